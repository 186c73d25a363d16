// Provides: curve_at(row, gamma), the final values of a curve at an angle in radians, per channel; 0 beyond pi/2, where
// curves end. Each curve is a row of `curves`; sample k of n stands at (k / (n - 1))^2 pi/2, so that a highlight of a
// ten-thousandth of a radian has as many samples as a wide one (ui/gl/brdf_stack.py).

uniform sampler2D curves;

vec3 curve_at(int row, float gamma) {
    if (gamma > 1.5707964) {
        return vec3(0.0);
    }
    int last = textureSize(curves, 0).x - 1;
    float place = min(sqrt(gamma * (2.0 / 3.14159265)), 1.0) * float(last);
    int below = min(int(place), last - 1);
    vec3 low = texelFetch(curves, ivec2(below, row), 0).rgb, high = texelFetch(curves, ivec2(below + 1, row), 0).rgb;
    return mix(low, high, place - float(below));
}
