// Provides: the share of its radiance that an emitter sends to the camera, by the row of its cone
// (engine/light/cones.py) and the direction from the camera to it, of any length.

float cone_share(vec4 row, vec3 towards) {
    float along = clamp(row.w - dot(row.xyz, towards / max(length(towards), 1e-30)), 0.0, 1.0);
    return along * along;
}
