"""Topics of PX4's uXRCE-DDS client for an external control law: message types and
their fields.

Facts of PX4 v1.17 and v1.18: its client publishes below ``/fmu/out`` and reads below
``/fmu/in``, each topic at 100 Hz at most, with times in microseconds of its own clock,
or of the agent's where it synchronises them (``UXRCE_DDS_SYNCT``).
"""

from __future__ import annotations

from collections.abc import Mapping

DEFINITIONS: Mapping[str, str] = {
    "px4_msgs/VehicleOdometry": (
        "uint64 timestamp\nuint64 timestamp_sample\nuint8 pose_frame\nfloat32[3]"
        " position\nfloat32[4] q\nuint8 velocity_frame\nfloat32[3] velocity\nfloat32[3]"
        " angular_velocity\nfloat32[3] position_variance\nfloat32[3]"
        " orientation_variance\nfloat32[3] velocity_variance\nuint8 reset_counter\nint8"
        " quality"
    ),
    "px4_msgs/SensorCombined": (
        "uint64 timestamp\nfloat32[3] gyro_rad\nuint32 gyro_integral_dt\nint32"
        " accelerometer_timestamp_relative\nfloat32[3] accelerometer_m_s2\nuint32"
        " accelerometer_integral_dt\nuint8 accelerometer_clipping\nuint8"
        " gyro_clipping\nuint8 accel_calibration_count\nuint8 gyro_calibration_count"
    ),
    "px4_msgs/VehicleControlMode": (
        "uint64 timestamp\nbool flag_armed\nbool"
        " flag_multicopter_position_control_enabled\nbool"
        " flag_control_manual_enabled\nbool flag_control_auto_enabled\nbool"
        " flag_control_offboard_enabled"
    ),
    "px4_msgs/VehicleLandDetected": (
        "uint64 timestamp\nbool freefall\nbool ground_contact\nbool maybe_landed\nbool"
        " landed\nbool in_ground_effect\nbool in_descend\nbool has_low_throttle\nbool"
        " vertical_movement\nbool horizontal_movement\nbool rotational_movement\nbool"
        " close_to_ground_or_skipped_check\nbool at_rest"
    ),
    "px4_msgs/VehicleCommandAck": (
        "uint64 timestamp\nuint32 command\nuint8 result\nuint8 result_param1\nint32"
        " result_param2\nuint8 target_system\nuint16 target_component\nbool"
        " from_external"
    ),
    "px4_msgs/VehicleCommand": (
        "uint64 timestamp\nfloat32 param1\nfloat32 param2\nfloat32 param3\nfloat32"
        " param4\nfloat64 param5\nfloat64 param6\nfloat32 param7\nuint32 command\nuint8"
        " target_system\nuint8 target_component\nuint8 source_system\nuint16"
        " source_component\nuint8 confirmation\nbool from_external"
    ),
    "px4_msgs/OffboardControlMode": (
        "uint64 timestamp\nbool position\nbool velocity\nbool acceleration\nbool"
        " attitude\nbool body_rate\nbool thrust_and_torque\nbool direct_actuator"
    ),
    "px4_msgs/ActuatorMotors": (
        "uint64 timestamp\nuint64 timestamp_sample\nuint16"
        " reversible_flags\nfloat32[12] control"
    ),
}
"""Message type -> the fields that are read or sent; v1.17 and v1.18 have other fields
behind those of the mode."""

TYPES: Mapping[str, str] = {
    **DEFINITIONS,
    "px4_msgs/VehicleControlMode": (
        DEFINITIONS["px4_msgs/VehicleControlMode"]
        + "\nbool flag_control_position_enabled\nbool flag_control_velocity_enabled\n"
        "bool flag_control_altitude_enabled\nbool flag_control_climb_rate_enabled\n"
        "bool flag_control_acceleration_enabled\nbool flag_control_attitude_enabled\n"
        "bool flag_control_rates_enabled\nbool flag_control_allocation_enabled\n"
        "bool flag_control_termination_enabled\nuint8 source_id"
    ),
}
"""Message type -> its fields in v1.17, by which DDS matches it; PX4's own agent matches
by the name alone."""

ODOMETRY = "/fmu/out/vehicle_odometry"

OUT: Mapping[str, str] = {
    # taken before the estimates, which carry the newest force
    "/fmu/out/sensor_combined": "px4_msgs/SensorCombined",
    ODOMETRY: "px4_msgs/VehicleOdometry",
    "/fmu/out/vehicle_control_mode": "px4_msgs/VehicleControlMode",
    "/fmu/out/vehicle_land_detected": "px4_msgs/VehicleLandDetected",
    "/fmu/out/vehicle_command_ack": "px4_msgs/VehicleCommandAck",
    "/fmu/out/vehicle_command_ack_v1": "px4_msgs/VehicleCommandAck",
}
"""Topic that PX4 publishes -> its type; v1.17 marks the second version of a type in the
topic's name."""

COMMAND, ALIVE, MOTORS = (
    "/fmu/in/vehicle_command",
    "/fmu/in/offboard_control_mode",
    "/fmu/in/actuator_motors",
)

IN: Mapping[str, str] = {
    COMMAND: "px4_msgs/VehicleCommand",
    ALIVE: "px4_msgs/OffboardControlMode",
    MOTORS: "px4_msgs/ActuatorMotors",
}
"""Topic that PX4 reads -> its type."""

MOST_MOTORS = 12
"""Number of motors in a set point."""
