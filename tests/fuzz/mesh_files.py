"""Small sound files of meshes and materials in text, binary and archives, and their readers."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np


def read_mesh_file(path: Path) -> None:
    from engine.scene.object_meshes import load_mesh_scene

    for item in load_mesh_scene(path).items:
        mesh = item.mesh
        assert np.isfinite(mesh.vertices).all() and mesh.triangles.min() >= 0
        assert mesh.triangles.max() < len(mesh.vertices) and (mesh.normals is None or np.isfinite(mesh.normals).all())


def plys(folder: Path) -> list[bytes]:
    from app.export.mitsuba import ply_bytes
    from engine.scene.scene_loader import load_scene
    from tests.engine.scene.loaders.test_ply import ASCII_CORNERS, binary, header
    from tests.engine.scene.test_costs import ply_of_lists

    text = header("ascii", 4, 1) + ASCII_CORNERS + "4 0 1 2 3\n"
    own = folder / "seed.ply"
    own.write_bytes(binary("<", struct.pack("<B4i", 4, 0, 1, 2, 3)))
    exported = ply_bytes(load_scene(own, (8, 8)), 0)
    strip = binary("<", struct.pack("<i5i", 5, 0, 1, 3, 2, -1), face="property list int int vertex_indices\n")
    arrow = header("ascii", 4, 1) + "0 0 0\n4 0 0\n1 1 0\n0 4 0\n4 1 2 3 0\n"
    return [
        own.read_bytes(), binary(">", struct.pack(">B4i", 4, 0, 1, 2, 3)), exported, ply_of_lists(3),
        strip.replace(b"element face", b"element tristrips"), arrow.encode(), text.encode(), text.encode(),
    ]  # fmt: skip


def objs(_: Path) -> list[bytes]:
    square = "# a square\nmtllib a.mtl\no thing\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvn 0 0 1\n"
    comb = "".join(f"v {x} {(x % 2) * 3} 0\n" for x in range(8)) + "v 8 9 0\nv 0 9 0\nf 8 9 10 1 2 3 4 5 6 7\nvw 1\n"
    return [comb.encode()] + [
        (square + "usemtl red\nf 1/1/1 2/2/1 3/3/1\nf 1//1 3//1 4//1\nf -4 -2 \\\n-1\nl 1 2\n").encode()
    ]


def mtls(folder: Path) -> list[bytes]:
    """Of the format, the extension and Blender's; with images beside them."""
    from PIL import Image

    Image.new("RGB", (4, 4), (128, 128, 255)).save(folder / "n.png")
    plain = "newmtl red\nKa 1 1 1\nKd .8 .5 .2\nKs 0.5 0.5 0.5\nNs 96.078\nd 0.5\nillum 2\nKe 1 0 0\n"
    images = "map_Kd -s 2 2 1 -o 0.5 0 -clamp on n.png\nmap_Bump -bm 0.5 n.png\nmap_d n.png\nmap_Ns a\\n.png\n"
    extended = "newmtl red\nKd 1 1 1\nPr 0.5\nPm 1.0\nPs 0.1\nNi 1.45\nTr 0.25\nnorm n.png\n"
    return [(head + plain + images).encode() for head in ("", "# Blender 4.2 MTL File\n")] + [extended.encode()]


def read_library(path: Path) -> None:
    card = "v 0 0 0\nv 1 0 0\nv 1 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nusemtl red\nf 1/1 2/2 3/3\n"
    path.with_suffix(".obj").write_text(f"mtllib {path.name}\n{card}")
    mtls(path.parent)
    read_mesh_file(path.with_suffix(".obj"))


def stls(_: Path) -> list[bytes]:
    from tests.engine.scene.loaders.test_stl import binary, text

    coloured = [31 << 10 | 0x8000, 31 | 0x8000, 0, 0]
    return [text().encode(), (text(name="") * 2).encode(), binary(header=b"x"), binary(coloured, b"COLOR=abcd")]


def daes(_: Path) -> list[bytes]:
    from tests.engine.scene.loaders.test_dae import BIND, MESH, PHONG, WHOLE

    shading = PHONG.format(diffuse='<texture texture="q" texcoord="UV"/>')
    nodes = f"<node><scale>-1 1 1</scale>{BIND}</node><node><rotate>0 0 1 30</rotate>{BIND}</node>"
    return [WHOLE.format(up="Z_UP", unit="", nodes=nodes, shading=shading, mesh=MESH.format(lines="")).encode()]


def offs(_: Path) -> list[bytes]:
    from tests.engine.scene.loaders.test_off import PLACES

    plain = "OFF\n# a square\n4 2 0\n" + PLACES + "4 0 1 2 3\n3 0 1 3 255 0 128\n"
    rows = "".join(f"{place} 0 0 1 255 0 128 255 0.5 1\n" for place in PLACES.splitlines())
    return [plain.encode(), ("STCNOFF\n4 1 0\n" + rows + "4 0 1 2 3\n").encode()]


def models(_: Path) -> list[bytes]:
    """The XML in a 3MF file, which damage to the archive would hardly ever reach."""
    from tests.engine.scene.loaders.test_threemf import mesh, model

    groups = '<basematerials id="5"><base name="a" displaycolor="#F00000"/></basematerials>'
    groups += '<m:colorgroup id="6"><m:color color="#00FF0080"/><m:color color="#0000FF"/></m:colorgroup>'
    own = mesh("", 'pid="6" p1="0" p2="1" p3="0"', 'p1="0"', 'pid="6" p1="1"')
    parts = '<components><component objectid="1" transform="1 0 0 0 1 0 0 0 1 2 3 4"/></components>'
    found = f'{groups}<object id="1" pid="5" pindex="0" name="a">{own}</object><object id="2">{parts}</object>'
    return [model(found, '<item objectid="2" partnumber="7"/><item objectid="1"/>').encode()]


def read_model(path: Path) -> None:
    from tests.engine.scene.loaders.test_threemf import packed

    file = path.with_suffix(".3mf")
    file.write_bytes(packed(path.read_bytes()))
    read_mesh_file(file)


def mtlxs(folder: Path) -> list[bytes]:
    """Networks of images, graphs and nodes of its own, an include, and two shaders."""
    from PIL import Image

    from tests.engine.scene.loaders.mtlx_samples import document, given, image, linked, node, surface

    Image.new("RGBA", (4, 4), (128, 90, 255, 70)).save(folder / "c.png")
    (folder / "part.mtlx").write_text(document('<xi:include href="a.mtlx"/>', root='fileprefix="x/"'))
    graph = image("i", "color3", "c.png", linked("texcoord", "vector2", "p"), "srgb_texture")
    graph += node("texcoord", "vector2", "t", "") + node("place2d", "vector2", "p", linked("texcoord", "vector2", "t"))
    graph += node("colorcorrect", "color3", "k", linked("in", "color3", "i") + given("hue", "float", "0.2"))
    graph += node("extract", "float", "e", linked("in", "color3", "k") + given("index", "integer", "1"))
    graph = f'<nodegraph name="g">{graph}<output name="a" type="color3" nodename="k"/>'
    graph += '<output name="b" type="float" nodename="e"/></nodegraph>'
    colour = '<input name="base_color" type="color3" nodegraph="g" output="a"/>'
    rough = '<input name="specular_roughness" type="float" nodegraph="g" output="b"/>'
    coat = given("coat", "float", "0.5") + given("emission", "float", "2") + given("opacity", "color3", "1, .5, 0")
    open_pbr = '<input name="fuzz_weight" type="float" nodegraph="g" output="b"/>' + given(
        "base_metalness", "float", ".5"
    )
    included = '<xi:include href="part.mtlx"/>'
    return [
        document(graph + surface("standard_surface", colour + rough + coat)).encode(),
        document(
            included + graph + surface("open_pbr_surface", colour + open_pbr), root='colorspace="acescg"'
        ).encode(),
        document(surface("gltf_pbr", given("base_color", "color3", "1,0,0")), version="1.37").encode(),
    ]


def read_mtlx_file(path: Path) -> None:
    """A document, with the maps that its networks compute."""
    from engine.scene.loaders.mtlx import read_materials

    mtlxs(path.parent)
    read_mesh_file(path)
    for baked in read_materials(path).maps[:2]:
        assert np.isfinite(baked.texels()).all()


def archives(folder: Path) -> list[bytes]:
    import zipfile

    found = []
    for compression in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        with zipfile.ZipFile(folder / "seed.zip", "w", compression) as archive:
            for name, data in (("deep/a.obj", objs(folder)[0]), ("deep/a.mtl", mtls(folder)[0]), ("readme", b"hello")):
                archive.writestr(name, data)
        found.append((folder / "seed.zip").read_bytes())
    with zipfile.ZipFile(folder / "seed.zip", "w") as archive:
        rest = b'[light]\nenvironment = "scene/files/b.exr"\n[[object]]\nname = "a"\n'
        archive.writestr("a.insitu", b'version = 2\nscene = "scene/a.obj"\n' + rest)
        archive.writestr("scene/a.obj", objs(folder)[0])
    return [*found, (folder / "seed.zip").read_bytes()]


def read_archive(path: Path) -> None:
    """All files of an archive, its scene unpacked, and its session, if it has one."""
    import os

    from app.document.scene_files import unpacked_scene_file
    from app.files.session import archived_session
    from engine.core.zip_files import ZipArchive

    archive = ZipArchive(path.read_bytes(), path)
    assert all(".." not in name.split("/") and not name.startswith("/") for name in archive.names)
    os.environ["INSITU_CACHE"] = str(path.parent / "cache")
    read_mesh_file(unpacked_scene_file(str(path)))
    archived_session(str(path))


def glbs(_: Path) -> list[bytes]:
    """A triangle with a texture, skinned bars that an animation bends, one of them with a morph target, and lights."""
    from tests.engine.render.test_vertex_colours import card_glb
    from tests.engine.scene.conftest import pack_glb
    from tests.engine.scene.loaders.test_gltf_lights import lights_glb
    from tests.engine.scene.loaders.test_gltf_rig import Bar
    from tests.engine.scene.test_costs import png, textured

    places, corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], "<f4"), np.arange(3, dtype="<u2")
    tree = {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "translation": [0, 1, 0], "scale": [1, 2, 1]}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"},
                      {"bufferView": 1, "componentType": 5123, "count": 3, "type": "SCALAR"}],
        "bufferViews": [{"buffer": 0, "byteOffset": 0, "byteLength": 36},
                        {"buffer": 0, "byteOffset": 36, "byteLength": 6}],
        "buffers": [{"byteLength": 42}],
    }  # fmt: skip
    card = textured(tree, places.tobytes() + corners.tobytes(), png(4), 1, baseColorTexture=True)
    bar, moving = Bar(), Bar()
    moving.primitive["targets"] = [{"POSITION": moving.add(np.full((5, 3), 0.5, "<f4"))}]
    moving.move(0, "weights", [0, 1, 2], [[0.0], [1.0], [0.0]])
    moving.move(1, "translation", [0, 1], [[0, 1, 0]] * 6, "CUBICSPLINE")
    for each in (bar, moving):
        each.tree["buffers"] = [{"byteLength": len(each.binary)}]
    lit = lights_glb([{"type": "spot", "range": 2, "spot": {"outerConeAngle": 0.5}}, {"type": "directional"}], [{}, {}])
    cut = card_glb(material={"alphaMode": "MASK", "alphaCutoff": 0.25, "doubleSided": False})
    return [pack_glb(*card), pack_glb(bar.tree, bar.binary), pack_glb(moving.tree, moving.binary), lit, cut]


def read_animated_file(path: Path) -> None:
    """A mesh, at rest and as it moves."""
    from engine.realtime.zonal_harmonics.pose import Pose
    from engine.realtime.zonal_harmonics.posed_scene import animated_pose
    from engine.scene.loaders.formats import read_model

    read_mesh_file(path)
    for part in read_model(path).parts:
        for clip in part.rig.skeleton.clips if part.rig is not None else ():
            places = part.mesh.vertices.astype(np.float64)
            rest = Pose(places, np.tile(np.eye(3), (len(places), 1, 1)))
            for time in (0.0, 0.3, 1e3):
                animated_pose(part.rig, rest, part.mesh.triangles, clip.name, time)
