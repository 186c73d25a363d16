"""Elements of Mitsuba's XML."""

from __future__ import annotations

from xml.etree.ElementTree import Element, SubElement

import numpy as np
from numpy.typing import ArrayLike


def add(parent: Element, tag: str, **attributes: str) -> Element:
    """A child with these attributes."""
    return SubElement(parent, tag, attributes)


def add_numbers(parent: Element, tag: str, name: str, values: ArrayLike) -> Element:
    """A child that holds numbers: `<rgb name="reflectance" value="0.5 0.5 0.5"/>`."""
    return add(parent, tag, name=name, value=" ".join(f"{v:.9g}" for v in np.ravel(values)))
