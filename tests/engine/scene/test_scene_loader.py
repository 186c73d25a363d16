"""Loading scenes into arrays: ranges, placement, notes on defects, and errors."""

import os

import numpy as np
import pytest

from engine.core.errors import LoadError
from engine.scene.mesh import face_normals
from engine.scene.scene_loader import load_scene
from tests.engine.scene.conftest import CARD
from tests.engine.scene.conftest import TRIANGLE_PLY as TRIANGLE
from tests.scene_text import LAMBERT, camera, environment, placed, scaled


def mesh_object(name: str, more: str = "") -> str:
    return f'[[object]]\nname = "thing"\nmesh = "{name}"\n{more}\n'


def test_objects_are_joined_and_keep_their_ranges(scene_file, mesh_file):
    mesh_file("t.ply", TRIANGLE)
    moved = "transform = [2,0,0,5, 0,2,0,0, 0,0,2,0, 0,0,0,1]\nsmooth = false\nemission = 4"
    scene = load_scene(scene_file(CARD + mesh_object("t.ply", moved)))
    assert scene.triangles.tolist() == [[0, 1, 2], [0, 2, 3], [4, 5, 6]]
    assert scene.object_of_triangle.tolist() == [0, 0, 1] and scene.triangle_ranges.tolist() == [[0, 2], [2, 3]]
    assert scene.vertices[4:].tolist() == [[5, 0, 0], [7, 0, 0], [5, 2, 0]]  # scaled by 2, moved by 5
    assert scene.smooth.tolist() == [True, False]
    assert scene.emission.tolist() == [[0, 0, 0], [4, 4, 4]] and scene.emitters.tolist() == [False, True]
    assert scene.geometric_normals.tolist() == [[0, 0, 1]] * 3
    assert scene.vertices.dtype == scene.normals.dtype == np.float32 and scene.triangles.dtype == np.int32
    assert scene.origin.tolist() == [0, 0, 0] and scene.resolution == (32, 24)
    assert load_scene(scene_file(), (7, 5)).resolution == (7, 5)


def test_one_file_may_serve_several_objects(scene_file, mesh_file):
    mesh_file("t.ply", TRIANGLE)
    scene = load_scene(scene_file(mesh_object("t.ply") + mesh_object("t.ply").replace("thing", "other")))
    assert len(scene.vertices) == 6


def test_mirrored_objects_face_outward(scene_file):
    scene = load_scene(scene_file(placed("ball", "sphere", scaled((1, -1, 1)))))
    centres = scene.vertices[scene.triangles].mean(axis=1)
    assert (np.einsum("tk,tk->t", scene.geometric_normals, centres) > 0).all()


def test_oddities_are_noted_by_object(scene_file, mesh_file):
    text = TRIANGLE.replace("element face 1", "element face 3").replace("\n3 0 1 2\n", "\n3 0 1 2\n3 0 1 1\n3 2 1 0\n")
    mesh_file("t.ply", text)
    scene = load_scene(scene_file(mesh_object("t.ply", LAMBERT)))
    assert scene.notes == ("thing: 1 faces that repeat another left out", "thing: 1 faces without area left out")
    assert len(scene.triangles) == 1 and np.isfinite(scene.normals).all()


def test_an_object_without_layers_is_grey_and_said_to_be(scene_file, mesh_file):
    mesh_file("t.ply", TRIANGLE)
    lamp = placed("lamp", "quad", more="emission = 1\n")
    scene = load_scene(scene_file(CARD + mesh_object("t.ply") + lamp))
    card, thing, shining = scene.description.objects
    for bare in (card, thing):
        (layer,) = bare.layers
        assert layer.model == "lambert" and layer.parameters == {"albedo": (0.5, 0.5, 0.5)} and bare.editable
    assert shining.layers == ()  # what shines needs none
    assert scene.notes == ("card, thing: without a material, shown in a grey that can be edited",)
    many = "".join(placed(f"card {k}", "quad") for k in range(5))
    assert load_scene(scene_file(many)).notes[0].startswith("card 0, card 1, card 2 and 2 more: without a material")


def test_a_scene_far_from_the_origin_keeps_its_detail(scene_file):
    ball = placed("ball", "sphere", scaled(1, (1e6, 0, -2e6)))
    scene = load_scene(scene_file(ball, camera((1e6, 0, -1999997), target=(1e6, 0, -2e6))))
    assert scene.origin.tolist() == pytest.approx([1e6, 0, -2e6])
    assert scene.camera_position.tolist() == pytest.approx([0, 0, 3])
    # float32 at two million resolves 0.125 m; relative to the origin the sphere stays round
    assert np.abs(np.linalg.norm(scene.vertices, axis=1) - 0.5).max() < 1e-6


def test_a_distant_lamp_does_not_take_the_detail_of_what_it_lights(scene_file):
    lamp = placed("lamp", "quad", scaled(0.1, (-1e6, 0, 0)), "emission = 4\n")
    scene = load_scene(scene_file(CARD + lamp))
    assert scene.origin.tolist() == [0, 0, 0]
    assert scene.vertices[:4].tolist() == [[-0.5, -0.5, 0], [0.5, -0.5, 0], [0.5, 0.5, 0], [-0.5, 0.5, 0]]


def test_each_object_has_its_box_in_the_world(scene_file):
    # Cubes 1 m wide: one doubled and a kilometre off; one turned by 45 degrees about Y, as wide as its diagonal.
    c = 0.5**0.5
    turned = placed("turned", "cube", f"{c},0,{c},0, 0,1,0,2, {-c},0,{c},0, 0,0,0,1")
    scene = load_scene(scene_file(placed("far", "cube", scaled(2, (1e3, 0, 0))) + turned))
    far, about_y = scene.bounds
    np.testing.assert_allclose(far, [[999, -1, -1], [1001, 1, 1]], atol=1e-3)
    np.testing.assert_allclose(about_y, [[-c, 1.5, -c], [c, 2.5, c]], atol=1e-6)


def test_the_environments_path_is_resolved_but_not_read(scene_file):
    path = scene_file(CARD, camera((0, 0, 3)) + environment(file="sky.exr"))
    assert load_scene(path).environment_path == path.parent.resolve() / "sky.exr"
    for name in ("../sky.exr", "/sky.exr", "http://x.org/sky.exr"):
        bad = scene_file(CARD, camera((0, 0, 3)) + environment(file=name))
        with pytest.raises(LoadError, match="scene.toml: environment: file = .*inside the scene's folder"):
            load_scene(bad)


@pytest.mark.parametrize("name", ["../t.ply", "/etc/passwd", "http://x.org/t.ply", "a/../../t.ply"])
def test_meshes_outside_the_folder_are_refused(scene_file, name):
    with pytest.raises(LoadError, match="scene.toml: object 'thing': mesh = .*inside the scene's folder"):
        load_scene(scene_file(mesh_object(name)))


def test_pipes_links_and_missing_files_do_not_hang(scene_file, tmp_path):
    os.mkfifo(tmp_path / "pipe.ply")
    os.mkfifo(tmp_path / "pipe.glb")
    (tmp_path / "out.ply").symlink_to("/etc/passwd")
    for name, line in [
        ("pipe.ply", "a named pipe"),
        ("pipe.glb", "a named pipe"),
        ("absent.obj", "No such file"),
        ("out.ply", "outside the scene folder"),
    ]:
        with pytest.raises(LoadError, match=line):
            load_scene(scene_file(mesh_object(name)))  # a pipe without a writer would wait for ever


def test_archives_are_no_meshes(scene_file, mesh_file):
    for name in ("bomb.zip", "bomb.ply.bz2", "bomb.tar.gz"):
        mesh_file(name, b"PK\x03\x04")
        with pytest.raises(LoadError, match="expected a mesh of type .glb, "):
            load_scene(scene_file(mesh_object(name)))


def test_files_over_the_cap_are_refused_before_they_are_read(scene_file, mesh_file, monkeypatch):
    monkeypatch.setattr("engine.scene.loaders.ply.MAX_MESH_BYTES", 100)
    mesh_file("t.ply", TRIANGLE)
    with pytest.raises(LoadError, match="size = .* bytes, expected at most 100 bytes"):
        load_scene(scene_file(mesh_object("t.ply")))


@pytest.mark.parametrize(
    ("vertices", "more", "line"),
    [
        ("0 0 0\n0 0 0\n0 0 0", "", "object 'thing': faces with an area = 0, expected at least one"),
        (
            "0 0 0\n1e8 0 0\n0 1e8 0",
            "transform = [100,0,0,0, 0,100,0,0, 0,0,100,0, 0,0,0,1]",
            "object 'thing': coordinates once placed = 1e+10, expected at most 1e+09 m",
        ),
        ("0 0 0\n1e-12 0 0\n0 1e-12 0", "", "extent of the scene = 1e-12 m, expected at least"),
    ],
)
def test_geometry_that_cannot_be_shown_is_refused(scene_file, mesh_file, vertices, more, line):
    mesh_file("t.ply", TRIANGLE.replace("0 0 0\n1 0 0\n0 1 0", vertices))
    with pytest.raises(LoadError) as caught:
        load_scene(scene_file(mesh_object("t.ply", more)))
    assert line in str(caught.value)


def test_a_part_is_one_of_the_file(scene_file, mesh_file):
    mesh_file("t.ply", TRIANGLE)
    with pytest.raises(LoadError, match="object 'thing': part = 1, expected no part"):
        load_scene(scene_file(mesh_object("t.ply", "part = 1")))


def test_a_failed_load_changes_nothing(scene_file, tmp_path):
    path = scene_file(mesh_object("absent.ply"))
    before = {p.name: p.read_bytes() for p in tmp_path.iterdir()}
    with pytest.raises(LoadError, match="nothing was changed"):
        load_scene(path)
    assert {p.name: p.read_bytes() for p in tmp_path.iterdir()} == before


@pytest.mark.parametrize("name", ["teatray", "bunny", "cornell"])
def test_the_reference_scenes_load_as_they_are(shared_reference, name):
    scene = load_scene(shared_reference / f"{name}.toml")
    assert np.isfinite(scene.vertices).all() and np.isfinite(scene.normals).all()
    assert np.abs(np.linalg.norm(scene.normals, axis=1) - 1).max() < 1e-5
    flat, solid = face_normals(scene.vertices, scene.triangles)
    assert solid.all() and np.abs(flat - scene.geometric_normals).max() < 1e-6
    assert scene.environment_path is None or scene.environment_path.is_file()
