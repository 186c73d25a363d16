import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from engine.light.emitters import (
    EmitterPatches,
    emitter_patches,
    emitter_tree,
    merge_triangles,
    merged_by_object,
    solid_angles,
    visible_importance,
)
from engine.sphere.geodesic import geodesic

# A unit square at height 1, shining down on the origin (counter-clockwise seen from below).
SQUARE = np.array(
    [[[-0.5, 1.0, -0.5], [0.5, 1.0, -0.5], [0.5, 1.0, 0.5]], [[-0.5, 1.0, -0.5], [0.5, 1.0, 0.5], [-0.5, 1.0, 0.5]]]
)
WHITE = np.ones((2, 3))


def patch_solid_angles(patches: EmitterPatches, points: np.ndarray) -> np.ndarray:
    """Solid angle of every patch from every point (P, 3): (P, M), steradians; 0 from behind and within its plane."""
    return solid_angles(patches.corners.astype(np.float64), points)


def irradiance(triangles: np.ndarray, n_patches: int, point: np.ndarray, normal: np.ndarray) -> float:
    """Solid angle times cosine at the patches' centres, for radiance 1."""
    patches = emitter_patches(triangles, np.ones((len(triangles), 3)), n_patches)
    to_light = patches.centre - point
    cosines = to_light @ normal / np.linalg.norm(to_light, axis=1)
    return float((patch_solid_angles(patches, point[None])[0] * np.maximum(cosines, 0.0)).sum())


def test_square_shines_down() -> None:
    patches = emitter_patches(SQUARE, WHITE, 2)
    np.testing.assert_allclose(patches.normal, [[0.0, -1.0, 0.0]] * 2, atol=1e-7)
    np.testing.assert_allclose(patches.area, 0.5)


@pytest.mark.parametrize("n_patches", [2, 3, 17, 64, 500])
def test_splitting_keeps_area_and_orientation(n_patches: int) -> None:
    patches = emitter_patches(SQUARE, [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]], n_patches)
    assert len(patches) == n_patches
    assert patches.area.sum(dtype=float) == pytest.approx(1.0, rel=1e-6)
    np.testing.assert_allclose(patches.normal, np.tile([0.0, -1.0, 0.0], (n_patches, 1)), atol=1e-6)
    # Flux pi * sum(L A): half a square of each radiance, whatever the number of patches.
    np.testing.assert_allclose((patches.radiance * patches.area[:, None]).sum(axis=0), [2.5, 3.5, 4.5], rtol=1e-6)
    # Halving the largest first leaves areas within a factor of two.
    assert patches.area.max() <= 2.0 * patches.area.min() * (1.0 + 1e-5)
    np.testing.assert_allclose(patches.centre, patches.corners.mean(axis=1), atol=1e-6)


def test_large_and_small_triangles_get_patches_by_area() -> None:
    small = SQUARE[:1] * 0.1 + np.array([5.0, 0.0, 0.0])
    patches = emitter_patches(np.concatenate([SQUARE, small]), np.eye(3), 100)
    counts = (patches.radiance > 0.0).sum(axis=0)
    # The small one has 0.005 of the 1.005 square metres: it stays whole.
    assert counts[2] == 1 and abs(int(counts[0]) - int(counts[1])) <= 2


def test_splitting_keeps_triangles_well_shaped() -> None:
    corners = emitter_patches(SQUARE, WHITE, 256).corners.astype(float)
    edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    # Bisecting the longest edge of a right isosceles triangle gives right isosceles triangles for ever.
    np.testing.assert_allclose(edges.max(axis=1) / edges.min(axis=1), np.sqrt(2.0), rtol=1e-4)


@pytest.mark.parametrize("step", [4, 8, 16])
def test_every_nth_patch_is_spread_over_the_emitter(step: int) -> None:
    # Visibility takes every eighth patch as a sample: of each quarter of the square a quarter of them, or one off.
    square = np.array([[[0, 0, 0], [1, 0, 0], [1, 0, 1]], [[0, 0, 0], [1, 0, 1], [0, 0, 1]]], float)
    centres = emitter_patches(square, np.ones((2, 3)), 256).centre[step - 1 :: step]
    quarters = np.bincount(2 * (centres[:, 0] > 0.5) + (centres[:, 2] > 0.5), minlength=4)
    assert np.abs(quarters - 64 / step).max() <= 1


def test_solid_angle_of_a_cube_face() -> None:
    # From the centre of a cube each face covers 4 pi / 6.
    face = SQUARE * np.array([2.0, 1.0, 2.0])
    for n_patches in (2, 5, 100):
        angles = patch_solid_angles(emitter_patches(face, WHITE, n_patches), np.zeros((1, 3)))
        assert angles.sum(dtype=float) == pytest.approx(4.0 * np.pi / 6.0, rel=1e-6)


def test_irradiance_below_a_unit_square() -> None:
    # Closed form: E = 0.752275 L straight below a unit square at height 1.
    up = np.array([0.0, 1.0, 0.0])
    assert irradiance(SQUARE, 1000, np.zeros(3), up) == pytest.approx(0.752275, rel=1e-4)


@pytest.mark.parametrize(("upright", "expected", "tolerance"), [(False, 0.199825, 5e-4), (True, 0.200044, 1e-2)])
def test_form_factor_of_unit_squares(upright: bool, expected: float, tolerance: float) -> None:
    # Parallel squares at distance 1: F = 0.199825. Perpendicular ones with a common edge: F = 0.200044; there the
    # points by the edge see the lowest patches at grazing angles, where one cosine for a whole patch errs most.
    place = (np.arange(20) + 0.5) / 20 - 0.5
    x, z = np.meshgrid(place, place)
    points = np.stack([x.ravel(), np.zeros(400), z.ravel()], axis=1)
    light = SQUARE
    if upright:
        light = np.stack([SQUARE[..., 0], SQUARE[..., 2] + 0.5, np.full((2, 3), -0.5)], axis=2)
    patches = emitter_patches(light, WHITE, 4000)
    if upright:
        assert patches.normal[0, 2] == pytest.approx(1.0)
    to_light = patches.centre[None] - points[:, None]
    cosines = np.maximum(to_light[..., 1] / np.linalg.norm(to_light, axis=2), 0.0)
    mean_irradiance = (patch_solid_angles(patches, points) * cosines).sum(axis=1).mean()
    assert mean_irradiance / np.pi == pytest.approx(expected, rel=tolerance)


def test_patches_are_dark_from_behind_and_from_their_plane() -> None:
    patches = emitter_patches(SQUARE, WHITE, 8)
    inside_plane = [[0.1, 1.0, 0.2], [0.5, 1.0, 0.5], [9.0, 1.0, 0.0], [0.0, 1.0, 0.0]]
    angles = patch_solid_angles(patches, np.array([[0.0, 2.0, 0.0], [3.0, 1.5, 0.0], *inside_plane]))
    np.testing.assert_allclose(angles, 0.0, atol=1e-6)


def test_just_below_a_patch_it_fills_half_the_sphere() -> None:
    angles = patch_solid_angles(emitter_patches(SQUARE, WHITE, 2), np.array([[0.1, 1.0 - 1e-7, -0.2]]))
    assert angles.sum() == pytest.approx(2.0 * np.pi, abs=1e-4)


@settings(deadline=None)  # the first example may compile
@given(
    st.lists(st.floats(-2.0, 2.0), min_size=3, max_size=3),
    st.integers(1, 60),
)
def test_solid_angles_do_not_depend_on_the_splitting(point: list[float], n_patches: int) -> None:
    place = np.array([point])
    whole = patch_solid_angles(emitter_patches(SQUARE, WHITE, 2), place).sum(dtype=float)
    split = patch_solid_angles(emitter_patches(SQUARE, WHITE, n_patches), place).sum(dtype=float)
    # Patches are stored in single precision: from very near their plane 1e-7 of a metre is an angle.
    distance = abs(point[1] - 1.0)
    assert np.isfinite(split) and 0.0 <= split <= 2.0 * np.pi + 1e-5
    if distance > 1e-3:
        assert split == pytest.approx(whole, abs=1e-3)


@pytest.mark.parametrize("scale", [1e-6, 1e6])
def test_solid_angle_has_no_scale(scale: float) -> None:
    angles = patch_solid_angles(emitter_patches(SQUARE * scale, WHITE, 30), np.zeros((1, 3)))
    # Below its centre, a unit square at height 1 covers 4 asin(1/5).
    assert angles.sum(dtype=float) == pytest.approx(4.0 * np.arcsin(0.2), rel=1e-5)


def test_degenerate_and_dark_triangles_are_left_out() -> None:
    flat = np.array([[[0.0, 0, 0], [1, 0, 0], [2, 0, 0]], [[1.0, 1, 1]] * 3])
    triangles = np.concatenate([SQUARE, flat, SQUARE + 7.0])
    radiance = np.concatenate([WHITE, WHITE, np.zeros((2, 3))])
    patches = emitter_patches(triangles, radiance, 10)
    assert len(patches) == 10
    assert patches.area.sum(dtype=float) == pytest.approx(1.0, rel=1e-6)
    assert np.isfinite(patches.normal).all()


def test_nothing_shines() -> None:
    for triangles in (np.zeros((0, 3, 3)), SQUARE):
        patches = emitter_patches(triangles, np.zeros((len(triangles), 3)), 10)
        assert len(patches) == 0 and patches.corners.shape == (0, 3, 3)
        assert patch_solid_angles(patches, np.zeros((4, 3))).shape == (4, 0)


def test_more_triangles_than_patches_stay_as_they_are() -> None:
    patches = emitter_patches(np.tile(SQUARE, (20, 1, 1)), np.ones((40, 3)), 5)
    assert len(patches) == 40


@pytest.mark.parametrize(
    ("triangles", "radiance", "n_patches"),
    [
        (SQUARE[0], WHITE, 4),
        (SQUARE, WHITE[:1], 4),
        (SQUARE * np.nan, WHITE, 4),
        (SQUARE, -WHITE, 4),
        (SQUARE, WHITE * np.inf, 4),
        (SQUARE, WHITE, 0),
    ],
)
def test_bad_emitters_are_refused(triangles: np.ndarray, radiance: np.ndarray, n_patches: int) -> None:
    with pytest.raises(ValueError, match="triangles|emitters|n_patches"):
        emitter_patches(triangles, radiance, n_patches)


def test_bad_points_are_refused() -> None:
    with pytest.raises(ValueError, match="points have shape"):
        patch_solid_angles(emitter_patches(SQUARE, WHITE, 4), np.zeros(3))


def test_a_tree_of_halves_keeps_area_and_knows_its_leaves() -> None:
    tree = emitter_tree(SQUARE, WHITE, 21)
    assert tree.n_roots == 2 and len(tree.leaves) == 21 and len(tree.child) == 2 + 2 * 19
    areas = np.linalg.norm(
        np.cross(*(tree.corners[:, 1:] - tree.corners[:, :1]).astype(float).transpose(1, 0, 2)), axis=1
    )
    whole = np.flatnonzero(tree.child >= 0)
    for half in (0, 1):
        halves = tree.child[whole] + half
        np.testing.assert_allclose(areas[halves], areas[whole] / 2, rtol=1e-6)
        np.testing.assert_array_equal(tree.parent[halves], whole)
    leaf = np.flatnonzero(tree.child < 0)
    # Leaves are counted depth first, so that those of a node stand together.
    np.testing.assert_allclose(tree.corners[leaf], tree.leaves.corners[tree.first[leaf]])
    np.testing.assert_array_equal(tree.first[tree.child[whole]], tree.first[whole])


def test_leaves_go_where_emitters_are_seen_from_near() -> None:
    # A panel of 4 m² at 5 m, a lamp a thousandth as large of a hundred times its radiance beside the points; a
    # third one as bright, behind a wall.
    panel, lamp = 2.0 * SQUARE + [0.0, 4.0, 0.0], 0.06 * SQUARE + [0.0, 0.4, 0.0]
    triangles = np.concatenate([panel, lamp, lamp + [0.3, 0.0, 0.0]])
    radiance = np.repeat([[1.0], [100.0], [100.0]], 2, axis=0) * np.ones(3)
    points = np.random.default_rng(2).uniform([-0.2, 0.0, -0.2], [0.2, 0.0, 0.2], (64, 3))
    normals, seen = np.tile([0.0, 1.0, 0.0], (64, 1)), np.ones((64, 6))
    seen[:, :4], seen[:, 4:] = 0.5, 0.0
    tree = emitter_tree(triangles, radiance, 100, visible_importance(triangles, radiance, points, normals, seen))
    below = np.bincount(np.searchsorted(tree.first[:6], np.arange(100), side="right") - 1, minlength=6)
    assert below[2:4].sum() > 2 * below[:2].sum() and (below[4:] == 1).all() and below.sum() == 100


def bulb(radius: float) -> np.ndarray:
    """A sphere of 1,280 triangles."""
    sphere = geodesic(3)
    return radius * sphere.vertices[sphere.triangles].astype(float)


def panel() -> np.ndarray:
    """The unit square at height 1, facing down, in 1,250 triangles."""
    place = np.linspace(-0.5, 0.5, 26)
    x, z = np.meshgrid(place, place, indexing="ij")
    grid = np.stack([x, np.ones_like(x), z], axis=2)
    a, b, c, d = grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]
    return np.concatenate([np.stack([a, b, c], axis=2), np.stack([a, c, d], axis=2)]).reshape(-1, 3, 3)


@pytest.mark.parametrize("distance", [0.15, 0.3, 1.0, 30.0])
def test_a_bulb_of_many_triangles_is_merged_into_few(distance: float) -> None:
    triangles, places = bulb(0.1), np.random.default_rng(5).normal(size=(20, 3))
    places *= distance / np.linalg.norm(places, axis=1, keepdims=True)
    merged, radiance, source, _ = merge_triangles(triangles, np.ones((len(triangles), 3)), 128)
    assert len(merged) == len(radiance) == len(source) == 128
    # A sphere covers 2 pi (1 - cos) with sin = R / d; what stands for it lies on its outside.
    expected = 2.0 * np.pi * (1.0 - np.sqrt(1.0 - (0.1 / distance) ** 2))
    found = solid_angles(merged, places).sum(axis=1, dtype=float)
    assert found.mean() == pytest.approx(expected, rel=0.02) and np.abs(found / expected - 1.0).max() < 0.06
    assert (np.linalg.norm(merged.mean(axis=1), axis=1) > 0.0975).all()


def test_a_panel_of_many_triangles_shines_as_two_do() -> None:
    merged = merge_triangles(panel(), np.ones((1250, 3)), 64).corners
    places = np.array([[0.0, 0.0, 0.0], [0.3, 0.8, 0.2], [1.0, 0.5, 0.0], [0.5, 0.9, 0.5]])
    np.testing.assert_allclose(merged[:, :, 1], 1.0, atol=1e-9)
    found, expected = (solid_angles(each, places).sum(axis=1) for each in (merged, SQUARE))
    np.testing.assert_allclose(found, expected, rtol=0.03)


def test_few_triangles_are_not_merged_and_radiances_never_mixed() -> None:
    triangles, radiance = panel(), np.ones((1250, 3))
    assert merge_triangles(triangles, radiance, 1250)[0] is triangles
    radiance[::3] = [5.0, 1.0, 0.5]
    merged, found, _, _ = merge_triangles(triangles, radiance, 40)
    assert len(merged) == 40
    areas = np.linalg.norm(np.cross(*(merged[:, 1:] - merged[:, :1]).transpose(1, 0, 2)), axis=1) / 2
    for colour in ([1.0, 1.0, 1.0], [5.0, 1.0, 0.5]):
        # Area is kept, colour by colour: 833 and 417 triangles of a 1,250th square metre.
        share = (radiance == colour).all(axis=1).mean()
        assert areas[(found == colour).all(axis=1)].sum() == pytest.approx(share, rel=1e-9)


def test_objects_are_merged_by_themselves_and_small_ones_stay_round() -> None:
    triangles = np.concatenate([panel(), bulb(0.01), np.zeros((3, 3, 3))])
    objects = np.repeat([7, 3, 3], [1250, len(bulb(0.01)), 3])
    (merged, _, source, _), found = merged_by_object(triangles, np.ones((len(triangles), 3)), objects, 128)
    areas = np.linalg.norm(np.cross(*(merged[:, 1:] - merged[:, :1]).transpose(1, 0, 2)), axis=1) / 2
    for one, n, radius in ((7, 128, None), (3, 64, 0.01)):
        assert (found == one).sum() == n
        area = 1.0 if radius is None else 4.0 * np.pi * radius**2
        assert areas[found == one].sum() == pytest.approx(area, rel=0.01)
    # The source of each is a triangle of its object, where it is one alone.
    assert (objects[source[source >= 0]] == found[source >= 0]).all()
    none = merged_by_object(triangles[:0], triangles[:0, 0], objects[:0], 64)[0]
    assert none.corners.shape == (0, 3, 3)


def test_triangles_of_one_kind_are_merged_by_brightness_and_keep_their_power() -> None:
    """A panel whose left half is bright: no merged triangle is of both halves."""
    triangles = panel()
    bright = triangles.mean(axis=1)[:, 0] < 0.0
    radiance = np.where(bright[:, None], [4.0, 2.0, 1.0], [0.1, 0.1, 0.4])
    merged, found, source, _ = merge_triangles(triangles, radiance, 64, np.zeros(len(triangles), int))
    assert len(merged) == 64 and (source[source >= 0] < len(triangles)).all()
    areas = np.linalg.norm(np.cross(*(merged[:, 1:] - merged[:, :1]).transpose(1, 0, 2)), axis=1) / 2
    np.testing.assert_allclose(areas @ found, radiance.mean(axis=0), rtol=1e-9)  # of a square metre
    mixed = ~np.isclose(found[:, 0], 4.0) & ~np.isclose(found[:, 0], 0.1)
    assert areas[mixed].sum() < 0.05


def test_radiance_that_varies_is_that_of_parts_and_wholes_have_their_mean() -> None:
    """Radiance x + 1 of a square from -1/2 to 1/2: of any triangle it is that at its centre."""

    def varying(corners: np.ndarray, roots: np.ndarray) -> np.ndarray:
        return np.repeat(corners.mean(axis=1)[:, :1] + 1.0, 3, axis=1)

    triangles = SQUARE - SQUARE.reshape(-1, 3).mean(axis=0)
    mean = varying(triangles, np.arange(2))
    tree = emitter_tree(triangles, mean, 64, varying=varying)
    np.testing.assert_allclose(tree.radiance, varying(tree.corners, np.zeros(0)), atol=1e-6)
    np.testing.assert_allclose(tree.leaves.area @ tree.leaves.radiance, 1.0, rtol=1e-5)
    # A tree by brightness is finer where it is bright.
    importance = visible_importance(
        triangles, mean, np.array([[0.0, -1.0, 0.0]]), np.array([[0.0, 1.0, 0.0]]), np.full((1, 2), 0.5)
    )
    leaves = emitter_tree(triangles, mean, 200, importance, varying=varying).leaves
    assert (leaves.centre[:, 0] > 0.0).mean() > 0.6
