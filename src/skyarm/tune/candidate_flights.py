"""Flights of many candidates of a law's gains through many wrong plants at once, one lane each."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from skyarm.compare.vehicle_spread import arm_length
from skyarm.log.batch_log import BatchLog
from skyarm.scenario.numbers import with_numbers
from skyarm.scenario.scenario_record import Scenario
from skyarm.simulate.batch import Batch
from skyarm.tune.law_knobs import Knob
from skyarm.tune.plant_spread import Plants

Array = npt.NDArray[np.float64]

LARGEST_TILT = math.radians(80.0)
"""A flight that tilts by more counts as lost, though it may come back."""

LOST = 100.0
"""m: error that a lost flight is charged."""

SAMPLED = 5
"""Control periods between two samples of the commands, where saturation is counted."""

NEAR_LIMIT = 0.999
"""Share of its largest speed from which on a rotor counts as saturated."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Flown:
    """What flights left, (candidates, plants) each.

    Attributes:
        error: m, what the law is asked to keep: of the tip; a law that does not keep the tip on its own is charged
            the mean of the tip's error and of base error plus arm length times joint error; without a tip the latter.
            Of two windows, before and in the gust, the geometric mean: each counts by its ratio of improvement.
        tip, base: m, mean distances in the first window from the continuous reference; the tip's is that of the base
            where there is none.
        joints: rad or m, mean norm of the joint errors.
        jitter: rad/s, RMS change of a rotor command per period. effort: N m or N, RMS of all joint efforts.
        lost: ended early, or tilted by more than 80 degrees.
        saturated: share of rotor commands at their largest speed; NaN where it was not counted.
        kinds: (plants,) kind of motion of each.
    """

    error: Array
    tip: Array
    base: Array
    joints: Array
    jitter: Array
    effort: Array
    lost: npt.NDArray[np.bool_]
    saturated: Array
    kinds: npt.NDArray[np.int_]


class CandidateFlights:
    """Flies candidates; the machine code is made once.

    Args:
        scenario: as :func:`skyarm.tune.excitation.excited` made it. knobs: of its law. plants: to fly.
        threads: results do not depend on it.
        seed: of the noise; each plant has its own, which all candidates share.
        gust: the flight has a window of a gust.
        saturation: count it, which keeps a log of the commands.
    """

    def __init__(
        self,
        scenario: Scenario,
        knobs: Sequence[Knob],
        plants: Plants,
        *,
        threads: int = 1,
        seed: int = 0,
        gust: bool = False,
        saturation: bool = False,
    ) -> None:
        self.knobs, self.plants, self.seed, self.threads = tuple(knobs), plants, seed, threads
        vehicle = scenario.world.vehicle
        self._arm, self._has_tip = arm_length(vehicle), bool(vehicle.end_effector)
        self._keeps_tip = scenario.controller.keeps_tip
        # a servo is told setpoints: its torque is its own
        self._efforts = tuple(f"tau{i + 1}_rms" for i, told in enumerate(scenario.told) if not told)
        self._windows = ("", "gust_") if gust else ("",)
        self._errors = ("position", "joint", "ee") if self._has_tip else ("position", "joint")
        metrics = [_error(window, each) for window in self._windows for each in self._errors]
        paths = [*_paths(self.knobs), *plants.values]
        self._most = np.array([float(rotor.max_speed) for rotor in scenario.controller.par.model.vehicle.rotors])
        damping = {path: float(column.max()) for path, column in plants.values.items() if path.endswith(".damping")}
        self._batch = Batch(
            scenario,
            paths,
            stiffest=with_numbers(scenario, damping),
            metrics=(*metrics, "rotor_jitter", "tilt_max", *self._efforts),
            single=True,
            log_every=SAMPLED if saturation else 0,
        )

    def fly(self, logs: Array, plants: int | None = None, others: Plants | None = None) -> Flown:
        """Fly every candidate through the first so many plants.

        Args:
            logs: (candidates, knobs) logarithms of factors.
            plants: how many; all if left out.
            others: in place of its own plants, with the same numbers.
        """
        flown = self.plants if others is None else others
        count, each = len(logs), flown.count if plants is None else plants
        values: dict[str, Array] = {}
        for knob, column in zip(self.knobs, np.exp(logs).T, strict=True):
            factors = np.repeat(column, each)
            values |= {f"controller.{'.'.join(place)}": factors * number for place, number in knob.numbers}
        values |= {path: np.tile(numbers[:each], count) for path, numbers in flown.values.items()}
        episodes = np.tile(np.arange(each), count)
        found = self._batch.fly(values, seed=self.seed, episodes=episodes, threads=self.threads)

        def table(name: str) -> Array:
            # a flight that ended before the window has NaN there
            return np.asarray(found.metrics[name], dtype=float).reshape(count, each)

        lost = ~found.completed.reshape(count, each) | ~(table("tilt_max") < LARGEST_TILT)
        parts = [{name: table(_error(window, name)) for name in self._errors} for window in self._windows]
        product = np.ones((count, each))
        for part in parts:
            product = product * self._asked(part)
        error = product ** (1.0 / len(parts))
        base, joints = parts[0]["position"], parts[0]["joint"]
        tip = parts[0].get("ee", base)
        squares = [table(name) ** 2 for name in self._efforts]
        return Flown(
            error=_charged(error, lost),
            tip=_charged(tip, lost),
            base=_charged(base, lost),
            joints=_charged(joints, lost),
            jitter=np.nan_to_num(table("rotor_jitter"), nan=LOST, posinf=LOST),
            effort=np.nan_to_num(np.sqrt(sum(squares)), nan=LOST) if squares else np.zeros((count, each)),
            lost=lost,
            saturated=self._saturated(found.log, count, each),
            kinds=flown.kinds[:each],
        )

    def _asked(self, errors: Mapping[str, Array]) -> Array:
        """What the law is asked to keep, of one window."""
        posture = errors["position"] + self._arm * errors["joint"]
        if self._keeps_tip:
            return errors["ee"]
        return 0.5 * (errors["ee"] + posture) if self._has_tip else posture

    def _saturated(self, log: BatchLog | None, count: int, each: int) -> Array:
        if log is None:
            return np.full((count, each), np.nan)
        speeds = np.stack([np.asarray(w, dtype=float) for w in log.command.rotor_speeds])
        full = speeds >= NEAR_LIMIT * self._most[:, None, None]
        return np.asarray(full.mean(axis=(0, 2))).reshape(count, each)

    def close(self) -> None:
        """End the threads."""
        self._batch.close()


def _paths(knobs: Sequence[Knob]) -> list[str]:
    return [f"controller.{'.'.join(place)}" for knob in knobs for place, _ in knob.numbers]


def _error(window: str, name: str) -> str:
    """Name of a metric: mean error against the continuous reference."""
    return f"{window}{name}_error_mean_continuous"


def _charged(error: Array, lost: npt.NDArray[np.bool_]) -> Array:
    return np.where(lost, LOST, np.minimum(np.nan_to_num(error, nan=LOST), LOST))
