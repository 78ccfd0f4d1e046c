// A Raspberry Pi Pico with an image: its clock, its resets, its serial port, and the record of
// what its laser's pin does. `chip.js` lists the emulated parts of the chip.
//
// It runs rp2040js, which leaves this to its caller:
//
// - It has one core and no boot ROM: the image starts at its vector table, as the second stage
//   of the boot would start it. As on the chip the last 256 bytes of the memory then are that second
//   stage, and the stack of the boot ROM is taken to have used 256 bytes below.
// - All runs at 125 MHz. On the chip the boot ROM and the start of an image after a reset of the chip
//   run at about 6.5 MHz, and the boot ROM takes its time, which is not there.
// - State machines of the PIO do not step with the core: see `pio.js`.
// - A DMA transfer of a word is an alarm of the clock.
// - An interrupt that comes while the core sleeps would be taken even when all are held back. So
//   the core never sleeps for long: this file knows that it does.
//
// Resets. The watchdog, when it is triggered or its timer has run out, resets the chip: all
// starts again except memory, the watchdog's scratch registers, its reason, and what this file has
// recorded. A write of AIRCR.SYSRESETREQ resets the core alone: PIO, DMA, pins and peripherals go on,
// until the image resets them. The flash is the image's file again after either. Clocks are counted
// from power-on.

import { Chip, FLASH } from './chip.js';
import { CLOCK_NS } from './edges.js';
import { FAULTS } from './faults.js';
import { Host } from './host.js';
import { level, milliseconds, Pulses } from './pulses.js';
import { answer } from './semihosting.js';

/** Clocks until a pin's level is in step with the chip's clock, and seen. */
const SYNCHRONISER = 2;
/** Clocks of a byte at 1 Mbaud. */
const CLOCKS_A_BYTE = 1250;
const CLOCKS_A_MS = 125_000;
const PAINT = 0xcccccccc;
const BRANCH_TO_ITSELF = 0xe7fe;
/** The value of REASON of the watchdog after a reset of the chip. */
const REASONS = { watchdog: 1, forced: 2 };
/** Functions that only a panic reaches. */
const PANIC_HANDLERS = /on_panic|rust_begin_unwind/;

export class Machine {
  /**
   * `elf` is what `readElf` gives. `edges` are changes of pins, counted in clocks from the first
   * clock in which pin `laser` is high if `fromLaser`, else from the start. With `oneClock` every
   * instruction takes one clock. With `usb` the serial port is that of the USB, not the UART. After
   * `boots` boots it ends. `plant` is `{ kind, ms }`, counted from the first pulse of the laser.
   */
  constructor(
    elf,
    {
      edges = [],
      laser = 2,
      fromLaser = false,
      oneClock = false,
      usb = false,
      boots = 10,
      plant = null,
      warn = () => {},
    } = {},
  ) {
    this.elf = elf;
    this.edges = edges;
    this.nextEdge = 0;
    this.laser = laser;
    this.pulses = new Pulses();
    this.edgesFrom = fromLaser ? null : 0;
    this.oneClock = oneClock;
    this.mostBoots = boots;
    this.plant = plant;
    this.warn = warn;
    this.codeEnd = Chip.codeEnd(elf);
    this.clocks = 0;
    /** The exit code, once the image has ended. */
    this.ended = null;
    this.instructions = 0;
    this.sleptClocks = 0;
    this.pioClocks = 0;
    /** Clocks spent at each instruction. */
    this.spent = new Float64Array(1 << 19);
    this.input = [];
    this.nextInput = 0;
    this.onOutput = () => {};
    /** The same of the UART if the serial port is that of the USB. */
    this.uartInput = [];
    this.onUartOutput = () => {};
    /** The device of the USB has gone from the host, which had its port open. */
    this.onGone = () => {};
    /** Clocks of events. */
    this.lastInput = null;
    this.dtrLow = null;
    this.planted = null;
    /** The clock from which the fault is due. */
    this.plantFrom = Infinity;
    /** The clock and the reason of each boot. */
    this.boots = [];
    this.host = usb
      ? new Host({
          onBytes: (bytes) => bytes.forEach((byte) => this.onOutput(byte)),
          onClosed: () => {
            this.dtrLow = this.clocks;
          },
          onGone: () => this.onGone(),
        })
      : null;
    /** Levels of the pins from outside. */
    this.inputs = new Set();
    this.levels = 0;
    this.powerOn();
  }

  get rp2040() {
    return this.chip.rp2040;
  }

  powerOn() {
    this.makeChip();
    this.boot('power');
  }

  makeChip() {
    /** The clock at which that of the chip was 0. */
    this.origin = this.clocks;
    this.chip = null;
    const chip = new Chip(this.elf, {
      now: () => this.clocks,
      changed: (clock) => this.changed(clock),
      onReset: (kind) => this.onReset(kind),
      onUsbReset: () => this.host?.attach(this.rp2040.usbCtrl),
      onBreak: () => this.onBreak(),
      warn: this.warn,
    });
    this.chip = chip;
    if (this.host === null) {
      this.uartInput = this.input;
      chip.rp2040.uart[0].onByte = (byte) => this.onOutput(byte);
    } else {
      chip.rp2040.uart[0].onByte = (byte) => this.onUartOutput(byte);
      this.host.attach(chip.rp2040.usbCtrl);
    }
    // Asked once a sample and else the sum of 30 pins.
    Object.defineProperty(chip.rp2040, 'gpioValues', { get: () => this.levels });
    this.inputs.forEach((pin) => chip.rp2040.gpio[pin].setInputValue(true));
    this.changed(this.clocks);
  }

  boot(reason) {
    this.asleep = false;
    /** The requested reset. */
    this.request = null;
    if (this.boots.length === this.mostBoots) {
      return this.end(1, `the image has booted ${this.mostBoots} times`);
    }
    this.boots.push({ clock: this.clocks, reason });
  }

  onReset(kind) {
    // The stronger one holds.
    this.request = this.request === null || this.request === 'core' ? kind : this.request;
  }

  reset() {
    const kind = this.request;
    if (kind === 'core') {
      this.chip.resetCore();
    } else {
      const old = this.chip;
      this.makeChip();
      this.chip.inherit(old, REASONS[kind]);
    }
    this.boot(kind);
  }

  end(code, why) {
    if (why) {
      process.stderr.write(`${why}\n`);
    }
    this.ended ??= code;
  }

  onBreak() {
    const exit = answer(this.rp2040);
    if (exit !== undefined) {
      this.end(exit);
    }
  }

  /** A pin may have changed: its output, or how its input comes in. */
  changed(clock) {
    if (this.chip === null) {
      return;
    }
    const { gpio } = this.rp2040;
    if (this.inputs.size > 0) {
      this.levels = gpio.reduce((sum, pin, index) => sum | (pin.inputValue ? 1 << index : 0), 0);
    }
    const begins = this.pulses.update(level(gpio[this.laser]), clock);
    if (begins && this.pulses.count === 1) {
      // What an instruction does to a pin is to be seen outside from the next clock on.
      this.edgesFrom ??= clock + 1;
      if (this.plant !== null) {
        this.plantFrom = clock + this.plant.ms * CLOCKS_A_MS;
      }
    }
  }

  setPin(pin, isHigh) {
    // Samples before the change are of the level before.
    this.chip.pio.settle(this.clocks - 1);
    this.inputs[isHigh ? 'add' : 'delete'](pin);
    this.rp2040.gpio[pin].setInputValue(isHigh);
    this.levels = this.rp2040.gpio.reduce((sum, gpio, index) => sum | (gpio.inputValue ? 1 << index : 0), 0);
  }

  /** Runs for about this many clocks, or until the image ends. */
  run(clocks) {
    const until = this.clocks + clocks;
    while (this.clocks < until && this.ended === null) {
      if (this.request !== null) {
        this.reset();
      } else if (this.clocks >= this.plantFrom && !this.asleep) {
        this.plantFault();
      } else if (this.chip.isLockedUp) {
        this.pass(until);
      } else if (this.asleep) {
        this.pass(until);
        this.asleep = !this.interrupted();
      } else {
        this.step();
      }
    }
  }

  step() {
    const { chip } = this;
    const { core } = chip.rp2040;
    if (core.interruptsUpdated) {
      chip.takeInterrupts();
    }
    const { PC } = core;
    if (PC >>> 28 === 1 && PC - FLASH >= this.codeEnd) {
      return this.end(1, `the image runs on at ${PC.toString(16)}, where no code is`);
    }
    const cycles = chip.step();
    const taken = this.oneClock ? 1 : cycles;
    this.instructions++;
    this.spent[(PC & 0xfffff) >> 1] += taken;
    if (core.waiting) {
      core.waiting = false;
      this.asleep = !this.interrupted();
    } else if (core.PC === PC && core.readUint16(PC) === BRANCH_TO_ITSELF) {
      // Only an interrupt ends it.
      this.asleep = !this.interrupted();
    }
    this.advance(this.clocks + taken);
  }

  plantFault() {
    // The instruction that the fault is planted at is the next one.
    this.chip.takeInterrupts();
    if (FAULTS[this.plant.kind](this)) {
      this.planted = this.clocks;
      this.plantFrom = Infinity;
    } else {
      this.step();
    }
  }

  interrupted() {
    const { core } = this.rp2040;
    return core.pendingSystick || core.pendingPendSV || (core.pendingInterrupts & core.enabledInterrupts) !== 0;
  }

  /** The clock of the next alarm. */
  get nextAlarm() {
    const { nextAlarm } = this.rp2040.clock;
    return nextAlarm ? this.origin + Math.ceil(nextAlarm.nanos / CLOCK_NS) : Infinity;
  }

  /** The clock in which the next edge comes. */
  get nextChange() {
    const isDue = this.edgesFrom !== null && this.nextEdge < this.edges.length;
    return isDue ? this.edgesFrom + this.edges[this.nextEdge].clock + SYNCHRONISER : Infinity;
  }

  /** Lets time pass until something happens, without instructions. */
  pass(until) {
    const from = this.clocks;
    const toInput = this.hasInput ? this.nextInput : Infinity;
    const plant = this.plantFrom > from ? this.plantFrom : Infinity;
    const next = Math.min(until, this.nextAlarm, this.chip.pio.due, this.nextChange, toInput, plant);
    this.advance(Math.max(from + 1, Math.ceil(next)));
    this.sleptClocks += this.clocks - from;
  }

  /** Lets time pass up to clock `until`. */
  advance(until) {
    const { pio } = this.chip;
    const { clock } = this.chip.rp2040;
    const from = this.clocks;
    if (pio.due > until && this.nextChange > until) {
      this.clocks = until;
      clock.tick((until - from) * CLOCK_NS);
    } else {
      this.advanceInSteps(until);
    }
    if (pio.runs) {
      this.pioClocks += until - from;
    }
    if (this.hasInput && this.clocks >= this.nextInput) {
      this.feed();
    }
  }

  get hasInput() {
    return this.input.length > 0 || this.uartInput.length > 0;
  }

  advanceInSteps(until) {
    const { pio } = this.chip;
    const { clock } = this.chip.rp2040;
    while (this.clocks < until) {
      const next = Math.max(this.clocks + 1, Math.min(until, pio.due, this.nextChange, this.nextAlarm));
      if (next > this.clocks + 1) {
        clock.tick((next - 1 - this.clocks) * CLOCK_NS);
      }
      this.clocks = next;
      while (this.nextChange <= next) {
        const { pin, level: isHigh } = this.edges[this.nextEdge++];
        this.setPin(pin, isHigh);
      }
      if (pio.due <= next) {
        pio.step(next);
      }
      clock.tick(CLOCK_NS);
    }
  }

  /** Gives the UART the next byte, and the USB the next packet, if they have room. */
  feed() {
    const [uart] = this.rp2040.uart;
    if (this.host !== null && this.input.length > 0 && this.host.send(this.input)) {
      this.lastInput = this.clocks;
    }
    if (this.uartInput.length > 0 && !uart.rxFIFO.full) {
      uart.feedByte(this.uartInput.shift());
      this.lastInput = this.clocks;
      this.nextInput = this.clocks + CLOCKS_A_BYTE;
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

  /** What has been done. */
  report() {
    const { clocks, instructions, sleptClocks, pioClocks } = this;
    const time = (clock) => (clock === null ? null : milliseconds(clock));
    const panicked = this.elf.functions.some(
      ({ name, address }) => PANIC_HANDLERS.test(name) && this.spent[(address & 0xfffff) >> 1] > 0,
    );
    return {
      clocks,
      instructions,
      sleptClocks,
      pioClocks,
      stack: this.stackUsed(),
      endMs: milliseconds(clocks),
      laser: this.pulses.report(clocks),
      lastInputMs: time(this.lastInput),
      dtrLowMs: time(this.dtrLow),
      plantedMs: time(this.planted),
      bootsMs: this.boots.map(({ clock }) => milliseconds(clock)),
      bootReasons: this.boots.map(({ reason }) => reason),
      panicked,
      hardFaults: this.chip.hardFaults,
      isLockedUp: this.chip.isLockedUp,
    };
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
