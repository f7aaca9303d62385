"""gsplat's trainer end to end without a GPU: all of gsplat's Python, our loop, and torch in place of its kernels."""

import dataclasses
import functools

import numpy as np
import pytest

from tests.backends.gsplat import kernels
from tests.conftest import known
from viewbench.backends import _gaussian_ply, gsplat
from viewbench.backends._points import Start
from viewbench.backends._psnr import psnr_db
from viewbench.backends._types import Budget, Report
from viewbench.common.errors import UserError

torch = pytest.importorskip("torch")
real = pytest.importorskip("gsplat", reason="gsplat is not installed (pip install 'viewbench[gpu]')")

from viewbench.backends.gsplat import gaussians as gaussians_of  # noqa: E402 - these import torch
from viewbench.backends.gsplat.densification import PAPER_STEPS, Densification  # noqa: E402
from viewbench.backends.gsplat.renderer import NEAR, Renderer  # noqa: E402

BACKEND = gsplat.Gsplat(device="cpu", rasterize=real.rasterization)
OPTIONS = {**BACKEND.CAPABILITIES.options, "points": "random", "drawn_points": 150}


@pytest.fixture(autouse=True)
def _on_the_cpu(monkeypatch):
    kernels.replace(monkeypatch)
    torch.set_num_threads(1)


def start_at(points):
    """Black Gaussians at points (P, 3) of the scene."""
    return gaussians_of.initial([Start(points, np.zeros(points.shape), "scene")], "default", 0, 1.0)


def train(views, out, steps=40, seed=0, report=None, budget=None, **options):
    out.mkdir()
    budget = budget or Budget(iterations=steps)
    return BACKEND.train(views, out, seed, budget, {**OPTIONS, **options}, report or Report())


def test_the_package_inside_the_backend_is_the_real_one():
    assert not real.__name__.startswith("viewbench")
    assert gsplat.__name__ == "viewbench.backends.gsplat"
    assert callable(real.rasterization)


@pytest.mark.parametrize(("strategy", "steps"), [("default", 200), ("mcmc", 400)])
def test_training_views_are_learnt(take_views, tmp_path, strategy, steps):
    views = take_views(width=24)
    options = {"strategy": strategy, "points": "scene", "sh_degree": 1, "gaussians": 300}
    trained = train(views, tmp_path / "m", steps=steps, **options)
    assert trained.iterations == steps
    assert trained.n_primitives == len(_gaussian_ply.load(tmp_path / "m" / "model.ply"))
    renders = list(BACKEND.render(tmp_path / "m", views.cameras))
    mean_colour = views.images.mean(axis=(1, 2), keepdims=True) + np.zeros_like(views.images)
    got, flat = (
        np.mean([psnr_db(image, view) for image, view in zip(images, views.images, strict=True)])
        for images in (renders, mean_colour)
    )
    assert got > flat + 2


@pytest.mark.parametrize("strategy", ["default", "mcmc"])
def test_gaussians_are_added_and_their_optimizers_follow(take_views, tmp_path, strategy):
    trained = train(take_views(width=24), tmp_path / "m", steps=60, strategy=strategy, points="scene")
    assert trained.n_primitives != 200
    assert np.isfinite(_gaussian_ply.load(tmp_path / "m" / "model.ply").means).all()


def test_growth_ends_where_there_are_enough(take_views, tmp_path):
    views, options = take_views(width=24), {"points": "scene", "steps": 80}
    assert train(views, tmp_path / "a", strategy="mcmc", gaussians=205, **options).n_primitives == 205
    assert known(train(views, tmp_path / "b", gaussians=150, **options).n_primitives) <= 150
    assert known(train(views, tmp_path / "c", **options).n_primitives) > 200


@pytest.mark.parametrize("source", ["auto", "scene", "sweep", "rays", "random"])
def test_it_starts_where_any_other_backend_can(take_views, tmp_path, source):
    trained = train(take_views(width=24), tmp_path / "m", steps=2, points=source, drawn_points=60)
    assert (trained.seeding.points, trained.seeding.count > 0) == (source, True)
    assert trained.n_primitives == trained.seeding.count
    limited = train(take_views(width=24), tmp_path / "n", steps=2, points=source, drawn_points=60, gaussians=40)
    assert limited.seeding.count <= 40


def test_points_that_are_guessed_start_as_faint_as_in_splat():
    place = np.eye(3)
    starts = [Start(place, np.ones((3, 3)), kind) for kind in ("scene", "guessed", "ray", "random")]
    opacity = 1 / (1 + np.exp(-gaussians_of.initial(starts, "mcmc", 0, 1.0).opacities.reshape(4, 3)[:, 0]))
    assert np.allclose(opacity, [0.5, 0.1, 0.03, 0.5])


def test_opacities_are_reset_on_schedule(take_views):
    """gsplat 1.5.3 alone never resets them."""
    views = take_views(width=24)
    params = gaussians_of.parameters(
        start_at(np.random.default_rng(0).normal(size=(20, 3))),
        "cpu",
    )
    optims = gaussians_of.optimizers(params, 1.0)
    densification = Densification(OPTIONS, params, optims, 1.0, 30_000)
    with torch.no_grad():
        params["opacities"].fill_(5.0)
    renderer = Renderer(real.rasterization, "cpu", 0.0, 0.0)
    for step, highest in ((2999, 0.99), (3000, 0.01)):
        image, info = renderer.render(params, views.cameras[0], 0)
        densification.before_backward(step, info)
        image.sum().backward()
        densification.strategy.refine_every = 10**9
        densification.after_step(step, info)
        assert float(params["opacities"].detach().sigmoid().max()) == pytest.approx(highest, abs=0.01)
    assert optims["opacities"].param_groups[0]["params"][0] is params["opacities"]


def test_a_run_that_loses_every_gaussian_says_so(take_views, tmp_path, monkeypatch):
    monkeypatch.setitem(gaussians_of.STARTS, "default", (0.001, 1.0))  # below what is pruned
    with pytest.raises(UserError, match="no Gaussian was opaque enough"):
        train(take_views(width=24), tmp_path / "m", steps=100, gaussians=100)


def test_the_schedule_is_squeezed_with_the_run():
    params = gaussians_of.parameters(start_at(np.eye(3)), "cpu")
    optims = gaussians_of.optimizers(params, 1.0)
    for steps, start, every, stop in ((30_000, 500, 100, 15_000), (3000, 50, 10, 1500)):
        strategy = Densification(OPTIONS, params, optims, 2.0, steps).strategy
        assert (strategy.refine_start_iter, strategy.refine_every, strategy.refine_stop_iter) == (start, every, stop)
    state = Densification(OPTIONS, params, optims, 2.0, 3000).state
    assert state["scene_scale"] == 2.0
    assert "binoms" in Densification({**OPTIONS, "strategy": "mcmc"}, params, optims, 2.0, 3000).state


def test_same_seed_same_model_on_one_cpu_thread(take_views, tmp_path):
    views = take_views(width=24)
    for name, seed in (("a", 3), ("b", 3), ("c", 4)):
        train(views, tmp_path / name, steps=30, seed=seed)
    a, b, c = ((tmp_path / name / "model.ply").read_bytes() for name in "abc")
    assert a == b
    assert a != c


def test_curve_and_seconds_leave_the_probe_out(take_views, tmp_path):
    import time

    views = take_views(width=24)

    def probe(render):
        time.sleep(0.2)
        return psnr_db(next(iter(render(views.cameras))), views.images[0])

    trained = train(views, tmp_path / "m", steps=20, report=Report(probe=probe), drawn_points=10)
    assert [point["step"] for point in trained.curve] == list(range(1, 21))
    assert trained.seconds < 20 * 0.2
    assert all(np.isfinite(known(point["test_psnr_db"])) for point in trained.curve)
    assert np.all(np.diff([known(point["seconds"]) for point in trained.curve]) > 0)


def test_seconds_end_a_run(take_views, tmp_path):
    trained = train(take_views(width=24), tmp_path / "m", budget=Budget(seconds=0.3), drawn_points=10)
    assert 0 < trained.iterations < PAPER_STEPS


@pytest.mark.parametrize("background", [0.0, 0.3, 1.0])
def test_background_is_kept_with_the_model(take_views, tmp_path, background):
    views = take_views(width=24)
    train(views, tmp_path / "m", steps=1, background=background, drawn_points=1)
    away = dataclasses.replace(views.cameras, c2w=views.cameras.c2w @ np.diag([-1.0, 1, -1, 1]))
    empty = [image for image in BACKEND.render(tmp_path / "m", away) if np.ptp(image) == 0]
    assert all(np.allclose(image, background) for image in empty)
    assert empty


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"strategy": "mcmd"}, "'mcmd', expected 'default' or 'mcmc'"),
        ({"background": 1.5}, "expected 0 to 1"),
        ({"sh_degree": 4}, "expected 0 to 3"),
        ({"gaussians": -1}, "expected 0 or more"),
        ({"points": "scenes"}, "did you mean 'scene'"),
        ({"points": "selected"}, "no point tracks"),
    ],
)
def test_what_it_cannot_do_is_refused_in_one_sentence(take_views, tmp_path, options, message):
    with pytest.raises(UserError, match=message):
        train(take_views(width=24), tmp_path / "m", **options)


def test_full_memory_is_said_to_be_so(take_views, tmp_path):
    def full(**arguments):
        raise torch.cuda.OutOfMemoryError("CUDA out of memory")

    (tmp_path / "m").mkdir()
    backend = gsplat.Gsplat(device="cpu", rasterize=full)
    with pytest.raises(UserError, match="memory is full with 150 Gaussians and 3 views of 24 pixels"):
        backend.train(take_views(width=24), tmp_path / "m", 0, Budget(iterations=5), OPTIONS, Report())
    assert not list((tmp_path / "m").iterdir())


def test_absent_cuda_is_explained():
    if torch.cuda.is_available():
        pytest.skip("there is a CUDA device here")
    assert "CUDA" in known(gsplat.Gsplat().available())
    assert "[compute] device is 'cpu'" in known(gsplat.Gsplat(device="cpu").available())
    assert gsplat.Gsplat().version().startswith("gsplat 1.")
    with pytest.raises(UserError, match="install a CUDA toolkit"):
        gsplat.Gsplat().warm()


def test_a_point_is_drawn_where_its_camera_sees_it(take_views):
    views = take_views(width=40)
    camera = dataclasses.replace(views.cameras[0], cx=np.array([17.0]), fy=views.cameras.fy[:1] * 1.2)
    right, up, back = camera.rotations[0].T
    point = camera.positions[0] - 2 * back + 0.3 * right + 0.4 * up
    gaussians = gaussians_of.initial([Start(point[None], np.ones((1, 3)), "scene")], "default", 0, 0.01)
    renderer = Renderer(real.rasterization, "cpu", 0.0, 0.0)
    (image,) = renderer.images(renderer.parameters(gaussians), camera, 0)
    weight = image.sum(axis=2)
    v, u = np.mgrid[:40, :40] + 0.5
    expected = 17 + camera.fx[0] * 0.3 / 2, camera.cy[0] - camera.fy[0] * 0.4 / 2
    assert np.allclose([(weight * u).sum() / weight.sum(), (weight * v).sum() / weight.sum()], expected, atol=0.1)


@pytest.mark.parametrize("strategy", ["default", "mcmc"])
def test_a_killed_run_goes_on_to_the_same_model(take_views, tmp_path, monkeypatch, strategy):
    views = take_views(width=24)
    options = {"strategy": strategy, "points": "scene", "steps": 60}
    whole = train(views, tmp_path / "whole", **options)
    monkeypatch.setattr("viewbench.backends.gsplat.trainer.SNAPSHOT_S", 0)

    def die(step, total, text):
        if step == 30:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train(views, tmp_path / "m", report=Report(progress=die), **options)
    assert [path.name for path in (tmp_path / "m").iterdir()] == ["snapshot.npz"]
    seen = []
    report = Report(progress=lambda step, total, text: seen.append(step))
    options = {**OPTIONS, **{key: value for key, value in options.items() if key != "steps"}}
    resumed = BACKEND.train(views, tmp_path / "m", 0, Budget(iterations=60), options, report)
    assert seen[0] == 30
    assert (tmp_path / "m" / "model.ply").read_bytes() == (tmp_path / "whole" / "model.ply").read_bytes()
    assert [point["step"] for point in resumed.curve] == [point["step"] for point in whole.curve]
    assert sorted(path.name for path in (tmp_path / "m").iterdir()) == ["model.json", "model.ply"]


def test_a_snapshot_that_cannot_be_read_is_no_snapshot(take_views, tmp_path):
    (tmp_path / "m").mkdir()
    (tmp_path / "m" / "snapshot.npz").write_bytes(b"half")
    trained = BACKEND.train(take_views(width=24), tmp_path / "m", 0, Budget(iterations=3), OPTIONS, Report())
    assert trained.iterations == 3


def test_no_precision_is_given_away_on_tensor_cores(take_views, tmp_path, monkeypatch):
    """TF32 has 10 bits, and SSIM's variances are what is left of a difference."""
    monkeypatch.setattr(torch.backends.cudnn, "allow_tf32", True)
    train(take_views(width=24), tmp_path / "m", steps=1)
    assert not torch.backends.cudnn.allow_tf32
    assert not torch.backends.cuda.matmul.allow_tf32


@pytest.mark.parametrize("mode", ["classic", "antialiased"])
@pytest.mark.parametrize(("degree", "background"), [(0, 0.0), (1, 1.0), (2, 0.7), (3, 0.0)])
def test_models_look_the_same_in_the_cpu_backend(take_views, tmp_path, mode, degree, background):
    """By gsplat's reference code. A pixel may differ by what one splat is cut off at; all the others are the same."""
    from viewbench.backends.splat import ply
    from viewbench.backends.splat.loop import draw
    from viewbench.backends.splat.options import Rendering

    views = take_views(width=40)
    start = Start(views.points.xyz, views.points.rgb / 255, "scene")
    gaussians = gaussians_of.initial([start], "mcmc", degree, 1.0)
    rng = np.random.default_rng(2)
    bent = {"shn": 0.2, "quats": 0.5, "scales": 0.6, "opacities": 2.0}
    drawn = {name: rng.normal(0, much, getattr(gaussians, name).shape) for name, much in bent.items()}
    drawn["scales"] += 1.5
    changed = {name: (getattr(gaussians, name) + much).astype(np.float32) for name, much in drawn.items()}
    gaussians = dataclasses.replace(gaussians, **changed)
    _gaussian_ply.save(tmp_path / "model.ply", gaussians)
    renderer = Renderer(functools.partial(real.rasterization, rasterize_mode=mode), "cpu", background, 0.0)
    how = Rendering(near=NEAR, background=background, antialias=mode == "antialiased")
    ours = np.array(list(draw(ply.read(tmp_path / "model.ply"), views.cameras, how)))
    theirs = np.array(list(renderer.images(renderer.parameters(gaussians), views.cameras, degree)))
    difference = np.abs(ours - theirs)
    assert theirs.std() > 0.05
    assert difference.max() <= 1 / 255
    assert np.quantile(difference, 0.999) < 2e-5
