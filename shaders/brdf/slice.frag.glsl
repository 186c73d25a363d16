#version 410 core
// Provides: the BRDF over theta_h (to the right) and theta_d (upwards), both from 0 to 90 degrees, at phi_d = 90
// degrees, h leaning along the tangent; 1/sr, 0 where a direction is below the horizon. Row 0 is the top.
#include "generated/brdf.glsl"

uniform vec2 size;       // texels
uniform float azimuth;   // phi_h, radians from the tangent

layout(location = 0) out vec4 value;

void main() {
    vec2 angles = vec2(gl_FragCoord.x, size.y - gl_FragCoord.y) / size * 1.57079633;
    float ch = cos(angles.x), sh = sin(angles.x), cd = cos(angles.y), sd = sin(angles.y);
    vec2 along = vec2(cos(azimuth), sin(azimuth)), across = vec2(-along.y, along.x);
    vec3 middle = vec3(cd * sh * along, cd * ch), apart = vec3(sd * across, 0.0);
    vec3 wi = middle + apart, wo = middle - apart;
    value = vec4(wi.z > 0.0 && wo.z > 0.0 ? brdf(wi, wo) : vec3(0.0), 1.0);
}
