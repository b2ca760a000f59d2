"""Rows and manifests that are damaged or forged: never other numbers, never a
traceback; folders of 0.3 are read.
"""

from __future__ import annotations

import copy
import hashlib
import io
import json
import random
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from skyarm.studies.flights.store import sound_content, unpack_rows
from skyarm.studies.sweep import StudyError, run_sweep
from skyarm.studies.sweep.manifest import MANIFEST
from skyarm.studies.sweep.maps import robustness_maps
from skyarm.studies.sweep.stats import Pictures, Rows, page, statistics
from support.studies import rows_file, small_study

pytest.importorskip("pyarrow")

TINY: dict[str, Any] = {
    "episodes": 4,
    "chunk": 2,
    "metrics": ["position_error_mean"],
    "duration": 0.4,
    "windows": None,
}
OLD = Path(__file__).parents[2] / "data" / "sweep_of_0_3"


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("tiny") / "out"
    run_sweep(small_study(**TINY), folder)
    return folder


@pytest.fixture
def done(whole: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(whole, tmp_path / "out"))


def some(step: int) -> Any:
    """Every so many cases by day, all by night."""
    return pytest.mark.parametrize(
        "step", [step, pytest.param(1, marks=pytest.mark.thorough)]
    )


@some(661)
def test_a_flipped_bit_of_rows_is_seen_by_statistics_and_when_the_sweep_goes_on(
    done: Path, step: int
) -> None:
    path = rows_file(done, 0)
    content, believed = path.read_bytes(), []
    for bit in range(0, 8 * len(content), step):
        wrong = bytearray(content)
        wrong[bit // 8] ^= 1 << bit % 8
        path.write_bytes(bytes(wrong))
        if sound_content(path) is not None or Rows(done).skipped != (path.name,):
            believed.append(bit)
    assert believed == []
    found = statistics(Rows(done))
    assert (found["rows"], found["files_not_counted"]) == (4, [path.name])
    with pytest.warns(UserWarning, match="damaged, and flown again: chunk_0000000"):
        summary = run_sweep(small_study(**TINY), done)
    assert (summary.found, summary.rows) == (3, 8)
    assert path.read_bytes() == content


@some(61)
def test_a_flipped_bit_of_a_manifest_is_refused_or_changes_nothing(
    done: Path, step: int
) -> None:
    path = done / MANIFEST
    content, right = path.read_bytes(), statistics(Rows(done))
    taken = 0
    for bit in range(0, 8 * len(content), step):
        wrong = bytearray(content)
        wrong[bit // 8] ^= 1 << bit % 8
        path.write_bytes(bytes(wrong))
        try:
            found = statistics(Rows(done))
        except StudyError as error:
            assert "\n" not in str(error), bit
        else:
            assert found == right, bit
            taken += 1
    assert taken < len(content), "white space at most"


def forged(value: Any) -> Iterator[Any]:
    """Other values in the place of one."""
    yield from (
        None,
        3,
        -1,
        0,
        1.5,
        True,
        10**30,
        "x",
        "",
        [],
        [3],
        [[1]],
        {},
        {"a": 1},
        {"a": None},
        {"a": {"b": []}},
    )


def places(table: dict[str, Any]) -> Iterator[tuple[str, ...]]:
    for name, value in table.items():
        yield (name,)
        if isinstance(value, dict):
            yield from ((name, *deeper) for deeper in places(value))


def in_one_line(folder: Path) -> str:
    """What statistics, maps and page say of a folder; empty if they find no fault."""
    try:
        rows = Rows(folder)
        robustness_maps(rows, None)
        page(statistics(rows), rows.manifest, Pictures())
    except StudyError as error:
        return str(error)
    return ""


@some(17)
@pytest.mark.parametrize("old", [False, True])
def test_a_forged_field_of_a_manifest_is_one_line_or_without_effect(
    done: Path, old: bool, step: int
) -> None:
    folder = Path(shutil.copytree(OLD, done.parent / "old")) if old else done
    path = folder / MANIFEST
    table = json.loads(path.read_bytes())
    table.pop("sha256", None)
    right = statistics(Rows(folder))
    cases = [(place, value) for place in places(table) for value in forged(None)]
    for number, (place, value) in enumerate(cases[::step]):
        wrong = copy.deepcopy(table)
        inner = wrong
        for name in place[:-1]:
            inner = inner[name]
        inner[place[-1]] = value
        if not old:
            wrong["sha256"] = hashlib.sha256(
                json.dumps(wrong, sort_keys=True).encode()
            ).hexdigest()
        path.write_text(json.dumps(wrong))
        said = in_one_line(folder)
        assert "\n" not in said, (place, value)
        if (
            not said
            and place[0] in ("study", "scenarios", "versions")
            and inner != table
        ):
            found = statistics(Rows(folder))
            assert found["controllers"] == right["controllers"] or place == (
                "study",
                "metrics",
            ), (place, value)
        if not old and number % 20 == 0:
            try:
                run_sweep(small_study(**TINY), folder)
            except ValueError as error:
                assert "\n" not in str(error), (place, value)


def test_a_forged_folder_of_old_or_new_is_never_a_traceback(done: Path) -> None:
    dice = random.Random(5)
    path = done / MANIFEST
    content = path.read_bytes()
    for _ in range(100):
        cut = sorted(dice.sample(range(len(content)), 2))
        path.write_bytes(content[: cut[0]] + content[cut[1] :])
        assert "\n" not in in_one_line(done)


def rewritten(path: Path, table: Any, **options: Any) -> Path:
    """Write a table in the place of a file of rows, under the name that its bytes give
    it, with the same metadata.
    """
    import pyarrow.parquet as pq

    metadata = pq.read_schema(path).metadata
    sink = io.BytesIO()
    pq.write_table(
        table.replace_schema_metadata(metadata), sink, compression="zstd", **options
    )
    digest = hashlib.sha256(sink.getvalue()).hexdigest()
    path.unlink()
    named = path.with_name(f"{'.'.join(path.name.split('.')[:-2])}.{digest}.parquet")
    named.write_bytes(sink.getvalue())
    return named


def test_a_file_that_unpacks_to_gigabytes_is_refused_before_it_does(done: Path) -> None:
    import pyarrow as pa

    path = rows_file(done, 0)
    zeros = pa.table({"episode": pa.array(np.zeros(130_000_000, np.uint8))})
    named = rewritten(path, zeros, use_dictionary=False)
    assert named.stat().st_size < 1_000_000
    assert Rows(done).skipped == (named.name,)
    content = sound_content(named)
    assert content is not None
    with pytest.raises(ValueError, match="must unpack to at most 1000 MB"):
        unpack_rows(content)
    with pytest.warns(UserWarning, match="damaged, and flown again"):
        assert run_sweep(small_study(**TINY), done).found == 3


def test_rows_of_other_types_are_one_line(done: Path) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    path = rows_file(done, 0)
    table = pq.read_table(path)
    words = pa.array(["many"] * len(table)).dictionary_encode()
    place = table.column_names.index("position_error_mean")
    rewritten(path, table.set_column(place, "position_error_mean", words))
    assert "column 'position_error_mean': must be readable" in in_one_line(done)


def test_a_sweep_of_0_3_is_summed_up_as_before_and_not_continued(
    tmp_path: Path,
) -> None:
    folder = Path(shutil.copytree(OLD, tmp_path / "old"))
    rows = Rows(folder)
    found = json.loads(json.dumps(statistics(rows)))
    assert found == json.loads((OLD / "stats_before.json").read_text())
    assert len(robustness_maps(rows, None)) == 2
    study = small_study(episodes=24, metrics=["position_error_mean", "peak_pitch"])
    with pytest.raises(
        StudyError,
        match=r"holds rows of skyarm 0\.3.*, which can be summed up and not continued",
    ):
        run_sweep(study, folder)


def test_rows_of_0_3_without_a_manifest_are_not_mixed_with_others(
    tmp_path: Path,
) -> None:
    folder = Path(shutil.copytree(OLD, tmp_path / "old"))
    (folder / MANIFEST).unlink()
    with pytest.raises(
        StudyError,
        match=(
            r"holds rows of skyarm 0\.3 without a manifest\.json; choose another --out"
        ),
    ):
        run_sweep(small_study(**TINY), folder)
    assert len([*(folder / "rows").iterdir()]) == 2


def test_a_damaged_file_of_0_3_does_not_count(tmp_path: Path) -> None:
    folder = Path(shutil.copytree(OLD, tmp_path / "old"))
    path = folder / "rows" / "chunk_0000001.parquet"
    path.write_bytes(path.read_bytes()[:-1])
    assert (Rows(folder).count, Rows(folder).skipped) == (32, (path.name,))


@pytest.mark.thorough
def test_five_thousand_flipped_bits_of_a_large_file_are_seen(tmp_path: Path) -> None:
    run_sweep(
        small_study(episodes=2000, chunk=2000, duration=0.2, windows=None), tmp_path
    )
    path, dice = rows_file(tmp_path, 0), random.Random(17)
    content = path.read_bytes()
    assert len(content) > 200_000
    for bit in (dice.randrange(8 * len(content)) for _ in range(5000)):
        wrong = bytearray(content)
        wrong[bit // 8] ^= 1 << bit % 8
        path.write_bytes(wrong)
        assert sound_content(path) is None, bit
