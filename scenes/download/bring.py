"""Brings one scene of the catalogue to the folder of captures: whole or not at all, and from where it broke off."""

import contextlib
import hashlib
import shutil
import zipfile
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ...common import plugins
from ...common.catalogue import Archive, DataSet, Listed, size_in_words
from ...common.errors import UserError
from ...common.files import sha256_file
from . import drive
from .hashes import Hashes
from .http import Patience, kind_of
from .ranges import ChangedError, NoRangesError, RangeFile
from .receipt import is_there, publish
from .room import check_room
from .unfinished import State, alone
from .unpack import DamagedError, damaged, extract, extract_tar, is_right, members, spans, unpack_nested
from .whole import Download

RESTARTS = 3  # times that an archive may become another one while it is read

Progress = Callable[[int, int | None, str], None]  # bytes that are there, of how many, of what
Say = Callable[[str], None]


@dataclass(frozen=True)
class Place:
    """Where downloads go, and what they have in common."""

    root: Path  # the folder of captures
    say: Say
    progress: Progress = lambda done, total, text: None
    patience: Patience = field(default_factory=Patience)

    @property
    def hashes(self) -> Hashes:
        return Hashes(self.root, self.say)

    def kept(self, address: str, name: str) -> Path:
        """Where a whole file is kept while it is needed."""
        mark = hashlib.sha256(address.encode()).hexdigest()[:8]
        return self.root / ".viewbench" / "archives" / f"{mark}-{name}"

    def kept_archive(self, archive: Archive) -> Path:
        """Likewise, by what the catalogue says of it."""
        return self.kept(archive.address, Path(archive.address).name)


def bring(scene: Listed, data: DataSet, place: Place, force: bool = False) -> Path:
    """The scene's folder, which is fetched unless it is there; with `force` again.

    Raises UserError for whatever is wrong at the server, on the way or here, and says what to do. What came is kept
    beside the folder, and a later call goes on from it.
    """
    folder = place.root / scene.path
    with alone(place.root, scene.name):
        if not force and is_there(scene, data, place.root):
            return folder
        staging = folder.with_name(f".part-{folder.name}")
        state = State(place.root / ".viewbench" / "state" / f"{scene.name.replace('/', '+')}.json", staging)
        anew = state.begin(force)
        if anew and scene.archive is not None:
            place.kept_archive(scene.archive).unlink(missing_ok=True)
        if scene.archive is None:
            made_from = drive.bring(scene, data, staging, folder, place, anew)
        elif kind_of(scene.archive.address) == "zip":
            made_from = _zip(scene, scene.archive, staging, state, place)
        else:
            made_from = _tar(scene, scene.archive, staging, place)
        if not plugins.load("scenes.formats", data.format).detect(staging):
            raise UserError(
                f"'{staging}' has what the archive calls '{scene.prefix}', which is no {data.format} capture"
            )
        publish(scene, data, staging, folder, made_from)
        state.end()
    return folder


def _zip(scene: Listed, archive: Archive, staging: Path, state: State, place: Place) -> dict[str, Any]:
    """Parts of the archive where the server gives them, else all of it."""
    for attempt in range(RESTARTS):
        try:
            with contextlib.closing(RangeFile(archive.address, "zip", place.patience)) as remote:
                if attempt and state.directory == _remote_directory(remote):
                    remote.validators = {}  # of machines that share the work each has an ETag of its own
                return _members(scene, archive, remote, staging, state, place)
        except ChangedError:
            place.say(f"'{archive.address}' has changed while it was read: begun anew")
        except NoRangesError:
            break
    else:
        raise UserError(f"'{archive.address}' becomes another file again and again while it is read; try later")
    path = place.kept_archive(archive)
    if not path.is_file():
        words = size_in_words(archive.bytes, archive.about_gb) or "size not known"
        place.say(f"the server gives no parts of '{archive.address}': the whole archive ({words}) is fetched")
    made_from = _whole(archive, path, scene, place)
    try:
        made_from |= _members(scene, archive, path, staging, state, place)
    except DamagedError:
        path.unlink()
        raise
    place.hashes.check(archive.address, "file", made_from["sha256"])
    if scene.shared == 1:
        path.unlink()
    else:
        place.say(f"the archive is kept for its other scenes in '{path}'; remove it when you need none of them")
    return made_from


def _members(
    scene: Listed, archive: Archive, source: RangeFile | Path, staging: Path, state: State, place: Place
) -> dict[str, Any]:
    """Takes the scene out of the archive: what is there and right is left alone."""
    name = archive.address
    with damaged(name), zipfile.ZipFile(source) as opened:
        directory = _directory_sha256(opened)
        if isinstance(source, RangeFile):
            place.hashes.check(name, "directory", directory, record=False)
        state.of(directory)
        chosen = members(opened, scene.prefix, scene.also, name)
        inner = {relative for relative in chosen if scene.nested and kind_of(relative) == "zip"}
        wanted = {
            relative: info
            for relative, info in chosen.items()
            if not (relative in state.unpacked if relative in inner else is_right(staging / relative, info))
        }
        total, left = _bytes(chosen), _bytes(wanted)
        twice = max((chosen[relative].file_size for relative in inner), default=0)
        check_room(staging, left + twice)
        if len(wanted) < len(chosen):
            place.say(f"{scene.name}: {len(chosen) - len(wanted)} of {len(chosen)} files are there already")
        if isinstance(source, RangeFile):
            source.plan(spans(opened, list(wanted.values())))
        done = _Count(scene.name, total - left, total, place.progress)
        staging.mkdir(parents=True, exist_ok=True)
        for relative, info in wanted.items():
            extract(opened, {relative: info}, staging, name, done)
            if relative in inner:
                unpack_nested(staging / relative, name, lambda count: None)
                state.has_unpacked(relative)
        done.finish()
        if isinstance(source, RangeFile):
            place.hashes.check(name, "directory", directory)
    return {"directory_sha256": directory}


def _tar(scene: Listed, archive: Archive, staging: Path, place: Place) -> dict[str, Any]:
    path = place.kept_archive(archive)
    made_from = _whole(archive, path, scene, place)
    shutil.rmtree(staging, ignore_errors=True)
    staging.mkdir(parents=True)
    count = _Count(f"{scene.name}: unpack", 0, None, place.progress)
    try:
        extract_tar(path, scene.prefix, scene.also, staging, archive.address, count)
    except UserError:
        path.unlink()  # it is not what it should be, and would not be the next time
        raise
    place.hashes.check(archive.address, "file", made_from["sha256"])
    path.unlink()
    return made_from


def _whole(archive: Archive, path: Path, scene: Listed, place: Place) -> dict[str, Any]:
    """Downloads the archive unless it is there, and compares its hash with what is known."""
    if not path.is_file():
        check_room(path.parent, archive.bytes or int(archive.about_gb * 1e9))

        def progress(done: int, total: int | None) -> None:
            place.progress(done, total, scene.name)

        room = 1 + 1 / scene.shared  # pictures are hardly smaller in an archive
        with alone(place.root, path.name):
            Download(archive.address, path, place.patience, progress, place.say, room).run()
    sha256 = sha256_file(path)
    try:
        place.hashes.check(archive.address, "file", sha256, record=False)
    except UserError:
        path.unlink()
        raise
    return {"sha256": sha256}


def _directory_sha256(archive: zipfile.ZipFile) -> str:
    """One hash of the names, lengths and CRC-32s of all members."""
    lines = (f"{info.CRC:08x} {info.file_size} {info.filename}\n" for info in archive.infolist())
    return hashlib.sha256("".join(lines).encode("utf-8", "surrogateescape")).hexdigest()


def _remote_directory(remote: RangeFile) -> str | None:
    with contextlib.suppress(zipfile.BadZipFile), zipfile.ZipFile(remote) as archive:
        return _directory_sha256(archive)
    return None


def _bytes(infos: dict[str, zipfile.ZipInfo]) -> int:
    return sum(info.file_size for info in infos.values())


class _Count:
    """Adds up bytes for the line that shows progress."""

    def __init__(self, text: str, done: int, total: int | None, progress: Progress):
        self.text, self.done, self.total, self.progress = text, done, total, progress

    def __call__(self, count: int) -> None:
        self.done += count
        self.progress(self.done, self.total, self.text)

    def finish(self) -> None:
        self.progress(self.done, self.done, self.text)
