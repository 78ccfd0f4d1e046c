// What is needed of an image: what to load where, and its symbols.

import { readFileSync } from 'node:fs';

const PT_LOAD = 1;
const SHT_SYMTAB = 2;
const STT_FUNC = 2;

/**
 * Reads a 32-bit little-endian ELF file.
 * `segments`: `{ address, bytes }`, where each lies before the image starts.
 * `symbols`: a Map of names to addresses. `functions`: `{ name, address }`, sorted.
 */
export function readElf(path) {
  const file = readFileSync(path);
  if (file.length < 52 || file.readUInt32BE(0) !== 0x7f454c46 || file[4] !== 1) {
    throw new Error(`${path}: not a 32-bit ELF file`);
  }
  const segments = [];
  const programs = file.readUInt32LE(28);
  for (let index = 0; index < file.readUInt16LE(44); index++) {
    const at = programs + index * file.readUInt16LE(42);
    const size = file.readUInt32LE(at + 16);
    if (file.readUInt32LE(at) === PT_LOAD && size > 0) {
      const offset = file.readUInt32LE(at + 4);
      segments.push({ address: file.readUInt32LE(at + 12), bytes: file.subarray(offset, offset + size) });
    }
  }
  const sections = file.readUInt32LE(32);
  const section = (index) => sections + index * file.readUInt16LE(46);
  const symbols = new Map();
  const functions = [];
  for (let index = 0; index < file.readUInt16LE(48); index++) {
    const at = section(index);
    if (file.readUInt32LE(at + 4) !== SHT_SYMTAB) {
      continue;
    }
    const names = file.readUInt32LE(section(file.readUInt32LE(at + 24)) + 16);
    const first = file.readUInt32LE(at + 16);
    for (let symbol = first; symbol < first + file.readUInt32LE(at + 20); symbol += 16) {
      const name = names + file.readUInt32LE(symbol);
      const text = file.toString('latin1', name, file.indexOf(0, name));
      const address = file.readUInt32LE(symbol + 4);
      symbols.set(text, address);
      if ((file[symbol + 12] & 0xf) === STT_FUNC) {
        functions.push({ name: text, address: address & ~1 });
      }
    }
  }
  functions.sort((a, b) => a.address - b.address);
  return { segments, symbols, functions };
}
