"""How long a file takes to its first shaded picture, and how much memory it holds:
`python -m benchmarks.open_files [TRIANGLES ...]`.

Landscapes of so many triangles as PLY, OBJ and GLB are opened in an editor without a window, whose worker is a process
of its own and has its kernels loaded: until its objects are lit from the camera, and until the first layer has its
light and shadows. Then a curve is edited, and the session is saved. Times are seconds by the clock, for which nothing
else may run, and of processor time (`_cpu_s`), all cores together; memory is the sum of both processes' proportional
shares, sampled ten times a second.
"""

from __future__ import annotations

import json
import os
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import psutil

from benchmarks.large_scenes import height_of, write_landscape

SIZES = (100_000, 1_000_000)
SIDE = 20.0
SAMPLE_SECONDS = 0.1
MOST_SECONDS = 300.0
# All sums are there; without a window nothing reports that they are drawn.
COMPLETE = ("refining", "finished", "exact")


def write_obj(path: Path, n_triangles: int) -> None:
    """The landscape as text."""
    places, faces = _landscape(n_triangles)
    with open(path, "w", encoding="ascii") as file:
        np.savetxt(file, places, "v %.5f %.5f %.5f")
        np.savetxt(file, faces + 1, "f %d %d %d")


def write_glb(path: Path, n_triangles: int, n_materials: int = 8) -> None:
    """The landscape in strips of several materials, as programs for modelling export it."""
    places, faces = _landscape(n_triangles)
    binary = places.astype("<f4").tobytes() + faces.astype("<u4").tobytes()
    bounds = np.linspace(0, len(faces), n_materials + 1).astype(int)
    accessors = [{
        "bufferView": 0, "componentType": 5126, "count": len(places), "type": "VEC3",
        "min": places.min(axis=0).tolist(), "max": places.max(axis=0).tolist(),
    }]  # fmt: skip
    for start, stop in zip(bounds, bounds[1:], strict=False):
        accessors.append({
            "bufferView": 1, "byteOffset": int(start) * 12, "componentType": 5125, "count": int(stop - start) * 3,
            "type": "SCALAR",
        })  # fmt: skip
    primitives = [{"attributes": {"POSITION": 0}, "indices": k + 1, "material": k} for k in range(n_materials)]
    tree = {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": primitives}], "accessors": accessors, "buffers": [{"byteLength": len(binary)}],
        "bufferViews": [
            {"buffer": 0, "byteLength": places.size * 4},
            {"buffer": 0, "byteOffset": places.size * 4, "byteLength": faces.size * 4},
        ],
        "materials": [
            {"name": f"earth {k}", "pbrMetallicRoughness": {"baseColorFactor": [red, 0.4, 0.3, 1.0]}}
            for k, red in enumerate(np.linspace(0.2, 0.8, n_materials).tolist())
        ],
    }  # fmt: skip
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    head = b"glTF" + np.array([2, 12 + 8 + len(text) + 8 + len(binary), len(text)], "<u4").tobytes() + b"JSON"
    path.write_bytes(head + text + np.array([len(binary)], "<u4").tobytes() + b"BIN\0" + binary)


def _landscape(n_triangles: int) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (V, 3) and triangles (T, 3)."""
    n = int(round((n_triangles / 2) ** 0.5)) + 1
    place = np.linspace(-SIDE / 2, SIDE / 2, n)
    x, z = np.meshgrid(place, place)
    first = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
    lower = np.stack([first, first + n, first + 1], axis=1)
    upper = np.stack([first + 1, first + n, first + n + 1], axis=1)
    places = np.stack([x, height_of(n), z], axis=-1).reshape(-1, 3)
    return places, np.stack([lower, upper], axis=1).reshape(-1, 3)


WRITERS: dict[str, Callable[[Path, int], object]] = {".ply": write_landscape, ".obj": write_obj, ".glb": write_glb}


@contextmanager
def peak_memory() -> Iterator[dict[str, float]]:
    """The most memory, MiB, of this process and its children within the block: "peak_mib" once it has ended."""
    found, ended = {"peak_mib": 0.0}, threading.Event()

    def sample() -> None:
        me = psutil.Process(os.getpid())
        while not ended.wait(SAMPLE_SECONDS):
            total = 0
            for process in (me, *me.children(recursive=True)):
                try:
                    info = process.memory_full_info()
                except psutil.Error:
                    continue
                total += getattr(info, "pss", info.rss)
            found["peak_mib"] = max(found["peak_mib"], total / 2**20)

    thread = threading.Thread(target=sample, daemon=True)
    thread.start()
    try:
        yield found
    finally:
        ended.set()
        thread.join()


def processor_seconds() -> float:
    """Processor time of this process and its children until now."""
    me = psutil.Process(os.getpid())
    times = [process.cpu_times() for process in (me, *me.children(recursive=True))]
    return sum(each.user + each.system for each in times)


def measure(file: Path) -> dict[str, float]:
    """Open a file, edit a curve of it, save the session."""
    from app.document.commands.curves import AddOperator
    from app.editor.editor import Editor
    from app.modes.placement.placement_events import LayerRadiance
    from app.worker.client import Client
    from engine.curve.operators import Operator

    editor = Editor(Client(), "shapes")
    events: list[object] = []

    def until(done: Callable[[], bool]) -> float:
        started = time.monotonic()
        while not done():
            events[:] = editor.tick()
            if time.monotonic() - started > MOST_SECONDS:
                raise RuntimeError(f"{file}: {editor.status}")
            time.sleep(0.002)
        return time.monotonic() - started

    until(lambda: editor.status.picture in COMPLETE)
    try:
        with peak_memory() as memory:
            before = processor_seconds()
            editor.open(str(file))
            opened = until(lambda: editor.document.source == str(file))
            opened_cpu = processor_seconds() - before
            shaded = opened + until(lambda: any(isinstance(event, LayerRadiance) for event in events))
            shaded_cpu = processor_seconds() - before
            key, layer = next(editor.document.layers())
            lift = Operator("translate", "y", 0.1, 0.2, 0.5, 0.8, magnitude=0.2)
            editor.do(AddOperator(key, layer.model.factors[0].name, lift))
            editor.tick()
            started = time.monotonic()
            editor.save(file.with_suffix(".insitu"))
            saved = time.monotonic() - started
    finally:
        editor.close()
    return {
        "headlight_s": opened, "headlight_cpu_s": opened_cpu, "shaded_s": shaded, "shaded_cpu_s": shaded_cpu,
        "saved_s": saved, **memory,
    }  # fmt: skip


def main() -> None:
    from app.system.kernel_cache import use_kernel_cache

    use_kernel_cache()
    for n_triangles in map(int, sys.argv[1:]) if sys.argv[1:] else SIZES:
        for suffix, write in WRITERS.items():
            with tempfile.TemporaryDirectory() as folder:
                file = Path(folder) / f"landscape{suffix}"
                write(file, n_triangles)
                os.environ["INSITU_CACHE"] = folder  # nothing of it is there from before
                found = measure(file)
            row = {"triangles": n_triangles, "format": suffix} | {k: round(v, 3) for k, v in found.items()}
            print(json.dumps(row), flush=True)


if __name__ == "__main__":
    main()
