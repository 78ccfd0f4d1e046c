//! The photon timer: three state machines of PIO0 in step with each other.
//!
//! One makes the laser's pulse. The other two sample the SPAD's pin, each every other clock,
//! because sampling and counting take one instruction each. All three have the same
//! period and are started by the same write. The first sample is three clocks after the
//! instruction that begins the pulse: the pulse leaves the chip one clock after its instruction,
//! and the input synchroniser delays a sample by two. So bin 0 begins with the pulse, except for
//! the delays of pads and wires.

use core::sync::atomic::{AtomicBool, Ordering};

use pio::{Instruction, InstructionOperands, MovDestination, MovOperation, MovSource, Program};
use rp2040_hal::gpio::bank0::{Gpio2, Gpio3};
use rp2040_hal::gpio::{FunctionPio0, OutputOverride, Pin, PullDown};
use rp2040_hal::pac::{IO_BANK0, PIO0, RESETS};
use rp2040_hal::pio::{
    PIO, PIOBuilder, PIOExt, PinDir, Running, Rx, SM0, SM1, SM2, ShiftDirection, StateMachine,
    StateMachineGroup3, StateMachineIndex, Stopped, Tx, UninitStateMachine,
};

use super::SensorPort;
use super::sample_rings::{self, SampleRings};
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

type Installed = rp2040_hal::pio::InstalledProgram<PIO0>;
type Machine<SM> = (UninitStateMachine<(PIO0, SM)>, Installed);

/// The stopped state machines and their programs.
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

/// The sampler of even clocks, or with one instruction more that of odd clocks. A cycle pushes the
/// level before it as a word of its own, takes `y + 1` samples two clocks apart and rests for
/// `osr + 2` clocks.
macro_rules! sampler_program {
    ($($first:literal)?) => {
        pio::pio_asm!(
            $($first,)?
            ".wrap_target",
            "    mov x, y",
            "    in pins, 1",
            "    push block",
            "sample:",
            "    in pins, 1",
            "    jmp x-- sample",
            "    mov x, osr",
            "rest:",
            "    jmp x-- rest",
            ".wrap",
        )
        .program
    };
}

impl SensorPort {
    /// A photon timer: the laser's pulse leaves at GP2, the SPAD's pulses come at GP3.
    ///
    /// # Panics
    /// Never: both programs fit.
    #[must_use]
    pub fn photon_timer(mut self, config: Config) -> PhotonTimer<Hardware> {
        let (mut pio, laser, even, odd, _) = self.pio.split(&mut self.resets);
        let mut install = |program: Program<32>| match pio.install(&program) {
            Ok(installed) => installed,
            Err(_) => panic!("the programs of the photon timer do not fit"),
        };
        let idle = Idle {
            laser: (laser, install(laser_program())),
            even: (even, install(sampler_program!())),
            odd: (odd, install(sampler_program!("    mov y, y"))),
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
    // The alias of RESETS.RESET that sets bits, and PIO0's (RP2040 datasheet, 2.1.2 and 2.14.3).
    core::arch::naked_asm!(
        "ldr r0, =0x4000e000",
        "movs r1, #1",
        "lsls r1, r1, #10",
        "str r1, [r0]",
        "bx lr",
        ".pool",
    )
}

/// High for `y + 2` clocks, low for `osr + 2`.
fn laser_program() -> Program<32> {
    pio::pio_asm!(
        ".side_set 1",
        ".wrap_target",
        "    mov x, y        side 1",
        "high:",
        "    jmp x-- high    side 1",
        "    mov x, osr      side 0",
        "low:",
        "    jmp x-- low     side 0",
        ".wrap",
    )
    .program
}

/// Puts the first of two numbers into Y and the second into OSR.
fn preset<SM: StateMachineIndex>(
    machine: &mut StateMachine<(PIO0, SM), Stopped>,
    tx: &mut Tx<(PIO0, SM)>,
    [y, osr]: [u32; 2],
) {
    let pull = InstructionOperands::PULL {
        if_empty: false,
        block: false,
    };
    let to_y = InstructionOperands::MOV {
        destination: MovDestination::Y,
        op: MovOperation::None,
        source: MovSource::OSR,
    };
    machine.clear_fifos();
    tx.write(y);
    for operands in [pull, to_y] {
        machine.exec_instruction(now(operands));
    }
    tx.write(osr);
    machine.exec_instruction(now(pull));
}

/// An instruction that leaves the laser's pin low.
const fn now(operands: InstructionOperands) -> Instruction {
    Instruction {
        operands,
        delay: 0,
        side_set: Some(0),
    }
}

fn sampler<SM: StateMachineIndex>(
    (machine, program): Machine<SM>,
    counters: [u32; 2],
) -> (StateMachine<(PIO0, SM), Stopped>, Ends<SM>) {
    let (mut machine, rx, mut tx) = PIOBuilder::from_installed_program(program)
        .in_pin_base(SPAD)
        .in_shift_direction(ShiftDirection::Right)
        .autopush(true)
        .build(machine);
    preset(&mut machine, &mut tx, counters);
    (machine, (rx, tx))
}

impl Sampler for Hardware {
    const KEPT: u32 = sample_rings::KEPT;

    fn start(&mut self, config: &Config) {
        self.stop();
        let Some(Idle { laser, even, odd }) = self.idle.take() else {
            return;
        };
        let (machine, program) = laser;
        let (mut laser, rx, mut tx) = PIOBuilder::from_installed_program(program)
            .side_set_pin_base(LASER)
            .build(machine);
        laser.set_pindirs([(LASER, PinDir::Output)]);
        preset(&mut laser, &mut tx, config.laser_counters());
        let (even, even_ends) = sampler(even, config.sampler_counters());
        let (odd, odd_ends) = sampler(odd, config.sampler_counters());
        self.rings
            .start(&mut self.resets, &even_ends.0, &odd_ends.0);
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
            laser.set_pins([(LASER, rp2040_hal::pio::PinState::Low)]);
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
