//! Why a device's sensor, and with it the laser, does not run.

use crate::numbered::numbered;

numbered! {
    /// Why the sensor stopped last. Reasons from [`Self::Panic`] on are those of a reset: the
    /// device has been started anew since, and its sensor is off until a host configures it.
    StopReason {
        /// A configuration took its place, or takes photons from the link.
        Configuration = 1: "another configuration",
        /// A host began another session.
        NewSession = 2: "a new session",
        /// The host ended its session.
        EndOfSession = 3: "the host ended its session",
        /// No frame of the host came for as long as the configuration allows.
        Silence = 4: "the host was silent",
        /// USB says that no program has the port open, or that the cable is unplugged.
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
    }
}
