import pytest

from viewbench.common import settings
from viewbench.common.errors import UserError


def load(tmp_path, text):
    path = tmp_path / "environment.toml"
    path.write_text(text, encoding="utf-8")
    return settings.load(path)


def test_the_shipped_file_documents_the_defaults(monkeypatch):
    for name in ("VIEWBENCH_DATA", "VIEWBENCH_ENVIRONMENT"):
        monkeypatch.delenv(name, raising=False)
    shipped = settings.load(settings.PACKAGE / settings.FILE)
    for name, kind in settings.SECTIONS.items():
        assert getattr(shipped, name) == kind(), f"[{name}] in environment.toml differs from the defaults in the code"
        text = (settings.PACKAGE / settings.FILE).read_text(encoding="utf-8")
        for key in vars(kind()):
            assert f"\n{key} = " in text, f"{name}.{key} is not documented in environment.toml"


def test_no_keys_is_enough(tmp_path):
    assert load(tmp_path, "").features.encoder == "efficientnet-lite0"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[tracing]\nuri = ''", "did you mean 'tracking'"),
        ("[tracking]\nurl = ''", "did you mean 'uri'"),
        ("[scenes.a]\npth = 'x'", "did you mean 'path'"),
        ("[scenes.a]\ndataset = 'x'", "'path' is missing"),
        ("[features]\nbatch = '16'", "expected a whole number"),
        ("[features]\nbatch = 0", "expected a positive number"),
        ("[tracking]\nrenders = -1", "expected 0 or more"),
        ("[tracking]\nmodels = 1.5", "expected a whole number"),
        ("[features]\nbatch = true", "expected a whole number"),
        ("[command.x]\ntrain = 'a b'", "expected a list"),
        ("[command.x]\ntrain = [1]", "list of strings"),
        ("[command.x]\ntrain = ['a']\nneeds_points = 1", "expected true or false"),
        ("[command.x]\ntrain = ['a']\nbackground = ['red']", "list of numbers"),
        ("data = 'x'", "is a section"),
        ("[data", "not valid TOML"),
    ],
)
def test_a_mistake_is_named(tmp_path, text, words):
    with pytest.raises(UserError, match=words):
        load(tmp_path, text)


def test_environment_variables_come_last(tmp_path, monkeypatch):
    monkeypatch.setenv("VIEWBENCH_TRACKING_URI", "http://127.0.0.1:1")
    monkeypatch.setenv("VIEWBENCH_FEATURES_BATCH", "4")
    monkeypatch.setenv("VIEWBENCH_DATA", "/captures")
    read = load(tmp_path, "[tracking]\nuri = 'sqlite:///a.db'\n[data]\nroot = '/other'")
    assert (read.tracking.uri, read.features.batch, read.data.root) == ("http://127.0.0.1:1", 4, "/captures")
    monkeypatch.setenv("VIEWBENCH_FEATURES_BATCH", "many")
    with pytest.raises(UserError, match="VIEWBENCH_FEATURES_BATCH"):
        load(tmp_path, "")


def test_no_limit_and_no_renders_are_zero(tmp_path):
    command = '[command.x]\ntrain = ["true", "{out}"]\noutput = "a.ply"\ntimeout = 0\n'
    found = load(tmp_path, f"[tracking]\nrenders = 0\n{command}")
    assert (found.tracking.renders, found.command["x"].timeout) == (0, 0)
