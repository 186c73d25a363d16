"""Stages of USD that move: animated transforms, skins."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from engine.realtime.zonal_harmonics.pose import Pose
from engine.realtime.zonal_harmonics.posed_scene import animated_pose
from engine.scene.loaders.model import ImportedPart
from tests.usd_text import ARM, SQUARE, box, mesh_of, place, read, unshown

pytest.importorskip("pxr", reason="usd-core, the extra insitu[usd], is not installed")

# ---------------------------------------------------------------------------------------------------------- animations


def test_animated_transforms_play_and_rest_at_the_start(tmp_path: Path) -> None:
    body = f"""
    def Mesh "Still" {{{SQUARE}}}
    def Xform "Turning" {{
        double3 xformOp:translate.timeSamples = {{ 10: (0, 0, 5), 34: (0, 0, 7) }}
        double xformOp:rotateZ.timeSamples = {{ 10: 0, 34: 360 }}
        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateZ"]
        def Mesh "M" {{{SQUARE}}}
    }}"""
    model = read(tmp_path, body, "startTimeCode = 10\n endTimeCode = 34\n timeCodesPerSecond = 24")
    (part,) = model.parts
    assert sorted(set(part.mesh.vertices[:, 2])) == [0.0, 5.0]
    assert part.rig is not None and [(a.name, a.duration) for a in part.rig.animations] == [("stage", 1.0)]
    places = part.mesh.vertices.astype(np.float64)
    rest = Pose(places, np.tile(np.eye(3), (len(places), 1, 1)))
    # After a quarter of a second the square is turned by 90 degrees, and half a metre further; at 1/16 s by 22.5.
    for time, angle, z in ((0.25, 90.0, 5.5), (0.0625, 22.5, 5.125)):
        posed = animated_pose(part.rig, rest, part.mesh.triangles, "stage", time)
        cosine, sine = np.cos(np.radians(angle)), np.sin(np.radians(angle))
        moving = places[:, 2] > 1.0
        turned = places[moving, :2] @ np.array([[cosine, sine], [-sine, cosine]])
        assert np.allclose(posed.positions[moving], np.column_stack([turned, np.full(4, z)]), atol=1e-6)
        assert np.allclose(posed.positions[~moving], places[~moving])


def test_other_animations_are_listed_and_show_their_first_value(tmp_path: Path) -> None:
    body = f"""def Mesh "M" {{{SQUARE}
        color3f[] primvars:displayColor.timeSamples = {{ 1: [(1, 0, 0)], 2: [(0, 1, 0)] }}
        matrix4d xformOp:transform.timeSamples = {{
            1: ((1, 0, 0, 0), (0.5, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1)),
            2: ((1, 0, 0, 0), (0.9, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1))
        }}
        uniform token[] xformOpOrder = ["xformOp:transform"]
    }}"""
    model = read(tmp_path, body, "startTimeCode = 1\n endTimeCode = 2")
    (part,) = model.parts
    assert part.rig is None and part.mesh.colours is not None and (part.mesh.colours[..., :2] == (1.0, 0.0)).all()
    names = unshown(model)
    assert names == {"Mesh.primvars:displayColor.timeSamples": 1, "Mesh.xformOpOrder.timeSamples": 1}


# --------------------------------------------------------------------------------------------------------------- skins


def _skinned(weights: str, interpolation: str) -> str:
    """A square on two joints: one rests, the other has moved along Z by the time code, 5 at the stage's start. Its
    third corner has a blend shape, of weight 0.5, that lifts it by 2."""
    still = "((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1))"
    n = 2 if interpolation == "vertex" else 1
    return f"""
def SkelRoot "Body" (prepend apiSchemas = ["SkelBindingAPI"]) {{
    def Skeleton "Bones" (prepend apiSchemas = ["SkelBindingAPI"]) {{
        uniform token[] joints = ["A", "B"]
        uniform matrix4d[] bindTransforms = [{still}, {still}]
        uniform matrix4d[] restTransforms = [{still}, {still}]
        rel skel:animationSource = </Body/Walk>
    }}
    def SkelAnimation "Walk" {{
        uniform token[] joints = ["A", "B"]
        float3[] translations.timeSamples = {{ 0: [(0, 0, 0), (0, 0, 0)], 10: [(0, 0, 0), (0, 0, 10)] }}
        quatf[] rotations = [(1, 0, 0, 0), (1, 0, 0, 0)]
        half3[] scales = [(1, 1, 1), (1, 1, 1)]
        uniform token[] blendShapes = ["up"]
        float[] blendShapeWeights = [0.5]
    }}
    def Mesh "Skin" (prepend apiSchemas = ["SkelBindingAPI"]) {{{SQUARE}
        rel skel:skeleton = </Body/Bones>
        int[] primvars:skel:jointIndices = [{"0, 1" if n == 1 else "0, 1, 0, 1, 0, 1, 0, 1"}] (
            interpolation = "{interpolation}"
            elementSize = 2
        )
        float[] primvars:skel:jointWeights = [{weights}] (
            interpolation = "{interpolation}"
            elementSize = 2
        )
        uniform token[] skel:blendShapes = ["up"]
        rel skel:blendShapeTargets = </Body/Skin/up>
        def BlendShape "up" {{
            uniform vector3f[] offsets = [(0, 2, 0)]
            uniform int[] pointIndices = [2]
        }}
    }}
}}
"""


@pytest.mark.parametrize(
    ("weights", "interpolation", "z"),
    [("1, 0, 0.5, 0.5, 0, 1, 1, 0", "vertex", [0.0, 2.5, 5.0, 0.0]), ("0, 1", "constant", [5.0] * 4)],
)
def test_skins_have_the_pose_at_the_start(tmp_path: Path, weights: str, interpolation: str, z: list[float]) -> None:
    # Weighted means of the joints' translations, 0 and 5; between the keys, where the library has no sample.
    model = read(tmp_path, _skinned(weights, interpolation), "startTimeCode = 5\n endTimeCode = 10")
    mesh = mesh_of(model)
    assert mesh.vertices.tolist() == [[-1, -1, z[0]], [1, -1, z[1]], [1, 2, z[2]], [-1, 1, z[3]]]
    assert not model.unshown


_HEAD = "startTimeCode = {}\n endTimeCode = 10\n timeCodesPerSecond = 10"
_FLAT = 'uniform token subdivisionScheme = "none"'


def _posed_at(part: ImportedPart, time: float) -> tuple[np.ndarray, np.ndarray]:
    """Where the animation has the vertices of a part, and their axes of normals."""
    assert part.rig is not None
    places = part.mesh.vertices.astype(np.float64)
    rest = Pose(places, np.tile(np.eye(3), (len(places), 1, 1)))
    found = animated_pose(part.rig, rest, part.mesh.triangles, "stage", time)
    return found.positions, found.frames[:, 2]


@pytest.mark.parametrize("time", [0.0, 3.0, 7.5, 10.0])
def test_skins_play_as_the_library_poses_them(tmp_path: Path, time: float) -> None:
    body = ARM.format(more=_FLAT, inbetween="")
    model, there = (read(tmp_path, body, _HEAD.format(start)) for start in (0, time))
    (part,), (other,) = model.parts, there.parts
    assert part.rig is not None and [(a.name, a.duration) for a in part.rig.animations] == [("stage", 1.0)]
    assert not model.unshown
    positions, _ = _posed_at(part, min(time / 10.0, 0.9999999))
    assert np.allclose(positions, other.mesh.vertices, atol=1e-5)


def test_normals_turn_with_the_bones(tmp_path: Path) -> None:
    along = "normal3f[] normals = [(0, 0, 1), (0, 0, 1), (0, 0, 1), (0, 0, 1), (0, 0, 1), (0, 0, 1)]"
    normals = f'{_FLAT}\n {along} (interpolation = "vertex")'
    model, there = (read(tmp_path, ARM.format(more=normals, inbetween=""), _HEAD.format(start)) for start in (0, 6))
    _, found = _posed_at(model.parts[0], 0.6)
    assert there.parts[0].mesh.normals is not None
    # At the ends each point follows one bone: there linear blending of normals is a rotation, as the library's is.
    ends = [0, 2, 3, 5]
    assert np.allclose(found[ends], there.parts[0].mesh.normals[ends], atol=1e-4)


def test_subdivided_skins_play_nearly_as_the_library_poses_them(tmp_path: Path) -> None:
    model, there = (read(tmp_path, ARM.format(more="", inbetween=""), _HEAD.format(start)) for start in (0, 8))
    positions, _ = _posed_at(model.parts[0], 0.8)
    # Two faces for an arm of 4 m, whose elbow bends by 72 degrees: bending what was refined misses the refinement of
    # what was bent by at most a tenth of its length.
    assert 1e-3 < np.abs(positions - there.parts[0].mesh.vertices).max() < 0.4 and not model.unshown


def test_a_skin_with_shapes_in_between_rests_and_is_listed(tmp_path: Path) -> None:
    more = "uniform vector3f[] inbetweens:half = [(0, -1, 0), (0, 1, 0)] ( weight = 0.5\n )"
    model = read(tmp_path, ARM.format(more=_FLAT, inbetween=more), "startTimeCode = 0\n endTimeCode = 10")
    assert model.parts[0].rig is None and unshown(model) == {"Mesh.skel:skeleton": 1, "SkelAnimation.timeSamples": 1}


def test_instances_of_skins_are_posed(tmp_path: Path) -> None:
    body = f"""class Xform "Person" {{ {_skinned("0, 1", "constant").replace("/Body", "/Person/Body")} }}
    def Xform "One" (instanceable = true\n prepend inherits = </Person>) {{}}
    def Xform "Two" (instanceable = true\n prepend inherits = </Person>) {{{place(7, 0, 0)}}}"""
    model = read(tmp_path, body, "startTimeCode = 5\n endTimeCode = 10")
    assert box(mesh_of(model)) == [[-1, -1, 5], [8, 2, 5]]


def test_a_skin_that_cannot_be_posed_rests_and_is_listed(tmp_path: Path) -> None:
    model = read(tmp_path, _skinned("0", "constant"), "startTimeCode = 5\n endTimeCode = 10")
    assert box(mesh_of(model))[0][2] == 0.0 and unshown(model)["Mesh.primvars:skel:jointWeights"] == 1
