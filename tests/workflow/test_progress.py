import io
import logging
import re
import threading
from types import SimpleNamespace

import pytest

from tests.conftest import known
from viewbench.workflow._pace import Pace
from viewbench.workflow._progress import LINE_S, TICK_S, Progress, last_line


class Terminal(io.StringIO):
    def isatty(self):
        return True

    @property
    def line(self) -> str:
        """What stands on the line now."""
        return self.getvalue().split("\r")[-1].rstrip()


class Clock:
    """Stands still until a test moves it."""

    def __init__(self):
        self.now = 0.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock():
    return Clock()


def record(event, **values):
    entry = logging.LogRecord("snakemake", logging.INFO, "", 0, "", (), None)
    entry.event = SimpleNamespace(name=event)
    vars(entry).update(values)
    return entry


def study(stream, clock):
    """Ten cells of which four are there already; the other six are planned."""
    bar = Progress("mine", stream, clock)
    bar.says("planning", cells=10)
    bar.emit(record("RUN_INFO", stats={"select": 6, "train": 6, "evaluate": 6, "total": 18}))
    return bar


def begin(bar, number, rule, **wildcards):
    bar.emit(record("JOB_INFO", jobid=number, rule_name=rule, log=[], wildcards=wildcards))


def end(bar, number):
    bar.emit(record("JOB_FINISHED", job_id=number))


def run_cell(bar, number, clock=None, seconds=0.0):
    """A cell whose training takes so many seconds and whose other steps take no time."""
    for step, rule in enumerate(("select", "train", "evaluate")):
        begin(bar, 10 * number + step, rule)
        if clock and rule == "train":
            clock.now += seconds
        end(bar, 10 * number + step)


def test_cells_of_earlier_runs_count_as_done(clock):
    bar = study(io.StringIO(), clock)
    assert bar.done == 4
    assert "4 of 10 cells" in bar.text()
    run_cell(bar, 1)
    run_cell(bar, 2)
    assert bar.done == 6


def test_the_line_says_something_before_the_study_is_read(clock):
    for stream in (Terminal(), io.StringIO()):
        bar = Progress("mine", stream, clock)
        bar.tick()
        assert "reading the study mine, 0:00 min so far" in stream.getvalue()


def test_a_terminal_moves_every_second_though_no_job_ends(clock):
    terminal = Terminal()
    bar = study(terminal, clock)
    begin(bar, 1, "train")
    lines = set()
    for _ in range(5):
        clock.now += TICK_S
        bar.tick()
        lines.add(terminal.line)
    assert len(lines) == 5
    assert "\n" not in terminal.getvalue()


def test_a_file_gets_a_line_now_and_then_though_no_job_ends(clock):
    file = io.StringIO()
    bar = study(file, clock)
    begin(bar, 1, "train")
    before = file.getvalue().count("\n")
    for _ in range(round(5 * LINE_S / TICK_S)):
        clock.now += TICK_S
        bar.tick()
    assert file.getvalue().count("\n") == before + 5


def test_what_runs_is_said(clock):
    bar = study(io.StringIO(), clock)
    assert bar.text().endswith("; starting")
    begin(bar, 1, "warm", trainer="splat")
    begin(bar, 2, "features", scene="attic")
    assert bar.text().endswith("; preparing the kernels, features of attic")
    end(bar, 1)
    end(bar, 2)
    for number in range(3, 7):
        begin(bar, number, "select", scene="attic")
        end(bar, number)
    begin(bar, 7, "select", scene="attic")
    begin(bar, 8, "train", scene="attic")
    assert bar.text().endswith("; choosing: 5 of 6, training: 1 of 6")
    begin(bar, 9, "a_rule_that_is_new")
    assert bar.text().endswith("training: 1 of 6, a_rule_that_is_new")


def test_time_left_is_what_the_rest_takes_at_the_pace_so_far(clock):
    bar = study(io.StringIO(), clock)
    assert bar.pace.seconds_left is None
    clock.now = 100.0  # of preparations, which say nothing of the cells
    run_cell(bar, 1, clock, 30)
    run_cell(bar, 2, clock, 30)
    assert abs(known(bar.pace.seconds_left) - 120) < 1e-6  # two of six took a minute
    assert "about 2:00 min left" in bar.text()


def test_jobs_side_by_side_halve_the_time_and_what_runs_is_partly_done(clock):
    pace = Pace(clock)
    pace.plan({"train": 6})
    for first in (0, 2):
        pace.begin(first, "train", {})
        pace.begin(first + 1, "train", {})
        clock.now += 10
        if first == 0:
            pace.end(0)
            pace.end(1)
    assert abs(known(pace.seconds_left) - 10) < 1e-6  # two of six, and two that are at their end
    assert pace.doing() == "training: 4 of 6"


def test_one_training_is_enough_for_an_estimate_and_none_is_not(clock):
    """Scores of which none has ended are taken to cost what they cost beside such a training."""
    pace = Pace(clock)
    pace.plan({"train": 4, "evaluate": 4})
    pace.begin(0, "train", {})
    clock.now += 20
    assert pace.seconds_left is None
    pace.end(0)
    assert 60 < known(pace.seconds_left) < 60 + 4 * 20


def test_a_model_that_failed_is_not_waited_for(clock):
    pace = Pace(clock)
    pace.plan({"train": 2, "evaluate": 2})
    pace.begin(0, "train", {})
    pace.end(0, failed=True)
    assert (pace.left("train"), pace.left("evaluate")) == (1, 1)


def test_other_jobs_do_not_count(clock):
    bar = study(io.StringIO(), clock)
    begin(bar, 1, "features")
    end(bar, 1)
    end(bar, 99)
    assert bar.done == 4


def test_a_terminal_gets_one_line_and_a_file_gets_few(clock):
    terminal, file = Terminal(), io.StringIO()
    for stream in (terminal, file):
        bar = study(stream, clock)
        for number in range(1, 7):
            clock.now += 3
            run_cell(bar, number)
        begin(bar, 1, "publish")
        end(bar, 1)
        bar.tick()
        bar.tick()
    assert terminal.getvalue().count("\n") == 1
    assert "10 of 10 cells" in terminal.getvalue().splitlines()[-1].split("\r")[-1]
    assert 2 <= file.getvalue().count("\n") <= 4


def test_a_line_is_no_longer_than_the_terminal(clock, monkeypatch):
    monkeypatch.setenv("COLUMNS", "60")
    terminal = Terminal()
    bar = study(terminal, clock)
    for number, rule in enumerate(("select", "train", "evaluate", "features", "warm", "describe")):
        begin(bar, number, rule, scene="a-scene-of-a-long-name")
    bar.tick()
    assert 20 < len(terminal.line) < 60
    assert re.match(r"\[#+ +\] 4 of 10 cells", terminal.line)


def test_a_failure_is_named_with_the_last_words_of_its_log(tmp_path, clock):
    log = tmp_path / "train.log"
    log.write_text("train: 10 of 100\nviewbench: out of memory\n\n")
    stream = io.StringIO()
    bar = study(stream, clock)
    begin(bar, 7, "train")
    for _ in range(2):  # as some releases say it
        values = {"rule_name": "train", "output": ["cells/a/train.json"], "log": [f"{log} (check log)"]}
        bar.emit(record("JOB_ERROR", jobid=7, **values))
    assert stream.getvalue().count("failed: ") == 1
    assert "failed: train of cells/a/train.json: viewbench: out of memory" in stream.getvalue()
    assert "1 failed" in bar.text()
    assert "training" not in bar.text()
    assert last_line([]) == ""


def test_what_goes_wrong_with_the_line_reaches_nobody(clock):
    stream = io.StringIO()
    bar = study(stream, clock)
    bar.emit(record("JOB_INFO"))  # a release whose records have another form
    stream.close()
    bar.tick()
    bar.says("planning")
    run_cell(bar, 1)
    bar.stop()


def test_the_line_makes_room_for_what_snakemake_prints_and_ends_where_nothing_is_to_be_done(clock):
    terminal = Terminal()
    bar = Progress("mine", terminal, clock)
    bar.tick()
    quiet = record("JOB_INFO")
    warning = logging.LogRecord("snakemake", logging.WARNING, "", 0, "watch out", (), None)
    nothing = logging.LogRecord("snakemake", logging.INFO, "", 0, "Nothing to be done (all there).", (), None)
    assert not bar.passes(quiet)
    assert terminal.line
    assert bar.passes(warning)
    assert terminal.line == ""
    bar.tick()
    assert terminal.line
    assert bar.passes(nothing)
    bar.tick()
    assert terminal.line == ""


def test_the_thread_ends_with_the_line(clock):
    bar = Progress("mine", io.StringIO(), clock)
    bar.start()
    (thread,) = [thread for thread in threading.enumerate() if thread.name == "progress"]
    assert thread.daemon, "it never keeps a run from ending"
    bar.stop()
    thread.join(60)
    assert not thread.is_alive()
