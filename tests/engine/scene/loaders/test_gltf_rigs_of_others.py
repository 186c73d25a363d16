"""Rigs in files of others: skins and clips beside the specification, and beside what they were baked to."""

from __future__ import annotations

import json
import struct
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from engine.realtime.zonal_harmonics import posed_scene
from engine.realtime.zonal_harmonics.pose import Moment
from engine.realtime.zonal_harmonics.posed_scene import animated_pose
from engine.scene.loaders.gltf import read_gltf
from engine.scene.scene_loader import load_scene
from tests.engine.scene.loaders.test_gltf_rig import rest_of


def by_the_specification(path: Path, clip: str | None, time: float) -> np.ndarray:
    """Where the vertices of a file's only skinned mesh are: G_j(t) B_j, one by one, from the JSON itself; clip: None
    for the mesh at rest."""
    data = path.read_bytes()
    (length,) = struct.unpack_from("<I", data, 12)
    tree, binary = json.loads(data[20 : 20 + length]), data[28 + length :]

    def values(number: int) -> np.ndarray:
        accessor = tree["accessors"][number]
        view = tree["bufferViews"][accessor["bufferView"]]
        kind = np.dtype({5126: "<f4", 5123: "<u2", 5121: "u1"}[accessor["componentType"]])
        width = {"SCALAR": 1, "VEC3": 3, "VEC4": 4, "MAT4": 16}[accessor["type"]]
        start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
        step = view.get("byteStride", width * kind.itemsize)
        rows = [np.frombuffer(binary, kind, width, start + i * step) for i in range(accessor["count"])]
        return np.stack(rows).astype(float)

    nodes = [dict(node) for node in tree["nodes"]]
    chosen = [each for each in tree.get("animations", []) if each["name"] == clip]
    for animation, channel in ((each, channel) for each in chosen for channel in each["channels"]):
        sampler = animation["samplers"][channel["sampler"]]
        times, keys = values(sampler["input"])[:, 0], values(sampler["output"])
        now = np.clip(time, times[0], times[-1])
        if sampler.get("interpolation", "LINEAR") == "STEP" or len(times) == 1:
            value = keys[max(np.searchsorted(times, now, side="right") - 1, 0)]
        elif channel["target"]["path"] == "rotation":
            value = Slerp(times, Rotation.from_quat(keys))(now).as_quat()
        else:
            value = np.array([np.interp(now, times, column) for column in keys.T])
        nodes[channel["target"]["node"]][channel["target"]["path"]] = value

    def local(node: dict) -> np.ndarray:
        if "matrix" in node:
            return np.reshape(node["matrix"], (4, 4)).T
        matrix = np.eye(4)
        matrix[:3, :3] = Rotation.from_quat(node.get("rotation", [0, 0, 0, 1])).as_matrix() * node.get("scale", [1] * 3)
        matrix[:3, 3] = node.get("translation", [0] * 3)
        return matrix

    parent = {child: k for k, node in enumerate(nodes) for child in node.get("children", [])}

    def whole(k: int) -> np.ndarray:
        return (whole(parent[k]) if k in parent else np.eye(4)) @ local(nodes[k])

    skin, primitive = tree["skins"][0], tree["meshes"][0]["primitives"][0]["attributes"]
    maps = values(skin["inverseBindMatrices"]).reshape(-1, 4, 4).swapaxes(1, 2)
    bones = np.stack([whole(joint) @ map_ for joint, map_ in zip(skin["joints"], maps, strict=True)])
    places = np.pad(values(primitive["POSITION"]), ((0, 0), (0, 1)), constant_values=1.0)
    joints, weights = values(primitive["JOINTS_0"]).astype(int), values(primitive["WEIGHTS_0"])
    weights = weights / weights.sum(axis=1, keepdims=True)
    return np.einsum("vk,vkab,vb->va", weights, bones[joints], places)[:, :3]


@pytest.mark.parametrize(("name", "clip", "time"), [("CesiumMan", "Anim_0", 0.71), ("Fox", "Walk", 0.4)])
def test_files_of_others_move_as_the_specification_says(shared_data: Path, name: str, clip: str, time: float) -> None:
    path = shared_data / "glb" / f"{name}.glb"
    scene = load_scene(path)
    pose = animated_pose(scene.rigs[0], *rest_of(scene), clip, time)
    size = np.ptp(pose.positions, axis=0).max()
    assert np.abs(pose.positions - by_the_specification(path, clip, time)).max() < 2e-5 * size
    assert np.abs(pose.frames @ pose.frames.transpose(0, 2, 1) - np.eye(3)).max() < 1e-9


@pytest.mark.parametrize("name", ["CesiumMan", "Fox"])
def test_files_of_others_rest_as_the_specification_says(shared_data: Path, name: str) -> None:
    path = shared_data / "glb" / f"{name}.glb"
    scene = load_scene(path)
    vertices = rest_of(scene)[0].positions + scene.origin
    assert np.abs(vertices - by_the_specification(path, None, 0.0)).max() < 2e-6 * np.ptp(vertices, axis=0).max()


@pytest.mark.parametrize(
    ("name", "truth"),
    [
        ("plain", "baked0"),
        ("node_scaled", "baked0"),
        ("posed_still", "baked90"),
        ("cm_zup", "baked0"),
        ("cm_zup_still", "baked0"),
    ],
)
def test_skins_rest_where_they_were_baked(shared_data: Path, name: str, truth: str) -> None:
    """Files whose mesh nodes, units and axes differ, beside what their skins come to."""
    folder = shared_data / "cases" / "21-skin-transforms"
    mesh, baked = (read_gltf(folder / f"{each}.glb").parts[0].mesh for each in (name, truth))
    assert mesh.vertices == pytest.approx(baked.vertices, abs=2e-6)
    assert mesh.normals == pytest.approx(baked.normals, abs=2e-6)


@pytest.mark.parametrize("name", ["plain", "node_scaled", "cm_zup"])
def test_skins_move_to_where_they_were_baked(shared_data: Path, name: str) -> None:
    """Places and normals, of a joint that turns by 45 and by 90 degrees."""
    folder = shared_data / "cases" / "21-skin-transforms"
    scene = load_scene(folder / f"{name}.toml")
    for seconds, truth in ((0.0, "baked0"), (0.5, "baked45"), (1.0, "baked90")):
        moved = posed_scene.pose_scene(scene, (("it", (Moment("bend", seconds),)),))
        baked = load_scene(folder / f"{truth}.toml")
        mine = slice(*scene.vertex_ranges[0])
        assert np.abs(moved.vertices[mine] - baked.vertices[mine]).max() < 1e-6
        assert np.abs(moved.normals[mine] - baked.normals[mine]).max() < 1e-6
