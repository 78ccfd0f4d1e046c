// The record of a pin: its pulses, as they leave the chip.

import { CLOCK_NS } from './edges.js';

const NS_A_MS = 1e6;

/** Clocks in milliseconds. */
export function milliseconds(clocks) {
  return (clocks * CLOCK_NS) / NS_A_MS;
}

/**
 * The level of a pin's pad: overrides, output enables and pulls are in it. A pin that nothing
 * drives and nothing pulls up is low.
 */
export function level(gpio) {
  if (gpio.outputEnable && !gpio.outputDisable) {
    return gpio.outputValue;
  }
  return gpio.pullupEnabled && !gpio.pulldownEnabled;
}

/** Pulses of a pin. Clocks count from power-on, over all resets. */
export class Pulses {
  constructor() {
    this.isHigh = false;
    /** Pulses that have begun, and the clock in which the first did. */
    this.count = 0;
    this.first = null;
    /** The clock in which the last pulse began, and the last clock in which the pin was high. */
    this.rise = 0;
    this.lastHigh = null;
    this.longest = 0;
    /** How often each time from one pulse's beginning to the next came, in clocks. */
    this.intervals = new Map();
  }

  /** The level from clock `clock` on. Gives whether a pulse begins. */
  update(isHigh, clock) {
    if (isHigh === this.isHigh) {
      return false;
    }
    this.isHigh = isHigh;
    if (isHigh) {
      if (this.count > 0) {
        const interval = clock - this.rise;
        this.intervals.set(interval, (this.intervals.get(interval) ?? 0) + 1);
      }
      this.count++;
      this.first ??= clock;
      this.rise = clock;
    } else {
      this.lastHigh = clock - 1;
      this.longest = Math.max(this.longest, clock - this.rise);
    }
    return isHigh;
  }

  /** The record up to clock `clock`; a pulse that has not ended counts as long as it is. */
  report(clock) {
    const { count, isHigh } = this;
    const longest = isHigh ? Math.max(this.longest, clock - this.rise) : this.longest;
    const lastHigh = isHigh ? clock : this.lastHigh;
    return {
      pulses: count,
      longestNs: longest * CLOCK_NS,
      firstHighMs: this.first === null ? null : milliseconds(this.first),
      lastHighMs: lastHigh === null ? null : milliseconds(lastHigh),
      isHigh,
      intervals: [...this.intervals].map(([clocks, count]) => [clocks * CLOCK_NS, count]),
    };
  }
}
