"""Takes a scene's files out of an archive: none leaves the folder, and what is there and right is not read again."""

import contextlib
import errno
import gzip
import itertools
import lzma
import stat
import struct
import tarfile
import zipfile
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path, PurePosixPath
from typing import IO

from ...common import limits
from ...common.catalogue import size_in_words
from ...common.errors import UserError
from .http import CHUNK, kind_of
from .room import check_room

LEFT_OUT = ("__MACOSX", ".DS_Store", "Thumbs.db")  # what systems leave in archives
ENCRYPTED = 1  # bit of a zip member's flags
DEEPEST = 3  # archives within archives


# What zipfile, tarfile and the decoders raise for bytes that are none of theirs.
DAMAGED = (
    *(zipfile.BadZipFile, tarfile.TarError, zlib.error, lzma.LZMAError, struct.error),
    *(EOFError, RuntimeError, ValueError, IndexError, KeyError, OverflowError),
)


OF_CONTENT = (None, errno.EINVAL, errno.EEXIST, errno.ENOTDIR, errno.EISDIR, errno.ENAMETOOLONG)


class DamagedError(UserError):
    """What came is not the archive that it was."""


Done = Callable[[int], None]  # is told the bytes of each piece that is written or found right


def safe(name: str, archive: str) -> PurePosixPath:
    """A member's name as a path that stays where it is put. Raises UserError for any other."""
    path = PurePosixPath(name)
    bad = path.is_absolute() or ".." in path.parts or "\\" in name or "\0" in name or name[1:2] == ":"
    if bad or not path.parts:
        raise UserError(f"archive '{archive}' has a member '{name}', which leaves the folder; nothing is unpacked")
    return path


def below(prefix: str, names: list[str], archive: str) -> str:
    """The prefix as the archive has it: the folder itself, or the one called so that is nearest to its top.

    Raises UserError, which names the folders at its top, where there is none.
    """
    if any(name.startswith(prefix) for name in names):
        return prefix
    deeper = sorted({name[: name.index("/" + prefix) + len(prefix) + 1] for name in names if "/" + prefix in name})
    shallow = [found for found in deeper if found.count("/") == min(map(_depth, deeper))]
    if len(shallow) == 1:
        return shallow[0]
    top = sorted({name.split("/")[0] for name in names if name})
    shown = ", ".join(top[:8]) + (", …" if len(top) > 8 else "")
    raise UserError(f"archive '{archive}' has no folder '{prefix}'; it has {shown or 'nothing'}")


def members(archive: zipfile.ZipFile, prefix: str, also: tuple[str, ...], name: str) -> dict[str, zipfile.ZipInfo]:
    """A scene's members by their path in its folder, in the order of the archive.

    Raises UserError for a name that leaves the folder (of any member: such an archive is not to be trusted), a link, a
    member with a password, and where the scene is not in the archive.
    """
    infos = [info for info in archive.infolist() if not _left_out(info.filename)]
    for info in infos:
        safe(info.filename, name)
    files = [info for info in infos if not info.is_dir()]
    found = below(prefix, [info.filename for info in files], name)
    extra = {below(wanted, [info.filename for info in files], name): PurePosixPath(wanted).name for wanted in also}
    chosen: dict[str, zipfile.ZipInfo] = {}
    for info in sorted(files, key=lambda info: info.header_offset):
        if info.filename.startswith(found):
            chosen[info.filename[len(found) :]] = info
        elif info.filename in extra:
            chosen[extra[info.filename]] = info
    # Members that share their bytes are packed once.
    packed = sum({info.header_offset: info.compress_size for info in chosen.values()}.values())
    check_expansion(sum(info.file_size for info in chosen.values()), packed, name)
    for info in chosen.values():
        if stat.S_ISLNK(info.external_attr >> 16):
            raise UserError(f"archive '{name}' has a link, '{info.filename}'; nothing is unpacked")
        if info.flag_bits & ENCRYPTED:
            raise UserError(
                f"archive '{name}' wants a password for '{info.filename}'; it is not what the catalogue means"
            )
    return chosen


def check_expansion(unpacked: int, packed: int, name: str) -> None:
    """Raises UserError for an archive that becomes so much larger that it is no capture but meant to fill the disk."""
    if unpacked > limits.EXPANSION * packed + limits.EXPANSION_FREE:
        raise UserError(
            f"archive '{name}' of {size_in_words(packed) or 'no bytes'} would become {size_in_words(unpacked)}, which "
            "pictures do not; nothing more is unpacked"
        )


def spans(archive: zipfile.ZipFile, chosen: list[zipfile.ZipInfo]) -> list[tuple[int, int]]:
    """Where these members lie in the archive: each from its header to the next member's, or to the directory."""
    starts = sorted({info.header_offset for info in archive.infolist()} | {archive.start_dir})
    after = dict(itertools.pairwise(starts))
    return [(info.header_offset, after[info.header_offset]) for info in chosen]


def is_right(path: Path, info: zipfile.ZipInfo) -> bool:
    """Whether the file has the length and the CRC-32 of the member."""
    if not path.is_file() or path.stat().st_size != info.file_size:
        return False
    crc = 0
    with open(path, "rb") as file:
        while piece := file.read(CHUNK):
            crc = zlib.crc32(piece, crc)
    return crc == info.CRC


def extract(archive: zipfile.ZipFile, chosen: dict[str, zipfile.ZipInfo], folder: Path, name: str, done: Done) -> None:
    """Writes the members below the folder. Raises UserError for one that is damaged twice in a row."""
    for relative, info in chosen.items():
        target = folder / safe(relative, name)
        target.parent.mkdir(parents=True, exist_ok=True)
        with damaged(name, info.filename):
            try:
                with archive.open(info) as source:
                    _copy(source, target, done)
            except (zipfile.BadZipFile, zlib.error, EOFError):
                if archive.filename:  # what is on the disk does not become right; what came over a network may
                    raise
                with archive.open(info) as source:
                    _copy(source, target, lambda count: None)
        if target.stat().st_size != info.file_size:
            raise UserError(
                f"archive '{name}' is damaged: '{info.filename}' has not the length that its directory says"
            )


@contextlib.contextmanager
def damaged(name: str, member: str = "") -> Iterator[None]:
    """What libraries say of a damaged archive, as a UserError that names it."""
    try:
        yield
    except NotImplementedError as error:
        raise DamagedError(f"archive '{name}' is packed in a way that Python does not know: {error}") from None
    except (*DAMAGED, OSError) as error:
        if isinstance(error, OSError) and not _of_content(error):
            raise
        where = f" at '{member}'" if member else ""
        raise DamagedError(f"archive '{name}' is damaged{where}: {error}") from None


def _of_content(error: OSError) -> bool:
    """Whether it is about what is in the archive: bz2 says so without a number, a seek to nowhere with EINVAL; and
    names that are a file's and a folder's, or that no file system takes."""
    return isinstance(error, gzip.BadGzipFile) or error.errno in OF_CONTENT


def extract_tar(path: Path, prefix: str, also: tuple[str, ...], folder: Path, name: str, done: Done) -> None:
    """Writes the files below `prefix` of a gzipped tar, which is read once from its start to its end.

    Raises UserError for a name that leaves the folder, a link or device (a picture is none), and a damaged archive,
    whose check sum is at its end.
    """
    names: list[str] = []
    extra = {wanted: PurePosixPath(wanted).name for wanted in also}
    count = total = 0
    with damaged(name), gzip.open(path) as stream:
        with tarfile.open(fileobj=stream, mode="r|", bufsize=CHUNK) as archive:
            for member in archive:
                if member.isdir() or _left_out(member.name):
                    continue
                member_name = member.name.removeprefix("./")
                names.append(member_name)
                safe(member_name, name)
                if member_name.startswith(prefix):
                    relative = member_name[len(prefix) :]
                elif member_name in extra:
                    relative = extra[member_name]
                else:
                    continue
                source = archive.extractfile(member) if member.isreg() else None
                if source is None:
                    raise UserError(f"archive '{name}' has a link or a device, '{member.name}'; nothing is unpacked")
                total += member.size
                check_expansion(total, path.stat().st_size, name)
                check_room(folder, member.size)
                target = folder / safe(relative, name)
                target.parent.mkdir(parents=True, exist_ok=True)
                _copy(source, target, done)
                count += 1
        while stream.read(CHUNK):
            pass
    if not count:
        below(prefix, names, name)
        raise UserError(f"archive '{name}' has '{prefix}' deeper than at its top; it is not what the catalogue means")


def unpack_nested(path: Path, name: str, done: Done, depth: int = 1) -> None:
    """Puts what is in the archive beside it and removes it, and likewise with the archives in there.

    So seq-01.zip of 7-Scenes becomes the folder seq-01. A call that was broken off goes on.
    """
    inner = f"{path.name} in {name}"
    if depth > DEEPEST:
        raise UserError(f"archive '{name}' has archives in archives in archives; '{path.name}' is not unpacked")
    with damaged(inner), zipfile.ZipFile(path) as archive:
        chosen = members(archive, "", (), inner)
        missing = {relative: info for relative, info in chosen.items() if not is_right(path.parent / relative, info)}
        check_room(path.parent, sum(info.file_size for info in missing.values()))
        extract(archive, missing, path.parent, inner, done)
    path.unlink()
    for relative in chosen:
        if kind_of(relative) == "zip":
            unpack_nested(path.parent / relative, inner, done, depth + 1)


def _depth(name: str) -> int:
    return name.count("/")


def _left_out(name: str) -> bool:
    return any(part in LEFT_OUT or part.startswith("._") for part in PurePosixPath(name).parts)


def _copy(source: IO[bytes], target: Path, done: Done) -> None:
    with open(target, "wb") as file:
        while piece := source.read(CHUNK):
            file.write(piece)
            done(len(piece))
