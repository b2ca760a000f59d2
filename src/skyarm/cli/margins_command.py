"""Command ``skyarm margins``: eigenvalues and stability margins of the linearised closed loop."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from skyarm.cli.arguments import Laws, Scenario, one_law, out_option, require_not_another, require_within
from skyarm.cli.lines import NOT_COMPLETED, say_suspicious
from skyarm.cli.output import bar, give, heading, plain, plugin_facts, tell, write_json
from skyarm.control.catalogue import is_named, must_be_named
from skyarm.control.safety import with_safety_layer
from skyarm.control.safety.safety_layer import SafetyParameters
from skyarm.records.files import output_file, shown, taken_back, write_atomically
from skyarm.records.text_tables import Row, aligned_lines
from skyarm.scenario.controller_table import is_gains_file
from skyarm.scenario.scenario_file import load_scenario
from skyarm.scenario.scenario_record import Scenario as Record

if TYPE_CHECKING:
    from skyarm.studies.stability.along import Evidence, Instant, Locus
    from skyarm.studies.stability.disk_margins import LoopMargin

GAINS = {"rotor_gain": "rotors", "joint_gain": "joints"}
"""Field of the margins -> head of its column."""

NOTE = """\
max |z|: spectral radius; slowest: largest real part of a rate, 1/s; delay:
further dead time it bears, ms; rotors, joints: factors on the actuators'
effect it bears, common to all of them. The worse of two linearisations, with
the rotors' time constant upward and with that downward. Instants along a
flight are frozen in time, and no proof that it is stable."""

LOOP_HEAD = ("weakest loop", "disk", "gain", "phase", "rad/s", "delay", "together")

LOOP_NOTE = """\
disk: symmetric disk margin, from 0 (unstable) to 2; gain, phase (deg): what a
loop bears by it, the others as they are; rad/s: where it is most delicate;
delay: dead time of this loop alone that it bears, ms; together: disk margin
of all loops of its kind, each under a factor of its own. The smallest of all
instants."""

GROUPS_ALONE = ("all commands", "all measurements")

MOST_INSTANTS = 10_000
"""Along a flight: each takes about half a second."""

Safety = Annotated[bool, typer.Option("--safety", help="with the safety layer")]


def margins(
    scenario: Scenario,
    laws: Laws = None,
    instants: Annotated[int, typer.Option(help="looked at along the scenario, beside hover")] = 4,
    safety: Safety = False,
    file: Annotated[str | None, out_option("write eigenvalues and margins there, as JSON")] = None,
    page: Annotated[
        str | None, typer.Option("--html", metavar="PAGE", help="write a page with Nyquist diagrams there, too (.html)")
    ] = None,
) -> None:
    """Linearise the closed loop: eigenvalues, margins.

    In hover and along the scenario: delay and gain of the actuators, disk margins of every loop, alone and together.
    Exit code 3 if the flight ended before its time.
    """
    from skyarm.studies.stability.along import evidence
    from skyarm.studies.stability.frozen_scenario import without_adaptation

    planned = _prepare(scenario, one_law(laws), safety=safety)
    require_within("--instants", instants, 0, MOST_INSTANTS)
    frozen = without_adaptation(planned)
    with taken_back(*(Path(each).parent for each in (file, page) if each)):
        written = None if file is None else output_file(file, "--out", ".json")
        drawn = None if page is None else output_file(page, "--html", ".html")
        with bar(planned.name) as advance:
            found = evidence(frozen, instants, lambda done, total: advance(done, total, "instants"))
    tell(heading(f"{found.controller} in {found.scenario}"))
    tell(
        *aligned_lines([("at", "max |z|", "slowest", "damping", "delay", *GAINS.values()), *map(_row, found.instants)])
    )
    tell(NOTE)
    if found.instants:
        least = min(each.swings for each in found.instants)
        tolerated = "more than 100" if math.isinf(least) else _number(1e3 * least)
        tell(f"small swings grow in flight from {tolerated} ms of further dead time on")
    tell("", *aligned_lines(loop_rows(found, every=False)), LOOP_NOTE)
    if frozen is not planned:
        tell("the law's slow adaptation of load and friction is held")
    if found.left_out:
        tell(f"disturbances are left out: {', '.join(found.left_out)}")
    if planned.changes:
        tell("changes in flight are left out: these are the margins of the scenario as it begins")
    if not found.completed:
        tell("the flight ended before its time: no instants beyond")
    document = {"schema": 1, **plain(found), **plugin_facts()}
    give(document, **({} if drawn is None else {"page": drawn}))
    if drawn is not None:
        from skyarm.studies.stability.along import hover_loci

        with bar("Nyquist diagrams"):
            write_atomically(drawn, margins_page(found, hover_loci(planned)).encode())
        tell(f"page: {drawn}")
    if written is not None:
        tell(f"written: {write_json(written, document)}")
    if not found.completed:
        raise typer.Exit(NOT_COMPLETED)


def _prepare(scenario: str, controller: str | None, *, safety: bool) -> Record:
    """Load a scenario for the margins, if requested with another controller or the safety layer.

    Raises:
        ValueError: one line.
    """
    if controller is not None and not is_named(controller) and not is_gains_file(controller):
        raise ValueError(f"controller = {shown(controller)}: {must_be_named(controller)}")
    require_not_another(scenario, "scenario")
    loaded = load_scenario(scenario, controller=controller)
    say_suspicious(loaded)
    if not safety or isinstance(loaded.controller.par, SafetyParameters):
        return loaded
    return loaded.with_controller(with_safety_layer(loaded.controller))


def _row(each: Instant) -> Row:
    """Make the table row of eigenvalues and stability margins at one instant."""
    rates = [s for m in each.by_lag.values() for s in m.s]
    return (
        "hover" if each.hover else f"{each.time:.2f} s",
        f"{each.radius:.6f}",
        f"{max((s.real for s in rates), default=-math.inf):.3g}",
        f"{min((-s.real / abs(s) for s in rates if s.imag != 0.0 and abs(s) > 0.0), default=1.0):.2f}",
        _number(1e3 * each.delay),
        *("-".join(_factor(k) for k in each.gain(field)) for field in GAINS),
    )


def _factor(value: float) -> str:
    """Format a gain margin in at most four characters."""
    if math.isinf(value):
        return "none"
    return f"{value:.0f}" if value >= 99.95 else f"{value:.1f}" if value >= 9.995 else f"{value:.2f}"


def _number(value: float) -> str:
    return "none" if math.isinf(value) else f"{value:.3g}"


def loop_rows(found: Evidence, *, every: bool) -> list[Row]:
    """Make the table rows of disk margins: the weakest loop of each group, or every loop.

    Args:
        found: evidence of :func:`skyarm.studies.stability.along.evidence`.
        every: every loop in place of the weakest of each group.
    """
    margins = [m for instant in found.instants for m in instant.by_lag.values()]
    alone = _smallest(each for m in margins for each in m.loops)
    several = _smallest(each for m in margins for each in m.together)
    rows: list[Row] = [LOOP_HEAD if not every else ("loop", *LOOP_HEAD[1:])]
    for group in dict.fromkeys(each.group for each in alone.values()):
        members = [each for each in alone.values() if each.group == group]
        listed = members if every else [min(members, key=lambda each: float(each.disk))]
        together = f"{several[group].disk:.2f}" if group in several else ""
        rows += [(*_cells(each), together if each is listed[-1] else "") for each in listed]
    return rows + [(*_cells(several[name]), f"{several[name].disk:.2f}") for name in GROUPS_ALONE if name in several]


def _smallest(found: Iterable[LoopMargin]) -> dict[str, LoopMargin]:
    """Keep the smallest disk margin of each loop over all instants, by the loop's name."""
    least: dict[str, LoopMargin] = {}
    for each in found:
        if each.name not in least or each.disk < least[each.name].disk:
            least[each.name] = each
    return least


def _cells(each: LoopMargin) -> Row:
    low, high = each.gain
    gain = f"{low:.2f}-" + ("none" if math.isinf(high) else f"{high:.2f}" if high < 10.0 else f"{high:.1f}")
    frequency = "-" if math.isnan(each.frequency) else f"{each.frequency:.1f}"
    delay = "none" if math.isinf(each.delay) else f"{1e3 * each.delay:.1f}"
    return each.name, f"{each.disk:.2f}", gain, f"{math.degrees(each.phase):.0f}", frequency, delay


WORDS = (
    "<p>The disk margin is how far gain and phase of a loop may change together, from 0 (unstable) to 2: gain and "
    "phase (degrees) are what it leaves of each alone, rad/s is where the loop is most delicate, delay the dead time "
    "(ms) that this loop alone bears, together the disk margin of all loops of its kind under factors of their own. "
    "Each number is the smallest of all instants.</p>"
)

CAPTION = (
    "The weakest loop of each kind in hover, cut one at a time, the others closed; dashed: negative frequencies. The "
    "curve stays out of the red disk around -1 (a half plane at a margin of 2), and touches it at the frequency said."
)


def margins_page(found: Evidence, loci: Sequence[Locus]) -> str:
    """Make the HTML page of margins: Nyquist diagrams in hover, and a table of every loop.

    Args:
        found: of :func:`skyarm.studies.stability.along.evidence`.
        loci: of :func:`skyarm.studies.stability.along.hover_loci`.
    """
    from skyarm.studies.stability.nyquist_figure import nyquist_figure
    from skyarm.view.figures.style import image_bytes
    from skyarm.view.pages import image, page, section, table

    body = ""
    if loci:
        names = "; ".join(f"{each.margin.name} {each.margin.disk:.2f}" for each in loci)
        picture = image_bytes(nyquist_figure(loci), dpi=150)
        body += section("Loops in hover", image(f"Nyquist diagrams: {names}", CAPTION, picture, wide=True))
    head, *rows = loop_rows(found, every=True)
    body += section("Every loop", WORDS + table([head[0], *(f">{name}" for name in head[1:])], rows))
    facts = "the loop is lost in hover"
    if found.instants:
        delay, swings = (min(getattr(each, name) for each in found.instants) for name in ("delay", "swings"))
        facts = f"delay margin {1e3 * delay:.3g} ms; small swings grow from {1e3 * swings:.3g} ms on"
        facts += f"; instants: {len(found.instants)}"
    if found.left_out:
        facts += f"; disturbances are left out: {', '.join(found.left_out)}"
    return page(f"Margins of {found.controller} in {found.scenario}", facts, body)
