// Measuring and sections, for pages of surfaces and tiles; clouds have measuring only. A position is three numbers: two
// horizontal coordinates and a height. Each page defines its own `terrain`:
//   columns, level    names of the three numbers; label of horizontal lengths
//   unit, step        unit and rounding step of heights
//   placeOf(found)    position of a result of `under`
//   apart(a, b)       { level, space, up, rise }: horizontal and 3D distance of two positions in metres, the height
//                     difference in its unit, and in metres
//   between(a, b, s)  position at a share of a straight line
//   trace(a, b)       positions along a measured line, to draw it
//   section(a, b)     { pieces, note }: pieces of the surface along a line as [[share, position], [share, position]], by share
//   areaOf(places)    area of a polygon as text, if supported

const TOOLS = ['measure', 'section'].filter($);
let tool = null;
let places = [];
let profile = null;

const TOOL_KEYS = {
  m: () => choose('measure'), p: () => choose('section'),
  backspace: () => { if (tool === 'measure') { places.pop(); tellMeasure(); } },
  escape: () => { if (tool !== null) choose(tool); },
};

function setTools() {
  for (const name of TOOLS) $(name).addEventListener('click', () => choose(name));
  if (!$('sheet')) return;
  $('shut').addEventListener('click', () => choose(null));
  $('save').addEventListener('click', saveProfile);
  $('profile').addEventListener('pointermove', followProfile);
}

function choose(next) {
  if (next !== null && !TOOLS.includes(next)) return;
  tool = tool === next ? null : next;
  places = [];
  profile = null;
  $('sheet')?.toggleAttribute('hidden', true);
  for (const name of TOOLS) press($(name), tool === name);
  $('view').classList.toggle('pick', tool !== null);
  if (tool === 'measure') tellMeasure();
  else if (tool === 'section') tell([['Section', 'click the first end']]);
  else tellPlace(null);
  dirty = true;
}

function clicked(px, py) {
  const found = under(px, py);
  if (!found) return;
  if (tool === null) return tellPlace(found);
  if (tool === 'section' && places.length === 2) places = [];
  places.push(terrain.placeOf(found));
  if (tool === 'measure') tellMeasure();
  else if (places.length === 2) makeProfile();
  else { profile = null; tell([['Section', 'click the other end']]); }
  dirty = true;
}

const tellHeight = (height) => num(height, terrain.step) + ' ' + terrain.unit;

function tellMeasure() {
  const pairs = places.slice(1).map((place, i) => terrain.apart(places[i], place));
  if (pairs.length === 0) return tell([['Measure', places.length ? 'click the next point' : 'click points on the terrain']]);
  const sum = (key) => pairs.reduce((all, pair) => all + pair[key], 0);
  const list = [['Length ' + terrain.level, metres(sum('level'))], ['in space', metres(sum('space'))],
    ['Height', (sum('up') >= 0 ? '+' : '') + tellHeight(sum('up'))]];
  const last = pairs[pairs.length - 1];
  list.push(['Grade of the last', num((last.rise * 100) / last.level, 0.1) + ' %']);
  if (places.length > 2 && terrain.areaOf) list.push(['Area ' + terrain.level, terrain.areaOf(places)]);
  tell(list);
}

// ---- overlay

function drawOver() {
  const [context] = plane($('over'));
  context.lineWidth = 2.5;
  context.lineJoin = 'round';
  context.strokeStyle = '#c8553d';
  const lines = profile ? profile.pieces.map((piece) => piece.map(([, place]) => place))
    : places.slice(1).map((place, i) => terrain.trace(places[i], place));
  context.beginPath();
  for (const line of lines) {
    let before = null;
    for (const at of line.map((place) => toView(place))) {
      if (at && before) context.lineTo(...at);
      else if (at) context.moveTo(...at);
      before = at;
    }
  }
  context.stroke();
  const dots = profile ? [profile.from, profile.to, profile.mark] : places;
  for (const at of dots.map((place) => place && toView(place))) if (at) dotAt(context, at);
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

function profileOf(from, to) {
  const { pieces, note } = terrain.section(from, to);
  const covered = pieces.reduce((sum, [a, b]) => sum + b[0] - a[0], 0);
  return { from, to, pieces, note, covered, line: pieces.flat(), length: terrain.apart(from, to).level };
}

function makeProfile() {
  profile = profileOf(...places);
  $('sheet').hidden = false;
  tell([['Section', 'point at the profile to read it; click for another section']]);
  drawProfile();
  dirty = true;
}

/** Updates the section of a changed surface, unless it covers less of the line. */
function renewProfile() {
  const now = profileOf(profile.from, profile.to);
  if (now.covered < profile.covered - 1e-6) return;
  profile = now;
  drawProfile();
}

function drawProfile(mark) {
  const [context, width, height] = plane($('profile'));
  const { pieces, line, length, note } = profile;
  if (line.length === 0) { $('profile-told').textContent = 'No surface along this line'; return; }
  const [low, high] = line.reduce(([least, most], [, [, , z]]) => [Math.min(least, z), Math.max(most, z)], [Infinity, -Infinity]);
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
  const lengths = ticks(0, length, 6);
  for (const at of lengths) context.fillText(num(at, lengths[1] || 1), px(at / length), height - 4);
  for (const fill of [true, false]) {
    context.beginPath();
    let end = -1;
    for (const [a, b] of pieces) {
      if (Math.abs(a[0] - end) > 1e-9) {
        if (fill && end >= 0) context.lineTo(px(end), room.bottom);
        context.moveTo(px(a[0]), fill ? room.bottom : py(a[1][2]));
        context.lineTo(px(a[0]), py(a[1][2]));
      }
      context.lineTo(px(b[0]), py(b[1][2]));
      end = b[0];
    }
    if (fill) { context.lineTo(px(end), room.bottom); context.fillStyle = 'rgba(28,110,140,.16)'; context.fill(); }
    else { context.strokeStyle = '#1c6e8c'; context.lineWidth = 1.8; context.stroke(); }
  }
  if (mark) { context.lineWidth = 2.5; dotAt(context, [px(mark), py(profile.mark[2])]); }
  const told = mark ? `${metres(mark * length)}: ${tellHeight(profile.mark[2])}`
    : `${metres(length)} long, ${num(low, terrain.step)} to ${tellHeight(high)}`;
  $('profile-told').textContent = 'Section: ' + told + (note ? ', ' + note : '');
}

function followProfile(event) {
  const width = $('profile').clientWidth - 58;
  const share = (event.clientX - $('profile').getBoundingClientRect().left - 50) / width;
  const piece = profile.pieces.find(([a, b]) => share >= a[0] && share <= b[0] && a[0] < b[0]);
  profile.mark = null;
  if (piece) {
    const [a, b] = piece;
    profile.mark = terrain.between(a[1], b[1], (share - a[0]) / (b[0] - a[0]));
    drawProfile(share);
  } else drawProfile();
  dirty = true;
}

function saveProfile() {
  const lines = profile.line.map(([share, place]) => [share * profile.length, ...place].join(','));
  const link = element('a');
  link.href = URL.createObjectURL(new Blob([`distance_m,${terrain.columns}\n${lines.join('\n')}\n`], { type: 'text/csv' }));
  link.download = 'section.csv';
  link.click();
  URL.revokeObjectURL(link.href);
}
