"""Live ROS topics of a simulation session, and commands and goals from ROS.

Topics are those of a log (:mod:`skyarm.log.ros.topics`) with the clock, the rotors and
the applied command. In come

* ``/skyarm/command``: rotor speeds (rad/s), joint efforts or setpoints, and angles of
  tilting rotors (rad) in one list, in the place of the law's command until ``timeout``
  after the last message; not where an autopilot flies;
* ``/skyarm/goal``: pose of the base, ``/skyarm/joint_goal``: positions of named joints;
  the reference moves there smoothly and stays, whether more messages come or not.

Of several vehicles all but the clock begin with the vehicle's name:
``/left/skyarm/goal``.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Mapping
from functools import partial

import numpy as np

from skyarm.dynamics.actuators import Command
from skyarm.dynamics.actuators.rotor import require_speeds
from skyarm.links.ros.goals import (
    base_goal,
    changes_to,
    check_reach,
    goal_paths,
    joint_goal,
    takes_goals,
    with_goals,
)
from skyarm.links.ros.node import Content, Node
from skyarm.log.flight_log import Log
from skyarm.log.log_columns import names_of
from skyarm.log.ros.message_bytes import MessageError, decode, encode
from skyarm.log.ros.messages import DEFINITIONS, FLIGHT
from skyarm.log.ros.scene import LogSection, Topic
from skyarm.log.ros.topics import FlightTopics, every_of, namespace_of, topics_of_all
from skyarm.log.sensor_data import COMPONENTS
from skyarm.log.team_log import WITHIN
from skyarm.records.arrays import Array
from skyarm.records.files import errors_as
from skyarm.reference import Trajectory
from skyarm.scenario.paths import prefix_of
from skyarm.scenario.scenario_record import Scenario
from skyarm.simulate.assemble_log import log_of_agent, sensor_data
from skyarm.simulate.session import Session, open_session
from skyarm.vehicle import Vehicle

COMMAND, GOAL, JOINT_GOAL = "/skyarm/command", "/skyarm/goal", "/skyarm/joint_goal"
"""Topics that are subscribed to."""

APPLIED, ROTORS = "/skyarm/applied", "/rotor_states"
"""Topics in addition to those of a log."""

NUMBERS, POSE, JOINTS = (
    "std_msgs/Float64MultiArray",
    "geometry_msgs/PoseStamped",
    "sensor_msgs/JointState",
)

TIMEOUT = 0.1
"""Time of flight (s) after the last command until the law takes over again; chosen:
ten periods of a publisher at 100 Hz."""

GOAL_PAUSE = 0.2
"""Least time of flight (s) between two accepted goals; of several, the last counts."""

Warn = Callable[[str], object]

Take = Callable[[str, str, Callable[[Content], None]], None]
"""Function that uses the messages of a topic, given the topic's name and type and a
function of one message."""


class LiveInstant:
    """Arrays of the latest control period by log name; costly ones are computed on
    demand.

    Args:
        session: session of the flight.
        log: log of its first part, which describes each vehicle.
    """

    def __init__(self, session: Session, log: Log) -> None:
        self._session, self._log = session, log
        self._known = session.latest_arrays

    @property
    def time(self) -> Array:
        """Start time (s) of the latest control period (1,); empty before the first
        period.
        """
        return self._known["time"]

    def __getitem__(self, array: str) -> Array:
        """Array of the latest control period, (1,) or (1, k), by its log name."""
        if array not in self._known:
            agent, within, own = array.rpartition(WITHIN)
            name = agent or next(iter(self._log.agents))
            piece = self._session.latest.of(name)
            if "." in own and not own.startswith(COMPONENTS):
                arrays: Mapping[str, Array] = sensor_data(piece)[0]
            else:
                info = dict(self._log.agents[name].info)
                arrays = log_of_agent(piece.scenario, [piece], None, info=info).arrays()
            self._known |= {
                f"{agent}{within}{each}": values for each, values in arrays.items()
            }
        return self._known[array]


class RosLink:
    """ROS node of one simulation session: publishes each control period, and takes
    commands and goals.

    Args:
        session: session to fly period by period with :meth:`step`; one of
            :func:`live_session` takes goals.
        node: node of ROS; the link closes it.
        timeout: s of flight after the last command until the law takes over again.
        warn: is told of messages that are refused, once for each topic; by default a
            Python warning.

    Attributes:
        commanded: periods flown under commands from ROS. goals: goals taken.
    """

    def __init__(
        self,
        session: Session,
        node: Node,
        *,
        timeout: float = TIMEOUT,
        warn: Warn = warnings.warn,
    ) -> None:
        if not 0.0 < timeout < math.inf:
            raise ValueError(f"timeout = {timeout!r}: must be a finite time above 0 s")
        self.session, self.node = session, node
        self.commanded = self.goals = 0
        self._warn, self._begun = warn, False
        self._refused: set[str] = set()
        try:
            self._log = session.log
            # of the table of every number only a file explains the type
            topics = FlightTopics(self._log)
            of_log = (topic for topic in topics.topics if topic.kind != FLIGHT)
            vehicles = session.scenario.vehicles
            own = {
                name: _own_topics(vehicles[name], log)
                for name, log in self._log.agents.items()
            }
            self._topics = (*of_log, *topics_of_all(own))
            self._pictures = topics.pictures
            self._seen: list[tuple[int, Topic, bytes]] = []
            pictures = (topic for each in self._pictures for topic in each.topics)
            # a message that is sent once waits for those who come later
            for topic in (*self._topics, *pictures):
                node.advertise(topic.name, topic.kind, latched=topic.every == 0)
            self._agents = {
                name: _AgentInputs(session, name, timeout, self._take_messages)
                for name in session.scenario.agents
            }
            for each in self._agents.values():
                for subscription in each.subscriptions:
                    node.subscribe(*subscription)
            self._look()
        except BaseException:
            node.close()
            raise

    def __enter__(self) -> RosLink:
        """Return the link; leaving the block closes it."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close the link."""
        self.close()

    def close(self) -> None:
        """Close the node: no socket and no thread is left."""
        self.node.close()

    def step(self) -> bool:
        """Simulate and publish a control period, under a recent ROS command or else the
        law; False at the end.
        """
        self.take_goals()
        command = self.take_command()
        going = self.session.step(command)
        self.commanded += command is not None
        self.publish()
        return going

    def take_command(self) -> Command | Mapping[str, Command] | None:
        """Newest received command that has not timed out, of several vehicles by name;
        None if the laws command.
        """
        newest = {name: each.take_command() for name, each in self._agents.items()}
        commands = {
            name: command for name, command in newest.items() if command is not None
        }
        return (
            # a scenario of one vehicle takes its command without a name
            next(iter(commands.values()), None)
            if len(newest) == 1
            else commands or None
        )

    def take_goals(self) -> None:
        """Redirect the references to the newest received goals, of each vehicle at most
        five times a second.
        """
        self.goals += sum([each.take_goals() for each in self._agents.values()])

    def publish(self) -> None:
        """Publish the latest control period on all topics that are due."""
        instant, tick = LiveInstant(self.session, self._log), self.session.tick - 1
        if not instant.time.size:
            return
        for topic in self._topics:
            due = tick % topic.every == topic.offset if topic.every else not self._begun
            if not due:
                continue
            # sums and norms of a lost flight may overflow, which is no reason to warn
            with np.errstate(all="ignore"):
                values = topic.values(LogSection(instant, slice(None)))
            self.node.send(
                topic.name, encode(topic.kind, DEFINITIONS, values, 1)[0].tobytes()
            )
        self._begun = True
        (now,) = LogSection(instant, slice(None)).stamps
        for stamp, topic, data in self._seen:
            if stamp <= now:
                self.node.send(topic.name, data)
        self._seen = [each for each in self._seen if each[0] > now]
        self._look()

    def _look(self) -> None:
        """Take the pictures that are due in the next period, whose messages leave when
        they arrive.
        """
        for each in self._pictures:
            if self.session.is_due(each.name):
                self._seen += each.messages(self.session.frame(each.name))

    def _take_messages(
        self, topic: str, kind: str, use: Callable[[Content], None]
    ) -> None:
        """Decode and use the messages that have arrived on a topic; invalid ones are
        refused.
        """
        for data in self.node.take(topic):
            try:
                use(decode(kind, DEFINITIONS, data))
            except MessageError as error:
                # one warning a topic: a publisher at 100 Hz would bury all others
                if topic not in self._refused:
                    self._refused.add(topic)
                    self._warn(
                        f"{topic}: a message is ignored: {error}; more of them are"
                        " ignored without a word"
                    )


class _AgentInputs:
    """Commands and goals from ROS for one vehicle of a session.

    Args:
        session: session of the flight.
        name: name of the vehicle.
        timeout: s of flight after the last command until the law takes over again.
        take: function that uses the messages of a topic, given its name and type and a
            function of one message.

    Attributes:
        subscriptions: name and type of the messages of each topic.
    """

    def __init__(self, session: Session, name: str, timeout: float, take: Take) -> None:
        scenario = session.scenario
        self._session = session
        self._name = name
        self._timeout = timeout
        self._take = take
        self._of = prefix_of(scenario, name)
        self._vehicle = scenario.agents[name].plant.vehicle
        self._commands = (
            [f"{namespace_of(scenario.agents, name)}{COMMAND}"]
            if scenario.autopilot is None
            else []
        )
        # a vehicle without joints has one topic of goals
        self._goals = [
            *zip(
                goal_topics(scenario, name),
                (POSE, JOINTS),
                (base_goal, self._joint_goal),
                strict=False,
            )
        ]
        goals = self._goals if takes_goals(self._reference) else []
        self.subscriptions = [
            *((topic, NUMBERS) for topic in self._commands),
            *((at, kind) for at, kind, _ in goals),
        ]
        self._command: Command | None = None
        self._received = self._last_goal = -math.inf
        self._goal: dict[str, float] = {}

    def take_command(self) -> Command | None:
        """Newest received command that has not timed out; None if the law commands the
        next period.
        """
        for topic in self._commands:
            self._take(topic, NUMBERS, self._use_command)
        return (
            self._command
            # times of flight are sums of periods: the last one counts in spite of
            # rounding
            if self._session.time - self._received < self._timeout - 1e-9
            else None
        )

    def _use_command(self, message: Content) -> None:
        self._command = command_of(message["data"], self._vehicle)
        self._received = self._session.time

    def take_goals(self) -> bool:
        """Redirect the reference to the newest received goals, at most five times a
        second; True if it did.
        """
        session = self._session
        if not takes_goals(self._reference):
            return False
        for topic, kind, goal_of in self._goals:
            self._take(topic, kind, partial(self._aim, goal_of))
        # 1e-9, so that rounding of the time costs no period
        if not (
            self._goal
            and session.running
            and session.time - self._last_goal >= GOAL_PAUSE - 1e-9
        ):
            return False
        changes = changes_to(self._reference, session.time, self._goal)
        session.change({f"{self._of}{path}": value for path, value in changes.items()})
        self._goal = {}
        self._last_goal = session.time
        return True

    @property
    def _reference(self) -> Trajectory:
        """Reference in force."""
        return self._session.scenario.agents[self._name].reference

    def _joint_goal(self, message: Content) -> dict[str, float]:
        return joint_goal(message, self._vehicle)

    def _aim(
        self, goal_of: Callable[[Content], dict[str, float]], message: Content
    ) -> None:
        goals = goal_of(message)
        check_reach(self._reference, self._session.time, goals)
        self._goal |= goals


def goal_topics(scenario: Scenario, name: str) -> list[str]:
    """Topics of the goals of a vehicle: of its base and, if it has any, of its
    joints.
    """
    joints = scenario.agents[name].plant.vehicle.n
    return [
        f"{namespace_of(scenario.agents, name)}{topic}"
        for topic in ([GOAL, JOINT_GOAL] if joints else [GOAL])
    ]


def live_session(
    scenario: Scenario, preparing: Callable[[float, float], object] | None = None
) -> tuple[Session, str]:
    """Open a session whose references take goals from ROS; where one takes none, return
    the reason, too.
    """
    session, reasons = open_live(scenario, preparing)
    several = scenario.is_team
    return session, "; ".join(
        f"{name}: {reason}" if several else reason for name, reason in reasons.items()
    )


def open_live(
    scenario: Scenario, preparing: Callable[[float, float], object] | None
) -> tuple[Session, dict[str, str]]:
    """Open a session whose references take goals from ROS; return it with the reason of
    each vehicle that takes none.

    Args:
        scenario: scenario to fly.
        preparing: function as of :func:`skyarm.simulate.session.open_session`.
    """
    live, reasons = with_goals(scenario)
    # inputs of its program from the start: the first goal would make the program anew,
    # which takes half a second
    return open_session(live, goal_paths(live), preparing=preparing), reasons


def command_of(numbers: list[float], vehicle: Vehicle) -> Command:
    """Vehicle command from a message's list of numbers: rotor speeds, joint efforts or
    setpoints, rotor tilt angles.

    Raises:
        MessageError: another count, a number that is not finite, or a rotor speed out
            of its range.
    """
    joints, rotors, tilts = vehicle.sizes
    if len(numbers) not in (rotors + joints, rotors + joints + tilts):
        more = f" and {tilts} tilts" if tilts else ""
        raise MessageError(
            f"{len(numbers)} numbers: must be {rotors} rotor speeds, {joints}"
            f" efforts{more}"
        )
    if not all(map(math.isfinite, numbers)):
        raise MessageError("must be of finite numbers")
    with errors_as(MessageError):
        require_speeds(vehicle.rotors, numbers[:rotors], "rotor speeds")
    return Command(
        rotor_speeds=tuple(numbers[:rotors]),
        efforts=tuple(numbers[rotors : rotors + joints]),
        tilts=tuple(numbers[rotors + joints :]),
    )


def _own_topics(vehicle: Vehicle, log: Log) -> tuple[Topic, ...]:
    """Topics of a vehicle that its log lacks: rotor speeds and command at the base's
    rate.
    """
    fast, _ = every_of(log)
    rotors = names_of(log).rotors

    def turning(part: LogSection) -> Content:
        return {
            "header": part.header(""),
            "name": rotors,
            "velocity": part["rotor_speeds"],
        }

    arrays = [
        "rotor_commands",
        "efforts",
        *(["tilt_commands"] if vehicle.tilts else []),
    ]

    def command(part: LogSection) -> Content:
        return {"data": np.hstack([part[name] for name in arrays])}

    return Topic(ROTORS, JOINTS, fast, turning), Topic(APPLIED, NUMBERS, fast, command)
