"""Stills of a scene by Mitsuba 3: run by an interpreter that has it, never imported by the project.

    PYTHON mitsuba_stills.py SCENE.toml OUT.npz WIDTH HEIGHT BOUNCES SAMPLES STILLS [OBJECT LAYER PARAMETER VALUE]

Writes pictures (n, H, W, 3), each from its own seed, the seconds (n,) of each and of processor time, and what they were
made with. The last four arguments change one parameter of a layer, by its number, to a JSON value. A small still before
them, which is not timed, has Mitsuba's kernels compiled. A pixel is averaged over its area, as in a usual still.

Understood are layers `lambert` and `rough_conductor` (at most one of each on an object), emission and a lat-long file
as environment; other scenes end with one line. Mitsuba reads row i of an environment of H rows at i / (H - 1), others
at the middles of pixels: it gets a map that it reads as it was meant. Mitsuba has no sum of two materials, but a blend:
w a/w + (1 - w) b/(1 - w) = a + b, with w near the share of the light that each reflects, by which it chooses samples.
"""

from __future__ import annotations

import ctypes.util
import json
import os
import sys
import time
import tomllib
from pathlib import Path
from typing import Any

import numpy as np

# Of the versions of LLVM that Debian names by number; another one may be named in DRJIT_LIBLLVM_PATH.
for number in (19, 22, 15):
    library = ctypes.util.find_library(f"LLVM-{number}")
    if library:
        os.environ.setdefault("DRJIT_LIBLLVM_PATH", library)

import mitsuba as mi  # noqa: E402

VARIANT = "llvm_ad_rgb"
WARM_UP = 4


def colour(value: Any) -> dict[str, Any]:
    return {"type": "rgb", "value": np.broadcast_to(value, 3).tolist()}


def reflectance(value: Any, share: float) -> dict[str, Any]:
    """That of a part of a blend, which may be above 1."""
    return {"type": "srgb", "color": (np.broadcast_to(value, 3) / share).tolist(), "unbounded": True}


def shares(layers: list[dict[str, Any]]) -> dict[str, float]:
    """The weight of each layer, by its model: near its part of what they reflect straight on, 1 together."""
    amounts = {}
    for layer in layers:
        if layer["model"] == "lambert":
            amounts["lambert"] = float(np.mean(layer["albedo"]))
        else:
            eta, k = np.array(layer["eta"]), np.array(layer["k"])
            fresnel = ((eta - 1) ** 2 + k**2) / ((eta + 1) ** 2 + k**2)
            amounts["rough_conductor"] = float(np.mean(layer.get("scale", 1.0) * fresnel))
    if len(amounts) < 2:
        return dict.fromkeys(amounts, 1.0)
    metal = float(np.clip(amounts["rough_conductor"] / sum(amounts.values()), 0.1, 0.9))
    return {"lambert": 1.0 - metal, "rough_conductor": metal}


def material(layers: list[dict[str, Any]]) -> dict[str, Any]:
    """Both sides of a surface with these layers, black without any."""
    parts = {layer["model"]: layer for layer in layers}
    unknown = set(parts) - {"lambert", "rough_conductor"}
    if unknown or len(parts) < len(layers):
        sys.exit(f"layers {[layer['model'] for layer in layers]}: no counterpart")
    if not parts:
        return diffuse({"albedo": 0.0}, 1.0)
    weights, makers = shares(layers), {"lambert": diffuse, "rough_conductor": conductor}
    made = [makers[model](parts[model], weights[model]) for model in makers if model in parts]
    if len(made) == 1:
        return both_sides(made[0])
    return both_sides({"type": "blendbsdf", "weight": weights["rough_conductor"], "first": made[0], "second": made[1]})


def both_sides(inner: dict[str, Any]) -> dict[str, Any]:
    return {"type": "twosided", "inner": inner}


def diffuse(layer: dict[str, Any], share: float) -> dict[str, Any]:
    return {"type": "diffuse", "reflectance": reflectance(layer["albedo"], share)}


def conductor(layer: dict[str, Any], share: float) -> dict[str, Any]:
    return {
        "type": "roughconductor",
        "distribution": layer.get("distribution", "ggx"),
        "alpha": float(layer["alpha"]),
        "eta": colour(layer["eta"]),
        "k": colour(layer["k"]),
        "specular_reflectance": reflectance(layer.get("scale", 1.0), share),
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


def environment(described: dict[str, Any], folder: Path) -> dict[str, Any]:
    image = mi.Bitmap(str(folder / described["file"])).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, False)
    radiance = np.array(image, np.float64)
    n_rows, n_columns = radiance.shape[:2]
    y = np.clip(np.arange(2 * n_rows + 1) / 2 - 0.5, 0, n_rows - 1)
    x = (np.arange(2 * n_columns) + 0.5) / 2 - 0.5
    row, column = np.minimum(y.astype(int), n_rows - 2), np.floor(x).astype(int)
    down, right = (y - row)[:, None, None], (x - column)[None, :, None]
    across = radiance[:, column % n_columns] * (1 - right) + radiance[:, (column + 1) % n_columns] * right
    return {
        "type": "envmap",
        "bitmap": mi.Bitmap((across[row] * (1 - down) + across[row + 1] * down).astype(np.float32)),
        "scale": float(described.get("scale", 1.0)),
        "to_world": mi.ScalarTransform4f().rotate([0, 1, 0], 180.0 + described.get("rotation", 0.0)),
    }


def scene_of(described: dict[str, Any], folder: Path, size: tuple[int, int], bounces: int) -> Any:
    if "file" not in described.get("environment", {"file": ""}) or "mapping" in described.get("environment", {}):
        sys.exit("environment: no counterpart but of a lat-long file")
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
    if "environment" in described:
        parts["environment"] = environment(described["environment"], folder)
    for i, each in enumerate(described["object"]):
        parts[f"object{i}"] = shape(each, folder)
    return mi.load_dict(parts)


def main() -> None:
    source, output = Path(sys.argv[1]), Path(sys.argv[2])
    width, height, bounces, samples, n_stills = map(int, sys.argv[3:8])
    described = tomllib.loads(source.read_text())
    for name, layer, parameter, value in [sys.argv[8:]] if sys.argv[8:] else []:
        changed = next(each for each in described["object"] if each["name"] == name)
        changed["layer"][int(layer)][parameter] = json.loads(value)
    mi.set_variant(VARIANT)
    scene = scene_of(described, source.parent, (width, height), bounces)
    np.array(mi.render(scene, seed=n_stills, spp=WARM_UP))
    pictures, seconds, used = [], [], []
    for seed in range(n_stills):
        started, before = time.perf_counter(), time.process_time()
        pictures.append(np.array(mi.render(scene, seed=seed, spp=samples), np.float32))
        seconds.append(time.perf_counter() - started)
        used.append(time.process_time() - before)
    made_with = f"Mitsuba {mi.__version__} ({VARIANT})"
    times = np.array(seconds), np.array(used)
    np.savez(output, pictures=np.stack(pictures), seconds=times[0], cpu_seconds=times[1], made_with=np.array(made_with))


if __name__ == "__main__":
    main()
