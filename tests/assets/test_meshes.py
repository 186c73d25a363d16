"""The committed meshes: sound, small, and what the generators make."""

from pathlib import Path

import numpy as np
import pytest

from assets.generate.mesh import Mesh, axis_rotation, check, cleaned, face_normals, load_ply, merged, save_ply
from assets.generate.scenes import MODELS, SCENES, SINGLE_MODELS
from assets.generate.surfaces import arc_profile, bezier, carried, circle, rounded_profile, rounded_rectangle, tube
from assets.generate.teapot import bernstein, bernstein_slope, load_patches, teapot
from engine.scene.loaders.gltf import read_gltf
from engine.scene.raycaster import RayCaster

ASSETS = Path(__file__).resolve().parents[2] / "assets"
PLY_FILES = sorted((ASSETS / "scenes").glob("*/*.ply"))


def volume(mesh: Mesh) -> float:
    """Enclosed by a closed mesh, by the divergence theorem; negative when it is inside out."""
    a, b, c = (mesh.positions[mesh.faces[:, corner]] for corner in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


@pytest.mark.parametrize("path", PLY_FILES, ids=lambda path: f"{path.parent.name}/{path.stem}")
def test_committed_mesh_is_sound(path: Path) -> None:
    mesh = load_ply(path)
    check(mesh)
    assert path.stat().st_size < 1_100_000


@pytest.mark.parametrize("name", SCENES)
def test_generator_makes_the_committed_meshes(name: str, tmp_path: Path) -> None:
    meshes = SCENES[name]()
    assert sorted(meshes) == sorted(path.stem for path in (ASSETS / "scenes" / name).glob("*.ply"))
    for part, mesh in meshes.items():
        committed = load_ply(ASSETS / "scenes" / name / f"{part}.ply")
        assert np.array_equal(mesh.faces, committed.faces)
        size = np.ptp(committed.positions, axis=0).max()
        # The same to float32 and to how another processor rounds a sine.
        assert np.allclose(mesh.positions, committed.positions, rtol=0, atol=1e-6 * size)
        assert np.allclose(mesh.normals, committed.normals, rtol=0, atol=1e-5)
        assert (mesh.coordinates is None) == (committed.coordinates is None)
        if mesh.coordinates is not None and committed.coordinates is not None:
            assert np.allclose(mesh.coordinates, committed.coordinates, rtol=0, atol=1e-5)


MODEL_FILES = [(ASSETS / "scenes" / name / file, save) for name in MODELS for file, save in MODELS[name].items()]
MODEL_FILES += [(ASSETS / "models" / f"{name}.glb", save) for name, save in SINGLE_MODELS.items()]


@pytest.mark.parametrize("file", range(len(MODEL_FILES)), ids=[path.name for path, _ in MODEL_FILES])
def test_generator_makes_the_committed_models(file: int, tmp_path: Path) -> None:
    path, save = MODEL_FILES[file]
    save(tmp_path / path.name)
    (made, committed) = (read_gltf(each) for each in (tmp_path / path.name, path))
    for part, other in zip(made.parts, committed.parts, strict=True):
        assert np.array_equal(part.mesh.triangles, other.mesh.triangles)
        assert np.allclose(part.mesh.vertices, other.mesh.vertices, rtol=0, atol=1e-6)


def test_everything_fits_in_17_megabytes() -> None:
    assert sum(path.stat().st_size for path in ASSETS.rglob("*") if path.suffix in (".ply", ".exr", ".glb")) < 17e6


def test_ply_reads_back_as_written(tmp_path: Path) -> None:
    ball = carried(arc_profile(1.0, (0, 0), -np.pi / 2, np.pi / 2, 9), circle(12))
    save_ply(ball, tmp_path / "ball.ply")
    back = load_ply(tmp_path / "ball.ply")
    assert np.array_equal(back.faces, ball.faces)
    assert np.array_equal(back.positions, ball.positions.astype(np.float32))


@pytest.mark.parametrize(
    ("fault", "message"),
    [
        ({"positions": np.array([[0, 0, 0], [1, 0, 0], [0, np.nan, 0.0]])}, "finite"),
        ({"faces": np.array([[0, 1, 3]])}, "outside"),
        ({"normals": np.array([[0, 0, 1], [0, 0, 1], [0, 0, 1.1]])}, "not unit, the first is 2"),
        ({"positions": np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0.0]])}, "no area"),
        ({"faces": np.array([[0, 2, 1]])}, "wound against"),
    ],
)
def test_check_names_the_fault(fault: dict[str, np.ndarray], message: str) -> None:
    sound = {
        "positions": np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0.0]]),
        "normals": np.tile([0, 0, 1.0], (3, 1)),
        "faces": np.array([[0, 1, 2]]),
    }
    check(Mesh(**sound))
    with pytest.raises(ValueError, match=message):
        check(Mesh(**(sound | fault)))


def test_cleaned_welds_smooth_edges_and_keeps_creases() -> None:
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]])
    positions = np.vstack([square[[0, 1, 2]], square[[0, 2, 3]]])
    faces = np.array([[0, 1, 2], [3, 5, 4], [0, 0, 1]])  # the second wound wrongly, the third without area
    flat = cleaned(Mesh(positions, np.tile([0, 0, 1.0], (6, 1)), faces))
    assert len(flat.positions) == 4 and len(flat.faces) == 2  # two shared corners welded
    assert (face_normals(flat)[:, 2] > 0).all()
    creased = np.tile([0, 0, 1.0], (6, 1))
    creased[3:] = [0, 0.6, 0.8]
    assert len(cleaned(Mesh(positions, creased, faces)).positions) == 6


def test_sphere_encloses_its_volume() -> None:
    ball = carried(arc_profile(2.0, (0, 0), -np.pi / 2, np.pi / 2, 97), circle(192))
    assert volume(ball) == pytest.approx(4 / 3 * np.pi * 8, rel=1e-3)  # 4/3 pi r^3, from inside by the chords
    assert np.allclose(ball.normals, ball.positions / 2, atol=1e-12)


def test_rounded_box_encloses_its_volume() -> None:
    r, side = 0.1, 1.0
    profile = rounded_profile([(0, 0, 0), (r, 0, r), (r, side, r), (0, side, 0)], arc_points=33)
    box = carried(profile, rounded_rectangle(side / 2 - r, side / 2 - r, 33))
    inner = side - 2 * r
    # Steiner's formula: the inner cube, six slabs, twelve quarter cylinders, eight eighths of a ball.
    expected = inner**3 + 6 * inner**2 * r + 3 * np.pi * inner * r**2 + 4 / 3 * np.pi * r**3
    assert volume(box) == pytest.approx(expected, rel=1e-4)


def test_rounded_profile_turns_smoothly_and_ends_where_requested() -> None:
    profile = rounded_profile([(0, 0, 0), (2, 0, 0.5), (2, 3, 0), (0, 3, 0)], arc_points=5)
    assert np.allclose(profile.points[[0, -1]], [(0, 0), (0, 3)])
    assert np.allclose(np.linalg.norm(profile.points[1:6] - (1.5, 0.5), axis=1), 0.5)  # about the fillet's centre
    assert np.allclose(profile.normals[[0, 5, -1]], [(0, -1), (1, 0), (0, 1)], atol=1e-12)


def test_rounded_profile_refuses_fillets_that_overlap() -> None:
    # Quarter turns take their radius on each side: 0.6 + 0.6 is more than the side of 1.
    with pytest.raises(ValueError, match="side 1"):
        rounded_profile([(0, 0, 0), (2, 0, 0.6), (2, 1, 0.6), (0, 1, 0)])


def test_straight_tube_is_a_capsule() -> None:
    path = np.column_stack([np.linspace(0, 3, 11), np.zeros(11), np.zeros(11)])
    capsule = tube(path, np.full(11, 0.5), 128, cap_rings=33)
    assert volume(capsule) == pytest.approx(np.pi * 0.25 * 3 + 4 / 3 * np.pi * 0.125, rel=2e-3)


def test_bezier_passes_its_ends() -> None:
    control = np.array([(0, 0), (1, 2), (3, 2), (4, 0.0)])
    # At 1/2 the weights are 1, 3, 3, 1 eighths.
    assert np.allclose(bezier(control, np.array([0, 0.5, 1])), [(0, 0), (2, 1.5), (4, 0)])


def test_rotation_is_right_handed() -> None:
    assert np.allclose(axis_rotation((0, 1, 0), np.pi / 2) @ (0, 0, 1), (1, 0, 0))


def test_bernstein_polynomials_sum_to_one_and_match_their_slopes() -> None:
    t = np.linspace(0.01, 0.99, 25)
    assert np.allclose(bernstein(t).sum(axis=1), 1)
    assert np.allclose((bernstein(t + 1e-6) - bernstein(t - 1e-6)) / 2e-6, bernstein_slope(t), atol=1e-8)


def test_newells_patches_are_complete_and_joined() -> None:
    parts, patches = load_patches()
    counts = {part: parts.count(part) for part in parts}
    assert counts == {"rim": 4, "body": 8, "handle": 4, "spout": 4, "lid": 8, "bottom": 4}
    # Each patch ends at v = 1 where the next one round begins at v = 0.
    for first in (0, 4, 8, 20, 24, 28):
        ring = patches[first : first + 4]
        assert np.allclose(ring[:, :, 3], np.roll(ring, -1, axis=0)[:, :, 0])
    # The spread lid's edge lies on the rim's inner edge, so that no gap shows.
    assert np.allclose(np.linalg.norm(patches[24:28, 3, 0, :2], axis=1), 1.4, atol=1e-3)


def test_teapot_stands_on_the_ground_with_normals_outward() -> None:
    pot = teapot(scale=1.0, n=6)
    assert pot.positions[:, 1].min() == pytest.approx(0, abs=1e-12)
    assert pot.positions[:, 1].max() == pytest.approx(3.15)  # the top of the lid's knob in Blinn's proportions
    low = (pot.positions[:, 1] > 0.3) & (pot.positions[:, 1] < 1.2) & (np.abs(pot.positions[:, 2]) > 1)
    # There only the body is: its normals lead away from the axis.
    outward = pot.positions[low][:, [0, 2]]
    assert (np.einsum("ij,ij->i", outward, pot.normals[low][:, [0, 2]]) > 0).all()


def test_the_rooms_floor_has_no_joints() -> None:
    # Narrower than a pixel, they were black dots in the sun: every millimetre across the planks is at height 0, level.
    planks = merged([load_ply(ASSETS / "scenes" / "room" / f"{part}.ply") for part in ("planks", "dark_oak")])
    caster = RayCaster(planks.positions, planks.faces)
    x = np.arange(-2.05, 2.05, 0.001)
    for z in (-2.4, 0.613, 2.2):
        origins = np.stack([x, np.full_like(x, 0.1), np.full_like(x, z)], axis=1)
        found = caster.intersect(origins, np.broadcast_to([0.0, -1.0, 0.0], origins.shape))
        np.testing.assert_allclose(found.distance, 0.1, atol=1e-5)
