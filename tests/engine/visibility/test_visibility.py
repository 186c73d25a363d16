"""What each point sees: brute force against the twin, coherence against brute force, symmetry and bookkeeping."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from engine.light.emitters import emitter_tree
from engine.precompute.direct.lighting import nearest_neighbours, prepare_lighting
from engine.precompute.direct.pipeline import Placement
from engine.scene.builtin import builtin_scenes
from engine.scene.raycaster import RayCaster, surface_points
from engine.scene.scene_loader import load_scene
from engine.sphere.geodesic import geodesic, locate
from engine.visibility import _kernels as kernels
from engine.visibility.coherent_grid import coherent_visibility, grid_steps
from engine.visibility.point_visibility import (
    Targets,
    Visibility,
    brute_force_visibility,
    empty_visibility,
    evaluate_rows,
    sphere_targets,
)
from tests.engine.precompute.direct.by_hand import NOWHERE, caster_of, points_at, square
from tests.naive.visibility import visible
from tests.scene_text import camera, facing_up, placed

SCENE = (
    camera((0.3, 2.2, 3.1), 50, (40, 33), (0, 0.3, 0))
    + placed("ground", "quad", facing_up(8))
    + placed("box", "cube", "0.6,0,0.3,-0.4, 0,0.8,0,0.4, -0.3,0,0.6,0, 0,0,0,1")
    + placed("card", "quad", "0.7,0,0,0.7, 0,0.7,0.1,0.5, 0,-0.1,0.7,0.3, 0,0,0,1")
)


@pytest.fixture
def placement(tmp_path: Path) -> Placement:
    path = tmp_path / "scene.toml"
    path.write_text(SCENE)
    return Placement(load_scene(path))


def all_rows(placement: Placement) -> np.ndarray:
    return np.arange(len(placement.hits.pixel))


def patches_above(n: int) -> Targets:
    lamp = square((0, 2.5, 0), (1, 0, 0), (0, 0, 1))
    return prepare_lighting(None, emitter_tree(lamp, np.ones((2, 3)), n), 1.0).emitter_targets


@pytest.mark.parametrize("targets", [sphere_targets(1), patches_above(40)], ids=["directions", "patches"])
def test_vertices_see_as_pixels_do(tmp_path: Path, targets: Targets) -> None:
    # Of a ball; no camera has a part in it, so that half of them are on the side that none sees.
    (tmp_path / "scene.toml").write_text(SCENE.replace('"cube"', '"sphere"'))
    scene = load_scene(tmp_path / "scene.toml")
    caster = RayCaster(scene.vertices, scene.triangles)
    ball = np.unique(scene.triangles[scene.object_of_triangle == 1])
    rows = np.arange(len(ball))[:: max(1, len(ball) // 8)]
    points = surface_points(caster, scene.vertices[ball], scene.normals[ball])
    found = brute_force_visibility(points, caster, targets, rows).unpacked(rows)
    expected = np.array([visible(scene.vertices, scene.triangles, points, targets, row) for row in rows])
    assert 0.1 < expected.mean() < 0.9
    np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize("targets", [sphere_targets(2), patches_above(40)], ids=["directions", "patches"])
def test_brute_force_is_the_naive_answer(placement: Placement, targets: Targets) -> None:
    rows = all_rows(placement)[::53]
    found = brute_force_visibility(placement.hits, placement.caster, targets, rows).unpacked(rows)
    scene = placement.scene
    expected = np.array([visible(scene.vertices, scene.triangles, placement.hits, targets, row) for row in rows])
    assert 0.2 < expected.mean() < 0.95
    np.testing.assert_array_equal(found, expected)


def test_an_open_plane_sees_its_half_of_the_sphere() -> None:
    # No triangle centre lies on the horizon of +Y: exactly half of 5,120 are above it.
    hits = points_at([[0, 0, 0]], [[0, 1, 0]])
    visibility = brute_force_visibility(hits, caster_of(), sphere_targets(4), np.array([0]))
    np.testing.assert_array_equal(visibility.unpacked(np.array([0]))[0], geodesic(4).centres[:, 1] > 0)
    assert (visibility.rays.traced, visibility.rays.possible) == (2560, 2560)


def test_bits_beyond_the_last_target_stay_clear() -> None:
    # 80 targets fill a word and a quarter.
    hits = points_at([[0, 0, 0]], [[0, 1, 0]])
    visibility = brute_force_visibility(hits, caster_of(), sphere_targets(1), np.array([0]))
    assert visibility.bits.shape == (1, 2)
    assert np.bitwise_count(visibility.bits).sum() == 40 and visibility.bits[0, 1] >> np.uint64(16) == 0


def test_a_turn_by_a_fifth_maps_visibility_onto_itself() -> None:
    # The icosahedron stands on a vertex, so a turn by 72° about Y maps the triangles of every level onto one another.
    random = np.random.default_rng(6)
    blockers = random.normal(size=(30, 1, 3)) + 0.4 * random.normal(size=(30, 3, 3))
    position, normal = 0.3 * random.normal(size=(12, 3)), random.normal(size=(12, 3))
    cosine, sine = np.cos(0.4 * np.pi), np.sin(0.4 * np.pi)
    turn = np.array([[cosine, 0, sine], [0, 1, 0], [-sine, 0, cosine]])
    rows, targets = np.arange(12), sphere_targets(3)
    image = locate(geodesic(3).centres @ turn.T, 3)
    assert len(np.unique(image)) == 1280
    before = brute_force_visibility(points_at(position, normal), caster_of(blockers), targets, rows).unpacked(rows)
    turned = points_at(position @ turn.T, normal @ turn.T)
    after = brute_force_visibility(turned, caster_of(blockers @ turn.T), targets, rows).unpacked(rows)
    # Equal but for rays within rounding of an edge.
    assert (after[:, image] != before).sum() <= 2 and 0.1 < before.mean() < 0.5


# ----------------------------------------------------------------------------------------------------------- coherence


def wrong_answers(scene: str | Path, resolution: tuple[int, int], every: int) -> tuple[float, float]:
    """Share of wrong answers at every so many points, and share of the rays traced."""
    placement = Placement(load_scene(scene, resolution))
    found = empty_visibility(placement.hits, sphere_targets(4))
    fractions = list(coherent_visibility(placement.hits, placement.caster, found))
    assert found.done.all() and fractions == sorted(fractions) and fractions[-1] == pytest.approx(1.0)
    rows = np.arange(0, len(placement.hits.pixel), every)
    true = brute_force_visibility(placement.hits, placement.caster, sphere_targets(4), rows)
    wrong = np.bitwise_count(found.bits[rows] ^ true.bits[rows]).sum()
    return float(wrong / true.rays.possible), found.rays.traced / found.rays.possible


def test_coherence_on_shapes() -> None:
    # At most 2 answers in 10,000 are wrong, for 7 % of the rays; at half the pixels a side of the full picture,
    # where neighbours are less alike.
    wrong, traced = wrong_answers(builtin_scenes()["shapes"], (257, 257), 36)
    assert wrong <= 2e-4 and traced < 0.07


@pytest.mark.sweep
def test_coherence_on_the_bunny(shared_reference: Path) -> None:
    wrong, traced = wrong_answers(shared_reference / "bunny.toml", (128, 128), 4)
    assert wrong <= 2e-4 and traced < 0.12


@pytest.mark.parametrize("n_targets", [5, 64, 100, 320])
def test_the_horizon_of_groups_is_that_of_each_direction(n_targets: int) -> None:
    # Groups of neighbouring triangles are decided at once; scattered directions, and those of a last short group, not.
    random = np.random.default_rng(n_targets)
    scattered = random.normal(size=(n_targets, 3))
    normal = random.normal(size=(200, 3))
    normal = (normal / np.linalg.norm(normal, axis=1, keepdims=True)).astype(np.float32)
    for directions in (geodesic(2).centres[:n_targets], scattered):
        centres = np.ascontiguousarray(directions / np.linalg.norm(directions, axis=1, keepdims=True), np.float32)
        targets = Targets(centres, np.zeros_like(centres), nearest_neighbours(centres))
        found = np.empty((200, targets.n_words), np.uint64)
        kernels.horizon_bits(np.arange(200), normal, normal, centres, targets.normals, False, targets.cones, found)
        expected = np.zeros((200, 64 * targets.n_words), bool)
        expected[:, :n_targets] = normal @ centres.T > 0.0
        unpacked = np.unpackbits(found.view(np.uint8), axis=1, bitorder="little").astype(bool)
        np.testing.assert_array_equal(unpacked, expected)


@pytest.mark.parametrize("alike", [True, False])
@pytest.mark.parametrize("n_informers", [0, 1, 2, 3, 4])
def test_a_guess_counts_the_votes(n_informers: int, alike: bool) -> None:
    # Target by target, counted with ones and zeros; without neighbours there is no boundary to mark. Of informers that
    # see different things nothing is believed.
    random = np.random.default_rng(n_informers)
    bits, horizon, believed, always, weak, weakest = random.integers(0, 1 << 63, (6, 5, 2), dtype=np.uint64)
    if alike:
        bits = bits[:1] ^ (bits & np.roll(bits, 1, axis=0) & np.roll(bits, 2, axis=0))
    always, weak, weakest, believed = always[:1], weak[:1], weakest[:1], believed[0]
    informers = np.full((1, 4), -1, np.int32)
    informers[0, :n_informers] = random.permutation(4)[:n_informers]
    before, todo, doubt = bits.copy(), np.zeros((1, 2), np.uint64), np.zeros((1, 2), np.uint64)
    row, alone = np.array([4]), np.full((128, 3), -1, np.int32)
    kernels.predict(row, informers, bits, horizon[:1], believed, always, weak, weakest, alone, todo, doubt)

    def unpacked(words: np.ndarray) -> np.ndarray:
        return np.unpackbits(np.ascontiguousarray(words).view(np.uint8), bitorder="little").astype(bool)

    above, votes = unpacked(horizon[0]), np.zeros(128, int)
    for informer in informers[0, :n_informers]:
        votes += unpacked(before[informer])
    if n_informers < 2:
        guess, asked, unsure = above & False, above, above & False
    else:
        guess, unsure = votes > n_informers / 2, votes == n_informers / 2
        sentinels = unpacked({2: weakest, 3: weak, 4: always}[n_informers])
        trusted = (votes == 3) & unpacked(believed) if n_informers == 4 else above & False
        asked = (votes > 0) & (votes < n_informers) & ~trusted | sentinels
        agree = (guess & above).sum() >= kernels.SHARED * ((votes > 0) & above).sum()
        assert agree or not alike
        if not agree:
            guess, unsure, asked = above & False, above & False, above
    for found, expected in ((bits[4], guess), (todo[0], asked), (doubt[0], unsure)):
        np.testing.assert_array_equal(unpacked(found), expected & above)
    np.testing.assert_array_equal(bits[:4], before[:4])


def test_every_pixel_has_its_turn_once(placement: Placement) -> None:
    # Square and diamond steps from every 16th pixel to each; informers stand on the same object, not on others.
    rows = np.concatenate([step.rows for step in grid_steps(placement.hits)])
    np.testing.assert_array_equal(np.sort(rows), all_rows(placement))
    objects = placement.hits.object_image.ravel()[placement.hits.pixel]
    known = np.zeros(len(rows), bool)
    for step in grid_steps(placement.hits):
        there = step.informers >= 0
        assert known[step.informers[there]].all()
        assert (objects[step.informers] == objects[step.rows][:, None])[there].all()
        known[step.rows] = True


def test_a_lattice_is_a_part_of_the_picture_and_is_kept(placement: Placement) -> None:
    found = empty_visibility(placement.hits, sphere_targets(3))
    list(coherent_visibility(placement.hits, placement.caster, found, until=4))
    width, _ = placement.hits.resolution
    on_lattice = (placement.hits.pixel % width % 4 == 0) & (placement.hits.pixel // width % 4 == 0)
    np.testing.assert_array_equal(found.done, on_lattice)
    kept, traced = found.bits[found.done].copy(), found.rays.traced
    list(coherent_visibility(placement.hits, placement.caster, found))
    assert found.done.all() and found.rays.traced > traced
    np.testing.assert_array_equal(found.bits[on_lattice], kept)
    # Whole again: nothing more is asked.
    traced = found.rays.traced
    list(coherent_visibility(placement.hits, placement.caster, found))
    evaluate_rows(placement.hits, placement.caster, found, all_rows(placement))
    assert found.rays.traced == traced


def test_interrupted_and_resumed_is_the_same(placement: Placement) -> None:
    whole, parts = (empty_visibility(placement.hits, sphere_targets(3)) for _ in range(2))
    list(coherent_visibility(placement.hits, placement.caster, whole))
    for _ in range(4):
        next(steps := coherent_visibility(placement.hits, placement.caster, parts), None)
        steps.close()
    list(coherent_visibility(placement.hits, placement.caster, parts))
    np.testing.assert_array_equal(parts.bits, whole.bits)


def test_no_targets_are_seen_at_once(placement: Placement) -> None:
    nothing = prepare_lighting(None, None, 1.0).emitter_targets
    found = empty_visibility(placement.hits, nothing)
    assert list(coherent_visibility(placement.hits, placement.caster, found)) == []
    assert found.done.all() and found.rays.traced == 0


def test_the_sphere_says_where_neighbours_agree_on_what_is_wrong(placement: Placement) -> None:
    # A cluster of 40 fine directions: the points around a thin shadow agree on all of it. With the point's own coarser
    # bits beside them fewer answers are wrong, and no more than 1 in 1,000.
    fine = geodesic(6)
    chosen = np.argsort(-fine.centres @ [0.5, 0.8, 0.33], kind="stable")[:40]
    centres = np.ascontiguousarray(fine.centres[chosen], np.float32)
    neighbours = nearest_neighbours(centres)
    targets = Targets(centres, np.zeros_like(centres), neighbours, parents=(chosen // 16).astype(np.int32))
    rows = all_rows(placement)
    sphere = brute_force_visibility(placement.hits, placement.caster, sphere_targets(4), rows)
    true = brute_force_visibility(placement.hits, placement.caster, targets, rows)

    def wrong(consulted: Visibility | None) -> float:
        found = empty_visibility(placement.hits, targets)
        list(coherent_visibility(placement.hits, placement.caster, found, sphere=consulted))
        assert found.rays.traced < 0.4 * found.rays.possible
        return float(np.bitwise_count(found.bits ^ true.bits).sum() / true.rays.possible)

    assert wrong(sphere) <= min(wrong(None), 1e-3)


def test_sentinels_find_what_the_points_around_miss() -> None:
    # Every sixteenth patch is always asked, whatever the neighbours agree on, and by other points others; of the
    # sphere, where the neighbours are few, the middle one of every sixteen or 64.
    def marked(targets: Targets, step: int, turn: int = 0) -> np.ndarray:
        return np.flatnonzero(np.unpackbits(targets.sentinels(step)[turn].view(np.uint8), bitorder="little"))

    patches, sphere = patches_above(40), sphere_targets(2)
    np.testing.assert_array_equal(marked(patches, patches.sentinel_step), [15, 31])
    turns = [marked(patches, patches.sentinel_step, turn) for turn in range(16)]
    np.testing.assert_array_equal(np.sort(np.concatenate(turns)), np.arange(40))
    assert len(sphere.sentinels(sphere.weak_step)) == 1
    np.testing.assert_array_equal(marked(sphere, sphere.weak_step), np.arange(63, 320, 64))
    np.testing.assert_array_equal(marked(sphere, sphere.weakest_step), np.arange(15, 320, 16))
    assert not len(marked(sphere, sphere.sentinel_step))


def test_a_caster_for_each_thread_is_not_needed() -> None:
    # Two blocks at once use one caster; the answers are those of one thread.
    hits = points_at(np.random.default_rng(2).random((3000, 3)), [[0, 1, 0]])
    blockers = square((0.5, 1.5, 0.5), (1, 0, 0), (0, 0, 1))
    rows = np.arange(3000)
    answers: list[np.ndarray] = []
    make: list[Callable[[], RayCaster]] = [
        lambda: caster_of(blockers),
        lambda: RayCaster(blockers.reshape(-1, 3), np.arange(6).reshape(2, 3), threads=1),
    ]
    for caster in make:
        answers.append(brute_force_visibility(hits, caster(), sphere_targets(2), rows).bits)
    np.testing.assert_array_equal(*answers)
    assert (answers[0] != brute_force_visibility(hits, caster_of(NOWHERE), sphere_targets(2), rows).bits).any()
