// One call of delatin, measured from inside. Prints a line of JSON.
//
// Usage: call_delatin.mjs MODULE GRID.raw WIDTH HEIGHT MAX_ERROR [MESH]
//
// MODULE is the folder of the installed package. MESH is as call_pydelatin.py writes it.

import { readFileSync, writeFileSync } from "node:fs";
import { pathToFileURL } from "node:url";

const [folder, raw, widthText, heightText, maxError, mesh] = process.argv.slice(2);
const { default: Delatin } = await import(pathToFileURL(`${folder}/index.js`));
const [width, height] = [Number(widthText), Number(heightText)];

const bytes = readFileSync(raw);
const grid = new Float32Array(bytes.buffer, bytes.byteOffset, width * height);

const cpuBefore = process.cpuUsage();
const started = performance.now();
const tin = new Delatin(grid, width, height);
tin.run(Number(maxError));
const wall = (performance.now() - started) / 1e3;
const spent = process.cpuUsage(cpuBefore);
const peak = process.resourceUsage().maxRSS / 1024;

const { coords, triangles } = tin;
if (mesh) {
  const vertices = new Float64Array((coords.length / 2) * 3);
  for (let i = 0; i < coords.length / 2; i++) {
    const [col, row] = [coords[2 * i], coords[2 * i + 1]];
    vertices.set([col, row, grid[row * width + col]], 3 * i);
  }
  const head = Buffer.from(`${coords.length / 2} ${triangles.length / 3}\n`);
  writeFileSync(mesh, Buffer.concat([
    head, Buffer.from(vertices.buffer), Buffer.from(Uint32Array.from(triangles).buffer),
  ]));
}
const facts = {
  wall, cpu: (spent.user + spent.system) / 1e6, peak_mib: peak, vertices: coords.length / 2,
};
console.log(JSON.stringify(facts));
