// Provides: samples of a measurement between its grid's points, and what of them a layer's quotient is, per channel
// (material._measured_kernels). `table`: 1/sr over phi_d (across, 0 to pi, which wraps round), theta_d (up) and theta_h
// (layers, spaced by its square root), both from 0 to pi/2. Filtering is done here: a sampler's own has weights of
// eight bits.

const float LEAST_PRODUCT = 1e-30;

// A measurement at a pair of directions: its value per channel, negative where there is none, and the angles.
struct Measured {
    vec3 value;
    float theta_i, theta_o, theta_h, theta_d, phi_h, phi_d, theta_u, theta_v;
};

vec3 measured_row(sampler2DArray table, ivec2 phi, float w, int j, int i) {
    return mix(texelFetch(table, ivec3(phi.x, j, i), 0).rgb, texelFetch(table, ivec3(phi.y, j, i), 0).rgb, w);
}

vec3 measured_sample(sampler2DArray table, float theta_h, float theta_d, float phi_d) {
    ivec3 n = textureSize(table, 0), last = n - 1;
    float degrees = theta_d * (float(n.y) / 1.57079633);
    vec2 at = min(vec2(degrees, sqrt(theta_h * (float(n.z * n.z) / 1.57079633))), vec2(last.yz));
    ivec2 low = min(ivec2(at), last.yz - 1);
    vec2 t = at - vec2(low);
    float around = phi_d * (float(n.x) / 3.14159265);
    int k = int(around);
    ivec2 phi = ivec2(k, k + 1) % n.x;
    float w = around - float(k);
    vec3 near = mix(measured_row(table, phi, w, low.x, low.y), measured_row(table, phi, w, low.x + 1, low.y), t.x);
    vec3 far = mix(measured_row(table, phi, w, low.x, low.y + 1), measured_row(table, phi, w, low.x + 1, low.y + 1), t.x);
    return mix(near, far, t.y);
}

// What lies under the product of the diffuse factors, over it.
vec3 diffuse_quotient(vec3 value, vec3 matt) {
    return min(value, matt) / max(matt, LEAST_PRODUCT);
}

// What lies above it, over the product of the highlight's factors.
vec3 specular_quotient(vec3 value, vec3 matt, vec3 shine) {
    return max(value - matt, 0.0) / max(shine, LEAST_PRODUCT);
}

vec3 whole_quotient(vec3 value, vec3 cloth) {
    return value / max(cloth, LEAST_PRODUCT);
}
