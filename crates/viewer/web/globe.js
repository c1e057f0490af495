// The WGS 84 ellipsoid, and a camera that orbits a position on it.

const EQUATOR = 6378137;
const FLATTENING = 1 / 298.257223563;
const SQUASH = FLATTENING * (2 - FLATTENING); // of the squared axes
const RADIANS = Math.PI / 180;
const plus = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];

/** Longitude normalized to -180 to 180 degrees. */
const around = (degrees) => ((((degrees + 180) % 360) + 360) % 360) - 180;

/** Normal of the ellipsoid. */
function upright(lon, lat) {
  const flat = Math.cos(lat * RADIANS);
  return [flat * Math.cos(lon * RADIANS), flat * Math.sin(lon * RADIANS), Math.sin(lat * RADIANS)];
}

/** Earth-centred coordinates, in metres, from degrees and ellipsoidal height. */
function earthCentred(lon, lat, height) {
  const up = upright(lon, lat);
  const reach = EQUATOR / Math.sqrt(1 - SQUASH * up[2] * up[2]);
  return [(reach + height) * up[0], (reach + height) * up[1], (reach * (1 - SQUASH) + height) * up[2]];
}

/** Longitude and latitude in degrees, and height, from earth-centred coordinates. */
function geodetic([x, y, z]) {
  const flat = Math.hypot(x, y);
  let lat = Math.atan2(z, flat * (1 - SQUASH));
  for (let i = 0; i < 6; i++) {
    const sine = Math.sin(lat);
    lat = Math.atan2(z + (SQUASH * EQUATOR * sine) / Math.sqrt(1 - SQUASH * sine * sine), flat);
  }
  const sine = Math.sin(lat);
  const height = flat * Math.cos(lat) + z * sine - EQUATOR * Math.sqrt(1 - SQUASH * sine * sine);
  return [Math.atan2(y, x) / RADIANS, lat / RADIANS, height];
}

/** The integral of a function (three-point Gauss quadrature, in pieces). */
function integral(of, from, to) {
  const pieces = 32;
  const half = (to - from) / pieces / 2;
  const off = half * Math.sqrt(0.6);
  let sum = 0;
  for (let i = 0; i < pieces; i++) {
    const middle = from + (2 * i + 1) * half;
    sum += (5 * of(middle - off) + 8 * of(middle) + 5 * of(middle + off)) / 9;
  }
  return sum * half;
}

/** Geodesic distance in metres between two positions in degrees. Of all geodesics from the position farther from the
 * equator, exactly one meets the latitude of the other at its longitude; its azimuth is found by bisection (Karney 2013,
 * Algorithms for geodesics), which also works for nearly antipodal positions. */
function geodesic([lon, lat], [toLon, toLat]) {
  const wide = Math.abs(around(toLon - lon)) * RADIANS;
  // Reduced latitudes; the first is south.
  const reduced = [lat, toLat].map((of) => Math.atan((1 - FLATTENING) * Math.tan(of * RADIANS)));
  const [a, b] = reduced.sort((one, other) => Math.abs(other) - Math.abs(one));
  const [first, second] = a > 0 ? [-a, -b] : [a, b];
  if (first === 0 && wide <= (1 - FLATTENING) * Math.PI) return EQUATOR * wide;
  const flat = Math.cos(first);
  const spread = Math.sin(second - first) * Math.sin(second + first);
  /** The geodesic of an azimuth: start and end on the auxiliary sphere, its scale, and the longitude difference. */
  const way = (turn) => {
    const east = Math.cos(turn) * flat; // of its direction at the equator
    const north = -Math.sin(turn) * flat;
    const rise = (SQUASH / (1 - SQUASH)) * (1 - east * east);
    const stretch = (at) => Math.sqrt(1 + rise * Math.sin(at) ** 2);
    const begin = Math.atan2(Math.sin(first) || -Number.MIN_VALUE, north);
    const end = Math.atan2(Math.sin(second), Math.sqrt(Math.max(0, north * north - spread)));
    const round = (at) => Math.atan2(east * Math.sin(at), Math.cos(at));
    const lag = integral((at) => (2 - FLATTENING) / (1 + (1 - FLATTENING) * stretch(at)), begin, end);
    return { begin, end, stretch, round: round(end) - round(begin) - FLATTENING * east * lag };
  };
  let [low, high] = [-Math.PI / 2, Math.PI / 2];
  while (true) {
    const turn = (low + high) / 2;
    const { begin, end, stretch, round } = way(turn);
    if (turn === low || turn === high) return (1 - FLATTENING) * EQUATOR * integral(stretch, begin, end);
    if (round < wide) low = turn; else high = turn;
  }
}

/** True if the globe hides a position, in earth-centred coordinates, from the eye; positions near the horizon are visible. */
function isBehind(eye, place) {
  const round = ([x, y, z]) => [x, y, z / (1 - FLATTENING)].map((v) => v / (0.99 * EQUATOR));
  const [from, to] = [round(eye), round(place)];
  const way = minus(to, from);
  const nearest = -dot(from, way) / dot(way, way);
  return nearest > 0 && nearest < 1 && Math.hypot(...along(from, way, nearest)) < 1;
}

/** East, north and up at a position on the ellipsoid. */
class Frame {
  constructor(lon, lat) {
    const [cosine, sine] = [Math.cos(lon * RADIANS), Math.sin(lon * RADIANS)];
    Object.assign(this, { lon, lat });
    this.origin = earthCentred(lon, lat, 0);
    this.up = upright(lon, lat);
    this.east = [-sine, cosine, 0];
    this.north = cross(this.up, this.east);
  }

  /** An earth-centred direction in this frame, and back. */
  inward(v) {
    return [dot(v, this.east), dot(v, this.north), dot(v, this.up)];
  }

  outward(v) {
    return along(along(along([0, 0, 0], this.east, v[0]), this.north, v[1]), this.up, v[2]);
  }

  /** Earth-centred coordinates of a position in this frame. */
  world(place) {
    return plus(this.origin, this.outward(place));
  }

  local(place) {
    return this.inward(minus(place, this.origin));
  }
}

/** A camera whose target is above the origin of its local frame. */
class GlobeCamera extends Camera {
  /** `home`: lon, lat, distance. */
  constructor(home) {
    super(EQUATOR);
    this.home = home;
    this.relief = 9000; // maximum exaggerated height above the ellipsoid, in metres
    this.reset();
  }

  reset() {
    if (!this.home) return;
    this.look(this.home.lon, this.home.lat, this.home.distance * Math.max(1, 1.2 / this.aspect));
    this.yaw = 0;
    this.pitch = -0.85;
  }

  /** Moves to another target with the same direction of view. */
  look(lon, lat, distance, height = 0) {
    this.frame = new Frame(lon, Math.max(-89.99, Math.min(89.99, lat)));
    this.target = [0, 0, height];
    this.distance = distance;
  }

  top() {
    this.yaw = 0;
    this.pitch = -Math.PI / 2 + 1e-4;
  }

  /** Moves the frame to the target; keeps the direction of view in space. */
  settle() {
    const [lon, lat, height] = geodetic(this.frame.world(this.target));
    const ahead = this.frame.outward(this.ahead);
    this.look(lon, lat, this.distance, height);
    const [east, north, up] = this.frame.inward(ahead);
    this.yaw = Math.atan2(east, north);
    this.pitch = Math.max(-Math.PI / 2 + 1e-4, Math.atan2(up, Math.hypot(east, north)));
  }

  turn(dx, dy, aroundEye = false) {
    super.turn(dx, dy, aroundEye);
    if (aroundEye) this.settle();
  }

  pan(dx, dy) {
    const height = this.target[2];
    super.pan(dx, dy);
    this.settle();
    this.target[2] = height;
  }

  zoom(factor, towards) {
    const before = this.distance;
    this.distance = Math.min(6 * EQUATOR, Math.max(10, before * factor));
    if (!towards) return;
    // The position under the pointer stays, but the target never moves far above or below the ground.
    const height = this.target[2] + (towards[2] - this.target[2]) * Math.max(0, 1 - this.distance / before);
    this.target = along(this.target, minus(towards, this.target), 1 - this.distance / before);
    const reach = Math.hypot(...this.target);
    if (reach > EQUATOR / 2) this.target = along([0, 0, 0], this.target, EQUATOR / 2 / reach);
    this.settle();
    this.target[2] = Math.max(-12000, Math.min(this.relief, height));
  }

  /** Along the ground, and up from it. */
  fly(ahead, right, up) {
    const height = this.target[2] + up;
    const level = [Math.sin(this.yaw), Math.cos(this.yaw), 0];
    this.target = along(along(this.target, level, ahead), this.right, right);
    this.settle();
    this.target[2] = Math.max(-12000, Math.min(6 * EQUATOR, height));
  }

  /** Distance in metres to the horizon of the ground, plus that of the highest terrain. */
  get horizon() {
    const eye = Math.hypot(...this.frame.world(this.eye));
    const ground = Math.hypot(...earthCentred(this.frame.lon, this.frame.lat, 0));
    const reach = (height) => Math.sqrt(Math.max(0, height) * (2 * ground + Math.max(0, height)));
    return { ground: reach(eye - ground), most: 1.2 * (reach(eye - ground) + reach(this.relief)) + this.distance };
  }

  /** From metres east, north and up of the eye to clip space. */
  get matrix() {
    const [ahead, right] = [this.ahead, this.right];
    const up = cross(right, ahead);
    const far = this.horizon.most + 1000;
    const near = Math.max(far * 1e-5, this.distance * 0.02);
    const f = 1 / HALF_VIEW;
    const turned = [right[0], up[0], -ahead[0], 0, right[1], up[1], -ahead[1], 0, right[2], up[2], -ahead[2], 0, 0, 0, 0, 1];
    const project = [
      f / this.aspect, 0, 0, 0, 0, f, 0, 0, -this.shift, 0, (far + near) / (near - far), -1,
      0, 0, (2 * far * near) / (near - far), 0,
    ];
    return product(project, turned);
  }
}
