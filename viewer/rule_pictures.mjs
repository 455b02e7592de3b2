// node rule_pictures.mjs PAGE CHOICE.json FOLDER: of each episode that CHOICE names one frame of a replay page, TASK-right.png and
// TASK-wrong.png, small and with few colours. Fails above 60 kB a picture. `./run pictures` calls it.
import {spawnSync} from 'node:child_process';
import {readFileSync, statSync, writeFileSync} from 'node:fs';
import {join, resolve} from 'node:path';
import {launch, open, readPage} from './test/browser.mjs';

const [file, choice, out] = process.argv.slice(2), MOST = 60_000; // bytes
const {tasks} = JSON.parse(readFileSync(choice, 'utf8')), {header} = readPage(readFileSync(file, 'utf8'));
const BARE = 'header,footer,aside,.bar,.slide,.strips,.overlay{display:none!important}#app{display:block;padding:0;max-width:none}' +
             '.stage{height:100vh;border:0;border-radius:0}';

// The track of an episode, by clip and policy.
function found({clip, policy}) {
  for (const scene of header.scenes)
    for (const [index, track] of scene.tracks.entries())
      if (track.row?.clip === clip && track.row?.policy === policy) return {scene: scene.id, index};
  throw new Error(`${file}: expected a track of ${policy} with ${clip}, found none`);
}

function packed(png, to) {
  const filter = 'split[a][b];[a]palettegen=max_colors=96:stats_mode=full[p];[b][p]paletteuse=dither=none';
  const done = spawnSync('ffmpeg', ['-v', 'error', '-y', '-i', '-', '-vf', filter, '-compression_level', '9', '-f', 'image2', to], {input: png});
  if (done.error || done.status !== 0) throw new Error(`ffmpeg failed: ${done.error ?? done.stderr}`);
  const size = statSync(to).size;
  if (size > MOST) throw new Error(`${to} has ${size} bytes, expected at most ${MOST}`);
  console.log(`${to}: ${size} bytes`);
}

const browser = await launch();
for (const [task, pair] of Object.entries(tasks))
  for (const side of ['right', 'wrong']) {
    const {scene, index} = found(pair[side]), {seconds, camera = ''} = pair[side];
    const hash = `#e=${encodeURIComponent(scene)}&f=${index}&v=${index}&t=${seconds}${camera}`;
    const {page, context} = await open(browser, resolve(file), {hash, width: 360, height: 420});
    await page.waitForFunction(() => document.getElementById('app')?.dataset.ready !== undefined, null, {timeout: 120000});
    await page.addStyleTag({content: BARE});
    await page.waitForTimeout(400);
    packed(await page.screenshot({timeout: 120000}), join(out, `${task}-${side}.png`));
    await context.close();
  }
await browser.close();
