// node film.mjs PAGE OUT [HASH]: a replay page as a film (.mp4, .gif, by ffmpeg) or as one picture (.png), without its panels.
// Frames are drawn by Debian's Chromium at 25 a second of the episode's time. `./run film` calls it.
import {spawn} from 'node:child_process';
import {resolve} from 'node:path';
import {launch, open} from './test/browser.mjs';

const [page_file, out, hash = ''] = process.argv.slice(2);
const FRAMES_A_SECOND = 25, LONGEST = 30; // [s]

const browser = await launch(), {page} = await open(browser, resolve(page_file), {hash, width: 960, height: 540});
await page.waitForFunction(() => document.getElementById('app')?.dataset.ready !== undefined);
await page.addStyleTag({content: 'header,footer,aside,.bar,.slide,.strips{display:none!important}#app{display:block;padding:0;max-width:none}' +
                                 '.stage{height:100vh;border:0;border-radius:0}'});
await page.waitForTimeout(300);
if (out.endsWith('.png')) {
  await page.screenshot({path: out});
} else {
  const [begin, end] = await page.locator('.slider').evaluate((s) => [Number(s.min), Number(s.max)]);
  const filter = out.endsWith('.gif') ? ['-vf', 'fps=12,scale=480:-1:flags=lanczos,split[a][b];[a]palettegen=64[p];[b][p]paletteuse'] : ['-pix_fmt', 'yuv420p'];
  const ffmpeg = spawn('ffmpeg', ['-v', 'error', '-y', '-f', 'image2pipe', '-framerate', String(FRAMES_A_SECOND), '-i', '-', ...filter, out],
                       {stdio: ['pipe', 'inherit', 'inherit']});
  const done = new Promise((resolved, failed) => {
    ffmpeg.on('error', () => failed(new Error('film: ffmpeg is not installed')));
    ffmpeg.on('close', (code) => code === 0 ? resolved() : failed(new Error(`film: ffmpeg ended with ${code}`)));
  });
  for (let t = begin; t <= Math.min(end, begin + LONGEST); t += 1 / FRAMES_A_SECOND) {
    await page.locator('.slider').evaluate((slider, seconds) => {
      slider.value = String(seconds);
      slider.dispatchEvent(new Event('input'));
      return new Promise((drawn) => requestAnimationFrame(() => requestAnimationFrame(drawn)));
    }, t);
    ffmpeg.stdin.write(await page.screenshot());
  }
  ffmpeg.stdin.end();
  await done;
}
await browser.close();
