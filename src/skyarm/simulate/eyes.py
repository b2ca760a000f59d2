"""Pictures of cameras and lidars: what each sees of the shapes of contact.

A picture follows from the poses of all bodies, the time and the seed, and is computed
when it is asked for: from the state of a running loop or from a log, with the same
numbers. Neither the loop nor a log holds pictures.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from skyarm.algebra import Mat3, Vec3
from skyarm.algebra.scalars.philox import normal
from skyarm.log.flight_log import Log, rows_of
from skyarm.records.arrays import Array, IntArray, doubles, stack_values
from skyarm.records.files import must_be_one_of
from skyarm.records.immutable import immutable, positional
from skyarm.records.leaves import rebuild
from skyarm.scenario.scenario_record import Scenario, ScenarioError
from skyarm.sensing.cameras.camera_kinds import RaySensor
from skyarm.sensing.cameras.ray_casting import RayCaster
from skyarm.simulate.draws import sensor_channel
from skyarm.simulate.first_state import first_loop_state
from skyarm.simulate.loop_state import LoopState, structure_of
from skyarm.world.component import by_array
from skyarm.world.contact.contact_point import BASE_NAME
from skyarm.world.contact.contact_scene import carrier_poses
from skyarm.world.contact.material import Material
from skyarm.world.contact.surface import Surface
from skyarm.world.contact.vehicle_bodies import (
    Part,
    fixed_side,
    part_of,
    part_of_vehicle,
)
from skyarm.world.scene.vehicle_shapes import (
    body_poses,
    matrices,
    place,
    quaternions_of,
    vectors,
)

AT_ONCE = 64
"""Number of instants of a log whose poses are computed together."""

CARRIED = ("object_position", "object_quaternion", "mechanism_position")
"""Logged arrays with the poses of movable bodies."""


@positional
class _Sight:
    """What the rays of one picture met: shapes, their poses from the sensor, number of
    the shape (from 1 on) and true depth of each ray.
    """

    shapes: Sequence[Surface]
    rotations: Array
    eyes: Array
    directions: Array
    number: IntArray
    depth: Array

    def normals(self) -> Array:
        """Outward unit normals (..., 3), optical axes; NaN where nothing is met."""
        found = np.full(self.directions.shape, np.nan)
        for i in np.unique(self.number[self.number > 0]):
            here = self.number == i
            R_SC = self.rotations[i - 1]
            way = self.directions[here] * self.depth[here][:, None]
            places = self.eyes[i - 1] + way @ R_SC.T
            normal_S = self.shapes[i - 1].skin(Vec3(*places.T), 0)[1]
            found[here] = vectors(normal_S, len(places)) @ R_SC
        return found


@immutable(slots=False, eq=False)
class Frame:
    """Picture of a depth camera or lidar.

    Attributes:
        time: instant at which it was taken, s; it arrives the sensor's latency later.
        sensor: name of the sensor.
        depth: (rows, columns) m, along the optical axis of a camera, along the ray of a
            lidar; infinite where nothing is within range, -inf where something is
            nearer than it, NaN where a reading is lost.
        segment: (rows, columns) number in ``names`` of the body that is seen; 0 for
            nothing within range.
        position, quaternion: true pose of the optical frame, (3,) m and (4,) w x y z,
            world axes.
        names: names of the bodies, as of contact; the first is empty.
        directions: (rows, columns, 3) of the rays, optical axes.
    """

    time: float
    sensor: str
    depth: Array
    segment: IntArray
    position: Array
    quaternion: Array
    names: tuple[str, ...]
    directions: Array
    sight: _Sight

    @cached_property
    def normal(self) -> Array:
        """Outward unit normals (rows, columns, 3) of what is seen, optical axes; NaN
        for nothing within range.
        """
        return np.where(self.segment[..., None] > 0, self.sight.normals(), np.nan)

    def points(self) -> Array:
        """Points (rows, columns, 3) that are seen, m, optical axes; NaN for none."""
        depth = np.where(np.isfinite(self.depth), self.depth, np.nan)
        return self.directions * depth[..., None]


@positional
class _Instants:
    """Poses of vehicles and movable bodies at N instants, as a log has them: times
    (N,), position (N, 3), quaternion (N, 4) and joints (N, n) of each vehicle, and
    arrays of ``CARRIED``.
    """

    times: Array
    vehicles: Sequence[tuple[Array, Array, Array]]
    carried: Mapping[str, Array]


@positional
class _Camera:
    """Sensor on a body, with the shapes that it may see."""

    sensor: RaySensor
    body: int
    rotation: Array
    position: Array
    shapes: IntArray
    caster: RayCaster
    directions: Array
    every: int
    channel: int


class Eyes:
    """All cameras and lidars of a scenario, and the shapes that they see.

    Attributes:
        names: names of the sensors, behind the vehicle's name and a dot if there are
            several.
        sensors: the sensors by these names.
        bodies: names of the bodies that may be seen; the first is empty, for nothing.
    """

    def __init__(self, scenario: Scenario) -> None:
        self._scenario = scenario
        self._world = world = scenario.world
        self._carriers = () if world is None else world.carriers
        self._surfaces = () if world is None else world.surfaces
        parts: list[tuple[int, Part]] = []
        for i, surface in enumerate(self._surfaces):
            parts.append((i, fixed_side(surface, 0.0).parts[0]))
        first = len(self._surfaces)
        for i, carrier in enumerate(self._carriers, first):
            parts += [(i, part_of(each)) for each in carrier.surfaces]
        first += len(self._carriers)
        # of each vehicle all bodies have poses, also those without shapes
        self._first = dict[str, int]()
        names = [each.name for each in (*self._surfaces, *self._carriers)]
        for agent, vehicle in scenario.vehicles.items():
            self._first[agent] = first
            own = f"{agent}." if len(scenario.vehicles) > 1 else ""
            called = [BASE_NAME, *(each.name for each in vehicle.moving)]
            names += [own + each for each in called]
            for shape in vehicle.collisions:
                part = part_of_vehicle(shape, Material())
                parts.append((first + 1 + shape.link, part))
            first += len(called)
        self.bodies = ("", *names)
        self._owners = np.array([i for i, _ in parts], int)
        self._shapes = [part.shape for _, part in parts]
        self._turns = _stack([part.rotation for _, part in parts])
        self._places = np.array(
            [[*map(float, part.position)] for _, part in parts]
        ).reshape(-1, 3)
        self._cameras = {
            each.name if len(scenario.agents) == 1 else f"{agent}.{each.name}": (
                self._camera(agent, each.name, each.sensor)
            )
            for agent, record in scenario.agents.items()
            for each in record.cameras
        }
        self.names = tuple(self._cameras)
        self.sensors = {name: each.sensor for name, each in self._cameras.items()}

    def _camera(self, agent: str, name: str, sensor: RaySensor) -> _Camera:
        vehicle = self._scenario.vehicles[agent]
        body = self._first[agent] + 1 + sensor.body_of(vehicle)
        seen = np.flatnonzero(sensor.sees_own_link | (self._owners != body))
        directions = sensor.directions()
        return _Camera(
            sensor,
            body,
            matrices(sensor.rotation, 1)[0],
            np.array([*map(float, sensor.position)]),
            seen,
            RayCaster(directions.reshape(-1, 3), [self._shapes[i] for i in seen]),
            directions,
            round(self._scenario.rates.control / sensor.frequency),
            sensor_channel(name, agent),
        )

    def _of(self, name: str) -> _Camera:
        if name not in self._cameras:
            known = must_be_one_of(self.names, name)
            raise ScenarioError(
                f"sensors.{name}: {known if self.names else 'there is no camera'}"
            )
        return self._cameras[name]

    def is_due(self, name: str, tick: int) -> bool:
        """True if a sensor takes a picture in a control period."""
        return tick % self._of(name).every == 0

    def frame(self, name: str, now: LoopState, time: float, tick: int) -> Frame:
        """Picture from a state of the loop, before a control period.

        Args:
            name: name of the sensor.
            now: state of the loop.
            time: s.
            tick: number of the period, which numbers the picture's noise.
        """
        seen = self._instants(now, np.array([time]))
        (frame,) = self._frames(name, seen, np.array([tick]))
        return frame

    def _ticks(self, log: Log) -> IntArray:
        return np.rint(log.time * self._scenario.rates.control).astype(int)

    def rows(self, name: str, log: Log) -> IntArray:
        """Instants of a log at which a sensor is due."""
        return np.flatnonzero(self._ticks(log) % self._of(name).every == 0)

    def frames(self, name: str, log: Log) -> Iterator[Frame]:
        """Pictures of a flight from its log, one at a time, when the sensor is due."""
        ticks = self._ticks(log)
        rows = self.rows(name, log)
        for begin in range(0, len(rows), AT_ONCE):
            chosen = rows[begin : begin + AT_ONCE]
            # arrays of a long flight are read from its file at every access
            part = rows_of(log, slice(chosen[0], chosen[-1] + 1))
            some = chosen - chosen[0]
            seen = _Instants(
                part.time[some],
                [
                    (each.position[some], each.quaternion[some], each.joints[some])
                    for each in part.agents.values()
                ],
                {each: part.component(each)[some] for each in CARRIED},
            )
            yield from self._frames(name, seen, ticks[chosen])

    def depths(
        self,
        name: str,
        loop_leaves: Array,
        time: ArrayLike,
        tick: ArrayLike,
        episodes: ArrayLike | None = None,
    ) -> Array:
        """Depths (lanes, rows, columns) of many flights at once.

        Args:
            name: name of the sensor.
            loop_leaves: (leaves, lanes) of the loops' states.
            time: s, one or (lanes,).
            tick: number of the control period, one or (lanes,).
            episodes: (lanes,) keys of the noise; the scenario's if left out.
        """
        camera = self._of(name)
        lanes = loop_leaves.shape[1]
        now = rebuild(self._structure, iter(loop_leaves))
        times, ticks = np.broadcast_to(time, lanes), np.broadcast_to(tick, lanes)
        keys = self._scenario.episode if episodes is None else episodes
        episode = np.broadcast_to(keys, lanes)
        depths = np.empty((lanes, *camera.sensor.shape))
        seen = self._instants(now, times)
        poses = self._poses(seen)
        for begin in range(0, lanes, AT_ONCE):
            some = slice(begin, begin + AT_ONCE)
            sights = self._look(camera, poses[0][some], poses[1][some])
            rows = zip(sights, ticks[some], episode[some], strict=True)
            for i, (sight, at, key) in enumerate(rows, begin):
                depths[i] = self._measured(camera, sight, int(at), int(key))
        return depths

    @cached_property
    def _structure(self) -> LoopState:
        return structure_of(first_loop_state(self._scenario))

    def _instants(self, now: LoopState, times: Array) -> _Instants:
        """Poses in a state of the loop, whose numbers are floats or arrays."""
        count = len(times)
        vehicles = [
            (
                stack_values(count, each.state.position).T,
                stack_values(count, each.state.quaternion).T,
                stack_values(count, each.state.joints).T,
            )
            for each in now.agents
        ]
        carried = dict[str, Array]()
        if self._carriers:
            # the contact model is the last of the shared ones
            memories = now.components[-1].carried
            numbers = [
                number
                for each, memory in zip(self._carriers, memories, strict=True)
                for number in each.logged(each.advance(memory))
            ]
            carried = {
                name: stack_values(count, values).T
                for name, values in by_array(self._carriers, numbers).items()
            }
        return _Instants(times, vehicles, carried)

    def _poses(self, seen: _Instants) -> tuple[Array, Array]:
        """Rotations (N, bodies, 3, 3) to world axes and positions (N, bodies, 3) of all
        bodies.
        """
        count = len(seen.times)
        rows = [
            (matrices(each.rotation, count), vectors(each.place(seen.times)[0], count))
            for each in self._surfaces
        ]
        if self._world is not None:
            objects, mechanisms = self._world.objects, self._world.mechanisms
            carried = carrier_poses(objects, mechanisms, seen.carried, count)
            rows += [carried[i] for i in range(len(carried))]
        for vehicle, own in zip(
            self._scenario.vehicles.values(), seen.vehicles, strict=True
        ):
            poses = (
                place(vehicle, *(each[0] for each in own)).poses
                if count == 1
                else body_poses(vehicle, *own)
            )
            rows += [poses[body] for body in sorted(poses)]
        return np.stack([R for R, _ in rows], 1), np.stack([p for _, p in rows], 1)

    def _look(
        self, camera: _Camera, rotations: Array, positions: Array
    ) -> list[_Sight]:
        """What a sensor's rays meet at N instants."""
        R_WC, p_WC = self._mounted(camera, rotations, positions)
        owners = self._owners[camera.shapes]
        R_WB = rotations[:, owners]
        R_SW = (R_WB @ self._turns[camera.shapes]).swapaxes(2, 3)
        places = self._places[camera.shapes][:, :, None]
        p_WS = positions[:, owners] + (R_WB @ places)[..., 0]
        R_SC = R_SW @ R_WC[:, None]
        eyes = (R_SW @ (p_WC[:, None] - p_WS)[..., None])[..., 0]
        depth, number = camera.caster.cast(R_SC, eyes)
        shapes = [self._shapes[i] for i in camera.shapes]
        shape = (len(depth), *camera.sensor.shape)
        rows = zip(R_SC, eyes, number.reshape(shape), depth.reshape(shape), strict=True)
        return [
            _Sight(shapes, R, eye, camera.directions, each, far)
            for R, eye, each, far in rows
        ]

    @staticmethod
    def _mounted(
        camera: _Camera, rotations: Array, positions: Array
    ) -> tuple[Array, Array]:
        """Rotations (N, 3, 3) and positions (N, 3) of a sensor's optical frame."""
        R_WB = rotations[:, camera.body]
        away = R_WB @ camera.position[:, None]
        return R_WB @ camera.rotation, positions[:, camera.body] + away[..., 0]

    def _measured(
        self, camera: _Camera, sight: _Sight, tick: int, episode: int
    ) -> Array:
        """Depth (rows, columns) with range and errors."""
        sensor, depth = camera.sensor, sight.depth
        read = depth
        if sensor.noise.any:
            numbers = normal(
                self._scenario.seed,
                episode,
                camera.channel,
                tick // camera.every,
                depth.size,
            )
            met = np.where(np.isfinite(depth), depth, 0.0)
            read = depth + sensor.noise.deviation(met) * numbers.reshape(depth.shape)
        read = np.where(depth > float(sensor.farthest), np.inf, read)
        read = np.where(depth < float(sensor.nearest), -np.inf, read)
        if sensor.grazing:
            along = np.abs((sight.normals() * sight.directions).sum(axis=-1))
            size = np.linalg.norm(sight.directions, axis=-1)
            lost = along < np.sin(float(sensor.grazing)) * size
            read = np.where(lost & np.isfinite(read), np.nan, read)
        return read

    def _frames(self, name: str, seen: _Instants, ticks: IntArray) -> Iterator[Frame]:
        camera = self._of(name)
        poses = self._poses(seen)
        for i, tick in enumerate(ticks.tolist()):
            R, p = (each[i : i + 1] for each in poses)
            R_WC, p_WC = self._mounted(camera, R, p)
            (sight,) = self._look(camera, R, p)
            within = (sight.depth >= float(camera.sensor.nearest)) & (
                sight.depth <= float(camera.sensor.farthest)
            )
            owners = 1 + np.append(self._owners[camera.shapes], -1)
            segment = np.where(within, owners[sight.number - 1], 0)
            yield Frame(
                time=float(seen.times[i]),
                sensor=name,
                depth=self._measured(camera, sight, tick, self._scenario.episode),
                segment=segment,
                position=p_WC[0],
                quaternion=quaternions_of(R_WC)[0],
                names=self.bodies,
                directions=camera.directions,
                sight=sight,
            )


def _stack(rotations: Sequence[Mat3]) -> Array:
    """Array (n, 3, 3) of matrices with plain numbers."""
    rows = [[[*map(float, row)] for row in R.rows] for R in rotations]
    return doubles(rows).reshape(-1, 3, 3)


def frames_of(log: Log, name: str) -> Iterator[Frame]:
    """Pictures of a sensor of a flight, one at a time, from the flight's log."""
    return Eyes(log.scenario).frames(name, log)
