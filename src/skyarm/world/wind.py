"""Wind models: independent force and air velocity (RotorS), or moving air that causes
drag.

In a file the wind has a mode, and further air a kind, of the same names and words::

    [environment.wind]
    mode = "force_wind"  # newtons and metres per second apart, as RotorS's plugin
    force = [2, 0, 0]                  # N, world axes (default 0)
    point = [0, 0, 0]  # m, where it acts on the base (default: its origin)
    air_velocity = [2, 0, 0]           # m/s that the rotors feel (default 0)
    # or a list of gusts, which add up
    gust = { force = [2, 0, 0], start = 7.5, duration = 3 }

    [environment.wind]
    mode = "moving_air"                  # air velocity; forces follow from drag
    velocity = [5, 0, 0]               # m/s, world axes (default 0)
    # or "step", the default
    gust = { velocity = [0, 3, 0], start = 5, duration = 2, shape = "one_minus_cosine" }
    turbulence = { altitude = 6, wind_20ft = 7.7 }   # Dryden; minimum_airspeed (1 m/s)

    [environment.wind]
    mode = "none"

The turbulence's u axis lies along the horizontal mean wind (world x in calm air).
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import replace
from typing import Annotated, Any, ClassVar, Self

from skyarm.algebra import E_X, ZERO3, Scalar, Scalars, Vec3
from skyarm.algebra.scalars.philox import normals
from skyarm.dynamics.point_motion import PointMotion
from skyarm.dynamics.state import State
from skyarm.records.coerce import absent
from skyarm.records.field_rules import accept_fields, checked
from skyarm.records.files import Fields
from skyarm.records.immutable import field_if_any, immutable, positional
from skyarm.records.leaves import Place
from skyarm.records.read_table import record_entry, record_from, registered_from
from skyarm.records.registry import names
from skyarm.records.units import Unit
from skyarm.records.words import Word
from skyarm.world import dryden
from skyarm.world.component import (
    Air,
    Component,
    Event,
    Force,
    Memory,
    NoMemory,
    Wrench,
)
from skyarm.world.dryden import HIGHEST, LOWEST, Dryden, DrydenMemory
from skyarm.world.gust import SHAPES, Gust


@positional
class WindSample(Component[NoMemory]):
    """Force, air velocity and logged numbers of all environment models at one instant
    of a flight.

    Attributes:
        force_W: force on the base, world axes, N.
        point_B: point of the base where it acts, base frame, m.
        air_velocity_W: velocity of the air that rotors and body drag see, world axes,
            m/s.
        numbers: numbers of all components for the log, in the order of their
            ``columns``.
    """

    force_W: Vec3 = ZERO3
    point_B: Vec3 = ZERO3
    air_velocity_W: Vec3 = ZERO3
    numbers: Scalars = ()

    def velocity(self, memory: NoMemory, t: Scalar, position_W: Vec3) -> Vec3:
        """Constant air velocity, m/s, world axes."""
        return self.air_velocity_W

    def wrenches(
        self,
        memory: NoMemory,
        t: Scalar,
        motion: PointMotion,
        rotor_speeds: Sequence[Scalar],
    ) -> Sequence[Wrench]:
        """Wrench of the constant force on the base."""
        return (Wrench(force_W=self.force_W, point=self.point_B),)


WindValue = Gust | tuple[Gust, ...] | Dryden | None
"""Value of a wind's field with a short spelling in a table: a gust, several gusts,
turbulence or none."""


class GustyWind(Component[Memory]):
    """Base class of wind models with gusts."""

    __slots__ = ()

    gust: Gust | None
    gusts: tuple[Gust, ...]

    blows: ClassVar[str]
    """Key in a file for the peak of a gust."""

    @classmethod
    def short_spellings(cls, fields: Fields) -> dict[str, WindValue]:
        """Read the gusts of a wind's TOML table, in which ``force`` or ``velocity`` is
        an alias of ``peak``.
        """
        return cls.gusts_from(fields)

    @classmethod
    def gusts_from(cls, fields: Fields) -> dict[str, WindValue]:
        """Read the field ``gust`` of a wind's TOML table: one gust, or a list of gusts
        that add up.
        """
        entry = fields.take("gust", None)
        at = fields.at("gust")
        if isinstance(entry, list):
            return {
                "gusts": tuple(
                    cls._gust(each, f"{at}[{i}]") for i, each in enumerate(entry)
                ),
                "gust": None,
            }
        return {} if entry is None else {"gust": cls._gust(entry, at), "gusts": ()}

    def to_entry(self) -> dict[str, Any]:
        """Table of the wind for a scenario file, with the peak of each gust named
        ``force`` or ``velocity``.

        Raises:
            TypeError: both a gust and gusts, which a file has one word for.
        """
        if self.gust is not None and self.gusts:
            raise TypeError(
                "gust and gusts: must not be stated both; the same wind has all of them"
                " in gusts"
            )
        table: dict[str, Any] = record_entry(self)
        table.pop("gust", None)
        gusts = [
            {
                self.blows: list(each.peak),
                "start": each.start,
                "duration": each.duration,
                "shape": each.shape,
            }
            for each in self.all_gusts
        ]
        if gusts:
            # a list stays a list, even of one, so that a file comes back as it was
            table["gust"] = gusts if self.gust is None else gusts[0]
        return table

    @classmethod
    def _gust(cls, entry: object, where: str) -> Gust:
        """Read one gust of a wind table, whose peak is named ``force`` or ``velocity``
        by the wind, or ``peak``.
        """
        fields = Fields(entry, where)
        if "peak" in fields.table:
            return record_from(Gust, fields)
        # a force has only steps, as the plugin of RotorS
        shapes = SHAPES if cls.blows == "velocity" else SHAPES[:1]
        peak = fields.vector(cls.blows)
        start = fields.number("start")
        duration = fields.number("duration", low=0.0, strict=True)
        shape = fields.choice("shape", shapes, SHAPES[0])
        fields.done()
        try:
            return Gust(peak=peak, start=start, duration=duration, shape=shape)  # type: ignore[arg-type]  # zeros fold
        except ValueError as error:
            words = str(error).removeprefix("gust.")
            raise ValueError(fields.at(words.replace("peak", cls.blows, 1))) from None

    @property
    def all_gusts(self) -> tuple[Gust, ...]:
        """All gusts of the wind."""
        return self.gusts if self.gust is None else (self.gust, *self.gusts)

    @property
    def events(self) -> tuple[Event, ...]:  # type: ignore[override]
        """Time intervals of the gusts, for pictures of a flight."""
        blowing = (gust for gust in self.all_gusts if any(map(float, gust.peak)))
        return tuple(
            ("gust", float(gust.start), float(gust.start + gust.duration))
            for gust in blowing
        )


@immutable
class ForceWind(GustyWind[NoMemory], Force[NoMemory]):
    """Wind as a force on the base and an independent air velocity, like the wind plugin
    of RotorS.

    A gust is an additional force, a step; it never changes the velocity of the air.
    Several add up.

    Source: RotorS, gazebo_wind_plugin.cpp lines 137-177.
    """

    force_W: Annotated[
        Vec3,
        Unit("N", "mean force on the base, world axes", folds=True, usual=500.0),
        Word("force"),
    ] = ZERO3
    point_B: Annotated[
        Vec3,
        Unit("m", "point at which mean and gust force act, base axes", folds=True),
        Word("point"),
    ] = ZERO3
    air_velocity_W: Annotated[
        Vec3,
        Unit(
            "m/s",
            "constant air velocity for the drag of rotors and airframe, world axes",
            folds=True,
            usual=60.0,
        ),
        Word("air_velocity"),
    ] = ZERO3
    gust: Gust | None = None
    gusts: Annotated[tuple[Gust, ...], Word("gust")] = field_if_any(default=())
    agent: Annotated[
        str,
        Unit("", "name of the only vehicle on which the force acts; empty for each"),
    ] = field_if_any(default="")

    blows: ClassVar[str] = "force"

    def __post_init__(self) -> None:
        accept_fields(self, "wind")
        for gust in self.all_gusts:
            if gust.shape != "step":
                raise ValueError(
                    f"gust.shape = {gust.shape!r}: a gust of force is a 'step' as in"
                    " RotorS"
                )

    def velocity(self, memory: NoMemory, t: Scalar, position_W: Vec3) -> Vec3:
        """Constant air velocity at the rotors, world axes, m/s."""
        return self.air_velocity_W

    def wrenches(
        self,
        memory: NoMemory,
        t: Scalar,
        motion: PointMotion,
        rotor_speeds: Sequence[Scalar],
    ) -> Sequence[Wrench]:
        """Wind force of mean and gusts on the base."""
        force = self.force_W
        for gust in self.all_gusts:
            force = force + gust.at(t)
        return (Wrench(force_W=force, point=self.point_B, agent=self.agent),)


Turbulence = DrydenMemory | NoMemory
"""Internal state of moving air; () for smooth air."""


@immutable
@checked("wind")
class MovingAir(GustyWind[Turbulence], Air[Turbulence]):
    """Wind as an air velocity, which acts on the vehicle only through rotor drag and
    body drag.

    Attributes:
        gust: additional air velocity. gusts: further gusts, which add up.
        turbulence: parameters of the Dryden model; None for smooth air.
    """

    velocity_W: Annotated[
        Vec3,
        Unit("m/s", "mean velocity of the air, world axes", folds=True, usual=60.0),
        Word("velocity"),
    ] = ZERO3
    gust: Gust | None = None
    turbulence: Dryden | None = None
    gusts: Annotated[tuple[Gust, ...], Word("gust")] = field_if_any(default=())

    blows: ClassVar[str] = "velocity"

    @classmethod
    def short_spellings(cls, fields: Fields) -> dict[str, WindValue]:
        """Read gusts, and turbulence given by altitude and wind speed, from a wind
        table of a scenario file.
        """
        values = cls.gusts_from(fields)
        table = fields.table.get("turbulence")
        # a table with an intensity is that of the record itself
        if isinstance(table, dict) and (
            "intensity" not in table or "altitude" in table
        ):
            word = "velocity_W" if "velocity_W" in fields.table else "velocity"
            inner = Fields(fields.take("turbulence"), fields.at("turbulence"))
            values["turbulence"] = low_turbulence(
                inner, fields.vector(word, (0.0, 0.0, 0.0))
            )
        return values

    def with_followers(self, replaced: Collection[Place]) -> Self:
        """Wind whose turbulence of an altitude has airspeed and direction of the
        replaced mean velocity.
        """
        followed = self.turbulence
        places = {place[:2] for place in replaced}
        stated = {
            ("turbulence", each)
            for each in ("airspeed", "direction_W", "least_airspeed")
        }
        moved = any(place[0] == "velocity_W" for place in places)
        # turbulence of an altitude has a least airspeed
        if (
            followed is None
            or not moved
            or absent(followed.least_airspeed)
            or places & stated
        ):
            return self
        return replace(self, turbulence=followed.in_wind(self.velocity_W))

    @property
    def uniforms(self) -> int:
        """Number of uniform random numbers that the turbulence draws per control
        period.
        """
        # three normal numbers of a step, made of two pairs of uniform ones
        return 0 if self.turbulence is None else 4

    def start(self, period: float, draws: Sequence[Scalar]) -> Turbulence:
        """Initial turbulence state, drawn from its stationary distribution; an empty
        tuple in smooth air.
        """
        if self.turbulence is None:
            return ()
        numbers = normals(draws)
        return dryden.start(
            # the fourth number of each four is left over from its pair
            Vec3(*numbers[0:3]),
            Vec3(*numbers[4:7]),
            period,
            par=self.turbulence,
        )

    def advance(
        self,
        memory: Turbulence,
        t: Scalar,
        dt: float,
        state: State,
        draws: Sequence[Scalar],
    ) -> Turbulence:
        """Turbulence state in the next control period."""
        if self.turbulence is None or not memory:
            return memory
        return dryden.step(memory, Vec3(*normals(draws)[:3]), dt, par=self.turbulence)[
            0
        ]

    def velocity(self, memory: Turbulence, t: Scalar, position_W: Vec3) -> Vec3:
        """Air velocity (m/s, world axes): mean wind, gusts and turbulence."""
        velocity = self.velocity_W
        for gust in self.all_gusts:
            velocity = velocity + gust.at(t)
        return (
            velocity
            if self.turbulence is None or not memory
            else velocity + dryden.velocity(memory, par=self.turbulence)
        )


def low_turbulence(fields: Fields, velocity: Sequence[float]) -> Dryden:
    """Dryden turbulence from a table of altitude (m), wind at 20 ft and minimum
    airspeed, in a mean wind (m/s).
    """
    altitude = fields.number("altitude", low=LOWEST)
    if altitude > HIGHEST:
        raise ValueError(
            f"{fields.at('altitude')} = {altitude!r}: must be at most {HIGHEST:g} m"
            " (1000 ft)"
        )
    wind_20ft = fields.number("wind_20ft", low=0.0)
    minimum = fields.number("minimum_airspeed", 1.0, low=0.0, strict=True)
    fields.done()
    x, y, z = velocity
    horizontal = math.hypot(x, y)
    # wind that is vertical, or none, has no heading: x is a choice
    direction = Vec3(x / horizontal, y / horizontal, 0) if horizontal > 0.0 else E_X
    return dryden.low_altitude(
        altitude, wind_20ft, math.hypot(x, y, z), direction, minimum
    )


def wind_from(table: object, where: str) -> Component[Any]:
    """Read the wind from the table ``[environment.wind]`` of a scenario file; ``mode``
    selects the wind model.

    Exact zeros of its vectors are structure and fold away.

    Args:
        table: table as read from TOML.
        where: path of the table, put before the field in messages.

    Raises:
        ValueError: one line with field, value and what is allowed.
    """
    fields = Fields(table, where)
    if fields.choice("mode", ("none", *names("force"), *names("air"))) == "none":
        fields.done()
        return NO_WIND
    return registered_from(
        "air force", Component, table, where, word="mode", folds=True
    )


Wind = ForceWind | MovingAir

NO_WIND = MovingAir()
"""Calm air: every component is a structural zero and folds away."""
