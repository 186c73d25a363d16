"""Stills of a scene by Mitsuba 3: run by an interpreter that has it, never imported by the project.

    PYTHON peer_program.py SCENE.toml OUT.npz WIDTH HEIGHT BOUNCES SAMPLES STILLS

Writes pictures (n, H, W, 3), each from its own seed, the seconds (n,) of each, and what they were made with. A small
still before them, which is not timed, has Mitsuba's kernels compiled. A pixel is averaged over its area, as in a usual
still.

Understood are layers `lambert` and `rough_conductor` (at most one of each on an object) and emission; other scenes end
with one line. Mitsuba has no sum of two materials, but a blend: w a/w + (1 - w) b/(1 - w) = a + b.
"""

from __future__ import annotations

import ctypes.util
import os
import sys
import time
import tomllib
from pathlib import Path
from typing import Any

import numpy as np

# Of the versions of LLVM that Debian names by number; another one may be named in DRJIT_LIBLLVM_PATH.
for number in (19, 22):
    library = ctypes.util.find_library(f"LLVM-{number}")
    if library:
        os.environ.setdefault("DRJIT_LIBLLVM_PATH", library)

import mitsuba as mi  # noqa: E402

VARIANT = "llvm_ad_rgb"
WARM_UP = 4


def colour(value: Any, factor: float = 1.0) -> dict[str, Any]:
    return {"type": "rgb", "value": (np.broadcast_to(value, 3) * factor).tolist()}


def material(layers: list[dict[str, Any]]) -> dict[str, Any]:
    """Both sides of a surface with these layers, black without any."""
    parts = {layer["model"]: layer for layer in layers}
    unknown = set(parts) - {"lambert", "rough_conductor"}
    if unknown or len(parts) < len(layers):
        sys.exit(f"layers {[layer['model'] for layer in layers]}: no counterpart")
    matt, metal = parts.get("lambert"), parts.get("rough_conductor")
    if not parts:
        return diffuse(0.0, 1.0)
    if metal is None:
        return both_sides(diffuse(parts["lambert"]["albedo"], 1.0))
    if matt is None:
        return both_sides(conductor(metal, 1.0))
    share = float(np.clip(metal.get("scale", 1.0), 0.05, 0.95))
    blend = {"type": "blendbsdf", "weight": share}
    blend |= {"first": diffuse(matt["albedo"], 1.0 - share), "second": conductor(metal, share)}
    return both_sides(blend)


def both_sides(inner: dict[str, Any]) -> dict[str, Any]:
    return {"type": "twosided", "inner": inner}


def diffuse(albedo: Any, share: float) -> dict[str, Any]:
    return {"type": "diffuse", "reflectance": colour(albedo, 1.0 / share)}


def conductor(layer: dict[str, Any], share: float) -> dict[str, Any]:
    return {
        "type": "roughconductor",
        "distribution": layer.get("distribution", "ggx"),
        "alpha": float(layer["alpha"]),
        "eta": colour(layer["eta"]),
        "k": colour(layer["k"]),
        "specular_reflectance": colour(layer.get("scale", 1.0), 1.0 / share),
    }


def shape(described: dict[str, Any], folder: Path) -> dict[str, Any]:
    file = folder / described["mesh"]
    place = np.reshape(described.get("transform", np.eye(4)), (4, 4)).tolist()
    made = {
        "type": file.suffix[1:],
        "filename": str(file),
        "face_normals": not described.get("smooth", True),
        "to_world": mi.ScalarTransform4f(place),
        "material": material(described.get("layer", [])),
    }
    if "emission" in described:
        made["light"] = {"type": "area", "radiance": colour(described["emission"])}
    return made


def scene_of(described: dict[str, Any], folder: Path, size: tuple[int, int], bounces: int) -> Any:
    if "environment" in described:
        sys.exit("environment: no counterpart")
    camera = described["camera"]
    up = camera.get("up", [0, 1, 0])
    film = {"type": "hdrfilm", "width": size[0], "height": size[1], "pixel_format": "rgb"}
    film |= {"component_format": "float32", "filter": {"type": "box"}}
    parts: dict[str, Any] = {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": bounces + 1},  # it counts the ends of paths as well
        "sensor": {
            "type": "perspective",
            "fov": camera["fov_y"],
            "fov_axis": "y",
            "to_world": mi.ScalarTransform4f().look_at(camera["position"], camera["target"], up),
            "film": film,
            "sampler": {"type": "multijitter"},
        },
    }
    for i, each in enumerate(described["object"]):
        parts[f"object{i}"] = shape(each, folder)
    return mi.load_dict(parts)


def main() -> None:
    source, output = Path(sys.argv[1]), Path(sys.argv[2])
    width, height, bounces, samples, n_stills = map(int, sys.argv[3:8])
    mi.set_variant(VARIANT)
    scene = scene_of(tomllib.loads(source.read_text()), source.parent, (width, height), bounces)
    np.array(mi.render(scene, seed=n_stills, spp=WARM_UP))
    pictures, seconds = [], []
    for seed in range(n_stills):
        started = time.perf_counter()
        pictures.append(np.array(mi.render(scene, seed=seed, spp=samples), np.float32))
        seconds.append(time.perf_counter() - started)
    made_with = f"Mitsuba {mi.__version__} ({VARIANT})"
    np.savez(output, pictures=np.stack(pictures), seconds=np.array(seconds), made_with=np.array(made_with))


if __name__ == "__main__":
    main()
