"""Views of OpenColorIO configurations: their values by closed forms, their defaults, and what is said of bad ones."""

from pathlib import Path

import numpy as np
import pytest

from engine.core.colour import ConfigView, display_transform, encode_srgb
from engine.core.colour_config import config_name, config_transform, read_view, resolve_view
from engine.core.errors import LoadError
from engine.render.display import display_values
from tests.colour_configs import write_config

LIGHT = np.random.default_rng(3).uniform(0.0, 1.0, (50, 3))


@pytest.mark.parametrize("interchange", [False, True])
def test_views_follow_their_formulas(tmp_path: Path, interchange: bool) -> None:
    """Light is linear Rec. 709, whatever the reference of the configuration."""
    config = str(write_config(tmp_path, interchange))
    shown = config_transform(LIGHT, ConfigView(config, "Monitor", "Plain"))
    np.testing.assert_allclose(shown, encode_srgb(LIGHT), atol=2e-4)
    shown = config_transform(LIGHT, ConfigView(config, "Projector", "Plain"))
    np.testing.assert_allclose(shown, LIGHT ** (1 / 2.2), atol=2e-4)
    x = 0.25 * LIGHT
    np.testing.assert_allclose(
        config_transform(LIGHT, ConfigView(config, "Monitor", "Film")), x * x * (3 - 2 * x), atol=2e-4
    )
    warm = config_transform(LIGHT, ConfigView(config, "Monitor", "Plain", "Warm"))
    np.testing.assert_allclose(warm, encode_srgb(np.clip(LIGHT * (2.0, 1.0, 0.5), 0.0, 1.0)), atol=2e-4)


def test_exposure_is_before_the_view_and_all_light_has_a_colour(tmp_path: Path) -> None:
    view = ConfigView(str(write_config(tmp_path)), "Monitor", "Plain")
    np.testing.assert_allclose(display_values(0.25 * LIGHT, 2.0, view), encode_srgb(LIGHT), atol=2e-4)
    odd = np.array([[np.nan, np.inf, -np.inf], [-1.0, 0.0, 1e30]])
    shown = config_transform(odd, view)
    np.testing.assert_allclose(shown, [[0, 1, 0], [0, 0, 1]], atol=1e-6)


def test_the_librarys_own_configuration_is_as_our_view_of_it() -> None:
    light = np.exp2(np.random.default_rng(5).uniform(-8.0, 5.0, (400, 3)))
    shown = config_transform(light, ConfigView("ocio://cg-config-v4.0.0_aces-v2.0_ocio-v2.5"))
    np.testing.assert_allclose(shown, display_transform(light, "aces_2"), atol=1e-3)


def test_what_is_left_open_is_the_default(tmp_path: Path) -> None:
    config = str(write_config(tmp_path))
    assert resolve_view(ConfigView(config)) == ConfigView(config, "Monitor", "Plain")
    assert resolve_view(ConfigView(config, view="Cube")) == ConfigView(config, "Projector", "Cube")
    assert resolve_view(ConfigView(config, view="Projector: Plain")) == ConfigView(config, "Projector", "Plain")
    assert resolve_view(ConfigView(config, "Projector")) == ConfigView(config, "Projector", "Plain")
    assert config_name("ocio://default") == "ocio://default" and Path(config_name("small.ocio")).is_absolute()


def test_what_was_assumed_is_said(tmp_path: Path) -> None:
    catalogue, shader = read_view(ConfigView(str(write_config(tmp_path)), view="Cube"))
    assert catalogue.displays == (("Monitor", ("Plain", "Film")), ("Projector", ("Plain", "Cube")))
    assert catalogue.looks == ("Warm",) and "scene_linear is taken as linear Rec. 709" in catalogue.note
    assert [each.values.shape for each in shader.textures] == [(9, 9, 9, 3)]
    (tmp_path / "other").mkdir()
    assert read_view(ConfigView(str(write_config(tmp_path / "other", True))))[0].note == ""


@pytest.mark.parametrize(
    ("display", "view", "look", "says"),
    [
        ("Wall", "", "", "display = Wall, expected one of Monitor, Projector"),
        ("Monitor", "Cube", "", "view = Cube, expected one of Plain, Film"),
        ("", "Sepia", "", "view = Sepia, expected one of Plain, Film, Cube"),
        ("", "", "Cold", "look = Cold, expected one of Warm"),
    ],
)
def test_what_is_not_there_is_said(tmp_path: Path, display: str, view: str, look: str, says: str) -> None:
    with pytest.raises(LoadError) as raised:
        resolve_view(ConfigView(str(write_config(tmp_path)), display, view, look))
    assert says in str(raised.value) and "\n" not in str(raised.value)


def test_bad_configurations_are_refused_in_a_line(tmp_path: Path) -> None:
    file = write_config(tmp_path)
    text = file.read_text()
    (tmp_path / "luts" / "curve.spi1d").unlink()
    cases = {
        "no.ocio": None, "text.ocio": "hello", "empty.ocio": "",
        "version.ocio": text.replace("version: 2", "version: 9"),
        "dark.ocio": text.partition("displays:")[0], "cut.ocio": text[:700], "bytes.ocio": "\x00\xff" * 40,
        "pack.ocioz": "PK nothing", "roles.ocio": text.replace(", scene_linear: lin", ""),
    }  # fmt: skip
    for name, content in cases.items():
        if content is not None:
            (tmp_path / name).write_text(content)
        with pytest.raises(LoadError) as raised:
            read_view(ConfigView(str(tmp_path / name)))
        assert name in str(raised.value) and "\n" not in str(raised.value), name
    with pytest.raises(LoadError, match="curve.spi1d"):
        read_view(ConfigView(str(file), "Monitor", "Film"))
    with pytest.raises(LoadError):
        read_view(ConfigView("ocio://none-of-these"))
    with pytest.raises(LoadError):
        read_view(ConfigView(str(tmp_path)))
