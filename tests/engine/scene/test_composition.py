"""Scenes with other objects than their files: equal to a file that has these objects."""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

from engine.core.errors import InsituError, LoadError
from engine.scene.added_objects import read_added
from engine.scene.composed_scene import SceneComposer, compose_scene
from engine.scene.composition import Composition, SceneObject
from engine.scene.description import ObjectDescription
from engine.scene.raycaster import RayCaster
from engine.scene.scene_loader import Scene, load_scene
from tests.engine.scene.conftest import TOY, TRIANGLE_PLY
from tests.scene_text import placed, scaled

# What is the same only for one file: its path, and what was read.
_OF_THE_FILE = ("file", "folder", "files", "notes", "description", "textures")
OBJECTS = {
    "card": placed("card", "quad"), "ball": placed("ball", "sphere"), "box": placed("box", "cube"), "toy": TOY,
}  # fmt: skip


def named(*names: str) -> Composition:
    return tuple(SceneObject(name, name) for name in names)


def assert_same_arrays(found: Scene, expected: Scene) -> None:
    assert found.description.objects == expected.description.objects
    for name in {each.name for each in fields(Scene)} - set(_OF_THE_FILE):
        a, b = getattr(found, name), getattr(expected, name)
        if isinstance(a, np.ndarray):
            assert a.dtype == b.dtype and np.array_equal(a, b), name
        else:
            assert a == b, name


@pytest.fixture
def scene(glb_file: Callable[..., Path], triangle_glb: tuple[dict, bytes], scene_file: Callable[..., Path]) -> Scene:
    glb_file(*triangle_glb)
    return load_scene(scene_file("".join(OBJECTS.values())))


def test_the_same_objects_are_the_same_scene(scene: Scene) -> None:
    assert_same_arrays(compose_scene(scene, named(*OBJECTS)), scene)


def test_any_selection_in_any_order_equals_a_file_of_it(scene: Scene, scene_file: Callable[..., Path]) -> None:
    shuffle = random.Random(7)
    for _ in range(12):
        names = shuffle.sample(list(OBJECTS), shuffle.randint(1, len(OBJECTS)))
        expected = load_scene(scene_file("".join(OBJECTS[name] for name in names)))
        found = compose_scene(scene, named(*names))
        # Texture coordinates of objects that have none are zeros where another object of the file has some.
        assert found.uvs is not None
        if expected.uvs is None:
            assert not found.has_uvs.any()
        else:
            assert np.array_equal(found.uvs, expected.uvs)
        assert np.array_equal(found.vertices, expected.vertices) and np.array_equal(found.triangles, expected.triangles)
        assert np.array_equal(found.object_of_triangle, expected.object_of_triangle)
        assert found.object_names == expected.object_names == tuple(names)


def test_duplicates_share_their_file_and_images(scene: Scene) -> None:
    composer = SceneComposer(scene)
    (scene.folder / "model.glb").unlink()  # it is not read again
    found = composer.compose_all((*named(*OBJECTS), *(SceneObject(f"toy {k}", "toy") for k in (2, 3, 4))))
    assert len(found.description.objects) == 7 and found.textures is scene.textures
    # Each has triangles of its own, and nothing besides.
    n_own = len(scene.triangles[slice(*scene.triangle_ranges[3])])
    assert len(found.triangles) == len(scene.triangles) + 3 * n_own


def test_a_duplicate_has_the_arrays_of_its_original(scene: Scene) -> None:
    file, transform = str(scene.folder / "model.glb"), scene.description.objects[3].transform
    copy = ObjectDescription(name="toy", mesh=file, part=0, transform=transform)
    found = compose_scene(scene, (*named(*OBJECTS), SceneObject("toy 2", copy)))
    assert found.object_names == (*OBJECTS, "toy 2")
    own, there = (slice(*found.vertex_ranges[i]) for i in (3, 4))
    assert np.array_equal(found.vertices[own], found.vertices[there])
    corners = [found.vertices[found.triangles[slice(*found.triangle_ranges[i])]] for i in (3, 4)]
    assert np.array_equal(*corners)


def test_an_added_object_is_relative_to_the_origin_of_the_scene(
    scene_file: Callable[..., Path],
) -> None:
    at = scaled(1, (1e6, 0, 0))
    scene = load_scene(scene_file(placed("card", "quad", at)))
    assert scene.origin[0] == pytest.approx(1e6)
    added = ObjectDescription(name="ball", primitive="sphere", transform=tuple(map(float, at.split(","))))
    found = compose_scene(scene, (*named("card"), SceneObject("ball", added)))
    assert np.array_equal(found.origin, scene.origin)
    vertices = found.vertices[slice(*found.vertex_ranges[1])]
    assert np.allclose(np.linalg.norm(vertices, axis=1), 0.5, atol=1e-6)


def test_a_file_with_several_materials_becomes_its_parts(
    scene: Scene, triangle_glb: tuple[dict, bytes], glb_file: Callable[..., Path]
) -> None:
    tree, binary = triangle_glb
    (primitive,) = tree["meshes"][0]["primitives"]
    tree["materials"] = [{"name": "red"}, {"name": "blue"}]
    tree["meshes"][0]["primitives"] = [primitive | {"material": k} for k in range(2)]
    file = glb_file(tree, binary)
    parts = read_added(str(file), scene).objects
    assert [part.source.part for part in parts] == [0, 1]
    composition = (*named("card"), *(SceneObject(part.description.name, part.source) for part in parts))
    found = compose_scene(scene, composition)
    assert found.object_names == ("card", *(part.description.name for part in parts))
    assert file in found.files


def test_objects_that_are_there_are_not_read_again(scene: Scene, tmp_path: Path) -> None:
    file = tmp_path / "added.ply"
    file.write_text(TRIANGLE_PLY)
    composer, read = SceneComposer(scene), read_added(str(file), scene)
    (added,) = read.objects
    composer.note(read.parts)
    file.unlink()
    assert composer.compose(named("ball")).missing == ()
    for composition in (
        (*named("card"), SceneObject("added", added.source)),
        (SceneObject("other", added.source), *named("ball")),
        (SceneObject("other", added.source, is_hidden=True), *named("ball")),
    ):
        found = composer.compose(composition)
        assert found.scene.object_names == tuple(each.name for each in composition) and not found.problems
    # It is forgotten once no picture has it: then it is to be read again, and its file has gone.
    composer.compose(named("ball"))
    found = composer.compose((SceneObject("other", added.source), *named("ball")))
    assert found.missing == (added.source,) and found.composition == named("ball")
    assert len(found.problems) == 1 and "added.ply" in found.problems[0]
    with pytest.raises(InsituError, match=r"added\.ply"):
        composer.compose_all(composition)


def test_a_hidden_object_keeps_its_place_and_has_no_surface(scene: Scene) -> None:
    names = list(OBJECTS)
    for hidden in (names[:1], names[1:3], names):
        found = compose_scene(scene, tuple(SceneObject(name, name, name in hidden) for name in names))
        shown = [name for name in names if name not in hidden]
        assert found.object_names == scene.object_names
        if not shown:  # a point is left, which no ray meets
            assert found.triangles.tolist() == [[0, 0, 0]] and np.ptp(found.bounds[0], axis=0).max() == 0.0
            up = np.float32([[0.0, 1.0, 0.0]])
            seen = RayCaster(found.vertices, found.triangles).intersect(found.vertices - up, up)
            assert (seen.triangle == -1).all() and np.isnan(found.bounds[1:]).all()
        else:
            expected = compose_scene(scene, named(*shown))
            assert np.array_equal(found.vertices, expected.vertices)
            assert np.array_equal(found.triangles, expected.triangles)
            assert np.isnan(found.bounds[[name in hidden for name in names]]).all()
    # Shown again it is as before.
    assert_same_arrays(compose_scene(scene, tuple(SceneObject(name, name, False) for name in names)), scene)


def test_a_scene_file_may_still_name_only_files_in_its_folder(scene: Scene, scene_file: Callable[..., Path]) -> None:
    outside = str(scene.folder / "model.glb")
    with pytest.raises(LoadError, match="a relative path to a file inside the scene's folder"):
        load_scene(scene_file(f'[[object]]\nname = "toy"\nmesh = "{outside}"\n'))
