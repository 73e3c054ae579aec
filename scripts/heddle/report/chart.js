// Error against time: points with intervals on both axes, logarithmic, a line a ladder, and the points that no other one beats.

const chart = {time: 'frame', metric: data.metrics[0].name, hidden: new Set()};

// Where an error goes on its axis: lower is nearer to the reference, whatever the metric.
// ssim, best at 1, is shown as 1 - ssim; psnr is a logarithm already, and its axis points down.
function errorAxis(metric) {
  if (metric === 'ssim') return {label: '1 − ssim', isLog: true, value: (row) => flipped(row, (v) => 1 - v)};
  if (isHigherBetter(metric)) return {label: `${metric} [dB]`, isLog: false, isDown: true, value: (row) => row};
  const unit = data.metrics.find((each) => each.name === metric)?.unit, suffix = unit ? ` [${unit}]` : '';
  if (metric === 'mean_difference') return {label: `|${metric}|${suffix}`, isLog: true, value: (row) => ({...row, value: Math.abs(row.value),
    low: row.low * row.high <= 0 ? 0 : Math.min(Math.abs(row.low), Math.abs(row.high)),
    high: Math.max(Math.abs(row.low), Math.abs(row.high))})};
  return {label: metric + suffix, isLog: true, value: (row) => row};
}
function flipped(row, f) {
  return {...row, value: f(row.value), low: f(row.high), high: f(row.low)};
}

function front(places) {
  return places.filter((a) => !places.some((b) => b !== a && b.x.value <= a.x.value && b.rank <= a.rank &&
    (b.x.value !== a.x.value || b.rank !== a.rank)));
}

function ticks(low, high, isLog) {
  if (!isLog) {
    const step = 10 ** Math.floor(Math.log10((high - low) / 3 || 1));
    const wide = [1, 2, 5, 10].map((each) => each * step).find((each) => (high - low) / each <= 6);
    const found = [];
    for (let value = Math.ceil(low / wide) * wide; value <= high; value += wide) found.push(Number(value.toPrecision(12)));
    return found;
  }
  const decades = Math.log10(high / low);
  const parts = decades > 3 ? [1] : decades > 1.2 ? [1, 2, 5] : decades > 0.45 ? [1, 1.5, 2, 3, 4, 5, 7] : null;
  if (!parts) return ticks(low, high, false);
  const found = [];
  for (let power = Math.floor(Math.log10(low)); power <= Math.log10(high); power++) {
    for (const part of parts) {
      const value = part * 10 ** power;
      if (value >= low && value <= high) found.push(Number(value.toPrecision(6)));
    }
  }
  return found;
}

// Limits of an axis with room about the values, which are few: intervals count too.
function limits(rows, isLog) {
  const values = rows.flatMap((row) => [row.value, row.low ?? row.value, row.high ?? row.value]).filter((v) => isLog ? v > 0 : true);
  let low = Math.min(...values), high = Math.max(...values);
  if (isLog) {
    // An interval that reaches almost to 0 must not push all points into a corner.
    low = Math.max(low, Math.min(...rows.map((row) => row.value).filter((v) => v > 0)) / 10);
    const room = Math.max((high / low) ** 0.07, 1.04);
    return [low / room, high * room];
  }
  const room = Math.max(0.07 * (high - low), 1e-6 * Math.abs(high), 1e-12);
  return [low - room, high + room];
}

function drawChart() {
  const axis = errorAxis(chart.metric);
  const isNarrow = document.getElementById('chart').clientWidth < 560;
  const width = isNarrow ? 420 : 1000, height = isNarrow ? 400 : 460;
  const left = isNarrow ? 62 : 78, right = 18, top = 14, zero = 34, bottom = 46;
  const shown = pointsOf(chosen.scene).filter((point) => !chart.hidden.has(point.variant));
  const places = [], without = [];
  for (const point of shown) {
    const x = point.rows[chart.time], error = point.rows[chart.metric];
    if (!x || !(x.value > 0) || !error) { without.push(point); continue; }
    // Equal images have an error of 0, or an infinite psnr: no place on the axis, but one below it.
    const y = error.value === undefined ? null : axis.value(error);
    const isZero = y === null ? /equal images/.test(error.note || '') : axis.isLog && y.value <= 0;
    if (y === null && !isZero) { without.push(point); continue; }
    places.push({point, x, y, isZero, rank: isZero ? -Infinity : axis.isDown ? -y.value : y.value});
  }
  if (!places.length) {
    return make('p', {class: 'note'}, 'No point of this scene has both a time and an error: the table below says why.');
  }
  const positive = places.filter((each) => !each.isZero), hasZero = places.some((each) => each.isZero);
  const [xLow, xHigh] = limits(places.map((each) => each.x), true);
  const [yLow, yHigh] = positive.length ? limits(positive.map((each) => each.y), axis.isLog) : [0.1, 1];
  const floor = height - bottom - (hasZero ? zero : 0);
  const toX = (v) => left + (width - left - right) * Math.log(v / xLow) / Math.log(xHigh / xLow);
  const part = (v) => axis.isLog ? Math.log(Math.max(v, yLow) / yLow) / Math.log(yHigh / yLow) : (v - yLow) / (yHigh - yLow);
  const toY = (v) => axis.isDown ? top + (floor - top) * part(v) : floor - (floor - top) * part(v);
  const placeY = (each) => each.isZero ? height - bottom - zero / 2 + 4 : toY(each.y.value);
  const svg = draw('svg', {viewBox: `0 0 ${width} ${height}`, role: 'group',
    'aria-label': `Error against time, scene ${data.scenes[chosen.scene].scene}: ${places.length} points; arrow keys move from point ` +
      'to point in order of time, Enter shows the image. The table "All points" has the same numbers.'});
  for (const value of ticks(xLow, xHigh, true)) {
    svg.append(draw('path', {class: 'grid', d: `M${toX(value)},${top}V${height - bottom}`}),
      draw('text', {x: toX(value), y: height - bottom + 17, 'text-anchor': 'middle', class: 'dim'}, digits(value, 3)));
  }
  for (const value of ticks(yLow, yHigh, axis.isLog)) {
    svg.append(draw('path', {class: 'grid', d: `M${left},${toY(value)}H${width - right}`}),
      draw('text', {x: left - 7, y: toY(value) + 4, 'text-anchor': 'end', class: 'dim'}, digits(value, 3)));
  }
  if (hasZero) {
    svg.append(draw('path', {class: 'axis', d: `M${left},${floor}H${width - right}`, 'stroke-dasharray': '2 3'}),
      draw('text', {x: left - 7, y: height - bottom - zero / 2 + 8, 'text-anchor': 'end', class: 'dim'}, axis.isDown ? 'equal' : '0'));
  }
  svg.append(draw('path', {class: 'axis', d: `M${left},${top}V${height - bottom}H${width - right}`}),
    draw('text', {x: (left + width - right) / 2, y: height - 8, 'text-anchor': 'middle'}, timeLabel(chart.time)),
    draw('text', {x: 15, y: (top + floor) / 2, 'text-anchor': 'middle', transform: `rotate(-90 15 ${(top + floor) / 2})`},
      `${axis.label} of ${data.study.port}${isNarrow ? '' : ', lower is nearer to the reference'}`));

  // The points that no other beats, as steps: what is to the upper right of them can be had cheaper or better.
  const best = front(places).sort((a, b) => a.x.value - b.x.value);
  if (best.length > 1) {
    let d = `M${toX(best[0].x.value)},${placeY(best[0])}`;
    for (const each of best.slice(1)) d += `H${toX(each.x.value)}V${placeY(each)}`;
    svg.append(draw('path', {d, fill: 'none', stroke: 'var(--strong)', 'stroke-width': 5, 'stroke-opacity': 0.3, 'aria-hidden': 'true'}));
  }
  for (const variant of variants) {
    const own = places.filter((each) => each.point.variant === variant);
    if (own.length < 2) continue;
    svg.append(draw('path', {d: 'M' + own.map((each) => `${toX(each.x.value)},${placeY(each)}`).join('L'), fill: 'none',
      stroke: look(variant).color, 'stroke-width': 1.4, 'stroke-dasharray': look(variant).dash, 'stroke-opacity': 0.75}));
  }
  const inOrder = [...places].sort((a, b) => a.x.value - b.x.value);
  const taken = places.map((each) => ({x: toX(each.x.value) - 8, y: placeY(each) - 8, w: 16, h: 16}));
  inOrder.forEach((each, i) => {
    const {point, x, y} = each, cx = toX(x.value), cy = placeY(each), color = look(point.variant).color;
    const isBest = best.includes(each);
    const group = draw('g', {class: `point${chosen.point === point ? ' chosen' : ''}`, role: 'button', 'data-row': point.row,
      tabindex: (chosen.point && inOrder.some((one) => one.point === chosen.point) ? chosen.point === point : i === 0) ? 0 : -1,
      'aria-label': pointText(point, isBest), 'aria-pressed': chosen.point === point ? 'true' : 'false'});
    const bars = [];
    if (x.low !== undefined) bars.push(`M${toX(Math.max(x.low, xLow))},${cy}H${toX(x.high)}`);
    if (!each.isZero && y.low !== undefined) bars.push(`M${cx},${toY(y.low)}V${toY(y.high)}`);
    group.append(draw('path', {d: bars.join(''), stroke: color, 'stroke-width': 1.6, fill: 'none'}),
      draw('circle', {class: 'ring', cx, cy, r: 11}));
    const symbol = mark(point.variant, 5.5);
    symbol.setAttribute('transform', `translate(${cx},${cy})`);
    group.append(symbol);
    const label = point.knobs.map(([, value]) => value).join(', ');
    // To the upper right, or in another corner where that is taken.
    const w = 7 * label.length;
    const box = [[11, -19], [11, 7], [-11 - w, -19], [-11 - w, 7]].map(([dx, dy]) => ({x: cx + dx, y: cy + dy, w, h: 12}))
      .find((b) => b.x > left && b.x + b.w < width - right && b.y > top - 12 && b.y + b.h < height - bottom
        && !taken.some((t) => b.x < t.x + t.w && t.x < b.x + b.w && b.y < t.y + t.h && t.y < b.y + b.h));
    if (label && box && shown.length <= 40) {
      taken.push(box);
      group.append(draw('text', {x: box.x, y: box.y + 11, class: 'dim', 'aria-hidden': 'true'}, label));
    }
    tipped(group, `${point.name}${isBest ? '  (no other point beats it)' : ''}\n${pointText(point, false, '\n')}\n${point.settings.join(' ')}\n` +
      'Click: show its image');
    const open = () => { choose(point); document.getElementById('h-images').scrollIntoView({block: 'start'}); };
    group.addEventListener('click', open);
    group.addEventListener('keydown', (event) => {
      const step = {ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1}[event.key];
      if (event.key === 'Enter' || event.key === ' ') {
        event.preventDefault();
        open();
      } else if (step || event.key === 'Home' || event.key === 'End') {
        event.preventDefault();
        const all = [...svg.querySelectorAll('.point')];
        const to = event.key === 'Home' ? 0 : event.key === 'End' ? all.length - 1 : (i + step + all.length) % all.length;
        all.forEach((one, k) => one.setAttribute('tabindex', k === to ? 0 : -1));
        all[to].focus();
      }
    });
    svg.append(group);
  });
  return [svg, without.length ? make('p', {class: 'note'}, `Not shown, for want of a time or an error with a number: ` +
    `${without.map((point) => point.name).join(', ')}.`) : null];
}

function timeLabel(quantity) {
  return quantity === 'frame' ? 'frame, submission to last fence [ms]' : `${quantity.replace('pass ', "pass '")}' alone [ms]`;
}
function pointText(point, isBest, separator = '; ') {
  const parts = separator === '\n' ? [] : [point.name];
  for (const quantity of [chart.time, chart.metric]) {
    const row = point.rows[quantity];
    parts.push(`${quantity}: ${withUnit(row)} ${interval(row)}`.trim());
    if (row && row.verdict) parts.push(`${quantity} against ${row.against}: ${row.verdict}`);
  }
  return parts.concat(isBest ? ['no other point beats it'] : []).join(separator);
}

function showChart() {
  const focused = document.activeElement && document.activeElement.closest('#chart svg .point');
  const row = focused && focused.getAttribute('data-row');
  const id = !focused && document.activeElement && document.activeElement.closest('#chart') && document.activeElement.id;
  const times = ['frame', ...new Set(points.flatMap((point) => Object.keys(point.rows).filter((each) => each.startsWith('pass '))))];
  const first = data.study.pass_name ? `pass ${data.study.pass_name}` : null;
  times.sort((a, b) => (b === 'frame') - (a === 'frame') || (b === first) - (a === first));
  const pick = (id_, label, values, value, set) => make('label', {}, label,
    make('select', {id: id_, onchange: (event) => { set(event.target.value); showChart(); }}, values.map((v) => option(v, v, v === value))));
  const legend = make('ul', {class: 'legend', 'aria-label': 'Variants'}, variants.map((variant, n) => make('li', {}, make('label', {},
    make('input', {type: 'checkbox', id: `variant-${n}`, checked: !chart.hidden.has(variant), onchange: (event) => {
      if (event.target.checked) chart.hidden.delete(variant); else chart.hidden.add(variant);
      showChart();
    }}),
    draw('svg', {width: 28, height: 14, viewBox: '-14 -7 28 14', 'aria-hidden': 'true'},
      draw('path', {d: 'M-14,0H14', stroke: look(variant).color, 'stroke-dasharray': look(variant).dash, 'stroke-width': 1.4}), mark(variant, 5)),
    variant + (knobsOf(variant) ? ` (${knobsOf(variant)})` : '')))));
  into('chart',
    make('div', {class: 'bar'}, pick('time-axis', 'Time', times, chart.time, (v) => { chart.time = v; }),
      pick('error-axis', 'Error', data.metrics.map((each) => each.name), chart.metric, (v) => { chart.metric = v; })),
    drawChart(), legend,
    make('p', {class: 'note'}, 'Bars are intervals that hold the true value with 95 % and more. The broad grey steps join the points that no ',
      'other one beats in both. Lines climb a ladder of knobs; numbers beside points are the knobs\' values. ',
      'Hover for settings, click or press Enter to see the image; ', make('kbd', {}, '←'), ' ', make('kbd', {}, '→'), ' from point to point.'));
  if (row) document.querySelector(`#chart svg .point[data-row="${row}"]`)?.focus();
  else if (id) document.getElementById(id)?.focus();
}
function knobsOf(variant) {
  const found = points.find((point) => point.variant === variant && point.knobs.length);
  return found ? found.knobs.map(([knob]) => knob).join(', ') : '';
}
onChange(showChart);
