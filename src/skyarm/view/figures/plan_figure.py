"""Figures of a plan: the vehicle along its motion, and what it uses of each limit over
time.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from skyarm.planning.plan_file import plan_arrays
from skyarm.planning.plan_report import tilts
from skyarm.planning.planner import Plan, states_at
from skyarm.records.arrays import Array, Pixels, float_array, lengths
from skyarm.view.figures.projection import SIDE, TOP, outline
from skyarm.view.figures.style import PAGE, Picture
from skyarm.world.contact.contact_scene import surface_shape
from skyarm.world.scene.scene import Instants
from skyarm.world.scene.vehicle_shapes import matrices, vectors

STILLS = 13
"""Number of positions of the vehicle that the picture of the motion shows."""

SIDES = ((SIDE, "z"), (TOP, "y"))
"""Projections of the motion, from the side and from above, and their upward axes; x is
to the right in both."""


def motion_figure(plan: Plan) -> Figure:
    """Draw the vehicle along its plan, projected from the side and from above, with the
    obstacles.
    """
    figure, axes = _paths(plan)
    for ax, (view, _) in zip(axes, SIDES, strict=True):
        for k, lines in enumerate(_stills(plan)):
            # the last one is black, and the first one light grey
            shade = 0.75 * (1.0 - k / (STILLS - 1))
            for line in lines:
                ax.plot(
                    *view.flat(line).T,
                    color=(shade, shade, shade),
                    linewidth=1.4,
                    solid_capstyle="round",
                )
    return figure


def motion_frames(plan: Plan, fps: int, dpi: float) -> Iterator[Pixels]:
    """Draw the vehicle moving along its plan, one picture (height, width, 3) for each
    instant at a rate ``fps``.
    """
    figure, axes = _paths(plan)
    figure.set_dpi(dpi)
    canvas: Any = FigureCanvasAgg(figure)
    canvas.draw()
    # what does not move is drawn once and copied: a frame then costs only its lines
    still = canvas.copy_from_bbox(figure.bbox)
    drawn = [LineCollection([], colors="black", linewidths=2.0) for _ in axes]
    clock = axes[0].text(
        0.01, 0.95, "", transform=axes[0].transAxes, va="top", **PAGE.words
    )
    for ax, each in zip(axes, drawn, strict=True):
        ax.add_collection(each, autolim=False)
    times = np.arange(0.0, float(plan.t[-1]), 1.0 / fps)
    for t, lines in zip(times, _lines_at(plan, times), strict=True):
        canvas.restore_region(still)
        clock.set_text(f"{t:.1f} s")
        for ax, each, (view, _) in zip(axes, drawn, SIDES, strict=True):
            each.set_segments([*view.flat(lines)])
            ax.draw_artist(each)
        axes[0].draw_artist(clock)
        # a copy, because the next picture is drawn into the same memory
        yield np.array(canvas.buffer_rgba())[..., :3]


def _paths(plan: Plan) -> tuple[Picture, list[Axes]]:
    """Draw the paths of base and tip, from the side and from above, and the obstacles.

    Both projections have one scale and show all of the motion; they stand beside each
    other where it is not long in x.
    """
    arrays = plan_arrays(plan)
    points = np.vstack([_stills(plan).reshape(-1, 3), arrays["position"]])
    middle = 0.5 * (points.max(axis=0) + points.min(axis=0))
    # half of the extent, and 5 % more for a margin
    half = 0.525 * np.ptp(points, axis=0)
    # a path more than 1.5 times as long as wide and high, chosen, has its two views on
    # top of each other
    stacked = half[0] > 1.5 * max(half[1:])
    # width over height of one drawing in a figure of the sizes below
    ratio = 3.6 if stacked else 1.05
    # one scale for both: the wider side decides, in either direction
    width = max(half[0], ratio * max(half[1:]))
    figure = PAGE.blank(11.0, 6.4 if stacked else 5.6)
    axes = [
        PAGE.dress(ax)
        for ax in (figure.subplots(2, 1) if stacked else figure.subplots(1, 2))
    ]
    for ax, (view, up) in zip(axes, SIDES, strict=True):
        for each in plan.task.obstacles:
            if each.shape != "plane":
                at = matrices(each.rotation, 1)[0], vectors(each.position, 1)[0]
                look = {
                    "facecolor": "#c9c9c9",
                    "edgecolor": PAGE.frame,
                    "alpha": 0.6,
                    "zorder": 1.0,
                }
                ax.add_patch(
                    Polygon(
                        outline(surface_shape(each), *at, view), closed=True, **look
                    )
                )
        ax.plot(
            *view.flat(arrays["position"]).T, color=PAGE.looks[0].color, linewidth=0.8
        )
        if arrays["tip"].size:
            ax.plot(*view.flat(arrays["tip"]).T, **PAGE.looks[1].line)
        x, y = view.flat(middle)
        ax.set(xlim=(x - width, x + width), ylim=(y - width / ratio, y + width / ratio))
        ax.set_aspect("equal")
        ax.set_xlabel("x [m]", **PAGE.words)
        ax.set_ylabel(f"{up} [m]", **PAGE.words)
    return figure, axes


def _stills(plan: Plan) -> Array:
    """Lines of the vehicle at equal steps of time."""
    return _lines_at(plan, np.linspace(0.0, float(plan.t[-1]), STILLS))


def _lines_at(plan: Plan, times: Array) -> Array:
    """Ends (N, lines, 2, 3) of the lines of a vehicle, booms and arm, at N instants, m,
    world axes.
    """
    vehicle = plan.task.vehicle
    x = states_at(plan, times)
    position, quaternion, joints = x[:, :3], x[:, 3:7], x[:, plan.stage.at.joints]
    seen = Instants(
        vehicle=vehicle,
        times=times,
        position=position,
        quaternion=quaternion,
        joints=joints,
    )
    ends = [(seen.place(), seen.place(rotor.position)) for rotor in vehicle.rotors]
    ends += [
        (seen.place(body=link.parent), seen.place(body=k))
        for k, link in enumerate(vehicle.links)
    ]
    if vehicle.end_effector:
        frame = vehicle.frame()
        ends.append(
            (seen.place(body=frame.link), seen.place(frame.position, frame.link))
        )
    return np.array(ends).transpose(2, 0, 1, 3)


def limits_figure(plan: Plan) -> Figure:
    """Draw speed, tilt, rotor thrusts, joint torques, joint rates and joints over time,
    with their limits.
    """
    vehicle = plan.task.vehicle
    limits = plan.task.limits
    at = plan.stage.at
    efforts = float_array(joint.effort_limit for joint in vehicle.joints)
    panels: list[tuple[str, str, Array, list[float]]] = [
        ("Speed", "m/s", lengths(plan.x[:, 7:10]), [limits.speed]),
        (
            "Tilt",
            "degrees",
            np.degrees(tilts(plan)),
            [math.degrees(limits.tilt)],
        ),
        (
            "Rotor thrust",
            "% of highest",
            100.0 * plan.thrust_shares,
            [100.0 * limits.thrust_share],
        ),
    ]
    if vehicle.n:
        share = 100.0 * limits.torque_share
        fastest = limits.joint_rate
        panels += [
            (
                "Joint torque",
                "% of limit",
                100.0 * plan.torques / efforts,
                [share, -share],
            ),
            (
                "Joint rate",
                "rad/s or m/s",
                plan.x[:, at.joint_rates],
                [fastest, -fastest],
            ),
            ("Joints", "rad or m", plan.x[:, at.joints], []),
        ]
    figure, axes = PAGE.tiles(len(panels), 2, (5.5, 2.1))
    for ax, (name, unit, values, ends) in zip(axes, panels, strict=True):
        for k, column in enumerate(np.atleast_2d(values.T)):
            ax.plot(plan.t, column, **PAGE.look(k).line)
        for end in ends:
            # a limit of 180 degrees of tilt is none
            if math.isfinite(end) and end < 179.9:
                ax.axhline(end, **PAGE.limit.line)
        for edge in plan.edges[1:-1]:
            ax.axvline(plan.t[edge], color=PAGE.frame, linewidth=0.5)
        ax.set_xlabel("Time [s]", **PAGE.words)
        ax.set_ylabel(f"{name} [{unit}]", **PAGE.small_words)
    return figure
