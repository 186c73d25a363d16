#version 410 core
// Provides: the linear picture. A pixel that sees a reflecting surface has the address of its shaded radiance, others
// have -1 and show the backdrop. At edges it has -2 - i, and shows the backdrop and several surfaces: from the i-th texel
// of `mixed` on stand their addresses and, as bits, their shares of the pixel, of which the last is negative.
// Alpha is the backdrop's, and 1 where a surface fills the pixel. What is not finite becomes black.
// CATCHERS: with shadows in place of some surfaces; the backdrop has alpha then, and the environment comes behind here.
#include "common/finite.glsl"
#include "common/sample_layout.glsl"
#include "common/latlong.glsl"
#include "common/caught.glsl"

uniform isampler2D pixel_addresses;
uniform isampler2D mixed;
uniform sampler2D shaded;
uniform sampler2D backdrop;

layout(location = 0) out vec4 radiance;

#if CATCHERS
uniform sampler2D catching;  // by row of `shaded`: 1 where its samples are those of a catcher
uniform sampler2D empty;     // the light of catchers alone, as if they filled each pixel
uniform sampler2D ray_directions;  // unit, world
uniform sampler2D environment;
uniform float rotation;  // radians
uniform float intensity;
uniform int transparent;

// A part of a pixel: catchers apart from all else, (light, share).
void add_part(int address, float share, inout vec3 others, inout vec4 catchers) {
    ivec2 texel = texel_of_address(address);
    vec3 light = share * texelFetch(shaded, texel, 0).rgb;
    if (texelFetch(catching, ivec2(0, texel.y), 0).r > 0.5) catchers += vec4(light, share);
    else others += light;
}

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    int address = texelFetch(pixel_addresses, pixel, 0).r;
    vec4 behind = texelFetch(backdrop, pixel, 0), catchers = vec4(0.0);
    vec3 others = address >= 0 ? vec3(0.0) : behind.rgb;
    float alpha = address >= 0 ? 1.0 : behind.a;
    if (address >= 0) add_part(address, 1.0, others, catchers);
    if (address < -1) {
        float share = 1.0;
        for (int i = -2 - address; share > 0.0; ++i) {
            ivec2 part = texelFetch(mixed, texel_of_address(i), 0).rg;
            share = intBitsToFloat(part.g);
            add_part(part.r, abs(share), others, catchers);
        }
    }
    vec4 value = vec4(others, alpha);
    if (catchers.a > 0.0) {
        value = caught(others, alpha, catchers.rgb / catchers.a, texelFetch(empty, pixel, 0).rgb, catchers.a);
    }
    if (transparent == 0) {
        vec3 direction = unrotate(texelFetch(ray_directions, pixel, 0).xyz, rotation);
        vec3 sky = intensity * textureLod(environment, latlong_coordinates(direction), 0.0).rgb;
        value = vec4(value.a < 1.0 ? value.rgb + (1.0 - value.a) * sky : value.rgb, 1.0);
    }
    radiance = vec4(is_finite(value.rgb) ? value.rgb : vec3(0.0), value.a);
}
#else
void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    int address = texelFetch(pixel_addresses, pixel, 0).r;
    vec3 surface = texelFetch(shaded, texel_of_address(max(address, 0)), 0).rgb;
    vec4 behind = texelFetch(backdrop, pixel, 0);
    vec3 value = address >= 0 ? surface : behind.rgb;
    if (address < -1) {
        float share = 1.0;
        for (int i = -2 - address; share > 0.0; ++i) {
            ivec2 part = texelFetch(mixed, texel_of_address(i), 0).rg;
            share = intBitsToFloat(part.g);
            value += abs(share) * texelFetch(shaded, texel_of_address(part.r), 0).rgb;
        }
    }
    radiance = vec4(is_finite(value) ? value : vec3(0.0), address >= 0 ? 1.0 : behind.a);
}
#endif
