"""Preview of a reference: future samples that are published together with the held
sample.

A sample is value, rate and acceleration of x, y, z, yaw and each joint.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from skyarm.algebra import Scalar
from skyarm.reference.trajectory import Reference

Sample = tuple[Scalar, Scalar, Scalar]
"""Value, first and second derivative of one signal."""


def samples(reference: Reference) -> list[Sample]:
    """Value, rate and acceleration of the reference's x, y, z, yaw and each joint."""
    base = list(
        zip(reference.position, reference.velocity, reference.acceleration, strict=True)
    )
    heading = reference.yaw, reference.yaw_rate, reference.yaw_acceleration
    joints = zip(
        reference.joints,
        reference.joint_rates,
        reference.joint_accelerations,
        strict=True,
    )
    return [*base, heading, *joints]


def with_preview(
    sample: Reference, leads: Sequence[Scalar], at: Callable[[Scalar], Reference]
) -> Reference:
    """Reference with a preview: the samples that follow the held one.

    Args:
        sample: published one, which is held.
        leads: s after it, of the samples to come; empty for none.
        at: reference by the time after the held sample, s.
    """
    if not leads:
        return sample
    later = [at(lead) for lead in leads]
    numbers: list[Scalar] = []
    for coming in later:
        for each in samples(coming):
            numbers += each
    return replace(
        sample,
        ahead=tuple(numbers),
        # a sum of tuples joins them: the turnings of all samples, one after the other
        turning=sum((coming.turning for coming in later), sample.turning),
    )


def samples_ahead(reference: Reference) -> list[list[Sample]]:
    """Future samples of all signals of a reference, one list for each preview instant;
    empty without a preview.
    """
    # three numbers of x, y, z, the heading and each joint
    count = 3 * (4 + len(reference.joints))
    rows = [
        reference.ahead[i : i + count] for i in range(0, len(reference.ahead), count)
    ]
    return [
        [(row[k], row[k + 1], row[k + 2]) for k in range(0, count, 3)] for row in rows
    ]
