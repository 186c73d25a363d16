"""Functions on the sphere: a hierarchy of triangles, Haar wavelets, spherical harmonics and their symmetries."""
