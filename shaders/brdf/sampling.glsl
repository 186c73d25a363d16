// Provides: directions for integrals over a BRDF of any width, and the densities (per solid angle) they come in: by the
// cosine, about a soft light, and about the highlight's pole, as many between any angle and its double. All integrands
// here divide by the sum of the densities, so that each direction counts for what finds it best (Veach's balance).

const float TAU = 6.2831853;
const float GOLDEN = 0.61803399;
const float NARROWEST = 1e-5;  // radians from the pole
const float RANGE = 11.9645;   // ln(pi/2 / NARROWEST)

// Place j of n in the unit square, evenly spread; `turn` gives another such set.
vec2 spread(int j, int n, vec2 turn) {
    return fract(vec2((float(j) + turn.x) / float(n), float(j) * GOLDEN + turn.y));
}

vec3 polar(float cosine, float sine, float phi) {
    return vec3(sine * cos(phi), sine * sin(phi), cosine);
}

vec3 sample_cosine(vec2 u) {
    return polar(sqrt(1.0 - u.x), sqrt(u.x), TAU * u.y);
}

float cosine_density(vec3 wi) {
    return max(wi.z, 0.0) / (0.5 * TAU);
}

// A half vector about the normal, and wo mirrored in it. `density` is that of this direction: near the pole, angles that
// are found again from the sum of both directions have no digits left.
vec3 sample_pole(vec2 u, vec3 wo, out float density) {
    float theta = NARROWEST * exp(RANGE * u.x);
    vec3 h = polar(cos(theta), sin(theta), TAU * u.y);
    float cos_d = dot(wo, h);
    density = 1.0 / (4.0 * max(abs(cos_d), 1e-6) * TAU * sin(theta) * theta * RANGE);
    return 2.0 * cos_d * h - wo;
}

// Of a direction that was found otherwise.
float pole_density(vec3 wi, vec3 wo) {
    vec3 s = wi + wo;
    float size = length(s), flat_size = length(s.xy);
    float theta = atan(flat_size, s.z);
    if (theta < NARROWEST || s.z <= 0.0) {
        return 0.0;
    }
    // 1 / (TAU sin theta theta RANGE) for half vectors, 1 / (4 cos theta_d) of that for wi.
    return size / (TAU * flat_size * theta * RANGE) / (2.0 * size);
}

// A frame about a direction: columns are two directions across and itself.
mat3 frame_about(vec3 n) {
    float s = n.z >= 0.0 ? 1.0 : -1.0, a = -1.0 / (s + n.z), b = n.x * n.y * a;
    return mat3(vec3(1.0 + s * n.x * n.x * a, s * b, -s * n.x), vec3(b, s + n.y * n.y * a, -n.y), n);
}

// About a soft light's middle: density k / TAU exp(k (cos - 1)), the von Mises-Fisher distribution for large k.
vec3 sample_blob(vec2 u, vec3 middle, float k) {
    float away = min(-log(max(1.0 - u.x, 1e-6)) / k, 2.0);
    return frame_about(middle) * polar(1.0 - away, sqrt(max(away * (2.0 - away), 0.0)), TAU * u.y);
}

float blob_density(vec3 wi, vec3 middle, float k) {
    return k / TAU * exp(k * (dot(wi, middle) - 1.0));
}
