"""A contact sheet of a choice: the frames chosen, those left out that repeat one most, and those that are farthest."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..common.errors import UserError, nearest
from ..common.files import whole
from ._picked import Picked

KINDS = (".jpg", ".jpeg", ".png", ".webp", ".html")
MOST = 1000  # chosen frames on one sheet, which is then 12,000 pixels high; a WebP file holds 16,383
PAIRS = 20  # frames left out that are shown beside a chosen one
FARTHEST = 8
Progress = Callable[[int, int | None, str], None]


@dataclass(frozen=True)
class Card:
    """A frame to show with what is written below it; `mark` is what stands out."""

    index: int
    name: str
    words: str
    mark: str = ""


@dataclass(frozen=True)
class Part:
    """A heading and rows of frames; in one of pairs the 1st, 3rd, … are left out and the 2nd, 4th, … chosen."""

    title: str
    words: str
    cards: tuple[Card, ...]
    pairs: bool = False


@dataclass(frozen=True)
class Sheet:
    """What a contact sheet shows."""

    title: str
    parts: tuple[Part, ...]


def kind_of(path: Path) -> str:
    """The ending of the file, one of KINDS. Raises UserError for another."""
    kind = path.suffix.lower()
    if kind not in KINDS:
        raise UserError(f"--sheet '{path}': expected a file ending in one of {', '.join(KINDS)}{nearest(kind, KINDS)}")
    return kind


def draw(path: Path, picked: Picked, progress: Progress) -> list[str]:
    """Writes the sheet as a picture, or as a page that needs nothing beside it; returns what a user must know of it.

    Raises UserError for a kind of file that is not drawn.
    """
    kind = kind_of(path)
    sheet, notes = contents(picked)
    frames = {card.index: picked.frames.paths[card.index] for part in sheet.parts for card in part.cards}
    with whole(path) as temporary:
        if kind == ".html":
            from ._sheet_page import write

            write(temporary, sheet, frames, progress)
        else:
            from ._sheet_picture import write

            write(temporary, sheet, frames, progress)
    return notes


def contents(picked: Picked) -> tuple[Sheet, list[str]]:
    """What the sheet of a choice shows, and what it leaves out."""
    chosen = np.sort(picked.chosen)
    shown, notes = chosen, []
    if len(chosen) > MOST:
        shown = chosen[np.linspace(0, len(chosen) - 1, MOST).round().astype(np.int64)]
        notes = [f"the sheet shows {MOST:,} of the {len(chosen):,} chosen frames, at equal steps"]
    ranks = {int(index): rank for rank, index in enumerate(picked.chosen, start=1)}
    followers = np.bincount(picked.owner, minlength=len(picked.frames)) - 1
    cards = tuple(
        _card(picked, index, f"{index}, pick {ranks[index]}", f"+{followers[index]:,}") for index in map(int, shown)
    )
    rest = len(picked.frames) - len(chosen)
    words = (
        f"In the order of the capture, with the number of the frame there and the pick that it was. +n: so many of the "
        f"{rest:,} frames left out are nearer to it than to any other chosen one, by {picked.factors}."
    )
    parts = [Part(f"{len(chosen):,} chosen" + (f", {len(shown):,} shown" if notes else ""), words, cards)]
    if rest and picked.distance is not None:
        parts += _left_out(picked)
    return Sheet(picked.title, tuple(parts)), notes


def _left_out(picked: Picked) -> list[Part]:
    assert picked.distance is not None
    left = np.setdiff1d(np.arange(len(picked.frames)), picked.chosen)
    order = left[np.argsort(picked.distance[left], kind="stable")]
    repeats = _one_each(picked, order)[:PAIRS]
    farthest = _one_each(picked, order[~np.isin(order, repeats)][::-1])[:FARTHEST]
    about = f"left, beside the chosen frame that is most similar by {picked.factors}; 1 is the same"
    most = f"One for a chosen frame: {about}."
    least = f"Those that are farthest from all chosen frames, likewise: {about}."
    parts = [Part("Left out, most like a chosen frame", most, _pairs(picked, repeats), True)]
    if len(farthest):
        parts.append(Part("Left out, least like any chosen frame", least, _pairs(picked, farthest), True))
    return parts


def _one_each(picked: Picked, order: np.ndarray) -> np.ndarray:
    """The first frame of the order for each chosen one that they are nearest to: neighbours say one thing."""
    _, first = np.unique(picked.owner[order], return_index=True)
    return order[np.sort(first)]


def _pairs(picked: Picked, left: Sequence[int] | np.ndarray) -> tuple[Card, ...]:
    assert picked.distance is not None
    cards: list[Card] = []
    for index in map(int, left):
        owner = int(picked.owner[index])
        similarity = f"{1 - picked.distance[index]:.3f}"
        cards += [_card(picked, index, str(index)), _card(picked, owner, f"{owner}, chosen", similarity)]
    return tuple(cards)


def _card(picked: Picked, index: int, words: str, mark: str = "") -> Card:
    return Card(index, picked.frames.names[index], words, mark)


def thumbnails(frames: dict[int, Path], size: int, progress: Progress) -> dict[int, Any]:
    """A small picture of each frame, by its index."""
    from ._thumbnails import thumbnail

    pictures = {}
    for done, (index, path) in enumerate(frames.items(), start=1):
        pictures[index] = thumbnail(path, size)
        progress(done, len(frames), "")
    return pictures
