"""An explanation of a loop's margins in words, a line each, and as plain data."""

from __future__ import annotations

import math
from typing import Any

from skyarm.tune.explanation import WORTH, Cause, Explanation
from skyarm.tune.front import LoopMargins
from skyarm.tune.loop_edges import Edges


def words(found: Explanation) -> list[str]:
    """What was found, a line each."""
    wanted = f"delay {1e3 * found.required.delay:.3g} ms, gains {1 / found.required.gain:.2f}-{found.required.gain:.2f}"
    if found.now is None:
        lines = ["no hover settles, not even with slow gains: thrust, torques or the belief are far off"]
    else:
        stable = found.now.growth <= 0.0
        state = "stable" if stable else f"UNSTABLE, grows {found.now.growth:.3g} 1/s"
        lines = [f"hover: {state}; {margins_in_words(found.now.margins)}; wanted: {wanted}"]
        where = "swings" if not stable else "nearest to swinging"
        if found.now.frequency > 0.0:
            lines.append(f"{where} at {found.now.frequency:.2g} Hz")
    for cause in found.causes:
        lines.append(f"{cause.part}: {cause.words}{_without(cause)}")
    if not found.short:
        lines.append("nothing is short of margin")
    for remedy in found.remedies:
        enough = "enough" if remedy.meets else "helps, not enough"
        lines.append(
            f"{remedy.part} at {remedy.share:g} of its bandwidth: {margins_in_words(remedy.after.margins)} ({enough})"
        )
    return lines


def _without(cause: Cause) -> str:
    if cause.without is None:
        return ""
    if cause.relief < WORTH:
        return "; in a hover that costs no margin"
    return f"; without: {margins_in_words(cause.without.margins)}"


def margins_in_words(margins: LoopMargins) -> str:
    """Margins on one line."""
    delay = f"{1e3 * margins.delay:.3g} ms" if math.isfinite(margins.delay) else "over 50 ms"
    rotors, joints = (
        "-".join("none" if k in (0.0, math.inf) else f"{k:.2f}" for k in pair)
        for pair in (margins.rotors, margins.joints)
    )
    return f"delay {delay}, rotors {rotors}, joints {joints}"


def plain(found: Explanation) -> dict[str, Any]:
    """What was found as plain data; what is not finite becomes null in JSON."""
    return {
        "short": found.short,
        "parts": list(found.parts),
        "thrust_margin": found.thrust_margin,
        "required": {"delay_margin_s": found.required.delay, "gain_margin": found.required.gain},
        "now": None if found.now is None else _plain_edges(found.now),
        "causes": [
            {
                "part": cause.part,
                "words": cause.words,
                "relief": cause.relief,
                "without": None if cause.without is None else _plain_edges(cause.without),
            }
            for cause in found.causes
        ],
        "remedies": [
            {
                "part": remedy.part,
                "bandwidth": remedy.share,
                "enough": remedy.meets,
                "relief": remedy.relief,
                "after": _plain_edges(remedy.after),
                "gains": dict(remedy.gains),
            }
            for remedy in found.remedies
        ],
    }


def _plain_edges(found: Edges) -> dict[str, Any]:
    margins = found.margins
    return {
        "growth_1_s": found.growth,
        "frequency_hz": found.frequency,
        "delay_margin_s": margins.delay,
        "rotor_gain": margins.rotors,
        "joint_gain": margins.joints,
    }
