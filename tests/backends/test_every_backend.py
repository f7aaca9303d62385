"""What every backend promises: one suite over all that can run here.

The configured nearest-view program is among them, and instant-ngp's adapter with a stand-in for its compiled module.
"""

import json
import shutil
import subprocess
import sys
import time
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

from tests.backends.conftest import make_checkout, nearest_command, settings_with
from viewbench.backends import _registry
from viewbench.backends._psnr import psnr_db
from viewbench.backends._train import WORK, train
from viewbench.backends._types import SHARED, Budget, Job, Seeding
from viewbench.common import holding
from viewbench.common.errors import UserError
from viewbench.common.settings import InstantNgp, Settings
from viewbench.common.settings import load as load_settings
from viewbench.scenes.images import load_images
from viewbench.scenes.load import open_scene
from viewbench.scenes.types import Scene

PROGRAMS = settings_with(nearest=nearest_command())
WIDTH = 48
ENOUGH = 400  # steps in which three small views are learnt


@pytest.fixture(scope="module")
def settings(tmp_path_factory) -> Settings:
    """Settings in which everything is configured that can be: the user's instant-ngp, or else one with a stand-in."""
    real = load_settings().instant_ngp
    if real.path:
        return replace(PROGRAMS, instant_ngp=real)
    checkout = make_checkout(tmp_path_factory.mktemp("external") / "instant-ngp")
    return replace(PROGRAMS, instant_ngp=InstantNgp(path=str(checkout)))


@pytest.fixture(params=_registry.names(PROGRAMS))
def name(request, settings):
    """A backend that can run here."""
    reason = _registry.load(request.param, settings).available()
    if reason:
        pytest.skip(f"{request.param}: {reason}")
    return request.param


@pytest.fixture
def backend(name, settings):
    return _registry.load(name, settings)


@pytest.fixture
def scene(small_room, settings) -> Scene:
    return open_scene(str(small_room), settings)


@pytest.fixture
def train_cell(settings):
    """Trains three views of a scene for a few steps."""

    def run(scene: Scene, name: str, out: Path, budget: Budget | None = None, **more) -> dict:
        job = Job(name, budget=budget or Budget(iterations=20), **{"seed": 0, "width": WIDTH, "curve": False, **more})
        return train(scene, selection_of(scene), job, out, settings=settings)

    return run


def selection_of(scene: Scene, indices: tuple[int, ...] = (0, 4, 8)) -> dict:
    names = [scene.train.names[i] for i in indices]
    return {"indices": list(indices), "names": names, "n_views": len(scene.train), "selector": "random", "seed": 0}


def test_three_views_are_learnt(scene, name, backend, tmp_path, train_cell):
    record = train_cell(scene, name, tmp_path / "m", Budget(iterations=ENOUGH))
    views, cameras = load_images(scene.train, np.array([0, 4, 8]), WIDTH)
    for render, view in zip(backend.render(tmp_path / "m", cameras), views, strict=True):
        flat = np.broadcast_to(view.mean(axis=(0, 1)), view.shape)
        assert psnr_db(render, view) > psnr_db(flat, view) + 4
    assert record == json.loads((tmp_path / "m" / "train.json").read_text())
    assert (record["backend"], record["count"], record["width"]) == (name, 3, WIDTH)
    assert record["version"]


def test_words_that_backends_share_mean_the_same(backend):
    for option, kind in SHARED.items():
        if option in backend.CAPABILITIES.options:
            assert type(backend.CAPABILITIES.options[option]) is kind


def test_where_it_started_is_recorded_in_one_shape(scene, name, tmp_path, train_cell):
    record = train_cell(scene, name, tmp_path / "m")["seeding"]
    assert set(record) == {item.name for item in fields(Seeding)}
    kinds = [record[f"{kind}_points"] for kind in ("scene", "sweep", "guessed", "ray", "random", "shell")]
    assert record["count"] == sum(kinds)
    assert (record["source"] == "none") == (record["count"] == 0)


def test_renders_have_the_size_of_their_cameras_and_colours_between_0_and_1(scene, name, backend, tmp_path, train_cell):
    train_cell(scene, name, tmp_path / "m")
    for width in (20, 64):
        cameras = scene.test.cameras.scaled(width)
        images = list(backend.render(tmp_path / "m", cameras))
        assert len(images) == len(cameras)
        for image, height in zip(images, cameras.height, strict=True):
            assert (image.shape, image.dtype) == ((height, width, 3), np.float32)
            assert 0 <= image.min() <= image.max() <= 1


def test_same_seed_same_model(scene, name, backend, tmp_path, train_cell):
    if not backend.CAPABILITIES.deterministic and name != "command:nearest":
        pytest.skip(f"{name} does not promise it")
    renders = []
    for folder in ("a", "b"):
        train_cell(scene, name, tmp_path / folder, seed=5)
        renders.append(np.stack(list(backend.render(tmp_path / folder, scene.test.cameras[:2].scaled(WIDTH)))))
    assert np.array_equal(*renders)


@pytest.mark.parametrize("limit", ["iterations", "seconds"])
def test_budget_is_obeyed_or_refused(scene, name, backend, tmp_path, limit, train_cell):
    if getattr(backend.CAPABILITIES, limit):
        limits = {"iterations": 10**7, limit: {"iterations": 7, "seconds": 0.5}[limit]}
        record = train_cell(scene, name, tmp_path / "m", Budget(**limits))
        assert 0 < record["iterations"] <= (7 if limit == "iterations" else 10**6)
        assert record["budget"][limit] == limits[limit]
    else:
        with pytest.raises(UserError, match=f"cannot limit its {limit}"):
            train_cell(scene, name, tmp_path / "m", Budget(**{limit: 5}))
        assert not (tmp_path / "m").exists()


def test_impossible_requests_are_refused_in_one_line(scene, name, backend, tmp_path, train_cell, settings):
    wrong = selection_of(scene)
    wrong["indices"] = [0, 4, len(scene.train)]
    requests = {"has no option 'itterations'": {"itterations": 3}}
    if "points" in backend.CAPABILITIES.options:
        requests |= {"expected something like": {"points": 3}, "nowhere": {"points": "nowhere"}}
    for message, options in requests.items():
        with pytest.raises(UserError, match=message) as caught:
            train_cell(scene, name, tmp_path / "m", options=options)
        assert "\n" not in str(caught.value)
    with pytest.raises(UserError, match="distinct and in"):
        train(scene, wrong, Job(name, 0, Budget(iterations=3), WIDTH), tmp_path / "m", settings=settings)
    assert not (tmp_path / "m" / "train.json").exists()
    assert not (tmp_path / "m" / WORK).exists()


def test_no_test_image_is_read_while_training(small_room, name, tmp_path, train_cell, settings):
    room = tmp_path / "room"
    shutil.copytree(small_room, room)
    for file in (room / "test").iterdir():
        file.write_bytes(b"garbage")
    scene = open_scene(str(room), settings)
    assert train_cell(scene, name, tmp_path / "m")["iterations"] > 0
    with pytest.raises(UserError, match="cannot be read"):
        train_cell(scene, name, tmp_path / "n", curve=True)  # the curve, which is scored on test views, does read them


def test_the_log_of_a_program_that_fails_is_kept(scene, tmp_path):
    code = "print('reading'); print('cannot go on'); raise SystemExit(1)"
    failing = settings_with(x=nearest_command(train=[sys.executable, "-c", code, "{iterations}"]))
    job = Job("command:x", 0, Budget(iterations=3), WIDTH)
    with pytest.raises(UserError, match="exit status 1: cannot go on"):
        train(scene, selection_of(scene), job, tmp_path / "m", settings=failing)
    (log,) = (tmp_path / "m").iterdir()
    assert (log.name, log.read_text().split("\n")[0]) == ("command.log", "reading")


def test_a_killed_run_leaves_nothing_half_written(small_room, scene, name, tmp_path, settings):
    (tmp_path / "selection.json").write_text(json.dumps(selection_of(scene)))
    slow = nearest_command()
    slow.train.extend(["--pause", "30"])
    command = [sys.executable, "-m", "viewbench", "train", str(small_room), "--backend", name]
    command += ["--selection", str(tmp_path / "selection.json"), "--width", str(WIDTH), "--out", str(tmp_path / "m")]

    def start(iterations: int, configured: Settings) -> subprocess.Popen:
        file = write_settings(tmp_path / "environment.toml", configured)
        environment = {"VIEWBENCH_ENVIRONMENT": str(file), "PATH": str(Path(sys.executable).parent)}
        return subprocess.Popen(
            [*command, "--iterations", str(iterations)], env=environment, stderr=subprocess.PIPE, text=True
        )

    killed = start(10**6, replace(settings, command={"nearest": slow}))
    while not (tmp_path / "m" / WORK / "model").is_dir():
        assert killed.poll() is None, killed.communicate()[1]
        time.sleep(0.01)
    time.sleep(0.5)
    killed.kill()
    killed.communicate()
    assert {path.name for path in (tmp_path / "m").iterdir()} == {WORK, holding.WRITER}
    again = start(5, settings)
    _, said = again.communicate()
    assert again.returncode == 0, said
    assert (tmp_path / "m" / "train.json").is_file()
    assert not (tmp_path / "m" / WORK).exists()


def write_settings(path: Path, settings: Settings) -> Path:
    """The configured programs as an environment.toml."""
    sections = [f"[instant_ngp]\npath = {json.dumps(settings.instant_ngp.path)}\n"]
    for name, entry in settings.command.items():
        keys = "\n".join(f"{key} = {json.dumps(getattr(entry, key))}" for key in ("train", "render"))
        sections.append(f"[command.{name}]\n{keys}\n")
    path.write_text("\n".join(sections), encoding="utf-8")
    return path
