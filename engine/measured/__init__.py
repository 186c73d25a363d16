"""Measured reflection: files, filling of gaps, fitted factors, and the table for look-ups in kernels.

    MERL .binary, Cornell .brdf ─┬─► samples ─► filled table ─┬─► factors (`fit`) ─► Measurement: part of the layer
    RGL .bsdf ─► `adaptive` ─────┘                            └─► `tables`: stays in the process that computes; a copy
                                                                  goes to the GPU for layers that are shown alone

The table holds the measurement itself and not its quotient with the factors. The quotient is computed from both at each
look-up: diffuse min(data / D, 1), with D the product of the diffuse factors, specular (data − D) / (G H) where that is
positive. So the sum of the layers is the interpolated measurement at any pair of directions. Tabulating and
interpolating the quotients was rejected: times curves they would match only at the grid's points, and take twice the
memory.

Direct light has a quotient for each colour. Indirect light has the directions of one quotient for all, weighted by the
reflection of each colour, the colours of the curves, and in each colour the energy of its own quotient
(`engine.precompute.indirect.albedo`): equivalent albedos of two measured materials, in two layers and in one, are
within 0.6 % of integrals of the data, where one quotient for all gave errors up to 20 %.
"""
