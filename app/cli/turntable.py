"""Pictures from all around a scene, or all through its animation, a file each: what `insitu render --turntable` and
`--frames` do.

A frame that is there and whole is kept, so that work that was stopped goes on where it was; a file beside the frames
has the digest of all that they depend on, and under another one all are drawn anew.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from app.files.session import dump_session
from app.frames import Draw, Frames, Report, draw_here, poses_of
from app.jobs.cache import content_key
from app.machine.atomic import require_place, save_file
from app.project import Project
from app.stills import ENDINGS, write_picture
from app.view_state import ViewState
from engine.colour import ToneMapping
from engine.errors import InsituError
from engine.light.image_files import read_radiance_image
from engine.texture.images import read_texture
from engine.texture.store import TextureStore

DIGEST = ".turntable"


@dataclass(frozen=True)
class FrameFiles:
    """The files of a turn: `count` of them in a folder, as `stem`0000`ending`."""

    folder: Path
    count: int
    stem: str = ""
    ending: str = ".png"

    @classmethod
    def of(cls, output: Path, count: int) -> FrameFiles:
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

    @property
    def record(self) -> Path:
        """The file that has the digest."""
        return self.folder / f"{DIGEST}-{self.stem}{self.ending[1:]}"

    def missing(self, digest: str, resolution: tuple[int, int]) -> list[int]:
        """Which of them are to be drawn; the digest is noted for the next time. Raises InsituError, also where there
        are files of such names in a folder that no turn has noted: they are somebody's own."""
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            known = self.record.read_text() if self.record.exists() else ""
        except (OSError, UnicodeDecodeError) as error:
            raise InsituError(f"{self.folder}: the folder cannot be used, {error}") from error
        if not known and (others := [self.path(i) for i in range(self.count) if self.path(i).exists()]):
            raise InsituError(f"{others[0]}: not a frame of an earlier turn; expected a folder without such files")
        if known != digest:
            for i in range(self.count):
                self.path(i).unlink(missing_ok=True)
            save_file(self.record, digest.encode())
        return [i for i in range(self.count) if not _is_whole(self.path(i), resolution)]


def draw_frames(
    project: Project, frames: Frames, files: FrameFiles, report: Report, view: ToneMapping = "filmic",
    draw: Draw = draw_here,
) -> int:  # fmt: skip
    """Draw what is missing of the frames, here or where `draw` does; how many that were. Raises InsituError."""
    if frames.animated:
        poses_of(project, frames.count)  # where there is no animation no file is touched
    require_place(*map(files.path, range(files.count)), files.record)
    missing = files.missing(_digest(project, frames, view), project.scene.resolution)
    drawn = 0
    for i, picture in draw(project, frames, missing, report):
        write_picture(files.path(i), picture, view)
        drawn += 1
    return drawn


def _digest(project: Project, *settings: object) -> str:
    """Of all that the frames depend on."""
    scene, sky = project.scene, project.sky
    text = dump_session(project.document, ViewState())
    geometry = (scene.vertices, scene.normals, scene.triangles, scene.object_of_triangle, scene.smooth, scene.emission)
    radiance = None if sky.environment is None else sky.environment.radiance
    textures = TextureStore(scene.file)
    maps = repr([textures.stamps(layer.maps.images) for _, layer in project.document.layers()])
    camera = scene.description.camera.model_dump_json()
    bounces = repr((project.n_bounces, scene.description.bounces, project.overruled))
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
