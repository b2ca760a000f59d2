"""A push at what gives way: the order falls to what it bears, the contact stays, the
reference goes along.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from pushed_boxes import worlds

import skyarm
from skyarm.algebra import Mat3, Vec3
from skyarm.control.blocks.force_control import (
    DesiredContact,
    InteractionGains,
    first_interaction,
    interact,
    normal_shift,
)
from skyarm.control.blocks.tip_force import levers
from skyarm.scenario.scenario_file import scenario_from
from support.worlds import beside_a_box, by_force, by_place

DT, TIP, BOX, WEIGHT = 0.005, 0.076, 0.25, 9.81
"""s; kg, of the tip along the normal and of the box; m/s^2."""

GAINS = InteractionGains(touch=0.3, lost=0.1)
AT = levers(skyarm.load_vehicle("hummingbird_arm2"), Mat3.identity(), (-0.45, -0.9))


def pushed(force, friction, seconds=3.0):
    """Contact, order (N), speed of the tip and of its reference (m/s) while it pushes a
    box: no delay, no noise.

    One line, one body: box and tip move together, and the tip has the damping of the
    law alone.
    """
    wanted, slip = (
        DesiredContact(force=force, speed=0.1, normal=Vec3(-1.0, 0.0, 0.0)),
        friction * BOX * WEIGHT,
    )
    memory = dataclasses.replace(first_interaction(2), free=1.0)
    v, x, felt, found = 0.0, 0.0, 0.31, []
    for _ in range(round(seconds / DT)):
        memory = dataclasses.replace(memory, gap=-x - memory.shift)
        observed = AT.disturbance(Vec3(-felt, 0.0, 0.0))
        memory, pressing = interact(GAINS, memory, wanted, observed, AT, v, 0.0, DT)
        drive = pressing.order - TIP * pressing.damping * v
        a = (drive - slip) / (TIP + BOX) if v > 0.0 or drive > slip else 0.0
        v, felt = max(v + a * DT, 0.0), drive - TIP * a
        x += v * DT
        found.append((memory.touching, pressing.order, v, -memory.shift_rate))
    return np.array(found).T


def test_a_box_that_slides_keeps_the_contact_at_about_the_speed_of_the_approach():
    bears = 0.28 * BOX * WEIGHT
    touching, order, speed, reference = pushed(1.0, 0.28)
    assert touching.all()
    # the force that is looked for falls by the wanted one for each 0.1 m/s above 0.8 of
    # the speed of the approach
    assert speed[-1] == pytest.approx(0.08 + 0.1 * (1.0 - bears), rel=0.02)
    assert order[-1] == pytest.approx(bears + GAINS.damping * TIP * speed[-1], rel=0.02)
    assert reference[-1] == pytest.approx(speed[-1], rel=0.02)
    assert speed.max() < 0.2


def test_the_surface_is_looked_for_from_where_it_was_last():
    def rate(**told):
        gone = dataclasses.replace(first_interaction(2), shift=-0.6, found=1.0, **told)
        return normal_shift(GAINS, gone, True, 0.0, 0.0, 0.1, DT)[1]

    assert rate() == 0.0
    assert rate(reached=-0.2) < 0.0


@pytest.mark.thorough
@pytest.mark.parametrize("wanted", [by_force(), by_place()], ids=["force", "place"])
def test_a_box_is_pushed_along_by_a_stated_force_as_by_place(wanted):
    completed, way, _ = worlds(scenario_from(beside_a_box(wanted)), 32, 4801)
    pushed_along = completed & (way > 0.2)
    print(f"{pushed_along.sum()} of 32; {way.min():.2f} to {way.max():.2f} m")
    assert pushed_along.sum() >= 24


@pytest.mark.thorough
def test_a_guards_force_is_held_by_each_box_that_bears_it():
    """No law holds more than the friction on a box that slides, but by making it ever
    faster.
    """
    until = {"force": 0.5, "timeout": 8.0, "on_timeout": "fail"}
    press = {
        "kind": "press",
        "force": 1.0,
        "normal": [-1.0, 0.0, 0.0],
        "duration": 2.0,
        "until": until,
    }
    phases = [{"kind": "hold", "duration": 0.5}, press, {"kind": "retreat"}]
    completed, _, values = worlds(scenario_from(beside_a_box(phases, 14.0)), 96, 4900)
    bears = values["world.surfaces.table.material.friction"] * BOX * WEIGHT > 0.5
    print(
        f"{completed.sum()} of 96; of {bears.sum()} that bear 0.5 N"
        f" {(completed & bears).sum()}"
    )
    assert (completed & bears).sum() >= bears.sum() - 2
