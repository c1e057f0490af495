// The page of a surface: display and tools.

const SLOPES = [[255, 255, 240], [254, 217, 140], [240, 130, 70], [178, 40, 60], [82, 12, 62]];
const ERRORS = [[238, 244, 240], [168, 211, 204], [110, 176, 180], [247, 214, 138], [236, 146, 78], [190, 52, 58]];
const NAMES = ['Relief', 'Height', 'Slope', 'Error'];

const shown = {
  colour: 1, wire: false, facets: false, walls: true, exaggeration: 1, azimuth: facts.azimuth, altitude: facts.altitude,
};
let drawing, camera, index, scene, floats;
let flying = false;
let dirty = true;

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
  makeScale();
  setControls();
  resize();
  camera.reset();
  whenResized(resize);
  $('wait').hidden = true;
  document.body.dataset.state = 'ready';
  requestAnimationFrame(frame);
}

// ---- colours

/** Colours of heights: halfway between equal steps of height and equal shares of the area. */
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
  scene.heights = heightRamp(bins, scene.bounds.z);
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

// ---- picking

/** The position on the surface under a CSS pixel, or null. */
function under(px, py) {
  const view = $('view');
  const ray = camera.ray((2 * px) / view.clientWidth - 1, 1 - (2 * py) / view.clientHeight);
  const from = toData(camera.eye);
  const to = toData(along(camera.eye, ray, camera.distance + camera.radius * 4));
  const found = index.hit(from, minus(to, from));
  return found && { ...found, error: floats ? floats[found.triangle] : undefined };
}

// ---- status line

function slopeOf(t) {
  const [a, b, c] = [0, 1, 2].map((k) => scene.corners[3 * t + k]);
  const at = (i) => [scene.world.x[i], scene.world.y[i], scene.world.z[i]].map((v, k) => v * facts.ground[k]);
  const n = norm(cross(minus(at(b), at(a)), minus(at(c), at(a))));
  return (Math.acos(Math.min(1, Math.abs(n[2]))) * 180) / Math.PI;
}

function tellPlace(found) {
  const [level, upright] = facts.reported_steps;
  if (!found) return tell([['', 'Point at the surface to read values · ? for help']]);
  const names = facts.geographic ? ['Lon', 'Lat'] : ['X', 'Y'];
  const list = [[names[0], num(found.x, level)], [names[1], num(found.y, level)],
    ['Height', num(found.z, upright) + ' ' + facts.units[1]], ['Slope', num(slopeOf(found.triangle), 0.1) + '°']];
  if (floats) list.push(['Error of the triangle', tellError(found.error)]);
  tell(list);
}

const tellError = (error) => (Number.isNaN(error) ? 'no samples' : num(error, facts.reported_steps[1] / 10) + ' ' + facts.units[1]);

/** Interface of the tools. */
const terrain = {
  columns: 'x,y,height', level: 'in plan', apart, areaOf,
  get unit() { return facts.units[1]; },
  get step() { return facts.reported_steps[1]; },
  placeOf: ({ x, y, z }) => [x, y, z],
  between: (a, b, share) => along(a, minus(b, a), share),
  trace: (a, b) => [a, b],
  section: (from, to) => {
    const place = ([share, height]) => [share, [...along(from, minus(to, from), share).slice(0, 2), height]];
    return { pieces: index.section(from, to).map((piece) => piece.map(place)) };
  },
};

// ---- controls

function setColour(colour) {
  if (colour === 3 && !floats) return;
  shown.colour = colour;
  for (const button of $('colours').children) press(button, Number(button.dataset.colour) === colour);
  $('legend').hidden = colour === 0;
  if (colour !== 0) { drawing.paint(scaleOf(colour)); drawLegend(); }
  dirty = true;
}

function setControls() {
  for (const button of $('colours').children) {
    button.addEventListener('click', () => setColour(Number(button.dataset.colour)));
    if (button.dataset.colour === '3' && !floats) button.disabled = true, button.title = 'requires --against GRID';
  }
  for (const name of ['wire', 'facets', 'walls']) {
    $(name).addEventListener('click', () => flip(name));
    press($(name), shown[name]);
  }
  $('light').addEventListener('input', (event) => setLight(Number(event.target.value)));
  setTools();
  setCamera();
  tellFigures();
}

const KEYS = {
  1: () => setColour(1), 2: () => setColour(2), 3: () => setColour(3), 4: () => setColour(0),
  e: () => flip('wire'), g: () => flip('facets'), b: () => flip('walls'),
  ...CAMERA_KEYS, ...TOOL_KEYS,
};

function tellFigures() {
  const { bounds } = scene;
  const [level, upright] = facts.reported_steps;
  const span = ([low, high], step) => num(low, step) + ' – ' + num(high, step);
  $('about').textContent = facts.about;
  rows($('figures'), [
    ...facts.figures,
    ['Vertices', count(scene.world.x.length)],
    ['Triangles', count(drawing.triangles)],
    [facts.geographic ? 'Lon' : 'X', span(bounds.x, level)],
    [facts.geographic ? 'Lat' : 'Y', span(bounds.y, level)],
    ['Heights', span(bounds.z, upright) + ' ' + facts.units[1]],
    ['Horizontal area', area(drawing.areas.plan)],
    ['Surface area', area(drawing.areas.surface)],
  ]);
  $('notes').textContent = facts.notes.join(' ');
}

function resize() {
  fitView();
  setColour(shown.colour);
  setExaggeration(shown.exaggeration);
  setLight(shown.azimuth);
  drawHeights(scene.bins, scene.heights, scene.bounds.z, 'area');
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

/** Interface for scripts. */
window.terrane = {
  facts, shown, names: NAMES, at: (x, y) => index.at(x, y), under, toView: (place) => toView(place),
  camera: () => camera, places: () => places, profile: () => profile,
  vertex: (i) => [scene.world.x[i], scene.world.y[i], scene.world.z[i]], corners: () => scene.corners,
  errors: () => floats,
  picture: () => pictureOf(drawing, () => drawing.draw(camera, how())),
};

start().catch(fail);
