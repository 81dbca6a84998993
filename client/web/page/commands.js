// Commands to the server, for those who have the token. It comes with the address that cairn-web prints (#token=...) or
// from the dialog, and is kept for this tab only.
const KEY = 'cairn-token';
const said = document.getElementById('said');
let timer = 0;

// `stays`: until something else is said.
export function say(text, stays = false) {
  said.textContent = text;
  clearTimeout(timer);
  if (!stays) timer = setTimeout(() => { said.textContent = ''; }, 6000);
}

export const token = () => sessionStorage.getItem(KEY) ?? '';

const post = (path, body, bearer) => fetch(path, {
  method: 'POST', headers: { 'Content-Type': 'application/json', Authorization: `Bearer ${bearer}` }, body: JSON.stringify(body ?? {}),
});

// What is wrong, in words; '' where it is the right one.
export async function useToken(text) {
  let answer = null;
  // Without an answer nobody knows whether it is the right one.
  for (let tries = 0; !answer && tries < 5; ++tries) {
    if (tries > 0) await new Promise((done) => setTimeout(done, 1000));
    answer = await post('/api/token', {}, text).catch(() => null);
  }
  if (!answer) return 'cairn-web does not answer. Try again.';
  if (!answer.ok) return answer.status === 401 ? 'This is not the token.' : `cairn-web does not say whether this is the token (${answer.status}). Try again.`;
  sessionStorage.setItem(KEY, text);
  return '';
}

export async function tokenOfAddress() {
  const match = /[#&]token=([^&]+)/.exec(location.hash);
  if (!match) return;
  history.replaceState(null, '', location.pathname + location.search);
  let text = match[1];
  try { text = decodeURIComponent(text); } catch { /* It holds a % that stands for itself. */ }
  const wrong = await useToken(text);
  if (wrong) say(`Commands stay locked. ${wrong}`);
}

// The answer, or null after it was said what went wrong.
export async function command(path, body, done) {
  const answer = await post(path, body, token()).catch(() => null);
  if (!answer) { say('cairn-web does not answer.'); return null; }
  const json = await answer.json().catch(() => ({}));
  if (!answer.ok) {
    if (answer.status === 401) sessionStorage.removeItem(KEY);
    say(`Not done: ${json.error ?? answer.status}`);
    return null;
  }
  say(done);
  return json;
}
