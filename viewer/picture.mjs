// node picture.mjs PAGE OUT.png [HASH]: a page as a visitor sees it, with few colours, so that a README can have it. Fails
// above 150 kB. `./run picture` calls it.
import {spawnSync} from 'node:child_process';
import {statSync, writeFileSync} from 'node:fs';
import {resolve} from 'node:path';
import {launch, open} from './test/browser.mjs';

const [file, out, hash = ''] = process.argv.slice(2), MOST = 150_000; // bytes
const browser = await launch(), {page} = await open(browser, resolve(file), {hash, width: 1180, height: 800});
await page.waitForFunction(() => document.getElementById('app')?.dataset.ready !== undefined, null, {timeout: 120000});
await page.waitForTimeout(500);
const picture = await page.screenshot({timeout: 120000});
await browser.close();
const filter = 'split[a][b];[a]palettegen=max_colors=224:stats_mode=full[p];[b][p]paletteuse=dither=none';
const packed = spawnSync('ffmpeg', ['-v', 'error', '-y', '-i', '-', '-vf', filter, '-compression_level', '9', '-f', 'image2', out], {input: picture});
if (packed.error || packed.status !== 0) { // where there is no ffmpeg, as it is
  console.error(`picture: ffmpeg is absent or failed, all colours stay: ${packed.error ?? packed.stderr}`);
  writeFileSync(out, picture);
}
const size = statSync(out).size;
console.log(`${out}: ${size} bytes`);
process.exitCode = size <= MOST ? 0 : 1;
