"""A chunk of episodes flown: the rows of its file."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from skyarm.files import needs_extra
from skyarm.simulate.batch import Batch
from skyarm.sweep.design import values
from skyarm.sweep.origin import Origin
from skyarm.sweep.plan import Plan
from skyarm.sweep.seal import sealed


def arrow() -> Any:
    """The Parquet library.

    Raises:
        ValueError: it is not installed; names the extra that brings it.
    """
    try:
        import pyarrow as pa
    except ImportError:
        raise ValueError(f"pyarrow: is missing; {needs_extra('sweep')}") from None
    return pa


def fly_chunk(plan: Plan, batches: Mapping[str, Batch], index: int, threads: int = 1) -> bytes:
    """Fly one chunk with every controller and return its Parquet file.

    The bytes depend on study and index only: not on threads, nor on what flew before.
    """
    pa = arrow()
    study = plan.study
    episodes = np.arange(study.span(index).start, study.span(index).stop)
    drawn = values(study, episodes)
    tables = []
    for position, batch in enumerate(batches.values()):
        outcome = batch.fly(
            {path: drawn[path] for path in study.paths}, seed=study.seed, episodes=episodes, threads=threads
        )
        columns: dict[str, Any] = {
            "episode": episodes.astype(np.uint32),
            "controller": _words(pa, np.full(len(episodes), position), list(batches)),
            **{path: np.asarray(column, dtype=float) for path, column in drawn.items()},
            **{name: np.asarray(column, dtype=float) for name, column in outcome.metrics.items()},
            "status": _words(pa, _places(outcome.status, plan.origin.statuses), list(plan.origin.statuses)),
            "end_time": outcome.end_time,
        }
        tables.append(pa.table(columns))
    return chunk_file(pa.concat_tables(tables), plan.origin, index)


def chunk_file(table: Any, origin: Origin, index: int) -> bytes:
    """The Parquet file of a chunk's rows, which says whose they are and carries its own checksum."""
    import pyarrow.parquet as pq

    sink = io.BytesIO()
    told = table.replace_schema_metadata(origin.metadata(index))
    pq.write_table(told, sink, compression="zstd", use_dictionary=["controller", "status"])
    return sealed(sink.getvalue())


def _places(status: Any, statuses: Sequence[str]) -> Any:
    """Number of each status among those there are."""
    return np.argmax([status == word for word in statuses], axis=0)


def _words(pa: Any, indices: Any, words: list[str]) -> Any:
    """A column of words, each stored once."""
    return pa.DictionaryArray.from_arrays(pa.array(indices, type=pa.int8()), pa.array(words))
