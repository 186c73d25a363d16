"""Scenes far from the world's origin, as surveys have them: every face, and the picture, as at the origin.

A sphere of 1,280 faces, 1 m in radius, at coordinates of UTM and of an earth-centred frame: there neighbouring numbers
of single precision are 0.5 m apart.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from engine.scene.primary_hits import trace_primary
from engine.scene.raycaster import RayCaster
from engine.scene.scene_loader import Scene, load_scene
from engine.sphere.geodesic import geodesic
from tests.engine.scene.conftest import pack_glb
from tests.scene_text import camera, facing_up, placed, scaled

OFFSETS = {
    "UTM": (500_000.0, 4_600_000.0, 120.0),
    "UTM, Y up": (500_000.0, 120.0, -4_600_000.0),
    "earth-centred": (4_100_000.25, 700_000.5, 4_800_000.125),
}
SIZE = (24, 18)
SPHERE = geodesic(3)


def as_ply(offset: tuple[float, ...]) -> bytes:
    head = (
        "ply\nformat binary_little_endian 1.0\n"
        f"element vertex {len(SPHERE.vertices)}\nproperty double x\nproperty double y\nproperty double z\n"
        f"element face {len(SPHERE.triangles)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    faces = b"".join(struct.pack("<B3i", 3, *triangle) for triangle in SPHERE.triangles.tolist())
    return head.encode() + (SPHERE.vertices + np.array(offset)).astype("<f8").tobytes() + faces


def as_obj(offset: tuple[float, ...]) -> bytes:
    lines = ["v {:.9f} {:.9f} {:.9f}".format(*vertex) for vertex in (SPHERE.vertices + np.array(offset)).tolist()]
    lines += ["f {} {} {}".format(*triangle) for triangle in (SPHERE.triangles + 1).tolist()]
    return "\n".join(lines).encode()


def as_glb(offset: tuple[float, ...]) -> bytes:
    """The sphere at the origin in single precision, placed by nodes: one that takes it too far, one below it back."""
    vertices, corners = SPHERE.vertices.astype("<f4").tobytes(), SPHERE.triangles.astype("<u4").tobytes()
    n, m = len(SPHERE.vertices), SPHERE.triangles.size
    return pack_glb(
        {
            "asset": {"version": "2.0"},
            "buffers": [{"byteLength": 12 * n + 4 * m}],
            "bufferViews": [
                {"buffer": 0, "byteLength": 12 * n},
                {"buffer": 0, "byteOffset": 12 * n, "byteLength": 4 * m},
            ],
            "accessors": [
                {"bufferView": 0, "componentType": 5126, "count": n, "type": "VEC3"},
                {"bufferView": 1, "componentType": 5125, "count": m, "type": "SCALAR"},
            ],
            "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
            "nodes": [
                {"translation": [2.0 * each for each in offset], "children": [1]},
                {"translation": [-each for each in offset], "mesh": 0},
            ],
            "scenes": [{"nodes": [0]}],
        },
        vertices + corners,
    )


WRITERS = {"ply": as_ply, "obj": as_obj, "glb": as_glb}


def assert_the_same_picture(far: Scene, near: Scene) -> None:
    there, here = (trace_primary(scene, RayCaster(scene.vertices, scene.triangles)) for scene in (far, near))
    assert np.array_equal(there.object_image, here.object_image)
    assert np.array_equal(there.pixel, here.pixel)
    # The numbers of a file are good to 1e-9 m there, single precision to 1e-7 of the sphere.
    assert np.abs(there.normal - here.normal).max() < 1e-4
    assert np.abs((there.position - far.camera_position) - (here.position - near.camera_position)).max() < 1e-4


@pytest.mark.parametrize("kind", WRITERS)
@pytest.mark.parametrize("place", OFFSETS)
def test_a_mesh_alone_is_what_it_is_at_the_origin(mesh_file: Callable[..., Path], kind: str, place: str) -> None:
    offset = OFFSETS[place]
    near = load_scene(mesh_file(f"near.{kind}", WRITERS[kind]((0.0, 0.0, 0.0))), SIZE)
    far = load_scene(mesh_file(f"far.{kind}", WRITERS[kind](offset)), SIZE)
    assert (far.triangle_ranges == near.triangle_ranges).all() and far.triangle_ranges[0, 1] == 1280
    assert not any("faces" in note for note in far.notes)  # it was: 610 faces without area left out
    assert far.origin + far.vertices[:642].mean(axis=0) == pytest.approx(offset, abs=1e-3)
    assert_the_same_picture(far, near)


@pytest.mark.parametrize("kind", WRITERS)
def test_a_scene_may_place_it_where_it_is_and_bring_it_home(
    scene_file: Callable[..., Path], mesh_file: Callable[..., Path], kind: str
) -> None:
    offset = np.array(OFFSETS["earth-centred"])
    mesh_file(f"near.{kind}", WRITERS[kind]((0.0, 0.0, 0.0)))
    mesh_file(f"far.{kind}", WRITERS[kind](tuple(offset)))

    def scene(name: str, eye: np.ndarray, shift: np.ndarray) -> Scene:
        view = camera((eye + [0, 0.5, 4]).tolist(), target=eye.tolist())
        ball = placed("ball", f"{name}.{kind}", scaled(1, shift))
        floor = placed("floor", "quad", facing_up(40, eye - [0, 1, 0]))
        return load_scene(scene_file(ball + floor, view), SIZE)

    near = scene("near", np.zeros(3), np.zeros(3))
    for there in (scene("far", offset, np.zeros(3)), scene("far", np.zeros(3), -offset), scene("near", offset, offset)):
        assert len(there.triangles) == 1282
        assert_the_same_picture(there, near)


def test_a_vertex_of_no_face_at_the_origin_changes_nothing(mesh_file: Callable[..., Path]) -> None:
    lines = as_obj(OFFSETS["UTM"]).split(b"\n")
    text = b"\n".join([*lines[:642], b"v 0 0 0", *lines[642:]])
    near = load_scene(mesh_file("near.obj", as_obj((0.0, 0.0, 0.0))), SIZE)
    assert_the_same_picture(load_scene(mesh_file("far.obj", text), SIZE), near)


def test_what_is_too_small_to_tell_apart_so_far_from_the_others_is_said_to_be(
    scene_file: Callable[..., Path], mesh_file: Callable[..., Path]
) -> None:
    """One thing at the origin, another 10,000 km away: single precision cannot have both, and no file is to blame."""
    mesh_file("ball.ply", as_ply((0.0, 0.0, 0.0)))
    near = "".join(placed(f"ball {k}", "ball.ply") for k in range(3))
    scene = load_scene(scene_file(near + placed("far", "ball.ply", scaled(1, (1e7, 0, 0)))))
    (said,) = (note for note in scene.notes if "left out" in note)
    assert said.startswith("far: ") and "faces left out, too small to tell apart 1e+07 m" in said
    start, stop = scene.triangle_ranges[3]
    assert np.isfinite(scene.geometric_normals).all() and 0 < stop - start < 1280


def test_a_case_from_a_survey(shared_data: Path) -> None:
    scene = load_scene(shared_data / "cases" / "29-far-offset" / "minimal_ecef.ply", SIZE)
    assert scene.triangle_ranges[0].tolist() == [0, 2]
    # Two halves of a square of 0.1 m that faces down.
    corners = scene.vertices[scene.triangles[:2]].astype(np.float64)
    doubled = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert np.allclose(doubled, [0.0, 0.01, 0.0], atol=1e-6) or np.allclose(doubled, [0.0, -0.01, 0.0], atol=1e-6)


@pytest.mark.parametrize("height", [-0.3, -0.6, -0.9])
def test_a_small_lamp_does_not_move_the_room_around_it(scene_file: Callable[..., Path], height: float) -> None:
    """Strokes are kept in the scene's frame: they would lie elsewhere once the lamp is moved or made larger."""
    lamp = placed("lamp", "cube", scaled(0.02, (0, height, 0)), "emission = [9, 9, 9]\n")
    assert not load_scene(scene_file(placed("ball", "sphere", scaled(2)) + lamp), SIZE).origin.any()


def test_figures_far_out_on_a_wide_floor_keep_their_detail(scene_file: Callable[..., Path]) -> None:
    balls = "".join(placed(str(x), "sphere", scaled(1, (x, 1, 5000))) for x in (3000, 3002))
    scene = load_scene(scene_file(placed("floor", "quad", facing_up(40000)) + balls), SIZE)
    for own, x in zip(scene.vertex_ranges[1:], (3000, 3002), strict=True):
        away = scene.vertices[slice(*own)].astype(np.float64) - np.subtract((x, 1, 5000), scene.origin)
        # In single precision about the world's origin it is 2e-4.
        assert np.abs(np.linalg.norm(away, axis=1) - 0.5).max() < 1e-6
