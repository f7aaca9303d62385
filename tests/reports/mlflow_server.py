"""A real `mlflow server` for tests, and a proxy before it that counts requests and does what networks do to them."""

import contextlib
import http.client
import os
import signal
import ssl
import subprocess
import sys
import threading
import time
import urllib.request
from collections import Counter
from collections.abc import Callable
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

from viewbench.backends._command_line import free_port

PATIENCE_S = 120  # for a server to begin
# No calls home, and no process for jobs that nobody gives it.
QUIET = {"MLFLOW_DISABLE_TELEMETRY": "true", "DO_NOT_TRACK": "true", "MLFLOW_SERVER_ENABLE_JOB_EXECUTION": "false"}
HOP = ("connection", "transfer-encoding", "content-length", "keep-alive")  # headers of one connection


class Server:
    """`mlflow server` with artifacts behind it; over SQLite where no other store is named."""

    def __init__(self, folder: Path, *options: str, store: str = "", **variables: str):
        folder.mkdir(parents=True, exist_ok=True)
        self.folder, self.port = folder, free_port()
        self.command = [sys.executable, "-m", "mlflow", "server", "--host", "127.0.0.1", "--port", str(self.port)]
        self.command += ["--backend-store-uri", store or f"sqlite:///{folder}/mlflow.db", "--workers", "1"]
        self.command += ["--artifacts-destination", str(folder / "artifacts"), "--serve-artifacts", *options]
        self.variables = {**QUIET, **variables}
        self.process: subprocess.Popen | None = None

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.port}"

    def start(self) -> "Server":
        """Returns when it answers."""
        with open(self.folder / "server.log", "ab") as log:
            self.process = subprocess.Popen(
                self.command,
                cwd=self.folder,
                env={**os.environ, **self.variables},
                stdout=log,
                stderr=log,
                start_new_session=True,
            )
        end = time.monotonic() + PATIENCE_S
        while time.monotonic() < end and self.process.poll() is None:
            with contextlib.suppress(OSError), urllib.request.urlopen(f"{self.url}/health", timeout=5) as answer:
                if answer.status == 200:
                    return self
            time.sleep(0.1)
        self.stop(signal.SIGKILL)
        raise AssertionError((self.folder / "server.log").read_text(encoding="utf-8", errors="replace")[-2000:])

    def stop(self, how: int = signal.SIGTERM) -> None:
        """Ends it and its workers."""
        if self.process is None:
            return
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self.process.pid, how)
        with contextlib.suppress(subprocess.TimeoutExpired):
            self.process.wait(20)
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self.process.pid, signal.SIGKILL)
        self.process.wait(20)
        self.process = None


class _Listener(ThreadingHTTPServer):
    def handle_error(self, request: object, client_address: object) -> None:
        """Silent: clients are killed, and do not wait for ever."""


class Proxy:
    """Hands requests on to a server. `loses(method, path)` says of a request that its answer is lost: the server has
    done what it asked, and the connection ends. `refuses` says which get a 503 and never reach it."""

    def __init__(self, behind: str, certificate: tuple[Path, Path] | None = None):
        self.behind = behind.removeprefix("http://")
        self.requests: Counter[str] = Counter()
        self.headers: list[dict[str, str]] = []
        self.loses: Callable[[str, str], bool] = lambda method, path: False
        self.refuses: Callable[[str, str], bool] = lambda method, path: False
        self.lock = threading.Lock()
        proxy = self

        class Handler(BaseHTTPRequestHandler):
            protocol_version = "HTTP/1.1"

            def handle_one(self) -> None:
                proxy.handle(self)

            do_GET = do_POST = do_PUT = do_PATCH = do_DELETE = handle_one  # noqa: N815

            def log_message(self, format: str, *args: object) -> None:
                pass

        self.server = _Listener(("127.0.0.1", 0), Handler)
        self.server.daemon_threads, self.server.block_on_close = True, False
        scheme = "http"
        if certificate:
            context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
            context.load_cert_chain(*certificate)
            self.server.socket = context.wrap_socket(self.server.socket, server_side=True)
            scheme = "https"
        self.url = f"{scheme}://127.0.0.1:{self.server.server_address[1]}"
        threading.Thread(target=self.server.serve_forever, daemon=True).start()

    def handle(self, request: BaseHTTPRequestHandler) -> None:
        path = request.path.split("?")[0]
        body = request.rfile.read(int(request.headers.get("Content-Length") or 0))
        with self.lock:
            self.requests[f"{request.command} {path}"] += 1
            self.headers.append(dict(request.headers))
            loses, refuses = self.loses(request.command, path), self.refuses(request.command, path)
        if refuses:
            request.send_response(503)
            request.send_header("Content-Length", "0")
            request.end_headers()
            return
        headers = {key: value for key, value in request.headers.items() if key.lower() not in HOP}
        connection = http.client.HTTPConnection(self.behind, timeout=60)
        try:
            connection.request(request.command, request.path, body, headers)
            answer = connection.getresponse()
            content = answer.read()
        except (OSError, http.client.HTTPException):  # the server was killed before or in the middle of its answer
            request.close_connection = True
            return
        finally:
            connection.close()
        if loses:
            request.close_connection = True
            return
        request.send_response(answer.status)
        for key, value in answer.getheaders():
            if key.lower() not in HOP:
                request.send_header(key, value)
        request.send_header("Content-Length", str(len(content)))
        request.end_headers()
        request.wfile.write(content)

    def calm(self) -> None:
        """Forgets what it counted and stops doing harm."""
        self.requests.clear()
        self.headers.clear()
        self.loses = self.refuses = lambda method, path: False

    def close(self) -> None:
        self.server.shutdown()
        self.server.server_close()


def once(wanted: str, times: int = 1) -> Callable[[str, str], bool]:
    """Of the requests whose path ends so, the first ones."""
    left = [times]

    def asked(method: str, path: str) -> bool:
        if not path.endswith(wanted) or not left[0]:
            return False
        left[0] -= 1
        return True

    return asked
