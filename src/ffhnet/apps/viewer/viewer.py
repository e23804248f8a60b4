"""The viewer: what happens when somebody opens a file, moves a slider or chooses a grasp."""

from __future__ import annotations

import tempfile
import threading
import time
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import viser

from ffhnet.apps.capture_options import CaptureOptions
from ffhnet.apps.viewer.motion import FRAMES_PER_SECOND, Frame, approach, closing, grasp_frame
from ffhnet.apps.viewer.panel import NO_EXAMPLE, NO_GRASP, build_panel, upload_options
from ffhnet.apps.viewer.sight import Looker, Sight, example_names
from ffhnet.apps.viewer.stage import Stage
from ffhnet.apps.viewer.texts import grasp_label, grasp_numbers, note
from ffhnet.errors import FFHNetError
from ffhnet.evaluation.picture import distinct
from ffhnet.hands import Hand

_APART = 0.07
"""m between the palms of two hands that are no near-duplicates; more than in pictures, which show three."""

_TURNED = 50.0
"""Degrees between such palms."""


class Viewer:
    """One server, one scene: every browser that connects sees and moves the same."""

    def __init__(
        self,
        server: viser.ViserServer,
        hand: Hand,
        looker: Looker,
        capture: CaptureOptions | None = None,
        threshold: float = 0.0,
    ) -> None:
        """Builds scene and panel.

        Args:
            server: where.
            hand: the hand of all grasps.
            looker: makes sights of files and examples.
            capture: options of the command line, from which uploads start.
            threshold: where its slider stands at first.
        """
        self._hand, self._looker, self._capture = hand, looker, capture or CaptureOptions()
        self.panel = build_panel(server.gui, example_names(), self._capture, threshold)
        self.stage = Stage(server, hand, self._choose)
        self._sight: Sight | None = None
        self._shown: list[int] = []
        self._chosen: int | None = None
        self._motion = 0
        # Callbacks come from many threads.
        self._lock = threading.RLock()
        self._listen()

    def show(self, sight: Sight) -> None:
        """Replaces what is seen."""
        with self._lock:
            self._choose(None)
            self._sight = sight
            if sight.known is None:
                _select(self.panel.example, NO_EXAMPLE)
            self.stage.show_sight(sight)
            self.stage.frame_camera(sight)
            self._update_crowd()
            feasible, sampled = len(sight.grasps), len(sight.grasps) + sight.dropped
            self.panel.status.content = note(
                f"{sight.title}: {len(sight.cloud)} points; {feasible} of {sampled} grasps can be taken up"
            )

    def show_example(self, name: str) -> None:
        """Shows one of `example_names()`."""
        _select(self.panel.example, name)

    def try_to_show(self, look: Callable[[], Sight]) -> None:
        """Shows what `look` finds, or why it finds nothing; what was seen before then stays."""
        with self._lock:
            self.panel.status.content = note("looking ...")
            try:
                self.show(look())
            except FFHNetError as error:
                self.panel.status.content = note(str(error), error=True)

    def _open_upload(self, file: viser.UploadedFile) -> None:
        """Shows the content of a file that a browser sent."""
        with tempfile.TemporaryDirectory() as folder:
            # The browser's name may hold anything: only its last part, and never a hidden file.
            path = Path(folder) / (Path(file.name.replace("\\", "/")).name.lstrip(".") or "file")

            def look() -> Sight:
                path.write_bytes(file.content)
                try:
                    return self._looker.file(path, upload_options(self.panel, path.name, self._capture))
                except FFHNetError as error:
                    raise type(error)(str(error).replace(f"{folder}/", "")) from error

            self.try_to_show(look)

    def _listen(self) -> None:
        panel = self.panel
        panel.example.on_update(lambda _: self._open_example())
        panel.upload.on_upload(lambda event: self._open_upload(event.target.value))
        for widget in (panel.threshold, panel.count, panel.distinct):
            widget.on_update(lambda _: self._update_crowd())
        panel.grasp.on_update(lambda _: self._choose_by_label())
        panel.close.on_click(lambda _: self._close())
        panel.trial.on_click(lambda _: self._try())

    def _open_example(self) -> None:
        name = self.panel.example.value
        if name != NO_EXAMPLE:
            self.try_to_show(lambda: self._looker.example(name))

    def _update_crowd(self) -> None:
        """Draws the grasps that the sliders leave, and offers them for choice."""
        with self._lock:
            if self._sight is None:
                return
            grasps, panel = self._sight.grasps, self.panel
            assert grasps.probability is not None
            above = np.flatnonzero(grasps.probability >= panel.threshold.value)
            most = int(panel.count.value)
            chosen = (
                above[distinct(grasps[above], most, _APART, _TURNED)]
                if panel.distinct.value
                else above[:most]
            )
            self._shown = [int(index) for index in chosen]
            self.stage.show_crowd(grasps, self._shown)
            self.stage.hide_crowd(self._chosen is not None)
            reach = f"{len(above)} of {len(grasps)} grasps reach {panel.threshold.value:.2f}"
            panel.shown.content = note(f"{len(self._shown)} hands shown; {reach}")
            # A choice that is not among them any more ends with this.
            panel.grasp.options = [NO_GRASP, *(grasp_label(grasps, index) for index in self._shown)]

    def _choose_by_label(self) -> None:
        with self._lock:
            label = self.panel.grasp.value
            if self._sight is None or label == NO_GRASP:
                self._choose(None)
                return
            labels = {grasp_label(self._sight.grasps, index): index for index in self._shown}
            self._choose(labels.get(label))

    def _choose(self, index: int | None) -> None:
        """Shows one grasp alone with its numbers, or all of them again."""
        with self._lock:
            if index == self._chosen:
                return
            self._chosen = index
            self._begin_motion()
            panel = self.panel
            panel.close.disabled = index is None
            panel.trial.disabled = index is None or not self._can_try
            self.stage.hide_crowd(index is not None)
            if self._sight is None or index is None:
                panel.numbers.content = ""
                _select(panel.grasp, NO_GRASP)
                self.stage.hide_frame()
                return
            _select(panel.grasp, grasp_label(self._sight.grasps, index))
            panel.numbers.content = grasp_numbers(self._sight.in_input[index])
            self.stage.show_frame(grasp_frame(self._sight.grasps[index]))

    @property
    def _can_try(self) -> bool:
        """Whether a trial can be made: the whole object is known, and MuJoCo is there."""
        return self._sight is not None and self._sight.known is not None and find_spec("mujoco") is not None

    def _close(self) -> None:
        with self._lock:
            if self._sight is None or self._chosen is None:
                return
            grasp = self._sight.grasps[self._chosen]
            motion = self._begin_motion()
        self._play([*approach(self._hand, grasp), *closing(self._hand, grasp)], motion)

    def _try(self) -> None:
        with self._lock:
            if self._sight is None or self._sight.known is None or self._chosen is None:
                return
            from ffhnet.apps.viewer.trial import describe, record_trial

            grasp, known = self._sight.grasps[self._chosen], self._sight.known
            motion = self._begin_motion()
            self.panel.outcome.content = note("simulating ...")
            recording = record_trial(self._hand, known, grasp)
        self._play(recording.frames, motion)
        with self._lock:
            if motion == self._motion:
                self.panel.outcome.content = note(describe(recording))

    def _begin_motion(self) -> int:
        """Ends whatever moves; the number that the new motion goes by."""
        self.panel.outcome.content = ""
        self._motion += 1
        return self._motion

    def _play(self, frames: list[Frame], motion: int) -> None:
        """Shows frame after frame, as long as no other motion has begun and nothing else was chosen."""
        for frame in frames:
            with self._lock:
                if motion != self._motion:
                    return
                self.stage.show_frame(frame)
            time.sleep(1 / FRAMES_PER_SECOND)


def _select(dropdown: viser.GuiDropdownHandle[str], option: str) -> None:
    """Chooses as if a user did."""
    dropdown.value = option  # type: ignore[misc]  # mypy does not see viser's setter
