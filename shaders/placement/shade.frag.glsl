#version 410 core
// Provides: one layer's share of the outgoing radiance, f_q * f_o(theta_o) * B, at each pixel of an object (the
// pixels in sample layout; blending sums the layers). FOOTPRINT: the layer was computed at fewer samples, and four of
// them with weights stand for a pixel. INDIRECT: indirect light is added, at fewer samples of its own. VIEW_CURVE: 0
// where f_o is 1 everywhere; 2: of its factors, one takes the angle to the coat's normal. MAPS: a texture and a weight
// map multiply the layer, at every pixel, however coarse the rest is.
#include "common/sample_layout.glsl"

const float HALF_PI = 1.57079632679490;
const float VIEW_CURVE_SIZE = 256.0;

uniform sampler2D accumulator;
uniform int first_row;
uniform vec3 gain;
#if FOOTPRINT
uniform isampler2D footprint_addresses;
uniform sampler2D footprint_weights;
#endif
#if INDIRECT
uniform sampler2D indirect;
uniform isampler2D indirect_addresses;
uniform sampler2D indirect_weights;
#endif
#if VIEW_CURVE
uniform sampler2D theta_o;     // radians
uniform sampler2D view_curve;  // f_o at VIEW_CURVE_SIZE angles, 0 to pi/2 inclusive; its factors, frame by frame
#endif
#if VIEW_CURVE > 1
uniform sampler2D coat_theta_o;  // radians
#endif

#if MAPS
uniform sampler2D maps;  // linear RGB and weight, at the object's own rows
uniform float texture_strength;
uniform int inverts_weight;
#endif

layout(location = 0) out vec4 radiance;

#if FOOTPRINT || INDIRECT
vec3 weighted_sum(sampler2D samples, ivec4 addresses, vec4 weights) {
    return weights.x * texelFetch(samples, texel_of_address(addresses.x), 0).rgb
         + weights.y * texelFetch(samples, texel_of_address(addresses.y), 0).rgb
         + weights.z * texelFetch(samples, texel_of_address(addresses.z), 0).rgb
         + weights.w * texelFetch(samples, texel_of_address(addresses.w), 0).rgb;
}
#endif

vec3 layer_radiance(ivec2 texel) {
#if FOOTPRINT
    vec3 value = weighted_sum(
        accumulator, texelFetch(footprint_addresses, texel, 0), texelFetch(footprint_weights, texel, 0));
#else
    vec3 value = texelFetch(accumulator, texel - ivec2(0, first_row), 0).rgb;
#endif
#if INDIRECT
    value += weighted_sum(
        indirect, texelFetch(indirect_addresses, texel, 0), texelFetch(indirect_weights, texel, 0));
#endif
    return value;
}

#if VIEW_CURVE
vec3 view_factor(float angle, int row) {
    float position = clamp(angle / HALF_PI, 0.0, 1.0) * (VIEW_CURVE_SIZE - 1.0);
    int i = min(int(position), int(VIEW_CURVE_SIZE) - 2);
    vec3 low = texelFetch(view_curve, ivec2(i, row), 0).rgb, high = texelFetch(view_curve, ivec2(i + 1, row), 0).rgb;
    return mix(low, high, position - float(i));
}
#endif

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    vec3 value = gain * layer_radiance(texel);
#if VIEW_CURVE
    value *= view_factor(texelFetch(theta_o, texel, 0).r, 0);
#endif
#if VIEW_CURVE > 1
    value *= view_factor(texelFetch(coat_theta_o, texel, 0).r, 1);
#endif
#if MAPS
    vec4 seen = texelFetch(maps, texel - ivec2(0, first_row), 0);
    value *= (1.0 + texture_strength * (seen.rgb - 1.0)) * (inverts_weight != 0 ? 1.0 - seen.a : seen.a);
#endif
    radiance = vec4(value, 0.0);
}
