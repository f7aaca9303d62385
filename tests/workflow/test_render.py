"""`viewbench render` as people use it: rooms by name, how a path moves, mistakes, and a run that is killed."""

import importlib
import json
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from viewbench.common.files import sha256_folder
from viewbench.scenes.rooms import _points, _rendering, _visibility
from viewbench.workflow.commands import _main

ROOM = "kitchen_living"


def run(capsys, *arguments):
    """(exit status, standard output, standard error)."""
    status = _main.run(["render", *(str(argument) for argument in arguments)])
    captured = capsys.readouterr()
    return status, captured.out, captured.err


@pytest.fixture
def stand_in(monkeypatch):
    """In place of Cycles: pictures of one colour, and the sizes and threads that were asked for."""
    asked = []

    class Renderer:
        def __init__(self, room, size, threads=1):
            self.size = size
            asked.append((size, threads))

        def __enter__(self):
            return self

        def __exit__(self, *error):
            pass

        def render(self, c2w, samples, seed):
            return np.full((self.size, self.size, 3), (samples, seed % 256, 9), np.uint8)

    monkeypatch.setattr(_rendering, "available", lambda: None)
    monkeypatch.setattr(_rendering, "Renderer", Renderer)
    monkeypatch.setattr(_points, "seen", lambda room: (np.zeros((1, 3)), np.zeros((1, 3), np.uint8)))
    monkeypatch.setattr(_visibility, "seen_shares", lambda room, test, train: np.linspace(0.5, 1, len(test)))
    return asked


def test_a_capture_is_rendered_and_views_are_chosen_from_it(capsys, tmp_path, stand_in):
    out = tmp_path / "my room żółć"
    arguments = (ROOM, "--size", 32, "--out", out, "--frames")
    status, said, err = run(capsys, *arguments, 8, "--path", "smooth", "--jobs", 2)
    assert (status, said) == (0, f"8 of 8 train frames in {out}\n"), err
    assert run(capsys, *arguments, 2, "--path", "test")[0] == 0
    assert stand_in == [(32, 2), (32, 1)]
    assert _main.run(["select", str(out), "--count", "3", "--factors", "pos,ang", "--out", str(tmp_path / "few")]) == 0
    assert len(capsys.readouterr().out.splitlines()) == 3


def test_a_shard_says_what_is_missing(capsys, tmp_path, stand_in):
    arguments = (ROOM, "--size", 16, "--frames", 5, "--out", tmp_path / "out", "--shard")
    status, out, err = run(capsys, *arguments, "2/2")
    assert (status, out) == (0, f"2 of 5 train frames in {tmp_path / 'out'}\n")
    assert "viewbench: 3 frames are other shards'" in err
    assert run(capsys, *arguments, "1/2")[1].startswith("5 of 5")
    assert len(json.loads((tmp_path / "out" / "transforms_train.json").read_text())["frames"]) == 5


def test_what_training_views_see_of_the_test_views_is_printed(capsys, stand_in):
    status, out, err = run(capsys, ROOM, "--path", "test", "--frames", 6, "--dry-run")
    assert status == 0, err
    least = "0.50 (0), 0.60 (1), 0.70 (2), 0.80 (3), 0.90 (4)"
    assert [line for line in out.splitlines() if " sees " in line] == [
        f"{path} sees 0.750 of the test views' pixels in the mean; least (view): {least}"
        for path in ("human", "smooth")
    ]
    assert " sees " not in run(capsys, ROOM, "--frames", 6, "--dry-run")[1]


def test_how_a_path_moves_is_printed_beside_others(capsys, tmp_path):
    file = tmp_path / "hand.txt"
    times = np.arange(0, 4, 0.01)
    rows = [f"{time:.2f} {0.2 * time:.4f} 0 1.4 0.5 -0.5 0.5 -0.5\n" for time in times]  # at 0.2 m/s, without a turn
    file.write_text("".join(rows))
    status, out, err = run(capsys, ROOM, "--path", file, "--frames", 20, "--dry-run", "--beside", file)
    assert status == 0, err
    lines = out.splitlines()
    assert lines[0].startswith("hand.txt: 20 frames, ")
    assert {line.split()[0] for line in lines[2::2]} == {"hand.txt", "human", "smooth", "test"}
    shown = next(line.split()[2:] for line in lines if line.startswith("hand.txt "))
    assert {float(value) for value in shown} == {0.2}
    assert "viewbench: hand.txt: scaled by 1.000" in err
    assert list(tmp_path.iterdir()) == [file]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("attic", "--dry-run"), "unknown room 'attic'"),
        (("kitchen_livin", "--dry-run"), "did you mean 'kitchen-living'"),
        ((ROOM,), "give --out FOLDER, or --dry-run"),
        ((ROOM, "--dry-run", "--path", "humna"), "neither a path of kitchen_living (human, smooth, test) nor a file"),
        ((ROOM, "--dry-run", "--path", "."), "nor a file"),
        ((ROOM, "--dry-run", "--frames", "100000"), "--frames 100000 is more"),
        ((ROOM, "--dry-run", "--frames", "0"), "--frames"),
        ((ROOM, "--out", "x", "--shard", "3/2"), "I from 1 to N"),
        ((ROOM, "--out", "x", "--shard", "0/2"), "I from 1 to N"),
        ((ROOM, "--out", "x", "--shard", "2"), "--shard takes I/N"),
        ((ROOM, "--out", "x", "--beside", "y"), "--beside goes with --dry-run"),
        ((ROOM, "--dry-run", "--beside", "nowhere.txt"), "nowhere.txt"),
        ((ROOM, "--out", "x", "--size", "3"), "--size"),
    ],
)
def test_mistakes_are_told_in_one_line(capsys, tmp_path, monkeypatch, arguments, said):
    monkeypatch.chdir(tmp_path)
    status, out, err = run(capsys, *arguments)
    assert (status, out) == (2, "")
    assert said in err
    assert len(err.splitlines()) == 1
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(_rendering.available() is None, reason="bpy is installed here")
def test_without_bpy_the_command_says_so_and_writes_nothing(capsys, tmp_path):
    status, out, err = run(capsys, ROOM, "--out", tmp_path / "out")
    assert (status, out) == (2, "")
    assert err == f"viewbench: {_rendering.available()}\n"
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
@pytest.mark.skipif(_rendering.available() is not None, reason=str(_rendering.available()))
@pytest.mark.parametrize("signal_name", ["SIGINT", "SIGTERM", "SIGKILL"])
def test_blender_is_stopped_and_goes_on(tmp_path, signal_name):
    """stdout has the result alone, though Blender writes there; a stopped run's frames stay, and none is cut."""
    command = [sys.executable, "-m", "viewbench", "render", ROOM, "--size", "16", "--samples", "1", "--frames", "6"]
    once = subprocess.run([*command, "--out", tmp_path / "once"], capture_output=True, text=True)
    assert once.returncode == 0, once.stderr
    assert once.stdout == f"6 of 6 train frames in {tmp_path / 'once'}\n"
    again = [*command, "--out", str(tmp_path / "again")]
    first = subprocess.Popen(again, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    while first.poll() is None and not list(tmp_path.glob("again/train/0*")):
        time.sleep(0.01)
    first.send_signal(getattr(signal, signal_name))
    out, err = first.communicate()
    assert out == ""
    assert first.returncode == (-signal.SIGKILL if signal_name == "SIGKILL" else 130), err
    assert not (tmp_path / "again" / "transforms_train.json").exists()
    assert subprocess.run(again, capture_output=True).returncode == 0
    assert sha256_folder(tmp_path / "again") == sha256_folder(tmp_path / "once")


CELL = '''"""A bare cell."""

from ._builder import Builder
from ._materials import MATERIALS
from ._paths import constant_speed
from ._types import Room

ROUND = (((1, 1, 1), (3, 3, 1)), ((3, 1, 1), (1, 3, 1)), ((2, 3, 1), (2, 0, 1)))


def build() -> Room:
    cell = Builder()
    cell.sheet("glass", (0, 0, 0), (4, 0, 0), (0, 4, 0))
    meshes = cell.meshes()
    return Room(
        meshes=meshes,
        materials={name: MATERIALS[name] for name in meshes},
        textures={},
        lights=(),
        parts=tuple(cell.parts),
        inside=((0, 0, 0), (4, 4, 3)),
        paths={"smooth": lambda count: constant_speed(ROUND, count)},
        points_path=constant_speed(ROUND, 100),
    )
'''


def test_a_room_is_one_more_file(capsys, tmp_path, monkeypatch, stand_in):
    """Nothing else is edited: a file beside the rooms is listed, described and rendered."""
    rooms = importlib.import_module("viewbench.scenes.rooms")
    (tmp_path / "rooms").mkdir()
    (tmp_path / "rooms" / "bare_cell.py").write_text(CELL)
    monkeypatch.setattr(rooms, "__path__", [*rooms.__path__, str(tmp_path / "rooms")])
    try:
        assert _main.run(["list", "rooms"]) == 0
        assert "bare-cell       A bare cell." in capsys.readouterr().out
        arguments = ("bare-cell", "--frames", 5, "--path")
        assert run(capsys, *arguments, "smooth", "--dry-run")[1].startswith("smooth: 5 frames, 0.")
        assert "neither a path of bare_cell (smooth) nor a file" in run(capsys, *arguments, "human", "--dry-run")[2]
        assert run(capsys, *arguments, "smooth", "--out", tmp_path / "out", "--size", 16)[0] == 0
        assert len(list((tmp_path / "out" / "train").iterdir())) == 5
    finally:
        sys.modules.pop("viewbench.scenes.rooms.bare_cell", None)
