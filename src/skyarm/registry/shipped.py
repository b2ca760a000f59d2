"""What the library registers of its own, kind -> name -> (where it is, one line), and other names of it."""

from __future__ import annotations

from collections.abc import Mapping

_WIND = "skyarm.environment.wind"
_DISTURBANCE = "skyarm.environment.disturbance_signals"
_AERODYNAMIC = "skyarm.environment.aerodynamic_forces"
_MOTION = "skyarm.reference.reference_tables"
_TASKS = "skyarm.reference.task_tables"
_SENSORS = "skyarm.sensors.sensor_kinds"
_FORCE = "skyarm.sensors.force_sensors"
_LAWS = "skyarm.control.catalogue.law_entries"

SHIPPED: Mapping[str, Mapping[str, tuple[str, str]]] = {
    "air": {
        "moving_air": (f"{_WIND}:MovingAir", "moving air with gusts and Dryden turbulence"),
        "air_signals": (f"{_DISTURBANCE}:AirSignals", "velocity of the air as signals of time, and noise"),
    },
    "force": {
        "force_wind": (f"{_WIND}:ForceWind", "a force on the base and an air speed, as RotorS types them"),
        "disturbance": (f"{_DISTURBANCE}:Disturbance", "force and torque at a frame as signals of time, and noise"),
        "ground_effect": (f"{_AERODYNAMIC}:GroundEffect", "thrust that grows near the ground"),
        "link_drag": (f"{_AERODYNAMIC}:LinkDrag", "drag of the arm's links in moving air"),
        "rotor_drag": (f"{_AERODYNAMIC}:RotorDrag", "thrust lost by climbing, and translational lift"),
    },
    "sensor": {
        "full_state": ("skyarm.sensors.noise:SensorNoise", "the full state with white noise"),
        "imu": (f"{_SENSORS}:Imu", "angular rate and specific force"),
        "pose": (f"{_SENSORS}:Pose", "position and attitude, as of motion capture"),
        "position": (f"{_SENSORS}:Position", "position, as of satellite navigation"),
        "heading": (f"{_SENSORS}:Heading", "yaw, as of a compass"),
        "encoders": (f"{_SENSORS}:Encoders", "positions and rates of the joints"),
        "force_torque": (f"{_FORCE}:ForceTorque", "force and torque that push at the tip or another frame"),
        "tactile_switch": (f"{_FORCE}:TactileSwitch", "whether anything pushes there"),
    },
    "estimator": {
        "pass_through": ("skyarm.estimate.estimator:PassThrough", "the full state as it was read"),
        "ekf": ("skyarm.estimate.error_state_filter:ErrorStateFilter", "error-state Kalman filter on an inertial unit"),
    },
    "drive": {
        "torque": ("skyarm.actuation.drive:TorqueDrive", "the setpoint is the torque"),
        "lagged_torque": (
            "skyarm.actuation.lagged_torque:LaggedTorque",
            "a torque that follows its setpoint with a first-order lag",
        ),
        "position_servo": ("skyarm.actuation.servo:PositionServo", "a servo whose setpoint is the joint's position"),
        "velocity_servo": ("skyarm.actuation.servo:VelocityServo", "a servo whose setpoint is the joint's rate"),
    },
    "law": {
        "rotors_sim_position": (f"{_LAWS}:rotors_sim_position", ""),
        "decoupled_pd": (f"{_LAWS}:decoupled_pd", ""),
        "hybrid_computed_torque": (f"{_LAWS}:hybrid_computed_torque", ""),
        "hybrid_computed_torque_euler": (f"{_LAWS}:hybrid_computed_torque_euler", ""),
        "nmpc": (f"{_LAWS}:nmpc", ""),
        "learned_compensator": (f"{_LAWS}:learned_compensator", ""),
        "ct_level_gravity": (f"{_LAWS}:ct_level_gravity", ""),
        "ct_coupled_thrust": (f"{_LAWS}:ct_coupled_thrust", ""),
        "ct_consistent": (f"{_LAWS}:ct_consistent", ""),
        "ct_observer": (f"{_LAWS}:ct_observer", ""),
        "ct_feedforward": (f"{_LAWS}:ct_feedforward", ""),
        "ct_extrapolation": (f"{_LAWS}:ct_extrapolation", ""),
        "ct_lag_inversion": (f"{_LAWS}:ct_lag_inversion", ""),
        "bulut2019": (f"{_LAWS}:bulut2019", ""),
        "guo2023": (f"{_LAWS}:guo2023", ""),
        "li2024": (f"{_LAWS}:li2024", ""),
        "kim2013": (f"{_LAWS}:kim2013", ""),
        "l1_adaptive": (f"{_LAWS}:l1_adaptive", ""),
        "l1_adaptive_lateral": (f"{_LAWS}:l1_adaptive_lateral", ""),
        "indi": (f"{_LAWS}:indi", ""),
        "admittance_pd": (f"{_LAWS}:admittance_pd", ""),
        "hybrid_ct": (f"{_LAWS}:hybrid_ct", ""),
        "centroidal": (f"{_LAWS}:centroidal", ""),
    },
    "motion": {
        "hover": (f"{_MOTION}:hover_table", "stay at a place"),
        "circle": (f"{_MOTION}:circle_table", "a circle in the horizontal plane"),
        "signals": (f"{_MOTION}:signals_table", "a signal for each axis"),
        "waypoints": (f"{_TASKS}:waypoints_table", "least snap through points, as fast as the limits let"),
        "samples": (f"{_TASKS}:samples_table", "smooth through the rows of a CSV file"),
        "phases": ("skyarm.reference.phases:phases_table", "a task: hold, go to, pick, place"),
    },
    "log_format": {
        "npz": ("skyarm.log.formats:NPZ", "arrays and all that was flown; read back by skyarm"),
        "csv": ("skyarm.log.formats:CSV", "a column a number with its name and unit, a row a control instant"),
        "mcap": ("skyarm.log.formats:MCAP", "messages of ROS 2 for Foxglove, PlotJuggler, RViz; read back by skyarm"),
        "parquet": ("skyarm.log.formats:PARQUET", "columns with units in their metadata; read back by skyarm"),
        "bag": ("skyarm.log.formats:BAG", "messages of ROS 1, as in an MCAP file"),
        "partial": ("skyarm.log.formats:PARTIAL", "the journal that a killed run leaves; read back by skyarm"),
    },
    "plant": {
        "rigid_body": ("skyarm.plant.compiled:RigidBodyPlant", "our own multibody dynamics"),
        "mujoco": ("skyarm.plant.mujoco:MujocoPlant", "MuJoCo's rigid bodies under the same loads"),
        "mujoco_contacts": ("skyarm.plant.mujoco_contacts:MujocoContactPlant", "the same with MuJoCo's own contacts"),
    },
    "ending": {
        "divergence": ("skyarm.scenario.endings:Divergence", "numbers that no flight has"),
        "joint_limits": ("skyarm.scenario.endings:JointLimits", "a joint past its limit"),
        "law_undefined": ("skyarm.scenario.endings:LawUndefined", "an attitude at which the law is not defined"),
        "ground": ("skyarm.scenario.endings:Ground", "the lowest point at z = 0"),
    },
}

ALIASES: Mapping[str, Mapping[str, str]] = {"law": {"exact": "centroidal"}}
"""Other names that stay: kind -> alias -> name."""

OLD_NAMES: Mapping[str, Mapping[str, str]] = {
    "air": {"airspeed": "moving_air"},
    "force": {"rotors_force": "force_wind"},
    "law": {
        "rotors_position": "rotors_sim_position",
        "bulut_computed_torque_style": "bulut2019",
        "guo_center_of_inertia_style": "guo2023",
        "li_feedforward_style": "li2024",
        "kim_sliding_mode_style": "kim2013",
        "learned_compensator_style": "learned_compensator",
    },
}
"""Names of the last version, which work with a warning: kind -> old -> new."""

RESERVED: Mapping[str, Mapping[str, tuple[str, ...]]] = {
    "command": {
        "a command": (
            *("reproduce", "run", "list", "show", "export-c", "cache", "replay", "diff", "export", "plot", "film"),
            *("sweep", "stats", "margins", "basin", "bench", "compare", "studio"),
            *("check", "new", "doctor", "attach", "export-mjcf", "tune", "identify"),
        ),
    },
    "law": {
        "a preset": (
            *("paper_ct", "paper_ct_euler", "paper_pd", "rotors_sim_hummingbird", "rotors_hummingbird"),
            *("centroidal_joint", "centroidal_joint_robust", "centroidal_joint_stiff", "centroidal_joint_gusts"),
            *("centroidal_tip", "centroidal_tip_robust", "centroidal_tip_stiff", "centroidal_tip_gusts"),
            *("exact_joint", "exact_joint_stiff", "exact_ee", "exact_ee_stiff"),
        ),
        "the controller of the scenario": ("own",),
    },
}
"""Names that stand for something else where the registry's do: kind -> what they are -> names."""

TUNED = "_tuned"
"""Ending of a shipped law's name that stands for its tuned gains."""


def reserved_for(kind: str, name: str) -> str | None:
    """What of the library a name stands for already, in words; None where it is free or registered itself."""
    if kind == "law" and name.endswith(TUNED) and name.removesuffix(TUNED) in (*SHIPPED["law"], *ALIASES["law"]):
        return f"the tuned gains of {name.removesuffix(TUNED)!r}"
    return next((what for what, names in RESERVED.get(kind, {}).items() if name in names), None)
