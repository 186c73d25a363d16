#version 430 core
// Provides: marks on the points around all visible pixels of an object; 0 to be added to the picture.

layout(early_fragment_tests) in;
layout(std430, binding = 7) readonly buffer Corners { int corners[]; };  // 20 words each
layout(std430, binding = 8) buffer Seen { uint seen[]; };
flat in int shows_back, triangle;
uniform uint picture;

layout(location = 0) out vec4 radiance;

void main() {
    for (int k = 0; k < 3; ++k) {
        int p = corners[20 * (3 * triangle + k) + 10 + shows_back];
        if (p >= 0) {
            seen[p] = picture;
        }
    }
    radiance = vec4(0.0);
}
