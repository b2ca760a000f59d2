"""Meanings, defaults and allowed values of keys of scenario and vehicle files that no field of a record declares.

Fields with a unit declare their meaning in the unit. Texts, flags, tables and computed defaults are described here, for
``skyarm show words`` and for the reference pages.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple


class WordText(NamedTuple):
    """Description of one key of a file.

    Attributes:
        meaning: meaning where the field's unit has none.
        default: value that a left-out key has, in words, where the program computes it.
        allowed: allowed values in words, where bounds do not say them.
        effect: effect of a higher or lower value.
        entry: type in words, where that of the field says less.
    """

    meaning: str = ""
    default: str = ""
    allowed: str = ""
    effect: str = ""
    entry: str = ""


VEHICLES = "a shipped name, or a path relative to this file"
PERIODS = "whole control periods"
STEPS = "whole physics steps"
RESPONSE = "larger values make the law act on an older state; the loop loses phase"
LATE = "larger values make commands take effect later; the loop loses phase"
WHEN = "needed only where changes or sweeps vary one of them"
LATER = "from a third of the flight to its end"

PATHS: Mapping[str, WordText] = {
    "schema": WordText("version of the file format", "1", "1"),
    "name": WordText("name of the flight and of its files", "", "1 to 100 characters, valid in a file name"),
    "title": WordText("description in one line"),
    "duration": WordText("length of the flight", "", "above 0, whole control periods"),
    "seed": WordText("seed of all random numbers", "", "0 to 2^32 - 1"),
    "episode": WordText(
        "number of the flight in a study; with `seed` it gives all random numbers", "", "0 to 2^32 - 1"
    ),
    "rates": WordText("[clocks of the loop](#rates)", "see its table"),
    "rates.physics": WordText(
        "rate of the physics steps; delays of commands are whole steps",
        "",
        "1 to 1e6",
        "higher rates integrate more exactly and take longer; the default `rk4` of `rigid_body` ignores it",
    ),
    "rates.control": WordText(
        "rate at which the law is called",
        "",
        "divides `physics`",
        "higher rates react sooner and take longer",
    ),
    "rates.reference": WordText(
        "rate at which the reference is sampled and held",
        "",
        "divides `control`",
        "higher rates give the law a smoother held reference",
    ),
    "plant": WordText("[the vehicle as simulated](#plant)", "required"),
    "plant.vehicle": WordText("vehicle that is simulated", "required", VEHICLES),
    "plant.gravity": WordText("acceleration of gravity along world -z", "9.81"),
    "plant.kind": WordText("simulator: the library's rigid-body dynamics, or MuJoCo"),
    "plant.integrator": WordText("[integrator](#integrators) of the plant"),
    "plant.closure": WordText("grasps as forces of springs, or as constraints of `mujoco` of the same stiffness"),
    "plant.drives.*": WordText("[drive](actuators.md#servos) of this joint", "the vehicle's"),
    "plant.drives.*.kind": WordText("kind of the drive"),
    "plant.payload.frame": WordText("frame that carries the payload", "the tip"),
    "model": WordText("[the vehicle as the law knows it](#model)", "the plant's vehicle and gravity"),
    "model.vehicle": WordText("vehicle that the law assumes", "required", f"{VEHICLES}; a planar model is allowed"),
    "model.gravity": WordText("acceleration of gravity that the law assumes", "9.81"),
    "model.payload.frame": WordText("frame that carries the payload", "the tip"),
    "controller": WordText("[law with its gains](#controller)"),
    "controller.preset": WordText("controller with published gains, without other options", "none"),
    "controller.law": WordText(
        "law with options: [cards of the laws](laws.md)",
        "required, unless `preset`, `autopilot` or a file of gains is stated",
    ),
    "controller.autopilot": WordText("[autopilot](autopilots.md) that flies the base in place of a law", "none"),
    "controller.tuned": WordText(
        "true: the shipped gains that were found for `law`; a path: a [file of gains](tuning.md), which names its law",
        "false",
    ),
    "controller.servos": WordText(
        "torques become [setpoints of the model's drives](actuators.md#torque-laws-on-servos)",
        "true if the model has drives",
    ),
    "controller.safety": WordText(
        "true: a [safety layer](#safety) around the law; a table: the same with these limits", "false"
    ),
    "controller.safety.stow": WordText("pose of the arm in recovery", "middle of the range; 0 without limits"),
    "controller.safety.tilt": WordText("", "", "above 0, at most 85 degrees"),
    "controller.safety.trusted_tilt": WordText("", "", "above 0, at most pi"),
    "controller.safety.climb": WordText("", "half of gravity", "above 0, at most gravity"),
    "controller.safety.stiffness": WordText("", "the law's answer to small errors in hover; 5.0 for `nmpc`"),
    "controller.safety.damping": WordText("", "the law's answer to small errors in hover; 2.7 for `nmpc`"),
    "controller.safety.joint_speed": WordText("largest speed of each joint", "12 or 1.5"),
    "controller.safety.joint_step": WordText("", "0.5 or 0.05"),
    "controller.safety.joint_slew": WordText("", "3 or 0.3"),
    "controller.safety.joint_margin": WordText(
        "", "0.05 or 0.005, at most a tenth of the range", "0 to a quarter of the range"
    ),
    "controller.safety.effort": WordText("largest effort of each joint", "the model's"),
    "controller.safety.rotor_slew": WordText("", "the whole range in 5 ms"),
    "controller.safety.effort_slew": WordText("largest rate of the commanded efforts", "the whole range in 5 ms"),
    "controller.safety.trusted_joint_error": WordText(
        "", "0.6 or 0.1; 1.5 or 0.3 for a law that keeps the tip on its reference"
    ),
    "controller.safety.lost_joint_speed": WordText("", "four times `joint_speed`"),
    "controller.safety.patience": WordText("time beyond a trusted limit after which the law is replaced; `inf`: never"),
    "controller.safety.calm": WordText("", "`inf`: never"),
    "reference": WordText("[desired motion](#reference)", "hover at the origin"),
    "reference.base": WordText(
        "[motion](#motions) of the base; a list of motions is their sum",
        "hover at the origin",
        entry="table, or a list of them: a motion",
    ),
    "reference.base.kind": WordText("kind of the motion", "required"),
    "reference.yaw": WordText("yaw angle of the base, a [signal](#signals)", "0"),
    "reference.joints[]": WordText("[signal](#signals) of each joint, in the vehicle's order", "all 0"),
    "reference.tip": WordText("[motion of the tip](tip_and_tasks.md), in place of `base` and `joints`", "none"),
    "reference.tracking_start": WordText("until this time the law receives the reference of t = 0, at rest"),
    "reference.governor": WordText("[path governor](path_governor.md), which slows a reference", "false"),
    "reference.push": WordText("[commanded contact force](pressing.md) of the tip", "none"),
    "reference.load": WordText("above 0.5 while the tip is commanded to hold a [load](carrying.md)", "none"),
    "reference.governor.joint_speed": WordText("largest speed of the joints", "no limit"),
    "sensors": WordText("[white noise of the measured state, and named sensors](#sensors)", "no noise"),
    "sensors.*": WordText("[sensor](sensors.md) of this name in addition to the full state", "none"),
    "sensors.*.kind": WordText("kind of the sensor"),
    "estimator": WordText(
        "[estimator](sensors.md) that turns sensor readings into what the law receives: a kind, or a table",
        "the full state",
    ),
    "estimator.kind": WordText("kind of the estimator"),
    "delays": WordText("[dead times of the loop](#delays)", "none"),
    "delays.measurement": WordText("", "", PERIODS, RESPONSE),
    "delays.command": WordText("", "", STEPS, LATE),
    "delays.rotors": WordText("", "", STEPS, LATE),
    "delays.joints": WordText("", "", STEPS, LATE),
    "delays.longest_command": WordText(
        f"upper bound of `command` + `rotors` and of `command` + `joints`; {WHEN}", "none"
    ),
    "initial": WordText("[state at t = 0](#initial)", "hover on the reference"),
    "initial.position": WordText("", "the reference"),
    "initial.velocity": WordText("", "0"),
    "initial.quaternion_wxyz": WordText("", "level, with the yaw of the reference", "length 1"),
    "initial.rate": WordText("", "0"),
    "initial.joints": WordText("values of the joints, in the vehicle's order", "the reference"),
    "initial.joint_rates": WordText("rates of the joints", "0"),
    "initial.rotor_speeds": WordText("", "hover trim"),
    "initial.tilts": WordText("", "0"),
    "initial.standing": WordText(
        "static equilibrium on the surface below, rotors at rest; needs a [world](contact.md)", "false"
    ),
    "environment.wind": WordText("[wind](#wind)", "calm air"),
    "environment.wind.mode": WordText("kind of the wind", "none"),
    "environment.air[]": WordText("further [motions of the air](disturbances_and_payloads.md)", "none"),
    "environment.air[].kind": WordText("kind of the component"),
    "environment.forces[]": WordText("[forces on bodies](disturbances_and_payloads.md)", "none"),
    "environment.forces[].kind": WordText("kind of the component"),
    "environment.faults[]": WordText("losses of single actuators", "none"),
    "environment.faults[].kind": WordText("kind of the fault"),
    "environment.ground": WordText("the flight ends where the lowest point reaches z = 0"),
    "world": WordText("[surfaces, objects, grippers](contact.md) that the vehicle touches", "none"),
    "world.kind": WordText("kind of the world"),
    "payloads[]": WordText("[payloads](disturbances_and_payloads.md) that are picked up and set down", "none"),
    "payloads[].kind": WordText("kind of the payload"),
    "endings[]": WordText("additional [endings](#endings)", "none"),
    "endings[].kind": WordText("kind of the ending"),
    "windows": WordText("[intervals over which metrics are taken](#windows)", "see its table"),
    "windows.steady": WordText("window of means, RMS and extremes", LATER),
    "windows.transient": WordText("window of peaks", "the first third"),
    "windows.gust": WordText("window of the metrics that begin with `gust_`", LATER),
    "windows.hover": WordText("window of the metric `hover_offset`; choose one before the motion begins", LATER),
    "windows.holds": WordText("windows in which the arm is held", LATER),
    "windows.last": WordText("length of the window before the planned end", "5"),
    "changes[]": WordText("[scheduled changes](#changes-in-flight)", "none"),
    "changes[].at": WordText("earliest time of the change"),
    "changes[].path": WordText("[path](sweeps.md) of the number or the part that is replaced"),
    "changes[].value": WordText("new value, as the file would state it", entry="any value"),
    "environment": WordText("[wind, forces, faults and ground](#environment)", "calm air above ground"),
    "plugins": WordText(
        "`need`: list of [plugins](extending.md) that must be loaded; a file loads none itself", "none"
    ),
    "plugins.need": WordText("", "none"),
    "agents": WordText("[several agents](#several-agents), each with keys of its own", "none"),
    "numbers": WordText("[numbers by path](#numbers-by-path-and-a-scenario-written-back), applied last", "none"),
}
"""Key of a scenario file -> its description."""

FIELDS: Mapping[tuple[str, str], WordText] = {
    ("Payload", "mass"): WordText("", "none"),
    ("Fault", "rotor"): WordText("name of the rotor", "none; a fault names a rotor or a joint"),
    ("Fault", "joint"): WordText("name of the joint", "none; a fault names a rotor or a joint"),
    ("Fault", "start"): WordText("time at which the fault begins"),
    ("Fault", "stuck"): WordText("the joint is locked from `start` on"),
    ("Fault", "effectiveness"): WordText(
        "fraction of its force that the actuator still gives; those of several faults of one actuator multiply",
        "required unless `stuck`",
    ),
    ("Gust", "peak"): WordText("", "required"),
    ("Gust", "start"): WordText("time at which the gust begins", "required"),
    ("Gust", "duration"): WordText("length of the gust", "required"),
    ("Gust", "shape"): WordText("course over time; a step is constant from start to end"),
    ("GustyWind", "gust"): WordText("gust, or a list of gusts", "none"),
    ("MovingAir", "turbulence"): WordText("Dryden turbulence at low altitude, u axis along the mean wind", "none"),
    ("Ramp", "start"): WordText("time at which the ramp begins"),
    ("Ramp", "duration"): WordText("length of the ramp"),
    ("Ramp", "shape"): WordText("course over time"),
    ("Sum", "signals"): WordText("signals that are added"),
    ("Shifted", "signal"): WordText("signal that is shifted"),
    ("Shifted", "delay"): WordText("time by which it comes later"),
    ("Product", "signal"): WordText("first factor"),
    ("Product", "factor"): WordText("second factor"),
    ("Pulses", "start"): WordText("time of the first pulse"),
    ("Pulses", "period"): WordText("time from one pulse to the next"),
    ("Pulses", "width"): WordText("length of a pulse"),
    ("Pulses", "count"): WordText("number of pulses"),
    ("Pulses", "height"): WordText("value during a pulse"),
    ("TimedPayload", "name"): WordText("name of the payload"),
    ("TimedPayload", "frame"): WordText("frame that carries the payload", "the tip"),
    ("TimedPayload", "pick"): WordText("time or place at which it is picked up"),
    ("TimedPayload", "drop"): WordText("time or place at which it is set down", "never"),
    ("TimedPayload", "believed"): WordText("the law's model contains the payload while it is carried"),
    ("Dryden", "altitude"): WordText("height above ground that the turbulence is for"),
    ("Dryden", "wind_20ft"): WordText("mean wind at 20 feet, which sets the intensity"),
    ("Dryden", "minimum_airspeed"): WordText("least airspeed of the filters", "1"),
    ("Dryden", "intensity"): WordText("", "from the altitude"),
    ("ChannelSensor", "dropouts"): WordText("lost readings", "none"),
    ("Channel", "offset"): WordText("bias as signals of time, one for each component", "none"),
    ("Encoders", "rates"): WordText("rates by finite difference, or measured", "", '"difference" or "measured"'),
    ("ForceTorque", "frame"): WordText("frame at which it measures", "the tip"),
    ("TactileSwitch", "frame"): WordText("frame at which it measures", "the tip"),
    ("FilterNumbers", "aiding"): WordText(
        "readings that correct those of the inertial unit", "", '"pose", "position" or "position_heading"'
    ),
    ("FilterNumbers", "force"): WordText(
        "specific force: of the accelerometer, or of the nominal vehicle and corrected", "", '"measured" or "modelled"'
    ),
    ("FilterNumbers", "gravity"): WordText("acceleration of gravity", "the model's"),
    ("FilterNumbers", "vehicle"): WordText("nominal vehicle", "the model's"),
    ("JointLimits", "stops"): WordText("joints with stops end the flight, too"),
    ("AirSignals", "velocity_W"): WordText("velocity of the air, world axes, m/s", "0"),
    ("AirSignals", "noise"): WordText("coloured noise", "none"),
    ("Disturbance", "frame"): WordText("frame at whose origin the force acts", "the base"),
    ("Disturbance", "axes"): WordText(
        "axes of force and torque: of the world, or of the frame", "", '"world" or "frame"'
    ),
    ("Disturbance", "force"): WordText("force, N", "0"),
    ("Disturbance", "torque"): WordText("torque, N m", "0"),
    ("Disturbance", "noise"): WordText("coloured noise", "none"),
    ("GroundEffect", "others"): WordText("each rotor counts the image of the others, too"),
    ("Contact", "surfaces"): WordText("surfaces fixed in the world", "none"),
    ("Contact", "points"): WordText("points of the vehicle that touch surfaces", "none"),
    ("Contact", "objects"): WordText("free rigid bodies", "none"),
    ("Contact", "mechanisms"): WordText("doors, valves, drawers and buttons", "none"),
    ("Contact", "grippers"): WordText("grippers of the vehicle", "none"),
    ("Contact", "grasps"): WordText("joints between vehicles and objects from the start", "none"),
    ("ContactPoint", "agent"): WordText("agent that has the point", "the only one"),
    ("Gripper", "agent"): WordText("agent that has the gripper", "the only one"),
    ("Grasp", "agent"): WordText("agent that holds the object", "the only one"),
    ("Grasp", "frame"): WordText("frame of the vehicle that holds the object", "the tip"),
    ("Grasp", "body"): WordText("object or mechanism that is held", "required"),
    ("Grasp", "name"): WordText("name in the log", "agent and body"),
    ("Surface", "shape"): WordText("shape"),
    ("Surface", "size"): WordText(
        "lengths of the shape: of a box, radius and length of a cylinder, radius of a sphere"
    ),
    ("Surface", "motion"): WordText("displacement over time that is added to the position", "at rest"),
    ("Surface", "mesh"): WordText("STL file that it is drawn as", "none"),
    ("ContactPoint", "frame"): WordText("frame that carries the point", "none; state `frame` or `body`"),
    ("ContactPoint", "body"): WordText('"base" or a link that carries the point', "none; state `frame` or `body`"),
    ("ContactPoint", "ring"): WordText("points on a circle about the position", "none"),
    ("FreeObject", "shape"): WordText("shape"),
    ("FreeObject", "size"): WordText("lengths of the shape, as of a surface"),
    ("FreeObject", "standing"): WordText("it is set down on what is below it, at rest"),
    ("FreeObject", "mesh"): WordText("STL file that it is drawn as", "none"),
    ("Mechanism", "kind"): WordText("kind of the mechanism"),
    ("Mechanism", "size"): WordText("lengths of the body of this kind"),
    ("Mechanism", "parts"): WordText("further surfaces, such as a handle, in the mechanism's axes", "none"),
    ("Mechanism", "detent"): WordText("interval of the coordinate with an opposing force", "none"),
    ("Gripper", "kind"): WordText("kind of the gripper"),
    ("Gripper", "frame"): WordText("frame of the gripper", "the tip"),
    ("Gripper", "closed"): WordText("command: closed above 0.5", "1"),
    ("Body", "planar"): WordText("true: `inertia` has only the moment about the joint axis; for a law's model"),
    ("Joint", "kind"): WordText("turns or slides", "", '"revolute" or "prismatic"'),
    ("Joint", "coulomb"): WordText("", "", "", "higher values stick the joint harder at rest"),
    ("Joint", "stop_stiffness"): WordText("", "[chosen](#drives-and-stops-of-joints)"),
    ("Joint", "stop_damping"): WordText("", "[chosen](#drives-and-stops-of-joints)"),
    ("Rotor", "thrust_coefficient"): WordText(
        "thrust = coefficient times squared speed", "required without `thrust_table`"
    ),
    ("Rotor", "moment_coefficient"): WordText("", "required without `thrust_table.torque`"),
    ("Rotor", "table"): WordText("[table](actuators.md#rotors-from-a-table) in place of the two coefficients", "none"),
    ("Rotor", "tilt"): WordText("[servo of a tilting rotor](#rotors-that-tilt)", "none"),
    ("Rotor", "axis"): WordText("direction of positive thrust, base axes", "", "not all zero"),
    ("Rotor", "inertia"): WordText("inertia of the rotating parts about the axis: spin-up and gyroscopic torque"),
    ("Tilt", "axis"): WordText("", "from base origin to hub"),
    ("Tilt", "lower"): WordText("", "", "-pi to 0"),
    ("Tilt", "upper"): WordText("", "", "0 to pi"),
    ("Battery", "cells"): WordText("cells in series"),
    ("Battery", "open_circuit"): WordText("`charge` and `voltage` of one cell, two rising lists"),
    ("Battery", "esc"): WordText(
        "governed: the speed is held while the voltage allows; open: it falls with the voltage",
        "",
        '"governed" or "open"',
    ),
    ("Mimic", "joint"): WordText("joint that it follows"),
    ("Mimic", "ratio"): WordText("motion per motion of the leader"),
    ("Mimic", "offset"): WordText("value where the leader is at 0"),
}
"""Class of a record and its field -> description, wherever a file has the record."""


def of_field(bases: tuple[str, ...], name: str) -> WordText:
    """Description of a field by the names of its class and base classes; an empty one if there is none."""
    return next((FIELDS[base, name] for base in bases if (base, name) in FIELDS), WordText())


def of_path(path: str) -> WordText:
    """Description of a key by its path; an empty one if there is none."""
    return PATHS.get(path, WordText())


TYPES: Mapping[str, str] = {
    "Channel": "[errors](sensors.md) of this channel",
    "Material": "stiffness, damping and friction",
}
"""Class of a field's value -> meaning of a field that states none."""


class HandWord(NamedTuple):
    """Key that a function reads from a table which no record declares.

    Attributes:
        kind: kind of the signal or motion, or table of a vehicle file. name: key.
        entry: type in words. unit: SI. default: in words; empty for a required key. meaning: in words.
        allowed: allowed values in words.
    """

    kind: str
    name: str
    entry: str
    unit: str
    default: str
    meaning: str
    allowed: str = ""


_WINDOW = (("start", "begin of the window; the signal is 0 outside"), ("stop", "end of the window"))


def _window(kind: str) -> tuple[HandWord, ...]:
    return tuple(HandWord(kind, name, "number", "s", "no limit", words) for name, words in _WINDOW)


SIGNALS: tuple[HandWord, ...] = (
    HandWord("constant", "value", "number", "", "", "value"),
    *_window("constant"),
    HandWord("sine", "amplitude", "number", "", "", "amplitude"),
    HandWord("sine", "frequency_hz", "number", "Hz", "", "frequency"),
    HandWord("sine", "phase", "number", "rad", "0", "phase at `start`, or at t = 0 without one"),
    *_window("sine"),
    HandWord("sequence", "start", "number", "s", "", "time at which the first segment begins"),
    HandWord(
        "sequence", "segments", "list of [duration, value]", "", "", "length of each ramp, s, and value at its end"
    ),
    HandWord("sequence", "initial", "number", "", "0", "value before the first segment"),
    HandWord("sequence", "shape", '"linear" or "quintic"', "", '"linear"', "course of each ramp over time"),
    HandWord("windowed", "signal", "signal", "", "", "signal that is cut"),
    *_window("windowed"),
    HandWord("spline", "times", "list of numbers", "s", "", "times of the points, rising"),
    HandWord("spline", "values", "list of numbers", "", "", "values at these times; at rest before and after"),
    HandWord("samples", "file", "text", "", "", "CSV file with one row a time"),
    HandWord("samples", "column", "text", "", "", "column of the values"),
    HandWord("samples", "time", "text", "", '"time"', "column of the times, s"),
    HandWord("samples", "start", "number", "s", "0", "time that is added to the column"),
)
"""Keys of the signals that are read by hand."""

MOTIONS: tuple[HandWord, ...] = (
    HandWord("hover", "position", "three numbers", "m", "", "place, world axes"),
    HandWord("circle", "radius", "number", "m", "", "radius of a horizontal circle"),
    HandWord("circle", "frequency_hz", "number", "Hz", "", "turns per second; negative turns clockwise"),
    HandWord("circle", "center", "three numbers", "m", "", "centre, world axes"),
    HandWord("circle", "start", "number", "s", "no limit", "begin of the circle; before it the base is at the centre"),
    HandWord("circle", "stop", "number", "s", "no limit", "end of the circle; after it the base is at the centre"),
    HandWord("signals", "x", "signal", "m", "0", "position along world x"),
    HandWord("signals", "y", "signal", "m", "0", "position along world y"),
    HandWord("signals", "z", "signal", "m", "0", "position along world z"),
)
"""Keys of the motions that are read by hand, but for tasks."""


_POSE = (
    ("position", "three numbers", "m", "0", "origin, in axes of the parent", ""),
    ("rpy", "three numbers", "rad", "aligned", "orientation: R = Rz(yaw) Ry(pitch) Rx(roll)", ""),
    ("quaternion_wxyz", "four numbers", "", "aligned", "orientation, in place of `rpy`", "length 1 within 1e-6"),
)


def _pose(kind: str) -> tuple[HandWord, ...]:
    return tuple(HandWord(kind, *each) for each in _POSE)


_BODIES = "required without `urdf`, `mjcf`, `airframe`"

VEHICLE: tuple[HandWord, ...] = (
    HandWord("top", "schema", "whole number", "", "", "version of the file format", "1"),
    HandWord("top", "name", "text", "", "", "name of the vehicle"),
    HandWord("top", "base", "table", "", _BODIES, "[body](#bodies) of the airframe"),
    HandWord("top", "title", "text", "", "none", "description in one line"),
    HandWord("top", "urdf", "text", "", "none", "path of a [URDF file](#urdf), in place of `base` and `links`"),
    HandWord("top", "mjcf", "text", "", "none", "path of an [MJCF file](#mjcf), in place of `base` and `links`"),
    HandWord("top", "airframe", "text", "", "none", "vehicle of the library or path of one, whose parts are taken"),
    HandWord("top", "links", "list of tables", "", "none", "[links](#links-and-joints), a parent before its children"),
    HandWord("top", "rotors", "list of tables", "", "none", "[rotors](#rotors)"),
    HandWord("top", "rotor_defaults", "table", "", "none", "values of rotors that state none"),
    HandWord("top", "frames", "list of tables", "", "none", "[named frames](#frames)"),
    HandWord("top", "end_effector", "text", "", "none", "frame that is the tip of tasks", "name of a frame"),
    HandWord("top", "drag", "table", "", "none", "[drag](#drag) of the airframe"),
    HandWord("top", "drives", "table", "", "joints take torques", "[drive](actuators.md#servos) of each named joint"),
    HandWord("top", "battery", "table", "", "constant supply", "[battery](actuators.md#battery)"),
    HandWord(
        "top",
        "joint_limits",
        "text",
        "",
        '"stop"',
        "a joint at its limit meets a stop, or ends the flight",
        '"stop" or "end"',
    ),
    HandWord("top", "joints", "list of tables", "", "none", "[changes of joints](#changes-of-joints) of another file"),
    HandWord("top", "attach", "list of tables", "", "none", "[arms](#attached-arms) from other files"),
    HandWord(
        "top",
        "mimic",
        "text",
        "",
        '"lock"',
        "[joints that follow another](#joints-that-follow-others) in other files: fixed, or coupled to it",
        '"lock" or "couple"',
    ),
    HandWord("top", "sources", "table", "", "none", "where each number comes from: dotted name of a field = text"),
    HandWord("links", "name", "text", "", "", "name of the link", "unique"),
    HandWord("links", "parent", "text", "", "", "body that carries the joint", '"base" or a link'),
    HandWord("links", "joint", "table", "", "", "joint between parent and link"),
    HandWord("links", "parts", "list of tables", "", "none", "rigid pieces with `name`, `mass`, `com`, `inertia`"),
    HandWord(
        "body",
        "inertia",
        "three or six numbers",
        "kg m^2",
        "a point mass",
        "about the centre of mass, link axes: xx, yy, zz, or xx, yy, zz, xy, xz, yz",
    ),
    HandWord("rotors", "name", "text", "", "", "name of the rotor", "unique"),
    HandWord("rotors", "position", "three numbers", "m", "", "hub, base axes"),
    HandWord(
        "rotors", "direction", "text", "", "", "sense of rotation, seen from the tip of the axis", '"ccw" or "cw"'
    ),
    HandWord("joint", "name", "text", "", "", "name of the joint", "unique"),
    HandWord("joint", "axis", "three numbers", "", "", "axis, joint frame", "not all zero"),
    *_pose("joint"),
    HandWord(
        "joint", "mimic", "table", "", "none", "`joint`, `ratio`, `offset`: [it follows](#joints-that-follow-others)"
    ),
    HandWord("joints", "name", "text", "", "", "joint of the other file"),
    HandWord("attach", "arm", "text", "", "", "path of the arm's file", ".urdf, .xml or .toml"),
    HandWord("attach", "to", "text", "", '"base"', "place of the arm", '"base", a link or a frame'),
    *_pose("attach"),
    HandWord("attach", "prefix", "text", "", "none", "text before every name of the arm"),
    HandWord(
        "attach", "mimic", "text", "", "`mimic` of the vehicle", "`mimic` for joints of this arm", '"lock" or "couple"'
    ),
    HandWord("frames", "name", "text", "", "", "name of the frame", "unique"),
    HandWord("frames", "link", "text", "", '"base"', "body that carries the frame", '"base" or a link'),
    *_pose("frames"),
)
"""Keys of a vehicle file that are no field of a record, or mean more than the field."""
