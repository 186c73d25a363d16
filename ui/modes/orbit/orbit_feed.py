"""Orbit's picture: the worker draws it, the window shows it; when idle Placement's fades in over it.

take: OrbitPicture ─► canvas;  all other events ─► PlacementFeed, which draws as soon as it has a part draw: the one or
the other, or for a quarter of a second both ─► display texture

Where there is a graphics card, moving pictures are drawn here, of parts that the worker exports (`ui.gl.context`);
where that fails, the worker draws them from then on.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Mapping
from typing import Protocol

import moderngl

from app.editor.editor import Editor
from app.messages.picture_events import PictureEvent, SceneFrame
from app.modes.orbit.orbit_controller import OrbitController
from app.modes.orbit.orbit_events import OrbitPartArrived, OrbitPicture
from ui.gl.context import GraphicsError, shader_bytes
from ui.gl.display import BLACK, DisplayView, ShownPicture
from ui.gl.view_transform import ToneView
from ui.modes.orbit.gl.canvas import PictureCanvas
from ui.modes.orbit.gl.shaded_picture import ShadedPicture
from ui.modes.placement.placement_feed import PlacementFeed, exposed_background, inspection, stops
from ui.picture_feed import PictureSource, ViewportStill, viewport_still

FADE_SECONDS = 0.25


class MovingRenderer(Protocol):
    """Draws moving pictures on a graphics card."""

    def warm_up(self) -> Iterator[None]:
        """Compile all shaders, one a step; raises GraphicsError."""

    def forget(self) -> None:
        """Free the memory of a scene: another was opened."""

    def release(self) -> None: ...


class OrbitFeed(PictureSource):
    """Feeds a canvas, and Placement's renderer beside it."""

    def __init__(self, context: moderngl.Context) -> None:
        self._context = context
        self.placement = PlacementFeed(context)
        self.canvas = PictureCanvas(context)
        self.shaded: MovingRenderer | None = None
        self._warm_up: Iterator[None] | None = None
        self._is_chosen = False
        self._shaded_of: object = None
        self._n_parts = 0
        self._opening = 0
        self._scene: object = None
        self._names: list[str] = []
        self._view = ToneView()
        self._texture: moderngl.Texture | None = None
        self._compared: object = None
        self._placement_since = math.inf
        self._drawn: object = None
        self._is_measure = self._are_caught = self._compares_caught = False

    @property
    def picture(self) -> moderngl.Texture | None:
        return self._texture

    def warm_up(self) -> Iterator[None]:
        return self.placement.warm_up()

    def take(self, editor: Editor, event: PictureEvent) -> None:
        if isinstance(event, OrbitPartArrived):
            self._take_part(editor, event)
            return
        if isinstance(event, OrbitPicture):
            self.canvas.set_picture(event.radiance)
            self._is_measure, self._drawn, self._shaded_of = event.is_measure, None, None
            self._are_caught = event.are_caught
            return
        if isinstance(event, SceneFrame):
            self._take_scene(event)
        self.placement.take(editor, event)

    def _take_scene(self, event: SceneFrame) -> None:
        """Take another scene, or another view of it: then what is shown stays until there is another picture."""
        scene = event.source, event.description.objects
        if scene != self._scene:
            self.canvas.clear()
        if event.opening != self._opening and self.shaded is not None:
            self.shaded.forget()
        self._opening = event.opening
        self.canvas.set_frame(event.frame)
        self._scene, self._names = scene, [described.name for described in event.description.objects]
        self._compared, self._drawn = None, None

    def draw(self, editor: Editor, last_frame_ms: float, all_taken: bool) -> bool:
        controller = _controller(editor)
        busy = self._prepare_shaders(editor, controller)
        self._draw_shaded(editor, controller)
        # Before there is a first picture, Placement's feed shows objects lit from the camera.
        is_first = self.canvas.is_empty
        busy |= (controller.is_placement_active or is_first) and self.placement.draw(editor, last_frame_ms, all_taken)
        share = 1.0 if is_first else self._share_of_placement(controller)
        if share < 1.0:  # what Placement's feed says is of its own picture
            editor.catchers.drawn(self._are_caught)
        self._follow_comparison(editor, share)
        if share == 1.0:
            self._texture = self.placement.picture
            self._drawn = None
        else:
            self._draw_canvas(editor, controller, share)
        is_fading = share < 1.0 and (share > 0.0 or controller.shows_placement)  # in its first frame the share is 0
        return busy or is_fading or self._view.waits

    def _prepare_shaders(self, editor: Editor, controller: OrbitController) -> bool:
        """Where moving pictures are to be drawn here: compile a shader, and after the last notify the controller;
        returns whether there are more."""
        if self._is_chosen:
            return False
        try:
            if self._warm_up is None:
                if not shader_bytes(self._context):
                    self._is_chosen = True
                    return False
                self.shaded = self._new_shaded()
                self._warm_up = self.shaded.warm_up()
            if next(self._warm_up, self) is self:
                self._is_chosen = True
                controller.draw_in_window(shader_bytes(self._context))
        except (GraphicsError, moderngl.Error) as error:
            self._disable_shaders(editor, error)
        return not self._is_chosen

    def _new_shaded(self) -> MovingRenderer:
        return ShadedPicture(self._context)

    def _take_part(self, editor: Editor, event: OrbitPartArrived) -> None:
        if isinstance(self.shaded, ShadedPicture):
            self._n_parts += 1
            try:
                self.shaded.buffers.take(event.part)
            except (GraphicsError, moderngl.Error) as error:
                self._disable_shaders(editor, error)

    def _draw_shaded(self, editor: Editor, controller: OrbitController) -> None:
        """Draw the moving picture, where it is drawn here and would differ."""
        wanted, shaded = controller.drawn_in_window, self.shaded
        if not isinstance(shaded, ShadedPicture) or wanted is None or not shaded.buffers.is_ready:
            return
        if (wanted, self._n_parts) == self._shaded_of:
            return
        try:
            self.canvas.show(shaded.draw(*wanted))
            controller.record_draw_seconds(shaded.seconds)
        except (GraphicsError, moderngl.Error) as error:
            self._disable_shaders(editor, error)
        self._shaded_of, self._drawn, self._is_measure = (wanted, self._n_parts), None, False
        self._are_caught = False

    def _disable_shaders(self, editor: Editor, error: Exception) -> None:
        """Let the worker draw from now on."""
        self.canvas.show(None)
        if self.shaded is not None:
            self.shaded.release()
        self.shaded, self._is_chosen = None, True
        _controller(editor).draw_in_window(0)
        editor.notify(f"{_controller(editor).title} is drawn by the processor: {error}", True)

    def _share_of_placement(self, controller: OrbitController) -> float:
        """The opacity of Placement's picture, 0 to 1."""
        now = time.monotonic()
        if not controller.shows_placement:
            self._placement_since = math.inf
            return 0.0
        self._placement_since = min(self._placement_since, now)
        return min((now - self._placement_since) / FADE_SECONDS, 1.0)

    def _draw_canvas(self, editor: Editor, controller: OrbitController, share: float) -> None:
        """Draw, where the picture would differ from the one drawn last."""
        view = self._display_view(editor, controller)
        if (view, share) != self._drawn:
            other = self.placement.renderer.linear_texture if share > 0.0 else None
            self._texture = self.canvas.draw(view, other, share)
            self._drawn = view, share

    def _follow_comparison(self, editor: Editor, share: float) -> None:
        compared = editor.view.compare
        # The picture that is remembered may have shadows in place of catchers, which those beside it show as objects.
        is_outdated = self._compares_caught and not self._are_caught and share == 0.0 and compared is editor.document
        if compared is self._compared and not is_outdated:
            return
        self._compares_caught = compared is not None and self._are_caught and share < 1.0
        if compared is None:
            self.canvas.drop_snapshot()
        else:
            self.canvas.take_snapshot(self.placement.renderer.linear_texture if share > 0.0 else None)
        self._compared, self._drawn = compared, None

    def _display_view(self, editor: Editor, controller: OrbitController) -> DisplayView:
        """Outlines and the divider belong to the view that was traced last; over a picture from another camera, which
        is shown until the next has been drawn, they would be beside their objects."""
        view, compared = editor.view, editor.view.compare
        rests = not controller.is_away and controller.shows_viewpoint
        tone_mapping = self._view.follow(view.tone_mapping, editor.colours)
        return DisplayView(
            exposure=0.0 if self._is_measure else view.exposure + stops(editor.document.light),
            compare_exposure=None if compared is None else view.exposure + stops(compared.light),
            tone_mapping="false_colour" if self._is_measure else tone_mapping,
            selected=self._index(view.selected.object if view.selected and rests else None),
            others=tuple(self._names.index(name) for name in view.others if name in self._names and rests),
            hovered=self._index(view.hovered if rests else None),
            compare_divider=view.compare_divider if compared is not None and rests else None,
            behind=exposed_background(editor.document.background, view.exposure),
            compare_behind=BLACK if compared is None else exposed_background(compared.background, view.exposure),
            **inspection(view),
        )

    def _index(self, name: str | None) -> int | None:
        return self._names.index(name) if name in self._names else None

    def still(self, editor: Editor) -> ViewportStill | None:
        controller, frame = _controller(editor), self.canvas.frame
        if controller.shows_placement:
            return self.placement.still(editor)
        if frame is None or self._texture is None:
            return None
        intensity, background = editor.document.light.intensity, editor.document.background
        shown = self.canvas.finished_image(self._display_view(editor, controller))
        return viewport_still(shown, self.canvas.linear_image_with_alpha(), intensity, background)

    def shown(self, editor: Editor) -> ShownPicture | None:
        controller = _controller(editor)
        if controller.shows_placement:
            return self.placement.shown(editor)
        if self.canvas.frame is None or self._texture is None or self._is_measure:
            return None
        return ShownPicture(*self.canvas.shown, self._display_view(editor, controller), editor.document.light.intensity)

    def map_thumbnails(self, key: str) -> Mapping[str, moderngl.Texture]:
        return self.placement.map_thumbnails(key)

    def map_refusal(self, editor: Editor, key: str) -> str | None:
        return self.placement.map_refusal(editor, key)

    def close(self) -> None:
        self.placement.close()
        self.canvas.release()
        if self.shaded is not None:
            self.shaded.release()


def _controller(editor: Editor) -> OrbitController:
    """The controller of the picture's mode."""
    assert isinstance(editor.controller, OrbitController)
    return editor.controller
