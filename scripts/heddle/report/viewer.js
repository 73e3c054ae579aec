// Two images of one scene, A and B: one beside or over the other, in turn, their difference, FLIP's map; zoom, place, exposure and
// the pixel under the cursor are shared.

const MODES = [
  ['a', 'A'], ['b', 'B'], ['slider', 'Slider'], ['side', 'Side by side'], ['flicker', 'Flicker'], ['difference', 'Difference'],
  ['signed', 'Signed'], ['flip', 'FLIP'],
];
const MAX_FLICKER = 3;  // a second: more can cause seizures (WCAG 2.3.1)
const viewer = {
  mode: 'slider', a: null, b: null, imageA: null, imageB: null, split: 0.5, exposure: 0, gain: 0, zoom: 1, x: 0, y: 0, cursor: null,
  curve: data.is_encoded ? 'as it is' : null, rate: 1, phase: 0, timer: 0, isPaused: matchMedia('(prefers-reduced-motion: reduce)').matches,
};
const keyOf = (choice) => choice === 'reference' ? data.scenes[chosen.scene].reference?.image : choice?.image;
const nameOf = (choice) => choice === 'reference' ? 'the reference' : choice ? choice.name : 'nothing';

// ---- Values to colours ----

const ENCODE = 4096;
const encoding = new Uint8ClampedArray(ENCODE + 1);
for (let i = 0; i <= ENCODE; i++) {  // over the square root, so that dark values have steps enough
  const x = (i / ENCODE) ** 2;
  encoding[i] = Math.round(255 * (x <= 0.0031308 ? 12.92 * x : 1.055 * x ** (1 / 2.4) - 0.055));
}
const encode = (x) => encoding[x <= 0 ? 0 : x >= 1 ? ENCODE : Math.round(Math.sqrt(x) * ENCODE)];
// Narkowicz 2016, "ACES Filmic Tone Mapping Curve"
const filmic = (x) => x <= 0 ? 0 : (x * (2.51 * x + 0.03)) / (x * (2.43 * x + 0.59) + 0.14);
const decode = (v) => v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4;
// Eight of the colours of "magma" (van der Walt and Smith 2015, CC0), for maps from 0 to 1; and blue, grey, orange for signs.
const MAGMA = [[0, 0, 4], [34, 17, 80], [95, 24, 127], [152, 45, 128], [211, 67, 110], [248, 118, 92], [254, 187, 129], [252, 253, 191]];
function ramp(stops, t) {
  const at = Math.min(Math.max(t, 0), 1) * (stops.length - 1), i = Math.min(Math.floor(at), stops.length - 2), f = at - i;
  return stops[i].map((each, c) => Math.round(each + f * (stops[i + 1][c] - each)));
}
const SIGNED = [[86, 180, 233], [0, 90, 160], [40, 40, 40], [190, 90, 0], [255, 190, 60]];

function canvasOf(width, height, paint) {
  const canvas = document.createElement('canvas');
  canvas.width = width;
  canvas.height = height;
  const context = canvas.getContext('2d'), picture_ = context.createImageData(width, height);
  paint(picture_.data);
  context.putImageData(picture_, 0, 0);
  return canvas;
}
function magenta(out, to) {
  out[to] = 255; out[to + 1] = 0; out[to + 2] = 255; out[to + 3] = 255;
}
const curveOf = (image) => viewer.curve || (image.channels >= 3 ? 'sRGB' : 'as it is');

function toned(image) {
  const key = `${image.version} ${viewer.exposure} ${curveOf(image)}`;
  if (image.toned && image.toned.key === key) return image.toned.canvas;
  const {values, channels} = image, scale = 2 ** viewer.exposure, curve = curveOf(image);
  const light = data.is_encoded && curve === 'as it is' && viewer.exposure !== 0;
  const byte = curve === 'sRGB' ? (v) => encode(v * scale) : curve === 'filmic' ? (v) => encode(filmic(v * scale))
    : light ? (v) => encode(decode(Math.min(Math.max(v, 0), 1)) * scale) : (v) => 255 * v * scale;
  const canvas = canvasOf(image.width, image.height, (out) => {
    for (let i = 0, from = 0; i < image.width * image.height; i++, from += channels) {
      const to = 4 * i;
      let isFinite_ = true;
      for (let c = 0; c < channels; c++) if (!Number.isFinite(values[from + c])) isFinite_ = false;
      if (!isFinite_) { magenta(out, to); continue; }
      out[to] = byte(values[from]);
      out[to + 1] = channels === 1 ? out[to] : byte(values[from + 1]);
      out[to + 2] = channels === 1 ? out[to] : channels === 2 ? 0 : byte(values[from + 2]);
      out[to + 3] = 255;
    }
  });
  image.toned = {key, canvas};
  return canvas;
}
// The mean over channels of A - B; NaN where either has no number.
function difference(a, b) {
  const key = `${a.key} ${a.version} ${b.key} ${b.version}`;
  if (viewer.difference && viewer.difference.key === key) return viewer.difference;
  const count = a.width * a.height, channels = Math.min(a.channels, b.channels);
  const mean = new Float32Array(count), signed = new Float32Array(count);
  let largest = 0;
  for (let i = 0; i < count; i++) {
    let sum = 0, size = 0;
    for (let c = 0; c < channels; c++) {
      const d = a.values[i * a.channels + c] - b.values[i * b.channels + c];
      sum += d;
      size += Math.abs(d);
    }
    signed[i] = sum / channels;
    mean[i] = size / channels;
    if (Number.isFinite(mean[i]) && mean[i] > largest) largest = mean[i];
  }
  viewer.difference = {key, mean, signed, largest, canvases: {}};
  return viewer.difference;
}
// White of a map of differences: the largest one, less with gain.
const whiteOf = (found) => (found.largest || 1) * 2 ** -viewer.gain;
function differenceCanvas(a, b, isSigned) {
  const found = difference(a, b), white = whiteOf(found), key = `${isSigned} ${viewer.gain}`;
  if (!found.canvases[key]) {
    const table_ = Array.from({length: 512}, (_, i) => isSigned ? ramp(SIGNED, i / 511) : ramp(MAGMA, i / 511));
    found.canvases = {[key]: canvasOf(a.width, a.height, (out) => {
      for (let i = 0; i < a.width * a.height; i++) {
        const value = isSigned ? 0.5 + 0.5 * found.signed[i] / white : found.mean[i] / white;
        if (!Number.isFinite(value)) { magenta(out, 4 * i); continue; }
        const color = table_[Math.min(Math.max(Math.round(511 * value), 0), 511)];
        out[4 * i] = color[0]; out[4 * i + 1] = color[1]; out[4 * i + 2] = color[2]; out[4 * i + 3] = 255;
      }
    })};
  }
  return found.canvases[key];
}
function flipCanvas(image, isReference) {
  if (!image.flip && !isReference) return null;
  if (!image.flipCanvas) {
    image.flipCanvas = canvasOf(image.width, image.height, (out) => {
      for (let i = 0; i < image.width * image.height; i++) {
        const color = ramp(MAGMA, isReference ? 0 : image.flip[i]);
        out[4 * i] = color[0]; out[4 * i + 1] = color[1]; out[4 * i + 2] = color[2]; out[4 * i + 3] = 255;
      }
    });
  }
  return image.flipCanvas;
}

// ---- Drawing ----

let canvas, readout, tileList, status, rampPlace, sliderInput;

function size() {
  return viewer.imageA || viewer.imageB;
}
function fitZoom() {
  return size() ? canvas.width / (viewer.mode === 'side' ? 2 : 1) / size().width : 1;
}
function scaleOf() {
  return fitZoom() * viewer.zoom;
}
function paneWidth() {
  return viewer.mode === 'side' ? canvas.width / 2 : canvas.width;
}
function keepInside() {
  const image = size(), scale = scaleOf();
  const seenX = paneWidth() / scale, seenY = canvas.height / scale;
  viewer.x = seenX >= image.width ? (image.width - seenX) / 2 : Math.min(Math.max(viewer.x, 0), image.width - seenX);
  viewer.y = seenY >= image.height ? (image.height - seenY) / 2 : Math.min(Math.max(viewer.y, 0), image.height - seenY);
}
function redraw() {
  if (!canvas) return;
  const image = size(), context = canvas.getContext('2d');
  const ratio = Math.min(devicePixelRatio || 1, 2), width = Math.max(canvas.parentElement.clientWidth - 2, 100);
  const aspect = image ? image.height / image.width : 0.5625;
  const height = Math.min(Math.round(width * (viewer.mode === 'side' ? aspect / 2 : aspect)), Math.round(0.8 * innerHeight));
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
  }
  context.setTransform(1, 0, 0, 1, 0, 0);
  context.clearRect(0, 0, canvas.width, canvas.height);
  if (!image) return;
  keepInside();
  const {imageA: a, imageB: b, mode} = viewer, scale = scaleOf();
  const put = (source, left, right, pane = 0) => {
    if (!source || right <= left) return;
    context.save();
    context.beginPath();
    context.rect(left, 0, right - left, canvas.height);
    context.clip();
    context.imageSmoothingEnabled = scale < 1;
    context.setTransform(scale, 0, 0, scale, pane - viewer.x * scale, -viewer.y * scale);
    context.drawImage(source, 0, 0);
    context.restore();
  };
  const w = canvas.width, split = Math.round(viewer.split * w);
  const both = a && b && a.width === b.width && a.height === b.height;
  const isMap = mode === 'difference' || mode === 'signed';
  if (mode === 'a' || (mode === 'flicker' && viewer.phase === 0)) put(a && toned(a), 0, w);
  else if (mode === 'b' || mode === 'flicker') put(b && toned(b), 0, w);
  else if (mode === 'side') {
    put(a && toned(a), 0, w / 2);
    put(b && toned(b), w / 2, w, w / 2);
  } else if (isMap) put(both ? differenceCanvas(a, b, mode === 'signed') : null, 0, w);
  else {
    const left = mode === 'flip' ? a && flipCanvas(a, viewer.a === 'reference') : a && toned(a);
    const right = mode === 'flip' ? b && flipCanvas(b, viewer.b === 'reference') : b && toned(b);
    // FLIP of the reference against itself is 0 everywhere: then A's map has the whole place.
    const at = mode === 'flip' && viewer.b === 'reference' ? w : mode === 'flip' && viewer.a === 'reference' ? 0 : split;
    put(left, 0, at);
    put(right, at, w);
  }
  const line = (x) => {
    context.fillStyle = '#000';
    context.fillRect(x - 1.5 * ratio, 0, 3 * ratio, canvas.height);
    context.fillStyle = '#fff';
    context.fillRect(x - 0.5 * ratio, 0, ratio, canvas.height);
  };
  if (mode === 'slider' || (mode === 'flip' && viewer.a !== 'reference' && viewer.b !== 'reference')) line(split);
  if (mode === 'side') line(w / 2);
  const frame = (x, y, width_, height_, color, pane = 0) => {
    context.lineWidth = 3 * ratio;
    for (const [style, wide] of [['#000', 3.5], [color, 1.5]]) {
      context.strokeStyle = style;
      context.lineWidth = wide * ratio;
      context.strokeRect(pane + (x - viewer.x) * scale, (y - viewer.y) * scale, width_ * scale, height_ * scale);
    }
  };
  const tiles = viewer.showTiles && a ? a.head.tiles || [] : [];
  for (const tile of tiles) frame(tile.x, tile.y, a.head.tile_side, a.head.tile_side, '#fff');
  if (viewer.cursor) {
    for (const pane of mode === 'side' ? [0, w / 2] : [0]) {
      context.save();
      context.beginPath();
      context.rect(pane, 0, paneWidth(), canvas.height);
      context.clip();
      const side = Math.max(1, 7 * ratio / scale);
      frame(viewer.cursor.x - (side - 1) / 2, viewer.cursor.y - (side - 1) / 2, side, side, '#fff', pane);
      context.restore();
    }
  }
  tag(context, ratio, mode, split, w);
  tell();
}
function tag(context, ratio, mode, split, w) {
  const texts = {a: [[`A: ${nameOf(viewer.a)}`, 0]], b: [[`B: ${nameOf(viewer.b)}`, 0]],
    flicker: [[viewer.phase ? `B: ${nameOf(viewer.b)}` : `A: ${nameOf(viewer.a)}`, 0]],
    slider: [[`A: ${nameOf(viewer.a)}`, 0], [`B: ${nameOf(viewer.b)}`, 1]], side: [[`A: ${nameOf(viewer.a)}`, 0], [`B: ${nameOf(viewer.b)}`, 1]],
    difference: [['|A − B|, mean of channels', 0]], signed: [['A − B, mean of channels', 0]],
    flip: viewer.b === 'reference' ? [['FLIP of A against the reference', 0]] : viewer.a === 'reference'
      ? [['FLIP of B against the reference', 0]] : [['FLIP of A', 0], ['FLIP of B', 1]]}[mode];
  context.font = `${12 * ratio}px system-ui, "DejaVu Sans", sans-serif`;
  for (const [full, isRight] of texts) {
    const most = (texts.length > 1 ? w / 2 : w) - 20 * ratio;
    let text = full;
    while (text.length > 4 && context.measureText(text).width > most) text = text.slice(0, -2) + '…';
    const wide = context.measureText(text).width + 12 * ratio;
    const x = isRight ? w - wide - 4 * ratio : 4 * ratio;
    context.fillStyle = 'rgba(0, 0, 0, 0.72)';
    context.fillRect(x, 4 * ratio, wide, 20 * ratio);
    context.fillStyle = '#fff';
    context.fillText(text, x + 6 * ratio, 18 * ratio);
  }
}

// ---- What is said ----

function valuesAt(image, x, y) {
  return image ? Array.from({length: image.channels}, (_, c) => image.values[(y * image.width + x) * image.channels + c]) : null;
}
function numbers(values) {
  return values.map((v) => Number.isFinite(v) ? digits(v, 6) : String(v)).join('  ');
}
function tell() {
  const {cursor, imageA: a, imageB: b} = viewer;
  if (!cursor || !a) { readout.textContent = 'Point at the image, or move the cursor with the arrow keys, for the values of a pixel.'; return; }
  const {x, y} = cursor;
  const about = (image) => image.known(x, y) ? '' : `   (mean of ${image.scale} x ${image.scale} pixels${data.level.mantissa === null || data.level.mantissa === 10 ? '' : `, rounded to ${data.level.mantissa} bits`})`;
  const lines = [`pixel ${x}, ${y} of ${a.width} x ${a.height}`];
  const va = valuesAt(a, x, y), vb = valuesAt(b, x, y);
  lines.push(`A      ${numbers(va)}${about(a)}`);
  if (vb) lines.push(`B      ${numbers(vb)}${about(b)}`, `A − B  ${numbers(va.map((v, c) => v - vb[c]))}`);
  const flips = [['A', viewer.a, a], ['B', viewer.b, b]].filter(([, choice, image]) => image && image.flip && choice !== 'reference')
    .map(([name, , image]) => `${name} ${digits(image.flip[y * image.width + x], 3)}`);
  if (flips.length) lines.push(`FLIP   ${flips.join('   ')}`);
  readout.textContent = lines.join('\n');
}
function say(text) {
  status.textContent = text;
}
function showRamp() {
  const {mode} = viewer;
  rampPlace.replaceChildren();
  if (!['difference', 'signed', 'flip'].includes(mode) || !viewer.imageA) return;
  const isSigned = mode === 'signed';
  let low = '0', high = '1';
  if (mode !== 'flip' && viewer.imageB) {
    const white = whiteOf(difference(viewer.imageA, viewer.imageB));
    high = digits(white, 3);
    low = isSigned ? `−${high}` : '0';
  }
  const bar = canvasOf(256, 1, (out) => {
    for (let i = 0; i < 256; i++) out.set([...ramp(isSigned ? SIGNED : MAGMA, i / 255), 255], 4 * i);
  });
  const head = viewer.imageA.head.flip;
  const note = mode === 'flip' && head ? head.why_none ? `no map: ${head.why_none}`
    : `${head.name}, mean ${digits(head.value, 4)}; ${head.formula}` : '';
  rampPlace.append(low, bar, high + (mode === 'flip' ? '' : ' and more; magenta: no number'), note ? `  ${note}` : '');
}

// ---- Choices ----

async function show() {
  const keys = [keyOf(viewer.a), keyOf(viewer.b)];
  const ticket = viewer.ticket = {};
  const found = await Promise.all(keys.map((key, i) => key ? picture(key).catch((error) => { say(error.message); return null; })
    : (say(`the study keeps no image of ${nameOf(i ? viewer.b : viewer.a)}`), null)));
  if (viewer.ticket !== ticket) return;  // another was chosen meanwhile
  [viewer.imageA, viewer.imageB] = found;
  if (found[0] && found[1]) {
    for (const [image, other, choice] of [[found[0], found[1], viewer.b], [found[1], found[0], viewer.a]]) {
      if (choice === 'reference') await pasteReference(image, other);
    }
    if (viewer.ticket !== ticket) return;
  }
  if (found[0]) {
    const lost = found[0].head.not_finite;
    say(`A is ${nameOf(viewer.a)}, B is ${nameOf(viewer.b)}` + (lost ? `; ${lost} pixels of A are no numbers (magenta)` : ''));
  }
  showTiles();
  showRamp();
  redraw();
}
function setMode(mode) {
  viewer.mode = mode;
  for (const button of document.querySelectorAll('#viewer [data-mode]')) {
    button.setAttribute('aria-pressed', button.dataset.mode === mode ? 'true' : 'false');
  }
  document.getElementById('split-label').hidden = !(mode === 'slider' || mode === 'flip');
  document.getElementById('flicker-bar').hidden = mode !== 'flicker';
  const isMap = mode === 'difference' || mode === 'signed';
  document.getElementById('gain-label').hidden = !isMap;
  document.getElementById('exposure-label').hidden = isMap || mode === 'flip';
  clearInterval(viewer.timer);
  viewer.phase = 0;
  if (mode === 'flicker') startFlicker();
  showRamp();
  redraw();
}
function startFlicker() {
  clearInterval(viewer.timer);
  const button = document.getElementById('flicker-pause');
  button.textContent = viewer.isPaused ? 'Go on' : 'Pause';
  if (!viewer.isPaused) viewer.timer = setInterval(flick, 1000 / (2 * Math.min(viewer.rate, MAX_FLICKER)));
}
function flick() {
  viewer.phase = 1 - viewer.phase;
  redraw();
}
function setSplit(value) {
  viewer.split = Math.min(Math.max(value, 0), 1);
  sliderInput.value = String(Math.round(100 * viewer.split));
  redraw();
}
function zoomAt(factor, px, py) {
  if (!size()) return;
  const before = scaleOf();
  viewer.zoom = Math.min(Math.max(viewer.zoom * factor, 1), 64);
  const after = scaleOf();
  viewer.x += px / before - px / after;
  viewer.y += py / before - py / after;
  redraw();
}
function zoomMiddle(factor) {
  zoomAt(factor, paneWidth() / 2, canvas.height / 2);
}
function fitView() {
  viewer.zoom = 1;
  redraw();
}
function lookAt(x, y, side) {
  viewer.zoom = Math.min(Math.max(Math.min(paneWidth(), canvas.height) / (3 * side) / fitZoom(), 1), 64);
  const scale = scaleOf();
  viewer.x = x + side / 2 - paneWidth() / scale / 2;
  viewer.y = y + side / 2 - canvas.height / scale / 2;
  viewer.cursor = {x: Math.min(x + Math.floor(side / 2), size().width - 1), y: Math.min(y + Math.floor(side / 2), size().height - 1)};
  redraw();
}
function moveCursor(dx, dy) {
  const image = size();
  if (!image) return;
  const from = viewer.cursor || {x: Math.floor(image.width / 2), y: Math.floor(image.height / 2)};
  viewer.cursor = {x: Math.min(Math.max(from.x + dx, 0), image.width - 1), y: Math.min(Math.max(from.y + dy, 0), image.height - 1)};
  const scale = scaleOf(), seenX = paneWidth() / scale, seenY = canvas.height / scale;
  if (viewer.cursor.x < viewer.x) viewer.x = viewer.cursor.x;
  if (viewer.cursor.y < viewer.y) viewer.y = viewer.cursor.y;
  if (viewer.cursor.x + 1 > viewer.x + seenX) viewer.x = viewer.cursor.x + 1 - seenX;
  if (viewer.cursor.y + 1 > viewer.y + seenY) viewer.y = viewer.cursor.y + 1 - seenY;
  redraw();
  clearTimeout(viewer.speaks);  // said when the cursor rests, not at every step
  viewer.speaks = setTimeout(() => { status.textContent = readout.textContent; }, 400);
}
let nextTile = 0;
function jumpTile(number) {
  const tiles = viewer.imageA?.head.tiles || [];
  if (!tiles.length) return;
  nextTile = number % tiles.length;
  const tile = tiles[nextTile];
  lookAt(tile.x, tile.y, viewer.imageA.head.tile_side);
  say(`worst tile ${nextTile + 1} of ${tiles.length}: mean ${data.metrics[0].name} map ${digits(tile.error)} at ${tile.x}, ${tile.y}`);
  nextTile++;
}
function showTiles() {
  const image = viewer.imageA, tiles = image?.head.tiles || [];
  nextTile = 0;
  const side = image ? image.head.tile_side : 0;
  tileList.replaceChildren(...tiles.map((tile, n) => {
    const crops = [image, viewer.b === 'reference' ? viewer.imageB : null].filter(Boolean).map((from) => {
      const small = make('canvas', {width: side, height: side, 'aria-hidden': 'true'});
      small.getContext('2d').drawImage(toned(from), -tile.x, -tile.y);
      return small;
    });
    return make('li', {}, make('button', {type: 'button', 'data-tile': n, onclick: () => { jumpTile(n); canvas.focus(); canvas.scrollIntoView({block: 'nearest'}); },
      'aria-label': `Worst tile ${n + 1}: mean error ${digits(tile.error)} at ${tile.x}, ${tile.y}`},
    make('span', {class: 'pair'}, crops), `${n + 1}:  ${digits(tile.error, 3)}`));
  }));
  document.getElementById('tiles-head').hidden = !tiles.length;
}
function swap() {
  [viewer.a, viewer.b] = [viewer.b, viewer.a];
  syncChoices();
  show();
}
function syncChoices() {
  for (const which of ['a', 'b']) {
    const choice = viewer[which];
    document.getElementById(`choose-${which}`).value = choice === 'reference' ? 'reference' : String(choice ? choice.row : '');
  }
}
async function loadWhole() {
  const keys = [keyOf(viewer.a), keyOf(viewer.b)].filter(Boolean);
  try {
    for (const key of keys) await makeWhole(key);
    say('whole images, to the bit, from the files beside this page');
  } catch (error) {
    say(error.message);
  }
  viewer.difference = null;
  showTiles();
  redraw();
}

function buildViewer() {
  const choices = (which) => make('label', {}, which.toUpperCase(), make('select', {id: `choose-${which}`, onchange: (event) => {
    const value = event.target.value;
    viewer[which] = value === 'reference' ? 'reference' : points[Number(value) - 1];
    if (which === 'a' && value !== 'reference') choose(viewer.a);
    else show();
  }}));
  const number = (id, text, low, high, step, value, set) => make('label', {id: `${id}-label`}, text, make('input',
    {type: 'range', id, min: low, max: high, step, value, oninput: (event) => {
      set(Number(event.target.value));
      document.getElementById(`${id}-value`).textContent = `${Number(event.target.value)} stops`;
      showRamp();
      redraw();
    }}), make('output', {id: `${id}-value`, for: id}, `${value} stops`));
  canvas = make('canvas', {id: 'canvas', tabindex: 0, role: 'application', 'aria-roledescription': 'image comparison',
    'aria-label': 'Images A and B. Arrow keys move the pixel cursor, with Shift ten pixels; keys are listed below the image.',
    'aria-describedby': 'keys'});
  readout = make('div', {class: 'readout', id: 'readout'});
  status = make('div', {role: 'status', id: 'viewer-status', class: 'note'});
  tileList = make('ul', {class: 'tiles', 'aria-label': 'Worst tiles of A'});
  rampPlace = make('span', {class: 'ramp', id: 'ramp'});
  sliderInput = make('input', {type: 'range', id: 'split', min: 0, max: 100, step: 1, value: 50,
    oninput: (event) => setSplit(Number(event.target.value) / 100)});
  into('viewer',
    make('div', {class: 'bar'}, choices('a'), choices('b'),
      make('button', {type: 'button', onclick: swap}, 'Swap'),
      data.level.scale > 1 ? make('button', {type: 'button', id: 'whole', onclick: loadWhole}, 'Whole images') : null),
    make('div', {class: 'bar', role: 'group', 'aria-label': 'How A and B are shown'}, MODES.map(([mode, text]) =>
      make('button', {type: 'button', 'data-mode': mode, 'aria-pressed': 'false', onclick: () => setMode(mode)}, text))),
    make('div', {class: 'bar'},
      make('label', {id: 'split-label'}, 'Split', sliderInput),
      make('span', {id: 'flicker-bar', class: 'bar', style: 'margin: 0'},
        make('button', {type: 'button', id: 'flicker-pause', onclick: () => { viewer.isPaused = !viewer.isPaused; startFlicker(); }}, 'Pause'),
        make('button', {type: 'button', id: 'flicker-step', onclick: flick}, 'A / B'),
        make('label', {}, 'Rate', make('select', {id: 'rate', onchange: (event) => { viewer.rate = Number(event.target.value); startFlicker(); }},
          [0.5, 1, 2, 3].map((rate) => option(rate, `${rate} / s`, rate === viewer.rate))))),
      number('exposure', 'Exposure', -12, 12, 0.5, 0, (v) => { viewer.exposure = v; }),
      number('gain', 'Gain', -4, 12, 0.5, 0, (v) => { viewer.gain = v; }),
      make('label', {}, 'Curve', make('select', {id: 'curve', onchange: (event) => { viewer.curve = event.target.value || null; redraw(); showTiles(); }},
        [['', 'by type'], ['sRGB', 'sRGB'], ['filmic', 'filmic, then sRGB'], ['as it is', 'none: 1 is white']].map(([v, t]) => option(v, t, v === (viewer.curve || ''))))),
      make('button', {type: 'button', 'aria-label': 'Zoom in', onclick: () => zoomMiddle(1.5)}, '+'),
      make('button', {type: 'button', 'aria-label': 'Zoom out', onclick: () => zoomMiddle(1 / 1.5)}, '−'),
      make('button', {type: 'button', onclick: fitView}, 'Fit'), rampPlace),
    make('div', {class: 'stage'}, canvas), readout, status,
    make('div', {id: 'tiles-head'},
      make('h3', {}, 'Worst tiles of A'),
      make('p', {class: 'note'}, `By the mean of their map of ${data.metrics[0].name} against the reference; left A, right the reference. `,
        make('label', {}, make('input', {type: 'checkbox', id: 'frames', onchange: (event) => { viewer.showTiles = event.target.checked; redraw(); }}), ' frames in the image')),
      tileList),
    make('details', {}, make('summary', {}, 'Keys'), make('p', {id: 'keys', class: 'note'},
      ...['1–8', ' the ways to show A and B; ', '←↑↓→', ' the pixel cursor, with ', 'Shift', ' ten pixels; ', '+', ' ', '−', ' zoom, ', '0', ' fit; ',
        '[', ' ', ']', ' the split; ', 'F', ' flicker, ', 'Space', ' the other image; ', 'E', ' ', 'D', ' exposure or gain up and down; ',
        'X', ' swap; ', 'N', ' ', 'P', ' next and previous point; ', 'W', ' next worst tile; ', 'L', ' whole images. With the mouse: drag moves, the wheel with ',
        'Ctrl', ' zooms, and with the image focused the wheel alone.']
        .map((each, i) => i % 2 === 0 ? make('kbd', {}, each) : each))),
    make('p', {class: 'note'}, levelText()));
  listen();
  setMode(viewer.mode);
}
function levelText() {
  const {scale, mantissa} = data.level;
  if (scale === 1) return 'Images are in this page whole, with all their bits; pixels that are no numbers are magenta.';
  const part = scale === 2 ? 'at half their width and height' : `at 1/${scale} of their width and height`;
  return `So that the page stays small, images are in it ${part}` + (mantissa < 10 ? `, their values rounded to ${mantissa + 1} significant bits` : '') +
    '; the worst tiles are whole. "Whole images" reads them from the folder images/ beside this page. Pixels that are no numbers are magenta.';
}

function listen() {
  let drag = null;
  const at = (event) => {
    const box = canvas.getBoundingClientRect();
    return {x: (event.clientX - box.left) * canvas.width / box.width, y: (event.clientY - box.top) * canvas.height / box.height};
  };
  const point = (place) => {
    const image = size();
    if (!image) return;
    const pane = paneWidth(), scale = scaleOf();
    const x = Math.floor((viewer.mode === 'side' && place.x >= pane ? place.x - pane : place.x) / scale + viewer.x), y = Math.floor(place.y / scale + viewer.y);
    viewer.cursor = x >= 0 && y >= 0 && x < image.width && y < image.height ? {x, y} : null;
  };
  canvas.addEventListener('pointerdown', (event) => {
    const place = at(event), near = 14 * canvas.width / canvas.clientWidth;
    const isSplit = viewer.mode === 'slider' && Math.abs(place.x - viewer.split * canvas.width) < near;
    drag = {place, x: viewer.x, y: viewer.y, isSplit};
    canvas.setPointerCapture(event.pointerId);
  });
  canvas.addEventListener('pointermove', (event) => {
    const place = at(event);
    if (drag && drag.isSplit) { setSplit(place.x / canvas.width); return; }
    if (drag) {
      viewer.x = drag.x - (place.x - drag.place.x) / scaleOf();
      viewer.y = drag.y - (place.y - drag.place.y) / scaleOf();
    }
    point(place);
    redraw();
  });
  for (const name of ['pointerup', 'pointercancel']) canvas.addEventListener(name, () => { drag = null; });
  canvas.addEventListener('wheel', (event) => {
    if (!event.ctrlKey && document.activeElement !== canvas) return;  // else the page scrolls
    event.preventDefault();
    const place = at(event), pane = paneWidth();
    zoomAt(2 ** (-event.deltaY / 240), place.x >= pane ? place.x - pane : place.x, place.y);
  }, {passive: false});
  const stops = (id, step) => {
    const input = document.getElementById(id);
    input.value = String(Number(input.value) + step);
    input.dispatchEvent(new Event('input'));
  };
  const neighbour = (step) => {
    const own = pointsOf(chosen.scene).filter((each) => each.image);
    if (own.length) choose(own[(own.indexOf(viewer.a) + step + own.length) % own.length]);
  };
  canvas.addEventListener('keydown', (event) => {
    if (event.altKey || event.metaKey || event.ctrlKey) return;
    const far = event.shiftKey ? 10 : 1, isMap = viewer.mode === 'difference' || viewer.mode === 'signed';
    const actions = {
      ArrowLeft: () => moveCursor(-far, 0), ArrowRight: () => moveCursor(far, 0), ArrowUp: () => moveCursor(0, -far), ArrowDown: () => moveCursor(0, far),
      '+': () => zoomMiddle(1.5), '=': () => zoomMiddle(1.5), '-': () => zoomMiddle(1 / 1.5), 0: fitView,
      '[': () => setSplit(viewer.split - 0.02), ']': () => setSplit(viewer.split + 0.02),
      f: () => setMode('flicker'), ' ': () => { if (viewer.mode !== 'flicker') setMode('flicker'); viewer.isPaused = true; startFlicker(); flick(); },
      e: () => stops(isMap ? 'gain' : 'exposure', 0.5), d: () => stops(isMap ? 'gain' : 'exposure', -0.5),
      x: swap, n: () => neighbour(1), p: () => neighbour(-1), w: () => jumpTile(nextTile), l: loadWhole,
    };
    MODES.forEach(([mode], i) => { actions[i + 1] = () => setMode(mode); });
    const action = actions[event.key] || actions[event.key.toLowerCase()];
    if (action) {
      event.preventDefault();
      action();
    }
  });
  new ResizeObserver(() => redraw()).observe(canvas.parentElement);
}

onChange((isOtherScene) => {
  if (!canvas) buildViewer();
  const scene = data.scenes[chosen.scene];
  if (isOtherScene || !document.getElementById('choose-a').options.length) {
    for (const which of ['a', 'b']) {
      document.getElementById(`choose-${which}`).replaceChildren(
        ...pointsOf(chosen.scene).map((point) => option(String(point.row), point.name + (point.image ? '' : ' (no image)'))),
        ...(scene.reference ? [option('reference', 'the reference')] : []));
    }
    viewer.b = null;
    viewer.zoom = 1;
    viewer.cursor = null;
  }
  viewer.a = chosen.point;
  if (!viewer.b) viewer.b = scene.reference ? 'reference' : pointsOf(chosen.scene)[0];
  syncChoices();
  show();
});
