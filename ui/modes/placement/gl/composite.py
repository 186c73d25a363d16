"""From the layers' accumulators to one linear picture.

`Compositor` has the textures of one camera's view. ``shade`` sums an object's layers into its rows of `shaded`,
``composite`` puts shaded surfaces and the backdrop together; both only for what changed. Pixels are shaded in sample
layout, once for each pixel that needs it, so that a picture that is mostly background or static costs little.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import moderngl
import numpy as np
from numpy.typing import NDArray

from engine.scene.description import Camera
from engine.scene.picture_frame import PictureFrame
from ui.gl.context import GraphicsError
from ui.gl.gpu_memory import TextureMemory, read_texture
from ui.gl.program import Box, Passes
from ui.modes.placement.gl.catching import Catching
from ui.modes.placement.gl.moved_lamps import (
    MovedLamps,
    ShownLamp,
    box_of_pixels,
    centre_distances,
    pointless_pixels,
)
from ui.modes.placement.gl.transport import (
    SAMPLES_PER_ROW,
    Accumulator,
    not_a_power_of_two,
    pack_samples,
    row_count,
    sample_addresses,
)

VIEW_CURVE_SIZE = 256


@dataclass(eq=False)
class FootprintTextures:
    """Which samples stand for each pixel: addresses (four a pixel) and weights, in the layout of `shaded`."""

    addresses: moderngl.Texture
    weights: moderngl.Texture
    n_samples_needed: NDArray[np.int64]  # (O,) one more than the largest sample index of each object


@dataclass(eq=False)
class MapTexture:
    """A layer's images at the pixels of its object, RGB and weight, in the layout of `shaded`; and their source."""

    texture: moderngl.Texture
    samples: NDArray[np.float16]


@dataclass(eq=False)
class Indirect:
    """The indirect light that a layer reflects, at its own samples."""

    accumulator: Accumulator
    footprint: FootprintTextures


class ShadedLayer(Protocol):
    """A layer as the compositor needs it."""

    @property
    def accumulator(self) -> Accumulator: ...
    @property
    def footprint(self) -> FootprintTextures | None: ...
    @property
    def indirect(self) -> Indirect | None: ...
    @property
    def gain(self) -> tuple[float, float, float]: ...
    @property
    def view_curve(self) -> moderngl.Texture | None: ...
    @property
    def visible(self) -> bool: ...
    @property
    def maps(self) -> MapTexture | None: ...
    @property
    def map_numbers(self) -> tuple[float, bool]: ...


class Compositor:
    """Shaded surfaces, backdrop and the linear picture of one frame."""

    def __init__(self, passes: Passes, memory: TextureMemory, frame: PictureFrame) -> None:
        require_sound(frame)
        self.frame = frame
        self._passes, self._memory = passes, memory
        self._textures: list[moderngl.Texture] = []
        self._framebuffers: list[moderngl.Framebuffer] = []
        self._environment: moderngl.Texture | None = None
        self._catching: Catching | None = None
        self._moved: MovedLamps | None = None
        self._sky: dict[str, Any] = {}

    def allocating(self) -> Generator[None, None, None]:
        """Make its textures, in steps each shorter than a frame; to be called before anything else.

        Textures made so far are freed where one fails, or where no further step is requested.
        """
        try:
            yield from self._allocate()
        except BaseException:
            self.release()
            raise

    def _allocate(self) -> Generator[None, None, None]:
        frame, size = self.frame, (self.frame.width, self.frame.height)
        counts = frame.object_ranges[:, 1] - frame.object_ranges[:, 0]
        rows = [row_count(int(n)) if n else 0 for n in counts]
        self._first_rows = np.concatenate(([0], np.cumsum(rows))).astype(int)
        self._object_boxes = [frame.object_box(i) for i in range(frame.n_objects)]
        self._n_rows = not_a_power_of_two(int(self._first_rows[-1]))
        self._lamps = frame.lamps._replace(emission=np.array(frame.lamps.emission, dtype=np.float32))
        self._emitter_pixels = np.zeros((frame.height, frame.width, 4), dtype=np.float32)
        self._emitter_pixels[..., :3] = frame.emission_image
        self._emitter_pixels[..., 3] = frame.open_image
        yield
        self._emission = self._keep(size, 4, "f4", self._emitter_pixels)
        yield
        self._rays = self._keep(size, 3, "f4", np.asarray(frame.ray_directions, np.float32))
        yield
        self._addresses, mixed = self._addresses_of_pixels()
        yield
        self._pixel_addresses = self._keep(size, 1, "i4", self._addresses)
        self._mixed = self._keep(mixed.shape[1::-1], 2, "i4", mixed)
        self._theta_o = self._keep((SAMPLES_PER_ROW, self._n_rows), 1, "f4", self.pack(frame.theta_o, np.float32))
        self._coat_theta_o = self._theta_o
        if frame.coat_theta_o is not frame.theta_o:
            packed = self.pack(frame.coat_theta_o, np.float32)
            self._coat_theta_o = self._keep((SAMPLES_PER_ROW, self._n_rows), 1, "f4", packed)
        yield
        # For lamps that are moved.
        self._pointless = pointless_pixels(frame)
        yield
        self._distances = yield from centre_distances(frame)
        self._distance_texture = self._keep(size, 1, "f4", self._distances)
        yield
        self.shaded = self._keep((SAMPLES_PER_ROW, self._n_rows), 4, "f4")
        self.backdrop = self._keep(size, 4, "f4")
        self.linear = self._keep(size, 4, "f4")
        yield
        targets = (self.shaded, self.backdrop, self.linear)
        self._framebuffers = [self._memory.framebuffer([texture]) for texture in targets]
        self._shaded_target, self._backdrop_target, self.linear_target = self._framebuffers

    def object_rows(self, i_object: int) -> tuple[int, int]:
        """(first row, number of rows) of an object's pixels in sample layout."""
        first, last = self._first_rows[i_object : i_object + 2]
        return int(first), int(last - first)

    def object_box(self, i_object: int) -> Box:
        """The box of the picture that contains an object's pixels."""
        return self._object_boxes[i_object]

    @property
    def filled_box(self) -> Box | None:
        """The box that shows moved lamps where they were, which any object may fill."""
        return None if self._moved is None else self._moved.filled_box

    def object_size(self, i_object: int) -> int:
        """The number of points that the camera sees on the object."""
        start, stop = self.frame.object_ranges[i_object]
        return int(stop - start)

    def pack(self, values: NDArray[np.generic], dtype: type[np.generic]) -> NDArray[np.generic]:
        """Values (P,) or (P,n) of the points as texels (rows, 1024, n) in the layout of `shaded`."""
        table = np.asarray(values, dtype=dtype)
        if table.ndim == 1:
            table = table[:, None]
        texels = np.zeros((self._n_rows, SAMPLES_PER_ROW, table.shape[1]), dtype=dtype)
        for i_object, (start, stop) in enumerate(self.frame.object_ranges):
            first, n_rows = self.object_rows(i_object)
            if n_rows:
                texels[first : first + n_rows] = pack_samples(table[start:stop], table.shape[1])
        return texels

    def _addresses_of_pixels(self) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
        """For each pixel (H,W) the address of its point's radiance, −1 where it has none, and −2 − i where it is mixed
        of several points, or of one that emits as well: their addresses and shares (as bits) begin at the i-th texel of
        the second array (rows,1024,2), the last share of a pixel negative."""
        frame = self.frame
        addresses = np.empty(frame.n_points, dtype=np.int32)
        for i_object, (start, stop) in enumerate(frame.object_ranges):
            base = self.object_rows(i_object)[0] * SAMPLES_PER_ROW
            addresses[start:stop] = base + sample_addresses(np.arange(stop - start))
        image = np.full(frame.height * frame.width, -1, dtype=np.int32)
        shown = np.flatnonzero(frame.share)
        is_whole = (frame.share[shown] == 1.0) & ~np.isin(frame.pixel[shown], frame.lamps.pixel)
        whole, parts = shown[is_whole], shown[~is_whole]
        image[frame.pixel[whole]] = addresses[whole]
        parts = parts[np.argsort(frame.pixel[parts], kind="stable")]
        first = np.flatnonzero(np.diff(frame.pixel[parts], prepend=-1))
        last = np.append(first[1:], len(parts))[: len(first)] - 1
        image[frame.pixel[parts[first]]] = -2 - first
        shares = frame.share[parts].astype(np.float32)
        shares[last] *= -1.0
        mixed = np.zeros((not_a_power_of_two(-(-len(parts) // SAMPLES_PER_ROW)), SAMPLES_PER_ROW, 2), dtype=np.int32)
        mixed.reshape(-1, 2)[: len(parts)] = np.stack([addresses[parts], shares.view(np.int32)], axis=1)
        return image.reshape(frame.height, frame.width), mixed

    def make_footprint(self, rows: NDArray[np.integer], weights: NDArray[np.floating]) -> FootprintTextures:
        """Textures of rows (P,4), indices into the samples of the pixel's own object, and weights (P,4)."""
        expected = (self.frame.n_points, 4)
        if rows.shape != expected or weights.shape != expected:
            raise GraphicsError(f"footprint of shapes {rows.shape} and {weights.shape}, expected {expected}")
        if rows.size and rows.min() < 0:
            raise GraphicsError(f"footprint row {rows.min()}, expected 0 or more")
        needed = [int(rows[start:stop].max(initial=-1)) + 1 for start, stop in self.frame.object_ranges]
        size = (SAMPLES_PER_ROW, self._n_rows)
        addresses = self._memory.texture(size, 4, "i4", self.pack(sample_addresses(rows), np.int32))
        try:
            packed = self._memory.texture(size, 4, "f4", self.pack(weights, np.float32))
        except GraphicsError:
            self._memory.release(addresses)
            raise
        return FootprintTextures(addresses, packed, np.array(needed, dtype=np.int64))

    def make_maps(self, i_object: int, samples: NDArray[np.float16]) -> MapTexture:
        """The texture of an object's samples (p,4), texture RGB and weight."""
        expected = (self.object_size(i_object), 4)
        if samples.shape != expected:
            raise GraphicsError(f"maps of shape {samples.shape}, expected {expected}")
        size = (SAMPLES_PER_ROW, row_count(len(samples)))
        return MapTexture(self._memory.texture(size, 4, "f2", pack_samples(samples, 4)), samples)

    def release_maps(self, maps: MapTexture | None) -> None:
        self._memory.release(None if maps is None else maps.texture)

    def release_footprint(self, footprint: FootprintTextures) -> None:
        self._memory.release(footprint.addresses)
        self._memory.release(footprint.weights)

    def set_environment(self, radiance: NDArray[np.floating] | None) -> None:
        """Set the lat-long map (H,W,3) seen behind everything; None is black."""
        if radiance is None:
            radiance = np.zeros((1, 1, 3), dtype=np.float32)
        if radiance.ndim != 3 or radiance.shape[2] != 3 or not np.isfinite(radiance).all():
            raise GraphicsError(f"environment of shape {radiance.shape}, expected (H, W, 3), all finite")
        made = self._memory.latlong(radiance)
        self._memory.release(self._environment)
        self._environment = made

    def set_emission(self, i_object: int, radiance: Sequence[float]) -> bool:
        """Set the radiance of an emitter's front, before its texture, where it is visible; returns whether that changes
        the backdrop."""
        lamps, wanted = self._lamps, np.asarray(radiance, dtype=np.float32)
        mine = lamps.object == i_object
        if not mine.any() or (lamps.emission[mine] == wanted).all():
            return False
        lamps.emission[mine] = wanted
        pixels = lamps.pixel[mine]
        there = np.isin(lamps.pixel, pixels)  # others may share them
        emitting = self._emitter_pixels.reshape(-1, 4)[:, :3]
        emitting[pixels] = 0.0
        np.add.at(emitting, lamps.pixel[there], lamps.seen[there])
        self._write(self._emission, self._emitter_pixels, box_of_pixels(pixels, self.frame.width))
        return True

    def set_moved_lamps(self, camera: Camera, lamps: tuple[ShownLamp, ...]) -> list[Box] | None:
        """Show lamps elsewhere than the frame has them, see `MovedLamps`; camera: the frame's. Returns the boxes of the
        picture that change, None where the backdrop does as well."""
        objects = tuple(sorted({lamp.i_object for lamp in lamps}))
        before, is_same = self._moved, objects == (() if self._moved is None else self._moved.objects)
        if is_same:
            return [] if self._moved is None else self._moved.place(lamps)
        self._moved = None
        if before is not None:
            self._fill(before.filled_box)
        if lamps:
            self._moved = MovedLamps(self._passes, self.frame, self._pointless, camera, objects)
            self._moved.place(lamps)
            self._fill(self._moved.filled_box)
        return None

    def _fill(self, box: Box) -> None:
        """Write a box of all that pixels show by themselves."""
        self._write(self._emission, self._emitter_pixels, box)
        self._write(self._pixel_addresses, self._addresses, box)
        self._write(self._distance_texture, self._distances, box)

    def _write(self, texture: moderngl.Texture, image: NDArray[np.generic], box: Box) -> None:
        """Write a box of an image (H,W) or (H,W,n) of the frame; pixels that show moved lamps take others' place."""
        x, y, width, height = box
        if not width:
            return
        part = np.ascontiguousarray(image[y : y + height, x : x + width])
        if self._moved is not None:
            row, column = np.divmod(self._moved.filled, self.frame.width)
            there = (row >= y) & (row < y + height) & (column >= x) & (column < x + width)
            flat = image.reshape(self.frame.height * self.frame.width, -1)
            part[row[there] - y, column[there] - x] = flat[self._moved.sources[there]].reshape(-1, *image.shape[2:])
        texture.write(part, viewport=box, alignment=1)

    def draw_backdrop(self, rotation_degrees: float, intensity: float, transparent: bool) -> None:
        """Redraw what is behind the surfaces; transparent: emitters alone, with alpha. Shadows on catchers have the
        environment behind them when the picture is composed."""
        if self._environment is None:
            self.set_environment(None)
        assert self._environment is not None
        program = self._passes.full_screen("placement/backdrop.frag.glsl")
        textures = {"emission": self._emission, "ray_directions": self._rays, "environment": self._environment}
        rotation = float(np.radians(rotation_degrees % 360.0))
        self._sky = {"rotation": rotation, "intensity": float(intensity), "transparent": int(transparent)}
        uniforms = self._sky | {"transparent": int(transparent or self._catching is not None)}
        self._passes.draw(program, self._backdrop_target, self.picture_box, textures, **uniforms)

    @property
    def catches(self) -> bool:
        """Whether shadows are shown in place of some objects."""
        return self._catching is not None

    def set_catchers(self, objects: Sequence[int], light: NDArray[np.floating] | None) -> bool:
        """Show of these objects only the shadows on them, see `Catching`; None: as they are. Returns whether the
        picture changes."""
        frame, before = self.frame, self._catching
        wanted = None if light is None or light.shape[:2] != (frame.height, frame.width) else light
        if before is None if wanted is None else before is not None and before.is_of(objects, wanted):
            return False
        self._catching = None
        if before is not None:
            before.release(self._memory)
        if wanted is not None:
            rows = np.zeros(self._n_rows, np.uint8)
            for first, count in map(self.object_rows, objects):
                rows[first : first + count] = 255
            self._catching = Catching(self._memory, tuple(objects), wanted, rows)
        return True

    @property
    def picture_box(self) -> Box:
        return 0, 0, self.frame.width, self.frame.height

    def shade(self, i_object: int, layers: Sequence[ShadedLayer]) -> None:
        """Sum the visible layers of an object; black when there are none."""
        first_row, n_rows = self.object_rows(i_object)
        if n_rows == 0:
            return
        box = (0, first_row, SAMPLES_PER_ROW, n_rows)
        drawn = [layer for layer in layers if layer.visible]
        if not drawn:
            self._shaded_target.use()
            self._shaded_target.clear(viewport=box)
        for i, layer in enumerate(drawn):
            self._shade_layer(layer, box, add=i > 0)

    def _shade_layer(self, layer: ShadedLayer, box: Box, add: bool) -> None:
        textures = {"accumulator": layer.accumulator.texture}
        uniforms: dict[str, Any] = {"gain": layer.gain}
        if layer.footprint is None or layer.maps is not None:
            uniforms["first_row"] = box[1]
        if layer.footprint is not None:
            textures["footprint_addresses"] = layer.footprint.addresses
            textures["footprint_weights"] = layer.footprint.weights
        if layer.indirect is not None:
            textures["indirect"] = layer.indirect.accumulator.texture
            textures["indirect_addresses"] = layer.indirect.footprint.addresses
            textures["indirect_weights"] = layer.indirect.footprint.weights
        if layer.view_curve is not None:
            textures["theta_o"], textures["view_curve"] = self._theta_o, layer.view_curve
            if layer.view_curve.height > 1:
                textures["coat_theta_o"] = self._coat_theta_o
        if layer.maps is not None:
            textures["maps"] = layer.maps.texture
            strength, inverts = layer.map_numbers
            uniforms |= {"texture_strength": strength, "inverts_weight": int(inverts)}
        program = self._passes.full_screen(
            "placement/shade.frag.glsl",
            FOOTPRINT=int(layer.footprint is not None),
            INDIRECT=int(layer.indirect is not None),
            VIEW_CURVE=0 if layer.view_curve is None else layer.view_curve.height,
            MAPS=int(layer.maps is not None),
        )
        self._passes.draw(program, self._shaded_target, box, textures, add=add, **uniforms)

    def composite(self, box: Box) -> None:
        """Redraw the linear picture inside `box`."""
        catching = self._catching
        program = self._passes.full_screen("placement/composite.frag.glsl", CATCHERS=int(catching is not None))
        textures = {
            "pixel_addresses": self._pixel_addresses, "mixed": self._mixed, "shaded": self.shaded,
            "backdrop": self.backdrop,
        }  # fmt: skip
        if catching is not None:
            assert self._environment is not None
            textures |= {"ray_directions": self._rays, "environment": self._environment, **catching.textures}
            self._passes.draw(program, self.linear_target, box, textures, **self._sky)
        else:
            self._passes.draw(program, self.linear_target, box, textures)
        if self._moved is not None:
            self._moved.draw(self.linear_target, box, self._distance_texture)

    def read_linear(self) -> NDArray[np.float32]:
        """The linear picture (H,W,4) with alpha; waits for the GPU."""
        return read_texture(self.linear, np.float32).astype(np.float32)

    def _keep(
        self, size: tuple[int, int], components: int, dtype: str, data: NDArray[np.generic] | None = None
    ) -> moderngl.Texture:
        texture = self._memory.texture(size, components, dtype, data)
        self._textures.append(texture)
        return texture

    def release(self) -> None:
        for framebuffer in self._framebuffers:
            self._memory.release_framebuffer(framebuffer)
        for texture in self._textures:
            self._memory.release(texture)
        self._memory.release(self._environment)
        if self._catching is not None:
            self._catching.release(self._memory)
            self._catching = None
        self._moved = None
        self._textures, self._framebuffers, self._environment = [], [], None


def require_sound(frame: PictureFrame) -> None:
    """Raise GraphicsError naming the array that does not fit."""
    image, n_image = (frame.height, frame.width), frame.width * frame.height
    shapes = {
        "object_ranges": (frame.object_ranges.shape, (frame.n_objects, 2)),
        "theta_o": (frame.theta_o.shape, (frame.n_points,)),
        "coat_theta_o": (frame.coat_theta_o.shape, (frame.n_points,)),
        "emission_image": (frame.emission_image.shape, (*image, 3)),
        "ray_directions": (frame.ray_directions.shape, (*image, 3)),
        "share": (frame.share.shape, (frame.n_points,)),
        "open_image": (frame.open_image.shape, image),
    }
    for name, (found, expected) in shapes.items():
        if found != expected:
            raise GraphicsError(f"{name} of shape {found}, expected {expected}")
    _refuse_outside("pixel", frame.pixel, n_image)
    _refuse_outside("object_ranges", frame.object_ranges, frame.n_points + 1)


def _refuse_outside(name: str, indices: NDArray[np.integer], end: int) -> None:
    if indices.size and (indices.min() < 0 or indices.max() >= end):
        raise GraphicsError(f"{name} holds {indices.min()} to {indices.max()}, expected 0 to {end - 1}")
