// Shared code of all pages: facts, packed arrays, numbers as text, the panel.

const $ = (id) => document.getElementById(id);
const facts = JSON.parse($('facts').textContent);

/** Decodes base64 in parts, without a copy of the whole text. */
function bytesOf(text) {
  const part = 1 << 20; // a multiple of 4
  const end = text.endsWith('==') ? 2 : text.endsWith('=') ? 1 : 0;
  const out = new Uint8Array((text.length / 4) * 3 - end);
  let at = 0;
  for (let from = 0; from < text.length; from += part) {
    const binary = atob(text.slice(from, from + part));
    for (let i = 0; i < binary.length; i++) out[at++] = binary.charCodeAt(i);
  }
  return out;
}

/** Decodes an array: inflates it, joins its byte planes, and reverts zigzag and differences. */
async function array(name) {
  const block = $('array-' + name);
  const { count, differences } = facts.arrays[name];
  const packed = new Blob([bytesOf(block.textContent)]);
  block.remove();
  const stream = packed.stream().pipeThrough(new DecompressionStream('deflate'));
  const planes = new Uint8Array(await new Response(stream).arrayBuffer());
  if (planes.length !== 4 * count) throw new Error('array ' + name + ' is damaged');
  const out = new Uint32Array(count);
  let before = 0;
  for (let i = 0; i < count; i++) {
    const word = planes[i] | (planes[count + i] << 8) | (planes[2 * count + i] << 16) | (planes[3 * count + i] << 24);
    const value = (word >>> 1) ^ -(word & 1);
    before = differences ? (before + value) | 0 : value;
    out[i] = before;
  }
  return out;
}

const has = (name) => name in facts.arrays;

/** A number with the decimals that `step` requires. */
function num(value, step = 0) {
  if (!Number.isFinite(value)) return '–';
  const digits = step > 0 ? Math.min(8, Math.max(0, Math.ceil(-Math.log10(step) - 1e-9))) : undefined;
  const most = digits ?? (Math.abs(value) >= 1000 ? 0 : Math.abs(value) >= 10 ? 1 : Math.abs(value) >= 1 ? 2 : 4);
  return value.toLocaleString('en', { minimumFractionDigits: digits ?? 0, maximumFractionDigits: most });
}

const count = (value) => value.toLocaleString('en');

function element(tag, text, parent) {
  const made = document.createElement(tag);
  if (text !== undefined) made.textContent = text;
  if (parent) parent.append(made);
  return made;
}

/** Fills a table with rows of names and values. */
function rows(table, list) {
  table.replaceChildren();
  for (const [name, value] of list) {
    const row = element('tr', undefined, table);
    element('td', name, row);
    element('td', typeof value === 'number' ? count(value) : value, row);
  }
}

/** Shows names and values in the status line. */
function tell(list) {
  $('status').replaceChildren();
  for (const [name, value] of list) {
    const one = element('span', name + ' ', $('status'));
    element('b', value, one);
  }
}

const metres = (value) => (value >= 10000 ? num(value / 1000, 0.01) + ' km' : num(value, value < 100 ? 0.01 : 0.1) + ' m');

function press(button, on) {
  button.setAttribute('aria-pressed', String(Boolean(on)));
}

const pressed = (button) => button.getAttribute('aria-pressed') === 'true';

/** Clears a canvas and fits its size to device pixels; its context uses CSS pixels. */
function plane(canvas) {
  const ratio = Math.min(window.devicePixelRatio || 1, 2);
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
  }
  // Without acceleration: Chromium may show the last accelerated frame late, until another follows.
  const context = canvas.getContext('2d', { willReadFrequently: true });
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, width, height);
  context.font = '11px system-ui, sans-serif';
  return [context, width, height];
}

/** Calls `resize` when the window or a canvas of the panel changes its size; in a folded panel it is 0. */
function whenResized(resize) {
  const observer = new ResizeObserver(resize);
  for (const one of [document.body, ...document.querySelectorAll('#panel canvas')]) observer.observe(one);
}

/** About `about` round numbers from `low` to `high`. */
function ticks(low, high, about) {
  const rough = (high - low) / Math.max(1, about);
  if (!(rough > 0)) return [low];
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((k) => k * power).find((k) => k >= rough) ?? 10 * power;
  const out = [];
  for (let i = Math.ceil(low / step - 1e-9); i * step <= high + step * 1e-9; i++) out.push(i * step || 0);
  return out;
}

/** Draws 256 colours and their scale into the legend. */
function drawRamp(colours, low, high, unit, told = num) {
  const [context, width] = plane($('legend'));
  for (let i = 0; i < width; i++) {
    context.fillStyle = css(colours[Math.min(255, Math.floor((i / width) * 256))]);
    context.fillRect(i, 2, 1.5, 14);
  }
  context.fillStyle = '#5b6876';
  const marks = ticks(low, high, 3);
  const step = marks.length > 1 ? marks[1] - marks[0] : 0;
  for (const mark of marks) {
    const at = ((mark - low) / (high - low || 1)) * width;
    context.fillRect(Math.min(width - 1, at), 16, 1, 4);
    const text = told(mark, step) + (mark === marks[marks.length - 1] ? unit : '');
    const wide = context.measureText(text).width;
    context.fillText(text, Math.max(0, Math.min(width - wide, at - wide / 2)), 32);
  }
}

/** A colour between stops ([r, g, b], 0 to 255), at 0 to 1. */
function between(stops, at) {
  const place = Math.min(1, Math.max(0, at)) * (stops.length - 1);
  const i = Math.min(stops.length - 2, Math.floor(place));
  const t = place - i;
  return stops[i].map((from, k) => from + (stops[i + 1][k] - from) * t);
}

const css = ([r, g, b], alpha = 1) => `rgba(${Math.round(r)},${Math.round(g)},${Math.round(b)},${alpha})`;

/** A shader program and its uniform locations. */
function linked(gl, vertex, fragment) {
  const program = gl.createProgram();
  for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
    gl.attachShader(program, shader);
  }
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
  const at = {};
  for (let i = 0; i < gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS); i++) {
    const { name } = gl.getActiveUniform(program, i);
    at[name] = gl.getUniformLocation(program, name);
  }
  return { program, at };
}

/** Uploads 256 colours ([r, g, b], 0 to 255) to a texture. */
function ramp(gl, texture, unit, colours) {
  const bytes = new Uint8Array(4 * 256);
  colours.forEach((colour, i) => bytes.set([...colour.map(Math.round), 255], 4 * i));
  gl.activeTexture(gl.TEXTURE0 + unit);
  gl.bindTexture(gl.TEXTURE_2D, texture);
  gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, 256, 1, 0, gl.RGBA, gl.UNSIGNED_BYTE, bytes);
  for (const [key, value] of [[gl.TEXTURE_MIN_FILTER, gl.LINEAR], [gl.TEXTURE_MAG_FILTER, gl.LINEAR],
    [gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE], [gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE]]) {
    gl.texParameteri(gl.TEXTURE_2D, key, value);
  }
}

/** Shows an error in the middle of the page. */
function fail(error) {
  const wait = $('wait');
  wait.hidden = false;
  wait.textContent = 'Cannot show this page: ' + (error?.message ?? error);
  document.body.dataset.state = 'failed';
}

function setPanel() {
  const toggle = $('fold');
  toggle.addEventListener('click', () => {
    const closed = $('panel').classList.toggle('closed');
    toggle.textContent = closed ? '☰' : '–';
    toggle.setAttribute('aria-expanded', String(!closed));
  });
  if (window.innerWidth < 720 && document.body.className !== 'insertion') toggle.click();
  const help = $('help');
  const flip = (open = help.hidden) => { help.hidden = !open; };
  $('ask').addEventListener('click', () => flip());
  $('done').addEventListener('click', () => flip(false));
  window.addEventListener('keydown', (event) => {
    if (event.target.matches('input[type="number"]')) return;
    if (event.key === '?' || (event.key === 'h' && !event.ctrlKey && !event.metaKey)) flip();
    if (event.key === 'Escape') flip(false);
  });
}
