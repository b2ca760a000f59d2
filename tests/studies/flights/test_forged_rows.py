"""Files of rows that someone made up: never code, never gigabytes, never a traceback;
they are flown again.
"""

from __future__ import annotations

import hashlib
import io
import os
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import skyarm
from skyarm.studies.flights import Store, Work, WorkRunner
from skyarm.studies.flights.store import KEY, sound_content, unpack_rows

pytest.importorskip("pyarrow")


@pytest.fixture(scope="module")
def work() -> Work:
    scenario = skyarm.load_scenario("case1", duration=0.1)
    return Work(
        label="one",
        scenario=scenario,
        episodes=np.arange(3),
        metrics=("tilt_max",),
        effort=0,
    )


@pytest.fixture(scope="module")
def good(work: Work, tmp_path_factory: pytest.TempPathFactory) -> bytes:
    store = Store(tmp_path_factory.mktemp("good"))
    with WorkRunner(store=store) as crew:
        ((_, content),) = crew.fly([work])
    return content


def put(folder: Path, content: bytes) -> Store:
    """Folder that holds a content under the name that its bytes give it."""
    (folder / "rows").mkdir(parents=True)
    (
        folder / "rows" / f"one.{hashlib.sha256(content).hexdigest()}.parquet"
    ).write_bytes(content)
    return Store(folder)


def table_of(content: bytes) -> Any:
    import pyarrow.parquet as pq

    return pq.read_table(io.BytesIO(content))


def written(table: Any, **options: Any) -> bytes:
    import pyarrow.parquet as pq

    sink = io.BytesIO()
    pq.write_table(table, sink, **options)
    return sink.getvalue()


def changed(good: bytes, kind: str) -> bytes:
    """Rows with the right key, and something that rows do not have."""
    import pyarrow as pa

    table = table_of(good)
    place, count = table.column_names.index("tilt_max"), len(table)
    if kind == "a metric is missing":
        table = table.drop_columns(["tilt_max"])
    elif kind == "a metric is there twice":
        table = table.append_column("tilt_max", table["tilt_max"])
    elif kind == "words in place of numbers":
        table = table.set_column(
            place, "tilt_max", pa.array(["a"] * count).dictionary_encode()
        )
    elif kind == "numbers in place of words":
        table = table.set_column(
            table.column_names.index("status"), "status", pa.array([1.0] * count)
        )
    elif kind == "plain text":
        table = table.set_column(
            table.column_names.index("status"), "status", table["status"].cast("string")
        )
    elif kind == "empty values":
        table = table.set_column(
            place, "tilt_max", pa.array([None] * count, pa.float64())
        )
    elif kind == "lists":
        table = table.set_column(place, "tilt_max", pa.array([[1.0]] * count))
    elif kind == "a row less":
        table = table.slice(1)
    return written(table)


KINDS = (
    "a metric is missing",
    "a metric is there twice",
    "words in place of numbers",
    "numbers in place of words",
)


@pytest.mark.parametrize(
    "kind", [*KINDS, "plain text", "empty values", "lists", "a row less"]
)
def test_rows_that_cannot_be_are_named_and_flown_again(
    work: Work, good: bytes, tmp_path: Path, kind: str
) -> None:
    store = put(tmp_path, changed(good, kind))
    with (
        pytest.warns(UserWarning, match=r"damaged, and flown again: one\."),
        WorkRunner(store=store) as crew,
    ):
        ((_, content),) = crew.fly([work])
    assert content == good
    assert [path.read_bytes() for path in (tmp_path / "rows").iterdir()] == [good]


def test_the_same_rows_under_their_own_name_count(
    work: Work, good: bytes, tmp_path: Path
) -> None:
    assert put(tmp_path, good).get(work) == good
    assert changed(good, "nothing") != good
    assert put(tmp_path / "again", changed(good, "nothing")).get(work) is not None


class Evil:
    """Runs code when it is unpickled."""

    def __reduce__(self) -> Any:
        return os.mkdir, ("evil",)


def test_a_pickle_before_a_good_end_is_no_file_of_rows(
    work: Work, good: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    size = int.from_bytes(good[-8:-4], "little")
    forged = pickle.dumps(Evil()) + good[-8 - size :]
    assert put(tmp_path / "out", forged).get(work) is None
    with pytest.raises(ValueError, match="must be a Parquet file"):
        unpack_rows(forged)
    assert not Path("evil").exists()


def test_a_word_that_every_row_repeats_is_unpacked_once(
    work: Work, tmp_path: Path
) -> None:
    import pyarrow as pa

    word = pa.array(["x" * 400_000] * 60)
    metadata = {KEY: work.key.encode()}
    plain = written(
        pa.table({"status": word}).replace_schema_metadata(metadata),
        store_schema=False,
        compression="zstd",
    )
    assert len(plain) < 10_000
    with pytest.raises(
        ValueError, match="must have columns of numbers, words and logs"
    ):
        unpack_rows(plain)
    shared = unpack_rows(written(pa.table({"status": word.dictionary_encode()})))[
        "status"
    ]
    assert shared[0] is shared[59]
    logs = written(pa.table({"log": pa.array([b"x" * 400_000] * 60)}))
    with pytest.raises(ValueError, match="must have each log by itself"):
        unpack_rows(logs)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes here")
def test_pipes_and_links_are_no_files_of_rows(work: Work, tmp_path: Path) -> None:
    (tmp_path / "rows").mkdir()
    os.mkfifo(tmp_path / "rows" / f"one.{'0' * 64}.parquet")
    (tmp_path / "rows" / f"one.{'1' * 64}.parquet").symlink_to("/dev/zero")
    assert Store(tmp_path).get(work) is None


def test_rows_of_other_numbers_stay_until_their_own_command_needs_them(
    work: Work, good: bytes, tmp_path: Path
) -> None:
    import dataclasses

    store, other = put(tmp_path, good), dataclasses.replace(work, seed=5)
    with WorkRunner(store=store) as crew:
        list(crew.fly([other]))
    assert len(list((tmp_path / "rows").iterdir())) == 2
    assert Store(tmp_path).get(work) == good
    assert sound_content(next((tmp_path / "rows").glob("one.*"))) is not None
