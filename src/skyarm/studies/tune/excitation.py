"""Flight on which gains are tuned: reference motions, wind gust, and perturbed plants.

Gains belong to the loop (vehicle, delay, noise, model mismatch), not to a path: every
vehicle flies the same motions, scaled to its arm, base, heading and arm at once through
a wind with a gust, then a step. The scenario keeps its plant, model, clocks, delays,
sensors, drives, estimator and air; its motion, payloads, faults, surfaces to touch and
what is scheduled stay away. With perfect sensors nothing would keep gains from growing
without end, so that a scenario without noise gets that of
:data:`skyarm.studies.compare.suite.NOISE`.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from skyarm.algebra import Vec3
from skyarm.algebra.scalars.philox import uniforms
from skyarm.control.model import Model
from skyarm.log.metrics.windows import Window, Windows
from skyarm.plant.interface import Truth
from skyarm.records.arrays import Array, Columns, IntArray, Mask
from skyarm.records.immutable import immutable
from skyarm.records.members import SOLE
from skyarm.reference import (
    Constant,
    Product,
    Ramp,
    Signal,
    Sine,
    Sum,
    Trajectory,
    Windowed,
)
from skyarm.scenario.controller_table import loop_facts, make_named_or_tuned
from skyarm.scenario.scenario_record import (
    PERFECT_SENSORS,
    Agent,
    Delays,
    FieldsByWord,
    Rates,
    Scenario,
    with_words,
)
from skyarm.sensing.estimate.estimator import PASS_THROUGH
from skyarm.studies.compare.perturbed_plants import (
    Spread,
    draw,
    fitted_damping,
    spread_of,
)
from skyarm.studies.trial.trial import DELAY, NOISE
from skyarm.vehicle import Joint, Vehicle
from skyarm.world import ForceWind
from skyarm.world.gust import Gust

KINDS = ("circle", "swings", "lemniscate")
"""Kinds of motion; plant k flies kind k modulo their number."""

CHANNEL = 30
"""Channel of the random generator, separate from those of plants and noise."""

EASE = Ramp(start=0.0, duration=3.0, height=1.0, shape="quintic")
"""Envelope of every sine, which grows from rest to its amplitude."""

STEPPED = 8.0
"""Time (s) of the step of the base."""

STEP = 0.3
"""Position step (m) of the base that ends the excitation flight, as in Case 3 of
Barakou et al. (2026)."""

HEIGHT = 10.0
"""Height (m) of the flight, far from the ground."""

TOGETHER = 2
"""Number of joints that swing by a full amplitude; of more, each swings by its
fraction."""

SPEED = (0.2, 0.8)
"""Lowest and highest speed (m/s) of the circles."""


def motion(vehicle: Vehicle) -> Trajectory:
    """Reference of a tuning flight: base on a lemniscate, arm swinging; amplitudes and
    frequencies are inputs.
    """
    # sizes and frequencies are chosen; y at twice the frequency of x makes the
    # lemniscate, and joints of different ones tell their errors apart
    return Trajectory(
        x=Sum((sine_from_rest(0.45, 0.2), Windowed(Constant(STEP), start=STEPPED))),
        y=sine_from_rest(0.15, 0.4),
        z=Sum((Constant(HEIGHT), sine_from_rest(0.15, 0.3))),
        yaw=sine_from_rest(0.2, 0.15),
        joints=tuple(
            _joint(joint, vehicle.n, 0.5 + 0.07 * i)
            for i, joint in enumerate(vehicle.joints)
        ),
    )


def unseen_motion(vehicle: Vehicle) -> Trajectory:
    """Reference trajectory that validates tuned gains and is not used to tune them.

    A spiral with two sines an axis, heading turned on, joints on two sines each; no
    step.
    """

    def two(
        amplitude: float, first: float, second: float, phase: float = 0.0
    ) -> Signal:
        return Sum(
            (
                sine_from_rest(amplitude, first, phase),
                sine_from_rest(0.5 * amplitude, second, phase + 1.0),
            )
        )

    # frequencies and phases are chosen so that no two joints swing alike
    joints = []
    for i, joint in enumerate(vehicle.joints):
        rest, size = rest_and_size(joint, vehicle.n)
        joints.append(
            Sum(
                (
                    Constant(rest),
                    two(0.8 * size, 0.33 + 0.05 * i, 0.71 - 0.04 * i, 0.8 * i),
                )
            )
        )
    return Trajectory(
        # primes of 0.01 Hz, so that no two sines of the base repeat together within 100
        # s
        x=two(0.3, 0.11, 0.29),
        y=two(0.4, 0.13, 0.23, 2.0),
        z=Sum((Constant(HEIGHT), two(0.1, 0.19, 0.37))),
        yaw=Product(Sine(amplitude=0.5, frequency_hz=0.1), EASE),
        joints=tuple(joints),
    )


def draw_motions(
    vehicle: Vehicle, count: int, *, seed: int
) -> tuple[Columns, IntArray]:
    """Draw reference motions for ``count`` plants: parameter path -> values, and the
    kind of each motion (count,).

    Args:
        vehicle: vehicle whose joints swing.
        count: plants; the first ones do not depend on it.
        seed: key.
    """
    # by turns; all kinds read the same columns of draws, as a plant flies one of them
    kinds = np.arange(count) % len(KINDS)
    share = uniforms(seed, np.arange(count), CHANNEL, 0, 8 + 3 * vehicle.n)

    def of_kind(*choices: Array | float) -> Array:
        return np.choose(kinds, [np.broadcast_to(each, count) for each in choices])

    def uniform(column: int, low: float, high: float) -> Array:
        return low + (high - low) * share[:, column]

    # the ranges of all draws are chosen
    rate, turn = uniform(0, 0.1, 0.25), uniform(1, 0.1, 0.22)
    # the radius at which a circle is flown at the drawn speed
    radius = uniform(2, *SPEED) / (2.0 * math.pi * rate)
    slow, wide = uniform(3, 0.0, 0.1), uniform(4, 0.2, 0.5)
    values = {
        **_sine(
            "reference.x.signals.0",
            of_kind(radius, slow, wide),
            of_kind(rate, turn, turn),
        ),
        **_sine(
            "reference.y",
            of_kind(radius, slow, 0.35 * wide),
            of_kind(rate, turn, 2.0 * turn),
            of_kind(0.5 * math.pi, 1.0, 0.0),
        ),
        **_sine(
            "reference.z.signals.1",
            uniform(5, 0.0, 0.15) * of_kind(0.5, 0.2, 1.0),
            uniform(6, 0.15, 0.35),
        ),
        **_sine("reference.yaw", uniform(7, 0.0, 0.4) * of_kind(1.0, 0.0, 1.0), turn),
    }
    for i, joint in enumerate(vehicle.joints):
        at = 8 + 3 * i
        _, size = rest_and_size(joint, vehicle.n)
        values |= _sine(
            f"reference.joints.{i}.signals.1",
            size
            * of_kind(
                uniform(at, 0.4, 1.0), uniform(at, 0.8, 1.6), uniform(at, 0.4, 1.0)
            ),
            of_kind(
                uniform(at + 1, 0.3, 0.6),
                uniform(at + 1, 0.5, 1.1),
                uniform(at + 1, 0.3, 0.7),
            ),
            uniform(at + 2, -math.pi, math.pi),
        )
    return values, kinds


def sine_from_rest(amplitude: float, frequency: float, phase: float = 0.0) -> Signal:
    """Sine signal that fades in from rest."""
    return Product(Sine(amplitude=amplitude, frequency_hz=frequency, phase=phase), EASE)


def _sine(
    path: str, amplitude: Array, frequency: Array, phase: Array | None = None
) -> Columns:
    """Amplitude, frequency and phase values of a sine reference signal, by parameter
    path.
    """
    at = f"{path}.signal"
    return {
        f"{at}.amplitude": amplitude,
        f"{at}.frequency_hz": frequency,
        f"{at}.phase": np.zeros(len(amplitude)) if phase is None else phase,
    }


def _joint(joint: Joint, joints: int, frequency: float) -> Signal:
    rest, size = rest_and_size(joint, joints)
    return Sum((Constant(rest), sine_from_rest(size, frequency)))


def rest_and_size(joint: Joint, joints: int) -> tuple[float, float]:
    """Middle and amplitude of a joint's swing within its limits.

    Args:
        joint: joint with its limits.
        joints: number of joints of the arm; more than two share the amplitude of two,
            to limit the load on the base.

    A tenth of what the joint may do, about its rest or the nearest place that leaves as
    much room again; a joint that may do little, as a short slide, swings about its
    middle.
    """
    low, high = joint.ends
    # 0.25 rad or m, chosen, where the limits are wide or missing
    size = min(0.25, 0.1 * (high - low))
    return min(max(0.0, low + 4.0 * size), high - 4.0 * size), size * min(
        1.0, TOGETHER / joints
    )


DURATION, SETTLED, BLOWN = 10.0, 2.0, 5.0
"""Times (s): duration of the flight, start of the scored interval, start of the gust.
Errors after the step do not count.

Before the first the vehicle leaves a hover into the wind. The step is there to be
survived: what error it leaves is the step's own, not that of gains.
"""

UNSEEN = Window(7.0, 12.0)
"""Scored interval (s) of the errors along the path for the final check, which ends with
it."""

UNKNOWN_DELAY = 0.010
"""Longest unmodelled delay (s) of the commands, as in the comparison's perturbed
plants."""

GUST, GUST_SHARE = Vec3(0.75, 0.5, 0.43), 0.15
"""Direction of the gust's force, and its size over the weight."""


def of_vehicle(vehicle: Vehicle, law: str | None = None) -> Scenario:
    """Tuning scenario of a vehicle, with a controller whose nominal model is exact.

    Args:
        vehicle: plant and belief.
        law: any name of the catalogue; left out, the centroidal law, on the tip if
            there is one.
    """
    named = law or ("centroidal_tip" if vehicle.end_effector else "centroidal_joint")
    rates = Rates()
    delays = Delays(measurement=DELAY)
    controller = make_named_or_tuned(
        named, Model(vehicle=vehicle), loop_facts(rates, delays)
    )
    agent = Agent(
        plant=Truth(vehicle=vehicle),
        controller=controller,
        reference=motion(vehicle),
        noise=NOISE,
        delays=delays,
    )
    return Scenario(
        name=vehicle.name, rates=rates, duration=DURATION, agents={SOLE: agent}
    )


def with_noise(agent: Agent) -> Agent:
    """Vehicle with the comparison's noise if its sensors are perfect."""
    noisy = (
        agent.noise != PERFECT_SENSORS
        or agent.all_sensors[1:]
        or agent.estimator != PASS_THROUGH
    )
    return agent if noisy else replace(agent, noise=NOISE)


def tuning_flight(
    scenario: Scenario, *, own_motion: bool = False, unseen: bool = False
) -> Scenario:
    """Tuning flight of a scenario, on which its gains are scored.

    Args:
        scenario: source of plant, nominal model, rates, sensors and air.
        own_motion: fly the scenario's own reference, for its own duration and windows.
        unseen: use the validation path; errors count after the gust.
    """
    longest = float(scenario.agent.delays.command) + UNKNOWN_DELAY
    delays = replace(scenario.agent.delays, longest_command=longest)
    vehicle = scenario.agent.vehicle
    weight = float(vehicle.mass) * float(scenario.agent.plant.gravity)
    gust = Gust(peak=GUST * (GUST_SHARE * weight), start=BLOWN, duration=1.0)
    motions: FieldsByWord = (
        {}
        if own_motion
        else {
            "duration": UNSEEN.stop if unseen else DURATION,
            "windows": Windows(
                steady=UNSEEN if unseen else Window(SETTLED, BLOWN),
                gust=Window(BLOWN, STEPPED),
            ),
            "reference": (unseen_motion if unseen else motion)(vehicle),
            "path_time": None,
        }
    )
    return with_words(
        with_words(scenario.as_begun.with_kind("rigid_body"), **motions),
        noise=with_noise(scenario.agent).noise,
        delays=delays,
        # what differs from plant to plant is drawn, payloads too; in a world most
        # motions would end at a wall
        faults=(),
        payloads=(),
        initial=None,
        tracking_start=0,
        ground=False,
        world=None,
        forces=(*scenario.forces, ForceWind(gusts=(gust,))),
    )


@immutable
class Plants:
    """Perturbed plants for gain tuning, which differ from the controller's nominal
    model.

    Attributes:
        spread: model mismatch. eased: share of the comparison's payload and wind for
            which the spare thrust suffices.
        values: path of the scenario -> (plants,).
        kinds: (plants,) kind of motion that each flies; zeros where all fly the same.
    """

    spread: Spread
    eased: float
    values: Columns
    kinds: IntArray

    @property
    def count(self) -> int:
        """Number of perturbed plants."""
        return len(next(iter(self.values.values())))

    def select(self, which: IntArray) -> Plants:
        """Subset of the perturbed plants by index."""
        values = {path: numbers[which] for path, numbers in self.values.items()}
        return replace(self, values=values, kinds=self.kinds[which])


def draw_plants(
    scenario: Scenario, count: int, *, seed: int, mixed: bool = False
) -> Plants:
    """Draw perturbed plants for a tuning flight.

    Args:
        scenario: scenario whose plant is the middle of the spread; its last force is
            the wind that is drawn.
        count: plants; the first ones do not depend on it.
        seed: key.
        mixed: a motion for each plant; the scenario flies that of
            :func:`skyarm.studies.tune.excitation.motion`.
    """
    truth = scenario.agent.vehicle
    own = float(scenario.agent.delays.command)
    longest = scenario.agent.delays.longest_command
    spread, eased = spread_of(
        truth,
        float(scenario.agent.plant.gravity),
        0.0 if longest is None else longest - own,
    )
    values = draw(scenario, spread, count, seed=seed)
    # without a tip nothing can hold a payload
    if not truth.end_effector:
        del values["plant.payload.mass"]
    # drawn from none on: the scenario's own delay comes on top
    if "delays.command" in values:
        values["delays.command"] = own + values["delays.command"]
    values = fitted_damping(scenario, spread, values)
    blown = len(scenario.forces) - 1
    for axis in "xyz":
        values[f"environment.forces.{blown}.force_W.{axis}"] = values.pop(
            f"environment.wind.force_W.{axis}"
        )
    assert isinstance(scenario.forces[blown], ForceWind)
    kinds: IntArray = np.zeros(count, dtype=int)
    if mixed:
        moved, kinds = draw_motions(truth, count, seed=seed)
        values |= moved
    return Plants(spread=spread, eased=eased, values=values, kinds=kinds)


def with_lost(pool: Plants, count: int, lost: Mask) -> Plants:
    """First plants of a pool, up to half of them replaced by plants on which gain
    candidates crashed.

    Those come first that some candidates lost and some flew: they tell one from
    another. Then those that all lost.

    Args:
        pool: plants, more than ``count``.
        count: number of plants to return.
        lost: (candidates, plants of the pool).
    """
    # the last key counts first: what all lost tells no candidate from another
    times = lost[:, count:].sum(axis=0)
    order = np.lexsort((np.arange(len(times)), -times, times == len(lost)))
    taken = count + order[times[order] > 0][: count // 2]
    return pool.select(np.concatenate([np.arange(count - len(taken)), np.sort(taken)]))
