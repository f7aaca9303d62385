"""The chosen cameras of one cell from above, over the room and the whole path.

By Pillow and numpy alone, in milliseconds: a tracker draws it while the study runs.
"""

import functools
import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..common.errors import UserError
from . import _topview
from ._run_pictures import GREY, INK, PAPER, letters_of, write

WIDTH, TALLEST = 640, 560  # pixels of the picture's width, and of the height of the room on it
MARGIN, TITLE, LEGEND = 12, 30, 26  # pixels around the room, and of the lines above and below it
FINE = 2  # drawn so many times larger, then reduced: edges come out smooth
POINTS = 20_000  # of the scene that are drawn; `viewbench describe` keeps 5,000
FRAMES = 5_000  # cameras of each kind that are drawn, of more at equal steps
SHADES = np.array([255, 229, 217, 206, 196, 188], dtype=np.uint8)  # of so many points on a pixel: walls stand out
LARGEST = 1e12  # of a coordinate: its square has digits left
PATH, TEST = "#A6A6A6", "#444444"
BAR = 170  # pixels kept for the scale bar beside the title
# Radii and lengths in pixels of the picture.
POINT, FRAME, CHOSEN, DIAMOND, TICK = 1.5, 1.4, 3.6, 4.5, 15.0


@dataclass(frozen=True)
class Room:
    """What the pictures of one scene have in common; places are pixels of the fine picture, (N, 2), y downwards."""

    name: str
    image: Any  # PIL, RGB, the fine picture: points, path and test cameras
    train: np.ndarray
    looks: np.ndarray  # (N, 2) what is level of each viewing direction, at most 1 long
    unit: float  # pixels of a scene unit; 0 where all that is drawn is at one place
    has_points: bool


def room_of(description: Any) -> Room:
    """The scene from above, of the record of results/STUDY/scenes/SCENE.json: its points faint, darker where many lie
    over one another as they do in walls, the path and the frames of the training split grey, the test cameras hollow
    diamonds. Both axes have one scale.

    Points that are no finite numbers are left out; a scene without any, with one camera or with all at one place is
    drawn as well. Of more than FRAMES cameras some are drawn. Raises UserError for a record that has no cameras or
    some that are no finite numbers.
    """
    from PIL import Image, ImageDraw

    name = description.get("scene") if isinstance(description, dict) else None
    name = name if isinstance(name, str) else "scene"
    train, forward = _rows(description, name, "train", "positions"), _rows(description, name, "train", "forward")
    test = _rows(description, name, "test", "positions")
    if not len(train) or train.shape != forward.shape:
        raise _wrong(name, f"{len(train)} training cameras and {len(forward)} viewing directions")
    lengths = np.linalg.norm(forward, axis=1, keepdims=True)
    if not lengths.all():
        raise _wrong(name, "a viewing direction of no length")
    forward = forward / lengths
    axes = _topview.plane(train, forward)
    middle = train.mean(axis=0)
    at, tests, points = ((rows - middle) @ axes.T for rows in (train, test, _points(description)))
    low, high = _topview.limits(np.vstack([at, tests]), points)
    unit = FINE * min((WIDTH - 2 * MARGIN) / (high - low)[0], TALLEST / (high - low)[1])
    size = (FINE * WIDTH, FINE * (round(unit / FINE * (high - low)[1]) + 2 * MARGIN))
    within = np.all((points >= low) & (points <= high), axis=1)

    def pixels(flat: np.ndarray) -> np.ndarray:
        return (flat - (low + high) / 2) * [unit, -unit] + np.array(size) / 2

    shades = Image.fromarray(_shade(pixels(points[within]), size[0] // FINE, size[1] // FINE))
    image = shades.resize(size, Image.Resampling.NEAREST).convert("RGB")
    pen, path = ImageDraw.Draw(image), pixels(at)
    for piece in _topview.pieces(_some(path)):
        if len(piece) > 1:
            pen.line(piece.ravel().tolist(), fill=PATH, width=FINE)
    for box in _around(_some(path), FRAME):
        pen.ellipse(box, fill=PATH)
    for box in _around(_some(pixels(tests)), DIAMOND):
        _diamond(pen, box)
    is_wide = within.any() or np.ptp(np.vstack([at, tests]), axis=0).max() > _topview.SMALLEST
    return Room(name, image, path, (forward @ axes.T) * [1, -1], unit * bool(is_wide), bool(within.any()))


def cameras(scene: Any, selection: Any, colour: str, name: str = "") -> Any:
    """A PIL image, RGB, 640 pixels wide and at most 640 high: the scene from above, the chosen cameras as discs of
    `colour` (`#RRGGBB`, the selector's), each with a line along its viewing direction, short where it looks up or down.

    `scene` is a description or what `room_of` made of it, which is most of the work and the same for all cells;
    `selection` is the record of a cell's selection.json; `name` is what the study calls the selector, whose own name
    the selection has. Pictures of one scene have one size and one place for each camera, whatever is chosen.

    Raises UserError as `room_of` does, and for a choice of a camera that is not there.
    """
    from PIL import Image, ImageDraw

    if not isinstance(colour, str) or not re.fullmatch(r"#[0-9A-Fa-f]{6}", colour):
        raise UserError(f"'{str(colour)[:40]}' is no colour; expected one such as '#0072B2'")
    room = scene if isinstance(scene, Room) else room_of(scene)
    chosen = _chosen(selection, len(room.train), room.name)
    image = room.image.copy()
    pen, shown = ImageDraw.Draw(image), _some(chosen)
    tips = room.train[shown] + FINE * TICK * room.looks[shown]
    for ends in np.hstack([room.train[shown], tips]).tolist():
        pen.line(ends, fill=colour, width=round(1.5 * FINE))
    for box in _around(room.train[shown], CHOSEN):
        pen.ellipse(box, fill=colour, outline=PAPER)
    small = image.reduce(FINE)
    page = Image.new("RGB", (WIDTH, small.height + TITLE + LEGEND), PAPER)
    page.paste(small, (0, TITLE))
    selector = name or selection.get("selector")
    words = f"{selector if isinstance(selector, str) else 'selection'}: {len(chosen)} of {len(room.train)} views"
    _title(page, f"{words} · {room.name}", room.unit / FINE)
    page.paste(_legend(colour, room.has_points), (0, page.height - LEGEND))
    return page


def _shade(points: np.ndarray, width: int, height: int) -> np.ndarray:
    """(H, W) uint8: the points, in pixels of the fine picture, at the size of the picture."""
    reach = int(POINT)
    y, x = np.mgrid[-reach : reach + 1, -reach : reach + 1]
    inside = x**2 + y**2 <= POINT**2
    xs = (points[:, :1] // FINE).astype(np.int64) + x[inside]
    ys = (points[:, 1:] // FINE).astype(np.int64) + y[inside]
    fits = (xs >= 0) & (ys >= 0) & (xs < width) & (ys < height)
    counts = np.bincount(ys[fits] * width + xs[fits], minlength=width * height)
    return SHADES[np.minimum(counts, len(SHADES) - 1)].reshape(height, width)


def _some(rows: np.ndarray) -> np.ndarray:
    return rows[:: max(1, -(-len(rows) // FRAMES))]


def _around(at: np.ndarray, radius: float) -> Iterator[tuple[float, float, float, float]]:
    reach = FINE * radius
    return ((x - reach, y - reach, x + reach, y + reach) for x, y in at.tolist())


def _diamond(pen: Any, box: tuple[float, float, float, float]) -> None:
    left, top, right, bottom = box
    x, y = (left + right) / 2, (top + bottom) / 2
    pen.line([x, top, right, y, x, bottom, left, y, x, top, right, y], fill=TEST, width=FINE, joint="curve")


def _title(page: Any, words: str, unit: float) -> None:
    """The words, and a bar of a round length, in scene units (metres where the capture is metric)."""
    from PIL import ImageDraw

    pen = ImageDraw.Draw(page)
    write(pen, (MARGIN, 7), words, WIDTH - 3 * MARGIN - BAR, INK, 15)
    if not unit:
        return
    length = _topview.round_length((BAR - 60) / unit)
    words = f"{length:g} unit{'' if length == 1 else 's'}"
    letters = letters_of(11)
    right = WIDTH - MARGIN - letters.getlength(words)
    pen.text((right, TITLE / 2 + 2), words, font=letters, fill=INK, anchor="lm")
    pen.line([right - 5 - length * unit, TITLE / 2 + 2, right - 5, TITLE / 2 + 2], fill=INK, width=2)


@functools.lru_cache(maxsize=64)
def _legend(colour: str, has_points: bool) -> Any:
    from PIL import Image, ImageDraw

    tall = FINE * LEGEND
    image = Image.new("RGB", (FINE * WIDTH, tall), PAPER)
    pen = ImageDraw.Draw(image)
    letters = letters_of(11 * FINE)
    x, y = float(FINE * MARGIN), tall / 2
    for kind, words in (
        ("chosen", "chosen, with its direction"),
        ("path", "all training views"),
        ("test", "test views"),
        *([("point", "points of the scene")] if has_points else []),
    ):
        middle = np.array([[x + 5 * FINE, y]])
        if kind == "chosen":
            pen.line([x + 5 * FINE, y, x + (5 + TICK) * FINE, y], fill=colour, width=round(1.5 * FINE))
            pen.ellipse(next(_around(middle, CHOSEN)), fill=colour)
            x += (TICK - 5) * FINE
        elif kind == "path":
            pen.line([x, y, x + 14 * FINE, y], fill=PATH, width=FINE)
            pen.ellipse(next(_around(middle + [2 * FINE, 0], FRAME)), fill=PATH)
            x += 4 * FINE
        elif kind == "test":
            _diamond(pen, next(_around(middle, DIAMOND)))
        else:
            for dx, dy in ((2, -3), (7, 0), (3, 4)):
                pen.ellipse(next(_around(np.array([[x + dx * FINE, y + dy * FINE]]), POINT)), fill="#C4C4C4")
        x += 14 * FINE
        pen.text((x, y), words, font=letters, fill=GREY, anchor="lm")
        x += letters.getlength(words) + 16 * FINE
    return image.reduce(FINE)


def _rows(description: Any, name: str, split: str, part: str) -> np.ndarray:
    """(N, 3) finite numbers. Raises UserError."""
    try:
        rows = description[split][part]
        array = np.array(rows, dtype=np.float64) if len(rows) else np.zeros((0, 3))
    except (KeyError, IndexError, TypeError, ValueError, OverflowError):
        raise _wrong(name, f"{split} {part} that are no rows of three numbers") from None
    if array.ndim != 2 or array.shape[1] != 3:
        raise _wrong(name, f"{split} {part} that are no rows of three numbers")
    if not (np.abs(array) <= LARGEST).all():
        raise _wrong(name, f"{split} {part} that are not finite or beyond {LARGEST:g}")
    return array


def _points(description: dict[str, Any]) -> np.ndarray:
    """(P, 3), none where what is there are no points: the cameras are shown without them."""
    none = np.zeros((0, 3))
    points = description.get("points")
    if not isinstance(points, list) or not points:
        return none
    try:
        array = np.array(points[:: -(-len(points) // POINTS)], dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        return none
    if array.ndim != 2 or array.shape[1] < 3:
        return none
    return array[(np.abs(array[:, :3]) <= LARGEST).all(axis=1), :3]


def _chosen(selection: Any, total: int, name: str) -> np.ndarray:
    indices = selection.get("indices") if isinstance(selection, dict) else None
    if not isinstance(indices, list) or not all(isinstance(i, int) and not isinstance(i, bool) for i in indices):
        raise UserError(f"the selection of scene '{name}' has no list of indices; select again")
    wrong = next((i for i in indices if not 0 <= i < total), None)
    if wrong is not None:
        raise UserError(f"the selection of scene '{name}' chooses view {wrong} of {total}; run the study again")
    return np.array(indices, dtype=np.int64)


def _wrong(name: str, what: str) -> UserError:
    return UserError(f"the description of scene '{name}' has {what}; remove it and run the study again")
