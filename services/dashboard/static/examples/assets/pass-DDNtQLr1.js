import{$t as e,A as t,B as n,C as r,D as i,E as a,F as o,G as s,H as c,I as l,K as u,L as d,M as f,N as p,O as ee,P as m,R as h,S as g,U as te,V as ne,W as re,_ as ie,_n as ae,a as _,b as oe,bn as v,c as se,d as y,en as b,f as x,g as ce,gn as le,h as ue,i as de,j as S,k as fe,l as pe,ln as me,lt as he,m as C,nn as ge,o as w,p as T,r as _e,s as ve,st as ye,tn as be,u as xe,v as Se,vn as Ce,w as E,x as we,y as Te,z as D,zt as O}from"./frame-Bmo7VneG.js";var k={"binned-8":{kind:`BINNED`,bins:8,shareLevels:255,meanLevels:255},"binned-12":{kind:`BINNED`,bins:12,shareLevels:255,meanLevels:255},"binned-16":{kind:`BINNED`,bins:16,shareLevels:255,meanLevels:255},"density-16":{kind:`BINNED`,bins:16,shareLevels:15,meanLevels:0},density:{kind:`DENSITY`,bins:0,shareLevels:0,meanLevels:0},"exact-coverage":{kind:`EXACT_COVERAGE`,bins:0,shareLevels:0,meanLevels:0},"weighted-average":{kind:`WEIGHTED_AVERAGE`,bins:0,shareLevels:0,meanLevels:0},paper:{kind:`PAPER`,bins:0,shareLevels:0,meanLevels:0}},Ee=`binned-12`,A={FULL:`255`,MOST_CORE:`1023`,RANKS:`256`,PRICE_STEPS:`8.0`,LEAST_PRICE:`-4.0`,LEAST_PRIOR:`-40.0`,LEAST_COVERED:`0.0001`,LEAST_ALONE:`0.001`,MOST_ALONE:`0.5`,LEAST_IMPORTANCE:`9.313225746154785e-10`,ROOT_SHARE:`0.6`,PLAIN_SHARE:`0.4`,OPTICAL_UNIT:`253`,BIN_LIMIT:`4095`,COUNT_LIMIT:`255`,RANGE_TILE:`8`,MOST_OPACITY:`16.0`,LEAST_OTHERS:`0.001`,LEAST_SPREAD:`0.001`,LUMA_R:`54`,LUMA_G:`183`,LUMA_B:`19`,LUMA_SHIFT:`6`,LUMA_SQUARE_SHIFT:`14`,MAX_EXPONENT:`60.0`},De=[`maxStorageBufferBindingSize`,`maxBufferSize`,`maxTextureDimension2D`],Oe=class e{device;description;blendsFloat32;#e=new Map;constructor(e,t){this.device=e,this.description=t,this.blendsFloat32=e.features.has(`float32-blendable`)}static async open(){if(!globalThis.isSecureContext)throw new v(`Browsers offer WebGPU on secure pages only.`,`Open this page by https, or as localhost.`);if(!navigator.gpu)throw new v(`This browser has no WebGPU.`,`Use a current Chrome, Edge, Safari or Firefox; on Linux WebGPU may have to be switched on in its settings.`);let t=await navigator.gpu.requestAdapter({powerPreference:`high-performance`});if(!t)throw new v(`The browser has WebGPU, but no graphics adapter for it.`,`Switch on hardware acceleration in the browser's settings, or update the graphics driver.`);let n={};for(let e of De)n[e]=t.limits[e];let r=[`float32-blendable`].filter(e=>t.features.has(e)),i=await t.requestDevice({requiredFeatures:r,requiredLimits:n}).catch(()=>{throw new v(`The browser has WebGPU, but cannot open the graphics device.`,`Load the page again.`)}),{vendor:a,architecture:o,description:s}=t.info;return new e(i,s||[a,o].filter(Boolean).join(` `)||`unknown adapter`)}static of(t){return new e(t,`a device that was opened elsewhere`)}get sumFormat(){return this.blendsFloat32?`rgba32float`:`rgba16float`}get scalarFormat(){return this.blendsFloat32?`r32float`:`r16float`}words(e){let t=4*Math.max(e,1),{maxStorageBufferBindingSize:n,maxBufferSize:r}=this.device.limits;j(t,Math.min(n,r),`Make the window smaller, or the budget.`);let{STORAGE:i,COPY_SRC:a,COPY_DST:o}=GPUBufferUsage;return this.device.createBuffer({size:t,usage:i|a|o})}filled(e,t){let n=Math.ceil(Math.max(e.byteLength,4)/4)*4;j(n,this.device.limits.maxBufferSize,`Open a smaller scene.`);let r=this.device.createBuffer({size:n,usage:t|GPUBufferUsage.COPY_DST,mappedAtCreation:!0}),i=new Uint8Array(e.buffer,e.byteOffset,e.byteLength);return new Uint8Array(r.getMappedRange()).set(i),r.unmap(),r}compute(e,t){let n=`${t}\n${e}`,r=this.#e.get(n);if(!r){let i=this.device.createShaderModule({code:e,label:t});r=this.device.createComputePipeline({label:t,layout:`auto`,compute:{module:i,entryPoint:t}}),this.#e.set(n,r)}return r}bind(e,t){return this.device.createBindGroup({layout:e.getBindGroupLayout(0),entries:ke(t)})}async read(e){let{MAP_READ:t,COPY_DST:n}=GPUBufferUsage,r=this.device.createBuffer({size:e.size,usage:t|n}),i=this.device.createCommandEncoder();i.copyBufferToBuffer(e,0,r,0,e.size),this.device.queue.submit([i.finish()]),await r.mapAsync(GPUMapMode.READ);let a=new Uint32Array(r.getMappedRange().slice(0));return r.destroy(),a}};function j(e,t,n){if(e<=t)return;let[r,i]=[Math.ceil(e/2**20),Math.floor(t/2**20)];throw new v(`A buffer of ${r} MiB is above this device's limit, ${i} MiB.`,n)}function ke(e){return e.map((e,t)=>({binding:t,resource:e instanceof GPUBuffer?{buffer:e}:e}))}function Ae(e){let t=Math.max(1,Math.ceil(e/64)),n=Math.min(t,1024);return[n,Math.ceil(t/n)]}var je=class extends Error{},M=class{gpu;isWanted;#e=null;constructor(e,t=()=>!0){this.gpu=e,this.isWanted=t}get encoder(){return this.#e??=this.gpu.device.createCommandEncoder()}submit(){this.#e&&this.gpu.device.queue.submit([this.#e.finish()]),this.#e=null}async pause(){if(this.submit(),await this.gpu.device.queue.onSubmittedWorkDone(),!this.isWanted())throw new je}},Me=`// Adds a fragment to its depth bin, one word, and its colour to its pixel's luma, another: one atomic exchange each
// (renderer/shaders/gather/bins.frag). \`words\`, [P][BINS], and \`luma\`, [P], are declared beside it, atomic.
fn units_in(optical_depth: f32) -> u32 {
    return u32(max(1.0, floor(optical_depth * OPTICAL_UNIT + 0.5)));
}

// What is full stays full. What others add meanwhile makes the exchange fail, and it is tried again.
fn add_to_bin(at: u32, units: u32, moment: u32) {
    var before = atomicLoad(&words[at]);
    loop {
        var sum = min(units_of(before) + units, BIN_LIMIT) << UNITS_SHIFT;
        sum |= min(moment_of(before) + moment, BIN_LIMIT) << MOMENT_SHIFT;
        sum |= min(fragments_of(before) + 1u, COUNT_LIMIT);
        if (sum == before) {
            return;
        }
        let tried = atomicCompareExchangeWeak(&words[at], before, sum);
        if (tried.exchanged) {
            return;
        }
        before = tried.old_value;
    }
}

// Whole numbers: what a network reads of colours is the same on every device, too.
fn add_luma(p: u32, units: u32, rgb: vec3u) {
    let own = (dot(rgb, vec3u(LUMA_R, LUMA_G, LUMA_B)) + 128u) >> 8u;
    let first = (units * own + (1u << (LUMA_SHIFT - 1))) >> LUMA_SHIFT;
    let second = (units * own * own + (1u << (LUMA_SQUARE_SHIFT - 1))) >> LUMA_SQUARE_SHIFT;
    var before = atomicLoad(&luma[p]);
    loop {
        let sum = (min((before >> 16u) + first, 0xffffu) << 16u) | min((before & 0xffffu) + second, 0xffffu);
        if (sum == before) {
            return;
        }
        let tried = atomicCompareExchangeWeak(&luma[p], before, sum);
        if (tried.exchanged) {
            return;
        }
        before = tried.old_value;
    }
}
`,Ne=`// Pixels of the window that every 64 triangles cover, those that overlap counted again: what drawing them will cost,
// known before the first of them is drawn.
@group(0) @binding(1) var<storage, read> positions: array<f32>;     // [vertices][3]
@group(0) @binding(2) var<storage, read> indices: array<u32>;       // [triangles][3]
@group(0) @binding(3) var<storage, read_write> areas: array<f32>;   // [groups]
var<workgroup> part: array<f32, 64>;

const PLANES = 5u;
const MOST_CORNERS = 3u + PLANES;  // each plane cuts off one and leaves two
struct Polygon {
    size: u32,
    corners: array<vec4f, MOST_CORNERS>,
}

// How far a point in clip space is inside of the window's edges and behind the near plane.
fn inside(plane: u32, corner: vec4f) -> f32 {
    switch plane {
        case 0u: { return corner.z; }
        case 1u: { return corner.w + corner.x; }
        case 2u: { return corner.w - corner.x; }
        case 3u: { return corner.w + corner.y; }
        default: { return corner.w - corner.y; }
    }
}

// What of a polygon is on the inner side of a plane (Sutherland and Hodgman 1974).
fn clipped(whole: Polygon, plane: u32) -> Polygon {
    var left: Polygon;
    for (var i = 0u; i < whole.size; i++) {
        let one = whole.corners[i];
        let two = whole.corners[(i + 1u) % whole.size];
        let here = inside(plane, one);
        let there = inside(plane, two);
        if (here >= 0.0) {
            left.corners[left.size] = one;
            left.size++;
        }
        if ((here >= 0.0) != (there >= 0.0)) {
            left.corners[left.size] = mix(one, two, here / (here - there));
            left.size++;
        }
    }
    return left;
}

fn window_position(corner: vec4f) -> vec2f {
    return 0.5 * corner.xy / corner.w * vec2f(camera.size);
}

fn corner_of(index: u32) -> vec4f {
    let at = 3u * indices[index];
    return clip_position(vec3f(positions[at], positions[at + 1u], positions[at + 2u]));
}

fn area_of(triangle: u32) -> f32 {
    var shape: Polygon;
    shape.size = 3u;
    for (var i = 0u; i < 3u; i++) {
        shape.corners[i] = corner_of(3u * triangle + i);
    }
    for (var plane = 0u; plane < PLANES; plane++) {
        shape = clipped(shape, plane);
    }
    var sum = 0.0;
    for (var i = 2u; i < shape.size; i++) {
        let base = window_position(shape.corners[0]);
        let one = window_position(shape.corners[i - 1u]) - base;
        let two = window_position(shape.corners[i]) - base;
        sum += 0.5 * abs(one.x * two.y - one.y * two.x);
    }
    return sum;
}

@compute @workgroup_size(64)
fn add_areas(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let place = group.y * groups.x + group.x;
    let triangle = 64u * place + lane;
    if (3u * triangle + 2u < arrayLength(&indices)) {
        part[lane] = area_of(triangle);
    }
    workgroupBarrier();
    if (lane > 0u || place >= arrayLength(&areas)) {
        return;
    }
    var sum = 0.0;
    for (var i = 0u; i < 64u; i++) {
        sum += part[i];
    }
    areas[place] = sum;
}
`,Pe=`// Whether there is anything to choose.
@group(0) @binding(0) var<storage, read_write> state: Cuts;
@group(0) @binding(1) var<uniform> budget: u32;

@compute @workgroup_size(1)
fn begin_cuts() {
    state.complete = select(0u, 1u, state.fragments <= budget);
}
`,Fe=`// A pixel's words, BINS of them side by side (renderer/shaders/common/bin_words.glsl). \`words\`, [P][BINS], is declared
// before.
// Gathered: word b is bin b. From the highest bits on: 12 of optical depth in units, 12 of the units times the position in
// the bin, 8 of fragments; each stops at its most, so that sums do not depend on the order.
// Packed: half of the words are what is kept of the bins (kept_bins.wgsl), a quarter the fragments of each, 8 bits a bin,
// and a quarter the rank of each, likewise.
const UNITS_SHIFT = 20u;
const MOMENT_SHIFT = 8u;

fn counts_at(p: u32, four: u32) -> u32 {
    return BINS * p + BINS / 2u + four;
}

fn ranks_at(p: u32, four: u32) -> u32 {
    return BINS * p + BINS / 2u + FOURS + four;
}

fn units_of(word: u32) -> u32 {
    return word >> UNITS_SHIFT;
}

fn moment_of(word: u32) -> u32 {
    return (word >> MOMENT_SHIFT) & BIN_LIMIT;
}

fn fragments_of(word: u32) -> u32 {
    return word & COUNT_LIMIT;
}
`,Ie=`// \`binned\`: every fragment into the tail's sums (renderer/shaders/binned/tail.frag).
@fragment
fn blend_tail(in: Surface) -> Tail {
    let stored = stored_surface(in);
    if (is_hidden(in) || !is_transparent(stored)) {
        discard;
        return Tail();
    }
    return tail_of(pixel_of(in), bitcast<f32>(depth_bits(in)), stored);
}
`,Le=`// Depth bins of the binned tails (METHOD.md section 2): renderer/shaders/common/depth_bins.glsl and tile_range.glsl.
fn tile_of(p: u32, width: u32) -> u32 {
    return p / width / RANGE_TILE * ((width + RANGE_TILE - 1) / RANGE_TILE) + p % width / RANGE_TILE;
}

// Bin and position in it, in [0, BINS]; range is nearest depth and extent.
fn bin_place(z: f32, range: vec2f) -> f32 {
    let x = select(0.0, clamp((z - range.x) / range.y, 0.0, 1.0), range.y > 0.0);
    return (PLAIN_SHARE * x + ROOT_SHARE * sqrt(x)) * f32(BINS);
}

fn bin_of(place: f32) -> u32 {
    return min(u32(place), BINS - 1u);
}
`,Re=`// Weighted-blended transparency (McGuire and Bavoil 2013), equation 10 with the logarithmic depth of
// renderer/techniques/weighted_blended.py.
struct Sums {
    @location(0) colours: vec4f,  // sum w a C, sum w a
    @location(1) depth: f32,      // sum -ln(1 - a)
}

// A power of two, of which the mean knows nothing: where targets are half floats, large weights would overflow.
const SCALE = 1.0 / 256.0;

fn depth_weight(z: f32) -> f32 {
    let d = log(z / camera.clip.x) / log(camera.clip.y / camera.clip.x);
    let free = 1.0 - clamp(d, 0.0, 1.0);
    return SCALE * max(1e-2, 3e3 * free * free * free);
}

@fragment
fn blend_sums(in: Surface) -> Sums {
    let stored = stored_surface(in);
    if (is_hidden(in) || !is_transparent(stored)) {
        discard;
        return Sums();
    }
    let a = f32(stored.a) / 255.0;
    let root = vec3f(stored.rgb) / 255.0;
    let weight = a * depth_weight(bitcast<f32>(depth_bits(in))) * a;  // w has a factor a, the colour is premultiplied
    return Sums(vec4f(weight * root * root, weight), -log(1.0 - a));
}
`,ze=`// Where a view is seen from.
struct Camera {
    world_to_view: mat4x4f,
    projection: mat4x4f,
    eye_ray: vec4f,  // scale and offset from window coordinates to x/-z and y/-z in view space
    up_view: vec4f,  // the scene's up axis in view space
    clip: vec2f,     // near and far distance, metres
    size: vec2u,     // width and height of the window, pixels
}

@group(0) @binding(0) var<uniform> camera: Camera;

fn clip_position(position: vec3f) -> vec4f {
    return camera.projection * (camera.world_to_view * vec4f(position, 1.0));
}
`,Be=`// Every transparent fragment into its pixel's run of the pool, in any order: the sort comes after
// (renderer/shaders/sbuffer/capture.frag). A cursor counts what its pixel has captured.
@group(2) @binding(0) var<storage, read> offsets: array<u32>;                 // [P + 1]
@group(2) @binding(1) var<storage, read_write> cursors: array<atomic<u32>>;   // [P]
@group(2) @binding(2) var<storage, read_write> pool: array<vec2u>;            // packed colour, depth bits

@fragment
fn capture(in: Surface) {
    let stored = stored_surface(in);
    if (is_hidden(in) || !is_transparent(stored)) {
        return;
    }
    let p = pixel_of(in);
    let at = offsets[p] + atomicAdd(&cursors[p], 1u);
    if (at < offsets[p + 1u]) {
        pool[at] = vec2u(pack(stored), depth_bits(in));
    }
}
`,Ve=`// Fragments of a pixel's first bins are appended to its core, the others go to the tail
// (renderer/shaders/kbuffer-deep/capture.frag). What a rounding brings beyond a run goes to the tail, too.
@group(2) @binding(2) var<storage, read> offsets: array<u32>;                // [P + 1]
@group(2) @binding(3) var<storage, read> cuts: array<u32>;                   // [P], bins of the core
@group(2) @binding(4) var<storage, read_write> cursors: array<atomic<u32>>;  // [P], fragments captured
@group(2) @binding(5) var<storage, read_write> pool: array<vec2u>;           // packed colour, depth bits

@fragment
fn capture_core(in: Surface) -> Tail {
    let stored = stored_surface(in);
    if (is_hidden(in) || !is_transparent(stored)) {
        discard;
        return Tail();
    }
    let p = pixel_of(in);
    let z = depth_bits(in);
    if (bin_of(bin_place(bitcast<f32>(z), ranges[tile_of(p, camera.size.x)])) < cuts[p]) {
        let at = offsets[p] + atomicAdd(&cursors[p], 1u);
        if (at < offsets[p + 1u]) {
            pool[at] = vec2u(pack(stored), z);
            discard;
            return Tail();
        }
    }
    return tail_of(p, bitcast<f32>(z), stored);
}
`,He=`// Second pass of the chain: every fragment finds its slot by its depth, or goes to the tail
// (renderer/shaders/kbuffer/chain_colour.frag). Depths and colours are kept inverted.
@group(2) @binding(2) var<storage, read> offsets: array<u32>;  // [P + 1]
@group(2) @binding(3) var<storage, read> depths: array<u32>;
@group(2) @binding(4) var<storage, read_write> colours: array<atomic<u32>>;

fn first_slot_not_nearer(first: u32, last: u32, z: u32) -> u32 {
    var begin = first;
    var end = last;
    while (begin < end) {
        let middle = (begin + end) >> 1u;
        if (depths[middle] > z) {
            begin = middle + 1u;
        } else {
            end = middle;
        }
    }
    return begin;
}

@fragment
fn chain_colour(in: Surface) -> Tail {
    let stored = stored_surface(in);
    if (is_hidden(in) || !is_transparent(stored)) {
        discard;
        return Tail();
    }
    let p = pixel_of(in);
    let end = offsets[p + 1u];
    let z = ~depth_bits(in);
    var word = ~pack(stored);
    for (var i = first_slot_not_nearer(offsets[p], end, z); i < end && depths[i] == z; i++) {
        let before = atomicMax(&colours[i], word);
        if (before == 0u) {  // it found a free slot: nothing is left for the tail
            discard;
            return Tail();
        }
        word = min(word, before);
    }
    return tail_of(p, bitcast<f32>(~z), unpack(~word));
}
`,Ue=`// First pass of the two-pass chain: the k(p) smallest depths, lock-free and in any order of arrival
// (renderer/shaders/kbuffer/chain_depth.frag). Depths are kept inverted, so that an empty slot is zero: each keeps the
// maximum of what passes it and hands the smaller value on.
@group(2) @binding(0) var<storage, read> offsets: array<u32>;  // [P + 1]
@group(2) @binding(1) var<storage, read_write> depths: array<atomic<u32>>;

@fragment
fn chain_depth(in: Surface) {
    let stored = stored_surface(in);
    if (is_hidden(in) || !is_transparent(stored)) {
        return;
    }
    let p = pixel_of(in);
    let end = offsets[p + 1u];
    var z = ~depth_bits(in);
    for (var i = offsets[p]; i < end; i++) {
        // A slot only ever rises, so a value read here that is not below z stays so: the atomic would change nothing.
        if (atomicLoad(&depths[i]) >= z) {
            continue;
        }
        let before = atomicMax(&depths[i], z);
        if (before == 0u) {
            break;
        }
        z = min(z, before);
    }
}
`,We=`// The rank that the budget ends in. One work group.
@group(0) @binding(0) var<storage, read_write> state: Cuts;
@group(0) @binding(1) var<storage, read> counted: array<u32>;  // [RANKS]
@group(0) @binding(2) var<uniform> budget: u32;
const OWN = RANKS / 256u;
var<workgroup> part: array<u32, 256>;

@compute @workgroup_size(256)
fn choose(@builtin(local_invocation_index) lane: u32) {
    var own = 0u;
    for (var i = 0u; i < OWN; i++) {
        own += counted[lane * OWN + i];
    }
    part[lane] = own;
    workgroupBarrier();
    var before = 0u;
    for (var i = 0u; i < lane; i++) {
        before += part[i];
    }
    // Exactly one thread's run has the first number with which it is too much.
    if (state.complete == 0u && before <= budget && before + own > budget) {
        var i = lane * OWN;
        for (; before + counted[i] <= budget; i++) {
            before += counted[i];
        }
        state.rank = i;
    }
}
`,Ge=`// Fragments that can be in a core.
@group(0) @binding(0) var<storage, read> words: array<u32>;                   // [P][BINS]
@group(0) @binding(1) var<storage, read_write> fragments: array<atomic<u32>>;  // the first member of Cuts
var<workgroup> found: atomic<u32>;

@compute @workgroup_size(256)
fn total_cores(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    for (var i = 0u; i < BLOCK / 256u; i++) {
        let p = group.x * BLOCK + i * 256u + lane;
        var before = 0u;
        for (var bin = 0u; bin < BINS && BINS * p < arrayLength(&words); bin++) {
            let own = usable_in(p, bin, before);
            if (own == FULL) {
                break;
            }
            before += own;
        }
        atomicAdd(&found, before);
    }
    workgroupBarrier();
    if (lane == 0u) {
        atomicAdd(&fragments[0], atomicLoad(&found));
    }
}
`,Ke=`// n(p), the transparent fragments of every pixel.
@group(2) @binding(0) var<storage, read_write> n: array<atomic<u32>>;

@fragment
fn count_fragments(in: Surface) {
    let stored = stored_surface(in);
    if (is_hidden(in) || !is_transparent(stored)) {
        return;
    }
    atomicAdd(&n[pixel_of(in)], 1u);
}
`,qe=`// Fragments by the rank of the price that they come at.
@group(0) @binding(0) var<storage, read> words: array<u32>;                   // [P][BINS]
@group(0) @binding(1) var<storage, read> state: Cuts;
@group(0) @binding(2) var<storage, read_write> counted: array<atomic<u32>>;   // [RANKS]
var<workgroup> own_counted: array<atomic<u32>, RANKS>;

fn add_events(p: u32) {
    var before = 0u;
    for (var bin = 0u; bin < BINS; bin++) {
        let own = usable_in(p, bin, before);
        if (own == FULL) {
            break;
        }
        if (own == 0u) {
            continue;
        }
        atomicAdd(&own_counted[rank_in(p, bin)], own);
        before += own;
    }
}

@compute @workgroup_size(256)
fn count_prices(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    for (var i = 0u; i < BLOCK / 256u; i++) {
        let p = group.x * BLOCK + i * 256u + lane;
        if (BINS * p < arrayLength(&words) && state.complete == 0u) {
            add_events(p);
        }
    }
    workgroupBarrier();
    for (var i = lane; i < RANKS; i += 256u) {
        let sum = atomicLoad(&own_counted[i]);
        if (sum > 0u) {
            atomicAdd(&counted[i], sum);
        }
    }
}
`,Je=`// A triangle that covers the window.
@vertex
fn cover(@builtin(vertex_index) corner: u32) -> @builtin(position) vec4f {
    return vec4f(select(-1.0, 3.0, corner == 1u), select(-1.0, 3.0, corner == 2u), 0.0, 1.0);
}
`,Ye=`// What the passes of a selection of cuts tell each other (renderer/shaders/allocation/state.glsl).
struct Cuts {
    fragments: u32,  // that can be in a core
    complete: u32,   // 1 where the budget covers them: nothing is predicted or selected
    rank: u32,       // of the price that all pixels are granted, plus 1: what grows there takes what is left
    sure: u32,       // fragments below it
}
`,Xe=`// A pixel's packed bins as a selection of cuts sees them (renderer/shaders/allocation/bins.glsl). \`words\`, [P][BINS], is
// declared before.
fn count_of(p: u32, bin: u32) -> u32 {
    return (words[counts_at(p, bin / 4u)] >> (8u * (bin & 3u))) & FULL;
}

// Fragments of all bins, as far as they are known.
fn known_fragments(p: u32) -> u32 {
    var sum = 0u;
    for (var bin = 0u; bin < BINS; bin++) {
        sum += count_of(p, bin);
    }
    return sum;
}

// Fragments of a bin that can be in a core behind \`before\` others; FULL where it cannot, nor can those behind it.
fn usable_in(p: u32, bin: u32, before: u32) -> u32 {
    let own = count_of(p, bin);
    return select(own, FULL, before + own > MOST_CORE);
}

// Of the price that a bin comes at (prices.wgsl).
fn rank_in(p: u32, bin: u32) -> u32 {
    return (words[ranks_at(p, bin / 4u)] >> (8u * (bin & 3u))) & (RANKS - 1u);
}
`,Ze=`// Sum of squared differences of two pictures' sRGB bytes, by block: integers, so exact. 2048 pixels fit a word.
@group(0) @binding(0) var<storage, read> one: array<u32>;
@group(0) @binding(1) var<storage, read> two: array<u32>;
@group(0) @binding(2) var<storage, read_write> squares: array<u32>;  // [blocks]
var<workgroup> sum: atomic<u32>;

@compute @workgroup_size(256)
fn add_squares(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    var own = 0u;
    for (var i = 0u; i < BLOCK / 256u; i++) {
        let p = group.x * BLOCK + i * 256u + lane;
        if (p < arrayLength(&one)) {
            for (var shift = 0u; shift < 24u; shift += 8u) {
                let apart = i32((one[p] >> shift) & 255u) - i32((two[p] >> shift) & 255u);
                own += u32(apart * apart);
            }
        }
    }
    atomicAdd(&sum, own);
    workgroupBarrier();
    if (lane == 0u) {
        squares[group.x] = atomicLoad(&sum);
    }
}
`,Qe=`// What a screen gets of linear light: one word a pixel, sRGB in three bytes and in the highest one k, up to 255.
fn encoded(linear: vec3f) -> vec3u {
    let c = clamp(linear, vec3f(0.0), vec3f(1.0));
    let curved = 1.055 * pow(c, vec3f(1.0 / 2.4)) - 0.055;
    return vec3u(select(curved, 12.92 * c, c <= vec3f(0.0031308)) * 255.0 + 0.5);
}

fn display_word(linear: vec3f, k: u32) -> u32 {
    let rgb = encoded(linear);
    return rgb.r | (rgb.g << 8u) | (rgb.b << 16u) | (min(k, 255u) << 24u);
}

fn decoded(word: u32) -> vec3f {
    let root = vec3f(vec3u(word, word >> 8u, word >> 16u) & vec3u(255u)) / 255.0;
    return root * root;
}

// One more fragment behind those that are composited; light is premultiplied RGB and what they let through.
fn behind(word: u32, light: vec4f) -> vec4f {
    let a = f32(word >> 24u) / 255.0;
    return vec4f(light.rgb + light.a * a * decoded(word), light.a * (1.0 - a));
}

// The mean of a tail's sums over the background as it is stored, by what the tail lets through.
fn tail_over(sums: vec4f, depth: f32, root: vec3f) -> vec3f {
    if (sums.a == 0.0) {
        return root * root;
    }
    let through = exp(-depth);
    return (1.0 - through) * (sums.rgb / sums.a) + through * root * root;
}
`,$e=`// Tiles whose centre no surface covers get the range of those around them, else that of the whole view
// (renderer/shaders/range/fill.comp). One work group.
@group(0) @binding(0) var<storage, read> found: array<vec2u>;            // [T], ~ nearest, farthest, float bits
@group(0) @binding(1) var<storage, read_write> ranges: array<vec2f>;     // [T], nearest and extent, metres
@group(0) @binding(2) var<uniform> grid: vec2u;                          // columns, rows
var<workgroup> part: array<vec2u, 256>;

fn around(tile: u32) -> vec2u {
    let at = vec2i(vec2u(tile % grid.x, tile / grid.x));
    var range = vec2u(0u);
    for (var y = max(at.y - 1, 0); y <= min(at.y + 1, i32(grid.y) - 1); y++) {
        for (var x = max(at.x - 1, 0); x <= min(at.x + 1, i32(grid.x) - 1); x++) {
            range = max(range, found[u32(y) * grid.x + u32(x)]);
        }
    }
    return range;
}

@compute @workgroup_size(256)
fn fill_ranges(@builtin(local_invocation_index) lane: u32) {
    let tiles = grid.x * grid.y;
    var whole = vec2u(0u);
    for (var tile = lane; tile < tiles; tile += 256u) {
        whole = max(whole, found[tile]);
    }
    part[lane] = whole;
    workgroupBarrier();
    for (var i = 0u; i < 256u; i++) {
        whole = max(whole, part[i]);
    }
    for (var tile = lane; tile < tiles; tile += 256u) {
        var range = found[tile];
        if (range.y == 0u) {
            range = around(tile);
        }
        if (range.y == 0u) {
            range = whole;
        }
        var ends = vec2f(0.0);
        if (range.y > 0u) {
            ends = bitcast<vec2f>(vec2u(~range.x, range.y));
        }
        ranges[tile] = vec2f(ends.x, ends.y - ends.x);
    }
}
`,et=`// What every pixel gets below the chosen rank, and with what comes at it.
@group(0) @binding(0) var<storage, read> words: array<u32>;               // [P][BINS]
@group(0) @binding(1) var<storage, read> state: Cuts;
@group(0) @binding(2) var<storage, read_write> cuts: array<u32>;          // [P], 5, 10, 5 and 10 bits
@group(0) @binding(3) var<storage, read_write> sums: array<vec2u>;        // [blocks], granted and growth
var<workgroup> sure: atomic<u32>;
var<workgroup> growth: atomic<u32>;

// Bins and fragments that are granted, and the same with those that come at the rank itself.
fn cut_of(p: u32) -> vec4u {
    var cut = vec4u(0u);
    var before = 0u;
    for (var bin = 0u; bin < BINS; bin++) {
        let own = usable_in(p, bin, before);
        if (own == FULL) {
            break;
        }
        if (own == 0u) {
            continue;
        }
        var found = 0u;
        if (state.complete == 0u) {
            found = rank_in(p, bin);
            if (found > state.rank) {
                break;
            }
        }
        before += own;
        cut.z = bin + 1u;
        cut.w = before;
        if (state.complete == 1u || found < state.rank) {
            cut.x = cut.z;
            cut.y = before;
        }
    }
    return cut;
}

@compute @workgroup_size(256)
fn find_cuts(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    for (var i = 0u; i < BLOCK / 256u; i++) {
        let p = group.x * BLOCK + i * 256u + lane;
        if (p < arrayLength(&cuts)) {
            let cut = cut_of(p);
            cuts[p] = cut.x | (cut.y << 5u) | (cut.z << 15u) | (cut.w << 20u);
            atomicAdd(&sure, cut.y);
            atomicAdd(&growth, cut.w - cut.y);
        }
    }
    workgroupBarrier();
    if (lane == 0u) {
        sums[group.x] = vec2u(atomicLoad(&sure), atomicLoad(&growth));
    }
}
`,tt=`// Offsets of the fixed k-buffer: the same number of slots for every pixel of the window.
@group(0) @binding(0) var<storage, read_write> offsets: array<u32>;  // [P + 1]
@group(0) @binding(1) var<uniform> budget: u32;

@compute @workgroup_size(64)
fn place_fixed(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let p = thread_of(id, groups);
    if (p < arrayLength(&offsets)) {
        offsets[p] = p * (budget / (arrayLength(&offsets) - 1u));
    }
}
`,nt=`// Every fragment into its depth bin; for a network, its colour as well (renderer/shaders/gather/bins.frag).
@group(2) @binding(0) var<storage, read> ranges: array<vec2f>;             // [T]
@group(2) @binding(1) var<storage, read_write> words: array<atomic<u32>>;  // [P][BINS]
@group(2) @binding(2) var<storage, read_write> luma: array<atomic<u32>>;   // [P], sums of luma and of its square

// The fragment's units, where it was added.
fn gather(in: Surface, stored: vec4u) -> u32 {
    let p = pixel_of(in);
    let place = bin_place(bitcast<f32>(depth_bits(in)), ranges[tile_of(p, camera.size.x)]);
    let bin = bin_of(place);
    let units = units_in(-log(1.0 - f32(stored.a) / 255.0));
    add_to_bin(BINS * p + bin, units, u32(f32(units) * (place - f32(bin)) + 0.5));
    return units;
}

// For the tail alone.
@fragment
fn gather_tail(in: Surface) {
    let stored = stored_surface(in);
    if (is_hidden(in) || !is_transparent(stored)) {
        return;
    }
    _ = gather(in, stored);
}

// For a network as well.
@fragment
fn gather_all(in: Surface) {
    let stored = stored_surface(in);
    if (is_hidden(in) || !is_transparent(stored)) {
        return;
    }
    add_luma(pixel_of(in), gather(in, stored), stored.rgb);
}
`,rt=`// A fragment in a pool: depth bits; red and green, blue and opacity, as half floats.
struct Slot {
    depth: u32,
    front: u32,
    back: u32,
}

fn comes_before(one: Slot, two: Slot) -> bool {
    if (one.depth != two.depth) {
        return one.depth < two.depth;
    }
    return one.front < two.front || (one.front == two.front && one.back < two.back);
}
`,it=`// What the depth bins know to be in front of a fragment (renderer/shaders/kbuffer/tail.glsl).
// Optical depth in front of a fragment: all of the bins before its own, and of its own bin's others as much as lies
// before it if they are spread evenly around their mean.
fn in_front(p: u32, place: f32, own: f32) -> f32 {
    let bin = bin_of(place);
    let total = optical_depth_at(p);
    let s = place - f32(bin);
    let word = kept_word(p, bin);
    let is_last = bin == BINS - 1u;
    var before = 0.0;
    if (bin > 0u) {
        before = total * share_behind(kept_word(p, bin - 1u));
    }
    let within = select(total * share_behind(word), total, is_last) - before;
    let others = max(within - own, 0.0);
    var middle = 0.5;
    if (others > LEAST_OTHERS) {
        middle = clamp((within * select(mean_in(word), 0.5, is_last) - own * s) / others, 0.0, 1.0);
    }
    let spread = max(min(middle, 1.0 - middle), LEAST_SPREAD);
    return before + others * clamp((s - (middle - spread)) / (2.0 * spread), 0.0, 1.0);
}
`,at=`// From the blocks' totals to the view's. One work group.
@group(0) @binding(0) var<storage, read> blocks: array<vec3u>;             // fragments, occupied, deepest
@group(0) @binding(1) var<storage, read_write> counted: array<u32>;        // the same of the view
var<workgroup> part: array<vec3u, 256>;

const CEILING = 0x7fffffffu;  // sums of fragments stop here, above any budget

fn joined(one: vec3u, two: vec3u) -> vec3u {
    return vec3u(min(one.x + two.x, CEILING), one.y + two.y, max(one.z, two.z));
}

@compute @workgroup_size(256)
fn join(@builtin(local_invocation_index) lane: u32) {
    var own = vec3u(0u);
    for (var block = lane; block < arrayLength(&blocks); block += 256u) {
        own = joined(own, blocks[block]);
    }
    part[lane] = own;
    workgroupBarrier();
    if (lane > 0u) {
        return;
    }
    for (var i = 1u; i < 256u; i++) {
        own = joined(own, part[i]);
    }
    counted[0] = own.x;
    counted[1] = own.y;
    counted[2] = own.z;
}
`,ot=`// What is kept of a pixel's depth bins, 16 bits each, two a word, and what it says of a fragment
// (renderer/shaders/common/kept_bins.glsl). \`words\`, [P][BINS], is declared before.
fn kept_word(p: u32, bin: u32) -> u32 {
    return (words[BINS * p + bin / 2u] >> (16u * (bin & 1u))) & 0xffffu;
}

fn optical_depth_at(p: u32) -> f32 {
    return f32(kept_word(p, BINS - 1u)) / OPTICAL_UNIT;
}

// Of a bin's word: the share of D in front of the next bin.
fn share_behind(word: u32) -> f32 {
    return f32(word >> 8u) / f32(SHARE_LEVELS);
}

// Of a bin's word: the mean position of its optical depth in it.
fn mean_in(word: u32) -> f32 {
    return select(0.5, f32(word & 255u) / f32(max(MEAN_LEVELS, 1)), MEAN_LEVELS > 0);
}
`,st=`// The next smaller level of a texture. The texture unit decodes and encodes sRGB: it is light that is averaged.
@group(0) @binding(0) var finer: texture_2d<f32>;
@group(0) @binding(1) var smooth_sampler: sampler;

@fragment
fn halve(@builtin(position) position: vec4f) -> @location(0) vec4f {
    let size = max(textureDimensions(finer) / 2u, vec2u(1u));
    return textureSample(finer, smooth_sampler, position.xy / vec2f(size));
}
`,ct=`// The background of every technique: opaque fragments only, stored gamma-2 like the transparent ones.
@fragment
fn opaque_colour(in: Surface) -> @location(0) vec4f {
    let stored = stored_surface(in);
    if (stored.a < 255u) {
        discard;
    }
    return vec4f(stored) / 255.0;
}
`,lt=`// What is kept of every pixel's gathered depth bins, and the fragments of each, in their place
// (renderer/shaders/gather/pack.comp): of bin b the share of optical depth in front of the next one, times 256, and its mean
// position; of the last one D in units.
@group(0) @binding(0) var<storage, read_write> words: array<u32>;  // [P][BINS]

// \`part / whole\` in steps of 1 / levels, to the nearest.
fn level(part: u32, whole: u32, levels: u32) -> u32 {
    return select(min((2u * levels * part + whole) / max(2u * whole, 1u), levels), 0u, whole == 0u);
}

@compute @workgroup_size(64)
fn pack_bins(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let p = thread_of(id, groups);
    if (BINS * p >= arrayLength(&words)) {
        return;
    }
    var gathered: array<u32, BINS>;
    var total = 0u;
    for (var b = 0u; b < BINS; b++) {
        gathered[b] = words[BINS * p + b];
        total += units_of(gathered[b]);
    }
    if (total == 0u) {
        return;  // all words stay zero
    }
    var front = 0u;
    var low = 0u;
    for (var b = 0u; b < BINS; b++) {
        let own = units_of(gathered[b]);
        front += own;
        var kept = level(front, total, SHARE_LEVELS) << 8u;
        if (MEAN_LEVELS > 0) {
            kept |= level(moment_of(gathered[b]), own, MEAN_LEVELS);
        }
        if (b == BINS - 1u) {
            kept = total;
        }
        if ((b & 1u) == 0u) {
            low = kept;
        } else {
            words[BINS * p + b / 2u] = low | (kept << 16u);
        }
    }
    for (var i = 0u; i < FOURS; i++) {
        var four = 0u;
        for (var j = 0u; j < 4u; j++) {
            four |= fragments_of(gathered[4u * i + j]) << (8u * j);
        }
        words[counts_at(p, i)] = four;
    }
}
`,ut=`// What the passes over pixels share: a pixel for each thread, 64 a group, in two dimensions.
fn thread_of(id: vec3u, groups: vec3u) -> u32 {
    return id.y * groups.x * 64u + id.x;
}

// Of a picture, at a pixel.
fn texel_of(picture: texture_2d<f32>, p: u32) -> vec4f {
    let width = textureDimensions(picture).x;
    return textureLoad(picture, vec2u(p % width, p / width), 0);
}
`,dt=`// Where each pixel's run of slots begins if every fragment has one.
@group(0) @binding(0) var<storage, read> n: array<u32>;                 // [P]
@group(0) @binding(1) var<storage, read> sums: array<vec2u>;            // [blocks], before each
@group(0) @binding(2) var<storage, read_write> offsets: array<u32>;     // [P + 1]
const OWN = BLOCK / 256u;
var<workgroup> part: array<u32, 256>;

@compute @workgroup_size(256)
fn place_all(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let first = group.x * BLOCK + lane * OWN;
    var here: array<u32, OWN>;
    var own = 0u;
    for (var i = 0u; i < OWN; i++) {
        if (first + i < arrayLength(&n)) {
            here[i] = min(n[first + i], TURNS);
        }
        own += here[i];
    }
    part[lane] = own;
    for (var reach = 1u; reach < 256u; reach *= 2u) {
        workgroupBarrier();
        var other = 0u;
        if (lane >= reach) {
            other = part[lane - reach];
        }
        workgroupBarrier();
        part[lane] += other;
    }
    var before = sums[group.x].x + part[lane] - own;
    for (var i = 0u; i < OWN; i++) {
        if (first + i < arrayLength(&offsets)) {
            offsets[first + i] = before;
        }
        before += here[i];
    }
}
`,ft=`// Where each pixel's core begins in the pool. What is left of the budget goes to the pixels that grow at the chosen rank,
// by index; the first that does not fit takes what does (renderer/shaders/allocation/place.comp). No run reaches beyond the
// budget.
@group(0) @binding(0) var<storage, read> total: array<u32>;            // the last one: fragments granted
@group(0) @binding(1) var<storage, read_write> cuts: array<u32>;       // [P], as they were found; then bins of the core
@group(0) @binding(2) var<storage, read> sums: array<vec2u>;           // [blocks], before each
@group(0) @binding(3) var<storage, read_write> offsets: array<u32>;    // [P + 1]
@group(0) @binding(4) var<uniform> budget: u32;
@group(0) @binding(5) var<storage, read> words: array<u32>;            // [P][BINS]
const OWN = BLOCK / 256u;
var<workgroup> part: array<vec2u, 256>;

// Bins of a pixel that may grow by so many fragments and no more.
fn bins_within(p: u32, cut: u32, room: u32) -> u32 {
    var bins = cut & 31u;
    var taken = 0u;
    let end = (cut >> 15u) & 31u;
    for (var bin = bins; bin < end; bin++) {
        let own = count_of(p, bin);
        taken += own;
        if (taken > room) {
            break;
        }
        if (own > 0u) {
            bins = bin + 1u;
        }
    }
    return bins;
}

@compute @workgroup_size(256)
fn place_cuts(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let first = group.x * BLOCK + lane * OWN;
    var here: array<u32, OWN>;
    var own = vec2u(0u);
    for (var i = 0u; i < OWN; i++) {
        if (first + i < arrayLength(&cuts)) {
            here[i] = cuts[first + i];
        }
        let granted = (here[i] >> 5u) & 0x3ffu;
        own += vec2u(granted, (here[i] >> 20u) - granted);
    }
    part[lane] = own;
    for (var reach = 1u; reach < 256u; reach *= 2u) {
        workgroupBarrier();
        var other = vec2u(0u);
        if (lane >= reach) {
            other = part[lane - reach];
        }
        workgroupBarrier();
        part[lane] += other;
    }
    var before = sums[group.x] + part[lane] - own;
    let spare = budget - min(budget, total[arrayLength(&total) - 1u]);
    for (var i = 0u; i < OWN; i++) {
        if (first + i < arrayLength(&offsets)) {
            offsets[first + i] = min(before.x + min(before.y, spare), budget);
        }
        let granted = (here[i] >> 5u) & 0x3ffu;
        let growth = (here[i] >> 20u) - granted;
        if (first + i < arrayLength(&cuts)) {
            var bins = here[i] & 31u;
            if (before.y + growth <= spare) {
                bins = (here[i] >> 15u) & 31u;
            } else if (before.y < spare) {
                bins = bins_within(first + i, here[i], spare - before.y);
            }
            cuts[first + i] = bins;
        }
        before += vec2u(granted, growth);
    }
}
`,pt=`// The two pictures beside each other, or what one wants to know of them.
struct Shown {
    split: f32,   // column where the right one begins
    what: u32,    // 0: the picture, 1: k, 2: difference to the exact picture
    width: u32,
}

@group(0) @binding(0) var<uniform> wanted: Shown;
@group(0) @binding(1) var<storage, read> left: array<u32>;
@group(0) @binding(2) var<storage, read> right: array<u32>;
@group(0) @binding(3) var<storage, read> exact: array<u32>;

// Colour maps of evaluation/report/colours.py: sRGB anchors, interpolated linearly.
const COUNT = array<vec3f, 8>(
    vec3f(68, 1, 84), vec3f(70, 50, 127), vec3f(54, 92, 141), vec3f(39, 127, 142),
    vec3f(31, 161, 135), vec3f(74, 194, 109), vec3f(159, 218, 58), vec3f(253, 231, 37),
);
const HEAT = array<vec3f, 8>(
    vec3f(0, 0, 4), vec3f(40, 12, 84), vec3f(101, 21, 110), vec3f(159, 42, 99),
    vec3f(212, 72, 66), vec3f(245, 125, 21), vec3f(250, 193, 39), vec3f(252, 255, 164),
);

fn mapped(anchors: array<vec3f, 8>, x: f32) -> vec3f {
    var table = anchors;
    let at = clamp(x, 0.0, 1.0) * 7.0;
    let low = min(u32(at), 6u);
    return mix(table[low], table[low + 1u], at - f32(low)) / 255.0;
}

fn bytes(word: u32) -> vec3f {
    return vec3f(vec3u(word, word >> 8u, word >> 16u) & vec3u(255u));
}

@fragment
fn present(@builtin(position) position: vec4f) -> @location(0) vec4f {
    let p = u32(position.y) * wanted.width + u32(position.x);
    var word = right[p];
    if (position.x < wanted.split) {
        word = left[p];
    }
    var colour = bytes(word) / 255.0;
    if (wanted.what == 1u) {
        colour = mapped(COUNT, log2(1.0 + f32(word >> 24u)) / 6.0);  // 63 is full
    } else if (wanted.what == 2u) {
        let apart = abs(bytes(word) - bytes(exact[p]));
        colour = mapped(HEAT, max(max(apart.r, apart.g), apart.b) / 32.0);
    }
    if (abs(position.x - wanted.split) < 1.0) {
        colour = vec3f(0.5);
    }
    return vec4f(colour, 1.0);
}
`,mt=`// The bundle's network on every occupied pixel: what it answers of each bin becomes the rank of the bin's price
// (renderer/shaders/kbuffer-deep/prices.comp and inputs.glsl, allocation/prices.glsl).
@group(0) @binding(0) var<storage, read_write> words: array<u32>;  // [P][BINS], packed
@group(0) @binding(1) var<storage, read> state: Cuts;
@group(0) @binding(2) var<storage, read> ranges: array<vec2f>;     // [T]
@group(0) @binding(3) var<storage, read> luma: array<u32>;         // [P], sums of luma and of its square
@group(0) @binding(4) var background: texture_2d<f32>;

fn sums_of(p: u32, fragments: u32) -> array<vec4f, TEXELS> {
    let range = ranges[tile_of(p, textureDimensions(background).x)];
    var s: array<vec4f, TEXELS>;
    s[0] = vec4f(f32(fragments), optical_depth_at(p), range.x, range.x + range.y);
    s[1] = vec4f(texel_of(background, p).rgb, 0.0);
    let unit = vec2f(f32(1u << LUMA_SHIFT) / 255.0, f32(1u << LUMA_SQUARE_SHIFT) / (255.0 * 255.0)) / OPTICAL_UNIT;
    s[2] = vec4f(vec2f(vec2u(luma[p] >> 16u, luma[p] & 0xffffu)) * unit, 0.0, 0.0);
    for (var b = 0u; b < BINS - 1u; b++) {
        let word = kept_word(p, b);
        s[3u + b / 4u][b % 4u] = share_behind(word);
        if (MEAN_LEVELS > 0) {
            s[7u + b / 4u][b % 4u] = mean_in(word);
        }
    }
    return s;
}

// What the tail tells of the log gain of one bin: n fragments, an optical depth \`own\` behind \`before\`; \`whole\` is the
// pixel's.
fn prior_gain(n: f32, own: f32, before: f32, whole: f32) -> f32 {
    let covered = max(1.0 - exp(-own), LEAST_COVERED);
    let wrong = clamp(whole * (0.5 / f32(SHARE_LEVELS)), LEAST_ALONE, MOST_ALONE);
    let alone = select(0.0, 2.0 * log(wrong), n == 1.0);
    return max(2.0 * (log(covered) - before) - log(n) + alone, LEAST_PRIOR);
}

// By its bits, because a compiler may take it that a comparison never meets NaN.
fn is_nan(x: f32) -> bool {
    return (bitcast<u32>(x) & 0x7fffffffu) > 0x7f800000u;
}

// NaN, of a network that overflows, comes last.
fn rank_of(price: f32) -> u32 {
    let steps = (price - LEAST_PRICE) * PRICE_STEPS;
    return select(u32(clamp(steps + 0.5, 0.0, f32(RANKS - 1))), RANKS - 1u, is_nan(price));
}

@compute @workgroup_size(64)
fn predict_ranks(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let p = thread_of(id, groups);
    if (BINS * p >= arrayLength(&words) || state.complete == 1u) {
        return;
    }
    let fragments = known_fragments(p);
    if (fragments == 0u) {
        return;
    }
    var answer = diaphane_predict(diaphane_features(sums_of(p, fragments)));
    let last = answer.y[DIAPHANE_OUTPUTS - 1];  // the weight of what the tail tells, or an importance
    let weight = select(max(last, LEAST_IMPORTANCE), LEAST_IMPORTANCE, is_nan(last));
    let whole = optical_depth_at(p);
    var ranks: array<u32, FOURS>;
    var rank = 0u;
    var in_front = 0.0;
    var before = 0.0;
    for (var bin = 0u; bin < BINS; bin++) {
        let n = f32(count_of(p, bin));
        let behind = whole * select(share_behind(kept_word(p, bin)), 1.0, bin == BINS - 1u);
        var price = 2.0 * log((in_front + 0.5 * n + 0.5) / weight);
        if (DIAPHANE_OUTPUTS > 1) {
            price = -(answer.y[bin] + last * prior_gain(max(n, 1.0), max(behind - before, 0.0), before, whole));
        }
        if (n > 0.0) {
            rank = max(rank, rank_of(price));
        }
        ranks[bin / 4u] |= rank << (8u * (bin & 3u));
        in_front += n;
        before = behind;
    }
    for (var i = 0u; i < FOURS; i++) {
        words[ranks_at(p, i)] = ranks[i];
    }
}
`,ht=`// An estimate of the depths between which each tile's fragments lie, at a quarter of the resolution: STEPS pixels across
// a tile (renderer/shaders/range/range.frag). The near ends are kept inverted, so that cleared buffers begin at zero.
@group(2) @binding(0) var<storage, read_write> found: array<atomic<u32>>;  // [T][2]
const STEPS = 2u;

@fragment
fn find_range(in: Surface) {
    let stored = stored_surface(in);
    let depth = 1.0 / in.position.w;
    let slope = abs(dpdxFine(depth)) + abs(dpdyFine(depth));
    if (!is_transparent(stored)) {
        return;
    }
    // Across a silhouette the slope says nothing: no surface falls by a twentieth of its distance within a tile.
    let reach = min(0.5 * slope, 0.05 * depth);
    // Where a triangle that reaches behind the eye is interpolated beyond its edges; such bits would be the greatest.
    if (!(depth > 0.0)) {
        return;
    }
    let columns = (camera.size.x + RANGE_TILE - 1) / RANGE_TILE;
    let tile = u32(in.position.y) / STEPS * columns + u32(in.position.x) / STEPS;
    atomicMax(&found[2u * tile], ~bitcast<u32>(depth - reach));
    atomicMax(&found[2u * tile + 1u], bitcast<u32>(depth + reach));
}
`,gt=`// The colour of all fragments as one weighted mean, with their total transmittance.
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
`,_t=`// Slots front to back, then the tail, then the background (renderer/shaders/kbuffer/resolve.frag).
@group(0) @binding(0) var<storage, read> offsets: array<u32>;          // [P + 1]
@group(0) @binding(1) var<storage, read> colours: array<u32>;          // ~ of packed colours; 0: an empty slot
@group(0) @binding(2) var background: texture_2d<f32>;                 // gamma-2 encoded
@group(0) @binding(3) var sums: texture_2d<f32>;                       // sum w C, sum w
@group(0) @binding(4) var depths: texture_2d<f32>;                     // sum -ln(1 - a)
@group(0) @binding(5) var<storage, read_write> shown: array<u32>;      // [P]

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
    let rest = tail_over(texel_of(sums, p), texel_of(depths, p).r, texel_of(background, p).rgb);
    shown[p] = display_word(light.rgb + light.a * rest, k);
}
`,vt=`// Each pixel's sorted core front to back, then the tail, then the background (renderer/shaders/kbuffer/resolve.frag).
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
`,yt=`// Each pixel's sorted run, composited front to back.
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
`,bt=`// Exclusive prefix sums over the blocks, in place. One work group: each thread has a run of them. Sums stop at CEILING,
// so that they are the same in any order.
@group(0) @binding(0) var<storage, read_write> total: array<u32>;   // its last word gets the sum of the first column
@group(0) @binding(1) var<storage, read_write> sums: array<vec2u>;  // [blocks]
var<workgroup> part: array<vec2u, 256>;

const CEILING = vec2u(0x7fffffffu);

@compute @workgroup_size(256)
fn scan(@builtin(local_invocation_index) lane: u32) {
    let blocks = arrayLength(&sums);
    let run = (blocks + 255u) / 256u;
    let first = min(lane * run, blocks);
    let end = min(first + run, blocks);
    var own = vec2u(0u);
    for (var i = first; i < end; i++) {
        own = min(own + sums[i], CEILING);
    }
    part[lane] = own;
    workgroupBarrier();
    if (lane == 0u) {
        var before = vec2u(0u);
        for (var i = 0u; i < 256u; i++) {
            let here = part[i];
            part[i] = before;
            before = min(before + here, CEILING);
        }
        total[arrayLength(&total) - 1u] = before.x;
    }
    workgroupBarrier();
    var before = part[lane];
    for (var i = first; i < end; i++) {
        let here = sums[i];
        sums[i] = before;
        before = min(before + here, CEILING);
    }
}
`,xt=`// The bundle's network on the rows of its manifest's self-test.
@group(0) @binding(0) var<storage, read> features: array<f32>;
@group(0) @binding(1) var<storage, read_write> answers: array<f32>;

@compute @workgroup_size(16)
fn answer_rows(@builtin(global_invocation_id) id: vec3u) {
    let row = id.x;
    if (row * DIAPHANE_OUTPUTS >= arrayLength(&answers)) {
        return;
    }
    var x: array<f32, DIAPHANE_FEATURES>;
    for (var i = 0u; i < DIAPHANE_FEATURES; i++) {
        x[i] = features[row * DIAPHANE_FEATURES + i];
    }
    var answer = diaphane_predict(x);
    for (var i = 0u; i < DIAPHANE_OUTPUTS; i++) {
        answers[row * DIAPHANE_OUTPUTS + i] = answer.y[i];
    }
}
`,St=`// A fragment in a pool: packed colour, depth bits.
alias Slot = vec2u;

fn comes_before(one: Slot, two: Slot) -> bool {
    return one.y < two.y || (one.y == two.y && one.x < two.x);
}
`,Ct=`// Sorts each pixel's run by depth, then colour: heapsort, in place. \`Slot\` is declared before.
@group(0) @binding(0) var<storage, read> offsets: array<u32>;        // [P + 1]
@group(0) @binding(1) var<storage, read> cursors: array<u32>;        // [P], fragments captured
@group(0) @binding(2) var<storage, read_write> pool: array<Slot>;

// Puts a fragment into the heap of \`count\` fragments from \`base\` on whose place \`hole\` is free.
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
`,wt=`// Geometry and shading, shared by every geometry pass: renderer/shaders/common/surface.{vert,glsl} in WGSL.
struct Material {
    scale: vec4f,    // factor of the texture's linear colour and opacity
    threshold: f32,  // opacity below which nothing is there, and from which on it is opaque; 0: it is blended
    is_opaque: u32,
}

struct Surface {
    // Invariant, so that depth has the same bits in all passes: the chain matches fragments by it.
    @builtin(position) @invariant position: vec4f,
    @location(0) normal: vec3f,
    @location(1) uv: vec2f,
    @location(2) colour: vec4f,
    @builtin(front_facing) is_front: bool,
}

struct Corner {
    @builtin(position) @invariant position: vec4f,
    @location(0) normal: vec3f,
    @location(1) uv: vec2f,
    @location(2) colour: vec4f,
}

@group(0) @binding(1) var opaque_depth: texture_depth_2d;  // not bound while it is drawn
@group(1) @binding(0) var<uniform> material: Material;
@group(1) @binding(1) var colour_texture: texture_2d<f32>;
@group(1) @binding(2) var colour_sampler: sampler;

@vertex
fn place(
    @location(0) position: vec3f,
    @location(1) normal: vec3f,
    @location(2) uv: vec2f,
    @location(3) colour: vec4f,
) -> Corner {
    let turned = (camera.world_to_view * vec4f(normal, 0.0)).xyz;
    return Corner(clip_position(position), turned, uv, colour);
}

fn pixel_of(in: Surface) -> u32 {
    return u32(in.position.y) * camera.size.x + u32(in.position.x);
}

// Distance along the view axis, float bits, which order as positive floats do. w is 1 / -z of the view, by perspective;
// it is invariant, which other outputs of a vertex shader cannot be.
fn depth_bits(in: Surface) -> u32 {
    return bitcast<u32>(1.0 / in.position.w);
}

// The depth test against the opaque surfaces. Fixed-function tests may come after a shader's writes to storage, so
// every pass does it by itself.
fn is_hidden(in: Surface) -> bool {
    return in.position.z >= textureLoad(opaque_depth, vec2i(in.position.xy), 0);
}

// Unit length; opposite normals of neighbouring vertices interpolate through zero, which stays zero.
fn direction(v: vec3f) -> vec3f {
    return v * inverseSqrt(max(dot(v, v), 1e-30));
}

// Two-sided diffuse light from above the viewer's left shoulder, a sky that is brighter along \`up\`, a small highlight.
fn shade(in: Surface, albedo: vec3f) -> vec3f {
    let eye = direction(vec3f(-in.position.xy * camera.eye_ray.xy - camera.eye_ray.zw, 1.0));
    let outside = direction(in.normal);
    let normal = select(-outside, outside, in.is_front);
    let light = normalize(vec3f(-0.5, 0.8, 0.9));
    let diffuse = max(dot(normal, light), 0.0);
    let sky = 0.5 + 0.5 * dot(normal, camera.up_view.xyz);
    let halfway = light + eye;  // its square is divided by, which costs no root
    var highlight = max(dot(normal, halfway), 0.0);
    highlight *= highlight / dot(halfway, halfway);
    for (var i = 0; i < 4; i++) {
        highlight *= highlight;
    }
    return albedo * (0.25 + 0.3 * sky + 0.6 * diffuse) + 0.25 * highlight;
}

// The fragment as it is stored: gamma-2 encoded RGB and alpha, integers in 0..255. Alpha 0 is nothing, 255 is opaque.
// It samples a texture, so it has to be called before the first branch.
fn stored_surface(in: Surface) -> vec4u {
    let texel = clamp(textureSample(colour_texture, colour_sampler, in.uv) * material.scale, vec4f(0.0), vec4f(1.0));
    let albedo = in.colour.rgb * in.colour.rgb * texel.rgb;  // vertex colours are gamma-2 encoded
    var alpha = in.colour.a * texel.a;
    if (material.threshold > 0.0) {
        alpha = select(1.0, 0.0, alpha < material.threshold);
    }
    if (material.is_opaque == 1u) {
        alpha = 1.0;
    }
    let encoded = sqrt(clamp(shade(in, albedo), vec3f(0.0), vec3f(1.0)));
    return vec4u(vec4f(encoded, clamp(alpha, 0.0, 1.0)) * 255.0 + 0.5);
}

fn is_transparent(stored: vec4u) -> bool {
    return stored.a > 0u && stored.a < 255u;
}

// One word a fragment: r, g, b, a from the lowest byte.
fn pack(stored: vec4u) -> u32 {
    return stored.r | (stored.g << 8u) | (stored.b << 16u) | (stored.a << 24u);
}

fn unpack(word: u32) -> vec4u {
    return vec4u(word, word >> 8u, word >> 16u, word >> 24u) & vec4u(255u);
}
`,Tt=`// A fragment's part of the tail's sums, weighed by what the depth bins know to be in front of it
// (renderer/shaders/kbuffer/tail.glsl). \`words\` and \`ranges\` are declared before.
struct Tail {
    @location(0) colours: vec4f,  // sum w C, sum w
    @location(1) depth: f32,      // sum -ln(1 - a)
}

fn tail_of(p: u32, z: f32, stored: vec4u) -> Tail {
    let fragment = vec4f(stored) / 255.0;
    let own = -log(1.0 - fragment.a);
    let place = bin_place(z, ranges[tile_of(p, camera.size.x)]);
    let weight = fragment.a * exp(-min(in_front(p, place, own), MAX_EXPONENT));
    return Tail(vec4f(weight * fragment.rgb * fragment.rgb, weight), own);
}
`,Et=`// What the tail reads.
@group(2) @binding(0) var<storage, read> ranges: array<vec2f>;  // [T]
@group(2) @binding(1) var<storage, read> words: array<u32>;     // [P][BINS], packed
`,Dt=`// Ranges of tiles that were found in a texture.
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
`,Ot=`// Fragments, occupied pixels and the fullest one's fragments of every block.
@group(0) @binding(0) var<storage, read> n: array<u32>;                       // [P]
@group(0) @binding(1) var<storage, read_write> blocks: array<vec3u>;
@group(0) @binding(2) var<storage, read_write> sums: array<vec2u>;            // [blocks], fragments and 0
var<workgroup> fragments: atomic<u32>;
var<workgroup> filled: atomic<u32>;
var<workgroup> deepest: atomic<u32>;

@compute @workgroup_size(256)
fn total_blocks(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    for (var i = 0u; i < BLOCK / 256u; i++) {
        let p = group.x * BLOCK + i * 256u + lane;
        if (p < arrayLength(&n)) {
            atomicAdd(&fragments, min(n[p], TURNS));
            atomicAdd(&filled, min(n[p], 1u));
            atomicMax(&deepest, n[p]);
        }
    }
    workgroupBarrier();
    if (lane == 0u) {
        blocks[group.x] = vec3u(atomicLoad(&fragments), atomicLoad(&filled), atomicLoad(&deepest));
        sums[group.x] = vec2u(atomicLoad(&fragments), 0u);
    }
}
`;function N(e){let t=Object.hasOwn(k,e)?k[e]:null;return t&&t.bins>0?{name:e,...t}:null}var P=N(Ee);Object.keys(k).flatMap(e=>N(e)??[]).filter(e=>e.meanLevels>0).reduce((e,t)=>t.bins>e.bins?t:e);var kt=Object.assign({"./shaders/add_to_bins.wgsl":Me,"./shaders/areas.wgsl":Ne,"./shaders/begin_cuts.wgsl":Pe,"./shaders/bin_words.wgsl":Fe,"./shaders/binned.wgsl":Ie,"./shaders/bins.wgsl":Le,"./shaders/blended.wgsl":Re,"./shaders/camera.wgsl":ze,"./shaders/capture.wgsl":Be,"./shaders/capture_core.wgsl":Ve,"./shaders/chain_colour.wgsl":He,"./shaders/chain_depth.wgsl":Ue,"./shaders/choose.wgsl":We,"./shaders/core_totals.wgsl":Ge,"./shaders/count.wgsl":Ke,"./shaders/count_prices.wgsl":qe,"./shaders/cover.wgsl":Je,"./shaders/cut_state.wgsl":Ye,"./shaders/cuts_of_counts.wgsl":Xe,"./shaders/difference.wgsl":Ze,"./shaders/display.wgsl":Qe,"./shaders/fill_ranges.wgsl":$e,"./shaders/find_cuts.wgsl":et,"./shaders/fixed.wgsl":tt,"./shaders/gather_bins.wgsl":nt,"./shaders/half_slot.wgsl":rt,"./shaders/in_front.wgsl":it,"./shaders/join.wgsl":at,"./shaders/kept_bins.wgsl":ot,"./shaders/mipmap.wgsl":st,"./shaders/opaque.wgsl":ct,"./shaders/pack.wgsl":lt,"./shaders/pixels.wgsl":ut,"./shaders/place_all.wgsl":dt,"./shaders/place_cuts.wgsl":ft,"./shaders/present.wgsl":pt,"./shaders/prices.wgsl":mt,"./shaders/range.wgsl":ht,"./shaders/resolve_blended.wgsl":gt,"./shaders/resolve_chain.wgsl":_t,"./shaders/resolve_core.wgsl":vt,"./shaders/resolve_exact.wgsl":yt,"./shaders/scan.wgsl":bt,"./shaders/self_test.wgsl":xt,"./shaders/slot.wgsl":St,"./shaders/sort.wgsl":Ct,"./shaders/surface.wgsl":wt,"./shaders/tail.wgsl":Tt,"./shaders/tail_inputs.wgsl":Et,"./shaders/take_ranges.wgsl":Dt,"./shaders/totals.wgsl":Ot}),At=2048,jt=2**31-1,Mt=4096;function Nt({bins:e,shareLevels:t,meanLevels:n}){let r={BINS:`${e}u`,FOURS:`${e/4}u`,SHARE_LEVELS:`${t}`,MEAN_LEVELS:`${n}`},i={BLOCK:`${At}u`,TURNS:`${Mt}u`,TEXELS:`11`};return Object.entries({...A,...r,...i}).map(([e,t])=>`const ${e} = ${t};`).join(`
`)}function F(e,t=P,n=``){let r=e.map(e=>{let t=kt[`./shaders/${e}.wgsl`];if(t===void 0)throw Error(`there is no shader ${e}`);return t});return[n,Nt(t),...r].join(`
`)}var Pt=4,Ft=Number(A.RANKS),I=[`cut_state`,`bin_words`,`cuts_of_counts`],It=e=>Math.floor(e/At)+1;function Lt(e,t){return Math.min(Math.floor(e*t),jt-1)}var Rt=class{#e;#t;#n;constructor(e){this.#e=e,this.#t=It(e.pixels),this.#n=e.gpu.filled(new Uint32Array(4),GPUBufferUsage.UNIFORM)}get offsets(){return this.#e.words(`offsets`,this.#e.pixels+1)}get cuts(){return this.#e.words(`cuts`,this.#e.pixels)}get state(){return this.#e.words(`cut state`,Pt)}get#r(){return this.#e.words(`sums`,2*this.#t)}async totals(e,t){let n=this.#e.words(`counted`,3),r=this.#a(e,t);this.#o(e,[`join`],`join`,[r,n],1),e.submit();let[i,a,o]=await this.#e.gpu.read(n);return[i,a,o]}placeAll(e,t){this.#a(e,t),this.#o(e,[`scan`],`scan`,[this.#e.words(`total`,1),this.#r],1),this.#o(e,[`place_all`],`place_all`,[t,this.#r,this.offsets],this.#t)}placeFixed(e,t){this.#i(t),this.#e.forPixels(e,[`fixed`],`place_fixed`,[this.offsets,this.#n],{threads:this.#e.pixels+1})}begin(e,{tail:t,words:n},r){this.#i(r),e.encoder.clearBuffer(this.state),this.#o(e,[...I,`core_totals`],`total_cores`,[n,this.state],this.#t,t),this.#o(e,[`cut_state`,`begin_cuts`],`begin_cuts`,[this.state,this.#n],1,t)}place(e,{tail:t,words:n}){let r=this.#e.zeros(e,`prices`,Ft),[i,a,o]=[this.state,this.cuts,this.#r];this.#o(e,[...I,`count_prices`],`count_prices`,[n,i,r],this.#t,t),this.#o(e,[`cut_state`,`choose`],`choose`,[i,r,this.#n],1,t),this.#o(e,[...I,`find_cuts`],`find_cuts`,[n,i,a,o],this.#t,t),this.#o(e,[`scan`],`scan`,[i,o],1);let s=[i,a,o,this.offsets,this.#n,n];this.#o(e,[...I,`place_cuts`],`place_cuts`,s,this.#t,t)}destroy(){this.#n.destroy()}#i(e){this.#e.gpu.device.queue.writeBuffer(this.#n,0,new Uint32Array([Math.min(e,jt-1)]))}#a(e,t){let n=this.#e.words(`totals`,4*this.#t);return this.#o(e,[`totals`],`total_blocks`,[t,n,this.#r],this.#t),n}#o(e,t,n,r,i,a){this.#e.dispatch(e,F(t,a),n,r,[i,1])}};function zt(e,t,n,r){e.forPixels(t,[`bin_words`,`pack`],`pack_bins`,[r],{tail:n})}var Bt=[`cut_state`,`bin_words`,`cuts_of_counts`,`bins`,`kept_bins`,`prices`];function Vt(e,t,n,r,i,a,o){let s=[r.words,i.state,a,r.luma,o.createView()],c={tail:n.tail,before:n.wgsl};e.forPixels(t,Bt,`predict_ranks`,s,c)}var Ht=class{gpu;width;height;pixels;#e=new Map;constructor(e,t,n){this.gpu=e,this.width=t,this.height=n,this.pixels=t*n}get bytes(){return[...this.#e.values()].reduce((e,{size:t})=>e+t,0)}destroy(){for(let e of this.#e.values())e.destroy()}words(e,t){let n=this.#e.get(e);if(n&&n.size===4*Math.max(t,1))return n;n?.destroy(),this.#e.delete(e);let r=this.gpu.words(t);return this.#e.set(e,r),r}zeros(e,t,n){let r=this.room(t,n);return e.encoder.clearBuffer(r,0,4*n),r}room(e,t){return this.words(e,Math.max(t,(this.#e.get(e)?.size??0)/4))}forPixels(e,t,n,r,{tail:i=P,before:a=``,threads:o=this.pixels}={}){this.dispatch(e,F([`pixels`,...t],i,a),n,r,Ae(o))}dispatch(e,t,n,r,i){let a=this.gpu.compute(t,n),o=e.encoder.beginComputePass();o.setPipeline(a),o.setBindGroup(0,this.gpu.bind(a,r)),o.dispatchWorkgroups(...i),o.end()}},Ut=Number(A.RANGE_TILE),Wt=class{gpu;tail;#e;#t;#n;constructor(e,t,n,r){this.gpu=e,this.tail=r,this.#e=new Ht(e,t,n),this.#t=new Rt(this.#e),this.#n=Math.ceil(t/Ut)*Math.ceil(n/Ut)}get width(){return this.#e.width}get height(){return this.#e.height}get words(){return this.#e.words(`bins`,this.tail.bins*this.#e.pixels)}get luma(){return this.#e.words(`luma`,this.#e.pixels)}get offsets(){return this.#t.offsets}get cuts(){return this.#t.cuts}get cursors(){return this.#e.words(`cursors`,this.#e.pixels)}slots(e){return Lt(e,this.#e.pixels)}pool(e){return this.#e.room(`pool`,3*Math.max(e,1))}begin(){let e=new M(this.gpu);for(let t of[this.words,this.luma,this.cursors])e.encoder.clearBuffer(t);e.submit()}select(e,t,n,r){let{tail:i,words:a,luma:o}=this,s=new M(this.gpu),c=this.#e.words(`ranges`,2*this.#n),l=this.#n;this.#e.forPixels(s,[`take_ranges`],`take_ranges`,[n.createView(),c],{threads:l}),zt(this.#e,s,i,a);let u={tail:i,words:a,luma:o};this.#t.begin(s,u,t),Vt(this.#e,s,e,u,this.#t,c,r),this.#t.place(s,u),s.submit()}sort(e){let t=new M(this.gpu);this.#e.forPixels(t,[`half_slot`,`sort`],`sort_runs`,[this.offsets,this.cursors,this.pool(e)]),t.submit()}get bytes(){return this.#e.bytes}destroy(){this.#e.destroy(),this.#t.destroy()}},Gt=Number(A.MOST_OPACITY);function L(e){return e.transparent&&e.blending===1&&!Kt(e)}function Kt(e){let{transmission:t,transmissionNode:n,backdropNode:r}=e;return(t??0)>0||!!n||!!r}var R=i.a.clamp(0,1).toVar(),z=_(e=>e.material.premultipliedAlpha?i.rgb.div(i.a.max(1e-6)):D(i.rgb))(),B=R.oneMinus().max(Math.exp(-Gt)).log().negate().toVar(),qt=class{#e=o(0);#t=o(1);here=fe.z.negate().add(this.#e).div(this.#t).max(1e-6).toVar();of(e){return Math.max((e+this.#e.value)/this.#t.value,1e-6)}update(e){let{near:t,far:n}=e,r=e.isOrthographicCamera===!0;this.#e.value=r?(n-t)/1024-t:0,this.#t.value=Math.sqrt((t+this.#e.value)*(n+this.#e.value))}},Jt=new WeakMap;function Yt(e){let t=e.contextNode,n=Jt.get(t);if(!n){let{getAO:e}=t.getFlowContextData();n=Te(t,{getAO:e??(e=>e)}),Jt.set(t,n)}return n}function Xt(e,t){let{_objects:n,_renderContexts:r}=e,i=({mrt:e})=>e!==null&&t.has(e);for(let e of[...n?._renderObjects??[]])i(e.context)&&e.dispose();let a=r?._renderContexts??{};for(let[e,t]of Object.entries(a))i(t)&&delete a[e]}function V(t){let n=new ge(1,1,{count:t.length,depthBuffer:!1,samples:0});return t.forEach(({name:t,format:r=e,type:i=he},a)=>{let o=n.textures[a];Object.assign(o,{name:t,format:r,type:i,minFilter:O,magFilter:O}),o.generateMipmaps=!1}),n}function H(e,t=!1){let n=new _e(5);n.blendSrc=n.blendDst=201,n.blendEquation=t?104:100;let r=a(e);for(let t of Object.keys(e))r.setBlendMode(t,n).setClearColor(t,0,0);return r}var U=class{material=new se;#e=new xe(this.material);constructor(e){this.material.fragmentNode=e,this.material.depthTest=this.material.depthWrite=!1}render(e,t){let{opaque:n,autoClear:r}=e,i=e.getRenderObjectFunction();Object.assign(e,{opaque:!0,autoClear:!1}),e.setRenderObjectFunction(null),e.setRenderTarget(t),this.#e.render(e),e.setRenderObjectFunction(i),Object.assign(e,{opaque:n,autoClear:r})}dispose(){this.material.dispose()}};function W(e){let t=new U(e);return Object.assign(t.material,{blending:5,blendSrc:201,blendDst:205}),t}var[G,Zt,Qt,$t,en,tn]=[`OPTICAL_UNIT`,`ROOT_SHARE`,`PLAIN_SHARE`,`MAX_EXPONENT`,`LEAST_OTHERS`,`LEAST_SPREAD`].map(e=>Number(A[e])),K=Math.min(...Object.values(k).flatMap(({bins:e,meanLevels:t})=>t>0?[e]:[])),nn=2048,q=Array.from({length:K/4},(e,t)=>t),rn=class{target;#e;#t;#n;#r;constructor(e,t){this.target=V([...q.map(e=>({name:`units${e}`})),...q.map(e=>({name:`moments${e}`}))]);let n=t.y.sub(t.x),r=n.greaterThan(0).select(e.sub(t.x).div(n.max(1e-12)).clamp(0,1),g(0)),i=r.mul(Qt).add(r.sqrt().mul(Zt)).mul(K).toVar();this.#e=i.floor().min(K-1).toVar(),this.#t=i.sub(this.#e).toVar(),this.#r=R.greaterThan(0).select(B.mul(G).add(.5).floor().clamp(1,nn),g(0)).toVar(),this.#n=this.#r.mul(this.#t).add(.5).floor().toVar()}outputs(e){let t={};for(let n of q)t[`units${n}`]=this.#a(n).mul(this.#r).mul(e),t[`moments${n}`]=this.#a(n).mul(this.#n).mul(e);return t}get weight(){let e=(e,t)=>q.map(n=>this.#i(`${e}${n}`).dot(t(n))).reduce((e,t)=>e.add(t)).toVar(),t=e(`units`,e=>this.#o(e)).div(G),n=e(`units`,e=>this.#a(e)).div(G),r=e(`moments`,e=>this.#a(e)).div(G),i=n.sub(B).max(0).toVar(),a=r.sub(B.mul(this.#t)).div(i.max(en)).clamp(0,1),o=i.greaterThan(en).select(a,g(.5)).toVar(),s=o.min(o.oneMinus()).max(tn).toVar(),c=this.#t.sub(o).add(s).div(s.mul(2)).clamp(0,1);return R.mul(t.add(i.mul(c)).min($t).negate().exp())}#i(e){return p(this.target.textures.find(t=>t.name===e),S).level(E(0))}#a(e){return this.#s(e).sub(this.#e).abs().oneMinus().clamp(0,1)}#o(e){return n(this.#e).sub(this.#s(e)).clamp(0,1)}#s(e){return n(4*e,4*e+1,4*e+2,4*e+3)}},an=8,J=()=>new x(new Uint32Array(1),1),on=class{depth;visible;#e=o(1,`uint`);#t=o(1,`uint`);#n=[J(),J(),J()].map(e=>f(e,`uint`,1).toAtomic());#r=1;constructor(e,t){this.depth=e,this.visible=t}static bytes(e,t,n){return 4*e*t*n}resize(e,t,n){[this.#t.value,this.#e.value]=[e,n];let r=Math.max(e*t*n,1);if(r!==this.#r){this.#r=r;for(let e of this.#n)e.value.dispose(),e.value=new x(new Uint32Array(r),1)}}release(){this.resize(0,0,0)}inserting(e){let[t]=this.#n;return _(()=>{let r=n(e).toVar(),i=this.#a.toVar(),a=this.#i.toVar();return w(this.visible.is,()=>{this.#o(e=>{let n=C(t.element(i.add(e)),a).toVar();a.assign(n.lessThan(a).select(n,a)),w(a.equal(m(0)),()=>void de())})}),r})()}get remaining(){let[e,t,n]=this.#n;return _(()=>{let r=this.visible.share.toVar(),i=z.max(0).min(65504).toVar(),a=this.#a.toVar(),o=this.#i.add(m(an)).toVar(),s=m(0).toVar();return w(this.visible.is,()=>{this.#o(t=>{w(T(e.element(a.add(t))).lessThanEqual(o),()=>void de()),s.addAssign(m(1))}),w(s.lessThan(this.#e),()=>{r.assign(0);let e=a.add(s);C(t.element(e),ee(i.rg)),C(n.element(e),ee(h(i.b,R)))})}),r})().toVar()}over(e){let[t,r,i]=this.#n;return _(()=>{let a=this.#a.toVar(),o=D(0).toVar(),s=g(1).toVar();return this.#o(e=>{let c=a.add(e),u=l(T(r.element(c))),d=l(T(i.element(c))).toVar();o.addAssign(n(u,d.x,0).rgb.mul(s.mul(d.y))),s.mulAssign(d.y.oneMinus());for(let e of[t,r,i])ue(e.element(c),m(0))}),o.addAssign(e.rgb.mul(s)),n(o,s.mul(e.a.oneMinus()).oneMinus())})()}dispose(){for(let e of this.#n)e.value.dispose()}get#i(){return m(2139095040).sub(r(this.depth))}get#a(){return m(t.y).mul(this.#t).add(m(t.x)).mul(this.#e)}#o(e){ve({start:m(0),end:this.#e,type:`uint`,condition:`<`},({i:t})=>e(t))}},sn=[`words`,`luma`,`offsets`,`cuts`,`cursors`,`pool`],cn=`fn diaphane_gather(p: u32, z: f32, range: vec2f, own: f32, rgb: vec3u) -> f32 {
    let place = bin_place(z, range);
    let bin = bin_of(place);
    let units = units_in(own);
    add_to_bin(BINS * p + bin, units, u32(f32(units) * (place - f32(bin)) + 0.5));
    add_luma(p, units, rgb);
    return 0.0;
}`,ln=`fn diaphane_capture(p: u32, z: f32, range: vec2f, rgb: vec3f, a: f32) -> f32 {
    if (bin_of(bin_place(z, range)) < cuts[p]) {
        let at = offsets[p] + atomicAdd(&cursors[p], 1u);
        if (at < offsets[p + 1u]) {
            atomicStore(&pool[3u * at], bitcast<u32>(z));
            atomicStore(&pool[3u * at + 1u], pack2x16float(rgb.rg));
            atomicStore(&pool[3u * at + 2u], pack2x16float(vec2f(rgb.b, a)));
            return 0.0;
        }
    }
    return 1.0;
}`,un=`fn diaphane_weight(p: u32, z: f32, range: vec2f, own: f32, a: f32) -> f32 {
    return a * exp(-min(in_front(p, bin_place(z, range), own), MAX_EXPONENT));
}`,dn=`fn diaphane_resolve(p: u32) -> vec4f {
    var light = vec4f(0.0, 0.0, 0.0, 1.0);
    let k = min(cursors[p], offsets[p + 1u] - offsets[p]);
    for (var i = offsets[p]; i < offsets[p] + k; i++) {
        let rg = unpack2x16float(pool[3u * i + 1u]);
        let ba = unpack2x16float(pool[3u * i + 2u]);
        light = vec4f(light.rgb + light.a * ba.y * vec3f(rg, ba.x), light.a * (1.0 - ba.y));
    }
    return light;
}`,Y=e=>e.replace(/\b(words|luma|offsets|cuts|cursors|pool)\[/g,`diaphane_$1.value[`),X=class{renderer;gpu;bins;range;tail;visible;picture;#e=o(1,`uint`);#t=[];#n=new Map;#r=V([{name:`background`,type:le}]);#i;#a;#o;#s;#c=null;#l=0;constructor(e,t,r,i,a,o,s,c){this.renderer=e,this.gpu=t,this.bins=r,this.range=a,this.tail=o,this.visible=s,this.picture=c;let l=p(c.texture,S).level(E(0)).rgb;this.#i=new U(n(l.clamp(0,1).sqrt(),1)),this.#a=this.#p(i),this.#o=this.#m(i),this.#s=this.#h()}static bytes(e,t,{bins:n}){return 4*Math.max(n*e,3*Math.floor(t*e))}get bytes(){return this.#c?.bytes??0}get slots(){return this.#l}async offsets(){return this.#c?this.gpu.read(this.#c.offsets):new Uint32Array(1)}render(e,t,n){let r=this.#u();this.#l=r.slots(t),this.#d(r),r.begin(),n(this.tail.target,this.#a),this.#i.render(this.renderer,this.#r);let[i,a]=[this.range.tiles,this.#r].map(e=>this.#f(e));r.select(e,this.#l,i,a),n(this.tail.target,this.#o),r.sort(this.#l),this.#s.render(this.renderer,this.picture)}release(){for(let{attribute:e}of this.#n.values())e.dispose();this.#n.clear(),this.#c?.destroy(),this.#c=null,this.#r.dispose()}dispose(){this.release(),Xt(this.renderer,new Set([this.#a,this.#o])),this.#i.dispose(),this.#s.dispose()}#u(){let{width:e,height:t}=this.picture;return(this.#c?.width!==e||this.#c.height!==t)&&this.release(),this.#r.setSize(e,t),this.#e.value=e,this.#c??=new Wt(this.gpu,e,t,this.bins)}#d(e){for(let t of sn){let n=t===`pool`?e.pool(this.#l):e[t],r=this.#n.get(t);if(r?.buffer===n)continue;r?.attribute.dispose();let i=new x(new Uint32Array(1),1);fn(this.renderer,i).buffer=n,this.#n.set(t,{buffer:n,attribute:i});for(let e of this.#t)e.name===t&&(e.node.value=i)}}#f(e){return fn(this.renderer,e.texture).texture}#p(e){let t=this.#g([`bins`,`bin_words`,`add_to_bins`],{words:!0,luma:!0}),r=u(cn,[t]);return H({mean:_(()=>{let t=g(0).toVar(),i=this.#_.toVar(),a=d(z.clamp(0,1).sqrt().mul(255).add(.5)).toVar(),[o,s]=[e.toVar(),B.toVar()];return w(this.visible.is,()=>void t.assign(r(this.#v,o,i,s,a))),n(t)})(),depth:n(0)})}#m(e){let t=this.#g([`bins`,`bin_words`,`kept_bins`,`in_front`],{words:!1}),n=this.#g([],{offsets:!1,cuts:!1,cursors:!0,pool:!0}),[r,i]=[u(Y(ln),[t,n]),u(un,[t])],a=this.#_.toVar(),o=_(()=>{let t=this.visible.share.toVar(),n=z.max(0).min(65504).toVar(),i=e.toVar();return w(this.visible.is,()=>void t.assign(r(this.#v,i,a,n,R))),t})().toVar(),s=i(this.#v,e,a,B,R);return this.tail.mrt(s,o)}#h(){let e=this.#g([],{offsets:!1,cursors:!1,pool:!1}),t=u(Y(dn),[e])(this.#v).toVar(),r=this.tail.picture.toVar();return W(n(t.rgb.add(r.rgb.mul(t.a)),t.a.mul(r.a.oneMinus()).oneMinus()))}#g(e,t){let n=Object.entries(t).map(([e,t])=>{let n=f(new x(new Uint32Array(1),1),`uint`,1).setName(`diaphane_${e}`),r=t?n.toAtomic():n.toReadOnly();return this.#t.push({name:e,node:r}),r});return Se(e.length?Y(F(e,this.bins)):``,n)}get#_(){let{here:e}=this.range;return h(e.x,e.y.sub(e.x).max(0))}get#v(){return m(t.y).mul(this.#e).add(m(t.x))}};function fn(e,t){return e.backend.get(t)}var pn=Number(A.RANGE_TILE),Z=2,Q=`range`,mn=class{depth;target;tiles;#e;#t=o(new ae(1,1));#n=o(new ae(0,0));#r=new me;#i=new Ce;mrt;here;constructor(e,t){this.depth=e;let r=t?ye:he,i=t?1e-6:2**-10;this.target=V([{name:Q,format:b,type:r}]),this.tiles=V([{name:Q,format:b,type:r}]);let a=e.here,o=oe(a).abs().add(we(a).abs()).div(2).min(a.div(20)),[s,c]=[a.sub(o).max(1e-6),a.add(o)];this.mrt=H({[Q]:n(g(1).div(s).mul(1+i),c.mul(1+i),0,0)},!0),this.#e=new U(this.#a());let l=p(this.tiles.texture,S).level(E(0)).rg;this.here=h(g(1).div(l.x.max(1e-9)),l.y).toVar()}#a(){let e=(e,t)=>p(this.target.texture,S.add(h(e,t).div(this.#t).div(Z))).level(E(0)).rg,t=(t,n)=>{let r=h(0);for(let i=t;i<n;i++)for(let a=t;a<n;a++)r=r.max(e(a+.5,i+.5));return r.toVar()},[r,i]=[t(-1,1),t(-3,3)],a=i.y.greaterThan(0).select(i,this.#n);return n(r.y.greaterThan(0).select(r,a),0,0)}setSize(e,t){let[n,r]=[Math.ceil(e/pn),Math.ceil(t/pn)];this.target.setSize(Z*n,Z*r),this.tiles.setSize(n,r),this.#t.value.set(n,r)}begin(){this.#n.value.set(0,0)}cover(e,t){let{geometry:n}=e;n&&!n.boundingSphere&&n.computeBoundingSphere();let r=e.boundingSphere??n?.boundingSphere,[i,a]=[t.near,t.far];if(r&&e.frustumCulled){let{center:n,radius:o}=this.#r.copy(r).applyMatrix4(e.matrixWorld),s=-this.#i.copy(n).applyMatrix4(t.matrixWorldInverse).z;[i,a]=[Math.max(i,s-o),Math.min(a,s+o)]}let{value:o}=this.#n;o.set(Math.max(o.x,1/this.depth.of(i)),Math.max(o.y,this.depth.of(a)))}fill(e){this.#e.render(e,this.tiles)}dispose(){this.target.dispose(),this.tiles.dispose(),this.#e.dispose()}},hn=class{target=V([{name:`mean`},{name:`depth`,format:be}]);mrt(e,t){return H({mean:n(z,1).mul(e.mul(t)),depth:n(B.mul(t),0,0,0)})}get picture(){let[e,t]=this.target.textures.map(e=>p(e,S).level(E(0))),r=t.r.negate().exp().oneMinus();return n(e.rgb.div(e.a.max(1e-9)).mul(r),r)}},gn=2**-22,_n=class{is;share;constructor(e){let t=p(e.depthTexture,S).level(E(0)).r;this.is=_(e=>{if(!e.material.depthTest)return R.greaterThan(0);let{renderer:n,camera:r}=e,i=vn(n,r.isOrthographicCamera===!0)(fe.z,ie,ce),a=n.reversedDepthBuffer?i.greaterThanEqual(t.sub(gn)):i.lessThanEqual(t.add(gn));return R.greaterThan(0).and(a)})().toVar(),this.share=this.is.select(g(1),g(0)).toVar()}};function vn({reversedDepthBuffer:e,logarithmicDepthBuffer:t},n){return n?e?re:c:e?s:t?ne:te}var yn=class{renderer;picture;#e=new qt;#t;#n;#r=new hn;#i;#a;#o=null;#s=null;#c=null;#l=1;#u=1;#d=``;constructor(e,t){this.renderer=e,this.picture=t,this.#t=new mn(this.#e,bn(e)),this.#a=new _n(t),this.#n=new rn(this.#e.here,this.#t.here),this.#i={bins:H(this.#n.outputs(this.#a.share)),tail:this.#r.mrt(this.#n.weight,this.#a.share),over:W(this.#r.picture)},this.setSize(t.width,t.height)}setSize(e,t){this.#t.setSize(e,t),this.#n.target.setSize(e,t),this.#r.target.setSize(e,t),[this.#l,this.#u]=[e,t]}begin(e){this.#e.update(e),this.#t.begin()}cover(e,t){this.#t.cover(e,t)}get deep(){return this.#s}render(e,t){let{technique:n,budget:r,bundle:i}=this.#h(e);if(n!==`kbuffer`&&this.#o?.slots.release(),n!==`kbuffer-deep`&&this.#s?.release(),t(this.#t.target,this.#t.mrt),this.#t.fill(this.renderer),n===`kbuffer-deep`)return this.#m(i).render(i,r,t);let{bins:a,tail:o,over:s}=n===`kbuffer`?this.#f(r):this.#i;t(this.#n.target,a),t(this.#r.target,o),s.render(this.renderer,this.picture)}#f(e){return this.#o??=this.#p(),this.#o.slots.resize(this.#l,this.#u,e),this.#o.passes}#p(){let e=new on(this.#e.here,this.#a),t=this.#n.outputs(this.#a.share),[n]=Object.keys(t);return{slots:e,passes:{bins:H({...t,[n]:e.inserting(t[n])}),tail:this.#r.mrt(this.#n.weight,e.remaining),over:W(e.over(this.#r.picture))}}}#m({tail:e}){this.#s&&this.#s.bins.name!==e.name&&(this.#s.dispose(),this.#s=null),this.#c??=Oe.of($(this.renderer));let[t,n]=[this.#c,this.#e.here];return this.#s??=new X(this.renderer,t,e,n,this.#t,this.#r,this.#a,this.picture)}#h({technique:e,budget:t,bundle:n}){let r={technique:`binned`,budget:0,bundle:n},i=e===`kbuffer-deep`,a=i?Math.max(t,0):Math.min(Math.max(Math.floor(t),0),8);if(e===`binned`||!(a>0))return r;let o=this.#l*this.#u,s=i&&!n?`There is no bundle for kbuffer-deep.`:xn(this.renderer,i?X.bytes(o,a,n.tail):on.bytes(this.#l,this.#u,a));return s&&s!==this.#d&&console.warn(`${s} Depth bins alone are used.`),this.#d=s,s?r:{technique:e,budget:a,bundle:n}}dispose(){let e=[this.#i,...this.#o?[this.#o.passes]:[]];Xt(this.renderer,new Set([this.#t.mrt,...e.flatMap(({bins:e,tail:t})=>[e,t])])),this.#t.dispose(),this.#n.target.dispose(),this.#r.target.dispose(),this.#i.over.dispose(),this.#o?.slots.dispose(),this.#o?.passes.over.dispose(),this.#s?.dispose()}};function bn(e){return e.hasFeature(`float32-blendable`)}function $(e){return e.backend.device??null}function xn(e,t){let n=$(e)?.limits;if(!n)return`A budget needs WebGPU, and this is WebGL 2.`;let r=Math.min(n.maxStorageBufferBindingSize,n.maxBufferSize);return t>r?`A budget of ${t} bytes in one buffer is above the ${r} of this device.`:``}var Sn=class extends pe{budget;technique;bundle;#e;#t;#n=null;#r=!1;constructor(e,t,{budget:n=0,bundle:r=null,technique:i}={}){super(pe.COLOR,e,t,{samples:0}),this.budget=n,this.bundle=r,this.technique=i??(r?`kbuffer-deep`:`kbuffer`),this.#e=e,this.#t=t}static get type(){return`DiaphanePassNode`}setMRT(){throw Error(`This pass has one output, its picture. Add a pass of three.js for what else is wanted of the scene.`)}setSize(e,t){super.setSize(e,t),this.#n?.setSize(this.renderTarget.width,this.renderTarget.height)}updateBefore(e){let t=e.renderer;this.#n?.renderer!==t&&this.#i(t);let n=this.#n;n.begin(this.#t);let r=!0,i=t.getRenderObjectFunction();this.#o(t,(e,t)=>L(t)?(n.cover(e,this.#t),r=!1,!1):this.#s(t)),super.updateBefore(e),r||this.#a(t,n),t.setRenderObjectFunction(i)}async slots(){let e=this.#n?.deep;if(!e?.slots)return null;let t=await e.offsets();return{budget:e.slots,k:t.subarray(1).map((e,n)=>e-t[n])}}#i(e){this.#n?.dispose(),this.#n=new yn(e,this.renderTarget)}#a(e,t){let n=y.saveRendererState(e),r=y.resetSceneState(this.#e,{}),{mask:i}=this.#t.layers,a=this.getLayers();a&&(this.#t.layers.mask=a.mask),this.#o(e,(e,t)=>L(t)),Object.assign(e,{opaque:!1,transparent:!0,autoClear:!0,autoClearColor:!0}),e.autoClearDepth=e.autoClearStencil=!1;let{contextNode:o}=e;e.contextNode=Yt(e),t.render(this,(t,n)=>{e.setRenderTarget(t),e.setMRT(n),e.render(this.#e,this.#t),e.setMRT(null)}),e.contextNode=o,this.#t.layers.mask=i,y.restoreSceneState(this.#e,r),y.restoreRendererState(e,n)}#o(e,t){e.setRenderObjectFunction((n,r,i,a,o,...s)=>{if(!t(n,o))return;let{depthWrite:c}=o;L(o)&&(o.depthWrite=!1),e.renderObject(n,r,i,a,o,...s),o.depthWrite=c})}#s(e){return Kt(e)&&!this.#r&&(this.#r=!0,console.warn(`The material "${e.name}" transmits light. three.js draws it beneath what is transparent, since it reads what is behind it. Use opacity in the place of transmission to have it composited.`)),!0}dispose(){this.#n?.dispose(),this.#n=null,super.dispose()}};function Cn(e,t,n){return new Sn(e,t,n)}export{N as n,Cn as t};