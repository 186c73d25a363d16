// Provides: the rows of shading points with gloss (`LightPart.rows`): coefficients and peaks in their own frames.

layout(std430, binding = 3) readonly buffer Rows { uint rows[]; };
uniform int row_words;

const int FIRST_PEAK = 7, FIRST_POWER = 47, FIRST_BITS = 167, FIRST_COEFFICIENT = 172, N_PEAKS = 40;

float number_at(int i) { return uintBitsToFloat(rows[i]); }
vec3 three_at(int i) { return vec3(number_at(i), number_at(i + 1), number_at(i + 2)); }
