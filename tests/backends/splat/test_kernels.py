"""Pictures, losses and gradients of the kernels against the float64 reference."""

import tracemalloc

import numpy as np
import pytest
import torch

from tests.backends.splat import reference
from tests.conftest import known
from viewbench.backends.splat import layout
from viewbench.backends.splat.backward import Moments, Rates
from viewbench.backends.splat.options import Rendering
from viewbench.backends.splat.projection import camera_vectors
from viewbench.backends.splat.renderer import Renderer
from viewbench.backends.splat.trainer import Trainer, Weights
from viewbench.scenes.types import Cameras

GROUPS = {"mean": (0, 3), "quaternion": (3, 7), "scale": (7, 10), "opacity": (10, 11), "sh0": (11, 14), "sh1": (14, 23)}


def camera(width, height, rng):
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    turn *= np.sign(np.linalg.det(turn))
    pose = np.eye(4)
    pose[:3, :3] = turn
    pose[:3, 3] = turn[:, 2] * 3.2 + rng.normal(size=3) * 0.05  # looks along -z at the middle
    focal, one = np.full(1, 1.2 * width), np.ones(1)
    size = np.full(1, width), np.full(1, height)
    cameras = Cameras(pose[None], focal, 1.1 * focal, (width / 2 + 1.3) * one, (height / 2 - 0.7) * one, *size)
    return camera_vectors(cameras)[0]


def cloud(n, rng, spread=0.12, degree=1):
    g = layout.empty(n, degree)
    g[0:3] = rng.uniform(-1, 1, (3, n))
    g[3:7] = rng.normal(size=(4, n))
    g[7:10] = np.log(spread) + 0.4 * rng.normal(size=(3, n))
    g[10] = 1.5 * rng.normal(size=n)
    g[11:14] = rng.normal(size=(3, n))
    g[14:] = 0.2 * rng.normal(size=g[14:].shape)
    return g


def behind(g):
    g[0:3, ::2] *= 8  # far outside, many of them behind the camera


def huge(g):
    g[7:10, ::3] += 4


def tiny(g):
    g[7:10] -= 6


def opaque(g):
    g[10] = 12


def thin(g):
    g[7] -= 5
    g[8] += 1


def off_screen(g):
    g[0:3] += 1.4


CASES = [None, behind, huge, tiny, opaque, thin, off_screen]


NEAR = 0.05
FILTERS = {"3dgs": {"low_pass": 0.3, "antialias": False}, "mip": {"low_pass": 0.1, "antialias": True}}


def both(g, cam, how, target, weight):
    """(picture, loss, picture gradient, parameter gradient) of the kernels, and of the reference."""
    width, height = int(cam[19]), int(cam[20])
    trainer = Trainer(g.shape[1], width, height, how)
    picture = trainer.renderer.draw(g, cam).copy()
    value = trainer.compare(trainer.target(target.transpose(1, 2, 0)), weight)
    gradient = trainer.image_gradient.copy()
    ours = picture, value, gradient, trainer.differentiate(g, cam).copy()

    parameters = torch.tensor(g.astype(np.float64), requires_grad=True)
    drawn = reference.render(parameters, cam, how)
    lost = reference.loss(drawn, torch.tensor(target, dtype=torch.float64), weight)
    (by_picture,) = torch.autograd.grad(lost, drawn, retain_graph=True)
    lost.backward()
    theirs = drawn.detach().numpy(), lost.item(), by_picture.numpy(), known(parameters.grad).numpy()
    return ours, theirs


@pytest.mark.parametrize("degenerate", CASES, ids=lambda case: case.__name__ if case else "plain")
@pytest.mark.parametrize(("n", "width", "height"), [(60, 40, 29), (200, 24, 35)])
@pytest.mark.parametrize("low_pass", FILTERS)
def test_picture_loss_and_gradients(degenerate, n, width, height, low_pass):
    rng = np.random.default_rng(n)
    g = cloud(n, rng)
    if degenerate:
        degenerate(g)
    cam = camera(width, height, rng)
    target = rng.uniform(0, 1, (3, height, width)).astype(np.float32)
    ours, theirs = both(g, cam, Rendering(NEAR, 0.3, 1, **FILTERS[low_pass]), target, 0.2)
    # A pixel where alpha is within rounding of 1/255 is drawn by one and not by the other: worth 1/255 of a colour,
    # rare, and not counted in the quantiles. Tiles that are opaque stop at a transmittance of 1e-4.
    difference = np.abs(ours[0] - theirs[0])
    assert np.quantile(difference, 0.98) < 5e-4
    assert difference.max() < 0.02
    assert abs(ours[1] - theirs[1]) < 2e-4 * max(1, theirs[1])
    assert np.isfinite(ours[3]).all()
    for name, (first, last) in GROUPS.items():
        scale = np.linalg.norm(theirs[3][first:last])
        error = np.linalg.norm(ours[3][first:last] - theirs[3][first:last])
        assert error <= 1e-2 * scale + 1e-8, f"{name}: {error} of {scale}"


@pytest.mark.parametrize("low_pass", FILTERS)
def test_plain_gradients_are_exact_to_rounding(low_pass):
    """Where no pixel sits on a threshold, kernels and reference agree to float32."""
    rng = np.random.default_rng(1)
    g, cam = cloud(40, rng), camera(40, 29, rng)
    target = rng.uniform(0, 1, (3, 29, 40)).astype(np.float32)
    ours, theirs = both(g, cam, Rendering(NEAR, **FILTERS[low_pass]), target, 0.2)
    np.testing.assert_allclose(ours[2], theirs[2], atol=2e-5 * np.abs(theirs[2]).max())
    for first, last in GROUPS.values():
        scale = np.abs(theirs[3][first:last]).max()
        np.testing.assert_allclose(ours[3][first:last], theirs[3][first:last], atol=2e-4 * scale)


@pytest.mark.parametrize("degree", range(layout.HIGHEST + 1))
def test_colours_of_every_degree(degree):
    rng = np.random.default_rng(2)
    g, cam = cloud(50, rng, degree=degree), camera(32, 32, rng)
    target = rng.uniform(0, 1, (3, 32, 32)).astype(np.float32)
    ours, theirs = both(g, cam, Rendering(NEAR, degree=degree), target, 0.2)
    assert np.abs(ours[0] - theirs[0]).max() < 0.02
    assert len(ours[3]) == len(g) == layout.rows(degree)
    assert layout.degree_of(g) == degree
    for row in range(layout.SH0, len(g)):
        # A pixel on the threshold of 1/255 may count for one Gaussian.
        off = np.abs(ours[3][row] - theirs[3][row])
        assert np.quantile(off, 0.9) < 1e-4 * np.abs(theirs[3][row]).max()
        assert np.linalg.norm(off) < 0.1 * np.linalg.norm(theirs[3][row])


def test_parameters_of_another_degree_are_refused():
    renderer = Renderer(5, 16, 16, Rendering(NEAR, degree=2))
    with pytest.raises(ValueError, match="23 rows"):
        renderer.draw(cloud(5, np.random.default_rng(0)), camera(16, 16, np.random.default_rng(0)))


@pytest.mark.parametrize("weight", [0.0, 0.2, 1.0])
@pytest.mark.parametrize("size", [(11, 11), (16, 37), (50, 12)])
def test_loss_of_any_picture(weight, size):
    rng = np.random.default_rng(3)
    height, width = size
    trainer = Trainer(1, width, height, Rendering())
    picture, target = (rng.uniform(0, 1, (3, height, width)).astype(np.float32) for _ in range(2))
    trainer.renderer.image[:] = picture
    value = trainer.compare(trainer.target(target.transpose(1, 2, 0)), weight)
    x = torch.tensor(picture, dtype=torch.float64, requires_grad=True)
    wanted = reference.loss(x, torch.tensor(target, dtype=torch.float64), weight)
    wanted.backward()
    assert abs(value - wanted.item()) < 1e-5
    gradient = known(x.grad)
    np.testing.assert_allclose(trainer.image_gradient, gradient.numpy(), atol=3e-5 * float(gradient.abs().max()))


def test_an_empty_view_is_background():
    g = cloud(10, np.random.default_rng(4))
    g[layout.LOGIT] = -20
    cam = camera(20, 20, np.random.default_rng(4))
    trainer = Trainer(10, 20, 20, Rendering(NEAR, 0.25))
    assert (trainer.renderer.draw(g, cam) == 0.25).all()
    assert trainer.renderer.pairs == 0
    trainer.compare(trainer.target(np.zeros((20, 20, 3), np.float32)), 0.2)
    assert not trainer.differentiate(g, cam).any()


def test_more_pairs_than_there_is_room_for():
    rng = np.random.default_rng(5)
    g, cam = cloud(40, rng), camera(64, 48, rng)
    g[7:10] += 3
    target = rng.uniform(0, 1, (48, 64, 3)).astype(np.float32)
    found = []
    for room in (None, 16):
        trainer = Trainer(40, 64, 48, Rendering(NEAR))
        if room:
            trainer.renderer._make_room(room)
            trainer.differentiate(g, cam)  # makes room for as few gradients
        picture = trainer.renderer.draw(g, cam)
        trainer.compare(trainer.target(target), 0.2)
        found.append((picture, trainer.differentiate(g, cam)))
    for roomy, tight in zip(*found, strict=True):
        np.testing.assert_array_equal(roomy, tight)


def test_drawing_makes_no_room_for_gradients():
    tracemalloc.start()
    renderer = Renderer(50_000, 64, 64, Rendering(NEAR))
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert len(renderer.slots.tile) == 8 * 50_000
    assert peak < 50_000 * 350  # bytes; those of the pairs' gradients would be 384 more
    assert len(Trainer(50, 64, 64, Rendering(NEAR)).pair_gradient) == 0


def test_splats_at_one_depth():
    """No order is right; the sort must neither fail nor lose one."""
    rng = np.random.default_rng(6)
    g, cam = cloud(30, rng), camera(32, 32, rng)
    g[0:3] = g[0:3, :1]
    renderer = Renderer(30, 32, 32, Rendering(NEAR))
    renderer.draw(g, cam)
    assert (renderer.slots.number > 0).sum() == renderer.visible > 0


def test_no_splat_has_more_slots_than_its_own():
    """Nothing checks bounds: rounding must not lead out of them where splats are larger than the picture by far."""
    rng, n, f = np.random.default_rng(9), 4000, 100.0
    z, size = rng.uniform(0.06, 0.2, n), np.exp(rng.uniform(0, 5, n))
    edge = rng.uniform(0, 300, n)  # where the ellipse ends, in pixels
    g = layout.empty(n, 1)
    g[layout.MEAN : layout.MEAN + 3] = [(edge - 3.2 * f * size / z - 150) * z / f, 0 * z, z]
    g[layout.LOG_SCALE : layout.LOG_SCALE + 3], g[layout.LOGIT] = np.log(size), 5
    cam = np.array([1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, f, f, 150, 150, 0, 0, 0, 300, 300], np.float32)
    renderer = Renderer(n, 300, 300, Rendering(NEAR))
    assert np.isfinite(renderer.draw(g, cam)).all()
    places = renderer.order.indices[: renderer.visible]
    seen = renderer.splats.gaussian[places]
    assert len(seen) > 100
    assert (renderer.slots.number[seen] <= renderer.splats.most[places]).all()
    assert renderer.slots.number.sum() == renderer.pairs


def test_the_filter_keeps_a_small_splats_light():
    """A splat that shrinks below a pixel loses light with its area: with Mip-Splatting's filter, not with 3DGS's."""
    light = {name: [] for name in FILTERS}
    cam = camera(32, 32, np.random.default_rng(7))
    for shrink in (0, 1):
        g = layout.empty(1, 1)
        g[7:10], g[10], g[11:14] = np.log(0.015) - shrink * np.log(2), 9, 1
        for name, values in light.items():
            values.append(Renderer(1, 32, 32, Rendering(NEAR, **FILTERS[name])).draw(g, cam).sum())
    assert light["mip"][0] / light["mip"][1] > 3
    assert light["3dgs"][0] / light["3dgs"][1] < 1.3


def test_the_benchmarks_torch_step_does_the_same_work():
    """`make bench` compares speeds, which says something where both do the same: a step on the same parameters."""
    from tests.bench.torch_splat import TorchStep

    rng = np.random.default_rng(8)
    g, cam = cloud(80, rng), camera(40, 32, rng)
    target = rng.uniform(0, 1, (32, 40, 3)).astype(np.float32)
    rates = np.full(len(g), 1e-4, np.float32)
    slow = TorchStep(g, rates)
    losses = [slow(cam, torch.tensor(target.transpose(2, 0, 1).copy())) for _ in range(2)]
    trainer = Trainer(80, 40, 32, Rendering(NEAR))
    planes, moments = trainer.target(target), Moments.zeros(g)
    for number, wanted in enumerate(losses, start=1):
        loss = trainer.step(g, moments, cam, planes, Rates.of_step(number, rates), Weights(0.2))
        assert abs(loss - wanted) < 2e-4
    updated = np.stack([row.detach().numpy() for row in slow.rows])
    assert np.median(np.abs(updated - g)) < 2e-5


@pytest.mark.parametrize(("height", "width"), [(1, 1), (3, 40), (33, 17)])
def test_windows_of_a_photograph_are_those_of_scipy(height, width):
    from scipy.ndimage import convolve1d

    from viewbench.backends.splat.loss import WINDOW, Target
    from viewbench.backends.splat.planes import Planes

    def blurred(plane):
        once = convolve1d(plane, WINDOW, axis=0, mode="constant")
        return convolve1d(once, WINDOW, axis=1, mode="constant")

    image = np.random.default_rng(0).uniform(0, 1, (height, width, 3)).astype(np.float32)
    planes = Planes(width, height)
    target = Target.of(image, planes)
    for channel in range(3):
        values = image[..., channel].astype(np.float64)
        mean = blurred(values)
        wanted = values, mean, blurred(values * values) - mean**2
        for part, value in zip(target, wanted, strict=True):
            np.testing.assert_allclose(planes.inside(part[channel]), value, atol=1e-7)
            assert np.count_nonzero(part[channel]) <= height * width, "the padding is zero"
