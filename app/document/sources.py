"""Sources that can be opened by name: recognized by the suffix, before anything is read.

A scene is a built-in one's name, a scene file, a mesh, which gets a floor of its own (`engine.scene.object_meshes`), or
a folder or a zip archive with one of these (`app.document.scene_files`). A session names a scene. An environment alone
opens the built-in scene lit by it.

Of a light probe the header is read, and its size tells the likely mapping: Debevec's angular maps are square, crosses
of a cube's faces 4 x 3 or 3 x 4, lat-long maps twice as wide as high; a user who drops a probe on the window should
not have to know. Where the guess is wrong, they can set it (`app.document.commands.light.SetMapping`).
"""

from __future__ import annotations

import os
import re
import struct
from dataclasses import dataclass
from pathlib import Path

from app.document.scene_files import (
    ARCHIVE_ENDING,
    SESSION_ENDING,
    Up,
    can_turn,
    renamed,
    scene_in_folder,
    split_axis,
    with_axis,
)
from app.system.paths import full_path
from engine.core.errors import InsituError
from engine.core.safe_files import exists, resolved
from engine.light import probe_mappings
from engine.light.probe_mappings import Mapping
from engine.measured.measurement import ENDINGS as MEASURED_ENDINGS
from engine.scene.builtin import DEFAULT_SCENE, builtin_scenes
from engine.scene.mesh import MESH_ENDINGS

SCENE_ENDINGS = (".toml", *MESH_ENDINGS, ARCHIVE_ENDING)
LIGHT_ENDINGS = (".exr", ".hdr", ".pic")
PICTURE_ENDINGS = (".png", ".jpg", ".jpeg", ".webp", ".ktx2")
# Of textures and maps; OpenEXR is light where none is asked for.
IMAGE_SUFFIXES = (*PICTURE_ENDINGS, ".exr")
EXPECTED = (
    f"a scene (.toml), a session ({SESSION_ENDING}), a mesh ({', '.join(MESH_ENDINGS)}), a folder or an archive "
    f"({ARCHIVE_ENDING}) with one scene, or light ({', '.join(LIGHT_ENDINGS)})"
)


@dataclass(frozen=True)
class Source:
    """A source to open: a scene by name or absolute path, under its own light or that of a file; or the session of that
    path, which names its scene."""

    scene: str = DEFAULT_SCENE
    light: Path | None = None
    session: Path | None = None


def source_of(name: str) -> Source:
    """The source of a name or path; it may not exist. Raises InsituError that says what it is instead, and what to
    do."""
    base, up = split_axis(name)
    is_builtin = base in builtin_scenes()
    path = scene_in_folder(Path(base)) if os.path.isdir(base) and not is_builtin else Path(base)
    if up == "z" and not can_turn(str(path)):
        raise InsituError(f"{base}: Z is up, expected a mesh ({', '.join(MESH_ENDINGS)}); other scenes are upright")
    if is_builtin:
        return Source(base)
    ending = path.suffix.lower()
    if ending in LIGHT_ENDINGS:
        return Source(light=resolved(path))
    if ending == SESSION_ENDING:
        return Source(session=resolved(path))
    if ending in SCENE_ENDINGS or not os.path.exists(path):
        return Source(renamed(name, full_path(str(path))))
    raise InsituError(f"{name}: {_describe_ending(ending)}")


def find_source(name: str | None, up: Up = "y") -> str:
    """The name of a built-in scene, or of an existing file that can be opened; up: the axis of a mesh that points up,
    where its name does not say it. Raises InsituError."""
    name = name or DEFAULT_SCENE
    name = with_axis(name, up) if up == "z" else name
    base = split_axis(name)[0]
    if base not in builtin_scenes() and not exists(base):
        there = ", ".join(builtin_scenes())
        raise InsituError(f"{name}: no such file, and no built-in scene of that name; built-in scenes are {there}")
    source_of(name)
    return name if name in builtin_scenes() else str(Path(name))


def _describe_ending(ending: str) -> str:
    """Describes a file that cannot be opened by its suffix, and says what to do with it."""
    if ending in MEASURED_ENDINGS:
        return "a measured BRDF, a material of its own; open a scene and import it onto an object there (File menu)"
    if ending in PICTURE_ENDINGS:
        return "a picture; open a scene and give it to a layer as its texture there (material panel)"
    return f"{'no file that is known' if ending else 'a file without an ending'}, expected {EXPECTED}"


HEADER_BYTES = 8192


def probe_size(file: Path) -> tuple[int, int] | None:
    """(width, height) of an OpenEXR or Radiance HDR image, by its header alone; None where that cannot be read."""
    if not os.path.isfile(file):
        return None
    try:
        with file.open("rb") as stream:
            head = stream.read(HEADER_BYTES)
    except OSError:
        return None
    windows = (
        rb"displayWindow\x00box2i\x00\x10\x00\x00\x00(.{16})",
        rb"dataWindow\x00box2i\x00\x10\x00\x00\x00(.{16})",
    )
    window = next(filter(None, (re.search(each, head, re.DOTALL) for each in windows)), None)
    if window is not None:
        left, top, right, bottom = struct.unpack("<4i", window.group(1))
        return right - left + 1, bottom - top + 1
    size = re.search(rb"\n[-+]([XY]) (\d{1,9}) [-+][XY] (\d{1,9})\r?\n", head)
    if size is None:
        return None
    first, second = int(size.group(2)), int(size.group(3))
    return (second, first) if size.group(1) == b"Y" else (first, second)


def likely_mapping(file: Path) -> Mapping:
    """The mapping that a probe's size suggests; "latlong" for what is no probe."""
    size = probe_size(file)
    return "latlong" if size is None else probe_mappings.likely_mapping(*size)
