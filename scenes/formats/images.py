"""A folder of images without poses, before any structure-from-motion: chosen by content, time and sharpness."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from ...common.errors import UserError
from ..image_files import HEIC, image_size
from ..orientation import must_be_written, upright_size, write_photo, written_name
from ..subset import place_image
from ..types import Cameras, Scene, Split
from ._frames import natural

WRITABLE = True
POSED = False
SUFFIXES = {".jpg", ".jpeg", ".png", ".webp", ".tif", ".tiff", ".bmp", *HEIC}


def detect(root: Path) -> str | None:
    """Why the folder is in this format, or None."""
    found = _images(root)
    return f"it has {len(found)} images and no poses" if len(found) >= 2 else None


def _images(root: Path) -> list[Path]:
    """The images in the folder itself or, where it has none, in its folder images/, in natural order."""
    for folder in (root, root / "images"):
        if folder.is_dir():
            found = [path for path in folder.iterdir() if path.suffix.lower() in SUFFIXES and path.is_file()]
            found = [path for path in found if not path.name.startswith("._")]  # macOS's, beside files on other disks
            if found:
                return sorted(found, key=lambda path: natural(path.name))
    return []


def read(root: Path) -> Scene:
    """All images as training views, in natural order of their names, without times.

    Sizes are those of the photos as they are seen and written (`orientation`); there may be several. Raises UserError
    when there are fewer than two, when one is no image, and for HEIC photos without the package for them.
    """
    paths = _images(root)
    if len(paths) < 2:
        raise UserError(f"'{root}' has {len(paths)} images; a capture has at least two")
    sizes = np.array([upright_size(path) for path in paths], dtype=np.int64)
    turn, note = True, ""
    if (sizes != sizes[0]).any():
        stored = np.array([image_size(path) for path in paths], dtype=np.int64)
        if not (stored != stored[0]).any():
            sizes, turn = stored, False
            note = "photos held upright and across are written as the sensor saw them, of one size, and not turned"
        else:
            found, counts = np.unique(sizes, axis=0, return_counts=True)
            listed = ", ".join(f"{count} of {w} x {h}" for (w, h), count in zip(found, counts, strict=True))
            note = f"photos of several sizes ({listed}): each is a camera of its own to structure-from-motion"
    names = tuple(path.name for path in paths)
    scene = unposed(root, "images", Split(names, tuple(paths), nominal_cameras(sizes)), turn=turn)
    return replace(scene, notes=(*scene.notes, note)) if note else scene


def nominal_cameras(sizes: np.ndarray) -> Cameras:
    """Cameras of (N, 2) sizes in pixels that stand at the origin and mean nothing but their sizes."""
    width, height = sizes.T
    poses = np.tile(np.eye(4), (len(sizes), 1, 1))
    return Cameras(poses, width * 1.0, width * 1.0, width / 2, height / 2, width, height)


def unposed(root: Path, name: str, frames: Split, files: tuple[Path, ...] = (), **details: object) -> Scene:
    """A scene of frames whose poses are not known."""
    note = "no poses: views are chosen by image content, time and sharpness"
    return Scene(
        name=root.stem,
        root=root,
        format=name,
        train=frames,
        test=frames.subset([]),
        files=files,
        notes=(note,),
        posed=False,
        details=details,
    )


def write(scene: Scene, indices: np.ndarray, out: Path, copy: bool) -> None:
    """Writes the chosen images to images/, and those held out, if any, to test/, under their files' names.

    They are linked or copied, but for those that programs would see turned or not at all (`orientation`).

    Raises UserError for two images of one name, which other formats keep in two folders.
    """
    names = {path.name for split in (scene.train, scene.test) for path in split.paths}
    for folder, split in (("images", scene.train.subset(indices)), ("test", scene.test)):
        taken: dict[str, Path] = {}
        for path in split.paths:
            if taken.setdefault(path.name, path) is not path:
                raise UserError(f"'{taken[path.name]}' and '{path}' have one name; write another format, or rename one")
            target = out / folder / written_name(path, names)
            if scene.format == "images" and must_be_written(path):
                target.parent.mkdir(exist_ok=True)
                write_photo(path, target, bool(scene.details.get("turn", True)))
            else:
                place_image(path, target, copy)
