"""A scene that is measured in a second: a cube and a ground under an even sky, 32 × 24 pixels."""

import pytest

SCENE = """
version = 1
name = "tiny"
bounces = 1
[camera]
position = [0.0, 1.6, 2.4]
target = [0.0, 0.2, 0.0]
fov_y = 40.0
resolution = [32, 24]
[environment]
radiance = [1.0, 0.9, 0.8]
[[object]]
name = "cube"
primitive = "cube"
smooth = false
transform = [0.6, 0, 0, 0,  0, 0.6, 0, 0.31,  0, 0, 0.6, 0,  0, 0, 0, 1]
layer = [ { model = "rough_conductor", alpha = 0.3 } ]
[[object]]
name = "ground"
primitive = "quad"
transform = [4, 0, 0, 0,  0, 0, 4, 0,  0, -4, 0, 0,  0, 0, 0, 1]
layer = [ { model = "lambert", albedo = [0.5, 0.4, 0.3] } ]
"""


@pytest.fixture(scope="package")
def tiny_scene(tmp_path_factory: pytest.TempPathFactory) -> str:
    file = tmp_path_factory.mktemp("tiny") / "scene.toml"
    file.write_text(SCENE)
    return str(file)
