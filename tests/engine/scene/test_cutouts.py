"""Where rays pass through surfaces: a slow twin, closed forms of coverage, pictures' hits and shadows."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from engine.core.errors import LoadError
from engine.material.opacity import OPAQUE, Opacity, opacity_from, opacity_values
from engine.precompute.direct.pipeline import Placement
from engine.scene.cutouts import pixel_chances, scene_caster
from engine.scene.edges import ray_offsets
from engine.scene.raycaster import RayCaster
from engine.scene.scene_loader import Scene, load_scene
from tests.scene_text import LAMBERT, camera, environment, placed, scaled

HEAD = camera((0, 0, 3), 20, (24, 24)) + environment()


@pytest.fixture
def scene_of(tmp_path: Path) -> Callable[..., Scene]:
    """scene_of(opacity, objects): a card before the camera, with an image of 2 x 2 texels, opaque on the diagonal from
    the upper left, and other objects."""
    pixels = np.zeros((2, 2, 4), np.uint8)
    pixels[[0, 1], [0, 1]] = 255
    Image.fromarray(pixels).save(tmp_path / "leaf.png")
    Image.fromarray(np.uint8([[0, 255]])).save(tmp_path / "grey.png")

    def write(opacity: str, objects: str = "") -> Scene:
        card = placed("card", "quad", more=f"smooth = false\n{LAMBERT}opacity = {{ {opacity} }}\n")
        (tmp_path / "scene.toml").write_text(HEAD + card + objects)
        return load_scene(tmp_path / "scene.toml")

    return write


class Chequered:
    """Half of the triangles (T,) have holes in the form of a chequerboard."""

    blends = False

    def __init__(self, passable: np.ndarray) -> None:
        self.passable = passable

    def opacity_at(self, triangle: np.ndarray, u: np.ndarray, v: np.ndarray) -> np.ndarray:
        return (np.floor(7.0 * u) + np.floor(7.0 * v)) % 2.0


def test_rays_go_on_behind_holes() -> None:
    chance = np.random.default_rng(0)
    n, n_rays = 200, 2000
    corners = chance.uniform(-1.0, 1.0, (n, 1, 3)) + chance.normal(0.0, 0.3, (n, 3, 3))
    holes = Chequered(chance.random(n) < 0.5)
    caster = RayCaster(corners.reshape(-1, 3), np.arange(3 * n).reshape(-1, 3), cutouts=holes)
    origins, directions = chance.uniform(-2.0, 2.0, (n_rays, 3)), chance.normal(size=(n_rays, 3))
    # The twin intersects all triangles with all rays, drops what falls into a hole, and takes the nearest.
    a, e1, e2 = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    p = np.cross(directions[:, None], e2)
    det = np.einsum("ti,rti->rt", e1, p)
    q = np.cross(origins[:, None] - a, e1)
    u = np.einsum("rti,rti->rt", origins[:, None] - a, p) / det
    v = np.einsum("rti,ri->rt", q, directions) / det
    distance = np.einsum("ti,rti->rt", e2, q) / det
    there = ~holes.passable | (holes.opacity_at(np.arange(n), u, v) > 0.5)
    met = (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0) & (distance > 0.0) & there
    distance = np.where(met, distance, np.inf)
    nearest, triangle = distance.min(axis=1), np.where(met.any(axis=1), distance.argmin(axis=1), -1)
    found = caster.intersect(origins, directions)
    assert np.array_equal(found.triangle, triangle)
    np.testing.assert_allclose(found.distance, nearest, rtol=1e-4)
    assert np.array_equal(caster.occluded(origins, directions), triangle >= 0)
    limits = chance.uniform(0.1, 3.0, n_rays).astype(np.float32)
    assert np.array_equal(caster.occluded(origins, directions, limits), nearest < limits)
    # Far away and tiny, where the caster moves and scales: the same answers.
    moved = RayCaster(1e-4 * corners.reshape(-1, 3), np.arange(3 * n).reshape(-1, 3), cutouts=holes)
    assert np.array_equal(moved.intersect(1e-4 * origins, directions).triangle, triangle)


def test_a_texel_under_the_cutoff_is_not_there(scene_of: Callable[..., Scene]) -> None:
    wall = placed("wall", "quad", scaled(4, (0, 0, -1)), LAMBERT)
    hits = Placement(scene_of('mode = "mask", file = "leaf.png", wrap = "clamp"', wall), None, 0).hits
    image = hits.object_image
    # The image's own rows: opaque in the upper left and the lower right, interpolated between texels' centres.
    assert image[8, 8] == 0 and image[15, 15] == 0 and image[8, 15] == 1 and image[15, 8] == 1
    opaque = Placement(scene_of('mode = "opaque", file = "leaf.png"', wall), None, 0).hits.object_image
    assert (opaque[4:-4, 4:-4] == 0).all()
    # Bilinear between 0 and 1: half of the card is there at a cutoff of 1/2, more below it, less above.
    shares = [
        np.mean(Placement(scene_of(f'mode = "mask", file = "leaf.png", wrap = "clamp", cutoff = {cutoff}'), None, 0)
                .hits.object_image[4:-4, 4:-4] == 0)
        for cutoff in (0.1, 0.5, 0.9)
    ]  # fmt: skip
    assert shares[0] > 0.6 > shares[1] > 0.4 > shares[2]


def test_a_grey_image_counts_by_its_brightness_and_a_factor_multiplies_it(scene_of: Callable[..., Scene]) -> None:
    image = Placement(scene_of('mode = "mask", file = "grey.png", wrap = "clamp"'), None, 0).hits.object_image
    assert (image[8:16, 8] == -1).all() and (image[8:16, 15] == 0).all()
    nothing = Placement(scene_of('mode = "mask", file = "grey.png", factor = 0.4'), None, 0)
    assert (nothing.hits.object_image == -1).all()


@pytest.mark.parametrize("n_rays", [4, 8, 16])
@pytest.mark.parametrize("share", [0.1, 0.5, 0.73])
def test_a_blending_card_covers_its_share_of_each_pixel(
    scene_of: Callable[..., Scene], share: float, n_rays: int
) -> None:
    hits = Placement(scene_of(f'mode = "blend", factor = {share}'), None, n_rays).hits
    inside = hits.open_image[5:-5, 5:-5]
    assert np.abs(inside - (1.0 - share)).max() <= 1.0 / n_rays  # one chance in each n-th
    assert inside.mean() == pytest.approx(1.0 - share, abs=0.02)
    covered = np.bincount(hits.pixel, hits.share, 24 * 24).reshape(24, 24)[5:-5, 5:-5]
    np.testing.assert_allclose(covered, 1.0 - inside, atol=1e-6)


def test_two_cards_behind_each_other_pass_the_product(scene_of: Callable[..., Scene]) -> None:
    behind = placed("other", "quad", scaled(2, (0, 0, -1)), f'{LAMBERT}opacity = {{ mode = "blend", factor = 0.5 }}\n')
    hits = Placement(scene_of('mode = "blend", factor = 0.5', behind), None, 16).hits
    inside = hits.open_image[5:-5, 5:-5]
    assert np.abs(inside - 0.25).max() <= 1.0 / 16.0  # 1/2 of 1/2 passes both


def test_shadow_rays_pass_by_the_opacity(scene_of: Callable[..., Scene]) -> None:
    chance = np.random.default_rng(3)
    origins = np.concatenate([chance.uniform(-0.4, 0.4, (20_000, 2)), np.full((20_000, 1), -1.0)], axis=1)
    up = np.tile(np.float32([0, 0, 1]), (20_000, 1))
    for factor in (0.2, 0.7):
        blocked = scene_caster(scene_of(f'mode = "blend", factor = {factor}')).occluded(origins, up)
        assert blocked.mean() == pytest.approx(factor, abs=0.01)  # standard error 0.003
        again = scene_caster(scene_of(f'mode = "blend", factor = {factor}')).occluded(origins, up)
        assert np.array_equal(blocked, again)
    masked = scene_caster(scene_of('mode = "mask", file = "leaf.png", wrap = "clamp"'))
    x, y = origins[:, 0], origins[:, 1]
    firm = (np.abs(x) > 0.3) & (np.abs(y) > 0.3)  # at the texels' own values
    assert np.array_equal(masked.occluded(origins, up)[firm], (x * y < 0.0)[firm])


def test_the_chances_of_a_pixel_are_spread_evenly() -> None:
    for n in (4, 8, 16):
        places = np.array([17.5, 9.5]) + ray_offsets(n)
        assert sorted(np.floor(n * pixel_chances(places, 64)).astype(int)) == list(range(n))
    every = np.stack(np.divmod(np.arange(64 * 64), 64)[::-1], axis=1) + 0.5
    assert np.histogram(pixel_chances(every, 64), 4, (0, 1))[0].min() > 900  # of 1,024 expected in each quarter


def test_opacities_are_read_and_written(scene_of: Callable[..., Scene]) -> None:
    table = {"mode": "mask", "cutoff": 0.25, "file": "a.png", "repeats": [2.0, 3.0], "vertices": True}
    opacity = opacity_from(table)
    assert opacity == Opacity("mask", 0.25, 1.0, "a.png", (2.0, 3.0), opacity_vertices=True)
    assert opacity_values(opacity) == table and opacity_values(OPAQUE) == {}
    assert not Opacity("mask", 0.5, 0.7).lets_pass and Opacity("mask", 0.5, 0.3).lets_pass
    assert not Opacity("blend").lets_pass and Opacity("blend", opacity_map="a.png").lets_pass
    for text, said in (
        ('mode = "glass"', "opaque"), ("cutoff = 2", "from 0 to 1"), ("alpha = 1", "mode, cutoff"),
        ('mode = "mask", file = "../x.png"', "outside the scene folder"),
    ):  # fmt: skip
        with pytest.raises(LoadError, match=said):
            scene_of(text)


def test_scenes_without_holes_have_no_digest(scene_of: Callable[..., Scene]) -> None:
    plain, holed = scene_of('mode = "blend"'), scene_of('mode = "blend", factor = 0.5')
    assert not plain.cutouts.digest and not plain.cutouts.passable.any() and holed.cutouts.digest
    assert holed.with_opacities({"card": OPAQUE}).cutouts.digest == ""
