"""Images that a mesh file names, files in its folder or inside it, each examined once; and those that it contains."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from engine.core.errors import LoadError
from engine.core.safe_files import find_inside, read_regular_file
from engine.scene.mesh import USD_ENDINGS
from engine.scene.variant_choice import parse_choices
from engine.texture.texture_files import MAX_IMAGE_BYTES, check_image, image_size, is_image, reduction

# Limit of pixels of all images of one file, plus more for every byte: a few kilobytes can claim millions of pixels.
# They are decoded when they are used, at 0.1 s a megapixel: at most 6 s for a small file, and never in the window's
# process.
MOST_PIXELS = 1 << 26
PIXELS_A_BYTE = 32


def decoding_cost(width: int, height: int) -> int:
    """The cost of an image in pixels: those that are shown, and an eighth for decoding what is reduced."""
    n_pixels, k = width * height, reduction(width, height)
    return n_pixels if k == 1 else n_pixels // k**2 + n_pixels // 8


class FileImages:
    """The images that one mesh file names, see `engine.core.safe_files.find_inside`. root: its folder."""

    def __init__(self, root: Path) -> None:
        self._root = root
        self._found: dict[tuple[Path, str], str | LoadError] = {}
        self._pixels_left = MOST_PIXELS

    def find(self, folder: Path, name: str) -> str:
        """The name, from the root, of an image that a file in `folder` names. Raises LoadError where there is none,
        where it is of no format that is read, or cut off, or has with those before it too many pixels."""
        key = folder, name
        if key not in self._found:
            try:
                self._found[key] = self._examined(folder, name)
            except LoadError as error:
                self._found[key] = error
        found = self._found[key]
        if isinstance(found, LoadError):
            raise found
        return found

    def _examined(self, folder: Path, name: str) -> str:
        path = find_inside(self._root, folder, name)
        if path is None:
            raise LoadError(name, "file", "not there", "an image in the mesh file's folder")
        data = read_regular_file(path, MAX_IMAGE_BYTES)
        if not is_image(data, path):
            raise LoadError(path, "format", path.suffix or "none", "PNG, JPEG, WebP, KTX 2 or OpenEXR")
        n_pixels = decoding_cost(*(image_size(data, path) or (0, 0)))
        self._pixels_left += PIXELS_A_BYTE * len(data)
        if n_pixels > self._pixels_left:
            raise LoadError(path, "pixels, with those of other images", n_pixels, f"at most {self._pixels_left}")
        check_image(data, path)
        self._pixels_left -= n_pixels
        return path.relative_to(self._root.resolve()).as_posix()


def image_reader(path: Path, choices: str = "") -> Callable[[int], bytes]:
    """A function from an image's number to its bytes in a glTF file or a .usdz archive, or of a computed map of
    MaterialX; it, too, raises LoadError. choices: the variants of a stage that it belongs to (`variant_choice`)."""
    if path.suffix.lower() == ".mtlx":
        from engine.scene.loaders.mtlx import mtlx_image_reader

        return mtlx_image_reader(path)
    if path.suffix.lower() in USD_ENDINGS:
        from engine.scene.loaders.usd import usd_image_reader

        return usd_image_reader(path, parse_choices(choices) or {})
    if path.suffix.lower() == ".3mf":
        from engine.scene.loaders.threemf import threemf_image_reader

        return threemf_image_reader(path)
    from engine.scene.loaders.gltf_buffers import gltf_image_reader

    return gltf_image_reader(path)
