"""Region of attraction of a controller: one flight each from attitudes over the sphere, rates and offsets."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.scenario.scenario_record import PERFECT_SENSORS, Scenario, ScenarioError, first_state
from skyarm.simulate.batch import Batch
from skyarm.studies.stability.along import hovering

Array = npt.NDArray[Any]

CAUGHT_POSITION, CAUGHT_TILT, CAUGHT_RATE, CAUGHT_SPEED, CAUGHT_JOINT_RATE = 5.0, math.radians(20.0), 1.0, 0.5, 1.0
"""m, rad, rad/s, m/s, rad/s or m/s of every joint: a flight that ends within all of them of its reference, level and at
rest, was caught. The distance is wide: a safety layer hovers where it took over. Only the last instant is looked at."""

RETURNED = 0.5
"""m: a caught flight that ends this near is back on its reference."""

DURATION = 12.0
"""s, enough for a fall of a second and its recovery; whole, so that it holds whole periods of any rate."""

CAUGHT = (
    f"{DURATION:g} s after its start within {CAUGHT_POSITION:g} m of the reference, tilted less than "
    f"{math.degrees(CAUGHT_TILT):g} deg, slower than {CAUGHT_SPEED:g} m/s and {CAUGHT_RATE:g} rad/s, every joint "
    f"slower than {CAUGHT_JOINT_RATE:g} rad/s (m/s)"
)
"""In words."""

MOST = {"rate": 1000.0, "offset": 1000.0, "speed": 1000.0}
"""rad/s, m, m/s: largest limits of the draws."""

MOST_FLIGHTS = 10_000_000

TILTS, RATES = 18, 12
"""Bins of the map: ten degrees each, and twelfths of the largest rate."""

PATHS = (
    *(f"initial.quaternion.{c}" for c in "wxyz"),
    *(f"initial.rate.{c}" for c in "xyz"),
    *(f"initial.position.{c}" for c in "xyz"),
    *(f"initial.velocity.{c}" for c in "xyz"),
)


@dataclass(frozen=True, kw_only=True)
class Basin:
    """A map of initial states.

    Attributes:
        controller, scenario: names. seed: of the draws.
        tilt: rad, angle between body z and up; rate: rad/s; offset: m; speed: m/s: of each flight's start (flights,).
        caught, returned: (flights,). status: how each ended (flights,).
        rate_limit, offset_limit, speed_limit: largest of each.
    """

    controller: str
    scenario: str
    seed: int
    tilt: Array
    rate: Array
    offset: Array
    speed: Array
    caught: Array
    returned: Array
    status: Array
    rate_limit: float
    offset_limit: float
    speed_limit: float

    @property
    def tilt_edges(self) -> Array:
        """rad, of the map's bins."""
        return self.edges(TILTS, RATES)[1]

    @property
    def rate_edges(self) -> Array:
        """rad/s."""
        return self.edges(TILTS, RATES)[0]

    def edges(self, tilts: int, rates: int) -> tuple[Array, Array]:
        """Edges of so many bins: rad/s of rate, rad of tilt."""
        # where every flight begins without a rate the bins need a width all the same
        return np.linspace(0.0, self.rate_limit or 1.0, rates + 1), np.linspace(0.0, math.pi, tilts + 1)

    def counts(self, tilts: int = TILTS, rates: int = RATES) -> tuple[Array, Array]:
        """(caught, flown) per bin, (rates, tilts)."""
        edges = self.edges(tilts, rates)
        flown, _, _ = np.histogram2d(self.rate, self.tilt, bins=edges)
        caught, _, _ = np.histogram2d(self.rate[self.caught], self.tilt[self.caught], bins=edges)
        return caught.astype(int), flown.astype(int)

    def plain(self) -> dict[str, Any]:
        """The map and its totals as plain data."""
        caught, flown = self.counts()
        names, numbers = np.unique(self.status, return_counts=True)
        upside_down = self.tilt > 0.5 * math.pi
        return {
            "schema": 1,
            "controller": self.controller,
            "scenario": self.scenario,
            "seed": self.seed,
            "flights": len(self.tilt),
            "caught": int(self.caught.sum()),
            "returned": int(self.returned.sum()),
            "upside_down": {"flights": int(upside_down.sum()), "caught": int(self.caught[upside_down].sum())},
            "status": dict(zip(names.tolist(), numbers.tolist(), strict=True)),
            "limits": {"rate": self.rate_limit, "offset": self.offset_limit, "speed": self.speed_limit},
            "success": {
                "position": CAUGHT_POSITION,
                "returned": RETURNED,
                "tilt": CAUGHT_TILT,
                "rate": CAUGHT_RATE,
                "speed": CAUGHT_SPEED,
                "joint_rate": CAUGHT_JOINT_RATE,
                "duration": DURATION,
            },
            "tilt_edges": self.tilt_edges.tolist(),
            "rate_edges": self.rate_edges.tolist(),
            "caught_by_rate_and_tilt": caught.tolist(),
            "flown_by_rate_and_tilt": flown.tolist(),
        }


def initial_states(
    scenario: Scenario, count: int, seed: int, *, rate: float, offset: float, speed: float
) -> dict[str, Array]:
    """Numbers of each flight's start, by path.

    The tilt is uniform from 0 to 180 degrees, about a level axis of any direction, after a turn of any yaw, so that
    every row of the map is flown equally often; rate, offset and speed have any direction and a uniform length.
    """
    rng = np.random.default_rng(seed)
    tilt, axis, yaw = rng.uniform(0.0, [math.pi, 2.0 * math.pi, 2.0 * math.pi], (count, 3)).T
    half = 0.5 * tilt
    lean = np.array([np.cos(half), np.sin(half) * np.cos(axis), np.sin(half) * np.sin(axis), np.zeros(count)])
    c, s = np.cos(0.5 * yaw), np.sin(0.5 * yaw)
    w, x, y, z = lean
    # lean q_yaw: the yaw is about the body's own axis, and leaves the tilt
    quaternion = np.array([w * c - z * s, x * c + y * s, y * c - x * s, w * s + z * c])
    start = np.array([float(value) for value in first_state(scenario).position])
    columns = [
        *quaternion,
        *_ball(rng, count, rate),
        *(start[:, None] + _ball(rng, count, offset)),
        *_ball(rng, count, speed),
    ]
    return dict(zip(PATHS, columns, strict=True))


def _ball(rng: np.random.Generator, count: int, longest: float) -> Array:
    """Vectors (3, count) of any direction and uniform length."""
    direction = rng.normal(size=(3, count))
    return np.asarray(direction / np.linalg.norm(direction, axis=0) * rng.uniform(0.0, longest, count))


def at_rest(rate: Array, speed: Array, joint_rate: Array) -> Array:
    """True where base (rad/s, m/s) and the quickest joint (rad/s or m/s) hardly move; NaN does."""
    quiet = (rate < CAUGHT_RATE) & (speed < CAUGHT_SPEED) & (joint_rate < CAUGHT_JOINT_RATE)
    return np.asarray(quiet)


def basin(
    scenario: Scenario,
    count: int = 100_000,
    *,
    seed: int = 0,
    rate: float = 12.0,
    offset: float = 1.0,
    speed: float = 2.0,
    threads: int = 1,
) -> Basin:
    """Fly a controller from ``count`` initial states to its first reference, held in calm air without a ground.

    Args:
        scenario: its truth, belief, controller, delays and sensors; noise is left out.
        count: flights.
        seed: of the draws.
        rate: rad/s, largest at the start.
        offset: m, largest at the start.
        speed: m/s, largest at the start.
        threads: the result does not depend on it.

    Raises:
        ScenarioError: fewer than one flight or too many, or a limit below zero or beyond ``MOST``.
    """
    if not 1 <= count <= MOST_FLIGHTS:
        raise ScenarioError(f"flights = {count}: must be from 1 to {MOST_FLIGHTS}")
    for name, value in (("rate", rate), ("offset", offset), ("speed", speed)):
        if not 0.0 <= value <= MOST[name]:
            raise ScenarioError(f"{name} = {value!r}: must be from 0 to {MOST[name]:g}")
    flight = hovering(scenario)
    flight = flight.with_words(kind="rigid_body", noise=PERFECT_SENSORS, duration=DURATION)
    flight = flight.with_words(initial=first_state(flight))
    values = initial_states(flight, count, seed, rate=rate, offset=offset, speed=speed)
    outcome = Batch(flight, PATHS).fly(values, threads=threads)
    wanted = np.array([[float(c)] for c in first_state(flight).position])
    state = outcome.state
    with np.errstate(all="ignore"):
        far = np.linalg.norm(np.array(list(state.position)) - wanted, axis=0)
        upright = 1.0 - 2.0 * (np.asarray(state.quaternion.x) ** 2 + np.asarray(state.quaternion.y) ** 2)
        turning = np.linalg.norm(np.array(list(state.rate)), axis=0)
        moving = np.linalg.norm(np.array(list(state.velocity)), axis=0)
        joints = np.array([np.abs(np.asarray(rate) + np.zeros_like(far)) for rate in state.joint_rates])
        swinging = joints.max(axis=0, initial=0.0) if len(joints) else np.zeros_like(far)
        quiet = at_rest(turning, moving, swinging)
        caught = outcome.completed & (far < CAUGHT_POSITION) & (upright > math.cos(CAUGHT_TILT)) & quiet
    start_tilt = np.arccos(np.clip(1.0 - 2.0 * (values[PATHS[1]] ** 2 + values[PATHS[2]] ** 2), -1.0, 1.0))
    lengths = [np.linalg.norm([values[path] for path in PATHS[i : i + 3]], axis=0) for i in (4, 10)]
    moved = np.linalg.norm(np.array([values[path] for path in PATHS[7:10]]) - wanted, axis=0)
    return Basin(
        controller=scenario.controller.name,
        scenario=scenario.name,
        seed=seed,
        tilt=start_tilt,
        rate=lengths[0],
        offset=moved,
        speed=lengths[1],
        caught=caught,
        returned=caught & (far < RETURNED),
        status=outcome.status,
        rate_limit=rate,
        offset_limit=offset,
        speed_limit=speed,
    )
