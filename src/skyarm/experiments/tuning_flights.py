"""Flights by which gains are tuned and laws compared: the paper's cases, many candidates at once, in machine code.

Errors are taken against the continuous reference. Perfect: no noise, no delay. Noisy: 1 mm, 1 cm/s, 2 mrad, 0.01 rad/s,
joints 1 mrad and 0.01 rad/s, and one control period of delay. Late: noisy and two more periods that no law knows of.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.algebra import Vec3
from skyarm.compile import leaves, rebuild
from skyarm.compile.llvm_text import Lanes
from skyarm.compile.loop import trace_loop
from skyarm.compile.native import Kernel, host_width
from skyarm.control.controller import Controller
from skyarm.control.tuned import rescaled
from skyarm.dynamics import frame_pose
from skyarm.environment import RotorsForce
from skyarm.environment.gust import Gust
from skyarm.plant.compiled import RigidBodyPlant
from skyarm.plant.sensors import SensorNoise
from skyarm.scalars import Scalar, absolute, logical_and, maximum, where
from skyarm.simulate.carry import Carry, Row, Sample, blend, structure_of
from skyarm.simulate.closed_loop import make_period
from skyarm.simulate.draws import draws_needed
from skyarm.simulate.inputs import episode_inputs
from skyarm.simulate.kinematics import level_tool
from skyarm.simulate.native import first_carry
from skyarm.simulate.scenario import Delays, Scenario
from skyarm.simulate.scenario_file import load_scenario
from skyarm.simulate.totals import distance, joint_norm

Array = npt.NDArray[np.float64]

NOISE = SensorNoise(position=1e-3, velocity=1e-2, attitude=2e-3, rate=1e-2, joints=1e-3, joint_rates=1e-2)

DURATION = 20.0
GUST = (7.5, 3.0)
"""Start and length of the gust, s."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Flight:
    """One of the paper's flights.

    Attributes:
        case: scenario that gives reference and vehicles. force, air, gust: along x, N, m/s, N.
        start: of the window of means, s.
    """

    case: str
    force: float = 0.0
    air: float = 0.0
    gust: float = 0.0
    start: float = 10.0


FLIGHTS: Mapping[str, Flight] = {
    "case1": Flight(case="case1"),
    "case2": Flight(case="case2"),
    "case3": Flight(case="case3"),
    "wind": Flight(case="case3", force=2.0, air=2.0),
    "gust": Flight(case="case2", gust=2.0, start=5.0),
}

SENSING: Mapping[str, tuple[float, int]] = {"perfect": (0.0, 0), "noisy": (1.0, 1), "late": (1.0, 3)}
"""Factor on the noise, and periods of delay."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Goal:
    """What an instant is measured against: the continuous reference, and 1 inside the window."""

    position: Vec3
    joints: tuple[Scalar, ...]
    tool: Vec3
    counted: Scalar


@dataclass(frozen=True, kw_only=True, slots=True)
class Tally:
    """Sums over the window, and the last commands.

    Attributes:
        count: instants. base, joint, tool: error norms. base_x: largest |x error|.
        jitter: changes of rotor commands.
        speeds: commands of the instant before.
    """

    count: Scalar
    base: Scalar
    joint: Scalar
    tool: Scalar
    base_x: Scalar
    jitter: Scalar
    speeds: tuple[Scalar, ...]


@dataclass(frozen=True, slots=True)
class Score:
    """Of each candidate: mean errors (m, rad, m), largest base error along x (m), jitter (rad/s), completion."""

    base: Array
    joint: Array
    tool: Array
    peak: Array
    jitter: Array
    completed: npt.NDArray[np.bool_]


class Course:
    """A law compiled for the flights: gains, wind and noise differ from lane to lane.

    Args:
        controller: the law with the gains that factors multiply.
        paths: constants that get a factor per lane.
        delay: of the measurement, control periods.
    """

    def __init__(self, controller: Controller, paths: Sequence[str] = (), *, delay: int = 0) -> None:
        base = load_scenario("case3", duration=DURATION)
        wind = RotorsForce(
            force_W=Vec3(0.0, 0, 0),
            air_velocity_W=Vec3(0.0, 0, 0),
            gust=Gust(peak=Vec3(0.0, 0, 0), start=GUST[0], duration=GUST[1]),
        )
        self.scenario = dataclasses.replace(
            base,
            controller=controller,
            wind=wind,
            sensors=NOISE,
            delays=Delays(measurement=delay / base.rates.control),
        )
        self.paths = tuple(paths)
        vehicle = self.scenario.world.vehicle
        inputs = episode_inputs(self.scenario)
        plant = RigidBodyPlant(self.scenario.world, inputs.wind_example, base.integrator, 1.0 / base.rates.physics)
        row = Row(time=0.0, reference=structure_of(inputs.reference.dense()))
        goal = Goal(position=Vec3(0.0, 0.0, 0.0), joints=(0.0,) * vehicle.n, tool=Vec3(0.0, 0.0, 0.0), counted=0.0)
        tally = Tally(
            count=0.0, base=0.0, joint=0.0, tool=0.0, base_x=0.0, jitter=0.0, speeds=(-1.0,) * len(vehicle.rotors)
        )
        self._first = (first_carry(self.scenario), tally)
        values = (0.0,) * (4 + len(self.paths))
        draws = draws_needed(self.scenario)

        def step(both: Any, lane: tuple[Any, ...], fed: tuple[Row, Goal], uniforms: Any) -> tuple[Any, tuple[()]]:
            carry, sums = both
            following, sample = make_period(self._varied(lane), plant.substeps)(carry, fed[0], uniforms)
            alive = sample.alive > 0.5
            return (following, blend(alive, self._tallied(sums, sample, fed[1]), sums)), ()

        loop = trace_loop(step, structure_of(self._first), values, (row, goal), draws, loops=True)
        self.kernel = Kernel(loop, Lanes(host_width()))
        self._tables: dict[str, Array] = {}

    def _varied(self, lane: tuple[Any, ...]) -> Scenario:
        """The scenario of a lane: wind along x, air, gust, noise, factors."""
        force, air, gust, noise, *factors = lane
        held = self.scenario.wind
        assert isinstance(held, RotorsForce)
        assert held.gust is not None
        wind = dataclasses.replace(
            held,
            force_W=Vec3(force, 0, 0),
            air_velocity_W=Vec3(air, 0, 0),
            gust=dataclasses.replace(held.gust, peak=Vec3(gust, 0, 0)),
        )
        sigmas = [leaf * noise for leaf in leaves(NOISE)]
        controller = rescaled(self.scenario.controller, dict(zip(self.paths, factors, strict=True)))
        sensors = rebuild(NOISE, iter(sigmas))
        return dataclasses.replace(self.scenario, wind=wind, sensors=sensors, controller=controller)

    def _tallied(self, sums: Tally, sample: Sample, goal: Goal) -> Tally:
        vehicle, state = self.scenario.world.vehicle, sample.state
        tool = state.position
        if vehicle.end_effector:
            reach = frame_pose(vehicle, vehicle.frame(), state.joints).p
            tool = tool + state.quaternion.rotation().apply(reach)
        inside = goal.counted
        speeds = sample.command.rotor_speeds
        first = sums.speeds[0] < 0.0
        change: Any = 0.0
        for new, old in zip(speeds, sums.speeds, strict=True):
            change = change + absolute(new - where(first, new, old)) * (1.0 / len(speeds))
        off = absolute(state.position.x - goal.position.x)
        return Tally(
            count=sums.count + inside,
            base=sums.base + inside * distance(state.position, goal.position),
            joint=sums.joint + inside * joint_norm(state.joints, goal.joints),
            tool=sums.tool + inside * distance(tool, goal.tool),
            base_x=where(logical_and(inside > 0.5, off > sums.base_x), off, sums.base_x),
            jitter=sums.jitter + inside * change,
            speeds=tuple(maximum(s, 0.0) for s in speeds),
        )

    def _table(self, flight: Flight) -> Array:
        """Rows of a flight: time, held reference, its tool (unused), continuous goals, window."""
        key = f"{flight.case} {flight.start}"
        if key not in self._tables:
            scenario = load_scenario(flight.case, duration=DURATION)
            inputs = episode_inputs(scenario)
            steps = scenario.steps

            def column(values: Any) -> Array:
                return np.broadcast_to(np.asarray(values, dtype=float), (steps,))

            now = inputs.reference.dense()
            p = np.stack([column(c) for c in now.position], axis=1)
            q = np.stack([column(c) for c in now.joints], axis=1)
            tool = level_tool(scenario.world.vehicle, p, column(now.yaw), q)
            inside = (inputs.times >= flight.start) & (inputs.times < DURATION)
            held = np.stack([column(leaf) for leaf in leaves(inputs.held_reference.dense())], axis=1)
            columns = [inputs.times, held, p, q, tool, inside.astype(float)]
            self._tables[key] = np.column_stack(columns)
        return self._tables[key]

    def fly(
        self,
        flight: Flight,
        factors: Mapping[str, Array],
        *,
        noise: float,
        seed: int = 0,
        lanes: int = 1,
        threads: int = 1,
    ) -> Score:
        """Fly one candidate per lane; every lane draws the same noise.

        Args:
            flight: which.
            factors: path -> (lanes,).
            noise: factor on the deviations.
            seed: of the noise.
            lanes: number of candidates where there are no paths.
            threads: results do not depend on it.
        """
        columns = [np.asarray(factors[path], dtype=float) for path in self.paths]
        count = columns[0].size if columns else lanes
        wind = [np.full(count, value) for value in (flight.force, flight.air, flight.gust, noise)]
        carry = np.repeat(np.array(leaves(self._first))[:, None], count, axis=1)
        table = self._table(flight)
        ended, _ = self.kernel.run(
            carry, np.stack([*wind, *columns]), table, seed=seed, episodes=np.zeros(count, dtype=int), threads=threads
        )
        found: tuple[Carry, Tally] = rebuild(self._first, iter(list(ended)))
        state, sums = found
        with np.errstate(all="ignore"):
            n = np.asarray(sums.count)
            means = [np.asarray(total) / n for total in (sums.base, sums.joint, sums.tool, sums.jitter)]
        base, joint, tool, jitter = means
        completed = np.asarray(state.ticks) >= len(table)
        return Score(base, joint, tool, np.asarray(sums.base_x), jitter, completed)
