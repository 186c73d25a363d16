"""The figures of direct light: precomputation and visibility against brute force, pictures against references."""

from __future__ import annotations

import statistics
from collections.abc import Iterator

import numpy as np

from app.measure.subject import Precomputed, Subject, largest_on_gpu, open_subject, precompute
from benchmarks.brute_force_ratio import Ratio, precompute_ratios, visibility_ratios, wrong_answers
from benchmarks.effort import Effort, open_at_most, size_text
from benchmarks.figures import Figure, not_measured
from benchmarks.references import REFERENCES, reference_errors, reference_folder
from engine.precompute.direct.pipeline import FINAL, PREVIEW, Placement
from engine.render.picture_difference import Errors

VISIBILITY_RESOLUTION = 512, 512


def precompute_figures(subject: Subject, effort: Effort) -> Iterator[Figure]:
    ratios: list[Ratio] = []
    for name, quality in (("precompute_ratio_400", PREVIEW), ("precompute_ratio_4000", FINAL)):
        runs = [(ratio, _times(done)) for ratio, done in precompute_ratios(
            subject, quality, effort.repetitions, effort.n_rays
        )]  # fmt: skip
        ratios += [ratio for ratio, _ in runs]
        yield Figure(
            name,
            tuple(ratio.value for ratio, _ in runs),
            f"stage {quality.name!r} at {size_text(subject)}: visibility, light and projection of all layers from an "
            "opened scene and an empty cache ÷ brute-force shadow rays at the raw rate, mean of before and after",
            {"seconds": [ratio.seconds for ratio, _ in runs], "runs": [times for _, times in runs]},
        )
    yield Figure("brute_force_s", tuple(ratio.brute_force for ratio in ratios), "rays of 5,120 directions ÷ raw rate")
    yield Figure("rays_per_s", tuple(ratio.rate for ratio in ratios), "raw Embree rate, all cores, prepared rays")
    yield Figure(
        "transport_mb",
        (runs[-1][1]["store_bytes"] / 1e6,),
        f"all layers as the worker keeps them, {FINAL.n_lights} lights; the GPU holds one curve's transport beside it",
        {"largest_curve_on_gpu_mb": runs[-1][1]["gpu_bytes"] / 1e6},
    )


def _times(done: Precomputed) -> dict[str, float]:
    return {
        "light_and_visibility_s": done.light_seconds,
        "projection_s": done.projection_seconds,
        "rays": done.rays,
        "store_bytes": done.store_bytes,
        "gpu_bytes": largest_on_gpu(done, "half"),
    }


def visibility_figures(subject: Subject, effort: Effort) -> list[Figure]:
    """On the built-in shapes and the reference bunny, at the resolution of the built-in scenes: what neighbours share
    grows with it, the bunny's own is half as fine. The scene itself stands beside them."""
    ratios: dict[str, list[Ratio]] = {}
    wrong: dict[str, float] = {}
    folder = reference_folder()
    scenes = {"shapes": "shapes"} | ({} if folder is None else {"bunny": str(folder / "bunny.toml")})
    for name, source in (scenes | {"this scene": subject.source}).items():
        resolution = VISIBILITY_RESOLUTION if name in scenes else None
        placement = Placement(open_at_most(source, effort.side, resolution).scene)
        ratios[name] = visibility_ratios(placement, effort.repetitions, effort.n_rays)
        wrong[name] = wrong_answers(placement, effort.n_wrong)
    parts = {name: [ratio.value for ratio in found] for name, found in ratios.items()}
    medians = tuple(statistics.median(parts[name]) for name in scenes)
    where = " and ".join(scenes)
    return [
        Figure(
            "visibility_ratio",
            medians,
            f"coherent level-4 visibility of every pixel ÷ brute force, {where}: the larger median counts",
            {"ratios": parts, "seconds": {name: [r.seconds for r in found] for name, found in ratios.items()}},
        ),
        Figure(
            "visibility_wrong",
            tuple(wrong[name] for name in scenes),
            f"answers that differ from brute force at {effort.n_wrong} random points, {where}: the larger counts",
            {"wrong": wrong},
        ),
    ]


def reference_figures() -> list[Figure]:
    folder = reference_folder()
    if folder is None:
        absent = "../shared/reference is not beside this checkout"
        return [not_measured(name, absent) for name in ("reference_error", "reference_mean")]
    found: dict[str, Errors] = {}
    for name in REFERENCES:
        subject = open_subject(str(folder / f"{name}.toml"))
        found[name] = reference_errors(subject, precompute(subject, FINAL), folder, name)
    how = f"stage {FINAL.name!r} against path-traced pictures within their masks, {', '.join(found)}: the worst counts"
    return [
        Figure("reference_error", tuple(e.rmse for e in found.values()), how, {n: e.rmse for n, e in found.items()}),
        Figure("reference_mean", tuple(np.abs([e.mean for e in found.values()]).tolist()), how,
               {n: e.mean for n, e in found.items()}),
    ]  # fmt: skip
