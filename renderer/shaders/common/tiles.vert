#version 450
// Two triangles over each listed tile of the window; those at its right and lower edge are clipped.
layout(location = 0) in vec2 in_tile;  // column and row of a tile
uniform vec2 tile_size;  // in clip space

void main() {
    const vec2 corner[6] = vec2[](vec2(0, 0), vec2(1, 0), vec2(0, 1), vec2(0, 1), vec2(1, 0), vec2(1, 1));
    gl_Position = vec4((in_tile + corner[gl_VertexID]) * tile_size - 1.0, 0.0, 1.0);
}
