"""The delay at which a vehicle really swings: flights of the nonlinear loop, many
delays side by side.
"""

from __future__ import annotations

import dataclasses

import numpy as np

import skyarm
from skyarm.scenario.scenario_record import PERFECT_SENSORS, first_state
from skyarm.studies.stability.flight_margins import hovering
from skyarm.studies.stability.frozen_scenario import with_held_lag, without_adaptation

EARLY, LATE = (4.0, 6.0), (12.0, 14.0)
"""s, in which the swing's size is looked at."""

TILT = 1e-4
"""Of the first attitude: small, so that nothing saturates while the swing grows or dies
out."""

LARGE = 1.0
"""rad/s: a swing of this size has grown to where actuators are at their limits, and
grows no more."""

TABLE = (
    ("hummingbird_arm2_rotors", "paper_pd", (0.4, 0.6)),
    ("hummingbird_arm2_rotors", "paper_ct", (0.4, 0.6)),
    ("hummingbird_arm2_rotors", "centroidal_tip", (0.4, 0.6)),
    ("hexarotor_arm6", "centroidal_tip", (0.2, 0.3, 0.3, 0.0, 0.2, 0.0)),
    ("pelican_arm2", "paper_ct", (0.4, 0.6)),
    ("quadrotor_roll_arm2", "centroidal_tip", (0.2, 0.3)),
)
"""Vehicle, law, arm of the table in docs/data/margins.md; the last flies servos on a
battery."""


def hover(vehicle, law, joints, **delays):
    """A scenario that hovers, perfectly measured, on the vehicle that the law
    believes.
    """
    document = {
        "schema": 1,
        "name": vehicle,
        "duration": 5.0,
        "plant": {"vehicle": vehicle},
        "controller": {"preset": law},
        "reference": {
            "base": {"kind": "hover", "position": [0.0, 0.0, 1.5]},
            "joints": list(joints),
        },
    }
    return dataclasses.replace(
        skyarm.scenario_from(document),
        noise=PERFECT_SENSORS,
        ground=False,
        delays=skyarm.Delays(**delays),
    )


def swings_from(scenario, delays):
    """The delay (s) from which on a small swing grows in flight, between two of those
    flown.

    Args:
        scenario: that hovers.
        delays: of the commands, s, ascending; from one at which nothing swings to one
            at which it does.
    """
    still = hovering(with_held_lag(without_adaptation(scenario)))
    longest = dataclasses.replace(
        scenario.delays, longest_command=float(max(delays)) + 1e-3
    )
    flight = dataclasses.replace(
        still,
        duration=LATE[1],
        kind="rigid_body",
        initial=first_state(still),
        delays=longest,
    )
    tilted = [f"initial.quaternion.{axis}" for axis in "xy"]
    batch = skyarm.Batch(
        flight, ["delays.command", *tilted], metrics=(), log_every=1, effort=0
    )
    lanes = np.full(len(delays), TILT)
    outcome = batch.fly(
        {"delays.command": np.asarray(delays), **dict.fromkeys(tilted, lanes)}
    )
    with np.errstate(all="ignore"):
        growth = np.log(size(outcome.log, *LATE) / size(outcome.log, *EARLY))
        swings = size(outcome.log, *LATE) > LARGE
    growth[(outcome.status != "completed") | swings] = np.inf
    k = int(np.argmax(growth > 0.0))
    assert k > 0, f"nothing between {growth[:1]} and swinging"
    share = (
        0.5
        if not np.isfinite(growth[k])
        else growth[k - 1] / (growth[k - 1] - growth[k])
    )
    return float(delays[k - 1] + share * (delays[k] - delays[k - 1]))


def size(log, begin, end):
    """Root mean square of all rates of base and joints about their mean, (lanes,)."""
    here = (log.time >= begin) & (log.time < end)
    rates = np.array([*log.state.rate, *log.state.joint_rates])[:, :, here]
    return np.sqrt(
        np.square(rates - rates.mean(axis=2, keepdims=True)).mean(axis=2).sum(axis=0)
    )
