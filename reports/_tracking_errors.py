"""What an error of MLflow means for who logs to it, in one sentence without passwords."""

import os
import re
from enum import Enum
from typing import Any
from urllib.parse import unquote

from ..common.errors import UserError

NO_TRACKING = "tracking.uri is empty"  # why nothing is logged where nobody wants it
SECRETS = ("MLFLOW_TRACKING_PASSWORD", "MLFLOW_TRACKING_TOKEN")
SHORTEST = 4  # letters of a secret that is looked for in texts; a shorter one would take words apart
LONGEST = 300  # letters of MLflow's own words
AWAY_STATUS = (408, 429, 500, 502, 503, 504)  # what MLflow's own client tries again

UNTRUSTED = "CERTIFICATE_VERIFY_FAILED"  # of TLS
# What requests and urllib3 say in several hundred letters.
PLAIN = {
    r"too many (\d{3}) error responses": "it answers with error {0}",
    r"Connection refused": "nobody answers there (connection refused)",
    r"Failed to resolve|Name or service not known": "there is no computer of that name",
    r"(?i)timed out|timeout exception": "it did not answer in time",
    r"RemoteDisconnected|Connection aborted|Connection reset": "it ended the connection without an answer",
}


class Kind(Enum):
    """What to do after an error."""

    AWAY = "away"  # nobody answers, or it cannot at the moment: try again later
    REFUSED = "refused"  # it answers and wants none of this: ask the user
    CELL = "cell"  # it does not take this one run: go on with the others


def masked(text: str, uri: str = "") -> str:
    """The text without user names and passwords in addresses and without the secrets that MLflow is given."""
    text = re.sub(r"(?<=://)[^\s'\"]*@", "***@", text)  # a password of a database may have "/" and "@" in it
    secrets = {os.environ.get(name, "") for name in SECRETS}
    for password in re.findall(r"://[^:/\s]*:([^\s'\"]*)@", uri):
        secrets |= {password, unquote(password)}
    for secret in sorted(secrets, key=len, reverse=True):
        if len(secret) >= SHORTEST:
            text = text.replace(secret, "***")
    return text


class TroubledError(Exception):
    """A store answers, but not what it is asked about one cell."""


def errors() -> tuple[type[BaseException], ...]:
    """What MLflow raises for what it meets: its own, requests' and files' (OSError), for answers that are not JSON
    (ValueError), and where the driver of a database is not installed."""
    from alembic.util import CommandError
    from mlflow.exceptions import MlflowException
    from sqlalchemy.exc import SQLAlchemyError

    return MlflowException, SQLAlchemyError, CommandError, OSError, ValueError, ImportError, TroubledError


def kind(error: BaseException) -> Kind:
    """What to do about it."""
    from requests import RequestException

    if isinstance(error, (FileNotFoundError, TroubledError, UserError)):
        return Kind.CELL
    status = _status(error)
    if isinstance(error, (OSError, ValueError, ImportError)) and not isinstance(error, RequestException):
        return Kind.REFUSED
    if refuses_user(error) or UNTRUSTED in str(error) or _is_damage(str(error)) or _is_another(error, status):
        return Kind.REFUSED
    return Kind.AWAY if status is None or status in AWAY_STATUS else Kind.CELL


def refuses_user(error: BaseException) -> bool:
    """Whether the answer was that this user may not."""
    return _status(error) in (401, 403)


def words(error: BaseException, uri: str) -> str:
    """The error in a few words, and what can be done about it where that is known."""
    text, status = str(error), _status(error)
    if status in (401, 403):
        return (
            f"it refused the user ({status}); set MLFLOW_TRACKING_USERNAME and MLFLOW_TRACKING_PASSWORD, or "
            "MLFLOW_TRACKING_TOKEN"
        )
    if _is_damage(text):
        return f"the database is damaged ({_first_line(text, uri)}); move the file away, and all cells are logged anew"
    if UNTRUSTED in text:
        return "its certificate is not trusted; name the authority's file in MLFLOW_TRACKING_SERVER_CERT_PATH"
    if _is_another(error, status):
        return f"what answers there is no MLflow server ({_first_line(text, uri)})"
    if isinstance(error, ImportError):
        return f"Python's driver of this database is not installed ({_first_line(text, uri)})"
    for pattern, said in PLAIN.items():
        if found := re.search(pattern, text):
            return said.format(*found.groups())
    return _first_line(text, uri) or type(error).__name__


def _is_another(error: BaseException, status: int | None) -> bool:
    """Whether the answer is none of MLflow's."""
    from mlflow.exceptions import RestException

    return "valid JSON" in str(error) or (
        not isinstance(error, RestException) and (isinstance(error, ValueError) or status in (404, 405))
    )


def _status(error: BaseException) -> int | None:
    """The HTTP status of an error; None where there was no answer."""
    from mlflow.exceptions import MlflowException

    failed: Any = error
    answer = getattr(failed, "response", None)
    if answer is not None:
        return answer.status_code
    if not isinstance(failed, MlflowException):
        return None
    found = re.search(r"failed with error code (\d{3})", str(error))
    return int(found[1]) if found else failed.get_http_status_code()


def _is_damage(text: str) -> bool:
    """What SQLite says of a file that is none of its own or is broken."""
    return "file is not a database" in text or "disk image is malformed" in text


def _first_line(text: str, uri: str) -> str:
    return masked((text.strip().splitlines() or [""])[0], uri)[:LONGEST]
