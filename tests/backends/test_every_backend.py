"""What every backend promises: one suite over all that can run here, the configured nearest-view program among them."""

import json
import shutil
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from tests.backends.conftest import nearest_command, settings_with
from viewbench.backends import _registry
from viewbench.backends._psnr import psnr_db
from viewbench.backends._train import WORK, train
from viewbench.backends._types import Budget
from viewbench.common import settings as settings_file
from viewbench.common.errors import UserError
from viewbench.common.settings import Settings
from viewbench.scenes.images import load_images
from viewbench.scenes.load import open_scene
from viewbench.scenes.types import Scene

SETTINGS = settings_with(nearest=nearest_command())
WIDTH = 48
ENOUGH = 400  # steps in which three small views are learnt


@pytest.fixture(params=_registry.names(SETTINGS))
def name(request):
    """A backend that can run here."""
    reason = _registry.load(request.param, SETTINGS).available()
    if reason:
        pytest.skip(f"{request.param}: {reason}")
    return request.param


@pytest.fixture
def backend(name):
    return _registry.load(name, SETTINGS)


@pytest.fixture
def scene(small_room) -> Scene:
    return open_scene(str(small_room), SETTINGS)


def selection_of(scene: Scene, indices: tuple[int, ...] = (0, 4, 8)) -> dict:
    names = [scene.train.names[i] for i in indices]
    return {"indices": list(indices), "names": names, "n_views": len(scene.train), "selector": "random", "seed": 0}


def train_cell(scene: Scene, name: str, out: Path, budget: Budget | None = None, **more) -> dict:
    arguments = {"settings": SETTINGS, "seed": 0, "width": WIDTH, "curve": False, **more}
    return train(scene, selection_of(scene), name, out, budget=budget or Budget(iterations=20), **arguments)


def test_three_views_are_learnt(scene, name, backend, tmp_path):
    record = train_cell(scene, name, tmp_path / "m", Budget(iterations=ENOUGH))
    views, cameras = load_images(scene.train, np.array([0, 4, 8]), WIDTH)
    for render, view in zip(backend.render(tmp_path / "m", cameras), views, strict=True):
        flat = np.broadcast_to(view.mean(axis=(0, 1)), view.shape)
        assert psnr_db(render, view) > psnr_db(flat, view) + 4
    assert record == json.loads((tmp_path / "m" / "train.json").read_text())
    assert (record["backend"], record["count"], record["width"]) == (name, 3, WIDTH)
    assert record["version"]


def test_renders_have_the_size_of_their_cameras_and_colours_between_0_and_1(scene, name, backend, tmp_path):
    train_cell(scene, name, tmp_path / "m")
    for width in (20, 64):
        cameras = scene.test.cameras.scaled(width)
        images = list(backend.render(tmp_path / "m", cameras))
        assert len(images) == len(cameras)
        for image, height in zip(images, cameras.height, strict=True):
            assert (image.shape, image.dtype) == ((height, width, 3), np.float32)
            assert 0 <= image.min() <= image.max() <= 1


def test_same_seed_same_model(scene, name, backend, tmp_path):
    if not backend.CAPABILITIES.deterministic and name != "command:nearest":
        pytest.skip(f"{name} does not promise it")
    renders = []
    for folder in ("a", "b"):
        train_cell(scene, name, tmp_path / folder, seed=5)
        renders.append(np.stack(list(backend.render(tmp_path / folder, scene.test.cameras[:2].scaled(WIDTH)))))
    assert np.array_equal(*renders)


@pytest.mark.parametrize("limit", ["iterations", "seconds"])
def test_budget_is_obeyed_or_refused(scene, name, backend, tmp_path, limit):
    if getattr(backend.CAPABILITIES, limit):
        limits = {"iterations": 10**7, limit: {"iterations": 7, "seconds": 0.5}[limit]}
        record = train_cell(scene, name, tmp_path / "m", Budget(**limits))
        assert 0 < record["iterations"] <= (7 if limit == "iterations" else 10**6)
        assert record["budget"][limit] == limits[limit]
    else:
        with pytest.raises(UserError, match=f"cannot limit its {limit}"):
            train_cell(scene, name, tmp_path / "m", Budget(**{limit: 5}))
        assert not (tmp_path / "m").exists()


def test_impossible_requests_are_refused_in_one_line(scene, name, tmp_path):
    wrong = selection_of(scene)
    wrong["indices"] = [0, 4, len(scene.train)]
    requests = {
        "has no option 'itterations'": {"options": {"itterations": 3}},
        "expected something like": {"options": {"points": 3}},
        "points": {"options": {"points": "nowhere"}},
    }
    for message, request in requests.items():
        with pytest.raises(UserError, match=message) as caught:
            train_cell(scene, name, tmp_path / "m", **request)
        assert "\n" not in str(caught.value)
    with pytest.raises(UserError, match="distinct and in"):
        train(scene, wrong, name, tmp_path / "m", settings=SETTINGS, seed=0, budget=Budget(iterations=3), width=WIDTH)
    assert not (tmp_path / "m" / "train.json").exists()
    assert not (tmp_path / "m" / WORK).exists()


def test_no_test_image_is_read_while_training(small_room, name, tmp_path):
    room = tmp_path / "room"
    shutil.copytree(small_room, room)
    for file in (room / "test").iterdir():
        file.write_bytes(b"garbage")
    scene = open_scene(str(room), SETTINGS)
    assert train_cell(scene, name, tmp_path / "m")["iterations"] > 0
    with pytest.raises(UserError, match="cannot be read"):
        train_cell(scene, name, tmp_path / "n", curve=True)  # the curve, which is scored on test views, does read them


def test_a_killed_run_leaves_nothing_half_written(small_room, scene, name, tmp_path):
    (tmp_path / "selection.json").write_text(json.dumps(selection_of(scene)))
    settings = write_settings(tmp_path / "environment.toml", SETTINGS)
    assert _registry.names(settings_file.load(settings)) == _registry.names(SETTINGS)
    command = [sys.executable, "-m", "viewbench", "train", str(small_room), "--backend", name]
    command += ["--selection", str(tmp_path / "selection.json"), "--width", str(WIDTH), "--out", str(tmp_path / "m")]
    environment = {"VIEWBENCH_ENVIRONMENT": str(settings), "PATH": str(Path(sys.executable).parent)}
    assert killed_in_the_middle([*command, "--iterations", "100000"], tmp_path / "m", environment)
    assert [path.name for path in (tmp_path / "m").iterdir()] == [WORK]
    done = subprocess.run([*command, "--iterations", "5"], env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "m" / "train.json").is_file()
    assert not (tmp_path / "m" / WORK).exists()


def killed_in_the_middle(command: list[str], out: Path, environment: dict[str, str]) -> bool:
    """Kills the command as soon as its work is on disk; again where it was faster, which a small program may be."""
    for _ in range(5):
        shutil.rmtree(out, ignore_errors=True)
        process = subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        while process.poll() is None and not any((out / WORK / "model").glob("*")):
            if (out / WORK / "model").is_dir() and "command" not in " ".join(command):
                time.sleep(1)  # a trainer in this process writes its model at the end
                break
            time.sleep(0.001)
        process.kill()
        if process.wait() != 0:
            return True
    return False


def write_settings(path: Path, settings: Settings) -> Path:
    """The configured programs as an environment.toml."""
    sections = []
    for name, entry in settings.command.items():
        keys = "\n".join(f"{key} = {json.dumps(getattr(entry, key))}" for key in ("train", "render"))
        sections.append(f"[command.{name}]\n{keys}\n")
    path.write_text("\n".join(sections), encoding="utf-8")
    return path
