"""What is said on screen has the names that panels give."""

import pytest

from app.document.commands.layers import SetParameter
from app.document.display_names import with_display_names
from tests.ui.stand_in import StandInClient
from ui.headless import HeadlessWindow


@pytest.mark.gl
@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("undone: teapot.1 theta_h Translate Y", "undone: teapot / coat half Translate Y"),
        ("teapot.1 alpha", "teapot / coat Roughness α"),
        ("give teapot.0 its Fresnel term", "give teapot / base its Fresnel term"),
        ("teapot.0, tray.0: shown as it was", "teapot / base, tray / Rough metal: shown as it was"),
        ("teapot.1", "teapot / coat"),
        ("teapot.1.alpha: value = 7, expected less", "teapot.1.alpha: value = 7, expected less"),
        ("teapot.10 and big teapot.1x", "teapot.10 and big teapot.1x"),
    ],
)
def test_layers_curves_and_parameters_have_their_names(window: HeadlessWindow, text: str, said: str) -> None:
    assert with_display_names(window.shell.editor.document, text) == said


@pytest.mark.gl
def test_what_was_undone_is_reported_by_name(window: HeadlessWindow) -> None:
    editor = window.shell.editor
    assert isinstance(editor._client, StandInClient)
    editor.do(SetParameter("teapot.1", "alpha", 0.3))
    window.frames(2)
    assert window.shell._context(0.0).undo_label == "teapot / coat Roughness α"
    editor.undo()
    window.frames(2)
    notice = window.shell.state.message
    assert notice is not None and notice.text == "undone: teapot / coat Roughness α"
