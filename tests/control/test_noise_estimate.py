"""Noise of velocity and accelerometer, found on signals whose noise is known, and a
Kalman filter's poles.
"""

import dataclasses
import math
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.linalg import solve_continuous_are
from scipy.stats import chi2

import skyarm
from skyarm.algebra import Vec3
from skyarm.control.laws.centroidal.make import make_centroidal
from skyarm.control.laws.centroidal.noise_estimate import (
    FELT,
    QUICKEST,
    SEEN,
    SLOWEST,
    NoiseGains,
    NoiseMemory,
    White,
)
from skyarm.control.model import Model
from skyarm.scenario.scenario_record import Delays
from skyarm.simulate.loop import run_in_python
from skyarm.studies.trial.facts import setting_of
from skyarm.studies.trial.trial import NOISE, Trial
from support.cases import sampled

DT = 0.005
GAINS = NoiseGains(density=0.0018, hears=False)
MODEL = Model(vehicle=skyarm.load_vehicle("hummingbird_arm2"))


def fed(noise, lacking=0.0, *, bandwidth=27.0, dt=DT, gains=GAINS):
    """Memories of the estimate along noise (n, 3) and accelerations that the model
    lacks, by an observer of our own.
    """
    noise = np.asarray(noise, dtype=float)
    velocity = np.cumsum(np.broadcast_to(lacking, noise.shape) * dt, axis=0)
    b, seen, pushed = math.exp(-bandwidth * dt), velocity[0] + noise[0], np.zeros(3)
    memory, found = gains.start(2), []
    for k, measured in enumerate(velocity + noise):
        off = measured - (seen + pushed * dt) if k else np.zeros(3)
        if k:
            seen, pushed = measured - b * b * off, pushed + (1.0 - b) ** 2 / dt * off
        told = SimpleNamespace(innovation=Vec3(*off), known=1.0, beside=())
        held = SimpleNamespace(
            corrections=told, observed=SimpleNamespace(velocity=Vec3(*seen))
        )
        memory = gains.after(memory, held, Vec3(*measured), dt)
        found.append(memory)
    return found


def white(size, seconds=8.0, dt=DT, seed=5):
    return size * np.random.default_rng(seed).normal(size=(round(seconds / dt), 3))


def of_variance(variance):
    return White(variance=variance)


def variance(memories):
    return np.mean([each.velocity.variance for each in memories[len(memories) // 2 :]])


@pytest.mark.parametrize(
    ("bandwidth", "dt"), [(27.0, 0.005), (8.0, 0.005), (60.0, 0.005), (27.0, 0.0025)]
)
def test_the_noise_is_found_by_an_observer_of_any_bandwidth(bandwidth, dt):
    """(1 - b)^2, 1.6 % at 27 rad/s, of a reading's noise is in the disturbance that the
    next change is less by.
    """
    found = variance(fed(white(0.1, dt=dt), bandwidth=bandwidth, dt=dt))
    assert found == pytest.approx(
        0.01 * (1.0 + (1.0 - math.exp(-bandwidth * dt)) ** 2), rel=0.05
    )


def test_the_bandwidth_is_that_of_the_kalman_filter():
    """Of v' = d, d' = w, by the Riccati equation: poles of one damping ratio, whose
    size falls with the noise.
    """
    A, C = np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([[1.0, 0.0]])

    def pole(size):
        P = solve_continuous_are(
            A.T, C.T, np.diag([0.0, 1.0]), np.array([[size * size * DT]])
        )
        return abs(np.linalg.eigvals(A - P @ C.T @ C / (size * size * DT))[0])

    least = GAINS.density / math.sqrt(DT)
    for size in (0.05, 0.1, 0.2):
        assert of_variance(size * size).share(GAINS.density, DT) == pytest.approx(
            pole(size) / pole(least), rel=1e-9
        )


def test_of_noise_the_density_counts():
    """Four times the readings with twice the noise of each say as much."""
    slow, fast = of_variance(0.01), of_variance(0.04)
    assert slow.share(GAINS.density, DT) == pytest.approx(
        fast.share(GAINS.density, DT / 4.0)
    )


@pytest.mark.parametrize("noise", [0.0, 0.01])
@pytest.mark.parametrize("lacking", ["nothing", "steady", "swinging", "turbulent"])
def test_the_benchs_noise_and_what_the_model_lacks_take_no_bandwidth(noise, lacking):
    """Bit for bit: whatever lasts longer than a period is no noise."""
    t = np.arange(1600)[:, None] * DT
    turbulent = np.cumsum(np.random.default_rng(1).normal(size=(1600, 3)), axis=0) * 0.3
    accelerations = {
        "nothing": 0.0,
        "steady": 5.0,
        "swinging": 5.0 * np.sin(30.0 * t),
        "turbulent": turbulent,
    }
    assert {
        each.velocity.share(GAINS.density, DT)
        for each in fed(white(noise), accelerations[lacking])
    } == {1.0}


def test_a_false_reading_is_no_noise():
    noise = white(0.01)
    noise[600] += (30.0, -10.0, 5.0)
    assert {each.velocity.share(GAINS.density, DT) for each in fed(noise)} == {1.0}


def test_noise_is_found_within_a_second_and_forgotten_within_five():
    noise = np.concatenate([white(0.01, 3.0), white(0.2, 3.0), white(0.01, 5.0)])
    shares = np.array([each.velocity.share(GAINS.density, DT) for each in fed(noise)])
    real = math.sqrt(GAINS.density / (0.2 * math.sqrt(DT)))
    assert shares[600] == 1.0
    assert shares[800:1200] == pytest.approx(real, rel=0.12)
    assert shares[-1] == 1.0


def test_a_noise_that_is_gone_is_forgotten_with_half_a_second():
    noise, still = of_variance(1.0), Vec3(0.0, 0.0, 0.0)
    for _ in range(100):
        noise = noise.after(still, still, GAINS.density, DT)
    assert noise.variance == pytest.approx((1.0 - 2.0 * DT) ** 100)


def test_axes_are_alike():
    noise = white(0.1, 2.0)
    one = fed(noise)[-1].velocity.variance
    assert fed(-noise)[-1].velocity.variance == one
    turn, _ = np.linalg.qr(np.random.default_rng(2).normal(size=(3, 3)))
    assert fed(noise @ turn)[-1].velocity.variance == pytest.approx(one, rel=1e-9)


@pytest.mark.parametrize("sigma", [0.05, 0.4])
def test_the_noise_of_an_accelerometer_is_found_beside_forces_that_last(sigma):
    """Of readings beyond the model, as turbulence and a step of 5 m/s^2 leave them."""
    rng, noise, found = np.random.default_rng(9), White(), []
    lasting = np.cumsum(rng.normal(size=(6400, 3)), axis=0) * 0.02
    lasting[3200:] += (5.0, -3.0, 1.0)
    for reading in lasting + sigma * rng.normal(size=(6400, 3)):
        beyond = Vec3(*reading)
        noise = noise.after(beyond - noise.last, beyond, FELT, DT)
        found.append(noise.variance)
    assert np.mean(found[800:]) == pytest.approx(sigma**2, rel=0.1)


@pytest.mark.parametrize(
    ("seen", "felt"),
    [
        (1.0, 1.0),
        (4.0, 1.0),
        (1.0, 6.0),
        (0.5, 0.1),
        (3.0, 3.0),
        (30.0, 1.0),
        (1.0, 90.0),
    ],
)
def test_the_poles_of_the_accelerometer_go_with_both_noises(seen, felt):
    """Its force's as the root of its noise, the one against the velocity as the ratio
    of both (Riccati), in bounds.
    """
    par = make_centroidal(MODEL, mode="tip").par
    memory = NoiseMemory(
        velocity=of_variance((seen * SEEN) ** 2 / DT),
        accelerometer=of_variance((felt * FELT) ** 2 / DT),
    )
    observer = par.parts.noise.adjust_gains(memory, par, DT).observer
    more, worse = max(seen, 1.0), max(felt, 1.0)
    assert observer.accelerometer.force == pytest.approx(40.0 * worse**-0.5)
    # v' = a + n_a, measured with n_v: the pole is the ratio of the densities
    P = solve_continuous_are(
        np.zeros((1, 1)),
        np.ones((1, 1)),
        [[(worse * FELT) ** 2]],
        [[(more * SEEN) ** 2]],
    )[0, 0]
    ratio = P / (more * SEEN) ** 2 / (FELT / SEEN)
    assert observer.accelerometer.velocity == pytest.approx(
        np.clip(8.0 * ratio, SLOWEST, QUICKEST)
    )


@pytest.mark.parametrize("times", [0.5, 1.0, 4.0])
def test_an_accelerometer_may_part_from_a_noisy_velocity_by_as_many_deviations(times):
    """The accepted difference goes with the velocity's deviation beyond the bench's,
    whatever the accelerometer's.
    """
    par = make_centroidal(MODEL).par
    gains, noise = par.parts.noise, (times * SEEN) ** 2 / DT
    for felt in (0.0, (3.0 * FELT) ** 2 / DT):
        memory = NoiseMemory(
            velocity=of_variance(noise), accelerometer=of_variance(felt)
        )
        found = gains.adjust_gains(memory, par, DT).observer.accelerometer
        assert found.agreement == pytest.approx(
            par.observer.accelerometer.agreement * max(times, 1.0)
        )


def test_an_observer_that_takes_velocities_whole_keeps_its_bandwidth():
    """Nothing is left of a reading: each change of it is one of the model's force."""
    assert (
        fed(white(0.1, 1.0), bandwidth=1e6)[-1].velocity.share(GAINS.density, DT) < 1.0
    )


def test_the_observer_alone_answers():
    par = make_centroidal(MODEL, mode="tip").par
    memory = NoiseMemory(velocity=of_variance(0.01), accelerometer=White())
    slower = par.parts.noise.adjust_gains(memory, par, DT)
    assert slower.observer.force == pytest.approx(
        27.0 * memory.velocity.share(GAINS.density, DT)
    )
    assert dataclasses.replace(slower, observer=par.observer) == par
    heard = par.observer.accelerometer
    assert (
        dataclasses.replace(slower.observer, force=27.0, accelerometer=heard, jump=0.3)
        == par.observer
    )


@pytest.mark.parametrize(
    ("deviation", "jump"),
    [(0.0, 0.3), (0.05, 0.3), (0.1, 27.0**0.5 * 0.1), (0.4, 27.0**0.5 * 0.4)],
)
def test_noise_is_no_leap(deviation, jump):
    """Three deviations of three axes are no blow: 97 % of white noise is below."""
    par = make_centroidal(MODEL, mode="tip").par
    memory = NoiseMemory(velocity=of_variance(deviation**2), accelerometer=White())
    found = par.parts.noise.adjust_gains(memory, par, DT).observer.jump
    assert found == pytest.approx(jump)
    if deviation > 0.05:
        assert chi2(3).cdf((found / deviation) ** 2) > 0.97


@pytest.mark.parametrize(
    ("name", "share"),
    [
        ("hummingbird_arm2", 1.0),
        ("crazyflie_arm1", 0.625),
        ("hexarotor12_arm5", 0.3125),
    ],
)
def test_of_slower_motors_the_noise_is_answered_sooner(name, share):
    """Mean time constants of 18.75, 30 and 60 ms."""
    noise = make_centroidal(Model(vehicle=skyarm.load_vehicle(name))).par.parts.noise
    assert noise.density == pytest.approx(0.0018 * share)


def noisy_circle(
    times, vehicle="hummingbird_arm2_rotors", duration=8.0, specific_force=0.0, **law
):
    setting = setting_of(vehicle, duration)
    noise = dataclasses.replace(
        NOISE,
        **{f.name: getattr(NOISE, f.name) * times for f in dataclasses.fields(NOISE)},
    )
    noise = dataclasses.replace(noise, specific_force=specific_force)
    circle = Trial(
        name="slow", title="", unit="", values=(0.0,), base="slow_circle", arm="gentle"
    )
    flight = dataclasses.replace(
        circle.scenario(setting, 0.0), noise=noise, delays=Delays(measurement=DT)
    )
    made = make_centroidal(flight.controller.par.model, mode="tip", delay=DT, **law)
    return dataclasses.replace(flight, controller=made)


def scores(scenario, seeds):
    names = ("ee_error_mean_continuous", "rotor_jitter")
    batch = skyarm.Batch(scenario, metrics=names, effort=0)
    found = batch.fly({}, seed=scenario.seed, episodes=np.array(seeds))
    assert found.completed.all()
    return [float(found.metrics[name].mean()) for name in names]


@pytest.mark.parametrize("specific_force", sampled([0.5, 0.0], 2))
def test_ten_times_the_benchs_noise_is_flown(specific_force):
    """26 mm without an estimate, and 103 rad/s of jitter."""
    tip, jitter = scores(noisy_circle(10.0, specific_force=specific_force), (11, 12))
    assert tip < 0.015
    assert jitter < 60.0


def test_a_shaken_accelerometer_alone_is_flown():
    """Forty times 0.05 m/s^2 with the bench's other noise; 6 mm at ten times with poles
    that stay.
    """
    assert scores(noisy_circle(1.0, specific_force=2.0), (11, 12))[0] < 0.004


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
    x = np.asarray(
        batch.fly(
            {path: np.array([0.0018, 1.0])}, seed=scenario.seed
        ).log.state.position.x
    )
    assert np.array_equal(x[0], floats.position[:, 0])
    assert not np.array_equal(x[1], floats.position[:, 0])
