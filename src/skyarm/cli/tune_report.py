"""What ``skyarm tune`` says of its front: tables for a terminal, plain data for ``--json``."""

from __future__ import annotations

from typing import Any

from rich.console import Console
from rich.text import Text

from skyarm.cli.lines import say
from skyarm.cli.terminal_tables import aligned
from skyarm.registry.plugins import identities


def print_front(found: Any, console: Console, seconds: float) -> None:
    """Print the front, then what the pick and the starts do on plants and a path kept aside."""
    from skyarm.tune.tune_page import error_words
    from skyarm.tune.tuning import ASIDE

    vehicle = found.plan.flight.world.vehicle
    error = error_words(vehicle)
    rows: list[tuple[str, ...]] = [("", error, "jitter", "effort", "lost", "saturated", "delay", "rotors", "joints")]
    for i, point in enumerate((found.before, *found.points)):
        mark = "before" if i == 0 else "pick" if i - 1 == found.picked else ""
        rows.append(
            (
                mark,
                f"{1e3 * point.tip:.3g} mm",
                f"{point.jitter:.3g}",
                f"{point.effort:.3g}",
                f"{point.lost:.0%}",
                f"{point.saturated:.1%}",
                *_margins(point.margins),
            )
        )
    plan = found.plan
    console.print(Text(f"{plan.label} for {plan.flight.world.vehicle.name}, from calm to stiff", style="bold"))
    if not vehicle.n:  # nothing of joints that there are not
        rows = [(*row[:3], *row[4:-1]) for row in rows]
    for line in aligned(rows):
        console.print(line, soft_wrap=True)
    console.print(
        f"{plan.effort.candidates} candidates on {plan.effort.plants} wrong plants, the front on {plan.unseen} others: "
        f"{seconds:.0f} s",
        soft_wrap=True,
    )
    console.print(f"on {ASIDE} plants and a path by which nothing was chosen:")
    aside = [
        (name, f"{1e3 * x.tip:.3g} mm", f"{x.jitter:.3g}", f"{x.lost:.1%}", "yes" if x.meets else "no")
        for name, x in found.aside.items()
    ]
    for line in aligned([("", error, "jitter", "lost", "meets all"), *aside]):
        console.print(line, soft_wrap=True)
    if found.pick.margins.why_none:
        say(f"margins are not asked for: {found.pick.margins.why_none}")
    if not found.meets:
        say("no point meets all constraints; the pick is the one that is least short of them")


def _margins(margins: Any) -> tuple[str, str, str]:
    """Delay and factors in cells; dashes where there are none."""
    if margins.why_none:
        return "-", "-", "-"
    rotors, joints = ("-".join(f"{k:.2f}" for k in pair) for pair in (margins.rotors, margins.joints))
    return f"{1e3 * margins.delay:.3g} ms", rotors, joints


def plain_tuning(found: Any) -> dict[str, Any]:
    """What a tuning found, as plain data."""
    from skyarm.tune.tune_page import about, gains_of, plain_aside, plain_point

    return {
        "controller": found.plan.label,
        "scenario": found.plan.check.name,
        "about": about(found),
        "before": plain_point(found.before),
        "front": [plain_point(point) | {"gains": gains_of(found, point)} for point in found.points],
        "picked": found.picked,
        "aside": {name: plain_aside(each) for name, each in found.aside.items()},
        "meets_constraints": found.meets,
        "required": {"delay_margin_s": found.required.delay, "gain_margin": found.required.gain},
    } | ({"plugins": identities()} if identities() else {})
