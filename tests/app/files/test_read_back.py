"""What is saved can be opened again: read back before it takes the place of what was there; one window knows of the
other."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import pytest

from app.document.commands.light import SetIntensity, SetRotation
from app.document.document import Document
from app.document.view_state import ViewState
from app.editor.editor import Editor
from app.files.journal import WRITE_SECONDS, Journal, recoverable_sessions
from app.files.known_file import KnownFile
from app.files.materials import Material, load_material, save_material
from app.files.session import load_session, save_session, write_session
from engine.core.errors import InsituError
from engine.material import MODELS, make_layer
from engine.realtime.zonal_harmonics.pose import Moment
from tests.app.fake_worker import FakeClient

# As the system hands out a name of bytes that are no UTF-8, and names that look like what is written of such a one.
NAMES = ["caf\udce9.toml", "file:caf%E9.toml", "file:", "a b%41.toml", "ä☀.toml", 'x"\\\n.toml', "a" * 250 + ".toml"]


def named(document: Document, folder: Path, name: str) -> Document:
    """The document of a scene, and under light, of that name."""
    light = replace(document.light, environment=str(folder / f"{name}.exr"))
    return replace(document, source=str(folder / name / "scene.toml"), light=light)


@pytest.mark.parametrize("name", NAMES)
def test_any_name_of_a_file_comes_back(document: Document, tmp_path: Path, name: str) -> None:
    for folder in (tmp_path, Path("/elsewhere")):  # relative to the session, and in full
        wanted = named(document, folder, name)
        assert load_session(save_session(tmp_path / "s.insitu", wanted, ViewState())).document == wanted
        (tmp_path / "s.insitu").read_bytes().decode()


@pytest.mark.parametrize("name", NAMES)
def test_the_journal_keeps_edits_of_a_scene_of_any_name(document: Document, tmp_path: Path, name: str) -> None:
    journal, wanted = Journal(tmp_path / "journal"), named(document, tmp_path, name)
    session = tmp_path / f"{name}.insitu"
    journal.note(10.0, wanted, ViewState(), True, KnownFile(session, "12ab"))
    journal.close(keep=True)
    assert not journal.problem
    (recovery,) = recoverable_sessions(tmp_path / "journal")
    assert recovery.session_path == session
    found = recovery.load()
    assert found.document == wanted and found.journal is not None and found.journal.session_digest == "12ab"


def unreadable(document: Document) -> list[Document]:
    """Documents that no file can hold so that it is read again, whatever else keeps them from coming about."""
    pot = document.object("pot")
    clips = ["x" * 5000, "", "half \ud83d"]
    posed = [document.with_object(replace(pot, moment=Moment(clip, 0.5))) for clip in clips]
    return [*posed, document.with_object(replace(pot, layers=pot.layers * 40))]


def test_what_could_not_be_opened_again_replaces_nothing(document: Document, tmp_path: Path) -> None:
    path = save_session(tmp_path / "s.insitu", document, ViewState())
    before = path.read_bytes()
    for wrong in unreadable(document):
        with pytest.raises(InsituError) as caught:
            save_session(path, wrong, ViewState())
        assert "\n" not in str(caught.value)
        assert path.read_bytes() == before and os.listdir(tmp_path) == ["s.insitu"]


def test_the_journal_keeps_the_last_document_that_can_be_read_and_goes_on(document: Document, tmp_path: Path) -> None:
    journal, now = Journal(tmp_path), 10.0
    good = [SetRotation(angle).apply(document) for angle in (1.0, 2.0)]
    for wrong in unreadable(document):
        for each in (good[0], wrong):
            now += WRITE_SECONDS
            journal.note(now, each, ViewState(), True)
            _wait_for(journal, each)
        assert journal.problem.startswith("autosave failed: ")
        assert load_session(journal.path).document == good[0]
    journal.note(now + WRITE_SECONDS, good[1], ViewState(), True)
    journal.close(keep=True)
    assert not journal.problem and load_session(journal.path).document == good[1]


def _wait_for(journal: Journal, document: Document) -> None:
    """Until the thread is done with it."""
    import time

    end = time.monotonic() + 10.0
    while journal.written is not document and not journal.problem and time.monotonic() < end:
        time.sleep(0.005)


def test_a_material_is_read_back_as_well(tmp_path: Path) -> None:
    path, layers = tmp_path / "gold.toml", (make_layer(MODELS["rough_conductor"], {"alpha": 0.2}, "coat"),)
    save_material(path, Material("gold", layers))
    for name in ("", "g" * 65, "half \ud83d"):
        with pytest.raises(InsituError):
            save_material(path, Material(name, layers))
    assert load_material(path).name == "gold"


# ------------------------------------------------------------------------------------------------------ two windows


def window(path: Path, *, journal: Journal | None = None) -> Editor:
    """An editor of that session."""
    client = FakeClient()
    editor = Editor(client, str(path), journal=journal)
    client.open_scene()
    editor.tick(0.0)
    assert editor.session.path == path
    return editor


@pytest.fixture
def session(document: Document, tmp_path: Path) -> Path:
    return save_session(tmp_path / "s.insitu", document, ViewState())


def test_the_second_window_does_not_save_over_the_first(session: Path) -> None:
    one, other = window(session), window(session)
    for editor, intensity in ((one, 2.0), (other, 3.0)):
        editor.do(SetIntensity(intensity))
    assert one.save() is None and not one.session.has_changed
    assert one.save() is None  # its own writing is no change
    line = other.save()
    assert line is not None and "written elsewhere since it was opened here" in line and other.session.is_unsaved
    assert load_session(session).document.light.intensity == 2.0
    assert other.save(session.with_name("other.insitu")) is None and not other.session.has_changed
    assert load_session(session).document.light.intensity == 2.0
    # Whoever names the file means to replace it.
    other.do(SetIntensity(4.0))
    assert other.save(session) is None and load_session(session).document.light.intensity == 4.0
    assert one.session.has_changed
    session.unlink()
    assert one.save() is None  # there is nothing to lose


def test_so_it_is_after_a_crash(session: Path, tmp_path: Path) -> None:
    journal = Journal(tmp_path / "journal")
    one = window(session, journal=journal)
    one.do(SetIntensity(2.0))
    one.tick(1.0)
    one.close()
    write_session(session, SetIntensity(5.0).apply(load_session(session).document), ViewState())
    (recovery,) = recoverable_sessions(tmp_path / "journal")
    client = FakeClient()
    later = Editor(client, "shelf")
    client.open_scene()
    later.tick(0.0)
    later.recover(recovery)
    client.open_scene()
    later.tick(1.0)
    assert later.document.light.intensity == 2.0 and later.session.path == session
    assert "written elsewhere" in str(later.save()) and load_session(session).document.light.intensity == 5.0
