"""viser server behind an access check of every request.

viser takes every page's websocket; it is given a socket of the loopback that is bound already, and the websocket of a
page of its own alone.
"""

from __future__ import annotations

import contextlib
import hmac
import http
import io
import logging
import os
import socket
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from http.cookies import CookieError, SimpleCookie
from typing import Any
from urllib.parse import parse_qs, urlsplit

from skyarm.records.files.packages import needs_extra

QUIET = "websockets.server"


class StudioError(ValueError):
    """Error if the studio cannot be opened, with a one-line message."""


def require_viser() -> None:
    """Raise an error unless viser is installed.

    Raises:
        StudioError: names the extra.
    """
    try:
        import viser  # noqa: F401
    except ImportError as error:
        raise StudioError(f"studio: {needs_extra('studio')} ({error})") from None


def listening_socket(port: int) -> socket.socket:
    """Open a listening socket on loopback; port 0 selects a free port.

    Raises:
        StudioError: the port is taken.
    """
    found = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    if os.name == "posix":  # elsewhere it lets two servers take one port
        found.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        found.bind((LOOPBACK[0], port))
        # who asks while libraries still load waits instead of being refused
        found.listen()
    except (OSError, OverflowError) as error:
        found.close()
        words = getattr(error, "strerror", None) or str(error)
        raise StudioError(f"--port = {port}: must be free ({words.lower()})") from None
    return found


def open_server(listening: socket.socket, guard: Guard, title: str) -> Any:
    """Start a viser server on a socket, with access check.

    Args:
        listening: bound.
        guard: access check.
        title: of the page.
    """
    require_viser()
    import viser
    import websockets.asyncio.server as module

    logging.getLogger(QUIET).setLevel(logging.CRITICAL)
    with _serving(module, listening, guard), _silent():
        return viser.ViserServer(host=LOOPBACK[0], port=guard.port, label=title, verbose=False)


def close_server(server: Any) -> None:
    """Stop a viser server and suppress its printed output."""
    with _silent():
        server.stop()


@contextlib.contextmanager
def _serving(module: Any, listening: socket.socket, guard: Guard) -> Iterator[None]:
    """Context manager that makes viser's websocket server use our socket and access check."""
    plain = module.serve

    def serve(handler: Callable[[Any], Any], _host: str, _port: int, **options: Any) -> Any:
        page = options.pop("process_request")

        def answer(connection: Any, request: Any) -> Any:
            headers = {name.title(): value for name, value in request.headers.raw_items()}
            websocket = headers.get("Upgrade", "").lower() == "websocket"
            refusal = guard.refusal(request.path, headers, websocket=websocket)
            if refusal is not None:
                return connection.respond(http.HTTPStatus.FORBIDDEN, f"403: {refusal}\n")
            response = page(connection, request)
            if response is not None:
                response.headers["Set-Cookie"] = guard.remember()
                response.headers["Referrer-Policy"] = "no-referrer"
                response.headers["X-Frame-Options"] = "DENY"
                response.headers["Connection"] = "close"
            return response

        options["max_size"] = MOST_BYTES
        return plain(handler, sock=listening, process_request=answer, **options)

    module.serve = serve
    try:
        yield
    finally:
        module.serve = plain


@contextlib.contextmanager
def _silent() -> Iterator[None]:
    """Context manager that suppresses what viser prints at start and stop."""
    with contextlib.redirect_stdout(io.StringIO()):
        yield


LOOPBACK = ("127.0.0.1", "localhost")

MOST_BYTES = 1 << 20
"""Of a frame: a page sends a slider's value or a camera, some hundred bytes."""


@dataclass(frozen=True, slots=True)
class Guard:
    """Access check of a server: host, origin and token of every request.

    Attributes:
        port: of the loopback that it listens at. token: that every request must bear.
    """

    port: int
    token: str

    @property
    def cookie(self) -> str:
        """Name of the cookie, with the port, since browsers do not separate cookies by port."""
        return f"skyarm_studio_{self.port}"

    def refusal(self, path: str, headers: Mapping[str, str], *, websocket: bool) -> str | None:
        """Text of the reason to refuse a request; None if it is allowed.

        Args:
            path: with its query.
            headers: by name.
            websocket: whether it asks for one; browsers send its page's ``Origin`` along, whatever the page wants.
        """
        host = headers.get("Host", "")
        if host not in {f"{name}:{self.port}" for name in LOOPBACK}:
            return "Host: must be the address that skyarm printed"
        origin = headers.get("Origin")
        if (origin is not None or websocket) and origin not in (f"http://{host}", f"https://{host}"):
            return "Origin: must be the page of skyarm itself"
        if not self._has_token(path, headers):
            return "token: must be that of the address that skyarm printed"
        return None

    def _has_token(self, path: str, headers: Mapping[str, str]) -> bool:
        """True if a request has the token, in its address or its cookie."""
        given = parse_qs(urlsplit(path).query).get("token", [])
        try:
            kept = SimpleCookie(headers.get("Cookie", "")).get(self.cookie)
        except CookieError:
            kept = None
        if kept is not None:
            given = [*given, kept.value]
        return any(hmac.compare_digest(each.encode(), self.token.encode()) for each in given)

    def remember(self) -> str:
        """``Set-Cookie`` value with the token, not readable by scripts and sent to this site only."""
        return f"{self.cookie}={self.token}; Path=/; HttpOnly; SameSite=Strict"

    def address(self) -> str:
        """Address to open in the user's browser, with the token."""
        return f"http://{LOOPBACK[0]}:{self.port}/?token={self.token}"
