// Rendering of a surface. Corners and positions are integer textures that the vertex shader reads by triangle, so that
// each triangle has its own error and edges.

const VERTEX = `#version 300 es
precision highp float;
precision highp int;
precision highp usampler2D;
uniform usampler2D corners, places;
uniform mat4 view;
uniform vec3 middle, scale;
uniform float exaggeration;
uniform int across;
out vec3 edge;
out vec3 normal;
out float height;
out vec3 at;
flat out float error;

uvec4 look(usampler2D from, int i) {
  return texelFetch(from, ivec2(i % across, i / across), 0);
}

void main() {
  int triangle = gl_VertexID / 3, corner = gl_VertexID % 3;
  uvec4 three = look(corners, triangle);
  uvec4 own = look(places, int(three[corner]));
  vec2 level = vec2(int(own.w << 16) >> 16, int(own.w) >> 16) / 32767.0;
  normal = vec3(level, sqrt(max(0.0, 1.0 - dot(level, level))));
  edge = vec3(corner == 0, corner == 1, corner == 2);
  error = uintBitsToFloat(three.w);
  height = float(own.z);
  at = (vec3(own.xyz) - middle) * scale * vec3(1, 1, exaggeration);
  gl_Position = view * vec4(at, 1);
}`;

const FRAGMENT = `#version 300 es
precision highp float;
in vec3 edge;
in vec3 normal;
in float height;
in vec3 at;
flat in float error;
uniform sampler2D palette;
uniform vec2 range;
uniform float exaggeration, most, wire, pixel;
uniform vec3 light, eye;
uniform int colour;
uniform bool facets;
out vec4 seen;

void main() {
  vec3 flat_ = normalize(cross(dFdx(at), dFdy(at)));
  flat_ *= flat_.z < 0.0 ? -1.0 : 1.0;
  vec3 n = facets ? flat_ : normalize(vec3(normal.xy * exaggeration, normal.z));
  float steep = degrees(acos(clamp(normalize(vec3(n.xy, n.z * exaggeration)).z, 0.0, 1.0)));
  float place = colour == 1 ? (height - range.x) / max(1e-9, range.y - range.x)
    : colour == 2 ? steep / 60.0 : error / most;
  vec3 tint = colour == 0 ? vec3(0.86, 0.85, 0.82) : texture(palette, vec2(clamp(place, 0.002, 0.998), 0.5)).rgb;
  float sun = max(0.0, dot(n, light));
  float lit = colour == 3 ? 0.62 + 0.42 * sun : 0.3 + 0.16 * n.z + 0.72 * sun;
  vec3 shown = tint * lit + vec3(0.05, 0.045, 0.03) * sun * sun;
  // Haze with distance.
  float haze = clamp(length(at - eye) / pixel - 1.6, 0.0, 1.0);
  shown = mix(shown, vec3(0.86, 0.9, 0.94), 0.25 * haze);
  if (wire > 0.0) {
    vec3 width = fwidth(edge);
    vec3 near = smoothstep(vec3(0.3), vec3(1.1), edge / max(width, vec3(1e-7)));
    float line = 1.0 - min(near.x, min(near.y, near.z));
    // Edges of triangles of a few pixels fade, so that dense parts do not turn black.
    float dense = max(width.x, max(width.y, width.z));
    shown = mix(shown, vec3(0.07, 0.1, 0.17), line * wire * clamp(0.42 / dense - 0.5, 0.1, 0.62));
  }
  seen = vec4(shown, 1);
}`;

const WALL_VERTEX = `#version 300 es
precision highp float;
in vec3 place;
in vec2 out_;
uniform mat4 view;
uniform vec3 middle, scale;
uniform float exaggeration;
out float side;
void main() {
  side = out_.x * 0.55 - out_.y * 0.45;
  gl_Position = view * vec4((place - middle) * scale * vec3(1, 1, exaggeration), 1);
}`;

const WALL_FRAGMENT = `#version 300 es
precision highp float;
in float side;
out vec4 seen;
void main() { seen = vec4(vec3(0.5, 0.46, 0.42) * (1.0 - 0.28 * side), 1); }`;

/** Number of triangles culled together. */
const RUN = 1 << 15;

class SurfaceDrawing {
  /** `data`: codes of x, y and z, corners, errors or null; `ground`: metres of a step along each axis. */
  constructor(canvas, data, ground) {
    const gl = canvas.getContext('webgl2', { antialias: true, preserveDrawingBuffer: false, powerPreference: 'high-performance' });
    if (!gl) throw new Error('this browser does not support WebGL 2');
    Object.assign(this, { gl, canvas, data, scale: ground });
    this.triangles = data.corners.length / 3;
    this.across = Math.min(4096, gl.getParameter(gl.MAX_TEXTURE_SIZE));
    this.program = linked(gl, VERTEX, FRAGMENT);
    this.measure();
    this.upload();
    this.makeRuns();
    this.palette = gl.createTexture();
    this.empty = gl.createVertexArray();
  }

  /** Area-weighted vertex normals, areas, and dimensions of the scene. */
  measure() {
    const { x, y, z, corners } = this.data;
    const [sx, sy, sz] = this.scale;
    const normals = new Float32Array(3 * x.length);
    let [plan, surface] = [0, 0];
    this.weights = new Float32Array(this.triangles);
    for (let t = 0; t < this.triangles; t++) {
      const [a, b, c] = [corners[3 * t], corners[3 * t + 1], corners[3 * t + 2]];
      const [ux, uy, uz] = [(x[b] - x[a]) * sx, (y[b] - y[a]) * sy, (z[b] - z[a]) * sz];
      const [vx, vy, vz] = [(x[c] - x[a]) * sx, (y[c] - y[a]) * sy, (z[c] - z[a]) * sz];
      const [nx, ny, nz] = [uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx];
      for (const i of [a, b, c]) {
        normals[3 * i] += nx;
        normals[3 * i + 1] += ny;
        normals[3 * i + 2] += nz;
      }
      this.weights[t] = Math.abs(nz) / 2;
      plan += Math.abs(nz) / 2;
      surface += Math.hypot(nx, ny, nz) / 2;
    }
    Object.assign(this, { normals, areas: { plan, surface } });
    const top = (codes) => codes.reduce((most, code) => (code > most ? code : most), 0);
    this.top = [top(x), top(y), top(z)];
    this.middle = this.top.map((code) => code / 2);
    this.radius = Math.hypot(...[0, 1].map((k) => this.middle[k] * this.scale[k])) || 1;
  }

  texture(unit, width, words) {
    const gl = this.gl;
    const lines = words.length / 4 / width;
    if (lines > gl.getParameter(gl.MAX_TEXTURE_SIZE)) throw new Error('this surface exceeds the texture size of the graphics card');
    const texture = gl.createTexture();
    gl.activeTexture(gl.TEXTURE0 + unit);
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA32UI, width, lines, 0, gl.RGBA_INTEGER, gl.UNSIGNED_INT, words);
  }

  upload() {
    const { x, y, z, corners, errors } = this.data;
    const room = (items) => new Uint32Array(4 * this.across * Math.max(1, Math.ceil(items / this.across)));
    const places = room(x.length);
    const n = this.normals;
    for (let i = 0; i < x.length; i++) {
      const length = Math.hypot(n[3 * i], n[3 * i + 1], n[3 * i + 2]) || 1;
      const sign = n[3 * i + 2] < 0 ? -1 : 1;
      const part = (k) => Math.round((n[3 * i + k] / length) * sign * 32767) & 0xffff;
      places.set([x[i], y[i], z[i], part(0) | (part(1) << 16)], 4 * i);
    }
    delete this.normals;
    this.texture(1, this.across, places);
    const all = room(this.triangles);
    for (let t = 0; t < this.triangles; t++) {
      all[4 * t] = corners[3 * t];
      all[4 * t + 1] = corners[3 * t + 1];
      all[4 * t + 2] = corners[3 * t + 2];
      all[4 * t + 3] = errors ? errors[t] : 0;
    }
    this.texture(0, this.across, all);
  }

  /** Bounding boxes of runs of triangles, for culling. */
  makeRuns() {
    const { x, y, z, corners } = this.data;
    this.runs = [];
    for (let first = 0; first < this.triangles; first += RUN) {
      const end = Math.min(this.triangles, first + RUN);
      const [low, high] = [[Infinity, Infinity, Infinity], [-Infinity, -Infinity, -Infinity]];
      for (let i = 3 * first; i < 3 * end; i++) {
        const v = corners[i];
        [x[v], y[v], z[v]].forEach((code, k) => {
          if (code < low[k]) low[k] = code;
          if (code > high[k]) high[k] = code;
        });
      }
      this.runs.push({ first, count: end - first, low, high });
    }
  }

  /** Walls from the outline down to below the lowest height, so that the surface looks like a block. */
  makeWalls() {
    const { x, y, z, corners } = this.data;
    const gl = this.gl;
    const edges = outline(corners, x.length);
    const base = -0.07 * Math.max(this.top[2], (0.3 * this.radius) / this.scale[2] / this.exaggeration);
    const list = new Float32Array(edges.length * 15);
    let at = 0;
    for (let i = 0; i < edges.length; i += 2) {
      const [a, b] = [edges[i], edges[i + 1]];
      const [dx, dy] = [(x[b] - x[a]) * this.scale[0], (y[b] - y[a]) * this.scale[1]];
      const length = Math.hypot(dx, dy) || 1;
      for (const [v, low] of [[a, 0], [a, 1], [b, 1], [a, 0], [b, 1], [b, 0]]) {
        list.set([x[v], y[v], low ? base : z[v], dy / length, -dx / length], at);
        at += 5;
      }
    }
    this.walls ??= { ...linked(gl, WALL_VERTEX, WALL_FRAGMENT), array: gl.createVertexArray(), buffer: gl.createBuffer() };
    const { program, array, buffer } = this.walls;
    this.walls.count = at / 5;
    gl.bindVertexArray(array);
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    gl.bufferData(gl.ARRAY_BUFFER, list, gl.STATIC_DRAW);
    for (const [name, size, offset] of [['place', 3, 0], ['out_', 2, 12]]) {
      const slot = gl.getAttribLocation(program, name);
      gl.enableVertexAttribArray(slot);
      gl.vertexAttribPointer(slot, size, gl.FLOAT, false, 20, offset);
    }
    gl.bindVertexArray(null);
  }

  /** 256 colours, as [r, g, b] from 0 to 255. */
  paint(colours) {
    ramp(this.gl, this.palette, 2, colours);
  }

  /** Draws the surface. `how`: exaggeration, colour (0 to 3), range, most, wire, facets, light, walls. */
  draw(camera, how) {
    const { gl, canvas } = this;
    const m = camera.matrix;
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.clearColor(0.886, 0.914, 0.937, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    const { program, at } = this.program;
    gl.useProgram(program);
    gl.bindVertexArray(this.empty);
    this.common(at, m, how);
    gl.uniform1i(at.corners, 0);
    gl.uniform1i(at.places, 1);
    gl.uniform1i(at.palette, 2);
    gl.uniform1i(at.across, this.across);
    gl.uniform2f(at.range, ...how.range);
    gl.uniform1f(at.most, how.most);
    gl.uniform1f(at.wire, how.wire ? 1 : 0);
    gl.uniform1f(at.pixel, camera.radius * 2);
    gl.uniform3f(at.light, ...how.light);
    gl.uniform3f(at.eye, ...camera.eye);
    gl.uniform1i(at.colour, how.colour);
    gl.uniform1i(at.facets, how.facets ? 1 : 0);
    this.drawn = 0;
    for (const run of this.runs) {
      if (unseen(run, m, this, how.exaggeration)) continue;
      gl.drawArrays(gl.TRIANGLES, 3 * run.first, 3 * run.count);
      this.drawn += run.count;
    }
    if (how.walls && this.triangles <= 3e6) this.drawWalls(m, how);
  }

  common(at, m, how) {
    const gl = this.gl;
    gl.uniformMatrix4fv(at.view, false, new Float32Array(m));
    gl.uniform3f(at.middle, ...this.middle);
    gl.uniform3f(at.scale, ...this.scale);
    gl.uniform1f(at.exaggeration, how.exaggeration);
  }

  drawWalls(m, how) {
    const gl = this.gl;
    if (!this.walls || this.exaggeration !== how.exaggeration) {
      this.exaggeration = how.exaggeration;
      this.makeWalls();
    }
    gl.useProgram(this.walls.program);
    gl.bindVertexArray(this.walls.array);
    this.common(this.walls.at, m, how);
    gl.drawArrays(gl.TRIANGLES, 0, this.walls.count);
  }
}

/** Border edges, as pairs of vertices in the direction of their triangle. */
function outline(corners, vertices) {
  const starts = new Uint32Array(vertices + 1);
  const triangles = corners.length / 3;
  for (let i = 0; i < corners.length; i++) starts[corners[i] + 1]++;
  for (let v = 0; v < vertices; v++) starts[v + 1] += starts[v];
  const ends = new Uint32Array(corners.length);
  const next = starts.slice();
  for (let t = 0; t < triangles; t++) {
    for (let k = 0; k < 3; k++) ends[next[corners[3 * t + k]]++] = corners[3 * t + ((k + 1) % 3)];
  }
  const out = [];
  for (let a = 0; a < vertices; a++) {
    for (let i = starts[a]; i < starts[a + 1]; i++) {
      const b = ends[i];
      let back = false;
      for (let j = starts[b]; j < starts[b + 1] && !back; j++) back = ends[j] === a;
      if (!back) out.push(a, b);
    }
  }
  return out;
}
