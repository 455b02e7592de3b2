// The host of an engine whose library is a package of npm: answers duet's frames (docs/extending.md, "A host") on the
// socket DUET_HOST_FD. Usage: node host.mjs ENGINE FOLDER, with ENGINE.mjs beside this file and FOLDER/node_modules.
//
// An engine's file exports `load(folder)`, which resolves to
//   {version, open(scene): {memory, contacts, step(request, answer): numbers written, free()}}
// where a step depends on nothing but the scene and its request.
import fs from 'node:fs';
import path from 'node:path';
import process from 'node:process';
import {layoutOf} from './layout.mjs';

const PROTOCOL = 'duet.host/1';
const [SCENE, STEP] = [1, 2];
const [READY, STEPPED, REFUSED] = [1, 2, 3];
const HEAD = 16; // bytes: u32 length of the content, u32 kind, u64 number of the message

const socket = Number(process.env.DUET_HOST_FD);

/** False where duet has closed the connection. */
function readExactly(buffer, bytes) {
  for (let at = 0; at < bytes;) {
    const got = fs.readSync(socket, buffer, at, bytes - at, null);
    if (got === 0) return false;
    at += got;
  }
  return true;
}

function write(buffer, bytes) {
  for (let at = 0; at < bytes;) at += fs.writeSync(socket, buffer, at, bytes - at);
}

function writeText(kind, number, text) {
  const content = Buffer.from(text);
  const frame = Buffer.alloc(HEAD + content.length);
  writeHead(frame, content.length, kind, number);
  content.copy(frame, HEAD);
  write(frame, frame.length);
}

function writeHead(frame, bytes, kind, number) {
  frame.writeUInt32LE(bytes, 0);
  frame.writeUInt32LE(kind, 4);
  frame.writeBigUInt64LE(number, 8);
}

/** A scene that is open: its buffers have the sizes of its requests and of its longest answer. */
function opened(engine, name, text) {
  const message = JSON.parse(text);
  if (message.protocol !== PROTOCOL) throw new Error(`expected ${PROTOCOL}, found ${message.protocol}`);
  if (message.engine !== name) throw new Error(`this host is of ${name}, asked for ${message.engine}`);
  const world = engine.open(message.scene);
  const layout = layoutOf(message.scene, world.memory);
  const answer = Buffer.alloc(HEAD + 8 * (layout.out.contacts + 10 * world.contacts));
  return {
    world, layout, answer,
    request: new Float64Array(layout.in.size),
    numbers: new Float64Array(answer.buffer, answer.byteOffset + HEAD, (answer.length - HEAD) / 8),
  };
}

function step(open, bytes, number) {
  const {request} = open;
  if (bytes !== request.byteLength) throw new Error(`a step has ${bytes} bytes, expected ${request.byteLength}`);
  if (!readExactly(new Uint8Array(request.buffer), bytes)) return false;
  const written = open.world.step(request, open.numbers);
  writeHead(open.answer, 8 * written, STEPPED, number);
  write(open.answer, HEAD + 8 * written);
  return true;
}

async function serve(name, folder) {
  for (const print of ['log', 'info', 'warn', 'error', 'debug']) console[print] = () => {};
  const engine = await (await import(`./${name}.mjs`)).load(path.join(folder, 'node_modules'));
  const head = Buffer.alloc(HEAD);
  let open = null;
  while (readExactly(head, HEAD)) {
    const bytes = head.readUInt32LE(0), kind = head.readUInt32LE(4), number = head.readBigUInt64LE(8);
    try {
      if (kind === SCENE) {
        const text = Buffer.alloc(bytes);
        if (!readExactly(text, bytes)) return;
        open?.world.free();
        open = null;
        open = opened(engine, name, text.toString());
        writeText(READY, number, JSON.stringify({protocol: PROTOCOL, engine: name, version: engine.version,
                                                 memory: open.world.memory, contacts: open.world.contacts}));
      } else if (kind === STEP && open !== null) {
        if (!step(open, bytes, number)) return;
      } else {
        throw new Error(`a frame of kind ${kind} ${open === null ? 'before a scene' : 'is unknown'}`);
      }
    } catch (error) {
      writeText(REFUSED, number, String(error?.message ?? error));
      return;
    }
  }
}

const [name, folder] = process.argv.slice(2);
await serve(name, folder);
