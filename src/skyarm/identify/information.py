"""Information of a measured flight: how accurately an identification could find each
parameter of a vehicle.

Some of its windows are fitted. Their information, times the number of all windows over
theirs, gives with what is known before the interval that the whole search would give
(Fisher information; Ljung, System Identification, 1999, 13.3). A number whose interval
a flight hardly narrows is not excited.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from skyarm.flight_data.flight_data import FlightData
from skyarm.identify.identified_numbers import SHOWN, identified_numbers
from skyarm.identify.identify_windows import first_fits, search_of
from skyarm.identify.windows import ClockedWindows
from skyarm.records.files import shipped_tables
from skyarm.records.immutable import immutable
from skyarm.vehicle import Vehicle

NOT_EXCITED = "not in this flight"
"""Text for a parameter on which a flight gives less than half of the information."""

TITLES: Mapping[str, str] = shipped_tables(__file__)
"""Parameter -> its readable name."""


@immutable
class ExpectedNumber:
    """Accuracy that a flight allows for a parameter of a vehicle.

    Attributes:
        name: name in a vehicle file or in the surroundings.
        unit: SI.
        start: value of the start vehicle.
        half_width: half width of the expected 95 % interval, in the unit.
        relative: half width of a positive number over the number; else 0.
        data_share: share of its information that the flight gives, 0 to 1.
    """

    name: str
    unit: str
    start: float
    half_width: float
    relative: float
    data_share: float

    @property
    def is_excited(self) -> bool:
        """True if the flight gives at least half of the information about the
        parameter.
        """
        return self.data_share >= SHOWN

    @property
    def title(self) -> str:
        """Readable name of the parameter."""
        return TITLES.get(self.name, self.name)

    @property
    def width(self) -> str:
        """Text of the half width of the expected interval, or that this flight does not
        narrow it.
        """
        if not self.is_excited:
            return NOT_EXCITED
        if self.relative:
            return f"± {100.0 * self.relative:.2g} %"
        return f"± {self.half_width:.2g} {self.unit}".rstrip()

    @property
    def verdict(self) -> str:
        """Text: excited with the expected accuracy, or not excited in this flight."""
        return f"excited ({self.width})" if self.is_excited else NOT_EXCITED


def expected_numbers(
    flights: Sequence[FlightData], start: Vehicle
) -> tuple[ExpectedNumber, ...]:
    """Accuracy that flights allow for each parameter of a vehicle, by the Fisher
    information of some windows.

    It takes about a third of the time of
    :func:`skyarm.identify.identify_windows.identify_by_windows`.

    Raises:
        ValueError: one line: flights that do not fit the vehicle, or nothing to
            identify, or SciPy is missing.
    """
    search = search_of(flights, start)
    some, near = first_fits(search)
    whole = ClockedWindows(search.flights, search.start, search.whole)
    # some windows tell of all: information grows with their number
    fit = near.of_more(whole.count / some.windows.count)
    logarithmic = {each.name for each in search.unknowns if each.positive}
    scale = search.scale(fit)
    positive = {
        each.name for each in scale.reported if logarithmic.intersection(each.parts)
    }
    numbers = []
    unseen = search.hidden_lags()
    for each in identified_numbers(fit, scale, search.sample)[0]:
        # half width of its logarithm, in which it is searched, thus relative
        share = 0.5 * math.log(each.high / each.low) if each.name in positive else 0.0
        numbers.append(
            ExpectedNumber(
                name=each.name,
                unit=each.unit,
                start=each.start,
                half_width=(
                    share * each.start if share else 0.5 * (each.high - each.low)
                ),
                relative=share,
                data_share=0.0 if each.name in unseen else each.data_share,
            )
        )
    return tuple(numbers)
