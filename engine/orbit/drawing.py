"""What is reflected to the eye in one picture, term by term."""

from __future__ import annotations

from collections.abc import Generator
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from engine.material.layer import Layer
from engine.orbit.lit_points import LitPoints
from engine.orbit.picture import Seen, interpolated, reflected, shaded, sunlit
from engine.orbit.reflections import Reflections, Term
from engine.orbit.sky import Sky
from engine.render.maps import MapFactors
from engine.render.still import StillProgress
from engine.scene.load import Scene
from engine.threads import even_parts, on_threads

Floats = NDArray[np.float32]
Quality = Literal["moving", "rest", "still"]

N_MOVING = 64  # coefficients of a point, while something moves
# Of what a pixel reflects: by which a sun may differ among the slices around it and be looked up in them.
_LITTLE = {"rest": 0.005, "still": 0.001}


def reflected_light(
    seen: Seen, lit: LitPoints, reflections: Reflections, scene: Scene, sky: Sky, n_bounces: int, quality: Quality,
    n_moving: int,
) -> Generator[StillProgress, None, Floats]:  # fmt: skip
    """Radiance (R, 3) that samples reflect to the eye, found term by term; see `Orbit.draw`."""
    radiance = np.zeros((len(seen.pixel), 3), np.float32)
    factors: dict[int, Floats] = {}

    def add(which: NDArray[np.int64], term: Term, out: Floats) -> None:
        """What a term reflects at samples (N,) of its object, without its maps, to out (R, 3)."""
        if n_bounces > 1:
            interpolated(seen, which, lit.indirect, out, reflections.albedo(term) / np.pi)
        if term.reflectance is not None:
            interpolated(seen, which, lit.incident.irradiance, out, np.array(term.reflectance))
        elif (tables := reflections.tables(term.layers)) is not None:
            if quality != "moving":
                others = reflected(seen, which, lit.incident, tables)
                suns = sunlit(seen, which, lit.incident, sky, term.layers, tables, others, _LITTLE[quality])
                out[which] += others + suns
            else:
                points = np.flatnonzero(lit.seen & (lit.points.i_object == term.i_object))
                shaded(seen, points, lit.incident, tables, n_moving, lit.colours)
                interpolated(seen, which, lit.colours, out, np.ones(3))

    for done, term in enumerate(reflections.terms):
        which = seen.of(term.i_object)
        if not len(which):
            continue
        yield StillProgress(done / len(reflections.terms), "reflection")
        if term.factor is None:
            add(which, term, radiance)
            continue
        if term.i_object not in factors:
            factors[term.i_object] = _factors(seen, which, scene, term.i_object, reflections.layers_of[term.i_object])
        own = np.zeros_like(radiance)
        add(which, term, own)
        radiance[which] += own[which] * factors[term.i_object][:, term.factor]
    return radiance


def _factors(seen: Seen, which: NDArray[np.int64], scene: Scene, i_object: int, layers: tuple[Layer, ...]) -> Floats:
    """By what maps multiply the visible layers of an object at samples (N,), (N, K, 3)."""
    maps = MapFactors(scene, {i_object: layers})

    def part(start: int, stop: int) -> Floats:
        n = stop - start
        return maps.of_hits(seen.in_scene(which[start:stop]), np.full(n, i_object), np.arange(n))

    return np.concatenate(on_threads(part, *even_parts(len(which))))
