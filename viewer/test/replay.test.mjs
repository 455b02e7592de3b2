// `duet replay`'s page in a real browser, as a stranger opens it: from disk, without a network.
import assert from 'node:assert/strict';
import {after, afterEach, before, test} from 'node:test';
import {existsSync, readFileSync, writeFileSync} from 'node:fs';
import {createRequire} from 'node:module';
import {join} from 'node:path';
import {deflateSync} from 'node:zlib';
import {McapStreamReader} from '@mcap/core';
import {decompress as unzstd} from 'fzstd';
import {brightness, closeAll, executable, folder, launch, meanOf, open, pictures, readNpz, readPage, spread} from './browser.mjs';
import {Kinematics, readColumns} from '../../build/web/parts/parts.mjs';

const replay = join(folder, 'replay.html'), html = readFileSync(replay, 'utf8');
const axe = createRequire(import.meta.url).resolve('axe-core/axe.min.js');
let browser;
before(async () => { browser = await launch(); });
afterEach(closeAll);
after(async () => { await browser?.close(); });

async function ready(path = replay, options = {}) {
  const opened = await open(browser, path, options);
  await opened.page.waitForFunction(() => document.getElementById('app')?.dataset.ready !== undefined, null, {timeout: 60000});
  await opened.page.waitForTimeout(150);
  return opened;
}

const attribute = (page, name) => page.evaluate((n) => document.getElementById('app').dataset[n], name);

test('the page opens from disk without a network, complains of nothing and is ready', async () => {
  assert.ok(executable);
  const {page, errors} = await ready();
  console.log(`replay.html: ${(html.length / 1e6).toFixed(2)} MB, ready in ${await attribute(page, 'ready')} ms`);
  assert.deepEqual(errors, []);
  assert.ok(Number(await attribute(page, 'ready')) > 0);
  await page.screenshot({path: join(pictures, 'replay.png')});
});

test('the picture is not empty', async () => {
  const {page} = await ready();
  const picture = brightness(await page.locator('.stage canvas').screenshot());
  assert.ok(spread(picture) > 8, `spread of the brightness ${spread(picture)}`);
});

test('playing draws pictures and moves the clock', async () => {
  const {page} = await ready();
  await page.getByRole('button', {name: 'all', exact: true}).click();
  await page.keyboard.press('Home');
  await page.getByRole('button', {name: 'Play or pause'}).click();
  const before = await page.locator('.clock').textContent();
  await page.waitForFunction(() => document.getElementById('app').dataset.fps !== undefined, null, {timeout: 60000});
  assert.notEqual(await page.locator('.clock').textContent(), before);
  console.log(`${await attribute(page, 'capsules')} capsules at 1440 x 1000, ${await attribute(page, 'fps')} pictures a second`);
});

test('the act plays in a loop when the page opens, until somebody does something', async () => {
  const {page} = await ready(replay, {reducedMotion: 'no-preference'});
  const play = page.getByRole('button', {name: 'Play or pause'});
  assert.equal(await play.textContent(), '❙❙');
  const first = await attribute(page, 'frame');
  await page.waitForFunction((frame) => document.getElementById('app').dataset.frame !== frame, first, {timeout: 60000});
  await page.keyboard.press('End');
  assert.equal(await play.textContent(), '▶');
  const shared = await ready(replay, {reducedMotion: 'no-preference', hash: await page.evaluate(() => location.hash)});
  assert.equal(await shared.page.getByRole('button', {name: 'Play or pause'}).textContent(), '▶', 'a link to an instant stays there');
});

test('the title names task, clip and verdict; the lines of the detector have names and limits', async () => {
  const {page} = await ready(), {header} = readPage(html), scene = header.scenes[0];
  const title = await page.locator('h1').textContent();
  assert.match(title.toLowerCase(), new RegExp(`^${scene.task.replaceAll('_', ' ')}, ${scene.name}: (success|failure|not judged)`));
  assert.ok(title.includes(header.title), title);
  const legend = await page.locator('.strip', {hasText: 'detector'}).locator('.legend li').allTextContents();
  const names = scene.tracks[0].detectors[0].names.map((name) => name.replaceAll('_', ' '));
  assert.deepEqual(legend.map((text) => text.replace(/ \(limit .*\)$/, '')), names);
  assert.ok(legend.some((text) => /\(limit [\d.]+ \S+\)$/.test(text)), legend.join('; '));
});

test('a failure says by how much, and of which limit', async () => {
  const {header} = readPage(html), tracks = header.scenes[0].tracks;
  const index = tracks.findIndex((track) => track.row.success === false && track.detectors[0]);
  assert.ok(index >= 0, 'the null arm fails');
  const {page} = await ready(replay, {hash: `#e=${encodeURIComponent(header.scenes[0].id)}&f=${index}&t=0`});
  assert.match(await page.locator('.why').first().textContent(), /[a-z ]+ short by [\d.]+ \S+ \(limit [\d.]+ \S+\)/);
});

// Lowest point of a robot's feet, and how far the shins end above it, at a frame.
function feetOf(track, robot, bytes, frame) {
  const motion = {};
  for (const name of ['position', 'turn', 'q']) motion[name] = readColumns(bytes, track.motion[name]);
  const kinematics = new Kinematics(robot);
  assert.ok(kinematics.update(motion, frame));
  return robot.outline.hulls.filter((hull) => hull.foot).map((hull) =>
    Math.min(...hull.spheres.map(([x, y, z, r]) => kinematics.point(hull.link, [x, y, z], [0, 0, 0])[2] - r)));
}

test('the robot stands on its feet', async () => {
  const {header, bytes} = readPage(html), track = header.scenes[0].tracks[0], robot = header.robots[track.robot];
  const feet = feetOf(track, robot, bytes, 0);
  assert.equal(feet.length, 2);
  for (const lowest of feet) assert.ok(Math.abs(lowest) < 0.01, `a foot ends ${lowest} m above the floor`);
});

for (const [name, robots] of [['clip', false], ['paired', true]])
  test(`a ${name} is shown with both people${robots ? ', the robot and the adapted partner' : ''}`, async () => {
    const file = join(folder, `${name}.html`), {header} = readPage(readFileSync(file, 'utf8'));
    const tracks = header.scenes[0].tracks;
    assert.equal(tracks.length, robots ? 2 : 1);
    assert.equal(tracks.at(-1).robot, -1);
    assert.ok(tracks.at(-1).partner >= 0 && tracks.at(-1).other_person >= 0);
    const {page, errors} = await ready(file);
    assert.ok(Number(await attribute(page, 'capsules')) > (robots ? 60 : 30), await attribute(page, 'capsules'));
    const picture = brightness(await page.locator('.stage canvas').screenshot());
    assert.ok(spread(picture) > 8, `spread of the brightness ${spread(picture)}`);
    await page.screenshot({path: join(pictures, `motion-${name}.png`)});
    for (const key of ['g', 'r', 'ArrowDown', ']', 'End', 'h', '3']) await page.keyboard.press(key);
    await page.waitForTimeout(150);
    await page.screenshot({path: join(pictures, `motion-${name}-grid.png`)});
    assert.deepEqual(errors, []);
  });

// A point of a frame, in the world.
function placed({translation: p, rotation: {x, y, z, w}}, [a, b, c]) {
  const [u, v, t] = [2 * (y * c - z * b), 2 * (z * a - x * c), 2 * (x * b - y * a)];
  return [p.x + a + w * u + y * t - z * v, p.y + b + w * v + z * u - x * t, p.z + c + w * t + x * v - y * u];
}

// Both ends of each capsule, against MCAP's transforms, which C++ made (rounded to 0.01 mm).
test('links are where C++ has them, to 0.1 mm', async () => {
  const {header, bytes} = readPage(html), reader = new McapStreamReader({decompressHandlers: {zstd: (packed, size) => unzstd(packed, new Uint8Array(Number(size)))}});
  const tracks = new Map(header.scenes.flatMap((scene) => scene.tracks.map((track) => [`/${scene.id}/${track.name}/where`, track])));
  reader.append(readFileSync(join(folder, 'replay.mcap')));
  const channels = new Map();
  let worst = 0, compared = 0;
  for (let record; (record = reader.nextRecord());) {
    if (record.type === 'Channel') channels.set(record.id, record.topic);
    if (record.type !== 'Message') continue;
    const track = tracks.get(channels.get(record.channelId));
    if (!track || record.sequence % 40 !== 0) continue;
    const robot = header.robots[track.robot], motion = {};
    for (const name of ['position', 'turn', 'q']) motion[name] = readColumns(bytes, track.motion[name]);
    const kinematics = new Kinematics(robot);
    assert.ok(kinematics.update(motion, record.sequence));
    const links = JSON.parse(new TextDecoder().decode(record.data)).transforms;
    for (const shape of robot.shapes) {
      for (const side of shape.half_length > 0 ? [-1, 1] : [0]) {
        const [w, x, y, z] = shape.quat_wxyz, d = side * shape.half_length;
        const end = [shape.p[0] + d * 2 * (x * z + w * y), shape.p[1] + d * 2 * (y * z - w * x), shape.p[2] + d * (1 - 2 * (x * x + y * y))];
        const here = kinematics.point(shape.link, end, [0, 0, 0]), there = placed(links[shape.link], end);
        worst = Math.max(worst, Math.hypot(here[0] - there[0], here[1] - there[1], here[2] - there[2]));
        ++compared;
      }
    }
  }
  console.log(`forward kinematics: ${compared} points, at most ${(1000 * worst).toFixed(4)} mm from C++`);
  assert.ok(compared > 500);
  assert.ok(worst < 1e-4, `${1000 * worst} mm`);
});

test('scrubbing to a touch shows the force that the recording has', async () => {
  const {header} = readPage(html);
  let checked = 0;
  for (const [index, track] of header.scenes[0].tracks.entries()) {
    const npz = join(folder, 'run/trajectories', `${track.row.key.slice(0, 16)}.npz`);
    if (!existsSync(npz)) continue;
    const arrays = readNpz(npz), forces = new Float64Array(track.frames);
    for (let i = 0; i < arrays.contact_frame.values.length; ++i)
      if (Number(arrays.contact_side.values[i]) === 1)
        forces[Number(arrays.contact_frame.values[i])] += Math.hypot(...arrays.contact_force.values.subarray(3 * i, 3 * i + 3));
    const strongest = forces.indexOf(Math.max(...forces));
    if (forces[strongest] < 5) continue;
    const seconds = (strongest - track.act[0]) / track.rate_hz;
    const {page, context} = await ready(replay, {hash: `#e=${encodeURIComponent(header.scenes[0].id)}&f=${index}&v=${index}&t=${seconds.toFixed(2)}`});
    assert.equal(Number(await attribute(page, 'frame')), strongest);
    const strip = page.locator('.strip', {hasText: 'partner force'}).locator('.value');
    assert.ok(Math.abs(parseFloat(await strip.textContent()) - forces[strongest]) < 0.3, `${await strip.textContent()} and ${forces[strongest]} N`);
    assert.match(await page.locator('.overlay .force').first().textContent(), /^[\d.]+ N [a-z ]+$/);
    if (++checked === 1) await page.screenshot({path: join(pictures, 'replay-touch.png')});
    await context.close();
    if (checked === 2) break;
  }
  assert.ok(checked > 0, 'no track of the run touches the partner');
});

test('everything is done by the keyboard, and the address keeps it', async () => {
  const {page, errors} = await ready();
  await page.keyboard.press('Home');
  const first = Number(await attribute(page, 'frame'));
  for (let i = 0; i < 7; ++i) await page.keyboard.press('ArrowRight');
  await page.waitForTimeout(150);
  assert.equal(Number(await attribute(page, 'frame')), first + 7);
  await page.keyboard.press('g');
  await page.keyboard.press('r');
  await page.keyboard.press('2');
  await page.keyboard.press('ArrowDown');
  await page.keyboard.press(']');
  await page.keyboard.press('s');
  const hash = await page.evaluate(() => location.hash), frame = await attribute(page, 'frame');
  for (const part of ['g=1', 'r=1', 'f=1', 's=0.5', 'c=']) assert.ok(hash.includes(part), `${part} in ${hash}`);
  await page.reload();
  await page.waitForFunction(() => document.getElementById('app')?.dataset.frame !== undefined);
  await page.waitForTimeout(200);
  assert.equal(await page.evaluate(() => location.hash), hash);
  assert.equal(await attribute(page, 'frame'), frame);
  await page.screenshot({path: join(pictures, 'replay-grid.png')});
  await page.keyboard.press('?');
  assert.ok(await page.locator('dialog[open]').isVisible());
  await page.keyboard.press('Escape');
  let reached = false;
  for (let i = 0; i < 8 && !reached; ++i) {
    await page.keyboard.press('Tab');
    reached = await page.evaluate(() => document.activeElement?.getAttribute('aria-label') === 'Play or pause');
  }
  assert.ok(reached, 'Tab reaches the play button');
  await page.keyboard.press('Space');
  await page.waitForTimeout(300);
  assert.equal(await page.evaluate(() => document.activeElement.textContent), '❙❙');
  assert.deepEqual(errors, []);
});

for (const [width, height] of [[1600, 1000], [1100, 800], [768, 1024], [420, 860]])
  test(`at ${width} pixels nothing is cut off`, async () => {
    const {page} = await ready(replay, {width, height});
    assert.ok(await page.evaluate(() => document.documentElement.scrollWidth) <= width);
    for (const name of ['.verdict h2', '.clock', '.slider', '.stage']) {
      const box = await page.locator(name).boundingBox();
      assert.ok(box && box.x >= 0 && box.x + box.width <= width + 0.5, `${name} at ${width}`);
    }
    await page.screenshot({path: join(pictures, `replay-${width}.png`), fullPage: width < 800});
  });

test('follows a dark scheme', async () => {
  const {page} = await ready(replay, {colorScheme: 'dark'});
  const png = await page.screenshot({path: join(pictures, 'replay-dark.png')});
  assert.ok(meanOf(brightness(png)) < 90);
});

for (const scheme of ['light', 'dark'])
  test(`axe finds nothing serious (${scheme})`, async () => {
    const {page} = await ready(replay, {colorScheme: scheme});
    await page.addScriptTag({path: axe});
    const found = (await page.evaluate(() => axe.run())).violations.filter((v) => ['serious', 'critical'].includes(v.impact));
    assert.deepEqual(found.map((v) => `${v.id}: ${v.nodes[0].html} ${v.nodes[0].failureSummary}`), []);
  });

test('without WebGL it says so, and strips and table stay', async () => {
  const plain = await launch(false);
  try {
    const {page, errors} = await open(plain, replay);
    await page.waitForFunction(() => document.getElementById('app')?.dataset.ready !== undefined);
    assert.match(await page.locator('[role=alert]').textContent(), /no WebGL2/);
    assert.ok(await page.locator('.strip canvas').first().isVisible());
    assert.ok(await page.locator('#all-episodes tbody tr').count() > 0);
    assert.deepEqual(errors.filter((text) => !/webgl/i.test(text)), []);
  } finally {
    await plain.close();
  }
});

test('without JavaScript the table stays', async () => {
  const {page} = await open(browser, replay, {javaScriptEnabled: false});
  assert.ok(await page.locator('#all-episodes tbody tr').first().isVisible());
  assert.match(await page.locator('noscript').textContent(), /JavaScript/);
});

function withData(change) {
  const {header, bytes, packed} = readPage(html);
  change(header);
  const text = Buffer.from(JSON.stringify(header)), size = Buffer.alloc(4);
  size.writeUInt32LE(text.length);
  return html.replace(packed, deflateSync(Buffer.concat([size, text, Buffer.from(bytes)])).toString('base64'));
}

test('data of another schema, and damaged data, are refused in a sentence', async () => {
  const other = join(folder, 'other.html');
  for (const [text, expected] of [[withData((h) => { h.schema = 'duet.replay/2'; }), /schema "duet\.replay\/2", and its viewer reads duet\.replay\/1/],
                                  [html.replace(readPage(html).packed, 'AAAA'), /the data of this page is damaged/]]) {
    writeFileSync(other, text);
    const {page} = await ready(other);
    assert.match(await page.locator('[role=alert]').textContent(), expected);
    assert.ok(await page.locator('#all-episodes tbody tr').first().isVisible());
  }
});

test('markup in names is text', async () => {
  const evil = '<img src=x onerror="document.title=\'owned\'">', path = join(folder, 'markup.html');
  writeFileSync(path, withData((header) => {
    header.title = evil;
    for (const scene of header.scenes) {
      scene.name = scene.task = evil;
      for (const track of scene.tracks) Object.assign(track, {name: evil, repeat: evil, origin: evil, message: evil, outcome: evil});
    }
  }));
  const {page} = await ready(path);
  assert.notEqual(await page.title(), 'owned');
  assert.equal(await page.locator('img').count(), 0);
  assert.ok(await page.locator('.who', {hasText: '<img src=x'}).isVisible());
});
