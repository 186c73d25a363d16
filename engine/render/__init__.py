"""Rendering: stills, pilots for light counts, bounces and costs, error estimates, and picture files."""
