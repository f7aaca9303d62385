"""A web server for the tests of downloads, which gives parts of files and misbehaves on purpose, request by request."""

import contextlib
import re
import ssl
import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

PAGE = b"<!DOCTYPE html><html><head><title>Log in to  the network</title></head><body>no</body></html>"


@dataclass
class Served:
    """A file; `faults` are taken in turn, one a request: (name, value). `always` is one for all further requests."""

    data: bytes
    etag: str = '"1"'
    ranges: bool = True
    modified: str = ""
    headers: dict[str, str] = field(default_factory=dict)
    faults: list[tuple] = field(default_factory=list)
    always: tuple | None = None


@dataclass(frozen=True)
class Asked:
    """What was asked, and how many bytes of a body went out."""

    path: str
    range: str
    if_range: str
    sent: int


class Server:
    """Runs on a port of its own until `close`; `asked` is all that was asked of it."""

    def __init__(self, certificate: Path | None = None) -> None:
        self.files: dict[str, Served] = {}
        self.asked: list[Asked] = []
        self.released = threading.Event()  # ends what stalls
        self.stalled = threading.Event()
        server = self

        class Handler(BaseHTTPRequestHandler):
            protocol_version = "HTTP/1.1"

            def do_GET(self) -> None:
                server._answer(self)

            def end_headers(self) -> None:
                self.send_header("Connection", "close")
                super().end_headers()

            def log_message(self, format: str, *args: Any) -> None:
                pass

        self._http = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self._http.daemon_threads = True
        self.scheme = "https" if certificate else "http"
        if certificate:
            context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
            context.load_cert_chain(certificate)
            self._http.socket = context.wrap_socket(self._http.socket, server_side=True)
        self.port = self._http.server_address[1]
        threading.Thread(target=self._http.serve_forever, args=(0.02,), daemon=True).start()

    def close(self) -> None:
        self.released.set()
        self._http.shutdown()
        self._http.server_close()

    def url(self, path: str) -> str:
        return f"{self.scheme}://127.0.0.1:{self.port}{path}"

    def serve(self, path: str, data: bytes, **given: Any) -> Served:
        self.files[path] = Served(data, **given)
        return self.files[path]

    def of(self, path: str) -> list[Asked]:
        return [asked for asked in self.asked if asked.path == path]

    def sent(self, path: str) -> int:
        return sum(asked.sent for asked in self.of(path))

    def _answer(self, handler: Any) -> None:
        path = re.sub(r"^http://[^/]*", "", handler.path)  # a proxy is asked for the whole address
        served = self.files.get(path)
        handler.close_connection = True
        sent = 0
        said = {name: handler.headers.get(name, "") for name in ("Range", "If-Range")}
        try:
            if served is None:
                handler.send_error(404)
                return
            fault, value = (served.faults.pop(0) if served.faults else served.always or ("", None))[:2]
            if callable(fault):
                fault(served)
                fault = ""
            sent = self._send(handler, served, said, fault, value)
        except (BrokenPipeError, ConnectionResetError):
            pass
        finally:
            self.asked.append(Asked(handler.path, said["Range"], said["If-Range"], sent))

    def _send(self, handler: Any, served: Served, said: dict[str, str], fault: str, value: Any) -> int:
        if fault == "status":
            handler.send_response(value)
            handler.send_header("Content-Length", "0")
            handler.send_header("Retry-After", "0")
            handler.end_headers()
            return 0
        if fault == "redirect":
            handler.send_response(302)
            handler.send_header("Location", value)
            handler.send_header("Content-Length", "0")
            handler.end_headers()
            return 0
        if fault == "page":
            handler.send_response(200)
            handler.send_header("Content-Type", "text/html")
            handler.send_header("Content-Length", str(len(PAGE)))
            handler.end_headers()
            handler.wfile.write(PAGE)
            return len(PAGE)
        data, size = served.data, len(served.data)
        match = re.fullmatch(r"bytes=(\d+)-(\d*)", said["Range"])
        fresh = said["If-Range"] in ("", served.etag, served.modified)
        if match and served.ranges and fresh and fault != "whole":
            first, last = int(match[1]), min(int(match[2] or size - 1), size - 1)
            if first >= size:
                handler.send_response(416)
                handler.send_header("Content-Range", f"bytes */{size}")
                handler.send_header("Content-Length", "0")
                handler.end_headers()
                return 0
            body = data[first : last + 1]
            shift = value if fault == "other_range" else 0
            handler.send_response(206)
            handler.send_header("Content-Range", f"bytes {first + shift}-{last + shift}/{size}")
        else:
            body = data
            handler.send_response(200)
        for name, text in served.headers.items():
            handler.send_header(name, text)
        if served.etag:
            handler.send_header("ETag", served.etag)
        if served.modified:
            handler.send_header("Last-Modified", served.modified)
        handler.send_header("Content-Length", str(len(body) + (value if fault == "length" else 0)))
        handler.end_headers()
        if fault == "flip":
            body = body[:value] + bytes([body[value] ^ 1]) + body[value + 1 :] if value < len(body) else body
        if fault in ("break", "stall"):
            handler.wfile.write(body[:value])
            handler.wfile.flush()
            if fault == "stall":
                self.stalled.set()
                self.released.wait(60)
            with contextlib.suppress(OSError):
                handler.connection.shutdown(2)
            return min(value, len(body))
        handler.wfile.write(body)
        return len(body)


def becomes(data: bytes, etag: str) -> tuple[Callable[[Served], None], None]:
    """A fault: from this request on the file is another one."""

    def change(served: Served) -> None:
        served.data, served.etag = data, etag

    return (change, None)
