"""Sensitivity of metrics to assumptions that Barakou et al. 2026 do not state, each
varied alone.

The report lists their metrics in tables of their own.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

from skyarm.paper.flights import STATED, with_damping
from skyarm.paper.published import CASES
from skyarm.records.immutable import immutable
from skyarm.reference import sequence
from skyarm.scenario.numbers import with_numbers
from skyarm.scenario.scenario_record import Delays, Scenario

DAMPINGS = (0.0, 0.001, 0.005, 0.02, 0.05)
"""Damping (N m s/rad) of both joints in the variants: from none to what the published
torques of joint 1 suggest, with two steps between that and the assumed one."""

ASSUMED_DAMPING = 0.001
"""Damping of the shipped simulated vehicle, that of the main table."""

STEP_RISE = 1e-3
"""Rise time (s) of a step; between two samples of a 50 Hz reference such a ramp is a
step."""

LATENCY = 0.003
"""Command delay (s) of RotorS's chain of about three physics steps of 1 ms."""


GROUPS = {
    "joint_damping": "Joint damping [N m s/rad]",
    "joint_damping_first": "Damping of joint 1 only [N m s/rad]",
    "ramp_shape": "Shape of the ramp, Case 1",
    "command_latency": "Latency of commands [s]",
}
"""Varied assumption -> its description."""


@immutable
class Variation:
    """One changed assumption about a flight, such as joint damping, with the cases to
    which it applies.

    Attributes:
        group, value: names in tables.
        cases: cases to which it applies.
        change: makes the changed scenario; None for the assumption with which the main
            table was simulated.
    """

    group: str
    value: str
    cases: tuple[str, ...] = CASES
    change: Callable[[Scenario], Scenario] | None = None

    @property
    def name(self) -> str:
        """Name of the changed assumption: its group and value, or the settings as
        stated if nothing is changed.
        """
        return f"{self.group} {self.value}" if self.change else STATED


def reshaped_ramps(planned: Scenario, shape: str) -> Scenario:
    """Scenario of Case 1 with quintic blends or steps in place of linear ramps."""
    # Case 1: up, hold, back, down, hold, back
    heights = (0.3, 0.3, 0.0, -0.3, -0.3, 0.0)
    rise = 1.0 if shape == "quintic" else STEP_RISE
    segments: list[tuple[float, float]] = []
    for height, seconds in zip(heights, (1.0, 5.0, 1.0, 1.0, 5.0, 1.0), strict=True):
        # a ramp that is faster than its segment holds its end for the rest
        moving = min(rise, seconds)
        segments += [(moving, height)] + (
            [(seconds - moving, height)] if seconds > moving else []
        )
    base = planned.agent.reference
    # the joints of Case 1 begin to move at 6 s
    first = sequence(6.0, segments, shape="quintic" if shape == "quintic" else "linear")
    return planned.with_reference(replace(base, joints=(first, *base.joints[1:])))


def damped_first_joint(planned: Scenario) -> Scenario:
    """Scenario with damping of 0.05 N m s/rad on joint 1 only, as its published torques
    suggest.
    """
    # the largest of the dampings that are tried
    return with_numbers(planned, {"plant.vehicle.links.0.joint.damping": DAMPINGS[-1]})


def delay_commands(planned: Scenario) -> Scenario:
    """Scenario with a delay of 3 ms on every command."""
    return planned.with_delays(Delays(command=LATENCY))


def variations() -> list[Variation]:
    """List of all changed assumptions."""
    damped = [
        Variation(
            group="joint_damping",
            value=f"{damping:g}",
            change=(
                None
                if damping == ASSUMED_DAMPING
                else partial(with_damping, damping=damping)
            ),
        )
        for damping in DAMPINGS
    ]
    first = Variation(
        group="joint_damping_first",
        value=f"{DAMPINGS[-1]:g}",
        change=damped_first_joint,
    )
    ramps = [
        Variation(
            group="ramp_shape",
            value=shape,
            # the only case with ramps
            cases=("case1",),
            change=None if shape == "linear" else partial(reshaped_ramps, shape=shape),
        )
        for shape in ("linear", "quintic", "step")
    ]
    late = Variation(
        group="command_latency", value=f"{LATENCY:g}", change=delay_commands
    )
    return [*damped, first, *ramps, late]
