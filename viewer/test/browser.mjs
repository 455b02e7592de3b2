// Parts that the checks of pages share: Debian's Chromium (software WebGL, no network), pictures, archives of numbers.
import {chromium} from 'playwright-core';
import {existsSync, mkdirSync, readFileSync} from 'node:fs';
import {join} from 'node:path';
import {inflateRawSync, inflateSync} from 'node:zlib';

export const folder = process.env.DUET_WEB ?? '../build/web'; // made by `./run web-test`
export const pictures = join(folder, 'pictures');
mkdirSync(pictures, {recursive: true});

export const executable = ['/usr/bin/chromium-headless-shell', '/usr/bin/chromium'].find((path) => existsSync(path));

// Without the second flag the canvas stays empty and nothing fails.
const WITH_WEBGL = ['--no-sandbox', '--use-angle=swiftshader', '--enable-unsafe-swiftshader'];
const WITHOUT_WEBGL = ['--no-sandbox', '--disable-gpu', '--disable-3d-apis'];

export function launch(webgl = true) {
  return chromium.launch({executablePath: executable, args: webgl ? WITH_WEBGL : WITHOUT_WEBGL});
}

const opened = [];
// A page that is left open goes on drawing.
export async function closeAll() {
  for (const context of opened.splice(0)) await context.close().catch(() => {});
}

// A page from disk with the network off, and what it complained of.
// Nothing moves by itself: a visitor who asked for less motion, unless a check says otherwise.
export async function open(browser, path, {hash = '', width = 1440, height = 1000, ...options} = {}) {
  const context = await browser.newContext({viewport: {width, height}, reducedMotion: 'reduce', ...options});
  opened.push(context);
  await context.setOffline(true);
  const page = await context.newPage(), errors = [];
  page.on('pageerror', (error) => errors.push(String(error)));
  page.on('console', (message) => message.type() === 'error' && errors.push(message.text()));
  await page.goto(`file://${path}${hash}`);
  return {page, errors, context};
}

// Reads a PNG of 8 bits a channel: width, height, brightness of each pixel.
export function brightness(png) {
  let at = 8, width = 0, height = 0, channels = 3;
  const data = [];
  while (at < png.length) {
    const size = png.readUInt32BE(at), kind = png.toString('latin1', at + 4, at + 8);
    if (kind === 'IHDR') {
      width = png.readUInt32BE(at + 8);
      height = png.readUInt32BE(at + 12);
      channels = png[at + 17] === 6 ? 4 : 3;
    }
    if (kind === 'IDAT') data.push(png.subarray(at + 8, at + 8 + size));
    at += size + 12;
  }
  const raw = inflateSync(Buffer.concat(data)), stride = width * channels, values = new Float64Array(width * height);
  let before = new Uint8Array(stride);
  for (let y = 0; y < height; ++y) {
    const filter = raw[y * (stride + 1)], line = new Uint8Array(raw.subarray(y * (stride + 1) + 1, (y + 1) * (stride + 1)));
    for (let i = 0; i < stride; ++i) {
      const a = i >= channels ? line[i - channels] : 0, b = before[i], c = i >= channels ? before[i - channels] : 0;
      const p = a + b - c, pa = Math.abs(p - a), pb = Math.abs(p - b), pc = Math.abs(p - c);
      line[i] += [0, a, b, (a + b) >> 1, pa <= pb && pa <= pc ? a : pb <= pc ? b : c][filter];
    }
    for (let x = 0; x < width; ++x)
      values[y * width + x] = (line[x * channels] + line[x * channels + 1] + line[x * channels + 2]) / 3;
    before = line;
  }
  return {width, height, values};
}

export function spread({values}) {
  const mean = values.reduce((a, b) => a + b, 0) / values.length;
  return Math.sqrt(values.reduce((a, b) => a + (b - mean) ** 2, 0) / values.length);
}

export function meanOf({values}) { return values.reduce((a, b) => a + b, 0) / values.length; }

// Arrays of an NPZ by name: {shape, values}.
export function readNpz(path) {
  const bytes = readFileSync(path), arrays = {};
  let end = bytes.length - 22;
  while (bytes.readUInt32LE(end) !== 0x06054b50) --end;
  let at = bytes.readUInt32LE(end + 16);
  for (let i = bytes.readUInt16LE(end + 10); i > 0; --i) {
    const method = bytes.readUInt16LE(at + 10), packed = bytes.readUInt32LE(at + 20), length = bytes.readUInt16LE(at + 28);
    const name = bytes.toString('utf8', at + 46, at + 46 + length), head = bytes.readUInt32LE(at + 42);
    const begin = head + 30 + bytes.readUInt16LE(head + 26) + bytes.readUInt16LE(head + 28);
    const content = bytes.subarray(begin, begin + packed);
    arrays[name.replace(/\.npy$/, '')] = readNpy(method === 8 ? inflateRawSync(content) : content);
    at += 46 + length + bytes.readUInt16LE(at + 30) + bytes.readUInt16LE(at + 32);
  }
  return arrays;
}

function readNpy(bytes) {
  const length = bytes.readUInt16LE(8), head = bytes.toString('latin1', 10, 10 + length);
  const kind = /'descr': '([^']*)'/.exec(head)[1], shape = /'shape': \(([^)]*)\)/.exec(head)[1].split(',').filter((s) => s.trim()).map(Number);
  const data = bytes.subarray(10 + length), copy = data.buffer.slice(data.byteOffset, data.byteOffset + data.length);
  const types = {'<f8': Float64Array, '<f4': Float32Array, '<i4': Int32Array, '<i8': BigInt64Array};
  return {shape, values: types[kind] ? new types[kind](copy) : null};
}

// The data of a replay page: its header and the bytes of its columns.
export function readPage(html) {
  const packed = /id="duet-replay">([^<]*)</.exec(html)[1];
  const all = inflateSync(Buffer.from(packed, 'base64')), size = all.readUInt32LE(0);
  return {header: JSON.parse(all.toString('utf8', 4, 4 + size)), bytes: new Uint8Array(all.subarray(4 + size)), packed};
}
