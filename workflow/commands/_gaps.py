"""`select --max-gap`: the selection that leaves no large gap in the capture, and what it says of it."""

from collections.abc import Callable
from typing import Any

import click
import numpy as np

from ...scenes.thinning import frame_number
from ...scenes.types import Scene
from ...selectors._chain import chained, check_count, gap_of, largest_gap, record_of


def without_gaps(
    choose: Callable[[int], dict[str, Any]],
    scene: Scene,
    count: int,
    text: str,
    allowed: np.ndarray | None = None,
    sharpness: np.ndarray | None = None,
) -> dict[str, Any]:
    """The selection of `count` views with no gap larger than `text`; its notes have fill, and gaps before and after.

    `choose` makes the selection of a count. `allowed` (N,) bool are the candidates. Raises UserError as `chained` does.
    """
    numbers = [frame_number(name) for name in scene.train.names] if scene.format == "video" else None
    gap, at, unit = gap_of(text, scene.train, None if numbers is None else np.array(numbers))
    if unit == "frames" and "f" not in text:
        click.echo(f"viewbench: the capture has no times, so --max-gap {text} is in frames, {gap:g}f", err=True)
    if 1 <= count <= len(at):  # else `choose` says so
        check_count(count, at, gap, allowed)
    whole = choose(count)

    def views(number: int) -> list[int]:
        return whole["indices"] if number == count else choose(number)["indices"]

    kept, extra = chained(views, whole["greedy"], count, at, gap, allowed, sharpness)
    before, after = (largest_gap(indices, at, allowed) for indices in (whole["indices"], kept + extra))
    notes = {
        "max_gap": f"{gap:g} {unit}",
        "fill": len(extra),
        "largest_gap_before": f"{round(before, 3):g} {unit}",
        "largest_gap_after": f"{round(after, 3):g} {unit}",
    }
    return record_of(whole, scene.train, kept, extra, **notes)
