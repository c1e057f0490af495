// The page of lines: methods, threshold, view.

const shown = { method: 0, threshold: 0, original: true, dots: false };
let filter, drawing, view;
let result = { kept: 0, places: 0 };
let dirty = true;
let took = 0;

async function start() {
  setPanel();
  const names = ['x', 'y', 'parts', ...facts.methods.map((method) => method[2])];
  const [x, y, parts, ...bits] = await Promise.all(names.map(array));
  filter = new LinesFilter(x, y, parts, bits.map((own) => new Float32Array(own.buffer)));
  drawing = new LinesDrawing($('view'), filter);
  const top = (codes) => codes.reduce((most, code) => Math.max(most, code), 0);
  view = { top: [top(x), top(y)], ground: ['x', 'y'].map((name, k) => facts[name].step * facts.ground[k]) };
  setControls();
  fit();
  resize();
  choose(0, filter.thresholdFor(0, Math.round(facts.vertices * 0.1)));
  whenResized(resize);
  $('wait').hidden = true;
  document.body.dataset.state = 'ready';
  requestAnimationFrame(frame);
}

// ---- view: centre and pixels per metre

function room() {
  const canvas = $('view');
  const left = canvas.clientWidth > 720 ? 296 : 0;
  return { left, width: canvas.clientWidth - left, height: canvas.clientHeight };
}

/** Extent of nearly all vertices, without remote islands. */
function middleOf() {
  const ends = ['x', 'y'].map((name) => {
    const some = filter[name].filter((_, i) => i % Math.ceil(filter.x.length / 1e5) === 0).sort();
    const [low, high] = [0.01, 0.99].map((share) => some[Math.floor((some.length - 1) * share)]);
    const [first, last] = [some[0], some[some.length - 1]];
    // If the full extent is not much larger, it is shown.
    return last - first < 2 * (high - low) ? [first, last] : [low, high];
  });
  return [ends.map(([low]) => low), ends.map(([, high]) => high)];
}

function fit() {
  const { left, width, height } = room();
  const [low, high] = middleOf();
  const sides = low.map((code, k) => Math.max((high[k] - code) * view.ground[k], 1e-9));
  view.pixels = Math.min((width * 0.92) / sides[0], (height * 0.88) / sides[1]);
  view.middle = low.map((code, k) => (code + high[k]) / 2);
  view.middle[0] -= left / 2 / view.pixels / view.ground[0];
  view.widest = view.pixels;
  dirty = true;
}

/** Codes at a CSS pixel. */
function codesAt(px, py) {
  const canvas = $('view');
  return [view.middle[0] + (px - canvas.clientWidth / 2) / view.pixels / view.ground[0],
    view.middle[1] - (py - canvas.clientHeight / 2) / view.pixels / view.ground[1]];
}

function zoom(factor, px, py) {
  const before = codesAt(px, py);
  view.pixels = Math.min(view.widest * 1e5, Math.max(view.widest * 0.2, view.pixels / factor));
  const after = codesAt(px, py);
  view.middle = view.middle.map((v, k) => v + before[k] - after[k]);
  dirty = true;
}

function tellPlace(px, py) {
  if (Number.isNaN(px)) return tell([['', 'Drag to move, wheel to zoom · ? for help']]);
  const codes = codesAt(px, py);
  const names = facts.geographic ? ['Lon', 'Lat'] : ['X', 'Y'];
  const step = facts.geographic ? 1e-5 : 10 ** Math.floor(Math.log10(1 / view.pixels));
  tell(codes.map((code, k) => [names[k], num(facts['xy'[k]].low + code * facts['xy'[k]].step, step)]));
}

// ---- the threshold

/** Filters at a threshold and measures the time. */
function choose(method, threshold) {
  const before = performance.now();
  Object.assign(shown, { method, threshold });
  result = filter.filter(method, threshold);
  drawing.take(filter.out, result.places);
  took = performance.now() - before;
  tellKept();
  dirty = true;
}

const unitOf = (method) => (facts.methods[method][1] === 'area' && facts.unit ? facts.unit + '²' : facts.unit);

function tellKept() {
  const { method, threshold } = shown;
  const share = result.kept / facts.vertices;
  $('kept').textContent = count(result.kept);
  $('share').textContent = `of ${count(facts.vertices)} vertices: ${num(share * 100, share < 0.01 ? 0.001 : 0.1)} %`;
  $('bar').style.width = share * 100 + '%';
  $('unit').textContent = unitOf(method);
  $('bounded').textContent = facts.methods[method][1] === 'area' ? 'Area threshold' : 'Tolerance';
  if (document.activeElement !== $('exact')) $('exact').value = Number(threshold.toPrecision(5));
  if (document.activeElement !== $('slider') || sliderAt(method) !== threshold) $('slider').value = placeOf(method, threshold);
  [...$('methods').children].forEach((button, i) => press(button, i === method));
  rows($('figures'), [['Features', facts.features], ['Lines and rings', filter.parts.length], ['Vertices', facts.vertices],
    ['Kept', result.kept], ['Removed', facts.vertices - result.kept], ['Filter time', num(took, 0.1) + ' ms']]);
  drawCurve();
}

/** The slider: 0 for no simplification, then a logarithmic scale from the lowest threshold to the highest. */
function sliderAt(method) {
  const place = Number($('slider').value);
  const [low, high] = filter.range(method);
  return place === 0 || high === 0 ? 0 : low * (high / low) ** ((place - 1) / 999);
}

function placeOf(method, threshold) {
  const [low, high] = filter.range(method);
  if (threshold < low || high === low) return threshold < high ? 0 : 1000;
  return Math.min(1000, 1 + Math.round((999 * Math.log(threshold / low)) / Math.log(high / low)));
}

/** The other method with the same number of vertices, for comparison. */
function setMethod(method) {
  choose(method, filter.thresholdFor(method, result.kept));
}

function drawCurve() {
  const [context, width, height] = plane($('histogram'));
  const { method, threshold } = shown;
  const [low, high] = filter.range(method);
  const bottom = height - 14;
  const at = (t) => (high > low ? (Math.log(t / low) / Math.log(high / low)) * width : 0);
  context.beginPath();
  context.moveTo(0, bottom);
  for (let px = 0; px <= width; px += 2) {
    const share = filter.count(method, low * (high / low || 1) ** (px / width)) / facts.vertices;
    context.lineTo(px, bottom - share * (bottom - 4));
  }
  context.lineTo(width, bottom);
  context.fillStyle = 'rgba(28,110,140,.2)';
  context.fill();
  context.strokeStyle = '#c8553d';
  context.lineWidth = 1.5;
  context.beginPath();
  const mark = threshold > 0 ? Math.min(width - 1, Math.max(1, at(threshold))) : 1;
  context.moveTo(mark, 2);
  context.lineTo(mark, bottom);
  context.stroke();
  context.fillStyle = '#5b6876';
  context.fillText(short(low), 0, height - 2);
  const text = short(high) + ' ' + unitOf(method);
  context.fillText(text, width - context.measureText(text).width, height - 2);
}

const short = (value) => (value >= 1e6 || (value < 1e-3 && value > 0) ? value.toExponential(1) : num(value));

// ---- controls

function step(by) {
  $('slider').value = Number($('slider').value) + by;
  choose(shown.method, sliderAt(shown.method));
}

function setControls() {
  facts.methods.forEach(([name], i) => {
    const button = element('button', name, $('methods'));
    button.addEventListener('click', () => setMethod(i));
  });
  $('slider').addEventListener('input', () => choose(shown.method, sliderAt(shown.method)));
  $('exact').addEventListener('input', () => {
    const value = Number($('exact').value);
    if ($('exact').value !== '' && value >= 0) choose(shown.method, value);
  });
  $('original').addEventListener('click', () => flip('original'));
  $('dots').addEventListener('click', () => flip('dots'));
  $('home').addEventListener('click', fit);
  gestures($('view'), {
    drag: (dx, dy) => {
      view.middle[0] -= dx / view.pixels / view.ground[0];
      view.middle[1] += dy / view.pixels / view.ground[1];
      dirty = true;
    },
    zoom, twist: () => {}, hover: tellPlace, click: tellPlace,
  });
  const keys = {
    m: () => setMethod(1 - shown.method), o: () => flip('original'), v: () => flip('dots'), r: fit,
    '+': () => zoom(0.8, ...centre()), '=': () => zoom(0.8, ...centre()), '-': () => zoom(1.25, ...centre()),
    arrowleft: () => step(-5), arrowright: () => step(5),
  };
  window.addEventListener('keydown', (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || event.target.matches('input')) return;
    keys[event.key.toLowerCase()]?.();
  });
  $('about').textContent = facts.about;
  $('notes').textContent = facts.notes.join(' ');
  tellPlace(NaN);
}

function centre() {
  const { left, width, height } = room();
  return [left + width / 2, height / 2];
}

function resize() {
  const canvas = $('view');
  const ratio = Math.min(window.devicePixelRatio || 1, 2);
  canvas.width = Math.max(1, Math.round(canvas.clientWidth * ratio));
  canvas.height = Math.max(1, Math.round(canvas.clientHeight * ratio));
  drawCurve();
  dirty = true;
}

function draw() {
  const canvas = $('view');
  const ratio = canvas.width / canvas.clientWidth;
  const scale = [2 / canvas.clientWidth, 2 / canvas.clientHeight].map((s, k) => s * view.pixels * view.ground[k]);
  drawing.draw({ middle: view.middle, scale }, { ...shown, thick: 1.8 * ratio });
}

function frame() {
  if (dirty) {
    dirty = false;
    draw();
  }
  requestAnimationFrame(frame);
}

/** Interface for scripts. */
window.terrane = {
  facts, shown, choose, result: () => ({ ...result, took }), count: (method, threshold) => filter.count(method, threshold),
  range: (method) => filter.range(method), view: () => view,
  picture: () => {
    const { gl, canvas } = drawing;
    draw();
    const bytes = new Uint8Array(4 * canvas.width * canvas.height);
    gl.readPixels(0, 0, canvas.width, canvas.height, gl.RGBA, gl.UNSIGNED_BYTE, bytes);
    return { width: canvas.width, height: canvas.height, bytes };
  },
};

start().catch(fail);
