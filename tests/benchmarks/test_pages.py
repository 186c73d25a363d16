"""The script behind docs/scale.md, on next to nothing."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from benchmarks import large_scenes
from engine.scene.scene_loader import load_scene


def test_a_landscape_has_its_triangles_and_hills(tmp_path: Path) -> None:
    large_scenes.make_scene(tmp_path, 800)
    scene = load_scene(tmp_path / "scene.toml")
    assert len(scene.triangles) == 800 and not scene.notes
    assert np.ptp(scene.vertices[:, 1]) > 0.5 and (scene.geometric_normals[:, 1] > 0.0).all()


def test_each_part_of_a_view_is_reported(tmp_path: Path) -> None:
    large_scenes.make_scene(tmp_path, 800)
    found = large_scenes.measure(tmp_path, (24, 16))
    assert found["n_tiles"] == 2 * -(-found["points"] // 256)  # of two layers
    assert found["tile_s"] == pytest.approx(found["tiles"] / found["n_tiles"]) and found["tile_bytes"] > 1000
    assert all(found[part] > 0.0 for part in ("open", "bvh", "hits", "light", "tiles", "indirect", "seen_mib"))
