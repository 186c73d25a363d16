"""Placement's picture: the worker's responses go to the renderer, followed by the document's curves.

    take: picture events ─► renderer (frame, footprint, layers, transport)
    draw: the document drawn (`app.modes.placement.picture_transition`) ─► gains, view curves, visibility, curve
    coefficients
          ─► renderer.update ─► display texture
          renderer's report ─► PlacementController.rendered

An upload under way takes part of the frame's time, coefficients the rest.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Mapping
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from app.document.background import Background
from app.document.document import Document, ObjectState, layer_key
from app.document.light_mix import emission_of
from app.document.light_state import RGB, LightState
from app.document.selection import is_layer_visible
from app.document.view_state import ViewState
from app.editor.editor import Editor
from app.messages.picture_events import PictureEvent, SceneFrame, SkyChanged
from app.modes.placement.placement_controller import PlacementController
from app.modes.placement.placement_events import (
    ComparisonRefined,
    Footprint,
    IndirectRadiance,
    LayerAppearance,
    LayerMapsChanged,
    LayerRadiance,
    TransportReady,
)
from app.modes.placement.placement_status import RenderReport
from engine.curve.wavelet import forward
from engine.material.layer import object_of
from engine.render.headlight import headlight_colour, headlight_radiance
from ui.gl.display import BLACK, Behind, DisplayView, ShownPicture, exposure_factor
from ui.gl.view_transform import ToneView
from ui.modes.placement.gl.layers import ComparedAppearance
from ui.modes.placement.gl.renderer import PlacementRenderer
from ui.modes.placement.gl.shader_warm_up import warm_up
from ui.modes.placement.lamp_feed import LampFeed
from ui.modes.placement.map_feed import MapFeed
from ui.picture_feed import PictureSource, ViewportStill, viewport_still

UPLOAD_SHARE = 0.5
# The fraction of the frame's time that refinement gets however long the rest takes.
LEAST_SHARE = 0.25
LEAST_INTENSITY = 1e-30
HEADLIGHT_SECONDS = 0.005
# The sky behind objects that are lit from the camera, while it is unknown.
PLAIN_SKY = 0.18


class PlacementFeed(PictureSource):
    """Feeds one `PlacementRenderer`; renderer: one that exists already."""

    def __init__(self, context: moderngl.Context, renderer: PlacementRenderer | None = None) -> None:
        self.renderer = renderer or PlacementRenderer(context)
        self._names: list[str] = []
        self._view_curves: dict[str, NDArray[np.float64]] = {}
        self._indirect: dict[str, IndirectRadiance] = {}
        self._held: dict[str, LayerRadiance] = {}  # until the transport that comes next
        self._drawn_as: dict[str, tuple[object, ...]] = {}
        self._holds = False
        self._emission: dict[str, RGB] = {}
        self._maps, self._lamps = MapFeed(self.renderer), LampFeed(self.renderer)
        self._plain: dict[str, ObjectState] = {}
        self._is_shaded = False  # all objects, lit from the camera at least: others are black
        self._view = ToneView()
        self._wanted: dict[str, NDArray[np.float64]] = {}
        self._compared: object = None
        self._rotation: float | None = None
        self._texture: moderngl.Texture | None = None
        self._exact_before = False
        self._followed: Document | None = None
        self._spent_ms = 0.0

    @property
    def picture(self) -> moderngl.Texture | None:
        return self._texture if self._is_shaded else None

    def warm_up(self) -> Iterator[None]:
        return warm_up(self.renderer)

    def map_thumbnails(self, key: str) -> Mapping[str, moderngl.Texture]:
        return self._maps.thumbnails(key)

    def map_refusal(self, editor: Editor, key: str) -> str | None:
        return _controller(editor).maps.refusal(key, editor.with_nodes(editor.document).layer(key).maps)

    def still(self, editor: Editor) -> ViewportStill | None:
        frame = self.renderer.frame
        if frame is None or self._texture is None:
            return None
        intensity, background = _controller(editor).picture.document.light.intensity, editor.document.background
        shown = self.renderer.finished_image(self._display_view(editor))
        return viewport_still(shown, self.renderer.linear_image_with_alpha(), intensity, background)

    def shown(self, editor: Editor) -> ShownPicture | None:
        if self.renderer.frame is None or self._texture is None:
            return None
        intensity = _controller(editor).picture.document.light.intensity
        return ShownPicture(*self.renderer.shown, self._display_view(editor), intensity)

    def shows_document(self, editor: Editor) -> bool:
        return self._exact_before and not self._holds and self._followed is editor.pictured

    def close(self) -> None:
        self._maps.clear()
        self._maps.release_retired()
        self.renderer.release()

    # ------------------------------------------------------------------------------------------- the worker's responses

    def take(self, editor: Editor, event: PictureEvent) -> None:
        self._maps.release_retired()
        match event:
            case SceneFrame():
                self._take_scene(event)
            case SkyChanged():
                self.renderer.set_environment(event.radiance, _controller(editor).picture.document.light.rotation)
            case LayerRadiance():
                self._take_radiance(event)
            case IndirectRadiance():
                self._indirect[event.key] = event
                self._take_indirect(event.key)
            case LayerMapsChanged():
                self._maps.take(event)
            case ComparisonRefined():
                if self._compared is not None:
                    self.renderer.snapshot_compare({key: _appearance(look) for key, look in event.appearances.items()})
            case TransportReady():
                numbers, curve, held = event.coefficients_first, event.factor, self._held.pop(event.key, None)
                self.renderer.set_footprint(*_both(event.footprint))
                self.renderer.begin_transport(
                    event.key, numbers, event.norms, event.scale, event.beside, curve, event.stage,
                    None if held is None else held.radiance,
                )  # fmt: skip

    def _take_scene(self, event: SceneFrame) -> None:
        self.renderer.set_frame(event.frame)
        self._names = [described.name for described in event.description.objects]
        self._plain.clear()
        self._view_curves.clear()
        self._indirect.clear()
        self._held.clear()
        self._drawn_as.clear()
        self._emission.clear()
        self._maps.clear()
        self._lamps.scene_taken(event)
        self._wanted = {}
        self._compared = self._rotation = self._followed = None
        self._is_shaded = False
        if event.description.environment is not None:  # until the worker sends its image
            self.renderer.set_environment(np.full((1, 2, 3), PLAIN_SKY, np.float32))

    def _take_radiance(self, event: LayerRadiance) -> None:
        renderer = self.renderer
        renderer.set_footprint(*_both(event.footprint))
        if event.key not in renderer.layer_keys:
            renderer.set_layer(event.key, self._names.index(object_of(event.key)), len(event.radiance))
            self._maps.layer_made(event.key)
        if self._drawn_as.get(event.key) != event.drawn_as:
            self._drawn_as[event.key] = event.drawn_as
            self._take_indirect(event.key)  # it may have come first, or belong to the layer before
        if event.is_outdated:  # its transport comes next
            self._held[event.key] = event
            return
        bands = event.coefficients.get(renderer.transport_curve(event.key) or "")
        shown = None if bands is None else forward(bands)
        renderer.set_layer_radiance(event.key, event.radiance, shown, event.stage)

    def _take_indirect(self, key: str) -> None:
        """Show a layer's indirect light, where it belongs to the layer whose direct light is shown."""
        event = self._indirect.get(key)
        if event is None or key not in self.renderer.layer_keys:
            return
        if event.footprint is None or event.drawn_as != self._drawn_as[key]:
            self.renderer.set_layer_indirect(key, None)
            return
        self.renderer.set_indirect_footprint(event.footprint.rows, event.footprint.weights)
        self.renderer.set_layer_indirect(key, event.radiance)

    def prepare(self, event: SceneFrame) -> bool:
        return self.renderer.prepare_frame(event.frame)

    # ------------------------------------------------------------------------------------------------------- each frame

    def draw(self, editor: Editor, last_frame_ms: float, all_taken: bool) -> bool:
        document = _controller(editor).picture.document
        self._end_plain(editor, document)
        shades_plainly = self._shade_headlight(editor, document)
        self._is_shaded = self._is_shaded or not shades_plainly
        if document is editor.pictured or document is not self._followed:
            self._follow_environment(document)
            self._follow_emitters(document)
            self._follow_layers(editor, document)
            self._follow_curve(editor)
            self._followed = document
        self._follow_visibility(editor, document)
        self._lamps.follow(editor.document, _controller(editor).lamps_elsewhere)
        self.renderer.hide_environment(editor.document.background.hides_environment)
        self._follow_catchers(editor, document)
        self._follow_comparison(editor)
        allowed = editor.view.frame_budget_ms
        budget = 1e-3 * max(allowed - (last_frame_ms - self._spent_ms), LEAST_SHARE * allowed)
        started = time.perf_counter()
        arriving = self.renderer.upload_fraction is not None
        uploaded = self.renderer.upload(UPLOAD_SHARE * budget)
        # The last slice makes the transport ready for use, which is enough for a frame; its use begins in the next.
        limit = 0 if arriving and uploaded else None
        report = self.renderer.update(limit, budget if uploaded else (1.0 - UPLOAD_SHARE) * budget)
        self._spent_ms = 1e3 * (time.perf_counter() - started)
        self._texture = self.renderer.composite(self._display_view(editor))
        wanted = max(map(len, self._wanted.values()), default=0)
        exact = uploaded and report.exact and all_taken
        _controller(editor).rendered(
            RenderReport(
                max(wanted - report.remaining, 0), wanted, report.image_error,
                exact and not self._holds,
                self.renderer.transport_precision, self.renderer.memory_bytes / 1e6, self.renderer.mean_radiance,
            )
        )  # fmt: skip
        changed = exact != self._exact_before
        self._exact_before = exact
        return not exact or changed or self._view.waits or shades_plainly

    def _shade_headlight(self, editor: Editor, document: Document) -> bool:
        """Show objects that have no picture yet lit from the camera, for a few milliseconds; returns whether some may
        be left."""
        until = time.perf_counter() + HEADLIGHT_SECONDS
        keys = set(self.renderer.layer_keys)
        there = self._plain.keys() | {object_of(key) for key in keys}
        for state in document.objects:
            is_new = state.name not in there and not state.is_lamp and state.name in self._names
            if not is_new and (state.name not in keys or self._plain[state.name] == state):
                continue
            if time.perf_counter() > until:
                return True
            self._plain[state.name] = state
            self._shade_object(editor, document, state)
        return False

    def _end_plain(self, editor: Editor, document: Document) -> None:
        """Remove objects lit from the camera that have a picture now: metals only when it has indirect light, without
        which they are black."""
        renderer = self.renderer
        there = {object_of(key) for key in set(renderer.layer_keys) - self._plain.keys()}
        for name in self._plain.keys() & set(renderer.layer_keys) & there:
            is_metal = not any(layer.model.is_diffuse for layer in document.object(name).layers)
            if not (is_metal and _controller(editor).lacks_bounces):
                renderer.remove_layer(name)

    def _shade_object(self, editor: Editor, document: Document, state: ObjectState) -> None:
        """Show an object as one layer, whose key is the object's name, and which goes when the real ones can be
        shown."""
        frame, index = self.renderer.frame, self._names.index(state.name)
        layers = {layer_key(state.name, i): layer for i, layer in enumerate(state.layers)}
        seen = [layer for key, layer in layers.items() if is_layer_visible(document, editor.view, key)]
        if frame is None or not seen:
            return
        theta_o = frame.theta_o[slice(*frame.object_ranges[index])]
        self.renderer.set_footprint(None)
        self.renderer.set_layer(state.name, index, len(theta_o))
        self.renderer.set_layer_radiance(state.name, headlight_radiance(headlight_colour(seen), theta_o), stage="plain")

    def _follow_environment(self, document: Document) -> None:
        """Rotate the background with the light."""
        rotation = document.light.rotation
        if rotation != self._rotation:
            self.renderer.turn_environment(rotation)
            self._rotation = rotation

    def _follow_emitters(self, document: Document) -> None:
        """Follow the visible radiance of emitters."""
        for name, radiance in emission_of(document):
            if name in self._names and self._emission.get(name) != radiance:
                self._emission[name] = radiance
                self.renderer.set_emission(self._names.index(name), radiance)

    def _follow_layers(self, editor: Editor, document: Document) -> None:
        """Follow gains and view curves; each setter of the renderer is free where nothing changed."""
        there = set(self.renderer.layer_keys)
        for key, layer in document.layers():
            if key not in there or not self._is_drawn(editor, key):
                continue
            self.renderer.set_layer_gain(key, _controller(editor).picture.gain(key).tolist())
            self._maps.follow(key, layer.maps)
            curves = _controller(editor).picture.view_curves(key)
            if self._view_curves.get(key) is not curves:
                self._view_curves[key] = curves
                self.renderer.set_view_curve(key, *curves)

    def _follow_visibility(self, editor: Editor, document: Document) -> None:
        """Follow which layers are visible; one that is gone may come back, by undo, before the worker knows of it."""
        seen = {key for key, _ in document.layers() if is_layer_visible(document, editor.view, key)}
        keys = set(self.renderer.layer_keys)
        plain = self._plain.keys() & keys
        for key in keys - plain:
            self.renderer.set_layer_visible(key, key in seen and object_of(key) not in plain)
        for name in plain:
            self.renderer.set_layer_visible(name, any(object_of(key) == name for key in seen))

    def _is_drawn(self, editor: Editor, key: str) -> bool:
        """Whether the picture of a layer is its own, and not that of the one that it replaced."""
        return self._drawn_as.get(key) == _controller(editor).picture.identity(key)

    def _follow_curve(self, editor: Editor) -> None:
        """Follow the selected curve, in all layers that share it and have a picture of their own."""
        self._holds = False
        factor = (editor.view.selected and editor.view.selected.factor) or ""
        found: dict[str, NDArray[np.float64]] = {}
        for key in _controller(editor).picture.edited_layers:
            coefficients = _controller(editor).picture.coefficients(key).get(factor)
            if coefficients is not None and key in self.renderer.layer_keys:
                if not self._is_drawn(editor, key):
                    self._holds = True
                    continue
                found[key] = coefficients
                if self._wanted.get(key) is not coefficients:
                    self.renderer.want(key, forward(coefficients), factor)
        self._wanted = found

    def _follow_catchers(self, editor: Editor, document: Document) -> None:
        """Follow which objects show only the shadows on them."""
        names = document.shadow_catchers
        is_fine = bool(names) and _controller(editor).picture.is_fine_of(names)
        light = editor.catchers.light(document) if is_fine else None
        are_caught = self.renderer.set_catchers([i for i, name in enumerate(self._names) if name in names], light)
        editor.catchers.drawn(are_caught)

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
        """Exposure includes the light's intensity: it multiplies the finished picture."""
        view, compared = editor.view, editor.view.compare
        return DisplayView(
            exposure=view.exposure + stops(_controller(editor).picture.document.light),
            compare_exposure=None if compared is None else view.exposure + stops(compared.light),
            tone_mapping=self._view.follow(view.tone_mapping, editor.colours),
            selected=self._index(view.selected.object if view.selected else None),
            others=tuple(i for name in view.others if (i := self._index(name)) is not None),
            hovered=self._index(view.hovered),
            compare_divider=view.compare_divider if view.compare is not None else None,
            behind=exposed_background(editor.document.background, view.exposure),
            compare_behind=BLACK if compared is None else exposed_background(compared.background, view.exposure),
            **inspection(view),
        )

    def _index(self, name: str | None) -> int | None:
        """The index of an object for its outline, None of a lamp that is not where the frame has it."""
        if name is not None and self._lamps.shows(name):
            return None
        return self._names.index(name) if name in self._names else None


def _controller(editor: Editor) -> PlacementController:
    """The controller of the picture: the mode's own, or the part of it that is Placement's."""
    controller = getattr(editor.controller, "placement", editor.controller)
    assert isinstance(controller, PlacementController)
    return controller


def _both(footprint: Footprint | None) -> tuple[NDArray[np.integer] | None, NDArray[np.floating] | None]:
    return (None, None) if footprint is None else (footprint.rows, footprint.weights)


def stops(light: LightState) -> float:
    """The light's intensity in stops."""
    return math.log2(max(light.intensity, LEAST_INTENSITY))


def inspection(view: ViewState) -> dict[str, Any]:
    """What of `DisplayView` is the same in all modes."""
    return {"gamma": view.gamma, "channel": view.picture_channel, "zebra": view.zebra}


def exposed_background(background: Background, exposure: float) -> Behind:
    """The radiance behind a picture in an exposure in stops, see `DisplayView`."""
    if background.kind == "transparent":
        return None
    red, green, blue = background.colour
    factor = exposure_factor(exposure)
    return factor * red, factor * green, factor * blue


def _appearance(look: LayerAppearance) -> ComparedAppearance:
    red, green, blue = (float(value) for value in look.gain)
    return ComparedAppearance((red, green, blue), look.view_curves, look.visible, look.radiance, look.maps)
