"""Trial of a user-defined law: floats against its traced program, so that nothing is frozen unseen."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import Any

from skyarm.algebra import Vec3
from skyarm.compile import leaves, rebuild
from skyarm.compile.tracing.float_trial import PERIODS, compare_with_floats
from skyarm.control.controller import Controller
from skyarm.control.law_checks import checked_law, is_own, wrong
from skyarm.reference import Reference
from skyarm.sensors.measurement import Measurement


def try_law(controller: Controller, period: float, seen: Measurement, wanted: Sequence[Reference]) -> None:
    """Refuse a law that is no function of its arguments, or whose first command is no number.

    A shipped law is not tried, nor one that is called with floats: such a law may keep what it likes.

    Args:
        controller: as it is to fly.
        period: control period, s.
        seen: what it measures first; in the periods that follow the vehicle drifts a little from there.
        wanted: references of the periods.

    Raises:
        LawError: one line.
    """
    if not controller.compiled or not is_own(controller):
        return
    law, par = checked_law(controller), controller.par

    def step(memory: Any, measured: Measurement, reference: Reference) -> tuple[Any, Any]:
        return law(memory, measured, reference, period, par=par)

    compare_with_floats(
        step,
        controller.memory,
        # a flight may have fewer periods
        list(zip(_drifting(seen, period), wanted, strict=False)),
        lambda words: wrong(controller, words),
        constants=par,
        names=("memory", "measurement", "reference", "par"),
        first=lambda instant, command: _require_numbers(controller, instant, command),
    )


def _require_numbers(controller: Controller, instant: Any, command: Sequence[float]) -> None:
    """Refuse a first command that is not finite although its inputs are."""
    if not all(map(math.isfinite, leaves(instant))):
        return
    vehicle = controller.par.model.vehicle
    counts = {"rotor_speeds": len(vehicle.rotors), "efforts": vehicle.n, "tilts": len(vehicle.tilts)}
    fields = [f"{name}[{i}]" for name, count in counts.items() for i in range(count)]
    for field, value in zip(fields, command, strict=False):  # angles may be left out
        if not math.isfinite(value):
            raise wrong(controller, f"gives {field} = {value} in its first period: must be a finite number")


def _drifting(first: Measurement, period: float) -> list[Measurement]:
    """Measurements of a vehicle that drifts a little."""
    return [
        dataclasses.replace(drifted(first, k), time=float(first.time) + k * period) if k else drifted(first, 0)
        for k in range(PERIODS)
    ]


def drifted(record: Any, k: int) -> Any:
    """A record of floats with a quaternion, every number a little other in every period ``k`` but the first."""
    start = [float(leaf) for leaf in leaves(record)]
    if k == 0:
        return rebuild(record, iter(start))
    moved = [x + 1e-3 * (1.0 + 0.01 * abs(x)) * math.sin(0.7 * i + 0.9 * k) for i, x in enumerate(start)]
    found = rebuild(record, iter(moved))
    return dataclasses.replace(found, quaternion=found.quaternion.normalized())


def level(blank: Measurement, gravity: float) -> Measurement:
    """Measurement of a vehicle at rest and level; gravity in m/s^2."""
    return dataclasses.replace(blank, specific_force=Vec3(0.0, 0.0, gravity))
