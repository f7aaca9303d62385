"""The command line: `viewbench COMMAND`, one module of `workflow/commands` a command, imported when it is called."""

import sys


def main(arguments: list[str] | None = None) -> None:
    """Runs a command; a user's mistake ends in one line on stderr and exit status 2."""
    from .workflow.commands import _main

    sys.exit(_main.run(arguments))


if __name__ == "__main__":
    main()
