"""Design of an excitation flight as a scenario, checked in the closed loop and compared
with an undesigned flight.

The scenario's sensors have the noise of the comparison suite and the default inertial
unit; expected intervals are those of
:func:`skyarm.identify.information.expected_numbers`, from simulated flights of the
nominal vehicle.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np

from skyarm.dynamics.workspace import reach
from skyarm.flight_data.flight_data import FlightData
from skyarm.flight_data.own_log import measured_flight
from skyarm.identify.design import SHRUNK, DesignLimits, design_segments, measured_noise
from skyarm.identify.information import ExpectedNumber, expected_numbers
from skyarm.identify.logged_commands import highest_speeds
from skyarm.identify.multisines import (
    BASE_AXES,
    Axes,
    Segment,
    axes_of,
    reference_table,
)
from skyarm.identify.required_flight import arm_clearance
from skyarm.identify.window_fit import one_thread
from skyarm.log.flight_log import Log
from skyarm.records.arrays import Array, Mask
from skyarm.records.files import PathLike
from skyarm.records.files.toml import Entry
from skyarm.records.immutable import immutable
from skyarm.scenario.save import scenario_text
from skyarm.scenario.scenario_file import scenario_from
from skyarm.simulate import run
from skyarm.studies.trial.trial import DELAY, NOISE
from skyarm.studies.tune.excitation import unseen_motion
from skyarm.vehicle import Vehicle

USUAL = DesignLimits()
Progress = Callable[[int, int, str], None]

LAW = "centroidal_joint"
"""Law of the designed flight: it tracks base and joints, which are excited, and not the
tip."""

FLIGHTS = 8
"""Largest number of closed-loop flights until one stays within the limits; chosen: the
last has a third of the first one's amplitudes."""

SATURATED = 0.002
"""Largest fraction of commands at a rotor's limit: an eighth of a second in a minute;
chosen."""


@immutable
class Sharpened:
    """Parameter of a vehicle with its expected 95 % intervals after a designed and an
    undesigned flight.

    Attributes:
        designed: accuracy by the designed flight.
        undesigned: accuracy by a flight of the same length along an undesigned path.
    """

    designed: ExpectedNumber
    undesigned: ExpectedNumber

    @property
    def ratio(self) -> float:
        """Ratio of the expected half width after the undesigned flight to that after
        the designed one.
        """
        return self.undesigned.half_width / self.designed.half_width


@immutable(eq=False)
class DesignedFlight:
    """Designed excitation flight.

    Attributes:
        document: scenario, as tables of a scenario file.
        numbers: accuracy of each number of the vehicle.
        tilt: rad, largest of the flight in the closed loop.
        box: (3,) m, extent of the base's path. clearance: m, least of the arm; infinite
            without one.
        saturated: share of commands at a rotor's limit.
    """

    document: Mapping[str, Entry]
    numbers: Sequence[Sharpened]
    tilt: float
    box: tuple[float, float, float]
    clearance: float
    saturated: float

    def text(self) -> str:
        """Text of the scenario file."""
        return scenario_text(self.document)


@one_thread()
def design_flight(
    vehicle: Vehicle,
    name: str,
    limits: DesignLimits = USUAL,
    *,
    folder: PathLike = "",
    candidates: int = 200,
    seed: int = 0,
    progress: Progress | None = None,
) -> DesignedFlight:
    """Design the flight within limits that identifies a vehicle's parameters best, and
    simulate it.

    Args:
        vehicle: nominal vehicle.
        name: name in the library or path, as in the scenario file.
        limits: limits of the flight.
        folder: folder where a path in the scenario file starts.
        candidates: segments that are tried.
        seed: seed of the draws and of the noise.
        progress: called with (done, total, words).

    Raises:
        ValueError: one line: no flight stays in the limits, or SciPy is missing.
    """
    # above the ground by half the box, the whole arm and the clearance, in tenths
    height = math.ceil(10.0 * (0.5 * limits.box + reach(vehicle) + limits.clear)) / 10.0
    axes = axes_of(vehicle, limits.box, height)

    def tell(done: int, words: str) -> None:
        if progress is not None:
            # beside the candidates a flight before and one after them
            progress(done, candidates + 2, words)

    def accuracy(log: Log) -> tuple[ExpectedNumber, ...]:
        return expected_numbers([_flight_data(log)], vehicle)

    tell(0, "undesigned flight")
    document = scenario_document(vehicle, name, [], axes, limits.seconds, seed)
    hover = scenario_from(document, folder)
    # the noise of the sensors and the wrench are those of a flight that nobody designed
    plain = run(hover.with_reference(unseen_motion(vehicle)))
    if plain.info["status"] != "completed":
        raise ValueError(
            f"vehicle '{vehicle.name}': the law {LAW} does not fly it"
            f" ({plain.info['status']})"
        )
    measured = measured_noise(_flight_data(plain), vehicle)
    segments = design_segments(
        vehicle,
        measured,
        axes,
        limits,
        candidates=candidates,
        seed=seed,
        progress=lambda done, words: tell(done + 1, words),
    )
    for flight in range(FLIGHTS):
        tell(candidates + 1, f"flight {flight + 1} in the closed loop")
        document = scenario_document(
            vehicle, name, segments, axes, limits.seconds, seed
        )
        log = run(scenario_from(document, folder))
        broken = broken_axes(log, vehicle, axes, limits)
        if not broken.any():
            break
        # only axes that break a limit are reduced: all others keep their information
        segments = [each.scale(np.where(broken, SHRUNK, 1.0)) for each in segments]
    else:
        raise ValueError(
            f"vehicle '{vehicle.name}': no flight stays in the limits; widen them"
        )
    tell(candidates + 2, "flown")
    extent = np.ptp(log.position, axis=0)
    pairs = zip(accuracy(log), accuracy(plain), strict=True)
    return DesignedFlight(
        document=document,
        numbers=[Sharpened(designed=a, undesigned=b) for a, b in pairs],
        tilt=float(_tilt(log).max()),
        box=(float(extent[0]), float(extent[1]), float(extent[2])),
        clearance=float(arm_clearance(vehicle, log.joints)[0].min()),
        saturated=_saturated_share(log, vehicle),
    )


def _flight_data(log: Log) -> FlightData:
    return measured_flight(log, Path("designed.npz"))


def scenario_document(
    vehicle: Vehicle,
    name: str,
    segments: Sequence[Segment],
    axes: Axes,
    seconds: float,
    seed: int,
) -> dict[str, Entry]:
    """Scenario in which a vehicle flies segments of multisines, as tables of a scenario
    file.
    """
    sensors: dict[str, Entry] = {
        k: v for k, v in dataclasses.asdict(NOISE).items() if v
    }
    sensors["imu"] = {"kind": "imu"}
    if vehicle.n:
        sensors["encoders"] = {"kind": "encoders"}
    return {
        "schema": 1,
        "name": f"identify_{vehicle.name}",
        "title": "Excitation flight of `skyarm identify design`",
        "duration": seconds,
        "seed": seed,
        "plant": {"vehicle": name},
        "controller": {"preset": LAW},
        "delays": {"measurement": DELAY},
        "sensors": sensors,
        "reference": reference_table(segments, axes),
    }


def broken_axes(log: Log, vehicle: Vehicle, axes: Axes, limits: DesignLimits) -> Mask:
    """Axes (4 + n,) whose motions break a limit in a flight."""
    broken = np.zeros(len(axes.rest), dtype=bool)
    if log.info["status"] != "completed" or _saturated_share(log, vehicle) > SATURATED:
        # no axis alone is at fault for these: all count
        broken[:] = True
    broken[:3] |= np.abs(log.position - axes.rest[:3]).max(axis=0) > 0.5 * limits.box
    # what tilts the base is its motion along x and y
    broken[:2] |= _tilt(log).max() > limits.tilt
    low, high = np.array([each.ends for each in vehicle.joints]).reshape(-1, 2).T
    broken[BASE_AXES:] |= ((log.joints < low) | (log.joints > high)).any(axis=0)
    broken[BASE_AXES:] |= arm_clearance(vehicle, log.joints)[0].min() < limits.clear
    return broken


def _tilt(log: Log) -> Array:
    """Angle (N,) of the base's upright axis against the vertical, rad."""
    x, y = log.quaternion[:, 1], log.quaternion[:, 2]
    # rounding may leave a cosine beyond 1
    return np.arccos(np.clip(1.0 - 2.0 * (x**2 + y**2), -1.0, 1.0))


def _saturated_share(log: Log, vehicle: Vehicle) -> float:
    """Share of logged rotor commands at a rotor's upper speed limit."""
    return float((log.rotor_commands >= highest_speeds(vehicle.rotors)).mean())
