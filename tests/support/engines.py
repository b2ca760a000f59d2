"""Engines: one call over all of them, C compilers, exported laws, threads, lanes that
are stepped.

- One call over every engine: floats, NumPy, JAX, CasADi and the tracer, each as lists
  of Python floats in and out.
- The machine's C compiler for tests: C text into a loaded library, an object's symbols,
  a function's stack.
- An exported controller, compiled and loaded: its C structs read back from the text,
  its step called from Python.
- Waiting for what threads of kernels soon do.
- Thousands of episodes stepped together, one control period a call, with actions per
  lane.
"""

from __future__ import annotations

import ctypes
import dataclasses
import re
import shutil
import subprocess
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from queue import SimpleQueue
from typing import Any, Self

import numpy as np
import numpy.typing as npt
import pytest
from scipy.differentiate import jacobian

from skyarm.algebra import Scalar
from skyarm.compile.c_source import END_IEEE, KEEP_IEEE, Floats, helpers, statements
from skyarm.compile.llvm.kernel import Kernel, host_width
from skyarm.compile.llvm.lane_stepper import LaneStepper
from skyarm.compile.llvm.llvm_text import Lanes
from skyarm.compile.tracing.tracer import Lowered
from skyarm.dynamics import State
from skyarm.records.files import shown
from skyarm.records.leaves import rebuild
from skyarm.scenario.numbers import number_at, with_numbers
from skyarm.scenario.scenario_checks import require_flight
from skyarm.scenario.scenario_record import Scenario, ScenarioError, noise_key
from skyarm.simulate.batch_leg import lane_statuses
from skyarm.simulate.examine import require_shapes
from skyarm.simulate.first_state import first_loop_state
from skyarm.simulate.inputs import held_row
from skyarm.simulate.lane_numbers import (
    LaneRules,
    checked_array,
    lane_mask,
    require_count,
    require_paths,
    require_rigid_body,
    require_short_steps,
    require_values,
    require_within_queue,
)
from skyarm.simulate.loop_state import InputRow, LoopState, structure_of
from skyarm.simulate.period import make_period
from skyarm.simulate.program import LoopProgram, TracedPeriod
from skyarm.simulate.stages import Stages

ENGINES = ("floats", "numpy", "jax", "casadi", "trace")


def jax_doubles(allowed: bool = True) -> Any:
    """A context in which JAX computes in 64 bits, or in 32; newer versions have it
    under another name.
    """
    jax = pytest.importorskip("jax")
    return (
        jax.enable_x64(allowed)
        if hasattr(jax, "enable_x64")
        else jax.experimental.enable_x64(allowed)
    )


def evaluate(
    engine: str,
    function: Callable[..., Sequence[Any]],
    lanes: Sequence[Sequence[float]],
) -> np.ndarray:
    """``function(*scalars) -> sequence of scalars`` at each lane; rows are lanes,
    columns outputs.
    """
    return {
        "floats": _floats,
        "numpy": _numpy,
        "jax": _jax,
        "casadi": _casadi,
        "trace": _trace,
    }[engine](function, lanes)


def slopes(
    function: Callable[..., Sequence[Any]], point: Any, units: Any = 1.0
) -> np.ndarray:
    """Jacobian of ``function(*scalars)`` on NumPy lanes, by SciPy's differences of
    eighth order.

    Args:
        function: as of :func:`evaluate`.
        point: where.
        units: of the scalars: ten times the first step.
    """

    def outputs(lanes: Any) -> Any:
        return np.array(
            np.broadcast_arrays(*function(*(lanes.T * units).T), lanes[0])[:-1]
        )

    return jacobian(outputs, point / units, initial_step=0.1, order=8).df / units


def _floats(function: Any, lanes: Any) -> np.ndarray:
    return np.array(
        [[float(out) for out in function(*map(float, lane))] for lane in lanes]
    )


def _spread(outputs: Any, count: int) -> np.ndarray:
    return np.array(
        [np.broadcast_to(np.asarray(out, dtype=float), (count,)) for out in outputs]
    ).T


def _numpy(function: Any, lanes: Any) -> np.ndarray:
    columns = np.array(lanes, dtype=float).T
    return _spread(function(*columns), len(lanes))


def _jax(function: Any, lanes: Any) -> np.ndarray:
    jax = pytest.importorskip("jax")
    with jax_doubles():
        columns = [
            jax.numpy.asarray(column) for column in np.array(lanes, dtype=float).T
        ]
        return _spread(function(*columns), len(lanes))


def _casadi(function: Any, lanes: Any) -> np.ndarray:
    import casadi

    inputs = [casadi.SX.sym(f"x{i}") for i in range(len(lanes[0]))]
    outputs = [casadi.SX(out) for out in function(*inputs)]
    compiled = casadi.Function("f", inputs, [casadi.vertcat(*outputs)])
    return np.array([np.array(compiled(*map(float, lane))).ravel() for lane in lanes])


def _trace(function: Any, lanes: Any) -> np.ndarray:
    from skyarm.compile import trace

    program = trace(
        lambda *scalars: tuple(function(*scalars)), *(0.5 for _ in lanes[0])
    )
    return np.array(
        [[float(out) for out in program(*map(float, lane))] for lane in lanes]
    )


CC = shutil.which("cc")
needs_cc = pytest.mark.skipif(CC is None, reason="no C compiler 'cc' on this machine")

STRICT = ("-Wall", "-Wextra", "-Werror", "-std=c99", "-pedantic")
CAREFUL = (
    "-Wconversion",
    "-Wshadow",
    "-Wdouble-promotion",
    "-Wmissing-prototypes",
    "-Wstrict-prototypes",
)
LIBM = {
    f"{name}{suffix}"
    for name in ("sqrt", "fabs", "floor", "copysign", "ldexp", "frexp")
    for suffix in ("", "f")
}


def run(*command: str | Path) -> str:
    result = subprocess.run(
        [str(c) for c in command],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert result.returncode == 0, result.stderr[:4000]
    return result.stdout


def object_file(
    text: str, folder: Path, flags: Sequence[str] = ("-O2",), name: str = "program"
) -> Path:
    """Compile to an object file; any warning is a failure."""
    assert CC is not None
    source, target = folder / f"{name}.c", folder / f"{name}.o"
    source.write_text(text, encoding="ascii")
    run(CC, *STRICT, *flags, "-fPIC", "-c", source, "-o", target)
    return target


def library(
    text: str, folder: Path, flags: Sequence[str] = ("-O2",), name: str = "program"
) -> ctypes.CDLL:
    """Compile and load; linked without the compile flags, which could change the
    process (flush to zero).
    """
    assert CC is not None
    shared = folder / f"{name}.so"
    run(CC, "-shared", object_file(text, folder, flags, name), "-lm", "-o", shared)
    return ctypes.CDLL(str(shared))


def undefined(target: Path) -> set[str]:
    """Symbols an object file needs from elsewhere."""
    if shutil.which("nm") is None:
        pytest.skip("no 'nm' on this machine")
    # what position-independent code needs is the linker's
    return set(re.findall(r"\bU _?(\w+)", run("nm", "-u", target))) - {
        "GLOBAL_OFFSET_TABLE_",
        "_GLOBAL_OFFSET_TABLE_",
    }


def c_function(program: Lowered, name: str, *, single: bool = False) -> str:
    """A C99 file with ``void name(const double *x, double *y)``: the program on plain
    arrays.

    Args:
        program: basic operations.
        name: of the function, a C identifier.
        single: float in place of double.
    """
    floats = Floats(single)
    inputs = [f"x[{i}]" for i in range(len(program.inputs))]
    outputs = [f"y[{i}]" for i in range(len(program.outputs))]
    body = statements(program, floats, name, inputs, outputs)
    signature = f"void {name}(const {floats.kind} *x, {floats.kind} *y)"
    lines = [
        "#include <math.h>",
        "",
        KEEP_IEEE,
        helpers(program, floats, name),
        f"{signature};",
        signature,
        "{",
    ]
    unused = ["    (void)x;", "    (void)y;"]  # a program of constants reads nothing
    return "\n".join(
        [*lines, *unused, *(f"    {line}" for line in body), "}", "", END_IEEE]
    )


def structs(text: str, name: str = "law"):
    """The C structs as the file itself declares them, read back by their text."""
    found = {}
    for key, body in re.findall(
        rf"^struct {name}_(\w+) {{\n(.*?)^}};", text, re.MULTILINE | re.DOTALL
    ):
        members = []
        for kind, member, sizes in re.findall(
            r"^    (double|float) (\w+)((?:\[\d+\])*);", body, re.MULTILINE
        ):
            held = {"double": ctypes.c_double, "float": ctypes.c_float}[kind]
            for size in reversed(re.findall(r"\d+", sizes)):
                held = held * int(size)
            members.append((member, held))
        found[key] = type(key, (ctypes.Structure,), {"_fields_": members})
    return found


def fill(struct, record) -> None:
    """A record's fields into the members of the same name."""
    for field in dataclasses.fields(record):
        value = getattr(record, field.name)
        if not hasattr(value, "__iter__"):
            setattr(struct, field.name, value)
        elif held := list(value):
            getattr(struct, field.name)[:] = held  # refuses another length


class Loaded:
    """An exported controller, loaded."""

    def __init__(self, text: str, folder, flags=("-O2",), name: str = "law") -> None:
        self.kinds, self.name = structs(text, name), name
        self.library = library(text, folder, flags, name)
        self.parameters = self.kinds["parameters"].in_dll(
            self.library, f"{name}_default_parameters"
        )
        self.memory = self.kinds["memory"]()
        ctypes.pointer(self.memory)[0] = self.kinds["memory"].in_dll(
            self.library, f"{name}_first_memory"
        )

    def __call__(self, measurement, reference, parameters=None) -> list[float]:
        m, r, command = (
            self.kinds["measurement"](),
            self.kinds["reference"](),
            self.kinds["command"](),
        )
        fill(m, measurement)
        fill(r, reference)
        arguments = [ctypes.byref(each) for each in (m, r, self.memory, command)]
        if parameters is None:
            getattr(self.library, f"{self.name}_step")(*arguments)
        else:
            getattr(self.library, f"{self.name}_step_with")(
                ctypes.byref(parameters), *arguments
            )
        return [
            *command.rotor_speeds,
            *getattr(command, "efforts", ()),
            *getattr(command, "tilts", ()),
        ]

    def copy_of_parameters(self):
        copy = self.kinds["parameters"]()
        ctypes.pointer(copy)[0] = self.parameters
        return copy


def wait_until(true, seconds=60.0):
    """Look until something is true, which it soon is."""
    deadline = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < deadline
        time.sleep(0.005)


def interrupted_queue():
    """A kind of queue, the first wait for which with a timeout is interrupted."""
    made = []

    class Interrupted(SimpleQueue):
        def get(self, block=True, timeout=None):
            if timeout is not None and not made:
                made.append(1)
                raise KeyboardInterrupt
            return super().get(block, timeout)

    return Interrupted


Array = npt.NDArray[Any]


def lane_numbers(field: str, values: Any, lanes: int) -> Array:
    """(lanes,) numbers of one path, of one number for all or of one a lane."""
    allowed = f"one number, or one for each of {lanes} lanes"
    found = checked_array(field, values, [(), (lanes,)], allowed).astype(float)
    if np.isnan(found).any():
        raise ScenarioError(f"{field}: nan is not a number")
    return np.broadcast_to(found, (lanes,))


def _beyond() -> np.errstate:
    """Round to 32 bits: values out of range become infinite, without a warning."""
    return np.errstate(over="ignore")


def own_row(scenario: Scenario, ticks: Scalar) -> Any:
    """Closed-loop inputs after a number of control periods: time, and the reference
    unless its task phases wait.
    """
    if scenario.agent.reference.guards:
        return InputRow(time=ticks / float(scenario.rates.control), reference=())
    return held_row(scenario, ticks)


class BatchSession:
    """A batch session steps many episodes of a scenario by actions: rotor speeds and
    joint setpoints of every lane.

    A lane that ends, or has flown the scenario's duration, keeps its last state until
    the next step, which begins its next episode from the first state. With
    ``autoreset`` off it stays until :meth:`reset` begins its next episode: state,
    number of the episode, ``ended`` and ``truncated`` are those of its last period,
    whatever steps come. Time counts anew in each episode, and so does noise: it depends
    on ``seed`` and the number of the episode alone, not on when the lane began it.

    Args:
        scenario: on the rigid-body plant; its law is not asked.
        lanes: how many.
        paths: numbers that differ from lane to lane (:mod:`skyarm.scenario.numbers`);
            :meth:`set` gives them.
        single: 32-bit floats. bit_exact: every episode equals a :class:`skyarm.Session`
            of the scenario with this seed and the episode's number bit for bit; else a
            multiplication and an addition may be rounded once.
        threads: most that work, kept until :meth:`close`; the numbers do not depend on
            it. seed: key of the noise.
        autoreset: begin again by itself. law: step the scenario's law in place of
            actions.
        stiffest: a scenario with the stiffest joint friction of the batch, and the
            shortest largest step that its air, forces and drives state; both fix the
            integration steps.

    Attributes:
        state: the plant's state, a record of (lanes,) views that each step writes anew.
        ended: (lanes,) True where the last step flown ended the episode before its
            time.
        truncated: (lanes,) True where the last step flown was the last of the
            scenario's duration and no ending has come.
        episodes: (lanes,) number of the episode that each lane flies.
    """

    def __init__(
        self,
        scenario: Scenario,
        lanes: int,
        paths: Sequence[str] = (),
        *,
        single: bool = False,
        bit_exact: bool = False,
        threads: int = 1,
        seed: int = 0,
        autoreset: bool = True,
        law: bool = False,
        stiffest: Scenario | None = None,
    ) -> None:
        require_flight(scenario)
        require_rigid_body(scenario)
        if scenario.changes:
            raise ScenarioError(
                "changes: must be left out for lanes that are stepped; set() gives them"
                " other numbers"
            )
        lanes, threads = (
            require_count("lanes", lanes),
            require_count("threads", threads),
        )
        paths, seed = require_paths(scenario, paths), noise_key("seed", seed)
        require_shapes(scenario)
        self.scenario, self.paths, self._autoreset, self._seed = (
            scenario,
            paths,
            autoreset,
            seed,
        )
        self._rules = LaneRules(scenario, paths)
        self._base = tuple(number_at(scenario, path) for path in paths)
        self._first, self._law = first_loop_state(scenario), law
        numbers = self._base, structure_of(self._first.agent.queue[0])
        self._loop = LoopProgram(
            scenario, self._lane_scenario, numbers, stiffest=stiffest
        )
        program = self._loop.trace(self._period, self._first)
        kernel = Kernel(
            program,
            Lanes(host_width(single=single), single=single, contract=not bit_exact),
        )
        self._stepper = LaneStepper(kernel, lanes, seed=seed, threads=threads)
        self._parameters = self._stepper.parameters
        self._actions = self._parameters[len(self._base) :]
        with _beyond():
            self._parameters[: len(self._base)] = np.array(self._base)[:, None]
        self._carry = self._stepper.carry
        now: LoopState = rebuild(self._first, iter(list(self._carry)))
        self.state: State = now.agent.state
        self._alive, self._ticks = self._carry[0], self._carry[1]
        self.episodes: Array = np.zeros(lanes, dtype=np.int64)
        self._next, self._over = 0, False
        self.ended, self.truncated = (
            np.zeros(lanes, dtype=bool),
            np.zeros(lanes, dtype=bool),
        )
        self.reset()

    def _lane_scenario(self, values: tuple[Sequence[Any], Any]) -> Scenario:
        return with_numbers(
            self.scenario, dict(zip(self.paths, values[0], strict=True))
        )

    def _period(
        self, period: TracedPeriod, now: LoopState
    ) -> tuple[LoopState, tuple[()]]:
        scenario = period.stages.scenario
        stages = Stages(scenario, () if self._law else (period.numbers[1],))
        following, _ = make_period(stages, period.plant)(
            now, (own_row(scenario, now.ticks),), period.uniforms
        )
        return following, ()

    @property
    def lanes(self) -> int:
        """Number of episodes flown in parallel."""
        return int(self._carry.shape[1])

    @property
    def now(self) -> LoopState:
        """Loop state at the start of the next period; each number is a (lanes,) view
        that the next step overwrites.
        """
        now: LoopState = rebuild(self._first, iter(list(self._carry)))
        return now

    def set(self, values: Mapping[str, Any], mask: Array | None = None) -> None:
        """Set numbers of lanes by path; they hold from the next step on, initial values
        from the next episode on.

        Args:
            values: path -> one number for all lanes, or (lanes,).
            mask: (lanes,) True where they hold; everywhere if left out.

        Raises:
            ScenarioError: a path that is not one of the session's, or numbers that
                cannot be; none is taken then.
        """
        among, columns = lane_mask(mask, self.lanes), {}
        for path, value in require_values(values).items():
            if path not in self.paths:
                raise ScenarioError(
                    f"path = {shown(path)}: must be one of"
                    f" {', '.join(self.paths) or 'none'}"
                )
            columns[path] = lane_numbers(f"values[{path!r}]", value, self.lanes)
        # with all numbers that a lane has: some are bounded by others
        now = {
            path: self._parameters[i][among].astype(float)
            for i, path in enumerate(self.paths)
        }
        numbers = now | {path: column[among] for path, column in columns.items()}
        require_within_queue(self.scenario, numbers)
        self._rules.require(numbers)
        require_short_steps(self.scenario, numbers, self._loop.largest)
        for path, column in columns.items():
            with _beyond():
                self._parameters[self.paths.index(path)][among] = column[among]
        self._stepper.fill()

    def reset(self, mask: Array | None = None, *, seed: int | None = None) -> State:
        """Begin new episodes in all lanes, or where the mask is true; returns the
        state.

        Args:
            mask: (lanes,) True where; everywhere if left out.
            seed: key of the noise from now on, with episodes numbered from 0 again; not
                together with a mask.

        Raises:
            ScenarioError: a mask or a seed that cannot be.
        """
        lanes = np.flatnonzero(lane_mask(mask, self.lanes))
        if seed is not None:
            if mask is not None:
                raise ScenarioError(
                    f"seed = {shown(seed)}: must be left out with a mask, since all"
                    " lanes have one"
                )
            self._seed, self._next = noise_key("seed", seed), 0
            self._stepper.seed(self._seed)
        self.episodes[lanes] = np.arange(self._next, self._next + len(lanes))
        self._next += len(lanes)
        self._stepper.begin(lanes, self.episodes[lanes])
        with _beyond():
            self._carry[:, lanes] = self._loop.start(
                self._parameters[:, lanes], self._seed, self.episodes[lanes]
            )
        self.ended[lanes] = self.truncated[lanes] = False
        self._over = bool((self.ended | self.truncated).any())
        self._stepper.fill()
        return self.state

    def step(self, actions: Array | None = None) -> State:
        """Fly one control period in every lane.

        Args:
            actions: (rotors + joints, lanes): rotor speeds (rad/s), then joint
                setpoints, then a row of angles for each rotor that tilts; (rotors +
                joints, 1) are those of every lane. Those of the last step if left out.

        Returns:
            ``state``: views that the next step writes anew.

        Raises:
            ScenarioError: actions of another shape, or no numbers; nothing is flown
                then.
        """
        if actions is not None:
            self._take(actions)
        if not self._over:
            self._fly()
        elif self._autoreset:
            self.reset(self.ended | self.truncated)
            self._fly()
        else:
            self._fly_those_that_go_on()
        return self.state

    def _fly(self) -> None:
        """Fly one control period in every lane, and update the termination flags."""
        self._stepper.step()
        np.less(self._alive, 0.5, out=self.ended)
        np.greater_equal(self._ticks, self.scenario.steps, out=self.truncated)
        self._over = bool((self.ended | self.truncated).any())
        if self._over:
            self._tell_apart()

    def _fly_those_that_go_on(self) -> None:
        """Fly one control period; lanes whose episode is over are restored."""
        over = np.flatnonzero(self.ended | self.truncated)
        held = self._carry[:, over].copy(), self.ended[over], self.truncated[over]
        if over.size < self.lanes:
            self._fly()
        self._carry[:, over], self.ended[over], self.truncated[over] = held

    def _take(self, actions: Array) -> None:
        """Actions of the next step."""
        held = self._actions
        if (
            isinstance(actions, np.ndarray)
            and actions.dtype == held.dtype
            and actions.shape == held.shape
        ):
            held[:] = actions
            return
        rows, lanes = held.shape
        allowed = (
            f"numbers of shape {(rows, lanes)} or {(rows, 1)}: rotor speeds, then joint"
            " setpoints"
        )
        given = checked_array("actions", actions, [(rows, lanes), (rows, 1)], allowed)
        with _beyond():
            held[:] = given

    def _tell_apart(self) -> None:
        """An ending that comes in the very last period counts as one, as in a single
        run.
        """
        last = np.flatnonzero(self.truncated & ~self.ended)
        if last.size:
            left: LoopState = rebuild(
                self._first, iter([leaf[last].astype(float) for leaf in self._carry])
            )
            values = {
                path: self._parameters[i, last].astype(float)
                for i, path in enumerate(self.paths)
            }
            status = lane_statuses(
                self.scenario, values, left, left.ticks, np.zeros(last.size, dtype=bool)
            )
            self.ended[last] = status != "completed"
        self.truncated &= ~self.ended

    def close(self) -> None:
        """End the threads, which otherwise wait for the next step as long as the
        session lives.
        """
        self._stepper.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
