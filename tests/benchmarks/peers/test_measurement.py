"""Peers that are not there, what is kept on disk, and what is not measured twice."""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path

import numpy as np
import pytest

from benchmarks.figures import NotMeasured
from benchmarks.peers import measurement
from benchmarks.peers.measurement import PEERS, keep_pictures, measure_case, peer_command, run_once
from benchmarks.peers.scenes import CASES, Case, described, write_scene
from engine.light.radiance_files import read_radiance_image


@pytest.mark.parametrize(("name", "variable", "program"), PEERS)
def test_a_peer_without_interpreter_is_told(
    name: str, variable: str, program: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv(variable, raising=False)
    with pytest.raises(NotMeasured, match=variable):
        peer_command(variable, program)
    monkeypatch.setenv(variable, "/some/python")
    assert peer_command(variable, program) == ["/some/python", "-m", f"benchmarks.programs.{program}"]


def test_an_interpreter_without_the_peer_is_told(tmp_path: Path) -> None:
    (tmp_path / "bpy.py").write_text("raise ModuleNotFoundError(\"No module named 'bpy'\")")
    program = tmp_path / "python"
    program.write_text(f'#!/bin/sh\nPYTHONPATH={tmp_path} exec {sys.executable} "$@"\n')
    program.chmod(0o755)
    (tmp_path / "found").mkdir()
    with pytest.raises(NotMeasured, match="No module named 'bpy'"):
        run_once(tmp_path / "found", "cycles", [str(program), "-m", "benchmarks.programs.cycles_edits"], {})
    assert not (tmp_path / "found" / "cycles.npz").exists()


def fake(edits: list[dict[str, object]], states: list[object]) -> dict[str, np.ndarray]:
    """The answer of a program with one grey picture an edit, and truths of radiance 1."""
    size, n = (128, 128, 3), len(edits)
    found = {"made_with": np.array("a fake"), "truths": np.ones((len(states), 2, *size), np.float32)}
    found |= {"edit": np.arange(n), "seconds": np.full(n, 0.1), "cpu_seconds": np.full(n, 0.05)}
    return found | {"pictures": np.full((n, *size), 0.9, np.float32), "opened": np.ones(size, np.float32)}


def test_a_missing_peer_is_reported_and_the_rest_measured(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("INSITU_PEER_PYTHON", "python")
    monkeypatch.delenv("INSITU_CYCLES_PYTHON", raising=False)
    monkeypatch.setattr(measurement, "run_once", lambda folder, name, command, job: fake(job["edits"], job["truths"]))
    found = measure_case(CASES[0], tmp_path)
    mitsuba, cycles = (found.peers[name] for name, *_ in PEERS)
    assert isinstance(cycles, str) and "INSITU_CYCLES_PYTHON" in cycles
    assert not isinstance(mitsuba, str) and mitsuba.edits[0].errors == pytest.approx((0.1,), abs=1e-4)
    assert found.ours.again == [0.0] * 8 and found.n_bounces == 4


def test_without_mitsuba_there_is_no_truth(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("INSITU_PEER_PYTHON", raising=False)
    with pytest.raises(NotMeasured, match="INSITU_PEER_PYTHON"):
        measure_case(CASES[0], tmp_path)


def test_what_is_there_is_not_measured_again_and_pictures_are_kept(tmp_path: Path) -> None:
    program = (
        "import json, sys, numpy as np; job = json.load(open(sys.argv[1])); "
        "np.savez(sys.argv[2], edit=[0], pictures=np.full((1, 2, 2, 3), job['x'], np.float32))"
    )
    command = [sys.executable, "-c", program]
    job = {"x": 0.5, "edits": [{"kind": "jump"}]}
    for x in (0.5, 2.0):
        assert run_once(tmp_path, "peer", command, job | {"x": x})["pictures"].max() == 0.5
    assert json.loads((tmp_path / "peer.json").read_text())["x"] == 0.5
    kept = tmp_path / "peer_pictures"
    assert {file.name for file in kept.iterdir()} == {"00_jump_first.exr", "00_jump_last.exr"}
    assert read_radiance_image(kept / "00_jump_first.exr").max() == 0.5


def test_pictures_without_denoiser_and_truths_are_kept(tmp_path: Path) -> None:
    picture = np.ones((2, 2, 3), np.float32)
    found = {"edit": np.array([0]), "pictures": picture[None], "raw": picture[None], "truths": picture[None, None]}
    keep_pictures(tmp_path / "new", {"edits": [{"kind": "undo"}]}, found)
    assert {file.stem for file in (tmp_path / "new").iterdir()} == {
        "state_0", "00_undo_first", "00_undo_last", "00_undo_last_raw",
    }  # fmt: skip


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_scenes_have_materials_that_all_have(case: Case, tmp_path: Path) -> None:
    file = write_scene(case, tmp_path)
    scene, project = described(file, (16, 16))
    layers = {each["name"]: each.get("layer", []) for each in scene["object"]}
    assert {layer["model"] for each in layers.values() for layer in each} == {"lambert", "rough_conductor"}
    assert all(os.path.isfile(each["mesh"]) and "transform" not in each for each in scene["object"])
    assert "environment" not in scene or os.path.isfile(scene["environment"]["file"])
    for parameter in case.script.parameters:
        value = layers[parameter.object][parameter.layer][parameter.name]
        assert tuple(np.ravel(value)) == tuple(np.ravel(parameter.value))
    assert len(project.object_names) == len(layers)


def test_what_is_replaced_must_be_there(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="0 of 'no such line', expected 1"):
        write_scene(Case("cornell", (16, 16), CASES[0].script, (("no such line", ""),)), tmp_path)
