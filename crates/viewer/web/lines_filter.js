// Lines at a threshold: one comparison per vertex.

class LinesFilter {
  /** x, y: codes of vertices; parts: vertices of each, doubled, one more for rings; thresholds: by method. */
  constructor(x, y, parts, thresholds) {
    Object.assign(this, { x, y, parts, thresholds });
    // Closes rings; an entry between parts breaks the line.
    this.out = new Float32Array(2 * (x.length + 2 * parts.length));
    this.sorted = thresholds.map((own) => Float32Array.from(own.filter((t) => t > 0 && t < Infinity)).sort());
    this.rings = parts.reduce((sum, part) => sum + (part & 1), 0);
  }

  /** Fills `out` with the kept vertices; returns the number of entries and of vertices. */
  filter(method, threshold) {
    const { x, y, parts, out } = this;
    const own = this.thresholds[method];
    let [at, vertex, breaks] = [0, 0, 0];
    for (let p = 0; p < parts.length; p++) {
      const end = vertex + (parts[p] >>> 1);
      const first = at;
      for (; vertex < end; vertex++) {
        if (own[vertex] > threshold) {
          out[at] = x[vertex];
          out[at + 1] = y[vertex];
          at += 2;
        }
      }
      if (parts[p] & 1) {
        out[at] = out[first];
        out[at + 1] = out[first + 1];
        at += 2;
      }
      out[at] = -1;
      out[at + 1] = -1;
      at += 2;
      breaks++;
    }
    return { places: at / 2, kept: at / 2 - breaks };
  }

  /** Number of kept vertices at a threshold, by bisection. */
  count(method, threshold) {
    return this.always(method) + this.sorted[method].length - this.upTo(method, threshold);
  }

  /** Number of thresholds up to a value. */
  upTo(method, threshold) {
    const list = this.sorted[method];
    let [low, high] = [0, list.length];
    while (low < high) {
      const half = (low + high) >>> 1;
      if (list[half] > threshold) high = half; else low = half + 1;
    }
    return low;
  }

  /** Number of vertices kept at every threshold, including closing vertices of rings. */
  always(method) {
    this.stay ??= this.thresholds.map((own) => own.reduce((sum, t) => sum + (t === Infinity ? 1 : 0), 0) + this.rings);
    return this.stay[method];
  }

  /** A threshold that keeps about a number of vertices. */
  thresholdFor(method, kept) {
    const list = this.sorted[method];
    const gone = list.length + this.always(method) - kept;
    return gone <= 0 ? 0 : list[Math.min(list.length, gone) - 1];
  }

  /** The range of the slider: thresholds that remove the first and the last vertices. */
  range(method) {
    const list = this.sorted[method];
    if (list.length === 0) return [0, 0];
    const high = list[list.length - 1];
    // Thresholds of rounding errors are left out.
    return [Math.max(list[Math.floor(list.length * 0.002)], high * 1e-7), high];
  }
}
