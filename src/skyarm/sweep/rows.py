"""A chunk of episodes flown: the rows of its file."""

from __future__ import annotations

import io
from collections.abc import Mapping
from typing import Any

import numpy as np

from skyarm.simulate.batch import Batch
from skyarm.simulate.endings import STATUSES
from skyarm.sweep.design import values
from skyarm.sweep.plan import Plan
from skyarm.sweep.study import Study

MARK = b"skyarm"
"""Key of a file's metadata that holds whose rows they are."""


def arrow() -> Any:
    """The Parquet library.

    Raises:
        ValueError: it is not installed; names the extra that brings it.
    """
    try:
        import pyarrow as pa
    except ImportError:
        raise ValueError("pyarrow: is missing; rows need the extra 'sweep': pip install 'skyarm[sweep]'") from None
    return pa


def mark(plan: Plan, index: int) -> bytes:
    """Whose rows a chunk holds."""
    return f"{plan.digest}/{index}".encode()


def fly_chunk(plan: Plan, batches: Mapping[str, Batch], index: int, threads: int = 1) -> bytes:
    """Fly one chunk with every controller and return its Parquet file.

    The bytes depend on study and index only: not on threads, nor on what flew before.
    """
    pa = arrow()
    import pyarrow.parquet as pq

    study = plan.study
    episodes = np.arange(study.span(index).start, study.span(index).stop)
    drawn = values(study, episodes)
    tables = []
    for position, batch in enumerate(batches.values()):
        outcome = batch.fly(drawn, seed=study.seed, episodes=episodes, threads=threads)
        columns: dict[str, Any] = {
            "episode": episodes.astype(np.uint32),
            "controller": _words(pa, np.full(len(episodes), position), list(batches)),
            **{path: np.asarray(column, dtype=float) for path, column in drawn.items()},
            **{name: np.asarray(column, dtype=float) for name, column in outcome.metrics.items()},
            "status": _words(pa, _places(outcome.status), list(STATUSES)),
            "end_time": outcome.end_time,
        }
        tables.append(pa.table(columns))
    table = pa.concat_tables(tables).replace_schema_metadata({MARK: mark(plan, index)})
    sink = io.BytesIO()
    pq.write_table(table, sink, compression="zstd", use_dictionary=["controller", "status"])
    return sink.getvalue()


def _places(status: Any) -> Any:
    """Number of each status in ``STATUSES``."""
    return np.argmax([status == word for word in STATUSES], axis=0)


def _words(pa: Any, indices: Any, words: list[str]) -> Any:
    """A column of words, each stored once."""
    return pa.DictionaryArray.from_arrays(pa.array(indices, type=pa.int8()), pa.array(words))


def row_count(study: Study, index: int) -> int:
    """Rows of a chunk."""
    return len(study.span(index)) * len(study.scenarios)
