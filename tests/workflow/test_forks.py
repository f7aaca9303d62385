"""Jobs that are forked from a prepared process behave as `viewbench` itself does, and never outlive who asked."""

import functools
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest

from tests.conftest import copy_package, environment_of, until
from viewbench.workflow import _fork_client, _fork_server

pytestmark = pytest.mark.skipif(not hasattr(os, "pidfd_open"), reason="jobs are forked on Linux alone")
COMMAND = '''
"""Does what a test asks."""
import os, signal, sys, time
from pathlib import Path
import click

@click.command()
@click.argument("what")
@click.argument("place", type=Path)
def command(what, place):
    """Does what a test asks."""
    if what == "report":
        print(Path.cwd(), os.environ.get("A_VARIABLE"), "numba" in sys.modules, "edited" if False else "as it was")
        print("beside it", file=sys.stderr)
    if what == "crash":
        raise ValueError("no luck")
    if what == "die":
        os.kill(os.getpid(), signal.SIGKILL)
    if what == "leave":
        sys.exit(7)
    if what == "wait":
        Path(place / "pid").write_text(f"{os.getpid()}\\n")
        try:
            time.sleep(600)
        except KeyboardInterrupt:
            Path(place / "stopped").touch()
            raise
'''


@pytest.fixture(scope="module")
def package(tmp_path_factory) -> Path:
    folder = copy_package(tmp_path_factory.mktemp("forks"))
    (folder / "workflow" / "commands" / "probe.py").write_text(COMMAND, encoding="utf-8")
    return folder


@pytest.fixture
def server(package, tmp_path) -> Iterator[subprocess.Popen]:
    address = tmp_path / "jobs"
    started = subprocess.Popen(
        _fork_server.command(str(address)), stdin=subprocess.PIPE, env=environment_of(package), cwd=tmp_path
    )
    until(address.exists)
    yield started
    started.communicate(timeout=60)


@pytest.fixture
def begin(package, tmp_path) -> Callable[..., subprocess.Popen]:
    """Starts `viewbench probe WHAT`, which finds the server where there is one."""

    def popen(*arguments: str, before: Callable[[], object] | None = None, **variables: str) -> subprocess.Popen:
        command = [sys.executable, "-m", "viewbench", *arguments]
        environment = {**environment_of(package), _fork_client.ADDRESS: str(tmp_path / "jobs"), **variables}
        pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
        # Tests that run in a shell's background have SIGINT ignored, which those that they start would inherit.
        usual = functools.partial(signal.signal, signal.SIGINT, signal.SIG_DFL)
        return subprocess.Popen(command, cwd=tmp_path, env=environment, preexec_fn=before or usual, **pipes)

    return popen


def ended(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return True
    return Path(f"/proc/{pid}/stat").read_text().split()[2] == "Z"


def waiting(begin, tmp_path) -> tuple[subprocess.Popen, int]:
    """A job that sleeps: its `viewbench` and its own process."""
    client = begin("probe", "wait", str(tmp_path))
    until(lambda: (tmp_path / "pid").is_file() and (tmp_path / "pid").read_text().endswith("\n"))
    pid = int((tmp_path / "pid").read_text())
    assert pid != client.pid
    return client, pid


def test_files_beside_the_results_are_no_modules(package, begin, tmp_path):
    for name in ("plyfile", "click", "queue"):
        (tmp_path / f"{name}.py").write_text("raise ImportError('this is not it')", encoding="utf-8")
    command, environment = _fork_server.command(str(tmp_path / "jobs")), environment_of(package)
    started = subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE, env=environment, cwd=tmp_path)
    until((tmp_path / "jobs").exists)
    # The server's folder is no place to look for its modules; `python -m viewbench` of a test would look there itself.
    client = begin("probe", "report", ".", PYTHONSAFEPATH="1")
    assert client.communicate(timeout=60)[1] == "beside it\n"
    assert client.returncode == 0
    _, errors = started.communicate(timeout=60)
    assert (started.returncode, errors) == (0, b"")
    assert not (tmp_path / "jobs").exists()


def test_who_is_gone_before_an_answer_leaves_no_job(server, begin, tmp_path):
    client = begin("probe", "wait", str(tmp_path))
    time.sleep(0.2)  # while the server imports
    client.kill()
    client.communicate(timeout=60)
    begin("probe", "report", ".").communicate(timeout=60)  # which comes after it
    if (tmp_path / "pid").is_file():
        until(lambda: ended(int((tmp_path / "pid").read_text() or 0)))


def test_a_signal_that_was_ignored_still_is(server, begin, tmp_path):
    client = begin("probe", "wait", str(tmp_path), before=lambda: signal.signal(signal.SIGINT, signal.SIG_IGN))
    until(lambda: (tmp_path / "pid").is_file() and (tmp_path / "pid").read_text().endswith("\n"))
    pid = int((tmp_path / "pid").read_text())
    for target in (client.pid, pid):
        os.kill(target, signal.SIGINT)
    time.sleep(0.5)
    assert not (tmp_path / "stopped").exists()
    assert not ended(pid)
    client.terminate()
    client.communicate(timeout=60)
    until(lambda: ended(pid))


def test_a_job_has_the_folder_the_variables_and_the_streams_of_who_asked(server, begin, tmp_path):
    client = begin("probe", "report", ".", A_VARIABLE="set here")
    out, err = client.communicate(timeout=60)
    assert (client.returncode, err) == (0, "beside it\n")
    assert out == f"{tmp_path} set here True as it was\n"


def test_without_a_server_a_command_runs_by_itself(begin, tmp_path):
    client = begin("probe", "report", ".")
    out, _ = client.communicate(timeout=60)
    assert (client.returncode, out) == (0, f"{tmp_path} None False as it was\n")


def test_a_job_reads_the_source_code_as_it_is(server, begin, package):
    path = package / "workflow" / "commands" / "probe.py"
    first = begin("probe", "report", ".").communicate(timeout=60)[0]
    path.write_text(COMMAND.replace("if False", "if True"), encoding="utf-8")
    second = begin("probe", "report", ".").communicate(timeout=60)[0]
    path.write_text(COMMAND, encoding="utf-8")
    assert (first.split()[-3:], second.split()[-1]) == (["as", "it", "was"], "edited")


@pytest.mark.parametrize(
    ("arguments", "status", "words"),
    [
        (["probe", "crash", "."], 1, "ValueError: no luck"),
        (["probe", "die", "."], 128 + signal.SIGKILL, ""),
        (["probe", "leave", "."], 7, ""),
        (["prob"], 2, "did you mean 'probe'"),
        (["train", "nowhere", "--selection", "none", "--out", "x"], 2, "nowhere"),
    ],
)
def test_how_a_job_ends_is_passed_on(server, begin, arguments, status, words):
    client = begin(*arguments)
    _, err = client.communicate(timeout=60)
    assert (client.returncode, words in err) == (status, True), err
    assert status != 2 or err.count("\n") == 1


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_signals_are_passed_on(server, begin, tmp_path, number):
    client, pid = waiting(begin, tmp_path)
    client.send_signal(number)
    _, err = client.communicate(timeout=60)
    assert (client.returncode, err.strip()) == (130, "viewbench: stopped")
    assert (tmp_path / "stopped").is_file()
    until(lambda: ended(pid))


def test_a_job_ends_with_who_asked(server, begin, tmp_path):
    client, pid = waiting(begin, tmp_path)
    client.kill()
    client.communicate(timeout=60)
    until(lambda: ended(pid))
    assert (tmp_path / "stopped").is_file()
    assert begin("probe", "leave", ".").wait(60) == 7, "the server goes on"


def test_jobs_end_with_the_run(server, begin, tmp_path):
    client, pid = waiting(begin, tmp_path)
    server.communicate(timeout=60)
    assert client.wait(60) != 0
    until(lambda: ended(pid))


def test_jobs_end_with_a_server_that_is_killed(server, begin, tmp_path):
    client, pid = waiting(begin, tmp_path)
    server.kill()
    _, err = client.communicate(timeout=60)
    assert (client.returncode, "is gone" in err) == (1, True)
    until(lambda: ended(pid))


@pytest.mark.parametrize(("local", "threads"), [(False, 1), (True, 2)])
def test_a_cluster_and_several_threads_have_no_server(monkeypatch, local, threads):
    monkeypatch.delenv(_fork_client.ADDRESS, raising=False)
    _fork_server.start(SimpleNamespace(local_exec=local), threads)
    assert _fork_client.ADDRESS not in os.environ
