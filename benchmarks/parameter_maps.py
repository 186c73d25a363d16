"""How far a blend of a few nodes is from a roughness that varies over the surface: `python -m benchmarks.parameter_maps
MUSEUM.exr` prints the figures of docs/measured-changes.md.

A ball of GGX, alpha from 0.05 to 0.8, is lit by an environment and by a square lamp of 9 degrees. Maps: a ramp once
around the ball, and blobs of which all values are equally frequent. The truth has no nodes and no noise: all directions
of light at each of some points for 64 values of alpha, between which a spline has the value of each of 64 places in
the pixel. (The path tracer looks alpha up at each hit as well, with noise: tests/engine/scene/test_parameter_maps.py.)
Columns: the pilot's estimate; the error of the blend alone; that of the picture; and of its mean.
"""

from __future__ import annotations

import shutil
import sys
import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter

from app.document.node_layers import node_counts
from app.project.project import Project, open_project, with_overrides
from app.stills.stills import render_project
from engine.core.frames import local_frames
from engine.light.environment import triangle_integrals
from engine.material.layer import Layer, evaluate_layer
from engine.precompute.direct.pipeline import Placement
from engine.reference.integrator import patch_samples
from engine.reference.texel_parameters import TexelParameters
from engine.render.picture_difference import errors
from engine.scene.map_sampler import MapFactors
from engine.sphere.geodesic import geodesic

Float64Array = NDArray[np.float64]
ALPHAS = np.geomspace(0.05, 0.8, 64)
SIDE, N_POINTS, LEVEL, N_PATCHES = 64, {"museum": 100, "lamp": 400}, 6, 4000
N_PLACES = 8  # along each side of a pixel
SCENE = """version = 1
bounces = 1
[camera]
position = [0.0, 0.3, 3.0]
target = [0.0, 0.0, 0.0]
fov_y = 24.0
resolution = [64, 64]
{light}
[[object]]
name = "ball"
primitive = "sphere"
[[object.layer]]
model = "rough_conductor"
name = "metal"
parameter_maps = {{ alpha = {{ map = "rough.png", range = [0.05, 0.8] }} }}
{lamp}
"""
LAMP = '[[object]]\nname = "lamp"\nprimitive = "quad"\ntransform = {0}\nemission = 30.0\n'


def write_scene(folder: Path, light: str, texture: str, museum: Path) -> Path:
    """A ball's scene with its map; the lamp is at (1.6, 1.8, 2.6), 0.6 wide, and faces the ball."""
    if texture == "ramp":
        shares = np.tile(np.linspace(0.0, 1.0, 512), (256, 1))
    else:
        noise = gaussian_filter(np.random.default_rng(1).normal(size=(256, 512)), (10, 20), mode="wrap")
        shares = noise.ravel().argsort().argsort().reshape(noise.shape) / (noise.size - 1)
    Image.fromarray(np.round(255.0 * shares).astype(np.uint8)).save(folder / "rough.png")
    shutil.copy(museum, folder / "museum.exr")
    place = np.array([1.6, 1.8, 2.6])
    forward = -place / np.linalg.norm(place)
    right = np.cross([0.0, 1.0, 0.0], forward)
    right /= np.linalg.norm(right)
    matrix = np.eye(4)
    matrix[:3] = np.stack([0.6 * right, 0.6 * np.cross(forward, right), 0.6 * forward, place], axis=1)
    text = SCENE.format(
        light='[environment]\nfile = "museum.exr"' if light == "museum" else "",
        lamp=LAMP.format(matrix.ravel().tolist()) if light == "lamp" else "",
    )
    file = folder / "ball.toml"
    file.write_text(text)
    return file


def radiance_by_alpha(project: Project, placement: Placement, rows: NDArray[np.integer], layer: Layer) -> Float64Array:
    """Radiance (64, N, 3) at points (N,) for each alpha; the ball is convex and hides no light from itself."""
    hits, sky = placement.hits, project.sky
    found = np.zeros((len(ALPHAS), len(rows), 3))
    directions = geodesic(LEVEL).centres
    power = None if sky.environment is None else triangle_integrals(sky.environment, sky.rotation, LEVEL)
    patches = placement.patches(N_PATCHES)
    for i, (row, frame) in enumerate(zip(rows, local_frames(hits.tangent[rows], hits.normal[rows]), strict=True)):
        wi, of_light = directions, power
        if of_light is None:
            assert patches is not None
            wi, _, of_light = patch_samples(patches, hits.position[row].astype(np.float64))
        local = wi @ frame.T
        lit = np.flatnonzero((local[:, 2] > 0.0) & (wi @ hits.horizon[row] > 0.0))
        wo = np.tile(frame @ hits.wo[row].astype(np.float64), (len(lit), 1))
        for k, alpha in enumerate(ALPHAS):
            reflected = evaluate_layer(layer.with_parameter("alpha", alpha), local[lit], wo)
            found[k, i] = (reflected * of_light[lit]).sum(axis=0)
    return found


def measure(light: str, texture: str, museum: Path) -> None:
    """Print the rows of one light and one map."""
    with tempfile.TemporaryDirectory() as folder:
        project = open_project(str(write_scene(Path(folder), light, texture, museum))).with_settings(n_edge_rays=0)
        placement = Placement(project.scene, None, 0)
        hits, (layer,) = placement.hits, project.document.object("ball").layers
        chosen = np.random.default_rng(0).choice(np.arange(*hits.object_ranges[0]), N_POINTS[light], replace=False)
        rows = np.sort(chosen)
        found = radiance_by_alpha(project, placement, rows, layer.replace(parameter_maps=()))
        by_alpha, truth = CubicSpline(np.log(ALPHAS), found), pixel_means(placement, project, layer, rows, found)
        for n in range(2, 7):
            edited = with_overrides(project, {"nodes": n})
            nodes = [each for key, each in edited.layers.items() if key.startswith("ball.")]
            factors = MapFactors(edited.scene, {0: nodes}).at_primary_hits(placement.caster, hits)[rows]
            values = np.log([float(each.values["alpha"]) for each in nodes])  # type: ignore[arg-type]
            blend = sum(by_alpha(value) * factors[:, k] for k, value in enumerate(values))
            picture = render_project(edited, lambda step: None).picture.reshape(-1, 3)[hits.pixel[rows]]
            (count,) = node_counts(edited.document, edited.statistics, n)
            alone, whole = errors(np.asarray(blend), truth), errors(picture, truth)
            shares = (count.error, alone.rmse, whole.rmse, whole.mean)
            print(f"| {light}, {texture} | {n} | " + " | ".join(f"{share:.2%}" for share in shares) + " |", flush=True)


def pixel_means(
    placement: Placement, project: Project, layer: Layer, rows: NDArray[np.integer], found: Float64Array
) -> Float64Array:
    """The true radiance (N, 3) of pixels: the mean over places in each."""
    (own,) = layer.parameter_maps
    texels = TexelParameters(project.scene, {0: [layer]}).in_pixels(placement.caster, placement.hits)
    steps = (np.arange(N_PLACES) + 0.5) / N_PLACES
    places = np.stack(np.meshgrid(steps, steps), axis=2).reshape(-1, 2)
    means = np.zeros((len(rows), 3))
    for i, row in enumerate(rows):
        channel = texels.sample(np.full(len(places), row), places)[:, 0]
        by_alpha = CubicSpline(np.log(ALPHAS), found[:, i])
        means[i] = by_alpha(np.log(own.values(channel)[:, 0])).mean(axis=0)
    return means


def main() -> None:
    """Print the whole table."""
    print("| light, map | nodes | pilot | blend | picture | mean |\n| --- | --- | --- | --- | --- | --- |")
    for light in N_POINTS:
        for texture in ("ramp", "blobs"):
            measure(light, texture, Path(sys.argv[1]))


if __name__ == "__main__":
    main()
