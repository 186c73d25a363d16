"""The precomputation of one picture, coarse to fine: primary hits, visibility, light, transport.

`Placement` holds what no edit invalidates (rays, hits, the sphere's visibility). Its long methods are generators that
yield the fraction done, so that the caller can show progress, answer other requests, or stop.
"""

from collections.abc import Generator, Iterator, Mapping
from copy import copy
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from engine.light.emitters import EmitterPatches, EmitterTree, emitter_patches, emitting_triangles, unmerged
from engine.light.environment import Environment
from engine.light.triangle_lights import cut_lights
from engine.precompute.direct import _footprint_kernels as kernels
from engine.precompute.direct.lighting import Lighting, emitters_for, prepare_lighting
from engine.precompute.direct.near_leaves import NearLight, no_near_leaves
from engine.precompute.direct.projection import VisibleLight
from engine.scene.cutouts import scene_caster
from engine.scene.emission_textures import emitting_triangles_of
from engine.scene.primary_hits import PrimaryHits, trace_primary
from engine.scene.raycaster import RayCaster
from engine.scene.scene_loader import Scene
from engine.settings import RenderSettings
from engine.visibility.coherent_grid import coherent_visibility
from engine.visibility.point_visibility import (
    VISIBILITY_LEVEL,
    Visibility,
    empty_visibility,
    evaluate_rows,
    see_all,
    sphere_targets,
    visible_shares,
)

N_SAMPLES = 4  # of a footprint
# A change of the normal by one radian counts as this many lattice steps.
NORMAL_WEIGHT = 4.0


@dataclass(frozen=True)
class Quality:
    """How finely a stage computes.

    stride: the stage computes every stride-th pixel; n_lights: sky lights; n_patches: leaves of the emitter tree;
    max_level: deepest sky triangle; tolerance: how many bands γ may bend over a light. own_rays: trace the lights of
    the cut alone, without the sphere's visibility; an intermediate stage uses that visibility where it is already
    known. stays: this picture is the final one, which must not depend on what is already known. sun_level: the level
    that sun lights are split to, see `engine.light.triangle_lights`.
    """

    name: str
    stride: int
    n_lights: int
    n_patches: int
    max_level: int = 6
    tolerance: float = 1.0
    own_rays: bool = True
    stays: bool = False
    sun_level: int = 0


# One level less saves a tenth of a second of the first picture; its samples are four pixels apart anyway.
COARSE = Quality("coarse", 4, 400, 32, max_level=5)
PREVIEW = Quality("preview", 1, 400, 32)
# The sky is summed one level deeper than most of its lights go, so that the centres of brightness of the finest lights
# are exact: the error of the built-in tea tray against the brute-force oracle is 0.46 % instead of 0.54 %.
FINAL = Quality("final", 1, 4000, 768, max_level=7, tolerance=0.5, own_rays=False, stays=True, sun_level=10)
# While the user drags a light nothing new is traced: the brightest regions use the sphere's own bits.
DRAG = Quality("drag", 8, 400, 16, VISIBILITY_LEVEL, own_rays=False)


def final_quality(settings: RenderSettings) -> Quality:
    """The last stage of a picture with these settings."""
    return replace(FINAL, n_lights=settings.n_lights, n_patches=settings.n_patches, own_rays=not settings.keeps_sphere)


class LightLink(NamedTuple):
    """Objects that not all lights reach, by their indices: the distant light that reaches them, and the emitters that
    do not (`dark`)."""

    objects: frozenset[int]
    sky: "SkyState"
    dark: frozenset[int] = frozenset()


@dataclass(frozen=True)
class SkyState:
    """The distant light: an environment (or none), rotated by `rotation` degrees, times `scale`. links: the objects
    that it does not reach, or that emitters do not (`engine.precompute.direct.linking`), each in one link at most."""

    environment: Environment | None
    rotation: float = 0.0
    scale: float = 1.0
    links: tuple[LightLink, ...] = ()


# Fractions of the visibility phase done after the sphere, the sky's brightest parts, and the emitters' leaves.
SPHERE_DONE, FINE_DONE, LEAVES_DONE = 0.6, 0.8, 0.95


def _rescale_progress(steps: Iterator[float], begin: float, end: float) -> Iterator[float]:
    """Maps the fractions of a part to those of the whole."""
    for fraction in steps:
        yield begin + (end - begin) * fraction


class Placement:
    """One scene seen from one camera."""

    def __init__(
        self, scene: Scene, caster: RayCaster | None = None, n_edge_rays: int = 0, hits: PrimaryHits | None = None
    ) -> None:
        """caster: that of the scene's triangles, if it exists already; n_edge_rays: see `trace_primary`; hits: the
        primary hits, if traced already."""
        self.scene = scene
        self.caster = caster or scene_caster(scene)
        self.hits = trace_primary(scene, self.caster, n_edge_rays=n_edge_rays) if hits is None else hits
        self.sphere: Visibility = empty_visibility(self.hits, sphere_targets(VISIBILITY_LEVEL))
        self._rows: dict[int, np.ndarray] = {}
        self._footprints: dict[int, tuple[np.ndarray, np.ndarray]] = {}
        self._nearest: dict[int, np.ndarray] = {}
        self._emitters: dict[int, EmitterTree | None] = {}
        self.has_shadows = True

    def without_shadows(self) -> "Placement":
        """The same, where nothing hides any light. Its sphere's visibility is not used."""
        part = copy(self)
        part.has_shadows, part._emitters = False, {}
        return part

    def with_emission(self, emission: Mapping[str, tuple[float, float, float]]) -> "Placement":
        """The same where emitters have another radiance, by name; with the same sphere's visibility."""
        part = copy(self)
        part.scene, part._emitters = self.scene.with_emission(emission), {}
        return part

    def at_rows(self, rows: np.ndarray) -> "Placement":
        """The same for some of its points, by ascending rows, with no visibility known."""
        part = copy(self)
        part.hits = self.hits.at(rows)
        part.sphere = empty_visibility(part.hits, self.sphere.targets)
        # The emitters are cut for its own points: sharing the whole's would make the result depend on the order of
        # calls.
        part._rows, part._footprints, part._nearest, part._emitters = {}, {}, {}, {}
        return part

    def rows_of(self, i_object: int, stride: int = 1) -> np.ndarray:
        """Rows of one object's points on the lattice of a stage, ascending."""
        begin, end = self.hits.object_ranges[i_object]
        rows = self.rows(stride)
        return rows[(rows >= begin) & (rows < end)]

    def rows(self, stride: int) -> np.ndarray:
        """Rows of all points on the lattice of a stage, ascending."""
        if stride not in self._rows:
            self._rows[stride] = lattice_rows(self.hits, stride)
        return self._rows[stride]

    def footprint(self, stride: int) -> tuple[np.ndarray, np.ndarray]:
        """The lattice samples that each point interpolates, with weights, see `footprint`."""
        if stride not in self._footprints:
            self._footprints[stride] = footprint(self.hits, self.rows(stride), stride)
        return self._footprints[stride]

    def nearest_rows(self, stride: int) -> np.ndarray:
        """The point on the lattice of a stage that counts most for each point, by rows (P,)."""
        if stride not in self._nearest:
            chosen, weights = self.footprint(stride)
            own = np.take_along_axis(chosen, weights.argmax(axis=1)[:, None], axis=1)[:, 0]
            rows = self.rows(stride)
            counts = np.diff(self.hits.object_ranges, axis=1)[:, 0]
            self._nearest[stride] = rows[own + np.repeat(np.searchsorted(rows, self.hits.object_ranges[:, 0]), counts)]
        return self._nearest[stride]

    def interpolated(self, samples: np.ndarray, i_object: int, stride: int) -> np.ndarray:
        """An object's picture (p, 3) at each of its points, of samples (s, 3) on the lattice of a stage."""
        begin, end = self.hits.object_ranges[i_object]
        rows, weights = (each[begin:end] for each in self.footprint(stride))
        return np.einsum("ps,psc->pc", weights, samples[rows])

    def light(self, sky: SkyState, quality: Quality) -> Generator[float, None, VisibleLight]:
        """Cuts the light of a stage, as if all of it reached all objects (`linking.light_groups` has those that it
        does reach), and traces its visibility; yields the fraction done."""
        rows = self.rows(quality.stride)
        own_rays = quality.own_rays and (quality.stays or not self.sphere.done[rows].all()) or not self.has_shadows
        cut = None
        if sky.environment is not None:
            seen = None
            if not own_rays:
                yield from _rescale_progress(self._trace_visibility(self.sphere, quality.stride), 0.0, SPHERE_DONE)
                seen = visible_shares(self.sphere, rows)
            cut = cut_lights(
                sky.environment,
                quality.n_lights,
                sky.rotation,
                quality.max_level,
                seen=seen,
                peak_level=quality.sun_level,
            )
        lighting = prepare_lighting(cut, self.emitters(quality.n_patches), quality.tolerance, own_rays, sky.scale)
        return (yield from self.visible_light(lighting, quality, own_rays))

    def visible_light(
        self, lighting: Lighting, quality: Quality, own_rays: bool = True
    ) -> Generator[float, None, VisibleLight]:
        """Traces the visibility of a light; yields the fraction done. own_rays: of one each of whose sky lights has a
        ray of its own."""
        rows = self.rows(quality.stride)
        fine = empty_visibility(self.hits, lighting.fine_targets)
        yield from _rescale_progress(
            self._trace_visibility(fine, quality.stride, None if own_rays else self.sphere), SPHERE_DONE, FINE_DONE
        )
        emitters = empty_visibility(self.hits, lighting.emitter_targets)
        yield from _rescale_progress(self._trace_visibility(emitters, quality.stride), FINE_DONE, LEAVES_DONE)
        if not self.has_shadows:
            return VisibleLight(lighting, self.sphere, fine, emitters, no_near_leaves(len(self.hits.pixel)))
        near = NearLight(self.hits, self.caster, lighting.emitters, emitters, rows)
        yield from _rescale_progress(near.find_steps(), LEAVES_DONE, 1.0)
        return VisibleLight(lighting, self.sphere, fine, emitters, near.leaves())

    def set_emission(self, emission: Mapping[str, tuple[float, float, float]]) -> None:
        """Sets the radiance of emitters, by name, see `Scene.with_emission`."""
        self.scene = self.scene.with_emission(emission)
        self._emitters.clear()

    def patches(self, n_patches: int) -> EmitterPatches | None:
        """The scene's emitters cut into about n_patches, or None where nothing emits."""
        return patches_of(self.scene, n_patches)

    def emitters(self, n_patches: int) -> EmitterTree | None:
        """The emitter tree with about n_patches leaves, for the picture's points; None where nothing emits."""
        if n_patches not in self._emitters:
            self._emitters[n_patches] = emitters_for(self.scene, self.caster, self.hits, n_patches)
        return self._emitters[n_patches]

    def _trace_visibility(
        self, visibility: Visibility, stride: int, sphere: Visibility | None = None
    ) -> Iterator[float]:
        if not self.has_shadows:
            see_all(visibility)
            return
        yield from coherent_visibility(self.hits, self.caster, visibility, stride, sphere)
        evaluate_rows(self.hits, self.caster, visibility, self.rows(stride))


def patches_of(scene: Scene, n_patches: int) -> EmitterPatches | None:
    """A scene's emitters cut into about n_patches, owned by their objects, or None where nothing emits."""
    emitting = emitting_triangles_of(scene)
    emitting = emitting.of(emitting_triangles(emitting.corners, emitting.radiance))
    if not len(emitting.corners):
        return None
    varying = emitting.radiance_of_parts(unmerged(emitting.corners, emitting.radiance))
    patches = emitter_patches(emitting.corners, emitting.radiance, n_patches, emitting.cones, varying)
    return replace(patches, owner=scene.object_of_triangle[emitting.triangle[patches.owner]])


def lattice_rows(hits: PrimaryHits, stride: int) -> np.ndarray:
    """Rows of `hits` at the centres of every `stride`-th pixel, ascending, (S,) int32; at least one for every visible
    object. For stride 1 all rows, including those beside pixel centres."""
    width, _ = hits.resolution
    if stride == 1:
        return np.arange(len(hits.pixel), dtype=np.int32)
    on_lattice = (hits.pixel // width % stride == 0) & (hits.pixel % width % stride == 0) & hits.is_centred
    for begin, end in hits.object_ranges:
        if end > begin and not on_lattice[begin:end].any():
            on_lattice[(begin + end) // 2] = True
    return np.flatnonzero(on_lattice).astype(np.int32)


def footprint(hits: PrimaryHits, samples: np.ndarray, stride: int) -> tuple[np.ndarray, np.ndarray]:
    """Four samples of the own object for each point, and their weights: ((P, 4) int32, (P, 4) float32 summing to 1).

    The samples are the nearest in the picture and in the direction of the normal, so that a picture of which only a
    lattice is computed is smooth on a surface and never bleeds over a silhouette or a sharp edge. samples (S,) are rows
    of `hits`; the indices returned count within the samples of the point's own object.
    """
    n_points, (width, height) = len(hits.pixel), hits.resolution
    chosen, distance = np.empty((n_points, N_SAMPLES), np.int32), np.empty((n_points, N_SAMPLES))
    nodes = np.full((-(-height // stride), -(-width // stride)), -1, np.int32)
    y, x = np.divmod(hits.pixel[samples], width)
    on_lattice = np.flatnonzero((y % stride == 0) & (x % stride == 0) & hits.is_centred[samples]).astype(np.int32)
    nodes[y[on_lattice] // stride, x[on_lattice] // stride] = on_lattice
    for begin, end in hits.object_ranges:
        first, last = np.searchsorted(samples, (begin, end))
        kernels.nearest_samples(
            begin, end, hits.pixel, hits.normal, width, stride, NORMAL_WEIGHT, samples, first, last - first, nodes,
            chosen, distance,
        )  # fmt: skip
    weights = np.maximum(1.0 - distance / 1.5, 0.0) ** 2 + 1e-6 / (1e-3 + distance)
    weights /= weights.sum(axis=1, keepdims=True)
    return chosen, weights.astype(np.float32)
