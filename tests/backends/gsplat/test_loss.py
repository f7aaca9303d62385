"""The loss of 3DGS against scikit-image's structural similarity."""

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from viewbench.backends.gsplat.loss import loss, ssim  # noqa: E402 - it imports torch


def pair(size: int = 40):
    rng = np.random.default_rng(1)
    truth = rng.random((size, size, 3))
    return np.clip(truth + rng.normal(0, 0.1, truth.shape), 0, 1), truth


def test_ssim_inside_the_border_is_scikit_image_s():
    from skimage.metrics import structural_similarity

    image, truth = pair()
    settings = {"channel_axis": 2, "data_range": 1.0, "gaussian_weights": True, "sigma": 1.5}
    expected = structural_similarity(image, truth, use_sample_covariance=False, full=True, **settings)[1]
    padded = [np.pad(part, ((5, 5), (5, 5), (0, 0))) for part in (image, truth)]
    with_border = structural_similarity(*padded, use_sample_covariance=False, full=True, **settings)[1]
    got = float(ssim(torch.from_numpy(image), torch.from_numpy(truth)))
    assert got == pytest.approx(with_border[5:-5, 5:-5].mean(), abs=1e-6)
    assert got == pytest.approx(expected.mean(), abs=0.05)


def test_loss_is_zero_for_equal_images_and_weighs_both_parts():
    image, truth = (torch.from_numpy(part) for part in pair())
    assert float(loss(truth, truth)) == pytest.approx(0, abs=1e-9)
    expected = 0.8 * (image - truth).abs().mean() + 0.2 * (1 - ssim(image, truth))
    assert float(loss(image, truth)) == pytest.approx(float(expected))
