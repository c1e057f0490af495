// Rendering of tiles: three separate vertices per triangle, relative to the centre of the tile. The offset from the eye
// is computed in doubles, so that nothing jitters.

const TILE_VERTEX = `#version 300 es
precision highp float;
in vec3 place;
in float height;
in vec2 within;
in vec4 aside; // normal; 1 for the lower end of a skirt
uniform mat4 view;
uniform mat3 turned;
uniform vec3 offset, middle;
uniform float exaggeration, skirt;
out vec3 edge;
centroid out vec3 normal;
centroid out vec3 above;
out vec3 at;
out vec2 inside;
centroid out float level;
out float hang;

void main() {
  int corner = gl_VertexID % 3;
  edge = vec3(corner == 0, corner == 1, corner == 2);
  vec3 up = normalize(place * vec3(1, 1, ${1 / (1 - SQUASH)}) + middle);
  vec3 raised = place + up * (height * (exaggeration - 1.0) - aside.w * skirt);
  at = turned * raised + offset;
  normal = turned * aside.xyz;
  above = turned * up;
  inside = within;
  level = height;
  hang = aside.w;
  gl_Position = view * vec4(at, 1);
}`;

const TILE_FRAGMENT = `#version 300 es
precision highp float;
in vec3 edge;
centroid in vec3 normal;
centroid in vec3 above;
in vec3 at;
in vec2 inside;
centroid in float level;
in float hang;
uniform sampler2D palette;
uniform vec2 range;
uniform vec4 data; // bounds of the data in the tile
uniform vec3 light, pole, tint;
uniform float exaggeration, wire, horizon, haze, error;
uniform int colour, quarters;
uniform bool facets, borders, smooth_;
out vec4 seen;

// Distance of a value from 0, in pixels.
vec2 pixels(vec2 value) { return abs(value) / max(fwidth(inside), vec2(1e-9)); }

void main() {
  int quarter = int(inside.x >= 0.5) | (int(inside.y >= 0.5) << 1);
  vec3 up = normalize(above);
  vec3 facet = normalize(cross(dFdx(at), dFdy(at)));
  facet *= dot(facet, up) < 0.0 ? -1.0 : 1.0;
  vec2 rim = min(pixels(inside), pixels(1.0 - inside));
  if (quarters != 15) rim = min(rim, pixels(inside - 0.5));
  vec3 width = fwidth(edge);
  if ((quarters >> quarter & 1) == 0) discard;
  float rise = dot(facet, up);
  vec3 n = facet;
  if (smooth_ && !facets) {
    float own = dot(normal, up);
    n = normalize((normal - own * up) * exaggeration + own * up);
    rise = own / max(1e-6, length(normal));
  } else rise = normalize(vec2(length(facet - rise * up), rise * exaggeration)).y;
  float steep = degrees(acos(clamp(rise, 0.0, 1.0)));
  float of = colour == 1 ? (level - range.x) / max(1e-9, range.y - range.x) : colour == 2 ? steep / 60.0 : error;
  vec3 shade = colour == 0 ? vec3(0.86, 0.85, 0.82) : colour == 3 ? tint : texture(palette, vec2(clamp(of, 0.002, 0.998), 0.5)).rgb;
  vec4 out_ = vec4(data.xy - inside, inside - data.zw);
  if (max(max(out_.x, out_.y), max(out_.z, out_.w)) > 0.0) shade = mix(vec3(0.8, 0.82, 0.84), shade, 0.18);
  vec3 east = normalize(cross(pole, up));
  float sun = max(0.0, dot(n, east * light.x + cross(up, east) * light.y + up * light.z));
  float lit = colour > 2 ? 0.55 + 0.47 * sun : 0.3 + 0.16 * dot(n, up) + 0.72 * sun;
  vec3 shown = shade * lit + vec3(0.05, 0.045, 0.03) * sun * sun;
  shown = mix(shown, vec3(0.86, 0.9, 0.94), haze * clamp(length(at) / horizon - 0.1, 0.0, 0.8));
  if (wire > 0.0) {
    vec3 near = smoothstep(vec3(0.3), vec3(1.1), edge / max(width, vec3(1e-7)));
    float line = 1.0 - min(near.x, min(near.y, near.z));
    float dense = max(width.x, max(width.y, width.z));
    shown = mix(shown, vec3(0.07, 0.1, 0.17), line * wire * clamp(0.42 / dense - 0.5, 0.1, 0.62));
  }
  if (borders && hang < 0.001) shown = mix(vec3(0.72, 0.16, 0.1), shown, smoothstep(0.5, 1.5, min(rim.x, rim.y)));
  seen = vec4(shown, 1);
}`;

/** Bytes of a vertex: position, height, position in the tile, normal. */
const VERTEX_BYTES = 24;
const ATTRIBUTES = [['place', 3, 'FLOAT', false, 0], ['height', 1, 'FLOAT', false, 12],
  ['within', 2, 'UNSIGNED_SHORT', true, 16], ['aside', 4, 'BYTE', true, 20]];

class TilesDrawing {
  constructor(canvas) {
    const gl = canvas.getContext('webgl2', { antialias: true, preserveDrawingBuffer: false, powerPreference: 'high-performance' });
    if (!gl) throw new Error('this browser does not support WebGL 2');
    Object.assign(this, { gl, canvas, palette: gl.createTexture() });
    this.program = linked(gl, TILE_VERTEX, TILE_FRAGMENT);
    this.slots = ATTRIBUTES.map(([name]) => gl.getAttribLocation(this.program.program, name));
  }

  paint(colours) {
    ramp(this.gl, this.palette, 0, colours);
  }

  /** Uploads a tile; returns the bytes that it takes in both memories. */
  upload(mesh) {
    const gl = this.gl;
    const { order, starts } = byQuarter(mesh);
    const bytes = new ArrayBuffer(order.length * VERTEX_BYTES);
    const [floats, shorts, signs] = [new Float32Array(bytes), new Uint16Array(bytes), new Int8Array(bytes)];
    order.forEach(([vertex, low], i) => {
      floats.set(mesh.places.subarray(3 * vertex, 3 * vertex + 3), 6 * i);
      floats[6 * i + 3] = mesh.heights[vertex];
      shorts[12 * i + 8] = Math.round((mesh.u[vertex] / STEPS) * 65535);
      shorts[12 * i + 9] = Math.round((mesh.v[vertex] / STEPS) * 65535);
      for (let k = 0; k < 3; k++) signs[24 * i + 20 + k] = mesh.normals ? Math.round(mesh.normals[3 * vertex + k] * 127) : 0;
      signs[24 * i + 23] = low ? 127 : 0;
    });
    mesh.buffer = gl.createBuffer();
    mesh.array = gl.createVertexArray();
    mesh.starts = starts;
    gl.bindVertexArray(mesh.array);
    gl.bindBuffer(gl.ARRAY_BUFFER, mesh.buffer);
    gl.bufferData(gl.ARRAY_BUFFER, bytes, gl.STATIC_DRAW);
    ATTRIBUTES.forEach(([, size, kind, whole, offset], i) => {
      if (this.slots[i] < 0) return;
      gl.enableVertexAttribArray(this.slots[i]);
      gl.vertexAttribPointer(this.slots[i], size, gl[kind], whole, VERTEX_BYTES, offset);
    });
    gl.bindVertexArray(null);
    const kept = [mesh.u, mesh.v, mesh.heights, mesh.corners, mesh.places].reduce((sum, list) => sum + list.byteLength, 0);
    mesh.smooth = mesh.normals !== null;
    mesh.normals = null; // on the card
    return bytes.byteLength + kept;
  }

  release(mesh) {
    this.gl.deleteVertexArray(mesh.array);
    this.gl.deleteBuffer(mesh.buffer);
  }

  /** Draws tiles. `how`: exaggeration, colour (0 to 4), range, wire, facets, borders, light, allowed, pixels, tintOf, errorOf, bounds. */
  draw(camera, draws, how) {
    const { gl, canvas, program: { program, at } } = this;
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.clearColor(0.886, 0.914, 0.937, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    gl.useProgram(program);
    const { frame } = camera;
    const { east, north, up } = frame;
    const eye = frame.world(camera.eye);
    const { ground } = camera.horizon;
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, this.palette);
    gl.uniform1i(at.palette, 0);
    gl.uniformMatrix4fv(at.view, false, new Float32Array(camera.matrix));
    gl.uniformMatrix3fv(at.turned, false, [east[0], north[0], up[0], east[1], north[1], up[1], east[2], north[2], up[2]]);
    gl.uniform3f(at.light, ...how.light);
    gl.uniform3f(at.pole, ...frame.inward([0, 0, 1]));
    gl.uniform2f(at.range, ...how.range);
    gl.uniform1f(at.exaggeration, how.exaggeration);
    gl.uniform1f(at.wire, how.wire ? 1 : 0);
    gl.uniform1f(at.horizon, Math.max(ground, camera.distance * 4));
    gl.uniform1f(at.haze, 0.6 * Math.max(0, 1 - ground / 2e6));
    gl.uniform1i(at.colour, how.colour);
    gl.uniform1i(at.facets, how.facets ? 1 : 0);
    gl.uniform1i(at.borders, how.borders ? 1 : 0);
    this.triangles = 0;
    for (const { tile, quarters, distance, gap, isBare } of draws) {
      const { mesh } = tile;
      gl.uniform3f(at.offset, ...frame.inward(minus(mesh.middle, eye)));
      gl.uniform3f(at.middle, mesh.middle[0], mesh.middle[1], mesh.middle[2] / (1 - SQUASH));
      gl.uniform1f(at.skirt, 2 * Math.max(gap, tile.error) * how.exaggeration + (3 * how.allowed * (distance + tile.reach)) / how.pixels);
      gl.uniform1i(at.quarters, quarters);
      gl.uniform1i(at.smooth_, mesh.smooth ? 1 : 0);
      gl.uniform3f(at.tint, ...how.tintOf(tile));
      gl.uniform1f(at.error, how.errorOf(tile));
      gl.uniform4f(at.data, ...(isBare ? NOWHERE : part(tile, how.bounds)));
      gl.bindVertexArray(mesh.array);
      for (const [first, end] of runs(mesh.starts, quarters)) gl.drawArrays(gl.TRIANGLES, first, end - first);
      if (!isBare) this.triangles += mesh.corners.length / 3;
    }
    gl.bindVertexArray(null);
  }
}

const NOWHERE = [2, 2, 2, 2];

/** Bounds in degrees as 0 to 1 from the west and south of a tile. */
function part({ west, south, width }, [w, s, e, n]) {
  return [(w - west) / width, (s - south) / width, (e - west) / width, (n - south) / width];
}

/** Vertices of all triangles, grouped by quarter, with those in several quarters last, and the start of each group. So
 * hidden quarters cost little. */
function byQuarter(mesh) {
  const middle = STEPS / 2 + 1;
  const list = [...mesh.corners].map((vertex) => [vertex, 0]).concat(skirt(mesh));
  const groups = [[], [], [], [], []];
  for (let t = 0; t < list.length; t += 3) {
    const three = list.slice(t, t + 3);
    const halves = [mesh.u, mesh.v].map((steps) => {
      const all = three.map(([vertex]) => steps[vertex]);
      return Math.max(...all) <= middle ? 0 : Math.min(...all) >= middle - 2 ? 1 : null;
    });
    groups[halves.includes(null) ? 4 : halves[0] + 2 * halves[1]].push(...three);
  }
  const starts = [0];
  for (const group of groups) starts.push(starts[starts.length - 1] + group.length);
  return { order: groups.flat(), starts };
}

/** Ranges to draw for a set of quarters. */
function runs(starts, quarters) {
  if (quarters === ALL_QUARTERS) return [[0, starts[5]]];
  return [0, 1, 2, 3, 4].filter((q) => q === 4 || (quarters >> q) & 1).map((q) => [starts[q], starts[q + 1]]).filter(([a, b]) => b > a);
}

/** Skirts below the four sides, which hide gaps to tiles of other levels: vertices, and 1 for the lower end. */
function skirt({ u, v }) {
  const out = [];
  for (const [fixed, end, way] of [[u, 0, v], [v, 0, u], [u, STEPS, v], [v, STEPS, u]]) {
    const side = [...fixed.keys()].filter((i) => fixed[i] === end).sort((a, b) => way[a] - way[b]);
    for (let i = 1; i < side.length; i++) {
      const [a, b] = [side[i - 1], side[i]];
      out.push([a, 0], [b, 0], [a, 1], [b, 0], [b, 1], [a, 1]);
    }
  }
  return out;
}

/** The nearest hit of a ray in earth-centred coordinates, up to a distance: { tile, triangle, weights, distance }. */
function hit(draws, origin, way, exaggeration, most = Infinity) {
  let found = null;
  for (const { tile, quarters } of draws) {
    const { mesh } = tile;
    const from = minus(origin, mesh.middle);
    const nearest = -dot(from, way);
    const reach = mesh.reach + Math.abs(exaggeration - 1) * Math.max(Math.abs(mesh.low), Math.abs(mesh.high));
    if (Math.hypot(...along(from, way, nearest)) > reach || nearest + reach < 0) continue;
    const places = bentPlaces(mesh, exaggeration);
    for (let t = 0; t < mesh.corners.length / 3; t++) {
      const three = [0, 1, 2].map((k) => mesh.corners[3 * t + k]);
      const [a, b, c] = three.map((i) => [places[3 * i], places[3 * i + 1], places[3 * i + 2]]);
      const crossing = cut(from, way, a, b, c);
      if (!crossing || crossing.distance >= (found?.distance ?? most)) continue;
      const { weights } = crossing;
      const share = (steps) => three.reduce((sum, i, k) => sum + steps[i] * weights[k], 0) / STEPS;
      const quarter = Number(share(mesh.u) >= 0.5) | (Number(share(mesh.v) >= 0.5) << 1);
      if ((quarters >> quarter) & 1) found = { tile, three, ...crossing };
    }
  }
  return found;
}

/** Exaggerated positions of a tile, relative to its centre. */
function bentPlaces(mesh, exaggeration) {
  if (exaggeration === 1) return mesh.places;
  if (mesh.bent?.exaggeration === exaggeration) return mesh.bent.places;
  const places = new Float64Array(mesh.places.length);
  for (let i = 0; i < mesh.heights.length; i++) {
    const [x, y, z] = plus(mesh.middle, mesh.places.subarray(3 * i, 3 * i + 3));
    const up = norm([x, y, z / (1 - SQUASH)]);
    places.set(along(mesh.places.subarray(3 * i, 3 * i + 3), up, mesh.heights[i] * (exaggeration - 1)), 3 * i);
  }
  mesh.bent = { exaggeration, places };
  return places;
}

/** Intersection of a ray and a triangle, from either side (Möller & Trumbore 1997). */
function cut(from, way, a, b, c) {
  const [ab, ac] = [minus(b, a), minus(c, a)];
  const across = cross(way, ac);
  const size = dot(ab, across);
  if (size === 0) return null;
  const off = minus(from, a);
  const second = dot(off, across) / size;
  if (second < -1e-9 || second > 1 + 1e-9) return null;
  const beside = cross(off, ab);
  const third = dot(way, beside) / size;
  if (third < -1e-9 || second + third > 1 + 1e-9) return null;
  const distance = dot(ac, beside) / size;
  return distance > 0 ? { distance, weights: [1 - second - third, second, third] } : null;
}
