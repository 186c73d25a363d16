#version 430 core
// Provides: rows of words put in their places in a buffer, a group a row.

layout(local_size_x = 64) in;
layout(std430, binding = 0) readonly buffer Sent { uint sent[]; };
layout(std430, binding = 1) readonly buffer Where { int where_to[]; };
layout(std430, binding = 2) writeonly buffer Target { uint target[]; };
uniform int n_sent;    // words of a row that is sent
uniform int n_target;  // of one in the buffer, as many or more

void main() {
    int row = int(gl_WorkGroupID.x), first = where_to[row] * n_target;
    for (int i = int(gl_LocalInvocationID.x); i < n_sent; i += 64) {
        target[first + i] = sent[row * n_sent + i];
    }
}
