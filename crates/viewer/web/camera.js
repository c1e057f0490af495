// A camera that orbits a target point, or flies.

/** Matrices are 16 numbers, column by column. */
function product(a, b) {
  const out = new Float64Array(16);
  for (let c = 0; c < 4; c++) {
    for (let r = 0; r < 4; r++) {
      for (let k = 0; k < 4; k++) out[4 * c + r] += a[4 * k + r] * b[4 * c + k];
    }
  }
  return out;
}

const minus = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const along = (a, b, t) => [a[0] + b[0] * t, a[1] + b[1] * t, a[2] + b[2] * t];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const norm = (a) => along([0, 0, 0], a, 1 / (Math.hypot(...a) || 1));

/** True if a box of codes is outside the view: all its corners lie beyond one side. */
function unseen({ low, high }, m, { middle, scale }, exaggeration) {
  const outside = [0, 0, 0, 0, 0];
  for (let k = 0; k < 8; k++) {
    const p = [0, 1, 2].map((axis) => {
      const code = (k >> axis) & 1 ? high[axis] : low[axis];
      return (code - middle[axis]) * scale[axis] * (axis === 2 ? exaggeration : 1);
    });
    const [x, y, , w] = [0, 1, 2, 3].map((r) => m[r] * p[0] + m[4 + r] * p[1] + m[8 + r] * p[2] + m[12 + r]);
    outside[0] += x < -w;
    outside[1] += x > w;
    outside[2] += y < -w;
    outside[3] += y > w;
    outside[4] += w < 0;
  }
  return outside.includes(8);
}

/** Tangent of half the vertical field of view. */
const HALF_VIEW = Math.tan((40 / 2) * (Math.PI / 180));

class Camera {
  /** For a scene of this radius around 0, in metres. */
  constructor(radius) {
    this.radius = radius;
    this.aspect = 1;
    this.shift = 0; // of the centre, in half widths of the view
    this.reset();
  }

  reset() {
    this.target = [0, 0, -0.04 * this.radius];
    this.yaw = 0.5; // radians clockwise from north
    this.pitch = -0.62; // below the horizon
    this.distance = this.radius * 2.6 * Math.max(1, 1.15 / this.aspect);
  }

  top() {
    this.target = [0, 0, 0];
    this.yaw = 0;
    this.pitch = -Math.PI / 2 + 1e-4;
    this.distance = (this.radius / HALF_VIEW) * 0.78 * Math.max(1, 1 / this.aspect);
  }

  get ahead() {
    const flat = Math.cos(this.pitch);
    return [Math.sin(this.yaw) * flat, Math.cos(this.yaw) * flat, Math.sin(this.pitch)];
  }

  get right() {
    return [Math.cos(this.yaw), -Math.sin(this.yaw), 0];
  }

  get eye() {
    return along(this.target, this.ahead, -this.distance);
  }

  /** From metres to clip space. */
  get matrix() {
    const [eye, ahead, right] = [this.eye, this.ahead, this.right];
    const up = cross(right, ahead);
    const far = this.distance + this.radius * 4;
    const near = Math.max(far * 1e-4, this.distance * 0.02);
    const look = [
      right[0], up[0], -ahead[0], 0, right[1], up[1], -ahead[1], 0, right[2], up[2], -ahead[2], 0,
      -dot(right, eye), -dot(up, eye), dot(ahead, eye), 1,
    ];
    const f = 1 / HALF_VIEW;
    const project = [
      f / this.aspect, 0, 0, 0, 0, f, 0, 0, -this.shift, 0, (far + near) / (near - far), -1,
      0, 0, (2 * far * near) / (near - far), 0,
    ];
    return product(project, look);
  }

  /** Direction of the ray through a position in the view, -1 to 1 along x and y. */
  ray(x, y) {
    const [ahead, right] = [this.ahead, this.right];
    const up = cross(right, ahead);
    return norm(along(along(ahead, right, (x - this.shift) * HALF_VIEW * this.aspect), up, y * HALF_VIEW));
  }

  turn(dx, dy, aroundEye = false) {
    const eye = this.eye;
    this.yaw += dx;
    this.pitch = Math.min(1.55, Math.max(-Math.PI / 2 + 1e-4, this.pitch + dy));
    if (aroundEye) this.target = along(eye, this.ahead, this.distance);
  }

  /** Moves the target with the pointer, by shares of the view's height. */
  pan(dx, dy) {
    const metres = 2 * HALF_VIEW * this.distance;
    const level = norm([Math.sin(this.yaw), Math.cos(this.yaw), 0]);
    const stretch = 1 / Math.max(0.35, Math.sin(-this.pitch));
    this.target = along(along(this.target, this.right, -dx * metres), level, dy * metres * stretch);
  }

  zoom(factor, towards) {
    const before = this.distance;
    this.distance = Math.min(this.radius * 12, Math.max(this.radius * 1e-4, before * factor));
    if (towards) this.target = along(this.target, minus(towards, this.target), 1 - this.distance / before);
  }

  fly(ahead, right, up) {
    const move = along(along([0, 0, up], this.ahead, ahead), this.right, right);
    this.target = along(this.target, move, 1);
  }
}

/** Pointers, wheel and keys of a view, as calls of `on`: drag(dx, dy, kind), zoom(factor, x, y), hover, click. */
function gestures(view, on) {
  const pointers = new Map();
  let moved = 0;
  let pinch = null;
  const place = (event) => {
    const box = view.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  };
  const two = () => {
    const [a, b] = [...pointers.values()];
    return { x: (a[0] + b[0]) / 2, y: (a[1] + b[1]) / 2, apart: Math.hypot(a[0] - b[0], a[1] - b[1]),
      angle: Math.atan2(b[1] - a[1], b[0] - a[0]) };
  };
  view.addEventListener('pointerdown', (event) => {
    view.setPointerCapture(event.pointerId);
    view.focus({ preventScroll: true });
    pointers.set(event.pointerId, place(event));
    moved = pointers.size > 1 ? 1e9 : 0;
    pinch = pointers.size === 2 ? two() : null;
    view.classList.add('drag');
  });
  view.addEventListener('pointermove', (event) => {
    const at = place(event);
    const before = pointers.get(event.pointerId);
    if (!before) return on.hover(...at);
    pointers.set(event.pointerId, at);
    const [dx, dy] = [at[0] - before[0], at[1] - before[1]];
    if (pointers.size === 2 && pinch) {
      const now = two();
      on.drag(now.x - pinch.x, now.y - pinch.y, 'pan');
      if (now.apart > 0 && pinch.apart > 0) on.zoom(pinch.apart / now.apart, now.x, now.y);
      on.twist(now.angle - pinch.angle);
      pinch = now;
      return;
    }
    moved += Math.hypot(dx, dy);
    if (moved > 4) on.drag(dx, dy, event.buttons & 6 || event.shiftKey ? 'pan' : 'turn');
  });
  const end = (event) => {
    if (pointers.delete(event.pointerId) && moved <= 4 && event.type === 'pointerup') on.click(...place(event));
    pinch = null;
    if (pointers.size === 0) view.classList.remove('drag');
  };
  view.addEventListener('pointerup', end);
  view.addEventListener('pointercancel', end);
  // After touch, the hovered position stays.
  view.addEventListener('pointerleave', (event) => event.pointerType === 'mouse' && on.hover(NaN, NaN));
  view.addEventListener('contextmenu', (event) => event.preventDefault());
  view.addEventListener('wheel', (event) => {
    event.preventDefault();
    const lines = event.deltaMode === 1 ? 30 : 1;
    on.zoom(Math.exp(Math.max(-120, Math.min(120, event.deltaY * lines)) * 0.0016), ...place(event));
  }, { passive: false });
}

// ---- held keys

const FLIGHT = ['w', 'a', 's', 'd', 'q', 'y', 'arrowup', 'arrowdown', 'arrowleft', 'arrowright'];
const held = new Set();
window.addEventListener('keyup', (event) => held.delete(event.key.toLowerCase()));
window.addEventListener('blur', () => held.clear());

/** Registers a held key; returns false if it is not a flight key. */
function hold(key) {
  if (FLIGHT.includes(key)) held.add(key);
  return FLIGHT.includes(key);
}

/** Moves by the held keys; returns false if there are none. */
function moveHeld(camera, seconds) {
  if (held.size === 0) return false;
  const way = (forth, back) => (held.has(forth) ? 1 : 0) - (held.has(back) ? 1 : 0);
  const step = camera.distance * 0.9 * seconds;
  camera.fly(way('w', 's') * step, way('d', 'a') * step, way('y', 'q') * step);
  camera.turn(way('arrowright', 'arrowleft') * seconds, way('arrowup', 'arrowdown') * seconds, true);
  return true;
}

function drawCompass(camera) {
  const [context, width] = plane($('compass'));
  const half = width / 2;
  context.translate(half, half);
  context.rotate(-camera.yaw);
  for (const [sign, colour] of [[-1, '#c8553d'], [1, '#8b97a3']]) {
    context.fillStyle = colour;
    context.beginPath();
    context.moveTo(0, sign * half * 0.62);
    context.lineTo(half * 0.2, 0);
    context.lineTo(-half * 0.2, 0);
    context.fill();
  }
  context.fillStyle = '#1d2733';
  context.textAlign = 'center';
  context.fillText('N', 0, -half * 0.66);
}

// ---- shared controls

function flip(name) {
  shown[name] = !shown[name];
  press($(name), shown[name]);
  dirty = true;
}

function setLight(azimuth) {
  shown.azimuth = ((azimuth % 360) + 360) % 360;
  $('light').value = shown.azimuth;
  $('light-told').textContent = num(shown.azimuth, 1) + '°, ' + num(shown.altitude, 1) + '° high';
  dirty = true;
}

function setFlight(on) {
  flying = on;
  press($('flight'), on);
}
