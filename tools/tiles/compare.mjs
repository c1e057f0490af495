// Holds the tiles that terrane writes against their grids as other programs read them.
//
//     node compare.mjs [TERRANE] [FOLDER]
//
// Grids made here (in the north, the south, across the equator and Greenwich, up to the date line, near a pole, below
// zero; with voids) become quantized-mesh and 3D Tiles. Every tile has to be decoded by each program; samples may be no
// further from its flat triangles than the tile says; tiles beside each other have the same border; heights that
// CesiumJS tells may differ by the bend of its own way to interpolate them, too. Then sets are damaged, each program
// has to notice. Pixels of masks of water are, as CesiumJS takes them, what their middles lie in. Prints a line for each
// set and program and exits with 1 when anything is wrong.

import { execFileSync } from "node:child_process";
import { cpSync, mkdirSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { join, resolve } from "node:path";
import { gunzipSync } from "node:zlib";

import { DECODERS } from "./decoders.mjs";
import { Surface, grids, isWithin, ofLevel } from "./ground.mjs";
import { cesium, listed, masked, rendered, validated, versionOf } from "./programs.mjs";
import { boundsOf, bytesOf, latticesOf, tileAt, tilesOf } from "./sets.mjs";

const SAMPLES = 400;
// Metres that heights in single precision may be off by, and parts of what a level may be off by.
const SINGLE = 2e-3;
const STEPS = 32767;
// CesiumJS takes 3D Tiles for its terrain with the edges of tiles alone.
const SETS = [
  { name: "quantized-mesh", options: ["-f", "quantized-mesh"], isTerrain: true },
  { name: "3dtiles", options: ["-f", "3dtiles", "--tile-edges"], isTerrain: true },
  { name: "meshopt/3dtiles", options: ["-f", "3dtiles", "--tile-edges", "--meshopt"], isTerrain: true },
  { name: "no-edges/3dtiles", options: ["-f", "3dtiles", "--meshopt"], isTerrain: false },
  { name: "skirts/3dtiles", options: ["-f", "3dtiles", "--tile-edges", "--skirts"], isTerrain: true, hasSkirts: true },
  { name: "small-skirts/3dtiles", options: ["-f", "3dtiles", "--meshopt", "--skirts"], isTerrain: false },
];

// What a decoder makes of all tiles.
const decoded = async (folder, decoder) => {
  const [found, faults] = [new Map(), []];
  for (const tile of tilesOf(folder)) {
    try {
      found.set(tile.key, { ...tile, ...(await decoder.read(bytesOf(tile.path), tile)) });
    } catch (error) {
      faults.push(`${tile.key}: ${error.message}`);
    }
  }
  return { found, faults };
};

// Pairs of tiles beside each other whose borders differ. At 180 degrees a grid that does not go around the globe ends on
// one side, and heights beyond it go on from its nearer edge.
const torn = (tiles, values) => {
  const side = (tile, axis, end) => {
    const on = tile.stops.flatMap((stop, i) => (stop[axis] === end ? [[stop[1 - axis], ...values(tile, i)]] : []));
    // What hangs from a vertex is at the same place of a side.
    const before = (a, b) => a.map((value, i) => value - b[i]).find((by) => by !== 0) ?? 0;
    return on.sort(before).join(";");
  };
  const faults = [];
  let looked = 0;
  for (const tile of tiles.values()) {
    const { level, x, y, key } = tile;
    for (const [axis, other] of [[0, `${level}/${x + 1}/${y}`], [1, `${level}/${x}/${y + 1}`]]) {
      const beside = tiles.get(other);
      if (!beside) continue;
      looked += 1;
      if (side(tile, axis, STEPS) !== side(beside, axis, 0)) faults.push(`${key} and ${other} have other borders`);
    }
  }
  return { looked, faults };
};

// Heights of samples that are further off than their tiles say, and the largest part of that.
const measured = (tiles, samples, errors) => {
  const [faults, heights] = [[], new Map()];
  let worst = 0;
  for (const level of new Set([...tiles.values()].map((tile) => tile.level))) {
    const of = samples.map((sample) => {
      const tile = tiles.get(tileAt(level, sample));
      if (!tile) {
        faults.push(`${tileAt(level, sample)} holds a sample and is not there`);
        return [NaN, NaN];
      }
      tile.surface ??= new Surface(tile, boundsOf(tile));
      const [flat, even] = tile.surface.heights(sample);
      const allowed = (errors.get(tile.key) ?? ofLevel(level)) + SINGLE;
      const off = Math.abs(flat - sample[2]);
      worst = Math.max(worst, off / allowed);
      if (!(off <= allowed)) faults.push(`${tile.key} is off by ${off} m at ${sample}, and says ${allowed}`);
      return [flat, even];
    });
    heights.set(level, of);
  }
  return { faults, heights, worst };
};

// The same of heights that a client tells, which interpolates by degrees: it may be off by the bend as well.
const told = (client, { heights }, samples, lattices, isTold = () => true) => {
  const faults = [...client.faults];
  let [bend, worst] = [0, 0];
  for (const [level, own] of heights) {
    // No less than is assumed: that of 3D Tiles is a little more.
    if (client.error(level) < ofLevel(level) * (1 - 1e-6)) faults.push(`takes level ${level} to be off by less`);
    samples.forEach((sample, i) => {
      if (!isTold(level, sample)) return;
      const [flat, even] = own[i];
      const found = client.heights.get(level)?.[i];
      const bent = Math.abs(flat - even);
      const off = Math.abs(found - sample[2]);
      bend = Math.max(bend, bent / ofLevel(level));
      worst = Math.max(worst, (off - bent) / ofLevel(level));
      // It is what the tile holds, to what single precision can tell, and near enough to the sample. Vertices on sides
      // are taken to be on them, from which rounding to a lattice may have moved them.
      const isOwn = Math.abs(found - even) <= SINGLE + 1e-3 * ofLevel(level) + 2 * (lattices[level] ?? 0);
      if (!isOwn) faults.push(`tells ${found} at ${sample} of level ${level}, and the tile holds ${even}`);
      if (!(off <= ofLevel(level) + bent + SINGLE)) faults.push(`is off by ${off} at ${sample} of level ${level}`);
    });
  }
  return { faults, bend, worst };
};

// What each program finds wrong with a set.
const check = async (folder, { ending, isTerrain, hasSkirts }, samples) => {
  const rows = [];
  let own;
  for (const decoder of DECODERS.filter((decoder) => decoder.ending === ending)) {
    const { found, faults } = await decoded(folder, decoder);
    const errors = new Map([...found].flatMap(([key, { error }]) => (error === undefined ? [] : [[key, error]])));
    const near = measured(found, samples, errors);
    // Heights of quantized-mesh are those of both tiles, and points of 3D Tiles, bit by bit.
    const values = ending === "glb" ? ({ points }, i) => points[i] : ({ degrees }, i) => [degrees[i][2]];
    const borders = torn(found, values);
    own ??= near;
    const told = `${found.size} tiles, off by ${near.worst.toFixed(3)} of what is stated, ${borders.looked} borders the same`;
    rows.push({ name: decoder.name, told, faults: [...faults, ...near.faults, ...borders.faults] });
  }
  if (isTerrain) {
    const client = await cesium(folder, samples);
    // CesiumJS takes what hangs from a vertex at -180 degrees for something at 180.
    const isTold = (level, sample) => !hasSkirts || !tileAt(level, sample).includes("/0/");
    const lattices = ending === "glb" ? latticesOf(folder) : [];
    const { faults, bend, worst } = told(client, own, samples, lattices, isTold);
    const text = `off by ${worst.toFixed(3)} of its level, and by a bend of up to ${bend.toFixed(3)}`;
    rows.push({ name: "cesium", told: text, faults });
  }
  if (ending === "glb") {
    rows.push({ name: "gltf-validator", told: "no error, no warning", faults: await validated(folder) });
    rows.push({ name: "@loaders.gl/3d-tiles", told: "names what there is", faults: await listed(folder) });
    rows.push({ name: "3d-tiles-renderer", told: "asks for all", faults: await rendered(folder) });
  }
  return rows;
};

// A copy of a set in which one of the deepest tiles is damaged, or gone; where that is.
const damaged = (folder, into, damage) => {
  rmSync(into, { recursive: true, force: true });
  cpSync(folder, into, { recursive: true });
  const tiles = tilesOf(into);
  const deepest = tiles.filter(({ level }) => level === tiles.at(-1).level);
  const { path } = deepest[Math.floor(deepest.length / 2)];
  const bytes = readFileSync(path);
  if (damage) writeFileSync(path, damage(bytes[0] === 0x1f ? gunzipSync(bytes) : bytes));
  else rmSync(path);
  return boundsOf(deepest[Math.floor(deepest.length / 2)]);
};

const halved = (bytes) => bytes.subarray(0, bytes.length / 2);
// The highest of a tile's heights is another: all heights are spread.
const spread = (bytes) => {
  bytes.writeFloatLE(bytes.readFloatLE(28) + 500, 28);
  return bytes;
};
// The tile is in another place, by its node.
const shifted = (bytes) => {
  const length = bytes.readUInt32LE(12);
  const text = bytes.subarray(20, 20 + length).toString();
  const moved = text.replace(/"matrix":\[[^\]]*\]/, (matrix) => {
    const numbers = JSON.parse(matrix.slice(9));
    numbers[12] += numbers[12] > 0 ? -64 : 64;
    return `"matrix":[${numbers}]`;
  });
  const padded = Buffer.from(moved.trimEnd().padEnd(length));
  if (moved === text || padded.length !== length) throw new Error("the node was not moved");
  padded.copy(bytes, 20);
  return bytes;
};

// Who has to notice what.
const DAMAGES = [
  { name: "cut off", set: "quantized-mesh", damage: halved, by: ["@here/quantized-mesh-decoder", "@loaders.gl/terrain", "cesium"] },
  { name: "spread", set: "quantized-mesh", damage: spread, by: ["@here/quantized-mesh-decoder", "@loaders.gl/terrain", "cesium"] },
  { name: "cut off", set: "3dtiles", damage: halved, by: ["@loaders.gl/gltf", "three", "cesium", "gltf-validator"] },
  { name: "moved", set: "3dtiles", damage: shifted, by: ["@loaders.gl/gltf", "three", "cesium"] },
  { name: "cut off", set: "meshopt/3dtiles", damage: halved, by: ["@loaders.gl/gltf", "three", "cesium", "gltf-validator"] },
  { name: "moved", set: "meshopt/3dtiles", damage: shifted, by: ["@loaders.gl/gltf", "three", "cesium"] },
  { name: "gone", set: "3dtiles", damage: null, by: ["@loaders.gl/3d-tiles", "3d-tiles-renderer"] },
];

const main = async ([terrane = "target/debug/terrane", folder = "target/tiles/sets"]) => {
  const log = console.log;
  // Programs say what they find by other ways, too.
  console.log = console.error = () => {};
  let [failed, looked] = [0, 0];
  const row = (set, { name, told, faults }) => {
    looked += 1;
    failed += faults.length > 0;
    const version = versionOf(name);
    log(`${set.padEnd(28)} ${`${name} ${version}`.padEnd(42)} ${faults.length ? `${faults.length} faults: ${faults[0]}` : told}`);
  };
  rmSync(folder, { recursive: true, force: true });
  mkdirSync(folder, { recursive: true });
  const made = grids();
  for (const set of SETS) set.ending = set.name === "quantized-mesh" ? "terrain" : "glb";
  for (const grid of made) {
    const source = join(folder, `${grid.name}.asc`);
    grid.write(source);
    for (const kind of SETS) {
      const { name, options } = kind;
      const set = resolve(folder, grid.name, name);
      mkdirSync(resolve(set, ".."), { recursive: true });
      execFileSync(terrane, ["tiles", source, set, "-q", ...options]);
      for (const found of await check(set, kind, grid.some(SAMPLES))) row(`${grid.name}, ${name}`, found);
    }
    const [lakes, wet] = [join(folder, `${grid.name}.geojson`), resolve(folder, grid.name, "water")];
    grid.writeLakes(lakes);
    execFileSync(terrane, ["tiles", source, wet, "-q", "--water", lakes, "--water-mask"]);
    const { looked: pixels, faults } = await masked(wet, (place) => isWithin(grid.lakes(), place));
    row(`${grid.name}, masks of water`, { name: "cesium", told: `${pixels} pixels as they are`, faults });
  }
  const [grid] = made;
  for (const { name, set, damage, by } of DAMAGES) {
    const [from, into] = [resolve(folder, grid.name, set), resolve(folder, "damaged", set)];
    const kind = SETS.find(({ name }) => name === set);
    const [west, south, east, north] = damaged(from, into, damage);
    const within = ([x, y]) => x > west && x < east && y > south && y < north;
    const found = await check(into, kind, grid.samples().filter(within));
    const blind = by.filter((program) => !found.find(({ name }) => name === program)?.faults.length);
    row(`a tile ${name}, ${set}`, {
      name: by[0],
      told: `noticed by ${by.join(", ")}`,
      faults: blind.map((program) => `${program} does not notice`),
    });
  }
  log(`${failed} of ${looked} are wrong`);
  return failed || !looked ? 1 : 0;
};

process.exit(await main(process.argv.slice(2)));
