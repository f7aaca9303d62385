"""A study logged to `mlflow server` over PostgreSQL while all of that is restarted and killed, and what is there then.

    python -m tests.server FOLDER [--cells N] [--writers N] [--install]          (or: make test-server)

FOLDER keeps the packages of the server; everything else lies in a temporary folder. Raises AssertionError where a cell
or a summary has not exactly one finished run with all that belongs to it in the end (`checks.py`), or a password is
found in a file. Ten minutes on two cores.
"""

import argparse
import json
import os
import random
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from tests.reports.mlflow_server import Proxy, Server
from tests.server.checks import check, has_password, missing
from tests.server.machines import PASSWORD, USER, Machine, Study, all_at_once
from tests.server.postgres import Postgres, packages, programs
from tests.server.trouble import Trouble, loses_some

COMES_S, LAG_S = 3.0, 15.0  # seconds from one cell to the next, and within which it comes to all machines
CATCH_UP_S = 240.0  # after the last cell, for the processes that follow


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("folder", type=Path)
    parser.add_argument("--cells", type=int, default=48)
    parser.add_argument("--writers", type=int, default=8)
    parser.add_argument("--install", action="store_true", help="PostgreSQL, by apt-get, where there is none")
    asked = parser.parse_args()
    bin_folder = programs(asked.install)
    paths = packages(asked.folder.resolve() / "packages")
    os.environ |= {"MLFLOW_TRACKING_USERNAME": USER, "MLFLOW_TRACKING_PASSWORD": PASSWORD}
    with tempfile.TemporaryDirectory(prefix="viewbench-server-") as name:
        Path(name).chmod(0o755)
        rehearse(Path(name), bin_folder, paths, asked.cells, asked.writers)


def rehearse(folder: Path, bin_folder: Path, paths: str, cells: int, writers: int) -> None:
    """All of it, in a folder that goes afterwards."""
    postgres = Postgres(folder / "postgres", bin_folder)
    (folder / "auth.ini").write_text(
        f"[mlflow]\ndefault_permission = READ\ndatabase_uri = {postgres.uri}\nadmin_username = {USER}\n"
        f"admin_password = {PASSWORD}\nauthorization_function = mlflow.server.auth:authenticate_request_basic_auth\n"
        "grant_default_workspace_access = false\n",
        encoding="utf-8",
    )
    variables = {"PYTHONPATH": paths, "MLFLOW_AUTH_CONFIG_PATH": str(folder / "auth.ini")}
    variables["MLFLOW_FLASK_SERVER_SECRET_KEY"] = "of a test"
    server = Server(folder / "server", "--app-name", "basic-auth", store=postgres.uri, **variables)
    proxy = Proxy(server.url)
    work = folder / "work"
    work.mkdir()
    began = time.monotonic()
    try:
        server.start()
        followed(Study(work, "followed", proxy.url, cells), server, postgres, proxy, writers)
        at_once(Study(work, "together", proxy.url, cells // 2), server, proxy, writers)
        a_real_one(Study(work, "whole", proxy.url, 12), server, postgres, proxy, writers)
    finally:
        server.stop()
        postgres.control("stop", "-m", "immediate")
    files = [path for path in work.rglob("*") if path.is_file()]
    assert files
    assert not has_password(work), has_password(work)
    print(f"no password in {len(files)} files of the studies; {time.monotonic() - began:.0f} s in all", flush=True)


def followed(study: Study, server: Server, postgres: Postgres, proxy: Proxy, writers: int) -> None:
    """Cells come one by one to so many machines, each of which has a process that follows; these are killed, too."""
    made, chance = study.make_cells(), random.Random(0)
    machines = [Machine(study, number, made) for number in range(writers)]
    harm(proxy)

    def killed() -> None:
        machine = chance.choice(machines)
        machine.kill()
        machine.follow()

    cells = chance.sample(study.cells, len(study.cells))
    comes = [
        (COMES_S * number + chance.uniform(0, LAG_S), machine, cell)
        for number, cell in enumerate(cells)
        for machine in range(writers)
    ]
    for machine in machines:
        machine.follow()
    with Trouble(server, postgres, proxy, killed) as trouble:
        began = time.monotonic()
        try:
            for at, number, cell in sorted(comes, key=lambda one: one[0]):
                while time.monotonic() < began + at:
                    time.sleep(0.05)
                machines[number].take(cell)
            end = time.monotonic() + CATCH_UP_S
            while time.monotonic() < end and any(one.account()["cells"] < len(cells) for one in machines):
                time.sleep(1)
            trouble.spare()
            counts = sorted(int(one.account()["cells"]) for one in machines)
            ends_s = max(machine.end() for machine in machines)
        except BaseException:
            trouble.spare()
            for machine in machines:
                machine.kill()
            raise
        asked = trouble.asked()
        print(f"followed by {writers} machines: {dict(trouble.done)}")
        print(f"  cells that each had seen logged: {counts} of {len(cells)}; the longest to end took {ends_s:.0f} s")
        print(f"  {asked} requests, {asked / len(cells):.0f} a cell", flush=True)
        print(f"  track by {writers} at once: {all_at_once(machines)}; {dict(trouble.done)} in all", flush=True)
    print(f"  before the last: {missing(server.url, study)} cells without a run", flush=True)
    once_more(machines[0])
    said = "".join(machine.said.read_text(encoding="utf-8") for machine in machines)
    assert "Traceback" not in said, said[-3000:]
    print(f"  {check(study, made, server.url)}", flush=True)


def at_once(study: Study, server: Server, proxy: Proxy, writers: int) -> None:
    """The whole study from nothing, by several at once."""
    made = study.make_cells()
    machines = [Machine(study, number, made) for number in range(writers)]
    for machine in machines:
        for cell in study.cells:
            machine.take(cell)
    harm(proxy)
    print(f"the whole study by {writers} machines at once: {all_at_once(machines)}")
    asked = sum(proxy.requests.values())
    print(f"  {asked} requests, {asked / len(study.cells):.0f} a cell", flush=True)
    once_more(machines[0])
    print(f"  {check(study, made, server.url)}", flush=True)


def a_real_one(study: Study, server: Server, postgres: Postgres, proxy: Proxy, writers: int) -> None:
    """A study that is trained, too, its name and password in the address."""
    address = proxy.url.replace("//", f"//{USER}:{PASSWORD}@")
    study.environment = {**study.environment, "VIEWBENCH_TRACKING_URI": address}
    for name in ("MLFLOW_TRACKING_USERNAME", "MLFLOW_TRACKING_PASSWORD"):
        del study.environment[name]
    harm(proxy)
    command = [sys.executable, "-m", "viewbench", "run", str(study.file), "-j", str(writers)]
    with Trouble(server, postgres, proxy) as trouble:
        done = subprocess.run(command, env=study.environment, cwd=study.folder, capture_output=True, text=True)
    assert PASSWORD not in done.stdout + done.stderr
    assert done.returncode == 0, done.stderr
    results = study.folder / "results" / study.name
    track = results / "logs" / "track"
    account = json.loads((track / "follow.json").read_text(encoding="utf-8"))
    said = (track / "follow.log").read_text(encoding="utf-8")
    stamp = json.loads((results / "tracked.json").read_text(encoding="utf-8"))
    print(f"viewbench run -j{writers}: {sum(proxy.requests.values())} requests, {dict(trouble.done)}")
    print(f"  followed: {account}, said {len(said.splitlines())} lines; the end of the study: {stamp}", flush=True)
    assert "Traceback" not in said, said
    assert "skipped" not in stamp, stamp
    print(f"  {check(study, results, server.url, page=True)}", flush=True)


def once_more(machine: Machine) -> None:
    """`track` when all is calm."""
    last = machine.track()
    assert last.returncode == 0, last.stderr
    print(f"  once more: {last.stdout.strip()}")


def harm(proxy: Proxy) -> None:
    """Begins to count anew, and to lose answers."""
    proxy.calm()
    proxy.loses = loses_some()


if __name__ == "__main__":
    main()
