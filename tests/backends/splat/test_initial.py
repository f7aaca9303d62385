"""Where Gaussians start, in a room whose depths are known: a box with painted walls, seen from inside."""

from dataclasses import asdict, replace

import numpy as np
import pytest
from scipy.spatial import KDTree

from tests.conftest import known
from viewbench.backends._points import knowing
from viewbench.backends._points.depth_maps import depth_maps
from viewbench.backends._points.drawn import along_rays
from viewbench.backends._points.neighbours import neighbours
from viewbench.backends._points.plane_sweep import sweep
from viewbench.backends._surroundings import surroundings
from viewbench.backends._types import TrainingSet
from viewbench.backends.splat.initial import along_curve, initial
from viewbench.backends.splat.layout import LOGIT, MEAN
from viewbench.backends.splat.options import Options
from viewbench.backends.splat.shell import shell
from viewbench.common.errors import UserError
from viewbench.scenes.types import Cameras, Points

SIZE, HALF_ROOM = 48, 2.0


def seed(data, o, rng):
    """The start as a training makes it: of what this source may know."""
    data = knowing(data, o.points)
    gaussians, seeding = initial(data, o, surroundings(data.training, data.points), rng)
    return gaussians, asdict(seeding)


def cameras(positions, angles):
    """Level cameras that look along angles (radians) in the plane of x and z."""
    n = len(angles)
    back = np.stack([-np.cos(angles), np.zeros(n), -np.sin(angles)], axis=1)
    up = np.tile([0.0, 1.0, 0.0], (n, 1))
    poses = np.tile(np.eye(4), (n, 1, 1))
    poses[:, :3, :3] = np.stack([np.cross(up, back), up, back], axis=2)
    poses[:, :3, 3] = positions
    one, size = np.ones(n), np.full(n, SIZE, np.int64)
    return Cameras(poses, 45 * one, 45 * one, SIZE / 2 * one, SIZE / 2 * one, size, size)


def rays(camera):
    """(H W, 3) directions whose depth is 1, and the distance along them to the walls, which is the depth there."""
    row, column = np.divmod(np.arange(SIZE * SIZE), SIZE)
    x, y = (column + 0.5 - camera.cx[0]) / camera.fx[0], (row + 0.5 - camera.cy[0]) / camera.fy[0]
    directions = np.stack([x, -y, -np.ones(len(x))], axis=1) @ camera.rotations[0].T
    with np.errstate(divide="ignore"):
        to_walls = (np.sign(directions) * HALF_ROOM - camera.positions[0]) / directions
    return directions, to_walls.min(axis=1)


def painted(points):
    """A colour for every point in space, smooth at the scale of a few pixels, that repeats nowhere near."""
    waves = np.random.default_rng(1).normal(size=(40, 3)) * 7
    phase, tint = np.random.default_rng(2).uniform(0, 6, 40), np.random.default_rng(3).normal(size=(40, 3))
    return np.clip(0.5 + np.sin(points @ waves.T + phase) @ tint * 0.05, 0, 1)


def room(positions, angles, points=None):
    """Photographs of the painted room, and (K, H, W) true depths."""
    views = cameras(np.asarray(positions, float), np.asarray(angles, float))
    images, depths = [], []
    for camera in views:
        directions, depth = rays(camera)
        images.append(painted(camera.positions[0] + directions * depth[:, None]).reshape(SIZE, SIZE, 3))
        depths.append(depth.reshape(SIZE, SIZE))
    k = len(images)
    names = tuple(map(str, range(k)))
    data = TrainingSet("room", names, views, np.stack(images).astype(np.float32), points, np.arange(k), views)
    return data, np.stack(depths)


@pytest.fixture(scope="module")
def walk():
    """Views of a walk through the room that looks all around."""
    turn = np.linspace(0, 2 * np.pi, 30, endpoint=False)
    return room(np.stack([0.6 * np.cos(turn), 0.1 * np.sin(3 * turn), 0.6 * np.sin(turn)], axis=1), turn)


def scattered(n):
    """Points that lie apart and look ways that do not overlap."""
    return room(
        np.stack([np.linspace(-1, 1, n), np.zeros(n), np.zeros(n)], 1), np.linspace(0, 2 * np.pi * (1 - 1 / n), n)
    )


def on_walls(points):
    return np.abs(np.abs(points).max(axis=1) - HALF_ROOM)


def test_depths_that_are_believed_are_right(walk):
    data, truth = walk
    maps = depth_maps(data, surroundings(data.training, data.points).depths, np.random.default_rng(0))
    assert maps.depth.shape == truth.shape  # small pictures are not made smaller
    error = np.abs(maps.depth - truth) / truth
    assert maps.sure.mean() > 0.2
    assert np.quantile(error[maps.sure], 0.95) < 0.07
    assert np.median(error[maps.guessed]) < 0.1
    positions, colours = maps.points(np.flatnonzero(maps.sure))
    assert np.quantile(on_walls(positions), 0.95) < 0.12
    assert np.abs(colours - painted(positions)).mean() < 0.05


def test_a_sweep_finds_the_depth_of_a_plane():
    """Against the definition: the plane's picture in a camera moved to the right by b is shifted by f b / z."""
    rng = np.random.default_rng(4)
    wide = np.kron(rng.uniform(0, 1, (12, 30)), np.ones((3, 3)))[:32].astype(np.float32)
    wide = 0.25 * (wide[:, :-3] + wide[:, 1:-2] + wide[:, 2:-1] + wide[:, 3:])
    reference, source = wide[:, 10:42].copy(), wide[:, 14:46].copy()  # 4 pixels to the right: f b = 4 z
    matrix = np.zeros((1, 3, 4))
    matrix[0, :, :3] = np.eye(3)
    matrix[0, 0, 3] = -8.0  # f b
    depths = np.geomspace(0.5, 8, 24)  # 2 is none of them
    depth, score = np.zeros((32, 32), np.float32), np.zeros((32, 32), np.float32)
    sweep(reference, source[None], matrix, depths, depth, score)
    inner = depth[4:-4, 8:-4]
    assert np.median(np.abs(inner - 2)) < 0.06
    assert (score <= 1 + 1e-5).all()


def test_a_picture_without_texture_is_not_believed():
    flat = np.full((16, 16), 0.5, np.float32)
    depth, score = np.zeros((16, 16), np.float32), np.zeros((16, 16), np.float32)
    matrix = np.concatenate([np.eye(3), np.array([[1.0], [0.0], [0.0]])], axis=1)[None]
    sweep(flat, flat[None], matrix, np.geomspace(1, 8, 8), depth, score)
    assert score.max() < 0.1


def test_neighbours_see_the_same_space_at_an_angle():
    positions = [[0, 0, 0], [0.01, 0, 0], [0, 0, 0.25], [0, 0, 0.3], [0, 0, 0]]
    views = cameras(np.array(positions, float), np.array([0, 0, 0, 0, np.pi]))
    best, value = neighbours(views, np.array([0]), 4, 1.0, 4.0, np.random.default_rng(0))
    assert set(best[0, :2]) == {2, 3}  # not the one that hardly moved
    assert best[0, 3] == 4  # nor the one that looks back, last and worth nothing
    assert value[0, 3] == 0
    assert (np.diff(value[0]) <= 0).all()


def options(**changed):
    return Options(**{"gaussians": 3000, "shell": 100, **changed})


def test_every_source_is_counted(walk):
    data, _ = walk
    walls = np.random.default_rng(5).uniform(-HALF_ROOM, HALF_ROOM, (800, 3))
    walls[np.arange(800), np.arange(800) % 3] = HALF_ROOM
    tracks = tuple([np.array([0, 3, 6])] * 500 + [np.array([1])] * 300)
    data = replace(data, points=Points(walls, np.full((800, 3), 128, np.uint8), tracks))
    wanted = {"auto": "scene and sweep", "scene": "scene", "selected": "selected", "sweep": "sweep"}
    wanted |= {"rays": "rays", "random": "random"}
    for source, name in wanted.items():
        gaussians, record = seed(data, options(points=source), np.random.default_rng(0))
        assert record["source"] == name
        assert record["points"] == source
        parts = [record[f"{part}_points"] for part in ("scene", "sweep", "guessed", "ray", "random", "shell")]
        assert sum(parts) == record["count"] == gaussians.shape[1] <= 3000
        assert np.isfinite(gaussians).all()
        assert record["scene_points"] == {"auto": 800, "scene": 800, "selected": 500}.get(source, 0)
    _, record = seed(data, options(points="auto", gaussians=1100), np.random.default_rng(0))
    assert (record["scene_points"], record["sweep_points"] + record["guessed_points"]) == (700, 300)


def test_unsure_points_start_almost_transparent(walk):
    data, _ = walk
    gaussians, record = seed(data, options(points="sweep"), np.random.default_rng(0))
    opacity = 1 / (1 + np.exp(-gaussians[LOGIT].astype(np.float64)))
    sure = opacity > 0.3
    assert sure.sum() == record["sweep_points"] + record["shell_points"]
    of_the_sweep = np.abs(opacity - 0.4) < 0.01
    assert of_the_sweep.sum() == record["sweep_points"]
    far = on_walls(gaussians[MEAN : MEAN + 3].T.astype(np.float64))
    assert np.quantile(far[of_the_sweep], 0.95) < 0.12


def test_views_that_no_other_helps_are_seeded_too():
    """Ten neighbours and one view that looks the other way: its pixels are seeded at depths found elsewhere."""
    turn = np.linspace(-0.2, 0.2, 10)
    positions = np.stack([np.zeros(10), np.zeros(10), 0.5 * np.linspace(-1, 1, 10)], axis=1)
    data, _ = room(np.concatenate([positions, [[0, 0, 0]]]), np.append(turn, np.pi))
    gaussians, record = seed(data, options(points="sweep", shell=0), np.random.default_rng(0))
    assert record["sweep_views"] == 10
    assert record["ray_points"] > 0
    means = gaussians[MEAN : MEAN + 3].T
    behind = means[means[:, 0] < 0]
    assert len(behind) >= record["ray_points"]
    assert np.abs(behind).max() < 4 * HALF_ROOM


@pytest.mark.parametrize("points", ["auto", "sweep"])
def test_without_overlap_it_falls_back_and_says_so(points):
    data, _ = scattered(4)
    gaussians, record = seed(data, options(points=points), np.random.default_rng(0))
    assert record["source"] == "rays"
    assert record["ray_points"] == 2900
    assert "fewer than 500" in record["fallback"]
    assert np.isfinite(gaussians).all()


def test_a_few_scene_points_are_kept_beside_rays():
    data, _ = scattered(4)
    few = Points(np.random.default_rng(0).uniform(-1, 1, (30, 3)), np.zeros((30, 3), np.uint8))
    _, record = seed(replace(data, points=few), options(), np.random.default_rng(0))
    assert (record["source"], record["scene_points"], record["ray_points"]) == ("scene and rays", 30, 2870)


@pytest.mark.parametrize(
    "changed",
    [{"gaussians": 0}, {"shell": -1}, {"sweep": float("nan")}, {"opacity": 1.0}, {"scale": 0.0}, {"sh_degree": 4}],
)
def test_values_that_make_no_sense_are_refused(changed):
    with pytest.raises(UserError, match=f"{next(iter(changed))}=.*expected a value from"):
        Options(**changed)


def test_every_number_has_limits():
    from dataclasses import fields

    from viewbench.backends.splat.options import LIMITS

    assert set(LIMITS) == {item.name for item in fields(Options) if item.type in (int, float)}


@pytest.mark.parametrize("factor", [1e-5, 1e5])
def test_the_unit_of_length_does_not_matter(walk, factor):
    """The same scene in millimetres: the same start, in millimetres."""
    data, _ = walk
    walls = np.random.default_rng(5).uniform(-HALF_ROOM, HALF_ROOM, (800, 3))
    data = replace(data, points=Points(walls, np.full((800, 3), 128, np.uint8)))
    poses = data.cameras.c2w.copy()
    poses[:, :3, 3] *= factor
    cameras_ = replace(data.cameras, c2w=poses)
    larger = replace(data, cameras=cameras_, training=cameras_, points=Points(walls * factor, data.points.rgb))
    first, record = seed(data, options(), np.random.default_rng(0))
    second, other = seed(larger, options(), np.random.default_rng(0))
    assert record == other
    scale = np.abs(first[MEAN : MEAN + 3]).max()
    # In another order, where rounding puts one of two neighbours into another cell of the curve.
    _, same = known(KDTree(first[MEAN : MEAN + 3].T).query(second[MEAN : MEAN + 3].T / factor))
    np.testing.assert_array_equal(np.sort(same), np.arange(first.shape[1]))
    np.testing.assert_allclose(second[MEAN : MEAN + 3] / factor, first[MEAN : MEAN + 3, same], atol=1e-4 * scale)
    np.testing.assert_allclose(second[7:10] - np.log(factor), first[7:10, same], atol=2e-3)


def test_neighbours_in_storage_are_neighbours_in_space():
    points = np.random.default_rng(6).uniform(-1, 1, (4000, 3))
    points[::50] *= 4  # beyond the curve
    order = along_curve(points)
    np.testing.assert_array_equal(np.sort(order), np.arange(4000))
    assert (along_curve(points[order]) == np.arange(4000)).all()
    inside = points[order][np.abs(points[order]).max(axis=1) <= 1]

    def reach(ordered):
        blocks = ordered[: len(ordered) // 16 * 16].reshape(-1, 16, 3)
        return np.prod(np.ptp(blocks, axis=1), axis=1).mean()

    assert reach(inside) < 0.1 * reach(np.random.default_rng(7).permutation(inside))


@pytest.mark.parametrize("count", [1, 2, 5, 40])
def test_few_gaussians_are_still_some(walk, count):
    for source in ("auto", "sweep", "rays"):
        gaussians, record = seed(walk[0], options(points=source, gaussians=count), np.random.default_rng(0))
        assert gaussians.shape[1] == record["count"] <= count
        assert record["count"] > 0
        assert np.isfinite(gaussians).all()


def test_cameras_in_one_place_have_no_depth():
    """A tripod: no baseline, no sweep, and nothing that divides by nothing."""
    data, _ = room(np.zeros((6, 3)), np.linspace(0, 2, 6))
    gaussians, record = seed(data, options(points="sweep"), np.random.default_rng(0))
    assert record["source"] == "rays"
    assert np.isfinite(gaussians).all()


def test_the_same_seed_starts_the_same(walk):
    data, _ = walk
    first, again, other = (seed(data, options(), np.random.default_rng(n))[0] for n in (1, 1, 2))
    assert first.tobytes() == again.tobytes() != other.tobytes()


def test_the_shell_has_the_colours_that_look_its_way(walk):
    data, _ = walk
    level = cameras(np.zeros((4, 3)), np.arange(4) * np.pi / 2)
    images = np.zeros((4, SIZE, SIZE, 3), np.float32)
    images[0], images[1], images[2:] = [1, 0, 0], [0, 1, 0], [0, 0, 1]  # red along x, green along z, blue behind
    data = replace(data, cameras=level, images=images, chosen=np.arange(4))
    around = replace(surroundings(data.training, None), centre=np.zeros(3), extent=2.0)
    positions, colours, size = shell(data, 400, around)
    np.testing.assert_allclose(np.linalg.norm(positions, axis=1), np.linalg.norm(positions[0]))
    unit = positions / np.linalg.norm(positions[0])
    assert (colours[unit[:, 0] > 0.95] == [1, 0, 0]).all()
    assert (colours[unit[:, 2] > 0.95] == [0, 1, 0]).all()
    above = colours[unit[:, 1] > 0.95]  # that nobody looks at
    np.testing.assert_allclose(above.sum(axis=1), 1)
    nearest = np.linalg.norm(unit[:, None] - unit, axis=2)
    assert 0.3 < size / (np.linalg.norm(positions[0]) * np.sort(nearest, axis=1)[:, 1].mean()) < 2


def test_points_along_rays_project_onto_their_pixels(walk):
    data, _ = walk
    start = along_rays(data, 200, 3.0, np.random.default_rng(3))
    points, colours = start.points, start.colours
    inside = np.zeros(200, int)
    for camera, image in zip(data.cameras, data.images, strict=True):
        x, y, z = (np.c_[points, np.ones(200)] @ camera.world_to_camera()[0].T)[:, :3].T
        column = np.floor(camera.fx[0] * x / z + camera.cx[0] + 1e-9)
        row = np.floor(camera.fy[0] * y / z + camera.cy[0] + 1e-9)
        ok = (z > 0) & (column >= 0) & (column < SIZE) & (row >= 0) & (row < SIZE)
        match = np.zeros(200, bool)
        match[ok] = (image[row[ok].astype(int), column[ok].astype(int)] == colours[ok].astype(np.float32)).all(axis=1)
        inside += match
    assert (inside >= 1).all()
