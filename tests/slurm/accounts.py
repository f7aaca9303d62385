"""What Slurm counted: a line an allocation, and sums by what they were for."""

import re
import subprocess
from collections import defaultdict
from dataclasses import dataclass

FIELDS = ("JobID", "State", "ExitCode", "ElapsedRaw", "CPUTimeRAW", "TimelimitRaw", "MaxRSS", "AllocTRES", "Comment")
UNITS = {"": 1, "K": 1 << 10, "M": 1 << 20, "G": 1 << 30}
GROUP = re.compile(r"rule_(choices|cells)-")


@dataclass
class Allocation:
    """One job of Slurm's, its steps put together."""

    number: str
    state: str
    exit_code: str
    elapsed_s: int
    cpu_s: int  # allocated, used or not
    limit_minutes: int  # as asked for
    rss: float  # bytes, the most of its steps
    tres: str
    purpose: str  # group or rule

    @property
    def asked_mb(self) -> float:
        """Of memory."""
        found = re.search(r"mem=([\d.]+)([KMG]?)", self.tres)
        return float(found[1]) * UNITS[found[2] or "M"] / UNITS["M"] if found else 0.0


def allocations(environment: dict[str, str]) -> list[Allocation]:
    """All of the cluster's, in order, requeued and killed ones too."""
    command = ["sacct", "--allusers", "--duplicates", "--parsable2", "--noheader", f"--format={','.join(FIELDS)}"]
    command += ["--starttime=now-1day"]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True, timeout=60)
    found: list[Allocation] = []
    for line in done.stdout.splitlines():
        number, state, code, elapsed, cpu, limit, rss, tres, comment = line.split("|", len(FIELDS) - 1)
        if "." not in number:
            found.append(
                Allocation(number, state, code, int(elapsed), int(cpu), _minutes(limit), 0.0, tres, _purpose(comment))
            )
        elif rss and found:
            found[-1].rss = max(found[-1].rss, _bytes(rss))
    return found


def _purpose(comment: str) -> str:
    group = GROUP.match(comment)
    return group[1] if group else comment.removeprefix("rule_").partition("_wildcards_")[0]


def _minutes(text: str) -> int:
    return int(text) if text.isdigit() else 0


def _bytes(text: str) -> float:
    found = re.fullmatch(r"([\d.]+)([KMG]?)", text)
    return float(found[1]) * UNITS[found[2]] if found else 0.0


def table(found: list[Allocation]) -> str:
    """One line each."""
    lines = [f"{'job':>5} {'for':16} {'state':24} {'exit':5} {'seconds':>7} {'minutes':>7} {'RSS MB':>7}  resources"]
    for one in found:
        numbers = f"{one.elapsed_s:7} {one.limit_minutes:7} {one.rss / UNITS['M']:7.0f}"
        lines.append(f"{one.number:>5} {one.purpose:16} {one.state:24} {one.exit_code:5} {numbers}  {one.tres}")
    return "\n".join(lines)


def sums(found: list[Allocation]) -> str:
    """Allocations, CPU hours and the largest memory, asked for and used, by purpose."""
    by_purpose: dict[str, list[Allocation]] = defaultdict(list)
    for one in found:
        by_purpose[one.purpose].append(one)
    lines = [f"{'for':16} {'allocations':>11} {'not completed':>13} {'CPU hours':>9} {'RSS MB':>7} {'of MB':>7}"]
    for purpose, ones in [*sorted(by_purpose.items()), ("all", found)]:
        worst = max(ones, key=lambda one: one.rss, default=None)
        lines.append(
            f"{purpose:16} {len(ones):11} {sum(one.state != 'COMPLETED' for one in ones):13} "
            f"{sum(one.cpu_s for one in ones) / 3600:9.3f} {worst.rss / UNITS['M'] if worst else 0:7.0f} "
            f"{worst.asked_mb if worst else 0:7.0f}"
        )
    return "\n".join(lines)
