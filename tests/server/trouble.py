"""What happens to a server while a study is logged to it: restarts, kills, and answers that are lost."""

import random
import signal
import threading
import time
from collections import Counter
from collections.abc import Callable

from tests.reports.mlflow_server import Proxy, Server
from tests.server.postgres import Postgres

APART, APART_S = 120, 12.0  # requests and seconds between two restarts: in fewer no cell is logged from end to end
LOST = 0.07  # of the answers


class Trouble(threading.Thread):
    """Restarts and kills the server and its database, one after the other, while its body runs."""

    def __init__(self, server: Server, postgres: Postgres, proxy: Proxy):
        super().__init__(daemon=True)
        self.server, self.postgres, self.proxy = server, postgres, proxy
        self.over, self.done = threading.Event(), Counter[str]()
        self.failed: list[BaseException] = []

    def run(self) -> None:
        causes: dict[str, Callable[[], None]] = {
            "PostgreSQL restarted": lambda: self.postgres.control("restart", "-m", "fast"),
            "server SIGTERM": lambda: self.restart(signal.SIGTERM),
            "PostgreSQL crashed": lambda: self.postgres.control("restart", "-m", "immediate"),
            "server SIGKILL": lambda: self.restart(signal.SIGKILL),
        }
        try:
            while True:
                for name, cause in causes.items():
                    enough, soonest = self.asked() + APART, time.monotonic() + APART_S
                    while self.asked() < enough or time.monotonic() < soonest:
                        if self.over.wait(0.1):
                            return
                    cause()
                    self.done[name] += 1
        except BaseException as error:  # raised when the body has ended
            self.failed.append(error)

    def asked(self) -> int:
        with self.proxy.lock:
            return sum(self.proxy.requests.values())

    def restart(self, how: int) -> None:
        self.server.stop(how)
        self.server.start()

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
