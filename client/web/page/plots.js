// Small plots of the last one to five minutes. Each is a picture with a description in words.
const SVG = 'http://www.w3.org/2000/svg';
const WIDTH = 300, HEIGHT = 64, LEFT = 38, SHORTEST_MS = 60000, LONGEST_MS = 300000;

function make(name, attributes, parent) {
  const element = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  parent.append(element);
  return element;
}

function niceTop(most) {
  for (const top of [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000, 10000]) if (most <= top) return top;
  return most;
}

// lines: [{ value: sample -> number, or null where there is none, style, name }]
export function plot(figure, samples, lines, unit) {
  figure.querySelector('svg')?.remove();
  const svg = make('svg', { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: 'img', preserveAspectRatio: 'none' }, figure);
  const last = samples[samples.length - 1];
  const words = !last ? 'nothing yet' : lines[0].value(last) === null ? 'no scans now'
    : `${lines.map((line) => `${line.name} ${format(line.value(last))}`).join(', ')} ${unit}`;
  figure.querySelector('.value').textContent = words;
  svg.setAttribute('aria-label', `Scans of the last minutes. Now: ${words}.`);
  const now = last ? last[0] : 0;
  const recent = samples.filter((sample) => now - sample[0] < LONGEST_MS);
  const span = Math.max(SHORTEST_MS, now - (recent[0]?.[0] ?? now));
  const top = niceTop(Math.max(1, ...recent.flatMap((sample) => lines.map((line) => line.value(sample)))));
  const x = (ms) => LEFT + ((WIDTH - LEFT) * (span - (now - ms))) / span;
  const y = (value) => HEIGHT - 4 - ((HEIGHT - 14) * value) / top;
  for (const value of [0, top]) {
    make('line', { x1: LEFT, x2: WIDTH, y1: y(value), y2: y(value), class: 'plot-grid' }, svg);
    make('text', { x: LEFT - 5, y: y(value) + 3, 'text-anchor': 'end', class: 'plot-text' }, svg).textContent = value;
  }
  for (const line of lines) {
    const points = recent.filter((sample) => line.value(sample) !== null).map((sample) => `${x(sample[0]).toFixed(1)},${y(line.value(sample)).toFixed(1)}`);
    make('polyline', { points: points.join(' '), class: `plot-line ${line.style}` }, svg);
  }
}

export const format = (value) => (value >= 100 ? value.toFixed(0) : value.toFixed(1));
