"""The one error that a user can cause, and the way it reaches them."""

LONGEST = 4000  # letters of a message: names and values of a file may be of any length


def printable(text: str) -> str:
    """The text with what a terminal would obey and not show (escape sequences, line breaks, marks that turn the
    direction of writing) and what is no text (lone surrogates) as Python writes them: `\\x1b`."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode("ascii") for c in text)


class UserError(Exception):
    """What was got, what was expected and what to do, in one sentence that names the file and the frame.

    The command line prints it as one line and exits with status 2; library callers catch it.
    """

    def __init__(self, message: str):
        text = printable(" ".join(str(message).split()))
        super().__init__(text if len(text) <= LONGEST else f"{text[: LONGEST - 1000]} … {text[-1000:]}")


def nearest(word: str, known) -> str:
    """`; did you mean 'x'?` for the known word nearest to `word`, or an empty string."""
    import difflib

    close = difflib.get_close_matches(word, list(known), n=1, cutoff=0.5)
    return f"; did you mean '{close[0]}'?" if close else ""
