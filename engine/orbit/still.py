"""A still in Orbit's way, from geometry to pixels: direct light, from the scene's own camera or any other."""

from __future__ import annotations

from collections.abc import Callable, Generator, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from engine.material.layer import Layer
from engine.orbit.incident import Lamps, light, no_light
from engine.orbit.picture import Seen, look, picture, reflected, sunlit
from engine.orbit.shading_points import ShadingPoints, shading_points
from engine.orbit.sky import make_sky
from engine.orbit.slices import make_slices
from engine.orbit.visibility import N_UPPER, Bits, see, see_patches
from engine.render.maps import MapFactors
from engine.render.still import StillProgress
from engine.transport.pipeline import Placement, SkyState

Floats = NDArray[np.float32]
LayersOf = Mapping[int, Sequence[Layer]]

N_POINTS = 40_000  # besides the meshes' own vertices
N_COEFFICIENTS = 320
_SEEING, _LIGHTING = 0.8, 0.95  # how far the two are when they end


def render_orbit(
    placement: Placement,
    layers_of: LayersOf,
    sky: SkyState,
    n_patches: int,
    n_points: int = N_POINTS,
    n_coefficients: int = N_COEFFICIENTS,
) -> Generator[StillProgress, None, Floats]:
    """Radiance (H, W, 3) after one reflection, as Orbit shows it at rest; yields how far it is.

    layers_of: the layers of each object, by its index.
    """
    scene, caster = placement.scene, placement.caster
    camera, resolution = scene.description.camera, placement.hits.resolution
    yield StillProgress(0.0, "shading points")
    points = shading_points(scene, caster, n_points)
    seen = look(scene, points, points.caster(), camera, resolution)
    if seen.from_behind:
        points = shading_points(scene, caster, n_points, seen.from_behind)
        seen = look(scene, points, points.caster(), camera, resolution)
    bits = yield from _visibility(points, placement)
    patches = placement.patches(n_patches)
    lamps = None if patches is None else Lamps(patches, see_patches(points, caster, patches))
    environment = None
    if sky.environment is not None:
        environment = replace(sky.environment, radiance=sky.environment.radiance * np.float32(sky.scale))
    incident, lit_sky = no_light(points, n_coefficients), make_sky(environment, sky.rotation)
    for done in light(points, bits, lit_sky.sunless, incident, lamps):
        share = done / max(len(points), 1)
        yield StillProgress(_SEEING + (_LIGHTING - _SEEING) * share, "light at the shading points")
    yield StillProgress(_LIGHTING, "reflection")

    def reflect(layers: LayersOf) -> Floats:
        slices = {i: make_slices(own) for i, own in layers.items()}
        return reflected(points, seen, incident, slices) + sunlit(points, bits, seen, lit_sky, layers)

    return picture(seen, _with_maps(placement, seen, layers_of, reflect), environment, sky.rotation)


def _visibility(points: ShadingPoints, placement: Placement) -> Generator[StillProgress, None, Bits]:
    bits = np.empty((len(points), N_UPPER // 2), np.uint8)
    for start, stop, part in see(points, placement.caster):
        bits[start:stop] = part
        yield StillProgress(_SEEING * stop / len(points), "visibility")
    return bits


def _with_maps(placement: Placement, seen: Seen, layers_of: LayersOf, reflect: Callable[[LayersOf], Floats]) -> Floats:
    """What is reflected at the pixels that see a point (P, 3), textures and weight maps multiplied in.

    Layers without maps that lie on one another are one reflection; each of the others is one of its own.
    """
    visible = {i: [layer for layer in layers if layer.visible] for i, layers in layers_of.items()}
    factors = MapFactors(placement.scene, layers_of).of_eye(placement)
    of_pixel = np.ones((placement.hits.object_image.size, *factors.shape[1:]), np.float32)
    of_pixel[placement.hits.pixel] = factors
    plain = {i: [layer for layer in layers if layer.maps.is_plain] for i, layers in visible.items()}
    total = reflect({i: layers for i, layers in plain.items() if layers})
    for k in range(factors.shape[1]):
        mapped = {i: [own[k]] for i, own in visible.items() if k < len(own) and not own[k].maps.is_plain}
        total += of_pixel[seen.pixel, k] * reflect(mapped)
    return total
