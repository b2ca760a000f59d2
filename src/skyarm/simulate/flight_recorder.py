"""Flight recorder: table of the samples that a simulator logs, one row per control
period, and where a row has what.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from skyarm.records.arrays import Array
from skyarm.records.leaves import leaves, rebuild
from skyarm.simulate.assemble_log import LoggedSamples
from skyarm.simulate.loop_state import Sample


class FlightRecorder:
    """Logged samples of consecutive control periods in memory, which machine code
    writes row by row.

    Args:
        sample: what is logged of one control instant, as an example. periods: rows of
            the table.

    Attributes:
        table: (periods, numbers). first: number of the control period of its first row.
    """

    def __init__(self, sample: Sample, periods: int) -> None:
        self._sample = sample
        self.first = 0
        # takes memory as it is written
        self.table: Array = np.empty((periods, len(leaves(sample))))

    def samples(
        self, start: int, stop: int, *, kept: bool = False
    ) -> tuple[LoggedSamples, ...]:
        """Logged samples of each vehicle in control periods ``start`` to ``stop``, as
        views of the log if not kept.
        """
        rows = self.table[start - self.first : stop - self.first]
        samples = list[LoggedSamples]()
        rows = rows.copy() if kept else rows
        # columns in place of numbers: each field becomes an array over time
        columns = rebuild(self._sample, iter(rows.T))
        for own, (first, command, measured, found, led, end) in zip(
            columns.agents, self._marks, strict=True
        ):
            samples.append(
                LoggedSamples(
                    states=rows[:, first:command],
                    commands=rows[:, command:measured],
                    measurement=own.measurement,
                    readings=own.readings,
                    wind=own.wind,
                    found=rows[:, found:led],
                    led=rows[:, led:end],
                )
            )
        return tuple(samples)

    @cached_property
    def reading_columns(self) -> dict[str, slice]:
        """Columns of each sensor's reading of the only vehicle in a row of the log, by
        the sensor's name.
        """
        sample = self._sample.agent
        places = dict[str, slice]()
        begin = self._marks[0][2] + len(leaves(sample.measurement))
        for name, reading in sample.readings:
            places[name] = slice(begin, begin := begin + len(leaves(reading)))
        return places

    @cached_property
    def joint_columns(self) -> slice:
        """Columns of the measured joint positions and rates of the only vehicle in a
        row of the log.
        """
        measured = self._sample.agent.measurement
        before = (
            measured.time,
            measured.position,
            measured.quaternion,
            measured.velocity,
            measured.rate,
            measured.specific_force,
        )
        begin = self._marks[0][2] + len(leaves(before))
        return slice(begin, begin + len(measured.joints) + len(measured.joint_rates))

    def row(self, tick: int) -> Array:
        """Logged row of a control period that has been flown: alive, state, command,
        measurement, readings.
        """
        row: Array = self.table[tick - self.first]
        return row

    def states_and_commands(self, start: int, stop: int) -> list[tuple[Array, Array]]:
        """Logged states and commands of each vehicle, of periods ``start`` to ``stop``
        as views.
        """
        rows = self.table[start - self.first : stop - self.first]
        return [
            (rows[:, first:command], rows[:, command:measured])
            for first, command, measured, *_ in self._marks
        ]

    @cached_property
    def _marks(self) -> list[list[int]]:
        """Columns of a logged sample at which each vehicle's state, command,
        measurement and later parts begin.
        """
        marks = list[list[int]]()
        begin = len(leaves(self._sample.alive))
        for own in self._sample.agents:
            # in the order of AgentSample's fields, which is that of a row
            later = (own.measurement, own.readings, own.wind)
            sizes = [
                len(leaves(part))
                for part in (own.state, own.command, later, own.found, own.led)
            ]
            marks.append([begin, *(begin + int(end) for end in np.cumsum(sizes))])
            begin = marks[-1][-1]
        return marks
