"""One rotor against the numbers of RotorS's motor plugin, worked out by hand."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from rotor_layouts import HUMMINGBIRD, K_F, K_M, hummingbird_rotor
from scipy.integrate import quad

from skyarm.algebra import Vec3
from skyarm.compile import trace
from skyarm.dynamics.actuators import Command, rotor_force, rotor_forces, speed_after
from skyarm.dynamics.actuators.rotor import equivalent_speed_and_lag, has_short_lag
from skyarm.dynamics.state import example_state
from skyarm.plant.compiled import RigidBodyPlant
from skyarm.plant.interface import Truth, flat
from skyarm.plant.mujoco import MujocoPlant
from skyarm.plant.rigid_body import coupled_verlet
from skyarm.plant.surroundings import Surroundings, Together
from skyarm.vehicle.battery import rotor_power
from skyarm.vehicle.thrust_table import ThrustTable
from skyarm.vehicle.vehicle_files import load_vehicle

ROTOR = hummingbird_rotor()
UP = [(0.01, 0.449329), (0.005, 0.670320), (0.002, 0.852144), (0.001, 0.923116)]
DOWN = [(0.01, 0.670320), (0.005, 0.818731), (0.002, 0.923116), (0.001, 0.960789)]
STILL = Vec3(0.0, 0.0, 0.0)


def array(v):
    return np.array(tuple(v), dtype=float)


@pytest.mark.parametrize(("dt", "left"), UP)
def test_a_rising_speed_lags_by_the_short_time_constant(dt, left):
    # the table has six digits
    assert speed_after(ROTOR, 0.0, 1.0, dt) == pytest.approx(1.0 - left, abs=1e-6)
    assert speed_after(ROTOR, 300.0, 500.0, dt) == pytest.approx(
        500.0 - 200.0 * left, abs=2e-4
    )


@pytest.mark.parametrize(("dt", "left"), DOWN)
def test_a_falling_speed_lags_by_the_long_time_constant(dt, left):
    assert speed_after(ROTOR, 1.0, 0.0, dt) == pytest.approx(left, abs=1e-6)
    assert speed_after(ROTOR, 500.0, 300.0, dt) == pytest.approx(
        300.0 + 200.0 * left, abs=2e-4
    )


def test_the_lag_is_a_semigroup():
    """Two half periods are one period, as only the exact solution has it."""
    for speed, command in ((200.0, 700.0), (700.0, 200.0), (500.0, 500.0)):
        halves = speed_after(
            ROTOR, speed_after(ROTOR, speed, command, 0.0025), command, 0.0025
        )
        assert halves == pytest.approx(
            speed_after(ROTOR, speed, command, 0.005), rel=1e-15
        )


def test_a_held_speed_stays():
    assert speed_after(ROTOR, 485.08, 485.08, 0.005) == 485.08


def test_a_command_above_the_limit_is_the_limit():
    assert speed_after(ROTOR, 700.0, 5000.0, 0.005) == speed_after(
        ROTOR, 700.0, 838.0, 0.005
    )
    assert speed_after(ROTOR, 0.0, 1e9, 10.0) == pytest.approx(838.0, rel=1e-12)
    # a limit decides the direction too: a rotor above it slows down with the long time
    # constant
    assert speed_after(ROTOR, 900.0, 5000.0, 0.005) == pytest.approx(
        838.0 + 62.0 * 0.818731, abs=1e-4
    )


def test_four_rotors_at_hover_speed_carry_the_weight():
    thrust = sum(
        rotor_force(rotor, 485.08, STILL).force.z for rotor in HUMMINGBIRD.rotors
    )
    assert thrust == pytest.approx(0.82103 * 9.8, rel=2e-5)  # the speed has five digits


def test_four_rotors_at_the_limit_give_24_newtons():
    thrust = sum(
        rotor_force(rotor, 838.0, STILL).force.z for rotor in HUMMINGBIRD.rotors
    )
    assert thrust == pytest.approx(24.01, abs=0.005)


@pytest.mark.parametrize(("direction", "sign"), [(1, -1.0), (-1, 1.0)])
def test_the_drag_torque_is_against_the_rotation(direction, sign):
    force = rotor_force(hummingbird_rotor(direction=direction), 500.0, STILL)
    thrust = 8.54858e-6 * 250000.0
    np.testing.assert_allclose(array(force.force), [0.0, 0.0, thrust], rtol=1e-15)
    np.testing.assert_allclose(
        array(force.torque), [0.0, 0.0, sign * 0.016 * thrust], rtol=1e-15
    )


def test_thrust_lifts_the_side_of_the_hub():
    """Positive roll lifts +y; positive pitch lowers +x."""
    left = rotor_force(hummingbird_rotor(position=Vec3(0.0, 0.17, 0.01)), 500.0, STILL)
    front = rotor_force(hummingbird_rotor(position=Vec3(0.17, 0.0, 0.01)), 500.0, STILL)
    moment = 0.17 * 8.54858e-6 * 250000.0
    np.testing.assert_allclose(
        array(left.torque)[:2], [moment, 0.0], rtol=1e-15, atol=1e-18
    )
    np.testing.assert_allclose(
        array(front.torque)[:2], [0.0, -moment], rtol=1e-15, atol=1e-18
    )


def test_hub_drag_is_against_the_motion_in_the_plane_of_the_rotor():
    force = rotor_force(ROTOR, 492.2, Vec3(2.0, -1.0, 5.0))
    c = 8.06428e-5 * 492.2
    np.testing.assert_allclose(array(force.force)[:2], [-2.0 * c, 1.0 * c], rtol=1e-14)
    # no loss of thrust in climb
    assert force.force.z == pytest.approx(8.54858e-6 * 492.2**2, rel=1e-14)


def test_hub_drag_in_two_metres_per_second_of_wind_is_that_of_the_spec():
    """Four rotors at 492.2 rad/s, tilted -0.2804 rad into 2 m/s: 0.2932 N along the
    wind, 0.0845 N of lift.
    """
    c, s = math.cos(-0.2804), math.sin(-0.2804)
    still_air_B = Vec3(-2.0 * c, 0.0, -2.0 * s)  # R_y^T (-2, 0, 0)
    total = np.zeros(3)
    for rotor in HUMMINGBIRD.rotors:
        force = rotor_force(rotor, 492.2, still_air_B).force
        total += [force.x, force.y, force.z - 8.54858e-6 * 492.2**2]
    along, lift = c * total[0] + s * total[2], -s * total[0] + c * total[2]
    assert along == pytest.approx(0.2932, abs=1e-4)
    assert lift == pytest.approx(0.0845, abs=1e-4)


def test_the_rolling_moment_is_against_the_motion_in_the_plane_of_the_rotor():
    torque = rotor_force(ROTOR, 500.0, Vec3(3.0, -2.0, 7.0)).torque
    np.testing.assert_allclose(array(torque)[:2], [-3.0 * 5e-4, 2.0 * 5e-4], rtol=1e-14)


def blades(direction, speed, forward, count=720):
    """Mean thrust (N) and torque (N m) of a rotor with blades of one pitch in a flow
    along its plane.

    Blade element theory without inflow (Leishman 2006, chapter 3): lift along the axis
    of thrust by the squared speed of the element across its span, at the places of one
    turn. Backwards the same blade pushes the other way.
    """
    azimuth = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)[:, None]
    radius = np.linspace(0.02, 0.12, 51)[None, :]
    place = np.stack(
        [np.cos(azimuth) * radius, np.sin(azimuth) * radius, 0.0 * azimuth * radius],
        axis=-1,
    )
    along = np.cross([0.0, 0.0, direction * np.sign(speed)], place / radius[..., None])
    across = abs(speed) * radius + along @ np.array([*forward, 0.0])
    lift = np.sign(speed) * 1e-3 * across**2 * (0.1 / 50)
    force = np.stack([0.0 * lift, 0.0 * lift, lift], axis=-1)
    return force.sum(axis=1).mean(axis=0), np.cross(place, force).sum(axis=1).mean(
        axis=0
    )


@pytest.mark.parametrize("direction", [1, -1])
@pytest.mark.parametrize("speed", [500.0, -500.0])
def test_a_signed_rolling_moment_is_that_of_the_advancing_blade(direction, speed):
    """One coefficient for both senses of rotation, forwards and backwards, and for
    every flow along the plane.
    """
    _, unit = blades(1, 1.0, (1.0, 0.0))
    coefficient = -unit[0]
    rotor = hummingbird_rotor(
        direction=direction,
        reversible=True,
        rolling="signed",
        rolling_moment_coefficient=float(coefficient),
    )
    assert coefficient > 0.0
    for forward in ((3.0, -2.0), (-1.0, 4.0)):
        found = rotor_force(rotor, speed, Vec3(*forward, 0.5)).torque
        _, expected = blades(direction, speed, forward)
        np.testing.assert_allclose(array(found)[:2], expected[:2], rtol=1e-9)


def test_a_rotor_backwards_is_the_turned_rotor_forwards():
    """Thrust, drag torque, hub drag and rolling moment at -W: those of the axis turned
    round at W.
    """
    fields = {
        "reversible": True,
        "rolling": "signed",
        "position": Vec3(0.1, -0.2, 0.03),
        "direction": -1,
    }
    here, there = (
        hummingbird_rotor(**fields),
        hummingbird_rotor(**fields, axis=Vec3(0, 0, -1)),
    )
    velocity, rate = Vec3(3.0, -2.0, 1.0), Vec3(0.3, 0.2, -0.4)
    back, ahead = (
        rotor_forces([here], [-400.0], velocity, rate),
        rotor_forces([there], [400.0], velocity, rate),
    )
    np.testing.assert_allclose(array(back.force), array(ahead.force), rtol=1e-14)
    np.testing.assert_allclose(array(back.torque), array(ahead.torque), rtol=1e-14)
    table = ThrustTable(
        speed=(200.0, 400.0, 800.0), thrust=(0.3, 1.3, 5.2), torque=(0.006, 0.02, 0.08)
    )
    tabled = [dataclasses.replace(each, table=table) for each in (here, there)]
    back = rotor_forces(tabled[:1], [-500.0], STILL, STILL)
    ahead = rotor_forces(tabled[1:], [500.0], STILL, STILL)
    np.testing.assert_allclose(array(back.force), array(ahead.force), rtol=1e-14)
    np.testing.assert_allclose(array(back.torque), array(ahead.torque), rtol=1e-14)


def test_power_of_a_rotor_backwards_is_that_forwards():
    rotor = hummingbird_rotor(reversible=True)
    assert (
        rotor_power([rotor], [-400.0], 0.7, 11.1)
        == rotor_power([rotor], [400.0], 0.7, 11.1)
        > 0.0
    )


def test_hub_drag_at_a_raised_hub_pitches_the_vehicle():
    """Drag 0.01 m above the origin: r x F = (0, 0.01 F_x, 0), beside the rolling
    moment.
    """
    rotor = hummingbird_rotor(position=Vec3(0.0, 0.0, 0.01))
    torque = rotor_force(rotor, 500.0, Vec3(2.0, 0.0, 0.0)).torque
    drag = -8.06428e-5 * 500.0 * 2.0
    np.testing.assert_allclose(
        array(torque)[:2], [-2.0 * 5e-4, 0.01 * drag], rtol=1e-14
    )


def test_a_tilted_rotor_is_a_turned_rotor():
    """Everything of a rotor with a turned axis, turned back, is that of the upright
    rotor.
    """
    from scipy.spatial.transform import Rotation

    rng = np.random.default_rng(5)
    for seed in range(20):
        R = Rotation.random(rng=np.random.default_rng(seed)).as_matrix()
        position, velocity = rng.normal(size=3), 3.0 * rng.normal(size=3)
        upright = hummingbird_rotor(position=Vec3(*position.tolist()), direction=-1)
        turned = hummingbird_rotor(
            position=Vec3(*(R @ position).tolist()),
            axis=Vec3(*(R @ [0.0, 0.0, 1.0]).tolist()),
            direction=-1,
        )
        a = rotor_force(upright, 400.0, Vec3(*velocity.tolist()))
        b = rotor_force(turned, 400.0, Vec3(*(R @ velocity).tolist()))
        np.testing.assert_allclose(array(b.force), R @ array(a.force), atol=1e-14)
        np.testing.assert_allclose(array(b.torque), R @ array(a.torque), atol=1e-14)


def test_air_only_takes_energy_from_a_moving_rotor():
    """Hub drag and the rolling moment of a hub that moves without turning: power = F v
    is never positive.
    """
    rng = np.random.default_rng(6)
    for _ in range(100):
        axis = rng.normal(size=3)
        rotor = hummingbird_rotor(axis=Vec3(*(axis / np.linalg.norm(axis)).tolist()))
        velocity = Vec3(*rng.normal(size=3).tolist())
        moving, still = (
            rotor_force(rotor, 500.0, velocity),
            rotor_force(rotor, 500.0, STILL),
        )
        assert (moving.force - still.force).dot(velocity) < 0.0


def test_a_rotor_at_rest_does_nothing():
    force = rotor_force(
        hummingbird_rotor(position=Vec3(0.1, 0.2, 0.3)), 0.0, Vec3(3.0, 2.0, 1.0)
    )
    np.testing.assert_array_equal(array(force.force), np.zeros(3))
    np.testing.assert_array_equal(array(force.torque), np.zeros(3))


def test_a_batch_is_a_loop_of_singles():
    rng = np.random.default_rng(7)
    rotor = hummingbird_rotor(position=Vec3(0.1, -0.2, 0.03), axis=Vec3(0.6, 0.0, 0.8))
    speed, command = rng.uniform(0.0, 838.0, size=(2, 32))
    velocity = rng.normal(size=(3, 32))
    force, after = (
        rotor_force(rotor, speed, Vec3(*velocity)),
        speed_after(rotor, speed, command, 0.005),
    )
    for lane in range(32):
        single = rotor_force(
            rotor, float(speed[lane]), Vec3(*velocity[:, lane].tolist())
        )
        np.testing.assert_array_equal(
            [c[lane] for c in force.force], array(single.force)
        )
        np.testing.assert_array_equal(
            [c[lane] for c in force.torque], array(single.torque)
        )
        assert after[lane] == speed_after(
            rotor, float(speed[lane]), float(command[lane]), 0.005
        )


def test_an_upright_rotor_needs_few_products():
    """W W, k W^2, thrust k_m, two of drag, two of the rolling moment and their
    coefficients: nothing with 0 or 1.
    """
    program = trace(lambda speed, v: rotor_force(ROTOR, speed, v), 1.0, STILL)
    tilted = trace(
        lambda speed, v: rotor_force(
            hummingbird_rotor(axis=Vec3(0.6, 0.0, 0.8)), speed, v
        ),
        1.0,
        STILL,
    )
    assert program.operations()["mul"] == 3 + 2 + 2 + 2
    assert tilted.operations()["mul"] > 2 * program.operations()["mul"]


def test_the_coefficients_are_those_of_the_spec():
    assert (K_F, K_M) == (8.54858e-6, 0.016)


def vectors_of(rotor, speed, velocity, rate):
    """Torque and force of one rotor in NumPy, straight from the motor plugin's
    lines.
    """
    r, n = array(rotor.position), array(rotor.axis)
    hub = velocity + np.cross(rate, r)
    across = hub - (hub @ n) * n
    thrust = rotor.thrust_coefficient * speed**2
    force = thrust * n - rotor.drag_coefficient * speed * across
    torque = -rotor.direction * rotor.moment_coefficient * thrust * n
    return (
        np.cross(r, force) + torque - rotor.rolling_moment_coefficient * speed * across,
        force,
    )


@pytest.mark.parametrize(
    "name",
    ["hummingbird", "hexarotor_arm6", "octo_coaxial_two_arms", "tilted_hexarotor"],
)
def test_forces_of_many_rotors_are_the_sum_of_each_ones(name):
    """Alike, coaxial, tilted, and one of them with a drag of its own; rounding only."""
    rng = np.random.default_rng(8)
    rotors = load_vehicle(name).rotors
    for vehicle in (
        rotors,
        (dataclasses.replace(rotors[0], drag_coefficient=3e-4), *rotors[1:]),
    ):
        speeds, velocity, rate = (
            rng.uniform(200.0, 700.0, len(rotors)),
            rng.normal(size=3) * 5.0,
            rng.normal(size=3),
        )
        found = rotor_forces(
            vehicle, speeds.tolist(), Vec3(*velocity.tolist()), Vec3(*rate.tolist())
        )
        each = [
            vectors_of(rotor, speed, velocity, rate)
            for rotor, speed in zip(vehicle, speeds, strict=True)
        ]
        torque, force = (sum(parts) for parts in zip(*each, strict=True))
        assert np.allclose(array(found.torque), torque, rtol=0.0, atol=1e-13)
        assert np.allclose(array(found.force), force, rtol=0.0, atol=1e-13)


@pytest.mark.parametrize("lag", [1.3e-3, 5e-4, 1e-4])
def test_a_short_lag_has_its_exact_impulse_of_thrust_and_spin(lag):
    """Thrust by the integral of w^2, yaw by that and by the spin that the rotors have
    gained, without air.
    """
    bare = load_vehicle("hummingbird")
    numbers = {"drag_coefficient": 0, "rolling_moment_coefficient": 0, "inertia": 3e-5}
    rotors = tuple(
        dataclasses.replace(
            r, time_constant_up=lag, time_constant_down=1.5 * lag, **numbers
        )
        for r in bare.rotors
    )
    vehicle, commands = (
        dataclasses.replace(bare, rotors=rotors),
        (
            600.0,
            350.0,
            600.0,
            250.0,
        ),
    )
    plant = RigidBodyPlant(Truth(vehicle=vehicle, gravity=0.0), Surroundings())
    x = flat(dataclasses.replace(example_state(0, 4), rotor_speeds=(300.0,) * 4))
    for _ in range(2):
        x = plant.advance(x, commands, (0.0,), 0.005)
    lift = yaw = 0.0
    for rotor, command in zip(rotors, commands, strict=True):
        tau = lag if command > 300.0 else 1.5 * lag
        square = quad(
            lambda t, c=command, tau=tau: (c + (300.0 - c) * math.exp(-t / tau)) ** 2,
            0.0,
            0.01,
            points=[tau, 5 * tau],
            epsabs=1e-6,
        )[0]
        lift += rotor.thrust_coefficient * square
        yaw -= (
            rotor.direction
            * rotor.moment_coefficient
            * rotor.thrust_coefficient
            * square
        )
        yaw -= (
            rotor.direction * 3e-5 * (command - 300.0) * (1.0 - math.exp(-0.01 / tau))
        )
    assert x[9] * float(vehicle.mass) == pytest.approx(lift, rel=1e-6)
    assert x[12] * float(vehicle.base.inertia.zz) == pytest.approx(yaw, rel=2e-3)


@pytest.mark.parametrize(
    ("lag", "least", "most"), [(6e-3, 0.01, 0.011), (7e-3, 0.007, 0.01)]
)
def test_simpsons_rule_through_zero_errs_by_1_percent_up_to_the_bound(lag, least, most):
    """Largest error of the mean w |w| over 5 ms by SciPy, as a share of the commanded
    change of it.
    """
    errors = []
    for share in np.linspace(0.02, 1.0, 50):
        for first, last in ((1.0, -share), (share, -1.0)):
            speed = lambda t, a=first, b=last: b + (a - b) * math.exp(-t / lag)  # noqa: E731
            push = lambda t, w=speed: w(t) * abs(w(t))  # noqa: E731
            zero = min(lag * math.log((last - first) / last), 0.005)
            exact = (quad(push, 0.0, zero)[0] + quad(push, zero, 0.005)[0]) / 0.005
            simpson = (push(0.0) + 4.0 * push(0.0025) + push(0.005)) / 6.0
            errors.append(abs(simpson - exact) / (first**2 + last**2))
    assert least < max(errors) < most
    rotor = dataclasses.replace(
        ROTOR, time_constant_up=lag, time_constant_down=lag, reversible=True
    )
    assert has_short_lag(rotor) is (most > 0.01)
    assert not has_short_lag(dataclasses.replace(rotor, reversible=False))


@pytest.mark.parametrize("lag", [3e-3, 6.9e-3])
def test_a_reversible_rotor_has_its_exact_impulse_through_zero(lag):
    """Runge-Kutta's steps of 4 ms from 400 to -300 rad/s, whose velocity by SciPy is
    the integral of w |w|.
    """
    bare = load_vehicle("hummingbird")
    numbers = {
        "drag_coefficient": 0,
        "rolling_moment_coefficient": 0,
        "reversible": True,
    }
    rotors = tuple(
        dataclasses.replace(r, time_constant_up=lag, time_constant_down=lag, **numbers)
        for r in bare.rotors
    )
    vehicle = dataclasses.replace(bare, rotors=rotors)
    plant = RigidBodyPlant(Truth(vehicle=vehicle, gravity=0.0), Surroundings())
    x = flat(dataclasses.replace(example_state(0, 4), rotor_speeds=(400.0,) * 4))
    x = plant.advance(x, (-300.0,) * 4, (0.0,), 0.004)
    zero = lag * math.log(700.0 / 300.0)
    pieces = [(0.0, min(zero, 0.004)), (min(zero, 0.004), 0.004)]
    speed = lambda t: -300.0 + 700.0 * math.exp(-t / lag)  # noqa: E731
    square = sum(
        quad(lambda t: speed(t) * abs(speed(t)), *piece)[0] for piece in pieces
    )
    lift = sum(float(r.thrust_coefficient) for r in rotors) * square
    assert x[9] * float(vehicle.mass) == pytest.approx(lift, rel=1e-6)


@pytest.mark.parametrize("seed", range(12))
def test_the_felt_speed_has_the_mean_thrust_and_the_felt_lag_the_mean_spin(seed):
    """Mean of w |w| and of dw/dt by SciPy, over drawn steps: to a stop, from one,
    through zero, and at rest.
    """
    rng = np.random.default_rng(seed)
    lag, dt = 10.0 ** rng.uniform(-4.0, -1.5), rng.choice([1e-3, 5e-3])
    first, last = rng.uniform(-800.0, 800.0, 2) * rng.choice(
        [0.0, 1.0], 2, p=[0.2, 0.8]
    )
    forward = seed % 3 == 0
    first, last = (abs(first), abs(last)) if forward else (first, last)
    numbers = {
        "time_constant_up": lag,
        "time_constant_down": lag,
        "max_speed": 900.0,
        "reversible": not forward,
    }
    rotor = dataclasses.replace(ROTOR, **numbers)
    felt, slow = equivalent_speed_and_lag(rotor, first, last, dt)

    def speed(t):
        return last + (first - last) * math.exp(-t / lag)

    points = [t for t in (lag, 3.0 * lag) if t < dt]
    if first * last < 0.0:
        points += [t for t in [lag * math.log((last - first) / last)] if t < dt]
    mean = (
        quad(
            lambda t: speed(t) * abs(speed(t)),
            0.0,
            dt,
            points=points or None,
            epsabs=1e-9,
            limit=200,
        )[0]
        / dt
    )
    assert felt * abs(felt) == pytest.approx(mean, rel=1e-8, abs=1e-6)
    if abs(first - last) > 1.0:
        assert (last - felt) / slow == pytest.approx((speed(dt) - first) / dt, rel=1e-9)
    assert (
        equivalent_speed_and_lag(rotor, last, last, dt)
        == pytest.approx((last, lag), rel=1e-12)
        or last == 0.0
    )


@pytest.mark.parametrize(
    "plant",
    ["rk4", "euler", "mujoco rk4", "mujoco euler", "mujoco rk4_staged", "verlet"],
)
@pytest.mark.parametrize("lag", [2e-2, 1e-3, 1e-4])
def test_every_plant_feels_the_mean_thrust_of_a_reversible_rotor(plant, lag):
    """Momentum of a vehicle without gravity after 10 ms of rotors that turn round, by
    SciPy's integral of w |w|.
    """
    bare = load_vehicle("hummingbird")
    numbers = {
        "drag_coefficient": 0,
        "rolling_moment_coefficient": 0,
        "inertia": 3e-5,
        "reversible": True,
    }
    rotors = tuple(
        dataclasses.replace(r, time_constant_up=lag, time_constant_down=lag, **numbers)
        for r in bare.rotors
    )
    world = Truth(vehicle=dataclasses.replace(bare, rotors=rotors), gravity=0.0)
    name = plant.rsplit(" ", maxsplit=1)[-1]
    first = dataclasses.replace(example_state(0, 4), rotor_speeds=(400.0,) * 4)
    x, commands = flat(first), (-300.0, 0.0, -300.0, 0.0)
    if name == "verlet":
        command, around, states = (
            Command(rotor_speeds=commands, efforts=()),
            Together((Surroundings(),)),
            (first,),
        )
        for _ in range(10):
            states, _ = coupled_verlet((world,), states, (command,), around, 0.001)
        x = flat(states[0])
    else:
        flying = (MujocoPlant if "mujoco" in plant else RigidBodyPlant)(
            world, Surroundings(), name
        )
        for _ in range(2):
            x = flying.advance(x, commands, (0.0,), 0.005)
    squares = [
        quad(
            lambda t, c=c: (w := c + (400.0 - c) * math.exp(-t / lag)) * abs(w),
            0.0,
            0.01,
            limit=400,
            points=(
                [lag, 3.0 * lag] + ([lag * math.log(700.0 / 300.0)] if c else [])
                if lag < 3e-3
                else None
            ),
        )[0]
        for c in commands
    ]
    lift = sum(
        float(r.thrust_coefficient) * square
        for r, square in zip(rotors, squares, strict=True)
    )
    assert x[9] * float(world.vehicle.mass) == pytest.approx(lift, rel=2e-3)
