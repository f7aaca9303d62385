"""Asks a web server for a file or a part of one, and says what is temporary, what is final and what is no file at all.

The standard library's urllib: it respects http_proxy, https_proxy and no_proxy, follows redirects, checks certificates,
and costs the base install nothing. What a download manager needs beyond it (retries, resuming, checks) is here.
"""

import contextlib
import http.client
import re
import ssl
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

from ... import __version__
from ...common.errors import UserError

CHUNK = 1 << 18  # bytes read at once
PASSING = (408, 425, 429, 500, 502, 503, 504)  # statuses that another try may not meet
SIGNATURES = {"zip": (b"PK\x03\x04", b"PK\x05\x06"), "tgz": (b"\x1f\x8b",)}
KINDS = {".zip": "zip", ".tgz": "tgz", ".tar.gz": "tgz"}


@dataclass(frozen=True)
class Patience:
    """How long a server is waited for; `tries` are those in a row that brought nothing."""

    timeout: float = 30.0  # seconds without a byte
    tries: int = 6
    pause: float = 1.0  # seconds before the second try, doubled before each further one
    longest: float = 60.0  # pause


class TemporaryError(Exception):
    """What another try may not meet; `wait` is how many seconds the server asks for."""

    def __init__(self, reason: str, wait: float = 0.0):
        super().__init__(reason)
        self.wait = wait


class Tries:
    """Counts the tries in a row that brought nothing, and pauses between them."""

    def __init__(self, address: str, patience: Patience):
        self.address, self.patience, self.failed = address, patience, 0

    def progress(self) -> None:
        """A byte came."""
        self.failed = 0

    def failure(self, error: TemporaryError) -> None:
        """Pauses before the next try. Raises UserError when there were enough."""
        self.failed += 1
        if self.failed >= self.patience.tries:
            raise UserError(
                f"'{self.address}': {error}, {self.failed} times in a row; what came is kept, and the same command "
                "goes on from there"
            )
        pause = min(self.patience.pause * 2 ** (self.failed - 1), self.patience.longest)
        time.sleep(max(pause, min(error.wait, self.patience.longest)))


@dataclass(frozen=True)
class Range:
    """What a response says of the part that it holds: first byte, last byte, length of the whole (None if unsaid)."""

    first: int
    last: int
    total: int | None


class _Redirects(urllib.request.HTTPRedirectHandler):
    """Follows redirects, but not from https to something that anybody on the way can change."""

    def redirect_request(self, req: Any, fp: Any, code: int, msg: str, headers: Any, newurl: str) -> Any:
        if req.full_url.startswith("https:") and not newurl.startswith("https:"):
            raise UserError(f"'{req.full_url}' redirects to '{newurl}', which is not encrypted; not followed")
        return super().redirect_request(req, fp, code, msg, headers, newurl)


def ask(address: str, headers: dict[str, str], patience: Patience) -> Any:
    """The response to one try, opened, its body not read.

    Status 416 (no such range) is a response too. Raises TemporaryError for what may pass and UserError for what does
    not: an address that is not there or forbidden, a certificate that is not trusted.
    """
    said = {"User-Agent": f"viewbench/{__version__}", "Accept-Encoding": "identity", **headers}
    try:
        opener = urllib.request.build_opener(_Redirects)
        return opener.open(urllib.request.Request(address, headers=said), timeout=patience.timeout)
    except urllib.error.HTTPError as error:
        if error.code == 416:
            return error
        with error:
            if error.code in PASSING:
                raise TemporaryError(f"the server answers {error.code} {error.reason}", _wait(error)) from None
            raise UserError(
                f"'{address}': the server answers {error.code} {error.reason}; the data set's own page says where it "
                "is now (`viewbench download --list`)"
            ) from None
    except urllib.error.URLError as error:
        if isinstance(error.reason, ssl.SSLCertVerificationError):
            raise UserError(
                f"'{address}': the server's certificate is not trusted ({error.reason.verify_message})"
            ) from None
        raise TemporaryError(
            f"it cannot be reached ({error.reason}; is there a network, and does it want a proxy?)"
        ) from None
    except (OSError, http.client.HTTPException) as error:
        raise TemporaryError(_words(error)) from None
    except ValueError as error:
        raise UserError(f"'{address}' is no address: {error}") from None


def _wait(error: Any) -> float:
    text = error.headers.get("Retry-After", "") if error.headers else ""
    return float(text) if re.fullmatch(r"\d+", text) else 0.0


def _words(error: BaseException) -> str:
    if isinstance(error, TimeoutError):
        return "the server says nothing any more"
    return f"the connection broke off ({str(error) or type(error).__name__})"


def read(response: Any, count: int) -> bytes:
    """At most `count` bytes of the body, as they come, none at its end.

    Raises TemporaryError where the connection breaks off, and what came before is not lost with it.
    """
    try:
        return response.read1(count)
    except (OSError, http.client.HTTPException, ValueError) as error:
        raise TemporaryError(_words(error)) from None


def head(response: Any, count: int) -> bytes:
    """The first `count` bytes of the body, fewer where it is shorter. Raises TemporaryError where it breaks off."""
    found = b""
    while len(found) < count and (piece := read(response, count - len(found))):
        found += piece
    announced = length_of(response)
    if announced is not None and len(found) < min(count, announced):
        raise TemporaryError("the server closed the connection early")
    return found


@contextlib.contextmanager
def closing(response: Any) -> Iterator[Any]:
    """Closes the response; a body that was not read to its end takes its connection with it."""
    try:
        yield response
    finally:
        with contextlib.suppress(OSError, http.client.HTTPException):
            response.close()


def length_of(response: Any) -> int | None:
    """Content-Length, None where there is none that is a number."""
    text = response.headers.get("Content-Length", "")
    return int(text) if re.fullmatch(r"\d+", text.strip()) else None


def range_of(response: Any) -> Range | None:
    """Content-Range of a part, None for a response that is none (whatever it claims to be)."""
    match = re.fullmatch(r"bytes (\d+)-(\d+)/(\d+|\*)", response.headers.get("Content-Range", "").strip())
    if response.status != 206 or not match:
        return None
    return Range(int(match[1]), int(match[2]), None if match[3] == "*" else int(match[3]))


def validators(response: Any) -> dict[str, str]:
    """ETag and Last-Modified, by which a server and we tell whether a file is still the same."""
    return {name: text for name in ("ETag", "Last-Modified") if (text := response.headers.get(name, ""))}


def same_file(now: dict[str, str], then: dict[str, str]) -> bool:
    """Whether what both say is the same; a server may say less about a part than about the whole."""
    return all(now[name] == then[name] for name in now.keys() & then.keys())


def if_range(then: dict[str, str]) -> dict[str, str]:
    """The header that asks for the part only if the file is still the same; a weak ETag may not stand in it."""
    etag = then.get("ETag", "")
    validator = etag if etag and not etag.startswith("W/") else then.get("Last-Modified", "")
    return {"If-Range": validator} if validator else {}


def kind_of(address: str) -> str | None:
    """ "zip" or "tgz" by the end of an address or a file's name; None for anything else."""
    path = address.split("?")[0].lower()
    return next((kind for suffix, kind in KINDS.items() if path.endswith(suffix)), None)


def check_signature(head: bytes, address: str, kind: str | None) -> None:
    """Raises UserError when a file's first bytes are no archive's, and says what they are instead."""
    if kind is None or head.startswith(SIGNATURES[kind]):
        return
    page = page_title(head)
    if page is not None:
        raise UserError(
            f"'{address}' answers with a web page{page} instead of the archive: a network that wants you to log in, or "
            "a server that has had enough; open the address in a browser to see"
        )
    raise UserError(
        f"'{address}' is no {kind} archive: it starts with {head[:8]!r}; it is not what the catalogue means"
    )


def page_title(head: bytes) -> str | None:
    """` ("title")` of a web page, an empty string where it has none, None where it is no web page."""
    text = head[:4096].decode("utf-8", "replace").lstrip("\ufeff \t\r\n")
    if not re.match(r"<(!doctype|html|head|\?xml)", text, re.IGNORECASE):
        return None
    match = re.search(r"<title[^>]*>\s*(.*?)\s*</title>", text, re.IGNORECASE | re.DOTALL)
    return f' ("{" ".join(match[1].split())[:80]}")' if match else ""


Progress = Callable[[int, int | None], None]  # bytes that are there, and of how many
