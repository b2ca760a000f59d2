"""Parts of the centroidal law changed in its constants or its memory, and steps of it."""

import dataclasses
from types import SimpleNamespace
from typing import Any

from skyarm.control.laws.centroidal.part import Step
from skyarm.control.laws.centroidal.shift_motion import Following


def with_parts(record: Any, **changes: Any) -> Any:
    """The constants, or the memory, with other parts."""
    return dataclasses.replace(record, parts=dataclasses.replace(record.parts, **changes))


def step_of(par: Any, state: Any, signals: Any = (), dt: float = 0.005, **known: Any) -> Step:
    """A step of the law; its memory's following, trim and applied, and any field of a step, may be given."""
    kept = {"following": Following(), "trim": (), "applied": (1.0,)}
    memory = SimpleNamespace(**{name: known.pop(name, value) for name, value in kept.items()})
    blank: dict[str, Any] = dict.fromkeys(("measurement", "reference", "observed", "told", "alone", "unknown", "force"))
    step = Step(par=par, memory=memory, dt=dt, signals=signals, free=(), **blank)
    step.state, step.told = state, SimpleNamespace(amid=state)
    for name, value in known.items():
        setattr(step, name, value)
    return step
