var e=`/demo/assets/shells-B5WAiC_M.glb`,t=`/demo/assets/shelf-eCNv2WYE.glb`,n=class extends Error{what;remedy;constructor(e,t){super(`${e} ${t}`),this.what=e,this.remedy=t,this.name=`Trouble`}},r=[`maxStorageBufferBindingSize`,`maxBufferSize`,`maxTextureDimension2D`,`maxColorAttachmentBytesPerSample`],i=class e{device;description;blendsFloat32;blendsManyFloat32;#e=new Map;constructor(e,t){this.device=e,this.description=t,this.blendsFloat32=e.features.has(`float32-blendable`),this.blendsManyFloat32=this.blendsFloat32&&e.limits.maxColorAttachmentBytesPerSample>=64}static async open(){if(!globalThis.isSecureContext)throw new n(`Browsers offer WebGPU on secure pages only.`,`Open this page by https, or as localhost.`);if(!navigator.gpu)throw new n(`This browser has no WebGPU.`,`Use a current Chrome, Edge, Safari or Firefox; on Linux WebGPU may have to be switched on in its settings.`);let t=await navigator.gpu.requestAdapter({powerPreference:`high-performance`});if(!t)throw new n(`The browser has WebGPU, but no graphics adapter for it.`,`Switch on hardware acceleration in the browser's settings, or update the graphics driver.`);let i={};for(let e of r)i[e]=t.limits[e];let a=[`float32-blendable`].filter(e=>t.features.has(e)),o=await t.requestDevice({requiredFeatures:a,requiredLimits:i}).catch(()=>{throw new n(`The browser has WebGPU, but cannot open the graphics device.`,`Load the page again.`)}),{vendor:s,architecture:c,description:l}=t.info;return new e(o,l||[s,c].filter(Boolean).join(` `)||`unknown adapter`)}get sumFormat(){return this.blendsFloat32?`rgba32float`:`rgba16float`}get scalarFormat(){return this.blendsFloat32?`r32float`:`r16float`}words(e){let t=4*Math.max(e,1),{maxStorageBufferBindingSize:n,maxBufferSize:r}=this.device.limits;a(t,Math.min(n,r),`Make the window smaller, or the budget.`);let{STORAGE:i,COPY_SRC:o,COPY_DST:s}=GPUBufferUsage;return this.device.createBuffer({size:t,usage:i|o|s})}filled(e,t){let n=Math.ceil(Math.max(e.byteLength,4)/4)*4;a(n,this.device.limits.maxBufferSize,`Open a smaller scene.`);let r=this.device.createBuffer({size:n,usage:t|GPUBufferUsage.COPY_DST,mappedAtCreation:!0}),i=new Uint8Array(e.buffer,e.byteOffset,e.byteLength);return new Uint8Array(r.getMappedRange()).set(i),r.unmap(),r}compute(e,t){let n=`${t}\n${e}`,r=this.#e.get(n);if(!r){let i=this.device.createShaderModule({code:e,label:t});r=this.device.createComputePipeline({label:t,layout:`auto`,compute:{module:i,entryPoint:t}}),this.#e.set(n,r)}return r}bind(e,t){return this.device.createBindGroup({layout:e.getBindGroupLayout(0),entries:o(t)})}async read(e){let{MAP_READ:t,COPY_DST:n}=GPUBufferUsage,r=this.device.createBuffer({size:e.size,usage:t|n}),i=this.device.createCommandEncoder();i.copyBufferToBuffer(e,0,r,0,e.size),this.device.queue.submit([i.finish()]),await r.mapAsync(GPUMapMode.READ);let a=new Uint32Array(r.getMappedRange().slice(0));return r.destroy(),a}};function a(e,t,r){if(e<=t)return;let[i,a]=[Math.ceil(e/2**20),Math.floor(t/2**20)];throw new n(`A buffer of ${i} MiB is above this device's limit, ${a} MiB.`,r)}function o(e){return e.map((e,t)=>({binding:t,resource:e instanceof GPUBuffer?{buffer:e}:e}))}function s(e){let t=Math.max(1,Math.ceil(e/64)),n=Math.min(t,1024);return[n,Math.ceil(t/n)]}var c=class{_listeners={};addEventListener(e,t){let n=this._listeners;return n[e]===void 0&&(n[e]=[]),n[e].indexOf(t)===-1&&n[e].push(t),this}removeEventListener(e,t){let n=this._listeners[e];if(n!==void 0){let e=n.indexOf(t);e!==-1&&n.splice(e,1)}return this}dispatchEvent(e){let t=this._listeners[e.type];if(t!==void 0){let n=t.slice(0);for(let t=0,r=n.length;t<r;t++)n[t].call(this,e)}return this}dispose(){for(let e in this._listeners)delete this._listeners[e]}},l=class{_disposed=!1;_name;_parent;_child;_attributes;constructor(e,t,n,r={}){if(this._name=e,this._parent=t,this._child=n,this._attributes=r,!t.isOnGraph(n))throw Error(`Cannot connect disconnected graphs.`)}getName(){return this._name}getParent(){return this._parent}getChild(){return this._child}setChild(e){return this._child=e,this}getAttributes(){return this._attributes}dispose(){this._disposed||=(this._parent._destroyRef(this),!0)}isDisposed(){return this._disposed}},u=class extends c{_emptySet=new Set;_edges=new Set;_parentEdges=new Map;_childEdges=new Map;listEdges(){return Array.from(this._edges)}listParentEdges(e){return Array.from(this._childEdges.get(e)||this._emptySet)}listParents(e){let t=new Set;for(let n of this.listParentEdges(e))t.add(n.getParent());return Array.from(t)}listChildEdges(e){return Array.from(this._parentEdges.get(e)||this._emptySet)}listChildren(e){let t=new Set;for(let n of this.listChildEdges(e))t.add(n.getChild());return Array.from(t)}disconnectParents(e,t){for(let n of this.listParentEdges(e))(!t||t(n.getParent()))&&n.dispose();return this}_createEdge(e,t,n,r){let i=new l(e,t,n,r);this._edges.add(i);let a=i.getParent();this._parentEdges.has(a)||this._parentEdges.set(a,new Set),this._parentEdges.get(a).add(i);let o=i.getChild();return this._childEdges.has(o)||this._childEdges.set(o,new Set),this._childEdges.get(o).add(i),i}_destroyEdge(e){return this._edges.delete(e),this._parentEdges.get(e.getParent()).delete(e),this._childEdges.get(e.getChild()).delete(e),this}},d=class{list=[];constructor(e){if(e)for(let t of e)this.list.push(t)}add(e){this.list.push(e)}remove(e){let t=this.list.indexOf(e);t>=0&&this.list.splice(t,1)}removeChild(e){let t=[];for(let n of this.list)n.getChild()===e&&t.push(n);for(let e of t)this.remove(e);return t}listRefsByChild(e){let t=[];for(let n of this.list)n.getChild()===e&&t.push(n);return t}values(){return this.list}},f=class{set=new Set;map=new Map;constructor(e){if(e)for(let t of e)this.add(t)}add(e){let t=e.getChild();this.removeChild(t),this.set.add(e),this.map.set(t,e)}remove(e){this.set.delete(e),this.map.delete(e.getChild())}removeChild(e){let t=this.map.get(e)||null;return t&&this.remove(t),t}getRefByChild(e){return this.map.get(e)||null}values(){return Array.from(this.set)}},p=class{map={};constructor(e){e&&Object.assign(this.map,e)}set(e,t){this.map[e]=t}delete(e){delete this.map[e]}get(e){return this.map[e]||null}keys(){return Object.keys(this.map)}values(){return Object.values(this.map)}},m=Symbol(`attributes`),h=Symbol(`immutableKeys`),g=class e extends c{_disposed=!1;graph;[m];[h];constructor(e){super(),this.graph=e,this[h]=new Set,this[m]=this._createAttributes()}getDefaults(){return{}}_createAttributes(){let t=this.getDefaults(),n={};for(let r in t){let i=t[r];if(i instanceof e){let e=this.graph._createEdge(r,this,i);this[h].add(r),n[r]=e}else n[r]=i}return n}isOnGraph(e){return this.graph===e.graph}isDisposed(){return this._disposed}dispose(){this._disposed||(this.graph.listChildEdges(this).forEach(e=>e.dispose()),this.graph.disconnectParents(this),this._disposed=!0,this.dispatchEvent({type:`dispose`}))}detach(){return this.graph.disconnectParents(this),this}swap(e,t){for(let n in this[m]){let r=this[m][n];if(r instanceof l){let i=r;i.getChild()===e&&this.setRef(n,t,i.getAttributes())}else if(r instanceof d)for(let i of r.listRefsByChild(e)){let r=i.getAttributes();this.removeRef(n,e),this.addRef(n,t,r)}else if(r instanceof f){let i=r.getRefByChild(e);if(i){let r=i.getAttributes();this.removeRef(n,e),this.addRef(n,t,r)}}else if(r instanceof p)for(let i of r.keys()){let a=r.get(i);a.getChild()===e&&this.setRefMap(n,i,t,a.getAttributes())}}return this}get(e){return this[m][e]}set(e,t){return this[m][e]=t,this.dispatchEvent({type:`change`,attribute:e})}getRef(e){let t=this[m][e];return t?t.getChild():null}setRef(e,t,n){if(this[h].has(e))throw Error(`Cannot overwrite immutable attribute, "${e}".`);let r=this[m][e];if(r&&r.dispose(),!t)return this;let i=this.graph._createEdge(e,this,t,n);return this[m][e]=i,this.dispatchEvent({type:`change`,attribute:e})}listRefs(e){return this.assertRefList(e).values().map(e=>e.getChild())}addRef(e,t,n){let r=this.graph._createEdge(e,this,t,n);return this.assertRefList(e).add(r),this.dispatchEvent({type:`change`,attribute:e})}removeRef(e,t){let n=this.assertRefList(e);if(n instanceof d)for(let e of n.listRefsByChild(t))e.dispose();else{let e=n.getRefByChild(t);e&&e.dispose()}return this}assertRefList(e){let t=this[m][e];if(t instanceof d||t instanceof f)return t;throw Error(`Expected RefList or RefSet for attribute "${e}"`)}listRefMapKeys(e){return this.assertRefMap(e).keys()}listRefMapValues(e){return this.assertRefMap(e).values().map(e=>e.getChild())}getRefMap(e,t){let n=this.assertRefMap(e).get(t);return n?n.getChild():null}setRefMap(e,t,n,r){let i=this.assertRefMap(e),a=i.get(t);if(a&&a.dispose(),!n)return this;r=Object.assign(r||{},{key:t});let o=this.graph._createEdge(e,this,n,{...r,key:t});return i.set(t,o),this.dispatchEvent({type:`change`,attribute:e,key:t})}assertRefMap(e){let t=this[m][e];if(t instanceof p)return t;throw Error(`Expected RefMap for attribute "${e}"`)}dispatchEvent(e){return super.dispatchEvent({...e,target:this}),this.graph.dispatchEvent({...e,target:this,type:`node:${e.type}`}),this}_destroyRef(e){let t=e.getName();if(this[m][t]===e)this[m][t]=null,this[h].has(t)&&e.getChild().dispose();else if(this[m][t]instanceof d)this[m][t].remove(e);else if(this[m][t]instanceof f)this[m][t].remove(e);else if(this[m][t]instanceof p){let n=this[m][t];for(let t of n.keys())n.get(t)===e&&n.delete(t)}else return;this.graph._destroyEdge(e),this.dispatchEvent({type:`change`,attribute:t})}},_=`v4.5.1`,v=`@glb.bin`,y=function(e){return e.ARRAY_BUFFER=`ARRAY_BUFFER`,e.ELEMENT_ARRAY_BUFFER=`ELEMENT_ARRAY_BUFFER`,e.INVERSE_BIND_MATRICES=`INVERSE_BIND_MATRICES`,e.OTHER=`OTHER`,e.SPARSE=`SPARSE`,e}({}),b=function(e){return e[e.R=4096]=`R`,e[e.G=256]=`G`,e[e.B=16]=`B`,e[e.A=1]=`A`,e}({}),x=class extends Float32Array{constructor(){throw super(),Error(`Unsupported typed array instantiation.`)}},S={5120:Int8Array,5121:Uint8Array,5122:Int16Array,5123:Uint16Array,5125:Uint32Array,5131:typeof Float16Array<`u`?Float16Array:x,5126:Float32Array,5130:Float64Array},C=class{static createBufferFromDataURI(e){if(typeof Buffer>`u`){let t=atob(e.split(`,`)[1]),n=new Uint8Array(t.length);for(let e=0;e<t.length;e++)n[e]=t.charCodeAt(e);return n}{let t=e.split(`,`)[1],n=e.indexOf(`base64`)>=0;return Buffer.from(t,n?`base64`:`utf8`)}}static encodeText(e){return new TextEncoder().encode(e)}static decodeText(e){return new TextDecoder().decode(e)}static concat(e){let t=0;for(let n of e)t+=n.byteLength;let n=new Uint8Array(t),r=0;for(let t of e)n.set(t,r),r+=t.byteLength;return n}static pad(e,t=0){let n=this.padNumber(e.byteLength);if(n===e.byteLength)return e;let r=new Uint8Array(n);if(r.set(e),t!==0)for(let i=e.byteLength;i<n;i++)r[i]=t;return r}static padNumber(e){return Math.ceil(e/4)*4}static equals(e,t){if(e===t)return!0;if(e.byteLength!==t.byteLength)return!1;let n=e.byteLength;for(;n--;)if(e[n]!==t[n])return!1;return!0}static toView(e,t=0,n=1/0){return new Uint8Array(e.buffer,e.byteOffset+t,Math.min(e.byteLength,n))}static assertView(e){if(e&&!ArrayBuffer.isView(e))throw Error(`Method requires Uint8Array parameter; received "${typeof e}".`);return e}},ee=class{match(e){return e.length>=3&&e[0]===255&&e[1]===216&&e[2]===255}getSize(e){let t=new DataView(e.buffer,e.byteOffset+4),n,r;for(;t.byteLength;){if(n=t.getUint16(0,!1),ne(t,n),r=t.getUint8(n+1),r===192||r===193||r===194)return[t.getUint16(n+7,!1),t.getUint16(n+5,!1)];t=new DataView(e.buffer,t.byteOffset+n+2)}throw TypeError(`Invalid JPG, no size found`)}getChannels(e){return 3}},te=class e{static PNG_FRIED_CHUNK_NAME=`CgBI`;match(e){return e.length>=8&&e[0]===137&&e[1]===80&&e[2]===78&&e[3]===71&&e[4]===13&&e[5]===10&&e[6]===26&&e[7]===10}getSize(t){let n=new DataView(t.buffer,t.byteOffset);return C.decodeText(t.slice(12,16))===e.PNG_FRIED_CHUNK_NAME?[n.getUint32(32,!1),n.getUint32(36,!1)]:[n.getUint32(16,!1),n.getUint32(20,!1)]}getChannels(e){return 4}},w=class{static impls={"image/jpeg":new ee,"image/png":new te};static registerFormat(e,t){this.impls[e]=t}static getMimeType(e){for(let t in this.impls)if(this.impls[t].match(e))return t;return null}static getSize(e,t){return this.impls[t]?this.impls[t].getSize(e):null}static getChannels(e,t){return this.impls[t]?this.impls[t].getChannels(e):null}static getVRAMByteLength(e,t){if(!this.impls[t])return null;if(this.impls[t].getVRAMByteLength)return this.impls[t].getVRAMByteLength(e);let n=0,r=this.getSize(e,t);if(!r)return null;for(;r[0]>1||r[1]>1;)n+=r[0]*r[1]*4,r[0]=Math.max(Math.floor(r[0]/2),1),r[1]=Math.max(Math.floor(r[1]/2),1);return n+=4,n}static mimeTypeToExtension(e){return e===`image/jpeg`?`jpg`:e.split(`/`).pop()}static extensionToMimeType(e){return e===`jpg`?`image/jpeg`:e?`image/${e}`:``}};function ne(e,t){if(t>e.byteLength)throw TypeError(`Corrupt JPG, exceeded buffer limits`);if(e.getUint8(t)!==255)throw TypeError(`Invalid JPG, marker table corrupted`);return e}var T=class{static basename(e){let t=e.split(/[\\/]/).pop();return t.substring(0,t.lastIndexOf(`.`))}static extension(e){if(e.startsWith(`data:image/`)){let t=e.match(/data:(image\/\w+)/)[1];return w.mimeTypeToExtension(t)}return e.startsWith(`data:model/gltf+json`)?`gltf`:e.startsWith(`data:model/gltf-binary`)?`glb`:e.startsWith(`data:application/`)?`bin`:e.split(/[\\/]/).pop().split(/[.]/).pop()}},re=typeof Float32Array<`u`?Float32Array:Array;function ie(){var e=new re(3);return re!=Float32Array&&(e[0]=0,e[1]=0,e[2]=0),e}function ae(e){var t=e[0],n=e[1],r=e[2];return Math.sqrt(t*t+n*n+r*r)}(function(){var e=ie();return function(t,n,r,i,a,o){var s,c;for(n||=3,r||=0,c=i?Math.min(i*n+r,t.length):t.length,s=r;s<c;s+=n)e[0]=t[s],e[1]=t[s+1],e[2]=t[s+2],a(e,e,o),t[s]=e[0],t[s+1]=e[1],t[s+2]=e[2];return t}})();var oe=`https://null.example`,se=class{static DEFAULT_INIT={};static PROTOCOL_REGEXP=/^[a-zA-Z]+:\/\//;static dirname(e){let t=e.lastIndexOf(`/`);return t===-1?`./`:e.substring(0,t+1)}static basename(e){return T.basename(new URL(e,oe).pathname)}static extension(e){return T.extension(new URL(e,oe).pathname)}static resolve(e,t){if(!this.isRelativePath(t))return t;let n=e.split(`/`),r=t.split(`/`);n.pop();for(let e=0;e<r.length;e++)r[e]!==`.`&&(r[e]===`..`?n.pop():n.push(r[e]));return n.join(`/`)}static isAbsoluteURL(e){return this.PROTOCOL_REGEXP.test(e)}static isRelativePath(e){return!/^(?:[a-zA-Z]+:)?\//.test(e)}};function ce(e){return Object.prototype.toString.call(e)===`[object Object]`}function E(e){if(ce(e)===!1)return!1;let t=e.constructor;if(t===void 0)return!0;let n=t.prototype;return ce(n)!==!1&&Object.hasOwn(n,`isPrototypeOf`)!==!1}var le=function(e){return e[e.SILENT=4]=`SILENT`,e[e.ERROR=3]=`ERROR`,e[e.WARN=2]=`WARN`,e[e.INFO=1]=`INFO`,e[e.DEBUG=0]=`DEBUG`,e}({}),D=class e{verbosity;static Verbosity=le;static DEFAULT_INSTANCE=new e(1);constructor(e){this.verbosity=e}debug(e){this.verbosity<=0&&console.debug(e)}info(e){this.verbosity<=1&&console.info(e)}warn(e){this.verbosity<=2&&console.warn(e)}error(e){this.verbosity<=3&&console.error(e)}};function ue(e){var t=e[0],n=e[1],r=e[2],i=e[3],a=e[4],o=e[5],s=e[6],c=e[7],l=e[8],u=e[9],d=e[10],f=e[11],p=e[12],m=e[13],h=e[14],g=e[15],_=t*o-n*a,v=t*s-r*a,y=n*s-r*o,b=l*m-u*p,x=l*h-d*p,S=u*h-d*m,C=t*S-n*x+r*b,ee=a*S-o*x+s*b,te=l*y-u*v+d*_,w=p*y-m*v+h*_;return c*C-i*ee+g*te-f*w}function de(e,t,n){var r=t[0],i=t[1],a=t[2],o=t[3],s=t[4],c=t[5],l=t[6],u=t[7],d=t[8],f=t[9],p=t[10],m=t[11],h=t[12],g=t[13],_=t[14],v=t[15],y=n[0],b=n[1],x=n[2],S=n[3];return e[0]=y*r+b*s+x*d+S*h,e[1]=y*i+b*c+x*f+S*g,e[2]=y*a+b*l+x*p+S*_,e[3]=y*o+b*u+x*m+S*v,y=n[4],b=n[5],x=n[6],S=n[7],e[4]=y*r+b*s+x*d+S*h,e[5]=y*i+b*c+x*f+S*g,e[6]=y*a+b*l+x*p+S*_,e[7]=y*o+b*u+x*m+S*v,y=n[8],b=n[9],x=n[10],S=n[11],e[8]=y*r+b*s+x*d+S*h,e[9]=y*i+b*c+x*f+S*g,e[10]=y*a+b*l+x*p+S*_,e[11]=y*o+b*u+x*m+S*v,y=n[12],b=n[13],x=n[14],S=n[15],e[12]=y*r+b*s+x*d+S*h,e[13]=y*i+b*c+x*f+S*g,e[14]=y*a+b*l+x*p+S*_,e[15]=y*o+b*u+x*m+S*v,e}function fe(e,t){var n=t[0],r=t[1],i=t[2],a=t[4],o=t[5],s=t[6],c=t[8],l=t[9],u=t[10];return e[0]=Math.sqrt(n*n+r*r+i*i),e[1]=Math.sqrt(a*a+o*o+s*s),e[2]=Math.sqrt(c*c+l*l+u*u),e}function pe(e,t){var n=new re(3);fe(n,t);var r=1/n[0],i=1/n[1],a=1/n[2],o=t[0]*r,s=t[1]*i,c=t[2]*a,l=t[4]*r,u=t[5]*i,d=t[6]*a,f=t[8]*r,p=t[9]*i,m=t[10]*a,h=o+u+m,g=0;return h>0?(g=Math.sqrt(h+1)*2,e[3]=.25*g,e[0]=(d-p)/g,e[1]=(f-c)/g,e[2]=(s-l)/g):o>u&&o>m?(g=Math.sqrt(1+o-u-m)*2,e[3]=(d-p)/g,e[0]=.25*g,e[1]=(s+l)/g,e[2]=(f+c)/g):u>m?(g=Math.sqrt(1+u-o-m)*2,e[3]=(f-c)/g,e[0]=(s+l)/g,e[1]=.25*g,e[2]=(d+p)/g):(g=Math.sqrt(1+m-o-u)*2,e[3]=(s-l)/g,e[0]=(f+c)/g,e[1]=(d+p)/g,e[2]=.25*g),e}var O=class e{static identity(e){return e}static eq(e,t,n=1e-5){if(e.length!==t.length)return!1;for(let r=0;r<e.length;r++)if(Math.abs(e[r]-t[r])>n)return!1;return!0}static clamp(e,t,n){return e<t?t:e>n?n:e}static decodeNormalizedInt(e,t){switch(t){case 5126:return e;case 5123:return e/65535;case 5121:return e/255;case 5122:return Math.max(e/32767,-1);case 5120:return Math.max(e/127,-1);default:throw Error(`Invalid component type.`)}}static encodeNormalizedInt(t,n){switch(n){case 5126:return t;case 5123:return Math.round(e.clamp(t,0,1)*65535);case 5121:return Math.round(e.clamp(t,0,1)*255);case 5122:return Math.round(e.clamp(t,-1,1)*32767);case 5120:return Math.round(e.clamp(t,-1,1)*127);default:throw Error(`Invalid component type.`)}}static decompose(e,t,n,r){let i=ae([e[0],e[1],e[2]]),a=ae([e[4],e[5],e[6]]),o=ae([e[8],e[9],e[10]]);ue(e)<0&&(i=-i),t[0]=e[12],t[1]=e[13],t[2]=e[14];let s=e.slice(),c=1/i,l=1/a,u=1/o;s[0]*=c,s[1]*=c,s[2]*=c,s[4]*=l,s[5]*=l,s[6]*=l,s[8]*=u,s[9]*=u,s[10]*=u,pe(n,s),r[0]=i,r[1]=a,r[2]=o}static compose(e,t,n,r){let i=r,a=t[0],o=t[1],s=t[2],c=t[3],l=a+a,u=o+o,d=s+s,f=a*l,p=a*u,m=a*d,h=o*u,g=o*d,_=s*d,v=c*l,y=c*u,b=c*d,x=n[0],S=n[1],C=n[2];return i[0]=(1-(h+_))*x,i[1]=(p+b)*x,i[2]=(m-y)*x,i[3]=0,i[4]=(p-b)*S,i[5]=(1-(f+_))*S,i[6]=(g+v)*S,i[7]=0,i[8]=(m+y)*C,i[9]=(g-v)*C,i[10]=(1-(f+h))*C,i[11]=0,i[12]=e[0],i[13]=e[1],i[14]=e[2],i[15]=1,i}};function me(e,t){if(!!e!=!!t)return!1;let n=e.getChild(),r=t.getChild();return n===r||n.equals(r)}function he(e,t){if(!!e!=!!t)return!1;let n=e.values(),r=t.values();if(n.length!==r.length)return!1;for(let e=0;e<n.length;e++){let t=n[e],i=r[e];if(t.getChild()!==i.getChild()&&!t.getChild().equals(i.getChild()))return!1}return!0}function ge(e,t){if(!!e!=!!t)return!1;let n=e.keys(),r=t.keys();if(n.length!==r.length)return!1;for(let r of n){let n=e.get(r),i=t.get(r);if(!!n!=!!i)return!1;let a=n.getChild(),o=i.getChild();if(a!==o&&!a.equals(o))return!1}return!0}function _e(e,t){if(e===t)return!0;if(!!e!=!!t||!e||!t||e.length!==t.length)return!1;for(let n=0;n<e.length;n++)if(e[n]!==t[n])return!1;return!0}function ve(e,t){if(e===t)return!0;if(!!e!=!!t)return!1;if(!E(e)||!E(t))return e===t;let n=e,r=t,i=0,a=0,o;for(o in n)i++;for(o in r)a++;if(i!==a)return!1;for(o in n){let e=n[o],t=r[o];if(ye(e)&&ye(t)){if(!_e(e,t))return!1}else if(E(e)&&E(t)){if(!ve(e,t))return!1}else if(e!==t)return!1}return!0}function ye(e){return Array.isArray(e)||ArrayBuffer.isView(e)}var be=`23456789abdegjkmnpqrvwxyzABDEGJKMNPQRVWXYZ`,xe=999,Se=6,Ce=new Set,we=function(){let e=``;for(let t=0;t<Se;t++)e+=be.charAt(Math.floor(Math.random()*42));return e},Te=function(){for(let e=0;e<xe;e++){let e=we();if(!Ce.has(e))return Ce.add(e),e}return``},k=e=>e,Ee=new Set,De=class extends g{constructor(e,t=``){super(e),this[m].name=t,this.init(),this.dispatchEvent({type:`create`})}getGraph(){return this.graph}getDefaults(){return Object.assign(super.getDefaults(),{name:``,extras:{}})}set(e,t){return Array.isArray(t)&&(t=t.slice()),super.set(e,t)}getName(){return this.get(`name`)}setName(e){return this.set(`name`,e)}getExtras(){return this.get(`extras`)}setExtras(e){return this.set(`extras`,e)}clone(){let e=this.constructor;return new e(this.graph).copy(this,k)}copy(e,t=k){for(let e in this[m]){let t=this[m][e];if(t instanceof l)this[h].has(e)||t.dispose();else if(t instanceof d||t instanceof f)for(let e of t.values())e.dispose();else if(t instanceof p)for(let e of t.values())e.dispose()}for(let n in e[m]){let r=this[m][n],i=e[m][n];if(i instanceof l)this[h].has(n)?r.getChild().copy(t(i.getChild()),t):this.setRef(n,t(i.getChild()),i.getAttributes());else if(i instanceof f||i instanceof d)for(let e of i.values())this.addRef(n,t(e.getChild()),e.getAttributes());else if(i instanceof p)for(let e of i.keys()){let r=i.get(e);this.setRefMap(n,e,t(r.getChild()),r.getAttributes())}else E(i)?this[m][n]=JSON.parse(JSON.stringify(i)):Array.isArray(i)||i instanceof ArrayBuffer||ArrayBuffer.isView(i)?this[m][n]=i.slice():this[m][n]=i}return this}equals(e,t=Ee){if(this===e)return!0;if(this.propertyType!==e.propertyType)return!1;for(let n in this[m]){if(t.has(n))continue;let r=this[m][n],i=e[m][n];if(r instanceof l||i instanceof l){if(!me(r,i))return!1}else if(r instanceof f||i instanceof f||r instanceof d||i instanceof d){if(!he(r,i))return!1}else if(r instanceof p||i instanceof p){if(!ge(r,i))return!1}else if(E(r)||E(i)){if(!ve(r,i))return!1}else if(ye(r)||ye(i)){if(!_e(r,i))return!1}else if(r!==i)return!1}return!0}detach(){return this.graph.disconnectParents(this,e=>e.propertyType!==`Root`),this}listParents(){return this.graph.listParents(this)}},A=class extends De{getDefaults(){return Object.assign(super.getDefaults(),{extensions:new p})}getExtension(e){return this.getRefMap(`extensions`,e)}setExtension(e,t){return t&&t._validateParent(this),this.setRefMap(`extensions`,e,t)}listExtensions(){return this.listRefMapValues(`extensions`)}},j=class e extends A{static Type={SCALAR:`SCALAR`,VEC2:`VEC2`,VEC3:`VEC3`,VEC4:`VEC4`,MAT2:`MAT2`,MAT3:`MAT3`,MAT4:`MAT4`};static ComponentType={BYTE:5120,UNSIGNED_BYTE:5121,SHORT:5122,UNSIGNED_SHORT:5123,UNSIGNED_INT:5125,FLOAT:5126,FLOAT16:5131,FLOAT64:5130};init(){this.propertyType=`Accessor`}getDefaults(){return Object.assign(super.getDefaults(),{array:null,type:e.Type.SCALAR,componentType:e.ComponentType.FLOAT,normalized:!1,sparse:!1,buffer:null})}static getElementSize(t){switch(t){case e.Type.SCALAR:return 1;case e.Type.VEC2:return 2;case e.Type.VEC3:return 3;case e.Type.VEC4:return 4;case e.Type.MAT2:return 4;case e.Type.MAT3:return 9;case e.Type.MAT4:return 16;default:throw Error(`Unexpected type: `+t)}}static getComponentSize(t){switch(t){case e.ComponentType.BYTE:case e.ComponentType.UNSIGNED_BYTE:return 1;case e.ComponentType.SHORT:case e.ComponentType.UNSIGNED_SHORT:return 2;case e.ComponentType.UNSIGNED_INT:case e.ComponentType.FLOAT:return 4;case e.ComponentType.FLOAT16:return 2;case e.ComponentType.FLOAT64:return 8;default:throw Error(`Unexpected component type: `+t)}}getMinNormalized(e){let t=this.getNormalized(),n=this.getElementSize(),r=this.getComponentType();if(this.getMin(e),t)for(let t=0;t<n;t++)e[t]=O.decodeNormalizedInt(e[t],r);return e}getMin(e){let t=this.getArray(),n=this.getCount(),r=this.getElementSize();for(let t=0;t<r;t++)e[t]=1/0;for(let i=0;i<n*r;i+=r)for(let n=0;n<r;n++){let r=t[i+n];Number.isFinite(r)&&(e[n]=Math.min(e[n],r))}return e}getMaxNormalized(e){let t=this.getNormalized(),n=this.getElementSize(),r=this.getComponentType();if(this.getMax(e),t)for(let t=0;t<n;t++)e[t]=O.decodeNormalizedInt(e[t],r);return e}getMax(e){let t=this.get(`array`),n=this.getCount(),r=this.getElementSize();for(let t=0;t<r;t++)e[t]=-1/0;for(let i=0;i<n*r;i+=r)for(let n=0;n<r;n++){let r=t[i+n];Number.isFinite(r)&&(e[n]=Math.max(e[n],r))}return e}getCount(){let e=this.get(`array`);return e?e.length/this.getElementSize():0}getType(){return this.get(`type`)}setType(e){return this.set(`type`,e)}getElementSize(){return e.getElementSize(this.get(`type`))}getComponentSize(){return this.get(`array`).BYTES_PER_ELEMENT}getComponentType(){return this.get(`componentType`)}getNormalized(){return this.get(`normalized`)}setNormalized(e){return this.set(`normalized`,e)}getScalar(e){let t=this.getElementSize(),n=this.getComponentType(),r=this.getArray();return this.getNormalized()?O.decodeNormalizedInt(r[e*t],n):r[e*t]}setScalar(e,t){let n=this.getElementSize(),r=this.getComponentType(),i=this.getArray();return this.getNormalized()?i[e*n]=O.encodeNormalizedInt(t,r):i[e*n]=t,this}getElement(e,t){let n=this.getNormalized(),r=this.getElementSize(),i=this.getComponentType(),a=this.getArray();for(let o=0;o<r;o++)n?t[o]=O.decodeNormalizedInt(a[e*r+o],i):t[o]=a[e*r+o];return t}setElement(e,t){let n=this.getNormalized(),r=this.getElementSize(),i=this.getComponentType(),a=this.getArray();for(let o=0;o<r;o++)n?a[e*r+o]=O.encodeNormalizedInt(t[o],i):a[e*r+o]=t[o];return this}getSparse(){return this.get(`sparse`)}setSparse(e){return this.set(`sparse`,e)}getBuffer(){return this.getRef(`buffer`)}setBuffer(e){return this.setRef(`buffer`,e)}getArray(){return this.get(`array`)}setArray(t){return this.set(`componentType`,t?Oe(t):e.ComponentType.FLOAT),this.set(`array`,t),this}getByteLength(){let e=this.get(`array`);return e?e.byteLength:0}};function Oe(e){switch(e.constructor){case Float32Array:return j.ComponentType.FLOAT;case Uint32Array:return j.ComponentType.UNSIGNED_INT;case Uint16Array:return j.ComponentType.UNSIGNED_SHORT;case Uint8Array:return j.ComponentType.UNSIGNED_BYTE;case Int16Array:return j.ComponentType.SHORT;case Int8Array:return j.ComponentType.BYTE;case Float64Array:return j.ComponentType.FLOAT64}if(typeof Float16Array<`u`&&e.constructor===Float16Array)return j.ComponentType.FLOAT16;throw Error(`Unknown accessor componentType.`)}var ke=class extends A{init(){this.propertyType=`Animation`}getDefaults(){return Object.assign(super.getDefaults(),{channels:new f,samplers:new f})}addChannel(e){return this.addRef(`channels`,e)}removeChannel(e){return this.removeRef(`channels`,e)}listChannels(){return this.listRefs(`channels`)}addSampler(e){return this.addRef(`samplers`,e)}removeSampler(e){return this.removeRef(`samplers`,e)}listSamplers(){return this.listRefs(`samplers`)}},Ae=class extends A{static TargetPath={TRANSLATION:`translation`,ROTATION:`rotation`,SCALE:`scale`,WEIGHTS:`weights`};init(){this.propertyType=`AnimationChannel`}getDefaults(){return Object.assign(super.getDefaults(),{targetPath:null,targetNode:null,sampler:null})}getTargetPath(){return this.get(`targetPath`)}setTargetPath(e){return this.set(`targetPath`,e)}getTargetNode(){return this.getRef(`targetNode`)}setTargetNode(e){return this.setRef(`targetNode`,e)}getSampler(){return this.getRef(`sampler`)}setSampler(e){return this.setRef(`sampler`,e)}},je=class e extends A{static Interpolation={LINEAR:`LINEAR`,STEP:`STEP`,CUBICSPLINE:`CUBICSPLINE`};init(){this.propertyType=`AnimationSampler`}getDefaultAttributes(){return Object.assign(super.getDefaults(),{interpolation:e.Interpolation.LINEAR,input:null,output:null})}getInterpolation(){return this.get(`interpolation`)}setInterpolation(e){return this.set(`interpolation`,e)}getInput(){return this.getRef(`input`)}setInput(e){return this.setRef(`input`,e,{usage:`OTHER`})}getOutput(){return this.getRef(`output`)}setOutput(e){return this.setRef(`output`,e,{usage:`OTHER`})}},Me=class extends A{init(){this.propertyType=`Buffer`}getDefaults(){return Object.assign(super.getDefaults(),{uri:``})}getURI(){return this.get(`uri`)}setURI(e){return this.set(`uri`,e)}},Ne=class e extends A{static Type={PERSPECTIVE:`perspective`,ORTHOGRAPHIC:`orthographic`};init(){this.propertyType=`Camera`}getDefaults(){return Object.assign(super.getDefaults(),{type:e.Type.PERSPECTIVE,znear:.1,zfar:100,aspectRatio:null,yfov:Math.PI*2*50/360,xmag:1,ymag:1})}getType(){return this.get(`type`)}setType(e){return this.set(`type`,e)}getZNear(){return this.get(`znear`)}setZNear(e){return this.set(`znear`,e)}getZFar(){return this.get(`zfar`)}setZFar(e){return this.set(`zfar`,e)}getAspectRatio(){return this.get(`aspectRatio`)}setAspectRatio(e){return this.set(`aspectRatio`,e)}getYFov(){return this.get(`yfov`)}setYFov(e){return this.set(`yfov`,e)}getXMag(){return this.get(`xmag`)}setXMag(e){return this.set(`xmag`,e)}getYMag(){return this.get(`ymag`)}setYMag(e){return this.set(`ymag`,e)}},M=class e extends A{static WrapMode={CLAMP_TO_EDGE:33071,MIRRORED_REPEAT:33648,REPEAT:10497};static MagFilter={NEAREST:9728,LINEAR:9729};static MinFilter={NEAREST:9728,LINEAR:9729,NEAREST_MIPMAP_NEAREST:9984,LINEAR_MIPMAP_NEAREST:9985,NEAREST_MIPMAP_LINEAR:9986,LINEAR_MIPMAP_LINEAR:9987};init(){this.propertyType=`TextureInfo`}getDefaults(){return Object.assign(super.getDefaults(),{texCoord:0,magFilter:null,minFilter:null,wrapS:e.WrapMode.REPEAT,wrapT:e.WrapMode.REPEAT})}getTexCoord(){return this.get(`texCoord`)}setTexCoord(e){return this.set(`texCoord`,e)}getMagFilter(){return this.get(`magFilter`)}setMagFilter(e){return this.set(`magFilter`,e)}getMinFilter(){return this.get(`minFilter`)}setMinFilter(e){return this.set(`minFilter`,e)}getWrapS(){return this.get(`wrapS`)}setWrapS(e){return this.set(`wrapS`,e)}getWrapT(){return this.get(`wrapT`)}setWrapT(e){return this.set(`wrapT`,e)}},{R:Pe,G:Fe,B:Ie,A:Le}=b,N=class e extends A{static AlphaMode={OPAQUE:`OPAQUE`,MASK:`MASK`,BLEND:`BLEND`};init(){this.propertyType=`Material`}getDefaults(){return Object.assign(super.getDefaults(),{alphaMode:e.AlphaMode.OPAQUE,alphaCutoff:.5,doubleSided:!1,baseColorFactor:[1,1,1,1],baseColorTexture:null,baseColorTextureInfo:new M(this.graph,`baseColorTextureInfo`),emissiveFactor:[0,0,0],emissiveTexture:null,emissiveTextureInfo:new M(this.graph,`emissiveTextureInfo`),normalScale:1,normalTexture:null,normalTextureInfo:new M(this.graph,`normalTextureInfo`),occlusionStrength:1,occlusionTexture:null,occlusionTextureInfo:new M(this.graph,`occlusionTextureInfo`),roughnessFactor:1,metallicFactor:1,metallicRoughnessTexture:null,metallicRoughnessTextureInfo:new M(this.graph,`metallicRoughnessTextureInfo`)})}getDoubleSided(){return this.get(`doubleSided`)}setDoubleSided(e){return this.set(`doubleSided`,e)}getAlpha(){return this.get(`baseColorFactor`)[3]}setAlpha(e){let t=this.get(`baseColorFactor`).slice();return t[3]=e,this.set(`baseColorFactor`,t)}getAlphaMode(){return this.get(`alphaMode`)}setAlphaMode(e){return this.set(`alphaMode`,e)}getAlphaCutoff(){return this.get(`alphaCutoff`)}setAlphaCutoff(e){return this.set(`alphaCutoff`,e)}getBaseColorFactor(){return this.get(`baseColorFactor`)}setBaseColorFactor(e){return this.set(`baseColorFactor`,e)}getBaseColorTexture(){return this.getRef(`baseColorTexture`)}getBaseColorTextureInfo(){return this.getRef(`baseColorTexture`)?this.getRef(`baseColorTextureInfo`):null}setBaseColorTexture(e){return this.setRef(`baseColorTexture`,e,{channels:Pe|Fe|Ie|Le,isColor:!0})}getEmissiveFactor(){return this.get(`emissiveFactor`)}setEmissiveFactor(e){return this.set(`emissiveFactor`,e)}getEmissiveTexture(){return this.getRef(`emissiveTexture`)}getEmissiveTextureInfo(){return this.getRef(`emissiveTexture`)?this.getRef(`emissiveTextureInfo`):null}setEmissiveTexture(e){return this.setRef(`emissiveTexture`,e,{channels:Pe|Fe|Ie,isColor:!0})}getNormalScale(){return this.get(`normalScale`)}setNormalScale(e){return this.set(`normalScale`,e)}getNormalTexture(){return this.getRef(`normalTexture`)}getNormalTextureInfo(){return this.getRef(`normalTexture`)?this.getRef(`normalTextureInfo`):null}setNormalTexture(e){return this.setRef(`normalTexture`,e,{channels:Pe|Fe|Ie})}getOcclusionStrength(){return this.get(`occlusionStrength`)}setOcclusionStrength(e){return this.set(`occlusionStrength`,e)}getOcclusionTexture(){return this.getRef(`occlusionTexture`)}getOcclusionTextureInfo(){return this.getRef(`occlusionTexture`)?this.getRef(`occlusionTextureInfo`):null}setOcclusionTexture(e){return this.setRef(`occlusionTexture`,e,{channels:Pe})}getRoughnessFactor(){return this.get(`roughnessFactor`)}setRoughnessFactor(e){return this.set(`roughnessFactor`,e)}getMetallicFactor(){return this.get(`metallicFactor`)}setMetallicFactor(e){return this.set(`metallicFactor`,e)}getMetallicRoughnessTexture(){return this.getRef(`metallicRoughnessTexture`)}getMetallicRoughnessTextureInfo(){return this.getRef(`metallicRoughnessTexture`)?this.getRef(`metallicRoughnessTextureInfo`):null}setMetallicRoughnessTexture(e){return this.setRef(`metallicRoughnessTexture`,e,{channels:Fe|Ie})}},Re=class extends A{init(){this.propertyType=`Mesh`}getDefaults(){return Object.assign(super.getDefaults(),{weights:[],primitives:new f})}addPrimitive(e){return this.addRef(`primitives`,e)}removePrimitive(e){return this.removeRef(`primitives`,e)}listPrimitives(){return this.listRefs(`primitives`)}getWeights(){return this.get(`weights`)}setWeights(e){return this.set(`weights`,e)}},ze=class extends A{init(){this.propertyType=`Node`}getDefaults(){return Object.assign(super.getDefaults(),{translation:[0,0,0],rotation:[0,0,0,1],scale:[1,1,1],weights:[],camera:null,mesh:null,skin:null,children:new f})}copy(e,t=k){if(t===k)throw Error(`Node cannot be copied.`);return super.copy(e,t)}getTranslation(){return this.get(`translation`)}getRotation(){return this.get(`rotation`)}getScale(){return this.get(`scale`)}setTranslation(e){return this.set(`translation`,e)}setRotation(e){return this.set(`rotation`,e)}setScale(e){return this.set(`scale`,e)}getMatrix(){return O.compose(this.get(`translation`),this.get(`rotation`),this.get(`scale`),[])}setMatrix(e){let t=this.get(`translation`).slice(),n=this.get(`rotation`).slice(),r=this.get(`scale`).slice();return O.decompose(e,t,n,r),this.set(`translation`,t).set(`rotation`,n).set(`scale`,r)}getWorldTranslation(){let e=[0,0,0];return O.decompose(this.getWorldMatrix(),e,[0,0,0,1],[1,1,1]),e}getWorldRotation(){let e=[0,0,0,1];return O.decompose(this.getWorldMatrix(),[0,0,0],e,[1,1,1]),e}getWorldScale(){let e=[1,1,1];return O.decompose(this.getWorldMatrix(),[0,0,0],[0,0,0,1],e),e}getWorldMatrix(){let e=[];for(let t=this;t!=null;t=t.getParentNode())e.push(t);let t,n=e.pop().getMatrix();for(;t=e.pop();)de(n,n,t.getMatrix());return n}addChild(e){let t=e.getParentNode();t&&t.removeChild(e);for(let t of e.listParents())t.propertyType===`Scene`&&t.removeChild(e);return this.addRef(`children`,e)}removeChild(e){return this.removeRef(`children`,e)}listChildren(){return this.listRefs(`children`)}getParentNode(){for(let e of this.listParents())if(e.propertyType===`Node`)return e;return null}getMesh(){return this.getRef(`mesh`)}setMesh(e){return this.setRef(`mesh`,e)}getCamera(){return this.getRef(`camera`)}setCamera(e){return this.setRef(`camera`,e)}getSkin(){return this.getRef(`skin`)}setSkin(e){return this.setRef(`skin`,e)}getWeights(){return this.get(`weights`)}setWeights(e){return this.set(`weights`,e)}traverse(e){e(this);for(let t of this.listChildren())t.traverse(e);return this}},Be=class e extends A{static Mode={POINTS:0,LINES:1,LINE_LOOP:2,LINE_STRIP:3,TRIANGLES:4,TRIANGLE_STRIP:5,TRIANGLE_FAN:6};init(){this.propertyType=`Primitive`}getDefaults(){return Object.assign(super.getDefaults(),{mode:e.Mode.TRIANGLES,material:null,indices:null,attributes:new p,targets:new f})}getIndices(){return this.getRef(`indices`)}setIndices(e){return this.setRef(`indices`,e,{usage:`ELEMENT_ARRAY_BUFFER`})}getAttribute(e){return this.getRefMap(`attributes`,e)}setAttribute(e,t){return this.setRefMap(`attributes`,e,t,{usage:`ARRAY_BUFFER`})}listAttributes(){return this.listRefMapValues(`attributes`)}listSemantics(){return this.listRefMapKeys(`attributes`)}getMaterial(){return this.getRef(`material`)}setMaterial(e){return this.setRef(`material`,e)}getMode(){return this.get(`mode`)}setMode(e){return this.set(`mode`,e)}listTargets(){return this.listRefs(`targets`)}addTarget(e){return this.addRef(`targets`,e)}removeTarget(e){return this.removeRef(`targets`,e)}},Ve=class extends De{init(){this.propertyType=`PrimitiveTarget`}getDefaults(){return Object.assign(super.getDefaults(),{attributes:new p})}getAttribute(e){return this.getRefMap(`attributes`,e)}setAttribute(e,t){return this.setRefMap(`attributes`,e,t,{usage:`ARRAY_BUFFER`})}listAttributes(){return this.listRefMapValues(`attributes`)}listSemantics(){return this.listRefMapKeys(`attributes`)}},He=class extends A{init(){this.propertyType=`Scene`}getDefaults(){return Object.assign(super.getDefaults(),{children:new f})}copy(e,t=k){if(t===k)throw Error(`Scene cannot be copied.`);return super.copy(e,t)}addChild(e){let t=e.getParentNode();return t&&t.removeChild(e),this.addRef(`children`,e)}removeChild(e){return this.removeRef(`children`,e)}listChildren(){return this.listRefs(`children`)}traverse(e){for(let t of this.listChildren())t.traverse(e);return this}},Ue=class extends A{init(){this.propertyType=`Skin`}getDefaults(){return Object.assign(super.getDefaults(),{skeleton:null,inverseBindMatrices:null,joints:new f})}getSkeleton(){return this.getRef(`skeleton`)}setSkeleton(e){return this.setRef(`skeleton`,e)}getInverseBindMatrices(){return this.getRef(`inverseBindMatrices`)}setInverseBindMatrices(e){return this.setRef(`inverseBindMatrices`,e,{usage:`INVERSE_BIND_MATRICES`})}addJoint(e){return this.addRef(`joints`,e)}removeJoint(e){return this.removeRef(`joints`,e)}listJoints(){return this.listRefs(`joints`)}},We=class extends A{init(){this.propertyType=`Texture`}getDefaults(){return Object.assign(super.getDefaults(),{image:null,mimeType:``,uri:``})}getMimeType(){return this.get(`mimeType`)||w.extensionToMimeType(T.extension(this.get(`uri`)))}setMimeType(e){return this.set(`mimeType`,e)}getURI(){return this.get(`uri`)}setURI(e){this.set(`uri`,e);let t=w.extensionToMimeType(T.extension(e));return t&&this.set(`mimeType`,t),this}getImage(){return this.get(`image`)}setImage(e){return this.set(`image`,C.assertView(e))}getSize(){let e=this.get(`image`);return e?w.getSize(e,this.getMimeType()):null}},Ge=class extends A{_extensions=new Set;init(){this.propertyType=`Root`}getDefaults(){return Object.assign(super.getDefaults(),{asset:{generator:`glTF-Transform ${_}`,version:`2.0`},defaultScene:null,accessors:new f,animations:new f,buffers:new f,cameras:new f,materials:new f,meshes:new f,nodes:new f,scenes:new f,skins:new f,textures:new f})}constructor(e){super(e),e.addEventListener(`node:create`,e=>{this._addChildOfRoot(e.target)})}clone(){throw Error(`Root cannot be cloned.`)}copy(e,t=k){if(t===k)throw Error(`Root cannot be copied.`);this.set(`asset`,{...e.get(`asset`)}),this.setName(e.getName()),this.setExtras({...e.getExtras()}),this.setDefaultScene(e.getDefaultScene()?t(e.getDefaultScene()):null);for(let n of e.listRefMapKeys(`extensions`)){let r=e.getExtension(n);this.setExtension(n,t(r))}return this}_addChildOfRoot(e){return e instanceof He?this.addRef(`scenes`,e):e instanceof ze?this.addRef(`nodes`,e):e instanceof Ne?this.addRef(`cameras`,e):e instanceof Ue?this.addRef(`skins`,e):e instanceof Re?this.addRef(`meshes`,e):e instanceof N?this.addRef(`materials`,e):e instanceof We?this.addRef(`textures`,e):e instanceof ke?this.addRef(`animations`,e):e instanceof j?this.addRef(`accessors`,e):e instanceof Me&&this.addRef(`buffers`,e),this}getAsset(){return this.get(`asset`)}listExtensionsUsed(){return Array.from(this._extensions)}listExtensionsRequired(){return this.listExtensionsUsed().filter(e=>e.isRequired())}_enableExtension(e){return this._extensions.add(e),this}_disableExtension(e){return this._extensions.delete(e),this}listScenes(){return this.listRefs(`scenes`)}setDefaultScene(e){return this.setRef(`defaultScene`,e)}getDefaultScene(){return this.getRef(`defaultScene`)}listNodes(){return this.listRefs(`nodes`)}listCameras(){return this.listRefs(`cameras`)}listSkins(){return this.listRefs(`skins`)}listMeshes(){return this.listRefs(`meshes`)}listMaterials(){return this.listRefs(`materials`)}listTextures(){return this.listRefs(`textures`)}listAnimations(){return this.listRefs(`animations`)}listAccessors(){return this.listRefs(`accessors`)}listBuffers(){return this.listRefs(`buffers`)}},Ke=class e{_graph=new u;_root=new Ge(this._graph);_logger=D.DEFAULT_INSTANCE;static _GRAPH_DOCUMENTS=new WeakMap;static fromGraph(t){return e._GRAPH_DOCUMENTS.get(t)||null}constructor(){e._GRAPH_DOCUMENTS.set(this._graph,this)}getRoot(){return this._root}getGraph(){return this._graph}getLogger(){return this._logger}setLogger(e){return this._logger=e,this}clone(){throw Error(`Use 'cloneDocument(source)' from '@gltf-transform/functions'.`)}merge(e){throw Error(`Use 'mergeDocuments(target, source)' from '@gltf-transform/functions'.`)}async transform(...e){let t=e.map(e=>e.name);for(let n of e)await n(this,{stack:t});return this}hasExtension(e){return this.getRoot().listExtensionsUsed().some(t=>t.extensionName===e)}createExtension(e){let t=e.EXTENSION_NAME;return this.getRoot().listExtensionsUsed().find(e=>e.extensionName===t)||new e(this)}disposeExtension(e){let t=this.getRoot().listExtensionsUsed().find(t=>t.extensionName===e);t&&t.dispose()}createScene(e=``){return new He(this._graph,e)}createNode(e=``){return new ze(this._graph,e)}createCamera(e=``){return new Ne(this._graph,e)}createSkin(e=``){return new Ue(this._graph,e)}createMesh(e=``){return new Re(this._graph,e)}createPrimitive(){return new Be(this._graph)}createPrimitiveTarget(e=``){return new Ve(this._graph,e)}createMaterial(e=``){return new N(this._graph,e)}createTexture(e=``){return new We(this._graph,e)}createAnimation(e=``){return new ke(this._graph,e)}createAnimationChannel(e=``){return new Ae(this._graph,e)}createAnimationSampler(e=``){return new je(this._graph,e)}createAccessor(e=``,t=null){return t||=this.getRoot().listBuffers()[0],new j(this._graph,e).setBuffer(t)}createBuffer(e=``){return new Me(this._graph,e)}},qe=class{jsonDoc;buffers=[];bufferViews=[];bufferViewBuffers=[];accessors=[];textures=[];textureInfos=new Map;materials=[];meshes=[];cameras=[];nodes=[];skins=[];animations=[];scenes=[];constructor(e){this.jsonDoc=e}setTextureInfo(e,t){this.textureInfos.set(e,t),t.texCoord!==void 0&&e.setTexCoord(t.texCoord),t.extras!==void 0&&e.setExtras(t.extras);let n=this.jsonDoc.json.textures[t.index];if(n.sampler===void 0)return;let r=this.jsonDoc.json.samplers[n.sampler];r.magFilter!==void 0&&e.setMagFilter(r.magFilter),r.minFilter!==void 0&&e.setMinFilter(r.minFilter),r.wrapS!==void 0&&e.setWrapS(r.wrapS),r.wrapT!==void 0&&e.setWrapT(r.wrapT)}},Je={logger:D.DEFAULT_INSTANCE,extensions:[],dependencies:{}},Ye=new Set([`Buffer`,`Texture`,`Material`,`Mesh`,`Primitive`,`Node`,`Scene`]),Xe=class{static read(e,t=Je){let n={...Je,...t},{json:r}=e,i=new Ke().setLogger(n.logger);this.validate(e,n);let a=new qe(e),o=r.asset,s=i.getRoot().getAsset();o.copyright&&(s.copyright=o.copyright),o.extras&&(s.extras=o.extras),r.extras!==void 0&&i.getRoot().setExtras({...r.extras});let c=r.extensionsUsed||[],l=r.extensionsRequired||[];n.extensions.sort((e,t)=>e.EXTENSION_NAME>t.EXTENSION_NAME?1:-1);for(let e of n.extensions)if(c.includes(e.EXTENSION_NAME)){let t=i.createExtension(e).setRequired(l.includes(e.EXTENSION_NAME)),r=t.prereadTypes.filter(e=>!Ye.has(e));r.length&&n.logger.warn(`Preread hooks for some types (${r.join()}), requested by extension ${t.extensionName}, are unsupported. Please file an issue or a PR.`);for(let e of t.readDependencies)t.install(e,n.dependencies[e])}let u=r.buffers||[];i.getRoot().listExtensionsUsed().filter(e=>e.prereadTypes.includes(`Buffer`)).forEach(e=>e.preread(a,`Buffer`)),a.buffers=u.map(e=>{let t=i.createBuffer(e.name);return e.extras&&t.setExtras(e.extras),e.uri&&e.uri.indexOf(`__`)!==0&&t.setURI(e.uri),t}),a.bufferViewBuffers=(r.bufferViews||[]).map((t,n)=>{if(!a.bufferViews[n]){let r=e.json.buffers[t.buffer],i=r.uri?e.resources[r.uri]:e.resources[v],o=t.byteOffset||0;a.bufferViews[n]=C.toView(i,o,t.byteLength)}return a.buffers[t.buffer]});let d=r.accessors||[];a.accessors=d.map(e=>{let t=a.bufferViewBuffers[e.bufferView],n=i.createAccessor(e.name,t).setType(e.type);return e.extras&&n.setExtras(e.extras),e.normalized!==void 0&&n.setNormalized(e.normalized),e.bufferView===void 0||n.setArray(Qe(e,a)),n});let f=r.images||[],p=r.textures||[];i.getRoot().listExtensionsUsed().filter(e=>e.prereadTypes.includes(`Texture`)).forEach(e=>e.preread(a,`Texture`)),a.textures=f.map(t=>{let n=i.createTexture(t.name);if(t.extras&&n.setExtras(t.extras),t.bufferView!==void 0){let i=r.bufferViews[t.bufferView],a=e.json.buffers[i.buffer],o=a.uri?e.resources[a.uri]:e.resources[v],s=i.byteOffset||0,c=i.byteLength,l=o.slice(s,s+c);n.setImage(l)}else t.uri!==void 0&&(n.setImage(e.resources[t.uri]),t.uri.indexOf(`__`)!==0&&n.setURI(t.uri));if(t.mimeType!==void 0)n.setMimeType(t.mimeType);else if(t.uri){let e=T.extension(t.uri);n.setMimeType(w.extensionToMimeType(e))}return n}),i.getRoot().listExtensionsUsed().filter(e=>e.prereadTypes.includes(`Material`)).forEach(e=>e.preread(a,`Material`)),a.materials=(r.materials||[]).map(e=>{let t=i.createMaterial(e.name);e.extras&&t.setExtras(e.extras),e.alphaMode!==void 0&&t.setAlphaMode(e.alphaMode),e.alphaCutoff!==void 0&&t.setAlphaCutoff(e.alphaCutoff),e.doubleSided!==void 0&&t.setDoubleSided(e.doubleSided);let n=e.pbrMetallicRoughness||{};if(n.baseColorFactor!==void 0&&t.setBaseColorFactor(n.baseColorFactor),e.emissiveFactor!==void 0&&t.setEmissiveFactor(e.emissiveFactor),n.metallicFactor!==void 0&&t.setMetallicFactor(n.metallicFactor),n.roughnessFactor!==void 0&&t.setRoughnessFactor(n.roughnessFactor),n.baseColorTexture!==void 0){let e=n.baseColorTexture,r=a.textures[p[e.index].source];t.setBaseColorTexture(r),a.setTextureInfo(t.getBaseColorTextureInfo(),e)}if(e.emissiveTexture!==void 0){let n=e.emissiveTexture,r=a.textures[p[n.index].source];t.setEmissiveTexture(r),a.setTextureInfo(t.getEmissiveTextureInfo(),n)}if(e.normalTexture!==void 0){let n=e.normalTexture,r=a.textures[p[n.index].source];t.setNormalTexture(r),a.setTextureInfo(t.getNormalTextureInfo(),n),e.normalTexture.scale!==void 0&&t.setNormalScale(e.normalTexture.scale)}if(e.occlusionTexture!==void 0){let n=e.occlusionTexture,r=a.textures[p[n.index].source];t.setOcclusionTexture(r),a.setTextureInfo(t.getOcclusionTextureInfo(),n),e.occlusionTexture.strength!==void 0&&t.setOcclusionStrength(e.occlusionTexture.strength)}if(n.metallicRoughnessTexture!==void 0){let e=n.metallicRoughnessTexture,r=a.textures[p[e.index].source];t.setMetallicRoughnessTexture(r),a.setTextureInfo(t.getMetallicRoughnessTextureInfo(),e)}return t}),i.getRoot().listExtensionsUsed().filter(e=>e.prereadTypes.includes(`Mesh`)).forEach(e=>e.preread(a,`Mesh`));let m=r.meshes||[];i.getRoot().listExtensionsUsed().filter(e=>e.prereadTypes.includes(`Primitive`)).forEach(e=>e.preread(a,`Primitive`)),a.meshes=m.map(e=>{let t=i.createMesh(e.name);return e.extras&&t.setExtras(e.extras),e.weights!==void 0&&t.setWeights(e.weights),(e.primitives||[]).forEach(n=>{let r=i.createPrimitive();n.extras&&r.setExtras(n.extras),n.material!==void 0&&r.setMaterial(a.materials[n.material]),n.mode!==void 0&&r.setMode(n.mode);for(let[e,t]of Object.entries(n.attributes||{}))r.setAttribute(e,a.accessors[t]);n.indices!==void 0&&r.setIndices(a.accessors[n.indices]);let o=e.extras&&e.extras.targetNames||[];(n.targets||[]).forEach((e,t)=>{let n=o[t]||t.toString(),s=i.createPrimitiveTarget(n);for(let[t,n]of Object.entries(e))s.setAttribute(t,a.accessors[n]);r.addTarget(s)}),t.addPrimitive(r)}),t}),a.cameras=(r.cameras||[]).map(e=>{let t=i.createCamera(e.name).setType(e.type);if(e.extras&&t.setExtras(e.extras),e.type===Ne.Type.PERSPECTIVE){let n=e.perspective;t.setYFov(n.yfov),t.setZNear(n.znear),n.zfar!==void 0&&t.setZFar(n.zfar),n.aspectRatio!==void 0&&t.setAspectRatio(n.aspectRatio)}else{let n=e.orthographic;t.setZNear(n.znear).setZFar(n.zfar).setXMag(n.xmag).setYMag(n.ymag)}return t});let h=r.nodes||[];i.getRoot().listExtensionsUsed().filter(e=>e.prereadTypes.includes(`Node`)).forEach(e=>e.preread(a,`Node`)),a.nodes=h.map(e=>{let t=i.createNode(e.name);if(e.extras&&t.setExtras(e.extras),e.translation!==void 0&&t.setTranslation(e.translation),e.rotation!==void 0&&t.setRotation(e.rotation),e.scale!==void 0&&t.setScale(e.scale),e.matrix!==void 0){let n=[0,0,0],r=[0,0,0,1],i=[1,1,1];O.decompose(e.matrix,n,r,i),t.setTranslation(n),t.setRotation(r),t.setScale(i)}return e.weights!==void 0&&t.setWeights(e.weights),t}),a.skins=(r.skins||[]).map(e=>{let t=i.createSkin(e.name);e.extras&&t.setExtras(e.extras),e.inverseBindMatrices!==void 0&&t.setInverseBindMatrices(a.accessors[e.inverseBindMatrices]),e.skeleton!==void 0&&t.setSkeleton(a.nodes[e.skeleton]);for(let n of e.joints)t.addJoint(a.nodes[n]);return t}),h.map((e,t)=>{let n=a.nodes[t];(e.children||[]).forEach(e=>n.addChild(a.nodes[e])),e.mesh!==void 0&&n.setMesh(a.meshes[e.mesh]),e.camera!==void 0&&n.setCamera(a.cameras[e.camera]),e.skin!==void 0&&n.setSkin(a.skins[e.skin])}),a.animations=(r.animations||[]).map(e=>{let t=i.createAnimation(e.name);e.extras&&t.setExtras(e.extras);let n=(e.samplers||[]).map(e=>{let n=i.createAnimationSampler().setInput(a.accessors[e.input]).setOutput(a.accessors[e.output]).setInterpolation(e.interpolation||je.Interpolation.LINEAR);return e.extras&&n.setExtras(e.extras),t.addSampler(n),n});return(e.channels||[]).forEach(e=>{let r=i.createAnimationChannel().setSampler(n[e.sampler]).setTargetPath(e.target.path);e.target.node!==void 0&&r.setTargetNode(a.nodes[e.target.node]),e.extras&&r.setExtras(e.extras),t.addChannel(r)}),t});let g=r.scenes||[];return i.getRoot().listExtensionsUsed().filter(e=>e.prereadTypes.includes(`Scene`)).forEach(e=>e.preread(a,`Scene`)),a.scenes=g.map(e=>{let t=i.createScene(e.name);return e.extras&&t.setExtras(e.extras),(e.nodes||[]).map(e=>a.nodes[e]).forEach(e=>t.addChild(e)),t}),r.scene!==void 0&&i.getRoot().setDefaultScene(a.scenes[r.scene]),i.getRoot().listExtensionsUsed().forEach(e=>e.read(a)),d.forEach((e,t)=>{let n=a.accessors[t],r=!!e.sparse,i=!e.bufferView&&!n.getArray();(r||i)&&n.setSparse(!0).setArray($e(e,a))}),i}static validate(e,t){let n=e.json;if(n.asset.version!==`2.0`)throw Error(`Unsupported glTF version, "${n.asset.version}".`);if(n.extensionsRequired){for(let e of n.extensionsRequired)if(!t.extensions.find(t=>t.EXTENSION_NAME===e))throw Error(`Missing required extension, "${e}".`)}if(n.extensionsUsed)for(let e of n.extensionsUsed)t.extensions.find(t=>t.EXTENSION_NAME===e)||t.logger.warn(`Missing optional extension, "${e}".`)}};function Ze(e,t){let n=t.jsonDoc,r=t.bufferViews[e.bufferView],i=n.json.bufferViews[e.bufferView],a=S[e.componentType],o=j.getElementSize(e.type),s=a.BYTES_PER_ELEMENT,c=e.byteOffset||0,l=new a(e.count*o),u=new DataView(r.buffer,r.byteOffset,r.byteLength),d=i.byteStride;for(let t=0;t<e.count;t++)for(let n=0;n<o;n++){let r=c+t*d+n*s,i;switch(e.componentType){case j.ComponentType.FLOAT:i=u.getFloat32(r,!0);break;case j.ComponentType.UNSIGNED_INT:i=u.getUint32(r,!0);break;case j.ComponentType.UNSIGNED_SHORT:i=u.getUint16(r,!0);break;case j.ComponentType.UNSIGNED_BYTE:i=u.getUint8(r);break;case j.ComponentType.SHORT:i=u.getInt16(r,!0);break;case j.ComponentType.BYTE:i=u.getInt8(r);break;case j.ComponentType.FLOAT16:i=u.getFloat16(r,!0);break;case j.ComponentType.FLOAT64:i=u.getFloat64(r,!0);break;default:throw Error(`Unexpected componentType "${e.componentType}".`)}l[t*o+n]=i}return l}function Qe(e,t){let n=t.jsonDoc,r=t.bufferViews[e.bufferView],i=n.json.bufferViews[e.bufferView],a=S[e.componentType],o=j.getElementSize(e.type),s=a.BYTES_PER_ELEMENT,c=o*s;if(i.byteStride!==void 0&&i.byteStride!==c)return Ze(e,t);let l=r.byteOffset+(e.byteOffset||0),u=e.count*o*s;return new a(r.buffer.slice(l,l+u))}function $e(e,t){let n=S[e.componentType],r=j.getElementSize(e.type),i;i=e.bufferView===void 0?new n(e.count*r):Qe(e,t);let a=e.sparse;if(!a)return i;let o=a.count,s={...e,...a.indices,count:o,type:`SCALAR`},c={...e,...a.values,count:o},l=Qe(s,t),u=Qe(c,t);for(let e=0;e<s.count;e++)for(let t=0;t<r;t++)i[l[e]*r+t]=u[e*r+t];return i}var et=function(e){return e[e.ARRAY_BUFFER=34962]=`ARRAY_BUFFER`,e[e.ELEMENT_ARRAY_BUFFER=34963]=`ELEMENT_ARRAY_BUFFER`,e}(et||{}),tt=class{_doc;jsonDoc;options;static BufferViewTarget=et;static BufferViewUsage=y;static USAGE_TO_TARGET={ARRAY_BUFFER:34962,ELEMENT_ARRAY_BUFFER:34963};accessorIndexMap=new Map;animationIndexMap=new Map;bufferIndexMap=new Map;cameraIndexMap=new Map;skinIndexMap=new Map;materialIndexMap=new Map;meshIndexMap=new Map;nodeIndexMap=new Map;imageIndexMap=new Map;textureDefIndexMap=new Map;textureInfoDefMap=new Map;samplerDefIndexMap=new Map;sceneIndexMap=new Map;imageBufferViews=[];otherBufferViews=new Map;otherBufferViewsIndexMap=new Map;extensionData={};bufferURIGenerator;imageURIGenerator;logger;_accessorUsageMap=new Map;accessorUsageGroupedByParent=new Set([`ARRAY_BUFFER`]);accessorParents=new Map;constructor(e,t,n){this._doc=e,this.jsonDoc=t,this.options=n;let r=e.getRoot(),i=r.listBuffers().length,a=r.listTextures().length;this.bufferURIGenerator=new nt(i>1,()=>n.basename||`buffer`),this.imageURIGenerator=new nt(a>1,t=>rt(e,t)||n.basename||`texture`),this.logger=e.getLogger()}createTextureInfoDef(e,t){let n={magFilter:t.getMagFilter()||void 0,minFilter:t.getMinFilter()||void 0,wrapS:t.getWrapS(),wrapT:t.getWrapT()},r=JSON.stringify(n);this.samplerDefIndexMap.has(r)||(this.samplerDefIndexMap.set(r,this.jsonDoc.json.samplers.length),this.jsonDoc.json.samplers.push(n));let i={source:this.imageIndexMap.get(e),sampler:this.samplerDefIndexMap.get(r)},a=JSON.stringify(i);this.textureDefIndexMap.has(a)||(this.textureDefIndexMap.set(a,this.jsonDoc.json.textures.length),this.jsonDoc.json.textures.push(i));let o={index:this.textureDefIndexMap.get(a)};return t.getTexCoord()!==0&&(o.texCoord=t.getTexCoord()),Object.keys(t.getExtras()).length>0&&(o.extras=t.getExtras()),this.textureInfoDefMap.set(t,o),o}createPropertyDef(e){let t={};return e.getName()&&(t.name=e.getName()),Object.keys(e.getExtras()).length>0&&(t.extras=e.getExtras()),t}createAccessorDef(e){let t=this.createPropertyDef(e);return t.type=e.getType(),t.componentType=e.getComponentType(),t.count=e.getCount(),this._doc.getGraph().listParentEdges(e).some(e=>e.getName()===`attributes`&&e.getAttributes().key===`POSITION`||e.getName()===`input`)&&(t.max=e.getMax([]).map(Math.fround),t.min=e.getMin([]).map(Math.fround)),e.getNormalized()&&(t.normalized=e.getNormalized()),t}createImageData(e,t,n){if(this.options.format===`GLB`)this.imageBufferViews.push(t),e.bufferView=this.jsonDoc.json.bufferViews.length,this.jsonDoc.json.bufferViews.push({buffer:0,byteOffset:-1,byteLength:t.byteLength});else{let r=w.mimeTypeToExtension(n.getMimeType());e.uri=this.imageURIGenerator.createURI(n,r),this.assignResourceURI(e.uri,t,!1)}}assignResourceURI(e,t,n){let r=this.jsonDoc.resources;if(!(e in r)){r[e]=t;return}if(t===r[e]){this.logger.warn(`Duplicate resource URI, "${e}".`);return}let i=`Resource URI "${e}" already assigned to different data.`;if(!n)this.logger.warn(i);else throw Error(i)}getAccessorUsage(e){let t=this._accessorUsageMap.get(e);if(t)return t;if(e.getSparse())return`SPARSE`;for(let t of this._doc.getGraph().listParentEdges(e)){let{usage:e}=t.getAttributes();if(e)return e;t.getParent().propertyType!==`Root`&&this.logger.warn(`Missing attribute ".usage" on edge, "${t.getName()}".`)}return`OTHER`}addAccessorToUsageGroup(e,t){let n=this._accessorUsageMap.get(e);if(n&&n!==t)throw Error(`Accessor with usage "${n}" cannot be reused as "${t}".`);return this._accessorUsageMap.set(e,t),this}},nt=class{multiple;basename;counter={};constructor(e,t){this.multiple=e,this.basename=t}createURI(e,t){if(e.getURI())return e.getURI();if(this.multiple){let n=this.basename(e);return this.counter[n]=this.counter[n]||1,`${n}_${this.counter[n]++}.${t}`}return`${this.basename(e)}.${t}`}};function rt(e,t){let n=e.getGraph().listParentEdges(t).find(t=>t.getParent()!==e.getRoot());return n?n.getName().replace(/texture$/i,``):``}var{BufferViewUsage:it}=tt,{UNSIGNED_INT:at,UNSIGNED_SHORT:ot,UNSIGNED_BYTE:st}=j.ComponentType,ct=new Set([`Accessor`,`Buffer`,`Material`,`Mesh`]),lt=class{static write(e,t){let n=e.getGraph(),r=e.getRoot(),i={asset:{generator:`glTF-Transform ${_}`,...r.getAsset()},extras:{...r.getExtras()}},a={json:i,resources:{}},o=new tt(e,a,t),s=t.logger||D.DEFAULT_INSTANCE,c=new Set(t.extensions.map(e=>e.EXTENSION_NAME)),l=e.getRoot().listExtensionsUsed().filter(e=>c.has(e.extensionName)).sort((e,t)=>e.extensionName>t.extensionName?1:-1),u=e.getRoot().listExtensionsRequired().filter(e=>c.has(e.extensionName)).sort((e,t)=>e.extensionName>t.extensionName?1:-1);l.length<e.getRoot().listExtensionsUsed().length&&s.warn(`Some extensions were not registered for I/O, and will not be written.`);for(let e of l){let n=e.prewriteTypes.filter(e=>!ct.has(e));n.length&&s.warn(`Prewrite hooks for some types (${n.join()}), requested by extension ${e.extensionName}, are unsupported. Please file an issue or a PR.`);for(let n of e.writeDependencies)e.install(n,t.dependencies[n])}function d(e,t,n,r){let a=[],s=0;for(let t of e){let e=o.createAccessorDef(t);e.bufferView=i.bufferViews.length;let n=t.getArray(),r=C.pad(C.toView(n));e.byteOffset=s,s+=r.byteLength,a.push(r),o.accessorIndexMap.set(t,i.accessors.length),i.accessors.push(e)}let c={buffer:t,byteOffset:n,byteLength:C.concat(a).byteLength};return r&&(c.target=r),i.bufferViews.push(c),{buffers:a,byteLength:s}}function f(e,t,n){let r=e[0].getCount(),a=0;for(let t of e){let e=o.createAccessorDef(t);e.bufferView=i.bufferViews.length,e.byteOffset=a;let n=t.getElementSize(),r=t.getComponentSize();a+=C.padNumber(n*r),o.accessorIndexMap.set(t,i.accessors.length),i.accessors.push(e)}let s=r*a,c=new ArrayBuffer(s),l=new DataView(c);for(let t=0;t<r;t++){let n=0;for(let r of e){let e=r.getElementSize(),i=r.getComponentSize(),o=r.getComponentType(),s=r.getArray();for(let r=0;r<e;r++){let c=t*a+n+r*i,u=s[t*e+r];switch(o){case j.ComponentType.FLOAT:l.setFloat32(c,u,!0);break;case j.ComponentType.BYTE:l.setInt8(c,u);break;case j.ComponentType.SHORT:l.setInt16(c,u,!0);break;case j.ComponentType.UNSIGNED_BYTE:l.setUint8(c,u);break;case j.ComponentType.UNSIGNED_SHORT:l.setUint16(c,u,!0);break;case j.ComponentType.UNSIGNED_INT:l.setUint32(c,u,!0);break;case j.ComponentType.FLOAT16:l.setFloat16(c,u,!0);break;case j.ComponentType.FLOAT64:l.setFloat64(c,u,!0);break;default:throw Error(`Unexpected component type: `+o)}}n+=C.padNumber(e*i)}}let u={buffer:t,byteOffset:n,byteLength:s,byteStride:a,target:tt.BufferViewTarget.ARRAY_BUFFER};return i.bufferViews.push(u),{byteLength:s,buffers:[new Uint8Array(c)]}}function p(e,t,n){let r=[],a=0,c=new Map,l=-1/0,u=!1;for(let t of e){let e=o.createAccessorDef(t);i.accessors.push(e),o.accessorIndexMap.set(t,i.accessors.length-1);let n=[],r=[],a=[],s=Array(t.getElementSize()).fill(0);for(let e=0,i=t.getCount();e<i;e++)if(t.getElement(e,a),!O.eq(a,s,0)){l=Math.max(e,l),n.push(e);for(let e=0;e<a.length;e++)r.push(a[e])}let d=n.length,f={accessorDef:e,count:d};if(c.set(t,f),d===0)continue;d>t.getCount()/2&&(u=!0);let p=S[t.getComponentType()];f.indices=n,f.values=new p(r)}if(!Number.isFinite(l))return{buffers:r,byteLength:a};u&&s.warn(`Some sparse accessors have >50% non-zero elements, which may increase file size.`);let d=l<255?Uint8Array:l<65535?Uint16Array:Uint32Array,f=l<255?st:l<65535?ot:at,p={buffer:t,byteOffset:n+a,byteLength:0};for(let t of e){let e=c.get(t);if(e.count===0)continue;e.indicesByteOffset=p.byteLength;let n=C.pad(C.toView(new d(e.indices)));r.push(n),a+=n.byteLength,p.byteLength+=n.byteLength}i.bufferViews.push(p);let m=i.bufferViews.length-1,h={buffer:t,byteOffset:n+a,byteLength:0};for(let t of e){let e=c.get(t);if(e.count===0)continue;e.valuesByteOffset=h.byteLength;let n=C.pad(C.toView(e.values));r.push(n),a+=n.byteLength,h.byteLength+=n.byteLength}i.bufferViews.push(h);let g=i.bufferViews.length-1;for(let t of e){let e=c.get(t);e.count!==0&&(e.accessorDef.sparse={count:e.count,indices:{bufferView:m,byteOffset:e.indicesByteOffset,componentType:f},values:{bufferView:g,byteOffset:e.valuesByteOffset}})}return{buffers:r,byteLength:a}}if(i.accessors=[],i.bufferViews=[],i.samplers=[],i.textures=[],i.images=r.listTextures().map((e,t)=>{let n=o.createPropertyDef(e);e.getMimeType()&&(n.mimeType=e.getMimeType());let r=e.getImage();return r&&o.createImageData(n,r,e),o.imageIndexMap.set(e,t),n}),l.filter(e=>e.prewriteTypes.includes(`Accessor`)).forEach(e=>e.prewrite(o,`Accessor`)),r.listAccessors().forEach(e=>{let t=o.accessorUsageGroupedByParent,r=o.accessorParents;if(o.accessorIndexMap.has(e))return;let i=o.getAccessorUsage(e);if(o.addAccessorToUsageGroup(e,i),t.has(i)){let t=n.listParents(e).find(e=>e.propertyType!==`Root`);r.set(e,t)}}),l.filter(e=>e.prewriteTypes.includes(`Buffer`)).forEach(e=>e.prewrite(o,`Buffer`)),(r.listAccessors().length>0||o.otherBufferViews.size>0||r.listTextures().length>0&&t.format===`GLB`)&&r.listBuffers().length===0)throw Error(`Buffer required for Document resources, but none was found.`);i.buffers=[],r.listBuffers().forEach((e,n)=>{let r=o.createPropertyDef(e),a=o.accessorUsageGroupedByParent,s=e.listParents().filter(e=>e instanceof j),c=new Set(s.map(e=>o.accessorParents.get(e))),l=new Map(Array.from(c).map((e,t)=>[e,t])),u={};for(let e of s){if(o.accessorIndexMap.has(e))continue;let t=o.getAccessorUsage(e),n=t;if(a.has(t)){let t=o.accessorParents.get(e);n+=`:${l.get(t)}`}u[n]||={usage:t,accessors:[]},u[n].accessors.push(e)}let m=[],h=i.buffers.length,g=0;for(let{usage:e,accessors:n}of Object.values(u))if(e===it.ARRAY_BUFFER&&t.vertexLayout===`interleaved`){let e=f(n,h,g);g+=e.byteLength;for(let t of e.buffers)m.push(t)}else if(e===it.ARRAY_BUFFER)for(let e of n){let t=f([e],h,g);g+=t.byteLength;for(let e of t.buffers)m.push(e)}else if(e===it.SPARSE){let e=p(n,h,g);g+=e.byteLength;for(let t of e.buffers)m.push(t)}else if(e===it.ELEMENT_ARRAY_BUFFER){let e=tt.BufferViewTarget.ELEMENT_ARRAY_BUFFER,t=d(n,h,g,e);g+=t.byteLength;for(let e of t.buffers)m.push(e)}else{let e=d(n,h,g);g+=e.byteLength;for(let t of e.buffers)m.push(t)}if(o.imageBufferViews.length&&n===0){for(let e=0;e<o.imageBufferViews.length;e++)if(i.bufferViews[i.images[e].bufferView].byteOffset=g,g+=o.imageBufferViews[e].byteLength,m.push(o.imageBufferViews[e]),g%8){let e=8-g%8;g+=e,m.push(new Uint8Array(e))}}if(o.otherBufferViews.has(e))for(let t of o.otherBufferViews.get(e))i.bufferViews.push({buffer:h,byteOffset:g,byteLength:t.byteLength}),o.otherBufferViewsIndexMap.set(t,i.bufferViews.length-1),g+=t.byteLength,m.push(t);if(g){let n;t.format===`GLB`?n=v:(n=o.bufferURIGenerator.createURI(e,`bin`),r.uri=n),r.byteLength=g,o.assignResourceURI(n,C.concat(m),!0)}i.buffers.push(r),o.bufferIndexMap.set(e,n)}),r.listAccessors().find(e=>!e.getBuffer())&&s.warn(`Skipped writing one or more Accessors: no Buffer assigned.`),l.filter(e=>e.prewriteTypes.includes(`Material`)).forEach(e=>e.prewrite(o,`Material`)),i.materials=r.listMaterials().map((e,t)=>{let n=o.createPropertyDef(e);if(e.getAlphaMode()!==N.AlphaMode.OPAQUE&&(n.alphaMode=e.getAlphaMode()),e.getAlphaMode()===N.AlphaMode.MASK&&(n.alphaCutoff=e.getAlphaCutoff()),e.getDoubleSided()&&(n.doubleSided=!0),n.pbrMetallicRoughness={},O.eq(e.getBaseColorFactor(),[1,1,1,1])||(n.pbrMetallicRoughness.baseColorFactor=e.getBaseColorFactor()),O.eq(e.getEmissiveFactor(),[0,0,0])||(n.emissiveFactor=e.getEmissiveFactor()),e.getRoughnessFactor()!==1&&(n.pbrMetallicRoughness.roughnessFactor=e.getRoughnessFactor()),e.getMetallicFactor()!==1&&(n.pbrMetallicRoughness.metallicFactor=e.getMetallicFactor()),e.getBaseColorTexture()){let t=e.getBaseColorTexture(),r=e.getBaseColorTextureInfo();n.pbrMetallicRoughness.baseColorTexture=o.createTextureInfoDef(t,r)}if(e.getEmissiveTexture()){let t=e.getEmissiveTexture(),r=e.getEmissiveTextureInfo();n.emissiveTexture=o.createTextureInfoDef(t,r)}if(e.getNormalTexture()){let t=e.getNormalTexture(),r=e.getNormalTextureInfo(),i=o.createTextureInfoDef(t,r);e.getNormalScale()!==1&&(i.scale=e.getNormalScale()),n.normalTexture=i}if(e.getOcclusionTexture()){let t=e.getOcclusionTexture(),r=e.getOcclusionTextureInfo(),i=o.createTextureInfoDef(t,r);e.getOcclusionStrength()!==1&&(i.strength=e.getOcclusionStrength()),n.occlusionTexture=i}if(e.getMetallicRoughnessTexture()){let t=e.getMetallicRoughnessTexture(),r=e.getMetallicRoughnessTextureInfo();n.pbrMetallicRoughness.metallicRoughnessTexture=o.createTextureInfoDef(t,r)}return o.materialIndexMap.set(e,t),n}),l.filter(e=>e.prewriteTypes.includes(`Mesh`)).forEach(e=>e.prewrite(o,`Mesh`)),i.meshes=r.listMeshes().map((e,t)=>{let n=o.createPropertyDef(e),r=null;return n.primitives=e.listPrimitives().map(e=>{let t={attributes:{}};t.mode=e.getMode();let n=e.getMaterial();n&&(t.material=o.materialIndexMap.get(n)),Object.keys(e.getExtras()).length&&(t.extras=e.getExtras());let i=e.getIndices();i&&(t.indices=o.accessorIndexMap.get(i));for(let n of e.listSemantics())t.attributes[n]=o.accessorIndexMap.get(e.getAttribute(n));for(let n of e.listTargets()){let e={};for(let t of n.listSemantics())e[t]=o.accessorIndexMap.get(n.getAttribute(t));t.targets=t.targets||[],t.targets.push(e)}return e.listTargets().length&&!r&&(r=e.listTargets().map(e=>e.getName())),t}),e.getWeights().length&&(n.weights=e.getWeights()),r&&(n.extras=n.extras||{},n.extras.targetNames=r),o.meshIndexMap.set(e,t),n}),i.cameras=r.listCameras().map((e,t)=>{let n=o.createPropertyDef(e);if(n.type=e.getType(),n.type===Ne.Type.PERSPECTIVE){n.perspective={znear:e.getZNear(),zfar:e.getZFar(),yfov:e.getYFov()};let t=e.getAspectRatio();t!==null&&(n.perspective.aspectRatio=t)}else n.orthographic={znear:e.getZNear(),zfar:e.getZFar(),xmag:e.getXMag(),ymag:e.getYMag()};return o.cameraIndexMap.set(e,t),n}),i.nodes=r.listNodes().map((e,t)=>{let n=o.createPropertyDef(e);return O.eq(e.getTranslation(),[0,0,0])||(n.translation=e.getTranslation()),O.eq(e.getRotation(),[0,0,0,1])||(n.rotation=e.getRotation()),O.eq(e.getScale(),[1,1,1])||(n.scale=e.getScale()),e.getWeights().length&&(n.weights=e.getWeights()),o.nodeIndexMap.set(e,t),n}),i.skins=r.listSkins().map((e,t)=>{let n=o.createPropertyDef(e),r=e.getInverseBindMatrices();r&&(n.inverseBindMatrices=o.accessorIndexMap.get(r));let i=e.getSkeleton();return i&&(n.skeleton=o.nodeIndexMap.get(i)),n.joints=e.listJoints().map(e=>o.nodeIndexMap.get(e)),o.skinIndexMap.set(e,t),n}),r.listNodes().forEach((e,t)=>{let n=i.nodes[t],r=e.getMesh();r&&(n.mesh=o.meshIndexMap.get(r));let a=e.getCamera();a&&(n.camera=o.cameraIndexMap.get(a));let s=e.getSkin();s&&(n.skin=o.skinIndexMap.get(s)),e.listChildren().length>0&&(n.children=e.listChildren().map(e=>o.nodeIndexMap.get(e)))}),i.animations=r.listAnimations().map((e,t)=>{let n=o.createPropertyDef(e),r=new Map;return n.samplers=e.listSamplers().map((e,t)=>{let n=o.createPropertyDef(e);return n.input=o.accessorIndexMap.get(e.getInput()),n.output=o.accessorIndexMap.get(e.getOutput()),n.interpolation=e.getInterpolation(),r.set(e,t),n}),n.channels=e.listChannels().map(e=>{let t=o.createPropertyDef(e);return t.sampler=r.get(e.getSampler()),t.target={node:o.nodeIndexMap.get(e.getTargetNode()),path:e.getTargetPath()},t}),o.animationIndexMap.set(e,t),n}),i.scenes=r.listScenes().map((e,t)=>{let n=o.createPropertyDef(e);return n.nodes=e.listChildren().map(e=>o.nodeIndexMap.get(e)),o.sceneIndexMap.set(e,t),n});let m=r.getDefaultScene();return m&&(i.scene=r.listScenes().indexOf(m)),i.extensionsUsed=l.map(e=>e.extensionName),i.extensionsRequired=u.map(e=>e.extensionName),l.forEach(e=>e.write(o)),ut(i),a}};function ut(e){let t=[];for(let n in e){let r=e[n];(Array.isArray(r)&&r.length===0||r===null||r===``||r&&typeof r==`object`&&Object.keys(r).length===0)&&t.push(n)}for(let n of t)delete e[n]}var dt=class{_logger=D.DEFAULT_INSTANCE;_extensions=new Set;_dependencies={};_vertexLayout=`interleaved`;_strictResources=!0;lastReadBytes=0;lastWriteBytes=0;setLogger(e){return this._logger=e,this}registerExtensions(e){for(let t of e)this._extensions.add(t),t.register();return this}registerDependencies(e){return Object.assign(this._dependencies,e),this}setVertexLayout(e){return this._vertexLayout=e,this}setStrictResources(e){return this._strictResources=e,this}async read(e){return await this.readJSON(await this.readAsJSON(e))}async readAsJSON(e){let t=await this.readURI(e,`view`);this.lastReadBytes=t.byteLength;let n=mt(t)?this._binaryToJSON(t):{json:JSON.parse(C.decodeText(t)),resources:{}};return await this._readResourcesExternal(n,this.dirname(e)),this._readResourcesInternal(n),n}async readJSON(e){return e=this._copyJSON(e),this._readResourcesInternal(e),Xe.read(e,{extensions:Array.from(this._extensions),dependencies:this._dependencies,logger:this._logger})}async binaryToJSON(e){let t=this._binaryToJSON(C.assertView(e));this._readResourcesInternal(t);let n=t.json;if(n.buffers&&n.buffers.some(e=>ft(t,e)))throw Error(`Cannot resolve external buffers with binaryToJSON().`);if(n.images&&n.images.some(e=>pt(t,e)))throw Error(`Cannot resolve external images with binaryToJSON().`);return t}async readBinary(e){return this.readJSON(await this.binaryToJSON(C.assertView(e)))}async writeJSON(e,t={}){if(t.format===`GLB`&&e.getRoot().listBuffers().length>1)throw Error(`GLB must have 0–1 buffers.`);return lt.write(e,{format:t.format||`GLTF`,basename:t.basename||``,logger:this._logger,vertexLayout:this._vertexLayout,dependencies:{...this._dependencies},extensions:Array.from(this._extensions)})}async writeBinary(e){let{json:t,resources:n}=await this.writeJSON(e,{format:`GLB`}),r=new Uint32Array([1179937895,2,12]),i=JSON.stringify(t),a=C.pad(C.encodeText(i),32),o=C.toView(new Uint32Array([a.byteLength,1313821514])),s=C.concat([o,a]);r[r.length-1]+=s.byteLength;let c=Object.values(n)[0];if(!c||!c.byteLength)return C.concat([C.toView(r),s]);let l=C.pad(c,0),u=C.toView(new Uint32Array([l.byteLength,5130562])),d=C.concat([u,l]);return r[r.length-1]+=d.byteLength,C.concat([C.toView(r),s,d])}async _readResourcesExternal(e,t){let n=e.json.images||[],r=e.json.buffers||[],i=[...n,...r].map(async r=>{let i=r.uri;if(!i||i.match(/data:/))return Promise.resolve();try{e.resources[i]=await this.readURI(this.resolve(t,i),`view`),this.lastReadBytes+=e.resources[i].byteLength}catch(t){if(!this._strictResources&&n.includes(r))this._logger.warn(`Failed to load image URI, "${i}". ${t}`),e.resources[i]=null;else throw t}});await Promise.all(i)}_readResourcesInternal(e){function t(t){if(t.uri){if(t.uri in e.resources)C.assertView(e.resources[t.uri]);else if(t.uri.match(/data:/)){let n=`__${Te()}.${T.extension(t.uri)}`;e.resources[n]=C.createBufferFromDataURI(t.uri),t.uri=n}}}(e.json.images||[]).forEach(e=>{if(e.bufferView===void 0&&e.uri===void 0)throw Error(`Missing resource URI or buffer view.`);t(e)}),(e.json.buffers||[]).forEach(t)}_copyJSON(e){let{images:t,buffers:n}=e.json;return e={json:{...e.json},resources:{...e.resources}},t&&(e.json.images=t.map(e=>({...e}))),n&&(e.json.buffers=n.map(e=>({...e}))),e}_binaryToJSON(e){if(!mt(e))throw Error(`Invalid glTF 2.0 binary.`);let t=new Uint32Array(e.buffer,e.byteOffset+12,2);if(t[1]!==1313821514)throw Error(`Missing required GLB JSON chunk.`);let n=t[0],r=C.decodeText(C.toView(e,20,n)),i=JSON.parse(r),a=20+n;if(e.byteLength<=a)return{json:i,resources:{}};let o=new Uint32Array(e.buffer,e.byteOffset+a,2);if(o[1]!==5130562)return{json:i,resources:{}};let s=o[0],c=C.toView(e,a+8,s);return{json:i,resources:{[v]:c}}}};function ft(e,t){return t.uri!==void 0&&!(t.uri in e.resources)}function pt(e,t){return t.uri!==void 0&&!(t.uri in e.resources)&&t.bufferView===void 0}function mt(e){if(e.byteLength<3*Uint32Array.BYTES_PER_ELEMENT)return!1;let t=new Uint32Array(e.buffer,e.byteOffset,3);return t[0]===1179937895&&t[1]===2}var ht=class extends dt{_fetchConfig;constructor(e=se.DEFAULT_INIT){super(),this._fetchConfig=e}async readURI(e,t){let n=await fetch(e,this._fetchConfig);switch(t){case`view`:return new Uint8Array(await n.arrayBuffer());case`text`:return n.text()}}resolve(e,t){return se.resolve(e,t)}dirname(e){return se.dirname(e)}},P=(e,t)=>[e[0]+t[0],e[1]+t[1],e[2]+t[2]],F=(e,t)=>[e[0]-t[0],e[1]-t[1],e[2]-t[2]],I=(e,t)=>[t*e[0],t*e[1],t*e[2]],L=(e,t)=>e[0]*t[0]+e[1]*t[1]+e[2]*t[2],gt=e=>Math.sqrt(L(e,e)),R=(e,t)=>[e[1]*t[2]-e[2]*t[1],e[2]*t[0]-e[0]*t[2],e[0]*t[1]-e[1]*t[0]];function z(e){let t=gt(e);return t>0?I(e,1/t):[0,0,1]}function _t(e,t){return e.map((n,r)=>[0,1,2,3].reduce((n,i)=>n+e[r%4+4*i]*t[r-r%4+i],0))}function vt(e,t){return[e[0]*t[0]+e[4]*t[1]+e[8]*t[2]+e[12],e[1]*t[0]+e[5]*t[1]+e[9]*t[2]+e[13],e[2]*t[0]+e[6]*t[1]+e[10]*t[2]+e[14]]}function yt(e){let t=[e[0],e[1],e[2]],n=[e[4],e[5],e[6]],r=[e[8],e[9],e[10]],i=L(t,R(n,r))<0?-1:1;return[I(R(n,r),i),I(R(r,t),i),I(R(t,n),i)]}function bt(e){return Math.floor(Math.sqrt(Math.min(Math.max(e,0),1))*255+.5)}function xt(e,t,n){let r=(e,t)=>[e[3*t],e[3*t+1],e[3*t+2]];for(let i=0;i<n.length;i+=3){let[a,o,s]=[n[i],n[i+1],n[i+2]],c=r(e,a),l=R(F(r(e,o),c),F(r(e,s),c));L(l,r(t,a))+L(l,r(t,o))+L(l,r(t,s))<0&&(n[i+1]=s,n[i+2]=o)}}var St=4e6,Ct=6*St,wt=32e6,Tt=2**28,Et=256*2**20,Dt=4,Ot=5,kt=6,At={33071:`clamp-to-edge`,33648:`mirror-repeat`,10497:`repeat`},jt=[`opaque`,`mixed`,`transparent`],Mt=/^KHR_(mesh_quantization|materials_(?!pbrSpecularGlossiness).*)$/;async function Nt(e,t){if(t.size>Et)throw new n(`${e} is larger than ${Et/2**20} MiB.`,`Open a smaller file.`);let r=await t.arrayBuffer().catch(()=>{throw new n(`${e} cannot be read.`,`It may be a folder, or have changed on the disk: choose it again.`)});try{let t=await It(e,await Pt(e,new Uint8Array(r)));if(t.every(e=>e.mesh.corners.length===0))throw new n(`${e} has nothing to draw.`,`Check that it has meshes of triangles in a scene.`);return Ut(e,t)}catch(t){throw t instanceof RangeError?new n(`${e} is too large.`,`Open a smaller file.`):t}}async function Pt(e,t){try{let r=new ht().setLogger(new D(D.Verbosity.SILENT)),i=await r.binaryToJSON(t),a=(i.json.extensionsRequired??[]).filter(e=>!Mt.test(e));if(a.length>0)throw new n(`${e} needs ${a.join(`, `)}, which is not supported here.`,`Export it without.`);i.json.extensionsRequired=[];let o=(i.json.accessors??[]).map(({count:e})=>e);if(!o.every(e=>Number.isInteger(e)&&e>0))throw Error(`a count is none`);let s=o.reduce((e,t)=>e+t,0);if(s>wt)throw Ft(e,s,`elements of attributes and indices`);return await r.readJSON(i)}catch(t){throw t instanceof n?t:new n(`${e} cannot be read as binary glTF.`,`Check it with a glTF validator; it has to be one .glb file.`)}}var Ft=(e,t,r)=>new n(`${e} has ${t.toLocaleString(`en`)} ${r} or more.`,`Open a smaller file.`);async function It(e,t){let n=t.getRoot(),r=n.getDefaultScene()??n.listScenes()[0],i=new Map,a=new Map,o=new Map,s=[],c=(r?.listChildren()??[]).map(e=>({node:e,matrix:e.getMatrix()})),[l,u]=[0,0];for(let{node:t,matrix:n}of c){for(let e of t.listChildren())c.push({node:e,matrix:_t(n,e.getMatrix())});for(let r of t.getMesh()?.listPrimitives()??[]){if(![Dt,Ot,kt].includes(r.getMode())||!r.getAttribute(`POSITION`))continue;let t=zt(r);if(l+=t.vertices,u+=t.corners,l>St)throw Ft(e,l,`vertices`);if(u>Ct)throw Ft(e,Math.floor(u/3),`triangles`);s.push({primitive:r,matrix:n})}}let d=[];for(let{primitive:t,matrix:n}of s){let r=t.getMaterial();i.has(r)||i.set(r,await Lt(e,r,o));let s=i.get(r);a.has(t)||a.set(t,Bt(t,s.uv));let c=a.get(t),l=yt(n);d.push({points:c.points.map(e=>vt(n,e)),normals:c.normals.map(e=>z([0,1,2].map(t=>l[0][t]*e[0]+l[1][t]*e[1]+l[2][t]*e[2]))),mesh:c,look:s})}return d}async function Lt(e,t,n){let r=t?.getAlphaMode()??`OPAQUE`,i=(t?.getBaseColorFactor()??[1,1,1,1]).map(e=>Math.min(Math.max(e,0),1)),a=t?await Rt(e,t,n):null,o=r===`MASK`?t?.getAlphaCutoff()??.5:0,s=Math.floor(i[3]*255+.5),c=a||r===`MASK`||s===255?`mixed`:`transparent`;(r===`OPAQUE`||!a&&s===255)&&(c=`opaque`);let l=+(t?.getBaseColorTextureInfo()?.getTexCoord()===1),u=[1,1,1,1],d=`TEXCOORD_${l}`;return{layer:c,image:a,scale:a?i:u,threshold:o,base:a?u:i,uv:d}}async function Rt(e,t,r){let i=t.getBaseColorTexture(),a=i?.getImage();if(!i||!a)return null;let o=r.get(i);if(!o){let t=new Blob([a],{type:i.getMimeType()});try{let n=[i.getSize()??[0,0],...[...r.values()].map(({width:e,height:t})=>[e,t])].reduce((e,[t,n])=>e+t*n,0);if(n>Tt)throw Ft(e,n,`pixels of images`);o=await createImageBitmap(t,{colorSpaceConversion:`none`,premultiplyAlpha:`none`})}catch(t){throw t instanceof n?t:new n(`An image in ${e} cannot be read.`,`Export it with PNG or JPEG images.`)}r.set(i,o)}let s=t.getBaseColorTextureInfo(),c=[s?.getWrapS(),s?.getWrapT()].map(e=>At[e??10497]??`repeat`);return{pixels:o,wrap:c}}function zt(e){let t=e.getAttribute(`POSITION`).getCount(),n=e.getIndices()?.getCount()??t,r=e.getMode()===Dt?n:3*n,i=e.getAttribute(`NORMAL`);return{vertices:i?.getCount()!==t||i.getElementSize()<3?Math.max(t,r):t,corners:r}}function Bt(e,t){let n=e.getAttribute(`POSITION`).getCount(),r=(t,r)=>{let i=e.getAttribute(t);return i?.getCount()!==n||i.getElementSize()<r?[]:Array.from({length:n},(e,t)=>i.getElement(t,[]).slice(0,r))},i=r(`POSITION`,3),a=e.getIndices(),o=a?Array.from(a.getArray()??[]):i.map((e,t)=>t),s={points:i,normals:r(`NORMAL`,3),uvs:r(t,2),corners:Vt(o,e.getMode(),i.length)};return s.normals.length===i.length?s:Ht(s)}function Vt(e,t,n){let r=[],i=t===Dt?3:1;for(let a=2;a<e.length;a+=i){let i=[t===kt?e[0]:e[a-2],e[a-1],e[a]];i.every(e=>e<n)&&r.push(...i)}return r}function Ht(e){let t=e.corners.map(t=>e.points[t]);return{points:t,normals:t.map((e,n)=>{let[r,i,a]=[0,1,2].map(e=>t[n-n%3+e]);return z(R(F(i,r),F(a,r)))}),uvs:e.uvs.length?e.corners.map(t=>e.uvs[t]):[],corners:t.map((e,t)=>t)}}function Ut(e,t){let r=[1/0,1/0,1/0],i=[-1/0,-1/0,-1/0];for(let{points:e}of t)for(let t of e)for(let e=0;e<3;++e)r[e]=Math.min(r[e],t[e]),i[e]=Math.max(i[e],t[e]);let a=I([r[0]+i[0],r[1]+i[1],r[2]+i[2]],.5);if(![...a,...F(i,a)].every(e=>Number.isFinite(Math.fround(e))))throw new n(`${e} has points that are not finite.`,`Look for NaN or huge numbers in it.`);let o=t.reduce((e,t)=>e+t.points.length,0),s=t.reduce((e,t)=>e+t.mesh.corners.length,0),c={name:e,positions:new Float32Array(3*o),normals:new Float32Array(3*o),uvs:new Float32Array(2*o),colours:new Uint8Array(4*o),indices:new Uint32Array(s),up:[0,1,0]},l=Wt(c,t,a);return xt(c.positions,c.normals,c.indices),{...c,batches:l,bounds:[F(r,a),F(i,a)]}}function Wt(e,t,n){let r=new Map;for(let e of t){let t=e.look.image?e.look:`${e.look.layer} ${e.look.threshold}`,n=r.get(t);n?n.push(e):r.set(t,[e])}let i=[],a=0,o=0;for(let t of[...r.values()].sort((e,t)=>Gt(e[0].look)-Gt(t[0].look))){let r=o;for(let{points:r,normals:i,mesh:s,look:c}of t){let t=[...c.base.slice(0,3).map(bt),Math.floor(c.base[3]*255+.5)];for(let t of s.corners)e.indices[o++]=a+t;r.forEach((r,o)=>{e.positions.set(F(r,n),3*a),e.normals.set(i[o],3*a),e.uvs.set(s.uvs[o]??[0,0],2*a),e.colours.set(t,4*a),++a})}let{layer:s,image:c,scale:l,threshold:u}=t[0].look;i.push({first:r,count:o-r,layer:s,image:c,scale:l,threshold:u})}return i.filter(e=>e.count>0)}var Gt=e=>jt.indexOf(e.layer);function Kt(e){let t=z(F(e.eye,e.target)),n=z(R(e.up,t));return{right:n,over:R(t,n),back:t}}function qt(e){return Array.from({length:8},(t,n)=>[e[n&1][0],e[n>>1&1][1],e[n>>2&1][2]])}function Jt(e,t){let{back:n}=Kt(e),r=qt(t).map(t=>L(F(e.eye,t),n)),i=gt(F(t[1],t[0]))||1,a=Math.max(Math.max(...r)+.001*i,.001*i),o=Math.max(Math.min(...r)-.001*i,1e-4*a);return[Math.min(o,.5*a),a]}function Yt(e,t,n,r,i){let{right:a,over:o,back:s}=Kt(e),[c,l]=Jt(e,t),u=1/Math.tan(e.fov*Math.PI/360),d=r/i,f=[a[0],o[0],s[0],0,a[1],o[1],s[1],0,a[2],o[2],s[2],0,-L(a,e.eye),-L(o,e.eye),-L(s,e.eye),1],p=[u/d,0,0,0,0,u,0,0,0,0,l/(c-l),-1,0,0,c*l/(c-l),0],m=[2*d/(r*u),-2/(i*u),-d/u,1/u],h=new ArrayBuffer(176),g=[...f,...p,...m,L(a,n),L(o,n),L(s,n),0,c,l];return new Float32Array(h).set(g),new Uint32Array(h).set([r,i],g.length),h}var Xt=1.02;function Zt(e,t,n,r=38){let i=I(P(e[0],e[1]),.5),a=B({eye:P(i,[0,0,1]),target:i,up:t,fov:r},25,20,1),{right:o,over:s,back:c}=Kt(a),l=Math.tan(r*Math.PI/360),u=qt(e).map(e=>{let t=F(e,i);return Math.max(Math.abs(L(t,o))/(l*n),Math.abs(L(t,s))/l)+L(t,c)});return{...a,eye:P(i,I(c,Math.max(Xt*Math.max(...u),1e-6)))}}function B(e,t,n,r){let i=F(e.eye,e.target),a=gt(i),o=z(e.up),s=Math.asin(Math.min(Math.max(L(i,o)/a,-1),1)),c=z(F(i,I(o,L(i,o)))),l=t*Math.PI/180,u=P(I(c,Math.cos(l)),I(R(o,c),Math.sin(l))),d=85*Math.PI/180,f=Math.min(Math.max(s+n*Math.PI/180,-d),d),p=P(I(u,Math.cos(f)),I(o,Math.sin(f)));return{...e,eye:P(e.target,I(p,a*r))}}function Qt(e,t,n){let r=Kt(e),i=2*Math.tan(e.fov*Math.PI/360)*gt(F(e.eye,e.target)),a=P(I(r.right,t*i),I(r.over,n*i));return{...e,eye:P(e.eye,a),target:P(e.target,a)}}var $t=6,en=.88;function tn(e,t,n){e.addEventListener(`pointerdown`,t=>e.setPointerCapture(t.pointerId)),e.addEventListener(`pointermove`,n=>{if(!e.hasPointerCapture(n.pointerId)||!t.view)return;let r=e.clientHeight,[i,a]=[n.movementX/r,n.movementY/r];t.view=n.shiftKey||n.buttons===2?Qt(t.view,-i,a):B(t.view,-180*i,180*a,1),t.draw()}),e.addEventListener(`contextmenu`,e=>e.preventDefault()),e.addEventListener(`wheel`,e=>{e.preventDefault(),t.view&&(t.view=B(t.view,0,0,Math.exp(Math.min(Math.max(e.deltaY,-200),200)/600)),t.draw())},{passive:!1}),e.addEventListener(`keydown`,e=>{e.ctrlKey||e.metaKey||e.altKey||!r(e.key,e.shiftKey)||e.preventDefault()});function r(e,r){let{view:i}=t;if(!i)return!1;let a={ArrowLeft:[-1,0],ArrowRight:[1,0],ArrowUp:[0,1],ArrowDown:[0,-1]}[e];if(a)t.view=r?Qt(i,.05*a[0],.05*a[1]):B(i,$t*a[0],$t*a[1],1);else if(e===`+`||e===`=`)t.view=B(i,0,0,en);else if(e===`-`)t.view=B(i,0,0,1/en);else if(e===`[`||e===`]`)return n(e===`[`?-.05:.05),!0;else if(e===`0`)return t.home(),!0;else return!1;return t.draw(),!0}}var nn=`// Pixels of the window that every 64 triangles cover, those that overlap counted again: what drawing them will cost,
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
`,rn=`// From the blocks' totals to what the frame has to solve, and where the first round counts. One work group.
@group(0) @binding(0) var<storage, read> blocks: array<vec4u>;  // fragments, occupied, singles, deepest
@group(0) @binding(1) var<storage, read_write> state: State;
@group(0) @binding(2) var<uniform> budget: u32;
var<workgroup> part: array<vec4u, 256>;

fn joined(one: vec4u, two: vec4u) -> vec4u {
    return vec4u(add(one.x, two.x), one.yz + two.yz, max(one.w, two.w));
}

@compute @workgroup_size(256)
fn begin(@builtin(local_invocation_index) lane: u32) {
    var own = vec4u(0u);
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
    state.fragments = own.x;
    state.occupied = own.y;
    state.deepest = own.w;
    state.k_min = select(0u, 1u, budget >= own.y);
    state.complete = select(0u, 1u, budget >= own.x);
    state.left = budget - min(budget, state.k_min * own.z);
    state.low = -LAST;
    state.high = LAST;
    // A warm start counts closely around the last answer: if this frame's is there, the next round finds it.
    let first = state.answer / EDGES * EDGES - EDGES * EDGES / 2;
    for (var j = 0; j < EDGES; j++) {
        if (state.warm == 1u) {
            state.edge[j] = clamp(first + EDGES * j, -LAST, LAST);
        } else {
            state.edge[j] = edge_between(-LAST, LAST, j);
        }
    }
}
`,an=`// Weighted-blended transparency (McGuire and Bavoil 2013), equation 10 with the logarithmic depth of
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
`,on=`// Where a view is seen from.
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
`,sn=`// Every transparent fragment into its pixel's run of the pool, in any order: the sort comes after
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
`,cn=`// Second pass of the chain: every fragment finds its slot by its depth, or goes to the tail
// (renderer/shaders/kbuffer/chain_colour.frag and tail.glsl). Depths and colours are kept inverted.
@group(2) @binding(0) var<storage, read> offsets: array<u32>;  // [P + 1]
@group(2) @binding(1) var<storage, read> depths: array<u32>;
@group(2) @binding(2) var<storage, read_write> colours: array<atomic<u32>>;
@group(2) @binding(3) var<storage, read> statistics: array<Statistics>;
@group(2) @binding(4) var<storage, read> gathered: array<u32>;  // [P][GATHERED]

// Share of D in front of a bin.
fn share_in_front(p: u32, bin: u32) -> f32 {
    if (bin == 0u) {
        return 0.0;
    }
    if (bin == BINS) {
        return 1.0;
    }
    return f32((gathered[share_word(p, bin)] >> share_shift(bin)) & SHARE_LEVELS) / f32(SHARE_LEVELS);
}

// Optical depth in front of a fragment, as far as the tail asks for it. With bins: those before its own, and of its
// bin's others, taken as evenly spread.
fn in_front(p: u32, z: f32, own: f32) -> f32 {
    let total = bitcast<f32>(gathered[GATHERED * p]);
    let x = relative_depth(z, statistics[p]);
    if (TAIL == BINNED) {
        let place = bin_place(x);
        let bin = min(u32(place), LAST_BIN);
        let before = total * share_in_front(p, bin);
        let others = total * share_in_front(p, bin + 1u) - before - own;
        return before + max(others, 0.0) * (place - f32(bin));
    }
    return select(0.0, DENSITY_G * total * x, TAIL == DENSITY);
}

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
fn chain_colour(in: Surface) -> @location(0) vec4f {  // sum w C, sum w
    let stored = stored_surface(in);
    if (is_hidden(in) || !is_transparent(stored)) {
        discard;
        return vec4f(0.0);
    }
    let p = pixel_of(in);
    let end = offsets[p + 1u];
    let z = ~depth_bits(in);
    var word = ~pack(stored);
    for (var i = first_slot_not_nearer(offsets[p], end, z); i < end && depths[i] == z; i++) {
        let before = atomicMax(&colours[i], word);
        if (before == 0u) {  // it found a free slot: nothing is left for the tail
            discard;
            return vec4f(0.0);
        }
        word = min(word, before);
    }
    let fallen = vec4f(unpack(~word)) / 255.0;
    let exponent = in_front(p, bitcast<f32>(~z), -log(1.0 - fallen.a));
    let weight = fallen.a * exp(-min(exponent, MAX_EXPONENT));
    return vec4f(weight * fallen.rgb * fallen.rgb, weight);
}
`,ln=`// First pass of the two-pass chain: the k(p) smallest depths, lock-free and in any order of arrival
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
`,un=`// Which edges hold the budget between them; where the next round counts. One work group.
@group(0) @binding(0) var<storage, read_write> state: State;
@group(0) @binding(1) var<storage, read> counts: array<u32>;  // [blocks][EDGES]
const SLICES = 256u / u32(EDGES);
var<workgroup> part: array<u32, 256>;

@compute @workgroup_size(256)
fn choose(@builtin(local_invocation_index) lane: u32) {
    var own = 0u;
    for (var row = lane / u32(EDGES); row < arrayLength(&counts) / u32(EDGES); row += SLICES) {
        own = add(own, counts[row * u32(EDGES) + lane % u32(EDGES)]);
    }
    part[lane] = own;
    workgroupBarrier();
    if (lane > 0u || state.complete == 1u || is_found(state.low, state.high)) {
        return;
    }
    for (var j = 0u; j < u32(EDGES); j++) {
        var sum = 0u;
        for (var slice = 0u; slice < SLICES; slice++) {
            sum = add(sum, part[slice * u32(EDGES) + j]);
        }
        if (sum > state.left) {
            state.high = state.edge[j];
            break;
        }
        state.low = state.edge[j];
    }
    let low = state.low;
    let high = state.high;
    state.answer = low;
    state.warm = 1u;
    for (var j = 0; j < EDGES; j++) {
        state.edge[j] = edge_between(low, high, j);
    }
}
`,dn=`// n(p) and the depth range of p. \`near\` is kept inverted, so that cleared buffers begin at zero everywhere.
struct Statistics {
    n: atomic<u32>,
    near: atomic<u32>,  // ~ of the least depth's bits
    far: atomic<u32>,
}

@group(2) @binding(0) var<storage, read_write> statistics: array<Statistics>;

@fragment
fn count_fragments(in: Surface) {
    let stored = stored_surface(in);
    if (is_hidden(in) || !is_transparent(stored)) {
        return;
    }
    let p = pixel_of(in);
    let z = depth_bits(in);
    atomicAdd(&statistics[p].n, 1u);
    atomicMax(&statistics[p].near, ~z);
    atomicMax(&statistics[p].far, z);
}
`,fn=`// A triangle that covers the window.
@vertex
fn cover(@builtin(vertex_index) corner: u32) -> @builtin(position) vec4f {
    return vec4f(select(-1.0, 3.0, corner == 1u), select(-1.0, 3.0, corner == 2u), 0.0, 1.0);
}
`,pn=`// The bundle's network on the gathered sums of every pixel with a choice: a and 1 / b of log gain(k) = a - b (k - 1)
// (renderer/shaders/kbuffer-deep/curves.comp). An importance w is a curve, too: k = floor(t w) at the price t.
@group(0) @binding(0) var<storage, read> state: State;
@group(0) @binding(1) var<storage, read> statistics: array<Statistics>;
@group(0) @binding(2) var<storage, read> gathered: array<u32>;
@group(0) @binding(3) var<storage, read_write> curves: array<vec2f>;
@group(0) @binding(4) var background: texture_2d<f32>;
@group(0) @binding(5) var sums0: texture_2d<f32>;
@group(0) @binding(6) var sums1: texture_2d<f32>;
@group(0) @binding(7) var sums2: texture_2d<f32>;
@group(0) @binding(8) var sums3: texture_2d<f32>;

// \`clamp\`, and the least for NaN, which a network that overflows can answer.
fn within(x: f32, least: f32, most: f32) -> f32 {
    let is_nan = (bitcast<u32>(x) & 0x7fffffffu) > 0x7f800000u;
    return select(clamp(x, least, most), least, is_nan);
}

fn sums_of(p: u32) -> array<vec4f, 11> {
    let here = statistics[p];
    let second = texel_of(sums2, p);
    let third = texel_of(sums3, p);
    let word = ~gathered[GATHERED * p + 1u];
    var s: array<vec4f, 11>;
    s[0] = vec4f(f32(here.n), second.w, third.w, bitcast<f32>(gathered[GATHERED * p]));
    s[1] = texel_of(sums0, p);
    s[2] = texel_of(sums1, p);
    s[3] = vec4f(second.rgb, nearest(here));
    s[4] = vec4f(third.rgb, bitcast<f32>(here.far));
    s[5] = vec4f(vec4u(word, word >> 8u, word >> 16u, word >> 24u) & vec4u(255u)) / 255.0;
    s[6] = vec4f(texel_of(background, p).rgb, 0.0);
    for (var b = 1u; b < BINS; b++) {  // bin b here is bin EVERY b of 16
        let share = (gathered[share_word(p, b)] >> share_shift(b)) & SHARE_LEVELS;
        let j = EVERY * b - 1u;
        s[7u + j / 4u][j % 4u] = f32(share) / f32(SHARE_LEVELS);
    }
    return s;
}

@compute @workgroup_size(64)
fn predict_curves(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let p = thread_of(id, groups);
    if (p >= arrayLength(&curves) || state.complete == 1u || statistics[p].n <= state.k_min) {
        return;
    }
    let y = Answer(diaphane_predict(diaphane_features(sums_of(p))));
    var curve = vec2f(y.x, 1.0 / y.y);
    if (DIAPHANE_OUTPUTS == 1) {
        curve = vec2f(-1.5 / y.x, y.x);
    }
    curves[p] = vec2f(within(curve.x, -MOST_GAIN, MOST_GAIN), within(curve.y, LEAST_RATE, MOST_RATE));
}
`,mn=`// Depth bins of the binned density tails (METHOD.md section 2): renderer/shaders/common/depth_bins.glsl in WGSL.
// GATHERED words a pixel: D; ~ of the nearest packed colour; then, while fragments are gathered, units of the bins, 16
// bits each, and after it the shares of D in front of bins 1 to BINS - 1, 4 bits each; the nearest lowest.

// Bin and position in it, in [0, BINS]; x is the relative depth.
fn bin_place(x: f32) -> f32 {
    return (PLAIN_SHARE * x + ROOT_SHARE * sqrt(x)) * f32(BINS);
}

// Word and bit of the share in front of a bin, from 1 on.
fn share_word(p: u32, bin: u32) -> u32 {
    return GATHERED * p + 2u + (bin - 1u) / 8u;
}

fn share_shift(bin: u32) -> u32 {
    return 4u * ((bin - 1u) & 7u);
}
`,hn=`// Sum of squared differences of two pictures' sRGB bytes, by block: integers, so exact. 2048 pixels fit a word.
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
`,gn=`// What a screen gets of linear light: one word a pixel, sRGB in three bytes and in the highest one k, up to 255.
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
`,_n=`// Offsets of the fixed k-buffer: the same number of slots for every pixel of the window.
@group(0) @binding(0) var<storage, read_write> offsets: array<u32>;  // [P + 1]
@group(0) @binding(1) var<uniform> budget: u32;

@compute @workgroup_size(64)
fn place_fixed(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let p = thread_of(id, groups);
    if (p < arrayLength(&offsets)) {
        offsets[p] = p * (budget / (arrayLength(&offsets) - 1u));
    }
}
`,vn=`// Order-independent sums over all fragments of a pixel (renderer/shaders/gather/gather.frag).
// Integers by atomics: the optical depth and the units of its depth bins, the nearest colour. WebGPU blends neither
// r32float nor rgba16unorm everywhere. Half floats by blending: what else a network reads, packed into four targets, as
// many as every device has room for.
struct Sums {
    @location(0) rgb_x: vec4f,          // sum rgb, sum x
    @location(1) alpha_rgb_x2: vec4f,   // sum a rgb, sum x^2
    @location(2) rgb2_alpha: vec4f,     // sum rgb^2, sum a
    @location(3) rgb_x_alpha2: vec4f,   // sum rgb x, sum a^2
}

@group(2) @binding(0) var<storage, read> statistics: array<Statistics>;
@group(2) @binding(1) var<storage, read_write> gathered: array<atomic<u32>>;  // [P][GATHERED]; D in OPTICAL_ONE-ths

// Adds to one of a word's halves, up to BIN_LIMIT: a sum beyond it would go on in the other half.
fn add_to_half(at: u32, shift: u32, units: u32) {
    var before = atomicLoad(&gathered[at]);
    loop {
        let room = BIN_LIMIT - ((before >> shift) & BIN_LIMIT);
        if (room == 0u) {
            return;
        }
        let tried = atomicCompareExchangeWeak(&gathered[at], before, before + (min(units, room) << shift));
        if (tried.exchanged) {
            return;
        }
        before = tried.old_value;
    }
}

fn gather(in: Surface, stored: vec4u) -> f32 {
    let p = pixel_of(in);
    let z = depth_bits(in);
    let here = statistics[p];
    let x = relative_depth(bitcast<f32>(z), here);
    let optical_depth = -log(1.0 - f32(stored.a) / 255.0);
    let at = GATHERED * p;
    // Beyond OPTICAL_CEILING nothing is visible, and the sum must not wrap round.
    if (atomicLoad(&gathered[at]) < OPTICAL_CEILING) {
        atomicAdd(&gathered[at], u32(optical_depth * OPTICAL_ONE + 0.5));
    }
    if (~z == here.near) {  // ties: the smaller packed colour
        atomicMax(&gathered[at + 1u], ~pack(stored));
    }
    if (BINS > 0u) {
        let bin = min(u32(bin_place(x)), LAST_BIN);
        let units = u32(max(1.0, floor(optical_depth * OPTICAL_UNIT + 0.5)));
        add_to_half(at + 2u + bin / 2u, 16u * (bin & 1u), units);
    }
    return x;
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
fn gather_all(in: Surface) -> Sums {
    let stored = stored_surface(in);
    if (is_hidden(in) || !is_transparent(stored)) {
        discard;
        return Sums();
    }
    let x = gather(in, stored);
    let rgb = vec3f(stored.rgb) / 255.0;
    let a = f32(stored.a) / 255.0;
    return Sums(vec4f(rgb, x), vec4f(a * rgb, x * x), vec4f(rgb * rgb, a), vec4f(rgb * x, a * a));
}
`,yn=`// The next smaller level of a texture. The texture unit decodes and encodes sRGB: it is light that is averaged.
@group(0) @binding(0) var finer: texture_2d<f32>;
@group(0) @binding(1) var smooth_sampler: sampler;

@fragment
fn halve(@builtin(position) position: vec4f) -> @location(0) vec4f {
    let size = max(textureDimensions(finer) / 2u, vec2u(1u));
    return textureSample(finer, smooth_sampler, position.xy / vec2f(size));
}
`,bn=`// Where each pixel's run of slots begins. What is left of the budget goes to the pixels that grow at the next price, in
// the order of their index (renderer/shaders/allocation/offsets.comp). No run reaches beyond the budget.
@group(0) @binding(0) var<storage, read> state: State;
@group(0) @binding(1) var<storage, read> slots: array<u32>;             // [P]
@group(0) @binding(2) var<storage, read> sums: array<vec2u>;            // [blocks], before each
@group(0) @binding(3) var<storage, read_write> offsets: array<u32>;     // [P + 1]
@group(0) @binding(4) var<uniform> budget: u32;
const OWN = BLOCK / 256u;
var<workgroup> part: array<vec2u, 256>;

@compute @workgroup_size(256)
fn place_slots(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let first = group.x * BLOCK + lane * OWN;
    var here: array<vec2u, OWN>;
    var own = vec2u(0u);
    for (var i = 0u; i < OWN; i++) {
        if (first + i < arrayLength(&slots)) {
            here[i] = vec2u(slots[first + i] & 0xffffu, slots[first + i] >> 16u);
        }
        own += here[i];
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
    var before = add2(sums[group.x], part[lane] - own);
    let spare = budget - min(budget, state.sure);
    for (var i = 0u; i < OWN; i++) {
        if (first + i < arrayLength(&offsets)) {
            offsets[first + i] = min(before.x + min(before.y, spare), budget);
        }
        before = add2(before, here[i]);
    }
}
`,xn=`// The background of every technique: opaque fragments only, stored gamma-2 like the transparent ones.
@fragment
fn opaque_colour(in: Surface) -> @location(0) vec4f {
    let stored = stored_surface(in);
    if (stored.a < 255u) {
        discard;
    }
    return vec4f(stored) / 255.0;
}
`,Sn=`// The gathered depth bins of every pixel, packed in place (renderer/shaders/gather/pack.comp).
@group(0) @binding(0) var<storage, read_write> gathered: array<u32>;  // [P][GATHERED]

@compute @workgroup_size(64)
fn pack_bins(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let p = thread_of(id, groups);
    let at = GATHERED * p;
    if (at + GATHERED > arrayLength(&gathered)) {
        return;
    }
    var front: array<u32, BINS + 1u>;
    for (var b = 0u; b < BINS; b++) {
        front[b + 1u] = front[b] + ((gathered[at + 2u + b / 2u] >> (16u * (b & 1u))) & BIN_LIMIT);
    }
    let total = front[BINS];
    gathered[at] = bitcast<u32>(f32(gathered[at]) / OPTICAL_ONE);
    for (var w = 0u; w < BINS / 8u; w++) {
        var word = 0u;
        for (var j = 0u; j < 8u; j++) {
            let b = 8u * w + j + 1u;
            if (b == BINS || total == 0u) {
                break;
            }
            word |= ((2u * SHARE_LEVELS * front[b] + total) / (2u * total)) << (4u * j);  // to the nearest step
        }
        gathered[at + 2u + w] = word;
    }
}
`,Cn=`// What the passes over pixels share: a pixel for each thread, 64 a group, in two dimensions.
fn thread_of(id: vec3u, groups: vec3u) -> u32 {
    return id.y * groups.x * 64u + id.x;
}

// Of a picture, at a pixel.
fn texel_of(picture: texture_2d<f32>, p: u32) -> vec4f {
    let width = textureDimensions(picture).x;
    return textureLoad(picture, vec2u(p % width, p / width), 0);
}
`,wn=`// The two pictures beside each other, or what one wants to know of them.
struct Shown {
    split: f32,   // column where the right one begins
    what: u32,    // 0: the picture, 1: k, 2: difference to the exact picture
    width: u32,
}

@group(0) @binding(0) var<uniform> wanted: Shown;
@group(0) @binding(1) var<storage, read> left: array<u32>;
@group(0) @binding(2) var<storage, read> right: array<u32>;
@group(0) @binding(3) var<storage, read> exact: array<u32>;

// Colour maps of services/report/colours.py: sRGB anchors, interpolated linearly.
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
`,Tn=`// Fragments of the open pixels of every block at every edge.
@group(0) @binding(0) var<storage, read> state: State;
@group(0) @binding(1) var<storage, read> statistics: array<Statistics>;
@group(0) @binding(2) var<storage, read> curves: array<vec2f>;
@group(0) @binding(3) var<storage, read_write> counts: array<u32>;  // [blocks][EDGES]
const OWN = BLOCK / 128u;
var<workgroup> at: array<f32, EDGES>;
var<workgroup> bin: array<atomic<u32>, EDGES>;

@compute @workgroup_size(128)
fn count_prices(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    if (is_found(state.low, state.high)) {
        return;
    }
    if (lane < u32(EDGES)) {
        at[lane] = price(state.edge[lane]);
    }
    var own: array<vec2f, OWN>;
    var most: array<u32, OWN>;  // 0: it is not open, and has none at any price
    for (var i = 0u; i < OWN; i++) {
        let p = group.x * BLOCK + i * 128u + lane;
        if (p < arrayLength(&statistics)) {
            let n = usable(statistics[p].n);
            if (n > state.k_min && state.complete == 0u) {
                own[i] = curves[p];
                most[i] = n;
            }
        }
    }
    workgroupBarrier();
    for (var j = 0u; j < u32(EDGES); j++) {
        let here = (j + lane) % u32(EDGES);  // neighbours add to different bins
        var sum = 0u;
        for (var i = 0u; i < OWN; i++) {
            sum += fragments_at(at[here], own[i], min(state.k_min, most[i]), most[i]);
        }
        atomicAdd(&bin[here], sum);
    }
    workgroupBarrier();
    if (lane < u32(EDGES)) {
        counts[group.x * u32(EDGES) + lane] = atomicLoad(&bin[lane]);
    }
}
`,En=`// Fragments of a pixel at a price (renderer/shaders/allocation/curve.glsl): floor(1.5 + (a + t) / b), t = -log lambda,
// within [k_min, n]. Prices are t = +-(2^e (1 + j / 2^(23 - SHIFT)) - 1), counted up from 0.
fn price(index: i32) -> f32 {
    let magnitude = bitcast<f32>(0x3f800000u + (u32(abs(index)) << SHIFT)) - 1.0;
    return select(magnitude, -magnitude, index < 0);
}

fn fragments_at(t: f32, curve: vec2f, least: u32, most: u32) -> u32 {
    return u32(clamp((curve.x + t) * curve.y + 1.5, f32(least), f32(most)));
}
`,Dn=`// The colour of all fragments as one weighted mean, with their total transmittance.
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
    let root = texel_of(background, p).rgb;
    let sum = texel_of(sums, p);
    var colour = root * root;
    if (sum.a > 0.0) {
        let through = exp(-texel_of(depths, p).r);
        colour = (1.0 - through) * (sum.rgb / sum.a) + through * colour;
    }
    shown[p] = display_word(colour, 0u);
}
`,On=`// Core front to back, then the tail, then the background (renderer/shaders/kbuffer/resolve.frag).
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
`,kn=`// Each pixel's sorted run, composited front to back.
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
`,An=`// Exclusive prefix sums over the blocks, in place. One work group: each thread has a run of them.
@group(0) @binding(0) var<storage, read_write> state: State;
@group(0) @binding(1) var<storage, read_write> sums: array<vec2u>;  // [blocks]
var<workgroup> part: array<vec2u, 256>;

@compute @workgroup_size(256)
fn scan(@builtin(local_invocation_index) lane: u32) {
    let blocks = arrayLength(&sums);
    let run = (blocks + 255u) / 256u;
    let first = min(lane * run, blocks);
    let end = min(first + run, blocks);
    var own = vec2u(0u);
    for (var i = first; i < end; i++) {
        own = add2(own, sums[i]);
    }
    part[lane] = own;
    workgroupBarrier();
    if (lane == 0u) {
        var before = vec2u(0u);
        for (var i = 0u; i < 256u; i++) {
            let here = part[i];
            part[i] = before;
            before = add2(before, here);
        }
        state.sure = before.x;
    }
    workgroupBarrier();
    var before = part[lane];
    for (var i = first; i < end; i++) {
        let here = sums[i];
        sums[i] = before;
        before = add2(before, here);
    }
}
`,jn=`// The bundle's network on the rows of its manifest's self-test.
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
    let y = Answer(diaphane_predict(x));
    for (var i = 0u; i < DIAPHANE_OUTPUTS; i++) {
        answers[row * DIAPHANE_OUTPUTS + i] = y[i];
    }
}
`,Mn=`// What every pixel gets at the found price, and by how much it grows at the next one; both fit 16 bits. Kept as
// integers: later passes need not round as this one does for the budget to be met.
@group(0) @binding(0) var<storage, read> state: State;
@group(0) @binding(1) var<storage, read> statistics: array<Statistics>;
@group(0) @binding(2) var<storage, read> curves: array<vec2f>;
@group(0) @binding(3) var<storage, read_write> slots: array<u32>;       // [P], low half: slots, high half: growth
@group(0) @binding(4) var<storage, read_write> sums: array<vec2u>;      // [blocks]
var<workgroup> sure: atomic<u32>;
var<workgroup> growth: atomic<u32>;

fn slots_of(p: u32) -> vec2u {
    let most = usable(statistics[p].n);
    if (state.complete == 1u || most <= state.k_min) {
        return vec2u(most, 0u);
    }
    let low = fragments_at(price(state.low), curves[p], state.k_min, most);
    return vec2u(low, max(fragments_at(price(state.high), curves[p], state.k_min, most), low) - low);
}

@compute @workgroup_size(256)
fn find_slots(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    var own = vec2u(0u);
    for (var i = 0u; i < BLOCK / 256u; i++) {
        let p = group.x * BLOCK + i * 256u + lane;
        if (p < arrayLength(&slots)) {
            let here = slots_of(p);
            slots[p] = here.x | (here.y << 16u);
            own += here;
        }
    }
    atomicAdd(&sure, own.x);
    atomicAdd(&growth, own.y);
    workgroupBarrier();
    if (lane == 0u) {
        sums[group.x] = vec2u(atomicLoad(&sure), atomicLoad(&growth));
    }
}
`,Nn=`// Sorts each pixel's run by depth, then packed colour: heapsort, in place.
@group(0) @binding(0) var<storage, read> offsets: array<u32>;        // [P + 1]
@group(0) @binding(1) var<storage, read_write> pool: array<vec2u>;   // packed colour, depth bits

fn comes_before(one: vec2u, two: vec2u) -> bool {
    return one.y < two.y || (one.y == two.y && one.x < two.x);
}

// Puts a fragment into the heap of \`count\` fragments from \`base\` on whose place \`hole\` is free.
fn sift(base: u32, count: u32, hole: u32, fragment: vec2u) {
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
    let n = offsets[p + 1u] - base;
    for (var i = n / 2u; i > 0u; i--) {
        sift(base, n, i - 1u, pool[base + i - 1u]);
    }
    for (var last = n; last > 1u; last--) {
        let farthest = pool[base];
        sift(base, last - 1u, 0u, pool[base + last - 1u]);
        pool[base + last - 1u] = farthest;
    }
}
`,Pn=`// What the passes of an allocation tell each other (renderer/shaders/allocation/state.glsl); \`warm\` and \`answer\` stay.
struct State {
    fragments: u32,    // N
    occupied: u32,     // pixels with fragments
    deepest: u32,      // fragments of the fullest pixel
    k_min: u32,        // 1 where the budget covers every occupied pixel
    complete: u32,     // 1 where it covers every fragment
    left: u32,         // budget of the open pixels: those whose k their count alone does not settle
    sure: u32,         // slots of all pixels at the price \`low\`
    low: i32,          // greatest index of a price known to be within the budget
    high: i32,         // an index above \`low\` that is beyond it, or LAST
    warm: u32,         // 1: \`answer\` is the index of an earlier frame's price
    answer: i32,
    edge: array<i32, EDGES>,  // indices of the prices that the next round counts at
}

const CEILING = 0x7fffffffu;  // sums stop here, above any budget

// Sums that stop at CEILING are the same in any order.
fn add(one: u32, two: u32) -> u32 {
    return min(one + two, CEILING);
}

fn add2(one: vec2u, two: vec2u) -> vec2u {
    return min(one + two, vec2u(CEILING));
}

// A pixel's fragments that can have a slot: no more than one shader can visit.
fn usable(n: u32) -> u32 {
    return min(n, TURNS);
}

// Whether the budget lies between neighbouring prices: later rounds have nothing to do.
fn is_found(low: i32, high: i32) -> bool {
    return high - low <= 1;
}

// Edge j of a round between two indices, evenly spread.
fn edge_between(low: i32, high: i32, j: i32) -> i32 {
    let apart = (high - low + EDGES) / (EDGES + 1);
    return min(low + apart * (j + 1), high);
}
`,Fn=`// What the count pass has left of a pixel.
struct Statistics {
    n: u32,
    near: u32,  // ~ of the least depth's bits
    far: u32,
}

fn nearest(here: Statistics) -> f32 {
    return bitcast<f32>(~here.near);
}

fn extent(here: Statistics) -> f32 {
    return bitcast<f32>(here.far) - nearest(here);
}

// Depth between the nearest and the farthest fragment, in [0, 1].
fn relative_depth(z: f32, here: Statistics) -> f32 {
    return select(0.0, (z - nearest(here)) / extent(here), extent(here) > 0.0);
}
`,In=`// Geometry and shading, shared by every geometry pass: renderer/shaders/common/surface.{vert,glsl} in WGSL.
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
`,Ln=`// Fragments, occupied pixels, pixels of one fragment and the fullest one's fragments of every block.
@group(0) @binding(0) var<storage, read> statistics: array<Statistics>;
@group(0) @binding(1) var<storage, read_write> blocks: array<vec4u>;
var<workgroup> fragments: atomic<u32>;
var<workgroup> filled: atomic<u32>;
var<workgroup> singles: atomic<u32>;
var<workgroup> deepest: atomic<u32>;

@compute @workgroup_size(256)
fn total_blocks(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    var own = vec3u(0u);
    var most = 0u;
    for (var i = 0u; i < BLOCK / 256u; i++) {
        let p = group.x * BLOCK + i * 256u + lane;
        if (p < arrayLength(&statistics)) {
            let n = usable(statistics[p].n);
            own += vec3u(n, min(n, 1u), select(0u, 1u, n == 1u));
            most = max(most, statistics[p].n);
        }
    }
    atomicAdd(&fragments, own.x);
    atomicAdd(&filled, own.y);
    atomicAdd(&singles, own.z);
    atomicMax(&deepest, most);
    workgroupBarrier();
    if (lane == 0u) {
        blocks[group.x] = vec4u(atomicLoad(&fragments), atomicLoad(&filled), atomicLoad(&singles), atomicLoad(&deepest));
    }
}
`,Rn={"exact-coverage":0,density:0,"weighted-average":0,paper:0,"density-8":8,"density-16":16};function zn(e,t){return Bn(e)?{name:e,bins:Rn[e],g:t}:null}var Bn=e=>Object.hasOwn(Rn,e),Vn={name:`density-16`,bins:Rn[`density-16`],g:0},Hn=Object.assign({"./shaders/areas.wgsl":nn,"./shaders/begin.wgsl":rn,"./shaders/blended.wgsl":an,"./shaders/camera.wgsl":on,"./shaders/capture.wgsl":sn,"./shaders/chain_colour.wgsl":cn,"./shaders/chain_depth.wgsl":ln,"./shaders/choose.wgsl":un,"./shaders/count.wgsl":dn,"./shaders/cover.wgsl":fn,"./shaders/curves.wgsl":pn,"./shaders/depth_bins.wgsl":mn,"./shaders/difference.wgsl":hn,"./shaders/display.wgsl":gn,"./shaders/fixed.wgsl":_n,"./shaders/gather.wgsl":vn,"./shaders/mipmap.wgsl":yn,"./shaders/offsets.wgsl":bn,"./shaders/opaque.wgsl":xn,"./shaders/pack.wgsl":Sn,"./shaders/pixels.wgsl":Cn,"./shaders/present.wgsl":wn,"./shaders/price_counts.wgsl":Tn,"./shaders/prices.wgsl":En,"./shaders/resolve_blended.wgsl":Dn,"./shaders/resolve_chain.wgsl":On,"./shaders/resolve_exact.wgsl":kn,"./shaders/scan.wgsl":An,"./shaders/self_test.wgsl":jn,"./shaders/slots.wgsl":Mn,"./shaders/sort.wgsl":Nn,"./shaders/state.wgsl":Pn,"./shaders/statistics.wgsl":Fn,"./shaders/surface.wgsl":In,"./shaders/totals.wgsl":Ln}),Un=2048,Wn=1884160,Gn=2**31-1,Kn=4096,qn=e=>2+e/2,Jn=1e30,Yn={"exact-coverage":`EXACT_COVERAGE`,density:`DENSITY`,"weighted-average":`WEIGHTED_AVERAGE`,paper:`PAPER`,"density-8":`BINNED`,"density-16":`BINNED`};function Xn({name:e,bins:t,g:n}){return`
${[...new Set(Object.values(Yn))].map((e,t)=>`const ${e} = ${t}u;`).join(`
`)}
const TAIL = ${Yn[e]};
const DENSITY_G = f32(${Math.min(n,Jn)});
const BINS = ${t}u;
const LAST_BIN = ${Math.max(t,1)-1}u;
const EVERY = ${t&&16/t}u;
const GATHERED = ${qn(t)}u;
const ROOT_SHARE = 0.6f;
const PLAIN_SHARE = 0.4f;
const SHARE_LEVELS = 15u;
const OPTICAL_UNIT = 951.0f;
const OPTICAL_ONE = 1048576.0f;
const OPTICAL_CEILING = 0x80000000u;
const BIN_LIMIT = 65535u;
const MAX_EXPONENT = 60.0f;
const BLOCK = ${Un}u;
const EDGES = 64;
const LAST = ${Wn};
const SHIFT = 9u;
const TURNS = ${Kn}u;
const MOST_GAIN = 0x1p100f;
const LEAST_RATE = 0x1p-98f;
const MOST_RATE = 4096.0f;
`}function V(e,t=Vn,n=``){let r=e.map(e=>{let t=Hn[`./shaders/${e}.wgsl`];if(t===void 0)throw Error(`there is no shader ${e}`);return t});return[n,Xn(t),...r].join(`
`)}var Zn=75,Qn=e=>Math.floor(e/Un)+1;function $n(e,t){return Math.min(Math.floor(e*t),Gn-1)}var er=class{#e;#t;#n;constructor(e){this.#e=e,this.#t=Qn(e.pixels),this.#n=e.gpu.filled(new Uint32Array(4),GPUBufferUsage.UNIFORM)}get state(){return this.#e.words(`state`,Zn)}async totals(){let[e,t,n]=await this.#e.gpu.read(this.state);return[e,t,n]}get offsets(){return this.#e.words(`offsets`,this.#e.pixels+1)}get curves(){return this.#e.words(`curves`,2*this.#e.pixels)}get#r(){return this.#e.words(`totals`,4*this.#t)}get#i(){return this.#e.words(`sums`,2*this.#t)}get#a(){return this.#e.words(`slots`,this.#e.pixels)}count(e){let{statistics:t}=this.#e;this.#o(e,[`state`,`statistics`,`totals`],`total_blocks`,[t,this.#r],this.#t)}begin(e,t){this.#e.gpu.device.queue.writeBuffer(this.#n,0,new Uint32Array([Math.min(t,Gn-1)])),this.#o(e,[`state`,`begin`],`begin`,[this.#r,this.state,this.#n],1)}solve(e){let t=this.#e.words(`counts`,64*this.#t),n=[this.state,this.#e.statistics,this.curves,t],r=[`state`,`statistics`,`prices`,`price_counts`];for(let i=0;i<5;++i)this.#o(e,r,`count_prices`,n,this.#t),this.#o(e,[`state`,`choose`],`choose`,[this.state,t],1)}place(e){let{statistics:t}=this.#e,n=[this.state,t,this.curves,this.#a,this.#i];this.#o(e,[`state`,`statistics`,`prices`,`slots`],`find_slots`,n,this.#t),this.#o(e,[`state`,`scan`],`scan`,[this.state,this.#i],1);let r=[this.state,this.#a,this.#i,this.offsets,this.#n];this.#o(e,[`state`,`offsets`],`place_slots`,r,this.#t)}placeFixed(e){this.#e.forPixels(e,[`fixed`],`place_fixed`,[this.offsets,this.#n],{threads:this.#e.pixels+1})}#o(e,t,n,r,i){this.#e.dispatch(e,V(t),n,r,[i,1])}},tr=class extends Error{},nr=class{gpu;isWanted;#e=null;constructor(e,t=()=>!0){this.gpu=e,this.isWanted=t}get encoder(){return this.#e??=this.gpu.device.createCommandEncoder()}submit(){this.#e&&this.gpu.device.queue.submit([this.#e.finish()]),this.#e=null}async pause(){if(this.submit(),await this.gpu.device.queue.onSubmittedWorkDone(),!this.isWanted())throw new tr}},rr=[`picture`,`count`,`error`];async function ir(e,t,n){let r=Qn(e.pixels),i=e.words(`squares`,r),a=new nr(e.gpu);return e.dispatch(a,V([`difference`]),`add_squares`,[t,n,i],[r,1]),a.submit(),(await e.gpu.read(i)).reduce((e,t)=>e+t,0)/(3*e.pixels*255**2)}var ar=e=>e===0?1/0:-10*Math.log10(e),or=class{gpu;#e;#t;#n;constructor(e,t){this.gpu=e;let r=navigator.gpu.getPreferredCanvasFormat(),i=t.getContext(`webgpu`);if(!i)throw new n(`The browser cannot show what WebGPU draws.`,`Update the browser.`);this.#e=i,this.#e.configure({device:e.device,format:r,alphaMode:`opaque`});let a=e.device.createShaderModule({code:V([`cover`,`present`])});this.#t=e.device.createRenderPipeline({layout:`auto`,vertex:{module:a,entryPoint:`cover`},fragment:{module:a,entryPoint:`present`,targets:[{format:r}]}}),this.#n=e.filled(new Uint32Array(4),GPUBufferUsage.UNIFORM)}clear(){let e=this.gpu.device.createCommandEncoder();this.#r(e).end(),this.gpu.device.queue.submit([e.finish()])}show(e,t,n,r,i,a){let{device:s}=this.gpu,c=new ArrayBuffer(16);new Float32Array(c)[0]=n,new Uint32Array(c).set([rr.indexOf(t),e.width],1),s.queue.writeBuffer(this.#n,0,c);let l=s.createCommandEncoder(),u=this.#r(l);u.setPipeline(this.#t);let d=this.#t.getBindGroupLayout(0),f=o([this.#n,r,i,a]);u.setBindGroup(0,s.createBindGroup({layout:d,entries:f})),u.draw(3),u.end(),s.queue.submit([l.finish()])}#r(e){let t=this.#e.getCurrentTexture().createView();return e.beginRenderPass({colorAttachments:[{view:t,loadOp:`clear`,storeOp:`store`,clearValue:[1,1,1,1]}]})}};function H(e){return document.getElementById(e)}var U=new Map;function W(e,t){if(t===null){if(!U.delete(e))return}else t instanceof n?U.set(e,t.message):(U.set(e,`Something went wrong. Load the page again; the browser's console has the details.`),console.error(t));let r=H(`trouble`);r.textContent=[...new Set(U.values())].join(`
`),r.hidden=U.size===0}var sr=new Map;function cr(e,t){t===null?sr.delete(e):sr.set(e,t);let n=[...sr.values()].join(` `);H(`status`).textContent!==n&&(H(`status`).textContent=n)}var lr={};async function ur(e,t,n){let r=(lr[e]??0)+1;lr[e]=r;let i=()=>lr[e]===r;cr(e,t);try{await n(i),i()&&W(e,null)}catch(t){i()&&W(e,t)}i()&&cr(e,null)}function dr(e,t){e.replaceChildren(...t.map(([e,t])=>new Option(t,e)))}function fr(){H(`figures`).replaceChildren(),H(`facts`).textContent=``}function pr(e){let{counted:t,left:n,right:r,width:i,height:a,bytes:o}=e;H(`figures`).replaceChildren(mr(`left`,n),mr(`right`,r));let s=t.occupied?(t.fragments/t.occupied).toFixed(1):`0`;H(`facts`).textContent=`${i} × ${a} pixels, ${hr(t.fragments)} transparent fragments in ${hr(t.occupied)} pixels, ${s} each; ${(o/2**20).toFixed(1)} MiB of buffers.`}function mr(e,t){let n=document.createElement(`tr`),r=document.createElement(`th`);r.scope=`row`,r.textContent=`${e}: ${t.technique}`,n.append(r);let{error:i,slots:a,milliseconds:o}=t,s=e=>i===null?`…`:Number.isNaN(i)?`–`:e(i),c=[s(e=>(1e5*e).toFixed(3)),s(e=>e===0?`exact`:ar(e).toFixed(2)),a?hr(a):`–`,o.toFixed(1)];for(let e of c)n.insertCell().textContent=e;return n}var hr=e=>e.toLocaleString(`en`),gr=({wgsl:e,selfTest:t})=>`${e}\nalias Answer = vec${Math.max(t.outputs[0].length,2)}f;`,_r=[`state`,`statistics`,`depth_bins`,`curves`];function vr(e,t,n,r,i){let a=[e.background,...r.targets].map(e=>e.createView()),o=[i.state,e.statistics,r.gathered,i.curves],s={tail:n.tail,before:gr(n)};e.forPixels(t,_r,`predict_curves`,[...o,...a],s)}async function yr(e,t){let{features:r,outputs:i,output_scale:a,tolerance:o}=t.selfTest,{STORAGE:s,COPY_SRC:c}=GPUBufferUsage;e.device.pushErrorScope(`validation`);let l=e.compute(V([`self_test`],t.tail,gr(t)),`answer_rows`),u=e.filled(new Float32Array(r.flat()),s),d=e.filled(new Float32Array(i.flat().length),s|c),f=e.device.createCommandEncoder(),p=f.beginComputePass();p.setPipeline(l),p.setBindGroup(0,e.bind(l,[u,d])),p.dispatchWorkgroups(Math.ceil(r.length/16)),p.end(),e.device.queue.submit([f.finish()]);let m=new Float32Array((await e.read(d)).buffer),h=await e.device.popErrorScope(),g=i[0].length,_=o[`predict.wgsl`]??0,v=i.flat().every((e,t)=>Math.abs(m[t]-e)<=_*a[t%g]);if(u.destroy(),d.destroy(),h||!v)throw new n(`The network of '${t.name}' ${t.version} does not answer its self-test rightly on this device.`,`Update the browser and the graphics driver; the other techniques work without it.`)}var br=`manifest.json`,xr=`predict.wgsl`,Sr=`diaphane-bundle/2`,Cr=[`format`,`name`,`head`,`outputs`,`features`,`hidden`,`layers`,`tail`,`metric`,`k_min`,`files`,`onnx`,`self_test`,`parity`,`provenance`,`evaluation`],wr=64*2**20,Tr=2**20,Er=16,Dr=256,Or={"gain-curve":[`a,b`,`a,b,g`],importance:[`importance`]};function kr(e){let t=G(JSON.parse(e));if(t.format!==Sr)throw Error(`its format is not ${Sr}`);let n=Cr.filter(e=>!(e in t));if(n.length)throw Error(`${n.join(`, `)} is missing`);let r=Object.keys(t).filter(e=>!Cr.includes(e));if(r.length)throw Error(`${r.join(`, `)} is unknown`);let{name:i,g:a}=G(t.tail),o=zn(String(i),K(a)),s=String(t.head);if(!Object.hasOwn(Or,s)||!Or[s].includes(String(t.outputs)))throw Error(`it has a head that is none, ${s} with ${t.outputs}`);if(!o||o.g<0)throw Error(`it has a tail that is none, ${i}`);let c=Mr(t.features,Dr);for(let e of c.map(G)){if(typeof e.name!=`string`||!(K(e.std)>0))throw Error(`a feature has no spread`);K(e.mean)}let l=Ar(t.files);if(!(`predict.wgsl`in l))throw Error(`there is no ${xr}`);return{tail:o,files:l,selfTest:jr(t,c.length)}}function Ar(e){let t=Object.entries(G(e)).map(([e,t])=>{let{sha256:n,bytes:r}=G(t),i=e===`manifest.json`?Tr:wr;if(!/^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$/.test(e)||!/^[0-9a-f]{64}$/.test(String(n)))throw Error(`a file has no proper name or hash`);if(!Number.isInteger(r)||K(r)<0||K(r)>i)throw Error(`a file has no proper size`);return[e,{sha256:String(n),bytes:K(r)}]});if(t.length===0||t.length>Er)throw Error(`there are no files, or too many`);return Object.fromEntries(t)}function jr(e,t){let n=G(e.self_test),r=Mr(e.outputs,3).length,i=(e,t)=>Mr(e,1024).map(e=>{let n=Mr(e,1024).map(K);if(n.length!==t)throw Error(`the self-test is not of the size of the network`);return n}),a={features:i(n.features,t),outputs:i(n.outputs,r)};if(a.features.length!==a.outputs.length||a.features.length===0)throw Error(`the self-test has no rows, or not as many answers`);let[o]=i([n.output_scale],r),s=Object.fromEntries(Object.entries(G(n.tolerance)).map(([e,t])=>[e,K(t)]));return{...a,output_scale:o,tolerance:s}}function G(e){if(typeof e!=`object`||!e||Array.isArray(e))throw Error(`a member is of another type`);return e}function Mr(e,t){if(!Array.isArray(e)||e.length>t)throw Error(`a list is none, or too long`);return e}function K(e){if(typeof e!=`number`||!Number.isFinite(e))throw Error(`a number is not finite`);return e}async function Nr(e,t,n){let r,[i,a]=[Pr(e),Pr(n)];if(i?.length!==32||a?.length!==64)return!1;try{r=await crypto.subtle.importKey(`raw`,i,{name:`Ed25519`},!1,[`verify`])}catch(e){return e instanceof DOMException&&e.name===`NotSupportedError`&&null}return crypto.subtle.verify({name:`Ed25519`},r,a,new TextEncoder().encode(t))}function Pr(e){try{let t=atob(e);return btoa(t)===e?Uint8Array.from(t,e=>e.charCodeAt(0)):null}catch{return null}}var Fr=`diaphane-release/1`,q=`Ask who runs the server: it may be misconfigured, or somebody may have tampered with it.`,Ir=`The server's answer is not the record of a version.`;function Lr(e){try{let t=G(JSON.parse(e)),n=e=>{let n=t[e];if(typeof n!=`string`)throw Error(`a text is not one`);return n},r=Ar(t.files);if(!(`manifest.json`in r))throw Error(`there is no manifest`);return{name:n(`name`),version:n(`version`),digest:n(`digest`),statement:n(`statement`),signature:n(`signature`),public_key:n(`public_key`),files:r}}catch{throw new n(Ir,`Load the page again.`)}}function Rr(e){let t=/^(\d{1,6})\.(\d{1,6})\.(\d{1,6})$/.exec(e);return t?t.slice(1).map(Number):[]}async function zr(e,t){let{name:r,version:i,digest:a}=t;if(e.name!==r||e.version!==i||e.digest!==a)throw new n(`The server sent '${e.name}' ${e.version}, and states that '${r}' ${t.selector} is ${i} with other files.`,q);if(e.public_key!==t.keys.at(-1))throw new n(`'${r}' ${i} is signed with another key than the statement that names it.`,`If the server's key was changed a moment ago, try again; else ask who runs it.`);if(await Nr(e.public_key,e.statement,e.signature)===!1)throw new n(`The signature of '${r}' ${i} is wrong.`,q);let o;try{o=G(JSON.parse(e.statement))}catch{throw new n(`The statement of '${r}' cannot be read.`,q)}let s={format:Fr,name:r,version:i,digest:a,files:e.files};if(Object.entries(s).some(([e,t])=>Hr(o[e])!==Hr(t)))throw new n(`The record of '${r}' does not say what its signature is for.`,q);if(a!==await Vr(e.files))throw new n(`The record of '${r}' contradicts itself.`,q)}async function Br(e){let t=await crypto.subtle.digest(`SHA-256`,e);return Array.from(new Uint8Array(t),e=>e.toString(16).padStart(2,`0`)).join(``)}async function Vr(e){let t=Object.fromEntries(Object.entries(e).map(([e,t])=>[e,t.sha256]));return Br(new TextEncoder().encode(Hr(t)))}function Hr(e){return typeof e!=`object`||!e||Array.isArray(e)?JSON.stringify(e)??``:`{${Object.entries(e).sort(([e],[t])=>e<t?-1:1).map(([e,t])=>`${JSON.stringify(e)}:${Hr(t)}`).join(`,`)}}`}var Ur=`diaphane-pointer/1`,Wr=`diaphane-handover/1`,Gr=64,Kr=[`digest`,`expires`,`format`,`issued`,`name`,`selector`,`serial`,`version`];async function qr(e){try{let t=G(JSON.parse(e)),n=J(t.public_key),r=t.handovers;if(!Array.isArray(r)||r.length>Gr)throw Error(`there are too many handovers`);let i=[Nr(n,J(t.statement),J(t.signature))],a=[];for(let e of r){let t=G(JSON.parse(J(e.statement))),[n,r]=[J(t.from),J(t.to)];if(t.format!==Wr||n!==(a.at(-1)??n))throw Error(`a key is missing`);i.push(Nr(n,e.statement,J(e.signature))),a.length===0&&a.push(n),a.push(r)}if((a.at(-1)??n)!==n)throw Error(`the handovers lead to another key`);let o=await Promise.all(i);if(o.includes(!1))throw Error(`a signature is wrong`);let s=G(JSON.parse(t.statement));if(s.format!==Ur||Object.keys(s).sort().join()!==Kr.join())throw Error(`it is another statement`);let c={name:J(s.name),selector:J(s.selector),version:J(s.version),digest:J(s.digest),serial:Jr(s.serial),issued:Jr(s.issued),expires:Jr(s.expires),keys:a.length?a:[n]};if(!Rr(c.version).length||!/^[0-9a-f]{64}$/.test(c.digest))throw Error(`no version`);return{pointer:c,isSigned:!o.includes(null)}}catch{throw new n(`The server's statement of what the alias means is not one, or its signature is wrong.`,`Load the page again; if it stays so, ask who runs the server.`)}}function J(e){if(typeof e!=`string`)throw Error(`a text is not one`);return e}function Jr(e){if(!Number.isSafeInteger(e)||e<0)throw Error(`a number is not one`);return e}var Yr={key:null,retired:[],names:{}},Xr=86400,Zr=`diaphane-trust/1`,Qr=`Ask who runs the server: it may be misconfigured, or somebody may have tampered with it.`;function $r(e,t,n,r,i){let a=Y(e.names,t);ti(t,n,r),ni(e,a,r),ri(a,r,i),a&&ii(a,r);let o=Y(a?.marks,n),s={serial:r.serial,version:r.version,issued:Math.max(r.issued,o?.issued??0)},c=r.keys.at(-1);return{key:c,retired:[...new Set([...e.retired,...r.keys.slice(0,-1)])],names:{...e.names,[t]:{key:c,marks:{...a?.marks,[n]:s},versions:{...a?.versions,[r.version]:r.digest}}}}}function ei(e,t){let{[t]:n,...r}=e.names;return{key:null,retired:e.retired,names:r}}function ti(e,t,r){if(r.name!==e||r.selector!==t)throw new n(`The server's statement is about ${`'${r.name}' ${r.selector}`}, not about '${e}' ${t}.`,Qr);if(Rr(t).length&&r.version!==t)throw new n(`The server has ${r.version} for '${e}' ${t}.`,Qr)}function ni(e,t,r){if(e.retired.includes(r.keys.at(-1)))throw new n(`'${r.name}' is signed with a key that was handed over to another one.`,`Ask who runs the server: it may not use its new key everywhere, or the old one was stolen.`);if(![e.key,t?.key].filter(e=>e!=null).every(e=>r.keys.includes(e)))throw new n(`'${r.name}' is signed with a key to which the one that this browser trusts did not hand over.`,`If the server's key was changed on purpose, forget the trusted key below.`)}function ri(e,t,r){let i=`The statement of what '${t.name}' ${t.selector} means`;if(t.issued>r+300)throw new n(`${i} is of ${Z(t.issued)}, which is yet to come: it is ${Z(r)} here.`,`Set the clock of this machine, or of the server.`);let a=t.expires-t.issued;if(a<=0||a>Xr)throw new n(`${i} holds until ${Z(t.expires)}, which is too long.`,Qr);if(t.expires+300<=r)throw new n(`${i} expired at ${Z(t.expires)}, and it is ${Z(r)}.`,`Set the clock of this machine; if it is right, something on the way to the server serves old answers.`);let o=Math.max(0,...Object.values(e?.marks??{}).map(e=>e.issued));if(t.expires+300<=o)throw new n(`${i} expired at ${Z(t.expires)}, and one of ${Z(o)} was seen here.`,`Set the clock of this machine; if it is right and the server's was wrong then, forget the model below.`)}function ii(e,t){let{name:r,selector:i,version:a}=t;if((Y(e.versions,a)??t.digest)!==t.digest)throw new n(`'${r}' ${a} has other files than it had before.`,`Versions never change: ask who runs the server.`);let o=Y(e.marks,i);if(o){if(t.serial<o.serial)throw new n(`The server's statement of what '${r}' ${i} means is older than one that was seen here: ${a}, where it was ${o.version} later.`,`Something may serve old answers; if the server's database was restored, move the alias once there.`);if(t.serial===o.serial&&a!==o.version)throw new n(`The server says that '${r}' ${i} is ${a} and ${o.version} at once.`,Qr)}}function ai(e){return JSON.stringify({format:Zr,...e})}function oi(e){if(e===null)return Yr;try{let{format:t,key:n,retired:r,names:i}=G(JSON.parse(e));if(t!==Zr||!(n===null||X(n)))throw Error(`the format is another one`);if(!Array.isArray(r)||!r.every(X))throw Error(`a key is not one`);return{key:n,retired:r,names:li(i,si)}}catch{throw new n(`What this browser saw of models cannot be read.`,`Forget it below, and choose the model again.`)}}function si(e){let{key:t,marks:n,versions:r}=G(e);if(!X(t))throw Error(`a key is not one`);return{key:t,marks:li(n,ci),versions:li(r,e=>{if(!X(e))throw Error(`a digest is not one`);return e})}}function ci(e){let{serial:t,version:n,issued:r}=G(e);if(!Number.isSafeInteger(t)||!Number.isSafeInteger(r)||!X(n))throw Error(`no mark`);return{serial:t,version:n,issued:r}}function li(e,t){return Object.fromEntries(Object.entries(G(e)).map(([e,n])=>[e,t(n)]))}function Y(e,t){return e&&Object.hasOwn(e,t)?e[t]:void 0}var X=e=>typeof e==`string`,Z=e=>new Date(1e3*Math.min(e,253402300799)).toISOString().replace(`T`,` `).replace(/\.\d+Z/,` UTC`),ui=`/demo/v1`,di=`/demo/session`,fi=`diaphane trust`,pi=/^[a-z0-9](?:[a-z0-9-]{0,61}[a-z0-9])?$/,mi=/^[a-z0-9](?:[a-z0-9.-]{0,38}[a-z0-9])?$/,hi=class extends n{constructor(){super(`Nobody is signed in.`,`Sign in to render with a published model.`)}},gi=class{memory;ask;now;constructor(e,t=(...e)=>fetch(...e),n=()=>Date.now()/1e3){this.memory=e,this.ask=t,this.now=n}async choices(){let{signed_in:e}=_i(await this.#r(di));if(e!==!0)throw new hi;let t=[],n=`${ui}/models?limit=200`;for(;n;){let e=await this.#r(n),r=_i(e);for(let{name:e,aliases:n,latest:i}of r.items){let r=Object.entries(n);for(let[n,i]of r)t.push({name:e,selector:n,version:i});r.length===0&&t.push({name:e,selector:i,version:i})}n=yi(e)}let r=e=>e.selector===`champion`?0:1;return t.sort((e,t)=>r(e)-r(t))}async pull(e,t){if(!pi.test(e)||!mi.test(t))throw new n(`There can be no '${e}' ${t}.`,`Choose a model of the list.`);let{pointer:r,isSigned:i}=await qr(await this.#e(`${ui}/models/${e}/pointers/${t}`)),a=$r(oi(this.memory.getItem(fi)),e,t,r,this.now());i&&this.memory.setItem(fi,ai(a));let o=Lr(await this.#e(`${ui}/models/${e}/versions/${r.version}`));return await zr(o,r),{...await this.#t(o),isSigned:i}}forget(e){let t;try{t=ei(oi(this.memory.getItem(fi)),e)}catch{t=Yr}this.memory.setItem(fi,ai(t))}async#e(e){return Q((await this.#r(e,{cache:`no-store`})).content)}async#t(e){let{name:t,version:r,files:i}=e,a=Q(await this.#n(e,br)),o;try{o=kr(a)}catch(e){throw new n(`'${t}' ${r} cannot be rendered here: ${e instanceof Error?e.message:String(e)}.`,`Choose another model.`)}let s={...o.files,[br]:i[br]};if(!Object.keys({...s,...i}).every(e=>i[e]?.sha256===s[e]?.sha256))throw new n(`The manifest of '${t}' ${r} lists other files than were published.`,`Publish it again.`);let c=Object.keys(o.files),l=Q((await Promise.all(c.map(t=>this.#n(e,t))))[c.indexOf(xr)]);return{name:t,version:r,tail:o.tail,wgsl:l,selfTest:o.selfTest}}async#n(e,t){let{sha256:r,bytes:i}=e.files[t],{content:a}=await this.#r(`${ui}/blobs/sha256/${r}`);if(a.byteLength!==i||await Br(a)!==r)throw new n(`${t} of '${e.name}' ${e.version} is not the file that was published.`,`Load the page again; if it stays so, ask who runs the server.`);return a}async#r(e,t={}){let r,i;try{r=await this.ask(e,{credentials:`same-origin`,redirect:`error`,...t}),i=await r.arrayBuffer()}catch{throw new n(`The server cannot be reached.`,`Check the connection, then try again.`)}let{ok:a,status:o,headers:s}=r;if(a)return{headers:s,content:i};if(o===401)throw new hi;let c=vi(i);throw new n(c.detail||c.title||`The server answered ${o}.`,c.remedy||`Try again.`)}},Q=e=>new TextDecoder().decode(e);function _i({content:e}){try{return JSON.parse(Q(e))}catch{throw new n(`The server's answer cannot be understood.`,`Ask who runs it: something may be in between.`)}}function vi(e){try{return G(JSON.parse(Q(e)))}catch{return{}}}function yi(e){return/<(\/demo\/v1\/models[^>]*)>; rel="next"/.exec(e.headers.get(`link`)??``)?.[1]??null}async function bi(e,t,n){let{sumFormat:r,scalarFormat:i}=e.gpu,a=[e.target(`tail`,r),e.target(`optical depth`,i)];await e.geometry.drawTransparent(t,{files:[`blended`],entryPoint:`blend_sums`,writes:[]},e.depth,[],a);let o=[e.background.createView(),...a.map(e=>e.createView()),n];e.forPixels(t,[`display`,`resolve_blended`],`resolve_blended`,o)}var xi={files:[`chain_depth`],entryPoint:`chain_depth`,writes:[!1,!0]},Si={files:[`statistics`,`depth_bins`,`chain_colour`],entryPoint:`chain_colour`,writes:[!1,!1,!0,!1,!1]},Ci=[`statistics`,`display`,`resolve_chain`];async function wi(e,t,n,r,i,a){let{geometry:o,depth:s,statistics:c,background:l}=e,{tail:u,gathered:d}=i,f=e.zeros(t,`depths`,r),p=e.zeros(t,`colours`,r);await o.drawTransparent(t,xi,s,[n,f]);let m=e.target(`tail`,e.gpu.sumFormat),h=[n,f,p,c,d];await o.drawTransparent(t,{...Si,tail:u},s,h,[m]);let g=[n,p,c,d,l.createView(),m.createView(),a];e.forPixels(t,Ci,`resolve_chain`,g,{tail:u})}var Ti={files:[`capture`],entryPoint:`capture`,writes:[!1,!0,!0]},Ei=2;async function Di(e,t,n,r,i){let a=e.zeros(t,`cursors`,e.pixels),o=e.room(`pool`,Ei*Math.max(r,1));await e.geometry.drawTransparent(t,Ti,e.depth,[n,a,o]),e.forPixels(t,[`sort`],`sort_runs`,[n,o]);let s=[n,o,e.background.createView(),i];e.forPixels(t,[`display`,`resolve_exact`],`resolve_exact`,s)}var Oi=`depth32float`,ki=`rgba8unorm`,Ai=[[12,`float32x3`],[12,`float32x3`],[8,`float32x2`],[4,`unorm8x4`]].map(([e,t],n)=>({arrayStride:e,attributes:[{format:t,offset:0,shaderLocation:n}]})),ji={color:{srcFactor:`one`,dstFactor:`one`,operation:`add`},alpha:{srcFactor:`one`,dstFactor:`one`,operation:`add`}},Mi=64,Ni=2**24,Pi=2**28,Fi=class{gpu;scene;#e;#t;#n;#r;#i;#a;#o=new Map;#s=[];constructor(e,t){this.gpu=e,this.scene=t;let{device:n}=e,{VERTEX:r,INDEX:i,UNIFORM:a,STORAGE:o}=GPUBufferUsage,{positions:s,normals:c,uvs:l,colours:u}=t;this.#t=[e.filled(s,r|o),...[c,l,u].map(t=>e.filled(t,r))],this.#n=e.filled(t.indices,i|o),this.#e=e.filled(new Uint8Array(176),a);let d=GPUShaderStage.VERTEX|GPUShaderStage.FRAGMENT,f=GPUShaderStage.FRAGMENT,p={binding:0,visibility:d,buffer:{type:`uniform`}},m={binding:1,visibility:f,texture:{sampleType:`depth`}};this.#a={camera:n.createBindGroupLayout({entries:[p]}),frame:n.createBindGroupLayout({entries:[p,m]}),look:n.createBindGroupLayout({entries:[{binding:0,visibility:f,buffer:{type:`uniform`}},{binding:1,visibility:f,texture:{}},{binding:2,visibility:f,sampler:{}}]})};let h=new Map;this.#i=t.batches.map(t=>{let n=t.image?.pixels??null;return h.has(n)||h.set(n,Li(e,n)),{batch:t,look:this.#f(t,h.get(n).createView())}}),this.#r=[...h.values()]}destroy(){for(let e of[...this.#t,this.#n,this.#e,...this.#r])e.destroy()}get isSlow(){return this.#s.length>1}async look(e,t){this.gpu.device.queue.writeBuffer(this.#e,0,e);let r=await this.#l(),i=r.reduce((e,t)=>e+t,0),a=Number.isNaN(i)?1/0:i;if(a>Pi){let[e,r]=[a,Pi].map(e=>Math.floor(e/t).toLocaleString(`en`));throw new n(`The surfaces cover the picture ${e} times over; at this size, ${r} times can be drawn here.`,`Look from elsewhere, make the window smaller, or open a simpler scene.`)}this.#s=Ii(r,this.scene.indices.length)}async drawOpaque(e,t,n,r){let i=this.#p(V([`camera`,`surface`,`opaque`]),`opaque_colour`,()=>({layout:[this.#a.camera,this.#a.look],targets:[{format:ki}],depth:{format:Oi,depthWriteEnabled:!0,depthCompare:`less`}}));await this.#c(e,[`opaque`,`mixed`],a=>{let o=e.encoder.beginRenderPass({colorAttachments:[{view:t.createView(),loadOp:a,storeOp:`store`,clearValue:r}],depthStencilAttachment:{view:n.createView(),depthLoadOp:a,depthStoreOp:`store`,depthClearValue:1}});return o.setPipeline(i),o.setBindGroup(0,this.#u(this.#a.camera,[this.#e])),o})}async drawTransparent(e,t,n,r,i=[]){let a=V([`camera`,`surface`,...t.files],t.tail),o=this.#p(a,t.entryPoint,()=>({layout:[this.#a.frame,this.#a.look,this.#d(t.writes)],targets:i.map(({format:e})=>({format:e,blend:ji})),depth:{format:Oi,depthWriteEnabled:!1,depthCompare:`always`}}));await this.#c(e,[`mixed`,`transparent`],t=>{let a=e.encoder.beginRenderPass({colorAttachments:i.map(e=>({view:e.createView(),loadOp:t,storeOp:`store`})),depthStencilAttachment:{view:n.createView(),depthReadOnly:!0}});return a.setPipeline(o),a.setBindGroup(0,this.#u(this.#a.frame,[this.#e,n.createView()])),a.setBindGroup(2,this.#u(o.getBindGroupLayout(2),r)),a})}async#c(e,t,n){for(let[r,i]of this.#s.entries()){r>0&&await e.pause();let a=n(r>0?`load`:`clear`);this.#t.forEach((e,t)=>a.setVertexBuffer(t,e)),a.setIndexBuffer(this.#n,`uint32`);for(let{batch:e,look:n}of this.#i){let[r,o]=[Math.max(e.first,i.first),Math.min(e.first+e.count,i.end)];!t.includes(e.layer)||o<=r||(a.setBindGroup(1,n),a.drawIndexed(o-r,1,r))}a.end()}}async#l(){let e=Math.ceil(this.scene.indices.length/192),t=this.gpu.words(e),n=new nr(this.gpu),r=this.gpu.compute(V([`camera`,`areas`]),`add_areas`),i=n.encoder.beginComputePass();i.setPipeline(r),i.setBindGroup(0,this.gpu.bind(r,[this.#e,this.#t[0],this.#n,t])),i.dispatchWorkgroups(...s(Mi*e)),i.end(),n.submit();let a=await this.gpu.read(t);return t.destroy(),new Float32Array(a.buffer)}#u(e,t){return this.gpu.device.createBindGroup({layout:e,entries:o(t)})}#d(e){return this.gpu.device.createBindGroupLayout({entries:e.map((e,t)=>({binding:t,visibility:GPUShaderStage.FRAGMENT,buffer:{type:e?`storage`:`read-only-storage`}}))})}#f(e,t){let n=new ArrayBuffer(32);new Float32Array(n).set([...e.scale,e.threshold]),new Uint32Array(n)[5]=+(e.layer===`opaque`);let[r,i]=e.image?.wrap??[`repeat`,`repeat`],a=this.gpu.device.createSampler({addressModeU:r,addressModeV:i,magFilter:`linear`,minFilter:`linear`,mipmapFilter:`linear`}),o=this.gpu.filled(new Uint8Array(n),GPUBufferUsage.UNIFORM);return this.#u(this.#a.look,[o,t,a])}#p(e,t,n){let r=`${t}\n${e}`,i=this.#o.get(r);if(!i){let{layout:a,targets:o,depth:s}=n(),{device:c}=this.gpu,l=c.createShaderModule({code:e,label:t});i=c.createRenderPipeline({label:t,layout:c.createPipelineLayout({bindGroupLayouts:a}),vertex:{module:l,entryPoint:`place`,buffers:Ai},fragment:{module:l,entryPoint:t,targets:o},primitive:{topology:`triangle-list`,cullMode:`none`},depthStencil:s}),this.#o.set(r,i)}return i}};function Ii(e,t){let n=[],[r,i]=[0,0];for(let t=0;t<e.length;++t){let a=192*t;i>0&&i+e[t]>Ni&&(n.push({first:r,end:a}),[r,i]=[a,0]),i+=e[t]}return[...n,{first:r,end:t}]}function Li(e,t){let{device:r}=e,{width:i,height:a}=t??{width:1,height:1},s=r.limits.maxTextureDimension2D;if(Math.max(i,a)>s)throw new n(`An image of ${i} × ${a} is above this device's limit, ${s}.`,`Make it smaller.`);let c=r.createTexture({size:[i,a],format:`rgba8unorm-srgb`,mipLevelCount:1+Math.floor(Math.log2(Math.max(i,a))),usage:GPUTextureUsage.TEXTURE_BINDING|GPUTextureUsage.COPY_DST|GPUTextureUsage.RENDER_ATTACHMENT});if(!t)return r.queue.writeTexture({texture:c},new Uint8Array([255,255,255,255]),{},[1,1]),c;r.queue.copyExternalImageToTexture({source:t},{texture:c},[i,a]);let l=r.createShaderModule({code:V([`cover`,`mipmap`])}),u=r.createRenderPipeline({layout:`auto`,vertex:{module:l,entryPoint:`cover`},fragment:{module:l,entryPoint:`halve`,targets:[{format:c.format}]}}),d=r.createSampler({minFilter:`linear`,magFilter:`linear`}),f=r.createCommandEncoder();for(let e=1;e<c.mipLevelCount;++e){let t=e=>c.createView({baseMipLevel:e,mipLevelCount:1}),n=f.beginRenderPass({colorAttachments:[{view:t(e),loadOp:`clear`,storeOp:`store`}]});n.setPipeline(u);let i=u.getBindGroupLayout(0);n.setBindGroup(0,r.createBindGroup({layout:i,entries:o([t(e-1),d])})),n.draw(3),n.end()}return r.queue.submit([f.finish()]),c}var Ri=3,zi={[ki]:4,[Oi]:4,r16float:2,r32float:4,rgba16float:8,rgba32float:16},Bi={files:[`count`],entryPoint:`count_fragments`,writes:[!0]},Vi=class{gpu;geometry;width;height;pixels;background;depth;statistics;#e=new Map;#t=new Map;constructor(e,t,n,r){this.gpu=e,this.geometry=t,this.width=n,this.height=r,this.pixels=n*r,this.background=this.target(`background`,ki),this.depth=this.target(`depth`,Oi),this.statistics=this.words(`statistics`,Ri*this.pixels)}get bytes(){return[...this.#e.values()].reduce((e,{size:t})=>e+t,0)+[...this.#t.values()].reduce((e,{format:t})=>e+zi[t],0)*this.pixels}destroy(){for(let e of[...this.#e.values(),...this.#t.values()])e.destroy()}words(e,t){let n=this.#e.get(e);if(n&&n.size===4*Math.max(t,1))return n;n?.destroy(),this.#e.delete(e);let r=this.gpu.words(t);return this.#e.set(e,r),r}zeros(e,t,n){let r=this.room(t,n);return e.encoder.clearBuffer(r,0,4*n),r}room(e,t){return this.words(e,Math.max(t,(this.#e.get(e)?.size??0)/4))}target(e,t){let n=`${e} ${t}`,r=this.#t.get(n);if(!r){let e=GPUTextureUsage.RENDER_ATTACHMENT|GPUTextureUsage.TEXTURE_BINDING;r=this.gpu.device.createTexture({size:[this.width,this.height],format:t,usage:e}),this.#t.set(n,r)}return r}forPixels(e,t,n,r,{tail:i=Vn,before:a=``,threads:o=this.pixels}={}){this.dispatch(e,V([`pixels`,...t],i,a),n,r,s(o))}dispatch(e,t,n,r,i){let a=this.gpu.compute(t,n),o=e.encoder.beginComputePass();o.setPipeline(a),o.setBindGroup(0,this.gpu.bind(a,r)),o.dispatchWorkgroups(...i),o.end()}async draw(e,t,n,r){let{geometry:i,width:a,height:o}=this;await i.look(Yt(t,n,i.scene.up,a,o),this.pixels);let s=bt(r)/255;await i.drawOpaque(e,this.background,this.depth,[s,s,s,1]),e.encoder.clearBuffer(this.statistics),await i.drawTransparent(e,Bi,this.depth,[this.statistics])}},Hi=[`statistics`,`depth_bins`,`gather`],Ui=4,Wi=[!1,!0],Gi={files:Hi,entryPoint:`gather_tail`,writes:Wi},Ki={files:Hi,entryPoint:`gather_all`,writes:Wi};async function qi(e,t,n,r){let i=e.zeros(t,`gathered`,qn(n.bins)*e.pixels),a=Ji(e,n),o=r?Array.from({length:Ui},(t,n)=>e.target(`sums${n}`,a)):[],s=[e.statistics,i];return await e.geometry.drawTransparent(t,{...r?Ki:Gi,tail:n},e.depth,s,o),e.forPixels(t,[`depth_bins`,`pack`],`pack_bins`,[i],{tail:n}),{tail:n,gathered:i,targets:o}}function Ji(e,t){return t.bins===0&&e.gpu.blendsManyFloat32?`rgba32float`:`rgba16float`}var Yi=[`kbuffer-deep`,`kbuffer`,`weighted-blended`,`sbuffer`],Xi=1,Zi=class{gpu;frame;#e;#t;#n={fragments:0,occupied:0};#r=null;#i=0;constructor(e,t,n,r){this.gpu=e,this.#t=t,this.frame=new Vi(e,t,n,r),this.#e=new er(this.frame)}destroy(){this.frame.destroy()}get isSlow(){return this.#t.isSlow}get offsets(){return this.#e.offsets}get slots(){return this.#i}async look(e,t){this.#r=null,await this.frame.draw(e,t,this.#t.scene.bounds,Xi),this.#e.count(e),this.#e.begin(e,Gn),e.submit();let[r,i,a]=await this.#e.totals();if(a>4096){let[e,t]=[a,Kn].map(e=>e.toLocaleString(`en`));throw new n(`A pixel has ${e} transparent fragments; up to ${t} can be drawn here.`,`Look from elsewhere, or open a simpler scene.`)}return this.#n={fragments:r,occupied:i},this.#n}async render(e,t,n,r,i){let{frame:a}=this,o=a.words(i,a.pixels),{fragments:s}=this.#n,c=$n(n,a.pixels);return this.#i={"kbuffer-deep":Math.min(c,s),kbuffer:c,"weighted-blended":0,sbuffer:s}[t],t===`sbuffer`?await this.#a(e,o):t===`weighted-blended`?await bi(a,e,o):await this.#o(e,t,this.#i,r,o),e.submit(),o}async#a(e,t){this.#e.begin(e,Gn),this.#e.place(e),await Di(this.frame,e,this.#e.offsets,this.#n.fragments,t)}async#o(e,t,r,i,a){let[o,s]=[this.frame,this.#e];if(s.begin(e,r),t===`kbuffer`){let t=await this.#s(e,Vn,!1);s.placeFixed(e),await wi(o,e,s.offsets,r,t,a);return}if(!i)throw new n(`There is no bundle for kbuffer-deep.`,`Choose a model.`);let c=await this.#s(e,i.tail,!0);vr(o,e,i,c,s),s.solve(e),s.place(e),await wi(o,e,s.offsets,r,c,a)}async#s(e,t,n){let r=this.#r;return r&&r.tail.bins===t.bins&&(!n||r.targets.length>0)?{...r,tail:t}:(this.#r=null,this.#r=await qi(this.frame,e,t,n),this.#r)}},Qi=1600,$i=250,ea=class{gpu;canvas;told;waits;failed;wanted={left:`kbuffer`,right:`weighted-blended`,mode:`picture`,factor:1,split:.5};bundle=null;view=null;#e;#t=null;#n=null;#r=null;#i=!1;#a=0;#o=!1;#s;#c=null;constructor(e,t,r,i,a){this.gpu=e,this.canvas=t,this.told=r,this.waits=i,this.failed=a,this.#e=new or(e,t),e.device.lost.then(()=>{this.#o=!0,a(new n(`The graphics device was lost.`,`Load the page again; if it stays so, update the browser and the graphics driver.`))})}async open(e){let t=new Fi(this.gpu,e);for(++this.#a;this.#r;)await this.#r;this.#t?.destroy(),this.#t=t,this.#_(!0),this.home()}home(){if(!this.#t)return;let{bounds:e,up:t}=this.#t.scene;this.view=Zt(e,t,this.canvas.width/this.canvas.height),this.draw()}draw(){clearTimeout(this.#s),this.#o||(this.#r?(++this.#a,this.#i=!0):this.#h(()=>this.#l()))}present(){this.#c&&this.#n&&!this.#o&&this.#g(this.#n)}async picture(e,t,n){for(;this.#r;)await this.#r;return clearTimeout(this.#s),new Promise((r,i)=>{this.#h(async()=>{try{let i=this.#_(!1),a=new nr(this.gpu),{fragments:o}=await i.look(a,e);r({words:await this.gpu.read(await i.render(a,t,n,this.bundle,`picture`)),offsets:await this.gpu.read(i.offsets),fragments:o})}catch(e){i(e)}})})}async#l(){let e=this.#_(!1);if(!e||!this.view)return;let t=this.#m(),n=await e.look(t,this.view);this.waits(e.isSlow);let r=await this.#u(e,t,`left`),i=await this.#u(e,t,`right`),a=e.frame.words(`exact`,e.frame.pixels);this.#c={left:r.buffer,right:i.buffer,exact:a},this.wanted.mode===`error`&&await e.render(t,`sbuffer`,1,null,`exact`),this.#g(e),this.#p(e,n,r.figures,i.figures),this.#s=setTimeout(()=>this.#d(e,n,r.figures,i.figures),$i)}async#u(e,t,n){let r=this.wanted[n],i=performance.now(),a=await e.render(t,r,this.wanted.factor,this.bundle,n);return await this.gpu.device.queue.onSubmittedWorkDone(),{buffer:a,figures:{technique:r,milliseconds:performance.now()-i,slots:e.slots,error:null}}}#d(e,t,n,r){if(this.#r||!this.#c||e!==this.#n)return;let i=this.#c;this.#h(async()=>{let a=await this.#f(e,[i.left,i.right]);this.#p(e,t,{...n,error:a[0]},{...r,error:a[1]})})}async#f(e,t){let r=[];try{let n=await e.render(this.#m(),`sbuffer`,1,null,`exact`);for(let i of t)r.push(await ir(e.frame,i,n));return r}catch(e){if(e instanceof n)return t.map(()=>NaN);throw e}}#p(e,t,n,r){let{width:i,height:a,bytes:o}=e.frame;this.told({counted:t,left:n,right:r,width:i,height:a,bytes:o})}#m(){let e=this.#a;return new nr(this.gpu,()=>e===this.#a)}#h(e){this.#r=e().catch(e=>{this.#o||e instanceof DOMException&&e.name===`AbortError`||e instanceof tr||(this.#c=null,this.#e.clear(),this.failed(e))}).finally(()=>{this.#r=null,this.waits(!1),this.#i&&(this.#i=!1,this.draw())})}#g(e){let{left:t,right:n,exact:r}=this.#c,{mode:i,split:a}=this.wanted;this.#e.show(e.frame,i,a*e.frame.width,t,n,r)}#_(e){if(!this.#t)return null;let t=this.canvas.getBoundingClientRect(),n=Math.min(Math.max(Math.round(t.width),1),Qi),r=Math.min(Math.max(Math.round(t.height),1),Qi),i=this.#n;return!e&&i&&i.frame.width===n&&i.frame.height===r?i:(i?.destroy(),[this.#n,this.#c]=[null,null],[this.canvas.width,this.canvas.height]=[n,r],this.#n=new Zi(this.gpu,this.#t,n,r),this.#n)}},ta={"glass shells":e,"a shelf of bottles":t},na={"kbuffer-deep":`kbuffer-deep: predicted k`,kbuffer:`kbuffer: fixed k`,"weighted-blended":`weighted-blended`,sbuffer:`sbuffer: exact`},ra={picture:``,count:`0, 1, 3, 7, … to 63 fragments and more, by doubling`,error:`largest difference of red, green and blue: 0 to 32 of 255 and more`},ia=new gi(aa()),$=e=>H(e);function aa(){try{return localStorage}catch{let e=new Map;return{getItem:t=>e.get(t)??null,setItem:(t,n)=>void e.set(t,n)}}}async function oa(){let e=new ea(await i.open(),H(`canvas`),e=>{W(`picture`,null),pr(e)},e=>cr(`picture`,e?`The picture is being drawn.`:null),e=>{W(`picture`,e),fr()});e.gpu.device.addEventListener(`uncapturederror`,({error:e})=>{W(`device`,e instanceof GPUOutOfMemoryError?new n(`The graphics device has no memory left.`,`Make the window or the budget smaller, or open a smaller scene; then load the page again.`):e)}),dr($(`scene`),Object.keys(ta).map(e=>[e,e]));for(let t of[`left`,`right`])fa(e,t,e.wanted[t]);sa(e),tn(H(`stage`),e,t=>ma(e,e.wanted.split+t)),Object.assign(globalThis,{diaphane:{picture:(t,n,r)=>e.picture(t,n,r)}}),await Promise.all([ca(e),_a(e)])}function sa(e){let t=(e,t)=>H(e).addEventListener(e===`budget`||e===`split`?`input`:`change`,()=>void t());t(`scene`,()=>$(`scene`).value?ca(e):da(e,ua));let n=H(`file`);t(`file`,()=>da(e,n.files?.[0])),n.addEventListener(`click`,()=>n.value=``),t(`model`,()=>va(e)),t(`mode`,()=>pa(e)),t(`split`,()=>ma(e,H(`split`).valueAsNumber/100)),t(`budget`,()=>ha(e));for(let n of[`left`,`right`])t(n,()=>fa(e,n,$(n).value));H(`controls`).addEventListener(`submit`,e=>e.preventDefault()),H(`forget`).addEventListener(`click`,()=>{let[t]=ga();t&&ia.forget(t),va(e)});let r=(e,t)=>{e.preventDefault(),H(`stage`).classList.toggle(`over`,t)};addEventListener(`dragover`,e=>r(e,e.dataTransfer?.types.includes(`Files`)??!1)),addEventListener(`dragleave`,e=>r(e,!1)),addEventListener(`drop`,t=>{r(t,!1),da(e,t.dataTransfer?.files[0])}),new ResizeObserver(()=>e.draw()).observe(e.canvas),ha(e)}var ca=e=>ur(`scene`,`The scene is loading.`,async t=>{let n=$(`scene`).value,r=await Nt(n,await la(ta[n]));t()&&await e.open(r)});async function la(e){try{let t=await fetch(e);if(t.ok)return await t.blob()}catch{}throw new n(`The sample cannot be loaded.`,`Check the connection, then load the page again.`)}var ua;async function da(e,t){t&&await ur(`scene`,`The file is read.`,async n=>{let r=await Nt(t.name,t);n()&&(await e.open(r),ua=t,Array.from($(`scene`).options).some(e=>e.value===``)||$(`scene`).prepend(new Option(``,``)),$(`scene`).options[0].text=t.name,$(`scene`).value=``)})}function fa(e,t,n){let r=Yi.filter(t=>t!==`kbuffer-deep`||e.bundle!==null);dr($(t),r.map(e=>[e,na[e]])),e.wanted[t]=r.includes(n)?n:`kbuffer`,$(t).value=e.wanted[t],H(`${t}-name`).textContent=e.wanted[t],e.draw()}function pa(e){let t=$(`mode`).value;e.wanted.mode=t,H(`legend`).hidden=t===`picture`,H(`ramp`).className=t,H(`legend-text`).textContent=ra[t],t===`error`?e.draw():e.present()}function ma(e,t){e.wanted.split=Math.min(Math.max(t,0),1),H(`split`).valueAsNumber=Math.round(100*e.wanted.split),e.present()}function ha(e){e.wanted.factor=2**H(`budget`).valueAsNumber,H(`budget-value`).textContent=`${e.wanted.factor.toPrecision(3)} fragments a pixel`,e.draw()}var ga=()=>$(`model`).value.split(`@`);async function _a(e){let t=H(`model-note`);try{let n=await ia.choices();if(n.length===0){t.textContent=`There is no model yet: build one, then load this page again. The other techniques need none.`;return}let r=n.map(({name:e,selector:t,version:n})=>{let r=t===n?`${e} ${n}`:`${e}@${t} (${n})`;return[`${e}@${t}`,r]});dr($(`model`),[[``,`none`],...r]),$(`model`).disabled=!1,$(`model`).value=r[0][0],await va(e)}catch(e){if(t.textContent=e instanceof Error?e.message:``,!(e instanceof hi))return;let n=document.createElement(`a`);n.href=`/sign-in?next=%2Fdemo`,n.textContent=`Sign in`,t.replaceChildren(n,` to render with a published model. The other techniques need none.`)}}async function va(e){let[t,n]=ga(),r=H(`model-note`);r.textContent=``;let i=t=>{let n=t!==null&&e.bundle===null;e.bundle=t,fa(e,`left`,e.wanted.left),fa(e,`right`,n?`kbuffer-deep`:e.wanted.right)};await ur(`model`,t?`The model is fetched.`:``,async a=>{try{let o=t&&n?await ia.pull(t,n):null;if(o&&await yr(e.gpu,o),!a()||(i(o),!o))return;let s=o.isSigned?`signature and hashes are right`:`hashes are right; this browser cannot check the signature (it has no Ed25519), and trusts the server`;r.textContent=`${t} ${o.version}: ${s}; its self-test passes on this device.`}catch(e){throw a()&&i(null),e}})}oa().catch(e=>{W(`device`,e),H(`status`).textContent=`There is nothing to see without WebGPU.`;for(let e of document.querySelectorAll(`#controls input, #controls select`))e.disabled=!0});