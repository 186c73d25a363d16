"""The kinds of files that people hand in, each with small sound ones by the project's own writers, and its reader.

A reader takes a file as the program does, and looks at what it made of it: it may raise `InsituError`, or nothing.
"""

from __future__ import annotations

import io
import struct
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tests.fuzz.gltf_seeds import dracos, gltfs, meshopts
from tests.fuzz.repair import repaired_glb, repaired_png, repaired_records
from tests.fuzz.usd_seeds import usdas, usdcs

ROOT = Path(__file__).resolve().parents[2]


@dataclass(frozen=True)
class Format:
    """name: of the files that are read, in a folder of their own; seeds: sound ones, made in a folder; repaired: with
    its checksums made right; share: of the inputs that are asked for, as many are read."""

    name: str
    seeds: Callable[[Path], Iterable[bytes]]
    read: Callable[[Path], object]
    is_text: bool = False
    repaired: Callable[[bytes], bytes] | None = None
    share: float = 1.0


def texts(pattern: str) -> Callable[[Path], list[bytes]]:
    return lambda _: [path.read_bytes() for path in sorted((ROOT / "assets").glob(pattern))]


# ---------------------------------------------------------------------------------------------------------- text


def read_scene(path: Path) -> None:
    from app.document.document import document_from_description
    from engine.scene.description import load_description

    document_from_description(str(path), load_description(path))


def scenes(folder: Path) -> list[bytes]:
    from tests.app.worker.ball_and_lamp import SCENE

    return [SCENE.encode(), *texts("scenes/*/scene.toml")(folder)]


def sessions(folder: Path) -> list[bytes]:
    """One that says little, and one in which all that there can be differs from its default."""
    from PIL import Image

    from app.document.commands.curves import AddOperator, CollapseOperators
    from app.document.commands.layers import SetFresnelTerm
    from app.document.commands.light import SetEnvironment
    from app.document.commands.maps import Paint, SetMap, SetOpacity
    from app.document.commands.poses import AddDeformer
    from app.document.document import document_from_description
    from app.document.view_state import Bookmark, Viewpoint, ViewState
    from app.files.session import save_session
    from engine.curve.drawing import through_points
    from engine.curve.operators import Operator
    from engine.material.strokes import Stroke, pack_dabs
    from engine.scene.description import Camera, parse_description
    from tests.app.fake_worker import SCENE as SHELF

    plain = edited = document_from_description("shelf", parse_description(SHELF, "scene.toml"))
    lift = Operator("translate", "y", 0.1, 0.2, 1 / 3, 0.4, magnitude=1 / 7, channels=(True, False, True))
    for command in (
        AddOperator("pot.1", "theta_h", lift),
        AddOperator("pot.1", "theta_h", Operator("amplify", "x", 0.0, 0.0, 0.5, 0.5, 1.25, baseline=0.1, muted=True)),
        AddOperator("pot.1", "theta_h", through_points((0.1, 1 / 3), ((1.0, 0.5, 0.25), (2.0, 1.0, 0.5)), 0.05)),
        AddOperator("pot.1", "theta_d", lift),
        CollapseOperators("pot.1", "theta_d"),
        SetFresnelTerm("pot.0", (0.9, 0.5, 0.04)),
        SetMap("floor.0", "texture", "oak.png"),
        SetMap("floor.0", "vertex_colours", True),
        SetOpacity("pot", "opacity_mode", "blend"),
        SetOpacity("pot", "opacity_factor", 1 / 3),
        Paint("floor.0", Stroke(0.1, dabs=pack_dabs(np.eye(3), np.eye(3)))),
        AddDeformer("pot", "bend", 0.5),
        SetEnvironment("constant", "angular", (1.0, 0.1, 1e-5)),
    ):
        edited = command.apply(edited)
    picture = io.BytesIO()
    Image.new("RGB", (16, 12), (200, 100, 50)).save(picture, "JPEG")
    look = Viewpoint(Camera(position=(1 / 3, 1.0, 4.0), target=(0.0, 0.1, 0.0), fov_y=1 / 7), (20, 10))
    view = ViewState(exposure=-1 / 3, tone_mapping="agx", bookmarks=(Bookmark("Above", look, picture.getvalue()),))
    cases = ((plain, ViewState()), (edited, view))
    return [save_session(folder / "seed.insitu", document, view).read_bytes() for document, view in cases]


def read_session(path: Path) -> None:
    from app.files.session import load_session

    for _, layer in load_session(path).document.layers():
        for name in layer.model.curve_names:
            assert np.isfinite(layer.curve(name)(np.array([0.0, 0.7, 1.57]))).all(), name


def read_script(path: Path) -> None:
    from app.operators.script import load_script

    load_script(path)


def read_material(path: Path) -> None:
    from app.files.materials import load_material

    load_material(path)


def materials(folder: Path) -> list[bytes]:
    from app.document.commands.curves import AddOperator
    from app.document.document import document_from_description
    from app.files.materials import Material, dump_material
    from engine.curve.operators import Operator
    from engine.scene.description import parse_description
    from tests.app.fake_worker import SCENE as SHELF

    lift = Operator("translate", "y", 0.1, 0.2, 1 / 3, 0.4, magnitude=1 / 7)
    document = AddOperator("pot.1", "theta_h", lift).apply(
        document_from_description("shelf", parse_description(SHELF, "scene.toml"))
    )
    own = dump_material(Material("Pot", document.object("pot").layers)).encode()
    return [own, *texts("materials/*.toml")(folder)]


def curve_tables(folder: Path) -> list[bytes]:
    return [
        b"# a peak\nangle,red,green,blue\n0,12.5,12,11\n2.5,9,9,9\n2.5,1,1,1\n90,0.1,0.1,0.1\n",
        b"Winkel;Wert\r\n10;1,5\r\n45;0,25\r\n",
        b"10 1 # first\n20\t2\n",
    ]


def read_curve_table(path: Path) -> None:
    from engine.curve.operators import apply_operators
    from engine.curve.table_text import load_table

    curve = apply_operators([load_table(path)], lambda gamma: np.ones((gamma.size, 3)))
    assert np.isfinite(curve(np.linspace(0.0, np.pi / 2, 50))).all() and len(curve.features) < 4200


def preferences(folder: Path) -> list[bytes]:
    from app.files.preferences import PreferenceFile

    PreferenceFile(folder / "seed.toml").choose(mouse="maya", scroll="orbit")
    return [(folder / "seed.toml").read_bytes()]


def read_preferences(path: Path) -> None:
    """What is damaged is as if it were not there: nothing is raised."""
    from app.files.preferences import PreferenceFile, Preferences

    assert PreferenceFile(path).current in [Preferences(m, s) for m in ("blender", "maya") for s in ("dolly", "orbit")]


def read_recent(path: Path) -> None:
    from app.files.preferences import RecentFiles

    RecentFiles(path).entries()


# ---------------------------------------------------------------------------------------------------------- meshes


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
    return found


def read_archive(path: Path) -> None:
    """All files of an archive, and its scene unpacked."""
    import os

    from app.document.scene_files import unpacked_scene_file
    from engine.core.zip_files import ZipArchive

    archive = ZipArchive(path.read_bytes(), path)
    assert all(".." not in name.split("/") and not name.startswith("/") for name in archive.names)
    os.environ["INSITU_CACHE"] = str(path.parent / "cache")
    read_mesh_file(unpacked_scene_file(str(path)))


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


# -------------------------------------------------------------------------------------------------------- pictures

GRADIENT = np.linspace(0.0, 4.0, 12 * 8 * 3, dtype=np.float32).reshape(8, 12, 3)
SQUARE = np.ascontiguousarray(GRADIENT[:, :8])


def exrs(folder: Path) -> list[bytes]:
    import OpenEXR

    from engine.render.display import exr_bytes
    from tests.naive.exr_files import ExrPart, exr_file

    found, path = [exr_bytes(GRADIENT, "a seed"), exr_bytes(SQUARE)], folder / "seed.exr"
    for kind, compression in ((np.float16, OpenEXR.NO_COMPRESSION), (np.float32, OpenEXR.PIZ_COMPRESSION)):
        channels = {name: np.ascontiguousarray(GRADIENT[..., i].astype(kind)) for i, name in enumerate("RGB")}
        with OpenEXR.File({"compression": compression, "type": OpenEXR.scanlineimage}, channels) as file:
            file.write(str(path))
        found.append(path.read_bytes())
    aces = (0.7347, 0.2653, 0.0, 1.0, 0.0001, -0.077, 0.32168, 0.33767)
    with OpenEXR.File({"chromaticities": aces, "type": OpenEXR.scanlineimage}, {"RGB": GRADIENT}) as file:
        file.write(str(path))
    name = b"displayWindow\0box2i\0" + struct.pack("<i", 16)
    within = found[0].replace(name + struct.pack("<4i", 0, 0, 11, 7), name + struct.pack("<4i", -3, 2, 8, 20))
    planes = {name: np.ascontiguousarray(GRADIENT[..., i]) for i, name in enumerate("RGB")}
    chroma = {"RY": planes["R"][::2, ::2], "BY": planes["B"][::2, ::2].astype(np.float16)}
    variants = (
        (ExrPart({"Z": planes["R"]}, name="depth"), ExrPart(planes, tile=5, is_mip_map=True, name="beauty")),
        (ExrPart({"Y": planes["G"]} | chroma, {"RY": (2, 2), "BY": (2, 2)}),),
        (ExrPart({"diffuse.R": planes["R"].astype(np.uint32), "diffuse.G": planes["G"].astype(np.float16)}, tile=8),),
    )
    cube = {name: np.ones((18, 3), np.float32) for name in "RGB"}
    return [*found, path.read_bytes(), within, *(exr_file(*parts) for parts in variants), exr_file(ExrPart(cube))]


def hdrs(folder: Path) -> list[bytes]:
    from tests.engine.light.test_radiance_files import flat_scanlines, gradient, packed_scanlines, rgbe, write_hdr

    quads = rgbe(gradient())
    header = b"EXPOSURE=2\r\nCOLORCORR=1 2 1\nPRIMARIES=0.7 0.3 0.2 0.8 0.1 0.05 0.31 0.33\n"
    columns = packed_scanlines(quads.swapaxes(0, 1))
    turned = write_hdr(folder / "turned.hdr", columns, b"-X 40 +Y 24", header).read_bytes()
    seeds = [write_hdr(folder / "seed.hdr", pack(quads)).read_bytes() for pack in (flat_scanlines, packed_scanlines)]
    return [*seeds, turned, turned.replace(b"rgbe", b"xyze")]


def read_light(path: Path) -> None:
    from engine.light.environment import load_environment
    from engine.light.probe_mappings import MAPPINGS, mapping_problem
    from engine.light.radiance_files import read_radiance_image

    height, width, _ = read_radiance_image(path).shape
    for mapping in MAPPINGS:
        if mapping_problem(mapping, width, height) is None:
            radiance = load_environment(path, mapping).radiance
            assert np.isfinite(radiance).all() and radiance.min() >= 0.0


def pngs(_: Path) -> list[bytes]:
    from PIL import Image

    from engine.render.display import deep_png, pixels_png

    pixels = (GRADIENT * 60).astype(np.uint8)
    found = [pixels_png(pixels), deep_png(GRADIENT / 4.0)]
    for picture in (Image.fromarray(pixels[..., 0]), Image.fromarray(pixels).convert("P"),
                    Image.fromarray((pixels[..., 0].astype(np.int32) * 200).astype(np.uint16))):  # fmt: skip
        buffer = io.BytesIO()
        picture.save(buffer, "PNG", compress_level=0)
        found.append(buffer.getvalue())
    return found


def jpegs(_: Path) -> list[bytes]:
    from PIL import Image

    found = []
    for options in ({}, {"progressive": True}):
        buffer = io.BytesIO()
        Image.fromarray((GRADIENT * 60).astype(np.uint8)).save(buffer, "JPEG", **options)
        found.append(buffer.getvalue())
    return found


def webps(_: Path) -> list[bytes]:
    from PIL import Image

    found = []
    for options in ({"lossless": True}, {"quality": 80}, {"lossless": True, "exif": b"Exif\0\0II*\0\x08\0\0\0\0\0"}):
        buffer = io.BytesIO()
        Image.fromarray((GRADIENT * 60).astype(np.uint8)).save(buffer, "WebP", **options)
        found.append(buffer.getvalue())
    return found


def ktx2s(_: Path) -> list[bytes]:
    return [path.read_bytes() for path in sorted((ROOT / "tests" / "engine" / "texture" / "ktx2").glob("*.ktx2"))]


def read_texture_file(path: Path) -> None:
    from engine.texture.texture_files import read_texture, read_weight

    data = path.read_bytes()
    assert np.isfinite(read_texture(data, path)).all()
    assert np.isfinite(read_weight(data, path)).all()


# ----------------------------------------------------------------------------------------------------- measurements


def merls(_: Path) -> list[bytes]:
    from engine.measured.sample_files import merl_bytes
    from tests.naive.measured import analytic_samples

    return [merl_bytes(analytic_samples(gaps=0.1))]


def read_merl_file(path: Path) -> None:
    from engine.measured.sample_files import merl_samples, read_merl

    assert np.isfinite(merl_samples(read_merl(path), path)).all()


def cornells(_: Path) -> list[bytes]:
    random = np.random.default_rng(3)
    rows = [[*random.uniform(0.0, 1.5, 4), *random.uniform(0.0, 1.0, 4)] for _ in range(60)]
    lines = ["# a seed", "4", "450 500 600 650", *(" ".join(f"{value:.4f}" for value in row) for row in rows)]
    return ["\n".join(lines).encode()]


def read_cornell_file(path: Path) -> None:
    from engine.measured.sample_files import read_cornell, scattered_samples

    found = scattered_samples(read_cornell(path), path)
    assert np.isfinite(found.values).all() and np.isfinite(found.wi).all() and np.isfinite(found.wo).all()


def tensors(_: Path) -> list[bytes]:
    from tests.naive.tensor_files import Gloss, acquired, tensor_bytes

    bands = np.array([420.0, 500.0, 580.0, 660.0])
    colours = Gloss(ground=(0.1, 0.2, 0.3, 0.4), shine=(0.5, 0.5, 0.4, 0.4))
    few = {"n_theta": 2, "n": 3, "n_facets": 4}
    return [
        tensor_bytes(acquired(Gloss(), **few)),
        tensor_bytes(acquired(Gloss(0.5, 0.2), n_phi=3, turn=np.pi, **few)),
        tensor_bytes(acquired(colours, wavelengths=bands, **few)),
    ]


def read_tensors(path: Path) -> None:
    from engine.measured.tensor_files import adaptive_reflection, read_tensor_file

    v = np.random.default_rng(4).normal(size=(2, 50, 3))
    wi, wo = np.abs(v / np.linalg.norm(v, axis=2, keepdims=True))
    assert np.isfinite(adaptive_reflection(read_tensor_file(path), path).evaluate(wi, wo)).all()


# ----------------------------------------------------------------------------------------------- what the program keeps


def entries(folder: Path) -> list[bytes]:
    """Of visibility, of a store of bands, and of fitted lobes."""
    from engine.realtime.triple_product.visibility import deflate_bits
    from engine.realtime.zonal_harmonics.zonal import membrane
    from tests.engine.precompute.direct.test_bandstore import sparse_bands, store_of, whole

    bits = np.random.default_rng(1).integers(0, 256, (9, 40)).astype(np.uint8)
    fitted = membrane(np.full(5, 0.5), 6)
    kinds = (
        deflate_bits("bits", bits),
        whole(store_of(sparse_bands(7, 8, 4, seed=2))),
        {name: getattr(fitted, name).astype(np.float32) for name in ("low", "axes", "coefficients", "errors")},
    )
    return [_kept(folder / "cache", arrays) for arrays in kinds]


def _kept(folder: Path, arrays: dict[str, np.ndarray]) -> bytes:
    from app.worker.cache import ArrayCache

    ArrayCache(folder).put("k", arrays)
    return (folder / "k.arrays").read_bytes()


def read_entry(path: Path) -> None:
    """By all who take such; none of them raises."""
    from app.worker.cache import ArrayCache
    from app.worker.deform_worker import stored_lobes
    from engine.core.stored_arrays import ArrayReader
    from engine.precompute.direct.bandstore import arrays_of_file, store_from_arrays
    from engine.realtime.triple_product.visibility import inflate_bits

    data = path.read_bytes()
    for read in (
        lambda arrays: inflate_bits("bits", ArrayReader(arrays), 9, 40),
        lambda arrays: store_from_arrays((8, 4), arrays_of_file((8, 4), 7, arrays)).radiance(
            np.ones((8, 3)), np.ones((4, 3))
        ),
        lambda arrays: stored_lobes(arrays, 5).harmonics(),
    ):
        ArrayCache(path.parent).get(path.stem, read)
        if not path.exists():  # one that is damaged is taken away
            path.write_bytes(data)


def tiles(folder: Path) -> list[bytes]:
    from app.worker.cache import ArrayCache

    with ArrayCache(folder / "tiles").open_tiles("k", 3) as kept:
        for i in range(3):
            kept.append_tile(i, {"a": np.full((4, 3), i, np.float32), "b": np.arange(5)})
    return [(folder / "tiles" / "k.tiles").read_bytes()]


def read_tiles(path: Path) -> None:
    from app.worker.cache import ArrayCache

    with ArrayCache(path.parent).open_tiles(path.stem, 3) as kept:
        for i in kept.complete_tiles:
            kept.tile(i, dict)


FORMATS = {
    "scene": Format("scene.toml", scenes, read_scene, is_text=True),
    "session": Format("a.insitu", sessions, read_session, is_text=True),
    "script": Format("script.toml", texts("scripts/*.toml"), read_script, is_text=True),
    "material": Format("material.toml", materials, read_material, is_text=True),
    "preferences": Format("preferences.toml", preferences, read_preferences, is_text=True),
    "recent": Format("recent.txt", lambda _: [b"/tmp/a.toml\n/tmp/b c.insitu\n"], read_recent, is_text=True),
    "table": Format("a.csv", curve_tables, read_curve_table, is_text=True),
    "ply": Format("a.ply", plys, read_mesh_file),
    "obj": Format("a.obj", objs, read_mesh_file, is_text=True),
    "mtl": Format("a.mtl", mtls, read_library, is_text=True),
    "stl": Format("a.stl", stls, read_mesh_file),
    "off": Format("a.off", offs, read_mesh_file, is_text=True),
    "dae": Format("a.dae", daes, read_mesh_file, is_text=True),
    "3mf": Format("a.model", models, read_model, is_text=True),
    "mtlx": Format("a.mtlx", mtlxs, read_mtlx_file, is_text=True),
    "zip": Format("a.zip", archives, read_archive),
    "glb": Format("a.glb", glbs, read_animated_file, repaired=repaired_glb),
    "gltf": Format("a.gltf", gltfs, read_animated_file, is_text=True),
    "meshopt": Format("a.glb", meshopts, read_animated_file, repaired=repaired_glb),
    "draco": Format("a.glb", dracos, read_animated_file, repaired=repaired_glb),
    "usda": Format("a.usda", usdas, read_animated_file, is_text=True),
    "usdc": Format("a.usdc", usdcs, read_animated_file),
    "exr": Format("a.exr", exrs, read_light),
    "hdr": Format("a.hdr", hdrs, read_light),
    "exr_texture": Format("t.exr", exrs, read_texture_file),
    "png": Format("a.png", pngs, read_texture_file, repaired=repaired_png),
    "jpeg": Format("a.jpg", jpegs, read_texture_file),
    "webp": Format("a.webp", webps, read_texture_file),
    "basis": Format("a.ktx2", ktx2s, read_texture_file),
    "cornell": Format("a.brdf", cornells, read_cornell_file, is_text=True),
    "tensors": Format("a.bsdf", tensors, read_tensors),
    "entry": Format("k.arrays", entries, read_entry, repaired=repaired_records),
    "tiles": Format("k.tiles", tiles, read_tiles, repaired=repaired_records),
    "merl": Format("a.binary", merls, read_merl_file, share=0.02),
}
