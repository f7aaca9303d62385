"""`select --check-matches`: whether structure-from-motion finds a way along the chosen frames, in numbers."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click
import numpy as np

from ...common import extras
from ...common.errors import UserError
from ...common.files import read_json, sealed, unsealed, write_json
from ...scenes.types import Scene
from . import _options


def possible(asked: bool | None) -> bool:
    """Whether OpenCV is there. Raises UserError where the check was asked for and it is not.

    `select` looks without being asked where it writes frames of a capture without poses: that takes about a third of a
    second a view, less than it takes to decode it, and a run of structure-from-motion that falls in two takes hours.
    """
    if asked:
        extras.need("cv2")
    return extras.missing("cv2") is None


def check(scene: Scene, record: dict[str, Any], out: Path | None, selection: Path | None) -> None:
    """Matches the chosen frames along the capture, says what was found, and adds it to the notes of selection.json."""
    from ...scenes.matching import ENOUGH, breaks, inliers_along

    order = sorted(record["indices"])
    if len(order) < 2:
        return
    names = [scene.train.names[i] for i in order]
    found = inliers_along(_pictures(scene, order, out), len(order), _options.progress("matches"))
    along, gone = found[0, :-1], breaks(found)
    weakest = int(along.argmin())
    notes = {
        "neighbours": len(along),
        "match": int((along >= ENOUGH).sum()),
        "median_inliers": float(np.median(along)),
        "weakest": [names[weakest], names[weakest + 1]],
        "weakest_inliers": int(along[weakest]),
        "breaks": [[names[k], names[k + 1]] for k in gone],
    }
    click.echo(f"viewbench: {sentence(notes)}{_advice(scene, order, along, gone)}", err=True)
    for path in (out and out / "selection.json", selection):
        if path:
            written = unsealed(read_json(path, "selection"), f"selection '{path}'")
            write_json(path, sealed({**written, "notes": {**written.get("notes", {}), "matches": notes}}))


def sentence(notes: dict[str, Any]) -> str:
    """What the notes say, in one line."""
    first, second = notes["weakest"]
    return (
        f"neighbours that match: {notes['match']} of {notes['neighbours']}, "
        f"median {notes['median_inliers']:g} inliers; "
        f"weakest: {first} – {second} with {notes['weakest_inliers']}"
    )


def _advice(scene: Scene, order: list[int], along: np.ndarray, gone: np.ndarray) -> str:
    """What to do about a chain that breaks."""
    from ...scenes.matching import ENOUGH
    from ...selectors._chain import fewest

    if not len(gone):
        return " (the frame after next leads on)" if along.min() < ENOUGH else ""
    where = "there" if len(gone) == 1 else f"at {len(gone)} places, the first after {scene.train.names[order[gone[0]]]}"
    times = scene.train.times
    at, unit = (np.arange(len(scene.train)) * 1.0, "f") if times is None or (np.diff(times) < 0).any() else (times, "s")
    least = float(np.diff(at).max())
    gap = max(least, float(np.median([at[order[k + 1]] - at[order[k]] for k in gone])) / 2)
    shown = f"{max(1, round(gap))}" if unit == "f" else f"{np.ceil(gap * 100) / 100:g}"
    need = fewest(at, float(shown))
    more = int(np.ceil(1.2 * len(order)))
    if max(need, more) > len(scene.train) and scene.details.get("assumed"):
        return f" (the chain may break {where}: look at more frames than {scene.details['assumed']} gives)"
    if max(need, more) > len(scene.train):
        return f" (the chain may break {where}: these frames overlap too little in the capture itself)"
    count = f" --count {max(more, need)}" if need > len(order) else f" or --count {more}"
    return f" (the chain may break {where}: --max-gap {shown}{unit}{count})"


def _pictures(scene: Scene, order: list[int], out: Path | None) -> Iterator[np.ndarray]:
    from ...scenes.matching import LONGEST, grey_pictures

    if scene.format != "video":
        yield from grey_pictures(scene.train.paths[i] for i in order)
    elif out is not None:
        yield from grey_pictures(out / "images" / f"{scene.train.names[i]}.png" for i in order)
    else:
        from PIL import Image

        from ...scenes.formats.video import pictures  # no source: nothing is chosen by it

        small = dict(pictures(scene, [scene.train.names[i] for i in order], LONGEST))
        if len(small) < len(order):
            raise UserError(f"video '{scene.root}' cannot be decoded any more; is the file the same?")
        for i in order:
            yield np.asarray(Image.fromarray(small.pop(scene.train.names[i])).convert("L"))
