"""Names of the environments for Gymnasium, registered when :mod:`skyarm.env` is imported.

Nothing of the engine is loaded before an environment is made.
"""

from __future__ import annotations

from skyarm.files import needs_extra

try:
    import gymnasium
except ModuleNotFoundError:
    raise ModuleNotFoundError(f"skyarm.env: {needs_extra('gym')}", name="gymnasium") from None

SINGLE = "skyarm.env.single_environment:Environment"
VECTOR = "skyarm.env.vector_environment:VectorEnvironment"
SHIPPED_TASKS = "skyarm.env.named_tasks"

ANY_SCENARIO = "skyarm/Scenario-v0"

TASK_NAMES = ("Hover", "TrackTip", "HoldTipInWind", "CarryPayload", "Recover")
"""Names of the shipped environments (:data:`skyarm.env.named_tasks.NAMED`)."""


def register() -> None:
    """Register ``skyarm/Scenario-v0`` and the shipped tasks; once is enough, twice does no harm."""
    if ANY_SCENARIO in gymnasium.registry:
        return
    gymnasium.register(ANY_SCENARIO, entry_point=SINGLE, vector_entry_point=VECTOR)
    for name in TASK_NAMES:
        gymnasium.register(
            f"skyarm/{name}-v0",
            entry_point=f"{SHIPPED_TASKS}:make_single",
            vector_entry_point=f"{SHIPPED_TASKS}:make_vector",
            kwargs={"task": name},
        )
