"""Figures of vehicles that fly together: a curve of each under its name, and only of
what is its own.
"""

from __future__ import annotations

import dataclasses
import functools
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import skyarm
from skyarm.algebra import Vec3
from skyarm.log.flight_log import Log
from skyarm.view.figures.flight_facts import applied_force
from skyarm.view.figures.flight_plot import plot
from skyarm.world.contact.contact_point import ContactPoint
from skyarm.world.contact.surface import Surface
from support.shaped import shaped
from support.teams import team, with_world


@functools.cache
def flown(name: str) -> Log:
    return skyarm.run(team(name, duration=0.3))


def words(ax: Any) -> str:
    """Label of the value axis in one line."""
    return " ".join(ax.get_ylabel().replace("_\n", "_").split())


def panels(figure: Any) -> dict[str, dict[str, Any]]:
    """Label of the axis -> label of the curve -> its values, of what the legend
    names.
    """
    return {
        words(ax): {
            line.get_label(): line.get_ydata()
            for line in ax.get_lines()
            if not line.get_label().startswith("_")
        }
        for ax in figure.axes
    }


def test_error_force_and_thrust_are_those_of_each_vehicle() -> None:
    log = flown("triangle")
    drawn = panels(plot(log, kind="team"))
    assert [*drawn] == ["Tip error [mm]", "Force on plate [N]", "Thrust [N]"]
    assert all([*each] == ["right", "front", "left"] for each in drawn.values())
    for i, (name, own) in enumerate(log.agents.items()):
        error = 1e3 * np.sqrt(
            ((own.position - own.position_reference) ** 2).sum(axis=1)
        )
        np.testing.assert_allclose(drawn["Tip error [mm]"][name], error, atol=1e-9)
        pull = log.grasp_pull[:, 3 * i : 3 * i + 3]
        np.testing.assert_allclose(
            drawn["Force on plate [N]"][name],
            np.sqrt((pull**2).sum(axis=1)),
            atol=1e-12,
        )
        rotors = log.scenario.agents[name].plant.vehicle.rotors
        thrust = sum(
            float(r.thrust_coefficient) * w**2
            for r, w in zip(rotors, own.rotor_speeds.T, strict=True)
        )
        np.testing.assert_allclose(drawn["Thrust [N]"][name], thrust, rtol=1e-12)
    # three vehicles that carry the plate in hover
    assert sum(
        values[-1] for values in drawn["Force on plate [N]"].values()
    ) == pytest.approx(0.278 * 9.81, rel=0.05)


def test_all_has_every_panel_once_and_one_vehicle_has_its_own() -> None:
    log = flown("bar")
    figure = plot(log)
    drawn, labels = panels(figure), [words(ax) for ax in figure.axes]
    assert len(labels) == len(set(labels)) == 13
    assert {
        "Base x [m]",
        "Yaw [deg]",
        "Force on bar [N]",
        "Tip error [mm]",
        "Thrust [N]",
    } < set(labels)
    for name, own in log.agents.items():
        np.testing.assert_array_equal(drawn["Base y [m]"][name], own.position[:, 1])
        alone = panels(own.plot())
        assert len(alone) == 11
        (curve,) = (
            values
            for label, values in alone["Force on bar [N]"].items()
            if label != "desired"
        )
        np.testing.assert_array_equal(curve, drawn["Force on bar [N]"][name])


def test_a_part_of_one_vehicle_is_no_curve_of_another() -> None:
    drawn = panels(plot(flown("bar"), kind="parts"))
    assert [*drawn["grasp_force_left_bar [N]"]] == ["left"]
    assert [*drawn["grasp_pull_right_bar_z [N]"]] == ["right"]
    assert [*drawn["object_position_bar_x [m]"]] == ["left", "right"]


def test_flights_of_teams_are_told_apart_by_both_names() -> None:
    drawn = panels(plot({"one": flown("bar"), "other": flown("cables")}, kind="team"))
    assert [*drawn["Thrust [N]"]] == [
        "one, left",
        "one, right",
        "other, left",
        "other, right",
    ]


def test_the_paths_are_drawn_with_the_body_in_the_grasps_and_its_cables() -> None:
    log = flown("cables")
    above, side = plot(log, kind="path").axes
    lines = {
        line.get_label(): line
        for line in above.get_lines()
        if not line.get_label().startswith("grasp")
    }
    for name, own in log.agents.items():
        np.testing.assert_array_equal(lines[name].get_ydata(), own.position[:, 1])
    cables = [line for line in side.get_lines() if line.get_label().startswith("grasp")]
    assert {line.get_label() for line in cables} == {
        "grasp/left_bar",
        "grasp/right_bar",
    }
    assert cables[0].get_ydata()[0] == pytest.approx(1.0, abs=0.02)
    (bar,) = (
        each
        for each in above.patches
        if each.get_label() == "world/bar" and each.get_fill() and each.zorder < 0.65
    )
    low, high = bar.get_xy().min(axis=0), bar.get_xy().max(axis=0)
    np.testing.assert_allclose(high - low, [0.0276, 0.684], atol=1e-6)
    assert side.get_ylim()[0] < 0.49


def touching() -> Log:
    """Flight in which only the skid of the right vehicle is pressed, by 2 N, as if it
    were so.
    """
    points = tuple(
        ContactPoint(
            name=f"{name}_skid", body="base", agent=name, position=Vec3(0.0, 0.0, 0.1)
        )
        for name in ("left", "right")
    )
    scenario = with_world(
        team("bar", duration=0.02), points=points, surfaces=(Surface(name="floor"),)
    )
    log = skyarm.run(scenario)
    force = np.zeros_like(log.contact_force)
    labels = log.agents["left"].info["received"]["components"]["fields"][
        "contact_force"
    ]["axes"]
    force[:, labels.index("floor/right_skid")] = 2.0
    pressed = {
        name: dataclasses.replace(
            own, received={**own.received, "components.contact_force": force}
        )
        for name, own in log.agents.items()
    }
    return type(log)(pressed, log.info)


def test_forces_of_bodies_that_touch_are_drawn_for_the_vehicles_they_are_of(
    tmp_path: Path,
) -> None:
    ball = shaped(tmp_path, [{"shape": "sphere", "size": [0.2]}])
    surge = {"kind": "ramp", "start": 0.0, "duration": 0.5, "height": 0.4}
    down = [{"kind": "constant", "value": 0.22}, {**surge, "height": -0.2}]
    agents = {
        name: {
            "plant": {"vehicle": ball},
            "controller": {"law": "decoupled_pd"},
            "reference": {"base": {"kind": "signals", "x": x, "z": z}},
        }
        for name, x, z in (("left", surge, down), ("right", 0.45, down), ("off", 3, 1))
    }
    document = {"schema": 1, "name": "touches", "duration": 0.8}
    world = {"surfaces": [{"name": "ground"}]}
    together = {**document, "agents": agents, "world": world}
    log = skyarm.run(skyarm.scenario_from(together, tmp_path))
    drawn = panels(plot(log, kind="contact"))
    assert {label: [*lines] for label, lines in drawn.items()} == {
        "left.base, ground [N]": ["left"],
        "right.base, ground [N]": ["right"],
        "left.base, right.base [N]": ["left", "right"],
    }
    single = {**document, **agents["left"], "world": world}
    alone = skyarm.run(skyarm.scenario_from(single, tmp_path))
    force = alone.component("collision_force")[:, 0]
    (axes,) = plot(alone, kind="contact").axes
    assert axes.get_ylabel() == "base, ground [N]"
    assert axes.get_lines()[0].get_ydata().max() == force.max() > 0.0


def test_the_force_of_a_contact_is_that_of_its_point_s_vehicle() -> None:
    log = touching()
    assert {name: float(applied_force(own)[0]) for name, own in log.agents.items()} == {
        "left": 0.0,
        "right": 2.0,
    }
    drawn = panels(plot(log, kind="contact"))
    assert [*drawn["floor, right_skid [N]"]] == ["right"]
