// An RP2040 with an image: rp2040js, and what it leaves to its caller.
//
// - It has one core and no boot ROM: the image starts at its vector table, as the second stage
//   of the boot would start it.
// - State machines of the PIO do not step with the core: here all that are enabled step once a
//   clock. Delays of their instructions and clock dividers are not there.
// - A DMA transfer of a word is an alarm of the clock, which ticks once a clock as well.
// - A handler would run at an odd address, as its vector is, and read tables beside its code wrongly.
// - An interrupt that comes while the core sleeps would be taken even when all are held back. So
//   the core never sleeps for long: this file knows that it does.

import { RP2040, USBCDC } from 'rp2040js';
import { CLOCK_NS } from './edges.js';
import { answer } from './semihosting.js';

const FLASH = 0x10000000;
const RAM = 0x20000000;
const VECTORS = FLASH + 0x100;
/** UARTRSR, UARTIFLS, UARTDMACR: registers of the UART that are not there. */
const UART_GAPS = new Set([0x04, 0x34, 0x48]);
/** AIRCR, through which an image resets the chip. */
const AIRCR = 0xd0c;
/** Clocks until a pin's level is in step with the chip's clock, and seen. */
const SYNCHRONISER = 2;
/** Clocks of a byte at 1 Mbaud. */
const CLOCKS_A_BYTE = 1250;
const PAINT = 0xcccccccc;

export class Machine {
  /**
   * `elf` is what `readElf` gives. `edges` are changes of pins, counted in clocks from the first
   * clock in which pin `origin` is high, or from the start without it. With `oneClock` every
   * instruction takes one clock. With `usb` the serial port is that of the USB, not the UART.
   */
  constructor(elf, { edges = [], origin = null, oneClock = false, usb = false, warn = () => {} } = {}) {
    const rp2040 = new RP2040();
    this.rp2040 = rp2040;
    this.elf = elf;
    this.edges = edges;
    this.nextEdge = 0;
    this.origin = origin;
    this.edgesFrom = origin === null ? 0 : null;
    this.oneClock = oneClock;
    this.clocks = 0;
    this.asleep = false;
    /** The exit code, once the image has ended. */
    this.ended = null;
    this.instructions = 0;
    this.sleptClocks = 0;
    this.pioClocks = 0;
    this.triggers = 0;
    this.wasHigh = false;
    /** Clocks spent at each instruction. */
    this.spent = new Float64Array(1 << 19);
    this.input = [];
    this.nextInput = 0;
    this.onOutput = () => {};
    rp2040.logger = { debug() {}, info() {}, warn: (_, text) => warn(text), error: (_, text) => warn(text) };
    for (const { address, bytes } of elf.segments) {
      const [memory, start] = address < RAM ? [rp2040.flash, FLASH] : [rp2040.sram, RAM];
      memory.set(bytes, address - start);
    }
    const inFlash = elf.segments.filter(({ address }) => address < RAM);
    this.codeEnd = Math.max(...inFlash.map(({ address, bytes }) => address + bytes.length - FLASH));
    rp2040.core.VTOR = VECTORS;
    rp2040.core.reset();
    rp2040.onBreak = (code) => this.onBreak(code);
    this.usb = usb ? new USBCDC(rp2040.usbCtrl) : null;
    /** The endpoint that waits for a packet of the host, and its most bytes. */
    this.wanted = null;
    if (usb) {
      this.usb.onSerialData = (bytes) => bytes.forEach((byte) => this.onOutput(byte));
      // Its own forgets a packet that is wanted before it knows the device.
      rp2040.usbCtrl.onEndpointRead = (endpoint, size) => {
        this.wanted = endpoint > 0 ? { endpoint, size } : this.wanted;
      };
    } else {
      rp2040.uart[0].onByte = (byte) => this.onOutput(byte);
    }
    this.fillGaps();
  }

  fillGaps() {
    const { rp2040 } = this;
    for (const uart of rp2040.uart) {
      const { readUint32, writeUint32 } = uart;
      uart.readUint32 = (offset) => (UART_GAPS.has(offset) ? 0 : readUint32.call(uart, offset));
      uart.writeUint32 = (offset, value) => UART_GAPS.has(offset) || writeUint32.call(uart, offset, value);
    }
    const { core, ppb } = rp2040;
    const { exceptionEntry } = core;
    core.exceptionEntry = (number) => {
      exceptionEntry.call(core, number);
      core.PC = (core.PC & ~1) >>> 0;
    };
    const { writeUint32 } = ppb;
    ppb.writeUint32 = (offset, value) =>
      offset === AIRCR ? this.end(1, 'the image resets the chip') : writeUint32.call(ppb, offset, value);
    rp2040.peripherals[0x40058].onWatchdogTrigger = () => this.end(1, 'the watchdog resets the chip');
    for (const pio of rp2040.pio) {
      pio.run = () => {};
    }
    // Asked once a sample and else the sum of 30 pins.
    let levels = 0;
    this.setPin = (pin, level) => {
      rp2040.gpio[pin].setInputValue(level);
      levels = rp2040.gpio.reduce((sum, gpio, index) => sum | (gpio.inputValue ? 1 << index : 0), 0);
    };
    Object.defineProperty(rp2040, 'gpioValues', { get: () => levels });
  }

  end(code, why) {
    if (why) {
      process.stderr.write(`${why}\n`);
    }
    this.ended ??= code;
  }

  onBreak(code) {
    if (code !== 0xab) {
      return this.end(1, `the image stops at ${this.rp2040.core.PC.toString(16)}`);
    }
    const exit = answer(this.rp2040);
    if (exit !== undefined) {
      this.end(exit);
    }
  }

  get pioRuns() {
    return !this.rp2040.pio[0].stopped || !this.rp2040.pio[1].stopped;
  }

  /** Runs for about so many clocks, or until the image ends or sleeps with nothing due by then. */
  run(clocks) {
    const { core } = this.rp2040;
    const until = this.clocks + clocks;
    while (this.clocks < until && this.ended === null) {
      if (this.asleep) {
        this.sleep(until);
        continue;
      }
      const { PC } = core;
      if (PC >>> 28 === 1 && PC - FLASH >= this.codeEnd) {
        return this.end(1, `the image runs on at ${PC.toString(16)}, where no code is`);
      }
      const cycles = core.executeInstruction();
      const taken = this.oneClock ? 1 : cycles;
      this.instructions++;
      this.spent[(PC & 0xfffff) >> 1] += taken;
      if (core.waiting) {
        core.waiting = false;
        this.asleep = !this.interrupted();
      }
      this.advance(taken);
    }
  }

  interrupted() {
    const { core } = this.rp2040;
    return core.pendingSystick || core.pendingPendSV || (core.pendingInterrupts & core.enabledInterrupts) !== 0;
  }

  sleep(until) {
    const { clock } = this.rp2040;
    let clocks = 1;
    if (!this.pioRuns) {
      const toAlarm = clock.nextAlarm ? Math.ceil(clock.nanosToNextAlarm / CLOCK_NS) : Infinity;
      const toInput = this.input.length > 0 ? this.nextInput - this.clocks : Infinity;
      clocks = Math.max(1, Math.min(toAlarm, toInput, until - this.clocks));
    }
    this.sleptClocks += clocks;
    this.advance(clocks);
    this.asleep = !this.interrupted();
  }

  /** Lets so many clocks pass. */
  advance(clocks) {
    if (this.pioRuns) {
      for (let left = clocks; left > 0; left--) {
        this.clocks++;
        this.stepPio();
        this.rp2040.clock.tick(CLOCK_NS);
      }
    } else {
      this.clocks += clocks;
      this.rp2040.clock.tick(clocks * CLOCK_NS);
      this.changePins();
    }
    if (this.input.length > 0 && this.clocks >= this.nextInput) {
      this.feed();
    }
  }

  /** Gives the serial port the next byte, or of the USB the next packet, if it has room. */
  feed() {
    const { uart, usbCtrl } = this.rp2040;
    if (this.usb === null) {
      if (!uart[0].rxFIFO.full) {
        uart[0].feedByte(this.input.shift());
        this.nextInput = this.clocks + CLOCKS_A_BYTE;
      }
    } else if (this.usb.initialized && this.wanted !== null) {
      const { endpoint, size } = this.wanted;
      this.wanted = null;
      usbCtrl.endpointReadDone(endpoint, Uint8Array.from(this.input.splice(0, size)));
    }
  }

  stepPio() {
    this.changePins();
    for (const pio of this.rp2040.pio) {
      if (pio.stopped) {
        continue;
      }
      for (const machine of pio.machines) {
        if (machine.enabled) {
          machine.step();
        }
      }
      pio.checkChangedPins();
    }
    this.pioClocks++;
    if (this.origin !== null) {
      const { gpio, pio } = this.rp2040;
      const isHigh = ((pio[0].pinValues >>> this.origin) & 1) === 1 && gpio[this.origin].outputValue;
      if (isHigh && !this.wasHigh) {
        this.triggers++;
        // What an instruction does to a pin is to be seen outside from the next clock on.
        this.edgesFrom ??= this.clocks + 1;
      }
      this.wasHigh = isHigh;
    }
  }

  changePins() {
    while (
      this.edgesFrom !== null &&
      this.nextEdge < this.edges.length &&
      this.edgesFrom + this.edges[this.nextEdge].clock + SYNCHRONISER <= this.clocks
    ) {
      const { pin, level } = this.edges[this.nextEdge++];
      this.setPin(pin, level);
    }
  }

  /** Bytes of the stack that have been used: cortex-m-rt has painted it. */
  stackUsed() {
    const [end, start] = ['_stack_end', '_stack_start'].map((name) => this.elf.symbols.get(name));
    let at = end;
    while (at < start && this.rp2040.readUint32(at) === PAINT) {
      at += 4;
    }
    return start - at;
  }

  /** The functions that took the most clocks: `{ name, clocks }`. */
  profile(count) {
    const { functions } = this.elf;
    const sums = new Map();
    let index = 0;
    this.spent.forEach((clocks, halfword) => {
      const address = FLASH + 2 * halfword;
      while (index + 1 < functions.length && functions[index + 1].address <= address) {
        index++;
      }
      if (clocks > 0 && functions[index]) {
        sums.set(functions[index].name, (sums.get(functions[index].name) ?? 0) + clocks);
      }
    });
    const sorted = [...sums].sort((a, b) => b[1] - a[1]).slice(0, count);
    return sorted.map(([name, clocks]) => ({ name, clocks }));
  }
}
