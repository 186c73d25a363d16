// Provides: a vertex's linear colour and opacity from the half floats of `engine.texture.gpu_export.colour_words`.

vec4 unpacked_colour(ivec2 words) {
    return vec4(unpackHalf2x16(uint(words.x)), unpackHalf2x16(uint(words.y)));
}
