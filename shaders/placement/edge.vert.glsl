#version 410 core
// Provides: one point on each silhouette pixel.

uniform ivec2 picture_size;

in int pixel;      // row-major
in int neighbour;  // row-major, the pixel on the silhouette's other side
in float weight;   // share of the pixel's area that shows the neighbour

flat out ivec2 own_pixel;
flat out ivec2 other_pixel;
flat out float other_weight;

void main() {
    own_pixel = ivec2(pixel % picture_size.x, pixel / picture_size.x);
    other_pixel = ivec2(neighbour % picture_size.x, neighbour / picture_size.x);
    other_weight = weight;
    gl_Position = vec4((vec2(own_pixel) + 0.5) / vec2(picture_size) * 2.0 - 1.0, 0.0, 1.0);
    gl_PointSize = 1.0;
}
