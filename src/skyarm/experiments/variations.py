"""What the unpublished assumptions are worth: each is varied alone, and the whole table is measured again.

The variations are the evidence behind the reasons in the report; none of them enters the table itself.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from skyarm.experiments.paper import Metrics, metrics, with_damping
from skyarm.experiments.published import CASES
from skyarm.reference import sequence
from skyarm.simulate import Delays, Log, Scenario

DAMPINGS = (0.0, 0.001, 0.005, 0.02, 0.05)
"""N m s/rad on both joints; 0.001 is assumed in the table."""

TIME_SHIFTS = (-0.5, 0.5, 1.0)
"""s by which a recorded reference may be late (positive) or early against the recorded response."""

LATENCY = 0.003
"""s of command delay: RotorS's chain of about three physics steps of 1 ms."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Variation:
    """One assumption changed.

    Attributes:
        group, value: how tables name it. label: in words.
        cases: where it applies.
        change: makes the changed scenario; None re-measures the same flight.
        measure: makes metrics of a case's log.
    """

    group: str
    value: str
    label: str
    cases: tuple[str, ...] = CASES
    change: Callable[[Scenario], Scenario] | None = None
    measure: Callable[[str, Log], Metrics] = metrics


def quintic_ramps(planned: Scenario) -> Scenario:
    """Case 1 with quintic blends in place of linear ramps; same times, same heights."""
    segments = ((1.0, 0.3), (5.0, 0.3), (1.0, 0.0), (1.0, -0.3), (5.0, -0.3), (1.0, 0.0))
    moving = sequence(6.0, segments, shape="quintic")
    base = planned.trajectory
    joints = (moving, *base.joints[1:])
    return dataclasses.replace(planned, trajectory=dataclasses.replace(base, joints=joints))


def delayed(planned: Scenario) -> Scenario:
    """Every command 3 ms late."""
    return dataclasses.replace(planned, delays=Delays(command=LATENCY))


def shifted_bag(case: str, log: Log, shift: float) -> Metrics:
    """Metrics of a log whose recorded reference is ``shift`` seconds late against the response."""
    rate = log.info["rates_hz"]["control"]
    rows = np.clip(np.arange(log.time.size) - round(shift * rate), 0, log.time.size - 1)
    names = [f"{quantity}_{form}" for quantity in ("position", "joints", "yaw", "tool") for form in ("held", "reference")]
    return metrics(case, dataclasses.replace(log, **{name: getattr(log, name)[rows] for name in names}))


def _damped(damping: float) -> Variation:
    return Variation(
        group="joint_damping",
        value=f"{damping:g}",
        label=f"joint damping {damping:g} N m s/rad",
        change=lambda planned: with_damping(planned, damping),
    )


def _shifted(shift: float) -> Variation:
    return Variation(
        group="time_shift",
        value=f"{shift:g}",
        label=f"recorded reference {abs(shift):g} s {'late' if shift > 0.0 else 'early'}",
        measure=lambda case, log: shifted_bag(case, log, shift),
    )


def variations() -> list[Variation]:
    """All of them."""
    ramps = [
        Variation(group="ramp_shape", value="linear", label="linear ramps", cases=("case1",)),
        Variation(group="ramp_shape", value="quintic", label="quintic ramps", cases=("case1",), change=quintic_ramps),
    ]
    late = Variation(group="command_latency", value=f"{LATENCY:g}", label=f"commands {1e3 * LATENCY:g} ms late", change=delayed)
    return [*(_damped(damping) for damping in DAMPINGS), *ramps, late, *(_shifted(shift) for shift in TIME_SHIFTS)]


def variation(group: str, value: str) -> Variation:
    """A variation by its names."""
    return next(each for each in variations() if (each.group, each.value) == (group, value))
