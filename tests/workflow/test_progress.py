import io
import logging
from types import SimpleNamespace

from tests.conftest import known
from viewbench.workflow._progress import Progress, last_line


class Terminal(io.StringIO):
    def isatty(self):
        return True


def record(event, **values):
    entry = logging.LogRecord("snakemake", logging.INFO, "", 0, "", (), None)
    entry.event = SimpleNamespace(name=event)
    vars(entry).update(values)
    return entry


def study(stream, clock):
    """Ten cells of which four are there already; the other six are planned and two of them are run."""
    bar = Progress(10, stream, clock)
    bar.emit(record("RUN_INFO", stats={"select": 6, "train": 6, "evaluate": 6, "total": 18}))
    return bar


def run_cell(bar, number, log=()):
    for step, rule in enumerate(("select", "train", "evaluate")):
        bar.emit(record("JOB_INFO", jobid=10 * number + step, rule_name=rule, log=list(log)))
        bar.emit(record("JOB_FINISHED", job_id=10 * number + step))


def test_cells_of_earlier_runs_count_as_done():
    seconds = iter(range(0, 1000, 5))
    bar = study(io.StringIO(), lambda: next(seconds))
    assert bar.done == 4
    assert "4 of 10 cells" in bar.text()
    run_cell(bar, 1)
    run_cell(bar, 2)
    assert bar.done == 6


def test_time_left_is_what_the_rest_takes_at_the_pace_so_far():
    now = [0.0]
    bar = study(io.StringIO(), lambda: now[0])
    assert bar.seconds_left is None
    now[0] = 60.0
    run_cell(bar, 1)
    run_cell(bar, 2)
    assert abs(known(bar.seconds_left) - 120) < 1e-6  # two of six took a minute


def test_other_jobs_do_not_count():
    bar = study(io.StringIO(), lambda: 0.0)
    bar.emit(record("JOB_INFO", jobid=1, rule_name="features", log=[]))
    bar.emit(record("JOB_FINISHED", job_id=1))
    bar.emit(record("JOB_FINISHED", job_id=99))
    assert bar.done == 4


def test_a_terminal_gets_one_line_and_a_file_gets_few():
    terminal, file = Terminal(), io.StringIO()
    for stream in (terminal, file):
        now = [0.0]
        bar = study(stream, lambda now=now: now[0])
        for number in range(1, 7):
            now[0] += 3
            run_cell(bar, number)
        bar.emit(record("JOB_INFO", jobid=1, rule_name="page", log=[]))
        bar.emit(record("JOB_FINISHED", job_id=1))
    assert terminal.getvalue().count("\n") == 1
    assert "10 of 10 cells" in terminal.getvalue().splitlines()[-1].split("\r")[-1]
    assert 2 <= file.getvalue().count("\n") <= 4


def test_a_failure_is_named_with_the_last_words_of_its_log(tmp_path):
    log = tmp_path / "train.log"
    log.write_text("train: 10 of 100\nviewbench: out of memory\n\n")
    stream = io.StringIO()
    bar = study(stream, lambda: 0.0)
    for _ in range(2):  # as some releases say it
        bar.emit(record("JOB_ERROR", rule_name="train", output=["cells/a/train.json"], log=[f"{log} (check log)"]))
    assert stream.getvalue().count("failed: ") == 1
    assert "failed: train of cells/a/train.json: viewbench: out of memory" in stream.getvalue()
    assert "1 failed" in bar.text()
    assert last_line([]) == ""
