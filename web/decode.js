// Bytes of the feed to values, by the tables of frames.js.

import { HEADER_BYTES, GOES_ON } from "./frames.js";

const READ = {
  u8: [1, (view, at) => view.getUint8(at)],
  u16: [2, (view, at) => view.getUint16(at, true)],
  u32: [4, (view, at) => view.getUint32(at, true)],
  i16: [2, (view, at) => view.getInt16(at, true)],
  i32: [4, (view, at) => view.getInt32(at, true)],
};
const TILE_CELLS = 1024;

/** The header of a frame, and a view of what follows it. */
export function readFrame(buffer) {
  const view = new DataView(buffer);
  const bytes = view.getUint32(4, true);
  return {
    kind: view.getUint8(0),
    goesOn: (view.getUint8(1) & GOES_ON) !== 0,
    count: view.getUint16(2, true),
    time_s: view.getFloat64(8, true),
    body: new DataView(buffer, HEADER_BYTES, bytes),
  };
}

/** One record from a place on; returns it and where it ends. */
export function readRecord(layout, view, from) {
  const record = {};
  let at = from;
  for (const [name, kind] of layout) {
    const [bytes, read] = READ[kind];
    record[name] = read(view, at);
    at += bytes;
  }
  return [record, at];
}

/** The 1024 cells of a tile; as src/cells.rs of proto has them. */
export function readCells(view, from, bytes) {
  const cells = new Int8Array(TILE_CELLS);
  let at = from;
  let cell = 0;
  while (at < from + bytes) {
    const control = view.getUint8(at++);
    if (control < 128) {
      for (let i = 0; i <= control; i++) cells[cell++] = view.getInt8(at++);
    } else {
      cells.fill(view.getInt8(at++), cell, cell + control - 125);
      cell += control - 125;
    }
  }
  if (cell !== TILE_CELLS) throw new Error(`a tile of ${cell} cells`);
  return cells;
}

/** The bytes of a view from a place on. */
export function bytesOf(view, from = 0, bytes = view.byteLength - from) {
  return new Uint8Array(view.buffer, view.byteOffset + from, bytes);
}
