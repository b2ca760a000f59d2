"""Studies: small sweeps, cells of comparisons, points of envelopes.

- Small studies for the tests of the sweep room.
- Cells of a comparison flown here, in no folder.
- Points and axes of envelopes, made up.
"""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

import numpy as np

from skyarm.studies.compare.cell_flights import Cell, CellFlights
from skyarm.studies.compare.envelope import point_of_plants
from skyarm.studies.flights import Work
from skyarm.studies.flights.fly import fly
from skyarm.studies.sweep import Study, run_sweep, study_from

MASS, WIND = "plant.vehicle.base.mass", "environment.wind.force_W.x"


def document(**fields: Any) -> dict[str, Any]:
    """A study of short flights in which some crash; keywords replace its fields, None
    takes one out.
    """
    small: dict[str, Any] = {
        "schema": 1,
        "name": "small",
        "scenario": "case3_wind",
        "controllers": ["paper_ct", "paper_pd"],
        "duration": 1.0,
        "episodes": 50,
        "chunk": 16,
        "seed": 3,
        "windows": {"steady": [0.2, 1.0], "transient": [0.0, 0.3]},
        "vary": {
            MASS: {"uniform": [0.4, 6.0]},
            WIND: {"normal": [1.0, 0.5]},
            "sensors.position": {"uniform": [0.0, 0.01]},
        },
    }
    return {key: value for key, value in (small | fields).items() if value is not None}


def small_study(**fields: Any) -> Study:
    return study_from(document(**fields))


Columns = dict[str, np.ndarray]


def flown(folder: Path, threads: int = 1, **fields: Any) -> dict[str, Columns]:
    """Rows of a small study: controller -> column -> values in the order of the
    episodes.
    """
    run_sweep(small_study(**fields), folder, workers=threads)
    return read(folder)


def read(folder: Path) -> dict[str, Columns]:
    """Rows of a folder, read without the package."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    tables = [pq.read_table(path) for path in sorted((folder / "rows").iterdir())]
    data = pa.concat_tables(
        [table.replace_schema_metadata(None) for table in tables]
    ).to_pydict()
    whole = {name: np.array(values) for name, values in data.items()}
    found = {}
    for controller in dict.fromkeys(data["controller"]):
        kept = np.flatnonzero(whole["controller"] == controller)
        kept = kept[np.argsort(whole["episode"][kept])]
        found[controller] = {name: values[kept] for name, values in whole.items()}
    return found


def same(a: Columns, b: Columns) -> bool:
    """Equal to the bit; NaN where the other is NaN."""
    return list(a) == list(b) and all(
        np.array_equal(a[name], b[name], equal_nan=a[name].dtype.kind == "f")
        for name in a
    )


def rows_file(folder: Path, chunk: int, controller: str = "paper_ct") -> Path:
    """File of the rows of one chunk with one controller."""
    (path,) = (folder / "rows").glob(f"chunk_{chunk:07d}.{controller}.*.parquet")
    return path


def drop_chunk(folder: Path, chunk: int) -> None:
    """Remove the rows of a chunk with every controller."""
    files = [*(folder / "rows").glob(f"chunk_{chunk:07d}.*.parquet")]
    assert files
    for file in files:
        file.unlink()


def write_manifest(folder: Path, table: dict[str, Any]) -> None:
    """Write a changed manifest of a sweep with the digest that it needs."""
    facts = {name: value for name, value in table.items() if name != "sha256"}
    digest = hashlib.sha256(json.dumps(facts, sort_keys=True).encode()).hexdigest()
    (folder / "manifest.json").write_text(json.dumps({**facts, "sha256": digest}))


def files_of(folder: Path) -> dict[str, bytes]:
    """Every file of a folder, hidden ones too, by its path."""
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def cell_of(flown: CellFlights | Work) -> Cell:
    """What a comparison judges of some flights."""
    work = flown.work() if isinstance(flown, CellFlights) else flown
    return Cell.of_rows(work, fly(work))


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
    facts = {
        "title": "a trial",
        "noisy": False,
        "judged": "tip, mean / largest",
        "window_s": [4.0, 20.0],
    }
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
