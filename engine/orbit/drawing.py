"""What is reflected to the eye in one picture, term by term."""

from __future__ import annotations

from collections.abc import Generator
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from engine.orbit.lit_points import LitPoints
from engine.orbit.picture import Seen, interpolated
from engine.orbit.reflected import reflected, shaded, sunlit
from engine.orbit.reflections import Reflections
from engine.orbit.seen_maps import factors
from engine.orbit.sky import Sky
from engine.render.still import StillProgress
from engine.scene.load import Scene

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
    everywhere, mapped = np.ones((1, 3), np.float32), dict[int, dict[int, Floats]]()
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
        lit.colours[points] = lit.sent_evenly(points, term.reflectance, reflections.albedo(term), n_bounces)
        tables = None if term.reflectance is not None else reflections.tables(term.layers)
        if tables is not None and quality == "moving":
            shaded(seen, points, lit.incident, tables, n_moving, lit.shades, lit.colours)
        interpolated(seen, which, lit.colours, factor, radiance)
        if tables is not None and quality != "moving":
            others = reflected(seen, which, lit.incident, tables)
            suns = sunlit(seen, which, lit.incident, sky, term.layers, tables, others, _LITTLE[quality])
            radiance[which] += factor * (others + suns)
    return radiance
