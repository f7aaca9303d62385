"""instant-ngp's adapter against a made-up checkout whose pyngp knows the real one's names and loader's conventions."""

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.backends.conftest import make_checkout
from tests.conftest import known
from viewbench.backends import _registry
from viewbench.backends._types import Budget, Report
from viewbench.common.errors import UserError
from viewbench.common.settings import InstantNgp, Settings


@pytest.fixture
def checkout(tmp_path):
    return make_checkout(tmp_path / "instant-ngp")


def load(path: object = "", python: str = ""):
    settings = Settings(source=Path("environment.toml"), instant_ngp=InstantNgp(str(path), python))
    return _registry.load("instant-ngp", settings)


def train(backend, views, out, budget=None, **options):
    out.mkdir()
    options = {**backend.CAPABILITIES.options, **options}
    return backend.train(views, out, 0, budget or Budget(iterations=40), options, Report())


def test_a_model_is_trained_and_its_views_come_back(checkout, take_views, tmp_path):
    backend, views = load(checkout), take_views()
    # a principal point off the middle and pixels that are not square: what scripts/run.py cannot render
    views = replace(views, cameras=replace(views.cameras, cx=views.cameras.cx + 3.25, fy=views.cameras.fy * 1.1))
    trained = train(backend, views, tmp_path / "m", aabb_scale=16)
    assert (trained.iterations, trained.curve[-1]["step"]) == (40, 40)
    assert not (tmp_path / "m" / "scene").exists()
    for image, view in zip(backend.render(tmp_path / "m", views.cameras), views.images, strict=True):
        assert np.abs(image - view)[:-1].max() <= 0.5 / 255 + 1e-6
        assert (image[-1] == 0).all(), "where a model has nothing, the background is black"
    (small,) = backend.render(tmp_path / "m", views.cameras[1].scaled(20))
    assert (small.shape, small.dtype) == ((20, 20, 3), np.float32)


def test_the_snapshot_holds_the_box_that_was_asked_for(checkout, take_views, tmp_path):
    for side in (4, 16):
        train(load(checkout), take_views(), tmp_path / str(side), aabb_scale=side)
        assert json.loads((tmp_path / str(side) / "model.ingp").read_text())["aabb_scale"] == side


def test_its_network_is_found_wherever_the_model_is_trained(checkout, take_views, tmp_path):
    backend = load(checkout)
    for name in ("base", "big"):
        train(backend, take_views(), tmp_path / name, network=name)
        assert json.loads((tmp_path / name / "model.ingp").read_text())["network"] == {"encoding": name}
    with pytest.raises(UserError, match=r"has no network 'bgi'; did you mean 'big'\? \(base, big\)"):
        train(backend, take_views(), tmp_path / "m", network="bgi")
    before = backend.configuration()
    (checkout / "configs" / "nerf" / "base.json").write_text("{}")
    assert backend.configuration() != before, "an edited network is another training"
    (checkout / "configs" / "nerf" / "base.json").unlink()
    assert "has no configs/nerf/base.json" in backend.available()


def test_the_stand_in_asks_for_a_root_directory(checkout, take_views, tmp_path, monkeypatch):
    """What an adapter that forgets it meets: no network, and no step."""
    from viewbench.backends import _subset

    monkeypatch.chdir(tmp_path)
    views = take_views()
    _subset.write(tmp_path / "scene", "transforms", views.cameras, views.images, extra={"aabb_scale": 4})
    monkeypatch.syspath_prepend(str(checkout / "build"))
    pyngp = __import__("pyngp")
    testbed = pyngp.Testbed()
    testbed.nerf.training.train_mode = pyngp.TrainMode.Nerf
    testbed.load_training_data(str(tmp_path / "scene" / "transforms.json"))
    testbed.shall_train = True
    with pytest.raises(RuntimeError, match="Unable to create a neural network trainer"):
        testbed.frame()
    testbed.root_dir = str(checkout)
    assert testbed.frame()


def test_a_training_that_it_gives_up_does_not_go_on_for_ever(checkout, take_views, tmp_path):
    module = checkout / "build" / "pyngp.py"
    module.write_text(module.read_text().replace('if not self._dataset["frames"]:', "if self.training_step == 3:"))
    with pytest.raises(UserError, match="instant-ngp gave up: no ray met anything"):
        train(load(checkout), take_views(), tmp_path / "m")


def test_the_seed_changes_the_order_of_frames_and_not_the_frames(checkout, take_views, tmp_path):
    views = take_views(chosen=tuple(range(0, 400, 40)))
    orders = []
    for name, seed in (("a", 1), ("b", 1), ("c", 2)):
        backend = load(checkout)
        (tmp_path / name).mkdir()
        backend.train(views, tmp_path / name, seed, Budget(iterations=1), backend.CAPABILITIES.options, Report())
        frames = json.loads((tmp_path / name / "model.ingp").read_text())["frames"]
        orders.append([json.dumps(frame["matrix"]) for frame in frames])
    assert orders[0] == orders[1] != orders[2]
    assert set(orders[0]) == set(orders[2])


def test_seconds_end_a_run(checkout, take_views, tmp_path):
    trained = train(load(checkout), take_views(), tmp_path / "m", Budget(seconds=0.2))
    assert 0.2 <= trained.seconds < 5


@pytest.mark.parametrize("side", [0, 3, 256])
def test_boxes_that_it_does_not_know_are_refused(checkout, take_views, tmp_path, side):
    with pytest.raises(UserError, match="power of two up to 128"):
        train(load(checkout), take_views(), tmp_path / "m", aabb_scale=side)


def test_cameras_outside_the_box_are_refused(checkout, take_views, tmp_path):
    """Of all training cameras, so that no choice of views fails where another goes."""
    views = take_views()
    moved = views.training.c2w.copy()
    moved[77, 0, 3] = 7.0
    assert 77 not in views.chosen
    with pytest.raises(UserError, match=r"a training camera is 7\.0 scene units .* set a larger aabb_scale"):
        train(load(checkout), replace(views, training=replace(views.training, c2w=moved)), tmp_path / "m")


def test_its_failure_is_one_sentence(checkout, take_views, tmp_path):
    module = checkout / "build" / "pyngp.py"
    module.write_text(module.read_text().replace("def frame(self)", "def framed(self)"))
    with pytest.raises(UserError, match=r"instant-ngp \(train\) failed with exit status 1: AttributeError: .*frame"):
        train(load(checkout), take_views(), tmp_path / "m")


def test_what_is_missing_is_named(checkout, tmp_path):
    assert load(checkout).available() is None
    assert load().available().startswith("no checkout is configured; clone https://github.com/NVlabs/instant-ngp")
    assert "is not there" in load(tmp_path / "none").available()
    assert "python 'no-python' is not there" in load(checkout, "no-python").available()
    (checkout / "build" / "pyngp.py").write_text("raise ImportError('libcuda.so.1: cannot open shared object file')")
    assert "libcuda.so.1" in load(checkout).available()
    (checkout / "build" / "pyngp.py").unlink()
    assert "has no build/pyngp" in load(checkout).available()


def test_the_commit_is_recorded(checkout):
    assert load(checkout).version().startswith("instant-ngp sha256:")
    git = ["git", "-C", str(checkout), "-c", "user.name=x", "-c", "user.email=x@example.org"]
    for command in (["init", "-q"], ["add", "."], ["commit", "-q", "-m", "x"]):
        subprocess.run([*git, *command], check=True)
    done = subprocess.run([*git, "rev-parse", "HEAD"], check=True, capture_output=True, text=True)
    first = load(checkout).version()
    assert first.startswith(f"instant-ngp {done.stdout[:12]}, sha256:")
    module = checkout / "build" / "pyngp.py"
    module.write_text(module.read_text() + "# built again\n")
    rebuilt = load(checkout).version()
    module.write_text(module.read_text() + "# and again\n")
    assert len({first, rebuilt, load(checkout).version()}) == 3, "a dirty checkout is not all that was built"
    with pytest.raises(UserError, match="no checkout is configured"):
        load().version()


def test_the_driver_needs_nothing_of_viewbench(checkout):
    driver = Path(known(sys.modules["viewbench.backends._ngp_driver"].__file__))
    assert "from viewbench" not in driver.read_text(encoding="utf-8")
    subprocess.run([sys.executable, "-I", str(driver), "check", str(checkout)], check=True)  # -I: no path of ours
