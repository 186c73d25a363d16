"""Lines of the plan that a person has set: part of the document, with undo, in sessions, and what is carried out."""

from __future__ import annotations

from pathlib import Path

import pytest

from app.cli.precompute import fill
from app.document.commands.layers import SetModel
from app.document.commands.plan import OverrideLine, active_overrides, override_from_value
from app.document.document import Document
from app.document.effective_settings import effective_view
from app.document.view_state import SetView, ViewState
from app.editor.editor import Editor
from app.files.session import load_session, save_session
from app.messages.worker_messages import SetCamera
from app.modes.placement.placement_messages import BouncesPlanned
from app.project.project import open_project, with_overrides
from app.worker.cache import ArrayCache
from engine.core.errors import InsituError, LoadError
from engine.settings import AS_PLANNED, RenderSettings
from tests.app.fake_worker import SCENE, FakeClient, computed
from tests.scene_text import ground

LINES = {"lights": 1000, "patches": 256, "bounces": 2, "sphere": 0, "precision": "float", "edges": 4}
CHOSEN = RenderSettings(1000, 256, 2, keeps_sphere=False, overridden=frozenset({"lights", "patches"}))


def with_lines(document: Document, **lines: int | str) -> Document:
    for line, value in lines.items():
        document = OverrideLine(line, value).apply(document)
    return document


def test_a_line_is_set_by_its_name_and_given_back(document: Document) -> None:
    changed = with_lines(document, **LINES, **{"pot.1.theta_h": 32})
    assert dict(changed.overrides) == LINES | {"pot.1.theta_h": 32}
    view = effective_view(ViewState(), changed)
    assert view.settings.of_light == CHOSEN
    assert (view.settings.precision, view.settings.n_edge_rays) == ("float", 4)
    for line in dict(changed.overrides):
        changed = override_from_value(line, "auto").apply(changed)
    assert changed == document and effective_view(view, changed) is view


@pytest.mark.parametrize(
    ("line", "value", "words"),
    [
        ("lamps", 3, "the plan has no line 'lamps' to override; lines are: lights, patches"),
        ("pot.1.theta_x", 3, "the plan has no line"),
        ("pot.1.alpha", 3, "the plan has no line"),
        ("lights", 3, "plan: lights = 3, expected a whole number from 20 to 80,000"),
        ("lights", True, "plan: lights = True"),
        ("edges", 5, "plan: edges = 5, expected off, 4, 8 or 16"),
        ("precision", "double", "expected half or float"),
        ("pot.1.theta_h", 48, "expected a power of two from 1 to 128"),
        ("pot.1.theta_h", 256, "expected a power of two from 1 to 128"),
    ],
)
def test_what_there_is_not_is_refused(document: Document, line: str, value: int, words: str) -> None:
    with pytest.raises(InsituError, match=words):
        OverrideLine(line, value).apply(document)


def test_a_line_of_a_layer_counts_for_nothing_while_the_layer_is_of_another_model(document: Document) -> None:
    changed = with_lines(document, **{"pot.1.theta_h": 32, "pot.0.theta_i": 512})
    assert active_overrides(changed) == {"pot.1.theta_h": 32, "pot.0.theta_i": 512}
    other = SetModel("pot.1", "lambert").apply(changed)
    assert active_overrides(other) == {"pot.0.theta_i": 512}
    assert active_overrides(SetModel("pot.1", "rough_conductor").apply(other)) == active_overrides(changed)


def test_a_session_has_them(document: Document, tmp_path: Path) -> None:
    changed = with_lines(document, **LINES, **{"pot.1.theta_h": 32})
    path = save_session(tmp_path / "mine", changed, ViewState())
    assert load_session(path).document == changed


@pytest.mark.parametrize("line", ["lights = 3", "bounces = true", "'pot.1.theta_h' = 7", "precision = 'double'"])
def test_a_damaged_line_of_a_session_is_named(document: Document, tmp_path: Path, line: str) -> None:
    path = save_session(tmp_path / "mine", document, ViewState())
    path.write_text(path.read_text().replace("[overrides]", f"[overrides]\n{line}"))
    with pytest.raises(LoadError, match="overrides"):
        load_session(path)


def test_the_editor_asks_for_what_is_set_and_undo_brings_back(settled: Editor, client: FakeClient) -> None:
    planned = dict(settled.controller.picture.wanted_coefficients("pot.1"))
    for line, value in {**LINES, "edges": 8, "pot.1.theta_h": 32}.items():
        assert settled.do(OverrideLine(line, value)) is None
    settled.tick(1.1)
    settled.tick(1.4)
    (look,) = client.sent(SetCamera)
    assert look.n_edge_rays == 8
    client.see_scene()
    settled.tick(1.5)
    request = computed(client)[-1]
    assert request.settings == CHOSEN and request.precision == "float"
    assert {state.key: state.bands for state in request.scene.layers}["pot.1"][0] == 32
    for _ in range(7):
        settled.undo()
    assert settled.document.overrides == () and settled.undo() is None
    assert {name: len(values) for name, values in settled.controller.picture.wanted_coefficients("pot.1").items()} == {
        name: len(values) for name, values in planned.items()
    }


def test_bounces_set_by_the_user_do_not_hide_how_many_are_planned(client: FakeClient) -> None:
    editor = Editor(client, "shelf")
    client.open_scene({key: value for key, value in SCENE.items() if key != "bounces"})
    editor.tick(0.0)
    editor.do(OverrideLine("bounces", 2))
    client.answer(computed(client)[-1], BouncesPlanned(3, "the last carries 2 %"))  # comes too late
    editor.tick(0.1)
    editor.tick(0.4)
    assert computed(client)[-1].settings.n_bounces == 2
    client.answer(computed(client)[-1], BouncesPlanned(2, ""))
    editor.tick(0.5)
    editor.undo()
    editor.tick(0.6)
    editor.tick(0.9)
    assert computed(client)[-1].settings.n_bounces == AS_PLANNED


def test_a_setting_of_the_view_gives_way(settled: Editor, client: FakeClient) -> None:
    settled.do(OverrideLine("lights", 600))
    settled.do(SetView.of(n_lights=5000))
    settled.tick(1.1)
    settled.tick(1.4)
    assert [request.settings.n_lights for request in computed(client)] == [600]


def test_a_command_line_changes_what_is_computed(tmp_path: Path) -> None:
    """Of a session and by hand alike, the cache has what the editor of that session will ask for."""
    (tmp_path / "scene.toml").write_text(ground((24, 18), gloss=True))
    project = open_project(str(tmp_path / "scene.toml"))
    lines = {"lights": 480, "ground.1.theta_h": 16, "sphere": 0, "bounces": 1, "edges": 0}
    by_hand = with_overrides(project, lines)
    session = save_session(tmp_path / "work", by_hand.document, ViewState())
    kept = {}
    for name, each in {"plain": project.with_settings(n_lights=480), "hand": by_hand, "session": None}.items():
        fill(each or open_project(str(session)), lambda progress: None, ArrayCache(tmp_path / name))
        kept[name] = {file.name: file.stat().st_size for file in (tmp_path / name).iterdir()}
    assert kept["hand"] == kept["session"]
    assert sum(kept["hand"].values()) < 0.6 * sum(kept["plain"].values())  # fewer bands, and no sphere
    with pytest.raises(InsituError, match="no line 'lamps'"):
        with_overrides(project, {"lamps": 7})
