"""Export of a controller as one C99 file with struct inputs, outputs and parameters;
needs libm only.

The file is written from the program that the law's own lines compute, so a double build
without contraction gives the bits of the Python law. Structure (topology, exact zeros
of the description, ablations) is folded in; every number the law reads is a parameter
that may change at run time.

With an estimator the file takes readings: the law stands behind the error-state filter,
as one step to a command.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial, reduce
from typing import Annotated, Any

from skyarm.algebra import Scalar, Scalars
from skyarm.algebra.scalars import absolute, logical_and, logical_or
from skyarm.compile import Program, trace
from skyarm.compile.c_source import Floats, StepFile, Struct, Units, make_struct
from skyarm.control.blocks.common import no_command
from skyarm.control.controller import (
    Controller,
    learns_load,
    part_of,
    presses,
    preview_leads,
    senses_force,
)
from skyarm.control.law_checks import (
    PERIODS,
    check_controller,
    checked_law,
    level,
    try_law,
)
from skyarm.control.model import TORQUE_GAINS
from skyarm.control.vectored_layer import turns_rotors
from skyarm.dynamics.actuators import Command
from skyarm.dynamics.actuators.drive import TORQUE_DRIVE, Drive
from skyarm.dynamics.actuators.hover import hover_trim
from skyarm.records.immutable import immutable
from skyarm.records.leaves import Dataclass, Place, blend, leaves, parts
from skyarm.records.units import Unit
from skyarm.reference import Reference
from skyarm.reference.carry import Carry
from skyarm.reference.trajectory import resting_arm
from skyarm.sensing.estimate.error_state_filter import ErrorStateFilter
from skyarm.sensing.estimate.filter_constants import AIDS, FilterMemory, blank
from skyarm.sensing.measurement import Measurement, blank_measurement
from skyarm.sensing.sensor_kinds import (
    EncoderReading,
    HeadingReading,
    ImuReading,
    PoseReading,
    PositionReading,
)
from skyarm.vehicle import Joint, Vehicle

SETPOINTS = {
    "efforts": Unit("", "command of each joint as in its line above, in that order")
}
"""Unit of the command's efforts in the C struct if some joints take setpoints."""

SPEEDS = {"rotor_speeds": Unit("rad/s", "unsigned, in the order of the rotors above")}


def units_of(joint: Joint, vehicle: Vehicle) -> str:
    """Text with a joint's kind, position unit and command unit."""
    slides = not joint.turns
    drive = drives_of(vehicle).get(joint.name, TORQUE_DRIVE)
    # of "rad or m" the first is for turning joints, the last for sliding ones
    takes = drive.takes.split(" or ")[-1 if slides else 0]
    if drive is not TORQUE_DRIVE:
        takes = f"setpoint of its {type(drive).__name__}" + (
            f" in {takes}" if takes else ""
        )
    return f"{joint.kind}, {'m' if slides else 'rad'}, {takes}"


def drives_of(vehicle: Vehicle) -> dict[str, Drive]:
    """Drives by joint name of the joints that take a setpoint other than torque."""
    return {
        each.name: each.drive for each in vehicle.drives if not each.drive.takes_torque
    }


def command_units(vehicle: Vehicle, *place: str) -> Units:
    """Units of a command's fields in the C struct, by path; empty if all joints take
    torques.
    """
    return {place: SPEEDS | SETPOINTS} if drives_of(vehicle) else {}


@immutable
class FilterReadings:
    """Sensor inputs of an exported state estimator, with time stamps; empty for unused
    sensors.

    The time stamp shows whether a reading is new; where none has arrived, the previous
    one is repeated. The force at the tip bypasses the filter, to a law that uses it.
    """

    imu: ImuReading
    pose: PoseReading | tuple[()] = ()
    position: PositionReading | tuple[()] = ()
    heading: HeadingReading | tuple[()] = ()
    encoders: EncoderReading | tuple[()] = ()
    tip_force: Annotated[
        Scalars,
        Unit("N", "reading of the force sensor: force on the tip, axes of the tip"),
    ] = ()


@immutable
class EstimatedConstants:
    """Constants of an exported law and of its state estimator, and the time between two
    calls (s).
    """

    parameters: Any
    estimator: ErrorStateFilter
    period: Annotated[float, Unit("s", "time between two calls")]


@immutable
class EstimatedMemory:
    """Internal states of state estimator and control law, the last command, and older
    ones that are still to act.

    ``underway`` is oldest first: as many as the command's delay has whole control
    periods.
    """

    estimate: FilterMemory
    law: Any
    sent: Command
    underway: tuple[Command, ...] = ()


def blank_readings(
    estimator: ErrorStateFilter, joints: int, tip_force: int
) -> FilterReadings:
    """Placeholder sensor readings with the shapes that a state estimator requires."""
    named = {
        PoseReading: "pose",
        PositionReading: "position",
        HeadingReading: "heading",
    }
    aids: dict[str, Any] = {named[kind]: blank(kind) for kind in AIDS[estimator.aiding]}
    still = (0.0,) * joints
    encoders = (
        EncoderReading(time=0.0, joints=still, joint_rates=still) if joints else ()
    )
    return FilterReadings(
        imu=blank(ImuReading), encoders=encoders, tip_force=(0.0,) * tip_force, **aids
    )


def filtered_readings(readings: FilterReadings) -> dict[str, Any]:
    """Readings of the sensors that the state estimator takes, by name."""
    return {
        name: each
        for name, each in parts(readings).items()
        # a law takes the force at the tip past the filter
        if leaves(each) and name != "tip_force"
    }


def have_come(readings: FilterReadings) -> Scalar:
    """True if every reading that the filter needs has a time above 0, and an attitude a
    length of 1 within 1 %.
    """
    taken = filtered_readings(readings).values()
    conditions: list[Scalar] = [each.time > 0.0 for each in taken]
    conditions += [
        # the square of a length that is 1 within 1 %
        absolute(sum((c * c for c in leaves(each.quaternion)), 0.0) - 1.0) < 0.02
        for each in taken
        if isinstance(each, PoseReading)
    ]
    come: Scalar = reduce(logical_and, conditions)
    return come


def first_estimated_memory(
    controller: Controller, estimator: ErrorStateFilter, late: int = 0
) -> EstimatedMemory:
    """Initial internal states of state estimator and control law, in hover with all
    joints at zero.

    ``late`` is the largest number of control periods by which a command acts late.
    """
    model = controller.par.model
    trim = hover_trim(model.vehicle, model.vehicle.zeros, model.gravity)
    drives = drives_of(model.vehicle)
    efforts = tuple(
        drives[joint.name].standing(effort, 0.0) if joint.name in drives else effort
        for joint, effort in zip(model.vehicle.joints, trim.efforts, strict=True)
    )
    sent = Command(rotor_speeds=tuple(trim.speeds), efforts=efforts).dense()
    start = estimator.start(model.vehicle)
    return EstimatedMemory(
        estimate=start, law=controller.memory, sent=sent, underway=(sent,) * late
    )


def estimated_law(
    controller: Controller, late: tuple[int, int] = (0, 0)
) -> Callable[..., tuple[EstimatedMemory, Command]]:
    """Step function (constants, readings, reference, memory) -> (memory, command) of
    state estimator and law.

    Until all readings have come the memory stays, and the command is the memory's.
    ``late``: whole control periods by which the commands of rotors and of joints act
    late.
    """
    law = checked_law(controller)

    def step(
        constants: EstimatedConstants,
        readings: FilterReadings,
        reference: Reference,
        memory: EstimatedMemory,
    ) -> tuple[EstimatedMemory, Command]:
        model = constants.parameters.model
        estimator = constants.estimator.believing(model.vehicle, model.gravity)
        arrived = filtered_readings(readings)
        queue = (*memory.underway, memory.sent)
        # the filter's model must have what acts now, not what was just sent
        rotors, joints = (queue[-1 - age] for age in late)
        acting = replace(rotors, efforts=joints.efforts)
        estimate, measurement = estimator.step(
            memory.estimate, arrived, acting, constants.period
        )
        if readings.tip_force:
            measurement = replace(measurement, tip_force=readings.tip_force)
        following, command = law(
            memory.law,
            measurement,
            reference,
            constants.period,
            par=constants.parameters,
        )
        new = EstimatedMemory(
            estimate=estimate, law=following, sent=command.dense(), underway=queue[1:]
        )
        # a zeroed struct would be the truth that the filter starts from
        now = blend(
            logical_or(memory.estimate.started > 0.5, have_come(readings)), new, memory
        )
        return now, now.sent

    return step


SHORTER = {
    "parameters": "",
    "model": "",
    "vehicle": "",
    "body": "",
    "links": "link",
    "frames": "frame",
}
"""Names in a parameter's path, with their shorter forms in C."""

STRUCTS = {
    "measurement": "Readings of the sensors.",
    "reference": "Desired motion.",
    "memory": "State of the law between calls; begin with the first memory.",
    "command": "Command of rotors and joints.",
    "parameters": (
        "Numbers of the nominal model, and gains; exact zeros and ones are folded into"
        " the code."
    ),
}
"""Comments of the C structs, by struct."""

NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,63}")


@immutable
class Constants:
    """Constants of an exported law, and the time between two calls (s)."""

    parameters: Any
    period: Annotated[float, Unit("s", "time between two calls")]


@immutable
class ExportedC:
    """An exported C file: its name, text, number of operations and parameter names."""

    name: str
    text: str
    operations: int
    parameters: tuple[str, ...]


def export_c(
    controller: Controller,
    *,
    name: str,
    period: float,
    single: bool = False,
    generator: str = "skyarm",
    estimator: ErrorStateFilter | None = None,
    late: tuple[int, int] = (0, 0),
    notes: Sequence[str] = (),
) -> ExportedC:
    """Write a controller as a C file.

    Args:
        controller: law and constants; its model's vehicle gives joints and rotors.
        name: prefix of every name of the file that others see; a C identifier.
        period: time between two calls, s.
        single: float in place of double.
        generator: name and version of the writing program, for the opening comment.
        estimator: state estimator between readings and law; the file's measurement then
            holds the readings.
        late: whole control periods by which the commands of rotors and of joints act
            late, for the estimator's model.
        notes: lines for the opening comment.

    Raises:
        ValueError: the name is no C identifier of at most 64 characters, the law cannot
            be traced, the estimator's model takes setpoints of the vehicle's drives for
            torques, or an estimator should compute in float.
    """
    if not NAME.fullmatch(name):
        raise ValueError(
            f"name = {name!r}: must be letters, digits and _, begin with a letter, 64"
            " at most"
        )
    controller.require_compiled("export as C")
    check_controller(controller)
    vehicle = controller.par.model.vehicle
    if estimator is not None:
        if single:
            raise ValueError(
                "--float32: must be left out with an estimator, whose times need"
                " double: export in double, or the law alone, without [estimator]"
            )
        estimator.require_torques(
            vehicle.name, {each.name: each.drive for each in vehicle.drives}
        )
    records = _examples(controller, period, estimator, max(late))
    seen = level(_blank(controller), float(controller.par.model.gravity))
    try_law(controller, period, seen, (records["reference"],) * PERIODS)
    program = _trace_step(controller, records, estimator, late)
    structs = _structs(
        controller, records, program, behind_filter=estimator is not None
    )
    file = StepFile(
        name=name,
        floats=Floats(single),
        program=program.lowered,
        structs=structs,
        notes=STRUCTS,
        inputs=("measurement", "reference"),
        output="command",
    )
    operations = sum(
        node.op not in ("input", "const") for node in program.lowered.nodes
    )
    names = tuple(member.name for member in structs["parameters"].members)
    opening = _header(controller, file, period, operations, generator, estimator)
    # behind the line that names the file, before what it holds
    opening[1:1] = notes
    text = file.text(opening)
    return ExportedC(name=name, text=text, operations=operations, parameters=names)


def _examples(
    controller: Controller, period: float, estimator: ErrorStateFilter | None, late: int
) -> dict[str, Any]:
    """Example inputs of the exported C function, which give array lengths and default
    values.
    """
    vehicle = controller.par.model.vehicle
    records = {
        "parameters": Constants(parameters=controller.par, period=period),
        "measurement": _blank(controller),
        "reference": (
            Reference(
                **resting_arm(vehicle.n), **_reference_inputs(controller.par, vehicle.n)
            ).dense()
        ),
        "memory": controller.memory,
    }
    if estimator is not None:
        records["parameters"] = EstimatedConstants(
            parameters=controller.par, estimator=estimator, period=period
        )
        records["measurement"] = blank_readings(
            estimator, vehicle.n, tip_force=_axes_at_tip(controller)
        )
        records["memory"] = first_estimated_memory(controller, estimator, late)
    return records


def _blank(controller: Controller) -> Measurement:
    """Placeholder measurement with the array lengths of the controller's vehicle."""
    vehicle = controller.par.model.vehicle
    axes = _axes_at_tip(controller)
    return blank_measurement(
        vehicle.n, len(vehicle.rotors), len(vehicle.tilts), tip_force=axes
    )


def _axes_at_tip(controller: Controller) -> int:
    """Number of tip force components that the law measures: 3 or 0."""
    return 3 if senses_force(controller.par) else 0


def _reference_inputs(par: Dataclass, joints: int) -> dict[str, Any]:
    """Reference fields that the law uses in addition to the motion (contact, load,
    preview, team), as placeholders.
    """
    # force, speed, normal, grip, pivot and axis: as many as there may be
    return {
        "push": (0.0,) * 12 if presses(par) else (),
        "load": (0.0,) if learns_load(par) else (),
        "carry": () if part_of(par, "carrying") is None else Carry.none().numbers,
        "ahead": (0.0,) * (3 * (4 + joints) * len(preview_leads(par))),
    }


def _trace_step(
    controller: Controller,
    records: dict[str, Any],
    estimator: ErrorStateFilter | None,
    late: tuple[int, int],
) -> Program:
    if estimator is not None:
        return trace(estimated_law(controller, late), *records.values())
    law = checked_law(controller)

    def step(
        constants: Constants,
        measurement: Measurement,
        reference: Reference,
        memory: Any,
    ) -> tuple[Any, Command]:
        following, command = law(
            memory, measurement, reference, constants.period, par=constants.parameters
        )
        # a C struct has one layout, so a memory that grows cannot be written
        if len(leaves(following)) != len(leaves(memory)):
            raise ValueError(
                f"law '{controller.name}': its memory must keep its structure to be"
                " written in C"
            )
        return following, command.dense()

    return trace(step, *records.values())


def _structs(
    controller: Controller,
    records: dict[str, Any],
    program: Program,
    *,
    behind_filter: bool,
) -> dict[str, Struct]:
    """C structs of the function's inputs and outputs; parameters are limited to those
    that the control law reads.
    """
    live = {node.index for node in program.lowered.nodes}
    # the parameters are the first inputs
    used = [node.index in live for node in program.lowered.inputs]
    vehicle = controller.par.model.vehicle
    angles = (0.0,) * (len(vehicle.tilts) if turns_rotors(controller) else 0)
    command = replace(no_command(vehicle), tilts=angles)
    units = {"command": command_units(vehicle)}
    if behind_filter:
        places = [
            ("sent",),
            *(("underway", str(i)) for i in range(len(records["memory"].underway))),
        ]
        units["memory"] = {
            key: each
            for place in places
            for key, each in command_units(vehicle, *place).items()
        }
    structs = {}
    for key, record in (records | {"command": command}).items():
        # measurement, reference and command have the same members in every law of a
        # vehicle
        everything = [True] * len(leaves(record))
        structs[key] = make_struct(
            record,
            _member,
            used if key == "parameters" else everything,
            {**_on_torque(controller), **units.get(key, {})},
        )
    return structs


MOST_LAYERS = 3
"""Largest number of layers around a control law: safety, tilting rotors, actuators."""


def _on_torque(controller: Controller) -> Units:
    """Units of joint gains that act on torque, by parameter path such as
    recovery.joint_gains.
    """
    deep = [("inner",) * layers for layers in range(MOST_LAYERS + 1)]
    # the recovery is a PD law on torque, whatever it protects
    places = [(*place, "recovery", "joint_gains") for place in deep]
    if controller.name.removeprefix("guarded_") in ("decoupled_pd", "admittance_pd"):
        places += [(*place, "joint_gains") for place in deep]
    return {("parameters", *place): TORQUE_GAINS for place in places}


def _member(path: Place) -> str:
    """Name of a C struct member from a field path, as link0_mass from (..., "links",
    "0", "body", "mass").
    """
    pieces: list[str] = []
    for part in path:
        if part.isdigit() and pieces and pieces[-1] in SHORTER.values():
            pieces[-1] += part
        else:
            pieces.append(SHORTER.get(part, part))
    text = "_".join(filter(None, pieces))
    # a C name must not begin with a digit, as a member of a tuple would
    return text if text[:1].isalpha() else f"value{text}"


def _header(
    controller: Controller,
    file: StepFile,
    period: float,
    operations: int,
    generator: str,
    estimator: ErrorStateFilter | None,
) -> list[str]:
    """Opening comment of the C file: purpose, law, vehicle, conventions and how to
    compile.
    """
    name, vehicle = file.name, controller.par.model.vehicle
    step = (
        controller.law.func if isinstance(controller.law, partial) else controller.law
    )
    paragraphs = (inspect.getdoc(step) or controller.name).split("\n\n")
    # of a law that is a file of its own
    if not any(part.startswith("Source:") for part in paragraphs):
        paragraphs += (inspect.getdoc(inspect.getmodule(step)) or "").split("\n\n")
    clocked = any(
        member.name == "period" for member in file.structs["parameters"].members
    )
    kept = [
        part
        for part in paragraphs
        if part is paragraphs[0] or part.startswith("Source:")
    ]
    return [
        f"{name}: controller '{controller.name}' for the vehicle '{vehicle.name}'.",
        *_filter_lines(estimator),
        (
            f"Generated by {generator}: change the law or the vehicle and export again,"
            " do not edit."
        ),
        "",
        *"\n".join(kept).split("\n"),
        *([f"Not defined at: {controller.limit}"] if controller.limit else []),
        "",
        f"Vehicle: {vehicle.title or vehicle.name}",
        *(
            f"  joint {i}: {link.joint.name} of link {i} '{link.name}',"
            f" {units_of(link.joint, vehicle)}"
            for i, link in enumerate(vehicle.links)
        ),
        *(
            f"  rotor {i}: {rotor.name}, {'ccw' if rotor.direction > 0 else 'cw'}, at "
            f"[{', '.join(f'{float(c):.4g}' for c in rotor.position)}] m"
            for i, rotor in enumerate(vehicle.rotors)
        ),
        "",
        (
            "SI units and radians. World z up; base x forward, y left, z up;"
            " quaternions w x y z, base to world."
        ),
        (
            f"Call {name}_step once every {period:g}"
            f" s{'' if clocked else ' or at another rate: this law has no clock'}."
        ),
        *_preview_lines(controller),
        *_carry_lines(controller),
        *(NAN if estimator is None else NAN_BEHIND_FILTER).split("\n"),
        (
            f"{operations} operations in {file.floats.kind}; nothing is allocated,"
            " nothing is global but constants."
        ),
        "",
        f"  cc -std=c99 -O2 -c {name}.c        (link with -lm)",
        "",
        (
            "Doubles have the bits of the law in Python: GCC, clang and MSVC are told"
            " not to contract a * b + c."
        ),
        (
            f"For the declarations alone: #define {name.upper()}_INTERFACE_ONLY, then"
            " #include this file."
        ),
    ]


NAN = """\
A NaN that the law reads reaches the command: check the command before an actuator \
gets it."""

NAN_BEHIND_FILTER = """\
The filter refuses an aiding reading that is NaN, and goes on without it: the \
command stays finite. Watch memory:
estimate_taken must grow, estimate_refused hardly, the diagonal of \
estimate_covariance_... must stay small.
A NaN of another reading stays: check the command before an actuator gets it; \
begin with the first memory again."""
"""Comment in the C file on NaN, of a law alone and of a law with its estimator."""


def _filter_lines(estimator: ErrorStateFilter | None) -> list[str]:
    """Comment lines in the C file on the readings that its estimator takes."""
    if estimator is None:
        return []
    return f"""\
The law receives the estimate of an error-state filter: \
{estimator.aiding}, inertial unit.
Readings: one clock for all time stamps, s, above 0; a stamp is the \
instant at which the sensor measured.
Where no new reading came, repeat the old one with its stamp. The filter \
starts at the first call in which
every stamp is above 0 and the quaternion of a pose has length 1; until \
then the command is that of the first
memory, a hover. So call first when every sensor has given a reading.\
""".splitlines()


def _carry_lines(controller: Controller) -> list[str]:
    """Comment lines in the C file on the instructions of a team, and on the estimate
    that its law takes.
    """
    if part_of(controller.par, "carrying") is None:
        return []
    return """\
Reference, carry: 1 in a grasp, else 0; then, three numbers each in world \
axes: known force (N) and moment
(N m) on the tip, rates of the force (N/s) and moment (N m/s) that leave \
the observer, shift of the tip (m),
its rate, its acceleration; turn of the heading about the tip (rad), its \
rate, its acceleration; at last the
bandwidth at which the shift settles (rad/s), and the mass of the load \
that the tip moves (kg).
Memory, parts, carrying: estimated force (N) and moment (N m) on the tip.\
""".splitlines()


def _preview_lines(controller: Controller) -> list[str]:
    """Comment lines in the C file on the times and order of the future reference
    samples.
    """
    leads = ", ".join(f"{float(lead):.4g}" for lead in preview_leads(controller.par))
    if not leads:
        return []
    return [
        (
            f"Reference, ahead: of each of the instants {leads} s after the sample that"
            " is held, value, rate and"
        ),
        (
            "acceleration of x, y, z, yaw and every joint, as the plan has them; a"
            " hover repeats the held ones."
        ),
    ]
