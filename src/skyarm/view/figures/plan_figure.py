"""Figures of a plan: the vehicle along its motion, and what it uses of each limit over time."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon

from skyarm.algebra import Quaternion, Vec3
from skyarm.dynamics.kinematics import link_poses
from skyarm.planning.plan_file import plan_arrays
from skyarm.planning.plan_report import tilts
from skyarm.planning.planner import Plan, states_at
from skyarm.records.arrays import Array, Pixels
from skyarm.vehicle import BASE
from skyarm.view.figures.style import PAGE, Picture
from skyarm.world.contact.surface import Surface

STILLS = 13
"""Number of positions of the vehicle that the picture of the motion shows."""

SIDES = (("x", 0, "z", 2), ("x", 0, "y", 1))
"""Projections of the motion: from the side and from above."""


def motion_figure(plan: Plan) -> Figure:
    """Draw the vehicle along its plan, projected from the side and from above, with the obstacles."""
    figure, axes = _paths(plan)
    for ax, (_, i, _, j) in zip(axes, SIDES, strict=True):
        for k, x in enumerate(_stills(plan)):
            shade = 0.75 * (1.0 - k / (STILLS - 1))
            for line in outline_of(plan, x):
                ax.plot(line[:, i], line[:, j], color=(shade, shade, shade), linewidth=1.4, solid_capstyle="round")
    return figure


def motion_frames(plan: Plan, fps: int, dpi: float) -> Iterator[Pixels]:
    """Draw the vehicle moving along its plan, one picture (height, width, 3) for each instant at a rate ``fps``."""
    figure, axes = _paths(plan)
    figure.set_dpi(dpi)
    canvas: Any = FigureCanvasAgg(figure)
    canvas.draw()
    still = canvas.copy_from_bbox(figure.bbox)
    drawn = [LineCollection([], colors="black", linewidths=2.0) for _ in axes]
    clock = axes[0].text(0.01, 0.95, "", transform=axes[0].transAxes, va="top", **PAGE.words)
    for ax, each in zip(axes, drawn, strict=True):
        ax.add_collection(each, autolim=False)
    for t in np.arange(0.0, float(plan.t[-1]), 1.0 / fps):
        canvas.restore_region(still)
        clock.set_text(f"{t:.1f} s")
        lines = outline_of(plan, states_at(plan, np.array([t]))[0])
        for ax, each, (_, i, _, j) in zip(axes, drawn, SIDES, strict=True):
            each.set_segments([line[:, [i, j]] for line in lines])
            ax.draw_artist(each)
        axes[0].draw_artist(clock)
        yield np.array(canvas.buffer_rgba())[..., :3]


def _paths(plan: Plan) -> tuple[Picture, list[Axes]]:
    """Draw the paths of base and tip, from the side and from above, and the obstacles.

    Both projections have one scale and show all of the motion; they stand beside each other where it is not long in x.
    """
    arrays = plan_arrays(plan)
    points = np.vstack([line for x in _stills(plan) for line in outline_of(plan, x)] + [arrays["position"]])
    middle, half = 0.5 * (points.max(axis=0) + points.min(axis=0)), 0.525 * np.ptp(points, axis=0)
    stacked = half[0] > 1.5 * max(half[1:])
    ratio = 3.6 if stacked else 1.05
    width = max(half[0], ratio * max(half[1:]))
    figure = PAGE.blank(11.0, 6.4 if stacked else 5.6)
    axes = [PAGE.dress(ax) for ax in (figure.subplots(2, 1) if stacked else figure.subplots(1, 2))]
    for ax, (across, i, up, j) in zip(axes, SIDES, strict=True):
        for each in plan.task.obstacles:
            _draw_obstacle(ax, each, i, j)
        ax.plot(arrays["position"][:, i], arrays["position"][:, j], color=PAGE.looks[0].color, linewidth=0.8)
        if arrays["tip"].size:
            ax.plot(arrays["tip"][:, i], arrays["tip"][:, j], **PAGE.looks[1].line)
        ax.set(xlim=(middle[i] - width, middle[i] + width))
        ax.set(ylim=(middle[j] - width / ratio, middle[j] + width / ratio))
        ax.set_aspect("equal")
        ax.set_xlabel(f"{across} [m]", **PAGE.words)
        ax.set_ylabel(f"{up} [m]", **PAGE.words)
    return figure, axes


def _stills(plan: Plan) -> Array:
    """States of the plan at equal steps of time."""
    return states_at(plan, np.linspace(0.0, float(plan.t[-1]), STILLS))


def outline_of(plan: Plan, x: Array) -> list[Array]:
    """Lines (points, 3) of a vehicle in one state, m, world axes: booms and arm."""
    vehicle = plan.task.vehicle
    n = vehicle.n
    R = Quaternion(*x[3:7].tolist()).rotation()
    base = Vec3(*x[:3].tolist())
    poses = link_poses(vehicle, tuple(x[13 : 13 + n].tolist()))

    def at(body: int, point: Vec3) -> list[float]:
        own = point if body == BASE else poses[body].apply(point)
        return [float(c) for c in base + R.apply(own)]

    origin = Vec3(0.0, 0.0, 0.0)
    lines = [[at(BASE, origin), at(BASE, rotor.position)] for rotor in vehicle.rotors]
    lines += [[at(link.parent, origin), at(k, origin)] for k, link in enumerate(vehicle.links)]
    if vehicle.end_effector:
        frame = vehicle.frame(vehicle.end_effector)
        lines.append([at(frame.link, origin), at(frame.link, frame.position)])
    return [np.array(line) for line in lines]


def _draw_obstacle(ax: Axes, surface: Surface, i: int, j: int) -> None:
    """Draw the outline of a surface in one projection; a plane is not drawn."""
    middle = np.array([*map(float, surface.position)])
    look = {"facecolor": "#c9c9c9", "edgecolor": PAGE.frame, "alpha": 0.6, "zorder": 1.0}
    if surface.shape == "sphere":
        ax.add_patch(Circle((middle[i], middle[j]), float(surface.size[0]), **look))
    elif surface.shape in ("box", "cylinder"):
        radius = surface.size[0]
        half = surface.size if surface.shape == "box" else (2.0 * radius, 2.0 * radius, surface.size[1])
        corners = np.array([[0.5 * s * float(h) for s, h in zip(signs, half, strict=True)] for signs in _CORNERS])
        R = np.array([[float(c) for c in row] for row in surface.rotation.rows])
        flat = (corners @ R.T + middle)[:, [i, j]]
        ax.add_patch(Polygon(_hull(flat), closed=True, **look))


_CORNERS = [(a, b, c) for a in (-1.0, 1.0) for b in (-1.0, 1.0) for c in (-1.0, 1.0)]


def _hull(points: Array) -> Array:
    """Convex hull of points in the plane, counter-clockwise (Andrew 1979)."""
    rows = sorted(map(tuple, np.round(points, 9).tolist()))

    def half(ordered: Sequence[tuple[float, ...]]) -> list[tuple[float, ...]]:
        chain: list[tuple[float, ...]] = []
        for p in ordered:
            while len(chain) > 1:
                (ax, ay), (bx, by) = chain[-2:]
                if (bx - ax) * (p[1] - ay) - (by - ay) * (p[0] - ax) > 0.0:
                    break
                chain.pop()
            chain.append(p)
        return chain[:-1]

    return np.array([*half(rows), *half(rows[::-1])])


def limits_figure(plan: Plan) -> Figure:
    """Draw speed, tilt, rotor thrusts, joint torques, joint rates and joints over time, with their limits."""
    vehicle, limits = plan.task.vehicle, plan.task.limits
    n, m = vehicle.n, len(vehicle.rotors)
    most = np.array([float(rotor.max_speed) for rotor in vehicle.rotors])
    thrust = 100.0 * (plan.x[:, 13 + 2 * n : 13 + 2 * n + m] * np.array(plan.stage.hover) / most) ** 2
    efforts = np.array([float(link.joint.effort_limit) for link in vehicle.links])
    panels: list[tuple[str, str, Array, Array, list[float]]] = [
        ("Speed", "m/s", plan.t, np.linalg.norm(plan.x[:, 7:10], axis=1), [limits.speed]),
        ("Tilt", "degrees", plan.t, np.degrees(tilts(plan)), [math.degrees(limits.tilt)]),
        ("Rotor thrust", "% of highest", plan.t, thrust, [100.0 * limits.thrust_share]),
    ]
    if n:
        share, fastest = 100.0 * limits.torque_share, limits.joint_rate
        panels += [
            ("Joint torque", "% of limit", plan.t[:-1], 100.0 * plan.torques / efforts, [share, -share]),
            (
                "Joint rate",
                "rad/s or m/s",
                plan.t,
                plan.x[:, 13 + n : 13 + 2 * n],
                [fastest, -fastest],
            ),
            ("Joints", "rad or m", plan.t, plan.x[:, 13 : 13 + n], []),
        ]
    figure, axes = PAGE.tiles(len(panels), 2, (5.5, 2.1))
    for ax, (name, unit, t, values, ends) in zip(axes, panels, strict=True):
        for k, column in enumerate(np.atleast_2d(values.T)):
            ax.plot(t, column, **PAGE.look(k).line)
        for end in ends:
            if math.isfinite(end) and end < 179.9:
                ax.axhline(end, **PAGE.limit.line)
        for edge in plan.edges[1:-1]:
            ax.axvline(plan.t[edge], color=PAGE.frame, linewidth=0.5)
        ax.set_xlabel("Time [s]", **PAGE.words)
        ax.set_ylabel(f"{name} [{unit}]", **PAGE.small_words)
    return figure
