"""``skyarm identify FLIGHT --vehicle START``: from files to numbers, a vehicle file
that flies, and one-line errors.
"""

from __future__ import annotations

import csv
import dataclasses
import json
import math
import re
import tomllib
from pathlib import Path

import numpy as np
import pytest

import skyarm as library
from skyarm.cli.tune_command import tuning_inputs
from skyarm.identify import identify_files, identify_flights
from skyarm.identify.held_out_errors import (
    CURVE,
    HOLD,
    HORIZONS,
    IDENTIFIED,
    HeldOut,
    HorizonErrors,
    OneStep,
)
from skyarm.identify.identified_file import identified_file
from skyarm.identify.identified_numbers import Identified, IdentifiedNumber
from skyarm.identify.identified_parts import IdentifiedSurroundings
from skyarm.identify.identified_report import correlated_pairs, prediction_lines
from skyarm.identify.identify_command import known_numbers
from skyarm.identify.identify_flights import known_of_search
from skyarm.identify.log_checks import check_log
from skyarm.identify.unknowns import second_moments
from skyarm.log.flight_log import rows_of
from skyarm.log.formats import save_log
from skyarm.reference import Constant, Sum, Trajectory
from skyarm.scenario.scenario_record import Delays, NamedSensor
from skyarm.sensing.channel import Channel as Errors
from skyarm.sensing.sensor_kinds import Imu
from skyarm.studies.tune.excitation import of_vehicle, sine_from_rest
from skyarm.vehicle.vehicle_files import list_vehicles
from skyarm.vehicle.vehicle_text import vehicle_text
from support.commands import refused, skyarm
from support.flights import unheard

pytest.importorskip("scipy", reason="needs the extra 'identify'")

START = library.load_vehicle("hummingbird")
FACTOR = 1.1

AXES = [
    f"{name}.{axis}=0"
    for name in ("place", "torque", "offset", "drag.area")
    for axis in "xyz"
]
KNOWN = (
    *AXES,
    "base.inertia.xy=0",
    "base.inertia.xz=0",
    "base.inertia.yz=0",
    "rotors.inertia=0",
    "drift=0",
)
"""Numbers that are not searched, so that the search is short."""


@pytest.fixture(scope="module")
def flights(tmp_path_factory):
    """A flight of a vehicle whose rotors lift a tenth more than the start vehicle's."""
    folder: Path = tmp_path_factory.mktemp("flights")
    stronger = tuple(
        dataclasses.replace(each, thrust_coefficient=FACTOR * each.thrust_coefficient)
        for each in START.rotors
    )
    (folder / "truth.toml").write_text(
        vehicle_text(dataclasses.replace(START, rotors=stronger))
    )
    path = Trajectory(
        x=sine_from_rest(0.3, 0.6, 0.0),
        y=sine_from_rest(0.4, 0.8, 2.0),
        # below g: its rotors never rest
        z=Sum((Constant(5.0), sine_from_rest(0.17, 1.1, 1.0))),
        yaw=sine_from_rest(0.5, 0.7, 1.0),
    )
    noisy = Imu(gyro=Errors(sigma=0.003), accelerometer=Errors(sigma=0.03))
    base, imu = of_vehicle(START), NamedSensor(name="imu", sensor=noisy)
    plant = dataclasses.replace(
        base.plant, vehicle=library.load_vehicle(folder / "truth.toml")
    )
    delays = Delays(measurement=0.005, command=0.004)
    log = library.run(
        dataclasses.replace(
            base,
            controller=unheard(base),
            plant=plant,
            reference=path,
            duration=6.4,
            delays=delays,
            sensors=(imu,),
        )
    )
    assert log.status == "completed"
    half = int(np.searchsorted(log.time, 3.4))
    save_log(rows_of(log, slice(0, half)), folder / "swings.npz")
    save_log(rows_of(log, slice(half, None)), folder / "aside.npz")
    return folder


@pytest.fixture(autouse=True)
def here(flights, monkeypatch):
    monkeypatch.chdir(flights)


@pytest.fixture(scope="module")
def identified(flights):
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(flights)
        words = (
            "swings.npz",
            "--vehicle",
            "hummingbird",
            "--held-out",
            "aside.npz",
            "--out",
            "found",
        )
        return skyarm(
            "identify", *words, *(word for each in KNOWN for word in ("--known", each))
        )


def test_a_flight_gives_numbers_with_intervals_and_a_vehicle_file(identified):
    assert identified.code == 0
    progress = [
        line
        for line in identified.err.splitlines()
        if line.startswith("skyarm: identify hummingbird: ")
    ]
    assert identified.err.splitlines() == progress
    document = json.loads(Path("found/identified.json").read_text())
    numbers = {each["name"]: each for each in document["numbers"]}
    thrust, true = (
        numbers["rotors.thrust_coefficient"],
        FACTOR * START.rotors[0].thrust_coefficient,
    )
    assert thrust["low"] < true < thrust["high"]
    assert thrust["value"] == pytest.approx(true, rel=0.01)
    for each in numbers.values():
        shown = [each[name] is not None for name in ("value", "low", "high")]
        assert shown == [each["reason"] == ""] * 3
        line = next(
            line
            for line in identified.out.splitlines()
            if line.startswith(f"{each['name']} ")
        )
        assert ("not in this data" in line) != (" to " in line)
    assert np.shape(document["correlation"]) == (len(numbers), len(numbers))
    assert document["known"]["torque.x"] == 0.0
    assert not {"torque.x", "drift"} & numbers.keys()


def test_the_vehicle_file_flies(identified):
    found = library.load_vehicle("found/vehicle.toml")
    assert (found.name, found.mass) == ("hummingbird_identified", START.mass)
    thrust = found.rotors[0].thrust_coefficient
    assert thrust == pytest.approx(
        FACTOR * START.rotors[0].thrust_coefficient, rel=0.01
    )
    assert dict(found.sources)["rotor_defaults.thrust_coefficient"].startswith(
        "identified from swings.npz ("
    )
    text = Path("found/vehicle.toml").read_text()
    assert f"thrust_coefficient = {thrust!r}  # {thrust:.4g} (" in text
    Path("fly.toml").write_text(
        'schema = 1\nname = "fly"\nduration = 0.3\n[plant]\nvehicle ='
        ' "found/vehicle.toml"\n[controller]\npreset ='
        ' "rotors_sim_hummingbird"\n[reference]\nbase = { kind = "hover", position ='
        " [0.0, 0.0, 1.0] }\n"
    )
    assert skyarm("run", "fly.toml").code == 0
    assert skyarm("check", "found/vehicle.toml").out.endswith(
        "can fly: no fault, 0 warnings\n"
    )
    assert tuning_inputs("found/vehicle.toml", None).scenario.plant.vehicle == found


def test_held_out_flights_are_predicted_better_than_by_start_vehicle_and_holding(
    identified,
):
    rows = list(csv.DictReader(Path("found/prediction.csv").read_text().splitlines()))
    at = {(row["horizon_s"], row["predictor"]): row for row in rows}
    assert len(rows) == 4 * len(CURVE)
    assert float(at["0.1", "with past"]["attitude_rad"]) < 0.5 * float(
        at["0.1", "hold"]["attitude_rad"]
    )
    for horizon in ("0.1", "0.5", "1"):
        for column in ("position_m", "attitude_rad"):
            model, start, hold = (
                float(at[horizon, each][column])
                for each in ("identified", "start vehicle", "hold")
            )
            assert model < 0.5 * hold, (horizon, column)
            assert column == "attitude_rad" or model < 0.1 * start, (horizon, column)
    assert re.search(
        r"^0\.5 s +identified +\S+ m +\S+ m/s +\S+ rad +\S+ rad/s +\d+$",
        identified.out,
        re.MULTILINE,
    )
    found = json.loads(Path("found/identified.json").read_text())["held_out"]
    steps = {name: each["specific_force"] for name, each in found["one_step"].items()}
    assert steps["identified"] < 0.2 * steps["start vehicle"]
    assert steps["identified"] < 0.2 * steps["hold"]
    assert (found["flights"], found["has_poses"]) == (["aside"], True)
    assert Path("found/prediction.png").read_bytes().startswith(b"\x89PNG")


OFFSET, DRIFT, LATER = 0.037, 50e-6, 60
"""s and s/s of a camera's clock; rows by which a camera's own file begins later."""


POSES = ("position", "velocity", "quaternion")


@pytest.mark.parametrize("files", [1, 2])
def test_motion_capture_of_another_clock_gives_the_numbers_of_the_aligned_log(
    identified, tmp_path, files
):
    """Its stamps are 37 ms early and drift by 50 ppm; offset, drift and intervals are
    said.
    """
    flight = library.load_flight("swings.npz")
    time = flight["quaternion"].time
    stamps = (time - OFFSET + DRIFT * time.mean()) / (1.0 + DRIFT)
    tables = {"t": {"t": time}, "mt": {"mt": stamps}}
    mappings = {"t": "", "mt": ""}
    for name in ("gyro", "accelerometer", "rotor_speed_commands", *POSES):
        clock = "mt" if name in POSES else "t"
        at = np.searchsorted(flight[name].time, time + 1e-9) - 1
        named = {
            f"{name}{k}": column[at] for k, column in enumerate(flight[name].values.T)
        }
        tables[clock] |= named
        mappings[clock] += (
            f'[{name}]\ntime = "{clock}"\ncolumns = {json.dumps(list(named))}\n'
        )
    if files == 1:
        tables, mappings = (
            {"t": tables["t"] | tables["mt"]},
            {"t": "".join(mappings.values())},
        )
    for clock, table in tables.items():
        folder = tmp_path / clock
        folder.mkdir()
        first = LATER if clock == "mt" else 0
        lines = (
            ",".join(map(repr, row))
            for row in np.stack(list(table.values()), axis=1)[first:].tolist()
        )
        (folder / "flight.csv").write_text("\n".join([",".join(table), *lines]))
        (folder / "columns.toml").write_text(mappings[clock])
    words = [
        str(tmp_path / "t/flight.csv"),
        "--vehicle",
        "hummingbird",
        "--out",
        str(tmp_path / "found"),
    ]
    words += ["--join", str(tmp_path / "mt/flight.csv")] if files == 2 else []
    done = skyarm(
        "identify", *words, *(word for each in KNOWN for word in ("--known", each))
    )
    assert done.code == 0, done.err
    # the stamps of each file begin at 0
    offset = OFFSET if files == 1 else time[LATER] - time[0]
    said = (
        "moved to the clock of gyro"
        if files == 1
        else "are of flight, moved to the clock of gyro"
    )
    assert re.search(
        rf"position, velocity, quaternion: {said}: offset \+(36|37|299|300)\.", done.out
    )
    found, same = (
        json.loads(Path(each).read_text())
        for each in (tmp_path / "found/identified.json", "found/identified.json")
    )
    assert same["clocks"] == {}
    clock = found["clocks"]["flight"]
    assert clock["offset"] == pytest.approx(offset, abs=3e-4)
    assert clock["drift"] == pytest.approx(DRIFT, abs=5e-5)
    assert min(clock["offset_error"], clock["drift_error"]) > 0.0
    for one, other in zip(found["numbers"], same["numbers"], strict=True):
        assert one["name"] == other["name"]
        # what the offset's own error leaves
        if other["value"] is not None and one["name"] != "pose_delay":
            assert one["value"] == pytest.approx(
                other["value"], abs=0.1 * (other["high"] - other["low"])
            ), one["name"]


def test_flights_are_identified_in_python_as_well(monkeypatch, without_isolation):
    given = []
    monkeypatch.setattr(
        identify_flights,
        "identify_by_windows",
        lambda *a, **k: given.append((a, k)) or found_with(),
    )
    monkeypatch.setattr(identify_flights, "doubtful_numbers", lambda *_: ())
    flight = library.load_flight("swings.npz")
    library.identify_flights(
        [flight], START, known={"delay": 0.004}, sections=((0.5, 2.9),)
    )
    ((flights, start, options, _), _), *_ = given
    assert (start, options.known) == (START, {"delay": 0.004})
    assert ([each.name for each in flights], options.sections) == (
        ["swings"],
        ((0.5, 2.9),),
    )
    blind = dataclasses.replace(
        flight,
        channels={name: flight[name] for name in flight if name != "accelerometer"},
    )
    with pytest.raises(
        ValueError, match=r"^swings\.npz: accelerometer: is not in this flight"
    ):
        library.identify_flights([blind], START)
    monkeypatch.undo()
    with (
        pytest.warns(UserWarning, match=r"^swings\.npz: acc"),
        pytest.raises(ValueError, match="accelerometer"),
    ):
        library.identify_flights([blind], START, despite_faults=True)


def test_python_weighs_the_vehicle_and_predicts_other_flights(
    monkeypatch, without_isolation
):
    """As the command does: the mass is the whole vehicle's, and drag may act at a
    height of its own.
    """
    given = []
    monkeypatch.setattr(
        identify_flights,
        "identify_by_windows",
        lambda *a, **k: given.append((a, k)) or found_with(),
    )
    monkeypatch.setattr(identify_flights, "doubtful_numbers", lambda *_: ())
    monkeypatch.setattr(
        identify_flights, "predict_held_out", lambda *a, **k: given.append((a, k))
    )
    both = [library.load_flight(name) for name in ("swings.npz", "aside.npz")]
    words = {
        "known": {"mass": 0.8},
        "drag_height": True,
        "held_out": both[1:],
        "gravity": 9.8,
    }
    library.identify_flights(both[:1], START, **words)
    ((_, start, fitted, _), _), ((_, _, aside, of_fit), predicted) = given
    assert float(start.mass) == pytest.approx(0.8)
    assert (fitted.drag_height, fitted.known, fitted.gravity) == (True, {}, 9.8)
    assert [flight.name for flight in aside] == [both[1].name]
    assert [flight.name for flight in predicted["seen"]] == [both[0].name]
    assert of_fit is fitted
    with pytest.raises(ValueError, match=r"^known\.mass = -1\.0: must be above 0"):
        library.identify_flights(both[:1], START, known={"mass": -1.0})


@pytest.mark.filterwarnings(
    "ignore::skyarm.scenario.without_effect.WithoutEffectWarning"
)
def test_a_simulated_flight_without_an_inertial_unit_says_which_sensor_to_name(
    tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    text = (
        'schema = 1\nname = "fly"\nduration = 0.1\n[plant]\nvehicle ='
        ' "hummingbird"\n[controller]\n'
    )
    text += (
        'preset = "rotors_sim_hummingbird"\n[reference]\nbase = { kind = "hover",'
        " position = [0.0, 0.0, 1.0] }\n"
    )
    Path("fly.toml").write_text(text)
    assert skyarm("run", "fly.toml", "--log", "fly.npz").code == 0
    named = '[sensors] imu = { kind = "imu" }'
    done = skyarm("identify", "fly.npz", "--vehicle", "hummingbird")
    refused(
        done,
        "fly.npz: accelerometer: is not in this flight; name an inertial unit in the"
        " scenario",
        named,
    )
    table, _, row = named.partition(" ")
    Path("measured.toml").write_text(f"{text}{table}\n{row}\n")
    assert skyarm("run", "measured.toml", "--log", "measured.npz").code == 0
    assert "accelerometer" in library.load_flight("measured.npz")


def number(name, value, **more):
    return IdentifiedNumber(
        name=name,
        unit="m",
        **{"low": 0.9, "high": 1.1, "start": 2.0, "data_share": 0.9} | more,
        value=value,
    )


def found_with(*numbers, settled=True, correlation=None, counted=(True,)):
    return Identified(
        counted=counted,
        numbers=numbers,
        correlation=(
            np.eye(len(numbers)) if correlation is None else np.array(correlation)
        ),
        vehicle=START,
        surroundings=IdentifiedSurroundings(delay=0.006),
        explained={},
        deviation={},
        settled=settled,
        seconds=3.0,
    )


@pytest.fixture
def without_isolation(monkeypatch):
    """Faults that show without a model only: the search for others takes most of the
    time of a short flight.
    """
    monkeypatch.setattr(
        identify_flights, "find_faults", lambda *given: tuple(check_log(*given))
    )


@pytest.fixture
def instead(monkeypatch, without_isolation):
    """Function that puts a result in place of the search's."""
    return lambda found: monkeypatch.setattr(
        identify_flights, "identify_by_windows", lambda *_, **__: found
    )


def test_a_flight_of_which_nothing_counts_is_named_and_is_no_source(instead, tmp_path):
    instead(found_with(number("base.mass", 0.7), counted=(True, False)))
    done = skyarm(
        "identify",
        "swings.npz",
        "aside.npz",
        "--vehicle",
        "hummingbird",
        "--out",
        str(tmp_path / "new"),
    )
    (line,) = [each for each in done.err.splitlines() if "no part counts" in each]
    assert line.startswith(
        "skyarm: warning: aside.npz: time: no part counts: nowhere 0.25 s in the air"
        " without a gap"
    )
    assert "from swings: " in done.out
    assert "aside" not in (tmp_path / "new" / "vehicle.toml").read_text()


def test_the_json_document_holds_numbers_with_intervals_and_no_value_without(instead):
    hidden = number("base.com.z", 0.1, reason="not in this data")
    instead(found_with(number("delay", 0.006), hidden))
    done = skyarm(
        "identify",
        "swings.npz",
        "--vehicle",
        "hummingbird",
        "--json",
        "--known",
        "mass=0.8",
    )
    document = json.loads(done.out)
    assert (done.code, document["command"], document["start"]) == (
        0,
        "identify",
        "hummingbird",
    )
    shown, unknown = document["numbers"]
    assert (shown["value"], shown["low"], shown["high"], shown["reason"]) == (
        0.006,
        0.9,
        1.1,
        "",
    )
    assert (unknown["value"], unknown["low"], unknown["high"], unknown["reason"]) == (
        None,
        None,
        None,
        hidden.reason,
    )
    assert (document["files"], document["settled"], document["faults"]) == (
        [],
        True,
        [],
    )


@pytest.mark.parametrize(
    ("numbers", "settled", "words"),
    [
        ((number("delay", 0.006),), False, "the search did not settle"),
        (
            (number("delay", 0.006, reason="not in this data"),),
            True,
            "the flights show none of these numbers",
        ),
    ],
)
def test_an_uncertain_result_ends_with_3(instead, numbers, settled, words, tmp_path):
    instead(found_with(*numbers, settled=settled))
    done = skyarm(
        "identify",
        "swings.npz",
        "--vehicle",
        "hummingbird",
        "--out",
        str(tmp_path / "new"),
    )
    assert (done.code, words in done.err) == (3, True)
    assert ("did not settle" in done.out) is not settled
    assert (tmp_path / "new" / "vehicle.toml").exists() is not settled


def test_predictions_of_an_earlier_identification_do_not_stay_beside_another(
    instead, tmp_path
):
    found, old = (
        found_with(number("delay", 0.006)),
        (
            tmp_path / "prediction.csv",
            tmp_path / "prediction.png",
        ),
    )
    instead(found)
    words = (
        "identify",
        "swings.npz",
        "--vehicle",
        "hummingbird",
        "--out",
        str(tmp_path),
    )
    assert skyarm(*words, "--held-out", "aside.npz").code == 0
    assert all(each.is_file() for each in old)
    assert skyarm(*words).code == 0
    assert not any(each.exists() for each in old)
    assert all(each.with_stem("prediction_1").is_file() for each in old)


def test_gravity_is_that_of_the_flights_unless_it_is_given(
    instead, monkeypatch, tmp_path
):
    felt = []
    instead(found_with(number("delay", 0.006)))
    plain = identify_flights.predict_held_out

    def predicted(found, start, flights, options, **more):
        felt.append(options.gravity)
        return plain(
            found, start, flights, dataclasses.replace(options, gravity=9.8), **more
        )

    monkeypatch.setattr(identify_flights, "predict_held_out", predicted)
    stated = {"swings.npz": 9.7, "aside.npz": 9.7}
    load = identify_files.load_flight

    def flight_of(file, columns=None):
        flight = load(file, columns)
        return dataclasses.replace(
            flight, facts={**flight.facts, "gravity": stated[Path(file).name]}
        )

    monkeypatch.setattr(identify_files, "load_flight", flight_of)
    words = (
        "identify",
        "swings.npz",
        "--vehicle",
        "hummingbird",
        "--held-out",
        "aside.npz",
    )
    assert skyarm(*words).code == skyarm(*words, "--gravity", "9.5").code == 0
    assert felt == [9.7, 9.5]
    stated["aside.npz"] = 9.75
    refused(
        skyarm(*words),
        "--gravity: is missing: the flights state several, m/s^2: swings 9.7, aside"
        " 9.75",
    )


def test_a_voltage_that_is_not_used_is_said(instead, monkeypatch):
    instead(found_with(number("delay", 0.006)))
    load = identify_files.load_flight

    def flight_of(file, columns=None):
        flight = load(file, columns)
        time = flight["gyro"].time
        volts = dataclasses.replace(flight["gyro"], values=12.0 - 0.01 * time[:, None])
        return flight.with_channels({"voltage": volts})

    monkeypatch.setattr(identify_files, "load_flight", flight_of)
    words = ("identify", "swings.npz", "--vehicle", "hummingbird")
    assert "voltage: is measured and not used: " in skyarm(*words).out
    assert "voltage: is measured" not in skyarm(*words, "--known", "voltage=12").out


def test_strong_correlations_are_named_where_a_number_is_shown():
    rows = [[1.0, -0.95, 0.2], [-0.95, 1.0, 0.99], [0.2, 0.99, 1.0]]
    unknown = {"reason": "not in this data"}
    found = found_with(
        number("a", 1.0),
        number("b", 1.0),
        number("c", 1.0, **unknown),
        correlation=rows,
    )
    assert correlated_pairs(found) == [("b", "c", 0.99), ("a", "b", -0.95)]
    hidden = found_with(
        number("a", 1.0, **unknown),
        number("b", 1.0, **unknown),
        number("c", 1.0),
        correlation=rows,
    )
    assert correlated_pairs(hidden) == [("b", "c", 0.99)]


def test_the_file_names_what_is_not_shown_what_was_given_and_a_search_without_an_end():
    numbers = (
        number("base.com.x", 1.0),
        number("base.com.z", 1.0, reason="not in this data"),
        number("delay", 0.006),
    )
    text = identified_file(
        found_with(*numbers, settled=False),
        START,
        ["a.csv", "b.csv"],
        {"rotors.inertia": 0.0},
    )
    assert "# x: 1 (0.9 to 1.1) m, start 2\n# z: not in this data\n" in text
    assert "# THE SEARCH DID NOT SETTLE" in text
    assert "# In a scenario: [delays] command = 0.006\n" in text
    assert (
        tomllib.loads(text)["sources"]["base.com"]
        == "identified from a.csv, b.csv (3 s)"
    )
    assert "DID NOT SETTLE" not in identified_file(
        found_with(*numbers), START, ["a.csv"], {}
    )


def test_the_height_of_the_hub_drag_stands_beside_the_positions_of_the_rotors():
    height = number("rotors.drag_height", 0.02)
    text = identified_file(found_with(height), START, ["a.csv"], {})
    assert (
        text.count(
            "]  # z, of the hub drag: 0.02 (0.9 to 1.1) m, start 2\ndirection = "
        )
        == 4
    )
    assert (
        tomllib.loads(text)["sources"]["rotors.position"]
        == "identified from a.csv (3 s)"
    )


def test_known_numbers_are_words_of_the_vehicle_file():
    inertia = [
        "base.inertia.xx = 0.01",
        "base.inertia.yy=0.012",
        "base.inertia.zz=0.02",
    ]
    start, known = known_numbers(START, ["mass=1.5", *inertia])
    assert start.mass == pytest.approx(1.5)
    assert start.base.inertia == START.base.inertia
    x, y, z = (known[f"base.second_moment.{axis}"] for axis in "xyz")
    np.testing.assert_allclose((y + z, x + z, x + y), (0.01, 0.012, 0.02))
    arm = library.load_vehicle("hummingbird_arm2_rotors")
    heavier, _ = known_numbers(arm, ["mass=2.0"])
    assert heavier.mass == pytest.approx(2.0)
    assert heavier.links == arm.links
    assert second_moments(START.base) == pytest.approx((0.006, 0.006, 0.001))


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("none.csv", "--vehicle", "hummingbird"), "flight = 'none.csv': no such file"),
        (
            ("swings.npz", "none.csv", "--vehicle", "hummingbird"),
            "flight = 'none.csv': no such file",
        ),
        (
            ("swings.npz", "--vehicle", "hummingbird", "--held-out", "./swings.npz"),
            "--held-out = './swings.npz': must not be among the flights of the fit",
        ),
        (
            (
                "swings.npz",
                "aside.npz",
                "--vehicle",
                "hummingbird",
                "--join",
                "aside.npz",
            ),
            "flights = 2: must be one with --join",
        ),
        (
            ("swings.npz", "--vehicle", "hummingbird", "--join", "none.csv"),
            "flight = 'none.csv': no such file",
        ),
        (
            ("swings.npz", "--join", "aside.npz"),
            "--join: must be left out without --vehicle, and with --lags",
        ),
        (
            ("swings.npz", "--vehicle", "hummingbird", "--held-out", "none.csv"),
            "flight = 'none.csv': no such file",
        ),
        (
            ("truth.toml",),
            "--vehicle: is missing: must be the vehicle as its data sheet",
        ),
        (("truth.toml", "--vehicle", "hummingbird"), "format 'toml' is unknown"),
        (
            ("swings.npz", "--vehicle", "hummingburd"),
            "vehicle = 'hummingburd': did you mean 'hummingbird'",
        ),
        (
            ("swings.npz", "--vehicle", "tilted_hexarotor"),
            ": 4 rotors, vehicle 'tilted_hexarotor' has 6",
        ),
        (
            ("swings.npz", "--vehicle", "hummingbird", "--known", "mass"),
            "--known = 'mass': must be NAME=VALUE",
        ),
        (
            ("swings.npz", "--vehicle", "hummingbird", "--known", "mass=x"),
            "--known mass = 'x': must be a number",
        ),
        (
            ("swings.npz", "--vehicle", "hummingbird", "--known", "mass=-1"),
            "--known mass = -1.0: must be above 0",
        ),
        (
            ("swings.npz", "--vehicle", "hummingbird", "--known", "dealy=0"),
            "known.dealy: did you mean 'delay'?",
        ),
        (
            ("swings.npz", "--vehicle", "hummingbird", "--known", "foo=1"),
            ", base.inertia.xx, base.inertia.yy, base.inertia.zz, base.inertia.xy, ",
        ),
        (
            (
                "swings.npz",
                "--vehicle",
                "hummingbird",
                "--known",
                "rotors.time_constant_up=0",
            ),
            "known.rotors.time_constant_up = 0.0: must be above 0",
        ),
        (
            (
                "swings.npz",
                "--vehicle",
                "hummingbird",
                "--known",
                "base.inertia.xx=0.01",
            ),
            (
                "--known base.inertia.yy: is missing: base.inertia.xx, base.inertia.yy,"
                " base.inertia.zz must be given"
            ),
        ),
        (
            ("swings.npz", "--vehicle", "hummingbird", "--begin", "2", "--end", "1"),
            "--end = 1: must be after --begin = 2",
        ),
        (
            ("swings.npz", "--vehicle", "hummingbird", "--begin", "9"),
            "--begin = 9: must be below 3.395 s, the end of swings",
        ),
        (
            ("swings.npz", "--vehicle", "hummingbird", "--begin", "3.395"),
            "--begin = 3.395: must be below 3.395 s, the end of swings",
        ),
        (
            ("swings.npz", "--vehicle", "hummingbird", "--begin", "2.6"),
            "0 s in the air: too short",
        ),
        (
            ("swings.npz", "--vehicle", "hummingbird", "--known", "voltage=0"),
            "--known voltage = 0.0: must be above 0",
        ),
        (
            ("swings.npz", "--vehicle", "hummingbird", "--known", "voltage=12"),
            "--known voltage = 12: must be left out: no flight measures the voltage",
        ),
        (
            ("swings.npz", "--vehicle", "hummingbird", "--columns", "none.toml"),
            "none.toml",
        ),
    ],
)
def test_what_cannot_be_is_one_line_and_leaves_no_folder(
    words, message, without_isolation
):
    refused(skyarm("identify", *words, "--out", "new/inner"), message)
    assert not Path("new").exists()


def test_a_measurement_counts_once_whatever_its_file_is_called(tmp_path):
    copy = tmp_path / "copy.npz"
    copy.write_bytes(Path("swings.npz").read_bytes())
    done = skyarm("identify", "swings.npz", str(copy), "--vehicle", "hummingbird")
    refused(done, "must be another measurement than 'swings.npz'")
    refused(
        skyarm("identify", *["swings.npz"] * 2, "--vehicle", "hummingbird"),
        "another measurement than 'swings.npz'",
    )


def test_the_word_flights_does_what_was_done_without_it(instead):
    instead(found_with(number("delay", 0.006)))
    words = (
        "swings.npz",
        "--vehicle",
        "hummingbird",
        "--known",
        "mass=0.8",
        "--begin",
        "0.5",
        "--json",
    )
    done = skyarm("identify", "flights", *words)
    assert (done.code, json.loads(done.out)["command"]) == (0, "identify")
    assert done == skyarm("identify", *words)


def test_a_vehicle_file_that_is_there_gets_a_number(instead, tmp_path):
    instead(found_with(number("delay", 0.006)))
    words, own = (
        (
            "identify",
            "swings.npz",
            "--vehicle",
            "hummingbird",
            "--out",
            str(tmp_path),
        ),
        b"mine",
    )
    (tmp_path / "vehicle.toml").write_bytes(own)
    done = skyarm(*words)
    assert f"what was there is kept: {tmp_path / 'vehicle_1.toml'}" in done.out
    assert (tmp_path / "vehicle_1.toml").read_bytes() == own
    assert (tmp_path / "vehicle.toml").read_bytes() != own


def test_predictions_worse_than_holding_are_said():
    def errors(position, rate):
        return [
            HorizonErrors(
                horizon=h, begins=9, position=p, velocity=0.1, attitude=0.1, rate=rate
            )
            for h, p in zip(HORIZONS, position, strict=True)
        ]

    held_out = HeldOut(
        flights=("a",),
        period=0.01,
        horizons=HORIZONS,
        errors={
            IDENTIFIED: errors((1.0, 3.0, 2.0, 5.0), 0.1),
            HOLD: errors((2.0, 2.0, 2.0, 2.0), 0.2),
        },
        one_step={
            IDENTIFIED: OneStep(specific_force=1.0, angular_acceleration=3.0),
            HOLD: OneStep(specific_force=1.5, angular_acceleration=2.0),
        },
        has_poses=True,
        notes=(),
    )
    assert (
        prediction_lines(held_out)[-1]
        == "'identified' is worse than 'hold': angular acceleration over 10 ms;"
        " position after 0.1, 1 s"
    )
    better = dataclasses.replace(
        held_out, errors=dict.fromkeys((IDENTIFIED, HOLD), held_out.errors[HOLD])
    )
    assert (
        prediction_lines(better)[-1]
        == "'identified' is worse than 'hold': angular acceleration over 10 ms"
    )


def test_an_inertia_that_no_body_has_is_refused():
    words = [
        f"base.inertia.{axis}={value}"
        for axis, value in (("xx", 0.01), ("yy", 0.01), ("zz", 0.03))
    ]
    with pytest.raises(
        ValueError, match=r"^--known base\.inertia\.zz = 0\.03: must be below .* 0\.02$"
    ):
        known_numbers(START, words)


@pytest.mark.parametrize(
    ("word", "message"),
    [
        ("delay=5", "--known delay = 5: must be at most 1 s in size"),
        (
            "rotors.time_constant_up=3",
            "--known rotors.time_constant_up = 3: must be at most 1 s",
        ),
        (
            "base.com.x=-10",
            (
                "--known base.com.x = -10: must be at most 0.184 m in size, 4 times the"
                " vehicle's size"
            ),
        ),
        (
            "base.inertia.xx=5",
            "--known base.inertia.xx = 5: must be at most 0.00025 kg m^2 in size",
        ),
        (
            "base.inertia.xy=5",
            "--known base.inertia.xy = 5: must be at most 0.00025 kg m^2 in size",
        ),
        (
            "links.rod.mass=0.03",
            (
                "--known links.rod.mass = 0.03: must be at most 0.0295 kg in size, the"
                " total mass"
            ),
        ),
    ],
)
def test_a_known_number_that_no_such_vehicle_has_is_refused_before_a_log_is_read(
    word, message
):
    done = skyarm(
        "identify", "swings.npz", "--vehicle", "crazyflie_arm1", "--known", word
    )
    refused(done, message)


FLYING = [name for name in list_vehicles() if library.load_vehicle(name).rotors]


@pytest.mark.parametrize("name", FLYING)
def test_a_vehicle_s_own_numbers_are_possible(name):
    """All of them, twice the time constants and the base's moments, any place on the
    rotors' circle, and delays.
    """
    vehicle = library.load_vehicle(name)
    base, rotor = vehicle.base, vehicle.rotors[0]
    far = max(math.hypot(*map(float, each.position)) for each in vehicle.rotors)
    body = np.array([[-1.0, 1.0, 1.0], [1.0, -1.0, 1.0], [1.0, 1.0, -1.0]])
    for times in (1.0, 2.0):
        known = {f"base.com.{axis}": float(getattr(base.com, axis)) for axis in "xyz"}
        known |= {
            f"base.inertia.{each}": times * float(getattr(base.inertia, each))
            for each in ("xx", "yy", "zz")
        }
        known |= {
            f"base.inertia.{each}": float(getattr(base.inertia, each))
            for each in ("xy", "xz", "yz")
        }
        known |= {
            f"place.{axis}": times * sign * far
            for axis, sign in zip("xyz", (1, -1, 1), strict=True)
        }
        known |= {
            f"rotors.{each}": times * float(getattr(rotor, each))
            for each in ("time_constant_up", "inertia")
        }
        known |= {
            "delay": 0.4 * times,
            "joint_delay": -0.02,
            "accelerometer_delay": 0.06,
        }
        known |= {
            f"links.{each.name}.mass": float(each.body.mass) for each in vehicle.links
        }
        same, given = known_of_search(vehicle, known, "known.")
        assert same == vehicle
        moments = [known.pop(f"base.inertia.{each}") for each in ("xx", "yy", "zz")]
        second = [given.pop(f"base.second_moment.{axis}") for axis in "xyz"]
        np.testing.assert_allclose(
            second, 0.5 * body @ moments, atol=2e-6 * sum(moments)
        )
        assert given == known


def test_known_moments_of_inertia_are_taken_by_the_function_too():
    with pytest.raises(ValueError, match=r"^known\.base\.inertia\.yy: is missing"):
        library.identify_flights([], START, known={"base.inertia.xx": 0.01})
