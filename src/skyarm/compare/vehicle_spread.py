"""The README's spread of the paper's vehicle for any other: scaled by mass, arm and spare thrust."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from skyarm import dynamics
from skyarm.actuation.hover import hover_trim
from skyarm.algebra import Mat3, Vec3
from skyarm.compare.perturbed_plants import Spread
from skyarm.scenario.numbers import number_at
from skyarm.scenario.scenario_record import Scenario
from skyarm.vehicle.vehicle_records import Vehicle

Array = npt.NDArray[np.float64]

MASS, ARM = 0.806, 0.3
"""kg and m: the vehicle for which the README's spread was written; Barakou et al. 2026, Table 1."""

FRICTION = 40.0
"""1/s: most joint damping over the joint's inertia at rest; what the README's spread is for the paper's forearm."""

RESERVE = 0.9
"""Of the weakest rotors' thrust: what load and wind together may ask for in a hover."""


def spread_of(vehicle: Vehicle, gravity: float, delay: float) -> tuple[Spread, float]:
    """The README's spread for a vehicle, and the share of payload and wind that it can bear.

    Masses, inertias, thrust and delay keep their shares; the centre of mass goes with the arm's length, payload and
    wind with the weight, joint damping with the arm's inertia. Payload and wind shrink together where the thrust in a
    hover would not reach for both.
    """
    usual = Spread()
    mass, length = float(vehicle.mass) / MASS, arm_length(vehicle) / ARM
    weakest = 1.0 + usual.thrust[0]
    load, wind = usual.payload * mass, usual.wind * mass
    needed = (load * gravity + wind) / (float(vehicle.mass) * gravity)
    eased = min(1.0, max(0.0, (RESERVE * weakest * thrust_margin(vehicle, gravity) - 1.0) / needed))
    spread = Spread(
        com=usual.com * length,
        payload=load * eased if vehicle.end_effector else 0.0,
        wind=wind * eased,
        damping=usual.damping * mass * length * length if vehicle.n else 0.0,
        delay=delay,
    )
    return spread, eased


def arm_length(vehicle: Vehicle) -> float:
    """m: from base to tip along the stretched arm; without one, the widest distance of a rotor from the base."""
    links = [math.sqrt(float(link.joint.position.dot(link.joint.position))) for link in vehicle.links]
    tip = next((frame for frame in vehicle.frames if frame.name == vehicle.end_effector), None)
    if tip is not None and links:
        return sum(links) + _length(tip.position)
    return max((_length(rotor.position) for rotor in vehicle.rotors), default=ARM)


def _length(v: Vec3) -> float:
    return math.sqrt(float(v.dot(v)))


def thrust_margin(vehicle: Vehicle, gravity: float) -> float:
    """Largest thrust over that of a hover, of the rotor with the least."""
    trim = hover_trim(vehicle, (0.0,) * vehicle.n, gravity)
    shares = [(float(r.max_speed) / max(float(w), 1e-9)) ** 2 for w, r in zip(trim.speeds, vehicle.rotors, strict=True)]
    return min(shares, default=math.inf)


def fitted_damping(scenario: Scenario, spread: Spread, values: dict[str, Array]) -> dict[str, Array]:
    """Drawn values with the damping of every joint from none to what its inertia bears, or to twice its own.

    Args:
        scenario: its truth is the middle of the spread.
        spread: that they were drawn from.
        values: path -> (plants,), of :func:`skyarm.compare.perturbed_plants.draw`.
    """
    truth = scenario.plant.vehicle
    M = dynamics.mass_matrix(truth, Mat3.identity(), (0.0,) * truth.n)
    found = dict(values)
    for i in range(truth.n):
        path = f"plant.vehicle.links.{i}.joint.damping"
        most = max(min(spread.damping, FRICTION * float(M[6 + i][6 + i])), 2.0 * number_at(scenario, path))
        found[path] = values[path] * (most / spread.damping)
    return found
