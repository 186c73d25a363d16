"""Orbit's knobs: coefficients kept of light, at rest and while something moves; points; which are kept, in how many
bits.

Pictures are judged at random pixels inside of objects, in direct light, by brute force over 81,920 directions. What
selection and bits do is found without the tables: the three factors at each pixel, truncated (`truncation`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.measure.accuracy import oracle
from app.measure.knobs import Knob, Shown
from app.measure.orbit import _inner_rows, _layers_of, _wait
from app.measure.subject import Subject
from app.measure.sweep import MIB
from app.measure.truncation import Float64Array, direct_factors
from app.project.project import Project
from engine.core.stored_arrays import Arrays
from engine.precompute.direct.pipeline import Placement
from engine.realtime.triple_product.orbit_engine import N_COEFFICIENTS, N_POINTS, Orbit
from engine.realtime.triple_product.view_radiance import N_MOVING, Quality
from engine.sphere.haar import Rule, forward, inverse, select_coefficients

SELECTIONS: dict[str, Rule] = {"adaptive, by size": "size", "adaptive, by energy": "energy", "top only": "top"}
WHOLE = "single precision"
_BFLOAT = "bfloat16"


@dataclass(frozen=True)
class OrbitKnobs:
    """Judged pixels and the oracle's level; the settings: coefficients kept, drawn while something moves, points
    besides the meshes' vertices, coefficients of each factor by selection, and bits of each; n_points: besides the
    meshes' vertices, where these are no matter."""

    n_pixels: int = 150
    level: int = 6
    kept: tuple[int, ...] = (20, 80, 160, 320, 640, 1280)
    moving: tuple[int, ...] = (20, 40, 64, 128, 320)
    points: tuple[int, ...] = (2500, 40_000)
    selected: tuple[int, ...] = (20, 80, 320, 1280)
    bits: tuple[int | str, ...] = (4, 6, 8, 10, 12, _BFLOAT, WHOLE)
    n_points: int = N_POINTS


QUICKLY = OrbitKnobs(16, 5, (320,), (20, 64), (), (20, 320), (4, 8, WHOLE), 100)


def orbit_knobs(subject: Subject, project: Project, effort: OrbitKnobs) -> Iterator[Knob]:
    """Of a subject in the resolution that is drawn. Raises NotMeasured where no pixel is inside of an object."""
    bench = _Bench(subject, project, effort)
    yield bench.knob("coefficients at rest", effort.kept, lambda n: bench.drawn("rest", n), N_COEFFICIENTS, "a picture")
    yield bench.knob("coefficients in motion", effort.moving, bench.moving, N_MOVING, "a picture")
    yield bench.knob("points", effort.points, bench.placed, N_POINTS, "making ready")
    if project.sky.environment is not None:
        for name, rule in SELECTIONS.items():
            yield bench.by_factors(
                f"coefficients, {name}", effort.selected, lambda n, r=rule: bench.selected(n, r), None
            )
        yield bench.by_factors("bits of a coefficient", effort.bits, bench.rounded, _BFLOAT)


class _Bench:
    def __init__(self, subject: Subject, project: Project, effort: OrbitKnobs) -> None:
        self._project, self._effort, self._layers = project, effort, _layers_of(project)
        self._placement = Placement(project.scene)
        self._rows = _inner_rows(self._placement.hits, effort.n_pixels)
        self._pixels = self._placement.hits.pixel[self._rows]
        self._truth = oracle(subject, self._placement, self._rows, effort.level)
        self._ready: dict[int, Orbit] = {}
        self._seen: Arrays | None = None

    def knob(self, name: str, settings: Any, make: Any, present: Any, cost: str) -> Knob:
        return Knob("orbit", name, settings, make, self._truth, present, cost)

    def drawn(self, quality: Quality, n_kept: int, n_moving: int = N_MOVING) -> Any:
        orbit = self._orbit(n_kept)

        def compute() -> Shown:
            picture = orbit.draw(
                self._project.scene.description.camera, self._project.scene.resolution, quality, n_moving
            )
            return Shown(picture.reshape(-1, 3)[self._pixels], orbit.n_bytes / MIB)

        return compute

    def moving(self, n: int) -> Any:
        return self.drawn("moving", N_COEFFICIENTS, n)

    def placed(self, n_points: int) -> Any:
        """From an opened scene to a picture at rest."""

        def compute() -> Shown:
            self._ready = {N_COEFFICIENTS: self._made(N_COEFFICIENTS, n_points)}
            shown: Shown = self.drawn("rest", N_COEFFICIENTS)()
            return shown

        return compute

    def _orbit(self, n_kept: int) -> Orbit:
        if n_kept not in self._ready:
            self._ready = {n_kept: self._made(n_kept, self._effort.n_points, self._seen)}
            self._seen = self._seen or self._ready[n_kept].stored_visibility()
        return self._ready[n_kept]

    def _made(self, n_kept: int, n_points: int, seen: Arrays | None = None) -> Orbit:
        """Made ready, and what the camera sees from behind as well; seen: what is known of visibility."""
        orbit = Orbit(self._project.scene, self._placement.caster, n_points, n_kept)
        if seen is not None:
            orbit.restore(seen)
        _wait(orbit, self._project.sky, self._layers)
        orbit.draw(self._project.scene.description.camera, self._project.scene.resolution)
        _wait(orbit, self._project.sky, self._layers)
        return orbit

    # ------------------------------------------------------------------------------------------- factors alone

    def by_factors(self, name: str, settings: Any, make: Any, present: Any) -> Knob:
        return Knob("orbit", name, settings, make, self._factors[0], present, "factors alone, not timed", timed=False)

    @cached_property
    def _factors(self) -> tuple[Float64Array, list[tuple[Float64Array, ...]]]:
        """The truth at the pixels, and the coefficients of light, visibility and reflection at each."""
        hits, sky, level = self._placement.hits, self._project.sky, self._effort.level
        truth, means = direct_factors(hits, self._rows, self._placement.caster, self._layers, sky, level)
        return truth, [tuple(forward(each) for each in factors) for factors in means]

    def selected(self, n: int, rule: Rule) -> Any:
        return lambda: self._multiplied(lambda each: np.where(select_coefficients(each, n, rule)[:, None], each, 0.0))

    def rounded(self, bits: int | str) -> Any:
        return lambda: self._multiplied(
            lambda each: in_bits(np.where(select_coefficients(each, N_COEFFICIENTS)[:, None], each, 0.0), bits)
        )

    def _multiplied(self, change: Any) -> Shown:
        """The three factors of each pixel, changed and multiplied."""
        products = (np.prod([*np.broadcast_arrays(*(inverse(change(each)) for each in of))], axis=0)
                    for of in self._factors[1])  # fmt: skip
        return Shown(np.stack([product.sum(axis=0) for product in products]))


def in_bits(values: Float64Array, bits: int | str) -> NDArray[np.floating]:
    """Numbers rounded to so many bits of the largest, sign included; to bfloat16, as Orbit keeps them; or not."""
    if bits == WHOLE:
        return values
    if bits == _BFLOAT:
        mantissa, exponent = np.frexp(values)
        return np.asarray(np.ldexp(np.rint(mantissa * 256.0) / 256.0, exponent))
    step = np.abs(values).max() / (2.0 ** (int(bits) - 1) - 1.0)
    return values if step == 0.0 else np.asarray(np.rint(values / step) * step)
