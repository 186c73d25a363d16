#version 410 core
// Provides: the linear picture. A pixel that sees a reflecting surface has the address of its shaded radiance, others
// have -1 and show the backdrop. At edges it has -2 - i, and shows the backdrop and several surfaces: from the i-th texel
// of `mixed` on stand their addresses and, as bits, their shares of the pixel, of which the last is negative.
// What is not finite becomes black with alpha 0, all else has alpha 1.
#include "common/finite.glsl"
#include "common/sample_layout.glsl"

uniform isampler2D pixel_addresses;
uniform isampler2D mixed;
uniform sampler2D shaded;
uniform sampler2D backdrop;

layout(location = 0) out vec4 radiance;

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    int address = texelFetch(pixel_addresses, pixel, 0).r;
    vec3 surface = texelFetch(shaded, texel_of_address(max(address, 0)), 0).rgb;
    vec3 value = address >= 0 ? surface : texelFetch(backdrop, pixel, 0).rgb;
    if (address < -1) {
        float share = 1.0;
        for (int i = -2 - address; share > 0.0; ++i) {
            ivec2 part = texelFetch(mixed, texel_of_address(i), 0).rg;
            share = intBitsToFloat(part.g);
            value += abs(share) * texelFetch(shaded, texel_of_address(part.r), 0).rgb;
        }
    }
    radiance = is_finite(value) ? vec4(value, 1.0) : vec4(0.0);
}
