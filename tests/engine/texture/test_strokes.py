"""Brush strokes on weight maps: what they cover, what stays unchanged, and their form in files."""

import math
import pickle
from pathlib import Path

import numpy as np
import pytest

from engine.material.layer_maps import Images, LayerMaps
from engine.material.map_tables import map_values, maps_from
from engine.material.parameters import ParameterError
from engine.material.strokes import MAX_DABS, Stroke, Strokes, pack_dabs
from engine.precompute.direct.pipeline import Placement
from engine.scene.description import parse_description
from engine.scene.map_sampler import MapSampler
from engine.scene.scene_loader import build_scene
from engine.texture.stroke_painting import MOST_BACK, PaintedPoints

CAMERA = {"position": [0, 0, 3], "target": [0, 0, 0], "fov_y": 25, "resolution": [32, 32]}
UP = np.array([0.0, 0.0, 1.0])
# Random points of a plane, and of its other side, which a sheet of paper has.
PLANE = np.c_[np.random.default_rng(3).uniform(-1.0, 1.0, (2000, 2)), np.zeros(2000)].astype(np.float32)


def stroke(*places: tuple[float, float, float], normal: np.ndarray = UP, **brush: float) -> Stroke:
    return Stroke(**{"radius": 0.3} | brush, dabs=pack_dabs(places, np.tile(normal, (len(places), 1))))  # type: ignore[arg-type]


def painted(*strokes: Stroke, base: float = 0.0, normal: np.ndarray = UP) -> np.ndarray:
    weights = np.full(len(PLANE), base, np.float32)
    normals = np.tile(normal.astype(np.float32), (len(PLANE), 1))
    return PaintedPoints(weights, PLANE, normals).weights(Strokes(strokes))


def distance(x: float, y: float) -> np.ndarray:
    return np.hypot(PLANE[:, 0] - x, PLANE[:, 1] - y)


def test_a_dab_is_full_inside_fades_and_ends_at_its_radius() -> None:
    found, far = painted(stroke((0.2, 0.1, 0.0), hardness=0.5, strength=0.8)), distance(0.2, 0.1)
    t = np.clip((0.3 - far) / 0.15, 0.0, 1.0)
    np.testing.assert_allclose(found, 0.8 * t * t * (3.0 - 2.0 * t), atol=1e-5)
    assert (found[far < 0.15] == np.float32(0.8)).all() and (found[far > 0.3] == 0.0).all()


def test_a_stroke_does_not_build_up_but_strokes_do() -> None:
    half = stroke((0.0, 0.0, 0.0), (0.01, 0.0, 0.0), (0.0, 0.0, 0.0), strength=0.5, hardness=1.0)
    inside = distance(0.0, 0.0) < 0.2
    assert (painted(half)[inside] == 0.5).all() and (painted(half, half)[inside] == 0.75).all()
    erased = painted(half, stroke((0.0, 0.0, 0.0), value=0.0, hardness=1.0))
    assert (erased[inside] == 0.0).all() and erased.min() >= 0.0 and painted(half, half, base=1.0).max() <= 1.0


def test_edges_are_painted_around_and_other_sides_are_not() -> None:
    dab = stroke((0.0, 0.0, 0.0), hardness=1.0)
    inside = distance(0.0, 0.0) < 0.2
    assert (painted(dab, normal=np.array([1.0, 0.0, 0.0]))[inside] == 1.0).all()
    assert (painted(dab, normal=-UP) == 0.0).all()


def test_what_goes_on_is_as_what_was_painted_at_once() -> None:
    rng = np.random.default_rng(5)
    done = Strokes()
    points = PaintedPoints(np.full(len(PLANE), 0.3, np.float32), PLANE, np.tile(np.float32(UP), (len(PLANE), 1)))
    for _ in range(3):
        ways = rng.uniform(-1.0, 1.0, (6, 3)) * [1, 1, 0]
        done = done.with_stroke(stroke(tuple(ways[0]), value=float(rng.uniform()), strength=0.7))
        points.weights(done)
        for way in ways[1:]:
            done = done.with_dabs(stroke(tuple(way)))
            newest = points.weights(done)
    np.testing.assert_array_equal(newest, painted(*done.strokes, base=0.3))
    before = Strokes(done.strokes[:1])
    other = before.with_stroke(stroke((0.0, 0.5, 0.0)))
    np.testing.assert_array_equal(points.weights(before), painted(*before.strokes, base=0.3))  # undone
    np.testing.assert_array_equal(points.weights(other), painted(*other.strokes, base=0.3))  # and painted on
    many = Strokes(tuple(stroke((0.1 * i - 1.0, 0.0, 0.0), strength=0.4) for i in range(MOST_BACK + 4)))
    for n in (len(many.strokes), 2, MOST_BACK, 0, 1):  # further back than is kept, and less far
        part = Strokes(many.strokes[:n])
        np.testing.assert_array_equal(points.weights(part), painted(*part.strokes, base=0.3))
    assert done.extends(before) and not before.extends(done)
    twice = Strokes(2 * done.strokes[-1:])
    points.weights(Strokes(twice.strokes[:1]))
    np.testing.assert_array_equal(points.weights(twice), painted(*twice.strokes, base=0.3))


def placement_of(primitive: str, **more: object) -> Placement:
    described = {"name": "thing", "primitive": primitive, "layer": [{"model": "lambert"}], **more}
    tree = {"version": 1, "camera": CAMERA, "object": [described]}
    return Placement(build_scene(parse_description(tree, "scene.toml"), Path("scene.toml")))


def test_pixels_within_the_radius_and_the_mean_by_area() -> None:
    placement = placement_of("quad")  # one metre square, at z = 0
    images = Images(weight_start=0.0, strokes=Strokes((stroke((0.1, 0.0, 0.0), hardness=1.0),)))
    seen = MapSampler(placement.scene, placement.caster, placement.hits).sample(0, images)
    far = np.linalg.norm(placement.hits.position - [0.1, 0.0, 0.0], axis=1)
    assert (seen.weight[far < 0.28] == 1.0).all() and (seen.weight[far > 0.3] == 0.0).all()
    assert seen.weight.min() >= 0.0 and seen.weight.max() <= 1.0 and (seen.texture == 1.0).all()
    # The disc of 0.3 m with its edge, a twentieth of the radius wide, of a square metre.
    assert seen.means.weight == pytest.approx(math.pi * 0.3**2 * 0.95, rel=0.02)
    assert seen.means.both[1] == pytest.approx(seen.means.weight)


def test_the_sides_of_a_cube_share_coordinates_and_no_strokes() -> None:
    placement = placement_of("cube")  # each side has the whole image
    images = Images(weight_start=0.0, strokes=Strokes((stroke((0.0, 0.0, 0.5), hardness=1.0),)))
    sampler = MapSampler(placement.scene, placement.caster, placement.hits)
    assert sampler.sample(0, images).means.weight == pytest.approx(math.pi * 0.3**2 * 0.95 / 6.0, rel=0.03)
    around = Images(weight_start=0.0, strokes=Strokes((stroke((0.5, 0.0, 0.5), hardness=1.0),)))
    # At an edge: half a disc on either side of it.
    assert sampler.sample(0, around).means.weight == pytest.approx(math.pi * 0.3**2 * 0.95 / 6.0, rel=0.03)


def test_fronts_are_where_the_winding_faces() -> None:
    upright = placement_of("quad").hits
    turned = placement_of("quad", transform=[-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1]).hits
    assert upright.front.all() and not turned.front.any()
    np.testing.assert_allclose(turned.outward, np.tile([0.0, 0.0, -1.0], (len(turned.pixel), 1)), atol=1e-6)


def test_files_and_processes_bring_strokes_back_equal() -> None:
    strokes = Strokes((stroke((1 / 3, 0.1, 2e-7), radius=1 / 7), stroke((0.0, 0.0, 0.0), value=0.25)))
    maps = LayerMaps(weight_start=0.0, strokes=strokes)
    assert maps_from(map_values(maps)) == maps and not maps.is_plain and maps.images.strokes == strokes
    assert pickle.loads(pickle.dumps(strokes)) == strokes and pickle.loads(pickle.dumps(Strokes())) == Strokes()
    assert Images(strokes=strokes) != Images() and LayerMaps(weight_invert=True, strokes=strokes).inverts


@pytest.mark.parametrize(
    "bad",
    [
        3, ["a"], [{"radius": 1.0}], [{"radius": 0.0, "dabs": "AAAA"}], [{"radius": 1.0, "dabs": "!"}],
        [{"radius": 1.0, "dabs": "AAAA"}], [{"radius": 1.0, "dabs": "", "colour": 1}],
        map_values(LayerMaps(strokes=Strokes((stroke((0, 0, 0), strength=2.0),))))["strokes"],
        [{"radius": float("nan"), "dabs": "A" * 32}],
        map_values(LayerMaps(strokes=Strokes((stroke((float("nan"), 0, 0)),))))["strokes"],
        map_values(LayerMaps(strokes=Strokes((stroke(*[(0, 0, 0)] * (MAX_DABS + 1)),))))["strokes"],
    ],
    ids=range(11),
)  # fmt: skip
def test_hostile_strokes_are_refused(bad: object) -> None:
    with pytest.raises(ParameterError):
        maps_from({"strokes": bad})


FAR = (500_000.0, 4_600_000.0, 120.0)


def seen_on_a_quad(at: tuple[float, ...], images: Images) -> np.ndarray:
    """The weights where the eye sees a quad of 2 m about a place."""
    x, y, z = at
    camera = CAMERA | {"position": [x, y, z + 3.0], "target": list(at)}
    quad = {"name": "quad", "primitive": "quad", "transform": [1, 0, 0, x, 0, 1, 0, y, 0, 0, 1, z, 0, 0, 0, 1]}
    described = parse_description({"version": 1, "camera": camera, "object": [quad]}, Path("scene.toml"))
    placement = Placement(build_scene(described, Path("scene.toml"), None))
    assert placement.scene.origin.any() == any(at)
    return MapSampler(placement.scene, placement.caster, placement.hits).sample(0, images).weight


def test_strokes_stay_where_they_are_in_the_world_in_far_scenes() -> None:
    """There the scene's arrays are about its own centre, and neighbouring numbers of the world 0.5 m apart."""
    near = stroke((0.12, 0.1, 0.0), (0.2, 0.1, 0.0), hardness=1.0, radius=0.2)
    expected = seen_on_a_quad((0.0, 0.0, 0.0), Images(weight_start=0.0, strokes=Strokes((near,))))
    assert 0.0 < expected.mean() < 0.5
    for x, y, z in (FAR, (499_997.0, 4_599_997.0, 117.0)):
        offset = np.subtract(FAR, (x, y, z))
        far = Stroke(0.2, hardness=1.0, dabs=pack_dabs([[0.12, 0.1, 0.0] + offset], [UP]), origin=(x, y, z))
        more = Stroke(0.2, dabs=pack_dabs([[0.2, 0.1, 0.0]], [UP]), origin=FAR)
        strokes = Strokes((far,)).with_dabs(more)
        found = seen_on_a_quad(FAR, Images(weight_start=0.0, strokes=strokes))
        np.testing.assert_allclose(found, expected, atol=5e-3)  # an edge of a centimetre, places to 0.03 mm
        again = maps_from({"strokes": map_values(LayerMaps(strokes=strokes))["strokes"]}).strokes
        assert again == strokes == pickle.loads(pickle.dumps(strokes))


def test_strokes_of_old_files_are_about_the_worlds_origin() -> None:
    (values,) = map_values(LayerMaps(strokes=Strokes((stroke((0.2, 0.1, 0.0)),))))["strokes"]
    assert "origin" not in values  # as all files had it
    (found,) = maps_from({"strokes": [values]}).strokes.strokes
    assert found.origin == (0.0, 0.0, 0.0)
    for wrong in ([0.0, 0.0], "far", [0.0, 0.0, 1e13], [0.0, 0.0, float("nan")]):
        with pytest.raises(ParameterError, match="origin"):
            maps_from({"strokes": [values | {"origin": wrong}]})
