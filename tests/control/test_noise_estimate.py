"""Noise of the measured velocity, found on signals whose noise is known, and the bandwidth that a Kalman filter has."""

import dataclasses
import math
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.linalg import solve_continuous_are

import skyarm
from skyarm.algebra import Vec3
from skyarm.control.controller import ControllerError
from skyarm.control.laws.centroidal.make import make_centroidal
from skyarm.control.laws.centroidal.noise_estimate import NoiseGains
from skyarm.control.model import Model
from skyarm.scenario.scenario_record import Delays
from skyarm.simulate.loop import run_in_python
from skyarm.studies.compare.envelope_axes import slow_circle
from skyarm.studies.compare.envelope_setting import setting_of
from skyarm.studies.compare.suite import NOISE

DT = 0.005
GAINS = NoiseGains(density=0.0018)
MODEL = Model(vehicle=skyarm.load_vehicle("hummingbird_arm2"))


def fed(noise, lacking=0.0, *, bandwidth=27.0, dt=DT, gains=GAINS):
    """Memories of the estimate along noise (n, 3) and accelerations that the model lacks, by an observer of our own."""
    noise = np.asarray(noise, dtype=float)
    velocity = np.cumsum(np.broadcast_to(lacking, noise.shape) * dt, axis=0)
    b, seen, pushed = math.exp(-bandwidth * dt), velocity[0] + noise[0], np.zeros(3)
    par = SimpleNamespace(observer=SimpleNamespace(force=bandwidth))
    memory, found = gains.start(2), []
    for k, measured in enumerate(velocity + noise):
        if k:
            off = measured - (seen + pushed * dt)
            seen, pushed = measured - b * b * off, pushed + (1.0 - b) ** 2 / dt * off
        step = SimpleNamespace(
            par=par,
            dt=dt,
            measurement=SimpleNamespace(velocity=Vec3(*measured)),
            observed=SimpleNamespace(velocity=Vec3(*seen)),
        )
        memory = gains.learn(memory, step)
        found.append(memory)
    return found


def white(size, seconds=8.0, dt=DT, seed=5):
    return size * np.random.default_rng(seed).normal(size=(round(seconds / dt), 3))


def variance(memories):
    return np.mean([each.variance for each in memories[len(memories) // 2 :]])


@pytest.mark.parametrize(("bandwidth", "dt"), [(27.0, 0.005), (8.0, 0.005), (60.0, 0.005), (27.0, 0.0025)])
def test_the_noise_is_found_by_an_observer_of_any_bandwidth(bandwidth, dt):
    """(1 - b)^2, 1.6 % at 27 rad/s, of a reading's noise is in the disturbance that the next change is less by."""
    found = variance(fed(white(0.1, dt=dt), bandwidth=bandwidth, dt=dt))
    assert found == pytest.approx(0.01 * (1.0 + (1.0 - math.exp(-bandwidth * dt)) ** 2), rel=0.05)


def test_the_bandwidth_is_that_of_the_kalman_filter():
    """Of v' = d, d' = w, by the Riccati equation: poles of one damping ratio, whose size falls with the noise."""
    A, C = np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([[1.0, 0.0]])

    def pole(size):
        P = solve_continuous_are(A.T, C.T, np.diag([0.0, 1.0]), np.array([[size * size * DT]]))
        return abs(np.linalg.eigvals(A - P @ C.T @ C / (size * size * DT))[0])

    least = GAINS.density / math.sqrt(DT)
    for size in (0.05, 0.1, 0.2):
        memory = dataclasses.replace(GAINS.start(2), variance=size * size)
        assert GAINS.share(memory, DT) == pytest.approx(pole(size) / pole(least), rel=1e-9)


def test_of_noise_the_density_counts():
    """Four times the readings with twice the noise of each say as much."""
    slow, fast = (dataclasses.replace(GAINS.start(2), variance=v) for v in (0.01, 0.04))
    assert GAINS.share(slow, DT) == pytest.approx(GAINS.share(fast, DT / 4.0))


@pytest.mark.parametrize("noise", [0.0, 0.01])
@pytest.mark.parametrize("lacking", ["nothing", "steady", "swinging", "turbulent"])
def test_the_benchs_noise_and_what_the_model_lacks_take_no_bandwidth(noise, lacking):
    """Bit for bit: whatever lasts longer than a period is no noise."""
    t = np.arange(1600)[:, None] * DT
    turbulent = np.cumsum(np.random.default_rng(1).normal(size=(1600, 3)), axis=0) * 0.3
    accelerations = {"nothing": 0.0, "steady": 5.0, "swinging": 5.0 * np.sin(30.0 * t), "turbulent": turbulent}
    assert {GAINS.share(each, DT) for each in fed(white(noise), accelerations[lacking])} == {1.0}


def test_a_false_reading_is_no_noise():
    noise = white(0.01)
    noise[600] += (30.0, -10.0, 5.0)
    assert {GAINS.share(each, DT) for each in fed(noise)} == {1.0}


def test_noise_is_found_within_a_second_and_forgotten_within_five():
    noise = np.concatenate([white(0.01, 3.0), white(0.2, 3.0), white(0.01, 5.0)])
    shares = np.array([GAINS.share(each, DT) for each in fed(noise)])
    real = math.sqrt(GAINS.density / (0.2 * math.sqrt(DT)))
    assert shares[600] == 1.0
    assert shares[800:1200] == pytest.approx(real, rel=0.12)
    assert shares[-1] == 1.0


def test_a_noise_that_is_gone_is_forgotten_with_half_a_second():
    memory, still = dataclasses.replace(GAINS.start(2), variance=1.0), Vec3(0.0, 0.0, 0.0)
    seen = SimpleNamespace(velocity=still)
    par = SimpleNamespace(observer=SimpleNamespace(force=27.0))
    for _ in range(100):
        memory = GAINS.learn(memory, SimpleNamespace(par=par, dt=DT, measurement=seen, observed=seen))
    assert memory.variance == pytest.approx((1.0 - 2.0 * DT) ** 100)


def test_axes_are_alike():
    noise = white(0.1, 2.0)
    one = fed(noise)[-1].variance
    assert fed(-noise)[-1].variance == one
    turn, _ = np.linalg.qr(np.random.default_rng(2).normal(size=(3, 3)))
    assert fed(noise @ turn)[-1].variance == pytest.approx(one, rel=1e-9)


def test_an_observer_that_takes_velocities_whole_keeps_its_bandwidth():
    assert fed(white(0.1, 1.0), bandwidth=1e6)[-1].variance == 0.0


def test_the_observer_alone_answers():
    par = make_centroidal(MODEL, mode="tip", preset="adaptive").par
    memory = dataclasses.replace(GAINS.start(2), variance=0.01)
    slower = par.parts.noise.adjust_gains(memory, par, DT)
    assert slower.observer.force == pytest.approx(27.0 * GAINS.share(memory, DT))
    assert dataclasses.replace(slower, observer=par.observer) == par
    assert dataclasses.replace(slower.observer, force=27.0) == par.observer


def test_with_an_accelerometer_there_is_no_such_part():
    assert make_centroidal(MODEL, mode="tip", preset="gusts").par.parts.noise is None
    with pytest.raises(ControllerError, match=r"controller\.velocity_noise = 0\.002: must be 0 with an accelerometer"):
        make_centroidal(MODEL, mode="tip", preset="gusts", velocity_noise=0.002)


@pytest.mark.parametrize(
    ("name", "share"), [("hummingbird_arm2", 1.0), ("crazyflie_arm1", 0.625), ("hexarotor12_arm5", 0.3125)]
)
def test_of_slower_motors_the_noise_is_answered_sooner(name, share):
    """Mean time constants of 18.75, 30 and 60 ms; a number that is given holds for any."""
    model = Model(vehicle=skyarm.load_vehicle(name))
    parts = make_centroidal(model, preset="adaptive").par.parts
    assert parts.noise.density == pytest.approx(0.0018 * share)
    assert make_centroidal(model, preset="adaptive", velocity_noise=0.003).par.parts.noise.density == 0.003


def noisy_circle(times, vehicle="hummingbird_arm2_rotors", duration=8.0, **law):
    setting = setting_of(vehicle, duration)
    noise = dataclasses.replace(NOISE, **{f.name: getattr(NOISE, f.name) * times for f in dataclasses.fields(NOISE)})
    flight = slow_circle(setting, noise=noise, delays=Delays(measurement=DT))
    made = make_centroidal(flight.controller.par.model, mode="tip", preset="adaptive", delay=DT, **law)
    return dataclasses.replace(flight, controller=made)


def scores(scenario, seeds):
    names = ("ee_error_mean_continuous", "rotor_jitter")
    batch = skyarm.Batch(scenario, metrics=names, effort=0)
    found = batch.fly({}, seed=scenario.seed, episodes=np.array(seeds))
    assert found.completed.all()
    return [float(found.metrics[name].mean()) for name in names]


def test_ten_times_the_benchs_noise_is_flown():
    """26 mm without, and 103 rad/s of jitter."""
    tip, jitter = scores(noisy_circle(10.0), (11, 12))
    assert tip < 0.015
    assert jitter < 60.0


@pytest.mark.thorough
def test_it_is_flown_by_other_vehicles():
    """Without: 50 mm, and lost."""
    for vehicle in ("hexarotor_arm6", "octo_coaxial_two_arms"):
        assert scores(noisy_circle(10.0, vehicle), (11, 12))[0] < 0.018


def test_lanes_and_floats_fly_it_to_the_same_bits():
    scenario = noisy_circle(10.0, duration=0.3)
    floats = run_in_python(scenario)
    path = "controller.parts.noise.density"
    batch = skyarm.Batch(scenario, [path], bit_exact=True, log_every=1, effort=0)
    x = np.asarray(batch.fly({path: np.array([0.0018, 1.0])}, seed=scenario.seed).log.state.position.x)
    assert np.array_equal(x[0], floats.position[:, 0])
    assert not np.array_equal(x[1], floats.position[:, 0])
