"""The one error that a user can cause, and the way it reaches them."""


class UserError(Exception):
    """What was got, what was expected and what to do, in one sentence that names the file and the frame.

    The command line prints it as one line and exits with status 2; library callers catch it.
    """

    def __init__(self, message: str):
        super().__init__(" ".join(str(message).split()))


class PassingError(UserError):
    """What the machine refused for now (memory that another program has, a device that is busy) and may give later.

    A command that ends with it is run again some times (workflow/_again.py).
    """


def nearest(word: str, known) -> str:
    """`; did you mean 'x'?` for the known word nearest to `word`, or an empty string."""
    import difflib

    close = difflib.get_close_matches(word, list(known), n=1, cutoff=0.5)
    return f"; did you mean '{close[0]}'?" if close else ""
