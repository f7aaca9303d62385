"""Lets no name of a capture give orders to the terminal that it is shown on: escape sequences are written out."""

import contextlib
import sys
from collections.abc import Iterator
from typing import Any

KEPT = "\t\n\r"  # lines, and bars of progress that are drawn over
ORDERS = [*range(0x20), *range(0x7F, 0xA0), 0x200E, 0x200F, *range(0x202A, 0x202F), *range(0x2066, 0x206A)]
WRITTEN = {code: chr(code).encode("unicode_escape").decode("ascii") for code in ORDERS if chr(code) not in KEPT}


class Shown:
    """A text stream that writes control characters, and marks that turn the direction of writing, as `\\x1b`."""

    def __init__(self, stream: Any):
        self._stream = stream

    def write(self, text: str) -> int:
        """As that of the stream; what is returned counts the letters that were given."""
        self._stream.write(text.translate(WRITTEN))
        return len(text)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


@contextlib.contextmanager
def guarded() -> Iterator[None]:
    """Standard error, and standard output where it is a terminal, show what they would obey.

    Elsewhere standard output has names byte by byte, those that are not UTF-8 too: other programs read it.
    """
    before = sys.stdout, sys.stderr
    sys.stderr = Shown(sys.stderr)
    if sys.stdout.isatty():
        sys.stdout = Shown(sys.stdout)
    elif hasattr(sys.stdout, "reconfigure"):
        sys.stdout.reconfigure(errors="surrogateescape")
    try:
        yield
    finally:
        sys.stdout, sys.stderr = before
