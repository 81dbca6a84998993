// Robots that are not joined with the map of their site yet. Where they are in it is not known, so each has a small picture of
// its own: what it has drawn itself, its path and its place, in the frame of its start.
import { colourOf, theme } from '/theme.js';
import { isFragment } from '/map.js';
import { element, keyed, setText } from '/panels.js';

const $ = (id) => document.getElementById(id);
const WIDTH = 168, HEIGHT = 112, MARGIN = 8;  // Of a picture on the page, in pixels.
const LEAST_M = 2;  // A picture shows at least this much to each side.
const known = new Map();  // By robot: { image, area, points, length }.

// Before its first pose a robot has none.
const hasPicture = (robot) => isFragment(robot) && robot.phase !== 'ended' && robot.pose !== null;

// Asks only while somebody can see the pictures. Without an answer what is shown stays; 404: the robot has drawn nothing yet.
export async function askFragment(robot, getJson) {
  const { name } = robot;
  if (!hasPicture(robot) || !$('fragments').open) return;
  const answer = await fetch(`/api/robots/${name}/map.png?theme=${theme()}`).catch(() => null);
  if (!answer?.ok && answer?.status !== 404) return;
  const area = answer.ok ? answer.headers.get('X-Map-Area').split(' ').map(Number) : null;
  const image = area ? await createImageBitmap(await answer.blob()) : null;
  const path = await getJson(`/api/robots/${name}/path`);
  known.get(name)?.image?.close();
  known.set(name, { image, area, points: path?.points ?? [], length: path?.length ?? 0 });
}

function boundsOf({ area, points }, pose) {
  const xs = [...(area ? [area[0], area[2]] : []), ...points.map(([x]) => x), pose.x];
  const ys = [...(area ? [area[1], area[3]] : []), ...points.map(([, y]) => y), pose.y];
  // Not Math.min(...xs): paths are long.
  const range = (values) => [values.reduce((a, b) => Math.min(a, b)), values.reduce((a, b) => Math.max(a, b))];
  return [range(xs), range(ys)];
}

function draw(canvas, robot, seen) {
  const ratio = window.devicePixelRatio || 1, context = canvas.getContext('2d'), { pose } = robot;
  canvas.width = WIDTH * ratio;  // This also clears it.
  canvas.height = HEIGHT * ratio;
  const [[x0, x1], [y0, y1]] = boundsOf(seen, pose);
  const scale = Math.min((WIDTH - 2 * MARGIN) / Math.max(x1 - x0, LEAST_M), (HEIGHT - 2 * MARGIN) / Math.max(y1 - y0, LEAST_M));
  const toX = (x) => WIDTH / 2 + (x - (x0 + x1) / 2) * scale, toY = (y) => HEIGHT / 2 - (y - (y0 + y1) / 2) * scale;
  context.scale(ratio, ratio);
  if (seen.image) {
    const [left, low, right, high] = seen.area;
    context.drawImage(seen.image, toX(left), toY(high), (right - left) * scale, (high - low) * scale);
  }
  context.strokeStyle = context.fillStyle = colourOf(robot.name);
  context.lineWidth = 2;
  context.beginPath();
  for (const [x, y] of seen.points) context.lineTo(toX(x), toY(y));
  context.stroke();
  context.translate(toX(pose.x), toY(pose.y));
  context.rotate(-pose.theta);
  context.beginPath();
  for (const [x, y] of [[8, 0], [-5, 5], [-3, 0], [-5, -5]]) context.lineTo(x, y);
  context.fill();
  const size = seen.area ? `${(seen.area[2] - seen.area[0]).toFixed(0)} × ${(seen.area[3] - seen.area[1]).toFixed(0)} m` : 'nothing drawn yet';
  canvas.setAttribute('aria-label', `Own map of ${robot.name}: ${size}, ${seen.length.toFixed(0)} m of way`);
}

export function showFragments(robots) {
  const fragments = robots.filter(hasPicture);
  $('fragments').hidden = fragments.length === 0;
  setText($('fragments-count'), String(fragments.length));
  for (const [name, seen] of known) {
    if (fragments.some((robot) => robot.name === name)) continue;
    seen.image?.close();
    known.delete(name);
  }
  keyed($('fragment-list'), fragments, (robot) => robot.name, (robot) => {
    const item = element('li');
    setText(element('span', 'name', item), robot.name);
    element('canvas', '', item).setAttribute('role', 'img');
    return item;
  }, (item, robot) => draw(item.querySelector('canvas'), robot, known.get(robot.name) ?? { points: [], length: 0 }));
}
