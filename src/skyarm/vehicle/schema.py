"""Schema of a vehicle's TOML file (``schema = 1``), and the line that says what is wrong with one.

Its tables stand in :mod:`skyarm.vehicle.schema`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal, NoReturn, get_args

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from skyarm.files import did_you_mean
from skyarm.vehicle.check import VehicleError, refuse

Finite = Annotated[float, Field(allow_inf_nan=False)]
NotNegative = Annotated[float, Field(allow_inf_nan=False, ge=0.0)]
Positive = Annotated[float, Field(allow_inf_nan=False, gt=0.0)]
Limit = Annotated[float, Field(gt=0.0)]
Effort = Annotated[float, Field(ge=0.0)]
Triple = Annotated[list[Finite], Field(min_length=3, max_length=3)]
Quadruple = Annotated[list[Finite], Field(min_length=4, max_length=4)]
Name = Annotated[str, Field(min_length=1)]

Column = list[NotNegative]

COLUMN = "a list of finite numbers of at least 0 that rise"
NAME = "text that is not empty, unique in its table"
TRIPLE_M = "three finite numbers, m"
COEFFICIENT = "a finite number of at least 0"


class Table(BaseModel):
    """A TOML table: no unknown fields, no silent conversions."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, defer_build=True)


class PartTable(Table):
    """A rigid piece of a link; without inertia a point mass."""

    name: Name = Field(description=NAME)
    mass: NotNegative = Field(description="a finite number of at least 0, kg")
    com: Triple = Field(default=[0.0, 0.0, 0.0], description=TRIPLE_M + ", in the link's frame")
    inertia: list[Finite] = Field(
        default=[0.0, 0.0, 0.0],
        min_length=3,
        max_length=6,
        description="three (xx yy zz) or six (xx yy zz xy xz yz) finite numbers, kg m^2",
    )
    planar: bool = Field(default=False, description="true or false")


class BodyTable(Table):
    """Mass distribution of the base or a link."""

    mass: NotNegative | None = Field(default=None, description="a finite number of at least 0, kg")
    com: Triple | None = Field(default=None, description=TRIPLE_M + ", in the link's frame")
    inertia: list[Finite] | None = Field(
        default=None,
        min_length=3,
        max_length=6,
        description="three (xx yy zz) or six (xx yy zz xy xz yz) finite numbers, kg m^2",
    )
    planar: bool = Field(default=False, description="true or false")
    parts: list[PartTable] = Field(default=[], description="an array of tables")


class PoseTable(Table):
    """Where a frame sits in another one."""

    position: Triple = Field(default=[0.0, 0.0, 0.0], description=TRIPLE_M)
    rpy: Triple | None = Field(default=None, description="three finite numbers, rad: R = Rz(yaw) Ry(pitch) Rx(roll)")
    quaternion_wxyz: Quadruple | None = Field(default=None, description="four finite numbers of unit length")


class Actuation(Table):
    """Limits and friction of a joint."""

    lower: float | None = Field(default=None, description="a number, rad or m")
    upper: float | None = Field(default=None, description="a number, rad or m")
    effort_limit: Effort | None = Field(default=None, description="a number of at least 0, N m or N")
    damping: NotNegative | None = Field(default=None, description=COEFFICIENT + ", N m s/rad or N s/m")
    coulomb: NotNegative | None = Field(default=None, description=COEFFICIENT + ", N m or N")
    coulomb_rate: Positive | None = Field(default=None, description="a finite number greater than 0, rad/s or m/s")
    armature: NotNegative | None = Field(default=None, description=COEFFICIENT + ", kg m^2 or kg")
    stop_stiffness: NotNegative | None = Field(default=None, description=COEFFICIENT + ", N m/rad or N/m")
    stop_damping: NotNegative | None = Field(default=None, description=COEFFICIENT + ", s/rad or s/m")


class MimicTable(Table):
    """What a joint that follows another one is to it."""

    joint: Name = Field(description="the name of another joint")
    ratio: Finite = Field(default=1.0, description="a finite number but 0, rad or m per rad or m")
    offset: Finite = Field(default=0.0, description="a finite number, rad or m")


class JointTable(PoseTable, Actuation):
    """Joint between a link and its parent."""

    name: Name = Field(description=NAME)
    kind: Literal["revolute", "prismatic"] = Field(default="revolute", description="'revolute' or 'prismatic'")
    axis: Triple = Field(
        description="three finite numbers, not all zero, in the joint's frame; every joint has an axis"
    )
    mimic: MimicTable | None = Field(default=None, description="a table: joint, ratio, offset")


class LinkTable(BodyTable):
    """Body that moves against its parent."""

    name: Name = Field(description=NAME)
    parent: Name = Field(description="the name of one parent, 'base' or a link (closed chains are not supported)")
    joint: JointTable = Field(description="a table")


class JointOverride(Actuation):
    """Limits and friction of a joint that a URDF file describes."""

    name: Name = Field(description=NAME)


class AttachTable(PoseTable):
    """An arm on the airframe: the root link of its file sits at a pose in a link."""

    arm: Name = Field(description="the path of a .urdf, .xml (MJCF) or .toml file, relative to this file")
    to: Name = Field(default="base", description="'base', or the name of a link or a frame")
    prefix: str = Field(default="", description="text, put before every name of the arm")
    mimic: Literal["lock", "couple"] | None = Field(default=None, description="'lock' or 'couple'")
    armature: NotNegative = Field(default=0.0, description=COEFFICIENT + ", kg m^2")


class ThrustTableTable(Table):
    """Rows of a data sheet, a list for each column."""

    speed: Column | None = Field(default=None, description=COLUMN + ", rad/s")
    thrust: Column = Field(description=COLUMN + ", N")
    torque: Column = Field(default=[], description=COLUMN + ", N m")
    current: Column = Field(default=[], description=COLUMN + ", A")
    throttle: Column = Field(default=[], description=COLUMN + ", 0 to 1")


class TiltTable(Table):
    """Servo that turns a rotor's axis."""

    axis: Triple | None = Field(default=None, description="three finite numbers, across the rotor's axis, base frame")
    lower: Finite = Field(description="a finite number from -pi to 0, rad")
    upper: Finite = Field(description="a finite number from 0 to pi, rad")
    time_constant: Positive = Field(description="a finite number greater than 0, s")
    max_rate: Limit | None = Field(default=None, description="a number greater than 0, rad/s")


class RotorDefaults(Table):
    """Values of every rotor that does not state its own."""

    axis: Triple | None = Field(default=None, description="three finite numbers, not all zero, in the base frame")
    thrust_coefficient: Positive | None = Field(default=None, description="a finite number greater than 0, N s^2/rad^2")
    moment_coefficient: NotNegative | None = Field(default=None, description=COEFFICIENT + ", m")
    drag_coefficient: NotNegative | None = Field(default=None, description=COEFFICIENT + ", N s^2/(rad m)")
    rolling_moment_coefficient: NotNegative | None = Field(default=None, description=COEFFICIENT + ", N s^2/rad")
    time_constant_up: Positive | None = Field(default=None, description="a finite number greater than 0, s")
    time_constant_down: Positive | None = Field(default=None, description="a finite number greater than 0, s")
    max_speed: Limit | None = Field(default=None, description="a number greater than 0, rad/s")
    inertia: NotNegative | None = Field(default=None, description=COEFFICIENT + ", kg m^2")
    thrust_table: ThrustTableTable | None = Field(default=None, description="a table of columns")
    tilt: TiltTable | None = Field(default=None, description="a table: axis, lower, upper, time_constant, max_rate")


class RotorTable(RotorDefaults):
    """Rotor on the base."""

    name: Name = Field(description=NAME)
    position: Triple = Field(description=TRIPLE_M + ", in the base frame")
    direction: Literal["ccw", "cw"] = Field(description="'ccw' or 'cw', seen against the axis (from its tip)")


class FrameTable(PoseTable):
    """Named frame fixed to a link."""

    name: Name = Field(description=NAME)
    link: Name = Field(default="base", description="'base' or the name of a link")


class DragTable(Table):
    """Drag of the airframe."""

    area: Annotated[list[NotNegative], Field(min_length=3, max_length=3)] = Field(
        description="three finite numbers of at least 0, m^2"
    )
    air_density: NotNegative = Field(default=1.225, description="a finite number of at least 0, kg/m^3")


class CurveTable(Table):
    """Open-circuit voltage of a cell."""

    charge: Column = Field(description=COLUMN + ", 0 to 1")
    voltage: Column = Field(description=COLUMN + ", V")


class BatteryTable(Table):
    """Battery of the rotors."""

    cells: Annotated[int, Field(ge=1)] = Field(description="a whole number of at least 1, in series")
    capacity: Positive = Field(description="a finite number greater than 0, A h")
    resistance: NotNegative = Field(description=COEFFICIENT + ", ohm")
    open_circuit: CurveTable = Field(description="a table of columns charge and voltage")
    reference_voltage: Positive = Field(description="a finite number greater than 0, V")
    charge: NotNegative = Field(default=1.0, description="a number from 0 to 1")
    standing_power: NotNegative = Field(default=0.0, description=COEFFICIENT + ", W")
    efficiency: Positive = Field(default=0.7, description="a number above 0 and at most 1")
    esc: Literal["governed", "open"] = Field(default="governed", description="'governed' or 'open'")


CLOSURES = ("closures", "closure", "loops", "loop", "loop_joints", "loop_closures", "constraints", "equality")
"""Tables in which other formats describe closed chains: refused by that name."""


class VehicleFile(Table):
    """The whole file."""

    schema_version: Literal[1] = Field(alias="schema", description="1")
    name: Name = Field(description="text that is not empty")
    title: str = Field(default="", description="text")
    urdf: Name | None = Field(default=None, description="the path of a URDF file, relative to this file")
    base: BodyTable | None = Field(default=None, description="a table")
    links: list[LinkTable] = Field(default=[], description="an array of tables")
    joints: list[JointOverride] = Field(default=[], description="an array of tables")
    rotor_defaults: RotorDefaults = Field(default=RotorDefaults(), description="a table")
    rotors: list[RotorTable] = Field(default=[], description="an array of tables")
    frames: list[FrameTable] = Field(default=[], description="an array of tables")
    end_effector: str = Field(default="", description="the name of a frame")
    joint_limits: Literal["stop", "end"] = Field(
        default="stop", description="'stop' (stops hold the joints there) or 'end' (passing one ends the flight)"
    )
    mjcf: Name | None = Field(default=None, description="the path of an MJCF file, relative to this file")
    airframe: Name | None = Field(
        default=None, description="a vehicle: a name of the library, or the path of its file, relative to this file"
    )
    attach: list[AttachTable] = Field(default=[], description="an array of tables")
    mimic: Literal["lock", "couple"] = Field(default="lock", description="'lock' or 'couple'")
    repair: bool = Field(default=False, description="true or false")
    drag: DragTable | None = Field(default=None, description="a table")
    battery: BatteryTable | None = Field(default=None, description="a table")
    drives: dict[str, dict[str, Any]] = Field(
        default={}, description="tables of drives by the joint's name: kind and its numbers"
    )
    sources: dict[str, str] = Field(default={}, description='a table of texts: field = "where its number comes from"')


def parse(document: Mapping[str, Any]) -> VehicleFile:
    """Check a TOML document field by field.

    Raises:
        VehicleError: one line with the first wrong field, its value and what is allowed.
    """
    try:
        return VehicleFile.model_validate(document)
    except ValidationError as error:
        errors = error.errors(include_url=False, include_context=False)
    # unknown fields first, all of them: they are often misspelt names of those that are then said to be missing
    unknown = [_refusal(document, each) for each in errors if each["type"] == "extra_forbidden"]
    raise VehicleError("; ".join(map(str, unknown)) if unknown else str(_refusal(document, errors[0])))


def _refusal(document: Mapping[str, Any], error: Any) -> VehicleError:
    """An error of the schema as a line."""
    try:
        _report(document, error)
    except VehicleError as line:
        return line


def _report(document: Mapping[str, Any], error: Any) -> NoReturn:
    location = error["loc"]
    field = path_text(document, location)
    if error["type"] == "extra_forbidden":
        if location[-1] in CLOSURES:
            refuse(field, error["input"], "closed chains are not supported")
        table = _fields(location[:-1])
        meant = did_you_mean(location[-1], table)
        refuse(field, error["input"], f"unknown field; {meant}allowed: {', '.join(table)}")
    allowed = next((text for end in range(len(location), 0, -1) if (text := _allowed(location[:end]))), error["msg"])
    if error["type"] == "missing":
        raise VehicleError(f"{field} = (missing): must be {allowed}")
    refuse(field, error["input"], f"must be {allowed}")


def path_text(document: Any, location: tuple[int | str, ...]) -> str:
    """``links[upper].joint.axis[0]``: array entries by their names where they have one."""
    text, here = "", document
    for step in location:
        try:
            here = here[step]
        except (KeyError, IndexError, TypeError):
            here = None
        if isinstance(step, int):
            name = here.get("name") if isinstance(here, dict) else None
            text += f"[{name if isinstance(name, str) and name else step}]"
        else:
            text += f".{step}" if text else str(step)
    return text


def _fields(location: tuple[int | str, ...]) -> dict[str, Any]:
    """Fields of the table at a location, by the names they have in a file."""
    table: type[BaseModel] = VehicleFile
    for step in location:
        if isinstance(step, str):
            found = _table_of(_named(table).get(step))
            if found is None:
                return {}
            table = found
    return _named(table)


def _named(table: type[BaseModel]) -> dict[str, Any]:
    return {info.alias or name: info for name, info in table.model_fields.items()}


def _table_of(info: Any) -> type[BaseModel] | None:
    waiting = [info.annotation] if info is not None else []
    while waiting:
        kind = waiting.pop()
        if isinstance(kind, type) and issubclass(kind, BaseModel):
            return kind
        waiting.extend(get_args(kind))
    return None


def _allowed(location: tuple[int | str, ...]) -> str:
    """Description of the field at a location."""
    if not isinstance(location[-1], str):
        return ""
    info = _fields(location[:-1]).get(location[-1])
    return (info.description or "") if info is not None else ""
