// Sections through tiles: intersection of the displayed terrain with the plane through two positions and the centre of
// the earth.

/** Number of pieces for the length of a section. */
const STRETCHES = 512;
/** Share of a tile's error that straight pieces of a section may add. */
const SAG = 0.01;

/** The line of a section: its plane, and distances along it. */
class SectionLine {
  /** From and to [longitude, latitude, height]. */
  constructor(from, to) {
    const across = cross(earthCentred(...from), earthCentred(...to));
    this.across = norm(across);
    /** False for positions above each other or antipodal: their plane is not unique. */
    this.isOne = Math.hypot(...across) > 1e-13 * EQUATOR * EQUATOR;
    const foot = earthCentred(from[0], from[1], 0);
    this.start = norm(along(foot, this.across, -dot(foot, this.across)));
    this.side = cross(this.across, this.start);
    this.angle = this.angleOf(to);
    this.lengths = [0];
    for (let i = 1, before = this.at(0); i <= STRETCHES; i++) {
      const now = this.at((this.angle * i) / STRETCHES);
      this.lengths.push(this.lengths[i - 1] + Math.hypot(...minus(now, before)));
      before = now;
    }
  }

  /** Geocentric angle from the start, in radians. */
  angleOf([lon, lat]) {
    const foot = earthCentred(lon, lat, 0);
    return Math.atan2(dot(foot, this.side), dot(foot, this.start));
  }

  /** Position on the ellipsoid at an angle. */
  at(angle) {
    const way = along(along([0, 0, 0], this.start, Math.cos(angle)), this.side, Math.sin(angle));
    return along([0, 0, 0], way, EQUATOR / Math.hypot(way[0], way[1], way[2] / (1 - FLATTENING)));
  }

  /** Share of the line before a position; below 0 and above 1 beyond its ends. */
  share(place) {
    const at = (this.angleOf(place) / this.angle) * STRETCHES;
    const i = Math.min(STRETCHES - 1, Math.max(0, Math.floor(at)));
    return (this.lengths[i] + (at - i) * (this.lengths[i + 1] - this.lengths[i])) / this.lengths[STRETCHES];
  }
}

/** Section of drawn tiles within bounds in degrees: pieces as [[share, position], [share, position]] by share, with
 * positions on the globe, and the largest error of their tiles. */
function sectionOf(draws, line, bounds) {
  const pieces = [];
  let error = 0;
  for (const { tile, quarters, isBare } of line.isOne ? draws : []) {
    if (isBare || Math.abs(dot(line.across, tile.mesh.middle)) > tile.mesh.reach) continue;
    const found = piecesOf(tile, line, quarters, bounds);
    if (found.length > 0) error = Math.max(error, tile.error);
    pieces.push(...found);
  }
  return { pieces: pieces.sort((a, b) => a[0][0] - b[0][0] || a[1][0] - b[1][0]), error };
}

function piecesOf(tile, line, quarters, bounds) {
  const { mesh } = tile;
  const middle = dot(line.across, mesh.middle);
  const sides = Float64Array.from(mesh.heights, (_, i) => middle + dot(line.across, mesh.places.subarray(3 * i, 3 * i + 3)));
  const rims = part(tile, bounds);
  const isShown = ([, , , u, v]) => u > rims[0] && v > rims[1] && u < rims[2] && v < rims[3] &&
    ((quarters >> (Number(u >= 0.5) | (Number(v >= 0.5) << 1))) & 1) === 1;
  const pieces = [];
  for (let t = 0; t < mesh.corners.length; t += 3) {
    const ends = crossing(mesh, sides, mesh.corners.subarray(t, t + 3));
    if (!ends) continue;
    // Beyond the drawn quarters or the data of the tile.
    const cuts = [0.5, rims[0], rims[2]].map((rim) => [3, rim]).concat([0.5, rims[1], rims[3]].map((rim) => [4, rim]));
    const stops = cuts.map(([k, rim]) => (rim - ends[0][k]) / (ends[1][k] - ends[0][k])).filter((s) => s > 0 && s < 1);
    const shares = [0, ...stops.sort((a, b) => a - b), 1];
    for (let i = 1; i < shares.length; i++) {
      if (isShown(mix(...ends, (shares[i - 1] + shares[i]) / 2))) {
        bent(mix(...ends, shares[i - 1]), mix(...ends, shares[i]), tile, line, pieces);
      }
    }
  }
  return pieces;
}

/** Linear interpolation of two lists of numbers. */
const mix = (a, b, share) => a.map((from, k) => from + (b[k] - from) * share);

/** Ends of the intersection of a plane and a triangle, from distances of its vertices: earth-centred coordinates, and
 * positions in the tile. */
function crossing(mesh, sides, three) {
  const vertex = (i) => [...plus(mesh.middle, mesh.places.subarray(3 * i, 3 * i + 3)), mesh.u[i] / STEPS, mesh.v[i] / STEPS];
  const found = [];
  for (let k = 0; k < 3; k++) {
    const [i, j] = [three[k], three[(k + 1) % 3]];
    const [a, b] = [sides[i], sides[j]];
    if (a === 0) found.push(vertex(i));
    else if (a * b < 0) found.push(mix(vertex(i), vertex(j), a / (a - b)));
  }
  return found.length < 2 ? null : found.slice(0, 2);
}

/** Divides a straight piece so that heights are linear between ends, and clips it to the line. */
function bent(from, to, { error, mesh }, line, pieces) {
  const reach = Math.sqrt(8 * EQUATOR * SAG * Math.max(error, 1e-3));
  const parts = Math.ceil(Math.hypot(...minus(to, from)) / reach);
  const at = (share) => {
    const place = geodetic(mix(from, to, share));
    return [line.share(place), place];
  };
  let before = at(0);
  for (let i = 1; i <= parts; i++) {
    const now = at(i / parts);
    const piece = within(...(before[0] < now[0] ? [before, now] : [now, before]));
    if (piece) pieces.push(piece);
    before = now;
  }
}

/** Clips a piece to 0 to 1; null if nothing remains, or on the other side of the globe. */
function within(a, b) {
  if (b[0] <= 0 || a[0] >= 1 || a[0] === b[0] || b[0] - a[0] > 1) return null;
  const cut = (share) => [share, straight(a[1], b[1], (share - a[0]) / (b[0] - a[0]))];
  return [a[0] < 0 ? cut(0) : a, b[0] > 1 ? cut(1) : b];
}

/** Position at a share of a straight line between two positions. */
const straight = (from, to, share) => geodetic(mix(earthCentred(...from), earthCentred(...to), share));
