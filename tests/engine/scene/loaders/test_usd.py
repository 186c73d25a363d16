"""Stages of USD: surfaces, transforms, instances, animations, and what is not shown, by files that the tests write."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from engine.core.errors import LoadError
from engine.realtime.zonal_harmonics.pose import Pose
from engine.realtime.zonal_harmonics.posed_scene import animated_pose
from engine.scene.loaders.model import ImportedModel
from engine.scene.loaders.usd import read_usd
from engine.scene.mesh import Mesh, face_normals, join_meshes
from tests.fuzz.usd_seeds import STAGES, write_images
from tests.usd_text import CARD, SQUARE, bound, material, place, read, unshown, usda, write


def mesh_of(model: ImportedModel) -> Mesh:
    (part,) = model.parts
    return part.mesh


def area(mesh: Mesh) -> float:
    a, b, c = mesh.vertices[mesh.triangles].transpose(1, 0, 2)
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2.0)


def box(mesh: Mesh) -> list[list[float]]:
    return np.round([mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)], 9).tolist()


# ------------------------------------------------------------------------------------------------------------ topology


def test_a_polygon_mesh_is_flat_where_it_has_no_normals(tmp_path: Path) -> None:
    mesh = mesh_of(read(tmp_path, CARD))
    assert area(mesh) == pytest.approx(4.0) and mesh.normals is None
    assert mesh.uvs is not None and np.allclose(mesh.uvs * 2.0 - 1.0, mesh.vertices[mesh.triangles][..., :2])


def test_concave_polygons_cover_their_own_area(tmp_path: Path) -> None:
    # An L of three unit squares, begun so that a fan would cover four.
    body = """def Mesh "L" {
        int[] faceVertexCounts = [6]
        int[] faceVertexIndices = [0, 1, 2, 3, 4, 5]
        point3f[] points = [(2, 0, 0), (2, 1, 0), (1, 1, 0), (1, 2, 0), (0, 2, 0), (0, 0, 0)]
        uniform token subdivisionScheme = "none"
    }"""
    assert area(mesh_of(read(tmp_path, body))) == pytest.approx(3.0)


def test_holes_and_polygons_without_three_corners_are_left_out(tmp_path: Path) -> None:
    body = """def Mesh "M" {
        int[] faceVertexCounts = [4, 2, 3, 3]
        int[] faceVertexIndices = [0, 1, 2, 3, 0, 1, 0, 1, 2, 0, 2, 3]
        int[] holeIndices = [3]
        point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
        float[] primvars:displayOpacity = [1, 1, 0.25, 1] (interpolation = "uniform")
        uniform token subdivisionScheme = "none"
    }"""
    mesh = mesh_of(read(tmp_path, body))
    assert area(mesh) == pytest.approx(1.5) and mesh.colours is not None
    assert mesh.colours[:, 0, 3].tolist() == [1.0, 1.0, 0.25]  # values keep the numbers that polygons have in the file


def test_left_handed_faces_are_wound_the_other_way(tmp_path: Path) -> None:
    for orientation, z in (("rightHanded", 1.0), ("leftHanded", -1.0)):
        body = f'def Mesh "M" {{{SQUARE} uniform token orientation = "{orientation}"\n}}'
        mesh = mesh_of(read(tmp_path, body))
        assert face_normals(mesh.vertices, mesh.triangles)[0][:, 2].tolist() == [z, z]
        assert mesh.uvs is not None and np.allclose(mesh.uvs * 2.0 - 1.0, mesh.vertices[mesh.triangles][..., :2])


BLACK, RED, GREEN, BLUE = [0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]


@pytest.mark.parametrize(
    ("interpolation", "values", "expected"),
    [
        ("constant", [RED], [RED] * 6),
        ("uniform", [RED, GREEN], [RED] * 3 + [GREEN] * 3),
        ("vertex", [BLACK, BLUE, GREEN, RED], [BLACK, BLUE, GREEN, BLACK, GREEN, RED]),
        ("varying", [BLACK, BLUE, GREEN, RED], [BLACK, BLUE, GREEN, BLACK, GREEN, RED]),
        ("faceVarying", [BLACK, BLUE, GREEN, RED, RED, BLUE], [BLACK, BLUE, GREEN, RED, RED, BLUE]),
    ],
)
def test_colours_of_every_interpolation(
    tmp_path: Path, interpolation: str, values: list[list[int]], expected: list[list[int]]
) -> None:
    colours = ", ".join(f"({red}, {green}, {blue})" for red, green, blue in values)
    body = f"""def Mesh "M" {{
        int[] faceVertexCounts = [3, 3]
        int[] faceVertexIndices = [0, 1, 2, 0, 2, 3]
        point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
        color3f[] primvars:displayColor = [{colours}] (interpolation = "{interpolation}")
        uniform token subdivisionScheme = "none"
    }}"""
    mesh = mesh_of(read(tmp_path, body))
    assert mesh.colours is not None and mesh.colours[..., :3].reshape(-1, 3).tolist() == expected


def test_indexed_primvars_and_those_of_prims_above(tmp_path: Path) -> None:
    body = f"""def Xform "Above" {{
        color3f[] primvars:displayColor = [(0, 0.5, 0)]
        def Mesh "Own" {{{SQUARE}
            color3f[] primvars:displayColor = [(1, 0, 0), (0, 0, 1)] (interpolation = "vertex")
            int[] primvars:displayColor:indices = [1, 0, 1, 0]
        }}
        def Mesh "Inherits" {{{SQUARE}{place(0, 0, 1)}}}
    }}"""
    mesh = mesh_of(read(tmp_path, body))
    assert mesh.colours is not None
    own, inherited = mesh.colours[:2], mesh.colours[2:]
    assert own[0, :, :3].tolist() == [[0, 0, 1], [1, 0, 0], [0, 0, 1]]
    assert (inherited[..., :3] == (0.0, 0.5, 0.0)).all()


def test_normals_of_corners_split_vertices_where_they_differ(tmp_path: Path) -> None:
    body = """def Mesh "M" {
        int[] faceVertexCounts = [3, 3]
        int[] faceVertexIndices = [0, 1, 2, 0, 2, 3]
        point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
        normal3f[] normals = [(0, 0, 2), (0, 0, 1), (1, 0, 0), (0, 0, 2), (0, 1, 0), (nan, 0, 1)] (
            interpolation = "faceVarying"
        )
        uniform token subdivisionScheme = "none"
    }"""
    model = read(tmp_path, body)
    mesh = mesh_of(model)
    assert len(mesh.vertices) == 5 and mesh.normals is not None  # corner 2 has two normals
    corners = np.round(mesh.normals[mesh.triangles].reshape(-1, 3), 6).tolist()
    # Of length 1; what is no number is that of the face.
    assert corners == [[0, 0, 1], [0, 0, 1], [1, 0, 0], [0, 0, 1], [0, 1, 0], [0, 0, 1]]
    assert any("1 that are no numbers" in note for note in model.notes)


def test_subdivided_spheres_are_smooth_and_lie_within_their_cube(tmp_path: Path) -> None:
    body = """def Mesh "Cube" {
        int[] faceVertexCounts = [4, 4, 4, 4, 4, 4]
        int[] faceVertexIndices = [0,1,3,2, 2,3,5,4, 4,5,7,6, 6,7,1,0, 1,7,5,3, 6,0,2,4]
        point3f[] points = [(-1,-1,1),(1,-1,1),(-1,1,1),(1,1,1),(-1,1,-1),(1,1,-1),(-1,-1,-1),(1,-1,-1)]
        normal3f[] normals = [(1,0,0)] (interpolation = "constant")
    }"""
    model = read(tmp_path, body)
    mesh = mesh_of(model)
    assert len(mesh.triangles) == 6 * 16 * 2 and mesh.normals is not None
    # The middle of a face is 1 away after one step, and after two (F + 2 R + P) / 4 with F = 55/72, R = 7/8 and P = 1.
    assert float(np.abs(mesh.vertices).max()) == pytest.approx((55.0 / 72.0 + 1.75 + 1.0) / 4.0)
    radii = np.linalg.norm(mesh.vertices, axis=1)
    outward = (mesh.normals * mesh.vertices).sum(axis=1) / radii
    assert outward.min() > 0.95 and radii.max() / radii.min() < 1.2
    assert not model.unshown  # its normals mean nothing


# -------------------------------------------------------------------------------------------------------------- shapes


@pytest.mark.parametrize(
    ("shape", "size", "volume"),
    [
        ('Sphere "S"', "double radius = 2", 4.0 / 3.0 * np.pi * 8.0),
        ('Cube "S"', "double size = 3", 27.0),
        ('Cylinder "S"', 'double radius = 2\n double height = 3\n uniform token axis = "X"', np.pi * 12.0),
        ('Cone "S"', "double radius = 2\n double height = 3", np.pi * 4.0),
        ('Capsule "S"', 'double radius = 1\n double height = 2\n uniform token axis = "Y"', np.pi * (2.0 + 4.0 / 3.0)),
        ('Cylinder_1 "S"', "double radiusTop = 1\n double radiusBottom = 2\n double height = 3", np.pi * 7.0),
    ],
)
def test_shapes_have_their_volume(tmp_path: Path, shape: str, size: str, volume: float) -> None:
    mesh = mesh_of(read(tmp_path, f"def {shape} {{\n{size}\n}}"))
    a, b, c = mesh.vertices[mesh.triangles].transpose(1, 0, 2)
    # By Gauss' theorem; positive, because all faces look outwards. Tessellation takes a few parts in a thousand.
    assert float((a * np.cross(b, c)).sum() / 6.0) == pytest.approx(volume, rel=4e-3)
    assert mesh.normals is not None and mesh.uvs is not None
    flat, _ = face_normals(mesh.vertices, mesh.triangles)
    assert ((mesh.normals[mesh.triangles] * flat[:, None]).sum(axis=2) > 0.7).all()


def test_shapes_without_sizes_have_those_of_the_schema(tmp_path: Path) -> None:
    sizes = {
        "Sphere": [2, 2, 2], "Cube": [2, 2, 2], "Cylinder": [2, 2, 2], "Cone": [2, 2, 2], "Capsule": [1, 1, 2],
        "Plane": [2, 2, 0],
    }  # fmt: skip
    for kind, size in sizes.items():
        low, high = box(mesh_of(read(tmp_path, f'def {kind} "S" {{}}')))
        assert np.allclose(np.subtract(high, low), size, atol=2e-3), kind


@pytest.mark.parametrize(("axis", "size"), [("X", [0, 4, 3]), ("Y", [3, 0, 4]), ("Z", [3, 4, 0])])
def test_planes_stand_on_their_axis(tmp_path: Path, axis: str, size: list[int]) -> None:
    body = f'def Plane "P" {{\n double width = 3\n double length = 4\n uniform token axis = "{axis}"\n}}'
    mesh = mesh_of(read(tmp_path, body))
    low, high = box(mesh)
    assert np.allclose(np.subtract(high, low), size)
    assert np.allclose(face_normals(mesh.vertices, mesh.triangles)[0], np.eye(3)["XYZ".index(axis)])


# ---------------------------------------------------------------------------------------------------------- transforms


def test_units_and_the_axis_that_points_up(tmp_path: Path) -> None:
    path = tmp_path / "a.usda"
    body = f'def Mesh "M" {{{SQUARE}{place(0, 0, 300)}}}'
    path.write_text(f'#usda 1.0\n(\n upAxis = "Z"\n metersPerUnit = 0.01\n)\n{body}')
    assert box(mesh_of(read_usd(path))) == [[-0.01, 3.0, -0.01], [0.01, 3.0, 0.01]]
    path.write_text(f"#usda 1.0\n{body}")  # centimetres and Y, where nothing is said
    assert box(mesh_of(read_usd(path))) == [[-0.01, -0.01, 3.0], [0.01, 0.01, 3.0]]


def test_transforms_follow_their_order_and_may_ignore_those_above(tmp_path: Path) -> None:
    body = f"""def Xform "A" {{{place(10, 0, 0)}
        def Mesh "Turned" {{{SQUARE}
            float3 xformOp:rotateXYZ = (90, 0, 0)
            double3 xformOp:translate = (0, 0, 5)
            float3 xformOp:scale = (1, 2, 1)
            uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateXYZ", "xformOp:scale"]
        }}
        def Mesh "Free" {{{SQUARE}
            double3 xformOp:translate = (0, 0, -7)
            uniform token[] xformOpOrder = ["!resetXformStack!", "xformOp:translate"]
        }}
    }}"""
    mesh = mesh_of(read(tmp_path, body))
    corners = {tuple(np.round(v, 6).tolist()) for v in mesh.vertices}
    assert {(9, 0, 3), (11, 0, 3), (11, 0, 7), (9, 0, 7), (-1, -1, -7), (1, 1, -7)} <= corners


def test_what_is_hidden_or_for_guides_is_listed(tmp_path: Path) -> None:
    body = f"""
    def Mesh "Shown" {{{SQUARE} token purpose = "render"
    }}
    def Xform "Hidden" {{
        token visibility = "invisible"
        def Mesh "M" {{{SQUARE} float custom:weight = 2
        }}
    }}
    def Mesh "Guide" {{{SQUARE} token purpose = "guide"
    }}
    def Mesh "Off" (active = false) {{{SQUARE}}}
    class Mesh "Class" {{{SQUARE}}}
    over "Over" {{ def Mesh "M" {{{SQUARE}}} }}
    """
    model = read(tmp_path, body)
    assert len(mesh_of(model).triangles) == 2
    assert unshown(model) == {"Xform.visibility": 1, "Mesh.purpose": 1, "Mesh.active": 1}


# ----------------------------------------------------------------------------------------------------------- instances


def test_instances_have_the_places_of_their_prims(tmp_path: Path) -> None:
    body = f"""
    class Xform "Tree" {{ def Xform "Trunk" {{{place(0, 1, 0)} def Mesh "M" {{{SQUARE}}} }} }}
    def Xform "One" (instanceable = true\n prepend inherits = </Tree>) {{{place(5, 0, 0)}}}
    def Xform "Two" (instanceable = true\n prepend inherits = </Tree>) {{{place(-5, 0, 0)}}}
    """
    mesh = mesh_of(read(tmp_path, body))
    assert len(mesh.triangles) == 4
    assert {(x, y, 0.0) for x in (-6.0, -4.0, 4.0, 6.0) for y in (0.0, 2.0)} == set(map(tuple, mesh.vertices.tolist()))


def test_point_instances_are_scaled_turned_and_masked(tmp_path: Path) -> None:
    body = f"""def PointInstancer "P" {{{place(0, 10, 0)}
        rel prototypes = [</P/Prototypes/A>, </P/Prototypes/B>]
        int[] protoIndices = [0, 1, 0]
        int64[] ids = [7, 8, 9]
        int64[] invisibleIds = [9]
        point3f[] positions = [(0, 0, 0), (5, 0, 0), (50, 0, 0)]
        quath[] orientations = [(1, 0, 0, 0), (0, 1, 0, 0), (1, 0, 0, 0)]
        float3[] scales = [(1, 1, 1), (2, 2, 2), (1, 1, 1)]
        over "Prototypes" {{
            def Mesh "A" {{{SQUARE}}}
            def Xform "B" {{{place(0, 0, 1)} def Mesh "M" {{{SQUARE}}} }}
        }}
    }}"""
    model = read(tmp_path, body)
    mesh = mesh_of(model)
    a, b = mesh.vertices[:4], mesh.vertices[4:]
    found = sorted([a, b], key=lambda each: each[:, 0].min())
    assert np.allclose([found[0].min(axis=0), found[0].max(axis=0)], [[-1, 9, 0], [1, 11, 0]])
    # B is a metre along +Z in its own frame; half a turn about X and the scale bring it to z = -2.
    assert np.allclose([found[1].min(axis=0), found[1].max(axis=0)], [[3, 8, -2], [7, 12, -2]], atol=1e-3)
    assert not model.unshown


def test_instances_in_instances_are_limited(tmp_path: Path) -> None:
    # Ten levels of ten: 10^10 copies in a few kilobytes.
    levels = [f'class Xform "L0" {{ def Mesh "M" {{{SQUARE}}} }}']
    for k in range(1, 11):
        uses = "\n".join(
            f'def Xform "I{i}" (instanceable = true\n prepend inherits = </L{k - 1}>) {{}}' for i in range(10)
        )
        levels.append(f'class Xform "L{k}" {{\n{uses}\n}}')
    body = "\n".join(levels) + '\ndef Xform "Top" (instanceable = true\n prepend inherits = </L10>) {}'
    with pytest.raises(LoadError, match="fewer instances in a file of this size"):
        read(tmp_path, body)


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


# ---------------------------------------------------------------------------------------------------------- all of it


def test_what_no_reader_knows_is_listed_by_schema_and_name(tmp_path: Path) -> None:
    body = f"""
    def Xform "World" (
        variants = {{ string colour = "red" }}
        prepend variantSets = "colour"
        prepend apiSchemas = ["PhysicsRigidBodyAPI"]
    ) {{
        variantSet "colour" = {{ "red" {{ }} "blue" {{ }} }}
        vector3f physics:velocity = (0, 1, 0)
        custom string userProperties:owner = "me"
    }}
    def Mesh "M" {{{SQUARE}
        vector3f[] velocities = [(0, 0, 0), (0, 0, 0), (0, 0, 0), (0, 0, 0)]
        texCoord2f[] primvars:second = [(0, 0)] (interpolation = "constant")
        rel proxyPrim = </World>
        float3[] extent = [(-1, -1, 0), (1, 1, 0)]
    }}
    def BasisCurves "Hair" {{ int[] curveVertexCounts = [4]
    }}
    def Points "Dust" {{}}
    def Foo "Unknown" {{ float bar = 1
    }}
    def SkelRoot "Body" {{ def Skeleton "Bones" {{}} }}
    def Material "Nobodys" {{}}
    """
    assert unshown(read(tmp_path, body)) == {
        "variantSets.colour": 1, "PhysicsRigidBodyAPI": 1, "Xform.physics:velocity": 1,
        "Xform.userProperties:owner": 1, "Mesh.velocities": 1, "Mesh.primvars:second": 1, "BasisCurves": 1,
        "Points": 1, "Foo": 1, "Skeleton": 1, "Material": 1,
    }  # fmt: skip


@pytest.mark.parametrize("name", STAGES)
def test_every_prim_of_every_sample_is_shown_or_listed(tmp_path: Path, name: str) -> None:
    """Each prim of a stage gets a property that nobody knows: the report has one of each schema, or the prim."""
    from pxr import Sdf, Usd

    write_images(tmp_path)
    (tmp_path / "a.usda").write_text(STAGES[name])
    stage = Usd.Stage.Open(str(tmp_path / "a.usda"))
    kinds = set()
    for prim in stage.Traverse():
        prim.CreateAttribute("unheardOf", Sdf.ValueTypeNames.Float, custom=True).Set(1.0)
        kinds.add(str(prim.GetTypeName()) or "Prim")
    stage.Export(str(tmp_path / "b.usda"))
    listed = unshown(read_usd(tmp_path / "b.usda"))
    assert kinds == {kind for kind in kinds if kind in listed or f"{kind}.unheardOf" in listed}


# -------------------------------------------------------------------------------------------------------------- faults


@pytest.mark.parametrize(
    ("mesh", "said"),
    [
        ("int[] faceVertexCounts = [3]\n int[] faceVertexIndices = [0, 1, 9]", "faceVertexIndices = 9"),
        ("int[] faceVertexCounts = [3]\n int[] faceVertexIndices = [0, 1, -2]", "faceVertexIndices = -2"),
        ("int[] faceVertexCounts = [5]\n int[] faceVertexIndices = [0, 1, 2]", "faceVertexCounts = 5"),
        ("int[] faceVertexCounts = [-3]\n int[] faceVertexIndices = [0, 1, 2]", "faceVertexCounts"),
        ("int[] faceVertexIndices = [0, 1, 2]", "faces = 0"),
    ],
)
def test_a_mesh_that_cannot_be_read_is_listed_beside_others(tmp_path: Path, mesh: str, said: str) -> None:
    broken = f'def Mesh "Broken" {{\n point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]\n {mesh}\n}}'
    model = read(tmp_path, CARD + "\n" + broken)
    assert len(mesh_of(model).triangles) == 2 and any(said in note for note in model.notes)
    with pytest.raises(LoadError, match="faces = 0"):
        read(tmp_path, broken)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "first bytes"), ("#usda 1.0\ndef Mesh {", "line 2"), ("#usda 99.0\n", "USD"),
        ("PXR-USDC" + "\0" * 100, "USD"), (usda(""), "faces = 0"), ("hello", "first bytes"),
    ],
)  # fmt: skip
def test_files_that_are_no_stages_are_refused_in_one_line(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "a.usda"
    path.write_text(text)
    with pytest.raises(LoadError) as error:
        read_usd(path)
    assert said in str(error.value) and "insitu-usd" not in str(error.value) and "\n" not in str(error.value)


def test_without_the_library_one_line_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(LoadError, match=r"not installed, expected the extra for USD: pip install 'insitu\[usd\]'"):
        read_usd(write(tmp_path / "a.usda", CARD))


# --------------------------------------------------------------------------------- what is wrong does not hide the rest


def test_a_property_of_another_type_costs_its_own_prim_alone(tmp_path: Path) -> None:
    points = SQUARE.partition("point3f[] points")[0] + "quatf points = (1, 0, 0, 0)\n"
    holes = f'def Mesh "M" {{{SQUARE} float holeIndices = 3\n}}'
    found = read(tmp_path, f'{CARD}\n{holes}\ndef Mesh "N" {{{points}}}')
    assert area(join_meshes([part.mesh for part in found.parts])) == pytest.approx(4.0)
    assert len([each for each in found.unshown if each.name.startswith("Mesh.")]) == 2


@pytest.mark.parametrize("matrix", ["((1, 0, 0, 1), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1))",
                                    "((nan, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1))"])  # fmt: skip
def test_what_has_no_place_is_listed(tmp_path: Path, matrix: str) -> None:
    lost = f"""def Xform "X" {{ matrix4d xformOp:transform = {matrix}
        uniform token[] xformOpOrder = ["xformOp:transform"]
        {CARD}
    }}"""
    found = read(tmp_path, f"{CARD}\n{lost}")
    assert area(mesh_of(found)) == pytest.approx(4.0)
    assert any(each.name == "Xform.xformOpOrder" and "has no place" in each.effect for each in found.unshown)


def test_an_axis_and_a_unit_that_are_none_are_noted(tmp_path: Path) -> None:
    found = read(tmp_path, CARD, 'upAxis = "X"\n    metersPerUnit = 0')
    assert area(mesh_of(found)) == pytest.approx(4.0e-4)  # centimetres
    assert found.notes == ("upAxis = X, taken as Y", "metersPerUnit = 0, taken as 0.01, as without one")


# --------------------------------------------------------------------------------------------------------------- names


def test_parts_are_called_as_their_prims_where_these_are_all_of_them(tmp_path: Path) -> None:
    painted = """color3f[] primvars:displayColor = [(1, 0, 0)]"""
    body = f"""
def Xform "Room" {{
    def Mesh "Wall" {{{SQUARE}}}
    def Mesh "Door" {{{SQUARE}}}
    def Mesh "Lamp" (prepend apiSchemas = ["MaterialBindingAPI"]) {{{SQUARE}{bound("Brass")}}}
    def Mesh "Toy" {{{SQUARE}{painted}}}
}}
{material("Brass", "")}
"""
    model = read(tmp_path, body)
    assert sorted(part.object_name for part in model.parts) == ["Lamp", "Room", "Toy"]  # Room: of Wall and Door
    assert [part.name for part in model.parts if part.object_name == "Lamp"] == ["Brass"]


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
    assert unshown(model) == {"SkelAnimation.timeSamples": 1}


def test_instances_of_skins_are_posed(tmp_path: Path) -> None:
    body = f"""class Xform "Person" {{ {_skinned("0, 1", "constant").replace("/Body", "/Person/Body")} }}
    def Xform "One" (instanceable = true\n prepend inherits = </Person>) {{}}
    def Xform "Two" (instanceable = true\n prepend inherits = </Person>) {{{place(7, 0, 0)}}}"""
    model = read(tmp_path, body, "startTimeCode = 5\n endTimeCode = 10")
    assert box(mesh_of(model)) == [[-1, -1, 5], [8, 2, 5]]


def test_a_skin_that_cannot_be_posed_rests_and_is_listed(tmp_path: Path) -> None:
    model = read(tmp_path, _skinned("0", "constant"), "startTimeCode = 5\n endTimeCode = 10")
    assert box(mesh_of(model))[0][2] == 0.0 and unshown(model)["Mesh.primvars:skel:jointWeights"] == 1
