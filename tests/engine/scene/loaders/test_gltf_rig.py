"""Skins, morph targets and animations of GLB files: read, refused, and evaluated; beside a twin that follows the
specification vertex by vertex."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from engine.realtime.zonal_harmonics.pose import Pose
from engine.realtime.zonal_harmonics.posed_scene import animated_pose, sample_clip
from engine.scene.loaders.gltf import ImportedModel, ImportedPart, read_gltf
from engine.scene.rig import Clip, Track
from engine.scene.scene_loader import Scene, load_scene
from tests.engine.scene.conftest import n_calls
from tests.scene_text import placed

HALF = float(np.sqrt(0.5))
QUARTER_ABOUT_Z = [0.0, 0.0, HALF, HALF]
RAISED = np.eye(4, dtype="<f4")
RAISED[1, 3] = -1.0  # the second joint stands at y = 1
NAMES = {1: "SCALAR", 3: "VEC3", 4: "VEC4", 16: "MAT4"}
TYPES = {"f4": 5126, "u1": 5121, "u2": 5123}


class Bar:
    """A bar along +Y of 3 triangles on two joints, the upper at y = 1, which an animation bends by a quarter turn: a
    file's tree and binary chunk, to be spoilt by tests."""

    def __init__(self) -> None:
        self.tree: dict[str, Any] = {
            "asset": {"version": "2.0"},
            "scenes": [{"nodes": [0, 1]}],
            "nodes": [
                {"mesh": 0, "skin": 0},
                {"children": [2]},
                {"translation": [0, 1, 0]},
            ],
            "accessors": [],
            "bufferViews": [],
        }
        self.binary = b""
        places = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [0, 2, 0]], "<f4")
        joints = np.array([[0, 0, 0, 0], [0, 0, 0, 0], [0, 1, 0, 0], [0, 1, 0, 0], [1, 0, 0, 0]], "<u1")
        weights = np.array([[1, 0, 0, 0], [1, 0, 0, 0], [0.5, 0.5, 0, 0], [0.5, 0.5, 0, 0], [1, 0, 0, 0]], "<f4")
        attributes = {"POSITION": self.add(places), "JOINTS_0": self.add(joints), "WEIGHTS_0": self.add(weights)}
        corners = self.add(np.array([[0], [1], [2], [1], [3], [2], [2], [3], [4]], "<u2"))
        self.primitive = {"attributes": attributes, "indices": corners}
        self.tree["meshes"] = [{"primitives": [self.primitive]}]
        maps = self.add(np.stack([np.eye(4, dtype="<f4"), RAISED]).swapaxes(1, 2).reshape(2, 16))
        self.tree["skins"] = [{"joints": [1, 2], "inverseBindMatrices": maps}]
        self.tree["animations"] = [{"name": "bend", "samplers": [], "channels": []}]
        self.turn = self.move(2, "rotation", [0, 1], [[0, 0, 0, 1], QUARTER_ABOUT_Z])

    def add(self, values: np.ndarray) -> int:
        """A new accessor's number."""
        rows = np.ascontiguousarray(values)
        view = {"buffer": 0, "byteOffset": len(self.binary), "byteLength": rows.nbytes}
        kind = {"bufferView": len(self.tree["bufferViews"]), "componentType": TYPES[rows.dtype.str[1:]]}
        self.tree["bufferViews"].append(view)
        self.tree["accessors"].append(kind | {"count": len(rows), "type": NAMES[rows.shape[1]]})
        self.binary += rows.tobytes() + b"\0" * (-rows.nbytes % 4)
        return len(self.tree["accessors"]) - 1

    def move(self, node: int, path: str, times: list, values: list, interpolation: str = "LINEAR") -> dict:
        """A new channel's sampler."""
        animation = self.tree["animations"][0]
        output = np.array(values, "<f4").reshape(len(values), -1)
        output = output.reshape(-1, 1) if path == "weights" else output
        sampler = {
            "input": self.add(np.array(times, "<f4").reshape(-1, 1)),
            "output": self.add(output),
            "interpolation": interpolation,
        }
        animation["channels"].append({"sampler": len(animation["samplers"]), "target": {"node": node, "path": path}})
        animation["samplers"].append(sampler)
        return sampler

    def morph(self, offsets: np.ndarray, **more: np.ndarray) -> None:
        target = {"POSITION": self.add(offsets.astype("<f4"))}
        target |= {key: self.add(values.astype("<f4")) for key, values in more.items()}
        self.primitive.setdefault("targets", []).append(target)  # type: ignore[attr-defined]


@pytest.fixture
def bar() -> Bar:
    return Bar()


@pytest.fixture
def read(glb_file: Callable[..., Path]) -> Callable[[Bar], ImportedModel]:
    def of(bar: Bar) -> ImportedModel:
        return read_gltf(glb_file(bar.tree | {"buffers": [{"byteLength": len(bar.binary)}]}, bar.binary))

    return of


def resting(mesh: Any) -> Pose:
    return Pose(mesh.vertices, np.broadcast_to(np.eye(3), (len(mesh.vertices), 3, 3)).copy())


def at(model: ImportedModel, seconds: float, clip: str = "bend", loop: bool = True) -> Pose:
    (part,) = model.parts
    assert part.rig is not None
    return animated_pose(part.rig, resting(part.mesh), part.mesh.triangles, clip, seconds, loop)


def test_a_skin_bends_its_mesh_and_leaves_it_as_it_was_at_rest(bar: Bar, read: Callable) -> None:
    model = read(bar)
    mesh = model.parts[0].mesh
    assert model.notes == () and (at(model, 0.0).positions == mesh.vertices).all()
    bent = at(model, 1.0, loop=False)
    # the tip turns about (0, 1, 0) from straight up to the left; what hangs half on either goes half of the way
    assert bent.positions[4] == pytest.approx([-1.0, 1.0, 0.0], abs=1e-6)
    assert bent.positions[3] == pytest.approx([0.5, 1.5, 0.0], abs=1e-6)
    assert (bent.positions[:2] == mesh.vertices[:2]).all()
    assert bent.frames[4, 0] == pytest.approx([0.0, 1.0, 0.0], abs=1e-6)  # its tangent has turned with it
    assert at(model, 0.5).positions[4] == pytest.approx([-HALF, 1.0 + HALF, 0.0], abs=1e-6)


def test_times_beyond_the_ends_begin_anew_or_stay(bar: Bar, read: Callable) -> None:
    model = read(bar)
    assert (at(model, 2.25).positions == at(model, 0.25).positions).all()
    assert (at(model, -0.75).positions == at(model, 0.25).positions).all()
    assert (at(model, 1.0).positions == at(model, 1.0, loop=False).positions).all()  # its end is its own, not its start
    assert (at(model, 9.0, loop=False).positions == at(model, 1.0, loop=False).positions).all()
    assert (at(model, -9.0, loop=False).positions == at(model, 0.0).positions).all()
    with pytest.raises(ValueError, match="animation 'walk', expected one of bend"):
        at(model, 0.0, "walk")
    with pytest.raises(ValueError, match="time nan, expected a finite number"):
        at(model, float("nan"))


def test_one_key_holds_for_ever(bar: Bar, read: Callable) -> None:
    bar.tree["animations"][0] |= {"channels": [], "samplers": []}
    bar.move(2, "rotation", [0.5], [QUARTER_ABOUT_Z])
    model = read(bar)
    for seconds in (0.0, 0.5, 7.0):
        assert at(model, seconds).positions[4] == pytest.approx([-1.0, 1.0, 0.0], abs=1e-6)


def test_morph_targets_move_places_and_normals(bar: Bar, read: Callable) -> None:
    bar.tree["animations"][0] |= {"channels": [], "samplers": []}
    normals = np.tile(np.array([[0, 0, 1]], "<f4"), (5, 1))
    bar.primitive["attributes"]["NORMAL"] = bar.add(normals)  # type: ignore[index]
    bar.morph(np.outer(np.arange(5), [0, 0, 1.0]))
    bar.morph(np.tile([0, 0, 2.0], (5, 1)), NORMAL=np.tile([1.0, 0, 0], (5, 1)))
    bar.move(0, "weights", [0, 1], [[0.0, 0.0], [0.0, 1.0]])
    model = read(bar)
    mesh = model.parts[0].mesh
    assert (at(model, 0.0).positions == mesh.vertices).all()
    half = at(model, 0.5)
    assert half.positions == pytest.approx(mesh.vertices + [0.0, 0.0, 1.0])
    assert half.frames[:, 2] == pytest.approx(np.tile([0.5, 0.0, 1.0], (5, 1)) / np.sqrt(1.25))


def test_normals_of_a_morph_target_without_its_own_follow_its_triangles(bar: Bar, read: Callable) -> None:
    """A shear: z grows with y, so that normals lean back by 45 degrees."""
    bar.tree["animations"][0] |= {"channels": [], "samplers": []}
    bar.morph(np.array([[0, 0, y] for y in (0, 0, 1, 1, 2)]))
    bar.move(0, "weights", [0], [[1.0]])
    pose = at(read(bar), 0.0)
    assert pose.frames[:, 2] == pytest.approx(np.tile([0.0, -HALF, HALF], (5, 1)), abs=1e-9)


@pytest.mark.parametrize(
    ("interpolation", "values", "expected"),
    [
        ("LINEAR", [[0, 0, 0], [2, 0, 0]], 0.5),
        ("STEP", [[0, 0, 0], [2, 0, 0]], 0.0),
        # Hermite: 2 (3 s^2 - 2 s^3) with flat tangents, over 2 s in place of 1
        ("CUBICSPLINE", [[0, 0, 0], [0, 0, 0], [0, 0, 0], [0, 0, 0], [2, 0, 0], [0, 0, 0]], 0.3125),
        ("CUBICSPLINE", [[0, 0, 0], [0, 0, 0], [1, 0, 0], [1, 0, 0], [2, 0, 0], [0, 0, 0]], 0.5),
    ],
)
def test_between_keys(interpolation: str, values: list, expected: float) -> None:
    shape = (2, 3, 3) if interpolation == "CUBICSPLINE" else (2, 3)
    track = Track(0, "translation", interpolation, np.array([0.0, 2.0]), np.reshape(values, shape).astype(float))
    value = sample_clip(Clip("move", 2.0, (track,)), 0.5)[0, "translation"]
    assert value == pytest.approx([expected, 0.0, 0.0])


def test_rotations_go_the_shorter_way(bar: Bar, read: Callable) -> None:
    """A quaternion and its negative are one rotation."""
    bar.tree["animations"][0] |= {"channels": [], "samplers": []}
    bar.move(2, "rotation", [0, 1], [[0, 0, 0, 1], [-q for q in QUARTER_ABOUT_Z]])
    assert at(read(bar), 0.5).positions[4] == pytest.approx([-HALF, 1.0 + HALF, 0.0], abs=1e-6)


def test_weights_are_shares_and_who_has_none_hangs_on_its_first_joint(bar: Bar, read: Callable) -> None:
    weights = np.array([[1, 0, 0, 0], [7, 0, 0, 0], [3, 3, 0, 0], [0.1, 0.1, 0, 0], [0, 0, 0, 0]], "<f4")
    bar.primitive["attributes"]["WEIGHTS_0"] = bar.add(weights)  # type: ignore[index]
    model = read(bar)
    bent = at(model, 1.0, loop=False).positions
    assert bent[3] == pytest.approx([0.5, 1.5, 0.0], abs=1e-6)
    assert bent[4] == pytest.approx([-1.0, 1.0, 0.0], abs=1e-6)


@pytest.mark.parametrize(
    ("spoil", "line"),
    [
        (lambda bar: bar.primitive["attributes"].pop("WEIGHTS_0"), "without joints and weights follows its node"),
        (
            lambda bar: bar.primitive["attributes"].update(JOINTS_0=bar.add(np.full((5, 4), 2, "<u1"))),
            "joint of vertex 0 = 2, expected joints from 0 to 1",
        ),
        (
            lambda bar: bar.primitive["attributes"].update(WEIGHTS_0=bar.add(np.full((5, 4), -1, "<f4"))),
            "WEIGHTS of vertex 0 = [-1.0, -1.0, -1.0, -1.0], expected finite",
        ),
        (
            lambda bar: bar.primitive["attributes"].update(WEIGHTS_0=bar.add(np.full((5, 4), np.nan, "<f4"))),
            "WEIGHTS of vertex 0 = [nan",
        ),
        (lambda bar: bar.tree["skins"][0].update(joints=[1, 9]), "joints = [1, 9], expected a list of indices"),
        (lambda bar: bar.tree["skins"][0].update(joints=[]), "joints = none, expected at least one"),
        (lambda bar: bar.tree["skins"][0].update(joints=[1, 2, 0]), "2 matrices, expected 3 finite ones"),
        (lambda bar: bar.tree["nodes"][0].update(skin=4), "skin = 4, expected an integer from 0 to 0"),
        (lambda bar: bar.turn.update(input=bar.add(np.ones((2, 1), "<f4"))), "input = times that do not ascend"),
        (lambda bar: bar.turn.update(input=bar.add(np.array([[0], [1], [2]], "<f4"))), "8 numbers, expected 12"),
        (lambda bar: bar.turn.update(interpolation="CUBIC"), "interpolation = CUBIC, expected one of LINEAR, STEP"),
        (lambda bar: bar.turn.update(interpolation="CUBICSPLINE"), "8 numbers, expected 24 for 2 keys"),
        (lambda bar: bar.turn.update(output=bar.add(np.zeros((2, 4), "<f4"))), "a quaternion of length 0"),
        (lambda bar: bar.turn.update(output=bar.add(np.full((2, 4), np.inf, "<f4"))), "not finite"),
        (lambda bar: bar.tree["nodes"][2].update(matrix=np.eye(4).ravel().tolist()), "nodes 2, which has a matrix"),
        (lambda bar: bar.tree["animations"][0]["channels"][0].update(sampler=5), "sampler = 5, expected an integer"),
    ],
)
def test_what_cannot_be_read_rests_and_says_why(bar: Bar, read: Callable, spoil: Callable, line: str) -> None:
    spoil(bar)
    model = read(bar)
    (note,) = [each for each in model.notes if line in each]
    assert "\n" not in note
    (part,) = model.parts
    if part.rig is not None:
        assert (at(model, 0.7).positions == part.mesh.vertices).all()


def test_files_that_ask_for_too_much_rest(bar: Bar, read: Callable, monkeypatch: Any) -> None:
    monkeypatch.setattr("engine.scene.loaders.gltf_rig.MOST_NUMBERS", -100_000)
    assert any("numbers more, expected fewer in a file of this size" in note for note in read(bar).notes)


def test_a_rigid_node_carries_its_mesh(bar: Bar, read: Callable) -> None:
    bar.tree["nodes"] = [{"mesh": 0}, {"translation": [5, 0, 0], "children": [0]}]
    bar.tree["scenes"] = [{"nodes": [1]}]
    bar.tree["animations"][0] |= {"channels": [], "samplers": []}
    bar.move(1, "translation", [0, 1], [[5, 0, 0], [7, 0, 0]])
    model = read(bar)
    rest = model.parts[0].mesh.vertices
    assert rest[0] == pytest.approx([5, 0, 0])
    assert (at(model, 0.0).positions == rest).all()
    assert at(model, 0.5).positions == pytest.approx(rest + [1.0, 0.0, 0.0])


def test_sets_of_joints_that_share_numbers_are_no_more_than_a_file_is_worth(bar: Bar, read: Callable) -> None:
    """A few bytes each, and gigabytes for all of them."""
    places = bar.add(np.zeros((5000, 3), "<f4"))
    joints, weights = bar.add(np.zeros((5000, 4), "<u1")), bar.add(np.ones((5000, 4), "<f4"))
    sets = {f"{name}_{k}": number for k in range(2000) for name, number in (("JOINTS", joints), ("WEIGHTS", weights))}
    bar.primitive["attributes"] = {"POSITION": places} | sets
    assert any("JOINTS_" in note and "numbers more" in note for note in read(bar).notes)


SMALL_AND_ASIDE = np.diag([0.01, 0.01, 0.01, 1.0])
SMALL_AND_ASIDE[:3, 3] = [7.0, 0.0, 0.0]


@pytest.mark.parametrize("animated", [True, False])
def test_joints_alone_place_a_skin_at_rest_too(bar: Bar, read: Callable, animated: bool) -> None:
    """Its mesh node is scaled and aside, which counts for nothing; its upper joint rests turned by a quarter."""
    bar.tree["nodes"][0]["matrix"] = SMALL_AND_ASIDE.T.ravel().tolist()
    bar.tree["nodes"][2]["rotation"] = QUARTER_ABOUT_Z
    normals = np.tile(np.array([[1, 0, 0]], "<f4"), (5, 1))
    bar.primitive["attributes"]["NORMAL"] = bar.add(normals)  # type: ignore[index]
    if not animated:
        del bar.tree["animations"]
    model = read(bar)
    (part,) = model.parts
    assert part.mesh.vertices[4] == pytest.approx([-1.0, 1.0, 0.0], abs=1e-6)
    assert part.mesh.vertices[3] == pytest.approx([0.5, 1.5, 0.0], abs=1e-6)
    assert part.mesh.vertices[:2] == pytest.approx(np.array([[0, 0, 0], [1, 0, 0]]))
    assert part.mesh.normals is not None
    assert part.mesh.normals[[0, 3, 4]] == pytest.approx(np.array([[1, 0, 0], [HALF, HALF, 0], [0, 1, 0]]), abs=1e-6)
    if animated:  # which turns the joint back up at first
        up = at(model, 0.0)
        assert up.positions[4] == pytest.approx([0.0, 2.0, 0.0], abs=1e-6)
        assert at(model, 1.0, loop=False).positions == pytest.approx(part.mesh.vertices)
        rest = Pose(part.mesh.vertices, np.tile(np.array([[[0, 0, 1], [1, 0, 0], [0, 1, 0]]]), (5, 1, 1)).astype(float))
        assert part.rig is not None
        turned = animated_pose(part.rig, rest, part.mesh.triangles, "bend", 0.0)
        assert turned.frames[4, 2] == pytest.approx([1.0, 0.0, 0.0], abs=1e-6)  # as it was before any bone


def test_a_skin_alone_is_framed_where_it_rests(bar: Bar, glb_file: Callable[..., Path]) -> None:
    """Floor and camera are those of the same file with its mesh node where the skeleton stands."""
    scenes = []
    for matrix in (np.eye(4), SMALL_AND_ASIDE):
        bar.tree["nodes"][0]["matrix"] = matrix.T.ravel().tolist()
        path = glb_file(bar.tree | {"buffers": [{"byteLength": len(bar.binary)}]}, bar.binary)
        scenes.append(load_scene(path))
    one, two = scenes
    assert one.description.camera == two.description.camera
    assert (one.vertices == two.vertices).all() and np.ptp(one.vertices[:5], axis=0).tolist() == [1.0, 2.0, 0.0]


def test_a_joint_that_mirrors_turns_the_winding(bar: Bar, read: Callable) -> None:
    bar.tree["nodes"][1]["scale"] = [-1, 1, 1]
    normals = np.tile(np.array([[0, 0, 1]], "<f4"), (5, 1))
    bar.primitive["attributes"]["NORMAL"] = bar.add(normals)  # type: ignore[index]
    mesh = read(bar).parts[0].mesh
    corners = mesh.vertices[mesh.triangles]
    assert (np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2] > 0).all()
    assert mesh.normals == pytest.approx(np.tile([0.0, 0.0, 1.0], (5, 1)))


@pytest.mark.parametrize("owner", ["node", "mesh"])
@pytest.mark.parametrize("animated", [True, False])
def test_weights_of_morph_targets_count_at_rest(bar: Bar, read: Callable, owner: str, animated: bool) -> None:
    bar.tree["nodes"][0] = {"mesh": 0, "translation": [0, 0, 3]}
    bar.primitive["attributes"].pop("JOINTS_0")  # type: ignore[attr-defined]
    bar.morph(np.tile([0, 0, 2.0], (5, 1)))
    (bar.tree["nodes"] if owner == "node" else bar.tree["meshes"])[0]["weights"] = [0.5]
    if animated:
        bar.tree["animations"][0] |= {"channels": [], "samplers": []}
        bar.move(0, "weights", [0, 1], [[0.0], [1.0]])
    else:
        del bar.tree["animations"]
    model = read(bar)
    mesh = model.parts[0].mesh
    assert mesh.vertices[4] == pytest.approx([0.0, 2.0, 4.0])
    if animated:
        assert at(model, 0.0).positions[4] == pytest.approx([0.0, 2.0, 3.0])
        assert (at(model, 0.5).positions == mesh.vertices).all()
        assert at(model, 1.0, loop=False).positions[4] == pytest.approx([0.0, 2.0, 5.0])


def test_many_animations_of_one_name(bar: Bar, read: Callable) -> None:
    """Each has a name of its own, in a time that grows with their number."""
    (bend,) = bar.tree["animations"]
    names = ["bend", "bend (2)"] + ["bend"] * 3000
    bar.tree["animations"] = [bend | {"name": name} for name in names]
    read(bar)  # what is imported at first is not counted
    parts: list[ImportedPart] = []
    assert n_calls(lambda: parts.extend(read(bar).parts)) < 450 * len(names)
    (part,) = parts
    assert part.rig is not None
    found = [clip.name for clip in part.rig.skeleton.clips]
    assert len(set(found)) == len(names) and found[:4] == ["bend", "bend (2)", "bend (3)", "bend (4)"]


def test_names_of_animations_can_be_shown_and_written(bar: Bar, read: Callable) -> None:
    (bend,) = bar.tree["animations"]
    bar.tree["animations"] = [bend | {"name": name} for name in ("w" * 5000, "a\ud800\x1b[2J\nb", " \t", "x" * 64)]
    (part,) = read(bar).parts
    assert part.rig is not None
    names = [clip.name for clip in part.rig.skeleton.clips]
    assert names == ["w" * 63 + "…", "a��[2J b", "animation 2", "x" * 64]
    assert all(name.encode() and name.isprintable() for name in names)


def rest_of(scene: Scene) -> tuple[Pose, np.ndarray]:
    start, stop = scene.vertex_ranges[0]
    first, last = scene.triangle_ranges[0]
    vertices = scene.vertices[start:stop].astype(float)
    return Pose(vertices, np.tile(np.eye(3), (len(vertices), 1, 1))), scene.triangles[first:last] - start


def test_an_object_moves_in_the_scene_it_was_placed_in(
    bar: Bar, glb_file: Callable, scene_file: Callable[..., Path]
) -> None:
    """Twice as large, turned by a quarter about Y and far off, so that the scene has an origin of its own."""
    glb_file(bar.tree | {"buffers": [{"byteLength": len(bar.binary)}]}, bar.binary)
    scene = load_scene(scene_file(placed("bar", "model.glb", "0,0,2,1000, 0,2,0,0, -2,0,0,0, 0,0,0,1")))
    rest, triangles = rest_of(scene)
    pose = animated_pose(scene.rigs[0], rest, triangles, "bend", 1.0, loop=False)
    # (-1, 1, 0) in the file
    assert pose.positions[4] + scene.origin == pytest.approx([1000.0, 2.0, 2.0], abs=1e-3)
    assert (animated_pose(scene.rigs[0], rest, triangles, "bend", 0.0).positions == rest.positions).all()


def test_channels_that_can_be_read_play_beside_others(bar: Bar, read: Callable) -> None:
    """An animation whose second channel is faulty moves by its first; one without a good channel is not offered."""
    (bend,) = bar.tree["animations"]
    expected = at(read(bar), 0.7).positions
    bar.tree["animations"] = [
        bend | {"channels": [*bend["channels"], {"sampler": 9, "target": {"node": 2, "path": "scale"}}]},
        bend | {"name": "none", "channels": [{"sampler": 9, "target": {"node": 2, "path": "scale"}}]},
    ]
    model = read(bar)
    assert [clip.name for clip in model.parts[0].rig.skeleton.clips] == [bend["name"]]
    assert np.array_equal(at(model, 0.7).positions, expected)
    (fault,) = [each for each in model.unshown if each.name == "animations.channels.target"]
    assert fault.count == 2
