"""Shading points, blockers and lights placed by hand, and the whole way from them to band transport."""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from engine.light.emitters import EmitterTree, emitter_tree
from engine.light.environment import Environment
from engine.light.triangle_lights import TriangleLights, cut_lights
from engine.material import MODELS
from engine.material.layer import Layer, make_layer
from engine.precompute.direct.bandstore import BandStore
from engine.precompute.direct.lighting import prepare_lighting
from engine.precompute.direct.near_leaves import near_leaves
from engine.precompute.direct.projection import LayerShape, VisibleLight, project_layer
from engine.scene.picture_frame import no_lamps
from engine.scene.primary_hits import PrimaryHits
from engine.scene.raycaster import RayCaster
from engine.visibility.point_visibility import brute_force_visibility, sphere_targets

# Far below everything and tiny: a caster needs a triangle, an empty scene has none.
NOWHERE = np.array([[[0.0, -900.0, 0.0], [1e-3, -900.0, 0.0], [0.0, -900.0, 1e-3]]])


def points_at(
    position: np.ndarray, normal: np.ndarray, wo: np.ndarray | None = None, lift: float = 1e-6
) -> PrimaryHits:
    """P points of one object, a picture of P × 1 pixels; the eye stands on the normals unless wo (P, 3) says where."""
    position, normal = np.atleast_2d(np.float64(position)), np.atleast_2d(np.float64(normal))
    normal = np.broadcast_to(normal / np.linalg.norm(normal, axis=1, keepdims=True), position.shape)
    aside = np.where(np.abs(normal[:, :1]) < 0.9, [[1.0, 0.0, 0.0]], [[0.0, 0.0, 1.0]])
    tangent = np.cross(aside, normal)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    wo = normal if wo is None else np.broadcast_to(wo / np.linalg.norm(wo, axis=-1, keepdims=True), position.shape)
    n = len(position)

    def vectors(values: np.ndarray) -> np.ndarray:
        return np.ascontiguousarray(values, np.float32)

    return PrimaryHits(
        resolution=(n, 1),
        pixel=np.arange(n, dtype=np.int32),
        offset=np.zeros((n, 2), np.float32),
        share=np.ones(n, np.float32),
        object_ranges=np.array([[0, n]], np.int32),
        position=vectors(position),
        offset_position=vectors(position + lift * normal),
        horizon=vectors(normal),
        normal=vectors(normal),
        geometric_normal=vectors(normal),
        front=np.ones(n, bool),
        tangent=vectors(tangent),
        wo=vectors(wo),
        object_image=np.zeros((1, n), np.int16),
        open_image=np.zeros((1, n), np.float32),
        emission_image=np.zeros((1, n, 3), np.float32),
        lamps=no_lamps(),
        ray_directions=vectors(-wo).reshape(1, n, 3),
    )


def caster_of(triangles: np.ndarray = NOWHERE) -> RayCaster:
    """Rays against triangles (T, 3, 3)."""
    return RayCaster(np.reshape(triangles, (-1, 3)), np.arange(3 * len(triangles)).reshape(-1, 3))


def square(centre: Sequence[float], u: Sequence[float], v: Sequence[float]) -> np.ndarray:
    """Two triangles (2, 3, 3) of the square centre ± u/2 ± v/2; its front is the side of u × v."""
    c, u, v = np.float64(centre), np.float64(u) / 2, np.float64(v) / 2
    corners = np.array([c - u - v, c + u - v, c + u + v, c - u + v])
    return corners[[[0, 1, 2], [0, 2, 3]]]


@lru_cache(maxsize=16)
def cut_sky(environment: Environment, n_lights: int, rotation: float) -> TriangleLights:
    return cut_lights(environment, n_lights, rotation, 6)


def light_of(
    hits: PrimaryHits,
    environment: Environment | None = None,
    emitters: np.ndarray | None = None,
    blockers: np.ndarray = NOWHERE,
    n_lights: int = 4000,
    n_patches: int = 256,
    rotation: float = 0.0,
    tolerance: float = 0.5,
) -> VisibleLight:
    """Sky and emitters (T, 3, 3) of radiance 1, seen through the blockers, every answer traced."""
    sky: TriangleLights | None = None
    tree: EmitterTree | None = None
    if environment is not None:
        sky = cut_sky(environment, n_lights, rotation)
    if emitters is not None:
        tree = emitter_tree(emitters, np.ones((len(emitters), 3)), n_patches)
    lighting = prepare_lighting(sky, tree, tolerance)
    caster, rows = caster_of(blockers), np.arange(len(hits.pixel))
    seen = brute_force_visibility(hits, caster, lighting.emitter_targets, rows)
    return VisibleLight(
        lighting,
        brute_force_visibility(hits, caster, sphere_targets(4), rows),
        brute_force_visibility(hits, caster, lighting.fine_targets, rows),
        seen,
        near_leaves(hits, caster, lighting.emitters, seen, rows),
    )


def project(hits: PrimaryHits, light: VisibleLight, layer: Layer, bands: tuple[int, int]) -> BandStore:
    """All points of `hits` in bands (J, K); true transport is `lighting.unit` times the store's."""
    shape = LayerShape(layer.model.name, tuple(layer.quotient_parameters().tolist()), bands)
    return BandStore(bands, tuple(project_layer(hits, np.arange(len(hits.pixel)), light, shape)))


def irradiance(hits: PrimaryHits, light: VisibleLight, n_bands: int = 32) -> np.ndarray:
    """E (P, 3): the bands of a Lambert layer all together, times π."""
    store = project(hits, light, make_layer(MODELS["lambert"]), (n_bands, 1))
    return np.pi * light.lighting.unit * store.radiance(np.ones((n_bands, 3)), np.ones((1, 3)))


def contract(store: BandStore, factor: int, dormant: np.ndarray, wavelet: bool) -> np.ndarray:
    """Transport (J or K, P, 3) of one factor with the other at rest: c_B (K, 3) for factor 0, c_A (J, 3) for 1."""
    kept = np.zeros((store.bands[factor], 3))
    coefficients = (kept, dormant) if factor == 0 else (dormant, kept)
    return store.fill(factor, coefficients, np.ones(len(kept)), np.float32, wavelet).numbers


def bands_of(store: BandStore) -> np.ndarray:
    """U (P, J, K, 3), read off the store one band at a time."""
    n_a, n_b = store.bands
    rows = [contract(store, 0, np.eye(n_b)[k][:, None] * np.ones(3), wavelet=False) for k in range(n_b)]
    return np.stack(rows, axis=1).transpose(2, 0, 1, 3).reshape(store.n_points, n_a, n_b, 3)
