"""Nothing that is read can become code: no pickle, no evaluated text, no shell, and what listens does so at home."""

import ast
import re
from pathlib import Path

import pytest

from tests.conftest import CODE
from viewbench.common.settings import PACKAGE

MODULES = {"pickle", "cPickle", "marshal", "shelve", "dill", "cloudpickle", "joblib", "jsonpickle", "telnetlib"}
# An unpickler that knows four names and refuses all others, for the weights of one encoder; `pickle.loads` is not it.
ALLOWED = {("scenes/encoders/_weights.py", "pickle")}
CALLS = {"eval", "exec", "compile", "__import__", "os.system", "os.popen", "yaml.load", "yaml.unsafe_load"}
CALLS |= {"yaml.full_load", "yaml.load_all", "tempfile.mktemp", "pickle.load", "pickle.loads", "subprocess.getoutput"}
CALLS |= {"subprocess.getstatusoutput", "os.execl", "os.spawnl", "ssl._create_unverified_context"}
NEEDED = {
    "np.load": ("allow_pickle", False),
    "numpy.load": ("allow_pickle", False),
    "torch.load": ("weights_only", True),
}


def dangers(code: str, name: str = "") -> list[str]:
    """What of the code could run what it reads."""
    found = []
    for node in ast.walk(ast.parse(code)):
        if isinstance(node, ast.Import):
            imported = [alias.name.split(".")[0] for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and not node.level:
            imported = [(node.module or "").split(".")[0]]
        else:
            imported = []
        found += [one for one in imported if one in MODULES and (name, one) not in ALLOWED]
        if isinstance(node, ast.Call):
            called = ast.unparse(node.func)
            given = {word.arg: ast.unparse(word.value) for word in node.keywords}
            found += [called] if called in CALLS else []
            found += ["a shell"] if given.get("shell", "False") != "False" else []
            if called in NEEDED:
                key, value = NEEDED[called]
                found += [] if given.get(key) == str(value) else [called]
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and "0.0.0.0" in node.value:
            found.append("an address for all the world")
    return found


def files() -> list[Path]:
    return [PACKAGE / "__main__.py", *(path for folder in CODE for path in sorted((PACKAGE / folder).rglob("*.py")))]


def test_no_code_from_data():
    assert len(files()) > 200
    names = {path: path.relative_to(PACKAGE).as_posix() for path in files()}
    found = {name: dangers(path.read_text(encoding="utf-8"), name) for path, name in names.items()}
    assert {name: what for name, what in found.items() if what} == {}


@pytest.mark.parametrize(
    "code",
    [
        "import pickle",
        "from marshal import loads",
        "import numpy as np\nnp.load('a')",
        "np.load('a', allow_pickle=True)",
        "torch.load('a', weights_only=False)",
        "yaml.load('a')",
        "eval('a')",
        "subprocess.run('a', shell=True)",
        "subprocess.run('a', shell=value)",
        "os.system('a')",
        "server.bind(('0.0.0.0', 80))",
    ],
)
def test_the_walk_finds_them(code):
    assert dangers(code)


PLACE = re.compile(r"\{([^{}]+)\}")
# Numbers and names whose letters the study's schema, or the rule itself, restricts; options joined by shlex.
BARE = {"wildcards.part", "wildcards.seed", "wildcards.ratio", "params.options", "params.width", "params.command"}
BARE |= {"params.part"}


def test_what_rules_hand_to_the_shell_is_quoted():
    rules = sorted((PACKAGE / "workflow").rglob("*.smk"))
    assert rules
    places = []
    for file in rules:
        lines = file.read_text(encoding="utf-8").split("\n")
        for number, line in enumerate(lines):
            if line.strip() == "shell:":
                for part in lines[number + 1 :]:
                    if not part.strip().startswith('"'):
                        break
                    places += PLACE.findall(part)
    assert len(places) > 30
    assert [place for place in places if not place.endswith(":q") and place not in BARE] == []
