"""What is trained on at first and what later: pictures of half the size, then whole ones.

A step on a picture of half the size costs about a third and moves the large parts as well, so that large pictures,
for which a budget of seconds holds few steps, gain by starting with it.
"""

import math

import numpy as np

from ...scenes.types import Cameras
from .._shrink import cameras_shrunk, images_shrunk
from .._types import TrainingSet
from .options import Rendering
from .projection import camera_vectors
from .trainer import Trainer

SMALLEST = 80  # pixels: geometric mean of the sides that halved pictures must have


class Stage:
    """Training views of one size, K pictures (K, H, W, 3), as the trainer takes them."""

    def __init__(self, images: np.ndarray, cameras: Cameras, count: int, rendering: Rendering):
        self.trainer = Trainer(count, images.shape[2], images.shape[1], rendering)
        self.cameras = camera_vectors(cameras)
        self.targets = [self.trainer.target(image) for image in images]


def halved(data: TrainingSet, count: int, rendering: Rendering) -> Stage | None:
    """The views at half their size; None where that leaves too little to learn from."""
    _, height, width, _ = data.images.shape
    if math.sqrt((height // 2) * (width // 2)) < SMALLEST:
        return None
    return Stage(images_shrunk(data.images, 2), cameras_shrunk(data.cameras, 2), count, rendering)
