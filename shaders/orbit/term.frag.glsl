#version 430 core
// Provides: one term of an object's reflection: its points' colours, the irradiance of a normal that bumps perturb
// (engine/realtime/triple_product/_pixel_kernels.py, `quick_irradiance`), times texture and weight.
#include "common/images.glsl"

centroid in vec3 colour;
in vec4 uvs;
in vec3 at;
flat in vec3 outside;

#if IS_BUMPY
flat in float side;
centroid in vec3 light, normal, along, across;
centroid in mat3 from_side;
uniform vec3 reflectance;
uniform int slopes;
uniform vec2 slope_repeats;
uniform float slope_scale;
uniform bool is_normal_map;

vec3 normal_offset(vec3 n, vec4 right, vec4 below) {
    vec2 slope = -slope_scale * side * over_pixel(slopes, uvs, right, below, slope_repeats).xy;
    vec3 sum;
    if (is_normal_map) {
        vec3 tangent = along - dot(along, n) * n;
        tangent /= max(length(tangent), 1e-30);
        slope *= sign(slope_repeats);
        sum = slope.x * tangent + slope.y * across.x * side * cross(n, tangent);
    } else {
        slope *= slope_repeats;
        sum = slope.x * along + slope.y * across;
    }
    return sum - dot(sum, n) * n;
}
#endif

#if HAS_HOLES
#include "common/opacity.glsl"
uniform int i_object;
#endif
#if HAS_MAPS
#include "common/maps.glsl"
centroid in vec3 vertex_colour;
#endif

#if IS_SHARP
#include "orbit/sharp.glsl"
#endif

layout(location = 0) out vec4 radiance;

void main() {
#if HAS_HOLES
    if (is_hole(i_object))
        discard;
#endif
    vec3 sent = colour;
    vec4 right = dFdx(uvs), below = dFdy(uvs);
    vec3 offset = vec3(0.0);
#if IS_BUMPY
    offset = normal_offset(normalize(normal), right, below);
    float cosine = inversesqrt(1.0 + dot(offset, offset));
    sent += reflectance * max((0.5 + 0.5 * cosine) * light + cosine * (offset * from_side), 0.0);
#endif
#if IS_SHARP
    sent += sharp_gloss(at, offset);
#endif
#if HAS_MAPS
    sent *= factor(uvs, right, below, at, outside, vertex_colour);
#endif
    radiance = vec4(sent, 0.0);
}
