// The page of terrain tiles: display and tools.

const SLOPES = [[255, 255, 240], [254, 217, 140], [240, 130, 70], [178, 40, 60], [82, 12, 62]];
const ERRORS = [[238, 244, 240], [168, 211, 204], [110, 176, 180], [247, 214, 138], [236, 146, 78], [190, 52, 58]];
/** Colours of levels; adjacent levels differ clearly. */
const LEVELS = [[196, 122, 94], [121, 164, 196], [214, 184, 104], [132, 172, 122], [170, 132, 178], [110, 178, 174]];
/** Rounding step of degrees: a tenth of a metre. */
const DEGREE_STEP = 1e-6;
/** Upper bound of heights above the ellipsoid, in metres. */
const ABOVE = 1e5;

const shown = {
  colour: 1, wire: Boolean(facts.edges), facets: false, borders: false, exaggeration: facts.exaggeration ?? 1,
  azimuth: facts.azimuth, altitude: facts.altitude, allowed: 2,
};
let drawing, camera, stream, set;
let view = null;
let flying = false;
let dirty = true;
let touched = false; // the user has moved the target
let natural = facts.exaggeration === null; // the exaggeration is still to be fitted
let pointer = null;
let painted = '';

async function start() {
  setPanel();
  const answer = await fetch(facts.index);
  if (!answer.ok) throw new Error(facts.index + ': ' + answer.status);
  set = new (facts.format === '3dtiles' ? ThreeTiles : TileSet)(await answer.json());
  drawing = new TilesDrawing($('view'));
  stream = new TileStream(set, {
    upload: (mesh) => drawing.upload(mesh), release: (mesh) => drawing.release(mesh), changed: () => { dirty = true; },
  });
  camera = new GlobeCamera(homeOf(set.bounds));
  setControls();
  resize();
  camera.reset();
  whenResized(resize);
  requestAnimationFrame(frame);
}

/** View of the full extent. */
function homeOf([west, south, east, north]) {
  const lat = (south + north) / 2;
  const wide = (east - west) * RADIANS * EQUATOR * Math.cos(lat * RADIANS);
  const span = Math.max(200, Math.hypot(wide, (north - south) * RADIANS * EQUATOR));
  return { lon: (west + east) / 2, lat, span, distance: Math.min(2.6e7, span * 1.3) };
}

// ---- picking

function viewOf() {
  const { frame } = camera;
  const eye = frame.world(camera.eye);
  const [ahead, right] = [camera.ahead, camera.right].map((v) => frame.outward(v));
  const wide = HALF_VIEW * camera.aspect;
  camera.relief = Math.max(100, (stream.heights?.[1] ?? 9000) * shown.exaggeration);
  return {
    eye, at: geodetic(eye), focus: [frame.lon, frame.lat], axes: [right, cross(right, ahead), ahead], horizon: camera.horizon.most,
    sides: [(-1 - camera.shift) * wide, (1 - camera.shift) * wide, HALF_VIEW],
    pixels: $('view').clientHeight / 2 / HALF_VIEW, exaggeration: shown.exaggeration, allowed: shown.allowed,
  };
}

/** The terrain under a position in the view. */
function under(px, py) {
  const { clientWidth, clientHeight } = $('view');
  const way = camera.frame.outward(camera.ray((2 * px) / clientWidth - 1, 1 - (2 * py) / clientHeight));
  return told(hit(stream.draws, camera.frame.world(camera.eye), way, shown.exaggeration), shown.exaggeration);
}

/** The displayed terrain at a position on the globe. */
function at(lon, lat) {
  const up = upright(lon, lat);
  return told(hit(stream.draws, earthCentred(lon, lat, ABOVE), along([0, 0, 0], up, -1), 1, 2 * ABOVE), 1);
}

/** A hit with its position on the globe. */
function told(found, exaggeration) {
  if (!found) return null;
  const { tile, three, weights } = found;
  const of = (places) => three.reduce((sum, i, k) => along(sum, places.subarray(3 * i, 3 * i + 3), weights[k]), [0, 0, 0]);
  const { mesh } = tile;
  const [lon, lat, height] = geodetic(plus(mesh.middle, of(mesh.places)));
  const [a, b, c] = three.map((i) => [...mesh.places.subarray(3 * i, 3 * i + 3)]);
  const steep = Math.abs(dot(norm(cross(minus(b, a), minus(c, a))), upright(lon, lat)));
  return { lon, lat, height, slope: Math.acos(Math.min(1, steep)) / RADIANS, level: tile.level, tile: tile.name, error: tile.error,
    scene: camera.frame.local(plus(mesh.middle, of(bentPlaces(mesh, exaggeration)))) };
}

/** Position in the view of a position on the globe; null behind the eye or the globe. */
function toView([lon, lat, height]) {
  const world = earthCentred(lon, lat, height * shown.exaggeration);
  if (isBehind(camera.frame.world(camera.eye), world)) return null;
  const place = minus(camera.frame.local(world), camera.eye);
  const m = camera.matrix;
  const [x, y, , w] = [0, 1, 2, 3].map((r) => m[r] * place[0] + m[4 + r] * place[1] + m[8 + r] * place[2] + m[12 + r]);
  const { clientWidth, clientHeight } = $('view');
  return w > 0 ? [((x / w + 1) / 2) * clientWidth, ((1 - y / w) / 2) * clientHeight] : null;
}

function tellPlace(found) {
  if (!found) return tell([['', 'Point at the terrain to read values']]);
  tell([['Lon', num(found.lon, DEGREE_STEP) + '°'], ['Lat', num(found.lat, DEGREE_STEP) + '°'],
    ['Height', num(found.height, 0.1) + ' m'], ['Slope', num(found.slope, 0.1) + '°'],
    ['Level', String(found.level)], ['Error', tellError(found.error)]]);
}

// ---- measuring and sections

/** Number of pieces of a drawn line. */
const TRACE = 64;

/** Interface of the tools; heights are above the ellipsoid. */
const terrain = {
  columns: 'lon,lat,height', level: 'on the ellipsoid', unit: 'm', step: 0.1,
  placeOf: ({ lon, lat, height }) => [lon, lat, height],
  apart: (a, b) => ({ level: geodesic(a, b), space: Math.hypot(...minus(earthCentred(...b), earthCentred(...a))),
    up: b[2] - a[2], rise: b[2] - a[2] }),
  between: straight,
  trace: (a, b) => Array.from({ length: TRACE + 1 }, (_, i) => {
    const [lon, lat] = straight(a, b, i / TRACE);
    return [lon, lat, a[2] + ((b[2] - a[2]) * i) / TRACE];
  }),
  section: (from, to) => {
    const { pieces, error } = sectionOf(stream.draws, new SectionLine(from, to), set.bounds);
    return { pieces, note: pieces.length ? 'error ' + tellError(error) : '' };
  },
};

/** Updates the section for the displayed tiles. */
let sectioned = '';
function followSection() {
  if (!profile) return;
  const now = covering().map(({ tile, quarters }) => tile.name + ':' + quarters).join();
  if (now !== sectioned) renewProfile();
  sectioned = now;
}

const tellError = (error) => '≤ ' + num(error, error < 10 ? 0.01 : 0.1) + ' m';

// ---- colours

const rangeOf = () => stream.heights ?? [0, 1];

/** Drawn tiles with data. */
const covering = () => stream.draws.filter((draw) => !draw.isBare);

/** Smallest and largest error of drawn tiles, for a logarithmic scale. */
function errorRange() {
  const all = covering().map(({ tile }) => Math.max(1e-3, tile.error));
  return all.length ? [Math.min(...all), Math.max(...all) * 1.001] : [1, 2];
}

function scaleOf(colour) {
  if (colour === 1) {
    const [low, high] = rangeOf();
    const isSea = low < 0 && high > 0;
    return Array.from({ length: 256 }, (_, i) => {
      const height = low + ((high - low) * i) / 255;
      if (isSea && height < 0) return between(facts.palette.water, 1 - height / Math.min(low, -0.5 * high));
      const from = isSea ? 0 : low;
      return between(facts.palette.land, (height - from) / (high - from || 1));
    });
  }
  const stops = colour === 2 ? SLOPES : ERRORS;
  return Array.from({ length: 256 }, (_, i) => between(stops, i / 255));
}

/** Draws the legend if its range has changed. */
function paint() {
  const { colour } = shown;
  const levels = [...new Set(covering().map(({ tile }) => tile.level))].sort((a, b) => a - b);
  const about = colour === 1 ? rangeOf() : colour === 3 ? levels : colour === 4 ? errorRange() : [];
  const now = [colour, ...about, $('legend').clientWidth].join();
  if (now === painted) return;
  painted = now;
  $('legend').hidden = colour === 0;
  if (colour === 0) return;
  if (colour === 3) return drawLevels(levels);
  drawing.paint(scaleOf(colour));
  if (colour === 4) drawRamp(scaleOf(4), ...about.map(Math.log10), '', (power) => num(10 ** power) + ' m');
  else drawRamp(scaleOf(colour), ...(colour === 1 ? about : [0, 60]), colour === 1 ? ' m' : '°');
}

function drawLevels(levels) {
  const [context, width] = plane($('legend'));
  const wide = Math.min(28, width / Math.max(1, levels.length));
  context.textAlign = 'center';
  levels.forEach((level, i) => {
    context.fillStyle = css(LEVELS[level % LEVELS.length]);
    context.fillRect(i * wide, 2, wide - 2, 14);
    context.fillStyle = '#5b6876';
    context.fillText(String(level), (i + 0.5) * wide - 1, 32);
  });
}

// ---- controls

function setColour(colour) {
  shown.colour = colour;
  for (const button of $('colours').children) press(button, Number(button.dataset.colour) === colour);
  dirty = true;
}

function setExaggeration(value) {
  const before = shown.exaggeration;
  shown.exaggeration = Math.min(1000, Math.max(0.01, value));
  camera.target[2] *= shown.exaggeration / before;
  $('exaggeration').value = Math.log2(shown.exaggeration);
  $('exaggeration-told').textContent = num(shown.exaggeration, 0.1) + ' ×';
  dirty = true;
}

function setAllowed(pixels) {
  shown.allowed = Math.min(64, Math.max(0.5, pixels));
  $('allowed').value = Math.log2(shown.allowed);
  $('allowed-told').textContent = num(shown.allowed, 0.1) + ' pixels';
  dirty = true;
}

function home() {
  camera.reset();
  touched = false;
  dirty = true;
}

function setControls() {
  for (const button of $('colours').children) button.addEventListener('click', () => setColour(Number(button.dataset.colour)));
  for (const name of ['wire', 'facets', 'borders']) {
    $(name).addEventListener('click', () => flip(name));
    press($(name), shown[name]);
  }
  $('allowed').addEventListener('input', (event) => setAllowed(2 ** event.target.value));
  $('exaggeration').addEventListener('input', (event) => { natural = false; setExaggeration(2 ** event.target.value); });
  $('light').addEventListener('input', (event) => setLight(Number(event.target.value)));
  setTools();
  $('flight').addEventListener('click', () => setFlight(!flying));
  $('top').addEventListener('click', () => { camera.top(); dirty = true; });
  $('home').addEventListener('click', home);
  $('compass').addEventListener('click', () => { camera.yaw = 0; dirty = true; });
  gestures($('view'), {
    drag: (dx, dy, kind) => {
      const height = $('view').clientHeight;
      touched ||= kind === 'pan';
      if (kind === 'pan') camera.pan(dx / height, dy / height);
      else if (flying) camera.turn((-1.2 * dx) / height, (1.2 * dy) / height, true);
      else camera.turn((3 * dx) / height, (-2 * dy) / height);
      dirty = true;
    },
    zoom: (factor, px, py) => {
      touched = true;
      camera.zoom(factor, under(px, py)?.scene);
      dirty = true;
    },
    twist: (angle) => { camera.turn(-angle, 0); dirty = true; },
    hover: (px, py) => { pointer = Number.isNaN(px) ? null : [px, py]; dirty = true; },
    click: (px, py) => { pointer = [px, py]; clicked(px, py); },
  });
  window.addEventListener('keydown', keyed);
  setColour(shown.colour);
  setExaggeration(shown.exaggeration);
  setLight(shown.azimuth);
  setAllowed(shown.allowed);
  $('about').textContent = `${count(set.count)} tiles of ${set.last + 1} levels`;
}

const KEYS = {
  1: () => setColour(1), 2: () => setColour(2), 3: () => setColour(3), 4: () => setColour(4), 5: () => setColour(0),
  e: () => flip('wire'), g: () => flip('facets'), b: () => flip('borders'),
  f: () => setFlight(!flying), r: home, t: () => camera.top(), n: () => { camera.yaw = 0; },
  ',': () => setAllowed(shown.allowed / 1.4), '.': () => setAllowed(shown.allowed * 1.4),
  '+': () => stretch(1.25), '=': () => stretch(1.25), '-': () => stretch(0.8),
  ...TOOL_KEYS,
};

function stretch(by) {
  natural = false;
  setExaggeration(shown.exaggeration * by);
}

function keyed(event) {
  if (event.ctrlKey || event.metaKey || event.altKey || event.target.matches('input')) return;
  const key = event.key.toLowerCase();
  if (hold(key)) { event.preventDefault(); touched = true; }
  KEYS[key]?.();
  dirty = true;
}

function resize() {
  const ratio = Math.min(window.devicePixelRatio || 1, 2);
  const canvas = $('view');
  canvas.width = Math.max(1, Math.round(canvas.clientWidth * ratio));
  canvas.height = Math.max(1, Math.round(canvas.clientHeight * ratio));
  camera.aspect = canvas.width / canvas.height;
  camera.shift = canvas.clientWidth > 720 ? 272 / canvas.clientWidth : 0;
  if (profile) drawProfile();
  dirty = true;
}

// ---- frames

function how() {
  const [azimuth, altitude] = [shown.azimuth, shown.altitude].map((degrees) => degrees * RADIANS);
  const level = Math.cos(altitude);
  const [least, most] = errorRange().map(Math.log);
  return { ...shown, range: rangeOf(), bounds: set.bounds, pixels: view.pixels,
    light: [Math.sin(azimuth) * level, Math.cos(azimuth) * level, Math.sin(altitude)],
    tintOf: ({ level: of }) => LEVELS[of % LEVELS.length].map((value) => value / 255),
    errorOf: ({ error }) => (Math.log(Math.max(1e-3, error)) - least) / (most - least) };
}

/** Until the user moves: keeps the target on the ground and fits the exaggeration. */
function follow() {
  if (touched) return;
  if (natural && isIdle() && stream.heights) {
    natural = false;
    const relief = stream.heights[1] - stream.heights[0];
    setExaggeration(Math.min(3, Math.max(1, Math.round((0.13 * camera.home.span) / (relief || 1)) / 2)));
  }
  const ground = at(camera.frame.lon, camera.frame.lat);
  // Errors of coarse tiles may be kilometres.
  const isNear = ground && (ground.error < camera.distance || ground.level === set.last);
  if (isNear) camera.target[2] = ground.height * shown.exaggeration;
}

const failures = () => [...stream.failures, ...set.failures()];

const isIdle = () => stream.waiting === 0 && stream.asker.isIdle;

function render() {
  view = viewOf();
  stream.update(view);
  const { draws } = stream;
  const z = camera.target[2];
  follow();
  if (camera.target[2] !== z) dirty = true;
  paint();
  drawing.draw(camera, draws, how());
  drawCompass(camera);
  followSection();
  drawOver();
  if (tool === null) tellPlace(pointer && under(...pointer));
  tellFigures();
  if (document.body.dataset.state !== 'ready' && draws.length > 0) {
    $('wait').hidden = true;
    document.body.dataset.state = 'ready';
  }
  if (draws.length === 0 && failures().length > 0) fail(failures()[0]);
}

const bytes = (value) => (value >= 1 << 20 ? num(value / (1 << 20), 0.1) + ' MiB' : num(value / 1024, 1) + ' KiB');

function figures() {
  const own = covering();
  const levels = own.map(({ tile }) => tile.level);
  return {
    drawn: own.length, loaded: stream.ready.size, loading: stream.waiting, again: stream.asker.paused, triangles: drawing.triangles, bytes: stream.bytes,
    received: stream.asker.received, pixels: Math.max(0, ...own.map((draw) => draw.pixels)), strain: stream.strain,
    levels: [Math.min(...levels), Math.max(...levels)], failures: failures().length,
  };
}

function tellFigures() {
  const now = figures();
  rows($('figures'), [
    ['Tiles drawn', now.drawn],
    ['Levels drawn', now.drawn ? now.levels.join(' – ') : '–'],
    ['Triangles drawn', now.triangles],
    ['Largest error', num(now.pixels, 0.1) + ' pixels'],
    ['Tiles in memory', count(now.loaded) + ', ' + bytes(now.bytes)],
    ['Received', bytes(now.received)],
    ['Tiles loading', now.loading],
    ['Heights', rangeOf().map((height) => num(height, 1)).join(' – ') + ' m'],
  ]);
  const notes = [];
  if (now.strain > 1) notes.push('Tiles are coarser than requested: finer tiles do not fit into memory.');
  if (now.again) notes.push(`${now.again} failed requests will be repeated.`);
  if (now.failures) notes.push(`${now.failures} tiles cannot be shown, first ${failures()[0]}.`);
  $('notes').textContent = notes.join(' ');
}

let before = 0;
function frame(now) {
  const seconds = Math.min(0.1, (now - before) / 1000);
  before = now;
  if (moveHeld(camera, seconds)) dirty = true;
  if (dirty) {
    dirty = false;
    try { render(); } catch (error) { return fail(error); }
  }
  requestAnimationFrame(frame);
}

/** Interface for scripts. */
window.terrane = {
  facts, shown, at, under, toView, geodesic, figures, section: (from, to) => terrain.section(from, to).pieces, places: () => places, profile: () => profile, stream: () => stream, camera: () => camera,
  isIdle: () => !dirty && isIdle(),
  drawn: () => covering().map(({ tile, quarters, pixels }) => ({ level: tile.level, x: tile.x, y: tile.y, quarters, pixels, error: tile.error })),
  look: (lon, lat, distance, height = 0) => { touched = true; camera.look(lon, lat, distance, height * shown.exaggeration); dirty = true; },
  refresh: () => { dirty = true; },
  picture: () => {
    const { gl, canvas } = drawing;
    drawing.draw(camera, stream.draws, how());
    const pixels = new Uint8Array(4 * canvas.width * canvas.height);
    gl.readPixels(0, 0, canvas.width, canvas.height, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
    return { width: canvas.width, height: canvas.height, bytes: pixels };
  },
};

start().catch(fail);
