// Arm's semihosting: an image's requests to its debugger, as far as the images use them.

import { writeSync } from 'node:fs';

const OPEN = 0x01;
const CLOSE = 0x02;
const WRITE = 0x05;
const ERRNO = 0x13;
const EXIT = 0x18;
const EXIT_EXTENDED = 0x20;
/** `ADP_Stopped_ApplicationExit` */
const APPLICATION_EXIT = 0x20026;

/** Answers one request; gives the exit code if the image ends with it, else undefined. */
export function answer(rp2040) {
  const { registers } = rp2040.core;
  const word = (index) => rp2040.readUint32(registers[1] + 4 * index);
  switch (registers[0]) {
    case OPEN: {
      // Only the console: opened for writing it is standard output, for appending standard error.
      const name = Array.from({ length: word(2) }, (_, at) => rp2040.readUint8(word(0) + at));
      const isConsole = String.fromCharCode(...name) === ':tt';
      registers[0] = isConsole && word(1) >= 4 ? (word(1) >= 8 ? 2 : 1) : 0xffffffff;
      return undefined;
    }
    case WRITE: {
      const [handle, from, length] = [word(0), word(1), word(2)];
      const bytes = Uint8Array.from({ length }, (_, at) => rp2040.readUint8(from + at));
      for (let done = 0; done < length; ) {
        done += writeSync(handle, bytes, done);
      }
      registers[0] = 0;
      return undefined;
    }
    case CLOSE:
    case ERRNO:
      registers[0] = 0;
      return undefined;
    case EXIT:
      return registers[1] === APPLICATION_EXIT ? 0 : 1;
    case EXIT_EXTENDED:
      return word(0) === APPLICATION_EXIT ? word(1) : 1;
    default:
      throw new Error(`the image asks for semihosting operation ${registers[0]}, which is not there`);
  }
}
