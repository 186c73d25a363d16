"""Pictures from all around a scene, or all through its animation, a file each: what `insitu render --turntable` and
`--frames` do.

The camera goes round its target once, in equal steps from where the scene has it; the animation goes on in equal steps
from its start, so that the first frame follows the last. A frame that is there and whole is
kept, so that work that was stopped goes on where it was; a file beside the frames has the digest of all that they
depend on, and under another one all are drawn anew.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from app.commands import SetTime
from app.files.session import dump_session
from app.jobs.cache import content_key
from app.machine.atomic import save_file
from app.project import Project
from app.stills import (
    ENDINGS,
    Mode,
    StillProgress,
    prepared_deform,
    prepared_orbit,
    render_project,
    write_picture,
)
from app.timeline import timeline
from app.view_state import ViewState
from engine.colour import ToneMapping
from engine.deform.pose import Poses
from engine.deform.posed_scene import posed
from engine.errors import InsituError
from engine.indirect.beyond import BRIGHTEST, held
from engine.indirect.series import BounceSeries
from engine.light.image_files import read_radiance_image
from engine.scene.camera_moves import orbited
from engine.scene.description import Camera
from engine.scene.load import Scene
from engine.texture.images import read_texture
from engine.texture.store import TextureStore

DIGEST = ".turntable"
_PREPARING = 0.3  # of the work, what is done once for all frames of Orbit
_PREPARING_POSES = 0.95  # and of Deform

Report = Callable[[StillProgress], None]
Picture = NDArray[np.float32]


@dataclass(frozen=True)
class Frames:
    """The files of a turn: `count` of them in a folder, as `stem`0000`ending`."""

    folder: Path
    count: int
    stem: str = ""
    ending: str = ".png"

    @classmethod
    def of(cls, output: Path, count: int) -> Frames:
        """As a person names them: a folder, or in it a file's name, whose stem and ending theirs then have."""
        if output.suffix.lower() in ENDINGS:
            return cls(output.parent, count, f"{output.stem}-", output.suffix.lower())
        if output.suffix and not output.is_dir():
            raise InsituError(
                f"{output}: expected a folder for the frames, or a name that ends in {' or '.join(ENDINGS)}"
            )
        return cls(output, count)

    def path(self, i: int) -> Path:
        return self.folder / f"{self.stem}{i:04d}{self.ending}"

    def missing(self, digest: str, resolution: tuple[int, int]) -> list[int]:
        """Which of them are to be drawn; the digest is noted for the next time. Raises InsituError, also where there
        are files of such names in a folder that no turn has noted: they are somebody's own."""
        record = self.folder / f"{DIGEST}-{self.stem}{self.ending[1:]}"
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            known = record.read_text() if record.exists() else ""
        except (OSError, UnicodeDecodeError) as error:
            raise InsituError(f"{self.folder}: the folder cannot be used, {error}") from error
        if not known and (others := [self.path(i) for i in range(self.count) if self.path(i).exists()]):
            raise InsituError(f"{others[0]}: not a frame of an earlier turn; expected a folder without such files")
        if known != digest:
            for i in range(self.count):
                self.path(i).unlink(missing_ok=True)
            save_file(record, digest.encode())
        return [i for i in range(self.count) if not _is_whole(self.path(i), resolution)]


def cameras(camera: Camera, count: int) -> list[Camera]:
    """Once around the target, from the camera itself on."""
    return [camera, *(orbited(camera, 2.0 * math.pi * i / count, 0.0) for i in range(1, count))]


def turn(
    project: Project, frames: Frames, report: Report, *, mode: Mode, n_lights: int, n_patches: int,
    series: BounceSeries | None = None, view: ToneMapping = "filmic",
) -> int:  # fmt: skip
    """Draw what is missing of the frames; how many that were. Raises InsituError."""
    digest = _digest(project, frames.count, mode, n_lights, n_patches, series, view)
    missing = frames.missing(digest, project.scene.resolution)
    camera = project.scene.description.camera
    around = cameras(Camera(**{name: getattr(camera, name) for name in Camera.model_fields}), frames.count)
    seen_from = [project.scene.seen_from(around[i]) for i in missing]
    if mode == "orbit":
        pictures = _orbits(project, seen_from, report, n_patches, series)
    else:
        pictures = _placements(project, seen_from, report, n_lights, n_patches, series)
    for i, picture in zip(missing, pictures, strict=False):
        write_picture(frames.path(i), picture, view)
    return len(missing)


def animate(
    project: Project, frames: Frames, report: Report, *, mode: Mode, n_lights: int, n_patches: int,
    series: BounceSeries | None = None, view: ToneMapping = "filmic",
) -> int:  # fmt: skip
    """Draw what is missing of the frames of the scene's animation; how many that were. Raises InsituError."""
    line = timeline(project.document, ViewState())
    if line is None:
        raise InsituError("--frames: the scene has no animation")
    documents = [SetTime(line.duration * i / frames.count).apply(project.document) for i in range(frames.count)]
    digest = _digest(project, frames.count, mode, n_lights, n_patches, series, view, "animation")
    missing = frames.missing(digest, project.scene.resolution)
    poses = [documents[i].poses for i in missing]
    if mode == "deform":
        pictures = _bendings(project, poses, report, series)
    else:
        seen = [_in_poses(project, each) for each in poses]
        pictures = _placements(project, seen, report, n_lights, n_patches, series)
    for i, picture in zip(missing, pictures, strict=False):
        write_picture(frames.path(i), picture, view)
    return len(missing)


def _in_poses(project: Project, poses: Poses) -> Scene:
    bumped = posed(project.resting, poses).bumped(dict(project.document.new_bumps))
    return bumped.seen_from(None, project.scene.resolution)


def _bendings(
    project: Project, poses: Sequence[Poses], report: Report, series: BounceSeries | None
) -> Iterator[Picture]:
    """Everything is made ready once; frames differ in their poses alone."""
    if not poses:
        return
    deform = prepared_deform(project, [name for name, _ in poses[0]], series)
    for step in deform.work():
        report(replace(step, fraction=_PREPARING_POSES * step.fraction))
    scene, intensity = project.scene, np.float64(project.document.light.intensity)
    for i, each in enumerate(poses):
        report(_frame(i, len(poses), _PREPARING_POSES))
        picture = deform.draw(scene.description.camera, scene.resolution, each, "rest")
        yield held(picture * intensity, BRIGHTEST)


def _orbits(
    project: Project, seen_from: Sequence[Scene], report: Report, n_patches: int, series: BounceSeries | None
) -> Iterator[Picture]:
    """Everything is made ready once; what only some cameras see, when one does."""
    if not seen_from:
        return
    orbit = prepared_orbit(project, n_patches, series)
    for step in orbit.work():
        report(replace(step, fraction=_PREPARING * step.fraction))
    intensity = np.float64(project.document.light.intensity)
    for i, seen in enumerate(seen_from):
        report(_frame(i, len(seen_from), _PREPARING))
        picture = orbit.draw(seen.description.camera, seen.resolution, "still")
        if not orbit.is_done:
            for _ in orbit.work():
                pass
            picture = orbit.draw(seen.description.camera, seen.resolution, "still")
        yield held(picture * intensity, BRIGHTEST)


def _placements(
    project: Project, seen_from: Sequence[Scene], report: Report, n_lights: int, n_patches: int,
    series: BounceSeries | None,
) -> Iterator[Picture]:  # fmt: skip
    """Each as a still of its own."""
    for i, seen in enumerate(seen_from):
        report(_frame(i, len(seen_from)))
        own = replace(project, scene=seen)
        yield render_project(own, _nothing, n_lights=n_lights, n_patches=n_patches, series=series).picture


def _frame(i: int, count: int, start: float = 0.0) -> StillProgress:
    """Frame i of so many is begun, and of all the work `start` was done before the first."""
    return StillProgress(start + (1.0 - start) * i / count, f"frame {i + 1} of {count}")


def _nothing(step: StillProgress) -> None:
    """A frame is short beside all of them."""


def _digest(project: Project, *settings: object) -> str:
    """Of all that the frames depend on."""
    scene, sky = project.scene, project.sky
    text = dump_session(project.document, ViewState())
    geometry = (scene.vertices, scene.normals, scene.triangles, scene.object_of_triangle, scene.smooth, scene.emission)
    radiance = None if sky.environment is None else sky.environment.radiance
    textures = TextureStore(scene.file)
    maps = repr([textures.stamps(layer.maps.images) for _, layer in project.document.layers()])
    camera = scene.description.camera.model_dump_json()
    bounces = repr((project.n_bounces, scene.description.bounces))
    return content_key(
        text, camera, scene.resolution, *geometry, radiance, sky.rotation, sky.scale, maps, bounces, repr(settings)
    )


def _is_whole(path: Path, resolution: tuple[int, int]) -> bool:
    """Whether a frame is there, to its last pixel."""
    try:
        found = read_radiance_image(path) if path.suffix == ".exr" else read_texture(path.read_bytes(), path)
    except (OSError, InsituError):
        return False
    return found.shape[1::-1] == resolution
