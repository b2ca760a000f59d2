"""Tables of text and the mapping of their columns."""

from __future__ import annotations

import io
import re
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from skyarm.flight_data.columns_file import QuantitySource, columns_from, read_columns
from skyarm.flight_data.flight_data import FlightData, load_flight
from skyarm.flight_data.raw_tables import RawTable, _fastest
from skyarm.records.files import read_toml

FLIGHTS = Path(__file__).parents[1] / "data" / "flights"
TIME = '[time]\ncolumn = "t"\n'
GYRO = '[gyro]\ncolumns = ["p", "q", "r"]\n'


def flight(folder: Path, text: str, mapping: str) -> FlightData:
    (folder / "flight.csv").write_text(text, encoding="utf-8")
    (folder / "columns.toml").write_text(mapping, encoding="utf-8")
    return load_flight(folder / "flight.csv")


def turn(angles: tuple[float, float, float]) -> np.ndarray:
    """Rotation matrix of roll, pitch and yaw, from three elementary ones."""
    (a, b, c), e = angles, np.eye(3)
    x = np.array([e[0], [0, np.cos(a), -np.sin(a)], [0, np.sin(a), np.cos(a)]])
    y = np.array([[np.cos(b), 0, np.sin(b)], e[1], [-np.sin(b), 0, np.cos(b)]])
    z = np.array([[np.cos(c), -np.sin(c), 0], [np.sin(c), np.cos(c), 0], e[2]])
    return z @ y @ x


def matrix(q: np.ndarray) -> np.ndarray:
    """Rotation matrix of a quaternion w, x, y, z."""
    w, v = q[0], q[1:]
    cross = np.cross(np.eye(3), v)
    return np.eye(3) + 2.0 * w * cross + 2.0 * cross @ cross


def test_units_signs_and_axes_of_vectors(tmp_path: Path) -> None:
    mapping = (
        '[time]\ncolumn = "t"\nunit = "ms"\n[gyro]\ncolumns = ["p", "-q", "r"]\nunit ='
        ' "deg/s"\nframe = "FRD"\n[position]\ncolumns = ["x", "y", "z"]\nunit ='
        ' "mm"\nworld = "NED"\n[rotor_commands]\ncolumns = ["u"]\nlow = 1000\nhigh ='
        ' 2000\n[voltage]\ncolumns = "v"\nunit = "mV"\n'
    )
    found = flight(
        tmp_path,
        "t,p,q,r,x,y,z,u,v\n100,180,90,0,1000,2000,3000,1250,7400\n110,0,0,90,0,0,0,2000,7300\n",
        mapping,
    )
    np.testing.assert_allclose(
        found["gyro"].values, np.array([[1, 0.5, 0], [0, 0, -0.5]]) * np.pi, atol=1e-15
    )
    np.testing.assert_allclose(found["position"].values, [[1, -2, -3], [0, 0, 0]])
    np.testing.assert_allclose(found["rotor_commands"].values, [[0.25], [1.0]])
    np.testing.assert_allclose(found["voltage"].values, [[7.4], [7.3]])
    np.testing.assert_allclose(found["gyro"].time, [0.0, 0.01])
    assert found.facts["start"] == pytest.approx(0.1)


@pytest.mark.parametrize("frame", ["FLU", "FRD"])
@pytest.mark.parametrize("world", ["z up", "NED"])
@pytest.mark.parametrize("inverse", [False, True])
def test_an_attitude_turns_our_base_axes_to_our_world_axes(
    tmp_path: Path, frame: str, world: str, inverse: bool
) -> None:
    angles, flip = (0.3, -0.5, 2.9), np.diag([1.0, -1.0, -1.0])
    given = turn(angles)
    wanted = given.T if inverse else given
    wanted = wanted @ flip if frame == "FRD" else wanted
    wanted = flip @ wanted if world == "NED" else wanted
    rest = f'frame = "{frame}"\nworld = "{world}"\ninverse = {str(inverse).lower()}\n'
    a, b, c = np.rad2deg(angles)
    euler = flight(
        tmp_path,
        f"t,a,b,c\n0,{a},{b},{c}\n1,{a},{b},{c}\n",
        TIME + '[quaternion]\ncolumns = ["a", "b", "c"]\nunit = "deg"\n' + rest,
    )
    np.testing.assert_allclose(
        matrix(euler["quaternion"].values[0]), wanted, atol=1e-12
    )
    half = np.arccos((np.trace(given) - 1.0) / 2.0) / 2.0
    axis = np.array(
        [
            given[2, 1] - given[1, 2],
            given[0, 2] - given[2, 0],
            given[1, 0] - given[0, 1],
        ]
    )
    x, y, z = np.sin(half) * axis / np.linalg.norm(axis)
    given = np.array([x, y, z, np.cos(half)]).tolist()
    first, second = (",".join(map(repr, row)) for row in (given, [-c for c in given]))
    rows = f"t,x,y,z,w\n0,{first}\n1,{second}\n"
    found = flight(
        tmp_path,
        rows,
        TIME + '[quaternion]\ncolumns = ["x", "y", "z", "w"]\norder = "xyzw"\n' + rest,
    )["quaternion"]
    np.testing.assert_allclose(matrix(found.values[0]), wanted, atol=1e-12)
    # no jump of the sign
    np.testing.assert_allclose(found.values[0], found.values[1], atol=1e-12)


def test_a_velocity_in_base_axes_is_turned_by_the_attitude(tmp_path: Path) -> None:
    mapping = (
        TIME
        + '[quaternion]\ncolumns = ["a", "b", "c"]\nunit = "deg"\n[velocity]\ncolumns ='
        ' ["u", "v", "w"]\nframe = "FRD"\n'
    )
    found = flight(tmp_path, "t,a,b,c,u,v,w\n0,0,0,90,1,2,3\n1,0,0,90,1,2,3\n", mapping)
    np.testing.assert_allclose(found["velocity"].values, [[2, 1, -3]] * 2, atol=1e-12)


def test_rows_without_numbers_and_times_that_do_not_rise_are_left_out_and_counted(
    tmp_path: Path,
) -> None:
    text = (
        "t,p,q,r,v\n0,1,1,1,8\n1,2,,2,\n2,nan,3,3,7\n1.5,9,9,9,\n3,4,4,4,\n"
        '900,5,5,x,\n4,"6",6,6,\n5,7,7,7\n\n'
    )
    found = flight(tmp_path, text, TIME + GYRO + '[voltage]\ncolumns = ["v"]\n')
    np.testing.assert_allclose(found["gyro"].time, [0, 1.5, 3, 4])
    np.testing.assert_allclose(found["voltage"].time, [0, 2])
    assert found.notes == (
        "file: 1 of 8 rows have not the 5 cells of the head and count as empty.",
        "file: 1 cells are no numbers and count as empty.",
        "gyro: 4 of 8 rows are without numbers and are left out.",
        "voltage: 6 of 8 rows are without numbers and are left out.",
    )


@pytest.mark.parametrize("cells", ["0.49,1,3,7", '0.49,1,2,3,"4",7'])
def test_a_row_that_lost_or_won_a_cell_is_not_read_shifted(
    tmp_path: Path, cells: str
) -> None:
    rows = [f"{k * 0.01:.2f},1,2,3,7" for k in range(100)]
    rows[49] = cells
    found = flight(tmp_path, "\n".join(["t,p,q,r,v", *rows, "", ""]), TIME + GYRO)
    assert {tuple(row) for row in found["gyro"].values} == {(1.0, 2.0, 3.0)}
    assert found["gyro"].time.size == 99
    assert (
        found.notes[0]
        == "file: 1 of 100 rows have not the 5 cells of the head and count as empty."
    )
    ended = flight(
        tmp_path,
        "\n".join(["t,p,q,r,v", *(f"{row}," for row in rows[:40])]),
        TIME + GYRO,
    )
    # a separator at the end of each row is no cell
    assert ended["gyro"].time.size == 40
    assert ended.notes == ()


@pytest.mark.parametrize("every", [1, 2, 3])
def test_a_quantity_of_every_so_many_rows_is_said_to_be_one(
    tmp_path: Path, every: int
) -> None:
    rows = [f"{k * 0.005:.3f},1,2,3,{7 if k % every == 0 else ''}" for k in range(120)]
    found = flight(
        tmp_path,
        "\n".join(["t,p,q,r,v", *rows]),
        TIME + GYRO + '[voltage]\ncolumns = ["v"]\n',
    )
    assert found["voltage"].time.size == 120 // every
    words = (
        f"voltage: has numbers in {120 // every} of 120 rows only,"
        f" {200.0 / every:.4g} Hz."
    )
    assert found.notes == ((words,) if every > 1 else ())


def test_a_slower_quantity_in_the_rows_of_a_faster_one_has_its_own_rate(
    tmp_path: Path,
) -> None:
    rows = [
        f"{k * 0.005:.3f},1,2,3,{k if k % 4 == 0 and k != 80 else ''}"
        for k in range(400)
    ]
    found = flight(
        tmp_path,
        "\n".join(["t,p,q,r,v", *rows]),
        TIME + GYRO + '[voltage]\ncolumns = ["v"]\n',
    )
    assert found["voltage"].rate == pytest.approx(50.0)
    assert found.notes == (
        "voltage: has numbers in 99 of 400 rows only, 50 Hz.",
        "voltage: 1 of 100 rows are without numbers and are left out.",
    )


def test_columns_that_no_mapping_names_are_unused_and_may_hold_anything(
    tmp_path: Path,
) -> None:
    found = flight(
        tmp_path, "t,p,q,r,,x,x,y\n0,1,2,3,a,b,c,d\n1,1,2,3,a,b,c,d\n", TIME + GYRO
    )
    assert (found.unused, found.notes) == (("x", "y"), ())


def test_a_stamp_far_ahead_does_not_take_the_rest_with_it(tmp_path: Path) -> None:
    found = flight(
        tmp_path,
        "t,p,q,r\n0,1,1,1\n1e9,2,2,2\n2,3,3,3\n2,3,3,3\n3,4,4,4\n",
        TIME + GYRO,
    )
    np.testing.assert_allclose(found["gyro"].time, [0, 2, 3])
    assert "2 of 5 rows are left out" in found.notes[0]


@pytest.mark.parametrize(
    ("name", "least"),
    [("nanobench/B9_trefoil_medium_rep4", 0.55), ("gazebo_iris/quadrotor_model", 0.9)],
)
def test_published_flights_obey_newton_s_and_euler_s_laws(
    name: str, least: float
) -> None:
    """The derivative of the velocity is specific force and gravity; that of the
    attitude the angular rate.
    """
    found = load_flight(FLIGHTS / f"{name}_from_20_to_23_s.csv")
    turns = np.array([matrix(q) for q in found["quaternion"].values])
    time = found["velocity"].time
    force = np.einsum("nij,nj->ni", turns, found["accelerometer"].values) - [
        0.0,
        0.0,
        9.81,
    ]
    grown = np.gradient(found["velocity"].values, time, axis=0)
    mean = [np.convolve(each, np.ones(9) / 9, "same") for each in (*force.T, *grown.T)]
    assert min(np.corrcoef(mean[k], mean[k + 3])[0, 1] for k in range(3)) > least
    steps = np.einsum("nji,njk->nik", turns[:-1], turns[1:])
    rates = (
        np.stack([steps[:, 2, 1], steps[:, 0, 2], steps[:, 1, 0]], axis=1)
        / np.diff(time)[:, None]
    )
    for k in range(3):
        smooth = np.convolve(rates[:, k], np.ones(9) / 9, "same")
        assert np.corrcoef(smooth, found["gyro"].values[:-1, k])[0, 1] > least
    assert found.unused


@pytest.mark.parametrize(
    ("mapping", "words"),
    [
        ("", "quantities = none: must be"),
        ("[gyr]\ncolumns = []\n", "gyr: is it .gyro.\\? must be one of|gyr: .*gyro"),
        ("[gyro]\n", "gyro.columns: is missing"),
        (
            '[gyro]\ncolumns = ["p", "q"]\n',
            r"gyro.columns = \['p', 'q'\]: must be 3 names",
        ),
        ('[gyro]\ncolumns = ["p", "q", "-q"]\n', "must name each column once"),
        ('[gyro]\ncolumns = ["p", "q", 3]\n', "must be a list of names"),
        (f'{GYRO}unit = "turns"\n', "gyro.unit = 'turns': must be"),
        (f'{GYRO}frame = "NED"\n', "gyro.frame = 'NED': must be"),
        (f"{GYRO}low = 3\n", "gyro.low = 3: unknown field"),
        (
            '[quaternion]\ncolumns = ["a", "b"]\n',
            "must be 4 names, or 3 of roll, pitch and yaw",
        ),
        (
            '[rotor_commands]\ncolumns = ["a"]\nlow = 1\n',
            "rotor_commands.high = 1: must differ from low",
        ),
        (
            '[rotor_commands]\ncolumns = ["a"]\nunit = "percent"\n',
            (
                "rotor_commands.unit = 'percent': must be left out: low and high tell"
                " its range"
            ),
        ),
        (
            '[velocity]\ncolumns = ["a", "b", "c"]\nframe = "FLU"\nworld = "NED"\n',
            "must be left out beside 'world'",
        ),
        ('[time]\nunit = "min"\n', "time.unit = 'min': must be"),
        ("gyro = 3\n", "gyro = 3: must be a table"),
    ],
)
def test_a_wrong_mapping_is_one_line(tmp_path: Path, mapping: str, words: str) -> None:
    (tmp_path / "columns.toml").write_text(mapping)
    with pytest.raises(ValueError, match=words) as error:
        read_columns(tmp_path / "columns.toml")
    assert str(error.value).startswith(str(tmp_path / "columns.toml"))
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("text", "mapping", "words"),
    [
        ("", TIME + GYRO, "head = ''"),
        ("t,p,q,r,\0\n1,2,3,4,5\n", TIME + GYRO, "must be the names of the columns"),
        (
            "t,p,q,r,\ufffd\n1,2,3,4,5\n",
            TIME + GYRO,
            "must be the names of the columns",
        ),
        ("t,p,q,r\n", TIME + GYRO, "rows = 0"),
        ("t,p,q,r\n1,2,3,4\n", GYRO, "time.column: is missing; there are t, p, q, r"),
        ("t,p,q\n1,2,3\n", TIME + GYRO, "gyro.columns = 'r': must be one of"),
        ("s,p,q,r\n1,2,3,4\n", TIME + GYRO, "time.column = 't': must be one of"),
        ("t,p,q,r,p\n1,2,3,4,5\n", TIME + GYRO, "head = 'p': names 2 columns"),
        ("t,p,q,r\n1,,3,4\n", TIME + GYRO, "channels = none"),
        (
            "t,p,q,r\n3,1,1,1\n2,1,1,1\n1,1,1,1\n",
            TIME + GYRO,
            "time of gyro: rises in 1 of 3 rows",
        ),
        (
            "t,p,q,r\n1,2,3,4\n",
            TIME + GYRO + 'topic = "imu"\n',
            "gyro.topic = 'imu': must be left out",
        ),
    ],
)
def test_a_table_that_does_not_fit_is_one_line(
    tmp_path: Path, text: str, mapping: str, words: str
) -> None:
    with pytest.raises(ValueError, match=words) as error:
        flight(tmp_path, text, mapping)
    assert "\n" not in str(error.value)


def test_a_table_without_a_mapping_lists_its_columns(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("t;p\n1;2\n")
    with pytest.raises(
        ValueError, match=r"columns: are missing; a columns.toml must map these: t, p"
    ):
        load_flight(tmp_path / "a.csv")
    with pytest.raises(ValueError, match="no such file"):
        load_flight(tmp_path / "b.csv")
    with pytest.raises(ValueError, match="no such file"):
        load_flight(tmp_path / "a.csv", "none.toml")


def test_the_example_of_the_documentation_is_read() -> None:
    from skyarm.flight_data import columns_file

    text = (columns_file.__doc__ or "").partition("::\n")[2]
    found = columns_from(read_toml(text.encode()))
    assert set(found.signals) == {
        "gyro",
        "accelerometer",
        "quaternion",
        "rotor_commands",
    }


def test_the_mapping_of_the_page_reads_a_table(tmp_path: Path) -> None:
    page = (Path(__file__).parents[2] / "docs" / "identification.md").read_text("utf-8")
    (mapping,) = re.findall(r"```toml\n(.*?)```", page, re.DOTALL)
    head = "t,p,q,r,ax,ay,az,qx,qy,qz,qw,vn,ve,vd,m1,m2,m3,m4,q1,q2,tau1,tau2\n"
    row = "0,0,90,0,0,1,0,0,0,1,0.1,0.2,0.3,1000,1500,2000,1250,90,0,0.1,-0.2\n"
    rows = f"0,{row}10000,{row}"
    found = flight(tmp_path, head + rows, mapping)
    assert found.unused == ()
    assert found["gyro"].time == pytest.approx([0.0, 0.01])
    assert found["gyro"].values[0] == pytest.approx([0.0, 0.0, np.pi / 2.0])
    assert found["accelerometer"].values[0] == pytest.approx([0.0, 0.0, 9.80665])
    assert found["quaternion"].values[0] == pytest.approx([1.0, 0.0, 0.0, 0.0])
    assert found["velocity"].values[0] == pytest.approx([0.1, -0.2, -0.3])
    assert found["rotor_commands"].values[0] == pytest.approx([0.0, 0.5, 1.0, 0.25])
    assert found["joint_positions"].values[0] == pytest.approx([np.pi / 2.0, 0.0])
    assert found["joint_efforts"].values[0] == pytest.approx([0.1, -0.2])


QUATERNION = '[quaternion]\ncolumns = ["w", "x", "y", "z"]\n'


def test_rows_whose_quaternion_is_no_rotation_are_left_out_and_the_first_is_positive(
    tmp_path: Path,
) -> None:
    rows = ["0,-2,0,0,0", "1,0,0,0,0", "2,-1,-1e-9,0,0", "3,1e9,0,0,0", "4,1,0,0,0"]
    found = flight(tmp_path, "\n".join(["t,w,x,y,z", *rows]), TIME + QUATERNION)
    np.testing.assert_allclose(
        found["quaternion"].values,
        [[1, 0, 0, 0], [1, 1e-9, 0, 0], [1, 0, 0, 0]],
        atol=1e-12,
    )
    assert found.notes == (
        "quaternion: 2 of 5 rows are without numbers and are left out.",
    )
    text = "t,w,x,y,z,p,q,r\n0,0,0,0,0,1,2,3\n1,0,0,0,0,1,2,3\n"
    empty = flight(tmp_path, text, TIME + QUATERNION + GYRO)
    assert "quaternion" not in empty
    assert (
        empty.notes[-1]
        == "quaternion: no row of w, x, y, z holds numbers, so that the channel is left"
        " out."
    )


def test_a_velocity_in_base_axes_is_turned_where_there_is_an_attitude(
    tmp_path: Path,
) -> None:
    half = 0.5**0.5
    rows = [
        f"{k},{f'{half},0,0,{half}' if 1 <= k <= 3 else ',,,'},1,0,0" for k in range(6)
    ]
    mapping = (
        TIME + QUATERNION + '[velocity]\ncolumns = ["u", "v", "s"]\nframe = "FLU"\n'
    )
    found = flight(tmp_path, "\n".join(["t,w,x,y,z,u,v,s", *rows]), mapping)
    np.testing.assert_allclose(found["velocity"].values, [[0, 1, 0]] * 3, atol=1e-12)
    # the flight begins with the attitude
    np.testing.assert_allclose(found["velocity"].time, [0, 1, 2])
    assert found["velocity"].source == "u, v, s, turned by the attitude"
    assert (
        found.notes[-1]
        == "velocity: 3 of 6 rows lie outside the attitude and are left out."
    )


def test_a_minus_belongs_to_a_column_that_bears_it(tmp_path: Path) -> None:
    mapping = TIME + '[gyro]\ncolumns = ["-p", "-q", "r"]\n'
    found = flight(tmp_path, "t,-p,q,r\n0,1,2,3\n1,1,2,3\n", mapping)
    np.testing.assert_allclose(found["gyro"].values, [[1, -2, 3]] * 2)


def test_a_source_whose_first_column_never_has_a_number_is_passed_over() -> None:
    full, empty = np.arange(9.0), np.full(9, np.nan)
    tables = {
        "fast": RawTable(columns={"a": empty, "b": full}, time=0.01 * full),
        "slow": RawTable(columns={"a": full, "b": full}, time=0.1 * full),
    }
    fast, slow = (QuantitySource(columns=("a", "b"), topic=name) for name in tables)
    assert _fastest(tables, (fast, slow)) is slow
    assert _fastest(tables, (fast,)) is None


def messages(
    rates: dict[str, float], seconds: float, seed: int = 0
) -> tuple[list[str], dict[str, np.ndarray]]:
    """Rows of a table in which each message has its own rate, as converters of logs
    write them; and their times.
    """
    noise = np.random.default_rng(seed)
    begins = 0.001 * np.arange(len(rates))
    every = {
        each: np.arange(t, seconds, 1.0 / rate).round(6)
        for t, (each, rate) in zip(begins, rates.items(), strict=True)
    }
    rows = [
        (time, [f"{noise.normal():.4f}" if name == each else "" for each in rates])
        for name, times in every.items()
        for time in times
    ]
    return [f"{time:.6f},{','.join(cells)}" for time, cells in sorted(rows)], every


def test_a_table_of_several_messages_has_each_at_its_own_rate_and_loses_none(
    tmp_path: Path,
) -> None:
    rows, times = messages({"p": 100.0, "m": 50.0, "v": 37.0}, 8.0)
    mapping = (
        TIME + '[rotor_commands]\ncolumns = ["m"]\n[rotor_speeds]\ncolumns ='
        ' ["p"]\n[voltage]\ncolumns = ["v"]\n'
    )
    found = flight(tmp_path, "\n".join(["t,p,m,v", *rows]), mapping)
    read = pd.read_csv(tmp_path / "flight.csv")
    for name, column in (
        ("rotor_speeds", "p"),
        ("rotor_commands", "m"),
        ("voltage", "v"),
    ):
        there = read[["t", column]].dropna()
        np.testing.assert_array_equal(found[name].values[:, 0], there[column])
        np.testing.assert_allclose(found[name].time, there["t"], rtol=0.0, atol=1e-9)
        assert found[name].time.size == times[column].size
    assert not [each for each in found.notes if "without numbers" in each]


def test_rows_that_a_message_lacks_are_told_from_rows_of_other_messages(
    tmp_path: Path,
) -> None:
    rows, _ = messages({"p": 100.0, "v": 37.0}, 8.0)
    lost = {f"{0.01 * k:.6f}" for k in (200, 201, 500)}
    rows = [
        f"{row.split(',')[0]},," if row.split(",")[0] in lost else row for row in rows
    ]
    # the logger paused: no row is lost
    rows = [row for row in rows if not 5.0 < float(row.split(",")[0]) < 6.0]
    mapping = TIME + '[rotor_speeds]\ncolumns = ["p"]\n[voltage]\ncolumns = ["v"]\n'
    found = flight(tmp_path, "\n".join(["t,p,v", *rows]), mapping)
    assert (
        "rotor_speeds: 3 of 701 rows are without numbers and are left out."
        in found.notes
    )


@pytest.mark.parametrize("separator", [",", ";", "\t", " ", ", ", "  "])
@pytest.mark.parametrize("ends", ["\n", "\r\n"])
def test_the_separator_is_what_cuts_head_and_rows_alike(
    tmp_path: Path, separator: str, ends: str
) -> None:
    names = ["time (us)", "gyroADC[0] (deg/s)", "b c d e", "q;r", "volt"]
    names = [f'"{each}"' if separator.strip() in {"", ";"} else each for each in names]
    mapping = (
        TIME.replace('"t"', '"time (us)"')
        + '[gyro]\ncolumns = ["gyroADC[0] (deg/s)", "b c d e",'
        ' "q;r"]\n[voltage]\ncolumns = "volt"\n'
    )
    rows = [separator.join((f"{k}", f"{k}.25", "-1e-3", "7", "12.5")) for k in range(9)]
    found = flight(tmp_path, ends.join([separator.join(names), *rows, ""]), mapping)
    read = pd.read_csv(
        tmp_path / "flight.csv", sep=separator.strip() or r"\s+", skipinitialspace=True
    )
    np.testing.assert_array_equal(found["gyro"].values, read.iloc[:, 1:4])
    np.testing.assert_array_equal(found["voltage"].values, read.iloc[:, 4:])
    assert found.notes == ()


def test_decimal_commas_are_numbers_in_a_table_that_they_do_not_separate(
    tmp_path: Path,
) -> None:
    text = "t;p;q;r\n0;0,25;-1,5e-3;7\n0,01;1,75;2;3\n"
    found = flight(tmp_path, text, TIME + GYRO)
    read = pd.read_csv(tmp_path / "flight.csv", sep=";", decimal=",")
    np.testing.assert_array_equal(found["gyro"].values, read[["p", "q", "r"]])
    np.testing.assert_array_equal(found["gyro"].time, read["t"])
    assert found.notes == ("file: 4 cells have a decimal comma.",)
    thousands = flight(tmp_path, 't,p,q,r\n0,"1,234",2,3\n1,1,2,3\n', TIME + GYRO)
    assert thousands["gyro"].time.size == 1


@pytest.mark.parametrize(
    ("cell", "time"),
    [
        ("[0.1, 0.2]", "3"),
        ("1", "01.05.2024 10:00:00"),
        ("1", "10.00.00,5"),
        ("nothing", "3"),
    ],
)
def test_a_column_without_any_number_is_named_with_its_first_cell(
    tmp_path: Path, cell: str, time: str
) -> None:
    text = f't;p;q;r\n{time};"{cell}";2;3\n{time};"{cell}";2;3\n'
    name, shown = ("t", time) if cell == "1" else ("p", cell)
    with pytest.raises(
        ValueError,
        match=re.escape(
            f"{name} = '{shown}': must be a number in each cell; split lists"
        ),
    ):
        flight(tmp_path, text, TIME + GYRO)


def test_counts_are_scaled_before_their_unit(tmp_path: Path) -> None:
    mapping = (
        TIME + '[accelerometer]\ncolumns = ["x", "y", "z"]\nunit = "g"\nscale ='
        ' 0.00048828125\n[rotor_commands]\ncolumns = ["m"]\nscale = 0.1\nlow ='
        " 100\nhigh = 200\n"
    )
    found = flight(
        tmp_path, "t,x,y,z,m\n0,1024,-2048,4096,1500\n1,0,0,2048,2000\n", mapping
    )
    np.testing.assert_allclose(
        found["accelerometer"].values, 9.80665 * np.array([[0.5, -1, 2], [0, 0, 1]])
    )
    np.testing.assert_allclose(found["rotor_commands"].values, [[0.5], [1.0]])


def test_several_files_of_one_clock_are_one_flight(tmp_path: Path) -> None:
    ticks = {"imu": np.arange(0, 900, 10), "motor": np.arange(3, 900, 20)}
    for name, stamps in ticks.items():
        frame = pd.DataFrame(
            {"t": stamps, **{f"{name}.{k}": np.sin(stamps + k) for k in range(3)}}
        )
        frame.to_csv(tmp_path / f"{name}.csv", index=False)
    (tmp_path / "columns.toml").write_text(
        '[time]\ncolumn = "t"\nunit = "ms"\n[gyro]\ncolumns = ["imu.0", "imu.1",'
        ' "imu.2"]\n[rotor_commands]\nfile = "motor.csv"\ncolumns = ["motor.0",'
        ' "motor.1"]\n'
    )
    found = load_flight(tmp_path / "imu.csv")
    np.testing.assert_allclose(found["gyro"].time, 1e-3 * ticks["imu"])
    np.testing.assert_allclose(found["rotor_commands"].time, 1e-3 * ticks["motor"])
    np.testing.assert_allclose(
        found["rotor_commands"].values[:, 1], np.sin(ticks["motor"] + 1)
    )
    assert found["rotor_commands"].source == "motor.csv: motor.0, motor.1"
    mapping = (tmp_path / "columns.toml").read_text()
    for wrong, words in (
        ("none.csv", "file = 'none.csv': no such file"),
        ("imu.csv", "columns = 'motor.0': "),
    ):
        (tmp_path / "columns.toml").write_text(mapping.replace("motor.csv", wrong))
        with pytest.raises(ValueError, match=re.escape(words)):
            load_flight(tmp_path / "imu.csv")


def test_of_each_file_the_columns_that_are_mapped_to_it_count_and_it_is_named(
    tmp_path: Path,
) -> None:
    """Names of one file may be texts, or stand twice, in another one."""
    stamps = np.arange(30) * 0.01
    rows = [f"{t:.2f},1,2,3" for t in stamps]
    (tmp_path / "a.csv").write_text(
        "t,x,y,z,n,n\n" + "".join(f"{row},world,odom\n" for row in rows)
    )
    (tmp_path / "b.csv").write_text("t,n,m,o\n" + "\n".join([*rows[:-1], "0.29,1,2,-"]))
    (tmp_path / "columns.toml").write_text(
        '[time]\ncolumn = "t"\n[gyro]\ncolumns = ["x", "y", "z"]\n'
        '[accelerometer]\nfile = "b.csv"\ncolumns = ["n", "m", "o"]\n'
    )
    found = load_flight(tmp_path / "a.csv")
    assert (found["gyro"].time.size, found["accelerometer"].time.size) == (30, 29)
    assert "b.csv: 1 cells are no numbers and count as empty." in found.notes
    (tmp_path / "b.csv").write_text(
        "t,n,m,o\n" + "\n".join(row.replace("3", "-") for row in rows[:3])
    )
    with pytest.raises(
        ValueError, match=r"b\.csv: o = '-': must be a number in each cell"
    ):
        load_flight(tmp_path / "a.csv")


def test_only_a_table_of_text_may_name_another_file() -> None:
    gyro = '[gyro]\ncolumns = ["gyro.x", "gyro.y", "gyro.z"]\nfile = "other.csv"\n'
    log = FLIGHTS / "crazyflie" / "log15_from_20_to_23_s"
    with pytest.raises(
        ValueError,
        match=r"gyro.file = 'other.csv': must be left out of a format that is no table",
    ):
        load_flight(log, columns_from(read_toml(gyro.encode())))


def table_of_times(times: list[str]) -> str:
    return "\n".join(["t,p,q,r", *(f"{time},{k},2,3" for k, time in enumerate(times))])


BOOT, DATE = "1970-01-01T00:00:30", "2024-05-01T10:00:00"


@pytest.mark.parametrize(
    ("unit", "begin", "rate"),
    # steps of 1 since boot may be s, too: they are asked for
    [
        case
        for case in product(["s", "ms", "us", "ns"], [BOOT, DATE], [25, 200, 1000])
        if case != ("ms", BOOT, 1000)
    ],
)
def test_a_unit_of_time_that_is_not_stated_is_that_whose_rate_can_be_true(
    tmp_path: Path, unit: str, begin: str, rate: int
) -> None:
    """Times are pandas' own since 1970."""
    stamps = pd.date_range(begin, periods=60, freq=pd.Timedelta(1 / rate, "s"))
    since = (
        (stamps - pd.Timestamp(0)).total_seconds()
        if unit == "s"
        else (stamps - pd.Timestamp(0)) // pd.Timedelta(1, unit)
    )
    found = flight(tmp_path, table_of_times([f"{each}" for each in since]), TIME + GYRO)
    np.testing.assert_allclose(found["gyro"].time, np.arange(60) / rate, atol=1e-6)
    assert found.facts["start"] == pytest.approx(stamps[0].timestamp(), abs=1e-6)
    assert (
        f"time: is taken for {unit}, as its steps are" in " ".join(found.notes)
    ) == (unit != "s")
    stated = flight(
        tmp_path,
        table_of_times([f"{each}" for each in since]),
        f'{TIME}unit = "{unit}"\n{GYRO}',
    )
    np.testing.assert_array_equal(stated["gyro"].time, found["gyro"].time)
    assert stated.notes == ()


@pytest.mark.parametrize(
    ("step", "unit", "words"),
    [
        (
            100,
            "",
            r"time.unit: is missing; steps of 100 may be ms: 10 Hz, us: 1e\+04 Hz$",
        ),
        (1, "", r"time.unit: is missing; steps of 1 may be s: 1 Hz, ms: 1000 Hz$"),
        (
            0.25,
            "",
            r"time.unit: is missing; steps of 0.25 may be s: 4 Hz, ms: 4000 Hz$",
        ),
        (
            5000,
            "s",
            r"time.unit = 's': cannot be true of steps of 5000; try us: 200 Hz$",
        ),
        (
            5000,
            "ms",
            r"time.unit = 'ms': cannot be true of steps of 5000; try us: 200 Hz$",
        ),
        (
            0.005,
            "us",
            r"time.unit = 'us': cannot be true of steps of 0.005; try s: 200 Hz$",
        ),
    ],
)
def test_times_of_which_no_unit_or_two_can_be_true_are_one_line(
    tmp_path: Path, step: float, unit: str, words: str
) -> None:
    stated = f'unit = "{unit}"\n' if unit else ""
    with pytest.raises(ValueError, match=r"columns\.toml: " + words):
        flight(
            tmp_path,
            table_of_times([f"{step * k}" for k in range(60)]),
            TIME + stated + GYRO,
        )


def test_a_date_tells_two_units_apart(tmp_path: Path) -> None:
    # ms and us since 1970
    for begin, rate in ((1_714_557_600_000, 10.0), (1_714_557_600_000_000, 10_000.0)):
        found = flight(
            tmp_path,
            table_of_times([f"{begin + 100 * k}" for k in range(60)]),
            TIME + GYRO,
        )
        np.testing.assert_allclose(found["gyro"].time, np.arange(60) / rate, atol=1e-6)
        assert found.facts["start"] == pytest.approx(1_714_557_600.0)


def test_slow_times_in_seconds_stay_and_few_rows_are_not_judged(tmp_path: Path) -> None:
    for step, rows, stated in ((0.15, 60, ""), (1.0, 9, ""), (1.5, 60, 'unit = "s"\n')):
        found = flight(
            tmp_path,
            table_of_times([f"{step * k}" for k in range(rows)]),
            TIME + stated + GYRO,
        )
        np.testing.assert_allclose(
            found["gyro"].time, step * np.arange(rows), atol=1e-9
        )


@pytest.mark.parametrize(
    "written",
    [
        "{:%Y-%m-%dT%H:%M:%S.%f}Z",
        "{:%Y-%m-%d %H:%M:%S.%f}",
        "{:%Y-%m-%dT%H:%M:%S.%f}000+00:00",
        '"{:%Y-%m-%d %H:%M:%S,%f}"',
    ],
)
@pytest.mark.parametrize("ends", ["\n", "\r\n", "\r"])
def test_dates_of_iso_8601_are_times_beside_pandas(
    tmp_path: Path, written: str, ends: str
) -> None:
    stamps = pd.date_range(
        "2024-05-01T10:00:00.5", periods=60, freq=pd.Timedelta(5, "ms")
    )
    text = table_of_times([written.format(each) for each in stamps]).replace("\n", ends)
    for unit in ("", 'unit = "us"\n'):
        found = flight(tmp_path, text, TIME + unit + GYRO)
        np.testing.assert_allclose(
            found["gyro"].time, (stamps - stamps[0]).total_seconds(), atol=2e-6
        )
        assert found.facts["start"] == pytest.approx(stamps[0].timestamp(), abs=2e-6)
        assert found.notes == ()


def test_dates_of_another_zone_and_times_of_a_day_are_read(tmp_path: Path) -> None:
    stamps = pd.date_range(
        "2024-05-01T10:00:00",
        periods=20,
        freq=pd.Timedelta(5, "ms"),
        tz="Europe/Madrid",
    )
    found = flight(
        tmp_path, table_of_times([each.isoformat() for each in stamps]), TIME + GYRO
    )
    assert found.facts["start"] == pytest.approx(stamps[0].timestamp(), abs=1e-6)
    found = flight(
        tmp_path,
        table_of_times([f"{each:%H:%M:%S.%f}" for each in stamps]),
        TIME + GYRO,
    )
    np.testing.assert_allclose(found["gyro"].time, 0.005 * np.arange(20), atol=1e-6)
    assert found.facts["start"] == pytest.approx(36_000.0)


def test_a_table_as_windows_writes_it_is_read_beside_pandas(tmp_path: Path) -> None:
    """Text of 16 bits, a line that names the separator, decimal commas and dates."""
    rows = [f"2024-05-01 10:00:00,{5 * k:03d};{k},25;-2,5;3" for k in range(60)]
    text = "\r\n".join(["t;p;q;r", *rows])
    mapping = tmp_path / "columns.toml"
    mapping.write_text(TIME + GYRO)
    (tmp_path / "flight.csv").write_bytes(f"sep=;\r\n{text}".encode("utf-16"))
    found, wanted = (
        load_flight(tmp_path / "flight.csv"),
        pd.read_csv(io.StringIO(text), sep=";", decimal=","),
    )
    np.testing.assert_array_equal(found["gyro"].values, wanted[["p", "q", "r"]])
    np.testing.assert_allclose(found["gyro"].time, 0.005 * np.arange(60), atol=1e-6)


def test_names_in_the_letters_of_western_windows_are_read_beside_pandas(
    tmp_path: Path,
) -> None:
    head, rows = (
        "t [µs],ω,°/s,q".replace("ω", "p±"),
        [f"{5000 * k},{k % 7},2.5,-1" for k in range(60)],
    )
    path, mapping = tmp_path / "flight.csv", tmp_path / "columns.toml"
    path.write_bytes("\n".join((head, *rows)).encode("cp1252"))
    mapping.write_text(
        '[time]\ncolumn = "t [µs]"\nunit = "us"\n[gyro]\ncolumns = ["p±", "°/s",'
        ' "q"]\n',
        "utf-8",
    )
    found, wanted = load_flight(path), pd.read_csv(path, encoding="cp1252")
    np.testing.assert_array_equal(found["gyro"].values, wanted[["p±", "°/s", "q"]])
    np.testing.assert_allclose(found["gyro"].time, 1e-6 * wanted["t [µs]"])
    # one damaged cell makes no other letters of the rest
    path.write_bytes(
        path.read_bytes().decode("cp1252").encode().replace(b",2.5,", b",\xff,", 1)
    )
    assert len(load_flight(path)["gyro"].time) == 59
