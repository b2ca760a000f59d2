"""Points and axes of envelopes, made up."""

from __future__ import annotations

from skyarm.studies.compare.envelope import point_of_plants


def point(error, *, lost=False, judged=None, largest=None):
    """A flight with a mean error in m."""
    status = "ground" if lost else "completed"
    numbers = {
        "judged": judged or error,
        "tip_mean": error,
        "tip_max": largest or 2.0 * error,
        "outside": 1.5,
        "tilt": 0.1,
        "jitter": 100.0 * error,
        "limited": 0.25 if error > 0.1 else 0.0,
    }
    return {**numbers, "status": status, "lost": lost}


def axis(values, unit="m/s", **laws):
    """An axis with points of laws."""
    facts = {"title": "a trial", "noisy": False, "judged": "tip, mean / largest", "window_s": [4.0, 20.0]}
    return {**facts, "values": list(values), "unit": unit, "laws": laws}


LOST = point(2.0, lost=True)

AXES_FLOWN = {
    "circle": axis(
        (1.0, 2.0, 3.0),
        paper_ct=[point(0.05), point(0.09), point(0.4)],
        l1_adaptive=[point(0.02), LOST, LOST],
        centroidal_tip=[point(0.001), point(0.095), point(0.5)],
    ),
    "turning_wind": axis(
        (20.0, 5.0),
        "s",
        paper_ct=[point(0.7), LOST],
        l1_adaptive=[point(0.7), point(0.6)],
        centroidal_tip=[point(0.009), LOST],
    ),
}


def plants(*flights):
    """A value of wrong plants."""
    return point_of_plants(flights)
