"""Stages of USD: transforms, units, instances, what is hidden, and names of parts."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from engine.core.errors import LoadError
from engine.scene.loaders.usd import read_usd
from tests.usd_text import SQUARE, bound, box, material, mesh_of, place, read, unshown

pytest.importorskip("pxr", reason="usd-core, the extra insitu[usd], is not installed")

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
