"""Names registered by the library: kind -> name -> (location, title).

Leaves are rooms that nothing imports (``pyproject.toml``): links, identification with its flight data, the paper. What
they perform is found by its row here.
"""

from __future__ import annotations

from collections.abc import Mapping

_WIND = "skyarm.world.wind"
_DISTURBANCE = "skyarm.world.disturbance_signals"
_AERODYNAMIC = "skyarm.world.aerodynamic_forces"
_SIGNAL = "skyarm.reference.signal_tables"
_MOTION = "skyarm.reference.reference_tables"
_TASKS = "skyarm.reference.waypoints"
_SENSORS = "skyarm.sensing.sensor_kinds"
_NAVIGATION = "skyarm.sensing.navigation_sensors"
_LAWS = "skyarm.control.laws"
_AUTOPILOTS = "skyarm.links.autopilots"
_FLIGHTS = "skyarm.flight_data"
_CLI = "skyarm.cli"
_IDENTIFY = "skyarm.studies.identify"

SECTIONS: Mapping[str, Mapping[str, tuple[str, str]]] = {
    "Vehicles": {
        "show": (f"{_CLI}.show_command:show", "List what ships, or show a vehicle or a flight."),
        "check": (f"{_CLI}.check_command:check", "Check whether a vehicle can fly, and why not."),
        "new": (f"{_CLI}.new_command:new", "Write starter files of a vehicle, scenario, law or study."),
    },
    "Flights": {
        "run": (f"{_CLI}.run_command:run", "Fly a scenario; write its log (npz, CSV, MCAP)."),
        "fly": ("skyarm.links.fly_command:fly", "Fly through an autopilot, by a law that runs here."),
        "diff": (f"{_CLI}.diff_command:diff", "Compare two logs, or a log with its flight flown again."),
        "plot": (f"{_CLI}.plot_command:plot", "Draw flights, or curves of a sweep's metrics."),
        "film": (f"{_CLI}.film_command:film", "Film flights; MP4, WebP, or a 3-D recording."),
        "studio": (f"{_CLI}.studio_command:studio", "Fly live on a page: sliders, gusts, laws side by side."),
        "export": (f"{_CLI}.export_command:export", "Write a log, a law as C, or a vehicle as MJCF."),
    },
    "Laws and studies": {
        "identify": (
            f"{_IDENTIFY}.identify_command:identify",
            "Identify a vehicle, or delays and lags, from flights.",
        ),
        "margins": (f"{_CLI}.margins_command:margins", "Linearise the closed loop: eigenvalues, margins."),
        "tune": (f"{_CLI}.tune_command:tune", "Tune a law's gains for a vehicle; write the Pareto front."),
        "compare": (f"{_CLI}.compare_command:compare", "Compare laws on a suite of trials, or on a scenario."),
        "sweep": (f"{_CLI}.sweep_command:sweep", "Fly a study's episodes, or sum up the folder of a sweep."),
        "reproduce": (
            "skyarm.studies.paper.reproduce_command:reproduce",
            "Repeat the flights of the paper by Barakou (2026).",
        ),
    },
    "Installation": {
        "doctor": (f"{_CLI}.doctor_command:doctor", "Check the installation and the cache of machine code."),
    },
}
"""Section of the help -> command -> (location, line of the help), in the order of the help.

Where the module of a command has SUBCOMMANDS, words and functions, a command of its own stands behind each word.
"""

OPTIONS: Mapping[str, str] = {
    "run --ros": "skyarm.links.ros.live_flight:fly_with_topics",
    "show FLIGHT": f"{_IDENTIFY}.flight_page:show_flight",
    "studio --vehicle": f"{_IDENTIFY}.flight_replay:replay_of",
}
"""Command-line option that a separate module performs -> location of the function in that module."""

SHIPPED: Mapping[str, Mapping[str, tuple[str, str]]] = {
    "air": {
        "moving_air": (f"{_WIND}:MovingAir", "moving air with gusts and Dryden turbulence"),
        "air_signals": (f"{_DISTURBANCE}:AirSignals", "velocity of the air as signals of time, and noise"),
    },
    "force": {
        "force_wind": (f"{_WIND}:ForceWind", "a force on the base and an air speed, as RotorS types them"),
        "disturbance": (f"{_DISTURBANCE}:Disturbance", "force and torque at a frame as signals of time, and noise"),
        "ground_effect": (f"{_AERODYNAMIC}:GroundEffect", "thrust that grows near the ground"),
        "launch_stand": ("skyarm.world.launch_stand:LaunchStand", "a stand from which the vehicle takes off"),
        "link_drag": (f"{_AERODYNAMIC}:LinkDrag", "drag of the arm's links in moving air"),
        "rotor_drag": (f"{_AERODYNAMIC}:RotorDrag", "thrust lost by climbing, and translational lift"),
    },
    "fault": {
        "loss": ("skyarm.world.faults:Fault", "a rotor or a joint's drive that loses force, or a joint that is stuck"),
    },
    "payload": {
        "rigid": ("skyarm.world.timed_payload:TimedPayload", "a rigid load on the frame that holds it"),
        "hanging": ("skyarm.world.hanging_payload:HangingPayload", "a point mass on a cord"),
    },
    "world": {
        "contact": ("skyarm.world.contact.contact:Contact", "surfaces, objects, grippers and the points that touch"),
    },
    "signal": {
        "constant": (f"{_SIGNAL}:constant_from", "one value, within a window"),
        "sine": (f"{_SIGNAL}:sine_from", "a sine, within a window"),
        "ramp": ("skyarm.reference.signals:Ramp", "from nothing to a height, linear or smooth"),
        "sequence": (f"{_SIGNAL}:sequence_from", "ramps one after the other"),
        "sum": ("skyarm.reference.signals:Sum", "of several signals"),
        "windowed": (f"{_SIGNAL}:windowed_from", "a signal that is zero outside of a window"),
        "shifted": ("skyarm.reference.signals:Shifted", "a signal some time later"),
        "product": ("skyarm.reference.signals:Product", "of two signals"),
        "pulses": ("skyarm.reference.signals:Pulses", "on for a part of each period"),
        "spline": ("skyarm.reference.waypoints:spline_signal", "least snap through values at instants"),
        "samples": ("skyarm.reference.waypoints:samples_signal", "a column of a file"),
    },
    "sensor": {
        "full_state": ("skyarm.sensing.measurement:SensorNoise", "the full state with white noise"),
        "imu": (f"{_SENSORS}:Imu", "angular rate and specific force"),
        "pose": (f"{_SENSORS}:Pose", "position and attitude, as of motion capture"),
        "position": (f"{_SENSORS}:Position", "position, as of satellite navigation"),
        "heading": (f"{_SENSORS}:Heading", "yaw, as of a compass"),
        "gnss": (f"{_NAVIGATION}:Gnss", "position and velocity, as of satellite navigation"),
        "magnetometer": (f"{_NAVIGATION}:Magnetometer", "magnetic field of the Earth in base axes"),
        "barometer": (f"{_NAVIGATION}:Barometer", "static pressure and temperature of the air"),
        "encoders": (f"{_SENSORS}:Encoders", "positions and rates of the joints"),
        "force_torque": (f"{_SENSORS}:ForceTorque", "force and torque that push at the tip or another frame"),
        "tactile_switch": (f"{_SENSORS}:TactileSwitch", "whether anything pushes there"),
    },
    "estimator": {
        "pass_through": ("skyarm.sensing.estimate.estimator:PassThrough", "the full state as it was read"),
        "ekf": (
            "skyarm.sensing.estimate.error_state_filter:ErrorStateFilter",
            "error-state Kalman filter on an inertial unit",
        ),
    },
    "drive": {
        "torque": ("skyarm.dynamics.actuators.drive:TorqueDrive", "the setpoint is the torque"),
        "lagged_torque": (
            "skyarm.dynamics.actuators.drive:LaggedTorque",
            "a torque that follows its setpoint with a first-order lag",
        ),
        "position_servo": (
            "skyarm.dynamics.actuators.servo:PositionServo",
            "a servo whose setpoint is the joint's position",
        ),
        "velocity_servo": (
            "skyarm.dynamics.actuators.servo:VelocityServo",
            "a servo whose setpoint is the joint's rate",
        ),
    },
    "law": {
        "rotors_sim_position": (
            f"{_LAWS}.paper:make_rotors_sim_position",
            "RotorS's geometric position controller, joints free",
        ),
        "decoupled_pd": (
            f"{_LAWS}.paper:make_decoupled_pd",
            "the paper's baseline: RotorS's controller and joint PD, no coupling",
        ),
        "hybrid_computed_torque": (
            f"{_LAWS}.paper:make_hybrid_computed_torque",
            "the paper's law: geometric accelerations through the coupled inverse dynamics",
        ),
        "nmpc": (f"{_LAWS}.predictive.law:make_predictive_controller", "whole-body model predictive control"),
        "learned_compensator": (
            f"{_LAWS}.learned.law:make_learned_controller",
            "the paper's law and a network for what its model leaves out",
        ),
        "ct_ladder": (
            f"{_LAWS}.ladder:make_stepped",
            "the paper's law with one to six of the steps that lead to the centroidal law",
        ),
        "bulut2019": (
            f"{_LAWS}.published.bulut:make_bulut",
            "computed torque on position, Euler angles and joints, translation decoupled in the mass matrix",
        ),
        "guo2023": (
            f"{_LAWS}.published.guo:make_guo",
            "SE(3) control of the centre of mass with the locked inertia, joints as servos",
        ),
        "li2024": (
            f"{_LAWS}.published.li:make_li",
            "geometric base with variable inertia and feed-forward of the arm's reaction, joints as servos",
        ),
        "kim2013": (
            f"{_LAWS}.published.kim:make_kim",
            "adaptive sliding mode through the coupled inverse dynamics",
        ),
        "l1_adaptive": (
            f"{_LAWS}.published.l1:make_l1",
            "L1 adaptive augmentation: predictor, piecewise-constant adaptation, low-pass",
        ),
        "indi": (
            f"{_LAWS}.published.indi:make_indi",
            "incremental nonlinear dynamic inversion of base and joints with its filters",
        ),
        "admittance_pd": (
            f"{_LAWS}.pressing:make_admittance_pd",
            "a virtual mass shifts the reference until the wanted force acts; the paper's baseline tracks it",
        ),
        "hybrid_ct": (
            f"{_LAWS}.pressing:make_hybrid_ct",
            "the paper's law tangential to a surface, a force along its normal",
        ),
        "centroidal": (
            f"{_LAWS}.centroidal.make:make_centroidal",
            "centroidal computed torque with disturbance observer: joints or tip on their references",
        ),
    },
    "autopilot": {
        "px4": (f"{_AUTOPILOTS}.px4:make_px4", "PX4 flies the base, a joint law the arm"),
        "ardupilot": (f"{_AUTOPILOTS}.ardupilot:make_ardupilot", "ArduPilot flies the base, a joint law the arm"),
        "betaflight": (f"{_AUTOPILOTS}.betaflight:make_betaflight", "Betaflight flies the base, a joint law the arm"),
    },
    "motion": {
        "hover": (f"{_MOTION}:hover_table", "stay at a place"),
        "circle": (f"{_MOTION}:circle_table", "a circle in the horizontal plane"),
        "signals": (f"{_MOTION}:signals_table", "a signal for each axis"),
        "waypoints": (f"{_TASKS}:waypoints_table", "least snap through points, as fast as the limits let"),
        "phases": ("skyarm.reference.phases:phases_table", "a task: hold, go to, pick, place"),
    },
    "log_format": {
        "npz": ("skyarm.log.formats:NPZ", "arrays and all that was flown; read back by skyarm"),
        "csv": ("skyarm.log.formats:CSV", "a column a number with its name and unit, a row a control instant"),
        "mcap": ("skyarm.log.formats:MCAP", "messages of ROS 2 for Foxglove, PlotJuggler, RViz; read back by skyarm"),
    },
    "flight_format": {
        "crazyflie": (f"{_FLIGHTS}.crazyflie_log:CRAZYFLIE", "a Crazyflie's log on its memory card"),
        "ulog": (f"{_FLIGHTS}.ulog:ULOG", "a log of PX4"),
        "bag": (f"{_FLIGHTS}.rosbag:BAG", "a bag of ROS 1"),
        "mcap": (f"{_FLIGHTS}.rosbag:MCAP", "a bag of ROS 2, or a log of skyarm"),
        "db3": (f"{_FLIGHTS}.rosbag:DATABASE", "a bag of ROS 2 as a database, or the folder of a bag"),
        "npz": (f"{_FLIGHTS}.own_log:OWN_LOG", "a log of skyarm"),
        "csv": (f"{_FLIGHTS}.table_file:TABLE", "a table of text with a mapping of its columns"),
    },
    "plant": {
        "rigid_body": ("skyarm.plant.compiled:RigidBodyPlant", "our own multibody dynamics"),
        "mujoco": ("skyarm.plant.mujoco:MujocoPlant", "MuJoCo's rigid bodies under the same loads"),
    },
    "ending": {
        "divergence": ("skyarm.scenario.endings:Divergence", "numbers that no flight has"),
        "joint_limits": ("skyarm.scenario.endings:JointLimits", "a joint past its limit"),
        "law_undefined": ("skyarm.scenario.endings:LawUndefined", "an attitude at which the law is not defined"),
        "ground": ("skyarm.scenario.endings:Ground", "the lowest point at z = 0"),
        "clearance": ("skyarm.scenario.endings:Clearance", "bodies too near to each other or to a fixed surface"),
    },
    "command": {name: row for section in SECTIONS.values() for name, row in section.items()},
}

RESERVED: Mapping[str, Mapping[str, tuple[str, ...]]] = {
    "command": {"a command": (*SHIPPED["command"],)},
    "law": {
        "a preset": (
            *("paper_ct", "paper_ct_euler", "paper_pd", "rotors_sim_hummingbird"),
            *("centroidal_joint", "centroidal_joint_robust", "centroidal_joint_stiff", "centroidal_joint_gusts"),
            *("centroidal_tip", "centroidal_tip_robust", "centroidal_tip_stiff", "centroidal_tip_gusts"),
        ),
        "the controller of the scenario": ("own",),
    },
}
"""Names that users cannot register: kind -> description of the present owner -> names."""

TUNED = "_tuned"
"""Suffix of a shipped law's name that selects its tuned gains."""


def reserved_for(kind: str, name: str) -> str | None:
    """Description of the library object that already has a name; None if the name is free for users."""
    if kind == "law" and name.endswith(TUNED) and name.removesuffix(TUNED) in SHIPPED["law"]:
        return f"the tuned gains of {name.removesuffix(TUNED)!r}"
    return next((what for what, names in RESERVED.get(kind, {}).items() if name in names), None)
