"""Tables of a vehicle's TOML file below the file itself, field by field.

A field's description says what is allowed; it is the text of the error and of the documentation.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

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
