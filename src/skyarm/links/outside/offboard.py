"""Real-time flight of a control law through an autopilot: take-over in hover, set
points, and hand-back.

The autopilot's clock sets the pace: an estimate belongs to the law's period that its
time lies in, and is answered at once by body rates, thrust and joint setpoints. Set
points go out only while estimates and heartbeats arrive, heartbeats of ours go, and the
autopilot is in the mode that takes them; otherwise the vehicle is handed back, in the
mode that holds its place.
"""

from __future__ import annotations

import contextlib
import dataclasses
import gc
import math
import os
import time
from collections.abc import Callable, Iterator
from typing import Annotated

from skyarm.control.controller import autopilot_of, senses_force
from skyarm.links.joint_port import JointLink, JointPortError, JointReading
from skyarm.links.outside.autopilot_link import AutopilotLink
from skyarm.links.outside.dds_link import DdsLink
from skyarm.links.outside.flight_record import FlightRecord, percentiles
from skyarm.links.outside.offboard_link import OffboardError
from skyarm.links.outside.outside_law import (
    LoopSettings,
    MotorSettings,
    OutsideLaw,
    require_full_thrust,
)
from skyarm.links.outside.rate_commands import Three
from skyarm.links.outside.rate_settings import ParameterReader, rate_settings
from skyarm.links.outside.state_frames import AutopilotState, WorldFrame
from skyarm.log.flight_log import Log
from skyarm.records.field_rules import checked
from skyarm.records.files import shown
from skyarm.records.immutable import immutable
from skyarm.records.leaves import leaves, rebuild
from skyarm.records.plain import Plain
from skyarm.records.units import Unit, positive
from skyarm.reference import Reference
from skyarm.scenario.payload_tables import scheduled_changes
from skyarm.scenario.scenario_record import Scenario, ScenarioError
from skyarm.simulate.check_endings import Ended
from skyarm.simulate.inputs import episode_inputs
from skyarm.simulate.stages import joined_reference

BEAT = 0.25
"""Time (s) between the heartbeats of this program."""

HAND_BACK = 0.3
"""Time (s) to wait at the end for a heartbeat, which shows whether the vehicle is still
in the set point mode."""

BEAT_LOST = 3.0
"""Time (s) without a heartbeat after which the autopilot counts as lost; it sends one
each second."""

LEAD = 0.6
"""Time (s) of set points before the mode is requested, as PX4 requires."""

TAKE_OVER = 5.0
"""Time (s) after which an autopilot that does not accept the set points is
abandoned."""

MODE_KNOWN = 2.5
"""Time (s) after the take-over from which the mode in a heartbeat counts; an older one
may still be in transit, and two of one a second have come by then."""

LINK_LOST, TAKEN_BACK, DIVERGED, STOPPED = (
    "link_lost",
    "taken_back",
    "diverged",
    "stopped",
)
"""Status of a flight that ended early: silence, mode change by the pilot, error beyond
the leash, Ctrl-C."""


@immutable
@checked("", OffboardError)
class OffboardSettings:
    """Settings of a real-time flight through an autopilot, outside of the simulator.

    Attributes:
        rate_bandwidth: bandwidth of an ideal rate loop; None inverts PX4's rate loop by
            its parameters.
        hover_share: thrust set point in hover; None takes the autopilot's own
            parameter.
        here: True puts the scenario's start where the vehicle is at take-over; False
            takes the autopilot's local frame, in north, west, up, for the scenario's
            world.
        patience: longest wait for the autopilot's first messages, and for a vehicle
            that hovers.
        stale: longest silence of the estimates, or of the joints, in flight.
        leash: largest distance of the base from its reference.
    """

    rate_bandwidth: Three | None = None
    hover_share: Annotated[
        float | None,
        Unit(
            "",
            "thrust set point in hover, 0 to 1; None: the autopilot's own parameter",
            low=0.05,
            high=0.95,
            effect=(
                "higher values lower the thrust that the law assumes at full set point"
            ),
        ),
    ] = None
    here: bool = True
    patience: Annotated[
        float,
        Unit(
            "s",
            "longest wait for the first messages, and for a vehicle that hovers",
            low=0.1,
        ),
    ] = 60.0
    stale: Annotated[
        float,
        Unit(
            "s",
            "longest gap in the estimates or joint readings in flight",
            low=0.02,
            high=2.0,
            effect="shorter gaps give control back to the autopilot sooner",
        ),
    ] = 0.25
    leash: Annotated[
        float,
        positive(
            "m",
            "largest distance of the base from its reference",
            effect="shorter distances give control back to the autopilot sooner",
        ),
    ] = 1.5


class HandBackError(Exception):
    """Error that ends a flight early and hands the vehicle back to its autopilot.

    Attributes:
        status: status of the flight.
    """

    def __init__(self, status: str, cause: str) -> None:
        super().__init__(cause)
        self.status = status


def require_outside(scenario: Scenario) -> None:
    """Raise an error for a scenario that cannot be flown outside the simulator.

    Raises:
        ScenarioError: an autopilot in the law's place, rotors that tilt, phases that
            wait, a time-scaled reference, scheduled changes of model, law or reference,
            or a law that needs a force sensor.
    """
    name, vehicle = scenario.agent.controller.name, scenario.agent.model.vehicle
    if autopilot_of(scenario.agent.controller) is not None:
        raise ScenarioError(
            f"controller.autopilot = {shown(name)}: must be a law, as by --laws LAW"
        )
    if vehicle.tilts:
        raise ScenarioError(
            "model.vehicle: must have rotors that do not tilt, for rates and thrust"
        )
    if senses_force(scenario.agent.controller.par):
        raise ScenarioError(
            f"controller = {shown(name)}: must leave force_sensor out; no link carries"
            " such a reading"
        )
    if episode_inputs(scenario).waits.guards:
        raise ScenarioError(
            "reference: must have no phases that wait for conditions, outside of the"
            " simulator"
        )
    if scenario.agent.path_time is not None:
        raise ScenarioError("path_time: must be left out, outside of the simulator")
    for change in scheduled_changes(scenario):
        # behind agents.NAME too
        if {"model", "controller", "reference"} & {*change.path.split(".")[:3:2]}:
            raise ScenarioError(
                f"changes: {change.path} at {change.at:g} s: must be left out, outside"
                " of the simulator (of a payload: believed = false)"
            )


@contextlib.contextmanager
def real_time() -> Iterator[None]:
    """Context manager that suspends garbage collection and, if permitted, sets
    real-time priority.
    """
    collecting = gc.isenabled()
    # a collection of garbage may take longer than a period
    gc.disable()
    first = False
    # no permission; no such scheduler
    with contextlib.suppress(OSError, AttributeError):
        # the flag stays set after an earlier flight without privileges
        if os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK == os.SCHED_OTHER:
            # 1 is the least real-time priority, ahead of all usual processes; those
            # that this one starts do not inherit it
            os.sched_setscheduler(
                0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(1)
            )
            first = True
    try:
        yield
    finally:
        if collecting:
            gc.enable()
        if first:
            _leave_real_time()


def _leave_real_time() -> None:
    """Return to the usual scheduling of this process."""
    try:
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    except PermissionError:
        # a limit (RLIMIT_RTPRIO) permits real-time priority, but only CAP_SYS_NICE
        # permits to take the flag back (sched(7))
        usual = os.SCHED_OTHER | os.SCHED_RESET_ON_FORK
        os.sched_setscheduler(0, usual, os.sched_param(0))


class OffboardFlight:
    """Real-time flight of a scenario's control law, by a link to the autopilot and a
    port to the joints.

    Args:
        scenario: its law, reference and rates; sensors, delays and environment are
            those of the real vehicle.
        link: link to the autopilot.
        arm: port to the joints.
        settings: settings of the flight.
        tell: called with a line of text at each stage.

    Attributes:
        interrupted: Ctrl-C or a signal that stopped the flight, to be raised again once
            its log is written; or None.
    """

    def __init__(
        self,
        scenario: Scenario,
        link: AutopilotLink,
        arm: JointLink,
        settings: OffboardSettings,
        tell: Callable[[str], None] = lambda text: None,
    ) -> None:
        require_outside(scenario)
        self._scenario = scenario
        self._link = link
        self._arm = arm
        self._settings = settings
        self._tell = tell
        self._inputs = episode_inputs(scenario)
        self._rows = self._inputs.held_leaves
        self._example: Reference = self._inputs.reference_example
        self._rate, self._steps = scenario.rates.control, scenario.steps
        self._rotors = len(scenario.agent.model.vehicle.rotors)
        self._record = FlightRecord()
        self._frame = WorldFrame()
        self._joints: JointReading | None = None
        self._joints_heard = self._beaten = -math.inf
        self._alive = math.inf
        self._missed, self._ours, self._asked = 0, False, math.inf
        self._needs_force = False
        self.interrupted: BaseException | None = None
        self._law: OutsideLaw  # made when the autopilot's settings are known

    def run(self) -> Log:
        """Take over a vehicle that hovers, fly the scenario, and hand the vehicle back;
        returns the flight's log.

        Raises:
            OffboardError: no autopilot, no estimates, a vehicle that does not hover,
                set points that are refused.
        """
        ended: Ended | None = None
        try:
            self._connect()
            self._await_hover()
            with real_time():
                self._take_over()
                self._follow()
        except HandBackError as end:
            ended = self._ending(end.status, str(end))
        except Exception:
            raise
        except BaseException as error:
            # Ctrl-C and signals: they go on once the log is written
            if not self._record.ticks:
                raise
            self.interrupted, ended = (
                error,
                self._ending(STOPPED, "stopped by Ctrl-C or a signal"),
            )
        finally:
            self._hand_back()
        return self._record.log(self._scenario, ended, self.facts)

    def _ending(self, status: str, cause: str) -> Ended:
        return Ended(
            status,
            cause,
            self._record.ticks[-1] / self._rate if self._record.ticks else 0.0,
        )

    @property
    def facts(self) -> dict[str, Plain]:
        """Durations and counts of the flight, and the pose of the world in the
        autopilot's local frame.
        """
        record, frame = self._record, self._frame
        return {
            "autopilot": self._link.title,
            "start_s": record.first,
            "computing": percentiles(record.computing),
            "round_trip": percentiles(self._link.round_trips),
            "periods": len(record.ticks),
            "missed": self._missed,
            "lost_frames": self._link.lost,
            "origin": [float(c) for c in frame.origin],
            "start": [float(c) for c in frame.start],
            "turn": frame.turn,
            "said": self._link.said,
        }

    def _pump(self, seconds: float) -> None:
        """Wait for messages, at most a given time (s); send a heartbeat if one is due;
        read the joints.

        Callers wait 0.02 s or 0.05 s, chosen: far less than a heartbeat's interval.
        """
        link = self._link
        link.wait(seconds)
        now = time.monotonic()
        if now - self._beaten >= BEAT:
            self._beaten = now
            link.beat()
        reading = self._arm.read()
        if reading is not None:
            count = self._scenario.agent.model.vehicle.n
            sizes = len(reading.joints), len(reading.joint_rates)
            if sizes != (count, count):
                raise JointPortError(
                    f"--joints: {sizes[0]} angles and {sizes[1]} rates: must be {count}"
                    " of each"
                )
            self._joints, self._joints_heard = reading, now

    def _until(
        self, seconds: float, ready: Callable[[], bool], words: str | Callable[[], str]
    ) -> None:
        """Wait until a condition holds, at most a given time (s).

        Raises:
            OffboardError: it is not so after some seconds; ``words``, the link's hint
                and the autopilot's text say why.
        """
        until = time.monotonic() + seconds
        while not ready():
            if time.monotonic() > until:
                said = "; ".join(filter(None, (self._link.hint, self._link.said)))
                reason = words() if callable(words) else words
                raise OffboardError(
                    f"{reason} within {seconds:g} s{said and f' ({said})'}"
                )
            self._pump(0.02)

    def _connect(self) -> None:
        """Wait for the autopilot and the joints, request state estimates, and prepare
        the control law.
        """
        link, settings = self._link, self._settings
        self._until(
            settings.patience,
            lambda: link.has_autopilot,
            "--link: no autopilot of PX4 or ArduPilot was heard",
        )
        self._tell(f"{link.title} is heard")
        asked = -math.inf

        def has_state() -> bool:
            nonlocal asked
            # once a second, as a request may be lost; 100 to 250 Hz are chosen
            if time.monotonic() - asked > 1.0:
                asked = time.monotonic()
                link.request_estimates(min(max(self._rate, 100), 250))
            return (
                link.state is not None
                and self._joints is not None
                and not self._lacks_force
            )

        def silent() -> str:
            who = (
                "--joints: the arm"
                if self._joints is None
                else "--link: the autopilot's estimator"
            )
            return f"{who} sent nothing"

        self._until(settings.patience, has_state, silent)
        loop = self._loop_settings()
        controller = self._scenario.agent.controller
        self._law = OutsideLaw(controller, loop, self._reference(0))
        self._needs_force = self._law.needs_accelerometer(self._reference(0))
        words = (
            f"--link: law {shown(controller.name)} needs an accelerometer:"
            f" {link.accelerometer}, or fly another law; no reading came"
        )
        self._until(settings.patience, has_state, words)

    def _loop_settings(self) -> LoopSettings | MotorSettings:
        """Settings of the loop around the control law, by the kind of set point that
        the link sends.
        """
        link, settings, model = self._link, self._settings, self._scenario.agent.model
        if isinstance(link, DdsLink):
            if settings.rate_bandwidth is not None:
                raise OffboardError(
                    "--rate-bandwidth: must be left out for motors, which have no rate"
                    " loop"
                )
            require_full_thrust(model.vehicle)
            return MotorSettings(period=1.0 / self._rate)
        reader = ParameterReader(link, self._pump)
        return rate_settings(
            reader,
            model,
            1.0 / self._rate,
            settings.rate_bandwidth,
            settings.hover_share,
        )

    def _await_hover(self) -> None:
        """Wait until the vehicle is armed, hovers slowly, and is not commanded by
        another program.
        """
        link = self._link

        def hovers() -> bool:
            state = link.state
            # 0.3 m/s, chosen
            slow = state is not None and math.hypot(*state.velocity) < 0.3
            return link.armed and not link.landed and slow and not link.obeys

        if not hovers():
            self._tell("waits for a vehicle that is armed and hovers")
        words = (
            "--link: the vehicle was not armed, in the air and slow, in a mode of its"
            " own,"
        )
        self._until(self._settings.patience, hovers, words)

    def _take_over(self) -> None:
        """Send set points for the initial reference and request the mode that takes
        them, until it is entered.
        """
        link, law, state = self._link, self._law, self._link.state
        assert state is not None
        start = self._reference(0)
        if self._settings.here:
            self._frame = WorldFrame.at_start(
                state, tuple(start.position), float(start.yaw)
            )
        begun, asked = time.monotonic(), -math.inf
        link.accepted, self._alive = False, begun
        while not (link.obeys or link.accepted):
            now = time.monotonic()
            if now - begun > TAKE_OVER:
                said = f": {link.said}" if link.said else ""
                raise OffboardError(
                    f"--link: {link.title} does not take set points (result"
                    f" {link.refused}){said}"
                )
            if now - begun > LEAD and now - asked > 0.5:
                asked = now
                self._ours, self._asked = True, min(self._asked, now)
                link.request_outside()
            self._pump(0.02)
            self._require_alive()
            state = link.take()
            if state is not None:
                law.reset()  # the vehicle does not obey yet
                self._answer(state, 0, start)
        law.reset()
        self._record = FlightRecord(
            first=link.state.time if link.state is not None else 0.0
        )
        self._tell("the law flies")

    def _follow(self) -> None:
        """Evaluate the law for every state estimate, until the end of the scenario."""
        link, record = self._link, self._record
        begun, last, before = time.monotonic(), -1, record.first
        while True:
            self._pump(0.05)
            self._require_alive()
            now = time.monotonic()
            if now - begun > MODE_KNOWN and not (link.obeys and link.armed):
                self._ours = False
                left = "left the mode that takes set points"
                cause = "is no longer armed" if link.obeys else left
                raise HandBackError(TAKEN_BACK, f"{link.title} {cause}")
            state = link.take()
            if state is None:
                continue
            jump, before = state.time - before, state.time
            if jump > self._settings.stale:
                raise HandBackError(
                    LINK_LOST,
                    f"the autopilot's clock went on by {jump:.3g} s between two"
                    " estimates",
                )
            tick = round((state.time - record.first) * self._rate)
            # an estimate twice in one period, or late from an earlier one, is no new
            # period
            if tick <= last:
                continue
            if tick >= self._steps:
                return
            self._missed += tick - last - 1
            last = tick
            reference = self._reference(tick)
            self._answer(state, tick, reference, record)
            error = math.dist(
                record.states[-1][:3], tuple(map(float, reference.position))
            )
            if error > self._settings.leash:
                raise HandBackError(
                    DIVERGED, f"the base is {error:.2f} m from its reference"
                )

    def _answer(
        self,
        state: AutopilotState,
        tick: int,
        reference: Reference,
        record: FlightRecord | None = None,
    ) -> None:
        """Evaluate the law for a state estimate and send its command."""
        law, link, arm = self._law, self._link, self._joints
        assert arm is not None
        if self._force_is_old:
            state = dataclasses.replace(state, specific_force=None)
        measured = self._frame.measurement(state, arm, tick / self._rate, self._rotors)
        command = law.step(measured, reference)
        if not all(map(math.isfinite, leaves(command))):
            raise HandBackError(DIVERGED, "the law's command is not finite")
        link.send(command.base)
        # the loop of the arm is not closed before take-over
        if record is None:
            return
        self._arm.send([float(each) for each in command.law.efforts], state.time)
        record.computing.append(time.monotonic() - link.heard)
        record.add(tick, measured, command)

    def _require_alive(self) -> None:
        """Raise an error if estimates, heartbeats or joint readings are overdue, or
        this process was suspended.
        """
        link, now, stale = self._link, time.monotonic(), self._settings.stale
        # silence shows only here: a stopped process finds its old estimates waiting
        stood, self._alive = now - self._alive, now
        if stood > stale:
            raise HandBackError(
                LINK_LOST, f"this process stood still for {stood:.2f} s"
            )
        if now - link.heard > stale:
            raise HandBackError(
                LINK_LOST, f"no estimate from the autopilot for {stale:g} s"
            )
        if self._lacks_force:
            raise HandBackError(
                LINK_LOST,
                f"no accelerometer reading from the autopilot for {stale:g} s",
            )
        if now - link.beaten > BEAT_LOST:
            raise HandBackError(
                LINK_LOST, f"no heartbeat from the autopilot for {BEAT_LOST:g} s"
            )
        if now - self._joints_heard > stale:
            raise HandBackError(
                LINK_LOST,
                f"no joint reading for {stale:g}"
                f" s{self._arm.problem and ': '}{self._arm.problem}",
            )

    @property
    def _lacks_force(self) -> bool:
        """True if the law needs an accelerometer, and no reading is new enough."""
        return self._needs_force and self._force_is_old

    @property
    def _force_is_old(self) -> bool:
        """True if no accelerometer reading has arrived for as long as an estimate may
        be missing.
        """
        return time.monotonic() - self._link.force_heard > self._settings.stale

    def _reference(self, tick: int) -> Reference:
        last = min(tick, self._steps - 1)
        going = rebuild(self._example, self._rows[last].tolist())
        return joined_reference(self._scenario, going, last / self._rate)

    def _hand_back(self) -> None:
        """Release the arm and, while the autopilot takes our set points, request its
        hold mode.
        """
        link = self._link
        self._arm.release()
        if not self._ours or not self._still_obeys():
            return
        # a request may be lost: it is repeated until a heartbeat shows the mode
        for _ in range(5):
            link.request_hold()
            # 0.3 s for each request and 0.05 s between looks are chosen
            until = time.monotonic() + 0.3
            while time.monotonic() < until and not link.holds:
                link.wait(0.05)
            if link.holds:
                return

    def _still_obeys(self) -> bool:
        """True unless the latest heartbeat shows another mode than the one for external
        set points.

        Without a heartbeat within ``HAND_BACK`` s the last one counts, if it is younger
        than our request for the mode.
        """
        link = self._link
        link.wait(0.0)
        last, until = link.beaten, time.monotonic() + HAND_BACK
        while time.monotonic() < until and link.beaten == last:
            link.wait(0.05)
        # the first heartbeat after take-over decides; without one the last is trusted
        # if it is older than our request, as it shows the mode before
        return link.obeys or link.beaten < self._asked
