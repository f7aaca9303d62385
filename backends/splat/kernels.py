"""Numbers that the kernels share, in single precision."""

import numpy as np

F = np.float32
ZERO, HALF, ONE, TWO = F(0), F(0.5), F(1), F(2)
LOG2E = F(1.4426950408889634)
