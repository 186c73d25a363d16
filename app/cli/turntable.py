"""Pictures from all around a scene, or all through its animation, a file each: what `insitu render --turntable` and
`--frames` do.

A complete frame that exists is reused, so that interrupted work continues where it was. A file beside the frames has
the key of all that they depend on, and lists the files that were written; under another key those are removed, even if
they are more than wanted now, and all are drawn anew. Files that were not written here, or were changed since, are not
touched.

The key is made of every field of the project, whatever fields are added, so that none can be forgotten: a project whose
picture may differ has another key; a value of an unknown kind is an error and not left out. Files that are read again
while a picture is drawn count by their contents.
"""

from __future__ import annotations

import dataclasses
import hashlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel

from app.document.named_files import files_of_document
from app.project.project import Project
from app.stills.frame_sequence import Draw, Frames, Report, draw_here, estimate_frame_error, poses_of
from app.stills.stills import ENDINGS, picture_bytes
from app.system.atomic import make_folder_of, require_place, save_file
from app.worker.cache import KeyPart, content_key
from engine.core.colour import AnyView
from engine.core.errors import InsituError
from engine.light.radiance_files import read_radiance_image
from engine.material.model import Model
from engine.scene.composed_scene import SceneComposer
from engine.texture.texture_files import read_texture
from engine.texture.texture_store import TextureStore


def picture_key(project: Project, *settings: object) -> str:
    """The key of a project, and of the settings of its drawing."""
    files = project.scene.files | files_of_document(project.document)
    return content_key(parts_of(project), parts_of(settings), tuple(_contents(file) for file in sorted(files)))


def parts_of(value: object) -> KeyPart:
    """A value as a part of a cache key, field by field. Raises TypeError for one of an unknown kind."""
    match value:
        case None | str() | bool() | int() | float() | bytes() | np.ndarray():
            return value
        case np.generic():
            return np.asarray(value)
        case Path():
            return str(value)
        case Enum():
            return type(value).__name__, value.name
        case Model():
            return value.name  # there is one instance of each
        case TextureStore() | SceneComposer():
            return None  # what was read already; its files count by their contents
        case BaseModel():
            return _named(value, type(value).model_fields)
        case tuple() | list():
            return tuple(map(parts_of, value))
        case set() | frozenset():
            return tuple(sorted(content_key(parts_of(each)) for each in value))
        case Mapping():
            return tuple((parts_of(key), parts_of(each)) for key, each in value.items())
    if dataclasses.is_dataclass(value):
        return _named(value, [field.name for field in dataclasses.fields(value)])
    raise TypeError(f"{type(value).__name__} in what a picture depends on: say how it counts")


def _named(value: object, names: Iterable[str]) -> KeyPart:
    return type(value).__name__, tuple((name, parts_of(getattr(value, name))) for name in names)


def _contents(file: Path) -> KeyPart:
    """The content of a file, by its name; None where it cannot be read, which its reader reports."""
    try:
        with file.open("rb") as opened:
            return str(file), hashlib.file_digest(opened, "blake2b").digest()
    except (OSError, ValueError):
        return str(file), None


RECORD = ".turntable"


@dataclass(frozen=True)
class FrameFiles:
    """The files of a turn: `count` of them in a folder, as `stem`0000`ending`."""

    folder: Path
    count: int
    stem: str = ""
    ending: str = ".png"

    @classmethod
    def of(cls, output: Path, count: int) -> FrameFiles:
        """The files as the user names them: a folder, or in it a file's name, whose stem and suffix theirs then
        have."""
        if output.suffix.lower() in ENDINGS:
            return cls(output.parent, count, f"{output.stem}-", output.suffix.lower())
        if output.suffix and not output.is_dir():
            raise InsituError(
                f"{output}: expected a folder for the frames, or a name that ends in {' or '.join(ENDINGS)}"
            )
        return cls(output, count)

    def path(self, i: int) -> Path:
        return self.folder / f"{self.stem}{i:04d}{self.ending}"

    @property
    def record(self) -> Path:
        """The file that has the key, and the list of written files."""
        return self.folder / f"{RECORD}-{self.stem}{self.ending[1:]}"

    def missing(self, key: str, resolution: tuple[int, int]) -> list[int]:
        """Which of them are to be drawn; the key is stored for the next time, and frames under another one are removed.
        Raises InsituError, also where there are files of such names that no turn has written: they are the user's
        own."""
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            known, written = self._read_record()
            if known != key:
                there = {name: self.folder / name for name in written if (self.folder / name).is_file()}
                own = [name for name, path in there.items() if _digest(path.read_bytes()) == written[name]]
                others = [path for path in map(self.path, range(self.count)) if path.exists() and path.name not in own]
                if others:
                    said = (
                        "changed since it was drawn" if others[0].name in written else "not a frame of an earlier turn"
                    )
                    raise InsituError(f"{others[0]}: {said}; expected a folder without such files")
                for name in own:
                    (self.folder / name).unlink()
                self._write_record(key, {})
        except (OSError, UnicodeDecodeError) as error:
            raise InsituError(f"{self.folder}: the folder cannot be used, {error}") from error
        return [i for i in range(self.count) if not _is_whole(self.path(i), resolution)]

    def write(self, i: int, picture: NDArray[np.float32], view: AnyView) -> None:
        """Write a frame to its file, which is listed before. Raises InsituError."""
        content, (key, written) = picture_bytes(self.path(i), picture, view), self._read_record()
        self._write_record(key, {**written, self.path(i).name: _digest(content)})
        save_file(self.path(i), content)

    def _read_record(self) -> tuple[str, dict[str, str]]:
        """The key of the present frames, "" where there are none, and the digests of the written files, by name."""
        if not self.record.exists():
            return "", {}
        key, *lines = self.record.read_text().splitlines() or [""]
        return key, {name: content for content, _, name in (line.partition(" ") for line in lines)}

    def _write_record(self, key: str, written: Mapping[str, str]) -> None:
        save_file(self.record, "\n".join([key, *(f"{content} {name}" for name, content in written.items())]).encode())


def draw_frames(
    project: Project, frames: Frames, files: FrameFiles, report: Report, view: AnyView = "filmic",
    draw: Draw = draw_here,
) -> tuple[int, str]:  # fmt: skip
    """Draw the missing frames, here or where `draw` does; returns how many they were, and in Deform the error of the
    middle one of them, as one line, else "". Raises InsituError."""
    if frames.animated:
        poses_of(project, frames.count)  # without an animation no file is touched
    make_folder_of(files.record)
    require_place(*map(files.path, range(files.count)), files.record)
    missing = files.missing(picture_key(project, frames, view), project.scene.resolution)
    drawn, error, estimated = 0, "", missing[len(missing) // 2] if missing and frames.mode == "deform" else -1
    for i, picture in draw(project, frames, missing, report):
        files.write(i, picture, view)
        drawn += 1
        if i == estimated and (said := estimate_frame_error(project, frames, i, picture)):
            error = f"frame {i}: {said}; what moves casts coarse shadows, a still by --time has finer ones"
    return drawn, error


def _is_whole(path: Path, resolution: tuple[int, int]) -> bool:
    """Whether a frame is there, to its last pixel."""
    try:
        found = read_radiance_image(path) if path.suffix == ".exr" else read_texture(path.read_bytes(), path)
    except (OSError, InsituError):
        return False
    return found.shape[1::-1] == resolution


def _digest(content: bytes) -> str:
    return hashlib.blake2b(content, digest_size=20).hexdigest()
