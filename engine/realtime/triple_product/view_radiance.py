"""The radiance that one picture shows, term by term.

The coefficients of light hold emitters and sky, not surfaces that these light: rooms in a mirror ball, shelves in a
varnished floor. So glossy pixels at rest trace a few rays, importance-sampled by their layers, to other shading points,
and add the radiance of these. At rest only sharp gloss does: blunt gloss reflects what its gathering points' rays met
(`glossy_bounces`). In moving pictures, a glossy surface reflects that light as a diffuse one of its equivalent albedo
does.
"""

from __future__ import annotations

import math
from collections.abc import Generator, Sequence
from itertools import chain
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from engine.core.threads import on_threads
from engine.material.layer import FRAMES, Frame, Layer
from engine.realtime.core.gpu_parts import n_sharp
from engine.realtime.core.view_samples import Rows, ViewSamples, add_values, factors, interpolate
from engine.realtime.triple_product.incident import ReachingLight, SceneEmitters, SkyMap
from engine.realtime.triple_product.lit_points import EXACTLY, LitPoints
from engine.realtime.triple_product.pixel_light import PixelLight, emitter_shadows, peak_shadows, sum_corrections
from engine.realtime.triple_product.pixel_reflection import (
    PerturbedSamples,
    perturb_samples,
    perturbed_irradiance,
    perturbed_reflection,
    quick_irradiance,
    quick_normal_offsets,
    reflect_at_pixels,
    shade_points,
)
from engine.realtime.triple_product.reflections import Reflections, Term
from engine.reference.path_lobes import N_NUMBERS, Scattering
from engine.render.still import StillProgress
from engine.scene.scene_loader import Scene
from engine.scene.shading_frames import LEAST_COSINE

Float32Array = NDArray[np.float32]
Quality = Literal["moving", "rest", "still"]

N_MOVING = 64  # coefficients of a point in moving pictures
# Share of a pixel's radiance by which slices may disagree about a peak before the BRDF is evaluated for it.
_LITTLE = {"moving": 0.005, "rest": 0.005, "still": 0.001}
N_RAYS = {"rest": 4, "still": 32}  # of a glossy sample, to other surfaces
_RAYS_AT_ONCE = 65536
_BRIGHTEST = 1e4  # limit of a ray's contribution, relative to the radiance of the surface that it meets


def view_radiance(
    seen: ViewSamples, lit: LitPoints, reflections: Reflections, scene: Scene, lights: Sequence[ReachingLight],
    n_bounces: int, quality: Quality, n_moving: int,
) -> Generator[StillProgress, None, Float32Array]:  # fmt: skip
    """Radiance (R, 3) that samples reflect to the camera, computed term by term; see `Orbit.draw`. lights: of each
    object, in one of them."""
    radiance = np.zeros((len(seen.pixel), 3), np.float32)
    everywhere, mapped = np.ones((1, 3), np.float32), dict[int, dict[int, Float32Array]]()
    perturbed: dict[tuple[int, Frame], PerturbedSamples] = {}

    def perturb(which: NDArray[np.int64], i_object: int, frame: Frame) -> PerturbedSamples:
        if (i_object, frame) not in perturbed:
            for other in [each for each in perturbed if each[0] != i_object]:
                del perturbed[other]
            perturbed[i_object, frame] = perturb_samples(seen, which, scene.in_frame(frame), i_object)
        return perturbed[i_object, frame]

    def left_by_covers(which: NDArray[np.int64], term: Term) -> Float32Array:
        """What covers of the other frame leave of a term (N, 1), relative to what they do at the normal of its own: its
        layers, and so their slices, have that."""
        other = FRAMES[1 - FRAMES.index(term.frame)]
        own, at_cover = (
            np.einsum("ni,ni->n", each.wo, each.frames[:, 1], dtype=np.float64)
            for each in (perturb(which, term.i_object, frame) for frame in (term.frame, other))
        )
        share = np.ones(len(which))
        for cover in term.covers:
            for cosines, power in ((at_cover, 1.0), (own, -1.0)):
                theta_o = np.arccos(np.clip(cosines, LEAST_COSINE, 1.0))
                share *= np.maximum(1.0 - cover.coverage(theta_o), LEAST_COSINE) ** power
        return np.asarray(share[:, None], np.float32)

    def sky_of(i_object: int) -> SkyMap:
        return next(each.sky for each in lights if each.objects[i_object])

    def emitters_of(i_object: int) -> SceneEmitters | None:
        """None as well while some light is coarse."""
        if (lit.state[lit.seen] != EXACTLY).any():
            return None
        return next(each.emitters for each in lights if each.objects[i_object])

    def reflected_by_bumps(which: NDArray[np.int64], term: Term) -> Float32Array:
        """Reflection of direct light by a term where bumps perturb normals, without its maps, (N, 3)."""
        if quality == "moving":
            light = quick_irradiance(seen, which, lit.incident, scene.in_frame(term.frame), term.i_object)
            return light * np.array(term.reflectance, np.float32)
        samples, sky = perturb(which, term.i_object, term.frame), sky_of(term.i_object)
        if term.reflectance is not None:
            light = perturbed_irradiance(seen, samples, lit.incident, sky)
            return light * np.array(term.reflectance, np.float32)
        tables = reflections.tables(term.layers)
        if tables is None:
            return np.zeros((len(which), 3), np.float32)
        return perturbed_reflection(seen, samples, lit.incident, sky, term.layers, tables, quality == "still")

    if quality != "moving":
        corrections = _pixel_light(seen, lit, lights, quality)
    for done, term in enumerate(reflections.terms):
        which = seen.of(term.i_object)
        if not len(which):
            continue
        yield StillProgress(done / len(reflections.terms), "reflection")
        sky = sky_of(term.i_object)
        if term.factor is not None and term.i_object not in mapped:
            layers = reflections.layers_of[term.i_object]
            mapped[term.i_object] = factors(seen, which, scene, term.i_object, layers, quality)
        factor = everywhere if term.factor is None else mapped[term.i_object][term.factor]
        # In moving pictures covers take their share at the term's own normal.
        if term.covers and quality != "moving" and scene.in_coat_frame is not None:
            factor = np.asarray(factor * left_by_covers(which, term), np.float32)
        points = np.flatnonzero(lit.seen & (lit.points.i_object == term.i_object))
        is_sharp = term.reflectance is None and reflections.is_sharp(term.layers)
        has_bumps = term.i_object in scene.in_frame(term.frame).bump_normals.objects
        # In moving pictures blunt gloss ignores bumps: it is shaded at points, whose spacing exceeds the bumps. Sharp
        # gloss is looked up by the perturbed normal.
        bumpy = has_bumps and (quality != "moving" or term.reflectance is not None)
        # At rest, gloss takes each pixel's own rotation of the tangent from a map; in moving pictures the points'.
        has_map = term.i_object in scene.tangent_rotations.mapped and term.reflectance is None
        bumpy |= has_map and quality != "moving"
        evenly = None if bumpy else term.reflectance
        tables = None if bumpy or term.reflectance is not None else reflections.tables(term.layers)
        shows = n_bounces > 1 and (quality == "still" and term.reflectance is None or quality == "rest" and is_sharp)
        slices = reflections.tables(term.layers) if quality == "rest" and term.reflectance is None else None
        albedo = None if shows or slices is not None else reflections.albedo(term)
        lit.colours[points] = lit.diffuse_radiance(points, evenly, albedo, n_bounces)
        if slices is not None and n_bounces > 1 and not shows:
            lit.colours[points] += lit.reflected_indirect(points, seen.camera_position, slices)
        if tables is not None and quality == "moving" and not is_sharp:
            shade_points(seen, points, lit.incident, tables, n_moving, lit.shades, lit.colours)
        interpolate(seen, which, lit.colours, factor, radiance)
        if bumpy:
            add_values(which, reflected_by_bumps(which, term), factor, radiance)
        elif term.reflectance is not None and quality != "moving":
            add_values(which, corrections.irradiance[which] * np.array(term.reflectance, np.float32), factor, radiance)
        if shows:
            normals = perturb(which, term.i_object, term.frame).frames[:, 1] if bumpy else None
            found = mirrored_light(seen, which, lit, scene, term.i_object, term.layers, quality, normals)
            add_values(which, found, factor, radiance)
        if tables is not None and quality != "moving":
            found = reflect_at_pixels(
                seen, which, lit.incident, sky, term.layers, tables, _LITTLE[quality],
                emitters=emitters_of(term.i_object), width=math.sqrt(reflections.lobe(term.layers)),
            )  # fmt: skip
            found += corrections.reflected(seen, scene, term.i_object, term.layers)
            add_values(which, found, factor, radiance)
        elif tables is not None and is_sharp:
            own = scene.in_frame(term.frame)
            offsets = quick_normal_offsets(seen, which, own, term.i_object) if has_bumps else None
            found = reflect_at_pixels(
                seen, which, lit.incident, sky, term.layers, tables, _LITTLE[quality], n_sharp(n_moving), offsets
            )
            add_values(which, found, factor, radiance)
    return radiance


def _pixel_light(seen: ViewSamples, lit: LitPoints, lights: Sequence[ReachingLight], quality: Quality) -> PixelLight:
    """Corrections for peaks and emitters that samples find with rays of their own."""
    reflects = np.flatnonzero(seen.samples.corners[:, 0] >= 0)
    found = []
    for objects, sky, emitters in lights:
        mine = reflects[objects[seen.samples.i_object[reflects]]]
        found.append(peak_shadows(seen, mine, lit.incident, sky, lit.caster, quality == "still"))
        if emitters is not None:
            found.append(emitter_shadows(seen, mine, emitters, lit.caster, quality))
    has_gloss = np.zeros(len(seen.pixel), bool)
    has_gloss[reflects] = lit.incident.slot[seen.samples.corners[reflects, 0]] >= 0
    return sum_corrections(seen, chain.from_iterable(found), has_gloss)


def mirrored_light(
    seen: ViewSamples, which: Rows, lit: LitPoints, scene: Scene, i_object: int, layers: Sequence[Layer], quality: str,
    normals: Float32Array | None = None,
) -> Float32Array:  # fmt: skip
    """Radiance (N, 3) from other surfaces that an object's layers reflect to the camera at samples (N,).

    normals (N, 3): perturbed by bumps; None for those interpolated between points.
    """
    found, n_rays = np.zeros((len(which), 3), np.float32), N_RAYS[quality]
    scattering, step = Scattering(layers), max(_RAYS_AT_ONCE // n_rays, 1)
    chance = np.random.default_rng(4)
    pattern, shifts = chance.random((n_rays, N_NUMBERS)), chance.random((len(which), N_NUMBERS))
    late = lit.late
    pattern[:, 0] = (np.arange(n_rays) + pattern[:, 0]) / n_rays  # the lobes in turn

    def part(start: int) -> None:
        some = which[start : start + step]
        between = seen.normals(some)
        frames = seen.frames(some, scene, i_object, None if normals is None else normals[start : start + step])
        frames, towards = np.repeat(frames, n_rays, axis=0), np.repeat(seen.samples.wo[some], n_rays, axis=0)
        wo = np.einsum("nij,nj->ni", frames, towards)
        wo[:, 2] = np.maximum(wo[:, 2], LEAST_COSINE)
        wo /= np.linalg.norm(wo, axis=1, keepdims=True)
        numbers = ((pattern + shifts[start : start + step, None]) % 1.0).reshape(-1, N_NUMBERS)
        wi = scattering.sample(numbers, wo)
        value, pdf = scattering.evaluate(wi, wo)
        directions = np.einsum("nij,ni->nj", frames, wi).astype(np.float32)
        above = np.einsum("ni,ni->n", directions, np.repeat(between, n_rays, axis=0)) > 0.0
        rays = np.flatnonzero((pdf > 0.0) & above)
        lifted = np.repeat(lit.caster.offset_origins(seen.places(some), between), n_rays, axis=0)
        met, _ = lit.mesh.trace(lifted[rays], directions[rays])
        of_back, own = late[met.corners[:, 0]], np.repeat(late[seen.samples.corners[some, 0]], n_rays)[rays]
        hit = (met.corners[:, 0] >= 0) & ((of_back < 0) | (of_back == own))
        sent = np.einsum("nk,nki->ni", met.weights[hit], lit.sent_on[met.corners[hit]])
        weight = np.minimum(value[rays[hit]] / pdf[rays[hit], None], _BRIGHTEST)
        for i in range(3):
            total = np.bincount(rays[hit] // n_rays, weight[:, i] * sent[:, i], len(some))
            found[start : start + step, i] = total / n_rays

    on_threads(part, range(0, len(which), step))
    return found
