"""Assembly of a flight log from the values recorded in every control period."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from skyarm.algebra import Scalar
from skyarm.control.law_estimates import found_by_law
from skyarm.log.flight_log import Log, log_of_arrays
from skyarm.log.metrics.windows import Windows
from skyarm.log.sensor_data import (
    COMPONENTS,
    DESCRIPTION,
    ESTIMATE,
    READINGS,
    LoggedField,
    Source,
    fields_of,
)
from skyarm.log.stored_arrays import ArrayFile, ArraysByName, join
from skyarm.log.team_log import SHARED, TeamLog
from skyarm.log.tip_positions import level_tip, tip
from skyarm.records.arrays import Array, doubles
from skyarm.records.files import versions
from skyarm.records.identity import log_digest, own_files
from skyarm.records.immutable import positional
from skyarm.records.leaves import Tree
from skyarm.records.plain import plain
from skyarm.records.registry.plugins import identities
from skyarm.reference import Reference
from skyarm.reference.trajectory import phase_numbers
from skyarm.scenario.scenario_record import Scenario
from skyarm.sensing.measurement import Measurement
from skyarm.sensing.sensor import at_origin
from skyarm.simulate.check_endings import Ended
from skyarm.simulate.first_state import readings_waiting
from skyarm.simulate.inputs import EpisodeInputs, FlightInputs, table_of
from skyarm.vehicle import Vehicle
from skyarm.world import WindSample
from skyarm.world.component import Column, by_array


@positional
class LoggedSamples:
    """Logged values of a flight, one row per control instant: states, commands,
    readings, winds, estimates.

    Attributes:
        measurement: measurement received by the law; None if not logged. readings: name
            and record of each sensor.
        wind: its scalars (N,) or longer; numbers that stand for every instant.
        found: (N, k) online estimates of the law, k = 0 without any.
        led: (N, k) columns of the reference clock (``Sample.led``), k = 0 without one.
    """

    states: Array
    commands: Array
    measurement: Measurement | None
    readings: tuple[tuple[str, Tree], ...]
    wind: WindSample
    found: Array
    led: Array


LogPart = tuple[Mapping[str, Array], dict[str, dict[str, Any]]]
"""Arrays of the log of one vehicle in some periods, and a description of the sources of
received data."""


StoredPiece = Mapping[str, LogPart]
"""Piece of a flight whose arrays are in a file: the part of the log of each vehicle by
name."""


@positional
class Piece:
    """Consecutive control periods of a flight between two scheduled changes, under one
    scenario.

    Attributes:
        inputs: inputs of the scenario. start: index of the first period. flown: logged
            samples of each vehicle.
    """

    scenario: Scenario
    inputs: FlightInputs
    start: int
    flown: tuple[LoggedSamples, ...]

    def in_file(self, file: ArrayFile) -> StoredPiece:
        """Piece with its arrays in a file instead of memory.

        Raises:
            OSError: as of :meth:`ArrayFile.store`.
        """
        parts = {name: _part_of(self.of(name)) for name in self.scenario.agents}
        return {
            name: (file.store(arrays), sources)
            for name, (arrays, sources) in parts.items()
        }

    def of(self, name: str) -> AgentPiece:
        """Periods of one vehicle, by its name."""
        index = tuple(self.scenario.agents).index(name)
        return AgentPiece(
            self.scenario.of(name),
            self.inputs.each[index],
            self.start,
            self.flown[index],
        )


@positional
class AgentPiece:
    """Consecutive control periods of one vehicle between two scheduled changes, under
    the scenario of its flight.

    Attributes:
        inputs: inputs of the scenario. start: index of the first period. flown: logged
            samples.
    """

    scenario: Scenario
    inputs: EpisodeInputs
    start: int
    flown: LoggedSamples


def join_pieces(
    scenario: Scenario,
    pieces: Sequence[Piece | StoredPiece],
    ending: Ended | None,
) -> Log:
    """Concatenate the parts of a flight before and after each scheduled change into one
    log.

    Args:
        scenario: scenario of the flight, as the log records it.
        pieces: at least one.
        ending: None for a flight that was completed.
    """
    flown = {
        name: [
            piece.of(name) if isinstance(piece, Piece) else piece[name]
            for piece in pieces
        ]
        for name in scenario.agents
    }
    logs = {
        name: log_of_agent(scenario.of(name), each, ending)
        for name, each in flown.items()
    }
    return (
        # a log of one vehicle has the short form of files, without names of vehicles
        next(iter(logs.values()))
        if len(logs) == 1
        else _of_team(logs, scenario, ending)
    )


def _of_team(logs: dict[str, Log], scenario: Scenario, ending: Ended | None) -> TeamLog:
    """Log of several vehicles, from a log of each."""
    shared = dict.fromkeys(
        column[0] for each in scenario.shared_components for column in each.columns
    )
    return TeamLog(logs, {**describe_team(scenario, ending), SHARED: [*shared]})


def log_of_agent(
    scenario: Scenario,
    pieces: Sequence[AgentPiece | LogPart],
    ending: Ended | None,
    *,
    info: dict[str, Any] | None = None,
) -> Log:
    """Concatenate the parts of one vehicle's flight before and after each scheduled
    change into one log.

    Args:
        scenario: scenario of the vehicle's flight, as the log records it.
        pieces: at least one; arrays in a file stay there.
        ending: None for a flight that was completed.
        info: metadata of the log, if known already.
    """
    parts: list[LogPart] = [
        each if isinstance(each, tuple) else _part_of(each) for each in pieces
    ]
    tables = [arrays for arrays, _ in parts]
    sources: dict[str, dict[str, Any]] = {}
    for _, descriptions in parts:
        for name, source in descriptions.items():
            # a change may give a sensor further fields; the first part has the rates
            sources.setdefault(name, source)["fields"] |= source["fields"]
    arrays: Mapping[str, Array] = join(tables) if len(tables) > 1 else tables[0]
    # arrays in a file stay there: a dictionary would read them all
    if not isinstance(tables[0], ArraysByName):
        arrays = dict(arrays)
    described = describe(scenario, ending) if info is None else info
    return log_of_arrays(
        arrays, described | ({DESCRIPTION: sources} if sources else {})
    )


def _part_of(piece: AgentPiece) -> LogPart:
    """Part of the log of one vehicle, from its logged samples."""
    received, described = sensor_data(piece)
    return _tables(piece) | received, described


def state_arrays(
    vehicle: Vehicle, times: Array, x: Array, u: Array
) -> dict[str, Array]:
    """Log arrays of time, state and commands by name, as views of the recorded values.

    Args:
        vehicle: vehicle of the plant.
        times: s, (N,).
        x: states, a row each.
        u: commands, a row each.
    """
    # columns in the order of State: 13 numbers of the base, joints, their rates, rotors
    n = vehicle.n
    rotors = len(vehicle.rotors)
    tilts = (
        {"tilts": x[:, 13 + 2 * n + rotors :], "tilt_commands": u[:, rotors + n :]}
        if vehicle.tilts
        else {}
    )
    return {
        "time": times,
        "position": x[:, 0:3],
        "quaternion": x[:, 3:7],
        "velocity": x[:, 7:10],
        "rate": x[:, 10:13],
        "joints": x[:, 13 : 13 + n],
        "joint_rates": x[:, 13 + n : 13 + 2 * n],
        "rotor_speeds": x[:, 13 + 2 * n :][:, :rotors],
        "rotor_commands": u[:, :rotors],
        "efforts": u[:, rotors:][:, :n],
        **tilts,
    }


def _tables(piece: AgentPiece) -> dict[str, Array]:
    """Log arrays by name, for the part of a flight between two scheduled changes."""
    scenario = piece.scenario
    inputs = piece.inputs
    flown = piece.flown
    vehicle = scenario.agent.vehicle
    count = len(flown.states)
    wind = flown.wind
    # inputs of a long flight begin at its window, not at its first period
    start = piece.start - inputs.ticks.start
    stop = start + count

    def table(record: Iterable[Scalar | Array], start: int = 0) -> Array:
        columns = map(doubles, record)
        rows = tuple(c[start : start + count] if c.ndim else c for c in columns)
        return table_of(rows, count)

    # a copy of the times: arrays of a log taken in flight must not be the session's
    state = state_arrays(
        vehicle, inputs.times[start:stop].copy(), flown.states, flown.commands
    )
    sampled, free, path_time, late = _references(inputs, flown, start, stop)
    tables = {
        f"{name}_held": table(getattr(sampled, name), late)
        for name in ("position", "velocity", "joints", "joint_rates")
    }
    tables |= {
        "yaw_held": table((sampled.yaw,), late)[:, 0],
        "position_reference": table(free.position),
        "joints_reference": table(free.joints),
        "yaw_reference": table((free.yaw,))[:, 0],
        "wind_force": table(wind.force_W),
        "air_velocity": table(wind.air_velocity_W),
    }
    if len(path_time):
        tables["path_time"] = path_time
    if scenario.agent.reference.phases:
        tables["phase"] = phase_numbers(scenario.agent.reference, path_time)
    # a task in the tip has a desired position of its own; else that of the level
    # vehicle
    own = (
        {"held": table(sampled.tip, late), "reference": table(free.tip)}
        if free.tip
        else {}
    )
    for name, columns in by_array(scenario.components, wind.numbers).items():
        tables[f"{COMPONENTS}.{name}"] = table(columns)
    begin = 0
    for name, numbers in found_by_law(scenario.agent.controller.memory).items():
        if flown.found.shape[1]:
            place = begin if len(numbers) == 1 else slice(begin, begin + len(numbers))
            tables[name] = flown.found[:, place]
            begin += len(numbers)
    del free  # its derivatives take more memory than the log of it
    for kind in ("held", "reference"):
        goals = (tables[f"{name}_{kind}"] for name in ("position", "yaw", "joints"))
        tables[f"tool_{kind}"] = own[kind] if own else level_tip(vehicle, *goals)
    return {
        **state,
        "tool": tip(vehicle, state["position"], state["quaternion"], state["joints"]),
        **tables,
    }


def sensor_data(piece: AgentPiece) -> tuple[dict[str, Array], dict[str, Any]]:
    """Log arrays of sensor readings and the law's measurement, and a description of
    each sensor for the log.
    """
    scenario = piece.scenario
    flown = piece.flown
    count = len(piece.flown.states)
    sensors = {
        name: (i, sensor) for i, (name, sensor) in enumerate(scenario.agent.all_sensors)
    }
    arrays: dict[str, Array] = {}
    described: dict[str, Any] = {}

    def keep(source: str, record: Tree, **clock: Any) -> None:
        rows = [*fields_of(record, count)]
        arrays.update({f"{source}.{name}": array for name, _, array in rows})
        fields = {name: field for name, field, _ in rows}
        described[source] = Source(fields, **clock).plain

    columns = [
        Column(*column) for each in scenario.components for column in each.columns
    ]
    declared = {
        array: LoggedField(
            each[0].unit,
            each[0].meaning,
            [column.label for column in each],
            _differing_units(each),
        )
        for array, each in by_array(scenario.components, columns).items()
    }
    if declared:
        described[COMPONENTS] = Source(declared).plain
    for name, reading in flown.readings:
        i, sensor = sensors[name]
        frame = (
            None
            if sensor.feels is None
            else scenario.agent.vehicle.frame(sensor.feels or None).name
        )
        mount = None
        # at the base's origin is the rule, which a file need not repeat
        if not (at_origin(sensor.mounted_at) and at_origin(sensor.turned_by)):
            mount = [*map(float, (*sensor.mounted_at, *sensor.turned_by))]
        late = readings_waiting(scenario, i)
        keep(
            f"{READINGS}.{name}",
            reading,
            every=scenario.rates.periods_between(sensor.frequency),
            late=late,
            frame=frame,
            mount=mount,
        )
    if flown.measurement is not None and scenario.agent.has_estimator:
        keep(ESTIMATE, flown.measurement)
    elif flown.measurement is not None:
        measured = {
            name: array for name, _, array in fields_of(flown.measurement, count)
        }
        arrays["measured_position"] = measured["position"]
        arrays["measured_joints"] = measured.get("joints", np.zeros((count, 0)))
    return arrays, described


def _differing_units(columns: Sequence[Column]) -> list[str] | None:
    """List the unit of each column of a log array; None if all columns have the same
    unit.
    """
    units = [each.unit for each in columns]
    return units if len(set(units)) > 1 else None


def _references(
    inputs: EpisodeInputs, flown: LoggedSamples, start: int, stop: int
) -> tuple[Reference, Reference, Array, int]:
    """Sampled-and-held reference, continuous reference and path time (s) at the logged
    instants of a flight.
    """
    # its reference is where the clock was in flight, which no table knows before
    if inputs.waits.guards:
        return (*inputs.waiting_references(flown.led.T), 0)
    led = (
        flown.led[:, 0]
        if flown.led.shape[1]
        else np.asarray(inputs.path_time)[start:stop]
    )
    return inputs.held_reference, inputs.reference_between(start, stop), led, start


def describe(scenario: Scenario, ending: Ended | None) -> dict[str, Any]:
    """Metadata of one vehicle's flight log as a dictionary: scenario, rates, status,
    versions, digest.
    """
    guards = scenario.agent.reference.guards
    own = scenario.agent
    world, others = scenario.world, scenario.others
    # who flies it again flies it without the others
    if scenario.others and world is not None and world.ignore:
        (name,) = scenario.agents
        around = replace(scenario.environment, world=world.without_others(name))
        scenario = replace(scenario, environment=around)
    whole = describe_team(scenario, ending)
    waits = [
        {"phase": each.phase, "at": float(each.at), "timeout": float(each.timeout)}
        for each in guards
    ]
    # the order of a log's info is that of its file
    opening = ("schema", "scenario", "title", "plant", "integrator")
    closing = {name: whole.pop(name) for name in ("scenario_record", "digest")}
    info = {
        **{name: whole[name] for name in opening},
        "plant_vehicle": own.vehicle.name,
        "plant_gravity": float(own.plant.gravity),
        "model_vehicle": own.model.vehicle.name,
        "model_gravity": float(own.model.gravity),
        "controller": own.controller.name,
        **whole,
    }
    if own.reference.phases:
        info["phases"] = [phase.name for phase in own.reference.phases]
    if waits:
        info["waits"] = waits
    # the scenario of the record flies alone
    if others:
        info["others"] = [*others]
    return info | closing


def describe_team(scenario: Scenario, ending: Ended | None) -> dict[str, Any]:
    """Metadata of a flight log that is of all vehicles: scenario, rates, status,
    versions, digest.
    """
    rates = scenario.rates
    whole = plain(scenario)
    files = own_files(scenario)
    return {
        "schema": 1,
        "scenario": scenario.name,
        "title": scenario.title,
        "plant": scenario.kind,
        "integrator": scenario.integrator,
        "rates_hz": {
            "physics": rates.physics,
            "control": rates.control,
            "reference": rates.reference,
        },
        "duration": scenario.duration,
        "windows": Windows().of_flight(scenario.duration, scenario.windows).plain(),
        "seed": scenario.seed,
        "episode": scenario.episode,
        "status": ending.status if ending else "completed",
        "cause": ending.cause if ending else "",
        "end_time": ending.time if ending else scenario.duration,
        "versions": versions("numpy", "mujoco-core"),
        "plugins": identities(),
        "code": files,
        "scenario_record": whole,
        "digest": log_digest(whole, files),
    }
