// Shared code of pages with x, y and height: positions in the scene and the view, lengths and areas, colours of heights,
// camera controls, frames. A page defines `scene`, `camera`, `drawing`, `shown`, `KEYS`,
// `under`, `tellPlace` and `how`.

// ---- between the data's coordinates and the scene

const toScene = ([x, y, z]) => [x, y, z].map(
  (v, k) => (v - scene.middle[k]) * facts.ground[k] * (k === 2 ? shown.exaggeration : 1));

const toData = (v) => v.map(
  (m, k) => m / facts.ground[k] / (k === 2 ? shown.exaggeration : 1) + scene.middle[k]);

/** Position in the view, in CSS pixels, of a position in data coordinates; null behind the eye. */
function toView(place) {
  const p = toScene(place);
  const m = camera.matrix;
  const [x, y, , w] = [0, 1, 2, 3].map((r) => m[r] * p[0] + m[4 + r] * p[1] + m[8 + r] * p[2] + m[12 + r]);
  if (w <= 0) return null;
  const view = $('view');
  return [((x / w + 1) / 2) * view.clientWidth, ((1 - y / w) / 2) * view.clientHeight];
}

/** Horizontal area of a polygon. */
function areaOf(list) {
  const twice = list.reduce((sum, a, i) => {
    const b = list[(i + 1) % list.length];
    return sum + ((a[0] - list[0][0]) * (b[1] - list[0][1]) - (b[0] - list[0][0]) * (a[1] - list[0][1]));
  }, 0);
  return area(Math.abs(twice / 2) * facts.ground[0] * facts.ground[1]);
}

const area = (value) => (value >= 1e6 ? num(value / 1e6, 0.01) + ' km²' : value >= 1e4 ? num(value / 1e4, 0.01) + ' ha' : num(value, 0.1) + ' m²');

function apart(a, b) {
  const d = [0, 1, 2].map((k) => (b[k] - a[k]) * facts.ground[k]);
  return { level: Math.hypot(d[0], d[1]), space: Math.hypot(...d), up: b[2] - a[2], rise: d[2] };
}

// ---- colours

/** 256 colours of heights: halfway between equal steps and equal counts of `bins`. */
function heightRamp(bins, [low, high]) {
  const size = (high - low) / 256 || 1;
  const isSea = low <= 0 && high > 0;
  const land = (k) => !isSea || low + (k + 0.5) * size > 0;
  const all = bins.reduce((sum, area, k) => sum + (land(k) ? area : 0), 0) || 1;
  const firstLand = [...bins.keys()].find(land) ?? 0;
  let below = 0;
  return Array.from(bins, (area, k) => {
    if (!land(k)) return between(facts.palette.water, 1 - (low + (k + 0.5) * size) / Math.min(low, -0.5 * high));
    below += area;
    return between(facts.palette.land, 0.5 * (below / all) + 0.5 * ((k - firstLand) / (255 - firstLand || 1)));
  });
}

/** Draws the histogram of heights from `low` to `high`: `bins` in 64 coloured groups. */
function drawHeights(bins, ramp, [low, high], counted) {
  const [context, width, height] = plane($('histogram'));
  const groups = 64;
  const sums = Array.from({ length: groups }, (_, g) => bins.slice(4 * g, 4 * g + 4).reduce((a, b) => a + b));
  const most = Math.max(...sums) || 1;
  sums.forEach((sum, g) => {
    context.fillStyle = css(ramp[4 * g + 2]);
    const tall = (sum / most) * (height - 16);
    context.fillRect((g / groups) * width, height - 14 - tall, width / groups - 0.6, tall);
  });
  context.fillStyle = '#5b6876';
  context.fillText(num(low, facts.reported_steps[1]), 0, height - 2);
  const text = counted + ' by height, to ' + num(high, facts.reported_steps[1]) + ' ' + facts.units[1];
  context.fillText(text, width - context.measureText(text).width, height - 2);
}

// ---- controls

function setExaggeration(value) {
  shown.exaggeration = Math.min(1000, Math.max(0.01, value));
  $('exaggeration').value = Math.log2(shown.exaggeration);
  $('exaggeration-told').textContent = num(shown.exaggeration, 0.1) + ' ×';
  dirty = true;
}

/** Pointers, buttons and keys of the camera. */
function setCamera() {
  $('exaggeration').addEventListener('input', (event) => setExaggeration(2 ** event.target.value));
  $('flight').addEventListener('click', () => setFlight(!flying));
  $('top').addEventListener('click', () => { camera.top(); dirty = true; });
  $('home').addEventListener('click', () => { camera.reset(); dirty = true; });
  $('compass').addEventListener('click', () => { camera.yaw = 0; dirty = true; });
  gestures($('view'), {
    drag: (dx, dy, kind) => {
      const height = $('view').clientHeight;
      if (kind === 'pan') camera.pan(dx / height, dy / height);
      else if (flying) camera.turn((-1.2 * dx) / height, (1.2 * dy) / height, true);
      else camera.turn((3 * dx) / height, (-2 * dy) / height);
      dirty = true;
    },
    zoom: (factor, px, py) => {
      const found = under(px, py);
      camera.zoom(factor, found && toScene([found.x, found.y, found.z]));
      dirty = true;
    },
    twist: (angle) => { camera.turn(-angle, 0); dirty = true; },
    hover: (px, py) => { if (tool === null) tellPlace(Number.isNaN(px) ? null : under(px, py)); },
    click: clicked,
  });
  window.addEventListener('keydown', keyed);
}

const CAMERA_KEYS = {
  f: () => setFlight(!flying), r: () => camera.reset(), t: () => camera.top(), n: () => { camera.yaw = 0; },
  '+': () => setExaggeration(shown.exaggeration * 1.25), '=': () => setExaggeration(shown.exaggeration * 1.25),
  '-': () => setExaggeration(shown.exaggeration / 1.25),
};

function keyed(event) {
  if (event.ctrlKey || event.metaKey || event.altKey || event.target.matches('input')) return;
  const key = event.key.toLowerCase();
  if (hold(key)) event.preventDefault();
  KEYS[key]?.();
  dirty = true;
}

/** Fits the canvas to device pixels, with the target centred beside the panel. */
function fitView() {
  const ratio = Math.min(window.devicePixelRatio || 1, 2);
  const view = $('view');
  view.width = Math.max(1, Math.round(view.clientWidth * ratio));
  view.height = Math.max(1, Math.round(view.clientHeight * ratio));
  camera.aspect = view.width / view.height;
  camera.shift = view.clientWidth > 720 ? 272 / view.clientWidth : 0;
}

// ---- frames

let before = 0;
function frame(now) {
  const seconds = Math.min(0.1, (now - before) / 1000);
  before = now;
  if (moveHeld(camera, seconds)) dirty = true;
  if (dirty) render();
  requestAnimationFrame(frame);
}

function render() {
  dirty = false;
  drawing.draw(camera, how());
  drawOver();
  drawCompass(camera);
}

/** Pixels of the view, from the bottom row up. */
function pictureOf({ gl, canvas }, draw) {
  draw();
  const bytes = new Uint8Array(4 * canvas.width * canvas.height);
  gl.readPixels(0, 0, canvas.width, canvas.height, gl.RGBA, gl.UNSIGNED_BYTE, bytes);
  return { width: canvas.width, height: canvas.height, bytes };
}
