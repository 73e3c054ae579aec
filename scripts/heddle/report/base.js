// What all parts of the page share: the data, elements, numbers with units and intervals.
const data = JSON.parse(document.getElementById('data').textContent);
const SVG = 'http://www.w3.org/2000/svg';

// An element with attributes and children. Texts are set as texts: nothing that a study says becomes markup.
function make(name, attributes = {}, ...children) {
  return fill(document.createElement(name), attributes, children);
}
function draw(name, attributes = {}, ...children) {
  return fill(document.createElementNS(SVG, name), attributes, children);
}
function fill(element, attributes, children) {
  for (const [key, value] of Object.entries(attributes)) {
    if (key.startsWith('on')) element.addEventListener(key.slice(2), value);
    else if (value !== undefined && value !== null && value !== false) element.setAttribute(key, value === true ? '' : value);
  }
  element.append(...children.flat().filter((each) => each !== null && each !== undefined));
  return element;
}
function into(id, ...children) {
  document.getElementById(id).replaceChildren(...children.flat().filter(Boolean));
}

// ---- Numbers ----

function digits(value, count = 4) {
  if (value === undefined || value === null) return '–';
  if (value === 0) return '0';
  const size = Math.abs(value);
  if (size >= 1e6 || size < 1e-4) return value.toExponential(Math.max(count - 2, 0));
  return String(Number(value.toPrecision(count)));
}
function bytes(value) {
  if (value === undefined) return '–';
  if (value < 1024) return `${value} B`;
  if (value < 1048576) return `${(value / 1024).toFixed(1)} KiB`;
  return `${(value / 1048576).toFixed(2)} MiB`;
}
function withUnit(row) {
  if (!row || row.value === undefined) return row && row.note ? row.note : '–';
  if (row.unit === 'bytes') return bytes(row.value);
  return digits(row.value) + (row.unit && row.unit !== '1' ? ` ${row.unit}` : '');
}
function interval(row) {
  if (!row || row.low === undefined) return '';
  return `(${digits(row.low)} to ${digits(row.high)})`;
}
function percent(logRatio) {
  if (logRatio === undefined) return '–';
  const value = 100 * Math.expm1(logRatio);
  return `${value >= 0 ? '+' : '−'}${digits(Math.abs(value), 3)} %`;
}
// The verdict of a row against the first point, with its difference.
function verdictText(row, isTime) {
  if (!row || !row.verdict) return '';
  if (row.difference === undefined) return row.verdict + (row.note ? ` (${row.note})` : '');
  const spell = isTime ? percent : (value) => (value > 0 ? '+' : '') + digits(value, 3);
  return `${row.verdict}: ${spell(row.difference)} (${spell(row.difference_low)} to ${spell(row.difference_high)}); ` +
    (row.matters === undefined ? '' : `what matters begins at ${spell(row.matters)}, `) +
    `smallest that could be seen ${row.smallest_seen === undefined ? 'none' : spell(row.smallest_seen)}` +
    (row.rounds_needed === undefined ? '' : `; about ${row.rounds_needed} rounds would tell`);
}
const CLOCKS = ['frame', 'processor'];  // their differences are of logarithms

function verdictClass(row) {
  return row && (row.verdict === 'better' || row.verdict === 'worse') ? row.verdict : '';
}

// ---- Points ----

const points = data.points;
points.forEach((point, index) => { point.row = index + 1; });
const variants = [...new Set(points.map((point) => point.variant))];
const COLORS = 8;
const SHAPES = [
  (r) => `M${r},0A${r},${r} 0 1 1 ${-r},0A${r},${r} 0 1 1 ${r},0Z`,
  (r) => `M${-r * 0.9},${-r * 0.9}H${r * 0.9}V${r * 0.9}H${-r * 0.9}Z`,
  (r) => `M0,${-r * 1.25}L${r * 1.1},0L0,${r * 1.25}L${-r * 1.1},0Z`,
  (r) => `M0,${r * 1.1}L${r * 1.15},${-r * 0.9}H${-r * 1.15}Z`,
  (r) => `M0,${-r * 1.1}L${r * 1.15},${r * 0.9}H${-r * 1.15}Z`,
  (r) => `M${-r * 0.4},${-r * 1.2}H${r * 0.4}V${-r * 0.4}H${r * 1.2}V${r * 0.4}H${r * 0.4}V${r * 1.2}H${-r * 0.4}V${r * 0.4}H${-r * 1.2}V${-r * 0.4}H${-r * 0.4}Z`,
  (r) => `M${r * 1.1},0L${-r * 0.9},${r * 1.15}V${-r * 1.15}Z`,
];
const DASHES = ['', '7 3', '2 3', '9 3 2 3'];
// Colour, shape and dash of a variant: no two of the first 56 share both colour and shape.
function look(variant) {
  const n = variants.indexOf(variant);
  return {color: `var(--c${n % COLORS})`, shape: SHAPES[n % SHAPES.length], dash: DASHES[Math.floor(n / COLORS) % DASHES.length]};
}
function mark(variant, radius) {
  const {color, shape} = look(variant);
  return draw('path', {class: 'mark', d: shape(radius), fill: color, stroke: 'var(--back)', 'stroke-width': 0.8});
}
function isHigherBetter(metric) {
  const found = data.metrics.find((each) => each.name === metric);
  return Boolean(found) && found.better === 'higher';
}
function pointsOf(scene) {
  return points.filter((point) => point.scene === scene);
}
function knobText(point) {
  return point.knobs.map(([knob, value]) => `${knob}=${value}`).join(' ');
}

// ---- What is chosen: parts of the page that show it are told ----

const chosen = {scene: 0, point: null};
const listeners = [];
function onChange(listener) {
  listeners.push(listener);
}
function choose(point) {
  const isOther = chosen.scene !== point.scene;
  chosen.point = point;
  chosen.scene = point.scene;
  listeners.forEach((listener) => listener(isOther));
}
function chooseScene(scene) {
  const same = pointsOf(scene).find((point) => chosen.point && point.name === chosen.point.name);
  choose(same || pointsOf(scene)[0]);
}

// ---- Tooltips: for the mouse and for the keyboard alike; the same text is the element's label ----

const tip = document.getElementById('tip');
function tipped(element, text) {
  const show = (event) => {
    tip.textContent = text;
    tip.hidden = false;
    const box = element.getBoundingClientRect();
    const x = event.clientX || box.right, y = event.clientY || box.bottom;
    tip.style.left = `${Math.max(4, Math.min(x + 14, innerWidth - tip.offsetWidth - 8))}px`;
    tip.style.top = `${y + 14 + tip.offsetHeight > innerHeight ? Math.max(4, y - tip.offsetHeight - 12) : y + 14}px`;
  };
  const hide = () => { tip.hidden = true; };
  for (const name of ['mouseenter', 'mousemove', 'focus']) element.addEventListener(name, show);
  for (const name of ['mouseleave', 'blur']) element.addEventListener(name, hide);
  return element;
}
addEventListener('keydown', (event) => { if (event.key === 'Escape') tip.hidden = true; });

function table(caption, heads, rows, attributes = {}) {
  return make('div', {class: 'scroll', tabindex: 0, role: 'group', 'aria-label': caption},
    make('table', attributes, make('caption', {}, caption),
      make('thead', {}, make('tr', {}, heads.map((head) => make('th', {scope: 'col', class: head.n ? 'n' : null}, head.text ?? head)))),
      make('tbody', {}, rows.map((row) => make('tr', {}, row.map((cell, i) =>
        i === 0 ? make('th', {scope: 'row'}, cell) : make('td', {class: heads[i].n ? 'n' : null}, cell)))))));
}
function option(value, text, isChosen) {
  return make('option', {value, selected: isChosen}, text);
}
