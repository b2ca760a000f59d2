"""Flight resampled at a film's frames from its log, with error, contact force and
end.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from skyarm.algebra.frames import continuous
from skyarm.log.flight_log import Log
from skyarm.log.tip_positions import yaw_quaternion
from skyarm.records.arrays import Array, lengths
from skyarm.records.files import shown
from skyarm.records.immutable import immutable
from skyarm.records.leaves import Tree
from skyarm.scenario.scenario_record import cameras_of
from skyarm.simulate.drawn_scenario import drawn_scenario
from skyarm.view.figures.flight_facts import (
    applied_force,
    desired_push,
    end_time,
    flight_labels,
    vehicle_logs,
)
from skyarm.view.picture.frames import (
    COLORS,
    Color,
    FlightFrames,
    patch_about,
    tip_error,
)
from skyarm.world.component import Component
from skyarm.world.scene.component_scenes import scene_in_log, scenes_of
from skyarm.world.scene.scene import Instants, Scene

MOST_FLIGHTS = len(COLORS)

READ = {
    "position": "position",
    "joints": "joints",
    "desired_position": "position_reference",
    "desired_joints": "joints_reference",
    "tip": "tip",
    "desired_tip": "tip_reference",
    "force": "wind_force",
    "air": "air_velocity",
    "tilts": "tilts",
}
"""Field of a filmed flight -> equal array of a log."""


@immutable(slots=False)
class FilmedFlight(FlightFrames):
    """Frames of one vehicle's flight from its log, with its error, contact force and
    end over the whole flight.

    Attributes:
        error: (F,) m, tip error; perpendicular to the nominal normal during a commanded
            push.
        error_time, error_curve: (N,) s and m, the same at every control instant.
        contact: (F,) N, sum of all normal forces on the vehicle, or of its grips; None
            without a world.
        contact_curve, wanted_curve: (N,) N, the same, and the force that the reference
            asks for; the second one None where it asks for none.
        end: s; from then on the vehicle stays where it was. lost: why it ended early,
            in words; empty for a whole flight.
    """

    error: Array
    error_time: Array
    error_curve: Array
    end: float
    lost: str
    contact: Array | None = None
    contact_curve: Array | None = None
    wanted_curve: Array | None = None


def film_flights(
    logs: Sequence[Log], times: Array, labels: Sequence[str] | None = None
) -> list[FilmedFlight]:
    """Resample several logs at a film's frames by linear interpolation, each vehicle
    with a name and a colour.

    After the end of a log its last state stays.

    Raises:
        ValueError: too many flights or labels, or a log that does not tell its vehicle.
    """
    count = sum(len(log.agents) for log in logs)
    if not 1 <= count <= MOST_FLIGHTS:
        what = "flights" if count == len(logs) else "agents"
        raise ValueError(
            f"{what} = {count}: must be from 1 to {MOST_FLIGHTS} in one film"
        )
    names = flight_labels(logs) if labels is None else list(labels)
    require_as_many(names, len(logs))
    colors = iter(COLORS)
    flights: list[FilmedFlight] = []
    for number, (log, name) in enumerate(zip(logs, names, strict=True)):
        team = [
            _resample(own, label, next(colors), times, number)
            for label, own in vehicle_logs(name, log)
        ]
        flights += _with_scenes(team, log)
    return flights


def require_as_many(labels: Sequence[str], flights: int) -> None:
    """Raise an error unless there are as many labels as flights.

    Raises:
        ValueError: one line.
    """
    if len(labels) != flights:
        raise ValueError(
            f"labels = {shown(labels)}: must be as many as the flights, {flights}"
        )


def _resample(
    log: Log, label: str, color: Color, times: Array, number: int
) -> FilmedFlight:
    """Resample a log of one vehicle at a film's frames, without a scene."""
    agent = drawn_scenario(log).agent
    now: dict[str, Any] = {
        field: read(log.time, getattr(log, name), times) for field, name in READ.items()
    }
    # an angle that jumps by a turn would be interpolated through all between
    yaw = read(log.time, np.unwrap(log.yaw_reference)[:, None], times)[:, 0]
    whole = log.status == "completed"
    error = lengths(tip_error(agent, log.time, log.tip, log.tip_reference))
    contact = applied_force(log)
    return FilmedFlight(
        label=label,
        color=color,
        vehicle=agent.vehicle,
        times=times,
        quaternion=read(log.time, continuous(log.quaternion), times),
        desired_quaternion=yaw_quaternion(yaw),
        error=read(log.time, error[:, None], times)[:, 0],
        error_time=log.time,
        error_curve=error,
        contact=(
            None if contact is None else read(log.time, contact[:, None], times)[:, 0]
        ),
        contact_curve=contact,
        wanted_curve=desired_push(log),
        end=end_time(log) if whole else float(log.time[-1]),
        lost="" if whole else log.status.replace("_", " "),
        number=number,
        **now,
    )


def _with_scenes(team: Sequence[FilmedFlight], log: Log) -> Iterator[FilmedFlight]:
    """Add the scenes around the vehicles of a flight: what all share to the first, to
    each what it has for itself.
    """
    around = np.mean(np.concatenate([each.desired_tip for each in team]), axis=0)
    patch = patch_about(np.concatenate([each.tip for each in team]))
    scenario = drawn_scenario(log)
    agents = {
        name: replace(each, name=name, around=around, patch=patch)
        for name, each in zip(scenario.agents, team, strict=True)
    }

    def draw(name: str, shared: bool) -> Scene:
        models = (
            *scenario.own_components(scenario.agents[name]),
            *(scenario.shared_components if shared else ()),
        )
        return _scene(log.agents[name], models, replace(agents[name], agents=agents))

    for each, scene in zip(agents.values(), scenes_of(agents, draw), strict=True):
        cameras = {
            name: sensor
            for name, (agent, sensor) in cameras_of(scenario).items()
            if agent == each.name
        }
        yield replace(each, scene=scene, cameras=cameras)


def _scene(log: Log, components: Sequence[Component[Tree]], seen: Instants) -> Scene:
    """Surfaces, objects and contact forces at a film's frames, interpolated from a
    log.
    """

    def at_frames(name: str) -> Array:
        array = log.component(name)
        if name.endswith("quaternion") and array.size:
            array = np.concatenate(
                [continuous(each) for each in np.split(array, array.shape[1] // 4, 1)],
                axis=1,
            )
        return read(log.time, array, seen.times)

    scene, flying = (
        scene_in_log(components, seen, at_frames),
        # after the end of the flight nothing presses any more
        seen.times[:, None] < end_time(log),
    )
    arrows = (
        replace(each, force=each.force * flying)
        for each in scene.arrows
        if np.any(each.force)
    )
    return replace(scene, arrows=tuple(arrows))


def read(time: Array, values: Array, times: Array) -> Array:
    """Interpolate the columns of a time series (N, k) at other times; returns (F,
    k).
    """
    columns = [np.interp(times, time, column) for column in values.T]
    return np.stack(columns, axis=1) if columns else np.zeros((len(times), 0))
