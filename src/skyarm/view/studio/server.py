"""Viser server with access check of every request and filter of every received frame.

viser takes every page's websocket and every value, and opens a tunnel into the internet
where a frame requests it; it is given a socket that is bound already, and websockets
that pass allowed frames only.
"""

from __future__ import annotations

import errno
import hmac
import http
import io
import logging
import math
import os
import socket
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, redirect_stdout
from http.cookies import CookieError, SimpleCookie
from typing import TYPE_CHECKING, Any, TypeAlias
from urllib.parse import parse_qs, urlsplit

from skyarm.records.files import needs_extra, shown
from skyarm.records.immutable import positional

if TYPE_CHECKING:
    import viser
    from websockets.asyncio.server import ServerConnection
    from websockets.http11 import Request, Response

ViserServer: TypeAlias = "viser.ViserServer"
GuiApi: TypeAlias = "viser.GuiApi"
SceneApi: TypeAlias = "viser.SceneApi"
CameraNode: TypeAlias = "viser.CameraFrustumHandle"
Tab: TypeAlias = "viser.GuiTabHandle"
Menu: TypeAlias = "viser.GuiDropdownHandle[str]"
Series: TypeAlias = "viser.uplot.Series"
"""Types of viser, for modules that do not import it."""

Slider: TypeAlias = Any
"""Slider of viser; its own type declares the value as read-only, which is set here."""

QUIET = "websockets.server"


STYLE = """<style>
/* the unseen series of a plot */
.uplot .u-legend .u-series:last-child { display: none }
@media (max-width: 36em) {
  /* viser lays its controls over the lower 60 % of a phone's picture, 266 px wide */
  #root div:has(> div > div > [data-dock-root]) { flex-direction: column }
  #root div:has(> div > [data-dock-root]) {
    height: auto !important; min-height: 0; width: 100%
  }
  #root div:has(> div > [data-dock-root]) ~ .mantine-Paper-root {
    position: relative !important; width: 100% !important;
    max-height: 58% !important; flex-shrink: 0;
    .mantine-ScrollArea-content > div { width: 100% !important }
  }
  #root :is(
    .mantine-Button-root, .mantine-ActionIcon-root,
    .mantine-Input-input, .mantine-Tabs-tab
  ) {
    min-height: 40px !important; min-width: 40px !important;
  }
  #root .mantine-Slider-root { padding-block: 14px !important }
}
</style>"""
"""Style sheet of the page. On screens up to 36 em wide, as viser counts them, the
picture is above the controls, which are as large as a finger."""


Inputs: TypeAlias = "dict[str, ViserServer]"
"""Name "server" -> server with the sliders and buttons of the page; empty until it is
made."""


class StudioError(ValueError):
    """Error if the studio cannot be opened, with a one-line message."""


LOOPBACK = ("127.0.0.1", "localhost")

EVERYWHERE = ("", "0.0.0.0")
"""Names of all addresses of this machine, which no page can have."""


def require_viser() -> None:
    """Raise an error unless viser is installed.

    Raises:
        StudioError: names the extra.
    """
    try:
        # imported for its failure alone: without the extra the page cannot be made
        import viser  # noqa: F401
    except ImportError as error:
        raise StudioError(f"studio: {needs_extra('studio')} ({error})") from None


def listening_socket(port: int, host: str = LOOPBACK[0]) -> socket.socket:
    """Open a listening socket on an address of this machine, the loopback by default;
    port 0 selects a free port.

    Raises:
        StudioError: the port is taken, or the machine has no such address.
    """
    if host in EVERYWHERE:
        raise StudioError(
            f"--host = {shown(host)}: must be one address of this machine, as the"
            " page's address names it"
        )
    listening = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    if os.name == "posix":  # elsewhere it lets two servers take one port
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listening.bind((host, port))
        # who asks while libraries still load waits instead of being refused
        listening.listen()
    except (OSError, OverflowError) as error:
        listening.close()
        words = (getattr(error, "strerror", None) or str(error)).lower()
        if (
            isinstance(error, socket.gaierror)
            or getattr(error, "errno", None) == errno.EADDRNOTAVAIL
        ):
            raise StudioError(
                f"--host = {shown(host)}: must be an IPv4 address of this machine"
                f" ({words})"
            ) from None
        raise StudioError(f"--port = {port}: must be free ({words})") from None
    return listening


def open_server(
    listening: socket.socket, guard: AccessGuard, title: str
) -> ViserServer:
    """Start a viser server on a socket, with access check and frame filter.

    Args:
        listening: bound.
        guard: who may speak.
        title: title of the page.
    """
    require_viser()
    import viser
    import websockets.asyncio.server as module

    logging.getLogger(QUIET).setLevel(logging.CRITICAL)
    inputs: Inputs = {}
    # of what viser prints when it starts and stops nothing is wanted
    with _serving(module, listening, guard, inputs), redirect_stdout(io.StringIO()):
        server = viser.ViserServer(
            host=LOOPBACK[0], port=guard.port, label=title, verbose=False
        )
    inputs["server"] = server
    configure_theme(server, dark=False)
    return server


def configure_theme(server: Any, *, dark: bool) -> None:
    """Set the look of the page of all tabs: light or dark (``server.dark``), without
    viser's logo and tunnel.
    """
    server.dark = dark
    server.gui.configure_theme(show_logo=False, show_share_button=False, dark_mode=dark)


def close_server(server: ViserServer) -> None:
    """Stop a viser server and suppress the messages that it prints."""
    with redirect_stdout(io.StringIO()):
        server.stop()


@contextmanager
def _serving(
    module: Any, listening: socket.socket, guard: AccessGuard, inputs: Inputs
) -> Iterator[None]:
    """Context manager in which viser serves on a given socket, with access checks and a
    frame filter.
    """
    plain = module.serve

    def serve(
        handler: Callable[[Any], Any], _host: str, _port: int, **options: Any
    ) -> Any:
        page = options.pop("process_request")

        async def handle(connection: ServerConnection) -> None:
            assert connection.request is not None
            # there is one reader, so that all tabs look as the last one that was opened
            configure_theme(
                inputs["server"],
                dark=guard.wants_dark(connection.request.headers.get("Cookie", "")),
            )
            await handler(Sieve(connection, inputs))

        def answer(connection: ServerConnection, request: Request) -> Response | None:
            try:
                return respond(connection, request)
            except (ValueError, LookupError, OSError):
                # no address, a header twice, no text, a name beyond the disk's
                return connection.respond(
                    http.HTTPStatus.BAD_REQUEST, "400: must be a request of a browser\n"
                )

        def respond(connection: ServerConnection, request: Request) -> Response | None:
            websocket = request.headers.get("Upgrade", "").lower() == "websocket"
            # of a name that stands twice no one is asked
            first = {name: request.headers.get_all(name)[0] for name in request.headers}
            refusal = guard.refusal(
                request.path,
                {k.title(): v for k, v in first.items()},
                websocket=websocket,
            )
            if refusal is not None:
                return connection.respond(
                    http.HTTPStatus.FORBIDDEN, f"403: {refusal}\n"
                )
            # raises UnicodeEncodeError, a ValueError, for a key that websockets would
            # choke on
            request.headers.get("Sec-WebSocket-Key", "").encode("ascii")
            # a compressed body could not be given the page's script and style
            if "Accept-Encoding" in request.headers:
                del request.headers["Accept-Encoding"]
            response: Response | None = page(connection, request)
            if response is not None:
                if b"<head>" in response.body:
                    response.body = response.body.replace(
                        b"<head>", b"<head>" + (guard.script() + STYLE).encode(), 1
                    )
                    del response.headers["Content-Length"]
                    response.headers["Content-Length"] = str(len(response.body))
                response.headers["Set-Cookie"] = guard.remember()
                # the address holds the token, which no other site may learn; and no
                # other page may lay this one under its own buttons
                response.headers["Referrer-Policy"] = "no-referrer"
                response.headers["X-Frame-Options"] = "DENY"
                response.headers["Connection"] = "close"
            return response

        options["max_size"] = MOST_BYTES
        return plain(handle, sock=listening, process_request=answer, **options)

    # viser has no argument for a socket or a check, so what it calls is replaced while
    # it starts
    module.serve = serve
    try:
        yield
    finally:
        module.serve = plain


class Sieve:
    """Websocket wrapper that passes valid slider and camera messages, and drops all
    others.

    Args:
        connection: the websocket. inputs: "server" -> that of viser, with the sliders
            and buttons of the page.
    """

    def __init__(self, connection: ServerConnection, inputs: Inputs) -> None:
        self._connection = connection
        self._inputs = inputs

    def __getattr__(self, name: str) -> Any:
        return getattr(self._connection, name)

    async def recv(self) -> bytes:
        """Receive the next valid websocket message."""
        while True:
            frame = await self._connection.recv()
            passed = self.admit(frame)
            if passed is not None:
                return passed

    def admit(self, frame: Any) -> bytes | None:
        """Return a received message with slider values clipped to their limits; None to
        drop it.
        """
        import msgspec

        try:
            message = msgspec.msgpack.decode(frame)
            kind = message["type"]
            if kind == "ViewerCameraMessage":
                return frame if _is_camera(message) else None
            if (
                kind != "GuiUpdateMessage"
                or set(message) != {"type", "uuid", "updates"}
                or set(message["updates"]) != {"value"}
            ):
                return None
            value = self._value(message["uuid"], message["updates"]["value"])
        except (
            msgspec.DecodeError,
            KeyError,
            TypeError,
            ValueError,
            AttributeError,
            RecursionError,
        ):
            return None
        return msgspec.msgpack.encode({**message, "updates": {"value": value}})

    def _value(self, uuid: str, value: Any) -> Any:
        """Check the value of an input and clip it to the limits of its slider.

        Raises:
            ValueError, KeyError: it does not, or there is no such input.
        """
        # private names: viser has no public way from a message's identifier to its
        # input
        handle = self._inputs["server"].gui._gui_input_handle_from_uuid[uuid]
        current = handle._impl.value
        props = handle._impl.props
        # booleans and texts have no limits, but menus have options
        if isinstance(current, (bool, str)):
            options = getattr(props, "options", None)
            # 200 letters are chosen as the longest text
            if (
                type(value) is not type(current)
                or (options is not None and value not in options)
                or len(str(value)) > 200
            ):
                raise ValueError(value)
            return value
        if not _is_finite(value):
            raise ValueError(value)
        low, high = getattr(props, "min", None), getattr(props, "max", None)
        value = value if low is None else max(value, low)
        return type(current)(value if high is None else min(value, high))


CAMERA = {"wxyz": 4, "position": 3, "look_at": 3, "up_direction": 3}
SCALARS = ("fov", "near", "far", "image_height", "image_width")
"""Fields of a camera's frame, each with its number of components."""


def _is_camera(message: dict[str, Any]) -> bool:
    """True for a valid camera message: all fields with finite numbers of the right
    count.
    """
    vectors = all(
        type(message[name]) is list
        and len(message[name]) == count
        and all(map(_is_finite, message[name]))
        for name, count in CAMERA.items()
    )
    return (
        vectors
        and all(_is_finite(message[name]) for name in SCALARS)
        and set(message) == {"type", *CAMERA, *SCALARS}
    )


def _is_finite(value: object) -> bool:
    """True for a finite int or float."""
    return type(value) in (int, float) and math.isfinite(value)  # type: ignore[arg-type]


MOST_BYTES = 1 << 20
"""Largest size (bytes) of a frame; a slider's value or a camera takes some hundred."""


@positional
class AccessGuard:
    """Access rules of the studio's server: allowed host, origin and secret token.

    Attributes:
        port: port that it listens at. token: text that every request must bear.
        host: address of this machine that it listens at.
    """

    port: int
    token: str
    host: str = LOOPBACK[0]

    @property
    def cookie(self) -> str:
        """Name of the cookie that holds the token; it contains the port."""
        return f"skyarm_studio_{self.port}"

    def refusal(
        self, path: str, headers: Mapping[str, str], *, websocket: bool
    ) -> str | None:
        """Return the reason why a request is refused; None for an allowed request.

        Args:
            path: with its query.
            headers: by name.
            websocket: whether it asks for one; browsers send its page's ``Origin``
                along, whatever the page wants.
        """
        host = headers.get("Host", "")
        if host not in {
            f"{name}:{self.port}"
            for name in (LOOPBACK if self.host in LOOPBACK else (self.host,))
        }:
            return "Host: must be the address that skyarm printed"
        origin = headers.get("Origin")
        if (origin is not None or websocket) and origin not in (
            f"http://{host}",
            f"https://{host}",
        ):
            return "Origin: must be the page of skyarm itself"
        if not self._has_token(path, headers):
            return "token: must be that of the address that skyarm printed"
        return None

    def _has_token(self, path: str, headers: Mapping[str, str]) -> bool:
        """True if a request has the secret token in its address or cookie."""
        given = parse_qs(urlsplit(path).query).get("token", [])
        given = [*given, *_cookie(headers.get("Cookie", ""), self.cookie)]
        return any(
            # in constant time, so that answers do not tell how much of a guess was
            # right
            hmac.compare_digest(each.encode(), self.token.encode())
            for each in given
        )

    def remember(self) -> str:
        """Header that stores the secret token as a cookie in the browser."""
        return f"{self.cookie}={self.token}; Path=/; HttpOnly; SameSite=Strict"

    def script(self) -> str:
        """Script of the page that stores in a cookie whether its browser prefers dark
        pages.
        """
        dark = 'matchMedia("(prefers-color-scheme: dark)").matches'
        return (
            f'<script>document.cookie = "{self.cookie}_dark=" + {dark} + "; Path=/;'
            ' SameSite=Strict"</script>'
        )

    def wants_dark(self, cookies: str) -> bool:
        """True for cookies of a browser that prefers dark pages."""
        return _cookie(cookies, f"{self.cookie}_dark") == ["true"]

    def address(self) -> str:
        """Web address with the secret token, for the user's browser."""
        return f"http://{self.host}:{self.port}/?token={self.token}"


def _cookie(cookies: str, name: str) -> list[str]:
    """Value of a cookie in a header; empty without it."""
    try:
        cookie = SimpleCookie(cookies).get(name)
    except CookieError:
        cookie = None
    return [] if cookie is None else [cookie.value]
