"""A tip that grips a handle: a force of either sign along the radius of a believed arc,
and nothing to lose.
"""

from __future__ import annotations

import dataclasses
import re
import tomllib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

import skyarm
from skyarm.algebra import Mat3, Vec3
from skyarm.algebra.scalars import divide, sqrt, where
from skyarm.control.blocks import force_control as law
from skyarm.control.blocks.force_control import (
    InteractionGains,
    first_interaction,
    wanted_of,
)
from skyarm.control.blocks.tip_force import levers
from skyarm.dynamics.kinematics import frame_pose
from skyarm.records.plain import plain
from skyarm.records.restore import restore
from skyarm.reference.reference_tables import push_from
from skyarm.scenario.numbers import with_numbers
from skyarm.scenario.scenario_file import scenario_from
from skyarm.world.component import Force, Wrench

DT = 0.005
GAINS = InteractionGains(touch=0.3, lost=0.1)
ARM = skyarm.load_vehicle("hummingbird_arm2_rotors")
JOINTS = (-0.45, -0.9)
RADIUS, GRASP, WRONG, STIFFNESS = 0.3, 0.4, 1.06, 4000.0


@dataclass(frozen=True, kw_only=True)
class Handle(Force):
    """A handle that goes about an axis along y: a spring to the arc from an instant on,
    free along it.
    """

    pivot: tuple[float, float, float]
    grasp: float = GRASP

    def wrenches(self, memory, t, motion, rotor_speeds):
        place, link = motion.frame()
        arm = motion.position(place, link) - Vec3(*self.pivot)
        arm = Vec3(arm.x, 0.0, arm.z)
        size = sqrt(arm.dot(arm))
        pull = where(t >= self.grasp, STIFFNESS * (divide(RADIUS, size) - 1.0), 0.0)
        return (Wrench(force_W=arm * pull, point=place, body=link),)


def scenario(**push):
    """The paper's vehicle swings a handle by 40 degrees; it believes a lever that is 6
    % too long.
    """
    tip = np.array([float(c) for c in frame_pose(ARM, ARM.frame(), JOINTS).p])
    start = np.array([0.0, 0.0, 1.0]) + tip
    down = np.array([0.0, 0.0, -1.0])  # the handle hangs at first, below its axis
    s = np.linspace(0.0, 1.0, 21)
    angle = np.radians(40.0) * (10.0 * s**3 - 15.0 * s**4 + 6.0 * s**5)
    pivot = start - WRONG * RADIUS * down
    path = (
        pivot
        + WRONG
        * RADIUS
        * np.stack([np.sin(angle), 0.0 * angle, -np.cos(angle)], axis=1)
        - tip
    )

    def spline(k):
        return {
            "kind": "spline",
            "times": [0.0, *(0.6 + 2.0 * s)],
            "values": [path[0, k], *path[:, k]],
        }

    document = {
        "schema": 1,
        "name": "grip",
        "duration": 3.0,
        "plant": {"vehicle": "hummingbird_arm2_rotors"},
        "model": {"vehicle": "hummingbird_arm2"},
        "controller": {"law": "centroidal", "mode": "tip", "interaction": [0.3, 0.1]},
        "reference": {
            "base": {"kind": "signals", "x": spline(0), "z": spline(2)},
            "joints": list(JOINTS),
            "push": (
                {
                    "force": 0.0,
                    "normal": [0.0, 0.0, -1.0],
                    "grip": {"kind": "constant", "value": 1.0, "start": GRASP},
                    "pivot": pivot.tolist(),
                    "axis": [0.0, 2.0, 0.0],
                }
                | push
            ),
        },
    }
    handle = Handle(pivot=tuple((start - RADIUS * down).tolist()))
    return dataclasses.replace(scenario_from(document), forces=(handle,)), np.array(
        handle.pivot
    )


def radial_force(flight, pivot):
    """N, of the handle on the tip, out of its axis, from 0.2 s after the grasp on; and
    its angle at the end, deg.
    """
    log = skyarm.run(flight)
    assert log.status == "completed"
    arm = (log.tip - pivot)[:, [0, 2]]
    size = np.linalg.norm(arm, axis=1)
    return (STIFFNESS * (RADIUS - size))[log.time > GRASP + 0.2], np.degrees(
        np.arctan2(arm[-1, 0], -arm[-1, 1])
    )


def test_a_handle_on_a_wrong_arc_is_led_with_the_wanted_radial_force():
    flight, pivot = scenario()
    for wanted in (0.0, -0.5):
        changed = with_numbers(flight, {"reference.push.force.value": wanted})
        force, angle = radial_force(changed, pivot)
        assert force.mean() == pytest.approx(wanted, abs=0.03)
        assert np.abs(force - wanted).max() < 0.15
        assert angle == pytest.approx(40.0 * WRONG, abs=2.0)
    # by positions the tip pulls at its handle, which is 8 mm from where it is believed
    # to go
    force, _ = radial_force(scenario(grip=0.0)[0], pivot)
    assert np.abs(force).max() > 0.5


def wanted(force, grip=1.0, **beside):
    return wanted_of(
        (
            force,
            0.1,
            -1.0,
            0.0,
            0.0,
            grip,
            *beside.get("pivot", ()),
            *beside.get("axis", ()),
        )
    )


def stepped(wish, memory, pull):
    """One period in which the tip is pulled by some force (N, world axes)."""
    at = levers(ARM, Mat3.identity(), JOINTS)
    return law.interact(
        GAINS, memory, wish, at.disturbance(Vec3(*pull)), at, 0.5, 0.99, DT
    )


def test_a_tip_that_grips_touches_at_once_and_loses_nothing():
    memory = first_interaction(2)
    for _ in range(620):  # near a limit of the joints the integral is slow
        memory, pressing = stepped(wanted(0.0), memory, (0.3, 0.0, 0.0))
    assert (memory.touching, memory.losing, memory.share) == (1.0, 0.0, 1.0)
    assert pressing.asked
    assert pressing.kept == 0.7
    # the handle pulls against the normal; bounded
    assert memory.integral == pytest.approx(0.3, abs=0.01)
    before = memory
    memory, pressing = stepped(wanted(0.0, grip=0.4), memory, (0.3, 0.0, 0.0))
    # until the handle's force is gone
    assert (memory.touching, memory.integral) == (1.0, 0.0)
    assert memory.share == pytest.approx(before.share - DT / 0.15)
    assert pressing.order == pytest.approx(before.order * 29.0 / 30.0)
    # at a limit; no force across beyond the cone of the order
    assert pressing.kept == pytest.approx(1.0 - 0.2 * 0.9)
    assert not pressing.asked


def test_the_integral_of_a_grip_is_bounded_by_the_size_of_the_force():
    found = [
        law.integrate_force_error(GAINS, 0.0, -2.0, a, 1.0, 1.0, 0.0, 10.0, signed=True)
        for a in (10.0, -10.0)
    ]
    assert found == pytest.approx([-1.3, 1.3])


def test_the_normal_points_out_of_the_axis_while_the_tip_grips():
    arc = {"pivot": (1.0, 0.0, 0.0), "axis": (0.0, 0.0, 1.0)}
    tip = Vec3(1.3, 0.4, 7.0)
    assert [*wanted(0.0, **arc).about_the_pivot(tip).normal] == pytest.approx(
        [0.6, 0.8, 0.0]
    )
    for told in (
        wanted(0.0, grip=0.0, **arc),
        wanted(0.0),
        wanted_of((1.0, 0.1, -1.0, 0.0, 0.0)),
    ):
        assert [*told.about_the_pivot(tip).normal] == [-1.0, 0.0, 0.0]
    on_the_axis = wanted(0.0, **arc).about_the_pivot(Vec3(1.0, 0.0, 3.0))
    assert [*on_the_axis.normal] == [-1.0, 0.0, 0.0]
    near, beside = (
        wanted(0.0, **arc).about_the_pivot(Vec3(1.0, y, 3.0)).normal
        for y in (0.9e-3, 1.1e-3)
    )
    assert ([*near], [*beside]) == (
        [-1.0, 0.0, 0.0],
        pytest.approx([0.0, 1.0, 0.0], abs=1e-6),
    )
    # as exported code has it where there is no axis
    none = wanted(0.0, pivot=(0.0,) * 3, axis=(0.0,) * 3)
    assert [*none.about_the_pivot(tip).normal] == [-1.0, 0.0, 0.0]


def test_only_what_presses_slides():
    assert [
        wanted(force, grip).presses
        for force, grip in ((1.0, 0.0), (1.0, 1.0), (0.0, 0.0))
    ] == [True, False, False]
    assert [
        wanted(force, grip).requests_contact
        for force, grip in ((1.0, 0.0), (0.0, 1.0), (0.0, 0.0))
    ] == [
        True,
        True,
        False,
    ]


def test_a_grip_is_kept_moved_and_read():
    trajectory = scenario()[0].reference
    assert restore(plain(trajectory)) == trajectory
    assert trajectory.at(1.0).push[5:] == pytest.approx(
        (1.0, *trajectory.push.pivot, 0.0, 1.0, 0.0)
    )
    assert trajectory.shifted(1.0).at(1.0).push[5] == 0.0
    assert GRASP in trajectory.switch_times()


def test_the_slide_on_the_page_is_that_of_the_example():
    root = Path(__file__).resolve().parents[2]
    page = (root / "docs/pressing.md").read_text("utf-8")
    (text,) = re.findall(r"```toml\n([^`]*)```", page)
    example = (root / "examples/press_and_slide.toml").read_text("utf-8")
    assert tomllib.loads(text)["base"] == tomllib.loads(example)["reference"]["base"]


@pytest.mark.parametrize(
    ("table", "field"),
    [
        ({"grip": "closed"}, "grip"),
        ({"grip": 1.0, "pivot": [0.0, 1.0]}, "pivot"),
        ({"grip": 1.0, "pivot": [0, 0, 1], "axis": [0, 0, 0]}, "axis"),
        ({"grip": 1.0, "pivot": [0, 0, float("nan")]}, "pivot"),
        ({"grip": 1.0, "axis": [0, 0, 1]}, "axis"),
        ({"pivot": [0, 0, 1]}, "pivot"),
        ({"grip": 1.0, "lever": 0.1}, "lever"),
    ],
)
def test_other_grips_are_refused_in_one_line(table, field):
    with pytest.raises(
        ValueError, match=rf"reference\.push\.?{field}|{field}"
    ) as refusal:
        push_from({"force": 0.0, "normal": [1, 0, 0], **table}, "reference.push")
    assert "\n" not in str(refusal.value)
