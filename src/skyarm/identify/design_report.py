"""Report of a designed excitation flight: expected confidence intervals, and the space
and tilt that it needs.
"""

from __future__ import annotations

import math

from skyarm.identify.designed_flight import DesignedFlight
from skyarm.records.text_tables import aligned_lines

HEADS = ("", "95 % interval, designed", "undesigned", "sharper by")


def design_facts(found: DesignedFlight) -> list[dict[str, float | str]]:
    """Expected half widths of the 95 % interval of each parameter, in its unit, as
    plain data.
    """
    return [
        {
            "name": each.designed.name,
            "unit": each.designed.unit,
            "designed": each.designed.half_width,
            "undesigned": each.undesigned.half_width,
            "sharper": each.ratio,
        }
        for each in found.numbers
    ]


def design_lines(found: DesignedFlight, vehicle: str, seconds: float) -> list[str]:
    """Lines of the report of a designed flight; the first is the title.

    Args:
        found: designed flight.
        vehicle: name of the vehicle.
        seconds: s, of flight.
    """
    rows = [
        (
            each.designed.title,
            each.designed.width,
            each.undesigned.width,
            f"{each.ratio:.1f}",
        )
        for each in found.numbers
    ]
    extent = " x ".join(f"{each:.2f}" for each in found.box)
    needs = [
        f"base within {extent} m",
        f"tilt at most {math.degrees(found.tilt):.0f} deg",
    ]
    if math.isfinite(found.clearance):
        needs.append(f"arm at least {found.clearance:.2f} m from rotors and base")
    return [
        f"excitation of {vehicle}: {seconds:g} s",
        *aligned_lines([HEADS, *rows]),
        (
            f"In a simulated flight: {', '.join(needs)}; {found.saturated:.2%} of the"
            " rotor commands at a limit."
        ),
        "Undesigned: the path on which tuned gains are validated, for as long.",
    ]
