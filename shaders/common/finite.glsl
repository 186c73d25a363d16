// Provides: whether a radiance is a number. Tested on the bits, since isnan and isinf may be optimised away.

bool is_finite(vec3 radiance) {
    uvec3 exponents = floatBitsToUint(radiance) & 0x7f800000u;
    return all(lessThan(exponents, uvec3(0x7f800000u)));
}
