"""Whether MLflow can write to a file of SQLite, found out before MLflow tries to, which may take it minutes."""

import contextlib
import os
import sqlite3
import time
from collections.abc import Iterator
from pathlib import Path

from ..common import holding
from ..common.errors import UserError

PREFIX = "sqlite:///"
POLL_S = 0.2


def path_of(uri: str) -> Path | None:
    """The absolute path of a file of SQLite; None for another store."""
    return Path(uri.removeprefix(PREFIX)).absolute() if uri.startswith(PREFIX) else None


def check(path: Path, wait_s: float) -> None:
    """Raises UserError, one sentence that says what to do, for a file that MLflow could not write to.

    Waits up to `wait_s` seconds for another that writes. A file that is not there is right: MLflow makes it.
    """
    if path.is_dir():
        raise UserError(f"{path} is a folder; name a file in tracking.uri")
    if not path.exists() or not path.stat().st_size:
        return
    try:
        with contextlib.closing(sqlite3.connect(f"{path.as_uri()}?mode=rw", uri=True, timeout=wait_s)) as database:
            database.execute("BEGIN IMMEDIATE")
            database.execute(
                "PRAGMA user_version = 1"
            )  # where the file may only be read this fails, the line before not
            tables = {name for (name,) in database.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
            made_by = database.execute("SELECT version_num FROM alembic_version").fetchall() if _made(tables) else []
            database.rollback()
    except sqlite3.Error as error:
        raise UserError(f"{path} {_words(str(error), wait_s)}") from None
    if made_by:
        _check_version(path, str(made_by[0][0]))


@contextlib.contextmanager
def alone_at_first(path: Path, wait_s: float) -> Iterator[None]:
    """While the body has MLflow make a database that is not there, no other process of ours does.

    MLflow's own making of one fails where two are at it. Waits up to `wait_s` seconds for another.
    """
    if path.exists() and path.stat().st_size and _is_made(path):
        yield
        return
    # flock, which SQLite's own locks (fcntl) know nothing of, on the file itself: empty, it is new to MLflow.
    handle = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
    try:
        until = time.monotonic() + wait_s
        while holding.lock(handle) is False and time.monotonic() < until:
            time.sleep(POLL_S)
        yield
    finally:
        os.close(handle)


def _is_made(path: Path) -> bool:
    with contextlib.suppress(sqlite3.Error), contextlib.closing(sqlite3.connect(path)) as database:
        return _made({name for (name,) in database.execute("SELECT name FROM sqlite_master WHERE type = 'table'")})
    return False


def _made(tables: set[str]) -> bool:
    return {"alembic_version", "runs"} <= tables


def _words(text: str, wait_s: float) -> str:
    if "locked" in text:
        return (
            f"is locked: another process has been writing to it for {wait_s:g} s; end it (`fuser FILE` names it) or "
            "raise tracking.patience"
        )
    if "readonly" in text or "unable to open" in text:
        return "cannot be written to; give yourself the right to, or name another file in tracking.uri"
    return (
        f"is damaged, or no SQLite file ({text}); move it away, and all cells are logged into a new one (the results "
        "do not depend on it)"
    )


def _check_version(path: Path, found: str) -> None:
    """Raises UserError for a schema that is not this MLflow's."""
    import mlflow
    from alembic.script import ScriptDirectory
    from mlflow.store.db.utils import _get_alembic_config

    scripts = ScriptDirectory.from_config(_get_alembic_config(db_url=""))
    if found in scripts.get_heads():
        return
    if found in {script.revision for script in scripts.walk_revisions()}:
        raise UserError(
            f"{path} was made by an older MLflow than {mlflow.__version__}; copy it, then type: mlflow db upgrade "
            f"{PREFIX}{path}"
        )
    raise UserError(
        f"{path} was made by a newer MLflow than {mlflow.__version__}; install that one (pip install --upgrade "
        "mlflow), or name another file in tracking.uri"
    )
