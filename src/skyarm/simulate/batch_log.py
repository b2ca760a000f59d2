"""Log of a batch of parallel episodes, at every k-th control instant."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from typing import Any

import numpy as np

from skyarm.algebra import Scalar
from skyarm.dynamics import State
from skyarm.dynamics.actuators import Command
from skyarm.log.sensor_data import ESTIMATE
from skyarm.records.arrays import AnyArray as Array
from skyarm.records.immutable import immutable
from skyarm.records.leaves import Record, leaves, mismatch, rebuild
from skyarm.reference import Reference
from skyarm.sensing.measurement import Measurement


@immutable
class Logged:
    """Quantities of one episode that a batch logs at a control instant: state, command,
    reference and readings.

    ``received`` are the sensors' readings and the estimate, name and record of each, as
    in :mod:`skyarm.log.sensor_data`; empty without sensors beside the full state.
    """

    alive: Scalar
    state: State
    command: Command
    reference: Reference
    received: tuple[tuple[str, Any], ...] = ()


@immutable
class BatchLog:
    """Log of a batch: arrays (episodes, samples) of states, commands and references.

    Attributes:
        time: (samples,), s. alive: (lanes, samples), bool.
        state, command, reference: records whose scalars are (lanes, samples); what is
            structure in them stays so.
        readings: sensor -> record of its newest reading that has arrived. estimate:
            measurement that the law received from an estimator; None without one. NaN
            where a leg of the flight has none of it.
    """

    time: Array
    alive: Array
    state: State
    command: Command
    reference: Reference
    readings: Mapping[str, Any] = field(default_factory=dict)
    estimate: Measurement | None = None


LoggedRows = tuple[tuple[Logged, ...], Array]
"""Logged record of each vehicle, and their rows, (samples, leaves, lanes)."""


def batch_logs(legs: Sequence[LoggedRows], time: Array) -> list[BatchLog]:
    """Make the log of each vehicle of a batch from the samples that compiled code
    wrote.

    Args:
        legs: logged record of each vehicle, and their rows, (samples, leaves, lanes),
            of each part of the flight.
        time: (samples,), s.
    """
    each_leg = []
    for examples, rows in legs:
        ends = np.cumsum([len(leaves(each)) for each in examples])
        # rows may be padded
        each_leg.append([*zip(examples, np.split(rows, ends, axis=1), strict=False)])
    return [_log_of_agent(own, time) for own in zip(*each_leg, strict=True)]


def _log_of_agent(legs: Sequence[tuple[Logged, Array]], time: Array) -> BatchLog:
    """Log of one vehicle of a batch, from its record and rows of each part of the
    flight.
    """
    parts = [_by_episode(example, rows) for example, rows in legs]
    alive = [np.asarray(each.alive) for each in parts]
    shapes = [each.shape for each in alive]
    records = {
        name: _concatenate([getattr(each, name) for each in parts], shapes)
        for name in ("state", "command", "reference")
    }
    names = dict.fromkeys(name for each in parts for name, _ in each.received)
    received = {
        name: _concatenate([dict(each.received).get(name) for each in parts], shapes)
        for name in names
    }
    return BatchLog(
        time=time,
        alive=np.concatenate(alive, axis=1),
        **records,
        estimate=received.pop(ESTIMATE, None),
        readings={name.partition(".")[2]: record for name, record in received.items()},
    )


def _by_episode(example: Logged, rows: Array) -> Logged:
    """Convert samples of a batch to a dataclass of arrays (episodes, samples), NaN
    after an episode's end.
    """
    # episodes first, as users index; in one block, as each column becomes an array
    columns = np.ascontiguousarray(rows.transpose(1, 2, 0))
    whole = rebuild(example, columns)
    alive = np.asarray(whole.alive) > 0.5
    # a lane that ended keeps its last state, which would look like a flight
    columns[:, ~alive] = np.nan
    return replace(whole, alive=alive)


def _concatenate(
    records: Sequence[Record | None], shapes: Sequence[tuple[int, ...]]
) -> Record:
    """Join logged segments along time; a segment whose fields differ from those of the
    last one becomes NaN.
    """
    # the last: a flight ends with the sensors that its scenario then has
    example = next(each for each in reversed(records) if each is not None)
    count = len(leaves(example))
    columns = []
    for each, shape in zip(records, shapes, strict=True):
        # a leg before a change may have had other sensors: their numbers are no match
        fits = each is not None and mismatch(example, each, "record") is None
        columns.append(leaves(each) if fits else [np.full(shape, np.nan)] * count)
    joined = (
        np.concatenate(parts, axis=1) if len(parts) > 1 else parts[0]
        for parts in zip(*columns, strict=True)
    )
    return rebuild(example, joined)
