// Folders of tiles: what is in them, and a server that sends them as they are to be served.

import { readFileSync, readdirSync, statSync } from "node:fs";
import { createServer } from "node:http";
import { join, relative } from "node:path";
import { gunzipSync } from "node:zlib";

const HALVES = ["west", "east"];
const TYPES = { json: "application/json", terrain: "application/vnd.quantized-mesh", glb: "model/gltf-binary" };

export const bytesOf = (path) => {
  const bytes = readFileSync(path);
  return bytes[0] === 0x1f && bytes[1] === 0x8b ? gunzipSync(bytes) : bytes;
};

// As decoders take it: they look at all of a buffer.
export const arrayOf = (bytes) => bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.byteLength);

// Metres of the lattices that positions of each level are on.
export const latticesOf = (folder) =>
  JSON.parse(bytesOf(`${folder}/tileset.json`)).extras.terrane.levels.map(({ lattice }) => lattice);

const walk = (folder) =>
  readdirSync(folder, { recursive: true })
    .map((name) => join(folder, name))
    .filter((path) => statSync(path).isFile());

// All tiles of a set: level, column and row from the south, as quantized-mesh counts them, and the file.
export const tilesOf = (folder) => {
  const found = walk(folder).flatMap((path) => {
    const parts = relative(folder, path).split(/[/.]/);
    const ending = parts.pop();
    if (ending !== "terrain" && ending !== "glb") return [];
    const half = ending === "glb" ? HALVES.indexOf(parts.shift()) : 0;
    const [level, x, y] = parts.map(Number);
    return [{ level, x: x + half * 2 ** level, y, path, key: `${level}/${x + half * 2 ** level}/${y}` }];
  });
  if (!found.length) throw new Error(`there are no tiles in ${folder}`);
  return found.sort((a, b) => a.level - b.level || a.x - b.x || a.y - b.y);
};

// West, south, east and north of a tile, in degrees.
export const boundsOf = ({ level, x, y }) => {
  const size = 180 / 2 ** level;
  return [x * size - 180, y * size - 90, (x + 1) * size - 180, (y + 1) * size - 90];
};

// The tile of a level that a place is in.
export const tileAt = (level, [longitude, latitude]) => {
  const size = 180 / 2 ** level;
  const within = (value, count) => Math.min(count - 1, Math.max(0, Math.floor(value / size)));
  return `${level}/${within(longitude + 180, 2 ** (level + 1))}/${within(latitude + 90, 2 ** level)}`;
};

// Not at the top of a server, as hardly any set is.
const ROOT = "/set";

// Serves a folder while something is done with its address.
export const served = async (folder, work) => {
  const server = createServer((request, response) => {
    try {
      const path = join(folder, decodeURIComponent(new URL(request.url, "http://localhost").pathname.replace(ROOT, "")));
      const bytes = readFileSync(path);
      const head = { "Content-Type": TYPES[path.split(".").pop()] ?? "application/octet-stream" };
      if (bytes[0] === 0x1f && bytes[1] === 0x8b) head["Content-Encoding"] = "gzip";
      response.writeHead(200, head).end(bytes);
    } catch {
      response.writeHead(404).end();
    }
  });
  await new Promise((ready) => server.listen(0, "127.0.0.1", ready));
  try {
    return await work(`http://127.0.0.1:${server.address().port}${ROOT}`);
  } finally {
    server.closeAllConnections();
    server.close();
  }
};
