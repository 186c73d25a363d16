"""Small stages of USD as text."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from engine.scene.loaders.model import ImportedModel
from engine.scene.loaders.usd import read_usd
from engine.scene.mesh import Mesh

# A square of two metres in the plane z = 0, whose corner k has the texture coordinates of a unit square.
SQUARE = """
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]
    texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1)] (interpolation = "vertex")
    uniform token subdivisionScheme = "none"
"""
CARD = f'def Mesh "Card" {{{SQUARE}}}'

# An arm of two boards along X, to be filled in with "more" of the mesh and "inbetween" shapes: the first hangs from the
# shoulder, which turns, the second from the elbow, which bends; a blend shape makes it wide there.
ARM = """
def Xform "World" {{
    double3 xformOp:translate = (0, 0, 3)
    uniform token[] xformOpOrder = ["xformOp:translate"]
    def SkelRoot "Body" (prepend apiSchemas = ["SkelBindingAPI"]) {{
        def Skeleton "Bones" (prepend apiSchemas = ["SkelBindingAPI"]) {{
            uniform token[] joints = ["Root", "Root/Elbow"]
            uniform matrix4d[] bindTransforms = [
                ((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1)),
                ((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (2, 0, 0, 1))]
            uniform matrix4d[] restTransforms = [
                ((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1)),
                ((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (2, 0, 0, 1))]
            rel skel:animationSource = </World/Body/Wave>
            double xformOp:rotateY = 30
            uniform token[] xformOpOrder = ["xformOp:rotateY"]
        }}
        def SkelAnimation "Wave" {{
            uniform token[] joints = ["Root", "Root/Elbow"]
            float3[] translations = [(0, 0, 0), (2, 0, 0)]
            quatf[] rotations.timeSamples = {{
                0: [(1, 0, 0, 0), (1, 0, 0, 0)],
                10: [(0.9238795, 0, 0, 0.3826834), (0.7071068, 0, 0.7071068, 0)] }}
            half3[] scales = [(1, 1, 1), (1, 1, 1)]
            uniform token[] blendShapes = ["fat"]
            float[] blendShapeWeights.timeSamples = {{ 0: [0], 8: [1] }}
        }}
        def Mesh "Skin" (prepend apiSchemas = ["SkelBindingAPI"]) {{
            int[] faceVertexCounts = [4, 4]
            int[] faceVertexIndices = [0, 1, 4, 3, 1, 2, 5, 4]
            point3f[] points = [(0, -1, 0), (2, -1, 0), (4, -1, 0), (0, 1, 0), (2, 1, 0), (4, 1, 0)]
            {more}
            rel skel:skeleton = </World/Body/Bones>
            uniform token[] skel:joints = ["Root/Elbow", "Root"]
            matrix4d primvars:skel:geomBindTransform = ((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0.5, 1))
            int[] primvars:skel:jointIndices = [1, 0, 1, 0, 0, 1, 1, 0, 1, 0, 0, 1] (
                interpolation = "vertex"
                elementSize = 2
            )
            float[] primvars:skel:jointWeights = [1, 0, 0.5, 0.5, 1, 0, 1, 0, 0.5, 0.5, 1, 0] (
                interpolation = "vertex"
                elementSize = 2
            )
            uniform token[] skel:blendShapes = ["fat"]
            rel skel:blendShapeTargets = </World/Body/Skin/fat>
            def BlendShape "fat" {{
                uniform vector3f[] offsets = [(0, -0.5, 0), (0, 0.5, 0)]
                uniform int[] pointIndices = [1, 4]
                {inbetween}
            }}
        }}
    }}
}}
"""


def usda(body: str, head: str = "") -> str:
    """A stage in metres with Y up, of this body; head: more of its metadata, which comes last and counts."""
    body = body.replace("}", "\n}\n")  # which USD asks for
    return f'#usda 1.0\n(\n    metersPerUnit = 1\n    upAxis = "Y"\n    {head}\n)\n{body}\n'


def place(x: float, y: float, z: float) -> str:
    """A translation of a prim."""
    return f"""
    double3 xformOp:translate = ({x}, {y}, {z})
    uniform token[] xformOpOrder = ["xformOp:translate"]
"""


def material(name: str, inputs: str, more: str = "") -> str:
    """A material with a preview surface of these inputs, and more prims in it."""
    return f"""
def Material "{name}" {{
    token outputs:surface.connect = </{name}/Surface.outputs:surface>
    def Shader "Surface" {{
        uniform token info:id = "UsdPreviewSurface"
        {inputs}
        token outputs:surface
    }}
    {more}
}}
"""


def texture(name: str, file: str, more: str = "", inside: str = "M") -> str:
    """A texture of a material, in the primvar `st` if nothing else is said."""
    return f"""
    def Shader "{name}" {{
        uniform token info:id = "UsdUVTexture"
        asset inputs:file = @{file}@
        float2 inputs:st.connect = </{inside}/Reader.outputs:result>
        float3 outputs:rgb
        float outputs:r
        float outputs:g
        float outputs:b
        float outputs:a
        {more}
    }}
"""


READER = """
    def Shader "Reader" {
        uniform token info:id = "UsdPrimvarReader_float2"
        string inputs:varname = "st"
        float2 outputs:result
    }
"""


def bound(name: str) -> str:
    """The binding of a material."""
    return f"\n    rel material:binding = </{name}>\n"


def card_of(name: str) -> str:
    """A square with a material."""
    return f'def Mesh "Card" (prepend apiSchemas = ["MaterialBindingAPI"]) {{{SQUARE}{bound(name)}}}\n'


def write(path: Path, body: str, head: str = "") -> Path:
    """A stage in a file."""
    path.write_text(usda(body, head))
    return path


def read(folder: Path, body: str, head: str = "") -> ImportedModel:
    """The model of a stage."""
    return read_usd(write(folder / "a.usda", body, head))


def unshown(model: ImportedModel) -> dict[str, int]:
    """The names of what is not shown, with their counts."""
    return {each.name: each.count for each in model.unshown}


def mesh_of(model: ImportedModel) -> Mesh:
    """The mesh of a model of one part."""
    (part,) = model.parts
    return part.mesh


def area(mesh: Mesh) -> float:
    """The area of all triangles."""
    a, b, c = mesh.vertices[mesh.triangles].transpose(1, 0, 2)
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2.0)


def box(mesh: Mesh) -> list[list[float]]:
    """The least and the largest corner."""
    return np.round([mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)], 9).tolist()
