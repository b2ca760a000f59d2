"""A tab of the studio's page without a browser: viser's protocol over a plain
websocket.
"""

from __future__ import annotations

import http.client
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import msgspec
import viser
import zstandard
from websockets.sync.client import ClientConnection, connect

from skyarm.view.studio.fleet import Fleet
from skyarm.view.studio.page import Page
from skyarm.view.studio.server import (
    AccessGuard,
    close_server,
    listening_socket,
    open_server,
)

CAMERA = {
    "type": "ViewerCameraMessage",
    "wxyz": [1.0, 0.0, 0.0, 0.0],
    "position": [1.0, 1.0, 1.0],
    "fov": 1.0,
    "near": 0.01,
    "far": 100.0,
    "image_height": 600,
    "image_width": 800,
    "look_at": [0.0, 0.0, 0.0],
    "up_direction": [0.0, 0.0, 1.0],
}


TOKEN = "0123456789abcdef"


class Open:
    """A page that is open.

    Args:
        folder: of saved flights. source: name or file of the scenario. laws: laws of
            the flights.
    """

    def __init__(self, folder: Path, source: str, laws: Sequence[str | None]) -> None:
        listening = listening_socket(0)
        self.port = listening.getsockname()[1]
        self.server = open_server(listening, AccessGuard(self.port, TOKEN), "test")
        self.page = Page(self.server, Fleet(source), laws, folder)
        self.thread = threading.Thread(target=self.page.run)
        self.thread.start()

    def close(self) -> None:
        """End the page's loop and its server."""
        self.page.stop()
        self.thread.join(10.0)
        close_server(self.server)

    def get(self, path: str, **headers: str) -> tuple[int, bytes, str]:
        """Status, content and cookie of an answer."""
        client = http.client.HTTPConnection("127.0.0.1", self.port, timeout=20)
        client.request("GET", path, headers=headers)
        answer = client.getresponse()
        found = answer.status, answer.read(), answer.getheader("Set-Cookie") or ""
        client.close()
        return found


class Tab:
    """A tab that says what it shows.

    Args:
        port: of the page. token: in the cookie; None sends none.
        origin: of the page that opens the websocket; None sends none.
        more: further cookies of the browser.
    """

    def __init__(
        self, port: int, token: str | None, origin: str | None = "own", more: str = ""
    ) -> None:
        own = f"http://127.0.0.1:{port}"
        headers = (
            {} if token is None else {"Cookie": f"skyarm_studio_{port}={token}{more}"}
        )
        self.socket: ClientConnection = connect(
            f"ws://127.0.0.1:{port}/",
            origin=own if origin == "own" else origin,  # type: ignore[arg-type]
            additional_headers=headers,
            subprotocols=[f"viser-v{viser.__version__}"],  # type: ignore[list-item]
            max_size=None,
            open_timeout=20,
            close_timeout=0.2,
        )
        self.props: dict[str, dict[str, Any]] = {}
        self.kinds: dict[str, str] = {}
        self.nodes: dict[str, dict[str, Any]] = {}
        self.dark: bool | None = None
        self.send(CAMERA)

    def send(self, message: dict[str, Any]) -> None:
        """Send a frame as the page's own code does."""
        self.socket.send(msgspec.msgpack.encode(message))

    def move(self, uuid: str, value: Any) -> None:
        """Give an input a value."""
        self.send(
            {"type": "GuiUpdateMessage", "uuid": uuid, "updates": {"value": value}}
        )

    def listen(self, until: Callable[[Tab], bool], seconds: float = 120.0) -> None:
        """Take in what the page is told until something holds.

        Raises:
            TimeoutError: it did not in time.
        """
        end = time.monotonic() + seconds
        while not until(self):
            left = end - time.monotonic()
            if left <= 0.0:
                raise TimeoutError(self.status())
            frame = self.socket.recv(timeout=left)
            assert isinstance(frame, bytes)
            length = int.from_bytes(frame[8:16], "little")
            text = zstandard.ZstdDecompressor().decompress(frame[16 : 16 + length])
            for message in msgspec.msgpack.decode(text)["messages"]:
                self._take(message)

    def _take(self, message: dict[str, Any]) -> None:
        kind = message["type"]
        if kind == "GuiUpdateMessage":
            self.props.setdefault(message["uuid"], {}).update(message["updates"])
        elif kind.startswith("Gui") and "props" in message:
            self.kinds[message["uuid"]] = kind
            self.props[message["uuid"]] = {
                **message["props"],
                "value": message.get("value"),
            }
        elif kind == "GuiRemoveMessage":
            self.props.pop(message["uuid"], None)
        elif kind == "ThemeConfigurationMessage":
            self.dark = message["dark_mode"]
        elif kind in ("SetPositionMessage", "SetOrientationMessage"):
            self.nodes.setdefault(message["name"], {})[kind] = message.get(
                "position", message.get("wxyz")
            )

    def find(self, word: str) -> str:
        """The input whose hint, label or options contain a word."""
        return next(
            uuid
            for uuid, props in self.props.items()
            if word
            in f"{props.get('hint')} {props.get('label')} {props.get('options')}"
        )

    def has(self, word: str) -> bool:
        """Whether there is such an input."""
        return any(
            word in f"{p.get('hint')} {p.get('label')} {p.get('options')}"
            for p in self.props.values()
        )

    def status(self) -> str:
        """What the page says in words."""
        texts = [
            str(props.get("content", props.get("_markdown", "")))
            for props in self.props.values()
        ]
        return next((text for text in texts if " s, " in text), "")

    def forget(self) -> None:
        """Forget what the page has said in words: what comes next is news."""
        for props in self.props.values():
            props.pop("_markdown", None)

    def error(self, law: str) -> float:
        """Tip error of a law as the page says it, mm; NaN before it does."""
        for line in self.status().splitlines():
            _, found, words = line.partition(f" {law}: tip error ")
            if found:
                return float(words.split()[0])
        return float("nan")

    def close(self) -> None:
        """Close the tab."""
        self.socket.close()
