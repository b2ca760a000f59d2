"""Command ``skyarm studio``: interactive simulation of a vehicle on a local web page."""

from __future__ import annotations

import os
import secrets
import signal
import threading
import webbrowser
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from skyarm.cli.arguments import Scenario
from skyarm.cli.output import tell
from skyarm.records.files import require_writable
from skyarm.view.studio.server import (
    Guard,
    StudioError,
    close_server,
    listening_socket,
    open_server,
    require_viser,
)

if TYPE_CHECKING:
    from skyarm.view.studio.page import Page


def studio(
    scenario: Scenario = "case2",
    controller: Annotated[
        list[str] | None,
        typer.Option(metavar="LAW", help="in place of the file's; up to three: repeat"),
    ] = None,
    port: Annotated[int, typer.Option(help="of the page; 0 takes a free one")] = 8080,
    no_browser: Annotated[bool, typer.Option("--no-browser", help="print the address, open nothing")] = False,
    out: Annotated[str, typer.Option("--out", help="folder of saved flights")] = "out/studio",
) -> None:
    """Fly live on a page: sliders, gusts, laws side by side.

    The address that is printed bears a token. A flight is saved as a log that 'skyarm run' flies again.
    """
    if not 0 <= port <= 65535:
        raise StudioError(f"--port = {port}: must be from 0 to 65535")
    made = [each for each in (Path(out), *Path(out).parents) if not os.path.lexists(each)]
    folder = require_writable(out)
    for each in made:  # they come with the first flight that is saved
        each.rmdir()
    require_viser()
    listening = listening_socket(port)
    try:
        from skyarm.view.studio.fleet import open_fleet
        from skyarm.view.studio.page import Page

        fleet = open_fleet(scenario, controller or [])
        guard = Guard(int(listening.getsockname()[1]), secrets.token_hex(16))
        server = open_server(listening, guard, f"skyarm studio: {scenario}")
    except BaseException:
        listening.close()
        raise
    try:
        page = Page(server, fleet, controller or [None], folder)
        tell(f"studio: {guard.address()}")
        if not no_browser:
            threading.Thread(target=webbrowser.open, args=(guard.address(),), daemon=True).start()
        with _ended_by(page):
            page.run()
    finally:
        close_server(server)
    tell("studio: closed")


@contextmanager
def _ended_by(page: Page) -> Iterator[None]:
    """Context manager in which Ctrl-C and SIGTERM end the studio's loop in an orderly way."""
    usual = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    for number in usual:
        signal.signal(number, lambda *_: page.stop())
    try:
        yield
    finally:
        for number, handler in usual.items():
            signal.signal(number, handler)
