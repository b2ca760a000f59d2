"""Report of stability margins in hover, along a flight and of single loops, as text,
tables and an HTML page.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace

from skyarm.records.text_tables import Row, aligned_lines
from skyarm.studies.stability.disk_margins import LoopMargin
from skyarm.studies.stability.flight_margins import Evidence, LinearisedInstant, Locus
from skyarm.view.pages import image, page, section, table

GAINS = {"rotor_gain": "rotors", "joint_gain": "joints"}
"""Field of the margins -> head of its column."""

NOTE = """\
max |z|: spectral radius; slowest: largest real part of a rate, 1/s; delay:
further dead time that the loop tolerates, ms; rotors, joints: tolerated
factors on the actuators' effect, common to all of them. The worse of two
linearisations, with the rotors' time constant upward and with that downward.
Instants along a flight are frozen in time, and no proof that it is stable."""

LOOP_HEAD = ("weakest loop", "disk", "gain", "phase", "rad/s", "delay", "together")

LOOP_NOTE = """\
disk: symmetric disk margin, from 0 (unstable) to 2; gain, phase (deg):
tolerated by this loop, the others unchanged; rad/s: most sensitive frequency;
delay: tolerated dead time of one loop of its kind alone, ms, the least of
all; together: disk margin of all loops of its kind, each with its own factor.
Disk and delay are the smallest of all instants, each by itself."""

GROUPS_ALONE = ("all commands", "all measurements")


def margin_lines(found: Evidence) -> list[str]:
    """Lines of text with the margins at each instant, and of the weakest loops."""
    head = ("at", "max |z|", "slowest", "damping", "delay", *GAINS.values())
    swings = []
    if found.instants:
        tolerated = _milliseconds(min(each.swings for each in found.instants))
        swings = [
            f"small swings grow in flight from {tolerated} ms of further dead time on"
        ]
    return [
        f"{found.controller} in {found.scenario}",
        *aligned_lines([head, *map(_row, found.instants)]),
        NOTE,
        *swings,
        "",
        *aligned_lines(loop_rows(found, every=False)),
        LOOP_NOTE,
    ]


def _row(each: LinearisedInstant) -> Row:
    """Make the table row of eigenvalues and stability margins at one instant."""
    rates = [s for m in each.by_lag.values() for s in m.s]
    damping = [-s.real / abs(s) for s in rates if s.imag != 0.0]
    return (
        "hover" if each.hover else f"{each.time:.2f} s",
        f"{each.radius:.6f}",
        f"{max((s.real for s in rates), default=-math.inf):.3g}",
        f"{min(damping, default=1.0):.2f}",
        _number(1e3 * each.delay),
        *("-".join(map(_factor, each.gain(field))) for field in GAINS),
    )


def _factor(value: float) -> str:
    """Format a gain margin in at most four characters."""
    if math.isinf(value):
        return "none"
    # from where on rounding would take one character more
    digits = 0 if value >= 99.95 else 1 if value >= 9.995 else 2
    return f"{value:.{digits}f}"


def _milliseconds(seconds: float) -> str:
    """Format a delay in ms; no delay beyond 100 ms is looked at."""
    return "more than 100" if math.isinf(seconds) else f"{1e3 * seconds:.3g}"


def _number(value: float) -> str:
    return "none" if math.isinf(value) else f"{value:.3g}"


def loop_rows(found: Evidence, *, every: bool) -> list[Row]:
    """Make the table rows of disk margins: the weakest loop of each group, or every
    loop.

    Args:
        found: evidence of :func:`skyarm.studies.stability.flight_margins.evidence`.
        every: every loop in place of the weakest of each group.
    """
    margins = [m for instant in found.instants for m in instant.by_lag.values()]
    alone = _smallest(each for m in margins for each in m.loops)
    several = _smallest(each for m in margins for each in m.together)
    rows: list[Row] = [LOOP_HEAD if not every else ("loop", *LOOP_HEAD[1:])]
    for group in dict.fromkeys(each.group for each in alone.values()):
        members = [each for each in alone.values() if each.group == group]
        listed = members if every else [_weakest(members)]
        together = f"{several[group].disk:.2f}" if group in several else ""
        rows += [
            (*_cells(each), together if each is listed[-1] else "") for each in listed
        ]
    return rows + [
        (*_cells(several[name]), f"{several[name].disk:.2f}")
        for name in GROUPS_ALONE
        if name in several
    ]


def _smallest(margins: Iterable[LoopMargin]) -> dict[str, LoopMargin]:
    """Smallest margins of each loop over all instants, by the loop's name."""
    by_name: dict[str, list[LoopMargin]] = {}
    for each in margins:
        by_name.setdefault(each.name, []).append(each)
    return {name: _weakest(several) for name, several in by_name.items()}


def _weakest(several: Sequence[LoopMargin]) -> LoopMargin:
    """Margin with the smallest disk, and with the smallest delay, which may be that of
    another one.
    """
    return replace(
        min(several, key=lambda each: float(each.disk)),
        delay=min(float(each.delay) for each in several),
    )


def _cells(each: LoopMargin) -> Row:
    low, high = each.gain
    gain = f"{low:.2f}-" + (
        "none" if math.isinf(high) else f"{high:.2f}" if high < 10.0 else f"{high:.1f}"
    )
    frequency = "-" if math.isnan(each.frequency) else f"{each.frequency:.1f}"
    delay = "none" if math.isinf(each.delay) else f"{1e3 * each.delay:.1f}"
    return (
        each.name,
        f"{each.disk:.2f}",
        gain,
        f"{math.degrees(each.phase):.0f}",
        frequency,
        delay,
    )


WORDS = (
    "<p>The disk margin is how far gain and phase of a loop may change together, from 0"
    " (unstable) to 2: gain and phase (degrees) are what it leaves of each alone, rad/s"
    " is the most sensitive frequency, delay the tolerated dead time (ms) of this loop"
    " alone, together the disk margin of all loops of its kind under factors of their"
    " own. Disk and delay are the smallest of all instants, each by itself.</p>"
)

CAPTION = (
    "The weakest loop of each kind in hover, cut one at a time, the others closed;"
    " dashed: negative frequencies. The curve stays out of the red disk around -1 (a"
    " half plane at a margin of 2), and touches it at the frequency said."
)


def margins_page(found: Evidence, loci: Sequence[Locus], picture: bytes = b"") -> str:
    """Make the HTML page of margins: Nyquist diagrams in hover, and a table of every
    loop.

    Args:
        found: evidence of :func:`skyarm.studies.stability.flight_margins.evidence`.
        loci: loci of :func:`skyarm.studies.stability.flight_margins.hover_loci`.
        picture: PNG of their diagrams.
    """
    body = ""
    if loci:
        names = "; ".join(f"{each.margin.name} {each.margin.disk:.2f}" for each in loci)
        body += section(
            "Loops in hover",
            image(f"Nyquist diagrams: {names}", CAPTION, picture, wide=True),
        )
    head, *rows = loop_rows(found, every=True)
    body += section(
        "Every loop", WORDS + table([head[0], *(f">{name}" for name in head[1:])], rows)
    )
    facts = "the loop is lost in hover"
    if found.instants:
        delay, swings = (
            min(getattr(each, name) for each in found.instants)
            for name in ("delay", "swings")
        )
        facts = (
            f"delay margin {_milliseconds(delay)} ms; small swings grow from"
            f" {_milliseconds(swings)} ms on"
        )
        facts += f"; instants: {len(found.instants)}"
    if found.left_out:
        facts += f"; disturbances are left out: {', '.join(found.left_out)}"
    return page(f"Margins of {found.controller} in {found.scenario}", facts, body)
