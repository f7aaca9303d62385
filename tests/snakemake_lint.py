"""Runs `snakemake --lint` and fails on advice, but for that which does not fit a pip project of one entry file."""

import json
import subprocess
import sys

# Software is installed once, by pip; paths are absolute where the results folder is the user's choice.
UNFITTING = {
    "Missing software definition",
    "No log directive defined",
    "Do not access input and output files individually by index in shell commands",
}


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
            if lint["title"].split(":")[0].strip() not in UNFITTING:
                print(f"{part.get('name', 'Snakefile')}: {lint['title']}: {lint['body']}")
                left += 1
    return left


if __name__ == "__main__":
    sys.exit(min(main(), 1))
