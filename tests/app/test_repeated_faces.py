"""Faces that a file has twice leave no flecks: the picture is that of the file that has each once."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import insitu

CORNERS = "".join(f"v {x} {y} {z}\n" for x in (0, 1) for y in (0, 1) for z in (0, 1))
SIDES = ["1 2 4 3", "5 7 8 6", "1 5 6 2", "3 4 8 7", "1 3 7 5", "2 6 8 4"]  # of a cube, wound outwards
FACES = "".join(f"f {side}\n" for side in SIDES)
TURNED = "".join(f"f {' '.join(side.split()[::-1])}\n" for side in SIDES)


def picture(folder: Path, text: str) -> tuple[np.ndarray, tuple[str, ...]]:
    (folder / "cube.obj").write_text(text)
    scene = insitu.open(folder / "cube.obj", resolution=(40, 30))
    return scene.image(bounces=1), scene.report.notes


@pytest.mark.parametrize("more", [FACES, TURNED, "usemtl other\n" + TURNED])
def test_repeated_faces_change_no_pixel(tmp_path: Path, more: str) -> None:
    """As they are, turned inside out (normals would cancel), and of another material."""
    once, _ = picture(tmp_path, CORNERS + FACES)
    twice, notes = picture(tmp_path, CORNERS + FACES + more)
    np.testing.assert_array_equal(twice, once)
    assert "cube: 6 faces that repeat another left out" in notes


def test_a_surface_with_normals_of_its_own_on_both_sides_has_no_flecks(tmp_path: Path) -> None:
    """Its two sides are at one place; whichever a ray meets shows the same."""
    card = "v 0 0 0\nv 1 0 0\nv 1 1 0.4\nv 0 1 0.4\nvn 0 -0.37 0.93\nvn 0 0.37 -0.93\n"
    front, back = "f 1//1 2//1 3//1 4//1\n", "f 4//2 3//2 2//2 1//2\n"
    once, _ = picture(tmp_path, card + front)
    twice, notes = picture(tmp_path, card + front + back)
    assert not any("repeat" in note for note in notes)
    np.testing.assert_allclose(twice, once, atol=0.02 * once.mean())
