"""Runs every program on a scene's script, keeps the pictures, and reads what they say.

Of each edit the first and the last picture are kept as OpenEXR, and of the peers the last one without denoiser;
PROGRAM.npz has all others, truths.npz the long pictures.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.figures import NotMeasured
from benchmarks.launches import run_program
from benchmarks.peer import VARIABLE, inner_pixels
from benchmarks.peers.scenes import Case, described, write_scene
from benchmarks.peers.timelines import Watched, difference_of_halves, differences_again, watched
from engine.precompute.direct.pipeline import Placement
from engine.render.display import exr_bytes

LONGEST_SECONDS = 7200.0
TRUTH_SAMPLES = 256
# Where a drag ends: there the peers' long pictures are compared, which shows what differs in their models.
COMPARED_STATE = 5
SEED = 1
MITSUBA, CYCLES = "Mitsuba + OIDN", "Cycles + OIDN"
# Name, the variable that names its interpreter, its program.
PEERS = (
    (MITSUBA, VARIABLE, "mitsuba_edits"),
    (CYCLES, "INSITU_CYCLES_PYTHON", "cycles_edits"),
)


@dataclass(frozen=True)
class Program:
    """What one program did with a script. again: see `differences_again`; model_error: relRMSE between its own long
    picture and the truth. opening: seconds and processor seconds until its first picture was finished, and selecting:
    processor seconds of selecting objects, one by one; of ours alone."""

    made_with: str
    edits: list[Watched]
    again: list[float]
    model_error: float = 0.0
    opening: tuple[float, float] | None = None
    selecting: tuple[float, ...] = ()


@dataclass(frozen=True)
class Found:
    """A scene: ours, and each peer by its name, or why it was not measured."""

    case: Case
    n_bounces: int
    ours: Program
    peers: Mapping[str, Program | str]


def measure_case(case: Case, folder: Path) -> Found:
    """Measure what is not in the folder yet. Raises NotMeasured where there is no Mitsuba, which makes the truths."""
    source = write_scene(case, folder / "scene")
    scene, project = described(source, case.resolution)
    mask = inner_pixels(Placement(project.scene).hits)
    states = [
        [change(parameter, value) for parameter, value in zip(case.script.parameters, state, strict=True)]
        for state in case.script.states
    ]
    edits = [
        {**change(edit.parameter, edit.value), "kind": edit.kind, "horizon_s": edit.horizon_s}
        for edit in case.script.edits
    ]
    job = {"scene": scene, "source": str(source), "resolution": case.resolution, "bounces": scene["bounces"]}
    job |= {"seed": SEED, "edits": [], "truths": states, "truth_samples": TRUTH_SAMPLES}
    truths = run_once(folder, "truths", peer_command(*PEERS[0][1:]), job)["truths"]
    job |= {"edits": edits, "truths": []}
    ours = run_once(folder, "insitu", [sys.executable, "-m", "benchmarks.programs.window_edits"], job)
    long = {**job, "edits": [], "truths": [states[COMPARED_STATE]]}
    peers: dict[str, Program | str] = {}
    for name, variable, program in PEERS:
        stem = program.removesuffix("_edits")
        try:
            command = peer_command(variable, program)
            peer = read(case, run_once(folder, stem, command, job), truths, mask)
            if name != MITSUBA:
                theirs = run_once(folder, f"{stem}_long", command, long)["truths"][0]
                apart = difference_of_halves(theirs[:, mask], truths[COMPARED_STATE][:, mask])
                peer = replace(peer, model_error=apart)
            peers[name] = peer
        except NotMeasured as error:
            peers[name] = str(error)
    return Found(case, int(scene["bounces"]), read(case, ours, truths, mask), peers)


def change(parameter: Any, value: Any) -> dict[str, Any]:
    """A parameter's new value, as jobs have it."""
    return {"object": parameter.object, "layer": parameter.layer, "parameter": parameter.name, "value": value}


def peer_command(variable: str, program: str) -> list[str]:
    """Raises NotMeasured where the variable names no interpreter."""
    python = os.environ.get(variable, "")
    if not python:
        raise NotMeasured(f"{variable} names no interpreter that has {program.removesuffix('_edits').capitalize()}")
    return [python, "-m", f"benchmarks.programs.{program}"]


def run_once(folder: Path, name: str, command: list[str], job: Mapping[str, Any]) -> dict[str, Any]:
    """The answer of a program, from the folder where it is there; pictures are kept beside it."""
    output = folder / f"{name}.npz"
    if not output.is_file():
        file, unfinished = folder / f"{name}.json", folder / f"{name}_unfinished.npz"
        file.write_text(json.dumps(job))
        run_program([*command, str(file), str(unfinished)], folder / "run", LONGEST_SECONDS)
        unfinished.rename(output)
        with np.load(output) as found:
            keep_pictures(folder / f"{name}_pictures", job, found)
    with np.load(output) as found:
        return dict(found)


def keep_pictures(folder: Path, job: Mapping[str, Any], found: Mapping[str, Any]) -> None:
    """See above; `07_jump_first.exr`."""
    folder.mkdir(exist_ok=True)
    pictures: dict[str, NDArray[np.float32]] = {}
    for state, halves in enumerate(found["truths"] if "truths" in found else ()):
        pictures[f"state_{state}"] = halves.mean(axis=0)
    for index, edit in enumerate(job["edits"]):
        rows = np.flatnonzero(found["edit"] == index)
        name = f"{index:02d}_{edit['kind']}"
        if not len(rows):
            continue
        pictures |= {f"{name}_first": found["pictures"][rows[0]], f"{name}_last": found["pictures"][rows[-1]]}
        if "raw" in found:
            pictures[f"{name}_last_raw"] = found["raw"][index]
    for name, picture in pictures.items():
        (folder / f"{name}.exr").write_bytes(exr_bytes(picture))


def read(case: Case, found: Mapping[str, Any], truths: NDArray[np.float32], mask: NDArray[np.bool_]) -> Program:
    """What an answer says."""
    edits = case.script.edits
    opening = None
    if "opening" in found:
        opening = float(found["opening"][0]), float(found["opening"][1])
    return Program(
        str(found["made_with"]),
        watched(edits, found, truths, mask),
        differences_again(edits, found, mask),
        opening=opening,
        selecting=tuple(seconds for seconds in np.ravel(found.get("selecting", ())).tolist() if seconds > 0.0),
    )
