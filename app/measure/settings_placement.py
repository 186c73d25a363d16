"""Placement's settings: lights, bands, precision, rays at edges; wavelets a frame; indirect light.

Direct light is judged at random points by brute force over 81,920 directions, indirect light by paths of four bounces.
A frame is what is shown after a drag of eight frames that bends a whole curve, with K coefficients each, and judged
against the edited material by brute force.

Three strategies choose the coefficients that frames show of a light or a curve that changes, where each frame may
change n of them: *anew*, the n that count most; *incremented*, the n whose changes count most, added to the frame
before [BenArtzi07, eq. 7.4]; *by bands*, where each level of the wavelets is given up and begun anew in the frames in
which it is farther from what it should be than zeros are.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from app.measure.settings import Outcome, Setting
from app.measure.subject import (
    BYTES,
    MIB,
    PRECISIONS,
    ComputedLayer,
    Precomputed,
    Subject,
    box_averaged,
    direct_picture,
    gpu_planes,
    largest_on_gpu,
    layer_coefficients,
    oracle,
    precompute_on,
    random_rows,
    reflected,
    seen_scale,
    visibility_seconds,
)
from app.project.project import Project, open_project
from app.stills.stills import layers_by_object, plan_still
from engine.core.generators import run_to_end
from engine.curve.operators import HALF_PI, Operator
from engine.curve.wavelet import forward
from engine.material.layer import Layer
from engine.precompute.direct.pipeline import FINAL, Placement, Quality
from engine.precompute.indirect.sampling_settings import (
    FINE,
    ROUGH,
    STILL,
    BounceSeries,
    SamplingSettings,
    parse_series,
)
from engine.reference.path_tracer import trace_halves
from engine.render.still import StillLayer, first_bounce_layers, indirect_radiance, still_layers, with_maps
from engine.visibility.point_visibility import VISIBILITY_LEVEL

Strategy = Literal["anew", "incremented", "by bands"]
STRATEGIES: tuple[Strategy, ...] = get_args(Strategy)


def frame_coefficients(
    weight: NDArray[np.floating], levels: NDArray[np.integer], desired: Sequence[NDArray[np.floating]], n_terms: int,
    strategy: Strategy,
) -> list[NDArray[np.floating]]:  # fmt: skip
    """The coefficients (T, 3) shown in each frame by those desired in it (T, 3), of which the first are shown whole.

    weight (T,): by which a coefficient counts; levels (T,): on which it is; n_terms: how many change in a frame.
    """
    held, frames = desired[0].copy(), []
    for light in desired:
        if strategy == "anew":
            held = np.zeros_like(light)
        if strategy == "by bands":
            stale, missing = (np.bincount(levels, weight**2 * (each**2).sum(axis=1)) for each in (light - held, light))
            held[(missing < stale)[levels]] = 0.0
        change = weight * np.abs(light - held).max(axis=1)
        chosen = np.argsort(-change, kind="stable")[:n_terms]
        held[chosen] = light[chosen]
        frames.append(held.copy())
    return frames


FloatingArray = NDArray[np.floating]

N_BOUNCES, N_FRAMES, FINER, SEED = 4, 8, 4, 11
FINENESSES = {each.name: each for each in (ROUGH, FINE, STILL)}
SERIES = {"one bounce": BounceSeries(1), "whole curves": BounceSeries(N_BOUNCES)}  # beside those of `parse_series`
SIMPLE_SERIES, WHOLE_SERIES = SERIES
# The edit whose frames are measured: twice the middle of the curve, less of its flanks, each channel by itself.
EDIT = (
    Operator("amplify", "y", 0.0, 0.0, HALF_PI, HALF_PI, 1.6),
    Operator("translate", "x", 0.0, 0.05, 0.5, 1.2, 0.05),
)


@dataclass(frozen=True)
class PlacementValues:
    """The picture's longer side, points judged in direct and in indirect light, the oracle's level, paths a point, and
    the values; wavelets: K a frame, of a curve with as many bands as the last of them; fine: how finely series and rays
    are compared."""

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
    series: tuple[str, ...] = (SIMPLE_SERIES, "64,1", "64,1,1", "64,1,1,1", "64,8,1,1", "8,1,1,1", WHOLE_SERIES)
    rays: tuple[int, ...] = (64, 128, 256, 512, 1024)
    fineness: tuple[str, ...] = tuple(FINENESSES)
    fine: SamplingSettings = FINE


QUICK = PlacementValues(
    32, 24, 5, 12, 256, (100, 1000), (3, 4), (8, 64), (32, 128), (1, 8, 64), (0, 4), (SIMPLE_SERIES, "64,1"), (64,), (),
    ROUGH,
)  # fmt: skip


def placement_settings(subject: Subject, effort: PlacementValues) -> Iterator[Setting]:
    """Of a subject at the effort's size."""
    direct = DirectPictures(subject, effort)
    yield from _stage_settings(direct, effort)
    yield direct.precision()
    yield _edge_rays(direct, effort)
    yield DraggedCurve(direct, effort).setting("wavelets a frame", "incremented", by_effect=True, present=32)
    yield from _IndirectPictures(direct, effort).settings()


class DirectPictures:
    """Pictures of direct light by stages with other settings."""

    def __init__(self, subject: Subject, effort: PlacementValues) -> None:
        self.subject, self.effort = subject, effort
        self.has_sky = subject.sky.environment is not None
        self.placement = Placement(subject.scene)
        visibility_seconds(self.placement)
        self.rows = random_rows(self.placement, effort.n_points)
        self.truth = oracle(subject, self.placement, self.rows, effort.level)

    def setting(self, name: str, values: Sequence[Any], make: Any, present: Any, cost: str) -> Setting:
        return Setting("placement", name, values, make, self.truth, present, cost)

    def stage(self, quality: Quality, bands: int | None = None, placement: Placement | None = None) -> Any:
        """What computes a stage, from known visibility of the sphere."""

        def compute() -> Outcome:
            done = precompute_on(placement or self.placement, self.subject, quality, bands)
            return Outcome(reflected(done)[self.rows], done.store_bytes / MIB)

        return compute

    @cached_property
    def done(self) -> Precomputed:
        """As the program does it, but with the most bands of a curve that wavelets are chosen from."""
        return precompute_on(self.placement, self.subject, FINAL, max(self.effort.wavelets))

    def by_level(self, level: int) -> Any:
        """One ray and one value of the BRDF for each triangle of a level, at the judged points alone."""
        return lambda: Outcome(oracle(self.subject, self.placement, self.rows, level))

    def precision(self) -> Setting:
        """The sum over the GPU's planes, at all points."""
        done = self.done

        def make(precision: Any) -> Any:
            parts = [(done.placement.rows_of(t.i_object), t, gpu_planes(done, t, precision)) for t in done.transports]

            def compute() -> Outcome:
                total = np.zeros((len(done.placement.hits.pixel), 3))
                for own, transport, planes in parts:
                    curve = forward(layer_coefficients(transport)[0]).astype(np.float32)
                    picture = np.einsum("jc,jpc->pc", curve, planes)
                    total[own] += picture * seen_scale(done.placement, own, transport.layer)
                return Outcome(total[self.rows], largest_on_gpu(done, precision) / MIB)

            return compute

        return self.setting("precision", PRECISIONS, make, "half", "summing all coefficients once, on the CPU")


def _stage_settings(direct: DirectPictures, effort: PlacementValues) -> Iterator[Setting]:
    cost = "transport, its shadows known"
    if direct.has_sky:  # lamps are no lights of the sphere, nor seen by its directions
        n_lights = FINAL.n_lights
        yield direct.setting(
            "lights", effort.lights, lambda n: direct.stage(replace(FINAL, n_lights=n)), n_lights, cost
        )
        alone = "every direction of the judged points"
        yield direct.setting("sphere level", effort.levels, direct.by_level, VISIBILITY_LEVEL, alone)
    yield direct.setting("bands", effort.bands, lambda n: direct.stage(FINAL, n), direct.subject.most_bands, cost)
    if direct.placement.patches(1) is not None:
        yield direct.setting(
            "patches of lamps",
            effort.patches,
            lambda n: direct.stage(replace(FINAL, n_patches=n)),
            FINAL.n_patches,
            cost,
        )


def _edge_rays(direct: DirectPictures, effort: PlacementValues) -> Setting:
    """All pixels, against a picture with four times as many points each way."""
    project = _project(direct.subject)
    width, height = direct.subject.scene.resolution
    larger = replace(project, scene=replace(project.scene, resolution=(FINER * width, FINER * height)))
    truth = box_averaged(direct_picture(larger, 0), FINER).reshape(-1, 3)
    return Setting(
        "placement", "rays through pixels at edges", effort.edge_rays,
        lambda n: lambda: Outcome(direct_picture(project, n).reshape(-1, 3)), truth, plan_still(project).n_edge_rays,
        "a still of direct light",
    )  # fmt: skip


def _project(subject: Subject) -> Project:
    return replace(open_project(subject.source), scene=subject.scene)


class DraggedCurve:
    """A drag bends one layer's curve in some frames, each of which may change K coefficients [BenArtzi07, 7.1]."""

    def __init__(self, direct: DirectPictures, effort: PlacementValues) -> None:
        self._effort, self._rows, done = effort, direct.rows, direct.done
        # Of the curves with the most bands the one whose layer has the most points.
        sizes = [(next(iter(t.bands.values())), t.store.n_points) for t in done.transports]
        index = sizes.index(max(sizes))
        transport = done.transports[index]
        self._own = done.placement.rows_of(transport.i_object)
        self._scale = seen_scale(done.placement, self._own, transport.layer)
        self._planes = gpu_planes(done, transport, "half")
        self._curves = [_dragged(transport, i / N_FRAMES) for i in range(N_FRAMES + 1)]
        self._others = reflected(done)
        self._others[self._own] -= self._whole(self._curves[0]) * self._scale
        layers: list[Layer] = [layer for _, layer in direct.subject.layers]
        layers[index] = transport.layer.with_operators(next(iter(transport.bands)), _part_of_edit(1.0))
        self._truth = oracle(direct.subject, done.placement, self._rows, effort.level, layers)

    def setting(self, name: str, strategy: Strategy, by_effect: bool, present: int | None = None) -> Setting:
        """K a frame, chosen by a strategy; by_effect: a coefficient counts by what it changes in the picture."""
        counts = [k for k in self._effort.wavelets if k <= len(self._curves[0])]
        return Setting(
            "placement", name, counts, lambda k: self._frame(k, strategy, by_effect), self._truth, present,
            "the sum of a frame's coefficients over the picture, on the CPU",
        )  # fmt: skip

    def _frame(self, k: int, strategy: Strategy, by_effect: bool) -> Any:
        """What adds the last frame's coefficients to what those before it have shown."""
        weight = np.ones(len(self._planes))
        if by_effect:
            weight = np.sqrt(np.mean(self._planes.astype(np.float64) ** 2, axis=(1, 2)))
        # Of each Daubechies coefficient: level 0 for the mean and the coarsest detail, then one for each doubling.
        levels = np.floor(np.log2(np.maximum(np.arange(len(weight)), 1))).astype(np.intp)
        frames = frame_coefficients(weight, levels, self._curves, k, strategy)
        before = np.zeros_like(frames[-1]) if strategy == "anew" else frames[-2]
        shown, change = self._whole(before), frames[-1] - before
        changed = np.flatnonzero(change.any(axis=1))

        def compute() -> Outcome:
            picture = self._others.copy()
            picture[self._own] += (shown + self._sum(change, changed)) * self._scale
            return Outcome(picture[self._rows], len(changed) * self._planes[0].size * BYTES["half"] / MIB)

        return compute

    def _whole(self, curve: FloatingArray) -> FloatingArray:
        return self._sum(curve, np.arange(len(curve)))

    def _sum(self, curve: FloatingArray, which: NDArray[np.integer]) -> FloatingArray:
        return np.asarray(np.einsum("kc,kpc->pc", curve[which].astype(np.float32), self._planes[which]))


def _part_of_edit(share: float) -> tuple[Operator, ...]:
    """The edit, so much of its way done."""
    return tuple(
        replace(each, magnitude=(1.0 - share) * (each.kind == "amplify") + share * each.magnitude) for each in EDIT
    )


def _dragged(transport: ComputedLayer, share: float) -> NDArray[np.float64]:
    layer = (
        transport.layer.with_operators(next(iter(transport.bands)), _part_of_edit(share)) if share else transport.layer
    )
    return np.asarray(forward(layer_coefficients(transport, layer)[0]))


class _IndirectPictures:
    """Pictures of indirect light at points inside of the picture, against paths."""

    def __init__(self, direct: DirectPictures, effort: PlacementValues) -> None:
        project = _project(direct.subject)
        self._effort, self._placement, self._sky = effort, direct.placement, project.sky
        self._rows = random_rows(self._placement, effort.n_indirect, seed=5)
        layers, n_paths = layers_by_object(project), effort.n_paths
        paths = trace_halves(self._placement, layers, project.sky, N_BOUNCES, n_paths, SEED, self._rows)
        self._truth = run_to_end(paths)[:, :, 1].mean(axis=0)
        self._direct = oracle(direct.subject, self._placement, self._rows, effort.level)
        self._layers: tuple[StillLayer, ...] = with_maps(
            self._placement, still_layers(project.layers.items(), project.object_names, plan_still(project))
        )

    def settings(self) -> Iterator[Setting]:
        fine = self._effort.fine
        yield self._setting(
            "series", self._effort.series, lambda text: self._shown(text, fine), WHOLE_SERIES,
            f"indirect light, {fine.name}",
        )  # fmt: skip
        yield self._setting(
            "gather rays", self._effort.rays,
            lambda n: self._shown(WHOLE_SERIES, replace(fine, n_rays=n, n_glossy_hits=min(fine.n_glossy_hits, n))),
            fine.n_rays,
            f"indirect light, {fine.name}",
        )  # fmt: skip
        yield self._setting(
            "fineness", self._effort.fineness, lambda name: self._shown(WHOLE_SERIES, FINENESSES[name]), FINE.name,
            "indirect light",
        )  # fmt: skip

    def _setting(self, name: str, values: Sequence[Any], make: Any, present: Any, cost: str) -> Setting:
        return Setting("placement", name, values, make, self._truth, present, cost)

    def _shown(self, text: str, fineness: SamplingSettings) -> Any:
        series = SERIES.get(text) or parse_series(text)

        def compute() -> Outcome:
            if series.n_bounces == 1:
                return Outcome(self._direct)
            layers = first_bounce_layers(self._layers, series)
            found = run_to_end(indirect_radiance(self._placement, layers, self._sky, series, fineness))
            return Outcome(self._direct + found[self._rows])

        return compute
