"""Two representations of indirect light on the same rays, as bounces and objects become more.

The room of `indirect_memory`, cut into more and more objects with one curve of 64 bands each: the gather operator with
its polynomial, which the editor uses, and the thesis' dense tensor. Seconds are those of the processor, which say more
than the clock's on a machine that others use; tracing, which both share, is left out.
"""

from __future__ import annotations

import csv
import io
import statistics
import time
from collections.abc import Iterator, Sequence
from dataclasses import astuple, dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.document.described import document_from_description
from app.measure.settings import Outcome, Setting
from app.measure.subject import at_most, open_subject
from app.project.distant_light import sky_of
from app.system.atomic import save_file
from benchmarks.dense_tensor import DenseTensor
from benchmarks.indirect_memory import SOURCE, cut
from engine.core.generators import run_to_end
from engine.material import MODELS
from engine.material.layer import make_layer
from engine.precompute.direct.pipeline import Placement
from engine.precompute.indirect.frozen_light import FrozenLight, LightEdit, SelectedCurve
from engine.precompute.indirect.gather_polynomial import GatherPolynomial, Representation
from engine.precompute.indirect.indirect_layers import IndirectLayer, diffuse_slant, indirect_layer
from engine.precompute.indirect.indirect_light import IndirectLight
from engine.precompute.indirect.sampling_settings import ROUGH, SamplingSettings
from engine.precompute.indirect.solver import Solver
from engine.scene.scene_loader import Scene

CSV = "indirect_representations.csv"
MODEL, N_BANDS = "phong", 64
FINENESS = replace(ROUGH, n_rays=512)
GATHER, DENSE = "gather", "dense"
REPETITIONS = 3


@dataclass(frozen=True)
class RepresentationRow:
    """One representation with M objects and N bounces: memory (MB, 10⁶ bytes) of what a freezing reads, seconds to make
    it from what was traced, seconds of a freezing, and how far its picture is from the plain sum (relative RMS)."""

    representation: str
    objects: int
    bounces: int
    points: int
    memory_mb: float
    made_s: float
    freeze_s: float
    error: float


def representation_rows(settings: Sequence[tuple[int, int]], side: int) -> Iterator[RepresentationRow]:
    """Two rows for each (objects, bounces)."""
    scene = open_subject(SOURCE).scene
    scene = replace(scene, resolution=at_most(scene.resolution, side))
    for n_objects, n_bounces in settings:
        yield from compare(cut(scene, n_objects), n_objects, n_bounces)


def compare(
    scene: Scene, n_objects: int, n_bounces: int, fineness: SamplingSettings = FINENESS
) -> tuple[RepresentationRow, RepresentationRow]:
    """Both representations of a cut scene."""
    light, layers = _traced(scene, n_objects, n_bounces, fineness)
    traced = light.points.samples.n_bytes + light.light.n_bytes

    def row(name: str, made: Representation, made_s: float, read: int) -> RepresentationRow:
        times, frozen = zip(*(_timed(made, layers, 0) for _ in range(REPETITIONS)), strict=True)
        counts, error = (n_objects, n_bounces, len(light.points.samples.points)), edit_error(light, layers, frozen[0])
        return RepresentationRow(name, *counts, (made.n_bytes + read) / 1e6, made_s, statistics.median(times), error)

    gather = GatherPolynomial(light)
    # What the first freezing keeps, for another object than the one that is timed, is what making it takes.
    first = row(GATHER, gather, _timed(gather, layers, n_objects - 1)[0], traced)
    started = time.process_time()
    dense = DenseTensor(light, layers)
    return first, row(DENSE, dense, time.process_time() - started, 0)


def _traced(
    scene: Scene, n_objects: int, n_bounces: int, fineness: SamplingSettings
) -> tuple[IndirectLight, list[IndirectLayer]]:
    # The tensor goes by equivalent albedos alone.
    layer = diffuse_slant(indirect_layer(0, make_layer(MODELS[MODEL]), (N_BANDS,)))
    layers = [replace(layer, i_object=i) for i in range(n_objects)]
    sky = sky_of(scene, document_from_description(SOURCE, scene.description).light)
    models = {layer.i_object: [MODEL] for layer in layers}
    return run_to_end(Solver(Placement(scene), models, sky, n_bounces, fineness, glossy=False).solve(layers)), layers


def edit_error(light: IndirectLight, layers: Sequence[IndirectLayer], frozen: FrozenLight) -> float:
    """Of the first object after an edit of its curve, from what was frozen for it."""
    found, plain = edited_pictures(light, layers, frozen)
    return float(np.sqrt(np.mean((found - plain) ** 2)) / plain.mean())


def edited_pictures(
    light: IndirectLight, layers: Sequence[IndirectLayer], frozen: FrozenLight
) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
    """What the first object reflects after that edit (p, 3): from what was frozen, and as the plain sum."""
    curve = layers[0].curves.curves[0] * np.linspace(0.2, 1.5, N_BANDS)[:, None]
    albedo = layers[0].albedo * 0.7
    edited = replace(layers[0], curves=replace(layers[0].curves, curves=(curve,)), albedo=albedo)
    [plain] = run_to_end(
        light.points.hemisphere_samples(0).reflect([edited.curves], light.outgoing_radiance([edited, *layers[1:]]))
    )
    return frozen.radiance(0, LightEdit(albedo, {0: curve}, {})), plain[:, 0]


def representation_setting(n_objects: int, n_bounces: int, side: int) -> Setting:
    """The same choice as a setting: seconds of a freezing, memory of what it reads."""
    scene = open_subject(SOURCE).scene
    scene = cut(replace(scene, resolution=at_most(scene.resolution, side)), n_objects)
    light, layers = _traced(scene, n_objects, n_bounces, FINENESS)
    frozen = run_to_end(GatherPolynomial(light).freeze(layers, 0, [SelectedCurve(0, 0)]))
    truth = edited_pictures(light, layers, frozen)[1]

    def make(name: Any) -> Any:
        made = GatherPolynomial(light) if name == GATHER else DenseTensor(light, layers)
        _timed(made, layers, n_objects - 1)  # what the first freezing keeps is a part of making it

        def compute() -> Outcome:
            found = run_to_end(made.freeze(layers, layers[0].i_object, [SelectedCurve(0, 0)]))
            return Outcome(edited_pictures(light, layers, found)[0], made.n_bytes / 2**20)

        return compute

    cost = f"freezing for an object, {n_objects} objects, {n_bounces} bounces"
    return Setting("placement", "representation of indirect light", (GATHER, DENSE), make, truth, GATHER, cost)


def write_rows(file: Path, rows: Sequence[RepresentationRow]) -> None:
    """One line a row under a line of names."""
    text = io.StringIO(newline="")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(field.name for field in fields(RepresentationRow))
    writer.writerows([f"{x:.4g}" if isinstance(x, float) else x for x in astuple(row)] for row in rows)
    save_file(file, text.getvalue().encode())


def _timed(made: Representation, layers: Sequence[IndirectLayer], i_layer: int) -> tuple[float, FrozenLight]:
    """Seconds of a freezing for a layer's object, and what it gave."""
    started = time.process_time()
    frozen = run_to_end(made.freeze(layers, layers[i_layer].i_object, [SelectedCurve(i_layer, 0)]))
    return time.process_time() - started, frozen
