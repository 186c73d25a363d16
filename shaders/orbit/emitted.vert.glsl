#version 430 core
// Provides: triangles, whether their backs are visible, and their numbers.
#include "orbit/surface.glsl"

flat out int shows_back, triangle;

void main() {
    gl_Position = projected(position);
    shows_back = int(is_back());
    triangle = gl_VertexID / 3;
}
