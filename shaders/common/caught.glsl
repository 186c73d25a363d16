// Provides: the shadows on catchers in a pixel, as `app/stills/shadow_catcher.py` has them, which explains the equations.

// A pixel's light and alpha. others: the light of all else in it; alpha: how much of it is covered; seen: the light of
// catchers as if they filled it, C; empty: the same where nothing else stands, W; share: of the pixel that they cover.
vec4 caught(vec3 others, float alpha, vec3 seen, vec3 empty, float share) {
    const vec3 LUMINANCE = vec3(0.2126, 0.7152, 0.0722);
    float total = dot(empty, LUMINANCE);
    float left = total > 0.0 ? dot(min(seen, empty), LUMINANCE) / total : 1.0;
    vec3 excess = max(seen - empty, vec3(0.0));
    return vec4(others + share * excess, clamp(alpha - share * clamp(left, 0.0, 1.0), 0.0, 1.0));
}
