"""Triple products of spherical wavelets: figures and tables of [Ma06] that Orbit and its studies have."""

from __future__ import annotations

import statistics
import time
from collections.abc import Mapping

import numpy as np
from PIL import Image

from app.measure.report import table
from app.measure.settings import Setting
from app.measure.settings_orbit import finish_orbit
from app.measure.subject import open_subject
from app.project.project import Project, open_project
from app.stills.stills import layers_by_object
from assets.scripts import orbit as guide_pictures
from benchmarks.orbit import SCENE, OrbitEffort, errors_by_coefficients
from benchmarks.papers.entries import Make, Work, paragraph
from benchmarks.variants import SELECTIONS, VariantEffort, orbit_variants
from benchmarks.visibility_textures import PLOT, TextureEffort, measure_all, write_plot
from engine.realtime.triple_product.orbit_engine import Orbit
from engine.render.picture_difference import errors
from engine.scene.camera_moves import orbit_camera

MB = 1e6
SCENES = ("teatray", SCENE, "plant")


def row(name: str, words: str) -> Make:
    """A row of the guide's pictures of Orbit."""

    def make(work: Work) -> str:
        if not work.quick:
            work.report(f"Orbit: {name}")
            Image.fromarray(guide_pictures.row(name)).save(work.images / f"orbit_{name}.png", optimize=True)
        return f"![{words}](../images/orbit_{name}.png)\n"

    return make


def per_pixel(work: Work) -> str:
    """Figure 5: gloss at points, and pixel by pixel."""
    shown = row("per_pixel", "Shaded per point, per pixel while moving, per pixel at rest")(work)
    size = (work.of(256, 24), work.of(192, 18))
    project = open_project("teatray", size)
    effort = OrbitEffort(n_pixels=work.of(300, 10), level=work.of(6, 4), coefficients=(320,))
    lines = [
        [
            {"moving": "while moving", "rest": "at rest", "still": "as stills are drawn"}[quality],
            f"{rmse:.1%}",
            f"{100 * mean:+.1f} %",
        ]
        for _, quality, rmse, mean in errors_by_coefficients(project, effort)
    ]
    words = "Per pixel, against brute force in direct light, tea tray:"
    return f"{shown}\n{words}\n\n{table(['', 'relRMSE', 'means'], lines)}"


def textures(work: Work) -> str:
    """Figure 6: visibility textures beside placed points."""
    effort = TextureEffort()
    if work.quick:
        effort = TextureEffort(("teatray",), (0, 2000), 10, (32, 24))
    found = measure_all(effort, work.report)
    write_plot(work.images, effort, found)
    lines = [
        [
            each.scene,
            each.way,
            f"{each.n_kept:,}",
            f"{each.visibility:.2%}",
            f"{each.radiance:.1%}",
            f"{each.share_used:.0%}",
        ]
        for each in found
    ]
    head = ["", "", "places", "visibility off", "relRMSE", "used of the texture"]
    return f"{table(head, lines)}\n![An atlas, and errors by places](../images/{PLOT})\n"


def truncation(work: Work) -> str:
    """Figures 7 and 8: the three factors truncated by three ways to choose, with 20 to 1,280 coefficients."""
    size = (work.of(128, 24), work.of(96, 18))
    project = open_project("teatray", size)
    effort = VariantEffort() if not work.quick else VariantEffort((), (2, 2, 24), 8, 4, (20, 320), (8,))
    lines = []
    for setting in orbit_variants(project, effort):
        way = setting.name.removeprefix("coefficients, ")
        if way in SELECTIONS:
            lines.append([way, *(f"{_error(setting, n):.1%}" for n in effort.selected)])
    shown = row("coefficients", "20, 80, 320 and 1,280 coefficients")(work)
    words = f"""The largest coefficients of each factor, light, visibility and BRDF, by size (area-weighted), by energy,
        or those of the top levels alone; relRMSE of {effort.n_pixels} pixels of the tea tray. Below, Orbit's own
        pictures by 20, 80, 320 and 1,280 coefficients, where light × visibility is one factor."""
    return f"{table(['', *(f'{n:,}' for n in effort.selected)], lines)}\n{paragraph(words)}\n{shown}"


def _error(setting: Setting, value: int) -> float:
    return errors(setting.make(value)().radiance, setting.truth).rmse


def storage(work: Work) -> str:
    """Table 1: what Orbit stores of three scenes."""
    lines = []
    for name in SCENES:
        project = open_project(name, (32, 24))
        orbit = Orbit(project.scene, n_points=work.of(40_000, 500))
        finish_orbit(orbit, project.sky, layers_by_object(project))
        stored = sum(each.nbytes for each in orbit.stored_visibility().values())
        lines.append([name, f"{orbit.n_bytes / MB:,.0f}", f"{stored / MB:,.0f}"])
    words = """Orbit rotates no light: at each point it projects light × visibility in the point's own frame, so that
        there are no rotated copies of the light, and slices of BRDFs by the view."""
    return f"{table(['', 'all, MB', 'of it visibility, MB'], lines)}\n{paragraph(words)}"


def rates(work: Work) -> str:
    """Table 3: frames a second while the camera moves, by coefficients."""
    lines = []
    for source in SCENES:
        n_vertices = len(open_subject(source).scene.vertices)
        cells = [
            f"{_rate(open_project(source, (work.of(1024, 64), work.of(768, 48))), n, work):.1f}" for n in (80, 320)
        ]
        lines.append([source, f"{n_vertices / 1000:.0f}k", *cells])
    for name, size, printed in (
        ("Dragon", "25k", ("97.4", "38.4")),
        ("XYZRGB", "50k", ("46.6", "16.9")),
        ("Buddha", "50k", ("43.5", "17.6")),
    ):
        lines.append([f"*{name}*, the paper's", size, *printed])
    words = """1,024 × 768, the camera goes round by 3° a frame; ours on two processor cores, with 40,000 points between
        the vertices, the paper's with visibility textures on an ATI X1900 XTX. What a graphics card draws of
        ours: [Orbit](../orbit.md)."""
    return f"{table(['', 'vertices', '80 coefficients', '320 coefficients'], lines)}\n{paragraph(words)}"


def _rate(project: Project, n_coefficients: int, work: Work) -> float:
    orbit = Orbit(project.scene, n_points=work.of(40_000, 500), n_coefficients=n_coefficients)
    finish_orbit(orbit, project.sky, layers_by_object(project))
    camera, seconds = project.scene.description.camera, []
    for k in range(work.of(12, 3)):
        moved = orbit_camera(camera, np.radians(3.0) * k, 0.0)
        begun = time.perf_counter()
        orbit.draw(camera.model_copy(update={"position": moved.position}), project.scene.resolution, "moving")
        seconds.append(time.perf_counter() - begun)
    return 1.0 / statistics.median(seconds[1:])


MAKERS: Mapping[str, Make] = {
    "figure 5": per_pixel,
    "figure 6": textures,
    "figure 7": truncation,
    "figure 9": row("material", "Three values of a roughness"),
    "figure 10": row("floor", "A floor whose material and normals vary, under light from two sides"),
    "figure 11": row("ward", "0.1 and 1.0, under a panel and under a hall"),
    "figure 13": row("lamps", "Three lamps, each with its shadows"),
    "figure 14": row("light", "Other light, other views"),
    "table 1": storage,
    "table 3": rates,
}
