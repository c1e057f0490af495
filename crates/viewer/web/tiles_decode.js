// Decoding of tiles: from stored tiles to earth-centred positions relative to the centre of the tile.

/** Steps from one border of a tile to the other. */
const STEPS = 32767;
/** Ids of supported extensions of quantized-mesh. */
const EXTENSION = { normals: 1, metadata: 4 };

/** Degrees: west, south, width. */
function rectangle({ level, x, y }) {
  const width = 180 / 2 ** level;
  return { west: -180 + x * width, south: -90 + y * width, width };
}

/** A tile of quantized-mesh 1.0: steps from the west and the south, heights, corners, normals, its error. */
function decodeTerrain(buffer) {
  const view = new DataView(buffer);
  const [low, high] = [view.getFloat32(24, true), view.getFloat32(28, true)];
  const vertices = view.getUint32(88, true);
  let at = 92;
  if (vertices * 6 > buffer.byteLength) throw new Error('truncated tile');
  const steps = () => {
    const out = new Uint16Array(vertices);
    for (let i = 0, value = 0; i < vertices; i++, at += 2) {
      const code = view.getUint16(at, true);
      value += (code >>> 1) ^ -(code & 1);
      out[i] = value;
    }
    return out;
  };
  const [u, v, h] = [steps(), steps(), steps()];
  const wide = vertices > 65536 ? 4 : 2;
  at = Math.ceil(at / wide) * wide;
  const index = () => (at += wide, wide === 4 ? view.getUint32(at - 4, true) : view.getUint16(at - 2, true));
  const triangles = view.getUint32(at, true);
  at += 4;
  if (triangles * 3 * wide > buffer.byteLength) throw new Error('truncated tile');
  const corners = new Uint32Array(3 * triangles);
  for (let i = 0, next = 0; i < corners.length; i++) {
    const code = index();
    if (code > next || next - code >= vertices) throw new Error('vertex index out of range');
    corners[i] = next - code;
    if (code === 0) next++;
  }
  for (let side = 0; side < 4; side++) at += 4 + view.getUint32(at, true) * wide;
  const heights = Float64Array.from(h, (step) => low + (high - low) * (step / STEPS));
  const found = { u, v, heights, corners, normals: null, error: null };
  while (at < buffer.byteLength) {
    const [kind, length] = [view.getUint8(at), view.getUint32(at + 1, true)];
    at += 5;
    if (kind === EXTENSION.normals) found.normals = octants(new Uint8Array(buffer, at, 2 * vertices));
    if (kind === EXTENSION.metadata) {
      const text = new Uint8Array(buffer, at + 4, view.getUint32(at, true));
      found.error = JSON.parse(new TextDecoder().decode(text)).error ?? null;
    }
    at += length;
  }
  return found;
}

/** Directions from octahedral encoding. */
function octants(bytes) {
  const out = new Float32Array((bytes.length / 2) * 3);
  for (let i = 0; 2 * i < bytes.length; i++) {
    let [x, y] = [(bytes[2 * i] / 255) * 2 - 1, (bytes[2 * i + 1] / 255) * 2 - 1];
    const z = 1 - Math.abs(x) - Math.abs(y);
    if (z < 0) [x, y] = [(1 - Math.abs(y)) * (x < 0 ? -1 : 1), (1 - Math.abs(x)) * (y < 0 ? -1 : 1)];
    out.set(norm([x, y, z]), 3 * i);
  }
  return out;
}

/** A decoded tile in space: its centre, and positions relative to it. */
function placed(id, found) {
  const { west, south, width } = rectangle(id);
  const { u, v, heights } = found;
  const middle = earthCentred(west + width / 2, south + width / 2, heights[0] ?? 0);
  const places = new Float32Array(3 * u.length);
  for (let i = 0; i < u.length; i++) {
    const place = earthCentred(west + width * (u[i] / STEPS), south + width * (v[i] / STEPS), heights[i]);
    places.set(minus(place, middle), 3 * i);
  }
  return measured({ ...found, middle, places });
}

/** A tile with its range of heights and its bounding radius. */
function measured(mesh) {
  let [low, high, reach] = [Infinity, -Infinity, 0];
  mesh.heights.forEach((height, i) => {
    [low, high] = [Math.min(low, height), Math.max(high, height)];
    reach = Math.max(reach, Math.hypot(...mesh.places.subarray(3 * i, 3 * i + 3)));
  });
  if (mesh.corners.length === 0) throw new Error('tile without triangles');
  return { ...mesh, low, high, reach };
}

/** Contents of a `layer.json`: available tiles, addresses, errors of levels. */
class TileSet {
  constructor(layer) {
    this.layer = layer;
    this.levels = layer.available;
    this.last = this.levels.length - 1;
    this.bounds = layer.bounds ?? [-180, -90, 180, 90];
    this.asker = new Asker();
  }

  has(level, x, y) {
    const all = this.levels[level] ?? [];
    return all.some((r) => x >= r.startX && x <= r.endX && y >= r.startY && y <= r.endY);
  }

  address({ level, x, y }) {
    const parts = { z: level, x, y, version: this.layer.version ?? '' };
    return this.layer.tiles[0].replace(/\{(\w+)\}/g, (all, name) => parts[name] ?? all);
  }

  decode(buffer, tile) {
    return placed(tile, decodeTerrain(buffer));
  }

  /** Error in metres of a tile without one: that of the level, or the one that viewers assume. */
  error({ level }) {
    const told = this.layer.terrane?.levels?.find((one) => one.level === level);
    return told?.error ?? 77067.34 / 2 ** level;
  }

  failures() {
    return [];
  }

  get count() {
    const of = (r) => (r.endX - r.startX + 1) * (r.endY - r.startY + 1);
    return this.levels.flat().reduce((sum, r) => sum + of(r), 0);
  }
}
