#version 430 core
// Provides: one layer of an object, times texture and weight: diffuse, or with detail, by lobes that lie on its texture
// coordinates instead of those of its points, also glossy; or its emission.
#include "common/images.glsl"
#if HAS_DETAIL
#include "deform/detail.glsl"
#include "deform/gloss.glsl"
uniform int gloss_layer;  // −1 for a diffuse one
uniform int own_light;
uniform float even;
uniform vec3 camera_position;
centroid in mat3 axes;
centroid in vec3 here;
#endif
#if HAS_HOLES
#include "common/opacity.glsl"
uniform int i_object;
#endif
#if HAS_MAPS
#include "common/maps.glsl"
centroid in vec3 vertex_colour;
#endif

centroid in vec3 front_white, back_white;
in vec4 uvs;
in vec3 at;
flat in vec3 outside;
flat in ivec2 has_points;
uniform vec3 reflectance;

layout(location = 0) out vec4 radiance;

void main() {
#if HAS_HOLES
    if (is_hole(i_object))
        discard;
#endif
    vec4 right = dFdx(uvs), below = dFdy(uvs);
    bool is_front = !gl_FrontFacing;  // rows count downwards
#if EMITS
    if (!is_front)
        discard;
    vec3 sent = vec3(1.0);
#else
    if ((is_front ? has_points.x : has_points.y) == 0)
        discard;
#if HAS_DETAIL
    mat3 frame = frame_of(axes, is_front);
    choose_light(own_light);
    vec3 sent = white_of_detail(uvs.xy, frame);
    if (gloss_layer >= 0)
        sent = shiny(gloss_layer, detail_normal(uvs.xy, frame), normalize(camera_position - here), sent, even);
#else
    vec3 sent = is_front ? front_white : back_white;
#endif
#endif
    sent *= reflectance;
#if HAS_MAPS
    sent *= factor(uvs, right, below, at, outside, vertex_colour);
#endif
    radiance = vec4(max(sent, 0.0), 0.0);
}
