"""Perturbed plants for robustness tests, the same for every controller, with a spread
scaled to the vehicle.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Annotated

import numpy as np

from skyarm import dynamics
from skyarm.algebra.scalars.philox import uniforms
from skyarm.dynamics.actuators.hover import hover_trim
from skyarm.records.arrays import Array, Columns
from skyarm.records.immutable import immutable
from skyarm.records.units import Unit
from skyarm.scenario.numbers import number_at
from skyarm.scenario.scenario_record import Scenario
from skyarm.vehicle import Vehicle

(
    CHANNEL_MASS,
    CHANNEL_COM,
    CHANNEL_INERTIA,
    CHANNEL_ROTORS,
    CHANNEL_WORLD,
    CHANNEL_WIND,
) = range(16, 22)
"""Channels of the random generator for perturbed plants, separate from those of a
flight's noise."""


@immutable
class Spread:
    """Bounds of the model mismatch from which perturbed plants are drawn uniformly.

    Each number is drawn on its own, evenly within its range; the thrust, the damping
    and the delay are one number of a plant, masses and inertias one of a body.
    """

    mass: Annotated[
        float, Unit("", "relative change of each body's mass, up or down")
    ] = 0.2
    com: Annotated[
        float, Unit("m", "shift of each body's centre of mass along each axis")
    ] = 0.01
    inertia: Annotated[
        float, Unit("", "relative change of each body's inertia, up or down")
    ] = 0.3
    thrust: Annotated[
        tuple[float, float],
        Unit("", "least and largest relative change of all rotors' thrust"),
    ] = (-0.10, 0.05)
    damping: Annotated[
        float, Unit("N m s/rad", "largest damping of the joints, from 0 on")
    ] = 0.02
    payload: Annotated[
        float, Unit("kg", "largest point mass at the tip, from 0 on")
    ] = 0.1
    wind: Annotated[
        float,
        Unit(
            "N",
            "largest constant force of a wind from any direction, which replaces the"
            " mean force of the scenario's wind; its gusts stay",
        ),
    ] = 3.0
    delay: Annotated[
        float, Unit("s", "largest delay of the commands, unknown to the laws")
    ] = 0.010


def draw(scenario: Scenario, spread: Spread, count: int, *, seed: int) -> Columns:
    """Draw perturbed plants: parameter path -> values (plants,), the same for all
    compared controllers.

    Args:
        scenario: scenario whose plant is the middle of the spread.
        spread: bounds.
        count: plants, numbered from 0; the first ones do not depend on it.
        seed: key.
    """
    truth = scenario.agent.vehicle
    bodies = ["base", *(f"links.{i}.body" for i in range(truth.n))]

    def draw_signed(channel: int, numbers: int) -> Array:
        # by index: the first plants are the same for any count
        return 2.0 * uniforms(seed, np.arange(count), channel, 0, numbers) - 1.0

    mass = draw_signed(CHANNEL_MASS, len(bodies))
    com = draw_signed(CHANNEL_COM, 3 * len(bodies))
    inertia = draw_signed(CHANNEL_INERTIA, len(bodies))
    # a column each for damping, payload, delay and wind
    world = draw_signed(CHANNEL_WORLD, 4)
    values: Columns = {}

    def scale(path: str, factor: Array) -> None:
        values[path] = number_at(scenario, path) * factor

    for i, body in enumerate(bodies):
        at = f"plant.vehicle.{body}"
        scale(f"{at}.mass", 1.0 + spread.mass * mass[:, i])
        for k, axis in enumerate("xyz"):
            values[f"{at}.com.{axis}"] = (
                number_at(scenario, f"{at}.com.{axis}") + spread.com * com[:, 3 * i + k]
            )
        # one factor for all six, so that the inertia stays one that a body can have
        for moment in ("xx", "yy", "zz", "xy", "xz", "yz"):
            scale(f"{at}.inertia.{moment}", 1.0 + spread.inertia * inertia[:, i])
    low, high = spread.thrust
    # from the least to the largest change, the same for all rotors
    thrust = (
        1.0 + low + 0.5 * (high - low) * (1.0 + draw_signed(CHANNEL_ROTORS, 1)[:, 0])
    )
    for i in range(len(truth.rotors)):
        scale(f"plant.vehicle.rotors.{i}.thrust_coefficient", thrust)
    for i in range(truth.n):
        # u is within -1 and 1: from none up to the bound
        values[f"plant.vehicle.links.{i}.joint.damping"] = (
            0.5 * spread.damping * (1.0 + world[:, 0])
        )
    values["plant.payload.mass"] = 0.5 * spread.payload * (1.0 + world[:, 1])
    # without one the scenario has no memory of late commands
    if spread.delay:
        values["delays.command"] = 0.5 * spread.delay * (1.0 + world[:, 2])
    force = 0.5 * spread.wind * (1.0 + world[:, 3])
    height, turn = draw_signed(CHANNEL_WIND, 2).T
    for axis, part in zip("xyz", on_sphere(height, math.pi * turn), strict=True):
        values[f"environment.wind.force_W.{axis}"] = force * part
    return values


FRICTION_PATHS = (".damping", ".coulomb")
"""Ends of the paths of numbers that make joints and grasps stiffer."""

OBJECT = re.compile(r"world\.objects\.\w+\.mass")
"""Paths of masses that touch."""


def hardest(scenario: Scenario, columns: Mapping[str, Array]) -> dict[str, float]:
    """Numbers that need the shortest integration steps of all flights, by parameter
    path.

    Stiffness k and friction mu of a surface need steps by k and by k mu. With the
    largest k, the mu that makes the largest k mu of any flight needs the shortest step
    of all, and none that is shorter.

    Args:
        scenario: what the flights have in common.
        columns: parameter path -> values (flights,).
    """
    extremes = dict[str, float]()
    for path, column in columns.items():
        if path.endswith(FRICTION_PATHS) or (
            path.startswith("world.grippers.") and path.endswith(".stiffness")
        ):
            extremes[path] = float(column.max())
        elif path.endswith(".material.stiffness"):
            most = extremes[path] = float(column.max())
            rough = path.removesuffix("stiffness") + "friction"
            if rough in columns:
                extremes[rough] = float((column * columns[rough]).max()) / most
        # lighter ones need shorter steps; the nominal one's are taken in any case
        elif OBJECT.fullmatch(path) and column.min() < number_at(scenario, path):
            extremes[path] = float(column.min())
    return extremes


def on_sphere(height: Array, azimuth: Array) -> tuple[Array, Array, Array]:
    """Coordinates of points on the unit sphere, uniformly distributed if height and
    azimuth (rad) are.

    Source: Archimedes: height and azimuth of a uniform point are uniform and
    independent.
    """
    across = np.sqrt(1.0 - height * height)
    return across * np.cos(azimuth), across * np.sin(azimuth), height


MASS, ARM = 0.806, 0.3
"""Mass (kg) and arm length (m) of the vehicle for which the comparison's spread was
chosen; Barakou et al. 2026, Table 1."""

FRICTION = 40.0
"""Largest joint damping over the joint's inertia at rest (1/s), equal to the
comparison's spread for the paper's forearm."""

RESERVE = 0.9
"""Largest hover load, payload and wind together, as a fraction of the weakest rotors'
thrust."""


def spread_of(vehicle: Vehicle, gravity: float, delay: float) -> tuple[Spread, float]:
    """Scale the standard model mismatch to a vehicle; also returns the fraction of
    payload and wind that it can lift.

    Masses, inertias, thrust and delay keep their shares; the centre of mass goes with
    the arm's length, payload and wind with the weight, joint damping with the arm's
    inertia. Payload and wind shrink together where the thrust in a hover would not
    reach for both. ``delay`` (s) is the largest one of the commands, as it is given.
    """
    usual = Spread()
    mass = float(vehicle.mass) / MASS
    length = arm_length(vehicle) / ARM
    weakest = 1.0 + usual.thrust[0]
    load, wind = usual.payload * mass, usual.wind * mass
    needed = (load * gravity + wind) / (float(vehicle.mass) * gravity)
    # what the weakest rotors give beyond a hover, over what load and wind ask for
    eased = min(
        1.0,
        max(0.0, (RESERVE * weakest * thrust_margin(vehicle, gravity) - 1.0) / needed),
    )
    spread = Spread(
        com=usual.com * length,
        payload=load * eased if vehicle.end_effector else 0.0,
        wind=wind * eased,
        damping=usual.damping * mass * length * length if vehicle.n else 0.0,
        delay=delay,
    )
    return spread, eased


def arm_length(vehicle: Vehicle) -> float:
    """Length from base to tip of the stretched arm, m; without an arm, the largest
    rotor distance from the base.
    """
    links = [float(joint.position.norm()) for joint in vehicle.joints]
    tip = next(
        (frame for frame in vehicle.frames if frame.name == vehicle.end_effector), None
    )
    if tip is not None and links:
        return sum(links) + float(tip.position.norm())
    return max((float(rotor.position.norm()) for rotor in vehicle.rotors), default=ARM)


def thrust_margin(vehicle: Vehicle, gravity: float) -> float:
    """Smallest ratio of maximum to hover thrust over all rotors."""
    trim = hover_trim(vehicle, vehicle.zeros, gravity)
    shares = [
        # a rotor that idles in hover is no bound
        (float(r.max_speed) / max(float(w), 1e-9)) ** 2
        for w, r in zip(trim.speeds, vehicle.rotors, strict=True)
    ]
    return min(shares, default=math.inf)


def fitted_damping(scenario: Scenario, spread: Spread, values: Columns) -> Columns:
    """Rescale the drawn joint dampings to lie between zero and a limit from joint
    inertia or nominal damping.

    Args:
        scenario: scenario whose plant is the middle of the spread.
        spread: spread that they were drawn from.
        values: path -> (plants,), of
            :func:`skyarm.studies.compare.perturbed_plants.draw`.
    """
    truth = scenario.agent.vehicle
    M = dynamics.mass_matrix_at_rest(truth)
    rescaled = dict(values)
    for i in range(truth.n):
        path = f"plant.vehicle.links.{i}.joint.damping"
        most = max(
            min(spread.damping, FRICTION * float(M[6 + i][6 + i])),
            # between 0 and twice it the nominal damping is the middle
            2.0 * number_at(scenario, path),
        )
        rescaled[path] = values[path] * (most / spread.damping)
    return rescaled
