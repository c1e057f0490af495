// Spatial index of triangles: heights, ray intersections and sections in double precision.

class SurfaceIndex {
  /** x, y, z: coordinates of vertices; corners: three vertices per triangle. */
  constructor(x, y, z, corners, bounds) {
    Object.assign(this, { x, y, z, corners, bounds });
    const triangles = corners.length / 3;
    const [width, height] = [bounds.x[1] - bounds.x[0] || 1, bounds.y[1] - bounds.y[0] || 1];
    const cells = Math.max(1, triangles / 2);
    this.columns = Math.max(1, Math.min(4096, Math.round(Math.sqrt(cells * (width / height)))));
    this.lines = Math.max(1, Math.min(4096, Math.round(cells / this.columns)));
    this.size = [width / this.columns, height / this.lines];
    this.fill(triangles);
  }

  column(x) {
    return Math.min(this.columns - 1, Math.max(0, Math.floor((x - this.bounds.x[0]) / this.size[0])));
  }

  line(y) {
    return Math.min(this.lines - 1, Math.max(0, Math.floor((y - this.bounds.y[0]) / this.size[1])));
  }

  /** Triangles by the cells that their boxes touch: one list, and the start of each cell in it. */
  fill(triangles) {
    const starts = new Uint32Array(this.columns * this.lines + 1);
    this.boxes(triangles, (cell) => { starts[cell + 1]++; });
    for (let i = 0; i + 1 < starts.length; i++) starts[i + 1] += starts[i];
    const list = new Uint32Array(starts[starts.length - 1]);
    const next = starts.slice();
    this.boxes(triangles, (cell, t) => { list[next[cell]++] = t; });
    Object.assign(this, { starts, list });
  }

  boxes(triangles, each) {
    const { x, y, corners } = this;
    for (let t = 0; t < triangles; t++) {
      const [a, b, c] = [corners[3 * t], corners[3 * t + 1], corners[3 * t + 2]];
      const [west, east] = [Math.min(x[a], x[b], x[c]), Math.max(x[a], x[b], x[c])];
      const [south, north] = [Math.min(y[a], y[b], y[c]), Math.max(y[a], y[b], y[c])];
      const [c0, c1, r0, r1] = [this.column(west), this.column(east), this.line(south), this.line(north)];
      for (let r = r0; r <= r1; r++) for (let k = c0; k <= c1; k++) each(r * this.columns + k, t);
    }
  }

  /** Height of a triangle at a position in it; NaN outside. */
  heightIn(t, px, py) {
    const { x, y, z, corners } = this;
    const [a, b, c] = [corners[3 * t], corners[3 * t + 1], corners[3 * t + 2]];
    const [ux, uy, vx, vy] = [x[b] - x[a], y[b] - y[a], x[c] - x[a], y[c] - y[a]];
    const area = ux * vy - uy * vx;
    if (area === 0) return NaN;
    const v = (ux * (py - y[a]) - uy * (px - x[a])) / area;
    const u = ((px - x[a]) * vy - (py - y[a]) * vx) / area;
    const edge = -1e-9;
    if (!(u >= edge && v >= edge && u + v <= 1 - edge)) return NaN;
    return z[a] + u * (z[b] - z[a]) + v * (z[c] - z[a]);
  }

  /** The highest surface at a position: its triangle and height; null without one. */
  at(px, py) {
    const { x, y } = this.bounds;
    if (!(px >= x[0] && px <= x[1] && py >= y[0] && py <= y[1])) return null;
    const cell = this.line(py) * this.columns + this.column(px);
    let best = null;
    for (let i = this.starts[cell]; i < this.starts[cell + 1]; i++) {
      const height = this.heightIn(this.list[i], px, py);
      if (height > (best?.z ?? -Infinity)) best = { triangle: this.list[i], x: px, y: py, z: height };
    }
    return best;
  }

  /** Calls `each` for the cells along a line from `from` to `to` ([x, y]), until it returns true. */
  walk(from, to, each) {
    const d = [to[0] - from[0], to[1] - from[1]];
    let [c, r] = [this.column(from[0]), this.line(from[1])];
    const last = [this.column(to[0]), this.line(to[1])];
    const step = d.map((v) => (v > 0 ? 1 : -1));
    const rim = (k, axis) => this.bounds['xy'[axis]][0] + (k + (d[axis] > 0 ? 1 : 0)) * this.size[axis];
    const next = (k, axis) => (d[axis] === 0 ? Infinity : (rim(k, axis) - from[axis]) / d[axis]);
    for (let guard = this.columns + this.lines + 2; guard > 0; guard--) {
      if (each(r * this.columns + c) || (c === last[0] && r === last[1])) return;
      if (next(c, 0) < next(r, 1)) c += step[0]; else r += step[1];
      if (c < 0 || r < 0 || c >= this.columns || r >= this.lines) return;
    }
  }

  /** The part of a line within the bounding box, as two shares of it; null if there is none. */
  clip(from, d) {
    let [low, high] = [0, 1];
    for (const [axis, name] of [[0, 'x'], [1, 'y']]) {
      const [a, b] = this.bounds[name].map((edge) => (edge - from[axis]) / d[axis]);
      if (d[axis] === 0) {
        if (from[axis] < this.bounds[name][0] || from[axis] > this.bounds[name][1]) return null;
      } else {
        [low, high] = [Math.max(low, Math.min(a, b)), Math.min(high, Math.max(a, b))];
      }
    }
    return low <= high ? [low, high] : null;
  }

  /** The first triangle that a ray from `from` along `d` (in the data's units, long enough) hits. */
  hit(from, d) {
    const part = this.clip(from, d);
    if (!part) return null;
    const ends = part.map((t) => [from[0] + d[0] * t, from[1] + d[1] * t]);
    let best = null;
    const seen = (t) => best && t > best.share + 1e-12;
    this.walk(ends[0], ends[1], (cell) => {
      for (let i = this.starts[cell]; i < this.starts[cell + 1]; i++) {
        const share = this.meet(this.list[i], from, d);
        if (share >= 0 && !seen(share)) best = { share, triangle: this.list[i] };
      }
      // A hit in this cell hides all behind it, unless it lies in a later cell.
      if (!best) return false;
      const [hx, hy] = [from[0] + d[0] * best.share, from[1] + d[1] * best.share];
      return this.line(hy) * this.columns + this.column(hx) === cell;
    });
    if (!best) return null;
    const [hx, hy] = [from[0] + d[0] * best.share, from[1] + d[1] * best.share];
    return { triangle: best.triangle, x: hx, y: hy, z: from[2] + d[2] * best.share };
  }

  /** The share of a ray at which it hits a triangle; NaN if it misses (Möller & Trumbore, 1997). */
  meet(t, from, d) {
    const { x, y, z, corners } = this;
    const [a, b, c] = [corners[3 * t], corners[3 * t + 1], corners[3 * t + 2]];
    const u = [x[b] - x[a], y[b] - y[a], z[b] - z[a]];
    const v = [x[c] - x[a], y[c] - y[a], z[c] - z[a]];
    const p = cross(d, v);
    const volume = dot(u, p);
    if (volume === 0) return NaN;
    const s = [from[0] - x[a], from[1] - y[a], from[2] - z[a]];
    const along1 = dot(s, p) / volume;
    const q = cross(s, u);
    const along2 = dot(d, q) / volume;
    if (!(along1 >= -1e-9 && along2 >= -1e-9 && along1 + along2 <= 1 + 1e-9)) return NaN;
    return dot(v, q) / volume;
  }

  /** Intersections of a section from `from` to `to` with edges: [share, height] by share, in pieces by triangle. */
  section(from, to) {
    const seen = new Set();
    const pieces = [];
    const d = [to[0] - from[0], to[1] - from[1]];
    const part = this.clip(from, d);
    if (!part) return [];
    const ends = part.map((t) => [from[0] + d[0] * t, from[1] + d[1] * t]);
    this.walk(ends[0], ends[1], (cell) => {
      for (let i = this.starts[cell]; i < this.starts[cell + 1]; i++) {
        const t = this.list[i];
        if (seen.has(t)) continue;
        seen.add(t);
        const piece = this.piece(t, from, d);
        if (piece) pieces.push(piece);
      }
      return false;
    });
    return pieces.sort((a, b) => a[0][0] - b[0][0] || a[1][0] - b[1][0]);
  }

  /** The intersection of a line and a triangle: its two ends as [share, height]. */
  piece(t, from, d) {
    const { x, y, z, corners } = this;
    const ids = [corners[3 * t], corners[3 * t + 1], corners[3 * t + 2]];
    const side = ids.map((i) => d[0] * (y[i] - from[1]) - d[1] * (x[i] - from[0]));
    const length = d[0] * d[0] + d[1] * d[1];
    const place = (i) => (d[0] * (x[i] - from[0]) + d[1] * (y[i] - from[1])) / length;
    const found = [];
    for (let k = 0; k < 3; k++) {
      const [i, j] = [ids[k], ids[(k + 1) % 3]];
      const [a, b] = [side[k], side[(k + 1) % 3]];
      if (a === 0) found.push([place(i), z[i]]);
      else if (a * b < 0) {
        const s = a / (a - b);
        found.push([place(i) + s * (place(j) - place(i)), z[i] + s * (z[j] - z[i])]);
      }
    }
    if (found.length < 2) return null;
    found.sort((a, b) => a[0] - b[0]);
    const [low, high] = [found[0], found[found.length - 1]];
    if (high[0] <= 0 || low[0] >= 1 || high[0] === low[0]) return null;
    const cut = (share) => [share, low[1] + ((high[1] - low[1]) * (share - low[0])) / (high[0] - low[0])];
    return [low[0] < 0 ? cut(0) : low, high[0] > 1 ? cut(1) : high];
  }
}
