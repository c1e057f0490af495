// The page of a surface: what is shown of it, and the tools to look at it.

const SLOPES = [[255, 255, 240], [254, 217, 140], [240, 130, 70], [178, 40, 60], [82, 12, 62]];
const ERRORS = [[238, 244, 240], [168, 211, 204], [110, 176, 180], [247, 214, 138], [236, 146, 78], [190, 52, 58]];
const NAMES = ['Relief', 'Height', 'Slope', 'Error'];

const shown = {
  colour: 1, wire: false, facets: false, walls: true, exaggeration: 1, azimuth: facts.azimuth, altitude: facts.altitude,
};
let drawing, camera, index, scene, floats;
let tool = null;
let places = [];
let flying = false;
let dirty = true;
let profile = null;

async function start() {
  setPanel();
  const [x, y, z, first, second, third] = await Promise.all(
    ['x', 'y', 'z', 'first', 'second', 'third'].map(array));
  const errors = has('errors') ? await array('errors') : null;
  const corners = new Uint32Array(3 * first.length);
  for (let t = 0; t < first.length; t++) {
    corners[3 * t] = first[t];
    corners[3 * t + 1] = first[t] + (second[t] | 0);
    corners[3 * t + 2] = first[t] + (third[t] | 0);
  }
  const axis = (name, codes) => Float64Array.from(codes, (code) => facts[name].low + code * facts[name].step);
  const world = { x: axis('x', x), y: axis('y', y), z: axis('z', z) };
  const ends = (name, codes) => [facts[name].low, facts[name].low + facts[name].step * codes.reduce((a, b) => Math.max(a, b), 0)];
  const bounds = { x: ends('x', x), y: ends('y', y), z: ends('z', z) };
  floats = errors ? new Float32Array(errors.buffer) : null;
  const ground = ['x', 'y', 'z'].map((name, k) => facts[name].step * facts.ground[k]);
  drawing = new SurfaceDrawing($('view'), { x, y, z, corners, errors }, ground);
  index = new SurfaceIndex(world.x, world.y, world.z, corners, bounds);
  scene = { world, bounds, corners, middle: ['x', 'y', 'z'].map((name) => (bounds[name][0] + bounds[name][1]) / 2) };
  camera = new Camera(drawing.radius);
  const relief = (bounds.z[1] - bounds.z[0]) * facts.ground[2];
  const natural = Math.min(8, Math.max(1, Math.round((0.26 * drawing.radius) / (relief || 1)) / 2));
  shown.exaggeration = facts.exaggeration ?? natural;
  shown.wire = Boolean(facts.edges);
  if (floats) shown.colour = 3;
  makeScale();
  setControls();
  resize();
  camera.reset();
  new ResizeObserver(resize).observe(document.body);
  $('wait').hidden = true;
  document.body.dataset.state = 'ready';
  requestAnimationFrame(frame);
}

// ---- colours

/** Heights' colours: halfway between equal steps of height and equal shares of the area. */
function makeScale() {
  const { z } = scene.world;
  const [low, high] = scene.bounds.z;
  const bins = new Float64Array(256);
  const size = (high - low) / 256 || 1;
  for (let t = 0; t < drawing.triangles; t++) {
    const mean = (z[scene.corners[3 * t]] + z[scene.corners[3 * t + 1]] + z[scene.corners[3 * t + 2]]) / 3;
    bins[Math.min(255, Math.max(0, Math.floor((mean - low) / size)))] += drawing.weights[t];
  }
  scene.bins = bins;
  const isSea = low <= 0 && high > 0;
  const land = (k) => !isSea || low + (k + 0.5) * size > 0;
  const all = bins.reduce((sum, area, k) => sum + (land(k) ? area : 0), 0) || 1;
  const firstLand = [...bins.keys()].find(land) ?? 0;
  let below = 0;
  scene.heights = Array.from(bins, (area, k) => {
    if (!land(k)) return between(facts.palette.water, 1 - (low + (k + 0.5) * size) / Math.min(low, -0.5 * high));
    below += area;
    return between(facts.palette.land, 0.5 * (below / all) + 0.5 * ((k - firstLand) / (255 - firstLand || 1)));
  });
}

const mostError = () => facts.error_scale || 1;

function scaleOf(colour) {
  if (colour === 1) return scene.heights;
  const stops = colour === 2 ? SLOPES : ERRORS;
  return Array.from({ length: 256 }, (_, i) => between(stops, i / 255));
}

function drawLegend() {
  const { colour } = shown;
  if (colour === 0) return;
  const [low, high] = colour === 1 ? scene.bounds.z : [0, colour === 2 ? 60 : mostError()];
  drawRamp(scaleOf(colour), low, high, colour === 2 ? '°' : ' ' + facts.units[1]);
}

function drawHistogram() {
  const [context, width, height] = plane($('histogram'));
  const groups = 64;
  const sums = Array.from({ length: groups }, (_, g) => scene.bins.slice(4 * g, 4 * g + 4).reduce((a, b) => a + b));
  const most = Math.max(...sums) || 1;
  sums.forEach((sum, g) => {
    context.fillStyle = css(scene.heights[4 * g + 2]);
    const tall = (sum / most) * (height - 16);
    context.fillRect((g / groups) * width, height - 14 - tall, width / groups - 0.6, tall);
  });
  context.fillStyle = '#5b6876';
  context.fillText(num(scene.bounds.z[0], facts.told_steps[1]), 0, height - 2);
  const text = 'area by height, to ' + num(scene.bounds.z[1], facts.told_steps[1]) + ' ' + facts.units[1];
  context.fillText(text, width - context.measureText(text).width, height - 2);
}

// ---- between the data's coordinates and the scene

const toScene = ([x, y, z]) => [x, y, z].map(
  (v, k) => (v - scene.middle[k]) * facts.ground[k] * (k === 2 ? shown.exaggeration : 1));

const toData = (v) => v.map(
  (m, k) => m / facts.ground[k] / (k === 2 ? shown.exaggeration : 1) + scene.middle[k]);

/** Where a place in the data's coordinates is in the view, in pixels of the layout; null behind the eye. */
function toView(place) {
  const p = toScene(place);
  const m = camera.matrix;
  const [x, y, , w] = [0, 1, 2, 3].map((r) => m[r] * p[0] + m[4 + r] * p[1] + m[8 + r] * p[2] + m[12 + r]);
  if (w <= 0) return null;
  const view = $('view');
  return [((x / w + 1) / 2) * view.clientWidth, ((1 - y / w) / 2) * view.clientHeight];
}

/** The place of the surface under a pixel of the layout, or null. */
function under(px, py) {
  const view = $('view');
  const ray = camera.ray((2 * px) / view.clientWidth - 1, 1 - (2 * py) / view.clientHeight);
  const from = toData(camera.eye);
  const to = toData(along(camera.eye, ray, camera.distance + camera.radius * 4));
  const found = index.hit(from, minus(to, from));
  return found && { ...found, error: floats ? floats[found.triangle] : undefined };
}

// ---- what is told

function slopeOf(t) {
  const [a, b, c] = [0, 1, 2].map((k) => scene.corners[3 * t + k]);
  const at = (i) => [scene.world.x[i], scene.world.y[i], scene.world.z[i]].map((v, k) => v * facts.ground[k]);
  const n = norm(cross(minus(at(b), at(a)), minus(at(c), at(a))));
  return (Math.acos(Math.min(1, Math.abs(n[2]))) * 180) / Math.PI;
}

function tellPlace(found) {
  const [level, upright] = facts.told_steps;
  if (!found) return tell([['', 'Point at the surface to read it · ? for help']]);
  const names = facts.geographic ? ['Lon', 'Lat'] : ['X', 'Y'];
  const list = [[names[0], num(found.x, level)], [names[1], num(found.y, level)],
    ['Height', num(found.z, upright) + ' ' + facts.units[1]], ['Slope', num(slopeOf(found.triangle), 0.1) + '°']];
  if (floats) list.push(['Error of the triangle', tellError(found.error)]);
  tell(list);
}

const tellError = (error) => (Number.isNaN(error) ? 'no sample in it' : num(error, facts.told_steps[1] / 10) + ' ' + facts.units[1]);

/** Metres between two places: in plan, and in space. */
function apart(a, b) {
  const d = [0, 1, 2].map((k) => (b[k] - a[k]) * facts.ground[k]);
  return { plan: Math.hypot(d[0], d[1]), space: Math.hypot(...d), up: b[2] - a[2] };
}

function tellMeasure() {
  const pairs = places.slice(1).map((place, i) => apart(places[i], place));
  if (pairs.length === 0) return tell([['Measure', places.length ? 'click the next place' : 'click places on the surface']]);
  const sum = (key) => pairs.reduce((all, pair) => all + pair[key], 0);
  const list = [['Length in plan', metres(sum('plan'))], ['in space', metres(sum('space'))],
    ['Height', (sum('up') >= 0 ? '+' : '') + num(sum('up'), facts.told_steps[1]) + ' ' + facts.units[1]]];
  const last = pairs[pairs.length - 1];
  const grade = (last.up * facts.ground[2] * 100) / last.plan;
  list.push(['Grade of the last', num(grade, 0.1) + ' %']);
  if (places.length > 2) list.push(['Area in plan', areaOf(places)]);
  tell(list);
}

/** The area within a line that is closed, in plan. */
function areaOf(list) {
  const twice = list.reduce((sum, a, i) => {
    const b = list[(i + 1) % list.length];
    return sum + ((a[0] - list[0][0]) * (b[1] - list[0][1]) - (b[0] - list[0][0]) * (a[1] - list[0][1]));
  }, 0);
  return area(Math.abs(twice / 2) * facts.ground[0] * facts.ground[1]);
}

const area = (value) => (value >= 1e6 ? num(value / 1e6, 0.01) + ' km²' : value >= 1e4 ? num(value / 1e4, 0.01) + ' ha' : num(value, 0.1) + ' m²');

function drawOver() {
  const [context] = plane($('over'));
  const shape = profile ? [profile.from, profile.to] : places;
  const seen = shape.map(toView);
  context.lineWidth = 2.5;
  context.lineJoin = 'round';
  const line = (points, colour) => {
    context.strokeStyle = colour;
    context.beginPath();
    points.forEach((p, i) => p && (i ? context.lineTo(...p) : context.moveTo(...p)));
    context.stroke();
  };
  if (profile) line(profile.line.map(([, place]) => toView(place)), '#c8553d');
  else line(seen, '#c8553d');
  for (const at of seen) if (at) dotAt(context, at);
  if (profile?.mark) { const at = toView(profile.mark); if (at) dotAt(context, at); }
}

function dotAt(context, [x, y]) {
  context.beginPath();
  context.arc(x, y, 4.5, 0, 7);
  context.fillStyle = '#fff';
  context.fill();
  context.strokeStyle = '#c8553d';
  context.stroke();
}

// ---- sections

function makeProfile() {
  const [from, to] = places;
  const pieces = index.section(from, to);
  const at = (share, height) => [from[0] + (to[0] - from[0]) * share, from[1] + (to[1] - from[1]) * share, height];
  const line = pieces.flat().map(([share, height]) => [share, at(share, height)]);
  profile = { from, to, pieces, line, length: apart(from, to).plan };
  $('sheet').hidden = false;
  tell([['Section', 'point at it to read it, click for another']]);
  drawProfile();
  dirty = true;
}

function drawProfile(mark) {
  const [context, width, height] = plane($('profile'));
  const heights = profile.pieces.flat().map(([, z]) => z);
  if (heights.length === 0) { $('profile-told').textContent = 'There is no surface on this line'; return; }
  const [low, high] = [Math.min(...heights.slice(0, 1e5)), Math.max(...heights.slice(0, 1e5))];
  const room = { left: 50, right: width - 8, top: 8, bottom: height - 20 };
  const px = (share) => room.left + share * (room.right - room.left);
  const py = (z) => room.bottom - ((z - low) / (high - low || 1)) * (room.bottom - room.top);
  context.fillStyle = '#5b6876';
  context.strokeStyle = 'rgba(29,39,51,.12)';
  context.lineWidth = 1;
  const marks = ticks(low, high, 4);
  for (const z of marks) {
    context.beginPath(); context.moveTo(room.left, py(z)); context.lineTo(room.right, py(z)); context.stroke();
    context.textAlign = 'right';
    context.fillText(num(z, marks[1] - marks[0] || 1), room.left - 6, py(z) + 4);
  }
  context.textAlign = 'center';
  const lengths = ticks(0, profile.length, 6);
  for (const at of lengths) context.fillText(num(at, lengths[1] || 1), px(at / profile.length), height - 4);
  for (const fill of [true, false]) {
    context.beginPath();
    let end = -1;
    for (const [a, b] of profile.pieces) {
      if (Math.abs(a[0] - end) > 1e-9) {
        if (fill && end >= 0) context.lineTo(px(end), room.bottom);
        context.moveTo(px(a[0]), fill ? room.bottom : py(a[1]));
        context.lineTo(px(a[0]), py(a[1]));
      }
      context.lineTo(px(b[0]), py(b[1]));
      end = b[0];
    }
    if (fill) { context.lineTo(px(end), room.bottom); context.fillStyle = 'rgba(28,110,140,.16)'; context.fill(); }
    else { context.strokeStyle = '#1c6e8c'; context.lineWidth = 1.8; context.stroke(); }
  }
  if (mark) { context.lineWidth = 2.5; dotAt(context, [px(mark[0]), py(mark[1])]); }
  const told = mark ? `${metres(mark[0] * profile.length)}: ${num(mark[1], facts.told_steps[1])} ${facts.units[1]}`
    : `${metres(profile.length)} long, ${num(low, facts.told_steps[1])} to ${num(high, facts.told_steps[1])} ${facts.units[1]}`;
  $('profile-told').textContent = 'Section: ' + told;
}

function followProfile(event) {
  const width = $('profile').clientWidth - 58;
  const share = (event.clientX - $('profile').getBoundingClientRect().left - 50) / width;
  const piece = profile.pieces.find(([a, b]) => share >= a[0] && share <= b[0]);
  profile.mark = null;
  if (piece) {
    const [a, b] = piece;
    const z = a[1] + ((b[1] - a[1]) * (share - a[0])) / (b[0] - a[0]);
    profile.mark = [0, 1].map((k) => profile.from[k] + (profile.to[k] - profile.from[k]) * share).concat(z);
    drawProfile([share, z]);
  } else drawProfile();
  dirty = true;
}

function saveProfile() {
  const lines = profile.line.map(([share, place]) => [share * profile.length, ...place].join(','));
  const link = element('a');
  link.href = URL.createObjectURL(new Blob(['distance_m,x,y,height\n' + lines.join('\n') + '\n'], { type: 'text/csv' }));
  link.download = 'section.csv';
  link.click();
  URL.revokeObjectURL(link.href);
}

// ---- controls

function choose(next) {
  tool = tool === next ? null : next;
  places = [];
  profile = null;
  $('sheet').hidden = true;
  press($('measure'), tool === 'measure');
  press($('section'), tool === 'section');
  $('view').classList.toggle('pick', tool !== null);
  if (tool === 'measure') tellMeasure();
  else if (tool === 'section') tell([['Section', 'click its first end']]);
  else tellPlace(null);
  dirty = true;
}

function clicked(px, py) {
  const found = under(px, py);
  if (!found) return;
  if (tool === null) return tellPlace(found);
  if (tool === 'section' && places.length === 2) places = [];
  places.push([found.x, found.y, found.z]);
  if (tool === 'measure') tellMeasure();
  else if (places.length === 2) makeProfile();
  else { profile = null; tell([['Section', 'click its other end']]); }
  dirty = true;
}

function setColour(colour) {
  if (colour === 3 && !floats) return;
  shown.colour = colour;
  for (const button of $('colours').children) press(button, Number(button.dataset.colour) === colour);
  $('legend').hidden = colour === 0;
  if (colour !== 0) { drawing.paint(scaleOf(colour)); drawLegend(); }
  dirty = true;
}

function setExaggeration(value) {
  shown.exaggeration = Math.min(1000, Math.max(0.01, value));
  $('exaggeration').value = Math.log2(shown.exaggeration);
  $('exaggeration-told').textContent = num(shown.exaggeration, 0.1) + ' ×';
  dirty = true;
}

function setControls() {
  for (const button of $('colours').children) {
    button.addEventListener('click', () => setColour(Number(button.dataset.colour)));
    if (button.dataset.colour === '3' && !floats) button.disabled = true, button.title = 'made with --against GRID';
  }
  for (const name of ['wire', 'facets', 'walls']) {
    $(name).addEventListener('click', () => flip(name));
    press($(name), shown[name]);
  }
  $('exaggeration').addEventListener('input', (event) => setExaggeration(2 ** event.target.value));
  $('light').addEventListener('input', (event) => setLight(Number(event.target.value)));
  $('measure').addEventListener('click', () => choose('measure'));
  $('section').addEventListener('click', () => choose('section'));
  $('flight').addEventListener('click', () => setFlight(!flying));
  $('top').addEventListener('click', () => { camera.top(); dirty = true; });
  $('home').addEventListener('click', () => { camera.reset(); dirty = true; });
  $('compass').addEventListener('click', () => { camera.yaw = 0; dirty = true; });
  $('shut').addEventListener('click', () => choose(null));
  $('save').addEventListener('click', saveProfile);
  $('profile').addEventListener('pointermove', followProfile);
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
  tellFigures();
}

const KEYS = {
  1: () => setColour(1), 2: () => setColour(2), 3: () => setColour(3), 4: () => setColour(0),
  e: () => flip('wire'), g: () => flip('facets'), b: () => flip('walls'), m: () => choose('measure'), p: () => choose('section'),
  f: () => setFlight(!flying), r: () => camera.reset(), t: () => camera.top(), n: () => { camera.yaw = 0; },
  '+': () => setExaggeration(shown.exaggeration * 1.25), '=': () => setExaggeration(shown.exaggeration * 1.25),
  '-': () => setExaggeration(shown.exaggeration / 1.25),
  backspace: () => { if (tool === 'measure') { places.pop(); tellMeasure(); } },
  escape: () => { if (tool !== null) choose(tool); },
};

function keyed(event) {
  if (event.ctrlKey || event.metaKey || event.altKey || event.target.matches('input')) return;
  const key = event.key.toLowerCase();
  if (hold(key)) event.preventDefault();
  KEYS[key]?.();
  dirty = true;
}

function tellFigures() {
  const { bounds } = scene;
  const [level, upright] = facts.told_steps;
  const span = ([low, high], step) => num(low, step) + ' – ' + num(high, step);
  $('about').textContent = facts.about;
  rows($('figures'), [
    ...facts.figures,
    ['Vertices', count(scene.world.x.length)],
    ['Triangles', count(drawing.triangles)],
    [facts.geographic ? 'Lon' : 'X', span(bounds.x, level)],
    [facts.geographic ? 'Lat' : 'Y', span(bounds.y, level)],
    ['Heights', span(bounds.z, upright) + ' ' + facts.units[1]],
    ['Area in plan', area(drawing.areas.plan)],
    ['Area of the surface', area(drawing.areas.surface)],
  ]);
  $('notes').textContent = facts.notes.join(' ');
}

function resize() {
  const ratio = Math.min(window.devicePixelRatio || 1, 2);
  const view = $('view');
  view.width = Math.max(1, Math.round(view.clientWidth * ratio));
  view.height = Math.max(1, Math.round(view.clientHeight * ratio));
  camera.aspect = view.width / view.height;
  // What is looked at is in the middle of what the panel leaves.
  camera.shift = view.clientWidth > 720 ? 272 / view.clientWidth : 0;
  setColour(shown.colour);
  setExaggeration(shown.exaggeration);
  setLight(shown.azimuth);
  drawHistogram();
  if (profile) drawProfile();
  if (tool === null) tellPlace(null);
  dirty = true;
}

function how() {
  const [azimuth, altitude] = [shown.azimuth, shown.altitude].map((degrees) => (degrees * Math.PI) / 180);
  const level = Math.cos(altitude);
  return { ...shown, range: [0, drawing.top[2]], most: mostError(),
    light: [Math.sin(azimuth) * level, Math.cos(azimuth) * level, Math.sin(altitude)] };
}

let before = 0;
function frame(now) {
  const seconds = Math.min(0.1, (now - before) / 1000);
  before = now;
  if (moveHeld(camera, seconds)) dirty = true;
  if (dirty) {
    dirty = false;
    drawing.draw(camera, how());
    drawOver();
    drawCompass(camera);
  }
  requestAnimationFrame(frame);
}

/** For scripts: what is shown, the surface at a place and under a pixel, and the picture. */
window.terrane = {
  facts, shown, names: NAMES, at: (x, y) => index.at(x, y), under, toView: (place) => toView(place),
  camera: () => camera, places: () => places, profile: () => profile,
  vertex: (i) => [scene.world.x[i], scene.world.y[i], scene.world.z[i]], corners: () => scene.corners,
  errors: () => floats,
  picture: () => {
    const { gl, canvas } = drawing;
    drawing.draw(camera, how());
    const bytes = new Uint8Array(4 * canvas.width * canvas.height);
    gl.readPixels(0, 0, canvas.width, canvas.height, gl.RGBA, gl.UNSIGNED_BYTE, bytes);
    return { width: canvas.width, height: canvas.height, bytes };
  },
};

start().catch(fail);
