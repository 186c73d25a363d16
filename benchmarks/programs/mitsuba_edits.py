"""Mitsuba 3 behind a script of edits: `PYTHON -m benchmarks.programs.mitsuba_edits JOB.json OUT.npz`, see
`progressive`. For an interpreter with mitsuba and pyoidn. The scene is that of `mitsuba_stills`.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.programs.mitsuba_stills import VARIANT, mi, scene_of, shares
from benchmarks.programs.progressive import Images, run


class Mitsuba:
    """A scene whose parameters change in place."""

    def __init__(self, job: dict[str, Any]) -> None:
        mi.set_variant(VARIANT)
        self.objects = job["scene"]["object"]
        self.scene = scene_of(job["scene"], Path(), tuple(job["resolution"]), job["bounces"])
        self.parameters = mi.traverse(self.scene)
        path = {"type": "path", "max_depth": job["bounces"] + 1}
        self.integrator = mi.load_dict({"type": "aov", "aovs": "albedo:albedo,normal:sh_normal", "inner": path})
        self.made_with = f"Mitsuba {mi.__version__} ({VARIANT})"

    def change(self, edit: dict[str, Any]) -> None:
        """See `progressive`."""
        index, described = next(each for each in enumerate(self.objects) if each[1]["name"] == edit["object"])
        model = described["layer"][edit["layer"]]["model"]
        name = {"albedo": "reflectance.value", "alpha": "alpha.value"}[edit["parameter"]]
        # A material of two layers is a blend, the diffuse one first.
        end = f".bsdf_{int(model != 'lambert')}.{name}" if len(described["layer"]) > 1 else f".{name}"
        (key,) = (key for key in self.parameters.keys() if key.startswith(f"object{index}.") and key.endswith(end))
        share = shares(described["layer"])[model]
        value = edit["value"] if edit["parameter"] == "alpha" else (np.broadcast_to(edit["value"], 3) / share).tolist()
        self.parameters[key] = value
        self.parameters.update()

    def render(self, samples: int, seed: int, done: int) -> Images:
        """See `progressive`."""
        return np.array(mi.render(self.scene, integrator=self.integrator, seed=seed + done, spp=samples), np.float32)


if __name__ == "__main__":
    run(Mitsuba)
