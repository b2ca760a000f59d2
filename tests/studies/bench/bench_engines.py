"""Our engines as contenders: the whole closed loop, with a different mass and gain in
every lane.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from bench_timing import Contender

from skyarm.compile.llvm.kernel import Kernel, host_width
from skyarm.compile.llvm.llvm_text import Lanes
from skyarm.compile.tracing.program import Loop, trace_loop
from skyarm.plant.compiled import Steps
from skyarm.records.leaves import leaves
from skyarm.scenario.numbers import number_at, with_numbers
from skyarm.scenario.scenario_record import Scenario
from skyarm.sensing.measurement import SensorNoise
from skyarm.simulate.draws import draws_needed
from skyarm.simulate.first_state import first_loop_state
from skyarm.simulate.inputs import episode_inputs
from skyarm.simulate.loop import run
from skyarm.simulate.loop_state import InputRow, structure_of
from skyarm.simulate.period import make_period
from skyarm.simulate.plant_steps import RigidBodySteps
from skyarm.simulate.stages import Stages
from skyarm.vehicle.vehicle_records import Vehicle

Array = npt.NDArray[np.float64]

VARIED = ("plant.vehicle.base.mass", "controller.gains.position.x")

NOISE = SensorNoise(
    position=0.002,
    velocity=0.02,
    attitude=0.002,
    rate=0.01,
    specific_force=0.05,
    joints=0.001,
    joint_rates=0.01,
    rotor_speeds=1.0,
)
"""Every channel at once, which is the dearest."""


@dataclass(frozen=True, slots=True)
class Flight:
    """A scenario's closed loop and what it is fed; no metrics, no log."""

    loop: Loop
    carry: Array
    parameters: Array
    rows: Array
    duration: float

    @classmethod
    def of(
        cls,
        scenario: Scenario,
        substeps: Callable[[float], Steps],
        *,
        loops: bool = True,
        paths: Sequence[str] = VARIED,
    ) -> Flight:
        """Trace a scenario with numbers per lane at ``paths``, its intervals cut into
        ``substeps(seconds)`` steps.
        """
        inputs = episode_inputs(scenario)
        base = tuple(number_at(scenario, path) for path in paths)

        def step(carry: Any, values: Any, row: Any, uniforms: Any) -> Any:
            varied = with_numbers(scenario, dict(zip(paths, values, strict=True)))
            stages = Stages(varied)
            following, sample = make_period(stages, RigidBodySteps(stages, substeps))(
                carry, (row,), uniforms
            )
            return following, sample.agent.state

        carry = first_loop_state(scenario)
        row = InputRow(time=0.0, reference=inputs.reference_example)
        loop = trace_loop(
            step, structure_of(carry), base, row, draws_needed(scenario), loops=loops
        )
        rows = np.column_stack(
            [
                inputs.times,
                np.array(inputs.held_leaves, dtype=float).reshape(scenario.steps, -1),
            ]
        )
        return cls(
            loop,
            np.array(leaves(carry), dtype=float),
            np.array(base),
            rows,
            scenario.duration,
        )

    def lanes(self, count: int) -> tuple[Array, Array]:
        """Carry and parameters of that many lanes: masses and gains within 2 % of the
        scenario's.
        """
        factors = np.random.default_rng(0).uniform(
            0.98, 1.02, (len(self.parameters), count)
        )
        return (
            np.repeat(self.carry[:, None], count, axis=1),
            self.parameters[:, None] * factors,
        )

    def runner(self, kernel: Any, count: int, threads: int) -> Callable[[], float]:
        """Fly ``count`` lanes on an engine; returns simulated seconds."""
        carry, parameters = self.lanes(count)

        def run() -> float:
            kernel.run(carry, parameters, self.rows, threads=threads)
            return self.duration * count

        return run


def steps_of(scenario: Scenario) -> Callable[[float], Steps]:
    """One RK4 step a control period, or 1 kHz Euler."""
    euler = scenario.integrator == "euler"
    return lambda seconds: Steps(round(1000.0 * seconds) if euler else 1)


def flights(scenario: Scenario) -> dict[str, Flight]:
    """The scenario with both integrators, and with noise."""
    made = {
        name: dataclasses.replace(scenario, integrator=name)
        for name in ("rk4", "euler")
    }
    made["noise"] = dataclasses.replace(scenario, integrator="rk4", noise=NOISE)
    return {name: Flight.of(one, steps_of(one)) for name, one in made.items()}


def native(flown: dict[str, Flight], threads: int, blocks: int) -> list[Contender]:
    """Machine code in every mode."""
    found = []
    modes = (
        ("f64 exact", Lanes(host_width()), "equal to Python floats bit for bit"),
        ("f64", Lanes(host_width(), contract=True), "a * b + c rounded once"),
        (
            "f32",
            Lanes(host_width(single=True), single=True, contract=True),
            "single precision",
        ),
    )
    words = {
        "euler": "Euler 1 ms",
        "rk4": "RK4 5 ms",
        "noise": "RK4 5 ms, noise on every sensor",
    }
    for name, flight in flown.items():
        for mode, lanes, what in modes:
            if name == "noise" and mode == "f64 exact":
                continue
            run = flight.runner(
                Kernel(flight.loop, lanes), blocks * lanes.width, threads
            )
            label = f"{name} {mode}" + (
                f", {threads} threads" if threads > 1 else ", 1 thread"
            )
            found.append(Contender(label, f"closed loop, {words[name]}, {what}", run))
    return found


def straight_line(flight: Flight) -> Contender:
    """The same program as straight-line Python, a second of flight."""
    step, width = flight.loop.stepper(), flight.loop.carry
    count = min(200, len(flight.rows))
    rows = flight.rows[:count].tolist()

    def run() -> float:
        carry: tuple[float, ...] = tuple(flight.carry.tolist())
        for row in rows:
            carry = step((*carry, *flight.parameters.tolist(), *row))[:width]
        return flight.duration * count / len(flight.rows)

    return Contender(
        "python rk4", "closed loop, RK4 5 ms, straight-line Python, one core", run
    )


REFERENCE_STEP = 0.125e-3
"""s, of RK4: what the engines' flights are compared with."""


def accuracy(scenario: Scenario, duration: float) -> dict[str, float]:
    """Largest distance of the base from the reference flight, m, by engine."""
    short = dataclasses.replace(scenario, duration=duration)
    finest = _positions(
        Flight.of(short, lambda seconds: Steps(round(seconds / REFERENCE_STEP))),
        Lanes(1),
    )
    found = {}
    for integrator in ("rk4", "euler"):
        one = dataclasses.replace(short, integrator=integrator)
        flight = Flight.of(one, steps_of(one))
        for mode, lanes in (
            ("f64 exact", Lanes(1)),
            ("f64", Lanes(1, contract=True)),
            ("f32", Lanes(1, single=True, contract=True)),
        ):
            found[f"{integrator} {mode}"] = _farthest(_positions(flight, lanes), finest)
        log = run(dataclasses.replace(one, kind="mujoco"))
        found[f"mujoco {integrator}, 1 ms, loads held a step"] = _farthest(
            log.position, finest
        )
    return found


def _positions(flight: Flight, lanes: Lanes) -> Array:
    kernel = Kernel(flight.loop, lanes, logging=True)
    _, log = kernel.run(flight.carry[:, None], flight.parameters[:, None], flight.rows)
    return log[:, :3, 0].astype(float)


def _farthest(a: Array, b: Array) -> float:
    return float(np.max(np.linalg.norm(a - b, axis=1)))


MUJOCO_STEP = 1e-3
"""s, semi-implicit Euler."""


def model_of(vehicle: Vehicle, integrator: str = "euler") -> Any:
    """Description of the vehicle for MuJoCo, with nothing that pushes but gravity."""
    from skyarm.plant.mujoco_model import build_spec

    return build_spec(vehicle, 9.81, timestep=MUJOCO_STEP, integrator=integrator)


def mujoco_rollout(
    vehicle: Vehicle, threads: int, steps: int = 500, integrator: str = "euler"
) -> Contender:
    """MuJoCo's own batch engine on all cores."""
    name = "mujoco.rollout" if integrator == "euler" else f"mujoco.rollout {integrator}"
    words = f"plant only, {integrator} 1 ms"
    return rollout_of(
        model_of(vehicle, integrator).compile(), None, threads, steps, words, name
    )


def mujoco_step(vehicle: Vehicle, steps: int = 2000) -> Contender:
    """One thread inside MuJoCo's C loop."""
    return stepped_model(
        model_of(vehicle).compile(), None, steps, "plant only, Euler 1 ms"
    )


def rollout_of(
    model: Any, positions: Any, threads: int, steps: int, words: str, name: str
) -> Contender:
    """A model of MuJoCo on all threads, again and again from the same start.

    Args:
        model: of MuJoCo.
        positions: to start from, (nq,); the model's own if None.
        threads: of the batch.
        steps: of an episode.
        words: for the table.
        name: for the table.
    """
    import mujoco
    from mujoco.rollout import Rollout

    data = [mujoco.MjData(model) for _ in range(threads)]
    start, batch = _start(model, data[0], positions), 8 * threads
    engine, states = Rollout(nthread=threads), np.zeros((batch, steps, start.size))

    def run() -> float:
        engine.rollout(
            model, data, np.tile(start, (batch, 1)), nstep=steps, state=states
        )
        return float(batch * steps * model.opt.timestep)

    return Contender(name, f"{words}, {threads} threads", run)


def stepped_model(model: Any, positions: Any, steps: int, words: str) -> Contender:
    """A model of MuJoCo on one core, as :func:`rollout_of`."""
    import mujoco

    data = mujoco.MjData(model)
    start = _start(model, data, positions)

    def run() -> float:
        mujoco.mj_setState(model, data, start, mujoco.mjtState.mjSTATE_FULLPHYSICS)
        mujoco.mj_step(model, data, nstep=steps)
        return float(steps * model.opt.timestep)

    return Contender("mj_step", f"{words}, one core, loop in C", run)


def _start(model: Any, data: Any, positions: Any) -> Any:
    import mujoco

    if positions is not None:
        data.qpos[: len(positions)] = positions
    start = np.zeros(mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS))
    mujoco.mj_getState(model, data, start, mujoco.mjtState.mjSTATE_FULLPHYSICS)
    return start
