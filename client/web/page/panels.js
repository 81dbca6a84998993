// The lists beside the map. Elements are kept and changed in place, so that focus and what a screen reader reads stay.
import { colourOf } from '/theme.js';
import { isFragment, robotState } from '/map.js';
import { format } from '/plots.js';

const $ = (id) => document.getElementById(id);
const PILLS = { tracking: 'good', unsure: 'warn', lost: 'bad', silent: '' };

export function setText(element, text) { if (element.textContent !== text) element.textContent = text; }

// One child of `list` for each item, by key, in the order of the items.
export function keyed(list, items, keyOf, make, update) {
  const old = new Map([...list.children].map((child) => [child.dataset.key, child]));
  items.forEach((item, index) => {
    const key = String(keyOf(item));
    let child = old.get(key);
    old.delete(key);
    if (!child) { child = make(item); child.dataset.key = key; }
    if (list.children[index] !== child) list.insertBefore(child, list.children[index] ?? null);
    update(child, item);
  });
  for (const child of old.values()) child.remove();
}

export function element(tag, className, parent) {
  const made = document.createElement(tag);
  if (className) made.className = className;
  parent?.append(made);
  return made;
}

function facts(list, rows) {
  keyed(list, rows.flatMap(([name, value]) => [{ tag: 'dt', key: `t${name}`, text: name }, { tag: 'dd', key: `d${name}`, text: value }]),
    (row) => row.key, (row) => element(row.tag), (child, row) => setText(child, row.text));
}

const scanSensors = (robot) => robot.sensors.filter((sensor) => sensor.sensor !== 'odometry');
export const counted = (number, thing) => `${number} ${thing}${number === 1 ? '' : 's'}`;
const droppedOf = (sensor) => Object.values(sensor.dropped).reduce((sum, count) => sum + count, 0);

function describeSensor(sensor) {
  const reasons = Object.entries(sensor.dropped).map(([reason, count]) => `${count} ${reason.replaceAll('_', ' ')}`);
  return `${sensor.sensor}: ${sensor.received} received, ${sensor.used} used, ${counted(sensor.keyframes, 'keyframe')}, ${sensor.waiting} waiting`
    + (reasons.length ? `, dropped: ${reasons.join(', ')}` : ', none dropped')
    + `. Scan to pose ${format(sensor.p50)} ms (median), ${format(sensor.p99)} ms (99 %).`;
}

// What somebody says of a robot's place: on the map, in numbers, or that nobody knows it.
function makeRelocalise(item, robot, onRelocalise) {
  const details = element('details', 'relocalise command', item);
  setText(element('summary', '', details), 'It is elsewhere');
  const row = element('p', 'row', details);
  const button = (text, className, parent, clicked) => {
    const made = element('button', className, parent);
    made.type = 'button';
    setText(made, text);
    made.addEventListener('click', clicked);
  };
  button('Show it on the map', 'on-map', row, () => onRelocalise(robot.name, 'map'));
  button('Look for it everywhere', 'anywhere', row, () => onRelocalise(robot.name, 'anywhere'));
  const form = element('form', 'row', details);
  for (const [name, words] of [['x', 'x (m)'], ['y', 'y (m)'], ['theta', 'heading (°)']]) {
    const label = element('label', '', form);
    label.append(words, ' ');
    const input = element('input', '', label);
    Object.assign(input, { type: 'number', step: 'any', name, required: true });
  }
  const here = element('button', '', form);
  setText(here, 'It is here');
  form.addEventListener('submit', (event) => {
    event.preventDefault();
    const number = (name) => Number(form.elements[name].value);
    onRelocalise(robot.name, 'here', { x: number('x'), y: number('y'), theta: (number('theta') * Math.PI) / 180 });
  });
}

// Whether it maps or is only localised, and for those who may command: the other of both.
const MODES = { map: 'Draws the map', localise: 'Only localised: nothing is drawn of it' };

function makeMode(item, robot, onMode) {
  element('span', 'mode', item);
  const row = element('span', 'row modes', item);
  for (const [mode, words] of [['localise', 'Only localise'], ['map', 'Map again']]) {
    const button = element('button', `command to-${mode}`, row);
    button.type = 'button';
    setText(button, words);
    button.setAttribute('aria-label', `${words}: ${robot.name}`);
    button.addEventListener('click', () => onMode(robot.name, mode));
  }
}

function showMode(item, robot, may) {
  const ended = robot.phase === 'ended';
  const mode = item.querySelector('.mode');
  mode.hidden = ended;
  setText(mode, MODES[robot.mode]);
  item.querySelector('.modes').hidden = !may || ended;
  const localise = item.querySelector('.to-localise'), map = item.querySelector('.to-map');
  for (const [button, other, is] of [[localise, map, 'localise'], [map, localise, 'map']]) {
    const focused = document.activeElement === button;
    button.hidden = robot.mode === is;
    if (focused && button.hidden) { other.hidden = false; other.focus(); }  // Who uses the keyboard stays here.
  }
}

export function showRobots(state, may, onChosen, onRelocalise, onMode) {
  $('robots-empty').hidden = state.robots.length > 0 || !state.connected;
  keyed($('robots'), state.robots, (robot) => robot.name, (robot) => {
    const item = element('li', 'robot');
    element('span', 'dot', item);
    const name = element('button', 'name', item);
    name.type = 'button';
    name.addEventListener('click', () => onChosen(robot.name));
    element('span', 'pill', item);
    element('span', 'where', item);
    element('span', 'note', item);
    makeMode(item, robot, onMode);
    const details = element('details', '', item);
    setText(element('summary', '', details), 'Scans');
    element('div', 'sensors', details);
    makeRelocalise(item, robot, onRelocalise);
    return item;
  }, (item, robot) => {
    const [style, words] = robotState(robot, state.connected);
    item.querySelector('.dot').style.background = colourOf(robot.name);
    const name = item.querySelector('.name');
    setText(name, robot.name);
    name.title = `Show ${robot.name} on the map`;
    const pill = item.querySelector('.pill');
    pill.className = `pill ${PILLS[style]}`;
    setText(pill, words);
    const { pose } = robot;
    item.querySelector('.relocalise').hidden = !may || !pose || robot.phase === 'ended';
    const used = scanSensors(robot).reduce((sum, sensor) => sum + sensor.used, 0);
    const dropped = scanSensors(robot).reduce((sum, sensor) => sum + droppedOf(sensor), 0);
    const place = pose ? `${pose.x.toFixed(2)}, ${pose.y.toFixed(2)} m, ${Math.round((pose.theta * 180) / Math.PI) || 0}°, ±${pose.ellipse ? pose.ellipse[0].toFixed(2) : '?'} m${isFragment(robot) ? ' from its start' : ''}` : 'no pose yet';
    setText(item.querySelector('.where'), `${place} · ${counted(used, 'scan')} used${dropped ? `, ${dropped} dropped` : ''}`);
    const note = item.querySelector('.note');
    note.hidden = !robot.note;
    setText(note, robot.note);
    showMode(item, robot, may);
    keyed(item.querySelector('.sensors'), scanSensors(robot), (sensor) => sensor.sensor, () => element('p'), (p, sensor) => setText(p, describeSensor(sensor)));
  });
}

const JOBS = { smooth: 'Smoothing', join: 'Joining robots', relocalise: 'Looking for a robot' };
const STATES = { queued: ['', 'Queued'], running: ['warn', 'Running'], succeeded: ['good', 'Done'], failed: ['bad', 'Failed'], cancelled: ['', 'Cancelled'] };

export function showJobs(state, may, onCancel) {
  $('jobs-empty').hidden = state.jobs.length > 0 || !state.connected;
  keyed($('jobs'), state.jobs, (job) => job.id, (job) => {
    const item = element('li', 'job');
    element('span', 'title', item);
    element('span', 'pill', item);
    const progress = element('progress', '', item);
    progress.max = 1;
    element('span', 'detail', item);
    const cancel = element('button', 'cancel command', item);
    cancel.type = 'button';
    setText(cancel, 'Cancel');
    cancel.setAttribute('aria-label', `Cancel job ${job.id}`);
    cancel.addEventListener('click', () => onCancel(job.id));
    return item;
  }, (item, job) => {
    setText(item.querySelector('.title'), `${JOBS[job.kind] ?? job.kind} ${job.id}`);
    const [style, words] = STATES[job.state] ?? ['', job.state];
    const pill = item.querySelector('.pill');
    pill.className = `pill ${style}`;
    setText(pill, job.state === 'running' ? `${Math.round(job.progress * 100)} %` : words);
    const progress = item.querySelector('progress');
    progress.hidden = job.final;
    progress.value = job.progress;
    progress.setAttribute('aria-label', `Progress of job ${job.id}`);
    const cost = job.state === 'succeeded' && job.cost_before > 0
      ? `disagreement of scans and map ${Math.round(Math.sqrt(job.cost_before) * 1000)} to ${Math.round(Math.sqrt(job.cost_after) * 1000)} mm, version ${job.version}` : job.message;
    setText(item.querySelector('.detail'), cost);
    item.querySelector('.cancel').hidden = job.final || !may;
  });
}

export function showMap(state, may, onEnable) {
  const { map } = state;
  const versions = map?.versions ?? [];
  facts($('map-facts'), !map ? [['Map', 'nothing drawn yet']] : [
    ['Size', map.tiles === 0 ? 'nothing drawn yet' : `${(map.bounds[2] - map.bounds[0]).toFixed(0)} × ${(map.bounds[3] - map.bounds[1]).toFixed(0)} m, ${counted(map.tiles, 'tile')}`],
    ['Cells', `${Math.round(map.resolution * 1000) / 10} cm`], ['Epoch', String(map.epoch)]]);
  keyed($('versions'), versions, (version) => version.version, (version) => {
    const item = element('li', 'version');
    setText(element('span', 'name', item), `Version ${version.version}`);
    element('span', 'note', item);
    element('span', 'pill good', item);
    const enable = element('button', 'command', item);
    enable.type = 'button';
    setText(enable, 'Enable');
    enable.setAttribute('aria-label', `Enable version ${version.version}`);
    enable.addEventListener('click', () => onEnable(version.version));
    return item;
  }, (item, version) => {
    setText(item.querySelector('.note'), version.note || (version.job === '0' ? 'live' : `job ${version.job}`));
    const pill = item.querySelector('.pill');
    pill.hidden = !version.enabled;
    setText(pill, 'Enabled');
    item.querySelector('button').hidden = version.enabled || !may;
  });
  const enabled = versions.find((version) => version.enabled)?.version;
  $('rollback').hidden = !may || versions.length < 2;
  $('rollback').disabled = !versions.some((version) => version.version < enabled);
  $('save').hidden = !may || !state.site;
  $('download').hidden = !state.site;
  for (const kind of ['yaml', 'png']) {
    if (state.site) $(`download-${kind}`).href = `/api/sites/${state.site}/map.${kind}`;
  }
}

export function showServer(state, may) {
  const r = state.refused;
  facts($('server-facts'), [
    ['Version', state.version || 'unknown'],
    ['Storing', state.degraded ? `DEGRADED: ${state.degraded}` : 'no problem'],
    ['Refused', `${r.datagrams} datagrams, ${r.commands} commands, ${r.over_limit} over a limit${r.secure ? `, ${r.peers} peers, ${r.endpoints} endpoints, ${r.samples} samples` : ''}`]]);
  $('read-only').hidden = state.commands;
  $('unlock').hidden = !state.commands || may;
  $('smooth').hidden = !state.commands;
  $('smooth').disabled = !may || !state.connected || state.robots.length === 0;
}

export function showConnection(state, streamLost) {
  const pill = $('connection'), banner = $('banner');
  const since = state?.answered_ms ? new Date(state.answered_ms).toLocaleTimeString() : '';
  const [style, words, text] = streamLost ? ['bad', 'Page offline', 'cairn-web does not answer. This page tries again.']
    : !state ? ['', 'Connecting', '']
    : !state.connected ? ['bad', 'Server lost', since ? `The server has not answered since ${since}. What you see is from then; the page goes on when it is back.` : 'No server answers on this DDS domain yet. The page goes on when there is one.']
    : state.degraded ? ['warn', 'Degraded', ''] : ['good', 'Live', ''];
  pill.className = `pill ${style}`;
  setText(pill, words);
  banner.hidden = !text;
  setText(banner, text);
  document.body.classList.toggle('old', style === 'bad');
}

export function showEmptyMap(state) {
  const empty = !state || !state.site || !state.map || state.map.tiles === 0;
  $('map-empty').hidden = !empty;
  if (!empty) return;
  const none = state && state.sites.length === 0;
  setText($('map-empty-title'), !state ? 'Connecting' : !state.connected ? 'No server' : none ? 'No site yet' : 'Nothing drawn yet');
  setText($('map-empty-text'), !state || !state.connected ? 'Waiting for an answer.'
    : none ? 'A site appears when the first robot opens a session.' : 'The map grows with the first scans.');
}
