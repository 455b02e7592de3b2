// Draws capsules, cones, hulls of spheres and a floor by WebGL2: one mesh and one draw call for all capsules of a body,
// one of each for a hull. Small on purpose: a page holds it whole, and a computer without a graphics card has to draw 250
// capsules 30 times a second.
import {View} from './camera';
import {Hull} from './replay';

export type Colour = [number, number, number];

// The numbers of an instance: position 3, quaternion 4, radius, half length, taper, colour 3.
const STRIDE = 13;

export class Bodies {
  data = new Float32Array(64 * STRIDE);
  count = 0;
  readonly hulls: {hull: Hull; data: Float32Array}[] = [];

  clear(): void {
    this.count = 0;
    this.hulls.length = 0;
  }

  addHull(hull: Hull, p: ArrayLike<number>, R: ArrayLike<number>, colour: Colour): void {
    this.hulls.push({hull, data: new Float32Array([p[0]!, p[1]!, p[2]!, R[0]!, R[1]!, R[2]!, R[3]!, 1, 0, 1, ...colour])});
  }

  // Along z of its frame; taper is the radius of the far end as a part of the near one's (1: a capsule, 0: a cone).
  add(p: ArrayLike<number>, R: ArrayLike<number>, radius: number, half: number, taper: number, colour: Colour): void {
    if ((this.count + 1) * STRIDE > this.data.length) {
      const more = new Float32Array(2 * this.data.length);
      more.set(this.data);
      this.data = more;
    }
    const at = this.count++ * STRIDE, d = this.data;
    for (let k = 0; k < 3; ++k) d[at + k] = p[k]!;
    for (let k = 0; k < 4; ++k) d[at + 3 + k] = R[k]!;
    d[at + 7] = radius;
    d[at + 8] = half;
    d[at + 9] = taper;
    for (let k = 0; k < 3; ++k) d[at + 10 + k] = colour[k]!;
  }
}

export interface Layer {
  bodies: Bodies;
  alpha: number; // below 1: a ghost
  shadow: boolean;
}

export interface Theme {
  background: Colour;
  floor: Colour;
  line: Colour;
  shadow: number; // how dark
}

export function rgb(hex: string): Colour {
  const n = parseInt(hex.slice(1), 16);
  return [(n >> 16) / 255, ((n >> 8) & 255) / 255, (n & 255) / 255];
}

// The colours that the style sheet has for the element.
export function themeOf(element: HTMLElement): Theme {
  const css = getComputedStyle(element), colour = (name: string) => rgb(css.getPropertyValue(name).trim());
  return {background: colour('--sky'), floor: colour('--floor'), line: colour('--grid'), shadow: Number(css.getPropertyValue('--shadow'))};
}

const BODY_VERTEX = `#version 300 es
layout(location=0) in vec4 corner; // on the unit sphere, and which end
layout(location=1) in vec3 place;
layout(location=2) in vec4 turn; // w, x, y, z
layout(location=3) in vec3 size; // radius, half length, taper
layout(location=4) in vec3 tint;
layout(location=5) in vec3 facing; // the normal before it is turned
uniform mat4 view;
uniform vec3 light;
uniform float flatten;
out vec3 normal;
out vec3 colour;
out vec3 world;
vec3 turned(vec3 v) { return v + 2.0 * cross(turn.yzw, cross(turn.yzw, v) + turn.x * v); }
void main() {
  float r = size.x * (corner.w > 0.0 ? size.z : 1.0);
  vec3 p = place + turned(corner.xyz * r + vec3(0.0, 0.0, corner.w * size.y));
  if (flatten > 0.5) { p.xy -= light.xy / light.z * max(p.z, 0.0); p.z = 0.004; }
  normal = turned(facing);
  colour = tint;
  world = p;
  gl_Position = view * vec4(p, 1.0);
}`;

const BODY_FRAGMENT = `#version 300 es
precision highp float;
in vec3 normal;
in vec3 colour;
in vec3 world;
uniform vec3 light;
uniform vec3 eye;
uniform float alpha;
uniform float flatten;
out vec4 pixel;
void main() {
  if (flatten > 0.5) { pixel = vec4(0.0, 0.0, 0.0, alpha); return; }
  vec3 n = normalize(normal), to = normalize(eye - world);
  float facing = max(dot(n, to), 0.0);
  float lit = 0.44 + 0.2 * n.z + 0.36 * max(dot(n, light), 0.0) + 0.26 * facing;
  float edge = 1.0 - facing, rim = edge * edge * edge;
  // Ghosts are seen by their outlines: where several overlap, the middle stays clear.
  float cover = alpha < 1.0 ? alpha * (0.3 + 1.5 * edge * edge) : 1.0;
  pixel = vec4(colour * lit + 0.12 * rim, cover);
}`;

const FLOOR_VERTEX = `#version 300 es
layout(location=0) in vec2 corner;
uniform mat4 view;
uniform vec2 middle;
out vec2 place;
void main() { place = middle + 16.0 * corner; gl_Position = view * vec4(place, 0.0, 1.0); }`;

const FLOOR_FRAGMENT = `#version 300 es
precision highp float;
in vec2 place;
uniform vec2 middle;
uniform vec3 ground;
uniform vec3 line;
uniform vec3 background;
out vec4 pixel;
float lines(float period, float width) {
  vec2 cell = place / period, near = abs(fract(cell - 0.5) - 0.5) / fwidth(cell);
  return 1.0 - min(min(near.x, near.y) / width, 1.0);
}
void main() {
  float far = smoothstep(2.5, 9.0, length(place - middle));
  float mark = max(0.35 * lines(0.25, 1.0) * (1.0 - smoothstep(1.0, 4.0, length(place - middle))), 0.9 * lines(1.0, 1.3));
  pixel = vec4(mix(mix(ground, line, mark), background, far), 1.0);
}`;

// A sphere that is cut at its middle: four numbers a corner, triangles by index.
function capsuleMesh(around: number, rings: number): {corners: Float32Array; indices: Uint16Array} {
  const corners: number[] = [], indices: number[] = [];
  for (let r = 0; r <= 2 * rings + 1; ++r) {
    const end = r <= rings ? -1 : 1, step = r <= rings ? r : r - 1;
    const angle = -Math.PI / 2 + (Math.PI * step) / (2 * rings);
    for (let i = 0; i <= around; ++i) {
      const turn = (2 * Math.PI * i) / around;
      corners.push(Math.cos(angle) * Math.cos(turn), Math.cos(angle) * Math.sin(turn), Math.sin(angle), end);
      if (r === 0 || i === 0) continue;
      const a = (r - 1) * (around + 1) + i - 1, b = a + around + 1;
      indices.push(a, a + 1, b, b, a + 1, b + 1);
    }
  }
  return {corners: new Float32Array(corners), indices: new Uint16Array(indices)};
}

// The hull of spheres, as a sphere whose corners are moved to where the hull is farthest in their direction, which is
// also its normal there: seven numbers a corner (place, end, normal).
function hullMesh(hull: Hull, around: number, rings: number): {corners: Float32Array; indices: Uint16Array} {
  const sphere = capsuleMesh(around, rings), corners: number[] = [];
  for (let i = 0; i < sphere.corners.length; i += 4) {
    const [x, y, z] = sphere.corners.subarray(i, i + 3) as unknown as [number, number, number];
    let far = hull.spheres[0]!, most = -Infinity;
    for (const one of hull.spheres) {
      const reach = x * one[0] + y * one[1] + z * one[2] + one[3];
      if (reach > most) [far, most] = [one, reach];
    }
    corners.push(far[0] + far[3] * x, far[1] + far[3] * y, far[2] + far[3] * z, 1, x, y, z);
  }
  return {corners: new Float32Array(corners), indices: sphere.indices};
}

interface Mesh {
  array: WebGLVertexArrayObject;
  indices: number;
}

export class Renderer {
  private readonly gl: WebGL2RenderingContext;
  private readonly body: WebGLProgram;
  private readonly floor: WebGLProgram;
  private readonly instances: WebGLBuffer;
  private readonly capsule: Mesh;
  private readonly hulls = new Map<Hull, Mesh>();
  private readonly floorArray: WebGLVertexArrayObject;
  private readonly places = new Map<string, WebGLUniformLocation | null>();
  readonly software: boolean;
  drawn = 0; // instances of the last picture

  // Throws where the browser has no WebGL2.
  constructor(readonly canvas: HTMLCanvasElement) {
    const probe = document.createElement('canvas').getContext('webgl2');
    const info = probe?.getExtension('WEBGL_debug_renderer_info');
    const name = probe && info ? String(probe.getParameter(info.UNMASKED_RENDERER_WEBGL)) : '';
    this.software = /swiftshader|llvmpipe|software/i.test(name);
    probe?.getExtension('WEBGL_lose_context')?.loseContext();
    const gl = canvas.getContext('webgl2', {antialias: !this.software, stencil: true, alpha: false});
    if (!gl) throw new Error('no WebGL2');
    this.gl = gl;
    this.body = program(gl, BODY_VERTEX, BODY_FRAGMENT);
    this.floor = program(gl, FLOOR_VERTEX, FLOOR_FRAGMENT);
    this.instances = gl.createBuffer()!;
    this.capsule = this.meshOf(this.software ? capsuleMesh(9, 2) : capsuleMesh(18, 6), 4, 0);
    this.floorArray = gl.createVertexArray()!;
    gl.bindVertexArray(this.floorArray);
    attribute(gl, new Float32Array([-1, -1, 1, -1, -1, 1, 1, 1]), 2);
    gl.enable(gl.DEPTH_TEST);
    gl.enable(gl.CULL_FACE);
    gl.enable(gl.SCISSOR_TEST);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
  }

  // Numbers a corner, and where its normal begins among them.
  private meshOf(made: {corners: Float32Array; indices: Uint16Array}, numbers: number, normal: number): Mesh {
    const gl = this.gl, array = gl.createVertexArray()!;
    gl.bindVertexArray(array);
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, made.corners, gl.STATIC_DRAW);
    for (const [location, size, at] of [[0, 4, 0], [5, 3, normal]] as const) {
      gl.enableVertexAttribArray(location);
      gl.vertexAttribPointer(location, size, gl.FLOAT, false, 4 * numbers, 4 * at);
    }
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, made.indices, gl.STATIC_DRAW);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.instances);
    let offset = 0;
    for (const [location, size] of [[1, 3], [2, 4], [3, 3], [4, 3]] as const) {
      gl.enableVertexAttribArray(location);
      gl.vertexAttribPointer(location, size, gl.FLOAT, false, 4 * STRIDE, 4 * offset);
      gl.vertexAttribDivisor(location, 1);
      offset += size;
    }
    return {array, indices: made.indices.length};
  }

  private hullOf(hull: Hull): Mesh {
    let mesh = this.hulls.get(hull);
    if (!mesh) {
      const made = this.software ? hullMesh(hull, 16, 5) : hullMesh(hull, 32, 10);
      this.hulls.set(hull, mesh = this.meshOf(made, 7, 4));
    }
    return mesh;
  }

  begin(): void { this.drawn = 0; }

  // Into a part of the canvas, in device pixels from its bottom left.
  draw(x: number, y: number, width: number, height: number, view: View, middle: ArrayLike<number>, layers: Layer[],
       theme: Theme): void {
    const gl = this.gl;
    gl.viewport(x, y, width, height);
    gl.scissor(x, y, width, height);
    gl.clearColor(...theme.background, 1);
    gl.clearStencil(0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT | gl.STENCIL_BUFFER_BIT);
    gl.useProgram(this.floor);
    gl.uniformMatrix4fv(this.at(this.floor, 'view'), false, view.matrix);
    gl.uniform2f(this.at(this.floor, 'middle'), middle[0]!, middle[1]!);
    gl.uniform3f(this.at(this.floor, 'ground'), ...theme.floor);
    gl.uniform3f(this.at(this.floor, 'line'), ...theme.line);
    gl.uniform3f(this.at(this.floor, 'background'), ...theme.background);
    gl.bindVertexArray(this.floorArray);
    gl.disable(gl.CULL_FACE);
    gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
    gl.enable(gl.CULL_FACE);
    gl.useProgram(this.body);
    gl.uniformMatrix4fv(this.at(this.body, 'view'), false, view.matrix);
    gl.uniform3f(this.at(this.body, 'light'), 0.36, 0.28, 0.89);
    gl.uniform3f(this.at(this.body, 'eye'), ...view.eye);
    for (const layer of layers) this.shadow(layer, theme);
    for (const layer of layers) this.drawn += layer.bodies.count + layer.bodies.hulls.length;
    for (const layer of layers) if (layer.alpha >= 1) this.instancesOf(layer, 1, 0);
    for (const layer of layers) if (layer.alpha < 1) this.ghost(layer);
  }

  private shadow(layer: Layer, theme: Theme): void {
    const gl = this.gl;
    if (!layer.shadow || layer.bodies.count + layer.bodies.hulls.length === 0) return;
    gl.enable(gl.STENCIL_TEST);
    gl.stencilFunc(gl.EQUAL, 0, 0xff);
    gl.stencilOp(gl.KEEP, gl.KEEP, gl.INCR);
    gl.enable(gl.BLEND);
    gl.depthMask(false);
    gl.disable(gl.CULL_FACE);
    this.instancesOf(layer, theme.shadow * Math.min(1, layer.alpha), 1);
    gl.enable(gl.CULL_FACE);
    gl.depthMask(true);
    gl.disable(gl.BLEND);
    gl.disable(gl.STENCIL_TEST);
  }

  // First its depth alone, so that only its outer surface shines through.
  private ghost(layer: Layer): void {
    const gl = this.gl;
    gl.colorMask(false, false, false, false);
    this.instancesOf(layer, 1, 0);
    gl.colorMask(true, true, true, true);
    gl.enable(gl.BLEND);
    gl.depthFunc(gl.EQUAL);
    this.instancesOf(layer, layer.alpha, 0);
    gl.depthFunc(gl.LESS);
    gl.disable(gl.BLEND);
  }

  private instancesOf(layer: Layer, alpha: number, flatten: number): void {
    const gl = this.gl, {count, data, hulls} = layer.bodies;
    gl.uniform1f(this.at(this.body, 'alpha'), alpha);
    gl.uniform1f(this.at(this.body, 'flatten'), flatten);
    if (count > 0) this.drawMesh(this.capsule, data.subarray(0, count * STRIDE), count);
    for (const one of hulls) this.drawMesh(this.hullOf(one.hull), one.data, 1);
  }

  private drawMesh(mesh: Mesh, instances: Float32Array, count: number): void {
    const gl = this.gl;
    gl.bindVertexArray(mesh.array);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.instances);
    gl.bufferData(gl.ARRAY_BUFFER, instances, gl.STREAM_DRAW);
    gl.drawElementsInstanced(gl.TRIANGLES, mesh.indices, gl.UNSIGNED_SHORT, 0, count);
  }

  private at(of: WebGLProgram, name: string): WebGLUniformLocation | null {
    const key = (of === this.body ? 'b.' : 'f.') + name;
    if (!this.places.has(key)) this.places.set(key, this.gl.getUniformLocation(of, name));
    return this.places.get(key)!;
  }
}

function attribute(gl: WebGL2RenderingContext, values: Float32Array, size: number): void {
  gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
  gl.bufferData(gl.ARRAY_BUFFER, values, gl.STATIC_DRAW);
  gl.enableVertexAttribArray(0);
  gl.vertexAttribPointer(0, size, gl.FLOAT, false, 0, 0);
}

function program(gl: WebGL2RenderingContext, vertex: string, fragment: string): WebGLProgram {
  const made = gl.createProgram()!;
  for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]] as const) {
    const shader = gl.createShader(kind)!;
    gl.shaderSource(shader, text);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader) ?? 'shader');
    gl.attachShader(made, shader);
  }
  gl.linkProgram(made);
  if (!gl.getProgramParameter(made, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(made) ?? 'program');
  return made;
}
