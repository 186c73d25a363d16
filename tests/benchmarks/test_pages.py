"""The scripts behind docs/scale.md and docs/peers.md, on next to nothing."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from benchmarks import large_scenes, peer_page
from benchmarks.peer import Stills
from benchmarks.peer_page import EDITS, Found, page
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


def test_a_page_of_peers_goes_by_equal_errors(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(peer_page, "_machine", lambda: "a machine")
    pictures = np.ones((2, 4, 4, 3))
    stills = Stills(pictures, np.array([1.0, 3.0]), 64, "a tracer", np.array([2.0, 6.0]))
    times = {"frame_s": [0.01], "frame_cpu_s": [0.02], "exact_s": [1.0], "exact_cpu_s": [2.0]}
    errors = {"before": 0.5, "framed": 0.08, "exact": 0.02}
    found = Found(EDITS[0], 3, times, errors, stills, 0.04, "a renderer")
    assert found.peer_seconds(0.08, cpu=True) == [0.5, 1.5] and found.peer_seconds(0.02, cpu=False) == [4.0, 12.0]
    first, finished = (line for line in page([found]).splitlines() if "| first frame" in line or "| finished" in line)
    # Half the noise of a still's 2 to 6 s costs four times as much, twice of it a quarter: 0.5 s at least against 0.02.
    assert "8.0%" in first and "1 s (0.5 to 1.5)" in first and first.endswith("| 25 |")
    assert "16 s (8 to 24)" in finished and finished.endswith("| 4 |")
