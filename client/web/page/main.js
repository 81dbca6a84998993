// Holds the page together: chooses the site, listens to the events, and hands what they say to the map and the lists.
import { SiteMap, isFragment } from '/map.js';
import { plot } from '/plots.js';
import { onThemeChange } from '/theme.js';
import * as panels from '/panels.js';
import { showDoctor } from '/doctor.js';
import { editOf, listenToTools, showEdits } from '/edits.js';
import { askFragment, showFragments } from '/fragments.js';
import { command, say, token, tokenOfAddress, useToken } from '/commands.js';

const $ = (id) => document.getElementById(id);
const PATH_PERIOD_MS = 4000;
let edits = [], editsShown = '';
let state = null, map = null, events = null, streamLost = false, waitingTiles = [], flow = [], retry = 0;
let wanted = new URLSearchParams(location.search).get('site') ?? '';

const may = () => Boolean(state?.commands && token());

const LAYERS = ['path', 'smoothed', 'ellipse', 'landmarks', 'edits', 'disagreement'];

async function getJson(path) {
  const answer = await fetch(path).catch(() => null);
  return answer?.ok ? answer.json() : null;
}

function listen() {
  events?.close();
  clearTimeout(retry);
  const source = new EventSource(`/api/events${wanted ? `?site=${encodeURIComponent(wanted)}` : ''}`);
  events = source;
  source.addEventListener('state', (event) => { streamLost = false; show(JSON.parse(event.data)); });
  source.addEventListener('tiles', (event) => {
    const changes = JSON.parse(event.data);
    if (map) map.applyTiles(changes); else waitingTiles.push(changes);
  });
  source.addEventListener('doctor', (event) => showDoctor(JSON.parse(event.data)));
  source.addEventListener('flow', (event) => { flow = flow.concat(JSON.parse(event.data)).slice(-300); showFlow(); });
  source.onerror = () => {
    streamLost = true;
    panels.showConnection(state, true);
    source.close();
    // Ask plainly first: a site that is gone is another thing than a page that is offline.
    retry = setTimeout(async () => {
      const answer = await fetch(`/api/state?site=${encodeURIComponent(wanted)}`).catch(() => null);
      if (answer?.status === 404) choose('');
      else listen();
    }, 1000);
  };
}

function choose(site) {
  wanted = site;
  map?.remove();
  map = null;
  showFragments([]);
  flow = [];
  waitingTiles = [];
  state = null;
  edits = [];
  editsShown = '';
  showEdits(site, edits, false);
  const address = new URL(location.href);
  if (site) address.searchParams.set('site', site); else address.searchParams.delete('site');
  history.replaceState(null, '', address);
  listen();
}

function showSites() {
  const select = $('site'), names = state.sites;
  if (select.dataset.names !== names.join()) {
    select.dataset.names = names.join();
    select.replaceChildren(...names.map((name) => new Option(name, name)));
  }
  select.disabled = names.length < 2;
  if (state.site) select.value = state.site;
}

function show(now) {
  state = { robots: [], jobs: [], map: null, ...now };  // Without a site the server says nothing of these.
  showSites();
  panels.showConnection(state, streamLost);
  panels.showEmptyMap(state);
  if (!state.site && state.sites.length > 0) { choose(state.sites[0]); return; }
  document.title = state.site ? `${state.site} – Cairn` : 'Cairn';
  if (!map && state.map) {
    map = new SiteMap($('map'), state.site, state.map);
    for (const name of LAYERS) map.shown[name] = $(`show-${name}`).checked;
    for (const changes of waitingTiles) map.applyTiles(changes);
    waitingTiles = [];
    askPaths();
  }
  map?.fit(state.map, false);
  map?.update(state.robots, state.connected);
  showFragments(state.robots);
  panels.showRobots(state, may(), (name) => {
    const robot = state.robots.find((one) => one.name === name);
    if (robot?.pose && !isFragment(robot)) map?.centre(robot.pose);
  }, relocalise, setMode);
  panels.showJobs(state, may(), (id) => command(`/api/jobs/${id}/cancel`, {}, 'The job is cancelled.'));
  panels.showMap(state, may(), (version) => command(`/api/sites/${state.site}/enable`, { version }, `Version ${version} is enabled.`));
  panels.showServer(state, may());
  if (state.site) askEdits();
}

function relocalise(name, how, pose) {
  const tell = (body) => command(`/api/robots/${name}/relocalise`, body, `${name} is looked for ${body.x === undefined ? 'everywhere' : 'there'}.`);
  if (how !== 'map') { tell(pose ?? {}); return; }
  const robot = state.robots.find((one) => one.name === name);
  if (!map || !robot?.pose) return;
  if (map.placing === name) { map.stopPlacing(); return; }
  $('map').scrollIntoView({ block: 'nearest' });  // On a phone it is above the lists.
  map.place(name, robot.pose.theta, (placed) => { if (placed) tell(placed); else say(''); });
  say(`Press where ${name} is, and drag to where it looks. Escape, or the button again, leaves it as it is.`, true);
}

function setMode(name, mode) {
  command(`/api/robots/${name}/${mode}`, {}, mode === 'map' ? `${name} maps again.` : `${name} is only localised from now on, in the map of its site.`);
}

function showFlow() {
  const latency = (at) => (sample) => (sample[1] > 0 ? sample[at] : null);  // Without scans there is none.
  plot($('flow'), flow, [
    { name: 'used', value: (sample) => sample[1], style: 'first' }, { name: 'dropped', value: (sample) => sample[2], style: 'second' }], '/s');
  plot($('latency'), flow, [
    { name: 'median', value: latency(3), style: 'first' }, { name: '99 %', value: latency(4), style: 'third' }], 'ms');
}

// They are asked for when the server says that they have changed.
async function askEdits() {
  const site = state.site, version = `${site} ${state.map?.edits ?? '0'}`;
  if (version !== editsShown) {
    editsShown = version;
    const answer = state.map?.edits === '0' ? [] : await getJson(`/api/sites/${site}/edits`);
    if (state?.site !== site || editsShown !== version) return;
    if (!answer) editsShown = '';  // With the next state.
    edits = answer ?? edits;
    map?.setEdits(edits);
  }
  showEdits(site, edits, may(), (id) => command(`/api/sites/${site}/remove-edit`, { id }, 'The edit is removed.'));
}

function sendEdit(edit) { command(`/api/sites/${state.site}/edit`, edit, 'The map is edited.'); }

listenToTools((kind, note) => {
  if (!map) return;
  if (map.placing === 'edit') { map.stopPlacing(); return; }
  $('map').scrollIntoView({ block: 'nearest' });
  map.span(kind === 'occupied', (from, to) => { if (from) sendEdit(editOf(kind, from, to, note)); else say(''); });
  say(`Press on the map and drag ${kind === 'occupied' ? 'along the wall' : 'to the opposite corner'}. Escape leaves it as it is.`, true);
}, sendEdit);

async function askDisagreement(asked) {
  const answer = await fetch(`/api/sites/${asked.site}/disagreement.png`).catch(() => null);
  const [url, area] = answer?.status === 200 ? [await asDataUrl(await answer.blob()), answer.headers.get('X-Map-Area').split(' ').map(Number)] : [null, null];
  if (map === asked) asked.setDisagreement(url, area);
}

function asDataUrl(blob) {
  return new Promise((resolve) => {
    const reader = new FileReader();
    reader.onload = () => resolve(reader.result);
    reader.onerror = () => resolve(null);
    reader.readAsDataURL(blob);
  });
}

let asking = false;
async function askPaths() {
  if (!map || !state?.connected || asking || document.hidden) return;
  asking = true;
  try { await askAll(); } catch { /* The connection broke in the middle of an answer: it is asked again. */ }
  asking = false;
}

async function askAll() {
  const asked = map, smoothed = state.map?.versions.some((version) => version.enabled && version.job !== '0');
  for (const robot of state.robots) {
    if (isFragment(robot)) {
      await askFragment(robot, getJson);
      if (map !== asked) return;
      showFragments(state.robots);
      continue;  // Its path is none in this map.
    }
    if (asked.shown.path) {
      const path = await getJson(`/api/robots/${robot.name}/path`);
      if (path && map === asked) asked.setPath(robot.name, path.points, false);
    }
    if (asked.shown.smoothed) {
      const path = smoothed ? await getJson(`/api/robots/${robot.name}/path?smoothed=1`) : null;
      if (map === asked) asked.setPath(robot.name, path?.points ?? [], true);
    }
  }
  if (asked.shown.disagreement && map === asked) await askDisagreement(asked);
  if (asked.shown.landmarks && map === asked) asked.setLandmarks((await getJson(`/api/sites/${asked.site}/landmarks`)) ?? []);
}

$('site').addEventListener('change', (event) => choose(event.target.value));
$('fit').addEventListener('click', () => map?.fit(state?.map, true));
for (const name of LAYERS) {
  $(`show-${name}`).addEventListener('change', (event) => {
    if (!map) return;
    map.shown[name] = event.target.checked;
    if (name === 'landmarks' && !event.target.checked) map.setLandmarks([]);
    if (name === 'disagreement' && !event.target.checked) map.setDisagreement(null);
    map.setEdits(edits);
    map.update(state.robots, state.connected);
    askPaths();
  });
}
$('show-names').addEventListener('change', (event) => $('map').classList.toggle('no-names', !event.target.checked));
$('smooth').addEventListener('click', () => command(`/api/sites/${state.site}/smooth`, {}, 'Smoothing has begun.'));
$('rollback').addEventListener('click', () => command(`/api/sites/${state.site}/rollback`, {}, 'The version before is enabled.'));
$('save').addEventListener('click', () => command(`/api/sites/${state.site}/save`, {}, 'The site is saved on the server.'));
$('unlock').addEventListener('click', () => { $('token-wrong').hidden = true; $('token').value = ''; $('token-dialog').showModal(); });
$('token-dialog').querySelector('form').addEventListener('submit', async (event) => {
  if (event.submitter?.value !== 'use') return;
  event.preventDefault();
  const wrong = await useToken($('token').value.trim());
  panels.setText($('token-wrong'), wrong);
  $('token-wrong').hidden = !wrong;
  if (wrong) return;
  $('token-dialog').close();
  say('Commands are unlocked.');
  if (state) show(state);
});

onThemeChange(() => { if (state?.site) show(state); askPaths(); });
document.addEventListener('visibilitychange', () => map?.refresh());
$('fragments').addEventListener('toggle', askPaths);
showFlow();
panels.showEmptyMap(null);
await tokenOfAddress();
// The address with a token, opened where the page is already open: the browser does not load it again.
window.addEventListener('hashchange', async () => {
  await tokenOfAddress();
  if (state) show(state);
});
listen();
setInterval(askPaths, PATH_PERIOD_MS);
