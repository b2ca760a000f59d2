"""Names of a motion's parameters in parameter paths, equal to the keys of the motion's
table in a file.

A motion is three signals. Those that a circle is made of have its radius, centre and
window; a list of motions is the sum of the signals of each.
"""

from __future__ import annotations

from collections.abc import Sequence

from skyarm.records.leaves import Place
from skyarm.records.path_names import Denoted, Names
from skyarm.reference.signals import Constant, Shifted, Signal, Sine, Sum, Windowed


def motion_names(x: Signal, y: Signal, z: Signal) -> Names:
    """Parameter names of a base or tip motion: a hover, a circle, three signals, or a
    list of such motions.
    """
    axes = [
        (signal, (letter,)) for signal, letter in zip((x, y, z), "xyz", strict=True)
    ]
    terms = [_terms(*axis) for axis in axes]
    if all(terms):
        return {
            str(i): _motion(*term) for i, term in enumerate(zip(*terms, strict=False))
        }
    return _motion(*axes)


def _terms(signal: Signal, at: Place) -> list[tuple[Signal, Place]] | None:
    """Terms, with field paths, of a sum signal that was made from a list of motions;
    None for any other signal.
    """
    match signal:
        # a list of motions is the sum of zero and one after the other
        case Constant(value=int() | float() as value) if value == 0.0:
            return []
        case Sum(signals=(before, last)):
            terms = _terms(before, (*at, "signals", "0"))
            return None if terms is None else [*terms, (last, (*at, "signals", "1"))]
    return None


def _motion(*axes: tuple[Signal, Place]) -> Names:
    """Parameter names of one motion, such as "radius" for a circle, by its three
    signals with their field paths.
    """
    places = [place for _, place in axes]
    names: dict[str, Denoted] = {
        letter: (place,) for letter, place in zip("xyz", places, strict=True)
    }
    if all(isinstance(signal, Constant) for signal, _ in axes):
        names["position"] = _vector([(*place, "value") for place in places])
    if all(_is_circle(signal) for signal, _ in axes[:2]):
        centers = [(*place, "signals", "0", "value") for place in places[:2]]
        windows = [(*place, "signals", "1") for place in places[:2]]
        sines = [(*place, "signal", "signal") for place in windows]
        names |= {
            "radius": tuple((*place, "amplitude") for place in sines),
            "frequency_hz": tuple((*place, "frequency_hz") for place in sines),
            "center": _vector([*centers, (*places[2], "value")]),
            # it opens the window, and the angle counts from it
            "start": tuple(
                place
                for at in windows
                for place in ((*at, "start"), (*at, "signal", "delay"))
            ),
            "stop": tuple((*place, "stop") for place in windows),
        }
    return names


def _is_circle(signal: object) -> bool:
    """True for a centre plus a windowed, shifted sine, the form that
    :func:`skyarm.reference.circle` builds.
    """
    match signal:
        case Sum(signals=(Constant(), Windowed(signal=Shifted(signal=Sine())))):
            return True
    return False


def _vector(places: Sequence[Place]) -> Names:
    """Parameter names of a vector's components: x, y, z and 0, 1, 2."""
    return {
        name: (place,) for i, place in enumerate(places) for name in ("xyz"[i], str(i))
    }
