"""What the program could do in another way, measured as settings beside those of the program (`app.measure.settings`).

Placement: shadows by the methods of the thesis, the coefficients that a frame changes chosen by other strategies, and
indirect light as the thesis' dense tensor. Orbit: which coefficients are kept, and in how many bits, found without its
tables: the three factors at each pixel, truncated (`haar_truncation`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.measure.settings import Outcome, Setting
from app.measure.settings_orbit import inner_rows
from app.measure.settings_placement import DirectPictures, DraggedCurve, PlacementValues, Strategy
from app.measure.subject import Subject, visibility_seconds
from app.project.project import Project
from app.stills.stills import layers_by_object
from benchmarks.haar_truncation import direct_factors
from benchmarks.indirect_representations import representation_setting
from benchmarks.thesis_visibility import variant_visibility, voronoi_targets
from engine.precompute.direct.pipeline import FINAL, Placement
from engine.realtime.triple_product.orbit_engine import N_COEFFICIENTS
from engine.sphere.haar import Rule, forward, inverse, select_coefficients
from engine.visibility.point_visibility import brute_force_visibility

SHADOWS = ("ours", "cut alone", "OPT", "GNU", "GWU", "SWB", "TRUE")
# Beside "wavelets a frame", which increments by effect: strategy, and whether a coefficient counts by its effect.
FRAMES: dict[str, tuple[Strategy, bool]] = {
    "incremented, by |Δc|": ("incremented", False),
    "anew, by effect": ("anew", True),
    "anew, by |c| (standard non-linear)": ("anew", False),
    "by bands, by effect": ("by bands", True),
}
SELECTIONS: dict[str, Rule] = {"adaptive, by size": "size", "adaptive, by energy": "energy", "top only": "top"}
WHOLE = "single precision"
_BFLOAT = "bfloat16"

Float64Array = NDArray[np.float64]


@dataclass(frozen=True)
class VariantEffort:
    """shadows: methods; frozen: objects, bounces and side in pixels where representations of indirect light are
    compared; n_pixels, level: judged pixels of Orbit and the level of their directions; selected: coefficients of each
    factor by selection; bits: of each coefficient."""

    shadows: tuple[str, ...] = SHADOWS
    frozen: tuple[int, int, int] = (4, 4, 96)
    n_pixels: int = 150
    level: int = 6
    selected: tuple[int, ...] = (20, 80, 320, 1280)
    bits: tuple[int | str, ...] = (4, 6, 8, 10, 12, _BFLOAT, WHOLE)


QUICK = VariantEffort(("ours", "TRUE"), (2, 2, 24), 16, 5, (20, 320), (4, 8, WHOLE))


def variant_settings(
    subject: Subject, project: Project, placement: PlacementValues, effort: VariantEffort
) -> Iterator[Setting]:
    """Of a scene; placement: how Placement's settings are measured. Raises InsituError where no pixel is inside of an
    object."""
    direct = DirectPictures(subject, placement)
    if direct.has_sky:
        yield direct.setting(
            "shadows", effort.shadows, lambda method: _with_shadows(direct, method), "ours", "visibility and transport"
        )
    dragged = DraggedCurve(direct, placement)
    for name, (strategy, by_effect) in FRAMES.items():
        yield dragged.setting(f"wavelets a frame, {name}", strategy, by_effect)
    yield representation_setting(*effort.frozen)
    if direct.has_sky:
        yield from orbit_variants(project, effort)


def _with_shadows(direct: DirectPictures, method: str) -> Callable[[], Outcome]:
    """What sees the sphere by one method and computes the stage."""
    placement = Placement(direct.subject.scene, direct.placement.caster)

    def compute() -> Outcome:
        if method == "ours":
            visibility_seconds(placement)
        elif method == "TRUE":
            everything = np.arange(len(placement.hits.pixel))
            targets = placement.sphere.targets
            placement.sphere = brute_force_visibility(placement.hits, placement.caster, targets, everything)
        elif method != "cut alone":
            around = voronoi_targets(placement.sphere.targets.positions.astype(np.float64)).neighbours
            targets = replace(placement.sphere.targets, neighbours=around)
            found = variant_visibility(placement.hits, placement.caster, targets, method)  # type: ignore[arg-type]
            placement.sphere = replace(found, targets=placement.sphere.targets)
        outcome: Outcome = direct.stage(replace(FINAL, own_rays=method == "cut alone"), None, placement)()
        return outcome

    return compute


def orbit_variants(project: Project, effort: VariantEffort) -> Iterator[Setting]:
    """The three factors of each judged pixel, changed and multiplied again."""
    placement = Placement(project.scene)
    rows = inner_rows(placement.hits, effort.n_pixels)
    layers = layers_by_object(project)
    truth, means = direct_factors(placement.hits, rows, placement.caster, layers, project.sky, effort.level)
    factors = [[forward(each) for each in of_pixel] for of_pixel in means]

    def multiplied(change: Callable[[Float64Array], NDArray[np.floating]]) -> Outcome:
        products = [
            np.prod([*np.broadcast_arrays(*(inverse(change(each)) for each in of_pixel))], axis=0)
            for of_pixel in factors
        ]
        return Outcome(np.stack([product.sum(axis=0) for product in products]))

    def kept(each: Float64Array, n: int, rule: Rule = "size") -> Float64Array:
        return np.where(select_coefficients(each, n, rule)[:, None], each, 0.0)

    def setting(name: str, values: Sequence[Any], make: Any, present: Any) -> Setting:
        return Setting("orbit", name, values, make, truth, present, "factors alone, not timed", timed=False)

    for name, rule in SELECTIONS.items():
        yield setting(
            f"coefficients, {name}", effort.selected,
            lambda n, rule=rule: lambda: multiplied(lambda each: kept(each, n, rule)), None,
        )  # fmt: skip
    yield setting(
        "bits of a coefficient", effort.bits,
        lambda bits: lambda: multiplied(lambda each: in_bits(kept(each, N_COEFFICIENTS), bits)), _BFLOAT,
    )  # fmt: skip


def in_bits(values: Float64Array, bits: int | str) -> NDArray[np.floating]:
    """Numbers rounded to so many bits of the largest, sign included; to bfloat16, as Orbit stores them; or not."""
    if bits == WHOLE:
        return values
    if bits == _BFLOAT:
        mantissa, exponent = np.frexp(values)
        return np.asarray(np.ldexp(np.rint(mantissa * 256.0) / 256.0, exponent))
    step = np.abs(values).max() / (2.0 ** (int(bits) - 1) - 1.0)
    return values if step == 0.0 else np.asarray(np.rint(values / step) * step)
