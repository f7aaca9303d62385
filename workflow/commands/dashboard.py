"""Serve MLflow over the runs that were logged."""

import os
import socket
import sys
from pathlib import Path

import click


@click.command()
@click.argument("study", required=False)
@click.option("--port", type=click.IntRange(1, 65535), default=5000, show_default=True)
@click.option("--results", type=click.Path(path_type=Path), default="results", show_default=True)
@click.option("--links", is_flag=True, help="Only say where the figures are; serve nothing.")
def command(study: str | None, port: int, results: Path, links: bool) -> None:
    """Serve MLflow on 127.0.0.1 over the database of `tracking.uri`, and say where each study's Figure 4 is.

    With a server in `tracking.uri` there is nothing to serve: its addresses are said. Ends with Ctrl-C.
    """
    from ...common import settings as settings_file
    from ...common.errors import UserError
    from ...reports import _tracked_link, _tracking
    from ...reports._tracking_errors import masked

    uri = settings_file.load().tracking.uri
    if not uri:
        raise UserError("tracking.uri is empty: nothing was logged")
    here = f"http://127.0.0.1:{port}"
    found = _tracked_link.figures(results, uri, here)
    if study is not None:
        name = Path(study).stem
        if name not in found:
            known = f" (there are: {', '.join(found)})" if found else ""
            raise UserError(f"no study '{name}' has been logged to {masked(uri, uri)}{known}")
        found = {name: found[name]}
    remote = _tracking.is_remote(uri)
    if not links and not remote:
        _check(uri, port)
    for name, figure in found.items():
        click.echo(f"Figure 4 of {name} in MLflow: {figure}")
    if links:
        return
    if remote:
        print(f"viewbench: runs are logged to {masked(uri)}, which serves them itself", file=sys.stderr)
        return
    arguments = ["server", "--backend-store-uri", _tracking.local_uri(uri), "--host", "127.0.0.1", "--port", str(port)]
    sys.stdout.flush()
    _tracking.keep_quiet()
    os.execv(sys.executable, [sys.executable, "-m", "mlflow", *arguments])


def _check(uri: str, port: int) -> None:
    """Raises UserError where there is nothing to serve, or nowhere to serve it."""
    from ...common.errors import UserError
    from ...reports import _tracking_sqlite
    from ...reports._tracking_errors import masked

    path = _tracking_sqlite.path_of(uri)
    if path is not None and not path.is_file():
        raise UserError(f"there is no database '{masked(uri, uri)}' yet; run a study first")
    with socket.socket() as tried:
        tried.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            tried.bind(("127.0.0.1", port))
        except OSError:
            raise UserError(f"port {port} is taken, by another dashboard perhaps; name another by --port") from None
