// `duet rate`'s page in a real browser: three raters press keys, export, and `duet agree` reads what they say.
import assert from 'node:assert/strict';
import {after, afterEach, before, test} from 'node:test';
import {execFileSync, spawnSync} from 'node:child_process';
import {readFileSync} from 'node:fs';
import {createRequire} from 'node:module';
import {join} from 'node:path';
import {brightness, closeAll, folder, launch, open, pictures, readPage, spread} from './browser.mjs';

const rating = join(folder, 'rating.html'), html = readFileSync(rating, 'utf8'), program = process.env.DUET_PROGRAM ?? '../build/release/duet';
const axe = createRequire(import.meta.url).resolve('axe-core/axe.min.js');
const rows = readFileSync(join(folder, 'run', 'episodes.jsonl'), 'utf8').trim().split('\n').map((line) => JSON.parse(line));
const keys = readPage(html).header.scenes.map((scene) => scene.id);
let browser;
before(async () => { browser = await launch(); });
afterEach(closeAll);
after(async () => { await browser?.close(); });

async function ready(options = {}) {
  const opened = await open(browser, rating, options);
  await opened.page.waitForFunction(() => document.getElementById('app')?.dataset.ready !== undefined, null, {timeout: 60000});
  return opened;
}

const shown = (page) => page.evaluate(() => document.getElementById('app').dataset.episode);
async function signIn(page, name) {
  await page.getByLabel('Your name').fill(name);
  await page.keyboard.press('Enter');
}
// A key an episode, as a rater does.
async function rate(page, letters) {
  for (const [i, letter] of letters.entries()) {
    assert.equal(await shown(page), keys[i]);
    await page.keyboard.press(letter);
  }
}
async function exported(page, name) {
  const [file] = await Promise.all([page.waitForEvent('download'), page.getByRole('button', {name: /^Export/}).click()]);
  const path = join(folder, `ratings-${name}.csv`);
  await file.saveAs(path);
  return path;
}

test('the page opens from disk without a network, shows a picture and is blind', async () => {
  const {page, errors} = await ready();
  console.log(`rating.html: ${(html.length / 1e6).toFixed(2)} MB, ${keys.length} episodes`);
  assert.ok(keys.length >= 4, 'the run has episodes');
  assert.ok(spread(brightness(await page.locator('.stage canvas').screenshot())) > 8);
  for (let i = 0; i < keys.length; ++i) {
    assert.equal(await shown(page), keys[i]);
    const said = `${await page.title()} ${await page.locator('body').innerText()}`.toLowerCase(), row = rows.find((one) => one.key === keys[i]);
    for (const told of [row.policy, row.engine, row.controller, row.clip, row.key.slice(0, 8), 'success', 'failure', 'null', 'fell', 'html', 'npz'])
      assert.doesNotMatch(said, new RegExp(`\\b${told.toLowerCase()}\\b`));
    await page.locator('h2').focus();
    await page.keyboard.press('ArrowRight');
  }
  assert.deepEqual(errors, []);
  await page.screenshot({path: join(pictures, 'rating.png')});
});

test('nothing can be answered without a name, and a letter of the name is no answer', async () => {
  const {page} = await ready();
  for (const name of ['Yes', 'No', 'Unsure']) assert.ok(await page.getByRole('button', {name, exact: true}).isDisabled());
  await page.getByLabel('Your name').pressSequentially('nyu');
  assert.match(await page.locator('.place').textContent(), /, 0 answered$/);
  assert.equal(await shown(page), keys[0]);
});

test('answers stay when the page is closed, by the name of the rater', async () => {
  const {page, context} = await ready();
  await signIn(page, 'anna');
  await page.keyboard.press('y');
  await page.getByRole('button', {name: 'Unsure', exact: true}).click();
  await page.keyboard.press(' ');
  assert.match(await page.locator('.place').textContent(), /, 2 answered$/, 'space plays and answers nothing');
  const again = await context.newPage();
  await again.goto(`file://${rating}`);
  await again.waitForFunction(() => document.getElementById('app')?.dataset.ready !== undefined);
  assert.equal(await again.getByLabel('Your name').inputValue(), 'anna');
  assert.equal(await shown(again), keys[2], 'it goes on at the first that is not answered');
  await again.locator('h2').focus();
  await again.keyboard.press('ArrowLeft');
  assert.equal(await again.getByRole('button', {name: 'Unsure', exact: true}).getAttribute('aria-pressed'), 'true');
  await signIn(again, 'ben');
  assert.match(await again.locator('.place').textContent(), /, 0 answered$/);
});

test('the same page in two tabs loses no answer of either', async () => {
  const {page, context} = await ready();
  await signIn(page, 'anna');
  const other = await context.newPage();
  await other.goto(`file://${rating}`);
  await other.waitForFunction(() => document.getElementById('app')?.dataset.ready !== undefined);
  await page.keyboard.press('y');
  await other.locator('h2').focus();
  await other.keyboard.press('ArrowRight');
  await other.keyboard.press('n');
  await page.waitForFunction(() => /, 2 answered$/.test(document.querySelector('.place').textContent));
  const text = readFileSync(await exported(page, 'tabs'), 'utf8').trim().split('\n').slice(1);
  assert.deepEqual(text, [`${keys[0]},anna,yes`, `${keys[1]},anna,no`]);
});

test('where the browser keeps nothing, the page asks before answers are lost', async () => {
  const {context} = await ready(), page = await context.newPage(), asked = [];
  await page.addInitScript(() => Object.defineProperty(window, 'localStorage', {get() { throw new Error('denied'); }}));
  page.on('dialog', (dialog) => { asked.push(dialog.type()); void dialog.accept(); });
  await page.goto(`file://${rating}`);
  await page.waitForFunction(() => document.getElementById('app')?.dataset.ready !== undefined);
  await signIn(page, 'anna');
  await page.keyboard.press('y');
  assert.match(await page.locator('[role=status]').textContent(), /keeps no answers: export before/);
  await page.reload();
  assert.deepEqual(asked, ['beforeunload']);
  await page.waitForFunction(() => document.getElementById('app')?.dataset.ready !== undefined);
  await signIn(page, 'anna');
  await page.keyboard.press('y');
  await exported(page, 'denied');
  await page.reload();
  assert.deepEqual(asked, ['beforeunload'], 'what is exported may go');
});

test('three raters export, and duet agree tells how far they agree', async () => {
  const ask = {anna: (i) => (i % 2 ? 'n' : 'y'), 'Ben, B.': (i) => (i === 0 ? 'u' : i % 2 ? 'n' : 'y'), carla: (i) => (i === 1 ? 'y' : i % 2 ? 'n' : 'y')};
  const files = [];
  for (const [i, [name, letter]] of Object.entries(ask).entries()) {
    const {page} = await ready();
    await signIn(page, name);
    await rate(page, keys.map((_, k) => letter(k)));
    assert.match(await page.locator('.place').textContent(), new RegExp(`, ${keys.length} answered$`));
    files.push(await exported(page, i));
  }
  const lines = readFileSync(files[1], 'utf8').trim().split('\n');
  assert.equal(lines[0], 'episode,rater,answer');
  assert.equal(lines[1], `${keys[0]},"Ben, B.",unsure`);
  assert.equal(lines.length, keys.length + 1);
  const answer = JSON.parse(execFileSync(program, ['agree', join(folder, 'run'), ...files, '--json'], {encoding: 'utf8'}));
  assert.deepEqual(answer.raters, ['anna', 'Ben, B.', 'carla']);
  assert.equal(answer.episodes, keys.length);
  assert.deepEqual(answer.disputes.map((one) => one.episode).sort(), [keys[0], keys[1]].sort());
  const agreed = answer.agreement.figures.find((figure) => figure.of === 'anna vs carla' && figure.name === 'agreed');
  assert.equal(agreed.value, (keys.length - 1) / keys.length);
  const detectors = new Set(rows.flatMap((row) => row.verdicts.map((verdict) => `${verdict.version}/${verdict.thresholds}`)));
  assert.ok(detectors.has('interaction/act') && detectors.has('robot/paper'));
  const kappas = answer.agreement.figures.filter((figure) => figure.name === 'kappa');
  for (const detector of ['headline', ...detectors])
    for (const who of [...answer.raters, 'majority']) assert.equal(kappas.filter((one) => one.of === `${detector} vs ${who}`).length, 1);
  for (const one of kappas.filter((figure) => Number.isFinite(figure.value))) assert.ok(one.low <= one.value && one.value <= one.high, one.of);
  const twice = spawnSync(program, ['agree', join(folder, 'run'), files[0], files[0]], {encoding: 'utf8'});
  assert.equal(twice.status, 2);
  assert.match(twice.stderr, /found 'anna' again/);
});

test('the page has no fault that axe finds, in light and dark', async () => {
  for (const colorScheme of ['light', 'dark']) {
    const {page} = await ready({colorScheme});
    await signIn(page, 'anna');
    await page.addScriptTag({path: axe});
    const found = await page.evaluate(() => window.axe.run());
    assert.deepEqual(found.violations.map((one) => `${one.id}: ${one.nodes[0].html}`), []);
  }
});

test('without WebGL nothing can be rated, and the page says so', async () => {
  const bare = await launch(false);
  const opened = await open(bare, rating);
  await opened.page.waitForFunction(() => document.getElementById('app')?.dataset.ready !== undefined);
  await signIn(opened.page, 'anna');
  assert.match(await opened.page.locator('[role=alert]').textContent(), /no WebGL2/);
  assert.ok(await opened.page.getByRole('button', {name: 'Yes', exact: true}).isDisabled());
  await bare.close();
});
