// The page of greedy insertion: two growing meshes side by side, and their errors.

const COLOURS = ['#1c6e8c', '#d9822b'];
const HEAT = [[246, 247, 243], [250, 222, 160], [240, 150, 82], [196, 60, 60], [96, 22, 60]];
const shown = { step: 0, playing: false, speed: 1, errors: false, edges: true };
let grid, meshes, runs, tints, shades;
let dirty = true;
let owed = 0;

async function start() {
  setPanel();
  const z = await array('z');
  grid = { width: facts.width, height: facts.height, z: Float64Array.from(z) };
  // Lets the browser show the waiting message.
  await new Promise((go) => setTimeout(go, 30));
  runs = [true, false].map((flips) => history(grid.width, grid.height, grid.z, flips));
  makeTints();
  restart();
  setControls();
  go(60);
  new ResizeObserver(() => { dirty = true; }).observe(document.body);
  $('wait').hidden = true;
  document.body.dataset.state = 'ready';
  requestAnimationFrame(frame);
}

const metre = (steps) => steps * facts.z.step;
const told = (steps) => num(metre(steps), facts.reported_steps[1]) + ' ' + facts.units[1];
const last = () => Math.max(...runs.map((run) => run.largest.length)) - 1;

function restart() {
  meshes = [true, false].map((flips) => new Insertion(grid.width, grid.height, grid.z, flips));
  shown.step = 0;
}

/** Shows both meshes after a number of insertions. */
function go(step) {
  const target = Math.max(0, Math.min(last(), Math.round(step)));
  if (target < shown.step) restart();
  for (; shown.step < target; shown.step++) meshes.forEach((mesh) => mesh.step());
  tellStep();
  dirty = true;
}

// The slider is logarithmic in the number of vertices.
const toSlider = (step) => (1000 * Math.log((step + 4) / 4)) / Math.log((last() + 4) / 4);
const fromSlider = (place) => 4 * ((last() + 4) / 4) ** (place / 1000) - 4;

function tellStep() {
  $('told').textContent = count(shown.step + 4) + ' vertices';
  if (document.activeElement !== $('slider') || shown.playing) $('slider').value = toSlider(shown.step);
  const value = (list) => list[Math.min(shown.step, list.length - 1)];
  const lines = [['Largest error', (i) => told(value(runs[i].largest))], ['RMS error', (i) => told(value(runs[i].rms))],
    ['Triangles', (i) => count(meshes[i].triangles)], ['Flips', (i) => count(meshes[i].flipped)]];
  rows($('figures'), lines.map(([name, of]) => [name, `${of(0)} · ${of(1)}`]));
  [0, 1].forEach((i) => { $('told-' + i).textContent = `largest error ${told(value(runs[i].largest))}`; });
}

/** Number of vertices at which a run meets a maximum error. */
function needed(i, error) {
  const at = runs[i].largest.findIndex((largest) => metre(largest) <= error);
  return at < 0 ? null : at + 4;
}

function tellNeeded() {
  const error = Number($('exact').value);
  const [delaunay, split] = [0, 1].map((i) => needed(i, error));
  rows($('needed'), [['Delaunay', `${count(delaunay)} vertices`], ['Split in three', `${count(split)} vertices`],
    ['Difference', `${num((split / delaunay - 1) * 100, 0.1)} % more`]]);
}

// ---- pictures

function makeTints() {
  const { width, height, z } = grid;
  const sorted = Float64Array.from(z).sort();
  const rank = (value) => {
    let [low, high] = [0, sorted.length];
    while (low < high) { const half = (low + high) >> 1; if (sorted[half] < value) low = half + 1; else high = half; }
    return low / sorted.length;
  };
  const span = sorted[sorted.length - 1] - sorted[0] || 1;
  tints = (value) => between(facts.palette.land, 0.5 * rank(value) + (0.5 * (value - sorted[0])) / span);
  const natural = facts.exaggeration ?? Math.max(1, (0.3 * Math.max(width * facts.cell[0], height * facts.cell[1])) / (metre(span) * facts.ground[2]));
  shades = (a, b, c) => {
    const at = (s) => [(s % width) * facts.cell[0], -Math.floor(s / width) * facts.cell[1], metre(z[s]) * facts.ground[2] * natural];
    const [p, q, r] = [a, b, c].map(at);
    const u = q.map((v, k) => v - p[k]);
    const v = r.map((w, k) => w - p[k]);
    const n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    const size = Math.hypot(...n) * (n[2] < 0 ? -1 : 1) || 1;
    const [azimuth, altitude] = [facts.azimuth, facts.altitude].map((d) => (d * Math.PI) / 180);
    const sun = (n[0] * Math.sin(azimuth) + n[1] * Math.cos(azimuth)) * Math.cos(altitude) + n[2] * Math.sin(altitude);
    return 0.38 + 0.78 * Math.max(0, sun / size);
  };
}

/** Positions of samples on a canvas. */
function layout(width, height) {
  const [w, h] = [(grid.width - 1) * facts.cell[0], (grid.height - 1) * facts.cell[1]];
  const scale = Math.min((width - 8) / w, (height - 12) / h);
  const [left, top] = [(width - w * scale) / 2, (height - h * scale) / 2 + 2];
  return (sample) => [left + (sample % grid.width) * facts.cell[0] * scale, top + Math.floor(sample / grid.width) * facts.cell[1] * scale];
}

function drawMesh(i) {
  const [context, width, height] = plane($('mesh-' + i));
  const mesh = meshes[i];
  const at = layout(width, height);
  if (shown.errors) drawErrors(context, mesh, at);
  context.lineJoin = 'round';
  for (let t = 0; t < mesh.triangles; t++) {
    const [a, b, c] = mesh.corners.subarray(3 * t, 3 * t + 3);
    context.beginPath();
    context.moveTo(...at(a));
    context.lineTo(...at(b));
    context.lineTo(...at(c));
    context.closePath();
    if (!shown.errors) {
      const tint = tints((grid.z[a] + grid.z[b] + grid.z[c]) / 3);
      const shade = shades(a, b, c);
      context.fillStyle = css(tint.map((v) => Math.min(255, v * shade)));
      context.fill();
      context.strokeStyle = context.fillStyle;
      context.lineWidth = 0.6;
      context.stroke();
    }
    if (shown.edges) {
      context.strokeStyle = 'rgba(20,28,44,.5)';
      context.lineWidth = mesh.triangles > 4000 ? 0.3 : 0.7;
      context.stroke();
    }
  }
  mark(context, at(mesh.vertices[mesh.vertices.length - 1]), '#c8322b');
  if (mesh.worst) mark(context, at(mesh.worst.at), 'rgba(255,255,255,.85)');
}

function drawErrors(context, mesh, at) {
  const [x0, y0] = at(0);
  const [x1, y1] = at(grid.width * grid.height - 1);
  const [cw, ch] = [(x1 - x0) / (grid.width - 1), (y1 - y0) / (grid.height - 1)];
  const most = runs[0].largest[0] || 1;
  for (let s = 0; s < mesh.errors.length; s++) {
    context.fillStyle = css(between(HEAT, Math.sqrt(mesh.errors[s] / most)));
    const [x, y] = at(s);
    context.fillRect(Math.max(x0, x - cw / 2), Math.max(y0, y - ch / 2), Math.min(cw, x1 - x + cw / 2) + 0.5, Math.min(ch, y1 - y + ch / 2) + 0.5);
  }
}

function mark(context, [x, y], fill) {
  context.beginPath();
  context.arc(x, y, 4, 0, 7);
  context.fillStyle = fill;
  context.fill();
  context.strokeStyle = '#7a1512';
  context.lineWidth = 1.4;
  context.stroke();
}

function curveLayout(width, height) {
  const most = Math.max(...runs.map((run) => metre(run.largest[0]))) || 1;
  const least = most * 1e-3;
  const room = { left: 46, right: width - 10, top: 6, bottom: height - 18 };
  const share = (step) => Math.log((step + 4) / 4) / Math.log((last() + 4) / 4);
  return {
    room, most, least,
    x: (step) => room.left + share(step) * (room.right - room.left),
    y: (error) => room.bottom - (Math.log(Math.max(least, error) / least) / Math.log(most / least)) * (room.bottom - room.top),
  };
}

function drawCurve() {
  const [context, width, height] = plane($('curve'));
  const { room, most, least, x, y } = curveLayout(width, height);
  context.fillStyle = '#5b6876';
  context.lineWidth = 1;
  for (let power = Math.ceil(Math.log10(least)); power <= Math.log10(most); power++) {
    const value = 10 ** power;
    context.strokeStyle = 'rgba(29,39,51,.12)';
    context.beginPath(); context.moveTo(room.left, y(value)); context.lineTo(room.right, y(value)); context.stroke();
    context.textAlign = 'right';
    context.fillText(num(value), room.left - 6, y(value) + 4);
  }
  context.textAlign = 'center';
  for (let vertices = 4; vertices <= last() + 4; vertices *= 4) {
    context.fillText(count(vertices), Math.min(width - 18, x(vertices - 4)), height - 4);
  }
  runs.forEach((run, i) => {
    for (const [list, dash] of [[run.largest, []], [run.rms, [4, 3]]]) {
      context.beginPath();
      let before = -9;
      list.forEach((error, step) => {
        const px = x(step);
        if (px - before < 0.7 || metre(error) < least) return;
        before = px;
        context.lineTo(px, y(metre(error)));
      });
      context.setLineDash(dash);
      context.strokeStyle = COLOURS[i];
      context.lineWidth = dash.length ? 1.1 : 1.8;
      context.stroke();
    }
    context.setLineDash([]);
    context.textAlign = 'right';
    context.fillStyle = COLOURS[i];
    context.fillText(['Delaunay', 'Split in three'][i], room.right - 4, room.top + 12 + 15 * i);
  });
  context.strokeStyle = '#c8322b';
  context.lineWidth = 1.2;
  context.beginPath(); context.moveTo(x(shown.step), room.top); context.lineTo(x(shown.step), room.bottom); context.stroke();
}

// ---- controls

function play(on) {
  shown.playing = on && shown.step < last();
  press($('play'), shown.playing);
  $('play').textContent = shown.playing ? 'Pause' : 'Play';
}

const aSecond = () => 2 ** (Number($('speed').value) * 1.6);

function flipErrors(on) {
  shown.errors = on;
  press($('errors'), on);
  press($('relief'), !on);
  dirty = true;
}

function setControls() {
  $('play').addEventListener('click', () => play(!shown.playing));
  $('back').addEventListener('click', () => { play(false); go(shown.step - 1); });
  $('next').addEventListener('click', () => { play(false); go(shown.step + 1); });
  $('home').addEventListener('click', () => { play(false); go(0); });
  $('slider').addEventListener('input', (event) => { play(false); go(fromSlider(Number(event.target.value))); });
  $('speed').addEventListener('input', tellSpeed);
  $('errors').addEventListener('click', () => flipErrors(true));
  $('relief').addEventListener('click', () => flipErrors(false));
  $('edges').addEventListener('click', flipEdges);
  $('exact').addEventListener('input', () => {
    const vertices = needed(0, Number($('exact').value));
    tellNeeded();
    if (vertices) { play(false); go(vertices - 4); }
  });
  $('curve').addEventListener('click', (event) => {
    const { room } = curveLayout($('curve').clientWidth, $('curve').clientHeight);
    const share = (event.clientX - $('curve').getBoundingClientRect().left - room.left) / (room.right - room.left);
    play(false);
    go(fromSlider(1000 * share));
  });
  const keys = {
    ' ': () => play(!shown.playing), e: () => flipErrors(!shown.errors), g: flipEdges, r: () => go(0),
    arrowleft: (event) => go(shown.step - (event.shiftKey ? 10 : 1)), arrowright: (event) => go(shown.step + (event.shiftKey ? 10 : 1)),
  };
  window.addEventListener('keydown', (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || event.target.matches('input')) return;
    const key = keys[event.key.toLowerCase()];
    if (key) { event.preventDefault(); key(event); }
  });
  $('about').textContent = facts.about;
  $('notes').textContent = facts.notes.join(' ');
  $('unit').textContent = facts.units[1];
  $('exact').value = Number((metre(runs[0].largest[0]) / 10).toPrecision(2));
  tellNeeded();
  tellSpeed();
}

function flipEdges() {
  shown.edges = !shown.edges;
  press($('edges'), shown.edges);
  dirty = true;
}

function tellSpeed() {
  $('speed-told').textContent = num(aSecond(), 1) + ' per second';
}

let before = 0;
function frame(now) {
  if (shown.playing) {
    owed += (Math.min(100, now - before) / 1000) * aSecond();
    const steps = Math.floor(owed);
    owed -= steps;
    if (steps > 0) go(shown.step + steps);
    if (shown.step >= last()) play(false);
  }
  before = now;
  if (dirty) {
    dirty = false;
    drawMesh(0);
    drawMesh(1);
    drawCurve();
  }
  requestAnimationFrame(frame);
}

/** Interface for scripts. */
window.terrane = { facts, shown, go, play, meshes: () => meshes, runs: () => runs, needed };

start().catch(fail);
