"""A scene that is measured in a second: a cube and a ground under an even sky, 32 × 24 pixels."""

import pytest

from tests.scene_text import camera, environment, facing_up, material, placed, scaled

SCENE = (
    camera((0.0, 1.6, 2.4), 40.0, (32, 24), (0.0, 0.2, 0.0), 'name = "tiny"\nbounces = 1\n')
    + environment((1.0, 0.9, 0.8))
    + placed("cube", "cube", scaled(0.6, (0, 0.31, 0)), material('model = "rough_conductor", alpha = 0.3'))
    + "smooth = false\n"
    + placed("ground", "quad", facing_up(4), material('model = "lambert", albedo = [0.5, 0.4, 0.3]'))
)


@pytest.fixture(scope="package")
def tiny_scene(tmp_path_factory: pytest.TempPathFactory) -> str:
    file = tmp_path_factory.mktemp("tiny") / "scene.toml"
    file.write_text(SCENE)
    return str(file)
