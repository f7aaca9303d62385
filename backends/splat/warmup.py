"""Compiles the kernels once, so that the jobs of a study load them from numba's cache."""

import numpy as np

from ...scenes.types import Cameras
from .._points.agreement import agreeing
from .._points.plane_sweep import sweep
from . import layout
from .backward import Moments, Rates
from .options import Rendering
from .projection import camera_vectors
from .trainer import Trainer, Weights


def compile_kernels() -> None:
    """One step of training on one Gaussian, and one sweep: every kernel, with the types that training calls it with."""
    one = np.ones(1)
    size = np.full(1, 16, np.int64)
    cameras = Cameras(np.eye(4)[None], 16 * one, 16 * one, 8 * one, 8 * one, size, size)
    trainer = Trainer(4, 16, 16, Rendering())
    gaussians = layout.empty(4, 1)
    gaussians[layout.MEAN + 2] = -2
    gaussians[layout.LOGIT] = 1
    target = trainer.target(np.zeros((16, 16, 3), np.float32))
    rates, weights = Rates.of_step(1, np.full(len(gaussians), 1e-3)), Weights(0.2, 1e-3, 1e-3)
    trainer.step(gaussians, Moments.zeros(gaussians), camera_vectors(cameras)[0], target, rates, weights)
    picture = np.zeros((8, 8), np.float32)
    sweep(picture, picture[None], np.zeros((1, 3, 4)), np.ones(1), picture.copy(), picture.copy())
    first = np.zeros(1, np.int64)
    agreeing(np.zeros((1, 3)), first, np.zeros((1, 3, 4)), np.zeros((1, 4, 4)), picture[None], 0.1, first.copy())
