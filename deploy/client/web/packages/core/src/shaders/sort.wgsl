// Sorts each pixel's run by depth, then colour: heapsort, in place. `Slot` is declared before.
@group(0) @binding(0) var<storage, read> offsets: array<u32>;        // [P + 1]
@group(0) @binding(1) var<storage, read> cursors: array<u32>;        // [P], fragments captured
@group(0) @binding(2) var<storage, read_write> pool: array<Slot>;

// Puts a fragment into the heap of `count` fragments from `base` on whose place `hole` is free.
fn sift(base: u32, count: u32, hole: u32, fragment: Slot) {
    var place = hole;
    loop {
        var child = 2u * place + 1u;
        if (child >= count) {
            break;
        }
        if (child + 1u < count && comes_before(pool[base + child], pool[base + child + 1u])) {
            child++;
        }
        if (!comes_before(fragment, pool[base + child])) {
            break;
        }
        pool[base + place] = pool[base + child];
        place = child;
    }
    pool[base + place] = fragment;
}

@compute @workgroup_size(64)
fn sort_runs(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let p = thread_of(id, groups);
    if (p + 1u >= arrayLength(&offsets)) {
        return;
    }
    let base = offsets[p];
    let n = min(cursors[p], offsets[p + 1u] - base);
    for (var i = n / 2u; i > 0u; i--) {
        sift(base, n, i - 1u, pool[base + i - 1u]);
    }
    for (var last = n; last > 1u; last--) {
        let farthest = pool[base];
        sift(base, last - 1u, 0u, pool[base + last - 1u]);
        pool[base + last - 1u] = farthest;
    }
}
