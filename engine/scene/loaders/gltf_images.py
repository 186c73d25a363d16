"""The images of a GLB file: in its binary chunk, as data in its JSON, or files beside it. Returns bytes, not pixels."""

from __future__ import annotations

import base64
import binascii
from collections.abc import Callable
from functools import partial
from pathlib import Path
from urllib.parse import unquote

from engine.core.safe_files import read_regular_file, resolve_inside
from engine.scene.loaders.glb import MAX_ITEMS, JsonObject, parse_glb
from engine.scene.mesh import MAX_MESH_BYTES

MAX_IMAGE_BYTES = 256 * 2**20


def image_reader(path: Path) -> Callable[[int], bytes]:
    """Return a function from an image's number to its bytes in a GLB file; it, too, raises LoadError naming the place
    and what was expected there."""
    return partial(image_bytes, *parse_glb(read_regular_file(path, MAX_MESH_BYTES), path))


def image_bytes(root: JsonObject, binary: bytes, index: int) -> bytes:
    """The bytes of an image of a file that was read already: its root and its binary chunk."""
    image = root.item("images", index)
    if image is None:
        there = len(root.values.get("images", []))
        raise root.error(f"images {index}", "nothing", f"an image from 0 to {there - 1}" if there else "images")
    uri = image.text("uri")
    if uri is None:
        return _from_chunk(root, image, binary)
    if uri.startswith("data:"):
        return _from_data(image, uri)
    place = resolve_inside(root.file.parent, unquote(uri), root.file, f"{image.place}: uri")
    return read_regular_file(place, MAX_IMAGE_BYTES)


def _from_chunk(root: JsonObject, image: JsonObject, binary: bytes) -> bytes:
    """The bytes of a buffer view."""
    index = image.integer("bufferView", 0, MAX_ITEMS)
    view = root.item("bufferViews", index)
    if view is None:
        raise image.error("bufferView", index, f"an integer from 0 to {len(root.children('bufferViews')) - 1}")
    view.integer("buffer", 0, 0)
    start = view.integer("byteOffset", 0, len(binary), 0)
    return binary[start : start + view.integer("byteLength", 1, len(binary) - start)]


def _from_data(image: JsonObject, uri: str) -> bytes:
    """The bytes of a `data:` URI in base64."""
    kind, comma, text = uri.partition(",")
    try:
        if not comma or not kind.endswith(";base64"):
            raise ValueError
        return base64.b64decode(text, validate=True)
    except (ValueError, binascii.Error):
        raise image.error("uri", uri, "data in base64") from None
