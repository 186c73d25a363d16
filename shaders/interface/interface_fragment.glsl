// Colours the interface's triangles: vertex colour times a texture (glyphs, icons, the picture).
#version 410 core

uniform sampler2D image;

in vec2 uv;
in vec4 colour;

out vec4 out_colour;

void main() {
    out_colour = colour * texture(image, uv);
}
