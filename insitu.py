"""Insitu: materials and light edited in their final placement.

This module is the package `insitu` of an installed wheel. Nothing is imported with it, as the program starts here.
"""

from __future__ import annotations


def main() -> int:
    """Run the program `insitu`; its exit status."""
    from app.__main__ import main

    return main()
