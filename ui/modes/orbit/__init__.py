"""Orbit in the window: its picture source, its renderer on a graphics card, and its part of the Accuracy panel."""
