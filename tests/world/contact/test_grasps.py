"""Grasps between vehicles and bodies: statics, momentum, energy, the rigid limit,
cables, and MuJoCo's bodies.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

import skyarm
from skyarm.algebra import E_X, Mat3, Quaternion, Vec3
from skyarm.dynamics import State
from skyarm.dynamics.actuators import Command
from skyarm.plant.compiled import RigidBodyPlant, Steps
from skyarm.plant.interface import Truth
from skyarm.scenario.scenario_record import Rates, Scenario
from skyarm.vehicle.linkage import Body
from skyarm.world.contact.carrier import CarriedFrame
from skyarm.world.contact.free_object import FreeObject
from skyarm.world.contact.grasp import Grasp
from support.teams import (
    GRAVITY,
    TEAMS,
    Constants,
    adrift,
    bodies_of,
    team,
    with_grasps,
    with_world,
)

STIFF = 5000.0


def placed(scenario: Scenario, y: dict[str, float], **grasps: Any) -> Scenario:
    """Team on a bar, whose vehicles hover and hold it at other places along it."""
    agents = {}
    for name, agent in scenario.agents.items():
        signal = dataclasses.replace(agent.reference.y, value=y[name])
        agents[name] = dataclasses.replace(
            agent, reference=dataclasses.replace(agent.reference, y=signal)
        )
    assert scenario.world is not None
    held = tuple(
        dataclasses.replace(each, place=Vec3(0.0, y[each.agent], 0.0), **grasps)
        for each in scenario.world.grasps
    )
    return level(with_world(dataclasses.replace(scenario, agents=agents), grasps=held))


def level(scenario: Scenario) -> Scenario:
    """Team whose grasps are in the plane of the body's centre of mass: unequal loads,
    which tilt it, move no lever.
    """
    assert scenario.world is not None
    held = tuple(
        dataclasses.replace(each, place=Vec3(each.place.x, each.place.y, 0.0))
        for each in scenario.world.grasps
    )
    things = tuple(
        dataclasses.replace(each, position=Vec3(0.0, 0.0, 1.0))
        for each in scenario.world.objects
    )
    return with_world(scenario, grasps=held, objects=things)


NIGHTLY = pytest.mark.thorough


@pytest.mark.parametrize(
    ("a", "b"),
    [
        pytest.param(0.19, 0.19, marks=NIGHTLY),
        (0.1, 0.3),
        pytest.param(0.3, 0.05, marks=NIGHTLY),
    ],
)
def test_two_ball_grasps_share_a_bar_by_their_distances(a: float, b: float) -> None:
    log = skyarm.run(placed(team("bar", duration=20.0), {"left": a, "right": -b}))
    weight, pulls = 0.104 * GRAVITY, log.grasp_pull[-1].reshape(2, 3)
    assert pulls[:, 2] == pytest.approx(
        [weight * b / (a + b), weight * a / (a + b)], abs=1e-6
    )
    thrust = {
        name: 3.5936999e-7 * (each.rotor_speeds[-1] ** 2).sum()
        for name, each in log.agents.items()
    }
    assert list(thrust.values()) == pytest.approx(
        0.25 * GRAVITY + pulls[:, 2], abs=1e-5
    )


def test_three_ball_grasps_share_a_plate_by_their_places() -> None:
    log = skyarm.run(level(team("triangle", duration=20.0)))
    places = np.array([[-0.094, -0.267], [0.3683, 0.0], [-0.094, 0.267]])
    shares = np.linalg.solve(
        np.vstack([np.ones(3), places.T]), [0.278 * GRAVITY, 0.0, 0.0]
    )
    assert log.grasp_pull[-1].reshape(3, 3)[:, 2] == pytest.approx(shares, abs=1e-6)


def test_a_grasp_pulls_by_its_stiffness_and_damping_and_an_opened_one_not_at_all() -> (
    None
):
    still = Vec3(0.0, 0.0, 0.0)
    one = Mat3(Vec3(1.0, 0.0, 0.0), Vec3(0.0, 1.0, 0.0), Vec3(0.0, 0.0, 1.0))
    body = CarriedFrame(position=still, rotation=one, velocity=still, turning=still)
    frame = dataclasses.replace(
        body, position=Vec3(0.302, 0.0, 0.0), velocity=Vec3(0.0, 0.1, 0.0)
    )
    grasp = Grasp(
        body="bar", place=Vec3(0.3, 0.0, 0.0), stiffness=STIFF, damping=7.0, release=2.0
    )
    assert tuple(grasp.pull((), frame, body, 1.9).force) == pytest.approx(
        (10.0, 0.7, 0.0), abs=1e-9
    )
    assert tuple(grasp.pull((), frame, body, 2.0).force) == (0.0, 0.0, 0.0)
    # a frame that turns with the body is at rest in it
    turning = dataclasses.replace(body, turning=Vec3(0.0, 0.0, 2.0))
    carried = dataclasses.replace(
        frame, velocity=turning.velocity_at(frame.position), turning=turning.turning
    )
    assert tuple(grasp.pull((), carried, turning, 0.0).force) == pytest.approx(
        (10.0, 0.0, 0.0), abs=1e-9
    )
    # over the patch of a fixed grasp: the sine of the angle, by stiffness times the
    # square of the radius
    fixed = dataclasses.replace(grasp, kind="fixed", radius=0.03, damping=0.0)
    turned = dataclasses.replace(
        frame, rotation=Quaternion.of_rotation_vector(E_X * 0.1).rotation()
    )
    torque = fixed.pull(one, turned, body, 0.0).torque
    assert tuple(torque) == pytest.approx(
        (STIFF * 0.03**2 * np.sin(0.1), 0.0, 0.0), abs=1e-12
    )


@pytest.mark.parametrize("plant", ["rigid_body", "mujoco"])
def test_an_opened_grasp_has_no_force_in_the_log_and_its_body_falls(plant: str) -> None:
    log = skyarm.run(
        with_grasps(team("bar", duration=0.2), release=0.1).with_kind(plant)
    )
    opened = log.time > 0.1 - 1e-9
    assert (log.grasp_force[opened] == 0.0).all()
    assert (log.grasp_pull[opened] == 0.0).all()
    assert (log.grasp_force[~opened][1:] > 0.1).all()
    falling = log.object_velocity[opened][:, 2]
    np.testing.assert_allclose(np.diff(falling), -GRAVITY * 0.005, rtol=0, atol=1e-9)


@pytest.mark.parametrize("kind", ["ball", "fixed"])
def test_a_grasp_closes_where_its_frame_then_is(kind: str) -> None:
    log = skyarm.run(with_grasps(team("bar", duration=1.5), close=0.1, kind=kind))
    before = log.time < 0.1 - 1e-9
    assert (log.grasp_force[before] == 0.0).all()
    fallen = log.object_position[0, 2] - log.object_position[before][-1, 2]
    assert fallen == pytest.approx(0.5 * GRAVITY * 0.095**2, rel=0.02)
    # the bar then hangs below the frames as it was at that instant, and the springs
    # bear it by their stretch alone
    closed = log.agents["left"].position[:, 2] - log.object_position[:, 2]
    assert closed[-1] == pytest.approx(
        closed[np.searchsorted(log.time, 0.1 - 1e-9)], abs=1e-3
    )
    assert log.grasp_pull[-1].reshape(2, 3)[:, 2] == pytest.approx(
        [0.5 * 0.104 * GRAVITY] * 2, abs=0.1
    )


def test_a_grasp_that_closes_in_flight_is_no_constraint_of_mujoco() -> None:
    late = with_grasps(team("bar"), close=0.1).with_kind("mujoco")
    with pytest.raises(
        ValueError,
        match=(
            r"world\.grasps\[0\]\.close = 0\.1: must be 0 where plant\.closure is"
            r" 'weld'"
        ),
    ):
        skyarm.run(
            dataclasses.replace(
                late, solver=dataclasses.replace(late.solver, closure="weld")
            )
        )


def test_a_squeezed_bar_is_pressed_by_two_springs_in_series() -> None:
    squeezed = placed(team("bar", duration=0.005), {"left": 0.19, "right": -0.19})
    assert squeezed.world is not None
    held = tuple(
        dataclasses.replace(
            each, place=Vec3(0.0, each.place.y * (1.0 + 0.001 / 0.19), 0.0)
        )
        for each in squeezed.world.grasps
    )
    log = skyarm.run(with_world(squeezed, grasps=held))
    assert log.grasp_pull[0].reshape(2, 3)[:, 1] == pytest.approx(
        [-0.5 * STIFF * 0.002, 0.5 * STIFF * 0.002], rel=1e-3
    )


@pytest.mark.parametrize(
    ("plant", "kind"),
    [
        ("rigid_body", "ball"),
        ("rigid_body", "fixed"),
        ("mujoco", "fixed"),
        pytest.param("mujoco", "ball", marks=NIGHTLY),
    ],
)
def test_momentum_of_all_bodies_stays(kind: str, plant: str) -> None:
    flown = adrift(with_grasps(team("bar", duration=2.0), kind=kind), 3).with_kind(
        plant
    )
    linear, angular = bodies_of(flown, skyarm.run(flown)).momentum
    assert np.abs(linear - linear[0]).max() < 1e-12 * np.abs(linear[0]).max()
    assert np.abs(angular - angular[0]).max() < 2e-3 * np.abs(angular[0]).max()


def test_momentum_and_energy_of_undamped_grasps_are_of_second_order(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    flown, errors = adrift(with_grasps(team("bar", duration=10.0), damping=0.0), 5), []
    for steps in (10, 20, 40):
        monkeypatch.setattr(
            RigidBodyPlant, "substeps", lambda _, __, n=steps: Steps(n, verlet=True)
        )
        log = skyarm.run(flown)
        bodies = bodies_of(flown, log)
        energy = bodies.kinetic + 0.5 / STIFF * (log.grasp_force**2).sum(axis=1)
        angular = bodies.momentum[1]
        errors.append(
            (
                np.abs(energy / energy[0] - 1.0).max(),
                np.abs(angular - angular[0]).max() / np.abs(angular[0]).max(),
            )
        )
    ratios = np.array(errors[:-1]) / np.array(errors[1:])
    assert ratios == pytest.approx(4.0, rel=0.25)
    assert errors[-1] < (1e-4, 1e-4)


@pytest.mark.parametrize(
    "kind", [pytest.param("ball", marks=NIGHTLY), "fixed", "cable"]
)
def test_both_plants_fly_the_same_grasps(
    kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(RigidBodyPlant, "substeps", lambda _, __: Steps(50))
    length = 0.01 if kind == "cable" else 0
    flown = adrift(with_grasps(team("bar", duration=1.0), kind=kind, length=length), 7)
    flown = dataclasses.replace(
        flown, rates=Rates(physics=10000, control=200, reference=200)
    )
    ours, theirs = skyarm.run(flown), skyarm.run(flown.with_kind("mujoco"))
    for name, own in ours.agents.items():
        for array in ("position", "quaternion", "velocity", "rate"):
            np.testing.assert_allclose(
                own[array], theirs.agents[name][array], rtol=0, atol=1e-8
            )
    for array in ("position", "quaternion", "velocity", "rate"):
        theirs_of = theirs.component(f"object_{array}")
        np.testing.assert_allclose(
            ours.component(f"object_{array}"), theirs_of, rtol=0, atol=1e-8
        )
    np.testing.assert_allclose(ours.grasp_pull, theirs.grasp_pull, rtol=0, atol=1e-6)


def test_both_plants_give_loads_faults_and_wind_to_the_same_agent() -> None:
    whole = team("bar", duration=0.4)
    weak = skyarm.Fault(rotor="front_left", effectiveness=0.8, start=0.05)
    load = skyarm.TimedPayload(
        name="load",
        mass=0.05,
        com=Vec3(0.02, 0.0, 0.0),
        frame="grip",
        pick=0.1,
        drop=9.0,
    )
    changed = dataclasses.replace(
        whole.agents["right"], faults=(weak,), payloads=(load,)
    )
    flown = dataclasses.replace(
        whole, agents={"left": whole.agents["left"], "right": changed}
    )
    plain, ours, theirs = (
        skyarm.run(each) for each in (whole, flown, flown.with_kind("mujoco"))
    )
    for name, own in ours.agents.items():
        assert np.abs(own.position - plain.agents[name].position).max() > 1e-3
        np.testing.assert_allclose(
            own.position, theirs.agents[name].position, rtol=0, atol=5e-5
        )
        np.testing.assert_allclose(
            own.quaternion, theirs.agents[name].quaternion, rtol=0, atol=5e-4
        )
    np.testing.assert_allclose(
        ours.object_position, theirs.object_position, rtol=0, atol=5e-5
    )


@pytest.mark.parametrize("plant", ["rigid_body", "mujoco"])
def test_a_fixed_grasp_keeps_the_attitude_in_which_each_vehicle_begins(
    plant: str,
) -> None:
    still = adrift(
        with_grasps(team("bar", duration=0.1), kind="fixed"), 1, speed=0.0, turning=0.0
    )
    turned = {"left": Vec3(0.3, 0.2, 0.5), "right": Vec3(-0.4, 0.1, -0.7)}
    agents = {
        name: dataclasses.replace(
            each,
            initial=dataclasses.replace(
                each.initial, quaternion=Quaternion.of_rotation_vector(turned[name])
            ),
        )
        for name, each in still.agents.items()
    }
    flown = dataclasses.replace(still, agents=agents).with_kind(plant)
    assert flown.world is not None
    log = skyarm.run(flown)
    assert np.abs(log.object_rate).max() < 1e-9
    for each in log.agents.values():
        assert np.abs(each.rate).max() < 1e-9


NEAR_TIP = 0.02
"""Mass (kg) of the lightest tip, for which steps are chosen."""


def oscillator(grasp: Grasp, thing: FreeObject) -> tuple[np.ndarray, np.ndarray]:
    """Stiffness and damping by inertia, M^-1 K and M^-1 D, of a body and the lightest
    tip in a grasp.
    """
    x, y, z = (float(c) for c in grasp.place)
    patch = float(grasp.radius) ** 2
    M = np.diag(
        [float(thing.mass)] * 3
        + [float(c) for c in thing.moments]
        + [NEAR_TIP] * 3
        + [NEAR_TIP * patch] * 3
    )
    J, none = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]), np.zeros((3, 3))
    rows = np.hstack([-np.eye(3), J, np.eye(3), none])
    shape = rows.T @ rows
    if grasp.kind == "fixed":
        turned = np.hstack([none, -np.eye(3), none, np.eye(3)])
        shape = shape + patch * turned.T @ turned
    return float(grasp.stiffness) * np.linalg.solve(M, shape), float(
        grasp.damping
    ) * np.linalg.solve(M, shape)


@pytest.mark.parametrize("kind", ["ball", "fixed"])
@pytest.mark.parametrize("mass", [0.005, 0.104, 2.0])
@pytest.mark.parametrize(
    ("stiffness", "damping"), [(5000.0, 0.0), (5000.0, 20.0), (50.0, 40.0), (1e5, 5.0)]
)
def test_the_step_of_a_grasp_is_that_of_its_fastest_pole(
    kind: str, mass: float, stiffness: float, damping: float
) -> None:
    place, size = Vec3(0.01, 0.19, 0.0097), (0.0276, 0.684, 0.0276)
    thing = FreeObject(name="bar", mass=mass, size=size)
    grasp = Grasp(
        body="bar",
        kind=kind,
        place=place,
        stiffness=stiffness,
        damping=damping,
        radius=0.04,
    )
    K, D = oscillator(grasp, thing)
    n = len(K)
    poles = np.linalg.eigvals(np.block([[np.zeros((n, n)), np.eye(n)], [-K, -D]]))
    undamped = np.sqrt(np.linalg.eigvals(K).real.max())
    h = float(grasp.step_of(thing, [grasp]))
    z = h * poles
    assert np.abs(1.0 + z + z**2 / 2.0 + z**3 / 6.0 + z**4 / 24.0).max() < 1.0 + 1e-6
    allowed = min(0.85 / undamped, 1.5 / np.abs(poles).max())
    # bounds of Gershgorin's: never longer, and not much shorter
    assert 0.25 * allowed < h < allowed * (1.0 + 1e-6)
    h = float(grasp.step_of(thing, [grasp], euler=True))
    step = np.block(
        [[np.eye(n) - h * h * K, h * (np.eye(n) - h * D)], [-h * K, np.eye(n) - h * D]]
    )
    assert np.abs(np.linalg.eigvals(step)).max() < 1.0 + 1e-6
    # of a semi-implicit step: stable within z^2 + 2 c z < 4, with z and c of the
    # fastest mode
    decay = np.linalg.eigvals(D).real.max()
    stable = (-decay + np.sqrt(decay**2 + 4.0 * undamped**2)) / undamped**2
    assert 0.15 * min(0.85 / undamped, stable) < h


SPEEDS = {
    "left": (1450.0, 1400.0, 1420.0, 1430.0),
    "right": (1380.0, 1470.0, 1400.0, 1410.0),
}
"""Rotor speeds, rad/s, of two vehicles that turn and move the bar between them."""


def steady(
    memory: Any, _measurement: Any, _reference: Any, _dt: Any, *, par: Any
) -> tuple[Any, Command]:
    """Law of constant rotor speeds."""
    return memory, Command(rotor_speeds=par.speeds, efforts=())


@dataclasses.dataclass(frozen=True, kw_only=True)
class Speeds(Constants):
    """Constants of the law of constant rotor speeds."""

    speeds: tuple[float, ...]


def under_speeds(
    agent: Any, vehicle: Any, speeds: tuple[float, ...], position: Vec3
) -> Any:
    """Agent that turns its rotors at constant speeds from the start, at rest."""
    state = State(
        position=position,
        quaternion=Quaternion(1.0, 0.0, 0.0, 0.0),
        velocity=Vec3(0.0, 0.0, 0.0),
        rate=Vec3(0.0, 0.0, 0.0),
        joints=(),
        joint_rates=(),
        rotor_speeds=speeds,
    )
    par = Speeds(model=skyarm.Model(vehicle=vehicle, gravity=GRAVITY), speeds=speeds)
    law = skyarm.Controller(name="steady", law=steady, par=par)
    truth = Truth(vehicle=vehicle, gravity=GRAVITY)
    return dataclasses.replace(agent, plant=truth, controller=law, initial=state)


def fused(scenario: Scenario) -> Any:
    """Vehicle of one body: two vehicles and the bar that they hold, about the bar's
    middle.
    """
    (own, _), bar = scenario.agents.values(), scenario.world.objects[0]  # type: ignore[union-attr]
    quad = own.plant.vehicle
    places = {"left": Vec3(0.0, 0.19, 0.0097), "right": Vec3(0.0, -0.19, 0.0097)}
    parts = [
        (
            float(quad.base.mass),
            np.diag([6.01e-4, 5.89e-4, 1.076e-3]),
            np.array([*each]),
        )
        for each in places.values()
    ]
    parts.append(
        (float(bar.mass), np.diag([float(c) for c in bar.moments]), np.zeros(3))
    )
    mass = sum(each[0] for each in parts)
    com = sum(each[0] * each[2] for each in parts) / mass
    inertia = sum(
        J + m * (((r - com) @ (r - com)) * np.eye(3) - np.outer(r - com, r - com))
        for m, J, r in parts
    )
    base = Body(mass=mass, com=Vec3(*com), inertia=inertia)
    rotors = tuple(
        dataclasses.replace(
            each, name=f"{name}_{each.name}", position=each.position + place
        )
        for name, place in places.items()
        for each in quad.rotors
    )
    return dataclasses.replace(quad, base=base, rotors=rotors, frames=())


def test_stiff_grasps_make_one_rigid_body(monkeypatch: pytest.MonkeyPatch) -> None:
    whole, gaps = team("bar", duration=0.3), []
    one = whole.of("left").agent
    bar = Vec3(0.0, 0.0, 0.9903)
    rates = Rates(physics=200, control=200, reference=200)
    still = dataclasses.replace(whole.environment, world=None)
    rigid = dataclasses.replace(
        whole,
        rates=rates,
        environment=still,
        agents={
            "main": under_speeds(
                one, fused(whole), (*SPEEDS["left"], *SPEEDS["right"]), bar
            )
        },
    )
    monkeypatch.setattr(RigidBodyPlant, "substeps", lambda _, __: Steps(200))
    wanted = skyarm.run(rigid)
    at = {"left": Vec3(0.0, 0.19, 1.0), "right": Vec3(0.0, -0.19, 1.0)}
    for stiffness in (1e3, 1e4, 1e5):
        held = with_grasps(
            whole,
            kind="fixed",
            stiffness=stiffness,
            damping=0.05 * stiffness**0.5,
            radius=0.1,
        )
        agents = {
            name: under_speeds(each, each.plant.vehicle, SPEEDS[name], at[name])
            for name, each in held.agents.items()
        }
        log = skyarm.run(dataclasses.replace(held, rates=rates, agents=agents))
        gaps.append(np.abs(log.object_position - wanted.position).max())
    slope = np.polyfit(np.log10([1e3, 1e4, 1e5]), np.log10(gaps), 1)[0]
    assert slope == pytest.approx(-1.0, abs=0.1)
    assert gaps[-1] < 1e-4


@pytest.mark.parametrize(
    ("apart", "parting", "tension"),
    [
        (0.51, 0.0, 8.0),
        # damping adds to the pull of ends that part, and takes from that of ends that
        # meet
        (0.51, 1.0, 11.0),
        (0.51, -1.0, 5.0),
        (0.51, -5.0, 0.0),
        # slack, though -8 N of the spring and 15 N of the damper add up to a pull
        (0.49, 5.0, 0.0),
        (0.49, 0.0, 0.0),
        (0.49, -5.0, 0.0),
    ],
)
def test_a_slack_cable_has_no_force_however_fast_its_ends_part(
    apart: float, parting: float, tension: float
) -> None:
    cable = Grasp(body="bar", kind="cable", length=0.5, stiffness=800.0, damping=3.0)
    one, none = Mat3(Vec3(1, 0, 0), Vec3(0, 1, 0), Vec3(0, 0, 1)), Vec3(0.0, 0.0, 0.0)
    along = np.array([0.6, 0.0, 0.8])
    hand = CarriedFrame(position=none, rotation=one, velocity=none, turning=none)
    away = (Vec3(*(scale * along)) for scale in (apart, parting))
    body = dataclasses.replace(hand, position=next(away), velocity=next(away))
    np.testing.assert_allclose(
        [*cable.pull((), hand, body, 0.0).force], -tension * along, rtol=0, atol=1e-9
    )
    # the same where the vehicle's end moves
    moved = dataclasses.replace(hand, velocity=body.velocity * -1.0)
    held = dataclasses.replace(body, velocity=none)
    np.testing.assert_allclose(
        [*cable.pull((), moved, held, 0.0).force], -tension * along, rtol=0, atol=1e-9
    )


def test_a_cable_pulls_and_never_pushes_and_gains_no_energy() -> None:
    rng, drops = np.random.default_rng(11), 200
    mass, dt = 0.1, 1e-4
    for damping in (0.0, 3.0):
        cable = Grasp(
            body="bar", kind="cable", length=0.5, stiffness=800.0, damping=damping
        )
        position, velocity = (
            0.4 * rng.uniform(-1.0, 1.0, (3, drops)),
            rng.uniform(-1.0, 1.0, (3, drops)),
        )
        one, none = (
            Mat3(Vec3(1, 0, 0), Vec3(0, 1, 0), Vec3(0, 0, 1)),
            Vec3(0.0, 0.0, 0.0),
        )
        hand = CarriedFrame(position=none, rotation=one, velocity=none, turning=none)

        def pulled(
            position: Any,
            velocity: Any,
            cable: Grasp = cable,
            hand: CarriedFrame = hand,
        ) -> Any:
            body = dataclasses.replace(
                hand, position=Vec3(*position), velocity=Vec3(*velocity)
            )
            return np.array([*cable.pull((), hand, body, 0.0).force])

        def energy(position: Any, velocity: Any, cable: Grasp = cable) -> Any:
            stretch = np.maximum(np.linalg.norm(position, axis=0) - 0.5, 0.0)
            moving = 0.5 * mass * (velocity**2).sum(axis=0)
            return (
                moving
                + mass * GRAVITY * position[2]
                + 0.5 * float(cable.stiffness) * stretch**2
            )

        start, most, slack = (
            energy(position, velocity),
            np.full(drops, -np.inf),
            np.zeros(drops, dtype=bool),
        )
        for k in range(6_000):
            position = position + 0.5 * dt * velocity
            force = pulled(position, velocity)
            assert ((force * position).sum(axis=0) <= 1e-12).all()
            slack |= (force == 0.0).all(axis=0)
            velocity = velocity + dt * (
                force / mass - np.array([[0.0], [0.0], [GRAVITY]])
            )
            position = position + 0.5 * dt * velocity
            if k % 5 == 0:  # a swing of the cable takes 700 steps
                most = np.maximum(most, energy(position, velocity))
        # of second order in the step, beside the energy above the lowest place at which
        # a drop hangs
        assert (most - start).max() < 1e-4 * (start + mass * GRAVITY * 0.5).max()
        assert slack.mean() > 0.9
        if damping:
            assert (energy(position, velocity) < start).mean() > 0.9


def test_a_bar_on_cables_hangs_below_its_vehicles() -> None:
    log = skyarm.run(team("cables", duration=20.0))
    assert log.grasp_force[-1] == pytest.approx(0.5 * 0.104 * GRAVITY, abs=1e-5)
    below = (
        np.array([each.position[-1, 2] for each in log.agents.values()])
        - log.object_position[-1, 2]
    )
    assert below == pytest.approx(
        0.5 + 0.0097 + 0.5 * 0.104 * GRAVITY / 2000.0, abs=1e-6
    )


def test_many_grasps_of_a_light_body_fly_as_stably_as_one() -> None:
    tables: dict[str, Any] = {
        "schema": 1,
        "name": "light",
        "duration": 0.5,
        "plant": {"vehicle": "dragonfly"},
        "controller": {"preset": "centroidal_joint"},
        "environment": {"ground": False},
        "agents": {
            f"a{i}": {
                "reference": {"base": {"kind": "hover", "position": [0.0, 0.0, 1.0]}}
            }
            for i in range(6)
        },
        "world": {
            "objects": [
                {
                    "name": "cube",
                    "shape": "box",
                    "size": [0.1] * 3,
                    "mass": 0.01,
                    "position": [0.0, 0.0, 1.0],
                }
            ],
            "grasps": [
                {"agent": f"a{i}", "frame": "grip", "body": "cube"} for i in range(6)
            ],
        },
    }
    log = skyarm.run(skyarm.scenario_from(tables, TEAMS))
    assert log.status == "completed"
    assert log.grasp_force[-1] == pytest.approx(0.01 * GRAVITY / 6, abs=2e-3)


def test_grasps_of_one_name_and_frames_lighter_than_the_steps_assume_are_refused() -> (
    None
):
    bar = team("bar")
    assert bar.world is not None
    first, second = bar.world.grasps
    with pytest.raises(
        ValueError,
        match=r"world\.grasps\[1\]\.name = 'left_bar': must be of one grasp only$",
    ):
        with_world(bar, grasps=(first, dataclasses.replace(second, agent="left")))
    light = skyarm.load_vehicle("crazyflie_arm1")
    with pytest.raises(
        ValueError,
        match=(
            r"^frame = '': its link of crazyflie_arm1 weighs 2\.5 g, must be 20 g or"
            r" more$"
        ),
    ):
        Grasp(body="bar").require_heavy(light)
    Grasp(body="bar").require_heavy(skyarm.load_vehicle("hummingbird_arm2"))


def test_a_path_of_what_all_share_has_no_name_of_a_vehicle() -> None:
    bar = team("bar")
    with pytest.raises(
        ValueError,
        match=(
            r"world\.objects\.bar\.mass': is of all agents, must be"
            r" world\.objects\.bar\.mass$"
        ),
    ):
        skyarm.with_numbers(bar, {"agents.left.world.objects.bar.mass": 0.2})
    heavier = skyarm.with_numbers(bar, {"world.objects.bar.mass": 0.2})
    assert heavier.world is not None
    assert heavier.world.objects[0].mass == 0.2
