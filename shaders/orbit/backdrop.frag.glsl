#version 430 core
// Provides: the environment behind all that is drawn, linear radiance; or, transparent, black with alpha 0.
#include "common/latlong.glsl"

uniform sampler2D environment;
uniform mat3 axes;        // of the picture's plane: its upper left corner, a pixel to the right, a pixel down
uniform float rotation;   // radians
uniform float intensity;
uniform int transparent;

layout(location = 0) out vec4 radiance;

void main() {
    if (transparent != 0) {
        radiance = vec4(0.0);
        return;
    }
    vec3 towards = normalize(axes * vec3(1.0, gl_FragCoord.xy));
    vec2 at = latlong_coordinates(unrotate(towards, rotation));
    radiance = vec4(intensity * textureLod(environment, at, 0.0).rgb, 1.0);
}
