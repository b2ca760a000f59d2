"""Multisine excitation from rest to rest: sines of base, heading and joints under an
envelope, as reference signals.

A segment begins and ends at rest in the same place, so that segments follow each other
in any order. Its sines have random phases (Pintelon and Schoukens, System
Identification: A Frequency Domain Approach, 2012, 2.5): amplitude, lowest and highest
frequency and the slope of the spectrum are drawn for each axis, and for each joint the
angle about which it swings.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from skyarm.records.arrays import Array
from skyarm.records.files.toml import Entry
from skyarm.records.immutable import immutable, positional
from skyarm.reference.signals import signal_from
from skyarm.studies.tune.excitation import rest_and_size
from skyarm.vehicle import Joint, Vehicle

BASE_AXES = 4
"""Number of axes of the base: x, y, z and heading, before the joints."""

SINES = 4
"""Number of sines of an axis; more raise the crest factor and the size of the file, not
the information."""

EASING = 1.5
"""Rise time and fall time (s) of the envelope."""

LOWEST, HIGHEST_BASE, HIGHEST_JOINTS = 0.15, 1.2, 2.5
"""Lowest frequency (Hz) of the sines, one and a half periods in a segment of 10 s, and
highest of the base and of the joints."""

STRONGEST = 4.0
"""Highest acceleration (m/s^2) of the base along a drawn axis: a tilt of 22 degrees."""

STEEPEST = 2.0
"""Largest power of the frequency with which amplitudes fall: equal accelerations."""

HEADING, SWING, MARGIN = 1.2, 1.2, 0.05
"""Largest swing (rad) of the heading, and of a joint without limits; margin to joint
limits as a fraction of the range."""


@immutable(eq=False)
class Segment:
    """Multisines of all axes (x, y, z, heading, joints) under one envelope from rest to
    rest.

    Attributes:
        duration: s.
        frequencies: (axes, SINES) Hz.
        amplitudes: (axes, SINES) m or rad.
        phases: (axes, SINES) rad.
        offsets: (axes,) middle of the swing less the rest, m or rad.
    """

    duration: float
    frequencies: Array
    amplitudes: Array
    phases: Array
    offsets: Array

    def scale(self, factors: Array) -> Segment:
        """Multisine segment with amplitudes and offsets of each axis scaled by a factor
        (axes,).
        """
        amplitudes, offsets = self.amplitudes * factors[:, None], self.offsets * factors
        return replace(self, amplitudes=amplitudes, offsets=offsets)

    def table(self, axis: int) -> dict[str, Entry]:
        """Excitation signal of one axis as a table of a scenario file, in time since
        the segment's start.
        """
        # rounded for who reads the file: a hundredth of a millimetre moves no vehicle
        sines: list[Entry] = [
            {
                "kind": "sine",
                "amplitude": round(float(a), 5),
                "frequency_hz": round(float(f), 4),
                "phase": float(p),
            }
            for a, f, p in zip(
                self.amplitudes[axis],
                self.frequencies[axis],
                self.phases[axis].round(3),
                strict=True,
            )
        ]
        ramps: list[Entry] = [
            {
                "kind": "ramp",
                "start": start,
                "duration": EASING,
                "height": height,
                "shape": "quintic",
            }
            for start, height in ((0.0, 1.0), (self.duration - EASING, -1.0))
        ]
        return {
            "kind": "product",
            "signal": [round(float(self.offsets[axis]), 5), *sines],
            "factor": ramps,
        }

    def motion(self, times: Array) -> Array:
        """Displacement from rest, velocity and acceleration (3, axes, N) of all axes at
        times (N,), s.
        """
        signals = [
            signal_from(self.table(axis), "segment")
            for axis in range(len(self.offsets))
        ]
        zero = np.zeros(len(times))
        return np.stack(
            [
                # a derivative may be one number for all times
                [zero + each for each in signal.derivatives(times)[:3]]
                for signal in signals
            ],
            axis=1,
        )


@positional(eq=False)
class Axes:
    """Rest positions and ranges of base, heading and joints for an excitation flight.

    Attributes:
        rest: (axes,) m or rad. low, high: (axes,) ends of the range.
        fastest: (axes,) Hz, highest frequency.
    """

    rest: Array
    low: Array
    high: Array
    fastest: Array


def axes_of(vehicle: Vehicle, box: float, height: float) -> Axes:
    """Rest positions and ranges of the base's position and heading and of the joints.

    Args:
        vehicle: vehicle with the limits of its joints.
        box: m, edge of the cube in which the base origin stays.
        height: m, of its centre.
    """
    joints = [_range(joint, vehicle.n) for joint in vehicle.joints]
    half = 0.5 * box
    rest = np.array([0.0, 0.0, height, 0.0, *(each[0] for each in joints)])
    low = np.array(
        [-half, -half, height - half, -HEADING, *(each[1] for each in joints)]
    )
    high = np.array([half, half, height + half, HEADING, *(each[2] for each in joints)])
    # rest, then ranges, then highest frequencies, of x, y, z, heading and joints
    return Axes(
        rest,
        low,
        high,
        np.array([HIGHEST_BASE] * BASE_AXES + [HIGHEST_JOINTS] * vehicle.n),
    )


def _range(joint: Joint, joints: int) -> tuple[float, float, float]:
    """Rest position of a joint and the ends of its swing."""
    rest, _ = rest_and_size(joint, joints)
    low, high = joint.ends
    margin = MARGIN * (high - low) if math.isfinite(high - low) else 0.0
    return rest, max(low + margin, rest - SWING), min(high - margin, rest + SWING)


def draw_segment(axes: Axes, duration: float, draw: np.random.Generator) -> Segment:
    """Draw a random multisine segment that stays within the ranges of all axes."""
    count = len(axes.rest)
    # each axis has a band of its own: which one shows most the search finds out
    slow, fast = np.log(LOWEST), np.log(axes.fastest)
    ends = np.sort(
        slow + (fast - slow)[:, None] * draw.uniform(size=(count, 2)), axis=1
    )
    # one sine in each part of the band, on a logarithmic scale, so that none coincide
    share = (np.arange(SINES) + draw.uniform(size=(count, SINES))) / SINES
    frequencies = np.exp(ends[:, :1] + (ends[:, 1:] - ends[:, :1]) * share)
    steepness = STEEPEST * draw.uniform(size=(count, 1))
    segment = Segment(
        duration=duration,
        frequencies=frequencies,
        amplitudes=frequencies**-steepness,
        phases=draw.uniform(-math.pi, math.pi, size=(count, SINES)),
        offsets=np.zeros(count),
    )
    middle = 0.5 * (axes.low + axes.high) - axes.rest
    room = 0.5 * (axes.high - axes.low)
    # what a swing leaves of the range its middle may take, so that small ones visit
    # other postures; a tenth is chosen, not measured
    size = room * draw.uniform(0.1, 1.0, size=count)
    offsets = middle + (room - size) * draw.uniform(-1.0, 1.0, size=count)
    # the base swings about its rest, as the box lies about that
    offsets[:BASE_AXES] = 0.0
    return within(replace(segment, offsets=offsets), axes, size)


def mutate_segment(segment: Segment, axes: Axes, draw: np.random.Generator) -> Segment:
    """Mutate a multisine segment: redraw some axes at random, and rescale the others a
    little.
    """
    other = draw_segment(axes, segment.duration, draw)
    # two axes are drawn anew on the mean, and the others keep what was good in them
    anew = draw.uniform(size=len(axes.rest)) < 2.0 / len(axes.rest)
    # chosen: more often larger than smaller
    scaled = segment.scale(draw.uniform(0.85, 1.3, size=len(axes.rest)))
    mutated = replace(
        segment,
        frequencies=np.where(anew[:, None], other.frequencies, scaled.frequencies),
        amplitudes=np.where(anew[:, None], other.amplitudes, scaled.amplitudes),
        phases=np.where(anew[:, None], other.phases, scaled.phases),
        offsets=np.where(anew, other.offsets, scaled.offsets),
    )
    return within(mutated, axes, None)


def within(segment: Segment, axes: Axes, size: Array | None) -> Segment:
    """Scale a multisine segment to given amplitudes (axes,), if any, and into the
    ranges of all axes.
    """
    # twenty instants in a period of the fastest sine
    times = np.arange(0.0, segment.duration, 0.02)
    sines = (
        2.0 * math.pi * segment.frequencies[:, :, None] * times
        + segment.phases[:, :, None]
    )
    waves = segment.amplitudes[:, :, None] * np.sin(sines)
    peak = np.abs(waves.sum(axis=1)).max(axis=1)
    pulled = np.abs(
        (waves * (2.0 * math.pi * segment.frequencies[:, :, None]) ** 2).sum(axis=1)
    ).max(axis=1)
    factor = np.ones(len(peak)) if size is None else size / peak
    factor[:3] = np.minimum(factor[:3], STRONGEST / pulled[:3])
    # another segment's offset may have grown beyond the range; at its end an axis
    # rests, in this and in what follows it
    offsets = np.clip(segment.offsets, axes.low - axes.rest, axes.high - axes.rest)
    room = np.minimum(axes.high - axes.rest - offsets, offsets + axes.rest - axes.low)
    # the divisor may be 0: an axis at rest has no peak
    factor = np.minimum(factor, np.maximum(room, 0.0) / np.maximum(peak, 1e-300))
    return replace(
        segment, amplitudes=segment.amplitudes * factor[:, None], offsets=offsets
    )


def reference_table(segments: Sequence[Segment], axes: Axes) -> dict[str, Entry]:
    """Table ``[reference]`` of a scenario file in which segments follow each other."""
    signals: list[Entry] = []
    for axis, rest in enumerate(axes.rest.tolist()):
        pieces: list[Entry] = [round(rest, 5)]
        start = 0.0
        for each in segments:
            moved: dict[str, Entry] = {
                "kind": "shifted",
                "delay": start,
                "signal": each.table(axis),
            }
            pieces.append(
                {
                    "kind": "windowed",
                    "start": start,
                    "stop": start + each.duration,
                    "signal": moved,
                }
            )
            start += each.duration
        signals.append(pieces)
    base = dict(zip("xyz", signals[:3], strict=True))
    return {
        "yaw": signals[3],
        "joints": signals[BASE_AXES:],
        "base": {"kind": "signals", **base},
    }
