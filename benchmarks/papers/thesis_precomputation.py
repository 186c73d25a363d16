"""Time and memory of precomputation [BenArtzi07, tables 4.2 and 6.1, figure 5.4]."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Iterator, Mapping
from math import comb
from pathlib import Path
from statistics import median

from matplotlib import pyplot as plt

from app.measure.report import table
from app.measure.subject import (
    BYTES,
    ComputedLayer,
    layer_bands,
    layer_coefficients,
    layer_shape,
    open_subject,
    precompute,
)
from benchmarks.figures import NotMeasured
from benchmarks.indirect_representations import representation_rows
from benchmarks.launches import measure_indirect
from benchmarks.papers.entries import Work, paragraph
from engine.core.generators import run_to_end
from engine.material.layer import Layer
from engine.precompute.direct.bandstore import BandStore, curve_planes, join_tiles
from engine.precompute.direct.pipeline import FINAL, PREVIEW, Placement, Quality
from engine.precompute.direct.projection import project_layer

SIDE = 512
MB = 1e6
# Scene, objects and series of table 6.1, its picture, and what it prints: h:m of precomputation, MB, s of a freezing,
# frames a second.
GLOBAL: Mapping[str, tuple[str, tuple[int, int], str]] = {
    "Cornell box": ("cornell", (450, 450), "5:58, 1,461 MB, 10 s, 22"),
    "vase": ("vase", (512, 512), "5:29, 964 MB, 8 s, 19"),
    "room": ("room", (640, 480), "9:25, 755 MB, 7 s, 20"),
    "ring": ("ring", (400, 400), "6:15, 627 MB, 16 s, 6"),
}
TIMEOUT_S = 1800.0
OBJECTS, BOUNCES, BASES = 6, (1, 2, 3, 4, 5, 6), (4, 8, 16, 32, 64, 128)


# --------------------------------------------------------------------------------------------------- direct: table 4.2


def direct_costs(work: Work) -> str:
    """Table 4.2: of each layer of the earrings and the tea tray."""
    side = work.of(SIDE, 32)
    head = [
        "object",
        "points",
        "layer",
        "bands",
        "switch, s",
        "raw, MB",
        "stored, MB",
        "4,000 lights, s",
        "400 lights, s",
    ]
    precompute(open_subject("teatray", (24, 24)), FINAL)  # compiled before anything is timed
    parts = []
    for source in ("teatray", "earrings"):
        work.report(f"precomputation of {source}")
        finest, few = dict(_layer_costs(source, side, FINAL)), dict(_layer_costs(source, side, PREVIEW))
        lines = [
            [*finest[key][0], f"{finest[key][1]:.2f}", f"{few[key][1]:.2f}"] for key in finest if key != "visibility"
        ]
        shadows = ["visibility and light", *[""] * 6, f"{finest['visibility'][1]:.1f}", f"{few['visibility'][1]:.1f}"]
        parts.append(f"*{source}*\n\n{table(head, [*lines, shadows])}")
    words = f"""Seconds of the clock on all cores, {side} × {side}, layers as opened. *Raw* is every band of every point
        in single precision, *stored* what the worker keeps. *Switch*: from the stored transport to that of one
        curve as the graphics card reads it."""
    return "\n".join([*parts, paragraph(words)])


def _layer_costs(source: str, side: int, quality: Quality) -> Iterator[tuple[str, tuple[list[str], float]]]:
    """For each layer, and for "visibility": the cells that do not depend on the lights, and the seconds."""
    subject = open_subject(source, (side, side))
    placement = Placement(subject.scene)
    begun = time.perf_counter()
    light = run_to_end(placement.light(subject.sky, quality))
    yield "visibility", ([], time.perf_counter() - begun)
    names = [each.name for each in subject.scene.description.objects]
    for i_object, layer in subject.layers:
        bands = layer_bands(layer)
        rows, shape = placement.rows_of(i_object), layer_shape(layer, bands)
        begun = time.perf_counter()
        store = join_tiles(shape.bands, project_layer(placement.hits, rows, light, shape))
        seconds = time.perf_counter() - begun
        switch = "" if shape.bands[1] == 1 else f"{_switch_seconds(store, layer, bands, i_object):.2f}"
        raw = store.n_points * shape.bands[0] * shape.bands[1] * 3 * BYTES["float"] / MB
        counts = " × ".join(str(n) for n in bands.values())
        stored = f"{store.n_bytes / MB:.1f} ({store.n_bytes / MB / raw:.2f})" if raw else "0"
        cells = [names[i_object], f"{store.n_points:,}", layer.model.name, counts, switch, f"{raw:,.0f}", stored]
        yield f"{i_object} {layer.name}", (cells, seconds)


def _switch_seconds(store: BandStore, layer: Layer, bands: dict[str, int], i_object: int) -> float:
    coefficients = layer_coefficients(ComputedLayer(i_object, layer, bands, store))
    seconds = []
    for factor in (0, 1, 0, 1):
        begun = time.perf_counter()
        curve_planes(store, factor, coefficients, 1.0, "half")
        seconds.append(time.perf_counter() - begun)
    return median(seconds)


# -------------------------------------------------------------------------------------------------- global: table 6.1


def global_costs(work: Work) -> str:
    """Table 6.1: of the scenes with four bounces, in the window."""
    lines = []
    for name, (source, resolution, printed) in GLOBAL.items():
        work.report(f"indirect light of {source} in the window")
        size = (48, 48) if work.quick else resolution
        lines.append([name, f"{size[0]} × {size[1]}", *_in_the_window(source, size, work), printed])
    head = [
        "",
        "picture",
        "first, s",
        "finest, s",
        "freezing, s",
        "its gloss too, s",
        "edit, ms",
        "memory, MB",
        "the thesis'",
    ]
    words = """Each in the editor with its worker, drawn by software: *first* until there is a picture with indirect
        light, *finest* until it is as fine as the editor makes it, *freezing* from selecting another object until
        edits of it are followed (medians of objects, the slowest), *edit* from a change of a curve to the
        finished frame with four bounces (medians, least and most). The thesis' columns are hours:minutes of
        precomputation, storage, seconds of a freezing, and frames a second."""
    return f"{table(head, lines)}\n{paragraph(words)}"


def _in_the_window(source: str, resolution: tuple[int, int], work: Work) -> list[str]:
    with tempfile.TemporaryDirectory(prefix="insitu-papers-") as folder:
        try:
            found, _ = measure_indirect(source, resolution, work.of(10, 1), 1, Path(folder), TIMEOUT_S)
        except NotMeasured as reason:
            return [str(reason), *[""] * 5]
    edits = [median(each) for each in found["edit_ms"].values()]
    freezing, whole = (
        max((median(e) for e in found[key].values() if e), default=0.0) for key in ("freeze_s", "freeze_whole_s")
    )
    return [
        f"{found['first_s']:.1f}",
        f"{found['finest_s']:.0f}",
        f"{freezing:.2f}",
        f"{whole:.1f}",
        f"{min(edits):.0f} to {max(edits):.0f}",
        f"{found['memory_mb']:.0f}",
    ]


# ------------------------------------------------------------------------------------------------- growth: figure 5.4


def tensor_terms(n_bases: int, n_bounces: int, is_symmetric: bool) -> int:
    """Terms of the N-bounce energy of a pixel with W basis BRDFs in the scene [BenArtzi07, sect. 5.2]: W^N, or
    C(N + W - 1, N) where those that differ by a permutation are one."""
    return comb(n_bounces + n_bases - 1, n_bounces) if is_symmetric else int(n_bases**n_bounces)


def growth(work: Work) -> str:
    """Figure 5.4: terms of the tensor by bounces and by bases, and what ours keeps instead."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(8.4, 3.2), layout="constrained")
    for is_symmetric, style in ((False, "--"), (True, "-")):
        words = "symmetric" if is_symmetric else "all"
        left.plot(
            BOUNCES, [tensor_terms(OBJECTS, n, is_symmetric) for n in BOUNCES], style, color="#2f6690", label=words
        )
        right.plot(BASES, [tensor_terms(w, 4, is_symmetric) for w in BASES], style, color="#2f6690", label=words)
    left.set(xlabel="bounces, 6 bases", ylabel="terms of a pixel", yscale="log")
    right.set(xlabel="bases, 4 bounces", xscale="log", yscale="log")
    right.set_xticks(BASES, [str(each) for each in BASES])
    right.minorticks_off()
    for axes in (left, right):
        axes.legend(frameon=False, fontsize=8)
        axes.spines[["top", "right"]].set_visible(False)
    shown = work.plot("tensor_growth", figure, "Terms of the tensor by bounces and by bases")
    settings = ((2, 2),) if work.quick else ((2, 4), (7, 2), (7, 3), (7, 4), (7, 5), (12, 4))
    rows = list(representation_rows(settings, work.of(192, 32)))
    by_setting: dict[tuple[int, int], dict[str, float]] = {}
    for row in rows:
        by_setting.setdefault((row.objects, row.bounces), {})[row.representation] = row.memory_mb
    lines = [
        [f"{m} objects, {n} bounces", f"{own['dense']:.1f}", f"{own['gather']:.1f}"]
        for (m, n), own in by_setting.items()
    ]
    ratio = tensor_terms(64, 4, False) / tensor_terms(64, 4, True)
    words = f"""With 4 bounces symmetry saves a factor of {ratio:.0f} at 64 bases, and 24 in the limit; the thesis reads
        90 off its plot. Ours stores no tensor: light goes from gather points to cache records, whose number does
        not depend on objects or bounces. Memory of what a freezing reads, from the same rays:"""
    return f"{shown}\n{paragraph(words)}\n{table(['', 'dense tensor, MB', 'gather operator, MB'], lines)}"
