"""The page of a tuning: a slider from calm to stiff, and for each of its stops scores, margins and gains.

The slider is a row of radio buttons, so that the page needs no script and the arrow keys move it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from html import escape
from importlib import resources

from skyarm.files.toml import toml_key, toml_value
from skyarm.pages import page as plain_page
from skyarm.pages import section, table
from skyarm.tune.front import RULE, LoopMargins, Point
from skyarm.tune.front_plot import front_plot, short_words
from skyarm.tune.gains_result import front_name, gains_of
from skyarm.tune.tuning_records import ASIDE, Tuning
from skyarm.vehicle.vehicle_records import Vehicle

CHOSEN = """#stop{i}:checked ~ .panels .panel{i} {{ display: block; }}
#stop{i}:checked ~ .stops .at{i} i {{ background: var(--accent); border-color: var(--accent); }}
#stop{i}:focus-visible ~ .stops .at{i} i {{ outline: 2px solid var(--ink); outline-offset: 2px; }}
#stop{i}:checked ~ figure .point{i} {{ fill: var(--accent); r: 8; }}"""


def tune_page(found: Tuning) -> str:
    """HTML of what a tuning found; one file that needs nothing else."""
    count = len(found.points)
    style = (resources.files("skyarm.tune") / "tune_page.css").read_text("utf-8")
    style = f"<style>\n{style}" + "\n".join(CHOSEN.format(i=i) for i in range(count)) + "\n</style>"
    inputs = "".join(
        f'<input class="stop" type="radio" name="stop" id="stop{i}" aria-label="stop {i + 1} of {count}, calm to stiff"'
        f"{' checked' if i == found.picked else ''}>"
        for i in range(count)
    )
    labels = "".join(
        f'<label for="stop{i}" class="at{i}{" picked" if i == found.picked else ""}" title="{short_words(point)}">'
        "<i></i></label>"
        for i, point in enumerate(found.points)
    )
    panels = "".join(f'<div class="panel panel{i}">{_panel(found, i)}</div>' for i in range(count))
    slider = (
        f'{style}{inputs}<div class="ends"><span>calm</span><span>stiff</span></div>'
        f'<div class="stops" role="presentation">{labels}</div>'
        f'{front_plot(found.before, found.points)}<div class="panels">{panels}</div>'
    )
    plan = found.plan
    facts = (
        f"{plan.effort.candidates} candidates on {plan.effort.plants} wrong plants; the front on {plan.unseen} plants "
        f"that the search has not seen; seed {plan.seed}"
    )
    rule = escape(RULE.replace("tip error", error_words(_vehicle(found))))
    short = "" if found.meets else " No point meets all: the pick is the least short."
    rule = f"<p>Picked is {rule}.{short}</p>"
    body = section("From calm to stiff", rule + slider) + section("All stops", _all(found))
    body += section("Plants and a path by which nothing was chosen", _aside(found))
    return plain_page(f"{plan.label} for {plan.flight.world.vehicle.name}", facts, body)


def _panel(found: Tuning, number: int) -> str:
    """Scores, margins and gains of a stop."""
    point, before = found.points[number], found.before
    rows = [[name, value(before), value(point)] for name, value in shown(_vehicle(found))]
    scores = table(["", ">before", ">at this stop"], rows)
    old, new = gains_of(found, before), gains_of(found, point)
    units = {knob.path: knob.unit for knob in found.plan.knobs}
    gains = table(
        ["gain", "unit", ">before", ">at this stop"],
        [[path, units[path], toml_value(old[path]), toml_value(value)] for path, value in new.items()],
    )
    lines = "\n".join(f"{toml_key(path)} = {toml_value(value)}" for path, value in new.items())
    mark = " (picked)" if number == found.picked else ""
    return (
        f"<h3>Stop {number + 1} of {len(found.points)}{mark}: {escape(front_name(number))}</h3>{scores}{gains}"
        f"<pre>[gains]\n{escape(lines)}</pre>"
    )


def _delay(margins: LoopMargins) -> str:
    return "-" if margins.why_none else "over 100" if math.isinf(margins.delay) else f"{1e3 * margins.delay:.3g}"


def _gains(margins: LoopMargins, pair: tuple[float, float]) -> str:
    if margins.why_none:
        return "-"
    return " to ".join("none" if k in (0.0, math.inf) else f"{k:.2f}" for k in pair)


def error_words(vehicle: Vehicle) -> str:
    """What the error of a flight is called: of the tip, or of the base where there is no tip."""
    return "tip error" if vehicle.end_effector else "base error"


def shown(vehicle: Vehicle) -> list[tuple[str, Callable[[Point], str]]]:
    """What a stop shows of a vehicle: words, and how the number is written; nothing of joints that it has not."""
    found: list[tuple[str, Callable[[Point], str]]] = [
        (f"{error_words(vehicle)}, 90 % of plants, mm", lambda p: f"{1e3 * p.tip:.3g}"),
        ("error that is tuned, mm", lambda p: f"{1e3 * p.error:.3g}"),
        ("rotor jitter, rad/s per period", lambda p: f"{p.jitter:.3g}"),
        ("joint efforts, RMS", lambda p: f"{p.effort:.3g}"),
        ("plants lost", lambda p: f"{p.lost:.0%}"),
        ("rotor commands at their limit", lambda p: f"{p.saturated:.1%}"),
        ("delay margin, ms", lambda p: _delay(p.margins)),
        ("gain margin of the rotors", lambda p: _gains(p.margins, p.margins.rotors)),
        ("gain margin of the joints", lambda p: _gains(p.margins, p.margins.joints)),
    ]
    return [each for each in found if vehicle.n or "joint" not in each[0]]


def _vehicle(found: Tuning) -> Vehicle:
    return found.plan.flight.world.vehicle


def _all(found: Tuning) -> str:
    joints, rows = bool(_vehicle(found).n), []
    for i, point in enumerate((found.before, *found.points)):
        name = "before" if i == 0 else f"stop {i}" + (", picked" if i - 1 == found.picked else "")
        margins = point.margins
        efforts = [f"{point.effort:.3g}"] * joints
        row = [name, f"{1e3 * point.tip:.3g}", f"{point.jitter:.3g}", *efforts, f"{point.lost:.0%}"]
        rows.append([*row, _delay(margins), _gains(margins, margins.rotors)])
        rows[-1] += [_gains(margins, margins.joints)] * joints
    error = error_words(_vehicle(found)).removesuffix(" error")
    head = ["", f">{error}, mm", ">jitter, rad/s", *([">effort"] * joints), ">lost", ">delay margin, ms", ">rotors"]
    return table([*head, *([">joints"] * joints)], rows)


def _aside(found: Tuning) -> str:
    """The pick beside all gains that were known before."""
    rows = [
        [name, f"{1e3 * x.tip:.3g}", f"{x.jitter:.3g}", f"{x.lost:.1%}", "yes" if x.meets else "no"]
        for name, x in found.aside.items()
    ]
    error = f">{error_words(_vehicle(found))}, 90 % of plants, mm"
    told = table(["", error, ">jitter, rad/s", ">lost", "meets all constraints"], rows)
    return f"<p>{ASIDE} plants.</p>{told}"
