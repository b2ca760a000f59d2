"""Longest stable integration steps of a contact model, and the times at which it needs
shorter ones.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from functools import reduce

from skyarm.algebra import ZERO3_DATA, Scalar
from skyarm.algebra.scalars import (
    absolute,
    clip,
    exp,
    logical_and,
    maximum,
    minimum,
    sqrt,
    where,
)
from skyarm.dynamics.point_motion import PointMotion
from skyarm.records.coerce import RecordError, concrete
from skyarm.records.leaves import blend, leaves
from skyarm.world.contact.carrier import AnyCarrier, reduced_mass, untouched_after
from skyarm.world.contact.contact_memory import ContactMemory
from skyarm.world.contact.grasp import Grasp
from skyarm.world.contact.gripper import Gripper
from skyarm.world.contact.holds import Holds
from skyarm.world.contact.material import LIGHTEST, RECOVERY
from skyarm.world.contact.meetings import TouchingBodies, misses, too_far
from skyarm.world.contact.surface import Surface
from skyarm.world.contact.vehicle_bodies import BodyTouch

HIT = 1.2
"""Impact speed (m/s) above which steps are finest; slower impacts use proportionally
longer steps. Chosen: a cylinder that tumbles at 1 m/s stays within 0.5 mm of one with
four times finer steps, 0.7 mm with half of it and 1.3 mm with twice (measured)."""

REGROWTH = 0.1
"""Time constant (s) in which steps grow again after an impact; chosen. The same
cylinder is within 0.9 mm with half of it, and 0.6 mm with twice, which takes longer
to fly."""

CALM_FOR = 2.0
"""Number of control periods in which nothing may be reached where steps are those of
grasps alone."""

VERLET_SHARE = 0.75
"""Step of the Stoermer-Verlet method as a fraction of that of semi-implicit Euler. An
elastic bounce then changes the energy by 0.006 % at any phase of the steps, and by
0.014 % at a fraction of 1 (measured). Sticking is stable up to 13 N on a tip of 20 g at
a friction of 0.6, against 7 N at a fraction of 1."""


class ContactSteps(TouchingBodies):
    """Base class of the contact model: how long its integration steps may be, and when
    it needs the shorter ones.
    """

    __slots__ = ()

    grippers: tuple[Gripper, ...]
    grasps: tuple[Grasp, ...]
    hit_steps: int

    @property
    def gripping(self) -> Holds:
        """Grippers and grasps of the vehicles combined with the movable bodies that
        they can hold.
        """
        return Holds(self.grippers, self.grasps, self.carriers)

    @property
    def steps(self) -> tuple[tuple[str, Scalar], ...]:
        """Longest stable integration step (s) of each contact, grasp and mechanism,
        each with a describing text.
        """
        carriers = self.carriers
        # without points the vehicle touches nothing, so only movable bodies count
        bodies = bool(self.points or self.vehicle_bodies)
        touched = self.surfaces if bodies or not carriers else ()
        masses = [each.mass for each in self.vehicle_bodies]
        mass: Scalar = LIGHTEST
        mass = reduce(minimum, masses, mass)
        own = [
            (f"the material of surface {each.name!r}", each.material.step_of(mass))
            for each in touched
        ]
        inner = [
            (f"mechanism {c.name!r}", c.largest_step)
            for c in carriers
            if c.largest_step is not None
        ]
        return (
            *own,
            *steps_of_carriers(carriers, self.surfaces, mass if bodies else None),
            *(
                [("world.vehicle_material", self.vehicle_material.step_of(mass))]
                if any(each.other == "body" for each in self.body_pairs)
                else []
            ),
            *self.gripping.steps(),
            *inner,
        )

    @property
    def largest_step(self) -> Scalar | None:  # type: ignore[override]
        """Longest stable integration step (s) of the whole contact model; None without
        contact.
        """
        return least_of(step for _, step in self.steps)

    @property
    def largest_euler_step(self) -> Scalar | None:
        """Longest stable semi-implicit Euler step (s) of the whole contact model; None
        without contact.
        """
        return least_of(
            (*(step for _, step in self.steps), *self._held_steps(euler=True))
        )

    @property
    def largest_verlet_step(self) -> Scalar | None:
        """Longest stable Stoermer-Verlet step (s) of the whole contact model; None
        without contact.
        """
        return _verlet(self.largest_euler_step)

    @property
    def largest_calm_step(self) -> Scalar | None:  # type: ignore[override]
        """Longest stable integration step (s) while no body is near another, of a model
        with grasps; else None.
        """
        return least_of(self._held_steps(euler=False)) if self.grasps else None

    @property
    def largest_calm_verlet_step(self) -> Scalar | None:  # type: ignore[override]
        """Longest stable Stoermer-Verlet step (s) while no body is near another, of a
        model with grasps; else None.
        """
        return _verlet(least_of(self._held_steps(euler=True))) if self.grasps else None

    def _held_steps(self, *, euler: bool) -> list[Scalar]:
        """Longest stable integration steps (s) of what acts without touch: grippers,
        grasps, springs of mechanisms.
        """
        inner = (
            each.largest_euler_step if euler else each.largest_step
            for each in self.carriers
        )
        held = (step for _, step in self.gripping.steps(euler=euler))
        return [*held, *(step for step in inner if step is not None)]

    def require_steps(self, least: float) -> None:
        """Refuse a contact model that needs integration steps shorter than ``least``
        (s).
        """
        if not concrete(*leaves(self)):
            # numbers of a batch are symbols: its lanes are checked one by one
            return
        allowed = (
            f"must leave them {least:g} s or more, a thousandth of the control period"
        )
        try:
            steps = [(what, float(step)) for what, step in self.steps]
        except ArithmeticError:
            # numbers beyond measure overflow in the quotients
            raise RecordError(
                f"world: has no integration steps in contact: {allowed}"
            ) from None
        for what, step in steps:
            # written so that NaN is refused, too
            if not step >= least:
                raise RecordError(
                    f"world: {what} asks for integration steps of {step:.2g} s in"
                    f" contact: {allowed}"
                )

    def far(
        self, memory: ContactMemory, motion: PointMotion, seconds: Scalar
    ) -> Scalar:
        """True if nothing can touch a surface within ``seconds`` and no gripper holds
        anything.

        Its whole speed counts, and not only what brings it nearer to the nearest place:
        force may still act where it leaves, and in a hole another wall may be in its
        way. What a gripper holds is near.
        """
        # a grasp may act far from any surface: `calm` tells when its steps suffice
        if self.grasps:
            return False
        return self._apart(
            # a held body moves with the vehicle by a stiff spring, which needs its
            # steps
            [grip.taken < 0.5 for grip in memory.grips],
            memory,
            motion,
            seconds,
        )

    def calm(
        self, memory: ContactMemory, motion: PointMotion, seconds: Scalar
    ) -> Scalar:
        """True if nothing can touch a surface within ``CALM_FOR`` times ``seconds``,
        and no impact was just before.

        The force of a grasp can be larger than what ``far`` reckons with, hence the
        longer time.
        """
        return self._apart(
            [steps <= 1.0 for steps in memory.finer], memory, motion, CALM_FOR * seconds
        )

    def _apart(
        self,
        also: list[Scalar],
        memory: ContactMemory,
        motion: PointMotion,
        seconds: Scalar,
    ) -> Scalar:
        """True if nothing can touch a surface within ``seconds`` and all other
        conditions hold, too.
        """
        apart = [
            *also,
            *(misses(each.touch, seconds) for each in self.meetings(memory, motion)),
            self._fastest_near(memory, motion, seconds) < 0.0,
        ]
        return reduce(logical_and, apart) if apart else True

    def _fastest_near(
        self, memory: ContactMemory, motion: PointMotion, seconds: Scalar
    ) -> Scalar:
        """Largest speed (m/s) of two bodies that may touch within ``seconds``; negative
        where none do.
        """

        def fastest(touches: Sequence[BodyTouch]) -> Scalar:
            speeds = [
                where(too_far(each.depth, each.speed, seconds), -1.0, each.speed)
                for each in touches
            ]
            return reduce(maximum, speeds)

        nothing: Scalar = -1.0
        # speeds ask for no bristles, whose rates would be computed far away, too
        bare = replace(memory, bristles=(ZERO3_DATA,) * self.bristle_count)
        return self.with_touches(bare, motion, fastest, nothing, seconds)

    @property
    def most_hit_steps(self) -> int:  # type: ignore[override]
        """Largest number of substeps into which an integration step is divided during
        an impact.
        """
        return self.hit_steps

    def hurry(
        self, memory: ContactMemory, motion: PointMotion, seconds: Scalar
    ) -> tuple[ContactMemory, Scalar]:
        """Internal state of the contact model, and number of substeps: 1 in slow
        contact, ``hit_steps`` in hard impact.

        They stay nearly as fine through a hit, or the change of the step itself would
        be felt as energy.
        """
        fastest: Scalar = 0.0
        for each in self.meetings(memory, motion):
            slip = each.touch.slip
            fastest = maximum(
                fastest, where(misses(each.touch, seconds), 0.0, slip.dot(slip))
            )
        rush = self._fastest_near(memory, motion, seconds)
        # a square with its sign: where no bodies are near, rush is -1 and asks for
        # nothing
        fastest = maximum(fastest, rush * absolute(rush))
        asked = sqrt(fastest) * (self.hit_steps / HIT)
        finer = clip(
            # grown again slowly: a sudden change of the step itself changes the energy
            maximum(asked, memory.finer[0] * exp(-seconds / REGROWTH)),
            1.0,
            float(self.hit_steps),
        )
        return replace(memory, finer=(finer,)), finer

    def near(self, memory: ContactMemory) -> ContactMemory:
        """Internal state of the contact model before a step in which bodies may
        touch.
        """
        if not memory.apart:
            return memory
        count = self.meeting_count
        bodies = memory.bristles[count:]
        up = (ZERO3_DATA,) * len(bodies)
        # alone() left bristles of bodies as they were: after a time apart they stand up
        bodies = blend(memory.apart[0] > 0.5, up, bodies)
        bristles = (*memory.bristles[:count], *bodies)
        return replace(memory, bristles=bristles, apart=(0.0,))

    def alone(
        self, memory: ContactMemory, seconds: Scalar, rounds: int, gravity: Scalar
    ) -> ContactMemory:
        """Internal state of the contact model after ``seconds`` without any contact."""
        left = exp(-RECOVERY * seconds)
        points = memory.bristles[: self.meeting_count]
        bodies = zip(self.carriers, memory.carried, strict=True)
        return replace(
            memory,
            clock=tuple(t + seconds for t in memory.clock),
            # those of bodies are set up when they are near again: they are many
            bristles=(
                *(bristle * left for bristle in points),
                *memory.bristles[len(points) :],
            ),
            apart=tuple(1.0 for _ in memory.apart),
            carried=tuple(
                untouched_after(each, body, seconds / rounds, rounds, gravity)
                for each, body in bodies
            ),
        )


def _verlet(step: Scalar | None) -> Scalar | None:
    """Longest Stoermer-Verlet step (s) by that of semi-implicit Euler."""
    return None if step is None else VERLET_SHARE * step


def steps_of_carriers(
    carriers: Sequence[AnyCarrier], surfaces: Sequence[Surface], least: Scalar | None
) -> Iterator[tuple[str, Scalar]]:
    """Longest stable integration step (s) of each kind of contact pair with a movable
    body.

    Args:
        carriers: movable bodies.
        surfaces: surfaces of the world.
        least: mass (kg) of the vehicle where it may touch them; None if it may not.
    """
    masses = [1.0 / each.mobility for each in carriers]
    for i, carrier in enumerate(carriers):
        others = [
            (masses[j], each.step_share)
            for j, each in enumerate(carriers)
            if j != i and each.spot_count
        ]
        what = f"the mass of {carrier.name!r}"
        share = carrier.step_share
        for surface in carrier.surfaces:
            if least is not None:
                # two bodies swing at their contact as their reduced mass does
                yield (
                    what,
                    share * surface.material.step_of(reduced_mass(masses[i], least)),
                )
            for mass, other in others:
                yield (
                    what,
                    min(share, other)
                    * surface.material.step_of(reduced_mass(masses[i], mass)),
                )
        if carrier.spot_count:
            for surface in surfaces:
                # a surface of the world does not yield: the body's mass alone counts
                yield what, share * surface.material.step_of(masses[i])


def least_of(steps: Iterable[Scalar]) -> Scalar | None:
    """Smallest of some steps (s); None for an empty sequence."""
    every = list(steps)
    return reduce(minimum, every) if every else None
