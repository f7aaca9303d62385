"""What happens to a server while a study is logged to it: restarts, kills, and answers that are lost."""

import random
import signal
import threading
import time
from collections import Counter
from collections.abc import Callable

from tests.reports.mlflow_server import Proxy, Server
from tests.server.postgres import Postgres

APART, APART_S = 60, 6.0  # requests and seconds between two of these: in fewer no cell is logged from end to end
LOST = 0.07  # of the answers


class Trouble(threading.Thread):
    """Restarts and kills the server and its database, one after the other, while its body runs.

    In between it calls `killed`, where there is one, which kills a process that logs.
    """

    def __init__(self, server: Server, postgres: Postgres, proxy: Proxy, killed: Callable[[], None] | None = None):
        super().__init__(daemon=True)
        self.server, self.postgres, self.proxy = server, postgres, proxy
        self.killed, self.kills = killed, threading.Lock()
        self.over, self.done = threading.Event(), Counter[str]()
        self.failed: list[BaseException] = []

    def run(self) -> None:
        causes: dict[str, Callable[[], bool]] = {
            "PostgreSQL restarted": lambda: self.renew("fast"),
            "server SIGTERM": lambda: self.restart(signal.SIGTERM),
            "PostgreSQL crashed": lambda: self.renew("immediate"),
            "server SIGKILL": lambda: self.restart(signal.SIGKILL),
        }
        try:
            while True:
                for name, cause in causes.items():
                    for what, does in (("process killed", self.kill), (name, cause)):
                        enough, soonest = self.asked() + APART, time.monotonic() + APART_S
                        while self.asked() < enough or time.monotonic() < soonest:
                            if self.over.wait(0.1):
                                return
                        if does():
                            self.done[what] += 1
        except BaseException as error:  # raised when the body has ended
            self.failed.append(error)

    def kill(self) -> bool:
        with self.kills:
            if self.killed:
                self.killed()
            return self.killed is not None

    def spare(self) -> None:
        """No process is killed from now on."""
        with self.kills:
            self.killed = None

    def asked(self) -> int:
        with self.proxy.lock:
            return sum(self.proxy.requests.values())

    def restart(self, how: int) -> bool:
        self.server.stop(how)
        self.server.start()
        return True

    def renew(self, how: str) -> bool:
        self.postgres.control("restart", "-m", how)
        return True

    def __enter__(self) -> "Trouble":
        self.start()
        return self

    def __exit__(self, *error: object) -> None:
        self.over.set()
        self.join()
        if self.failed:
            raise self.failed[0]


def loses_some() -> Callable[[str, str], bool]:
    """LOST of the answers, always the same ones."""
    chance = random.Random(1)
    return lambda method, path: chance.random() < LOST
