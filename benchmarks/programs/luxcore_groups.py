"""Light groups of LuxCore: run by an interpreter that has pyluxcore, never imported by the project.

    PYTHON luxcore_groups.py SCENE.npz OUT.npz SECONDS TRUTH_SECONDS FACTOR

SCENE.npz has size (width, height), camera (3, 3) (position, target, up) and fov_y in degrees, sky (3,), and of each
object i: vertices_i (V, 3), triangles_i (T, 3), normals_i (V, 3) where these are smooth, emission_i (3,), albedo_i
(3,), alpha_i, 0 for a diffuse one. Each emitter is a light group, and so is the sky.

It renders direct light for SECONDS, and then changes one group after the other to FACTOR times its strength, as its
editor does: by the film's radiance scales, after which the picture is developed anew. Writes the seconds (n, 2) of a
change and of a second one back, the pictures (n, H, W, 3) after it, and of each such light two pictures of other seeds
(n, 2, H, W, 3), of TRUTH_SECONDS each; what they were made with; and the samples of a pixel.
"""

from __future__ import annotations

import os
import sys
import time
from typing import Any

import numpy as np
import pyluxcore

PIPELINE = "film.imagepipelines.0."
SCALE = PIPELINE + "radiancescales.{}.globalscale"
LOOK_SECONDS = 0.05


def properties(values: dict[str, Any]) -> Any:
    made = pyluxcore.Properties()
    for name, value in values.items():
        made.Set(pyluxcore.Property(name, value))
    return made


def floats(array: Any) -> list[float]:
    return [float(x) for x in np.ravel(array)]


def scene_of(found: Any) -> tuple[Any, int]:
    """The scene, and how many groups its lights have: the sky, and each emitter."""
    scene, n_groups = pyluxcore.Scene(), 1
    position, target, up = found["camera"]
    values: dict[str, Any] = {
        "scene.camera.type": "perspective",
        "scene.camera.lookat.orig": floats(position),
        "scene.camera.lookat.target": floats(target),
        "scene.camera.up": floats(up),
        "scene.camera.fieldofview": float(found["fov_y"]),
        "scene.lights.sky.type": "constantinfinite",
        "scene.lights.sky.color": floats(found["sky"]),
        "scene.lights.sky.id": 0,
    }
    scene.Parse(properties(values))
    for i in range(sum(name.startswith("vertices_") for name in found.files)):
        vertices, triangles = found[f"vertices_{i}"], found[f"triangles_{i}"]
        normals = found[f"normals_{i}"] if f"normals_{i}" in found.files else None
        normals = None if normals is None else [tuple(map(float, each)) for each in normals]
        corners, indices = ([tuple(each.tolist()) for each in array] for array in (vertices, triangles))
        scene.DefineMesh(f"mesh{i}", corners, indices, normals, None, None, None)
        material = f"scene.materials.material{i}."
        albedo, alpha = floats(found[f"albedo_{i}"]), float(found[f"alpha_{i}"])
        if alpha:
            values = {
                f"scene.textures.fresnel{i}.type": "fresnelcolor",
                f"scene.textures.fresnel{i}.kr": albedo,
                material + "type": "metal2",
                material + "fresnel": f"fresnel{i}",
                material + "uroughness": alpha,
                material + "vroughness": alpha,
            }
        else:
            values = {material + "type": "matte", material + "kd": albedo}
        emission = floats(found[f"emission_{i}"])
        if any(emission):
            values |= {material + "emission": emission, material + "emission.id": n_groups}
            n_groups += 1
        values |= {f"scene.objects.object{i}.shape": f"mesh{i}", f"scene.objects.object{i}.material": f"material{i}"}
        scene.Parse(properties(values))
    return scene, n_groups


def rendered(scene: Any, size: tuple[int, int], seconds: float, seed: int, scales: dict[int, float]) -> Any:
    """A session after so many seconds, paused."""
    values: dict[str, Any] = {
        "renderengine.type": "PATHCPU",
        "renderengine.seed": seed,
        "sampler.type": "SOBOL",
        "path.pathdepth.total": 1,
        "path.clamping.variance.maxvalue": 0.0,
        "film.width": size[0],
        "film.height": size[1],
        "film.filter.type": "BOX",
        "film.filter.width": 0.5,
        PIPELINE + "0.type": "NOP",
    }
    session = pyluxcore.RenderSession(pyluxcore.RenderConfig(properties(values), scene))
    session.Start()
    begun = time.perf_counter()
    while time.perf_counter() - begun < seconds:
        time.sleep(LOOK_SECONDS)
        session.UpdateStats()
    session.Pause()
    if scales:
        session.Parse(properties({SCALE.format(group): scale for group, scale in scales.items()}))
    return session


def developed(session: Any, size: tuple[int, int]) -> Any:
    """The picture (H, W, 3) of a session, row 0 at the top."""
    pixels = np.zeros((size[1], size[0], 3), np.float32)
    session.GetFilm().GetOutputFloat(pyluxcore.FilmOutputType.RGB_IMAGEPIPELINE, pixels, 0)
    return pixels[::-1].copy()


def main() -> None:
    found, output = np.load(sys.argv[1]), sys.argv[2]
    seconds, truth_seconds, factor = map(float, sys.argv[3:6])
    pyluxcore.Init(lambda line: None)
    size = int(found["size"][0]), int(found["size"][1])
    scene, n_groups = scene_of(found)
    session = rendered(scene, size, seconds, 1, dict.fromkeys(range(n_groups), 1.0))
    before = developed(session, size)
    n_samples = session.GetFilm().GetStats().Get("stats.film.spp").GetFloat()
    took, pictures = [], []
    for group in range(n_groups):
        times = []
        for scale in (factor, 1.0):
            begun = time.perf_counter()
            session.Parse(properties({SCALE.format(group): scale}))
            picture = developed(session, size)
            times.append(time.perf_counter() - begun)
            if scale == factor:
                pictures.append(picture)
        took.append(times)
    session.Stop()
    truths: list[list[Any]] = []
    for seed in (2, 3):
        session = rendered(scene, size, truth_seconds, seed, dict.fromkeys(range(n_groups), 1.0))
        truths.append([])
        for group in range(n_groups):
            session.Parse(
                properties({SCALE.format(each): factor if each == group else 1.0 for each in range(n_groups)})
            )
            truths[-1].append(developed(session, size))
        session.Stop()
    np.savez(
        output, before=before, pictures=np.stack(pictures), truths=np.stack(truths, axis=1), seconds=np.array(took),
        samples=np.array(n_samples), made_with=np.array(f"LuxCore {pyluxcore.Version()} (PATHCPU)"),
    )  # fmt: skip


if __name__ == "__main__":
    main()
    os._exit(0)  # what pyluxcore 2.11 does at a usual end is a segmentation fault
