"""Stored pictures: named, replaced, read one after the other, forgotten; and random sequences of all of it."""

from __future__ import annotations

import random
from pathlib import Path

import numpy as np
import pytest

from app.editor.editor import Editor
from app.editor.stored_pictures import MOST_PICTURES
from app.messages.file_messages import PictureRead, ReadPicture
from app.messages.worker_messages import RequestFailed, WorkerRestarted
from app.operators.registry import run_operator
from engine.core.errors import InsituError
from tests.app.fake_worker import FakeClient


def light(value: float = 1.0) -> np.ndarray:
    return np.full((2, 3, 4), value, np.float32)


@pytest.fixture
def editor(client: FakeClient) -> Editor:
    editor = Editor(client, "shelf")
    client.open_scene()
    editor.tick(0.0)
    return editor


def test_pictures_get_names_and_the_last_one_is_compared(editor: Editor) -> None:
    for value in (1.0, 2.0):
        editor.stored.store(light(value))
    assert editor.stored.names == ("Picture 1", "Picture 2") and editor.view.stored == "Picture 2"
    editor.stored.store(light(3.0), "Picture 1")  # replaced
    assert editor.stored.names == ("Picture 1", "Picture 2")
    assert editor.stored.compared is not None and editor.stored.compared.light[0, 0, 0] == 3.0
    editor.stored.remove("Picture 1")
    assert editor.view.stored == "" and editor.stored.compared is None and editor.stored.names == ("Picture 2",)


def test_a_comparison_with_a_stored_picture_ends_that_of_a_document_and_the_reverse(editor: Editor) -> None:
    assert run_operator(editor, "compare") is None and editor.view.compare is not None
    editor.stored.store(light())
    assert editor.view.compare is None and editor.view.stored
    assert run_operator(editor, "compare") is None and not editor.view.stored


def test_what_cannot_be_is_one_line(editor: Editor) -> None:
    assert run_operator(editor, "compare_with", "Night") == "there is no stored picture 'Night'; none is stored yet"
    for _ in range(MOST_PICTURES):
        editor.stored.store(light())
    with pytest.raises(InsituError, match="remove one first"):
        editor.stored.store(light())
    with pytest.raises(InsituError, match="expected 1 to"):
        editor.stored.store(light(), " ")


def test_files_are_read_one_after_the_other(editor: Editor, client: FakeClient, tmp_path: Path) -> None:
    for name in ("a.exr", "broken.png", "a.exr"):
        editor.stored.load(tmp_path / name)
    (first,) = client.sent(ReadPicture)
    assert not first.may_have_gaps  # an error is measured
    client.answer(first, PictureRead(light()))
    editor.tick(0.1)
    assert editor.view.stored == "a.exr" and editor.stored.is_reading
    client.answer(client.sent(ReadPicture)[1], RequestFailed("broken.png: first bytes = b'', expected a picture"))
    editor.tick(0.2)
    assert "broken.png" in editor.status.message and editor.status.is_error and editor.view.stored == "a.exr"
    client.answer(client.sent(ReadPicture)[2], PictureRead(light(5.0)))
    editor.tick(0.3)
    assert editor.stored.names == ("a.exr", "a.exr 2") and not editor.stored.is_reading
    stored = editor.stored.picture("a.exr 2")
    assert stored.size == (3, 2) and stored.light[0, 0, 0] == 5.0


def test_pictures_of_a_file_are_told_from_those_that_only_have_its_name(
    editor: Editor, client: FakeClient, tmp_path: Path
) -> None:
    here, there = tmp_path / "here" / "cup.exr", tmp_path / "there" / "cup.exr"
    for file in (here, there):
        editor.stored.load(file)
        client.answer(client.sent(ReadPicture)[-1], PictureRead(light()))
        editor.tick(0.1)
    assert editor.stored.names_of(here) == ("cup.exr",) and editor.stored.names_of(there) == ("cup.exr 2",)
    editor.stored.store_file(light(3.0), there)  # in its place, and not in that of the other
    assert editor.view.stored == "cup.exr 2" and editor.stored.picture("cup.exr").light[0, 0, 0] == 1.0
    editor.stored.store(light(), "cup.exr")
    assert editor.stored.names_of(here) == ()
    editor.stored.store_file(light(4.0), here)
    assert editor.view.stored == "cup.exr 3" and editor.stored.names == ("cup.exr", "cup.exr 2", "cup.exr 3")


def test_a_worker_that_ends_takes_only_the_file_with_it(editor: Editor, client: FakeClient, tmp_path: Path) -> None:
    for name in ("bomb.exr", "b.exr"):
        editor.stored.load(tmp_path / name)
    client.answer(client.sent(ReadPicture)[0], WorkerRestarted("killed"))
    editor.tick(0.1)
    assert [Path(each.file).name for each in client.sent(ReadPicture)] == ["bomb.exr", "b.exr"]


@pytest.mark.parametrize("seed", range(8))
def test_random_sequences_leave_it_valid(editor: Editor, client: FakeClient, tmp_path: Path, seed: int) -> None:
    """What is compared is stored, names are their order's, and the view is never of two comparisons."""
    chance, model, files = random.Random(seed), dict[str, float](), dict[str, Path]()
    due: list[ReadPicture] = []
    for step in range(120):
        kind = chance.choice(("store", "replace", "load", "answer", "fail", "restart", "remove", "choose", "compare",
                              "difference", "store_file"))  # fmt: skip
        known = len(client.sent(ReadPicture))
        match kind:
            case "store" if len(model) < MOST_PICTURES:
                editor.stored.store(light(step))
                model[editor.view.stored] = step
            case "replace" if model:
                name = chance.choice([*model])
                editor.stored.store(light(step), name)
                model[name] = step
                files.pop(name, None)
            case "store_file":
                file, names = tmp_path / f"{chance.randrange(3)}.exr", [*model]
                of_it = [name for name in names if files.get(name) == file]
                if not of_it and len(model) == MOST_PICTURES:
                    with pytest.raises(InsituError, match="remove one first"):
                        editor.stored.store_file(light(step), file)
                else:
                    editor.stored.store_file(light(step), file)
                    assert editor.view.stored == of_it[-1] if of_it else editor.view.stored not in names
                    model[editor.view.stored], files[editor.view.stored] = step, file
            case "load":
                editor.stored.load(tmp_path / f"{chance.randrange(3)}.exr")
            case "answer" if due:
                before, file = editor.view.stored, Path(due[-1].file)
                client.answer(due.pop(), PictureRead(light(step)))
                editor.tick(float(step))
                if len(model) < MOST_PICTURES:
                    assert editor.view.stored not in model
                    model[editor.view.stored], files[editor.view.stored] = step, file
                else:
                    assert editor.view.stored == before and editor.status.is_error
            case "fail" if due:
                client.answer(due.pop(), RequestFailed("no"))
                editor.tick(float(step))
            case "restart" if due:
                client.answer(due.pop(), WorkerRestarted("killed"))
                editor.tick(float(step))
            case "remove" if model:
                name = chance.choice([*model])
                assert run_operator(editor, "remove_stored", name) is None
                del model[name]
                files.pop(name, None)
            case "choose" if model:
                assert run_operator(editor, "compare_with", chance.choice(["", *model])) is None
            case "compare":
                assert run_operator(editor, "compare") is None
            case "difference" if editor.view.stored:
                assert run_operator(editor, "difference") is None
        due += client.sent(ReadPicture)[known:]
        view = editor.view
        assert len(due) <= 1 and editor.stored.is_reading == bool(due)
        assert editor.stored.names == tuple(model) and (view.stored in model or view.stored == "")
        assert not (view.stored and view.compare is not None)
        for name, value in model.items():
            assert editor.stored.picture(name).light[0, 0, 0] == value
            assert editor.stored.picture(name).file == files.get(name)
