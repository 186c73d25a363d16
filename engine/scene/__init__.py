"""Scenes: their description and loading, meshes, ray casting, cameras and primary hits."""
