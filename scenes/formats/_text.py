"""Text files of numbers as people and tools write them: lines, tables and matrices."""

import re
from pathlib import Path

import numpy as np

from ...common import bounded, limits
from ...common.errors import UserError

BREAKS = ("\n", "\r", "\v", "\f", "\x1c", "\x1d", "\x1e", "\x85", "\u2028", "\u2029")  # as `splitlines` has them
NOT_A_NUMBER = re.compile(r"[+-]?1\.#\w+")  # how older C libraries on Windows print NaN and infinity


def lines(path: Path, what: str) -> list[tuple[int, str]]:
    """(number, text) of the lines that are neither empty nor a comment, which begins with `#`.

    A byte order mark and Windows line ends are no part of them. Raises UserError for a file that is missing, no text
    or beyond `limits`.
    """
    try:
        text = bounded.data(path, what, limits.TEXT_BYTES).decode("utf-8-sig")
    except UnicodeDecodeError:
        raise UserError(f"{what} '{path}' is no text file (UTF-8)") from None
    if sum(map(text.count, BREAKS)) > limits.LINES:
        raise UserError(f"{what} '{path}' has more than {limits.LINES:,} lines; thin it out")
    found = ((number, line.strip()) for number, line in enumerate(text.splitlines(), 1))
    kept = [(number, line) for number, line in found if line and not line.startswith("#")]
    long = next((number for number, line in kept if len(line) > limits.LINE_LETTERS), None)
    if long is not None:
        raise UserError(
            f"{what} '{path}', line {long} has more than {limits.LINE_LETTERS:,} letters; it is no such file"
        )
    return kept


def table(path: Path, what: str) -> tuple[np.ndarray, list[int]]:
    """(rows, columns) float64 of a text file of numbers, and the number of each row's line.

    Words are parted by spaces or commas, and `#` after a space begins a comment; a first line without any number in it
    is a heading. Raises UserError, which names the file and the line, when it is missing, empty or has something else
    in it.
    """
    rows: list[list[float]] = []
    kept: list[int] = []
    count = 0
    for number, line in lines(path, what):
        words = re.split(r"\s#", line)[0].replace(",", " ").split()
        row = [_number(word) for word in words]
        found = [value for value in row if value is not None]
        if not found and not rows:
            continue
        if len(found) < len(row):
            shown = bounded.quoted(path, words[row.index(None)], 40)
            raise UserError(f"{what} '{path}', line {number}: {shown} is no number")
        if rows and len(found) != len(rows[0]):
            raise UserError(
                f"{what} '{path}', line {number} has {len(found)} numbers, the line before it {len(rows[0])}; "
                "each row should have equally many"
            )
        count += len(found)
        if count > limits.NUMBERS:
            raise UserError(f"{what} '{path}' has more than {limits.NUMBERS:,} numbers; thin it out")
        rows.append(found)
        kept.append(number)
    if not rows:
        raise UserError(f"{what} '{path}' has no numbers")
    return np.array(rows), kept


def _number(word: str) -> float | None:
    try:
        return float(word)
    except ValueError:
        return float("nan") if NOT_A_NUMBER.fullmatch(word) else None


def numbers(path: Path, what: str) -> np.ndarray:
    """(rows, columns) float64 of a text file of numbers; as `table`, whose errors it raises."""
    return table(path, what)[0]


def matrix(path: Path, what: str) -> np.ndarray:
    """(4, 4) matrix in a text file. Raises UserError for another shape."""
    values = numbers(path, what)
    if values.size != 16:
        raise UserError(f"{what} '{path}' has {values.size} numbers, expected the 16 of a 4 x 4 matrix")
    return values.reshape(4, 4)
