"""Materials matched in the worker and in Python: measured files, what a model is of itself, and both errors."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import insitu
from app.document.described import document_from_description
from app.document.material_match import MaterialMatch
from app.files.materials import measured_layers
from app.messages.match_messages import MatchMaterial, MatchProgress, MaterialMatched
from app.messages.worker_messages import RequestFailed, Response, SceneOpened
from app.worker.cache import ArrayCache
from app.worker.tasks import RequestDispatcher
from engine.material import MODELS, make_layer
from engine.scene.description import SceneDescription
from tests.opened import open_in_process, run_in_process
from tests.scene_text import LAMBERT, camera, environment, material, placed, scaled

SCENE = (
    camera((0, 0, 3), resolution=(24, 24), head="bounces = 1\n")
    + environment((0.4, 0.5, 0.7))
    + placed("ball", "sphere", more=LAMBERT)
    + placed("behind", "sphere", scaled(0.2, (0, 0, -3)), more=material('model = "ward"'))
)


@pytest.fixture
def source(tmp_path: Path) -> str:
    (tmp_path / "scene.toml").write_text(SCENE)
    return str(tmp_path / "scene.toml")


def ask(source: str, match: MaterialMatch) -> list[Response]:
    """All answers of a worker that has opened the scene."""
    worker = RequestDispatcher(ArrayCache())
    (opened,) = (each for each in open_in_process(worker, source) if isinstance(each, SceneOpened))
    document = document_from_description(source, SceneDescription.model_validate_json(opened.description))
    return run_in_process(worker, MatchMaterial(match, document))


def test_the_worker_answers_with_progress_and_both_errors(source: str) -> None:
    red = make_layer(MODELS["lambert"], {"albedo": (0.8, 0.2, 0.1)})
    *progress, answer = ask(source, MaterialMatch("ball", (red,), "red", "lambert"))
    assert all(isinstance(each, MatchProgress) for each in progress) and isinstance(answer, MaterialMatched)
    fractions = [each.fraction for each in progress if isinstance(each, MatchProgress)]
    assert fractions == sorted(fractions) and fractions[-1] > 0.7
    # A diffuse surface of another albedo is its curve multiplied: only the smoothing of the fit is left.
    assert answer.errors.before > 0.5 and answer.errors.brdf < 0.01
    assert answer.errors.picture is not None and answer.errors.picture < 0.02
    assert answer.planned


def test_what_a_model_cannot_do_is_in_both_errors(source: str) -> None:
    # Of a highlight that mirrors an even sky no diffuse curve has the BRDF; the picture is off by less than that.
    metal = make_layer(MODELS["rough_conductor"], {"alpha": 0.1})
    *_, answer = ask(source, MaterialMatch("ball", (metal,), "metal", "lambert"))
    assert isinstance(answer, MaterialMatched)
    assert answer.errors.brdf > 0.3 and answer.errors.picture is not None and 0.02 < answer.errors.picture


def test_an_object_that_no_pixel_sees_has_no_error_in_the_picture(source: str) -> None:
    white = make_layer(MODELS["lambert"])
    *_, answer = ask(source, MaterialMatch("behind", (white,), "white", "lambert"))
    assert isinstance(answer, MaterialMatched) and answer.errors.picture is None
    assert answer.errors.text.endswith("not in the picture")


def test_a_measured_file_is_read_in_the_worker(source: str, merl_file: Path) -> None:
    match = MaterialMatch("ball", measured_layers(merl_file), "gloss", "rough_conductor", searched=())
    *_, answer = ask(source, match)
    assert isinstance(answer, MaterialMatched) and answer.errors.brdf < 0.5 * answer.errors.before
    assert np.isfinite(answer.errors.picture or np.nan)


def test_a_damaged_file_is_one_line(source: str, tmp_path: Path) -> None:
    (tmp_path / "bad.binary").write_bytes(b"\x5a\0\0\0" * 3 + b"\xff" * 800)
    *_, answer = ask(source, MaterialMatch("ball", measured_layers(tmp_path / "bad.binary"), "bad", "ward"))
    assert isinstance(answer, RequestFailed) and "bad.binary" in answer.line and "\n" not in answer.line


def test_python_matches_and_undoes_it_to_the_bit(source: str) -> None:
    scene = insitu.open(source)
    before = scene.document
    errors = scene.match_material("ball", "lambert", "Terracotta")
    assert errors.brdf < errors.before and errors.picture is not None and errors.picture < 0.1
    assert [scene["ball"][0].model, len(scene["ball"][0]["theta_i"].operators)] == ["lambert", 1]
    assert scene.undo() == "Diffuse, as Terracotta on ball" and scene.document == before
    with pytest.raises(insitu.Error, match="no model"):
        scene.match_material("ball", "glass")
