// Core front to back, then the tail, then the background (renderer/shaders/kbuffer/resolve.frag).
@group(0) @binding(0) var<storage, read> offsets: array<u32>;          // [P + 1]
@group(0) @binding(1) var<storage, read> colours: array<u32>;          // ~ of packed colours; 0: an empty slot
@group(0) @binding(2) var<storage, read> kept: array<u32>;             // [P][WORDS]; the first is D
@group(0) @binding(3) var background: texture_2d<f32>;                 // gamma-2 encoded
@group(0) @binding(4) var tail: texture_2d<f32>;                       // sum w C, sum w
@group(0) @binding(5) var<storage, read_write> shown: array<u32>;      // [P]

@compute @workgroup_size(64)
fn resolve_chain(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let p = id.y * groups.x * 64u + id.x;
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
    let width = textureDimensions(background).x;
    let xy = vec2u(p % width, p / width);
    let root = textureLoad(background, xy, 0).rgb;
    let sums = textureLoad(tail, xy, 0);
    var colour = light.rgb + light.a * root * root;
    if (sums.a > 0.0) {  // what the whole list lets through is exp(-D)
        let through = min(exp(-bitcast<f32>(kept[WORDS * p])), light.a);
        colour = light.rgb + (light.a - through) / sums.a * sums.rgb + through * root * root;
    }
    shown[p] = display_word(colour, k);
}
