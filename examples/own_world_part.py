"""A payload, a fault, a contact world and signals of your own, one of each.

Each is a subclass that overrides one function of its kind; a signal may also be a
function that reads its table. Often the shipped kinds are enough.

The functions are called with symbols and compiled. So write ``where`` in place of
``if`` and functions of skyarm.algebra.scalars in place of ``math``, and let equal
arguments give equal numbers: what needs random numbers is a wind or a force. A field
must not be called ``kind`` or ``mode``.
"""

import tomllib
from dataclasses import dataclass

import skyarm
from skyarm.algebra.scalars import exp, logical_and, where
from skyarm.reference import Signal, Sine


@skyarm.register.fault("fading")
@dataclass(frozen=True, kw_only=True)
class Fading(skyarm.Fault):
    """An actuator whose force fades to its effectiveness."""

    time: float = 1.0  # s, beside rotor or joint, effectiveness and start of the base

    def share(self, t):
        """Fraction of the actuator's force that is left; rotor speeds do not change,
        and a joint with stuck = true does not call it.
        """
        lost = 1.0 - self.effectiveness
        faded = self.effectiveness + lost * exp((self.start - t) / self.time)
        return where(t >= self.start, faded, 1.0)


@skyarm.register.payload("low")
@dataclass(frozen=True, kw_only=True)
class Low(skyarm.TimedPayload):
    """A payload that is set down after ``drop``, but only near the ground."""

    height: float = 0.5  # m

    def events_reached(self, t, position_W):
        """May it be picked up now, and set down now? position_W is that of the frame
        that holds it.
        """
        pick, drop = skyarm.TimedPayload.events_reached(self, t, position_W)
        return pick, logical_and(drop, position_W.z <= self.height)


@skyarm.register.world("sticky")
@dataclass(frozen=True, kw_only=True)
class Sticky(skyarm.Contact):
    """A ground that attracts the tip from any height."""

    pull: float = 1.0  # N at height 0; a third of it at 0.5 m

    def far(self, memory, motion, seconds):
        """True if there is no force within so many seconds, and wrenches is not called;
        the inherited one knows surfaces and grippers only.
        """
        return False

    def wrenches(self, memory, t, motion, rotor_speeds):
        """Forces of the base class, and your own, as in own_force.py; log.contact_force
        has the first of them alone.
        """
        point, body = motion.frame()
        height = motion.position(point, body).z
        force = skyarm.Vec3(0.0, 0.0, -self.pull * exp(-height / 0.5))
        touching = skyarm.Contact.wrenches(self, memory, t, motion, rotor_speeds)
        return (*touching, skyarm.Wrench(force_W=force, point=point, body=body))


@skyarm.register.signal("parabola")
@dataclass(frozen=True, kw_only=True)
class Parabola(Signal):
    """A value with a constant second derivative."""

    second: float = 0.1

    def derivatives(self, t):
        """The value and four derivatives; what is always zero is the int 0, which costs
        no time. A signal that jumps also has switch_times().
        """
        return 0.5 * self.second * t * t, self.second * t, self.second, 0, 0


# fields reads the table: number, vector, numbers, choice, text, flag, inner, tables.
# What it does not read is refused as an unknown field; without a default it is
# required.
@skyarm.register.signal("beat")
def beat(fields):
    """Two sines of nearly the same frequency."""
    size = fields.number("amplitude", 0.1, low=0.0)
    slow, fast = fields.number("frequency_hz"), fields.number("other_hz")
    first = Sine(amplitude=size, frequency_hz=slow)
    return first + Sine(amplitude=size, frequency_hz=fast)


TIRED = """
schema = 1
name = "tired"
duration = 10.0
plant = { vehicle = "hummingbird_arm2_rotors" }
model = { vehicle = "hummingbird_arm2" }
controller = { preset = "paper_ct" }

[reference]
base = { kind = "hover", position = [0.0, 0.0, 1.0] }
yaw = { kind = "beat", frequency_hz = 0.5, other_hz = 0.6 }

[[environment.faults]]
kind = "fading"
rotor = "front"
effectiveness = 0.9
start = 2.0
time = 0.5
"""
LANDING = """
schema = 1
name = "landing"
duration = 8.0
plant = { vehicle = "hummingbird_arm2_rotors" }
controller = { preset = "centroidal_tip" }

[reference.base]
kind = "signals"
z = [1.2, { kind = "ramp", start = 3, duration = 2, height = -0.5, shape = "quintic" }]

[[payloads]]
kind = "low"
name = "parcel"
mass = 0.1
pick = 1.0
drop = 2.0
height = 0.55
"""
PULLED = """
schema = 1
name = "pulled"
duration = 4.0
plant = { vehicle = "hummingbird_arm2_rotors" }
controller = { preset = "paper_ct" }
world = { kind = "sticky", pull = 1.0, surfaces = [{ name = "ground" }] }

[reference]
base = { kind = "hover", position = [0.0, 0.0, 1.0] }
yaw = { kind = "parabola", second = 0.1 }
"""

if __name__ == "__main__":
    tired = skyarm.scenario_from(tomllib.loads(TIRED))
    share = [round(float(tired.faults[0].share(t)), 3) for t in (0.0, 2.5, 9.0)]
    print(share, skyarm.run(tired).status)  # [1.0, 0.937, 0.9] completed

    log = skyarm.run(skyarm.scenario_from(tomllib.loads(LANDING)))
    held = log.payload_mass[:, 0] > 0.0
    last, height = log.time[held][-1], log.tip[held][-1, 2]
    print(f"held until {last:.2f} s, at {height:.2f} m")  # held until 4.21 s, at 0.55 m

    pulled = skyarm.scenario_from(tomllib.loads(PULLED))
    print(pulled.reference.yaw.derivatives(2.0))  # (0.2, 0.2, 0.1, 0, 0)
    free = skyarm.with_numbers(pulled, {"world.pull": 0.0})
    heights = [skyarm.run(each).position[-1, 2] for each in (free, pulled)]
    # 0.28 N at the tip, and 4 N/m is the position gain of the law
    print(f"{heights[0] - heights[1]:.3f} m lower")  # 0.071 m lower
