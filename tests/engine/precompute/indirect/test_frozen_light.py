"""Sums over frozen light in each frame of a drag, against the formula as it stands, in double precision."""

import numpy as np
import pytest

from engine.precompute.indirect.frozen_light import (
    FrozenCurve,
    FrozenGloss,
    FrozenLight,
    LightEdit,
    Modes,
    SelectedCurve,
)

N_BANDS, N_MODES, N_POWERS, N_POINTS = 12, 3, 4, 5
KNOTS = np.array([0, 2, 5, 11])
EDITED, OTHER = 0, 1


def frozen_light(rng: np.random.Generator) -> FrozenLight:
    """An edited layer that sees itself, and another one that it lights."""

    def planes(*shape: int) -> np.ndarray:
        return rng.uniform(0.0, 1.0, (3, *shape, N_POINTS)).astype(np.float32)

    modes = Modes(rng.normal(size=(N_BANDS, N_MODES)).astype(np.float32), rng.normal(size=(N_MODES, N_BANDS)))
    gloss = FrozenGloss(
        SelectedCurve(EDITED, 0), rng.uniform(0.5, 1.0, 3), rng.uniform(0.0, 1.0, (N_BANDS, 3)), KNOTS,
        rng.uniform(0.0, 1.0, (N_BANDS, 3)), modes, rng.uniform(0.2, 0.8, 3),
        {i: planes(len(KNOTS)) for i in (EDITED, OTHER)}, {i: planes(N_MODES, N_MODES) for i in (EDITED, OTHER)},
        {i: planes(N_POWERS - 1, N_MODES) for i in (EDITED, OTHER)}, {EDITED: planes(N_MODES, N_MODES)},
    )  # fmt: skip
    curve = FrozenCurve(rng.uniform(0.0, 1.0, (N_BANDS, 3)), modes)
    return FrozenLight({OTHER: planes(N_POWERS)}, {EDITED: planes(N_BANDS, N_POWERS)}, {EDITED: curve}, (gloss,))


def plain_radiance(light: FrozenLight, layer: int, edit: LightEdit) -> tuple[np.ndarray, np.ndarray]:
    """The radiance (p, 3) of a layer, and the sum of the sizes of all terms."""
    (gloss,), d = light.gloss, edit.albedo
    delta = gloss.tint * (edit.sent[EDITED] - gloss.frozen)
    amounts = gloss.modes.weights @ delta
    found = np.zeros((2, N_POINTS, 3))

    def add(weight: float, plane: np.ndarray, channel: int) -> None:
        term = weight * plane.astype(np.float64)
        found[0, :, channel] += term
        found[1, :, channel] += abs(term)

    for c in range(3):
        for n in range(N_POWERS):
            if layer == EDITED:
                for j in range(N_BANDS):
                    add(d[c] ** n * edit.curves[EDITED][j, c], light.bands[EDITED][c, j, n], c)
            else:
                add(d[c] ** n, light.reflected[OTHER][c, n], c)
        for i, j in enumerate(KNOTS):
            add(delta[j, c], gloss.by_layer[layer][c, i], c)
        for k in range(N_MODES):
            for r in range(N_MODES):
                add(amounts[r, c] * amounts[k, c], gloss.pairs[layer][c, r, k], c)
                if layer == EDITED:
                    own = light.curves[EDITED]
                    epsilon = own.modes.weights @ (edit.curves[EDITED] - own.values)
                    add(epsilon[r, c] * amounts[k, c], gloss.products[EDITED][c, r, k], c)
            for n in range(1, N_POWERS):
                add((d[c] ** n - gloss.albedo[c] ** n) * amounts[k, c], gloss.by_power[layer][c, n - 1, k], c)
    return found[0], found[1]


@pytest.mark.parametrize("n_edits", [1_000, pytest.param(100_000, marks=pytest.mark.sweep)])
def test_random_edits_in_any_order_are_the_plain_sums(n_edits: int) -> None:
    """As the window draws them: a layer whose state seems to be the one on screen is not drawn again."""
    rng = np.random.default_rng(7)
    light = frozen_light(rng)
    first = edit = LightEdit(np.full(3, 0.5), {EDITED: light.curves[EDITED].values}, {EDITED: light.gloss[0].frozen})
    began = {layer: light.radiance(layer, first) for layer in (EDITED, OTHER)}
    shown: dict[int, tuple[bytes, np.ndarray]] = {}
    for i in range(n_edits):
        curve, sent, albedo = edit.curves[EDITED].copy(), edit.sent[EDITED].copy(), edit.albedo.copy()
        size = 10.0 ** rng.uniform(-3.0, 3.0)
        match rng.integers(4):
            case 0:
                curve[rng.integers(N_BANDS)] = size * rng.uniform(0.0, 1.0, 3)
            case 1:
                sent[rng.integers(N_BANDS)] = size * rng.uniform(0.0, 1.0, 3)
            case 2:
                albedo = rng.uniform(0.0, 1.0, 3)
            case _:
                curve, sent, albedo = first.curves[EDITED], first.sent[EDITED], first.albedo  # undo
        edit = LightEdit(albedo, {EDITED: curve}, {EDITED: sent})
        for layer in (EDITED, OTHER):
            state = light.dependence(layer, edit)
            if layer not in shown or shown[layer][0] != state:
                shown[layer] = state, light.radiance(layer, edit)
        if i % 100 == 99:
            for layer in (EDITED, OTHER):
                expected, size_of_terms = plain_radiance(light, layer, edit)
                assert (np.abs(shown[layer][1] - expected) <= 1e-5 * size_of_terms).all()
    for layer in (EDITED, OTHER):
        np.testing.assert_array_equal(light.radiance(layer, first), began[layer])
