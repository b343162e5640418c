var e=`/demo/assets/shells-B5WAiC_M.glb`,t=`/demo/assets/shelf-eCNv2WYE.glb`,n=(e,t)=>[e[0]+t[0],e[1]+t[1],e[2]+t[2]],r=(e,t)=>[e[0]-t[0],e[1]-t[1],e[2]-t[2]],i=(e,t)=>[t*e[0],t*e[1],t*e[2]],a=(e,t)=>e[0]*t[0]+e[1]*t[1]+e[2]*t[2],o=e=>Math.sqrt(a(e,e)),s=(e,t)=>[e[1]*t[2]-e[2]*t[1],e[2]*t[0]-e[0]*t[2],e[0]*t[1]-e[1]*t[0]];function c(e){let t=o(e);return t>0?i(e,1/t):[0,0,1]}function l(e,t){return e.map((n,r)=>[0,1,2,3].reduce((n,i)=>n+e[r%4+4*i]*t[r-r%4+i],0))}function u(e,t){return[e[0]*t[0]+e[4]*t[1]+e[8]*t[2]+e[12],e[1]*t[0]+e[5]*t[1]+e[9]*t[2]+e[13],e[2]*t[0]+e[6]*t[1]+e[10]*t[2]+e[14]]}function d(e){let t=[e[0],e[1],e[2]],n=[e[4],e[5],e[6]],r=[e[8],e[9],e[10]],o=a(t,s(n,r))<0?-1:1;return[i(s(n,r),o),i(s(r,t),o),i(s(t,n),o)]}function f(e){let t=c(r(e.eye,e.target)),n=c(s(e.up,t));return{right:n,over:s(t,n),back:t}}function p(e){return Array.from({length:8},(t,n)=>[e[n&1][0],e[n>>1&1][1],e[n>>2&1][2]])}function m(e,t){let{back:n}=f(e),i=p(t).map(t=>a(r(e.eye,t),n)),s=o(r(t[1],t[0]))||1,c=Math.max(Math.max(...i)+.001*s,.001*s),l=Math.max(Math.min(...i)-.001*s,1e-4*c);return[Math.min(l,.5*c),c]}function h(e,t,n,r,i){let{right:o,over:s,back:c}=f(e),[l,u]=m(e,t),d=1/Math.tan(e.fov*Math.PI/360),p=r/i,h=[o[0],s[0],c[0],0,o[1],s[1],c[1],0,o[2],s[2],c[2],0,-a(o,e.eye),-a(s,e.eye),-a(c,e.eye),1],g=[d/p,0,0,0,0,d,0,0,0,0,u/(l-u),-1,0,0,l*u/(l-u),0],_=[2*p/(r*d),-2/(i*d),-p/d,1/d],v=new ArrayBuffer(176),y=[...h,...g,..._,a(o,n),a(s,n),a(c,n),0,l,u];return new Float32Array(v).set(y),new Uint32Array(v).set([r,i],y.length),v}var g=1.02;function _(e,t,o,s=38){let c=i(n(e[0],e[1]),.5),l=v({eye:n(c,[0,0,1]),target:c,up:t,fov:s},25,20,1),{right:u,over:d,back:m}=f(l),h=Math.tan(s*Math.PI/360),_=p(e).map(e=>{let t=r(e,c);return Math.max(Math.abs(a(t,u))/(h*o),Math.abs(a(t,d))/h)+a(t,m)});return{...l,eye:n(c,i(m,Math.max(g*Math.max(..._),1e-6)))}}function v(e,t,l,u){let d=r(e.eye,e.target),f=o(d),p=c(e.up),m=Math.asin(Math.min(Math.max(a(d,p)/f,-1),1)),h=c(r(d,i(p,a(d,p)))),g=t*Math.PI/180,_=n(i(h,Math.cos(g)),i(s(p,h),Math.sin(g))),v=85*Math.PI/180,y=Math.min(Math.max(m+l*Math.PI/180,-v),v),b=n(i(_,Math.cos(y)),i(p,Math.sin(y)));return{...e,eye:n(e.target,i(b,f*u))}}function y(e,t,a){let s=f(e),c=2*Math.tan(e.fov*Math.PI/360)*o(r(e.eye,e.target)),l=n(i(s.right,t*c),i(s.over,a*c));return{...e,eye:n(e.eye,l),target:n(e.target,l)}}var b={"binned-8":{kind:`BINNED`,bins:8,shareLevels:255,meanLevels:255},"binned-12":{kind:`BINNED`,bins:12,shareLevels:255,meanLevels:255},"binned-16":{kind:`BINNED`,bins:16,shareLevels:255,meanLevels:255},"density-16":{kind:`BINNED`,bins:16,shareLevels:15,meanLevels:0},density:{kind:`DENSITY`,bins:0,shareLevels:0,meanLevels:0},"exact-coverage":{kind:`EXACT_COVERAGE`,bins:0,shareLevels:0,meanLevels:0},"weighted-average":{kind:`WEIGHTED_AVERAGE`,bins:0,shareLevels:0,meanLevels:0},paper:{kind:`PAPER`,bins:0,shareLevels:0,meanLevels:0}},x=`binned-12`,S={FULL:`255`,MOST_CORE:`1023`,RANKS:`256`,PRICE_STEPS:`8.0`,LEAST_PRICE:`-4.0`,LEAST_PRIOR:`-40.0`,LEAST_COVERED:`0.0001`,LEAST_ALONE:`0.001`,MOST_ALONE:`0.5`,LEAST_IMPORTANCE:`9.313225746154785e-10`,ROOT_SHARE:`0.6`,PLAIN_SHARE:`0.4`,OPTICAL_UNIT:`253`,BIN_LIMIT:`4095`,COUNT_LIMIT:`255`,RANGE_TILE:`8`,MOST_OPACITY:`16.0`,LEAST_OTHERS:`0.001`,LEAST_SPREAD:`0.001`,LUMA_R:`54`,LUMA_G:`183`,LUMA_B:`19`,LUMA_SHIFT:`6`,LUMA_SQUARE_SHIFT:`14`,MAX_EXPONENT:`60.0`},C=class extends Error{what;remedy;constructor(e,t){super(`${e} ${t}`),this.what=e,this.remedy=t,this.name=`Trouble`}},ee=[`maxStorageBufferBindingSize`,`maxBufferSize`,`maxTextureDimension2D`],te=class e{device;description;blendsFloat32;#e=new Map;constructor(e,t){this.device=e,this.description=t,this.blendsFloat32=e.features.has(`float32-blendable`)}static async open(){if(!globalThis.isSecureContext)throw new C(`Browsers offer WebGPU on secure pages only.`,`Open this page by https, or as localhost.`);if(!navigator.gpu)throw new C(`This browser has no WebGPU.`,`Use a current Chrome, Edge, Safari or Firefox; on Linux WebGPU may have to be switched on in its settings.`);let t=await navigator.gpu.requestAdapter({powerPreference:`high-performance`});if(!t)throw new C(`The browser has WebGPU, but no graphics adapter for it.`,`Switch on hardware acceleration in the browser's settings, or update the graphics driver.`);let n={};for(let e of ee)n[e]=t.limits[e];let r=[`float32-blendable`].filter(e=>t.features.has(e)),i=await t.requestDevice({requiredFeatures:r,requiredLimits:n}).catch(()=>{throw new C(`The browser has WebGPU, but cannot open the graphics device.`,`Load the page again.`)}),{vendor:a,architecture:o,description:s}=t.info;return new e(i,s||[a,o].filter(Boolean).join(` `)||`unknown adapter`)}static of(t){return new e(t,`a device that was opened elsewhere`)}get sumFormat(){return this.blendsFloat32?`rgba32float`:`rgba16float`}get scalarFormat(){return this.blendsFloat32?`r32float`:`r16float`}words(e){let t=4*Math.max(e,1),{maxStorageBufferBindingSize:n,maxBufferSize:r}=this.device.limits;ne(t,Math.min(n,r),`Make the window smaller, or the budget.`);let{STORAGE:i,COPY_SRC:a,COPY_DST:o}=GPUBufferUsage;return this.device.createBuffer({size:t,usage:i|a|o})}filled(e,t){let n=Math.ceil(Math.max(e.byteLength,4)/4)*4;ne(n,this.device.limits.maxBufferSize,`Open a smaller scene.`);let r=this.device.createBuffer({size:n,usage:t|GPUBufferUsage.COPY_DST,mappedAtCreation:!0}),i=new Uint8Array(e.buffer,e.byteOffset,e.byteLength);return new Uint8Array(r.getMappedRange()).set(i),r.unmap(),r}compute(e,t){let n=`${t}\n${e}`,r=this.#e.get(n);if(!r){let i=this.device.createShaderModule({code:e,label:t});r=this.device.createComputePipeline({label:t,layout:`auto`,compute:{module:i,entryPoint:t}}),this.#e.set(n,r)}return r}bind(e,t){return this.device.createBindGroup({layout:e.getBindGroupLayout(0),entries:re(t)})}async read(e){let{MAP_READ:t,COPY_DST:n}=GPUBufferUsage,r=this.device.createBuffer({size:e.size,usage:t|n}),i=this.device.createCommandEncoder();i.copyBufferToBuffer(e,0,r,0,e.size),this.device.queue.submit([i.finish()]),await r.mapAsync(GPUMapMode.READ);let a=new Uint32Array(r.getMappedRange().slice(0));return r.destroy(),a}};function ne(e,t,n){if(e<=t)return;let[r,i]=[Math.ceil(e/2**20),Math.floor(t/2**20)];throw new C(`A buffer of ${r} MiB is above this device's limit, ${i} MiB.`,n)}function re(e){return e.map((e,t)=>({binding:t,resource:e instanceof GPUBuffer?{buffer:e}:e}))}function ie(e){let t=Math.max(1,Math.ceil(e/64)),n=Math.min(t,1024);return[n,Math.ceil(t/n)]}var ae=class extends Error{},oe=class{gpu;isWanted;#e=null;constructor(e,t=()=>!0){this.gpu=e,this.isWanted=t}get encoder(){return this.#e??=this.gpu.device.createCommandEncoder()}submit(){this.#e&&this.gpu.device.queue.submit([this.#e.finish()]),this.#e=null}async pause(){if(this.submit(),await this.gpu.device.queue.onSubmittedWorkDone(),!this.isWanted())throw new ae}},se=`// Adds a fragment to its depth bin, one word, and its colour to its pixel's luma, another: one atomic exchange each
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
`,ce=`// Pixels of the window that every 64 triangles cover, those that overlap counted again: what drawing them will cost,
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
`,le=`// Whether there is anything to choose.
@group(0) @binding(0) var<storage, read_write> state: Cuts;
@group(0) @binding(1) var<uniform> budget: u32;

@compute @workgroup_size(1)
fn begin_cuts() {
    state.complete = select(0u, 1u, state.fragments <= budget);
}
`,ue=`// A pixel's words, BINS of them side by side (renderer/shaders/common/bin_words.glsl). \`words\`, [P][BINS], is declared
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
`,de=`// \`binned\`: every fragment into the tail's sums (renderer/shaders/binned/tail.frag).
@fragment
fn blend_tail(in: Surface) -> Tail {
    let stored = stored_surface(in);
    if (is_hidden(in) || !is_transparent(stored)) {
        discard;
        return Tail();
    }
    return tail_of(pixel_of(in), bitcast<f32>(depth_bits(in)), stored);
}
`,fe=`// Depth bins of the binned tails (METHOD.md section 2): renderer/shaders/common/depth_bins.glsl and tile_range.glsl.
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
`,pe=`// Weighted-blended transparency (McGuire and Bavoil 2013), equation 10 with the logarithmic depth of
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
`,me=`// Where a view is seen from.
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
`,he=`// Every transparent fragment into its pixel's run of the pool, in any order: the sort comes after
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
`,ge=`// Fragments of a pixel's first bins are appended to its core, the others go to the tail
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
`,_e=`// Second pass of the chain: every fragment finds its slot by its depth, or goes to the tail
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
`,ve=`// First pass of the two-pass chain: the k(p) smallest depths, lock-free and in any order of arrival
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
`,ye=`// The rank that the budget ends in. One work group.
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
`,be=`// Fragments that can be in a core.
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
`,xe=`// n(p), the transparent fragments of every pixel.
@group(2) @binding(0) var<storage, read_write> n: array<atomic<u32>>;

@fragment
fn count_fragments(in: Surface) {
    let stored = stored_surface(in);
    if (is_hidden(in) || !is_transparent(stored)) {
        return;
    }
    atomicAdd(&n[pixel_of(in)], 1u);
}
`,Se=`// Fragments by the rank of the price that they come at.
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
`,Ce=`// A triangle that covers the window.
@vertex
fn cover(@builtin(vertex_index) corner: u32) -> @builtin(position) vec4f {
    return vec4f(select(-1.0, 3.0, corner == 1u), select(-1.0, 3.0, corner == 2u), 0.0, 1.0);
}
`,we=`// What the passes of a selection of cuts tell each other (renderer/shaders/allocation/state.glsl).
struct Cuts {
    fragments: u32,  // that can be in a core
    complete: u32,   // 1 where the budget covers them: nothing is predicted or selected
    rank: u32,       // of the price that all pixels are granted, plus 1: what grows there takes what is left
    sure: u32,       // fragments below it
}
`,Te=`// A pixel's packed bins as a selection of cuts sees them (renderer/shaders/allocation/bins.glsl). \`words\`, [P][BINS], is
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
`,Ee=`// Sum of squared differences of two pictures' sRGB bytes, by block: integers, so exact. 2048 pixels fit a word.
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
`,De=`// What a screen gets of linear light: one word a pixel, sRGB in three bytes and in the highest one k, up to 255.
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
`,Oe=`// Tiles whose centre no surface covers get the range of those around them, else that of the whole view
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
`,ke=`// What every pixel gets below the chosen rank, and with what comes at it.
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
`,Ae=`// Offsets of the fixed k-buffer: the same number of slots for every pixel of the window.
@group(0) @binding(0) var<storage, read_write> offsets: array<u32>;  // [P + 1]
@group(0) @binding(1) var<uniform> budget: u32;

@compute @workgroup_size(64)
fn place_fixed(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let p = thread_of(id, groups);
    if (p < arrayLength(&offsets)) {
        offsets[p] = p * (budget / (arrayLength(&offsets) - 1u));
    }
}
`,je=`// Every fragment into its depth bin; for a network, its colour as well (renderer/shaders/gather/bins.frag).
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
`,Me=`// A fragment in a pool: depth bits; red and green, blue and opacity, as half floats.
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
`,Ne=`// What the depth bins know to be in front of a fragment (renderer/shaders/kbuffer/tail.glsl).
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
`,Pe=`// From the blocks' totals to the view's. One work group.
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
`,Fe=`// What is kept of a pixel's depth bins, 16 bits each, two a word, and what it says of a fragment
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
`,Ie=`// The next smaller level of a texture. The texture unit decodes and encodes sRGB: it is light that is averaged.
@group(0) @binding(0) var finer: texture_2d<f32>;
@group(0) @binding(1) var smooth_sampler: sampler;

@fragment
fn halve(@builtin(position) position: vec4f) -> @location(0) vec4f {
    let size = max(textureDimensions(finer) / 2u, vec2u(1u));
    return textureSample(finer, smooth_sampler, position.xy / vec2f(size));
}
`,Le=`// The background of every technique: opaque fragments only, stored gamma-2 like the transparent ones.
@fragment
fn opaque_colour(in: Surface) -> @location(0) vec4f {
    let stored = stored_surface(in);
    if (stored.a < 255u) {
        discard;
    }
    return vec4f(stored) / 255.0;
}
`,Re=`// What is kept of every pixel's gathered depth bins, and the fragments of each, in their place
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
`,ze=`// What the passes over pixels share: a pixel for each thread, 64 a group, in two dimensions.
fn thread_of(id: vec3u, groups: vec3u) -> u32 {
    return id.y * groups.x * 64u + id.x;
}

// Of a picture, at a pixel.
fn texel_of(picture: texture_2d<f32>, p: u32) -> vec4f {
    let width = textureDimensions(picture).x;
    return textureLoad(picture, vec2u(p % width, p / width), 0);
}
`,Be=`// Where each pixel's run of slots begins if every fragment has one.
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
`,Ve=`// Where each pixel's core begins in the pool. What is left of the budget goes to the pixels that grow at the chosen rank,
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
`,He=`// The two pictures beside each other, or what one wants to know of them.
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
`,Ue=`// The bundle's network on every occupied pixel: what it answers of each bin becomes the rank of the bin's price
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
`,We=`// An estimate of the depths between which each tile's fragments lie, at a quarter of the resolution: STEPS pixels across
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
`,Ge=`// The colour of all fragments as one weighted mean, with their total transmittance.
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
`,Ke=`// Slots front to back, then the tail, then the background (renderer/shaders/kbuffer/resolve.frag).
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
`,qe=`// Each pixel's sorted core front to back, then the tail, then the background (renderer/shaders/kbuffer/resolve.frag).
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
`,Je=`// Each pixel's sorted run, composited front to back.
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
`,Ye=`// Exclusive prefix sums over the blocks, in place. One work group: each thread has a run of them. Sums stop at CEILING,
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
`,Xe=`// The bundle's network on the rows of its manifest's self-test.
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
`,Ze=`// A fragment in a pool: packed colour, depth bits.
alias Slot = vec2u;

fn comes_before(one: Slot, two: Slot) -> bool {
    return one.y < two.y || (one.y == two.y && one.x < two.x);
}
`,Qe=`// Sorts each pixel's run by depth, then colour: heapsort, in place. \`Slot\` is declared before.
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
`,$e=`// Geometry and shading, shared by every geometry pass: renderer/shaders/common/surface.{vert,glsl} in WGSL.
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
`,et=`// A fragment's part of the tail's sums, weighed by what the depth bins know to be in front of it
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
`,tt=`// What the tail reads.
@group(2) @binding(0) var<storage, read> ranges: array<vec2f>;  // [T]
@group(2) @binding(1) var<storage, read> words: array<u32>;     // [P][BINS], packed
`,nt=`// Ranges of tiles that were found in a texture.
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
`,rt=`// Fragments, occupied pixels and the fullest one's fragments of every block.
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
`;function it(e){let t=Object.hasOwn(b,e)?b[e]:null;return t&&t.bins>0?{name:e,...t}:null}var at=it(x),ot=Object.keys(b).flatMap(e=>it(e)??[]).filter(e=>e.meanLevels>0).reduce((e,t)=>t.bins>e.bins?t:e),st=Object.assign({"./shaders/add_to_bins.wgsl":se,"./shaders/areas.wgsl":ce,"./shaders/begin_cuts.wgsl":le,"./shaders/bin_words.wgsl":ue,"./shaders/binned.wgsl":de,"./shaders/bins.wgsl":fe,"./shaders/blended.wgsl":pe,"./shaders/camera.wgsl":me,"./shaders/capture.wgsl":he,"./shaders/capture_core.wgsl":ge,"./shaders/chain_colour.wgsl":_e,"./shaders/chain_depth.wgsl":ve,"./shaders/choose.wgsl":ye,"./shaders/core_totals.wgsl":be,"./shaders/count.wgsl":xe,"./shaders/count_prices.wgsl":Se,"./shaders/cover.wgsl":Ce,"./shaders/cut_state.wgsl":we,"./shaders/cuts_of_counts.wgsl":Te,"./shaders/difference.wgsl":Ee,"./shaders/display.wgsl":De,"./shaders/fill_ranges.wgsl":Oe,"./shaders/find_cuts.wgsl":ke,"./shaders/fixed.wgsl":Ae,"./shaders/gather_bins.wgsl":je,"./shaders/half_slot.wgsl":Me,"./shaders/in_front.wgsl":Ne,"./shaders/join.wgsl":Pe,"./shaders/kept_bins.wgsl":Fe,"./shaders/mipmap.wgsl":Ie,"./shaders/opaque.wgsl":Le,"./shaders/pack.wgsl":Re,"./shaders/pixels.wgsl":ze,"./shaders/place_all.wgsl":Be,"./shaders/place_cuts.wgsl":Ve,"./shaders/present.wgsl":He,"./shaders/prices.wgsl":Ue,"./shaders/range.wgsl":We,"./shaders/resolve_blended.wgsl":Ge,"./shaders/resolve_chain.wgsl":Ke,"./shaders/resolve_core.wgsl":qe,"./shaders/resolve_exact.wgsl":Je,"./shaders/scan.wgsl":Ye,"./shaders/self_test.wgsl":Xe,"./shaders/slot.wgsl":Ze,"./shaders/sort.wgsl":Qe,"./shaders/surface.wgsl":$e,"./shaders/tail.wgsl":et,"./shaders/tail_inputs.wgsl":tt,"./shaders/take_ranges.wgsl":nt,"./shaders/totals.wgsl":rt}),ct=2048,lt=2**31-1,ut=4096;function dt({bins:e,shareLevels:t,meanLevels:n}){let r={BINS:`${e}u`,FOURS:`${e/4}u`,SHARE_LEVELS:`${t}`,MEAN_LEVELS:`${n}`},i={BLOCK:`${ct}u`,TURNS:`${ut}u`,TEXELS:`11`};return Object.entries({...S,...r,...i}).map(([e,t])=>`const ${e} = ${t};`).join(`
`)}function w(e,t=at,n=``){let r=e.map(e=>{let t=st[`./shaders/${e}.wgsl`];if(t===void 0)throw Error(`there is no shader ${e}`);return t});return[n,dt(t),...r].join(`
`)}var ft=4,pt=Number(S.RANKS),mt=[`cut_state`,`bin_words`,`cuts_of_counts`],ht=e=>Math.floor(e/ct)+1;function gt(e,t){return Math.min(Math.floor(e*t),lt-1)}var _t=class{#e;#t;#n;constructor(e){this.#e=e,this.#t=ht(e.pixels),this.#n=e.gpu.filled(new Uint32Array(4),GPUBufferUsage.UNIFORM)}get offsets(){return this.#e.words(`offsets`,this.#e.pixels+1)}get cuts(){return this.#e.words(`cuts`,this.#e.pixels)}get state(){return this.#e.words(`cut state`,ft)}get#r(){return this.#e.words(`sums`,2*this.#t)}async totals(e,t){let n=this.#e.words(`counted`,3),r=this.#a(e,t);this.#o(e,[`join`],`join`,[r,n],1),e.submit();let[i,a,o]=await this.#e.gpu.read(n);return[i,a,o]}placeAll(e,t){this.#a(e,t),this.#o(e,[`scan`],`scan`,[this.#e.words(`total`,1),this.#r],1),this.#o(e,[`place_all`],`place_all`,[t,this.#r,this.offsets],this.#t)}placeFixed(e,t){this.#i(t),this.#e.forPixels(e,[`fixed`],`place_fixed`,[this.offsets,this.#n],{threads:this.#e.pixels+1})}begin(e,{tail:t,words:n},r){this.#i(r),e.encoder.clearBuffer(this.state),this.#o(e,[...mt,`core_totals`],`total_cores`,[n,this.state],this.#t,t),this.#o(e,[`cut_state`,`begin_cuts`],`begin_cuts`,[this.state,this.#n],1,t)}place(e,{tail:t,words:n}){let r=this.#e.zeros(e,`prices`,pt),[i,a,o]=[this.state,this.cuts,this.#r];this.#o(e,[...mt,`count_prices`],`count_prices`,[n,i,r],this.#t,t),this.#o(e,[`cut_state`,`choose`],`choose`,[i,r,this.#n],1,t),this.#o(e,[...mt,`find_cuts`],`find_cuts`,[n,i,a,o],this.#t,t),this.#o(e,[`scan`],`scan`,[i,o],1);let s=[i,a,o,this.offsets,this.#n,n];this.#o(e,[...mt,`place_cuts`],`place_cuts`,s,this.#t,t)}destroy(){this.#n.destroy()}#i(e){this.#e.gpu.device.queue.writeBuffer(this.#n,0,new Uint32Array([Math.min(e,lt-1)]))}#a(e,t){let n=this.#e.words(`totals`,4*this.#t);return this.#o(e,[`totals`],`total_blocks`,[t,n,this.#r],this.#t),n}#o(e,t,n,r,i,a){this.#e.dispatch(e,w(t,a),n,r,[i,1])}},vt=[`bins`,`bin_words`,`add_to_bins`,`gather_bins`],yt={files:vt,entryPoint:`gather_tail`,writes:[!1,!0]},bt={files:vt,entryPoint:`gather_all`,writes:[!1,!0,!0]},xt=[`bins`,`tail_inputs`,`kept_bins`,`in_front`,`tail`],St=(e,{words:t})=>[e.ranges,t],Ct=e=>[e.target(`tail`,`rgba16float`),e.target(`optical depth`,e.gpu.scalarFormat)];async function wt(e,t,n,r){let i=e.zeros(t,`${n.bins} bins`,n.bins*e.pixels),a=r?e.zeros(t,`luma`,e.pixels):null,o=[e.ranges,i,...a?[a]:[]];return await e.geometry.drawTransparent(t,{...r?bt:yt,tail:n},e.depth,o),Tt(e,t,n,i),{tail:n,words:i,luma:a}}function Tt(e,t,n,r){e.forPixels(t,[`bin_words`,`pack`],`pack_bins`,[r],{tail:n})}var Et=[`cut_state`,`bin_words`,`cuts_of_counts`,`bins`,`kept_bins`,`prices`];function Dt(e,t,n,r,i,a,o){let s=[r.words,i.state,a,r.luma,o.createView()],c={tail:n.tail,before:n.wgsl};e.forPixels(t,Et,`predict_ranks`,s,c)}async function Ot(e,t){let{features:n,outputs:r,output_scale:i,tolerance:a}=t.selfTest,{STORAGE:o,COPY_SRC:s}=GPUBufferUsage;e.device.pushErrorScope(`validation`);let c=e.compute(w([`self_test`],t.tail,t.wgsl),`answer_rows`),l=e.filled(new Float32Array(n.flat()),o),u=e.filled(new Float32Array(r.flat().length),o|s),d=e.device.createCommandEncoder(),f=d.beginComputePass();f.setPipeline(c),f.setBindGroup(0,e.bind(c,[l,u])),f.dispatchWorkgroups(Math.ceil(n.length/16)),f.end(),e.device.queue.submit([d.finish()]);let p=new Float32Array((await e.read(u)).buffer),m=await e.device.popErrorScope(),h=r[0].length,g=a[`predict.wgsl`]??0,_=r.flat().every((e,t)=>Math.abs(p[t]-e)<=g*i[t%h]);if(l.destroy(),u.destroy(),m||!_)throw new C(`The network of '${t.name}' ${t.version} does not answer its self-test rightly on this device.`,`Update the browser and the graphics driver; the other techniques work without it.`)}var kt=class{gpu;width;height;pixels;#e=new Map;constructor(e,t,n){this.gpu=e,this.width=t,this.height=n,this.pixels=t*n}get bytes(){return[...this.#e.values()].reduce((e,{size:t})=>e+t,0)}destroy(){for(let e of this.#e.values())e.destroy()}words(e,t){let n=this.#e.get(e);if(n&&n.size===4*Math.max(t,1))return n;n?.destroy(),this.#e.delete(e);let r=this.gpu.words(t);return this.#e.set(e,r),r}zeros(e,t,n){let r=this.room(t,n);return e.encoder.clearBuffer(r,0,4*n),r}room(e,t){return this.words(e,Math.max(t,(this.#e.get(e)?.size??0)/4))}forPixels(e,t,n,r,{tail:i=at,before:a=``,threads:o=this.pixels}={}){this.dispatch(e,w([`pixels`,...t],i,a),n,r,ie(o))}dispatch(e,t,n,r,i){let a=this.gpu.compute(t,n),o=e.encoder.beginComputePass();o.setPipeline(a),o.setBindGroup(0,this.gpu.bind(a,r)),o.dispatchWorkgroups(...i),o.end()}},At=`depth32float`,jt=`rgba8unorm`,Mt=[[12,`float32x3`],[12,`float32x3`],[8,`float32x2`],[4,`unorm8x4`]].map(([e,t],n)=>({arrayStride:e,attributes:[{format:t,offset:0,shaderLocation:n}]})),Nt={color:{srcFactor:`one`,dstFactor:`one`,operation:`add`},alpha:{srcFactor:`one`,dstFactor:`one`,operation:`add`}},Pt=176,Ft=16,It=64,Lt=2**24,Rt=2**28,zt=class{gpu;scene;#e;#t;#n;#r;#i;#a;#o;#s=new Map;#c=[];constructor(e,t){this.gpu=e,this.scene=t;let{device:n}=e,{VERTEX:r,INDEX:i,UNIFORM:a,STORAGE:o}=GPUBufferUsage,{positions:s,normals:c,uvs:l,colours:u}=t;this.#n=[e.filled(s,r|o),...[c,l,u].map(t=>e.filled(t,r))],this.#r=e.filled(t.indices,i|o),this.#e=e.filled(new Uint8Array(Pt),a),this.#t=e.filled(new Uint8Array(Pt),a);let d=GPUShaderStage.VERTEX|GPUShaderStage.FRAGMENT,f=GPUShaderStage.FRAGMENT,p={binding:0,visibility:d,buffer:{type:`uniform`}},m={binding:1,visibility:f,texture:{sampleType:`depth`}};this.#o={camera:n.createBindGroupLayout({entries:[p]}),frame:n.createBindGroupLayout({entries:[p,m]}),look:n.createBindGroupLayout({entries:[{binding:0,visibility:f,buffer:{type:`uniform`}},{binding:1,visibility:f,texture:{}},{binding:2,visibility:f,sampler:{}}]})};let h=new Map;this.#a=t.batches.map(t=>{let n=t.image?.pixels??null;return h.has(n)||h.set(n,Ht(e,n)),{batch:t,look:this.#p(t,h.get(n).createView())}}),this.#i=[...h.values()]}destroy(){let e=[...this.#n,this.#r,this.#e,this.#t,...this.#i];for(let t of e)t.destroy()}get isSlow(){return this.#c.length>1}async look(e,t,n){this.gpu.device.queue.writeBuffer(this.#e,0,e),this.gpu.device.queue.writeBuffer(this.#t,0,Bt(e,t));let r=await this.#u(),i=r.reduce((e,t)=>e+t,0),a=Number.isNaN(i)?1/0:i;if(a>Rt){let[e,t]=[a,Rt].map(e=>Math.floor(e/n).toLocaleString(`en`));throw new C(`The surfaces cover the picture ${e} times over; at this size, ${t} times can be drawn here.`,`Look from elsewhere, make the window smaller, or open a simpler scene.`)}this.#c=Vt(r,this.scene.indices.length)}async drawOpaque(e,t,n,r){let i=this.#m(w([`camera`,`surface`,`opaque`]),`opaque_colour`,()=>({layout:[this.#o.camera,this.#o.look],targets:[{format:jt}],depth:{format:At,depthWriteEnabled:!0,depthCompare:`less`}}));await this.#l(e,[`opaque`,`mixed`],a=>{let o=e.encoder.beginRenderPass({colorAttachments:[{view:t.createView(),loadOp:a,storeOp:`store`,clearValue:r}],depthStencilAttachment:{view:n.createView(),depthLoadOp:a,depthStoreOp:`store`,depthClearValue:1}});return o.setPipeline(i),o.setBindGroup(0,this.#d(this.#o.camera,[this.#e])),o})}async drawTransparent(e,t,n,r,i=[]){let a=w([`camera`,`surface`,...t.files],t.tail),o=this.#m(a,t.entryPoint,()=>({layout:[this.#o.frame,this.#o.look,this.#f(t.writes)],targets:i.map(({format:e})=>({format:e,blend:Nt})),depth:{format:At,depthWriteEnabled:!1,depthCompare:`always`}}));await this.#l(e,[`mixed`,`transparent`],t=>{let a=e.encoder.beginRenderPass({colorAttachments:i.map(e=>({view:e.createView(),loadOp:t,storeOp:`store`})),depthStencilAttachment:{view:n.createView(),depthReadOnly:!0}});return a.setPipeline(o),a.setBindGroup(0,this.#d(this.#o.frame,[this.#e,n.createView()])),a.setBindGroup(2,this.#d(o.getBindGroupLayout(2),r)),a})}async drawCoarse(e,t,n,r){let i=this.#m(w([`camera`,`surface`,...t.files]),t.entryPoint,()=>({layout:[this.#o.camera,this.#o.look,this.#f(t.writes)],targets:[{format:n.format,writeMask:0}]}));await this.#l(e,[`mixed`,`transparent`],t=>{let a=e.encoder.beginRenderPass({colorAttachments:[{view:n.createView(),loadOp:t,storeOp:`discard`}]});return a.setPipeline(i),a.setBindGroup(0,this.#d(this.#o.camera,[this.#t])),a.setBindGroup(2,this.#d(i.getBindGroupLayout(2),[r])),a})}async#l(e,t,n){for(let[r,i]of this.#c.entries()){r>0&&await e.pause();let a=n(r>0?`load`:`clear`);this.#n.forEach((e,t)=>a.setVertexBuffer(t,e)),a.setIndexBuffer(this.#r,`uint32`);for(let{batch:e,look:n}of this.#a){let[r,o]=[Math.max(e.first,i.first),Math.min(e.first+e.count,i.end)];!t.includes(e.layer)||o<=r||(a.setBindGroup(1,n),a.drawIndexed(o-r,1,r))}a.end()}}async#u(){let e=Math.ceil(this.scene.indices.length/192),t=this.gpu.words(e),n=new oe(this.gpu),r=this.gpu.compute(w([`camera`,`areas`]),`add_areas`),i=n.encoder.beginComputePass();i.setPipeline(r),i.setBindGroup(0,this.gpu.bind(r,[this.#e,this.#n[0],this.#r,t])),i.dispatchWorkgroups(...ie(It*e)),i.end(),n.submit();let a=await this.gpu.read(t);return t.destroy(),new Float32Array(a.buffer)}#d(e,t){return this.gpu.device.createBindGroup({layout:e,entries:re(t)})}#f(e){return this.gpu.device.createBindGroupLayout({entries:e.map((e,t)=>({binding:t,visibility:GPUShaderStage.FRAGMENT,buffer:{type:e?`storage`:`read-only-storage`}}))})}#p(e,t){let n=new ArrayBuffer(32);new Float32Array(n).set([...e.scale,e.threshold]),new Uint32Array(n)[5]=+(e.layer===`opaque`);let[r,i]=e.image?.wrap??[`repeat`,`repeat`],a=this.gpu.device.createSampler({addressModeU:r,addressModeV:i,magFilter:`linear`,minFilter:`linear`,mipmapFilter:`linear`}),o=this.gpu.filled(new Uint8Array(n),GPUBufferUsage.UNIFORM);return this.#d(this.#o.look,[o,t,a])}#m(e,t,n){let r=`${t}\n${e}`,i=this.#s.get(r);if(!i){let{layout:a,targets:o,depth:s}=n(),{device:c}=this.gpu,l=c.createShaderModule({code:e,label:t});i=c.createRenderPipeline({label:t,layout:c.createPipelineLayout({bindGroupLayouts:a}),vertex:{module:l,entryPoint:`place`,buffers:Mt},fragment:{module:l,entryPoint:t,targets:o},primitive:{topology:`triangle-list`,cullMode:`none`},...s&&{depthStencil:s}}),this.#s.set(r,i)}return i}};function Bt(e,[t,n]){let r=new Float32Array(e.slice(0));for(let e=0;e<4;++e){let i=Ft+4*e,a=r[i+3];r[i]=t*r[i]+(t-1)*a,r[i+1]=n*r[i+1]+(1-n)*a}return r.buffer}function Vt(e,t){let n=[],[r,i]=[0,0];for(let t=0;t<e.length;++t){let a=192*t;i>0&&i+e[t]>Lt&&(n.push({first:r,end:a}),[r,i]=[a,0]),i+=e[t]}return[...n,{first:r,end:t}]}function Ht(e,t){let{device:n}=e,{width:r,height:i}=t??{width:1,height:1},a=n.limits.maxTextureDimension2D;if(Math.max(r,i)>a)throw new C(`An image of ${r} × ${i} is above this device's limit, ${a}.`,`Make it smaller.`);let o=n.createTexture({size:[r,i],format:`rgba8unorm-srgb`,mipLevelCount:1+Math.floor(Math.log2(Math.max(r,i))),usage:GPUTextureUsage.TEXTURE_BINDING|GPUTextureUsage.COPY_DST|GPUTextureUsage.RENDER_ATTACHMENT});if(!t)return n.queue.writeTexture({texture:o},new Uint8Array([255,255,255,255]),{},[1,1]),o;n.queue.copyExternalImageToTexture({source:t},{texture:o},[r,i]);let s=n.createShaderModule({code:w([`cover`,`mipmap`])}),c=n.createRenderPipeline({layout:`auto`,vertex:{module:s,entryPoint:`cover`},fragment:{module:s,entryPoint:`halve`,targets:[{format:o.format}]}}),l=n.createSampler({minFilter:`linear`,magFilter:`linear`}),u=n.createCommandEncoder();for(let e=1;e<o.mipLevelCount;++e){let t=e=>o.createView({baseMipLevel:e,mipLevelCount:1}),r=u.beginRenderPass({colorAttachments:[{view:t(e),loadOp:`clear`,storeOp:`store`}]});r.setPipeline(c);let i=c.getBindGroupLayout(0);r.setBindGroup(0,n.createBindGroup({layout:i,entries:re([t(e-1),l])})),r.draw(3),r.end()}return n.queue.submit([u.finish()]),o}var Ut=[`picture`,`count`,`error`];async function Wt(e,t,n){let r=ht(e.pixels),i=e.words(`squares`,r),a=new oe(e.gpu);return e.dispatch(a,w([`difference`]),`add_squares`,[t,n,i],[r,1]),a.submit(),(await e.gpu.read(i)).reduce((e,t)=>e+t,0)/(3*e.pixels*255**2)}var Gt=e=>e===0?1/0:-10*Math.log10(e),Kt=class{gpu;#e;#t;#n;constructor(e,t){this.gpu=e;let n=navigator.gpu.getPreferredCanvasFormat(),r=t.getContext(`webgpu`);if(!r)throw new C(`The browser cannot show what WebGPU draws.`,`Update the browser.`);this.#e=r,this.#e.configure({device:e.device,format:n,alphaMode:`opaque`});let i=e.device.createShaderModule({code:w([`cover`,`present`])});this.#t=e.device.createRenderPipeline({layout:`auto`,vertex:{module:i,entryPoint:`cover`},fragment:{module:i,entryPoint:`present`,targets:[{format:n}]}}),this.#n=e.filled(new Uint32Array(4),GPUBufferUsage.UNIFORM)}clear(){let e=this.gpu.device.createCommandEncoder();this.#r(e).end(),this.gpu.device.queue.submit([e.finish()])}show(e,t,n,r,i,a){let{device:o}=this.gpu,s=new ArrayBuffer(16);new Float32Array(s)[0]=n,new Uint32Array(s).set([Ut.indexOf(t),e.width],1),o.queue.writeBuffer(this.#n,0,s);let c=o.createCommandEncoder(),l=this.#r(c);l.setPipeline(this.#t);let u=this.#t.getBindGroupLayout(0),d=re([this.#n,r,i,a]);l.setBindGroup(0,o.createBindGroup({layout:u,entries:d})),l.draw(3),l.end(),o.queue.submit([c.finish()])}#r(e){let t=this.#e.getCurrentTexture().createView();return e.beginRenderPass({colorAttachments:[{view:t,loadOp:`clear`,storeOp:`store`,clearValue:[1,1,1,1]}]})}},qt=`manifest.json`,Jt=`predict.wgsl`,Yt=`diaphane-bundle/2`,Xt=[`format`,`name`,`head`,`outputs`,`features`,`hidden`,`layers`,`tail`,`metric`,`files`,`onnx`,`self_test`,`parity`,`provenance`,`evaluation`],Zt=64*2**20,Qt=2**20,$t=16,en=256,tn=64;function nn(e){let t=T(JSON.parse(e));if(t.format!==Yt)throw Error(`its format is not ${Yt}`);let n=Xt.filter(e=>!(e in t));if(n.length)throw Error(`${n.join(`, `)} is missing`);let r=Object.keys(t).filter(e=>!Xt.includes(e));if(r.length)throw Error(`${r.join(`, `)} is unknown`);let{name:i,g:a}=T(t.tail),o=it(String(i)),s=String(t.head);if(!o||E(a)<0)throw Error(`it has a tail without depth bins, or an unknown one, ${i}`);if(String(t.outputs)!==rn(s,o))throw Error(`it has a head that is none, ${s} with ${t.outputs}`);let c=sn(t.features,en);for(let e of c.map(T)){if(typeof e.name!=`string`||!(E(e.std)>0))throw Error(`a feature has no spread`);E(e.mean)}let l=an(t.files);if(!(`predict.wgsl`in l))throw Error(`there is no ${Jt}`);return{tail:o,files:l,selfTest:on(t,c.length)}}function rn(e,{bins:t}){return e===`importance`?`importance`:e===`bin-gains`?[...Array.from({length:t},(e,t)=>`gain_${t}`),`prior`].join():null}function an(e){let t=Object.entries(T(e)).map(([e,t])=>{let{sha256:n,bytes:r}=T(t),i=e===`manifest.json`?Qt:Zt;if(!/^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$/.test(e)||!/^[0-9a-f]{64}$/.test(String(n)))throw Error(`a file has no proper name or hash`);if(!Number.isInteger(r)||E(r)<0||E(r)>i)throw Error(`a file has no proper size`);return[e,{sha256:String(n),bytes:E(r)}]});if(t.length===0||t.length>$t)throw Error(`there are no files, or too many`);return Object.fromEntries(t)}function on(e,t){let n=T(e.self_test),r=sn(e.outputs,tn).length,i=(e,t)=>sn(e,1024).map(e=>{let n=sn(e,1024).map(E);if(n.length!==t)throw Error(`the self-test is not of the size of the network`);return n}),a={features:i(n.features,t),outputs:i(n.outputs,r)};if(a.features.length!==a.outputs.length||a.features.length===0)throw Error(`the self-test has no rows, or not as many answers`);let[o]=i([n.output_scale],r),s=Object.fromEntries(Object.entries(T(n.tolerance)).map(([e,t])=>[e,E(t)]));return{...a,output_scale:o,tolerance:s}}function T(e){if(typeof e!=`object`||!e||Array.isArray(e))throw Error(`a member is of another type`);return e}function sn(e,t){if(!Array.isArray(e)||e.length>t)throw Error(`a list is none, or too long`);return e}function E(e){if(typeof e!=`number`||!Number.isFinite(e))throw Error(`a number is not finite`);return e}async function cn(e,t,n){let r,[i,a]=[ln(e),ln(n)];if(i?.length!==32||a?.length!==64)return!1;try{r=await crypto.subtle.importKey(`raw`,i,{name:`Ed25519`},!1,[`verify`])}catch(e){return e instanceof DOMException&&e.name===`NotSupportedError`&&null}return crypto.subtle.verify({name:`Ed25519`},r,a,new TextEncoder().encode(t))}function ln(e){try{let t=atob(e);return btoa(t)===e?Uint8Array.from(t,e=>e.charCodeAt(0)):null}catch{return null}}var un=`diaphane-release/1`,D=`Ask who runs the server: it may be misconfigured, or somebody may have tampered with it.`,dn=`The server's answer is not the record of a version.`;function fn(e){try{let t=T(JSON.parse(e)),n=e=>{let n=t[e];if(typeof n!=`string`)throw Error(`a text is not one`);return n},r=an(t.files);if(!(`manifest.json`in r))throw Error(`there is no manifest`);return{name:n(`name`),version:n(`version`),digest:n(`digest`),statement:n(`statement`),signature:n(`signature`),public_key:n(`public_key`),files:r}}catch{throw new C(dn,`Load the page again.`)}}function pn(e){let t=/^(\d{1,6})\.(\d{1,6})\.(\d{1,6})$/.exec(e);return t?t.slice(1).map(Number):[]}async function mn(e,t){let{name:n,version:r,digest:i}=t;if(e.name!==n||e.version!==r||e.digest!==i)throw new C(`The server sent '${e.name}' ${e.version}, and states that '${n}' ${t.selector} is ${r} with other files.`,D);if(e.public_key!==t.keys.at(-1))throw new C(`'${n}' ${r} is signed with another key than the statement that names it.`,`If the server's key was changed a moment ago, try again; else ask who runs it.`);if(await cn(e.public_key,e.statement,e.signature)===!1)throw new C(`The signature of '${n}' ${r} is wrong.`,D);let a;try{a=T(JSON.parse(e.statement))}catch{throw new C(`The statement of '${n}' cannot be read.`,D)}let o={format:un,name:n,version:r,digest:i,files:e.files};if(Object.entries(o).some(([e,t])=>_n(a[e])!==_n(t)))throw new C(`The record of '${n}' does not say what its signature is for.`,D);if(i!==await gn(e.files))throw new C(`The record of '${n}' contradicts itself.`,D)}async function hn(e){let t=await crypto.subtle.digest(`SHA-256`,e);return Array.from(new Uint8Array(t),e=>e.toString(16).padStart(2,`0`)).join(``)}async function gn(e){let t=Object.fromEntries(Object.entries(e).map(([e,t])=>[e,t.sha256]));return hn(new TextEncoder().encode(_n(t)))}function _n(e){return typeof e!=`object`||!e||Array.isArray(e)?JSON.stringify(e)??``:`{${Object.entries(e).sort(([e],[t])=>e<t?-1:1).map(([e,t])=>`${JSON.stringify(e)}:${_n(t)}`).join(`,`)}}`}var vn=`diaphane-pointer/1`,yn=`diaphane-handover/1`,bn=64,xn=[`digest`,`expires`,`format`,`issued`,`name`,`selector`,`serial`,`version`];async function Sn(e){try{let t=T(JSON.parse(e)),n=O(t.public_key),r=t.handovers;if(!Array.isArray(r)||r.length>bn)throw Error(`there are too many handovers`);let i=[cn(n,O(t.statement),O(t.signature))],a=[];for(let e of r){let t=T(JSON.parse(O(e.statement))),[n,r]=[O(t.from),O(t.to)];if(t.format!==yn||n!==(a.at(-1)??n))throw Error(`a key is missing`);i.push(cn(n,e.statement,O(e.signature))),a.length===0&&a.push(n),a.push(r)}if((a.at(-1)??n)!==n)throw Error(`the handovers lead to another key`);let o=await Promise.all(i);if(o.includes(!1))throw Error(`a signature is wrong`);let s=T(JSON.parse(t.statement));if(s.format!==vn||Object.keys(s).sort().join()!==xn.join())throw Error(`it is another statement`);let c={name:O(s.name),selector:O(s.selector),version:O(s.version),digest:O(s.digest),serial:Cn(s.serial),issued:Cn(s.issued),expires:Cn(s.expires),keys:a.length?a:[n]};if(!pn(c.version).length||!/^[0-9a-f]{64}$/.test(c.digest))throw Error(`no version`);return{pointer:c,isSigned:!o.includes(null)}}catch{throw new C(`The server's statement of what the alias means is not one, or its signature is wrong.`,`Load the page again; if it stays so, ask who runs the server.`)}}function O(e){if(typeof e!=`string`)throw Error(`a text is not one`);return e}function Cn(e){if(!Number.isSafeInteger(e)||e<0)throw Error(`a number is not one`);return e}var wn={key:null,retired:[],names:{}},Tn=86400,En=`diaphane-trust/1`,Dn=`Ask who runs the server: it may be misconfigured, or somebody may have tampered with it.`;function On(e,t,n,r,i){let a=zn(e.names,t);An(t,n,r),jn(e,a,r),Mn(a,r,i),a&&Nn(a,r);let o=zn(a?.marks,n),s={serial:r.serial,version:r.version,issued:Math.max(r.issued,o?.issued??0)},c=r.keys.at(-1);return{key:c,retired:[...new Set([...e.retired,...r.keys.slice(0,-1)])],names:{...e.names,[t]:{key:c,marks:{...a?.marks,[n]:s},versions:{...a?.versions,[r.version]:r.digest}}}}}function kn(e,t){let{[t]:n,...r}=e.names;return{key:null,retired:e.retired,names:r}}function An(e,t,n){if(n.name!==e||n.selector!==t)throw new C(`The server's statement is about ${`'${n.name}' ${n.selector}`}, not about '${e}' ${t}.`,Dn);if(pn(t).length&&n.version!==t)throw new C(`The server has ${n.version} for '${e}' ${t}.`,Dn)}function jn(e,t,n){if(e.retired.includes(n.keys.at(-1)))throw new C(`'${n.name}' is signed with a key that was handed over to another one.`,`Ask who runs the server: it may not use its new key everywhere, or the old one was stolen.`);if(![e.key,t?.key].filter(e=>e!=null).every(e=>n.keys.includes(e)))throw new C(`'${n.name}' is signed with a key to which the one that this browser trusts did not hand over.`,`If the server's key was changed on purpose, forget the trusted key below.`)}function Mn(e,t,n){let r=`The statement of what '${t.name}' ${t.selector} means`;if(t.issued>n+300)throw new C(`${r} is of ${A(t.issued)}, which is yet to come: it is ${A(n)} here.`,`Set the clock of this machine, or of the server.`);let i=t.expires-t.issued;if(i<=0||i>Tn)throw new C(`${r} holds until ${A(t.expires)}, which is too long.`,Dn);if(t.expires+300<=n)throw new C(`${r} expired at ${A(t.expires)}, and it is ${A(n)}.`,`Set the clock of this machine; if it is right, something on the way to the server serves old answers.`);let a=Math.max(0,...Object.values(e?.marks??{}).map(e=>e.issued));if(t.expires+300<=a)throw new C(`${r} expired at ${A(t.expires)}, and one of ${A(a)} was seen here.`,`Set the clock of this machine; if it is right and the server's was wrong then, forget the model below.`)}function Nn(e,t){let{name:n,selector:r,version:i}=t;if((zn(e.versions,i)??t.digest)!==t.digest)throw new C(`'${n}' ${i} has other files than it had before.`,`Versions never change: ask who runs the server.`);let a=zn(e.marks,r);if(a){if(t.serial<a.serial)throw new C(`The server's statement of what '${n}' ${r} means is older than one that was seen here: ${i}, where it was ${a.version} later.`,`Something may serve old answers; if the server's database was restored, move the alias once there.`);if(t.serial===a.serial&&i!==a.version)throw new C(`The server says that '${n}' ${r} is ${i} and ${a.version} at once.`,Dn)}}function Pn(e){return JSON.stringify({format:En,...e})}function Fn(e){if(e===null)return wn;try{let{format:t,key:n,retired:r,names:i}=T(JSON.parse(e));if(t!==En||!(n===null||k(n)))throw Error(`the format is another one`);if(!Array.isArray(r)||!r.every(k))throw Error(`a key is not one`);return{key:n,retired:r,names:Rn(i,In)}}catch{throw new C(`What this browser saw of models cannot be read.`,`Forget it below, and choose the model again.`)}}function In(e){let{key:t,marks:n,versions:r}=T(e);if(!k(t))throw Error(`a key is not one`);return{key:t,marks:Rn(n,Ln),versions:Rn(r,e=>{if(!k(e))throw Error(`a digest is not one`);return e})}}function Ln(e){let{serial:t,version:n,issued:r}=T(e);if(!Number.isSafeInteger(t)||!Number.isSafeInteger(r)||!k(n))throw Error(`no mark`);return{serial:t,version:n,issued:r}}function Rn(e,t){return Object.fromEntries(Object.entries(T(e)).map(([e,n])=>[e,t(n)]))}function zn(e,t){return e&&Object.hasOwn(e,t)?e[t]:void 0}var k=e=>typeof e==`string`,A=e=>new Date(1e3*Math.min(e,253402300799)).toISOString().replace(`T`,` `).replace(/\.\d+Z/,` UTC`),Bn=`/demo/v1`,Vn=`/demo/session`,Hn=`diaphane trust`,Un=/^[a-z0-9](?:[a-z0-9-]{0,61}[a-z0-9])?$/,Wn=/^[a-z0-9](?:[a-z0-9.-]{0,38}[a-z0-9])?$/,Gn=class extends C{constructor(){super(`Nobody is signed in.`,`Sign in to render with a published model.`)}},Kn=class{memory;ask;now;constructor(e,t=(...e)=>fetch(...e),n=()=>Date.now()/1e3){this.memory=e,this.ask=t,this.now=n}async choices(){let{signed_in:e}=qn(await this.#r(Vn));if(e!==!0)throw new Gn;let t=[],n=`${Bn}/models?limit=200`;for(;n;){let e=await this.#r(n),r=qn(e);for(let{name:e,aliases:n,latest:i}of r.items){let r=Object.entries(n);for(let[n,i]of r)t.push({name:e,selector:n,version:i});r.length===0&&t.push({name:e,selector:i,version:i})}n=Yn(e)}let r=e=>e.selector===`champion`?0:1;return t.sort((e,t)=>r(e)-r(t))}async pull(e,t){if(!Un.test(e)||!Wn.test(t))throw new C(`There can be no '${e}' ${t}.`,`Choose a model of the list.`);let{pointer:n,isSigned:r}=await Sn(await this.#e(`${Bn}/models/${e}/pointers/${t}`)),i=On(Fn(this.memory.getItem(Hn)),e,t,n,this.now());r&&this.memory.setItem(Hn,Pn(i));let a=fn(await this.#e(`${Bn}/models/${e}/versions/${n.version}`));return await mn(a,n),{...await this.#t(a),isSigned:r}}forget(e){let t;try{t=kn(Fn(this.memory.getItem(Hn)),e)}catch{t=wn}this.memory.setItem(Hn,Pn(t))}async#e(e){return j((await this.#r(e,{cache:`no-store`})).content)}async#t(e){let{name:t,version:n,files:r}=e,i=j(await this.#n(e,qt)),a;try{a=nn(i)}catch(e){throw new C(`'${t}' ${n} cannot be rendered here: ${e instanceof Error?e.message:String(e)}.`,`Choose another model.`)}let o={...a.files,[qt]:r[qt]};if(!Object.keys({...o,...r}).every(e=>r[e]?.sha256===o[e]?.sha256))throw new C(`The manifest of '${t}' ${n} lists other files than were published.`,`Publish it again.`);let s=Object.keys(a.files),c=j((await Promise.all(s.map(t=>this.#n(e,t))))[s.indexOf(Jt)]);return{name:t,version:n,tail:a.tail,wgsl:c,selfTest:a.selfTest}}async#n(e,t){let{sha256:n,bytes:r}=e.files[t],{content:i}=await this.#r(`${Bn}/blobs/sha256/${n}`);if(i.byteLength!==r||await hn(i)!==n)throw new C(`${t} of '${e.name}' ${e.version} is not the file that was published.`,`Load the page again; if it stays so, ask who runs the server.`);return i}async#r(e,t={}){let n,r;try{n=await this.ask(e,{credentials:`same-origin`,redirect:`error`,...t}),r=await n.arrayBuffer()}catch{throw new C(`The server cannot be reached.`,`Check the connection, then try again.`)}let{ok:i,status:a,headers:o}=n;if(i)return{headers:o,content:r};if(a===401)throw new Gn;let s=Jn(r);throw new C(s.detail||s.title||`The server answered ${a}.`,s.remedy||`Try again.`)}},j=e=>new TextDecoder().decode(e);function qn({content:e}){try{return JSON.parse(j(e))}catch{throw new C(`The server's answer cannot be understood.`,`Ask who runs it: something may be in between.`)}}function Jn(e){try{return T(JSON.parse(j(e)))}catch{return{}}}function Yn(e){return/<(\/demo\/v1\/models[^>]*)>; rel="next"/.exec(e.headers.get(`link`)??``)?.[1]??null}async function Xn(e,t,n){let{sumFormat:r,scalarFormat:i}=e.gpu,a=[e.target(`tail`,r),e.target(`optical depth`,i)];await e.geometry.drawTransparent(t,{files:[`blended`],entryPoint:`blend_sums`,writes:[]},e.depth,[],a),Zn(e,t,a,n)}function Zn(e,t,n,r){let i=[e.background,...n].map(e=>e.createView());e.forPixels(t,[`display`,`resolve_blended`],`resolve_blended`,[...i,r])}var Qn={files:[...xt,`binned`],entryPoint:`blend_tail`,writes:[!1,!1]};async function $n(e,t,n,r){let i=Ct(e),a={...Qn,tail:n.tail};await e.geometry.drawTransparent(t,a,e.depth,St(e,n),i),Zn(e,t,i,r)}var er={files:[`chain_depth`],entryPoint:`chain_depth`,writes:[!1,!0]},tr={files:[...xt,`chain_colour`],entryPoint:`chain_colour`,writes:[!1,!1,!1,!1,!0]};async function nr(e,t,n,r,i,a){let{geometry:o,depth:s}=e,c=e.zeros(t,`depths`,r),l=e.zeros(t,`colours`,r);await o.drawTransparent(t,er,s,[n,c]);let u=Ct(e),d=[...St(e,i),n,c,l];await o.drawTransparent(t,{...tr,tail:i.tail},s,d,u);let f=[e.background,...u].map(e=>e.createView());e.forPixels(t,[`display`,`resolve_chain`],`resolve_chain`,[n,l,...f,a])}var rr={files:[...xt,`capture_core`],entryPoint:`capture_core`,writes:[!1,!1,!1,!1,!0,!0]},ir=2;async function ar(e,t,n,r,i,a){let{offsets:o,cuts:s}=r,c=e.zeros(t,`cursors`,e.pixels),l=e.room(`pool`,ir*Math.max(i,1)),u=Ct(e),d=[...St(e,n),o,s,c,l];await e.geometry.drawTransparent(t,{...rr,tail:n.tail},e.depth,d,u),e.forPixels(t,[`slot`,`sort`],`sort_runs`,[o,c,l]);let f=[e.background,...u].map(e=>e.createView());e.forPixels(t,[`display`,`resolve_core`],`resolve_core`,[o,c,l,...f,a])}var or={files:[`capture`],entryPoint:`capture`,writes:[!1,!0,!0]},sr=2;async function cr(e,t,n,r,i){let a=e.zeros(t,`cursors`,e.pixels),o=e.room(`pool`,sr*Math.max(r,1));await e.geometry.drawTransparent(t,or,e.depth,[n,a,o]),e.forPixels(t,[`slot`,`sort`],`sort_runs`,[n,a,o]);let s=[n,o,e.background.createView(),i];e.forPixels(t,[`display`,`resolve_exact`],`resolve_exact`,s)}function lr(e){return Math.floor(Math.sqrt(Math.min(Math.max(e,0),1))*255+.5)}function ur(e,t,n){let i=(e,t)=>[e[3*t],e[3*t+1],e[3*t+2]];for(let o=0;o<n.length;o+=3){let[c,l,u]=[n[o],n[o+1],n[o+2]],d=i(e,c),f=s(r(i(e,l),d),r(i(e,u),d));a(f,i(t,c))+a(f,i(t,l))+a(f,i(t,u))<0&&(n[o+1]=u,n[o+2]=l)}}var M=Number(S.RANGE_TILE),dr=2,fr={[jt]:4,[At]:4,r8unorm:1,r16float:2,r32float:4,rgba16float:8,rgba32float:16},pr={files:[`range`],entryPoint:`find_range`,writes:[!0]},mr={files:[`count`],entryPoint:`count_fragments`,writes:[!0]},hr=class extends kt{geometry;background;depth;counts;ranges;#e;#t;#n=new Map;constructor(e,t,n,r){super(e,n,r),this.geometry=t,this.background=this.target(`background`,jt),this.depth=this.target(`depth`,At),this.counts=this.words(`n`,this.pixels),this.#e=[Math.ceil(n/M),Math.ceil(r/M)],this.#t=e.filled(new Uint32Array([...this.#e,0,0]),GPUBufferUsage.UNIFORM),this.ranges=this.words(`ranges`,2*this.#e[0]*this.#e[1])}get bytes(){return[...this.#n.values()].reduce((e,{format:t,width:n,height:r})=>e+fr[t]*n*r,super.bytes)}destroy(){super.destroy();for(let e of this.#n.values())e.destroy()}target(e,t,n=[this.width,this.height]){let r=`${e} ${t}`,i=this.#n.get(r);if(!i){let e=GPUTextureUsage.RENDER_ATTACHMENT|GPUTextureUsage.TEXTURE_BINDING;i=this.gpu.device.createTexture({size:n,format:t,usage:e}),this.#n.set(r,i)}return i}async draw(e,t,n,r){let{geometry:i,width:a,height:o}=this,[s,c]=this.#e,l=h(t,n,i.scene.up,a,o);await i.look(l,[a/(s*M),o/(c*M)],this.pixels);let u=lr(r)/255;await i.drawOpaque(e,this.background,this.depth,[u,u,u,1]),e.encoder.clearBuffer(this.counts),await i.drawTransparent(e,mr,this.depth,[this.counts]);let d=this.zeros(e,`found ranges`,2*s*c);await i.drawCoarse(e,pr,this.#r(),d),this.dispatch(e,w([`fill_ranges`]),`fill_ranges`,[d,this.ranges,this.#t],[1,1])}#r(){let e=this.#e.map(e=>e*dr);return this.target(`coarse`,`r8unorm`,e)}},gr=[`binned`,`kbuffer-deep`,`kbuffer`,`weighted-blended`,`sbuffer`],_r=1,vr=class{gpu;frame;#e;#t;#n={fragments:0,occupied:0};#r=null;#i=0;constructor(e,t,n,r){this.gpu=e,this.#t=t,this.frame=new hr(e,t,n,r),this.#e=new _t(this.frame)}destroy(){this.frame.destroy()}get isSlow(){return this.#t.isSlow}get offsets(){return this.#e.offsets}get slots(){return this.#i}async look(e,t){this.#r=null,await this.frame.draw(e,t,this.#t.scene.bounds,_r);let[n,r,i]=await this.#e.totals(e,this.frame.counts);if(i>4096){let[e,t]=[i,ut].map(e=>e.toLocaleString(`en`));throw new C(`A pixel has ${e} transparent fragments; up to ${t} can be drawn here.`,`Look from elsewhere, or open a simpler scene.`)}return this.#n={fragments:n,occupied:r},this.#n}async render(e,t,n,r,i){let{frame:a}=this,o=a.words(i,a.pixels),{fragments:s}=this.#n,c=gt(n,a.pixels);return this.#i={binned:0,"kbuffer-deep":Math.min(c,s),kbuffer:c,"weighted-blended":0,sbuffer:s}[t],t===`sbuffer`?await this.#a(e,o):t===`weighted-blended`?await Xn(a,e,o):t===`binned`?await $n(a,e,await this.#c(e,ot,!1),o):t===`kbuffer`?await this.#o(e,this.#i,o):await this.#s(e,this.#i,r,o),e.submit(),o}async#a(e,t){this.#e.placeAll(e,this.frame.counts),await cr(this.frame,e,this.#e.offsets,this.#n.fragments,t)}async#o(e,t,n){let r=await this.#c(e,at,!1);this.#e.placeFixed(e,t),await nr(this.frame,e,this.#e.offsets,t,r,n)}async#s(e,t,n,r){if(!n)throw new C(`There is no bundle for kbuffer-deep.`,`Choose a model.`);let[i,a]=[this.frame,this.#e],o=await this.#c(e,n.tail,!0);a.begin(e,o,t),Dt(i,e,n,o,a,i.ranges,i.background),a.place(e,o),await ar(i,e,o,a,t,r)}async#c(e,t,n){let r=this.#r;return r&&r.tail.name===t.name&&(!n||r.luma)?r:(this.#r=null,this.#r=await wt(this.frame,e,t,n),this.#r)}},yr=class{_listeners={};addEventListener(e,t){let n=this._listeners;return n[e]===void 0&&(n[e]=[]),n[e].indexOf(t)===-1&&n[e].push(t),this}removeEventListener(e,t){let n=this._listeners[e];if(n!==void 0){let e=n.indexOf(t);e!==-1&&n.splice(e,1)}return this}dispatchEvent(e){let t=this._listeners[e.type];if(t!==void 0){let n=t.slice(0);for(let t=0,r=n.length;t<r;t++)n[t].call(this,e)}return this}dispose(){for(let e in this._listeners)delete this._listeners[e]}},N=class{_disposed=!1;_name;_parent;_child;_attributes;constructor(e,t,n,r={}){if(this._name=e,this._parent=t,this._child=n,this._attributes=r,!t.isOnGraph(n))throw Error(`Cannot connect disconnected graphs.`)}getName(){return this._name}getParent(){return this._parent}getChild(){return this._child}setChild(e){return this._child=e,this}getAttributes(){return this._attributes}dispose(){this._disposed||=(this._parent._destroyRef(this),!0)}isDisposed(){return this._disposed}},br=class extends yr{_emptySet=new Set;_edges=new Set;_parentEdges=new Map;_childEdges=new Map;listEdges(){return Array.from(this._edges)}listParentEdges(e){return Array.from(this._childEdges.get(e)||this._emptySet)}listParents(e){let t=new Set;for(let n of this.listParentEdges(e))t.add(n.getParent());return Array.from(t)}listChildEdges(e){return Array.from(this._parentEdges.get(e)||this._emptySet)}listChildren(e){let t=new Set;for(let n of this.listChildEdges(e))t.add(n.getChild());return Array.from(t)}disconnectParents(e,t){for(let n of this.listParentEdges(e))(!t||t(n.getParent()))&&n.dispose();return this}_createEdge(e,t,n,r){let i=new N(e,t,n,r);this._edges.add(i);let a=i.getParent();this._parentEdges.has(a)||this._parentEdges.set(a,new Set),this._parentEdges.get(a).add(i);let o=i.getChild();return this._childEdges.has(o)||this._childEdges.set(o,new Set),this._childEdges.get(o).add(i),i}_destroyEdge(e){return this._edges.delete(e),this._parentEdges.get(e.getParent()).delete(e),this._childEdges.get(e.getChild()).delete(e),this}},P=class{list=[];constructor(e){if(e)for(let t of e)this.list.push(t)}add(e){this.list.push(e)}remove(e){let t=this.list.indexOf(e);t>=0&&this.list.splice(t,1)}removeChild(e){let t=[];for(let n of this.list)n.getChild()===e&&t.push(n);for(let e of t)this.remove(e);return t}listRefsByChild(e){let t=[];for(let n of this.list)n.getChild()===e&&t.push(n);return t}values(){return this.list}},F=class{set=new Set;map=new Map;constructor(e){if(e)for(let t of e)this.add(t)}add(e){let t=e.getChild();this.removeChild(t),this.set.add(e),this.map.set(t,e)}remove(e){this.set.delete(e),this.map.delete(e.getChild())}removeChild(e){let t=this.map.get(e)||null;return t&&this.remove(t),t}getRefByChild(e){return this.map.get(e)||null}values(){return Array.from(this.set)}},I=class{map={};constructor(e){e&&Object.assign(this.map,e)}set(e,t){this.map[e]=t}delete(e){delete this.map[e]}get(e){return this.map[e]||null}keys(){return Object.keys(this.map)}values(){return Object.values(this.map)}},L=Symbol(`attributes`),R=Symbol(`immutableKeys`),xr=class e extends yr{_disposed=!1;graph;[L];[R];constructor(e){super(),this.graph=e,this[R]=new Set,this[L]=this._createAttributes()}getDefaults(){return{}}_createAttributes(){let t=this.getDefaults(),n={};for(let r in t){let i=t[r];if(i instanceof e){let e=this.graph._createEdge(r,this,i);this[R].add(r),n[r]=e}else n[r]=i}return n}isOnGraph(e){return this.graph===e.graph}isDisposed(){return this._disposed}dispose(){this._disposed||(this.graph.listChildEdges(this).forEach(e=>e.dispose()),this.graph.disconnectParents(this),this._disposed=!0,this.dispatchEvent({type:`dispose`}))}detach(){return this.graph.disconnectParents(this),this}swap(e,t){for(let n in this[L]){let r=this[L][n];if(r instanceof N){let i=r;i.getChild()===e&&this.setRef(n,t,i.getAttributes())}else if(r instanceof P)for(let i of r.listRefsByChild(e)){let r=i.getAttributes();this.removeRef(n,e),this.addRef(n,t,r)}else if(r instanceof F){let i=r.getRefByChild(e);if(i){let r=i.getAttributes();this.removeRef(n,e),this.addRef(n,t,r)}}else if(r instanceof I)for(let i of r.keys()){let a=r.get(i);a.getChild()===e&&this.setRefMap(n,i,t,a.getAttributes())}}return this}get(e){return this[L][e]}set(e,t){return this[L][e]=t,this.dispatchEvent({type:`change`,attribute:e})}getRef(e){let t=this[L][e];return t?t.getChild():null}setRef(e,t,n){if(this[R].has(e))throw Error(`Cannot overwrite immutable attribute, "${e}".`);let r=this[L][e];if(r&&r.dispose(),!t)return this;let i=this.graph._createEdge(e,this,t,n);return this[L][e]=i,this.dispatchEvent({type:`change`,attribute:e})}listRefs(e){return this.assertRefList(e).values().map(e=>e.getChild())}addRef(e,t,n){let r=this.graph._createEdge(e,this,t,n);return this.assertRefList(e).add(r),this.dispatchEvent({type:`change`,attribute:e})}removeRef(e,t){let n=this.assertRefList(e);if(n instanceof P)for(let e of n.listRefsByChild(t))e.dispose();else{let e=n.getRefByChild(t);e&&e.dispose()}return this}assertRefList(e){let t=this[L][e];if(t instanceof P||t instanceof F)return t;throw Error(`Expected RefList or RefSet for attribute "${e}"`)}listRefMapKeys(e){return this.assertRefMap(e).keys()}listRefMapValues(e){return this.assertRefMap(e).values().map(e=>e.getChild())}getRefMap(e,t){let n=this.assertRefMap(e).get(t);return n?n.getChild():null}setRefMap(e,t,n,r){let i=this.assertRefMap(e),a=i.get(t);if(a&&a.dispose(),!n)return this;r=Object.assign(r||{},{key:t});let o=this.graph._createEdge(e,this,n,{...r,key:t});return i.set(t,o),this.dispatchEvent({type:`change`,attribute:e,key:t})}assertRefMap(e){let t=this[L][e];if(t instanceof I)return t;throw Error(`Expected RefMap for attribute "${e}"`)}dispatchEvent(e){return super.dispatchEvent({...e,target:this}),this.graph.dispatchEvent({...e,target:this,type:`node:${e.type}`}),this}_destroyRef(e){let t=e.getName();if(this[L][t]===e)this[L][t]=null,this[R].has(t)&&e.getChild().dispose();else if(this[L][t]instanceof P)this[L][t].remove(e);else if(this[L][t]instanceof F)this[L][t].remove(e);else if(this[L][t]instanceof I){let n=this[L][t];for(let t of n.keys())n.get(t)===e&&n.delete(t)}else return;this.graph._destroyEdge(e),this.dispatchEvent({type:`change`,attribute:t})}},Sr=`v4.5.1`,Cr=`@glb.bin`,wr=function(e){return e.ARRAY_BUFFER=`ARRAY_BUFFER`,e.ELEMENT_ARRAY_BUFFER=`ELEMENT_ARRAY_BUFFER`,e.INVERSE_BIND_MATRICES=`INVERSE_BIND_MATRICES`,e.OTHER=`OTHER`,e.SPARSE=`SPARSE`,e}({}),Tr=function(e){return e[e.R=4096]=`R`,e[e.G=256]=`G`,e[e.B=16]=`B`,e[e.A=1]=`A`,e}({}),Er=class extends Float32Array{constructor(){throw super(),Error(`Unsupported typed array instantiation.`)}},Dr={5120:Int8Array,5121:Uint8Array,5122:Int16Array,5123:Uint16Array,5125:Uint32Array,5131:typeof Float16Array<`u`?Float16Array:Er,5126:Float32Array,5130:Float64Array},z=class{static createBufferFromDataURI(e){if(typeof Buffer>`u`){let t=atob(e.split(`,`)[1]),n=new Uint8Array(t.length);for(let e=0;e<t.length;e++)n[e]=t.charCodeAt(e);return n}{let t=e.split(`,`)[1],n=e.indexOf(`base64`)>=0;return Buffer.from(t,n?`base64`:`utf8`)}}static encodeText(e){return new TextEncoder().encode(e)}static decodeText(e){return new TextDecoder().decode(e)}static concat(e){let t=0;for(let n of e)t+=n.byteLength;let n=new Uint8Array(t),r=0;for(let t of e)n.set(t,r),r+=t.byteLength;return n}static pad(e,t=0){let n=this.padNumber(e.byteLength);if(n===e.byteLength)return e;let r=new Uint8Array(n);if(r.set(e),t!==0)for(let i=e.byteLength;i<n;i++)r[i]=t;return r}static padNumber(e){return Math.ceil(e/4)*4}static equals(e,t){if(e===t)return!0;if(e.byteLength!==t.byteLength)return!1;let n=e.byteLength;for(;n--;)if(e[n]!==t[n])return!1;return!0}static toView(e,t=0,n=1/0){return new Uint8Array(e.buffer,e.byteOffset+t,Math.min(e.byteLength,n))}static assertView(e){if(e&&!ArrayBuffer.isView(e))throw Error(`Method requires Uint8Array parameter; received "${typeof e}".`);return e}},Or=class{match(e){return e.length>=3&&e[0]===255&&e[1]===216&&e[2]===255}getSize(e){let t=new DataView(e.buffer,e.byteOffset+4),n,r;for(;t.byteLength;){if(n=t.getUint16(0,!1),Ar(t,n),r=t.getUint8(n+1),r===192||r===193||r===194)return[t.getUint16(n+7,!1),t.getUint16(n+5,!1)];t=new DataView(e.buffer,t.byteOffset+n+2)}throw TypeError(`Invalid JPG, no size found`)}getChannels(e){return 3}},kr=class e{static PNG_FRIED_CHUNK_NAME=`CgBI`;match(e){return e.length>=8&&e[0]===137&&e[1]===80&&e[2]===78&&e[3]===71&&e[4]===13&&e[5]===10&&e[6]===26&&e[7]===10}getSize(t){let n=new DataView(t.buffer,t.byteOffset);return z.decodeText(t.slice(12,16))===e.PNG_FRIED_CHUNK_NAME?[n.getUint32(32,!1),n.getUint32(36,!1)]:[n.getUint32(16,!1),n.getUint32(20,!1)]}getChannels(e){return 4}},B=class{static impls={"image/jpeg":new Or,"image/png":new kr};static registerFormat(e,t){this.impls[e]=t}static getMimeType(e){for(let t in this.impls)if(this.impls[t].match(e))return t;return null}static getSize(e,t){return this.impls[t]?this.impls[t].getSize(e):null}static getChannels(e,t){return this.impls[t]?this.impls[t].getChannels(e):null}static getVRAMByteLength(e,t){if(!this.impls[t])return null;if(this.impls[t].getVRAMByteLength)return this.impls[t].getVRAMByteLength(e);let n=0,r=this.getSize(e,t);if(!r)return null;for(;r[0]>1||r[1]>1;)n+=r[0]*r[1]*4,r[0]=Math.max(Math.floor(r[0]/2),1),r[1]=Math.max(Math.floor(r[1]/2),1);return n+=4,n}static mimeTypeToExtension(e){return e===`image/jpeg`?`jpg`:e.split(`/`).pop()}static extensionToMimeType(e){return e===`jpg`?`image/jpeg`:e?`image/${e}`:``}};function Ar(e,t){if(t>e.byteLength)throw TypeError(`Corrupt JPG, exceeded buffer limits`);if(e.getUint8(t)!==255)throw TypeError(`Invalid JPG, marker table corrupted`);return e}var V=class{static basename(e){let t=e.split(/[\\/]/).pop();return t.substring(0,t.lastIndexOf(`.`))}static extension(e){if(e.startsWith(`data:image/`)){let t=e.match(/data:(image\/\w+)/)[1];return B.mimeTypeToExtension(t)}return e.startsWith(`data:model/gltf+json`)?`gltf`:e.startsWith(`data:model/gltf-binary`)?`glb`:e.startsWith(`data:application/`)?`bin`:e.split(/[\\/]/).pop().split(/[.]/).pop()}},jr=typeof Float32Array<`u`?Float32Array:Array;function Mr(){var e=new jr(3);return jr!=Float32Array&&(e[0]=0,e[1]=0,e[2]=0),e}function Nr(e){var t=e[0],n=e[1],r=e[2];return Math.sqrt(t*t+n*n+r*r)}(function(){var e=Mr();return function(t,n,r,i,a,o){var s,c;for(n||=3,r||=0,c=i?Math.min(i*n+r,t.length):t.length,s=r;s<c;s+=n)e[0]=t[s],e[1]=t[s+1],e[2]=t[s+2],a(e,e,o),t[s]=e[0],t[s+1]=e[1],t[s+2]=e[2];return t}})();var Pr=`https://null.example`,Fr=class{static DEFAULT_INIT={};static PROTOCOL_REGEXP=/^[a-zA-Z]+:\/\//;static dirname(e){let t=e.lastIndexOf(`/`);return t===-1?`./`:e.substring(0,t+1)}static basename(e){return V.basename(new URL(e,Pr).pathname)}static extension(e){return V.extension(new URL(e,Pr).pathname)}static resolve(e,t){if(!this.isRelativePath(t))return t;let n=e.split(`/`),r=t.split(`/`);n.pop();for(let e=0;e<r.length;e++)r[e]!==`.`&&(r[e]===`..`?n.pop():n.push(r[e]));return n.join(`/`)}static isAbsoluteURL(e){return this.PROTOCOL_REGEXP.test(e)}static isRelativePath(e){return!/^(?:[a-zA-Z]+:)?\//.test(e)}};function Ir(e){return Object.prototype.toString.call(e)===`[object Object]`}function H(e){if(Ir(e)===!1)return!1;let t=e.constructor;if(t===void 0)return!0;let n=t.prototype;return Ir(n)!==!1&&Object.hasOwn(n,`isPrototypeOf`)!==!1}var Lr=function(e){return e[e.SILENT=4]=`SILENT`,e[e.ERROR=3]=`ERROR`,e[e.WARN=2]=`WARN`,e[e.INFO=1]=`INFO`,e[e.DEBUG=0]=`DEBUG`,e}({}),U=class e{verbosity;static Verbosity=Lr;static DEFAULT_INSTANCE=new e(1);constructor(e){this.verbosity=e}debug(e){this.verbosity<=0&&console.debug(e)}info(e){this.verbosity<=1&&console.info(e)}warn(e){this.verbosity<=2&&console.warn(e)}error(e){this.verbosity<=3&&console.error(e)}};function Rr(e){var t=e[0],n=e[1],r=e[2],i=e[3],a=e[4],o=e[5],s=e[6],c=e[7],l=e[8],u=e[9],d=e[10],f=e[11],p=e[12],m=e[13],h=e[14],g=e[15],_=t*o-n*a,v=t*s-r*a,y=n*s-r*o,b=l*m-u*p,x=l*h-d*p,S=u*h-d*m,C=t*S-n*x+r*b,ee=a*S-o*x+s*b,te=l*y-u*v+d*_,ne=p*y-m*v+h*_;return c*C-i*ee+g*te-f*ne}function zr(e,t,n){var r=t[0],i=t[1],a=t[2],o=t[3],s=t[4],c=t[5],l=t[6],u=t[7],d=t[8],f=t[9],p=t[10],m=t[11],h=t[12],g=t[13],_=t[14],v=t[15],y=n[0],b=n[1],x=n[2],S=n[3];return e[0]=y*r+b*s+x*d+S*h,e[1]=y*i+b*c+x*f+S*g,e[2]=y*a+b*l+x*p+S*_,e[3]=y*o+b*u+x*m+S*v,y=n[4],b=n[5],x=n[6],S=n[7],e[4]=y*r+b*s+x*d+S*h,e[5]=y*i+b*c+x*f+S*g,e[6]=y*a+b*l+x*p+S*_,e[7]=y*o+b*u+x*m+S*v,y=n[8],b=n[9],x=n[10],S=n[11],e[8]=y*r+b*s+x*d+S*h,e[9]=y*i+b*c+x*f+S*g,e[10]=y*a+b*l+x*p+S*_,e[11]=y*o+b*u+x*m+S*v,y=n[12],b=n[13],x=n[14],S=n[15],e[12]=y*r+b*s+x*d+S*h,e[13]=y*i+b*c+x*f+S*g,e[14]=y*a+b*l+x*p+S*_,e[15]=y*o+b*u+x*m+S*v,e}function Br(e,t){var n=t[0],r=t[1],i=t[2],a=t[4],o=t[5],s=t[6],c=t[8],l=t[9],u=t[10];return e[0]=Math.sqrt(n*n+r*r+i*i),e[1]=Math.sqrt(a*a+o*o+s*s),e[2]=Math.sqrt(c*c+l*l+u*u),e}function Vr(e,t){var n=new jr(3);Br(n,t);var r=1/n[0],i=1/n[1],a=1/n[2],o=t[0]*r,s=t[1]*i,c=t[2]*a,l=t[4]*r,u=t[5]*i,d=t[6]*a,f=t[8]*r,p=t[9]*i,m=t[10]*a,h=o+u+m,g=0;return h>0?(g=Math.sqrt(h+1)*2,e[3]=.25*g,e[0]=(d-p)/g,e[1]=(f-c)/g,e[2]=(s-l)/g):o>u&&o>m?(g=Math.sqrt(1+o-u-m)*2,e[3]=(d-p)/g,e[0]=.25*g,e[1]=(s+l)/g,e[2]=(f+c)/g):u>m?(g=Math.sqrt(1+u-o-m)*2,e[3]=(f-c)/g,e[0]=(s+l)/g,e[1]=.25*g,e[2]=(d+p)/g):(g=Math.sqrt(1+m-o-u)*2,e[3]=(s-l)/g,e[0]=(f+c)/g,e[1]=(d+p)/g,e[2]=.25*g),e}var W=class e{static identity(e){return e}static eq(e,t,n=1e-5){if(e.length!==t.length)return!1;for(let r=0;r<e.length;r++)if(Math.abs(e[r]-t[r])>n)return!1;return!0}static clamp(e,t,n){return e<t?t:e>n?n:e}static decodeNormalizedInt(e,t){switch(t){case 5126:return e;case 5123:return e/65535;case 5121:return e/255;case 5122:return Math.max(e/32767,-1);case 5120:return Math.max(e/127,-1);default:throw Error(`Invalid component type.`)}}static encodeNormalizedInt(t,n){switch(n){case 5126:return t;case 5123:return Math.round(e.clamp(t,0,1)*65535);case 5121:return Math.round(e.clamp(t,0,1)*255);case 5122:return Math.round(e.clamp(t,-1,1)*32767);case 5120:return Math.round(e.clamp(t,-1,1)*127);default:throw Error(`Invalid component type.`)}}static decompose(e,t,n,r){let i=Nr([e[0],e[1],e[2]]),a=Nr([e[4],e[5],e[6]]),o=Nr([e[8],e[9],e[10]]);Rr(e)<0&&(i=-i),t[0]=e[12],t[1]=e[13],t[2]=e[14];let s=e.slice(),c=1/i,l=1/a,u=1/o;s[0]*=c,s[1]*=c,s[2]*=c,s[4]*=l,s[5]*=l,s[6]*=l,s[8]*=u,s[9]*=u,s[10]*=u,Vr(n,s),r[0]=i,r[1]=a,r[2]=o}static compose(e,t,n,r){let i=r,a=t[0],o=t[1],s=t[2],c=t[3],l=a+a,u=o+o,d=s+s,f=a*l,p=a*u,m=a*d,h=o*u,g=o*d,_=s*d,v=c*l,y=c*u,b=c*d,x=n[0],S=n[1],C=n[2];return i[0]=(1-(h+_))*x,i[1]=(p+b)*x,i[2]=(m-y)*x,i[3]=0,i[4]=(p-b)*S,i[5]=(1-(f+_))*S,i[6]=(g+v)*S,i[7]=0,i[8]=(m+y)*C,i[9]=(g-v)*C,i[10]=(1-(f+h))*C,i[11]=0,i[12]=e[0],i[13]=e[1],i[14]=e[2],i[15]=1,i}};function Hr(e,t){if(!!e!=!!t)return!1;let n=e.getChild(),r=t.getChild();return n===r||n.equals(r)}function Ur(e,t){if(!!e!=!!t)return!1;let n=e.values(),r=t.values();if(n.length!==r.length)return!1;for(let e=0;e<n.length;e++){let t=n[e],i=r[e];if(t.getChild()!==i.getChild()&&!t.getChild().equals(i.getChild()))return!1}return!0}function Wr(e,t){if(!!e!=!!t)return!1;let n=e.keys(),r=t.keys();if(n.length!==r.length)return!1;for(let r of n){let n=e.get(r),i=t.get(r);if(!!n!=!!i)return!1;let a=n.getChild(),o=i.getChild();if(a!==o&&!a.equals(o))return!1}return!0}function Gr(e,t){if(e===t)return!0;if(!!e!=!!t||!e||!t||e.length!==t.length)return!1;for(let n=0;n<e.length;n++)if(e[n]!==t[n])return!1;return!0}function Kr(e,t){if(e===t)return!0;if(!!e!=!!t)return!1;if(!H(e)||!H(t))return e===t;let n=e,r=t,i=0,a=0,o;for(o in n)i++;for(o in r)a++;if(i!==a)return!1;for(o in n){let e=n[o],t=r[o];if(qr(e)&&qr(t)){if(!Gr(e,t))return!1}else if(H(e)&&H(t)){if(!Kr(e,t))return!1}else if(e!==t)return!1}return!0}function qr(e){return Array.isArray(e)||ArrayBuffer.isView(e)}var Jr=`23456789abdegjkmnpqrvwxyzABDEGJKMNPQRVWXYZ`,Yr=999,Xr=6,Zr=new Set,Qr=function(){let e=``;for(let t=0;t<Xr;t++)e+=Jr.charAt(Math.floor(Math.random()*42));return e},$r=function(){for(let e=0;e<Yr;e++){let e=Qr();if(!Zr.has(e))return Zr.add(e),e}return``},G=e=>e,ei=new Set,ti=class extends xr{constructor(e,t=``){super(e),this[L].name=t,this.init(),this.dispatchEvent({type:`create`})}getGraph(){return this.graph}getDefaults(){return Object.assign(super.getDefaults(),{name:``,extras:{}})}set(e,t){return Array.isArray(t)&&(t=t.slice()),super.set(e,t)}getName(){return this.get(`name`)}setName(e){return this.set(`name`,e)}getExtras(){return this.get(`extras`)}setExtras(e){return this.set(`extras`,e)}clone(){let e=this.constructor;return new e(this.graph).copy(this,G)}copy(e,t=G){for(let e in this[L]){let t=this[L][e];if(t instanceof N)this[R].has(e)||t.dispose();else if(t instanceof P||t instanceof F)for(let e of t.values())e.dispose();else if(t instanceof I)for(let e of t.values())e.dispose()}for(let n in e[L]){let r=this[L][n],i=e[L][n];if(i instanceof N)this[R].has(n)?r.getChild().copy(t(i.getChild()),t):this.setRef(n,t(i.getChild()),i.getAttributes());else if(i instanceof F||i instanceof P)for(let e of i.values())this.addRef(n,t(e.getChild()),e.getAttributes());else if(i instanceof I)for(let e of i.keys()){let r=i.get(e);this.setRefMap(n,e,t(r.getChild()),r.getAttributes())}else H(i)?this[L][n]=JSON.parse(JSON.stringify(i)):Array.isArray(i)||i instanceof ArrayBuffer||ArrayBuffer.isView(i)?this[L][n]=i.slice():this[L][n]=i}return this}equals(e,t=ei){if(this===e)return!0;if(this.propertyType!==e.propertyType)return!1;for(let n in this[L]){if(t.has(n))continue;let r=this[L][n],i=e[L][n];if(r instanceof N||i instanceof N){if(!Hr(r,i))return!1}else if(r instanceof F||i instanceof F||r instanceof P||i instanceof P){if(!Ur(r,i))return!1}else if(r instanceof I||i instanceof I){if(!Wr(r,i))return!1}else if(H(r)||H(i)){if(!Kr(r,i))return!1}else if(qr(r)||qr(i)){if(!Gr(r,i))return!1}else if(r!==i)return!1}return!0}detach(){return this.graph.disconnectParents(this,e=>e.propertyType!==`Root`),this}listParents(){return this.graph.listParents(this)}},K=class extends ti{getDefaults(){return Object.assign(super.getDefaults(),{extensions:new I})}getExtension(e){return this.getRefMap(`extensions`,e)}setExtension(e,t){return t&&t._validateParent(this),this.setRefMap(`extensions`,e,t)}listExtensions(){return this.listRefMapValues(`extensions`)}},q=class e extends K{static Type={SCALAR:`SCALAR`,VEC2:`VEC2`,VEC3:`VEC3`,VEC4:`VEC4`,MAT2:`MAT2`,MAT3:`MAT3`,MAT4:`MAT4`};static ComponentType={BYTE:5120,UNSIGNED_BYTE:5121,SHORT:5122,UNSIGNED_SHORT:5123,UNSIGNED_INT:5125,FLOAT:5126,FLOAT16:5131,FLOAT64:5130};init(){this.propertyType=`Accessor`}getDefaults(){return Object.assign(super.getDefaults(),{array:null,type:e.Type.SCALAR,componentType:e.ComponentType.FLOAT,normalized:!1,sparse:!1,buffer:null})}static getElementSize(t){switch(t){case e.Type.SCALAR:return 1;case e.Type.VEC2:return 2;case e.Type.VEC3:return 3;case e.Type.VEC4:return 4;case e.Type.MAT2:return 4;case e.Type.MAT3:return 9;case e.Type.MAT4:return 16;default:throw Error(`Unexpected type: `+t)}}static getComponentSize(t){switch(t){case e.ComponentType.BYTE:case e.ComponentType.UNSIGNED_BYTE:return 1;case e.ComponentType.SHORT:case e.ComponentType.UNSIGNED_SHORT:return 2;case e.ComponentType.UNSIGNED_INT:case e.ComponentType.FLOAT:return 4;case e.ComponentType.FLOAT16:return 2;case e.ComponentType.FLOAT64:return 8;default:throw Error(`Unexpected component type: `+t)}}getMinNormalized(e){let t=this.getNormalized(),n=this.getElementSize(),r=this.getComponentType();if(this.getMin(e),t)for(let t=0;t<n;t++)e[t]=W.decodeNormalizedInt(e[t],r);return e}getMin(e){let t=this.getArray(),n=this.getCount(),r=this.getElementSize();for(let t=0;t<r;t++)e[t]=1/0;for(let i=0;i<n*r;i+=r)for(let n=0;n<r;n++){let r=t[i+n];Number.isFinite(r)&&(e[n]=Math.min(e[n],r))}return e}getMaxNormalized(e){let t=this.getNormalized(),n=this.getElementSize(),r=this.getComponentType();if(this.getMax(e),t)for(let t=0;t<n;t++)e[t]=W.decodeNormalizedInt(e[t],r);return e}getMax(e){let t=this.get(`array`),n=this.getCount(),r=this.getElementSize();for(let t=0;t<r;t++)e[t]=-1/0;for(let i=0;i<n*r;i+=r)for(let n=0;n<r;n++){let r=t[i+n];Number.isFinite(r)&&(e[n]=Math.max(e[n],r))}return e}getCount(){let e=this.get(`array`);return e?e.length/this.getElementSize():0}getType(){return this.get(`type`)}setType(e){return this.set(`type`,e)}getElementSize(){return e.getElementSize(this.get(`type`))}getComponentSize(){return this.get(`array`).BYTES_PER_ELEMENT}getComponentType(){return this.get(`componentType`)}getNormalized(){return this.get(`normalized`)}setNormalized(e){return this.set(`normalized`,e)}getScalar(e){let t=this.getElementSize(),n=this.getComponentType(),r=this.getArray();return this.getNormalized()?W.decodeNormalizedInt(r[e*t],n):r[e*t]}setScalar(e,t){let n=this.getElementSize(),r=this.getComponentType(),i=this.getArray();return this.getNormalized()?i[e*n]=W.encodeNormalizedInt(t,r):i[e*n]=t,this}getElement(e,t){let n=this.getNormalized(),r=this.getElementSize(),i=this.getComponentType(),a=this.getArray();for(let o=0;o<r;o++)n?t[o]=W.decodeNormalizedInt(a[e*r+o],i):t[o]=a[e*r+o];return t}setElement(e,t){let n=this.getNormalized(),r=this.getElementSize(),i=this.getComponentType(),a=this.getArray();for(let o=0;o<r;o++)n?a[e*r+o]=W.encodeNormalizedInt(t[o],i):a[e*r+o]=t[o];return this}getSparse(){return this.get(`sparse`)}setSparse(e){return this.set(`sparse`,e)}getBuffer(){return this.getRef(`buffer`)}setBuffer(e){return this.setRef(`buffer`,e)}getArray(){return this.get(`array`)}setArray(t){return this.set(`componentType`,t?ni(t):e.ComponentType.FLOAT),this.set(`array`,t),this}getByteLength(){let e=this.get(`array`);return e?e.byteLength:0}};function ni(e){switch(e.constructor){case Float32Array:return q.ComponentType.FLOAT;case Uint32Array:return q.ComponentType.UNSIGNED_INT;case Uint16Array:return q.ComponentType.UNSIGNED_SHORT;case Uint8Array:return q.ComponentType.UNSIGNED_BYTE;case Int16Array:return q.ComponentType.SHORT;case Int8Array:return q.ComponentType.BYTE;case Float64Array:return q.ComponentType.FLOAT64}if(typeof Float16Array<`u`&&e.constructor===Float16Array)return q.ComponentType.FLOAT16;throw Error(`Unknown accessor componentType.`)}var ri=class extends K{init(){this.propertyType=`Animation`}getDefaults(){return Object.assign(super.getDefaults(),{channels:new F,samplers:new F})}addChannel(e){return this.addRef(`channels`,e)}removeChannel(e){return this.removeRef(`channels`,e)}listChannels(){return this.listRefs(`channels`)}addSampler(e){return this.addRef(`samplers`,e)}removeSampler(e){return this.removeRef(`samplers`,e)}listSamplers(){return this.listRefs(`samplers`)}},ii=class extends K{static TargetPath={TRANSLATION:`translation`,ROTATION:`rotation`,SCALE:`scale`,WEIGHTS:`weights`};init(){this.propertyType=`AnimationChannel`}getDefaults(){return Object.assign(super.getDefaults(),{targetPath:null,targetNode:null,sampler:null})}getTargetPath(){return this.get(`targetPath`)}setTargetPath(e){return this.set(`targetPath`,e)}getTargetNode(){return this.getRef(`targetNode`)}setTargetNode(e){return this.setRef(`targetNode`,e)}getSampler(){return this.getRef(`sampler`)}setSampler(e){return this.setRef(`sampler`,e)}},ai=class e extends K{static Interpolation={LINEAR:`LINEAR`,STEP:`STEP`,CUBICSPLINE:`CUBICSPLINE`};init(){this.propertyType=`AnimationSampler`}getDefaultAttributes(){return Object.assign(super.getDefaults(),{interpolation:e.Interpolation.LINEAR,input:null,output:null})}getInterpolation(){return this.get(`interpolation`)}setInterpolation(e){return this.set(`interpolation`,e)}getInput(){return this.getRef(`input`)}setInput(e){return this.setRef(`input`,e,{usage:`OTHER`})}getOutput(){return this.getRef(`output`)}setOutput(e){return this.setRef(`output`,e,{usage:`OTHER`})}},oi=class extends K{init(){this.propertyType=`Buffer`}getDefaults(){return Object.assign(super.getDefaults(),{uri:``})}getURI(){return this.get(`uri`)}setURI(e){return this.set(`uri`,e)}},si=class e extends K{static Type={PERSPECTIVE:`perspective`,ORTHOGRAPHIC:`orthographic`};init(){this.propertyType=`Camera`}getDefaults(){return Object.assign(super.getDefaults(),{type:e.Type.PERSPECTIVE,znear:.1,zfar:100,aspectRatio:null,yfov:Math.PI*2*50/360,xmag:1,ymag:1})}getType(){return this.get(`type`)}setType(e){return this.set(`type`,e)}getZNear(){return this.get(`znear`)}setZNear(e){return this.set(`znear`,e)}getZFar(){return this.get(`zfar`)}setZFar(e){return this.set(`zfar`,e)}getAspectRatio(){return this.get(`aspectRatio`)}setAspectRatio(e){return this.set(`aspectRatio`,e)}getYFov(){return this.get(`yfov`)}setYFov(e){return this.set(`yfov`,e)}getXMag(){return this.get(`xmag`)}setXMag(e){return this.set(`xmag`,e)}getYMag(){return this.get(`ymag`)}setYMag(e){return this.set(`ymag`,e)}},J=class e extends K{static WrapMode={CLAMP_TO_EDGE:33071,MIRRORED_REPEAT:33648,REPEAT:10497};static MagFilter={NEAREST:9728,LINEAR:9729};static MinFilter={NEAREST:9728,LINEAR:9729,NEAREST_MIPMAP_NEAREST:9984,LINEAR_MIPMAP_NEAREST:9985,NEAREST_MIPMAP_LINEAR:9986,LINEAR_MIPMAP_LINEAR:9987};init(){this.propertyType=`TextureInfo`}getDefaults(){return Object.assign(super.getDefaults(),{texCoord:0,magFilter:null,minFilter:null,wrapS:e.WrapMode.REPEAT,wrapT:e.WrapMode.REPEAT})}getTexCoord(){return this.get(`texCoord`)}setTexCoord(e){return this.set(`texCoord`,e)}getMagFilter(){return this.get(`magFilter`)}setMagFilter(e){return this.set(`magFilter`,e)}getMinFilter(){return this.get(`minFilter`)}setMinFilter(e){return this.set(`minFilter`,e)}getWrapS(){return this.get(`wrapS`)}setWrapS(e){return this.set(`wrapS`,e)}getWrapT(){return this.get(`wrapT`)}setWrapT(e){return this.set(`wrapT`,e)}},{R:ci,G:li,B:ui,A:di}=Tr,fi=class e extends K{static AlphaMode={OPAQUE:`OPAQUE`,MASK:`MASK`,BLEND:`BLEND`};init(){this.propertyType=`Material`}getDefaults(){return Object.assign(super.getDefaults(),{alphaMode:e.AlphaMode.OPAQUE,alphaCutoff:.5,doubleSided:!1,baseColorFactor:[1,1,1,1],baseColorTexture:null,baseColorTextureInfo:new J(this.graph,`baseColorTextureInfo`),emissiveFactor:[0,0,0],emissiveTexture:null,emissiveTextureInfo:new J(this.graph,`emissiveTextureInfo`),normalScale:1,normalTexture:null,normalTextureInfo:new J(this.graph,`normalTextureInfo`),occlusionStrength:1,occlusionTexture:null,occlusionTextureInfo:new J(this.graph,`occlusionTextureInfo`),roughnessFactor:1,metallicFactor:1,metallicRoughnessTexture:null,metallicRoughnessTextureInfo:new J(this.graph,`metallicRoughnessTextureInfo`)})}getDoubleSided(){return this.get(`doubleSided`)}setDoubleSided(e){return this.set(`doubleSided`,e)}getAlpha(){return this.get(`baseColorFactor`)[3]}setAlpha(e){let t=this.get(`baseColorFactor`).slice();return t[3]=e,this.set(`baseColorFactor`,t)}getAlphaMode(){return this.get(`alphaMode`)}setAlphaMode(e){return this.set(`alphaMode`,e)}getAlphaCutoff(){return this.get(`alphaCutoff`)}setAlphaCutoff(e){return this.set(`alphaCutoff`,e)}getBaseColorFactor(){return this.get(`baseColorFactor`)}setBaseColorFactor(e){return this.set(`baseColorFactor`,e)}getBaseColorTexture(){return this.getRef(`baseColorTexture`)}getBaseColorTextureInfo(){return this.getRef(`baseColorTexture`)?this.getRef(`baseColorTextureInfo`):null}setBaseColorTexture(e){return this.setRef(`baseColorTexture`,e,{channels:ci|li|ui|di,isColor:!0})}getEmissiveFactor(){return this.get(`emissiveFactor`)}setEmissiveFactor(e){return this.set(`emissiveFactor`,e)}getEmissiveTexture(){return this.getRef(`emissiveTexture`)}getEmissiveTextureInfo(){return this.getRef(`emissiveTexture`)?this.getRef(`emissiveTextureInfo`):null}setEmissiveTexture(e){return this.setRef(`emissiveTexture`,e,{channels:ci|li|ui,isColor:!0})}getNormalScale(){return this.get(`normalScale`)}setNormalScale(e){return this.set(`normalScale`,e)}getNormalTexture(){return this.getRef(`normalTexture`)}getNormalTextureInfo(){return this.getRef(`normalTexture`)?this.getRef(`normalTextureInfo`):null}setNormalTexture(e){return this.setRef(`normalTexture`,e,{channels:ci|li|ui})}getOcclusionStrength(){return this.get(`occlusionStrength`)}setOcclusionStrength(e){return this.set(`occlusionStrength`,e)}getOcclusionTexture(){return this.getRef(`occlusionTexture`)}getOcclusionTextureInfo(){return this.getRef(`occlusionTexture`)?this.getRef(`occlusionTextureInfo`):null}setOcclusionTexture(e){return this.setRef(`occlusionTexture`,e,{channels:ci})}getRoughnessFactor(){return this.get(`roughnessFactor`)}setRoughnessFactor(e){return this.set(`roughnessFactor`,e)}getMetallicFactor(){return this.get(`metallicFactor`)}setMetallicFactor(e){return this.set(`metallicFactor`,e)}getMetallicRoughnessTexture(){return this.getRef(`metallicRoughnessTexture`)}getMetallicRoughnessTextureInfo(){return this.getRef(`metallicRoughnessTexture`)?this.getRef(`metallicRoughnessTextureInfo`):null}setMetallicRoughnessTexture(e){return this.setRef(`metallicRoughnessTexture`,e,{channels:li|ui})}},pi=class extends K{init(){this.propertyType=`Mesh`}getDefaults(){return Object.assign(super.getDefaults(),{weights:[],primitives:new F})}addPrimitive(e){return this.addRef(`primitives`,e)}removePrimitive(e){return this.removeRef(`primitives`,e)}listPrimitives(){return this.listRefs(`primitives`)}getWeights(){return this.get(`weights`)}setWeights(e){return this.set(`weights`,e)}},mi=class extends K{init(){this.propertyType=`Node`}getDefaults(){return Object.assign(super.getDefaults(),{translation:[0,0,0],rotation:[0,0,0,1],scale:[1,1,1],weights:[],camera:null,mesh:null,skin:null,children:new F})}copy(e,t=G){if(t===G)throw Error(`Node cannot be copied.`);return super.copy(e,t)}getTranslation(){return this.get(`translation`)}getRotation(){return this.get(`rotation`)}getScale(){return this.get(`scale`)}setTranslation(e){return this.set(`translation`,e)}setRotation(e){return this.set(`rotation`,e)}setScale(e){return this.set(`scale`,e)}getMatrix(){return W.compose(this.get(`translation`),this.get(`rotation`),this.get(`scale`),[])}setMatrix(e){let t=this.get(`translation`).slice(),n=this.get(`rotation`).slice(),r=this.get(`scale`).slice();return W.decompose(e,t,n,r),this.set(`translation`,t).set(`rotation`,n).set(`scale`,r)}getWorldTranslation(){let e=[0,0,0];return W.decompose(this.getWorldMatrix(),e,[0,0,0,1],[1,1,1]),e}getWorldRotation(){let e=[0,0,0,1];return W.decompose(this.getWorldMatrix(),[0,0,0],e,[1,1,1]),e}getWorldScale(){let e=[1,1,1];return W.decompose(this.getWorldMatrix(),[0,0,0],[0,0,0,1],e),e}getWorldMatrix(){let e=[];for(let t=this;t!=null;t=t.getParentNode())e.push(t);let t,n=e.pop().getMatrix();for(;t=e.pop();)zr(n,n,t.getMatrix());return n}addChild(e){let t=e.getParentNode();t&&t.removeChild(e);for(let t of e.listParents())t.propertyType===`Scene`&&t.removeChild(e);return this.addRef(`children`,e)}removeChild(e){return this.removeRef(`children`,e)}listChildren(){return this.listRefs(`children`)}getParentNode(){for(let e of this.listParents())if(e.propertyType===`Node`)return e;return null}getMesh(){return this.getRef(`mesh`)}setMesh(e){return this.setRef(`mesh`,e)}getCamera(){return this.getRef(`camera`)}setCamera(e){return this.setRef(`camera`,e)}getSkin(){return this.getRef(`skin`)}setSkin(e){return this.setRef(`skin`,e)}getWeights(){return this.get(`weights`)}setWeights(e){return this.set(`weights`,e)}traverse(e){e(this);for(let t of this.listChildren())t.traverse(e);return this}},hi=class e extends K{static Mode={POINTS:0,LINES:1,LINE_LOOP:2,LINE_STRIP:3,TRIANGLES:4,TRIANGLE_STRIP:5,TRIANGLE_FAN:6};init(){this.propertyType=`Primitive`}getDefaults(){return Object.assign(super.getDefaults(),{mode:e.Mode.TRIANGLES,material:null,indices:null,attributes:new I,targets:new F})}getIndices(){return this.getRef(`indices`)}setIndices(e){return this.setRef(`indices`,e,{usage:`ELEMENT_ARRAY_BUFFER`})}getAttribute(e){return this.getRefMap(`attributes`,e)}setAttribute(e,t){return this.setRefMap(`attributes`,e,t,{usage:`ARRAY_BUFFER`})}listAttributes(){return this.listRefMapValues(`attributes`)}listSemantics(){return this.listRefMapKeys(`attributes`)}getMaterial(){return this.getRef(`material`)}setMaterial(e){return this.setRef(`material`,e)}getMode(){return this.get(`mode`)}setMode(e){return this.set(`mode`,e)}listTargets(){return this.listRefs(`targets`)}addTarget(e){return this.addRef(`targets`,e)}removeTarget(e){return this.removeRef(`targets`,e)}},gi=class extends ti{init(){this.propertyType=`PrimitiveTarget`}getDefaults(){return Object.assign(super.getDefaults(),{attributes:new I})}getAttribute(e){return this.getRefMap(`attributes`,e)}setAttribute(e,t){return this.setRefMap(`attributes`,e,t,{usage:`ARRAY_BUFFER`})}listAttributes(){return this.listRefMapValues(`attributes`)}listSemantics(){return this.listRefMapKeys(`attributes`)}},_i=class extends K{init(){this.propertyType=`Scene`}getDefaults(){return Object.assign(super.getDefaults(),{children:new F})}copy(e,t=G){if(t===G)throw Error(`Scene cannot be copied.`);return super.copy(e,t)}addChild(e){let t=e.getParentNode();return t&&t.removeChild(e),this.addRef(`children`,e)}removeChild(e){return this.removeRef(`children`,e)}listChildren(){return this.listRefs(`children`)}traverse(e){for(let t of this.listChildren())t.traverse(e);return this}},vi=class extends K{init(){this.propertyType=`Skin`}getDefaults(){return Object.assign(super.getDefaults(),{skeleton:null,inverseBindMatrices:null,joints:new F})}getSkeleton(){return this.getRef(`skeleton`)}setSkeleton(e){return this.setRef(`skeleton`,e)}getInverseBindMatrices(){return this.getRef(`inverseBindMatrices`)}setInverseBindMatrices(e){return this.setRef(`inverseBindMatrices`,e,{usage:`INVERSE_BIND_MATRICES`})}addJoint(e){return this.addRef(`joints`,e)}removeJoint(e){return this.removeRef(`joints`,e)}listJoints(){return this.listRefs(`joints`)}},yi=class extends K{init(){this.propertyType=`Texture`}getDefaults(){return Object.assign(super.getDefaults(),{image:null,mimeType:``,uri:``})}getMimeType(){return this.get(`mimeType`)||B.extensionToMimeType(V.extension(this.get(`uri`)))}setMimeType(e){return this.set(`mimeType`,e)}getURI(){return this.get(`uri`)}setURI(e){this.set(`uri`,e);let t=B.extensionToMimeType(V.extension(e));return t&&this.set(`mimeType`,t),this}getImage(){return this.get(`image`)}setImage(e){return this.set(`image`,z.assertView(e))}getSize(){let e=this.get(`image`);return e?B.getSize(e,this.getMimeType()):null}},bi=class extends K{_extensions=new Set;init(){this.propertyType=`Root`}getDefaults(){return Object.assign(super.getDefaults(),{asset:{generator:`glTF-Transform ${Sr}`,version:`2.0`},defaultScene:null,accessors:new F,animations:new F,buffers:new F,cameras:new F,materials:new F,meshes:new F,nodes:new F,scenes:new F,skins:new F,textures:new F})}constructor(e){super(e),e.addEventListener(`node:create`,e=>{this._addChildOfRoot(e.target)})}clone(){throw Error(`Root cannot be cloned.`)}copy(e,t=G){if(t===G)throw Error(`Root cannot be copied.`);this.set(`asset`,{...e.get(`asset`)}),this.setName(e.getName()),this.setExtras({...e.getExtras()}),this.setDefaultScene(e.getDefaultScene()?t(e.getDefaultScene()):null);for(let n of e.listRefMapKeys(`extensions`)){let r=e.getExtension(n);this.setExtension(n,t(r))}return this}_addChildOfRoot(e){return e instanceof _i?this.addRef(`scenes`,e):e instanceof mi?this.addRef(`nodes`,e):e instanceof si?this.addRef(`cameras`,e):e instanceof vi?this.addRef(`skins`,e):e instanceof pi?this.addRef(`meshes`,e):e instanceof fi?this.addRef(`materials`,e):e instanceof yi?this.addRef(`textures`,e):e instanceof ri?this.addRef(`animations`,e):e instanceof q?this.addRef(`accessors`,e):e instanceof oi&&this.addRef(`buffers`,e),this}getAsset(){return this.get(`asset`)}listExtensionsUsed(){return Array.from(this._extensions)}listExtensionsRequired(){return this.listExtensionsUsed().filter(e=>e.isRequired())}_enableExtension(e){return this._extensions.add(e),this}_disableExtension(e){return this._extensions.delete(e),this}listScenes(){return this.listRefs(`scenes`)}setDefaultScene(e){return this.setRef(`defaultScene`,e)}getDefaultScene(){return this.getRef(`defaultScene`)}listNodes(){return this.listRefs(`nodes`)}listCameras(){return this.listRefs(`cameras`)}listSkins(){return this.listRefs(`skins`)}listMeshes(){return this.listRefs(`meshes`)}listMaterials(){return this.listRefs(`materials`)}listTextures(){return this.listRefs(`textures`)}listAnimations(){return this.listRefs(`animations`)}listAccessors(){return this.listRefs(`accessors`)}listBuffers(){return this.listRefs(`buffers`)}},xi=class e{_graph=new br;_root=new bi(this._graph);_logger=U.DEFAULT_INSTANCE;static _GRAPH_DOCUMENTS=new WeakMap;static fromGraph(t){return e._GRAPH_DOCUMENTS.get(t)||null}constructor(){e._GRAPH_DOCUMENTS.set(this._graph,this)}getRoot(){return this._root}getGraph(){return this._graph}getLogger(){return this._logger}setLogger(e){return this._logger=e,this}clone(){throw Error(`Use 'cloneDocument(source)' from '@gltf-transform/functions'.`)}merge(e){throw Error(`Use 'mergeDocuments(target, source)' from '@gltf-transform/functions'.`)}async transform(...e){let t=e.map(e=>e.name);for(let n of e)await n(this,{stack:t});return this}hasExtension(e){return this.getRoot().listExtensionsUsed().some(t=>t.extensionName===e)}createExtension(e){let t=e.EXTENSION_NAME;return this.getRoot().listExtensionsUsed().find(e=>e.extensionName===t)||new e(this)}disposeExtension(e){let t=this.getRoot().listExtensionsUsed().find(t=>t.extensionName===e);t&&t.dispose()}createScene(e=``){return new _i(this._graph,e)}createNode(e=``){return new mi(this._graph,e)}createCamera(e=``){return new si(this._graph,e)}createSkin(e=``){return new vi(this._graph,e)}createMesh(e=``){return new pi(this._graph,e)}createPrimitive(){return new hi(this._graph)}createPrimitiveTarget(e=``){return new gi(this._graph,e)}createMaterial(e=``){return new fi(this._graph,e)}createTexture(e=``){return new yi(this._graph,e)}createAnimation(e=``){return new ri(this._graph,e)}createAnimationChannel(e=``){return new ii(this._graph,e)}createAnimationSampler(e=``){return new ai(this._graph,e)}createAccessor(e=``,t=null){return t||=this.getRoot().listBuffers()[0],new q(this._graph,e).setBuffer(t)}createBuffer(e=``){return new oi(this._graph,e)}},Si=class{jsonDoc;buffers=[];bufferViews=[];bufferViewBuffers=[];accessors=[];textures=[];textureInfos=new Map;materials=[];meshes=[];cameras=[];nodes=[];skins=[];animations=[];scenes=[];constructor(e){this.jsonDoc=e}setTextureInfo(e,t){this.textureInfos.set(e,t),t.texCoord!==void 0&&e.setTexCoord(t.texCoord),t.extras!==void 0&&e.setExtras(t.extras);let n=this.jsonDoc.json.textures[t.index];if(n.sampler===void 0)return;let r=this.jsonDoc.json.samplers[n.sampler];r.magFilter!==void 0&&e.setMagFilter(r.magFilter),r.minFilter!==void 0&&e.setMinFilter(r.minFilter),r.wrapS!==void 0&&e.setWrapS(r.wrapS),r.wrapT!==void 0&&e.setWrapT(r.wrapT)}},Ci={logger:U.DEFAULT_INSTANCE,extensions:[],dependencies:{}},wi=new Set([`Buffer`,`Texture`,`Material`,`Mesh`,`Primitive`,`Node`,`Scene`]),Ti=class{static read(e,t=Ci){let n={...Ci,...t},{json:r}=e,i=new xi().setLogger(n.logger);this.validate(e,n);let a=new Si(e),o=r.asset,s=i.getRoot().getAsset();o.copyright&&(s.copyright=o.copyright),o.extras&&(s.extras=o.extras),r.extras!==void 0&&i.getRoot().setExtras({...r.extras});let c=r.extensionsUsed||[],l=r.extensionsRequired||[];n.extensions.sort((e,t)=>e.EXTENSION_NAME>t.EXTENSION_NAME?1:-1);for(let e of n.extensions)if(c.includes(e.EXTENSION_NAME)){let t=i.createExtension(e).setRequired(l.includes(e.EXTENSION_NAME)),r=t.prereadTypes.filter(e=>!wi.has(e));r.length&&n.logger.warn(`Preread hooks for some types (${r.join()}), requested by extension ${t.extensionName}, are unsupported. Please file an issue or a PR.`);for(let e of t.readDependencies)t.install(e,n.dependencies[e])}let u=r.buffers||[];i.getRoot().listExtensionsUsed().filter(e=>e.prereadTypes.includes(`Buffer`)).forEach(e=>e.preread(a,`Buffer`)),a.buffers=u.map(e=>{let t=i.createBuffer(e.name);return e.extras&&t.setExtras(e.extras),e.uri&&e.uri.indexOf(`__`)!==0&&t.setURI(e.uri),t}),a.bufferViewBuffers=(r.bufferViews||[]).map((t,n)=>{if(!a.bufferViews[n]){let r=e.json.buffers[t.buffer],i=r.uri?e.resources[r.uri]:e.resources[Cr],o=t.byteOffset||0;a.bufferViews[n]=z.toView(i,o,t.byteLength)}return a.buffers[t.buffer]});let d=r.accessors||[];a.accessors=d.map(e=>{let t=a.bufferViewBuffers[e.bufferView],n=i.createAccessor(e.name,t).setType(e.type);return e.extras&&n.setExtras(e.extras),e.normalized!==void 0&&n.setNormalized(e.normalized),e.bufferView===void 0||n.setArray(Di(e,a)),n});let f=r.images||[],p=r.textures||[];i.getRoot().listExtensionsUsed().filter(e=>e.prereadTypes.includes(`Texture`)).forEach(e=>e.preread(a,`Texture`)),a.textures=f.map(t=>{let n=i.createTexture(t.name);if(t.extras&&n.setExtras(t.extras),t.bufferView!==void 0){let i=r.bufferViews[t.bufferView],a=e.json.buffers[i.buffer],o=a.uri?e.resources[a.uri]:e.resources[Cr],s=i.byteOffset||0,c=i.byteLength,l=o.slice(s,s+c);n.setImage(l)}else t.uri!==void 0&&(n.setImage(e.resources[t.uri]),t.uri.indexOf(`__`)!==0&&n.setURI(t.uri));if(t.mimeType!==void 0)n.setMimeType(t.mimeType);else if(t.uri){let e=V.extension(t.uri);n.setMimeType(B.extensionToMimeType(e))}return n}),i.getRoot().listExtensionsUsed().filter(e=>e.prereadTypes.includes(`Material`)).forEach(e=>e.preread(a,`Material`)),a.materials=(r.materials||[]).map(e=>{let t=i.createMaterial(e.name);e.extras&&t.setExtras(e.extras),e.alphaMode!==void 0&&t.setAlphaMode(e.alphaMode),e.alphaCutoff!==void 0&&t.setAlphaCutoff(e.alphaCutoff),e.doubleSided!==void 0&&t.setDoubleSided(e.doubleSided);let n=e.pbrMetallicRoughness||{};if(n.baseColorFactor!==void 0&&t.setBaseColorFactor(n.baseColorFactor),e.emissiveFactor!==void 0&&t.setEmissiveFactor(e.emissiveFactor),n.metallicFactor!==void 0&&t.setMetallicFactor(n.metallicFactor),n.roughnessFactor!==void 0&&t.setRoughnessFactor(n.roughnessFactor),n.baseColorTexture!==void 0){let e=n.baseColorTexture,r=a.textures[p[e.index].source];t.setBaseColorTexture(r),a.setTextureInfo(t.getBaseColorTextureInfo(),e)}if(e.emissiveTexture!==void 0){let n=e.emissiveTexture,r=a.textures[p[n.index].source];t.setEmissiveTexture(r),a.setTextureInfo(t.getEmissiveTextureInfo(),n)}if(e.normalTexture!==void 0){let n=e.normalTexture,r=a.textures[p[n.index].source];t.setNormalTexture(r),a.setTextureInfo(t.getNormalTextureInfo(),n),e.normalTexture.scale!==void 0&&t.setNormalScale(e.normalTexture.scale)}if(e.occlusionTexture!==void 0){let n=e.occlusionTexture,r=a.textures[p[n.index].source];t.setOcclusionTexture(r),a.setTextureInfo(t.getOcclusionTextureInfo(),n),e.occlusionTexture.strength!==void 0&&t.setOcclusionStrength(e.occlusionTexture.strength)}if(n.metallicRoughnessTexture!==void 0){let e=n.metallicRoughnessTexture,r=a.textures[p[e.index].source];t.setMetallicRoughnessTexture(r),a.setTextureInfo(t.getMetallicRoughnessTextureInfo(),e)}return t}),i.getRoot().listExtensionsUsed().filter(e=>e.prereadTypes.includes(`Mesh`)).forEach(e=>e.preread(a,`Mesh`));let m=r.meshes||[];i.getRoot().listExtensionsUsed().filter(e=>e.prereadTypes.includes(`Primitive`)).forEach(e=>e.preread(a,`Primitive`)),a.meshes=m.map(e=>{let t=i.createMesh(e.name);return e.extras&&t.setExtras(e.extras),e.weights!==void 0&&t.setWeights(e.weights),(e.primitives||[]).forEach(n=>{let r=i.createPrimitive();n.extras&&r.setExtras(n.extras),n.material!==void 0&&r.setMaterial(a.materials[n.material]),n.mode!==void 0&&r.setMode(n.mode);for(let[e,t]of Object.entries(n.attributes||{}))r.setAttribute(e,a.accessors[t]);n.indices!==void 0&&r.setIndices(a.accessors[n.indices]);let o=e.extras&&e.extras.targetNames||[];(n.targets||[]).forEach((e,t)=>{let n=o[t]||t.toString(),s=i.createPrimitiveTarget(n);for(let[t,n]of Object.entries(e))s.setAttribute(t,a.accessors[n]);r.addTarget(s)}),t.addPrimitive(r)}),t}),a.cameras=(r.cameras||[]).map(e=>{let t=i.createCamera(e.name).setType(e.type);if(e.extras&&t.setExtras(e.extras),e.type===si.Type.PERSPECTIVE){let n=e.perspective;t.setYFov(n.yfov),t.setZNear(n.znear),n.zfar!==void 0&&t.setZFar(n.zfar),n.aspectRatio!==void 0&&t.setAspectRatio(n.aspectRatio)}else{let n=e.orthographic;t.setZNear(n.znear).setZFar(n.zfar).setXMag(n.xmag).setYMag(n.ymag)}return t});let h=r.nodes||[];i.getRoot().listExtensionsUsed().filter(e=>e.prereadTypes.includes(`Node`)).forEach(e=>e.preread(a,`Node`)),a.nodes=h.map(e=>{let t=i.createNode(e.name);if(e.extras&&t.setExtras(e.extras),e.translation!==void 0&&t.setTranslation(e.translation),e.rotation!==void 0&&t.setRotation(e.rotation),e.scale!==void 0&&t.setScale(e.scale),e.matrix!==void 0){let n=[0,0,0],r=[0,0,0,1],i=[1,1,1];W.decompose(e.matrix,n,r,i),t.setTranslation(n),t.setRotation(r),t.setScale(i)}return e.weights!==void 0&&t.setWeights(e.weights),t}),a.skins=(r.skins||[]).map(e=>{let t=i.createSkin(e.name);e.extras&&t.setExtras(e.extras),e.inverseBindMatrices!==void 0&&t.setInverseBindMatrices(a.accessors[e.inverseBindMatrices]),e.skeleton!==void 0&&t.setSkeleton(a.nodes[e.skeleton]);for(let n of e.joints)t.addJoint(a.nodes[n]);return t}),h.map((e,t)=>{let n=a.nodes[t];(e.children||[]).forEach(e=>n.addChild(a.nodes[e])),e.mesh!==void 0&&n.setMesh(a.meshes[e.mesh]),e.camera!==void 0&&n.setCamera(a.cameras[e.camera]),e.skin!==void 0&&n.setSkin(a.skins[e.skin])}),a.animations=(r.animations||[]).map(e=>{let t=i.createAnimation(e.name);e.extras&&t.setExtras(e.extras);let n=(e.samplers||[]).map(e=>{let n=i.createAnimationSampler().setInput(a.accessors[e.input]).setOutput(a.accessors[e.output]).setInterpolation(e.interpolation||ai.Interpolation.LINEAR);return e.extras&&n.setExtras(e.extras),t.addSampler(n),n});return(e.channels||[]).forEach(e=>{let r=i.createAnimationChannel().setSampler(n[e.sampler]).setTargetPath(e.target.path);e.target.node!==void 0&&r.setTargetNode(a.nodes[e.target.node]),e.extras&&r.setExtras(e.extras),t.addChannel(r)}),t});let g=r.scenes||[];return i.getRoot().listExtensionsUsed().filter(e=>e.prereadTypes.includes(`Scene`)).forEach(e=>e.preread(a,`Scene`)),a.scenes=g.map(e=>{let t=i.createScene(e.name);return e.extras&&t.setExtras(e.extras),(e.nodes||[]).map(e=>a.nodes[e]).forEach(e=>t.addChild(e)),t}),r.scene!==void 0&&i.getRoot().setDefaultScene(a.scenes[r.scene]),i.getRoot().listExtensionsUsed().forEach(e=>e.read(a)),d.forEach((e,t)=>{let n=a.accessors[t],r=!!e.sparse,i=!e.bufferView&&!n.getArray();(r||i)&&n.setSparse(!0).setArray(Oi(e,a))}),i}static validate(e,t){let n=e.json;if(n.asset.version!==`2.0`)throw Error(`Unsupported glTF version, "${n.asset.version}".`);if(n.extensionsRequired){for(let e of n.extensionsRequired)if(!t.extensions.find(t=>t.EXTENSION_NAME===e))throw Error(`Missing required extension, "${e}".`)}if(n.extensionsUsed)for(let e of n.extensionsUsed)t.extensions.find(t=>t.EXTENSION_NAME===e)||t.logger.warn(`Missing optional extension, "${e}".`)}};function Ei(e,t){let n=t.jsonDoc,r=t.bufferViews[e.bufferView],i=n.json.bufferViews[e.bufferView],a=Dr[e.componentType],o=q.getElementSize(e.type),s=a.BYTES_PER_ELEMENT,c=e.byteOffset||0,l=new a(e.count*o),u=new DataView(r.buffer,r.byteOffset,r.byteLength),d=i.byteStride;for(let t=0;t<e.count;t++)for(let n=0;n<o;n++){let r=c+t*d+n*s,i;switch(e.componentType){case q.ComponentType.FLOAT:i=u.getFloat32(r,!0);break;case q.ComponentType.UNSIGNED_INT:i=u.getUint32(r,!0);break;case q.ComponentType.UNSIGNED_SHORT:i=u.getUint16(r,!0);break;case q.ComponentType.UNSIGNED_BYTE:i=u.getUint8(r);break;case q.ComponentType.SHORT:i=u.getInt16(r,!0);break;case q.ComponentType.BYTE:i=u.getInt8(r);break;case q.ComponentType.FLOAT16:i=u.getFloat16(r,!0);break;case q.ComponentType.FLOAT64:i=u.getFloat64(r,!0);break;default:throw Error(`Unexpected componentType "${e.componentType}".`)}l[t*o+n]=i}return l}function Di(e,t){let n=t.jsonDoc,r=t.bufferViews[e.bufferView],i=n.json.bufferViews[e.bufferView],a=Dr[e.componentType],o=q.getElementSize(e.type),s=a.BYTES_PER_ELEMENT,c=o*s;if(i.byteStride!==void 0&&i.byteStride!==c)return Ei(e,t);let l=r.byteOffset+(e.byteOffset||0),u=e.count*o*s;return new a(r.buffer.slice(l,l+u))}function Oi(e,t){let n=Dr[e.componentType],r=q.getElementSize(e.type),i;i=e.bufferView===void 0?new n(e.count*r):Di(e,t);let a=e.sparse;if(!a)return i;let o=a.count,s={...e,...a.indices,count:o,type:`SCALAR`},c={...e,...a.values,count:o},l=Di(s,t),u=Di(c,t);for(let e=0;e<s.count;e++)for(let t=0;t<r;t++)i[l[e]*r+t]=u[e*r+t];return i}var ki=function(e){return e[e.ARRAY_BUFFER=34962]=`ARRAY_BUFFER`,e[e.ELEMENT_ARRAY_BUFFER=34963]=`ELEMENT_ARRAY_BUFFER`,e}(ki||{}),Ai=class{_doc;jsonDoc;options;static BufferViewTarget=ki;static BufferViewUsage=wr;static USAGE_TO_TARGET={ARRAY_BUFFER:34962,ELEMENT_ARRAY_BUFFER:34963};accessorIndexMap=new Map;animationIndexMap=new Map;bufferIndexMap=new Map;cameraIndexMap=new Map;skinIndexMap=new Map;materialIndexMap=new Map;meshIndexMap=new Map;nodeIndexMap=new Map;imageIndexMap=new Map;textureDefIndexMap=new Map;textureInfoDefMap=new Map;samplerDefIndexMap=new Map;sceneIndexMap=new Map;imageBufferViews=[];otherBufferViews=new Map;otherBufferViewsIndexMap=new Map;extensionData={};bufferURIGenerator;imageURIGenerator;logger;_accessorUsageMap=new Map;accessorUsageGroupedByParent=new Set([`ARRAY_BUFFER`]);accessorParents=new Map;constructor(e,t,n){this._doc=e,this.jsonDoc=t,this.options=n;let r=e.getRoot(),i=r.listBuffers().length,a=r.listTextures().length;this.bufferURIGenerator=new ji(i>1,()=>n.basename||`buffer`),this.imageURIGenerator=new ji(a>1,t=>Mi(e,t)||n.basename||`texture`),this.logger=e.getLogger()}createTextureInfoDef(e,t){let n={magFilter:t.getMagFilter()||void 0,minFilter:t.getMinFilter()||void 0,wrapS:t.getWrapS(),wrapT:t.getWrapT()},r=JSON.stringify(n);this.samplerDefIndexMap.has(r)||(this.samplerDefIndexMap.set(r,this.jsonDoc.json.samplers.length),this.jsonDoc.json.samplers.push(n));let i={source:this.imageIndexMap.get(e),sampler:this.samplerDefIndexMap.get(r)},a=JSON.stringify(i);this.textureDefIndexMap.has(a)||(this.textureDefIndexMap.set(a,this.jsonDoc.json.textures.length),this.jsonDoc.json.textures.push(i));let o={index:this.textureDefIndexMap.get(a)};return t.getTexCoord()!==0&&(o.texCoord=t.getTexCoord()),Object.keys(t.getExtras()).length>0&&(o.extras=t.getExtras()),this.textureInfoDefMap.set(t,o),o}createPropertyDef(e){let t={};return e.getName()&&(t.name=e.getName()),Object.keys(e.getExtras()).length>0&&(t.extras=e.getExtras()),t}createAccessorDef(e){let t=this.createPropertyDef(e);return t.type=e.getType(),t.componentType=e.getComponentType(),t.count=e.getCount(),this._doc.getGraph().listParentEdges(e).some(e=>e.getName()===`attributes`&&e.getAttributes().key===`POSITION`||e.getName()===`input`)&&(t.max=e.getMax([]).map(Math.fround),t.min=e.getMin([]).map(Math.fround)),e.getNormalized()&&(t.normalized=e.getNormalized()),t}createImageData(e,t,n){if(this.options.format===`GLB`)this.imageBufferViews.push(t),e.bufferView=this.jsonDoc.json.bufferViews.length,this.jsonDoc.json.bufferViews.push({buffer:0,byteOffset:-1,byteLength:t.byteLength});else{let r=B.mimeTypeToExtension(n.getMimeType());e.uri=this.imageURIGenerator.createURI(n,r),this.assignResourceURI(e.uri,t,!1)}}assignResourceURI(e,t,n){let r=this.jsonDoc.resources;if(!(e in r)){r[e]=t;return}if(t===r[e]){this.logger.warn(`Duplicate resource URI, "${e}".`);return}let i=`Resource URI "${e}" already assigned to different data.`;if(!n)this.logger.warn(i);else throw Error(i)}getAccessorUsage(e){let t=this._accessorUsageMap.get(e);if(t)return t;if(e.getSparse())return`SPARSE`;for(let t of this._doc.getGraph().listParentEdges(e)){let{usage:e}=t.getAttributes();if(e)return e;t.getParent().propertyType!==`Root`&&this.logger.warn(`Missing attribute ".usage" on edge, "${t.getName()}".`)}return`OTHER`}addAccessorToUsageGroup(e,t){let n=this._accessorUsageMap.get(e);if(n&&n!==t)throw Error(`Accessor with usage "${n}" cannot be reused as "${t}".`);return this._accessorUsageMap.set(e,t),this}},ji=class{multiple;basename;counter={};constructor(e,t){this.multiple=e,this.basename=t}createURI(e,t){if(e.getURI())return e.getURI();if(this.multiple){let n=this.basename(e);return this.counter[n]=this.counter[n]||1,`${n}_${this.counter[n]++}.${t}`}return`${this.basename(e)}.${t}`}};function Mi(e,t){let n=e.getGraph().listParentEdges(t).find(t=>t.getParent()!==e.getRoot());return n?n.getName().replace(/texture$/i,``):``}var{BufferViewUsage:Ni}=Ai,{UNSIGNED_INT:Pi,UNSIGNED_SHORT:Fi,UNSIGNED_BYTE:Ii}=q.ComponentType,Li=new Set([`Accessor`,`Buffer`,`Material`,`Mesh`]),Ri=class{static write(e,t){let n=e.getGraph(),r=e.getRoot(),i={asset:{generator:`glTF-Transform ${Sr}`,...r.getAsset()},extras:{...r.getExtras()}},a={json:i,resources:{}},o=new Ai(e,a,t),s=t.logger||U.DEFAULT_INSTANCE,c=new Set(t.extensions.map(e=>e.EXTENSION_NAME)),l=e.getRoot().listExtensionsUsed().filter(e=>c.has(e.extensionName)).sort((e,t)=>e.extensionName>t.extensionName?1:-1),u=e.getRoot().listExtensionsRequired().filter(e=>c.has(e.extensionName)).sort((e,t)=>e.extensionName>t.extensionName?1:-1);l.length<e.getRoot().listExtensionsUsed().length&&s.warn(`Some extensions were not registered for I/O, and will not be written.`);for(let e of l){let n=e.prewriteTypes.filter(e=>!Li.has(e));n.length&&s.warn(`Prewrite hooks for some types (${n.join()}), requested by extension ${e.extensionName}, are unsupported. Please file an issue or a PR.`);for(let n of e.writeDependencies)e.install(n,t.dependencies[n])}function d(e,t,n,r){let a=[],s=0;for(let t of e){let e=o.createAccessorDef(t);e.bufferView=i.bufferViews.length;let n=t.getArray(),r=z.pad(z.toView(n));e.byteOffset=s,s+=r.byteLength,a.push(r),o.accessorIndexMap.set(t,i.accessors.length),i.accessors.push(e)}let c={buffer:t,byteOffset:n,byteLength:z.concat(a).byteLength};return r&&(c.target=r),i.bufferViews.push(c),{buffers:a,byteLength:s}}function f(e,t,n){let r=e[0].getCount(),a=0;for(let t of e){let e=o.createAccessorDef(t);e.bufferView=i.bufferViews.length,e.byteOffset=a;let n=t.getElementSize(),r=t.getComponentSize();a+=z.padNumber(n*r),o.accessorIndexMap.set(t,i.accessors.length),i.accessors.push(e)}let s=r*a,c=new ArrayBuffer(s),l=new DataView(c);for(let t=0;t<r;t++){let n=0;for(let r of e){let e=r.getElementSize(),i=r.getComponentSize(),o=r.getComponentType(),s=r.getArray();for(let r=0;r<e;r++){let c=t*a+n+r*i,u=s[t*e+r];switch(o){case q.ComponentType.FLOAT:l.setFloat32(c,u,!0);break;case q.ComponentType.BYTE:l.setInt8(c,u);break;case q.ComponentType.SHORT:l.setInt16(c,u,!0);break;case q.ComponentType.UNSIGNED_BYTE:l.setUint8(c,u);break;case q.ComponentType.UNSIGNED_SHORT:l.setUint16(c,u,!0);break;case q.ComponentType.UNSIGNED_INT:l.setUint32(c,u,!0);break;case q.ComponentType.FLOAT16:l.setFloat16(c,u,!0);break;case q.ComponentType.FLOAT64:l.setFloat64(c,u,!0);break;default:throw Error(`Unexpected component type: `+o)}}n+=z.padNumber(e*i)}}let u={buffer:t,byteOffset:n,byteLength:s,byteStride:a,target:Ai.BufferViewTarget.ARRAY_BUFFER};return i.bufferViews.push(u),{byteLength:s,buffers:[new Uint8Array(c)]}}function p(e,t,n){let r=[],a=0,c=new Map,l=-1/0,u=!1;for(let t of e){let e=o.createAccessorDef(t);i.accessors.push(e),o.accessorIndexMap.set(t,i.accessors.length-1);let n=[],r=[],a=[],s=Array(t.getElementSize()).fill(0);for(let e=0,i=t.getCount();e<i;e++)if(t.getElement(e,a),!W.eq(a,s,0)){l=Math.max(e,l),n.push(e);for(let e=0;e<a.length;e++)r.push(a[e])}let d=n.length,f={accessorDef:e,count:d};if(c.set(t,f),d===0)continue;d>t.getCount()/2&&(u=!0);let p=Dr[t.getComponentType()];f.indices=n,f.values=new p(r)}if(!Number.isFinite(l))return{buffers:r,byteLength:a};u&&s.warn(`Some sparse accessors have >50% non-zero elements, which may increase file size.`);let d=l<255?Uint8Array:l<65535?Uint16Array:Uint32Array,f=l<255?Ii:l<65535?Fi:Pi,p={buffer:t,byteOffset:n+a,byteLength:0};for(let t of e){let e=c.get(t);if(e.count===0)continue;e.indicesByteOffset=p.byteLength;let n=z.pad(z.toView(new d(e.indices)));r.push(n),a+=n.byteLength,p.byteLength+=n.byteLength}i.bufferViews.push(p);let m=i.bufferViews.length-1,h={buffer:t,byteOffset:n+a,byteLength:0};for(let t of e){let e=c.get(t);if(e.count===0)continue;e.valuesByteOffset=h.byteLength;let n=z.pad(z.toView(e.values));r.push(n),a+=n.byteLength,h.byteLength+=n.byteLength}i.bufferViews.push(h);let g=i.bufferViews.length-1;for(let t of e){let e=c.get(t);e.count!==0&&(e.accessorDef.sparse={count:e.count,indices:{bufferView:m,byteOffset:e.indicesByteOffset,componentType:f},values:{bufferView:g,byteOffset:e.valuesByteOffset}})}return{buffers:r,byteLength:a}}if(i.accessors=[],i.bufferViews=[],i.samplers=[],i.textures=[],i.images=r.listTextures().map((e,t)=>{let n=o.createPropertyDef(e);e.getMimeType()&&(n.mimeType=e.getMimeType());let r=e.getImage();return r&&o.createImageData(n,r,e),o.imageIndexMap.set(e,t),n}),l.filter(e=>e.prewriteTypes.includes(`Accessor`)).forEach(e=>e.prewrite(o,`Accessor`)),r.listAccessors().forEach(e=>{let t=o.accessorUsageGroupedByParent,r=o.accessorParents;if(o.accessorIndexMap.has(e))return;let i=o.getAccessorUsage(e);if(o.addAccessorToUsageGroup(e,i),t.has(i)){let t=n.listParents(e).find(e=>e.propertyType!==`Root`);r.set(e,t)}}),l.filter(e=>e.prewriteTypes.includes(`Buffer`)).forEach(e=>e.prewrite(o,`Buffer`)),(r.listAccessors().length>0||o.otherBufferViews.size>0||r.listTextures().length>0&&t.format===`GLB`)&&r.listBuffers().length===0)throw Error(`Buffer required for Document resources, but none was found.`);i.buffers=[],r.listBuffers().forEach((e,n)=>{let r=o.createPropertyDef(e),a=o.accessorUsageGroupedByParent,s=e.listParents().filter(e=>e instanceof q),c=new Set(s.map(e=>o.accessorParents.get(e))),l=new Map(Array.from(c).map((e,t)=>[e,t])),u={};for(let e of s){if(o.accessorIndexMap.has(e))continue;let t=o.getAccessorUsage(e),n=t;if(a.has(t)){let t=o.accessorParents.get(e);n+=`:${l.get(t)}`}u[n]||={usage:t,accessors:[]},u[n].accessors.push(e)}let m=[],h=i.buffers.length,g=0;for(let{usage:e,accessors:n}of Object.values(u))if(e===Ni.ARRAY_BUFFER&&t.vertexLayout===`interleaved`){let e=f(n,h,g);g+=e.byteLength;for(let t of e.buffers)m.push(t)}else if(e===Ni.ARRAY_BUFFER)for(let e of n){let t=f([e],h,g);g+=t.byteLength;for(let e of t.buffers)m.push(e)}else if(e===Ni.SPARSE){let e=p(n,h,g);g+=e.byteLength;for(let t of e.buffers)m.push(t)}else if(e===Ni.ELEMENT_ARRAY_BUFFER){let e=Ai.BufferViewTarget.ELEMENT_ARRAY_BUFFER,t=d(n,h,g,e);g+=t.byteLength;for(let e of t.buffers)m.push(e)}else{let e=d(n,h,g);g+=e.byteLength;for(let t of e.buffers)m.push(t)}if(o.imageBufferViews.length&&n===0){for(let e=0;e<o.imageBufferViews.length;e++)if(i.bufferViews[i.images[e].bufferView].byteOffset=g,g+=o.imageBufferViews[e].byteLength,m.push(o.imageBufferViews[e]),g%8){let e=8-g%8;g+=e,m.push(new Uint8Array(e))}}if(o.otherBufferViews.has(e))for(let t of o.otherBufferViews.get(e))i.bufferViews.push({buffer:h,byteOffset:g,byteLength:t.byteLength}),o.otherBufferViewsIndexMap.set(t,i.bufferViews.length-1),g+=t.byteLength,m.push(t);if(g){let n;t.format===`GLB`?n=Cr:(n=o.bufferURIGenerator.createURI(e,`bin`),r.uri=n),r.byteLength=g,o.assignResourceURI(n,z.concat(m),!0)}i.buffers.push(r),o.bufferIndexMap.set(e,n)}),r.listAccessors().find(e=>!e.getBuffer())&&s.warn(`Skipped writing one or more Accessors: no Buffer assigned.`),l.filter(e=>e.prewriteTypes.includes(`Material`)).forEach(e=>e.prewrite(o,`Material`)),i.materials=r.listMaterials().map((e,t)=>{let n=o.createPropertyDef(e);if(e.getAlphaMode()!==fi.AlphaMode.OPAQUE&&(n.alphaMode=e.getAlphaMode()),e.getAlphaMode()===fi.AlphaMode.MASK&&(n.alphaCutoff=e.getAlphaCutoff()),e.getDoubleSided()&&(n.doubleSided=!0),n.pbrMetallicRoughness={},W.eq(e.getBaseColorFactor(),[1,1,1,1])||(n.pbrMetallicRoughness.baseColorFactor=e.getBaseColorFactor()),W.eq(e.getEmissiveFactor(),[0,0,0])||(n.emissiveFactor=e.getEmissiveFactor()),e.getRoughnessFactor()!==1&&(n.pbrMetallicRoughness.roughnessFactor=e.getRoughnessFactor()),e.getMetallicFactor()!==1&&(n.pbrMetallicRoughness.metallicFactor=e.getMetallicFactor()),e.getBaseColorTexture()){let t=e.getBaseColorTexture(),r=e.getBaseColorTextureInfo();n.pbrMetallicRoughness.baseColorTexture=o.createTextureInfoDef(t,r)}if(e.getEmissiveTexture()){let t=e.getEmissiveTexture(),r=e.getEmissiveTextureInfo();n.emissiveTexture=o.createTextureInfoDef(t,r)}if(e.getNormalTexture()){let t=e.getNormalTexture(),r=e.getNormalTextureInfo(),i=o.createTextureInfoDef(t,r);e.getNormalScale()!==1&&(i.scale=e.getNormalScale()),n.normalTexture=i}if(e.getOcclusionTexture()){let t=e.getOcclusionTexture(),r=e.getOcclusionTextureInfo(),i=o.createTextureInfoDef(t,r);e.getOcclusionStrength()!==1&&(i.strength=e.getOcclusionStrength()),n.occlusionTexture=i}if(e.getMetallicRoughnessTexture()){let t=e.getMetallicRoughnessTexture(),r=e.getMetallicRoughnessTextureInfo();n.pbrMetallicRoughness.metallicRoughnessTexture=o.createTextureInfoDef(t,r)}return o.materialIndexMap.set(e,t),n}),l.filter(e=>e.prewriteTypes.includes(`Mesh`)).forEach(e=>e.prewrite(o,`Mesh`)),i.meshes=r.listMeshes().map((e,t)=>{let n=o.createPropertyDef(e),r=null;return n.primitives=e.listPrimitives().map(e=>{let t={attributes:{}};t.mode=e.getMode();let n=e.getMaterial();n&&(t.material=o.materialIndexMap.get(n)),Object.keys(e.getExtras()).length&&(t.extras=e.getExtras());let i=e.getIndices();i&&(t.indices=o.accessorIndexMap.get(i));for(let n of e.listSemantics())t.attributes[n]=o.accessorIndexMap.get(e.getAttribute(n));for(let n of e.listTargets()){let e={};for(let t of n.listSemantics())e[t]=o.accessorIndexMap.get(n.getAttribute(t));t.targets=t.targets||[],t.targets.push(e)}return e.listTargets().length&&!r&&(r=e.listTargets().map(e=>e.getName())),t}),e.getWeights().length&&(n.weights=e.getWeights()),r&&(n.extras=n.extras||{},n.extras.targetNames=r),o.meshIndexMap.set(e,t),n}),i.cameras=r.listCameras().map((e,t)=>{let n=o.createPropertyDef(e);if(n.type=e.getType(),n.type===si.Type.PERSPECTIVE){n.perspective={znear:e.getZNear(),zfar:e.getZFar(),yfov:e.getYFov()};let t=e.getAspectRatio();t!==null&&(n.perspective.aspectRatio=t)}else n.orthographic={znear:e.getZNear(),zfar:e.getZFar(),xmag:e.getXMag(),ymag:e.getYMag()};return o.cameraIndexMap.set(e,t),n}),i.nodes=r.listNodes().map((e,t)=>{let n=o.createPropertyDef(e);return W.eq(e.getTranslation(),[0,0,0])||(n.translation=e.getTranslation()),W.eq(e.getRotation(),[0,0,0,1])||(n.rotation=e.getRotation()),W.eq(e.getScale(),[1,1,1])||(n.scale=e.getScale()),e.getWeights().length&&(n.weights=e.getWeights()),o.nodeIndexMap.set(e,t),n}),i.skins=r.listSkins().map((e,t)=>{let n=o.createPropertyDef(e),r=e.getInverseBindMatrices();r&&(n.inverseBindMatrices=o.accessorIndexMap.get(r));let i=e.getSkeleton();return i&&(n.skeleton=o.nodeIndexMap.get(i)),n.joints=e.listJoints().map(e=>o.nodeIndexMap.get(e)),o.skinIndexMap.set(e,t),n}),r.listNodes().forEach((e,t)=>{let n=i.nodes[t],r=e.getMesh();r&&(n.mesh=o.meshIndexMap.get(r));let a=e.getCamera();a&&(n.camera=o.cameraIndexMap.get(a));let s=e.getSkin();s&&(n.skin=o.skinIndexMap.get(s)),e.listChildren().length>0&&(n.children=e.listChildren().map(e=>o.nodeIndexMap.get(e)))}),i.animations=r.listAnimations().map((e,t)=>{let n=o.createPropertyDef(e),r=new Map;return n.samplers=e.listSamplers().map((e,t)=>{let n=o.createPropertyDef(e);return n.input=o.accessorIndexMap.get(e.getInput()),n.output=o.accessorIndexMap.get(e.getOutput()),n.interpolation=e.getInterpolation(),r.set(e,t),n}),n.channels=e.listChannels().map(e=>{let t=o.createPropertyDef(e);return t.sampler=r.get(e.getSampler()),t.target={node:o.nodeIndexMap.get(e.getTargetNode()),path:e.getTargetPath()},t}),o.animationIndexMap.set(e,t),n}),i.scenes=r.listScenes().map((e,t)=>{let n=o.createPropertyDef(e);return n.nodes=e.listChildren().map(e=>o.nodeIndexMap.get(e)),o.sceneIndexMap.set(e,t),n});let m=r.getDefaultScene();return m&&(i.scene=r.listScenes().indexOf(m)),i.extensionsUsed=l.map(e=>e.extensionName),i.extensionsRequired=u.map(e=>e.extensionName),l.forEach(e=>e.write(o)),zi(i),a}};function zi(e){let t=[];for(let n in e){let r=e[n];(Array.isArray(r)&&r.length===0||r===null||r===``||r&&typeof r==`object`&&Object.keys(r).length===0)&&t.push(n)}for(let n of t)delete e[n]}var Bi=class{_logger=U.DEFAULT_INSTANCE;_extensions=new Set;_dependencies={};_vertexLayout=`interleaved`;_strictResources=!0;lastReadBytes=0;lastWriteBytes=0;setLogger(e){return this._logger=e,this}registerExtensions(e){for(let t of e)this._extensions.add(t),t.register();return this}registerDependencies(e){return Object.assign(this._dependencies,e),this}setVertexLayout(e){return this._vertexLayout=e,this}setStrictResources(e){return this._strictResources=e,this}async read(e){return await this.readJSON(await this.readAsJSON(e))}async readAsJSON(e){let t=await this.readURI(e,`view`);this.lastReadBytes=t.byteLength;let n=Ui(t)?this._binaryToJSON(t):{json:JSON.parse(z.decodeText(t)),resources:{}};return await this._readResourcesExternal(n,this.dirname(e)),this._readResourcesInternal(n),n}async readJSON(e){return e=this._copyJSON(e),this._readResourcesInternal(e),Ti.read(e,{extensions:Array.from(this._extensions),dependencies:this._dependencies,logger:this._logger})}async binaryToJSON(e){let t=this._binaryToJSON(z.assertView(e));this._readResourcesInternal(t);let n=t.json;if(n.buffers&&n.buffers.some(e=>Vi(t,e)))throw Error(`Cannot resolve external buffers with binaryToJSON().`);if(n.images&&n.images.some(e=>Hi(t,e)))throw Error(`Cannot resolve external images with binaryToJSON().`);return t}async readBinary(e){return this.readJSON(await this.binaryToJSON(z.assertView(e)))}async writeJSON(e,t={}){if(t.format===`GLB`&&e.getRoot().listBuffers().length>1)throw Error(`GLB must have 0–1 buffers.`);return Ri.write(e,{format:t.format||`GLTF`,basename:t.basename||``,logger:this._logger,vertexLayout:this._vertexLayout,dependencies:{...this._dependencies},extensions:Array.from(this._extensions)})}async writeBinary(e){let{json:t,resources:n}=await this.writeJSON(e,{format:`GLB`}),r=new Uint32Array([1179937895,2,12]),i=JSON.stringify(t),a=z.pad(z.encodeText(i),32),o=z.toView(new Uint32Array([a.byteLength,1313821514])),s=z.concat([o,a]);r[r.length-1]+=s.byteLength;let c=Object.values(n)[0];if(!c||!c.byteLength)return z.concat([z.toView(r),s]);let l=z.pad(c,0),u=z.toView(new Uint32Array([l.byteLength,5130562])),d=z.concat([u,l]);return r[r.length-1]+=d.byteLength,z.concat([z.toView(r),s,d])}async _readResourcesExternal(e,t){let n=e.json.images||[],r=e.json.buffers||[],i=[...n,...r].map(async r=>{let i=r.uri;if(!i||i.match(/data:/))return Promise.resolve();try{e.resources[i]=await this.readURI(this.resolve(t,i),`view`),this.lastReadBytes+=e.resources[i].byteLength}catch(t){if(!this._strictResources&&n.includes(r))this._logger.warn(`Failed to load image URI, "${i}". ${t}`),e.resources[i]=null;else throw t}});await Promise.all(i)}_readResourcesInternal(e){function t(t){if(t.uri){if(t.uri in e.resources)z.assertView(e.resources[t.uri]);else if(t.uri.match(/data:/)){let n=`__${$r()}.${V.extension(t.uri)}`;e.resources[n]=z.createBufferFromDataURI(t.uri),t.uri=n}}}(e.json.images||[]).forEach(e=>{if(e.bufferView===void 0&&e.uri===void 0)throw Error(`Missing resource URI or buffer view.`);t(e)}),(e.json.buffers||[]).forEach(t)}_copyJSON(e){let{images:t,buffers:n}=e.json;return e={json:{...e.json},resources:{...e.resources}},t&&(e.json.images=t.map(e=>({...e}))),n&&(e.json.buffers=n.map(e=>({...e}))),e}_binaryToJSON(e){if(!Ui(e))throw Error(`Invalid glTF 2.0 binary.`);let t=new Uint32Array(e.buffer,e.byteOffset+12,2);if(t[1]!==1313821514)throw Error(`Missing required GLB JSON chunk.`);let n=t[0],r=z.decodeText(z.toView(e,20,n)),i=JSON.parse(r),a=20+n;if(e.byteLength<=a)return{json:i,resources:{}};let o=new Uint32Array(e.buffer,e.byteOffset+a,2);if(o[1]!==5130562)return{json:i,resources:{}};let s=o[0],c=z.toView(e,a+8,s);return{json:i,resources:{[Cr]:c}}}};function Vi(e,t){return t.uri!==void 0&&!(t.uri in e.resources)}function Hi(e,t){return t.uri!==void 0&&!(t.uri in e.resources)&&t.bufferView===void 0}function Ui(e){if(e.byteLength<3*Uint32Array.BYTES_PER_ELEMENT)return!1;let t=new Uint32Array(e.buffer,e.byteOffset,3);return t[0]===1179937895&&t[1]===2}var Wi=class extends Bi{_fetchConfig;constructor(e=Fr.DEFAULT_INIT){super(),this._fetchConfig=e}async readURI(e,t){let n=await fetch(e,this._fetchConfig);switch(t){case`view`:return new Uint8Array(await n.arrayBuffer());case`text`:return n.text()}}resolve(e,t){return Fr.resolve(e,t)}dirname(e){return Fr.dirname(e)}},Gi=4e6,Ki=6*Gi,qi=32e6,Ji=2**28,Yi=256*2**20,Xi=4,Zi=5,Qi=6,$i={33071:`clamp-to-edge`,33648:`mirror-repeat`,10497:`repeat`},ea=[`opaque`,`mixed`,`transparent`],ta=/^KHR_(mesh_quantization|materials_(?!pbrSpecularGlossiness).*)$/;async function na(e,t){if(t.size>Yi)throw new C(`${e} is larger than ${Yi/2**20} MiB.`,`Open a smaller file.`);let n=await t.arrayBuffer().catch(()=>{throw new C(`${e} cannot be read.`,`It may be a folder, or have changed on the disk: choose it again.`)});try{let t=await aa(e,await ra(e,new Uint8Array(n)));if(t.every(e=>e.mesh.corners.length===0))throw new C(`${e} has nothing to draw.`,`Check that it has meshes of triangles in a scene.`);return fa(e,t)}catch(t){throw t instanceof RangeError?new C(`${e} is too large.`,`Open a smaller file.`):t}}async function ra(e,t){try{let n=new Wi().setLogger(new U(U.Verbosity.SILENT)),r=await n.binaryToJSON(t),i=(r.json.extensionsRequired??[]).filter(e=>!ta.test(e));if(i.length>0)throw new C(`${e} needs ${i.join(`, `)}, which is not supported here.`,`Export it without.`);r.json.extensionsRequired=[];let a=(r.json.accessors??[]).map(({count:e})=>e);if(!a.every(e=>Number.isInteger(e)&&e>0))throw Error(`a count is none`);let o=a.reduce((e,t)=>e+t,0);if(o>qi)throw ia(e,o,`elements of attributes and indices`);return await n.readJSON(r)}catch(t){throw t instanceof C?t:new C(`${e} cannot be read as binary glTF.`,`Check it with a glTF validator; it has to be one .glb file.`)}}var ia=(e,t,n)=>new C(`${e} has ${t.toLocaleString(`en`)} ${n} or more.`,`Open a smaller file.`);async function aa(e,t){let n=t.getRoot(),r=n.getDefaultScene()??n.listScenes()[0],i=new Map,a=new Map,o=new Map,s=[],f=(r?.listChildren()??[]).map(e=>({node:e,matrix:e.getMatrix()})),[p,m]=[0,0];for(let{node:t,matrix:n}of f){for(let e of t.listChildren())f.push({node:e,matrix:l(n,e.getMatrix())});for(let r of t.getMesh()?.listPrimitives()??[]){if(![Xi,Zi,Qi].includes(r.getMode())||!r.getAttribute(`POSITION`))continue;let t=ca(r);if(p+=t.vertices,m+=t.corners,p>Gi)throw ia(e,p,`vertices`);if(m>Ki)throw ia(e,Math.floor(m/3),`triangles`);s.push({primitive:r,matrix:n})}}let h=[];for(let{primitive:t,matrix:n}of s){let r=t.getMaterial();i.has(r)||i.set(r,await oa(e,r,o));let s=i.get(r);a.has(t)||a.set(t,la(t,s.uv));let l=a.get(t),f=d(n);h.push({points:l.points.map(e=>u(n,e)),normals:l.normals.map(e=>c([0,1,2].map(t=>f[0][t]*e[0]+f[1][t]*e[1]+f[2][t]*e[2]))),mesh:l,look:s})}return h}async function oa(e,t,n){let r=t?.getAlphaMode()??`OPAQUE`,i=(t?.getBaseColorFactor()??[1,1,1,1]).map(e=>Math.min(Math.max(e,0),1)),a=t?await sa(e,t,n):null,o=r===`MASK`?t?.getAlphaCutoff()??.5:0,s=Math.floor(i[3]*255+.5),c=a||r===`MASK`||s===255?`mixed`:`transparent`;(r===`OPAQUE`||!a&&s===255)&&(c=`opaque`);let l=+(t?.getBaseColorTextureInfo()?.getTexCoord()===1),u=[1,1,1,1],d=`TEXCOORD_${l}`;return{layer:c,image:a,scale:a?i:u,threshold:o,base:a?u:i,uv:d}}async function sa(e,t,n){let r=t.getBaseColorTexture(),i=r?.getImage();if(!r||!i)return null;let a=n.get(r);if(!a){let t=new Blob([i],{type:r.getMimeType()});try{let i=[r.getSize()??[0,0],...[...n.values()].map(({width:e,height:t})=>[e,t])].reduce((e,[t,n])=>e+t*n,0);if(i>Ji)throw ia(e,i,`pixels of images`);a=await createImageBitmap(t,{colorSpaceConversion:`none`,premultiplyAlpha:`none`})}catch(t){throw t instanceof C?t:new C(`An image in ${e} cannot be read.`,`Export it with PNG or JPEG images.`)}n.set(r,a)}let o=t.getBaseColorTextureInfo(),s=[o?.getWrapS(),o?.getWrapT()].map(e=>$i[e??10497]??`repeat`);return{pixels:a,wrap:s}}function ca(e){let t=e.getAttribute(`POSITION`).getCount(),n=e.getIndices()?.getCount()??t,r=e.getMode()===Xi?n:3*n,i=e.getAttribute(`NORMAL`);return{vertices:i?.getCount()!==t||i.getElementSize()<3?Math.max(t,r):t,corners:r}}function la(e,t){let n=e.getAttribute(`POSITION`).getCount(),r=(t,r)=>{let i=e.getAttribute(t);return i?.getCount()!==n||i.getElementSize()<r?[]:Array.from({length:n},(e,t)=>i.getElement(t,[]).slice(0,r))},i=r(`POSITION`,3),a=e.getIndices(),o=a?Array.from(a.getArray()??[]):i.map((e,t)=>t),s={points:i,normals:r(`NORMAL`,3),uvs:r(t,2),corners:ua(o,e.getMode(),i.length)};return s.normals.length===i.length?s:da(s)}function ua(e,t,n){let r=[],i=t===Xi?3:1;for(let a=2;a<e.length;a+=i){let i=[t===Qi?e[0]:e[a-2],e[a-1],e[a]];i.every(e=>e<n)&&r.push(...i)}return r}function da(e){let t=e.corners.map(t=>e.points[t]);return{points:t,normals:t.map((e,n)=>{let[i,a,o]=[0,1,2].map(e=>t[n-n%3+e]);return c(s(r(a,i),r(o,i)))}),uvs:e.uvs.length?e.corners.map(t=>e.uvs[t]):[],corners:t.map((e,t)=>t)}}function fa(e,t){let n=[1/0,1/0,1/0],a=[-1/0,-1/0,-1/0];for(let{points:e}of t)for(let t of e)for(let e=0;e<3;++e)n[e]=Math.min(n[e],t[e]),a[e]=Math.max(a[e],t[e]);let o=i([n[0]+a[0],n[1]+a[1],n[2]+a[2]],.5);if(![...o,...r(a,o)].every(e=>Number.isFinite(Math.fround(e))))throw new C(`${e} has points that are not finite.`,`Look for NaN or huge numbers in it.`);let s=t.reduce((e,t)=>e+t.points.length,0),c=t.reduce((e,t)=>e+t.mesh.corners.length,0),l={name:e,positions:new Float32Array(3*s),normals:new Float32Array(3*s),uvs:new Float32Array(2*s),colours:new Uint8Array(4*s),indices:new Uint32Array(c),up:[0,1,0]},u=pa(l,t,o);return ur(l.positions,l.normals,l.indices),{...l,batches:u,bounds:[r(n,o),r(a,o)]}}function pa(e,t,n){let i=new Map;for(let e of t){let t=e.look.image?e.look:`${e.look.layer} ${e.look.threshold}`,n=i.get(t);n?n.push(e):i.set(t,[e])}let a=[],o=0,s=0;for(let t of[...i.values()].sort((e,t)=>ma(e[0].look)-ma(t[0].look))){let i=s;for(let{points:i,normals:a,mesh:c,look:l}of t){let t=[...l.base.slice(0,3).map(lr),Math.floor(l.base[3]*255+.5)];for(let t of c.corners)e.indices[s++]=o+t;i.forEach((i,s)=>{e.positions.set(r(i,n),3*o),e.normals.set(a[s],3*o),e.uvs.set(c.uvs[s]??[0,0],2*o),e.colours.set(t,4*o),++o})}let{layer:c,image:l,scale:u,threshold:d}=t[0].look;a.push({first:i,count:s-i,layer:c,image:l,scale:u,threshold:d})}return a.filter(e=>e.count>0)}var ma=e=>ea.indexOf(e.layer),ha=6,ga=.88;function _a(e,t,n){e.addEventListener(`pointerdown`,t=>e.setPointerCapture(t.pointerId)),e.addEventListener(`pointermove`,n=>{if(!e.hasPointerCapture(n.pointerId)||!t.view)return;let r=e.clientHeight,[i,a]=[n.movementX/r,n.movementY/r];t.view=n.shiftKey||n.buttons===2?y(t.view,-i,a):v(t.view,-180*i,180*a,1),t.draw()}),e.addEventListener(`contextmenu`,e=>e.preventDefault()),e.addEventListener(`wheel`,e=>{e.preventDefault(),t.view&&(t.view=v(t.view,0,0,Math.exp(Math.min(Math.max(e.deltaY,-200),200)/600)),t.draw())},{passive:!1}),e.addEventListener(`keydown`,e=>{e.ctrlKey||e.metaKey||e.altKey||!r(e.key,e.shiftKey)||e.preventDefault()});function r(e,r){let{view:i}=t;if(!i)return!1;let a={ArrowLeft:[-1,0],ArrowRight:[1,0],ArrowUp:[0,1],ArrowDown:[0,-1]}[e];if(a)t.view=r?y(i,.05*a[0],.05*a[1]):v(i,ha*a[0],ha*a[1],1);else if(e===`+`||e===`=`)t.view=v(i,0,0,ga);else if(e===`-`)t.view=v(i,0,0,1/ga);else if(e===`[`||e===`]`)return n(e===`[`?-.05:.05),!0;else if(e===`0`)return t.home(),!0;else return!1;return t.draw(),!0}}function Y(e){return document.getElementById(e)}var X=new Map;function Z(e,t){if(t===null){if(!X.delete(e))return}else t instanceof C?X.set(e,t.message):(X.set(e,`Something went wrong. Load the page again; the browser's console has the details.`),console.error(t));let n=Y(`trouble`);n.textContent=[...new Set(X.values())].join(`
`),n.hidden=X.size===0}var va=new Map;function ya(e,t){t===null?va.delete(e):va.set(e,t);let n=[...va.values()].join(` `);Y(`status`).textContent!==n&&(Y(`status`).textContent=n)}var ba={};async function xa(e,t,n){let r=(ba[e]??0)+1;ba[e]=r;let i=()=>ba[e]===r;ya(e,t);try{await n(i),i()&&Z(e,null)}catch(t){i()&&Z(e,t)}i()&&ya(e,null)}function Sa(e,t){e.replaceChildren(...t.map(([e,t])=>new Option(t,e)))}function Ca(){Y(`figures`).replaceChildren(),Y(`facts`).textContent=``}function wa(e){let{counted:t,left:n,right:r,width:i,height:a,bytes:o}=e;Y(`figures`).replaceChildren(Ta(`left`,n),Ta(`right`,r));let s=t.occupied?(t.fragments/t.occupied).toFixed(1):`0`;Y(`facts`).textContent=`${i} × ${a} pixels, ${Ea(t.fragments)} transparent fragments in ${Ea(t.occupied)} pixels, ${s} each; ${(o/2**20).toFixed(1)} MiB of buffers.`}function Ta(e,t){let n=document.createElement(`tr`),r=document.createElement(`th`);r.scope=`row`,r.textContent=`${e}: ${t.technique}`,n.append(r);let{error:i,slots:a,milliseconds:o}=t,s=e=>i===null?`…`:Number.isNaN(i)?`–`:e(i),c=[s(e=>(1e5*e).toFixed(3)),s(e=>e===0?`exact`:Gt(e).toFixed(2)),a?Ea(a):`–`,o.toFixed(1)];for(let e of c)n.insertCell().textContent=e;return n}var Ea=e=>e.toLocaleString(`en`),Da=1600,Oa=250,ka=class{gpu;canvas;told;waits;failed;wanted={left:`binned`,right:`weighted-blended`,mode:`picture`,factor:1,split:.5};bundle=null;view=null;#e;#t=null;#n=null;#r=null;#i=!1;#a=0;#o=!1;#s;#c=null;constructor(e,t,n,r,i){this.gpu=e,this.canvas=t,this.told=n,this.waits=r,this.failed=i,this.#e=new Kt(e,t),e.device.lost.then(()=>{this.#o=!0,i(new C(`The graphics device was lost.`,`Load the page again; if it stays so, update the browser and the graphics driver.`))})}async open(e){let t=new zt(this.gpu,e);for(++this.#a;this.#r;)await this.#r;this.#t?.destroy(),this.#t=t,this.#_(!0),this.home()}home(){if(!this.#t)return;let{bounds:e,up:t}=this.#t.scene;this.view=_(e,t,this.canvas.width/this.canvas.height),this.draw()}draw(){clearTimeout(this.#s),this.#o||(this.#r?(++this.#a,this.#i=!0):this.#h(()=>this.#l()))}present(){this.#c&&this.#n&&!this.#o&&this.#g(this.#n)}async picture(e,t,n){for(;this.#r;)await this.#r;return clearTimeout(this.#s),new Promise((r,i)=>{this.#h(async()=>{try{let i=this.#_(!1),a=new oe(this.gpu),{fragments:o}=await i.look(a,e);r({words:await this.gpu.read(await i.render(a,t,n,this.bundle,`picture`)),offsets:await this.gpu.read(i.offsets),fragments:o})}catch(e){i(e)}})})}async#l(){let e=this.#_(!1);if(!e||!this.view)return;let t=this.#m(),n=await e.look(t,this.view);this.waits(e.isSlow);let r=await this.#u(e,t,`left`),i=await this.#u(e,t,`right`),a=e.frame.words(`exact`,e.frame.pixels);this.#c={left:r.buffer,right:i.buffer,exact:a},this.wanted.mode===`error`&&await e.render(t,`sbuffer`,1,null,`exact`),this.#g(e),this.#p(e,n,r.figures,i.figures),this.#s=setTimeout(()=>this.#d(e,n,r.figures,i.figures),Oa)}async#u(e,t,n){let r=this.wanted[n],i=performance.now(),a=await e.render(t,r,this.wanted.factor,this.bundle,n);return await this.gpu.device.queue.onSubmittedWorkDone(),{buffer:a,figures:{technique:r,milliseconds:performance.now()-i,slots:e.slots,error:null}}}#d(e,t,n,r){if(this.#r||!this.#c||e!==this.#n)return;let i=this.#c;this.#h(async()=>{let a=await this.#f(e,[i.left,i.right]);this.#p(e,t,{...n,error:a[0]},{...r,error:a[1]})})}async#f(e,t){let n=[];try{let r=await e.render(this.#m(),`sbuffer`,1,null,`exact`);for(let i of t)n.push(await Wt(e.frame,i,r));return n}catch(e){if(e instanceof C)return t.map(()=>NaN);throw e}}#p(e,t,n,r){let{width:i,height:a,bytes:o}=e.frame;this.told({counted:t,left:n,right:r,width:i,height:a,bytes:o})}#m(){let e=this.#a;return new oe(this.gpu,()=>e===this.#a)}#h(e){this.#r=e().catch(e=>{this.#o||e instanceof DOMException&&e.name===`AbortError`||e instanceof ae||(this.#c=null,this.#e.clear(),this.failed(e))}).finally(()=>{this.#r=null,this.waits(!1),this.#i&&(this.#i=!1,this.draw())})}#g(e){let{left:t,right:n,exact:r}=this.#c,{mode:i,split:a}=this.wanted;this.#e.show(e.frame,i,a*e.frame.width,t,n,r)}#_(e){if(!this.#t)return null;let t=this.canvas.getBoundingClientRect(),n=Math.min(Math.max(Math.round(t.width),1),Da),r=Math.min(Math.max(Math.round(t.height),1),Da),i=this.#n;return!e&&i&&i.frame.width===n&&i.frame.height===r?i:(i?.destroy(),[this.#n,this.#c]=[null,null],[this.canvas.width,this.canvas.height]=[n,r],this.#n=new vr(this.gpu,this.#t,n,r),this.#n)}},Aa={"glass shells":e,"a shelf of bottles":t},ja={binned:`binned: depth bins alone`,"kbuffer-deep":`kbuffer-deep: predicted k`,kbuffer:`kbuffer: fixed k`,"weighted-blended":`weighted-blended`,sbuffer:`sbuffer: exact`},Ma={picture:``,count:`0, 1, 3, 7, … to 63 fragments and more, by doubling`,error:`largest difference of red, green and blue: 0 to 32 of 255 and more`},Na=new Kn(Pa()),Q=e=>Y(e);function Pa(){try{return localStorage}catch{let e=new Map;return{getItem:t=>e.get(t)??null,setItem:(t,n)=>void e.set(t,n)}}}async function Fa(){let e=new ka(await te.open(),Y(`canvas`),e=>{Z(`picture`,null),wa(e)},e=>ya(`picture`,e?`The picture is being drawn.`:null),e=>{Z(`picture`,e),Ca()});e.gpu.device.addEventListener(`uncapturederror`,({error:e})=>{Z(`device`,e instanceof GPUOutOfMemoryError?new C(`The graphics device has no memory left.`,`Make the window or the budget smaller, or open a smaller scene; then load the page again.`):e)}),Sa(Q(`scene`),Object.keys(Aa).map(e=>[e,e]));for(let t of[`left`,`right`])$(e,t,e.wanted[t]);Ia(e),_a(Y(`stage`),e,t=>Ha(e,e.wanted.split+t)),Object.assign(globalThis,{diaphane:{picture:(t,n,r)=>e.picture(t,n,r)}}),await Promise.all([La(e),Ga(e)])}function Ia(e){let t=(e,t)=>Y(e).addEventListener(e===`budget`||e===`split`?`input`:`change`,()=>void t());t(`scene`,()=>Q(`scene`).value?La(e):Ba(e,za));let n=Y(`file`);t(`file`,()=>Ba(e,n.files?.[0])),n.addEventListener(`click`,()=>n.value=``),t(`model`,()=>Ka(e)),t(`mode`,()=>Va(e)),t(`split`,()=>Ha(e,Y(`split`).valueAsNumber/100)),t(`budget`,()=>Ua(e));for(let n of[`left`,`right`])t(n,()=>$(e,n,Q(n).value));Y(`controls`).addEventListener(`submit`,e=>e.preventDefault()),Y(`forget`).addEventListener(`click`,()=>{let[t]=Wa();t&&Na.forget(t),Ka(e)});let r=(e,t)=>{e.preventDefault(),Y(`stage`).classList.toggle(`over`,t)};addEventListener(`dragover`,e=>r(e,e.dataTransfer?.types.includes(`Files`)??!1)),addEventListener(`dragleave`,e=>r(e,!1)),addEventListener(`drop`,t=>{r(t,!1),Ba(e,t.dataTransfer?.files[0])}),new ResizeObserver(()=>e.draw()).observe(e.canvas),Ua(e)}var La=e=>xa(`scene`,`The scene is loading.`,async t=>{let n=Q(`scene`).value,r=await na(n,await Ra(Aa[n]));t()&&await e.open(r)});async function Ra(e){try{let t=await fetch(e);if(t.ok)return await t.blob()}catch{}throw new C(`The sample cannot be loaded.`,`Check the connection, then load the page again.`)}var za;async function Ba(e,t){t&&await xa(`scene`,`The file is read.`,async n=>{let r=await na(t.name,t);n()&&(await e.open(r),za=t,Array.from(Q(`scene`).options).some(e=>e.value===``)||Q(`scene`).prepend(new Option(``,``)),Q(`scene`).options[0].text=t.name,Q(`scene`).value=``)})}function $(e,t,n){let r=gr.filter(t=>t!==`kbuffer-deep`||e.bundle!==null);Sa(Q(t),r.map(e=>[e,ja[e]])),e.wanted[t]=r.includes(n)?n:`binned`,Q(t).value=e.wanted[t],Y(`${t}-name`).textContent=e.wanted[t],e.draw()}function Va(e){let t=Q(`mode`).value;e.wanted.mode=t,Y(`legend`).hidden=t===`picture`,Y(`ramp`).className=t,Y(`legend-text`).textContent=Ma[t],t===`error`?e.draw():e.present()}function Ha(e,t){e.wanted.split=Math.min(Math.max(t,0),1),Y(`split`).valueAsNumber=Math.round(100*e.wanted.split),e.present()}function Ua(e){e.wanted.factor=2**Y(`budget`).valueAsNumber,Y(`budget-value`).textContent=`${e.wanted.factor.toPrecision(3)} fragments per pixel`,e.draw()}var Wa=()=>Q(`model`).value.split(`@`);async function Ga(e){let t=Y(`model-note`);try{let n=await Na.choices();if(n.length===0){t.textContent=`There is no model yet: build one, then load this page again. The other techniques need none.`;return}let r=n.map(({name:e,selector:t,version:n})=>{let r=t===n?`${e} ${n}`:`${e}@${t} (${n})`;return[`${e}@${t}`,r]});Sa(Q(`model`),[[``,`none`],...r]),Q(`model`).disabled=!1,Q(`model`).value=r[0][0],await Ka(e)}catch(e){if(t.textContent=e instanceof Error?e.message:``,!(e instanceof Gn))return;let n=document.createElement(`a`);n.href=`/sign-in?next=%2Fdemo`,n.textContent=`Sign in`,t.replaceChildren(n,` to render with a published model. The other techniques need none.`)}}async function Ka(e){let[t,n]=Wa(),r=Y(`model-note`);r.textContent=``;let i=t=>{let n=t!==null&&e.bundle===null;e.bundle=t,$(e,`left`,e.wanted.left),$(e,`right`,n?`kbuffer-deep`:e.wanted.right)};await xa(`model`,t?`The model is fetched.`:``,async a=>{try{let o=t&&n?await Na.pull(t,n):null;if(o&&await Ot(e.gpu,o),!a()||(i(o),!o))return;let s=o.isSigned?`signature and hashes are right`:`hashes are right; this browser cannot check the signature (it has no Ed25519), and trusts the server`;r.textContent=`${t} ${o.version}: ${s}; its self-test passes on this device.`}catch(e){throw a()&&i(null),e}})}Fa().catch(e=>{Z(`device`,e),Y(`status`).textContent=`There is nothing to see without WebGPU.`;for(let e of document.querySelectorAll(`#controls input, #controls select`))e.disabled=!0});