"""Unsaved edits are on disk within a second, and offered again after the editor's end, whatever ended it."""

import subprocess
import sys
import textwrap
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from app.document.commands.light import SetIntensity, SetRotation
from app.document.document import Document
from app.document.view_state import ViewState
from app.editor.editor import Editor
from app.files.journal import RETRY_SECONDS, WRITE_SECONDS, Journal, recoverable_sessions
from app.files.known_file import KnownFile
from app.files.session import load_session, save_session
from tests.app.fake_worker import FakeClient
from tests.app.limits import largest_file


def opened(client: FakeClient, journal: Journal | None) -> Editor:
    editor = Editor(client, "shelf", journal=journal)
    client.open_scene()
    editor.tick(0.0)
    return editor


def test_edits_are_written_soon_and_offered_after_the_end(document: Document, tmp_path: Path) -> None:
    journal = Journal(tmp_path)
    journal.note(10.0, document, ViewState(exposure=1.0), True, KnownFile(Path("/home/mine.insitu")))
    assert recoverable_sessions(tmp_path) == []  # its editor lives
    journal.close(keep=True)
    (recovery,) = recoverable_sessions(tmp_path)
    assert recovery.scene == "shelf" and recovery.session_path == Path("/home/mine.insitu")
    session = recovery.load()
    assert session.document == document and session.view.exposure == 1.0
    recovery.discard()
    assert list(tmp_path.iterdir()) == []


def test_writing_is_at_most_half_a_second_behind(document: Document, tmp_path: Path) -> None:
    journal = Journal(tmp_path)
    later = SetRotation(1.0).apply(document)
    journal.note(10.0, document, ViewState(), True)
    journal.note(10.1, later, ViewState(), True)  # too soon after the first
    journal.note(10.0 + WRITE_SECONDS, later, ViewState(), True)
    journal.close(keep=True)
    assert load_session(journal.path).document == later


def test_nothing_unsaved_leaves_nothing(document: Document, tmp_path: Path) -> None:
    journal = Journal(tmp_path)
    journal.note(10.0, document, ViewState(), True)
    journal.note(20.0, document, ViewState(), False)  # saved meanwhile
    journal.close(keep=True)
    assert not journal.path.exists()


def test_a_clean_end_removes_the_journal(document: Document, tmp_path: Path) -> None:
    journal = Journal(tmp_path)
    journal.note(10.0, document, ViewState(), True)
    journal.close()
    assert list(tmp_path.iterdir()) == []


def test_damaged_journals_are_not_offered(document: Document, tmp_path: Path) -> None:
    save_session(tmp_path / "good.insitu", document, ViewState())
    text = (tmp_path / "good.insitu").read_text()
    (tmp_path / "bad.insitu").write_text(text[: text.rindex('"')])
    assert [recovery.path.name for recovery in recoverable_sessions(tmp_path)] == ["good.insitu"]


def test_a_full_disk_is_reported_and_tried_again(client: FakeClient, tmp_path: Path) -> None:
    journal = Journal(tmp_path)
    editor = opened(client, journal)
    with largest_file(10):
        editor.do(SetIntensity(2.0))
        editor.tick(1.0)
        wait_until(lambda: journal.problem != "")
    assert "autosave failed" in journal.problem and not journal.path.exists()
    editor.tick(1.1)
    assert "autosave failed" in editor.status.message and editor.status.is_error
    editor.tick(1.0 + RETRY_SECONDS)
    editor.close()
    assert journal.problem == "" and load_session(journal.path).document == editor.document


def wait_until(is_so: Callable[[], bool]) -> None:
    """Let the journal's thread work; ten seconds at most."""
    deadline = time.monotonic() + 90.0
    while not is_so() and time.monotonic() < deadline:
        time.sleep(0.001)


EDITOR = textwrap.dedent("""
    import sys, time
    from app.document.commands.light import SetIntensity
    from app.editor.editor import Editor
    from app.files.journal import Journal
    from tests.app.fake_worker import FakeClient

    client = FakeClient()
    editor = Editor(client, "shelf", journal=Journal())
    client.open_scene()
    editor.tick()
    number = 0
    while True:
        number += 1
        editor.do(SetIntensity(float(number)), "drag")
        editor.tick()
        print(number, flush=True)
        time.sleep(0.01)
""")


def test_a_killed_editor_loses_less_than_a_second(state_folder: Path) -> None:
    with subprocess.Popen([sys.executable, "-c", EDITOR], stdout=subprocess.PIPE, text=True) as running:
        assert running.stdout is not None
        numbers = [int(running.stdout.readline()) for _ in range(120)]
        running.kill()  # SIGKILL: no handler, no atexit
        numbers += [int(line) for line in running.stdout.read().split()]
    (recovery,) = recoverable_sessions(state_folder / "journals")
    # The edits came every 10 ms or slower, so that a second is at most 100 of them.
    assert recovery.load().document.light.intensity >= numbers[-1] - 100


def test_the_editor_recovers_and_then_keeps_its_own_journal(client: FakeClient, tmp_path: Path) -> None:
    first = opened(client, Journal(tmp_path))
    first.do(SetIntensity(7.0))
    first.tick(1.0)
    first.close()  # unsaved: the journal stays
    assert client.closed
    (recovery,) = recoverable_sessions(tmp_path)
    journal = Journal(tmp_path)
    second = opened(client, journal)
    assert second.recover(recovery) is None
    client.open_scene()
    second.tick(2.0)
    assert second.document == first.document and second.session.is_unsaved
    assert second.undo() is None  # recovered edits are where it starts
    assert recovery.path.exists()
    second.close()
    assert [found.path for found in recoverable_sessions(tmp_path)] == [journal.path]


def test_recovered_edits_that_are_saved_need_no_journal(client: FakeClient, tmp_path: Path, state_folder: Path) -> None:
    first = opened(client, Journal(tmp_path))
    first.do(SetIntensity(7.0))
    first.close()
    (recovery,) = recoverable_sessions(tmp_path)
    second = opened(client, Journal(tmp_path))
    second.recover(recovery)
    client.open_scene()
    second.tick(2.0)
    state_folder.mkdir()
    second.save(state_folder / "mine")
    second.tick(3.0)
    assert not recovery.path.exists()
    second.close()
    assert recoverable_sessions(tmp_path) == []


def test_unsaved_edits_outlive_the_opening_of_another_scene(client: FakeClient, tmp_path: Path) -> None:
    editor = opened(client, Journal(tmp_path))
    editor.do(SetIntensity(7.0))
    editor.open("another")
    client.open_scene()
    editor.tick(1.0)
    assert "can be recovered" in editor.status.message and not editor.session.is_unsaved
    (recovery,) = recoverable_sessions(tmp_path)
    assert recovery.load().document.light.intensity == 7.0
    editor.close()
    assert len(recoverable_sessions(tmp_path)) == 1


def test_saving_makes_the_journal_needless(client: FakeClient, tmp_path: Path) -> None:
    journal = Journal(tmp_path)
    editor = opened(client, journal)
    assert not editor.session.is_unsaved
    assert "needs a name" in (editor.save() or "")
    editor.do(SetIntensity(2.0))
    assert editor.session.is_unsaved
    assert editor.save(tmp_path / "mine") is None
    assert not editor.session.is_unsaved and editor.session.path == tmp_path / "mine.insitu"
    editor.do(SetIntensity(3.0))
    editor.undo()
    assert not editor.session.is_unsaved  # back at what was saved
    editor.close()
    assert not journal.path.exists()


def test_a_session_is_opened_with_its_scene(client: FakeClient, tmp_path: Path) -> None:
    editor = opened(client, None)
    editor.do(SetIntensity(5.0))
    editor.select("pot.0")
    editor.save(tmp_path / "mine")
    again = Editor(client, str(tmp_path / "mine.insitu"))
    client.open_scene()
    again.tick(0.0)
    assert again.document == editor.document and not again.session.is_unsaved
    assert again.view.selected == ("pot", 0, "theta_i")
    assert again.session.path == tmp_path / "mine.insitu"


@pytest.mark.parametrize("content", ["version = 9", "version = 1"])
def test_a_bad_session_leaves_all_as_it_is(client: FakeClient, tmp_path: Path, content: str) -> None:
    editor = opened(client, None)
    before, n_requests = editor.document, len(client.requests)
    (tmp_path / "bad.insitu").write_text(content)
    assert "nothing was changed" in (editor.open(str(tmp_path / "bad.insitu")) or "")
    assert editor.document is before and len(client.requests) == n_requests


def test_a_session_of_another_scene_opens_the_scene_alone(client: FakeClient, tmp_path: Path) -> None:
    editor = opened(client, None)
    editor.save(tmp_path / "mine")
    text = (tmp_path / "mine.insitu").read_text()
    for name in ("pot", "floor", "lamp"):
        text = text.replace(f'"{name}"', f'"other {name}"')
    (tmp_path / "mine.insitu").write_text(text)
    again = Editor(client, str(tmp_path / "mine.insitu"))
    client.open_scene()
    again.tick(0.0)
    assert again.scene_is_open and "without its session" in again.status.message
    assert again.session.path is None  # a save would not overwrite what did not fit


# ---------------------------------------------------------------------------------------- damaged, and nowhere to write


def notice_of(journal: Journal) -> str:
    wait_until(lambda: journal.warning != "")
    return journal.warning


def test_a_damaged_journal_is_kept_aside_and_reported_once(
    client: FakeClient, document: Document, tmp_path: Path
) -> None:
    save_session(tmp_path / "good.insitu", document, ViewState())
    text = (tmp_path / "good.insitu").read_text()
    for name, content in (("a", text[: text.rindex('"')]), ("b", "\0" * 500), ("newer", "version = 99")):
        (tmp_path / f"{name}.insitu").write_text(content)
    journal = Journal(tmp_path)
    line = notice_of(journal)
    assert "edits that were not saved cannot be read" in line and f"{tmp_path / 'a.damaged'}, and 1 more" in line
    assert (tmp_path / "a.damaged").read_text() == text[: text.rindex('"')] and (tmp_path / "b.damaged").exists()
    # A newer version can read its own, and will.
    assert (tmp_path / "newer.insitu").exists()
    assert [recovery.path.name for recovery in recoverable_sessions(tmp_path)] == ["good.insitu"]
    editor = opened(client, journal)
    assert editor.status.message == line and editor.status.is_error
    editor.notify("something else")
    editor.tick(1.0)
    assert editor.status.message == "something else"
    editor.close()
    # The next start meets none, and says nothing.
    again = Journal(tmp_path)
    again.close()
    assert again.warning == "" and (tmp_path / "a.damaged").exists()


def test_a_journal_whose_editor_lives_is_left_alone(document: Document, tmp_path: Path) -> None:
    living = Journal(tmp_path)
    while not living.path.with_suffix(".lock").exists() or living._lock is None:  # its thread takes it
        time.sleep(0.001)
    living.path.write_text("half a jour")
    other = Journal(tmp_path)
    other.close()
    assert other.warning == "" and living.path.exists()
    living.close()


@pytest.mark.parametrize("place", ["file/journals", "/proc/self/journals"])
def test_without_a_folder_for_it_the_editor_works_and_says_so_once(
    client: FakeClient, tmp_path: Path, place: str
) -> None:
    (tmp_path / "file").touch()
    journal = Journal(tmp_path / place)
    editor = opened(client, journal)
    assert editor.status.message.startswith(f"autosave failed: {tmp_path / place}: ") and editor.status.is_error
    for step in range(1, 4):
        assert editor.do(SetIntensity(1.0 + step)) is None
        editor.notify("something else")
        editor.tick(step * 2 * RETRY_SECONDS)
        assert editor.status.message == "something else"
    editor.close()


def test_a_folder_that_comes_back_is_used(document: Document, tmp_path: Path) -> None:
    """A disk that was not there at the start: the journal is locked, too, once it can be."""
    folder = tmp_path / "disk" / "journals"
    folder.parent.touch()
    journal = Journal(folder)
    wait_until(lambda: "autosave failed" in journal.problem and "Not a directory" in journal.problem)
    folder.parent.unlink()
    journal.note(10.0, document, ViewState(), True)
    wait_until(lambda: journal.written is not None)
    assert journal.problem == "" and recoverable_sessions(folder) == []  # its editor lives
    journal.close(keep=True)
    assert len(recoverable_sessions(folder)) == 1
