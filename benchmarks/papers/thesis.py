"""The entries of [BenArtzi07], by place."""

from __future__ import annotations

from collections.abc import Mapping

from app.measure.report import save_figure
from assets.scripts import curve_figures, figures
from assets.scripts.bounces import save
from benchmarks.papers.entries import Make, Work
from benchmarks.papers.thesis_increments import didactic, edited_curve, turning_light
from benchmarks.papers.thesis_light import (
    earrings_session,
    guide_sheet,
    lights_with_extent,
    phong_edits,
    tea_tray_session,
)
from benchmarks.papers.thesis_precomputation import direct_costs, global_costs, growth
from benchmarks.papers.thesis_rooms import (
    cornell_edits,
    guide_bounces,
    ring_edits,
    room_session,
    series_of_bounces,
    two_bounces,
    vase_session,
)
from benchmarks.papers.thesis_shadows import (
    coherence,
    fewer_lights,
    plant,
    ray_costs,
    rays,
    speeds,
    truth_pictures,
    variants,
)


def window(name: str, words: str) -> Make:
    """The whole window after one of the guides' scripts."""

    def make(work: Work) -> str:
        if not work.quick:
            work.report(f"the window: {name}")
            figures.take(name, work.images.resolve())
        return f"![{words}](../images/{name}.png)\n"

    return make


def phong_curve(work: Work) -> str:
    """Figure 3.1."""
    save_figure(work.images / "phong_curves.png", curve_figures.phong_curves())
    return "![Phong's curve for five exponents](../images/phong_curves.png)\n"


def operators(work: Work) -> str:
    """Figures 9.1 to 9.4."""
    save_figure(work.images / "curve_operators.png", curve_figures.curve_operators())
    return "![Helper functions, and a curve before and after](../images/curve_operators.png)\n"


def turning_ratio(work: Work) -> str:
    """Section 6.2.1."""
    if not work.quick:
        save(work.images / "ratio.png", curve_figures.ratios())
    return "![A streak turns as the ratio passes 1](../images/ratio.png)\n"


MAKERS: Mapping[str, Make] = {
    "figure 1.2-1.4": phong_edits,
    "figure 3.1": phong_curve,
    "figure 3.2": window("pearls_sigma", "The window: σ of the pearls"),
    "figure 3.3": window("posts_fresnel", "The window: Fresnel effect of the posts"),
    "figure 3.4": window("teapot_anisotropy", "The window: the teapot brushed"),
    "figure 3.5": window("velvet", "The window: velvet"),
    "figure 3.6": window("measured_cloth", "The window: a measured cloth"),
    "figure 3.7": window("curve_drawing", "The window: a curve is drawn"),
    "figure 4.3": lights_with_extent,
    "figure 4.4": tea_tray_session,
    "figure 4.4 a.1-d.1": guide_sheet,
    "figure 4.5": earrings_session,
    "table 4.2": direct_costs,
    "figure 5.3": two_bounces,
    "figure 5.4": growth,
    "figure 5.5, 5.6": cornell_edits,
    "section 5.2": series_of_bounces,
    "figure 6.1, 6.4": room_session,
    "figure 6.3": vase_session,
    "figure 6.5": ring_edits,
    "section 6.2.1": turning_ratio,
    "section 6.2": guide_bounces,
    "table 6.1": global_costs,
    "table 7.1": didactic,
    "figure 7.1": edited_curve,
    "figure 7.2": turning_light,
    "figure 8.2": fewer_lights,
    "figure 8.7": truth_pictures,
    "figure 8.8": variants,
    "figure 8.9": plant,
    "table 8.1": rays,
    "table 8.2": speeds,
    "table 8.3": ray_costs,
    "section 8.8": coherence,
    "figure 9.1-9.4": operators,
}
