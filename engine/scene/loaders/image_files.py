"""Images that a mesh file names: files in its folder or inside it."""

from __future__ import annotations

from pathlib import Path

from engine.core.errors import LoadError
from engine.core.safe_files import find_inside, read_regular_file
from engine.texture.texture_files import MAX_IMAGE_BYTES, check_image, is_image


def find_image(root: Path, folder: Path, name: str) -> str:
    """The name, from `root`, of an image that a file in `folder` names, see `engine.core.safe_files.find_inside`.
    Raises LoadError where there is none, where it is of no format that is read, or cut off."""
    path = find_inside(root, folder, name)
    if path is None:
        raise LoadError(name, "file", "not there", "an image in the mesh file's folder")
    data = read_regular_file(path, MAX_IMAGE_BYTES)
    if not is_image(data, path):
        raise LoadError(path, "format", path.suffix or "none", "PNG, JPEG, WebP, KTX 2 or OpenEXR")
    check_image(data, path)
    return path.relative_to(root.resolve()).as_posix()
