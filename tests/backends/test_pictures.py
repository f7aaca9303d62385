"""Pictures that stream are those that do not, to the bit, and leave nothing behind."""

import errno
import os
import signal
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings, strategies

from tests.backends.test_records import JOB, SETTINGS
from viewbench.backends import _evaluate, _train
from viewbench.backends._pictures import Pictures
from viewbench.backends.splat import stages
from viewbench.backends.splat.options import Rendering
from viewbench.backends.splat.team import Team
from viewbench.common.errors import UserError
from viewbench.scenes import images
from viewbench.scenes.images import Picture
from viewbench.scenes.load import open_scene
from viewbench.selectors import _run

SIZE = (4, 5, 3)


def picture(kind, rng):
    """One of the three ways in which a picture is kept."""
    if kind == "float":
        return Picture(rng.uniform(0, 1, SIZE).astype(np.float32), 1)
    one, dtype = (255, np.uint8) if kind == "byte" else (1020, np.uint16)
    return Picture(rng.integers(0, one + 1, SIZE).astype(dtype), one)


@settings(max_examples=40, deadline=None)
@given(strategies.lists(strategies.sampled_from(["byte", "sum", "float"]), max_size=7), strategies.integers(0, 1500))
def test_where_they_are_kept_changes_no_bit(tmp_path_factory, kinds, kept):
    rng = np.random.default_rng(len(kinds))
    given_ = [picture(kind, rng) for kind in kinds]
    wanted = [one.pixels() for one in given_]
    folder = tmp_path_factory.mktemp("pictures")
    for limit in (0, 1, SIZE[0] * SIZE[1] * 3, kept, 1 << 30):
        with Pictures(iter(given_), SIZE, folder, limit) as pictures:
            assert not list(folder.iterdir()), "the file has a name"
            assert pictures.shape == (len(kinds), *SIZE)
            assert len(pictures) == len(kinds)
            for place in np.random.default_rng(0).permutation(len(kinds)):  # in any order, and again
                for _ in range(2):
                    found = pictures[int(place)]
                    assert (found.dtype, found.tobytes()) == (np.float32, wanted[place].tobytes())
                    found[:] = -1  # nobody else's
            assert [one.tobytes() for one in pictures] == [one.tobytes() for one in wanted]
            assert np.asarray(pictures).tobytes() == b"".join(one.tobytes() for one in wanted)
            with pytest.raises(IndexError):
                pictures[len(kinds)]
            if kinds:
                assert (pictures[-1] == wanted[-1]).all()


def test_no_more_is_kept_than_was_said(tmp_path):
    given_ = [picture("byte", np.random.default_rng(0)) for _ in range(10)]
    with Pictures(given_, SIZE, tmp_path, 3 * 60 + 59) as pictures:
        assert len(pictures._kept) == 3
        assert os.fstat(pictures._file.fileno()).st_size == 7 * 60


def test_a_full_disk_is_one_sentence(tmp_path, monkeypatch):
    def full(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "pwrite", full)
    with pytest.raises(UserError, match=r"cannot be written to .*: No space left on device; free some space") as caught:
        Pictures([picture("byte", np.random.default_rng(0))], SIZE, tmp_path, 0)
    assert "\n" not in str(caught.value)
    assert not list(tmp_path.iterdir())


@pytest.fixture
def trained(small_room, tmp_path, monkeypatch):
    """The model that was trained with so many bytes for pictures, and for targets."""
    scene = open_scene(str(small_room), SETTINGS)
    chosen = _run.run(scene, "uniform", 5, 0)

    def run(pictures: int, targets: int) -> bytes:
        monkeypatch.setattr(_train, "KEPT_BYTES", pictures)
        monkeypatch.setattr(stages, "TARGETS", targets)
        monkeypatch.setattr(stages, "SMALLEST", 20)  # so that half the size comes first
        out = tmp_path / f"{pictures}-{targets}"
        _train.train(scene, chosen, JOB, out, settings=SETTINGS)
        assert not (out / _train.WORK).exists()
        return (out / "model.ply").read_bytes()

    return run


def test_a_training_that_streams_ends_in_the_same_bytes(trained):
    whole = trained(1 << 30, 1 << 30)
    assert trained(0, 0) == whole
    assert trained(64 * 64 * 6, 1 << 18) == whole


def test_what_a_failed_training_read_is_gone(trained, tmp_path, monkeypatch):
    held = []

    def fail(data, *_):
        held.append(data.images)
        raise UserError("it failed")

    monkeypatch.setattr("viewbench.backends.splat.loop.train", fail)
    with pytest.raises(UserError, match="it failed"):
        trained(0, 0)
    assert len(held[0]) == 0
    assert not (tmp_path / "0-0" / _train.WORK).exists()


def test_a_killed_process_leaves_no_file(tmp_path):
    code = f"""
import numpy as np, os, pathlib, sys
from viewbench.backends._pictures import Pictures
from viewbench.scenes.images import Picture
pictures = Pictures([Picture(np.zeros({SIZE}, np.uint8), 255)], {SIZE}, pathlib.Path(sys.argv[1]), 0)
os.kill(os.getpid(), {int(signal.SIGKILL)})
"""
    assert subprocess.run([sys.executable, "-c", code, str(tmp_path)], check=False).returncode == -signal.SIGKILL
    assert not list(tmp_path.iterdir())


def test_targets_that_are_made_anew_are_the_same(small_room, monkeypatch):
    scene = open_scene(str(small_room), SETTINGS)
    views, cameras = images.load_images(scene.train, np.arange(3), 48)
    found = []
    for limit in (0, 400_000, 1 << 30):
        monkeypatch.setattr(stages, "TARGETS", limit)
        for factor in (1, 2):
            stage = stages.Stage(views, cameras, 10, Rendering(), Team(), factor)
            found.append(b"".join(part.tobytes() for view in (2, 0, 1, 2) for part in stage.target(view)))
    assert found[0::2] == found[:1] * 3
    assert found[1::2] == found[1:2] * 3


def test_scoring_reads_every_test_view_once_and_one_at_a_time(small_room, tmp_path, monkeypatch):
    scene = open_scene(str(small_room), SETTINGS)
    chosen = _run.run(scene, "uniform", 3, 0)
    _train.train(scene, chosen, JOB, tmp_path, settings=SETTINGS)
    order = []

    def note(path, expected, real=images._read):
        order.append(path)
        return real(path, expected)

    def shown(*arguments, real=_evaluate.save_png):
        order.append("drawn")
        return real(*arguments)

    monkeypatch.setattr(images, "_read", note)
    monkeypatch.setattr(_evaluate, "save_png", shown)
    _evaluate.evaluate(tmp_path, scene, tmp_path, settings=SETTINGS)
    assert order[0::2] == list(scene.test.paths)
    assert set(order[1::2]) == {"drawn"}
