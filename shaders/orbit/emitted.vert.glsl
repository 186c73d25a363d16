#version 430 core
// Provides: triangles, whether their backs are seen, and their numbers.
#include "orbit/surface.glsl"

flat out int shows_back, triangle;

void main() {
    gl_Position = seen_at(position);
    shows_back = int(is_back());
    triangle = gl_VertexID / 3;
}
