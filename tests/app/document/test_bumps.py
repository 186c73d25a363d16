"""Bumps as edits: by path, with undo, in sessions, and what the worker is asked to trace for them."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from app.document.commands.maps import SetBumps
from app.document.named_files import files_of_document
from app.document.targets import resolve
from app.document.view_state import ViewState
from app.editor.editor import Editor
from app.editor.view_controller import REST_SECONDS
from app.files.session import load_session, save_session
from app.messages.worker_messages import OpenScene, SetCamera, ViewTraced
from app.project.assignments import set_path
from app.project.project import open_project
from app.worker.schedule import InProcessClient
from app.worker.tasks import RequestDispatcher, WorkerContext
from engine.core.errors import InsituError
from engine.core.generators import run_to_end
from engine.material.bumps import NO_BUMPS, Bumps
from tests.app.fake_worker import FakeClient
from tests.scene_text import LAMBERT, camera, placed


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    """A scene of a card with a bump map of its own, and a normal map beside it."""
    Image.fromarray(np.tile(np.arange(0, 256, 4, dtype=np.uint8), (4, 1))).save(tmp_path / "ramp.png")
    Image.fromarray(np.tile(np.uint8([158, 128, 251]), (4, 4, 1))).save(tmp_path / "lean.png")
    own = 'smooth = false\nbump_map = { file = "ramp.png", height = 0.1 }\n' + LAMBERT
    (tmp_path / "scene.toml").write_text(camera((0, 0, 5), 20, (6, 6)) + placed("card", "quad", "", own))
    return tmp_path / "scene.toml"


def test_a_path_sets_what_a_still_shows(scene: Path) -> None:
    own = open_project(str(scene)).scene
    other = open_project(str(scene), values=[("card.normal_map", "lean.png"), ("card.bump_strength", 2.0)])
    assert other.document.object("card").bumps == Bumps(normal_map="lean.png", bump_strength=2.0, bump_height=0.1)
    assert own.description.objects[0].bumps == Bumps(bump_map="ramp.png", bump_height=0.1)
    assert other.scene.description.objects[0].bumps.normal_map == "lean.png" and not own.bump_normals.flaws
    none = open_project(str(scene), values=[("card.bump_map", "")])
    assert none.scene.bump_normals.objects == () and resolve(none.document, "card.bump_height").kind == "bumps"
    for path, value in (("card.bump_strength", 11.0), ("card.normal_map", "gone.png"), ("card.bump_repeats", [0, 1])):
        with pytest.raises(InsituError, match=r"10|gone\.png|none 0"):
            open_project(str(scene), values=[(path, value)])


def test_sessions_keep_what_differs_from_the_scene(scene: Path) -> None:
    document = open_project(str(scene)).document
    path = scene.parent / "a.insitu"
    for name, value in (("bump_strength", 0.5), ("normal_map", "lean.png"), ("bump_map", "")):
        changed = SetBumps("card", name, value).apply(document)
        save_session(path, changed, ViewState())
        again = open_project(str(path))
        assert again.document == changed
        assert again.scene.description.objects[0].bumps == changed.objects[0].bumps
    save_session(path, document, ViewState())
    assert "bumps" not in path.read_text() and load_session(path).document.new_bumps == ()
    back = SetBumps("card", "bump_strength", 1.0).apply(SetBumps("card", "bump_strength", 3.0).apply(document))
    assert back == document  # as the scene's file has it


def test_what_is_frozen_or_shines_refuses(scene: Path) -> None:
    document = open_project(str(scene)).document
    frozen = set_path(document, "card.frozen", True).apply(document)
    with pytest.raises(InsituError, match="frozen"):
        SetBumps("card", "bump_strength", 2.0).apply(frozen)


def test_the_worker_sees_other_normals_and_says_what_is_wrong(scene: Path) -> None:
    client = InProcessClient(RequestDispatcher())
    id = client.send(OpenScene(str(scene)))

    def seen(*bumps: Bumps) -> ViewTraced:
        client.send(SetCamera(id, bumps=tuple(("card", each) for each in bumps)))
        answers: list[ViewTraced] = []
        while not answers:
            answers = [each for each in client.poll(0.1) if isinstance(each, ViewTraced)]
        return answers[0]

    own, flat, wrong = seen(), seen(NO_BUMPS), seen(Bumps(normal_map="ramp.png"))
    assert abs(own.frame.normal[:, 0]).max() > 0.05 and not own.flaws
    assert abs(flat.frame.normal[:, 0]).max() == 0.0 and not flat.flaws
    assert abs(wrong.frame.normal[:, 0]).max() == 0.0 and "three of a normal map" in wrong.flaws[0]


def test_transport_is_kept_by_bumps_and_visibility_without_them(scene: Path) -> None:
    bench = WorkerContext()
    bench.load(open_project(str(scene)).scene, 1)
    keys = []
    for strength in (1.0, 2.0, 0.0):
        run_to_end(
            bench.set_camera(SetCamera(1, bumps=(("card", Bumps(bump_map="ramp.png", bump_strength=strength)),)))
        )
        keys.append((bench.geometry_key, bench.view_key))
    assert len({geometry for geometry, _ in keys}) == 1 and len({view for _, view in keys}) == 3
    assert keys[2][0] == keys[2][1]  # flat: as without


def test_transport_is_kept_by_rotations_and_visibility_without_them(scene: Path) -> None:
    bench = WorkerContext()
    bench.load(open_project(str(scene)).scene, 1)
    keys, flat = [], Bumps(bump_map="ramp.png", bump_strength=0.0)
    image = scene.parent / "ramp.png"
    for changes in ({}, {"tangent_angle": 5.0}, {"tangent_map": "ramp.png"},
                    {"tangent_map": "ramp.png", "tangent_range": 90.0}, {"tangent_map": "ramp.png"}):  # fmt: skip
        if len(keys) == 4:  # another image in the file's place
            Image.fromarray(np.full((4, 4), 77, np.uint8)).save(image)
        run_to_end(bench.set_camera(SetCamera(1, bumps=(("card", replace(flat, **changes)),))))
        keys.append((bench.geometry_key, bench.view_key))
    assert len({geometry for geometry, _ in keys}) == 1 and len({view for _, view in keys}) == 5
    assert keys[0][0] == keys[0][1]  # without rotation: as before


def test_rotations_have_paths_and_sessions(scene: Path) -> None:
    turned = open_project(str(scene), values=[("card.tangent_angle", 30), ("card.tangent_map", "ramp.png")])
    path = scene.parent / "b.insitu"
    save_session(path, turned.document, ViewState())
    again = open_project(str(path))
    assert again.document == turned.document
    own = again.scene.description.objects[0].bumps
    assert (own.tangent_angle, own.tangent_map, own.bump_map) == (30.0, "ramp.png", "ramp.png")
    assert scene.parent / "ramp.png" in files_of_document(turned.document)
    for name, value in (("tangent_angle", 400), ("tangent_map", "gone.png"), ("tangent_range", "wide")):
        with pytest.raises(InsituError, match=r"360|gone\.png"):
            open_project(str(scene), values=[(f"card.{name}", value)])


def test_a_coats_frame_has_paths_and_sessions(scene: Path) -> None:
    values = [("card.coat_normal_map", "lean.png"), ("card.coat_strength", 0.5), ("card.0.frame", "coat")]
    coated = open_project(str(scene), values=values)
    own = Bumps(bump_map="ramp.png", bump_height=0.1)
    expected = replace(own, coat_normal_map="lean.png", coat_strength=0.5)
    assert coated.document.object("card").bumps == expected and coated.document.layer("card.0").frame == "coat"
    assert coated.scene.in_frame("coat").bump_normals.objects == (0,)
    path = scene.parent / "c.insitu"
    save_session(path, coated.document, ViewState())
    again = open_project(str(path))
    assert again.document == coated.document and again.scene.description.objects[0].bumps == expected
    assert scene.parent / "lean.png" in files_of_document(coated.document)
    for name, value in (("coat_strength", 11), ("coat_normal_map", "gone.png"), ("0.frame", "lacquer")):
        with pytest.raises(InsituError, match=r"10|gone\.png|base, coat"):
            open_project(str(scene), values=[(f"card.{name}", value)])
    # In a scene's file the map is a table with the keys of normal_map.
    text = scene.read_text().replace("bump_map", 'coat_normal_map = { file = "lean.png", scale = 0.5 }\nbump_map')
    scene.write_text(text.replace('model = "lambert"', 'model = "lambert", frame = "coat"'))
    assert open_project(str(scene)).document.object("card").bumps == expected
    assert open_project(str(scene)).document.layer("card.0").frame == "coat"


def test_transport_depends_on_the_coats_normals(scene: Path) -> None:
    bench, keys = WorkerContext(), []
    bench.load(open_project(str(scene)).scene, 1)
    for name in ("", "lean.png"):
        run_to_end(bench.set_camera(SetCamera(1, bumps=(("card", Bumps(coat_normal_map=name)),))))
        keys.append((bench.geometry_key, bench.view_key))
    assert keys[0][0] == keys[1][0] == keys[0][1] != keys[1][1]


def test_an_edit_is_traced_once_the_hand_rests_and_undone_in_one_step(client: FakeClient) -> None:
    editor = Editor(client, "shelf")
    client.open_scene()
    editor.tick(0.0)
    client.finish_stage("final", exact=True)
    editor.tick(1.0)
    client.requests.clear()
    name = next(state.name for state in editor.document.objects if not state.emits)
    assert editor.do(SetBumps(name, "bump_map", "bricks.png")) is None
    editor.tick(2.0)
    assert client.sent(SetCamera) == []
    editor.tick(2.1 + REST_SECONDS)
    (look,) = client.sent(SetCamera)
    assert look.bumps == ((name, Bumps(bump_map="bricks.png")),)
    editor.undo()
    editor.tick(3.0)
    editor.tick(3.1 + REST_SECONDS)
    assert client.sent(SetCamera)[-1].bumps == () and editor.document.new_bumps == ()
