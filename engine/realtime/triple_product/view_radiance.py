"""The radiance that one picture shows, term by term."""

from __future__ import annotations

from collections.abc import Generator
from itertools import chain
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from engine.core.generators import StillProgress
from engine.realtime.triple_product.incident import SceneEmitters
from engine.realtime.triple_product.lamp_shadows import lamp_shadows
from engine.realtime.triple_product.lit_points import LitPoints
from engine.realtime.triple_product.mirrored_light import mirrored_light
from engine.realtime.triple_product.peak_shadows import peak_shadows
from engine.realtime.triple_product.perturbed_normals import (
    PerturbedSamples,
    perturb_samples,
    perturbed_irradiance,
    perturbed_reflection,
    quick_irradiance,
)
from engine.realtime.triple_product.pixel_light import PixelLight, added_up
from engine.realtime.triple_product.point_reflection import reflect_at_rest, reflect_moving, shade_points
from engine.realtime.triple_product.reflections import Reflections, Term
from engine.realtime.triple_product.sky_map import SkyMap
from engine.realtime.triple_product.view_maps import factors
from engine.realtime.triple_product.view_samples import ViewSamples, add_values, interpolate
from engine.scene.scene_loader import Scene

Float32Array = NDArray[np.float32]
Quality = Literal["moving", "rest", "still"]

N_MOVING = 64  # coefficients of a point in moving pictures
_N_SHARP = 96  # the same, at least, for sharp gloss, which fewer would blur
# Share of a pixel's radiance by which slices may disagree about a peak before the BRDF is evaluated for it.
_LITTLE = {"rest": 0.005, "still": 0.001}


def view_radiance(
    seen: ViewSamples, lit: LitPoints, reflections: Reflections, scene: Scene, sky: SkyMap,
    lamps: SceneEmitters | None, n_bounces: int,
    quality: Quality, n_moving: int,
) -> Generator[StillProgress, None, Float32Array]:  # fmt: skip
    """Radiance (R, 3) that samples reflect to the camera, computed term by term; see `Orbit.draw`."""
    radiance = np.zeros((len(seen.pixel), 3), np.float32)
    everywhere, mapped = np.ones((1, 3), np.float32), dict[int, dict[int, Float32Array]]()
    turned: dict[int, PerturbedSamples] = {}

    def reflected_by_bumps(which: NDArray[np.int64], term: Term) -> Float32Array:
        """Reflection of direct light by a term where bumps perturb normals, without its maps, (N, 3)."""
        if quality == "moving":
            light = quick_irradiance(seen, which, lit.incident, scene, term.i_object)
            return light * np.array(term.reflectance, np.float32)
        if term.i_object not in turned:
            turned.clear()
            turned[term.i_object] = perturb_samples(seen, which, scene, term.i_object)
        samples = turned[term.i_object]
        if term.reflectance is not None:
            light = perturbed_irradiance(seen, samples, lit.incident, sky)
            return light * np.array(term.reflectance, np.float32)
        tables = reflections.tables(term.layers)
        if tables is None:
            return np.zeros((len(which), 3), np.float32)
        return perturbed_reflection(seen, samples, lit.incident, sky, tables, quality == "still")

    if quality != "moving":
        found_out = _found_out(seen, lit, sky, lamps, quality)
    for done, term in enumerate(reflections.terms):
        which = seen.of(term.i_object)
        if not len(which):
            continue
        yield StillProgress(done / len(reflections.terms), "reflection")
        if term.factor is not None and term.i_object not in mapped:
            layers = reflections.layers_of[term.i_object]
            mapped[term.i_object] = factors(seen, which, scene, term.i_object, layers, quality)
        factor = everywhere if term.factor is None else mapped[term.i_object][term.factor]
        points = np.flatnonzero(lit.seen & (lit.points.i_object == term.i_object))
        # In moving pictures gloss ignores bumps: it is shaded at points, whose spacing exceeds the bumps.
        bumpy = term.i_object in scene.bump_normals.objects and (quality != "moving" or term.reflectance is not None)
        evenly = None if bumpy else term.reflectance
        tables = None if bumpy or term.reflectance is not None else reflections.tables(term.layers)
        is_sharp = term.reflectance is None and reflections.is_sharp(term.layers)
        shows = n_bounces > 1 and (quality == "still" and term.reflectance is None or quality == "rest" and is_sharp)
        albedo = None if shows else reflections.albedo(term)
        lit.colours[points] = lit.diffuse_radiance(points, evenly, albedo, n_bounces)
        if tables is not None and quality == "moving" and not is_sharp:
            shade_points(seen, points, lit.incident, tables, n_moving, lit.shades, lit.colours)
        interpolate(seen, which, lit.colours, factor, radiance)
        if bumpy:
            add_values(which, reflected_by_bumps(which, term), factor, radiance)
        elif term.reflectance is not None and quality != "moving":
            add_values(which, found_out.irradiance[which] * np.array(term.reflectance, np.float32), factor, radiance)
        if shows:
            normals = turned[term.i_object].frames[:, 1] if bumpy else None
            found = mirrored_light(seen, which, lit, scene, term.i_object, term.layers, quality, normals)
            add_values(which, found, factor, radiance)
        if tables is not None and quality != "moving":
            found = reflect_at_rest(seen, which, lit.incident, sky, term.layers, tables, _LITTLE[quality])
            found += found_out.reflected(seen, scene, term.i_object, term.layers)
            add_values(which, found, factor, radiance)
        elif tables is not None and is_sharp:
            found = reflect_moving(seen, which, lit.incident, sky, tables, max(n_moving, _N_SHARP))
            add_values(which, found, factor, radiance)
    return radiance


def _found_out(
    seen: ViewSamples, lit: LitPoints, sky: SkyMap, lamps: SceneEmitters | None, quality: Quality
) -> PixelLight:
    """Corrections for peaks and lamps that samples find with rays of their own."""
    reflects = np.flatnonzero(seen.samples.corners[:, 0] >= 0)
    of_peaks = peak_shadows(seen, reflects, lit.incident, sky, lit.caster, quality == "still")
    of_lamps = lamp_shadows(seen, reflects, lamps, lit.caster, quality) if lamps is not None else ()
    has_gloss = np.zeros(len(seen.pixel), bool)
    has_gloss[reflects] = lit.incident.slot[seen.samples.corners[reflects, 0]] >= 0
    return added_up(seen, chain(of_peaks, of_lamps), has_gloss)
