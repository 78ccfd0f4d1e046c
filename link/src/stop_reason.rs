//! Why a device's sensor, and with it the laser, has stopped.

use crate::numbered::numbered;

numbered! {
    /// Why the sensor stopped last. [`Self::Panic`] to [`Self::Reset`] are reasons of a reset: the
    /// device has restarted, and its sensor is off until a host configures it.
    StopReason {
        /// Another configuration, possibly one with photons from the link.
        Configuration = 1: "another configuration",
        /// A host began a new session.
        NewSession = 2: "a new session",
        /// The host ended its session.
        EndOfSession = 3: "the host ended its session",
        /// No frame of the host arrived within the host timeout.
        Silence = 4: "the host was silent",
        /// No program has the USB port open, or the cable is unplugged.
        NotListening = 5: "the host closed the USB port",
        /// The firmware panicked.
        Panic = 6: "the firmware panicked",
        /// A hard fault, a stack overflow included.
        Fault = 7: "a hard fault",
        /// The firmware hung until the watchdog reset it.
        Watchdog = 8: "the watchdog",
        /// The supply was too low.
        BrownOut = 9: "the supply voltage was too low",
        /// The reset pin or a debugger.
        Reset = 10: "a reset",
        /// The device's port to the host failed. The session may go on over it.
        PortFailed = 11: "the device's port failed",
    }
}
