"""Built-in scenes and environments load, and show what they are made for."""

import numpy as np
import pytest

from engine.light.environment import load_environment
from engine.material import MODELS, validate_parameters
from engine.realtime.zonal_harmonics.pose import Pose
from engine.realtime.zonal_harmonics.posed_scene import animated_pose
from engine.scene.builtin import builtin_environments, builtin_scenes
from engine.scene.description import load_description
from engine.scene.scene_loader import load_scene

SCENES = [  # default first
    "teatray", "ajar", "amphora", "bat", "cornell", "dominoes", "earrings", "empty", "idol", "mime", "plant", "plate",
    "ring", "rings", "room", "shapes", "stairwell", "storeroom", "vase",
]  # fmt: skip


def test_names() -> None:
    assert list(builtin_scenes()) == SCENES
    assert list(builtin_environments()) == ["hall", "sky", "studio"]


@pytest.mark.parametrize("name", builtin_scenes())
def test_scene_loads_without_a_complaint(name: str) -> None:
    scene = load_scene(builtin_scenes()[name])
    assert scene.description.name == name
    assert scene.notes == ()
    # Nothing of it is wasted: every object has faces.
    assert np.array_equal(np.unique(scene.object_of_triangle), np.arange(len(scene.description.objects)))


@pytest.mark.parametrize("name", builtin_scenes())
def test_layers_are_of_known_models_with_valid_parameters(name: str) -> None:
    path = builtin_scenes()[name]
    for item in load_description(path).objects:
        for i, layer in enumerate(item.layers):
            assert layer.model in MODELS
            validate_parameters(MODELS[layer.model], layer.parameters, f"{path}: {item.name}.{i}")


@pytest.mark.parametrize("name", builtin_environments())
def test_environment_loads_without_a_complaint(name: str) -> None:
    environment = load_environment(builtin_environments()[name])
    assert environment.radiance.shape == (256, 512, 3)
    assert environment.notes == ()


def test_the_mime_laughs_and_frowns() -> None:
    """By two morph targets: the corners of its mouth rise and sink by more than a centimetre, its neck stays."""
    scene = load_scene(builtin_scenes()["mime"])
    i = scene.object_index("face")
    rig, (first, last), (start, stop) = scene.rigs[i], scene.vertex_ranges[i], scene.triangle_ranges[i]
    assert rig is not None and [clip.name for clip in rig.skeleton.clips] == ["moods"] and len(rig.binding.morphs) == 2
    assert scene.rigs[scene.object_index("neck")] is None
    vertices = scene.vertices[first:last].astype(float)
    rest = Pose(vertices, np.tile(np.eye(3), (len(vertices), 1, 1)))
    laughs, frowns, again = (
        animated_pose(rig, rest, scene.triangles[start:stop] - first, "moods", time).positions
        for time in (1.0, 3.0, 4.0)
    )
    moved = np.linalg.norm(laughs - frowns, axis=1)
    chin_or_top = np.abs(vertices[:, 1] - vertices[:, 1].mean()) > 0.19
    assert moved.max() > 0.01 and moved[chin_or_top].max() < 1e-3
    assert again == pytest.approx(vertices, abs=1e-6)


def test_the_bat_flaps() -> None:
    """Its wings rise and sink by more than a hand's breadth, and stay wings; at 0 its hands are about at rest."""
    scene = load_scene(builtin_scenes()["bat"])
    i = scene.object_index("wings")
    rig, (first, last), (start, stop) = scene.rigs[i], scene.vertex_ranges[i], scene.triangle_ranges[i]
    assert rig is not None and [clip.name for clip in rig.skeleton.clips] == ["flap"]
    vertices = scene.vertices[first:last].astype(float)
    rest = Pose(vertices, np.tile(np.eye(3), (len(vertices), 1, 1)))
    poses = [
        animated_pose(rig, rest, scene.triangles[start:stop] - first, "flap", time) for time in (0.0, 0.3, 0.9, 1.2)
    ]
    tops = [pose.positions[:, 1].max() for pose in poses]
    assert tops[1] > tops[0] + 0.1 and poses[2].positions[:, 1].min() < 0.2
    assert poses[3].positions == pytest.approx(poses[0].positions, abs=1e-6)  # its last key is its first
