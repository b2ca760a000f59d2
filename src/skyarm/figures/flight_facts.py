"""What a picture says about a flight beside its curves: names, limits, and when something happened to it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skyarm.figures.contact_curves import Touching, touchings
from skyarm.figures.flight_events import Event, events_in
from skyarm.figures.quantities import end_time, gust_interval
from skyarm.log.flight_log import Log
from skyarm.log.log_columns import names_of


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightFacts:
    """Names and limits of what flew.

    Attributes:
        joints: names. revolute: joint by joint, whether it turns; else it slides.
        rotors: names. tip: the vehicle has one.
        joint_limits: (lower, upper), rad or m. effort_limits: (-limit, limit), N m or N.
        rotor_limits: (largest speed,), rad/s.
        setpoints: joint by joint, units of what it is told where that is no torque, None where it is; several of
            several flights.
        events: gusts, faults, changes. touching: pairs of surfaces and points that touched, and when.
    """

    joints: tuple[str, ...] = ()
    revolute: tuple[bool, ...] = ()
    rotors: tuple[str, ...] = ()
    tip: bool = False
    joint_limits: tuple[tuple[float, float], ...] = ()
    effort_limits: tuple[tuple[float, float], ...] = ()
    rotor_limits: tuple[tuple[float], ...] = ()
    setpoints: tuple[tuple[str | None, ...], ...] = ()
    events: tuple[Event, ...] = ()
    touching: tuple[Touching, ...] = ()


def flight_facts(log: Log) -> FlightFacts:
    """Facts of a flight from the scenario that its log keeps; of a log without one, from its arrays alone."""
    try:
        scenario = log.scenario
    except ValueError:  # of a version that kept none, or of a plugin that is not loaded: the curves are there
        return _from_arrays(log)
    vehicle = scenario.world.vehicle
    joints = [link.joint for link in vehicle.links]
    return FlightFacts(
        joints=tuple(_capital(joint.name) for joint in joints),
        revolute=tuple(joint.kind == "revolute" for joint in joints),
        rotors=tuple(rotor.name for rotor in vehicle.rotors),
        tip=bool(vehicle.end_effector),
        joint_limits=tuple((float(joint.lower), float(joint.upper)) for joint in joints),
        effort_limits=tuple((-float(joint.effort_limit), float(joint.effort_limit)) for joint in joints),
        rotor_limits=tuple((float(rotor.max_speed),) for rotor in vehicle.rotors),
        setpoints=tuple((unit,) for unit in names_of(log).setpoints),
        events=events_in(scenario, end_time(log)),
        touching=touchings(log),
    )


def _from_arrays(log: Log) -> FlightFacts:
    gust = gust_interval(log)
    return FlightFacts(
        joints=tuple(f"Joint {i + 1}" for i in range(log.joints.shape[1])),
        revolute=(True,) * log.joints.shape[1],
        rotors=tuple(str(i + 1) for i in range(log.rotor_speeds.shape[1])),
        setpoints=tuple((unit,) for unit in names_of(log).setpoints),
        tip=not np.array_equal(log.tip, log.position),
        events=() if gust is None else (Event("gust", *gust),),
        touching=touchings(log),
    )


def _capital(name: str) -> str:
    return name[:1].upper() + name[1:]
