"""Orbit's pictures: shown as the worker draws them, or drawn on a graphics card from the parts that it exports."""
