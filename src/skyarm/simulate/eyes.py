"""Pictures of cameras and lidars: what each sees of the shapes of contact.

A picture follows from the poses of all bodies, the time and the seed, and is computed
when it is asked for: from the state of a running loop or from a log, with the same
numbers. Neither the loop nor a log holds pictures.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cached_property
from itertools import pairwise
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import ArrayLike

from skyarm.algebra import Quaternion, Vec3
from skyarm.algebra.scalars.philox import normal
from skyarm.log.flight_log import Log, rows_of
from skyarm.records.arrays import Array, IntArray, float_array, stack_values
from skyarm.records.files import must_be_one_of
from skyarm.records.immutable import immutable, positional
from skyarm.scenario.in_flight import stretches
from skyarm.scenario.numbers import with_numbers
from skyarm.scenario.scenario_record import Scenario, ScenarioError, cameras_of
from skyarm.sensing.cameras.camera_kinds import RaySensor
from skyarm.sensing.cameras.ray_casting import RayCaster
from skyarm.simulate.drawn_scenario import drawn_scenario
from skyarm.simulate.draws import sensor_channel
from skyarm.simulate.loop_state import LoopState
from skyarm.vehicle import BASE
from skyarm.vehicle.vehicle_records import body_names
from skyarm.world.component import by_array
from skyarm.world.contact.contact_scene import carrier_poses
from skyarm.world.contact.material import Material
from skyarm.world.contact.shape_pairs import PlacedShape
from skyarm.world.contact.vehicle_bodies import Part, part_of, part_of_vehicle
from skyarm.world.scene.vehicle_shapes import (
    body_poses,
    matrices,
    quaternions_of,
    vectors,
)

if TYPE_CHECKING:
    from skyarm.world.contact.contact_memory import ContactMemory

AT_ONCE = 16
"""Largest number of instants whose rays are met together."""

RAYS = 400_000
"""Number of rays that are met together: of the largest pictures ``AT_ONCE`` instants
took 1.2 GB."""

CARRIED = ("object_position", "object_quaternion", "mechanism_position")
"""Logged arrays with the poses of movable bodies."""


Poses = tuple[Array, Array]
"""Rotations (N, bodies, 3, 3) to world axes and positions (N, bodies, 3), m, of all
bodies at N instants."""


@positional
class _Camera:
    """Sensor, its body, its rays, control periods between pictures, and channel of its
    noise.
    """

    sensor: RaySensor
    body: int
    caster: RayCaster
    every: int
    channel: int


@immutable(slots=False, eq=False)
class RangeImage:
    """Picture of a depth camera or lidar.

    Attributes:
        time: instant at which it was taken, s; it arrives the sensor's latency later.
        sensor: name of the sensor.
        names: names of the bodies, as of contact; the first is empty.
        position, quaternion: true pose of the optical frame, (3,) m and (4,) w x y z,
            world axes.
        distance: (rows, columns) m, true depth; infinite where nothing is ahead.
        number: (rows, columns) of the shape that is met, from 1 on.
        rotations, eyes: (bodies, 3, 3) from optical axes to those of each body, and
            (bodies, 3) m, the sensor's place in these.
        keys: seed, episode, channel and number of the picture, of its noise.
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
    keys: tuple[int, int, int, int]
    camera: _Camera

    @property
    def directions(self) -> Array:
        """Directions (rows, columns, 3) of the rays, optical axes, whose length is one
        unit of depth.
        """
        return self.camera.caster.directions

    @cached_property
    def depth(self) -> Array:
        """Measured depth (rows, columns), m: along the optical axis of a camera, along
        the ray of a lidar.

        Infinite where nothing is within range, -inf where something is nearer than it,
        NaN where a reading is lost.
        """
        sensor, true = self.camera.sensor, self.distance
        depth = true
        if sensor.noise.any:
            numbers = normal(*self.keys, true.size).reshape(true.shape)
            # without a hit any depth will do: its noise is lost in the sum with
            # infinity
            met = np.where(np.isfinite(true), true, 0.0)
            depth = true + sensor.noise.deviation(met) * numbers
        if sensor.grazing:
            across = np.abs((self.normal * self.directions).sum(axis=-1))
            least = np.sin(sensor.grazing) * np.linalg.norm(self.directions, axis=-1)
            depth = np.where(across < least, np.nan, depth)
        # by the true distance: noise carries no hit out of the range
        depth = np.where(true > sensor.farthest, np.inf, depth)
        return np.where(true < sensor.nearest, -np.inf, depth)

    @cached_property
    def segment(self) -> IntArray:
        """Number (rows, columns) in ``names`` of the body that is seen; 0 for nothing
        within range.
        """
        sensor, far = self.camera.sensor, self.distance
        bodies = np.array([0, *(1 + each for each in self.camera.caster.owners)])
        within = (far >= sensor.nearest) & (far <= sensor.farthest)
        return np.where(within, bodies[self.number], 0)

    @cached_property
    def normal(self) -> Array:
        """Outward unit normals (rows, columns, 3) of what is seen, optical axes; NaN
        for nothing within range.
        """
        normals = np.full(self.directions.shape, np.nan)
        caster = self.camera.caster
        for i, (body, part) in enumerate(zip(caster.owners, caster.parts, strict=True)):
            here = (self.number == i + 1) & (self.segment > 0)
            if here.any():
                R_BO = self.rotations[body]
                way = self.directions[here] * self.distance[here][:, None]
                places = Vec3(*(self.eyes[body] + way @ R_BO.T).T)
                solid = PlacedShape(part.shape, part.rotation, part.position)
                normals[here] = vectors(solid.skin(places, 0)[1], len(way)) @ R_BO
        return normals

    def points(self, *, world: bool = False) -> Array:
        """Points (rows, columns, 3) that are seen, m, NaN for none: in optical axes, or
        in the world.
        """
        depth = np.where(np.isfinite(self.depth), self.depth, np.nan)
        points = self.directions * depth[..., None]
        if world:
            R_WO = matrices(Quaternion(*self.quaternion).rotation(), 1)[0]
            points = points @ R_WO.T + self.position
        return points


class Eyes:
    """All cameras and lidars of a scenario, and the shapes that they see.

    Attributes:
        names: names of the sensors, behind the vehicle's name and a dot if there are
            several.
        bodies: names of the bodies that may be seen; the first is empty, for nothing.
    """

    def __init__(self, scenario: Scenario) -> None:
        self._scenario = scenario
        shapes = list[tuple[str, Sequence[Part]]]()
        for contact in scenario.worlds:
            shapes += [(each.name, [part_of(each)]) for each in contact.surfaces]
            for carrier in contact.carriers:
                shapes.append((carrier.name, [*map(part_of, carrier.surfaces)]))
        bases = dict[str, int]()
        for agent, vehicle in scenario.vehicles.items():
            # BASE is -1: with it the index is that of the base, the first of these
            # shapes
            bases[agent] = len(shapes) - BASE
            for link, name in enumerate(body_names(vehicle), BASE):
                own = [each for each in vehicle.shapes if each.link == link]
                parts = [part_of_vehicle(each, Material()) for each in own]
                shapes.append((f"{agent}.{name}" if scenario.is_team else name, parts))
        self.bodies = ("", *(name for name, _ in shapes))
        every = [(i, part) for i, (_, parts) in enumerate(shapes) for part in parts]
        self._cameras = dict[str, _Camera]()
        for name, (agent, sensor) in cameras_of(scenario).items():
            body = bases[agent] + sensor.body_of(scenario.vehicles[agent])
            seen = [row for row in every if sensor.sees_own_link or row[0] != body]
            self._cameras[name] = _Camera(
                sensor,
                body,
                RayCaster(
                    sensor.directions(), [i for i, _ in seen], [p for _, p in seen]
                ),
                scenario.rates.periods_between(sensor.frequency),
                sensor_channel(name.rpartition(".")[2], agent),
            )
        self.names = tuple(self._cameras)

    @classmethod
    def of_log(cls, log: Log) -> Eyes:
        """Cameras of a flight from its log, whose laws need not be known any more.

        Raises:
            ValueError: one line: a log of one of several vehicles, which has not the
                poses of all that is seen, or a scenario that cannot be restored.
        """
        if others := log.info.get("others"):
            (own,) = log.agents
            raise ScenarioError(
                f"sensors: see {', '.join(others)}, too, whose poses are in the log of"
                f" the whole flight alone; read its frames('{own}.SENSOR')"
            )
        return cls(drawn_scenario(log))

    def is_due(self, name: str, tick: int) -> bool:
        """True if a sensor takes a picture in a control period."""
        return tick % self._camera(name).every == 0

    def _camera(self, name: str) -> _Camera:
        if name not in self._cameras:
            allowed = must_be_one_of(self.names, name)
            raise ScenarioError(
                f"sensors.{name}: {allowed if self.names else 'there is no camera'}"
            )
        return self._cameras[name]

    def frame(self, name: str, now: LoopState, time: float, tick: int) -> RangeImage:
        """Picture from a state of the loop, before a control period.

        Args:
            name: name of the sensor.
            now: state of the loop.
            time: s.
            tick: number of the period, which numbers the picture's noise.
        """
        times = np.array([time])
        poses = self._present(now, times, self._scenario)
        return next(self._frames(name, times, poses, [(tick, *self._keys)]))

    def frames(self, name: str, log: Log) -> Iterator[RangeImage]:
        """Pictures of a flight from its log, one at a time, when the sensor is due."""
        camera, changes = self._camera(name), stretches(self._scenario)
        # times are k / rate up to rounding
        ticks = np.rint(log.time * self._scenario.rates.control).astype(int)
        due = np.flatnonzero(ticks % camera.every == 0)
        if len(changes) > 1:
            edges = np.searchsorted(ticks, [each.start for each in changes[1:]])
            spans = pairwise([0, *edges, len(ticks)])
            for each, (start, stop) in zip(changes, spans, strict=True):
                # laws that change are not seen, and may not be known any more
                flown = each.overrides.seen_of(self._scenario)
                yield from Eyes(flown).frames(name, rows_of(log, slice(start, stop)))
            return
        # in pieces, of which a long flight reads its file: memory does not grow
        # 1 more: of a large sensor one picture at a time is left
        size = min(AT_ONCE, 1 + RAYS // math.prod(camera.sensor.shape))
        for rows in (due[i : i + size] for i in range(0, len(due), size)):
            part = rows_of(log, slice(rows[0], rows[-1] + 1))
            some = rows - rows[0]
            vehicles = [
                (each.position[some], each.quaternion[some], each.joints[some])
                for each in part.agents.values()
            ]
            carried = {each: part.component(each)[some] for each in CARRIED}
            times = part.time[some]
            poses = self._poses(times, vehicles, carried, self._scenario)
            keys = [(tick, *self._keys) for tick in ticks[rows].tolist()]
            yield from self._frames(name, times, poses, keys)

    def depths(
        self,
        name: str,
        now: LoopState,
        times: Array,
        tick: ArrayLike,
        keys: Sequence[ArrayLike] = (),
        numbers: Mapping[str, Array] = MappingProxyType({}),
    ) -> Array:
        """Depths (lanes, rows, columns) of many flights at once, which may differ in
        numbers and keys.

        Args:
            name: name of the sensor.
            now: state of the loop, its scalars (lanes,).
            times: (lanes,) s.
            tick: number of the control period, one or (lanes,).
            keys: seed and episode of the noise, one or (lanes,); the scenario's if left
                out.
            numbers: path -> (lanes,) numbers of the scenario, of which positions of
                surfaces and centres of mass count.
        """
        own = (
            np.broadcast_to(each, len(times)).astype(int).tolist()
            for each in (tick, *(keys or self._keys))
        )
        flown = self._scenario
        varied = with_numbers(flown, numbers) if numbers else flown
        poses = self._present(now, times, varied)
        frames = self._frames(name, times, poses, zip(*own, strict=True))
        return np.stack([each.depth for each in frames])

    @property
    def _keys(self) -> tuple[int, int]:
        """Keys of the scenario's noise."""
        return self._scenario.seed, self._scenario.episode

    def _present(self, now: LoopState, times: Array, varied: Scenario) -> Poses:
        """Poses in a state of the loop, whose numbers are floats or arrays."""
        count = len(times)
        vehicles = [
            [stack_values(count, x).T for x in (s.position, s.quaternion, s.joints)]
            for s in (each.state for each in now.agents)
        ]
        carried = dict[str, Array]()
        # a state has centres of mass, which may vary
        for contact in varied.worlds:
            # the contact model is the last of the shared ones
            memory = cast("ContactMemory", now.components[-1])
            pairs = zip(contact.carriers, memory.carried, strict=True)
            # advanced as a period does before it logs: attitudes of unit length
            numbers = [x for each, m in pairs for x in each.logged(each.advance(m))]
            columns = cast("Any", contact.carriers)
            for name, values in by_array(columns, numbers).items():
                carried[name] = stack_values(count, values).T
        return self._poses(times, vehicles, carried, varied)

    def _poses(
        self,
        times: Array,
        vehicles: Sequence[Sequence[Array]],
        carried: Mapping[str, Array],
        varied: Scenario,
    ) -> Poses:
        """Poses of all bodies.

        Args:
            times: (N,) s.
            vehicles: position (N, 3), quaternion (N, 4) and joints (N, n) of each.
            carried: arrays of ``CARRIED``, of N rows.
            varied: the scenario, with numbers or arrays (N,).
        """
        count = len(times)
        upright = np.tile(np.eye(3), (count, 1, 1))
        poses = list[tuple[Array, Array]]()
        for contact, moved in zip(self._scenario.worlds, varied.worlds, strict=True):
            for each, placed in zip(contact.surfaces, moved.surfaces, strict=True):
                # parts stand at the surfaces' own positions: only the change is a pose
                away = placed.place(times)[0] - each.position
                poses.append((upright, vectors(away, count)))
            poses += carrier_poses(contact, carried, count).values()
        records = self._scenario.vehicles.values()
        for vehicle, own in zip(records, vehicles, strict=True):
            poses += body_poses(vehicle, *own).values()
        rotations, positions = zip(*poses, strict=True)
        return np.stack(rotations, 1), np.stack(positions, 1)

    def _frames(
        self,
        name: str,
        times: Array,
        poses: Poses,
        keys: Iterable[Sequence[int]],
    ) -> Iterator[RangeImage]:
        """Pictures at some times (N,), s, from period, seed and episode of each."""
        camera = self._camera(name)
        R_WB, p_WB = poses
        R_WL, p_WL = R_WB[:, camera.body], p_WB[:, camera.body]
        R_WO = R_WL @ matrices(camera.sensor.rotation, 1)
        p_WO = p_WL + R_WL @ float_array(camera.sensor.position)
        R_BW = R_WB.swapaxes(2, 3)
        rotations = R_BW @ R_WO[:, None]
        eyes = (R_BW @ (p_WO[:, None] - p_WB)[..., None])[..., 0]
        distances, numbers = camera.caster.cast(rotations, eyes)
        quaternions = quaternions_of(R_WO)
        for i, (tick, seed, episode) in enumerate(keys):
            yield RangeImage(
                time=float(times[i]),
                sensor=name,
                names=self.bodies,
                position=p_WO[i],
                quaternion=quaternions[i],
                distance=distances[i],
                number=numbers[i],
                rotations=rotations[i],
                eyes=eyes[i],
                keys=(seed, episode, camera.channel, tick // camera.every),
                camera=camera,
            )
