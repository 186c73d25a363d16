"""The file of a scene that is named by the folder or the zip archive that it is in, and which way is up in a mesh.

A folder or an archive has one scene: the session at its top, where there is one (`app.export.package` writes such),
else its scene file, else its mesh. Where there are several, they are listed for the user to choose. A folder is
searched by names alone, without following links. An archive is unpacked into the cache, by the process that reads the
scene, and its document keeps the archive's name; only files that scenes can name are written, or all where there is a
session, whose archive has nothing else (`engine.core.zip_files` bounds and checks them).

A mesh whose Z axis points up is named `part.stl#z-up`, so that sessions, recent files and clusters keep the choice; and
a stage of USD with variants of its sets `kitchen.usd#shape=tall,size=big`.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import time
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Literal

from app.system.atomic import make_private_folder, replacing_folder, sweep_temporaries
from app.system.unpacked import ARCHIVE_ENDING, folder_of_archive, note_archive, unpacked_folder
from engine.core.errors import InsituError, LoadError, list_names
from engine.core.safe_files import add_unpacked, read_regular_file
from engine.scene.builtin import scene_path
from engine.scene.mesh import MATERIAL_ENDING, MAX_MESH_BYTES, MESH_ENDINGS, USD_ENDINGS
from engine.scene.toml_text import parse_toml_bytes
from engine.scene.variant_choice import choices_text, parse_choices

Up = Literal["y", "z"]
Z_UP = "#z-up"
SESSION_ENDING = ".insitu"
_SCENE_ENDING = ".toml"
_WITH_VARIANTS = (*USD_ENDINGS, ARCHIVE_ENDING)
# Files that are written of an archive without a session: scenes, meshes, and what these name.
_USED = (
    SESSION_ENDING, _SCENE_ENDING, *MESH_ENDINGS, ".mtl", ".bin", ".png", ".jpg", ".jpeg", ".exr", ".hdr", ".pic",
    ".webp", ".ktx2", ".binary", ".brdf", ".bsdf", ".csv",
)  # fmt: skip
_MOST_ENTRIES, _DEEPEST = 4096, 8
# In the folder of an unpacked archive: the name of its scene, and in a second line that of its session, if it has one.
_NOTE = ".scene"
_MOST_KEPT, _KEPT_SECONDS = 8, 24 * 3600.0


def split_axis(source: str) -> tuple[str, Up]:
    """The name of a scene without what is chosen of it, and the axis of a mesh that points up."""
    name, _, up = _parts(source)
    return name, up


def with_axis(source: str, up: Up) -> str:
    """The name of a scene with this axis of its mesh up."""
    name, chosen, _ = _parts(source)
    return _named(name, chosen, up)


def variants_of(source: str) -> dict[str, str]:
    """The variants that are chosen of a stage, by the names of their sets."""
    return _parts(source)[1]


def with_variants(source: str, chosen: Mapping[str, str]) -> str:
    """The name of a scene with these variants besides those that it has."""
    name, before, up = _parts(source)
    return _named(name, before | dict(chosen), up)


def renamed(source: str, name: str) -> str:
    """Another name with what is chosen of a scene."""
    _, chosen, up = _parts(source)
    return _named(name, chosen, up)


def has_variants(source: str) -> bool:
    """Whether a scene may have sets of variants: a stage of USD, or one that may be in an archive."""
    return split_axis(source)[0].lower().endswith(_WITH_VARIANTS)


def _parts(source: str) -> tuple[str, dict[str, str], Up]:
    """The name of a scene, the variants and the axis that are chosen."""
    up: Up = "z" if source.endswith(Z_UP) else "y"
    whole = source.removesuffix(Z_UP)
    name, mark, text = whole.rpartition("#")
    chosen = parse_choices(text) if mark and name.lower().endswith(_WITH_VARIANTS) else None
    return (whole, {}, up) if chosen is None else (name, chosen, up)


def _named(name: str, chosen: Mapping[str, str], up: Up) -> str:
    return name + (f"#{choices_text(chosen)}" if chosen else "") + (Z_UP if up == "z" else "")


def can_turn(source: str) -> bool:
    """Whether a scene is a mesh that was opened alone, or may be one in an archive."""
    return split_axis(source)[0].lower().endswith((*MESH_ENDINGS, ARCHIVE_ENDING))


def is_archive(source: str) -> bool:
    """Whether a scene is in a zip archive."""
    return split_axis(source)[0].lower().endswith(ARCHIVE_ENDING)


def scene_file(source: str) -> Path:
    """The file of a scene: a built-in one, its own path, or its path among the files of an archive, where that is
    unpacked (`unpacked_scene_file`), else the archive's."""
    path = scene_path(split_axis(source)[0])
    return (_unpacked(path) or path) if is_archive(source) else path


def unpacked_scene_file(source: str) -> Path:
    """The same; an archive is unpacked before. Raises InsituError."""
    path = scene_path(split_axis(source)[0])
    return (_unpacked(path) or _unpack(path)) if is_archive(source) else path


def files_of_scene(source: str) -> set[Path]:
    """A scene's file, and the archive that it is in."""
    return {scene_file(source)} | ({scene_path(split_axis(source)[0])} if is_archive(source) else set())


def scene_in_folder(folder: Path) -> Path:
    """The one scene of a folder, which links do not belong to. Raises InsituError that lists the scenes where there are
    several. The window's process calls it: 4,096 entries take 10 ms."""
    names: list[str] = []
    n_entries, left = 0, [("", 0)]
    while left:
        inside, depth = left.pop()
        with contextlib.suppress(OSError), os.scandir(folder / inside) as entries:  # what cannot be listed is left out
            for entry in entries:
                n_entries += 1
                if n_entries > _MOST_ENTRIES:
                    raise InsituError(f"{folder}: a folder of more than {_MOST_ENTRIES} files; open the scene in it")
                name = f"{inside}/{entry.name}" if inside else entry.name
                if entry.is_dir(follow_symlinks=False):
                    if depth < _DEEPEST and not entry.name.startswith("."):
                        left.append((name, depth + 1))
                elif not entry.is_symlink():
                    names.append(name)
    return folder / _only_scene(names, folder)


def is_folder_of_scene(path: Path) -> bool:
    """Whether it is a folder that can be opened."""
    if not os.path.isdir(path):
        return False
    try:
        scene_in_folder(path)
    except InsituError:
        return False
    return True


def _only_scene(names: Iterable[str], where: Path) -> str:
    """The one session among names, at the top, else the one scene file, else the one mesh, else the one file of
    materials."""
    found = [name for name in sorted(names) if not any(part.startswith((".", "__MACOSX")) for part in name.split("/"))]
    sessions = [name for name in found if name.lower().endswith(SESSION_ENDING) and "/" not in name]
    if len(sessions) == 1:
        return sessions[0]
    scenes = [name for name in found if name.lower().endswith(_SCENE_ENDING)]
    meshes = [name for name in found if name.lower().endswith(MESH_ENDINGS)]
    # Materials lie beside the mesh that has them.
    scenes = scenes or [name for name in meshes if not name.lower().endswith(MATERIAL_ENDING)] or meshes
    if not scenes:
        raise InsituError(f"{where}: no scene in it, expected a scene (.toml) or a mesh ({', '.join(MESH_ENDINGS)})")
    if len(scenes) > 1:
        listed = list_names(scenes)
        raise InsituError(f"{where}: {len(scenes)} scenes in it, expected one: {listed}; open one of them itself")
    return scenes[0]


# ---------------------------------------------------------------------------------------------------------- archives


def _unpacked(archive: Path) -> Path | None:
    """The scene of an archive that is unpacked; None where it is not."""
    try:
        folder = folder_of_archive(archive)
        scene, _ = _noted(folder)
        os.utime(folder)
        add_unpacked(folder)
    except (OSError, ValueError):
        return None
    return scene if scene.is_file() else None


def session_of_archive(source: str) -> Path | None:
    """The session of an archive that is unpacked; None where it has none, or is not."""
    archive = scene_path(split_axis(source)[0])
    try:
        return _noted(folder_of_archive(archive))[1] if is_archive(source) else None
    except (OSError, ValueError):
        return None


def _noted(folder: Path) -> tuple[Path, Path | None]:
    """The scene and the session of an unpacked archive. Raises OSError or ValueError."""
    scene, session, *_ = [*(folder / _NOTE).read_text(encoding="utf-8").split("\n"), ""]
    return folder / scene, folder / session if session else None


def _unpack(archive: Path) -> Path:
    """Unpack an archive; returns its scene. Raises InsituError."""
    from engine.core.zip_files import ZipArchive

    found = ZipArchive(read_regular_file(archive, MAX_MESH_BYTES), archive)
    scene, session = _only_scene(found.names, archive), ""
    if scene.lower().endswith(SESSION_ENDING):
        scene, session = _scene_of_session(found.read(scene), archive / scene), scene
    make_private_folder(unpacked_folder())
    folder = folder_of_archive(archive)
    sweep_temporaries(folder.parent)
    _forget_oldest(folder.parent)
    with replacing_folder(folder) as part:
        for name in (name for name in found.names if session or name.lower().endswith(_USED)):
            path = part / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(found.read(name))
        note_archive(part, archive)
        (part / _NOTE).write_text(f"{scene}\n{session}", encoding="utf-8")
    add_unpacked(folder)
    return _noted(folder)[0]


def _scene_of_session(data: bytes, path: Path) -> str:
    """The file of the scene that a session in an archive names. Raises LoadError."""
    named = parse_toml_bytes(data, path).get("scene")
    scene = split_axis(named)[0] if isinstance(named, str) else ""
    if not scene or os.path.isabs(scene) or ".." in Path(scene).parts:
        raise LoadError(path, "scene", named, "a file of the same archive")
    return scene


def _forget_oldest(parent: Path) -> None:
    """Remove archives that were unpacked and have not been opened for a day, except the last few."""
    opened = list[tuple[float, Path]]()
    for path in parent.iterdir():
        with contextlib.suppress(OSError):  # another process may remove it now
            opened += [(path.stat().st_mtime, path)] if path.is_dir() else []
    for when, path in sorted(opened, reverse=True)[_MOST_KEPT:]:
        if when < time.time() - _KEPT_SECONDS:
            shutil.rmtree(path, ignore_errors=True)
