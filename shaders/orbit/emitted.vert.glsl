#version 430 core
// Provides: triangles, whether their backs are visible, and their numbers.
#include "orbit/surface.glsl"
#include "common/vertex_colour.glsl"

flat out int shows_back, triangle;
#if HAS_HOLES
sample out vec2 opacity_uv;
sample out float vertex_opacity;
#endif

void main() {
    gl_Position = projected(position);
    shows_back = int(is_back());
    triangle = gl_VertexID / 3;
#if HAS_HOLES
    opacity_uv = image_place;
    vertex_opacity = unpacked_colour(packed_colour).a;
#endif
}
