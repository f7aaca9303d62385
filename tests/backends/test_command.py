"""The `command` backend with a real program of its own, and with everything that can be wrong about one."""

import re
import sys
import tomllib
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.backends.conftest import nearest_command, settings_with
from viewbench.backends import _registry
from viewbench.backends._types import Budget, Report, Seeding
from viewbench.common import settings as settings_file
from viewbench.common.errors import UserError
from viewbench.common.settings import PACKAGE, Command

OPTIONS = {"points": "scene"}
TEN = Budget(iterations=10)


def load(**changes: object):
    return _registry.load("command:tool", settings_with(tool=nearest_command(**changes)))


def train(backend, views, out: Path, budget: Budget = TEN, options: dict = OPTIONS):
    out.mkdir()
    return backend.train(views, out, 5, budget, options, Report())


def python(code: str) -> list[str]:
    """A program that does `code`; braces in it are doubled, as in any template."""
    return [sys.executable, "-c", code]


def test_the_nearest_view_is_rendered_at_the_camera_s_size(take_views, tmp_path):
    views, backend = take_views(), load()
    trained = train(backend, views, tmp_path / "model")
    assert trained.iterations == 10
    assert not (tmp_path / "model" / "scene").exists(), "the subset is not kept beside the model"
    assert "kept 3 views" in (tmp_path / "model" / "command.log").read_text()
    for image, view in zip(backend.render(tmp_path / "model", views.cameras), views.images, strict=True):
        assert np.abs(image - view).max() <= 0.5 / 255 + 1e-6
    (small,) = backend.render(tmp_path / "model", views.cameras[:1].scaled(20))
    assert (small.shape, small.dtype) == ((20, 20, 3), np.float32)


def test_the_program_sees_the_chosen_views_and_no_name_of_theirs(take_views, tmp_path):
    views = take_views()
    nasty = type(views)(**{**vars(views), "scene": "$(reboot)", "names": ("; rm -rf ~", "`x`", "-flag")})
    code = (
        "import sys, pathlib; print(*sys.argv[1:]); open('model', 'w')\n"
        "print(*sorted(path.name for path in pathlib.Path(sys.argv[1]).rglob('*')))"
    )
    trained = train(load(train=[*python(code), "{scene}", "{seed}", "--w={width}", "{views}"]), nasty, tmp_path / "m")
    printed = (tmp_path / "m" / "command.log").read_text()
    assert printed.splitlines()[0].endswith("scene 5 --w=48 3")
    assert printed.splitlines()[1] == "00000.png 00001.png 00002.png images points3d.ply transforms.json"
    assert trained.seeding == Seeding(points="scene", source="scene", count=200, of=200, scene_points=200)


@pytest.mark.parametrize(("source", "count"), [("none", 0), ("random", 100_000), ("rays", 100_000), ("auto", 286)])
def test_the_points_of_all_views_can_be_kept_from_the_program(take_views, tmp_path, source, count):
    code = "import pathlib, sys; print(pathlib.Path(sys.argv[1], 'points3d.ply').exists()); open('model', 'w')"
    trained = train(load(train=[*python(code), "{scene}"]), take_views(), tmp_path / "m", options={"points": source})
    assert trained.seeding.count == count
    assert (tmp_path / "m" / "command.log").read_text().strip() == str(count > 0)


def test_programs_that_open_a_port_get_one_each(take_views, tmp_path):
    """Both listen at once, as two jobs of a study do."""
    code = (
        "import pathlib, socket, sys, time; s = socket.socket(); s.bind(('127.0.0.1', int(sys.argv[1]))); s.listen()\n"
        "place = pathlib.Path(sys.argv[2]); (place / sys.argv[1]).touch()\n"
        "while len(list(place.iterdir())) < 2: time.sleep(0.01)\n"
        "open('model', 'w')"
    )
    (tmp_path / "ports").mkdir()
    backend = load(train=[*python(code), "{port}", str(tmp_path / "ports")], timeout=60)
    with ThreadPoolExecutor(2) as pool:
        list(pool.map(lambda name: train(backend, take_views(), tmp_path / name), "ab"))


def test_a_program_that_needs_points_is_not_started_without(take_views, tmp_path):
    backend = load(needs_points=True)
    with pytest.raises(UserError, match="points=none leaves it none; set points=random"):
        train(backend, take_views(), tmp_path / "a", options={"points": "none"})
    without = replace(take_views(), points=None)
    with pytest.raises(UserError, match="scene 'room' has none; set points=random"):
        train(backend, replace(without, scene="room"), tmp_path / "b")
    assert train(backend, without, tmp_path / "c", options={"points": "random"}).seeding.count == 100_000
    assert train(load(), without, tmp_path / "d").seeding == Seeding()


def test_a_model_is_drawn_on_the_background_it_was_trained_on(take_views, tmp_path):
    pink = [0.6130, 0.0101, 0.3984]
    code = (
        "import numpy as np; from viewbench.backends import _gaussian_ply as g\n"
        "one = lambda *shape: np.ones((1, *shape), np.float32)\n"
        "far = g.Gaussians(1e6 * one(3), one(3), one(4), one(), one(3), one(0, 3))\n"
        "g.save(__import__('pathlib').Path('splat.ply'), far)"
    )
    views = take_views()
    backend = load(train=python(code), render=[], output="splat.ply", background=pink)
    train(backend, views, tmp_path / "m")
    (image,) = backend.render(tmp_path / "m", views.cameras[:1])
    assert np.allclose(image, pink, atol=1e-6)
    assert backend.configuration()["render"] != load(render=[], output="splat.ply").configuration()["render"]


def test_limits_are_obeyed_where_the_command_line_names_them():
    assert (load().CAPABILITIES.iterations, load().CAPABILITIES.seconds) == (True, False)
    timed = load(train=["true", "{seconds}"], device="cuda").CAPABILITIES
    assert (timed.iterations, timed.seconds, timed.device) == (False, True, "cuda")


def test_a_budget_that_the_command_line_needs_is_asked_for(take_views, tmp_path):
    with pytest.raises(UserError, match="command:tool takes iterations"):
        train(load(), take_views(), tmp_path / "m", Budget(seconds=5))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"train": ["x", "{sead}"]}, r"'train': unknown placeholder \{sead\}; did you mean 'seed'\?"),
        ({"train": ["x", "{scene!r}"]}, "unknown placeholder"),
        ({"train": ["x", "{scene.name}"]}, "unknown placeholder"),
        ({"train": ["x", '{"a": 1}']}, "unknown placeholder"),
        ({"train": ["x", "{"]}, "write a brace that is meant"),
        ({"train": []}, "'train' is an empty list"),
        ({"render": []}, "without 'render', 'output' is the PLY file"),
        ({"render": [], "output": "{name}.ply"}, "without 'render', 'output' is the PLY file"),
        ({"train": ["x"], "output": "{iterations}/{name}.png"}, "rendering takes {iterations}"),
        ({"output": "{out}/render.png"}, "'output' names one file"),
        ({"render": ["x", "{scene}"]}, r"'render': unknown placeholder \{scene\}"),
        ({"output": "render.png"}, "'output' names one file for all renders"),
        ({"format": "colmop"}, "did you mean 'colmap'"),
        ({"device": "gpu"}, "expected 'cpu' or 'cuda'"),
        ({"background": [0.1, 0.2]}, "expected red, green and blue"),
        ({"background": [0.0, 0.0, 255.0]}, "expected red, green and blue"),
        ({"train": ["python", "/opt/3dgs/train.py", "--eval"]}, "holds out every 8th of the chosen views"),
    ],
)
def test_a_section_that_cannot_work_is_refused_before_anything_runs(changes, message):
    with pytest.raises(UserError, match=message):
        load(**changes)


def test_a_name_that_is_not_configured_is_answered_with_the_nearest():
    with pytest.raises(UserError, match=r"no \[command\.nearset\]; did you mean 'nearest'"):
        _registry.load("command:nearset", settings_with(nearest=nearest_command()))
    assert "add a section [command.NAME]" in _registry.load("command", settings_with()).available()


def test_an_absent_program_is_unavailable_and_says_which():
    reason = load(render=["no-such-renderer"]).available()
    assert reason == "'no-such-renderer', which its `render` command starts, is not installed or not on PATH"
    assert load().available() is None


def test_a_program_may_stand_behind_env_and_its_variables():
    assert load(train=["env", "A=1", "B=2", sys.executable, "A=3"]).available() is None
    assert "'no-such-trainer'" in load(train=["/usr/bin/env", "A=1", "no-such-trainer"]).available()
    assert load(train=["env", "A=1"]).available() is None, "env alone is a program too"


def test_version_is_what_the_program_says_or_a_hash_of_its_files(tmp_path):
    assert load(version=python("print('tool 1.2')")).version() == "tool 1.2"
    script = tmp_path / "tool.py"
    versions = set()
    for text in ("pass", "pass # edited", "pass"):
        script.write_text(text)
        versions.add(load(train=[sys.executable, str(script)]).version())
    assert len(versions) == 2


def test_failures_of_the_program_are_one_sentence(take_views, tmp_path):
    views = take_views()
    with pytest.raises(UserError, match="command:tool failed with exit status 1: ValueError: out of memory"):
        train(load(train=python("raise ValueError('out of memory')")), views, tmp_path / "a")
    with pytest.raises(UserError, match="left nothing in its folder"):
        train(load(train=python("pass")), views, tmp_path / "b")
    with pytest.raises(UserError, match="stopped after 1 s"):
        train(load(train=python("import time; time.sleep(60)"), timeout=1), views, tmp_path / "c")
    with pytest.raises(UserError, match="option 'points' is 'scenes'; did you mean 'scene'"):
        train(load(), views, tmp_path / "d", options={"points": "scenes"})


def test_renders_are_looked_for_where_output_says(take_views, tmp_path):
    views = take_views()
    train(load(), views, tmp_path / "m")
    with pytest.raises(UserError, match=r"wrote 0 of 3 renders, '00000_rgb\.png' is not there"):
        list(load(output="sub/{name}_rgb.png").render(tmp_path / "m", views.cameras))
    assert len(list(load(output="{index:05d}.png").render(tmp_path / "m", views.cameras))) == 3


def test_a_camera_alone_is_rendered_by_a_program_that_names_renders_below_their_common_folder(take_views, tmp_path):
    """As nerfstudio does: `ns-render dataset` writes one picture to test/rgb.png and two to test/rgb/NAME.png."""
    code = (
        "import os, pathlib, shutil, sys; files = sorted(pathlib.Path(sys.argv[1], 'images').iterdir())\n"
        "root = os.path.commonpath(files)\n"
        "for file in files:\n"
        "    place = (pathlib.Path(sys.argv[2], 'rgb') / file.relative_to(root)).with_suffix('.png')\n"
        "    place.parent.mkdir(parents=True, exist_ok=True); shutil.copy(file, place)"
    )
    views = take_views()
    backend = load(render=[*python(code), "{cameras}", "{renders}"], output="rgb/{name}.png")
    train(backend, views, tmp_path / "m")
    for count in (1, 2):
        assert len(list(backend.render(tmp_path / "m", views.cameras[:count]))) == count


def test_renders_in_the_model_folder_are_this_run_s(take_views, tmp_path):
    """The 3DGS authors' render.py writes beside its model, under the number of iterations."""
    views = take_views()
    code = (
        "import pathlib, shutil, sys; place = pathlib.Path('test', 'ours_' + sys.argv[2]); place.mkdir(parents=True)\n"
        "for file in sorted(pathlib.Path(sys.argv[1], 'images').iterdir()): shutil.copy(file, place)"
    )
    shape = {
        "render": [*python(code), "{cameras}", "{iterations}"],
        "output": "{out}/test/ours_{iterations}/{name}.png",
    }
    train(load(**shape), views, tmp_path / "m", Budget(iterations=2))
    assert len(list(load(**shape).render(tmp_path / "m", views.cameras[:2]))) == 2
    shape["render"] = [sys.executable, "-c", "pass"]
    with pytest.raises(UserError, match="wrote 0 of 2 renders"):
        list(load(**shape).render(tmp_path / "m", views.cameras[:2]))


@pytest.mark.parametrize("degree", [0, 1, 3])
def test_a_ply_of_gaussians_needs_no_renderer(take_views, tmp_path, degree):
    views, script = take_views(), tmp_path / "splat.py"
    script.write_text(
        "import sys; import numpy as np; from viewbench.backends import _gaussian_ply as g\n"
        "one = lambda *shape: np.ones((5, *shape), np.float32)\n"
        f"shn = np.zeros((5, {(degree + 1) ** 2 - 1}, 3), np.float32)\n"
        "place = one(3) * np.array(sys.argv[2:], np.float32)\n"
        "g.save(sys.argv[1], g.Gaussians(place, 0 * one(3), one(4), 9 * one(), one(3), shn))\n"
    )
    before = (views.cameras.positions[0] + 3 * views.cameras.forward[0]).astype(str).tolist()
    backend = load(train=[sys.executable, str(script), "splat.ply", *before], render=[], output="splat.ply")
    assert backend.available() is None
    train(backend, views, tmp_path / "m")
    image = next(iter(backend.render(tmp_path / "m", views.cameras[:1])))
    assert (image.shape, image.dtype) == ((48, 48, 3), np.float32)
    assert image.max() == pytest.approx(0.5 + 0.2820948, abs=0.02), "the constant band of one, on black"


def example_text() -> str:
    """The sections [command.NAME] that environment.toml has as comments."""
    lines = (PACKAGE / "environment.toml").read_text(encoding="utf-8").splitlines()
    start = next(number for number, line in enumerate(lines) if line.startswith("# [command."))
    text = [line.removeprefix("# ") for line in lines[start:]]
    written = [line for line in text if re.match(r"""\[command\.|\w+ = |\s*"|#?$""", line)]
    return "\n".join(written)


def examples() -> dict:
    """These sections by their names."""
    return tomllib.loads(example_text())["command"]


def test_the_examples_that_ship_are_well_formed():
    commands = {name: Command(**section) for name, section in examples().items()}
    settings = settings_with(**commands)
    assert set(settings.command) == {"3dgs", "splatfacto", "nerfacto", "opensplat"}
    for name in settings.command:
        backend = _registry.load(f"command:{name}", settings)
        device = "cpu" if name == "nerfacto" else "cuda"
        assert (backend.CAPABILITIES.device, backend.CAPABILITIES.iterations) == (device, True)


def test_the_section_is_read_from_environment_toml(tmp_path):
    file = tmp_path / "environment.toml"
    file.write_text(
        '[command.mine]\ntrain = ["a", "{scene}"]\nrender = ["b", "{cameras}"]\nformat = "colmap"\n'
        'version = ["a", "--version"]\ndevice = "cuda"\ntimeout = 60\n'
    )
    settings = settings_file.load(file)
    assert "command:mine" in _registry.names(settings)
    assert _registry.load("command:mine", settings).CAPABILITIES.device == "cuda"
