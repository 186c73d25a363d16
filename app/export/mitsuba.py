"""A scene as a folder for Mitsuba 3: scene.xml, meshes, the sky, materials, and render.py that renders it.

    OUT/scene.xml       camera, lights, objects; materials that Mitsuba has no counterpart for are of the type "insitu"
    OUT/render.py       `python render.py` renders scene.xml to render.exr; it defines that type
    OUT/meshes/*.ply    in world coordinates, those of a far scene and its camera less the scene's centre
    OUT/materials/*.npz tables of the materials of that type; *.bsdf measurements that Mitsuba has a type for
    OUT/sky.exr         lat-long

The standard models are used where they are exact: `diffuse`, `roughconductor`, and the two of them together; and
`measured` for an isotropic RGB tensor file that is not edited. Everything else, above all edited curves, becomes a
table over half and difference angles, one for all layers that the same images multiply: nodes of parameters that vary
over the surface among them. `measured` was rejected for it: its samples follow one distribution of visible normals,
which a curve that is bent no longer has, and its tangents are not those of Insitu's objects. Opacity is Mitsuba's
`mask`.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from app.export import stem_of, written_names
from app.export.images import add_opacity
from app.export.materials import add, add_numbers, write_material
from app.project.project import Project
from app.system.atomic import replacing_folder, require_folder, write_atomically
from engine.core.generators import run_to_end
from engine.material.layer import Layer, object_of
from engine.render.display import exr_bytes
from engine.scene.emission_textures import mean_emission
from engine.scene.scene_loader import Scene

RENDER = Path(__file__).with_name("render.py")
MITSUBA = "3.5.0"
# Surfaces with holes that a path can pass, where there are any.
MOST_PASSED = 8
Report = Callable[[float, str], None]
Steps = Generator[tuple[float, str], None, list[str]]


def export_steps(project: Project, folder: Path, n_bounces: int) -> Steps:
    """Write the folder, whole or not at all; yields the fraction done and the next object, returns notes on what is not
    the same there, a line each. Raises InsituError."""
    require_folder(folder, written_names(project.object_names))
    with replacing_folder(folder) as unfinished:
        for part in ("meshes", "materials"):
            (unfinished / part).mkdir()
        return (yield from _write(project, unfinished, n_bounces))


def export_scene(project: Project, folder: Path, n_bounces: int, report: Report) -> list[str]:
    """All of `export_steps`, reported to `report`; returns the notes."""
    return run_to_end(export_steps(project, folder, n_bounces), lambda step: report(*step))


def _write(project: Project, folder: Path, n_bounces: int) -> Steps:
    root = ElementTree.Element("scene", version=MITSUBA)
    # It counts the ends of a path as well, and each surface that a path passes.
    depth = n_bounces + 1 + (MOST_PASSED if project.scene.cutouts.opacities else 0)
    add(add(root, "integrator", type="path"), "integer", name="max_depth", value=str(depth))
    _add_camera(root, project)
    notes = _add_sky(root, project, folder)
    if (origin := project.scene.origin).any():
        moved = ", ".join(f"{0.0 - each:.9g}" for each in origin)
        notes.append(f"the scene stands far from the origin, where single precision is coarse: moved by {moved} m")
    names = project.object_names
    for index, name in enumerate(names):
        yield index / len(names), name
        if project.document.object(name).visible:
            notes += _add_object(root, project, folder, index)
    ElementTree.indent(root)
    write_atomically(folder / "scene.xml", ElementTree.tostring(root, encoding="utf-8", xml_declaration=True))
    write_atomically(folder / "render.py", RENDER.read_bytes())
    return notes


def _add_camera(root: ElementTree.Element, project: Project) -> None:
    camera, (width, height) = project.scene.description.camera, project.scene.resolution
    sensor = add(root, "sensor", type="perspective")
    add(sensor, "float", name="fov", value=f"{camera.fov_y:.9g}")
    add(sensor, "string", name="fov_axis", value="y")
    origin = project.scene.origin
    points = {"origin": camera.position - origin, "target": camera.target - origin, "up": np.array(camera.up)}
    place = add(sensor, "transform", name="to_world")
    add(place, "lookat", **{name: ", ".join(f"{v:.9g}" for v in point) for name, point in points.items()})
    film = add(sensor, "film", type="hdrfilm")
    for name, value in (("width", width), ("height", height)):
        add(film, "integer", name=name, value=str(value))
    add(film, "string", name="pixel_format", value="rgb")
    add(film, "string", name="component_format", value="float32")
    add(film, "rfilter", type="box")
    add(add(sensor, "sampler", type="multijitter"), "integer", name="sample_count", value="256")


def _add_sky(root: ElementTree.Element, project: Project, folder: Path) -> list[str]:
    sky = project.sky
    if sky.environment is None:
        return []
    radiance = sky.environment.radiance * np.float32(sky.scale * project.document.light.intensity)
    if radiance.shape[:2] == (1, 1):
        add_numbers(add(root, "emitter", type="constant"), "rgb", "radiance", radiance[0, 0])
        return []
    write_atomically(folder / "sky.exr", exr_bytes(radiance))
    emitter = add(root, "emitter", type="envmap")
    add(emitter, "string", name="filename", value="sky.exr")
    # Mitsuba's image begins at the opposite side: its left edge is at -Z, which is the middle of Insitu's.
    add(add(emitter, "transform", name="to_world"), "rotate", y="1", angle=f"{sky.rotation + 180.0:.9g}")
    return list(sky.environment.notes)


def _add_object(root: ElementTree.Element, project: Project, folder: Path, index: int) -> list[str]:
    scene, name = project.scene, project.object_names[index]
    state = project.document.object(name)
    stem = stem_of(index, name)
    write_atomically(folder / "meshes" / f"{stem}.ply", ply_bytes(scene, index))
    shape = add(root, "shape", type="ply", id=stem)
    add(shape, "string", name="filename", value=f"meshes/{stem}.ply")
    add(shape, "boolean", name="face_normals", value=str(not scene.smooth[index]).lower())
    lamp = [f"{name}: shines to all sides: its cone is not written"] if scene.description.objects[index].cone else []
    if scene.emitters[index]:
        emission = mean_emission(scene, index) * project.document.light.intensity
        add_numbers(add(shape, "emitter", type="area"), "rgb", "radiance", emission)
        lamp += [f"{name}: shines evenly: its texture is not written"] * (index in scene.emission_textures.tinted)
    elif state.emits:
        lamp += [f"{name}: black: what is unlit is not written"]
    if state.is_lamp:
        add_numbers(add(shape, "bsdf", type="diffuse"), "rgb", "reflectance", (0.0, 0.0, 0.0))
        return lamp
    layers: list[Layer] = [layer for key, layer in project.layers.items() if object_of(key) == name]
    opacity, notes = scene.cutouts.opacities.get(index), list[str]()
    if opacity is not None:
        shape = add(shape, "bsdf", type="mask")
        alpha = add_opacity(shape, opacity, scene.cutouts.images.get(index), f"materials/{stem}.exr")
        if alpha is not None:
            write_atomically(folder / "materials" / f"{stem}.exr", exr_bytes(alpha))
        if opacity.opacity_uv_set:
            notes.append("its opacity is laid out by the first texture coordinates")
        if opacity.opacity_vertices:
            notes.append("the opacity of its vertices is not written")
    notes += write_material(shape, layers, scene, index, folder, stem)
    return lamp + [f"{name}: {note}" for note in notes]


def ply_bytes(scene: Scene, index: int) -> bytes:
    """The object's triangles with vertex normals, and texture coordinates and vertex colours where it has them."""
    first, last = scene.triangle_ranges[index]
    triangles: NDArray[np.integer] = scene.triangles[first:last]
    names = ["x", "y", "z", "nx", "ny", "nz"]
    columns = []
    if scene.has_uvs[index] and scene.uvs is not None:
        columns.append(scene.uvs[first:last, :, :2].reshape(-1, 2))
        names += ["u", "v"]
    if scene.colours is not None:
        columns.append(scene.colours[first:last, :, :3].reshape(-1, 3))
        names += ["r", "g", "b"]
    if columns:  # vertices of their own: coordinates differ between triangles
        corners, triangles = triangles.ravel(), np.arange(triangles.size).reshape(-1, 3)
    else:
        corners, triangles = np.unique(triangles, return_inverse=True)
        triangles = triangles.reshape(-1, 3)
    rows = np.concatenate([scene.vertices[corners], scene.normals[corners], *columns], axis=1).astype("<f4")
    faces = np.empty(len(triangles), np.dtype([("n", "u1"), ("corners", "<i4", 3)]))
    faces["n"], faces["corners"] = 3, triangles
    head = ["ply", "format binary_little_endian 1.0", f"element vertex {len(rows)}"]
    head += [f"property float {name}" for name in names]
    head += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header", ""]
    return "\n".join(head).encode() + rows.tobytes() + faces.tobytes()
