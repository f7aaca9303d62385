"""How every kernel is compiled, and where the compiled ones are kept.

Whatever numba compiles goes through the decorators here, and nothing else imports numba: it reads its settings when it
is first imported. A module that uses them must be among SOURCES.
"""

import contextlib
import hashlib
import os
from pathlib import Path

from .files import user_cache
from .settings import PACKAGE

# Files with kernels, and with the constants and functions that are compiled into them.
SOURCES = (
    "common/kernels.py",
    "common/lanes.py",
    "common/lane_functions.py",
    "backends/_points/*.py",
    "backends/splat/*.py",
    "selectors/_coverage_kernels.py",
)


def sources() -> list[Path]:
    """The files of SOURCES, sorted."""
    return sorted(path for pattern in SOURCES for path in PACKAGE.glob(pattern))


def _prepare() -> None:
    """Settings that numba reads when it is first imported, unless the user has made them.

    Compiled kernels are kept in the user's cache folder, so that all jobs of a study share them. Its name has a hash
    of all sources: numba looks at the file of a kernel alone, and would keep one that inlines what another file has
    changed. Full-width vectors are allowed, which numba by default avoids on processors that have them (a quarter of
    the speed).
    """
    if "NUMBA_CACHE_DIR" not in os.environ:
        sha256 = hashlib.sha256(b"".join(path.read_bytes() for path in sources())).hexdigest()
        with contextlib.suppress(RuntimeError):  # no home: numba finds a place itself
            os.environ["NUMBA_CACHE_DIR"] = str(user_cache(f"numba-{sha256[:16]}"))
    if "NUMBA_CPU_FEATURES" not in os.environ and "NUMBA_CPU_NAME" not in os.environ:
        try:
            import llvmlite.binding as llvm

            features = llvm.get_host_cpu_features()
            features["prefer-256-bit"] = False
            os.environ["NUMBA_CPU_FEATURES"] = features.flatten()
            os.environ["NUMBA_CPU_NAME"] = llvm.get_host_cpu_name()
        except (ImportError, RuntimeError):
            pass


_prepare()

import numba.core.config  # noqa: E402
import numba.core.errors  # noqa: E402
import numba.core.types  # noqa: E402
import numba.core.typing.templates  # noqa: E402
import numba.extending  # noqa: E402

# In a process that was forked (workflow/_fork_server.py) numba was there before its settings.
numba.core.config.reload_config()

strict = numba.njit(cache=True)  # arithmetic as Python has it, in the order in which it is written
# In the order in which it is written too, so the same bits on every machine, but a division by zero gives infinity, and
# other threads are not kept waiting: loops without sums run as vectors.
exact = numba.njit(cache=True, error_model="numpy", boundscheck=False, nogil=True)
written = numba.njit(inline="always", error_model="numpy", boundscheck=False)  # inlined into such
