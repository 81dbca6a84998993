// What a person does with the page, in a headless Chromium against real programs: opens it, sees a robot move and the
// map grow, unlocks commands, starts a job, sees the smoothed map, downloads it, and lives through a restart of the
// server. It waits for conditions, never for a time. With PICTURES it leaves the pictures of the documentation.
import { spawn } from 'node:child_process';
import { mkdtempSync, readFileSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { chromium } from 'playwright-core';

const { CAIRN_BIN: bin, CHROMIUM: executablePath, PICTURES: pictures } = process.env;
// A domain that other tests are unlikely to use: they take 1 to 200.
const domain = String(201 + (process.pid % 30));
const state = mkdtempSync(join(tmpdir(), 'cairn-browser-'));
const children = [];
let steps = 0;

function start(program, ...options) {
  const child = spawn(join(bin, program), ['--domain', domain, ...options], { stdio: ['ignore', 'pipe', 'pipe'] });
  child.text = '';
  for (const stream of [child.stdout, child.stderr]) stream.on('data', (data) => { child.text = (child.text + data).slice(-20000); });
  child.ended = new Promise((resolve) => { child.on('exit', resolve); });
  children.push(child);
  return child;
}

async function stop(child, signal = 'SIGTERM') {
  child.kill(signal);
  await child.ended;
}

async function eventually(what, condition, deadlineMs = 30000) {
  for (const end = Date.now() + deadlineMs; Date.now() < end; await new Promise((resolve) => { setTimeout(resolve, 50); })) {
    if (await condition()) { ++steps; console.log(`ok: ${what}`); return; }
  }
  throw new Error(`not within ${deadlineMs / 1000} s: ${what}`);
}

const startServer = () => start('cairnd', '--state', state, '--set', 'slam.particles=20', '--log-level', 'warn');

let browser = null;
try {
  let server = startServer();
  const web = start('cairn-web', '--port', '0', '--token', 'of-the-test');
  await eventually('cairn-web prints its address', () => /http:\S+/.test(web.text));
  const address = /http:\/\/[0-9.:]+\//.exec(web.text)[0];

  browser = await chromium.launch({ executablePath, args: ['--no-sandbox', '--disable-gpu'] });
  const context = await browser.newContext({ viewport: { width: 1280, height: 800 }, colorScheme: 'light', acceptDownloads: true });
  const page = await context.newPage();
  const errors = [], outside = [];
  page.on('pageerror', (error) => errors.push(error.message));
  page.on('console', (message) => { if (message.type() === 'error' && /Content Security|Uncaught/.test(message.text())) errors.push(message.text()); });
  page.on('request', (request) => { if (!request.url().startsWith(address) && !request.url().startsWith('data:')) outside.push(request.url()); });
  const text = (selector) => page.locator(selector).innerText();

  await page.goto(address);
  await eventually('without a robot the page says what to do', async () => /No site yet/.test(await text('#map-empty')));

  const seconds = pictures ? '60' : '25';
  const sim = start('cairn', 'sim', '--site', 'hall', '--world', 'building', '--robots', '2', '--beams', '181', '--hz', '5', '--seconds', seconds, '--rate', pictures ? '4' : '3', '--window', '32');
  await eventually('both robots are listed', async () => await page.locator('#robots .robot').count() === 2);
  await eventually('a robot is on the map', () => page.locator('.robot-icon[data-robot=robot1]').isVisible());
  const place = () => page.locator('.robot-icon[data-robot=robot1]').evaluate((icon) => icon.style.transform);
  const where = await text('#robots .robot .where');
  await eventually('it moves', async () => await text('#robots .robot .where') !== where);
  const tiles = () => page.locator('#map img.cell:not([hidden])').evaluateAll((all) => all.filter((tile) => tile.complete && tile.naturalWidth === 128).map((tile) => tile.src));
  await eventually('tiles of the map are shown', async () => (await tiles()).length > 0);
  const firstTiles = (await tiles()).join();
  await eventually('the map grows', async () => (await tiles()).join() !== firstTiles);
  await eventually('its path is drawn', async () => page.locator('#map path').evaluateAll((all) => all.some((path) => path.getAttribute('d').length > 60)));

  await page.getByRole('button', { name: 'Unlock commands' }).click();
  await page.getByLabel('Token').fill('wrong');
  await page.getByRole('button', { name: 'Unlock', exact: true }).click();
  await eventually('a wrong token is refused', () => page.locator('#token-wrong').isVisible());
  await page.getByLabel('Token').fill('of-the-test');
  await page.keyboard.press('Enter');
  await eventually('the right one unlocks', async () => page.locator('#smooth').isEnabled());

  await sim.ended;
  if (sim.exitCode !== 0) throw new Error(`cairn sim: ${sim.text}`);
  const before = (await tiles()).join();
  await page.getByRole('button', { name: /Smooth paths/ }).click();
  await eventually('the job is listed and ends', async () => /Done/.test(await text('#jobs')), 60000);
  await eventually('its map version is enabled', async () => /Version 2[^]*Enabled/.test(await text('#versions')));
  await eventually('the map has changed', async () => (await tiles()).length > 0 && (await tiles()).join() !== before);

  const [download] = await Promise.all([page.waitForEvent('download'), page.locator('#download-yaml').click()]);
  const yaml = readFileSync(await download.path(), 'utf8');
  await eventually('the map is downloaded', () => /resolution: 0.05/.test(yaml) && /image: "hall.png"/.test(yaml));

  if (pictures) {
    await page.locator('#fit').click();
    await page.evaluate(() => { document.activeElement.blur(); document.getElementById('said').textContent = ''; });
    const shot = async (name, size, colorScheme) => {
      await page.emulateMedia({ colorScheme });
      await page.setViewportSize(size);
      await page.locator('#fit').click();
      await page.waitForLoadState('networkidle', { timeout: 1500 }).catch(() => {});
      await eventually(`tiles for ${name}`, async () => (await tiles()).length > 0 && (await tiles()).every((tile) => tile.includes(colorScheme)));
      await page.screenshot({ path: join(pictures, name), scale: 'css' });
    };
    await shot('page-light.png', { width: 1280, height: 800 }, 'light');
    await shot('page-dark.png', { width: 1280, height: 800 }, 'dark');
    await page.locator('#legend').evaluate((legend) => { legend.open = false; });
    await shot('page-phone.png', { width: 390, height: 800 }, 'light');
    await page.emulateMedia({ colorScheme: 'light' });
    await page.setViewportSize({ width: 1280, height: 800 });
  }
  await place();

  await stop(server, 'SIGKILL');
  await eventually('the loss of the server is said', async () => /Server lost/.test(await text('#connection')) && page.locator('#banner').isVisible());
  await eventually('the last map stays', async () => (await tiles()).length > 0);
  server = startServer();
  await eventually('the page goes on when it is back', async () => /Live/.test(await text('#connection')), 60000);
  await eventually('and shows the map', async () => (await tiles()).length > 0);
  if (errors.length > 0) throw new Error(`errors of the page: ${errors.join('; ')}`);
  if (outside.length > 0) throw new Error(`asked for from outside: ${outside.join(' ')}`);
  console.log(`${steps} steps passed`);
} catch (error) {
  console.error(`FAILED: ${error.message}`);
  for (const child of children) if (child.text) console.error(`--- ${child.spawnfile.split('/').pop()}:\n${child.text.slice(-1500)}`);
  process.exitCode = 1;
} finally {
  await browser?.close();
  for (const child of children) child.kill('SIGKILL');
  rmSync(state, { recursive: true, force: true });
}
