"""Parts of a flight under an autopilot: joint law, rotor speeds from outside, rates,
take-off.
"""

from __future__ import annotations

import dataclasses
import inspect
import socket
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest
from px4_flights import scenario_of

from skyarm import load_vehicle
from skyarm.algebra import Quaternion, Vec3
from skyarm.control.catalogue import entry_of
from skyarm.control.controller import ControllerError, innermost
from skyarm.control.model import Model
from skyarm.dynamics.actuators import Command
from skyarm.dynamics.array_front import forward_dynamics
from skyarm.links.autopilots import ardupilot, betaflight, flight, px4
from skyarm.links.autopilots.angle_control import AngleGains
from skyarm.links.autopilots.autopilot import (
    Autopilot,
    BaseGoal,
    SensedInstant,
    SimulatorLink,
    controller_with,
    move_arm,
    plain_parameters,
    require_rotors,
)
from skyarm.links.autopilots.flight import (
    PilotedSession,
    goal_of,
    planned_scenario,
    take_off_scenario,
)
from skyarm.links.autopilots.px4 import make_px4
from skyarm.links.transcript import Tape, TranscriptError
from skyarm.records.plain import plain
from skyarm.records.restore import restore
from skyarm.reference import hover
from skyarm.scenario.scenario_file import load_scenario
from skyarm.scenario.scenario_record import (
    Change,
    NamedSensor,
    Scenario,
    ScenarioError,
    first_state,
)
from skyarm.sensing.measurement import Measurement, SensorNoise
from skyarm.sensing.sensor import Sensor
from skyarm.sensing.sensor_kinds import Encoders
from skyarm.simulate.session import Session
from skyarm.vehicle.vehicle_records import Vehicle


def test_the_joint_law_gives_the_joints_the_accelerations_of_its_feedback(
    tmp_path: Path,
) -> None:
    controller = scenario_of(tmp_path).controller
    par = innermost(controller.par)
    vehicle = par.model.vehicle
    rng = np.random.default_rng(5)
    for _ in range(5):
        q, qd, w = rng.normal(0, 0.3, 2), rng.normal(0, 0.5, 2), rng.normal(0, 0.2, 3)
        force = np.array([0.3, -0.2, 9.9])
        measured = Measurement(
            time=0.0,
            position=Vec3(0.0, 0.0, 0.0),
            quaternion=Quaternion(1.0, 0.0, 0.0, 0.0),
            velocity=Vec3(0.0, 0.0, 0.0),
            rate=Vec3(*w),
            joints=tuple(q),
            joint_rates=tuple(qd),
            specific_force=Vec3(*force),
        )
        wanted = np.array([0.1, -0.2])
        reference = hover((0.0, 0.0, 0.0), joints=tuple(wanted)).at(0.0)
        _, command = move_arm((), measured, reference, 0.004, par=par)
        assert command.rotor_speeds == (0.0,) * 4
        gains = par.joint_gains
        stiffness, damping = np.array(gains.stiffness), np.array(gains.damping)
        expected = stiffness * (wanted - q) - damping * qd
        # the base made to accelerate as measured, without angular acceleration, by the
        # force on it that does so
        acceleration = force - np.array([0.0, 0.0, 9.81])

        def residual(
            applied: np.ndarray,
            q=q,
            qd=qd,
            w=w,
            acceleration=acceleration,
            efforts=command.efforts,
        ):  # type: ignore[no-untyped-def]
            found = forward_dynamics(
                vehicle,
                (0, 0, 0),
                (1, 0, 0, 0),
                q,
                (0, 0, 0, *w, *qd),
                (*applied, *efforts),
                gravity=9.81,
            )
            return found[:6] - np.array([*acceleration, 0, 0, 0]), found[6:]

        zero = residual(np.zeros(6))[0]
        columns = np.array([residual(unit)[0] - zero for unit in np.eye(6)]).T
        applied = np.linalg.solve(columns, -zero)
        limits = [
            float(link.joint.effort_limit)
            for link in vehicle.links
            if link.joint is not None
        ]
        if all(
            abs(e) < 0.99 * limit
            for e, limit in zip(command.efforts, limits, strict=True)
        ):
            np.testing.assert_allclose(
                residual(applied)[1], expected, rtol=1e-6, atol=1e-6
            )


@pytest.mark.parametrize("law", ["traced", "called"])
def test_rotor_speeds_from_outside_fly_beside_the_joint_law(law: str) -> None:
    """Machine code and Python have the same bits, and a law's own rotor speeds from
    outside its own flight.
    """
    scenario = load_scenario("case3", controller="paper_ct", duration=0.1)
    if law == "called":
        scenario = dataclasses.replace(
            scenario,
            controller=dataclasses.replace(scenario.controller, compiled=False),
        )
    own = Session(scenario, machine_code=law == "traced")
    own.run()
    commands = own.log.rotor_commands
    flights = []
    for machine_code in (True, False):
        session = Session(scenario, machine_code=machine_code)
        for speeds in commands:
            session.step(rotors=speeds.tolist())
        flights.append(session.log)
    for name in ("position", "quaternion", "joints", "rotor_commands"):
        np.testing.assert_array_equal(
            getattr(flights[0], name), getattr(flights[1], name)
        )
        np.testing.assert_array_equal(getattr(flights[0], name), getattr(own.log, name))


def test_rotor_speeds_beside_a_command_or_of_another_number_are_refused() -> None:
    session = Session(load_scenario("case3", duration=0.1))
    command = Command(rotor_speeds=(1.0,) * 4, efforts=(0.0,) * 2)
    with pytest.raises(ScenarioError, match="must be left out beside a command"):
        session.step(command, rotors=(1.0,) * 4)
    with pytest.raises(ScenarioError, match="3 rotor speeds"):
        session.step(rotors=(1.0,) * 3)


def test_the_link_s_rate_is_fast_enough_and_divides_the_others(tmp_path: Path) -> None:
    scenario = load_scenario("case3", controller="px4")
    planned = planned_scenario(scenario)
    assert planned.rates.control >= 250
    for sensor in planned.sensors:
        assert (
            not sensor.sensor.frequency
            or planned.rates.control % round(sensor.sensor.frequency) == 0
        )
    assert planned.rates.physics % planned.rates.control == 0
    assert planned.rates.control % planned.rates.reference == 0
    assert {each.name for each in planned.sensors} == {
        "imu",
        "magnetometer",
        "barometer",
        "gnss",
    }
    assert planned_scenario(planned) is planned


@pytest.mark.parametrize("name", ["press_and_hold", "turn_valve"])
def test_a_task_in_contact_is_refused(name: str) -> None:
    with pytest.raises(
        ScenarioError,
        match=r"^reference: must have no push and no phase in contact for PX4, .* law$",
    ):
        planned_scenario(load_scenario(name, controller="px4"))


def test_a_scheduled_task_in_contact_is_refused() -> None:
    scenario = load_scenario("pick_and_carry", controller="px4")
    push = {"kind": "hover", "position": [0.0, 0.0, 1.0]}
    later = {
        "base": push,
        "joints": [0.0, 0.0],
        "push": {"force": 2.0, "normal": [-1.0, 0.0, 0.0]},
    }
    planned_scenario(scenario)
    with pytest.raises(ScenarioError, match=r"^reference: must have no push"):
        planned_scenario(
            dataclasses.replace(
                scenario, changes=(Change(at=3.0, path="reference", value=later),)
            )
        )


def test_a_start_at_a_surface_is_refused() -> None:
    scenario = load_scenario("press_and_hold", controller="px4")
    free = dataclasses.replace(scenario.reference, push=None)
    with pytest.raises(
        ScenarioError,
        match=(
            r"^initial: point 'tip' starts .* m from surface 'wall': must be at least"
        ),
    ):
        planned_scenario(dataclasses.replace(scenario, reference=free))


def test_rates_of_a_scenario_that_has_the_sensors_are_planned_too() -> None:
    planned = planned_scenario(load_scenario("case3", controller="px4"))
    slow = dataclasses.replace(
        planned, rates=dataclasses.replace(planned.rates, control=50, physics=500)
    )
    assert planned_scenario(slow).rates.control == 250


class Plain(Session):
    """Session that flies without the program: the rotors get what the test gives."""


def test_a_session_of_an_autopilot_is_one_that_starts_its_program(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.delenv("SKYARM_PX4", raising=False)
    monkeypatch.setenv("PATH", "")
    with pytest.raises(
        ScenarioError,
        match=(
            r"^autopilot: PX4's program is missing; build it .* SKYARM_PX4 to its path$"
        ),
    ):
        Session(load_scenario("case3", controller="px4"))


def test_clocks_and_sensors_that_the_autopilot_needs_are_checked_too(
    tmp_path: Path,
) -> None:
    late = load_scenario("case3", controller="px4", duration=1.005)
    with pytest.raises(
        ScenarioError,
        match=(
            r"^duration = 1\.005: must be a whole number of control periods of 0\.004 s"
        ),
    ):
        Session(late)
    broken = scenario_of(tmp_path, preparation=60.001)
    with pytest.raises(
        ScenarioError,
        match=(
            r"^duration = 60\.001: must be a whole number of control periods of 0\.004"
        ),
    ):
        Session(broken)


def test_the_take_off_begins_at_rest_on_the_stand_below_the_start(
    tmp_path: Path,
) -> None:
    scenario = planned_scenario(scenario_of(tmp_path, climb=0.4, yaw=0.6))
    session = Plain(take_off_scenario(scenario))
    z = 1.5 - 0.4
    first = session.state
    assert float(first.position.z) == pytest.approx(z - 9.81 / 1600)
    assert float(session.measurement.specific_force.z) == pytest.approx(9.81)
    for _ in range(250):
        session.step(rotors=(0.0,) * 4)
    state = session.state
    assert [float(c) for c in state.position] == pytest.approx(
        [0.5, -0.3, z - 9.81 / 1600], abs=2e-4
    )
    assert float(state.velocity.norm()) < 1e-3


def test_the_goal_is_the_base_of_the_reference_that_is_held_in_the_period() -> None:
    scenario = load_scenario("case3", duration=8.0)
    session = Session(scenario)
    for tick in (0, 10, 1300, 1599):
        session._engine.tick = tick
        # control at 200 Hz, reference at 50 Hz
        held = scenario.reference.at(tick // 4 * 4 / 200.0)
        goal = goal_of(session.reference)
        assert [
            *goal.position,
            *goal.velocity,
            *goal.acceleration,
            goal.yaw,
        ] == pytest.approx(
            [*held.position, *held.velocity, *held.acceleration, held.yaw], abs=1e-12
        )


@pytest.mark.parametrize(
    ("value", "words"),
    [
        (3, "must be a table"),
        ({"A-B": 1.0}, "must be a name of at most 16 letters"),
        ({"A" * 17: 1.0}, "16 letters"),
        ({"A": "x"}, "must be a number up to 3.4e[+]38"),
        ({"A": True}, "must be a number up to 3.4e[+]38"),
        ({"A": 1e300}, "A = 1e[+]300: must be a number up to"),
        ({"A": float("nan")}, "must be a number up to 3.4e[+]38"),
    ],
)
def test_parameters_are_names_and_finite_numbers(value: object, words: str) -> None:
    with pytest.raises(ControllerError, match=words):
        plain_parameters(value)
    assert plain_parameters({"MPC_XY_P": 1}) == (("MPC_XY_P", 1),)


def test_rotors_without_a_highest_speed_are_refused(tmp_path: Path) -> None:
    scenario = scenario_of(tmp_path)
    vehicle = scenario.plant.vehicle
    free = dataclasses.replace(
        vehicle,
        rotors=tuple(
            dataclasses.replace(rotor, max_speed=float("inf"))
            for rotor in vehicle.rotors
        ),
    )
    with pytest.raises(ControllerError, match="must have a max_speed"):
        make_px4(Model(vehicle=free, gravity=9.81))


def test_the_autopilot_is_told_the_model_and_the_rotors_are_the_plants(
    tmp_path: Path,
) -> None:
    scenario = scenario_of(tmp_path)
    vehicle = scenario.plant.vehicle
    heavy = dataclasses.replace(
        vehicle,
        base=dataclasses.replace(vehicle.base, mass=2.0 * float(vehicle.base.mass)),
    )
    changed = dataclasses.replace(
        scenario, plant=dataclasses.replace(scenario.plant, vehicle=heavy)
    )
    assert changed.agent.model.vehicle == vehicle
    endless = tuple(
        dataclasses.replace(rotor, max_speed=float("inf")) for rotor in vehicle.rotors
    )
    changed = dataclasses.replace(
        scenario,
        plant=dataclasses.replace(
            scenario.plant, vehicle=dataclasses.replace(vehicle, rotors=endless)
        ),
    )
    with pytest.raises(
        ScenarioError, match=r"plant\.vehicle: rotor .* must have a max_speed"
    ):
        planned_scenario(changed)


def test_each_link_takes_what_it_says_from_the_model(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scenario = scenario_of(tmp_path)
    vehicle = scenario.plant.vehicle
    heavy = dataclasses.replace(
        vehicle,
        base=dataclasses.replace(vehicle.base, mass=2.0 * float(vehicle.base.mass)),
    )
    changed = dataclasses.replace(
        scenario, plant=dataclasses.replace(scenario.plant, vehicle=heavy)
    )
    told = []

    class Told(Exception):  # noqa: N818
        pass

    def take(given: object, *_: object) -> None:
        told.append(given)
        raise Told

    monkeypatch.setattr(px4, "vehicle_parameters", take)
    monkeypatch.setattr(ardupilot, "vehicle_parameters", take)
    monkeypatch.setattr(betaflight, "Sticks", take)
    for record in (px4.PX4(), ardupilot.ArduPilot(), betaflight.Betaflight()):
        with pytest.raises(Told):
            record.connect(changed, Tape())
    assert told == [vehicle] * 3


def test_a_log_flown_again_leaves_its_transcript_alone(tmp_path: Path) -> None:
    scenario = scenario_of(tmp_path, transcript=str(tmp_path / "a.tape"))
    assert scenario.controller.par.autopilot.transcript == str(tmp_path / "a.tape")
    assert restore(plain(scenario.controller)).par.autopilot.transcript == ""


def test_no_file_names_a_program_to_start(tmp_path: Path) -> None:
    scenario = scenario_of(tmp_path, program="/bin/true")
    assert scenario.controller.par.autopilot.program == "/bin/true"
    assert restore(plain(scenario.controller)).par.autopilot.program == ""
    file = tmp_path / "swing.toml"
    file.write_text(
        file.read_text("utf-8").replace('"px4"', '"px4"\nprogram = "/bin/true"'),
        "utf-8",
    )
    with pytest.raises(
        ValueError, match=r"controller\.program = .*: must be left out: .* SKYARM_PX4"
    ) as caught:
        load_scenario(file)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("kind", [px4.PX4, ardupilot.ArduPilot, betaflight.Betaflight])
def test_the_options_of_a_file_are_the_fields_of_the_record(kind: type) -> None:
    fields = {each.name: each.default for each in dataclasses.fields(kind)}
    options = inspect.signature(entry_of(kind.name).function()).parameters
    assert {name: each.default for name, each in options.items()} == {
        "model": inspect.Parameter.empty,
        "joint_gains": None,
        **fields,
    }


def test_a_file_gives_the_gains_of_the_position_loop_of_betaflight(
    tmp_path: Path,
) -> None:
    scenario_of(tmp_path)
    file = tmp_path / "swing.toml"
    whole = file.read_text("utf-8")
    for position, words in (
        (4.0, ""),
        (-4.0, r"controller\.gains\.position = -4\.0: must be at least 0"),
    ):
        file.write_text(
            whole.replace(
                '"px4"', f'"betaflight"\ngains = {{ position = {position} }}'
            ),
            "utf-8",
        )
        if words:
            with pytest.raises(ValueError, match=words):
                load_scenario(file)
        else:
            assert load_scenario(file).controller.par.autopilot.gains == AngleGains(
                position=4.0
            )


def test_measured_joints_are_where_the_engine_says(tmp_path: Path) -> None:
    scenario = dataclasses.replace(load_scenario("case3"), duration=0.1)
    session = Session(scenario)
    session.step()
    measured = session.measurement
    session.step()
    engine = session._engine
    np.testing.assert_array_equal(
        engine.recorder.row(1)[engine.recorder.joint_columns],
        [float(each) for each in (*measured.joints, *measured.joint_rates)],
    )


@dataclass(frozen=True, kw_only=True, slots=True)
class Resting(Autopilot):
    """Autopilot without a program, which leaves the vehicle on its stand."""

    name: ClassVar[str] = "resting"
    title: ClassVar[str] = "Resting"
    variable: ClassVar[str] = "NONE"
    least_rate: ClassVar[int] = 200

    def sensors(self, vehicle: Vehicle) -> dict[str, Sensor]:
        return {}

    @property
    def outside_ports(self) -> tuple[int, int]:
        return 0, 0

    def connect(self, scenario: Scenario, tape: Tape) -> SimulatorLink:
        return RestingLink()


class RestingLink(SimulatorLink):
    """Link that notes what it is given."""

    following = True

    def __init__(self) -> None:
        self.seen, self.signals, self.asked, self.closed = (
            list[tuple[SensedInstant, BaseGoal]](),
            (0.0,) * 4,
            0,
            0,
        )

    def exchange(self, now: SensedInstant, goal: BaseGoal) -> tuple[float, ...]:
        self.seen.append((now, goal))
        return self.signals

    def release(self) -> None:
        self.asked += 1
        self.released = True

    def close(self) -> None:
        self.closed += 1


ENCODERS = NamedSensor(name="encoders", sensor=Encoders(frequency=100.0))
NOISE = SensorNoise(joints=0.01)


@pytest.fixture
def resting(monkeypatch: pytest.MonkeyPatch) -> Callable[..., PilotedSession]:
    """Session of case 3 that is handed over on the stand."""
    monkeypatch.setattr(flight, "NEAR", 1.0)

    def begin(
        duration: float = 0.05, progress: Any = None, **options: Any
    ) -> PilotedSession:
        scenario = load_scenario("case3", duration=duration)
        record = Resting(climb=0.3, preparation=4.0, **options)
        controller = controller_with(record, scenario.controller.par.model, None)
        scenario = dataclasses.replace(
            scenario,
            controller=controller,
            sensors=(*scenario.sensors, ENCODERS),
            noise=NOISE,
        )
        return PilotedSession(scenario, progress=progress)

    return begin


def test_the_exchange_goes_on_in_time_at_the_hand_over_and_ends_with_the_flight(
    resting: Callable[..., PilotedSession],
) -> None:
    seconds = []
    session = resting(progress=lambda *given: seconds.append(given))
    link = session._link
    assert isinstance(link, RestingLink)
    begun, prepared = len(link.seen), session.log.info["autopilot"]["prepared_s"]
    assert prepared == round(prepared)
    assert begun == 200 * prepared
    # at the hand-over both are equal
    assert seconds == [
        *((float(second), 4.0) for second in range(1, round(prepared) + 1)),
        (prepared, prepared),
    ]
    assert session.time == 0.0
    log = session.run()
    assert log.status == "completed"
    assert not session.step()
    # the last period asks for nothing
    assert (len(log.time), len(link.seen), link.closed) == (10, begun + 9, 1)
    times = np.array([now.time for now, _ in link.seen])
    np.testing.assert_allclose(times, np.arange(len(times)) / 200.0, atol=1e-9)
    for now, _ in link.seen:  # 100 Hz
        assert now.readings["encoders"][0] == pytest.approx(
            2 * (round(200 * now.time) // 2) / 200.0, abs=1e-9
        )
    (now, goal), state = link.seen[begun + 4], log.position[4]
    assert now.state[:3] == state.tolist()
    assert goal.position == pytest.approx(log.position_reference[5].tolist(), abs=1e-12)
    start = first_state(load_scenario("case3")).position
    assert link.seen[0][1].position == pytest.approx(
        [float(c) for c in start], abs=1e-12
    )


@pytest.mark.parametrize(
    "signals", [(0.1,) * 3, (0.1, 0.1, 1.01, 0.1), (0.1, -0.01, 0.1, np.nan)]
)
def test_signals_that_are_none_end_the_flight(
    resting: Callable[..., PilotedSession], signals: tuple[float, ...]
) -> None:
    session = resting()
    assert session.step()
    session._link.signals = signals  # type: ignore[union-attr]
    assert not session.step()
    assert session.log.status == "autopilot"
    assert (
        session.log.info["cause"] == "Resting sent rotor signals: must be 4 from 0 to 1"
    )
    assert session._link.closed == 1  # type: ignore[union-attr]


def test_a_program_outside_gets_measured_joints_and_its_setpoints_move_the_joints(
    resting: Callable[..., PilotedSession], monkeypatch: pytest.MonkeyPatch
) -> None:
    told = []

    class Port:
        facts: ClassVar[dict[str, int]] = {}

        def __init__(self, port: int, count: int) -> None:
            self.count = count

        def exchange(
            self, at: float, joints: list[float], rates: list[float]
        ) -> tuple[float, ...] | None:
            told.append((at, *joints, *rates))
            return (0.02, -0.01) if len(told) > 5 else None

        def close(self) -> None:
            pass

    monkeypatch.setattr(flight, "JointServer", Port)
    session = resting(outside=True)
    prepared = session.log.info["autopilot"]["prepared_s"]
    assert (prepared, session._link.asked) == (3.0, 1)  # type: ignore[union-attr]  # a second after it was asked
    measured = []
    for _ in range(10):
        measured.append(session.measurement)
        session.step()
    log = session.log
    assert log.efforts[5:].tolist() == [[0.02, -0.01]] * 5
    assert (log.efforts[:5] != [0.02, -0.01]).all()
    assert [row[0] for row in told] == pytest.approx(prepared + np.arange(10) / 200.0)
    for before, row in zip(measured, told[1:], strict=False):
        assert row[1:] == tuple(map(float, (*before.joints, *before.joint_rates)))
    assert (np.array([row[1:3] for row in told[1:]]) != log.joints[:9]).all()


def test_a_taken_joint_port_is_found_before_the_program_starts(
    resting: Callable[..., PilotedSession], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Resting, "connect", lambda *_: pytest.fail("started"))
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        monkeypatch.setattr(Resting, "outside_ports", (0, taken.getsockname()[1]))
        with pytest.raises(
            ScenarioError, match=r"UDP port \d+ of the joints: must be free"
        ):
            resting(outside=True)


def test_a_transcript_that_cannot_be_completed_keeps_the_flight(
    resting: Callable[..., PilotedSession], monkeypatch: pytest.MonkeyPatch
) -> None:
    def full() -> None:
        raise TranscriptError("disk full")

    session = resting()
    monkeypatch.setattr(session._tape, "close", full)
    session._closer.detach()
    session._closer = partial(flight._close, session._link, session._tape)  # type: ignore[arg-type, assignment]
    log = session.run()
    assert (log.status, log.info["cause"], len(log.time)) == (
        "autopilot",
        "disk full",
        10,
    )


def test_a_plant_with_other_rotors_than_the_model_is_refused(tmp_path: Path) -> None:
    vehicle = load_vehicle("hummingbird")
    with pytest.raises(
        ScenarioError, match=r"plant\.vehicle: 6 rotors: must be 4, as of the model"
    ):
        require_rotors(load_vehicle("hexarotor_arm6"), vehicle, "PX4")
    require_rotors(vehicle, vehicle, "PX4")
    with pytest.raises(
        ScenarioError, match=r"plant\.vehicle: must have no rotors that tilt for PX4"
    ):
        require_rotors(load_vehicle("voliro_like"), vehicle, "PX4")
