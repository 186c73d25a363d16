// Places the interface's triangles. Positions are framebuffer pixels, row 0 at the top; colours are sRGB.
#version 410 core

uniform vec2 display_size;

in vec2 in_position;
in vec2 in_uv;
in vec4 in_colour;

out vec2 uv;
out vec4 colour;

void main() {
    uv = in_uv;
    colour = in_colour;
    vec2 clip = in_position / display_size * 2.0 - 1.0;
    gl_Position = vec4(clip.x, -clip.y, 0.0, 1.0);
}
