"""Materials matched by a process of its own and in Python: measured files, what a model is of itself, both errors, and
that both have the same answer."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

import pytest

import insitu
from app.document.commands.layers import AddLayers, SetVisible
from app.document.material_match import MaterialAnswer, MaterialMatch
from app.document.view_state import Viewpoint, ViewState
from app.files.materials import Material, save_material
from app.project.material_matching import found_source, match_material
from app.project.project import Project, open_project
from app.worker.material_matcher import MaterialMatcher, dump_answer, load_answer
from app.worker.session_process import TaskAnswer
from engine.core.errors import InsituError
from engine.core.generators import run_to_end
from engine.material import MODELS, make_layer
from engine.material.layer import Layer
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


@pytest.fixture
def project(source: str) -> Project:
    return open_project(source)


def match(project: Project, layer: Layer, model: str, name: str = "ball") -> MaterialAnswer:
    """What comes of a match with a layer."""
    asked = MaterialMatch(name, "", model, title="it", layers=(layer,))
    return run_to_end(match_material(project, asked))


def test_what_a_model_can_do_is_in_both_errors(project: Project) -> None:
    red = make_layer(MODELS["lambert"], {"albedo": (0.8, 0.2, 0.1)})
    told: list[tuple[float, str]] = []
    asked = MaterialMatch("ball", "", "lambert", title="red", layers=(red,))
    answer = run_to_end(match_material(project, asked), told.append)
    fractions = [fraction for fraction, _ in told]
    assert fractions == sorted(fractions) and fractions[0] == 0.0 and fractions[-1] > 0.7
    assert list(dict(map(reversed, told))) == ["reading the material", "fitting curves", "drawing both in place"]
    # A diffuse surface of another albedo is its curve multiplied: only the smoothing of the fit is left.
    assert answer.errors.before > 0.5 and answer.errors.brdf < 0.01
    assert answer.errors.picture is not None and answer.errors.picture < 0.02


def test_what_a_model_cannot_do_is_in_both_errors(project: Project) -> None:
    # Of a highlight that mirrors an even sky no diffuse curve has the BRDF; the picture is off by less than that.
    errors = match(project, make_layer(MODELS["rough_conductor"], {"alpha": 0.1}), "lambert").errors
    assert errors.brdf > 0.3 and errors.picture is not None and 0.02 < errors.picture


def test_an_object_that_no_pixel_sees_has_no_error_in_the_picture(project: Project) -> None:
    errors = match(project, make_layer(MODELS["lambert"]), "lambert", "behind").errors
    assert errors.picture is None and errors.text.endswith("not in the picture")


def test_an_object_is_in_the_picture_as_long_as_any_layer_of_it_is_shown(project: Project) -> None:
    white, document = make_layer(MODELS["lambert"]), project.document
    document = AddLayers("ball", (make_layer(MODELS["ward"]),)).apply(document)
    for hidden, is_seen in (
        (("ball.0",), True),
        (("ball.1",), True),
        (("ball.0", "ball.1"), False),
        (("ball",), False),
    ):
        changed = document
        for path in hidden:
            changed = SetVisible(path, False).apply(changed)
        errors = match(project.edited(changed, Viewpoint()), white, "lambert").errors
        assert (errors.picture is not None) == is_seen, hidden


# ---------------------------------------------------------------------------------------------------------- the process


@pytest.fixture
def matcher() -> Iterator[MaterialMatcher]:
    made = MaterialMatcher()
    yield made
    made.close()


def ended(matcher: MaterialMatcher) -> tuple[TaskAnswer[MaterialAnswer], list[str]]:
    """What has come of a match, and what it told meanwhile."""
    until, told = time.monotonic() + 300.0, [matcher.progress]
    while not (found := matcher.take_ended()):
        assert time.monotonic() < until
        if matcher.progress != told[-1]:
            told.append(matcher.progress)
        time.sleep(0.002)
    (one,) = found
    return one, told


def ask(
    matcher: MaterialMatcher, project: Project, source: str, model: str, searched: tuple[str, ...] | None = None
) -> None:
    asked = found_source(MaterialMatch("ball", source, model, searched=searched), project.document)
    matcher.begin(project.document, ViewState(), asked)


def test_the_process_has_the_answer_of_python(matcher: MaterialMatcher, source: str, project: Project) -> None:
    ask(matcher, project, "Terracotta", "lambert")
    (answer, said), told = ended(matcher)
    assert answer is not None, said
    assert told[0] == "matching Terracotta 0% opening the scene" and "matching Terracotta 70%" in " ".join(told)
    assert any("fitting curves" in each for each in told) and not matcher.progress
    scene = insitu.open(source)
    assert scene.match_material("ball", "lambert", "Terracotta") == answer.errors
    assert scene.document.object("ball").layers == (answer.layer,)


def test_measured_files_are_read_in_the_process(matcher: MaterialMatcher, project: Project, merl_file: Path) -> None:
    ask(matcher, project, str(merl_file), "rough_conductor", ())
    (answer, said), _ = ended(matcher)
    assert answer is not None, said
    assert answer.errors.brdf < 0.5 * answer.errors.before and answer.errors.picture is not None


def test_a_damaged_file_is_one_line(matcher: MaterialMatcher, project: Project, tmp_path: Path) -> None:
    (tmp_path / "bad.binary").write_bytes(b"\x5a\0\0\0" * 3 + b"\xff" * 800)
    ask(matcher, project, str(tmp_path / "bad.binary"), "ward")
    (answer, said), _ = ended(matcher)
    assert answer is None and said.startswith("bad was not matched: ") and "bad.binary" in said and "\n" not in said


def test_a_process_that_was_killed_is_one_line(matcher: MaterialMatcher, project: Project) -> None:
    ask(matcher, project, "Gold", "rough_conductor")
    task, until = matcher._matching.task, time.monotonic() + 60.0
    while task is not None and task.process is None and time.monotonic() < until:
        time.sleep(0.002)
    assert task is not None and task.process is not None
    task.process.kill()
    (answer, said), _ = ended(matcher)
    assert answer is None and said.startswith("Gold: it was not matched, signal 9") and "\n" not in said


def test_a_match_that_is_stopped_says_nothing(matcher: MaterialMatcher, project: Project) -> None:
    ask(matcher, project, "Gold", "rough_conductor")
    task = matcher._matching.task
    matcher.stop()
    assert task is not None and not matcher.progress
    matcher.close()
    assert matcher.take_ended() == [] and (task.process is None or task.process.wait(10.0) is not None)


def test_answers_survive_their_journey_and_others_are_refused(project: Project) -> None:
    answer = match(project, make_layer(MODELS["rough_conductor"]), "rough_conductor", "behind")
    tree = dump_answer(answer)
    found = load_answer(tree)
    assert found.layer == answer.layer and found.errors == answer.errors
    two = tree["material"].replace("layer = [", 'layer = [\n  { model = "lambert" },')
    for faulty in (
        None, {}, {**tree, "brdf": float("nan")}, {**tree, "extra": 1}, {**tree, "material": "layer = 3"},
        {**tree, "material": two},
    ):  # fmt: skip
        with pytest.raises(InsituError, match="what the match found"):
            load_answer(faulty)


# --------------------------------------------------------------------------------------------------------------- Python


def test_python_takes_an_object_a_layer_and_a_file(source: str, tmp_path: Path) -> None:
    save_material(tmp_path / "red.toml", Material("red", (make_layer(MODELS["lambert"], {"albedo": (0.8, 0.2, 0.1)}),)))
    scene = insitu.open(source)
    for given, label in (
        (None, "Diffuse, as behind on behind"), ("ball", "Diffuse, as ball on behind"),
        ("ball.0", "Diffuse, as ball Diffuse on behind"), (str(tmp_path / "red.toml"), "Diffuse, as red on behind"),
    ):  # fmt: skip
        scene.match_material("behind", "lambert", given)
        assert scene.undo() == label


def test_python_matches_and_undoes_it_to_the_bit(source: str) -> None:
    scene = insitu.open(source)
    before = scene.document
    errors = scene.match_material("ball", "lambert", "Terracotta")
    assert errors.brdf < errors.before and errors.picture is not None and errors.picture < 0.1
    assert [scene["ball"][0].model, len(scene["ball"][0]["theta_i"].operators)] == ["lambert", 1]
    assert scene.undo() == "Diffuse, as Terracotta on ball" and scene.document == before
    with pytest.raises(insitu.Error, match="no model"):
        scene.match_material("ball", "glass")
