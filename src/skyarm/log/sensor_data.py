"""Sensor readings and estimator output as arrays of a log, with their units and
meanings.

``readings.imu.rate`` is the field ``rate`` of the reading of sensor ``imu``,
``estimate.position`` a field of the measurement that an estimator gave the law. Names,
units and axes come from the records themselves: a sensor of a user needs no line here.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict

import numpy as np

from skyarm.algebra import Quaternion, Vec3
from skyarm.log.flown_scenario import Info
from skyarm.records.arrays import Array, doubles
from skyarm.records.immutable import positional
from skyarm.records.leaves import Tree, is_record, parts, walk
from skyarm.records.units import Unit, units

READINGS, ESTIMATE = "readings", "estimate"

COMPONENTS = "components"
"""Source name of the arrays that components declare."""

DESCRIPTION = "received"
"""Key of a log's description with its sources of received data."""

BARE = "value"
"""Field of a reading that is a number or a tuple of numbers."""


@positional
class LoggedField:
    """Field of a sensor reading or estimate: unit, meaning and column labels.

    Attributes:
        unit: SI; empty for pure numbers. meaning: in words.
        axes: endings of its columns; None for one number an instant.
        units: unit of each column, where they differ.
    """

    unit: str
    meaning: str
    axes: list[str] | None
    units: list[str] | None = None


@positional
class Source:
    """Sensor or estimator with logged readings: fields, interval, delay and frame.

    Attributes:
        fields: fields of its record, by name.
        every: control periods from one reading to the next. late: control periods of a
            reading's delay.
        frame: frame of the vehicle at which a force is read, in its axes; None for any
            other sensor.
        mount: place (m) and roll, pitch, yaw (rad) of a sensor beside the base origin,
            in the base; None at it.
    """

    fields: dict[str, LoggedField]
    every: int = 1
    late: int = 0
    frame: str | None = None
    mount: list[float] | None = None

    @property
    def plain(self) -> Info:
        """Convert the description of a sensor or estimator to plain data for a log
        file.
        """
        return {
            name: value
            for name, value in asdict(self).items()
            if name != "mount" or value
        }


def fields_of(record: Tree, count: int) -> Iterator[tuple[str, LoggedField, Array]]:
    """Yield name, description and values over time, (N,) or (N, k), of each field of a
    sensor reading.

    Args:
        record: record whose scalars are columns (N,), or numbers that stand for every
            instant.
        count: number of instants, N.
    """
    # vectors are records with axes of their own, not of fields
    whole = is_record(record) and not isinstance(record, (Vec3, Quaternion))
    said = units(type(record)) if whole else {}
    for name, value in (parts(record) if whole else {BARE: record}).items():
        numbers = [
            (place, each)
            for place, each in walk(value)
            if not isinstance(each, (str, bool, type(None)))
        ]
        if not numbers:
            # a field of texts has no columns
            continue
        table = np.stack(
            [np.broadcast_to(doubles(each), (count,)) for _, each in numbers], axis=1
        )
        single = numbers[0][0] == ()
        unit = said.get(name, Unit())
        axes = None if single else ["_".join(place) for place, _ in numbers]
        yield (
            name,
            LoggedField(unit.unit, unit.meaning, axes),
            table[:, 0] if single else table,
        )


def sources_of(info: Info) -> dict[str, Source]:
    """Read the sensors, estimator and environment models that a log stores, by name.

    Raises:
        ValueError: one line: a damaged description.
    """
    try:
        sources = {
            name: Source(
                {key: LoggedField(**field) for key, field in each["fields"].items()},
                each["every"],
                each["late"],
                each["frame"],
                each.get("mount"),
            )
            for name, each in info.get(DESCRIPTION, {}).items()
        }
        sound = all(map(_has_valid_types, sources.values()))
    except (AttributeError, KeyError, TypeError):
        sound = False
    if not sound:
        raise ValueError(
            f"{DESCRIPTION}: must be what skyarm writes of sensors and estimate"
        )
    return sources


def _has_valid_types(source: Source) -> bool:
    """True if a sensor's description from a log file has valid types."""
    counts = all(
        type(each) is int and each >= 0 for each in (source.every - 1, source.late)
    )
    fields = source.fields.values()
    lists = [each.axes for each in fields] + [each.units for each in fields]
    axes = [each for each in lists if each is not None]
    filled = all(isinstance(each, list) and each for each in axes)
    texts = [] if source.frame is None else [source.frame]
    texts += [text for each in fields for text in (each.unit, each.meaning)]
    texts += [axis for each in axes for axis in each]
    # a place is written as six floats; other types belong to a damaged description
    mount = source.mount is None or [type(each) for each in source.mount] == [float] * 6
    return counts and filled and mount and all(isinstance(each, str) for each in texts)
