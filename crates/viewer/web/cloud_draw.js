// Rendering of points into two images: colours, and ids with depths. The second image serves picking under the cursor
// and eye-dome lighting of the first.

const POINT_VERTEX = `#version 300 es
precision highp float;
precision highp int;
in uint x, y, z, marks, intensity, rgb;
uniform mat4 view;
uniform vec3 middle, scale;
uniform float exaggeration, size, reach;
uniform vec2 heights, strengths;
uniform int colour;
uniform highp sampler2D palette, kinds;
out vec3 tint;
out float wide;
flat out uvec2 known;

vec4 kind(uint which, int line) {
  return texelFetch(kinds, ivec2(int(which), line), 0);
}

float share(float value, vec2 range) {
  return clamp((value - range.x) / max(1e-9, range.y - range.x), 0.0, 1.0);
}

void main() {
  vec4 of_class = kind(marks & 255u, 0), of_return = kind(marks >> 8u & 15u, 1);
  gl_Position = view * vec4((vec3(x, y, z) - middle) * scale * vec3(1, 1, exaggeration), 1);
  // Near points are larger, up to a limit.
  wide = clamp(size * reach / max(gl_Position.w, 1e-6), 1.0, 3.0 * size);
  gl_PointSize = wide;
  known = uvec2(gl_VertexID + 1, floatBitsToUint(gl_Position.w));
  if (min(of_class.a, of_return.a) < 0.5) gl_Position = vec4(2, 2, 2, 1);
  tint = colour == 0 ? texture(palette, vec2(share(float(z), heights) * 255.0 / 256.0 + 0.5 / 256.0, 0.5)).rgb
    : colour == 1 ? of_class.rgb
    : colour == 2 ? vec3(0.08 + 0.9 * sqrt(share(float(intensity), strengths)))
    : colour == 3 ? of_return.rgb
    : vec3(rgb & 255u, rgb >> 8u & 255u, rgb >> 16u & 255u) / 255.0;
}`;

const POINT_FRAGMENT = `#version 300 es
precision highp float;
precision highp int;
in vec3 tint;
in float wide;
flat in uvec2 known;
layout(location = 0) out vec4 seen;
layout(location = 1) out uvec2 what;
void main() {
  vec2 from = 2.0 * gl_PointCoord - 1.0;
  if (wide > 2.5 && dot(from, from) > 1.0) discard;
  seen = vec4(tint, 1);
  what = known;
}`;

const SHADE_VERTEX = `#version 300 es
void main() {
  gl_Position = vec4(gl_VertexID == 1 ? 3 : -1, gl_VertexID == 2 ? 3 : -1, 0, 1);
}`;

// Darkens pixels with nearer neighbours (eye-dome lighting, Boucheny 2009), sampled on a circle.
const SHADE_FRAGMENT = `#version 300 es
precision highp float;
precision highp int;
precision highp usampler2D;
uniform sampler2D colours;
uniform usampler2D points;
uniform float radius, strength;
uniform vec3 sky;
out vec4 seen;

void main() {
  ivec2 here = ivec2(gl_FragCoord.xy), last = textureSize(points, 0) - 1;
  uvec2 own = texelFetch(points, here, 0).rg;
  if (own.x == 0u) { seen = vec4(sky, 1); return; }
  float depth = log2(uintBitsToFloat(own.g)), sum = 0.0;
  for (int k = 0; k < 8; k++) {
    float angle = 0.785398 * float(k);
    ivec2 there = clamp(here + ivec2(round(radius * vec2(cos(angle), sin(angle)))), ivec2(0), last);
    uvec2 other = texelFetch(points, there, 0).rg;
    if (other.x != 0u) sum += max(0.0, depth - log2(uintBitsToFloat(other.g)));
  }
  seen = vec4(texelFetch(colours, here, 0).rgb * max(0.35, exp(-strength * sum / 8.0)), 1);
}`;

/** Number of points culled together. */
const RUN = 1 << 15;
/** Picking radius in pixels. */
const NEAR = 7;
const SKY = [0.886, 0.914, 0.937];
const ATTRIBUTES = ['x', 'y', 'z', 'marks', 'intensity', 'rgb'];

class CloudDrawing {
  /** `data`: codes of x, y and z, marks, intensities and colours or null; `ground`: metres of a step along each axis;
      `heights`: codes of z that the scene reaches between, whatever lies far off. */
  constructor(canvas, data, ground, [low, high]) {
    const gl = canvas.getContext('webgl2', { antialias: false, preserveDrawingBuffer: false, powerPreference: 'high-performance' });
    if (!gl) throw new Error('this browser does not support WebGL 2');
    Object.assign(this, { gl, canvas, data, scale: ground, points: data.x.length, drawn: 0 });
    const top = (codes) => codes.reduce((most, code) => (code > most ? code : most), 0);
    this.top = [data.x, data.y, data.z].map(top);
    this.middle = [this.top[0] / 2, this.top[1] / 2, (low + high) / 2];
    const half = [this.top[0], this.top[1], high - low].map((codes, k) => (codes / 2) * ground[k]);
    this.radius = Math.max(Math.hypot(half[0], half[1]), half[2]) || 1;
    this.program = linked(gl, POINT_VERTEX, POINT_FRAGMENT);
    this.shading = linked(gl, SHADE_VERTEX, SHADE_FRAGMENT);
    this.upload();
    this.makeRuns();
    [this.palette, this.kinds] = [gl.createTexture(), gl.createTexture()];
    [this.empty, this.size] = [gl.createVertexArray(), [0, 0]];
  }

  upload() {
    const { gl, data, program: { program } } = this;
    this.array = gl.createVertexArray();
    gl.bindVertexArray(this.array);
    for (const name of ATTRIBUTES) {
      const slot = gl.getAttribLocation(program, name);
      if (!data[name]) { gl.vertexAttribI4ui(slot, 0, 0, 0, 0); continue; }
      gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
      gl.bufferData(gl.ARRAY_BUFFER, data[name], gl.STATIC_DRAW);
      gl.enableVertexAttribArray(slot);
      gl.vertexAttribIPointer(slot, 1, gl.UNSIGNED_INT, 0, 0);
    }
    gl.bindVertexArray(null);
  }

  /** Bounding boxes of runs of points, for culling. */
  makeRuns() {
    const { data, points } = this;
    this.runs = [];
    for (let first = 0; first < points; first += RUN) {
      const end = Math.min(points, first + RUN);
      const [low, high] = [[Infinity, Infinity, Infinity], [-Infinity, -Infinity, -Infinity]];
      [data.x, data.y, data.z].forEach((codes, k) => {
        for (let i = first; i < end; i++) {
          if (codes[i] < low[k]) low[k] = codes[i];
          if (codes[i] > high[k]) high[k] = codes[i];
        }
      });
      this.runs.push({ first, count: end - first, low, high });
    }
  }

  /** 256 colours of heights, as [r, g, b] from 0 to 255. */
  paint(colours) {
    ramp(this.gl, this.palette, 2, colours);
  }

  /** Colours and visibility of classes and returns: two lines of 256 [r, g, b, shown]. */
  paintKinds(lines) {
    const gl = this.gl;
    gl.activeTexture(gl.TEXTURE3);
    gl.bindTexture(gl.TEXTURE_2D, this.kinds);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
    const bytes = Uint8Array.from(lines.flat(2));
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, 256, 2, 0, gl.RGBA, gl.UNSIGNED_BYTE, bytes);
  }

  /** Framebuffers of the size of the view. */
  target() {
    const { gl, canvas: { width, height } } = this;
    if (this.size[0] === width && this.size[1] === height) return;
    this.size = [width, height];
    this.buffer ??= gl.createFramebuffer();
    this.pictures ??= [gl.createTexture(), gl.createTexture()];
    this.depth ??= gl.createRenderbuffer();
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.buffer);
    [[gl.RGBA8, gl.RGBA, gl.UNSIGNED_BYTE], [gl.RG32UI, gl.RG_INTEGER, gl.UNSIGNED_INT]].forEach(([inside, format, kind], i) => {
      gl.activeTexture(gl.TEXTURE0 + i);
      gl.bindTexture(gl.TEXTURE_2D, this.pictures[i]);
      gl.texImage2D(gl.TEXTURE_2D, 0, inside, width, height, 0, format, kind, null);
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
      gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0 + i, gl.TEXTURE_2D, this.pictures[i], 0);
    });
    gl.bindRenderbuffer(gl.RENDERBUFFER, this.depth);
    gl.renderbufferStorage(gl.RENDERBUFFER, gl.DEPTH_COMPONENT24, width, height);
    gl.framebufferRenderbuffer(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.RENDERBUFFER, this.depth);
    gl.drawBuffers([gl.COLOR_ATTACHMENT0, gl.COLOR_ATTACHMENT1]);
  }

  /** Draws the points. `how`: exaggeration, colour (0 to 4), size in pixels of the screen, shade, heights, strengths. */
  draw(camera, how) {
    const { gl, canvas, program: { program, at } } = this;
    const m = camera.matrix;
    this.target();
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.buffer);
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.clearBufferfv(gl.COLOR, 0, [...SKY, 1]);
    gl.clearBufferuiv(gl.COLOR, 1, [0, 0, 0, 0]);
    gl.clearBufferfv(gl.DEPTH, 0, [1]);
    gl.enable(gl.DEPTH_TEST);
    gl.useProgram(program);
    gl.bindVertexArray(this.array);
    gl.uniformMatrix4fv(at.view, false, new Float32Array(m));
    gl.uniform3f(at.middle, ...this.middle);
    gl.uniform3f(at.scale, ...this.scale);
    gl.uniform1f(at.exaggeration, how.exaggeration);
    gl.uniform1f(at.size, how.size);
    gl.uniform1f(at.reach, camera.radius * 2.6);
    gl.uniform2f(at.heights, ...how.heights);
    gl.uniform2f(at.strengths, ...how.strengths);
    gl.uniform1i(at.colour, how.colour);
    gl.uniform1i(at.palette, 2);
    gl.uniform1i(at.kinds, 3);
    this.drawn = 0;
    for (const run of this.runs) {
      if (unseen(run, m, this, how.exaggeration)) continue;
      gl.drawArrays(gl.POINTS, run.first, run.count);
      this.drawn += run.count;
    }
    this.shade(how);
  }

  shade(how) {
    const { gl, shading: { program, at } } = this;
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.disable(gl.DEPTH_TEST);
    gl.useProgram(program);
    gl.bindVertexArray(this.empty);
    gl.uniform1i(at.colours, 0);
    gl.uniform1i(at.points, 1);
    gl.uniform1f(at.radius, Math.max(1.5, 0.6 * how.size));
    gl.uniform1f(at.strength, how.shade ? 45 : 0);
    gl.uniform3f(at.sky, ...SKY);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }

  /** The point that is drawn nearest to a place of the view, as shares of its width and height from the upper left;
      null where there is none within a few pixels. */
  pick(across, down) {
    const { gl, canvas: { width, height } } = this;
    const [px, py] = [Math.floor(across * width), height - 1 - Math.floor(down * height)];
    const [left, low] = [Math.max(0, px - NEAR), Math.max(0, py - NEAR)];
    const [columns, lines] = [Math.min(width, px + NEAR + 1) - left, Math.min(height, py + NEAR + 1) - low];
    if (columns <= 0 || lines <= 0) return null;
    const words = new Uint32Array(4 * columns * lines);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.buffer);
    gl.readBuffer(gl.COLOR_ATTACHMENT1);
    gl.readPixels(left, low, columns, lines, gl.RGBA_INTEGER, gl.UNSIGNED_INT, words);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    let [best, least] = [null, Infinity];
    for (let i = 0; i < columns * lines; i++) {
      const away = (left + (i % columns) - px) ** 2 + (low + Math.floor(i / columns) - py) ** 2;
      if (words[4 * i] > 0 && away < least) [best, least] = [words[4 * i] - 1, away];
    }
    return best;
  }
}
