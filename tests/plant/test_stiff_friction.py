"""Joint friction that is fast against the integration step."""

import dataclasses
import math

import numpy as np
import pytest
from independent_flight import Flight

from skyarm.plant.compiled import RigidBodyPlant
from skyarm.plant.interface import Truth, example_command, flat
from skyarm.plant.joint_rate import friction_rate
from skyarm.plant.mujoco import MujocoPlant
from skyarm.records.leaves import leaves
from skyarm.scenario.scenario_record import trimmed_state
from skyarm.vehicle import VehicleError
from skyarm.vehicle.vehicle_files import load_vehicle
from support.vehicles import MujocoTwin, RandomState, steady_wind

TRUTH = load_vehicle("hummingbird_arm2_rotors")


def flown(plant, vehicle, dt, seconds=0.2):
    start = trimmed_state(Truth(vehicle=vehicle), (0.0, 0.0, 10.0), 0.0, (0.4, -0.3))
    x, command = flat(start), [*start.rotor_speeds, 0.02, -0.01]
    assert len(command) == len(leaves(example_command(2, 4)))
    for _ in range(round(seconds / dt)):
        x = plant.advance(x, command, (), dt)
    return np.array(x)


def test_the_decay_rate_is_that_of_one_joint_on_a_heavy_base():
    first = TRUTH.links[0]
    alone = dataclasses.replace(
        TRUTH,
        base=dataclasses.replace(TRUTH.base, mass=1e6, inertia=(1e6, 1e6, 1e6)),
        links=(
            dataclasses.replace(
                first, joint=dataclasses.replace(first.joint, damping=0.03)
            ),
        ),
        frames=(),
        end_effector="",
    )
    # a rod of 40 g and 0.15 m about its end: m L^2 / 3
    assert friction_rate(alone) == pytest.approx(
        0.03 / (0.04 * 0.15**2 / 3.0), rel=1e-6
    )


def bent(low, high, kind="revolute", **fields):
    """Two links of the shipped arm; the second joint's limits and kind are given."""
    first, second = TRUTH.links
    joint = dataclasses.replace(
        second.joint, kind=kind, lower=low, upper=high, **fields
    )
    return dataclasses.replace(
        TRUTH, links=(first, dataclasses.replace(second, joint=joint))
    )


def joint_mobility(vehicle, joints):
    """Joint accelerations that joint torques give, by MuJoCo's mass matrix."""
    state = RandomState(
        np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]), np.array(joints), np.zeros(8)
    )
    return np.linalg.inv(MujocoTwin(vehicle).mass_matrix(state))[6:, 6:]


def rate_at(vehicle, angle):
    """Largest decay rate with the second joint at an angle, damping being the only
    friction.
    """
    damping = np.diag([link.joint.damping for link in vehicle.links])
    return np.linalg.eigvals(joint_mobility(vehicle, (0.0, angle)) @ damping).real.max()


@pytest.mark.parametrize(
    ("kind", "low", "high", "tried"),
    [
        ("revolute", 1.3, 1.7, (1.3, 1.7)),
        ("revolute", -math.inf, math.inf, (-math.pi, math.pi)),
        ("revolute", 4.0, 4.5, (4.0, 4.5)),
        ("prismatic", -math.inf, math.inf, (-1.0, 1.0)),
        ("prismatic", -0.05, 0.02, (-0.05, 0.02)),
    ],
)
def test_the_rate_is_the_largest_that_a_joints_own_travel_allows(
    kind, low, high, tried
):
    # a link that slides 2 m away along the one before it: the nearer it comes, the
    # lighter the first joint turns
    slide = {"axis": (0, 0, 1), "position": (0, 0, -2.0)} if kind == "prismatic" else {}
    vehicle = bent(low, high, kind, **slide)
    largest = max(rate_at(vehicle, angle) for angle in np.linspace(*tried, 201))
    found = friction_rate(vehicle)
    # 64 samples and the place nearest to zero, against the largest of a fine scan
    assert largest * 0.98 < found < largest * (1.0 + 1e-9)


def test_without_friction_there_is_no_rate():
    assert friction_rate(TRUTH.with_joints(damping=0)) == 0.0


@pytest.mark.parametrize("product", [0.599, 0.79, 1.19, 2.39])
def test_the_step_keeps_the_error_of_the_fastest_mode_that_its_bound_promises(product):
    """Rates and steps whose product is just below a multiple of the bound, or of a
    looser one.
    """
    pytest.importorskip("scipy")
    period, here = 0.005, (0.4, -0.3)
    held = TRUTH.with_joints(damping=0.001, coulomb=0)
    joints = [
        # hardly any travel: the rate that chooses the step is the rate of this flight
        dataclasses.replace(link.joint, lower=angle - 1e-6, upper=angle + 1e-6)
        for link, angle in zip(held.links, here, strict=True)
    ]
    links = [
        dataclasses.replace(link, joint=joint)
        for link, joint in zip(held.links, joints, strict=True)
    ]
    held = dataclasses.replace(held, links=tuple(links))
    vehicle = held.with_joints(damping=0.001 * product / (period * friction_rate(held)))
    # nothing but the fastest mode: no weight, no thrust
    rates, modes = np.linalg.eig(joint_mobility(vehicle, here))
    mode = 0.3 * modes[:, np.argmax(rates)]
    world = Truth(vehicle=vehicle, gravity=0.0)
    start = dataclasses.replace(
        trimmed_state(world, (0.0, 0.0, 10.0), 0.0, here),
        joint_rates=tuple(mode.tolist()),
        rotor_speeds=(0.0,) * 4,
    )
    found = np.array(
        RigidBodyPlant(world, steady_wind()).advance(
            flat(start), (0.0,) * 6, (), period
        )
    )
    wanted = Flight(vehicle, 0.0, steady_wind()).fly(
        flat(start), (0.0,) * 4, (0.0,) * 2, period
    )
    # the promised 6e-4, rounded up
    assert np.abs(found - wanted)[15:17].max() < 6.5e-4 * np.abs(mode).max()
    assert np.abs(wanted)[15:17].max() == pytest.approx(
        math.exp(-product) * np.abs(mode).max(), rel=0.01
    )


@pytest.mark.parametrize("damping", [0.001, 0.02, 0.05])
def test_one_control_period_per_call_is_as_good_as_many_small_steps(damping):
    vehicle = TRUTH.with_joints(damping=damping)
    world = Truth(vehicle=vehicle)
    coarse = flown(RigidBodyPlant(world, steady_wind()), vehicle, 0.005)
    fine = flown(RigidBodyPlant(world, steady_wind()), vehicle, 0.00025)
    # 6e-4 of a mode that has decayed to a few thousandths of its start
    assert np.abs(coarse - fine)[:17].max() < 2e-5


def test_mujoco_holds_stiff_friction_for_short_steps_only():
    vehicle = TRUTH.with_joints(damping=0.05)
    world = Truth(vehicle=vehicle)
    ours = flown(RigidBodyPlant(world, steady_wind()), vehicle, 0.005)
    theirs = flown(MujocoPlant(world, steady_wind()), vehicle, 0.005)
    # first order in rate * step = 0.1, on angles of a tenth of a radian
    assert np.abs(ours - theirs)[13:15].max() < 2e-3


def test_mujocos_bodies_with_stage_loads_take_shorter_steps_in_stiff_friction():
    vehicle = TRUTH.with_joints(damping=0.3)
    assert 0.001 * friction_rate(vehicle) > 2.8, (
        "beyond which a step of fourth order is unstable"
    )
    world = Truth(vehicle=vehicle)
    ours = flown(RigidBodyPlant(world, steady_wind()), vehicle, 0.005)
    theirs = flown(MujocoPlant(world, steady_wind(), "rk4_staged"), vehicle, 0.005)
    # as between steps of the rigid-body plant alone, above
    assert np.abs(ours - theirs)[:17].max() < 2e-5


def test_friction_beyond_any_explicit_integrator_is_refused_by_joint_and_field():
    sticky = TRUTH.with_joints(coulomb=0.1, coulomb_rate=1e-4)
    with pytest.raises(
        VehicleError,
        match=(
            r"^joints\[joint2\].coulomb = 0.1: joint friction decays .* raise"
            r" coulomb_rate"
        ),
    ):
        RigidBodyPlant(Truth(vehicle=sticky), steady_wind())
