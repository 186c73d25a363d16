// Provides: a weight under the strokes of a brush, as `engine.texture.stroke_painting` paints it.

layout(std430, binding = 6) readonly buffer Strokes { uint stroke_words[]; };
uniform ivec2 strokes;  // the first and the last, excluded
uniform int n_strokes;  // in all: behind them stand the dabs

float smooth_step(float x) {
    x = clamp(x, 0.0, 1.0);
    return x * x * (3.0 - 2.0 * x);
}

vec3 three_of_stroke(int i) {
    return uintBitsToFloat(uvec3(stroke_words[i], stroke_words[i + 1], stroke_words[i + 2]));
}

float painted(float weight, vec3 at, vec3 normal) {
    for (int s = strokes.x; s < strokes.y; ++s) {
        int first = 8 * s;
        float radius = uintBitsToFloat(stroke_words[first + 2]), inner = uintBitsToFloat(stroke_words[first + 3]);
        float coverage = 0.0;
        for (uint d = stroke_words[first]; d < stroke_words[first + 1]; ++d) {
            int dab = 8 * n_strokes + 6 * int(d);
            float apart = distance(at, three_of_stroke(dab));
            float share = smooth_step(2.0 * dot(normal, three_of_stroke(dab + 3)) + 1.0);
            share *= smooth_step((radius - apart) / (radius - inner));
            coverage = apart < radius ? max(coverage, share) : coverage;
        }
        float strength = uintBitsToFloat(stroke_words[first + 4]), value = uintBitsToFloat(stroke_words[first + 5]);
        weight += strength * coverage * (value - weight);
    }
    return weight;
}
