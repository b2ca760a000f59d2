"""Who may speak to the page: the rules of a request and of a frame, apart from any server.

A page that a browser shows may ask any server of the same machine; what tells a foreign page is the ``Origin`` that
browsers send with a websocket, and what tells a foreign name for this machine is ``Host``. A token keeps out other
users of the machine: it comes with the address that the command prints, and stays in a cookie.
"""

from __future__ import annotations

import hmac
import ipaddress
from collections.abc import Mapping
from dataclasses import dataclass
from http.cookies import CookieError, SimpleCookie
from urllib.parse import parse_qs, urlsplit

LOOPBACK = ("127.0.0.1", "localhost", "[::1]")

MOST_BYTES = 1 << 20
"""Of a frame: a page sends a slider's value or a camera, some hundred bytes."""


@dataclass(frozen=True, slots=True)
class Guard:
    """Rules of one server.

    Attributes:
        host, port: that it listens at. token: that every request must bear.
    """

    host: str
    port: int
    token: str

    @property
    def cookie(self) -> str:
        """Name of the cookie: cookies do not tell ports apart."""
        return f"skyarm_studio_{self.port}"

    def refusal(self, path: str, headers: Mapping[str, str], *, websocket: bool) -> str | None:
        """Why a request is refused, in words; None where it may pass.

        Args:
            path: with its query.
            headers: by name.
            websocket: whether it asks for one; browsers send its page's ``Origin`` along, whatever the page wants.
        """
        host = headers.get("Host", "")
        if is_loopback(self.host) and host not in {f"{name}:{self.port}" for name in LOOPBACK}:
            return "Host: must be the address that skyarm printed"
        origin = headers.get("Origin")
        if (origin is not None or websocket) and origin not in (f"http://{host}", f"https://{host}"):
            return "Origin: must be the page of skyarm itself"
        if not self._token(path, headers):
            return "token: must be that of the address that skyarm printed"
        return None

    def _token(self, path: str, headers: Mapping[str, str]) -> bool:
        """Whether a request bears the token, in its address or its cookie."""
        given = parse_qs(urlsplit(path).query).get("token", [])
        try:
            kept = SimpleCookie(headers.get("Cookie", "")).get(self.cookie)
        except CookieError:
            kept = None
        if kept is not None:
            given = [*given, kept.value]
        return any(hmac.compare_digest(each.encode(), self.token.encode()) for each in given)

    def remember(self) -> str:
        """The header that lets a browser keep the token: no script reads it, no other site's page sends it."""
        return f"{self.cookie}={self.token}; Path=/; HttpOnly; SameSite=Strict"

    def address(self) -> str:
        """What a user opens."""
        shown = self.host if ":" not in self.host else f"[{self.host}]"
        return f"http://{shown}:{self.port}/?token={self.token}"


def is_loopback(host: str) -> bool:
    """Whether only this machine reaches an address."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False
