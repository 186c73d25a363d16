"""The images of one scene, each read once.

A name in a scene file is relative to the scene's folder and may not leave it; a full path is one that the user chose.
An image of a glTF or 3MF file is named `FILE.glb#N`, the Nth of its images; `FILE.mtlx#N` is the Nth map that a network
of MaterialX computes, and `FILE.usdz#N` the Nth file of an archive.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import partial, reduce
from itertools import zip_longest
from pathlib import Path
from threading import Lock
from weakref import ref

import numpy as np
from numpy.typing import NDArray

from engine.core.errors import LoadError
from engine.core.safe_files import local_path, read_regular_file, resolve_inside
from engine.material.bumps import Bumps
from engine.material.layer_maps import Channel, ChannelImage, Images, Space, split_image_name
from engine.material.opacity import Opacity
from engine.material.parameter_maps import ChannelStatistics, channel_statistics
from engine.texture.node_images import blend_node_images
from engine.texture.pyramid import Pyramid, make_pyramid
from engine.texture.texture_files import (
    MAX_IMAGE_BYTES,
    Image,
    read_direction_vectors,
    read_directions,
    read_heights,
    read_normal_map,
    read_opacity,
    read_texture,
    read_weight,
)

MOST_BYTES = 1 << 30
Stamp = tuple[int, int] | None


class TextureStore:
    """Pyramids by name, the most recently used ones up to a gibibyte; a file that has been written since is read again.
    Safe to use from several threads."""

    def __init__(self, scene_file: Path) -> None:
        """scene_file: errors name it, and names are relative to its folder."""
        self._scene_file = scene_file
        self._kept: OrderedDict[tuple[str, str, Space, float, Channel], tuple[Stamp, Pyramid]] = OrderedDict()
        # Textures of nodes, with the images that they were made of; statistics with theirs: neither keeps one alive.
        self._nodes: OrderedDict[Images, tuple[list[ref[Pyramid]], Pyramid]] = OrderedDict()
        self._statistics: dict[ChannelImage, tuple[ref[Pyramid], ChannelStatistics]] = {}
        self._lock = Lock()
        self._notes: list[str] = []
        # Readers of files with several images, during loading.
        self._files: dict[tuple[Path, str], Callable[[int], bytes]] | None = None

    def texture(self, images: Images) -> Pyramid | None:
        """Linear RGB of the texture, of a node times its weight; None if there is none. Of images in several sets of
        texture coordinates ask for each of `Images.textures`. Raises LoadError."""
        if images.node is not None:
            return self._node_texture(images)
        if not images.texture:
            return None
        return self._pyramid("texture", images.texture, images.texture_space).with_transform(images.texture_transform)

    def weight(self, images: Images) -> Pyramid | None:
        """Shares of the weight map; None if there is none. Raises LoadError."""
        return self._pyramid("weight", images.weight, "", channel=images.weight_channel) if images.weight else None

    def channel_statistics(self, image: ChannelImage) -> ChannelStatistics:
        """The statistics of one channel of an image of numbers. Raises LoadError."""
        pyramid = self.numbers(image)
        with self._lock:
            known, statistics = self._statistics.get(image, (None, None))
        if statistics is None or known is None or known() is not pyramid:
            statistics = channel_statistics(pyramid.levels[0])
            with self._lock:
                self._statistics[image] = ref(pyramid), statistics
        return statistics

    def slopes(self, bumps: Bumps) -> Pyramid | None:
        """Slopes along u and v of a normal or a bump map; None if there is none. Raises LoadError."""
        if not bumps.file:
            return None
        what = "flipped_normal_map" if bumps.normal_map and bumps.flip_green else bumps.kind
        return self._pyramid(what, bumps.file, "").with_transform(bumps.transform)

    def directions(self, bumps: Bumps) -> Pyramid | None:
        """(cos 2θ, sin 2θ) of a map's angles θ of tangents; None if there is none. Raises LoadError."""
        if bumps.tangent_map and bumps.tangent_vectors:
            return self._pyramid("tangent_vectors", bumps.tangent_map, "")
        if not bumps.tangent_map or not bumps.tangent_range:
            return None
        return self._pyramid("tangent_map", bumps.tangent_map, "", bumps.tangent_range)

    def opacity(self, opacity: Opacity) -> Pyramid | None:
        """Opacities of an image; None if there is none. Raises LoadError."""
        if not opacity.opacity_map:
            return None
        return self._pyramid("opacity_map", opacity.opacity_map, "").with_transform(opacity.transform)

    def load(
        self, wanted: Iterable[Images], bumps: Iterable[Bumps] = (), opacities: Iterable[Opacity] = (),
        channels: Iterable[ChannelImage] = (),
    ) -> None:  # fmt: skip
        """Read named images that are not loaded yet, a file of several images once. Raises LoadError."""
        with self.open_files():
            for images in wanted:
                for of_set in images.textures:
                    self.texture(of_set)
                self.weight(images)
            for each in bumps:
                self.slopes(each)
                self.directions(each)
            for opacity in opacities:
                self.opacity(opacity)
            for channel in channels:
                self.numbers(channel)

    @contextmanager
    def open_files(self) -> Iterator[None]:
        """Keep files of several images open meanwhile."""
        self._files = {}
        try:
            yield
        finally:
            self._files = None

    def numbers(self, image: ChannelImage) -> Pyramid:
        """A channel of an image, in its mapping. Raises LoadError."""
        return self._pyramid("weight", image.file, "", channel=image.channel).with_transform(image.transform)

    def _node_texture(self, images: Images) -> Pyramid:
        """The texture of a node: see `blend_node_images`. It is made anew where an image was."""
        images = images.without_strokes
        assert images.node is not None
        own = self.texture(images.without_node)
        numbers = [self.numbers(each.image) for each in images.node.weights]
        sources = [*([] if own is None else [own]), *numbers]
        with self._lock:
            known, pyramid = self._nodes.pop(images, ([], None))
            if pyramid is None or any(a is None or a() is not b for a, b in zip_longest(known, sources)):
                pyramid = blend_node_images(images, own, numbers)
            self._nodes[images] = [ref(each) for each in sources], pyramid
            while len(self._nodes) > 1 and sum(each.n_bytes for _, each in self._nodes.values()) > MOST_BYTES:
                self._nodes.popitem(last=False)
        return pyramid

    def take_notes(self) -> tuple[str, ...]:
        """Notes on images that were read since the last call: which are shown at reduced size."""
        with self._lock:
            notes, self._notes[:] = tuple(self._notes), []
        return notes

    def _pyramid(self, what: str, name: str, space: Space, degrees: float = 0.0, channel: Channel = "grey") -> Pyramid:
        key = (what, name, space, degrees, channel)
        path, number, choices = self._place(what, name)
        stamp = _stamp(path)
        with self._lock:
            before, pyramid = self._kept.get(key, (None, None))
            if pyramid is None or before != stamp:
                data, shown = self._read(path, number, choices)
                pyramid = make_pyramid(
                    read_texture(data, shown, space, self._notes.append) if space
                    else read_directions(data, shown, degrees, self._notes.append) if degrees
                    else read_weight(data, shown, self._notes.append, channel) if what == "weight"
                    else _READ[what](data, shown, report=self._notes.append)
                )  # fmt: skip
                self._kept[key] = stamp, pyramid
                self._forget_oldest()
            self._kept.move_to_end(key)
            return pyramid

    def _forget_oldest(self) -> None:
        while len(self._kept) > 1 and sum(each.n_bytes for _, each in self._kept.values()) > MOST_BYTES:
            self._kept.popitem(last=False)

    def _read(self, path: Path, number: int | None, choices: str) -> tuple[bytes, str]:
        """The bytes of an image, and its name in errors."""
        if number is None:
            return read_regular_file(path, MAX_IMAGE_BYTES), str(path)
        from engine.scene.loaders.image_files import image_reader

        reader = (self._files or {}).get((path, choices)) or image_reader(path, choices)
        if self._files is not None:
            self._files[path, choices] = reader
        return reader(number), f"{path}#{number}"

    def _place(self, what: str, name: str) -> tuple[Path, int | None, str]:
        """The path of an image, its number in a file of several, and the choices there that it belongs to."""
        file, number = split_image_name(name)
        number, choices = (None, "") if number is None else number.partition("@")[::2]
        if number is not None and not (number.isascii() and number.isdecimal() and len(number) < 6):
            raise LoadError(self._scene_file, what, name, "FILE.glb#N, .gltf, .3mf, .mtlx or .usdz, with a number")
        path = Path(file)
        if not path.is_absolute():
            path = resolve_inside(self._scene_file.parent, str(path), self._scene_file, what)
        return path, None if number is None else int(number), choices


_READ: dict[str, Callable[..., Image]] = {
    "texture": read_texture, "normal_map": read_normal_map, "bump_map": read_heights,
    "flipped_normal_map": partial(read_normal_map, flip_green=True), "opacity_map": read_opacity,
    "tangent_vectors": read_direction_vectors,
}  # fmt: skip


def sample_images(
    images: Images, store: TextureStore, n: int,
    sample: Callable[[Pyramid, tuple[float, float]], NDArray[np.float32]],
    vertex_colours: Callable[[], NDArray[np.float32]],
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:  # fmt: skip
    """Texture (N, 3) and weight (N,) without strokes; sample: returns n values of an image with these repeats;
    vertex_colours: those of the mesh there, (N, 3 or more), asked for where they multiply the texture."""
    textures, weight = [(store.texture(each), each.texture_scale) for each in images.textures], store.weight(images)
    factors = [sample(texture, scale) for texture, scale in textures if texture is not None]
    colours = reduce(np.multiply, factors) if factors else np.ones((n, 3), np.float32)
    shares = np.full(n, images.weight_start, np.float32)
    if weight is not None:
        shares = sample(weight, (1.0, 1.0))[:, 0]
    if images.vertex_colours:
        colours = colours * vertex_colours()[:, :3]
    return colours, shares


def _stamp(path: Path) -> Stamp:
    """Changes when a file is written; None for a missing file, which reading it will report."""
    try:
        status = local_path(path).stat()
    except (OSError, ValueError):
        return None
    return status.st_mtime_ns, status.st_size
