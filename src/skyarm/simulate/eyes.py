"""Pictures of cameras and lidars: what each sees of the shapes of contact.

A picture follows from the poses of all bodies, the time and the seed, and is computed
when it is asked for: from the state of a running loop or from a log, with the same
numbers. Neither the loop nor a log holds pictures.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from skyarm.algebra import Vec3
from skyarm.algebra.scalars.philox import normal
from skyarm.log.flight_log import Log
from skyarm.records.arrays import Array, IntArray, float_array, stack_values
from skyarm.records.files import must_be_one_of
from skyarm.records.immutable import immutable, positional
from skyarm.records.leaves import rebuild
from skyarm.scenario.numbers import with_numbers
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
from skyarm.world.contact.shape_pairs import PlacedShape
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

if TYPE_CHECKING:
    from skyarm.world.contact import Contact

AT_ONCE = 64
"""Number of instants whose rays are met together."""

CARRIED = ("object_position", "object_quaternion", "mechanism_position")
"""Logged arrays with the poses of movable bodies."""


@positional
class _Camera:
    """Sensor with its body, the shapes that it may see, and the bodies of these."""

    sensor: RaySensor
    body: int
    owners: IntArray
    parts: Sequence[Part]
    directions: Array
    caster: RayCaster
    every: int
    channel: int


@immutable(slots=False, eq=False)
class Frame:
    """Picture of a depth camera or lidar.

    Attributes:
        time: instant at which it was taken, s; it arrives the sensor's latency later.
        sensor: name of the sensor.
        names: names of the bodies, as of contact; the first is empty.
        position, quaternion: true pose of the optical frame, (3,) m and (4,) w x y z,
            world axes.
        distance: (rows, columns) m, true depth; infinite where nothing is ahead.
        number: (rows, columns) of the shape that is met, from 1 on.
        rotations, eyes: (bodies, 3, 3) from optical axes to those of each body, and (3,
            bodies) m, the sensor's place in these.
        noise: (rows, columns) standard normal numbers; empty without noise.
        camera: sensor and shapes.
    """

    time: float
    sensor: str
    names: tuple[str, ...]
    position: Array
    quaternion: Array
    distance: Array
    number: IntArray
    rotations: Array
    eyes: Array
    noise: Array
    camera: _Camera

    @property
    def directions(self) -> Array:
        """Directions (rows, columns, 3) of the rays, optical axes, whose length is one
        unit of depth.
        """
        return self.camera.directions

    @cached_property
    def depth(self) -> Array:
        """Measured depth (rows, columns), m: along the optical axis of a camera, along
        the ray of a lidar.

        Infinite where nothing is within range, -inf where something is nearer than it,
        NaN where a reading is lost.
        """
        sensor = self.camera.sensor
        depth = self.distance
        if self.noise.size:
            met = np.where(np.isfinite(depth), depth, 0.0)
            depth = depth + sensor.noise.deviation(met) * self.noise
        if sensor.grazing:
            across = np.abs((self.normal * self.directions).sum(axis=-1))
            least = np.sin(sensor.grazing) * np.linalg.norm(self.directions, axis=-1)
            depth = np.where(across < least, np.nan, depth)
        depth = np.where(self.distance > sensor.farthest, np.inf, depth)
        return np.where(self.distance < sensor.nearest, -np.inf, depth)

    @cached_property
    def segment(self) -> IntArray:
        """Number (rows, columns) in ``names`` of the body that is seen; 0 for nothing
        within range.
        """
        sensor, far = self.camera.sensor, self.distance
        bodies = np.append(1 + self.camera.owners, 0)[self.number - 1]
        return bodies * ((far >= sensor.nearest) & (far <= sensor.farthest))

    @cached_property
    def normal(self) -> Array:
        """Outward unit normals (rows, columns, 3) of what is seen, optical axes; NaN
        for nothing within range.
        """
        normals = np.full(self.directions.shape, np.nan)
        for i in np.unique(self.number[self.segment > 0]) - 1:
            here = (self.number == i + 1) & (self.segment > 0)
            part, body = self.camera.parts[i], self.camera.owners[i]
            R_BC = self.rotations[body]
            way = self.directions[here] * self.distance[here][:, None]
            places = Vec3(*(self.eyes[body] + way @ R_BC.T).T)
            solid = PlacedShape(part.shape, part.rotation, part.position)
            normals[here] = vectors(solid.skin(places, 0)[1], len(way)) @ R_BC
        return normals

    def points(self) -> Array:
        """Points (rows, columns, 3) that are seen, m, optical axes; NaN for none."""
        depth = np.where(np.isfinite(self.depth), self.depth, np.nan)
        return self.directions * depth[..., None]


Poses = tuple[Array, Sequence[tuple[Array, Array, Array]], Mapping[str, Array]]
"""Times (N,) s, position (N, 3), quaternion (N, 4) and joints (N, n) of each vehicle,
and arrays of ``CARRIED``, as of a log."""


class Eyes:
    """All cameras and lidars of a scenario, and the shapes that they see.

    Attributes:
        sensors: the sensors by name, behind the vehicle's name and a dot if there are
            several.
        bodies: names of the bodies that may be seen; the first is empty, for nothing.
    """

    def __init__(self, scenario: Scenario) -> None:
        self._scenario = scenario
        self._worlds = scenario.worlds
        bodies = list[tuple[str, Sequence[Part]]]()
        for contact in self._worlds:
            bodies += [(s.name, fixed_side(s, 0.0).parts) for s in contact.surfaces]
            for each in contact.carriers:
                bodies.append((each.name, [*map(part_of, each.surfaces)]))
        bases = dict[str, int]()
        for agent, vehicle in scenario.vehicles.items():
            bases[agent] = len(bodies)
            several = f"{agent}." if len(scenario.vehicles) > 1 else ""
            names = [BASE_NAME, *(each.name for each in vehicle.moving)]
            for link, name in enumerate(names, -1):
                own = [each for each in vehicle.collisions if each.link == link]
                parts = [part_of_vehicle(each, Material()) for each in own]
                bodies.append((several + name, parts))
        self.bodies = ("", *(name for name, _ in bodies))
        every = [(i, part) for i, (_, parts) in enumerate(bodies) for part in parts]
        self._cameras = dict[str, _Camera]()
        for agent, record in scenario.agents.items():
            for each in record.cameras:
                sensor = each.sensor
                body = bases[agent] + 1 + sensor.body_of(record.vehicle)
                seen = [row for row in every if sensor.sees_own_link or row[0] != body]
                owners = np.array([i for i, _ in seen], int)
                parts = [part for _, part in seen]
                ways = sensor.directions()
                name = f"{agent}.{each.name}" if len(bases) > 1 else each.name
                self._cameras[name] = _Camera(
                    sensor,
                    body,
                    owners,
                    parts,
                    ways,
                    RayCaster(ways.reshape(-1, 3), owners, parts),
                    round(scenario.rates.control / sensor.frequency),
                    sensor_channel(each.name, agent),
                )
        self.sensors = {name: each.sensor for name, each in self._cameras.items()}

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the sensors."""
        return tuple(self.sensors)

    def _camera(self, name: str) -> _Camera:
        if name not in self._cameras:
            allowed = must_be_one_of(self.names, name)
            raise ScenarioError(
                f"sensors.{name}: {allowed if self.names else 'there is no camera'}"
            )
        return self._cameras[name]

    def is_due(self, name: str, tick: int) -> bool:
        """True if a sensor takes a picture in a control period."""
        return tick % self._camera(name).every == 0

    def frame(self, name: str, now: LoopState, time: float, tick: int) -> Frame:
        """Picture from a state of the loop, before a control period.

        Args:
            name: name of the sensor.
            now: state of the loop.
            time: s.
            tick: number of the period, which numbers the picture's noise.
        """
        poses = self._poses_in(now, np.array([time]))
        return next(self._frames(name, poses, tick, self._keys))

    def frames(self, name: str, log: Log) -> Iterator[Frame]:
        """Pictures of a flight from its log, one at a time, when the sensor is due."""
        ticks = np.rint(log.time * self._scenario.rates.control).astype(int)
        rows = np.flatnonzero(ticks % self._camera(name).every == 0)
        vehicles = [
            (each.position[rows], each.quaternion[rows], each.joints[rows])
            for each in log.agents.values()
        ]
        carried = {each: log.component(each)[rows] for each in CARRIED}
        poses = log.time[rows], vehicles, carried
        return self._frames(name, poses, ticks[rows], self._keys)

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
        now = rebuild(self._structure, iter(loop_leaves))
        times = np.broadcast_to(time, loop_leaves.shape[1])
        seed, episode = self._keys
        keys = seed, episode if episodes is None else episodes
        return self.lane_depths(name, now, times, tick, keys=keys)

    def lane_depths(
        self,
        name: str,
        now: LoopState,
        times: Array,
        ticks: ArrayLike,
        *,
        keys: Sequence[ArrayLike] = (),
        numbers: Mapping[str, Array] = MappingProxyType({}),
    ) -> Array:
        """Depths (lanes, rows, columns) of flights that differ in numbers and keys.

        Args:
            name: name of the sensor.
            now: state of the loop, its scalars (lanes,).
            times: (lanes,) s. ticks: numbers of the control periods.
            keys: seeds and episodes of the noise; the scenario's if left out.
            numbers: path -> (lanes,) numbers of the scenario, such as the place of a
                surface.
        """
        poses = self._poses_in(now, times)
        frames = self._frames(name, poses, ticks, keys or self._keys, numbers)
        return np.stack([each.depth for each in frames])

    @property
    def _keys(self) -> tuple[int, int]:
        return self._scenario.seed, self._scenario.episode

    @cached_property
    def _structure(self) -> LoopState:
        return structure_of(first_loop_state(self._scenario))

    def _poses_in(self, now: LoopState, times: Array) -> Poses:
        """Poses in a state of the loop, whose numbers are floats or arrays."""

        def columns(values: Sequence[Array]) -> Array:
            return stack_values(len(times), values).T

        vehicles = [
            (
                columns([*each.state.position]),
                columns([*each.state.quaternion]),
                columns(each.state.joints),
            )
            for each in now.agents
        ]
        carried = dict[str, Array]()
        for contact in self._worlds:
            # the contact model is the last of the shared ones
            memories = now.components[-1].carried
            pairs = zip(contact.carriers, memories, strict=True)
            logged = [n for each, m in pairs for n in each.logged(each.advance(m))]
            rows = by_array(contact.carriers, logged)
            carried |= {name: columns(values) for name, values in rows.items()}
        return times, vehicles, carried

    def _world_poses(
        self, poses: Poses, worlds: Sequence[Contact]
    ) -> tuple[Array, Array]:
        """Rotations (N, bodies, 3, 3) to world axes and positions (N, bodies, 3) of all
        bodies.
        """
        times, vehicles, carried = poses
        count = len(times)
        rows = list[tuple[Array, Array]]()
        for contact in worlds:
            for each in contact.surfaces:
                turn = matrices(each.rotation, count)
                rows.append((turn, vectors(each.place(times)[0], count)))
            moved = carrier_poses(contact.objects, contact.mechanisms, carried, count)
            rows += moved.values()
        whole = self._scenario.vehicles.values()
        for vehicle, own in zip(whole, vehicles, strict=True):
            rows += (
                place(vehicle, *(each[0] for each in own)).poses
                if count == 1
                else body_poses(vehicle, *own)
            ).values()
        rotations, positions = zip(*rows, strict=True)
        return np.stack(rotations, 1), np.stack(positions, 1)

    def _frames(
        self,
        name: str,
        poses: Poses,
        ticks: ArrayLike,
        keys: Sequence[ArrayLike],
        varied: Mapping[str, Array] = MappingProxyType({}),
    ) -> Iterator[Frame]:
        """Pictures at N instants, in pieces, so that memory does not grow with N."""
        camera = self._camera(name)
        sensor = camera.sensor
        R_BO = matrices(sensor.rotation, 1)[0]
        p_BO = float_array(sensor.position)[:, None]
        times, vehicles, carried = poses
        at = np.array([np.full(len(times), each) for each in (ticks, *keys)], int)
        for begin in range(0, len(times), AT_ONCE):
            part = slice(begin, begin + AT_ONCE)
            own = {path: column[part] for path, column in varied.items()}
            R_WB, p_WB = self._world_poses(
                (
                    times[part],
                    [tuple(each[part] for each in own) for own in vehicles],
                    {each: array[part] for each, array in carried.items()},
                ),
                with_numbers(self._scenario, own).worlds if own else self._worlds,
            )
            R_WO = R_WB[:, camera.body] @ R_BO
            p_WO = p_WB[:, camera.body] + (R_WB[:, camera.body] @ p_BO)[..., 0]
            R_SO = R_WB.swapaxes(2, 3) @ R_WO[:, None]
            off = (p_WO[:, None] - p_WB)[..., None]
            eyes = (R_WB.swapaxes(2, 3) @ off)[..., 0]
            distances, numbers = camera.caster.cast(R_SO, eyes)
            quaternions = quaternions_of(R_WO)
            for i, distance in enumerate(distances):
                noise = np.zeros(0)
                if sensor.noise.any:
                    tick, seed, episode = at[:, begin + i]
                    noise = normal(
                        seed,
                        episode,
                        camera.channel,
                        tick // camera.every,
                        distance.size,
                    ).reshape(sensor.shape)
                yield Frame(
                    time=float(times[begin + i]),
                    sensor=name,
                    names=self.bodies,
                    position=p_WO[i],
                    quaternion=quaternions[i],
                    distance=distance.reshape(sensor.shape),
                    number=numbers[i].reshape(sensor.shape),
                    rotations=R_SO[i],
                    eyes=eyes[i],
                    noise=noise,
                    camera=camera,
                )


def frames_of(log: Log, name: str) -> Iterator[Frame]:
    """Pictures of a sensor of a flight, one at a time, from the flight's log."""
    return Eyes(log.scenario).frames(name, log)
