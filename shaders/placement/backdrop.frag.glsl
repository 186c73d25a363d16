#version 410 core
// Provides: what is seen where no reflecting surface is: emitters (premade picture, alpha the share of a pixel that
// nothing covers) and behind them the environment, linear radiance; or, transparent, without it, and alpha is the share
// of a pixel that is covered.
#include "common/latlong.glsl"

uniform sampler2D emission;
uniform sampler2D ray_directions;  // unit, world
uniform sampler2D environment;
uniform float rotation;   // radians
uniform float intensity;
uniform int transparent;

layout(location = 0) out vec4 radiance;

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    vec4 emitted = texelFetch(emission, pixel, 0);
    if (transparent != 0) {
        radiance = vec4(emitted.rgb, 1.0 - emitted.a);
        return;
    }
    vec3 direction = unrotate(texelFetch(ray_directions, pixel, 0).xyz, rotation);
    vec3 behind = intensity * textureLod(environment, latlong_coordinates(direction), 0.0).rgb;
    radiance = vec4(emitted.a > 0.0 ? emitted.rgb + emitted.a * behind : emitted.rgb, 1.0);
}
