"""What is trained on at first and what later: pictures of half the size, then whole ones.

A step on a picture of half the size costs about a third and moves the large parts as well, so that large pictures,
for which a budget of seconds holds few steps, gain by starting with it.
"""

import math

from ...scenes.types import Cameras
from .._shrink import cameras_shrunk, image_shrunk
from .._types import Images, TrainingSet
from .loss import Target
from .options import Rendering
from .projection import camera_vectors
from .team import Team
from .trainer import Trainer

SMALLEST = 80  # pixels: geometric mean of the sides that halved pictures must have
# Bytes of targets that are kept, a quarter of them for half the size. Those of other views are made when they come up,
# in a small part of the time of a step.
TARGETS = 512 << 20


class Stage:
    """Training views of one size, `factor` times smaller than K pictures (K, H, W, 3), as the trainer takes them."""

    def __init__(self, images: Images, cameras: Cameras, count: int, rendering: Rendering, team: Team, factor: int = 1):
        self.trainer = Trainer(count, images.shape[2] // factor, images.shape[1] // factor, rendering, team)
        self.cameras = camera_vectors(cameras)
        self._images, self._factor = images, factor
        planes = self.trainer.renderer.planes
        self._other = Target.zeros(planes)
        views = min(len(images), TARGETS // factor**2 // self._other.nbytes)
        self._kept = [self._filled(Target.zeros(planes), view) for view in range(views)]

    def target(self, view: int) -> Target:
        """What a view's picture is to the trainer, the same bits whether it was kept or not; until the next call."""
        return self._kept[view] if view < len(self._kept) else self._filled(self._other, view)

    def _filled(self, target: Target, view: int) -> Target:
        return target.filled(image_shrunk(self._images[view], self._factor), self.trainer.renderer.planes)


def halved(data: TrainingSet, count: int, rendering: Rendering, team: Team) -> Stage | None:
    """The views at half their size; None where that leaves too little to learn from."""
    _, height, width, _ = data.images.shape
    if math.sqrt((height // 2) * (width // 2)) < SMALLEST:
        return None
    return Stage(data.images, cameras_shrunk(data.cameras, 2), count, rendering, team, factor=2)
