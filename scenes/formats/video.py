"""A video file (by PyAV): frames chosen by content, time and sharpness, written with their original numbers."""

import os
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ...common import extras  # no source: it says what to install
from ...common.errors import UserError
from ...common.files import read_json, whole, write_json
from ...common.sources import code_sha256
from ..digest import file_sha256
from ..thinning import Thinning, frame_name, frame_number, kept
from ..types import Scene, Split
from . import _video_known
from ._video_cache import drop, hold, trim
from ._video_decode import frames
from ._video_packets import Packets, opened, read_packets
from ._video_picture import Look, hdr, look_of, picture, size
from .images import nominal_cameras, unposed

WRITABLE = True
POSED = False
SUFFIXES = {".mp4", ".mov", ".mkv", ".avi", ".webm", ".m4v", ".3gp", ".mts", ".m2ts"}
SMALL = 384  # pixels of the longer side of the frames that features and sharpness are computed from
CACHE_GB = 10
TRIED = 5  # frames at the start that may be damaged

Progress = Callable[[int, int | None, str], None]


def available() -> str | None:
    """Why videos cannot be read here, or None."""
    return extras.missing("av")


def detect(root: Path) -> str | None:
    """Why the file is in this format, or None."""
    return f"it is a {root.suffix} file" if root.is_file() and root.suffix.lower() in SUFFIXES else None


def read(
    root: Path,
    thinning: Thinning = Thinning(),  # noqa: B008
    cache_gb: int = CACHE_GB,
    progress: Progress | None = None,
    extract: bool = True,
) -> Scene:
    """The frames that `thinning` leaves as training views, named frame_000000 and so on, with their times in seconds.

    A name has the frame's number in the video, whatever is left out. Small pictures of the frames are kept in the
    user's cache, one file a frame, by the video's content: what was decoded once is not decoded again, for another
    thinning or after a run that was stopped. `cache_gb` bounds the cache; `extract` False makes no pictures, which
    is enough to say what the video is. What is in memory is one frame.
    Raises UserError for a file that is no video, and when PyAV is not installed.
    """
    extras.need("av")
    with opened(root):  # before all of it is read for its hash
        pass
    # The code of decoding is in the name: pictures of another version are not taken for those of this one.
    code = code_sha256("scenes.formats._video_picture", "scenes.formats._video_decode")[:8]
    folder = hold(f"{file_sha256(root)[:32]}-{SMALL}-{code}")
    try:
        return _read(root, folder, thinning, cache_gb, progress, extract)
    except UserError:
        drop(folder)
        raise


def _read(
    root: Path, folder: Path, thinning: Thinning, cache_gb: int, progress: Progress | None, extract: bool
) -> Scene:
    packets, lost = _table(root, folder)
    times = packets.times
    numbers = np.flatnonzero(kept(len(times), times, thinning))
    facts = _facts(root, folder, packets)
    a, b, c, d = facts["turn"]
    look = Look(packets.aspect, (a, b, c, d))
    if extract:
        lost |= _extract(root, folder, packets, look, [n for n in numbers.tolist() if n not in lost], progress)
        trim(cache_gb)
    numbers = np.array([n for n in numbers.tolist() if n not in lost], dtype=np.int64)
    if len(numbers) < 2:
        raise UserError(
            f"video '{root}' has {len(numbers)} frames that can be decoded and are looked at; at least two are needed"
        )
    names = tuple(frame_name(number) for number in numbers.tolist())
    paths = tuple(folder / f"{name}.jpg" for name in names)
    sizes = np.tile(np.array(facts["size"], dtype=np.int64), (len(names), 1))
    split = Split(names, paths, nominal_cameras(sizes), times[numbers])
    details = {"extracted": True, "assumed": str(thinning), "packets": packets, "look": look}
    scene = unposed(root, "video", split, files=(root,), **details)
    notes = [packets.cut, f"{len(lost)} frames cannot be decoded and are left out" if lost else ""]
    if facts["hdr"]:
        notes.append(f"its high dynamic range ({facts['hdr']}) is mapped to sRGB, reference white to 240 of 255")
    if thinning:
        notes.append(f"{len(numbers)} of its {len(times)} frames are looked at ({thinning})")
    return replace(scene, notes=(*scene.notes, *(note for note in notes if note)))


def _table(root: Path, folder: Path) -> tuple[Packets, set[int]]:
    """The video's packets and the frames known to be damaged, from the cache where they are there."""
    file = folder / "packets.npz"
    packets = _video_known.packets(file)
    if packets is None:
        packets = read_packets(root)
        _video_known.keep(file, packets)
    return packets, _video_known.lost(folder / "lost.json")


def _facts(root: Path, folder: Path, packets: Packets) -> dict[str, Any]:
    """Size and dynamic range of the frames, of the first one that can be decoded."""
    file = folder / "facts.json"
    known = _video_known.facts(file)
    if known is not None:
        return known
    for number in range(min(len(packets.frames), TRIED)):
        for _, frame in frames(root, packets, [number]):
            look = look_of(frame, packets.aspect)
            write_json(file, {"size": size(frame, look), "hdr": hdr(frame), "turn": look.turn})
            return read_json(file, "cached facts")
    raise UserError(f"video '{root}' has no frame that can be decoded")


def _extract(
    root: Path, folder: Path, packets: Packets, look: Look, numbers: list[int], progress: Progress | None
) -> set[int]:
    """Puts the small pictures that are not in the folder there; returns the frames that cannot be decoded."""
    from PIL import Image

    with os.scandir(folder) as entries:
        have = {entry.name for entry in entries if entry.stat().st_size}  # empty: the machine lost its power
    missing = [number for number in numbers if f"{frame_name(number)}.jpg" not in have]
    if not missing:
        return set()
    left = set(missing)
    for number, frame in frames(root, packets, missing):
        with whole(folder / f"{frame_name(number)}.jpg") as temporary:
            Image.fromarray(picture(frame, look, SMALL)).save(temporary, format="JPEG", quality=92)
        left.discard(number)
        if progress:
            progress(len(missing) - len(left), len(missing), "")
    known = folder / "lost.json"
    write_json(known, sorted(left | _video_known.lost(known)))
    return left


def pictures(scene: Scene, names: list[str], longest: int | None = None) -> Iterator[tuple[str, np.ndarray]]:
    """(name, (H, W, 3) uint8 sRGB) of frames of the video, upright, at full size or with so long a side."""
    packets = scene.details["packets"]
    wanted = sorted(frame_number(name) for name in names)
    for number, frame in frames(scene.root, packets, wanted):
        yield frame_name(number), picture(frame, scene.details["look"], longest)


def write(scene: Scene, indices: np.ndarray, out: Path, copy: bool) -> None:
    """Decodes what the chosen frames need and writes them at full size, as PNG, to images/, test ones to test/.

    Raises UserError for a frame that cannot be decoded any more.
    """
    from PIL import Image

    folders = {scene.train.names[i]: out / "images" for i in indices} | dict.fromkeys(scene.test.names, out / "test")
    for name, pixels in pictures(scene, list(folders)):
        folder = folders.pop(name)
        folder.mkdir(exist_ok=True)
        Image.fromarray(pixels).save(folder / f"{name}.png", compress_level=4)
    if folders:
        raise UserError(f"video '{scene.root}': frame '{next(iter(folders))}' cannot be decoded; is the file the same?")
