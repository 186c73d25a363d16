#version 410 core
// Provides: one point on each pixel of an object's outline.

uniform ivec2 picture_size;

in int pixel;  // row-major

void main() {
    ivec2 place = ivec2(pixel % picture_size.x, pixel / picture_size.x);
    gl_Position = vec4((vec2(place) + 0.5) / vec2(picture_size) * 2.0 - 1.0, 0.0, 1.0);
    gl_PointSize = 1.0;
}
