#version 410 core
// Provides: the outline's colour.

uniform vec3 outline_colour;  // sRGB encoded

layout(location = 0) out vec4 colour;

void main() {
    colour = vec4(outline_colour, 1.0);
}
