"""Dryden turbulence against the published spectra, through SciPy's continuous
systems.
"""

import math

import numpy as np
import pytest

from skyarm.algebra import E_X, E_Y, Vec3
from skyarm.algebra.scalars import philox
from skyarm.compile import trace
from skyarm.world import Dryden, DrydenMemory, low_altitude
from skyarm.world.dryden import start, step

linalg = pytest.importorskip("scipy.linalg")
signal = pytest.importorskip("scipy.signal")

PAR = Dryden(
    intensity=Vec3(1.5, 1.2, 0.8), scale_length=Vec3(40.0, 30.0, 6.0), airspeed=4.0
)
STEPS = (0.0005, 0.005, 0.1, 2.0, 30.0)


def matrices(par, dt):
    """x' = A x + B n, y = C x + D n of the sequence, read off by unit inputs: the step
    is linear.
    """
    columns, outputs = [], []
    for unit in np.eye(8):
        memory, velocity = step(
            DrydenMemory(*unit[:5].tolist()), Vec3(*unit[5:].tolist()), dt, par=par
        )
        columns.append([memory.u, memory.v, memory.w, memory.v_inner, memory.w_inner])
        outputs.append(list(velocity))
    full, out = np.array(columns).T, np.array(outputs).T
    return full[:, :5], full[:, 5:], out[:, :5], out[:, 5:]


def covariance(par, dt):
    A, B, _, _ = matrices(par, dt)
    return linalg.solve_discrete_lyapunov(A, B @ B.T)


def continuous(index, par=PAR):
    """Published filter of a component, driven by white noise of unit (two-sided)
    spectral density.
    """
    sigma = list(par.intensity)[index]
    T = list(par.scale_length)[index] / par.airspeed
    # one-sided spectrum sigma^2 2T/pi / (1 + T^2 w^2); two-sided density in Hz form:
    # times pi
    if index == 0:
        return signal.TransferFunction([sigma * math.sqrt(2.0 * T)], [T, 1.0])
    return signal.TransferFunction(
        np.array([math.sqrt(3.0) * T, 1.0]) * sigma * math.sqrt(T),
        np.polymul([T, 1.0], [T, 1.0]),
    )


def published_spectrum(index, w, par=PAR):
    """MIL-F-8785C 3.7.1.2 as a one-sided spectrum in time frequency w (rad/s): its
    integral over w > 0 is sigma^2.
    """
    sigma, L, V = (
        list(par.intensity)[index],
        list(par.scale_length)[index],
        par.airspeed,
    )
    x = (L * w / V) ** 2
    if index == 0:
        return sigma**2 * 2.0 * L / (math.pi * V) / (1.0 + x)
    return sigma**2 * L / (math.pi * V) * (1.0 + 3.0 * x) / (1.0 + x) ** 2


@pytest.mark.parametrize("index", [0, 1, 2])
def test_the_oracle_filter_has_the_published_spectrum(index):
    w = np.geomspace(0.01, 100.0, 30)
    _, response = signal.freqresp(continuous(index), w)
    np.testing.assert_allclose(
        np.abs(response) ** 2 / math.pi, published_spectrum(index, w), rtol=1e-12
    )


@pytest.mark.parametrize("dt", STEPS)
def test_variance_is_the_intensity_squared_at_any_step(dt):
    A, B, C, D = matrices(PAR, dt)
    P = linalg.solve_discrete_lyapunov(A, B @ B.T)
    variance = np.diag(C @ P @ C.T + D @ D.T)
    # 1e-8: the poles exp(-dt V/L) are within 5e-5 of 1, which costs the Lyapunov
    # equation four or five digits twice
    np.testing.assert_allclose(variance, [1.5**2, 1.2**2, 0.8**2], rtol=1e-8)


@pytest.mark.parametrize("dt", STEPS)
@pytest.mark.parametrize("index", [0, 1, 2])
def test_autocovariance_is_that_of_the_continuous_filter(index, dt):
    A, B, C, D = matrices(PAR, dt)
    P = linalg.solve_discrete_lyapunov(A, B @ B.T)
    system = continuous(index).to_ss()
    Pc = linalg.solve_continuous_lyapunov(system.A, -system.B @ system.B.T)
    sigma = list(PAR.intensity)[index]
    for lag in (1, 2, 3, 10, 400):
        ours = (
            C @ np.linalg.matrix_power(A, lag) @ P @ C.T
            + C @ np.linalg.matrix_power(A, lag - 1) @ B @ D.T
        )[index, index]
        theirs = (system.C @ linalg.expm(system.A * lag * dt) @ Pc @ system.C.T)[0, 0]
        assert ours == pytest.approx(theirs, abs=1e-8 * sigma**2)  # as above


def test_components_are_independent():
    A, B, C, D = matrices(PAR, 0.1)
    P = linalg.solve_discrete_lyapunov(A, B @ B.T)
    full = C @ P @ C.T + D @ D.T
    assert np.abs(full - np.diag(np.diag(full))).max() < 1e-12


@pytest.mark.parametrize("index", [0, 1, 2])
def test_spectrum_of_a_drawn_record_is_the_published_one(index):
    lanes, n, dt = 64, 4096, 0.05
    noise = philox.normal(3, np.arange(lanes)[:, None], 7, np.arange(n + 1), 6)
    par = PAR
    memory = start(Vec3(*noise[:, n, :3].T), Vec3(*noise[:, n, 3:].T), dt, par=par)
    record = np.empty((lanes, n))
    for k in range(n):
        memory, velocity = step(memory, Vec3(*noise[:, k, :3].T), dt, par=par)
        record[:, k] = list(velocity)[index]
    f, density = signal.welch(record, fs=1.0 / dt, nperseg=1024, detrend=False)
    mean = density.mean(axis=0)
    # below: the window's leakage; above: aliases of the sampled record
    band = (f > 0.1) & (f < 1.0)
    expected = published_spectrum(index, 2.0 * math.pi * f[band]) * 2.0 * math.pi
    # 64 x 7 segments: 5 % a bin; 20 bins averaged: 1.5 %; aliases add up to 3 % at 1 Hz
    # of 10 Hz
    bins = (mean[band] / expected)[:40].reshape(-1, 20).mean(axis=1)
    np.testing.assert_allclose(bins, 1.0, atol=0.06)


@pytest.mark.parametrize("dt", STEPS)
def test_the_start_is_stationary(dt):
    columns = []
    for unit in np.eye(6):
        m = start(Vec3(*unit[:3].tolist()), Vec3(*unit[3:].tolist()), dt, par=PAR)
        columns.append([m.u, m.v, m.w, m.v_inner, m.w_inner])
    drawn = np.array(columns).T
    # as for the variance
    np.testing.assert_allclose(drawn @ drawn.T, covariance(PAR, dt), atol=1e-8)


def test_a_drawn_ensemble_has_the_intensity_from_first_step_to_last():
    lanes, dt = 5000, 0.02
    noise = philox.normal(11, np.arange(lanes)[:, None], 0, np.arange(102), 3)
    memory = start(Vec3(*noise[:, 100].T), Vec3(*noise[:, 101].T), dt, par=PAR)
    for k in range(100):
        memory, velocity = step(memory, Vec3(*noise[:, k].T), dt, par=PAR)
        if k in (0, 99):
            for value, sigma in zip(velocity, PAR.intensity, strict=True):
                # 4.5 sigma
                assert np.std(value) == pytest.approx(
                    sigma, rel=4.5 / math.sqrt(2 * lanes)
                )
                assert abs(np.mean(value)) < 4.5 * sigma / math.sqrt(lanes)


def test_scale_lengths_and_intensities_follow_the_specification():
    # at 1000 ft the bracket 0.177 + 0.000823 h is exactly 1: isotropic
    top = low_altitude(304.8, 10.0, 5.0)
    np.testing.assert_allclose(list(top.scale_length), [304.8] * 3, rtol=1e-12)
    np.testing.assert_allclose(list(top.intensity), [1.0] * 3, rtol=1e-12)
    # at 50 ft in 15 kn, by hand: 0.177 + 0.04115 = 0.21815
    par = low_altitude(50 * 0.3048, 7.7, 5.0)
    L, sigma = list(par.scale_length), list(par.intensity)
    assert L[2] == pytest.approx(15.24)
    assert L[0] == L[1] == pytest.approx(15.24 * 0.21815**-1.2, rel=1e-12)
    assert L[0] == pytest.approx(94.7, abs=0.1)  # m: 311 ft
    assert sigma[2] == pytest.approx(0.77)
    assert sigma[0] == sigma[1] == pytest.approx(0.77 * 0.21815**-0.4, rel=1e-12)


def test_airspeed_is_the_mean_wind_with_a_floor():
    assert low_altitude(10.0, 5.0, 6.0).airspeed == 6.0
    assert low_altitude(10.0, 5.0, 0.0).airspeed == 1.0
    assert low_altitude(10.0, 5.0, 0.0, minimum_airspeed=2.0).airspeed == 2.0


@pytest.mark.parametrize(
    ("altitude", "wind"), [(3.0, 5.0), (305.0, 5.0), (math.nan, 5.0), (10.0, -1.0)]
)
def test_numbers_outside_the_model_are_refused(altitude, wind):
    with pytest.raises(ValueError, match="must be from"):
        low_altitude(altitude, wind, 5.0)


def test_components_point_along_left_of_and_above_the_mean_wind():
    par = Dryden(
        intensity=Vec3(1.0, 1.0, 1.0),
        scale_length=Vec3(9.0, 9.0, 9.0),
        airspeed=3.0,
        direction_W=E_Y,
    )
    along = step(
        DrydenMemory(1.0, 0.0, 0.0, 0.0, 0.0), Vec3(0.0, 0.0, 0.0), 0.01, par=par
    )[1]
    left = step(
        DrydenMemory(0.0, 1.0, 0.0, 0.0, 0.0), Vec3(0.0, 0.0, 0.0), 0.01, par=par
    )[1]
    up = step(
        DrydenMemory(0.0, 0.0, 1.0, 0.0, 0.0), Vec3(0.0, 0.0, 0.0), 0.01, par=par
    )[1]
    assert along.y > 0.9
    assert left.x < -0.9
    assert up.z > 0.9
    assert along.x == along.z == left.y == left.z == up.x == up.y == 0.0


def test_every_engine_takes_the_same_step():
    memory, noise = DrydenMemory(0.3, -0.2, 0.9, 1.1, -0.4), Vec3(0.5, -1.5, 0.25)

    def advance(memory, noise, dt):
        return step(memory, noise, dt, par=PAR)

    new, velocity = advance(memory, noise, 0.005)
    traced, traced_velocity = trace(advance, memory, noise, 0.005)(memory, noise, 0.005)
    assert (traced, list(traced_velocity)) == (new, list(velocity))  # bit for bit
    lanes = step(
        DrydenMemory(*(np.full(2, v) for v in (0.3, -0.2, 0.9, 1.1, -0.4))),
        Vec3(*(np.full(2, v) for v in noise)),
        0.005,
        par=PAR,
    )[1]
    for ours, theirs in zip(lanes, velocity, strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=1e-14)  # another exp


def test_no_intensity_is_no_turbulence():
    par = low_altitude(10.0, 0.0, 0.0, E_X)
    memory = start(Vec3(1.0, 1.0, 1.0), Vec3(1.0, 1.0, 1.0), 0.01, par=par)
    assert list(step(memory, Vec3(2.0, 2.0, 2.0), 0.01, par=par)[1]) == [0.0, 0.0, 0.0]
