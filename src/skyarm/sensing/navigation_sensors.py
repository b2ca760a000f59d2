"""Navigation sensors of an autopilot: magnetometer, barometer and satellite navigation
with velocity.

Units are those of data sheets and autopilots: gauss, hPa, degrees Celsius. World axes
are x north, y west, z up.

Sources: ICAO Doc 7488/3, 1993 (standard atmosphere: temperature, pressure and
geopotential height in the troposphere); World Magnetic Model 2020 (the default field:
0.215 gauss horizontal and 0.430 gauss down in Zurich, the default place of common
autopilot simulators, whose rounded 0.427 gauss stands here, with the declination taken
as zero).
"""

from __future__ import annotations

from typing import Annotated, ClassVar

from skyarm.algebra import Scalar, Vec3
from skyarm.algebra.scalars import data, divide, exp, log, minimum
from skyarm.dynamics.state import BaseVelocity, State
from skyarm.records.immutable import immutable
from skyarm.records.units import Unit
from skyarm.sensing.channel import Channel, ChannelSensor, Quantities, SampleRate
from skyarm.sensing.sensor import BasePosition
from skyarm.sensing.sensor_kinds import Reading

SEA_LEVEL_TEMPERATURE = 288.15
"""Temperature (K) of the standard atmosphere at sea level."""

SEA_LEVEL_PRESSURE = 1013.25
"""Pressure (hPa) of the standard atmosphere at sea level."""

LAPSE_RATE = 0.0065
"""Decrease of the temperature with the geopotential height in the troposphere (K/m)."""

PRESSURE_EXPONENT = 9.80665 / (287.05287 * LAPSE_RATE)
"""Power of the temperature ratio: gravity (m/s^2) by gas constant of air (J/(kg K)) and
lapse rate, 5.2559."""

EARTH_RADIUS = 6356766.0
"""Nominal Earth radius (m) that relates geopotential to geometric heights."""

TROPOPAUSE = 11000.0
"""Geopotential height (m) of the tropopause."""

KELVIN = 273.15
"""Temperature (K) of 0 degrees Celsius."""


@immutable
class MagnetometerReading(Reading):
    """Reading of a magnetometer: magnetic flux density."""

    field: Annotated[Vec3, Unit("gauss", "magnetic field, base axes")]


@immutable
class BarometerReading(Reading):
    """Reading of a barometer: static pressure and temperature of the air."""

    pressure: Annotated[Scalar, Unit("hPa", "static pressure of the air")]
    temperature: Annotated[Scalar, Unit("degC", "temperature of the air")]


@immutable
class GnssReading(Reading):
    """Reading of satellite navigation: position and velocity of the base origin."""

    position: BasePosition
    velocity: BaseVelocity


@immutable
class Magnetometer(ChannelSensor):
    """Magnetometer: the uniform magnetic field of the Earth in base axes, gauss.

    The bias of ``field`` is hard iron: a field of the vehicle itself, constant in base
    axes.

    Attributes:
        north, west, up: components of the Earth's field along the world axes x, y, z.
        field: errors, base axes.
    """

    record: ClassVar[type] = MagnetometerReading

    frequency: SampleRate = 50.0
    north: Annotated[
        Scalar, Unit("gauss", "component of the Earth's field along the world x axis")
    ] = 0.215
    west: Annotated[
        Scalar, Unit("gauss", "component of the Earth's field along the world y axis")
    ] = 0.0
    up: Annotated[
        Scalar, Unit("gauss", "component of the Earth's field along the world z axis")
    ] = -0.427
    field: Channel = Channel(sigma=0.005)

    def quantities(self, state: State, specific_force: Vec3) -> Quantities:
        """Magnetic field in base axes: name, error model and true components."""
        field_W = Vec3(data(self.north), data(self.west), data(self.up))
        return self.channels(field=state.rotation.apply_T(field_W))


@immutable
class Barometer(ChannelSensor):
    """Barometer: static pressure (hPa) and temperature (degC) of the standard
    atmosphere at the base origin.

    Attributes:
        altitude: height of the world's origin above mean sea level; the default is that
            of Zurich.
        pressure: errors; the default noise is that of a height of 0.1 m near sea level.
        temperature: errors.
    """

    record: ClassVar[type] = BarometerReading

    frequency: SampleRate = 50.0
    altitude: Annotated[
        Scalar,
        Unit(
            "m",
            "altitude of the world's origin above mean sea level",
            # the range of the standard's tables, below the tropopause
            low=-5000.0,
            high=11000.0,
        ),
    ] = 488.0
    pressure: Channel = Channel(sigma=0.012)
    temperature: Channel = Channel()

    def quantities(self, state: State, specific_force: Vec3) -> Quantities:
        """Pressure and temperature of the air: name, error model and true value of
        each.
        """
        pressure, temperature = standard_air(self.altitude + state.position.z)
        return self.channels(pressure=(pressure,), temperature=(temperature,))


@immutable
class Gnss(ChannelSensor):
    """Satellite navigation with velocity: position (m) and velocity (m/s) of the base
    origin, world axes.
    """

    record: ClassVar[type] = GnssReading

    frequency: SampleRate = 10.0
    position: Channel = Channel(sigma=0.02)
    velocity: Channel = Channel(sigma=0.05)

    def quantities(self, state: State, specific_force: Vec3) -> Quantities:
        """Base position and velocity: name, error model and true components of each."""
        return self.channels(position=state.position, velocity=state.velocity)


def standard_air(altitude: Scalar) -> tuple[Scalar, Scalar]:
    """Static pressure (hPa) and temperature (degC) of the standard atmosphere (ICAO Doc
    7488) in the troposphere.

    Args:
        altitude: geometric height above mean sea level, m; -5000 to about 11 000. Above
            the tropopause both values remain those of the tropopause.
    """
    geopotential = minimum(
        divide(altitude * EARTH_RADIUS, altitude + EARTH_RADIUS), TROPOPAUSE
    )
    temperature = SEA_LEVEL_TEMPERATURE - geopotential * LAPSE_RATE
    # scalars have no power; below the tropopause the temperature is far above 0 K
    ratio = exp(log(temperature * (1.0 / SEA_LEVEL_TEMPERATURE)) * PRESSURE_EXPONENT)
    return ratio * SEA_LEVEL_PRESSURE, temperature - KELVIN
