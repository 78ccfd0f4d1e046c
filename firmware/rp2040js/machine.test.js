// `node --test`: what a machine does with its pins and resets, without an image of Rust.

import assert from 'node:assert/strict';
import { spawnSync } from 'node:child_process';
import { copyFileSync, mkdtempSync, readdirSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { test } from 'node:test';
import { fileURLToPath } from 'node:url';
import { Machine } from './machine.js';
import { milliseconds } from './pulses.js';

const PIO0 = 0x50200000;
const PIO_CTRL = PIO0;
const GP2_CTRL = 0x40014014;
const PSM_WDSEL = 0x40010008;
const RESETS = 0x4000c000;
const WATCHDOG = 0x40058000;
const AIRCR = 0xe000ed0c;
const FUNCTION_PIO0 = 6;
const OUTPUT_LOW = 2 << 8;
const CLOCKS_A_US = 125;

/** Vectors, and `b .`: the core rests. */
function image() {
  const boot = { address: 0x10000000, bytes: new Uint8Array(256).fill(0x42) };
  const bytes = new Uint8Array(10);
  const view = new DataView(bytes.buffer);
  view.setUint32(0, 0x20042000, true);
  view.setUint32(4, 0x10000109, true);
  view.setUint16(8, 0xe7fe, true);
  const symbols = new Map([
    ['_stack_end', 0x20041000],
    ['_stack_start', 0x20042000],
  ]);
  return { segments: [boot, { address: 0x10000100, bytes }], symbols, functions: [] };
}

/** A machine whose laser fires pulses of 13 clocks, each 35 clocks. */
function lit() {
  const machine = new Machine(image());
  const write = (offset, value) => machine.rp2040.writeUint32(PIO0 + offset, value);
  // mov x, y side 1; jmp x-- 1 side 1; mov x, osr side 0; jmp x-- 3 side 0
  [0xb022, 0x1041, 0xa027, 0x0043].forEach((opcode, at) => write(0x48 + 4 * at, opcode));
  write(0xcc, 3 << 12);
  write(0xdc, (1 << 29) | (1 << 26) | (2 << 10) | (2 << 5));
  // set pindirs, 1; set y, 11; set x, 20; mov osr, x
  [0xe081, 0xe04b, 0xe034, 0xa0e1].forEach((opcode) => write(0xd8, opcode));
  machine.rp2040.writeUint32(GP2_CTRL, FUNCTION_PIO0);
  machine.run(10);
  machine.rp2040.writeUint32(PIO_CTRL, 1);
  return machine;
}

function runUntilHigh(machine) {
  while (!machine.pulses.isHigh) {
    machine.run(1);
  }
}

const report = (machine) => machine.report().laser;

test('pulses are counted, and measured', () => {
  const machine = lit();
  machine.run(35 * 1000);
  const { pulses, longestNs, firstHighMs } = report(machine);
  assert.equal(pulses, 1000);
  assert.equal(longestNs, 104);
  assert.equal(firstHighMs, milliseconds(11));
});

test('a state machine that stops within a pulse leaves the pin high', () => {
  const machine = lit();
  runUntilHigh(machine);
  machine.rp2040.writeUint32(PIO_CTRL, 0);
  machine.run(1000);
  assert.equal(report(machine).isHigh, true);
  assert.ok(report(machine).longestNs >= 8000);
});

test('an override holds the pin low, and so does a reset of the PIO', () => {
  for (const [address, value] of [
    [GP2_CTRL, FUNCTION_PIO0 | OUTPUT_LOW],
    [RESETS, 1 << 10],
  ]) {
    const machine = lit();
    runUntilHigh(machine);
    const { pulses } = report(machine);
    machine.rp2040.writeUint32(address, value);
    machine.run(1000);
    assert.deepEqual([report(machine).isHigh, report(machine).pulses], [false, pulses]);
  }
});

test('the watchdog resets the chip after its time, but not memory, scratch and reason', () => {
  const machine = lit();
  const { rp2040 } = machine;
  rp2040.writeUint32(0x20000100, 0x12345678);
  rp2040.writeUint32(WATCHDOG + 0x0c, 7);
  rp2040.writeUint32(PSM_WDSEL, 0x1fffc);
  // Two a microsecond.
  rp2040.writeUint32(WATCHDOG + 0x04, 2000);
  rp2040.writeUint32(WATCHDOG, 1 << 30);
  machine.run(999 * CLOCKS_A_US);
  assert.equal(machine.boots.length, 1);
  machine.run(10 * CLOCKS_A_US);
  const [, { clock, reason }] = machine.boots;
  assert.equal(reason, 'watchdog');
  assert.ok(Math.abs(clock - 1000 * CLOCKS_A_US) < 20, `${clock}`);
  assert.equal(report(machine).isHigh, false);
  assert.ok(report(machine).lastHighMs <= milliseconds(clock));
  const read = (address) => machine.rp2040.readUint32(address);
  assert.equal(read(0x20000100), 0x12345678);
  assert.equal(read(WATCHDOG + 0x0c), 7);
  assert.equal(read(WATCHDOG + 0x08), 1);
  assert.equal(read(0x20041f00), 0x42424242);
});

test('a watchdog that is fed does not reset', () => {
  const machine = lit();
  machine.rp2040.writeUint32(PSM_WDSEL, 0x1fffc);
  for (let ms = 0; ms < 5; ms++) {
    machine.rp2040.writeUint32(WATCHDOG + 0x04, 4000);
    machine.rp2040.writeUint32(WATCHDOG, 1 << 30);
    machine.run(1000 * CLOCKS_A_US);
  }
  assert.equal(machine.boots.length, 1);
});

test('a forced reset says so', () => {
  const machine = lit();
  machine.rp2040.writeUint32(PSM_WDSEL, 0x1ffff);
  machine.rp2040.writeUint32(WATCHDOG, 1 << 31);
  machine.run(100);
  assert.equal(machine.boots[1].reason, 'forced');
  assert.equal(machine.rp2040.readUint32(WATCHDOG + 0x08), 2);
});

test('a change of how the queues of a state machine join empties them', () => {
  const { rp2040 } = lit();
  const [machine] = rp2040.pio[0].machines;
  const shift = PIO0 + 0xd0;
  const fill = () => [1, 2].forEach((word) => rp2040.writeUint32(PIO0 + 0x10, word));
  fill();
  rp2040.writeUint32(shift, rp2040.readUint32(shift));
  assert.equal(machine.txFIFO.itemCount, 2);
  rp2040.writeUint32(shift, (rp2040.readUint32(shift) ^ (1 << 31)) >>> 0);
  assert.equal(machine.txFIFO.itemCount, 0);
});

test('a reset of the core lets the laser fire on', () => {
  const machine = lit();
  machine.run(350);
  machine.rp2040.core.writeUint32(AIRCR, 0x05fa0004);
  machine.run(3500);
  assert.equal(machine.boots[1].reason, 'core');
  assert.ok(report(machine).pulses >= 109);
  assert.equal(report(machine).longestNs, 104);
});

test('an image that resets without end is ended', () => {
  const machine = new Machine(image(), { boots: 3 });
  for (let count = 0; count < 5; count++) {
    machine.onReset('core');
    machine.run(10);
  }
  assert.deepEqual([machine.boots.length, machine.ended], [3, 1]);
});

test('an exception that cannot save its registers locks the core up', () => {
  const machine = new Machine(image());
  machine.run(10);
  machine.rp2040.core.SP = 0x20000010;
  machine.chip.raiseHardFault();
  assert.equal(machine.chip.isLockedUp, true);
  machine.run(1000);
  assert.ok(machine.clocks >= 1010);
});

test('without its package the runner says in one line how to install it', () => {
  const folder = mkdtempSync(join(tmpdir(), 'rp2040-'));
  const here = fileURLToPath(new URL('.', import.meta.url));
  const files = readdirSync(here).filter((name) => /\.js$|^package\.json$/.test(name));
  files.forEach((name) => copyFileSync(join(here, name), join(folder, name)));
  const { status, stderr } = spawnSync('node', [join(folder, 'run.js'), 'image']);
  rmSync(folder, { recursive: true });
  assert.deepEqual([status, String(stderr)], [1, 'error: rp2040js is missing: npm ci --prefix firmware/rp2040js\n']);
});
