"""Visibility between samples: Orbit's placed points beside the paper's visibility textures [Ma06, 3.3 and figure 6].

Both keep the visibility of 5,120 directions at some places of the surface and interpolate it at a pixel: between the
three points of a triangle, or bilinearly between four texels of an atlas, which xatlas makes of the scene's triangles.
They get the same number of places, and nothing else is approximated: light and reflection are those of the pixel.

    measure(scene, effort) ─► rows of the table
"""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xatlas
from matplotlib import pyplot as plt
from numpy.typing import NDArray

from app.measure.report import save_figure
from app.measure.settings_orbit import inner_rows
from app.project.project import open_project
from app.stills.stills import layers_by_object
from benchmarks.haar_truncation import COARSE, direct_factors
from engine.precompute.direct.pipeline import Placement
from engine.realtime.core.shading_points import ShadingPoints, shading_points
from engine.realtime.core.view_samples import PointMesh
from engine.render.picture_difference import errors
from engine.scene.raycaster import RayCaster
from engine.scene.scene_loader import Scene
from engine.sphere.geodesic import geodesic

Float64Array = NDArray[np.float64]
Rows = NDArray[np.intp]

FILE, PLOT = "visibility_textures.csv", "visibility_textures.png"
PADDING = 2  # empty texels between charts, so that no texel borders on two
ROUNDS = 4  # in which an atlas of the right number of texels is found
WITHIN = 0.02
ATLAS_TEXELS = 60_000  # of the one that is drawn
PERCENT = (1, 2, 5, 10)
STYLES = {"placed points": "o-", "visibility textures": "s--"}


@dataclass(frozen=True)
class TextureEffort:
    """Scenes, points beside the meshes' own vertices, and how many pixels of which resolution are judged."""

    scenes: tuple[str, ...] = ("teatray", "rings", "plant")
    n_points: tuple[int, ...] = (0, 10_000, 40_000)
    n_pixels: int = 300
    resolution: tuple[int, int] = (320, 240)


@dataclass(frozen=True, eq=False)
class Places:
    """Where visibility is kept, for N pixels: positions (N, K, 3), lifted off the surface, and weights (N, K), whose
    sum is 1; n_kept: all such places of the scene; share_used: of the rectangle that stores them."""

    lifted: Float64Array
    weights: Float64Array
    n_kept: int
    share_used: float = 1.0


@dataclass(frozen=True)
class Measured:
    """A row of the table: mean error of visibility over the directions above the pixels' surfaces, and relRMSE of
    radiance, in a scene with so many places; share_used: see `Places`."""

    scene: str
    way: str
    n_kept: int
    visibility: float
    radiance: float
    share_used: float


def measure(name: str, effort: TextureEffort) -> Iterator[Measured]:
    """The rows of one scene, a built-in name or a file, for each number of points."""
    project = open_project(name, effort.resolution)
    scene, placement, layers = project.scene, Placement(project.scene), layers_by_object(project)
    rows = inner_rows(placement.hits, effort.n_pixels)
    _, factors = direct_factors(placement.hits, rows, placement.caster, layers, project.sky, COARSE, COARSE)
    power, visible, reflected = (np.array(each) for each in zip(*factors, strict=True))
    truth = np.einsum("ntk,nto,ntk->nk", power, visible, reflected)
    pixels, above, charts = placement.hits.pixel[rows], reflected.any(axis=2), Charts(scene)

    def row(way: str, places: Places) -> Measured:
        found = interpolated_visibility(placement.caster, places)
        off = float(np.abs(found - visible[..., 0])[above].mean())
        radiance = np.einsum("ntk,nt,ntk->nk", power, found, reflected)
        return Measured(name, way, places.n_kept, off, errors(radiance, truth).rmse, places.share_used)

    for n in effort.n_points:
        points = shading_points(scene, placement.caster, n)
        yield row("placed points" if n else "vertices", at_points(scene, points, pixels, effort.resolution))
        if n:
            yield row("visibility textures", at_texels(charts, len(points), pixels, placement))


def interpolated_visibility(caster: RayCaster, places: Places) -> Float64Array:
    """Visibility (N, 5120) at N pixels, in world directions."""
    directions = geodesic(COARSE).centres.astype(np.float32)
    found = np.zeros((len(places.lifted), len(directions)))
    for k in range(places.lifted.shape[1]):
        some = np.flatnonzero(places.weights[:, k] > 0.0)
        for i in some:
            origins = np.broadcast_to(places.lifted[i, k].astype(np.float32), directions.shape)
            free = ~caster.occluded(np.ascontiguousarray(origins), directions)
            found[i] += places.weights[i, k] * free
    return found


# ------------------------------------------------------------------------------------------------------ placed points


def at_points(scene: Scene, points: ShadingPoints, pixels: Rows, resolution: tuple[int, int]) -> Places:
    """The three points around each pixel (N,)."""
    samples = PointMesh(scene, points).sample_view(scene.description.camera, resolution).samples
    corners, weights = samples.corners[pixels], samples.weights[pixels].astype(np.float64)
    return Places(points.lifted[corners].astype(np.float64), weights, len(points))


# ------------------------------------------------------------------------------------------------- visibility textures


@dataclass(frozen=True, eq=False)
class Atlas:
    """An atlas of T triangles, size (width, height) in texels: uvs (T, 3, 2) of their corners, in texels."""

    uvs: Float64Array
    size: tuple[int, int]

    def triangle_at(self, texels: NDArray[np.integer]) -> tuple[Rows, Float64Array]:
        """The triangle that covers the middle of each texel (n, 2), −1 for none, and the barycentric weights (n, 3) of
        its corners: a ray down onto the flat atlas finds it."""
        flat = np.concatenate([self.uvs.reshape(-1, 2), np.zeros((3 * len(self.uvs), 1))], axis=1)
        caster = RayCaster(flat, np.arange(len(flat), dtype=np.int32).reshape(-1, 3))
        origins = np.concatenate([texels + 0.5, np.ones((len(texels), 1))], axis=1).astype(np.float32)
        hits = caster.intersect(origins, np.tile(np.array([0.0, 0.0, -1.0], np.float32), (len(origins), 1)))
        u, v = hits.u.astype(np.float64), hits.v.astype(np.float64)
        return hits.triangle.astype(np.intp), np.stack([1.0 - u - v, u, v], axis=1)

    @property
    def texels(self) -> NDArray[np.intp]:
        """All texels (width · height, 2), row by row."""
        y, x = np.divmod(np.arange(self.size[0] * self.size[1]), self.size[0])
        return np.stack([x, y], axis=1)

    def kept(self) -> NDArray[np.bool_]:
        """Which texels (height, width) are kept: those that are covered, and those beside them, which bilinear look-ups
        at the edges of charts read."""
        width, height = self.size
        covered = np.pad((self.triangle_at(self.texels)[0] >= 0).reshape(height, width), 1)
        wide = covered[:-2] | covered[1:-1] | covered[2:]
        return np.asarray(wide[:, :-2] | wide[:, 1:-1] | wide[:, 2:])


class Charts:
    """A scene's triangles cut into charts, which is most of xatlas' work, to be packed for any number of texels."""

    def __init__(self, scene: Scene) -> None:
        made = xatlas.Atlas()
        vertices, triangles = scene.vertices.astype(np.float32), scene.triangles.astype(np.uint32)
        made.add_mesh(np.ascontiguousarray(vertices), np.ascontiguousarray(triangles))
        made.generate(pack_options=_packing(256))
        _, self._triangles, uvs = made[0]
        self._uvs = (uvs * (made.width, made.height)).astype(np.float32)

    def atlas(self, n_texels: int) -> tuple[Atlas, int]:
        """An atlas that keeps about so many texels, and how many it keeps."""
        side = math.sqrt(1.5 * n_texels)
        for _ in range(ROUNDS):
            atlas = self._packed(round(side))
            n_kept = int(atlas.kept().sum())
            if abs(n_kept / n_texels - 1.0) < WITHIN:
                break
            side *= math.sqrt(n_texels / n_kept)
        return atlas, n_kept

    def _packed(self, side: int) -> Atlas:
        """The atlas in a square of about that many texels a side."""
        made = xatlas.Atlas()
        made.add_uv_mesh(self._uvs, self._triangles)
        made.generate(pack_options=_packing(side))
        _, triangles, uvs = made[0]
        return Atlas(uvs[triangles].astype(np.float64) * (made.width, made.height), (made.width, made.height))


def _packing(resolution: int) -> xatlas.PackOptions:
    packing = xatlas.PackOptions()
    packing.resolution, packing.padding, packing.create_image = resolution, PADDING, False
    return packing


def at_texels(charts: Charts, n_texels: int, pixels: Rows, placement: Placement) -> Places:
    """The four texels around each pixel (N,); one that is not covered stands for the nearest place of the pixel's own
    triangle."""
    atlas, n_kept = charts.atlas(n_texels)
    scene, caster, camera = placement.scene, placement.caster, placement.scene.camera_position
    directions = placement.hits.ray_directions.reshape(-1, 3)[pixels]
    hits = caster.intersect(np.broadcast_to(camera, directions.shape).astype(np.float32), directions)
    own = hits.triangle.astype(np.intp)
    within = np.stack([1.0 - hits.u - hits.v, hits.u, hits.v], axis=1).astype(np.float64)
    place = np.einsum("nk,nki->ni", within, atlas.uvs[own]) - 0.5
    low = np.floor(place).astype(np.intp)
    x, y = (place - low).T
    lifted, weights = np.empty((len(pixels), 4, 3)), np.stack([(1 - x) * (1 - y), x * (1 - y), (1 - x) * y, x * y], 1)
    for k, step in enumerate(((0, 0), (1, 0), (0, 1), (1, 1))):
        texels = low + step
        triangle, shares = atlas.triangle_at(texels)
        outside = triangle < 0
        triangle[outside] = own[outside]
        shares[outside] = nearest_within(atlas.uvs[own[outside]], texels[outside] + 0.5)
        at = np.einsum("nk,nki->ni", shares, scene.vertices[scene.triangles[triangle]])
        towards_camera = scene.geometric_normals[triangle]
        facing = np.sign(np.einsum("ni,ni->n", towards_camera, camera - at))[:, None]
        lifted[:, k] = caster.offset_origins(at, facing * towards_camera)
    return Places(lifted, weights, n_kept, n_kept / (atlas.size[0] * atlas.size[1]))


def nearest_within(corners: Float64Array, at: Float64Array) -> Float64Array:
    """Barycentric weights (n, 3) of the places in triangles (n, 3, 2) that are nearest to (n, 2), which lie outside."""
    best, least = np.zeros((len(at), 3)), np.full(len(at), np.inf)
    for i in range(3):
        j = (i + 1) % 3
        edge = corners[:, j] - corners[:, i]
        along = np.einsum("ni,ni->n", at - corners[:, i], edge) / np.maximum(np.einsum("ni,ni->n", edge, edge), 1e-30)
        along = np.clip(along, 0.0, 1.0)
        away = np.linalg.norm(at - corners[:, i] - along[:, None] * edge, axis=1)
        nearer = np.flatnonzero(away < least)
        least[nearer], best[nearer] = away[nearer], 0.0
        best[nearer, i], best[nearer, j] = 1.0 - along[nearer], along[nearer]
    return best


def measure_all(effort: TextureEffort, report: Callable[[str], None]) -> list[Measured]:
    """The rows of all scenes."""
    found = []
    for name in effort.scenes:
        for row in measure(name, effort):
            report(f"{name}, {row.way}, {row.n_kept:,} places: {row.radiance:.2%}")
            found.append(row)
    return found


def write_textures(folder: Path, effort: TextureEffort, report: Callable[[str], None]) -> None:
    """Measure the scenes and write the table and the plot into a folder."""
    found = measure_all(effort, report)
    with open(folder / FILE, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(("scene", "way", "places", "error of visibility", "relRMSE", "share of the rectangle"))
        writer.writerows((e.scene, e.way, e.n_kept, e.visibility, e.radiance, e.share_used) for e in found)
    write_plot(folder, effort, found)


def write_plot(folder: Path, effort: TextureEffort, found: Sequence[Measured]) -> None:
    """The atlas of the first scene, and errors by the number of places."""
    scene = open_project(effort.scenes[0], effort.resolution).scene
    _draw(folder / PLOT, scene, Charts(scene).atlas(ATLAS_TEXELS)[0], found)


def _draw(path: Path, scene: Scene, atlas: Atlas, found: Sequence[Measured]) -> None:
    """The atlas of a scene, a colour an object, beside the errors of all scenes against the number of places."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(12.0, 4.5), layout="constrained")
    triangle, _ = atlas.triangle_at(atlas.texels)
    objects = np.where(triangle >= 0, scene.object_of_triangle[triangle], -1).reshape(atlas.size[::-1])
    left.imshow(np.ma.masked_less(objects, 0), origin="lower", cmap="tab10", vmin=0, vmax=9, interpolation="nearest")
    left.set(title=f"atlas of {Path(scene.file).parent.name}", xticks=[], yticks=[])
    for k, name in enumerate(dict.fromkeys(each.scene for each in found)):
        for way, style in STYLES.items():
            own = [each for each in found if (each.scene, each.way) == (name, way)]
            places, errors_of = [each.n_kept for each in own], [100.0 * each.radiance for each in own]
            right.plot(places, errors_of, style, color=f"C{k}", label=f"{name}, {way}")
    right.set(xlabel="places", ylabel="relRMSE, %", yscale="log")
    right.set_yticks(PERCENT, [str(each) for each in PERCENT])
    right.minorticks_off()
    right.legend(frameon=False, fontsize=8, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    right.spines[["top", "right"]].set_visible(False)
    save_figure(path, figure)
