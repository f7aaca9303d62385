"""gsplat's CUDA kernels against splat's: the same Gaussians, the same pictures. Skipped without a GPU; `make gpu`."""

import dataclasses

import numpy as np
import pytest

from viewbench.backends import _gaussian_ply, gsplat
from viewbench.backends._points import Start
from viewbench.backends.splat import ply
from viewbench.backends.splat.loop import draw
from viewbench.backends.splat.options import Rendering


@pytest.mark.parametrize("degree", [0, 3])
def test_cuda_kernels_draw_what_splat_draws(take_views, tmp_path, degree):
    backend = gsplat.Gsplat()
    reason = backend.available()
    if reason:
        pytest.skip(reason)
    from viewbench.backends.gsplat.gaussians import initial
    from viewbench.backends.gsplat.renderer import NEAR, Renderer

    views = take_views(width=128)
    gaussians = initial([Start(views.points.xyz, views.points.rgb / 255, "scene")], "mcmc", degree, 1.0)
    rng = np.random.default_rng(2)
    shn = rng.normal(0, 0.2, gaussians.shn.shape).astype(np.float32)
    gaussians = dataclasses.replace(gaussians, shn=shn, scales=gaussians.scales + 1.5)
    _gaussian_ply.save(tmp_path / "model.ply", gaussians)
    renderer = Renderer(backend.rasterizer(), backend.device, 0.5, 0.0)
    theirs = np.array(list(renderer.images(renderer.parameters(gaussians), views.cameras, degree)))
    how = Rendering(near=NEAR, background=0.5)
    ours = np.array(list(draw(ply.read(tmp_path / "model.ply"), views.cameras, how)))
    difference = np.abs(ours - theirs)
    assert theirs.std() > 0.05
    assert difference.max() <= 1 / 255
    assert np.quantile(difference, 0.999) < 1e-3
