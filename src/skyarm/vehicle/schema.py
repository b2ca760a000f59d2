"""Schema of a vehicle's TOML file (``schema = 1``), and the line that says what is wrong with one.

Its tables stand in :mod:`skyarm.vehicle.schema_tables`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal, NoReturn, get_args

from pydantic import BaseModel, Field, ValidationError

from skyarm.files import did_you_mean
from skyarm.vehicle.check import VehicleError, refuse
from skyarm.vehicle.schema_tables import (
    AttachTable,
    BatteryTable,
    BodyTable,
    DragTable,
    FrameTable,
    JointOverride,
    LinkTable,
    Name,
    RotorDefaults,
    RotorTable,
    Table,
)

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
