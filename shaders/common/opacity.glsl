// Provides: whether a surface is not there at a sample of a pixel, as `engine.scene.cutouts` has it.
#include "common/images.glsl"

// A row of 8 for each object: 0 opaque, 1 mask, 2 blend; where its image begins, -1 for none; repeats; factor; cutoff;
// whether the opacity of vertices counts; 0.
layout(std430, binding = 14) readonly buffer Opacities { float opacities[]; };
sample in vec4 opacity_uvs;
sample in float vertex_opacity;

// Spread evenly over the samples of a pixel, whose columns differ.
float chance() {
    uvec2 pixel = uvec2(gl_FragCoord.xy);
    uint mixed = (pixel.y * 65536u + pixel.x + 1u) * 0x9E3779B1u;
    mixed = (mixed ^ (mixed >> 15)) * 0x85EBCA6Bu;
    return fract(float((mixed ^ (mixed >> 13)) >> 8) * exp2(-24.0) + gl_SamplePosition.x);
}

bool is_hole(int i_object) {
    int row = 8 * i_object, image = int(opacities[row + 1]);
    float alpha = opacities[row + 4];
    if (image >= 0) {
        vec2 repeats = vec2(opacities[row + 2], opacities[row + 3]);
        alpha *= between_texels(image, level_of(image, 0), place_on(image, opacity_uvs, repeats)).x;
    }
    if (opacities[row + 6] > 0.0)
        alpha *= vertex_opacity;
    return opacities[row] == 1.0 ? alpha < opacities[row + 5] : opacities[row] == 2.0 && alpha <= chance();
}
