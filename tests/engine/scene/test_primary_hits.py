"""Primary hits: order, frames, emitters and background, and invariants for any camera."""

from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from engine.core.errors import LoadError
from engine.scene import primitives
from engine.scene.description import parse_description
from engine.scene.primary_hits import PrimaryHits, trace_primary
from engine.scene.raycaster import RayCaster
from engine.scene.scene_loader import Scene, build_scene, load_scene
from tests.engine.scene.conftest import CARD
from tests.scene_text import camera, placed, scaled


def trace(path, resolution=None) -> tuple[Scene, PrimaryHits]:
    scene = load_scene(path, resolution)
    return scene, trace_primary(scene, RayCaster(scene.vertices, scene.triangles), resolution)


def view(position, target=(0, 0, 0), size=(64, 48), fov=40) -> str:
    return camera(position, fov, size, target)


SPHERE = placed("ball", "sphere")
ALL = ("position", "offset_position", "normal", "geometric_normal", "tangent", "wo")
UNIT = ("normal", "geometric_normal", "tangent", "wo")


def check_invariants(scene: Scene, hits: PrimaryHits) -> None:
    """What holds for every picture."""
    width, height = hits.resolution
    for name in ALL:
        array = getattr(hits, name)
        assert array.shape == (len(hits.pixel), 3) and array.dtype == np.float32 and np.isfinite(array).all(), name
    for name in UNIT:
        assert np.abs(np.linalg.norm(getattr(hits, name), axis=1) - 1).max(initial=0) < 1e-5, name
    facing = np.einsum("pk,pk->p", hits.normal, hits.wo), np.einsum("pk,pk->p", hits.geometric_normal, hits.wo)
    assert min(f.min(initial=0) for f in facing) > -1e-6
    assert np.abs(np.einsum("pk,pk->p", hits.normal, hits.tangent)).max(initial=0) < 1e-5
    centred = hits.is_centred
    assert (hits.object_image.reshape(-1)[hits.pixel[centred]] == hits.objects[centred]).all()
    for start, end in hits.object_ranges:
        assert (np.diff(hits.pixel[start:end]) >= 0).all() and (
            np.diff(hits.pixel[start:end][centred[start:end]]) > 0
        ).all()
    rows = hits.row_image[hits.row_image >= 0]
    assert len(rows) == centred.sum() and (np.sort(rows) == np.flatnonzero(centred)).all()
    assert hits.object_ranges[-1, 1] == len(hits.pixel)
    assert hits.object_image.shape == (height, width) and hits.ray_directions.shape == (height, width, 3)
    shown = np.bincount(hits.pixel, hits.share, width * height) + hits.open_image.ravel()
    shown += np.bincount(hits.lamps.pixel, hits.lamps.share, width * height)
    dark = np.isin(hits.object_image, np.flatnonzero(scene.emitters)).ravel()  # the backs of lamps may be seen
    assert np.abs(shown[~dark] - 1.0).max(initial=0) < 1e-6 and shown.max() < 1.0 + 1e-6


def test_a_sphere_has_its_true_normals(scene_file):
    scene, hits = trace(scene_file(SPHERE, view((0, 0, 3))))
    check_invariants(scene, hits)
    # a sphere of radius ½ at the origin: n = p / |p|, up to the tessellation's sagitta
    assert np.abs(hits.normal - hits.position / np.linalg.norm(hits.position, axis=1, keepdims=True)).max() < 2e-3
    assert np.abs(np.linalg.norm(hits.position, axis=1) - 0.5).max() < 1e-3
    # it fills a disc: tan of its half angle is 0.5/√(9 − 0.25), the picture's half height tan 20°
    share = np.pi * (0.5 / np.sqrt(8.75) / np.tan(np.radians(20)) * 24) ** 2 / (64 * 48)
    assert len(hits.pixel) / (64 * 48) == pytest.approx(share, rel=0.02)
    assert (hits.object_image == -1).sum() == 64 * 48 - len(hits.pixel)


def test_flat_objects_show_their_faces(scene_file):
    _, hits = trace(scene_file(SPHERE + "smooth = false\n", view((0, 0, 3))))
    assert np.array_equal(hits.normal, hits.geometric_normal)


def test_both_sides_reflect(scene_file):
    _, front = trace(scene_file(CARD, view((0, 0, 3))))
    _, back = trace(scene_file(CARD, view((0, 0, -3))))
    assert len(front.pixel) == len(back.pixel) > 0
    assert np.allclose(front.normal, [0, 0, 1]) and np.allclose(back.normal, [0, 0, -1])  # each toward its eye
    assert (back.offset_position[:, 2] < back.position[:, 2]).all()  # lifted to the eye's side


def test_a_normal_that_leans_away_is_bent_to_the_camera_and_stays_on_its_side(scene_file, mesh_file):
    head = "ply\nformat ascii 1.0\nelement vertex 3\n" + "".join(
        f"property float {n}\n" for n in ("x", "y", "z", "nx", "ny", "nz")
    )
    text = head + "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    # the face looks along +Z, its vertex normals along +X: from the left the eye sees the front, but n·wo < 0
    mesh_file("t.ply", text + "-1 -1 0 1 0 0.01\n1 -1 0 1 0 0.01\n0 1 0 1 0 0.01\n3 0 1 2\n")
    scene, hits = trace(scene_file(placed("t", "t.ply"), view((-3, 0, 0.5))))
    check_invariants(scene, hits)
    assert (hits.geometric_normal[:, 2] > 0.99).all()
    # Turned round by its own sign it would be -X and see what is behind the face. It is first the one in the plane of
    # the normal and the eye that the eye sees edge on: n - (n·wo) wo, normalized, and a hair towards the eye.
    wo = hits.wo.astype(np.float64)
    leaning = np.array([1.0, 0.0, 0.01]) / np.hypot(1.0, 0.01)
    edge_on = leaning + (0.001 - wo @ leaning)[:, None] * wo
    edge_on /= np.linalg.norm(edge_on, axis=1, keepdims=True)
    # It would mirror the eye into the face, so it becomes the half vector of the eye and a direction 0.025 above that.
    mirror = 2.0 * np.einsum("pk,pk->p", edge_on, wo)[:, None] * edge_on - wo
    assert (mirror[:, 2] < 0.0).all()
    mirror[:, 2] = 0.025
    half = wo + mirror / np.linalg.norm(mirror, axis=1, keepdims=True)
    assert np.abs(hits.normal - half / np.linalg.norm(half, axis=1, keepdims=True)).max() < 0.01
    assert np.einsum("pk,pk->p", hits.normal, hits.wo).min() > 0
    assert np.einsum("pk,pk->p", hits.normal, hits.geometric_normal).min() > 0


def test_no_normal_of_a_smooth_surface_mirrors_the_eye_into_its_faces(scene_file, tmp_path):
    ball = trimesh.creation.icosphere(subdivisions=1, radius=0.5)
    (tmp_path / "ball.ply").write_bytes(ball.export(file_type="ply", vertex_normal=True))
    scene, hits = trace(scene_file(placed("ball", "ball.ply"), view((0.3, 0.8, 2.5))))
    check_invariants(scene, hits)
    along, facing = (np.einsum("pk,pk->p", each, hits.wo) for each in (hits.normal, hits.geometric_normal))
    height = np.einsum("pk,pk->p", 2.0 * along[:, None] * hits.normal - hits.wo, hits.geometric_normal)
    # 80 triangles: normals lean away from their faces by up to 20 degrees, and so along the whole silhouette.
    assert (height >= np.minimum(0.9 * facing, 0.025) - 1e-3).all()
    assert (height < 0.03).mean() > 0.03
    # Where they do not, they stay between those of the vertices: the ball's own.
    inner = along > 0.6
    true = hits.position / np.linalg.norm(hits.position, axis=1, keepdims=True)
    assert inner.any() and np.einsum("pk,pk->p", hits.normal, true)[inner].min() > np.cos(np.radians(3.0))


def test_vertex_normals_that_cancel_fall_back_to_the_face(scene_file, mesh_file):
    head = "ply\nformat ascii 1.0\nelement vertex 3\n" + "".join(
        f"property float {n}\n" for n in ("x", "y", "z", "nx", "ny", "nz")
    )
    text = head + "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    # three normals at 120° in the plane: their mean at the centroid is zero
    mesh_file("t.ply", text + "-1 -1 0 1 0 0\n1 -1 0 -0.5 0.866025 0\n0 1 0 -0.5 -0.866025 0\n3 0 1 2\n")
    path = scene_file(placed("t", "t.ply"), view((0, -1 / 3, 3), (0, -1 / 3, 0), (1, 1), 1))
    scene, hits = trace(path)
    check_invariants(scene, hits)
    assert hits.normal[0] == pytest.approx([0, 0, 1])


def test_tangents_run_across_the_objects_axis(scene_file):
    _, hits = trace(scene_file(SPHERE, view((0, 0, 3))))
    # on a sphere Y × n is horizontal, east for an eye on +Z
    assert np.abs(hits.tangent[:, 1]).max() < 1e-6
    middle = np.abs(hits.normal[:, 0]) < 0.1
    assert (hits.tangent[middle, 0] > 0.9).all()
    # a quarter turn about Z takes the object's Y to world −X: tangents lose their X part
    turned = placed("ball", "sphere", "0,1,0,0, -1,0,0,0, 0,0,1,0, 0,0,0,1")
    _, hits = trace(scene_file(turned, view((0, 0, 3))))
    assert np.abs(hits.tangent[:, 0]).max() < 1e-6


def test_where_the_axis_is_the_normal_the_tangent_is_the_x_axis(scene_file):
    lying = placed("card", "quad", "1,0,0,0, 0,0,1,0, 0,1,0,0, 0,0,0,1")
    # the card's Y axis becomes world Z and its normal world −Y … seen from above it is turned up: t = Y × n
    _, hits = trace(scene_file(lying, view((0, 3, 0.1))))
    assert np.allclose(np.abs(hits.tangent), [1, 0, 0], atol=1e-6)
    _, hits = trace(scene_file(placed("box", "cube"), view((0, 3, 0.001))))
    assert np.allclose(hits.tangent, [1, 0, 0], atol=1e-6)  # on the top n = Y: the X axis


LAMP = placed("lamp", "quad", more="emission = [3, 2, 1]\n")


def test_emitters_are_pictures_that_shine_from_their_front(scene_file):
    scene, front = trace(scene_file(LAMP, view((0, 0, 3))))
    check_invariants(scene, front)
    assert len(front.pixel) == 0 and front.object_image[24, 32] == 0
    assert front.emission_image[24, 32].tolist() == [3, 2, 1] and front.emission_image[0, 0].tolist() == [0, 0, 0]
    _, back = trace(scene_file(LAMP, view((0, 0, -3))))
    assert back.object_image[24, 32] == 0 and not back.emission_image.any()  # dark from behind


def test_points_are_sorted_by_object(scene_file):
    far = placed("far", "quad", scaled((9, 9, 1), (0, 0, -2)))
    scene, hits = trace(scene_file(far + SPHERE + LAMP, view((0, 0, 3))))
    check_invariants(scene, hits)
    counts = hits.object_ranges[:, 1] - hits.object_ranges[:, 0]
    assert counts[0] > 0 and counts[1] >= 0 and counts[2] == 0  # a lamp has no shading points
    assert counts.sum() == len(hits.pixel)


def test_resolution_and_scale_do_not_change_what_is_seen(scene_file):
    path = scene_file(SPHERE, view((0, 0, 3)))
    _, small = trace(path)
    _, large = trace(path, (128, 96))
    assert large.resolution == (128, 96)
    assert len(large.pixel) == pytest.approx(4 * len(small.pixel), rel=0.02)


@pytest.mark.parametrize("scale", [1e-4, 1.0, 1e5])
def test_a_scene_may_be_tiny_huge_or_far_away(scene_file, scale):
    far = 1000 * scale
    ball = placed("ball", "sphere", scaled(scale, (far, 0, 0)))
    scene, hits = trace(scene_file(ball, view((far, 0, 3 * scale), (far, 0, 0))))
    check_invariants(scene, hits)
    _, plain = trace(scene_file(SPHERE, view((0, 0, 3))))
    assert np.array_equal(hits.object_image, plain.object_image)  # a thousand diameters from the origin: the same
    assert np.abs(hits.position / scale - plain.position).max() < 1e-4
    assert scene.origin[0] == pytest.approx(far)


NUMBERS = st.floats(-1e9, 1e9, allow_nan=False) | st.floats(-3, 3, allow_nan=False) | st.sampled_from([0.0, 1.0, 1e-9])


@settings(max_examples=150, deadline=None, derandomize=True)
@given(
    st.sampled_from(["quad", "cube", "sphere"]),
    st.lists(NUMBERS, min_size=12, max_size=12),
    st.tuples(NUMBERS, NUMBERS, NUMBERS),
    st.booleans(),
)
def test_no_placement_gives_a_number_that_is_none(primitive, entries, position, smooth):
    """Whatever the matrix and the eye: one line that says why not, or finite unit vectors. The sphere has a 64th of its
    triangles, as none of it depends on their number."""
    target = [entries[3], entries[7], entries[11]]
    tree = {
        "version": 1,
        "camera": {"position": position, "target": target, "resolution": [8, 6]},
        "object": [{"name": "a", "primitive": primitive, "transform": [*entries, 0, 0, 0, 1], "smooth": smooth}],
    }
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(primitives, "_RINGS", 8)
        patch.setattr(primitives, "_SEGMENTS", 16)
        try:
            scene = build_scene(parse_description(tree, "f"), Path("f"))
        except LoadError:
            return
    check_invariants(scene, trace_primary(scene, RayCaster(scene.vertices, scene.triangles)))


@pytest.mark.parametrize(("name", "n_objects"), [("teatray", 3), ("bunny", 4), ("cornell", 8)])
def test_the_reference_scenes(shared_reference, name, n_objects):
    image = pytest.importorskip("PIL.Image")
    scene, hits = trace(shared_reference / f"{name}.toml")
    check_invariants(scene, hits)
    assert len(hits.object_ranges) == n_objects and scene.notes == ()
    with image.open(shared_reference / f"{name}_mask.png") as mask:
        counted = np.array(mask.convert("L")) > 127
    seen = np.zeros(counted.size, bool)
    seen[hits.pixel] = True
    assert not (counted.reshape(-1) & ~seen).any()  # every pixel the references count has a shading point
    if name == "cornell":
        assert hits.emission_image.max() == pytest.approx(18.4)  # its lamp is seen from the front
