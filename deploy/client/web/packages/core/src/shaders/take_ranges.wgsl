// Ranges of tiles that were found in a texture.
@group(0) @binding(0) var tiles: texture_2d<f32>;                     // inverse of the nearest depth, farthest depth
@group(0) @binding(1) var<storage, read_write> ranges: array<vec2f>;  // [T], nearest and extent

@compute @workgroup_size(64)
fn take_ranges(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let tile = thread_of(id, groups);
    if (tile >= arrayLength(&ranges)) {
        return;
    }
    let found = texel_of(tiles, tile).rg;
    let nearest = 1.0 / max(found.x, 1e-9);
    ranges[tile] = vec2f(nearest, max(found.y - nearest, 0.0));
}
