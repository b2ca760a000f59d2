"""Logs read back: the same bits, the same scenario; from a file that was cut off what came before; else one line."""

from __future__ import annotations

import dataclasses
import json
import random
import struct
import time
import warnings

import numpy as np
import pytest

import skyarm
from logged_flights import begins, drawn, flown, same
from skyarm.log.contents import CutLogWarning
from thorough import sampled

FORMATS = ("npz", "mcap", "parquet")

CHUNK, DATA_END = 6, 15
"""Opcodes of MCAP's records."""


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    pytest.importorskip("pyarrow", reason="needs the extra 'logs'")
    folder = tmp_path_factory.mktemp("files")
    return {kind: skyarm.save_log(flown(), folder / f"flight.{kind}").read_bytes() for kind in FORMATS}


def loaded(folder, kind, content):
    path = folder / f"given.{kind}"
    path.write_bytes(content)
    return skyarm.load_log(path)


@pytest.mark.parametrize("kind", FORMATS)
def test_a_log_is_read_back_to_the_bit_with_its_scenario(kind, files, tmp_path):
    read = loaded(tmp_path, kind, files[kind])
    assert same(read, flown())
    assert read.scenario == flown().scenario
    assert all(array.flags.c_contiguous and array.flags.writeable for array in read.arrays().values())
    assert skyarm.save_log(read, tmp_path / f"again.{kind}").read_bytes() == files[kind]


@pytest.mark.parametrize("kind", FORMATS)
@pytest.mark.parametrize("name", sampled(skyarm.list_vehicles(), 6))
@pytest.mark.parametrize("count", [0, 1, 250])
def test_logs_of_any_vehicle_and_length_are_read_back(kind, name, count, tmp_path):
    pytest.importorskip("pyarrow", reason="needs the extra 'logs'")
    log = drawn(skyarm.load_vehicle(name), count=count)
    if count > 1:
        log.wind_force[1] = [np.nan, -0.0, np.inf]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert same(skyarm.load_log(skyarm.save_log(log, tmp_path / f"drawn.{kind}")), log)


def test_npz_files_of_before_are_read(tmp_path):
    log = flown()
    np.savez_compressed(tmp_path / "old.npz", **log.arrays(), info=np.array(json.dumps(log.info)))
    assert same(skyarm.load_log(tmp_path / "old.npz"), log)


def test_parquet_has_units_in_its_fields_and_npz_in_its_description(files, tmp_path):
    import pyarrow.parquet as pq

    (tmp_path / "flight.parquet").write_bytes(files["parquet"])
    table = pq.read_table(tmp_path / "flight.parquet")
    field = table.schema.field("joint_effort_2")
    assert field.metadata == {b"unit": b"N m", b"meaning": b"commanded"}
    assert np.array_equal(table.column("joint_effort_2").to_numpy(), flown().efforts[:, 1])
    (tmp_path / "flight.npz").write_bytes(files["npz"])
    info = json.loads(str(np.load(tmp_path / "flight.npz")["info"]))
    assert info["columns"]["joint_rates"] == {"columns": ["joint_rate_1", "joint_rate_2"], "units": ["rad/s"] * 2}


@pytest.mark.parametrize("kind", FORMATS)
def test_a_file_that_was_cut_off_gives_one_line_or_what_came_before(kind, files, tmp_path):
    content, rng = files[kind], random.Random(4)
    cuts = [0, 1, 7, 8, 9, *(rng.randrange(len(content)) for _ in range(40)), len(content) - 1]
    seen = set()
    for cut in cuts:
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            try:
                read = loaded(tmp_path, kind, content[:cut])
            except ValueError as error:
                seen.add("refused")
                assert str(error).startswith("log = ")
                assert "\n" not in str(error)
                continue
        assert kind == "mcap"
        seen.add(read.status)
        assert begins(read, flown())
        if read.status == "cut":
            (warning,) = said
            assert warning.category is CutLogWarning
            end = read.time[-1] if read.time.size else 0
            assert f"cut at t = {end:g} s" in str(warning.message)
            assert read.info["cause"] == f"the log is cut at t = {end:g} s of 3.015 s"
            assert read.scenario == flown().scenario
    assert seen == ({"refused", "cut", "completed"} if kind == "mcap" else {"refused"})


def test_only_the_chunk_in_which_a_file_was_cut_is_lost(files, tmp_path):
    content = files["mcap"]
    with pytest.warns(CutLogWarning, match=r"cut at t = \S+ s; what came before is read"):
        assert loaded(tmp_path, "mcap", content[: int(len(content) * 0.8)]).time.size >= 360


@pytest.mark.parametrize("kind", FORMATS)
def test_damaged_bytes_give_one_line_or_are_not_in_what_is_read(kind, files, tmp_path):
    content, rng, refused = files[kind], random.Random(5), 0
    for _ in range(60):
        damaged = bytearray(content)
        begin = rng.choice([rng.randrange(200), rng.randrange(len(content))])
        for at in range(begin, min(begin + rng.choice([1, 4]), len(content))):
            damaged[at] ^= rng.randrange(1, 256)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", CutLogWarning)
            try:
                read = loaded(tmp_path, kind, bytes(damaged))
            except ValueError as error:
                refused += 1
                assert str(error).startswith("log = ")
                assert "\n" not in str(error)
                continue
        assert begins(read, flown()), begin
    assert refused > 10


def test_a_chunk_that_became_another_record_is_damage_and_no_gap_in_time(files, tmp_path):
    """What a record is has no checksum of its own: a reader passes over those that it does not know."""
    content, at, changed = bytearray(files["mcap"]), 8, 0
    while content[at] != DATA_END:
        if content[at] == CHUNK:
            content[at] ^= 0x40
            with pytest.raises(ValueError, match=r"^log = '.*': must have the checksums .* damaged$"):
                loaded(tmp_path, "mcap", bytes(content))
            content[at] ^= 0x40
            changed += 1
        at += 9 + struct.unpack_from("<Q", content, at + 1)[0]
    assert changed > 2


def test_what_a_parquet_file_says_of_its_flight_has_a_checksum(files, tmp_path):
    pq = pytest.importorskip("pyarrow.parquet", reason="needs the extra 'logs'")
    (tmp_path / "whole.parquet").write_bytes(files["parquet"])
    table = pq.read_table(tmp_path / "whole.parquet")
    metadata = dict(table.schema.metadata)
    metadata[b"skyarm"] = metadata[b"skyarm"].replace(b'"duration": ', b'"durotion": ')
    assert metadata != table.schema.metadata
    pq.write_table(table.replace_schema_metadata(metadata), tmp_path / "damaged.parquet")
    with pytest.raises(ValueError, match=r"^log = '.*damaged\.parquet': must have the checksum .* damaged$"):
        skyarm.load_log(tmp_path / "damaged.parquet")


def test_parquet_files_of_before_are_read(files, tmp_path):
    pq = pytest.importorskip("pyarrow.parquet", reason="needs the extra 'logs'")
    (tmp_path / "now.parquet").write_bytes(files["parquet"])
    table = pq.read_table(tmp_path / "now.parquet")
    metadata = {key: value for key, value in table.schema.metadata.items() if key == b"skyarm"}
    pq.write_table(table.replace_schema_metadata(metadata), tmp_path / "before.parquet")
    assert same(skyarm.load_log(tmp_path / "before.parquet"), flown())


@pytest.mark.parametrize("kind", FORMATS)
@pytest.mark.parametrize("content", [b"", b"garbage", b"\x89MCAP0\r\n", b"PAR1", b"PK\x03\x04", bytes(range(256)) * 50])
def test_a_file_that_is_no_log_is_one_line(kind, content, tmp_path):
    with pytest.raises(ValueError, match=r"^log = '.*': must be ") as refused:
        loaded(tmp_path, kind, content)
    assert "\n" not in str(refused.value)


def test_an_mcap_file_of_someone_else_is_one_line(tmp_path):
    mcap_writer = pytest.importorskip("mcap.writer", reason="needs the extra 'test'")
    for compression in mcap_writer.CompressionType:
        with (tmp_path / "other.mcap").open("wb") as stream:
            writer = mcap_writer.Writer(stream, compression=compression)
            writer.start()
            schema = writer.register_schema("std_msgs/msg/Float64", "ros2msg", b"float64 data")
            channel = writer.register_channel("/skyarm/flight", "cdr", schema)
            writer.add_message(channel, 0, bytes(12), 0)
            writer.finish()
        with pytest.raises(ValueError, match=r"^log = '.*other\.mcap': (must be a log that skyarm wrote|chunks: must)"):
            skyarm.load_log(tmp_path / "other.mcap")


def test_a_log_of_another_shape_or_schema_is_one_line(tmp_path):
    log = drawn(skyarm.load_vehicle("hummingbird_arm2"))
    wrong = {
        "short": dataclasses.replace(log, position=log.position[:3]),
        "wide": dataclasses.replace(log, position=log.quaternion),
        "joints": dataclasses.replace(log, joint_rates=log.position),
        "schema": dataclasses.replace(log, info={**log.info, "schema": 2}),
        "single": dataclasses.replace(log, wind_force=log.wind_force.astype(np.float32)),
    }
    for name, each in wrong.items():
        np.savez(tmp_path / "wrong.npz", **each.arrays(), info=np.array(json.dumps(each.info)))
        with pytest.raises(ValueError, match=r"^log = '.*wrong\.npz': must be a log of schema 1$"):
            skyarm.load_log(tmp_path / "wrong.npz")
        assert name


@pytest.mark.parametrize(
    "columns", [None, 3, {}, {"time": 1}, {"time": {"columns": ["time", "nothing"], "units": [""]}}]
)
def test_a_description_that_names_other_columns_is_one_line(columns, tmp_path):
    from skyarm.log import contents

    log = drawn(skyarm.load_vehicle("hummingbird_arm2"))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(contents, "layout", lambda _: columns)
        skyarm.save_log(log, tmp_path / "drawn.mcap")
    with pytest.raises(ValueError, match=r"^log = '.*drawn\.mcap': [^\n]*must (be|have)"):
        skyarm.load_log(tmp_path / "drawn.mcap")


def test_thirty_seconds_of_flight_are_written_in_seconds(tmp_path):
    # three seconds over and over: what they are makes no difference
    log = flown()
    many = {name: np.concatenate([array[:600]] * 10) for name, array in log.arrays().items()}
    many["time"] = np.arange(6000) / 200
    begun = time.process_time()
    path = skyarm.save_log(dataclasses.replace(log, **many), tmp_path / "long.mcap")
    assert time.process_time() - begun < 6.0
    assert path.stat().st_size > 10_000_000
