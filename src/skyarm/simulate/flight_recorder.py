"""Flight recorder: table of the samples that a simulator logs, one row per control
period, and where a row has what.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from skyarm.records.arrays import Array
from skyarm.records.leaves import leaves, parts, rebuild
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
        rows = rows.copy() if kept else rows
        # columns in place of numbers: each field becomes an array over time
        columns = rebuild(self._sample, rows.T)
        return tuple(
            LoggedSamples(
                states=rows[:, span["state"]],
                commands=rows[:, span["command"]],
                measurement=own.measurement,
                readings=own.readings,
                wind=own.wind,
                found=rows[:, span["found"]],
                led=rows[:, span["led"]],
            )
            for own, span in zip(columns.agents, self._spans, strict=True)
        )

    @cached_property
    def reading_columns(self) -> dict[str, slice]:
        """Columns of each sensor's reading of the only vehicle in a row of the log, by
        the sensor's name.
        """
        return {name: _span(reading) for name, reading in self._places.agent.readings}

    @cached_property
    def joint_columns(self) -> slice:
        """Columns of the measured joint positions and rates of the only vehicle in a
        row of the log.
        """
        measured = self._places.agent.measurement
        return _span((measured.joints, measured.joint_rates))

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
            (rows[:, span["state"]], rows[:, span["command"]]) for span in self._spans
        ]

    @cached_property
    def _places(self) -> Sample:
        """Column of each number of a sample, in that number's place."""
        # floats, as an int would be structure
        return rebuild(self._sample, map(float, range(self.table.shape[1])))

    @cached_property
    def _spans(self) -> list[dict[str, slice]]:
        """Columns of the fields of each vehicle's sample, by field."""
        return [
            {name: _span(value) for name, value in parts(own).items()}
            for own in self._places.agents
        ]


def _span(places: object) -> slice:
    """Columns from the first to the last of a record of columns."""
    columns = leaves(places)
    return slice(int(columns[0]), int(columns[-1]) + 1) if columns else slice(0)
