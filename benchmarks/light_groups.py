"""A mix of lights beside LuxCore's light groups: `python -m benchmarks.light_groups FOLDER`.

Two balls under a sky and seven lamps (`light_mix`) in direct light, and then each light alone ten times as strong.
The time of a change is that from the request to a finished frame: here the worker's answer, carried out in this
process, upload, shading and view; in LuxCore the film's radiance scales and the picture developed from it. The error is
relRMSE against what either program makes of that very light: the final transport here; in LuxCore two longer pictures
of other seeds, cleared of their own noise, where no lamp and no silhouette is near. LuxCore renders for as long as the
lights here take to be ready, opening included. Materials are alike, not the same: LuxCore's metal has another
distribution.

FOLDER gets light_groups.csv. LuxCore is used where `INSITU_LUXCORE_PYTHON` names an interpreter that has pyluxcore.
"""

from __future__ import annotations

import csv
import io
import os
import statistics
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import astuple, dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.modes.placement.placement_messages import PrepareRelighting
from app.project.project import Project, open_project
from app.system.atomic import save_file
from app.system.kernel_cache import use_kernel_cache
from benchmarks.figures import NotMeasured
from benchmarks.launches import run_program
from benchmarks.light_mix import N_LAMPS, TIMES_TEN, mixed_scene, scene_text
from benchmarks.peer import cleared_error, inner_pixels
from benchmarks.relighting import ReadyScene, RelightEffort
from engine.precompute.direct.pipeline import FINAL, Placement
from engine.render.picture_difference import errors
from engine.scene.picture_frame import picture_frame

VARIABLE = "INSITU_LUXCORE_PYTHON"
PROGRAM = Path(__file__).with_name("programs") / "luxcore_groups.py"
CSV = "light_groups.csv"
LIGHTS = ("sky", *(f"lamp {i}" for i in range(N_LAMPS)))
RESOLUTION = (192, 144)
TRUTH_FACTOR = 2.0  # of the seconds of LuxCore's pictures
TIMEOUT_S = 1800.0


@dataclass(frozen=True)
class Row:
    """What a program takes until lights can be mixed (s) and for the change of one (ms), and its error (relRMSE)."""

    program: str
    light: str
    ready_s: float
    change_ms: float
    error: float


def measure_ours(folder: Path, resolution: tuple[int, int] = RESOLUTION, n_final: int = FINAL.n_lights) -> list[Row]:
    """A row a light. Raises NotMeasured where there is no OpenGL."""
    from ui.gl.context import GraphicsError, create_headless_context
    from ui.gl.display import DisplayView
    from ui.modes.placement.gl.renderer import PlacementRenderer

    try:
        context = create_headless_context()
    except GraphicsError as error:
        raise NotMeasured(str(error)) from None
    source = _source(folder)
    scene = open_project(source, resolution).scene
    renderer = PlacementRenderer(context)
    renderer.set_frame(picture_frame(Placement(scene).hits, scene.camera_position))
    begun = time.perf_counter()
    ready = ReadyScene(source, RelightEffort(resolution, n_final=n_final), folder / "cache")
    ready.ask(PrepareRelighting(ready.scene))
    ready_s = time.perf_counter() - begun
    pictures, times = {}, {}
    for light in ("", *LIGHTS):  # first none, which compiles shaders
        changed = mixed_scene(ready.scene, light, 1.0, TIMES_TEN)
        begun = time.perf_counter()
        pictures[light] = ready.pictures(ready.transport(changed), "relit")
        for work in ready.scene.layers:
            if work.key not in renderer.layer_keys:
                renderer.set_layer(work.key, scene.object_index(work.object), len(pictures[light][work.key]))
            renderer.set_layer_radiance(work.key, pictures[light][work.key])
        renderer.composite(DisplayView())
        context.finish()
        times[light] = 1e3 * (time.perf_counter() - begun)
    renderer.release()
    context.release()
    rows = []
    for light in LIGHTS:
        truth = ready.pictures(ready.transport(mixed_scene(ready.scene, light, 1.0, TIMES_TEN), n_final), "final")
        both = (np.concatenate([each[key] for key in truth]) for each in (pictures[light], truth))
        rows.append(Row("Insitu", light, ready_s, times[light], errors(*both).rmse))
    return rows


def measure_luxcore(
    folder: Path, seconds: float, resolution: tuple[int, int] = RESOLUTION, truth_seconds: float | None = None
) -> list[Row]:
    """The same of LuxCore after so many seconds. Raises NotMeasured where it is not installed."""
    python = os.environ.get(VARIABLE, "")
    if not python:
        raise NotMeasured(f"{VARIABLE} names no interpreter that has pyluxcore")
    described, output = folder / "groups.npz", folder / "luxcore.npz"
    project = open_project(_source(folder), resolution)
    arrays: dict[str, Any] = scene_arrays(project)
    np.savez(described, **arrays)
    mask = inner_pixels(Placement(project.scene).hits)
    numbers = seconds, truth_seconds or TRUTH_FACTOR * seconds, TIMES_TEN
    run_program([python, str(PROGRAM), str(described), str(output), *map(str, numbers)], folder, TIMEOUT_S)
    with np.load(output) as found:
        pictures, truths, times, program = (found[name] for name in ("pictures", "truths", "seconds", "made_with"))
    return [
        Row(str(program), light, seconds, 1e3 * float(took), cleared_error(picture[mask], *halves[:, mask]))
        for light, picture, halves, took in zip(LIGHTS, pictures, truths, times.mean(axis=1), strict=True)
    ]


def scene_arrays(project: Project) -> dict[str, NDArray[np.generic]]:
    """A scene as `programs/luxcore_groups.py` reads it: lambert and rough conductors under a constant sky."""
    scene, camera = project.scene, project.scene.description.camera
    environment = scene.description.environment
    assert environment is not None
    arrays: dict[str, NDArray[np.generic]] = {
        "size": np.array(scene.resolution), "fov_y": np.array(camera.fov_y), "sky": np.array(environment.radiance),
        "camera": np.array([camera.position, camera.target, camera.up]),
    }  # fmt: skip
    layers = {key.rsplit(".", 1)[0]: layer for key, layer in project.picture_document.layers()}
    for i, name in enumerate(scene.object_names):
        (first, last), (begin, end) = scene.vertex_ranges[i], scene.triangle_ranges[i]
        arrays[f"vertices_{i}"] = scene.vertices[first:last] + scene.origin
        arrays[f"triangles_{i}"] = scene.triangles[begin:end] - first
        if scene.smooth[i]:
            arrays[f"normals_{i}"] = scene.normals[first:last]
        arrays[f"emission_{i}"] = scene.emission[i]
        numbers: dict[str, Any] = dict(layers[name].parameters) if name in layers else {"albedo": 0.0}
        arrays[f"alpha_{i}"] = np.array(numbers.get("alpha", 0.0))
        # Of a metal what it reflects straight on, by Fresnel: ((η − 1)² + k²) / ((η + 1)² + k²).
        eta, k = (np.array(numbers.get(each, 0.0)) for each in ("eta", "k"))
        fresnel = ((eta - 1.0) ** 2 + k**2) / ((eta + 1.0) ** 2 + k**2)
        arrays[f"albedo_{i}"] = np.broadcast_to(numbers["albedo"] if "albedo" in numbers else fresnel, 3)
    return arrays


def _source(folder: Path) -> str:
    source = folder / "scene.toml"
    source.write_text(scene_text())
    return str(source)


def write_rows(file: Path, rows: Sequence[Row]) -> None:
    """The table, as CSV."""
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow([field.name for field in fields(Row)])
    table.writerows(astuple(row) for row in rows)
    save_file(file, text.getvalue().encode())


def main(folder: Path) -> None:
    """Measure, write the table and print its medians."""
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="insitu-groups-") as scratch:
        rows = measure_ours(Path(scratch))
        try:
            rows += measure_luxcore(Path(scratch), rows[0].ready_s)
        except NotMeasured as reason:
            print(f"no LuxCore: {reason}")
    write_rows(folder / CSV, rows)
    for program in dict.fromkeys(row.program for row in rows):
        own = [row for row in rows if row.program == program]
        change, error = (statistics.median(getattr(row, name) for row in own) for name in ("change_ms", "error"))
        print(f"{program}: ready in {own[0].ready_s:.1f} s, a change {change:.1f} ms, error {error:.2%}, ", end="")
        print(f"worst {max(row.error for row in own):.2%}")


if __name__ == "__main__":
    use_kernel_cache()
    main(Path(sys.argv[1]))
