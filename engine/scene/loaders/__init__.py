"""Readers of mesh files: OBJ, PLY, glTF and GLB."""
