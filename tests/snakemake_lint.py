"""Runs `snakemake --lint` and fails on advice, but for that which does not fit a pip project of one entry file."""

import json
import subprocess
import sys

# Software is installed once, by pip, into the environment that runs Snakemake.
UNFITTING = {"Specify a conda environment or container for each rule."}


def main() -> int:
    """Prints the advice that is left and returns how much there is."""
    done = subprocess.run(
        [sys.executable, "-m", "snakemake", "--lint", "json"], capture_output=True, text=True, check=False
    )
    start = done.stdout.find("{")
    if start < 0:
        print(done.stdout + done.stderr)
        return 1
    advice = json.loads(done.stdout[start:])
    left = 0
    for part in [*advice.get("rules", []), *advice.get("snakefiles", [])]:
        for lint in part["lints"]:
            if lint["title"].strip().rstrip(":") not in UNFITTING:
                print(f"{part.get('name', 'Snakefile')}: {lint['title']} {lint['body']}")
                left += 1
    return left


if __name__ == "__main__":
    sys.exit(min(main(), 1))
