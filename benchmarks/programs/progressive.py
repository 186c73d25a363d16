"""A progressive path tracer behind a script of edits: the loop that the programs of the peers share.

Run by the peers' interpreters, with NumPy and pyoidn alone. A job is a JSON file:

    scene: as the scene's TOML, meshes and environment by their full paths; resolution [width, height]; bounces;
    edits: [{object, layer, parameter, value, horizon_s}, ...], seed; truths: [[{object, layer, parameter, value}, ...],
    ...]: states as changes to the scene; truth_samples: of each of a truth's two halves

and the answer an .npz: pictures (n, H, W, 3) denoised, with edit (n,), samples (n,), seconds (n,) and cpu_seconds (n,)
since the edit; raw (e, H, W, 3): the last picture of each edit before it is denoised, and raw_cpu_seconds (e,): what it
took without the denoiser; opened (H, W, 3): the picture before the first edit; truths (t, 2, H, W, 3); made_with.

After an edit samples double: 1, 2, 4, 8 and so on, all of them kept; each picture is denoised with the albedo and the
normals of the same samples as guides, and counts from when it is there. No pass begins that would end after an edit's
horizon on both clocks.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

# Samples of each pass: a picture has as many as all passes so far, which doubles. Stratified samplers like squares.
PASSES = (1, 1, 2, 4, 8, 16, 36, 64, 144, 256, 576, 1024)
N_OPENING = 8
LONGER = 1.6
TRUTH_PASS = 256

Images = NDArray[np.float32]


class Tracer(Protocol):
    """A path tracer with a scene."""

    made_with: str

    def change(self, edit: dict[str, Any]) -> None:
        """Give one parameter of a layer another value."""

    def render(self, samples: int, seed: int, done: int) -> Images:
        """The mean of so many more samples: radiance, albedo and normals (H, W, 9). done: samples with this seed so
        far."""


def denoised(mean: Images) -> Images:
    """Radiance (H, W, 3) by Intel Open Image Denoise at its highest quality, guided by albedo and normals."""
    import pyoidn

    colour, albedo, normal = (np.ascontiguousarray(mean[..., 3 * i : 3 * i + 3]) for i in range(3))
    return np.array(pyoidn.denoise(colour, albedo=np.clip(albedo, 0.0, 1.0), normal=normal, hdr=True))


def follow(tracer: Tracer, edits: list[dict[str, Any]], seed: int) -> dict[str, Any]:
    """The pictures after each edit, see above."""
    found: dict[str, list[Any]] = {name: [] for name in ("edit", "samples", "seconds", "cpu_seconds", "pictures")}
    raw: list[tuple[Images, float]] = []
    for index, edit in enumerate(edits):
        started, used = time.perf_counter(), time.process_time()
        tracer.change(edit)
        last = np.zeros((0, 0, 3), np.float32), 0.0
        for n_samples, mean, spent in refine(tracer, seed + 1000 * (index + 1), PASSES):
            last, picture = (mean[..., :3], spent), denoised(mean)
            times = time.perf_counter() - started, time.process_time() - used
            for name, value in zip(found, (index, n_samples, *times, picture), strict=True):
                found[name].append(value)
            # The next pass doubles what was spent. One that would end past the horizon is not begun.
            if min(times) * LONGER > edit["horizon_s"]:
                break
        raw.append(last)
    answer = {name: np.array(values) for name, values in found.items()}
    return answer | {"raw": np.array([image for image, _ in raw]), "raw_cpu_seconds": np.array([s for _, s in raw])}


def refine(tracer: Tracer, seed: int, passes: tuple[int, ...]) -> Iterator[tuple[int, Images, float]]:
    """After each pass: samples so far, their mean (H, W, 9), processor seconds spent on them."""
    total, n_samples, spent = np.zeros(1), 0, 0.0
    for samples in passes:
        used = time.process_time()
        total = total + samples * tracer.render(samples, seed, n_samples).astype(np.float64)
        n_samples += samples
        spent += time.process_time() - used
        yield n_samples, (total / n_samples).astype(np.float32), spent


def truths(tracer: Tracer, states: list[list[dict[str, Any]]], samples: int, seed: int) -> Images:
    """Two independent halves of a long picture of each state (t, 2, H, W, 3)."""
    found = []
    for index, state in enumerate(states):
        for edit in state:
            tracer.change(edit)
        halves = []
        for half in range(2):
            begin = seed + 1_000_000 + 1000 * (2 * index + half)
            passes = [tracer.render(TRUTH_PASS, begin + i, 0)[..., :3] for i in range(-(-samples // TRUTH_PASS))]
            halves.append(np.mean(passes, axis=0, dtype=np.float64).astype(np.float32))
        found.append(halves)
    return np.array(found, np.float32)


def run(open_scene: Callable[[dict[str, Any]], Tracer]) -> None:
    """The program: JOB.json OUT.npz. What is compiled or built on first use is so before the first edit."""
    job = json.loads(Path(sys.argv[1]).read_text())
    tracer = open_scene(job)
    found: dict[str, Any] = {}
    if job["edits"]:
        opened = [denoised(mean) for _, mean, _ in refine(tracer, job["seed"], PASSES[:N_OPENING])][-1]
        found = {"opened": opened, **follow(tracer, job["edits"], job["seed"])}
    if job["truths"]:
        found["truths"] = truths(tracer, job["truths"], job["truth_samples"], job["seed"])
    np.savez(sys.argv[2], made_with=np.array(tracer.made_with), **found)
