"""Scene files: what is read, and how each kind of error is reported."""

import tomllib

import pytest

from engine.core.errors import LoadError
from engine.scene.description import SceneDescription, load_description, parse_description

BASE = """
version = 1
[camera]
position = [0, 0, 3]
target = [0, 0, 0]
fov_y = 40
resolution = [32, 24]
[environment]
radiance = [1, 2, 3]
[[object]]
name = "ball"
primitive = "sphere"
emission = [0, 0, 0]
layer = [{ model = "lambert", name = "base", albedo = [0.5, 0.5, 0.5] }, { model = "phong", exponent = 20 }]
[[object]]
name = "card"
mesh = "card.ply"
smooth = false
"""


def spoilt(path: str, value: object) -> dict:
    """The tree of BASE with the value at a dotted path replaced, or removed for None."""
    tree = tomllib.loads(BASE)
    *way, last = (int(key) if key.isdigit() else key for key in path.split("."))
    node = tree
    for key in way:
        node = node[key]
    if value is None:
        del node[last]
    else:
        node[last] = value
    return tree


def test_reads_what_stands_there_and_fills_in_the_rest():
    scene = parse_description(tomllib.loads(BASE), "scene.toml")
    ball, card = scene.objects
    assert ball.layers[1].parameters == {"exponent": 20.0}  # all keys but model and name
    assert ball.layers[0].name == "base"
    assert not ball.emits and ball.editable and ball.smooth  # a black emission shines no light
    assert not card.smooth and card.layers == () and card.transform[0] == 1.0
    assert scene.camera.up == (0.0, 1.0, 0.0)
    assert scene.environment.radiance == (1.0, 2.0, 3.0)


def test_a_single_number_is_a_grey():
    scene = parse_description(spoilt("environment.radiance", 2), "f")
    assert scene.environment.radiance == (2.0, 2.0, 2.0)


def test_descriptions_are_values():
    one = parse_description(tomllib.loads(BASE), "f")
    assert one == parse_description(tomllib.loads(BASE), "g")
    with pytest.raises(ValueError, match="frozen"):
        one.camera.fov_y = 3.0  # type: ignore[misc]


@pytest.mark.parametrize("name", ["teatray", "bunny", "cornell"])
def test_reference_scenes_survive_json(shared_reference, name):
    scene = load_description(shared_reference / f"{name}.toml")
    assert SceneDescription.model_validate_json(scene.model_dump_json(by_alias=True)) == scene  # JSON and back


@pytest.mark.parametrize(
    ("path", "value", "line"),
    [
        ("version", 2, "version = 2 (made by a newer version), expected version 1"),
        ("version", None, "version = nothing, expected 1"),
        ("version", True, "version = True, expected 1"),
        ("version", "1", "version = 1, expected 1"),
        ("camera", None, "camera = nothing, expected a value"),
        ("camera", 3, "camera = 3, expected a"),
        ("camera.fov_y", "wide", "camera: fov_y = wide, expected a finite number"),
        ("camera.fov_y", "30", "camera: fov_y = 30, expected a finite number"),
        ("camera.fov_y", float("nan"), "camera: fov_y = nan, expected a finite number"),
        ("camera.fov_y", 0, "camera: fov_y = 0, expected greater than or equal to 0.01"),
        ("camera.fov_y", 180, "camera: fov_y = 180, expected less than or equal to 179"),
        ("camera.position", [0, 0], "camera: position 2 = nothing, expected a value"),
        ("camera.position", [0, 0, 1e30], "camera: position 2 = 1e+30, expected less than or equal to 1000000000"),
        ("camera.target", [0, 0, 3], "camera: target = [0, 0, 3], expected a point other than the position"),
        ("camera.up", [0, 0, 1], "camera: up = [0, 0, 1], expected a direction that is not parallel to the view"),
        ("camera.up", [True, 0, 0], "camera: up 0 = True, expected a finite number"),
        ("camera.resolution", [0, 1], "camera: resolution 0 = 0, expected greater than or equal to 1"),
        ("camera.resolution", [1.5, 1], "camera: resolution 0 = 1.5, expected"),
        ("camera.resolution", [10**9, 1], "camera: resolution 0 = 1000000000, expected less than"),
        ("camera.lens", 3, "camera: lens = 3, expected one of position, target, up, fov_y, resolution"),
        ("sky", 1, "sky = 1, expected one of version, name, bounces, camera, environment, object"),
        ("environment.file", "a.exr", "environment: file = a.exr, expected exactly one of file and radiance"),
        ("environment.radiance", None, "environment: file = nothing, expected exactly one of file and radiance"),
        ("environment.radiance", [1, -1, 1], "environment: radiance 1 = -1, expected greater than or equal to 0"),
        ("environment.radiance", [1, 1, float("inf")], "environment: radiance 2 = inf, expected a finite number"),
        ("environment.mapping", "dome", "environment: mapping = dome, expected 'latlong', 'angular', 'ball' or 'cube'"),
        (
            "environment.sun",
            [{"direction": [0, 0, 0], "irradiance": 1}],
            "environment: sun 0: direction = [0, 0, 0], expected one other",
        ),
        ("environment.sun", [{"direction": [0, 1, 0]}], "sun 0: irradiance = nothing, expected a value"),
        ("environment.scale", -1, "environment: scale = -1, expected greater than or equal to 0"),
        ("environment.rotation", 10**400, "environment: rotation = 1000"),
        ("object", 3, "object = 3, expected a list"),
        ("object.1.name", "ball", "object 'ball' = nothing, expected names that differ"),
        ("object.0.name", "a.b", "object 0 'a.b': name = a.b, expected a name of 1 to 64 characters without"),
        ("object.0.name", "", "object 0 '': name = , expected a name"),
        ("object.0.name", 3, "object 0: name = 3, expected a name"),
        (
            "object.0.primitive",
            "teapot",
            "object 0 'ball': primitive = teapot, expected 'quad', 'cube', 'sphere', 'disc', ",
        ),
        ("object.0.mesh", "a.ply", "object 0 'ball': mesh = a.ply, expected exactly one of mesh and primitive"),
        ("object.0.transform", [1] * 15, "object 0 'ball': transform = [1, 1"),
        ("object.0.transform", [0] * 15 + [1], "object 0 'ball': transform = [0, 0"),
        ("object.0.smooth", 1, "object 0 'ball': smooth = 1, expected true or false"),
        ("object.0.emission", [0, "x", 0], "object 0 'ball': emission 1 = x, expected a finite number"),
        ("object.0.colour", 1, "object 0 'ball': colour = 1, expected one of name, mesh, primitive, part, transform"),
        ("object.0.layer", 3, "object 0 'ball': layer = 3, expected a list"),
        ("object.0.layer.0.model", None, "object 0 'ball': layer 0 'base': model = nothing, expected a value"),
        ("object.0.layer.0.model", 3, "object 0 'ball': layer 0 'base': model = 3, expected a string"),
        ("object.0.layer.1.name", "base", "object 0 'ball': layer = [{"),
        ("object.0.layer.0.albedo", [1, float("nan"), 1], "layer 0 'base': albedo = [1, nan, 1], expected a finite"),
        ("object.0.layer.0.albedo", {"r": 1}, "layer 0 'base': albedo = {'r': 1}, expected a finite number"),
    ],
)
def test_each_mistake_is_one_line_with_file_key_value_and_expectation(path, value, line):
    with pytest.raises(LoadError) as caught:
        parse_description(spoilt(path, value), "dir/scene.toml")
    text = str(caught.value)
    assert text.startswith("dir/scene.toml: ") and text.endswith("; nothing was changed") and "\n" not in text
    assert line in text


@pytest.mark.parametrize(
    ("entries", "expected"),
    [
        ([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1], "an invertible matrix"),  # flat along z
        ([1, 2, 3, 0, 2, 4, 6, 0, 0, 0, 1, 0, 0, 0, 0, 1], "an invertible matrix"),  # two columns in one plane
        ([1e30, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1], "finite numbers of at most 1e+09"),
        ([1, 0, 0, 1e30, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1], "finite numbers of at most 1e+09"),
        ([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 1, 1], "a last row 0 0 0 1"),  # a projection
    ],
)
def test_transforms_that_lose_the_object_are_refused(entries, expected):
    with pytest.raises(LoadError, match=f"object 0 'ball': transform .*expected {expected.replace('+', '.')}"):
        parse_description(spoilt("object.0.transform", entries), "f")


@pytest.mark.parametrize("scale", [1e-6, 1e-3, 1.0, -1.0, 1e6])
def test_small_large_and_mirroring_scales_are_transforms(scale):
    entries = [scale, 0, 0, 0, 0, scale, 0, 0, 0, 0, scale, 0, 0, 0, 0, 1]
    scene = parse_description(spoilt("object.0.transform", entries), "f")
    assert scene.objects[0].transform[0] == scale  # invertibility does not depend on the size


@pytest.mark.parametrize(
    ("data", "what"),
    [
        (b"version = ", "TOML = "),
        (b"version = 1\nversion = 1", "TOML = "),
        (b"\xff\xfe", "byte 0 = 0xff, expected UTF-8 text"),
        (b"a = " + b"[" * 100_000, "line 1: brackets = [["),
        (b"version = " + b"1" * 10_000, "line 1: word = 111"),
        (b"version = 1\n[camera]\nfov_y = 1e999", "camera: "),
    ],
)
def test_what_is_no_toml_is_named(tmp_path, data, what):
    path = tmp_path / "scene.toml"
    path.write_bytes(data)
    with pytest.raises(LoadError) as caught:
        load_description(path)
    assert what in str(caught.value)
