"""Captures that mean harm, and what viewbench does with them: `python tests/scenes/hostile.py` prints the table.

Each command runs in a process of its own that is forked from one which has imported what it needs; time and memory are
those of the command alone.
"""

import contextlib
import json
import os
import resource
import shlex
import shutil
import struct
import subprocess
import sys
import tempfile
import time
import zlib
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

SECRET = "correct-horse-battery-staple"
MEMORY = 12 << 30  # bytes of addresses; what is used is far less
PATIENCE_S = 120
SELECT = "select {scene} --selector uniform --count 2 --out {out}"


@dataclass(frozen=True)
class Result:
    """What a command did; `left` are the files that are there now and were not before."""

    attack: str
    command: str
    status: int
    seconds: float
    megabytes: int
    out: str
    err: str
    left: list[str]
    pages: str = ""  # the HTML that it wrote


@dataclass(frozen=True)
class Attack:
    """`make` fills the folder that it is given; "{outside}" in a command is a folder beside the capture."""

    make: Callable[[Path], object]
    commands: tuple[str, ...]
    status: int = 2
    says: str = ""


ATTACKS: dict[str, Attack] = {}


def attack(name: str, *commands: str, status: int = 2, says: str = ""):
    """Enters what the function makes in the table."""

    def entered(make: Callable[[Path], object]) -> Callable[[Path], object]:
        ATTACKS[name] = Attack(make, commands or (SELECT,), status, says)
        return make

    return entered


def posed(folder: Path, names: list[str] | None = None, **keys: object) -> Path:
    """A capture of three frames as transforms.json; the pictures of names that a file system takes are there."""
    from PIL import Image

    names = names or [f"images/{i}.png" for i in range(3)]
    frames = []
    for i, name in enumerate(names):
        with contextlib.suppress(OSError, ValueError):
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            Image.new("RGB", (32, 24), (i, 0, 0)).save(folder / name, format="PNG")
        pose = [[1, 0, 0, i], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
        frames.append({"file_path": name, "transform_matrix": pose})
    table = {"fl_x": 30, "w": 32, "h": 24, **keys, "frames": frames}
    (folder / "transforms.json").write_text(json.dumps(table))
    return folder


def leading_out(link: Path) -> Path:
    """A folder beside the capture, to which `link` in the capture leads."""
    outside = link.parents[1] / "outside"
    outside.mkdir()
    link.symlink_to("../outside")
    return outside


def edited(folder: Path, change: Callable[[dict], object]) -> None:
    """The capture's table as `change` leaves it."""
    table = json.loads((folder / "transforms.json").read_text())
    change(table)
    (folder / "transforms.json").write_text(json.dumps(table))


def colmap(folder: Path, images: int = 3, points: bytes = struct.pack("<Q", 0)) -> Path:
    """A binary model, whose points are the bytes given."""
    from PIL import Image

    model = folder / "sparse" / "0"
    model.mkdir(parents=True)
    (folder / "images").mkdir()
    (model / "cameras.bin").write_bytes(struct.pack("<QIiQQ4d", 1, 1, 1, 32, 24, 30, 30, 16, 12))
    rows = struct.pack("<Q", images)
    for i in range(images):
        rows += struct.pack("<I7dI", i + 1, 1, 0, 0, 0, i, 0, 0, 1) + f"{i}.png\0".encode() + struct.pack("<Q", 0)
        Image.new("RGB", (32, 24), (i, 0, 0)).save(folder / f"images/{i}.png")
    (model / "images.bin").write_bytes(rows)
    (model / "points3D.bin").write_bytes(points)
    return model


def sparse(path: Path, size: int, head: bytes = b"") -> None:
    """A file that has so many bytes, most of them zeros that take no room."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with open(path, "wb") as file:
        file.write(head)
        file.truncate(size)


def png(width: int, height: int, extra: bytes = b"") -> bytes:
    """A PNG file of that size with no pixels in it, and chunks `extra` before them."""
    head = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + extra + chunk(b"IDAT", zlib.compress(b"\0" * 100))


def chunk(kind: bytes, data: bytes) -> bytes:
    """A chunk of a PNG file."""
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def tiff(width: int, height: int, following: int = 0) -> bytes:
    """The head of a TIFF file, whose second directory lies where `following` says."""
    tags = [(256, 4, 1, width), (257, 4, 1, height), (258, 3, 1, 8), (259, 3, 1, 1), (262, 3, 1, 1), (273, 4, 1, 8)]
    tags += [(277, 3, 1, 1), (278, 4, 1, height), (279, 4, 1, width * height % (1 << 32))]
    body = b"".join(struct.pack("<HHII", *tag) for tag in tags)
    return struct.pack("<2sHIH", b"II", 42, 8, len(tags)) + body + struct.pack("<I", following)


def picture(folder: Path, content: bytes, name: str = "images/1.png") -> None:
    """A capture one of whose pictures has these bytes, and whose cameras are of the size that its head says."""
    posed(folder, ["images/0.png", name, "images/2.png"])
    (folder / name).write_bytes(content)


def ply(folder: Path, head: str, body: bytes = b"") -> None:
    """A capture with a point cloud."""
    posed(folder)
    (folder / "points3d.ply").write_bytes(f"ply\n{head}end_header\n".encode() + body)


XYZ = "property float x\nproperty float y\nproperty float z\n"
BINARY = "format binary_little_endian 1.0\n"


@attack("nothing wrong", status=0)
def _(folder):
    posed(folder)


# Links and files that are none


@attack("a pipe for transforms.json", "info {scene}")
def _(folder):
    os.mkfifo(folder / "transforms.json")


@attack("a pipe for an image")
def _(folder):
    posed(folder, w=0, h=0)
    (folder / "images/0.png").unlink()
    os.mkfifo(folder / "images/0.png")


@attack("a pipe for COLMAP's rigs.bin", says="pipe")
def _(folder):
    os.mkfifo(colmap(folder) / "rigs.bin")


@attack("a pipe for sensor.yaml", says="pipe")
def _(folder):
    euroc(folder)
    (folder / "mav0/cam0/sensor.yaml").unlink()
    os.mkfifo(folder / "mav0/cam0/sensor.yaml")


@attack("a pipe among features", status=0)
def _(folder):
    posed(folder)
    (folder / "features").mkdir()
    os.mkfifo(folder / "features/efficientnet-lite0.json")


@attack("an image that links to /dev/zero")
def _(folder):
    posed(folder, w=0, h=0)
    (folder / "images/0.png").unlink()
    (folder / "images/0.png").symlink_to("/dev/zero")


@attack("transforms.json that links to /dev/zero", "info {scene}")
def _(folder):
    (folder / "transforms.json").symlink_to("/dev/zero")


@attack("an image that links to itself")
def _(folder):
    posed(folder)
    (folder / "images/0.png").unlink()
    (folder / "images/0.png").symlink_to("0.png")


@attack("a folder of images that links above itself", status=0)
def _(folder):
    posed(folder)
    (folder / "images/again").symlink_to("..")


@attack("a list that links to a secret", "info {scene} --format tum-rgbd", says="what a link leads to")
def _(folder):
    (folder.parent / "secret").write_text(f"9{SECRET} {SECRET}\n")
    (folder / "rgb.txt").symlink_to(folder.parent / "secret")
    (folder / "groundtruth.txt").write_text("1 0 0 0 0 0 0 1\n")
    (folder / "1").write_text("")


@attack("transforms.json that links to a secret", "info {scene}")
def _(folder):
    (folder.parent / "secret").write_text(SECRET)
    (folder / "transforms.json").symlink_to(folder.parent / "secret")


@attack("a mask that links to a secret, copied", f"{SELECT} --copy", SELECT, says="no picture")
def _(folder):
    posed(folder)
    (folder.parent / "secret").write_text(SECRET)
    (folder / "masks").mkdir()
    (folder / "masks/0.png").symlink_to(folder.parent / "secret")
    edited(folder, lambda table: [frame.update(mask_path="masks/0.png") for frame in table["frames"]])


@attack("a smaller image of COLMAP that links to a secret", f"{SELECT} --copy", says="no picture")
def _(folder):
    colmap(folder)
    (folder.parent / "secret").write_text(SECRET)
    (folder / "images_2").mkdir()
    for i in range(3):
        (folder / f"images_2/{i}.png").symlink_to(folder.parent / "secret")


@attack("a frame outside", says="leaves the scene folder")
def _(folder):
    posed(folder, ["../outside/0.png", "images/1.png", "images/2.png"])


@attack("a frame by an absolute path", says="leaves the scene folder")
def _(folder):
    posed(folder)
    edited(folder, lambda table: table["frames"][0].update(file_path="/etc/passwd"))


@attack(
    "a link in the capture that --out is to follow",
    "select {scene} --selector uniform --count 2 --out {scene}/subset",
    "select {scene} --selector uniform --count 2 --out {scene}/subset/deeper --force",
    "select {scene} --selector uniform --count 2 --out {scene}/subset --force",
    says="a link in the capture",
)
def _(folder):
    posed(folder)
    (leading_out(folder / "subset") / "precious").write_text(SECRET)


@attack(
    "features/ that links elsewhere",
    "features {scene} --beside",
    says="is a link",
)
def _(folder):
    posed(folder)
    leading_out(folder / "features")


@attack("settings in the capture", "info {scene}", "info .", says="may have come with it")
def _(folder):
    posed(folder)
    (folder / "environment.toml").write_text('[data]\nroot = "/"\n')


@attack("settings of 1 GB in the current folder", "info .", says="at most 1.05 MB")
def _(folder):
    posed(folder)
    sparse(folder / "environment.toml", 1 << 30)


# Names

NAMES = ["images/a\nb.png", "images/\x1b[2J\x1b]0;x\x07.png", "images/$(touch pwned).png", "images/-rf.png"]
NAMES += ['images/"><script>alert(1)<!--.png', "images/`id`;\u202egnp.png", "images/%s{0}$x$.png"]


@attack(
    "names for terminals, shells and pages",
    SELECT,
    f"{SELECT}2 --sheet sheet.html --plot plot.html",
    "info {scene}",
    status=0,
)
def _(folder):
    posed(folder, NAMES)


@attack("an error about a name that gives orders")
def _(folder):
    posed(folder, NAMES[:3])
    (folder / NAMES[1]).unlink()


@attack("a name of 300 letters", says="missing")
def _(folder):
    posed(folder, ["images/" + "a" * 300, "images/1.png"])


@attack("a name of a million letters, and digits", SELECT)
def _(folder):
    posed(folder, ["9" * 1_000_000, "images/1.png"])


@attack("names that are no text", says="missing")
def _(folder):
    posed(folder, ["images/\ud800.png", "images/1.png"])


@attack("names that are not UTF-8, as COLMAP", "convert {scene} --to colmap --out {out}")
def _(folder):
    posed(folder, [os.fsdecode(b"images/\xff\xfe.png"), "images/1.png"])


# JSON


@attack("1 GB of JSON", says="at most 134 MB")
def _(folder):
    sparse(folder / "transforms.json", 1 << 30, b'{"frames": [')


@attack("JSON 100,000 deep", says="not valid JSON")
def _(folder):
    (folder / "transforms.json").write_text("[" * 100_000)


@attack("JSON of 5 million lists", says="lists and objects")
def _(folder):
    (folder / "transforms.json").write_text('{"frames": [' + "[]," * 5_000_000 + "[]]}")


@attack("JSON with a number of 5,000 digits", says="digits")
def _(folder):
    (folder / "transforms.json").write_text('{"fl_x": ' + "9" * 5000 + ', "frames": []}')


@attack("JSON with NaN and infinity", says="focal length")
def _(folder):
    posed(folder, fl_x=float("nan"))


@attack("JSON with one key twice", status=0)
def _(folder):
    posed(folder)
    text = (folder / "transforms.json").read_text()
    (folder / "transforms.json").write_text('{"frames": 7, ' + text[1:])


@attack("5,000 keys for each of 5,000 frames", "info {scene}", says="twice")
def _(folder):
    posed(folder, None, **{f"key{i}": i for i in range(5_000)})
    frame = json.loads((folder / "transforms.json").read_text())["frames"][0]
    frames = [{**frame, "file_path": f"images/{i}.png"} for i in range(5_000)]
    edited(folder, lambda table: table.update(frames=[*frames, frames[-1]]))


# Pictures


@attack("a PNG of 400 million pixels", says="200 million")
def _(folder):
    picture(folder, png(20_000, 20_000))


@attack("a BMP of 400 million pixels", says="200 million")
def _(folder):
    picture(folder, b"BM" + struct.pack("<IHHIIiiHHIIiiII", 54, 0, 0, 54, 40, 20_000, 20_000, 1, 24, 0, 0, 1, 1, 0, 0))


@attack("a GIF of 4 billion pixels", says="200 million")
def _(folder):
    picture(folder, b"GIF89a" + struct.pack("<HHBBB", 65535, 65535, 0, 0, 0) + b",\0\0\0\0\1\0\1\0\0\2\2D\1\0;")


@attack("a TIFF of 10^12 pixels, its directories in a circle", says="200 million")
def _(folder):
    picture(folder, tiff(1_000_000, 1_000_000, 8), "images/1.tif")


@attack("a PPM that claims 10^10 pixels", says="200 million")
def _(folder):
    picture(folder, b"P6 100000 100000 255\n")


@attack("a PNG whose text unpacks to 1 GB", "select {scene} --selector maxmin --count 2 --out {out}")
def _(folder):
    compressor = zlib.compressobj(9)
    packed = b"".join(compressor.compress(bytes(1 << 20)) for _ in range(1024)) + compressor.flush()
    picture(folder, png(32, 24, chunk(b"zTXt", b"Comment\0\0" + packed)))


@attack("a PNG whose colour profile unpacks to 1 GB", "select {scene} --selector maxmin --count 2 --out {out}")
def _(folder):
    compressor = zlib.compressobj(9)
    packed = b"".join(compressor.compress(bytes(1 << 20)) for _ in range(1024)) + compressor.flush()
    picture(folder, png(32, 24, chunk(b"iCCP", b"profile\0\0" + packed)))


@attack("photos whose EXIF is rubbish", "select {scene} --selector uniform --count 2 --out {out}", status=0)
def _(folder):
    from PIL import Image

    walk(folder)
    shutil.rmtree(folder / "images")
    tags = struct.pack("<HHHII", 3, 0x0112, 3, 1 << 31, 1 << 31) + struct.pack("<HHII", 0x8769, 4, 1, 8)
    tags += struct.pack("<HHII", 0x8825, 4, 1, 8) + struct.pack("<I", 8)  # directories in themselves
    rubbish = b"Exif\0\0II*\0" + struct.pack("<I", 8) + tags
    for i in range(3):
        Image.new("RGB", (32, 24), (80 * i, 0, 0)).save(folder / f"{i}.jpg", exif=rubbish)


@attack("PostScript as a JPEG, for Ghostscript", says="none of")
def _(folder):
    script = b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 32 24\n%%EndComments\n(pwned) (w) file closefile\n"
    picture(folder, script, "images/1.jpg")


@attack("a JPEG of 3,000 scans", "select {scene} --selector maxmin --count 2 --out {out}", says="scans")
def _(folder):
    import io

    from PIL import Image

    buffer = io.BytesIO()
    Image.new("RGB", (32, 24)).save(buffer, format="JPEG", progressive=True)
    content = buffer.getvalue()
    last = content.rindex(b"\xff\xda")
    picture(folder, content[:last] + content[last:-2] * 3000 + content[-2:], "images/1.jpg")


@attack("an image file of 1 TB", says="at most 1.07 GB")
def _(folder):
    posed(folder)
    sparse(folder / "images/1.png", 1 << 40, png(32, 24))


# Numbers in COLMAP's files


@attack("COLMAP with 2^63 points", says="points")
def _(folder):
    colmap(folder, points=struct.pack("<Q", 1 << 63))


@attack("COLMAP with a track of 2^61 views", says="cut short")
def _(folder):
    colmap(folder, points=struct.pack("<QQ3d3BdQ", 1, 1, 0, 0, 0, 0, 0, 0, 0, 1 << 61))


@attack("COLMAP with 2^63 images", says="cut short")
def _(folder):
    model = colmap(folder)
    (model / "images.bin").write_bytes(struct.pack("<Q", 1 << 63) + bytes(200))


@attack("COLMAP with a name without an end", says="cut short")
def _(folder):
    model = colmap(folder)
    (model / "images.bin").write_bytes(struct.pack("<QI7dI", 1, 1, 1, 0, 0, 0, 0, 0, 0, 1) + b"a" * 10_000_000)


@attack("COLMAP with a camera of 2^63 pixels", says="cut short or damaged")
def _(folder):
    model = colmap(folder)
    (model / "cameras.bin").write_bytes(struct.pack("<QIiQQ4d", 1, 1, 1, 1 << 63, 24, 30, 30, 16, 12))


@attack("COLMAP's points of 1 TB", says="at most 4.29 GB")
def _(folder):
    sparse(colmap(folder) / "points3D.bin", 1 << 40)


@attack("COLMAP's text in a line of 900 MB", says="no text")
def _(folder):
    model = colmap(folder)
    (model / "cameras.bin").unlink()
    for name in ("images", "points3D"):
        (model / f"{name}.bin").unlink()
        (model / f"{name}.txt").write_text("#\n")
    sparse(model / "cameras.txt", 900_000_000, b"1 PINHOLE 32 24 ")


# Points, features, text


@attack("a PLY that claims 10^12 vertices", says="fewer are in it")
def _(folder):
    ply(folder, f"{BINARY}element vertex 1000000000000\n{XYZ}")


@attack("a PLY of 10^9 vertices in a file of holes", says="thin it out")
def _(folder):
    ply(folder, f"{BINARY}element vertex 1000000000\n{XYZ}")
    os.truncate(folder / "points3d.ply", 12_000_000_200)


@attack("a PLY with lists for vertices", says="lists")
def _(folder):
    ply(folder, f"{BINARY}element vertex 1\n{XYZ}property list int float more\n", bytes(100))


@attack("a PLY with a property twice", says="twice")
def _(folder):
    ply(folder, f"{BINARY}element vertex 1\n{XYZ}property float x\n", bytes(100))


@attack("a PLY with NaN", says="NaN")
def _(folder):
    ply(folder, f"{BINARY}element vertex 1\n{XYZ}", struct.pack("<3f", float("nan"), 0, 0))


@attack("a PLY whose head does not end", says="its head does not end")
def _(folder):
    ply(folder, "comment " + "a" * 10_000_000)


@attack("a PLY with 10^9 faces behind its vertices", status=0)
def _(folder):
    faces = "element face 1000000000\nproperty list uchar int vertex_indices\n"
    ply(folder, f"{BINARY}element vertex 1\n{XYZ}{faces}", bytes(12))
    os.truncate(folder / "points3d.ply", 1_000_000_000)


@attack(
    "features with code in them",
    f"{SELECT} --features {{scene}}/features.npy".replace("uniform", "maxmin"),
    says="numbers",
)
def _(folder):
    import numpy as np

    posed(folder)

    class Code:
        def __reduce__(self):
            return os.mkdir, ("pwned",)

    np.save(folder / "features.npy", np.array([Code()], dtype=object), allow_pickle=True)


@attack("features that claim 10^15 rows", f"{SELECT} --features {{scene}}/features.npy".replace("uniform", "maxmin"))
def _(folder):
    posed(folder)
    head = str({"descr": "<f4", "fortran_order": False, "shape": (10**15, 4)}).ljust(117) + "\n"
    (folder / "features.npy").write_bytes(b"\x93NUMPY\1\0" + struct.pack("<H", len(head)) + head.encode())


@attack("a trajectory in a line of 1 GB", "info {scene} --poses {scene}/poses.txt", says="at most 134 MB")
def _(folder):
    walk(folder)
    sparse(folder / "poses.txt", 1 << 30)


@attack("a trajectory in a line of 100 MB", "info {scene} --poses {scene}/poses.txt", says="letters")
def _(folder):
    walk(folder)
    (folder / "poses.txt").write_text("1 " * 50_000_000)


@attack("a trajectory of 3 million lines", "info {scene} --poses {scene}/poses.txt", says="lines")
def _(folder):
    walk(folder)
    (folder / "poses.txt").write_text("1\n" * 3_000_000)


@attack("a sequence with a number of 6,000 digits", "info {scene}", says="no folder")
def _(folder):
    (folder / "seq-01").mkdir()
    (folder / "seq-01/frame-000000.pose.txt").write_text("1")
    (folder / "TrainSplit.txt").write_text("sequence" + "1" * 6000)


# Videos


@attack("a list of other files as a video", "info {scene}/clip.mp4")
def _(folder):
    clip(folder / "real.mp4")
    (folder / "clip.mp4").write_text("ffconcat version 1.0\nfile real.mp4\n")


@attack("a playlist of addresses as a video", "info {scene}/clip.mp4")
def _(folder):
    (folder / "clip.mp4").write_text("#EXTM3U\n#EXT-X-TARGETDURATION:1\n#EXTINF:1,\nhttp://127.0.0.1:9/a.ts\n")


@attack("a video that claims 16,384 x 16,384 pixels", "info {scene}/clip.avi")
def _(folder):
    clip(folder / "clip.avi", "mjpeg", "yuvj420p")
    content = (folder / "clip.avi").read_bytes()
    head = content.index(b"strf") + 12  # where its width is
    content = content[:head] + struct.pack("<ii", 16384, 16384) + content[head + 8 :]
    begin = b"\xff\xc0\0\x11\x08"  # of a JPEG's head, before its height and width
    content = content.replace(begin + struct.pack(">HH", 48, 64), begin + struct.pack(">HH", 16384, 16384))
    (folder / "clip.avi").write_bytes(content)


@attack(
    "a video that claims 10^9 frames",
    "info {scene}/clip.mp4",
)
def _(folder):
    clip(folder / "clip.mp4")
    content = bytearray((folder / "clip.mp4").read_bytes())
    for kind, *values in ((b"stsz", 0, 1, 1 << 30), (b"stsc", 0, 1, 1, 1 << 30, 1), (b"stts", 0, 1, 1 << 30)):
        at = content.index(kind) + 4
        content[at : at + 4 * len(values)] = struct.pack(f">{len(values)}I", *values)
    (folder / "clip.mp4").write_bytes(content)


@attack("a video of 8 TB", "info {scene}/clip.mp4", says="137 GB")
def _(folder):
    sparse(folder / "clip.mp4", 8 << 40)


@attack("a video without frames", "info {scene}/clip.mkv")
def _(folder):
    clip(folder / "clip.mkv", frames=0)


# Selections, models, studies

TRAIN = "train {scene} --selection {scene}/selection.json --iterations 1 --width 16 --out "


def selection(folder: Path, indices: list) -> None:
    """A selection of the capture by somebody else."""
    posed(folder)
    names = [f"images/{i % 3}.png" for i in range(len(indices))]
    record = {"indices": indices, "names": names, "n_views": 3, "selector": "mine", "seed": 0}
    (folder / "selection.json").write_text(json.dumps(record))


@attack("a selection of view 10^18", TRAIN + "{out}", says="indices")
def _(folder):
    selection(folder, [0, 10**18])


@attack("a selection of view -1", TRAIN + "{out}", says="indices")
def _(folder):
    selection(folder, [0, -1])


@attack("a record of training that names files outside", "evaluate {scene}/model {scene} --holdout every:2 --out {out}")
def _(folder):
    from viewbench.common import settings
    from viewbench.common.files import sha256_file
    from viewbench.scenes.digest import scene_sha256
    from viewbench.scenes.load import open_scene

    posed(folder, [f"images/{i}.png" for i in range(6)])
    scene = open_scene(str(folder), settings.load(), holdout="every:2")
    (folder.parent / "secret").write_text(SECRET)
    (folder / "model").mkdir()
    files = {"../../secret": sha256_file(folder.parent / "secret")}
    record = {"scene": scene.name, "scene_sha256": scene_sha256(scene), "files": files, "backend": "splat", "width": 16}
    (folder / "model/train.json").write_text(json.dumps(record))


@attack("a study whose aliases are 10^9 values", "study {scene}/study.yaml", says="aliases")
def _(folder):
    lines = ["a0: &a0 [x, x, x, x, x, x, x, x, x, x]"]
    lines += [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10)}]" for i in range(1, 10)]
    (folder / "study.yaml").write_text("\n".join(lines))


@attack("a study 100,000 deep", "study {scene}/study.yaml", says="not valid YAML")
def _(folder):
    (folder / "study.yaml").write_text("[" * 100_000)


@attack("a pipe for a study", "study {scene}/study.yaml")
def _(folder):
    os.mkfifo(folder / "study.yaml")


def walk(folder: Path) -> None:
    """A folder of three images."""
    posed(folder)
    (folder / "transforms.json").unlink()


def euroc(folder: Path) -> None:
    """A sequence of EuRoC of one frame."""
    from PIL import Image

    (folder / "mav0/cam0/data").mkdir(parents=True)
    (folder / "mav0/state_groundtruth_estimate0").mkdir()
    (folder / "mav0/cam0/data.csv").write_text("1000000000,a.png\n")
    Image.new("L", (32, 24)).save(folder / "mav0/cam0/data/a.png")
    (folder / "mav0/cam0/sensor.yaml").write_text("")
    (folder / "mav0/state_groundtruth_estimate0/data.csv").write_text("1000000000,0,0,0,1,0,0,0\n")


def clip(path: Path, codec: str = "mpeg4", pixels: str = "yuv420p", frames: int = 10) -> None:
    """A video of 64 x 48 pixels."""
    import av  # pyright: ignore[reportMissingImports]: an extra
    import numpy as np

    with av.open(str(path), "w") as container:
        stream: Any = container.add_stream(codec, rate=10)  # whose stubs know no variable for a codec
        stream.width, stream.height, stream.pix_fmt = 64, 48, pixels
        container.start_encoding()
        for i in range(frames):
            frame = av.VideoFrame.from_ndarray(np.full((48, 64, 3), i * 20, np.uint8), format="rgb24")
            container.mux(stream.encode(frame))
        container.mux(stream.encode())


def outcomes(names: list[str], folder: Path) -> list[Result]:
    """Makes the attacks below the folder and runs their commands."""
    results = []
    for number, name in enumerate(names):
        place = folder / f"{number:03d}"
        scene = place / "scene"
        scene.mkdir(parents=True)
        ATTACKS[name].make(scene)
        before = found(place)
        for command in ATTACKS[name].commands:
            words = [word.format(scene="scene", out="out") for word in shlex.split(command)]
            inside = name.startswith("settings")
            if inside:
                words = ["../scene" if word == "scene" else word for word in words]
            status, seconds, kilobytes = ran(words, scene if inside else place, place)
            said = [(place / stream).read_text(errors="replace") for stream in ("stdout", "stderr")]
            left = sorted(found(place) - before - {"stdout", "stderr"})
            pages = "".join((place / file).read_text() for file in left if file.endswith(".html"))
            results.append(Result(name, command, status, seconds, kilobytes // 1024, said[0], said[1], left, pages))
            before |= set(left)
        shutil.rmtree(place)
    return results


def found(folder: Path) -> set[str]:
    """Files and folders below a folder, links not followed; those that the cache of parsed sources has left out."""
    every = (Path(at, name) for at, folders, files in os.walk(folder) for name in (*folders, *files))
    return {name for path in every if "sources" not in (name := path.relative_to(folder).as_posix())}


def ran(words: list[str], folder: Path, place: Path) -> tuple[int, float, int]:
    """Exit status, seconds and kilobytes of a command, whose streams go to files in `place`."""
    began = time.monotonic()
    pid = os.fork()
    if not pid:
        with contextlib.suppress(BaseException):
            for number, name in ((1, "stdout"), (2, "stderr")):
                os.dup2(os.open(place / name, os.O_CREAT | os.O_WRONLY | os.O_TRUNC), number)
            os.chdir(folder)
            os.environ["XDG_CACHE_HOME"] = str(place / "cache")
            resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
            resource.setrlimit(resource.RLIMIT_CPU, (PATIENCE_S, PATIENCE_S))
            Path("/proc/self/clear_refs").write_text("5")  # the most memory so far is from now on
            from viewbench.workflow.commands import _main

            try:
                status = _main.run(words)
            except BaseException:
                import traceback

                traceback.print_exc()
                status = 99
            sys.stdout.flush()
            sys.stderr.flush()
            os._exit(status)
        os._exit(98)
    _, status, usage = os.wait4(pid, 0)
    return os.waitstatus_to_exitcode(status), time.monotonic() - began, usage.ru_maxrss


def in_a_process(names: list[str], folder: Path) -> dict[str, list[Result]]:
    """`outcomes` in a process of its own, by attack: this one may have threads, and much in memory."""
    command = [sys.executable, __file__, "--json", str(folder), *names]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    rows = [Result(**row) for row in json.loads(done.stdout)]
    return {name: [row for row in rows if row.attack == name] for name in names}


def main() -> None:
    """Prints the table, or the results as JSON."""
    import numpy as np  # noqa: F401
    import PIL.Image  # noqa: F401
    import pycolmap  # noqa: F401

    with contextlib.suppress(ImportError):
        import av  # noqa: F401  # pyright: ignore[reportMissingImports]: an extra
    if sys.argv[1:2] == ["--json"]:
        print(json.dumps([asdict(row) for row in outcomes(sys.argv[3:], Path(sys.argv[2]))]))
        return
    with tempfile.TemporaryDirectory(prefix="hostile-") as folder:
        for name in sys.argv[1:] or list(ATTACKS):
            for row in outcomes([name], Path(folder)):
                last = (row.err.strip().splitlines() or row.out.strip().splitlines() or [""])[-1]
                facts = [row.attack, row.command.split()[0], row.status, f"{row.seconds:.1f} s", f"{row.megabytes} MB"]
                print(*facts, last, sep=" | ")


if __name__ == "__main__":
    main()
