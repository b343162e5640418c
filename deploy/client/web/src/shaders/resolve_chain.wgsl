// Core front to back, then the tail, then the background (renderer/shaders/kbuffer/resolve.frag).
@group(0) @binding(0) var<storage, read> offsets: array<u32>;          // [P + 1]
@group(0) @binding(1) var<storage, read> colours: array<u32>;          // ~ of packed colours; 0: an empty slot
@group(0) @binding(2) var<storage, read> statistics: array<Statistics>;
@group(0) @binding(3) var<storage, read> gathered: array<u32>;         // [P][GATHERED]; the first is D
@group(0) @binding(4) var background: texture_2d<f32>;                 // gamma-2 encoded
@group(0) @binding(5) var tail: texture_2d<f32>;                       // sum w C, sum w
@group(0) @binding(6) var<storage, read_write> shown: array<u32>;      // [P]

// Colour of tail and background behind the core, all of it premultiplied by what the core lets through.
fn behind_core(p: u32, k: u32, core: f32, sums: vec4f, background: vec3f) -> vec3f {
    if (sums.a == 0.0) {
        return core * background;
    }
    let average = sums.rgb / sums.a;
    if (TAIL == PAPER || TAIL == WEIGHTED_AVERAGE) {  // w = a, so its sum is A: P = (1 - A / t)^t
        let t = f32(statistics[p].n - k);
        let through = pow(max(1.0 - sums.a / t, 0.0), t);
        let share = select(1.0 - through, 1.0, TAIL == PAPER);
        return core * (share * average + through * background);
    }
    let through = min(exp(-bitcast<f32>(gathered[GATHERED * p])), core);  // the whole list lets exp(-D) through
    return (core - through) * average + through * background;
}

@compute @workgroup_size(64)
fn resolve_chain(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let p = thread_of(id, groups);
    if (p >= arrayLength(&shown)) {
        return;
    }
    var light = vec4f(0.0, 0.0, 0.0, 1.0);
    var k = 0u;
    for (var i = offsets[p]; i < offsets[p + 1u]; i++) {
        if (colours[i] == 0u) {  // the pixel has fewer fragments than slots
            break;
        }
        light = behind(~colours[i], light);
        k++;
    }
    let root = texel_of(background, p).rgb;
    let rest = behind_core(p, k, light.a, texel_of(tail, p), root * root);
    shown[p] = display_word(light.rgb + rest, k);
}
