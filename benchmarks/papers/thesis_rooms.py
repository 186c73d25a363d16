"""Pictures with indirect light: series, and edits in place [BenArtzi07, ch. 5 and 6]."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from shutil import copytree
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.measure.report import table
from app.measure.subject import at_most, open_subject
from app.project.project import Project, open_project
from app.stills.stills import layers_by_object, render_picture
from assets.scripts import bounces
from assets.scripts.bounces import save
from benchmarks.papers.entries import Work, paragraph
from benchmarks.papers.sheets import closeup, sheet
from benchmarks.series import series_rows, series_table
from engine.core.generators import run_to_end
from engine.precompute.direct.pipeline import Placement
from engine.precompute.indirect.sampling_settings import BounceSeries, parse_series
from engine.render.display import display_picture
from engine.render.picture_difference import errors
from engine.render.still import render_paths
from engine.scene.builtin import scene_path

Values = Sequence[tuple[str, Any]]
Radiance = NDArray[np.float32]

# Two bounces, as in the thesis' figure 5.3.
SERIES = ("128,8", "16,8", "128,1")
CORNELL: Values = (
    ("back.gloss.alpha", 0.06),
    ("back.gloss.scale", 1.0),
    ("back.paint.albedo", (0.12, 0.12, 0.12)),
    ("short block.paint.albedo", (0.75, 0.62, 0.05)),
)
ROOM: Values = (
    ("sofa.cloth.albedo", (0.05, 0.32, 0.06)),
    ("sofa.sheen.exponent", 60.0),
    ("sofa.sheen.scale", (0.12, 0.16, 0.12)),
    ("planks.varnish.alpha", 0.03),
    ("planks.varnish.scale", 4.0),
    ("planks.oak.albedo", (0.22, 0.16, 0.14)),
)
BRUSHED = '{ model = "ashikhmin_shirley", name = "glaze", n_u = 4.0, n_v = 900.0, scale = [0.5, 0.5, 0.55] }'
FRESNEL: Values = (("vase.glaze.eta", (4.0, 4.0, 4.0)), ("vase.porcelain.albedo", (0.3, 0.3, 0.29)))
RING = (
    ("plane shinier", (("plane.polish.alpha", 0.05), ("plane.polish.scale", 4.0))),
    ("ring duller", (("ring.gold.alpha", 0.2),)),
)


def two_bounces(work: Work) -> str:
    """Figure 5.3: series of two bounces on the tea tray, against paths of two bounces."""
    side = work.of(160, 24)
    project = open_project("teatray", (side, side)).with_settings(n_edge_rays=0)
    placement = Placement(project.scene)
    truth = run_to_end(render_paths(placement, layers_by_object(project), project.sky, 2, work.of(4096, 16)))
    halves = [
        run_to_end(render_paths(placement, layers_by_object(project), project.sky, 2, work.of(1024, 16), seed))
        for seed in (1, 2)
    ]
    noise = errors(halves[0], halves[1]).rmse / np.sqrt(2.0) / (1.0 if work.quick else 2.0)
    seen = placement.hits.object_image >= 0
    pictures = {text: _still(project, parse_series(text)) for text in SERIES} | {
        "direct light": _still(project, BounceSeries(1))
    }
    lines = []
    for words, each in pictures.items():
        off = errors(each[seen], truth[seen])
        lines.append([words, f"{off.rmse:.1%}", f"{100 * off.mean:+.1f} %"])
    shown = work.picture(
        "two_bounces",
        sheet(["paths", *pictures], [[display_picture(each) for each in (truth, *pictures.values())]]),
        "Paths of two bounces, three series, direct light alone",
    )
    words = f"Against {work.of(4096, 16):,} paths a pixel, whose own noise is {noise:.1%}, over pixels of objects:"
    return f"{shown}\n{words}\n\n{table(['series', 'relRMSE', 'means'], lines)}"


def cornell_edits(work: Work) -> str:
    """Figures 5.5 and 5.6 a, b: an edit of the Cornell box, beside paths, direct light and the coarser series."""
    side = work.of(200, 24)
    before, after = (
        open_project("cornell", (side, side), values).with_settings(n_edge_rays=0) for values in ((), CORNELL)
    )
    placement = Placement(after.scene)
    n_paths = work.of(2048, 16)
    truth = [
        run_to_end(render_paths(placement, layers_by_object(each), each.sky, 4, n_paths)) for each in (before, after)
    ]
    series = BounceSeries(4)
    ours = [_still(each, series) for each in (before, after)]
    direct, diffuse = _still(after, BounceSeries(1)), _still(after, parse_series("direct+1,1,1,1"))
    rows = [[ours[0], ours[1], diffuse], [truth[0], truth[1], direct]]
    shown = work.picture(
        "cornell_edits",
        sheet(
            ["before", "back wall glossy, block yellow", "direct + 1,1,1,1; direct"],
            [[display_picture(e) for e in row] for row in rows],
        ),
        "Ours above, paths below; right: the coarser series, direct light alone",
    )
    lines = [
        ["before", *_off(ours[0], truth[0])],
        ["after", *_off(ours[1], truth[1])],
        ["after, direct + 1,1,1,1", *_off(diffuse, truth[1])],
        ["after, direct light alone", *_off(direct, truth[1])],
    ]
    words = f"""Ours above, paths ({n_paths:,} a pixel) below; to the right what the thesis compares in figure 5.6:
        direct light with a diffuse indirect part above, direct light alone below. Four bounces:"""
    return f"{shown}\n{paragraph(words)}\n{table(['', 'relRMSE', 'means'], lines)}"


def series_of_bounces(work: Work) -> str:
    """Sections 5.2 and 5.6: series of four bounces on three scenes, beside paths with materials as simple."""
    parts = []
    for name, values in (("cornell", CORNELL), ("teatray", ()), ("ring", ())):
        side = work.of(32, 6)
        project = open_project(name, (side, side), values).with_settings(n_edge_rays=0)
        parts.append(f"{name}:\n\n{series_table(series_rows(project, work.of(1024, 4)))}")
    words = """relRMSE to 1,024 paths a pixel with whole curves at each of four bounces, 32 × 32; the noise of paths is
        taken out, so 0.0 % means no more than noise. *Such paths* have whole curves at as many bounces as the
        series has bands at, and albedos at the others: what the approximation itself leaves out. The box is as
        edited in figures 5.5 and 5.6: the highlight of its glossy wall needs more than the 16 bands of 16,8,1,1,
        which ring."""
    return "\n\n".join([*parts, paragraph(words)])


def _still(project: Project, series: BounceSeries) -> Radiance:
    return render_picture(project, lambda step: None, series=series)


def _off(found: Radiance, truth: Radiance) -> list[str]:
    off = errors(found, truth)
    return [f"{off.rmse:.1%}", f"{100 * off.mean:+.1f} %"]


# ------------------------------------------------------------------------------------------------------------ chapter 6


def room_session(work: Work) -> str:
    """Figures 6.1 and 6.4: sofa and floor of the room edited, all light above, direct light below, and closeups."""
    resolution = (work.of(240, 24), work.of(180, 18))
    before, after = (open_project("room", resolution, values) for values in ((), ROOM))
    lit = [[display_picture(_still(each, BounceSeries(n))) for each in (before, after)] for n in (4, 1)]
    parts = [closeup(lit[0][1], *where) for where in ((0.05, 0.5, 0.4), (0.55, 0.55, 0.4))]
    rows = [[*lit[0], parts[0]], [*lit[1], parts[1]]]
    return work.picture(
        "room_session",
        sheet(["before", "sofa and floor edited", "closeups"], rows),
        "The room before and after an edit: four bounces above, direct light below",
    )


def vase_session(work: Work) -> str:
    """Figure 6.3: the vase as it is, brushed, and with a stronger Fresnel effect."""
    resolution = at_most(open_subject("vase").scene.resolution, work.of(220, 24))
    whole = _still(open_project("vase", resolution), BounceSeries(4))
    with tempfile.TemporaryDirectory() as folder:
        brushed = _still(_edited_scene("vase", Path(folder), _brush, resolution), BounceSeries(4))
    fresnel = _still(open_project("vase", resolution, FRESNEL), BounceSeries(4))
    where = (0.28, 0.3, 0.5)
    shown = [display_picture(whole), *(closeup(display_picture(each), *where) for each in (whole, brushed, fresnel))]
    return work.picture(
        "vase_session",
        sheet(["as it is", "closeup", "brushed glaze", "stronger Fresnel"], [shown]),
        "The vase: as it is, brushed, with a stronger Fresnel effect",
    )


def _brush(text: str) -> str:
    """The vase's glaze as an anisotropic layer."""
    lines = [f"  {BRUSHED}," if 'name = "glaze"' in line else line for line in text.splitlines()]
    return "\n".join(lines)


def _edited_scene(source: str, folder: Path, edit: Callable[[str], str], resolution: tuple[int, int]) -> Project:
    file = scene_path(source)
    copytree(file.parent, folder, dirs_exist_ok=True)
    (folder / "scene.toml").write_text(edit(file.read_text(encoding="utf-8")), encoding="utf-8")
    return open_project(str(folder / "scene.toml"), resolution)


def ring_edits(work: Work) -> str:
    """Figure 6.5: the ring's caustic and its mirror image, with 64 bands at the first and 16 at the second bounce."""
    side = work.of(220, 24)
    series = parse_series("64,16")
    shown = [
        display_picture(_still(open_project("ring", (side, side), values), series)) for _, values in (("", ()), *RING)
    ]
    return work.picture(
        "ring_edits",
        sheet(["as it is", *(words for words, _ in RING)], [shown]),
        "The ring's caustic as it is, on a shinier plane, and of a duller ring, 64,16",
    )


def guide_bounces(work: Work) -> str:
    """The guide's pictures of scenes with direct light alone and with all bounces."""
    lines = []
    for name in bounces.SCENES:
        if not work.quick:
            work.report(f"{name} with direct light alone, and with all bounces")
            save(work.images / f"bounces_{name}.png", bounces.side_by_side(name))
        lines.append(f"![{name}: direct light, all bounces](../images/bounces_{name}.png)\n")
    return "\n".join(lines)
