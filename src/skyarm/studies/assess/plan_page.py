"""Page of a plan: what is tight, the moving vehicle, and the limits over time."""

from __future__ import annotations

import math
from collections.abc import Iterator

from skyarm.planning.plan_report import PlanSummary, summary, summary_lines
from skyarm.planning.planner import Plan
from skyarm.planning.task import TaskLimits
from skyarm.view.figures.plan_figure import limits_figure, motion_figure, motion_frames
from skyarm.view.figures.style import image_bytes
from skyarm.view.film.video_files import webp_bytes
from skyarm.view.pages import image, page, paragraph, section, table

FRAMES = 20
"""Rate (Hz) of the moving picture, which is drawn in the time of the flight."""


def plan_page(plan: Plan) -> str:
    """Make the HTML page of a plan."""
    found = summary(plan)
    first, *_, last = summary_lines(plan.task.name, found)
    # no phase begins at the last edge, the end of the flight
    phases = [
        (f"{k}", name, f"{begin:.3f}", f"{length:.3f}")
        for k, ((name, length), begin) in enumerate(
            zip(found.phases, plan.t[list(plan.edges)], strict=False)
        )
    ]
    head = ["", ">largest", ">limit", ">of the limit", "where and when"]
    body = section(
        "What is tight",
        table(head, [*_rows(found, plan.task.limits)]) + paragraph(last),
    )
    film = image(
        "The vehicle moves along its plan, seen from the side and from above",
        "As fast as it flies. Line: the base. Dashes: the tip.",
        # 80 dots per inch, chosen: fewer than the stills have, since it has many frames
        webp_bytes(motion_frames(plan, FRAMES, 80.0), FRAMES),
        wide=True,
    )
    stills = image(
        "The vehicle at several instants of its plan",
        "Rotors and arm at equal steps of time, from light to dark.",
        image_bytes(motion_figure(plan), dpi=110),
        wide=True,
    )
    body += section("Motion", film + stills)
    body += section(
        "Limits over time",
        image(
            "Speed, tilt, rotor thrusts, joint torques, joint rates and joints over"
            " time",
            "Dashes: the limit. Grey lines: where a phase begins.",
            image_bytes(limits_figure(plan), dpi=110),
            wide=True,
        ),
    )
    body += section("Phases", table(["", "phase", ">begins, s", ">lasts, s"], phases))
    return page(f"Plan {plan.task.name}", first, body)


def _rows(found: PlanSummary, limits: TaskLimits) -> Iterator[tuple[str, ...]]:
    """Rows of the table of what is tight: quantity, largest value, limit, share of it,
    where and when.
    """
    for name, unit, most, limit in (
        ("speed of the base", "m/s", found.speed, limits.speed),
        (
            "tilt of the base",
            "degrees",
            math.degrees(found.tilt),
            math.degrees(limits.tilt),
        ),
    ):
        stated = (
            (f"{limit:.3g} {unit}", f"{100.0 * most / limit:.0f} %")
            if math.isfinite(limit)
            else ("none", "")
        )
        yield name, f"{most:.2f} {unit}", *stated, ""
    for name, tight, share in (
        ("rotor thrust", found.rotor, limits.thrust_share),
        ("joint torque", found.torque, limits.torque_share),
        ("joint rate", found.joint_rate, 1.0),
    ):
        if tight is not None:
            used = (
                f"{100.0 * tight.share:.0f} % of the highest",
                f"{100.0 * share:.0f} %",
            )
            yield (
                name,
                *used,
                f"{100.0 * tight.share / share:.0f} %",
                f"{tight.name} at {tight.time:.2f} s",
            )
    if found.clearance is not None:
        yield (
            "smallest distance",
            f"{found.clearance:.3f} m",
            f"{limits.clearance:.3g} m",
            "",
            found.nearest,
        )
