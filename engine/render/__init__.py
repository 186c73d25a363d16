"""Rendering: stills, the path tracer, estimates of light counts, bounces and errors, image maps, and picture files."""
