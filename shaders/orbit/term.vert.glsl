#version 430 core
// Provides: one term of an object's reflection at its shading points, and under bumps the light for offset normals.
#include "orbit/surface.glsl"
#include "orbit/points.glsl"
#include "orbit/rows.glsl"
#include "common/vertex_colour.glsl"

layout(std430, binding = 4) readonly buffer Gloss { vec4 gloss[]; };
uniform vec3 reflectance;
uniform vec3 sends_on;
uniform float has_gloss;

centroid out vec3 colour;
out vec4 uvs;  // in two sets of texture coordinates
out vec3 at;
flat out vec3 outside;
#if HAS_MAPS
centroid out vec3 vertex_colour;
#endif
#if HAS_HOLES
sample out vec4 opacity_uvs;
sample out float vertex_opacity;
#endif
#if IS_BUMPY
flat out float side;
centroid out vec3 light, normal, along, across;
centroid out mat3 from_side;  // of red, green and blue: power times direction
#endif
#if IS_SHARP
flat out int shows_back, triangle;
centroid out vec3 shares;
#endif

void main() {
    gl_Position = projected(position);
    int p = is_back() ? sides.y : sides.x;
    // Until points on a back are uploaded, it shows the light of its front, diffusely reflected.
    bool has_point = p >= 0, reflects = has_point || sides.x >= 0;
    p = max(has_point ? p : sides.x, 0);
#if IS_SHARP
    shows_back = int(is_back());
    triangle = gl_VertexID / 3;
    shares = vec3(equal(ivec3(gl_VertexID % 3), ivec3(0, 1, 2)));
    vec3 glossy = has_point ? vec3(0.0) : sends_on * irradiance[p].rgb;
#else
    vec3 glossy = has_point ? gloss[p].rgb : sends_on * irradiance[p].rgb;
#endif
    vec3 sent = sends_on * indirect[p].rgb + has_gloss * glossy;
#if IS_BUMPY
    side = is_back() ? -1.0 : 1.0;
    light = reflects ? irradiance[p].rgb : vec3(0.0);
    normal = normal_of(p);
    along = first_way;
    across = second_way;
    int row = max(row_of(p), 0) * row_words;
    mat3 along_axes = outerProduct(tangent_of(p), three_at(row + 1)) + outerProduct(across_of(p), three_at(row + 4));
    from_side = reflects ? along_axes : mat3(0.0);
#else
    sent += reflectance * irradiance[p].rgb;
#endif
    colour = reflects ? sent : vec3(0.0);
    uvs = image_places;
    at = position;
    outside = face;
#if HAS_MAPS
    vertex_colour = unpacked_colour(packed_colour).rgb;
#endif
#if HAS_HOLES
    opacity_uvs = image_places;
    vertex_opacity = unpacked_colour(packed_colour).a;
#endif
}
