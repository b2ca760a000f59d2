"""Log of one flight: its arrays, derived quantities and files."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import MISSING, field, fields
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from skyarm.algebra import Quaternion
from skyarm.algebra.quaternion import euler_angles
from skyarm.dynamics.state import State
from skyarm.log.flown_scenario import Info, flown_scenario
from skyarm.log.log_columns import columns
from skyarm.log.log_tables import ArrowTable, DataFrame, log_frame, log_table
from skyarm.log.periods import (
    ContactPeriod,
    GraspPeriod,
    contact_periods,
    grasp_periods,
)
from skyarm.log.sensor_data import COMPONENTS, ESTIMATE, sources_of
from skyarm.log.stored_arrays import ArraysByName
from skyarm.records.arrays import Array
from skyarm.records.files import PathLike
from skyarm.records.immutable import LONGEST, immutable
from skyarm.records.leaves import parts
from skyarm.records.members import SOLE
from skyarm.records.notebook import notebook_html
from skyarm.records.registry import find
from skyarm.records.units import Unit, units

PICTURES = "skyarm.view.figures.flight_plot"
"""Module that draws a log's pictures, imported by name only when a picture is
requested."""

SHORTFALL = "skyarm.log.metrics.shortfall"
"""Module of the shortfall, imported likewise."""

EYES = "skyarm.simulate.eyes"
"""Module of the pictures of cameras, imported likewise."""

FORMATS = "log_format"
"""Registry kind of file formats, which read and write whole logs."""

HELD = "held reference"

CONTINUOUS = "continuous reference"


def _if_any() -> Array:
    """Dataclass field for an optional array of a log, empty by default."""
    return field(default_factory=lambda: np.zeros((0, 0)))


@immutable(slots=False)
class Log:
    """Log of a flight at N control instants, as arrays; SI units, radians, world axes
    by default.

    Attributes:
        time: (N,).
        position, velocity: (N, 3). quaternion: (N, 4) wxyz. rate: (N, 3) body axes.
        joints, joint_rates, efforts: (N, n); efforts are the commanded joint torques.
        rotor_speeds, rotor_commands: (N, rotors).
        position_held, velocity_held, joints_held, joint_rates_held, yaw_held: the
            reference as published and held.
        position_reference, joints_reference, yaw_reference: the continuous reference.
        tool: (N, 3) the tip. tool_held, tool_reference: where a level base on reference
            would put it. ``tip``, ``tip_held`` and ``tip_reference`` are the same
            arrays; files keep the first names.
        wind_force: (N, 3) of wind and forces on the base, with what the motion of the
            air changes of the drag of rotors and airframe. air_velocity: (N, 3) at the
            base origin.
        lag_found: (N, 2) s, estimated lags of the rotors' and the joints' loops beyond
            the law's nominal delay
            (:mod:`skyarm.control.laws.centroidal.lag_estimate`); without columns for a
            law that estimates none.
        load_mass_found, load_place_found: (N,) kg, (N, 3) m, of the load that the law
            learned: mass, and centre in the axes of the tip; empty for a law that
            learns none.
        push_found, push_deviation: (N, 3) N, (N,) N, of the force at the tip that the
            law estimates: world axes, and its standard error along the surface's
            normal; empty for a law without ``tolerances``.
        path_time: (N,) the reference's time, s, where it is planned apart from the
            flight's; ``time - path_time`` is its lag. Empty where it is not; of a task
            whose phases wait, the reference's own time, which is waited from.
        phase: (N,) number of the phase that is flown, one more than the last once all
            are done. Empty where no phase waits.
        tilts, tilt_commands: (N, tilting rotors) rad; without columns where no rotor
            tilts.
        measured_position, measured_joints: what the law received, noise and delay of
            the full state's sensor in it; without columns in a flight on an estimator,
            which has ``estimate`` in their place.
        received: arrays of ``readings``, ``estimate`` and components by name,
            ``readings.imu.rate``, ``estimate.position``, ``components.ARRAY``. Those of
            components are attributes, too (``log.ARRAY``): each declares its columns,
            with units and meanings.
        info: scenario, seeds, versions, status ("completed", "diverged", "joint_limit",
            "ground", "controller_undefined", "rotor_contact", "body_contact",
            "clearance", "phase_failed"), cause, end time; ``scenario_record`` is all
            that was flown as plain data, and ``digest`` its SHA-256: logs of one
            digest, and of the same versions, are of the same flight (:attr:`scenario`
            reads it back), but where ``commanded`` is true: commands from outside took
            the law's place, and no log keeps them. ``plugins`` were loaded; ``code``
            are the files of user code that flew, by name and SHA-256, which are part of
            the digest. ``phases`` are the kinds of the phases of a task that waits;
            ``received`` describes readings and estimate.
    """

    time: Annotated[Array, Unit("s", "time of the control instants")]
    position: Annotated[Array, units(State)["position"]]
    quaternion: Annotated[Array, units(State)["quaternion"]]
    velocity: Annotated[Array, units(State)["velocity"]]
    rate: Annotated[Array, units(State)["rate"]]
    joints: Annotated[Array, units(State)["joints"]]
    joint_rates: Annotated[Array, units(State)["joint_rates"]]
    efforts: Annotated[Array, Unit("N m or N", "commanded joint efforts")]
    rotor_speeds: Annotated[Array, units(State)["rotor_speeds"]]
    rotor_commands: Annotated[Array, Unit("rad/s", "commanded rotor speeds, unsigned")]
    position_held: Annotated[Array, Unit("m", f"{HELD}, world axes")]
    velocity_held: Annotated[Array, Unit("m/s", f"{HELD}, world axes")]
    joints_held: Annotated[Array, Unit("rad or m", HELD)]
    joint_rates_held: Annotated[Array, Unit("rad/s or m/s", HELD)]
    yaw_held: Annotated[Array, Unit("rad", HELD)]
    position_reference: Annotated[Array, Unit("m", f"{CONTINUOUS}, world axes")]
    joints_reference: Annotated[Array, Unit("rad or m", CONTINUOUS)]
    yaw_reference: Annotated[Array, Unit("rad", CONTINUOUS)]
    tool: Annotated[Array, Unit("m", "position of the tip, world axes")]
    tool_held: Annotated[
        Array, Unit("m", f"tip position if a level base were on the {HELD}, world axes")
    ]
    tool_reference: Annotated[
        Array,
        Unit("m", f"tip position if a level base were on the {CONTINUOUS}, world axes"),
    ]
    wind_force: Annotated[
        Array, Unit("N", "force of wind and disturbances on the base, world axes")
    ]
    air_velocity: Annotated[
        Array, Unit("m/s", "velocity of the air at the base origin, world axes")
    ]
    measured_position: Annotated[
        Array, Unit("m", "measured position of the base origin, world axes")
    ] = _if_any()
    measured_joints: Annotated[Array, Unit("rad or m", "measured joint positions")] = (
        _if_any()
    )
    lag_found: Annotated[
        Array, Unit("s", "lag that the law estimates in addition to its nominal delay")
    ] = _if_any()
    load_mass_found: Annotated[
        Array, Unit("kg", "mass of the load, estimated by the law")
    ] = _if_any()
    load_place_found: Annotated[
        Array,
        Unit("m", "centre of mass of the load, estimated by the law, axes of the tip"),
    ] = _if_any()
    push_found: Annotated[
        Array, Unit("N", "force at the tip, estimated by the law, world axes")
    ] = _if_any()
    push_deviation: Annotated[
        Array, Unit("N", "standard error of the estimated tip force along the normal")
    ] = _if_any()
    path_time: Annotated[Array, Unit("s", "path time of the governed reference")] = (
        _if_any()
    )
    phase: Annotated[
        Array,
        Unit(
            "",
            "index of the task's current phase, from 0; one past the last once all are"
            " done",
        ),
    ] = _if_any()
    tilts: Annotated[Array, units(State)["tilts"]] = _if_any()
    tilt_commands: Annotated[
        Array, Unit("rad", "commanded angles of the tilting rotors")
    ] = _if_any()
    received: Mapping[str, Array] = field(default_factory=dict)
    info: Info

    def __repr__(self) -> str:
        said = (
            f"{name}={self.info.get(name)!r}"
            for name in ("scenario", "controller", "status", "end_time")
        )
        return f"Log({', '.join(said)}, instants={self.time.size})"[:LONGEST]

    def __getitem__(self, array: str) -> Array:
        """Array of the log by its name."""
        return self.received[array] if array in self.received else getattr(self, array)

    def component(self, name: str) -> Array:
        """Array logged by a wind, force or contact model of the flight; (N, 0) if the
        flight has no such array.
        """
        array = self.received.get(f"{COMPONENTS}.{name}")
        return np.zeros((self.time.size, 0)) if array is None else array

    def __getattr__(self, name: str) -> Array:
        """Arrays logged by wind, force and contact models as attributes, such as
        ``log.contact_force``.
        """
        # dict first: __getattr__ is also called while a log is unpickled, before it has
        # fields
        stored: Mapping[str, Array] = self.__dict__.get("_stored", {})
        received: Mapping[str, Array] = self.__dict__.get("received", {})
        if name in stored:
            return stored[name]
        if name in IF_ANY:
            return np.zeros((0, 0))
        if f"{COMPONENTS}.{name}" not in received:
            raise AttributeError(
                f"log.{name}: must be an array of a log, or of a component of this"
                " flight"
            )
        return received[f"{COMPONENTS}.{name}"]

    @property
    def agents(self) -> Mapping[str, Log]:
        """Log of each vehicle of the flight by name; of one vehicle it is this log."""
        # a log of an older version names no vehicle, so its only one has the usual name
        named = (self.info.get("scenario_record") or {}).get("agents") or {SOLE: None}
        return {next(iter(named)): self}

    @property
    def readings(self) -> dict[str, dict[str, Array]]:
        """Sensor readings by sensor and field, (N,) or (N, k): the latest one received
        at each instant.
        """
        sensors: dict[str, dict[str, Array]] = {}
        for name, array in self.received.items():
            source, _, last = name.rpartition(".")
            if source not in (ESTIMATE, COMPONENTS):
                sensors.setdefault(source.partition(".")[2], {})[last] = array
        return sensors

    @property
    def estimate(self) -> dict[str, Array]:
        """Estimator output by field, (N,) or (N, k), as the control law received it."""
        begin = f"{ESTIMATE}."
        # by names, since arrays of a long flight are read from its file one by one
        return {
            name.removeprefix(begin): self.received[name]
            for name in self.received
            if name.startswith(begin)
        }

    @property
    def phase_ends(self) -> tuple[tuple[str, float | None], ...]:
        """Kind and completion time (s, or None) of each phase of a task."""
        ends = []
        phase = self.phase
        for number, name in enumerate(self.info.get("phases", ())):
            # half a number above: phases are stored as floats
            later = np.flatnonzero(phase > number + 0.5)
            ends.append((str(name), float(self.time[later[0]]) if later.size else None))
        return tuple(ends)

    @property
    def contact_periods(self) -> tuple[ContactPeriod, ...]:
        """Contact periods, each from a touch to the loss of contact, ordered by
        start.
        """
        return contact_periods(self)

    @property
    def grasp_periods(self) -> tuple[GraspPeriod, ...]:
        """Grasp periods, each from a grasp to its release, ordered by start."""
        return grasp_periods(self)

    @property
    def tip(self) -> Array:
        """Position (m, world axes) of the tip, (N, 3)."""
        return self.tool

    @property
    def tip_held(self) -> Array:
        """Position reference (m) of the tip, (N, 3), held constant between the
        reference's sampling instants.
        """
        return self.tool_held

    @property
    def tip_reference(self) -> Array:
        """Position reference (m) of the tip, (N, 3), continuous in time."""
        return self.tool_reference

    @property
    def shortfall(self) -> Any:
        """Actuators at their limits and references that the flight did not reach;
        ``lines`` are sentences on both.
        """
        return import_module(SHORTFALL).shortfall(self)

    def frames(self, sensor: str) -> Iterator[Any]:
        """Pictures of a camera or lidar, one at a time, computed from the logged poses.

        Args:
            sensor: name of the sensor, as ``wrist``, or ``left.wrist`` of several
                vehicles.

        Yields:
            :class:`skyarm.simulate.eyes.RangeImage`.

        Raises:
            ValueError: one line: no such sensor, a log of one of several vehicles, or
                as :attr:`scenario`; a law of its own may be unknown by now.
        """
        eyes = import_module(EYES).Eyes.of_log(self)
        frames: Iterator[Any] = eyes.frames(sensor, self)
        return frames

    @property
    def status(self) -> str:
        """Final status of the episode."""
        return str(self.info["status"])

    @property
    def scenario(self) -> Any:
        """Scenario of the flight, restored from the log.

        Raises:
            ValueError: one line: a log of a version that did not keep it, plugins that
                are not loaded, or a damaged log.
        """
        return self.scenario_with({})

    def scenario_with(self, replaced: Mapping[str, object]) -> Any:
        """Scenario of the flight with some entries of its file replaced, by key such as
        ``plant.kind``.

        Raises:
            ValueError: as :attr:`scenario`, a path that is no word, or a value that it
                cannot have.
        """
        return flown_scenario(self.info, replaced)

    @property
    def euler(self) -> Array:
        """Roll, pitch and yaw (rad), (N, 3), in the ZYX convention."""
        return np.stack(euler_angles(Quaternion(*self.quaternion.T).rotation()), axis=1)

    def plot(self, file: PathLike | None = None, **options: Any) -> Any:
        """Plot the flight over time, with the options of :func:`skyarm.plot`.

        Returns:
            a Matplotlib figure, which a notebook shows.

        Raises:
            ValueError: one line. OSError: the file cannot be written.
        """
        return import_module(PICTURES).plot(self, file, **options)

    def arrays(self) -> Mapping[str, Array]:
        """All arrays of the log by name; those in a file are read when they are
        accessed.
        """
        stored: Mapping[str, Array] | None = self.__dict__.get("_stored")
        if stored is not None:
            return stored
        # empty arrays have no columns and are left out of files
        absent = [name for name in IF_ANY if not getattr(self, name).size]
        own = {
            name: array
            for name, array in parts(self).items()
            if name not in ("info", "received", *absent)
        }
        return own | dict(self.received)

    def save_npz(self, path: PathLike) -> Path:
        """Write the log as a compressed npz file."""
        written: Path = find(FORMATS, "npz").write(self, path)
        return written

    def _rows(self, chosen: slice) -> Log:
        arrays = self.arrays()
        # a stored array reads only the rows, so that a long log need not fit into
        # memory
        read = (
            arrays.read
            if isinstance(arrays, ArraysByName)
            else lambda name, rows: arrays[name][rows]
        )
        return log_of_arrays({name: read(name, chosen) for name in arrays}, self.info)

    @property
    def units(self) -> Mapping[str, Unit]:
        """Unit, frame and meaning of every array and of every column of a wind, force
        or contact model, by name.
        """
        arrays, of_parts = self.arrays(), f"{COMPONENTS}."
        declared = {
            each.name: Unit(each.unit, each.meaning)
            for each in columns(self)
            if each.array.startswith(of_parts)
        }
        for source, of in sources_of(self.info).items():
            for name, each in of.fields.items():
                # columns of one array differ in unit where joints turn and slide
                unit = Unit(
                    " or ".join(dict.fromkeys(each.units or [each.unit])), each.meaning
                )
                # arrays of components are attributes of the log, too
                array = f"{source}.{name}"
                declared |= {
                    key: unit
                    for key in (array, array.removeprefix(of_parts))
                    if array in arrays
                }
        return declared | {
            name: unit for name, unit in units(Log).items() if name in arrays
        }

    def save_csv(self, path: PathLike) -> Path:
        """Write a CSV file: a column for each number, such as ``velocity_x [m/s]``, a
        row per control instant.
        """
        written: Path = find(FORMATS, "csv").write(self, path)
        return written

    def to_pandas(self) -> DataFrame:
        """Return a pandas DataFrame: the columns of the CSV file over ``time``, units
        in ``attrs["units"]``.

        Raises:
            ValueError: pandas is missing; one line that says how to install it.
        """
        return log_frame(self)

    def to_arrow(self) -> ArrowTable:
        """Return a pyarrow Table: the columns of the CSV file, ``unit`` and ``meaning``
        in each field's metadata.

        Raises:
            ValueError: pyarrow is missing; one line that says how to install it.
        """
        return log_table(self)

    def _repr_html_(self) -> str:
        return notebook_html(self)

    @classmethod
    def load_npz(cls, path: PathLike) -> Log:
        """Read a log from an npz file.

        Raises:
            OSError: the file cannot be read.
            ValueError: it is not such a log.
        """
        log: Log = find(FORMATS, "npz").read(path)
        return log


IF_ANY = tuple(
    each.name
    for each in fields(Log)
    if each.default_factory is not MISSING and each.name != "received"
)
"""Arrays that not every flight has; without values they are left out of files and have
no columns."""


def rows_of(log: Log, chosen: slice) -> Log:
    """Return a log with only the selected control instants of another log."""
    return log._rows(chosen)


PIECE = 5_000
"""Number of control instants that are written or counted at a time."""


def log_of_arrays(arrays: Mapping[str, Array], info: Info) -> Log:
    """Make a log from its arrays by name, as :meth:`Log.arrays` returns them."""
    others = [name for name in arrays if "." in name]
    if not isinstance(arrays, ArraysByName):
        own = {name: array for name, array in arrays.items() if name not in others}
        return Log(**own, received={name: arrays[name] for name in others}, info=info)
    # without __init__: arrays of a file are read when they are first used
    log = object.__new__(Log)
    named = [
        name
        for name in units(Log)
        if name in arrays and (name not in IF_ANY or arrays[name].size)
    ]
    stored, received = (
        ArraysByName(names, arrays.read) for names in ([*named, *others], others)
    )
    log.__dict__.update(received=received, info=info, _stored=stored)
    return log
