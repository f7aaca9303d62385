"""Gaussians in the 3DGS authors' PLY layout."""

import numpy as np
import pytest
from plyfile import PlyData

from viewbench.backends import _gaussian_ply
from viewbench.common.errors import UserError


def some(degree: int, count: int = 7) -> _gaussian_ply.Gaussians:
    rng = np.random.default_rng(degree)
    shapes = {"means": (3,), "scales": (3,), "quats": (4,), "opacities": (), "sh0": (3,)}
    arrays = {name: rng.normal(size=(count, *shape)).astype(np.float32) for name, shape in shapes.items()}
    return _gaussian_ply.Gaussians(**arrays, shn=rng.normal(size=(count, (degree + 1) ** 2 - 1, 3)).astype(np.float32))


@pytest.mark.parametrize("degree", [0, 1, 2, 3])
def test_what_is_written_is_read_back(tmp_path, degree):
    gaussians = some(degree)
    _gaussian_ply.save(tmp_path / "model.ply", gaussians)
    back = _gaussian_ply.load(tmp_path / "model.ply")
    assert back.degree == degree
    for name, array in vars(gaussians).items():
        assert np.array_equal(getattr(back, name), array), name


def test_layout_is_that_of_the_viewers(tmp_path):
    gaussians = some(3)
    _gaussian_ply.save(tmp_path / "model.ply", gaussians)
    vertex = PlyData.read(str(tmp_path / "model.ply"))["vertex"]
    assert len(vertex.properties) == 62
    assert np.array_equal(vertex["f_rest_0"], gaussians.shn[:, 0, 0])
    assert np.array_equal(vertex["f_rest_14"], gaussians.shn[:, 14, 0]), "all of red comes first"
    assert np.array_equal(vertex["f_rest_15"], gaussians.shn[:, 0, 1])
    assert np.array_equal(vertex["rot_0"], gaussians.quats[:, 0])


def test_other_files_are_refused(tmp_path):
    with pytest.raises(UserError, match="cannot be read"):
        _gaussian_ply.load(tmp_path / "none.ply")
    (tmp_path / "text.ply").write_text("hello")
    with pytest.raises(UserError, match="not a PLY file of 3D Gaussians"):
        _gaussian_ply.load(tmp_path / "text.ply")
