// Reads the log of a run as viewers of others do, with Foxglove's own packages and nothing of ours: node read_log.mjs LOG OUT.
// Writes the 29 positions of each state and command to OUT (doubles: log time [ns], q...), and prints what it found as JSON.
import {openSync, readSync, statSync, writeFileSync} from 'node:fs';
import {McapIndexedReader} from '@mcap/core';
import {decompress} from 'fzstd';
import {parse} from '@foxglove/rosmsg';
import {MessageReader} from '@foxglove/rosmsg2-serialization';

const [log, out] = process.argv.slice(2);
const file = openSync(log, 'r'), size = statSync(log).size;
let bytes = 0;
const readable = {
  size: async () => BigInt(size),
  read: async (offset, length) => {
    const buffer = new Uint8Array(Number(length));
    bytes += readSync(file, buffer, 0, buffer.length, Number(offset));
    return buffer;
  },
};
const handlers = {zstd: (buffer, length) => decompress(buffer, new Uint8Array(Number(length)))};
const reader = await McapIndexedReader.Initialize({readable, decompressHandlers: handlers});
const opened = bytes;

const readers = new Map();
function decoded(message) {
  const channel = reader.channelsById.get(message.channelId);
  const schema = reader.schemasById.get(channel.schemaId);
  if (channel.messageEncoding === 'json') return JSON.parse(new TextDecoder().decode(message.data));
  if (channel.messageEncoding !== 'cdr') return undefined;
  if (!readers.has(channel.id)) readers.set(channel.id, new MessageReader(parse(new TextDecoder().decode(schema.data), {ros2: true})));
  return readers.get(channel.id).readMessage(message.data);
}

const topics = {}, numbers = [];
let health, limiter, crc;
for await (const message of reader.readMessages()) {
  const {topic} = reader.channelsById.get(message.channelId);
  topics[topic] = (topics[topic] ?? 0) + 1;
  const content = decoded(message);
  if (topic === 'guard/health') health = content;
  if (topic === 'guard/limiter') limiter = content;
  const motors = content?.motor_state ?? content?.motor_cmd;
  if (!motors) continue;
  crc = content.crc;
  numbers.push(Number(message.logTime), topic === 'rt/lowcmd' ? 1 : 0, ...motors.slice(0, 29).map((motor) => motor.q));
}
writeFileSync(out, new Float64Array(numbers));

// The last tenth of the time: what a viewer reads that is moved there.
const {messageStartTime, messageEndTime} = reader.statistics;
const from = messageEndTime - (messageEndTime - messageStartTime) / 10n;
bytes = 0;
let late = 0;
for await (const message of reader.readMessages({startTime: from, topics: ['rt/lowstate']})) {
  if (message.logTime < from) throw new Error('a message from before the time that was asked for');
  ++late;
}
console.log(JSON.stringify({size, opened, sought: bytes, late, topics, crc, health, limiter,
  messages: Number(reader.statistics.messageCount), chunks: reader.chunkIndexes.length,
  seconds: Number(messageEndTime - messageStartTime) / 1e9}));
