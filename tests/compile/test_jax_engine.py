"""Stepped programs on JAX equal the Python floats, draw the same numbers, and have
right derivatives.
"""

from __future__ import annotations

import functools
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from support.cases import sampled
from support.engines import jax_doubles

jax = pytest.importorskip("jax")

# ruff: noqa: E402  the engine needs the library
from jax_kernel import JaxKernel
from stepped_flights import (
    CONSTANTS,
    CONTROLLER,
    DRAWS,
    PENDULUM,
    TILTED,
    flight_lanes,
    flight_row,
    flight_rows,
    flight_step,
    flown_in_python,
    lanes_of,
    pendulum_step,
)

from skyarm.algebra.scalars import (
    absolute,
    acos,
    atan2,
    divide,
    exp,
    floor,
    philox,
    sqrt,
    tan,
    tanh,
    where,
)
from skyarm.algebra.scalars import log as ln
from skyarm.algebra.scalars.functions import copysign
from skyarm.compile import trace
from skyarm.compile.jax.jax_operations import evaluate, uniforms
from skyarm.compile.tracing.lower import repeat
from skyarm.compile.tracing.program import trace_loop
from skyarm.records.files import needs_extra


@pytest.fixture(autouse=True)
def _double():
    with jax_doubles():
        yield


@functools.cache
def pendulum(**options):
    """One kernel for all tests that want the same: XLA compiles it once for each number
    of lanes in a block.
    """
    return JaxKernel(
        trace_loop(pendulum_step, PENDULUM, CONSTANTS, (0.0,), DRAWS), **options
    )


def pendulum_lanes(lanes):
    return lanes_of(PENDULUM, 0.5, lanes, 1), lanes_of(CONSTANTS, 0.5, lanes, 2)


TORQUES = np.sin(np.arange(120) / 7.0)[:, None]


@pytest.mark.parametrize(
    ("lanes", "block", "threads"), sampled([(5, 2, 2), (1, 64, 1), (7, None, 1)], 3)
)
def test_noisy_pendulums_equal_the_python_floats_lane_by_lane(lanes, block, threads):
    """Tolerance: XLA may contract a * b + c; 120 damped steps of numbers below 3 gather
    a few hundred roundings.
    """
    kernel = pendulum(lanes_per_block=block, logging=True)
    carry, parameters = pendulum_lanes(lanes)
    episodes = 4_000_000_000 + np.arange(lanes) * 3
    keys = {"seed": 2**63 + 5, "start": 17}
    found, log = kernel.run(
        carry, parameters, TORQUES, episodes=episodes, threads=threads, **keys
    )
    assert log.shape == (120, 2, lanes)
    for k in range(lanes):
        expected, entries = flown_in_python(
            kernel.loop,
            carry[:, k],
            parameters[:, k],
            TORQUES,
            episode=int(episodes[k]),
            **keys,
        )
        np.testing.assert_allclose(found[:, k], expected, rtol=0, atol=1e-13)
        np.testing.assert_allclose(log[:, :, k], entries, rtol=0, atol=1e-13)


@pytest.mark.thorough
def test_a_lane_has_the_same_bits_in_any_company():
    """Blocks of one width are one program: other lanes, their number and the threads
    change nothing.
    """
    kernel = pendulum(lanes_per_block=4)
    carry, parameters = pendulum_lanes(11)
    alone = kernel.run(carry, parameters, TORQUES)[0]
    assert np.array_equal(kernel.run(carry, parameters, TORQUES, threads=2)[0], alone)
    few = kernel.run(
        carry[:, 3:7], parameters[:, 3:7], TORQUES, episodes=np.arange(3, 7)
    )[0]
    assert np.array_equal(few, alone[:, 3:7])


def test_a_diverged_lane_stays_visible_and_leaves_its_neighbours_untouched():
    kernel = pendulum(lanes_per_block=4)
    carry, parameters = pendulum_lanes(11)
    clean = kernel.run(carry, parameters, TORQUES)[0]
    spoiled = parameters.copy()
    spoiled[1, 2] = -1e9  # damping that doubles the rate a million times over
    found = kernel.run(carry, spoiled, TORQUES)[0]
    assert not np.isfinite(found[:, 2]).all()
    others = [0, 1, *range(3, 11)]
    assert np.array_equal(found[:, others], clean[:, others])


@pytest.mark.parametrize("every", sampled([50, 1000], 2))
def test_a_decimated_log_holds_every_nth_entry(every):
    """Steps that are no multiple of it, and fewer steps than it; blocks of two lanes,
    the last with one.
    """
    kernel = pendulum(lanes_per_block=2, logging=True)
    carry, parameters = pendulum_lanes(3)
    (final, full), (same, log) = (
        kernel.run(carry, parameters, TORQUES, every=n) for n in (1, every)
    )
    assert np.array_equal(final, same)
    assert np.array_equal(log, full[::every])


def test_single_precision_needs_no_64_bit_numbers_and_stays_within_its_digits():
    """Tolerance: 120 steps of 6e-8 each on numbers below 3."""
    carry, parameters = pendulum_lanes(3)
    with jax_doubles(False):
        kernel = pendulum(single=True)
        found = kernel.run(carry, parameters, TORQUES, seed=5)[0]
    assert found.dtype == np.float32
    for k in range(3):
        expected, _ = flown_in_python(
            kernel.loop, carry[:, k], parameters[:, k], TORQUES, seed=5, episode=k
        )
        np.testing.assert_allclose(found[:, k], expected, rtol=0, atol=3e-5)


@pytest.mark.parametrize("single", [False, True])
def test_uniform_numbers_equal_philox_to_the_bit(single):
    """Single precision is within a unit of the last place."""
    dtype = np.float32 if single else np.float64
    episodes = np.array([0, 1, 7, 2**31, 2**32 - 1] * 400, dtype=np.uint32)
    steps = np.arange(2000, dtype=np.uint32) * np.uint32(2_147_483)
    seed = 0xFEDCBA9876543210
    words = np.array([seed & 0xFFFFFFFF, seed >> 32], dtype=np.uint32)
    with jax_doubles(not single):
        draw = jax.vmap(lambda e, s: uniforms(words, e, s, ((2, 5), (9, 2)), dtype))
        found = jax.jit(draw)(episodes, steps)
    expected = [
        philox.uniforms(seed, episodes, channel, steps, count)
        for channel, count in ((2, 5), (9, 2))
    ]
    wanted = np.concatenate(expected, axis=-1).astype(dtype)
    np.testing.assert_array_max_ulp(
        np.array(found).T, wanted, maxulp=1 if single else 0
    )


def test_single_uniforms_are_the_doubles_within_a_unit_of_the_last_place():
    """Words chosen so that the 53 bits end just at, above and below a tie of 24 bits,
    at every magnitude.
    """
    from skyarm.compile.jax.jax_operations import _unit32

    rng = np.random.default_rng(8)
    ones = [int(rng.integers(1, 2**24)) for _ in range(20)]
    kept = {
        min(abs((one << shift) + d), 2**52 - 1)
        for one in ones
        for shift in range(28)
        for d in (-1, 0, 1)
    }
    kept |= {0, 1, 2, 3, 2**52 - 1, 2**28 - 1, 2**20, 2**20 - 1}
    k = np.array(sorted(kept), dtype=np.uint64)
    expected = ((2 * k + 1).astype(np.float64) * 2.0**-53).astype(np.float32)
    low, high = (
        ((k << 12) & np.uint64(0xFFFFFFFF)).astype(np.uint32),
        (k >> 20).astype(np.uint32),
    )
    np.testing.assert_array_max_ulp(
        np.asarray(jax.jit(jax.vmap(_unit32))(low, high)), expected, maxulp=1
    )


def everything(x, y):
    bits = copysign(divide(x, y), y) + floor(3.0 * x)
    logic = where(((x < 0.2) & (y > 0.1)) | (x < -0.5), x * y, x - y)
    return (
        atan2(y, x),
        exp(x),
        ln(absolute(y)),
        tanh(3.0 * x),
        tan(x),
        acos(0.9 * x),
        sqrt(absolute(x)),
        bits,
        logic,
    )


def test_every_operation_equals_the_python_floats_on_ordinary_and_special_numbers():
    """Tolerance: contraction changes the last digits of a value, by up to 2e-16 of each
    function's largest term.
    """
    program = trace(everything, 0.5, 0.5)
    special = [0.0, -0.0, 1.0, -1.0, 0.5, 1e-300, np.inf, -np.inf, np.nan]
    rng = np.random.default_rng(4)
    pairs = [(x, y) for x in special for y in special] + rng.uniform(
        -1.0, 1.0, (200, 2)
    ).tolist()
    lanes = np.array(pairs).T
    found = np.array(
        jax.jit(jax.vmap(lambda x, y: evaluate(program.lowered, (x, y), np.float64)))(
            *lanes
        )
    ).T
    expected = np.array([program.flat(tuple(pair)) for pair in pairs])
    np.testing.assert_allclose(found, expected, rtol=2e-15, atol=1e-15)
    zeros = expected == 0.0
    assert np.array_equal(np.signbit(found[zeros]), np.signbit(expected[zeros]))


def test_a_nan_is_no_number_that_is_at_least_zero():
    """XLA's own 0 <= x * x is true of a NaN, which would hide a crash."""
    program = trace(
        lambda x: tuple(
            where(f(x) >= 0.0, 1.0, 2.0) for f in (absolute, exp, lambda x: x * x)
        ),
        0.5,
    )
    found = jax.jit(lambda x: evaluate(program.lowered, (x,), np.float64))
    assert [float(one) for one in found(np.nan)] == [2.0] * 3 == list(program(np.nan))
    assert [float(one) for one in found(0.0)] == [1.0] * 3 == list(program(0.0))


STEPS = 160
"""0.8 s of flight with RK4."""

FLIGHTS = """
import sys
from jax_kernel import JaxKernel, configure_cpu
from skyarm.compile.tracing.program import trace_loop
configure_cpu()
import jax, numpy as np
from stepped_flights import *
jax.config.update("jax_enable_x64", True)
def flight(step):
    loop = trace_loop(step, TILTED, CONTROLLER.par, flight_row())
    return JaxKernel(loop, lanes_per_block=3)
carry, parameters = flight_lanes(4)
carry[10, 2] = np.nan  # one lane's roll rate
final, _ = flight(flight_step).run(carry, parameters, flight_rows(int(sys.argv[2])))
np.savez(sys.argv[1], final=final)
"""
"""In a process of its own: JAX reads the CPU flags when it starts."""


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    out = tmp_path_factory.mktemp("jax") / "flights.npz"
    environment = os.environ | {
        "PYTHONPATH": os.pathsep.join(sys.path),
        "JAX_PLATFORMS": "cpu",
    }
    # our own flags join it; XLA's last optimisations, by LLVM, take half of its time
    # and have tests of their own
    environment["XLA_FLAGS"] = "--xla_backend_optimization_level=0"
    command = [sys.executable, "-c", FLIGHTS, str(out), str(STEPS)]
    done = subprocess.run(
        command,
        env=environment,
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return np.load(out)


def test_the_controlled_vehicle_equals_the_python_floats_and_a_lost_one_harms_nobody(
    flown,
):
    """Tolerance: the loop is stable, so roundings of 160 steps do not grow; rotor
    speeds are of order 500 rad/s.
    """
    loop = trace_loop(flight_step, TILTED, CONTROLLER.par, flight_row())
    carry, parameters = flight_lanes(4)
    rows = flight_rows(STEPS)
    found = flown["final"]
    assert np.isnan(found[:3, 2]).all()
    scale = np.where(np.arange(loop.carry) < 17, 1.0, 500.0)
    for k in (0, 1, 3):
        expected, _ = flown_in_python(loop, carry[:, k], parameters[:, k], rows)
        np.testing.assert_allclose(
            found[:, k] / scale, expected / scale, rtol=0, atol=2e-12
        )
        assert abs(expected[:3] - carry[:3, k]).max() > 0.05  # it flew


SLOPES = (
    (ln, 3.0, 1.0 / 3.0),
    (ln, 0.07, 1.0 / 0.07),
    (exp, 2.5, np.exp(2.5)),
    (lambda x: atan2(x, 1.0), 0.0, 1.0),
    (lambda x: atan2(x, -1.0), -0.0, -1.0),
    (lambda x: atan2(x, -1.0), -0.3, -1.0 / 1.09),
    (tanh, 0.0, 1.0),
    (tanh, -1.3, 1.0 - np.tanh(1.3) ** 2),
    (absolute, -2.0, -1.0),
    (lambda x: divide(2.0, x), 0.5, -8.0),
    (lambda x: divide(x, 4.0), 0.0, 0.25),
    (sqrt, 0.25, 1.0),
    (lambda x: sqrt(where(x < 0.0, 0.0, x)), -1.0, 0.0),
    (lambda x: where(x > 0.0, divide(1.0, x), x), 0.0, 1.0),
    (lambda x: where(x > 0.0, sqrt(x), 3.0 * x), 0.0, 3.0),
    (lambda x: where(x < 1e-9, 1.0 - x, divide(sqrt(x * x), x)), 0.0, -1.0),
)


@pytest.mark.thorough
def test_slopes_are_right_at_ordinary_points_and_finite_beside_a_branch_not_taken():
    """Forwards and backwards, each of its own program, compiled together. Tolerance: a
    few roundings.
    """
    programs = [
        trace(lambda x, of=function: (of(x),), 0.5).lowered for function, _, _ in SLOPES
    ]
    functions = [
        lambda x, of=program: evaluate(of, (x,), np.float64)[0] for program in programs
    ]

    def slopes(points):
        places = list(zip(functions, points, strict=True))
        return [jax.grad(f)(x) for f, x in places], [
            jax.jvp(f, (x,), (1.0,))[1] for f, x in places
        ]

    backwards, forwards = jax.jit(slopes)([x for _, x, _ in SLOPES])
    for k, (_, x, slope) in enumerate(SLOPES):
        assert float(backwards[k]) == pytest.approx(slope, rel=1e-14), (
            f"row {k}, at {x}"
        )
        assert float(forwards[k]) == pytest.approx(slope, rel=1e-14), f"row {k}, at {x}"


def test_double_precision_that_jax_does_not_allow_is_refused_with_the_setting():
    with (
        jax_doubles(False),
        pytest.raises(
            ValueError, match=r'update\("jax_enable_x64", True\).*single=True'
        ),
    ):
        pendulum.__wrapped__()


def test_wrong_shapes_and_keys_are_refused_by_name():
    kernel = pendulum()
    carry, parameters = pendulum_lanes(2)
    for bad, match in (
        ((carry[:1], parameters, TORQUES), r"carry: shape \(1, 2\), allowed \(2, 2\)"),
        (
            (carry, parameters[:, :1], TORQUES),
            r"parameters: shape \(3, 1\), allowed \(3, 2\)",
        ),
        (
            (carry, parameters, np.zeros((4, 2))),
            r"rows: shape \(4, 2\), allowed \(4, 1\)",
        ),
    ):
        with pytest.raises(ValueError, match=match):
            kernel.run(*bad)
    with pytest.raises(ValueError, match="seed = -1"):
        kernel.run(carry, parameters, TORQUES, seed=-1)
    with pytest.raises(ValueError, match="whole numbers below"):
        kernel.run(carry, parameters, TORQUES, episodes=np.array([-1, 0]))


def test_a_loop_without_parameters_rows_or_steps_runs():
    kernel = JaxKernel(
        trace_loop(lambda x, p, r, u: ((2.0 * x[0], 1.5), ()), (1.0, 0.0), (), ())
    )
    start = np.array([[1.0, 2.0, 3.0], [0.0, 0.0, 0.0]])
    assert kernel.run(start, np.zeros((0, 3)), np.zeros((3, 0)))[0].tolist() == [
        [8.0, 16.0, 24.0],
        [1.5] * 3,
    ]
    assert np.array_equal(
        kernel.run(start, np.zeros((0, 3)), np.zeros((0, 0)))[0], start
    )


def test_a_program_traced_with_loops_is_refused(monkeypatch):
    monkeypatch.setattr("skyarm.compile.tracing.lower.WRITTEN_OUT", 0)

    def step(carry, par, row, draws):
        return repeat(3, lambda x: (x[0] * 0.5,), carry), ()

    kernel = JaxKernel(trace_loop(step, (1.0,), (), (), loops=True))
    with pytest.raises(ValueError, match="without loops for JAX"):
        kernel.run(np.ones((1, 1)), np.zeros((0, 1)), np.zeros((1, 0)))
    written_out = JaxKernel(trace_loop(step, (1.0,), (), ()))
    assert (
        written_out.run(np.ones((1, 1)), np.zeros((0, 1)), np.zeros((1, 0)))[0] == 0.125
    )


FRESH = """
import os
from jax_kernel import configure_cpu
configure_cpu()
flags = os.environ["XLA_FLAGS"]
import jax, numpy as np
jax.config.update("jax_enable_x64", True)
print(jax.jit(lambda x: x + 1.0)(np.arange(3.0)).tolist())
configure_cpu()
assert os.environ["XLA_FLAGS"] == flags
given = "--xla_cpu_enable_fast_math=false --xla_cpu_prefer_vector_width=512 "
assert flags.startswith(given), flags
"""


def test_the_cpu_flags_are_known_to_this_jaxlib_and_come_before_it_starts():
    """A flag that jaxlib does not know would end the process; a user's own flags
    stay.
    """
    bench = Path(__file__).parents[1] / "studies" / "bench"
    environment = os.environ | {
        "XLA_FLAGS": "--xla_cpu_enable_fast_math=false",
        "JAX_PLATFORMS": "cpu",
        "PYTHONPATH": os.pathsep.join([str(bench), os.environ.get("PYTHONPATH", "")]),
    }
    done = subprocess.run(
        [sys.executable, "-c", FRESH],
        env=environment,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[0] == "[1.0, 2.0, 3.0]"


def test_a_missing_library_is_named_with_its_extra():
    hidden = (
        "import sys; sys.modules['jax'] = None; import"
        " skyarm.compile.jax.jax_operations"
    )
    done = subprocess.run(
        [sys.executable, "-c", hidden],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert f"MissingExtraError: {needs_extra('jax')}" in done.stderr
