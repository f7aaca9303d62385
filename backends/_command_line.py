"""Command lines with {placeholders}, run as lists and never through a shell."""

import itertools
import socket
import string
from pathlib import Path
from typing import Any

from ..common.errors import UserError, nearest

TRAIN_PLACES = ("scene", "out", "seed", "iterations", "seconds", "width", "height", "views", "port")
RENDER_PLACES = ("cameras", "renders", "out", "seed", "iterations", "width", "height", "port")
OUTPUT_PLACES = ("name", "index", "out", "iterations")


def check_places(command: list[str], known: tuple[str, ...], where: str) -> None:
    """Raises UserError for a placeholder that is none of the known ones, and for a brace that opens nothing."""
    for part in command:
        try:
            parsed = list(string.Formatter().parse(part))
        except ValueError as error:
            raise UserError(f"{where}: '{part}': {error}; write a brace that is meant as {{{{ or }}}}") from None
        for _, place, _, conversion in parsed:
            if place is not None and (place not in known or conversion):
                raise UserError(
                    f"{where}: unknown placeholder {{{place}}}{nearest(place, known)} (known: {', '.join(known)})"
                )


def places_in(command: list[str]) -> set[str]:
    """Names between braces in a command line."""
    return {place for part in command for _, place, _, _ in string.Formatter().parse(part) if place}


def filled(command: list[str], values: dict[str, Any]) -> list[str]:
    """The command line with the values in the places of their names."""
    return [part.format(**values) for part in command]


def program(command: list[str]) -> str:
    """The program that a command line starts: behind `env` and the variables that it sets, where it begins so."""
    if Path(command[0]).name != "env":
        return command[0]
    return next(itertools.dropwhile(lambda part: "=" in part, command[1:]), command[0])


def free_port() -> int:
    """A TCP port of this machine that nobody listens on: programs that open one collide when two of them run."""
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return listener.getsockname()[1]
