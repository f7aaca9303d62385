"""PSNR of a rendered view: its own file, since training curves use it and the other scores are not theirs."""

import math

import numpy as np


def psnr_db(image: np.ndarray, truth: np.ndarray) -> float:
    """Peak signal-to-noise ratio in dB, data range 1: -10 log10 of the mean squared error.

    image, truth: (H, W, 3) in [0, 1]. Equal images give infinity. Two images that differ by 0.1 everywhere give 20.
    """
    error = float(np.mean((image.astype(np.float64) - truth.astype(np.float64)) ** 2))
    return math.inf if error == 0 else -10 * math.log10(error)
