"""Opening what people have, in the real window: a mesh, light, a broken file; the window is of use after each."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.app.test_project import TETRAHEDRON
from tests.pictures import write_exr
from tests.ui.real_window import opened

pytestmark = pytest.mark.window


def test_broken_files_meshes_and_light(tmp_path: Path) -> None:
    (tmp_path / "torn.ply").write_text(TETRAHEDRON[:-10])
    (tmp_path / "thing.ply").write_text(TETRAHEDRON)
    (tmp_path / "toy.fbx").write_bytes(b"")
    write_exr(tmp_path / "probe.exr", np.full((4, 8, 3), 3.0, np.float32))
    with opened(tmp_path, str(tmp_path / "torn.ply"), resolution=(32, 32)) as real:
        assert real.ask("editor.document.source") == "teatray"
        assert "rows in the body = 7, expected 8" in real.notice() and "teatray is open instead" in real.notice()
        real.events(("drop", (str(tmp_path / "thing.ply"),)))
        real.wait_until("editor.document.source.endswith('thing.ply') and editor.status.picture != 'waiting'", 150.0)
        assert real.notice() == "opened thing; thing: without a material, shown in a grey that can be edited"
        real.events(("drop", (str(tmp_path / "probe.exr"),)))
        real.wait_until("editor.document.light.environment.endswith('probe.exr')")
        real.events(("drop", (str(tmp_path / "toy.fbx"),)))
        assert "toy.fbx: " in real.notice() and "expected a scene" in real.notice()
        real.do(f"editor.save(__import__('pathlib').Path({str(tmp_path / 'work.insitu')!r}))")
        document = real.ask("editor.document")
        real.do("editor.open('shapes')")
        real.wait_until("editor.document.source == 'shapes'")
        real.events(("drop", (str(tmp_path / "work.insitu"),)))
        real.wait_until("editor.document.source.endswith('thing.ply') and editor.status.picture != 'waiting'", 150.0)
        assert real.ask("editor.document") == document
