"""A sensor of your own: a GPS at 10 Hz that drifts and drops out, and its estimator.

A sensor reads the true state with its errors. An estimator turns all readings into the
measurement of the law, which receives nothing else: a sensor that no estimator reads
changes only the log. Inertial units, motion capture and force sensors ship with skyarm.
"""

import tomllib
from dataclasses import dataclass, replace

import skyarm
from skyarm.algebra.scalars import where


@skyarm.register.sensor("gps")
@dataclass(frozen=True, kw_only=True)
class Gps(skyarm.Sensor):
    """Reads (1 if there is a fix, x, y, z); memory is bias and last fix."""

    frequency: float = 10.0  # Hz; must divide the control rate, and 0 means that rate
    latency: float = 0.05  # s until a reading arrives; whole control periods
    sigma: float = 0.02  # white noise, m
    walk: float = 0.002  # of the bias from reading to reading, m
    dropout: float = 0.1  # share of lost fixes
    # random numbers in (0, 1) that a reading of this vehicle draws
    uniforms = staticmethod(lambda vehicle: 7)
    # the first memory, a tuple or a dataclass of floats
    start = staticmethod(lambda vehicle: ((0.0,) * 3, (0.0,) * 3))

    def measure(self, memory, t, state, specific_force, draws, dt):
        """Called ``frequency`` times a second: next memory, and a reading of one shape
        for the whole flight (so a number says that the fix was lost). state is the
        truth; specific_force is that of the base in its axes, m/s^2. A force sensor has
        ``feels`` and ``feel`` instead; one that gives readings of a shipped kind says
        so by ``record``, and the shipped filter then reads it: see help(skyarm.Sensor).
        """
        (bias, last), lost = memory, draws[6] < self.dropout
        noise = skyarm.normals(draws[:6])
        bias = [b + self.walk * n for b, n in zip(bias, noise[:3], strict=True)]
        parts = zip(state.position, bias, noise[3:], strict=True)
        fix = [p + b + self.sigma * n for p, b, n in parts]
        kept = tuple(where(lost, old, new) for old, new in zip(last, fix, strict=True))
        return (tuple(bias), kept), (where(lost, 0.0, 1.0), *kept)


title = "the full state's position, drawn towards the fixes"


@skyarm.register.estimator("gps_corrected", title=title)
@dataclass(frozen=True, kw_only=True)
class Corrected(skyarm.Estimator):
    """The full state, its position moved by a correction, which is the memory."""

    gain: float = 0.01  # more follows the fixes, less averages their noise
    start = staticmethod(lambda vehicle: (0.0,) * 3)

    def step(self, memory, readings, command, dt):
        """Called each control period: next memory, and the measurement. readings holds
        what has arrived, by the names of [sensors], until the next arrives; "state" is
        always there, the full state with the noise of [sensors]. command acts now. An
        estimator that predicts takes the law's vehicle by ``believing``, and refuses a
        scenario without its sensor by ``require_sensors``.
        """
        full, (fix, *place) = readings["state"], readings["gps"]
        triples = zip(memory, place, full.position, strict=True)
        off = tuple(m + self.gain * fix * (p - q - m) for m, p, q in triples)
        return off, replace(full, position=full.position + skyarm.Vec3(*off))


FLIGHT = """
schema = 1
name = "fixes"
duration = 30.0
plant = { vehicle = "hummingbird_arm2_rotors" }
model = { vehicle = "hummingbird_arm2" }
controller = { preset = "paper_ct" }
reference = { base = { kind = "hover", position = [0.0, 0.0, 1.0] } }
sensors = { gps = { kind = "gps", dropout = 0.2 } }
estimator = { kind = "gps_corrected" }
"""

if __name__ == "__main__":
    log = skyarm.run(skyarm.scenario_from(tomllib.loads(FLIGHT)))
    # a reading of 10 Hz stays for 20 control periods; 80 % are expected to be fixes
    taken = log.readings["gps"]["value"][::20]
    print(f"{100 * taken[:, 0].mean():.0f} % fixes")  # 79 % fixes
    off = log.estimate["position"] - log.position
    # less than the 20 mm of a single fix
    print(f"{1e3 * off[:, 0].std():.1f} mm off along x")  # 9.9 mm off along x
