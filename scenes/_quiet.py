"""Keeps what image libraries say of damaged files off the terminal: the reader says it, with the file's name."""

import contextlib
import functools
import os
import sys
import threading
from collections.abc import Iterator

_lock = threading.Lock()
_inside = 0  # threads
_kept = -1  # a copy of stderr, while they are


@functools.cache
def hush_pillow() -> None:
    """PIL warns of EXIF that is cut short and the like, once for each place in its code, without the file's name."""
    import logging
    import warnings

    logging.getLogger("PIL").addHandler(logging.NullHandler())
    warnings.filterwarnings("ignore", module=r"PIL\.")


@contextlib.contextmanager
def silenced(silent: bool) -> Iterator[None]:
    """Turns stderr away where `silent`: libtiff writes its errors there by itself, from C.

    Threads may be in it at the same time; the last one out turns stderr back.
    """
    global _inside, _kept
    if not silent:
        yield
        return
    with _lock:
        _inside += 1
        if _inside == 1:
            sys.stderr.flush()
            with contextlib.suppress(OSError):  # stderr is closed
                _kept = os.dup(2)
                nowhere = os.open(os.devnull, os.O_WRONLY)
                os.dup2(nowhere, 2)
                os.close(nowhere)
    try:
        yield
    finally:
        with _lock:
            _inside -= 1
            if not _inside and _kept >= 0:
                sys.stderr.flush()
                os.dup2(_kept, 2)
                os.close(_kept)
                _kept = -1
