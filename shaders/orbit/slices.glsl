// Provides: the slices of a term's layers, interpolation between four of them, and what they reflect of a point's row,
// as `engine.realtime.triple_product._slice_kernels`.
#include "orbit/rows.glsl"

layout(std430, binding = 8) readonly buffer Coefficients { uvec2 coefficients[]; };
layout(std430, binding = 9) readonly buffer Values { uvec2 values[]; };
layout(std430, binding = 10) readonly buffer Images { int images[]; };  // of coefficients, by symmetry
layout(std430, binding = 11) readonly buffer Places { int places[]; };  // of triangles
uniform ivec2 grid;      // polar angles and columns
uniform ivec2 n_entries; // of a slice: coefficients and triangles
uniform ivec2 n_images;  // of a symmetry
uniform int n_symmetries;
uniform float steepest;

const float WHOLE_TURN = 6.28318530717959, FIFTH = WHOLE_TURN / 5.0;

struct Cell {
    int symmetry;
    int slice;  // the first of four
    vec4 shares;
};

// bfloat16, three in two words.
vec3 unpacked(uvec2 words) {
    return uintBitsToFloat(uvec3(words.x << 16, words.x & 0xFFFF0000u, words.y << 16));
}

Cell cell_at(vec3 direction) {
    float polar = min(acos(clamp(direction.y, 0.0, 1.0)), steepest) / steepest * float(grid.x - 1);
    float azimuth = dot(direction.xz, direction.xz) > 0.0 ? atan(direction.x, direction.z) : 0.0;
    azimuth += azimuth < 0.0 ? WHOLE_TURN : 0.0;
    float whole = 0.5 * WHOLE_TURN;
    int symmetry = 0;
    if (n_symmetries > 2) {
        int turn = int(azimuth / FIFTH);
        azimuth -= float(turn) * FIFTH;
        whole = 0.5 * FIFTH;
        symmetry = turn % 5;
        if (azimuth > whole) {
            azimuth = FIFTH - azimuth;
            symmetry = 5 + (turn + 1) % 5;
        }
    } else if (azimuth > whole) {
        azimuth = WHOLE_TURN - azimuth;
        symmetry = 1;
    }
    float place = azimuth / whole * float(grid.y - 1);
    int row = min(int(polar), grid.x - 2), column = clamp(int(place), 0, grid.y - 2);
    float down = polar - float(row), across = place - float(column);
    vec2 upper = vec2(1.0 - across, across);
    return Cell(symmetry, row * grid.y + column, vec4((1.0 - down) * upper, down * upper));
}

#define BETWEEN(entries, n, cell, at)                                                         \
    (cell.shares.x * unpacked(entries[(cell.slice) * n + at]) +                               \
     cell.shares.y * unpacked(entries[(cell.slice + 1) * n + at]) +                           \
     cell.shares.z * unpacked(entries[(cell.slice + grid.y) * n + at]) +                      \
     cell.shares.w * unpacked(entries[(cell.slice + grid.y + 1) * n + at]))

vec3 coefficient_between(Cell cell, int number) {
    int at = images[cell.symmetry * n_images.x + number];
    return BETWEEN(coefficients, n_entries.x, cell, at);
}

vec3 value_between(Cell cell, int triangle) {
    int at = places[cell.symmetry * n_images.y + triangle];
    return BETWEEN(values, n_entries.y, cell, at);
}

// What slices reflect of coefficient k of a row, one product of the triple product's sum.
vec3 reflected_coefficient(Cell cell, int first, int k) {
    int at = first + FIRST_COEFFICIENT + 2 * k;
    uint low = rows[at], high = rows[at + 1];
    vec3 light = uintBitsToFloat(uvec3(low & 0xFFFF0000u, high << 16, high & 0xFFFF0000u));
    return light * coefficient_between(cell, int(low & 0xFFFFu));
}

// What slices reflect of the peak number s of a row.
vec3 reflected_peak(Cell cell, int first, int s) {
    int triangle = int(rows[first + FIRST_PEAK + s]);
    return triangle < 0 ? vec3(0.0) : three_at(first + FIRST_POWER + 3 * s) * value_between(cell, triangle);
}
