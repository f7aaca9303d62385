"""The most memory that choosing, training and scoring take, by number of frames, beside the bound that tests hold.

    python tests/bench/bench_memory.py [--frames 300,1000,3000] [--size 1024x576] [--widths 256,512]

A capture of so many training views, and an eighth as many test views, is made of 8 JPEGs, which links share. Views
are chosen by maxmin with image content; all are trained on, for some steps with 2,000 Gaussians, at each width, and all
test views are scored. MiB of resident sets, of the command and all that it starts; the table is Markdown.
"""

import argparse
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from tests.large import GAUSSIANS, MIB, bound_bytes, capture, peak_bytes
from viewbench.backends import splat

DISTINCT, STEPS = 8, 20


def measured(folder: Path, frames: int, size: tuple[int, int], widths: list[int]) -> dict[str, tuple[int, int]]:
    """Peak and bound in bytes of each command, on a capture of so many views."""
    capture(folder / "room", frames, frames // 8, size, DISTINCT)
    found: dict[str, tuple[int, int]] = {}

    def note(row: str, pixels: int, command: str, *arguments: object) -> None:
        views = frames // 8 if command == "evaluate" else frames
        found[row] = peak_bytes(folder, command, *arguments), bound_bytes(command, views, pixels)
        print(f"{frames:5} {row:32} {found[row][0] / MIB:8.0f}", file=sys.stderr, flush=True)

    pixels = size[0] * size[1]
    note("select, a tenth by maxmin", pixels, "select", "room", "--ratio", 0.1, "--selection", "tenth.json")
    every = ("--selector", "uniform", "--ratio", 1, "--selection", "all.json")
    note("select, all", pixels, "select", "room", *every)
    how = ("--selection", "all.json", "--iterations", STEPS, "--set", f"gaussians={GAUSSIANS}")
    for width in widths:
        pixels = width * round(size[1] * width / size[0])
        note(f"train at {width} pixels", pixels, "train", "room", *how, "--width", width, "--out", f"{width}")
        note(f"evaluate at {width} pixels", pixels, "evaluate", f"{width}", "room", "--out", f"{width}")
    return found


def main() -> None:
    """Prints the table."""
    parser = argparse.ArgumentParser(description=str(__doc__).split("\n")[0])
    parser.add_argument("--frames", default="300,1000,3000")
    parser.add_argument("--size", default="1024x576")
    parser.add_argument("--widths", default="256,512")
    asked = parser.parse_args()
    counts, widths = ([int(part) for part in text.split(",")] for text in (asked.frames, asked.widths))
    width, height = map(int, asked.size.split("x"))
    splat.warm()
    table = {}
    for count in counts:
        with tempfile.TemporaryDirectory() as folder:
            table[count] = measured(Path(folder), count, (width, height), widths)
    print(f"| MiB at most, pictures of {asked.size} | {' | '.join(f'{count:,}' for count in counts)} | bound |")
    print(f"| --- |{' ---: |' * (len(counts) + 1)}")
    for row in table[counts[0]]:
        peaks = " | ".join(f"{table[count][row][0] / MIB:,.0f}" for count in counts)
        print(f"| {row} | {peaks} | {table[counts[-1]][row][1] / MIB:,.0f} |")


if __name__ == "__main__":
    main()
