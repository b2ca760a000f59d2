"""A payload on a cord: it swings as a pendulum, hangs with its weight, and gives the
vehicle what it loses.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import skyarm
from skyarm.algebra import Vec3
from skyarm.dynamics.kinematics import frame_pose
from skyarm.scenario.scenario_file import scenario_from
from skyarm.scenario.unlikely_numbers import load_warnings
from skyarm.world import HangingPayload, Reach, TimedPayload
from skyarm.world.contact import Material, Surface

DT = 0.005

GROUND = (Surface(name="ground"),)


@dataclass(frozen=True)
class Holder:
    """Motion of a vehicle of which only the frame that holds the load counts."""

    place: Vec3
    speed: Vec3
    gravity: float
    solids: tuple[Surface, ...] = ()

    def frame(self, _name):
        return Vec3(0.0, 0.0, 0.0), 0

    def position(self, *_at):
        return self.place

    def velocity(self, *_at):
        return self.speed


def swing(payload, seconds, holder, *, start=None, gravity=9.81):
    """Memories of a load under a frame whose place and velocity are given; from a place
    of its own if wanted.
    """
    memory, rows = payload.start(DT, ()), []
    for k in range(round(seconds / DT)):
        place, velocity = holder(k * DT)
        memory = payload.act(memory, k * DT, DT, Holder(place, velocity, gravity))
        if k == 0 and start is not None:
            memory = replace(memory, position=start, velocity=Vec3(0.0, 0.0, 0.0))
        rows.append(memory)
    return rows


def still(_t):
    return Vec3(0.0, 0.0, 2.0), Vec3(0.0, 0.0, 0.0)


def test_at_rest_it_hangs_with_its_weight_on_a_cord_that_its_weight_stretches():
    rows = swing(HangingPayload(mass=0.3, cord=0.8, stretch=0.02), 1.0, still)
    for memory in rows:
        assert tuple(memory.position) == pytest.approx(
            (0.0, 0.0, 2.0 - 0.8 * 1.02), abs=1e-12
        )
        assert tuple(memory.pull) == pytest.approx((0.0, 0.0, -0.3 * 9.81), abs=1e-12)


def test_it_swings_with_the_period_of_a_pendulum():
    """2 pi sqrt(L / g) of the stretched cord, with the correction of an amplitude of
    0.1 rad: within 0.5 %.
    """
    length = 0.8 * 1.02
    start = Vec3(length * math.sin(0.1), 0.0, 2.0 - length * math.cos(0.1))
    rows = swing(HangingPayload(mass=0.3, cord=0.8), 6.0, still, start=start)
    x = np.array([memory.position.x for memory in rows])
    crossings = np.flatnonzero(np.diff(np.sign(x)) != 0)
    period = 2.0 * np.diff(crossings).mean() * DT
    assert period == pytest.approx(
        2.0 * math.pi * math.sqrt(length / 9.81) * (1.0 + 0.1**2 / 16.0), rel=5e-3
    )
    # a cord damps its length, not the swing
    assert 0.095 < x[-400:].max() / length < 0.101


def test_a_row_of_the_log_has_the_load_where_it_is_at_the_rows_time():
    """A swing of 0.5 rad against SciPy: one period later it is up to 7 mm away."""
    payload, length = HangingPayload(mass=0.3, cord=0.8), 0.8 * 1.02
    start = Vec3(length * math.sin(0.5), 0.0, 2.0 - length * math.cos(0.5))
    rows = swing(payload, 1.0, still, start=start)[1:]
    found = np.array([payload.logged(memory, None)[1:] for memory in rows])
    square = 9.81 / (0.02 * 0.8)

    def slope(_t, y):
        line = np.array([0.0, 2.0]) - y[:2]
        size = np.linalg.norm(line)
        along = line / size
        pull = square * (size - 0.8) - 2.0 * 0.2 * math.sqrt(square) * (along @ y[2:])
        return [*y[2:], *(along * max(pull, 0.0) - [0.0, 9.81])]

    times = DT * np.arange(len(rows))
    exact = solve_ivp(
        slope,
        (0.0, 1.0),
        [start.x, start.z, 0.0, 0.0],
        t_eval=times,
        rtol=1e-10,
        atol=1e-12,
    ).y
    np.testing.assert_allclose(found[:, [0, 2]], exact[:2].T, atol=1e-3)


def test_the_vehicle_gets_the_momentum_that_the_load_loses():
    """Sum of pulls over periods and weight against the load's momentum, to rounding,
    while the frame moves.
    """

    def holder(t):
        return Vec3(0.1 * math.sin(5 * t), 0.05 * t, 2.0), Vec3(
            0.5 * math.cos(5 * t), 0.05, 0.0
        )

    rows = swing(HangingPayload(mass=0.3, cord=0.5), 2.0, holder)
    pulled = sum(np.array(tuple(memory.pull)) * DT for memory in rows)
    weight = np.array([0.0, 0.0, -0.3 * 9.81 * DT * len(rows)])
    momentum = 0.3 * np.array(tuple(rows[-1].velocity))
    assert momentum == pytest.approx(weight - pulled, abs=1e-12)
    assert np.abs(momentum[:2]).max() > 1e-3


def test_a_cord_pulls_and_never_pushes():
    rows = swing(
        HangingPayload(mass=0.3, cord=0.5), 0.3, still, start=Vec3(0.0, 0.0, 2.3)
    )
    assert tuple(rows[5].pull) == (0.0, 0.0, 0.0)
    fallen = 2.3 - rows[5].position.z
    assert fallen == pytest.approx(0.5 * 9.81 * (5 * DT) ** 2, rel=0.02)


def test_it_is_held_from_one_instant_to_the_other_and_not_again():
    payload = TimedPayload(mass=0.3, pick=0.02, drop=0.04)
    rows = swing(payload, 0.06, still)
    assert [memory.held for memory in rows] == [0, 0, 0, 0, 1, 1, 1, 1, 0, 0, 0, 0]
    assert [memory.caught for memory in rows] == [0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0]
    assert tuple(rows[-1].place) == (0.0, 0.0, 2.0)


def test_it_is_grasped_and_let_go_within_reach_of_places():
    def holder(t):
        return Vec3(10.0 * t, 0.0, 0.0), Vec3(10.0, 0.0, 0.0)

    payload = TimedPayload(
        mass=0.3,
        pick_place=Reach(within=0.06, of=[0.2, 0, 0]),
        drop_place=Reach(within=0.06, of=[0.4, 0, 0]),
    )
    held = [memory.held for memory in swing(payload, 0.06, holder)]
    assert held == [0, 0, 0, 1, 1, 1, 1, 0, 0, 0, 0, 0]
    assert tuple(payload.start(DT, ()).place) == (0.2, 0.0, 0.0)


def test_a_load_lies_down_on_the_floor_and_slides_with_friction():
    """Lowered onto it the cord is slack; at 1 m/s on it, it stops after v^2 / (2 mu
    g).
    """
    payload = HangingPayload(mass=0.3, cord=0.5)
    memory = payload.start(DT, ())
    for k in range(400):
        height = max(1.0 - 0.5 * k * DT, 0.3)
        sinking = Vec3(0.0, 0.0, -0.5 if height > 0.3 else 0.0)
        memory = payload.act(
            memory, k * DT, DT, Holder(Vec3(0.0, 0.0, height), sinking, 9.81, GROUND)
        )
        assert memory.position.z >= 0.0
    assert memory.position.z == 0.0
    assert tuple(memory.pull) == (0.0, 0.0, 0.0)
    memory = replace(memory, velocity=Vec3(0.6, 0.8, 0.0))
    for _ in range(200):
        # above the load, whose cord stays slack
        over = Vec3(memory.position.x, memory.position.y, 0.2)
        memory = payload.act(
            memory, 5.0, DT, Holder(over, Vec3(0.0, 0.0, 0.0), 9.81, GROUND)
        )
    way = 1.0 / (2.0 * 0.3 * 9.81)
    assert tuple(memory.position) == pytest.approx(
        (0.6 * way, 0.8 * way, 0.0), rel=2e-3
    )
    assert math.hypot(memory.velocity.x, memory.velocity.y) < 1e-9
    # and is lifted again
    for k in range(200):
        over = Vec3(memory.position.x, memory.position.y, 0.2 + 0.5 * k * DT)
        memory = payload.act(
            memory, 6.0, DT, Holder(over, Vec3(0.0, 0.0, 0.5), 9.81, GROUND)
        )
    assert memory.position.z == pytest.approx(0.7 - 0.51, abs=0.02)


@pytest.mark.parametrize("angle", [0.25, 0.35])
def test_on_a_slope_it_lies_or_slides_by_the_friction_of_the_surface(angle):
    """Closed form, tan(angle) beside 0.3: at rest below it, (sin - mu cos) g t^2 / 2
    down the slope above.
    """
    slope = (
        Surface(
            name="slope", angles=Vec3(0.0, angle, 0.0), material=Material(friction=0.3)
        ),
    )
    payload, at = HangingPayload(mass=0.3, cord=0.5), Vec3(0.0, 0.0, 0.2)
    memory = payload.act(
        payload.start(DT, ()), 0.0, DT, Holder(at, Vec3(0.0, 0.0, 0.0), 9.81, slope)
    )
    for k in range(1, 81):
        # the cord is slack
        over = Vec3(memory.position.x, 0.0, memory.position.z + 0.2)
        memory = payload.act(
            memory, k * DT, DT, Holder(over, Vec3(0.0, 0.0, 0.0), 9.81, slope)
        )
    x, z = memory.position.x, memory.position.z
    assert x * math.sin(angle) + z * math.cos(angle) == pytest.approx(0.0, abs=1e-9), (
        "on the slope"
    )
    pull = 9.81 * max(math.sin(angle) - 0.3 * math.cos(angle), 0.0)
    assert x / math.cos(angle) == pytest.approx(
        0.5 * pull * (81 * DT) ** 2, rel=0.01, abs=1e-9
    )


BOX = {"shape": "box", "size": [2.0, 2.0, 0.1], "position": [0.0, 0.0, -0.05]}
SHELF = {"shape": "box", "size": [2.0, 2.0, 0.01], "position": [0.0, 0.0, 0.395]}
BALL = {"shape": "sphere", "size": [0.5], "position": [0.0, 0.0, -0.5]}


@pytest.mark.parametrize("plant", ["rigid_body", "mujoco"])
@pytest.mark.parametrize(
    ("ground", "surface", "top"),
    [
        (True, {}, 0.0),
        (False, {}, 0.0),
        (False, BOX, 0.0),
        (True, BOX, 0.0),
        (False, SHELF, 0.4),
        (False, BALL, None),
    ],
)
def test_a_flown_load_meets_the_surfaces_of_the_world(ground, surface, top, plant):
    """It hangs 0.6 m below a tip at 0.45 m: on a floor, on a thin shelf that the cord
    would pass, on a ball.
    """
    document = {
        "schema": 1,
        "name": "on",
        "duration": 0.8,
        "plant": {"vehicle": "hummingbird_arm2_rotors", "kind": plant},
        "controller": {"preset": "centroidal_joint"},
        "environment": {"ground": ground},
        "reference": {
            "base": {"kind": "hover", "position": [0.0, 0.0, 0.84]},
            "joints": [0.0, 0.0],
        },
        "payloads": [{"kind": "hanging", "mass": 0.1, "pick": 0.1, "cord": 0.6}],
        "world": {"surfaces": [{"name": "floor", **surface}]},
    }
    scenario = scenario_from(document)
    log = skyarm.run(scenario)
    held = log.component("payload_mass")[:, 0] > 0.0
    place = log.component("payload_position")[held]
    assert log.status == "completed"
    assert held.sum() > 100
    heights = (
        place[:, 2]
        if top is not None
        else np.linalg.norm(place - [0.0, 0.0, -0.5], axis=1) - 0.5
    )
    np.testing.assert_allclose(heights, top or 0.0, atol=1e-9)
    tip = skyarm.load_vehicle("hummingbird_arm2_rotors")
    low = 0.84 + float(frame_pose(tip, tip.frame(), (0.0, 0.0)).p.z) - 0.6 * 1.02
    line = (
        f"payloads[0].cord: lets the load hang {(top or 0.0) - low:.3g} m below surface"
        " 'floor' along the reference"
    )
    assert any(each.startswith(line) for each in load_warnings(scenario))


def test_check_warns_of_a_cord_that_reaches_below_the_ground():
    document = {
        "schema": 1,
        "name": "low",
        "duration": 1.0,
        "plant": {"vehicle": "hummingbird_arm2_rotors"},
        "controller": {"preset": "centroidal_joint"},
        "reference": {
            "base": {"kind": "hover", "position": [0.0, 0.0, 0.6]},
            "joints": [0.0, 0.0],
        },
        "payloads": [{"kind": "hanging", "mass": 0.1, "pick": 0.5, "cord": 0.5}],
    }
    (line,) = load_warnings(scenario_from(document))
    tip = skyarm.load_vehicle("hummingbird_arm2_rotors")
    depth = 0.51 - (0.6 + float(frame_pose(tip, tip.frame(), (0.0, 0.0)).p.z))
    assert line.startswith(
        f"payloads[0].cord: lets the load hang {depth:.3g} m below surface 'ground'"
    )
    document["reference"]["base"]["position"] = [0.0, 0.0, 1.5]
    assert not [*load_warnings(scenario_from(document))]
    document["reference"]["base"]["position"], document["environment"] = (
        [
            0.0,
            0.0,
            0.6,
        ],
        {"ground": False},
    )
    assert not [*load_warnings(scenario_from(document))]
