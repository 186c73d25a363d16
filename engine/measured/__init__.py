"""Measured reflection: files, what is missing in them, factors fitted to them, and the table that kernels look up.

    MERL .binary, Cornell .brdf ─► samples ─► filled table ─┬─► factors (`fit`) ─► Measurement: travels with the layer
                                                            └─► `tables`: stays in the process that computes; a copy
                                                                goes to the GPU for layers that are shown alone

The table holds the measurement itself and not its quotient with the factors. The quotient follows from both wherever it
is looked up: diffuse min(data / D, 1), D the product of the diffuse factors, specular (data − D) / (G H) where that is
positive. Interpolated like this the layers' sum is the interpolated measurement at any pair of directions; quotients
tabulated and interpolated were rejected: times curves they would be it at the grid's points alone, and take twice the
memory.

Direct light has a quotient for each colour. Indirect light has the directions of one for all, weighted by what each
reflects, the colours of the curves, and in each colour the energy of its own quotient
(`engine.precompute.indirect.albedo`): equivalent albedos of two measured materials, of two layers and of one, are
within 0.6 % of integrals of the data, where the quotient for all was up to 20 % off.
"""
