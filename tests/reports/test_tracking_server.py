import contextlib
import json
import signal
import subprocess
import sys
import threading
import time
import uuid
from dataclasses import replace
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import pytest

from tests.conftest import known
from tests.reports.mlflow_server import Proxy, Server, once
from tests.reports.test_tracking import GROUPS, ROWS, about, counts, write_cell
from viewbench.common.cells import cell_name
from viewbench.common.errors import UserError
from viewbench.common.settings import Tracking
from viewbench.reports import _tracking
from viewbench.reports._tracked_cell import StudyCells
from viewbench.reports._tracked_study import Tracked
from viewbench.reports._tracked_summary import group_of
from viewbench.reports._tracking_log import Log

FILES = {"selection.json", "train.json", "metrics.json", "renders", "model"}


@pytest.fixture(scope="module")
def server(tmp_path_factory):
    started = Server(tmp_path_factory.mktemp("server")).start()
    yield started
    started.stop()


@pytest.fixture
def proxy(server):
    before = Proxy(server.url)
    yield before
    before.close()


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    """What the tracker sets for its process does not outlive a test, and pauses are short."""
    for name in ("MAX_RETRIES", "TIMEOUT"):
        monkeypatch.delenv(f"MLFLOW_HTTP_REQUEST_{name}", raising=False)
    monkeypatch.setenv("MLFLOW_HTTP_REQUEST_BACKOFF_FACTOR", "0")
    monkeypatch.setattr(_tracking, "PAUSES_S", (0.2,))


@pytest.fixture
def study(tmp_path):
    """A name that no other test has, and results of four cells."""
    results = tmp_path / "results" / "demo"
    for row in ROWS:
        write_cell(results, row)
    return f"study-{uuid.uuid4().hex}", results


def runs_of(server, study):
    """Everything that is in the experiment and not deleted, asked without the proxy."""
    from mlflow import MlflowClient

    client = MlflowClient(tracking_uri=server.url)
    experiment = known(client.get_experiment_by_name(study))
    return client, client.search_runs([experiment.experiment_id], max_results=1000)


def log(name, rows, results, tracking, **more):
    return counts(_tracking.track(about(name), rows, results, tracking, **more))


def cells_of(server, study):
    """Client, and the runs of cells alone."""
    client, runs = runs_of(server, study)
    return client, [run for run in runs if _tracking.CELL in run.data.tags]


def assert_right(server, study, rows=ROWS):
    """One finished run a cell and a summary, none of them in part; cells are children of summaries."""
    client, runs = runs_of(server, study)
    assert {run.info.status for run in runs} == {"FINISHED"}
    cells = [run for run in runs if _tracking.CELL in run.data.tags]
    summaries = {run.info.run_id: run for run in runs if run not in cells}
    assert sorted(run.data.tags[_tracking.CELL] for run in cells) == sorted(map(cell_name, rows))
    groups = {name.rsplit("/", 2)[0] for name in map(cell_name, rows)}
    assert groups <= set(GROUPS)
    assert sorted(run.data.tags["viewbench.summary"] for run in summaries.values()) == sorted(groups)
    for run in cells:
        assert run.data.metrics["psnr_db"] == 20.0
        assert run.data.params["n_views"] == "40"
        assert len(known(run.inputs).dataset_inputs) == 1
        assert {item.path for item in client.list_artifacts(run.info.run_id)} == FILES
        assert len(client.get_metric_history(run.info.run_id, "train/loss")) == 3
        assert (
            summaries[run.data.tags["mlflow.parentRunId"]].data.tags["viewbench.summary"]
            in run.data.tags[_tracking.CELL]
        )
    for run in summaries.values():
        assert [point.value for point in client.get_metric_history(run.info.run_id, "psnr_db")] == [20.0]


REQUESTS = (
    *("experiments/create", "experiments/set-experiment-tag", "runs/search", "runs/create", "runs/log-batch"),
    *("runs/log-inputs", "renders/0.jpg", "model/model.ply", "runs/update"),
)


@pytest.mark.parametrize("request_", REQUESTS)
def test_an_answer_that_is_lost_leaves_no_second_run(server, proxy, study, request_):
    name, results = study
    proxy.loses = once(request_)
    assert log(name, ROWS[:1], results, Tracking(uri=proxy.url)) == {"logged": 1, "kept": 0}
    assert sum(count for asked, count in proxy.requests.items() if asked.endswith(request_)) >= 2
    assert_right(server, name, ROWS[:1])


@pytest.mark.parametrize("request_", ["runs/create", "runs/update"])
def test_an_answer_that_is_never_heard_is_cleared_by_the_next_call(server, proxy, study, request_):
    name, results = study
    proxy.loses = lambda method, path: path.endswith(request_)
    with pytest.raises(UserError, match="did not take the runs"):
        log(name, ROWS[:1], results, Tracking(uri=proxy.url, patience=0))
    _, runs = runs_of(server, name)
    assert runs  # which nobody knows to be there
    proxy.calm()
    log(name, ROWS, results, Tracking(uri=proxy.url))
    assert_right(server, name)


WRITER = """
import sys, json
from pathlib import Path
from viewbench.common.settings import Tracking
from viewbench.reports import _about, _tracking
study, row, results, uri = sys.argv[1:]
row = json.loads(row)
told = _about.About(study, "A study to log", "", "viewbench run demo.yaml", ("random", "maxmin"), (row,))
print("ready", flush=True)
sys.stdin.readline()
_tracking.track(told, [row], Path(results), Tracking(uri=uri))
"""


def writer(study, row, results, uri):
    """A process that logs one cell when it is told to."""
    arguments = [sys.executable, "-c", WRITER, study, json.dumps(row), str(results), uri]
    process = subprocess.Popen(arguments, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert known(process.stdout).readline() == "ready\n"
    return process


@pytest.mark.parametrize("request_", ["runs/create", "runs/update"])
def test_a_writer_that_is_killed_leaves_nothing(server, proxy, study, request_):
    name, results = study
    process = writer(name, ROWS[0], results, proxy.url)

    def kills(method, path):
        if path.endswith(request_):
            process.kill()
            process.wait()
        return False

    proxy.loses = kills
    process.communicate("go\n", timeout=120)
    assert process.returncode == -signal.SIGKILL
    proxy.calm()
    end = time.monotonic() + 30
    while not runs_of(server, name)[1] and time.monotonic() < end:
        time.sleep(0.1)  # the server does what it was asked after all
    assert runs_of(server, name)[1]
    log(name, ROWS, results, Tracking(uri=proxy.url))
    assert_right(server, name)


def test_eight_writers_of_all_cells_at_once_in_an_experiment_that_is_not_there(server, proxy, study):
    name, results = study
    barrier, failed = threading.Barrier(8), []

    def write(number):
        barrier.wait()
        try:
            log(name, ROWS[number % 2 :] + ROWS[: number % 2], results, Tracking(uri=proxy.url))
        except UserError as error:
            failed.append(str(error))

    threads = [threading.Thread(target=write, args=(number,)) for number in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert failed == []
    assert_right(server, name)


def test_who_logs_to_a_server_begins_somewhere_and_leaves_nothing_out(study):
    rows = [{**row, "ratio": str(ratio)} for row in ROWS for ratio in (0.1, 0.2, 0.3)]

    def turned(uri):
        return _tracking._turned(rows, Log(None, uri, "demo", Tracking()))

    assert turned("sqlite:///mlflow.db") == rows
    orders = [turned("http://127.0.0.1:5000") for _ in range(40)]
    assert all(sorted(map(cell_name, order)) == sorted(map(cell_name, rows)) for order in orders)
    assert len({cell_name(order[0]) for order in orders}) > 1
    assert _tracking._turned([], Log(None, "http://127.0.0.1:5000", "demo", Tracking())) == []


def test_a_run_that_another_removes_is_begun_again(server, proxy, study):
    name, results = study
    removed = []

    def removes(method, path):
        if path.endswith("renders/0.jpg") and not removed:
            client, runs = cells_of(server, name)
            removed.append(runs[0].info.run_id)
            client.delete_run(removed[0])
        return False

    proxy.loses = removes
    log(name, [ROWS[0]], results, Tracking(uri=proxy.url))
    assert len(removed) == 1
    assert_right(server, name, ROWS[:1])


def test_a_cell_that_is_made_anew_while_it_is_logged_is_logged_anew(server, proxy, study):
    name, results = study
    write_cell(results, ROWS[0], psnr_db=15.0)

    def changes(method, path):
        if path.endswith("runs/update"):
            write_cell(results, ROWS[0])
        return False

    proxy.loses = changes
    log(name, [ROWS[0]], results, Tracking(uri=proxy.url))
    assert_right(server, name, ROWS[:1])


@pytest.mark.parametrize("change", ["a score", "a summary that is removed"])
def test_a_summary_that_another_has_made_anew_is_kept(server, proxy, study, change):
    """Of two who know the same run, which goes, the second takes that of the first: eight would go on without end."""
    name, results = study
    tracking = Tracking(uri=proxy.url)
    if change == "a score":
        write_cell(results, ROWS[0], psnr_db=15.0)
    log(name, ROWS[:2], results, tracking)
    write_cell(results, ROWS[0])
    rows = [*ROWS[:2], *({**row, "ratio": "0.2"} for row in ROWS[:2])]
    for row in rows[2:]:
        write_cell(results, row)
    both = []
    for _ in range(2):
        own = _tracking.open_log(name, tracking, 1, 5)
        own.start()
        both.append(Tracked(about(name, rows), StudyCells(about(name, rows), results, tracking), own))
    client, (old,) = runs_of(server, name)[0], [run for run in runs_of(server, name)[1] if is_summary(run)]
    if change != "a score":
        client.delete_run(old.info.run_id)
    for one in both:
        for row in rows:
            one.cell(row)
        one.summary(group_of(rows[0]), rows)
    _, runs = runs_of(server, name)
    (summary,) = [run for run in runs if is_summary(run)]
    assert summary.info.run_id != old.info.run_id
    assert {known(one.log.known(("summary", "splat/room/random"))).id for one in both} == {summary.info.run_id}
    history = client.get_metric_history(summary.info.run_id, "psnr_db")
    assert [(point.step, point.value) for point in history] == [(10, 20.0), (20, 20.0)]
    cells = [run for run in runs if not is_summary(run)]
    assert [run.data.tags["mlflow.parentRunId"] for run in cells] == 4 * [summary.info.run_id]


def is_summary(run):
    return run.data.tags["viewbench.kind"] == "summary"


def test_an_experiment_that_was_deleted_is_restored_without_what_was_removed(server, proxy, study):
    name, results = study
    tracking = Tracking(uri=proxy.url)
    log(name, ROWS, results, tracking)
    client, runs = runs_of(server, name)
    client.create_run(runs[0].info.experiment_id, tags=runs[0].data.tags)  # as a writer that was killed leaves it
    client.delete_experiment(runs[0].info.experiment_id)
    assert log(name, ROWS, results, tracking) == {"logged": 0, "kept": 4}
    assert_right(server, name)


def test_a_cell_takes_few_requests(server, proxy, study):
    name, results = study
    train = results / "cells" / cell_name(ROWS[0]) / "train.json"
    record = json.loads(train.read_text())
    record["curve"] = [{"step": i, "seconds": 0.001 * i, "loss": 1.0, "test_psnr_db": 9.0} for i in range(1, 1201)]
    train.write_text(json.dumps(record))
    tracking = Tracking(uri=proxy.url, renders=3)
    log(name, ROWS[:1], results, tracking)
    # of 2409 numbers, and of the point of a summary
    assert sum(count for asked, count in proxy.requests.items() if asked.endswith("log-batch")) == 3 + 2
    proxy.calm()
    rows = [{**row, "selector": "coverage"} for row in ROWS[:2]]
    for row in rows:
        write_cell(results, row)
    _tracking.track(about(name, [*ROWS, *rows]), rows, results, tracking)
    # seven files; two searches, to begin, numbers, data set, to end; a summary without files, with a point, which is
    # looked at before and after
    start, cell, summary = 2, 7 + 2 + 4, 2 + 4 + 2 + 2
    assert sum(proxy.requests.values()) == start + 2 * cell + summary
    log(name, ROWS, results, tracking)
    proxy.calm()
    assert log(name, ROWS, results, tracking) == {"logged": 0, "kept": 4}
    assert sum(proxy.requests.values()) == 2


def test_the_end_of_a_study_waits_for_a_server(server, proxy, study):
    name, results = study
    proxy.refuses = lambda method, path: True
    with pytest.raises(UserError, match="503"):
        log(name, ROWS, results, Tracking(uri=proxy.url, patience=1))
    said = []
    timer = threading.Timer(3, proxy.calm)
    timer.start()
    done = log(name, ROWS, results, Tracking(uri=proxy.url, patience=300), say=said.append)
    assert done == {"logged": 4, "kept": 0}
    assert len(said) == 1
    assert "asking again" in said[0]
    assert_right(server, name)


def test_a_cell_that_is_not_taken_leaves_the_others(server, proxy, study):
    name, results = study
    broken = results / "cells" / cell_name(ROWS[1]) / "train.json"
    whole = broken.read_text()
    broken.write_text("{")
    with pytest.raises(UserError, match=rf"took 3 of 4 cells, first without {cell_name(ROWS[1])}: .*not valid JSON"):
        log(name, ROWS, results, Tracking(uri=proxy.url))
    assert_right(server, name, [ROWS[0], *ROWS[2:]])
    broken.write_text(whole)
    # one that the server fails at each time, though it answers otherwise
    proxy.refuses = lambda method, path: path.endswith("log-batch")
    with pytest.raises(UserError, match=r"took 3 of 4 cells, first without"):
        log(name, ROWS, results, Tracking(uri=proxy.url))
    proxy.calm()
    log(name, ROWS, results, Tracking(uri=proxy.url))
    assert_right(server, name)


USERS = {"": "Bearer tok/en-4711", "ann:pass%23word@": "Basic YW5uOnBhc3Mjd29yZA=="}  # in the address, and what is sent


@pytest.mark.parametrize(("user", "header"), USERS.items())
def test_no_password_is_told(server, proxy, study, user, header, monkeypatch, capfd, caplog):
    name, results = study
    monkeypatch.setenv("MLFLOW_TRACKING_TOKEN", "tok/en-4711")
    tracking = Tracking(uri=proxy.url.replace("//", f"//{user}"), patience=0)
    log(name, ROWS[:1], results, tracking)
    assert {sent["Authorization"] for sent in proxy.headers} == {header}
    said = []
    proxy.refuses = lambda method, path: True
    with pytest.raises(UserError) as first:
        log(name, [ROWS[1]], results, tracking)
    with pytest.raises(UserError) as second:
        log(name, ROWS, results, replace(tracking, patience=5), say=said.append)
    nobody = Tracking(uri=f"http://{user}127.0.0.1:9", patience=0)
    with pytest.raises(UserError) as third:
        log(name, ROWS, results, nobody)
    said += [str(error.value) for error in (first, second, third)]
    files = [path.read_text(errors="replace") for path in results.rglob("*") if path.is_file()]
    runs = [repr(run.to_dictionary()) for run in runs_of(server, name)[1]]
    assert len(said) == 4
    assert any("503" in text for text in said)  # why it is away
    for secret in ("4711", "pass%23word", "pass#word", "YW5uOnBhc3Mjd29yZA"):
        assert not [text for text in (*said, *files, *runs, *capfd.readouterr(), caplog.text) if secret in text]


def test_who_must_be_named_and_who_is_no_server_is_said(server, study):
    name, results = study

    class Handler(BaseHTTPRequestHandler):
        status, content = 401, b"You are not authenticated."

        def do_GET(self):
            self.send_response(self.status)
            self.end_headers()
            self.wfile.write(self.content)

        def log_message(self, format, *args):
            pass

    with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as other:
        threading.Thread(target=other.serve_forever, daemon=True).start()
        tracking = Tracking(uri=f"http://127.0.0.1:{other.server_address[1]}", patience=300)
        with pytest.raises(UserError, match="MLFLOW_TRACKING_USERNAME"):
            log(name, ROWS, results, tracking)
        for Handler.status, Handler.content in ((404, b"no such page"), (200, b"<html>")):
            with pytest.raises(UserError, match="no MLflow server"):
                log(name, ROWS, results, tracking)
        other.shutdown()


def test_a_certificate_is_trusted_where_a_variable_names_it(server, study, tmp_path, monkeypatch):
    name, results = study
    certificate = self_signed(tmp_path)
    with contextlib.closing(Proxy(server.url, certificate)) as proxy:
        with pytest.raises(UserError, match="MLFLOW_TRACKING_SERVER_CERT_PATH"):
            log(name, ROWS, results, Tracking(uri=proxy.url, patience=300))
        monkeypatch.setenv("MLFLOW_TRACKING_SERVER_CERT_PATH", str(certificate[0]))
        log(name, ROWS, results, Tracking(uri=proxy.url))
    assert_right(server, name)


def self_signed(folder):
    """Files of a certificate of 127.0.0.1 and its key."""
    import datetime
    import ipaddress

    from cryptography import x509
    from cryptography.hazmat.primitives import hashes, serialization
    from cryptography.hazmat.primitives.asymmetric import ec

    key = ec.generate_private_key(ec.SECP256R1())
    name = x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, "127.0.0.1")])
    now = datetime.datetime.now(datetime.UTC)
    built = x509.CertificateBuilder().subject_name(name).issuer_name(name).public_key(key.public_key())
    built = built.serial_number(x509.random_serial_number()).not_valid_before(now - datetime.timedelta(days=1))
    built = built.not_valid_after(now + datetime.timedelta(days=1))
    address = x509.SubjectAlternativeName([x509.IPAddress(ipaddress.ip_address("127.0.0.1"))])
    signed = built.add_extension(address, critical=False).sign(key, hashes.SHA256())
    pem = serialization.Encoding.PEM
    (folder / "cert.pem").write_bytes(signed.public_bytes(pem))
    plain = serialization.NoEncryption()
    (folder / "key.pem").write_bytes(key.private_bytes(pem, serialization.PrivateFormat.PKCS8, plain))
    return folder / "cert.pem", folder / "key.pem"
