"""Stand-in for PX4 behind its agent: DDS types and encoder of another hand, a rigid
body under thrusts of motors.
"""

from __future__ import annotations

import threading
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from cyclonedds.core import DDSException, Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import make_idl_struct
from cyclonedds.idl.types import (
    array,
    float32,
    float64,
    int8,
    int32,
    uint8,
    uint16,
    uint32,
    uint64,
)
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

from links.outside.stand_in import GRAVITY, StandIn, quaternion_of, turned
from skyarm.vehicle.vehicle_records import Vehicle

VECTOR = array[float32, 3]

CONTROLS = (
    "manual",
    "auto",
    "offboard",
    "position",
    "velocity",
    "altitude",
    "climb_rate",
    "acceleration",
    "attitude",
    "rates",
    "allocation",
    "termination",
)


def flags(names: str) -> dict[str, type[bool]]:
    """Fields that are true or false."""
    return dict.fromkeys(names.split(), bool)


PARTS: dict[str, dict[str, Any]] = {
    "VehicleOdometry": {
        "timestamp": uint64,
        "timestamp_sample": uint64,
        "pose_frame": uint8,
        "position": VECTOR,
        "q": array[float32, 4],
        "velocity_frame": uint8,
        "velocity": VECTOR,
        "angular_velocity": VECTOR,
        "position_variance": VECTOR,
        "orientation_variance": VECTOR,
        "velocity_variance": VECTOR,
        "reset_counter": uint8,
        "quality": int8,
    },
    "SensorCombined": {
        "timestamp": uint64,
        "gyro_rad": VECTOR,
        "gyro_integral_dt": uint32,
        "accelerometer_timestamp_relative": int32,
        "accelerometer_m_s2": VECTOR,
        "accelerometer_integral_dt": uint32,
        "accelerometer_clipping": uint8,
        "gyro_clipping": uint8,
        "accel_calibration_count": uint8,
        "gyro_calibration_count": uint8,
    },
    "VehicleControlMode": (
        {"timestamp": uint64}
        | flags("flag_armed flag_multicopter_position_control_enabled")
        | {f"flag_control_{name}_enabled": bool for name in CONTROLS}
        | {"source_id": uint8}
    ),
    "VehicleLandDetected": (
        {"timestamp": uint64}
        | flags(
            "freefall ground_contact maybe_landed landed in_ground_effect in_descend"
            " has_low_throttle"
        )
        | flags(
            "vertical_movement horizontal_movement rotational_movement"
            " close_to_ground_or_skipped_check at_rest"
        )
    ),
    "VehicleCommandAck": {
        "timestamp": uint64,
        "command": uint32,
        "result": uint8,
        "result_param1": uint8,
        "result_param2": int32,
        "target_system": uint8,
        "target_component": uint16,
        "from_external": bool,
    },
    "VehicleCommand": (
        {"timestamp": uint64}
        | {f"param{i}": float32 for i in range(1, 5)}
        | {
            "param5": float64,
            "param6": float64,
            "param7": float32,
            "command": uint32,
            "target_system": uint8,
            "target_component": uint8,
            "source_system": uint8,
            "source_component": uint16,
            "confirmation": uint8,
            "from_external": bool,
        }
    ),
    "OffboardControlMode": (
        {"timestamp": uint64}
        | flags(
            "position velocity acceleration attitude body_rate thrust_and_torque"
            " direct_actuator"
        )
    ),
    "ActuatorMotors": {
        "timestamp": uint64,
        "timestamp_sample": uint64,
        "reversible_flags": uint16,
        "control": array[float32, 12],
    },
}

TYPES: dict[str, Any] = {
    name: make_idl_struct(name, f"px4_msgs::msg::dds_::{name}_", parts)
    for name, parts in PARTS.items()
}

SENT = {
    "vehicle_odometry": "VehicleOdometry",
    "sensor_combined": "SensorCombined",
    "vehicle_control_mode": "VehicleControlMode",
    "vehicle_land_detected": "VehicleLandDetected",
    "vehicle_command_ack_v1": "VehicleCommandAck",
}

READ = {
    "vehicle_command": "VehicleCommand",
    "offboard_control_mode": "OffboardControlMode",
    "actuator_motors": "ActuatorMotors",
}


def message(name: str, **values: Any) -> Any:
    """Message of a type; what is left out is zero."""
    found = {}
    for part, kind in PARTS[name].items():
        long = {VECTOR: 3, array[float32, 4]: 4, array[float32, 12]: 12}.get(kind)
        found[part] = values.get(part, [0.0] * long if long else kind is not bool and 0)
    return TYPES[name](**found)


@dataclass
class DdsStandIn(StandIn):
    """PX4 as :class:`StandIn`, by DDS.

    Attributes:
        vehicle: whose rotors its motors turn. domain, space: of its topics. zero: s of
            its clock at its start.
        mixed: frame of the odometry's velocity is the base.
    """

    vehicle: Vehicle | None = None
    domain: int = 0
    space: str = ""
    zero: float = 500.0
    mixed: bool = False
    stamps: list[int] = field(default_factory=list)
    controls: list[list[float]] = field(default_factory=list)

    def __enter__(self) -> DdsStandIn:
        me = DomainParticipant(self.domain)
        qos = Qos(
            Policy.Reliability.BestEffort,
            Policy.Durability.TransientLocal,
            Policy.History.KeepLast(1),
        )
        topics = {
            name: Topic(me, f"rt{self.space}/fmu/{way}/{name}", TYPES[kind])
            for way, table in (("out", SENT), ("in", READ))
            for name, kind in table.items()
        }
        self._writers = {name: DataWriter(me, topics[name], qos=qos) for name in SENT}
        late = Qos(Policy.Reliability.BestEffort, Policy.History.KeepLast(10))
        self._inbox = {name: DataReader(me, topics[name], qos=late) for name in READ}
        self.p, self.v = np.array(self.place, dtype=float), np.zeros(3)
        c, s = np.cos(self.heading), np.sin(self.heading)
        self.R, self.w = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]]), np.zeros(3)
        assert self.vehicle is not None
        full = np.array(
            [
                float(r.thrust_coefficient) * float(r.max_speed) ** 2
                for r in self.vehicle.rotors
            ]
        )
        self._full, self._thrusts = (
            full,
            full * (float(self.vehicle.mass) * GRAVITY / full.sum()),
        )
        self._asked_at, self._alive = -np.inf, -np.inf
        self._stop, self._since = threading.Event(), np.inf
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join(2.0)
        self._writers.clear()
        self._inbox.clear()

    def _say(self, name: str, **values: Any) -> None:
        self._writers[name].write(message(SENT[name], **values))

    def _integrate(self, dt: float) -> None:
        """Move on by a step: Newton's and Euler's laws in forward, right, down."""
        if not self.offboard:
            self.v[:], self.w[:] = 0.0, 0.0
            return
        vehicle = self.vehicle
        assert vehicle is not None
        torque = np.zeros(3)
        for rotor, thrust in zip(vehicle.rotors, self._thrusts, strict=True):
            x, y, z = (float(c) for c in rotor.position)
            torque += np.cross([x, -y, -z], [0.0, 0.0, -thrust])
            torque[2] += (
                float(rotor.direction) * float(rotor.moment_coefficient) * thrust
            )
        inertia = vehicle.base.inertia
        J = np.diag([float(c) for c in (inertia.xx, inertia.yy, inertia.zz)])
        self.w += np.linalg.solve(J, torque - np.cross(self.w, J @ self.w)) * dt
        self.R = turned(self.R, self.w * dt)
        self.v += (
            self.R[:, 2] * (-self._thrusts.sum() / float(vehicle.mass))
            + [0, 0, GRAVITY]
        ) * dt
        self.p += self.v * dt
        self.path.append(self.p.copy())

    def _report(self, steps: int, now: float, since: float) -> None:
        stamp = round((now - 500.0 + self.zero) * 1e6)
        velocity = self.R.T @ self.v if self.mixed else self.v
        self._say(
            "sensor_combined", timestamp=stamp, accelerometer_m_s2=[0.0, 0.0, -GRAVITY]
        )
        self._say(
            "vehicle_odometry",
            timestamp=stamp + 900,
            timestamp_sample=stamp,
            pose_frame=1,
            position=[
                np.nan if since >= self.nan_at else float(self.p[0]),
                *map(float, self.p[1:]),
            ],
            q=quaternion_of(self.R),
            velocity_frame=3 if self.mixed else 1,
            velocity=[float(c) for c in velocity],
            angular_velocity=[float(c) for c in self.w],
        )
        if steps % 25 == 0:
            armed = self.armed and since < self.disarms_at
            mode = "offboard" if self.offboard else "auto"
            held = {f"flag_control_{mode}_enabled": True, "flag_armed": armed}
            self._say("vehicle_control_mode", timestamp=stamp, **held)
            self._say("vehicle_land_detected", timestamp=stamp, landed=self.landed)

    def _read(self, now: float) -> None:
        for name, reader in self._inbox.items():
            try:
                taken = [each for each in reader.take(20) if hasattr(each, "timestamp")]
            except DDSException:
                continue
            for each in taken:
                self.seen.append(name)
                getattr(self, f"_hear_{name}")(each, now)

    def _hear_offboard_control_mode(self, m: Any, now: float) -> None:
        assert m.direct_actuator
        self._alive = now
        self.stamps.append(m.timestamp)

    def _hear_actuator_motors(self, m: Any, now: float) -> None:
        count = len(self._full)
        assert all(np.isnan(m.control[count:]))
        self.controls.append(m.control[:count])
        self._thrusts = self._full * np.clip(m.control[:count], 0.0, 1.0)
        self.setpoints.append(now)

    def _hear_vehicle_command(self, m: Any, now: float) -> None:
        assert (m.command, m.param1, m.from_external) == (176, 1.0, True)
        wants = m.param2 == 6.0
        self.asked.append("offboard" if wants else "hold")
        taken = not (wants and (self.refuses or now - self._alive > 0.5))
        if taken and wants != self.offboard:
            self.offboard, self._since = wants, now if wants else np.inf
            self.modes.append("offboard" if wants else "hold")
        # another program's
        self._say("vehicle_command_ack_v1", command=176, result=0, target_system=9)
        who = {"target_system": m.source_system, "target_component": m.source_component}
        self._say(
            "vehicle_command_ack_v1", command=176, result=0 if taken else 1, **who
        )
