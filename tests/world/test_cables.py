"""Teams on cables: where the vehicles stand, what the cables bear, and what turns a
beam between two forces.
"""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np
import pytest

import skyarm
from skyarm.algebra import Vec3
from skyarm.control.laws.centroidal.contact.carrying import planned_effect
from skyarm.records.files import Fields
from skyarm.reference import Reference
from skyarm.reference.carry import Carry
from skyarm.reference.object_motion import motion_of_object
from skyarm.world.contact.carrier import CarriedFrame
from skyarm.world.team.decentralised import Decentralised
from skyarm.world.team.object_wrench import ObjectWrench
from skyarm.world.team.team import TeamInputs
from skyarm.world.team.virtual_masses import Member
from support.cables import (
    BAR,
    HALF,
    HANGING,
    SWINGING,
    beam,
    figure_eight,
    on_cables,
    rate_of_beam,
    roll,
    thapa,
)

RODS = {"left": (0.0, HALF, 0.0097), "right": (0.0, -HALF, 0.0097)}
CORNERS = {
    "right": (-0.094, -0.267, 0.0097),
    "front": (0.3683, 0.0, 0.0097),
    "left": (-0.094, 0.267, 0.0097),
}
TOUR = [
    {"kind": "lift", "height": 0.3, "duration": 1.5},
    {"kind": "carry", "by": [0.8, 0.0, 0.0], "duration": 2.0},
    {"kind": "turn", "angle": 0.8, "duration": 2.0},
    {"kind": "tilt", "roll": 0.15, "duration": 1.5},
]
PLATE = {
    "name": "plate",
    "shape": "box",
    "size": [0.8, 0.6, 0.01],
    "mass": 0.278,
    "inertia": [6.25e-3, 6.25e-3, 1.246e-2],
    "position": [0.0, 0.0, 0.49],
}


PLANTS = ("rigid_body", "mujoco")


def rod(phases=TOUR, duration=4.0, **team):
    body = {**BAR, "position": [0.0, 0.0, 0.49]}
    return on_cables(
        body,
        RODS,
        team={**SWINGING, **team},
        motion={"phases": phases},
        duration=duration,
    )


def plate(duration=9.0, **team):
    return on_cables(
        PLATE,
        CORNERS,
        team={**SWINGING, **team},
        motion={"phases": TOUR},
        duration=duration,
    )


def desired(scenario, t, h=1e-3):
    """Desired place, acceleration, axes and moment of the body by differences of its
    pose alone.
    """
    team = scenario.team

    def pose(time):
        at = team.motion.at(time)
        return np.array([*at.position]), np.array([[*row] for row in at.R.rows])

    (before, R0), (x, R), (after, R1) = pose(t - h), pose(t), pose(t + h)
    inertia = np.diag([*map(float, team.inertia)])

    def spin(A, B):
        skew = (B @ A.T - A @ B.T) / 2.0
        return np.array([skew[2, 1], skew[0, 2], skew[1, 0]]) / h

    momentum = [Q @ inertia @ Q.T @ w for Q, w in ((R0, spin(R0, R)), (R, spin(R, R1)))]
    return x, (after - 2.0 * x + before) / h**2, R, (momentum[1] - momentum[0]) / h


@pytest.mark.parametrize(
    ("tables", "pull"),
    [(rod(duration=8.0, internal_force=0.2), 0.2), (plate(internal_force=0.3), 0.3)],
)
def test_each_vehicle_stands_at_the_end_of_a_cable_along_its_force(tables, pull):
    scenario = skyarm.scenario_from(tables)
    (body,) = tables["world"]["objects"]
    above = CORNERS["front"][2]
    places = np.array([grasp["place"] for grasp in tables["world"]["grasps"]])
    for t in (0.6, 2.2, 3.1, 4.4, 6.3):
        x, a, R, moment = desired(scenario, t)
        arms = places @ R.T
        # a rod turns freely about the line of its grasps: the apparent weight has no
        # lever
        if len(arms) == 2:
            down = np.add(a, [0.0, 0.0, 9.81])
            down -= R[:, 1] * (R[:, 1] @ down)
            arms = places[:, 1:2] * R[:, 1] + above * down / np.linalg.norm(down)
        cross = [
            np.array([[0, -r[2], r[1]], [r[2], 0, -r[0]], [-r[1], r[0], 0]])
            for r in arms
        ]
        G = np.vstack([np.hstack([np.eye(3)] * len(arms)), np.hstack(cross)])
        wrench = np.concatenate([body["mass"] * np.add(a, [0.0, 0.0, 9.81]), moment])
        inner = np.zeros_like(arms)  # along the line of each pair
        for i, j in itertools.permutations(range(len(arms)), 2):
            inner[i] += pull * (arms[i] - arms[j]) / np.linalg.norm(arms[i] - arms[j])
        forces = (np.linalg.pinv(G, rcond=1e-10) @ wrench).reshape(-1, 3) + inner
        ends = x + arms + 0.5 * forces / np.linalg.norm(forces, axis=1)[:, None]
        for name, end in zip(scenario.agents, ends, strict=True):
            reference = scenario.agents[name].reference.at(t)
            assert np.allclose([*reference.position], end, atol=2e-4)
            assert float(reference.yaw) == pytest.approx(
                np.arctan2(R[1, 0], R[0, 0]), abs=1e-6
            )


def test_two_vehicles_carry_a_rod_on_cables():
    log = skyarm.run(skyarm.scenario_from(rod()))
    assert log.info["status"] == "completed"
    assert log.team_position_error.max() < 1e-2  # m
    assert log.team_position_error.mean() < 3.5e-3
    pull, late = log.grasp_pull.reshape(-1, 2, 3), log.time > 0.3
    assert log.grasp_force[late].min() > 0.3  # N, taut throughout
    assert np.abs(log.team_pull).max() < 2e-3
    # each cable pulls towards its vehicle
    for k, (agent, place) in enumerate(RODS.items()):
        w, x, y, z = log.object_quaternion.T
        rows = [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)]
        rows += [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)]
        rows += [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]
        grasp = log.object_position + np.array(rows).T.reshape(-1, 3, 3) @ place
        along = log.agents[agent].position - grasp
        along /= np.linalg.norm(along, axis=1)[:, None]
        tension = (pull[:, k] * along).sum(axis=1)
        assert tension.min() >= 0.0
        assert np.allclose(pull[:, k], tension[:, None] * along, atol=2e-3)


@pytest.mark.thorough
def test_mujoco_flies_a_rod_on_cables_alike():
    ours, other = (
        skyarm.run(skyarm.scenario_from(rod(internal_force=0.2)).with_kind(kind))
        for kind in PLANTS
    )
    assert np.abs(ours.object_position - other.object_position).max() < 1e-4
    assert np.abs(ours.team_pull - other.team_pull).max() < 1e-2


@pytest.mark.thorough
@pytest.mark.parametrize("pull", [0.0, 0.3])
def test_three_vehicles_carry_a_plate_on_cables(pull):
    log = skyarm.run(skyarm.scenario_from(plate(internal_force=pull)))
    # rotors begin at the vehicles' own weights: the plate drops by 18 mm, and is back
    # within 0.7 s
    error, late = 1e3 * log.team_position_error[:, 0], log.time > 0.7
    assert log.info["status"] == "completed"
    assert error[late].max() < 8.0
    assert error[-100:].max() < 1.0
    assert np.degrees(log.team_turn_error[late].max()) < 1.0
    assert log.grasp_force[late].min() > 0.2
    assert np.abs(log.team_pull - log.team_pull_reference)[late].max() < 0.03


@pytest.mark.thorough
def test_slack_cables_take_a_rod_from_the_floor_and_set_it_down():
    phases = [
        {"kind": "hold", "duration": 2.0},
        {"kind": "lift", "height": 0.4, "duration": 2.0},
        {"kind": "carry", "by": [1.0, 0.0, 0.0], "duration": 2.0},
        {"kind": "place", "duration": 2.0},
    ]
    tables = rod(phases, 10.0)
    tables["world"]["surfaces"] = [{"name": "floor", "shape": "plane"}]
    tables["world"]["objects"][0] |= {"position": [0.0, 0.0, 0.0138], "standing": True}
    log = skyarm.run(skyarm.scenario_from(tables))
    assert (
        log.grasp_force[(log.time > 0.2) & (log.time < 0.7)].max() < 0.02
    )  # the vehicles take the load in the 1.3 s before the lift
    assert log.grasp_force[(log.time > 2.0) & (log.time < 7.5)].min() > 0.3
    assert log.grasp_force[-1].max() < 0.15  # N, of 0.51: the cables are just taut
    assert log.team_position_error.max() < 12e-3
    assert np.allclose(log.object_position[-1], [1.0, 0.0, 0.0138], atol=2e-3)


def swings(**team):
    """Mean distance (mm) of a rod from its place two seconds after a carry of 1.5 s."""
    phases = [*HANGING, {"kind": "carry", "by": [0.4, 0.0, 0.0], "duration": 1.5}]
    log = skyarm.run(skyarm.scenario_from(rod(phases, 5.0, **team)))
    return 1e3 * log.team_position_error[log.time > 4.0].mean()


@pytest.mark.thorough
def test_the_swing_of_a_rod_is_damped():
    without, damped = swings(swing=0.0), swings()
    assert without > 2.0
    assert damped < 0.3 * without


def law(kind=ObjectWrench, phases=TOUR, **fields):
    motion = motion_of_object(
        Fields({"phases": phases}, "reference.object"), Vec3(0.0, 0.0, 0.5)
    )
    places = RODS.values()
    masses = fields.pop("masses", (1.0,) * len(places))
    members = tuple(
        Member(agent=f"a{i}", place=Vec3(*place), mass=mass)
        for i, (place, mass) in enumerate(zip(places, masses, strict=True))
    )
    return kind(
        object="bar",
        members=members,
        motion=motion,
        mass=0.104,
        inertia=Vec3(4e-3, 1e-5, 4e-3),
        **fields,
    )


def said(
    whole,
    t,
    velocity=(0.0, 0.0, 0.0),
    turning=(0.0, 0.0, 0.0),
    forces=None,
    count=400,
    dt=0.005,
):
    """State of a law and its instructions after periods in which a body at its place
    has a velocity of its own.
    """
    at, still = whole.motion.at(t), Vec3(0.0, 0.0, 0.0)
    body = CarriedFrame(
        position=at.position,
        rotation=at.R,
        velocity=at.velocity + Vec3(*velocity),
        turning=at.rate + Vec3(*turning),
    )
    given = (
        [still] * len(whole.members)
        if forces is None
        else [Vec3(*each) for each in forces]
    )
    inputs = TeamInputs(
        time=t,
        holding=1.0,
        desired=at,
        body=body,
        gravity=9.81,
        forces=given,
        moments=[still] * len(given),
    )
    own, rows = whole.first(dt), ()
    for _ in range(count):
        own, rows = whole.lead(own, inputs, dt)
    return own, [Carry.of(row) for row in rows]


def test_a_swing_shifts_all_vehicles_against_it():
    whole = law(swing=0.2, pull_gain=0.0)
    _, rows = said(whole, 1.0, velocity=(0.3, -0.1, 0.4), turning=(1.0, 2.0, 0.5))
    # up and down cables are stiff, and a twist is quicker than the vehicles
    for row in rows:
        assert np.allclose([*row.offset], [-0.2 * 0.3, -0.2 * -0.1, 0.0], atol=1e-5)


def test_a_hanging_body_is_brought_to_its_place_below_its_start_too():
    phases = [*HANGING, {"kind": "carry", "by": [0.0, 0.0, -0.3], "duration": 1.0}]
    hanging = law(phases=phases, pose_gain=0.5)
    standing = law(phases=[{"kind": "hold", "duration": 0.1}, *phases], pose_gain=0.5)
    for whole, moves in ((hanging, True), (standing, False)):
        at = whole.motion.at(3.0)
        body = CarriedFrame(
            position=at.position + Vec3(0.1, 0.0, 0.0),
            rotation=at.R,
            velocity=at.velocity,
            turning=at.rate,
        )
        still = [Vec3(0.0, 0.0, 0.0)] * 2
        inputs = TeamInputs(
            time=3.0,
            holding=1.0,
            desired=at,
            body=body,
            gravity=9.81,
            forces=still,
            moments=still,
        )
        own, _ = whole.lead(whole.first(0.005), inputs, 0.005)
        assert own.pose.place.x == pytest.approx(-0.1 * 0.5 * 0.005 if moves else 0.0)


def test_a_virtual_mass_is_the_share_of_an_adapted_one():
    whole = law(
        Decentralised,
        masses=(0.6, 0.4),
        gain=0.1,
        adaptation=2.0,
        initial_mass=0.3,
        filter=1e3,
        phases=HANGING,
    )
    excess = 0.5  # N, more than 0.3 kg weigh
    own, _ = said(
        whole, 2.0, forces=[(0.0, 0.0, 0.3 * 9.81 + excess)] * 2, count=1, dt=1e-3
    )
    rates = [(each.mass - 0.3) / 1e-3 for each in own]
    assert rates == pytest.approx(
        [2.0 * m * 9.81 * 0.1 * excess for m in (0.6, 0.4)], rel=1e-9
    )
    with pytest.raises(ValueError, match=r"initial_mass = -1\.0: must be at least 0"):
        dataclasses.replace(whole, initial_mass=-1.0)


def test_a_vehicle_without_a_tip_bears_a_load_at_its_origin():
    vehicle = skyarm.load_vehicle("dragonfly")
    turned = Reference(yaw=0.5 * np.pi)
    effect = planned_effect(
        vehicle, turned, Carry.none(), Vec3(1.0, 2.0, -3.0), Vec3(0.1, 0.2, 0.3)
    )
    assert [*effect.force] == [1.0, 2.0, -3.0]
    # base axes, of the moment alone
    assert np.allclose([*effect.torque], [0.2, -0.1, 0.3])
    assert effect.efforts == ()


@pytest.mark.parametrize("pull", [0.1, -0.1])
def test_the_sign_of_the_internal_force_decides_where_a_beam_turns(pull):
    """Theorem of Tognon, Gabellieri and others 2018: tension levels a beam on cables,
    compression turns it over.
    """
    log = skyarm.run(skyarm.scenario_from(beam(pull, tilt=0.15, duration=4.0)))
    angle, during = roll(log), log.time > 1.0
    rate = np.polyfit(log.time[during], np.log(np.tan(0.5 * angle[during])), 1)[0]
    assert rate == pytest.approx(rate_of_beam(pull, 0.5), rel=0.15)
    assert (angle[-1] < 0.09) if pull > 0.0 else (angle[-1] > 0.25)


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("pull", "height", "rate"),
    [(0.0, 0.0, 0.0), (-0.02, 0.0097, -0.0159), (-0.05, 0.0097, 0.063)],
)
def test_without_internal_force_a_beam_stays_and_its_own_weight_helps(
    pull, height, rate
):
    log = skyarm.run(
        skyarm.scenario_from(beam(pull, tilt=0.15, height=height, duration=10.0))
    )
    assert rate_of_beam(pull, 0.5, height) == pytest.approx(rate, abs=1e-3)
    during = log.time > 3.0
    found = np.polyfit(log.time[during], np.log(np.tan(0.5 * roll(log)[during])), 1)[0]
    assert found == pytest.approx(rate, abs=4e-3)


@pytest.mark.thorough
def test_a_law_that_sees_the_attitude_levels_a_beam_under_compression():
    tables = beam(-0.1, tilt=0.1, duration=8.0)
    given = {
        "law": "object_wrench",
        "internal_force": -0.1,
        "pose_gain": 0.3,
        **SWINGING,
    }
    tables["team"] = {
        name: tables["team"][name] for name in ("object", "members")
    } | given
    log = skyarm.run(skyarm.scenario_from(tables))
    during = log.time > 1.0
    assert np.polyfit(log.time[during], np.log(roll(log)[during]), 1)[
        0
    ] == pytest.approx(-0.3, abs=0.03)


@pytest.mark.thorough
@pytest.mark.parametrize("gain", [0.1, 0.02])
def test_thapas_numbers_survive_rotors_and_attitude(gain):
    """At his gain, 0.1 m/(N s), and at a fifth of it."""
    log = skyarm.run(skyarm.scenario_from(thapa(gain)))
    assert log.info["status"] == "completed"
    late = log.time > 15.0
    assert log.team_pull[late].mean() == pytest.approx(2.0, abs=0.01)
    assert np.allclose(
        log.object_velocity[late].mean(axis=0), [0.2, 0.0, 0.0], atol=1e-3
    )
    weight = log.grasp_pull[late].reshape(-1, 2, 3)[:, :, 2].mean(axis=0)
    assert weight.sum() == pytest.approx(0.5 * 9.81, abs=5e-3)


@pytest.mark.thorough
def test_a_load_follows_a_figure_eight_at_five_metres_a_second():
    tables, begin = figure_eight(1.065, 3.32)
    log = skyarm.run(skyarm.scenario_from(tables))
    assert np.linalg.norm(log.object_velocity, axis=1).max() == pytest.approx(
        5.0, abs=0.1
    )
    assert log.team_position_error[log.time > begin].max() < 5e-3
    assert log.grasp_force[log.time > 0.5].min() > 0.5


def test_a_body_without_a_lift_and_a_wrong_path_are_refused():
    tables = rod()
    tables["reference"]["object"]["phases"] = [{"kind": "hold", "duration": 1.0}]
    with pytest.raises(
        skyarm.ScenarioError,
        match=r"reference\.object\.phases: must have a phase of kind 'lift'",
    ):
        skyarm.scenario_from(tables)
    tables = rod()
    tables["reference"]["object"]["path"] = {"kind": "spiral"}
    with pytest.raises(
        skyarm.ScenarioError,
        match=r"reference\.object\.path\.kind = 'spiral': did you mean 'signals'",
    ):
        skyarm.scenario_from(tables)


def test_a_vehicle_hangs_its_cable_from_its_tip_where_it_has_one():
    plain = skyarm.load_vehicle("dragonfly")
    hook = dataclasses.replace(
        plain.frame("grip"), name="hook", position=Vec3(0.02, 0.01, -0.03)
    )
    able = dataclasses.replace(plain, frames=(*plain.frames, hook), end_effector="hook")
    whole = law(
        phases=[*HANGING, {"kind": "turn", "angle": 0.5 * np.pi, "duration": 1.0}]
    )
    member = dataclasses.replace(whole.members[0], length=0.5)
    whole = dataclasses.replace(whole, members=(member, whole.members[1]))
    ends, bases = (
        [*whole.path_of(member, each, 9.81, 5.0).at(4.0).position]
        for each in (plain, able)
    )
    # turned by 90 degrees
    assert np.allclose(np.subtract(ends, bases), [-0.01, 0.02, -0.03], atol=1e-9)
    effect = planned_effect(
        able, Reference(), Carry.none(), Vec3(0.0, 0.0, -1.0), Vec3(0.0, 0.0, 0.0)
    )
    assert np.allclose([*effect.torque], [-0.01, 0.02, 0.0])


def test_a_path_is_added_to_the_phases():
    path = {
        "kind": "signals",
        "x": {"kind": "sine", "amplitude": 0.5, "frequency_hz": 0.1},
        "y": -0.2,
        "z": 0.1,
    }
    tables = {
        "phases": [{"kind": "lift", "height": 0.4, "duration": 1.0}],
        "path": path,
    }
    at = motion_of_object(Fields(tables, "reference.object"), Vec3(1.0, 2.0, 3.0)).at(
        4.0
    )
    w = 0.2 * np.pi
    assert [*at.position] == pytest.approx([1.0 + 0.5 * np.sin(4.0 * w), 1.8, 3.5])
    assert [*at.acceleration] == pytest.approx(
        [-0.5 * w * w * np.sin(4.0 * w), 0.0, 0.0]
    )


def test_a_member_has_the_length_of_its_cable_and_may_suppose_another():
    scenario = skyarm.scenario_from(
        rod(
            members=[
                {"agent": "left", "place": RODS["left"], "length": 0.54},
                {"agent": "right", "place": RODS["right"]},
            ]
        )
    )
    assert [float(each.length) for each in scenario.team.members] == [0.54, 0.5]
    heights = [
        float(each.reference.at(0.0).position.z) for each in scenario.agents.values()
    ]
    with pytest.raises(
        ValueError, match=r"team\.members\.0\.length': must be equal in all episodes"
    ):
        # the paths were planned with it
        skyarm.with_numbers(scenario, {"team.members.0.length": 0.5})
    assert heights == pytest.approx(
        [0.49 + 0.0097 + 0.54, 0.49 + 0.0097 + 0.5], abs=1e-6
    )
