"""Fuzzed files: pictures of each kind, points, models of Gaussians, arrays, and archives of downloads."""

import io
import tarfile
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from tests.fuzz._reader import Input, InvalidError, Reader
from viewbench.backends import _gaussian_ply, _snapshot
from viewbench.common.errors import UserError
from viewbench.scenes import features, shipped_features
from viewbench.scenes.download import unpack
from viewbench.scenes.formats.images import nominal_cameras
from viewbench.scenes.image_files import check_whole, image_size
from viewbench.scenes.images import load_images
from viewbench.scenes.orientation import must_be_written, upright_size, write_photo
from viewbench.scenes.ply import read_points
from viewbench.scenes.types import Split

SIZE = (24, 16)
ROWS = np.random.default_rng(0).normal(size=(3, 4)).astype(np.float32)


def pixels(mode: str = "RGB") -> Image.Image:
    """A small picture of noise, in the mode."""
    values = np.random.default_rng(1).integers(0, 256, (SIZE[1], SIZE[0], 4), dtype=np.uint8)
    if mode == "I;16":
        return Image.fromarray(values[..., 0].astype(np.uint16) * 200)
    if mode == "F":
        return Image.fromarray(values[..., 0].astype(np.float32))
    image = Image.fromarray(values)
    return image if mode == "RGBA" else image.convert("RGB").convert(mode)


def profile() -> bytes:
    """An ICC profile of sRGB."""
    from PIL import ImageCms

    return ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()


def _tags() -> Image.Exif:
    from tests.scenes.test_photos import exif

    return exif(6)


def of_png(root: Path) -> None:
    for mode in ("RGB", "RGBA", "L", "LA", "P", "1", "I;16"):
        pixels(mode).save(root / f"{mode.replace(';', '')}.png")
    pixels().save(root / "tags.png", exif=_tags(), icc_profile=profile(), dpi=(72, 72))
    pixels("P").save(root / "clear.png", transparency=3)
    pixels().save(root / "key.png", transparency=(1, 2, 3))
    pixels().save(root / "moving.png", save_all=True, append_images=[pixels("L").convert("RGB")])


def of_jpg(root: Path) -> None:
    for mode in ("RGB", "L", "CMYK"):
        pixels(mode).save(root / f"{mode}.jpg")
    pixels().save(root / "tags.jpg", exif=_tags(), icc_profile=profile(), comment=b"a")
    pixels().save(root / "progressive.jpg", progressive=True, subsampling=2)
    pixels().save(root / "restart.jpg", restart_marker_blocks=1)


def of_webp(root: Path) -> None:
    pixels().save(root / "lossy.webp")
    pixels("RGBA").save(root / "lossless.webp", lossless=True)
    pixels().save(root / "tags.webp", exif=_tags(), icc_profile=profile())
    pixels().save(root / "moving.webp", save_all=True, append_images=[pixels("L").convert("RGB")])


def of_tif(root: Path) -> None:
    for mode in ("RGB", "RGBA", "L", "P", "1", "CMYK", "I;16", "F"):
        pixels(mode).save(root / f"{mode.replace(';', '')}.tif")
    for packed in ("tiff_lzw", "tiff_deflate", "packbits", "jpeg"):
        pixels().save(root / f"{packed}.tif", compression=packed)
    pixels("1").save(root / "fax.tif", compression="group4")
    pixels().save(root / "tags.tif", exif=_tags(), icc_profile=profile())
    pixels().save(root / "pages.tif", save_all=True, append_images=[pixels()])


def of_bmp(root: Path) -> None:
    for mode in ("RGB", "RGBA", "L", "P", "1"):
        pixels(mode).save(root / f"{mode}.bmp")


def of_gif(root: Path) -> None:
    pixels("P").save(root / "one.gif")
    pixels("P").save(root / "clear.gif", transparency=3)
    pixels("P").save(root / "moving.gif", save_all=True, append_images=[pixels("L").convert("P")], loop=0)


def of_heic(root: Path) -> None:
    import pillow_heif  # pyright: ignore[reportMissingImports]: an extra

    pillow_heif.register_heif_opener()
    pixels().save(root / "photo.heic")
    pixels("RGBA").save(root / "clear.heic")
    pixels().save(root / "tags.heic", exif=_tags().tobytes(), icc_profile=profile())


def opens_picture(given: Input) -> None:
    """A picture as all that reads one does: its head, all of it, upright, at 16 pixels, written again."""
    path = given.root / given.changed[0]
    errors: list[UserError] = []
    width = [0]

    def loaded() -> None:
        split = Split((path.name,), (path,), nominal_cameras(np.array([image_size(path)])))
        made, _ = load_images(split, np.array([0]), 16)
        if made.shape[2:] != (16, 3) or not (np.isfinite(made).all() and made.min() >= 0 and made.max() <= 1):
            raise InvalidError("pixels of another shape, NaN, or outside of [0, 1]")

    def embedded() -> None:
        made = features.picture(path, 16)
        if made.shape != (16, 16, 3) or not np.isfinite(made).all():
            raise InvalidError("a picture to embed of another shape, or with NaN")

    def sized() -> None:
        width[0], height = upright_size(path)
        if width[0] < 1 or height < 1:
            raise InvalidError("a picture without pixels")

    def written() -> None:
        if must_be_written(path):
            given.spare.mkdir(exist_ok=True)
            target = given.spare / path.with_suffix(".jpg" if path.suffix == ".heic" else path.suffix).name
            write_photo(path, target, given.rng.random() < 0.5)

    for use in (sized, lambda: check_whole(path), loaded, embedded, written):
        try:
            use()
        except UserError as error:
            errors.append(error)
    if errors:
        raise errors[0]


def of_points(root: Path) -> None:
    from plyfile import PlyData, PlyElement

    base = [("x", "f4"), ("y", "f4"), ("z", "f4"), ("nx", "f4"), ("red", "u1"), ("green", "u1"), ("blue", "u1")]
    table = np.zeros(5, base)
    table["x"] = np.arange(5)
    faces = np.array([([0, 1, 2],), ([1, 2, 3],)], dtype=[("vertex_indices", "i4", (3,))])
    lists = np.empty(2, dtype=[("vertex_indices", "O")])
    lists["vertex_indices"] = [np.array([0, 1, 2], "i4"), np.array([1, 2, 3, 4], "i4")]
    vertex = PlyElement.describe(table, "vertex")
    ways: dict[str, dict[str, Any]] = {
        "text": {"text": True},
        "little": {"byte_order": "<"},
        "big": {"byte_order": ">"},
    }
    for name, way in ways.items():
        PlyData([vertex], **way).write(root / f"{name}.ply")
        PlyData([vertex, PlyElement.describe(faces, "face")], **way).write(root / f"{name}_faces.ply")
        PlyData([vertex, PlyElement.describe(lists, "face")], **way).write(root / f"{name}_lists.ply")
    doubles = table.astype([("x", "f8"), ("y", "f8"), ("z", "f8"), ("nx", "f8"), *base[4:]])
    PlyData([PlyElement.describe(doubles, "vertex")], comments=["made up"]).write(root / "doubles.ply")


def opens_points(given: Input) -> None:
    points = read_points(given.root / given.changed[0])
    if points.xyz.shape != (len(points), 3) or points.xyz.dtype != np.float64:
        raise InvalidError("points of another shape")
    if points.rgb.shape != (len(points), 3) or points.rgb.dtype != np.uint8:
        raise InvalidError("colours of another shape")


def gaussians(rest: int) -> _gaussian_ply.Gaussians:
    rng = np.random.default_rng(2)
    made = (rng.normal(size=shape).astype(np.float32) for shape in ((6, 3), (6, 3), (6, 4), (6,), (6, 3), (6, rest, 3)))
    return _gaussian_ply.Gaussians(*made)


def of_gaussians(root: Path) -> None:
    for rest in (0, 3, 15):
        _gaussian_ply.save(root / f"model{rest}.ply", gaussians(rest))


def opens_gaussians(given: Input) -> None:
    from viewbench.backends.splat import ply

    path = given.root / given.changed[0]
    model = _gaussian_ply.load(path)
    n, rest = len(model), model.shn.shape[1]
    shapes = [(n, 3), (n, 3), (n, 4), (n,), (n, 3), (n, rest, 3)]
    if [value.shape for value in vars(model).values()] != shapes:
        raise InvalidError("Gaussians of another shape")
    ply.read(path)


def of_arrays(root: Path) -> None:
    np.save(root / "f4.npy", ROWS)
    np.save(root / "f8.npy", ROWS.astype(np.float64))
    np.save(root / "f2.npy", ROWS.astype(np.float16))
    np.save(root / "i4.npy", np.arange(12).reshape(3, 4))
    np.save(root / "columns.npy", np.asfortranarray(ROWS))


def opens_array(given: Input) -> None:
    path = given.root / given.changed[0]
    rows = features.load_user_features(path, 3)
    if rows.shape[0] != 3 or rows.ndim != 2 or rows.dtype != np.float32 or not np.isfinite(rows).all():
        raise InvalidError("features of another shape, or not finite")


def of_rows(root: Path) -> None:
    np.save(root / "row.npy", ROWS[0])


def opens_row(given: Input) -> None:
    row = features.cached(given.root / "row.npy")
    if row is None:
        raise UserError("it is made again")
    if row.ndim != 1 or row.dtype != np.float32 or not np.isfinite(row).all():
        raise InvalidError("a row of the cache that is none")


MADE_BY = {"version": "1", "weights_sha256": "", "decoding": ""}


def of_shipped(root: Path) -> None:
    shipped_features.write(root, "enc", MADE_BY, ["a" * 64, "b" * 64, "c" * 64], ROWS)


def opens_shipped(given: Input) -> None:
    from viewbench.common.files import write_text

    file = given.root / "features" / "enc.npy"
    shipped_features.files(given.root)
    sums = file.with_suffix(".sha256")
    if "features/enc.sha256" not in given.changed and given.rng.random() < 0.8:  # so that the others are looked into
        files = (file.with_suffix(".json"), file)
        if not all(path.is_file() for path in files):
            raise UserError("one of them is not there")
        write_text(sums, shipped_features._sums(file))
    before = sums.read_bytes() if sums.is_file() else b""
    try:
        rows = shipped_features.read(given.root, "enc", lambda: MADE_BY)
    finally:
        if before and "features/enc.sha256" not in given.changed:
            write_text(sums, _sums_of_valid())
    for row in rows.values():
        if row.ndim != 1 or not np.isfinite(row).all() or abs(np.linalg.norm(row) - 1) > 1e-3:
            raise InvalidError("a row that is not of length 1")


def _sums_of_valid() -> str:
    import tempfile

    with tempfile.TemporaryDirectory(dir=Path(tempfile.gettempdir()).parent) as folder:
        of_shipped(Path(folder))
        return (Path(folder) / "features" / "enc.sha256").read_text()


def of_snapshot(root: Path) -> None:
    _snapshot.write(root, {"gaussians": ROWS, "step": np.array(3)}, {"seed": 0, "curve": [1.0, 2.0]})


def opens_snapshot(given: Input) -> None:
    def make(arrays: dict[str, np.ndarray], plain: dict[str, Any]) -> tuple:
        return arrays["gaussians"].shape, int(arrays["step"]), plain["seed"]

    if _snapshot.read(given.root, make) is None:
        raise UserError("it is begun anew")


def of_zip(root: Path) -> None:
    inner = io.BytesIO()
    with zipfile.ZipFile(inner, "w") as archive:
        archive.writestr("seq/a.txt", "1 2 3\n" * 20)
    for name, packed in (("stored", zipfile.ZIP_STORED), ("packed", zipfile.ZIP_DEFLATED), ("bz", zipfile.ZIP_BZIP2)):
        with zipfile.ZipFile(root / f"{name}.zip", "w", packed) as archive:
            for file in ("room/images/a.png", "room/images/b.png", "room/sparse/0/cameras.txt", "other/c.txt"):
                archive.writestr(file, (file * 30).encode())
            archive.writestr("room/inner.zip", inner.getvalue())


def opens_zip(given: Input) -> None:
    name = given.changed[0]
    given.spare.mkdir()
    target = given.spare / "staging"
    with unpack.damaged(name), zipfile.ZipFile(given.root / name) as archive:
        chosen = unpack.members(archive, "room/", (), name)
        unpack.spans(archive, list(chosen.values()))
        missing = {at: info for at, info in chosen.items() if not unpack.is_right(target / at, info)}
        unpack.extract(archive, missing, target, name, lambda count: None)
        _inside(given.spare)
    for path in [path for path in target.rglob("*.zip") if path.is_file()]:
        unpack.unpack_nested(path, name, lambda count: None)
    _inside(given.spare)


def of_tar(root: Path) -> None:
    with tarfile.open(root / "scene.tar.gz", "w:gz") as archive:
        for file in ("room/images/a.png", "room/images/b.png", "room/poses.txt", "other/c.txt"):
            info = tarfile.TarInfo(file)
            info.size = 30 * len(file)
            archive.addfile(info, io.BytesIO((file * 30).encode()))
    import gzip

    (root / "scene.tar").write_bytes(gzip.decompress((root / "scene.tar.gz").read_bytes()))
    (root / "scene.tar.gz").unlink()


def opens_tar(given: Input) -> None:
    import gzip

    given.spare.mkdir()
    packed = given.spare / "scene.tar.gz"
    packed.write_bytes(gzip.compress((given.root / "scene.tar").read_bytes(), 1))
    unpack.extract_tar(packed, "room/", (), given.spare / "staging", "scene.tar.gz", lambda count: None)
    _inside(given.spare)


def _inside(folder: Path) -> None:
    """Raises InvalidError for anything beside the folder that was to be filled."""
    extra = [path.name for path in folder.iterdir() if path.name not in ("staging", "scene.tar.gz")]
    if extra or any(path.is_symlink() for path in folder.rglob("*")):
        raise InvalidError("something is written beside the folder, or a link into it")


Make = Callable[[Path], object]
PICTURES: dict[str, Make] = {
    "png": of_png,
    "jpg": of_jpg,
    "webp": of_webp,
    "tif": of_tif,
    "bmp": of_bmp,
    "gif": of_gif,
    "heic": of_heic,
}
READERS = (
    *(
        Reader(f"picture-{kind}", make, opens_picture, package="pillow_heif" if kind == "heic" else "", whole=True)
        for kind, make in PICTURES.items()
    ),
    Reader("points-ply", of_points, opens_points, whole=True),
    Reader("gaussians-ply", of_gaussians, opens_gaussians, whole=True),
    Reader("features-npy", of_arrays, opens_array, whole=True),
    Reader("features-cache", of_rows, opens_row, whole=True),
    Reader("features-shipped", of_shipped, opens_shipped),
    Reader("snapshot-npz", of_snapshot, opens_snapshot, whole=True),
    Reader("archive-zip", of_zip, opens_zip, whole=True),
    Reader("archive-tar", of_tar, opens_tar, whole=True),
)
