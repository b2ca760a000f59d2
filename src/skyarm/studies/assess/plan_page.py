"""Page of a plan: its numbers, the moving vehicle, and the limits over time."""

from __future__ import annotations

from skyarm.planning.plan_report import summary, summary_lines
from skyarm.planning.planner import Plan
from skyarm.view.figures.plan_figure import limits_figure, motion_figure
from skyarm.view.figures.style import image_bytes
from skyarm.view.pages import image, page, paragraph, section, table


def plan_page(plan: Plan) -> str:
    """Make the HTML page of a plan."""
    first, *rest = summary_lines(plan.task.name, summary(plan))
    phases = [
        (f"{k}", name, f"{begin:.3f}", f"{length:.3f}")
        for k, ((name, length), begin) in enumerate(zip(summary(plan).phases, plan.t[list(plan.edges)], strict=False))
    ]
    body = section("What is tight", "".join(map(paragraph, rest)))
    body += section(
        "Motion",
        image(
            "The vehicle along its plan, from the side and from above",
            "Rotors and arm at equal steps of time, from light to dark. Line: the base. Dashes: the tip.",
            image_bytes(motion_figure(plan), dpi=110),
            wide=True,
        ),
    )
    body += section(
        "Limits over time",
        image(
            "Speed, tilt, rotor thrusts, joint torques, joint rates and joints over time",
            "Dashes: the limit. Grey lines: where a phase begins.",
            image_bytes(limits_figure(plan), dpi=110),
            wide=True,
        ),
    )
    body += section("Phases", table(["", "phase", ">begins, s", ">lasts, s"], phases))
    return page(f"Plan {plan.task.name}", first, body)
