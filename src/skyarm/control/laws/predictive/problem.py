"""What is to be solved now: goals along the horizon, no further from the vehicle than a plan can bring it."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from skyarm.control.laws.predictive import preview
from skyarm.control.laws.predictive.engine import Engine
from skyarm.control.laws.predictive.parameters import PredictiveParameters
from skyarm.control.laws.predictive.solve import Problem
from skyarm.control.laws.predictive.tip_contact import Touch, contact_goals, shift_ahead
from skyarm.reference import Trajectory

Array = npt.NDArray[np.float64]

LONGEST_ERROR = 0.15
"""m: a base further from its reference is asked to come this near only, so that a step does not saturate everything."""

WIDEST_ERROR = 1.5
"""rad or m: the same for a joint."""

WIDEST_TURN = 1.0
"""rad: the same for the heading, whose cost is of the sine."""

BEARABLE = 0.8
"""Share of a drive's limit that a disturbance is foreseen to take at most; the rest moves the arm."""


def problem_at(
    engine: Engine,
    x: Array,
    disturbance: Array,
    sample: preview.Sample,
    time: float,
    late: float,
    par: PredictiveParameters,
    touch: Touch | None = None,
) -> Problem:
    """What is to be solved from the state ``late`` s after now, when a command begins to act."""
    later = late + np.append(0.0, np.cumsum(engine.solver.steps))
    if isinstance(par.preview, Trajectory):
        signals = preview.known(par.preview, time + later)
    else:
        signals = preview.extrapolated(sample, sample.age + later)
    model, pressed = par.model, disturbance
    if touch is not None and engine.contact is not None:
        along = shift_ahead(engine.contact.gains, touch, later)
        places, rates, bends = (shifted(*each, touch.normal) for each in zip(signals, along, strict=True))
        signals = places, rates, bends
        disturbance, pressed = np.array(touch.free), np.array(touch.pressed)
    held = np.array([0.0, 0.0, float(model.gravity)]) - pressed[:3] / float(model.vehicle.mass)
    shift = engine.stance.at(signals[2][:, :3] + held, signals[0])
    wanted = preview.goals(*signals, shift)
    # a step of the reference is approached as one of this size, which moves along
    error = x[:3] - wanted[0, :3] - shift[0]
    distance = float(np.linalg.norm(error))
    if distance > LONGEST_ERROR:
        wanted[:, :3] += error * (1.0 - LONGEST_ERROR / distance)
    off = float(np.angle(np.exp(1j * (_heading(x) - wanted[0, 6]))))
    wanted[:, 6] += off - np.clip(off, -WIDEST_TURN, WIDEST_TURN)
    joints = model.vehicle.n
    beyond = x[13 : 13 + joints] - wanted[0, 7 : 7 + joints]
    wanted[:, 7 : 7 + joints] += beyond - np.clip(beyond, -WIDEST_ERROR, WIDEST_ERROR)
    if touch is not None and engine.contact is not None:
        wanted = np.hstack([wanted, contact_goals(engine.contact.gains, touch, later)])
    return Problem(x, bearable(disturbance, engine.bounds.efforts), wanted)


def shifted(signals: Array, way: Array, normal: Sequence[float]) -> Array:
    """Signals (T, 4 + joints) whose place is moved along a normal by ``way`` (T,)."""
    found = signals.copy()
    found[:, :3] += way[:, None] * np.array(normal)
    return found


def _heading(x: Array) -> float:
    """Heading of a state, rad."""
    w, a, b, c = x[3:7].tolist()
    return math.atan2(2.0 * (w * c + a * b), 1.0 - 2.0 * (b * b + c * c))


def bearable(disturbance: Array, most: Array) -> Array:
    """A disturbance whose torques the arm can hold; its force as it is.

    What pushes harder carries the arm away until it lies along the push. A torque foreseen as constant would spin it
    up over the whole horizon, and no plan would be found.
    """
    driven = most > 0.0  # nothing bears what acts on a passive joint, and it is foreseen as it is
    share = np.max(np.abs(disturbance[6:][driven]) / (BEARABLE * most[driven]), initial=1.0)
    return disturbance if share == 1.0 else np.append(disturbance[:3], disturbance[3:] / share)
