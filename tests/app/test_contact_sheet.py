"""Contact sheets: the command line's page has each look's own still in its place, and saving one in the background."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from app.document.commands import AddLook, SetBackground, SetParameter
from app.document.document import Document
from app.document.view_state import SetView, ViewState
from app.files.session import save_session
from app.project.project import open_project
from app.stills.contact_sheet import LEAST_GAP, chosen_looks, columns_of_page, linear_files, page, sheet_of
from app.stills.layer_saver import LayerSaver
from engine.core.errors import InsituError
from engine.light.radiance_files import read_radiance_image
from engine.render.display import display_picture
from tests.app.cli.command_line import run
from tests.scene_text import LAMBERT, camera, environment, facing_up, placed

SIZE = 12, 9
SCENE = (
    camera((0.0, 1.0, 3.0), 40, SIZE, (0, 0.3, 0), "bounces = 1\n") + environment((0.4, 0.5, 0.7))
    + placed("ground", "quad", facing_up(1), LAMBERT)
)  # fmt: skip
VIEW = SetView.of(n_bounces=1).apply(ViewState())


@pytest.fixture
def document(tmp_path: Path) -> Document:
    """A scene of three looks: as it is, of a dark ground, and of that over one colour."""
    (tmp_path / "scene.toml").write_text(SCENE)
    document = open_project(str(tmp_path / "scene.toml")).document
    for command in (
        AddLook("Dark"), SetParameter("ground.0", "albedo", 0.1), AddLook("Plain, dark"), SetBackground("colour")
    ):  # fmt: skip
        document = command.apply(document)
    return document


def test_the_sheet_has_the_still_of_each_look(
    document: Document, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    session, sheet = save_session(tmp_path / "looks.insitu", document, VIEW), tmp_path / "sheet.png"
    names = "Plain, dark,Look 1"
    assert run("contact-sheet", session, "-o", sheet, "--looks", names, "--columns", "1", "--exr") == 0
    assert "2 looks of 12 x 9" in capsys.readouterr().out
    pixels = np.asarray(Image.open(sheet))
    for n, name in enumerate(("Plain, dark", "Look 1")):
        still = tmp_path / f"{n}.exr"
        assert run("render", session, "-o", still, "--look", name) == 0
        picture = read_radiance_image(still)
        linear = linear_files(sheet, sheet_of(open_project(str(session)), names, writes_linear=True))[n]
        np.testing.assert_array_equal(read_radiance_image(linear), picture)
        below = LEAST_GAP + n * (SIZE[1] + 2 * 11 + LEAST_GAP)
        shown = pixels[below : below + SIZE[1], LEAST_GAP : LEAST_GAP + SIZE[0]]
        np.testing.assert_array_equal(shown, display_picture(picture))


def test_what_makes_no_sense_is_refused_in_a_line(
    document: Document, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    session = save_session(tmp_path / "looks.insitu", document, VIEW)
    for words, says in (
        ((session, "--looks", "Brass"), "there is no look 'Brass'; looks of this scene: Look 1, Dark, Plain, dark"),
        ((tmp_path / "scene.toml",), "there are no looks"),
        ((session, "--width", "16384", "--columns", "3"), "more than 16384 pixels per side"),
    ):
        assert run("contact-sheet", *words, "-o", tmp_path / "sheet.png") != 0
        assert says in capsys.readouterr().err
    assert run("contact-sheet", session, "-o", tmp_path / "sheet.exr") != 0
    assert not [*tmp_path.glob("sheet*")]


def test_names_with_commas_are_found() -> None:
    names = ("A", "A, B", "C")
    assert chosen_looks("A, B,C", names) == ("A, B", "C") and chosen_looks("C,A", names) == ("C", "A")
    with pytest.raises(InsituError, match="no look 'D'"):
        chosen_looks("A,D", names)


def test_a_page_is_about_as_wide_as_a_screen_with_few_empty_places() -> None:
    # Of wide pictures one column less; six of them fill 3 x 2, five leave one place.
    assert [columns_of_page(n, 100, 100) for n in (1, 2, 4, 5, 6, 9)] == [1, 2, 2, 3, 3, 3]
    assert columns_of_page(6, 200, 100) == 2
    white = np.full((9, 12, 3), 255, np.uint8)
    assert page([("a", white)] * 5, 2).shape == (3 * (9 + 22 + 6) + 6, 2 * (12 + 6) + 6, 3)
    # A name is no wider than its picture: beside the pictures the page is empty.
    assert (page([("a name that is far too long", white)])[:, -6:] == 24).all()


def test_a_sheet_is_saved_while_the_editor_goes_on(document: Document, tmp_path: Path) -> None:
    saver = LayerSaver()
    try:
        saver.save(document, VIEW, tmp_path / "sheet.png")
        until = time.monotonic() + 120.0
        while not (said := saver.finished_messages()):
            assert time.monotonic() < until
            time.sleep(0.02)
    finally:
        saver.close()
    assert said == [(f"saved {tmp_path / 'sheet.png'} with 3 looks", False)]
    session = save_session(tmp_path / "looks.insitu", document, VIEW)
    assert run("contact-sheet", session, "-o", tmp_path / "same.png") == 0
    assert (tmp_path / "sheet.png").read_bytes() == (tmp_path / "same.png").read_bytes()
