"""Local, deformable transfer: figures and rates of [Sloan05] that Deform and its studies have."""

from __future__ import annotations

import statistics
from collections.abc import Mapping, Sequence
from dataclasses import replace

from app.measure.report import table
from app.project.project import open_project
from app.stills.stills import layers_by_object
from assets.scripts import deform as guide_pictures
from assets.scripts import lobes as lobe_pictures
from benchmarks.deform import DeformEffort, deform_figures
from benchmarks.gloss_transfer import BODIES, GlossEffort, GlossRow, measure, plot
from benchmarks.papers.entries import Make, Work, paragraph
from benchmarks.rotation_cost import report as rotation_costs
from benchmarks.zonal_fit_errors import fit_errors, random_vectors, shadowed_mesh
from engine.core.generators import run_to_end
from engine.precompute.direct.pipeline import Placement
from engine.realtime.zonal_harmonics.deform_engine import ORDER, Deform, finish_deform
from engine.realtime.zonal_harmonics.gloss_pilot import PilotResult
from engine.realtime.zonal_harmonics.posed_scene import pose_scene
from engine.render.picture_difference import errors
from engine.render.still import render_paths
from engine.scene.surface_kinds import NO_SURFACE

# Root mean square errors that figures 2 and 3 and their captions print, by the number of lobes.
PRINTED_RANDOM, PRINTED_MESH = {6: 0.00908}, {3: 0.045}
LOBES = (1, 2, 3, 4, 6)


def random_fit(work: Work) -> str:
    """Figure 2."""
    vectors = random_vectors(work.of(200, 5))
    found = run_to_end(fit_errors(vectors, LOBES))
    if not work.quick:
        lobe_pictures.random(work.images / "lobes_random.png")
    return f"{_by_lobes(found, PRINTED_RANDOM)}\n![A random function and its fits](../images/lobes_random.png)\n"


def mesh_fit(work: Work) -> str:
    """Figure 3."""
    vectors = run_to_end(shadowed_mesh(work.of(1100, 20), work.of(2000, 100)))
    found = run_to_end(fit_errors(vectors, LOBES))
    if not work.quick:
        lobe_pictures.head(work.images / "lobes_head.png")
    return f"{_by_lobes(found, PRINTED_MESH)}\n![The head by 1 to 4 lobes, and errors](../images/lobes_head.png)\n"


def _by_lobes(found: dict[int, float], printed: dict[int, float]) -> str:
    line = [f"{each:.3g}" + (f" ({printed[n]:g})" if n in printed else "") for n, each in found.items()]
    heads = [f"{n} lobe{'s' * (n > 1)}" for n in found]
    words = f"RMS of the error over that of the signal, order {ORDER}, the paper's in brackets."
    return f"{table(['', *heads], [['error', *line]])}\n{words}\n"


def flight(work: Work) -> str:
    """Figure 1."""
    if not work.quick:
        guide_pictures.flap(work.images / "deform_bat.png")
    return "![The bat's flight](../images/deform_bat.png)\n"


def glossy_rows(work: Work) -> str:
    """Figure 4: by the number of rows and the order, each with the lobes fitted to its rows."""
    bodies = dict(list(BODIES.items())[: work.of(len(BODIES), 1)])
    lines = list(measure(bodies, GlossEffort(20, 100, (4,), (3,)) if work.quick else GlossEffort()))
    if not work.quick:
        plot(work.images / "gloss_rows.png", lines)
        guide_pictures.gloss(work.images / "deform_gloss.png")
    words = """relRMSE of gloss on bodies in a pose against sums over the sky, by the order of the harmonics: as one
        lobe, and by so many rows; in brackets the share of values that are black and should not be, where that is a
        percent or more. Order 4 with 3 rows is the paper's."""
    return (
        f"{_by_rows(lines)}\n{paragraph(words)}\n"
        "![Error by the number of rows](../images/gloss_rows.png)\n\n"
        "![One lobe, sixteen rows, paths](../images/deform_gloss.png)\n"
    )


def _by_rows(lines: Sequence[GlossRow]) -> str:
    """A line for each body and order."""
    counts = list(dict.fromkeys(each.found.n_rows for each in lines))
    cells = {(each.body, each.order, each.found.n_rows): each.found for each in lines}
    found = []
    for body, order in dict.fromkeys((each.body, each.order) for each in lines):
        own = [cells.get((body, order, n)) for n in counts]
        found.append([body, order, *("" if each is None else _error_text(each) for each in own)])
    return table(["body", "order", *(f"{n} rows" if n else "lobe" for n in counts)], found)


def _error_text(found: PilotResult) -> str:
    return f"{found.error:.2f}" + (f" ({found.black:.0%})" if found.black >= 0.01 else "")


def patches(work: Work) -> str:
    """Figures 5 and 7."""
    if not work.quick:
        guide_pictures.surfaces(work.images / "deform_surfaces.png")
        guide_pictures.transfer(work.images / "deform_transfer.png")
    return (
        "![Head matt and of alabaster; patches and wrinkles on a jar](../images/deform_surfaces.png)\n\n"
        "![A waffle unshadowed, with shadows, with interreflection, as a slab, glossy](../images/deform_transfer.png)\n"
    )


def bent_head(work: Work) -> str:
    """Figure 6, bottom: paths, transfer that stays as at rest, transfer that turns."""
    size = (work.of(192, 24), work.of(192, 24))
    project = open_project("idol", size)
    scene, layers = project.resting, layers_by_object(project)
    deform = Deform(scene, work.of(guide_pictures.N_POINTS, 0), work.of(guide_pictures.N_RAYS, 50))
    deform.set_light(project.sky)
    deform.set_layers(layers)
    deform.set_surfaces((("head", NO_SURFACE),))
    deform.set_bending(("head",))
    deform.set_bounces(1)
    finish_deform(deform)
    placement = Placement(pose_scene(scene, guide_pictures.BENT))
    traced = run_to_end(render_paths(placement, layers, project.sky, 1, work.of(1024, 8)))
    own = placement.hits.object_image == scene.object_index("head")
    lines = []
    for words, turned in (("transfer as at rest", False), ("transfer that turns", True)):
        drawn = deform.draw(scene.description.camera, size, guide_pictures.BENT, "rest", turned)
        off = errors(drawn[own], traced[own])
        lines.append([words, f"{off.rmse:.1%}", f"{100 * off.mean:+.1f} %"])
    if not work.quick:
        guide_pictures.truth(work.images / "deform_truth.png")
    words = "Direct light of the bent and twisted head, against paths of it:"
    return f"{words}\n\n{table(['', 'relRMSE', 'means'], lines)}\n![Paths, transfer as at rest, transfer that turns](../images/deform_truth.png)\n"  # noqa: E501


def rates(work: Work) -> str:
    """Section 6: frames a second, the fit's time, and what rotation costs by order."""
    effort = DeformEffort()
    if work.quick:
        effort = replace(effort, columns=20, rows=12, n_rays=50, n_random=4, n_mesh=10, n_frames=3, resolution=(48, 36))
    found = {figure.name: figure for figure in deform_figures(effort, work.report)}
    lines: list[Sequence[str]] = [
        ["frames a second, diffuse, another pose each", _median(found["deform_fps"].samples), "100 to 200"],
        ["rays and lobes, s", _median(found["zh_fit_s"].samples), "240 to 600, and up to 1,800 for the fit"],
    ]
    rotation = "" if work.quick else f"\nWhat rotation costs [Sloan05, 3.4]:\n\n{rotation_costs()}"
    words = f"""A relief of {effort.columns * effort.rows:,} vertices, {effort.resolution[0]} × {effort.resolution[1]},
        on two processor cores; the paper's head has 17,575 vertices, drawn by a GeForce 6800 Ultra, fitted on a
        Pentium 4."""
    return f"{table(['', 'ours', 'the paper'], lines)}\n{paragraph(words)}{rotation}"


def _median(values: Sequence[float]) -> str:
    return f"{statistics.median(values):.3g} ({min(values):.3g} to {max(values):.3g})" if values else "not measured"


MAKERS: Mapping[str, Make] = {
    "figure 1": flight,
    "figure 2": random_fit,
    "figure 3": mesh_fit,
    "figure 4": glossy_rows,
    "figure 5": patches,
    "figure 6": bent_head,
    "section 6": rates,
}
