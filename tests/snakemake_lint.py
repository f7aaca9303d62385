"""Runs `snakemake --lint` and fails on advice, but for that which does not fit a project installed by pip."""

import re
import subprocess
import sys

# Software is installed once, by pip, into the environment that runs Snakemake.
UNFITTING = {"Specify a conda environment or container for each rule."}


def main() -> int:
    """Prints the advice that is left and returns how many pieces there are."""
    command = [sys.executable, "-m", "snakemake", "--lint"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    text = done.stdout + done.stderr
    given = [title.strip().rstrip(":") for title in re.findall(r"^ +\* (.+)$", text, re.MULTILINE)]
    left = [title for title in given if title not in UNFITTING]
    if left or (done.returncode and not given):
        print(text)
    return len(left) or (1 if done.returncode and not given else 0)


if __name__ == "__main__":
    sys.exit(min(main(), 1))
