"""Measured materials in documents: read by the worker, put on objects as one step, written by their file's name."""

import random
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.document.commands.curves import AddOperator
from app.document.commands.layers import SetFrozen, SetModel, SetParameter
from app.document.described import document_from_description
from app.document.document import Document
from app.document.named_files import (
    layers_of_document,
    measured_files,
    measurement_in,
    unread_files,
    with_measurements,
)
from app.editor.editor import Editor
from app.files.materials import Material, dump_material, import_measured, load_material, measured_layers, parse_material
from app.files.session import load_session
from app.messages.file_messages import FilesWritten, MeasurementsRead, ReadMeasured, WriteFiles
from app.messages.worker_messages import FetchTable, OpenScene, Progress, RequestFailed, SceneOpened, TableFetched
from app.modes.placement.curves import Curves
from app.modes.placement.placement_messages import ComputeTransport, LayerPicture, PlanBands
from app.project.assignments import set_path
from app.project.project import open_project
from app.worker.cache import ArrayCache
from app.worker.schedule import InProcessClient
from app.worker.tasks import RequestDispatcher
from engine.core.errors import InsituError, LoadError
from engine.curve.operators import Operator
from engine.material import MODELS, make_layer
from engine.material.measured import HIGHLIGHT_MODELS
from engine.measured import tables
from engine.measured.measurement import Part
from engine.measured.sample_files import merl_samples, read_merl
from engine.planner import band_counts
from engine.render.tabulate import untabulated_features
from engine.scene.description import SceneDescription
from engine.settings import RenderSettings
from tests.app.fake_worker import FakeClient
from tests.naive.measured import drawn_measurement
from tests.naive.tensor_files import Gloss, acquired, tensor_bytes
from tests.opened import open_in_process, run_in_process
from tests.scene_text import camera, environment, material, placed

LAYERS = 'model = "measured_diffuse", file = "NAME"', 'model = "measured", file = "NAME", smoothing = 0.3'
SCENE = (
    camera((0, 0, 3), resolution=(12, 12), head="bounces = 1\n")
    + environment((0.4, 0.5, 0.7))
    + placed("ball", "sphere", more=material(*LAYERS))
)


@pytest.fixture
def scene(tmp_path: Path, merl_file: Path) -> Path:
    shutil.copy(merl_file, tmp_path / "gloss.binary")
    (tmp_path / "scene.toml").write_text(SCENE.replace("NAME", "gloss.binary"))
    return tmp_path / "scene.toml"


def document_of(opened: SceneOpened, source: Path) -> Document:
    from app.document.named_files import document_with_measurements

    description = SceneDescription.model_validate_json(opened.description)
    return document_with_measurements(document_from_description(str(source), description), opened.measurements)


def compute(document: Document) -> ComputeTransport:
    return ComputeTransport(Curves(16).scene_state(document), None, None, 80, RenderSettings(80, 20))


def test_a_worker_reads_what_a_scene_names(scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tables, "_tables", {})
    store = ArrayCache(tmp_path / "cache")
    tasks = RequestDispatcher(store)
    opened = next(a for a in open_in_process(tasks, str(scene)) if isinstance(a, SceneOpened))
    assert opened.measurements["gloss.binary"].is_read
    document = document_of(opened, scene)
    number = opened.measurements["gloss.binary"].number
    assert measured_files(layers_of_document(document)) == ((str(scene.parent / "gloss.binary"), number),)
    request = compute(document)
    before = {a.key: a.radiance for a in run_in_process(tasks, request) if isinstance(a, LayerPicture)}
    assert set(before) == {"ball.0", "ball.1"} and all(picture.max() > 0.0 for picture in before.values())
    # One that has just been started has no table, and reads it first; nothing is fitted for it is kept.
    monkeypatch.setattr(tables, "_tables", {})
    monkeypatch.delattr(tables, "fit_factors")
    after = {a.key: a.radiance for a in run_in_process(tasks, request) if isinstance(a, LayerPicture)}
    assert all(np.array_equal(after[key], before[key]) for key in before)
    another = replace(opened.measurements["gloss.binary"], file=str(scene.parent / "gloss.binary"), number=number + 1)
    layers = tuple(replace(each, layer=each.layer.with_parameter("file", another)) for each in request.scene.layers)
    *_, failed = run_in_process(tasks, replace(request, scene=replace(request.scene, layers=layers)))
    assert isinstance(failed, RequestFailed) and "has changed since it was imported" in failed.line


@pytest.mark.parametrize("name", ["../gloss.binary", "/etc/passwd", "there_is_none.binary"])
def test_scenes_read_files_of_their_own_folder_alone(scene: Path, name: str) -> None:
    scene.write_text(SCENE.replace("NAME", name))
    with pytest.raises(LoadError, match=r"expected a (relative path|readable file)"):
        open_project(str(scene))


def test_an_empty_name_is_none(scene: Path) -> None:
    with pytest.raises(LoadError, match="expected the name of a file with a measured BRDF"):
        scene.write_text(SCENE.replace("NAME", ""))
        open_project(str(scene))


def test_an_import_is_one_step(client: FakeClient, tmp_path: Path) -> None:
    editor = Editor(client, "shelf")
    client.open_scene()
    editor.tick(0.0)
    before, file = editor.document, tmp_path / "drawn.binary"
    assert editor.do(import_measured("pot", file)) is None
    (asked,) = client.sent(ReadMeasured)
    assert asked.files == (str(file),) and editor.document is before and editor.exchange.reading.is_under_way
    client.answer(asked, Progress("measured BRDF", 0.5, text="fitting"))
    editor.tick(0.1)
    assert editor.status.text == "fitting"
    client.answer(asked, MeasurementsRead({str(file): replace(drawn_measurement(), file=str(file))}))
    editor.tick(0.2)
    layers = editor.document.object("pot").layers
    assert [layer.name for layer in layers] == ["diffuse", "highlight"] and not editor.exchange.reading.is_under_way
    assert unread_files(layers) == () and editor.history.undo_label == "drawn on pot"
    editor.tick(5.0)
    asked = client.sent(ComputeTransport)[-1]
    assert measured_files(each.layer for each in asked.scene.layers) == ((str(file), 5),)
    assert "is what was imported" in str(editor.do(SetParameter("pot.0", "file", "x.binary")))
    editor.undo()
    assert editor.document.objects == before.objects


@pytest.mark.parametrize("highlight", ["specular", "around", "brushed"])
def test_an_import_gets_the_curves_that_fit_best(tmp_path: Path, highlight: Part) -> None:
    # What a scene names stays what it is.
    file = tmp_path / "x.bsdf"
    read = replace(drawn_measurement(), file=str(file), highlight=highlight)
    found = with_measurements(measured_layers(file), {str(file): read})
    assert [layer.model for layer in found] == [MODELS["measured_diffuse"], HIGHLIGHT_MODELS[highlight]]
    assert {measurement_in(layer) for layer in found} == {read}
    named = (make_layer(MODELS["measured"], {"file": str(file)}),)
    assert with_measurements(named, {str(file): read})[0].model is MODELS["measured"]
    (cloth,) = with_measurements(measured_layers(file, cloth=True), {str(file): read})
    assert cloth.model is MODELS["measured_cloth"]


def test_a_highlight_is_edited_over_other_angles(client: FakeClient, tmp_path: Path) -> None:
    # The file, smoothing and edits of the curve that both have stay; from another model nothing does.
    editor, file = Editor(client, "shelf"), tmp_path / "drawn.binary"
    client.open_scene()
    editor.tick(0.0)
    editor.do(import_measured("pot", file))
    client.answer(client.sent(ReadMeasured)[-1], MeasurementsRead({str(file): drawn_measurement()}))
    editor.tick(0.1)
    lift = Operator("amplify", "y", 0.1, 0.2, 0.4, 0.6, magnitude=1.5)
    for command in (SetParameter("pot.1", "smoothing", 0.5), AddOperator("pot.1", "theta_h", lift),
                    AddOperator("pot.1", "theta_d", lift), SetModel("pot.1", "measured_around")):  # fmt: skip
        assert editor.do(command) is None
    layer = editor.document.layer("pot.1")
    assert layer.model.name == "measured_around" and measurement_in(layer) == drawn_measurement()
    assert layer.values["smoothing"] == 0.5 and dict(layer.edits) == {"theta_h": (lift,)}
    editor.do(SetModel("pot.1", "phong"))
    editor.do(SetModel("pot.1", "measured_around"))
    assert measurement_in(editor.document.layer("pot.1")) is None


def test_an_anisotropic_import_is_rendered_and_has_no_table(tmp_path: Path) -> None:
    file = tmp_path / "brushed.bsdf"
    file.write_bytes(tensor_bytes(acquired(Gloss(0.5, 0.15), n_theta=5, n_phi=9, n=10, n_facets=16, turn=np.pi)))
    tasks = RequestDispatcher(ArrayCache(tmp_path / "cache"))
    layers = measured_layers(file)
    *_, answer = run_in_process(tasks, ReadMeasured((str(file),), layers))
    assert isinstance(answer, MeasurementsRead) and answer.found[str(file)].is_anisotropic
    assert [set(bands) for bands in answer.planned] == [{"theta_i"}, {"theta_u", "theta_v"}]
    *_, given = run_in_process(tasks, FetchTable(str(file)))
    assert isinstance(given, TableFetched) and given.measurement.is_anisotropic and given.samples.size == 3
    (note,) = untabulated_features(with_measurements(layers, answer.found)[:1])
    assert "averaged around the normal" in note


def test_the_worker_plans_a_session_with_an_import(scene: Path, merl_file: Path, tmp_path: Path) -> None:
    # Of its layers those that the scene does not have; with the curves that its files have.
    tasks = RequestDispatcher(ArrayCache(tmp_path / "cache"))
    *_, plain = run_in_process(tasks, OpenScene(str(scene)))
    assert isinstance(plain, SceneOpened)
    own = layers_of_document(document_of(plain, scene))
    assert [layer for layer, _ in plain.planned] == own
    layers = (*own, *measured_layers(merl_file, cloth=True))
    *_, opened = run_in_process(tasks, OpenScene(str(scene), (str(merl_file),), layers))
    assert isinstance(opened, SceneOpened)
    *others, (layer, bands) = opened.planned
    assert [each for each, _ in others] == own
    assert layer.model.name == "measured_cloth" and not unread_files([layer]) and bands == band_counts(layer)


def test_the_window_plans_no_bands_of_an_import(
    client: FakeClient, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    editor = Editor(client, "shelf")
    client.open_scene()
    editor.tick(0.0)
    monkeypatch.delattr("app.modes.placement.band_plans.band_counts")
    file = tmp_path / "drawn.binary"
    editor.do(import_measured("pot", file))
    (asked,) = client.sent(ReadMeasured)
    assert asked.layers == measured_layers(file)
    found = {str(file): replace(drawn_measurement(), file=str(file))}
    bands = {"theta_i": 32}, {"theta_h": 128, "theta_d": 8}
    client.answer(asked, MeasurementsRead(found, bands))
    for now in (0.1, 5.0):
        editor.tick(now)
    works = client.sent(ComputeTransport)[-1].scene.layers
    assert [work.bands for work in works if work.key.startswith("pot")] == [(32,), (128, 8)]
    editor.undo()
    editor.redo()
    editor.tick(10.0)
    assert not client.sent(PlanBands)
    # Nor of a session that has it.
    assert editor.save(tmp_path / "x.insitu") is None
    pot = editor.document.object("pot").layers
    other = Editor(client, str(tmp_path / "x.insitu"))
    assert with_measurements(client.sent(OpenScene)[-1].layers[:2], found) == pot
    client.open_scene(measurements=found, planned=tuple(zip(pot, bands, strict=True)))
    for now in (0.0, 5.0):
        other.tick(now)
    works = client.sent(ComputeTransport)[-1].scene.layers
    assert [work.bands for work in works if work.key.startswith("pot")] == [(32,), (128, 8)]
    assert not client.sent(PlanBands)


@pytest.mark.parametrize("ends", ["drop", "cancel", "undo"])
def test_an_import_that_comes_during_a_drag_is_a_step_of_its_own(client: FakeClient, tmp_path: Path, ends: str) -> None:
    editor = Editor(client, "shelf")
    client.open_scene()
    editor.tick(0.0)
    before, file = editor.document, str(tmp_path / "drawn.binary")
    editor.do(import_measured("pot", Path(file)))
    editor.begin_drag("albedo")
    editor.do(SetParameter("pot.0", "albedo", 0.3))
    client.answer(client.sent(ReadMeasured)[-1], MeasurementsRead({file: replace(drawn_measurement(), file=file)}))
    editor.tick(0.1)
    editor.do(SetParameter("pot.0", "albedo", 0.4))
    dragged = editor.document
    assert dragged.layer("pot.0") == before.layer("pot.0").with_parameter("albedo", 0.4)
    {"drop": editor.end_drag, "cancel": editor.cancel_drag, "undo": editor.undo}[ends]()
    assert [layer.name for layer in editor.document.object("pot").layers] == ["diffuse", "highlight"]
    assert editor.undo() == "drawn on pot" and not editor.exchange.is_reading
    if ends == "drop":
        assert editor.document == dragged and editor.undo() == "albedo"
    assert editor.document == before and editor.undo() is None


@pytest.mark.parametrize("seed", range(6))
def test_any_sequence_of_imports_and_drags_is_undone_to_the_bit(client: FakeClient, tmp_path: Path, seed: int) -> None:
    """An answer changes nothing while a drag goes on, however it ends; each step of undo leads to a document that was
    there before the import or the drag, and nothing is left to wait for."""
    rng, editor, file, now = random.Random(seed), Editor(client, "shelf"), str(tmp_path / "drawn.binary"), 0.0
    client.open_scene()
    editor.tick(now)
    first, at_rest = editor.document, [editor.document]
    for _ in range(60):
        before, n_steps = editor.document, len(editor.history.undo_steps)
        match rng.choice(("ask", "answer", "answer", "hold", "drag", "drag", "drop", "cancel", "undo", "redo")):
            case "ask":
                editor.do(import_measured("pot", Path(file)))
                assert editor.document is before
            case "answer" if editor.exchange.is_reading:
                found = MeasurementsRead({file: replace(drawn_measurement(), file=file)})
                client.answer(client.sent(ReadMeasured)[-1], found)
                is_dragging = editor.history.dragging
                editor.tick(now := now + 0.1)
                if is_dragging:
                    assert editor.document is before and len(editor.history.undo_steps) == n_steps
                else:
                    assert not editor.exchange.is_reading
            case "hold":
                editor.begin_drag()
            case "drag" if editor.history.dragging:
                editor.do(SetParameter("floor.0", "albedo", rng.random()))
                assert editor.document.object("pot") is before.object("pot")
            case "drop":
                editor.end_drag()
            case "cancel":
                editor.cancel_drag()
            case "undo":
                editor.undo()
            case "redo":
                editor.redo()
        if not editor.history.dragging:
            at_rest.append(editor.document)
    editor.end_drag()
    at_rest.append(editor.document)
    known = [*at_rest, *(step.document for step in editor.history.undo_steps)]
    while editor.undo() is not None:
        assert editor.document in known
    assert editor.document == first


def test_an_import_that_fails_or_is_cancelled_changes_nothing(client: FakeClient, tmp_path: Path) -> None:
    editor = Editor(client, "shelf")
    client.open_scene()
    editor.tick(0.0)
    before = editor.document
    for end in (
        lambda asked: client.answer(asked, RequestFailed("x.binary: size = 3 bytes")),
        lambda _: editor.cancel_work(),
    ):
        editor.do(import_measured("pot", tmp_path / "x.binary"))
        asked = client.sent(ReadMeasured)[-1]
        end(asked)
        editor.tick(0.1)
        assert not editor.exchange.reading.is_under_way
        client.answer(asked, MeasurementsRead({asked.files[0]: drawn_measurement()}))
        editor.tick(0.2)
        assert editor.document is before


def test_the_worker_answers_an_import_between_other_work(merl_file: Path, tmp_path: Path) -> None:
    client = InProcessClient(RequestDispatcher(ArrayCache(tmp_path / "cache")))
    layers = measured_layers(merl_file)
    client.send(ReadMeasured((str(merl_file),), layers))
    answer = client.poll(float("inf"))[-1]
    assert isinstance(answer, MeasurementsRead) and answer.found[str(merl_file)].is_read
    # What takes longer than a frame is planned there, of the layers as they will be.
    assert answer.planned == tuple(band_counts(layer) for layer in with_measurements(layers, answer.found))


def test_the_worker_hands_a_table_out(merl_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tables, "_tables", {})
    tasks = RequestDispatcher(ArrayCache(tmp_path / "cache"))
    *_, given = run_in_process(tasks, FetchTable(str(merl_file)))
    assert isinstance(given, TableFetched) and given.measurement.is_read
    number = given.measurement.number
    assert np.array_equal(given.samples, tables.table_of(number).samples) and given.samples.dtype == np.float32
    # By its number at once; a copy of the file is the same table, by its own name; another number is another file.
    monkeypatch.delattr("app.worker.file_tasks.read_measurement")
    (again,) = run_in_process(tasks, FetchTable("copy.binary", number))
    assert isinstance(again, TableFetched) and again.measurement == replace(given.measurement, file="copy.binary")
    monkeypatch.undo()
    *_, failed = run_in_process(tasks, FetchTable(str(merl_file), number + 1))
    assert isinstance(failed, RequestFailed) and "has changed since it was imported" in failed.line


def test_a_table_is_asked_for_once(client: FakeClient) -> None:
    editor = Editor(client, "shelf")
    client.open_scene()
    editor.tick(0.0)
    measurement, samples = drawn_measurement(), np.zeros((2, 2, 2, 3), np.float32)
    for _ in range(2):
        editor.tables.request_table(measurement)
    (asked,) = client.sent(FetchTable)
    assert (asked.file, asked.number) == ("drawn.binary", 5) and editor.tables.take() is None
    client.answer(asked, TableFetched(measurement, samples))
    editor.tick(0.1)
    editor.tables.request_table(measurement)  # it is here, and nobody has taken it
    assert len(client.sent(FetchTable)) == 1
    assert editor.tables.take() == (5, samples) and editor.tables.take() is None
    # One that fails is not asked for again until another scene is opened, and is told of where it would be shown.
    unread = replace(measurement, number=0, file="gone.binary")
    editor.tables.request_table(unread)
    client.answer(client.sent(FetchTable)[-1], RequestFailed("gone.binary: cannot be read"))
    editor.tick(0.2)
    editor.tables.request_table(unread)
    assert editor.tables.refusal(unread) == "gone.binary: cannot be read" and not editor.tables.refusal(measurement)
    assert not editor.status.is_error and len(client.sent(FetchTable)) == 2
    editor.open("shelf")
    client.open_scene()
    editor.tick(0.3)
    editor.tables.request_table(unread)
    assert len(client.sent(FetchTable)) == 3


def test_a_material_is_exported_by_the_worker(client: FakeClient, tmp_path: Path) -> None:
    editor = Editor(client, "shelf")
    client.open_scene()
    editor.tick(0.0)
    assert editor.exchange.export_measured(tmp_path / "pot.binary") is None
    (asked,) = client.sent(WriteFiles)
    assert asked.layers == editor.document.object("pot").layers
    answers = run_in_process(RequestDispatcher(ArrayCache(tmp_path / "cache")), asked)
    samples = merl_samples(read_merl(tmp_path / "pot.binary"), tmp_path / "pot.binary")
    assert samples.max() > 0.2 and {type(answer) for answer in answers} == {Progress, FilesWritten}
    client.answer(asked, answers[-1])
    editor.tick(0.1)
    assert editor.status.message == f"written {tmp_path / 'pot.binary'}" and not editor.status.is_error


def test_an_import_needs_an_object(client: FakeClient, tmp_path: Path) -> None:
    editor = Editor(client, "shelf")
    client.open_scene()
    editor.tick(0.0)
    editor.select(None)
    assert "select the object" in str(editor.exchange.import_measured(tmp_path / "x.binary"))
    editor.select("pot")
    editor.do(SetFrozen("pot", True))
    assert "frozen" in str(editor.exchange.import_measured(tmp_path / "x.binary")) and not client.sent(ReadMeasured)


def test_a_path_gives_an_object_what_was_measured(client: FakeClient, tmp_path: Path) -> None:
    editor = Editor(client, "shelf")
    client.open_scene()
    editor.tick(0.0)
    assert set_path(editor.document, "pot.material", "x.binary") == import_measured("pot", Path("x.binary"))


def test_sessions_and_materials_name_the_file(client: FakeClient, tmp_path: Path) -> None:
    # Relative to the session's folder, so that both can move; read again when the session is opened.
    editor = Editor(client, "shelf")
    client.open_scene()
    editor.tick(0.0)
    file = tmp_path / "data" / "drawn.binary"
    measurement = replace(drawn_measurement(), file=str(file))
    editor.do(import_measured("pot", file))
    client.answer(client.sent(ReadMeasured)[-1], MeasurementsRead({str(file): measurement}))
    editor.tick(0.1)
    assert editor.save(tmp_path / "x.insitu") is None
    assert 'file = "data/drawn.binary"' in (tmp_path / "x.insitu").read_text()
    session = load_session(tmp_path / "x.insitu")
    assert unread_files(session.document.object("pot").layers) == (str(file),)
    other = Editor(client, str(tmp_path / "x.insitu"))
    opening = client.sent(OpenScene)[-1]
    assert opening.measured == (str(file),)
    client.open_scene(measurements={str(file): measurement})
    other.tick(0.0)
    assert other.document.objects == editor.document.objects
    text = dump_material(Material("drawn", editor.document.object("pot").layers))
    assert unread_files(parse_material(text, "the clipboard").layers) == (str(file),)
    (tmp_path / "drawn.toml").write_text(text.replace(str(file), "data/drawn.binary"))
    assert unread_files(load_material(tmp_path / "drawn.toml").layers) == (str(file),)


def test_measured_layers_are_of_one_file(tmp_path: Path) -> None:
    found = [measurement_in(layer) for layer in measured_layers(tmp_path / "x.binary")]
    assert found[0] == found[1] and found[0] is not None and not found[0].is_read
    with pytest.raises(InsituError, match="has not been read"):
        tables.table_of(12345)
