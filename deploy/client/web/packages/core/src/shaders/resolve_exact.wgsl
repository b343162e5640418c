// Each pixel's sorted run, composited front to back.
@group(0) @binding(0) var<storage, read> offsets: array<u32>;          // [P + 1]
@group(0) @binding(1) var<storage, read> pool: array<vec2u>;           // packed colour, depth bits
@group(0) @binding(2) var background: texture_2d<f32>;                 // gamma-2 encoded
@group(0) @binding(3) var<storage, read_write> shown: array<u32>;      // [P]

@compute @workgroup_size(64)
fn resolve_exact(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let p = thread_of(id, groups);
    if (p >= arrayLength(&shown)) {
        return;
    }
    var light = vec4f(0.0, 0.0, 0.0, 1.0);
    for (var i = offsets[p]; i < offsets[p + 1u]; i++) {
        light = behind(pool[i].x, light);
    }
    let root = texel_of(background, p).rgb;
    shown[p] = display_word(light.rgb + light.a * root * root, offsets[p + 1u] - offsets[p]);
}
