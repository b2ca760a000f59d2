"""Performance envelope of controllers, and its tables: one trial parameter at a time is
increased until the crash.

A law flies an axis as one batch where the axis' values are data of one scenario, value
by value where they are not.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from skyarm.control.controller import ControllerError
from skyarm.log.metrics.windows import Window, Windows
from skyarm.records.arrays import Columns
from skyarm.records.immutable import immutable
from skyarm.scenario.controller_table import controller_by_name
from skyarm.scenario.scenario_record import Scenario
from skyarm.studies.compare.cell_flights import (
    JITTER,
    LIMITED,
    ONE_BY_ONE,
    Cell,
    Document,
    Record,
    TrialFlights,
)
from skyarm.studies.compare.entrants import TUNED, Entrant
from skyarm.studies.compare.envelope_axes import (
    AXES,
    OUTSIDE,
    OVERSHOOT,
    PLANTS,
    TIP,
    TIP_MAX,
    EnvelopeAxis,
    axis_words,
    plants_at,
)
from skyarm.studies.compare.run_suite import DPI, Pngs, Refused, Suite
from skyarm.studies.compare.suite import Case, Condition
from skyarm.studies.trial.facts import DURATION, PAPER, TrialSetting, setting_of
from skyarm.studies.trial.table import refusals, report_of
from skyarm.view.figures.comparison_figures import envelope_figure
from skyarm.view.figures.style import image_bytes
from skyarm.view.pages import DASH, Report, Section, image, number, table_of

ENVELOPE = "envelope-suite"

LAWS = ("paper_pd", "paper_ct", "l1_adaptive", "centroidal_tip")
"""Default laws; nmpc takes a quarter of an hour more (--laws nmpc)."""

TUNED_LAWS = tuple(TUNED.get(law, law) for law in LAWS)
"""Default laws on other vehicles than the paper's."""

QUICK = 10.0
"""Duration (s) of a trial with --quick."""


@immutable(slots=False)
class AxisFlights(TrialFlights):
    """Flights of one controller in a trial at increasing difficulty, all with the same
    noise.
    """

    trial: EnvelopeAxis

    further_metrics = (OVERSHOOT, OUTSIDE)
    same_noise = True

    @property
    def label(self) -> str:
        """File name of the stored results; includes the axis value if the flights have
        only one.
        """
        return super().label + (f"_{self.points[0]:g}" if len(self.points) == 1 else "")

    def scenario(self) -> Scenario:
        """Scenario of the envelope trial at its easiest value, or at the only value to
        be simulated.
        """
        value = self.trial.of(self.setting)[0] if self.trial.numbers else self.points[0]
        built = replace(
            self.trial.scenario(self.setting, value),
            seed=self.seed,
            name=self.case.name,
        )
        return built.with_controller(controller_by_name(built, self.entrant.law))

    def values(self, scenario: Scenario) -> Columns:
        """Parameters that vary along the difficulty axis: parameter path -> values
        (flights,).
        """
        if not self.trial.plants:
            return self.numbers(1)
        count = self.episodes(scenario) // len(self.points)
        drawn = [
            plants_at(self.setting, scenario, value, count, seed=self.seed)
            for value in self.points
        ]
        return {
            path: np.concatenate([each[path] for each in drawn]) for path in drawn[0]
        }

    def episodes(self, scenario: Scenario) -> int:
        """Number of flights: one per axis value, or several perturbed plants per
        value.
        """
        if not self.trial.plants:
            return len(self.points)
        return len(self.points) * (
            min(PLANTS, ONE_BY_ONE) if self.alone(scenario) else PLANTS
        )


def axis_flights(
    law: str,
    axis: EnvelopeAxis,
    setting: TrialSetting,
    *,
    seed: int = 0,
    plant: str = "rigid_body",
) -> list[AxisFlights]:
    """Flights of a controller along one difficulty axis: one batch if possible, else
    one entry per value.

    Args:
        law: preset or law.
        axis: axis with the values that fly.
        setting: vehicle and duration.
        seed: seed of the noise.
        plant: kind of simulated plant.

    Raises:
        ControllerError: the law does not fit the vehicle.
    """
    points = axis.of(setting)
    inside = Window(axis.start, setting.duration)
    whole = AxisFlights(
        # the paper's gains fit no other vehicle
        entrant=Entrant(name=law, law=TUNED.get(law, law) if axis.vehicle else law),
        case=Case(name=axis.name, windows=Windows(steady=inside, gust=inside)),
        condition=Condition(
            name="noisy" if axis.noisy else "perfect", noisy=axis.noisy
        ),
        plant=plant,
        seed=seed,
        trial=axis,
        setting=setting,
        points=points,
    )
    if (axis.plants or axis.numbers) and not whole.alone(whole.scenario()):
        return [whole]
    return [replace(whole, points=(value,)) for value in points]


@immutable
class Envelope(Suite[AxisFlights]):
    """Benchmark that measures the performance envelope of several controllers.

    Attributes:
        laws: presets or laws, in order. axes: names. vehicle: name or file. seed: seed
            of the noise.
        plant: kind of plant.
        quick: the first and the last value of each axis only, in flights of 10 s.
    """

    laws: tuple[str, ...] = LAWS
    axes: tuple[str, ...] = tuple(AXES)
    vehicle: str = PAPER
    seed: int = 0
    plant: str = "rigid_body"
    quick: bool = False

    name, file, folder = ENVELOPE, "envelope", "out/envelope"
    settings = ("vehicle", "seed", "plant", "quick")

    @property
    def setting(self) -> TrialSetting:
        """Hover scenario of the vehicle, with the scales of its envelope trials."""
        return setting_of(self.vehicle, QUICK if self.quick else DURATION, self.plant)

    def setting_of_axis(self, name: str) -> TrialSetting:
        """Hover scenario for a difficulty axis: of the envelope's vehicle, or of a
        vehicle that the axis prescribes.
        """
        return setting_of(
            AXES[name].vehicle or self.vehicle, self.setting.duration, self.plant
        )

    @property
    def flyable_axes(self) -> tuple[str, ...]:
        """Names of flyable difficulty axes; those that prescribe a vehicle only for
        that of Barakou et al. 2026.
        """
        servos = bool(self.setting.truth.drives)
        return tuple(
            name
            for name in self.axes
            if not (servos and AXES[name].torques)
            and (self.vehicle == PAPER or not AXES[name].vehicle)
        )

    def axis(self, name: str) -> EnvelopeAxis:
        """Difficulty axis by name, with only the values to be simulated."""
        axis = AXES[name]
        return (
            # the easiest and the hardest value
            replace(axis, values=(axis.values[0], axis.values[-1]))
            if self.quick
            else axis
        )

    def plan_cells(self) -> tuple[list[AxisFlights], Refused]:
        """All flights of the envelope, and reasons why a controller is excluded."""
        cells: list[AxisFlights] = []
        refused: dict[str, str] = {}
        for law in self.laws:
            for name in self.flyable_axes:
                axis, setting = self.axis(name), self.setting_of_axis(name)
                try:
                    cells += axis_flights(
                        law, axis, setting, seed=self.seed, plant=self.plant
                    )
                except ControllerError as error:
                    if axis.vehicle:  # the law may fly the others
                        refused[f"{law} on {axis.vehicle}"] = str(error)
                        continue
                    refused[law] = str(error)
                    # it flies none of the envelope's vehicle: cells planned before are
                    # dropped
                    cells = [each for each in cells if each.entrant.name != law]
                    break
        return cells, refused

    def judge(
        self, flown: Sequence[tuple[AxisFlights, Cell]], refused: Refused
    ) -> Document:
        """Evaluate the envelope: errors of every controller at every value of every
        difficulty axis.
        """
        axes: Document = {
            name: axis_record(self.axis(name), self.setting_of_axis(name))
            for name in self.flyable_axes
        }
        for flights, cell in flown:
            points = points_of(cell, flights.trial, len(flights.points))
            axes[flights.case.name]["laws"].setdefault(flights.entrant.name, []).extend(
                points
            )
        laws = [law for law in self.laws if law not in refused]
        return {"laws": laws, "not_flown": dict(refused), "axes": axes}

    def pictures(self, found: Record) -> dict[str, bytes]:
        """Pictures of the envelope report by file name: errors along all difficulty
        axes.
        """
        panels = {axis_words(name): axis for name, axis in found["axes"].items()}
        return {
            "envelope.png": image_bytes(envelope_figure(panels, found["laws"]), dpi=DPI)
        }

    def report(self, found: Record, pictures: Pngs = None) -> Report:
        """Envelope report: a summary, and a table for each difficulty axis."""
        return envelope_report(found, (pictures or {}).get("envelope.png"))


LEVELS = (0.010, 0.100)
"""Tip errors (m) by which an axis is rated: the largest level with an error below the
first shows where a law is accurate, below the second where it is still usable."""

MEASURED = {
    "tip_mean": TIP,
    "tip_max": TIP_MAX,
    "outside": OUTSIDE,
    "tilt": "tilt_max",
    "jitter": JITTER,
    "limited": LIMITED,
}
"""Key of a point -> metric in m, s, rad, rad/s or as a fraction."""

NEAR = 0.020
"""Tip error (m) below which a plant counts as held throughout its window; the
comparison's success criterion."""

OF_PLANTS = (
    f"plants that keep the tip within {1e3 * NEAR:g} mm, tip of all: median of means /"
    " largest"
)
"""Description of that count, for an axis of perturbed plants."""

JUDGED = {
    TIP: "tip, mean / largest",
    OVERSHOOT: "overshoot of the base; time with the tip over 5 cm away",
}
"""Metric -> description of an axis' numbers."""


def points_of(
    cell: Cell, axis: EnvelopeAxis, values: int | None = None
) -> list[Document]:
    """Results along a difficulty axis as plain data: errors in m, tilt in rad, status,
    crashed or not.

    Of an axis of plants one for each of so many ``values``.
    """
    lanes = _lanes(cell, axis)
    if not axis.plants:
        return lanes
    count = len(lanes) // (values or 1)
    return [point_of_plants(lanes[k : k + count]) for k in range(0, len(lanes), count)]


def _lanes(cell: Cell, axis: EnvelopeAxis) -> list[Document]:
    lanes = []
    for k, status in enumerate(cell.status):
        numbers = {
            name: _finite(cell.metrics[metric][k])
            for name, metric in (("judged", axis.metric), *MEASURED.items())
        }
        # no error is known of a flight that ended before its window
        lost = not cell.tracked_to_end[k] or numbers["judged"] is None
        lanes.append({**numbers, "status": str(status), "lost": bool(lost)})
    return lanes


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def point_of_plants(flights: Sequence[Record]) -> Document:
    """Combine the results of all perturbed plants at one axis value into one result.

    It is judged by the largest mean error of the plants that fly to their end, and lost
    where one plant is. Its mean is the median of the plants' means, all else the
    largest of theirs. ``plants`` has them one by one.
    """
    flown = [each for each in flights if not each["lost"]]
    point: Document = {
        key: _over(flown, key, max)
        for key in ("judged", "tip_max", "outside", "jitter", "limited")
    }
    point |= {
        "tip_mean": _over(flown, "tip_mean", np.median),
        "tilt": _over(flights, "tilt", max),
    }
    gone = [each["status"] for each in flights if each["lost"]]
    near = sum(each["tip_max"] <= NEAR for each in flown)
    counts = {"of": len(flights), "held": near, "lost": len(gone)}
    each = [{"judged": one["judged"], "lost": one["lost"]} for one in flights]
    return {
        **point,
        "status": gone[0] if gone else "completed",
        "lost": bool(gone),
        "plants": {**counts, "each": each},
    }


def _over(
    flights: Sequence[Record], key: str, how: Callable[[list[float]], float]
) -> float | None:
    numbers = [each[key] for each in flights if each[key] is not None]
    return float(how(numbers)) if numbers else None


def axis_record(axis: EnvelopeAxis, setting: TrialSetting) -> Document:
    """Description of a difficulty axis as plain data, without results; values in
    display units.
    """
    return {
        "title": axis.title,
        "unit": axis.unit,
        # products such as 0.07 * 100 have digits that nobody stated
        "values": [float(f"{value * axis.shown:.6g}") for value in axis.of(setting)],
        "judged": OF_PLANTS if axis.plants else JUDGED[axis.metric],
        "noisy": axis.noisy,
        "window_s": [axis.start, setting.duration],
        "laws": {},
    }


def within(points: Sequence[Record], level: float) -> int:
    """Number of consecutive difficulties, from the easiest, at which a controller's
    error stays below a level (m).
    """
    count = 0
    for point in points:
        if point["lost"] or point["judged"] > level:
            break
        count += 1
    return count


def lost_at(points: Sequence[Record]) -> list[int]:
    """Indices of the difficulty values at which the vehicle crashes or diverges."""
    return [k for k, point in enumerate(points) if point["lost"]]


LOST = "lost"
COMMANDS = (
    "Rotor jitter (RMS change of a command per period), rad/s; periods with a rotor at"
    " its limit"
)
CAPTION = (
    "Error of every law along every axis, mm. A cross in the band at the top is a law"
    " that is lost there"
)

MEANING = (
    "Errors are distances of the tip from where a level base on its reference would"
    " carry it: mean / largest, mm; of steps the base's overshoot. A law is lost where"
    " its flight ended early, tilted by over 80 degrees or was, in the mean over its"
    " last 5 s, over 0.5 m off. After the semicolon the largest jitter of its other"
    " flights (RMS change of a rotor command per period, rad/s), and the largest share"
    " of periods with a rotor at its limit."
)

HOW = (
    "Trials of {seconds}; motions grow from rest between 2 and 5 s. Perfect state, or"
    " where an axis is noisy 1 mm, 1 cm/s, 2 mrad, 0.01 rad/s, joints 1 mrad, and"
    " measurements 5 ms old, of which laws that can are told. Another vehicle than the"
    " paper's is given forces and loads by its weight, accelerations by its thrust"
    " margin where that is smaller, and swings of the arm by its joints' limits."
)


def envelope_report(found: Record, picture: bytes | None = None) -> Report:
    """Build the envelope report: a summary, and a table for each difficulty axis."""
    axes, laws = found["axes"], found["laws"]
    seconds = " and ".join(
        f"{each:g} s"
        for each in sorted({axis["window_s"][1] for axis in axes.values()})
    )
    counted = [
        f"{len(each)} {one if len(each) == 1 else many}"
        for each, one, many in ((laws, "law", "laws"), (axes, "axis", "axes"))
    ]
    return report_of(
        f"The envelope of {found['vehicle']}",
        f"{', '.join(counted)}, seed {found['seed']}, plant {found['plant']}",
        [
            summary_section(found, picture),
            *(
                Section(
                    title=axis_title(name, axis),
                    remark=(
                        HOW.format(seconds=seconds) if name == next(iter(axes)) else ""
                    ),
                    tables=[
                        table_of(axis_head(axis), axis_rows(axis)),
                        table_of(axis_head(axis), command_rows(axis), title=COMMANDS),
                    ],
                )
                for name, axis in axes.items()
            ),
        ],
    )


def summary_section(found: Record, picture: bytes | None = None) -> Section:
    """Report section with the range of every difficulty axis that each controller
    tolerates.
    """
    axes, laws = found["axes"], found["laws"]
    levels = " / ".join(f"{1e3 * level:g}" for level in LEVELS)
    return Section(
        name="How far each law is good",
        notes=[MEANING, *refusals(found)],
        pictures=image(CAPTION, CAPTION, picture, wide=True) if picture else "",
        tables=[
            table_of([f"within {levels} mm up to", *laws], summary_rows(axes, laws))
        ],
    )


def cell_text(point: Record, judged: str) -> str:
    """Table text of an envelope result: mean and largest error, mm, or overshoot, mm;
    or "lost".

    Of perturbed plants how many keep the tip and how many are lost, the median of their
    means and the largest error.
    """
    if "plants" in point:
        plants = point["plants"]
        parts = [f"{plants['held']} of {plants['of']}"]
        parts += [f"{plants['lost']} lost"] if plants["lost"] else []
        if plants["lost"] < plants["of"]:
            parts.append(
                f"{number(point['tip_mean'], 1e3)} / {number(point['tip_max'], 1e3)}"
            )
        return "; ".join(parts)
    if point["lost"]:
        return LOST
    if judged == JUDGED[TIP]:
        return f"{number(point['judged'], 1e3)} / {number(point['tip_max'], 1e3)}"
    return f"{number(point['judged'], 1e3)}; {number(point['outside'])} s"


def axis_head(axis: Record) -> list[str]:
    """Column headings of a difficulty axis' table: controller, then values with their
    unit.
    """
    return ["law", *(f"{value:g} {axis['unit']}" for value in axis["values"])]


def axis_rows(axis: Record) -> list[list[str]]:
    """Rows of a difficulty axis' table of errors, one per controller."""
    return [
        [law, *(cell_text(point, axis["judged"]) for point in points)]
        for law, points in axis["laws"].items()
    ]


def command_rows(axis: Record) -> list[list[str]]:
    """Rows of a difficulty axis' table of rotor jitter and saturation, one per
    controller.
    """
    return [[law, *map(command_text, points)] for law, points in axis["laws"].items()]


def command_text(point: Record) -> str:
    """Table text of rotor jitter (rad/s) and periods at a limit (%); the largest of
    perturbed plants.
    """
    if point["jitter"] is None or (point["lost"] and "plants" not in point):
        return LOST
    return f"{number(point['jitter'])}; {number(point['limited'], 1e2)} %"


def axis_title(name: str, axis: Record) -> str:
    """Section title of a difficulty axis: its name, its trial, whether sensors are
    noisy, and the error metric.
    """
    return (
        f"{axis_words(name)}: {axis['title']}{', with noise' if axis['noisy'] else ''}"
        f" ({axis['judged']}, mm)"
    )


def reach_text(axis: Record, points: Sequence[Record]) -> str:
    """Text with the axis values up to which a controller's error stays low, and where
    it crashes.

    Then the largest rotor jitter where it flies, rad/s, and the largest share of
    periods with a rotor at its limit.
    """
    values = axis["values"]
    gone = lost_at(points)
    counts = [within(points, level) for level in LEVELS]
    good = " / ".join(f"{values[count - 1]:g}" if count else DASH for count in counts)
    if gone:
        last = len(gone) > 1 and gone[0] + len(gone) == len(values)
        good += (
            f", lost from {values[gone[0]]:g}"
            if last
            else f", lost at {', '.join(f'{values[k]:g}' for k in gone)}"
        )
    flown = [point for point in points if not point["lost"]]
    if not flown:
        return good
    jitter, limited = (
        max(point[key] or 0.0 for point in flown) for key in ("jitter", "limited")
    )
    return f"{good}; {jitter:.2g}" + (f", {100.0 * limited:.2g} %" if limited else "")


def summary_rows(axes: Record, laws: Sequence[str]) -> list[list[str]]:
    """Rows of the envelope's summary: range of each difficulty axis, and how far each
    controller gets.
    """
    rows = []
    for name, axis in axes.items():
        values, unit = axis["values"], axis["unit"]
        span = f"{values[0]:g} to {values[-1]:g} {unit}"
        cells = [
            reach_text(axis, axis["laws"][law]) if law in axis["laws"] else DASH
            for law in laws
        ]
        rows.append([f"{axis_words(name)}, {span}", *cells])
    return rows
