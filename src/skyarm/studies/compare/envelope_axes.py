"""Difficulty axes of the performance envelope: trials with one growing value, by
``library/envelope_axes.toml``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from skyarm.algebra import E_X, Vec3
from skyarm.records.arrays import Columns
from skyarm.records.immutable import immutable
from skyarm.records.leaves import walk
from skyarm.reference import Constant, Product, Signal, Sum, signal_from
from skyarm.reference.splines import uniform_curve
from skyarm.scenario.scenario_record import Scenario, with_words
from skyarm.studies.compare.perturbed_plants import (
    Spread,
    draw,
    fitted_damping,
    spread_of,
)
from skyarm.studies.compare.suite import library_rows
from skyarm.studies.trial.facts import DURATION, PAPER, TrialSetting
from skyarm.studies.trial.trial import MOTIONS, Maker, Trial
from skyarm.vehicle import BodyDrag
from skyarm.world import MovingAir
from skyarm.world.dryden import Dryden

TIP, OVERSHOOT = "ee_error_mean_continuous", "x_error_max_continuous"
"""Metrics that judge an axis: mean distance of the tip from its reference with a level
base, or overshoot of the base in a step along x."""

TIP_MAX, OUTSIDE = "ee_error_max_continuous", "ee_time_outside_continuous"
"""Metrics: largest such distance, and time for which it exceeds 5 cm."""

HULL, SCALE_LENGTH = 0.02, 3.0
"""Drag of the hull (N/(m/s)^2) in turbulence, for the paper's weight; length scale (m)
of the turbulence along all axes."""

POINTS, SPAN = 31, {"x": 0.8, "y": 0.8, "z": 0.3, "joints": 0.6}
"""Seed of the random curve's points, and their largest distance from its middle (m; rad
for joints)."""

PLANTS = 24
"""Perturbed plants of every value, the same ones for every law, further from the model
as the value grows."""


def random_curve(built: Scenario, setting: TrialSetting, step: float) -> Scenario:
    """Envelope trial: base and joints follow B-splines with random control points at a
    given spacing (s).
    """
    draws = np.random.default_rng(POINTS)
    ease = signal_from(MOTIONS["parts"]["ease"], "ease")
    # as many as the densest curve takes, so that all values draw the same ones; a
    # quintic curve ends five points before the last, and three are in reserve
    count = math.ceil(DURATION / min(AXES["random_curve"].values)) + 8

    def curve(span: float) -> Signal:
        points = span * draws.uniform(-1.0, 1.0, count)
        return Product(
            uniform_curve(
                points[: math.ceil(setting.duration / step) + 8].tolist(), 0.0, step
            ),
            ease,
        )

    hover = setting.hover.agent.reference
    base = dict[str, Any]((axis, curve(SPAN[axis] * setting.climb)) for axis in "xyz")
    joints = tuple(
        Sum((Constant(middle), curve(SPAN["joints"] * unit)))
        for middle, unit in zip(setting.middle, setting.swing, strict=True)
    )
    return built.with_reference(
        replace(hover, **base | {"z": Sum((hover.z, base["z"]))}, joints=joints)
    )


def turbulence(built: Scenario, setting: TrialSetting, mean: float) -> Scenario:
    """Envelope trial: hover in turbulent wind along x with given mean (m/s), standard
    deviation half the mean.
    """
    # an area whose drag at 1 m/s is HULL times the weight
    drag = BodyDrag(
        area=Vec3(*(2.0 * HULL * setting.weight / 1.225,) * 3), air_density=1.225
    )
    sigma = Vec3(*(0.5 * mean,) * 3)
    length = Vec3(*(SCALE_LENGTH,) * 3)
    gusts = Dryden(intensity=sigma, scale_length=length, airspeed=mean, direction_W=E_X)
    plant = replace(built.agent.plant, vehicle=replace(setting.truth, drag=drag))
    return with_words(
        built,
        plant=plant,
        wind=MovingAir(velocity_W=Vec3(mean, 0, 0), turbulence=gusts),
    )


MADE: Mapping[str, Maker] = {"random_curve": random_curve, "turbulence": turbulence}
"""Makers of trials that no entries of a file describe."""


@immutable
class EnvelopeAxis(Trial):
    """Difficulty axis of the performance envelope: a trial whose largest change comes
    last.

    Attributes:
        plants: a value is the width of a spread of plants, and many fly each.
        shown: factor from SI to the unit.
        start: s, beginning of the error metrics. metric: metric that decides on the
            axis.
        torques: whether the joints must take torques; a vehicle whose joints are servos
            does not fly it.
        vehicle: vehicle that flies the axis in place of the envelope's; "" for none.
    """

    plants: bool = False
    shown: float = 1.0
    start: float = 4.0
    metric: str = TIP
    torques: bool = False
    vehicle: str = ""

    makers = MADE


def axis_words(name: str) -> str:
    """Printed words for an axis; the names in files and options are older than some
    words.
    """
    return "perturbed plants" if name == "wrong_plants" else name.replace("_", " ")


def plants_at(
    setting: TrialSetting, scenario: Scenario, times: float, count: int, *, seed: int
) -> Columns:
    """Perturbed plants at one axis value: parameter path -> values (plants,).

    Args:
        setting: vehicle.
        scenario: scenario of the axis; its truth is the middle of the spread.
        times: width of the spread over that of the comparison.
        count: plants.
        seed: key.
    """
    # the spread was chosen for the paper's vehicle; others have it scaled
    if setting.vehicle == PAPER:
        return draw(scenario, widen(Spread(), times), count, seed=seed)
    spread, _ = spread_of(
        setting.truth, float(scenario.agent.plant.gravity), Spread().delay
    )
    return fitted_damping(
        scenario, spread, draw(scenario, widen(spread, times), count, seed=seed)
    )


def widen(spread: Spread, times: float) -> Spread:
    """Distribution of perturbed plants with all its widths multiplied by a factor."""
    low, high = spread.thrust
    shares = {
        place[0]: value * times for place, value in walk(spread) if place[0] != "thrust"
    }
    return Spread(**shares, thrust=(low * times, high * times))


AXES: Mapping[str, EnvelopeAxis] = {
    row["name"]: EnvelopeAxis(**row) for row in library_rows("envelope_axes")
}
"""Axes: motions of base and arm; a step, and forces in hover; delays, lags, a load and
noise on a slow circle."""

VEHICLES = tuple(axis.vehicle for axis in AXES.values() if axis.vehicle)
"""Further vehicles, each with an axis of delays: six joints, two arms with slides on
eight rotors, and servos."""
