#version 430 core
// Provides: radiance of a triangle's front or back: diffuse light times the object's albedo, gloss, and emission.
#include "common/cone.glsl"
#if HAS_HOLES
#include "common/opacity.glsl"
#endif
layout(std430, binding = 8) readonly buffer Objects { float objects[]; };

centroid in vec3 front_white, front_gloss, back_white, back_gloss;
in vec3 from_camera;
flat in ivec3 shown;

layout(location = 0) out vec4 radiance;

void main() {
#if HAS_HOLES
    if (is_hole(shown.z))
        discard;
#endif
    bool is_front = !gl_FrontFacing;  // rows count downwards
    if (!is_front && shown.x == 1 && shown.y == 0)
        discard;
    int at = 16 * shown.z;
    vec3 albedo = vec3(objects[at], objects[at + 1], objects[at + 2]);
    vec4 cone = vec4(objects[at + 12], objects[at + 13], objects[at + 14], objects[at + 15]);
    vec3 emission = vec3(objects[at + 4], objects[at + 5], objects[at + 6]) * cone_share(cone, from_camera);
    vec3 reflected = is_front ? front_white * albedo + front_gloss : back_white * albedo + back_gloss;
    bool reflects = (is_front ? shown.x : shown.y) == 1;
    radiance = vec4((is_front ? emission : vec3(0.0)) + (reflects ? max(reflected, 0.0) : vec3(0.0)), 1.0);
}
