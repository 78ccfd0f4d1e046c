// Levels of pins over time, from a file: one change a line, `nanoseconds pin level`, in order.

import { readFileSync } from 'node:fs';

/** Nanoseconds of a clock at 125 MHz. */
export const CLOCK_NS = 8;

/**
 * The changes of a file, each `{ clock, pin, level }`. A change is seen by the clock during
 * which it comes.
 */
export function readEdges(path) {
  const edges = [];
  let last = 0;
  readFileSync(path, 'utf8')
    .split('\n')
    .forEach((line, index) => {
      const text = line.split('#')[0].trim();
      if (text === '') {
        return;
      }
      const words = text.split(/\s+/).map(Number);
      const [ns, pin, level] = words;
      const isRight =
        words.length === 3 && ns >= last && Number.isInteger(pin) && pin >= 0 && pin < 30 && (level === 0 || level === 1);
      if (!isRight) {
        throw new Error(`${path}:${index + 1}: not \`nanoseconds pin level\` in order: ${line}`);
      }
      last = ns;
      edges.push({ clock: Math.floor(ns / CLOCK_NS), pin, level: level === 1 });
    });
  return edges;
}
