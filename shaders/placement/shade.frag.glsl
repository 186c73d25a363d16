#version 410 core
// Provides: one layer's share of the outgoing radiance, f_q * f_o(theta_o) * B, at each pixel of an object (the
// pixels in sample layout; blending sums the layers). FOOTPRINT: the layer was computed at fewer samples, and four of
// them with weights stand for a pixel. VIEW_CURVE: f_o is not 1 everywhere. MAPS: a texture and a weight map multiply
// the layer, at every pixel, however coarse the rest is.
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
#if VIEW_CURVE
uniform sampler2D theta_o;     // radians
uniform sampler2D view_curve;  // f_o at VIEW_CURVE_SIZE angles, 0 to pi/2 inclusive
#endif

#if MAPS
uniform sampler2D maps;  // linear RGB and weight, at the object's own rows
uniform float texture_strength;
uniform int inverts_weight;
#endif

layout(location = 0) out vec4 radiance;

#if FOOTPRINT
vec3 layer_radiance(ivec2 texel) {
    ivec4 addresses = texelFetch(footprint_addresses, texel, 0);
    vec4 weights = texelFetch(footprint_weights, texel, 0);
    return weights.x * texelFetch(accumulator, texel_of_address(addresses.x), 0).rgb
         + weights.y * texelFetch(accumulator, texel_of_address(addresses.y), 0).rgb
         + weights.z * texelFetch(accumulator, texel_of_address(addresses.z), 0).rgb
         + weights.w * texelFetch(accumulator, texel_of_address(addresses.w), 0).rgb;
}
#else
vec3 layer_radiance(ivec2 texel) {
    return texelFetch(accumulator, texel - ivec2(0, first_row), 0).rgb;
}
#endif

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    vec3 value = gain * layer_radiance(texel);
#if VIEW_CURVE
    float position = clamp(texelFetch(theta_o, texel, 0).r / HALF_PI, 0.0, 1.0) * (VIEW_CURVE_SIZE - 1.0);
    int i = min(int(position), int(VIEW_CURVE_SIZE) - 2);
    vec3 low = texelFetch(view_curve, ivec2(i, 0), 0).rgb, high = texelFetch(view_curve, ivec2(i + 1, 0), 0).rgb;
    value *= mix(low, high, position - float(i));
#endif
#if MAPS
    vec4 seen = texelFetch(maps, texel - ivec2(0, first_row), 0);
    value *= (1.0 + texture_strength * (seen.rgb - 1.0)) * (inverts_weight != 0 ? 1.0 - seen.a : seen.a);
#endif
    radiance = vec4(value, 0.0);
}
