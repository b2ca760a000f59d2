"""Simulation of the plant under logged commands, from any state and with any vehicle
parameters, in SIMD lanes.

What a flight's commands explain is flown by the same step as every simulation. Lanes of
machine code differ in the numbers of the vehicle, in where in the log they begin, and
in a constant wrench, which stands for what the model leaves unexplained.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from skyarm.algebra import ZERO3_DATA, Scalar, Scalars, Vec3
from skyarm.compile.llvm.kernel import Kernel
from skyarm.compile.llvm.lane_stepper import LaneStepper
from skyarm.compile.tracing.program import trace_loop
from skyarm.dynamics.actuators import Command
from skyarm.dynamics.actuators.drive import Drive
from skyarm.dynamics.point_motion import PointMotion
from skyarm.dynamics.state import State, example_state
from skyarm.plant.compiled import RigidBodyPlant, hold
from skyarm.plant.interface import Truth, example_command
from skyarm.plant.rigid_body import Moved
from skyarm.plant.surroundings import Memories, Surroundings, Together
from skyarm.records.arrays import Array, field_views
from skyarm.records.immutable import immutable
from skyarm.records.leaves import Tree
from skyarm.simulate.command_delay import drives_after, switches
from skyarm.vehicle import Vehicle
from skyarm.world import Component, Effectiveness, Wrench

Numbers = Mapping[str, Scalar]


@immutable
class Unexplained(Component[tuple[Vec3, Vec3]]):
    """Residual force (N) and torque (N m) on the base about its origin, base axes,
    unexplained by the plant model.
    """

    def wrenches(
        self,
        memory: tuple[Vec3, Vec3],
        t: Scalar,
        motion: PointMotion,
        rotor_speeds: Sequence[Scalar],
    ) -> Sequence[Wrench]:
        """Residual force and torque on the base, unexplained by the plant model, in
        world axes.
        """
        force, torque = map(motion.rotation.apply, memory)
        return [Wrench(force_W=force, torque_W=torque)]


@immutable
class Inputs:
    """Vehicle parameters, unexplained wrench and commands of one simulated flight over
    one step.

    Attributes:
        numbers: vehicle parameters in the order of the replay's names.
        thrust: factor of every rotor's thrust and drag torque, as by the battery.
        force, torque: unexplained wrench, N and N m, base axes.
        before, after: commands between which the step switches: speeds of the rotors,
            rad/s, and setpoints of the joints' drives, N m or N without one.
        late: instants within the step at which the rotors switch, and the joints, s.
    """

    numbers: Scalars
    thrust: Scalar
    force: Vec3
    torque: Vec3
    before: Command
    after: Command
    late: tuple[Scalar, Scalar]


# no cut of LoopProgram: its step is that of a log's clock, as 0.0040016 s, and rates of
# scenarios are whole numbers of Hz; it has no sensors, law and random numbers, and its
# commands, which arrive within a step, differ from lane to lane
# no RigidBodySteps either, which selects against an interval that a traced delay leaves
# empty: no faster here (measured), and where a delay is of whole steps the attitude is
# normalised once, not three times, so that last bits of the state differ
class CommandReplay:
    """Compiled plant model that flies under logged commands.

    Args:
        vehicle_of: numbers by name -> vehicle, of any scalars. start: usual numbers, by
            which steps are chosen.
        drives_of: vehicle -> drive of each joint; none where all take torques.
        step: time over which inputs are constant, s. gravity: m/s^2.
        sensed: numbers, states before and after a step -> what is logged of it beside
            the state.
        finer: least number of integration steps within one.

    Attributes:
        names: names of the numbers. step: s. substeps: integration steps within one.
    """

    def __init__(
        self,
        vehicle_of: Callable[[Numbers], Vehicle],
        start: Mapping[str, float],
        step: float,
        gravity: float,
        *,
        drives_of: Callable[[Vehicle], tuple[Drive, ...]] = lambda vehicle: (),
        sensed: Callable[[Numbers, State, State], Sequence[Scalar]] = lambda *_: (),
        finer: int = 1,
    ) -> None:
        self.names = tuple(start)
        self.step = step
        usual = vehicle_of(start)
        n = usual.n
        rotors = len(usual.rotors)
        drives = drives_of(usual)
        memories = tuple(each.begin(0.0, 0.0, step) for each in drives)

        def around(vehicle: Vehicle, given: Inputs, memories: Memories) -> Surroundings:
            # the joints' share is an int, structure: identification scales thrust alone
            left = Effectiveness(rotors=(given.thrust,) * rotors, joints=(1,) * n)
            push = (given.force, given.torque)
            return Surroundings(
                components=(Unexplained(),),
                memories=(push,),
                effectiveness=left,
                drives=drives_of(vehicle),
                drive_memories=memories,
            )

        none = ZERO3_DATA
        still = example_command(n, rotors)
        late = (0.0, 0.0)
        self._inputs = Inputs(
            numbers=tuple(start.values()),
            thrust=1.0,
            force=none,
            torque=none,
            before=still,
            after=still,
            late=late,
        )
        state = example_state(n, rotors)
        self._carry = state, memories
        plant = RigidBodyPlant(
            Truth(vehicle=usual, gravity=gravity),
            around(usual, self._inputs, memories),
            "rk4",
        )
        usually = plant.substeps(step)
        # a search compares steps: it may ask for finer ones than stability needs
        self.substeps = max(finer, usually.near)
        count = usually._replace(near=self.substeps)

        def fly(
            carry: tuple[State, Memories], given: Inputs, _row: Tree, _uniforms: Tree
        ) -> tuple[tuple[State, Memories], Scalars]:
            before, memories = carry
            numbers = dict(zip(self.names, given.numbers, strict=True))
            vehicle = vehicle_of(numbers)
            memories = drives_after(
                drives_of(vehicle),
                memories,
                given.before,
                given.after,
                given.late[1],
                before,
                step,
            )
            worlds = (Truth(vehicle=vehicle, gravity=gravity),)
            beside = Together((around(vehicle, given, memories),))
            now: Moved = (before,), ()
            left: Scalar = step
            # as in a control period (RigidBodySteps), so that a log is met to its
            # delays
            for seconds, command in switches(given.before, given.after, *given.late):
                now = hold(worlds, "rk4", count, now, (command,), beside, seconds)
                left = left - seconds
            (after,), _ = hold(worlds, "rk4", count, now, (given.after,), beside, left)
            return (after, memories), tuple(sensed(numbers, before, after))

        loop = trace_loop(fly, (state, memories), self._inputs, (), loops=True)
        # lanes that are not contracted: else its bits would depend on the effort of the
        # compiler, and a search and a design decide by them
        self._kernel = Kernel(loop, logging=True, effort=1)

    def flights(self, lanes: int, threads: int = 1) -> ReplayedFlights:
        """Make flights simulated side by side, all at rest at the origin, with the
        default vehicle parameters.
        """
        return ReplayedFlights(self._kernel, self._carry, self._inputs, lanes, threads)


class ReplayedFlights:
    """Flights under logged commands, simulated side by side, step by step.

    Attributes:
        state: field of a state -> (numbers, lanes) now. memories: (numbers, lanes) of
            the joints' drives.
        inputs: field of the inputs -> (numbers, lanes) over the next step; commands by
            ``speeds_before``, ``speeds_after``, ``setpoints_before`` and
            ``setpoints_after``.
        logged: (numbers, lanes) of the last step.
    """

    def __init__(
        self,
        kernel: Kernel,
        carry: tuple[State, Memories],
        inputs: Inputs,
        lanes: int,
        threads: int,
    ) -> None:
        self._stepper = LaneStepper(kernel, lanes, threads=threads)
        stepper = self._stepper
        self.state, count = field_views(carry[0], stepper.carry)
        self.memories = stepper.carry[count:]
        self.inputs, _ = field_views(inputs, stepper.parameters)
        for part in ("before", "after"):
            fields = {
                "rotor_speeds": "speeds",
                "efforts": "setpoints",
            }
            rows = self.inputs.pop(part)
            commands, _ = field_views(getattr(inputs, part), rows)
            self.inputs |= {
                f"{name}_{part}": commands[field] for field, name in fields.items()
            }
        self.logged: Array = stepper.logged
        # zeros of a new array are no attitude
        self.state["quaternion"][0] = 1.0
        # factor of the rotors' thrust, which 1 leaves as it is
        self.inputs["thrust"][:] = 1.0
        self.inputs["numbers"][:] = np.array(inputs.numbers, dtype=float)[:, None]

    def step(self) -> None:
        """Simulate one step of all flights."""
        # inputs are written in place, those of the padding lanes have to follow
        self._stepper.fill()
        self._stepper.step()

    def close(self) -> None:
        """Shut down the threads of the simulation."""
        self._stepper.close()
