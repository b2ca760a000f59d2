"""Type, unit, default, allowed values, meaning and effect of each option of the control laws.

A field of a law's constants declares its own unit and meaning. :data:`OPTIONS` has the others: options that are
written otherwise than they are stored, and texts.
"""

from __future__ import annotations

import dataclasses
import inspect
import math
from collections.abc import Mapping

from skyarm.control.blocks.geometric import RATE_ERRORS
from skyarm.control.catalogue import entry_of
from skyarm.control.law_maker import constants_of
from skyarm.control.laws.centroidal.options import GAINS, RANGES, RETIRED, VALUES
from skyarm.control.laws.centroidal.parameters import MODES
from skyarm.control.model import Options, Terms
from skyarm.dynamics.actuators.mixer import POLICIES
from skyarm.records.immutable import immutable
from skyarm.records.leaves import field_names
from skyarm.records.units import NUMBER, Unit, declared_fields, declared_units

CLOCK = "from the scenario"
"""Default of an option that follows from the scenario's rates and delays."""


@immutable(kw_only=False)
class OptionText:
    """Description of one option of a control law for tables and for ``skyarm show words``.

    Attributes:
        unit: unit, meaning and bounds.
        entry: type in words; empty for that of ``default``.
        allowed: allowed values in words; empty for the bounds of ``unit``.
        usual: default in words; empty for ``default``.
        effect: effect of a higher or lower value; empty if obvious, or if nobody tunes the option.
        default: value in the signature of the law's maker.
    """

    unit: Unit = NUMBER
    entry: str = ""
    allowed: str = ""
    usual: str = ""
    effect: str = ""
    default: object = None


def _text(meaning: str, *choices: str, unit: str = "", **more: str) -> OptionText:
    """Description of an option that is a text, a flag or a table."""
    allowed = more.pop("allowed", " or ".join(f'"{each}"' for each in choices))
    return OptionText(Unit(unit, meaning), more.pop("entry", "text"), allowed, **more)


def _row(count: str, unit: str, meaning: str, effect: str = "", **more: str) -> OptionText:
    """Description of an option that is a row of numbers."""
    return OptionText(Unit(unit, meaning), f"{count} numbers", effect=effect, **more)


_OBSERVER = _row(
    "three",
    "rad/s",
    "bandwidths of the observed force, torque and joint efforts",
    "higher values estimate a disturbance sooner and pass more noise to the commands",
    allowed="above 0",
)
_DELAY = OptionText(
    Unit("control periods", "known age of the measurement, over which the state is predicted", low=0, high=100),
    "whole number",
    usual=CLOCK,
    effect="a value below the true age leaves the remaining delay in the loop",
)
_TOUCH = _row(
    "two",
    "N",
    "normal forces at the tip above which contact begins and below which it ends",
    "lower values detect contact sooner, and more often where there is none",
    allowed="above 0",
)
_FLAG = "true or false"

SHARED: Mapping[str, OptionText] = {
    "gains": _text(
        "gains of the base on position, velocity, attitude and body rate",
        entry="table",
        usual="those of RotorS for the Hummingbird, scaled to mass and inertia of the model",
        allowed="`position`, `velocity`, `attitude`, `rate`",
        effect="higher values respond faster and amplify noise",
    ),
    "joint_gains": _text(
        "gains of the joints on position and rate",
        entry="table",
        usual="150 1/s^2 and 17 1/s",
        allowed="`stiffness`, `damping`",
        effect="higher values respond faster and amplify noise",
    ),
    "mixer_policy": _text(
        "what is given up first where rotors saturate",
        *POLICIES,
        effect="`clip` limits each rotor by itself; `priority` keeps roll and pitch, then thrust, then yaw; "
        "`thrust_before_yaw` lets the thrust make room for yaw, too",
    ),
    "rate_error": _text(
        "error of the body rate against the desired yaw rate: in the form of RotorS's code, or of Lee 2010",
        *RATE_ERRORS,
    ),
    "terms": _text(
        "terms of the computed torque that are left out",
        entry="list of names",
        usual="none",
        allowed=", ".join(f'"{name}"' for name in field_names(Terms) or ()),
    ),
    "friction_compensation": OptionText(
        Unit("", "fraction of the model's friction that each joint's torque compensates", low=0.0),
        "one number for each joint",
        usual="none",
        effect="1 compensates all friction of the model; more than the true friction destabilizes the joint",
    ),
    "rate_weights": OptionText(
        Unit("", "factor on each joint's desired rate before the measured rate is subtracted", low=0.0),
        "one number for each joint",
        usual="1",
        effect="lower values overshoot less and lag behind the reference more",
    ),
    "euler": _text("computation in the paper's Euler angles, undefined at a pitch of 90 degrees", entry=_FLAG),
    "observer": _OBSERVER,
    "delay_periods": _DELAY,
    "reference_period": OptionText(
        Unit("s", "time between samples of the held reference", low=0.0, strict=True), "number", usual=CLOCK
    ),
    "parameters": _text(
        "parameters of the autopilot in place of those that follow from the vehicle", entry="table", usual="none"
    ),
    "transcript": _text("file that the exchanged bytes are written to", usual="none"),
    "replayed": _text("file of an earlier transcript that answers in place of the program", usual="none"),
    "outside": _text("flight in real time, in which a program outside commands base and arm", entry=_FLAG),
    "instance": OptionText(Unit("", "number of the instance, for several on one machine"), "whole number"),
}
"""Options that mean the same for several laws."""

_TIP = ' with `mode = "tip"`'

CENTROIDAL: Mapping[str, OptionText] = {
    "mode": _text("what the law keeps on its reference: base and joints, or the tip", *MODES),
    "preset": _text(
        "name of a preset of version 0.3; each of them flies the present gains, with a note",
        *("adaptive", "gusts", "robust", "stiff"),
        usual="none",
    ),
    "delay": OptionText(
        Unit("s", "known delay from a command to its measurement, over which the state is predicted"),
        "number",
        "0 to 100 whole control periods",
        CLOCK,
        "a value below the true delay leaves the remaining delay in the loop",
    ),
    "age": OptionText(
        Unit("s", "part of `delay` that is the age of the measurement; the rest is a delay of the commands"),
        "number",
        "0 to `delay`, whole control periods",
        f"{CLOCK}; in Python `delay`",
    ),
    "control_period": OptionText(
        Unit("s", "control period; a file may only repeat that of its rates", low=1e-5, high=10.0),
        "number",
        usual=CLOCK,
    ),
    "reference_period": OptionText(
        Unit("s", "time between samples of the held reference", low=1e-5, high=10.0), "number", usual=CLOCK
    ),
    "tip_mass_limit": OptionText(
        Unit("kg", "bound of the mass at the tip that `adaptation` estimates", low=0.0, high=1000.0),
        "number",
        effect="higher values cover heavier loads",
    ),
    "base": _row(
        "four",
        "1/s^2, 1/s, 1/s^2, 1/s",
        "gains on position and velocity of the centre of mass, on attitude and on body rate",
        "higher values respond faster, amplify noise and tolerate less delay",
    ),
    "yaw": _row(
        "two",
        "1/s^2, 1/s",
        "gains on yaw angle and yaw rate",
        "higher values respond faster and saturate the rotors sooner",
    ),
    "arm": _row(
        "two",
        "1/s^2, 1/s",
        "stiffness and damping of the joints",
        "higher values track the joints closer, amplify noise and tolerate less delay",
    ),
    "tip": _row(
        "two",
        "1/s^2, 1/s",
        f"gains on position and velocity of the tip,{_TIP}",
        "higher values track the tip closer, amplify noise and tolerate less delay",
    ),
    "observer": _row(
        "four",
        "rad/s",
        "bandwidths of the observed force, torque and joint efforts, and of the filter of the pose",
        "higher values estimate a disturbance sooner and pass more noise to the commands",
        allowed="three above 0; the last at least 0",
    ),
    "bandwidth": OptionText(
        Unit("", "factor on dampings and observer; its square multiplies stiffnesses"),
        effect="higher values reject disturbances better, raise the jitter and tolerate less delay",
    ),
    "tilt": OptionText(
        Unit("", "tangent of the largest commanded tilt"),
        effect="higher values allow more horizontal force; the tilt is steeper",
    ),
    "reach": OptionText(
        Unit("m", f"error of the base beyond which the tip follows the base,{_TIP}"),
        effect="higher values let the arm cover larger errors of the base",
    ),
    "damping": OptionText(
        Unit("m", f"singular value of the tip's Jacobian below which its direction is given up,{_TIP}"),
        effect="higher values move the joints less near stretched poses and track the tip less closely",
    ),
    "posture": OptionText(
        Unit("m", f"weight of the joints' own references,{_TIP}"),
        effect="higher values keep the joints nearer to their references and the tip farther from its own",
    ),
    "preview": OptionText(
        Unit("s", f"time ahead by which the base starts to shift,{_TIP}; 0 disables it"),
        effect="higher values begin a shift of the base earlier, which then is smoother",
    ),
    "shift_rate": OptionText(
        Unit("rad/s", f"filter of the disturbance that the shift of the base follows,{_TIP}"),
        effect="higher values shift the base sooner after a change of wind, with more motion",
    ),
    "force_trend": OptionText(
        Unit("rad/s", "tracker of the rate of the observed force; 0 disables it"),
        usual="20.0, less for slow motors",
        effect="higher values predict a changing wind sooner and amplify noise",
    ),
    "accelerometer": _row(
        "two",
        "rad/s",
        "bandwidths with which observed force and velocity follow the accelerometer; twice 0 ignores it",
        "higher first values estimate a force sooner and need an accelerometer with less noise",
        allowed="0 to 1000, both above 0 or both 0",
    ),
    "lag": _row(
        "two",
        "s",
        "lags of rotors and of joints at which the law halves their bandwidth; twice 0 disables the estimate",
        "lower values reduce the gains more for the same lag",
        allowed="both above 0 or both 0",
    ),
    "adaptation": OptionText(
        Unit("1/s", "rate of the estimated load at the tip; 0 estimates none"),
        effect="higher values estimate a load sooner, with more noise",
    ),
    "interaction": _row(
        "two",
        "N",
        f"normal forces at the tip above which contact begins and below which it ends,{_TIP}; twice 0 disables contact",
        "lower values detect contact sooner, and more often where there is none",
        allowed="0 to 1000, both above 0 or both 0",
    ),
    "tolerances": _row(
        "two",
        "",
        "relative standard deviations of the actual joint torques and of the arm's weight, with `interaction`",
        allowed="0 to 1",
    ),
    "force_sensor": _text(
        "the tip's force is that of a force sensor, with `interaction` or `admittance`",
        entry=_FLAG,
        allowed=_FLAG,
    ),
    "load": OptionText(
        Unit("kg", "largest estimated mass of a carried load, under `reference.load`; 0 estimates none"),
        effect="higher values cover heavier loads",
    ),
    "sideways": OptionText(
        Unit(
            "",
            "fraction of the rotors' range used to push sideways, by rotors that give any force without a tilt",
        ),
        effect="higher values push harder sideways without tilt",
    ),
    "attitude": _row("two", "rad", "roll and pitch that sideways force holds", allowed="-1 to 1"),
    "admittance": _text(
        f"virtual `mass`, `damping`, `stiffness` of the tip along three axes,{_TIP}",
        entry="table",
        usual="none",
        allowed="`mass`, `damping`, `stiffness`, `normal`, `threshold`",
        effect="lower stiffness and damping yield more to a push",
    ),
}

OPTIONS: Mapping[str, Mapping[str, OptionText]] = {
    "centroidal": {
        **CENTROIDAL,
        **{
            name: OptionText(Unit("", "option of version 0.3, replaced by `preview`; read with a note"), "number")
            for name in RETIRED
        },
    },
    "decoupled_pd": {"joint_gains": dataclasses.replace(SHARED["joint_gains"], usual="150 and 17 times the inertia")},
    "admittance_pd": {
        "joint_gains": dataclasses.replace(SHARED["joint_gains"], usual="150 and 17 times the inertia"),
        "interaction": _TOUCH,
    },
    "hybrid_ct": {"interaction": _TOUCH},
    "ct_ladder": {"observer": dataclasses.replace(_OBSERVER, unit=Unit("rad/s", f"{_OBSERVER.unit.meaning}; step 3"))},
    "l1_adaptive": {
        "lateral": _text("compensation of the force across body z by attitude; not in the publication", entry=_FLAG)
    },
    "indi": {"measured_speeds": _text("rotor speeds are measured; false models them", entry=_FLAG)},
    "nmpc": {
        "mode": _text("what the cost keeps on its reference: the tip, or the joints", "tool", "joints"),
        "weights": _text(
            "weights of the cost, each one over the error that costs 1 per second",
            entry="table",
            usual="those of its rows",
            allowed="any of its rows",
            effect="a higher weight tracks this quantity closer at the cost of the others",
        ),
        "bandwidths": _text(
            "bandwidths of the disturbance observer",
            entry="table",
            usual="those of its rows",
            allowed="any of its rows",
            effect="higher values estimate a disturbance sooner and pass more noise to the commands",
        ),
        "stages": OptionText(
            Unit("", "stages of the horizon", low=2, high=200),
            "whole number",
            effect="higher values follow fast motions closer and take longer to compute",
        ),
        "horizon": OptionText(
            Unit("s", "length of the horizon", low=0.05, high=5.0),
            effect="higher values foresee limits earlier; stages become longer",
        ),
        "every": OptionText(
            Unit("control periods", "time from one solution to the next", low=1, high=200),
            "whole number",
            "1 to 199, less than `stages`",
            effect="higher values compute less often and react later",
        ),
        "interaction": _row(
            "two",
            "N",
            "normal forces at the tip above which contact begins and below which it ends; twice 0 disables contact",
            usual="0.3, 0.1 with a tip",
            allowed="above 0, or twice 0",
        ),
    },
}
"""Law -> descriptions of options that differ from those of :data:`SHARED`, or are its own."""


COUNTS = {2: "two", 3: "three", 4: "four"}


def option_texts(law: str) -> dict[str, OptionText]:
    """Descriptions of the options of a law or an autopilot, by name, in the order of its maker."""
    entry = entry_of(law)
    maker = entry.function()
    fields = declared_fields(getattr(maker, "kind", constants_of(maker)))
    declared = declared_units(Options) | declared_units(maker)
    usual = {name: each.default for name, each in inspect.signature(maker).parameters.items()}
    texts = {}
    for option in entry.options():
        own = OPTIONS.get(law, {}).get(option) or SHARED.get(option, OptionText())
        _, unit = fields.get(option) or declared.get(option) or (None, NUMBER)
        value = VALUES.get(option, "") if law == "centroidal" and option not in usual else usual[option]
        unit = _merge_units(unit, own.unit)
        if law == "centroidal" and option in RANGES:
            low, high = RANGES[option]
            unit = dataclasses.replace(unit, low=low, high=high)
        elif law == "centroidal" and option in GAINS:
            unit = dataclasses.replace(unit, low=0.0)
        texts[option] = dataclasses.replace(own, unit=unit, default=value, entry=own.entry or _entry(value))
    return texts


def _entry(value: object) -> str:
    """Type of an option in words, from its default; empty if the default does not tell."""
    if isinstance(value, tuple) and len(value) in COUNTS:
        return f"{COUNTS[len(value)]} numbers"
    words = {bool: _FLAG, int: "whole number", float: "number", str: "text"}
    return words.get(type(value), "") if value != "" else ""


def _merge_units(declared: Unit, described: Unit) -> Unit:
    """Unit of a field with the meaning that it has as an option."""
    if declared is NUMBER or not (declared.unit or declared.meaning or math.isfinite(declared.low)):
        return described
    return dataclasses.replace(
        declared, unit=declared.unit or described.unit, meaning=described.meaning or declared.meaning
    )
