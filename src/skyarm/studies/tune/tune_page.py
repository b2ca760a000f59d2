"""Results of a tuning: gain files for scenarios, lines of text, and a page with a
slider over control effort.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from importlib import resources

from skyarm.records.files.toml import toml_key, toml_value
from skyarm.records.identity import identity
from skyarm.records.leaves import part, parts, walk
from skyarm.records.text_tables import Row, aligned_lines
from skyarm.studies.tune.front import RULE, LoopMargins, Point
from skyarm.studies.tune.tuning import Tuning, Validation
from skyarm.view.pages import Facts, render_template
from skyarm.view.pages import page as plain_page

DIGITS = 6
"""Number of significant digits of a gain in a file."""


GROUPS = {
    "pull error": "pull",
    "effort": "effort",
    "delay": "margins",
    "rotors": "margins",
    "joints": "joints",
}
"""Head of a column that not every table has -> group of columns that it is of."""


def front_name(number: int) -> str:
    """File name of a set of gains of the Pareto front, numbered from low to high
    control effort.
    """
    return f"front_{number + 1}.toml"


def gains_of(tuning: Tuning, point: Point) -> dict[str, float | list[float]]:
    """Gains of one set of the Pareto front, as in a gain file: parameter path -> value
    or list.
    """
    subject, flight = tuning.plan.subject, tuning.plan.flight
    tuned, below = subject.constants(tuning.under(flight, point))
    gains: dict[str, float | list[float]] = {}
    for knob in tuning.plan.knobs:
        place = (*below, *knob.path.split("."))
        values = [
            _short(float(value))
            for _, value in walk(part(tuned, place), place)
            if isinstance(value, float)
        ]
        # equal numbers, as of all axes, are stated as one
        gains[knob.path] = values[0] if len(set(values)) == 1 else values
    return gains


def gains_text(tuning: Tuning, point: Point, law: Facts, kept: Facts) -> str:
    """Text of a TOML file of tuned gains, with their origin.

    Args:
        tuning: result.
        point: point of its front.
        law: facts of the law, for [law].
        kept: gains that stood in the file before and are no knobs.
    """
    plan = tuning.plan
    gains = {**kept, **gains_of(tuning, point)}
    before = gains_of(tuning, tuning.before)
    units = {knob.path: knob.unit for knob in plan.knobs}
    lines = [
        (
            f"# Gains of {plan.label} for {plan.subject.title(plan.flight)}, written by"
            " skyarm tune."
        ),
        (
            '# In a scenario: [controller] tuned = "THIS FILE"; on a command line:'
            " --laws THIS FILE"
        ),
        "schema = 1",
        *_table("law", law),
        "",
        "[gains]",
    ]
    for path, value in gains.items():
        note = (
            f"    # {units[path]}, was {toml_value(before[path])}"
            if path in units
            else ""
        )
        # a gain without a unit has no comma
        lines.append(
            f"{toml_key(path)} = {toml_value(value)}{note.replace('# , was', '# was')}"
        )
    lines += _table("about", about(tuning))
    lines += _table("about.before", plain_point(tuning, tuning.before))
    lines += _table("about.after", plain_point(tuning, point))
    for name, each in tuning.aside.items():
        lines += _table(f"about.aside.{toml_key(name)}", plain_aside(tuning, each))
    lines += _table("about.required", plain_required(tuning))
    return "\n".join(lines) + "\n"


def about(tuning: Tuning) -> Facts:
    """Origin of the tuned gains: scenario, vehicle, digests and search settings, as
    plain data.
    """
    plan = tuning.plan
    return {
        **plan.facts(),
        "scenario": plan.check.name,
        **plan.subject.origin(plan.flight),
        "flight_digest": identity(plan.flight),
        "candidates": plan.effort.candidates,
        "unseen_plants": plan.stages.unseen,
        "share_of_usual_payload_and_wind": _short(tuning.plants.eased),
        "rule": rule_words(tuning),
    }


def rule_words(tuning: Tuning) -> str:
    """Rule of the pick, in words of what was tuned."""
    return RULE.replace("tip error", tuning.plan.subject.error(tuning.plan.flight))


def plain_point(tuning: Tuning, point: Point) -> dict[str, float | str]:
    """Scores and margins of one set of gains, as plain data."""
    return _scores(tuning, point) | plain_margins(point.margins)


def plain_aside(tuning: Tuning, aside: Validation) -> dict[str, float | str | bool]:
    """Scores of gains on validation plants, as plain data."""
    return {**_scores(tuning, aside), "meets_constraints": aside.meets}


def _scores(tuning: Tuning, scored: Point | Validation) -> dict[str, float | str]:
    """Scores that the subject of a tuning has, by their names in files."""
    names = tuning.plan.subject.score_names
    numbers = parts(scored)
    return {
        names[name]: _short(float(numbers[name])) for name in names if name in numbers
    }


def plain_margins(margins: LoopMargins) -> dict[str, float | str]:
    """Stability margins as plain data; margins beyond the examined range are
    omitted.
    """
    if margins.why_none:
        return {"no_margins": margins.why_none}
    stated = {"delay_margin_s": margins.delay}
    for name, pair in (("rotor", margins.rotors), ("joint", margins.joints)):
        stated[f"{name}_gain_least"], stated[f"{name}_gain_most"] = pair
    # a factor of 0 or without end is one beyond those that were looked at
    return {
        name: _short(value)
        for name, value in stated.items()
        if math.isfinite(value) and (value > 0.0 or name == "delay_margin_s")
    }


def _table(head: str, values: Facts) -> Sequence[str]:
    return [
        "",
        f"[{head}]",
        *(f"{toml_key(name)} = {toml_value(value)}" for name, value in values.items()),
    ]


def _short(value: float) -> float:
    return float(f"{value:.{DIGITS}g}")


def tune_page(found: Tuning) -> str:
    """HTML page of a tuning's results, in one self-contained file."""
    plan, subject = found.plan, found.plan.subject
    facts = (
        f"{plan.effort.candidates} candidates on {plan.effort.plants} perturbed plants;"
        f" the front on {plan.stages.unseen} plants that the search did not use; seed"
        f" {plan.seed}"
    )
    body = render_template(
        "studies/tune/tune.html",
        found=found,
        rule=rule_words(found),
        style=(resources.files("skyarm.studies.tune") / "tune_page.css").read_text(
            "utf-8"
        ),
        error=subject.error(plan.flight),
        columns=subject.columns(plan.flight),
        table="gains" if subject.has_gains_file else "team",
        after=subject.after,
        gains=[gains_of(found, point) for point in found.points],
        before=gains_of(found, found.before),
        units={knob.path: knob.unit for knob in plan.knobs},
        aside=plan.stages.aside,
        inf=math.inf,
        text=toml_value,
        key=toml_key,
    )
    return plain_page(f"{plan.label} for {subject.title(plan.flight)}", facts, body)


def front_lines(found: Tuning, seconds: float) -> list[str]:
    """Lines of text with the Pareto front of a tuning, and a check on plants and a path
    not used for tuning.

    Args:
        found: result.
        seconds: duration of the tuning, s.
    """
    plan, subject = found.plan, found.plan.subject
    error, columns = subject.error(plan.flight), subject.columns(plan.flight)
    absent = {name for name, group in GROUPS.items() if group not in columns}
    head: Row = (
        "",
        error,
        "pull error",
        "jitter",
        "effort",
        "lost",
        "saturated",
        "delay",
        "rotors",
        "joints",
    )
    rows = list[Row]()
    for i, point in enumerate((found.before, *found.points)):
        mark = "before" if i == 0 else "pick" if i - 1 == found.picked else ""
        numbers = (
            f"{point.jitter:.3g}",
            f"{point.effort:.3g}",
            f"{point.lost:.0%}",
            f"{point.saturated:.1%}",
        )
        rows.append((mark, *_errors(point), *numbers, *_margins(point.margins)))
    aside = [
        (
            name,
            *_errors(x),
            f"{x.jitter:.3g}",
            f"{x.lost:.1%}",
            "yes" if x.meets else "no",
        )
        for name, x in found.aside.items()
    ]
    return [
        f"{plan.label} for {subject.title(plan.flight)}, from calm to stiff",
        *aligned_lines(_without(absent, [head, *rows])),
        (
            f"{plan.effort.candidates} candidates on {plan.effort.plants} perturbed"
            f" plants, the front on {plan.stages.unseen} others: {seconds:.0f} s"
        ),
        f"on {plan.stages.aside} {subject.after}:",
        *aligned_lines(
            _without(
                absent,
                [("", error, "pull error", "jitter", "lost", "meets all"), *aside],
            )
        ),
    ]


def _without(absent: Collection[str], rows: Sequence[Row]) -> list[Row]:
    """Rows without the columns of some heads; the first row has the heads."""
    return [
        tuple(
            cell for name, cell in zip(rows[0], row, strict=True) if name not in absent
        )
        for row in rows
    ]


def _errors(scored: Point | Validation) -> tuple[str, str]:
    """Format the error and the pull for a table row."""
    return f"{1e3 * scored.tip:.3g} mm", f"{scored.pull:.3g} N"


def _margins(margins: LoopMargins) -> tuple[str, str, str]:
    """Format delay and gain margins for a table row; dashes if they are missing."""
    if margins.why_none:
        return "-", "-", "-"
    rotors, joints = (
        "-".join(f"{k:.2f}" for k in pair) for pair in (margins.rotors, margins.joints)
    )
    return f"{1e3 * margins.delay:.3g} ms", rotors, joints


def plain_tuning(found: Tuning) -> Facts:
    """Result of a tuning as plain data."""
    return {
        "controller": found.plan.label,
        "scenario": found.plan.check.name,
        "about": about(found),
        "before": plain_point(found, found.before),
        "front": [
            plain_point(found, point) | {"gains": gains_of(found, point)}
            for point in found.points
        ],
        "picked": found.picked,
        "aside": {name: plain_aside(found, each) for name, each in found.aside.items()},
        "meets_constraints": found.meets,
        "required": plain_required(found),
    }


def plain_required(found: Tuning) -> dict[str, float]:
    """Margins that the gains must have, as plain data."""
    if "margins" not in found.plan.subject.columns(found.plan.flight):
        return {}
    return {"delay_margin_s": found.required.delay, "gain_margin": found.required.gain}
