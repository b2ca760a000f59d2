"""Web page that replays a measured flight as a ghost next to its model's motion under
the same commands.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from skyarm.view.picture.marks import tones_of
from skyarm.view.picture.viser_sink import VehicleNodes
from skyarm.view.studio.clock import Clock
from skyarm.view.studio.controls import Chart, Column, add_clock, literal, on_user_input
from skyarm.view.studio.page_loop import PageLoop
from skyarm.view.studio.picture import (
    COLORS,
    GHOST,
    LOOK_AT,
    SLOW,
    STAGE,
    TRAIL,
    VIEWS,
    StudioStage,
)
from skyarm.view.studio.replay import (
    HORIZONS,
    PredictionError,
    PredictionReplay,
    mean_error,
)
from skyarm.world.scene.vehicle_shapes import longest_boom, place

if TYPE_CHECKING:
    from skyarm.view.studio.server import ViserServer

GHOST_OPACITY = 0.6
"""Opacity of the measured vehicle, higher than that of a reference."""

USUAL_BOOM = 0.17
"""Boom length (m) of the vehicle for which the first view of simulated flights is
made."""


class ReplayPicture(StudioStage):
    """3D picture of a replay: the measured vehicle as a ghost, the model's vehicle
    solid, and both trails.

    Args:
        server: server of viser. replay: replay that is drawn.
    """

    def __init__(self, server: ViserServer, replay: PredictionReplay) -> None:
        super().__init__(server)
        self.follow = True
        scene = self._scene
        vehicle = replay.vehicle
        size = longest_boom(replay.vehicle) / USUAL_BOOM
        self._ghost = VehicleNodes(
            scene, f"{STAGE}/measured", vehicle, tones_of(GHOST, GHOST_OPACITY)
        )
        self._model = VehicleNodes(
            scene, f"{STAGE}/model", vehicle, tones_of(COLORS[0])
        )
        self._origin = replay.measured.position[0]
        low = replay.measured.position.min(axis=0)
        high = replay.measured.position.max(axis=0)
        # a viewer may leave out lines where the first ones are not seen: they span the
        # flight
        reached = np.array([[low, high]], dtype=np.float32)
        self._trails = [
            scene.add_line_segments(
                f"{STAGE}/{name}_trail", reached, color, thickness=0.004 * size
            )
            for name, color in (("measured", GHOST), ("model", COLORS[0]))
        ]
        # twice the flight's extent, and 12 m at least; both chosen
        self._ground.width = self._ground.height = max(
            12.0, 2.0 * float(np.ceil((high - low)[:2].max()))
        )
        self._ground.position = (
            *np.round(0.5 * (low + high)[:2]),
            min(0.0, float(low[2])),
        )
        camera = server.initial_camera
        camera.look_at = tuple(self._origin + size * LOOK_AT)
        camera.position = tuple(self._origin + size * VIEWS[0])

    def draw(self, replay: PredictionReplay) -> None:
        """Draw the replay at the current time."""
        self._frame += 1
        for nodes, motion in (
            (self._ghost, replay.measured),
            (self._model, replay.model),
        ):
            k = replay.tick
            predicted = bool(np.isfinite(motion.position[k]).all())
            nodes.show(predicted)
            if predicted:
                placed = place(
                    replay.vehicle,
                    motion.position[k],
                    motion.quaternion[k],
                    motion.joints[k],
                )
                nodes.place(placed.poses)
        self._follow(replay.measured.position[replay.tick])
        if self._frame % SLOW == 0:
            for node, segments in zip(self._trails, replay.trails(TRAIL), strict=True):
                node.points = (
                    segments if len(segments) else np.zeros((1, 2, 3))
                ).astype(np.float32)


class ReplayPage(PageLoop):
    """Web page of a measured flight next to its model.

    Args:
        server: server of viser. replay: replay that is shown.
    """

    def __init__(self, server: ViserServer, replay: PredictionReplay) -> None:
        super().__init__(server, "prediction")
        self.replay = replay
        self._picture: ReplayPicture = ReplayPicture(server, replay)
        self._predicting = False
        gui = server.gui
        self._status = gui.add_markdown(self._text())
        self._time = add_clock(gui, self.do, (replay.steps - 1) / replay.rate)
        low, high = HORIZONS
        first = min(max(replay.horizon, low), high)
        hint = (
            "the model is set back to the measured position, attitude, velocity and"
            " rate after this time"
        )
        horizon = gui.add_slider(
            "set back every (s)", low, high, 0.05, first, hint=hint
        )
        self._horizon = replay.horizon
        on_user_input(
            horizon,
            lambda value: self._orders.put(lambda: setattr(self, "_horizon", value)),
        )
        follow = gui.add_checkbox(
            "follow", True, hint="the camera goes along with the measured vehicle"
        )
        on_user_input(follow, self.follow)
        shown: dict[str, Column[PredictionError]] = {
            "position error (mm)": lambda seen: 1e3 * seen.position,
            "attitude error (deg)": lambda seen: math.degrees(seen.attitude),
        }
        self._charts = [
            Chart(gui, title, replay.curves, {"": get}) for title, get in shown.items()
        ]

    def do(self, work: Callable[[Clock], None]) -> None:
        """Queue a function that changes the playback clock, to be called before the
        next frame.
        """
        self._orders.put(lambda: work(self.replay))

    def _handle_inputs(self) -> None:
        """Execute the queued inputs, then predict anew if the horizon was moved."""
        super()._handle_inputs()
        # of a slider that is moved meanwhile only the last place counts
        if self._horizon != self.replay.horizon and not self._predicting:
            self._predicting = True
            self._worker.submit(self._predict, self._horizon)

    def _predict(self, horizon: float) -> None:
        """Predict the replayed flight over another horizon (s) in the background, while
        playback continues.
        """
        predicted = self.replay.predict(horizon)

        def show() -> None:
            self._predicting = False
            self.replay.show(predicted, horizon)
            self._picture.hurry()

        self._orders.put(show)

    def _advance(self, seconds: float) -> None:
        self.replay.advance(seconds)

    def _draw(self) -> None:
        self._picture.draw(self.replay)

    def _draw_slowly(self) -> None:
        """Update plots, clock and status text, at a lower rate than the 3D picture."""
        for chart in self._charts:
            chart.draw()
        if self.replay.playing:
            self._time.value = self.replay.time
        self._status.content = self._text()

    def _text(self) -> str:
        """Status text of the page: clock, current prediction errors, and root mean
        squares over the flight.
        """
        replay = self.replay
        age = replay.age[replay.tick]
        now = "no prediction here, near the ground, a gap or an end of the log"
        if math.isfinite(age):
            now = (
                f"{_in_words(*replay.errors[:, replay.tick])}, {age:.2f} s after it was"
                " set back"
            )
        whole, constant = mean_error(replay.errors), mean_error(replay.held_errors)
        return self._with_report(
            [
                f"**{literal(replay.title)}**",
                replay.words,
                f"model {literal(replay.vehicle.name)}: {now}",
                (
                    f"root mean square: {_in_words(*whole)}; with held velocity and"
                    f" rate: {_in_words(*constant)}"
                ),
                (
                    "Grey: measured. Blue: model under the recorded commands. An open"
                    " loop drifts: it is set back to the measured state every"
                    f" {replay.horizon:g} s."
                ),
                *(["Predicting ..."] if self._predicting else []),
                *(
                    [f"**Warning:** {literal(replay.warning)}"]
                    if replay.warning
                    else []
                ),
            ]
        )


def _in_words(position: float, attitude: float) -> str:
    """Format errors of position (m) and attitude (rad) as text in mm and degrees."""
    return f"{1e3 * position:.3g} mm, {math.degrees(attitude):.3g} deg"
