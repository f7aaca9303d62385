"""The README's "Add one", followed to the letter in a copy: one new file each, found by its name."""

import json

import pytest

from tests.backends.conftest import nearest_command
from tests.conftest import ROOM
from tests.workflow.clones import Clone

STUDY = """
scenes: [mine]
selectors: [every-third, uniform]
ratios: [0.25]
seeds: 2
backends: [{backend: grey}, command:mine]
budget: {iterations: 1}
encoder: brightness
reference: false
reports: [cell_count]
"""
SELECTOR = """
\"\"\"Every third view.\"\"\"
import numpy as np
from ._types import Choice
SEEDED = False
FACTORS = ("sem",)
PARAMETERS = {"factors": ["sem"]}
def select(views, count, rng, factors=("sem",)):
    assert views.features.shape == (len(views), 2)
    return Choice(np.arange(0, len(views), 3)[:count])
"""
BACKEND = """
\"\"\"The mean colour of the chosen views, everywhere.\"\"\"
import numpy as np
from ._types import Capabilities, Trained
CAPABILITIES = Capabilities(seconds=False)
def available():
    return None
def version():
    return "1"
def train(data, out, seed, budget, options, report):
    np.save(out / "grey.npy", np.asarray(data.images).mean(axis=(0, 1, 2)))
    return Trained(iterations=1, seconds=0.1)
def render(model, cameras):
    colour = np.load(model / "grey.npy")
    for camera in cameras:
        yield np.broadcast_to(colour, (camera.height[0], camera.width[0], 3)).astype(np.float32)
"""
FORMAT = """
\"\"\"Frames whose poses stand in one line each of frames.csv.\"\"\"
import numpy as np
from ._frames import split
from ._intrinsics import Intrinsics
from ..types import Scene
def detect(root):
    return "it has frames.csv" if (root / "frames.csv").is_file() else None
def read(root):
    rows = [line.split(",") for line in (root / "frames.csv").read_text().splitlines()]
    paths = [root / row[0] for row in rows]
    poses = np.array([[float(number) for number in row[1:]] for row in rows]).reshape(-1, 4, 4)
    train = split(root, paths, poses, Intrinsics(200.0, 200.0, 128.0, 128.0, "of the room"))
    return Scene(root.name, root, "frames-csv", train, train.subset([]), files=(root / "frames.csv",))
"""
ENCODER = """
\"\"\"Brightness and its spread.\"\"\"
import numpy as np
def available():
    return None
def version(argument):
    return "1"
def encoder(argument, device):
    return 16, lambda images: np.stack([images.mean(axis=(1, 2, 3)), images.std(axis=(1, 2, 3)) + 1], axis=1)
"""
REPORT = """
\"\"\"How many cells there are.\"\"\"
from ._items import Item
def build(study, out):
    return [Item("Cells", "text", f"There are {len(study.done)} cells.")]
"""
COMMAND = """
\"\"\"Count the training views.\"\"\"
import click
from . import _options
@click.command()
@_options.scene_options
def command(scene):
    \"\"\"Print how many training views SCENE has.\"\"\"
    from ...common import settings
    click.echo(len(scene.open(settings.load()).train))
"""


@pytest.fixture(scope="module")
def extended(tmp_path_factory):
    parent = tmp_path_factory.mktemp("recipes")
    clone = Clone(parent, STUDY)
    table = json.loads((ROOM / "transforms_train.json").read_text(encoding="utf-8"))
    folder = parent / "capture"
    folder.mkdir()
    lines = []
    for number, frame in enumerate(table["frames"][::25]):
        (folder / f"{number:02d}.jpg").write_bytes((ROOM / frame["file_path"]).read_bytes())
        pose = [entry for row in frame["transform_matrix"] for entry in row]
        lines.append(",".join([f"{number:02d}.jpg", *map(str, pose)]))
    (folder / "frames.csv").write_text("\n".join(lines), encoding="utf-8")
    for name, text in {
        "selectors/every_third.py": SELECTOR,
        "backends/grey.py": BACKEND,
        "scenes/formats/frames_csv.py": FORMAT,
        "scenes/encoders/brightness.py": ENCODER,
        "reports/cell_count.py": REPORT,
        "workflow/commands/count.py": COMMAND,
    }.items():
        (clone.folder / name).write_text(text, encoding="utf-8")
    program = nearest_command()
    settings = f"[scenes.mine]\npath = {str(folder)!r}\nholdout = 'every:4'\n"
    settings += f"[command.mine]\ntrain = {json.dumps(program.train)}\nrender = {json.dumps(program.render)}\n"
    (clone.folder / "environment.toml").write_text(settings, encoding="utf-8")
    return clone


@pytest.mark.parametrize(
    ("kind", "name"),
    [
        ("selectors", "every-third"),
        ("backends", "grey"),
        ("formats", "frames-csv"),
        ("encoders", "brightness"),
        ("backends", "command:mine"),
    ],
)
def test_it_is_listed(extended, kind, name):
    done = extended.call("viewbench", "list", kind)
    assert name in done.stdout.split(), done.stderr


def test_a_format_that_is_read_only_is_written_as_transforms(extended, tmp_path):
    capture = str(extended.folder.parent / "capture")
    options = ["--count", "3", "--selector", "uniform", "--out", str(tmp_path / "out")]
    done = extended.call("viewbench", "select", capture, *options)
    assert done.returncode == 0, done.stderr
    assert "format frames-csv is only read; the subset is written as transforms" in done.stderr
    assert (tmp_path / "out" / "transforms.json").is_file()


def test_a_command_is_called_by_the_name_of_its_file(extended):
    done = extended.call("viewbench", "count", "mine")
    assert (done.stdout, done.returncode) == ("12\n", 0), done.stderr
    assert "Count the training views." in extended.call("viewbench", "--help").stdout


def test_a_study_uses_them_all(extended):
    extended.run()
    page = (extended.results / "reports" / "index.html").read_text(encoding="utf-8")
    assert "There are 8 cells." in page
    record = json.loads(next(extended.results.rglob("every-third/**/selection.json")).read_text())
    assert record["indices"] == [0, 3, 6]
    assert record["features_sha256"]
    assert extended.planned() == {}
