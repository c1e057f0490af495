// 3D Tiles 1.1 of `terrane tiles`: two implicit quadtrees, whose subtrees list available tiles and their errors, and a
// binary glTF mesh for each tile.

/** The two halves of the globe. */
const HALVES = ['west', 'east'];
const WIDTHS = { SCALAR: 1, VEC2: 2, VEC3: 3 };
const COMPONENTS = { 5123: Uint16Array, 5125: Uint32Array, 5126: Float32Array };

/** JSON and binary part of a file with a four-letter signature. */
function twoParts(buffer, letters) {
  const view = new DataView(buffer);
  const found = new TextDecoder().decode(new Uint8Array(buffer, 0, 4));
  if (found !== letters) throw new Error('not a 3D Tiles file');
  const text = (at, length) => JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, at, length)));
  if (letters === 'subt') {
    const length = Number(view.getBigUint64(8, true));
    return [text(24, length), buffer.slice(24 + length)];
  }
  const length = view.getUint32(12, true);
  return [text(20, length), buffer.slice(28 + length)];
}

/** Available tiles below a tile for a number of levels, with their errors. */
class Subtree {
  constructor(buffer, { level, x, y }, levels) {
    const [json, bytes] = twoParts(buffer, 'subt');
    Object.assign(this, { level, x, y, levels });
    const part = (number) => {
      const { byteOffset, byteLength } = json.bufferViews[number];
      return bytes.slice(byteOffset, byteOffset + byteLength);
    };
    const bits = ({ bitstream, constant }) =>
      (bitstream === undefined ? () => constant === 1 : ((all) => (at) => ((all[at >> 3] >> (at & 7)) & 1) === 1)(new Uint8Array(part(bitstream))));
    this.isHere = bits(json.tileAvailability);
    this.isBelow = bits(json.childSubtreeAvailability);
    const errors = new Float64Array(part(json.propertyTables[0].properties.geometricError.values));
    this.errors = new Map();
    for (let at = 0, row = 0; at < (4 ** levels - 1) / 3; at++) if (this.isHere(at)) this.errors.set(at, errors[row++]);
  }

  /** Morton index of a tile in its level. */
  along({ level, x, y }) {
    let at = 0;
    for (let bit = level - this.level - 1; bit >= 0; bit--) at = 4 * at + ((x >> bit) & 1) + 2 * ((y >> bit) & 1);
    return at;
  }

  number(id) {
    return (4 ** (id.level - this.level) - 1) / 3 + this.along(id);
  }
}

/** Contents of a `tileset.json`; see `TileSet` for `layer.json`. */
class ThreeTiles {
  constructor(tileset) {
    const { extras: { terrane }, root } = tileset;
    const tiling = root.children[0].implicitTiling;
    this.last = tiling.availableLevels - 1;
    this.depth = tiling.subtreeLevels;
    this.bounds = terrane.bounds;
    this.count = terrane.levels.reduce((sum, level) => sum + level.tiles, 0);
    this.subtrees = new Map();
    this.asker = new Asker();
  }

  address({ level, x, y }, ending = 'glb') {
    return `${HALVES[x >> level]}/${level}/${x & (2 ** level - 1)}/${y}.${ending}`;
  }

  /** The subtree of a tile; null until it is loaded, which `stream` is notified of. */
  subtree({ level, x, y }, stream) {
    const by = level % this.depth;
    const top = { level: level - by, x: x >> by, y: y >> by };
    const name = this.address(top, 'subtree');
    if (!this.subtrees.has(name) && this.asker.room > 0) this.load(name, top, stream).then(() => stream.more());
    return this.subtrees.get(name) ?? null;
  }

  async load(name, top, stream) {
    this.subtrees.set(name, null);
    try {
      this.subtrees.set(name, new Subtree(await this.asker.get(name), top, this.depth));
    } catch (error) {
      const told = this.asker.later(name, error, () => { this.subtrees.delete(name); stream.more(); });
      if (told) this.subtrees.set(name, { failed: `${name}: ${told}` });
    }
  }

  /** True if a tile exists; null while that is unknown. */
  has(level, x, y, stream) {
    if (level > this.last) return false;
    const id = { level, x, y };
    if (level > 0 && level % this.depth === 0) {
      const above = this.subtree({ level: level - 1, x: x >> 1, y: y >> 1 }, stream);
      if (!above || above.failed) return above && false;
      if (!above.isBelow(above.along(id))) return false;
    }
    const subtree = this.subtree(id, stream);
    return subtree && !subtree.failed && subtree.isHere(subtree.number(id));
  }

  error({ level, x, y }) {
    const subtree = this.subtree({ level, x, y });
    return subtree.errors.get(subtree.number({ level, x, y }));
  }

  failures() {
    return [...this.subtrees.values()].flatMap((subtree) => subtree?.failed ?? []);
  }

  /** A tile in space: its centre, and positions relative to it. */
  decode(buffer) {
    const [json, bytes] = twoParts(buffer, 'glTF');
    const list = (number) => {
      const { bufferView, componentType, count, type } = json.accessors[number];
      return new COMPONENTS[componentType](bytes, json.bufferViews[bufferView].byteOffset, count * WIDTHS[type]);
    };
    const { attributes, indices } = json.meshes[0].primitives[0];
    // The node has y up, as in glTF, and the tileset z up: the two rotations cancel.
    const { matrix } = json.nodes[0];
    const middle = [matrix[12], 0 - matrix[14], matrix[13]];
    const places = list(attributes.POSITION).slice();
    const within = list(attributes.TEXCOORD_0);
    const vertices = places.length / 3;
    const heights = Float64Array.from({ length: vertices }, (_, i) => geodetic(plus(middle, places.subarray(3 * i, 3 * i + 3)))[2]);
    const steps = (k) => Uint16Array.from({ length: vertices }, (_, i) => Math.round((k ? 1 - within[2 * i + 1] : within[2 * i]) * STEPS));
    const corners = Uint32Array.from(list(indices));
    if (corners.some((corner) => corner >= vertices)) throw new Error('vertex index out of range');
    const normals = attributes.NORMAL === undefined ? null : list(attributes.NORMAL).slice();
    return measured({ u: steps(0), v: steps(1), heights, corners, normals, middle, places });
  }
}
