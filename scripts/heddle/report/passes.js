// Of the chosen point: its passes' times one after the other, what leaving each out saves, and memory with and without sharing.

function passRows(point) {
  const graph = point.frame_graph === null || point.frame_graph === undefined ? null : data.graphs[point.frame_graph];
  const order = new Map((graph ? graph.passes : []).map((each) => [each.name, each.stages.length ? each.stages[0].number : Infinity]));
  return Object.entries(point.rows).filter(([quantity, row]) => quantity.startsWith('pass ') && row.value !== undefined)
    .map(([quantity, row]) => ({name: quantity.slice(5), row})).sort((a, b) => (order.get(a.name) ?? Infinity) - (order.get(b.name) ?? Infinity));
}
function leftOut(point, name) {
  const scene = data.scenes[point.scene].scene;
  return data.leave_one_out.find((each) => each.scene === scene && each.pass === name && each.cost_ms &&
    `${each.variant} ${each.knobs || ''}`.trim() === point.name);
}

function showPasses() {
  const point = chosen.point, rows = passRows(point);
  if (!rows.length) {
    into('passes', make('p', {class: 'note'}, `${point.name}: no passes were timed${point.note ? ` (${point.note})` : ''}.`));
    return;
  }
  const costs = rows.map(({name}) => leftOut(point, name)), hasCosts = costs.some(Boolean);
  const isNarrow = document.getElementById('passes').clientWidth < 620;
  const width = isNarrow ? 430 : 1000, label = isNarrow ? 90 : 130, line = 25, top = 26, right = isNarrow ? 72 : 100;
  // The axis holds all that is drawn: sums of passes, ends of intervals, what leaving out saves and the frame.
  const frame = point.rows.frame, frameMs = frame?.value ?? 0;
  let sum = 0;
  const ends = rows.map(({row}) => (sum += row.value) - row.value + Math.max(row.value, row.high ?? 0));
  const high = Math.max(frameMs, ...ends, ...costs.filter(Boolean).map((each) => each.cost_ms[2])) * 1.02;
  const low = Math.min(0, ...costs.filter(Boolean).map((each) => each.cost_ms[0]));
  const toX = (ms) => label + (width - label - right) * (ms - low) / (high - low);
  const height = top + line * rows.length * (hasCosts ? 1.6 : 1) + 30, step = line * (hasCosts ? 1.6 : 1);
  const svg = draw('svg', {viewBox: `0 0 ${width} ${height}`, role: 'img',
    'aria-label': `Passes of ${point.name} in the order in which they run; the table below has the same numbers`});
  for (const value of ticks(low, high, false)) {
    svg.append(draw('path', {class: 'grid', d: `M${toX(value)},${top - 4}V${height - 26}`}),
      draw('text', {x: toX(value), y: 14, 'text-anchor': 'middle', class: 'dim'}, digits(value, 3)));
  }
  svg.append(draw('text', {x: 4, y: 14, class: 'dim'}, 'ms'));
  if (frameMs > 0) {  // under the numbers, which stand out from it
    svg.append(draw('path', {d: `M${toX(frameMs)},${top - 6}V${height - 26}`, stroke: 'var(--text)', 'stroke-dasharray': '5 3', 'stroke-width': 1.3}),
      draw('text', {x: toX(frameMs), y: height - 10, 'text-anchor': 'middle'}, `frame ${digits(frameMs, 3)} ms`));
  }
  let at = 0;
  rows.forEach(({name, row}, i) => {
    const y = top + step * i, isStudied = name === data.study.pass_name, color = isStudied ? 'var(--c1)' : 'var(--c0)';
    const text = `pass '${name}': ${withUnit(row)} ${interval(row)}, ${row.samples} frames submitted stage by stage`;
    const group = tipped(draw('g', {}), text);
    group.append(draw('text', {x: label - 8, y: y + 13, 'text-anchor': 'end', 'font-weight': isStudied ? 700 : null}, shorten(name, isNarrow ? 11 : 18)),
      draw('rect', {x: toX(at), y: y + 2, width: Math.max(toX(at + row.value) - toX(at), 1.2), height: 14, fill: color}));
    if (row.low !== undefined) {
      group.append(draw('path', {d: `M${toX(at + row.low)},${y + 9}H${toX(at + row.high)}M${toX(at + row.low)},${y + 5}v8M${toX(at + row.high)},${y + 5}v8`,
        stroke: 'var(--text)', 'stroke-width': 1.2}));
    }
    group.append(draw('text', {x: toX(ends[i]) + 7, y: y + 13, class: 'dim outlined'}, `${digits(row.value, 3)} ms`));
    const cost = costs[i];
    if (cost) {
      const [a, middle, b] = cost.cost_ms;
      group.append(draw('rect', {x: Math.min(toX(0), toX(middle)), y: y + 20, width: Math.max(Math.abs(toX(middle) - toX(0)), 1.2), height: 8,
        fill: 'none', stroke: 'var(--c2)', 'stroke-width': 1.6}),
      draw('path', {d: `M${toX(a)},${y + 24}H${toX(b)}M${toX(a)},${y + 21}v6M${toX(b)},${y + 21}v6`, stroke: 'var(--c2)', 'stroke-width': 1.2}));
    }
    svg.append(group);
    at += row.value;
  });
  into('passes', make('p', {}, make('strong', {}, point.name), `, ${data.scenes[point.scene].scene}: the frame alone takes ${withUnit(frame)} ${interval(frame)}.`),
    svg,
    make('p', {class: 'note'}, 'Filled: a pass\'s own time, submitted and waited for stage by stage, which makes a frame slower: their sum is not the frame. ',
      hasCosts ? 'Outlined: by what the frame gets shorter when the pass is left out. ' : 'What leaving a pass out saves was not measured for this point. ',
      'Bars at the ends: intervals that hold the true median with 95 % and more, where the samples suffice.'),
    make('details', {}, make('summary', {}, 'The same as a table'),
      table(`Passes of ${point.name}, in order`, ['Pass', {text: 'Own time', n: 1}, {text: 'Interval', n: 1}, {text: 'Confidence', n: 1}, {text: 'Samples', n: 1}, {text: 'Left out, the frame is shorter by', n: 1}],
        rows.map(({name, row}, i) => [name, withUnit(row), interval(row), `${digits(100 * row.confidence, 4)} %`, String(row.samples),
          costs[i] ? `${digits(costs[i].cost_ms[1])} ms (${digits(costs[i].cost_ms[0])} to ${digits(costs[i].cost_ms[2])})` : 'not measured']))));
}
function shorten(text, most) {
  return text.length > most ? `${text.slice(0, most - 1)}…` : text;
}

function showMemory() {
  const point = chosen.point;
  const graph = typeof point.frame_graph === 'number' ? data.graphs[point.frame_graph] : null;
  const known = Object.entries(point.rows).filter(([quantity]) => quantity.startsWith('memory '));
  const parts = [];
  if (graph) {
    const {heap_bytes: heap, unaliased_bytes: apart, own_bytes: own} = graph.memory;
    const isNarrow = document.getElementById('memory').clientWidth < 620, width = isNarrow ? 430 : 900, label = isNarrow ? 0 : 150;
    const most = Math.max(apart + own, heap + own, 1), toW = (v) => (width - label - 20) * v / most;
    const svg = draw('svg', {viewBox: `0 0 ${width} ${isNarrow ? 96 : 74}`, role: 'img',
      'aria-label': `Images and buffers of ${point.name}: ${bytes(heap + own)} with sharing, ${bytes(apart + own)} without; ${bytes(own)} of both is kept or read afterwards`});
    [['sharing memory', heap], ['each its own', apart]].forEach(([text, transient], i) => {
      const y = isNarrow ? 14 + 46 * i : 6 + 34 * i, x = label;
      svg.append(draw('text', isNarrow ? {x: 0, y: y - 2} : {x: label - 8, y: y + 16, 'text-anchor': 'end'}, text),
        draw('rect', {x, y: y + 3, width: Math.max(toW(own), 0), height: 20, fill: 'var(--c0)'}),
        draw('rect', {x: x + toW(own), y: y + 3, width: Math.max(toW(transient), transient ? 1 : 0), height: 20, fill: 'var(--c4)', stroke: 'var(--back)'}));
    });
    const saved = apart - heap;
    parts.push(make('p', {}, make('strong', {}, point.name), `: images and buffers of the frame take ${bytes(heap + own)}; without sharing ${bytes(apart + own)}. `,
      `${bytes(own)} of both is kept or read afterwards; what lives only within the frame takes ${bytes(heap)} instead of ${bytes(apart)}` +
      (apart ? ` (${digits(100 * saved / apart, 3)} % less).` : '.')), svg,
    make('ul', {class: 'legend'}, [['var(--c0)', 'kept, or read afterwards'], ['var(--c4)', 'within the frame alone']].map(([color, text]) =>
      make('li', {}, make('label', {}, draw('svg', {width: 14, height: 14, 'aria-hidden': 'true'}, draw('rect', {width: 14, height: 14, fill: color})), text)))));
  } else {
    parts.push(make('p', {class: 'note'}, `${point.name}: its frame was not planned${point.note ? ` (${point.note})` : ''}.`));
  }
  if (known.length) {
    parts.push(make('details', {}, make('summary', {}, 'The same as a table, and what the host counted'),
      table(`Memory of ${point.name}`, ['What', {text: 'Bytes', n: 1}, {text: '', n: 1}], [
        ...(graph ? [['images and buffers, sharing', graph.memory.heap_bytes + graph.memory.own_bytes], ['images and buffers, each its own', graph.memory.unaliased_bytes + graph.memory.own_bytes],
          ['of both: kept or read afterwards', graph.memory.own_bytes]].map(([what, value]) => [what, String(value), bytes(value)]) : []),
        ...known.map(([quantity, row]) => [`counted: ${quantity.slice(7)}`, String(row.value), bytes(row.value)])])));
  }
  into('memory', parts);
}
onChange(showPasses);
onChange(showMemory);
