// Runs an image of the Raspberry Pi Pico until it ends or is interrupted.

import { createServer } from 'node:net';
import { parseArgs } from 'node:util';
import { CLOCK_NS, readEdges } from './edges.js';
import { readElf } from './elf.js';
import { milliseconds } from './pulses.js';

// Both need a package.
const files = [import('./faults.js'), import('./machine.js')];
const [{ FAULTS }, { Machine }] = await Promise.all(files).catch((error) => {
  const isMissing = error.code === 'ERR_MODULE_NOT_FOUND';
  const reason = isMissing ? 'rp2040js is missing: npm ci --prefix firmware/rp2040js' : error.message;
  process.stderr.write(`error: ${reason}\n`);
  process.exit(1);
});

const HELP = `\
node run.js IMAGE [options]

  --port N        put the serial port on this TCP port of this computer
  --edges FILE    change pins as in the file: lines of \`nanoseconds pin level\`
  --from PIN      count the file's time from the first clock in which this pin is high, and
                  record the pulses of this pin; without it those of pin 2, the laser's
  --usb           put the serial port of the USB there, not the UART. A client that connects
                  opens it (DTR and RTS), and one that disconnects closes it
  --uart N        with --usb: put the UART on this TCP port
  --plant KIND@MS plant a fault, so many milliseconds after the laser's first pulse. KIND is
                    fault       an undefined instruction: a hard fault
                    hang        a loop without end; interrupts go on
                    lockup      the core stops; all else goes on
                    halt        a debugger halts the core
                    clock       the processor's timer stops; all else goes on
                    core-reset  the core is reset, and nothing else
                    overflow    a function begins with no room on the stack: the core locks up
                    overflow-entered
                                the same, but the handler of the hard fault is entered
                    panic       a function that panics is called
                    bus-reset   with --usb: the host resets the bus, and does no more
                    starve      a state machine gets no dither for some laser cycles
  --boots N       end with a failure instead of booting once more than this (10)
  --attached      end when standard input does
  --for MS        with a port: end so many milliseconds after the last of these: the client has
                  gone, DTR is low, the fault is planted. Once the client has gone,
                  time runs as fast as it can
  --count         let every instruction take one clock: the timer then counts them
  --report        print what it has done, and where time went, to standard error at the end
  --warn          print what the emulator lacks

Times are those of the image, in milliseconds since power-on where the report has them. A
watchdog resets the chip; AIRCR resets the core alone. The image then boots again. It ends by
semihosting.`;

/** Clocks between two looks at the serial port's client. */
const SLICE = 50_000;

function main() {
  const { values, positionals } = parseArgs({
    allowPositionals: true,
    options: {
      port: { type: 'string' },
      edges: { type: 'string' },
      from: { type: 'string' },
      plant: { type: 'string' },
      boots: { type: 'string' },
      for: { type: 'string' },
      attached: { type: 'boolean' },
      count: { type: 'boolean' },
      usb: { type: 'boolean' },
      uart: { type: 'string' },
      report: { type: 'boolean' },
      warn: { type: 'boolean' },
      help: { type: 'boolean', short: 'h' },
    },
  });
  if (values.help || positionals.length !== 1) {
    process.stderr.write(`${HELP}\n`);
    process.exit(values.help ? 0 : 2);
  }
  const whole = (name) => {
    const number = Number(values[name]);
    if (values[name] !== undefined && !(Number.isInteger(number) && number >= 0)) {
      throw new Error(`--${name} takes a whole number`);
    }
    return values[name] === undefined ? undefined : number;
  };
  const machine = new Machine(readElf(positionals[0]), {
    edges: values.edges ? readEdges(values.edges) : [],
    laser: whole('from'),
    fromLaser: values.from !== undefined,
    oneClock: values.count === true,
    usb: values.usb === true,
    boots: whole('boots'),
    plant: values.plant === undefined ? null : readPlant(values.plant),
    warn: values.warn ? (text) => process.stderr.write(`emulator: ${text}\n`) : undefined,
  });
  const done = () => finish(machine, values.report);
  if (values.port === undefined) {
    while (machine.ended === null) {
      machine.run(SLICE);
    }
    return done();
  }
  if (values.attached) {
    process.stdin.on('end', () => machine.end(0)).resume();
  }
  if (values.uart !== undefined) {
    serveUart(machine, whole('uart'));
  }
  serve(machine, whole('port'), whole('for') ?? null, done);
}

function readPlant(text) {
  const [kind, ms, ...more] = text.split('@');
  const isRight = more.length === 0 && Object.hasOwn(FAULTS, kind) && /^\d+(\.\d+)?$/.test(ms ?? '');
  if (!isRight) {
    throw new Error(`--plant takes KIND@MS, where KIND is ${Object.keys(FAULTS).join(', ')}`);
  }
  return { kind, ms: Number(ms) };
}

/**
 * Runs it with its serial port on a TCP port, never ahead of this computer's time. With `forMs`
 * it ends by itself, and is ahead once its client has gone.
 */
function serve(machine, port, forMs, done) {
  let client = null;
  let output = [];
  /** The clock at which the last client went. */
  let gone = null;
  machine.onOutput = (byte) => output.push(byte);
  machine.onGone = () => client?.destroy();
  const server = createServer({ noDelay: true }, (socket) => {
    client?.destroy();
    client = socket;
    machine.host?.open();
    socket.on('data', (bytes) => machine.input.push(...bytes));
    socket.on('error', () => {});
    socket.on('close', () => {
      if (client === socket) {
        client = null;
        gone = machine.clocks;
      }
    });
  });
  server.on('error', (error) => {
    process.stderr.write(`error: ${error.message}\n`);
    process.exit(1);
  });
  const isOver = () => {
    const isWaiting = machine.plant !== null && machine.planted === null;
    if (forMs === null || client !== null || gone === null || machine.host?.isOpen || isWaiting) {
      return false;
    }
    const last = Math.max(gone, machine.dtrLow ?? 0, machine.planted ?? 0);
    return milliseconds(machine.clocks - last) >= forMs;
  };
  const start = performance.now();
  const turn = () => {
    if (client === null && machine.input.length === 0) {
      // Like a kernel, which first sends the data already written.
      machine.host?.close();
    }
    machine.run(SLICE);
    if (output.length > 0) {
      client?.write(Buffer.from(output));
      output = [];
    }
    if (isOver()) {
      machine.end(0);
    }
    if (machine.ended !== null) {
      return done();
    }
    const ahead = (machine.clocks * CLOCK_NS) / 1e6 - (performance.now() - start);
    const isFree = forMs !== null && client === null && gone !== null;
    // Idle time must not run ahead of the client's; busy time is behind it.
    if (ahead > 2 && !isFree) {
      setTimeout(turn, ahead);
    } else {
      setImmediate(turn);
    }
  };
  server.listen(port, '127.0.0.1', turn);
}

/** Puts the UART of a machine whose serial port is the USB's on a TCP port. */
function serveUart(machine, port) {
  const server = createServer({ noDelay: true }, (socket) => {
    machine.onUartOutput = (byte) => socket.write(Uint8Array.of(byte));
    socket.on('data', (bytes) => machine.uartInput.push(...bytes));
    socket.on('error', () => {});
  });
  server.listen(port, '127.0.0.1');
}

function finish(machine, report) {
  if (report) {
    process.stderr.write(`${JSON.stringify({ ...machine.report(), functions: machine.profile(12) })}\n`);
  }
  process.exit(machine.ended);
}

try {
  main();
} catch (error) {
  process.stderr.write(`error: ${error.message}\n`);
  process.exit(1);
}
