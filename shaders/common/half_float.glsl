// Provides: eight 16-bit floats of one RGBA32UI texel, in memory order (little endian: the low half comes first).
// Not unpackHalf2x16, which needs OpenGL 4.2. Exact for every finite half, also where denormal floats are flushed to
// zero: a half without leading one is read as 2^-14 (1 + m) less 2^-14.

const uint HALF_EXPONENT = 0x0f800000u;    // of a half whose mantissa stands where a float's does
const uint EXPONENT_REBASE = 0x38000000u;  // 127 - 15, the difference of the biases
const uint SMALLEST_NORMAL = 0x38800000u;  // 2^-14 as a float

// Halves without their sign, shifted left by 13.
vec4 magnitudes(uvec4 shifted) {
    uvec4 bits = shifted + EXPONENT_REBASE;
    vec4 denormal = uintBitsToFloat(bits + 0x00800000u) - uintBitsToFloat(SMALLEST_NORMAL);
    return mix(uintBitsToFloat(bits), denormal, equal(shifted & HALF_EXPONENT, uvec4(0u)));
}

vec4 with_signs(vec4 magnitude, uvec4 signs) {
    return uintBitsToFloat(floatBitsToUint(magnitude) | signs);
}

vec4 low_halves(uvec4 words) {
    return with_signs(magnitudes((words & 0x7fffu) << 13), (words & 0x8000u) << 16);
}

vec4 high_halves(uvec4 words) {
    return with_signs(magnitudes((words >> 3) & 0x0fffe000u), words & 0x80000000u);
}
