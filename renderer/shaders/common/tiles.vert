#version 450
// Two triangles over each tile of the window that is asked for; those at its right and lower edge are clipped.
layout(location = 0) in uint in_most;  // fragments of the tile's fullest pixel
uniform uint least;      // of the tiles that are drawn
uniform uint greatest;
uniform int columns;
uniform vec2 tile_size;  // in clip space

void main() {
    const vec2 corner[6] = vec2[](vec2(0, 0), vec2(1, 0), vec2(0, 1), vec2(0, 1), vec2(1, 0), vec2(1, 1));
    vec2 tile = vec2(gl_InstanceID % columns, gl_InstanceID / columns);
    bool is_drawn = least <= in_most && in_most <= greatest;
    gl_Position = is_drawn ? vec4((tile + corner[gl_VertexID]) * tile_size - 1.0, 0.0, 1.0) : vec4(2.0, 2.0, 2.0, 1.0);
}
