"""The page over its own protocol, without a browser: who may speak, what a frame can
do, and what a slider moves.
"""

import http.client
import math
import os
import random
import socket
import sys
import threading
import time
from collections.abc import Iterator

import msgspec
import pytest
from tab import CAMERA, TOKEN, Open, Tab
from websockets.exceptions import ConnectionClosed, InvalidStatus

from skyarm.view.studio.fleet import Fleet
from skyarm.view.studio.picture import COLORS
from skyarm.view.studio.server import (
    AccessGuard,
    close_server,
    listening_socket,
    open_server,
)
from support.commands import refused, skyarm


@pytest.fixture(scope="module")
def shown(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Open]:
    page = Open(tmp_path_factory.mktemp("studio"), "case2", ["paper_ct", "paper_pd"])
    try:
        yield page
    finally:
        page.close()


@pytest.fixture
def tab(shown: Open) -> Iterator[Tab]:
    first = Tab(shown.port, TOKEN)
    first.listen(
        lambda t: t.has("controller.gains.position.x") and t.error("paper_pd") >= 0.0
    )
    begin(shown, first)
    yield first
    first.close()


def begin(shown: Open, tab: Tab) -> None:
    """Begin again at real time."""
    done = threading.Event()

    def again(fleet: Fleet) -> None:
        fleet.reset()
        done.set()

    tab.move(tab.find("0.25x"), "1x")
    shown.page.do(again)
    assert done.wait(20.0)
    tab.forget()
    # words of before may be on their way
    tab.listen(lambda t: 0.0 <= seconds(t) < 1.0 and "playing, 1x" in t.status())


def click(tab: Tab, word: str) -> None:
    """Press the button, or the one of a group, that bears a word."""
    uuid = tab.find(word)
    options = tab.props[uuid].get("options")
    tab.move(
        uuid, next(option for option in options if word in option) if options else True
    )


def fast(tab: Tab) -> None:
    tab.move(tab.find("0.25x"), "4x")


def seconds(tab: Tab) -> float:
    line = next(
        (line for line in tab.status().splitlines() if " s, p" in line), "nan s"
    )
    return float(line.split()[0])


def test_the_page_is_for_who_bears_the_token(shown: Open) -> None:
    status, content, cookie = shown.get(f"/?token={TOKEN}")
    assert (status, b"<html" in content.lower()) == (200, True)
    assert "HttpOnly" in cookie
    assert "SameSite=Strict" in cookie
    kept = cookie.split(";")[0]
    assert shown.get("/", Cookie=kept)[0] == 200
    for path, headers in (
        ("/", {}),
        ("/?token=", {}),
        ("/?token=0123456789abcdeF", {}),
        ("/?token=%00", {}),
        ("/", {"Cookie": kept[:-1]}),
        ("/", {"Cookie": f"another={TOKEN}"}),
        (f"/?token={TOKEN}", {"Origin": "https://evil.example"}),
        (f"/?token={TOKEN}", {"Host": f"evil.example:{shown.port}"}),
        (f"/?token={TOKEN}", {"Host": "127.0.0.1"}),
    ):
        status, content, cookie = shown.get(path, **headers)
        assert (status, cookie) == (403, ""), (path, headers)
        assert TOKEN.encode() not in content


def test_a_page_is_dark_where_its_browser_prefers_so(shown: Open) -> None:
    _, content, _ = shown.get(f"/?token={TOKEN}", **{"Accept-Encoding": "gzip"})
    name = f"skyarm_studio_{shown.port}_dark"
    assert (
        content.count(
            f'<head><script>document.cookie = "{name}=" + matchMedia('.encode()
        )
        == 1
    )
    assert content.rstrip().endswith(b"</html>")  # of its whole length
    # what viser lays over the picture of a phone stands below it
    assert content.index(b"\n@media (max-width: 36em)") < content.index(b"</head>")
    for more, dark in (
        (f"; {name}=true", True),
        (f"; {name}=false", False),
        ("; other=true", False),
    ):
        tab = Tab(shown.port, TOKEN, more=more)
        tab.listen(lambda t, dark=dark: t.dark is dark, 20.0)
        assert shown.server.dark is dark
        tab.close()


WEBSOCKET = (
    "Upgrade: websocket",
    "Connection: Upgrade",
    "Sec-WebSocket-Version: 13",
    "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==",
)


def request(shown: Open, path: str = f"/?token={TOKEN}", *headers: str) -> bytes:
    host = f"127.0.0.1:{shown.port}"
    lines = [
        f"GET {path} HTTP/1.1",
        f"Host: {host}",
        *headers,
        *([f"Origin: http://{host}"] if headers else []),
    ]
    return ("\r\n".join(lines) + "\r\n\r\n").encode("latin-1")


def answers(shown: Open, requests: list[bytes]) -> list[bytes]:
    """First lines of what each is answered; empty of a connection that is closed, or
    that waits for more.
    """
    sockets = [
        socket.create_connection(("127.0.0.1", shown.port), timeout=20.0)
        for _ in requests
    ]
    found = []
    for each, sent in zip(sockets, requests, strict=True):
        each.sendall(sent)
    for each, sent in zip(sockets, requests, strict=True):
        each.settimeout(20.0 if sent.endswith(b"\r\n\r\n") else 0.02)
        try:
            found.append(each.recv(200).split(b"\r\n")[0])
        except OSError:
            found.append(b"")
        each.close()
    return found


def test_an_odd_request_is_refused_as_one(shown: Open) -> None:
    odd = [
        request(shown, "//["),  # no address
        request(shown, "/?token=\xff"),  # no text
        request(shown, f"/{'a' * 5000}?token={TOKEN}"),  # a name that no disk takes
        request(shown, f"/?token={TOKEN}", "Upgrade: websocket", "Upgrade: websocket"),
        request(shown, f"/?token={TOKEN}", *WEBSOCKET[:3], "Sec-WebSocket-Key: \xda"),
    ]
    assert answers(shown, odd) == [b"HTTP/1.1 400 Bad Request"] * len(odd)
    assert answers(shown, [request(shown, f"/nothing?token={TOKEN}")]) == [
        b"HTTP/1.1 404 NOT FOUND"
    ]


def test_no_request_is_an_error_of_the_server(shown: Open) -> None:
    rng, sent = random.Random(7), list[bytes]()
    for _ in range(400):
        made = bytearray(
            request(shown, f"/?token={TOKEN}", *rng.choice([(), WEBSOCKET]))
        )
        for _ in range(rng.randint(1, 5)):
            at = rng.randrange(len(made))
            made[at : at + rng.randint(0, 3)] = rng.randbytes(rng.randint(0, 4))
        sent.append(bytes(made))
    for begin in range(0, len(sent), 50):
        assert not [
            each
            for each in answers(shown, sent[begin : begin + 50])
            if b" 500 " in each
        ]
    assert shown.get(f"/?token={TOKEN}")[0] == 200


@pytest.mark.parametrize(
    ("token", "origin"),
    [
        (None, "own"),
        ("0123456789abcdeF", "own"),
        (TOKEN, "https://evil.example"),
        (TOKEN, "null"),
        (TOKEN, None),
    ],
)
def test_a_websocket_of_anyone_else_is_refused(
    shown: Open, token: str | None, origin: str | None
) -> None:
    with pytest.raises(InvalidStatus) as refused:
        Tab(shown.port, token, origin)
    assert refused.value.response.status_code == 403


def test_garbage_does_no_harm_and_says_nothing(
    shown: Open, tab: Tab, capfd: pytest.CaptureFixture[str]
) -> None:
    slider = tab.find("environment.wind.force.x")
    group = tab.find("play / pause")
    update = {"type": "GuiUpdateMessage", "uuid": slider, "updates": {"value": 1.0}}
    frames: list[bytes | str] = [
        b"",
        b"\x00",
        b"\xc1" * 40,
        os.urandom(500),
        "text",
        "{}",
        b"\x93" * 2000,
        b"\x91" * 100_000,
    ]
    frames += [
        msgspec.msgpack.encode(message)
        for message in (
            None,
            [],
            {},
            {"type": None},
            {"type": "Nothing"},
            {"type": "ShareUrlRequest"},
            {"type": "RunJavascriptMessage", "source": "1"},
            {"type": "GuiUpdateMessage"},
            {**update, "uuid": "nobody"},
            {**update, "uuid": ["a"]},
            {**update, "uuid": {}},
            {**update, "updates": None},
            {**update, "updates": {"visible": False}},
            {**update, "updates": {"value": 1.0, "_impl": 2}},
            *(
                {**update, "updates": {"value": bad}}
                for bad in (None, "1", [], {}, math.nan, math.inf, True, {"a": 1})
            ),
            *(
                {**update, "uuid": group, "updates": {"value": bad}}
                for bad in (None, 3, "nothing", ["step"])
            ),
            {**CAMERA, "wxyz": [1.0]},
            {**CAMERA, "wxyz": None},
            {**CAMERA, "fov": "wide"},
            {**CAMERA, "position": [math.nan, 0.0, 0.0]},
            {**CAMERA, "more": 1},
            {k: v for k, v in CAMERA.items() if k != "near"},
        )
    ]
    other = Tab(shown.port, TOKEN)
    for frame in frames:
        other.socket.send(frame)
    before = seconds(tab)
    tab.listen(lambda t: seconds(t) > before + 0.2)
    other.close()
    large = Tab(shown.port, TOKEN)
    large.socket.send(b"x" * (2 << 20))
    with pytest.raises(ConnectionClosed):  # it alone ends
        large.listen(lambda _: False)
    before = seconds(tab)
    tab.listen(lambda t: seconds(t) > before + 0.2)
    written = capfd.readouterr()
    assert written.out + written.err == ""


def test_a_value_beyond_a_slider_is_its_end(shown: Open, tab: Tab) -> None:
    knob = tab.find("environment.wind.force.x")
    other = Tab(shown.port, TOKEN)
    other.listen(lambda t: knob in t.props)
    tab.move(knob, 1e9)
    other.listen(lambda t: t.props[knob]["value"] == 5.0)  # what other tabs are told
    other.close()
    wait(
        lambda: (
            shown.page.fleet.flights[0].values.get("environment.wind.force.x") == 5.0
        )
    )
    tab.move(knob, -7)
    wait(
        lambda: (
            shown.page.fleet.flights[0].values.get("environment.wind.force.x") == -5.0
        )
    )


def wait(until: object, limit: float = 20.0) -> None:
    end = time.monotonic() + limit
    while not until():  # type: ignore[operator]
        assert time.monotonic() < end
        time.sleep(0.01)


def test_a_slider_moves_the_vehicle_that_it_belongs_to(shown: Open, tab: Tab) -> None:
    tab.listen(lambda t: seconds(t) > 0.3)
    calm = tab.error("paper_ct")
    tab.move(tab.find("environment.wind.force.x"), 2.0)
    tab.listen(
        lambda t: t.error("paper_ct") > 5.0 * calm and t.error("paper_pd") > 5.0 * calm
    )
    click(tab, "reset")
    tab.listen(lambda t: seconds(t) < 1.0 and t.error("paper_ct") < 2.0 * calm)
    assert shown.page.fleet.flights[0].values == {}


@pytest.mark.thorough
def test_a_gust_passes(tab: Tab) -> None:
    fast(tab)
    tab.listen(lambda t: seconds(t) > 2.5)  # the law has found its own offset
    calm = tab.error("paper_ct")
    click(tab, "gust (2 N")
    tab.listen(lambda t: t.error("paper_ct") > 4.0 * calm)
    tab.listen(lambda t: t.error("paper_ct") < 1.5 * calm)


def test_a_pause_holds_and_the_time_goes_back(shown: Open, tab: Tab) -> None:
    tab.listen(lambda t: seconds(t) > 0.5)
    click(tab, "play")
    tab.listen(lambda t: "paused" in t.status())
    held = shown.page.fleet.tick
    click(tab, "step")
    wait(lambda: shown.page.fleet.tick == held + 1)
    tab.move(tab.find("scrub back"), 0.25)
    wait(lambda: shown.page.fleet.tick == 50)
    tab.listen(lambda t: seconds(t) == 0.25)


def test_several_tabs_see_one_flight(shown: Open, tab: Tab) -> None:
    second = Tab(shown.port, TOKEN)
    knob = tab.find("environment.wind.force.y")
    second.listen(lambda t: knob in t.props)
    tab.move(knob, 1.0)
    second.listen(lambda t: t.props[knob]["value"] == 1.0)
    second.listen(lambda t: "/stage/law1" in t.nodes and "/stage/law2" in t.nodes)
    second.close()
    before = seconds(tab)
    tab.listen(lambda t: seconds(t) > before)


def test_a_law_is_made_beside_the_flight_and_a_third_one_joins(
    shown: Open, tab: Tab
) -> None:
    tab.listen(lambda t: seconds(t) > 0.2)
    tabs = [
        props["_tab_labels"] for props in tab.props.values() if "_tab_labels" in props
    ]
    tab.move(tab.find("law 3"), "rotors_sim_hummingbird")
    before = shown.page.fleet.tick
    wait(lambda: len(shown.page.fleet.flights) == 3)
    assert shown.page.fleet.tick > before  # the others flew on meanwhile
    tab.listen(lambda t: "rotors_sim_hummingbird" in t.status())
    # the colour of each; the tab that is open stays so, since the tabs do
    squares = [f'<span style="color: rgb{color}">\u25a0</span> ' for color in COLORS]
    for square, flight in zip(squares, shown.page.fleet.flights, strict=True):
        assert f"{square}{flight.title}: tip error" in tab.status()
    assert tabs == [
        props["_tab_labels"] for props in tab.props.values() if "_tab_labels" in props
    ]
    assert tabs == [["plots", "scenario", "world", "laws"]]
    folders = [
        props["label"] for props in tab.props.values() if "expand_by_default" in props
    ]
    assert len(folders) == len(set(folders))
    assert {"paper_ct: law", "paper_pd: law", "rotors_sim_hummingbird: law"} <= set(
        folders
    )
    tab.move(tab.find("law 3"), "none")
    wait(lambda: len(shown.page.fleet.flights) == 2)


def test_a_case_is_flown_by_the_same_laws(shown: Open, tab: Tab) -> None:
    click(tab, "case1")
    tab.listen(lambda t: "Case 1" in t.status())
    wait(
        lambda: (
            [flight.title for flight in shown.page.fleet.flights]
            == ["paper_ct", "paper_pd"]
        )
    )
    assert shown.page.fleet.source == "case1"
    click(tab, "case2")
    wait(
        lambda: (
            shown.page.fleet.source == "case2" and len(shown.page.fleet.flights) == 2
        )
    )


def test_a_page_that_nobody_watches_rests_between_two_looks(
    shown: Open, monkeypatch: pytest.MonkeyPatch
) -> None:
    looks: list[float] = []
    monkeypatch.setattr(
        shown.server, "get_clients", lambda: looks.append(time.monotonic()) or {}
    )
    time.sleep(0.35)
    monkeypatch.undo()
    # ten times a second
    assert 1 <= len(looks) <= 5


@pytest.mark.skipif(
    sys.platform != "linux", reason="127.0.0.2 is an address of Linux alone"
)
def test_a_page_for_other_devices_asks_for_its_own_address_and_the_token() -> None:
    listening = listening_socket(0, "127.0.0.2")
    port = listening.getsockname()[1]
    guard = AccessGuard(port, TOKEN, "127.0.0.2")
    assert guard.address() == f"http://127.0.0.2:{port}/?token={TOKEN}"
    server = open_server(listening, guard, "test")

    def status(path: str, host: str) -> int:
        client = http.client.HTTPConnection("127.0.0.2", port, timeout=20)
        client.request("GET", path, headers={"Host": f"{host}:{port}"})
        found = client.getresponse().status
        client.close()
        return found

    try:
        assert status(f"/?token={TOKEN}", "127.0.0.2") == 200
        assert status("/", "127.0.0.2") == 403
        assert status(f"/?token={TOKEN}", "127.0.0.1") == 403
        assert status(f"/?token={TOKEN}", "evil.example") == 403
    finally:
        close_server(server)


@pytest.mark.parametrize("host", ["", "0.0.0.0", "203.0.113.9", "no.such.name.invalid"])
def test_an_address_that_is_not_one_of_this_machine_is_refused(host: str) -> None:
    refused(
        skyarm("studio", "--host", host, "--port", "0", "--no-browser"),
        f"--host = {host!r}: must be ",
    )
