"""Pictures that tests put in files."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from engine.render.display import exr_bytes


def write_exr(path: Path, radiance: NDArray[np.float32]) -> None:
    """Linear radiance (H, W, 3) as an OpenEXR file."""
    path.write_bytes(exr_bytes(radiance))


def write_flawed_exr(path: Path, radiance: NDArray[np.float32]) -> None:
    """The same of values that need not be finite."""
    import OpenEXR

    OpenEXR.File({"compression": OpenEXR.ZIP_COMPRESSION}, {"RGB": radiance}).write(str(path))
