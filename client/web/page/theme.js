// Light or dark, as the system says, and the colours of robots: eight that people with any colour vision tell apart
// (Okabe and Ito 2008), lighter in the dark.
const dark = window.matchMedia('(prefers-color-scheme: dark)');
const LIGHT = ['#0072b2', '#c65200', '#00805d', '#a8437f', '#8a6500', '#6a51a3', '#1b7fae', '#7a5230'];
const DARK = ['#5db4ef', '#ff9a57', '#3fd0a5', '#ef9ccb', '#ecc04f', '#b7a3e8', '#7fd3f5', '#d3a77c'];
const given = new Map();

export const theme = () => (dark.matches ? 'dark' : 'light');
export const onThemeChange = (act) => dark.addEventListener('change', act);

// A robot keeps its colour as long as the page is open.
export function colourOf(robot) {
  if (!given.has(robot)) given.set(robot, given.size);
  const colours = dark.matches ? DARK : LIGHT;
  return colours[given.get(robot) % colours.length];
}
