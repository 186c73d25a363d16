"""From the linear picture to the screen: exposure, tone mapping, sRGB, outlines, A/B.

Outlines are short lists of points drawn over the picture: checking each pixel's neighbours in a full-screen shader
costs more than the rest of the frame on a software rasterizer, and hardly any pixel needs it.

View transforms are in `ui.gl.view_transform`. What inspects a picture (one channel, stripes where it is clipped) is a
variant of the shader, so that the picture alone costs nothing more.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import moderngl
import numpy as np
from numpy.typing import NDArray

from app.document.view_state import PICTURE_CHANNELS, PictureChannel
from engine.scene.picture_frame import PictureFrame
from ui.gl.gpu_memory import TextureMemory, read_texture
from ui.gl.program import Box, Passes
from ui.gl.view_transform import DrawnView, ToneMapper

# -------------------------------------------------------------------------------------------------- the display picture


Behind = tuple[float, float, float] | None
BLACK: Behind = (0.0, 0.0, 0.0)
SELECTION_COLOUR, OTHERS_COLOUR = (1.0, 0.62, 0.12), (0.75, 0.33, 0.03)
HOVER_COLOUR = (0.82, 0.82, 0.82)
# Where there is no background, display.frag.glsl shows the picture over this, or with alpha.
_CHECKERBOARD, _WITH_ALPHA = 1, 2
DIVIDER_COLOUR = (0.95, 0.95, 0.95, 1.0)


@dataclass(frozen=True)
class DisplayView:
    """How the linear picture is shown.

    exposure in stops; selected (the active one), others and hovered are object indices, outlined; compare_divider in
    [0, 1] is the border between the snapshot A (left) and the picture B (right), None shows the picture alone;
    compare_exposure is A's, None as B's. behind is the exposed radiance of the background, seen where alpha is below 1,
    None shows a checkerboard there; compare_behind is A's. gamma: the finished colours are raised to
    1 / gamma. channel: which is seen alone; zebra: stripes where the screen's values are at their end.
    """

    exposure: float = 0.0
    tone_mapping: DrawnView = "filmic"
    selected: int | None = None
    others: tuple[int, ...] = ()
    hovered: int | None = None
    compare_divider: float | None = None
    compare_exposure: float | None = None
    behind: Behind = BLACK
    compare_behind: Behind = BLACK
    gamma: float = 1.0
    channel: PictureChannel = "colour"
    zebra: bool = False

    @property
    def is_inspected(self) -> bool:
        """Whether more is shown than the picture."""
        return self.channel != "colour" or self.zebra

    @property
    def plain(self) -> DisplayView:
        """The same without what inspects the picture."""
        return replace(self, channel="colour", zebra=False)


class ShownPicture(NamedTuple):
    """What is on screen: its display, what the linear picture is drawn into, how it is shown, and the intensity of the
    light, which the linear picture is without."""

    display: Display
    target: moderngl.Framebuffer
    view: DisplayView
    intensity: float

    @property
    def linear(self) -> moderngl.Texture:
        """The linear picture."""
        texture = self.target.color_attachments[0]
        assert isinstance(texture, moderngl.Texture)
        return texture


class Display:
    """The display picture of one frame, RGBA8 and sRGB encoded, and the snapshot for A/B."""

    def __init__(self, passes: Passes, memory: TextureMemory, frame: PictureFrame) -> None:
        self._passes, self._memory, self._frame = passes, memory, frame
        self._mapper = ToneMapper(passes, memory)
        self._size = (frame.width, frame.height)
        self.texture = memory.texture(self._size, 4, "f1")
        self._target = memory.framebuffer([self.texture])
        self._snapshot: moderngl.Texture | None = None
        self._snapshot_target: moderngl.Framebuffer | None = None
        self._outlines: dict[int, tuple[moderngl.Buffer, moderngl.VertexArray]] = {}

    @property
    def has_snapshot(self) -> bool:
        return self._snapshot is not None

    def take_snapshot(self, linear: moderngl.Framebuffer) -> None:
        """Keep a copy of the linear picture as A."""
        if self._snapshot is None:
            self._snapshot = self._memory.texture(self._size, 4, "f4")
            self._snapshot_target = self._memory.framebuffer([self._snapshot])
        assert self._snapshot_target is not None
        linear.viewport = self._snapshot_target.viewport = (0, 0, *self._size)
        self._memory.context.copy_framebuffer(self._snapshot_target, linear)

    def drop_snapshot(self) -> None:
        self._memory.release_framebuffer(self._snapshot_target)
        self._memory.release(self._snapshot)
        self._snapshot = self._snapshot_target = None

    def draw(self, linear: moderngl.Texture, view: DisplayView, box: Box) -> None:
        """Redraw `box` of the display picture, and all outlines."""
        for region, source, exposure, behind in self._regions(linear, view, box):
            shown = replace(view, exposure=exposure, behind=behind)
            draw_on_screen(self._passes, self._mapper, self._target, source, shown, region)
        others = ((i_object, OTHERS_COLOUR) for i_object in view.others)
        for i_object, colour in ((view.hovered, HOVER_COLOUR), *others, (view.selected, SELECTION_COLOUR)):
            if i_object is not None and 0 <= i_object < self._frame.n_objects:
                self._outline(i_object, colour)
        if view.compare_divider is not None and self.has_snapshot:
            x = min(self._divider_column(view), self._size[0] - 1)
            self._target.use()
            self._target.clear(*DIVIDER_COLOUR, viewport=(x, 0, 1, self._size[1]))

    def read(self) -> NDArray[np.uint8]:
        """The display picture (H,W,3), sRGB; waits for the GPU."""
        return read_texture(self.texture, np.uint8)[..., :3].astype(np.uint8)

    def sampled(
        self, linear: moderngl.Texture, view: DisplayView, box: Box, size: tuple[int, int], dtype: str = "f1"
    ) -> NDArray[np.generic]:
        """The box of a linear picture as it is shown, with nothing drawn over it, by so many pixels (height, width, 4)
        evenly from it; "f1" from 0 to 255, "f4" from 0 to 1. Waits for the GPU."""
        texture = self._memory.texture(size, 4, dtype)
        target = self._memory.framebuffer([texture])
        stride = box[2] / size[0], box[3] / size[1]
        try:
            part = (0, 0, *size), _CHECKERBOARD, (box[0], box[1]), stride
            draw_on_screen(self._passes, self._mapper, target, linear, view.plain, *part)
            return read_texture(texture, np.uint8 if dtype == "f1" else np.float32)
        finally:
            self._memory.release_framebuffer(target)
            self._memory.release(texture)

    def finished(self, linear: moderngl.Texture, view: DisplayView) -> NDArray[np.float32]:
        """The picture (H,W,3) alone, without outlines and divider, in the screen's values, unrounded: for files that
        have more levels than the screen; over a transparent background with alpha (H,W,4). Waits for the GPU."""
        whole: Box = (0, 0, *self._size)
        texture = self._memory.texture(self._size, 4, "f4")
        target = self._memory.framebuffer([texture])
        try:
            draw_on_screen(self._passes, self._mapper, target, linear, view.plain, whole, _WITH_ALPHA)
            n_channels = 4 if view.behind is None else 3
            return read_texture(texture, np.float32)[..., :n_channels].astype(np.float32)
        finally:
            self._memory.release_framebuffer(target)
            self._memory.release(texture)

    def _regions(
        self, linear: moderngl.Texture, view: DisplayView, box: Box
    ) -> list[tuple[Box, moderngl.Texture, float, Behind]]:
        """Which part of `box` shows which picture, with its exposure and background: the snapshot left of the divider,
        the picture right."""
        if view.compare_divider is None or self._snapshot is None:
            return [(box, linear, view.exposure, view.behind)]
        x, y, width, height = box
        split = min(max(self._divider_column(view), x), x + width)
        other = view.exposure if view.compare_exposure is None else view.compare_exposure
        left = (x, y, split - x, height), self._snapshot, other, view.compare_behind
        right = (split, y, x + width - split, height), linear, view.exposure, view.behind
        return [part for part in (left, right) if part[0][2] > 0]

    def _divider_column(self, view: DisplayView) -> int:
        return round(min(max(view.compare_divider or 0.0, 0.0), 1.0) * self._size[0])

    def _outline(self, i_object: int, colour: tuple[float, float, float]) -> None:
        if i_object not in self._outlines:
            self._outlines[i_object] = self._outline_points(i_object)
        array = self._outlines[i_object][1]
        self._passes.draw_points(array, self._target, {}, picture_size=self._size, outline_colour=colour)

    def _outline_points(self, i_object: int) -> tuple[moderngl.Buffer, moderngl.VertexArray]:
        pixels = outline_pixels(self._frame.object_image == i_object)
        context = self._memory.context
        buffer = context.buffer(pixels) if pixels.size else context.buffer(reserve=4)
        array = context.vertex_array(self._passes.points("outline"), [(buffer, "1i", "pixel")])
        array.vertices = pixels.size
        return buffer, array

    def release(self) -> None:
        self.drop_snapshot()
        self._mapper.release()
        for buffer, array in self._outlines.values():
            array.release()
            buffer.release()
        self._memory.release_framebuffer(self._target)
        self._memory.release(self.texture)


def draw_on_screen(
    passes: Passes, mapper: ToneMapper, target: moderngl.Framebuffer, source: moderngl.Texture, view: DisplayView,
    region: Box, transparent: int = _CHECKERBOARD, first: tuple[int, int] = (0, 0),
    stride: tuple[float, float] = (1.0, 1.0),
) -> None:  # fmt: skip
    """Draw the region of a target from a linear picture as it is shown. transparent: what is shown where there is no
    background, as display.frag.glsl numbers it; first, stride: the texel of the source in the target's first, and how
    many there are for each."""
    inspects = view.is_inspected
    program = mapper.full_screen("placement/display.frag.glsl", view.tone_mapping, INSPECTED=int(inspects))
    textures = {"linear_picture": source, **mapper.textures(view.tone_mapping)}
    kind = transparent if view.behind is None else 0
    inspection: dict[str, Any] = (
        {"channel": PICTURE_CHANNELS.index(view.channel), "zebra": view.zebra} if inspects else {}
    )
    passes.draw(
        program, target, region, textures, exposure=exposure_factor(view.exposure), behind=view.behind or BLACK,
        transparent=kind, first=first, stride=stride, inverse_gamma=1.0 / view.gamma, **inspection,
    )  # fmt: skip


def exposure_factor(stops: float) -> float:
    """The factor of an exposure in stops, clamped to ±64."""
    return float(2.0 ** min(max(stops, -64.0), 64.0))


def outline_pixels(mask: NDArray[np.bool_]) -> NDArray[np.int32]:
    """Row-major indices of the pixels just outside a mask (H,W): the outline covers nothing of what it surrounds."""
    padded = np.pad(mask, 1)
    neighbours = np.stack([padded[:-2, 1:-1], padded[2:, 1:-1], padded[1:-1, :-2], padded[1:-1, 2:]])
    return np.flatnonzero(~mask & neighbours.any(axis=0)).astype(np.int32)


# ------------------------------------------------------------------------------------------------ the error map over it


class ErrorOverlay:
    """One texture, of the colours that were requested last."""

    def __init__(self, context: moderngl.Context) -> None:
        self._context = context
        self._colours: NDArray[np.uint8] | None = None
        self._texture: moderngl.Texture | None = None

    def texture(self, colours: NDArray[np.uint8] | None) -> moderngl.Texture | None:
        """The texture of colours (H, W, 4), row 0 at the top; uploaded where they differ from those before."""
        if colours is None:
            return None
        if colours is not self._colours:
            size = colours.shape[1], colours.shape[0]
            if self._texture is None or self._texture.size != size:
                self.release()
                self._texture = self._context.texture(size, 4)
            self._texture.write(np.ascontiguousarray(colours))
            self._colours = colours
        return self._texture

    def release(self) -> None:
        """Free the texture."""
        if self._texture is not None:
            self._texture.release()
        self._texture = self._colours = None
