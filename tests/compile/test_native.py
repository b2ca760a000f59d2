"""Machine code gives the bits of Python floats on every vector width, and its cache
survives whatever befalls it.
"""

from __future__ import annotations

import os
import platform
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest
from programs_random import SPECIAL, bits, oscillator, random_function, same_bits

from skyarm.algebra.scalars import elementary
from skyarm.algebra.scalars.philox import uniforms
from skyarm.compile import TracedBranchError
from skyarm.compile.llvm import kernel as native
from skyarm.compile.llvm.kernel import Kernel, host_width
from skyarm.compile.llvm.lane_stepper import Stepper
from skyarm.compile.llvm.llvm_text import Lanes
from skyarm.compile.tracing.lower import repeat
from skyarm.compile.tracing.program import trace_loop
from support.cases import sampled


@pytest.fixture(autouse=True, scope="module")
def _optimised():
    """Code as users fly it; other tests hurry the compiler."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SKYARM_EFFORT", "2")
        yield


SOURCE = str(Path(native.__file__).parents[3])


@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch):
    folder = tmp_path / "cache"
    monkeypatch.setenv("SKYARM_CACHE", str(folder))
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    return folder


def spring(draws=()):
    return trace_loop(oscillator, (0.0, 0.0), (0.0,), (0.0,), draws)


def fly(kernel, lanes=11, steps=50, **options):
    carry = np.vstack([np.linspace(0.1, 1.0, lanes), np.zeros(lanes)])
    stiffness = np.linspace(1.0, 30.0, lanes)[None]
    rows = np.sin(np.arange(steps) / 7.0)[:, None]
    return kernel.run(carry, stiffness, rows, **options)


@pytest.mark.parametrize("seed", sampled(range(6), 6))
def test_a_random_program_has_the_bits_of_python_floats_on_every_width(seed):
    function = random_function(np.random.default_rng([5, seed]))
    loop = trace_loop(lambda c, p, r, u: (c, function(*p, *r)), (), (0.5, 0.5), (0.5,))
    a, b = (grid.ravel() for grid in np.meshgrid(SPECIAL, SPECIAL))
    rows = np.array([[0.25], [np.nan], [-7.5]])
    step = loop.stepper()
    expected = [
        [
            bits(step((x, y, row[0])))
            for x, y in zip(a.tolist(), b.tolist(), strict=True)
        ]
        for row in rows.tolist()
    ]
    for width in (1, 2, 4, 8):
        kernel = Kernel(loop, Lanes(width), logging=True)
        _, log = kernel.run(np.zeros((0, a.size)), np.stack([a, b]), rows)
        assert [
            [bits(log[k, :, i]) for i in range(a.size)] for k in range(3)
        ] == expected, width


@pytest.mark.parametrize("seed", sampled(range(3), 3))
def test_single_precision_has_the_same_bits_on_every_width(seed):
    function = random_function(np.random.default_rng([6, seed]))
    loop = trace_loop(lambda c, p, r, u: (c, function(*p)), (), (0.5, 0.5), ())
    special = np.array(SPECIAL)[np.abs(SPECIAL) != 1e308]
    values = np.stack([grid.ravel() for grid in np.meshgrid(special, special)])
    logs = []
    for width in (1, 4, 8, 16):
        kernel = Kernel(loop, Lanes(width, single=True), logging=True)
        logs.append(
            kernel.run(np.zeros((0, values.shape[1])), values, np.zeros((1, 0)))[1]
        )
    assert all(same_bits(logs[0], log) for log in logs[1:])


# exp to (|x| + 2) units: its reduced argument carries the rounding of x
SINGLE = [
    ("sin", -30.0, 30.0, 2.0),
    ("cos", -30.0, 30.0, 2.0),
    ("exp", -87.0, 88.7, 2.0),
    ("log", 1e-30, 1e30, 2.0),
    ("tanh", -100.0, 100.0, 3.0),
    ("asin", -1.0, 1.0, 4.0),
]


@pytest.mark.parametrize(("name", "low", "high", "bound"), SINGLE)
def test_single_precision_keeps_its_own_accuracy(name, low, high, bound):
    """Errors in units of 1.2e-7 of the value or, near a zero of sin and cos, of one."""
    loop = trace_loop(
        lambda c, p, r, u: (c, (elementary.COMPOSED[name](p[0]),)), (), (0.5,), ()
    )
    kernel = Kernel(loop, Lanes(8, single=True), logging=True)
    x = np.concatenate(
        [np.linspace(low, high, 4001), np.linspace(low, high, 4001) * 1e-3]
    ).astype(np.float32)
    x = x[x >= np.float32(low)]
    _, log = kernel.run(np.zeros((0, x.size)), x[None], np.zeros((1, 0)))
    exact = {"asin": np.arcsin}.get(name, getattr(np, name, None))(x.astype(float))
    scale = np.maximum(np.abs(exact), 1e-2 if name in ("sin", "cos", "log") else 1e-30)
    assert float(np.max(np.abs(log[0, 0] - exact) / scale)) <= bound * 1.2e-7


def test_single_precision_exp_is_infinite_or_zero_beyond_its_range():
    """Between 88.7 (single) and 709 (double) the exponent must not wrap round: tanh of
    a Coulomb law lives there.
    """
    loop = trace_loop(
        lambda c, p, r, u: (
            c,
            (elementary.exp(p[0]), elementary.tanh(p[0]), elementary.exp(-p[0])),
        ),
        (),
        (0.5,),
        (),
    )
    kernel = Kernel(loop, Lanes(4, single=True), logging=True)
    x = np.concatenate([np.arange(89.0, 712.0), [1e4, np.inf]])
    _, log = kernel.run(np.zeros((0, x.size)), x[None], np.zeros((1, 0)))
    assert np.all(log[0, 0] == np.inf)
    assert np.all(log[0, 1] == 1.0)
    assert np.all((log[0, 2] >= 0.0) & (log[0, 2] <= np.exp(-88.9)))


def test_lanes_that_do_not_fill_a_vector_are_flown_alike():
    kernel = Kernel(spring(), Lanes(8), logging=True)
    whole, log = fly(kernel, lanes=17)
    for k in (0, 8, 16):
        carry = np.vstack([np.linspace(0.1, 1.0, 17), np.zeros(17)])[:, k : k + 1]
        alone, logged = kernel.run(
            carry,
            np.linspace(1.0, 30.0, 17)[None, k : k + 1],
            np.sin(np.arange(50) / 7.0)[:, None],
        )
        assert same_bits(alone[:, 0], whole[:, k])
        assert same_bits(logged[:, :, 0], log[:, :, k])


def test_the_log_keeps_every_nth_step():
    loop = spring()
    _, log = fly(Kernel(loop, logging=True))
    _, thinned = fly(Kernel(loop, logging=True), every=7)
    assert thinned.shape[0] == 8
    assert same_bits(thinned, log[::7])


def test_results_do_not_depend_on_threads():
    kernel = Kernel(spring(((0, 2),)), Lanes(4), logging=True)
    one = fly(kernel, lanes=103, seed=9)
    for threads in (2, 3, 16):
        assert all(
            same_bits(a, b)
            for a, b in zip(
                one, fly(kernel, lanes=103, seed=9, threads=threads), strict=True
            )
        )


@pytest.mark.parametrize("width", [1, 8])
def test_random_numbers_are_those_of_the_generator(width):
    """Odd counts, two channels, a late start, seeds of 64 bits, any episodes: the bits
    of philox.uniforms.
    """
    draws = ((0, 3), (7, 2))
    loop = trace_loop(lambda c, p, r, u: (c, tuple(u)), (), (), (), draws)
    kernel = Kernel(loop, Lanes(width), logging=True)
    episodes, seed = np.array([5, 0, 2**32 - 1, 77, 8, 9, 10, 11, 12]), 2**63 + 12345
    _, log = kernel.run(
        np.zeros((0, 9)),
        np.zeros((0, 9)),
        np.zeros((4, 0)),
        seed=seed,
        episodes=episodes,
        start=2**32 - 4,
    )
    steps = np.arange(2**32 - 4, 2**32)
    for k, episode in enumerate(episodes.tolist()):
        drawn = [
            uniforms(seed, episode, channel, steps, count) for channel, count in draws
        ]
        assert same_bits(log[:, :, k], np.concatenate(drawn, axis=1))


def test_an_episode_is_the_same_in_any_chunk():
    kernel = Kernel(spring(((0, 2),)), Lanes(4), logging=True)
    carry, stiffness, rows = np.ones((2, 10)), np.full((1, 10), 4.0), np.zeros((30, 1))
    whole, _ = kernel.run(carry, stiffness, rows, seed=3)
    parts = [(0, 3), (3, 4), (4, 10)]
    for a, b in parts:
        part, _ = kernel.run(
            carry[:, a:b], stiffness[:, a:b], rows, seed=3, episodes=np.arange(a, b)
        )
        assert same_bits(part, whole[:, a:b])


def test_an_episode_cut_in_time_goes_on_where_it_stopped():
    kernel = Kernel(spring(((0, 2),)), Lanes(4))
    carry, stiffness, rows = (
        np.ones((2, 5)),
        np.full((1, 5), 4.0),
        np.sin(np.arange(30.0))[:, None],
    )
    whole, _ = kernel.run(carry, stiffness, rows, seed=3)
    first, _ = kernel.run(carry, stiffness, rows[:13], seed=3)
    second, _ = kernel.run(first, stiffness, rows[13:], seed=3, start=13)
    assert same_bits(second, whole)


def test_a_lane_that_diverges_leaves_its_neighbours_their_bits():
    kernel = Kernel(spring(), Lanes(8))
    carry, stiffness, rows = np.ones((2, 16)), np.full((1, 16), 4.0), np.ones((40, 1))
    healthy, _ = kernel.run(carry, stiffness, rows)
    stiffness[0, 5], carry[0, 9] = np.nan, np.inf
    found, _ = kernel.run(carry, stiffness, rows)
    others = [k for k in range(16) if k not in (5, 9)]
    assert same_bits(found[:, others], healthy[:, others])
    assert not np.isfinite(found[:, [5, 9]]).any()


def test_contraction_rounds_once_and_stays_close():
    exact, _ = fly(Kernel(spring(), Lanes(8)), steps=500)
    contracted, _ = fly(Kernel(spring(), Lanes(8, contract=True)), steps=500)
    # 500 steps of a stable spring, a rounding each
    assert np.max(np.abs(contracted - exact)) < 1e-12


def test_only_contraction_flushes_subnormal_numbers_and_no_caller_notices():
    loop = trace_loop(lambda c, p, r, u: ((c[0] * 0.5,), ()), (0.0,), (), ())
    smallest = np.array([[2.2250738585072014e-308]])
    ends = {}
    for contract in (False, True):
        kernel = Kernel(loop, Lanes(1, contract=contract))
        ends[contract] = kernel.run(smallest, np.zeros((0, 1)), np.zeros((1, 0)))[0][
            0, 0
        ]
        stepper = Stepper(kernel, smallest[:, 0])
        stepper.step()
        assert stepper.carry[0] == ends[contract]
        assert float(smallest[0, 0]) * 0.5 > 0.0
    assert ends[False] == 0.5 * 2.2250738585072014e-308
    assert ends[True] == (
        0.0 if platform.machine() in ("x86_64", "AMD64") else ends[False]
    )


def test_a_branch_on_a_traced_value_names_file_and_line_and_the_remedy():
    def step(carry, parameters, row, draws):
        return ((carry[0] if carry[0] > 0.0 else 0.0),), ()

    line = step.__code__.co_firstlineno + 1
    with pytest.raises(
        TracedBranchError,
        match=rf"test_native\.py:{line}: branch on a traced value; use .*where",
    ):
        trace_loop(step, (1.0,), (), ())


def test_shapes_that_do_not_fit_are_refused():
    kernel = Kernel(spring())
    with pytest.raises(ValueError, match=r"rows: shape \(5, 2\), allowed \(steps, 1\)"):
        kernel.run(np.zeros((2, 3)), np.zeros((1, 3)), np.zeros((5, 2)))
    with pytest.raises(
        ValueError, match=r"parameters: shape \(2, 3\), allowed \(1, 3\)"
    ):
        kernel.run(np.zeros((2, 3)), np.zeros((2, 3)), np.zeros((5, 1)))
    with pytest.raises(
        ValueError, match=r"parameters: shape \(1, 4\), allowed \(1, 3\)"
    ):
        kernel.run(np.zeros((2, 3)), np.zeros((1, 4)), np.zeros((5, 1)))
    with pytest.raises(ValueError, match=r"episodes: shape \(2,\), allowed \(3,\)"):
        kernel.run(
            np.zeros((2, 3)), np.zeros((1, 3)), np.zeros((5, 1)), episodes=np.arange(2)
        )
    with pytest.raises(
        ValueError, match=r"episodes: must be whole numbers from 0 to 2\*\*32 - 1"
    ):
        kernel.run(
            np.zeros((2, 3)),
            np.zeros((1, 3)),
            np.zeros((5, 1)),
            episodes=np.array([0, 1, 2**32]),
        )
    with pytest.raises(ValueError, match=r"every = 0: must be at least 1"):
        kernel.run(np.zeros((2, 3)), np.zeros((1, 3)), np.zeros((5, 1)), every=0)


def test_code_made_in_a_hurry_has_the_bits_of_the_other_and_an_entry_of_its_own(
    tmp_path, monkeypatch
):
    monkeypatch.setenv("SKYARM_CACHE", str(tmp_path))
    loop, rng = spring(), np.random.default_rng(5)
    carry, parameters, rows = (
        rng.normal(size=s)
        for s in ((loop.carry, 3), (loop.parameters, 3), (50, loop.row))
    )
    flights = [
        Kernel(loop, Lanes(2), logging=True, effort=effort).run(
            carry, parameters, rows, seed=3
        )
        for effort in (0, 2)
    ]
    assert all(same_bits(a, b) for a, b in zip(*flights, strict=True))
    assert len(list(tmp_path.glob("*.o"))) == 2


def test_no_lanes_are_no_error():
    carry, log = Kernel(spring(), logging=True).run(
        np.zeros((2, 0)), np.zeros((1, 0)), np.zeros((5, 1))
    )
    assert carry.shape == (2, 0)
    assert log.shape == (5, 1, 0)


class TestCache:
    def entries(self, cache):
        return sorted(cache.glob("*.o"))

    def test_the_second_kernel_is_not_compiled_again(self, cache, monkeypatch):
        first = fly(Kernel(spring()))[0]
        (entry,) = self.entries(cache)
        written = entry.stat().st_mtime_ns

        def compile_again(*_arguments):
            raise AssertionError("compiled although the cache holds it")

        monkeypatch.setattr(native, "build", compile_again)
        assert same_bits(fly(Kernel(spring()))[0], first)
        assert entry.stat().st_mtime_ns == written

    @pytest.mark.parametrize("damage", ["empty", "cut", "flipped", "text"])
    def test_a_damaged_entry_is_built_again(self, cache, damage):
        first = fly(Kernel(spring()))[0]
        (entry,) = self.entries(cache)
        good = entry.read_bytes()
        flipped = good[:200] + bytes([good[200] ^ 1]) + good[201:]
        entry.write_bytes(
            {
                "empty": b"",
                "cut": good[:-100],
                "flipped": flipped,
                "text": b"not an object file",
            }[damage]
        )
        assert same_bits(fly(Kernel(spring()))[0], first)
        assert entry.read_bytes() == good

    def test_a_folder_that_cannot_be_written_is_no_error(self, cache, monkeypatch):
        cache.write_text("a file where the folder should be")
        assert fly(Kernel(spring()))[0].shape == (2, 11)
        monkeypatch.setenv("SKYARM_CACHE", "/proc/skyarm/no such folder")
        assert fly(Kernel(spring()))[0].shape == (2, 11)

    def test_no_home_folder_is_no_error(self, monkeypatch):
        for name in (
            "SKYARM_CACHE",
            "XDG_CACHE_HOME",
            "XDG_STATE_HOME",
            "LOCALAPPDATA",
            "HOME",
            "USERPROFILE",
        ):
            monkeypatch.delenv(name, raising=False)

        def no_home():
            raise RuntimeError("Could not determine home directory.")

        monkeypatch.setattr(Path, "home", staticmethod(no_home))
        assert fly(Kernel(spring()))[0].shape == (2, 11)

    def test_another_processor_has_entries_of_its_own(self, cache, monkeypatch):
        here = fly(Kernel(spring(), Lanes(2)))[0]
        (entry,) = self.entries(cache)
        import llvmlite.binding as llvm

        features = llvm.get_host_cpu_features().flatten().replace("+avx512", "-avx512")
        monkeypatch.setattr(native, "_features", lambda: f"{features},-fma")
        there = fly(Kernel(spring(), Lanes(2)))[0]
        assert len(self.entries(cache)) == 2
        assert entry.exists()
        assert same_bits(here, there)

    def test_programs_that_differ_in_one_constant_have_entries_of_their_own(
        self, cache
    ):
        for constant in (1.0, 1.0000000000000002):
            Kernel(
                trace_loop(
                    lambda c, p, r, u, k=constant: ((c[0] * k,), ()), (1.0,), (), ()
                )
            )
        assert len(self.entries(cache)) == 2

    def test_processes_that_compile_at_once_do_not_disturb_each_other(
        self, cache, tmp_path
    ):
        script = tmp_path / "one.py"
        script.write_text(
            "import sys, numpy as np\nfrom programs_random import oscillator\nfrom"
            " skyarm.compile.tracing.program import trace_loop\nfrom"
            " skyarm.compile.llvm.kernel import Kernel\nfor k in range(4):\n    kernel"
            " = Kernel(trace_loop(oscillator, (0.0, 0.0), (0.0,), (0.0,), ((k, 2),)))\n"
            "    print(kernel.run(np.ones((2, 3)), np.ones((1, 3)), np.ones((9,"
            " 1)))[0].tolist())\n"
        )
        paths = os.pathsep.join([SOURCE, str(Path(__file__).parent)])
        environment = {
            **os.environ,
            "PYTHONPATH": paths,
            "SKYARM_CACHE": str(cache),
            "XDG_STATE_HOME": str(tmp_path / "s"),
        }
        running = [
            subprocess.Popen(
                [sys.executable, str(script)],
                env=environment,
                stdout=subprocess.PIPE,
                text=True,
            )
            for _ in range(3)
        ]
        outputs = [process.communicate(timeout=60)[0] for process in running]
        assert [process.returncode for process in running] == [0, 0, 0]
        assert outputs[0] == outputs[1] == outputs[2]
        assert outputs[0].count("\n") == 4
        assert len(self.entries(cache)) == 4
        assert not list(cache.glob(".*.part"))

    def test_threads_that_compile_at_once_do_not_disturb_each_other(self):
        found, errors = [], []

        def work():
            try:
                found.append(fly(Kernel(spring()))[0])
            except Exception as error:
                errors.append(error)

        threads = [threading.Thread(target=work) for _ in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert not errors
        assert all(same_bits(found[0], other) for other in found)


def test_the_width_of_the_host_is_a_register_of_it():
    assert host_width() in (2, 4, 8)
    assert host_width(single=True) == 2 * host_width()


class TestStepper:
    def test_it_steps_as_the_kernel_does(self):
        kernel = Kernel(spring(), Lanes(1), logging=True)
        stepper = Stepper(kernel, np.array([0.4, -0.1]), np.array([7.0]))
        rows = np.sin(np.arange(30.0))[:, None]
        carry, log = kernel.run(np.array([[0.4], [-0.1]]), np.array([[7.0]]), rows)
        for k, row in enumerate(rows):
            stepper.row[:] = row
            stepper.step()
            assert same_bits(stepper.output, log[k, :, 0])
        assert same_bits(stepper.carry, carry[:, 0])

    def test_it_keeps_its_own_copies_and_its_machine_code_alive(self):
        carry = np.array([1.0, 0.0])
        step = Stepper(Kernel(spring(), Lanes(1)), carry, np.array([1.0])).step
        for _ in range(100):
            step()
        assert carry.tolist() == [1.0, 0.0]

    def test_what_does_not_fit_is_refused(self):
        with pytest.raises(ValueError, match=r"lanes.width = 2: must be 1"):
            Stepper(Kernel(spring(), Lanes(2)), np.zeros(2), np.zeros(1))
        with pytest.raises(ValueError, match=r"carry: shape \(3,\), allowed \(2,\)"):
            Stepper(Kernel(spring(), Lanes(1)), np.zeros(3), np.zeros(1))
        with pytest.raises(
            ValueError, match=r"parameters: shape \(0,\), allowed \(1,\)"
        ):
            Stepper(Kernel(spring(), Lanes(1)), np.zeros(2))


def test_a_large_program_is_made_with_the_least_effort(tmp_path, monkeypatch):
    """The optimiser takes minutes over 300 000 operations, and answers no signal
    meanwhile.
    """
    made, build = [], native.build
    monkeypatch.setenv("SKYARM_CACHE", str(tmp_path))
    monkeypatch.delenv(native.EFFORT, raising=False)
    monkeypatch.setattr(
        native, "build", lambda text, effort: made.append(effort) or build(text, effort)
    )
    loop = spring()
    size = native.operations(loop.program.nodes, written=True)
    for largest in (size - 1, size):
        monkeypatch.setattr(native, "LARGE", largest)
        Kernel(loop, Lanes(1))
    assert made == [0, 2]


def count(program, **which):
    return native.operations(program.program.nodes, **which)


@pytest.mark.parametrize(("most", "until"), [(3000, None), (300, 0), (3, 0)])
def test_a_loop_body_is_compiled_once_however_often_it_is_executed(most, until):
    def body(both):
        return both[0] - 1.0, both[1] * 1.5 + both[0]

    loop = trace_loop(
        lambda c, *_: (repeat(most, body, c, until), ()), (7.0, 1.0), (), (), loops=True
    )
    written = count(loop, written=True)
    assert written < 12
    rounds = most if until is None else min(most, 4)
    assert count(loop) - written == pytest.approx((rounds - 1) * 3, abs=2)


def test_full_effort_pays_for_long_flights_and_short_programs_alone():
    once = native.Assembly("", written=1000, size=1000, effort=2)
    looped = native.Assembly("", written=1000, size=4000, effort=2)
    assert not once.pays(149_000)
    assert once.pays(151_000)
    assert looped.pays(38_000)
    assert once.pays(15_100, times=10)
    assert not native.Assembly("", written=native.LARGE + 1, size=10**9, effort=2).pays(
        10**9
    )


def test_what_is_compiled_behind_a_command_serves_the_next_one_with_the_same_bits(
    monkeypatch,
):
    loop = spring()
    plain, _ = fly(Kernel(loop, Lanes(1), effort=0))
    text = native.Assembly.of(loop, Lanes(1)).text
    native.compile_behind(text)
    made = []
    monkeypatch.setattr(
        native.subprocess, "Popen", lambda *_, **__: made.append("again")
    )
    native.compile_behind(text)
    full = native._identity(text, 2)
    assert native._behind.pop().wait(60.0) == 0
    assert native.object_cache.load(full) is not None
    monkeypatch.setattr(native, "build", lambda *_: made.append("compiled"))
    assert same_bits(fly(Kernel(loop, Lanes(1), effort=0))[0], plain)
    native.compile_behind(text)
    assert made == []
    monkeypatch.setattr(native, "ANEW", 0.0)
    native.object_cache.clear()
    native.compile_behind(text)
    native.compile_behind(text)
    assert made == ["again", "again"]


@pytest.mark.parametrize("limit", ["0", "1"])
def test_a_limit_of_effort_starts_no_compilation_behind(monkeypatch, limit):
    monkeypatch.setenv("SKYARM_EFFORT", limit)
    monkeypatch.setattr(native.subprocess, "Popen", None)
    native.compile_behind(native.Assembly.of(spring(), Lanes(1)).text)


def test_a_command_ends_well_where_no_process_can_be_started(monkeypatch):
    def refused(*_, **__):
        raise BlockingIOError("Resource temporarily unavailable")

    monkeypatch.setattr(native.subprocess, "Popen", refused)
    native.compile_behind(native.Assembly.of(spring(), Lanes(1)).text)
