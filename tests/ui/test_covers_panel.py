"""The rows of covers and variants in the material panel: chosen, shown in words, and undone."""

from __future__ import annotations

from dataclasses import replace

import pytest

from app.document.commands.layers import AddLayers, SetVariant, new_layer
from app.document.document import Variant
from app.messages.worker_messages import OpenScene
from engine.scene.import_report import ImportReport
from engine.scene.loaders.model import VariantSet
from ui.headless import HeadlessWindow
from ui.panels.material import _cover_note

pytestmark = pytest.mark.gl


def test_what_lies_on_a_layer_is_chosen(window: HeadlessWindow) -> None:
    editor = window.shell.editor
    editor.do(AddLayers("teapot", (new_layer("clearcoat"),)))
    editor.select("teapot.0")
    window.frames(2)
    coated = editor.document.layer("teapot.0")
    # 4 % head-on; at 80 degrees 0.04 + 0.96 (1 - cos 80)^5 = 41 %.
    assert _cover_note(coated) == "Clear coat on it takes 4 % of it, seen head-on, and 41 % at 80°."
    window.click_handle("material.under")
    window.frames(2)
    window.click_handle("material.under.Nothing")
    window.frames(2)
    bare = editor.document.layer("teapot.0")
    assert bare.under == "" and _cover_note(bare) == ""
    editor.undo()
    assert editor.document.layer("teapot.0") == coated


def test_a_variant_is_chosen(window: HeadlessWindow) -> None:
    editor = window.shell.editor
    document = editor.document
    pot, gold = document.object("teapot"), (new_layer("microfacet"),)
    looks = (Variant("plain", pot.layers), Variant("gold", gold))
    editor.history.document = document.with_object(replace(pot, variants=looks))
    window.frames(2)
    window.click_handle("material.variant")
    window.frames(2)
    window.click_handle("material.variant.gold")
    window.frames(2)
    assert editor.document.object("teapot").layers == gold and editor.document.variant == "gold"
    assert SetVariant("plain").apply(editor.document).object("teapot").layers == pot.layers


def test_a_variant_of_a_stage_is_opened_again(window: HeadlessWindow) -> None:
    editor = window.shell.editor
    editor.history.document = replace(editor.document, source="/models/room.usda")
    sets = (VariantSet("shape", ("low", "tall"), "low"), VariantSet("size", ("big", "small")))
    editor.scenes.report = ImportReport(variant_sets=sets)
    window.frames(2)
    window.click_handle("material.set.shape")
    window.frames(2)
    window.click_handle("material.set.shape.tall")
    requests = editor._client.requests  # type: ignore[attr-defined]
    assert [each.source for each in requests if isinstance(each, OpenScene)][-1] == "/models/room.usda#shape=tall"
