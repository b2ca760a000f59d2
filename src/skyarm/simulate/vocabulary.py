"""The words of a scenario file and where its numbers stand in the records.

One number of a file may stand at several places of the records (a circle's radius is the amplitude of two sines), and a
file's word may be another than the record's (``force`` is ``force_W``). Words that are both lead to the record.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from skyarm.algebra import Quaternion, Vec3
from skyarm.dynamics import State
from skyarm.environment import Airspeed, Gust, RotorsForce
from skyarm.plant.interface import World
from skyarm.reference import Constant, Shifted, Signal, Sine, Sum, Trajectory, Windowed
from skyarm.vehicle.records import Vehicle

Place = tuple[str, ...]
"""Field names and item numbers that lead from one record to a part of it."""

Tree = Mapping[str, Any]
"""Name -> places it stands for, or a tree of more names."""

WORDS: Mapping[type, Mapping[str, str]] = {
    RotorsForce: {"force": "force_W", "point": "point_B", "air_velocity": "air_velocity_W"},
    Airspeed: {"velocity": "velocity_W"},
    Gust: {"force": "peak", "velocity": "peak"},
    State: {"quaternion_wxyz": "quaternion"},
}
"""Words of the file for fields of records."""


def names(record: Any) -> dict[str, tuple[Place, ...] | Tree]:
    """Names that lead on from a record."""
    found: dict[str, tuple[Place, ...] | Tree] = {}
    if isinstance(record, tuple):
        found |= {str(i): ((str(i),),) for i in range(len(record))}
        return found | {
            item.name: ((str(i),),) for i, item in enumerate(record) if isinstance(getattr(item, "name", None), str)
        }
    if not dataclasses.is_dataclass(record):
        return found
    signal: Any = record
    if isinstance(signal, Signal):
        return _signal(signal)
    found |= {field.name: ((field.name,),) for field in dataclasses.fields(record)}
    if isinstance(record, (Vec3, Quaternion)):
        found |= {str(i): ((field.name,),) for i, field in enumerate(dataclasses.fields(record))}
    for word, field in WORDS.get(type(record), {}).items():
        found[word] = ((field,),)
    if isinstance(record, World):
        found["joints"] = _every_joint(record.vehicle)
    if isinstance(record, Trajectory):
        found["base"] = _motions(record)
    return found


def part(record: Any, place: Place) -> Any:
    """What stands at a place."""
    for name in place:
        record = record[int(name)] if isinstance(record, tuple) else getattr(record, name)
    return record


def replaced(record: Any, values: Mapping[Place, Any]) -> Any:
    """The record with other values at some places, none of which lies inside another.

    Every record on the way is made, and checked, once: numbers that only together make sense are replaced together.
    """
    if () in values:
        return values[()]
    below: dict[str, dict[Place, Any]] = {}
    for place, value in values.items():
        below.setdefault(place[0], {})[place[1:]] = value
    if isinstance(record, tuple):
        return tuple(replaced(item, below[str(i)]) if str(i) in below else item for i, item in enumerate(record))
    return dataclasses.replace(
        record, **{name: replaced(getattr(record, name), inner) for name, inner in below.items()}
    )


def _every_joint(vehicle: Vehicle) -> Tree:
    """[plant] joints = { damping, ... }: the same number for every joint."""
    fields = ("damping", "coulomb", "coulomb_rate", "effort_limit")
    return {
        field: tuple(("vehicle", "links", str(i), "joint", field) for i in range(vehicle.n))
        for field in fields
        if vehicle.n
    }


def _signal(signal: Signal) -> dict[str, tuple[Place, ...] | Tree]:
    """A signal's own fields, and those of the signal that a window or a shift holds."""
    found: dict[str, tuple[Place, ...] | Tree] = {}
    if isinstance(signal, (Windowed, Shifted)):
        found |= {name: _under(("signal",), at) for name, at in names(signal.signal).items()}
    if isinstance(signal, Sum):
        found |= {str(i): (("signals", str(i)),) for i in range(len(signal.signals))}
    found |= {field.name: ((field.name,),) for field in dataclasses.fields(signal)}  # type: ignore[arg-type]
    if isinstance(signal, Windowed) and isinstance(signal.signal, Shifted) and isinstance(signal.signal.signal, Sine):
        # the time of a sine that starts counts from there
        found["start"] = (("start",), ("signal", "delay"))
    return found


def _under(head: Place, at: tuple[Place, ...] | Tree) -> tuple[Place, ...] | Tree:
    """The same places seen from a record further out."""
    if isinstance(at, tuple):
        return tuple((*head, *place) for place in at)
    return {name: _under(head, inner) for name, inner in at.items()}


def _motions(motion: Trajectory) -> Tree:
    """[reference.base] as the file has it: hover, circle, signals, or a list of them."""
    axes = (motion.x, motion.y, motion.z)
    if all(_is_list(axis) for axis in axes):
        each = zip(*(_items(axis) for axis in axes), strict=False)
        return {
            str(i): _motion(
                tuple(a for a, _ in item), tuple((letter, *at) for letter, (_, at) in zip("xyz", item, strict=True))
            )
            for i, item in enumerate(each)
        }
    return _motion(axes, (("x",), ("y",), ("z",)))


def _is_list(signal: Signal) -> bool:
    """A sum ((0 + a) + b) ... that starts from the motionless trajectory, as lists of motions are read."""
    while isinstance(signal, Sum) and len(signal.signals) == 2:
        signal = signal.signals[0]
        if isinstance(signal, Constant) and isinstance(signal.value, (int, float)) and signal.value == 0.0:
            return True
    return False


def _items(signal: Any) -> list[tuple[Signal, Place]]:
    """Terms of such a sum in the order of the file, with their places."""

    def backwards() -> Iterator[tuple[Signal, Place]]:
        rest: Any = signal
        at: Place = ()
        while isinstance(rest, Sum):
            yield rest.signals[1], (*at, "signals", "1")
            rest, at = rest.signals[0], (*at, "signals", "0")

    return list(backwards())[::-1]


def _motion(axes: tuple[Signal, ...], places: tuple[Place, ...]) -> Tree:
    """One motion, by what its three signals are."""
    found: dict[str, Any] = dict(zip("xyz", ((place,) for place in places), strict=True))
    if all(isinstance(axis, Constant) for axis in axes):
        found["position"] = _vector([(*place, "value") for place in places])
    turning = axes[:2]
    if all(_is_circle(axis) for axis in turning):
        centers = [(*place, "signals", "0", "value") for place in places[:2]]
        window = [(*place, "signals", "1") for place in places[:2]]
        sine = [(*place, "signal", "signal") for place in window]
        found |= {
            "radius": tuple((*place, "amplitude") for place in sine),
            "frequency_hz": tuple((*place, "frequency_hz") for place in sine),
            "center": _vector([*centers, (*places[2], "value")]),
            "start": tuple(place for at in window for place in ((*at, "start"), (*at, "signal", "delay"))),
            "stop": tuple((*place, "stop") for place in window),
        }
    return found


def _is_circle(signal: Any) -> bool:
    """A centre and a windowed, shifted sine, as :func:`skyarm.reference.circle` makes them."""
    if not isinstance(signal, Sum) or len(signal.signals) != 2:
        return False
    center, turn = signal.signals
    return (
        isinstance(center, Constant)
        and isinstance(turn, Windowed)
        and isinstance(turn.signal, Shifted)
        and isinstance(turn.signal.signal, Sine)
    )


def _vector(places: Sequence[Place]) -> Tree:
    """Three numbers by letter and by number."""
    return {name: (place,) for i, place in enumerate(places) for name in ("xyz"[i], str(i))}
