"""Insitu: materials and light edited in their final placement.

    import insitu

    scene = insitu.open("teatray")
    scene["teapot"]["copper"]["gamma_alpha"].amplify(y=1.5)
    picture = scene.image()

`open` returns a `Scene`; what fails raises `Error`, in one line. docs/guides/python.md shows a first session.
This module is the package `insitu` of an installed wheel. Nothing is imported with it, as the program starts here: the
interface is imported when one of its names is used.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from app.interface import Curve as Curve
    from app.interface import Error as Error
    from app.interface import Operator as Operator
    from app.interface import Scene as Scene
    from app.interface import open as open

__all__ = ["Curve", "Error", "Operator", "Scene", "main", "open"]


def main() -> int:
    """Run the program `insitu`; its exit status."""
    from app.__main__ import main

    return main()


def __getattr__(name: str) -> object:
    if name not in __all__:
        raise AttributeError(f"module 'insitu' has no attribute {name!r}")
    from app.system.kernel_cache import use_kernel_cache

    use_kernel_cache()  # before the engine is imported
    from app import interface

    return getattr(interface, name)


def __dir__() -> list[str]:
    return sorted(__all__)
