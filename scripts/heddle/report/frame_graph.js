// The frame graph as a picture: layers from top to bottom, who reads what; passes that were dropped are grey, and say why.
// Layers by longest path, order in them by neighbours' means, as Sugiyama, Tagawa and Toda 1981 do; long edges go around.

const NODE = {width: 172, height: 58, gap: 18, layer: 46};  // a box is wider where its words are

// Widths of the words as they will be drawn: measured, since no count of letters tells them.
const pen = document.createElement('canvas').getContext('2d');
function textWidth(text, weight, size) {
  pen.font = `${weight} ${size}px ${getComputedStyle(document.body).fontFamily}`;
  return pen.measureText(text).width;
}
function boxTexts(pass) {
  return [
    {y: 19, weight: 700, size: 12, text: shorten(pass.name, 40)},
    {y: 34, weight: 400, size: 12, text: shorten(pass.technique, 40)},
    {y: 50, weight: 400, size: 10.5, text: shorten(pass.is_pruned ? pass.reason :
      pass.stages.length ? `stage${pass.stages.length > 1 ? 's' : ''} ${pass.stages.map((stage) => stage.number).join(', ')}` : 'runs in its callers', 40)},
  ];
}

function layout(graph) {
  const nodes = new Map(graph.passes.map((pass) => {
    const texts = boxTexts(pass), width = Math.max(NODE.width, ...texts.map(({text, weight, size}) => Math.ceil(textWidth(text, weight, size)) + 16));
    return [pass.name, {pass, name: pass.name, texts, width, above: [], below: [], layer: 0}];
  }));
  const joined = new Map();  // edges of a pair and a kind are one line
  for (const edge of graph.edges) {
    const key = JSON.stringify([edge.from, edge.to, edge.kind]);
    if (!joined.has(key)) joined.set(key, {from: edge.from, to: edge.to, kind: edge.kind, what: []});
    joined.get(key).what.push(edge.what + (edge.shape ? ` (${edge.shape})` : ''));
  }
  const edges = [...joined.values()], forward = edges.filter((edge) => edge.kind !== 'previous' && edge.from !== edge.to);
  // The longest path; a cycle, which no planned graph has, would stop after as many rounds as there are nodes.
  for (let round = 0, isMoving = true; isMoving && round < nodes.size; round++) {
    isMoving = false;
    for (const edge of forward) {
      const from = nodes.get(edge.from), to = nodes.get(edge.to);
      if (to.layer < from.layer + 1) { to.layer = from.layer + 1; isMoving = true; }
    }
  }
  // What nobody's output needs early stands right above its first reader.
  for (const node of [...nodes.values()].sort((a, b) => b.layer - a.layer)) {
    const readers = forward.filter((edge) => edge.from === node.name).map((edge) => nodes.get(edge.to).layer);
    const givers = forward.some((edge) => edge.to === node.name);
    if (readers.length && !givers) node.layer = Math.min(...readers) - 1;
  }
  const layers = [];
  const put = (node) => { (layers[node.layer] ||= []).push(node); return node; };
  graph.passes.forEach((pass) => put(nodes.get(pass.name)));
  for (const edge of forward) {
    let last = nodes.get(edge.from);
    const to = nodes.get(edge.to);
    edge.path = [last];
    while (last.layer + 1 < to.layer) {
      const bend = put({isBend: true, layer: last.layer + 1, above: [last], below: []});
      last.below.push(bend);
      edge.path.push(last = bend);
    }
    last.below.push(to);
    to.above.push(last);
    edge.path.push(to);
  }
  for (let i = 0; i < layers.length; i++) layers[i] ||= [];
  const widthOf = (node) => node.isBend ? 12 : node.width;
  const settle = () => layers.forEach((layer) => layer.forEach((node, i) => { node.rank = i; }));
  settle();
  for (let sweep = 0; sweep < 12; sweep++) {
    const [towards, order] = sweep % 2 ? ['below', [...layers].reverse()] : ['above', layers];
    for (const layer of order) {
      layer.forEach((node, i) => { node.mean = node[towards].length ? node[towards].reduce((sum, each) => sum + each.rank, 0) / node[towards].length : i; });
      layer.sort((a, b) => a.mean - b.mean);
      layer.forEach((node, i) => { node.rank = i; });
    }
  }
  for (const layer of layers) {
    let x = 0;
    for (const node of layer) { node.x = x + widthOf(node) / 2; x += widthOf(node) + NODE.gap; }
  }
  for (let sweep = 0; sweep < 24; sweep++) {
    for (const layer of sweep % 2 ? [...layers].reverse() : layers) {
      for (const node of layer) {
        const near = [...node.above, ...node.below];
        node.want = near.length ? near.reduce((sum, each) => sum + each.x, 0) / near.length : node.x;
      }
      // As near to where they want to be as their neighbours in the layer let them, from both sides.
      const room = (a, b) => (widthOf(a) + widthOf(b)) / 2 + NODE.gap;
      const right = [], left = [];
      layer.forEach((node, i) => { right[i] = i ? Math.max(node.want, right[i - 1] + room(layer[i - 1], node)) : node.want; });
      for (let i = layer.length - 1; i >= 0; i--) left[i] = i < layer.length - 1 ? Math.min(layer[i].want, left[i + 1] - room(layer[i], layer[i + 1])) : layer[i].want;
      layer.forEach((node, i) => { node.x = (right[i] + left[i]) / 2; });
    }
  }
  const all = layers.flat();
  const least = Math.min(...all.map((node) => node.x - widthOf(node) / 2)) - 26;
  for (const node of all) {
    node.x -= least;
    node.y = 12 + node.layer * (NODE.height + NODE.layer);
  }
  return {nodes, edges, width: Math.max(...all.map((node) => node.x + widthOf(node) / 2)) + 26, height: layers.length * (NODE.height + NODE.layer) - NODE.layer + 26};
}

function edgePath(edge, nodes) {
  if (!edge.path) {  // last frame's version: around the outside, upwards
    const from = nodes.get(edge.from), to = nodes.get(edge.to), x1 = from.x + from.width / 2, x2 = to.x + to.width / 2;
    const out = Math.max(x1, x2) + 20;
    return `M${x1},${from.y + 38}C${out},${from.y + 38} ${out},${to.y + 20} ${x2 + 2},${to.y + 20}`;
  }
  let d = '', last = null;
  edge.path.forEach((node, i) => {
    const inY = node.y - (i === edge.path.length - 1 ? 3 : 0), outY = node.y + NODE.height;
    if (!i) d = `M${node.x},${outY}`;
    else {
      const middle = (last.y + inY) / 2;
      d += `C${last.x},${middle} ${node.x},${middle} ${node.x},${inY}`;
      if (node.isBend) d += `V${outY}`;
    }
    last = {x: node.x, y: outY};
  });
  return d;
}

function showGraph() {
  const point = chosen.point;
  if (typeof point.frame_graph !== 'number') {
    into('graph', make('p', {class: 'note'}, `${point.name}: its frame was not planned${point.note ? ` (${point.note})` : ''}.`));
    return;
  }
  const graph = data.graphs[point.frame_graph], {nodes, edges, width, height} = layout(graph);
  const parameters = point.parameters === null ? {} : data.interned[point.parameters];
  const dropped = graph.passes.filter((pass) => pass.is_pruned);
  const svg = draw('svg', {viewBox: `0 0 ${width} ${height}`, width, height, class: 'graph', role: 'group',
    style: `min-width: ${Math.min(width, 0.62 * width + 180)}px`,
    'aria-label': `Frame graph of ${point.name}: ${graph.passes.length - dropped.length} passes run, ${dropped.length} are dropped; the table below says the same`});
  svg.append(draw('defs', {}, draw('marker', {id: 'arrow', viewBox: '0 0 8 8', refX: 6, refY: 4, markerWidth: 7, markerHeight: 7, orient: 'auto-start-reverse'},
    draw('path', {d: 'M0,0L8,4L0,8Z'}))));
  for (const edge of edges) {
    const isGrey = nodes.get(edge.from).pass.is_pruned || nodes.get(edge.to).pass.is_pruned;
    edge.line = draw('path', {d: edgePath(edge, nodes), class: `${edge.kind}${isGrey ? ' grey' : ''}`, 'marker-end': 'url(#arrow)'});
    svg.append(tipped(edge.line, `${edge.from} → ${edge.to} ${{reads: 'reads', answers: 'calls the function', previous: 'reads last frame\'s'}[edge.kind]}\n${edge.what.join('\n')}`));
  }
  const names = [...nodes.keys()];
  names.forEach((name, i) => {
    const node = nodes.get(name), {pass} = node;
    const numbers_ = pass.stages.map((stage) => `${stage.number} ${stage.kind} ${stage.name}`);
    const text = `${pass.name}: ${pass.technique}\n${pass.is_pruned ? 'dropped' : 'runs'}: ${pass.reason}` +
      (numbers_.length ? `\nstages in the frame's order: ${numbers_.join(', ')}` : '') + (pass.scene.length ? `\nof the scene: ${pass.scene.join(', ')}` : '') +
      (parameters[name] ? '\n' + Object.entries(parameters[name]).map(([key, value]) => `${key} = ${value}`).join(', ') : '');
    const group = draw('g', {class: `node${pass.is_pruned ? ' pruned' : ''}${name === data.study.pass_name ? ' studied' : ''}`, role: 'img', tabindex: i ? -1 : 0,
      'aria-label': text, transform: `translate(${node.x - node.width / 2},${node.y})`},
    draw('rect', {width: node.width, height: NODE.height, rx: 7}),
    node.texts.map(({y, weight, size, text: words}, line) => draw('text', {x: node.width / 2, y, 'text-anchor': 'middle', class: line ? 'dim' : null,
      'font-weight': weight, 'font-size': size}, words)));
    const light = (isOn) => edges.forEach((edge) => { if (edge.from === name || edge.to === name) edge.line.classList.toggle('lit', isOn); });
    for (const event of ['mouseenter', 'focus']) group.addEventListener(event, () => light(true));
    for (const event of ['mouseleave', 'blur']) group.addEventListener(event, () => light(false));
    group.addEventListener('keydown', (event) => {
      const step = {ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1}[event.key];
      if (!step) return;
      event.preventDefault();
      const all = [...svg.querySelectorAll('.node')], to = (i + step + all.length) % all.length;
      all.forEach((one, k) => one.setAttribute('tabindex', k === to ? 0 : -1));
      all[to].focus();
    });
    svg.append(tipped(group, text));
  });
  into('graph', make('p', {}, make('strong', {}, point.name), `: ${graph.file.split('/').pop()}, ${graph.extent.join(' x ')} pixels, output '${graph.output}'. ` +
    (dropped.length ? `${dropped.length} of ${graph.passes.length} passes ${dropped.length === 1 ? 'is' : 'are'} dropped (grey): ` +
      dropped.map((pass) => `'${pass.name}', for ${pass.reason}`).join('; ') + '.' : 'No pass is dropped.')),
  make('div', {class: 'scroll'}, svg),
  make('p', {class: 'note'}, 'From top to bottom. Whole lines: a resource that the lower pass reads; dashed: a function that it calls; dotted: last frame\'s version. ',
    'Hover or focus a pass for its settings, stages and lines; ', make('kbd', {}, '←'), ' ', make('kbd', {}, '→'), ' from pass to pass.'),
  make('details', {}, make('summary', {}, 'The same as a table'),
    table(`Passes of ${graph.file}`, ['Pass', 'Technique', 'Runs', 'Why', 'Stages', 'Takes', 'Calls'], graph.passes.map((pass) => [
      pass.name, pass.technique, pass.is_pruned ? 'dropped' : 'yes', pass.reason, pass.stages.map((stage) => `${stage.number} ${stage.name}`).join(', '),
      graph.edges.filter((edge) => edge.to === pass.name && edge.kind !== 'answers').map((edge) => edge.what + (edge.kind === 'previous' ? '@previous' : '')).concat(pass.scene).join(', '),
      graph.edges.filter((edge) => edge.to === pass.name && edge.kind === 'answers').map((edge) => `${edge.what} (${edge.from})`).join(', ')]))));
}
onChange(showGraph);
