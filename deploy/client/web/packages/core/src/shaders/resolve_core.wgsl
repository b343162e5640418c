// Each pixel's sorted core front to back, then the tail, then the background (renderer/shaders/kbuffer/resolve.frag).
@group(0) @binding(0) var<storage, read> offsets: array<u32>;          // [P + 1]
@group(0) @binding(1) var<storage, read> cursors: array<u32>;          // [P], fragments captured
@group(0) @binding(2) var<storage, read> pool: array<vec2u>;           // packed colour, depth bits
@group(0) @binding(3) var background: texture_2d<f32>;                 // gamma-2 encoded
@group(0) @binding(4) var sums: texture_2d<f32>;                       // sum w C, sum w
@group(0) @binding(5) var depths: texture_2d<f32>;                     // sum -ln(1 - a)
@group(0) @binding(6) var<storage, read_write> shown: array<u32>;      // [P]

@compute @workgroup_size(64)
fn resolve_core(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let p = thread_of(id, groups);
    if (p >= arrayLength(&shown)) {
        return;
    }
    var light = vec4f(0.0, 0.0, 0.0, 1.0);
    let k = min(cursors[p], offsets[p + 1u] - offsets[p]);
    for (var i = offsets[p]; i < offsets[p] + k; i++) {
        light = behind(pool[i].x, light);
    }
    let rest = tail_over(texel_of(sums, p), texel_of(depths, p).r, texel_of(background, p).rgb);
    shown[p] = display_word(light.rgb + light.a * rest, k);
}
