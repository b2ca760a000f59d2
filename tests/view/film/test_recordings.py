"""Recordings, unpacked again: where the bodies are at each instant, how large it is,
and the page that plays it.
"""

from __future__ import annotations

import base64
import dataclasses
import re
import socket
import threading
from pathlib import Path

import numpy as np
import pytest

from support.pictures import flight

pytest.importorskip("viser", reason="no extra 'studio'")
from recorded_scenes import place_at, unpacked

import skyarm
from skyarm.view.film.make_film import FilmSettings
from skyarm.view.film.recording import (
    Recording,
    record,
    save_recording,
)
from skyarm.world.scene.vehicle_shapes import vehicle_shapes

FPS = 20


@pytest.fixture(scope="module")
def two() -> Recording:
    return record([flight(), flight("centroidal_tip")], FilmSettings(fps=FPS))


def test_every_body_is_where_the_log_has_it(two: Recording) -> None:
    found = unpacked(two.content)
    assert found["durationSeconds"] == pytest.approx(1.0)
    assert two.seconds == pytest.approx(1.0)
    for i, law in enumerate(("paper_pd", "centroidal_tip")):
        log = flight(law)
        for k in (0, 7, 19):
            at = int(np.searchsorted(log.time, k / FPS))
            for root, position in (
                ("vehicle", log.position[at]),
                ("desired", log.position_reference[at]),
            ):
                name = f"/flight{i + 1}/{root}"
                place = place_at(
                    found["messages"], name, "SetPositionMessage", "position", k / FPS
                )
                # 0.1 mm are recorded
                np.testing.assert_allclose(place, position, atol=1e-4)
            tip = np.array(
                [float(c) for c in flight(law).scenario.plant.vehicle.frame().position]
            )
            # the second link hangs on the base
            for node in ("vehicle/1", "vehicle"):
                name = f"/flight{i + 1}/{node}"
                w, *v = place_at(
                    found["messages"], name, "SetOrientationMessage", "wxyz", k / FPS
                )
                placed = place_at(
                    found["messages"], name, "SetPositionMessage", "position", k / FPS
                )
                tip = placed + tip + 2.0 * np.cross(v, np.cross(v, tip) + w * tip)
            np.testing.assert_allclose(tip, log.tip[at], atol=5e-4)


def test_a_payload_is_where_the_log_has_it() -> None:
    base = {
        "kind": "circle",
        "radius": 0.3,
        "frequency_hz": 0.5,
        "center": [0.0, 0.0, 1.0],
    }
    log = skyarm.run(
        skyarm.scenario_from(
            {
                "name": "w",
                "duration": 1.0,
                "plant": {"vehicle": "hummingbird_arm2_rotors"},
                "controller": {"preset": "paper_ct"},
                "payloads": [{"mass": 0.02, "pick": 0.4}],
                "reference": {"base": base, "joints": [0.3, -0.2]},
            }
        )
    )
    messages = unpacked(record(log, FilmSettings(fps=FPS, ghost=False)).content)[
        "messages"
    ]
    for seconds, held in ((0.0, 0.4), (0.4, 0.4), (0.6, 0.6), (0.95, 0.95)):
        place = place_at(
            messages,
            "/flight1/solids/payload",
            "SetPositionMessage",
            "position",
            seconds,
        )
        np.testing.assert_allclose(
            place, log.tip[np.searchsorted(log.time, held)], atol=5e-4
        )


def test_flights_stand_apart_or_in_one_place() -> None:
    apart = {}
    for layout in ("side", "over"):
        content = record(
            [flight(), flight()], FilmSettings(fps=5, layout=layout, ghost=False)
        ).content
        messages = unpacked(content)["messages"]
        first, second = (
            place_at(messages, f"/flight{i}", "SetPositionMessage", "position", 0.0)
            for i in (1, 2)
        )
        apart[layout] = float(np.linalg.norm(second - first))
        assert not any(
            "desired/" in str(message.get("name")) for _, message in messages
        )
    assert apart["over"] == 0.0
    assert 0.5 < apart["side"] < 5.0


def test_the_round_ends_of_a_rod_are_at_its_ends(two: Recording) -> None:
    messages = unpacked(two.content)["messages"]
    rods = [
        shape
        for shape in vehicle_shapes(flight().scenario.plant.vehicle)
        if shape.kind == "capsule"
    ]
    assert len(rods) > 4
    for rod in rods:
        for end, sign in (("start", -0.5), ("end", 0.5)):
            name = f"/flight1/vehicle/{rod.body}/{rod.name}/{end}"
            place = place_at(messages, name, "SetPositionMessage", "position", 0.0)
            np.testing.assert_allclose(place, [0.0, 0.0, sign * rod.size[1]], atol=1e-6)


def wind_arrow(
    force: tuple[float, ...], air: tuple[float, ...]
) -> tuple[np.ndarray, bool]:
    """Direction of the arrow of a flight in a constant wind, and whether it is seen."""
    log = flight()
    air_velocity = 0 * log.air_velocity + air
    return wind_arrow_of(
        dataclasses.replace(
            log, wind_force=0 * log.wind_force + force, air_velocity=air_velocity
        )
    )


def wind_arrow_of(blown: skyarm.Log) -> tuple[np.ndarray, bool]:
    """The same at the end of any flight."""
    found = unpacked(record(blown, FilmSettings(fps=2)).content)
    said = [
        message
        for _, message in found["messages"]
        if message.get("name") == "/flight1/wind"
    ]
    sent = [
        message["updates"]["points"]["__binary_index"]
        for message in said
        if "updates" in message
    ]
    seen = any(
        message["visible"]
        for message in said
        if message["type"].endswith("VisibilityMessage")
    )
    if not sent:
        return np.zeros(3), seen
    start, end = np.frombuffer(found["buffers"][sent[-1]], np.float32).reshape(2, 3)
    return (end - start) / np.linalg.norm(end - start), seen


@pytest.mark.parametrize("wind", [(0.0, 2.0, 0.0), (-2.0, 0.0, 0.0), (1.2, -0.9, 2.0)])
def test_the_arrow_lies_along_the_wind(wind: tuple[float, ...]) -> None:
    for force, air in ((wind, (0.0, 0.0, 9.0)), ((0.0, 0.0, 0.0), wind)):
        along, seen = wind_arrow(force, air)
        assert seen
        np.testing.assert_allclose(
            along, np.array(wind) / np.linalg.norm(wind), atol=1e-6
        )


def test_next_to_no_wind_has_no_arrow() -> None:
    assert not wind_arrow((0.0, 0.0, 0.0), (0.03, 0.0, 0.0))[1]
    assert not wind_arrow((0.01, 0.0, 0.0), (0.0, 0.0, 0.0))[1]
    assert wind_arrow((0.03, 0.0, 0.0), (0.0, 0.0, 0.0))[1]


def test_what_does_not_move_is_recorded_once() -> None:
    still = skyarm.run(skyarm.load_scenario("case2", duration=1.0))
    messages = unpacked(record(still, FilmSettings(fps=FPS)).content)["messages"]
    ghost = [
        m
        for _, m in messages
        if m.get("name") == "/flight1/desired" and m["type"] == "SetPositionMessage"
    ]
    reference = len(
        np.unique(np.round(still.position_reference[:: 200 // FPS], 4), axis=0)
    )
    assert len(ghost) <= reference + 2


def test_a_recording_is_small(two: Recording) -> None:
    # 30 s of one flight take about 70 kB; what does not grow with time takes some
    assert len(two.content) / 2 < 70e3 / 30 + 8e3


def test_the_same_flights_give_the_same_recording(two: Recording) -> None:
    again = record([flight(), flight("centroidal_tip")], FilmSettings(fps=FPS))
    assert unpacked(again.content) == unpacked(two.content)


def test_nothing_listens_while_a_recording_is_made(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    opened = []
    for name in ("bind", "listen"):
        usual = getattr(socket.socket, name)
        monkeypatch.setattr(
            socket.socket,
            name,
            lambda own, *at, usual=usual: opened.append(at) or usual(own, *at),
        )
    before = threading.active_count()
    assert record(flight(), FilmSettings(fps=2)).content
    assert opened == []
    assert threading.active_count() == before


def test_a_page_holds_all_that_it_needs(two: Recording, tmp_path: Path) -> None:
    page = save_recording(two, tmp_path / "alone.html").read_text("utf-8")
    (held,) = re.findall(r'__VISER_EMBED_DATA__="([^"]+)"', page[:2_000_000])
    assert '{darkMode:matchMedia("(prefers-color-scheme: dark)").matches}' in page
    assert base64.b64decode(held) == two.content
    assert not re.findall(
        r"""<(?:script|link|img)[^>]*(?:src|href)=["']?(?:https?:)?//""", page
    )
    assert save_recording(two, tmp_path / "a.viser").read_bytes() == two.content


def test_a_suffix_in_capitals_is_the_same(two: Recording, tmp_path: Path) -> None:
    for name in ("A.VISER", "B.HTML"):
        assert save_recording(two, tmp_path / name) == tmp_path / name
        assert (tmp_path / name).is_file()


def test_three_flights_stand_about_the_place_of_the_middle_one() -> None:
    messages = unpacked(
        record([flight()] * 3, FilmSettings(fps=1, ghost=False)).content
    )["messages"]
    left, middle, right = (
        place_at(messages, f"/flight{i}", "SetPositionMessage", "position", 0.0)
        for i in (1, 2, 3)
    )
    np.testing.assert_allclose(middle, 0.0, atol=1e-9)
    np.testing.assert_allclose(left, -right, atol=1e-9)
    assert np.linalg.norm(right) > 0.5


def test_the_arrow_turns_with_the_wind() -> None:
    log = flight()
    wind = np.where(log.time[:, None] < 0.4, [0.0, 2.0, 0.0], [2.0, 0.0, 0.0])
    along, seen = wind_arrow_of(dataclasses.replace(log, wind_force=wind))
    assert seen
    np.testing.assert_allclose(along, [1.0, 0.0, 0.0], atol=1e-6)
