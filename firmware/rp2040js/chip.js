// An RP2040 with an image in its flash: rp2040js and the parts that it lacks.
//
// - A handler would run at an odd address, as its vector is, and read tables next to its code wrongly.
// - There is no fault. Here an access outside the address map, an access that is not aligned, an
//   undefined instruction (UDF) and a breakpoint raise HardFault. A fault in the handler of
//   HardFault, or while the registers of an exception are saved, locks the core up.
// - RESETS and the resets of the watchdog and of AIRCR do nothing. Here RESETS resets PIO, DMA,
//   pins, pads and USB; other peripherals keep their registers. The resets of the chip and of the core
//   are asked for at the machine.
// - The alarm of the watchdog would come again and again, without end.
// - The chip's reset register (CHIP_RESET) and some of the UART's registers are not there.

import { RP2040 } from 'rp2040js';
import { PioClock } from './pio.js';

export const FLASH = 0x10000000;
export const RAM = 0x20000000;
export const RAM_END = 0x20042000;
const VECTORS = FLASH + 0x100;
const BOOT2_BYTES = 256;
/** Bytes below the second stage of the boot that the stack of the boot ROM is taken to use. */
const BOOT_STACK_BYTES = 256;

/** What a processor can reach: the first address, and the first behind. */
const ADDRESS_MAP = [
  [0x00000000, 0x00004000], // ROM
  [0x10000000, 0x15004000], // flash, its cache
  [0x18000000, 0x18004000], // its interface
  [RAM, RAM_END],
  [0x21000000, 0x21040000], // the same without stripes
  [0x40000000, 0x40070000], // APB
  [0x50000000, 0x50400000], // AHB
  [0xd0000000, 0xd0004000], // SIO
  [0xe0000000, 0xe0100000], // of the core
];

const HARD_FAULT = 3;
const NMI = 2;
/** UARTRSR, UARTIFLS, UARTDMACR: registers of the UART that are not there. */
const UART_GAPS = new Set([0x04, 0x34, 0x48]);
const AIRCR = 0xd0c;
const SYSRESETREQ = 1 << 2;
const SYST_CSR = 0x010;
const CHIP_RESET = 0x08;
const HAD_POR = 1 << 8;

const RESETS = 0x4000c;
const PSM = 0x40010;
const IO_BANK0 = 0x40014;
const PADS_BANK0 = 0x4001c;
const PWM = 0x40050;
const WATCHDOG = 0x40058;
const VREG_AND_CHIP_RESET = 0x40064;

/** Bits of RESETS. */
const RESET_DMA = 1 << 2;
const RESET_IO_BANK0 = 1 << 5;
const RESET_PADS_BANK0 = 1 << 8;
const RESET_PIO = [1 << 10, 1 << 11];
const RESET_USB = 1 << 24;
/** Oscillators, clocks, RESETS: to restart one of these restarts all that comes after them. */
const PSM_FIRST = 0xf;
const PSM_PROC0 = 1 << 15;

const NO_FUNCTION = 0x1f;
const PAD_AT_RESET = 0b0110110;

/** An access that the bus does not answer, or an undefined instruction. */
class Fault extends Error {}

/** The core has stopped for good. */
class Lockup extends Error {}

export class Chip {
  /**
   * `elf` is what `readElf` gives. `now` gives the clock, `changed` is called with a clock when
   * a pin may have changed, `onReset` with 'watchdog', 'forced' or 'core', `onUsbReset` when the USB is
   * reset, `onBreak` with the number of a semihosting breakpoint.
   */
  constructor(elf, { now, changed, onReset, onUsbReset, onBreak, warn }) {
    const rp2040 = new RP2040();
    this.rp2040 = rp2040;
    this.elf = elf;
    this.now = now;
    this.changed = changed;
    this.onReset = onReset;
    this.onUsbReset = onUsbReset;
    this.onBreak = onBreak;
    /** The core has locked up. */
    this.isLockedUp = false;
    /** A handler is entered even if registers cannot be saved. */
    this.ignoresStackingFaults = false;
    this.hardFaults = 0;
    rp2040.logger = { debug() {}, info() {}, warn: (_, text) => warn(text), error: (_, text) => warn(text) };
    this.flash32 = new Uint32Array(rp2040.flash.buffer);
    this.pio = new PioClock(rp2040, now, changed);
    this.load();
    this.startCore();
    this.fillUart();
    this.fillPins();
    this.fillResets();
  }

  /** The end of the code, from the start of the flash. */
  static codeEnd(elf) {
    const inFlash = elf.segments.filter(({ address }) => address < RAM);
    return Math.max(...inFlash.map(({ address, bytes }) => address + bytes.length - FLASH));
  }

  /** Puts the image into the flash as it is in the file. */
  load() {
    for (const { address, bytes } of this.elf.segments) {
      const [memory, start] =
        address < RAM ? [this.rp2040.flash, FLASH] : [this.rp2040.sram, RAM];
      memory.set(bytes, address - start);
    }
  }

  /** Takes over what a reset of the chip leaves: the memory and the watchdog's notes. */
  inherit(old, reason) {
    const [watchdog, oldWatchdog] = [this, old].map((chip) => chip.rp2040.peripherals[WATCHDOG]);
    this.rp2040.sram.set(old.rp2040.sram);
    watchdog.scratchData.set(oldWatchdog.scratchData);
    watchdog.reason = reason;
    this.hardFaults = old.hardFaults;
    this.bootRom();
  }

  /** Resets the processor alone. */
  resetCore() {
    const { rp2040 } = this;
    const { ppb } = rp2040;
    const { pendingInterrupts } = rp2040.core;
    this.load();
    rp2040.core = new rp2040.core.constructor(rp2040);
    // What peripherals ask for they go on asking for.
    rp2040.core.pendingInterrupts = pendingInterrupts;
    ppb.writeUint32(SYST_CSR, 0);
    this.isLockedUp = false;
    this.ignoresStackingFaults = false;
    this.bootRom();
    this.startCore();
  }

  /** What the boot ROM leaves at the end of the memory: the second stage, and its own stack. */
  bootRom() {
    const { sram, flash } = this.rp2040;
    const second = sram.length - BOOT2_BYTES;
    sram.set(flash.subarray(0, BOOT2_BYTES), second);
    sram.fill(0xb0, second - BOOT_STACK_BYTES, second);
  }

  startCore() {
    const { rp2040 } = this;
    const { core } = rp2040;
    core.VTOR = VECTORS;
    core.reset();
    rp2040.onBreak = (code) => this.onBreakpoint(code);
    const { exceptionEntry } = core;
    core.exceptionEntry = (number) => {
      const { writeUint32 } = core;
      if (this.ignoresStackingFaults) {
        core.writeUint32 = (address, value) => isMapped(address >>> 0) && writeUint32(address, value);
      }
      try {
        exceptionEntry.call(core, number);
      } catch (error) {
        throw error instanceof Fault ? new Lockup() : error;
      } finally {
        core.writeUint32 = writeUint32;
      }
      core.PC = (core.PC & ~1) >>> 0;
    };
    this.fillBus();
  }

  /** Accesses of the core. */
  fillBus() {
    const { rp2040, flash32 } = this;
    const { core, sram, sramView, flash, flash16 } = rp2040;
    const check = (address, size) => {
      if ((address & (size - 1)) !== 0 || !isMapped(address)) {
        throw new Fault(`${address.toString(16)}`);
      }
    };
    core.readUint32 = (place) => {
      const address = place >>> 0;
      if ((address & 3) === 0) {
        if (address >= RAM && address < RAM_END) {
          return sramView.getUint32(address - RAM, true);
        }
        if (address >>> 24 === 0x10) {
          return flash32[(address & 0xffffff) >> 2];
        }
      }
      check(address, 4);
      return rp2040.readUint32(address);
    };
    core.readUint16 = (place) => {
      const address = place >>> 0;
      if ((address & 1) === 0) {
        if (address >>> 24 === 0x10) {
          return flash16[(address & 0xffffff) >> 1];
        }
        if (address >= RAM && address < RAM_END) {
          return sramView.getUint16(address - RAM, true);
        }
      }
      check(address, 2);
      return rp2040.readUint16(address);
    };
    core.readUint8 = (place) => {
      const address = place >>> 0;
      if (address >= RAM && address < RAM_END) {
        return sram[address - RAM];
      }
      if (address >>> 24 === 0x10) {
        return flash[address & 0xffffff];
      }
      check(address, 1);
      return rp2040.readUint8(address);
    };
    core.writeUint32 = (place, value) => {
      const address = place >>> 0;
      if (address >= RAM && address < RAM_END && (address & 3) === 0) {
        sramView.setUint32(address - RAM, value, true);
        return;
      }
      check(address, 4);
      rp2040.writeUint32(address, value);
    };
    core.writeUint16 = (place, value) => {
      check(place >>> 0, 2);
      rp2040.writeUint16(place >>> 0, value);
    };
    core.writeUint8 = (place, value) => {
      check(place >>> 0, 1);
      rp2040.writeUint8(place >>> 0, value);
    };
  }

  onBreakpoint(code) {
    const { core } = this.rp2040;
    const isBreakpoint = core.readUint16(core.PC - 2) >> 8 === 0xbe;
    if (isBreakpoint && code === 0xab) {
      return this.onBreak();
    }
    throw new Fault('no instruction');
  }

  /** Enters the handlers that are due. The core is then where its next instruction is. */
  takeInterrupts() {
    const { core } = this.rp2040;
    try {
      while (core.interruptsUpdated && core.checkForInterrupts());
    } catch (error) {
      this.lockUp(error);
    }
  }

  /** Executes one instruction; gives its clocks. */
  step() {
    const { core } = this.rp2040;
    const { PC, SP } = core;
    try {
      return core.executeInstruction();
    } catch (error) {
      if (!(error instanceof Fault)) {
        this.lockUp(error);
        return 1;
      }
      core.PC = PC;
      core.SP = SP;
      this.raiseHardFault();
      return 1;
    }
  }

  raiseHardFault() {
    const { core } = this.rp2040;
    if (core.IPSR === HARD_FAULT || core.IPSR === NMI) {
      this.isLockedUp = true;
      return;
    }
    this.hardFaults++;
    try {
      core.exceptionEntry(HARD_FAULT);
    } catch (error) {
      this.lockUp(error);
    }
  }

  /** Errors that are not faults of the core are thrown on. */
  lockUp(error) {
    if (!(error instanceof Lockup)) {
      throw error;
    }
    this.isLockedUp = true;
  }

  fillUart() {
    for (const uart of this.rp2040.uart) {
      const { readUint32, writeUint32 } = uart;
      uart.readUint32 = (offset) => (UART_GAPS.has(offset) ? 0 : readUint32.call(uart, offset));
      uart.writeUint32 = (offset, value) => UART_GAPS.has(offset) || writeUint32.call(uart, offset, value);
    }
  }

  /** Tells of every write that may change a pin, but those of the PIO's own. */
  fillPins() {
    const { rp2040 } = this;
    const { peripherals, sio } = rp2040;
    const tell = (peripheral) => {
      const { writeUint32 } = peripheral;
      peripheral.writeUint32 = (offset, value) => {
        writeUint32.call(peripheral, offset, value);
        this.changed(this.now());
      };
    };
    [peripherals[IO_BANK0], peripherals[PADS_BANK0], peripherals[PWM], sio, ...rp2040.pio].forEach(tell);
    this.tell = tell;
  }

  fillResets() {
    const { rp2040 } = this;
    const { peripherals, ppb } = rp2040;
    const [resets, watchdog] = [peripherals[RESETS], peripherals[WATCHDOG]];
    const writeResets = resets.writeUint32;
    resets.writeUint32 = (offset, value) => {
      const before = resets.reset;
      writeResets.call(resets, offset, value);
      this.reset(resets.reset & ~before);
    };
    const writePpb = ppb.writeUint32;
    ppb.writeUint32 = (offset, value) => {
      if (offset !== AIRCR) {
        writePpb.call(ppb, offset, value);
      } else if (value & SYSRESETREQ) {
        this.onReset('core');
      }
    };
    watchdog.onWatchdogTrigger = () => {
      const { wdsel } = peripherals[PSM];
      // Its alarm would come again and again in the same clock.
      watchdog.timer.enable = false;
      watchdog.alarm.enable = false;
      this.reset(resets.wdsel);
      if (wdsel & PSM_FIRST) {
        this.onReset(watchdog.reason === 1 ? 'watchdog' : 'forced');
      } else if (wdsel & PSM_PROC0) {
        this.onReset('core');
      }
    };
    peripherals[VREG_AND_CHIP_RESET].readUint32 = (offset) => (offset === CHIP_RESET ? HAD_POR : 0);
  }

  /** Resets the peripherals of these bits of RESETS. */
  reset(bits) {
    const { rp2040 } = this;
    if (bits === 0) {
      return;
    }
    RESET_PIO.forEach((bit, index) => {
      if (bits & bit) {
        this.pio.reset(index);
        this.tell(rp2040.pio[index]);
      }
    });
    if (bits & RESET_DMA) {
      const old = rp2040.dma;
      old.channels.forEach((channel) => channel.abort());
      rp2040.dma = new old.constructor(rp2040, old.name);
      // What peripherals ask for they go on asking for.
      rp2040.dma.dreq = old.dreq;
      rp2040.peripherals[0x50000] = rp2040.dma;
      rp2040.dma.checkInterrupts();
    }
    for (const gpio of rp2040.gpio) {
      if (bits & RESET_IO_BANK0) {
        Object.assign(gpio, { ctrl: NO_FUNCTION, irqEnableMask: 0, irqForceMask: 0, irqStatus: 0 });
      }
      if (bits & RESET_PADS_BANK0) {
        gpio.padValue = PAD_AT_RESET;
      }
    }
    if (bits & RESET_USB) {
      this.resetUsb();
    }
    this.changed(this.now());
  }

  resetUsb() {
    const { rp2040 } = this;
    const old = rp2040.usbCtrl;
    [...old.endpointReadAlarms, ...old.endpointWriteAlarms].forEach((alarm) => alarm.alarm?.cancel());
    old.resetAlarm.cancel();
    rp2040.usbCtrl = new old.constructor(rp2040, old.name);
    rp2040.peripherals[0x50110] = rp2040.usbCtrl;
    rp2040.usbCtrl.checkInterrupts();
    this.onUsbReset();
  }
}

function isMapped(address) {
  return ADDRESS_MAP.some(([first, end]) => address >= first && address < end);
}
