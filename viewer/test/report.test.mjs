// The HTML report in a real browser: what its first screen answers, that its tables are those of the text, how it is sorted
// and searched, what it draws, and what stays without a script.
import assert from 'node:assert/strict';
import {after, afterEach, before, test} from 'node:test';
import {readFileSync, readdirSync} from 'node:fs';
import {createRequire} from 'node:module';
import {join, resolve} from 'node:path';
import {pathToFileURL} from 'node:url';
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
    ({ranked: row.cells[0].textContent !== '-', rate: parseFloat(row.cells[3].textContent)})));
  assert.ok(rows.some((row) => row.ranked) && rows.some((row) => !row.ranked));
  assert.deepEqual(rows, [...rows].sort((a, b) => Number(b.ranked) - Number(a.ranked) || b.rate - a.rate));
});

// Tables of a Markdown text: lists of rows of cells, the header first.
function tablesOf(markdown) {
  const tables = [];
  let open = false;
  for (const line of markdown.split('\n')) {
    const split = line.startsWith('|') ? line.slice(1, -1).split(/(?<!\\)\|/) : null;
    const cells = split?.map((cell) => cell.trim().replaceAll('\\|', '|').replaceAll('&lt;', '<')) ?? null;
    if (cells && !open) tables.push([]);
    open = cells !== null;
    if (cells && !cells.every((cell) => /^:?-+:?$/.test(cell))) tables.at(-1).push(cells);
  }
  return tables;
}

for (const javaScriptEnabled of [true, false])
  test(`every table has the cells of the text report (${javaScriptEnabled ? 'with' : 'without'} a script)`, async () => {
    const {page} = await open(browser, report, {javaScriptEnabled});
    const names = readdirSync(folder).filter((name) => name.endsWith('.md')).map((name) => name.slice(0, -3));
    assert.ok(names.includes('board') && names.includes('leaderboard') && names.length > 4, String(names));
    let compared = 0;
    for (const name of names) {
      const expected = tablesOf(readFileSync(join(folder, `${name}.md`), 'utf8'));
      // A metric shows its title; its name is that title's tip. An axis, a bar and links stand beside the text of a cell.
      const found = await page.locator(`#${name} table:not(.map)`).evaluateAll((tables) => {
        const textOf = (cell) => cell.querySelector('span[title]')?.title ?? (cell.querySelector(':scope > svg + .ci') ?? cell).textContent;
        return tables.map((table) => Array.from(table.rows, (row) => Array.from(row.cells, textOf)));
      });
      assert.deepEqual(found, expected, name);
      compared += found.length;
    }
    assert.ok(compared > names.length, `${compared} tables`);
  });

test('any column sorts, numbers as numbers and what has none last', async () => {
  const {page} = await open(browser, report);
  await page.locator('#leaderboard summary').first().click();
  const head = page.locator('#leaderboard table').first().locator('thead th', {hasText: 'Overall'});
  const column = await head.evaluate((th) => th.cellIndex);
  const rows = page.locator('#leaderboard table').first().locator('tbody tr');
  const values = () => rows.evaluateAll((all, at) => all.map((row) => parseFloat(row.cells[at].textContent)), column);
  await head.getByRole('button').click();
  assert.equal(await head.getAttribute('aria-sort'), 'descending');
  assert.deepEqual(await values(), (await values()).sort((a, b) => b - a));
  await head.getByRole('button').press('Enter');
  assert.equal(await head.getAttribute('aria-sort'), 'ascending');
  assert.deepEqual(await values(), (await values()).sort((a, b) => a - b));
});

test('axes and bars stand where the printed numbers are', async () => {
  const {page} = await open(browser, report);
  const rows = await page.locator('table.ranked tbody tr').evaluateAll((all) => all.map((row) => ({
    printed: parseFloat(row.cells[3].textContent), low: Number(/\[([\d.]+)/.exec(row.cells[3].textContent)[1]),
    mean: Number(row.querySelector('.axis .m').getAttribute('x1')), begin: Number(row.querySelector('.axis .b').getAttribute('x')),
    dots: row.querySelectorAll('.axis circle').length, named: row.querySelector('.axis + .ci').textContent.split(', ').length})));
  const x = (percent) => 8 + percent / 100 * 284;
  for (const row of rows) {
    assert.ok(Math.abs(row.mean - x(row.printed)) < 0.3 && Math.abs(row.begin - x(row.low)) < 0.3, JSON.stringify(row));
    assert.equal(row.dots, row.named);
  }
  assert.ok(rows.length > 1);
  await page.locator('#leaderboard summary').first().click();
  const bars = await page.locator('#leaderboard td svg.bar').evaluateAll((all) => all.map((bar) => ({
    printed: parseFloat(bar.parentElement.textContent), width: Number(bar.getAttribute('width')),
    dot: Number(bar.querySelector('.dot').getAttribute('cx'))})));
  assert.ok(bars.length > 4);
  for (const bar of bars) assert.ok(Math.abs(bar.dot - (5 + bar.printed / 100 * (bar.width - 10))) < 0.2, JSON.stringify(bar));
});

test('plots of the data are drawn and told: losses of clips, steps, the success in each engine', async () => {
  const {page, errors} = await open(browser, report);
  await page.evaluate(() => document.querySelectorAll('details').forEach((d) => { d.open = true; }));
  const figures = page.locator('figure[data-plot]'), count = await figures.count();
  assert.ok(count > 0);
  const data = await page.evaluate(() => JSON.parse(document.getElementById('duet-report').textContent));
  assert.equal(data.plots.length, count);
  for (let i = 0; i < count; ++i) {
    await figures.nth(i).scrollIntoViewIfNeeded();
    const svg = figures.nth(i).locator('svg');
    await svg.waitFor();
    const plot = data.plots[await figures.nth(i).getAttribute('data-plot')], label = await svg.getAttribute('aria-label');
    for (const series of plot.series) assert.ok(label.includes(`${series.name} from `), label);
    const paths = await svg.locator('path[stroke-dasharray]').evaluateAll((all) => all.map((path) => path.getAttribute('d')));
    assert.ok(paths.length >= plot.series.length && paths.every((d) => !/NaN|Infinity/.test(d)));
  }
  assert.ok(await page.locator('#engines figure img').evaluate((img) => img.naturalWidth > 300 && img.alt.length > 20));
  assert.ok(await page.locator('article.clip svg.stage').first().isVisible());
  await figures.first().screenshot({path: join(pictures, 'report-plot.png')});
  assert.deepEqual(errors, []);
});

test('an axis ends at round ticks, whole decades for a loss that falls far', async () => {
  const {Axis, niceStep, curvesOf, heightAxis, pathOf} = await import(pathToFileURL(resolve(folder, 'parts', 'parts.mjs')));
  assert.deepEqual([2, 0.1, 3.1, 0.06].map((raw) => +niceStep(raw).toPrecision(3)), [2, 0.1, 5, 0.1]);
  const plain = new Axis(0, 100);
  for (const value of [0.3, 9.7]) plain.take(value);
  plain.round(5);
  assert.deepEqual(plain.ticks(), [0, 2, 4, 6, 8, 10]);
  assert.deepEqual([plain.at(5), plain.label(2), plain.label(12000), plain.label(3e6), plain.label(0)], [50, '2', '12k', '3M', '0']);
  const decades = new Axis(100, 0, true);
  for (const value of [3e-5, 0.2]) decades.take(value);
  decades.round(20);
  assert.equal(decades.ticks().length, 6); // 1e-5 to 1
  assert.deepEqual([decades.at(1), decades.label(1e-5), decades.label(0.01), decades.label(1)], [0, '1e-5', '0.01', '1']);
  const lossOf = (...y) => ({title: '', x_label: '', y_label: '', loss: true, series: [{name: 'total', x: y.map((_, i) => i), y}]});
  const logarithmic = (plot) => heightAxis(plot, curvesOf(plot)).logarithmic;
  assert.deepEqual([lossOf(100, 1, 0.5), lossOf(3, 2, 1), lossOf(-3, 200), lossOf(0, 0)].map(logarithmic), [true, false, false, false]);
  for (const value of [0, 1e-9, -3, 5e7]) { // one value alone has an axis, too
    const plot = {...lossOf(value, null, value), loss: false}, curves = curvesOf(plot), y = heightAxis(plot, curves), x = new Axis(0, 1);
    for (const at of [0, 2]) x.take(at);
    assert.ok(y.ticks().length > 1 && y.ticks().every((tick) => !/NaN|Infinity/.test(y.label(tick))), String(value));
    const path = pathOf(curves[0], x, y);
    assert.ok(path.split('M').length === 3 && !/NaN|Infinity/.test(path), path); // interrupted
  }
  const terms = {...lossOf(4, 2), series: [{name: 'small', x: [0, 1], y: [1, 1]}, {name: 'large', y: [3, 3]}, {name: 'total', y: [4, 2]}]};
  assert.deepEqual(curvesOf(terms).map((curve) => curve.name), ['total', 'large', 'small']);
});

test('clips of one task can be chosen', async () => {
  const {page} = await open(browser, report);
  await page.locator('#clips summary').first().click();
  const all = await page.locator('article.clip').count();
  await page.locator('.filter button', {hasText: 'Hug'}).click();
  const shown = await page.locator('article.clip:visible').count();
  assert.ok(shown > 0 && shown < all, `${shown} of ${all}`);
});

test('a number leads to its episodes, and they can be searched', async () => {
  const {page} = await open(browser, report);
  const all = await page.locator('#episodes table tbody tr').count();
  await page.locator('table.map tbody td a').first().click();
  assert.ok(await page.locator('#episodes table').isVisible());
  const shown = await page.locator('#episodes table tbody tr:visible').count();
  assert.ok(shown > 0 && shown < all, `${shown} of ${all}`);
  await page.getByLabel('Search episodes').fill('no such clip');
  assert.equal(await page.locator('#episodes table tbody tr:visible').count(), 0);
  assert.match(await page.locator('.finder [role=status]').textContent(), new RegExp(`^0 of ${all}$`));
});

test('failures stand first, and a key leads to its replay', async () => {
  const {page} = await open(browser, report);
  await page.locator('#episodes summary').first().click();
  const verdicts = await page.locator('#episodes table tbody tr td:nth-last-child(2)').allTextContents();
  if (verdicts.some((v) => v !== 'success')) assert.notEqual(verdicts[0], 'success');
  const link = page.locator('#episodes table td:last-child a').first(), key = await link.textContent();
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

test('without JavaScript everything is a plain table, and says what is left out', async () => {
  const {page} = await open(browser, report, {javaScriptEnabled: false});
  assert.ok(await page.locator('#board tbody tr').first().isVisible());
  await page.locator('#episodes summary').first().click();
  assert.ok(await page.locator('#episodes tbody tr').first().isVisible());
  assert.match(await page.locator('noscript').textContent(), /JavaScript/);
});
