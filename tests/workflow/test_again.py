"""What may pass is tried again in a fresh process, also by the fork server; what will not is not."""

import os
import subprocess
import sys
import time

import pytest

from tests.conftest import known, until
from viewbench.backends import _passing
from viewbench.common.errors import PassingError, UserError
from viewbench.common.settings import PACKAGE
from viewbench.workflow import _again, _fork_client, _fork_server

# Fails as often as it is told to, and leaves a line for each time that it was begun.
PROGRAM = """
import os, signal, sys
from pathlib import Path
how, times, out = sys.argv[1], int(sys.argv[2]), Path(sys.argv[3])
begun = Path(sys.argv[4])
with open(begun, "a") as file:
    print(os.environ.get("CUDA_VISIBLE_DEVICES", "all"), file=file)
if len(begun.read_text().splitlines()) <= times:
    if how == "killed":
        os.kill(os.getpid(), signal.SIGKILL)
    sys.exit({"full": "RuntimeError: CUDA out of memory. Tried to allocate 2.00 GiB", "wrong": "no such flag"}[how])
(out / "model").write_text("good")
"""


@pytest.fixture
def place(small_room, tmp_path, run_viewbench):
    (tmp_path / "program.py").write_text(PROGRAM, encoding="utf-8")
    chosen = tmp_path / "chosen.json"
    done = run_viewbench("select", small_room, "--selector", "uniform", "--count", 2, "--selection", chosen)
    assert done.returncode == 0, done.stderr
    return tmp_path


def train(place, small_room, how, times, server=None, wait="0", **variables):
    entry = [sys.executable, str(place / "program.py"), how, str(times), "{out}", str(place / "begun"), "{iterations}"]
    text = f"[compute]\nretry_wait = {wait}\n[command.odd]\ntrain = {entry!r}\nrender = ['true']\n"
    (place / "environment.toml").write_text(text, encoding="utf-8")
    arguments = [small_room, "--selection", place / "chosen.json", "--backend", "command:odd", "--out", place / "model"]
    command = [sys.executable, "-m", "viewbench", "train", *map(str, arguments)]
    environment = {**os.environ, "VIEWBENCH_ENVIRONMENT": str(place / "environment.toml"), **variables}
    if server is not None:
        environment[_fork_client.ADDRESS] = str(server)
    return subprocess.Popen(
        command, cwd=PACKAGE, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )


def begun(place):
    return len((place / "begun").read_text().splitlines())


@pytest.mark.parametrize("how", ["full", "killed"])
def test_a_lack_of_memory_is_tried_again(place, small_room, how):
    process = train(place, small_room, how, 2)
    _, said = process.communicate(timeout=120)
    assert process.returncode == 0, said
    assert begun(place) == 3
    assert said.count("tried again in 0 s") == 2
    assert (place / "model" / "train.json").is_file()


def test_one_that_stays_is_said_in_the_end(place, small_room):
    process = train(place, small_room, "full", 99)
    _, said = process.communicate(timeout=120)
    assert (process.returncode, begun(place)) == (_again.PASSING, 3)
    assert said.splitlines()[-1].endswith("CUDA out of memory. Tried to allocate 2.00 GiB")
    assert not (place / "model" / "train.json").exists()


def test_what_will_not_pass_is_not_tried_again(place, small_room):
    process = train(place, small_room, "wrong", 99)
    _, said = process.communicate(timeout=120)
    assert (process.returncode, begun(place)) == (2, 1)
    assert "no such flag" in said


def test_none_is_tried_again_where_nobody_wants_it(place, small_room):
    process = train(place, small_room, "full", 1, VIEWBENCH_COMPUTE_RETRIES="0")
    process.communicate(timeout=120)
    assert (process.returncode, begun(place)) == (_again.PASSING, 1)


def test_a_job_of_a_study_is_tried_again_and_sees_all_devices_again(place, small_room):
    address = place / "jobs"
    server = subprocess.Popen(
        _fork_server.command(str(address)), stdin=subprocess.PIPE, env=dict(os.environ), cwd=PACKAGE
    )
    try:
        until(address.exists)
        process = train(place, small_room, "full", 1, server=address)
        _, said = process.communicate(timeout=120)
    finally:
        server.communicate(timeout=60)
    assert process.returncode == 0, said
    assert (place / "begun").read_text().splitlines() == ["all", "all"]


def test_a_wait_can_be_stopped(place, small_room):
    process = train(place, small_room, "full", 1, wait="600")
    until((place / "begun").is_file)
    said = known(process.stderr)
    while "tried again" not in said.readline():
        pass
    time.sleep(1)  # it starts again, and then waits
    process.terminate()
    process.communicate(timeout=60)
    assert process.returncode != 0
    assert begun(place) == 1


@pytest.mark.parametrize(
    "error",
    [
        MemoryError(),
        RuntimeError("CUDA error: out of memory\nCUDA kernel errors might be reported later"),
        RuntimeError("CUDA error: all CUDA-capable devices are busy or unavailable"),
        OSError(116, "Stale file handle", "a.png"),
    ],
)
def test_what_may_pass(error):
    with pytest.raises(PassingError) as caught, _passing.named("backend 'x'", "3 views"):
        raise error
    assert str(caught.value).count("\n") == 0


@pytest.mark.parametrize(
    "error",
    [UserError("no"), RuntimeError("shapes do not match"), OSError(28, "No space left on device"), KeyError("a")],
)
def test_what_will_not_pass(error):
    with pytest.raises(type(error)) as caught, _passing.named("backend 'x'", "3 views"):
        raise error
    assert caught.value is error


def test_words_of_torch_s_own_error():
    torch = pytest.importorskip("torch")
    expected = pytest.raises(PassingError, match="ran out of memory with 3 views: CUDA out of memory")
    with expected, _passing.named("backend 'x'", "3 views"):
        raise torch.cuda.OutOfMemoryError("CUDA out of memory. Tried to allocate 20.00 MiB")
