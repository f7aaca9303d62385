"""A video file (by PyAV): frames chosen by content, time and sharpness, written with their original numbers."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from ...common import extras  # no source: it says what to install
from ...common.errors import UserError
from ...common.files import read_json, sha256_file, user_cache, whole_folder, write_json
from ..types import Scene, Split
from .images import nominal_cameras, unposed

WRITABLE = True
POSED = False
SUFFIXES = {".mp4", ".mov", ".mkv", ".avi", ".webm", ".m4v"}
SMALL = 384  # pixels of the longer side of the frames that features and sharpness are computed from


def available() -> str | None:
    """Why videos cannot be read here, or None."""
    return extras.missing("av")


def detect(root: Path) -> str | None:
    """Why the file is in this format, or None."""
    return f"it is a {root.suffix} file" if root.is_file() and root.suffix.lower() in SUFFIXES else None


def read(root: Path) -> Scene:
    """Every frame as a training view, named frame_000000 and so on, with its time in seconds.

    The video is decoded once, frame by frame, into a cache of small pictures named by the file's content; what is in
    memory is one frame. Raises UserError for a file that is no video, and when PyAV is not installed.
    """
    folder = user_cache("video") / f"{sha256_file(root)[:32]}-{SMALL}"
    if not (folder / "frames.json").is_file():
        with whole_folder(folder) as temporary:
            times, size = _extract(root, temporary)
            write_json(temporary / "frames.json", {"times": times, "size": size})
    table = read_json(folder / "frames.json", "cached frames")
    times = table["times"]
    names = tuple(frame_name(number) for number in range(len(times)))
    paths = tuple(folder / f"{name}.jpg" for name in names)
    sizes = np.tile(np.array(table["size"], dtype=np.int64), (len(times), 1))
    frames = Split(names, paths, nominal_cameras(sizes), np.array(times, dtype=np.float64))
    return unposed(root, "video", frames, files=(root,), extracted=True)


def frame_name(number: int) -> str:
    """Name of the frame with this number in the video, from 0."""
    return f"frame_{number:06d}"


def _extract(root: Path, folder: Path) -> tuple[list[float], list[int]]:
    times: list[float] = []
    size = [0, 0]
    for number, frame in enumerate(_frames(root)):
        image = _upright(frame)
        size = list(image.size)
        image.thumbnail((SMALL, SMALL))
        image.save(folder / f"{frame_name(number)}.jpg", quality=92)
        times.append(float(frame.time) if frame.time is not None else float(number))
    if len(times) < 2:
        raise UserError(f"video '{root}' has {len(times)} frames that can be decoded; at least two are needed")
    return times, size


def _upright(frame: Any) -> Any:
    """The frame as an image, turned as a player turns it: telephones film on their side and say so in the file."""
    image = frame.to_image()
    turn = getattr(frame, "rotation", 0)  # degrees counter-clockwise; PyAV has it since 13
    return image.rotate(turn, expand=True) if turn else image


def _frames(root: Path) -> Iterator[Any]:
    extras.need("av")
    import av
    from av.error import FFmpegError

    try:
        with av.open(str(root)) as container:
            if not container.streams.video:
                raise UserError(f"'{root}' has no video in it")
            container.streams.video[0].thread_type = "AUTO"
            yield from container.decode(video=0)
    except (FFmpegError, ValueError, OSError) as error:
        raise UserError(f"video '{root}' cannot be decoded: {error}") from None


def write(scene: Scene, indices: np.ndarray, out: Path, copy: bool) -> None:
    """Decodes the video once more and writes the chosen frames at full size, as PNG, to images/, test ones to test/."""
    folders = {scene.train.names[i]: out / "images" for i in indices} | dict.fromkeys(scene.test.names, out / "test")
    left = len(folders)
    for number, frame in enumerate(_frames(scene.root)):
        name = frame_name(number)
        if name in folders:
            folders[name].mkdir(exist_ok=True)
            _upright(frame).save(folders[name] / f"{name}.png", compress_level=4)
            left -= 1
            if not left:
                break
