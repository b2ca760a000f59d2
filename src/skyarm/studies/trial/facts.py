"""Vehicle of trials: its hover scenario, and facts by which speeds, distances and loads
are scaled to it.

Amplitudes are stated for the paper's vehicle. Another vehicle is asked for as much as
it can be asked for:

* forces, loads and the drag of the hull in proportion to its weight;
* accelerations of the base by its hover thrust margin, (largest thrust / weight - 1) g
  against that of the paper's vehicle, never more than the paper's: amplitudes and steps
  times that share, speeds on the circle times its root;
* joints swing about the middle of their range or about zero, where zero lies within it,
  and by at most 0.7 of the way to the nearer limit where the paper's arm swings by 1
  (rad, or m); a passive joint is left where it hangs;
* damping in proportion to what each joint moves: of one, the fastest motion falls to
  1 / e within a control period.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from skyarm.dynamics import mass_matrix_at_rest
from skyarm.dynamics.actuators.hover import highest_thrust
from skyarm.dynamics.workspace import reach
from skyarm.records.arrays import doubles
from skyarm.records.files import PathLike, file_name, shown
from skyarm.records.files.names import read_named
from skyarm.records.immutable import immutable
from skyarm.scenario.scenario_file import LIBRARY, scenario_from
from skyarm.scenario.scenario_record import Scenario, ScenarioError
from skyarm.vehicle import Joint, Vehicle
from skyarm.vehicle.vehicle_files import load_vehicle

Facts = dict[str, float]
"""Numbers by the names that expressions give them."""

PAPER = "hummingbird_arm2_rotors"
"""Vehicle for which the amplitudes are stated, as RotorS simulates it; the laws' model
is the paper's Table 1."""

HEIGHT = 1.5
"""Height (m) of the base; more where an arm reaches further down than 1 m."""

CLEARANCE = 0.5
"""Least distance (m) between the tip of a hanging arm and the ground."""

ROOM = 0.7
"""Largest fraction of the distance to a joint's nearer limit that a swing of 1 (rad or
m) uses, chosen."""

DURATION = 20.0
"""Duration (s) of a trial."""


@immutable
class TrialSetting:
    """Hover scenario of a vehicle, and the scales of trials with the vehicle.

    Attributes:
        vehicle: name or file. hover: scenario that every trial is made from.
        document: its file. folder: folder of its paths. given: words in place of the
            file's, such as the duration.
        truth: simulated vehicle, as opposed to the controller's nominal model.
        weight: over that of the paper's vehicle. climb: share of the paper's
            accelerations, at most 1.
        middle: middle of each joint's swing, rad or m.
        swing: amplitude of each joint, rad or m where the paper's arm swings by 1.
        damping: of each joint, N m s/rad or N s/m, as of :func:`fading`.
        duration: duration of a trial, s.
    """

    vehicle: str
    hover: Scenario
    document: Mapping[str, Any]
    folder: Path
    given: Mapping[str, Any]
    truth: Vehicle
    weight: float
    climb: float
    middle: tuple[float, ...]
    swing: tuple[float, ...]
    damping: tuple[float, ...]
    duration: float = DURATION

    @property
    def facts(self) -> Facts:
        """Numbers of the vehicle that expressions may name."""
        height = float(
            next(iter(self.hover.agents.values())).reference.z.derivatives(0.0)[0]
        )
        own = {"mass": float(self.truth.mass), "rate": self.hover.rates.control}
        return {"weight": self.weight, "climb": self.climb, "height": height} | own

    @property
    def joints(self) -> dict[str, Facts]:
        """Numbers of each joint that expressions may name, by the joint's name."""
        columns = {"middle": self.middle, "swing": self.swing, "damping": self.damping}
        return {
            joint.name: {
                "j": j,
                "even": 1 - j % 2,
                "odd": j % 2,
                **{name: own[j] for name, own in columns.items()},
            }
            for j, joint in enumerate(self.truth.joints)
        }

    @property
    def words(self) -> dict[str, Any]:
        """Words of the vehicle that entries may name in braces."""
        return {
            "tip": self.truth.end_effector,
            "seconds": max(1, math.ceil(self.duration)),
        }


# each trial of a suite asks for it again, and nobody can change it
# 8 is chosen: a miss takes 0.1 s (measured)
@lru_cache(maxsize=8)
def setting_of(
    vehicle: str = PAPER,
    duration: float = DURATION,
    plant: str = "rigid_body",
    law: str | None = None,
    *,
    armed: bool = True,
    at: str = "--vehicle",
) -> TrialSetting:
    """Hover scenario and trial scales of a vehicle given by name or file.

    Args:
        vehicle: name or file.
        duration: s.
        plant: kind of simulated plant.
        law: law in place of a placeholder.
        armed: whether the vehicle must have an arm with a tip.
        at: name of the vehicle's field in messages.

    Raises:
        VehicleError: no such vehicle.
        ScenarioError: a vehicle without an arm, without a tip or that cannot hover.
    """
    truth = load_vehicle(vehicle)
    _require_hover(f"{at} = {shown(vehicle)}", truth, armed)
    middles = [middle for middle, _ in map(_swing_range, truth.joints)]
    reference = {"base": {"kind": "signals", "z": _height(truth)}, "joints": middles}
    given = {"duration": duration, "plant": plant} | (
        {"controller": law} if law else {}
    )
    return _setting(vehicle, _hover(vehicle) | {"reference": reference}, Path(), given)


def setting_of_scenario(
    name: PathLike, folder: Path, given: Mapping[str, Any]
) -> TrialSetting:
    """Scenario of a file and the scales of its vehicle, the first of several.

    Args:
        name: name of a shipped scenario, or path beside ``folder``.
        folder: folder of the file that names it.
        given: words in place of the file's, as of
            :func:`skyarm.scenario.scenario_file.scenario_from`.

    Raises:
        ValueError: one line: no such scenario, or a wrong one.
    """
    text = file_name(name, "scenario")
    document, place = read_named(
        str(folder / text) if text.endswith(".toml") else text, "scenario", LIBRARY
    )
    return _setting(text, document, place, given)


def _setting(
    name: str, document: Mapping[str, Any], folder: Path, given: Mapping[str, Any]
) -> TrialSetting:
    hover = scenario_from(document, folder, given)
    truth = next(iter(hover.vehicles.values()))
    paper = load_vehicle(PAPER)
    ranges = list(map(_swing_range, truth.joints))
    return TrialSetting(
        vehicle=name,
        document=document,
        folder=folder,
        given=given,
        hover=hover,
        truth=truth,
        weight=float(truth.mass) / float(paper.mass),
        climb=min(1.0, _spare_thrust(truth) / _spare_thrust(paper)),
        middle=tuple(middle for middle, _ in ranges),
        swing=tuple(swing for _, swing in ranges),
        # unit of the trials: the fastest motion falls to 1 / e within a control period
        damping=fading(truth, hover.rates.control),
        duration=hover.duration,
    )


def _require_hover(where: str, truth: Vehicle, armed: bool) -> None:
    if armed and not (truth.n and truth.end_effector):
        raise ScenarioError(
            f"{where}: must have an arm with an end_effector{truth.tip_cure}"
        )
    if not _spare_thrust(truth) > 0.0:
        raise ScenarioError(
            f"{where}: must be able to hover; 'skyarm check' says why it is not"
        )


def _hover(vehicle: str) -> dict[str, Any]:
    """Scenario file of a hover without its reference.

    The paper's vehicle hovers as in case 3, whose controller has the published model.
    """
    if vehicle == PAPER:
        return read_named("case3", "scenario", LIBRARY)[0] | {
            "name": "hover",
            "title": "hover",
        }
    return {
        "name": "hover",
        "duration": DURATION,
        "plant": {"vehicle": vehicle},
        # fits every vehicle; the law on trial replaces it
        "controller": {"law": "centroidal"},
    }


def _height(truth: Vehicle) -> float:
    # up to a whole decimetre
    return max(HEIGHT, math.ceil(10.0 * (float(reach(truth)) + CLEARANCE)) / 10.0)


def _spare_thrust(vehicle: Vehicle) -> float:
    """Thrust-to-weight ratio minus one; a ratio of 3 is assumed for rotors without a
    speed limit.
    """
    most = float(highest_thrust(vehicle)) / (9.81 * float(vehicle.mass))
    return (most if math.isfinite(most) else 3.0) - 1.0


def _swing_range(joint: Joint) -> tuple[float, float]:
    """Mid position of a joint's swing, and its amplitude: 1 rad (or m), less near
    limits, 0 for a passive joint.
    """
    low, high = joint.ends
    # a range without one of its ends has no middle
    middle = (
        0.0 if low < 0.0 < high or not math.isfinite(low + high) else 0.5 * (low + high)
    )
    room = min(middle - low, high - middle)
    still = joint.effort_limit == 0
    return middle, 0.0 if still else min(1.0, ROOM * room)


def fading(vehicle: Vehicle, rate: float) -> tuple[float, ...]:
    """Damping (joints,) in proportion to what each joint moves, of which the fastest
    motion fades at a rate (1/s).

    What a joint moves is 1 / (M^-1)_ii, base and other joints free; of one joint the
    damping is rate / (M^-1)_ii.
    """
    if not vehicle.n:
        return ()
    M = doubles(mass_matrix_at_rest(vehicle))
    mobility = np.linalg.inv(M)[6:, 6:]
    inertia = 1.0 / np.diag(mobility)
    fastest = np.abs(np.linalg.eigvals(mobility * inertia)).max()
    return tuple((rate / fastest * inertia).tolist())
