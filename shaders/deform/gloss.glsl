// Provides: what a glossy layer sends to the camera, as `engine.realtime.zonal_harmonics._shading_kernels.gloss_range`.
// Needs deform/light.glsl.

layout(std430, binding = 4) readonly buffer Gloss { float gloss[]; };  // for polar angles of wo: bands, lean
uniform int n_angles;
uniform float steepest;  // radians
uniform float cosine[ORDER];

// even: light that is added to both sides of the visibility ratio, summed over channels.
vec3 shiny(int layer, vec3 normal, vec3 towards, vec3 white, float even) {
    float up = max(dot(towards, normal), 0.01);
    vec3 along = towards - up * normal;
    float place = min(acos(min(up, 1.0)) / steepest, 1.0) * (n_angles - 1);
    int low = min(int(place), n_angles - 2), row = 3 * ORDER + 1;
    float share = place - low;
    int at = (layer * n_angles + low) * row;
    float turn = mix(gloss[at + row - 1], gloss[at + 2 * row - 1], share);
    vec3 bands[ORDER], values = vec3(0.0), unblocked = vec3(0.0);
    look_up(cos(turn) * normal - sin(turn) / max(length(along), 1e-12) * along, bands);
    for (int l = 0; l < ORDER; l++, at += 3) {
        vec3 here = vec3(gloss[at], gloss[at + 1], gloss[at + 2]);
        vec3 next = vec3(gloss[at + row], gloss[at + row + 1], gloss[at + row + 2]);
        values += mix(here, next, share) * bands[l];
    }
    look_up(normal, bands);
    for (int l = 0; l < ORDER; l++)
        unblocked += cosine[l] * bands[l];
    float open = (dot(white, vec3(1.0)) + even) / max(dot(unblocked, vec3(1.0)) + even, 1e-20);
    return max(clamp(open, 0.0, 1.0) * values, 0.0);
}
