"""What every metric means, as the report prints it."""

from __future__ import annotations

from dataclasses import dataclass, replace

from skyarm.paper.flights import CONTINUOUS


@dataclass(frozen=True, slots=True)
class Metric:
    """One row of a table.

    Attributes:
        label: words. unit: SI. definition: one sentence.
        bound: the paper states an upper bound only.
    """

    label: str
    unit: str
    definition: str
    bound: bool = False


METRICS = {
    "position_error_mean": Metric("Position error, mean", "m", "Mean of |e_p| over the window; e_p = p - p_d."),
    "position_error_max": Metric("Position error, largest", "m", "Largest |e_p| in the window."),
    "position_min": Metric("Position error, low end", "m", "Smallest |e_p| in the window."),
    "position_max": Metric("Position error, high end", "m", "Largest |e_p| in the window."),
    "position_ripple": Metric("Position error, ripple", "m", "Half of peak to peak of |e_p| in the window."),
    "peak_x": Metric("Peak along x", "m", "Largest magnitude of the x component of e_p in the window."),
    "ee_error_mean": Metric(
        "Tip error, mean",
        "m",
        "Mean of |p_ee - p_ee,d| over the window; p_ee,d = p_d + R_z(yaw_d) p_e(theta_d), the level pose.",
    ),
    "ee_error_max": Metric("Tip error, largest", "m", "Largest |p_ee - p_ee,d| in the window."),
    "joint_error_mean": Metric("Joint error, mean", "rad", "Mean over the window of the norm of both joint errors."),
    "joint_error_max": Metric("Joint error, largest", "rad", "Largest norm of both joint errors in the window."),
    "pitch_rms": Metric("Pitch, RMS", "rad", "Root mean square of pitch over the window."),
    "pitch_mean": Metric("Pitch, mean", "rad", "Mean of pitch over the window."),
    "pitch_ripple": Metric("Pitch, ripple", "rad", "Half of peak to peak of pitch in the window."),
    "roll_rms": Metric("Roll, RMS", "rad", "Root mean square of roll over the window."),
    "peak_pitch": Metric(
        "Peak pitch",
        "rad",
        "Largest |pitch| in the transient, t in [0, 8) s; in the gust the largest in its window, with its sign.",
    ),
    "peak_position": Metric("Peak position error", "m", "Largest |e_p| in the transient, t in [0, 8) s."),
    "tau1_rms": Metric("Torque of joint 1, RMS", "N m", "Root mean square of the commanded torque over the window."),
    "tau2_rms": Metric("Torque of joint 2, RMS", "N m", "Root mean square of the commanded torque over the window."),
    "settling_time": Metric(
        "Settling time",
        "s",
        "First time after which |e_p| stays within 0.02 m of its steady mean to the end; a dash if it never does.",
    ),
    "settling_time_upper_bound": Metric(
        "Settling time, upper bound", "s", "As the settling time; the paper states only that it is less.", True
    ),
    "iae_position": Metric(
        "Integral of position error", "m s", "Integral of |e_p| over the run; in the gust over its window."
    ),
    "iae_joint": Metric(
        "Integral of joint error",
        "rad s",
        "Integral of the joint error norm over the run; in the gust over its window.",
    ),
    "hover_offset": Metric("Hover offset", "m", "Mean of z_d - z over t in [4, 5.9) s, before the motion starts."),
    "held_position_error": Metric(
        "Position error, arm held", "m", "Case 1: mean of |e_p| over the last 3 s of each hold of the arm."
    ),
}


def metric(name: str) -> Metric:
    """Find a metric; a name not listed describes itself."""
    base = name.removesuffix(CONTINUOUS)
    found = METRICS.get(base, Metric(base.replace("_", " "), "", ""))
    if base == name:
        return found
    return replace(found, label=f"{found.label}, continuous reference")
