"""A log's files: exact, whole or absent, refused when they are something else."""

from __future__ import annotations

import csv
import dataclasses
import errno
import json
import os
import stat
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from skyarm.dynamics import State
from skyarm.records.files import require_writable, write_atomically
from skyarm.records.units import units
from skyarm.scenario.scenario_file import load_scenario
from skyarm.simulate import Log, run


@pytest.fixture(scope="module")
def log() -> Log:
    return run(load_scenario("case3_wind", duration=0.2))


def test_npz_round_trips_every_array_and_the_description(
    log: Log, tmp_path: Path
) -> None:
    read = Log.load_npz(log.save_npz(tmp_path / "flight.npz"))
    assert read.info == log.info
    for name, array in log.arrays().items():
        assert np.array_equal(array, read.arrays()[name]), name
        assert read.arrays()[name].dtype == np.float64


def test_csv_round_trips_every_number_exactly(log: Log, tmp_path: Path) -> None:
    with log.save_csv(tmp_path / "flight.csv").open(newline="") as stream:
        heads, *rows = list(csv.reader(stream))
    header = [head.split(" [")[0] for head in heads]
    read = np.array([[float(cell) for cell in row] for row in rows])
    assert len(set(header)) == len(header)
    # side by side, the arrays are the file: no column is missing, none stands in
    # another's place
    arrays = [
        array[:, None] if array.ndim == 1 else array for array in log.arrays().values()
    ]
    assert np.array_equal(read, np.concatenate(arrays, axis=1))
    for name, wanted in {
        "position_z": log.position[:, 2],
        "quaternion_w": log.quaternion[:, 0],
        "joint_2": log.joints[:, 1],
        "joint_effort_1": log.efforts[:, 0],
        "rotor_speed_back": log.rotor_speeds[:, 2],
        "yaw_held": log.yaw_held,
        "tip_reference_x": log.tip_reference[:, 0],
    }.items():
        assert np.array_equal(read[:, header.index(name)], wanted), name


def test_csv_tells_equal_neighbours_from_zeros_of_either_sign(
    log: Log, tmp_path: Path
) -> None:
    values = np.resize(
        [0.0, 0.0, -0.0, 1.5, 1.5, 1.5, np.nan, np.inf, 0.1], log.time.size
    )
    with (
        dataclasses.replace(log, yaw_held=values)
        .save_csv(tmp_path / "flight.csv")
        .open(newline="") as stream
    ):
        heads, *rows = list(csv.reader(stream))
    place = [head.split(" [")[0] for head in heads].index("yaw_held")
    assert [row[place] for row in rows] == [repr(float(value)) for value in values]


def test_every_array_says_its_unit_and_csv_heads_name_it(
    log: Log, tmp_path: Path
) -> None:
    assert set(log.units) == set(log.arrays())
    assert log.units["rate"] is units(State)["rate"]
    named = log.save_csv(tmp_path / "flight.csv").read_text()
    heads = named.split("\n", 1)[0]
    assert {
        "time [s]",
        "position_z [m]",
        "quaternion_w",
        "rate_y [rad/s]",
        "joint_1 [rad]",
        "joint_effort_2 [N m]",
    } <= (set(heads.split(",")))


def test_the_description_says_what_the_numbers_depend_on(log: Log) -> None:
    assert log.info["schema"] == 1
    assert log.info["plant_vehicle"] == "hummingbird_arm2_rotors"
    assert log.info["model_vehicle"] == "hummingbird_arm2"
    assert (log.info["plant_gravity"], log.info["model_gravity"]) == (9.8, 9.81)
    assert log.info["rates_hz"] == {"physics": 1000, "control": 200, "reference": 50}
    assert {"seed", "episode", "controller", "integrator", "versions"} <= set(log.info)
    assert {"skyarm", "numpy", "mujoco-core", "python"} <= set(log.info["versions"])
    assert json.loads(json.dumps(log.info, allow_nan=False)) == log.info


def test_the_tip_is_what_files_call_the_tool(log: Log) -> None:
    assert (
        log.tip is log.tool,
        log.tip_held is log.tool_held,
        log.tip_reference is log.tool_reference,
    ) == (True,) * 3
    assert {"tool", "tool_held", "tool_reference"} <= set(log.arrays())


def test_euler_angles_are_those_of_the_quaternion() -> None:
    rotation = pytest.importorskip("scipy.spatial.transform").Rotation
    rng = np.random.default_rng(5)
    angles = rng.uniform([-3.0, -1.5, -3.0], [3.0, 1.5, 3.0], (50, 3))
    x, y, z, w = rotation.from_euler("ZYX", angles[:, ::-1]).as_quat().T
    flight = run(load_scenario("case1", duration=0.25))
    turned = dataclasses.replace(flight, quaternion=np.stack([w, x, y, z], axis=1))
    # rounding, some digits lost near 90 degrees
    assert np.abs(turned.euler - angles).max() < 1e-12


@pytest.mark.parametrize("short_of", [1e-3, 1e-6, 1e-7])
def test_euler_angles_keep_their_digits_near_a_pitch_of_90_degrees(
    short_of: float,
) -> None:
    rotation = pytest.importorskip("scipy.spatial.transform").Rotation
    flight = run(load_scenario("case1", duration=0.25))
    pitch = 0.5 * np.pi - short_of
    x, y, z, w = rotation.from_euler("ZYX", [0.3, pitch, -0.4]).as_quat()
    turned = dataclasses.replace(
        flight, quaternion=np.tile([w, x, y, z], (flight.time.size, 1))
    )
    # a few roundings of the quaternion; an arcsine would turn them into 1e-16 /
    # short_of
    assert np.abs(turned.euler[:, 1] - pitch).max() < 1e-15


@pytest.mark.parametrize("existing", [None, b"old"])
def test_a_write_that_is_cut_off_leaves_what_was_there(
    tmp_path: Path, existing: bytes | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    target = tmp_path / "log.npz"
    if existing is not None:
        target.write_bytes(existing)

    def killed(_self: Path, _target: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(Path, "replace", killed)
    with pytest.raises(KeyboardInterrupt):
        write_atomically(target, b"new content")
    monkeypatch.undo()
    assert (target.read_bytes() if target.exists() else None) == existing
    assert sorted(p.name for p in tmp_path.iterdir()) == (
        ["log.npz"] if existing is not None else []
    )


def test_a_target_that_cannot_be_written_is_one_line_and_leaves_nothing(
    tmp_path: Path,
) -> None:
    (tmp_path / "taken").mkdir()
    with pytest.raises(
        OSError, match=r"^file = '.*taken': must be writable \(Is a directory\)$"
    ):
        write_atomically(tmp_path / "taken", b"content")
    assert [p.name for p in tmp_path.iterdir()] == ["taken"]


def test_written_files_have_ordinary_rights(tmp_path: Path) -> None:
    ordinary = tmp_path / "ordinary"
    ordinary.write_bytes(b"")
    written = write_atomically(tmp_path / "deep" / "er" / "file", b"content")
    assert written.read_bytes() == b"content"
    assert written.stat().st_mode == ordinary.stat().st_mode


def test_an_output_folder_is_made_and_proved(tmp_path: Path) -> None:
    made = require_writable(tmp_path / "a" / "b")
    assert made.is_dir()
    assert not list(made.iterdir())
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(
        OSError, match=r"output folder = '.*file': must be writable \(File exists\)"
    ):
        require_writable(tmp_path / "file")
    with pytest.raises(
        OSError,
        match=r"output folder = '.*file.inner': must be writable \(Not a directory\)",
    ):
        require_writable(tmp_path / "file" / "inner")


@pytest.mark.parametrize("content", [b"", b"garbage", b"PK\x03\x04 cut off"])
def test_a_file_that_is_no_log_is_refused_in_one_line(
    tmp_path: Path, content: bytes
) -> None:
    path = tmp_path / "log.npz"
    path.write_bytes(content)
    with pytest.raises(
        ValueError,
        match="must be a log that save_npz wrote; 'skyarm run SCENARIO --log FILE'",
    ):
        Log.load_npz(path)


def test_a_log_of_another_schema_is_refused(log: Log, tmp_path: Path) -> None:
    np.savez(
        tmp_path / "old.npz", time=log.time, info=np.array(json.dumps({"schema": 1}))
    )
    with pytest.raises(ValueError, match="must be a log of schema 1"):
        Log.load_npz(tmp_path / "old.npz")
    newer = {**log.arrays(), "info": np.array(json.dumps({**log.info, "schema": 2}))}
    np.savez(tmp_path / "new.npz", **newer)
    with pytest.raises(ValueError, match="must be a log of schema 1"):
        Log.load_npz(tmp_path / "new.npz")
    with pytest.raises(FileNotFoundError):
        Log.load_npz(tmp_path / "missing.npz")


def test_saving_twice_gives_the_same_csv(log: Log, tmp_path: Path) -> None:
    first, second = (
        log.save_csv(tmp_path / "a.csv"),
        log.save_csv(os.fspath(tmp_path / "b.csv")),
    )
    assert first.read_bytes() == second.read_bytes()


def test_content_is_on_disk_before_the_file_has_its_name_and_the_name_after(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    done: list[str] = []
    sync, rename = os.fsync, Path.replace

    def fsync(handle: int) -> None:
        done.append("folder" if stat.S_ISDIR(os.fstat(handle).st_mode) else "content")
        sync(handle)

    def replace(path: Path, target: Path) -> Path:
        done.append("name")
        return rename(path, target)

    monkeypatch.setattr(os, "fsync", fsync)
    monkeypatch.setattr(Path, "replace", replace)
    write_atomically(tmp_path / "file", b"content")
    assert done[:2] == ["content", "name"]
    assert done[2:] == ([] if os.name == "nt" else ["folder"])
    done.clear()
    write_atomically(tmp_path / "file", b"more", entry=False)
    assert done == ["content", "name"]


def test_a_disk_that_cannot_be_forced_is_no_error_and_one_that_fails_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for code, fails in ((errno.EINVAL, False), (errno.EIO, True)):

        def fsync(handle: int, code: int = code) -> None:
            raise OSError(code, os.strerror(code))

        monkeypatch.setattr(os, "fsync", fsync)
        if fails:
            with pytest.raises(OSError, match="must be writable"):
                write_atomically(tmp_path / "new", b"content")
            assert list(tmp_path.iterdir()) == [tmp_path / "file"]
        else:
            write_atomically(tmp_path / "file", b"content")
