"""Units and meaning of the fields of the learned compensator in an exported file."""

from __future__ import annotations

LEARNED_NOTES = {
    "Rotor.position": "m, hub, base axes",
    "Rotor.axis": "unit vector of thrust, base axes",
    "Rotor.thrust_coefficient": "N s^2/rad^2",
    "Rotor.moment_coefficient": "m, drag torque per thrust",
    "LearnedParameters.answer": "rad/s, how fast the network's answer is followed",
    "Network.means": "of the inputs, in their units",
    "Network.factors": "one over the deviation of each input",
    "Network.scales": "of the outputs: N and N m, base axes, then joint torques",
    "Network.limits": "largest magnitude of each output, in its unit",
    "Layer.weights": "of a layer, a row an output",
    "Layer.offsets": "of a layer",
    "LearnedMemory.answer": "N and N m at the base, base axes, then joint torques; filtered",
    "History.started": "0 before the first measurement",
    "History.commanded": "0 before the first command",
    "History.velocity": "m/s, world axes, filtered",
    "History.rate": "rad/s, base axes, filtered",
    "History.joint_rates": "rad/s or m/s, filtered",
    "History.force": "N, base axes, of the commanded rotors in still air, filtered",
    "History.torque": "N m, base axes, of the commanded rotors in still air, filtered",
    "History.efforts": "N m or N, commanded, filtered",
}
"""Comment of each field by the record that holds it."""
