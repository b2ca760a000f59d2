"""A part of a user is drawn in every picture, without an edit anywhere: a rope from a
place to the base.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from types import SimpleNamespace
from typing import Any

import matplotlib.pyplot as plt
import numpy as np

import skyarm
from skyarm.algebra import Vec3
from skyarm.vehicle.vehicle_records import Vehicle
from skyarm.view.figures.flight_plot import path_figure
from skyarm.view.film.filmed_flight import film_flights
from skyarm.view.picture.marks import marks_of, vehicle_solids
from skyarm.view.studio.fleet import Flight
from skyarm.view.studio.picture import FleetPicture
from skyarm.world import ForceWind, Gust
from skyarm.world.component import Column, Force, Wrench
from skyarm.world.hanging_payload import HangingPayload
from skyarm.world.scene.scene import Instants, Line, Scene
from skyarm.world.scene.shapes import Shape, Solid
from support.peers import Scene as Nodes

ANCHOR = (0.4, 0.3, 0.0)


@skyarm.register.force("rope_with_shapes")
@dataclass(frozen=True, kw_only=True)
class Rope(Force):
    """A rope from a place of the world to the base, with a peg at its foot."""

    stiffness: float = 0.1  # N/m

    columns = (Column("rope_length", "", "m"),)

    def wrenches(
        self, memory: Any, t: Any, motion: Any, rotor_speeds: Sequence[Any]
    ) -> Sequence[Wrench]:
        return (Wrench(force_W=(Vec3(*ANCHOR) - motion.position()) * self.stiffness),)

    def logged(self, memory: Any, motion: Any) -> tuple[Any, ...]:
        return ((Vec3(*ANCHOR) - motion.position()).norm(),)

    def shapes(self, seen: Instants) -> Scene:
        base, still = seen.place(), np.tile(np.eye(3), (len(seen.times), 1, 1))
        foot = np.tile(ANCHOR, (len(seen.times), 1))
        peg = Solid(
            Shape("peg", "surface", "sphere", -1, (0.02,)), foot, still, fixed=True
        )
        np.testing.assert_allclose(
            seen.numbers["rope_length"][:, 0],
            np.linalg.norm(foot - base, axis=1),
            atol=1e-3,
        )
        return Scene(
            solids=(peg,), lines=(Line("rope", np.stack([foot, base], axis=1)),)
        )

    def warnings(self, vehicle: Vehicle, step: float) -> Sequence[str]:
        return (
            f"stiffness = {self.stiffness:g} N/m: hardly a rope of {vehicle.name!r}",
        )


@cache
def scenario() -> skyarm.Scenario:
    """Two ropes, and a payload that hangs."""
    load = HangingPayload(mass=0.02, pick=0.02)
    case = skyarm.load_scenario("case2", duration=0.1)
    return dataclasses.replace(
        case, forces=(Rope(), Rope(), ForceWind(gust=Gust())), payloads=(load,)
    )


@cache
def flown() -> skyarm.Log:
    return skyarm.run(scenario())


def test_a_rope_is_in_the_path_picture() -> None:
    figure = path_figure({"a": flown()}, (0.0, 0.1)).figure
    drawn = [line.get_label() for line in figure.axes[0].lines]
    assert drawn.count("rope") == drawn.count("rope_2") == 2
    assert "peg" in [patch.get_label() for patch in figure.axes[0].patches]
    plt.close(figure)


def test_a_rope_and_a_cord_are_in_a_film_where_vehicle_and_load_are() -> None:
    log = flown()
    flight = film_flights([log], log.time)[0]
    rope, _second, cord = flight.scene.lines
    np.testing.assert_allclose(rope.places[:, 1], log.position, atol=1e-9)
    held = np.isfinite(cord.places[:, 0, 0])
    np.testing.assert_array_equal(held, log.payload_mass[:, 0] > 0.0)
    np.testing.assert_allclose(cord.places[held, 0], log.tip[held], atol=1e-9)
    np.testing.assert_allclose(
        cord.places[held, 1], log.payload_position[held], atol=1e-9
    )
    assert {"peg", "peg_2", "payload"} <= {
        solid.shape.name for solid in vehicle_solids(flight)
    }
    marks = [
        each
        for each in marks_of([flight], 0.2, 1.0)(5)
        if np.allclose(each.start, ANCHOR)
    ]
    np.testing.assert_allclose(marks[0].end, log.position[5], atol=1e-9)


def test_a_rope_is_in_the_studio() -> None:
    nodes = Nodes()
    picture = FleetPicture(
        SimpleNamespace(scene=nodes, initial_camera=SimpleNamespace())
    )
    picture.build(scenario(), ["a"])
    rope = nodes.nodes["/stage/lines1/rope"]
    flight = Flight(None, scenario())
    flight.to(8)
    picture.hurry()
    picture.draw([flight])
    np.testing.assert_allclose(
        rope.points[0], [ANCHOR, list(flight.session.state.position)], atol=1e-4
    )
    assert {"/stage/scene1/peg", "/stage/lines1/cord", "/stage/scene1/payload"} <= set(
        nodes.nodes
    )


def test_a_part_warns_in_its_own_place() -> None:
    from skyarm.scenario.unlikely_numbers import unlikely_numbers

    lines = [line for line in unlikely_numbers(scenario()) if "rope" in line]
    assert lines[1].startswith(
        "environment.forces[1]: stiffness = 0.1 N/m: hardly a rope of 'hummingbird"
    )
