"""Whether MLflow was away a moment ago: then hundreds of jobs need not each wait for it."""

import time
from pathlib import Path

from ..common.errors import UserError
from ..common.files import read_json, write_json

AGAIN_S = 120.0  # after which one job tries anew


class Away:
    """A file beside the logs of a study, shared by its jobs on all machines, that is there while MLflow is away."""

    def __init__(self, results: Path, address: str):
        """`results` is results/STUDY, `address` where runs are logged to, without a password."""
        self.path, self.address = results / "logs" / "track" / "away.json", address

    def since_s(self) -> float | None:
        """Seconds since a job last found nobody; None where one may try, which is taken as trying.

        When AGAIN_S are over the first that asks is let through, and the others wait on.
        """
        try:
            # The file's clock and this machine's may differ, by less than AGAIN_S.
            age_s = abs(time.time() - self.path.stat().st_mtime)
            if read_json(self.path).get("address") != self.address:
                return None
            if age_s < AGAIN_S:
                return age_s
            self.path.touch()
        except (OSError, UserError, AttributeError):  # not there, or removed by one that found MLflow again
            pass
        return None

    def says(self, reason: str) -> None:
        """Nobody was there."""
        write_json(self.path, {"address": self.address, "reason": reason})

    def over(self) -> None:
        """It answers again."""
        self.path.unlink(missing_ok=True)
