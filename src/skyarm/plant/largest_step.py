"""Longest stable integration steps of winds, forces, contacts and joint drives; names
of the integrators.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

from skyarm.algebra import Scalar
from skyarm.dynamics.actuators.drive import Drive
from skyarm.plant.surroundings import AnyComponent, Surroundings, Together
from skyarm.records import coerce
from skyarm.records.coerce import concrete
from skyarm.records.files import shown
from skyarm.records.leaves import leaves
from skyarm.world.component import MOST_STEPS

INTEGRATORS = ("rk4", "euler", "rk4_staged")
"""Names of the integrators. On the rigid-body plant the third equals the first, which
evaluates loads at each stage anyway."""


def require_integrator(integrator: str) -> None:
    """Refuse the name of an integrator that there is not."""
    if integrator not in INTEGRATORS:
        raise ValueError(
            f"integrator = {integrator!r}: must be one of {list(INTEGRATORS)}"
        )


FRICTION_STEP = 0.7
"""Largest product of friction's decay rate and an RK4 step with loads at each stage
(stable to 2.78; error 1.2e-3 of the fastest mode). Thirty seconds of case3 at 0.65 end
within 3.5e-8 m of 32 steps, at 0.33 within 3.3e-8 (measured)."""

HELD_FRICTION_STEP = 0.1
"""The same product with loads held for a step: friction is of first order then, 5 % off
at 0.1."""

VERLET_FRICTION_STEP = 0.35
"""The same product of a Stoermer-Verlet step, whose friction is that of mid-step: 0.7 %
of the fastest mode off."""

VERLET = "verlet"
"""Integrator of the rigid-body plant in place of its Runge-Kutta steps near coupled
bodies; not selectable in a scenario. It evaluates forces once a step, where a
Runge-Kutta step evaluates them four times."""

STAGES = 4
"""Number of force evaluations of a Runge-Kutta step."""


def largest_step(
    around: Together, *, coupled: bool = True, euler: bool = False
) -> float | None:
    """Longest integration step (s) that is stable for all environment models and joint
    drives; None for no limit.

    ``coupled`` says whether coupled components count: inactive ones allow any step.
    ``euler`` selects the steps of the semi-implicit Euler method.
    """
    parts = [each for each in around.components_of_all if coupled or not each.coupled]
    own = (each.largest_euler_step if euler else each.largest_step for each in parts)
    return _least((*own, *(drive.largest_step for drive in around.drives_of_all)))


def largest_stable_step(record: AnyComponent | Drive, *, euler: bool) -> Scalar | None:
    """Longest step (s) of an environment model or joint drive that is stable with all
    integrators in use.
    """
    verlet = getattr(record, "largest_verlet_step", None)
    if not euler and verlet is None:
        return record.largest_step
    steps = [
        getattr(record, "largest_euler_step", record.largest_step),
        None if euler else verlet,
    ]
    # lanes may fly by any method, so the shortest of its steps counts
    return min((step for step in steps if step is not None), default=None)


def lanes_step(around: Together, *, euler: bool) -> float | None:
    """Longest integration step (s) that is stable in every SIMD lane of a batch of
    flights; None for no limit.
    """
    records: tuple[AnyComponent | Drive, ...] = (
        *around.components_of_all,
        *around.drives_of_all,
    )
    return _least(largest_stable_step(each, euler=euler) for each in records)


def verlet_step(around: Together) -> float | None:
    """Longest Stoermer-Verlet step (s) in contact; None if Runge-Kutta is used instead.

    Runge-Kutta is used if anything else needs short steps: drive loops and damped air
    tolerate less with Verlet.
    """
    # without coupled components there is nothing to gain by it
    if not around.coupled or largest_step(around, coupled=False) is not None:
        return None
    steps = [component.largest_verlet_step for _, component, _ in around.coupled]
    # one component that cannot be integrated so excludes the method
    return None if None in steps else _least(steps)


def _least(steps: Iterable[Scalar | None]) -> float | None:
    return min((float(step) for step in steps if step is not None), default=None)


STATED = (
    "plant.drives.",
    "plant.vehicle.drives.",
    "environment.air.",
    "environment.forces.",
    "world.",
)
"""Prefixes of the paths of numbers that may determine the longest stable step."""


def stated_step(scenario: Any) -> float | None:
    """Longest integration step (s) that is stable for a scenario's winds, forces and
    joint drives.
    """
    agents = scenario.agents.values()
    each = tuple(
        Surroundings(components=scenario.own_components(a), drives=a.all_drives)
        for a in agents
    )
    around = Together(each, tuple(scenario.agents), scenario.shared_components)
    return largest_step(around, euler=scenario.integrator == "euler")


def divisions(seconds: float, largest: float | None) -> int:
    """Smallest number of equal parts of ``seconds`` that are at most ``largest`` (s)
    long.
    """
    # 0.005 / 0.001 is five up to rounding
    return 1 if largest is None else max(1, math.ceil(seconds / largest - 1e-9))


def check_largest_step(
    records: Iterable[tuple[str, AnyComponent | Drive]], period: float
) -> None:
    """Refuse a longest stable integration step that is not positive, or below a
    thousandth of the control period.

    Args:
        records: place and air, force or drive of each.
        period: control period, s.

    Raises:
        ValueError: one line with field, value and what is allowed.
    """
    for where, record in records:
        # a property of traced numbers is not evaluated: it may branch
        if not concrete(*leaves(record)):
            continue
        allowed = f"{period / MOST_STEPS:g} s, a thousandth of the control period"
        for name in ("largest_step", "largest_euler_step", "largest_verlet_step"):
            given = getattr(record, name, None)
            if given is None:
                continue
            value = coerce.number(f"{where}.{name}", given)
            if not concrete(value):
                coerce.refuse(f"{where}.{name}", given, "must be one number")
            # written so that NaN is refused, too
            if period / MOST_STEPS <= value < math.inf:
                continue
            # the parameters of a drive are in the file, its largest step is not
            why = (
                record.why_short_steps()
                # NaN or infinity is told as it is: no constants of a drive explain it
                if isinstance(record, Drive) and value < period
                else ""
            )
            if why:
                raise ValueError(
                    f"{where}: {why} move the joint within {value:.2g} s, must be at"
                    f" least {allowed}"
                )
            raise ValueError(
                f"{where}.{name} = {shown(value)}: must be None or at least {allowed}"
            )
