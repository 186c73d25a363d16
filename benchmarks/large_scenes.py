"""What one view of a large scene costs, part by part, as docs/scale.md has it:
`python -m benchmarks.large_scenes [TRIANGLES ...]`.

The scene is a landscape of so many triangles under the built-in sky: broad hills, stones and grit of half a triangle's
size, diffuse earth with a gloss over it. Each size is measured in a process of its own, in seconds of processor time,
of both cores together: what other programs do meanwhile changes these little.
"""

from __future__ import annotations

import json
import pickle
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import psutil
from numpy.typing import NDArray

SIZES = (10_000, 100_000, 1_000_000, 10_000_000)
SIDE = 20.0
RESOLUTION = (256, 256)
SCENE = """
version = 1
name = "landscape"
bounces = {bounces}
[camera]
position = [0, 4.5, 11]
target = [0, 0, 0]
fov_y = 50
resolution = [{width}, {height}]
[environment]
file = "sky.exr"
[[object]]
name = "landscape"
mesh = "landscape.ply"
layer = [
    {{ model = "lambert", name = "earth", albedo = [0.45, 0.35, 0.25] }},
    {{ model = "rough_conductor", name = "gloss", alpha = 0.3, scale = 0.1 }},
]
"""

Result = TypeVar("Result")


def height_of(n: int) -> NDArray[np.float64]:
    """Heights (n, n) in metres, of octaves that halve in size and height down to twice the distance of two."""
    x = np.linspace(0.0, 1.0, n)
    height, generator, frequency = np.zeros((n, n)), np.random.default_rng(5), 2
    while frequency * 2 < n:
        nodes = generator.standard_normal((frequency + 2, frequency + 2))
        place = x * frequency
        i = np.minimum(place.astype(int), frequency)
        t = place - i
        t = t * t * (3.0 - 2.0 * t)
        rows = nodes[i] * (1.0 - t)[:, None] + nodes[i + 1] * t[:, None]
        height += 2.4 / frequency**0.9 * (rows[:, i] * (1.0 - t) + rows[:, i + 1] * t)
        frequency *= 2
    return height


def write_landscape(path: Path, n_triangles: int) -> int:
    """A PLY file of about so many triangles; how many it has."""
    n = int(round((n_triangles / 2) ** 0.5)) + 1
    place = np.linspace(-SIDE / 2, SIDE / 2, n)
    vertices = np.empty((n, n, 3), "<f4")
    vertices[..., 0], vertices[..., 1], vertices[..., 2] = place, height_of(n), place[:, None]
    faces = np.empty((n - 1, n - 1, 2), np.dtype([("n", "u1"), ("corners", "<i4", 3)]))
    first = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).astype(np.int32)
    faces["n"] = 3
    faces["corners"][..., 0, :] = np.stack([first, first + n, first + 1], axis=-1)
    faces["corners"][..., 1, :] = np.stack([first + 1, first + n, first + n + 1], axis=-1)
    head = ["ply", "format binary_little_endian 1.0", f"element vertex {n * n}"]
    head += [f"property float {name}" for name in "xyz"]
    head += [f"element face {faces.size}", "property list uchar int vertex_indices", "end_header", ""]
    with open(path, "wb") as file:
        file.write("\n".join(head).encode())
        vertices.tofile(file)
        faces.tofile(file)
    return faces.size


class Clock:
    """Seconds of processor time and most memory (MiB) of each part, in order."""

    def __init__(self) -> None:
        self.parts: dict[str, float] = {}

    def time(self, name: str, work: Callable[[], Result]) -> Result:
        started = time.process_time()
        result = work()
        self.parts[name] = time.process_time() - started
        self.parts[f"{name}_mib"] = _most_memory() / 2**20
        return result


def _most_memory() -> int:
    """Bytes of main memory at most until now; where the system does not say, now."""
    if sys.platform == "linux":
        import resource

        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
    memory: int = psutil.Process().memory_info().rss
    return memory


def measure(folder: Path, resolution: tuple[int, int] = RESOLUTION) -> dict[str, Any]:
    """One view of the scene in a folder, after a small one that has its kernels loaded."""
    from app.system.kernel_cache import use_kernel_cache

    use_kernel_cache()
    from app.project.project import open_project
    from app.stills.stills import plan_still, render_picture
    from engine.core.generators import run_to_end
    from engine.precompute.direct.pipeline import Placement
    from engine.precompute.direct.projection import project_layer
    from engine.precompute.indirect.sampling_settings import BounceSeries
    from engine.render.still import indirect_radiance, shape_of, still_layers, still_quality, with_maps
    from engine.scene.raycaster import RayCaster

    small = open_project(str(folder / "small.toml"))
    render_picture(small, lambda step: None, series=BounceSeries(2))
    clock = Clock()
    project = clock.time("open", lambda: open_project(str(folder / "scene.toml"), resolution))
    scene = project.scene
    plan = plan_still(project)
    caster = clock.time("bvh", lambda: RayCaster(scene.vertices, scene.triangles))
    placement = clock.time("hits", lambda: Placement(scene, caster, plan.n_edge_rays))
    sky = project.sky
    layers = with_maps(placement, still_layers(project.layers.items(), project.object_names, plan))
    light = clock.time("light", lambda: run_to_end(placement.light(sky, still_quality(plan))))
    n_tiles = n_bytes = 0

    def project_all() -> None:
        nonlocal n_tiles, n_bytes
        for each in layers:
            for tile in project_layer(placement.hits, placement.rows_of(each.i_object), light, shape_of(each)):
                n_tiles += 1
                n_bytes += tile.values.nbytes + tile.scale.nbytes

    clock.time("tiles", project_all)
    light_bytes = len(pickle.dumps(light, protocol=5))
    clock.time("indirect", lambda: run_to_end(indirect_radiance(placement, layers, sky, BounceSeries(2))))
    return {
        "triangles": len(scene.triangles),
        "file_mib": (folder / "landscape.ply").stat().st_size / 2**20,
        "points": len(placement.hits.pixel),
        "n_tiles": n_tiles,
        "tile_s": clock.parts["tiles"] / n_tiles,
        "tile_bytes": n_bytes / n_tiles,
        "seen_mib": light_bytes / 2**20,
        "rays_per_point": light.sphere.rays.traced / max(len(placement.hits.pixel), 1),
        **clock.parts,
    }


def make_scene(folder: Path, n_triangles: int) -> None:
    """The scene file, its mesh and its sky, and a small one beside it."""
    width, height = RESOLUTION
    shutil.copyfile(Path(__file__).resolve().parents[1] / "assets" / "environments" / "sky.exr", folder / "sky.exr")
    write_landscape(folder / "landscape.ply", n_triangles)
    write_landscape(folder / "small.ply", 200)
    scene = SCENE.format(bounces=2, width=width, height=height)
    (folder / "scene.toml").write_text(scene)
    small = SCENE.format(bounces=2, width=24, height=24).replace("landscape.ply", "small.ply")
    (folder / "small.toml").write_text(small)


def main() -> None:
    if sys.argv[1:2] == ["--in"]:
        print(json.dumps(measure(Path(sys.argv[2]))))
        return
    for n_triangles in map(int, sys.argv[1:]) if sys.argv[1:] else SIZES:
        with tempfile.TemporaryDirectory() as folder:
            make_scene(Path(folder), n_triangles)
            command = [sys.executable, "-m", "benchmarks.large_scenes", "--in", folder]
            found = json.loads(subprocess.run(command, check=True, capture_output=True).stdout)
        print(json.dumps({name: round(value, 4) for name, value in found.items()}), flush=True)


if __name__ == "__main__":
    main()
