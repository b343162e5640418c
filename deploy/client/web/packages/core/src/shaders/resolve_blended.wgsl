// The colour of all fragments as one weighted mean, with their total transmittance.
@group(0) @binding(0) var background: texture_2d<f32>;  // gamma-2 encoded
@group(0) @binding(1) var sums: texture_2d<f32>;        // sum w C, sum w
@group(0) @binding(2) var depths: texture_2d<f32>;      // optical depth
@group(0) @binding(3) var<storage, read_write> shown: array<u32>;

@compute @workgroup_size(64)
fn resolve_blended(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let p = thread_of(id, groups);
    if (p >= arrayLength(&shown)) {
        return;
    }
    shown[p] = display_word(tail_over(texel_of(sums, p), texel_of(depths, p).r, texel_of(background, p).rgb), 0u);
}
