"""Our engines as contenders: the whole closed loop, with a mass and a gain of its own in every lane."""

from __future__ import annotations

import dataclasses
import importlib.util
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.bench.timing import Contender
from skyarm.compile import leaves
from skyarm.compile.llvm.kernel import Kernel, host_width
from skyarm.compile.llvm.llvm_text import Lanes
from skyarm.compile.tracing.stepped_loop import Loop, trace_loop
from skyarm.scenario.numbers import number_at, with_numbers
from skyarm.scenario.scenario_file import scenario_from
from skyarm.scenario.scenario_record import Scenario
from skyarm.sensors.measurement import SensorNoise
from skyarm.simulate.draws import draws_needed
from skyarm.simulate.first_state import first_loop_state
from skyarm.simulate.inputs import episode_inputs
from skyarm.simulate.loop import run
from skyarm.simulate.loop_state import Row, structure_of
from skyarm.simulate.period import make_period
from skyarm.simulate.plant_steps import RigidBodySteps
from skyarm.simulate.stages import Stages

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
        substeps: Callable[[float], int],
        *,
        loops: bool = True,
        paths: Sequence[str] = VARIED,
    ) -> Flight:
        """Trace a scenario with numbers per lane at ``paths``, its intervals cut into ``substeps(seconds)`` steps."""
        inputs = episode_inputs(scenario)
        base = tuple(number_at(scenario, path) for path in paths)

        def step(carry: Any, values: Any, row: Any, uniforms: Any) -> Any:
            varied = with_numbers(scenario, dict(zip(paths, values, strict=True)))
            stages = Stages(varied)
            following, sample = make_period(stages, RigidBodySteps(stages, substeps))(carry, row, uniforms)
            return following, sample.state

        carry = first_loop_state(scenario)
        row = Row(time=0.0, reference=inputs.reference_example)
        loop = trace_loop(step, structure_of(carry), base, row, draws_needed(scenario), loops=loops)
        rows = np.column_stack([inputs.times, np.array(inputs.held, dtype=float).reshape(scenario.steps, -1)])
        return cls(loop, np.array(leaves(carry), dtype=float), np.array(base), rows, scenario.duration)

    def lanes(self, count: int) -> tuple[Array, Array]:
        """Carry and parameters of that many lanes: masses and gains within 2 % of the scenario's."""
        factors = np.random.default_rng(0).uniform(0.98, 1.02, (len(self.parameters), count))
        return np.repeat(self.carry[:, None], count, axis=1), self.parameters[:, None] * factors

    def runner(self, kernel: Any, count: int, threads: int) -> Callable[[], float]:
        """Fly ``count`` lanes on an engine; returns simulated seconds."""
        carry, parameters = self.lanes(count)

        def run() -> float:
            kernel.run(carry, parameters, self.rows, threads=threads)
            return self.duration * count

        return run


def six_joints(duration: float) -> Scenario:
    """A hexarotor that holds its six-joint arm still under computed torque."""
    return scenario_from(
        {
            "schema": 1,
            "name": "six_joints",
            "duration": duration,
            "plant": {"vehicle": "hexarotor_arm6"},
            "controller": {"law": "hybrid_computed_torque"},
            "reference": {
                "base": {"kind": "hover", "position": [0.0, 0.0, 2.0]},
                "joints": [0.0, 0.5, -0.5, 0.0, 0.3, 0.0],
            },
        },
        "six_joints",
    )


BARE_RATE = 500
"""Hz, of physics and control of the bare quadrotor: crazyflow's own."""


def bare_quadrotor(duration: float, threads: int, blocks: int) -> Contender:
    """The Hummingbird without an arm in hover under its geometric controller, at the rates that crazyflow steps with.

    The whole controller runs at every step; crazyflow's runs its position loop at every fifth.
    """
    scenario = scenario_from(
        {
            "schema": 1,
            "name": "bare_quadrotor",
            "duration": duration,
            "rates": {"physics": BARE_RATE, "control": BARE_RATE, "reference": 100},
            "plant": {"vehicle": "hummingbird", "integrator": "euler"},
            "controller": {"law": "rotors_sim_position"},
            "reference": {"base": {"kind": "hover", "position": [0.0, 0.0, 1.0]}},
        },
        "bare_quadrotor",
    )
    flight = Flight.of(scenario, lambda seconds: round(BARE_RATE * seconds))
    lanes = Lanes(host_width(single=True), single=True, contract=True)
    run = flight.runner(Kernel(flight.loop, lanes), blocks * lanes.width, threads)
    what = f"closed loop of a quadrotor without an arm, Euler and control at {BARE_RATE} Hz, f32"
    return Contender("bare f32", what, run)


def steps_of(scenario: Scenario) -> Callable[[float], int]:
    """One RK4 step a control period, or 1 kHz Euler."""
    return (lambda _seconds: 1) if scenario.integrator != "euler" else lambda seconds: round(1000.0 * seconds)


def flights(scenario: Scenario) -> dict[str, Flight]:
    """The scenario with both integrators, and with noise."""
    made = {name: dataclasses.replace(scenario, integrator=name) for name in ("rk4", "euler")}
    made["noise"] = dataclasses.replace(scenario, integrator="rk4", sensors=NOISE)
    return {name: Flight.of(one, steps_of(one)) for name, one in made.items()}


def native(flown: dict[str, Flight], threads: int, blocks: int) -> list[Contender]:
    """Machine code in every mode."""
    found = []
    modes = (
        ("f64 exact", Lanes(host_width()), "equal to Python floats bit for bit"),
        ("f64", Lanes(host_width(), contract=True), "a * b + c rounded once"),
        ("f32", Lanes(host_width(single=True), single=True, contract=True), "single precision"),
    )
    words = {"euler": "Euler 1 ms", "rk4": "RK4 5 ms", "noise": "RK4 5 ms, noise on every sensor"}
    for name, flight in flown.items():
        for mode, lanes, what in modes:
            if name == "noise" and mode == "f64 exact":
                continue
            run = flight.runner(Kernel(flight.loop, lanes), blocks * lanes.width, threads)
            label = f"{name} {mode}" + (f", {threads} threads" if threads > 1 else ", 1 thread")
            found.append(Contender(label, f"closed loop, {words[name]}, {what}", run))
    return found


def python(flight: Flight) -> Contender:
    """The same program as straight-line Python, a second of flight."""
    step, width = flight.loop.stepper(), flight.loop.carry
    count = min(200, len(flight.rows))
    rows = flight.rows[:count].tolist()

    def run() -> float:
        carry: tuple[float, ...] = tuple(flight.carry.tolist())
        for row in rows:
            carry = step((*carry, *flight.parameters.tolist(), *row))[:width]
        return flight.duration * count / len(flight.rows)

    return Contender("python rk4", "closed loop, RK4 5 ms, straight-line Python, one core", run)


def jax(scenario: Scenario, threads: int) -> list[Contender]:
    """JAX on the processor, if it is installed."""
    if importlib.util.find_spec("jax") is None:
        return []
    from skyarm.compile.jax.jax_engine import JaxKernel

    flight = Flight.of(scenario, steps_of(scenario), loops=False)
    found: list[Contender] = []
    for name in ("f64", "f32"):
        with _precision(name):
            kernel = JaxKernel(flight.loop, single=name == "f32")
        run = flight.runner(kernel, 64 * threads * (2 if name == "f32" else 1), threads)
        what = f"closed loop, RK4 5 ms, JAX on the processor, {name}"
        found.append(Contender(f"jax rk4 {name}", what, partial(_run_in, name, run)))
    return found


@contextmanager
def _precision(name: str) -> Iterator[None]:
    """JAX in double precision for a while: others in the same process rely on its single."""
    from jax import config

    settings: Any = config
    before = settings.read("jax_enable_x64")
    settings.update("jax_enable_x64", name == "f64")
    try:
        yield
    finally:
        settings.update("jax_enable_x64", before)


def _run_in(name: str, run: Callable[[], float]) -> float:
    with _precision(name):
        return run()


REFERENCE_STEP = 0.125e-3
"""s, of RK4: what the engines' flights are compared with."""


def accuracy(scenario: Scenario, duration: float) -> dict[str, float]:
    """Largest distance of the base from the reference flight, m, by engine."""
    short = dataclasses.replace(scenario, duration=duration)
    finest = _positions(Flight.of(short, lambda seconds: round(seconds / REFERENCE_STEP)), Lanes(1))
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
        log = run(dataclasses.replace(one, plant="mujoco"))
        found[f"mujoco {integrator}, 1 ms, loads held a step"] = _farthest(log.position, finest)
    return found


def _positions(flight: Flight, lanes: Lanes) -> Array:
    kernel = Kernel(flight.loop, lanes, logging=True)
    _, log = kernel.run(flight.carry[:, None], flight.parameters[:, None], flight.rows)
    return log[:, :3, 0].astype(float)


def _farthest(a: Array, b: Array) -> float:
    return float(np.max(np.linalg.norm(a - b, axis=1)))
