"""Probes and cube maps of a known field, L = 1 + 0.9 d in the three channels, drawn from the definition of each map."""

from pathlib import Path

import numpy as np
import pytest

from engine.core.errors import LoadError
from engine.light.environment import load_environment
from engine.light.probe_mappings import likely_mapping, mapping_problem
from tests.engine.light.test_environment import write_exr
from tests.naive.sphere import directions_of_texels

AHEAD, BACK = np.array([0.0, 0.0, -1.0]), np.array([0.0, 0.0, 1.0])
RIGHT, UP = np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])


def field(directions: np.ndarray) -> np.ndarray:
    return (1.0 + 0.9 * directions / np.linalg.norm(directions, axis=-1, keepdims=True)).astype(np.float32)


def face(centre: np.ndarray, right: np.ndarray, up: np.ndarray, size: int) -> np.ndarray:
    """What is seen through one side of a cube: its middle, and where the picture's right and top are."""
    place = (2.0 * np.arange(size) + 1.0) / size - 1.0
    return field(centre + place[None, :, None] * right - place[:, None, None] * up)


def cube_map(layout: str, size: int) -> np.ndarray:
    """The faces in their cells; all else is NaN, and must not be read.

    A cross is a cube cut open: whoever stands inside and turns to the right sees its side faces one after another, and
    looks up or down from the one ahead. In the upright cross the face behind is reached by way of the one below.
    """
    ahead, above = face(AHEAD, RIGHT, UP, size), face(UP, RIGHT, BACK, size)
    below, left = face(-UP, RIGHT, AHEAD, size), face(-RIGHT, AHEAD, UP, size)
    right, behind = face(RIGHT, BACK, UP, size), face(BACK, -RIGHT, UP, size)
    upside_down = face(BACK, RIGHT, -UP, size)
    cells = {
        "lying": [[None, above, None, None], [left, ahead, right, behind], [None, below, None, None]],
        "upright": [[None, above, None], [left, ahead, right], [None, below, None], [None, upside_down, None]],
        "column": [[right], [left], [above], [below], [behind], [ahead]],
    }[layout]
    empty = np.full((size, size, 3), np.nan, np.float32)
    return np.concatenate(
        [np.concatenate([empty if each is None else each for each in row], axis=1) for row in cells], axis=0
    )


@pytest.mark.parametrize("layout", ["lying", "upright", "column"])
@pytest.mark.parametrize("size", [31, 32])
def test_cube_maps(tmp_path: Path, layout: str, size: int) -> None:
    environment = load_environment(write_exr(tmp_path / "a.exr", cube_map(layout, size)), "cube")
    assert environment.radiance.shape == (2 * size, 4 * size, 3)
    # Texels cover at most 2 / 31 = 0.065; the nearest errs by half of that, times 0.9.
    expected = field(directions_of_texels(2 * size, 4 * size))
    np.testing.assert_allclose(environment.radiance, expected, atol=0.04)
    assert np.abs(environment.radiance - expected).mean() < 0.008
    assert environment.notes == ()


def test_a_column_of_faces_is_a_cube_map_whatever_its_mapping(tmp_path: Path) -> None:
    path = write_exr(tmp_path / "a.exr", cube_map("column", 8))
    environment = load_environment(path)
    np.testing.assert_array_equal(environment.radiance, load_environment(path, "cube").radiance)
    assert environment.notes == ("a column of six squares, read as the faces of a cube",)


@pytest.mark.parametrize("size", [199, 200])
def test_a_mirroring_ball(tmp_path: Path, size: int) -> None:
    place = (2.0 * np.arange(size) + 1.0) / size - 1.0
    x, y = np.meshgrid(place, -place)
    height = np.sqrt(np.maximum(1.0 - x**2 - y**2, 0.0))
    normal = np.stack([x, y, height], axis=2)
    # The camera stands at +Z: its direction, mirrored at the normal.
    reflected = 2.0 * normal * height[..., None] - BACK
    picture = np.where((x**2 + y**2 <= 1.0)[..., None], field(reflected), np.nan).astype(np.float32)
    environment = load_environment(write_exr(tmp_path / "a.exr", picture), "ball")
    expected = field(directions_of_texels(*environment.radiance.shape[:2]))
    error = np.abs(environment.radiance - expected)
    # Towards the rim a texel covers ever more of what is behind the ball: 1 / 200 of the radius from the rim the
    # direction is 0.2 rad from -Z.
    ahead = expected[..., 2] < 0.3
    assert error[~ahead].max() < 0.1 and error.max() < 0.35 and error.mean() < 0.01


def test_sizes_tell_the_mapping() -> None:
    assert [likely_mapping(*size) for size in ((2048, 1024), (512, 512), (1024, 768), (768, 1024), (256, 1536))] == [
        "latlong", "angular", "cube", "cube", "cube"
    ]  # fmt: skip
    assert mapping_problem("ball", 4, 4) is None and mapping_problem("latlong", 5, 3) is None
    assert mapping_problem("ball", 4, 5) == "a square picture of a ball"
    assert str(mapping_problem("cube", 4, 5)).startswith("a cube map")


@pytest.mark.parametrize("size", [(4, 6), (3, 5)])
def test_other_sizes_are_refused(tmp_path: Path, size: tuple[int, int]) -> None:
    with pytest.raises(LoadError, match="expected a cube map: a cross of 4 x 3 or 3 x 4 faces"):
        load_environment(write_exr(tmp_path / "a.exr", np.ones((*size, 3), np.float32)), "cube")
