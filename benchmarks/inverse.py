"""Painting a highlight: the time from a stroke to its picture, and how near the curve comes that made a picture.

Times are those of a window without a display and a worker in a process of its own, as a user has them: a stroke is
pressed and released at once, on the tea tray's lacquer, of 64 bands. The error is that of the curve of a ball, which
shows all angles, found from a picture by the same transport, linear and as a file of 8 bits has it.
"""

from __future__ import annotations

import shutil
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from app.editor.editor import Editor
from app.measure.subject import ComputedLayer, Precomputed, layer_coefficients, open_subject, precompute, seen_scale
from app.messages.worker_messages import WorkerClient
from app.modes.placement.highlight_controller import HighlightController
from app.worker.client import Client
from benchmarks.figures import Figure, NotMeasured, not_measured
from engine.core.colour import decode_srgb, encode_srgb
from engine.inverse.curve_fit import radiance_weights
from engine.inverse.highlight_brush import HighlightBrush
from engine.inverse.layer_fit import LayerPixels, fit_layers
from engine.precompute.direct.pipeline import FINAL
from engine.render.picture_difference import errors
from engine.scene.builtin import builtin_environments
from ui.headless import HeadlessWindow
from ui.panels.actions import PressHighlight, ReleaseHighlight
from ui.picture_feed import PictureFeed
from ui.script_runner import wait_for_picture, wait_for_scene

NAMES = ("inverse_ms", "inverse_curve_error")
SCENE, LAYER, CURVE = "teatray", "tray.1", "theta_h"
# Where strokes begin, as shares of the picture, and their brush.
PLACES = ((0.35, 0.75), (0.62, 0.70), (0.75, 0.62))
RADIUS = 24.0
BALL = """version = 1
[camera]
position = [0.0, 0.9, 2.2]
target = [0.0, 0.0, 0.0]
fov_y = 28.0
[environment]
file = "studio.exr"
[[object]]
name = "ball"
primitive = "sphere"
layer = [{ model = "rough_conductor", alpha = 0.12 }]
"""
# The roughness that made the picture to be matched, and the share of its pixels that its exposure clips.
ROUGHNESS, CLIPPED = 0.25, 0.01


@dataclass(frozen=True)
class InverseEffort:
    """The sides of the pictures that strokes and errors are measured in, and strokes at each place."""

    side: int = 512
    error_side: int = 128
    n_strokes: int = 4


def inverse_figures(
    effort: InverseEffort | None, report: Callable[[str], None], make_client: Callable[[], WorkerClient] = Client
) -> list[Figure]:
    """All of them; None: left out. make_client: starts the worker."""
    if effort is None:
        return [not_measured(name, "left out of a quick run") for name in NAMES]
    report("painted highlights")
    try:
        figures = [_stroke_figure(effort, make_client())]
    except NotMeasured as error:
        figures = [not_measured(NAMES[0], str(error))]
    return [*figures, _error_figure(effort)]


def _stroke_figure(effort: InverseEffort, client: WorkerClient) -> Figure:
    editor = Editor(client, SCENE, resolution=(effort.side, effort.side))
    try:
        window = HeadlessWindow(editor)
        window.shell.source = feed = PictureFeed(window.context, editor.mode)
        try:
            wait_for_scene(window, editor)
            editor.select(f"{LAYER}.{CURVE}")
            wait_for_picture(window, editor, "exact")
            _stroke_ms(window, editor, PLACES[0], effort)  # loads what solves
            found = [_stroke_ms(window, editor, place, effort) for place in PLACES for _ in range(effort.n_strokes)]
        finally:
            feed.close()
            window.close()
    finally:
        editor.close()
    how = (
        f"{effort.side} x {effort.side}, {found[0][1]} bands, brush of {RADIUS:.0f} pixels: from the press and release "
        "of the brush to the first frame with the answer (glFinish)"
    )
    return Figure("inverse_ms", tuple(ms for ms, _ in found), how)


def _stroke_ms(
    window: HeadlessWindow, editor: Editor, place: tuple[float, float], effort: InverseEffort
) -> tuple[float, int]:
    """Milliseconds of one stroke, which is taken back, and the number of bands that it solved for."""
    strokes, scale = editor.controller.highlights, effort.side / 512.0
    assert strokes is not None
    before = editor.document
    brush = HighlightBrush(radius=RADIUS * scale)
    began = time.perf_counter()
    window.shell.request(
        PressHighlight(brush, "curve", (place[0] * effort.side, place[1] * effort.side)), ReleaseHighlight()
    )
    if not window.run_until(lambda: _is_answered(strokes, before, editor), 60.0):
        raise NotMeasured("a stroke was not answered within a minute")
    # The frame that took the answer has drawn it, and has finished.
    elapsed = 1e3 * (time.perf_counter() - began)
    operators = editor.document.layer(LAYER).operators(CURVE)
    n_bands = len(operators[-1].gammas)  # type: ignore[union-attr]
    editor.undo()
    wait_for_picture(window, editor, "exact")
    return elapsed, n_bands


def _is_answered(strokes: HighlightController, before: object, editor: Editor) -> bool:
    return editor.document is not before and (strokes.wants_picture or not strokes.is_busy)


def _error_figure(effort: InverseEffort) -> Figure:
    with tempfile.TemporaryDirectory(prefix="insitu-measure-") as folder:
        shutil.copy(builtin_environments()["studio"], folder)
        (Path(folder) / "scene.toml").write_text(BALL)
        subject = open_subject(str(Path(folder) / "scene.toml"), (effort.error_side, effort.error_side))
        done = precompute(subject, FINAL)
    chosen = done.transports[0]
    off = {"linear": _curve_error(done, chosen, in_8_bits=False), "8 bits": _curve_error(done, chosen, in_8_bits=True)}
    how = (
        f"a ball at {effort.error_side} x {effort.error_side}, its curve of {chosen.bands[CURVE]} bands from a picture "
        f"of it at roughness {ROUGHNESS:g}, relative RMS error of its band values"
    )
    return Figure("inverse_curve_error", tuple(off.values()), how, off)


def _curve_error(done: Precomputed, chosen: ComputedLayer, in_8_bits: bool) -> float:
    """relRMSE of the band values that are found from the picture of another roughness."""
    rows = done.placement.rows_of(chosen.i_object)
    view = seen_scale(done.placement, rows, chosen.layer) * done.light.lighting.unit
    before = layer_coefficients(chosen)
    # The quotient stays that of the layer: what differs is the curve alone.
    after = chosen.layer.with_parameter("alpha", ROUGHNESS).coefficients(CURVE, chosen.bands[CURVE])
    linear, seen = (np.asarray(chosen.store.radiance(a, before[1]) * view, np.float64) for a in (after, before[0]))
    target, kept = _as_photograph(linear) if in_8_bits else (linear, np.ones(len(linear), bool))
    pixels = LayerPixels(
        chosen.store.take(np.flatnonzero(kept)), view[kept], dict(zip(chosen.bands, before, strict=False))
    )
    found = fit_layers([pixels], [CURVE], (target - seen)[kept], radiance_weights(target[kept]))
    return errors(before[0] + found.fits[CURVE].change, after).rmse


def _as_photograph(radiance: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Radiance (n, 3) that went through 8 bits of sRGB, and which pixels were not clipped."""
    exposure = 1.0 / float(np.quantile(radiance.max(axis=1), 1.0 - CLIPPED))
    code = np.round(255.0 * encode_srgb(np.clip(radiance * exposure, 0.0, 1.0)))
    return decode_srgb(code / 255.0) / exposure, np.asarray((code < 255.0).all(axis=1))
