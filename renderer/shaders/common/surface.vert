#version 450
// World-space triangles to clip space. Every geometry pass uses this one vertex shader, so that depth is
// bit-equal between passes: the two-pass chain matches fragments by it.
layout(location = 0) in vec3 in_position;
layout(location = 1) in vec3 in_normal;
layout(location = 2) in vec2 in_uv;
layout(location = 3) in vec4 in_colour;
#if MORE_UVS
layout(location = 4) in vec4 in_more_uvs;
out vec4 v_more_uvs;
#endif

uniform mat4 world_to_view;
uniform mat4 projection;

invariant gl_Position;
invariant out float v_depth;
#if GLASS
invariant out vec3 v_normal;  // alpha depends on it
#else
out vec3 v_normal;
#endif
out vec2 v_uv;
out vec4 v_colour;

void main() {
    precise vec4 view = world_to_view * vec4(in_position, 1.0);
    v_depth = -view.z;  // view-space distance along the axis, metres
    v_normal = mat3(world_to_view) * in_normal;
    v_uv = in_uv;
#if MORE_UVS
    v_more_uvs = in_more_uvs;
#endif
    v_colour = in_colour;
    gl_Position = projection * view;
}
