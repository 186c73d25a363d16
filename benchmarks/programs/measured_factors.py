"""How well products of curves describe measurements: `python -m benchmarks.programs.measured_factors FILE...`.

For each file and product of the highlight, beside g(theta_i) g(theta_o) of the diffuse part: log RMS over samples that
took part in the fit, and over a third that did not. Grids and tensor files are sampled at random pairs of directions,
with the light at random in wi or wo; scattered files as they are.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from engine.core.generators import run_to_end
from engine.measured.adaptive import scattered_directions
from engine.measured.sample_files import CORNELL_SUFFIX, ScatteredSamples, read_cornell, scattered_samples
from engine.measured.scattered_fit import ProductFit
from engine.measured.tables import read_measurement, table_of

HALF, DIFFERENCE, SLOPES = "theta_h", "theta_d", ("theta_u", "theta_v")
PRODUCTS = {
    "H": (HALF,),
    "H(θh) G(θd)": (HALF, DIFFERENCE),
    "H S(θi) S(θo)": (HALF, "s"),
    "H G Q(φd)": (HALF, DIFFERENCE, "phi_d"),
    "H G P(φh)": (HALF, DIFFERENCE, "phi_h"),
    "H G S(θi) S(θo)": (HALF, DIFFERENCE, "s"),
    "H G A(θi) B(θo)": (HALF, DIFFERENCE, "theta_i", "theta_o"),
    "U(θu) V(θv) G": (*SLOPES, DIFFERENCE),
}


def samples_of(path: Path) -> ScatteredSamples:
    """Samples of a file. Raises LoadError."""
    if path.suffix.lower() == CORNELL_SUFFIX:
        return scattered_samples(read_cornell(path), path)
    wi, wo = scattered_directions()
    swapped = np.random.default_rng(2).random(len(wi)) < 0.5
    wi[swapped], wo[swapped] = wo[swapped], wi[swapped]
    return ScatteredSamples(wi, wo, table_of(run_to_end(read_measurement(path)).number).evaluate(wi, wo), 0)


def main(names: list[str]) -> None:
    """Print a table of each file."""
    for name in names:
        samples = samples_of(Path(name))
        left_out = np.arange(len(samples.values)) % 3 == 0
        print(f"{Path(name).name}: {len(samples.values)} samples")
        for title, curves in PRODUCTS.items():
            fits = [ProductFit(samples, channel, curves, ~left_out) for channel in range(3)]
            errors = [np.sqrt(np.mean([fit.error(mask) ** 2 for fit in fits])) for mask in (~left_out, left_out)]
            print(f"  {title:20} {errors[0]:.3f}  left out {errors[1]:.3f}")


if __name__ == "__main__":
    main(sys.argv[1:])
