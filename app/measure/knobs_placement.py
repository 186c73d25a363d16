"""Placement's knobs: lights, shadows, bands, precision, rays at edges; wavelets a frame; indirect light.

Direct light is judged at random points by brute force over 81,920 directions, indirect light by paths of four bounces.
A frame is what is shown after a drag of eight frames that bends a whole curve, with K coefficients each, and judged as
the edited material by brute force.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.measure.accuracy import layer_coefficients, oracle, random_rows, reflected, seen_scale
from app.measure.edges import box_averaged, direct_picture
from app.measure.knobs import Knob, Shown
from app.measure.representations import representation_knob
from app.measure.speed import ComputedLayer, Precomputed, precompute_on, visibility_seconds
from app.measure.subject import Subject
from app.measure.sweep import BYTES, EDIT, MIB, PRECISIONS, edited_layer, gpu_planes, largest_on_gpu
from app.measure.turning import Way, spent
from app.project.project import Project, open_project
from app.stills.stills import layers_by_object, plan_still
from engine.core.generators import run_to_end
from engine.curve.operators import Operator
from engine.curve.wavelet import forward
from engine.material.layer import Layer
from engine.precompute.direct.pipeline import FINAL, Placement, Quality
from engine.precompute.indirect.sampling_settings import FINE, ROUGH, STILL, SamplingSettings
from engine.precompute.indirect.series import BounceSeries, parse_series
from engine.render.path_tracer import trace_halves
from engine.render.still import StillLayer, still_layers, with_maps
from engine.render.still_indirect import indirect_radiance
from engine.visibility.point_visibility import brute_force_visibility
from engine.visibility.targets import VISIBILITY_LEVEL
from engine.visibility.thesis_variants import variant_visibility, voronoi_targets

FloatingArray = NDArray[np.floating]

N_BOUNCES, N_FRAMES, FINER, SEED = 4, 8, 4, 11
FINENESSES = {each.name: each for each in (ROUGH, FINE, STILL)}
SERIES = {"one bounce": BounceSeries(1), "whole curves": BounceSeries(N_BOUNCES)}  # beside those of `parse_series`
SIMPLE_SERIES, WHOLE_SERIES = SERIES
WAYS: dict[str, tuple[Way, bool]] = {
    "incremented, by effect": ("incremented", True),
    "incremented, by |Δc|": ("incremented", False),
    "anew, by effect": ("anew", True),
    "anew, by |c| (standard non-linear)": ("anew", False),
    "by bands, by effect": ("by bands", True),
}
SHADOWS = ("ours", "cut alone", "OPT", "GNU", "GWU", "SWB", "TRUE")


@dataclass(frozen=True)
class PlacementKnobs:
    """The picture's longer side, points judged in direct and in indirect light, the oracle's level, paths a point, and
    the settings; wavelets: K a frame, of a curve with as many bands as the last of them; fine: how finely series and
    rays are compared; frozen: objects, bounces and side in pixels where representations of indirect light are."""

    side: int = 64
    n_points: int = 300
    level: int = 6
    n_indirect: int = 100
    n_paths: int = 2048
    lights: tuple[int, ...] = (50, 100, 200, 400, 1000, 4000, 10_000)
    levels: tuple[int, ...] = (2, 3, 4, 5)
    bands: tuple[int, ...] = (4, 8, 16, 32, 64, 128, 256)
    patches: tuple[int, ...] = (8, 32, 128, 768, 2000)
    wavelets: tuple[int, ...] = (1, 2, 4, 8, 16, 32, 64, 128)
    edge_rays: tuple[int, ...] = (0, 4, 8, 16)
    shadows: tuple[str, ...] = SHADOWS
    series: tuple[str, ...] = (SIMPLE_SERIES, "64,1", "64,1,1", "64,1,1,1", "64,8,1,1", "8,1,1,1", WHOLE_SERIES)
    rays: tuple[int, ...] = (64, 128, 256, 512, 1024)
    fineness: tuple[str, ...] = tuple(FINENESSES)
    fine: SamplingSettings = FINE
    frozen: tuple[int, int, int] = (4, 4, 96)


QUICKLY = PlacementKnobs(
    32, 24, 5, 12, 256, (100, 1000), (3, 4), (8, 64), (32, 128), (1, 8, 64), (0, 4), ("ours", "TRUE"),
    (SIMPLE_SERIES, "64,1"), (64,), (), ROUGH, (2, 2, 24),
)  # fmt: skip


def placement_knobs(subject: Subject, effort: PlacementKnobs) -> Iterator[Knob]:
    """Of a subject at the effort's size."""
    bench = _Direct(subject, effort)
    yield from _stage_knobs(bench, effort)
    if bench.has_sky:
        yield bench.knob("shadows", effort.shadows, bench.with_shadows, "ours", "visibility and transport")
    yield bench.precision_knob()
    yield _edge_knob(bench, effort)
    yield from _Drag(bench, effort).knobs()
    yield from _Indirect(bench, effort).knobs()
    yield representation_knob(*effort.frozen)


class _Direct:
    """Pictures of direct light by stages with other settings."""

    def __init__(self, subject: Subject, effort: PlacementKnobs) -> None:
        self.subject, self.effort = subject, effort
        self.has_sky = subject.sky.environment is not None
        self.placement = Placement(subject.scene)
        visibility_seconds(self.placement)
        self.rows = random_rows(self.placement, effort.n_points)
        self.truth = oracle(subject, self.placement, self.rows, effort.level)

    def knob(self, name: str, settings: Sequence[Any], make: Any, present: Any, cost: str) -> Knob:
        return Knob("placement", name, settings, make, self.truth, present, cost)

    def stage(self, quality: Quality, bands: int | None = None, placement: Placement | None = None) -> Any:
        """What computes a stage, from known visibility of the sphere."""

        def compute() -> Shown:
            done = precompute_on(placement or self.placement, self.subject, quality, bands)
            return Shown(reflected(done)[self.rows], done.store_bytes / MIB)

        return compute

    @cached_property
    def done(self) -> Precomputed:
        """As the program does it, but with the most bands of a curve that wavelets are chosen from."""
        return precompute_on(self.placement, self.subject, FINAL, max(self.effort.wavelets))

    def with_shadows(self, way: str) -> Any:
        """What sees the sphere by one method and computes the stage."""
        placement = Placement(self.subject.scene, self.placement.caster)

        def compute() -> Shown:
            if way == "ours":
                visibility_seconds(placement)
            elif way == "TRUE":
                everything = np.arange(len(placement.hits.pixel))
                targets = placement.sphere.targets
                placement.sphere = brute_force_visibility(placement.hits, placement.caster, targets, everything)
            elif way != "cut alone":
                around = voronoi_targets(placement.sphere.targets.positions.astype(np.float64)).neighbours
                targets = replace(placement.sphere.targets, neighbours=around)
                found = variant_visibility(placement.hits, placement.caster, targets, way)  # type: ignore[arg-type]
                placement.sphere = replace(found, targets=placement.sphere.targets)
            shown: Shown = self.stage(replace(FINAL, own_rays=way == "cut alone"), None, placement)()
            return shown

        return compute

    def by_level(self, level: int) -> Any:
        """One ray and one value of the BRDF for each triangle of a level, at the judged points alone."""
        return lambda: Shown(oracle(self.subject, self.placement, self.rows, level))

    def precision_knob(self) -> Knob:
        """The sum over the GPU's planes, at all points."""
        done = self.done

        def make(precision: Any) -> Any:
            parts = [(done.placement.rows_of(t.i_object), t, gpu_planes(done, t, precision)) for t in done.transports]

            def compute() -> Shown:
                total = np.zeros((len(done.placement.hits.pixel), 3))
                for own, transport, planes in parts:
                    curve = forward(layer_coefficients(transport)[0]).astype(np.float32)
                    picture = np.einsum("jc,jpc->pc", curve, planes)
                    total[own] += picture * seen_scale(done.placement, own, transport.layer)
                return Shown(total[self.rows], largest_on_gpu(done, precision) / MIB)

            return compute

        return self.knob("precision", PRECISIONS, make, "half", "summing all coefficients once, on the CPU")


def _stage_knobs(bench: _Direct, effort: PlacementKnobs) -> Iterator[Knob]:
    cost = "transport, its shadows known"
    if bench.has_sky:  # lamps are no lights of the sphere, nor seen by its directions
        n_lights = FINAL.n_lights
        yield bench.knob("lights", effort.lights, lambda n: bench.stage(replace(FINAL, n_lights=n)), n_lights, cost)
        alone = "every direction of the judged points"
        yield bench.knob("sphere level", effort.levels, bench.by_level, VISIBILITY_LEVEL, alone)
    yield bench.knob("bands", effort.bands, lambda n: bench.stage(FINAL, n), bench.subject.most_bands, cost)
    if bench.placement.patches(1) is not None:
        yield bench.knob(
            "patches of lamps",
            effort.patches,
            lambda n: bench.stage(replace(FINAL, n_patches=n)),
            FINAL.n_patches,
            cost,
        )


def _edge_knob(bench: _Direct, effort: PlacementKnobs) -> Knob:
    """All pixels, against a picture with four times as many points each way."""
    project = _project(bench.subject)
    width, height = bench.subject.scene.resolution
    larger = replace(project, scene=replace(project.scene, resolution=(FINER * width, FINER * height)))
    truth = box_averaged(direct_picture(larger, 0), FINER).reshape(-1, 3)
    return Knob(
        "placement", "rays through pixels at edges", effort.edge_rays,
        lambda n: lambda: Shown(direct_picture(project, n).reshape(-1, 3)), truth, plan_still(project).n_edge_rays,
        "a still of direct light",
    )  # fmt: skip


def _project(subject: Subject) -> Project:
    return replace(open_project(subject.source), scene=subject.scene)


class _Drag:
    """A hand bends one layer's curve in some frames, each of which may change K coefficients [BenArtzi07, 7.1]."""

    def __init__(self, bench: _Direct, effort: PlacementKnobs) -> None:
        self._effort, self._rows, done = effort, bench.rows, bench.done
        index = edited_layer(bench.subject, done)
        transport = done.transports[index]
        self._own = done.placement.rows_of(transport.i_object)
        self._scale = seen_scale(done.placement, self._own, transport.layer)
        self._planes = gpu_planes(done, transport, "half")
        self._curves = [_dragged(transport, i / N_FRAMES) for i in range(N_FRAMES + 1)]
        self._others = reflected(done)
        self._others[self._own] -= self._whole(self._curves[0]) * self._scale
        layers: list[Layer] = [layer for _, layer in bench.subject.layers]
        layers[index] = transport.layer.with_operators(next(iter(transport.bands)), _part(1.0))
        self._truth = oracle(bench.subject, done.placement, self._rows, effort.level, layers)

    def knobs(self) -> Iterator[Knob]:
        most = len(self._curves[0])
        counts = [k for k in self._effort.wavelets if k <= most]
        for name, (way, by_effect) in WAYS.items():
            present = 32 if name == next(iter(WAYS)) else None
            yield Knob(
                "placement", f"wavelets a frame, {name}", counts,
                partial(self._frame, way=way, by_effect=by_effect), self._truth, present,
                "the sum of a frame's coefficients over the picture, on the CPU",
            )  # fmt: skip

    def _frame(self, k: int, way: Way, by_effect: bool) -> Any:
        """What adds the last frame's coefficients to what those before it have shown."""
        weight = np.ones(len(self._planes))
        if by_effect:
            weight = np.sqrt(np.mean(self._planes.astype(np.float64) ** 2, axis=(1, 2)))
        frames = spent(weight, _curve_levels(len(weight)), self._curves, k, way)
        before = np.zeros_like(frames[-1]) if way == "anew" else frames[-2]
        shown, change = self._whole(before), frames[-1] - before
        changed = np.flatnonzero(change.any(axis=1))

        def compute() -> Shown:
            picture = self._others.copy()
            picture[self._own] += (shown + self._sum(change, changed)) * self._scale
            return Shown(picture[self._rows], len(changed) * self._planes[0].size * BYTES["half"] / MIB)

        return compute

    def _whole(self, curve: FloatingArray) -> FloatingArray:
        return self._sum(curve, np.arange(len(curve)))

    def _sum(self, curve: FloatingArray, which: NDArray[np.integer]) -> FloatingArray:
        return np.asarray(np.einsum("kc,kpc->pc", curve[which].astype(np.float32), self._planes[which]))


def _part(share: float) -> tuple[Operator, ...]:
    """The edit, so much of its way done."""
    return tuple(
        replace(each, magnitude=(1.0 - share) * (each.kind == "amplify") + share * each.magnitude) for each in EDIT
    )


def _dragged(transport: ComputedLayer, share: float) -> NDArray[np.float64]:
    layer = transport.layer.with_operators(next(iter(transport.bands)), _part(share)) if share else transport.layer
    return np.asarray(forward(layer_coefficients(transport, layer)[0]))


def _curve_levels(n: int) -> NDArray[np.intp]:
    """Of each Daubechies coefficient: 0 for the mean and the coarsest detail, then one for each doubling."""
    return np.floor(np.log2(np.maximum(np.arange(n), 1))).astype(np.intp)


class _Indirect:
    """Pictures of indirect light at points inside of the picture, against paths."""

    def __init__(self, bench: _Direct, effort: PlacementKnobs) -> None:
        project = _project(bench.subject)
        self._effort, self._placement, self._sky = effort, bench.placement, project.sky
        self._rows = random_rows(self._placement, effort.n_indirect, seed=5)
        layers, n_paths = layers_by_object(project), effort.n_paths
        paths = trace_halves(self._placement, layers, project.sky, N_BOUNCES, n_paths, SEED, self._rows)
        self._truth = run_to_end(paths)[:, :, 1].mean(axis=0)
        self._direct = oracle(bench.subject, self._placement, self._rows, effort.level)
        self._layers: tuple[StillLayer, ...] = with_maps(
            self._placement, still_layers(project.layers.items(), project.object_names, plan_still(project))
        )

    def knobs(self) -> Iterator[Knob]:
        fine = self._effort.fine
        yield self._knob(
            "series", self._effort.series, lambda text: self._shown(text, fine), WHOLE_SERIES,
            f"indirect light, {fine.name}",
        )  # fmt: skip
        yield self._knob(
            "gather rays", self._effort.rays,
            lambda n: self._shown(WHOLE_SERIES, replace(fine, n_rays=n, n_glossy_hits=min(fine.n_glossy_hits, n))),
            fine.n_rays,
            f"indirect light, {fine.name}",
        )  # fmt: skip
        yield self._knob(
            "fineness", self._effort.fineness, lambda name: self._shown(WHOLE_SERIES, FINENESSES[name]), FINE.name,
            "indirect light",
        )  # fmt: skip

    def _knob(self, name: str, settings: Sequence[Any], make: Any, present: Any, cost: str) -> Knob:
        return Knob("placement", name, settings, make, self._truth, present, cost)

    def _shown(self, text: str, fineness: SamplingSettings) -> Any:
        series = SERIES.get(text) or parse_series(text)

        def compute() -> Shown:
            if series.n_bounces == 1:
                return Shown(self._direct)
            first = series.first
            layers = [replace(each, bands=_at_most(each.bands, first)) for each in self._layers]
            found = run_to_end(indirect_radiance(self._placement, layers, self._sky, series, fineness))
            return Shown(self._direct + found[self._rows])

        return compute


def _at_most(bands: tuple[int, int], most: int | None) -> tuple[int, int]:
    return bands if most is None else (min(bands[0], most), min(bands[1], most))
