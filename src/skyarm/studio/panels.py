"""Sliders for numbers of the records: one for each knob, in a folder for each group."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from skyarm.studio.knobs import Knob

Moved = Callable[[str, float], None]


class KnobPanel:
    """Sliders of some knobs.

    Args:
        gui: of viser, within the container that they shall stand in.
        knobs: in order.
        moved: called with path and value when a hand has moved one, from any thread.
        open_groups: folders that stand open at first.
    """

    def __init__(self, gui: Any, knobs: Sequence[Knob], moved: Moved, open_groups: Sequence[str] = ()) -> None:
        self._knobs = {knob.path: knob for knob in knobs}
        self._sliders: dict[str, Any] = {}
        for group in dict.fromkeys(knob.group for knob in knobs):
            with gui.add_folder(group, expand_by_default=group in open_groups):
                for knob in knobs:
                    if knob.group == group:
                        self._sliders[knob.path] = _slider(gui, knob, moved)

    def show(self, values: Mapping[str, float]) -> None:
        """Set the sliders to numbers by path; those that are not given, to the scenario's."""
        for path, slider in self._sliders.items():
            slider.value = self._knobs[path].clipped(values.get(path, self._knobs[path].value))


def _slider(gui: Any, knob: Knob, moved: Moved) -> Any:
    """The slider of one knob."""
    label = f"{knob.label} ({knob.unit})" if knob.unit else knob.label
    hint = f"{knob.path}: {knob.meaning}" if knob.meaning else knob.path
    slider = gui.add_slider(label, knob.low, knob.high, knob.step, knob.clipped(knob.value), hint=hint)

    async def by_hand(event: Any) -> None:
        if event.client_id is not None:  # what the studio sets itself is no hand
            moved(knob.path, knob.clipped(event.target.value))

    slider.on_update(by_hand)
    return slider
