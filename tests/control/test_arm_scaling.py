"""Joint accelerations that are scaled until the rotors reach: linear programs, the model's own dynamics, a flight."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.optimize import linprog

import skyarm
from skyarm import dynamics
from skyarm.actuation import allocation_matrix, make_mixer
from skyarm.algebra import Force, Mat3, Quaternion, Vec3
from skyarm.control.blocks.disturbance import Disturbance
from skyarm.control.controller import ControllerError
from skyarm.control.laws.centroidal import make_centroidal
from skyarm.control.laws.centroidal.arm_scaling import arm_share, largest_share, margins, reaction
from skyarm.control.laws.centroidal.demands import Demand, Planned
from skyarm.control.laws.centroidal.torques import actuate
from skyarm.control.model import Model
from skyarm.dynamics import State
from skyarm.reference import Constant, Product, Ramp, Sum, Trajectory
from skyarm.scalars.taylor import Taylor

VEHICLE = skyarm.load_vehicle("hexarotor_arm6")
ARM2 = skyarm.load_vehicle("hummingbird_arm2_rotors")
DT, GRAVITY = 0.005, 9.81
ZERO = Vec3(0.0, 0.0, 0.0)
KEPT = 0.1
POSTURE = (0.0, -0.4, 0.7, 0.0, -0.5, 0.0)


def array(values):
    return np.array([float(v) for v in values])


def vec(values):
    return Vec3(*map(float, values))


def program(a, b, top, m):
    """Largest s in [0, 1] within the limits of every rotor."""
    upper, lower = np.maximum(top - m, a + m), np.minimum(m, a - m)
    found = linprog([-1.0], A_ub=np.r_[b, -b][:, None], b_ub=np.r_[upper - a, a - lower], bounds=[(0.0, 1.0)])
    return float(found.x[0])


@pytest.mark.parametrize("vehicle", [VEHICLE, ARM2], ids=["six rotors", "four rotors"])
def test_the_share_is_the_largest_that_linear_programs_find(vehicle):
    mixer, rng, weight = make_mixer(vehicle, "priority"), np.random.default_rng(14), float(vehicle.mass) * GRAVITY
    inverse, top = np.array(mixer.inverse, dtype=float), array(mixer.highest)
    margin = array(margins(mixer, weight, KEPT))
    np.testing.assert_allclose(margin, KEPT * np.abs(inverse[:, 3]) * weight)
    arms = 0.5 * weight * np.array([0.17, 0.17, 0.016])
    found, yaw_helped = [], 0
    for _ in range(15):
        alone, arm = (vec(rng.normal(size=3) * arms * size) for size in (0.5, 2.0))
        thrust = rng.uniform(0.1, 2.0) * weight
        shares = []
        for turning in (0.0, 1.0):
            rows = inverse * [1.0, 1.0, turning, 1.0]
            shares.append(program(rows @ [*alone, thrust], rows @ [*arm, 0.0], top, margin))
        share = float(arm_share(mixer, alone, arm, thrust, margin.tolist()))
        assert share == pytest.approx(max(shares), abs=1e-7)
        found.append(share)
        yaw_helped += shares[1] > shares[0] + 1e-6
    assert min(found) < 0.3
    assert max(found) == 1.0
    assert yaw_helped  # now and then a yaw torque makes room


def test_an_arm_that_adds_nothing_is_never_slowed():
    mixer = make_mixer(ARM2, "priority")
    assert arm_share(mixer, vec((50.0, 0.0, 0.0)), ZERO, 1e3, [1.0] * 4) == 1.0


def law(vehicle, kept, **more):
    options = {"adaptation": 0.0, "lag_inversion": 0.0, "arm_scaling": kept, **more}
    return make_centroidal(Model(vehicle=vehicle, gravity=GRAVITY), mode="joint", **options).par


def commanded(vehicle, kept, joints, alpha, posture, *, limit=1e3, thrust=1.0):
    """Commands for accelerations, and the accelerations that follow from the model's forward dynamics."""
    strong = vehicle.with_joints(effort_limit=limit, damping=0.0, coulomb=0.0)
    par, n = law(strong, kept), strong.n
    assert n == len(posture)
    still = tuple(Taylor((0.0, 0.0, 0.0)) for _ in range(n))
    plan = Planned(R=Mat3.identity(), rate=ZERO, alpha=ZERO, proper=vec((0, 0, GRAVITY)), joints=still)
    rates, turning = tuple(0.5 * q for q in posture), vec((0.0, -0.2, 0.0))
    state = State(
        position=ZERO,
        quaternion=Quaternion(1.0, 0.0, 0.0, 0.0),
        velocity=ZERO,
        rate=turning,
        joints=posture,
        joint_rates=rates,
        rotor_speeds=(400.0,) * len(strong.rotors),
    )
    lift = thrust * float(strong.mass) * GRAVITY
    demand = Demand(thrust=lift, alpha=alpha, joints=joints, planned=plan)
    none = Disturbance(force=ZERO, torque=ZERO, efforts=(0.0,) * n)
    done = actuate(par, par.model, state, demand, none, (0.0,) * len(strong.rotors), 1.0, DT)
    squares = array(done.command.rotor_speeds) ** 2
    x, y, z, up = np.array(allocation_matrix(strong), dtype=float) @ squares
    pushed = Force(vec((x, y, z)), vec((0, 0, up)))
    base, qdd = dynamics.forward_dynamics(strong, posture, turning, rates, pushed, done.command.efforts)
    return done, squares / array(par.mixer.highest), array(base.angular), array(qdd), up / lift


PITCHING = [1, 2, 4]
"""Joints about y: their motion asks for no yaw torque, which would be given up first."""

ASKED = (0.0, -450.0, 600.0, 0.0, -225.0, 0.0)
TURN = vec((0.0, -6.0, 0.0))
MIXER = make_mixer(VEHICLE, "priority")
MARGIN = array(margins(MIXER, float(VEHICLE.mass) * GRAVITY, KEPT)) / array(MIXER.highest)


def test_the_base_turns_and_climbs_as_wanted_and_joints_slow_down_together():
    """What the rotors cannot give is taken from the joints: from all by one factor, and from nothing else."""
    _, speeds, angular, qdd, up = commanded(VEHICLE, KEPT, ASKED, TURN, POSTURE)
    share = qdd[PITCHING] / np.array(ASKED)[PITCHING]
    assert angular[:2] == pytest.approx(array(TURN)[:2], abs=1e-6)
    assert up == pytest.approx(1.0)
    assert 0.02 < share[0] < 0.9
    np.testing.assert_allclose(share, share[0], rtol=1e-6)
    # and no more than that: one rotor has nothing but its margin left
    room = np.minimum(speeds, 1.0 - speeds) - MARGIN
    assert room.min() == pytest.approx(0.0, abs=1e-9)
    # without it the attitude is what gives way
    _, _, angular, _, _ = commanded(VEHICLE, 0.0, ASKED, TURN, POSTURE)
    assert np.abs(angular[:2] - array(TURN)[:2]).max() > 5.0


def test_what_fits_is_not_touched():
    gentle = tuple(0.002 * each for each in ASKED)
    with_, without = (commanded(VEHICLE, kept, gentle, TURN, POSTURE)[0] for kept in (KEPT, 0.0))
    assert with_ == without


def test_a_rotor_that_is_beyond_its_limit_leaves_its_margin_to_the_arm():
    assert largest_share([105.0], [40.0], [100.0], [8.0]) == 0.2
    assert largest_share([-3.0], [-40.0], [100.0], [8.0]) == 0.2
    assert largest_share([105.0], [-40.0], [100.0], [8.0]) == 1.0  # the arm relieves it


def test_of_weak_joints_the_motion_which_is_left_is_scaled():
    weak = 8.0
    wanted = array(commanded(VEHICLE, 0.0, ASKED, TURN, POSTURE)[0].command.efforts)
    missing = wanted - np.clip(wanted, -weak, weak)
    left = np.array(ASKED) - array(reaction(VEHICLE, POSTURE).accelerations(missing.tolist()))
    done, _, angular, qdd, _ = commanded(VEHICLE, KEPT, ASKED, TURN, POSTURE, limit=weak)
    share = qdd[PITCHING] / left[PITCHING]
    assert np.abs(missing).max() > 1.0
    assert angular[:2] == pytest.approx(array(TURN)[:2], abs=1e-6)
    assert 0.02 < share[0] < 0.9
    np.testing.assert_allclose(share, share[0], rtol=1e-6)
    assert np.abs(array(done.command.efforts)).max() <= weak


def test_very_weak_joints_stay_within_their_torques():
    done, *_ = commanded(VEHICLE, KEPT, ASKED, TURN, POSTURE, limit=0.05)
    assert np.abs(array(done.command.efforts)).max() == 0.05


def test_it_is_left_out_by_nothing_and_without_joints():
    assert not law(ARM2, 0.0).scales_arm
    assert not law(skyarm.load_vehicle("hummingbird"), KEPT).scales_arm
    par = law(ARM2, KEPT)
    assert par.scales_arm
    assert "joints slowed where rotors do not reach" in par.choices()
    with pytest.raises(ControllerError, match=r"controller\.arm_scaling = 1\.5: must be at most 1"):
        law(ARM2, 1.5)


@pytest.mark.thorough
def test_a_step_of_a_strong_arm_hardly_moves_the_base():
    """All six joints step by 0.35 rad: 89 mm and 29 degrees without the option, 14 mm and 4 degrees with it."""
    there, back = (Ramp(start=start, duration=0.005, height=to) for start, to in ((0.3, 0.35), (2.5, -0.35)))
    joints = tuple(Product(Constant((-1.0) ** k), Sum((there, back))) for k in range(6))
    document = {
        "name": "step",
        "duration": 4.0,
        "plant": {"vehicle": "hexarotor_arm6"},
        "controller": {"preset": "centroidal_joint"},
        "reference": {"base": {"kind": "hover", "position": [0.0, 0.0, 2.0]}, "joints": [0.0] * 6},
    }
    found = skyarm.scenario_from(document)
    moved = dataclasses.replace(found, trajectory=Trajectory(z=Constant(2.0), joints=joints))
    off = {}
    for kept in (0.0, KEPT):
        flown = make_centroidal(moved.controller.par.model, preset="adaptive", joint_limits=False, arm_scaling=kept)
        log = skyarm.run(dataclasses.replace(moved, controller=flown))
        off[kept] = np.linalg.norm(log.position - [0.0, 0.0, 2.0], axis=1).max()
    assert off[KEPT] < 0.025
    assert off[0.0] > 0.05
