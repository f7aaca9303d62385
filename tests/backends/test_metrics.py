"""Scores against what they are defined to be."""

import math

import numpy as np
import pytest
import torch

from tests.backends.splat import reference
from viewbench.backends._metrics import lpips, lpips_weights, ssim
from viewbench.backends._psnr import psnr_db
from viewbench.common.errors import UserError


def test_psnr_of_a_known_difference():
    image = np.full((4, 5, 3), 0.5)
    assert psnr_db(image, image) == math.inf
    assert abs(psnr_db(image + 0.1, image) - 20) < 1e-9  # -10 log10(0.1²)
    assert abs(psnr_db(image - 0.01, image) - 40) < 1e-9


def test_ssim_is_that_of_the_reference_away_from_the_edges():
    """The two differ in how they continue a picture beyond its edges and in nothing else."""
    rng = np.random.default_rng(0)
    truth = rng.uniform(0, 1, (40, 50, 3))
    image = np.clip(truth + 0.1 * rng.normal(size=truth.shape), 0, 1)
    assert abs(ssim(truth, truth) - 1) < 1e-12
    plain = reference.ssim(torch.tensor(image.transpose(2, 0, 1)), torch.tensor(truth.transpose(2, 0, 1))).item()
    assert abs(ssim(image, truth) - plain) < 0.02
    assert math.isnan(ssim(truth[:8], truth[:8]))


def test_lpips_with_weights_on_disk(tmp_path):
    from viewbench.common.torchvision_cpu import import_torchvision

    import_torchvision()
    pytest.importorskip("lpips")
    torch.manual_seed(0)
    weights = tmp_path / "alexnet.pth"
    torch.save(import_torchvision().models.alexnet(weights=None).state_dict(), weights)
    rng = np.random.default_rng(0)
    truth = rng.uniform(0, 1, (64, 64, 3)).astype(np.float32)
    near, far = (np.clip(truth + size * rng.normal(size=truth.shape), 0, 1).astype(np.float32) for size in (0.05, 0.5))
    assert lpips_weights(str(weights)) == weights
    assert lpips(truth, truth, weights) < 1e-6
    assert 0 < lpips(near, truth, weights) < lpips(far, truth, weights)


def test_missing_weights(monkeypatch, tmp_path):
    lpips_weights.cache_clear()
    monkeypatch.setenv("HOME", str(tmp_path))
    assert lpips_weights("") is None
    with pytest.raises(UserError, match="lpips_weights"):
        lpips_weights(str(tmp_path / "nothing.pth"))
