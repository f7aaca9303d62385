"""The command line: `viewbench COMMAND`, one module of `workflow/commands` a command, imported when it is called."""

import os
import sys


def main(arguments: list[str] | None = None) -> None:
    """Runs a command; a user's mistake ends in one line on stderr and exit status 2."""
    # Products of matrices are small here: more threads of OpenBLAS take several times as long, waiting for each other.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    if arguments is not None:  # of a caller in Python, whose process stays as it is
        from .workflow.commands import _main

        sys.exit(_main.run(arguments))
    from .workflow import _fork_client

    status = _fork_client.run(sys.argv[1:])
    if status is None:
        from .workflow import _again

        status = _again.run(sys.argv[1:])
    sys.exit(status)


if __name__ == "__main__":
    main()
