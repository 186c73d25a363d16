"""Plots as PNG files, drawn without a display."""

from __future__ import annotations

import io
from pathlib import Path

import matplotlib

matplotlib.use("Agg")

from matplotlib import pyplot as plt
from matplotlib.figure import Figure

from app.system.atomic import save_file

DPI = 150
INK, FRONT = "#333333", "#c0392b"


def save_figure(file: Path, figure: Figure) -> None:
    """As PNG, whole or not at all; the figure is closed."""
    buffer = io.BytesIO()
    figure.savefig(buffer, dpi=DPI)
    plt.close(figure)
    save_file(file, buffer.getvalue())
