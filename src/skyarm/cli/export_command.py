"""Command ``skyarm export``: convert a log, write a control law as C, or a vehicle in a
format of other programs.
"""

from __future__ import annotations

import inspect
import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from skyarm import __version__
from skyarm.algebra import Mat3
from skyarm.cli.arguments import (
    OptionalOut,
    require_left_out,
    shipped_names,
    word_completion,
)
from skyarm.cli.output import bar, give, tell
from skyarm.control.catalogue import is_named, must_be_named
from skyarm.control.model import Model
from skyarm.dynamics.actuators import AllocationError
from skyarm.log.formats import load_log, require_format, require_readable, save_log
from skyarm.log.ros.topics import EPOCH
from skyarm.plant.interface import require_gravity
from skyarm.records.files import (
    errors_as,
    must_be_one_of,
    number,
    output_file,
    require_file,
    shown,
    unreadable,
    write_atomically,
)
from skyarm.records.files.names import read_named
from skyarm.records.files.own_inputs import require_no_input
from skyarm.records.files.user_code import require_result
from skyarm.records.path_names import word_of
from skyarm.records.registry import find, names
from skyarm.records.registry.plugins import identities, law_of_file_name
from skyarm.scenario.controller_table import make_named_or_tuned
from skyarm.scenario.scenario_file import (
    LIBRARY,
    is_scenario,
    kind_of_file,
    load_scenario,
    scenario_from,
)
from skyarm.scenario.scenario_record import HIGHEST_RATE, Rates, Scenario, first_state
from skyarm.sensing.sensor_kinds import ImuReading, mount_rotation, reads
from skyarm.simulate.command_delay import rotor_and_joint_delays
from skyarm.vehicle import BASE, Frame
from skyarm.vehicle.robot_text import actuator_names
from skyarm.vehicle.vehicle_files import list_vehicles, load_vehicle
from skyarm.vehicle.vehicle_tables import RIGID

RATE, SLOWEST = 200.0, 1e-3
"""Default control rate (Hz) of an exported law, that of scenarios, and lowest plausible
one."""

LONGEST_STEP = 0.1
"""Longest plausible step (s) of MuJoCo."""

LATEST = 2.0**31 - 1.0
"""Latest Unix time (s) of a ROS message, whose seconds are an int32: in January
2038."""

SUFFIXES = {"c": (".c",), "mjcf": (".xml", ".mjcf")}
"""Format of a law or vehicle -> suffixes of its files, where these are others than its
name."""

ONE = {"bodies": "body", "joints": "joint", "actuators": "actuator"}

OF_LAWS = ("--rate", "--name", "--float32")

OF_VEHICLES = ("--gravity", "--timestep", "--collisions")
"""Options that a format of vehicles has if its function takes an argument of that
name."""


def export(
    what: str,
    to: Annotated[
        str | None,
        word_completion("c", registered="log_format vehicle_format"),
    ] = None,
    file: OptionalOut = None,
    vehicle: str | None = None,
    gravity: float | None = None,
    rate: float | None = None,
    name: str | None = None,
    single: Annotated[bool, typer.Option("--float32")] = False,
    timestep: float = 0.001,
    collisions: bool = False,
    epoch: float | None = None,
) -> None:
    """Write a log, a law as C, or a vehicle as MJCF, URDF or SDF.

    With --to c a preset, a law, LAW_tuned, FILE.py:make, gains or a scenario (its
    controller) become one C99 file. What a format loses of a vehicle stands in the
    first lines of its file.

    Options:
        what LOG|LAW|VEHICLE|SCENARIO: a log; c: a law or scenario; else vehicle or
            scenario
        to FORMAT: mcap, npz, csv: a log; c: a law; mjcf, urdf, sdf, toml: a vehicle
        file FILE: file to write; for a log next to it if left out
        vehicle: with c: vehicle in the model; of a log of several: which
        gravity: with c, mjcf: m/s^2; left out: the scenario's, or 9.81
        rate: with c: control rate, Hz; left out: the scenario's, or 200
        name: with c: beginning of the names in the file
        single: with c: float in place of double
        timestep: with mjcf: time step of MuJoCo, s
        collisions: with mjcf: the shapes touch the floor and other bodies
        epoch: with mcap: Unix time of the start of the flight, s; if left out 0
    """
    # without a format of laws or vehicles it is a log, whose format may follow from its
    # file
    if to != "c" and to not in names("vehicle_format"):
        require_left_out(
            [*OF_LAWS, *OF_VEHICLES], " of a log; it belongs to --to c or mjcf"
        )
        with bar(f"{what}: writing"):
            return _log(what, to, file, epoch, vehicle)
    taken = ("--gravity",) if to == "c" else _options_of(to)
    others = [
        *(() if to == "c" else ("--vehicle", *OF_LAWS)),
        *(each for each in OF_VEHICLES if each not in taken),
    ]
    require_left_out([*others, "--epoch"], f" beside --to {to}")
    if file is None:
        raise ValueError(f"--out: is missing; --to {to} writes a file")
    written = output_file(file, "--out", *SUFFIXES.get(to, (f".{to}",)))
    if to != "c":
        step = number(timestep, "--timestep", low=0.0, strict=True)
        if step > LONGEST_STEP:
            raise ValueError(
                f"--timestep = {timestep!r}: must be at most {LONGEST_STEP:g} s"
            )
        return _vehicle(
            what, to, written, gravity, {"timestep": step, "collisions": collisions}
        )
    with bar(f"{what}: writing C"):
        _law(what, written, vehicle, gravity, rate, name, single=single)


def _log(
    flight: str,
    to: str | None,
    file: str | None,
    epoch: float | None,
    vehicle: str | None,
) -> None:
    formats = names("log_format")
    allowed = (*formats, "c", *names("vehicle_format"))
    if to is None and (
        file is None
        or Path(flight).suffix in (".toml", *RIGID)
        or flight in list_vehicles()
    ):
        raise ValueError(f"--to: is missing; {must_be_one_of(allowed, None)}")
    if to is not None and to not in formats:
        raise ValueError(f"--to = {shown(to)}: {must_be_one_of(allowed, to)}")
    require_readable(flight, "flight")
    require_file(flight, f"flight = {shown(flight)}")
    if file is not None:
        require_format(file, "--out")
        if to is not None and Path(file).suffix != f".{to}":
            raise ValueError(
                f"--out = {shown(file)}: must end in .{to}, as --to = {shown(to)} is"
                " written"
            )
        target = output_file(file, "--out")
    else:
        # beside the flight, of the same name
        target = Path(flight).with_suffix(f".{to}")
        require_no_input(target, "--out")
    log = load_log(flight)
    if vehicle is not None:
        if vehicle not in log.agents:
            raise ValueError(
                f"--vehicle = {shown(vehicle)}: {must_be_one_of(log.agents, vehicle)}"
            )
        log = log.agents[vehicle]
    if epoch is not None:
        if target.suffix != ".mcap":
            raise ValueError(
                f"--epoch = {epoch!r}: must be left out of {target.suffix}; time stamps"
                " are those of mcap"
            )
        if number(epoch, "--epoch", low=0.0) > LATEST:
            raise ValueError(
                f"--epoch = {epoch!r}: must be at most {LATEST:.0f} s, which is in"
                " January 2038"
            )
        log.info[EPOCH] = epoch
    save_log(log, target)
    tell(f"log: {target}")
    give(file=target)


def _options_of(form: str) -> list[str]:
    """Options of the command that a format of vehicles takes: the arguments of its
    function.
    """
    arguments = inspect.signature(find("vehicle_format", form)).parameters
    return [each for each in OF_VEHICLES if each.removeprefix("--") in arguments]


def _vehicle(
    what: str, form: str, file: Path, gravity: float | None, chosen: dict[str, object]
) -> None:
    """Export a vehicle, or that of a scenario with its first state, in a registered
    format.
    """
    if is_scenario(what):
        scenario = load_scenario(what).alone("a model of a vehicle")
        vehicle = scenario.agent.plant.vehicle
        applied = float(scenario.agent.plant.gravity)
        start = first_state(scenario)
        units = [
            each for each in scenario.agent.sensors if reads(each.sensor, ImuReading)
        ]
        frames = [
            Frame(
                name=each.name,
                link=BASE,
                position=each.sensor.mounted_at,
                rotation=mount_rotation(each.sensor.turned_by) or Mat3.identity(),
            )
            for each in units
        ]
        vehicle = replace(vehicle, frames=(*vehicle.frames, *frames))
    else:
        # a vehicle alone stands on earth
        vehicle = load_vehicle(what)
        applied = 9.81
        start = None
        units = []
    if gravity is not None:
        applied = require_gravity(gravity, "--gravity")
    # each format takes what its function has arguments for
    chosen |= {
        "gravity": applied,
        "start": start,
        "inertial": [each.name for each in units],
    }
    write = find("vehicle_format", form)
    taken = inspect.signature(write).parameters
    text = write(
        vehicle, **{name: value for name, value in chosen.items() if name in taken}
    )
    require_result(write, text, isinstance(text, str), "the text of the file")
    write_atomically(file, text.encode())
    counts = {
        "bodies": len(vehicle.bodies),
        "joints": len(vehicle.moving),
    }
    actuators = actuator_names(vehicle)
    give(counts, file=file, vehicle=vehicle.name, actuators=actuators)
    listed = {**counts, "actuators": len(actuators)}.items()
    tell(
        f"{file}: {vehicle.name},"
        f" {', '.join(f'{n} {ONE[name] if n == 1 else name}' for name, n in listed)}"
    )


def _law(
    controller: str,
    file: Path,
    vehicle: str | None,
    gravity: float | None,
    rate: float | None,
    name: str | None,
    *,
    single: bool,
) -> None:
    """Export a control law as a C file."""
    from skyarm.control.onboard.export_c import export_c

    asked = None if rate is None else number(rate, "--rate", low=0.0, strict=True)
    if asked is not None and not SLOWEST <= asked <= HIGHEST_RATE:
        raise ValueError(
            f"--rate = {rate!r}: must be from {SLOWEST:g} to {HIGHEST_RATE} Hz"
        )
    of_gains = kind_of_file(controller) == "gains"
    notes = list[str]()
    estimator = None
    late = (0, 0)
    if is_named(controller) or of_gains:
        if vehicle is None:
            raise ValueError(
                f"--vehicle: is missing; controller {controller!r} must know the"
                " vehicle it flies"
            )
        model = Model(
            vehicle=load_vehicle(vehicle),
            gravity=9.81 if gravity is None else require_gravity(gravity, "--gravity"),
        )
        title = Path(controller).stem if of_gains else law_of_file_name(controller)
        control_rate = asked or RATE
        with errors_as(
            ValueError, f"--vehicle = {model.vehicle.name!r}: ", of=AllocationError
        ):
            chosen = make_named_or_tuned(
                controller, model, {"control_period": 1.0 / control_rate}
            )
    else:
        _require_scenario(controller)
        for option, value in (("--vehicle", vehicle), ("--gravity", gravity)):
            if value is not None:
                raise ValueError(
                    f"{option} = {value!r}: must be left out, scenario {controller!r}"
                    " brings its own"
                )
        planned = load_scenario(controller).alone("the law in C")
        if asked is not None and asked != planned.rates.control:
            with errors_as(ValueError, f"--rate = {rate!r}: "):
                planned = _at_rate(controller, asked, planned.rates).alone(
                    "the law in C"
                )
        chosen, title = planned.agent.controller, planned.name
        estimator = planned.agent.placed_estimator.on_board
        late = _late_periods(planned)
        if _changes_in_flight(planned):
            notes = [
                f"Law, model and estimator as {controller} begins, without its changes"
                " in flight."
            ]
        control_rate = float(planned.rates.control)
    believed = chosen.par.model.vehicle
    # names of C begin with a letter and hold no other signs
    identifier = re.sub(r"[^A-Za-z0-9_]", "_", title)
    exported = export_c(
        chosen,
        name=name or (identifier if identifier[0].isalpha() else f"law_{identifier}"),
        period=1.0 / control_rate,
        single=single,
        generator=", ".join(
            [
                f"skyarm {__version__}",
                *(f"{each} {of}" for each, of in identities().items()),
            ]
        ),
        estimator=estimator,
        late=late,
        notes=notes,
    )
    write_atomically(file, exported.text.encode("ascii"))
    precision = "float" if single else "double"
    give(
        file=file,
        function=f"{exported.name}_step",
        law=chosen.name,
        vehicle=believed.name,
        number=precision,
        operations=exported.operations,
        parameters=len(exported.parameters),
        rate_hz=control_rate,
    )
    tell(
        f"{file}: {exported.name}_step, {chosen.name} for {believed.name}",
        f"{exported.operations} operations in {precision}, {len(exported.parameters)}"
        " parameters",
        *notes,
    )


def _at_rate(name: str, rate: float, own: Rates) -> Scenario:
    """Scenario read anew with another control rate (Hz), so that law, filter and checks
    are those of this rate.
    """
    tables, folder = read_named(name, "scenario", LIBRARY)
    step = int(rate) if rate.is_integer() else rate
    stated = tables.get("rates")
    rates = dict(stated) if isinstance(stated, dict) else {}
    # both must fit the control rate; the C file holds nothing of them
    rates |= {
        "control": step,
        # not below the scenario's own rate, unless the highest one forbids it
        "physics": (
            min(math.ceil(own.physics / rate), max(1, int(HIGHEST_RATE / rate))) * step
        ),
    }
    rates |= {"reference": math.gcd(int(step), own.reference)}
    return scenario_from(tables | {"rates": rates}, folder)


def _late_periods(scenario: Scenario) -> tuple[int, int]:
    """Whole control periods by which the commands of rotors and of joints act late."""
    (rotors, _), (joints, _) = rotor_and_joint_delays(scenario)
    return int(float(rotors)), int(float(joints))


def _changes_in_flight(scenario: Scenario) -> bool:
    """True if law, model or estimator change in flight, by scheduled changes or
    payloads in the law's model.
    """
    changed = any(
        word_of(each.path).split(".")[0] in ("controller", "model", "estimator")
        for each in scenario.changes
    )
    return changed or any(each.believed for each in scenario.agent.payloads)


def _require_scenario(controller: str) -> None:
    if controller in shipped_names("scenario"):
        return
    if Path(controller).suffix != ".toml":
        raise ValueError(
            f"controller = {shown(controller)}: {must_be_named(controller)}, or a"
            f" scenario ({', '.join(shipped_names('scenario'))}) or a scenario's .toml"
            " file"
        )
    if reason := unreadable(Path(controller)):
        raise ValueError(
            f"controller = {shown(controller)}: {reason}; must be one of a scenario or"
            " of gains"
        )
