"""EfficientNet-Lite0 (Tan and Le 2019, less squeeze-and-excitation, with ReLU6) up to its last convolution, in numpy.

Maps are (height, width, channels) of one picture, float32. A batch normalisation after a convolution is folded into it:
γ (w∗x − μ) / √(σ² + ε) + β is a convolution by w γ / √(σ² + ε) with the bias β − μ γ / √(σ² + ε).
A pointwise convolution is a matrix product, a depthwise one a sum of products over its taps, which einsum does in one
pass over the map. Pictures are done one by one, so that what a picture gives does not depend on those beside it.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

EPSILON = 1e-3
STEM = 3, 2  # taps a side and stride of the first convolution
STRIDES = (1, 2, 1, 2, 1, 2, 1, 1, 1, 1, 1, 2, 1, 1, 1, 1)  # of the blocks


@dataclass(frozen=True)
class Convolution:
    """weight (inputs, outputs) of a pointwise one, (taps, taps, channels) of a depthwise one; bias (outputs,)."""

    weight: np.ndarray
    bias: np.ndarray


@dataclass(frozen=True)
class Block:
    """An inverted residual: expand the channels, filter each, project to fewer."""

    expand: Convolution | None  # the first block has none
    filter: Convolution
    project: Convolution
    stride: int

    @property
    def adds(self) -> bool:
        """Whether input and output have one shape, so that the block adds to what it is given."""
        return self.stride == 1 and self.expand is not None and len(self.expand.weight) == len(self.project.bias)


@dataclass(frozen=True)
class Network:
    stem: Convolution  # weight (27, 32): 3 × 3 pixels of three colours
    blocks: tuple[Block, ...]
    head: Convolution

    def features(self, picture: np.ndarray) -> np.ndarray:
        """(1280,) of a picture (H, W, 3) that is normalised already: the last maps' averages."""
        patches = _windows(picture, *STEM)  # (h, w, 3 colours, 3, 3)
        x = _relu6(patches.reshape(*patches.shape[:2], -1) @ self.stem.weight, self.stem.bias)
        for block in self.blocks:
            y = x if block.expand is None else _relu6(x @ block.expand.weight, block.expand.bias)
            windows = _windows(y, len(block.filter.weight), block.stride)
            y = _relu6(np.einsum("ijcyx,yxc->ijc", windows, block.filter.weight), block.filter.bias)
            y = y @ block.project.weight + block.project.bias
            x = x + y if block.adds else y
        return _relu6(x @ self.head.weight, self.head.bias).mean(axis=(0, 1))


def network(tensors: Mapping[str, np.ndarray]) -> Network:
    """The network of the weights (outputs, inputs, taps, taps) and statistics as efficientnet_lite_pytorch names them.

    Raises KeyError for one that is missing.
    """

    def folded(convolution: str, norm: str) -> tuple[np.ndarray, np.ndarray]:
        """(taps, taps, inputs, outputs) and (outputs,)."""
        scale = tensors[f"{norm}.weight"] / np.sqrt(tensors[f"{norm}.running_var"] + EPSILON)
        weight = tensors[f"{convolution}.weight"] * scale[:, None, None, None]
        bias = tensors[f"{norm}.bias"] - tensors[f"{norm}.running_mean"] * scale
        return np.ascontiguousarray(weight.transpose(2, 3, 1, 0)), bias

    def pointwise(convolution: str, norm: str) -> Convolution:
        weight, bias = folded(convolution, norm)
        return Convolution(weight[0, 0], bias)

    def block(name: str, stride: int) -> Block:
        weight, bias = folded(f"{name}._depthwise_conv", f"{name}._bn1")
        first = f"{name}._expand_conv.weight" not in tensors
        return Block(
            expand=None if first else pointwise(f"{name}._expand_conv", f"{name}._bn0"),
            filter=Convolution(weight[:, :, 0], bias),
            project=pointwise(f"{name}._project_conv", f"{name}._bn2"),
            stride=stride,
        )

    stem, bias = folded("_conv_stem", "_bn0")
    return Network(
        stem=Convolution(stem.transpose(2, 0, 1, 3).reshape(27, -1), bias),
        blocks=tuple(block(f"_blocks.{number}", stride) for number, stride in enumerate(STRIDES)),
        head=pointwise("_conv_head", "_bn1"),
    )


def _windows(x: np.ndarray, taps: int, stride: int) -> np.ndarray:
    """(⌈H / stride⌉, ⌈W / stride⌉, C, taps, taps) pixels around each output; zeros outside, as TensorFlow pads."""
    sizes = [math.ceil(size / stride) for size in x.shape[:2]]
    missing = [max((out - 1) * stride + taps - size, 0) for out, size in zip(sizes, x.shape[:2], strict=True)]
    before = [size // 2 for size in missing]
    padded = np.zeros((x.shape[0] + missing[0], x.shape[1] + missing[1], x.shape[2]), dtype=np.float32)
    padded[before[0] : before[0] + x.shape[0], before[1] : before[1] + x.shape[1]] = x
    return sliding_window_view(padded, (taps, taps), axis=(0, 1))[::stride, ::stride]


def _relu6(x: np.ndarray, bias: np.ndarray) -> np.ndarray:
    """min(max(x + bias, 0), 6), in the place of x."""
    np.add(x, bias, out=x)
    return np.clip(x, 0, 6, out=x)
