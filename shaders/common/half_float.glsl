// Provides: eight 16-bit floats of one RGBA32UI texel, in memory order (little endian: the low half comes first).
// Not unpackHalf2x16, which needs OpenGL 4.2. The exponent is rebased by a multiplication with 2^112, so that zero
// stays zero; halves below 2^-14 become 0 where the implementation flushes denormals.

const float HALF_EXPONENT_REBASE = 5.192296858534828e33;

vec4 low_halves(uvec4 words) {
    return uintBitsToFloat(((words & 0x7fffu) << 13) | ((words & 0x8000u) << 16)) * HALF_EXPONENT_REBASE;
}

vec4 high_halves(uvec4 words) {
    return uintBitsToFloat(((words >> 3) & 0x0fffe000u) | (words & 0x80000000u)) * HALF_EXPONENT_REBASE;
}
