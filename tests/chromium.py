"""A headless Chromium for tests, driven by the DevTools protocol over two pipes: no package and no port is needed."""

import base64
import contextlib
import fcntl
import json
import os
import select
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

NAMES = ("chromium", "chromium-browser", "google-chrome")
PATIENCE_S = 90
# Chromium reads commands from file descriptor 3 and answers on 4.
BEGIN = """import os, sys
os.dup2(int(sys.argv[1]), 3)
os.dup2(int(sys.argv[2]), 4)
os.execv(sys.argv[3], sys.argv[3:])
"""
FLAGS = ("--headless", "--remote-debugging-pipe", "--disable-gpu", "--hide-scrollbars", "--no-first-run")
FLAGS += ("--disable-dev-shm-usage", "--disable-background-networking", "--disable-component-update")


def find() -> str | None:
    """The program, or None where this machine has none."""
    return next(filter(None, map(shutil.which, NAMES)), None)


class Page:
    """One page of a browser of its own, which ends with the `with` statement; everything raises AssertionError when
    the browser has not answered within 90 seconds."""

    def __init__(self, program: str, width: int, height: int):
        self.folder = tempfile.TemporaryDirectory(prefix="viewbench-browser-", ignore_cleanup_errors=True)
        (theirs_in, self._commands), (self._answers, theirs_out) = _pipe(), _pipe()
        command = [sys.executable, "-c", BEGIN, str(theirs_in), str(theirs_out), program, *FLAGS]
        command += [f"--user-data-dir={self.folder.name}", *(["--no-sandbox"] if os.geteuid() == 0 else [])]
        self.process = subprocess.Popen(
            command,
            pass_fds=(theirs_in, theirs_out),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        os.close(theirs_in)
        os.close(theirs_out)
        self._session: str | None = None
        self._received, self._sent = b"", 0
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self._session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        self.call("Page.enable")
        self.size(width, height)

    def __enter__(self) -> "Page":
        return self

    def __exit__(self, *_: object) -> None:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self.process.pid, signal.SIGKILL)
        self.process.wait()
        os.close(self._commands)
        os.close(self._answers)
        self.folder.cleanup()

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """What a method of the DevTools protocol returns."""
        self._sent += 1
        message: dict[str, Any] = {"id": self._sent, "method": method, "params": parameters}
        if self._session:
            message["sessionId"] = self._session
        os.write(self._commands, json.dumps(message).encode() + b"\0")
        end = time.monotonic() + PATIENCE_S
        while True:
            answer = self._next(end)
            if answer.get("id") == self._sent:  # what has no id is an event
                assert "error" not in answer, f"{method}: {answer['error']}"
                return answer["result"]

    def _next(self, end: float) -> dict[str, Any]:
        while b"\0" not in self._received:
            ready, _, _ = select.select([self._answers], [], [], max(0.0, end - time.monotonic()))
            assert ready, "Chromium does not answer"
            piece = os.read(self._answers, 1 << 20)
            assert piece, "Chromium has ended"
            self._received += piece
        one, _, self._received = self._received.partition(b"\0")
        return json.loads(one)

    def size(self, width: int, height: int) -> None:
        """Size of the page in pixels."""
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)

    def before(self, script: str) -> None:
        """Runs a script at the beginning of every document from now on."""
        self.call("Page.addScriptToEvaluateOnNewDocument", source=script)

    def open(self, address: str) -> None:
        """Opens an address afresh, even where only what is after its # has changed."""
        self.call("Page.navigate", url="about:blank")
        self.call("Page.navigate", url=address)

    def value(self, expression: str) -> Any:
        """What JavaScript makes of the expression."""
        return self.call("Runtime.evaluate", expression=expression, returnByValue=True)["result"].get("value")

    def wait(self, expression: str) -> None:
        """Returns when the expression is true."""
        end = time.monotonic() + PATIENCE_S
        while not self.value(expression):
            assert time.monotonic() < end, f"the page never came to: {expression}\n{self.text()[:2000]}"
            time.sleep(0.2)

    def text(self) -> str:
        """What the page says."""
        return self.value("document.body ? document.body.innerText : ''") or ""

    def picture(self, path: Path) -> None:
        """Writes the page as a PNG, when it has looked the same for a second; after 8 s also one that moves."""
        last, same, end = "", 0, time.monotonic() + 8
        while same < 4 and time.monotonic() < end:
            time.sleep(0.25)
            now = self.call("Page.captureScreenshot", format="png")["data"]
            last, same = now, same + 1 if now == last else 0
        path.write_bytes(base64.b64decode(last))


def _pipe() -> tuple[int, int]:
    """A pipe whose numbers are none of 3 and 4."""
    ends = os.pipe()
    moved = [fcntl.fcntl(end, fcntl.F_DUPFD_CLOEXEC, 10) for end in ends]
    for end in ends:
        os.close(end)
    return moved[0], moved[1]
