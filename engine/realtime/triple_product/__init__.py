"""Orbit: light, visibility and BRDF slices at points of the scene, multiplied for any camera [Ma06]."""
