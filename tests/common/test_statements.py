from viewbench.common import statements

TEXT = """
import json
from . import a, b
from ..c import d  # no source: why

def f():
    from ..e.f import (
        g,
    )
"""
FOUND = {(0, "", ("json",)), (1, "", ("a", "b")), (2, "e.f", ("g",))}


def fresh(monkeypatch, tmp_path):
    """As in a process that has just begun."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    statements._remembered.cache_clear()
    statements._used.clear()
    statements._fresh.clear()


def test_imports_at_the_top_and_inside_but_those_that_are_marked():
    assert set(statements.import_statements(TEXT)) == FOUND


def test_what_was_parsed_is_not_parsed_again_and_what_changed_is(monkeypatch, tmp_path):
    fresh(monkeypatch, tmp_path)
    file = tmp_path / "module.py"
    file.write_text(TEXT)
    assert set(statements.of_file(file)) == FOUND
    statements.keep()
    fresh(monkeypatch, tmp_path)
    parsed = []
    monkeypatch.setattr(statements, "import_statements", lambda text: parsed.append(text) or [(1, "", ("new",))])
    assert set(statements.of_file(file)) == FOUND
    assert parsed == []
    file.write_text(TEXT + "\nfrom . import new\n")
    assert statements.of_file(file) == [(1, "", ("new",))]
    assert len(parsed) == 1
    fresh(monkeypatch, tmp_path)


def test_a_cache_that_is_broken_is_made_anew(monkeypatch, tmp_path):
    fresh(monkeypatch, tmp_path)
    statements._file().parent.mkdir(parents=True)
    statements._file().write_text("{")
    file = tmp_path / "module.py"
    file.write_text(TEXT)
    assert set(statements.of_file(file)) == FOUND
    statements.keep()
    assert len(statements._file().read_text()) > 10
    fresh(monkeypatch, tmp_path)


def test_no_more_than_so_many_files_are_kept(monkeypatch, tmp_path):
    fresh(monkeypatch, tmp_path)
    monkeypatch.setattr(statements, "KEPT", 2)
    for number in range(3):
        file = tmp_path / "module.py"
        file.write_text(f"import a{number}\n")
        statements.of_file(file)
        if number < 2:
            statements.keep()
            fresh(monkeypatch, tmp_path)
    statements.keep()
    fresh(monkeypatch, tmp_path)
    assert len(statements._remembered()) == 1
    fresh(monkeypatch, tmp_path)
