// Runs an image of the Raspberry Pi Pico until it ends or is interrupted.

import { createServer } from 'node:net';
import { parseArgs } from 'node:util';
import { CLOCK_NS, readEdges } from './edges.js';
import { readElf } from './elf.js';
import { Machine } from './machine.js';

const HELP = `\
node run.js IMAGE [options]

  --port N        put the serial port on this TCP port of this computer
  --edges FILE    change pins as the file says: lines of \`nanoseconds pin level\`
  --from PIN      count the file's time from the first clock in which this pin is high
  --usb           put the serial port of the USB there, not the UART
  --attached      end when standard input does
  --count         let every instruction take one clock: the timer then counts them
  --report        print what it has done, and where time went, to standard error at the end
  --warn          print what the emulator lacks`;

/** Clocks between two looks at the serial port's client. */
const SLICE = 50_000;

function main() {
  const { values, positionals } = parseArgs({
    allowPositionals: true,
    options: {
      port: { type: 'string' },
      edges: { type: 'string' },
      from: { type: 'string' },
      attached: { type: 'boolean' },
      count: { type: 'boolean' },
      usb: { type: 'boolean' },
      report: { type: 'boolean' },
      warn: { type: 'boolean' },
      help: { type: 'boolean', short: 'h' },
    },
  });
  if (values.help || positionals.length !== 1) {
    process.stderr.write(`${HELP}\n`);
    process.exit(values.help ? 0 : 2);
  }
  const numbers = [values.port ?? '0', values.from ?? '0'].map(Number);
  if (!numbers.every((number) => Number.isInteger(number) && number >= 0)) {
    throw new Error('--port and --from take a whole number');
  }
  const machine = new Machine(readElf(positionals[0]), {
    edges: values.edges ? readEdges(values.edges) : [],
    origin: values.from === undefined ? null : numbers[1],
    oneClock: values.count === true,
    usb: values.usb === true,
    warn: values.warn ? (text) => process.stderr.write(`emulator: ${text}\n`) : undefined,
  });
  if (values.port === undefined) {
    while (machine.ended === null) {
      machine.run(SLICE);
    }
    return finish(machine, values.report);
  }
  if (values.attached) {
    process.stdin.on('end', () => machine.end(0)).resume();
  }
  serve(machine, numbers[0], () => finish(machine, values.report));
}

/** Runs it with its serial port on a TCP port, never ahead of this computer's time. */
function serve(machine, port, done) {
  let client = null;
  let output = [];
  machine.onOutput = (byte) => output.push(byte);
  const server = createServer({ noDelay: true }, (socket) => {
    client?.destroy();
    client = socket;
    socket.on('data', (bytes) => machine.input.push(...bytes));
    socket.on('error', () => {});
    socket.on('close', () => {
      client = client === socket ? null : client;
    });
  });
  server.on('error', (error) => {
    process.stderr.write(`error: ${error.message}\n`);
    process.exit(1);
  });
  const start = performance.now();
  const turn = () => {
    machine.run(SLICE);
    if (output.length > 0) {
      client?.write(Buffer.from(output));
      output = [];
    }
    if (machine.ended !== null) {
      return done();
    }
    const ahead = (machine.clocks * CLOCK_NS) / 1e6 - (performance.now() - start);
    // Idle time must not run ahead of the client's; busy time is behind it.
    if (ahead > 2) {
      setTimeout(turn, ahead);
    } else {
      setImmediate(turn);
    }
  };
  server.listen(port, '127.0.0.1', turn);
}

function finish(machine, report) {
  if (report) {
    const functions = machine.profile(12).map(({ name, clocks }) => ({ name, clocks }));
    const { clocks, instructions, sleptClocks, pioClocks, triggers } = machine;
    const stack = machine.stackUsed();
    process.stderr.write(`${JSON.stringify({ clocks, instructions, sleptClocks, pioClocks, triggers, stack, functions })}\n`);
  }
  process.exit(machine.ended);
}

try {
  main();
} catch (error) {
  process.stderr.write(`error: ${error.message}\n`);
  process.exit(1);
}
