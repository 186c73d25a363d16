"""README's pictures of Deform: .venv/bin/python assets/scripts/deform.py [FOLDER]. Some minutes.

`deform_truth.png` after [Sloan05, fig. 6], `deform_surfaces.png` after figures 1, 3 to 5 and 7, `deform_bat.png`, an
animated PNG.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import replace
from io import BytesIO
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from app.commands import SetTime
from app.project import Project, open_project
from app.stills import _layers_by_object
from engine.deform.live import Deform, finished
from engine.deform.pose import Deformation, Poses
from engine.deform.posed_scene import posed
from engine.indirect.beyond import BRIGHTEST, held
from engine.render.image_files import png_bytes
from engine.render.path_tracer import render_paths
from engine.scene.load import Scene
from engine.scene.surface_kinds import DeformSurface
from engine.steps import finish
from engine.transport.pipeline import Placement

N_RAYS = 1500
N_FRAMES, FRAME_MS = 24, 50
BENT: Poses = (("head", (Deformation("bend", 55.0), Deformation("twist", 50.0))),)
Picture = NDArray[np.uint8]


def main(folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    _save(folder / "deform_truth.png", np.hstack(truth()))
    _save(folder / "deform_surfaces.png", surfaces())
    flap(folder / "deform_bat.png")


def truth() -> list[Picture]:
    """The bent head: by paths, by transfer that stays as it was at rest, as Deform draws it."""
    project = open_project("idol", (256, 256))
    scene = _with_surfaces(project.resting, {"head": None})
    deform = _ready(project, scene, ("head",))
    camera, layers = scene.description.camera, _layers_by_object(project)
    traced = finish(render_paths(Placement(posed(scene, BENT)), layers, project.sky, 2, 128))
    drawn = [deform.draw(camera, (256, 256), BENT, "rest", turned) for turned in (False, True)]
    return [_shown(held(each, BRIGHTEST)) for each in (traced, *drawn)]


def surfaces() -> Picture:
    """The head matt and of alabaster, bent; the jar under four patches, and wrinkled; two moments of the bat."""
    size = (256, 256)
    idol, amphora, bat = (open_project(name, size) for name in ("idol", "amphora", "bat"))
    row = [_still(idol, {"head": None}, BENT), _still(idol, {}, BENT)]
    row += [_still(bat, {}, SetTime(time).apply(bat.document).poses) for time in (0.15, 0.75)]
    bent: Poses = (("jar", (Deformation("bend", 25.0), Deformation("bulge", 0.2))),)
    below = [
        _still(amphora, {"jar": DeformSurface.model_validate(says)}, bent)
        for says in (
            {"patch": {"kind": "weave", "height": 1.5}},
            {"patch": {"kind": "bumps"}},
            {"patch": {"kind": "swirl", "height": 1.5}},
            {"wrinkles": {"across": "v", "repeats": 2.0, "depth": 0.6}},
        )
    ]
    return np.vstack([np.hstack(row), np.hstack(below)])


def flap(file: Path) -> None:
    """The bat's flight, looping."""
    project = open_project("bat", (320, 240))
    deform = _ready(project, project.resting, ("fur", "wings"))
    camera = project.resting.description.camera
    frames = []
    for i in range(N_FRAMES):
        poses = SetTime(1.2 * i / N_FRAMES).apply(project.document).poses
        frames.append(Image.fromarray(_shown(deform.draw(camera, (320, 240), poses, "rest"))))
    frames[0].save(file, save_all=True, append_images=frames[1:], duration=FRAME_MS, loop=0, optimize=True)
    print(file, file.stat().st_size)


def _still(project: Project, surfaces: Mapping[str, DeformSurface | None], poses: Poses) -> Picture:
    scene = _with_surfaces(project.resting, surfaces)
    deform = _ready(project, scene, tuple(name for name, _ in poses))
    return _shown(deform.draw(scene.description.camera, scene.resolution, poses, "rest"))


def _ready(project: Project, scene: Scene, bends: tuple[str, ...]) -> Deform:
    deform = Deform(scene, n_rays=N_RAYS)
    deform.set_light(project.sky)
    deform.set_layers(_layers_by_object(project))
    deform.set_posed(bends)
    return finished(deform)


def _with_surfaces(scene: Scene, surfaces: Mapping[str, DeformSurface | None]) -> Scene:
    """With these of objects, by name, instead of the file's."""
    objects = tuple(
        each.model_copy(update={"deform": surfaces.get(each.name, each.deform)}) for each in scene.description.objects
    )
    return replace(scene, description=scene.description.model_copy(update={"objects": objects}))


def _shown(radiance: NDArray[np.float32]) -> Picture:
    """As the window shows it."""
    return np.array(Image.open(BytesIO(png_bytes(radiance, tone_mapping="filmic"))).convert("RGB"))


def _save(file: Path, picture: Picture) -> None:
    Image.fromarray(picture).save(file, optimize=True)
    print(file, file.stat().st_size)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "docs/images"))
