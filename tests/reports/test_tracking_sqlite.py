import contextlib
import os
import shutil
import sqlite3
import stat
import subprocess
import sys
import tempfile
import threading
from pathlib import Path

import pytest

from tests.reports.test_tracking import ROWS, runs_of, track, write_cell
from viewbench.common.errors import UserError
from viewbench.common.settings import Tracking
from viewbench.reports import _tracking_sqlite


@pytest.fixture(scope="module")
def logged(tmp_path_factory):
    """Results of four cells and a database with runs of three."""
    folder = tmp_path_factory.mktemp("logged")
    for row in ROWS:
        write_cell(folder / "results" / "demo", row)
    track(folder / "results" / "demo", tracking_in(folder), ROWS[:3])
    return folder


@pytest.fixture
def store(logged, tmp_path):
    shutil.copy(logged / "mlflow.db", tmp_path)
    return logged / "results" / "demo", tmp_path / "mlflow.db", tracking_in(tmp_path)


def tracking_in(folder, patience=1):
    return Tracking(f"sqlite:///{folder}/mlflow.db", str(folder / "artifacts"), renders=2, patience=patience)


def refused(store, match):
    """The sentence with which logging ends."""
    results, _, tracking = store
    with pytest.raises(UserError, match=match) as error:
        track(results, tracking)
    assert len(str(error.value)) < 500
    return str(error.value)


def test_a_database_that_another_writes_to_is_waited_for(store):
    results, path, tracking = store
    with contextlib.closing(sqlite3.connect(path, check_same_thread=False)) as other:
        other.execute("BEGIN EXCLUSIVE")
        assert "tracking.patience" in refused(store, "is locked: another process has been writing to it for 1 s")
        timer = threading.Timer(2, other.rollback)
        timer.start()
        patient = tracking_in(path.parent, patience=120)
        assert track(results, patient) == {"logged": 1, "kept": 3}
        timer.join()
    assert len(runs_of(tracking)[1]) == 4


def test_a_database_of_another_mlflow_is_named(store):
    from alembic.script import ScriptDirectory
    from mlflow.store.db.utils import _get_alembic_config

    scripts = ScriptDirectory.from_config(_get_alembic_config(db_url=""))
    older = [script.revision for script in scripts.walk_revisions()][1]
    for version, said in ((older, r"older MLflow .* mlflow db upgrade sqlite:///"), ("0123456789ab", "newer MLflow")):
        with contextlib.closing(sqlite3.connect(store[1])) as database, database:
            database.execute("UPDATE alembic_version SET version_num = ?", (version,))
        refused(store, said)


def test_a_damaged_database_is_named_and_a_new_one_takes_everything(store):
    results, path, tracking = store
    whole = path.read_bytes()
    for content in (b"no database" * 1000, whole[: len(whole) // 2], whole[:4096] + b"\xff" * (len(whole) - 4096)):
        path.write_bytes(content)
        assert "move " in refused(store, "damaged|malformed")
    path.unlink()
    assert track(results, tracking) == {"logged": 4, "kept": 0}


def test_a_file_that_cannot_be_written_to_is_named(store):
    with tempfile.TemporaryDirectory() as folder:
        Path(folder).chmod(0o755)
        path = Path(shutil.copy(store[1], folder))
        path.chmod(stat.S_IRUSR | stat.S_IRGRP | stat.S_IROTH)
        me = os.geteuid()
        if not me:
            os.seteuid(65534)  # root may write to everything; nobody may not
        try:
            with pytest.raises(UserError, match="cannot be written to"):
                _tracking_sqlite.check(path, 1)
        finally:
            os.seteuid(me)
    _tracking_sqlite.check(store[1], 1)


def test_a_folder_and_an_address_that_is_none_are_named(store):
    results, path, _ = store
    with pytest.raises(UserError, match="is a folder"):
        track(results, Tracking(uri=f"sqlite:///{path.parent}"))
    with pytest.raises(UserError, match=r"127\.0\.0\.1:5000"):
        track(results, Tracking(uri="127.0.0.1:5000://", patience=0))


def test_two_that_make_a_database_at_once(tmp_path):
    """As two studies do that end together in a new folder: MLflow's own making of a database fails then."""
    code = (
        "import sys; from pathlib import Path; from viewbench.common.settings import Tracking\n"
        "from viewbench.reports import _about, _tracking\n"
        "folder = Path(sys.argv[1])\n"
        "tracking = Tracking(f'sqlite:///{folder}/mlflow.db', str(folder / 'a'), patience=100)\n"
        "told = _about.About(sys.argv[2], '', '', '', (), ())\n"
        "_tracking.track(told, [], folder / sys.argv[2], tracking)"
    )
    jobs = [
        subprocess.Popen([sys.executable, "-c", code, str(tmp_path), name], stderr=subprocess.PIPE, text=True)
        for name in ("one", "two")
    ]
    said = [job.communicate(timeout=240)[1] for job in jobs]
    assert [job.returncode for job in jobs] == [0, 0], said
    with contextlib.closing(sqlite3.connect(tmp_path / "mlflow.db")) as database:
        names = {name for (name,) in database.execute("SELECT name FROM experiments")}
    assert {"one", "two"} <= names
