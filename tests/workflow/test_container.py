"""Whether the image's recipe copies what is there and installs what the project says."""

import json
import re
import shlex
import subprocess
import tomllib

import pytest

from viewbench.common.settings import PACKAGE

FILE = PACKAGE / "workflow" / "container" / "Containerfile"
INSTRUCTIONS = {"FROM", "ARG", "RUN", "COPY", "USER", "WORKDIR", "ENTRYPOINT", "CMD", "ENV"}


@pytest.fixture(scope="module")
def steps() -> list[tuple[str, str]]:
    """Instructions and what stands behind them, continued lines put together."""
    lines = [line for line in FILE.read_text().splitlines() if not line.startswith("#")]
    joined = re.sub(r"\\\n", " ", "\n".join(lines))
    return [(line.split(None, 1)[0], line.split(None, 1)[1]) for line in joined.splitlines() if line.strip()]


def of(steps: list[tuple[str, str]], name: str) -> list[str]:
    return [rest for instruction, rest in steps if instruction == name]


def test_every_line_is_an_instruction(steps):
    assert {name for name, _ in steps} <= INSTRUCTIONS
    assert steps[0][0] == "FROM"
    for text in of(steps, "ENTRYPOINT") + of(steps, "CMD"):
        assert all(isinstance(word, str) for word in json.loads(text))


def test_what_is_copied_is_tracked(steps):
    listed = subprocess.run(["git", "ls-files"], cwd=PACKAGE, capture_output=True, text=True)
    if listed.returncode:
        pytest.skip("not a clone")
    tracked = set(listed.stdout.splitlines())
    sources = [word for text in of(steps, "COPY") for word in text.split()[:-1]]
    assert len(sources) > 10
    for source in sources:
        assert source in tracked or any(path.startswith(f"{source}/") for path in tracked), source


def test_all_that_is_packaged_is_copied(steps):
    """A folder of code or a file that a wheel takes along is in the image too."""
    project = tomllib.loads((PACKAGE / "pyproject.toml").read_text())["tool"]["setuptools"]
    copied = {word for text in of(steps, "COPY") for word in text.split()[:-1]}
    folders = {name.split(".")[1] for name in project["packages"] if "." in name}
    files = {name.split("/")[0] for name in project["package-data"]["viewbench"]}
    wanted = (
        folders | files | {"pyproject.toml", "constraints.txt", "README.md", "LICENSE", "__init__.py", "__main__.py"}
    )
    assert {name if name != "profiles" else "workflow/profiles" for name in wanted} <= copied


def test_it_installs_the_pinned_packages_of_a_study(steps):
    extras = tomllib.loads((PACKAGE / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    (install,) = [text for text in of(steps, "RUN") if "pip install" in text]
    words = shlex.split(install)
    assert words[words.index("--constraint") + 1] == "/opt/viewbench/constraints.txt"
    assert "--no-cache-dir" in words
    assert {word for word in words if ">=" in word} == {word for word in extras["study"] if "viewbench[" not in word}
    (chosen,) = [text.partition("=")[2] for text in of(steps, "ARG") if text.startswith("EXTRAS=")]
    assert set(chosen.split(",")) <= set(extras)


def test_its_python_is_one_that_the_project_takes_and_it_does_not_run_as_root(steps):
    wanted = tomllib.loads((PACKAGE / "pyproject.toml").read_text())["project"]["requires-python"]
    (image,) = of(steps, "FROM")
    version = re.fullmatch(r"python:(\d+)\.(\d+)-slim", image)
    assert version is not None
    assert [int(part) for part in version.groups()] >= [int(part) for part in wanted.removeprefix(">=").split(".")]
    (user,) = of(steps, "USER")
    assert user != "0"
    assert any(f"useradd --create-home --uid {user} " in text for text in of(steps, "RUN"))
    names = [name for name, _ in steps]
    assert names.index("USER") > max(index for index, name in enumerate(names) if name in ("RUN", "COPY"))
