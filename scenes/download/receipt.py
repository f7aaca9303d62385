"""Whether a scene is there and complete, by the receipt that its download leaves, and how it gets there whole."""

import itertools
import shutil
import sys
from pathlib import Path
from typing import Any

from ...common import plugins
from ...common.catalogue import DataSet, Listed
from ...common.errors import UserError
from ...common.files import read_json, write_json
from ..image_files import is_file

RECEIPT = "download.json"  # in the scene's folder: what it was made from, and what belongs to it


def is_there(scene: Listed, data: DataSet, root: Path) -> bool:
    """Whether the scene is there and complete.

    Raises UserError where a folder is there that is neither what was downloaded nor a capture that was put there by
    hand.
    """
    folder = root / scene.path
    if not folder.exists():
        return False
    if (folder / RECEIPT).is_file():
        files = _files(folder / RECEIPT)
        wrong = [name for name, size in files.items() if _size(folder / name) != size]
        if wrong:
            raise UserError(
                f"'{folder}' is there, but {len(wrong)} of its {len(files)} files are missing or changed, such as "
                f"'{wrong[0][:200]}'; --force fetches it again"
            )
    elif not plugins.load("scenes.formats", data.format).detect(folder):
        raise UserError(f"'{folder}' is there, and is no {data.format} capture; remove it, or --force replaces it")
    return True


def publish(scene: Listed, data: DataSet, staging: Path, folder: Path, made_from: dict[str, Any]) -> None:
    """Writes the receipt and renames the folder; an old one goes only then.

    What somebody added to the old folder (a camera.txt, a model trained in it) moves into the new one; a folder that no
    receipt tells of is kept whole beside it.
    """
    address = scene.archive.address if scene.archive else f"https://drive.google.com/drive/folders/{data.drive}"
    found = sorted(path for path in staging.rglob("*") if path.is_file())
    files = {path.relative_to(staging).as_posix(): path.stat().st_size for path in found}
    licence = {"name": data.licence.name, "address": data.licence.address}
    record = {"schema": 1, "scene": scene.name, "address": address, **made_from, "licence": licence, "files": files}
    write_json(staging / RECEIPT, record)
    old = folder.with_name(f".old-{folder.name}")
    shutil.rmtree(old, ignore_errors=True)
    if folder.exists():
        folder.replace(old)
    staging.replace(folder)
    if (old / RECEIPT).is_file():
        _move_added(old, folder)
        shutil.rmtree(old, ignore_errors=True)
    elif old.exists():
        names = (folder.with_name(f"{folder.name}.old{k}") for k in itertools.count(1))
        kept = next(path for path in names if not path.exists())
        old.replace(kept)
        print(f"viewbench: what was in '{folder}' is in '{kept}'", file=sys.stderr)


def _files(receipt: Path) -> dict[str, int]:
    """Bytes of each file that the receipt lists. Raises UserError for one that viewbench did not write."""
    record = read_json(receipt, "receipt")
    files = record.get("files", {}) if isinstance(record, dict) else None
    if not isinstance(files, dict) or not all(isinstance(size, int) for size in files.values()):
        raise UserError(f"receipt '{receipt}' is not as viewbench writes it; --force fetches the scene again")
    return files


def _move_added(old: Path, folder: Path) -> None:
    """Moves files that the receipt of the old folder does not list, and that the new one does not have."""
    listed = {*_files(old / RECEIPT), RECEIPT}
    for path in [path for path in old.rglob("*") if path.is_symlink() or path.is_file()]:
        name = path.relative_to(old).as_posix()
        if name not in listed and not (folder / name).exists():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            path.replace(folder / name)


def _size(path: Path) -> int | None:
    return path.stat().st_size if is_file(path) else None
