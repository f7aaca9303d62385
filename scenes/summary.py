"""The facts of a scene that people and programs ask for first."""

from typing import Any

import numpy as np

from .types import UNCALIBRATED, Scene


def summary(scene: Scene) -> dict[str, Any]:
    """Format, frames per split, image size (pixels), focal lengths (pixels), extent (scene units) and points."""
    cameras = scene.train.cameras
    sizes = sorted({(int(w), int(h)) for w, h in zip(cameras.width, cameras.height, strict=True)})
    unknown = scene.train.lens == UNCALIBRATED or not scene.posed
    extent = np.ptp(cameras.positions, axis=0)
    return {
        "scene": scene.name,
        "path": str(scene.root),
        "format": scene.format,
        "training_views": len(scene.train),
        "test_views": len(scene.test),
        "test_split": scene.holdout,
        "poses": scene.posed,
        "image_size": [f"{width} x {height}" for width, height in sizes],
        "focal_length": [] if unknown else sorted({round(float(f), 2) for f in cameras.fx})[:5],
        "distorted": cameras.distortion is not None,
        "camera_extent": [round(float(value), 4) for value in extent] if scene.posed else [],
        "points": 0 if scene.points is None else len(scene.points),
        "tracks": scene.points is not None and scene.points.seen_by is not None,
        "times": scene.train.times is not None,
        "notes": list(scene.notes),
    }
