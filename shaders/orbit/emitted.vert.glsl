#version 430 core
// Provides: triangles, whether their backs are visible, where they are, and their numbers.
#include "orbit/surface.glsl"
#include "common/vertex_colour.glsl"

flat out int shows_back, triangle;
out vec3 from_camera;
#if HAS_HOLES
sample out vec4 opacity_uvs;
sample out float vertex_opacity;
#endif
#if HAS_MAPS
out vec4 uvs;
centroid out vec3 vertex_colour;
#endif

void main() {
    gl_Position = projected(position);
    shows_back = int(is_back());
    from_camera = position - camera_position;
    triangle = gl_VertexID / 3;
#if HAS_MAPS
    uvs = image_places;
    vertex_colour = unpacked_colour(packed_colour).rgb;
#endif
#if HAS_HOLES
    opacity_uvs = image_places;
    vertex_opacity = unpacked_colour(packed_colour).a;
#endif
}
