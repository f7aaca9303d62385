"""The command group: finds commands by file, imports the one that is called, and turns errors into one line."""

import difflib
import errno
import os
import signal
import sys
import warnings

import click

from ... import __version__
from ...common import extras, plugins, terminal
from ...common.errors import PassingError, UserError, printable
from .. import _follow
from .._again import PASSING

PACKAGE = "workflow.commands"
FULL = (errno.ENOSPC, errno.EDQUOT)


class Commands(click.Group):
    """Commands by name; a module is imported only when its command runs or prints its own help."""

    def list_commands(self, context: click.Context) -> list[str]:
        return plugins.names(PACKAGE)

    def get_command(self, context: click.Context, name: str) -> click.Command | None:
        return plugins.load(PACKAGE, name).command if name in self.list_commands(context) else None

    def resolve_command(self, context: click.Context, args: list[str]):
        known = self.list_commands(context)
        if args and args[0] not in known:
            close = difflib.get_close_matches(args[0], known, n=1)
            hint = f"; did you mean '{close[0]}'?" if close else f" (there are: {', '.join(known)})"
            raise UserError(f"unknown command '{args[0]}'{hint}")
        return super().resolve_command(context, args)

    def format_commands(self, context: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Commands"):
            formatter.write_dl([(name, plugins.summary(PACKAGE, name)) for name in self.list_commands(context)])


@click.command(cls=Commands, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
@click.version_option(__version__, prog_name="viewbench")
def group() -> None:
    """Choose which views of a capture to train on, train scene models, and compare the ways of choosing."""


def run(arguments: list[str] | None = None) -> int:
    """Runs one command and returns the exit status.

    That is 0 or the command's, 2 for a user's mistake, 75 for what may work another time, 130 when stopped.
    """
    signal.signal(signal.SIGTERM, _stop)  # so that temporary files are removed on the way out
    if hasattr(signal, "SIGHUP") and signal.getsignal(signal.SIGHUP) == signal.SIG_DFL:  # and not under nohup
        signal.signal(signal.SIGHUP, _stop)
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:  # closed by who called
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115
    if not sys.warnoptions:  # of libraries, about what a file holds: what matters of it is said in a sentence
        for kind in (RuntimeWarning, UserWarning):
            warnings.simplefilter("ignore", kind)
    with terminal.guarded():
        return _run(arguments)


def _run(arguments: list[str] | None) -> int:
    try:
        _follow.follow()
        status = group.main(arguments, prog_name="viewbench", standalone_mode=False)
        sys.stdout.flush()
    except PassingError as error:
        return _fail(str(error), PASSING)
    except UserError as error:
        return _fail(str(error))
    except click.ClickException as error:
        return _fail(" ".join(error.format_message().split()))
    except ModuleNotFoundError as error:
        answer = extras.answer(error)
        if answer is None:
            raise
        return _fail(answer)
    except (KeyboardInterrupt, click.Abort):
        print("viewbench: stopped", file=sys.stderr)
        return 130
    except BrokenPipeError:  # the reader of our output has gone, as `| head` does
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except UnicodeEncodeError as error:
        name = str(error.object)[max(0, error.start - 40) : error.end + 40]
        return _fail(f"a name is no text that can be written: '{printable(name)}'; rename the file")
    except OSError as error:
        if error.errno is None:
            raise
        if error.errno in FULL:
            return _fail(f"{error.strerror}; make room for what is written, and run the same command again")
        return _fail(f"{error.strerror}: '{error.filename}'" if error.filename else str(error.strerror))
    return status or 0


def _fail(message: str, status: int = 2) -> int:
    print(f"viewbench: {printable(message)}", file=sys.stderr)
    return status


def _stop(number: int, frame: object) -> None:
    raise KeyboardInterrupt
