//! The photon timer: three state machines of PIO0 in step with each other.
//!
//! One makes the laser's pulse. The other two sample the SPAD's pin, each every other clock,
//! because sampling and counting take one instruction each. All three have the same
//! period and are started by the same write. What the dither adds to a laser cycle comes to all three by DMA,
//! from one table that is read over and over. The first sample is three clocks after the
//! instruction that begins the pulse: the pulse leaves the chip one clock after its instruction,
//! and the input synchroniser delays a sample by two. So bin 0 begins with the pulse, except for
//! the delays of pads and wires.

use core::sync::atomic::{AtomicBool, Ordering};

use dtof_sensors::dither::Dither;
use pio::{
    Instruction, InstructionOperands, JmpCondition, MovDestination, MovOperation, MovSource,
    Program,
};

use super::SensorPort;
use super::chip::hal::gpio::bank0::{Gpio2, Gpio3};
use super::chip::hal::gpio::{FunctionPio0, OutputOverride, Pin, PullDown};
use super::chip::hal::pac::{IO_BANK0, PIO0, RESETS};
use super::chip::hal::pio::{
    PIO, PIOBuilder, PIOExt, PinDir, Running, Rx, SM0, SM1, SM2, ShiftDirection, StateMachine,
    StateMachineGroup3, StateMachineIndex, Stopped, Tx, UninitStateMachine,
};
use super::chip::registers::{RESET_PIO0, RESET_SET};
use super::sample_rings::{self, Queue, SampleRings};
use crate::photon_timer::{Config, PhotonTimer, Sampler, Samples};

/// The timer runs.
pub static RUNS: AtomicBool = AtomicBool::new(false);

const LASER: u8 = 2;
const SPAD: u8 = 3;

/// The laser's pulse, and the SPAD's pulses.
pub type Pins = (
    Pin<Gpio2, FunctionPio0, PullDown>,
    Pin<Gpio3, FunctionPio0, PullDown>,
);

type Installed = super::chip::hal::pio::InstalledProgram<PIO0>;
type Machine<SM> = (UninitStateMachine<(PIO0, SM)>, Installed);

/// The stopped state machines and their programs. The samplers share one.
struct Idle {
    laser: Machine<SM0>,
    even: Machine<SM1>,
    odd: Machine<SM2>,
}

type Ends<SM> = (Rx<(PIO0, SM)>, Tx<(PIO0, SM)>);

/// The running state machines.
struct Steps {
    group: StateMachineGroup3<PIO0, SM0, SM1, SM2, Running>,
    laser: Ends<SM0>,
    even: Ends<SM1>,
    odd: Ends<SM2>,
}

/// The hardware of a photon timer.
pub struct Hardware {
    idle: Option<Idle>,
    steps: Option<Steps>,
    rings: SampleRings,
    resets: RESETS,
    _pio: PIO<PIO0>,
    pins: Pins,
}

/// The sampler of odd clocks; that of even clocks begins one instruction later. A cycle pushes the level
/// before it as a word of its own, takes 64 samples two clocks apart, in two loops because a counter can be set
/// to 31 at most, and rests for `y + 2` clocks and as many more as the dither adds.
fn sampler_program() -> Program<32> {
    pio::pio_asm!(
        "    mov y, y",
        ".wrap_target",
        "    set x, 30",
        "    in pins, 1",
        "    push block",
        "first:",
        "    in pins, 1",
        "    jmp x-- first",
        "    in pins, 1",
        "    set x, 31",
        "second:",
        "    in pins, 1",
        "    jmp x-- second",
        "    mov x, y",
        "rest:",
        "    jmp x-- rest",
        "    pull block",
        "    out x, 8",
        "added:",
        "    jmp x-- added",
        ".wrap",
    )
    .program
}

impl SensorPort {
    /// A photon timer: the laser's pulse leaves at GP2, the SPAD's pulses come at GP3.
    ///
    /// # Panics
    /// Never: both programs fit.
    #[must_use]
    pub fn photon_timer(mut self, config: Config) -> PhotonTimer<Hardware> {
        // An input of RP2350 may hold a pin high against its own pull-down (RP2350-E9).
        self.pins.0.set_input_enable(false);
        let (mut pio, laser, even, odd, _) = self.pio.split(&mut self.resets);
        let mut install = |program: Program<32>| match pio.install(&program) {
            Ok(installed) => installed,
            Err(_) => panic!("the programs of the photon timer do not fit"),
        };
        let laser = (laser, install(laser_program()));
        let of_odd = install(sampler_program());
        // SAFETY: the program is never uninstalled.
        #[allow(unsafe_code, reason = "two state machines run one program")]
        let of_even = unsafe { of_odd.share() };
        let idle = Idle {
            laser,
            even: (even, of_even),
            odd: (odd, of_odd),
        };
        let hardware = Hardware {
            idle: Some(idle),
            steps: None,
            rings: SampleRings::new(self.dma),
            resets: self.resets,
            _pio: pio,
            pins: self.pins,
        };
        PhotonTimer::new(hardware, config)
    }
}

/// Holds the laser off from now on: the state machines go on when the processor fails.
pub fn laser_off() {
    // SAFETY: the register is that of the laser's pin alone, and the image does nothing more.
    #[allow(unsafe_code, reason = "there is no handle of the peripheral here")]
    let control = unsafe { &*IO_BANK0::PTR }.gpio(LASER.into()).gpio_ctrl();
    control.modify(|_, w| w.outover().low());
}

/// Resets PIO0 before anything else, as a reset of the processor alone does not: its state
/// machines would fire the laser until the memory is set up, some milliseconds.
#[unsafe(naked)]
#[unsafe(no_mangle)]
#[allow(
    unsafe_code,
    reason = "cortex-m-rt calls it by this name, before there is memory"
)]
unsafe extern "C" fn __pre_init() {
    core::arch::naked_asm!(
        "ldr r0, ={set}",
        "ldr r1, ={pio0}",
        "str r1, [r0]",
        "bx lr",
        ".pool",
        set = const RESET_SET,
        pio0 = const RESET_PIO0,
    )
}

/// High for `y + 2` clocks, low for `isr + 5` and as many more as the dither adds.
fn laser_program() -> Program<32> {
    pio::pio_asm!(
        ".side_set 1",
        ".wrap_target",
        "    mov x, y        side 1",
        "high:",
        "    jmp x-- high    side 1",
        "    mov x, isr      side 0",
        "low:",
        "    jmp x-- low     side 0",
        "    pull block      side 0",
        "    out x, 8        side 0",
        "added:",
        "    jmp x-- added   side 0",
        ".wrap",
    )
    .program
}

/// Puts a number into a register.
fn preset<SM: StateMachineIndex>(
    machine: &mut StateMachine<(PIO0, SM), Stopped>,
    tx: &mut Tx<(PIO0, SM)>,
    destination: MovDestination,
    number: u32,
) {
    tx.write(number);
    let pull = InstructionOperands::PULL {
        if_empty: false,
        block: false,
    };
    let mov = InstructionOperands::MOV {
        destination,
        op: MovOperation::None,
        source: MovSource::OSR,
    };
    for operands in [pull, mov] {
        machine.exec_instruction(now(operands));
    }
}

/// An instruction that leaves the laser's pin low.
const fn now(operands: InstructionOperands) -> Instruction {
    Instruction {
        operands,
        delay: 0,
        side_set: Some(0),
    }
}

/// A sampler that begins `skipped` instructions later.
fn sampler<SM: StateMachineIndex>(
    (machine, program): Machine<SM>,
    skipped: u8,
    rest: u32,
) -> (StateMachine<(PIO0, SM), Stopped>, Ends<SM>) {
    let begin = InstructionOperands::JMP {
        condition: JmpCondition::Always,
        address: program.offset() + skipped,
    };
    let (mut machine, rx, mut tx) = PIOBuilder::from_installed_program(program)
        .in_pin_base(SPAD)
        .in_shift_direction(ShiftDirection::Right)
        .out_shift_direction(ShiftDirection::Right)
        .autopush(true)
        .build(machine);
    machine.clear_fifos();
    preset(&mut machine, &mut tx, MovDestination::Y, rest);
    machine.exec_instruction(now(begin));
    (machine, (rx, tx))
}

impl Sampler for Hardware {
    const KEPT: u32 = sample_rings::KEPT;

    fn start(&mut self, config: &Config, dither: Dither) {
        self.stop();
        let Some(Idle { laser, even, odd }) = self.idle.take() else {
            return;
        };
        // The queues take the numbers of the registers first.
        self.rings.stop(&mut self.resets);
        let range = dither.range();
        let (machine, program) = laser;
        let (mut laser, rx, mut tx) = PIOBuilder::from_installed_program(program)
            .side_set_pin_base(LASER)
            .out_shift_direction(ShiftDirection::Right)
            .build(machine);
        laser.set_pindirs([(LASER, PinDir::Output)]);
        laser.clear_fifos();
        let [pulse, pause] = config.laser_counters(range);
        preset(&mut laser, &mut tx, MovDestination::Y, pulse);
        preset(&mut laser, &mut tx, MovDestination::ISR, pause);
        let rest = config.sampler_counter(range);
        let (even, even_ends) = sampler(even, 1, rest);
        let (odd, odd_ends) = sampler(odd, 0, rest);
        let samples = [Queue::read(&even_ends.0), Queue::read(&odd_ends.0)];
        let added = [
            Queue::write(&tx),
            Queue::write(&even_ends.1),
            Queue::write(&odd_ends.1),
        ];
        self.rings.start(samples, added, dither);
        self.pins.0.set_output_override(OutputOverride::DontInvert);
        self.steps = Some(Steps {
            group: laser.with(even).with(odd).start(),
            laser: (rx, tx),
            even: even_ends,
            odd: odd_ends,
        });
        RUNS.store(true, Ordering::Relaxed);
    }

    fn stop(&mut self) {
        if let Some(steps) = self.steps.take() {
            // First: a state machine that halts within a pulse would make it longer.
            self.pins.0.set_output_override(OutputOverride::AlwaysLow);
            let (mut laser, even, odd) = steps.group.stop().free();
            laser.set_pins([(LASER, super::chip::hal::pio::PinState::Low)]);
            self.idle = Some(Idle {
                laser: laser.uninit(steps.laser.0, steps.laser.1),
                even: even.uninit(steps.even.0, steps.even.1),
                odd: odd.uninit(steps.odd.0, steps.odd.1),
            });
            RUNS.store(false, Ordering::Relaxed);
        }
    }

    fn completed(&mut self) -> u32 {
        self.rings.completed()
    }

    fn samples(&self, cycle: u32) -> Samples {
        self.rings.samples(cycle)
    }

    fn has_stalled(&self) -> bool {
        self.rings.has_stalled()
    }
}
