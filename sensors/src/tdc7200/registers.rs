//! Registers of the TDC7200 (data sheet SNAS647D, section 8.6 "Register Maps").

/// Command byte, bit 7: go on to the next register after each one (section
/// 8.5.1.6 "Auto Increment Mode").
pub(super) const AUTO_INCREMENT: u8 = 0x80;
/// Command byte, bit 6: write (section 8.5.1.5 "Register Read/Write").
pub(super) const WRITE: u8 = 0x40;

/// CONFIG1, 8 bits, 0x00 after reset.
pub(super) const CONFIG1: u8 = 0x00;
/// CONFIG1 bit 7: calibrate after an interrupted measurement as well.
pub(super) const FORCE_CAL: u8 = 1 << 7;
/// CONFIG1 bit 6: even parity in bit 23 of the result registers.
pub(super) const PARITY_EN: u8 = 1 << 6;
/// CONFIG1 bit 4: STOP counts on its falling edge.
pub(super) const STOP_EDGE: u8 = 1 << 4;
/// CONFIG1 bit 3: START counts on its falling edge.
pub(super) const START_EDGE: u8 = 1 << 3;
/// CONFIG1 bits 2..1: 0 is measurement mode 1, 1 is measurement mode 2.
pub(super) const MEAS_MODE_2: u8 = 1 << 1;
/// CONFIG1 bit 0: clear `INT_STATUS` and the results, raise TRIGG and measure.
pub(super) const START_MEAS: u8 = 1;

/// CONFIG2, 8 bits: `CALIBRATION2_PERIODS` in bits 7..6, `AVG_CYCLES` in 5..3 (0 is
/// none), `NUM_STOP` less 1 in 2..0.
pub(super) const CONFIG2: u8 = 0x01;
/// CONFIG2 after reset.
pub(super) const CONFIG2_RESET: u8 = 0x40;

/// `INT_STATUS`, 8 bits.
pub(super) const INT_STATUS: u8 = 0x02;
/// `INT_STATUS` bit 4 `MEAS_COMPLETE_FLAG`, bit 2 `CLOCK_CNTR_OVF_INT`, bit 1
/// `COARSE_CNTR_OVF_INT` and bit 0 `NEW_MEAS_INT`: with one of them the measurement
/// is over. Bit 3, `MEAS_STARTED_FLAG`, does not count.
pub(super) const OVER: u8 = 0b1_0111;

/// `CLOCK_CNTR_OVF_INT` and `COARSE_CNTR_OVF_INT`: a counter ended it.
pub(super) const OVERFLOW: u8 = 0b110;

/// `INT_MASK`, 8 bits: the bits of `INT_STATUS` that pull INTB low.
pub(super) const INT_MASK: u8 = 0x03;
/// `INT_MASK` after reset: all three interrupts.
pub(super) const INT_MASK_RESET: u8 = 0x07;

/// `COARSE_CNTR_OVF_H`, then _L: where measurement mode 1 ends.
pub(super) const COARSE_CNTR_OVF_H: u8 = 0x04;
/// `CLOCK_CNTR_OVF_H`, then _L: where measurement mode 2 ends.
pub(super) const CLOCK_CNTR_OVF_H: u8 = 0x06;
/// `CLOCK_CNTR_STOP_MASK_H`, then _L: clock periods in which STOP is ignored.
pub(super) const CLOCK_CNTR_STOP_MASK_H: u8 = 0x08;

/// TIME1, 24 bits, the first of the result registers: TIME1, `CLOCK_COUNT1`,
/// TIME2, ..., `CLOCK_COUNT5`, TIME6 follow each other.
pub(super) const TIME1: u8 = 0x10;
/// `CLOCK_COUNT1`, 24 bits.
pub(super) const CLOCK_COUNT1: u8 = 0x11;
/// CALIBRATION1, 24 bits.
pub(super) const CALIBRATION1: u8 = 0x1B;
/// CALIBRATION2, 24 bits, the last of the result registers.
pub(super) const CALIBRATION2: u8 = 0x1C;

/// Result registers, TIME1 to CALIBRATION2.
pub(super) const RESULTS: usize = (CALIBRATION2 - TIME1 + 1) as usize;
/// Bits 22..0 of a result register; bit 23 is the parity.
pub(super) const VALUE: u32 = 0x7f_ffff;
