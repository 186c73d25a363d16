// Provides: the sRGB transfer function (IEC 61966-2-1, the exact two pieces); input and output in [0, 1].

vec3 encode_srgb(vec3 linear) {
    vec3 curved = 1.055 * pow(max(linear, vec3(0.0031308)), vec3(1.0 / 2.4)) - 0.055;
    return mix(curved, 12.92 * linear, lessThanEqual(linear, vec3(0.0031308)));
}
