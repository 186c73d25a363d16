"""Measured reflection: files, what is missing in them, factors fitted to them, and the table that kernels look up.

    MERL .binary, Cornell .brdf ─► samples ─► filled table ─┬─► factors (`fit`) ─► Measurement: travels with the layer
                                                            └─► `tables`: stays in the process that computes; a copy
                                                                goes to the GPU for layers that are shown alone

The table holds the measurement itself and not its quotient with the factors. The quotient follows from both wherever it
is looked up: diffuse min(data / D, 1), D the product of the diffuse factors, specular (data − D) / (G H) where that is
positive. Interpolated like this the layers' sum is the interpolated measurement at any pair of directions; quotients
tabulated and interpolated were rejected: times curves they would be it at the grid's points alone, and take twice the
memory.

Direct light has a quotient for each colour. Indirect light has one for all, weighted by what each reflects, and the
colours of the curves: equivalent albedos of seven measured materials are then within 7 % of the true ones, but for
channels that reflect little beside the others (0.068 for 0.044 in a yellow plastic's blue).
"""
