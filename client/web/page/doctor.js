// Why robots are not on the map, or what else is wrong: what `cairn ros2 doctor` says, in the same words, and robots that have no session. Names
// in it come from the network, so everything is set as text.
import { counted, element, keyed, setText } from '/panels.js';

const $ = (id) => document.getElementById(id);

function texts(list, items) {
  list.hidden = items.length === 0;
  keyed(list, items.map((text, index) => [index, text]), ([index]) => index, () => element('li'), (item, [, text]) => setText(item, text));
}

// Topics change all the time, so that they are not read aloud by themselves; how many robots are missing is.
function summary(ros2, strays) {
  const missing = (ros2?.namespaces ?? []).filter((one) => !one.on_map).length + strays.length;
  const all = (ros2?.namespaces.length ?? 0) + strays.length;
  if (all === 0) return '';
  return missing === 0 ? 'Every robot that is seen here is on the map.' : `${missing} of ${all} seen here ${missing === 1 ? 'is' : 'are'} not on the map.`;
}

function makeNamespace() {
  const item = element('li', 'finding');
  element('span', 'title', item);
  element('span', 'pill', item);
  element('span', 'detail', item);
  element('ol', 'problems', item);
  const details = element('details', '', item);
  element('summary', '', details);
  element('ul', 'topics', details);
  return item;
}

function showNamespace(item, one) {
  setText(item.querySelector('.title'), one.name);
  const pill = item.querySelector('.pill');
  const [look, state] = !one.on_map ? ['bad', 'Not on the map'] : one.problems.length === 0 ? ['good', 'On the map'] : ['warn', 'On the map, but:'];
  pill.className = `pill ${look}`;
  setText(pill, state);
  setText(item.querySelector('.detail'), one.who);
  texts(item.querySelector('.problems'), one.problems);
  const summary = item.querySelector('summary');
  setText(summary, `Topics (${one.topics.length})`);
  summary.setAttribute('aria-label', `${one.topics.length} topics of ${one.name}`);
  texts(item.querySelector('.topics'), one.topics);
}

// `doctor`: { ros2: null where the server has no door for ROS 2, strays }.
export function showDoctor(doctor) {
  const { ros2, strays } = doctor;
  $('doctor').hidden = !ros2 && strays.length === 0;
  setText($('doctor-summary'), summary(ros2, strays));
  setText($('doctor-where'), ros2 ? `${ros2.where}${ros2.advice ? `: ${ros2.advice}` : ''}` : '');
  texts($('doctor-problems'), ros2?.problems ?? []);
  const namespaces = ros2?.namespaces ?? [];
  $('doctor-namespaces').hidden = namespaces.length === 0;
  keyed($('doctor-namespaces'), namespaces, (one) => one.name, makeNamespace, showNamespace);
  $('doctor-strays').hidden = strays.length === 0;
  keyed($('doctor-strays'), strays.map((stray, index) => ({ ...stray, index })), (stray) => stray.index, () => {
    const item = element('li', 'finding');
    element('span', 'title', item);
    setText(element('span', 'pill bad', item), 'Not on the map');
    element('span', 'detail', item);
    return item;
  }, (item, stray) => {
    setText(item.querySelector('.title'), stray.robot);
    setText(item.querySelector('.detail'), `${stray.why} (${counted(stray.dropped, 'scan')} dropped)`);
  });
}
