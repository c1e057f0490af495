// The grids that tiles are made of, and the bent earth: what a flat triangle is off by at a sample.

import { writeFileSync } from "node:fs";

const VOID = -9999;
const RADIANS = Math.PI / 180;
const EQUATOR = 6378137;
const FLATTENING = 1 / 298.257223563;
const ECCENTRICITY = FLATTENING * (2 - FLATTENING);

// Longitude and latitude of the south-western sample, degrees between samples, columns and rows, a middle height and
// how far heights reach from it; with holes or not.
const GRIDS = [
  { name: "alps", at: [7.03, 46.02], by: 0.001, size: [140, 120], middle: 1900, reach: 1400, holes: false },
  { name: "andes", at: [-70.41, -33.52], by: 0.001, size: [130, 150], middle: 3000, reach: 2500, holes: true },
  { name: "dead_sea", at: [35.44, 31.37], by: 0.001, size: [120, 120], middle: -390, reach: 45, holes: true },
  { name: "null_island", at: [-0.0605, -0.0705], by: 0.001, size: [130, 140], middle: 10, reach: 80, holes: false },
  { name: "svalbard", at: [14.9, 78.1], by: 0.001, size: [160, 110], middle: 500, reach: 450, holes: true },
  { name: "date_line", at: [179.85, -17.1], by: 0.001, size: [151, 100], middle: 200, reach: 300, holes: false },
];

// A grid of ridges, valleys and steps, in eighths of a metre, with the samples that tiles are held against.
class Grid {
  constructor(told) {
    Object.assign(this, told);
    const [columns, rows] = told.size;
    this.heights = Float64Array.from({ length: columns * rows }, (_, i) => {
      const [x, y] = [i % columns, Math.floor(i / columns)];
      return told.holes && this.isHole(x, y) ? VOID : this.rough(x, y);
    });
  }

  rough(x, y) {
    const ridges = Math.abs(Math.sin(x / 9 + Math.sin(y / 13))) + Math.cos(y / 17) * Math.sin(x / 31);
    const grain = (((x * 7919) ^ (y * 104729)) % 17) / 17;
    const step = (x * 3 + y * 5) % 71 < 4 ? 0.2 : 0;
    const part = (ridges - 0.5) * 0.6 + (grain - 0.5) * 0.08 + step;
    return Math.round((this.middle + this.reach * part) * 8) / 8;
  }

  isHole(x, y) {
    const [columns, rows] = this.size;
    const isOval = ((x - columns * 0.6) / 21) ** 2 + ((y - rows * 0.45) / 13) ** 2 < 1;
    return isOval || (x < 17 && y < 23) || (x * 31 + y * 17) % 97 === 0;
  }

  write(path) {
    const { at, by, size } = this;
    const rows = Array.from({ length: size[1] }, (_, y) => [
      ...this.heights.subarray(y * size[0], (y + 1) * size[0]),
    ]);
    const head = `ncols ${size[0]}\nnrows ${size[1]}\nxllcenter ${at[0]}\nyllcenter ${at[1]}\ncellsize ${by}`;
    // Rows of the file begin in the north.
    const lines = rows.reverse().map((row) => row.join(" "));
    writeFileSync(path, `${head}\nNODATA_value ${VOID}\n${lines.join("\n")}\n`);
    writeFileSync(path.replace(/asc$/, "prj"), "EPSG:4326");
  }

  // Water of the grid, by parts of its width and height: a lake with an island, and one that reaches beyond the grid.
  lakes() {
    const place = ([u, v]) => [0, 1].map((axis) => this.at[axis] + [u, v][axis] * (this.size[axis] - 1) * this.by);
    const ring = (corners) => [...corners, corners[0]].map(place);
    return [
      [ring([[0.1, 0.12], [0.7, 0.07], [0.83, 0.66], [0.42, 0.9], [0.13, 0.5]]), ring([[0.4, 0.4], [0.55, 0.41], [0.5, 0.6]])],
      [ring([[0.75, 0.8], [0.99, 0.83], [0.98, 1.4], [0.71, 1.3]])],
    ];
  }

  writeLakes(path) {
    const features = this.lakes().map((coordinates) => {
      return { type: "Feature", properties: {}, geometry: { type: "Polygon", coordinates } };
    });
    writeFileSync(path, JSON.stringify({ type: "FeatureCollection", features }));
  }

  // All samples with a height, as longitude, latitude in degrees, and height.
  samples() {
    const [columns] = this.size;
    const all = [...this.heights].map((height, i) => {
      const [x, y] = [i % columns, Math.floor(i / columns)];
      return [this.at[0] + x * this.by, this.at[1] + y * this.by, height];
    });
    return all.filter(([, , height]) => height !== VOID);
  }

  // So many of them, drawn by lot, always the same ones.
  some(count) {
    const all = this.samples();
    let seed = 12345;
    const draw = () => {
      seed = (Math.imul(seed, 1103515245) + 12345) >>> 0;
      return all[Math.floor((seed / 2 ** 32) * all.length)];
    };
    return Array.from({ length: count }, draw);
  }
}

export const grids = () => GRIDS.map((told) => new Grid(told));

// Whether a place lies in one of the polygons, by the sides that are north of it; nothing where one is very near.
export const isWithin = (polygons, [x, y]) => {
  let isNear = false;
  const found = polygons.some((rings) => {
    let count = 0;
    for (const ring of rings) {
      for (let i = 1; i < ring.length; i++) {
        const [a, b] = [ring[i - 1], ring[i]];
        if (a[0] <= x === b[0] <= x) continue;
        const north = a[1] + ((x - a[0]) / (b[0] - a[0])) * (b[1] - a[1]) - y;
        isNear ||= Math.abs(north) < 1e-11;
        count += north > 0;
      }
    }
    return count % 2 === 1;
  });
  return isNear ? undefined : found;
};

// What a client takes a level to be off by.
export const ofLevel = (level) => 77067.34 / 2 ** level;

export const minus = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];

// What is upright at a place in degrees.
const upright = ([longitude, latitude]) => {
  const [l, b] = [longitude * RADIANS, latitude * RADIANS];
  return [Math.cos(b) * Math.cos(l), Math.cos(b) * Math.sin(l), Math.sin(b)];
};

// Earth-centred, of degrees and metres.
export const placed = ([longitude, latitude, height]) => {
  const [x, y, z] = upright([longitude, latitude]);
  const radius = EQUATOR / Math.sqrt(1 - ECCENTRICITY * z * z);
  return [(radius + height) * x, (radius + height) * y, (radius * (1 - ECCENTRICITY) + height) * z];
};

// Degrees and metres, of what is earth-centred.
export const unplaced = ([x, y, z]) => {
  const across = Math.hypot(x, y);
  let latitude = Math.atan2(z, across * (1 - ECCENTRICITY));
  let height = 0;
  for (let i = 0; i < 12; i++) {
    const sine = Math.sin(latitude);
    const radius = EQUATOR / Math.sqrt(1 - ECCENTRICITY * sine * sine);
    height = across * Math.cos(latitude) + z * sine - EQUATOR * Math.sqrt(1 - ECCENTRICITY * sine * sine);
    latitude = Math.atan2(z, across * (1 - (ECCENTRICITY * radius) / (radius + height)));
  }
  return [Math.atan2(y, x) / RADIANS, latitude / RADIANS, height];
};

// The height above a place of a flat triangle, or nothing if it is beside it by more than `hair` of its size.
const flat = (place, [a, b, c], hair) => {
  const [from, along] = [placed(place), upright(place)];
  const [u, v, to] = [minus(b, a), minus(c, a), minus(from, a)];
  const across = cross(along, v);
  const size = dot(u, across);
  const s = dot(to, across) / size;
  const turned = cross(to, u);
  const t = dot(along, turned) / size;
  const isWithin = Math.min(s, t, 1 - s - t) >= -hair;
  return isWithin ? dot(v, turned) / size : undefined;
};

// The height at a place of a triangle that is flat in longitudes and latitudes.
const even = (place, [a, b, c], hair) => {
  const [u, v, to] = [minus(b, a), minus(c, a), minus(place, a)];
  const size = u[0] * v[1] - u[1] * v[0];
  const [s, t] = [(to[0] * v[1] - to[1] * v[0]) / size, (u[0] * to[1] - u[1] * to[0]) / size];
  const isWithin = Math.min(s, t, 1 - s - t) >= -hair;
  return isWithin ? (1 - s - t) * a[2] + s * b[2] + t * c[2] : undefined;
};

// Squares along each side of a tile that its triangles are sorted into.
const SQUARES = 32;

// A tile as a program decodes it: vertices in degrees and metres and earth-centred, and triangles of them.
export class Surface {
  constructor({ degrees, points, triangles }, [west, south, east, north]) {
    Object.assign(this, { degrees, points, triangles, at: [west, south], by: [east - west, north - south] });
    this.squares = Array.from({ length: SQUARES * SQUARES }, () => []);
    triangles.forEach((corners, i) => {
      const [[x0, x1], [y0, y1]] = [0, 1].map((axis) => {
        const all = corners.map((corner) => degrees[corner][axis]);
        const [low, high] = [Math.min(...all), Math.max(...all)];
        // Seen from above, flat triangles reach beyond their corners along parallels.
        const slack = 0.1 * Math.max(...corners.map((corner) => Math.abs(degrees[corner][0] - degrees[corners[0]][0])));
        return [this.square(axis, low - slack), this.square(axis, high + slack)];
      });
      for (let x = x0; x <= x1; x++) for (let y = y0; y <= y1; y++) this.squares[y * SQUARES + x].push(i);
    });
  }

  square(axis, value) {
    const found = Math.floor(((value - this.at[axis]) / this.by[axis]) * SQUARES);
    return Math.min(SQUARES - 1, Math.max(0, found));
  }

  // The heights there of the flat triangles and of those that are even in degrees.
  heights([longitude, latitude]) {
    const place = [longitude, latitude, 0];
    const near = this.squares[this.square(1, latitude) * SQUARES + this.square(0, longitude)];
    const search = (corners, height, hairs) => {
      for (const hair of hairs) {
        for (const i of near) {
          const found = height(place, this.triangles[i].map((corner) => corners[corner]), hair);
          if (found !== undefined) return found;
        }
      }
      return NaN;
    };
    // Where a side bows out of the tile, the flat triangle beside it goes on.
    return [search(this.points, flat, [0, 1e-9, 1e-6, 0.05]), search(this.degrees, even, [0, 1e-9, 1e-4])];
  }
}
