"""Results of a tuning: files of gains that scenarios name, and a page with a slider from calm to stiff.

The slider is a row of radio buttons, so that the page needs no script and the arrow keys move it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from html import escape
from importlib import resources
from typing import Any

from skyarm.control.catalogue import PRESETS, TUNED
from skyarm.files.toml import toml_key, toml_value
from skyarm.pages import page as plain_page
from skyarm.pages import section, table
from skyarm.records.identity import identity
from skyarm.records.leaves import part, walk
from skyarm.tune.front import RULE, LoopMargins, Point
from skyarm.tune.hover_margins import with_gains
from skyarm.tune.law_knobs import inner_place
from skyarm.tune.tuning import ASIDE, Aside, Tuning
from skyarm.vehicle.vehicle_records import Vehicle

DIGITS = 6
"""Of a gain in a file."""


def front_name(number: int) -> str:
    """File of a point of the front, counted from calm to stiff."""
    return f"front_{number + 1}.toml"


def words_of(name: str) -> dict[str, Any]:
    """What a [law] table says of a controller by its name in the catalogue."""
    if name in PRESETS:
        return {"preset": name}
    return {"law": name.removesuffix(TUNED), "tuned": True} if name.endswith(TUNED) else {"law": name}


def gains_of(tuning: Tuning, point: Point) -> dict[str, float | list[float]]:
    """The numbers below the path of every knob, as a file of gains has them."""
    controller = tuning.plan.flight.controller
    tuned = with_gains(controller, tuning.plan.knobs, point.logs)
    below, found = inner_place(controller), {}
    for knob in tuning.plan.knobs:
        place = (*below, *knob.path.split("."))
        values = [_short(float(value)) for _, value in walk(part(tuned.par, place), place) if isinstance(value, float)]
        found[knob.path] = values[0] if len(set(values)) == 1 else values
    return found


def gains_text(tuning: Tuning, point: Point, words: Mapping[str, Any], kept: Mapping[str, Any]) -> str:
    """A file of gains.

    Args:
        tuning: what was found.
        point: of its front.
        words: of the law, for [law].
        kept: gains that stood in the file before and are no knobs.
    """
    plan = tuning.plan
    gains = {**kept, **gains_of(tuning, point)}
    before = gains_of(tuning, tuning.before)
    units = {knob.path: knob.unit for knob in plan.knobs}
    lines = [
        f"# Gains of {plan.label} for {plan.flight.plant.vehicle.name}, written by skyarm tune.",
        '# In a scenario: [controller] tuned = "THIS FILE"; on a command line: --controller THIS FILE',
        "schema = 1",
        *_table("law", words),
        "",
        "[gains]",
    ]
    for path, value in gains.items():
        note = f"    # {units[path]}, was {toml_value(before[path])}" if path in units else ""
        lines.append(f"{toml_key(path)} = {toml_value(value)}{note.replace('# , was', '# was')}")
    lines += _table("about", about(tuning))
    lines += _table("about.before", plain_point(tuning.before))
    lines += _table("about.after", plain_point(point))
    for name, each in tuning.aside.items():
        lines += _table(f"about.aside.{toml_key(name)}", plain_aside(each))
    lines += _table("about.required", {"delay_margin_s": tuning.required.delay, "gain_margin": tuning.required.gain})
    return "\n".join(lines) + "\n"


def about(tuning: Tuning) -> dict[str, Any]:
    """Where the gains come from."""
    plan = tuning.plan
    return {
        **{name: value for name, value in plan.facts().items() if name not in ("knobs", "flight", "own", "law")},
        "scenario": plan.check.name,
        "vehicle": plan.flight.plant.vehicle.name,
        "vehicle_digest": identity(plan.flight.plant.vehicle),
        "belief_digest": identity(plan.flight.controller.par.model.vehicle),
        "flight_digest": identity(plan.flight),
        "candidates": plan.effort.candidates,
        "unseen_plants": plan.unseen,
        "share_of_usual_payload_and_wind": _short(tuning.plants.eased),
        "rule": RULE,
    }


def plain_point(point: Point) -> dict[str, Any]:
    """Scores and margins of a point."""
    return {
        "error_m": _short(point.error),
        "tip_m": _short(point.tip),
        "jitter_rad_s": _short(point.jitter),
        "effort": _short(point.effort),
        "lost": _short(point.lost),
        "saturated": _short(point.saturated),
        **plain_margins(point.margins),
    }


def plain_aside(aside: Aside) -> dict[str, float | bool]:
    """Scores on plants and a path by which nothing was chosen."""
    scores = {"tip_m": aside.tip, "jitter_rad_s": aside.jitter, "lost": aside.lost}
    return {**{name: _short(value) for name, value in scores.items()}, "meets_constraints": aside.meets}


def plain_margins(margins: LoopMargins) -> dict[str, Any]:
    """Margins; what is beyond all that is looked at is left out."""
    if margins.why_none:
        return {"no_margins": margins.why_none}
    delay = {"delay_margin_s": _short(margins.delay)} if math.isfinite(margins.delay) else {}
    return delay | {
        f"{name}_gain_{side}": _short(value)
        for name, pair in (("rotor", margins.rotors), ("joint", margins.joints))
        for side, value in zip(("least", "most"), pair, strict=True)
        if math.isfinite(value) and value > 0.0
    }


def _table(head: str, values: Mapping[str, Any]) -> Sequence[str]:
    return ["", f"[{head}]", *(f"{toml_key(name)} = {toml_value(value)}" for name, value in values.items())]


def _short(value: float) -> float:
    return float(f"{value:.{DIGITS}g}")


WIDTH, HEIGHT, EDGE = 640.0, 300.0, 56.0
"""Of the plot, and its margin: units of the SVG."""


def short_words(point: Point) -> str:
    """A point in a few words."""
    return escape(f"tip {1e3 * point.tip:.3g} mm, jitter {point.jitter:.3g} rad/s")


def front_plot(before: Point, front: Sequence[Point]) -> str:
    """Error over jitter, both on logarithmic axes; each point of the front has a class of its number."""
    points = (before, *front)
    across = [math.log10(max(point.jitter, 1e-6)) for point in points]
    up = [math.log10(max(1e3 * point.error, 1e-6)) for point in points]
    x, y = _axis(across, EDGE, WIDTH - 16.0), _axis(up, HEIGHT - 40.0, 16.0)
    dots = [(x(a), y(b)) for a, b in zip(across, up, strict=True)]
    line = " ".join(f"{a:.1f},{b:.1f}" for a, b in dots[1:])
    circles = "".join(
        f'<circle class="point{i}" cx="{a:.1f}" cy="{b:.1f}" r="5"><title>{short_words(front[i])}</title></circle>'
        for i, (a, b) in enumerate(dots[1:])
    )
    a, b = dots[0]
    ends = "".join(
        f'<text x="{x(value):.1f}" y="{HEIGHT - 22:.1f}" text-anchor="{anchor}">{10**value:.2g}</text>'
        for value, anchor in ((min(across), "start"), (max(across), "end"))
    ) + "".join(
        f'<text x="{EDGE - 6:.1f}" y="{y(value) + 4:.1f}" text-anchor="end">{10**value:.3g}</text>'
        for value in (min(up), max(up))
    )
    return (
        f'<figure class="wide"><svg viewBox="0 0 {WIDTH:.0f} {HEIGHT:.0f}" role="img" aria-label="error over jitter">'
        f'<line class="axis" x1="{EDGE}" y1="{HEIGHT - 40}" x2="{WIDTH - 16}" y2="{HEIGHT - 40}"/>'
        f'<line class="axis" x1="{EDGE}" y1="16" x2="{EDGE}" y2="{HEIGHT - 40}"/>{ends}'
        f'<text x="{WIDTH / 2:.0f}" y="{HEIGHT - 4:.0f}" text-anchor="middle">rotor jitter, rad/s per period</text>'
        f'<text x="{EDGE + 6:.0f}" y="14">error, mm</text><polyline points="{line}"/>{circles}'
        f'<circle class="before" cx="{a:.1f}" cy="{b:.1f}" r="6">'
        f"<title>before: {short_words(before)}</title></circle>"
        f"</svg><figcaption>Both axes are logarithmic; the ring is the law as it was before.</figcaption></figure>"
    )


def _axis(values: list[float], low: float, high: float) -> Callable[[float], float]:
    """From a value to its place, with some room at both ends."""
    first, last = min(values), max(values)
    width = max(last - first, 1e-6)
    return lambda value: low + (high - low) * (0.04 + 0.92 * (value - first) / width)


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
    return plain_page(f"{plan.label} for {plan.flight.plant.vehicle.name}", facts, body)


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
    return found.plan.flight.plant.vehicle


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
