"""Brings the picture up to date: the worker's answers to the renderer, the document's curves after them.

    take: editor.tick ─► picture events ─► renderer (frame, footprint, layers, transport)
    draw: document ─► gains, view curves, visibility, curve coefficients ─► renderer.update ─► display texture
          renderer's report ─► PlacementTalk.rendered

`draw` is part of a frame where the hand does something, else a step before it; `take` comes between two frames: so the
hand is heard in the meantime. Everything slow is sliced: answers are taken for a few milliseconds and the rest the next
time, an upload under way takes part of the frame's time, coefficients what is left. Before there is a scene `take`
rehearses, after which no shader is left to compile.
"""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from app.document import RGB, LightState, layer_key
from app.editor import Editor
from app.light_commands import emission_of
from app.picture import PictureEvent, SceneFrame, SkyChanged
from app.placement.events import (
    ComparedRefined,
    Footprint,
    IndirectRadiance,
    LayerLook,
    LayerMapsChanged,
    LayerRadiance,
    TransportReady,
)
from app.placement.status import RenderReport
from app.placement.talk import PlacementTalk
from app.solo import is_seen
from engine.curve.wavelet import forward
from engine.light.environment import Environment, tone_mapped_thumbnail
from engine.scene.description import SceneDescription
from ui.brush import Spot, spot_of
from ui.gl.context import GraphicsError
from ui.gl.picture_frame import PictureFrame
from ui.gl.placement.layers import Look
from ui.gl.placement.rehearsal import rehearse
from ui.gl.placement.renderer import PlacementRenderer
from ui.gl.tonemap import DisplayView
from ui.map_feed import MapFeed, small_texture
from ui.shown_view import ShownView
from ui.still import Still
from ui.surface_lobe import SurfacePoint

# Between two looks at what the worker has sent, while a curve that was selected is waited for.
CURVE_LOOK_SECONDS = 0.005
# After so long no further answer is taken at once.
TAKING_SECONDS = 0.008
UPLOAD_SHARE = 0.5
# Of the frame's time, what refinement gets however long the rest takes.
LEAST_SHARE = 0.25
LEAST_INTENSITY = 1e-30
THUMBNAIL_WIDTH = 512


class PictureFeed:
    """Feeds one `PlacementRenderer`."""

    def __init__(self, renderer: PlacementRenderer) -> None:
        self.renderer = renderer
        self._waiting: deque[PictureEvent] = deque()
        self._rehearsal: Iterator[None] = rehearse(renderer)
        self._threads = ThreadPoolExecutor(1, thread_name_prefix="thumbnail")
        self._thumbnail_due: Future[NDArray[np.uint8]] | None = None
        self._description: SceneDescription | None = None
        self._names: list[str] = []
        self._arrays: Mapping[str, NDArray[Any]] = {}
        self._view_curves: dict[str, NDArray[np.float64]] = {}
        self._indirect: dict[str, IndirectRadiance] = {}
        self._drawn_as: dict[str, tuple[object, ...]] = {}
        self._holds = False
        self._emission: dict[str, RGB] = {}
        self._maps = MapFeed(renderer)
        self._view = ShownView()
        self._wanted: dict[str, NDArray[np.float64]] = {}
        self._compared: object = None
        self._rotation: float | None = None
        self._texture: moderngl.Texture | None = None
        self._thumbnail: moderngl.Texture | None = None
        self._exact_before = False
        self._frame_ms = 0.0
        self._spent_ms = 0.0
        self._stepped = False
        self._took = False

    @property
    def picture(self) -> moderngl.Texture | None:
        """The display picture, row 0 at the top; None before there is a scene."""
        return self._texture

    @property
    def is_behind(self) -> bool:
        """Whether something of what the worker answered is not in the picture yet."""
        return bool(self._waiting)

    @property
    def environment(self) -> moderngl.Texture | None:
        """The environment's thumbnail, row 0 at the top."""
        return self._thumbnail

    def map_thumbnails(self, key: str) -> Mapping[str, moderngl.Texture]:
        """The "texture" and the "weight" of a layer, small, row 0 at the top; those there are."""
        return self._maps.thumbnails(key)

    def map_refusal(self, editor: Editor, key: str) -> str | None:
        """Why the images of a layer cannot be used, in one line."""
        return _talk(editor).maps.refusal(key, editor.document.layer(key).maps)

    @property
    def heading(self) -> float:
        """Where the camera looks, degrees clockwise from -Z seen from above."""
        if self._description is None:
            return 0.0
        camera = self._description.camera
        x, _, z = (t - p for t, p in zip(camera.target, camera.position, strict=True))
        return math.degrees(math.atan2(x, -z))

    def object_at(self, column: int, row: int) -> str | None:
        """The name of what a pixel of the picture sees."""
        if self.renderer.frame is None:
            return None
        index = self.renderer.object_at(column, row)
        return self._names[index] if 0 <= index < len(self._names) else None

    def surface_at(self, column: int, row: int) -> SurfacePoint | None:
        """The surface that a pixel of the picture sees; None for emitters and the background."""
        arrays, description = self._arrays, self._description
        place = self._sample_at(column, row)
        if description is None or place is None or "normal" not in arrays:
            return None
        height, width = arrays["object_image"].shape
        normal, tangent = (arrays[name][place].astype(np.float64) for name in ("normal", "tangent"))
        normal /= np.linalg.norm(normal)
        across = np.cross(normal, tangent)
        across /= np.linalg.norm(across)
        frame = np.stack([np.cross(across, normal), across, normal])
        ray = arrays["ray_directions"][row, column].astype(np.float64)
        return SurfacePoint(column, row, frame, ray, description.camera, (width, height))

    def spot_at(self, column: int, row: int) -> Spot | None:
        """The point that a pixel of the picture sees; None for emitters and the background."""
        arrays, description = self._arrays, self._description
        sample = self._sample_at(column, row)
        if description is None or sample is None or "distance" not in arrays:
            return None
        return spot_of(arrays, description.camera, column, row, sample)

    def _sample_at(self, column: int, row: int) -> int | None:
        """The primary hit of a pixel."""
        arrays = self._arrays
        if self._description is None:
            return None
        height, width = arrays["object_image"].shape
        if not (0 <= column < width and 0 <= row < height) or arrays["object_image"][row, column] < 0:
            return None
        start, stop = arrays["object_ranges"][int(arrays["object_image"][row, column])]
        place = int(start) + int(np.searchsorted(arrays["pixel"][start:stop], row * width + column))
        return place if place < stop and arrays["pixel"][place] == row * width + column else None

    def still(self, editor: Editor) -> Still | None:
        """The picture as it is now, for a file; None before there is one. Waits for the GPU."""
        frame = self.renderer.frame
        if frame is None or self._texture is None:
            return None
        return Still(
            self.renderer.finished_image(self._display_view(editor)),
            self.renderer.linear_image() * np.float32(editor.document.light.intensity),
            (frame.edge_pixels, frame.edge_neighbours, frame.edge_weights),
        )

    def take(self, editor: Editor, now: float) -> bool:
        """Take the worker's answers and ask it for what is missing. Whether there is something to draw."""
        until = time.perf_counter() + TAKING_SECONDS
        self._maps.release_retired()
        scene_came = False
        for event in editor.tick(now):
            if isinstance(event, SceneFrame):  # what was before it is void
                self._waiting.clear()
                scene_came = True
            self._waiting.append(event)
        self._took = self._took or bool(self._waiting)
        try:
            if self._scene_waits:
                # The first scene; of a later one the panels would draw a picture that is gone: `draw` takes it.
                if self._texture is None and not (scene_came and time.perf_counter() >= until):
                    self._take(editor, self._waiting.popleft())
            elif self._waiting:
                self._take_waiting(editor, until)
            elif self._description is None:
                next(self._rehearsal, None)
        except GraphicsError as error:
            editor.notify(str(error), True)
        return self._took or self._thumbnail_is_ready

    def draw(self, editor: Editor, last_frame_ms: float) -> bool:
        """Follow the document and draw. Whether another frame would show more.

        `last_frame_ms` is what the last frame took in all: what it spent on other things is kept out of the budget.
        """
        if self._stepped:
            self._frame_ms = last_frame_ms
        took, self._took = self._took, False
        try:
            if self._scene_waits:
                if self._texture is None:
                    return True
                self._take(editor, self._waiting.popleft())
            if self._description is None:
                return took
            busy = self._follow(editor, last_frame_ms)
        except GraphicsError as error:
            editor.notify(str(error), True)
            return False
        self._stepped = busy or took
        return busy

    def close(self) -> None:
        """Free GL objects and let the loading thread end."""
        self._threads.shutdown(wait=False, cancel_futures=True)
        if self._thumbnail is not None:
            self._thumbnail.release()
        self._maps.clear()
        self._maps.release_retired()
        self.renderer.release()

    # ------------------------------------------------------------------------------------------ the worker's answers

    @property
    def _scene_waits(self) -> bool:
        """Whether a scene is the next to be taken; nothing comes before one."""
        return bool(self._waiting) and isinstance(self._waiting[0], SceneFrame)

    def _take_waiting(self, editor: Editor, until: float) -> None:
        """Take what waits until that time, one event at least."""
        while self._waiting:
            self._take(editor, self._waiting.popleft())
            if time.perf_counter() >= until:
                return

    def _take(self, editor: Editor, event: PictureEvent) -> None:
        match event:
            case SceneFrame():
                self._take_scene(event)
            case SkyChanged():
                self.renderer.set_environment(event.radiance, editor.document.light.rotation)
                self._take_sky_picture(event.radiance)
            case LayerRadiance():
                self._take_radiance(event)
            case IndirectRadiance():
                self._indirect[event.key] = event
                self._take_indirect(event.key)
            case LayerMapsChanged():
                self._maps.take(event)
            case ComparedRefined():
                if self._compared is not None:
                    self.renderer.snapshot_compare({key: _look(look) for key, look in event.looks.items()})
            case TransportReady():
                numbers, curve = event.coefficients_first, event.factor
                self.renderer.set_footprint(*_both(event.footprint))
                self.renderer.begin_transport(
                    event.key, numbers, event.norms, event.scale, event.beside, curve, event.stage
                )

    def _take_scene(self, event: SceneFrame) -> None:
        self.renderer.set_frame(picture_frame(event))
        self._description = event.description
        self._names = [described.name for described in event.description.objects]
        self._arrays = event.arrays
        self._view_curves.clear()
        self._indirect.clear()
        self._drawn_as.clear()
        self._emission.clear()
        self._maps.clear()
        self._wanted = {}
        self._compared = self._rotation = None

    def _take_radiance(self, event: LayerRadiance) -> None:
        renderer = self.renderer
        renderer.set_footprint(*_both(event.footprint))
        if event.key not in renderer.layer_keys:
            renderer.set_layer(event.key, self._names.index(event.key.rpartition(".")[0]), len(event.radiance))
            self._maps.layer_made(event.key)
        if self._drawn_as.get(event.key) != event.drawn_as:
            self._drawn_as[event.key] = event.drawn_as
            self._take_indirect(event.key)  # it may have been the first to come, or be that of the layer before
        bands = event.coefficients.get(renderer.transport_curve(event.key) or "")
        shown = None if bands is None else forward(bands)
        renderer.set_layer_radiance(event.key, event.radiance, shown, event.stage)

    def _take_indirect(self, key: str) -> None:
        """Show a layer's indirect light, where it is that of the layer whose direct light is shown."""
        event = self._indirect.get(key)
        if event is None or key not in self.renderer.layer_keys:
            return
        if event.footprint is None or event.drawn_as != self._drawn_as[key]:
            self.renderer.set_layer_indirect(key, None)
            return
        self.renderer.set_indirect_footprint(event.footprint.rows, event.footprint.weights)
        self.renderer.set_layer_indirect(key, event.radiance)

    # ---------------------------------------------------------------------------------------------------- each frame

    def _follow(self, editor: Editor, last_frame_ms: float) -> bool:
        """The document as it is now, in the picture. Whether there is more to come."""
        thumbnail_came = self._follow_environment(editor)
        self._follow_emitters(editor)
        self._follow_layers(editor)
        self._follow_curve(editor)
        self._follow_comparison(editor)
        allowed = editor.view.frame_budget_ms
        budget = 1e-3 * max(allowed - (last_frame_ms - self._spent_ms), LEAST_SHARE * allowed)
        started = time.perf_counter()
        arriving = self.renderer.upload_fraction is not None
        uploaded = self.renderer.upload(UPLOAD_SHARE * budget)
        # The last slice makes the transport ready for work, which is enough for a frame; the work begins in the next.
        limit = 0 if arriving and uploaded else None
        report = self.renderer.update(limit, budget if uploaded else (1.0 - UPLOAD_SHARE) * budget)
        self._spent_ms = 1e3 * (time.perf_counter() - started)
        self._texture = self.renderer.composite(self._display_view(editor))
        wanted = max(map(len, self._wanted.values()), default=0)
        exact = uploaded and report.exact and not self._waiting
        _talk(editor).rendered(
            RenderReport(
                max(wanted - report.remaining, 0), wanted, report.image_error, self._frame_ms,
                exact and not self._holds,
                self.renderer.transport_precision, self.renderer.memory_bytes / 1e6, self.renderer.mean_radiance,
            )
        )  # fmt: skip
        changed = exact != self._exact_before
        self._exact_before = exact
        return not exact or changed or thumbnail_came or self._view.waits

    def _follow_environment(self, editor: Editor) -> bool:
        """Turn the background with the light; whether the thumbnail is a new one."""
        rotation = editor.document.light.rotation
        if rotation != self._rotation:
            self.renderer.turn_environment(rotation)
            self._rotation = rotation
        if self._thumbnail_due is None or not self._thumbnail_is_ready:
            return False
        self._show_thumbnail(self._thumbnail_due.result())
        self._thumbnail_due = None
        return True

    def _follow_emitters(self, editor: Editor) -> None:
        """What is seen of them."""
        for name, radiance in emission_of(editor.document):
            if name in self._names and self._emission.get(name) != radiance:
                self._emission[name] = radiance
                self.renderer.set_emission(self._names.index(name), radiance)

    @property
    def _thumbnail_is_ready(self) -> bool:
        return self._thumbnail_due is not None and self._thumbnail_due.done()

    def _take_sky_picture(self, radiance: NDArray[np.floating]) -> None:
        """Make the panel's picture of the sky, in a thread; of no light at all there is none."""
        self._thumbnail_due = self._threads.submit(_thumbnail, radiance) if np.any(radiance) else None
        if self._thumbnail_due is None and self._thumbnail is not None:
            self._thumbnail.release()
            self._thumbnail = None

    def _show_thumbnail(self, pixels: NDArray[np.uint8]) -> None:
        if self._thumbnail is not None:
            self._thumbnail.release()
        self._thumbnail = small_texture(self.renderer.context, pixels)

    def _follow_layers(self, editor: Editor) -> None:
        """Gains, view curves and visibility; each setter of the renderer is free where nothing changed."""
        document, gone = editor.document, set(self.renderer.layer_keys)
        for state in document.objects:
            for index in range(len(state.layers)):
                key = layer_key(state.name, index)
                if key not in gone:
                    continue
                gone.remove(key)
                self.renderer.set_layer_visible(key, is_seen(document, editor.view, key))
                if not self._is_drawn(editor, key):
                    continue
                self.renderer.set_layer_gain(key, _talk(editor).layer_gain(key).tolist())
                self._maps.follow(key, state.layers[index].maps)
                curve = _talk(editor).view_curve(key)
                if self._view_curves.get(key) is not curve:
                    self._view_curves[key] = curve
                    self.renderer.set_view_curve(key, curve)
        for key in gone:  # it may come back, by undo, before the worker has heard of it
            self.renderer.set_layer_visible(key, False)

    def _is_drawn(self, editor: Editor, key: str) -> bool:
        """Whether the picture of a layer is its own, and not that of the one that it took the place of."""
        return self._drawn_as.get(key) == _talk(editor).drawn_as(key)

    def _follow_curve(self, editor: Editor) -> None:
        """The selected curve, in all layers that follow it and have a picture of their own."""
        self._holds = False
        factor = (editor.view.selected and editor.view.selected.factor) or ""
        found: dict[str, NDArray[np.float64]] = {}
        for key in _talk(editor).edited_layers:
            coefficients = _talk(editor).wanted_coefficients(key).get(factor)
            if coefficients is not None and key in self.renderer.layer_keys:
                if not self._is_drawn(editor, key):
                    self._holds = True
                    continue
                found[key] = coefficients
                if self._wanted.get(key) is not coefficients:
                    self.renderer.wanted(key, forward(coefficients), factor)
        self._wanted = found

    def _follow_comparison(self, editor: Editor) -> None:
        compared = editor.view.compare
        if compared is self._compared:
            return
        if compared is None:
            self.renderer.drop_compare()
        else:
            self.renderer.snapshot_compare()
        self._compared = compared

    def _display_view(self, editor: Editor) -> DisplayView:
        """Exposure takes the light's intensity along: it multiplies the finished picture."""
        view, compared = editor.view, editor.view.compare
        return DisplayView(
            exposure=view.exposure + _stops(editor.document.light),
            compare_exposure=None if compared is None else view.exposure + _stops(compared.light),
            tone_mapping=self._view.follow(view.tone_mapping),
            selected=self._index(view.selected.object if view.selected else None),
            hovered=self._index(view.hovered),
            compare_divider=view.compare_divider if view.compare is not None else None,
        )

    def _index(self, name: str | None) -> int | None:
        return self._names.index(name) if name in self._names else None


def _talk(editor: Editor) -> PlacementTalk:
    """Whose picture it is."""
    assert isinstance(editor.talk, PlacementTalk)
    return editor.talk


def _both(footprint: Footprint | None) -> tuple[NDArray[np.integer] | None, NDArray[np.floating] | None]:
    return (None, None) if footprint is None else (footprint.rows, footprint.weights)


def _stops(light: LightState) -> float:
    """The light's intensity as exposure."""
    return math.log2(max(light.intensity, LEAST_INTENSITY))


def _look(look: LayerLook) -> Look:
    red, green, blue = (float(value) for value in look.gain)
    return Look((red, green, blue), look.view_curve, look.visible, look.radiance, look.maps)


def picture_frame(event: SceneFrame) -> PictureFrame:
    """The worker's primary hits as the renderer takes them."""
    arrays = event.arrays
    height, width = arrays["object_image"].shape
    names = ("pixel", "object_ranges", "object_image", "theta_o", "emission_image", "ray_directions")
    edges = {name: arrays[name] for name in ("edge_pixels", "edge_neighbours", "edge_weights") if name in arrays}
    return PictureFrame(width, height, **{name: arrays[name] for name in names}, **edges)  # type: ignore[arg-type]


def _thumbnail(radiance: NDArray[np.floating]) -> NDArray[np.uint8]:
    """The environment as a panel shows it, (h,w,3) sRGB."""
    return tone_mapped_thumbnail(Environment(np.asarray(radiance, np.float32), "thumbnail"), THUMBNAIL_WIDTH)
