"""What lies beside the images of a capture and belongs to them: masks, depth images, and smaller copies of all three.

Tools find these by folder and name, so that a subset has them under the same ones:

    masks/NAME.jpg.png      COLMAP's feature extraction (ImageReaderOptions.mask_path)
    masks/NAME.png          nerfstudio's COLMAP reader (masks_path, depths_path: the image's name with .png)
    images_2/NAME.jpg       nerfstudio, gsplat, Mip-NeRF 360: a half, a fourth, an eighth of the size
    masks_2, depths_2       nerfstudio, for the same factor
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path, PurePosixPath

from .image_files import is_file, leaves

FACTORS = (2, 4, 8)
SIDE = re.compile(r"(masks?|depths?|normals?)(_[248])?")  # folders beside images/
SUFFIXES = (".png", ".jpg", ".jpeg", ".npy", ".exr", ".tif", ".tiff")


def beside(root: Path, names: Sequence[str]) -> list[tuple[Path, str]]:
    """Files in folders beside images/ that belong to the images of these names (relative to images/), and their place.

    The place is relative to `root`. An image may have none, or one under each of the tools' names.
    """
    if not root.is_dir():
        return []
    folders = sorted(path for path in root.iterdir() if path.is_dir() and SIDE.fullmatch(path.name))
    return [
        (folder / place, f"{folder.name}/{place}")
        for folder in folders
        for name in names
        for place in _in(folder, name)
    ]


def first_of(root: Path, kind: str, names: Sequence[str]) -> tuple[Path | None, ...]:
    """The file in the folder `kind` ("masks", "depths") of each image; empty where none has one."""
    folder = root / kind
    if not folder.is_dir():
        return ()
    found = tuple(next((folder / place for place in _in(folder, name)), None) for name in names)
    return found if any(found) else ()


def _in(folder: Path, name: str) -> Iterator[str]:
    """Names in the folder that belong to the image `name`, each looked for when its turn comes."""
    pure = PurePosixPath(name)
    places = [name, *(f"{name}{end}" for end in SUFFIXES), *(pure.with_suffix(end).as_posix() for end in SUFFIXES)]
    return (place for place in dict.fromkeys(places) if is_file(folder / place))


def smaller(root: Path, listed: Mapping[str, Sequence[str]]) -> tuple[list[tuple[Path, str]], list[str]]:
    """Smaller copies of the files of transforms.json, and their place; and a note where they are left out.

    `listed` has the paths of "images", "masks" and "depths" as transforms.json names them. Nerfstudio takes
    FOLDER_2/NAME for all of them as soon as it takes it for the images, whose folder it looks for by the first image
    alone (data/dataparsers/nerfstudio_dataparser.py, `_get_fname`). So a factor comes along where every file has its
    copy, and not at all otherwise.
    """
    found, notes = [], []
    for factor in FACTORS:
        wanted = [
            (root / f"{kind}_{factor}" / PurePosixPath(name).name, f"{kind}_{factor}/{PurePosixPath(name).name}")
            for kind, names in listed.items()
            for name in names
            if not leaves(name)
        ]
        there = [is_file(source) for source, _ in wanted]
        if wanted and all(there):
            found += wanted
        elif any(there) and (root / f"images_{factor}").is_dir():
            lacking = wanted[there.index(False)][1]
            notes.append(f"pictures at 1/{factor} of the size are left out: '{lacking}' is missing")
    return found, notes
