"""A study logged to `mlflow server` over PostgreSQL while all of that is restarted and killed, and what is there then.

    python -m tests.server FOLDER [--cells N] [--writers N] [--install]          (or: make test-server)

FOLDER keeps the packages of the server; everything else lies in a temporary folder. Raises AssertionError where a cell
has not exactly one finished run in the end, or a password is found in a file. Ten minutes on two cores.
"""

import argparse
import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from tests.reports.mlflow_server import Proxy, Server
from tests.reports.test_tracking import write_cell
from tests.server.postgres import Postgres, packages, programs
from viewbench.common.cells import cell_name
from viewbench.common.settings import load as load_settings
from viewbench.reports import _tracking
from viewbench.workflow import _study

USER, PASSWORD = "admin", "a-word-4711-nobody-says"
STUDY = """title: A study for a server
scenes: [room_human]
selectors: [uniform, random, maxmin, kcenter]
ratios: [{ratios}]
seeds: [0, 1]
backends: [{{name: splat, backend: splat, budget: {{iterations: 20}}}}]
width: 48
reference: false
"""
APART = 40  # requests between two restarts
AGAIN = 20  # times that a job is begun which found nobody, as another of a long study would be
EVERY = 7  # of the writers is killed, of the cells has two writers, and of a hundred answers so many are lost


class Study:
    """A file of a study, its results and its address."""

    def __init__(self, folder: Path, name: str, address: str, cells: int):
        self.name, self.folder, self.file = name, folder, folder / f"{name}.yaml"
        ratios = ", ".join(f"{0.02 + 0.01 * i:.2f}" for i in range(max(1, cells // 6)))
        self.file.write_text(STUDY.format(ratios=ratios), encoding="utf-8")
        self.cells = _study.load(str(self.file), load_settings()).cells()
        self.results = folder / "results"
        self.environment = {
            **os.environ,
            "VIEWBENCH_TRACKING_URI": address,
            "VIEWBENCH_TRACKING_PATIENCE": "240",
            "MLFLOW_TRACKING_USERNAME": USER,
            "MLFLOW_TRACKING_PASSWORD": PASSWORD,
        }
        self.said: Counter[str] = Counter()
        self.seconds: list[float] = []

    def make_cells(self) -> None:
        for cell in self.cells:
            write_cell(self.results / self.name, cell)

    def track(self, *options: str, kill_after_s: float | None = None) -> int:
        """Runs `viewbench track`, as a job does."""
        command = [sys.executable, "-m", "viewbench", "track", str(self.file), "--results", str(self.results), *options]
        begun, killed = time.monotonic(), False
        process = subprocess.Popen(
            command, env=self.environment, cwd=self.folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        try:
            out, errors = process.communicate(timeout=kill_after_s)
        except subprocess.TimeoutExpired:
            process.kill()
            killed = True
            out, errors = process.communicate()
        self.seconds.append(time.monotonic() - begun)
        assert PASSWORD not in out + errors
        assert "Traceback" not in errors, errors
        said = {"was not asked": "not asked, since it was away", "the end of the study tries again": "found it away"}
        ended = next((words for text, words in said.items() if text in errors), "logged")
        self.said["killed" if killed else ended if not process.returncode else "failed"] += 1
        return process.returncode

    def track_cells(self, writers: int) -> None:
        """So many at once; some cells have two writers, and some writers are killed."""
        jobs = [(cell, False) for cell in self.cells]
        jobs += [(cell, False) for cell in self.cells[::EVERY]] + [(cell, True) for cell in self.cells[3::EVERY]]
        random.Random(0).shuffle(jobs)

        def write(number: int, cell: dict[str, str], killed: bool) -> None:
            stamp = self.folder / f"stamp-{number}.json"
            after_s = random.Random(number).uniform(2, 12) if killed else None
            for _ in range(AGAIN if number % EVERY else 1):
                self.track("--cell", cell_name(cell), "--stamp", str(stamp), kill_after_s=after_s)
                if killed or "skipped" not in json.loads(stamp.read_text(encoding="utf-8")):
                    break

        with ThreadPoolExecutor(writers) as pool:
            for done in [pool.submit(write, number, *job) for number, job in enumerate(jobs)]:
                done.result()

    def check(self, where: str) -> str:
        """Counts the runs, asking the server itself."""
        from mlflow import MlflowClient

        client = MlflowClient(tracking_uri=where)
        experiment = client.get_experiment_by_name(self.name)
        assert experiment is not None
        runs = client.search_runs([experiment.experiment_id], max_results=5000)
        each = Counter(run.data.tags[_tracking.CELL] for run in runs)
        states = Counter(run.info.status for run in runs)
        assert set(each) == set(map(cell_name, self.cells)), f"{len(each)} of {len(self.cells)} cells have a run"
        assert set(each.values()) == {1}, each.most_common(3)
        assert set(states) == {"FINISHED"}, states
        whole = [run for run in runs if {"psnr_db", "train_s"} <= set(run.data.metrics)]
        files = Counter(len(client.list_artifacts(run.info.run_id)) for run in runs)
        assert len(whole) == len(runs), f"{len(runs) - len(whole)} runs are not whole"
        assert set(files) == {4}, files
        deleted = len(client.search_runs([experiment.experiment_id], run_view_type=2, max_results=5000))
        return (
            f"{len(self.cells)} cells, runs a cell {set(each.values())}, {dict(states)}, {deleted} removed on the way"
        )


class Trouble(threading.Thread):
    """Restarts and kills the server and its database, one after the other, until it is told to stop."""

    def __init__(self, server: Server, postgres: Postgres, study: Study, proxy: Proxy):
        super().__init__(daemon=True)
        self.server, self.postgres, self.study, self.proxy = server, postgres, study, proxy
        self.over, self.done = threading.Event(), Counter[str]()

    def run(self) -> None:
        while True:
            for name, cause in {
                "PostgreSQL restarted": lambda: self.postgres.control("restart", "-m", "fast"),
                "server SIGTERM": lambda: self.restart(signal.SIGTERM),
                "PostgreSQL crashed": lambda: self.postgres.control("restart", "-m", "immediate"),
                "server SIGKILL": lambda: self.restart(signal.SIGKILL),
            }.items():
                enough = sum(self.proxy.requests.values()) + APART
                while sum(self.proxy.requests.values()) < enough:
                    if self.over.wait(0.1):
                        return
                cause()
                self.done[name] += 1
                # As if the minutes had gone by after which jobs ask again.
                (self.study.results / self.study.name / "logs" / "track" / "away.json").unlink(missing_ok=True)

    def restart(self, how: int) -> None:
        self.server.stop(how)
        self.server.start()

    def stop(self) -> None:
        self.over.set()
        self.join()


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
    try:
        server.start()
        proxy.loses = loses_some()
        one_by_one(Study(folder, "jobs", proxy.url, cells), server, postgres, proxy, writers)
        at_once(Study(folder, "together", proxy.url, cells // 2), server, proxy, writers)
        by_snakemake(Study(folder, "whole", proxy.url, 12), server, postgres, proxy, writers)
    finally:
        server.stop()
        postgres.control("stop", "-m", "immediate")
    files = [path for name in ("results", ".snakemake") for path in (folder / name).rglob("*") if path.is_file()]
    told = [path for path in files if PASSWORD.encode() in path.read_bytes()]
    assert files
    assert not told, told
    print("no file of results/ or .snakemake/ has the password", flush=True)


def loses_some():
    """EVERY % of the answers, always the same ones."""
    chance = random.Random(1)
    return lambda method, path: chance.random() < EVERY / 100


def one_by_one(study: Study, server: Server, postgres: Postgres, proxy: Proxy, writers: int) -> None:
    """A job a cell, `writers` at once, in an experiment that is not there yet."""
    study.make_cells()
    trouble = Trouble(server, postgres, study, proxy)
    trouble.start()
    study.track_cells(writers)
    longest_s = max(study.seconds)
    print(f"jobs: {writers} at once, {dict(study.said)}, {sum(proxy.requests.values())} requests", flush=True)
    print(f"  the longest job {longest_s:.0f} s", flush=True)
    code = study.track()
    trouble.stop()
    print(f"  during these: {dict(trouble.done)}; the end of the study: exit status {code}", flush=True)
    assert not study.track()
    print(f"  {study.check(server.url)}", flush=True)


def at_once(study: Study, server: Server, proxy: Proxy, writers: int) -> None:
    """The whole study, by several at once."""
    study.make_cells()
    with ThreadPoolExecutor(writers) as pool:
        codes = list(pool.map(lambda _: study.track(), range(writers)))
    print(f"whole study by {writers} at once: exit status {Counter(codes)}", flush=True)
    assert not study.track()
    print(f"  {study.check(server.url)}", flush=True)


def by_snakemake(study: Study, server: Server, postgres: Postgres, proxy: Proxy, writers: int) -> None:
    """A study that is trained, too, its name and password in the address."""
    proxy.calm()
    address = proxy.url.replace("//", f"//{USER}:{PASSWORD}@")
    study.environment = {**study.environment, "VIEWBENCH_TRACKING_URI": address}
    for name in ("MLFLOW_TRACKING_USERNAME", "MLFLOW_TRACKING_PASSWORD"):
        del study.environment[name]
    proxy.loses = loses_some()
    trouble = Trouble(server, postgres, study, proxy)
    trouble.start()
    command = [sys.executable, "-m", "viewbench", "run", str(study.file), "-j", str(writers)]
    done = subprocess.run(command, env=study.environment, cwd=study.folder, capture_output=True, text=True)
    trouble.stop()
    assert PASSWORD not in done.stdout + done.stderr
    assert done.returncode == 0, done.stderr
    print(f"snakemake -j{writers}: {sum(proxy.requests.values())} requests, {dict(trouble.done)}", flush=True)
    stamp = json.loads((study.results / study.name / "tracked.json").read_text(encoding="utf-8"))
    print(f"  the end of the study: {stamp}; {study.check(server.url)}", flush=True)


if __name__ == "__main__":
    main()
