"""The report's section on laws beyond the paper: tables of the comparison, a picture, and how to read them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from skyarm.compare.comparison_report import BASE, JOINT, TOOL, Column, value
from skyarm.compare.suite import DELAY, NOISE, conditions
from skyarm.metrics.score import score
from skyarm.metrics.windows import Windows
from skyarm.pages import DASH, bullets, details, grouped, image, number, paragraph, table
from skyarm.paper.campaign import COLUMNS, HARDER, LAWS, WIND
from skyarm.paper.flights import STEADY
from skyarm.paper.published import TITLES
from skyarm.simulate import Log

NAMES = {
    "paper_pd": "the paper's PD",
    "paper_ct": "the paper's CT",
    "centroidal_joint": "centroidal law, joint mode",
    "centroidal_tip": "centroidal law, tip mode",
}

QUANTITIES = (("base, mm", BASE), ("joints, mrad", JOINT), ("tip, mm", TOOL))
PEAKS = (("base, mm", "gust_peak_x_continuous"), ("joints, mrad", ""), ("tip, mm", "gust_ee_peak_x_continuous"))
"""In the gust: largest errors along it from its start on."""

SIDE = "case3_wind_side"

WORDS = {
    **TITLES,
    "case3_wind_45": "Case 3 in the same wind from 45 deg",
    SIDE: "Case 3 in the same wind from the side, across the plane of the arm",
}
"""Case -> its title."""

CAPTION = (
    "Means over 10 to 20 s against the continuous reference; in the gust the largest errors along it, from its start "
    "on (-: joints have no error along it). A dash elsewhere: no flight came to its end. Rotor jitter, with noise: "
    "RMS change of a commanded rotor speed from one control period to the next"
)

PICTURE = (
    "Largest error of the tip in every 0.05 s, logarithmic. Grey: the window of the means. At 6 s the arm starts to "
    "swing and the reference steps by 0.3 m onto the circle, at 21 s both stop and it steps back: spikes that no law "
    "can avoid"
)


def beyond_section(summaries: Mapping[str, Any], logs: Mapping[str, Mapping[str, Log]], picture: bytes) -> str:
    """HTML of the section.

    Args:
        summaries: by condition, case, entrant.
        logs: plant -> entrant -> log in the wind with perfect state.
        picture: PNG of the tip's error over time, or nothing.
    """
    parts = [paragraph(lead())]
    if picture:
        words = f"{WORDS[WIND]}. {PICTURE}. Plant: {next(iter(logs), 'none')}."
        parts.append(image(f"{WORDS[WIND]}: tip error over time", words, picture, kind="single"))
    parts += [bullets(hints(summaries)), details("Every case, perfect and noisy", harder_table(summaries))]
    found = plants_table(logs)
    return "".join(parts) + (details("Plant by plant", found) if found else "")


def lead() -> str:
    """Flights and their noise, from the comparison's own constants."""
    noise = (
        f"{1e3 * NOISE.position:g} mm, {1e2 * NOISE.velocity:g} cm/s, {1e3 * NOISE.attitude:g} mrad, "
        f"{NOISE.rate:g} rad/s, joints {1e3 * NOISE.joints:g} mrad and {NOISE.joint_rates:g} rad/s"
    )
    return (
        "The centroidal law of this library beside the paper's two laws, on the paper's cases and with the wind "
        "from two more sides; the plant is rigid_body. Perfect state: one flight. Noisy: white noise of "
        f"{noise}, measurements {1e3 * DELAY:g} ms old, mean of {conditions()['noisy'].episodes} seeds; the "
        "centroidal law is given the delay. The other laws, and perturbed plants: skyarm compare. All are slow "
        "motions in constant or stepped forces; how far the numbers hold as speed, wind, delay, lag, payload and noise "
        "grow: skyarm compare envelope-suite."
    )


def _shown(summaries: Mapping[str, Any], condition: str, case: str, law: str, metric: str, factor: float = 1e3) -> str:
    return number(value(summaries.get(condition, {}), Column("", case, metric, factor), law))


def hints(summaries: Mapping[str, Any]) -> list[str]:
    """Explanations of what looks like a fault, with the numbers of these flights."""

    def shown(law: str, metric: str, factor: float = 1e3, case: str = WIND) -> str:
        return _shown(summaries, "perfect", case, law, metric, factor)

    def both(law: str, metric: str) -> str:
        return " and ".join(_shown(summaries, condition, "case1", law, metric) for condition in COLUMNS)

    return [
        f"Joint mode cannot keep the tip in the wind, nor can any law that keeps the joints: against the wind the base "
        f"must lean (here by up to {shown('centroidal_joint', 'tilt_max', math.degrees(1.0))} deg), and an arm that "
        f"hangs from it with its joints on their references leans along. With the base exact to "
        f"{shown('centroidal_joint', BASE)} mm and the joints to {shown('centroidal_joint', JOINT)} mrad the tip is "
        f"{shown('centroidal_joint', TOOL)} mm away.",
        f"Tip mode gives up what it does not need: the joints leave their references (by "
        f"{shown('centroidal_tip', JOINT)} mrad in the wind) and the base gives way (by "
        f"{shown('centroidal_tip', BASE)} mm, or {shown('centroidal_tip', BASE, case=SIDE)} mm where the wind blows "
        f"across the plane of the arm), so that the mean tip error is {shown('centroidal_tip', TOOL)} mm "
        f"({shown('centroidal_tip', TOOL, case=SIDE)} mm).",
        "The paper's laws do not fly better with noise where their base errors are smaller (Case 1, perfect "
        f"and noisy: CT {both('paper_ct', BASE)} mm, PD {both('paper_pd', BASE)} mm). They hang below their height, "
        "and rotors that speed up faster than they slow down turn noisy commands into more mean thrust, which lifts "
        "CT by some 3 mm (rotors with equal time constants: by nothing). What PD gains comes with the delay and not "
        f"with the noise; its joints pay for it (there {both('paper_pd', JOINT)} mrad).",
    ]


def harder_table(summaries: Mapping[str, Any]) -> str:
    """Base, joints and tip of every law in every case, perfect and noisy, with the rotors' jitter."""
    head = ["law", *(f">{condition}: {words}" for condition in COLUMNS for words, _ in QUANTITIES)]
    groups = []
    for case in HARDER:
        quantities = PEAKS if case == "case2_gust" else QUANTITIES
        rows = []
        for law in LAWS:
            cells = [
                _shown(summaries, condition, case, law, metric) if metric else DASH
                for condition in COLUMNS
                for _, metric in quantities
            ]
            rows.append([NAMES[law], *cells, _shown(summaries, "noisy", case, law, "rotor_jitter", 1.0)])
        groups.append((WORDS[case], rows))
    return grouped([*head, ">noisy: rotor jitter, rad/s"], groups, CAPTION)


def plants_table(logs: Mapping[str, Mapping[str, Log]]) -> str:
    """The flights in the wind with perfect state on every plant that was asked for."""
    found = {plant: {name: errors(log) for name, log in flown.items()} for plant, flown in logs.items()}
    head = ["law", *(f">{plant}: {words}" for plant in found for words, _ in QUANTITIES)]
    rows = [
        [NAMES[name], *(number(laws[name][metric], 1e3) for laws in found.values() for _, metric in QUANTITIES)]
        for name in LAWS
    ]
    return table(head, rows, f"{WORDS[WIND]} with perfect state, plant by plant") if found else ""


def errors(log: Log) -> dict[str, float | None]:
    """Base, joints and tip of a flight as the comparison counts them; None for one that ended before its time."""
    if log.status != "completed":
        return dict.fromkeys((BASE, JOINT, TOOL))
    return {**score(log, (BASE, JOINT, TOOL), Windows(steady=STEADY))}
