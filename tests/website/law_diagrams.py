"""What the block diagram of each law shows."""

from __future__ import annotations

from itertools import pairwise

from block_diagrams import Box, Diagram

TOLD = "told"
REFERENCE = Box(0, 0, ("reference", "p, psi, joints"), kind=TOLD)


def vehicle(column: float, row: float = 0) -> Box:
    """The vehicle, at the end of every diagram."""
    return Box(column, row, ("vehicle", "rotors and joints"), kind="vehicle")


def chain(
    title: str,
    *steps: Box,
    joints: tuple[Box, ...] = (),
    words: dict[str, str] | None = None,
) -> Diagram:
    """Steps in a row from the reference to the vehicle, and a second row for the
    joints, which joins at the vehicle.
    """
    said = words or {}
    names = [f"step{i}" for i in range(len(steps))]
    boxes = {
        "reference": REFERENCE,
        **dict(zip(names, steps, strict=True)),
        "vehicle": vehicle(len(steps) + 1),
    }
    order = ["reference", *names, "vehicle"]
    arrows = [(a, b, said.get(f"{a}>{b}", "")) for a, b in pairwise(order)]
    arms = [f"joint{i}" for i in range(len(joints))]
    boxes |= dict(zip(arms, joints, strict=True))
    if arms:
        order = ["reference", *arms, "vehicle"]
        arrows += [(a, b, "") for a, b in pairwise(order)]
    return Diagram(title, boxes, arrows)


POSITION = Box(1, 0, ("position PD", "a_d (82)"), measured=True)
ATTITUDE = Box(2, 0, ("attitude on SO(3)", "alpha_d (85)"), measured=True)
DYNAMICS = Box(3, 0, ("inverse dynamics", "M qdd + C qd"), measured=True)
MIXER = Box(4, 0, ("mixer (97)-(103)", "torque limit"))
JOINT_PD = Box(2, 1, ("joint PD (92)", "qdd_d"), measured=True)


def coupled(
    title: str,
    *,
    dynamics: Box = DYNAMICS,
    attitude: Box = ATTITUDE,
    more: dict[str, Box] | None = None,
    arrows: tuple[tuple[str, str, str], ...] = (),
    last: Box = MIXER,
    position: Box = POSITION,
    continued: bool = False,
) -> Diagram:
    """The paper's law and what is made of it: base and joints meet in the inverse
    dynamics.
    """
    boxes = {
        "reference": REFERENCE,
        "position": position,
        "attitude": attitude,
        "dynamics": dynamics,
    }
    boxes |= {"mixer": last, "vehicle": vehicle(5), "joints": JOINT_PD, **(more or {})}
    told = "continued" if continued else "reference"
    lines = [
        (told, "position", ""),
        ("position", "attitude", ""),
        ("attitude", "dynamics", ""),
        ("dynamics", "mixer", ""),
        ("mixer", "vehicle", ""),
        (told, "joints", ""),
        ("joints", "dynamics", ""),
    ]
    if continued:
        boxes["continued"] = CONTINUED
        lines.append(("reference", "continued", ""))
    return Diagram(title, boxes, [*lines, *arrows])


def servo(*lines: str) -> tuple[Box, ...]:
    """Joints that are controlled apart."""
    return (Box(2, 1, lines, measured=True),)


CONSISTENT = Box(
    3, 0, ("inverse dynamics", "thrust in, base", "acceleration out"), measured=True
)
AIMED = Box(2, 0, ("attitude on SO(3)", "along coupled force"), measured=True)
OBSERVER = Box(3, 1, ("observer", "force, torque, joints"), measured=True)
TWICE = Box(2, 0, ("attitude on SO(3)", "with rate and", "acceleration"), measured=True)
CONTINUED = Box(1, 1, ("continuation of", "held samples"))
UNLAG = Box(4, 0, ("mixer, torque limit", "motor lag inverted"))
FEEDS = (("observer", "dynamics", ""),)

DIAGRAMS: dict[str, Diagram] = {
    "rotors_sim_position": chain(
        "RotorS's geometric position controller: position PD, attitude, mixer; the"
        " joints get no torque",
        POSITION,
        ATTITUDE,
        Box(3, 0, ("torque I alpha_d", "thrust -m a_d . R e3")),
        Box(4, 0, ("mixer (97)-(103)",)),
    ),
    "decoupled_pd": chain(
        "The paper's baseline: RotorS's controller for the base, and joint PD with"
        " gravity",
        POSITION,
        ATTITUDE,
        Box(3, 0, ("torque I alpha_d", "thrust -m a_d . R e3")),
        Box(4, 0, ("mixer (97)-(103)",)),
        joints=(
            Box(2, 1, ("joint PD", "+ level gravity"), measured=True),
            Box(4, 1, ("torque limit",)),
        ),
    ),
    "hybrid_computed_torque": coupled(
        "The paper's law: accelerations of base and joints meet in the inverse dynamics"
    ),
    "ct_ladder": coupled(
        "The paper's computed torque with all six steps",
        attitude=TWICE,
        dynamics=CONSISTENT,
        more={"observer": OBSERVER},
        arrows=FEEDS,
        continued=True,
        last=UNLAG,
    ),
    "bulut2019": coupled(
        "Computed torque on Euler angles; translation is decoupled in the mass matrix",
        attitude=Box(2, 0, ("small angles", "Euler accelerations"), measured=True),
        dynamics=Box(3, 0, ("M_rr, M_rq, M_qq", "M_tr = M_tq = 0"), measured=True),
    ),
    "guo2023": chain(
        "The centre of mass translates, the locked inertia turns about it; joints are"
        " servos",
        Box(1, 0, ("PD of the", "centre of mass"), measured=True),
        Box(2, 0, ("attitude on SO(3)", "alpha_d"), measured=True),
        Box(3, 0, ("locked inertia J_C(q)", "torque about C"), measured=True),
        Box(4, 0, ("mixer",)),
        joints=servo("joint servos", "own inertia, weight"),
    ),
    "li2024": chain(
        "A geometric base with variable inertia; the arm's reaction is fed forward"
        " to it",
        POSITION,
        ATTITUDE,
        Box(3, 0, ("variable inertia", "+ arm's reaction"), measured=True),
        Box(4, 0, ("mixer",)),
        joints=servo("joint servos", "own inertia, weight"),
    ),
    "hybrid_ct": coupled(
        "The paper's law across the normal; along it an observer estimates the force,"
        " and the commanded one is fed forward to joints, torque and thrust",
        dynamics=Box(3, 0, ("inverse dynamics", "less J^T n o"), measured=True),
        more={
            "observer": Box(
                3, 1, ("observer, contact", "command o along n"), measured=True
            )
        },
        arrows=FEEDS,
    ),
    "admittance_pd": chain(
        "A virtual mass between commanded and observed force moves the reference of the"
        " paper's baseline",
        Box(1, 0, ("virtual mass", "f.n - f_d moves s"), measured=True),
        Box(2, 0, ("position PD", "a_d (82)"), measured=True),
        Box(3, 0, ("attitude on SO(3)", "thrust, torque"), measured=True),
        Box(4, 0, ("mixer (97)-(103)",)),
        joints=(
            Box(2, 1, ("joint PD", "+ level gravity"), measured=True),
            Box(4, 1, ("less J^T n f_d", "torque limit")),
        ),
    ),
    "kim2013": Diagram(
        "Adaptive sliding mode: sliding variables give accelerations for the coupled"
        " inverse dynamics",
        {
            "reference": REFERENCE,
            "sliding": Box(
                1, 0, ("sliding variables", "s = edot + L e"), measured=True
            ),
            "reach": Box(2, 0, ("K s + eta tanh(s/b)", "+ delta"), measured=False),
            "adapt": Box(2, 1, ("adaptation", "deltadot = gamma s")),
            "dynamics": DYNAMICS,
            "mixer": MIXER,
            "vehicle": vehicle(5),
        },
        [
            ("reference", "sliding", ""),
            ("sliding", "reach", ""),
            ("sliding", "adapt", ""),
            ("adapt", "reach", ""),
            ("reach", "dynamics", ""),
            ("dynamics", "mixer", ""),
            ("mixer", "vehicle", ""),
        ],
    ),
    "l1_adaptive": coupled(
        "A predictor estimates what the model omits; the matched part is filtered and"
        " subtracted",
        more={"l1": Box(3, 1, ("predictor, adaptation", "low-pass"), measured=True)},
        arrows=(("l1", "dynamics", ""),),
    ),
    "indi": Diagram(
        "Increments on the measured accelerations and applied torques, all through one"
        " filter",
        {
            "reference": REFERENCE,
            "position": Box(1, 0, ("position PD", "a_c"), measured=True),
            "attitude": Box(2, 0, ("attitude", "alpha_c, qdd_c"), measured=True),
            "increment": Box(
                3, 0, ("last torque + M x", "(desired - measured)"), measured=True
            ),
            "filters": Box(
                3, 1, ("Butterworth filters", "a_f, alpha_f, T_f"), measured=True
            ),
            "mixer": MIXER,
            "vehicle": vehicle(5),
        },
        [
            ("reference", "position", ""),
            ("position", "attitude", ""),
            ("attitude", "increment", ""),
            ("filters", "increment", ""),
            ("increment", "mixer", ""),
            ("mixer", "vehicle", ""),
        ],
    ),
    "centroidal": Diagram(
        "The centroidal law: a force for the centre of mass, an attitude for it, joints"
        " or tip, one inverse dynamics",
        {
            "reference": REFERENCE,
            "com": Box(1, 0, ("centre of mass", "force, 2 derivatives"), measured=True),
            "attitude": Box(
                2, 0, ("attitude on SO(3)", "along the force"), measured=True
            ),
            "tasks": Box(
                2, 1, ("joint mode: joints", "tip mode: tip, links"), measured=True
            ),
            "dynamics": CONSISTENT,
            "observer": Box(
                3, 1, ("observer, estimates", "of load and friction"), measured=True
            ),
            "mixer": Box(4, 0, ("mixer, torque limit", "trim, lag")),
            "vehicle": vehicle(5),
        },
        [
            ("reference", "com", ""),
            ("com", "attitude", ""),
            ("attitude", "dynamics", ""),
            ("reference", "tasks", ""),
            ("tasks", "dynamics", ""),
            ("observer", "dynamics", ""),
            ("dynamics", "mixer", ""),
            ("mixer", "vehicle", ""),
        ],
    ),
    "nmpc": Diagram(
        "Model predictive control: every second period a plan over 0.65 s, in between"
        " its feedback",
        {
            "reference": REFERENCE,
            "preview": Box(1, 0, ("preview", "samples to come")),
            "solve": Box(
                2, 0, ("plan: linearise,", "Riccati, line search"), measured=False
            ),
            "feedback": Box(3, 0, ("u* + K (x - x*)", "within limits"), measured=True),
            "observer": Box(2, 1, ("extended state", "observer"), measured=True),
            "command": Box(4, 0, ("rotor commands", "through the lag")),
            "vehicle": vehicle(5),
        },
        [
            ("reference", "preview", ""),
            ("preview", "solve", ""),
            ("observer", "solve", ""),
            ("solve", "feedback", ""),
            ("feedback", "command", ""),
            ("command", "vehicle", ""),
        ],
    ),
    "learned_compensator": coupled(
        "The paper's law; a network estimates what the model omits",
        more={
            "network": Box(
                3, 1, ("network 39-32-32-8", "filtered, limited"), measured=True
            )
        },
        arrows=(("network", "dynamics", ""),),
    ),
}
"""Law -> its diagram."""
