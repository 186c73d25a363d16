"""Views: AgX by its published figures, ACES as the library has it, and what no view may do to a colour."""

from pathlib import Path

import numpy as np
import pytest
from scipy.ndimage import map_coordinates

from app.files.materials import load_material
from engine.core.colour import (
    TABLE_SIDE,
    TABLE_STOPS,
    TABULATED_VIEWS,
    TONE_MAPPINGS,
    VIEWS,
    ToneMapping,
    agx_sigmoid,
    display_transform,
    find_view,
    view_table,
)
from engine.core.errors import LoadError
from engine.render.display import display_picture, display_values

ROOT = Path(__file__).resolve().parents[3]
GOLD, COPPER, BRASS = np.array([1.0, 0.782, 0.344]), np.array([0.955, 0.638, 0.538]), np.array([0.91, 0.78, 0.42])
EXPOSURES = np.geomspace(0.02, 4.0, 12)


def hue(encoded: np.ndarray) -> np.ndarray:
    """CIE L*a*b* hue of sRGB values (N, 3), degrees: about 40 copper, 90 gold, from 100 on olive."""
    linear = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
    to_xyz = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
    f = np.cbrt(linear @ to_xyz.T / [0.9505, 1.0, 1.089])
    return np.degrees(np.arctan2(200 * (f[:, 1] - f[:, 2]), 500 * (f[:, 0] - f[:, 1])))


@pytest.mark.parametrize("metal", [GOLD, COPPER, BRASS], ids=["gold", "copper", "brass"])
def test_no_metal_turns_olive_in_the_default_view(metal: np.ndarray) -> None:
    # Channel by channel, gold went from a hue of 91° to 103° as light grew, and copper from 47° to 59°.
    shown = display_values(EXPOSURES[:, None] * metal)
    own = hue(display_values(0.5 * metal[None], 0.0, "linear"))
    assert np.abs(hue(shown) - own).max() < 4.0


def test_the_librarys_gold_has_the_colour_of_gold() -> None:
    # Its spectrum in linear Rec. 709 is (1.02, 0.78, 0.34), as published by N. Hoffman; of integrated eta and k it was
    # (0.97, 0.80, 0.32), which is olive where it is dark.
    layer = load_material(ROOT / "assets" / "materials" / "gold.toml").layers[0]
    eta, k = (np.array(dict(layer.parameters)[name]) for name in ("eta", "k"))
    reflectance = ((eta - 1) ** 2 + k**2) / ((eta + 1) ** 2 + k**2)
    assert reflectance == pytest.approx([1.0, 0.78, 0.34], abs=0.015)


def test_the_darkest_and_the_brightest_channel_go_by_the_curve_and_the_other_between() -> None:
    x = np.array([[4.0, 1.0, 0.2]])
    f = lambda v: v * (2.51 * v + 0.03) / (v * (2.43 * v + 0.59) + 0.14)  # noqa: E731
    decoded = ((display_values(x)[0] + 0.055) / 1.055) ** 2.4
    np.testing.assert_allclose(decoded[[0, 2]], [f(4.0), f(0.2)], rtol=1e-9)
    assert (decoded[1] - decoded[2]) / (decoded[0] - decoded[2]) == pytest.approx(0.8 / 3.8)


def test_agx_is_near_the_polynomial_that_others_use() -> None:
    # B. Wrensch's fit of sixth degree to the same curve: 0.0027 off on average.
    x = np.linspace(0.0, 1.0, 1001)
    fit = np.polyval([15.5, -40.14, 31.96, -6.868, 0.4298, 0.1191, -0.00232], x)
    assert np.mean((agx_sigmoid(x) - fit) ** 2) < 1e-5
    assert agx_sigmoid(np.array([0.0, 10 / 16.5, 1.0])) == pytest.approx([0.0, 0.5, 1.0], abs=1e-12)


def test_middle_grey_and_white() -> None:
    greys = np.array([[0.0] * 3, [0.18] * 3, [1e36] * 3], np.float32)
    assert display_transform(greys, "agx")[:, 0] == pytest.approx([0.0, 0.5, 1.0], abs=2e-3)
    # 10 nits of 100 where 0.18 is lit: (0.1)^(1/2.2) is 0.35.
    assert display_transform(greys, "aces_2")[:, 1] == pytest.approx([0.0, 0.35, 1.0], abs=5e-3)


@pytest.mark.parametrize("view", TONE_MAPPINGS)
def test_whatever_the_light_the_colour_is_one(view: ToneMapping) -> None:
    light = np.array([[np.finfo(np.float32).max, 0.0, -1.0], [-1e30, 1e-45, 0.0], [1e20, 1e20, 1e-20]])
    shown = display_values(light[None], 3.0, view)
    assert np.isfinite(shown).all() and shown.min() >= 0.0 and shown.max() <= 1.0
    assert display_picture(light[None], 0.0, view).dtype == np.uint8
    greys = display_values(np.repeat(np.geomspace(1e-3, 1e3, 60)[:, None], 3, axis=1), 0.0, view)
    if view != "false_colour":
        assert (np.diff(greys, axis=0) >= -1e-6).all() and np.ptp(greys, axis=1).max() < 3e-3


@pytest.mark.parametrize(("view", "mostly", "most"), [("agx", 0.5, 1.5), ("aces_2", 1.6, 6.0), ("aces_1", 1.6, 10.0)])
def test_tables_are_what_they_are_of(view: ToneMapping, mostly: float, most: float) -> None:
    rng = np.random.default_rng(0)
    light = np.exp2(rng.uniform(-9.0, 6.0, (50_000, 1)) + rng.uniform(-5.0, 0.0, (50_000, 3)))
    low, high = TABLE_STOPS
    place = (np.log2(light) - low) / (high - low) * (TABLE_SIDE - 1)
    table = view_table(view).astype(float)
    found = [map_coordinates(table[..., k], place.T[::-1], order=1, mode="nearest") for k in range(3)]
    off = 255 * np.abs(np.stack(found, axis=1) - display_transform(light, view))
    assert np.quantile(off, 0.999) < mostly and off.max() < most


def test_views_are_named_as_people_say_them() -> None:
    assert [find_view(known.label.upper()) for known in VIEWS.values()] == list(TONE_MAPPINGS)
    assert find_view("aces_2") == "aces_2" and find_view(" standard ") == "linear" and set(TABULATED_VIEWS) < set(VIEWS)
    with pytest.raises(LoadError, match="view: name = sepia, expected Filmic, AgX, ACES 2.0"):
        find_view("sepia")
