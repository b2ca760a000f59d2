"""Small files that would unpack to gigabytes are refused before they are unpacked."""

from __future__ import annotations

import io
import json
import tracemalloc
import zipfile

import numpy as np
import pytest

import skyarm
from skyarm.records.files.unpacked import (
    LARGEST,
    RATIO,
    TooLargeError,
    npz_arrays,
    require_size,
)


def npz_bomb(path):
    """An npz of 1 MB whose zeros take 1.1 GB, in many members that share one piece of
    the file.
    """
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        with archive.open("time.npy", "w", force_zip64=True) as stream:
            np.lib.format.write_array_header_1_0(
                stream, {"descr": "<f8", "fortran_order": False, "shape": (15_000_000,)}
            )
            for _ in range(120):
                stream.write(bytes(1_000_000))
        member = archive.infolist()[0]
        # the directory of an archive may name one piece of the file as often as it
        # likes
        for number in range(9):
            again = zipfile.ZipInfo(f"array{number}.npy")
            for name in (
                "compress_type",
                "CRC",
                "compress_size",
                "file_size",
                "header_offset",
                "flag_bits",
            ):
                setattr(again, name, getattr(member, name))
            archive.filelist.append(again)


@pytest.mark.parametrize(("suffix", "bomb"), [("npz", npz_bomb)])
def test_a_small_log_that_unpacks_to_a_gigabyte_is_refused_before_it_does(
    suffix, bomb, tmp_path
):
    file = tmp_path / f"bomb.{suffix}"
    bomb(file)
    assert RATIO * file.stat().st_size < LARGEST
    tracemalloc.start()
    try:
        with pytest.raises(
            ValueError,
            match=(
                rf"^log = '.*bomb\.{suffix}': must unpack to at most 1000 MB, and would"
                r" to 1"
            ),
        ):
            skyarm.load_log(file)
        assert tracemalloc.get_traced_memory()[1] < 50e6
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("method", [zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
def test_a_member_that_is_unpacked_as_a_whole_is_refused(method):
    stream = io.BytesIO()
    with (
        zipfile.ZipFile(stream, "w", method) as archive,
        archive.open("time.npy", "w") as member,
    ):
        np.lib.format.write_array(member, np.zeros(1_000_000))
    small = bytearray(stream.getvalue())
    # the directory's entry says a header and eight bytes
    at = small.rindex(b"PK\1\2") + 24
    small[at : at + 4] = (136).to_bytes(4, "little")
    tracemalloc.start()
    try:
        with pytest.raises(
            ValueError,
            match=r"^must be an npz file: members must be stored or deflated$",
        ):
            npz_arrays(bytes(small))
        assert tracemalloc.get_traced_memory()[1] < 1e6
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("broken", ["cut", "no archive", "compression"])
def test_whatever_is_wrong_with_an_npz_file_is_a_value_error(broken):
    stream = io.BytesIO()
    np.savez_compressed(stream, a=np.arange(100.0))
    content = bytearray(stream.getvalue())
    content[60:80] = bytes(20)
    wrong = {"cut": content[:100], "no archive": b"x", "compression": content}[broken]
    with pytest.raises(ValueError, match=r"^must be an npz file: "):
        npz_arrays(bytes(wrong))


def test_a_large_file_may_hold_what_numbers_shrink_to():
    content = memoryview(bytes(1000)).cast("B")
    require_size(LARGEST, bytes(content))
    with pytest.raises(TooLargeError):
        require_size(LARGEST + 1, bytes(content))
    large = bytearray(int(LARGEST / RATIO) + 10)
    require_size(RATIO * len(large), large)
    with pytest.raises(TooLargeError):
        require_size(RATIO * len(large) + 1, large)


WRONG = {
    "rates_hz": [
        None,
        3,
        {"control": "fast"},
        {"physics": 1, "control": 0, "reference": 1},
    ],
    "duration": ["x", None, [1.0], float("nan")],
    "status": [3, None, {}],
    "scenario": [[]],
    "cause": [{}],
    "controller": [3],
    "versions": ["1.0", {"skyarm": 3}],
    "plugins": [[1], "x"],
    "code": [3],
    "phases": [3, [4]],
    "waits": [3, [3], [{"phase": "x", "at": 1.0, "timeout": 1.0}]],
    "windows": [[3]],
    "scenario_record": ["x", [1]],
}


@pytest.mark.parametrize("name", WRONG)
def test_a_forged_field_of_a_description_is_refused_by_its_name(name, tmp_path):
    log = skyarm.run(skyarm.load_scenario("case1", duration=0.02))
    for value in WRONG[name]:
        forged = {**log.info, name: value}
        stream = io.BytesIO()
        np.savez(stream, **log.arrays(), info=np.array(json.dumps(forged)))
        file = tmp_path / "forged.npz"
        file.write_bytes(stream.getvalue())
        with pytest.raises(
            ValueError, match=rf"^log = '.*forged\.npz': info\.{name}[ .\[:]"
        ) as error:
            skyarm.load_log(file)
        assert "\n" not in str(error.value)
