"""Load sharing: static equilibrium of the bodies that grasps hold, and the load of each
vehicle by its grasps.

A body hangs in the springs of its grasps, whose frames stay where they are at the start
of the flight: the wrenches h balance its weight, G h = -w, with the least elastic
energy, and cables only pull.

Source: Murray, Li, Sastry 1994, section 5.3 (grasp map G).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from skyarm.algebra import Vec3
from skyarm.dynamics.point_motion import PointMotion
from skyarm.plant.surroundings import motions_of
from skyarm.records.arrays import Array, doubles, float_array, lengths, norm
from skyarm.records.immutable import positional
from skyarm.scenario.scenario_record import Scenario, first_state
from skyarm.studies.assess.arm_poses import WRENCH, ArmPoses
from skyarm.studies.assess.causes import ALARMS
from skyarm.studies.assess.finding import NOTE, OK, WARNING, Finding
from skyarm.studies.assess.flight_loads import Load
from skyarm.studies.assess.joints import joint_torques
from skyarm.studies.assess.thrust import ENOUGH, thrust_margin, torque_authority
from skyarm.vehicle import Vehicle

if TYPE_CHECKING:
    from skyarm.world.contact.contact import Contact
    from skyarm.world.contact.grasp import Grasp

WITH_SHARE = " with its share"
"""Words behind the questions about a vehicle that bears its share of the bodies."""

LEVER = 1e-4
"""Lever (m) of a weight about its grasps, and slope of its cables, that count as
rounding."""

ROUNDING = 1e-9
"""Stiffness over the largest, and force over the weight, that count as zero."""


@positional
class Balance:
    """Static equilibrium of one body in its grasps.

    Attributes:
        body: name of the body. weight: N. grasps: those that hold it.
        wrenches: (grasps, 6) force (N) and torque (N m) of each on the body at its
            place, world axes.
        loads: what each adds to the base torque (N m), base force (N) and joint efforts
            of its vehicle, (6 + n) each.
        determined: whether geometry alone gives the vertical forces, whatever the
            stiffness of the grasps.
        departure: how the body leaves its pose, after which it hangs from its grasps;
            empty in stable equilibrium.
        remarks: slack cables, and surfaces that the body rests on, without which it is
            balanced here.
    """

    body: str
    weight: float
    grasps: tuple[Grasp, ...]
    wrenches: Array
    loads: tuple[Array, ...]
    determined: bool
    departure: str
    remarks: tuple[str, ...]

    def of(self, agent: str) -> list[int]:
        """Indices of the grasps of a vehicle; those of the only one have no name."""
        return [i for i, each in enumerate(self.grasps) if each.agent in ("", agent)]

    def share(self, agent: str) -> float:
        """Vertical force (N) of a vehicle's grasps on the body."""
        return float(self.wrenches[self.of(agent), 2].sum())


def balances(scenario: Scenario, lost: str = "") -> list[Balance]:
    """Static equilibrium of every object that grasps hold at the start of a flight;
    mechanisms have their own bearings.

    Args:
        scenario: the whole one, of all vehicles.
        lost: name of a vehicle whose grasps are open.
    """
    solved = []
    for contact in (each for each in scenario.worlds if each.grasps):
        alone = [scenario.of(name) for name in scenario.agents]
        plants = [each.agent.plant for each in alone]
        states = [first_state(each) for each in alone]
        motion = motions_of(plants, states, tuple(scenario.agents))[0]
        memory = contact.start(0.0, ())
        pulls = [
            row
            for row in contact.gripping.pulls(memory, motion, 0.0)
            # a grasp that opens at once holds nothing at the start
            if float(row[0].release) > 0.0
        ]
        for index, thing in enumerate(contact.objects):
            rows = [
                (grasp, pull.place, frame.position)
                for grasp, of, pull, frame in pulls
                if of == index
            ]
            weight = float(thing.mass * motion.gravity)
            middle = float_array(memory.carried[index].position)
            if rows and weight > 0.0:
                left = [r for r in rows if not lost or r[0].agent != lost]
                remarks = _remarks(contact, index, motion)
                solved.append(
                    _balance(thing.name, weight, middle, left, motion, remarks)
                )
    return solved


def _remarks(contact: Contact, index: int, motion: PointMotion) -> list[str]:
    """Remarks about the surfaces that an object touches at the start."""
    from skyarm.world.contact.carrier import NOBODY

    names = {
        each.surface if each.by == index else contact.carriers[each.by].name
        for each in contact.meetings(contact.start(0.0, ()), motion)
        if index in (each.by, each.of)
        and each.by != NOBODY
        # nearer than that counts as a touch
        and float(each.touch.depth) > -LEVER
    }
    return [
        f"touches {name} at the start: its shares are those once it is lifted"
        for name in sorted(names)
    ]


def _balance(
    body: str,
    weight: float,
    middle: Array,
    rows: Sequence[tuple[Grasp, Vec3, Vec3]],
    motion: PointMotion,
    remarks: list[str],
) -> Balance:
    """Static equilibrium of a body.

    Args:
        body: name of the body.
        weight: N.
        middle: (3,) centre of mass, m, world axes.
        rows: grasps, each with its place on the body and with the vehicle's frame, m,
            world axes.
        motion: motions of the vehicles at the start.
        remarks: remarks about the body.
    """
    grasps = [row[0] for row in rows]
    places = np.array([float_array(row[1]) for row in rows]).reshape(-1, 3)
    lines = np.array([float_array(row[2] - row[1]) for row in rows]).reshape(-1, 3)
    stretch = np.pad(lines, ((0, 0), (0, 3)))
    K = np.zeros((len(rows), 6, 6))
    for i, grasp in enumerate(grasps):
        k = float(grasp.stiffness)
        turning = float(grasp.radius) ** 2
        far = norm(lines[i])
        # a patch of radius r resists turning by k r^2; a ball and a cable do not
        K[i] = k * np.diag([1.0, 1.0, 1.0, *(3 * [turning * (grasp.kind == "fixed")])])
        if grasp.kind == "cable" and far:
            K[i, :3, :3] = k * np.outer(lines[i], lines[i]) / far**2
            stretch[i] *= 1.0 - float(grasp.length) / far
    cables = np.array([each.kind == "cable" for each in grasps], dtype=bool)
    up = np.array([0.0, 0.0, weight])
    while True:
        # about a place on the axis that is free to turn: what no grasp bears is then a
        # moment about this axis alone
        pole = next(iter(places[K.any(axis=(1, 2))]), middle)
        G = np.tile(np.eye(6), (len(rows), 1, 1))
        # without grasps the list is empty, which cannot be assigned
        G[:, 3:, :3] = [np.cross(np.eye(3), arm) for arm in places - pole] or 0.0
        needed = np.array([*up, *np.cross(middle - pole, up)])
        wrenches, free = _springs(G, K, stretch, needed)
        pushes = np.where(cables, -np.sum(wrenches[:, :3] * lines, axis=1), 0.0)
        if not np.any(pushes > ROUNDING * weight):
            break
        # one cable at a time: another may bear load once this one is slack
        slack = int(np.argmax(pushes))
        K[slack] = 0.0
        remarks = [
            *remarks,
            f"cable {grasps[slack].label} would have to push: it hangs slack",
        ]
    # stiffness that differs from grasp to grasp shows where it has a part in the
    # vertical forces
    others, _ = _springs(
        G, K * np.arange(1.0, len(rows) + 1.0)[:, None, None], stretch, needed
    )
    left = needed - np.einsum("ijk,ik->j", G, wrenches)
    below = float(pole[2] - middle[2])
    lever = norm(left[3:]) / weight
    # a patch's torque goes with the sine of the turn: k r^2 is the most of it
    most = K[:, 5, 5]
    torque = lengths(wrenches[:, 3:])
    pivot = "grasp " + ", ".join(
        each.label for each, own in zip(grasps, K, strict=True) if own.any()
    )
    over = torque > most
    departure = ""
    if not K.any():
        departure = "falls: nothing holds it"
    elif np.any(over):
        i = int(np.argmax(over))
        departure = (
            f"turns in grasp {grasps[i].label}: its patch holds {most[i]:.3g} N m of"
            f" {torque[i]:.3g} N m"
        )
    elif norm(left[:3]) > LEVER * weight:
        departure = f"swings: {pivot} cannot pull straight up from where it begins"
    # free to turn about a horizontal axis, and the centre of mass lies beside the pole
    # (a moment is left) or above it (unstable)
    elif np.any(np.abs(free[3:5]) > LEVER) and (lever > LEVER or below < -LEVER):
        departure = (
            f"tips about {pivot} by {math.degrees(math.atan2(lever, below)):.0f}"
            " degrees"
        )
    wrenches[over, 3:] *= (most[over] / torque[over])[:, None]
    loads = tuple(
        _load(motion.of(each.agent), each, wrench)
        for each, wrench in zip(grasps, wrenches, strict=True)
    )
    # equal but for rounding, a millionth of the weight
    determined = np.allclose(others[:, 2], wrenches[:, 2], rtol=0.0, atol=1e-6 * weight)
    return Balance(
        body,
        weight,
        tuple(grasps),
        wrenches,
        loads,
        determined,
        departure,
        tuple(remarks),
    )


def _springs(G: Array, K: Array, stretch: Array, needed: Array) -> tuple[Array, Array]:
    """Wrenches (grasps, 6) of springs that exert a needed wrench (6,) on a body, and
    twists (6, k) that strain none.

    Args:
        G: (grasps, 6, 6) map of the wrench of each at its place to that at the pole.
        K: (grasps, 6, 6) stiffness.
        stretch: (grasps, 6) before the body moves, m and rad.
        needed: force (N), and torque (N m) about the pole.
    """
    GK = G @ K
    total = np.einsum("ijk,ilk->jl", GK, G)
    sizes, twists = np.linalg.eigh(total)
    sag = np.linalg.pinv(total, ROUNDING, hermitian=True) @ (
        np.einsum("ijk,ik->j", GK, stretch) - needed
    )
    return (
        np.einsum("ijk,ik->ij", K, stretch - sag @ G),
        twists[:, sizes <= ROUNDING * sizes[-1]],
    )


def _load(motion: PointMotion, grasp: Grasp, wrench: Array) -> Array:
    """Base torque, base force and joint efforts (6 + n,) that a vehicle adds to exert a
    wrench (6,) by its grasp.
    """
    at = motion.vehicle.frame(grasp.frame or None)
    base, efforts = motion.generalized_force(
        Vec3(*wrench[:3]), Vec3(*wrench[3:]), at.position, at.link
    )
    return doubles([*base.torque, *base.force, *efforts])


def poses_with_share(
    scenario: Scenario, name: str, bodies: Sequence[Balance], payload: float = 0.0
) -> ArmPoses:
    """Level hover of one vehicle at the start, with its share of the bodies, and a
    payload (kg) at its tip.

    Thrust is the size of the force that the rotors give in all, for which the base
    tilts if grasps pull sideways.
    """
    one = scenario.of(name)
    vehicle = one.agent.vehicle
    gravity = float(one.agent.plant.gravity)
    vehicle = vehicle.with_payload(payload) if payload else vehicle
    load = np.zeros(6 + vehicle.n)
    weight = float(vehicle.mass) * gravity
    for each in bodies:
        load += sum(each.loads[i] for i in each.of(name))
    # the force that grasps add tilts the thrust: its size counts, beyond the weight
    thrust = math.hypot(*load[3:5], weight + load[5]) - weight
    poses = ArmPoses.only(
        vehicle, doubles([first_state(one).joints]), gravity, WITH_SHARE
    )
    return replace(poses, load=np.array([[*load[:3], thrust, *load[6:]]]).T)


def load_of(
    scenario: Scenario, name: str, bodies: Sequence[Balance], payload: float
) -> list[Finding]:
    """Check results for one vehicle with its share of the bodies: the share, then
    rotors and joints under it.
    """
    bodies = [each for each in bodies if each.of(name)]
    if not bodies:
        return []
    poses = poses_with_share(scenario, name, bodies, payload)
    margins, joints = thrust_margin(poses), joint_torques(poses)
    shares = (
        f"{each.share(name):.4g} N of the {each.weight:.4g} N of {each.body}"
        f" ({each.share(name) / each.weight:.0%}, by "
        + ("geometry)" if each.determined else "the stiffness of the grasps)")
        for each in bodies
    )
    thrust = float(poses.efforts(poses.joints)[WRENCH - 1, 0])
    share = sum(each.share(name) for each in bodies)
    text = (
        f"{' and '.join(shares)}; hover takes {thrust:.4g} N of"
        f" thrust{_spare(margins[0])}"
    )
    used = [
        (each.value / each.limit, each.question.removesuffix(poses.held))
        for each in joints
        # a joint without a limit has NaN there, which is above nothing
        if each.limit > 0.0
    ]
    text += "; {1} is {0:.0%} of its limit".format(*max(used)) if used else ""
    turns = [
        replace(each, question=f"{each.question}{WITH_SHARE}")
        for each in torque_authority(poses)
    ]
    return [
        Finding("load share", NOTE, text, "world.grasps", value=share, unit="N"),
        *margins,
        *joints,
        *turns,
    ]


def _spare(margin: Finding) -> str:
    """Words for a thrust margin; empty if it is not known."""
    return (
        ""
        if math.isnan(margin.value)
        else f", with {margin.value - 1.0:+.0%} of thrust margin"
    )


def carried_loads(
    scenario: Scenario, name: str, bodies: Sequence[Balance]
) -> list[Load]:
    """Share of one vehicle in the body that its team carries, a point mass at its grasp
    from lift to place.

    It is the share of the weight at the start, until the grasp opens. Sideways pulls of
    cables and internal forces are not in it, nor moments of fixed grasps.
    """
    team = scenario.team
    gravity = float(scenario.agents[name].plant.gravity)
    if team is None or team.motion is None or not gravity:
        return []
    loads = []
    for each in bodies:
        own = [each.grasps[i] for i in each.of(name)]
        mass = each.share(name) / gravity
        if each.body != team.object or not own or not mass > 0.0:
            continue

        body = partial(Vehicle.point_mass, mass=mass, frame=own[0].frame or None)
        opened = min(float(grasp.release) for grasp in own)
        loads.append(
            Load(
                each.body,
                float(team.motion.lift),
                min(float(team.motion.stop), opened),
                mass,
                body,
            )
        )
    return loads


def balance_of_bodies(bodies: Sequence[Balance]) -> list[Finding]:
    """Check result for each body that grasps hold: whether its pose at the start is a
    stable equilibrium.
    """
    findings = []
    for each in bodies:
        level = WARNING if each.departure else NOTE if each.remarks else OK
        text = (
            "; ".join(filter(None, (each.departure, *each.remarks)))
            or "in stable equilibrium"
        )
        remedy = (
            "grasps around the vertical through its centre of mass, or fixed ones of"
            " more radius"
        )
        findings.append(
            Finding(
                f"balance of {each.body}",
                level,
                text,
                "world.grasps",
                remedy,
                each.weight,
                unit="N",
            )
        )
    return findings


def losses(
    scenario: Scenario, bodies: Sequence[Balance], payload: float = 0.0
) -> list[Finding]:
    """Check result for the loss of each vehicle that holds a body: motion of the
    bodies, and shares of the others.

    Its value is the least thrust margin of the others.
    """
    findings = []
    for lost in dict.fromkeys(grasp.agent for each in bodies for grasp in each.grasps):
        after = balances(scenario, lost)
        level = NOTE
        margins = list[float]()
        texts = [
            f"{each.body} is no longer in balance: it {each.departure}"
            for each in after
            if each.departure
        ]
        for name in scenario.agents:
            loaded = load_of(scenario, name, after, payload)
            alarms = ", ".join(
                f"{each.level} in {each.question}"
                for each in loaded
                if each.level in ALARMS
            )
            # load_of states the share first, then the thrust margin
            if loaded:
                texts.append(
                    f"{name} carries {loaded[0].value:.4g}"
                    f" N{_spare(loaded[1])}{alarms and f' ({alarms})'}"
                )
                margins.append(loaded[1].value)
            level = WARNING if alarms else level
        remedy = "a lighter body, more thrust, or one vehicle more"
        least = min(margins, default=math.nan)
        findings.append(
            Finding(
                f"loss of {lost}",
                level,
                "; ".join(texts),
                f"agents.{lost}",
                remedy,
                least,
                ENOUGH,
            )
        )
    return findings
