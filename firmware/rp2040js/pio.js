// The clock of the PIO's state machines: each that is enabled steps once a clock.
//
// A state machine that only counts is not stepped until its counter runs out. That are two loops:
// `again: jmp x-- again`, and `again: in pins, 1` with `jmp x-- again`. What its registers would
// be meanwhile is put in place before somebody looks. All other steps are rp2040js' own.
//
// Delays of instructions and clock dividers are not there.

/** `jmp x--` to address 0, and the bits that are not delay or side-set. */
const JMP_X = 0x0040;
const WITHOUT_SIDE = 0xe0ff;
const IN_PINS_1 = 0x4001;
const AUTOPUSH_RIGHT = (1 << 16) | (1 << 18);
/** Registers of a state machine begin here. */
const STATE_MACHINES = 0x0c8;
const BYTES_OF_ONE = 0x18;
/** SHIFTCTRL within them; a change of its two uppermost bits, FJOIN, empties both queues (3.7, SM0_SHIFTCTRL). */
const SHIFTCTRL = 0x08;
const JOINS = 30;

/** Empties the queues, which rp2040js leaves as they are. */
function empty(machine) {
  machine.rxFIFO.reset();
  machine.txFIFO.reset();
  machine.updateDMARx();
  machine.updateDMATx();
}

export class PioClock {
  /** `now` gives the clock up to which all has happened. `changed` is called when a pin may have. */
  constructor(rp2040, now, changed) {
    this.rp2040 = rp2040;
    this.now = now;
    this.changed = changed;
    /** Enabled state machines: `{ pio, machine, at, due }`. Steps up to clock `at` are done. */
    this.lanes = [];
    /** The clock of the next step that has to be made. */
    this.due = Infinity;
    rp2040.pio.forEach((pio) => this.attach(pio));
  }

  get runs() {
    return this.lanes.length > 0;
  }

  attach(pio) {
    const { readUint32, writeUint32 } = pio;
    pio.run = () => {};
    // A restart has nothing to set back: there are no dividers.
    pio.machines.forEach((machine) => {
      machine.clkDivRestart = () => {};
    });
    pio.readUint32 = (offset) => {
      if (offset >= STATE_MACHINES) {
        this.settle(this.now());
      }
      return readUint32.call(pio, offset);
    };
    pio.writeUint32 = (offset, value) => {
      this.settle(this.now());
      const machine = pio.machines[Math.floor((offset - STATE_MACHINES) / BYTES_OF_ONE)];
      const isShift = (offset - STATE_MACHINES) % BYTES_OF_ONE === SHIFTCTRL;
      if (machine && isShift && (machine.shiftCtrl ^ value) >>> JOINS !== 0) {
        empty(machine);
      }
      writeUint32.call(pio, offset, value);
      this.plan();
    };
  }

  /** Resets a PIO: as rp2040js cannot, another takes its place. */
  reset(index) {
    const { rp2040 } = this;
    const old = rp2040.pio[index];
    const address = Object.keys(rp2040.peripherals).find((key) => rp2040.peripherals[key] === old);
    const pio = new old.constructor(rp2040, old.name, old.firstIrq, index);
    rp2040.pio[index] = pio;
    rp2040.peripherals[address] = pio;
    this.attach(pio);
    pio.checkInterrupts();
    this.settle(this.now());
    this.plan();
  }

  /** All state machines that are enabled now step at the next clock. */
  plan() {
    const at = this.now();
    this.lanes = this.rp2040.pio.flatMap((pio) =>
      pio.machines
        .filter((machine) => machine.enabled)
        .map((machine) => ({ pio, machine, at, due: at + 1 })),
    );
    this.due = this.lanes.length > 0 ? at + 1 : Infinity;
  }

  /** Makes the steps up to clock `clock` that have been put off. */
  settle(clock) {
    for (const lane of this.lanes) {
      this.catchUp(lane, clock);
    }
  }

  catchUp(lane, clock) {
    const { machine } = lane;
    const { instructions } = lane.pio;
    let left = clock - lane.at;
    lane.at = Math.max(lane.at, clock);
    while (left > 0) {
      if (instructions[machine.pc] !== IN_PINS_1) {
        if ((instructions[machine.pc] & WITHOUT_SIDE) === (JMP_X | machine.pc)) {
          machine.x = (machine.x - left) >>> 0;
          return;
        }
        machine.step();
        left--;
      } else if (left === 1) {
        machine.step();
        return;
      } else {
        const samples = Math.min(left >> 1, 31);
        const isHigh = (machine.inPins & 1) === 1;
        const shifted = machine.inputShiftReg >>> samples;
        machine.inputShiftReg = isHigh ? shifted | (-1 << (32 - samples)) : shifted;
        machine.inputShiftCount += samples;
        machine.x = (machine.x - samples) >>> 0;
        left -= 2 * samples;
      }
    }
  }

  /** Makes the steps of clock `clock`. */
  step(clock) {
    let due = Infinity;
    for (const lane of this.lanes) {
      if (lane.due <= clock) {
        const { pio, machine } = lane;
        this.catchUp(lane, clock - 1);
        const { pinValues, pinDirections } = pio;
        const { pc } = machine;
        machine.step();
        lane.at = clock;
        lane.due = clock + 1 + this.idle(lane, pc);
        if (pinValues !== pio.pinValues || pinDirections !== pio.pinDirections) {
          this.changed(clock);
        }
      }
      due = Math.min(due, lane.due);
    }
    this.due = due;
  }

  /** How many of the next steps only count, after one of the instruction at `last`. */
  idle({ pio, machine }, last) {
    const { pc } = machine;
    const { instructions } = pio;
    if (machine.waiting) {
      return 0;
    }
    // The step before has set the pins as this instruction does.
    if (pc === last && (instructions[pc] & WITHOUT_SIDE) === (JMP_X | pc)) {
      return machine.x;
    }
    const samples =
      instructions[pc] === IN_PINS_1 &&
      instructions[pc + 1] === (JMP_X | pc) &&
      machine.sidesetCount === 0 &&
      machine.wrapTop !== pc &&
      (machine.shiftCtrl & AUTOPUSH_RIGHT) === AUTOPUSH_RIGHT;
    if (!samples) {
      return 0;
    }
    const toPush = machine.pushThreshold - 1 - machine.inputShiftCount;
    return 2 * Math.max(0, Math.min(machine.x, toPush));
  }
}
