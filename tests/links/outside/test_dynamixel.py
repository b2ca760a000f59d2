"""Port to DYNAMIXEL servos, on a stand-in for the maker's SDK that keeps a control
table for each servo.
"""

import dataclasses
import math
import sys
import threading
import time
import types

import pytest

from skyarm.links.joint_port import JointPortError
from skyarm.links.outside import joint_links
from skyarm.links.outside.dynamixel import DynamixelJoints, ServoBus
from skyarm.links.outside.joint_links import open_joints
from skyarm.vehicle.vehicle_files import load_vehicle


def stand_in(tables, *, opens=True, answers=(1, 2), models=(1020, 1020)):
    """Module with the names of the SDK that are used: each servo is a table of bytes by
    address.
    """
    sdk = types.ModuleType("dynamixel_sdk")

    class PortHandler:
        def __init__(self, device):
            sdk.device, sdk.closed = device, False

        def openPort(self):
            return opens

        def setBaudRate(self, baud):
            sdk.baud = baud
            return True

        def closePort(self):
            sdk.closed = True

    class PacketHandler:
        def __init__(self, version):
            assert version == 2.0

        def ping(self, port, number):
            return models[number - 1], 0, 0

        def write1ByteTxRx(self, port, number, address, value):
            if number not in answers:
                return -3001, 0
            sdk.writes.append((number, address, value))
            tables[number][address] = value
            return 0, 0

    class GroupSyncRead:
        def __init__(self, port, handler, start, length):
            self.start, self.length, self.ids = start, length, []

        def addParam(self, number):
            self.ids.append(number)
            return True

        def txRxPacket(self):
            return 0

        def isAvailable(self, number, address, length):
            return (
                number in answers
                and address >= self.start
                and address + length <= self.start + self.length
            )

        def getData(self, number, address, length):
            return int.from_bytes(
                bytes(tables[number][address + k] for k in range(length)), "little"
            )

    class GroupSyncWrite:
        def __init__(self, port, handler, start, length):
            self.start, self.length, self.rows = start, length, {}

        def addParam(self, number, data):
            assert len(data) == self.length
            self.rows[number] = data
            return True

        def txPacket(self):
            for number, data in self.rows.items():
                for k, byte in enumerate(data):
                    tables[number][self.start + k] = byte
            return 0

        def clearParam(self):
            self.rows = {}

    sdk.writes = []
    for each in (PortHandler, PacketHandler, GroupSyncRead, GroupSyncWrite):
        setattr(sdk, each.__name__, each)
    return sdk


def put(table, address, value, size):
    for k, byte in enumerate((value & (1 << 8 * size) - 1).to_bytes(size, "little")):
        table[address + k] = byte


def get(table, address, size):
    value = int.from_bytes(
        bytes(table.get(address + k, 0) for k in range(size)), "little"
    )
    return value - (1 << 8 * size) if value >> 8 * size - 1 else value


@pytest.fixture
def tables():
    found = {1: {}, 2: {}}
    for table in found.values():
        put(table, 128, 0, 4)
        put(table, 132, 2048, 4)
    return found


@pytest.fixture
def sdk(tables, monkeypatch):
    made = stand_in(tables)
    monkeypatch.setitem(sys.modules, "dynamixel_sdk", made)
    return made


def settle(condition, seconds=2.0):
    until = time.monotonic() + seconds
    while not (found := condition()):
        assert time.monotonic() < until
        time.sleep(0.002)
    return found


def test_angles_and_rates_of_the_control_table(sdk, tables):
    put(tables[1], 132, 3072, 4)  # a quarter turn beyond the middle
    put(tables[2], 132, -2048, 4)  # a whole turn below
    put(tables[2], 128, -100, 4)
    arm = DynamixelJoints(ServoBus(device="/dev/x", ids=(1, 2)))
    try:
        found = settle(arm.read)
        assert found.joints == pytest.approx((0.5 * math.pi, -2.0 * math.pi))
        assert found.joint_rates == pytest.approx(
            (0.0, -100 * 0.229 * 2.0 * math.pi / 60.0)
        )
        assert (sdk.device, sdk.baud) == ("/dev/x", 1_000_000)
    finally:
        arm.close()
    assert sdk.closed


def test_positions_go_out_in_the_order_of_the_joints(sdk, tables):
    arm = DynamixelJoints(ServoBus(device="/dev/x", ids=(2, 1)))
    try:
        arm.send((math.pi, -0.5 * math.pi), 0.0)
        settle(lambda: get(tables[2], 116, 4) == 4096)
        assert get(tables[1], 116, 4) == 1024
        assert [tables[k][11] for k in (1, 2)] == [4, 4]  # position over several turns
    finally:
        arm.close()


@pytest.mark.parametrize(
    ("model", "counts"),
    [(1200, 500), (1240, 500), (1710, 500), (1040, 373), (1310, 186)],
)
def test_servos_count_their_current_in_units_of_their_model(
    model, counts, tables, monkeypatch
):
    """XL330, XC330, XM335 (1 mA), XH430-V (1.34 mA), XW540 (2.69 mA) beside XM430, of
    the e-Manual's control tables.
    """
    monkeypatch.setitem(
        sys.modules, "dynamixel_sdk", stand_in(tables, models=(model, 1020))
    )
    arm = DynamixelJoints(ServoBus(device="/dev/x", ids=(1, 2), torque=2.0, most=1.0))
    try:
        arm.send((-1.0, 9.0), 0.0)
        settle(lambda: get(tables[2], 102, 2) != 0)
        assert (get(tables[1], 102, 2), get(tables[2], 102, 2)) == (
            -counts,
            round(1.0 / 2.69e-3),
        )
    finally:
        arm.close()


@pytest.mark.parametrize("model", [1700, 1060, 321])
def test_a_servo_whose_unit_of_current_is_unknown_takes_no_torque(
    model, tables, monkeypatch
):
    """XC335, XL430 without a current mode, MX-106: nothing turns, and positions still
    go.
    """
    monkeypatch.setitem(
        sys.modules, "dynamixel_sdk", stand_in(tables, models=(model, 1020))
    )
    with pytest.raises(
        JointPortError,
        match=rf"servo 1 on '/dev/x': model {model} counts no known current; without",
    ):
        DynamixelJoints(ServoBus(device="/dev/x", ids=(1, 2), torque=2.0))
    assert tables[1][64] == 0
    DynamixelJoints(ServoBus(device="/dev/x", ids=(1, 2))).close()
    assert tables[1][64] == 1


def test_torques_become_currents_within_their_limit(sdk, tables):
    arm = DynamixelJoints(ServoBus(device="/dev/x", ids=(1, 2), torque=2.0, most=1.0))
    try:
        arm.send((-1.0, 9.0), 0.0)
        settle(lambda: get(tables[1], 102, 2) != 0)
        assert get(tables[1], 102, 2) == round(-0.5 / 2.69e-3)
        assert get(tables[2], 102, 2) == round(1.0 / 2.69e-3)
        assert [tables[k][11] for k in (1, 2)] == [0, 0]  # current
    finally:
        arm.close()


def test_the_mode_changes_while_the_servo_is_off_and_its_watchdog_is_set(sdk, tables):
    arm = DynamixelJoints(ServoBus(device="/dev/x", ids=(1,)))
    arm.close()
    assert sdk.writes == [(1, 64, 0), (1, 11, 4), (1, 98, 0), (1, 98, 25), (1, 64, 1)]


def test_a_released_arm_holds_its_place(sdk, tables):
    arm = DynamixelJoints(ServoBus(device="/dev/x", ids=(1, 2), torque=2.0))
    try:
        arm.send((0.5, 0.5), 0.0)
        settle(lambda: get(tables[1], 102, 2) != 0)
        arm.release()
        assert [tables[k][11] for k in (1, 2)] == [4, 4]
        assert [tables[k][64] for k in (1, 2)] == [1, 1]
        put(tables[1], 102, 0, 2)
        time.sleep(0.02)
        assert get(tables[1], 102, 2) == 0  # nothing is written any more
    finally:
        arm.close()


def test_setpoints_that_are_not_renewed_are_not_sent_on(sdk, tables):
    """Our own thread feeds the servos' watchdog, so that it does not see a law that
    stands still.
    """
    arm = DynamixelJoints(ServoBus(device="/dev/x", ids=(1, 2), torque=2.0))
    try:
        arm.send((0.5, 0.5), 0.0)
        settle(lambda: get(tables[1], 102, 2) != 0)
        settle(lambda: [tables[k][11] for k in (1, 2)] == [4, 4], 1.0)
        put(tables[1], 102, 0, 2)
        time.sleep(0.02)
        assert get(tables[1], 102, 2) == 0
        # the law goes on: its torques act in the mode of torques again
        sdk.writes.clear()
        arm.send((0.5, 0.5), 0.0)
        settle(lambda: get(tables[1], 102, 2) != 0)
        assert sdk.writes == [
            (k, at, value) for k in (1, 2) for at, value in ((64, 0), (11, 0), (64, 1))
        ]
    finally:
        arm.close()


def test_a_slow_bus_does_not_hold_up_the_law(sdk, tables, monkeypatch):
    busy = threading.Event()

    def slow(self):
        busy.set()
        time.sleep(0.3)
        return 0

    monkeypatch.setattr(sdk.GroupSyncRead, "txRxPacket", slow)
    arm = DynamixelJoints(ServoBus(device="/dev/x", ids=(1, 2)))
    try:
        assert busy.wait(2.0)
        begun = time.monotonic()
        arm.read()
        arm.send((0.0, 0.0), 0.0)
        assert time.monotonic() - begun < 0.1
    finally:
        arm.close()


def test_an_error_of_the_sdk_is_the_arms_problem(sdk, tables, monkeypatch):
    monkeypatch.setattr(sdk.GroupSyncRead, "txRxPacket", lambda self: self.missing)
    arm = DynamixelJoints(ServoBus(device="/dev/x", ids=(1, 2)))
    try:
        settle(lambda: arm.problem)
        assert "has no attribute 'missing'" in arm.problem
        assert arm.read() is None
    finally:
        arm.close()


def test_a_bus_at_another_speed_is_closed_again(sdk, monkeypatch):
    monkeypatch.setattr(sdk.PortHandler, "setBaudRate", lambda self, baud: False)
    with pytest.raises(JointPortError, match="cannot be opened at"):
        DynamixelJoints(ServoBus(device="/dev/x", ids=(1, 2)))
    assert sdk.closed


@pytest.mark.parametrize(
    ("field", "value"),
    [("torque", 0.0), ("torque", -1.0), ("torque", math.nan), ("most", 0.0)],
)
def test_a_bus_without_sense_is_one_line(field, value):
    with pytest.raises(
        JointPortError, match=f"--joints.{field} = {value}: must be"
    ) as error:
        ServoBus(device="/dev/x", ids=(1,), **{field: value})
    assert "\n" not in str(error.value)


def test_a_servo_that_does_not_answer_is_one_line(tables, monkeypatch):
    sdk = stand_in(tables, answers=(1,))
    monkeypatch.setitem(sys.modules, "dynamixel_sdk", sdk)
    with pytest.raises(
        JointPortError, match="--joints: servo 2 on '/dev/x' does not answer"
    ):
        DynamixelJoints(ServoBus(device="/dev/x", ids=(1, 2)))
    assert sdk.closed


def test_a_port_that_does_not_open_is_one_line(tables, monkeypatch):
    monkeypatch.setitem(sys.modules, "dynamixel_sdk", stand_in(tables, opens=False))
    with pytest.raises(JointPortError, match="cannot be opened at 57600 bits a second"):
        DynamixelJoints(ServoBus(device="/dev/x", ids=(1, 2), baud=57600))


def test_without_the_sdk_the_message_names_the_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "dynamixel_sdk", None)
    with pytest.raises(
        JointPortError, match=r"dynamixel_sdk: is missing; .*extra 'dynamixel'"
    ):
        DynamixelJoints(ServoBus(device="/dev/x", ids=(1,)))


def test_an_address_opens_the_bus(sdk, tables):
    arm = open_joints(
        "dynamixel:/dev/ttyUSB0?ids=1,2&torque=1.8&baud=57600",
        load_vehicle("hummingbird_arm2"),
    )
    arm.close()
    assert (sdk.device, sdk.baud) == ("/dev/ttyUSB0", 57600)


def test_an_address_without_options_has_those_of_the_record(sdk, tables, monkeypatch):
    found = []
    monkeypatch.setattr(joint_links, "DynamixelJoints", found.append)
    for options in ("ids=1,2&torque=1.8", "ids=1,2&torque=1.8&baud=57600&most=0.7"):
        open_joints(
            f"dynamixel:/dev/ttyUSB0?{options}", load_vehicle("hummingbird_arm2")
        )
    plain = ServoBus(device="/dev/ttyUSB0", ids=(1, 2), torque=1.8)
    assert found == [plain, dataclasses.replace(plain, baud=57600, most=0.7)]
