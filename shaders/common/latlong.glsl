// Provides: the texture coordinates of a unit world direction in a lat-long map (docs/conventions.md, "Light").
// The centre column looks along -Z, +Y is up (row 0 is the top), azimuth grows to the right toward +X.

const float PI = 3.14159265358979;

// The direction in the environment's own frame: the environment is turned by `rotation` radians about +Y.
vec3 unrotate(vec3 direction, float rotation) {
    float c = cos(rotation), s = sin(rotation);
    return vec3(c * direction.x - s * direction.z, direction.y, s * direction.x + c * direction.z);
}

vec2 latlong_coordinates(vec3 direction) {
    float azimuth = dot(direction.xz, direction.xz) > 0.0 ? atan(direction.x, -direction.z) : 0.0;
    return vec2(azimuth / (2.0 * PI) + 0.5, acos(clamp(direction.y, -1.0, 1.0)) / PI);
}
