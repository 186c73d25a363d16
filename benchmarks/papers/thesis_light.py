"""Light in place: edits under simple light, and sessions on the tea tray and the earrings [BenArtzi07, ch. 1 and 4]."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.measure.report import table
from app.project.project import open_project
from assets.scripts import simple_lighting as guide_picture
from assets.scripts.bounces import save
from benchmarks.papers.entries import Work
from benchmarks.papers.sheets import sheet
from benchmarks.point_lights import N_PIXELS, SCENES, figure, measure
from engine.core.generators import run_to_end
from engine.material import MODELS
from engine.material.layer import Layer, make_layer
from engine.planner import band_counts
from engine.precompute.direct.pipeline import FINAL, Placement, Quality, SkyState
from engine.precompute.direct.simple_lighting import simple_lighting
from engine.render.display import display_picture
from engine.render.picture_difference import errors
from engine.render.still import StillLayer, render_still
from engine.settings import Lighting

Values = Sequence[tuple[str, Any]]
Radiance = NDArray[np.float32]

EXPONENTS = (4.0, 16.0, 64.0, 256.0, 1024.0)
LIGHTINGS: Mapping[Lighting, str] = {
    "scene": "in place",
    "point_light": "one distant light",
    "no_shadows": "no shadows",
}
# The thesis' sessions, each step with those before it.
TEA_TRAY: Sequence[tuple[str, Values]] = (
    ("a: as opened", ()),
    ("b: brushed", (("teapot.copper.n_u", 6.0), ("teapot.copper.n_v", 1200.0))),
    (
        "c: tray sharper",
        (("tray.lacquer.alpha", 0.03), ("tray.lacquer.scale", 0.8), ("tray.base.albedo", (0.05, 0.02, 0.01))),
    ),
    ("d: handles of silver", (("handles.brushed.eta", (0.15, 0.14, 0.13)), ("handles.brushed.k", (3.7, 3.1, 2.4)))),
)
EARRINGS: Sequence[tuple[str, Values]] = (
    ("a: as opened", ()),
    ("b: sharper pearls", (("pearls.lustre.sigma", 0.05),)),
    ("c: a haze", (("pearls.nacre.albedo", (0.62, 0.56, 0.58)),)),
    ("d: blue cloth", (("cloth.weave.albedo", (0.012, 0.03, 0.16)), ("cloth.sheen.scale", (0.03, 0.06, 0.2)))),
    ("e: posts of silver", (("posts.gold.eta", (0.15, 0.14, 0.13)), ("posts.gold.k", (3.7, 3.1, 2.4)))),
)
FEW = replace(FINAL, name="400 lights", n_lights=400)


def phong_edits(work: Work) -> str:
    """Figures 1.2 to 1.4: Phong's exponent from 4 to 1024 on all surfaces, under each lighting."""
    side = work.of(200, 32)
    project = open_project("shapes", (side, side))
    placement = Placement(project.scene, n_edge_rays=work.of(8, 0))
    objects = sorted({i for i, _ in project.indexed_layers})
    pictures: dict[Lighting, list[Radiance]] = {}
    for lighting in LIGHTINGS:
        lit, sky = simple_lighting(placement, project.sky, lighting)
        pictures[lighting] = []
        for exponent in EXPONENTS:
            layer = make_layer(MODELS["phong"], {"exponent": exponent, "scale": (0.6, 0.6, 0.6)})
            pictures[lighting].append(rendered(lit, sky, [(i, layer) for i in objects]))
    rows = [[display_picture(each) for each in row] for row in pictures.values()]
    shown = work.picture(
        "phong_edits",
        sheet([f"n = {n:g}" for n in EXPONENTS], rows),
        "In place, under one distant light, without shadows",
    )
    lines = [
        [
            LIGHTINGS[lighting],
            *(f"{errors(ours, truth).rmse:.0%}" for ours, truth in zip(row, pictures["scene"], strict=True)),
        ]
        for lighting, row in pictures.items()
        if lighting != "scene"
    ]
    words = "From above: in place, under one distant light, under the sky without shadows. How far the simple pictures are from those in place, relRMSE:"  # noqa: E501
    return f"{shown}\n{words}\n\n{table(['', *(f'n = {n:g}' for n in EXPONENTS)], lines)}"


def rendered(
    placement: Placement, sky: SkyState, layers: Sequence[tuple[int, Layer]], quality: Quality = FINAL
) -> Radiance:
    """Direct light (H, W, 3) with the bands that are planned."""
    stills = []
    for i_object, layer in layers:
        counts = (*band_counts(layer).values(), 1)
        stills.append(StillLayer(i_object, layer, (counts[0], counts[1]), True))
    return run_to_end(render_still(placement, stills, sky, quality), lambda step: None)


def lights_with_extent(work: Work) -> str:
    """Figure 4.3."""
    quick = {"size": 32, "n_pixels": 20, "counts": (50,), "level": 4} if work.quick else {}
    rows = list(measure(**quick))  # type: ignore[arg-type]
    if not work.quick:
        save(work.images / "point_lights.png", np.asarray(figure()))
    counts = list(dict.fromkeys(row.n for row in rows))
    lines = [
        [
            f"{scene}, {lights}",
            *(f"{100 * row.rmse:.2g} %" for row in rows if (row.scene, row.lights) == (scene, lights)),
        ]
        for scene in SCENES
        for lights in ("points", "triangles")
    ]
    return (
        f"{table(['', *(f'{n:,} lights' for n in counts)], lines)}\nrelRMSE of {quick.get('n_pixels', N_PIXELS):,} "
        "pixels against 81,920 directions. Points above, triangles below, on sharper copper:\n\n"
        "![Points and triangles of light](../images/point_lights.png)\n"
    )


def tea_tray_session(work: Work) -> str:
    """Figure 4.4: four steps of an edit in place and under one distant light, and the last with 400 lights."""
    placements, pictures, few = _session("teatray", TEA_TRAY, work, ("scene", "point_light"), last_with=FEW)
    off = errors(few, pictures["scene"][-1])
    rows = [
        [display_picture(each) for each in [*row, few if lighting == "scene" else np.ones_like(few)]]
        for lighting, row in pictures.items()
    ]
    columns = [*(words for words, _ in TEA_TRAY), "d': 400 lights"]
    shown = work.picture("session_teatray", sheet(columns, rows), "An editing session in place, and under one light")
    changes = [
        [LIGHTINGS[lighting], *(f"{errors(b, a).rmse:.0%}" for a, b in zip(row, row[1:], strict=False))]
        for lighting, row in pictures.items()
    ]
    how = f"{placements} points"
    return (
        f"{shown}\nHow much each step changes the picture ({how}), relRMSE to the step before:\n\n"
        f"{table(['', *(words for words, _ in TEA_TRAY[1:])], changes)}\n"
        f"d' with 400 lights is {off.rmse:.1%} off d with 4,000, its mean {100 * off.mean:+.1f} %.\n"
    )


def earrings_session(work: Work) -> str:
    """Figure 4.5: five steps of an edit."""
    _, pictures, _ = _session("earrings", EARRINGS, work, ("scene",))
    rows = [[display_picture(each) for each in row] for row in pictures.values()]
    return work.picture("session_earrings", sheet([words for words, _ in EARRINGS], rows), "An editing session")


def _session(
    source: str,
    steps: Sequence[tuple[str, Values]],
    work: Work,
    lightings: Sequence[Lighting],
    last_with: Quality = FINAL,
) -> tuple[int, dict[Lighting, list[Radiance]], Radiance]:
    """The number of points, the pictures of each step by lighting, and the last in place by another quality."""
    side = work.of(224, 32)
    scene = open_project(source, (side, side)).scene
    placement = Placement(scene, n_edge_rays=work.of(8, 0))
    pictures: dict[Lighting, list[Radiance]] = {lighting: [] for lighting in lightings}
    values: list[tuple[str, Any]] = []
    for _, change in steps:
        values += change
        project = open_project(source, (side, side), values)
        for lighting in lightings:
            lit, sky = simple_lighting(placement, project.sky, lighting)
            pictures[lighting].append(rendered(lit, sky, project.indexed_layers))
    last = rendered(placement, project.sky, project.indexed_layers, last_with)
    return len(placement.hits.pixel), pictures, last


def guide_sheet(work: Work) -> str:
    """The guide's picture of one edit under four kinds of light."""
    if not work.quick:
        save(work.images / "simple_lighting.png", np.asarray(guide_picture.figure()))
    return "![One edit under one light, on a ball, without shadows and in place](../images/simple_lighting.png)\n"
