"""Parameter paths: dotted names as in a scenario file, converted to fields of the Scenario dataclass.

One number of a file may have several places in the records (a circle's radius is the amplitude of two sines), and a
file's word may be another than the record's (``force`` is ``force_W``). Both words lead to the record.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any

from skyarm.algebra import Quaternion, Vec3
from skyarm.algebra.scalars import Scalar
from skyarm.dynamics import State
from skyarm.plant.interface import Truth
from skyarm.records.files import did_you_mean
from skyarm.records.leaves import Place, field_names, part, parts
from skyarm.records.registry.registrations import name_of
from skyarm.records.words import EACH, lifted_fields, slots
from skyarm.reference import Constant, Shifted, Signal, Sine, Sum, Trajectory, Windowed
from skyarm.reference.path_time import PLANNED
from skyarm.reference.tip_motion import TipMotion
from skyarm.scenario.endings import Ending
from skyarm.scenario.scenario_record import Scenario, ScenarioError
from skyarm.vehicle.linkage import JOINT_NUMBERS
from skyarm.vehicle.vehicle_records import Vehicle
from skyarm.world import Air, AirSignals, Force, ForceWind, Gust, MovingAir

LATE = "delays.command"
"""Path of the commands' delay, which stays out of the numbers of a flight that has none."""


def places_of(scenario: Scenario, path: str) -> tuple[Place, ...]:
    """Fields of a scenario that store the parameter at a path; several if one number is stored more than once.

    Raises:
        ScenarioError: a field that does not exist (with those that do), or one that is structure.
    """
    if (held := place_of_delay(scenario, path)) is not None:
        return (held,)
    for slot in slots(Scenario):
        if slot.word.varies == "never" and is_below(path, slot.path):
            raise ScenarioError(
                f"path = {path!r}: {slot.path} is structure, the same for all episodes; fly two studies"
            )
        if slot.type is Scalar and path == slot.path:
            return (slot.place,)
    if path.startswith("reference.") and scenario.path_time is not None:
        raise ScenarioError(f"path = {path!r}: {PLANNED}; make a scenario of each (skyarm.govern)")
    if path.startswith("changes.") and not path.endswith(".value"):
        raise ScenarioError(f"path = {path!r}: must be changes.NUMBER.value; when a change comes is structure")
    for root, start in roots(scenario).items():
        if path.startswith(f"{root}."):
            return _follow(scenario, path, start, path[len(root) + 1 :].split("."))
    known = variable_words()
    near = did_you_mean(".".join(path.split(".")[:2]), known) or did_you_mean(path.split(".", maxsplit=1)[0], known)
    raise ScenarioError(f"path = {path!r}: {near}must start with one of {', '.join(known)}")


def is_below(path: str, word: str) -> bool:
    """True if a path is a word of a file or leads to something inside it."""
    return path == word or path.startswith(f"{word}.")


@cache
def variable_words() -> dict[str, Place]:
    """Words of a file below which numbers may vary, with the field that each denotes."""
    return {
        slot.path: slot.place
        for slot in slots(Scenario)
        if slot.word.varies != "never" and slot.type is not Scalar and EACH not in slot.path
    }


@cache
def delay_words() -> dict[str, tuple[Place, str]]:
    """Numbers that vary only where a field beside them is stated: path -> record, and name of that field."""
    return {
        f"{slot.path}.{name}": (slot.place, other)
        for slot in slots(Scenario)
        if isinstance(slot.type, type)
        for name, other in lifted_fields(slot.type).items()
    }


def place_of_delay(scenario: Scenario, path: str) -> Place | None:
    """Field of a delay that may vary, as the scenario states how long it gets at most; None for all else."""
    record, other = delay_words().get(path, ((), ""))
    if not other or part(scenario, (*record, other)) is None:
        return None
    return (*record, path.rpartition(".")[2])


def roots(scenario: Scenario) -> dict[str, Place]:
    """Beginnings of parameter paths, such as plant or sensors.imu, with the scenario fields that they denote."""
    carried = ("agent", "plant", "vehicle", "drives")
    found: dict[str, Place] = {
        f"plant.drives.{each.name}": (*carried, str(i), "drive") for i, each in enumerate(scenario.plant.vehicle.drives)
    }
    for slot in slots(Scenario):
        if EACH in slot.path:
            inside = slot.place[len(slot.record) + 1 :]
            for i, each in enumerate(part(scenario, slot.record)):
                found[f"{slot.table}.{each.name}"] = (*slot.record, str(i), *inside)
    return {**found, **variable_words()}


def _follow(scenario: Scenario, path: str, start: Place, words: list[str]) -> tuple[Place, ...]:
    places: Any = (start,)
    for word in words:
        if isinstance(places, tuple):
            options = names(part(scenario, places[0]))
            heads = places
        else:
            options, heads = places, (start,)
        if word not in options:
            known = [
                *options,
                *(_named_sensors_and_drives(scenario, path) if start in variable_words().values() else ()),
            ]
            there = f"{did_you_mean(word, known)}there are {', '.join(known) or 'no fields'}"
            raise ScenarioError(f"path = {path!r}: no {word!r} here; {there}")
        places = _with_heads(heads, options[word])
        start = heads[0]
    if not isinstance(places, tuple):
        raise ScenarioError(f"path = {path!r}: must lead to a number; there are {', '.join(places)}")
    # a number of the file that is held as a signal
    return tuple((*at, "value") if isinstance(part(scenario, at), Constant) else at for at in places)


def _named_sensors_and_drives(scenario: Scenario, path: str) -> list[str]:
    """Names of sensors and drives, listed as suggestions for a misspelt parameter path."""
    head = path[: path.index(".") + 1]
    return [
        name.removeprefix(head) for name in roots(scenario) if name not in variable_words() and name.startswith(head)
    ]


def _with_heads(heads: tuple[Place, ...], found: object) -> Any:
    """Prepend each of several parent fields to the fields that a name denotes."""
    if isinstance(found, tuple):
        return tuple((*head, *tail) for head in heads for tail in found)
    return found


Tree = Mapping[str, Any]
"""Name -> places it stands for, or a tree of more names."""

WORDS: Mapping[type, Mapping[str, str]] = {
    ForceWind: {"force": "force_W", "point": "point_B", "air_velocity": "air_velocity_W"},
    MovingAir: {"velocity": "velocity_W"},
    AirSignals: {"velocity": "velocity_W"},
    Gust: {"force": "peak", "velocity": "peak"},
    State: {"quaternion_wxyz": "quaternion"},
}
"""Words of the file for fields of records."""


REGISTERED: Mapping[type, str] = {Air: "air", Force: "force", Ending: "ending"}
"""Items of lists that bear the name of their class."""


def names(record: object) -> dict[str, tuple[Place, ...] | Tree]:
    """Names that may continue a parameter path inside a given dataclass or tuple, with the field of each."""
    found: dict[str, tuple[Place, ...] | Tree] = {}
    if isinstance(record, tuple):
        found |= {number: ((number,),) for number in parts(record)}
        named = [_name(item) for item in record]
        return found | {name: ((str(i),),) for i, name in enumerate(named) if name and named.count(name) == 1}
    fields = field_names(type(record))
    if fields is None:
        return found
    signal: Any = record
    if isinstance(signal, Signal):
        return _signal(signal)
    found |= {field: ((field,),) for field in fields}
    if isinstance(record, (Vec3, Quaternion)):
        found |= {str(i): ((field,),) for i, field in enumerate(fields)}
    for word, field in WORDS.get(type(record), {}).items():
        found[word] = ((field,),)
    if isinstance(record, Truth):
        found["joints"] = _every_joint(record.vehicle)
    if isinstance(record, Trajectory):
        found["base"] = _motions(record)
        for part_name in ("tip", "push", "load"):
            if getattr(record, part_name) is None:
                del found[part_name]
    if isinstance(record, TipMotion):
        found["path"] = _motions(record)
    return found


def _name(item: object) -> str | None:
    """Name of a list item: its ``name`` field, else the name under which its class is registered."""
    own = getattr(item, "name", None)
    if isinstance(own, str):
        return own
    kind = next((kind for base, kind in REGISTERED.items() if isinstance(item, base)), None)
    return name_of(kind, type(item)) if kind else None


def _every_joint(vehicle: Vehicle) -> Tree:
    """Parameter names of [plant] joints = { damping, ... }, each of which sets one number for every joint."""
    return {
        field: tuple(("vehicle", "links", str(i), "joint", field) for i in range(vehicle.n))
        for field in JOINT_NUMBERS
        if vehicle.n
    }


def _signal(signal: Signal) -> dict[str, tuple[Place, ...] | Tree]:
    """Parameter names of a signal's fields, including those of a signal inside a window or time shift."""
    found: dict[str, tuple[Place, ...] | Tree] = {}
    if isinstance(signal, (Windowed, Shifted)):
        found |= {name: _under(("signal",), at) for name, at in names(signal.signal).items()}
    if isinstance(signal, Sum):
        found |= {str(i): (("signals", str(i)),) for i in range(len(signal.signals))}
    found |= {field: ((field,),) for field in parts(signal)}
    if isinstance(signal, Windowed) and isinstance(signal.signal, Shifted) and isinstance(signal.signal.signal, Sine):
        # the time of a sine that starts counts from there
        found["start"] = (("start",), ("signal", "delay"))
    return found


def _under(head: Place, at: tuple[Place, ...] | Tree) -> tuple[Place, ...] | Tree:
    """Prepend the field of a containing dataclass to the fields of the contained dataclass."""
    if isinstance(at, tuple):
        return tuple((*head, *place) for place in at)
    return {name: _under(head, inner) for name, inner in at.items()}


def _motions(motion: Trajectory | TipMotion) -> Tree:
    """Parameter names of [reference.base] or the tip's path, as in the file: hover, circle, signals, or a list."""
    axes = [(getattr(motion, letter), (letter,)) for letter in "xyz"]
    terms = [_terms(*axis) for axis in axes]
    if all(terms):
        return {str(i): _motion(*term) for i, term in enumerate(zip(*terms, strict=False))}
    return _motion(*axes)


def _terms(signal: Signal, at: Place) -> list[tuple[Signal, Place]] | None:
    """Terms of a sum ((0 + a) + b) ... of a list of motions, with their field paths; None for any other signal."""
    match signal:
        case Constant(value=int() | float() as value) if value == 0.0:
            return []
        case Sum(signals=(before, last)):
            terms = _terms(before, (*at, "signals", "0"))
            return None if terms is None else [*terms, (last, (*at, "signals", "1"))]
    return None


def _motion(*axes: tuple[Signal, Place]) -> Tree:
    """Parameter names of one motion, such as "radius" for a circle, by its three signals with their field paths."""
    places = [place for _, place in axes]
    found: dict[str, Any] = {letter: (place,) for letter, place in zip("xyz", places, strict=True)}
    if all(isinstance(signal, Constant) for signal, _ in axes):
        found["position"] = _vector([(*place, "value") for place in places])
    if all(_is_circle(signal) for signal, _ in axes[:2]):
        centers = [(*place, "signals", "0", "value") for place in places[:2]]
        windows = [(*place, "signals", "1") for place in places[:2]]
        sines = [(*place, "signal", "signal") for place in windows]
        found |= {
            "radius": tuple((*place, "amplitude") for place in sines),
            "frequency_hz": tuple((*place, "frequency_hz") for place in sines),
            "center": _vector([*centers, (*places[2], "value")]),
            "start": tuple(place for at in windows for place in ((*at, "start"), (*at, "signal", "delay"))),
            "stop": tuple((*place, "stop") for place in windows),
        }
    return found


def _is_circle(signal: object) -> bool:
    """True for a centre plus a windowed, shifted sine, the form that :func:`skyarm.reference.circle` builds."""
    match signal:
        case Sum(signals=(Constant(), Windowed(signal=Shifted(signal=Sine())))):
            return True
    return False


def _vector(places: Sequence[Place]) -> Tree:
    """Parameter names of a vector's components: x, y, z and 0, 1, 2."""
    return {name: (place,) for i, place in enumerate(places) for name in ("xyz"[i], str(i))}
