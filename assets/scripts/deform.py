"""The guides' pictures of Deform: `python -m assets.scripts.deform [FOLDER] [NAME ...]`. Some minutes.

`deform_truth.png` after [Sloan05, fig. 6], `deform_surfaces.png` after figures 1, 3 to 5 and 7, `deform_transfer.png`
after 5 to 7, `deform_gloss.png` of the shadows in gloss, `deform_bat.png`, an animated PNG.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from app.document.commands import SetTime
from app.project.project import Project, open_project
from app.stills.stills import layers_by_object
from assets.scripts.bounces import save
from engine.core.clamping import BRIGHTEST, clamp_radiance
from engine.core.generators import run_to_end
from engine.material import MODELS
from engine.material.layer import make_layer
from engine.precompute.direct.pipeline import Placement
from engine.realtime.zonal_harmonics.deform_engine import Deform, finish_deform
from engine.realtime.zonal_harmonics.gloss_pilot import LOBE
from engine.realtime.zonal_harmonics.gloss_rows import MOST_ROWS
from engine.realtime.zonal_harmonics.object_transfer import N_LOBES, UNSHADOWED
from engine.realtime.zonal_harmonics.pose import Deformation, Poses
from engine.realtime.zonal_harmonics.posed_scene import pose_scene
from engine.render.display import display_picture
from engine.render.still import render_paths
from engine.scene.surface_kinds import NO_SURFACE, DeformSurface, SurfacesByObject

N_RAYS, N_POINTS = 800, 5000
SIZE, SMALL = (256, 256), (320, 240)
N_FRAMES, FRAME_MS = 24, 50
BENT: Poses = (("head", (Deformation("bend", 55.0), Deformation("twist", 50.0))),)
SLAB = {"thickness": 0.03, "scattering": 30.0, "absorption": 0.2}
BEHIND, NEARER = 330.0, {"target": (0.0, 0.4, 0.0), "fov_y": 32.0}  # light comes through the wings
DULL_COPPER = make_layer(
    MODELS["rough_conductor"], {"alpha": 0.3, "eta": (0.201, 0.9237, 1.1022), "k": (3.9133, 2.453, 2.1421)}
)
PATCHES = (
    {"patch": {"kind": "weave", "height": 1.5}},
    {"patch": {"kind": "bumps"}},
    {"wrinkles": {"across": "v", "repeats": 2.0, "depth": 0.6}},
)
Picture = NDArray[np.uint8]


def main(folder: Path, names: Sequence[str]) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for name in names or MAKERS:
        MAKERS[name](folder / f"deform_{name}.png")
        print(folder / f"deform_{name}.png", (folder / f"deform_{name}.png").stat().st_size, flush=True)


def truth(file: Path) -> None:
    """The bent head: by paths, by transfer that stays as it was at rest, as Deform draws it."""
    project = open_project("idol", SIZE)
    scene = project.resting
    deform = _ready(project, ("head",), (("head", NO_SURFACE),))
    camera, layers = scene.description.camera, layers_by_object(project)
    traced = run_to_end(render_paths(Placement(pose_scene(scene, BENT)), layers, project.sky, 2, 128))
    drawn = [deform.draw(camera, SIZE, BENT, "rest", turned) for turned in (False, True)]
    save(file, np.hstack([_shown(clamp_radiance(each, BRIGHTEST)) for each in (traced, *drawn)]))


def surfaces(file: Path) -> None:
    """The bent head matt and of alabaster; the jar under two patches, and wrinkled."""
    idol, amphora = (open_project(name, SIZE) for name in ("idol", "amphora"))
    row = [_still(idol, (("head", NO_SURFACE),), BENT), _still(idol, (), BENT)]
    bent: Poses = (("jar", (Deformation("bend", 25.0), Deformation("bulge", 0.2))),)
    row += [_still(amphora, (("jar", DeformSurface.model_validate(each)),), bent) for each in PATCHES]
    save(file, np.hstack(row))


def transfer(file: Path) -> None:
    """A waffle on the bent jar: unshadowed; with its shadows; with what it reflects onto itself; as a slab that light
    comes through; glossy alone."""
    project = open_project("amphora", SIZE)
    bent: Poses = (("jar", (Deformation("bend", 25.0),)),)
    opaque, slab = ({"patch": {"kind": "waffle", "repeats": [1.0, 1.0], **more}} for more in ({}, SLAB))
    clay = make_layer(MODELS["lambert"], {"albedo": (0.85, 0.82, 0.78)})
    metal = make_layer(MODELS["rough_conductor"], {"alpha": 0.35})
    row = []
    for says, layer, n_bounces, n_lobes in (
        (opaque, clay, 1, UNSHADOWED), (opaque, clay, 1, 4), (opaque, clay, 3, 4), (slab, clay, 1, 4),
        (opaque, metal, 1, 4),
    ):  # fmt: skip
        deform = Deform(project.resting, N_POINTS, N_RAYS)
        deform.set_light(project.sky)
        deform.set_layers({**layers_by_object(project), 0: (layer,)})
        deform.set_surfaces((("jar", DeformSurface.model_validate(says)),))
        deform.set_bending(("jar",))
        deform.set_bounces(n_bounces)
        deform.set_effort(N_RAYS, n_lobes)
        row.append(_shown(finish_deform(deform).draw(project.resting.description.camera, SIZE, bent, "rest")))
    save(file, np.hstack([each[:, 40:216] for each in row]))


def gloss(file: Path) -> None:
    """The bent head of dull copper alone: one lobe, rows of transfer, and by paths that reflect once."""
    project = open_project("idol", SIZE)
    scene, layers = project.resting, {**layers_by_object(project), 0: (DULL_COPPER,)}
    deform = Deform(scene, N_POINTS, N_RAYS)
    deform.set_light(project.sky)
    deform.set_layers(layers)
    deform.set_surfaces((("head", NO_SURFACE),))
    deform.set_bending(("head",))
    deform.set_bounces(1)
    row = []
    for n_rows in (LOBE, MOST_ROWS):
        deform.set_effort(N_RAYS, N_LOBES, n_rows)
        row.append(finish_deform(deform).draw(scene.description.camera, SIZE, BENT, "rest"))
    row.append(run_to_end(render_paths(Placement(pose_scene(scene, BENT)), layers, project.sky, 1, 256)))
    save(file, np.hstack([_shown(clamp_radiance(each, BRIGHTEST))[:, 40:216] for each in row]))


def flap(file: Path) -> None:
    """The bat's flight, looping."""
    project = open_project("bat", SMALL, [("light.rotation", BEHIND)])
    deform = _ready(project, ("fur", "wings"))
    camera = project.resting.description.camera.model_copy(update=NEARER)
    frames = []
    for i in range(N_FRAMES):
        poses = SetTime(1.2 * i / N_FRAMES).apply(project.document).poses
        frames.append(Image.fromarray(_shown(deform.draw(camera, SMALL, poses, "rest"))))
    frames[0].save(file, save_all=True, append_images=frames[1:], duration=FRAME_MS, loop=0, optimize=True)


def _still(project: Project, surfaces: SurfacesByObject, poses: Poses) -> Picture:
    deform, scene = _ready(project, tuple(name for name, _ in poses), surfaces), project.resting
    return _shown(deform.draw(scene.description.camera, scene.resolution, poses, "rest"))


def _ready(project: Project, bends: tuple[str, ...], surfaces: SurfacesByObject = ()) -> Deform:
    """surfaces: of objects, by name, instead of the file's."""
    deform = Deform(project.resting, N_POINTS, N_RAYS)
    deform.set_light(project.sky)
    deform.set_layers(layers_by_object(project))
    deform.set_surfaces(surfaces)
    deform.set_bending(bends)
    return finish_deform(deform)


def _shown(radiance: NDArray[np.float32]) -> Picture:
    return display_picture(radiance, tone_mapping="filmic")


MAKERS: dict[str, Callable[[Path], None]] = {
    "bat": flap, "gloss": gloss, "surfaces": surfaces, "transfer": transfer, "truth": truth
}  # fmt: skip

if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "docs/images"), sys.argv[2:])
