"""Task of a plan: vehicle, start, phases with goals, limits and obstacles, as its file
states them.

::

    schema = 1
    name = "eagle_catch"
    vehicle = "hexacopter370_flying_arm_3"   # a shipped name or the path of a file
    minimise = "effort"                      # or "time"

    [start]
    position = [-5, 0, 1]                    # m

    [limits]
    tilt = 1.05                              # rad

    [[phases]]
    name = "approach"
    to = { tip = [0, 0, 0] }                 # at the end of the phase
    duration = 1.4                           # s; left out: free

    [[phases]]
    name = "grasp"
    kind = "hold"                            # the tip rests
    duration = 0.2
    gripper = "claw"                         # closes when the phase begins

    [[phases]]
    name = "away"
    to = { base = [5, 0, 1.5], heading = 0.0, joints = [0, 0, 0], rest = true }
    duration = 1.6

    [[obstacles]]
    shape = "box"
    position = [2.5, 0, 0]
    size = [0.2, 4, 2]
"""

from __future__ import annotations

import math
import os
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal

from skyarm.algebra import ZERO3, Vec3
from skyarm.records.coerce import unit_vector
from skyarm.records.field_rules import accept_fields, checked
from skyarm.records.files import (
    Fields,
    PathLike,
    errors_as,
    file_name,
    read_toml,
    require_file,
    shown,
)
from skyarm.records.files.names import require_kind
from skyarm.records.immutable import immutable
from skyarm.records.read_table import record_from
from skyarm.records.units import Unit, nonnegative, positive
from skyarm.vehicle import Vehicle
from skyarm.vehicle.vehicle_files import list_vehicles, load_vehicle
from skyarm.vehicle.vehicle_records import require_plant, undriven_joints
from skyarm.world.contact.surface import Surface
from skyarm.world.contact.surface_files import with_bodies


class TaskError(ValueError):
    """Error of a planning task: one line with file, field, value and what is
    allowed.
    """


@immutable
class Start:
    """State at the beginning of a plan, at rest.

    Attributes:
        attitude: roll, pitch, yaw (ZYX) of the base.
    """

    position: Annotated[
        Vec3, Unit("m", "position of the base origin at the beginning, world axes")
    ] = ZERO3
    attitude: Annotated[
        tuple[float, ...],
        Unit("rad", "roll, pitch and yaw of the base at the beginning"),
    ] = (0.0,) * 3
    joints: Annotated[
        tuple[float, ...],
        Unit("rad or m", "joint positions at the beginning; zero if left out"),
    ] = ()

    def __post_init__(self) -> None:
        accept_fields(self, "start", TaskError)
        if len(self.attitude) != 3:
            raise TaskError(
                f"start.attitude = {shown(list(self.attitude))}: must be three"
                " angles, rad"
            )


def _direction(field: str, value: object) -> Vec3 | None:
    """Unit vector of a field that may be left out."""
    return None if value is None else unit_vector(field, value)


@immutable
@checked("to", TaskError)
class Goal:
    """Goal at the end of a phase; what is left out is free."""

    tip: Annotated[Vec3 | None, Unit("m", "position of the tip, world axes")] = None
    tip_velocity: Annotated[
        Vec3 | None, Unit("m/s", "velocity of the tip, world axes")
    ] = None
    tip_axis: Annotated[
        Vec3 | None,
        Unit(
            "",
            "direction of the tip frame's z axis, a unit vector in world axes",
            rule=_direction,
        ),
    ] = None
    base: Annotated[
        Vec3 | None, Unit("m", "position of the base origin, world axes")
    ] = None
    velocity: Annotated[
        Vec3 | None, Unit("m/s", "velocity of the base origin, world axes")
    ] = None
    attitude: Annotated[
        tuple[float, ...], Unit("rad", "roll, pitch and yaw of the base")
    ] = ()
    heading: Annotated[
        float | None, Unit("rad", "heading of the base about world z")
    ] = None
    joints: Annotated[tuple[float, ...], Unit("rad or m", "joint positions")] = ()
    rest: Annotated[
        bool, Unit("", "true: base and joints are at rest, without acceleration")
    ] = False


@immutable
@checked("contact", TaskError)
class PlannedContact:
    """Contact of the tip throughout a phase.

    Attributes:
        kind: "point", which holds the tip by pressing; "bar", which holds it by any
            force; "plane", on which it slides.
    """

    kind: Literal["point", "bar", "plane"] = "point"
    normal: Annotated[
        Vec3, Unit("", "unit vector out of the surface, world axes", rule=unit_vector)
    ] = Vec3(0.0, 0.0, 1.0)
    friction: Annotated[float, nonnegative("", "coefficient of friction")] = 0.7
    force: Annotated[float, nonnegative("N", "least force along the normal")] = 0.0


@immutable
@checked("phase", TaskError)
class PlanPhase:
    """Phase of a task.

    Attributes:
        kind: "go", a free motion; "hold", in which the tip rests; "contact", in which
            it also is pushed.
        to: goal at the end. contact: of kind "contact".
    """

    name: Annotated[str, Unit("", "name of the phase in reports")] = ""
    kind: Literal["go", "hold", "contact"] = "go"
    to: Goal = Goal()
    duration: Annotated[
        float | None,
        Unit("s", "duration; a free one is chosen by the plan", low=0.02, high=120.0),
    ] = None
    step: Annotated[
        float | None, Unit("s", "time between nodes", low=0.002, high=0.5)
    ] = None
    contact: PlannedContact | None = None
    gripper: Annotated[str, Unit("", "gripper that closes when the phase begins")] = ""
    release: Annotated[str, Unit("", "gripper that opens when the phase begins")] = ""
    tilt: Annotated[
        float | None, Unit("rad", "largest tilt in this phase", low=0.01, high=math.pi)
    ] = None

    @property
    def resting(self) -> bool:
        """True if the tip rests throughout the phase."""
        return self.kind == "hold" or (
            self.contact is not None and self.contact.kind != "plane"
        )


@immutable
@checked("limits", TaskError)
class TaskLimits:
    """Limits of a plan.

    The defaults are chosen; what the shares leave of thrust and torque is for a law's
    feedback.
    """

    tilt: Annotated[
        float,
        Unit("rad", "largest tilt of the base; pi for none", low=0.01, high=math.pi),
    ] = math.radians(60)
    thrust_share: Annotated[
        float,
        Unit("", "usable fraction of each rotor's highest thrust", low=0.05, high=1.0),
    ] = 0.9
    torque_share: Annotated[
        float,
        Unit("", "usable fraction of each joint's effort limit", low=0.05, high=1.0),
    ] = 0.95
    joint_rate: Annotated[
        float, Unit("rad/s or m/s", "largest joint rate", low=0.01, high=100.0)
    ] = 3.0
    speed: Annotated[
        float, Unit("m/s", "largest speed of the base", low=0.01, infinite=True)
    ] = math.inf
    rate: Annotated[
        float,
        Unit("rad/s", "largest angular rate of the base", low=0.01, infinite=True),
    ] = math.inf
    clearance: Annotated[
        float,
        nonnegative(
            "m",
            "smallest distance that the plan keeps from obstacles and between own"
            " bodies",
        ),
    ] = 0.05
    rotor_lag: Annotated[
        float,
        Unit(
            "",
            "how far a rotor's speed may be behind its command, as a fraction of its"
            " speed in hover",
            low=0.01,
            infinite=True,
        ),
    ] = 0.2


@immutable
class Task:
    """Planning task: a vehicle, its start, phases with goals, limits and obstacles."""

    name: Annotated[str, Unit("", "name of the task")] = "task"
    vehicle: Vehicle
    start: Start = Start()
    phases: tuple[PlanPhase, ...] = ()
    limits: TaskLimits = TaskLimits()
    obstacles: tuple[Surface, ...] = ()
    minimise: Literal["effort", "time"] = "effort"
    world: Annotated[
        Any,
        Unit(
            "",
            "table [world] of the scenario that flies the plan; its surfaces are"
            " obstacles",
        ),
    ] = None
    passable: Annotated[
        tuple[str, ...], Unit("", "names of surfaces of `world` that are no obstacles")
    ] = ()
    gravity: Annotated[float, positive("m/s^2", "gravity, downwards")] = 9.81
    step: Annotated[
        float, Unit("s", "time between nodes of free motion", low=0.002, high=0.5)
    ] = 0.04

    @classmethod
    def short_spellings(cls, fields: Fields) -> dict[str, object]:
        """Vehicle of a table, by its name, and obstacles, of which each has a name or a
        number.
        """
        world, passable = fields.inner("world"), fields.take("passable", [])
        rows = [*fields.tables("obstacles"), *world.tables("surfaces")]
        # read for its refusal: the names are checked when the phases are known
        world.tables("grippers")
        rows = [
            each
            for each in rows
            if not isinstance(passable, list) or each.table.get("name") not in passable
        ]
        named = [
            Fields({"name": f"obstacle{k}"} | each.table, each.where)
            for k, each in enumerate(rows)
        ]
        obstacles = tuple(record_from(Surface, each) for each in named)
        surfaces = [each.table.get("name") for each in world.tables("surfaces")]
        # after the surfaces, whose own faults come first
        if not isinstance(passable, list) or any(
            name not in surfaces for name in passable
        ):
            raise ValueError(
                f"{fields.at('passable')} = {shown(passable)}: must be names of"
                " surfaces of the world"
            )
        return {
            "vehicle": load_vehicle(fields.take("vehicle")),
            "obstacles": obstacles,
            "passable": tuple(passable),
        }

    def __post_init__(self) -> None:
        accept_fields(self, "", TaskError)
        n = self.vehicle.n
        if not self.phases:
            raise TaskError("phases: must be one phase or more")
        last = self.phases[-1]
        if last.kind == "hold" and last.to.velocity is None:
            # nothing comes after it: a tip that rests on a base that moves on would
            # rest for this instant only
            ending = replace(last, to=replace(last.to, rest=True))
            object.__setattr__(self, "phases", (*self.phases[:-1], ending))
        lists = [("start.joints", self.start.joints)]
        lists += [
            (f"phases[{k}].to.joints", each.to.joints)
            for k, each in enumerate(self.phases)
        ]
        for name, joints in lists:
            if joints and len(joints) != n:
                raise TaskError(
                    f"{name} = {shown(list(joints))}: must be {n} positions, one for"
                    " each joint, or left out"
                )
        names = [each.name for each in self.obstacles]
        for obstacle in self.obstacles:
            if names.count(obstacle.name) > 1:
                raise TaskError(
                    f"obstacles: name = {obstacle.name!r} stands twice; names must be"
                    " unique"
                )
            # a plan has the obstacles of one instant, and distances to solid bodies
            if obstacle.moves or obstacle.shape in ("hole", "heightfield"):
                raise TaskError(
                    f"obstacles[{obstacle.name}]: must stand still and be no plate with"
                    " a hole or heightfield"
                )
        for k, each in enumerate(self.phases):
            _check_phase(
                each, f"phases[{k}]", self.vehicle, self.phases[k - 1] if k else None
            )
        if self.world is not None:
            require_grippers(self)
        if any(rotor.tilt is not None for rotor in self.vehicle.rotors):
            raise TaskError(
                f"vehicle = {self.vehicle.name!r}: must have no tilting rotors; no plan"
                " turns them"
            )
        with errors_as(TaskError):
            require_plant(self.vehicle)
            _require_actuators(self.vehicle)


def _require_actuators(vehicle: Vehicle) -> None:
    """Refuse a vehicle with passive joints, which a plan would drive, or with rotors of
    any speed.

    Raises:
        ValueError: one line.
    """
    if passive := undriven_joints(vehicle):
        fix = (
            "must be above 0 (N m or N), for a plan drives every joint; a joint that"
            " [[joints]] hold holds is none"
        )
        raise ValueError(
            f"vehicle = {vehicle.name!r}: joints[{passive[0]}].effort_limit = 0: {fix}"
        )
    for rotor in vehicle.rotors:
        if not math.isfinite(float(rotor.max_speed)):
            fix = "must be finite (rad/s), for a plan limits thrusts by it"
            raise ValueError(
                f"vehicle = {vehicle.name!r}: rotors[{rotor.name}].max_speed = inf:"
                f" {fix}"
            )


def require_grippers(task: Task) -> None:
    """Refuse a task whose phases close or open a gripper that its world does not have.

    Raises:
        TaskError: one line.
    """
    names = [each.get("name") for each in (task.world or {}).get("grippers", [])]
    for k, phase in enumerate(task.phases):
        for word, name in (("gripper", phase.gripper), ("release", phase.release)):
            if name and name not in names:
                own = (
                    "be a gripper of [[world.grippers]], one of"
                    f" {', '.join(map(str, names))}"
                )
                allowed = own if names else "be left out without [[world.grippers]]"
                raise TaskError(f"phases[{k}].{word} = {name!r}: must {allowed}")


def _check_phase(
    phase: PlanPhase, at: str, vehicle: Vehicle, before: PlanPhase | None
) -> None:
    """Refuse a phase that cannot be planned.

    Raises:
        TaskError: one line.
    """
    goal = phase.to
    if phase.kind == "contact" and phase.contact is None:
        raise TaskError(
            f"{at}.contact: is missing; a phase of kind 'contact' needs one"
        )
    if phase.kind != "contact" and phase.contact is not None:
        raise TaskError(
            f"{at}.contact: must be left out in a phase of kind {phase.kind!r}"
        )
    if goal.attitude and len(goal.attitude) != 3:
        raise TaskError(
            f"{at}.to.attitude = {shown(list(goal.attitude))}: must be three"
            " angles, rad"
        )
    if goal.attitude and goal.heading is not None:
        raise TaskError(
            f"{at}.to.heading = {goal.heading:g}: must be left out beside attitude"
        )
    if goal.rest and goal.velocity is not None and any(goal.velocity):
        raise TaskError(
            f"{at}.to.velocity = {shown([*goal.velocity])}: must be left out beside"
            " rest"
        )
    # phases other than free motions are stated by where the tip is
    needs_tip = (
        phase.kind != "go"
        or goal.tip is not None
        or goal.tip_velocity is not None
        or goal.tip_axis is not None
    )
    if needs_tip and not vehicle.end_effector:
        raise TaskError(
            f"{at}: needs a vehicle with a tip; {vehicle.name!r} has none"
            f" (end_effector){vehicle.tip_cure}"
        )
    for whose, each in (
        ("", goal),
        (" of the phase before", before.to if before is not None else Goal()),
    ):
        if phase.resting and each.tip_velocity is not None and any(each.tip_velocity):
            value = f"to.tip_velocity = {shown([*each.tip_velocity])}"
            raise TaskError(
                f"{at}: {value}{whose}: must be left out or zero; the tip rests in this"
                " phase"
            )
    if (
        phase.kind != "go"
        and before is not None
        and before.to.tip is None
        and not before.resting
    ):
        raise TaskError(
            f"{at}: the tip rests where the phase before leaves it, which must say"
            " to.tip"
        )


def load_task(path: PathLike) -> Task:
    """Load a planning task from a TOML file, or a shipped one by its name.

    Args:
        path: path of a .toml file, or the name of a shipped task.

    Raises:
        TaskError: one line with file, field, value and what is allowed.
    """
    with errors_as(TaskError):
        text = file_name(path, "task")
        file = Path(text)
        shipped = LIBRARY / f"{text}.toml"
        # hides no file, as those have a suffix; Path.is_file raises for a long name
        if os.path.isfile(shipped):
            file = shipped
        elif file.suffix != ".toml":
            raise TaskError(
                f"task = {shown(text)}: must be a .toml file or one of"
                f" {', '.join(list_tasks())}"
            )
        else:
            require_file(file, f"task = {shown(text)}")
        try:
            table = read_toml(file.read_bytes())
            require_kind(table, "task")
            return task_from(table, file.parent)
        except ValueError as error:
            raise TaskError(f"{text}: {error}") from None


def task_from(table: object, folder: Path = Path()) -> Task:
    """Planning task from the table of its file.

    Args:
        table: as read from TOML.
        folder: where paths of vehicles and bodies begin.

    Raises:
        ValueError: one line with field, value and what is allowed.
    """
    fields = Fields(table, "")
    fields.require_schema()
    own = dict(fields.table)
    name = fields.take("vehicle")
    own.pop("schema", None)
    # a shipped vehicle's name goes before a file of that name
    if (
        isinstance(name, str)
        and name not in list_vehicles()
        and os.path.isfile(folder / name)
    ):
        own["vehicle"] = str(folder / name)
    if "world" in own:
        own["world"] = with_bodies(own["world"], folder)
    return record_from(Task, Fields(own, ""))


def vehicle_of_file(path: PathLike, folder: Path) -> str:
    """Name of a task's vehicle, or the path of its file from a folder, as a scenario
    there states it.
    """
    shipped = LIBRARY / f"{path}.toml"
    file = shipped if os.path.isfile(shipped) else Path(path)
    name = str(read_toml(file.read_bytes())["vehicle"])
    own = file.parent / name
    return (
        os.path.relpath(own, folder)
        if name not in list_vehicles() and os.path.isfile(own)
        else name
    )


LIBRARY = Path(__file__).parent / "library"
"""Folder of the shipped tasks."""


def list_tasks() -> tuple[str, ...]:
    """Return the names of the shipped planning tasks."""
    return tuple(sorted(each.stem for each in LIBRARY.glob("*.toml")))
