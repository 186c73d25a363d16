#version 410 core
// Provides: the linear picture: Orbit's, enlarged to the picture's size where it has fewer pixels, and over it so much
// of another of that size as `share` says. What is not finite becomes black with alpha 0, all else has alpha 1.
#include "common/finite.glsl"

uniform sampler2D picture;
uniform sampler2D other;
uniform vec2 size;  // of the target
uniform float share;  // of the other, 0 to 1

layout(location = 0) out vec4 radiance;

void main() {
    vec3 value = texture(picture, gl_FragCoord.xy / size).rgb;
    if (share > 0.0) {
        value = mix(value, texelFetch(other, ivec2(gl_FragCoord.xy), 0).rgb, share);
    }
    radiance = is_finite(value) ? vec4(value, 1.0) : vec4(0.0);
}
