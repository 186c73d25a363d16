"""The scenes that are edited, as files that every program reads: TOML for ours, a description for the peers.

Only scenes whose materials all of them have: `lambert` and `rough_conductor`. The Cornell box is the built-in one. Of
the tea tray the pot's copper is `rough_conductor` here, since neither peer has the scene's Ashikhmin-Shirley.
"""

from __future__ import annotations

import shutil
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from app.export.mitsuba import ply_bytes
from app.project.project import Project, open_project
from benchmarks.peers.edits import Parameter, Script, script_of
from engine.scene.builtin import scene_path

COPPER = (
    'model = "rough_conductor", name = "copper", distribution = "ggx", alpha = 0.15, eta = [0.2004, 0.924, 1.1022], '
    "k = [3.9129, 2.4528, 2.1421], scale = 0.8"
)
ASHIKHMIN = 'model = "ashikhmin_shirley", name = "copper", n_u = 320.0, n_v = 70.0, scale = [0.92, 0.50, 0.33]'


@dataclass(frozen=True)
class Case:
    """A built-in scene, the size of its pictures, the script, and what is replaced in its file."""

    name: str
    resolution: tuple[int, int]
    script: Script
    replaced: tuple[tuple[str, str], ...] = ()


CASES = (
    Case(
        "cornell",
        (128, 128),
        script_of(
            Parameter("back", 1, "alpha", 0.18),
            0.3,
            (
                (Parameter("tall block", 1, "alpha", 0.35), 0.15),
                (Parameter("left", 0, "albedo", (0.63, 0.065, 0.05)), (0.1, 0.25, 0.55)),
                (Parameter("back", 1, "alpha", 0.18), 0.1),
            ),
        ),
    ),
    Case(
        "teatray",
        (128, 128),
        script_of(
            Parameter("teapot", 1, "alpha", 0.15),
            0.3,
            (
                (Parameter("handles", 0, "alpha", 0.25), 0.12),
                (Parameter("tray", 0, "albedo", (0.19, 0.07, 0.032)), (0.05, 0.12, 0.2)),
                (Parameter("tray", 1, "alpha", 0.12), 0.25),
            ),
        ),
        ((ASHIKHMIN, COPPER), ("bounces = 1", "bounces = 4")),
    ),
)


def write_scene(case: Case, folder: Path) -> Path:
    """A copy of the scene's folder with what is replaced; its file."""
    source = scene_path(case.name)
    shutil.copytree(source.parent, folder, dirs_exist_ok=True)
    text = source.read_text(encoding="utf-8")
    for old, new in case.replaced:
        if text.count(old) != 1:
            raise ValueError(f"{source}: {text.count(old)} of {old!r}, expected 1")
        text = text.replace(old, new)
    file = folder / source.name
    file.write_text(text, encoding="utf-8")
    return file


def described(file: Path, resolution: tuple[int, int]) -> tuple[dict[str, Any], Project]:
    """What a peer reads: the file's tables, with full paths, and meshes (PLY, in the world) written beside it."""
    project = open_project(str(file), resolution)
    scene: dict[str, Any] = tomllib.loads(file.read_text(encoding="utf-8"))
    if "environment" in scene:
        scene["environment"]["file"] = str(file.parent / scene["environment"]["file"])
    for index, each in enumerate(scene["object"]):
        mesh = file.parent / f"world_{index}.ply"
        mesh.write_bytes(ply_bytes(project.scene, index))
        each["mesh"] = str(mesh)
        each.pop("transform", None)
    return scene, project
