"""A push at what gives way: the order falls to what it bears, the contact stays, the reference goes along."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import skyarm
from pushed_boxes import START, beside_a_box, by_force, by_place
from skyarm.algebra import Mat3, Vec3
from skyarm.control.blocks.force_control import InteractionGains, Wanted, first_interaction, interact
from skyarm.control.blocks.tip_force import levers
from skyarm.scenario.scenario_file import scenario_from
from skyarm.simulate.batch import Batch

DT, TIP, BOX, WEIGHT = 0.005, 0.076, 0.25, 9.81
"""s; kg, of the tip along the normal and of the box; m/s^2."""

GAINS = InteractionGains(touch=0.3, lost=0.1)
AT = levers(skyarm.load_vehicle("hummingbird_arm2"), Mat3.identity(), (-0.45, -0.9))


def pushed(force, friction, seconds=3.0):
    """Contact, order (N), speed of the tip and of its reference (m/s) while it pushes a box: no delay, no noise.

    One line, one body: box and tip move together, and the tip has the damping of the law alone.
    """
    wanted, slip = Wanted(force=force, speed=0.1, normal=Vec3(-1.0, 0.0, 0.0)), friction * BOX * WEIGHT
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


@pytest.mark.parametrize("friction", [0.15, 0.28])
def test_a_box_that_slides_keeps_the_contact_at_about_the_speed_of_the_approach(friction):
    touching, order, speed, reference = pushed(1.0, friction)
    bears = friction * BOX * WEIGHT
    assert touching.all()
    assert speed[-1] == pytest.approx(0.05 + 0.1 * (1.0 - bears), rel=0.02)  # 1 N (1 - (v - v_p / 2) / (0.1 m/s)) = mu m g
    assert order[-1] == pytest.approx(bears + GAINS.damping * TIP * speed[-1], rel=0.02)
    assert reference[-1] == pytest.approx(speed[-1], rel=0.02)
    assert speed.max() < 0.2
