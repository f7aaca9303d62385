"""Points that the chosen views alone tell: those of the capture that two of them see, and new ones by COLMAP."""

import numpy as np
import pycolmap
import pytest

from tests.conftest import known
from tests.scenes.test_transforms import frames, opened, write
from viewbench.common.errors import UserError
from viewbench.common.settings import load as load_settings
from viewbench.scenes.chosen_points import EXHAUSTIVE, NEIGHBOURS, near_pairs, seen, triangulated
from viewbench.scenes.load import open_scene
from viewbench.scenes.subset import write_subset


def test_points_that_two_chosen_views_see(data_root, tmp_path):
    scene = open_scene("hololens_space", load_settings())
    chosen = list(range(0, len(scene.train), 10))
    fewer = known(seen(scene, chosen).points)
    tracks = known(known(scene.points).seen_by)
    wanted = [k for k, views in enumerate(tracks) if len(set(views.tolist()) & set(chosen)) >= 2]
    np.testing.assert_array_equal(fewer.xyz, known(scene.points).xyz[wanted])
    write_subset(seen(scene, chosen), {"indices": chosen}, tmp_path / "out")
    model = pycolmap.Reconstruction(tmp_path / "out" / "sparse" / "0")
    assert model.num_points3D() == len(wanted)
    assert all(point.track.length() >= 2 for point in model.points3D.values())


def test_without_tracks_there_is_nothing_to_tell(small_room):
    with pytest.raises(UserError, match="which views see a point"):
        seen(opened(small_room), [0, 1])


def test_triangulated_points_lie_where_the_capture_has_them(data_root, tmp_path):
    """Twelve neighbours of a real walk: most new points are close to one that the whole capture gave."""
    scene = open_scene("hololens_space", load_settings())
    chosen = list(range(40, 76, 3))
    made = triangulated(scene, chosen[::-1])
    points = known(made.points)
    assert len(points) > 100
    from scipy.spatial import KDTree

    apart, _ = KDTree(known(scene.points).xyz).query(points.xyz)
    extent = np.ptp(scene.train.cameras.positions, axis=0).max()
    assert np.median(apart) < 0.01 * extent
    assert {int(i) for views in known(points.seen_by) for i in views} <= set(chosen)
    write_subset(made, {"indices": chosen}, tmp_path / "out")
    model = pycolmap.Reconstruction(tmp_path / "out" / "sparse" / "0")
    assert sorted(image.name for image in model.images.values()) == [scene.train.names[i] for i in chosen]
    assert (model.num_points3D(), model.compute_mean_reprojection_error() < 2) == (len(points), True)
    again = open_scene(str(tmp_path / "out"), load_settings())
    np.testing.assert_allclose(again.train.cameras.c2w, scene.train.cameras.c2w[chosen], atol=1e-9)
    assert len(known(again.points)) == len(points)


def test_pictures_of_nothing_have_no_points(tmp_path):
    listed = frames("a.png", "b.png")
    listed[1]["transform_matrix"] = [[1, 0, 0, 0.1], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
    scene = opened(write(tmp_path, listed, size=(64, 48), fl_x=50))
    with pytest.raises(UserError, match="no point could be triangulated"):
        triangulated(scene, [0, 1])


def test_pairs_are_of_views_that_look_the_same_way(data_root):
    cameras = open_scene("hololens_space", load_settings()).train.cameras
    few = near_pairs(cameras[:EXHAUSTIVE])
    every = [(i, j) for i in range(EXHAUSTIVE) for j in range(i + 1, EXHAUSTIVE)]
    forward = cameras.forward[:EXHAUSTIVE]
    assert few == [(i, j) for i, j in every if np.arccos(np.clip(forward[i] @ forward[j], -1, 1)) <= 2.0]
    many = near_pairs(cameras)
    assert len(many) <= len(cameras) * NEIGHBOURS
    assert all((i, i + 1) in many for i in range(0, len(cameras) - 1, 25)), "neighbours of a walk"
