#version 430 core
// Provides: the triple product: the glossy reflection of visible points towards the camera, the sum over their nonzero
// coefficients of light times visibility, times the slice towards the camera, and over their peaks. A group a point.
#include "orbit/points.glsl"
#include "orbit/slices.glsl"

layout(local_size_x = 32) in;
layout(std430, binding = 12) readonly buffer Seen { uint seen[]; };
layout(std430, binding = 13) writeonly buffer Gloss { vec4 gloss[]; };
uniform ivec2 range;  // of points, the last excluded
uniform uint picture; // its number, which marks the points that it shows
uniform vec3 camera_position;
uniform int n_most;   // coefficients

shared vec3 sums[32];

void main() {
    int p = range.x + int(gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x);
    if (p >= range.y || seen[p] != picture) {
        return;
    }
    vec3 wo = camera_position - place_of(p);
    wo = dot(wo, wo) > 1e-30 ? normalize(wo) : normal_of(p); // a camera at the point looks from straight above
    Cell cell = cell_at(vec3(dot(tangent_of(p), wo), dot(normal_of(p), wo), dot(across_of(p), wo)));
    int mine = int(gl_LocalInvocationID.x), first = row_of(p) * row_words;
    int n = min(int(rows[first]), n_most);
    vec3 total = vec3(0.0);
    for (int k = mine; k < n; k += 32) {
        total += reflected_coefficient(cell, first, k);
    }
    for (int s = mine; s < N_PEAKS; s += 32) {
        total += reflected_peak(cell, first, s);
    }
    sums[mine] = total;
    for (int half_way = 16; half_way > 0; half_way /= 2) {
        barrier();
        if (mine < half_way) {
            sums[mine] += sums[mine + half_way];
        }
    }
    if (mine == 0) {
        gloss[p] = vec4(sums[0], 0.0);
    }
}
