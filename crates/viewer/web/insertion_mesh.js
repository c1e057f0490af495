// Greedy insertion on a small grid: repeatedly, the sample with the largest error becomes a vertex.
// Garland & Heckbert 1995. Heights are integers, so every decision is exact; ties go to the lowest
// row and column. The result is that of `terrane tin --method greedy1` on the same heights.

class Insertion {
  /** z: heights by row and column; `flips`: Delaunay, or triangles are only split. */
  constructor(width, height, z, flips) {
    Object.assign(this, { width, height, z, flips });
    const most = 2 * width * height + 4;
    this.corners = new Int32Array(3 * most);
    this.twins = new Int32Array(3 * most).fill(-1);
    this.versions = new Int32Array(most);
    this.errors = new Float64Array(width * height);
    this.triangles = 0;
    this.vertices = [0, width - 1, width * height - 1, width * (height - 1)];
    this.squares = 0;
    this.flipped = 0;
    this.heap = [];
    const [a, b, c, d] = this.vertices;
    this.set(0, a, b, c);
    this.set(1, a, c, d);
    this.link(2, 3);
    this.triangles = 2;
    [0, 1].forEach((t) => this.scan(t));
  }

  set(t, a, b, c) {
    this.corners[3 * t] = a;
    this.corners[3 * t + 1] = b;
    this.corners[3 * t + 2] = c;
  }

  link(one, other) {
    if (one >= 0) this.twins[one] = other;
    if (other >= 0) this.twins[other] = one;
  }

  col(sample) { return sample % this.width; }

  row(sample) { return Math.floor(sample / this.width); }

  /** Twice the signed area of three samples: positive if they turn from columns to rows. */
  turn(a, b, c) {
    const [ax, ay] = [this.col(a), this.row(a)];
    return (this.col(b) - ax) * (this.row(c) - ay) - (this.row(b) - ay) * (this.col(c) - ax);
  }

  /** Positive if d lies within the circumcircle of a, b and c. */
  inCircle(a, b, c, d) {
    const [dx, dy] = [this.col(d), this.row(d)];
    const [ax, ay, bx, by, cx, cy] = [a, b, c].flatMap((s) => [this.col(s) - dx, this.row(s) - dy]);
    const [aa, bb, cc] = [ax * ax + ay * ay, bx * bx + by * by, cx * cx + cy * cy];
    return aa * (bx * cy - by * cx) - bb * (ax * cy - ay * cx) + cc * (ax * by - ay * bx);
  }

  /** Measures the samples of a triangle and stores the worst. */
  scan(t) {
    const { width, z, errors, corners } = this;
    const [a, b, c] = [corners[3 * t], corners[3 * t + 1], corners[3 * t + 2]];
    const [ax, ay, bx, by, cx, cy] = [a, b, c].flatMap((s) => [this.col(s), this.row(s)]);
    const total = this.turn(a, b, c);
    let [worst, place] = [0, -1];
    for (let row = Math.min(ay, by, cy); row <= Math.max(ay, by, cy); row++) {
      for (let col = Math.min(ax, bx, cx); col <= Math.max(ax, bx, cx); col++) {
        const wa = (cx - bx) * (row - by) - (cy - by) * (col - bx);
        const wb = (ax - cx) * (row - cy) - (ay - cy) * (col - cx);
        const wc = (bx - ax) * (row - ay) - (by - ay) * (col - ax);
        if (wa < 0 || wb < 0 || wc < 0) continue;
        const at = row * width + col;
        const own = z[at];
        const error = Math.abs(wa * (z[a] - own) + wb * (z[b] - own) + wc * (z[c] - own)) / total;
        this.squares += error * error - errors[at] * errors[at];
        errors[at] = error;
        if (error > worst) { worst = error; place = at; }
      }
    }
    this.versions[t]++;
    if (place >= 0) this.push({ error: worst, at: place, t, version: this.versions[t] });
  }

  /** The next vertex: the sample with the largest error; for ties the lowest row and column. */
  get worst() {
    while (this.heap.length > 0 && this.versions[this.heap[0].t] !== this.heap[0].version) this.pop();
    return this.heap[0] ?? null;
  }

  before(a, b) { return a.error > b.error || (a.error === b.error && a.at < b.at); }

  push(entry) {
    const { heap } = this;
    let i = heap.push(entry) - 1;
    while (i > 0 && this.before(heap[i], heap[(i - 1) >> 1])) {
      const up = (i - 1) >> 1;
      [heap[i], heap[up]] = [heap[up], heap[i]];
      i = up;
    }
  }

  pop() {
    const { heap } = this;
    const last = heap.pop();
    if (heap.length === 0) return;
    heap[0] = last;
    for (let i = 0; ;) {
      let next = i;
      for (const k of [2 * i + 1, 2 * i + 2]) if (k < heap.length && this.before(heap[k], heap[next])) next = k;
      if (next === i) return;
      [heap[i], heap[next]] = [heap[next], heap[i]];
      i = next;
    }
  }

  /** Inserts the worst sample; false if all errors are 0. */
  step() {
    const worst = this.worst;
    if (!worst) return false;
    this.vertices.push(worst.at);
    for (const t of this.insert(worst.t, worst.at)) this.scan(t);
    return true;
  }

  /** Inserts a sample of triangle `t`; returns the triangles around it. */
  insert(t, p) {
    const sides = [0, 1, 2].map((k) => this.turn(this.corners[3 * t + k], this.corners[3 * t + ((k + 1) % 3)], p));
    const on = sides.indexOf(0);
    if (on < 0) return this.fan(p, [t], [3 * t, 3 * t + 1, 3 * t + 2], true);
    const next = (e) => 3 * Math.floor(e / 3) + ((e + 1) % 3);
    const edge = 3 * t + on;
    const twin = this.twins[edge];
    if (twin < 0) return this.fan(p, [t], [next(edge), next(next(edge))], false);
    const around = [next(edge), next(next(edge)), next(twin), next(next(twin))];
    return this.fan(p, [t, Math.floor(twin / 3)], around, true);
  }

  /** Replaces triangles by those from `p` to the edges around them. */
  fan(p, gone, edges, closed) {
    const ring = edges.map((e) => {
      const to = 3 * Math.floor(e / 3) + ((e + 1) % 3);
      return { from: this.corners[e], to: this.corners[to], beyond: this.twins[e] };
    });
    const fresh = ring.map((_, i) => gone[i] ?? this.triangles++);
    ring.forEach(({ from, to }, i) => this.set(fresh[i], p, from, to));
    ring.forEach(({ beyond }, i) => {
      this.twins[3 * fresh[i] + 1] = -1;
      this.link(3 * fresh[i] + 1, beyond);
      const last = i + 1 === ring.length;
      if (last && !closed) {
        this.twins[3 * fresh[i] + 2] = -1;
        this.twins[3 * fresh[0]] = -1;
      } else this.link(3 * fresh[i] + 2, 3 * fresh[last ? 0 : i + 1]);
    });
    return this.flips ? this.legalise(p, fresh) : fresh;
  }

  /** Lawson 1977: an edge opposite to `p` is flipped if `p` lies within the circumcircle of the triangle beyond it. */
  legalise(p, fresh) {
    const star = new Set(fresh);
    const waiting = [...fresh];
    while (waiting.length > 0) {
      const t = waiting.pop();
      const twin = this.twins[3 * t + 1];
      if (twin < 0) continue;
      const u = Math.floor(twin / 3);
      const [ahead, behind] = [3 * u + ((twin + 1) % 3), 3 * u + ((twin + 2) % 3)];
      const [a, b, d] = [this.corners[3 * t + 1], this.corners[3 * t + 2], this.corners[behind]];
      if (this.inCircle(p, a, b, d) <= 0) continue;
      const [beyondA, beyondB, side] = [this.twins[ahead], this.twins[behind], this.twins[3 * t + 2]];
      this.set(t, p, a, d);
      this.set(u, p, d, b);
      this.twins[3 * t + 1] = -1;
      this.link(3 * t + 1, beyondA);
      this.link(3 * t + 2, 3 * u);
      this.twins[3 * u + 1] = -1;
      this.link(3 * u + 1, beyondB);
      this.twins[3 * u + 2] = -1;
      this.link(3 * u + 2, side);
      this.flipped++;
      star.add(u);
      waiting.push(t, u);
    }
    return star;
  }

  get rms() { return Math.sqrt(Math.max(0, this.squares) / (this.width * this.height)); }
}

/** Runs to the end: the maximum error and the RMS after each insertion, from 4 vertices on. */
function history(width, height, z, flips) {
  const mesh = new Insertion(width, height, z, flips);
  const [largest, rms] = [[], []];
  do {
    largest.push(mesh.worst?.error ?? 0);
    rms.push(mesh.rms);
  } while (mesh.step());
  return { largest, rms };
}
