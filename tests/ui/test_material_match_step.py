"""A script's step that matches a material: the edit that Python has, and one line where it cannot be done."""

from __future__ import annotations

from pathlib import Path

import moderngl
import pytest

import insitu
from app.operators.script import load_script
from app.worker.cache import ArrayCache
from app.worker.schedule import InProcessClient
from app.worker.tasks import RequestDispatcher
from tests.ui.small_scene import opened_window, write_small_scene
from ui.script_runner import ScriptError, run_steps, wait_for_scene

pytestmark = pytest.mark.gl


def test_it_is_the_edit_that_python_has(context: moderngl.Context, tmp_path: Path) -> None:
    source = write_small_scene(tmp_path)
    script = tmp_path / "a.toml"
    client = InProcessClient(RequestDispatcher(ArrayCache(tmp_path / "cache")))
    with opened_window(context, source, client) as window:
        editor = window.shell.editor
        wait_for_scene(window, editor)
        before = editor.document
        for value, line in (
            ('object = "ball", source = "Gold", model = "glass"', "step 1: there is no model 'glass'"),
            ('object = "ball", source = "gold.binary", model = "ward"', "gold was not matched: .*gold.binary"),
        ):
            script.write_text(f"[[step]]\nmatch_material = {{ {value} }}\n")
            with pytest.raises(ScriptError, match=line):
                run_steps(window, editor, load_script(script))
            assert editor.document == before and not editor.material_matching.progress
        script.write_text('[[step]]\nmatch_material = { object = "ball", source = "Terracotta", model = "lambert" }\n')
        run_steps(window, editor, load_script(script))
        found = editor.document.object("ball").layers
        scene = insitu.open(source)
        errors = scene.match_material("ball", "lambert", "Terracotta")
        assert scene.document.object("ball").layers == found
        assert editor.status.material_match_note == ("ball", f"Diffuse, as Terracotta: error {errors.text}")
        assert editor.undo() == "Diffuse, as Terracotta on ball" and editor.document == before
