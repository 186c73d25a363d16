"""Cycles behind a script of edits: `PYTHON -m benchmarks.programs.cycles_edits JOB.json OUT.npz`, see `progressive`.

For an interpreter with bpy 4.5, pyoidn and OpenEXR. `lambert` is a diffuse closure of roughness 0, `rough_conductor`
the metallic closure with eta and k; layers add. What may make a picture cheaper and wrong is off: clamping, filtered
gloss, adaptive sampling, the threshold of light sampling, offsets at the terminator. A pixel is a box of its size.

Cycles has no picture in memory without a window: each pass writes an OpenEXR file without compression, in memory where
/dev/shm is there.
"""

from __future__ import annotations

import math
import tempfile
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import OpenEXR
from mathutils import Matrix, Vector

from benchmarks.programs.progressive import Images, run

SUBSET = 8192
LAYERS = ("Combined", "Denoising Albedo", "Denoising Normal")


def turned(points: Any) -> Images:
    """Blender's axes: Z up."""
    x, y, z = np.moveaxis(np.asarray(points, np.float32), -1, 0)
    return np.stack([x, -z, y], axis=-1)


def read_ply(file: Path) -> tuple[Images, Images, Any]:
    """Vertices, normals (V, 3) and triangles (T, 3) of a file as `app.export.mitsuba.ply_bytes` writes it."""
    head, body = file.read_bytes().split(b"end_header\n", 1)
    words = head.decode().split()
    n_vertices, n_faces = (int(words[words.index(kind) + 1]) for kind in ("vertex", "face"))
    width = words.count("float")
    rows = np.frombuffer(body, "<f4", n_vertices * width).reshape(n_vertices, width)
    face = np.dtype([("n", "u1"), ("corners", "<i4", 3)])
    return rows[:, :3], rows[:, 3:6], np.frombuffer(body, face, n_faces, rows.nbytes)["corners"]


class Material:
    """The nodes of an object's layers; emission on the side that its faces turn to."""

    def __init__(self, described: dict[str, Any]) -> None:
        self.made = bpy.data.materials.new(described["name"])
        self.made.use_nodes = True
        self.tree = self.made.node_tree
        self.tree.nodes.clear()
        closures = [self._layer(layer) for layer in described.get("layer", [])]
        self.layers = [node for node, _ in closures]
        ends = [end for _, end in closures]
        if "emission" in described:
            ends = [self._light(described["emission"])]
        while len(ends) > 1:
            both = self.tree.nodes.new("ShaderNodeAddShader")
            for i in range(2):
                self.tree.links.new(ends.pop(0), both.inputs[i])
            ends.append(both.outputs[0])
        output = self.tree.nodes.new("ShaderNodeOutputMaterial")
        if ends:
            self.tree.links.new(ends[0], output.inputs["Surface"])

    def _layer(self, layer: dict[str, Any]) -> tuple[Any, Any]:
        if layer["model"] == "lambert":
            node = self.tree.nodes.new("ShaderNodeBsdfDiffuse")
            node.inputs["Roughness"].default_value = 0.0
            set_parameter(node, "albedo", layer["albedo"])
            return node, node.outputs[0]
        node = self.tree.nodes.new("ShaderNodeBsdfMetallic")
        node.fresnel_type = "PHYSICAL_CONDUCTOR"
        node.distribution = layer.get("distribution", "ggx").upper()
        for name, place in (("eta", "IOR"), ("k", "Extinction")):
            node.inputs[place].default_value = layer[name]
        set_parameter(node, "alpha", layer["alpha"])
        # A share of it: the rest of the mixture is an input without closure, which is black.
        share = self.tree.nodes.new("ShaderNodeMixShader")
        share.inputs[0].default_value = layer.get("scale", 1.0)
        self.tree.links.new(node.outputs[0], share.inputs[2])
        return node, share.outputs[0]

    def _light(self, radiance: Any) -> Any:
        light, side = self.tree.nodes.new("ShaderNodeEmission"), self.tree.nodes.new("ShaderNodeMixShader")
        light.inputs["Color"].default_value = (*radiance, 1.0)
        light.inputs["Strength"].default_value = 1.0
        geometry = self.tree.nodes.new("ShaderNodeNewGeometry")
        self.tree.links.new(geometry.outputs["Backfacing"], side.inputs[0])
        self.tree.links.new(light.outputs[0], side.inputs[1])
        self.made.cycles.emission_sampling = "FRONT"
        return side.outputs[0]


def set_parameter(node: Any, parameter: str, value: Any) -> None:
    """albedo of a diffuse closure, alpha of a metallic one, whose roughness is its square root."""
    if parameter == "albedo":
        node.inputs["Color"].default_value = (*np.broadcast_to(value, 3).tolist(), 1.0)
    else:
        node.inputs["Roughness"].default_value = math.sqrt(value)


class Cycles:
    """A scene in Blender's own data."""

    def __init__(self, job: dict[str, Any]) -> None:
        bpy.ops.wm.read_factory_settings(use_empty=True)
        self.scene = bpy.context.scene
        described = job["scene"]
        set_up(self.scene, job["bounces"], job["resolution"])
        place_camera(self.scene, described["camera"], job["resolution"])
        light_up(self.scene, described.get("environment"))
        self.materials = {each["name"]: add_object(self.scene, each) for each in described["object"]}
        memory = Path("/dev/shm")
        self.folder = tempfile.TemporaryDirectory(dir=memory if memory.is_dir() else None)
        self.scene.render.filepath = f"{self.folder.name}/pass.exr"
        self.made_with = f"Cycles of Blender {bpy.app.version_string}"

    def change(self, edit: dict[str, Any]) -> None:
        """See `progressive`."""
        set_parameter(self.materials[edit["object"]].layers[edit["layer"]], edit["parameter"], edit["value"])

    def render(self, samples: int, seed: int, done: int) -> Images:
        """See `progressive`."""
        cycles = self.scene.cycles
        cycles.samples, cycles.seed = SUBSET, seed
        cycles.use_sample_subset, cycles.sample_offset, cycles.sample_subset_length = True, done, samples
        self.scene.update_tag()  # else what persists, sampling patterns included, is used again
        bpy.context.view_layer.update()
        bpy.ops.render.render(write_still=True)
        parts = OpenEXR.File(self.scene.render.filepath, separate_channels=True).channels()
        found = []
        for layer in LAYERS:
            ends = "XYZ" if layer == "Denoising Normal" else "RGB"
            found += [parts[f"ViewLayer.{layer}.{end}"].pixels for end in ends]
        return np.stack(found, axis=-1)


def set_up(scene: Any, bounces: int, resolution: list[int]) -> None:
    scene.render.engine = "CYCLES"
    scene.render.use_persistent_data = True
    scene.render.resolution_x, scene.render.resolution_y = resolution
    scene.render.resolution_percentage = 100
    scene.render.use_compositing = scene.render.use_sequencer = False
    image = scene.render.image_settings
    image.file_format, image.color_depth, image.exr_codec = "OPEN_EXR_MULTILAYER", "32", "NONE"
    bpy.context.view_layer.cycles.denoising_store_passes = True
    cycles = scene.cycles
    cycles.device = "CPU"
    for name in ("max_bounces", "diffuse_bounces", "glossy_bounces"):
        setattr(cycles, name, bounces - 1)  # it counts the reflections after the first
    cycles.pixel_filter_type = "BOX"
    cycles.sampling_pattern = "TABULATED_SOBOL"
    cycles.use_adaptive_sampling = cycles.use_denoising = False
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0.0
    cycles.blur_glossy = cycles.light_sampling_threshold = 0.0
    cycles.caustics_reflective = True


def place_camera(scene: Any, described: dict[str, Any], resolution: list[int]) -> None:
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    place, target, up = (Vector(turned(described.get(key, (0, 1, 0)))) for key in ("position", "target", "up"))
    back = (place - target).normalized()
    right = up.cross(back).normalized()
    turn = Matrix((right, back.cross(right), back)).transposed()
    camera.matrix_world = Matrix.Translation(place) @ turn.to_4x4()
    camera.data.sensor_fit = "VERTICAL"
    camera.data.angle_y = math.radians(described["fov_y"])
    camera.data.clip_start, camera.data.clip_end = 1e-4, 1e4
    scene.collection.objects.link(camera)
    scene.camera = camera


def light_up(scene: Any, described: dict[str, Any] | None) -> None:
    """The lat-long image whose middle looks to -Z, Blender's +Y, where its own look to +X."""
    scene.world = bpy.data.worlds.new("world")
    scene.world.use_nodes = True
    tree = scene.world.node_tree
    background = tree.nodes["Background"]
    background.inputs["Color"].default_value = (0.0, 0.0, 0.0, 1.0)
    if described is None:
        return
    image, turn, place = (tree.nodes.new(f"ShaderNode{name}") for name in ("TexEnvironment", "Mapping", "TexCoord"))
    image.image = bpy.data.images.load(described["file"])
    image.image.colorspace_settings.name = "Linear Rec.709"
    turn.inputs["Rotation"].default_value[2] = math.radians(-90.0 - described.get("rotation", 0.0))
    tree.links.new(place.outputs["Generated"], turn.inputs[0])
    tree.links.new(turn.outputs[0], image.inputs[0])
    tree.links.new(image.outputs[0], background.inputs["Color"])
    background.inputs["Strength"].default_value = described.get("scale", 1.0)


def add_object(scene: Any, described: dict[str, Any]) -> Material:
    vertices, normals, triangles = read_ply(Path(described["mesh"]))
    mesh = bpy.data.meshes.new(described["name"])
    mesh.from_pydata(turned(vertices).tolist(), [], triangles.tolist())
    smooth = described.get("smooth", True)
    mesh.polygons.foreach_set("use_smooth", [smooth] * len(triangles))
    if smooth:
        mesh.normals_split_custom_set_from_vertices(turned(normals).tolist())
    material = Material(described)
    mesh.materials.append(material.made)
    made = bpy.data.objects.new(described["name"], mesh)
    made.cycles.shadow_terminator_geometry_offset = made.cycles.shadow_terminator_offset = 0.0
    scene.collection.objects.link(made)
    return material


if __name__ == "__main__":
    run(Cycles)
