"""Logs read back: the same bits, the same scenario; from a file that was cut off or
damaged one line.
"""

from __future__ import annotations

import dataclasses
import io
import json
import random
import time
import warnings
import zipfile

import numpy as np
import pytest

import skyarm
from support.cases import sampled
from support.logs import drawn, flown, same

FORMATS = ("npz", "mcap")


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("files")
    return {
        kind: skyarm.save_log(flown(), folder / f"flight.{kind}").read_bytes()
        for kind in FORMATS
    }


def loaded(folder, kind, content):
    path = folder / f"given.{kind}"
    path.write_bytes(content)
    return skyarm.load_log(path)


@pytest.mark.parametrize("kind", FORMATS)
def test_a_log_is_read_back_to_the_bit_with_its_scenario(kind, files, tmp_path):
    read = loaded(tmp_path, kind, files[kind])
    assert same(read, flown())
    assert read.scenario == flown().scenario
    assert all(
        array.flags.c_contiguous and array.flags.writeable
        for array in read.arrays().values()
    )
    assert skyarm.save_log(read, tmp_path / f"again.{kind}").read_bytes() == files[kind]


@pytest.mark.parametrize("kind", FORMATS)
@pytest.mark.parametrize("name", sampled(skyarm.list_vehicles(), 6))
@pytest.mark.parametrize("count", [0, 1, 250])
def test_logs_of_any_vehicle_and_length_are_read_back(kind, name, count, tmp_path):
    log = drawn(skyarm.load_vehicle(name), count=count)
    if count > 1:
        log.wind_force[1] = [np.nan, -0.0, np.inf]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert same(
            skyarm.load_log(skyarm.save_log(log, tmp_path / f"drawn.{kind}")), log
        )


def test_npz_files_of_before_are_read(tmp_path):
    log = flown()
    np.savez_compressed(
        tmp_path / "old.npz", **log.arrays(), info=np.array(json.dumps(log.info))
    )
    assert same(skyarm.load_log(tmp_path / "old.npz"), log)


def test_npz_has_names_and_units_of_columns_in_its_description(files, tmp_path):
    (tmp_path / "flight.npz").write_bytes(files["npz"])
    info = json.loads(str(np.load(tmp_path / "flight.npz")["info"]))
    assert info["columns"]["joint_rates"] == {
        "columns": ["joint_rate_1", "joint_rate_2"],
        "units": ["rad/s"] * 2,
    }


def wrong(content, rng):
    """Contents of a file that was cut off, then of one with damaged bytes."""
    for at in [0, 1, 7, 8, 9, *(rng.randrange(len(content)) for _ in range(30))]:
        yield content[:at]
    for _ in range(60):
        damaged = bytearray(content)
        begin = rng.choice([rng.randrange(200), rng.randrange(len(content))])
        for at in range(begin, min(begin + rng.choice([1, 4]), len(content))):
            damaged[at] ^= rng.randrange(1, 256)
        yield bytes(damaged)


@pytest.mark.parametrize("kind", FORMATS)
def test_a_file_that_was_cut_off_or_damaged_is_one_line_or_the_whole_log(
    kind, files, tmp_path
):
    refused = 0
    for content in wrong(files[kind], random.Random(4)):
        try:
            read = loaded(tmp_path, kind, content)
        except ValueError as error:
            refused += 1
            assert str(error).startswith("log = ")
            assert "\n" not in str(error)
        else:
            assert same(read, flown())
    assert refused > 35


def test_an_mcap_file_of_someone_else_is_one_line(tmp_path):
    mcap_writer = pytest.importorskip("mcap.writer", reason="needs the extra 'test'")
    with (tmp_path / "other.mcap").open("wb") as stream:
        writer = mcap_writer.Writer(stream)
        writer.start()
        schema = writer.register_schema(
            "std_msgs/msg/Float64", "ros2msg", b"float64 data"
        )
        channel = writer.register_channel("/skyarm/flight", "cdr", schema)
        writer.add_message(channel, 0, bytes(12), 0)
        writer.finish()
    with pytest.raises(
        ValueError,
        match=r"^log = '.*other\.mcap': must be a whole MCAP file that skyarm wrote",
    ):
        skyarm.load_log(tmp_path / "other.mcap")


@pytest.mark.parametrize("kind", FORMATS)
@pytest.mark.parametrize(
    "content",
    [b"", b"garbage", b"\x89MCAP0\r\n", b"PAR1", b"PK\x03\x04", bytes(range(256)) * 50],
)
def test_a_file_that_is_no_log_is_one_line(kind, content, tmp_path):
    with pytest.raises(ValueError, match=r"^log = '.*': must be ") as refused:
        loaded(tmp_path, kind, content)
    assert "\n" not in str(refused.value)


def test_a_log_of_another_shape_or_schema_is_one_line(tmp_path):
    log = drawn(skyarm.load_vehicle("hummingbird_arm2"))
    wrong = {
        "short": dataclasses.replace(log, position=log.position[:3]),
        "wide": dataclasses.replace(log, position=log.quaternion),
        "joints": dataclasses.replace(log, joint_rates=log.position),
        "schema": dataclasses.replace(log, info={**log.info, "schema": 2}),
        "single": dataclasses.replace(
            log, wind_force=log.wind_force.astype(np.float32)
        ),
    }
    for name, each in wrong.items():
        np.savez(
            tmp_path / "wrong.npz",
            **each.arrays(),
            info=np.array(json.dumps(each.info)),
        )
        with pytest.raises(
            ValueError, match=r"^log = '.*wrong\.npz': must be a log of schema 1$"
        ):
            skyarm.load_log(tmp_path / "wrong.npz")
        assert name


def test_thirty_seconds_of_flight_are_written_in_seconds(tmp_path):
    # three seconds over and over: what they are makes no difference
    log = flown()
    many = {
        name: np.concatenate([array[:600]] * 10) for name, array in log.arrays().items()
    }
    many["time"] = np.arange(6000) / 200
    begun = time.process_time()
    path = skyarm.save_log(dataclasses.replace(log, **many), tmp_path / "long.mcap")
    assert time.process_time() - begun < 6.0
    assert path.stat().st_size > 10_000_000


@pytest.mark.parametrize("name", ["time", "wind_force", "position"])
def test_a_member_of_an_archive_that_is_no_array_is_one_line(name, files, tmp_path):
    path = tmp_path / "bytes.npz"
    with (
        zipfile.ZipFile(io.BytesIO(files["npz"])) as whole,
        zipfile.ZipFile(path, "w") as archive,
    ):
        assert f"{name}.npy" in whole.namelist()
        for member in whole.namelist():
            # NumPy gives the bytes of a member that has not its head
            content = b"none" if member == f"{name}.npy" else whole.read(member)
            archive.writestr(member, content)
    with pytest.raises(ValueError, match=r"^log = '.*bytes\.npz': must be a log"):
        skyarm.load_log(path)
