"""Brings a scene out of a shared Google Drive folder, by gdown."""

import zipfile
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any

from ...common import extras
from ...common.catalogue import DataSet, Listed
from ...common.errors import UserError
from ...common.files import sha256_file
from .http import KINDS, SIGNATURES, kind_of, page_title
from .unpack import below, damaged, extract, extract_tar, is_right, members, safe

if TYPE_CHECKING:
    from .bring import Place


def bring(scene: Listed, data: DataSet, staging: Path, folder: Path, place: "Place", anew: bool) -> dict[str, Any]:
    """Fills `staging` with the scene's files, or with those of the archive that is called like it.

    With `anew` an archive that is kept from before is fetched again.

    Raises UserError for a folder without either, and where Google refuses, with what to do by hand.
    """
    extras.need("gdown")
    by_hand = f"or by hand: {data.by_hand} at '{folder}'"
    listed = _ask(by_hand, data.drive, "download_folder", id=data.drive, skip_download=True)
    files = {str(item.path).replace("\\", "/"): str(item.id) for item in listed}
    place.say(f"{scene.name}: {len(files)} files are in the shared folder")
    own = _own(scene, files)
    if own:
        return _files(scene, own, staging, place, by_hand)
    archive = _archive(scene, data, files)
    if archive is None:
        shown = ", ".join(sorted(files)[:6]) + (", …" if len(files) > 6 else "")
        raise UserError(
            f"the shared folder has neither '{scene.prefix}' nor an archive of it, but {shown or 'nothing'}; {by_hand}"
        )
    if anew:
        place.kept(files[archive], PurePosixPath(archive).name).unlink(missing_ok=True)
    return _unpacked(scene, archive, files[archive], staging, place, by_hand)


def _own(scene: Listed, files: dict[str, str]) -> dict[str, str]:
    """Ids of the files in the scene's folder, by their path in it."""
    if not any(f"/{scene.prefix}" in f"/{name}" for name in files):
        return {}
    prefix = below(scene.prefix, list(files), "the shared folder")
    return {name[len(prefix) :]: identity for name, identity in files.items() if name.startswith(prefix)}


def _archive(scene: Listed, data: DataSet, files: dict[str, str]) -> str | None:
    """The archive that is called like the scene, or like the data set or its last word."""
    stems = {name: PurePosixPath(name).name for name in files if kind_of(name)}
    for wanted in (scene.scene, data.name, data.name.split("-")[-1]):
        for name, last in stems.items():
            if any(last.lower() == wanted + suffix for suffix in KINDS):
                return name
    return None


def _files(scene: Listed, own: dict[str, str], staging: Path, place: "Place", by_hand: str) -> dict[str, Any]:
    for number, (relative, identity) in enumerate(sorted(own.items())):
        target = staging / safe(relative, "the shared folder")
        place.progress(number, len(own), f"{scene.name}, files")
        if not target.is_file():
            _fetch(identity, target, place, by_hand)
    place.progress(len(own), len(own), f"{scene.name}, files")
    return {"files_of_drive": len(own)}


def _unpacked(scene: Listed, name: str, identity: str, staging: Path, place: "Place", by_hand: str) -> dict[str, Any]:
    path = place.kept(identity, PurePosixPath(name).name)
    if not path.is_file():
        _fetch(identity, path, place, by_hand, scene.name)
    sha256 = sha256_file(path)
    address = f"https://drive.google.com/file/d/{identity}"
    try:
        place.hashes.check(address, "file", sha256, record=False)
        _take(scene, name, path, staging)
    except UserError:
        path.unlink()
        raise
    place.hashes.check(address, "file", sha256)
    if _is_alone(scene, name):
        path.unlink()
    else:
        place.say(f"the archive is kept for its other scenes in '{path}'; remove it when you need none of them")
    return {"sha256": sha256}


def _is_alone(scene: Listed, name: str) -> bool:
    """Whether the archive is called like the scene, and not like the data set."""
    return PurePosixPath(name).name.lower().startswith(scene.scene + ".")


def _take(scene: Listed, name: str, path: Path, staging: Path) -> None:
    """Unpacks the scene; an archive that is called like it may have its files without a folder."""
    if kind_of(name) == "zip":
        with damaged(name), zipfile.ZipFile(path) as archive:
            names = [info.filename for info in archive.infolist()]
            bare = _is_alone(scene, name) and not any(f"/{scene.prefix}" in f"/{member}" for member in names)
            chosen = members(archive, "" if bare else scene.prefix, scene.also, name)
            missing = {at: info for at, info in chosen.items() if not is_right(staging / at, info)}
            extract(archive, missing, staging, name, lambda count: None)
    else:
        extract_tar(path, scene.prefix, scene.also, staging, name, lambda count: None)


def _fetch(identity: str, target: Path, place: "Place", by_hand: str, text: str = "") -> None:
    """One file, which is there only when it is whole: gdown writes beside it first, and goes on from what it has."""
    target.parent.mkdir(parents=True, exist_ok=True)
    given: dict[str, Any] = {"id": identity, "output": str(target), "resume": True, "retries": place.patience.tries}
    if text:
        given["progress"] = lambda done, total: place.progress(done, total, text)
    _ask(by_hand, target.name, "download", timeout=place.patience.timeout, **given)
    if not target.is_file():
        raise UserError(f"Google Drive does not give '{target.name}'; try again later, {by_hand}")
    with open(target, "rb") as file:
        head = file.read(4096)
    kind = kind_of(target.name)
    page = page_title(head)
    if page is not None or (kind and not head.startswith(SIGNATURES[kind])):
        target.unlink()
        got = f"a web page{page}" if page is not None else f"something that starts with {head[:8]!r}"
        raise UserError(
            f"Google Drive gives {got} in place of '{target.name}', as it does when a file was downloaded too often; "
            f"try again tomorrow, {by_hand}"
        )


def _ask(by_hand: str, what: str, function: str, **given: Any) -> Any:
    """Calls a function of gdown. Raises UserError with what Google says where it refuses."""
    import gdown  # pyright: ignore[reportMissingImports]

    try:
        return getattr(gdown, function)(quiet=True, use_cookies=False, **given)
    except Exception as error:
        if isinstance(error, OSError) and error.errno is not None and error.filename:
            raise  # ours: a full disk, a folder that may not be written
        words = " ".join(str(error).split()) or type(error).__name__
        raise UserError(f"Google Drive refuses '{what}': {words[:300]}; try again tomorrow, {by_hand}") from None
