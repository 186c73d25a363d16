"""Small stages of USD, in text and binary, which together have all that its reader knows."""

from __future__ import annotations

from pathlib import Path

from tests.usd_text import ARM, CARD, READER, SQUARE, card_of, material, place, texture, usda

_LOOK = material(
    "M",
    """
        color3f inputs:diffuseColor.connect = </M/Colour.outputs:rgb>
        float inputs:roughness.connect = </M/Numbers.outputs:g>
        float inputs:metallic = 0.5
        float inputs:opacity.connect = </M/Colour.outputs:a>
        float inputs:opacityThreshold = 0.5
        normal3f inputs:normal.connect = </M/Relief.outputs:rgb>
        color3f inputs:emissiveColor = (0.5, 0.25, 0)
        float inputs:clearcoat = 0.5
        float inputs:ior = 1.4
    """,
    READER
    + texture("Colour", "colour.png", 'token inputs:wrapS = "mirror"\n float4 inputs:scale = (1, 0.5, 1, 1)')
    + texture("Numbers", "numbers.png", 'token inputs:sourceColorSpace = "raw"')
    + texture("Relief", "relief.png", "float4 inputs:scale = (2, 2, 2, 1)\n float4 inputs:bias = (-1, -1, -1, 0)"),
)
_LIGHTS = f"""
def SphereLight "Ball" {{ float inputs:intensity = 5
{place(0, 3, 0)} }}
def RectLight "Panel" {{ float inputs:width = 2
    bool inputs:normalize = 1
{place(0, 3, 1)} }}
def DiskLight "Spot" (prepend apiSchemas = ["ShapingAPI"]) {{ float inputs:shaping:cone:angle = 30
{place(0, 3, 2)} }}
def DistantLight "Sun" {{ bool inputs:enableColorTemperature = 1
    float inputs:colorTemperature = 3000
}}
def DomeLight "Sky" {{ asset inputs:texture:file = @sky.exr@
}}
def DomeLight "Tilted" {{ asset inputs:texture:file = @sky.exr@
    color3f inputs:color = (1, 0.5, 0.25)
    double xformOp:rotateX = 30
    uniform token[] xformOpOrder = ["xformOp:rotateX"]
}}
def CylinderLight "Tube" {{ }}
def Camera "View" {{ float focalLength = 35
{place(0, 0, 9)} }}
"""
_MOVING = f"""
def Xform "Turning" {{
    double xformOp:rotateY.timeSamples = {{ 0: 0, 24: 90 }}
    uniform token[] xformOpOrder = ["xformOp:rotateY"]
    def Mesh "Card" {{{SQUARE}}}
}}
class Xform "Tree" {{ def Sphere "Ball" {{ double radius = 0.5
}} }}
def Xform "One" (instanceable = true\n prepend inherits = </Tree>) {{{place(5, 0, 0)}}}
def Xform "Two" (instanceable = true\n prepend inherits = </Tree>) {{{place(-5, 0, 0)}}}
def PointInstancer "Points" {{
    rel prototypes = </Points/A>
    int[] protoIndices = [0, 0]
    point3f[] positions = [(0, 0, 1), (0, 0, 2)]
    def Cone "A" {{}}
}}
"""
_SUBDIVIDED = """
def Mesh "Cube" (prepend apiSchemas = ["MaterialBindingAPI"]) {
    int[] faceVertexCounts = [4, 4, 4, 4, 4, 4]
    int[] faceVertexIndices = [0,1,3,2, 2,3,5,4, 4,5,7,6, 6,7,1,0, 1,7,5,3, 6,0,2,4]
    point3f[] points = [(-1,-1,1),(1,-1,1),(-1,1,1),(1,1,1),(-1,1,-1),(1,1,-1),(-1,-1,-1),(1,-1,-1)]
    int[] creaseIndices = [0, 1, 3]
    int[] creaseLengths = [3]
    float[] creaseSharpnesses = [2]
    int[] cornerIndices = [5]
    float[] cornerSharpnesses = [10]
    color3f[] primvars:displayColor = [(1, 0, 0), (0, 1, 0)] (interpolation = "faceVarying")
    int[] primvars:displayColor:indices = [0,1,0,1,0,1,0,1,0,1,0,1,0,1,0,1,0,1,0,1,0,1,0,1]
    def GeomSubset "Top" { uniform token elementType = "face"
        uniform token familyName = "materialBind"
        int[] indices = [1, 2]
        rel material:binding = </M>
    }
}
"""
_VARIANTS = f"""
def Xform "Room" (
    variants = {{ string shape = "wide"
}}
    prepend variantSets = "shape"
) {{
    variantSet "shape" = {{
        "wide" {{ def Mesh "Card" {{{SQUARE}}}
}}
        "round" {{ def Sphere "Ball" {{}}
}}
    }}
}}
"""
STAGES = {
    "card": usda(CARD),
    "look": usda(_LOOK + card_of("M")),
    "lights": usda(CARD + _LIGHTS),
    "variants": usda(_VARIANTS),
    "arm": usda(ARM.format(more="", inbetween=""), "startTimeCode = 0\n endTimeCode = 10"),
    "moving": usda(_MOVING, "startTimeCode = 0\n endTimeCode = 24"),
    "subdivided": usda(_SUBDIVIDED + material("M", "color3f inputs:diffuseColor = (0, 0, 1)")),
}


def write_images(folder: Path) -> None:
    """The images that the stages name."""
    import numpy as np
    from PIL import Image

    from tests.pictures import write_exr

    texels = np.random.default_rng(2).integers(0, 255, (4, 4, 4), np.uint8)
    Image.fromarray(texels).save(folder / "colour.png")
    Image.fromarray(texels[..., :3]).save(folder / "numbers.png")
    Image.fromarray(np.full((4, 4, 3), (128, 128, 255), np.uint8)).save(folder / "relief.png")
    write_exr(folder / "sky.exr", np.ones((4, 8, 3), np.float32))


def usdas(folder: Path) -> list[bytes]:
    """The stages as text."""
    write_images(folder)
    return [text.encode() for text in STAGES.values()]


def usdcs(folder: Path) -> list[bytes]:
    """The stages as binary."""
    from pxr import Sdf

    found = []
    for text in usdas(folder):
        layer = Sdf.Layer.CreateAnonymous("seed.usda")
        layer.ImportFromString(text.decode())
        layer.Export(str(folder / "seed.usdc"))
        found.append((folder / "seed.usdc").read_bytes())
    return found
