"""Names of the environments for Gymnasium; an installed package registers them by its entry point.

Gymnasium calls :func:`register` when it is imported: nothing of the library is loaded before an environment is made.
"""

from __future__ import annotations

SINGLE = "skyarm.env.single_environment:Environment"
VECTOR = "skyarm.env.vector_environment:VectorEnvironment"
NAMED = "skyarm.env.named_tasks"

TASKS = {
    "Hover": "hover",
    "TrackTip": "track_tip",
    "HoldTipInWind": "hold_tip_in_wind",
    "CarryPayload": "carry_payload",
    "Recover": "recover",
}
"""Name of each shipped environment -> function of :mod:`skyarm.env.named_tasks` that says what it is."""


def register() -> None:
    """Register ``skyarm/Scenario-v0`` and the shipped tasks; once is enough, twice does no harm."""
    import gymnasium

    if "skyarm/Scenario-v0" in gymnasium.registry:
        return
    gymnasium.register("skyarm/Scenario-v0", entry_point=SINGLE, vector_entry_point=VECTOR)
    for name in TASKS:
        gymnasium.register(
            f"skyarm/{name}-v0",
            entry_point=f"{NAMED}:make_single",
            vector_entry_point=f"{NAMED}:make_vector",
            kwargs={"task": name},
        )
