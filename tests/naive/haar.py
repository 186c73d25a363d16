"""The integral of a product of three Haar wavelets of the sphere, by its closed form."""

from engine.sphere.haar import _SIGNS, N_ROOTS


def tripling_coefficient(i: int, j: int, k: int) -> float:
    """The integral of the product of basis functions i, j, k, each by its number [Ma06, the theorem of 3.1].

    Not 0 in three cases: the same mean three times, 1; the three wavelets of one triangle, its measure; one wavelet
    twice and a coarser function, which is ±1 all over it: the measure with that sign. A mean over the triangle that
    holds a wavelet counts as coarser.
    """
    coarse, fine, finest = sorted((i, j, k))
    if finest < N_ROOTS:
        return float(coarse == finest)
    level, triangle, child = place_of(finest)
    if fine < N_ROOTS or place_of(fine)[:2] != (level, triangle):
        return 0.0
    if fine == finest:
        return _sign_over(coarse, level, triangle) * 4.0**-level
    same = coarse >= N_ROOTS and place_of(coarse)[:2] == (level, triangle)
    return 4.0**-level if same and place_of(coarse)[2] != place_of(fine)[2] else 0.0


def place_of(number: int) -> tuple[int, int, int]:
    """(level, triangle, i) of the wavelet with a number ≥ 20."""
    level, n = 0, N_ROOTS
    while number >= 4 * n:
        level, n = level + 1, 4 * n
    return level, (number - n) // 3, (number - n) % 3


def _sign_over(number: int, level: int, triangle: int) -> float:
    """The constant value of basis function `number` on a triangle of `level`, if it is constant there; else 0."""
    if number < N_ROOTS:
        return float(triangle >> (2 * level) == number)
    own_level, own, i = place_of(number)
    if own_level >= level or triangle >> (2 * (level - own_level)) != own:
        return 0.0
    child = (triangle >> (2 * (level - own_level - 1))) & 3
    return float(_SIGNS[1 + i, child])
