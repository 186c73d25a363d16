"""RGL's tensor files: the container, and reflection in the adaptive parameterization."""

import struct
from pathlib import Path

import numpy as np
import pytest

from engine.core.errors import LoadError
from engine.core.generators import run_to_end
from engine.measured.measurement import evaluate_table
from engine.measured.sample_files import rgb_weights
from engine.measured.tables import read_measurement, table_of
from engine.measured.tensor_files import MAGIC, adaptive_reflection, read_tensor_file, tensor_fields
from tests.naive.tensor_files import Gloss, acquired, tensor_bytes

HERE = Path(__file__).parent
WAVELENGTHS = np.array([360.0, 420.0, 470.0, 510.0, 560.0, 600.0, 650.0, 720.0])
SPECTRAL = Gloss(0.3, 0.3, tuple(np.linspace(0.05, 0.4, 8)), tuple(np.linspace(0.9, 0.5, 8)))
BRUSHED = Gloss(0.5, 0.2)
CASES = {
    "isotropic": acquired(Gloss(), n_theta=5, n=12, n_facets=16),
    "half_turn": acquired(BRUSHED, n_theta=4, n_phi=5, n=10, n_facets=16, turn=np.pi),
    "quarter_turn": acquired(BRUSHED, n_theta=4, n_phi=4, n=10, n_facets=16, turn=np.pi / 2),
    "whole_turn": acquired(BRUSHED, n_theta=4, n_phi=9, n=10, n_facets=16),
    "spectral": acquired(SPECTRAL, n_theta=4, n=10, n_facets=16, wavelengths=WAVELENGTHS),
}


@pytest.mark.parametrize("case", CASES)
def test_values_are_those_of_mitsuba(case: str) -> None:
    # Mitsuba computes in single precision. Spectra of Mitsuba become colours here, as the reader's do.
    lines = (HERE / "mitsuba_measured.csv").read_text().splitlines()
    rows = np.array([line.split(",")[1:] for line in lines if line.startswith(f"{case},")], float)
    reflection = adaptive_reflection(tensor_bytes(CASES[case]), Path(case))
    expected = rows[:, 6:] @ rgb_weights(WAVELENGTHS) if case == "spectral" else rows[:, 6:]
    assert len(rows) == 12
    np.testing.assert_allclose(reflection.tabulated(rows[:, :3], rows[:, 3:6]), expected, rtol=1e-4, atol=1e-6)


def hemisphere(count: int, seed: int, least: float = 0.2) -> np.ndarray:
    v = np.random.default_rng(seed).normal(size=(4 * count, 3))
    v = v / np.linalg.norm(v, axis=1, keepdims=True)
    return v[v[:, 2] > least][:count]


@pytest.mark.parametrize(
    ("gloss", "azimuths"), [(Gloss(), {}), (BRUSHED, {"n_phi": 13, "turn": np.pi}), (BRUSHED, {"n_phi": 17})]
)
def test_an_acquisition_gives_back_its_formula(gloss: Gloss, azimuths: dict[str, float]) -> None:
    # Interpolation between 12 angles, 15 or 22 degrees of azimuth and 32 x 32 samples: a few percent, and the median
    # below two.
    fields = acquired(gloss, n_theta=12, n=32, n_facets=64, **azimuths)  # type: ignore[arg-type]
    reflection = adaptive_reflection(tensor_bytes(fields), Path("x.bsdf"))
    wi, wo = hemisphere(300, 1), hemisphere(300, 2)
    found, expected = reflection.evaluate(wi, wo), gloss.reflection(wi, wo)
    assert np.sqrt(np.mean((found - expected) ** 2)) < 0.06 * expected.mean()
    assert np.median(np.abs(found / expected - 1.0)) < 0.02
    np.testing.assert_array_equal(found, reflection.evaluate(wo, wi))


def test_uniform_directions_map_to_the_square_by_area() -> None:
    # What visible normals map to is uniform: half of a density's integral lies in half of the square, whatever it is.
    reflection = adaptive_reflection(tensor_bytes(CASES["half_turn"]), Path("x.bsdf"))
    fine = (np.arange(400) + 0.5) / 400
    u, v = (each.ravel() for each in np.meshgrid(fine, fine))
    number = np.full(u.size, 6)
    x, y = reflection.visible.to_square([(number, np.ones(u.size))], u, v)
    flat = reflection.visible.density.reshape(-1, 16, 16)[6]
    i, j = (np.minimum((each * 15).astype(int), 14) for each in (v, u))
    s, t = v * 15 - i, u * 15 - j
    density = (1 - s) * ((1 - t) * flat[i, j] + t * flat[i, j + 1])
    density += s * ((1 - t) * flat[i + 1, j] + t * flat[i + 1, j + 1])
    counts = np.histogram2d(y, x, 4, [(0, 1), (0, 1)], weights=density / density.sum())[0]
    np.testing.assert_allclose(counts, 1 / 16, atol=1e-3)


def test_an_isotropic_file_becomes_a_table(tmp_path: Path) -> None:
    path = tmp_path / "gloss.bsdf"
    path.write_bytes(tensor_bytes(CASES["isotropic"]))
    measurement = run_to_end(read_measurement(path))
    assert measurement.report is not None and measurement.report.error < 0.3
    wi, wo = hemisphere(400, 3), hemisphere(400, 4)
    found = evaluate_table(table_of(measurement.number).samples, wi, wo)
    expected = adaptive_reflection(path.read_bytes(), path).evaluate(wi, wo)
    # Half a degree of interpolation where the coarse acquisition has its bends.
    np.testing.assert_allclose(found, expected, rtol=0.03)


SOUND = CASES["isotropic"]
FIELD = struct.Struct("<HBQ")


def header(name: bytes, *numbers: int) -> bytes:
    """A file of one field: name, type, offset and sizes, and no array."""
    kind, offset, *sizes = numbers
    said = struct.pack("<H", len(name)) + name + FIELD.pack(len(sizes), kind, offset)
    return MAGIC + struct.pack("<I", 1) + said + struct.pack(f"<{len(sizes)}Q", *sizes)


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b"tensor_file\0\2\0", "first bytes = .* expected those of a tensor file, version 1.0"),
        (MAGIC, "size = 14 bytes, expected a whole header"),
        (MAGIC + struct.pack("<I", 10**9), "number of fields = 1000000000, expected at most 64"),
        (header(b"ndf", 10, 0, 2**40, 2**40), "field ndf = 1099511627776 x 1099511627776 of 4 bytes at 0, expected an"),
        (header(b"ndf", 10, 2**63, 2), "field ndf = 2 of 4 bytes at 9223372036854775808, expected an array within"),
        (header(b"ndf", 10, 0, 0), "field ndf = 0 of 4 bytes at 0"),
        (header(b"ndf", 99, 0, 2), "field ndf = 1 dimensions of type 99"),
        (tensor_bytes({"a": np.ones(1, np.uint8)}), "fields = a, expected a measured BRDF, with theta_i"),
        (tensor_bytes({**SOUND, "sigma": SOUND["sigma"][0]}), "field sigma = 16 of float32, expected N x N"),
        (tensor_bytes({**SOUND, "ndf": -SOUND["ndf"]}), "field ndf = -.* expected numbers from 0 to"),
        (tensor_bytes({**SOUND, "vndf": 0 * SOUND["vndf"]}), "vndf at phi_i 0, theta_i 0 = all 0"),
        (tensor_bytes({**SOUND, "theta_i": SOUND["theta_i"][::-1]}), "field theta_i = values that do not ascend"),
        (
            tensor_bytes({**CASES["half_turn"], "phi_i": np.arange(5, dtype="f4") / 10}),
            "phi_i = 0 to 0.4, expected a q",
        ),
        (tensor_bytes({**SOUND, "rgb": SOUND["rgb"] + np.float32(np.inf)}), "reflection at phi_i 0, theta_i 0"),
        (tensor_bytes({**CASES["spectral"], "wavelengths": WAVELENGTHS.astype("f4") + 300}), "wavelengths = 660 to"),
    ],
)
def test_other_files_are_refused(data: bytes, said: str) -> None:
    with pytest.raises(LoadError, match=f"^x.bsdf: {said}"):
        adaptive_reflection(data, Path("x.bsdf"))


def test_a_file_is_read_to_the_last_byte(tmp_path: Path) -> None:
    path = tmp_path / "x.bsdf"
    path.write_bytes(tensor_bytes(SOUND))
    found = tensor_fields(read_tensor_file(path), path)
    assert list(found) == list(SOUND)
    for name, field in SOUND.items():
        np.testing.assert_array_equal(found[name], field)
    with pytest.raises(LoadError, match=r"expected an array within the file's"):
        tensor_fields(path.read_bytes()[:-1], path)
