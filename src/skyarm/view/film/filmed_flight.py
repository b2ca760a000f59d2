"""Flight resampled at a film's frames, with the solids, lines and arrows that are drawn."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import field, replace
from itertools import groupby, pairwise

import numpy as np

from skyarm.log.flight_log import Log
from skyarm.records.arrays import Array, doubles, lengths, norm
from skyarm.records.files import shown
from skyarm.records.immutable import immutable, positional
from skyarm.records.leaves import Tree
from skyarm.reference.tip_motion import TipPush
from skyarm.vehicle import Vehicle
from skyarm.view.figures.flight_facts import applied_force, desired_push, end_time, flight_labels, vehicle_logs
from skyarm.world.component import Component
from skyarm.world.scene.component_scenes import scene_in_log, scenes_of
from skyarm.world.scene.scene import PATCH, Instants, Scene
from skyarm.world.scene.shapes import RGBA, Solid
from skyarm.world.scene.vehicle_shapes import body_poses, rotor_turns, shape_rotation, vehicle_shapes

Color = tuple[float, float, float]

COLORS: tuple[Color, ...] = (
    (0.835, 0.369, 0.0),
    (0.0, 0.447, 0.698),
    (0.0, 0.620, 0.451),
    (0.8, 0.475, 0.655),
    (0.45, 0.35, 0.75),
    (0.35, 0.35, 0.35),
)
"""Colours (red, green, blue, 0 to 1) by the flight's index; the first four are Okabe and Ito's, distinguishable by
colour-blind eyes."""

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

WIDEST = 6.0
"""Extent (m) of the paths beyond which the patch of a plane does not grow."""


@immutable
class FilmedFlight:
    """Flight of one vehicle at the F frames of a film, in SI units and world axes: poses, references, error, forces.

    Attributes:
        number: index of the flight in the film, the same for the vehicles that fly together.
        label: name in the picture. color: colour of the vehicle, its trail and its curve.
        vehicle: the plant's.
        position (F, 3), quaternion (F, 4) wxyz, joints (F, n): of the plant.
        desired_position (F, 3), desired_quaternion (F, 4), desired_joints (F, n): the continuous reference, level.
        tip, desired_tip: (F, 3) m. force: (F, 3) N of the wind. air: (F, 3) m/s, velocity of the air.
        error: (F,) m, tip error; perpendicular to the nominal normal during a commanded push.
        error_time, error_curve: (N,) s and m, the same at every control instant.
        contact: (F,) N, sum of all normal forces on the vehicle, or of its grips; None without a world.
        contact_curve, wanted_curve: (N,) N, the same, and the force that the reference asks for; the second one None
            where it asks for none.
        tilts: (F, rotors that tilt) rad; without columns where none does.
        scene: solids, lines and arrows of the scenario's components; of what vehicles share only with the first.
        end: s; from then on the vehicle stays where it was. lost: why it ended early, in words; empty for a whole
            flight.
    """

    label: str
    color: Color
    vehicle: Vehicle
    position: Array
    quaternion: Array
    joints: Array
    tilts: Array
    desired_position: Array
    desired_quaternion: Array
    desired_joints: Array
    tip: Array
    desired_tip: Array
    force: Array
    air: Array
    error: Array
    error_time: Array
    error_curve: Array
    end: float
    lost: str
    scene: Scene = field(default_factory=Scene)
    contact: Array | None = None
    contact_curve: Array | None = None
    wanted_curve: Array | None = None
    number: int = 0


Flights = Sequence[FilmedFlight]
"""Flights of single vehicles shown together in one film, those of one flight next to each other."""


def by_flight(flights: Flights) -> list[list[FilmedFlight]]:
    """Group the vehicles of a film by the flight that they are in."""
    return [[*group] for _, group in groupby(flights, lambda each: each.number)]


def film_flights(logs: Sequence[Log], times: Array, labels: Sequence[str] | None = None) -> list[FilmedFlight]:
    """Resample several logs at a film's frames, each vehicle with a name and a colour.

    Raises:
        ValueError: too many flights or labels, or a log that does not tell its vehicle.
    """
    count = sum(len(log.agents) for log in logs)
    if not 1 <= count <= MOST_FLIGHTS:
        what = "flights" if count == len(logs) else "agents"
        raise ValueError(f"{what} = {count}: must be from 1 to {MOST_FLIGHTS} in one film")
    names = flight_labels(logs) if labels is None else list(labels)
    if len(names) != len(logs):
        raise ValueError(f"labels = {shown(names)}: must be as many as the flights, {len(logs)}")
    colors, flights = iter(COLORS), list[FilmedFlight]()
    for number, (log, name) in enumerate(zip(logs, names, strict=True)):
        team = [_resample(own, label, next(colors), times, number) for label, own in vehicle_logs(name, log)]
        flights += _with_scenes(team, log, times)
    return flights


def film_flight(log: Log, label: str, color: Color, times: Array, about: Array | None = None) -> FilmedFlight:
    """Resample a log of one vehicle at a film's frames by linear interpolation; after its end, the last state stays.

    Args:
        log: log of the flight.
        label: name in the picture.
        color: colour of the vehicle.
        times: (F,) s.
        about: (K, 3) m, places about which planes are drawn; the tip's own if left out.

    Raises:
        ValueError: the log does not tell its vehicle.
    """
    (flight,) = _with_scenes([_resample(log, label, color, times)], log, times, about)
    return flight


def _resample(log: Log, label: str, color: Color, times: Array, number: int = 0) -> FilmedFlight:
    """Resample a log of one vehicle at a film's frames, without a scene."""
    agent = log.scenario.agent
    now = {field: read(log.time, getattr(log, name), times) for field, name in READ.items()}
    yaw = read(log.time, np.unwrap(log.yaw_reference)[:, None], times)[:, 0]
    push, whole = getattr(agent.reference, "push", None), log.status == "completed"
    error, contact = _error(log, push), applied_force(log)
    return FilmedFlight(
        label=label,
        color=color,
        vehicle=agent.vehicle,
        quaternion=read(log.time, continuous(log.quaternion), times),
        desired_quaternion=np.stack([np.cos(yaw / 2), 0 * yaw, 0 * yaw, np.sin(yaw / 2)], axis=1),
        error=read(log.time, error[:, None], times)[:, 0],
        error_time=log.time,
        error_curve=error,
        contact=None if contact is None else read(log.time, contact[:, None], times)[:, 0],
        contact_curve=contact,
        wanted_curve=desired_push(log),
        end=end_time(log) if whole else float(log.time[-1]),
        lost="" if whole else log.status.replace("_", " "),
        number=number,
        scene=Scene(),
        **now,
    )


def _with_scenes(team: Flights, log: Log, times: Array, about: Array | None = None) -> Iterator[FilmedFlight]:
    """Add the scenes around the vehicles of a flight: what all share to the first, to each what it has for itself."""
    around = np.mean(np.concatenate([each.desired_tip for each in team]) if about is None else about, axis=0)
    patch = patch_about(np.concatenate([each.tip for each in team]) if about is None else about)
    scenario, agents = log.scenario, dict[str, Instants]()
    for name, each in zip(scenario.agents, team, strict=True):
        agents[name] = Instants(
            vehicle=each.vehicle, times=times, position=each.position, quaternion=each.quaternion, joints=each.joints,
            around=around, patch=patch, name=name,
        )  # fmt: skip

    def draw(name: str, shared: bool) -> Scene:
        models = *scenario.own_components(scenario.agents[name]), *(scenario.shared_components if shared else ())
        return _scene(log.agents[name], models, replace(agents[name], agents=agents))

    for each, scene in zip(team, scenes_of(agents, draw), strict=True):
        yield replace(each, scene=scene)


def _error(log: Log, push: TipPush | None) -> Array:
    """Tip error (m) over time; during a commanded push, only its part perpendicular to the surface normal."""
    away = log.tip - log.tip_reference
    if push is not None:
        away = push.across(away, log.time, log.tip)
    return lengths(away)


def patch_about(tip: Array) -> float:
    """Half width (m) of the square drawn for an infinite plane, grown with the tip's displacement."""
    finite = tip[np.isfinite(tip).all(axis=1)]
    way = float(np.ptp(finite, axis=0).max()) if len(finite) else 0.0
    return PATCH + 0.5 * min(way, WIDEST)


def _scene(log: Log, components: Sequence[Component[Tree]], seen: Instants) -> Scene:
    """Surfaces, objects and contact forces at a film's frames, interpolated from a log."""

    def at_frames(name: str) -> Array:
        array = log.component(name)
        if name.endswith("quaternion") and array.size:
            array = np.concatenate([continuous(each) for each in np.split(array, array.shape[1] // 4, 1)], axis=1)
        return read(log.time, array, seen.times)

    scene, flying = scene_in_log(components, seen, at_frames), seen.times[:, None] < end_time(log)
    arrows = (replace(each, force=each.force * flying) for each in scene.arrows if np.any(each.force))
    return replace(scene, arrows=tuple(arrows))


def read(time: Array, values: Array, times: Array) -> Array:
    """Interpolate the columns of a time series (N, k) at other times; returns (F, k)."""
    columns = [np.interp(times, time, column) for column in values.T]
    return np.stack(columns, axis=1) if columns else np.zeros((len(times), 0))


def continuous(quaternion: Array) -> Array:
    """Flip signs of a quaternion series (N, 4) so that it is continuous, for interpolation."""
    same = np.einsum("ni,ni->n", quaternion[1:], quaternion[:-1]) >= 0.0
    sign = np.concatenate([[1.0], np.cumprod(np.where(same, 1.0, -1.0))])[: len(quaternion)]
    return doubles(quaternion * sign[:, None])


TRAIL = 4.0
"""Duration (s) of the tip's trail."""

TRAIL_PIECES = 80
"""Number of line segments of a trail."""

GHOST_OPACITY, ROTOR_OPACITY = 0.16, 0.45
GHOST: Color = (0.15, 0.2, 0.3)
DARK: Color = (0.16, 0.17, 0.2)
TIP: Color = (0.85, 0.12, 0.16)
POINT: Color = (0.95, 0.75, 0.1)
WHITE: Color = (1.0, 1.0, 1.0)
PATH: RGBA = (0.25, 0.28, 0.34, 0.55)
WIND: RGBA = (0.25, 0.55, 0.85, 0.9)

TOUCH: RGBA = (0.78, 0.1, 0.55, 0.95)
"""Colour of contact forces."""

TOUCH_PER_NEWTON, LONGEST_TOUCH = 0.12, 0.5
"""Length of a contact arrow: m per N, and largest (m)."""

THICK, THIN = 3.5, 2.0
"""Line widths (pixels at 720 lines) of a trail and of a desired path."""

LEAST_STEP = 0.004
"""Least length (m) of a trail's segment, so that a tip at rest costs nothing."""

ARROW_PER_NEWTON, ARROW_PER_SPEED, LONGEST_ARROW = 0.2, 0.08, 0.6
"""Length of wind arrows: m per N, m per m/s, and largest (m)."""

LEAST_FORCE, LEAST_SPEED = 0.02, 0.05
"""Least force (N) and air speed (m/s) that are drawn."""


@positional
class FilmMark:
    """Line or arrow between two world points, drawn in one frame of a film.

    Attributes:
        kind: "line" or "arrow". width: pixels of a line, m of an arrow's radius.
    """

    kind: str
    width: float
    start: Array
    end: Array
    rgba: RGBA


def trail(flight: FilmedFlight, times: Array, k: int, width: float) -> list[FilmMark]:
    """Make the fading trail of the tip's last seconds, as lines."""
    first = int(np.searchsorted(times, times[k] - TRAIL))
    # every so many frames of the film, not of the trail, so that a line stays where it was drawn once
    every = max(1, int(np.searchsorted(times, times[0] + TRAIL)) // TRAIL_PIECES)
    at = _thin_out(flight.tip[[*range(-(-first // every) * every, k, every), k]])
    share = np.linspace(0.15, 0.85, max(len(at) - 1, 1))
    return [
        FilmMark("line", width, a, b, (*flight.color, float(s)))
        for a, b, s in zip(at[:-1], at[1:], share, strict=False)
    ]


def desired_path(flight: FilmedFlight, width: float) -> list[FilmMark]:
    """Make the line of the desired tip path over a whole film."""
    at = _thin_out(flight.desired_tip[:: -(-len(flight.desired_tip) // (4 * TRAIL_PIECES))])
    return [FilmMark("line", width, a, b, PATH) for a, b in pairwise(at)]


def wind_arrow(flight: FilmedFlight, k: int, reach: float) -> list[FilmMark]:
    """Make an arrow along the wind near the vehicle, with a length by wind force or air speed, the longer one."""
    seen = [
        scale * each[k]
        for each, scale, least in (
            (flight.force, ARROW_PER_NEWTON, LEAST_FORCE),
            (flight.air, ARROW_PER_SPEED, LEAST_SPEED),
        )
        if np.linalg.norm(each[k]) > least
    ]
    length = max(seen, key=norm, default=np.zeros(3))
    size = norm(length)
    if not size:
        return []
    along = length / size
    end = flight.desired_position[k] - 1.6 * reach * along + np.array([0.0, 0.0, 0.8 * reach])
    return [FilmMark("arrow", 0.06 * reach, end - min(size, LONGEST_ARROW) * along, end, WIND)]


def touch_marks(flight: FilmedFlight, k: int, reach: float) -> list[FilmMark]:
    """Make arrows of all contact forces at frame k, each starting at its contact point."""
    marks = []
    for touch in flight.scene.arrows:
        size = norm(touch.force[k])
        if size > LEAST_FORCE:
            length = min(TOUCH_PER_NEWTON * size, LONGEST_TOUCH)
            end = touch.spot[k] + touch.force[k] * (length / size)
            marks.append(FilmMark("arrow", 0.045 * reach, touch.spot[k], end, TOUCH))
    return marks


def wind_words(flight: FilmedFlight, k: int) -> str:
    """Caption with the force on the base and the wind speed in a frame; empty if both are negligible."""
    force, speed = (norm(each[k]) for each in (flight.force, flight.air))
    words = [f"force {force:.1f} N"] if force > LEAST_FORCE else []
    return ", ".join([*words, *([f"wind {speed:.1f} m/s"] if speed > LEAST_SPEED else [])])


def _thin_out(places: Array) -> Array:
    """Thin out a path (F, 3) so that neighbouring points keep a minimum distance."""
    chosen = [places[0]]
    for place in places[1:]:
        if np.linalg.norm(place - chosen[-1]) > LEAST_STEP:
            chosen.append(place)
    return np.array(chosen)


def marks_of(flights: Flights, times: Array, reach: float, scale: float) -> Callable[[int], list[FilmMark]]:
    """Make a function that lists the lines and arrows of a film panel at a given frame."""
    still = desired_path(flights[0], THIN * scale)
    for flight in flights[1:]:
        if not np.allclose(flight.desired_tip, flights[0].desired_tip, atol=1e-6):
            still += desired_path(flight, THIN * scale)

    def at(k: int) -> list[FilmMark]:
        moving = [mark for flight in flights for mark in trail(flight, times, k, THICK * scale)]
        touching = [mark for flight in flights for mark in touch_marks(flight, k, reach)]
        drawn = [line for flight in flights for line in scene_lines(flight, k, THICK * scale)]
        blowing = [arrow for flight in flights for arrow in wind_arrow(flight, k, reach)]
        return [*still, *moving, *drawn, *touching, *blowing]

    return at


def vehicle_solids(flight: FilmedFlight) -> list[Solid]:
    """Make the solids of a flight in a film: vehicle in the flight's colour, payloads and surroundings."""
    own = _solids(flight, flight.position, flight.quaternion, flight.joints, ghost=False)
    around = (
        replace(each, rgba=each.rgba or role_color(each.shape.role, flight.color, ghost=False))
        for each in flight.scene.solids
    )
    return [*own, *around]


def scene_lines(flight: FilmedFlight, k: int, width: float) -> list[FilmMark]:
    """Make the lines of line-shaped objects, such as cables, in a film's frame k; hidden ones (NaN) are left out."""
    pieces = [(a, b, line.rgba) for line in flight.scene.lines for a, b in pairwise(line.places[k])]
    return [FilmMark("line", width, a, b, rgba) for a, b, rgba in pieces if np.isfinite([a, b]).all()]


def ghost_solids(flight: FilmedFlight) -> list[Solid]:
    """Make transparent solids of the vehicle in its desired pose: level base, joints on reference."""
    desired = flight.desired_position, flight.desired_quaternion, flight.desired_joints
    return _solids(flight, *desired, ghost=True)


def role_color(role: str, color: Color, *, ghost: bool) -> RGBA:
    """Colour of a shape by its role (hull, link, rotor, ...); ``color`` is that of the flight."""
    if ghost:
        return (*GHOST, GHOST_OPACITY)
    if role == "rotor":
        return (*_mix(color, WHITE, 0.45), ROTOR_OPACITY)
    own = {
        "hull": color,
        "link": _mix(color, WHITE, 0.25),
        "tip": TIP,
        "point": POINT,
        "payload": _mix(color, DARK, 0.5),
    }
    return (*own.get(role, DARK), 1.0)


def _solids(flight: FilmedFlight, position: Array, quaternion: Array, joints: Array, *, ghost: bool) -> list[Solid]:
    poses = body_poses(flight.vehicle, position, quaternion, joints)
    # nothing is wanted of the servos: the desired pose has them at rest
    turns = {} if ghost else rotor_turns(flight.vehicle, flight.tilts)
    solids = []
    for shape in (*vehicle_shapes(flight.vehicle), *(() if ghost else flight.scene.attached)):
        R, p = poses[shape.body]
        color = role_color(shape.role, flight.color, ghost=ghost)
        solids.append(Solid(shape, p + R @ np.array(shape.position), R @ shape_rotation(shape, turns), color))
    return solids


def _mix(a: Color, b: Color, share: float) -> Color:
    """Blend of two colours, with a ``share`` of the second."""
    red, green, blue = ((1.0 - share) * one + share * other for one, other in zip(a, b, strict=True))
    return (red, green, blue)
