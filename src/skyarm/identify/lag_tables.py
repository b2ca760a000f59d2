"""Lines of scenario and vehicle files that say what a log told of delays and lags."""

from __future__ import annotations

from skyarm.files.toml import toml_key
from skyarm.identify.lag_records import Estimated, LoopLags

STEP = 0.001
"""s, of the usual physics, of which a command's delay is a whole number."""


def lag_tables(found: LoopLags, measured: float = 0.0) -> str:
    """TOML to paste: delays of plant and law, the rotors' time constants, the joints' drives; empty if none is known.

    Args:
        found: in a log.
        measured: s, age of the measurement that the law is told of beside, where the log's rates are true.
    """
    lines: list[str] = []
    rotors = found.rotors
    if rotors is not None and rotors.known:
        periods = round((measured + rotors.delay.value) / found.period)
        lines += [
            "# scenario: what the plant has, in whole physics steps",
            "[delays]",
            f"command = {round(rotors.delay.value / STEP) * STEP:.3f}  {_from(rotors.delay)}",
            "",
            "# what a law may be told, as an option of its law: centroidal, and others",
            f"# controller.delay = {periods * found.period:.6g}",
            f"# controller.delay_periods = {periods}",
            "",
            "# vehicle file, each of [[rotors]]",
            f"# time_constant_up = {rotors.up.value:.4f}  {_from(rotors.up)}",
            f"# time_constant_down = {rotors.down.value:.4f}  {_from(rotors.down)}",
            "",
        ]
    for joint in found.joints:
        # a lag that its interval does not tell from none is none; where delay and lag are one, it stands for both
        lagging = joint.up.low > STEP if joint.apart else joint.together.low > found.period
        if joint.known and lagging:
            beside = f"beside a delay of {1e3 * joint.delay.value:.1f} ms"
            lines += [
                f"[plant.drives.{toml_key(joint.name)}]",
                'kind = "lagged_torque"',
                f"time_constant = {joint.up.value:.4f}  {_from(joint.up)}; {beside}",
                "",
            ]
    return "\n".join(lines)


def _from(found: Estimated) -> str:
    return f"# {1e3 * found.low:.2f} to {1e3 * found.high:.2f} ms"
