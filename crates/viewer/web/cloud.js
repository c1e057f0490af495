// The page of a point cloud: displayed points and tools.

const COLOURS = ['Height', 'Class', 'Intensity', 'Return', 'Colour'];
const RETURNS = [[130, 130, 136], [58, 108, 168], [232, 150, 60], [92, 166, 96], [196, 78, 88], [140, 104, 176], [150, 116, 92],
  [214, 138, 190], [188, 182, 74], [84, 186, 196]];
const FLAGS = ['synthetic', 'key point', 'withheld', 'overlap'];
/** Shares of points beyond either end of the colour scale. */
const BEYOND = 0.001;

const shown = { colour: 0, exaggeration: 1, size: 2, shade: true, classes: new Set(), returns: new Set() };
let drawing, camera, scene;
let flying = false;
let dirty = true;

async function start() {
  setPanel();
  const names = ['x', 'y', 'z', 'marks', 'intensity', 'colour'];
  const [x, y, z, marks, intensity, rgb] = await Promise.all(names.map((name) => (has(name) ? array(name) : null)));
  const ground = ['x', 'y', 'z'].map((name, k) => facts[name].step * facts.ground[k]);
  const heights = endsOf(z, BEYOND);
  drawing = new CloudDrawing($('view'), { x, y, z, marks, intensity, rgb }, ground, heights);
  const world = (name, code) => facts[name].low + code * facts[name].step;
  scene = {
    x, y, z, marks, intensity, rgb, world, heights, strengths: intensity ? endsOf(intensity, 0.01) : [0, 1],
    bounds: { x: [0, 1], y: [0, 1], z: [0, 1] }, middle: ['x', 'y', 'z'].map((name, k) => world(name, drawing.middle[k])),
  };
  ['x', 'y', 'z'].forEach((name, k) => { scene.bounds[name] = [0, drawing.top[k]].map((code) => world(name, code)); });
  camera = new Camera(drawing.radius);
  shown.exaggeration = facts.exaggeration ?? 1;
  for (const { class: code } of facts.classes) shown.classes.add(code);
  for (const { number } of facts.returns) shown.returns.add(number);
  countKinds();
  makeScale();
  setControls();
  setSize(shown.size);
  resize();
  camera.reset();
  whenResized(resize);
  $('wait').hidden = true;
  document.body.dataset.state = 'ready';
  requestAnimationFrame(frame);
}

/** Low and high quantiles of values, by counts of 4096 steps. */
function endsOf(values, share) {
  const [low, high] = values.reduce(([a, b], v) => [v < a ? v : a, v > b ? v : b], [Infinity, 0]);
  const size = (high - low + 1) / 4096;
  const counts = new Uint32Array(4096);
  for (const value of values) counts[Math.floor((value - low) / size)]++;
  const most = share * values.length;
  const end = (from, step) => {
    let i = from;
    for (let sum = counts[i]; sum <= most && counts[i + step] !== undefined; sum += counts[i]) i += step;
    return i;
  };
  return [Math.max(low, low + Math.floor(end(0, 1) * size)), Math.min(high, low + Math.ceil((end(4095, -1) + 1) * size))];
}

// ---- classes and returns

/** Numbers of points in the page, by class and return. */
function countKinds() {
  scene.counts = new Uint32Array(4096);
  for (const mark of scene.marks) scene.counts[mark & 4095]++;
}

const isOn = (mark) => shown.classes.has(mark & 255) && shown.returns.has((mark >> 8) & 15);

/** Number of points whose class and return are shown. */
const countShown = () => scene.counts.reduce((sum, points, mark) => sum + (points > 0 && isOn(mark) ? points : 0), 0);

const returnColour = (number) => RETURNS[number % RETURNS.length];

/** The set of switches of these colours, and its entries. */
function kindsOf(colour) {
  if (colour === 1) {
    return { on: shown.classes, list: facts.classes.map((of) => ({ ...of, code: of.class, name: of.class + ' ' + of.name })) };
  }
  if (colour !== 3) return null;
  const name = (number) => (number === 0 ? 'unknown' : 'return ' + number);
  const list = facts.returns.map(({ number, points }) => ({ code: number, name: name(number), colour: returnColour(number), points }));
  return { on: shown.returns, list };
}

function drawKinds() {
  const kinds = kindsOf(shown.colour);
  $('kinds').hidden = kinds === null;
  $('kinds').replaceChildren();
  for (const { code, name, colour, points } of kinds?.list ?? []) {
    const button = element('button', undefined, $('kinds'));
    drawSwatch(element('i', undefined, button), colour);
    element('span', name, button);
    element('b', count(points), button);
    press(button, kinds.on.has(code));
    button.addEventListener('click', (event) => switchKind(kinds, code, event.shiftKey));
  }
}

function drawSwatch(swatch, colour) {
  swatch.style.background = css(colour);
}

function switchKind({ on, list }, code, alone) {
  const isAlone = on.size === 1 && on.has(code);
  if (alone) {
    on.clear();
    for (const kind of list) if (isAlone || kind.code === code) on.add(kind.code);
  } else if (!on.delete(code)) on.add(code);
  showKinds();
}

function showEverything() {
  for (const colour of [1, 3]) {
    const { on, list } = kindsOf(colour);
    for (const { code } of list) on.add(code);
  }
  showKinds();
}

function showKinds() {
  const line = (colours, on) => Array.from({ length: 256 }, (_, i) => [...(colours(i) ?? [128, 128, 128]), on.has(i) ? 255 : 0]);
  const classes = new Map(facts.classes.map((of) => [of.class, of.colour]));
  drawing.paintKinds([line((i) => classes.get(i), shown.classes), line(returnColour, shown.returns)]);
  drawKinds();
  tellFigures();
  dirty = true;
}

// ---- colours

const heightOf = (code) => scene.world('z', code);

function makeScale() {
  const { z, heights: [low, high] } = scene;
  const bins = new Float64Array(256);
  for (const code of z) bins[Math.min(255, Math.max(0, Math.floor(((code - low) / (high - low || 1)) * 256)))]++;
  scene.bins = bins;
  scene.ramp = heightRamp(bins, scene.heights.map(heightOf));
  drawing.paint(scene.ramp);
}

function drawLegend() {
  const { colour } = shown;
  const gray = (i) => { const v = 255 * (0.08 + 0.9 * Math.sqrt(i / 255)); return [v, v, v]; };
  $('legend').hidden = colour !== 0 && colour !== 2;
  if (colour === 0) drawRamp(scene.ramp, ...scene.heights.map(heightOf), ' ' + facts.units[1]);
  if (colour === 2) drawRamp(Array.from({ length: 256 }, (_, i) => gray(i)), ...scene.strengths, '');
}

// ---- picking

/** All attributes of a point. */
function pointOf(i) {
  const { x, y, z, marks, intensity, rgb } = scene;
  const mark = marks[i];
  const channels = rgb && [0, 8, 16].map((shift) => (rgb[i] >> shift) & 255);
  return {
    point: i, x: scene.world('x', x[i]), y: scene.world('y', y[i]), z: scene.world('z', z[i]), class: mark & 255,
    number: (mark >> 8) & 15, returns: (mark >> 12) & 15, flags: FLAGS.filter((_, bit) => (mark >> (16 + bit)) & 1),
    intensity: intensity ? intensity[i] : null, colour: channels,
  };
}

/** The point under a CSS pixel, or null. */
function under(px, py) {
  if (dirty) render();
  const view = $('view');
  const found = drawing.pick(px / view.clientWidth, py / view.clientHeight);
  return found === null ? null : pointOf(found);
}

function tellPlace(found) {
  const [level, upright] = facts.reported_steps;
  if (!found) return tell([['', 'Point at the cloud to read values · ? for help']]);
  const names = facts.geographic ? ['Lon', 'Lat'] : ['X', 'Y'];
  const name = facts.classes.find((of) => of.class === found.class)?.name ?? '';
  const list = [[names[0], num(found.x, level)], [names[1], num(found.y, level)],
    ['Height', num(found.z, upright) + ' ' + facts.units[1]], ['Class', (found.class + ' ' + name).trim()]];
  if (found.number > 0) list.push(['Return', found.number + ' of ' + found.returns]);
  if (found.intensity !== null) list.push(['Intensity', String(found.intensity)]);
  if (found.colour) list.push(['Colour', found.colour.join(' ')]);
  if (found.flags.length) list.push(['Flags', found.flags.join(', ')]);
  tell(list);
}

/** Interface of the tools. */
const terrain = {
  level: 'in plan', apart, areaOf,
  get unit() { return facts.units[1]; },
  get step() { return facts.reported_steps[1]; },
  placeOf: ({ x, y, z }) => [x, y, z],
  trace: (a, b) => [a, b],
};

// ---- controls

/** True if the points have the attribute of these colours. */
const isKnown = (colour) => (colour !== 2 || Boolean(scene.intensity)) && (colour !== 4 || Boolean(scene.rgb));

function setColour(colour) {
  if (!isKnown(colour)) return;
  shown.colour = colour;
  for (const button of $('colours').children) press(button, Number(button.dataset.colour) === colour);
  drawLegend();
  drawKinds();
  dirty = true;
}

function setSize(size) {
  shown.size = Math.min(12, Math.max(1, size));
  $('size').value = shown.size;
  $('size-told').textContent = num(shown.size, 0.1) + ' pixels';
  dirty = true;
}

function setControls() {
  for (const button of $('colours').children) {
    const colour = Number(button.dataset.colour);
    button.addEventListener('click', () => setColour(colour));
    if (!isKnown(colour)) button.disabled = true, button.title = 'not an attribute of these points';
  }
  $('shade').addEventListener('click', () => flip('shade'));
  $('everything').addEventListener('click', showEverything);
  $('size').addEventListener('input', (event) => setSize(Number(event.target.value)));
  setTools();
  setCamera();
  showKinds();
}

const KEYS = {
  1: () => setColour(0), 2: () => setColour(1), 3: () => setColour(2), 4: () => setColour(3), 5: () => setColour(4),
  0: showEverything, l: () => flip('shade'), '.': () => setSize(shown.size + 0.5), ',': () => setSize(shown.size - 0.5),
  ...CAMERA_KEYS, ...TOOL_KEYS,
};

function tellFigures() {
  const { bounds } = scene;
  const [level, upright] = facts.reported_steps;
  const span = ([low, high], step) => num(low, step) + ' – ' + num(high, step);
  const { shown: held, of } = facts.points;
  const [width, depth] = [0, 1].map((k) => drawing.top[k] * drawing.scale[k]);
  $('about').textContent = facts.about;
  rows($('figures'), [
    ['Points', of],
    ['In the page', held < of ? count(held) + ' (' + num((held * 100) / of) + ' %)' : 'all'],
    ['Shown', countShown()],
    ['Files', facts.files],
    [facts.geographic ? 'Lon' : 'X', span(bounds.x, level)],
    [facts.geographic ? 'Lat' : 'Y', span(bounds.y, level)],
    ['Heights', span(bounds.z, upright) + ' ' + facts.units[1]],
    ...(width * depth > 0 ? [['Points per m²', num(of / (width * depth))]] : []),
  ]);
  $('notes').textContent = facts.notes.join(' ');
}

function resize() {
  fitView();
  setColour(shown.colour);
  setExaggeration(shown.exaggeration);
  drawHeights(scene.bins, scene.ramp, scene.heights.map(heightOf), 'points');
  if (tool === null) tellPlace(null);
  dirty = true;
}

function how() {
  const ratio = $('view').width / $('view').clientWidth;
  return { ...shown, size: shown.size * ratio, heights: scene.heights, strengths: scene.strengths };
}

/** Interface for scripts. */
window.terrane = {
  facts, shown, names: COLOURS, under, toView: (place) => toView(place), camera: () => camera, places: () => places,
  point: pointOf, points: () => drawing.points, countShown, heights: () => scene.heights.map(heightOf),
  picture: () => pictureOf(drawing, () => drawing.draw(camera, how())),
};

start().catch(fail);
