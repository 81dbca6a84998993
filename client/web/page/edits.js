// What people say about the map, whatever robots have drawn: the list of it, and the tools to say it.
import { element, keyed, setText } from '/panels.js';

const $ = (id) => document.getElementById(id);
// As the server calls them, in words for people.
const KINDS = { free: 'Erased', unknown: 'Forgotten', occupied: 'Wall', keep_out: 'Keep out', origin: 'Origin of the building' };
const WALL_WIDTH = 0.1;  // Metres.

// Two ends as an edit: of a wall they are its ends, of anything else opposite corners of a box.
export function editOf(kind, from, to, note) {
  const [a, b] = [[from.x, from.y], [to.x, to.y]];
  if (kind === 'occupied') return { kind, points: [a, b], width: WALL_WIDTH, note };
  return { kind, points: [a, [b[0], a[1]], b, [a[0], b[1]]], note };
}

function describe(edit) {
  const [x, y] = [0, 1].map((axis) => edit.points.reduce((sum, point) => sum + point[axis], 0) / edit.points.length);
  return `${edit.note ? `${edit.note}, ` : ''}at ${x.toFixed(1)}, ${y.toFixed(1)} m`;
}

// Of a site, because every site numbers its edits from 1.
export function showEdits(site, edits, may, onRemove) {
  $('edits-empty').hidden = edits.length > 0;
  $('edit-tools').hidden = !may;
  keyed($('edits'), edits, (edit) => `${site} ${edit.id}`, (edit) => {
    const item = element('li', 'edit');
    setText(element('span', 'name', item), KINDS[edit.kind] ?? edit.kind);
    setText(element('span', 'note', item), describe(edit));
    const remove = element('button', 'command', item);
    remove.type = 'button';
    setText(remove, 'Remove');
    remove.setAttribute('aria-label', `Remove edit ${edit.id}: ${KINDS[edit.kind] ?? edit.kind} ${describe(edit)}`);
    remove.addEventListener('click', () => onRemove(edit.id));
    return item;
  }, (item) => { item.querySelector('button').hidden = !may; });
}

// `onDraw` begins to take two places from the map; `onEnds` gets two ends that were typed.
export function listenToTools(onDraw, onEnds) {
  const kind = () => $('edit-kind').value, note = () => $('edit-note').value.trim();
  $('edit-draw').addEventListener('click', () => onDraw(kind(), note()));
  $('edit-form').addEventListener('submit', (event) => {
    event.preventDefault();
    const number = (name) => Number(event.target.elements[name].value);
    onEnds(editOf(kind(), { x: number('x1'), y: number('y1') }, { x: number('x2'), y: number('y2') }, note()));
  });
}
