"""Rendering a path into a folder: whole frames, going on after a stop, shards, and recorded trajectories fitted in."""

import contextlib
import inspect
import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image
from plyfile import PlyData

from viewbench.common import extras, plugins
from viewbench.common.errors import UserError
from viewbench.common.settings import PACKAGE
from viewbench.scenes.formats import transforms
from viewbench.scenes.rooms import _capture, _fitting, _pace, _points, _rendering, _visibility
from viewbench.scenes.rooms._clearance import CLEARANCE_M, clearance
from viewbench.scenes.types import OPENCV

SHIPPED = PACKAGE / "scenes" / "generated_room"
ROOM = plugins.load("scenes.rooms", "kitchen-living").build()


class StandIn:
    """Renders a flat picture whose colour tells pose, samples and seed; may stop at its n-th frame, as Ctrl-C does."""

    def __init__(self, size: int, stop_at: int | None = None) -> None:
        self.size, self.stop_at, self.calls = size, stop_at, []

    def render(self, c2w: np.ndarray, samples: int, seed: int) -> np.ndarray:
        if len(self.calls) == self.stop_at:
            raise KeyboardInterrupt
        self.calls.append(seed)
        colour = [seed % 251, samples * 10 % 251, int(abs(c2w[0, 3]) * 40) % 251]
        return np.full((self.size, self.size, 3), colour, np.uint8)


def points(room: object) -> tuple[np.ndarray, np.ndarray]:
    return np.arange(6.0).reshape(2, 3), np.array([[1, 2, 3], [4, 5, 6]], np.uint8)


def shares(room: object, test: np.ndarray, train: np.ndarray) -> np.ndarray:
    return np.linspace(0.5, 1, len(test)) * (len(train) / 10)


def job(path: str = "human", count: int = 6, **other: object) -> _capture.Job:
    walk = ROOM.paths[path](count)
    given: dict = {"room": "kitchen_living", "path": path, "times": walk.times, "c2w": walk.c2w, **LOOK}
    given["split"] = "test" if path == "test" else "train"
    given |= other
    return _capture.Job(**given)


LOOK = {"size": 16, "samples": 4}


def run(out: Path, made: _capture.Job, shard: tuple[int, int] = (1, 1), stop_at: int | None = None) -> list[int]:
    """Renders, and returns the seeds of the frames rendered."""
    renderer = StandIn(made.size, stop_at)
    with contextlib.suppress(KeyboardInterrupt):
        _capture.write(
            out, made, ROOM, lambda: contextlib.nullcontext(renderer), points, shares, shard, lambda *_: None
        )
    return renderer.calls


def content(out: Path) -> dict[str, bytes]:
    return {file.relative_to(out).as_posix(): file.read_bytes() for file in out.rglob("*") if file.is_file()}


def test_the_stand_in_has_the_real_ones_signature():
    assert inspect.signature(StandIn.render) == inspect.signature(_rendering.Renderer.render)
    assert inspect.signature(points).return_annotation == inspect.signature(_points.seen).return_annotation
    asked = list(inspect.signature(_visibility.seen_shares).parameters)
    assert asked[:3] == list(inspect.signature(shares).parameters)


def test_a_capture_is_in_the_form_of_the_shipped_one(tmp_path):
    run(tmp_path, job())
    run(tmp_path, job("test", 3))
    for split, folder in (("train", "human"), ("test", "human")):
        ours = json.loads((tmp_path / f"transforms_{split}.json").read_text())
        theirs = json.loads((SHIPPED / folder / f"transforms_{split}.json").read_text())
        assert list(ours) == list(theirs)
        assert ours["camera_angle_x"] == theirs["camera_angle_x"]
        assert ours["fl_x"] == pytest.approx(theirs["fl_x"] * 16 / 256)
        assert ours["frames"][0] == theirs["frames"][0]
    seen = json.loads((tmp_path / "seen_test.json").read_text())["seen"]
    assert seen == {"test/0000.png": 0.3, "test/0001.png": 0.45, "test/0002.png": 0.6}
    scene = transforms.read(tmp_path)
    assert (len(scene.train), len(scene.test)) == (6, 3)
    assert scene.points is not None
    assert scene.points.xyz.tolist() == [[0, 1, 2], [3, 4, 5]]
    with Image.open(tmp_path / "test" / "0001.png") as image:
        assert image.getpixel((0, 0))[:2] == (100_001 % 251, 160)  # type: ignore[index]


def test_what_is_seen_is_found_anew_for_other_frames(tmp_path):
    run(tmp_path, job())
    run(tmp_path, job("test", 4))
    before = (tmp_path / "seen_test.json").read_bytes()
    run(tmp_path, job("test", 4))
    assert (tmp_path / "seen_test.json").read_bytes() == before
    for name in ("render_test.json", "transforms_test.json"):
        (tmp_path / name).unlink()
    for frame in (tmp_path / "test").iterdir():
        frame.unlink()
    run(tmp_path, job("test", 3))
    assert len(json.loads((tmp_path / "seen_test.json").read_text())["seen"]) == 3


def test_a_render_begun_without_a_quality_goes_on_and_test_frames_have_none(tmp_path):
    run(tmp_path, job(), stop_at=2)
    record = json.loads((tmp_path / "render_train.json").read_text())
    del record["quality"]
    (tmp_path / "render_train.json").write_text(json.dumps(record))
    with pytest.raises(UserError, match="quality 95, not 80"):
        run(tmp_path, job(quality=80))
    assert run(tmp_path, job()) == [2, 3, 4, 5]
    run(tmp_path, job("test", 3), stop_at=1)
    assert run(tmp_path, job("test", 3, quality=80)) == [100_001, 100_002]


def test_a_stopped_run_goes_on_and_ends_as_an_unbroken_one(tmp_path):
    run(tmp_path / "once", job())
    assert run(tmp_path / "twice", job(), stop_at=2) == [0, 1]
    assert not (tmp_path / "twice" / "transforms_train.json").exists()
    (tmp_path / "twice" / "train" / ".part-left.jpg").write_bytes(b"of a run that was killed")
    cut = tmp_path / "twice" / "train" / "0001.jpg"
    cut.write_bytes(cut.read_bytes()[:-200])
    assert run(tmp_path / "twice", job()) == [1, 2, 3, 4, 5]
    assert content(tmp_path / "twice") == content(tmp_path / "once")
    assert run(tmp_path / "twice", job()) == []


def test_shards_share_the_frames(tmp_path):
    run(tmp_path / "whole", job())
    assert run(tmp_path / "shared", job(), (2, 2)) == [1, 3, 5]
    assert not (tmp_path / "shared" / "transforms_train.json").exists()
    assert run(tmp_path / "shared", job(), (1, 2)) == [0, 2, 4]
    assert content(tmp_path / "shared") == content(tmp_path / "whole")
    assert run(tmp_path / "shared", job(), (9, 9)) == []


@pytest.mark.parametrize(
    ("other", "said"),
    [
        ({"size": 32}, "size 16, not 32"),
        ({"samples": 8}, "samples 4, not 8"),
        ({"path": "smooth"}, "path human, not smooth"),
        ({"room": "attic"}, "room kitchen_living, not attic"),
        ({"c2w": job().c2w + 1}, "another state"),
    ],
)
def test_another_render_is_not_mixed_in(tmp_path, other, said):
    run(tmp_path, job(), stop_at=1)
    before = content(tmp_path)
    with pytest.raises(UserError, match=said):
        run(tmp_path, job(**other))
    assert content(tmp_path) == before


def test_test_frames_go_only_with_training_frames_of_the_same_room_and_size(tmp_path):
    run(tmp_path, job())
    with pytest.raises(UserError, match="size 16, not 32"):
        run(tmp_path, job("test", 2, size=32))
    assert run(tmp_path, job("test", 2, samples=1)) == [100_000, 100_001]


def test_a_folder_of_something_else_is_left_alone(tmp_path):
    (tmp_path / "photo.jpg").write_bytes(b"mine")
    with pytest.raises(UserError, match="no render of a room"):
        run(tmp_path, job())
    with pytest.raises(UserError, match="is a file"):
        run(tmp_path / "photo.jpg", job())
    (tmp_path / "begun").mkdir()
    (tmp_path / "begun" / ".part-record.json").touch()  # by another shard, at this moment
    assert run(tmp_path / "begun", job(), (1, 3)) == [0, 3]
    (tmp_path / "broken").mkdir()
    (tmp_path / "broken" / "render_train.json").write_text("[1]")
    with pytest.raises(UserError, match="another folder"):
        run(tmp_path / "broken", job())
    assert (tmp_path / "photo.jpg").read_bytes() == b"mine"


def test_points_are_written_as_the_shipped_ones(tmp_path):
    """The shipped file, read by plyfile and written again, is the same byte for byte."""
    row = PlyData.read(SHIPPED / "points3d.ply")["vertex"].data
    xyz, rgb = (np.stack([row[name] for name in names], 1) for names in (("x", "y", "z"), ("red", "green", "blue")))
    _points.write(tmp_path / "again.ply", xyz, rgb)
    assert (tmp_path / "again.ply").read_bytes() == (SHIPPED / "points3d.ply").read_bytes()


def trajectory(file: Path, centre: tuple, radius: float, n: int = 300) -> Path:
    """A TUM file of a round, the camera looking ahead, level (z up); written as TUM's tools do."""
    angles = np.linspace(0, 2 * np.pi, n)
    rows = []
    for i, angle in enumerate(angles):
        forward = np.array([-np.sin(angle), np.cos(angle), 0])
        turn = np.stack([np.cross(forward, [0, 0, 1]), [0, 0, -1], forward], 1)  # OpenCV: right, down, forward
        w = np.sqrt(max(0, 1 + np.trace(turn))) / 2
        if w < 1e-3:
            continue
        x, y, z = ((turn[2, 1] - turn[1, 2]), (turn[0, 2] - turn[2, 0]), (turn[1, 0] - turn[0, 1]))
        place = np.array(centre) + radius * np.array([np.cos(angle), np.sin(angle), 0])
        rows.append([1e9 + i / 30, *place, x / 4 / w, y / 4 / w, z / 4 / w, w])
    file.write_text("# time tx ty tz qx qy qz qw\n" + "".join(" ".join(f"{v:.9f}" for v in row) + "\n" for row in rows))
    return file


def test_a_trajectory_that_fits_keeps_its_form(tmp_path):
    fit = _fitting.fitted(trajectory(tmp_path / "täglich 1.txt", (90, -40, 1.5), 0.3), ROOM, 100)
    places = fit.c2w[:, :3, 3]
    assert clearance(ROOM, places).min() >= CLEARANCE_M
    assert "scaled by 1.000" in fit.notes[0]
    assert "no pose moved" in fit.notes[1]
    middle = (places.min(axis=0) + places.max(axis=0)) / 2
    assert np.allclose(np.linalg.norm(places - middle, axis=1), 0.3, atol=0.01)
    assert middle[2] == pytest.approx(1.5, abs=1e-6)
    steps = np.diff(places, axis=0)
    forward = -fit.c2w[:-1, :3, 2]
    cosine = np.einsum("nk,nk->n", steps, forward) / np.linalg.norm(steps, axis=1)
    assert np.median(cosine) > 0.99, "it looks ahead as it did"
    assert fit.times[0] == 0
    assert np.diff(fit.times).min() > 0


@pytest.mark.parametrize(("radius", "height"), [(1.6, 0.5), (30.0, 1.5), (0.5, -7.0)])
def test_a_trajectory_that_does_not_fit_is_brought_in_and_it_is_said(tmp_path, radius, height):
    file = trajectory(tmp_path / "round.txt", (0, 0, height), radius)
    first, second = (_fitting.fitted(file, ROOM, 80) for _ in range(2))
    assert clearance(ROOM, first.c2w[:, :3, 3]).min() >= CLEARANCE_M - 1e-9
    assert np.array_equal(first.c2w, second.c2w)
    assert np.array_equal(first.c2w[[0, -1]], _fitting.fitted(file, ROOM, 2).c2w), "the same way for any count"
    assert np.allclose(first.c2w[:, 2, 1], 1), "up stays up"
    if radius > 10:
        scale = float(first.notes[0].split()[2])
        assert 0 < scale < 0.1
    if radius == 1.6:  # through furniture at this height
        moved, n = (int(word) for word in first.notes[1].split(" poses")[0].split(" of "))
        assert 0 < moved <= n


def test_what_is_no_trajectory_is_said(tmp_path):
    file = trajectory(tmp_path / "round.txt", (0, 0, 1), 1)
    with pytest.raises(UserError, match=r"rows; --frames 1000 is more"):
        _fitting.fitted(file, ROOM, 1000)
    (tmp_path / "x.txt").write_text("1 2 3\n")
    with pytest.raises(UserError, match="8 of time"):
        _fitting.fitted(tmp_path / "x.txt", ROOM, 1)
    with pytest.raises(UserError, match="--frames 5000 is more"):
        ROOM.paths["human"](5000)


def test_frames_are_never_the_same_twice():
    for name, path in ROOM.paths.items():
        walk = path(1000)
        assert len(walk) == 1000, name
        assert (np.diff(walk.times) > 0).all(), name


def test_pace_of_a_known_motion():
    """1 m/s and 90 degrees a second, at 100 Hz; a tenth as fast over a quarter of the time."""
    times = np.arange(0, 10, 0.01)
    c2w = np.tile(np.eye(4), (len(times), 1, 1))
    way = np.where(times < 2.5, 0.1 * times, 0.25 + times - 2.5)
    angle = way * np.pi / 2
    c2w[:, 0, 3] = way
    c2w[:, 0, 0], c2w[:, 0, 1], c2w[:, 1, 0], c2w[:, 1, 1] = np.cos(angle), -np.sin(angle), np.sin(angle), np.cos(angle)
    speed, turn = _pace.pace(times, c2w @ OPENCV)
    assert speed[[0, 2, 5]] == pytest.approx([0.1, 1, 1])
    assert turn[[0, 2, 5]] == pytest.approx([9, 90, 90])
    assert np.isnan(_pace.pace(times[:1], c2w[:1])[0]).all()
    assert len(_pace.table({"a": (times, c2w), "b": (times, c2w)})) == 5


def test_real_frames_are_those_that_ship(tmp_path):
    """Of training frames the pixels are the shipped ones but for what processors differ in; points are the same."""
    if extras.missing("bpy"):
        pytest.skip(str(_rendering.available()))
    made = job("human", 400, size=256)
    with _rendering.Renderer(ROOM, 256) as renderer:
        for i in (0, 200):
            ours = renderer.render(made.c2w[i], 4, i)
            Image.fromarray(ours).save(tmp_path / "frame.jpg", quality=95, subsampling=0)
            images = (tmp_path / "frame.jpg", SHIPPED / "human" / "train" / f"{i:04d}.jpg")
            first, second = (np.asarray(Image.open(file)).astype(int) for file in images)
            assert np.abs(first - second).mean() < 0.5
            assert np.percentile(np.abs(first - second), 99.9) <= 8
        assert np.array_equal(ours, renderer.render(made.c2w[200], 4, 200))
    _points.write(tmp_path / "points3d.ply", *_points.seen(ROOM))
    assert (tmp_path / "points3d.ply").read_bytes() == (SHIPPED / "points3d.ply").read_bytes()


def test_without_bpy_one_line_says_what_it_wants(monkeypatch):
    monkeypatch.setattr(extras, "importlib", SimpleNamespace(util=SimpleNamespace(find_spec=lambda name: None)))
    said = _rendering.available()
    assert said is not None
    assert "pip install 'viewbench[render]'" in said
    assert "environment of its own" in said
    assert "\n" not in said
