"""Updates the picture of any mode: the worker's responses to its source, and a drawing of it.

    take: editor.tick ─► picture events ─► the mode's PictureSource; scene and sky also ─► SceneView
    draw: document, view ─► PictureSource.draw ─► display texture

`draw` is part of a frame during input, else a step before it; `take` runs between two frames, so that input is
processed in the meantime. Everything slow is sliced: responses are processed for a few milliseconds and the rest the
next time. Before there is a scene `take` warms up, after which no shader is left to compile and no mode to import. When
another mode is chosen, or the camera moves, the picture before stays until there is something to show.

A still is the picture on screen, without the window's interface.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import chain
from typing import Protocol

import moderngl
import numpy as np
from numpy.typing import NDArray

from app.document.background import Background
from app.editor.editor import Editor
from app.messages.picture_events import PictureEvent, SceneFrame, SkyChanged
from app.modes.mode import Mode
from app.modes.registry import MODES
from app.system.lazy_import import import_named
from engine.render.crop import Crop, cropped
from engine.render.display import deep_png, exr_bytes, pixels_png
from engine.render.scopes import Scopes
from engine.scene.description import Camera
from engine.scene.picture_frame import PictureFrame
from engine.scene.surface_spot import SurfaceSpot
from ui.gl.context import GraphicsError
from ui.gl.display import ShownPicture
from ui.gl.gpu_memory import TextureMemory
from ui.picture_readings import PictureReadings
from ui.pixel_values import PixelValues
from ui.scene_view import SceneView
from ui.surface_lobe import SurfacePoint

# The time between two checks for responses, while a selected curve is waited for.
CURVE_POLL_SECONDS = 0.005
# After so long no further response is processed at once.
TAKING_SECONDS = 0.008


class PictureSource(Protocol):
    """A mode's picture in GL. The defaults do nothing."""

    def __init__(self, context: moderngl.Context) -> None: ...

    @property
    def picture(self) -> moderngl.Texture | None:
        """The display picture, row 0 at the top; None before there is a scene."""

    def warm_up(self) -> Iterator[None]:
        """Compile, step by step, what pictures will be drawn with."""
        return iter(())

    def take(self, editor: Editor, event: PictureEvent) -> None:
        """Take a part of the picture; a `SceneFrame` makes all before it void."""

    def prepare(self, event: SceneFrame) -> bool:
        """Do a part of the work for this scene, short compared with a frame; returns whether there is another part."""
        return False

    def draw(self, editor: Editor, last_frame_ms: float, all_taken: bool) -> bool:
        """Follow the document and draw. Returns whether another frame would show more.

        `last_frame_ms` is the time of the whole last frame; all_taken: whether no event waits to be taken.
        """

    def still(self, editor: Editor) -> ViewportStill | None:
        """The picture as it is now, for a file; None before there is one."""
        return None

    def shown(self, editor: Editor) -> ShownPicture | None:
        """What is on screen, to be measured; None where there is nothing."""
        return None

    def shows_document(self, editor: Editor) -> bool:
        """Whether the last frame showed the document as it is now, and nothing is left to be added to it."""
        return False

    def map_thumbnails(self, key: str) -> Mapping[str, moderngl.Texture]:
        """The "texture" and the "weight" of a layer, small, row 0 at the top, where there are any."""
        return {}

    def map_refusal(self, editor: Editor, key: str) -> str | None:
        """Why the images of a layer cannot be used, in one line."""
        return None

    def close(self) -> None:
        """Free GL objects."""


def _made_of(editor: Editor) -> tuple[object, ...]:
    """The state that a picture depends on besides its mode; it may stay while that is equal."""
    return editor.document, replace(
        editor.view, mode="", hovered=None, fit=True, zoom=1.0, centre=(0.5, 0.5), crop=None, probes=()
    )


class CopiedPicture:
    """A copy of a display picture. Raises GraphicsError where there is no room for it."""

    def __init__(self, context: moderngl.Context, picture: moderngl.Texture) -> None:
        self._memory = TextureMemory(context)
        self._picture = self._memory.copied(picture)

    @property
    def picture(self) -> moderngl.Texture:
        return self._picture

    @property
    def n_bytes(self) -> int:
        return self._memory.bytes_in_use

    def close(self) -> None:
        """Free the copy."""
        self._memory.release(self._picture)


class PictureFeed:
    """Feeds the source of the mode that is chosen; source: that of `mode`, where it exists already."""

    def __init__(self, context: moderngl.Context, mode: Mode, source: PictureSource | None = None) -> None:
        self._context = context
        self._scene = SceneView(context)
        self._waiting: deque[PictureEvent] = deque()
        self._frame_ms = 0.0
        self._stepped = False
        self._took = False
        self._shown_scene: SceneFrame | None = None
        self._left: PictureSource | CopiedPicture | None = None
        self._left_scene: SceneFrame | None = None
        self._left_mode: Mode | None = None
        self._left_of: object = None  # what the picture of the mode before was made of, where it was finished
        self._finished_of: object = None
        self._took_scene = False  # whether the source has the scene
        self._readings = PictureReadings()
        self.stamp = 0  # rises with each frame in which the picture may have changed
        self._drawn_of: object = None
        self._is_plain = False  # whether objects lit from the camera are shown, and no mode's picture
        self._choose(mode, source or import_named(mode.picture)(context))

    def _choose(self, mode: Mode, source: PictureSource) -> None:
        self._mode, self.source, self._took_scene = mode, source, False
        self._warm_up = chain(source.warm_up(), _importing())

    @property
    def picture(self) -> moderngl.Texture | None:
        """The display picture, row 0 at the top; None before there is a scene."""
        return self.source.picture if self._left is None else self._left.picture

    @property
    def environment(self) -> moderngl.Texture | None:
        """The environment's thumbnail, row 0 at the top."""
        return self._scene.environment

    @property
    def has_environment(self) -> bool:
        """Whether the scene's own file has an environment."""
        return self._scene.has_environment

    @property
    def heading(self) -> float:
        """The camera's direction, degrees clockwise from -Z seen from above."""
        return self._scene.heading

    @property
    def shows_view_before(self) -> bool:
        """Whether the picture is of the view before, because this one has none yet."""
        return self._left is not None and self._left_scene is not self._shown_scene

    @property
    def camera(self) -> Camera | None:
        """The camera of the shown picture; None before there is a scene."""
        scene = self._left_scene if self.shows_view_before else self._shown_scene
        return None if scene is None else scene.description.camera

    @property
    def mode_before(self) -> Mode | None:
        """The mode whose picture stays until the present one has its own; None where it has."""
        return self._left_mode if self._left is not None and not self.shows_view_before else None

    @property
    def is_behind(self) -> bool:
        """Whether a response of the worker is not in the picture yet."""
        return bool(self._waiting)

    @property
    def is_finished(self) -> bool:
        """Whether the last frame showed a finished picture, with nothing of the one before fading out."""
        return self._finished_of is not None

    @property
    def frame(self) -> PictureFrame | None:
        """What each pixel of the picture sees; None before there is a scene."""
        return self._scene.frame

    def object_at(self, column: int, row: int) -> str | None:
        """The name of the object that a pixel of the picture sees."""
        return self._scene.object_at(column, row)

    def objects_in(self, left: float, top: float, right: float, bottom: float) -> tuple[str, ...]:
        """The names of the objects that are seen in a rectangle, pixels of the picture."""
        return self._scene.objects_in(left, top, right, bottom)

    def surface_at(self, column: int, row: int) -> SurfacePoint | None:
        """The surface that a pixel of the picture sees; None for emitters and the background."""
        return self._scene.surface_at(column, row)

    def spot_at(self, column: int, row: int) -> SurfaceSpot | None:
        """The point that a pixel of the picture sees; None for emitters and the background."""
        return self._scene.spot_at(column, row)

    def shown(self, editor: Editor) -> ShownPicture | None:
        """What is on screen, to be measured; None while it is not the mode's own picture."""
        if self.source is None or self.shows_view_before or self.mode_before is not None:
            return None
        return self.source.shown(editor)

    def shows_document(self, editor: Editor) -> bool:
        """Whether the last frame showed the document as it is now in the mode's own picture, and all of it."""
        if self.source is None or self.shows_view_before or self.mode_before is not None:
            return False
        return self.source.shows_document(editor)

    def values_at(self, editor: Editor, column: int, row: int, side: int = 1) -> PixelValues | None:
        """The values of a pixel of the mode's own picture, or the mean of a square about it; None while another one
        stays on screen."""
        picture = self.shown(editor)
        return None if picture is None else self._readings.values(self._known_stamp, picture, column, row, side)

    def scopes(self, editor: Editor, crop: Crop | None) -> Scopes | None:
        """The scopes of the mode's own picture, or of a part of it; None while another one stays on screen."""
        picture = self.shown(editor)
        return None if picture is None else self._readings.scopes(self._known_stamp, picture, crop)

    @property
    def _known_stamp(self) -> int | None:
        """The stamp of what is on screen; None where that has changed since the last frame."""
        return None if self._took else self.stamp

    def take(self, editor: Editor, now: float) -> bool:
        """Process the worker's responses and request what is missing. Returns whether there is something to draw."""
        until = time.perf_counter() + TAKING_SECONDS
        scene_came = False
        for event in editor.tick(now):
            if isinstance(event, SceneFrame):  # what was before it is void
                self._waiting.clear()
                scene_came = True
            self._waiting.append(event)
        if editor.mode is not self._mode:
            if self._left is None and self.source.picture is not None:
                self._left, self._left_scene = self.source, self._shown_scene
                self._left_mode = None if self._is_plain else self._mode
                self._left_of = self._finished_of
            else:
                self.source.close()
            self._choose(editor.mode, import_named(editor.mode.picture)(self._context))
        self._took = self._took or bool(self._waiting)
        try:
            if self._scene_waits:
                # The first scene; with a later one the panels would draw a picture that is gone: `draw` takes it.
                if (
                    not (scene_came and time.perf_counter() >= until)
                    and self._prepare_scene(until)
                    and not self.picture
                ):
                    self._take(editor, self._waiting.popleft())
            elif self._waiting:
                self._take_waiting(editor, until)
            elif not self._scene.is_there:
                next(self._warm_up, None)
        except GraphicsError as error:
            editor.notify(str(error), True)
        return self._took or self._scene.thumbnail_is_ready

    def draw(self, editor: Editor, last_frame_ms: float) -> bool:
        """Follow the document and draw. Returns whether another frame would show more.

        `last_frame_ms` is the time of the whole last frame: what it spent on other work is not part of the budget.
        """
        if self._stepped:
            self._frame_ms = last_frame_ms
        took, self._took = self._took, False
        try:
            if self._scene_waits:
                if self.picture is None:
                    return True
                self._take(editor, self._waiting.popleft())
            if not self._scene.is_there:
                return took
            thumbnail_came = self._scene.follow()
            editor.metrics.frame_ms = self._frame_ms
            busy = self.source.draw(editor, last_frame_ms, not self._waiting) or thumbnail_came
            status = editor.status
            made_of = _made_of(editor)
            if busy or took or self._stepped or made_of != self._drawn_of:
                self.stamp += 1
            self._drawn_of = made_of
            is_better = self.mode_before is not None and self._left_of == made_of
            if is_better and not status.stopped:
                # "Finished" of a mode whose source has yet to take its scene and layers is that of the source before.
                may_leave = status.is_finished and not busy and self._took_scene and not self._waiting
            else:
                stopped = self.shows_view_before and status.stopped
                may_leave = status.picture != "waiting" or status.follows_input or stopped
            if may_leave:
                self._leave()
            self._finished_of = made_of if status.is_finished and not busy else None
            self._is_plain = status.picture == "waiting" and self._left is None
        except GraphicsError as error:
            editor.notify(str(error), True)
            return False
        self._stepped = busy or took
        return busy

    def still(self, editor: Editor) -> ViewportStill | None:
        """The picture as it is now, for a file; None before there is one. Waits for the GPU."""
        return self.source.still(editor)

    def map_thumbnails(self, key: str) -> Mapping[str, moderngl.Texture]:
        """The "texture" and the "weight" of a layer, small, row 0 at the top, where there are any."""
        return self.source.map_thumbnails(key)

    def map_refusal(self, editor: Editor, key: str) -> str | None:
        """Why the images of a layer cannot be used, in one line."""
        return self.source.map_refusal(editor, key)

    def close(self) -> None:
        """Free GL objects and let the loading thread end."""
        self._leave()
        self._scene.close()
        self.source.close()

    def _leave(self) -> None:
        """Drop the copy of what was shown before."""
        if self._left is not None:
            self._left.close()
        if self.shows_view_before and self._shown_scene is not None:
            self._scene.take_scene(self._shown_scene)
        self._left = None

    def _keep_view_before(self, event: SceneFrame) -> None:
        """Copy what is shown, if only the view of the same scene changes; another scene removes it."""
        before = self._shown_scene
        if before is None or before.opening != event.opening:
            self._leave()
        elif self._left is None and self.source.picture is not None:
            try:
                self._left, self._left_scene = CopiedPicture(self._context, self.source.picture), before
                self._left_mode = self._mode
            except GraphicsError:
                pass  # objects are lit from the camera meanwhile

    @property
    def _scene_waits(self) -> bool:
        """Whether a scene is the next event to be taken; nothing comes before one."""
        return bool(self._waiting) and isinstance(self._waiting[0], SceneFrame)

    def _prepare_scene(self, until: float) -> bool:
        """Continue the work for the scene that waits, until that time; returns whether all of it is done."""
        scene = self._waiting[0]
        assert isinstance(scene, SceneFrame)
        try:
            while self.source.prepare(scene):
                if time.perf_counter() >= until:
                    return False
        except GraphicsError:
            self._waiting.popleft()
            raise
        return True

    def _take_waiting(self, editor: Editor, until: float) -> None:
        """Take waiting events until that time, at least one with all that must be shown together with it."""
        while self._waiting:
            event = self._waiting.popleft()
            self._take(editor, event)
            if time.perf_counter() >= until and not event.with_next:
                return

    def _take(self, editor: Editor, event: PictureEvent) -> None:
        if isinstance(event, SceneFrame) and event is not self._shown_scene:  # else announced again, to another mode
            self._keep_view_before(event)
        self.source.take(editor, event)
        if isinstance(event, SceneFrame):
            self._shown_scene, self._took_scene = event, True
            if not self.shows_view_before:
                self._scene.take_scene(event)
        elif isinstance(event, SkyChanged):
            self._scene.take_sky(event.radiance)


def _importing() -> Iterator[None]:
    """Import what modes draw with, one at a time: the first frame after another is chosen would wait 20 ms for that."""
    for mode in MODES:
        for name in filter(None, (mode.controller, mode.picture, mode.accuracy, mode.tools, mode.strip, mode.handles)):
            import_named(name)
            yield


@dataclass(frozen=True)
class ViewportStill:
    """One picture at the scene's resolution.

    shown: (H,W,3) in the screen's values, sRGB; radiance: (H,W,3) linear, including the light's intensity, without
    exposure and tone mapping. Over a transparent background both have alpha (H,W,4), which is multiplied into the
    radiance alone, as PNG and EXR expect it.
    """

    shown: NDArray[np.float32]
    radiance: NDArray[np.float32]

    def encoded(self, ending: str, deep: bool, crop: Crop | None = None) -> bytes:
        """The bytes of a file: ".exr" linear, 32 bits; ".png" as shown, 8 bits or `deep` 16. crop: only that part,
        which keeps its place in an .exr."""
        if ending == ".exr":
            return exr_bytes(np.nan_to_num(self.radiance, posinf=0.0, neginf=0.0), crop=crop)  # black, as on screen
        shown = cropped(self.shown, crop)
        return deep_png(shown) if deep else pixels_png(np.round(255.0 * shown).astype(np.uint8))


def viewport_still(
    shown: NDArray[np.float32], linear: NDArray[np.float32], intensity: float, background: Background
) -> ViewportStill:
    """The still of a picture as it is shown, and linear with alpha (H, W, 4) without the light's intensity."""
    if background.hides_environment:
        light = linear[..., :3] * np.float32(intensity)
        return ViewportStill(shown, background.behind(np.concatenate([light, linear[..., 3:]], axis=2)))
    return ViewportStill(shown, linear[..., :3] * np.float32(intensity))
