"""Incremental wavelet rendering [BenArtzi07, ch. 7]: table 7.1, figures 7.1 and 7.2."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from matplotlib import pyplot as plt
from numpy.typing import NDArray

from app.measure.report import table
from app.measure.settings_placement import Strategy, frame_coefficients
from app.measure.subject import gpu_planes, open_subject, precompute, seen_scale
from benchmarks.papers.entries import Work, paragraph
from benchmarks.papers.sheets import sheet
from benchmarks.turning_sky import ROWS, TurningEffort, turning_errors
from engine.curve.operators import HALF_PI, Operator
from engine.curve.wavelet import forward, inverse
from engine.precompute.direct.pipeline import FINAL
from engine.render.display import display_picture
from engine.render.picture_difference import errors

Float64Array = NDArray[np.float64]

# Table 7.1: transport of one pixel, and the curves of its three frames in the box basis.
TRANSPORT = np.array([3.0, 5.0, 2.0])
CURVES = np.array([[4.0, 2.0, 1.0], [4.0, 3.0, 1.0], [4.0, 2.0, 0.0]])
# Figure 7.1: the pearls' lustre, and the rise that the user draws into it.
LUSTRE, FACTOR, N_BANDS, N_TERMS = "lustre", "theta_h", 128, 30
RISE = (
    Operator("translate", "y", 0.45, 0.7, 0.9, 1.25, 6.0),
    Operator("amplify", "y", 0.45, 0.7, 0.9, 1.25, 2.0, channels=(False, False, True)),
)
NAMES: dict[Strategy, str] = {"anew": "standard non-linear", "incremented": "incremental"}


def didactic(work: Work) -> str:
    """Table 7.1: one multiplication a frame."""
    desired = [np.zeros((3, 1)), *(curve[:, None] for curve in CURVES)]
    found = {
        strategy: frame_coefficients(np.ones(3), np.zeros(3, np.int64), desired, 1, strategy)[1:]
        for strategy in ("incremented", "anew")
    }
    lines = []
    for t, curve in enumerate(CURVES):
        held = [found[strategy][t][:, 0] for strategy in ("incremented", "anew")]
        cells = [f"{_tuple(each)}" for each in held]
        shown = [f"{TRANSPORT @ each:g}" for each in held]
        lines.append([str(t + 1), _tuple(curve), f"{TRANSPORT @ curve:g}", cells[0], shown[0], cells[1], shown[1]])
    head = ["frame", "desired", "R perfect", "incremental", "R", "non-linear", "R"]
    return f"{table(head, lines)}\nT = (3, 5, 2), one multiplication a frame, chosen by |Δc|.\n"


def _tuple(values: NDArray[np.floating]) -> str:
    return "(" + ", ".join(f"{value:g}" for value in values) + ")"


def edited_curve(work: Work) -> str:
    """Figure 7.1: a rise drawn into the pearls' curve, as 30 wavelets show it by both strategies."""
    side = work.of(200, 32)
    subject = open_subject("earrings", (side, side))
    done = precompute(subject, FINAL, N_BANDS)
    transport = next(each for each in done.transports if each.layer.name == LUSTRE)
    rows = done.placement.rows_of(transport.i_object)
    edited = transport.layer
    for operator in RISE:
        edited = edited.with_operators(FACTOR, (*edited.operators(FACTOR), operator))
    n_bands = transport.bands[FACTOR]
    before, after = (forward(each.coefficients(FACTOR, n_bands)) for each in (transport.layer, edited))
    planes = gpu_planes(done, transport, "float").astype(np.float64)
    scale = seen_scale(done.placement, rows, transport.layer)
    weight = np.sqrt((planes**2).mean(axis=(1, 2)))
    shown = {
        name: frame_coefficients(weight, np.zeros(n_bands, np.int64), [before, after], N_TERMS, strategy)[1]
        for strategy, name in NAMES.items()
    }
    truth = np.einsum("jc,jpc->pc", after, planes) * scale
    pictures = {name: np.einsum("jc,jpc->pc", each, planes) * scale for name, each in shown.items()}
    lines = [
        [name, f"{errors(each, truth).rmse:.2%}", f"{(each < -1e-6).any(axis=1).mean():.1%}"]
        for name, each in pictures.items()
    ]
    plot = work.plot("incremental_curve", _curve_plot(after, shown), "The curve by 30 wavelets, both ways")
    images = [display_picture(_image(done.placement, rows, each)) for each in (truth, *pictures.values())]
    seen = work.picture(
        "incremental_pearls", sheet(["whole curve", *pictures], [images]), "The pearls' lustre by 30 wavelets"
    )
    words = f"""{N_TERMS} of {n_bands} wavelets a frame, chosen by their effect. relRMSE of what the layer reflects in
        the first frame after the edit, and the share of points that would reflect less than nothing:"""
    return f"{plot}\n{seen}\n{paragraph(words)}\n{table(['', 'relRMSE', 'negative'], lines)}"


def _image(placement: object, rows: NDArray[np.integer], values: Float64Array) -> NDArray[np.float32]:
    hits = placement.hits  # type: ignore[attr-defined]
    width, height = hits.resolution
    image = np.zeros((height * width, 3), np.float32)
    np.add.at(image, hits.pixel[rows], np.asarray(np.maximum(values, 0.0) * hits.share[rows, None], np.float32))
    return image.reshape(height, width, 3)


def _curve_plot(desired: Float64Array, shown: Mapping[str, NDArray[np.floating]]) -> plt.Figure:
    figure, axes = plt.subplots(figsize=(5.6, 2.8), layout="constrained")
    degrees = np.degrees((np.arange(len(desired)) + 0.5) * HALF_PI / len(desired))
    axes.plot(degrees, inverse(desired)[:, 2], color="#c9c9c9", lw=4, label="desired, blue")
    for (name, each), colour in zip(shown.items(), ("#c0392b", "#2f6690"), strict=True):
        axes.plot(degrees, inverse(each)[:, 2], color=colour, lw=1, label=name)
    top = 1.3 * float(inverse(desired)[degrees > 20.0, 2].max())
    axes.set(xlabel="θh, degrees", xlim=(0, 90), ylim=(-0.25 * top, top))
    axes.axhline(0.0, color="#888888", lw=0.6)
    axes.legend(frameon=False, fontsize=8)
    axes.spines[["top", "right"]].set_visible(False)
    return figure


def turning_light(work: Work) -> str:
    """Figure 7.2: a sky that turns, by strategy and number of wavelets a frame."""
    effort = TurningEffort()
    if work.quick:
        effort = replace(effort, resolution=(24, 24), n_points=20, n_lights=200, terms=(8, 32))
    found = turning_errors(effort, work.report)
    degrees = list(dict.fromkeys(each.degrees for each in found))
    keys = dict.fromkeys((each.strategy, each.terms) for each in found)
    lines = []
    for strategy, terms in keys:
        own = [each.error for each in found if (each.strategy, each.terms) == (strategy, terms)]
        lines.append(
            [strategy if strategy == ROWS else f"{strategy}, {terms} wavelets", *(f"{100 * e:.1f} %" for e in own)]
        )
    words = """RMS of the error over mean radiance, of frames in which the tea tray's sky turns by so many degrees each.
        *By bands* is what the thesis has of [Overbeck06]; *rows* is what Placement does: each point has the
        wavelets that count for it, about as many as the mean that is named in [relighting](../relighting.md)."""
    return f"{table(['', *(f'{each:g}° a frame' for each in degrees)], lines)}\n{paragraph(words)}"
