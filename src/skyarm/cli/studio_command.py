"""Command ``skyarm studio``: interactive simulation, or replay of a measured flight, on
a local web page.
"""

from __future__ import annotations

import os
import secrets
import signal
import threading
import webbrowser
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from skyarm.cli.arguments import (
    Laws,
    Out,
    Scenario,
    law_names,
    name_completion,
    require_left_out,
)
from skyarm.cli.output import tell
from skyarm.records.files import require_writable
from skyarm.records.registry.registrations import function_of_option
from skyarm.view.studio.server import (
    LOOPBACK,
    AccessGuard,
    StudioError,
    ViserServer,
    close_server,
    listening_socket,
    open_server,
    require_viser,
)

if TYPE_CHECKING:
    from skyarm.view.studio.page_loop import PageLoop
    from skyarm.view.studio.replay import PredictionReplay

OF_SIMULATION, OF_REPLAY = ("--laws", "--out"), ("--horizon", "--delay", "--columns")
"""Options without effect, with and without ``--vehicle``."""


def studio(
    scenario: Scenario = "case2",
    laws: Laws = None,
    port: int = 8080,
    host: str = LOOPBACK[0],
    no_browser: bool = False,
    out: Out = "out/studio",
    vehicle: Annotated[str | None, name_completion("vehicle")] = None,
    horizon: float = 1.0,
    delay: float | None = None,
    columns: str | None = None,
) -> None:
    """Fly live on a page: sliders, gusts, laws side by side.

    The printed address contains a token. A saved flight is a log for 'skyarm run'. With
    --vehicle a measured flight is a ghost next to the flight of the model under the
    same commands.

    Options:
        scenario: a scenario file or a shipped name; with --vehicle a measured flight
        port: port of the page; 0 takes a free one
        host ADDRESS: address of this machine for other devices
        no_browser: print the address and open no browser
        out FOLDER: folder of saved flights
        vehicle: replay a measured flight next to this model under the recorded commands
        horizon: with --vehicle: time between resets to the measured state, s
        delay: with --vehicle: delay of the commands, s; the identified one if left out
        columns FILE: with --vehicle: meaning of its columns; if left out columns.toml
            next to it
    """
    if not 0 <= port <= 65535:
        raise StudioError(f"--port = {port}: must be from 0 to 65535")
    if vehicle is not None:
        require_left_out(OF_SIMULATION, " with --vehicle: no law flies in a replay")
        replay: PredictionReplay = function_of_option("studio --vehicle")(
            scenario, vehicle, horizon, delay, columns
        )

        def replay_page(server: ViserServer) -> PageLoop:
            from skyarm.view.studio.replay_page import ReplayPage

            return ReplayPage(server, replay)

        _serve(
            host,
            port,
            no_browser,
            f"skyarm studio: {replay.title}",
            lambda: replay_page,
        )
        return
    require_left_out(OF_REPLAY, " without --vehicle")
    names = law_names(laws)
    made = [
        # the folder is made to try it, and taken back until a flight is saved
        each
        for each in (Path(out), *Path(out).parents)
        if not os.path.lexists(each)
    ]
    folder = require_writable(out)
    for each in made:  # they come with the first flight that is saved
        each.rmdir()

    def simulation() -> Callable[[ViserServer], PageLoop]:
        from skyarm.view.studio.fleet import open_fleet
        from skyarm.view.studio.page import Page

        fleet = open_fleet(scenario, names)
        return lambda server: Page(server, fleet, names or [None], folder)

    _serve(host, port, no_browser, f"skyarm studio: {scenario}", simulation)


def _serve(
    host: str,
    port: int,
    no_browser: bool,
    title: str,
    prepare: Callable[[], Callable[[ViserServer], PageLoop]],
) -> None:
    """Serve a page until Ctrl-C.

    Args:
        host: address of this machine that the page has.
        port: port of the page; 0 takes a free one.
        no_browser: whether no browser is opened.
        title: title of the page.
        prepare: called once the port is taken; returns the function that makes the page
            on a server.
    """
    require_viser()
    # the port is taken before the flight is prepared, which takes seconds
    listening = listening_socket(port, host)
    try:
        page_on = prepare()
        # a token, because any page in the browser could send requests to this port
        guard = AccessGuard(
            int(listening.getsockname()[1]), secrets.token_hex(16), host
        )
        server = open_server(listening, guard, title)
    except BaseException:
        listening.close()
        raise
    try:
        page = page_on(server)
        tell(f"studio: {guard.address()}")
        if not no_browser:
            # a browser may block until it is closed
            threading.Thread(
                target=webbrowser.open, args=(guard.address(),), daemon=True
            ).start()
        with _ended_by(page):
            page.run()
    finally:
        close_server(server)
    tell("studio: closed")


@contextmanager
def _ended_by(page: PageLoop) -> Iterator[None]:
    """Context manager in which Ctrl-C and SIGTERM end the studio's loop in an orderly
    way.
    """
    usual = {each: signal.getsignal(each) for each in (signal.SIGINT, signal.SIGTERM)}
    for each in usual:
        signal.signal(each, lambda *_: page.stop())
    try:
        yield
    finally:
        for each, handler in usual.items():
            signal.signal(each, handler)
