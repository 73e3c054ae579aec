// The table of all points, what made their numbers, the machine, and the page's own controls.

const sorting = {key: null, isDown: false};

function showPoints() {
  const had = document.activeElement && document.activeElement.closest('#points') && document.activeElement.dataset.sort;
  const metricNames = data.metrics.map((each) => each.name);
  const passName = data.study.pass_name ? `pass ${data.study.pass_name}` : null;
  const quantities = [...CLOCKS, ...(passName ? [passName] : []), ...metricNames];
  const columns = [
    {head: 'Row', key: 'row', value: (point) => point.row, n: 1}, {head: 'Point', key: 'point', value: (point) => point.name},
    ...quantities.map((quantity) => ({head: quantity === 'frame' ? 'Frame [ms]' : quantity === 'processor' ? 'Processors [ms]' : quantity.startsWith('pass ') ? `${quantity} [ms]` : metricHead(quantity), key: quantity, n: 1,
      value: (point) => point.rows[quantity]?.value ?? NaN})),
    {head: 'Memory', key: 'memory', n: 1, value: (point) => memoryOf(point)},
  ];
  const rows = pointsOf(chosen.scene);
  if (sorting.key) {
    const by = columns.find((column) => column.key === sorting.key);
    rows.sort((a, b) => {
      const x = by.value(a), y = by.value(b);
      if (Number.isNaN(x) || Number.isNaN(y)) return Number.isNaN(x) - Number.isNaN(y);  // what has no number comes last
      return (x < y ? -1 : x > y ? 1 : 0) * (sorting.isDown ? -1 : 1);
    });
  }
  const head = columns.map((column) => make('th', {scope: 'col', class: column.n ? 'n' : null,
    'aria-sort': sorting.key === column.key ? (sorting.isDown ? 'descending' : 'ascending') : 'none'},
  make('button', {type: 'button', 'data-sort': column.key, onclick: () => {
    sorting.isDown = sorting.key === column.key && !sorting.isDown;
    sorting.key = column.key;
    showPoints();
  }}, column.head + (sorting.key === column.key ? (sorting.isDown ? ' ▼' : ' ▲') : ''))));
  const body = rows.map((point) => {
    const cells = quantities.map((quantity) => {
      const row = point.rows[quantity];
      const parts = [row && row.value === undefined ? row.note || '–' : digits(row?.value)];
      if (row && row.low !== undefined) parts.push(make('br'), make('span', {class: 'range'}, `${digits(row.low, 3)} to ${digits(row.high, 3)}`));
      if (row && row.verdict) {
        parts.push(make('br'), tipped(make('span', {class: `range ${verdictClass(row)}`},
          `${{better: '✓ ', worse: '✗ '}[row.verdict] || ''}${row.verdict}`), verdictText(row, CLOCKS.includes(quantity))));
      }
      if (row && row.dominated_by) parts.push(make('br'), make('span', {class: 'range worse'}, `beaten by ${row.dominated_by}`));
      if (row && row.is_on_front) parts.push(make('br'), make('span', {class: 'range'}, '★ on the front'));
      return make('td', {class: 'n'}, parts);
    });
    const pick = make('button', {type: 'button', 'aria-pressed': chosen.point === point ? 'true' : 'false', 'data-pick': point.row,
      onclick: (event) => { event.stopPropagation(); choose(point); document.querySelector(`[data-pick="${point.row}"]`)?.focus(); }}, point.name);
    return make('tr', {class: `pick${chosen.point === point ? ' chosen' : ''}`, onclick: () => choose(point)},
      make('td', {class: 'n'}, String(point.row)),
      make('th', {scope: 'row'}, draw('svg', {width: 14, height: 14, viewBox: '-7 -7 14 14', style: 'display: inline-block; vertical-align: middle', 'aria-hidden': 'true'}, mark(point.variant, 5)), ' ', pick),
      point.state === 'ok' ? cells : make('td', {colspan: quantities.length}, `${point.state}: ${point.note}`),
      make('td', {class: 'n'}, bytes(memoryOf(point))));
  });
  into('points', make('div', {class: 'scroll', tabindex: 0, role: 'group', 'aria-label': 'All points, a table'},
    make('table', {}, make('caption', {}, `Scene ${data.scenes[chosen.scene].scene}. Verdicts are against ${baselineName()}: better, worse, no difference seen, or undecided. ` +
      'Choose a point to see its image, passes, graph and what made its numbers.'),
    make('thead', {}, make('tr', {}, head)), make('tbody', {}, body))),
  make('p', {class: 'note'}, '★ no other point beats it in both frame time and the first error. Rows keep their number over all scenes: heddle reproduce takes it.'));
  if (had) document.querySelector(`#points [data-sort="${CSS.escape(had)}"]`)?.focus();
}
function metricHead(name) {
  const unit = data.metrics.find((each) => each.name === name)?.unit;
  return unit ? `${name} [${unit}]` : name;
}
function memoryOf(point) {
  if (typeof point.frame_graph !== 'number') return undefined;
  const {heap_bytes, own_bytes} = data.graphs[point.frame_graph].memory;
  return heap_bytes + own_bytes;
}
function baselineName() {
  return points[0].name;
}

function showMade() {
  const point = chosen.point, scene = data.scenes[point.scene];
  const file = decodeURIComponent(location.pathname.split('/').pop() || 'report.html');
  const command = `heddle reproduce ${/^[\w.-]+$/.test(file) ? file : `'${file}'`} ${point.row}`;
  const image = point.image && data.images[point.image];
  const facts = [
    ['Again', make('code', {id: 'reproduce'}, command)],
    ['Point', `${point.name} (row ${point.row})`], ['Graph', point.graph], ['Settings', make('code', {}, point.settings.map((each) => `--set '${each}'`).join(' '))],
    ['Scene', `${scene.file}${scene.camera ? `, camera '${scene.camera}'` : ''}, time ${scene.time} s${scene.arguments.map(([name, value]) => `, ${name} ${value}`).join('')}${scene.overlays.length ? `, overlays ${scene.overlays.join(', ')}` : ''}`],
    ['Image', image ? `${data.study.port}, seed 0, after ${data.study.settle} frame${data.study.settle === 1 ? '' : 's'} from a cut; ${image.width} x ${image.height} x ${image.channels}, ${image.file}` : 'none was kept'],
    ['SHA-256 of the image', image ? make('code', {}, image.sha256) : '–'],
    ['Compared with', scene.reference ? `${scene.reference.graph}, ${scene.reference.settings.join(' ')}: the mean of ${scene.reference.parts} renderings with seeds of their own, at most` : 'nothing'],
    ['Study', make('code', {}, data.command || '–')],
  ];
  const device = data.interned[point.device];
  if (device) facts.push(['Device', deviceText(device)]);
  const changed = Object.entries(point.rows);
  into('made', make('dl', {class: 'facts'}, facts.flatMap(([name, value]) => [make('dt', {}, name), make('dd', {}, value)])),
    make('details', {}, make('summary', {}, `Every number of ${point.name}, and what made it`),
      table(`${point.name}, ${scene.scene}`, ['Quantity', {text: 'Value', n: 1}, {text: 'Interval', n: 1}, {text: 'Confidence', n: 1}, {text: 'Samples', n: 1}, 'Formula', 'Verdict or note'],
        changed.map(([quantity, row]) => [quantity, withUnit(row), interval(row), row.confidence === undefined ? '' : `${digits(100 * row.confidence, 4)} %`, row.samples ? String(row.samples) : '',
          row.formula === undefined ? (quantity.startsWith('memory') || quantity.startsWith('count') ? 'counted by the host in one frame' : '') : data.formulas[row.formula],
          verdictText(row, CLOCKS.includes(quantity)) || row.note || '']))),
    make('details', {}, make('summary', {}, `Files that the study was made of (${Object.keys(data.files).length})`),
      table('SHA-256, first 16 digits', ['File', 'Contents'], Object.entries(data.files).map(([name, hash]) => [name, make('code', {}, hash)]))));
}
function deviceText(device) {
  if (typeof device === 'string') return device;
  return Object.entries(device).filter(([, value]) => ['string', 'number'].includes(typeof value)).map(([key, value]) => `${key.replaceAll('_', ' ')}: ${value}`).join('; ');
}

function showMachine() {
  const {machine, versions, study} = data;
  const devices = [...new Set(points.map((point) => point.device).filter((each) => typeof each === 'number').map((each) => deviceText(data.interned[each] || 'unknown')))];
  const warnings = data.scenes.flatMap((scene) => scene.restless.map((text) => `${scene.scene}: ${text}`));
  const floor = points.map((point) => point.rows['frame noise floor']).filter(Boolean);
  into('machine', make('dl', {class: 'facts'}, [
    ['Processor', `${machine.processor || 'unknown'}, ${machine.processors} logical processors`], ['System', machine.system],
    ['Device and driver', devices.join(' / ') || 'unknown'],
    ['Versions', Object.entries(versions).map(([name, value]) => `${name} ${value}`).join(', ')], ['Command', make('code', {}, data.command || '–')],
    ['Rounds', `${study.rounds} rounds of ${study.frames} frame${study.frames === 1 ? '' : 's'} twice; all points take turns in each, there and back, and nothing else runs`],
    ['Noise floor', floor.length ? floor.map((row) => percent(Math.abs(row.value))).join(', ') + ': by what the first point differed from itself in another process, by scene' : 'unknown'],
    ['Verdicts', `false "better" or "worse" of equal variants: at most ${digits(100 * data.false_verdicts)} %; the smallest difference that could be seen would be with ${digits(100 * data.power)} %; ` +
      `what matters: ${digits(100 * study.resolution)} % of time, ${digits(100 * study.error_resolution)} % of the first point's error; better and worse are certain and as much, no difference seen is certainly less`],
    ['Written', data.written],
  ].flatMap(([name, value]) => [make('dt', {}, name), make('dd', {}, value)])),
  warnings.length ? [make('h3', {}, 'What speaks against the machine'), ...warnings.map((text) => make('p', {class: 'warning'}, text))] : make('p', {class: 'note'}, 'Nothing was seen that speaks against the machine.'));
}

// ---- The page ----

function setTheme(theme) {
  const dark = matchMedia('(prefers-color-scheme: dark)').matches;
  document.documentElement.dataset.theme = theme === 'auto' ? (dark ? 'dark' : 'light') : theme;
  for (const button of document.querySelectorAll('[data-theme-choice]')) {
    button.setAttribute('aria-pressed', button.dataset.themeChoice === theme ? 'true' : 'false');
  }
  try { localStorage.setItem('heddle-theme', theme); } catch { /* a page from disk may have no storage */ }
}
function storedTheme() {
  try { return localStorage.getItem('heddle-theme') || 'auto'; } catch { return 'auto'; }
}
let theme = storedTheme();
if (!['auto', 'light', 'dark'].includes(theme)) theme = 'auto';
into('bar',
  data.scenes.length > 1 ? make('label', {}, 'Scene', make('select', {id: 'scene', onchange: (event) => chooseScene(Number(event.target.value))},
    data.scenes.map((scene, i) => option(String(i), scene.scene, i === 0)))) : make('span', {class: 'dim'}, `Scene ${data.scenes[0]?.scene ?? ''}`),
  make('span', {class: 'bar', role: 'group', 'aria-label': 'Colours', style: 'margin: 0'}, [['auto', 'As the system'], ['light', 'Light'], ['dark', 'Dark']].map(([value, text]) =>
    make('button', {type: 'button', 'data-theme-choice': value, onclick: () => { theme = value; setTheme(value); }}, text))));
setTheme(theme);
matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => setTheme(theme));
onChange(() => {
  const select = document.getElementById('scene');
  if (select) select.value = String(chosen.scene);
});
onChange(showPoints);
onChange(showMade);
showMachine();
let lastWidth = innerWidth;
addEventListener('resize', () => {
  if (innerWidth === lastWidth) return;
  lastWidth = innerWidth;
  showChart();
  showPasses();
  showMemory();
});
// Charts and tables are painted before the first image is unpacked.
if (points.length) {
  const begin = points.find((point) => Object.values(point.rows).some((row) => row.is_on_front) && point.scene === 0 && point !== points[0]) ||
    points.find((point) => point.state === 'ok') || points[0];
  choose(begin);
}
