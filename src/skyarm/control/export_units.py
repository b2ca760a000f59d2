"""Units and meaning of every field that an exported controller reads or writes: the comments of its C structs."""

from __future__ import annotations

from skyarm.control.export_units_learned import LEARNED_NOTES

NOTES = {
    "Measurement.time": "s",
    "Measurement.position": "m, base origin, world axes",
    "Measurement.quaternion": "w x y z, unit, base to world",
    "Measurement.velocity": "m/s, base origin, world axes",
    "Measurement.rate": "rad/s, gyroscope, base axes",
    "Measurement.specific_force": "m/s^2, accelerometer, base axes, +g along z in hover",
    "Measurement.joints": "rad or m, see the joints above",
    "Measurement.joint_rates": "rad/s or m/s",
    "Measurement.rotor_speeds": "rad/s, unsigned",
    "Reference.position": "m, base origin, world axes",
    "Reference.velocity": "m/s, world axes",
    "Reference.acceleration": "m/s^2, world axes",
    "Reference.jerk": "m/s^3, world axes",
    "Reference.snap": "m/s^4, world axes",
    "Reference.yaw": "rad, heading about world z",
    "Reference.yaw_rate": "rad/s",
    "Reference.yaw_acceleration": "rad/s^2",
    "Reference.joints": "rad or m",
    "Reference.joint_rates": "rad/s or m/s",
    "Reference.joint_accelerations": "rad/s^2 or m/s^2",
    "Reference.joint_jerks": "rad/s^3 or m/s^3",
    "Reference.joint_snaps": "rad/s^4 or m/s^4",
    "Command.rotor_speeds": "rad/s, unsigned, in the order of the rotors above",
    "Command.efforts": "N m or N, in the order of the joints above",
    "Constants.period": "s, between two calls",
    "Model.gravity": "m/s^2",
    "Body.mass": "kg",
    "Body.com": "m, centre of mass, axes of its link",
    "Body.inertia": "kg m^2, about the centre of mass, axes of its link",
    "Joint.axis": "unit vector, joint axes",
    "Joint.position": "m, joint origin, axes of the parent link",
    "Joint.rotation": "joint axes to axes of the parent link",
    "Joint.effort_limit": "N m or N, largest effort of the joint",
    "Frame.position": "m, a named frame (the tool), axes of its link",
    "Frame.rotation": "axes of a named frame to those of its link",
    "GeometricGains.position": "N/m, Kp",
    "GeometricGains.velocity": "N s/m, Kv",
    "GeometricGains.attitude": "N m/rad, KR",
    "GeometricGains.rate": "N m s/rad, Kw",
    "JointGains.stiffness": "1/s^2: acceleration per error of the joint",
    "JointGains.damping": "1/s: acceleration per error of the joint's rate",
    "Mixer.inverse": "(rad/s)^2 per N m about x, y, z and per N of thrust, a row a rotor; follows from the rotors",
    "Mixer.highest": "(rad/s)^2, largest squared speed of each rotor",
    **LEARNED_NOTES,
}
"""Comment of each field by the record that holds it."""

TORQUE_NOTES = {
    "JointGains.stiffness": "N m/rad or N/m: effort per error of the joint",
    "JointGains.damping": "N m s/rad or N s/m: effort per error of the joint's rate",
}
"""The same gains in a law that closes the joints on torque."""

STRUCTS = {
    "measurement": "What the sensors say.",
    "reference": "Desired motion.",
    "memory": "What the law keeps from one call to the next; begin with the first memory.",
    "command": "What the actuators are asked for.",
    "parameters": "What the law believes and how hard it pulls; exact zeros and ones are folded into the code.",
}
"""Comment of each struct."""
