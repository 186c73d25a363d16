"""The error of indirect light after an edit, over time: `python -m benchmarks.programs.edited_sampling SCENE OUT.json`.

A curve is lifted in light that was found before, or the sky turns and light is found anew. Then rays are added where
the present materials are noisy, as the window does at rest. After each round: processor seconds since, and the error of
the indirect light against that of many more rays, whose own noise is a part of it; the first line is what there is
without adding any.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from app.project.project import Project, open_project
from app.stills.stills import plan_still
from benchmarks.programs.command_line import Figures, command_line, resolution_of, write_found
from engine.core.generators import run_to_end
from engine.curve.operators import Operator
from engine.material.layer import Layer
from engine.precompute.direct.pipeline import Placement, SkyState
from engine.precompute.indirect.edited_sampling import EditedSampling
from engine.precompute.indirect.indirect_layers import IndirectLayer
from engine.precompute.indirect.indirect_light import IndirectLight
from engine.precompute.indirect.photons import PhotonMap, no_nearby_photons
from engine.precompute.indirect.sampling_settings import FINE
from engine.precompute.indirect.solver import Solver
from engine.render.still import by_object, direct_mean, indirect_layers, models_of, still_layers

N_BOUNCES = 4
# As the window's, with rays and photons enough: what is left out is what the window leaves out as well. The photons are
# averaged over the discs of the window's.
PHOTONS = 8
JUDGE = replace(FINE, n_rays=2048, n_glossy_hits=2048, gloss_noise=0.3, n_photons=PHOTONS * FINE.n_photons)
SHOULDER = 0.0, 0.05, 0.35, 0.6
TURN = 60.0


@dataclass(frozen=True)
class LitView:
    """A view of a project's scene and how it is solved for."""

    project: Project
    placement: Placement

    def light(self, layers: dict[str, Layer], sky: SkyState, judge: bool = False) -> IndirectLight:
        """Indirect light, found with these layers under a sky."""
        own = still_layers(layers.items(), self.project.object_names, plan_still(self.project))
        other = None if judge else run_to_end(direct_mean(self.placement, by_object(own), sky))
        settings = JUDGE if judge else FINE
        solver = Solver(self.placement, models_of(own), sky, N_BOUNCES, settings, other_light=other)
        light = run_to_end(solver.solve(indirect_layers(own, None)))
        return self._with_even_photons(light) if judge else light

    def _with_even_photons(self, light: IndirectLight) -> IndirectLight:
        points, scene, caster = light.points, self.placement.scene, self.placement.caster
        bare = replace(points, landed=no_nearby_photons(len(points.samples.rows)))
        return replace(light, points=bare.with_photons(PhotonMap(points.photons, PHOTONS), scene, caster))

    def reflecting(self, layers: dict[str, Layer]) -> list[IndirectLayer]:
        """These layers as indirect light uses them."""
        return indirect_layers(
            still_layers(layers.items(), self.project.object_names, plan_still(self.project)), None
        )  # fmt: skip


def errors_of(picture: NDArray[np.floating], truth: NDArray[np.floating]) -> dict[str, float]:
    """RMS error relative to the mean of all pixels, of all but the brightest hundredth, and of the mean."""
    squares, mean = ((picture - truth) ** 2).mean(axis=1), float(truth.mean())
    dark = truth.sum(axis=1) <= np.percentile(truth.sum(axis=1), 99.0)
    return {
        "error": float(np.sqrt(squares.mean())) / mean,
        "error_99": float(np.sqrt(squares[dark].mean())) / mean,
        "mean": float(picture.mean()) / mean - 1.0,
    }


def rounds(view: LitView, light: IndirectLight, layers: dict[str, Layer], truth: IndirectLight) -> Iterator[Figures]:
    """The figures before and after each round."""
    reflecting, spent = view.reflecting(layers), 0.0
    judge, judge_noise = truth.picture(reflecting), run_to_end(truth.noise(reflecting))[0]

    def figures(light: IndirectLight, seconds: float, n_noisy: int) -> Figures:
        samples = light.points.samples
        return {
            "seconds": seconds, **errors_of(light.picture(reflecting), judge),
            "noise": run_to_end(light.noise(reflecting))[0], "n_sets": len(samples.rows) / len(samples.points),
            "noisy": n_noisy / len(samples.points), "mb": light.n_bytes / 1e6,
            "judge_noise": judge_noise,
        }  # fmt: skip

    yield figures(light, 0.0, 0)
    begun = time.process_time()
    for step in EditedSampling(view.placement, reflecting, FINE).improved(light):
        if step.light is not None:
            spent += time.process_time() - begun
            yield figures(step.light, spent, step.n_noisy)
            begun = time.process_time()


def measure(source: str, resolution: tuple[int, int] | None, key: str, curve: str, times: float) -> Figures:
    """The figures of each edit, "lifted" and "turned"."""
    project = open_project(source).with_settings(n_edge_rays=0)
    if resolution is not None:
        project = replace(project, scene=project.scene.from_camera(None, resolution))
    view, layers = LitView(project, Placement(project.scene)), dict(project.layers)
    lift = Operator("amplify", "y", *SHOULDER, times)
    lifted = layers | {key: layers[key].with_operators(curve, (lift,))}
    turned = replace(project.sky, rotation=project.sky.rotation + TURN)
    found: Figures = {}
    for name, sky, with_layers, before in (
        ("lifted", project.sky, lifted, layers), ("turned", turned, layers, layers),
    ):  # fmt: skip
        light, truth = view.light(before, sky), view.light(with_layers, sky, judge=True)
        found[name] = []
        for each in rounds(view, light, with_layers, truth):
            found[name].append(each)
            print(f"{source} {name}: " + ", ".join(f"{what} {value:.4g}" for what, value in each.items()), flush=True)
    return found


def main(arguments: list[str] | None = None) -> int:
    """The command line; its exit status."""
    parser = command_line("edited_sampling", __doc__, "source")
    parser.add_argument("--resolution", nargs=2, type=int)
    parser.add_argument("--layer", required=True)
    parser.add_argument("--curve", default="theta_h")
    parser.add_argument("--times", type=float, default=5.0)
    given = parser.parse_args(arguments)
    return write_found(
        given.output, lambda: measure(given.source, resolution_of(given), given.layer, given.curve, given.times)
    )


if __name__ == "__main__":
    sys.exit(main())
