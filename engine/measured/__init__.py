"""Measured reflection: files, what is missing in them, factors fitted to them, and the table that kernels look up.

    MERL .binary, Cornell .brdf ─► samples ─► filled table ─┬─► factors (`fit`) ─► Measurement: travels with the layer
                                                            └─► `tables`: stays in the process that computes

The table holds the measurement itself and not its quotient with the factors. The quotient follows from both wherever it
is looked up: diffuse min(data / D, 1), D the product of the diffuse factors, specular (data − D) / (G H) where that is
positive. Interpolated like this the layers' sum is the interpolated measurement at any pair of directions; quotients
tabulated and interpolated, which was tried on paper, times curves would be so at the grid's points alone, and twice
the memory.
"""
