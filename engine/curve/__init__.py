"""One-dimensional curves: edited by operators, fitted by bands, transformed to wavelets.

    curve --operators--> edited curve --bands--> band values (J, 3) --wavelet--> coefficients (J, 3)

Uses numpy only: the window's process imports it before the window opens.
"""
