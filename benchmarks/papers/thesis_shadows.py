"""Coherent visibility [BenArtzi07, ch. 8]: tables 8.1 to 8.3, figures 8.2 and 8.7 to 8.9, and a sky that turns.

Pictures are diffuse and white, as the thesis' are, under point lights cut from the scene's own sky [Agarwal03].
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.measure.report import table
from app.project.project import Project, open_project
from benchmarks.papers.entries import Work, paragraph
from benchmarks.papers.sheets import closeup, difference, sheet
from benchmarks.thesis_visibility import VARIANTS, Variant, variant_visibility, voronoi_targets
from benchmarks.visibility_methods import (
    METHODS,
    OPT,
    OURS,
    THESIS_SPEED,
    THESIS_TABLE,
    TRUE,
    Size,
    VisibilityEffort,
    VisibilityRow,
    measured_scenes,
    ours_visibility,
    row_of,
    scenes_of,
    visibility_rows,
)
from engine.light.triangle_lights import TriangleLights, cut_lights
from engine.precompute.direct.pipeline import Placement
from engine.render.display import display_picture
from engine.render.picture_difference import errors
from engine.visibility.point_visibility import Visibility

Radiance = NDArray[np.float32]

LIGHTS = (50, 100, 200, 400)
# Seconds of TRUE and OPT, times as fast and by its rays, microseconds of a ray [BenArtzi07, table 8.3].
PRINTED_COSTS = {
    "shapes": (26.12, 23.20, 3.24, 3.05),
    "bunny": (15.72, 24.33, 3.52, 5.82),
    "plant": (3.18, 4.94, 5.62, 8.68),
    "dominoes": (12.88, 11.38, 5.39, 4.93),
}
ALBEDO, BRIGHTEST_ERROR = 0.7, 0.25
# Parts of the pictures that show what fails: (left, top, share).
TORUS, LEAVES = (0.40, 0.12, 0.42), (0.3, 0.45, 0.35)
TURN_DEGREES, TURN_FRAMES = 1.0, 12


@dataclass(frozen=True, eq=False)
class Shadows:
    """A scene's points under n point lights from its sky."""

    project: Project
    placement: Placement
    lights: TriangleLights

    @classmethod
    def of(cls, source: str, side: int, n_lights: int, turned: float = 0.0) -> Shadows:
        """turned: degrees that the sky is rotated further."""
        project = open_project(source, (side, side))
        sky = project.sky
        assert sky.environment is not None
        return cls(project, Placement(project.scene), cut_lights(sky.environment, n_lights, sky.rotation + turned))

    def seen(self, method: Variant | str) -> Visibility:
        """Visibility of the lights by a variant of the thesis or by ours."""
        hits, caster, targets = self.placement.hits, self.placement.caster, voronoi_targets(self.lights.centre)
        if method == OURS:
            return ours_visibility(hits, caster, targets)
        return variant_visibility(hits, caster, targets, method)  # type: ignore[arg-type]

    def picture(self, visibility: Visibility) -> Radiance:
        """White matt surfaces (H, W, 3): B = (albedo / π) Σ_m V_m L_m max(n · ω_m, 0)."""
        hits = self.placement.hits
        width, height = hits.resolution
        cosine = np.maximum(hits.normal @ self.lights.centre.T, 0.0)
        visible = visibility.unpacked(np.arange(len(hits.pixel)))
        image = np.zeros((height * width, 3), np.float32)
        image[hits.pixel] = ALBEDO / np.pi * (cosine * visible) @ self.lights.power
        return image.reshape(height, width, 3)


@cache
def _rows(is_quick: bool) -> tuple[VisibilityRow, ...]:
    """All methods on all scenes, measured once for the three tables."""
    if is_quick:
        few, scenes = tuple(Size(33, n) for n in (50, 200, 400)), {"shapes": "shapes", "plant": "plant"}
        return tuple(visibility_rows(VisibilityEffort(few, scenes), lambda _: None))
    sizes = tuple(Size(513, n, 3 if n == 200 else 1) for n in LIGHTS)
    return tuple(visibility_rows(VisibilityEffort(sizes, measured_scenes()), print))


def rays(work: Work) -> str:
    """Table 8.1: percent of the rays above the horizon that each method traces, the thesis' in brackets."""
    rows = _rows(work.quick)
    side, found = rows[0].side, sorted({row.directions for row in rows})
    parts = []
    for i, scene in enumerate(scenes_of(rows)):
        lines = []
        for method in METHODS:
            printed = THESIS_TABLE[method][i] if method in THESIS_TABLE and not work.quick else ()
            own = [row_of(rows, scene, side, n, method) for n in (LIGHTS if not work.quick else found)]
            cells = [f"{100 * row.rays:.1f}" + (f" ({printed[k]:g})" if printed else "") for k, row in enumerate(own)]
            lines.append([method, *cells, f"{100 * own[-1].wrong:.2g} %"])
        heads = [f"{n} lights" for n in (LIGHTS if not work.quick else found)]
        parts.append(f"*{scene}*\n\n{table(['', *heads, 'wrong'], lines)}")
    words = """Percent of shadow rays above the horizon, the thesis' of its own scenes in brackets; *wrong*: of the
        answers, with the most lights. *FLO* is GNU that does not flood in the finest step: the thesis names it
        and prints no figure."""
    return "\n".join([*parts, paragraph(words)])


def speeds(work: Work) -> str:
    """Table 8.2: how many times as fast as tracing all, at 200 lights."""
    rows = _rows(work.quick)
    scenes, side, lines = scenes_of(rows), rows[0].side, []
    for method in METHODS:
        cells = []
        for i, scene in enumerate(scenes):
            own, true = (row_of(rows, scene, side, 200, each) for each in (method, TRUE))
            printed = f" ({THESIS_SPEED[method][i]:g})" if method in THESIS_SPEED and not work.quick else ""
            cells.append(f"{own.seconds:.2f} s, {true.seconds / own.seconds:.1f} ×{printed}")
        lines.append([method, *cells])
    return (
        f"{table(['', *scenes], lines)}\nSeconds of the processor for visibility alone; the thesis' whole renderings "
        "in brackets.\n"
    )


def ray_costs(work: Work) -> str:
    """Table 8.3: what a ray costs in all and in few, at 400 lights."""
    rows = _rows(work.quick)
    side, lines = rows[0].side, []
    for scene in scenes_of(rows):
        true, few = (row_of(rows, scene, side, 400, method) for method in (TRUE, OPT))
        faster, ideal = true.seconds / few.seconds, 1.0 / few.rays
        micro = [1e6 * row.ray_seconds / row.n_rays for row in (true, few)]
        printed = PRINTED_COSTS.get(scene, (0.0,) * 4)
        cells = (f"{faster:.1f} ×", f"{ideal:.1f} ×", *(f"{each:.3f}" for each in micro))
        lines.append([scene, *(f"{own} ({each:g})" for own, each in zip(cells, printed, strict=True))])
    head = ["", "OPT as fast as TRUE", "by its rays", "µs a ray in TRUE", "µs a ray in OPT"]
    return f"{table(head, lines)}\nThe thesis' in brackets, on a Xeon of 3.06 GHz.\n"


# ----------------------------------------------------------------------------------------------------------- pictures


def fewer_lights(work: Work) -> str:
    """Figure 8.2: dominoes by all rays, by OPT, and by fewer lights that cost as many rays as OPT."""
    side = work.of(256, 32)
    many, few = (Shadows.of("dominoes", side, n) for n in (400, 50))
    true, opt, coarse = many.seen(TRUE), many.seen(OPT), few.seen(TRUE)
    pictures = [many.picture(true), many.picture(opt), few.picture(coarse)]
    n_rays = [seen.rays.traced for seen in (true, opt, coarse)]
    columns = [
        "400 lights, all rays",
        f"OPT, {n_rays[1] / n_rays[0]:.0%} of the rays",
        f"50 lights, {n_rays[2] / n_rays[0]:.0%}",
    ]
    exposure = _exposure(pictures[0])
    shown = [display_picture(each * exposure) for each in pictures]
    off = [errors(each, pictures[0]).rmse for each in pictures[1:]]
    return (
        work.picture("dominoes", sheet(columns, [shown]), "Dominoes by all rays, by OPT, and by fewer lights")
        + f"\nOPT is {off[0]:.2%} off, 50 lights {off[1]:.0%} (relRMSE).\n"
    )


def truth_pictures(work: Work) -> str:
    """Figure 8.7: shapes and bunny by OPT and by all rays, 200 lights."""
    side, rows, lines = work.of(256, 32), [], []
    for name, source in list(measured_scenes().items())[:2]:
        shadows = Shadows.of(source, side, 200)
        seen = [shadows.seen(method) for method in (OPT, TRUE)]
        pictures = [shadows.picture(each) for each in seen]
        exposure = _exposure(pictures[1])
        rows.append(
            [
                *(display_picture(each * exposure) for each in pictures),
                difference(pictures[0], pictures[1], BRIGHTEST_ERROR),
            ]
        )
        lines.append([name, f"{errors(*pictures).rmse:.3%}", f"{_wrong(*seen):.4%}", f"{_changed(*rows[-1][:2]):.2%}"])
    shown = work.picture(
        "shapes_bunny",
        sheet(["OPT", "all rays", "difference, white: mean / 4"], rows),
        "Shapes and bunny by OPT and by all rays",
    )
    return f"{shown}\n{table(['', 'relRMSE', 'wrong answers', 'pixels that differ in 8 bits'], lines)}"


def variants(work: Work) -> str:
    """Figure 8.8: the torus' shadow by each variant with 100 lights, and what each misses."""
    return _variant_sheet(work, "shapes", "visibility_variants", TORUS)


def plant(work: Work) -> str:
    """Figure 8.9: the plant by the variants that can be trusted, 100 lights, and what each misses."""
    return _variant_sheet(work, "plant", "visibility_plant", LEAVES)


def _variant_sheet(work: Work, source: str, name: str, where: tuple[float, float, float]) -> str:
    side = work.of(256, 32)
    shadows = Shadows.of(source, side, 100)
    methods = [*(each for each in VARIANTS if each != TRUE), OURS]
    true = shadows.seen(TRUE)
    truth = shadows.picture(true)
    exposure, blocks, lines = _exposure(truth), [], []
    for method in methods:
        seen = shadows.seen(method)
        picture = shadows.picture(seen)
        shown = closeup(display_picture(picture * exposure), *where)
        blocks.append((method, shown, closeup(difference(picture, truth, BRIGHTEST_ERROR), *where)))
        lines.append(
            [
                method,
                f"{_wrong(seen, true):.3%}",
                f"{errors(picture, truth).rmse:.2%}",
                f"{seen.rays.traced / seen.rays.possible:.1%}",
            ]
        )
    small = [_halved(each) for _, *pair in blocks for each in pair]
    half = (len(blocks) + 1) // 2
    images = [[small[2 * i] for i in range(half)], [small[2 * i + 1] for i in range(half)]]
    rest = [[small[2 * i] for i in range(half, len(blocks))], [small[2 * i + 1] for i in range(half, len(blocks))]]
    first = work.picture(
        f"{name}_1", sheet([m for m, *_ in blocks[:half]], images), f"{source}: variants and what they miss"
    )
    second = work.picture(f"{name}_2", sheet([m for m, *_ in blocks[half:]], rest), f"{source}: more variants")
    words = "Close-ups, and below each the difference to all rays, white at a quarter of the picture's mean."
    return f"{first}\n{second}\n{words}\n\n{table(['', 'wrong answers', 'relRMSE', 'rays'], lines)}"


def _halved(picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
    height, width = picture.shape[0] // 2 * 2, picture.shape[1] // 2 * 2
    means = picture[:height, :width].reshape(height // 2, 2, width // 2, 2, 3).mean(axis=(1, 3))
    return np.rint(means).astype(np.uint8)


# ---------------------------------------------------------------------------------------------------- a turning sky


def coherence(work: Work) -> str:
    """Frame-to-frame change while the sky turns slowly, by OPT and by all rays [BenArtzi07, sect. 8.8]."""
    side, n_frames, lines = work.of(192, 24), work.of(TURN_FRAMES, 3), []
    sources = dict(list(measured_scenes().items())[: 1 if work.quick else None])
    for name, source in sources.items():
        frames: dict[str, list[Any]] = {method: [] for method in (TRUE, OPT, OURS)}
        for k in range(n_frames):
            shadows = Shadows.of(source, side, 200, TURN_DEGREES * k)
            for method, own in frames.items():
                own.append(shadows.picture(shadows.seen(method)))
        lines.append([name, *_changes(frames)])
    words = f"""The sky turns by {TURN_DEGREES:g}° a frame, 200 lights, {n_frames} frames. *Change*: mean |difference|
        from a frame to the next, of the mean radiance. *Flicker*: RMS of what a method's change from frame to
        frame differs from that of all rays, of the mean radiance: what the eye would see that is not the light's."""
    head = ["", "change", "OPT: change", "flicker", "ours: change", "flicker"]
    return f"{table(head, lines)}\n{paragraph(words)}"


def _changes(frames: Mapping[str, Sequence[Radiance]]) -> list[str]:
    steps = {method: np.diff(np.stack(own).astype(np.float64), axis=0) for method, own in frames.items()}
    mean = float(np.mean(frames[TRUE]))
    cells = [f"{np.abs(steps[TRUE]).mean() / mean:.2%}"]
    for method in (OPT, OURS):
        flicker = np.sqrt(((steps[method] - steps[TRUE]) ** 2).mean()) / mean
        cells += [f"{np.abs(steps[method]).mean() / mean:.2%}", f"{flicker:.2%}"]
    return cells


def _exposure(truth: Radiance) -> float:
    return float(0.35 / (truth[truth > 0.0].mean() or 1.0))


def _wrong(seen: Visibility, true: Visibility) -> float:
    """Share of the answers above the horizon that differ."""
    return float(np.bitwise_count(seen.bits ^ true.bits).sum(dtype=np.int64) / true.rays.possible)


def _changed(one: NDArray[np.uint8], other: NDArray[np.uint8]) -> float:
    return float((one != other).any(axis=2).mean())
