"""Pictures in planes that are padded by zeros, so that the loss's windows are long flat loops."""

import numpy as np

RADIUS = 5  # pixels, of the loss's window: the padding


class Planes:
    """Sizes of the padded planes of pictures of one size."""

    def __init__(self, width: int, height: int):
        self.width, self.height = width, height
        self.stride = -(-(width + 2 * RADIUS) // 16) * 16
        self.rows = height + 2 * RADIUS + 2  # tiles of 8 pixels may reach 7 beyond the picture, and are read whole
        self.size = self.rows * self.stride

    def zeros(self, count: int) -> np.ndarray:
        """(count, size) float32."""
        return np.zeros((count, self.size), np.float32)

    def inside(self, planes: np.ndarray) -> np.ndarray:
        """The picture inside padded planes, (…, H, W), not a copy."""
        shaped = planes.reshape(*planes.shape[:-1], self.rows, self.stride)
        return shaped[..., RADIUS : RADIUS + self.height, RADIUS : RADIUS + self.width]
