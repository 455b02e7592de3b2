// The HTML report in a real browser: what its first screen answers, how it is searched, and what stays without a script.
import assert from 'node:assert/strict';
import {after, afterEach, before, test} from 'node:test';
import {readFileSync} from 'node:fs';
import {createRequire} from 'node:module';
import {join} from 'node:path';
import {brightness, closeAll, folder, launch, meanOf, open, pictures} from './browser.mjs';

const report = join(folder, 'report.html'), size = readFileSync(report).length;
const axe = createRequire(import.meta.url).resolve('axe-core/axe.min.js');
let browser;
before(async () => { browser = await launch(); });
afterEach(closeAll);
after(async () => { await browser?.close(); });

test('the first screen says which policy, how sure, and whether the engine matters', async () => {
  const begun = performance.now();
  const {page, errors} = await open(browser, report);
  console.log(`report.html: ${(size / 1e6).toFixed(2)} MB, loaded in ${(performance.now() - begun).toFixed(0)} ms, ` +
              `${await page.evaluate(() => document.documentElement.scrollHeight)} pixels high`);
  const height = 1000;
  for (const text of [/[\d.]+ \[[\d.]+, [\d.]+\] % success/, /lift over the best control/, /(in each of the \d+ engines|From engine to engine)/]) {
    const box = await page.locator('.answer p', {hasText: text}).boundingBox();
    assert.ok(box && box.y + box.height < height, String(text));
  }
  const first = await page.locator('table.ranked tbody tr').first().boundingBox();
  assert.ok(first.y + first.height < height, 'the best row stands on the first screen');
  assert.deepEqual(errors, []);
  await page.screenshot({path: join(pictures, 'report.png')});
});

test('the board is in order: competitors by success, then what has no rank', async () => {
  const {page} = await open(browser, report);
  const rows = await page.locator('table.ranked tbody tr').evaluateAll((all) => all.map((row) =>
    ({ranked: row.cells[0].dataset.v !== '', rate: Number(row.cells[2].dataset.v)})));
  assert.ok(rows.some((row) => row.ranked) && rows.some((row) => !row.ranked));
  assert.deepEqual(rows, [...rows].sort((a, b) => Number(b.ranked) - Number(a.ranked) || b.rate - a.rate));
});

test('a number leads to its episodes, and they can be searched', async () => {
  const {page} = await open(browser, report);
  const all = await page.locator('table.rows tbody tr').count();
  await page.locator('table.map tbody td a').first().click();
  assert.ok(await page.locator('table.rows').isVisible());
  const shown = await page.locator('table.rows tbody tr:visible').count();
  assert.ok(shown > 0 && shown < all, `${shown} of ${all}`);
  await page.getByLabel('Search episodes').fill('no such clip');
  assert.equal(await page.locator('table.rows tbody tr:visible').count(), 0);
  assert.match(await page.locator('.finder [role=status]').textContent(), new RegExp(`^0 of ${all}$`));
});

test('failures stand first, and a key leads to its replay', async () => {
  const {page} = await open(browser, report);
  await page.locator('#episodes summary').first().click();
  const verdicts = await page.locator('table.rows tbody tr td:nth-last-child(2)').allTextContents();
  if (verdicts.some((v) => v !== 'success')) assert.notEqual(verdicts[0], 'success');
  const link = page.locator('table.rows td:last-child a').first(), key = await link.textContent();
  await link.click();
  await page.waitForFunction(() => document.getElementById('app')?.dataset.ready !== undefined);
  await page.waitForTimeout(200);
  await page.locator('.verdict summary').click();
  assert.match(await page.locator('.verdict dl').textContent(), new RegExp(key));
});

for (const [width, height] of [[1600, 1000], [1100, 800], [768, 1024], [420, 860]])
  test(`at ${width} pixels the success is in sight`, async () => {
    const {page} = await open(browser, report, {width, height});
    assert.ok(await page.evaluate(() => document.documentElement.scrollWidth) <= width);
    const box = await page.locator('table.ranked tbody tr .rate').first().boundingBox();
    assert.ok(box && box.x >= 0 && box.x + box.width <= width, `the success at ${width}`);
    await page.screenshot({path: join(pictures, `report-${width}.png`)});
  });

test('follows a dark scheme, and prints', async () => {
  const {page} = await open(browser, report, {colorScheme: 'dark'});
  assert.ok(meanOf(brightness(await page.screenshot({path: join(pictures, 'report-dark.png')}))) < 90);
  await page.emulateMedia({media: 'print', colorScheme: 'light'});
  assert.equal(await page.locator('nav').isVisible(), false);
});

for (const scheme of ['light', 'dark'])
  test(`axe finds nothing serious (${scheme})`, async () => {
    const {page} = await open(browser, report, {colorScheme: scheme});
    await page.evaluate(() => document.querySelectorAll('details').forEach((d) => { d.open = true; }));
    await page.addScriptTag({path: axe});
    const found = (await page.evaluate(() => axe.run())).violations.filter((v) => ['serious', 'critical'].includes(v.impact));
    assert.deepEqual(found.map((v) => `${v.id}: ${v.nodes.length}: ${v.nodes[0].html} ${v.nodes[0].failureSummary}`), []);
  });

test('without JavaScript everything is a plain table', async () => {
  const {page} = await open(browser, report, {javaScriptEnabled: false});
  assert.ok(await page.locator('table.ranked tbody tr').first().isVisible());
  await page.locator('#episodes summary').first().click();
  assert.ok(await page.locator('table.rows tbody tr').first().isVisible());
});
