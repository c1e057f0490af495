// Rendering of lines: the original as thin lines, the simplified lines as ribbons.

const THIN_VERTEX = `#version 300 es
precision highp float;
in vec2 place;
uniform vec2 middle, rest, scale;
uniform float size;
void main() {
  gl_Position = vec4((place - middle - rest) * scale, 0, 1);
  gl_PointSize = size;
}`;

const THIN_FRAGMENT = `#version 300 es
precision highp float;
uniform vec4 colour;
uniform bool round_;
out vec4 seen;
void main() {
  if (round_ && length(gl_PointCoord - 0.5) > 0.5) discard;
  seen = vec4(colour.rgb * colour.a, colour.a);
}`;

// A quad between two vertices; a negative one is a break.
const RIBBON_VERTEX = `#version 300 es
precision highp float;
in vec2 from, to;
uniform vec2 middle, rest, scale, pixel;
uniform float thick;
out float across;
void main() {
  vec2 a = (from - middle - rest) * scale, b = (to - middle - rest) * scale;
  vec2 along = (b - a) / pixel;
  float far = length(along);
  vec2 unit = far > 0.0 ? along / far : vec2(1, 0);
  float side = (gl_VertexID & 1) == 0 ? -1.0 : 1.0;
  bool head = gl_VertexID > 1;
  float half_ = thick * 0.5 + 0.75;
  vec2 corner = (head ? b : a) + (vec2(-unit.y, unit.x) * side + unit * (head ? 0.4 : -0.4)) * half_ * pixel;
  across = side * half_;
  gl_Position = from.x < 0.0 || to.x < 0.0 ? vec4(2, 2, 2, 1) : vec4(corner, 0, 1);
}`;

const RIBBON_FRAGMENT = `#version 300 es
precision highp float;
in float across;
uniform vec4 colour;
uniform float thick;
out vec4 seen;
void main() {
  float alpha = colour.a * clamp(thick * 0.5 + 0.5 - abs(across), 0.0, 1.0);
  seen = vec4(colour.rgb * alpha, alpha);
}`;

/** Primitive restart index, above all ids of vertices. */
const RESTART = 0xffffffff;

class LinesDrawing {
  constructor(canvas, filter) {
    const gl = canvas.getContext('webgl2', { antialias: true, alpha: false });
    if (!gl) throw new Error('this browser does not support WebGL 2');
    Object.assign(this, { gl, canvas, places: 0 });
    this.thin = linked(gl, THIN_VERTEX, THIN_FRAGMENT).program;
    this.ribbon = linked(gl, RIBBON_VERTEX, RIBBON_FRAGMENT).program;
    this.setOriginal(filter);
    this.kept = gl.createBuffer();
    gl.bindBuffer(gl.ARRAY_BUFFER, this.kept);
    gl.bufferData(gl.ARRAY_BUFFER, filter.out.byteLength, gl.DYNAMIC_DRAW);
    this.ribbons = this.attributes(this.ribbon, [['from', 0, 1], ['to', 8, 1]]);
    this.points = this.attributes(this.thin, [['place', 0, 0]]);
  }

  /** An attribute array of the bound buffer: name, offset in bytes, true if per ribbon. */
  attributes(program, list) {
    const gl = this.gl;
    const array = gl.createVertexArray();
    gl.bindVertexArray(array);
    for (const [name, offset, divisor] of list) {
      const slot = gl.getAttribLocation(program, name);
      gl.enableVertexAttribArray(slot);
      gl.vertexAttribPointer(slot, 2, gl.FLOAT, false, 8, offset);
      gl.vertexAttribDivisor(slot, divisor);
    }
    gl.bindVertexArray(null);
    return array;
  }

  setOriginal({ x, y, parts }) {
    const gl = this.gl;
    const places = new Float32Array(2 * x.length);
    for (let i = 0; i < x.length; i++) {
      places[2 * i] = x[i];
      places[2 * i + 1] = y[i];
    }
    const ids = new Uint32Array(x.length + 2 * parts.length);
    let [at, vertex] = [0, 0];
    for (const part of parts) {
      const first = vertex;
      for (const end = vertex + (part >>> 1); vertex < end; vertex++) ids[at++] = vertex;
      if (part & 1) ids[at++] = first;
      ids[at++] = RESTART;
    }
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, places, gl.STATIC_DRAW);
    this.original = this.attributes(this.thin, [['place', 0, 0]]);
    gl.bindVertexArray(this.original);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, ids, gl.STATIC_DRAW);
    gl.bindVertexArray(null);
    this.ids = at;
  }

  /** Uploads the result of a filter. */
  take(out, places) {
    const gl = this.gl;
    gl.bindBuffer(gl.ARRAY_BUFFER, this.kept);
    gl.bufferSubData(gl.ARRAY_BUFFER, 0, out, 0, 2 * places);
    this.places = places;
  }

  uniforms(program, view, colour) {
    const gl = this.gl;
    gl.useProgram(program);
    const at = (name) => gl.getUniformLocation(program, name);
    // Codes are integers that floats represent: the fraction of the centre is subtracted separately.
    gl.uniform2f(at('middle'), ...view.middle.map(Math.floor));
    gl.uniform2f(at('rest'), ...view.middle.map((v) => v - Math.floor(v)));
    gl.uniform2f(at('scale'), ...view.scale);
    gl.uniform4f(at('colour'), ...colour);
    return at;
  }

  draw(view, how) {
    const { gl, canvas } = this;
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.clearColor(0.965, 0.972, 0.978, 1);
    gl.clear(gl.COLOR_BUFFER_BIT);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    if (how.original) {
      const at = this.uniforms(this.thin, view, [0.48, 0.54, 0.6, 0.75]);
      gl.uniform1f(at('size'), 1);
      gl.uniform1i(at('round_'), 0);
      gl.bindVertexArray(this.original);
      gl.drawElements(gl.LINE_STRIP, this.ids, gl.UNSIGNED_INT, 0);
    }
    if (this.places < 2) return;
    const at = this.uniforms(this.ribbon, view, [0.784, 0.27, 0.19, 0.95]);
    gl.uniform1f(at('thick'), how.thick);
    gl.uniform2f(at('pixel'), 2 / canvas.width, 2 / canvas.height);
    gl.bindVertexArray(this.ribbons);
    gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, this.places - 1);
    if (how.dots) {
      const dot = this.uniforms(this.thin, view, [0.09, 0.13, 0.2, 1]);
      gl.uniform1f(dot('size'), how.thick * 2.6);
      gl.uniform1i(dot('round_'), 1);
      gl.bindVertexArray(this.points);
      gl.drawArrays(gl.POINTS, 0, this.places);
    }
    gl.bindVertexArray(null);
  }
}
