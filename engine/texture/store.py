"""The images of one scene, each read once.

A name in a scene file is relative to the scene's folder and may not leave it; a full path is what a person chose. A
picture inside a GLB file is named `FILE.glb#N`, the Nth of its images.
"""

from __future__ import annotations

from collections import OrderedDict
from pathlib import Path
from threading import Lock

from engine.errors import LoadError
from engine.material.maps import Images, Space
from engine.scene.files import read_regular_file, resolve_inside
from engine.texture.images import MAX_IMAGE_BYTES, read_texture, read_weight
from engine.texture.pyramid import Pyramid, make_pyramid

MOST_BYTES = 1 << 30


class TextureStore:
    """Pyramids by name, the ones used last up to a gibibyte. Safe to use from several threads."""

    def __init__(self, scene_file: Path) -> None:
        """scene_file: errors name it, and names are relative to its folder."""
        self._scene_file = scene_file
        self._kept: OrderedDict[tuple[str, str, Space], Pyramid] = OrderedDict()
        self._lock = Lock()

    def texture(self, images: Images) -> Pyramid | None:
        """Linear RGB of the texture; None where there is none. Raises LoadError."""
        return self._pyramid("texture", images.texture, images.texture_space) if images.texture else None

    def weight(self, images: Images) -> Pyramid | None:
        """Shares of the weight map; None where there is none. Raises LoadError."""
        return self._pyramid("weight", images.weight, "linear") if images.weight else None

    def load(self, images: Images) -> None:
        """Read what is named and not there yet. Raises LoadError."""
        self.texture(images)
        self.weight(images)

    def _pyramid(self, what: str, name: str, space: Space) -> Pyramid:
        key = (what, name, space)
        with self._lock:
            if key not in self._kept:
                data, shown = self._read(what, name)
                pixels = read_texture(data, shown, space) if what == "texture" else read_weight(data, shown)
                self._kept[key] = make_pyramid(pixels)
                self._forget_oldest()
            self._kept.move_to_end(key)
            return self._kept[key]

    def _forget_oldest(self) -> None:
        while len(self._kept) > 1 and sum(each.n_bytes for each in self._kept.values()) > MOST_BYTES:
            self._kept.popitem(last=False)

    def _read(self, what: str, name: str) -> tuple[bytes, str]:
        """The bytes of an image, and what errors call it."""
        file, mark, number = name.rpartition("#")
        inside = mark and file.lower().endswith(".glb")
        path = Path(file if inside else name)
        if not path.is_absolute():
            path = resolve_inside(self._scene_file.parent, str(path), self._scene_file, what)
        if not inside:
            return read_regular_file(path, MAX_IMAGE_BYTES), str(path)
        if not (number.isascii() and number.isdecimal() and len(number) < 6):
            raise LoadError(self._scene_file, what, name, "FILE.glb#N with the number of an image")
        from engine.scene.gltf_images import read_image

        return read_image(path, int(number)), f"{path}#{number}"
