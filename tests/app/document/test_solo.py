"""One layer seen alone: what is shown of which object, and that it is no edit."""

from dataclasses import replace

from app.document.document import Document, ObjectState
from app.document.solo import is_layer_visible, solo_layer, toggle_solo
from app.document.view_state import ViewState
from engine.material import MODELS, make_layer

BASE, COAT = make_layer(MODELS["lambert"], name="base"), make_layer(MODELS["ward"], name="coat").with_fresnel(0.5)
TERM = COAT.replace(name="fresnel", follows="coat", rises=True)
POT, TRAY = ObjectState("pot", (BASE, COAT, TERM)), ObjectState("tray", (BASE, BASE.replace(name="two")))
DOCUMENT = Document("x", (POT, TRAY))


def seen(document: Document, view: ViewState) -> list[str]:
    return [key for key, _ in document.layers() if is_layer_visible(document, view, key)]


def test_solo_hides_the_others_of_its_object() -> None:
    view = toggle_solo(ViewState(), "pot.0").apply(ViewState())
    assert view.solo == "pot.0" and seen(DOCUMENT, view) == ["pot.0", "tray.0", "tray.1"]
    assert seen(DOCUMENT, toggle_solo(view, "pot.0").apply(view)) == ["pot.0", "pot.1", "pot.2", "tray.0", "tray.1"]


def test_a_fresnel_term_stays_with_its_layer() -> None:
    assert seen(DOCUMENT, ViewState(solo="pot.1")) == ["pot.1", "pot.2", "tray.0", "tray.1"]


def test_a_hidden_layer_is_seen_alone_and_hidden_objects_stay_so() -> None:
    hidden = DOCUMENT.with_layer("pot.0", BASE.replace(visible=False))
    assert seen(hidden, ViewState(solo="pot.0")) == ["pot.0", "tray.0", "tray.1"]
    assert seen(hidden, ViewState()) == ["pot.1", "pot.2", "tray.0", "tray.1"]
    away = DOCUMENT.with_object(replace(DOCUMENT.object("pot"), visible=False))
    assert seen(away, ViewState(solo="pot.0")) == ["tray.0", "tray.1"]


def test_a_layer_that_is_gone_hides_nothing() -> None:
    view = ViewState(solo="pot.7")
    assert solo_layer(DOCUMENT, view) is None and len(seen(DOCUMENT, view)) == 5
