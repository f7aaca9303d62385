"""Which failures may pass by themselves: of a training that is run again, and of one that would only fail again."""

import contextlib
import errno
from collections.abc import Iterator

from ..common.errors import PassingError

# What the programs behind a backend print where the device had no room or was not to be had: CUDA's and cuBLAS' own
# names of errors, and PyTorch's sentences.
WORDS = (
    "out of memory",
    "outofmemoryerror",
    "cudaerrormemoryallocation",
    "cuda_error_out_of_memory",
    "cublas_status_alloc_failed",
    "cudnn_status_alloc_failed",
    "busy or unavailable",
    "cannot allocate memory",
    "std::bad_alloc",
)
# Of the system: a network's file system or a busy device. A full disk is no such thing.
ERRORS = (errno.ENOMEM, errno.EAGAIN, errno.ESTALE, errno.ETIMEDOUT, errno.ENOLCK, errno.EBUSY)


def passes(text: str) -> bool:
    """Whether the last words of a program say that it may work another time."""
    return any(word in text.lower() for word in WORDS)


@contextlib.contextmanager
def named(what: str, work: str) -> Iterator[None]:
    """Turns a lack of memory, of the machine's or a device's, into PassingError: `what` did not have it for `work`."""
    try:
        yield
    except MemoryError:
        raise PassingError(f"{what} ran out of memory with {work}") from None
    except OSError as error:
        if error.errno not in ERRORS:
            raise
        raise PassingError(f"{what}: {error.strerror}" + (f": '{error.filename}'" if error.filename else "")) from None
    except RuntimeError as error:  # torch's, whose OutOfMemoryError is one; torch is not imported for its name
        if not passes(f"{type(error).__name__} {error}"):
            raise
        first = (str(error).strip().splitlines() or [""])[0]
        raise PassingError(f"{what} ran out of memory with {work}: {first[:200]}") from None
