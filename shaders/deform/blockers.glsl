// Provides: how much light clusters of triangles block at a white diffuse point, as
// `engine.realtime.zonal_harmonics._shading_kernels`.
// Needs deform/light.glsl.

// Clusters, see `engine.realtime.zonal_harmonics.shading.CLUSTER_ROW`, then for each object whether each of those casts
// its shadow on it.
layout(std430, binding = 6) readonly buffer Blockers { float blockers[]; };
uniform int n_blockers, n_casters;
uniform float spread[ORDER];  // by what the light of each band is multiplied
uniform float least;          // of an even light, see `_shading_kernels.LEAST_BLOCKED`

const int BLOCKER = 14;

// The light that one of them blocks: a cone's mean of each band is (P_(l-1) - P_(l+1)) / ((2l+1)(1-c)) at its rim.
vec3 blocked_by(int at, vec3 place, vec3 normal) {
    vec3 to = vec3(blockers[at], blockers[at + 1], blockers[at + 2]) - place;
    float area = blockers[at + 3], square = max(dot(to, to), 1e-20);
    float most = area / (area + PI * square), up = dot(normal, to) / sqrt(square);
    if (most < least || up < -sqrt(most) || most * (max(up, 0.0) + 0.25 * sqrt(most)) < least)
        return vec3(0.0);
    vec3 d = to / sqrt(square);
    vec3 squares = vec3(blockers[at + 4], blockers[at + 5], blockers[at + 6]);
    vec3 products = vec3(blockers[at + 7], blockers[at + 8], blockers[at + 9]);
    float outline = dot(squares, d * d) + 2.0 * dot(products, vec3(d.x * d.y, d.x * d.z, d.y * d.z));
    outline = min(PI * sqrt(max(outline, 0.0)), area);
    float away = dot(vec3(blockers[at + 10], blockers[at + 11], blockers[at + 12]), d);
    outline *= clamp(1.0 - 2.0 * away, 0.0, 1.0);
    float sine2 = outline / (outline + PI * square), sine = sqrt(sine2);
    if (up < sine)  // the cone extends below the horizon
        up = up > -sine ? (up + sine) * (up + sine) / max(4.0 * sine, 1e-20) : 0.0;
    float weight = sine2 * up - least;
    if (weight <= 0.0)
        return vec3(0.0);
    vec3 bands[ORDER];
    look_up(d, bands);
    float c = sqrt(1.0 - sine2), before = 1.0, here = c;
    vec3 mean = spread[0] * bands[0];
    for (int l = 1; l < ORDER; l++) {
        float after = (float(2 * l + 1) * c * here - float(l) * before) / float(l + 1);
        mean += spread[l] * (before - after) / (float(2 * l + 1) * (1.0 - c)) * bands[l];
        before = here;
        here = after;
    }
    return weight * max(mean, 0.0);
}

// The rest of white, the radiance of an object's point without other objects.
vec3 with_shadows(vec3 white, int object, vec3 place, vec3 normal) {
    vec3 blocked = vec3(0.0);
    for (int k = 0; k < n_blockers; k++)
        if (blockers[BLOCKER * n_blockers + object * n_casters + int(blockers[BLOCKER * k + 13])] > 0.0)
            blocked += blocked_by(BLOCKER * k, place, normal);
    vec3 left = max(1.0 - 0.5 * max(blocked, 0.0) / max(white, vec3(1e-20)), 0.0);
    return white * left * left;
}
