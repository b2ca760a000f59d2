"""Live ROS topics of a simulation session, and commands and goals from ROS.

Topics are those of a log (:mod:`skyarm.log.ros.topics`) with the clock, the rotors and the applied command. In come

* ``/skyarm/command``: rotor speeds (rad/s), joint efforts or setpoints, and angles of tilting rotors (rad) in one list,
  in the place of the law's command until ``timeout`` after the last message; not where an autopilot flies;
* ``/skyarm/goal``: pose of the base, ``/skyarm/joint_goal``: positions of named joints; the reference moves there
  smoothly and stays, whether more messages come or not.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Mapping
from types import TracebackType

import numpy as np

from skyarm.control.controller import autopilot_of
from skyarm.dynamics.actuators import Command
from skyarm.links.ros.goals import base_goal, changes_to, check_reach, goal_paths, joint_goal, takes_goals, with_goals
from skyarm.links.ros.node import Content, Node
from skyarm.log.flight_log import Log
from skyarm.log.log_columns import names_of
from skyarm.log.ros.message_bytes import MessageError, decode, encode
from skyarm.log.ros.messages import FLIGHT
from skyarm.log.ros.scene import LogSection
from skyarm.log.ros.topics import FlightTopics, Topic, every_of
from skyarm.records.arrays import Array
from skyarm.records.plain import Plain
from skyarm.scenario.scenario_record import Scenario
from skyarm.simulate.assemble_log import log_of_agent, sensor_data
from skyarm.simulate.session import Session, open_session

COMMAND, GOAL, JOINT_GOAL = "/skyarm/command", "/skyarm/goal", "/skyarm/joint_goal"
"""Topics that are subscribed to."""

APPLIED, ROTORS, CLOCK = "/skyarm/applied", "/rotor_states", "/clock"
"""Topics in addition to those of a log."""

NUMBERS, POSE, JOINTS, TIME = (
    "std_msgs/Float64MultiArray", "geometry_msgs/PoseStamped", "sensor_msgs/JointState", "rosgraph_msgs/Clock"
)  # fmt: skip

TIMEOUT = 0.1
"""Time of flight (s) after the last command until the law takes over again."""

GOAL_PAUSE = 0.2
"""Least time of flight (s) between two accepted goals; of several, the last counts."""

Warn = Callable[[str], object]


class LiveInstant:
    """Arrays of the latest control period by log name; costly ones are computed on demand."""

    def __init__(self, session: Session, info: Mapping[str, Plain]) -> None:
        self._session, self._info = session, info
        self._known = session.latest_arrays

    @property
    def time(self) -> Array:
        """Start time (s) of the latest control period (1,); empty before the first period."""
        return self._known["time"]

    def __getitem__(self, array: str) -> Array:
        """Array of the latest control period, (1,) or (1, k), by its log name."""
        if array not in self._known:
            (name,), latest = self._session.scenario.agents, self._session.latest
            piece = latest.of(name)
            if "." in array:
                self._known |= sensor_data(piece)[0]
            else:
                self._known |= log_of_agent(piece.scenario, [piece], None, info=dict(self._info)).arrays()
        return self._known[array]


class RosLink:
    """ROS node of one simulation session: publishes each control period, and takes commands and goals.

    Args:
        session: session to fly period by period with :meth:`step`; one of :func:`live_session` takes goals.
        node: node of ROS 1 or 2; the link closes it.
        timeout: s of flight after the last command until the law takes over again.
        warn: is told of messages that are refused, once for each topic; by default a Python warning.

    Attributes:
        commanded: periods flown under commands from ROS. goals: goals taken.
    """

    def __init__(self, session: Session, node: Node, *, timeout: float = TIMEOUT, warn: Warn = warnings.warn) -> None:
        if not 0.0 < timeout < math.inf:
            raise ValueError(f"timeout = {timeout!r}: must be a finite time above 0 s")
        self.session, self.node = session, node
        self.commanded = self.goals = 0
        self._timeout, self._warn = timeout, warn
        self._refused: set[str] = set()
        self._command: Command | None = None
        self._heard = -math.inf
        self._goal: dict[str, float] = {}
        self._last_goal = -math.inf
        self._begun = False
        try:
            self._takes_commands = autopilot_of(session.scenario.agent.controller) is None
            log = session.log
            self._info = log.info
            self._definitions = node.definitions
            # of the table of every number only a file explains the type
            of_log = (topic for topic in FlightTopics(log).topics if topic.kind != FLIGHT)
            self._topics = (*of_log, *_own_topics(session, log))
            self._register()
        except BaseException:
            node.close()
            raise

    def _register(self) -> None:
        """Advertise and subscribe to all ROS topics of the simulation session."""
        node, scenario = self.node, self.session.scenario
        for topic in self._topics:
            node.advertise(topic.name, topic.kind, latched=topic.every == 0)
        if self._takes_commands:
            node.subscribe(COMMAND, NUMBERS)
        if takes_goals(scenario.agent.reference):
            node.subscribe(GOAL, POSE)
            if scenario.agent.plant.vehicle.n:
                node.subscribe(JOINT_GOAL, JOINTS)

    def __enter__(self) -> RosLink:
        """Return the link; leaving the block closes it."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the link."""
        self.close()

    def close(self) -> None:
        """Close the node: no socket and no thread is left."""
        self.node.close()

    def step(self) -> bool:
        """Simulate and publish a control period, under a recent ROS command or else the law; False at the end."""
        self.take_goals()
        command = self.take_command()
        going = self.session.step(command)
        self.commanded += command is not None
        self.publish()
        return going

    def take_command(self) -> Command | None:
        """Newest received command that has not timed out; None if the law commands the next period."""
        sizes = self.session.scenario.agent.plant.vehicle.sizes
        for message in self._take_messages(COMMAND, NUMBERS) if self._takes_commands else ():
            try:
                self._command, self._heard = command_of(message["data"], *sizes), self.session.time
            except MessageError as error:
                self._refuse(COMMAND, error)
        return self._command if self.session.time - self._heard < self._timeout - 1e-9 else None

    def take_goals(self) -> None:
        """Redirect the reference to the newest received goals, at most five times a second."""
        session = self.session
        if not takes_goals(session.scenario.agent.reference):
            return
        for message in self._take_messages(GOAL, POSE):
            try:
                self._aim(base_goal(message))
            except MessageError as error:
                self._refuse(GOAL, error)
        vehicle = session.scenario.agent.plant.vehicle
        for message in self._take_messages(JOINT_GOAL, JOINTS) if vehicle.n else ():
            try:
                self._aim(joint_goal(message, vehicle))
            except MessageError as error:
                self._refuse(JOINT_GOAL, error)
        if self._goal and session.running and session.time - self._last_goal >= GOAL_PAUSE - 1e-9:
            session.change(changes_to(session.scenario.agent.reference, session.time, self._goal))
            self._goal, self._last_goal = {}, session.time
            self.goals += 1

    def _aim(self, goals: Mapping[str, float]) -> None:
        check_reach(self.session.scenario.agent.reference, self.session.time, goals)
        self._goal |= goals

    def publish(self) -> None:
        """Publish the latest control period on all topics that are due."""
        instant, tick = LiveInstant(self.session, self._info), self.session.tick - 1
        if not instant.time.size:
            return
        for topic in self._topics:
            due = tick % topic.every == topic.offset if topic.every else not self._begun
            if not due:
                continue
            with np.errstate(all="ignore"):
                values = topic.values(LogSection(instant, slice(None)))
            data = encode(topic.kind, self._definitions, values, 1, packed=self.node.packed)
            self.node.send(topic.name, data[0].tobytes())
        self._begun = True

    def _take_messages(self, topic: str, kind: str) -> list[Content]:
        """Decode the messages that have arrived on a topic; invalid ones are refused."""
        messages = []
        for data in self.node.take(topic):
            try:
                messages.append(decode(kind, self._definitions, data, packed=self.node.packed))
            except MessageError as error:
                self._refuse(topic, error)
        return messages

    def _refuse(self, topic: str, error: MessageError) -> None:
        if topic not in self._refused:
            self._refused.add(topic)
            self._warn(f"{topic}: a message is ignored: {error}; more of them are ignored without a word")


def live_session(scenario: Scenario, preparing: Callable[[float, float], object] | None = None) -> tuple[Session, str]:
    """Open a session whose reference takes goals from ROS; else return the reason why it takes none."""
    live, reason = with_goals(scenario)
    # inputs of its program from the start: the first goal would make the program anew, which takes half a second
    return open_session(live, goal_paths(live.agent.reference), preparing=preparing), reason


def command_of(numbers: list[float], joints: int, rotors: int, tilts: int) -> Command:
    """Vehicle command from a message's list of numbers: rotor speeds, joint efforts or setpoints, rotor tilt angles.

    Raises:
        MessageError: another count, a number that is not finite, or a negative rotor speed.
    """
    if len(numbers) not in (rotors + joints, rotors + joints + tilts):
        more = f" and {tilts} tilts" if tilts else ""
        raise MessageError(f"{len(numbers)} numbers: must be {rotors} rotor speeds, {joints} efforts{more}")
    if not all(map(math.isfinite, numbers)):
        raise MessageError("must be of finite numbers")
    if min(numbers[:rotors], default=0.0) < 0.0:
        raise MessageError("a rotor speed is negative; must be unsigned")
    return Command(
        rotor_speeds=tuple(numbers[:rotors]),
        efforts=tuple(numbers[rotors : rotors + joints]),
        tilts=tuple(numbers[rotors + joints :]),
    )


def _own_topics(session: Session, log: Log) -> tuple[Topic, ...]:
    """Topics that a log lacks: clock in every control period; rotor speeds and command at the base's rate."""
    fast, _ = every_of(log)
    rotors = names_of(log).rotors

    def clock(part: LogSection) -> Content:
        return {"clock": part.stamps}

    def turning(part: LogSection) -> Content:
        return {"header": part.header(""), "name": rotors, "velocity": part["rotor_speeds"]}

    arrays = ["rotor_commands", "efforts", *(["tilt_commands"] if session.scenario.agent.plant.vehicle.tilts else [])]

    def command(part: LogSection) -> Content:
        return {"data": np.hstack([part[name] for name in arrays])}

    return (
        Topic(CLOCK, TIME, 1, clock),
        Topic(ROTORS, JOINTS, fast, turning),
        Topic(APPLIED, NUMBERS, fast, command),
    )
