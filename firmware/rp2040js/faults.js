// Faults that are planted into a running machine. The file of the image stays as it is, and so
// does the flash after a reset.

import { FLASH, RAM } from './chip.js';

/** SYST_CSR, the control of the processor's timer. */
const SYST_CSR = 0xe000e010;
/** CTRL of the DMA's channel that sends the dither to the first shift register, without a start. */
const DITHER_CTRL = 0x50000000 + 6 * 0x40 + 0x10;
const ENABLED = 1;
/** CTRL of the watchdog: it runs, and pauses while a debugger halts a core or uses JTAG (RP2040 datasheet, 4.7.6). */
const WATCHDOG_CTRL = 0x40058000;
const WATCHDOG_ENABLE = 1 << 30;
const WATCHDOG_PAUSES = 7 << 24;
/** Clocks for which it pauses: more than the four laser cycles for which its queue lasts. */
const PAUSE = 7500;
/** Milliseconds of a reset of the bus: a hub takes 10 to 20. */
const BUS_RESET_MS = 20;
const UDF = 0xde00;
const BRANCH_TO_ITSELF = 0xe7fe;
/** `push` of two registers or more, the last of which is LR: a function begins. */
const PUSH_LR = 0xb5;
const THUMB = 1;
const PANIC_FILE = 'planted.rs';

/**
 * Each is called before every instruction, once it is due, until it gives true.
 */
export const FAULTS = {
  /** The next instruction is undefined: HardFault. */
  fault: (machine) => isAtWork(machine) && patch(machine, UDF),
  /** The next instruction is a loop; interrupts go on. */
  hang: (machine) => isAtWork(machine) && patch(machine, BRANCH_TO_ITSELF),
  /** The core stops for good; all else goes on. */
  lockup: ({ chip }) => {
    chip.isLockedUp = true;
    return true;
  },
  /** A debugger halts the core, and with it a watchdog that was told to wait for it. */
  halt: ({ chip, rp2040 }) => {
    chip.isLockedUp = true;
    const control = rp2040.readUint32(WATCHDOG_CTRL);
    if (control & WATCHDOG_PAUSES) {
      rp2040.writeUint32(WATCHDOG_CTRL, (control & ~WATCHDOG_ENABLE) >>> 0);
    }
    return true;
  },
  /** The processor's timer stops: no millisecond ends any more. */
  clock: ({ rp2040 }) => {
    rp2040.writeUint32(SYST_CSR, 0);
    return true;
  },
  /** The core is reset, and nothing else. */
  'core-reset': (machine) => {
    machine.onReset('core');
    return true;
  },
  /** A function begins with no room on the stack. */
  overflow: (machine) => {
    const { core } = machine.rp2040;
    const opcode = core.readUint16(core.PC);
    const pushes = opcode >> 8 === PUSH_LR && (opcode & 0xff) !== 0;
    if (!isAtWork(machine) || !pushes) {
      return false;
    }
    core.SP = symbol(machine, '_stack_end') + 4;
    return true;
  },
  /** The same on a core that enters the handler of HardFault with nothing saved. */
  'overflow-entered': (machine) => {
    const isPlanted = FAULTS.overflow(machine);
    machine.chip.ignoresStackingFaults = isPlanted;
    return isPlanted;
  },
  /** The host resets the bus of the USB, for longer than the laser may go on, and does no more. */
  'bus-reset': ({ host }) => {
    host.resetBus(BUS_RESET_MS);
    return true;
  },
  /** A state machine gets no dither for some laser cycles, and waits for it. */
  starve: (machine) => {
    const { rp2040, clocks } = machine;
    const control = rp2040.readUint32(DITHER_CTRL);
    if (machine.starvedFrom === undefined) {
      rp2040.writeUint32(DITHER_CTRL, control & ~ENABLED);
      machine.starvedFrom = clocks;
    }
    const isOver = clocks >= machine.starvedFrom + PAUSE;
    // The image may have set the channel up again.
    if (isOver && !(control & ENABLED)) {
      rp2040.writeUint32(DITHER_CTRL, control | ENABLED);
    }
    return isOver;
  },
  /** The image calls a function of core::panicking. */
  panic: (machine) => {
    if (!isAtWork(machine)) {
      return false;
    }
    const { core } = machine.rp2040;
    const { address, words } = panicFunction(machine);
    // As a caller would: its `Location`, in its stack frame, is (address, length, line, column).
    const file = new TextEncoder().encode(PANIC_FILE);
    const frame = (core.SP - 32) & ~7;
    [...file].forEach((byte, at) => core.writeUint8(frame + 16 + at, byte));
    [frame + 16, file.length, 1, 1].forEach((word, at) => core.writeUint32(frame + 4 * at, word));
    [...words, frame].forEach((word, at) => {
      core.registers[at] = word;
    });
    core.SP = frame;
    core.LR = core.PC | THUMB;
    core.PC = address;
    return true;
  },
};

/** In no handler, with no interrupt held back. */
function isAtWork({ rp2040: { core } }) {
  return core.IPSR === 0 && !core.PM;
}

function patch({ rp2040 }, opcode) {
  const { PC } = rp2040.core;
  const [memory, start] = PC < RAM ? [rp2040.flashView, FLASH] : [rp2040.sramView, RAM];
  memory.setUint16(PC - start, opcode, true);
  return true;
}

/** A function that panics, and its arguments before the `Location`. */
function panicFunction({ elf }) {
  const candidates = [
    // An index and a length.
    [/9panicking18panic_bounds_check/, [7, 3]],
    // Nothing.
    [/9panicking11panic_const\d+panic_const_/, []],
  ];
  for (const [pattern, words] of candidates) {
    const found = elf.functions.find(({ name }) => pattern.test(name));
    if (found) {
      return { address: found.address, words };
    }
  }
  throw new Error('the image has no function that panics');
}

function symbol({ elf }, name) {
  const address = elf.symbols.get(name);
  if (address === undefined) {
    throw new Error(`the image has no symbol ${name}`);
  }
  return address;
}
