"""Stages of USD: what is not shown is listed, what is wrong costs its own prim alone."""

from __future__ import annotations

from pathlib import Path

import pytest

from engine.core.errors import LoadError
from engine.scene.loaders.usd import read_usd
from engine.scene.mesh import join_meshes
from tests.fuzz.usd_seeds import STAGES, write_images
from tests.usd_text import CARD, SQUARE, area, mesh_of, read, unshown, usda, write

pytest.importorskip("pxr", reason="usd-core, the extra insitu[usd], is not installed")

# ----------------------------------------------------------------------------------------------------------- all of it


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


# -------------------------------------------------------------------------------- what is wrong does not hide the rest


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
