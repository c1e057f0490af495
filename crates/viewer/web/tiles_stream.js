// Selection of tiles to draw, load and unload: the coarsest within the screen-space error.

/** Quarter of a child tile in its parent: bit 0 for east, bit 1 for north. */
const QUARTERS = [0, 1, 2, 3];
const ALL_QUARTERS = 15;
/** Range of heights before a tile is loaded. */
const ANY_HEIGHT = [-12000, 9500];

class Tile {
  constructor(level, x, y, heights) {
    Object.assign(this, { level, x, y, heights, state: 'none', used: 0, wanted: 0, bytes: 0 });
    const { west, south, width } = rectangle(this);
    Object.assign(this, { west, south, width });
    this.ground = earthCentred(west + width / 2, south + width / 2, 0);
    this.up = upright(west + width / 2, south + width / 2);
    const corners = [0, 0.5, 1].flatMap((a) => [0, 0.5, 1].map((b) => earthCentred(west + a * width, south + b * width, 0)));
    this.reach = level < 2 ? 1.3e7 : Math.max(...corners.map((corner) => Math.hypot(...minus(corner, this.ground))));
  }

  get name() {
    return `${this.level}/${this.x}/${this.y}`;
  }
}

/** `set`: available tiles; `upload(mesh)`, `release(mesh)`: to and from the graphics card; `changed()`: new tiles loaded. */
class TileStream {
  constructor(set, { upload, release, changed }) {
    Object.assign(this, { set, upload, release, changed });
    this.roots = [0, 1].map((x) => new Tile(0, x, 0, ANY_HEIGHT));
    this.ready = new Set();
    this.loading = new Set();
    this.asker = set.asker;
    this.most = 256 << 20; // bytes
    this.bytes = 0;
    this.failures = [];
    this.turn = 0;
    this.strain = 1; // factor on the allowed error if tiles do not fit into memory
    this.waiting = 0;
    this.heights = null;
    this.draws = [];
  }

  /** Selects tiles for a view into `draws`, as { tile, quarters, pixels, distance, gap, isBare }; requests missing tiles. */
  update(view) {
    this.turn++;
    this.view = view;
    this.draws = [];
    this.list = [];
    this.unknown = 0;
    for (const root of this.roots) {
      if (root.state === 'ready') this.visit(root, 0);
      else if (this.set.has(0, root.x, 0, this)) this.want(root, Infinity);
      else if (this.set.has(0, root.x, 0, this) === null) this.unknown++;
    }
    this.waiting = this.list.length + this.unknown;
    this.ask();
    this.letGo();
  }

  /** `gap`: error of coarser tiles that may be adjacent. */
  visit(tile, gap) {
    tile.used = this.turn;
    if (this.isHidden(tile)) return;
    const distance = this.distance(tile);
    const { pixels: scale, exaggeration, allowed } = this.view;
    const pixels = (tile.error * exaggeration * scale) / distance;
    if (pixels <= allowed * this.strain || tile.level === this.set.last) {
      this.draws.push({ tile, quarters: ALL_QUARTERS, pixels, distance, gap, isBare: !this.isOfData(tile) });
      return;
    }
    // A quarter is drawn from the parent until its child is loaded, so that there are no holes, and if the child does
    // not exist.
    const parts = this.parts(tile);
    let [bare, late] = [0, 0];
    parts.forEach((part, quarter) => {
      if (part === false) bare |= 1 << quarter;
      else if (part === null || part.state === 'failed' || (part.state !== 'ready' && !this.isHidden(part))) late |= 1 << quarter;
    });
    const below = bare | late ? Math.max(gap, tile.error) : gap;
    parts.forEach((part, quarter) => {
      if (part === null) this.unknown++;
      else if (part && part.state === 'ready') this.visit(part, below);
      else if (part && late & (1 << quarter)) this.want(part, pixels);
    });
    for (const [quarters, isBare] of [[late, false], [bare, true]]) {
      if (quarters) this.draws.push({ tile, quarters, pixels, distance, gap, isBare });
    }
  }

  isOfData({ west, south, width }) {
    const [w, s, e, n] = this.set.bounds;
    return west <= e && west + width >= w && south <= n && south + width >= s;
  }

  /** The children: false if one does not exist, null if that is unknown. */
  parts(tile) {
    tile.parts ??= QUARTERS.map(() => null);
    tile.parts.forEach((part, q) => {
      if (part !== null) return;
      const at = [tile.level + 1, 2 * tile.x + (q & 1), 2 * tile.y + (q >> 1)];
      const [low, high] = tile.heights;
      const has = this.set.has(...at, this);
      tile.parts[q] = has ? new Tile(...at, [low - tile.error, high + tile.error]) : has;
    });
    return tile.parts;
  }

  /** Bounding sphere of a tile, with exaggerated heights. */
  ball(tile) {
    const { exaggeration } = this.view;
    const [low, high] = tile.heights;
    const middle = along(tile.ground, tile.up, ((low + high) / 2) * exaggeration);
    return { middle, radius: tile.reach * (1 + Math.abs(high * exaggeration) / EQUATOR) + ((high - low) / 2) * exaggeration };
  }

  /** True for a tile outside the view or beyond the horizon; but never for tiles at the target, whose ground height is
   * needed in any view. */
  isHidden(tile) {
    if (tile.looked === this.turn) return tile.hidden;
    const { eye, axes, sides, horizon, focus: [lon, lat] } = this.view;
    const holds = (value, from) => value >= from && value <= from + tile.width;
    if (holds(lon, tile.west) && holds(lat, tile.south)) return false;
    const { middle, radius } = this.ball(tile);
    const from = minus(middle, eye);
    const [x, y, ahead] = axes.map((axis) => dot(from, axis));
    const [left, right, up] = sides;
    const beyond = (value, side) => value - ahead * side > radius * Math.hypot(1, side);
    tile.looked = this.turn;
    tile.hidden = ahead < -radius || beyond(-x, -left) || beyond(x, right) || beyond(y, up) || beyond(-y, up) ||
      Math.hypot(...from) - radius > horizon;
    return tile.hidden;
  }

  /** Approximate distance in metres from the eye to the nearest part of a tile. */
  distance(tile) {
    const { at: [lon, lat, height], eye, exaggeration } = this.view;
    const { west, south, width, heights } = tile;
    const clamp = (value, low, high) => Math.min(high, Math.max(low, value));
    const half = width / 2;
    const off = around(lon - west - half);
    const near = earthCentred(west + half + clamp(off, -half, half), clamp(lat, south, south + width),
      clamp(height, heights[0] * exaggeration, heights[1] * exaggeration));
    return Math.max(1, Math.hypot(...minus(near, eye)));
  }

  want(tile, urgency) {
    if (tile.state === 'failed') return;
    tile.wanted = this.turn;
    tile.urgency = urgency;
    this.list.push(tile);
  }

  /** Cancels outdated requests, and starts the most urgent ones. */
  ask() {
    for (const tile of this.loading) if (tile.wanted !== this.turn) tile.abort.abort();
    const list = this.list.filter((tile) => tile.state === 'none').sort((a, b) => b.urgency - a.urgency);
    for (const tile of list.slice(0, Math.max(0, this.asker.room))) this.load(tile);
  }

  async load(tile) {
    tile.state = 'loading';
    tile.abort = new AbortController();
    this.loading.add(tile);
    try {
      const buffer = await this.asker.get(this.set.address(tile), tile.abort.signal);
      this.take(tile, this.set.decode(buffer, tile));
    } catch (error) {
      tile.state = 'none';
      if (!tile.abort.signal.aborted) this.failed(tile, error);
    }
    this.loading.delete(tile);
    this.more();
  }

  /** Repeats a failed request later, or gives up. */
  failed(tile, error) {
    const again = () => { tile.state = 'none'; this.more(); };
    const told = this.asker.later(this.set.address(tile), error, again);
    tile.state = told ? 'failed' : 'paused';
    if (told) this.failures.push(tile.name + ': ' + told);
  }

  /** Handles loaded data: requests further tiles at once, not only after drawing. */
  more() {
    this.update(this.view);
    this.changed();
  }

  take(tile, mesh) {
    tile.mesh = mesh;
    tile.error = mesh.error ?? this.set.error(tile);
    tile.heights = [mesh.low, mesh.high];
    tile.bytes = this.upload(mesh);
    tile.state = 'ready';
    tile.used = this.turn;
    this.bytes += tile.bytes;
    this.ready.add(tile);
    this.measure(tile);
  }

  /** The range of heights where there are data. */
  measure({ west, south, width, mesh }) {
    const [w, s, e, n] = this.set.bounds;
    mesh.heights.forEach((height, i) => {
      const [lon, lat] = [west + width * (mesh.u[i] / STEPS), south + width * (mesh.v[i] / STEPS)];
      if (lon < w || lon > e || lat < s || lat > n) return;
      const [low, high] = this.heights ?? [height, height];
      this.heights = [Math.min(low, height), Math.max(high, height)];
    });
  }

  /** Keeps within the memory limit: drops tiles unused for longest; if all are needed, coarsens the selection. */
  letGo() {
    if (this.bytes > this.most) {
      const old = [...this.ready].filter((tile) => tile.used < this.turn && tile.level > 0).sort((a, b) => a.used - b.used);
      for (const tile of old) {
        if (this.bytes <= 0.9 * this.most) break;
        this.drop(tile);
      }
    }
    let needed = 0;
    for (const tile of this.ready) if (tile.used === this.turn) needed += tile.bytes;
    const before = this.strain;
    if (needed > this.most) this.strain = Math.min(1e6, this.strain * 1.25);
    else if (needed < 0.5 * this.most) this.strain = Math.max(1, this.strain / 1.25);
    if (this.strain !== before) this.changed();
  }

  drop(tile) {
    this.release(tile.mesh);
    this.bytes -= tile.bytes;
    this.ready.delete(tile);
    Object.assign(tile, { state: 'none', mesh: null, bytes: 0 });
    if (tile.parts?.every((part) => !part || part.state === 'none')) tile.parts = undefined;
  }
}
