"""What every choice of views is told alike: size, depths and seeds of a scene."""

from dataclasses import replace

import numpy as np
import pytest

from viewbench.backends import _train
from viewbench.backends._points import knowing
from viewbench.backends._surroundings import GUESSED_FAR, surroundings
from viewbench.backends._types import Budget, Job
from viewbench.backends.splat.initial import initial
from viewbench.backends.splat.options import Options
from viewbench.common.settings import load as load_settings
from viewbench.scenes.load import open_scene
from viewbench.scenes.types import Points


def around(data, points="scene"):
    return surroundings(data.training, data.points if points == "scene" else None)


@pytest.mark.parametrize("points", ["scene", "none"])
def test_they_are_the_same_whatever_was_chosen(take_views, points):
    first, second = (around(take_views(chosen), points) for chosen in ((0, 1, 2), tuple(range(0, 400, 9))))
    assert first.centre.tolist() == second.centre.tolist()
    assert (first.extent, first.nearest, first.depths) == (second.extent, second.nearest, second.depths)


def test_extent_is_that_of_3dgs(take_views):
    positions = take_views().training.positions
    away = [np.sqrt(((p - positions.mean(axis=0)) ** 2).sum()) for p in positions]
    assert around(take_views()).extent == pytest.approx(1.1 * max(away))


def test_depths_are_those_of_the_points_in_the_training_views(take_views):
    """Against a loop over views and points."""
    data = take_views()
    depths = []
    for camera in data.training:
        seen = np.c_[data.points.xyz, np.ones(200)] @ camera.world_to_camera()[0].T
        u = camera.fx * seen[:, 0] / seen[:, 2] + camera.cx
        v = camera.fy * seen[:, 1] / seen[:, 2] + camera.cy
        inside = (seen[:, 2] > 0) & (u > 0) & (v > 0) & (u < camera.width) & (v < camera.height)
        depths += seen[inside, 2].tolist()
    nearest, near, far = np.quantile(depths, [0.001, 0.01, 0.99])
    found = around(data)
    assert (found.nearest, *found.depths) == pytest.approx((nearest, 0.5 * near, 3 * far))


def test_tracks_say_which_views_see_a_point(take_views):
    data = take_views()
    tracks = tuple(np.array([7]) if i % 2 else np.array([], np.int64) for i in range(200))
    w2c = data.training.world_to_camera()[7]
    depths = (np.c_[data.points.xyz, np.ones(200)] @ w2c.T)[1::2, 2]
    depths = depths[depths > 0]
    found = surroundings(data.training, replace(data.points, seen_by=tracks * 1))
    if len(depths) >= 100:
        assert found.nearest == pytest.approx(np.quantile(depths, 0.001))
    else:
        assert found.depths[1] == pytest.approx(GUESSED_FAR * found.extent)


def test_a_long_path_does_not_move_the_near_plane_as_far_as_it_is_long(take_views):
    data = take_views()
    poses = data.training.c2w.copy()
    poses[:, :3, 3] = [0, 0, 0] + np.linspace(0, 1, 400)[:, None] * [100, 0, 0]
    poses[:, 1, 3] = np.sin(np.arange(400))
    corridor = replace(data.training, c2w=poses)
    assert surroundings(corridor, None).nearest < 0.07 * surroundings(corridor, None).extent
    points = Points(np.random.default_rng(0).uniform(-2, 2, (2000, 3)) + [50, 0, 0], np.zeros((2000, 3), np.uint8))
    longer = replace(data.training, c2w=poses + np.eye(4)[3] * 0)
    assert surroundings(longer, points).nearest < 3


@pytest.mark.parametrize("source", ["sweep", "rays", "random"])
def test_a_start_without_points_sees_none_of_them(take_views, source):
    """The scene's points moved away change nothing that a sweep or rays find: not even the range of depths."""
    data = take_views(tuple(range(0, 400, 20)))
    o = Options(points=source, gaussians=2000)

    def start(points):
        seen = knowing(replace(data, points=points), source)
        return initial(seen, o, surroundings(data.training, seen.points), np.random.default_rng(0))[0]

    moved = Points(data.points.xyz * 100, data.points.rgb)
    assert np.array_equal(start(data.points), start(moved))
    assert np.array_equal(start(data.points), start(None))


def test_the_scene_points_that_are_drawn_are_the_same_for_every_choice(small_room, tmp_path, monkeypatch):
    """Half of the points fit: which of them must not depend on the views or on who chose them."""
    scene, settings = open_scene(str(small_room), load_settings()), load_settings()
    drawn = []

    def spy(data, o, known, rng):
        gaussians, record = initial(data, o, known, rng)
        drawn.append(gaussians[:3, : record.scene_points].tobytes())
        return gaussians, record

    monkeypatch.setattr("viewbench.backends.splat.loop.initial", spy)
    choices = [("random", [0, 4]), ("maxmin", [1, 5, 9]), ("full", list(range(12)))]
    for number, (selector, indices) in enumerate(choices):
        names = [scene.train.names[i] for i in indices]
        chosen = {"indices": indices, "names": names, "n_views": 12, "selector": selector, "seed": number}
        job = Job("splat", 3, Budget(1), 48, {"gaussians": 900, "points": "scene"}, curve=False)
        _train.train(scene, chosen, job, tmp_path / str(number), settings=settings)
    assert len(set(drawn)) == 1
