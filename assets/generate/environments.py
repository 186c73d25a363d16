"""The built-in environments: name -> picture (256, 512, 3), linear Rec. 709."""

from collections.abc import Callable

from . import hall, sky, studio
from .mesh import Floats

ENVIRONMENTS: dict[str, Callable[[], Floats]] = {"studio": studio.picture, "sky": sky.picture, "hall": hall.picture}
