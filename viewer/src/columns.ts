// The numbers of a page: blocks of columns, 16 bits a value, second differences, low bytes before high ones
// (replay/replay_header.h).

export interface Block {
  at: number; // first byte
  rows: number;
  bases: number[];
  steps: number[];
}

// Column k of row t is at [k * rows + t].
export interface Columns {
  rows: number;
  width: number;
  values: Float64Array;
}

const NOT_A_NUMBER = -32768;

export function readColumns(bytes: Uint8Array, block: Block): Columns {
  const rows = block.rows, width = block.bases.length, size = rows * width;
  const values = new Float64Array(size);
  for (let k = 0; k < width; ++k) {
    let before = 0, beforeThat = 0;
    for (let t = 0; t < rows; ++t) {
      const place = block.at + k * rows + t;
      const second = bytes[place]! | (bytes[place + size]! << 8);
      const value = (((second + 2 * before - beforeThat) & 0xffff) << 16) >> 16;
      beforeThat = before;
      before = value;
      values[k * rows + t] = value === NOT_A_NUMBER ? NaN : block.bases[k]! + value * block.steps[k]!;
    }
  }
  return {rows, width, values};
}
