"""The renderer of Placement: what the window calls each frame.

A picture is the sum of layers, each with an accumulator B at its samples. The selected layer, and those that share its
curve, also have their transport on the GPU, and follow the curve by increments (`edited_layers`); the others stay as
the worker computed them.

In a frame the window calls ``upload`` (a slice of a pending transport), ``want`` (the present curve), ``update`` (as
many terms as the time allows) and ``composite`` (the display texture). No call waits for the GPU, except the read-backs
and one measurement of a term's cost after each new transport. Every failure is a GraphicsError and leaves the old
picture.

On a software rasterizer (llvmpipe, two cores, 512×512, a layer of 60,000 samples) a curve change is a finished frame
after 15 ms of CPU with 30 terms and 35 ms with all 128, spread over both cores; of these 1.6 ms shade the object, 3.5
ms composite and 3.2 ms tone map.

Order of the worker's responses: a layer's radiance before its transport. A radiance that arrives while a transport is
active makes that transport stale: increments continue from the new picture, but nothing is rebuilt from the old one.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import moderngl
import numpy as np
from numpy.typing import NDArray

from engine.scene.description import Camera
from engine.scene.picture_frame import PictureFrame
from engine.settings import Precision
from ui.gl.context import GraphicsError
from ui.gl.display import Display, DisplayView
from ui.gl.gpu_memory import TextureMemory
from ui.gl.program import Box, Passes
from ui.modes.placement.gl.coming_frame import ComingFrame
from ui.modes.placement.gl.composite import Compositor
from ui.modes.placement.gl.edited_layers import EditedLayers
from ui.modes.placement.gl.layers import ComparedAppearance, LayerStack
from ui.modes.placement.gl.moved_lamps import ShownLamp
from ui.modes.placement.gl.transport import TermSum


@dataclass(frozen=True)
class UpdateReport:
    """The result of an update.

    applied: terms added; remaining: terms that still differ; image_error: their amount, relative to the mean radiance;
    exact: nothing is left to add or to rebuild.
    """

    applied: int = 0
    remaining: int = 0
    image_error: float = 0.0
    exact: bool = True


@dataclass(eq=False)
class _Picture:
    """All that belongs to one frame; the boxes are what must be drawn again."""

    compositor: Compositor
    display: Display
    layers: LayerStack
    linear_box: Box | None
    display_box: Box | None = None
    view: DisplayView | None = None
    backdrop_is_stale: bool = True
    rotation_degrees: float = 0.0
    intensity: float = 1.0
    transparent: bool = False


class PlacementRenderer:
    """All GL state of Placement in one context. `memory_limit` in bytes refuses textures beyond it."""

    def __init__(self, context: moderngl.Context, memory_limit: int | None = None) -> None:
        self.context = context
        self.memory = TextureMemory(context, memory_limit)
        self._passes = Passes(context)
        self._terms = TermSum(self._passes, self.memory)
        self._picture: _Picture | None = None
        self._coming: ComingFrame | None = None
        self._edited = EditedLayers(self.memory, self._terms)

    # --------------------------------------------------------------------------------------------------------- the view

    def set_frame(self, frame: PictureFrame) -> None:
        """Start a new picture; layers, transports, footprint, environment and snapshot of the old one are dropped."""
        while self.prepare_frame(frame):
            pass
        assert self._coming is not None and self._coming.made is not None
        (compositor, display), self._coming = self._coming.made, None
        self._release_picture()
        layers = LayerStack(self.memory, compositor)
        self._picture = _Picture(compositor, display, layers, linear_box=compositor.picture_box)

    def prepare_frame(self, frame: PictureFrame) -> bool:
        """Do a step of what `set_frame` needs for this frame, while the picture stays; returns whether there are
        more."""
        if self._coming is None or self._coming.frame is not frame:
            self._drop_coming()
            self._coming = ComingFrame(self._passes, self.memory, frame)
        try:
            return self._coming.advance()
        except BaseException:
            self._coming = None
            raise

    def _drop_coming(self) -> None:
        if self._coming is not None:
            self._coming.release()
        self._coming = None

    def clear(self) -> None:
        """Drop the picture and all that belongs to it."""
        self._release_picture()

    @property
    def frame(self) -> PictureFrame | None:
        return None if self._picture is None else self._picture.compositor.frame

    def set_environment(
        self, radiance: NDArray[np.floating] | None, rotation_degrees: float = 0.0, intensity: float = 1.0
    ) -> None:
        """Set the lat-long map (H,W,3) behind the surfaces; None is black. It lights nothing here."""
        self._shown().compositor.set_environment(radiance)
        self.turn_environment(rotation_degrees, intensity)

    def set_emission(self, i_object: int, radiance: Sequence[float]) -> None:
        """Set the visible radiance of an emitter, linear; free where nothing changes."""
        picture = self._shown()
        picture.backdrop_is_stale = picture.compositor.set_emission(i_object, radiance) or picture.backdrop_is_stale

    def turn_environment(self, rotation_degrees: float, intensity: float = 1.0) -> None:
        """Set the rotation and intensity of the present map."""
        picture = self._shown()
        picture.rotation_degrees, picture.intensity = float(rotation_degrees), float(intensity)
        picture.backdrop_is_stale = True

    def hide_environment(self, hides: bool) -> None:
        """Leave the environment out behind the surfaces, so that the picture has alpha; free where nothing changes."""
        picture = self._shown()
        picture.backdrop_is_stale = picture.backdrop_is_stale or hides != picture.transparent
        picture.transparent = hides

    def set_catchers(self, objects: Sequence[int], light: NDArray[np.floating] | None) -> bool:
        """Show of these objects only the shadows on them; light (H,W,3): what they send where nothing throws any, None
        to show them as they are. Returns whether their shadows are shown. Free where nothing changes."""
        picture = self._shown()
        picture.backdrop_is_stale |= picture.compositor.set_catchers(objects, light)
        return picture.compositor.catches

    def set_moved_lamps(self, camera: Camera, lamps: tuple[ShownLamp, ...]) -> None:
        """Show lamps elsewhere than the frame has them, see `MovedLamps`; camera: the frame's. Free where nothing
        changes."""
        picture = self._shown()
        changed = picture.compositor.set_moved_lamps(camera, lamps)
        picture.backdrop_is_stale |= changed is None
        for box in changed or ():
            picture.linear_box = _union(picture.linear_box, box)

    def set_footprint(self, rows: NDArray[np.integer] | None, weights: NDArray[np.floating] | None = None) -> None:
        """Set which samples stand for each pixel in the pictures set from now on; None: one sample per pixel.

        rows (P,4) index the samples of the pixel's own object, from 0; weights (P,4) sum to 1.
        """
        self._shown().layers.set_footprint(rows, weights)
        self._release_unused_footprints()

    # ------------------------------------------------------------------------------------------------------- the layers

    def set_layer(self, key: str, i_object: int, n_samples: int) -> None:
        """Add a layer, black; an old one of that key loses its picture and transport."""
        self._shown().layers.put(key, i_object, n_samples)
        self._edited.drop(key)
        self._release_unused_footprints()

    def remove_layer(self, key: str) -> None:
        """Remove a layer that is not edited."""
        self._shown().layers.remove(key)

    def set_layer_radiance(
        self,
        key: str,
        radiance: NDArray[np.floating],
        coefficients: NDArray[np.floating] | None = None,
        stage: str = "",
    ) -> None:
        """Replace a layer's picture by radiance (p,3) at the samples of the current footprint.

        coefficients (J,3), Daub4 domain: those of the active transport's curve that the radiance was contracted with.
        None when unknown: an active transport then waits for its successor. stage: that of the radiance; a pending
        transport of another one is dropped.
        """
        layers = self._shown().layers
        same_samples = layers.set_radiance(key, radiance, layers.footprint)
        self._edited.start_from(key, coefficients, same_samples, stage)
        self._release_unused_footprints()

    def set_indirect_footprint(self, rows: NDArray[np.integer], weights: NDArray[np.floating]) -> None:
        """Set which samples of indirect light stand for each pixel, as in `set_footprint`, from now on."""
        self._shown().layers.set_indirect_footprint(rows, weights)
        self._release_unused_footprints()

    def set_layer_indirect(self, key: str, radiance: NDArray[np.floating] | None) -> None:
        """Set a layer's indirect radiance (p,3), without f_q and f_o; None: there is none."""
        self._shown().layers.set_indirect(key, radiance)
        self._release_unused_footprints()

    @property
    def layer_keys(self) -> tuple[str, ...]:
        return () if self._picture is None else self._picture.layers.keys

    def set_layer_gain(self, key: str, gain: Sequence[float]) -> None:
        """Set f_q, one factor per channel."""
        self._shown().layers.set_gain(key, gain)

    def set_layer_visible(self, key: str, visible: bool) -> None:
        self._shown().layers.set_visible(key, visible)

    def set_layer_maps(self, key: str, samples: NDArray[np.float16] | None) -> None:
        """Set a layer's images (p,4) at every pixel of its object, texture RGB and weight; None: it has none."""
        self._shown().layers.set_maps(key, samples)

    def set_map_numbers(self, key: str, strength: float, inverts: bool) -> None:
        """Set the strength of a layer's texture, from 0 to 1, and whether one minus the weight counts."""
        self._shown().layers.set_map_numbers(key, strength, inverts)

    def set_view_curve(
        self, key: str, curve: NDArray[np.floating] | None, of_coat: NDArray[np.floating] | None = None
    ) -> None:
        """Set f_o (256,3) at angles θ_o from 0 to π/2 inclusive, linear between; None is 1 everywhere."""
        self._shown().layers.set_view_curve(key, curve, of_coat)

    # ---------------------------------------------------------------------------------------------------- the transport

    def begin_transport(
        self,
        key: str,
        transport: NDArray[np.floating],
        norms: NDArray[np.floating],
        scale: NDArray[np.floating] | None = None,
        beside: Collection[str] = (),
        curve: str = "",
        stage: str = "",
        radiance: NDArray[np.floating] | None = None,
    ) -> None:
        """Start to upload a layer's transport (J,p,3) over a curve, true values transport·scale, in the Daub4 domain.

        Its numbers are float16 or float32, and stay so on the GPU. norms (J,3) are the lengths ‖T_k‖ of the true values
        over the p samples; scale (J,) or (J,3), None is 1. The active transport and the picture stay until ``upload``
        is done; then all transports are dropped except those of layers `beside` it, which follow the same curve.
        Another pending one is dropped unless it is one of these. radiance: the layer's at these samples under a curve
        of before, which is shown only if the upload is dropped.
        """
        self._edited.begin(self._shown().layers, key, transport, norms, scale, beside, curve, stage, radiance)

    def upload(self, time_budget_s: float) -> bool:
        """Continue the upload for about this long; True when none is pending."""
        if self._edited.upload_fraction is None:
            return True
        is_over = self._edited.upload(self._shown().layers, time_budget_s)
        self._release_unused_footprints()
        return is_over

    @property
    def upload_fraction(self) -> float | None:
        """The uploaded fraction of the pending transport; None when there is none."""
        return self._edited.upload_fraction

    @property
    def transport_precision(self) -> Precision | None:
        """Whether the active transport is of half or single floats; None where none is active."""
        return self._edited.precision

    def transport_curve(self, key: str) -> str | None:
        """The curve of a layer's active transport; None where there is none."""
        return self._edited.curve(key)

    def want(self, key: str, coefficients: NDArray[np.floating], curve: str = "") -> None:
        """Set the curve (J,3), Daub4 domain, that the layer should show; stored for its transport where that is not
        there.

        Raises GraphicsError on numbers that are not finite; a number of bands that the active transport does not have
        waits for the next one.
        """
        self._edited.want(key, coefficients, curve)

    def update(self, max_coefficients: int | None = None, budget_s: float | None = None) -> UpdateReport:
        """Move the picture towards the wanted curves: at most so many terms, and as many as fit into `budget_s`.

        With neither, all. A rebuild that is due may take 32 terms, whatever the limits.
        """
        if not self._edited.keys:
            return UpdateReport()
        done = self._edited.update(self._shown().layers, max_coefficients, budget_s)
        self._release_unused_footprints()
        return UpdateReport(done.applied, done.remaining, self.image_error(), done.exact)

    @property
    def mean_radiance(self) -> float:
        """Mean radiance of the direct light, over the pixels that see a surface and the channels."""
        return self._shown().layers.mean_radiance()

    def image_error(self) -> float:
        """sqrt(Σ_k |Δc_k|²‖T_k‖² / values) / mean radiance, over the pixels that see a surface.

        An estimate: the T_k are not orthogonal over the picture, and f_o is left out.
        """
        if not self._edited.keys:
            return 0.0
        picture = self._shown()
        size = picture.compositor.object_size(picture.layers[self._edited.keys[0]].i_object)
        missing = self._edited.missing(picture.layers, size)
        missing /= max(1, 3 * picture.compositor.frame.n_points) ** 0.5
        mean = picture.layers.mean_radiance()
        return missing / mean if missing > 0.0 and mean > 0.0 else 0.0

    # ------------------------------------------------------------------------------------------------------ the picture

    def composite(self, view: DisplayView) -> moderngl.Texture:
        """The display picture, RGBA8, sRGB encoded, row 0 the top; only what changed is drawn again.

        Framebuffer, viewport and blending are changed: bind your own again afterwards.
        """
        self._draw_linear()
        picture = self._shown()
        if view != picture.view:
            picture.display_box = picture.compositor.picture_box
        if picture.display_box is not None:
            picture.display.draw(picture.compositor.linear, view, picture.display_box)
        picture.display_box, picture.view = None, view
        return picture.display.texture

    def snapshot_compare(self, looks: Mapping[str, ComparedAppearance] | None = None) -> None:
        """Store the linear picture, with these appearances of its layers (None: the present ones), as A of the
        comparison."""
        self._draw_linear()
        picture = self._shown()
        with picture.layers.with_appearances(looks or {}):
            objects = {picture.layers[key].i_object for key in looks or {} if key in picture.layers}
            picture.layers.dirty |= objects
            self._draw_linear()
            picture.display.take_snapshot(picture.compositor.linear_target)
        self._draw_linear()
        picture.display_box = picture.compositor.picture_box

    def drop_compare(self) -> None:
        """End the comparison."""
        picture = self._shown()
        picture.display.drop_snapshot()
        picture.display_box = picture.compositor.picture_box

    @property
    def linear_texture(self) -> moderngl.Texture:
        """The linear picture as it was drawn last; alpha: the share of each pixel that is covered."""
        return self._shown().compositor.linear

    @property
    def shown(self) -> tuple[Display, moderngl.Framebuffer]:
        """The display, and what the linear picture was drawn into last."""
        picture = self._shown()
        return picture.display, picture.compositor.linear_target

    def linear_image(self) -> NDArray[np.float32]:
        """The linear picture (H,W,3); waits for the GPU."""
        return self.linear_image_with_alpha()[..., :3]

    def linear_image_with_alpha(self) -> NDArray[np.float32]:
        """The linear picture and the share of each pixel that is covered (H,W,4); waits for the GPU."""
        self._draw_linear()
        return self._shown().compositor.read_linear()

    def display_image(self) -> NDArray[np.uint8]:
        """The last display picture (H,W,3), sRGB; waits for the GPU."""
        return self._shown().display.read()

    def finished_image(self, view: DisplayView) -> NDArray[np.float32]:
        """The picture (H,W,3), with alpha (H,W,4) over a transparent background, in the screen's values, exposed and
        tone mapped as in the view, with nothing drawn over it; waits for the GPU."""
        self._draw_linear()
        picture = self._shown()
        return picture.display.finished(picture.compositor.linear, view)

    def layer_radiance(self, key: str) -> NDArray[np.float32]:
        """The radiance (p,3) of one layer in its accumulator; waits for the GPU."""
        return self._shown().layers[key].accumulator.read()

    def object_at(self, x: int, y: int) -> int:
        """The object at a pixel, column x and row y from the top; −1 where there is none."""
        frame = self._shown().compositor.frame
        inside = 0 <= x < frame.width and 0 <= y < frame.height
        return int(frame.object_image[y, x]) if inside else -1

    @property
    def memory_bytes(self) -> int:
        """Bytes of all textures."""
        return self.memory.bytes_in_use

    def release(self) -> None:
        """Free all GL objects of this renderer."""
        self._release_picture()
        self._terms.release()
        self._passes.release()

    def _draw_linear(self) -> None:
        """Update the linear picture."""
        picture = self._shown()
        compositor, layers = picture.compositor, picture.layers
        if picture.backdrop_is_stale:
            compositor.draw_backdrop(picture.rotation_degrees, picture.intensity, picture.transparent)
            picture.backdrop_is_stale, picture.linear_box = False, compositor.picture_box
        for i_object in sorted(layers.dirty):
            compositor.shade(i_object, layers.of_object(i_object))
            picture.linear_box = _union(picture.linear_box, compositor.object_box(i_object))
            picture.linear_box = _union(picture.linear_box, compositor.filled_box)
        layers.dirty.clear()
        if picture.linear_box is not None:
            compositor.composite(picture.linear_box)
        picture.display_box = _union(picture.display_box, picture.linear_box)
        picture.linear_box = None

    def _shown(self) -> _Picture:
        if self._picture is None:
            raise GraphicsError("no picture yet: set_frame comes first")
        return self._picture

    def _release_unused_footprints(self) -> None:
        self._shown().layers.release_unused_footprints(self._edited.footprints)

    def _release_picture(self) -> None:
        self._drop_coming()
        self._edited.clear()
        if self._picture is not None:
            self._picture.layers.release()
            self._picture.display.release()
            self._picture.compositor.release()
            self._picture = None


def _union(a: Box | None, b: Box | None) -> Box | None:
    """The smallest box around both; None and boxes without area are empty."""
    boxes = [box for box in (a, b) if box is not None and box[2] > 0 and box[3] > 0]
    if len(boxes) < 2:
        return boxes[0] if boxes else None
    left, top = min(box[0] for box in boxes), min(box[1] for box in boxes)
    right, bottom = max(box[0] + box[2] for box in boxes), max(box[1] + box[3] for box in boxes)
    return left, top, right - left, bottom - top
