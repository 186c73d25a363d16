// Provides: where sample i of a compact buffer lies. Samples go in groups of 8; a texture row holds 128 groups, first
// the first samples of all of them, then the second ones, and so on (the same numbers stand in ui/modes/placement/gl/transport.py).

const int GROUPS_PER_ROW = 128;
const int SAMPLES_PER_ROW = 1024;

// The texel of a linear address (row * SAMPLES_PER_ROW + column).
ivec2 texel_of_address(int address) {
    return ivec2(address & (SAMPLES_PER_ROW - 1), address >> 10);
}
