"""Vehicle whose performance envelope is flown: its hover scenario, and units of speed and distance of the trials.

Amplitudes are stated for the paper's vehicle. Another vehicle is asked for as much as it can be asked for:

* forces, loads and the drag of the hull in proportion to its weight;
* accelerations of the base by its hover thrust margin, (largest thrust / weight - 1) g against that of the paper's
  vehicle, never more than the paper's: amplitudes and steps times that share, speeds on the circle times its root;
* joints swing about the middle of their range or about zero, where zero lies within it, and by at most 0.7 of the way
  to the nearer limit where the paper's arm swings by 1 (rad, or m); a passive joint is left where it hangs.
"""

from __future__ import annotations

import dataclasses
import math
from functools import lru_cache
from typing import Any

from skyarm.dynamics.actuators.hover import highest_thrust
from skyarm.dynamics.workspace import reach
from skyarm.records.files import shown
from skyarm.records.immutable import immutable
from skyarm.reference import Constant, Trajectory
from skyarm.scenario.scenario_file import load_scenario, scenario_from
from skyarm.scenario.scenario_record import Scenario, ScenarioError
from skyarm.vehicle import Joint, Vehicle
from skyarm.vehicle.vehicle_files import load_vehicle

PAPER = "hummingbird_arm2_rotors"
"""Vehicle for which the amplitudes are stated, as RotorS simulates it; the laws' model is the paper's Table 1."""

HEIGHT = 1.5
"""Height (m) of the base; more where an arm reaches further down than 1 m."""

CLEARANCE = 0.5
"""Least distance (m) between the tip of a hanging arm and the ground."""

ROOM = 0.7
"""Largest fraction of the distance to a joint's nearer limit that a swing of 1 (rad or m) uses."""

DURATION = 20.0
"""Duration (s) of a trial."""


@immutable
class Setting:
    """Hover scenario of a vehicle, and the scales of the envelope's trials with the vehicle.

    Attributes:
        vehicle: name or file. hover: scenario that every trial is made from.
        weight: over that of the paper's vehicle. climb: share of the paper's accelerations, at most 1.
        middle: middle of each joint's swing, rad or m.
        swing: amplitude of each joint, rad or m where the paper's arm swings by 1.
        duration: duration of a trial, s.
    """

    vehicle: str
    hover: Scenario
    weight: float
    climb: float
    middle: tuple[float, ...]
    swing: tuple[float, ...]
    duration: float = DURATION

    @property
    def truth(self) -> Vehicle:
        """Simulated vehicle, as opposed to the controller's nominal model."""
        return self.hover.agent.vehicle


@lru_cache(maxsize=8)
def setting_of(vehicle: str = PAPER, duration: float = DURATION, plant: str = "rigid_body") -> Setting:
    """Hover scenario and trial scales of a vehicle given by name or file.

    Raises:
        VehicleError: no such vehicle.
        ScenarioError: a vehicle without an arm, without a tip or that cannot hover.
    """
    truth = load_vehicle(vehicle)
    _require_arm(vehicle, truth)
    middle, swing = zip(*map(_swing_range, truth.joints), strict=True)
    hover = _hover(vehicle, truth, duration, plant)
    reference = Trajectory(z=Constant(_height(truth)), joints=tuple(map(Constant, middle)))
    return Setting(
        vehicle=vehicle,
        hover=hover.with_reference(reference),
        weight=float(truth.mass) / float(load_vehicle(PAPER).mass),
        climb=min(1.0, _spare_thrust(truth) / _spare_thrust(load_vehicle(PAPER))),
        middle=middle,
        swing=swing,
        duration=duration,
    )


def _require_arm(name: str, truth: Vehicle) -> None:
    if not truth.n or not truth.end_effector:
        raise ScenarioError(f"--vehicle = {shown(name)}: must have an arm with an end_effector{truth.tip_cure}")
    if not _spare_thrust(truth) > 0.0:
        raise ScenarioError(f"--vehicle = {shown(name)}: must be able to hover; 'skyarm check' says why it is not")


def _hover(vehicle: str, truth: Vehicle, duration: float, plant: str) -> Scenario:
    """Hover scenario of a vehicle; that of Barakou et al. 2026 has the controller model of the publication."""
    if vehicle == PAPER:
        scenario = load_scenario("case3", plant=plant, duration=duration)
        return dataclasses.replace(scenario, name="hover", title="hover")
    document: dict[str, Any] = {
        "name": "hover",
        "duration": duration,
        "plant": {"vehicle": vehicle, "kind": plant},
        "controller": {"law": "centroidal"},
        "reference": {"base": {"kind": "hover", "position": [0.0, 0.0, HEIGHT]}, "joints": [0.0] * truth.n},
    }
    return scenario_from(document)


def _height(truth: Vehicle) -> float:
    return max(HEIGHT, math.ceil(10.0 * (float(reach(truth)) + CLEARANCE)) / 10.0)


def _spare_thrust(vehicle: Vehicle) -> float:
    """Thrust-to-weight ratio minus one; a ratio of 3 is assumed for rotors without a speed limit."""
    most = float(highest_thrust(vehicle)) / (9.81 * float(vehicle.mass))
    return (most if math.isfinite(most) else 3.0) - 1.0


def _swing_range(joint: Joint) -> tuple[float, float]:
    """Mid position of a joint's swing, and its amplitude: 1 rad (or m), less near limits, 0 for a passive joint."""
    low, high = joint.ends
    middle = 0.0 if low < 0.0 < high or not math.isfinite(low + high) else 0.5 * (low + high)
    room = min(middle - low, high - middle)
    still = joint.effort_limit == 0
    return middle, 0.0 if still else min(1.0, ROOM * room)
