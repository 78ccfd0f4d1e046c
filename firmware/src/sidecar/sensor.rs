//! Photons and histograms of a sensor, which cannot wait.

use dtof_core::{Count24, DepthEvent, EchoNumber, PixelAddress};
use dtof_link::frame::Deframer;
use embedded_io::{Read, ReadReady, Write, WriteReady};
use heapless::vec::Vec;

use super::{BINS, Sidecar};
use dtof_link::message;
use dtof_link::{Source, StopReason};
use dtof_sensors::simulated::Simulated;
use dtof_sensors::{PhotonSink, Polled, Sensor, SensorFault};

/// The most polls of the sensor in a row. A sensor that always has more must not block the link.
const POLLS: usize = 4;

/// Laser cycles between two polls of the link, which come a millisecond apart at the latest, of a
/// simulated sensor without a clock.
const UNPACED: u16 = 4096;

impl Sidecar<'_> {
    /// Does all that can be done without waiting: processes the bytes that `serial` has
    /// received, polls `sensor` while a configuration takes photons from it, and sends as much as
    /// `serial` takes. `lost` is the number of bytes the port has lost so far. The report counts
    /// the errors of the sensor and names the last.
    ///
    /// The first call stops the sensor, as it may be on. It is the same sensor each time: a sidecar stops only the one that it
    /// is given.
    ///
    /// # Errors
    /// Fails if `serial` fails. The sensor is stopped then, and only another configuration starts it again.
    pub fn poll_with<S: Read + ReadReady + Write + WriteReady>(
        &mut self,
        sensor: &mut impl Sensor,
        serial: &mut S,
        lost: u32,
        now_ms: u32,
    ) -> Result<(), S::Error> {
        // The last configuration takes effect before the next message is answered.
        self.steer(sensor, now_ms);
        let done = self.serve(serial, lost, now_ms).and_then(|()| {
            self.poll_sensor(sensor, now_ms);
            self.serve(serial, lost, now_ms)
        });
        if done.is_err() {
            // Now, as the caller may not poll again.
            self.stop_sensor(StopReason::PortFailed);
            self.steer(sensor, now_ms);
        }
        done
    }

    /// Polls `sensor` while a configuration takes photons from it, and again while
    /// it has more, up to a limit. The report counts its errors and names the last.
    ///
    /// It starts or stops the sensor first: see the module.
    pub fn poll_sensor(&mut self, sensor: &mut impl Sensor, now_ms: u32) {
        self.steer(sensor, now_ms);
        self.sensor_has_more = false;
        for _ in 0..POLLS {
            if !self.takes_sensor() {
                return;
            }
            match sensor.poll(now_ms, self) {
                Ok(Polled::Idle) => return,
                Ok(Polled::Working | Polled::Data) => {}
                Err(error) => {
                    self.sensor_failed(error.into());
                    return;
                }
            }
        }
        self.sensor_has_more = true;
    }

    /// Whether the sensor had still more when it was polled last: poll it again at once.
    #[must_use]
    pub const fn sensor_has_more(&self) -> bool {
        self.sensor_has_more
    }

    /// Starts the sensor, or stops it; again if a stop did not reach it.
    #[inline(never)]
    fn steer(&mut self, sensor: &mut impl Sensor, now_ms: u32) {
        if !self.listens {
            self.stop_sensor(StopReason::NotListening);
        } else if self.host_is_silent(now_ms) {
            self.stop_sensor(StopReason::Silence);
        }
        if !self.has_steered {
            // Another firmware, or another sidecar of this one, may have left it on.
            self.has_steered = true;
            sensor.stop();
        }
        let is_configured = self.array.config().is_some() && self.source == Source::Sensor;
        let should_run = is_configured && self.off.is_none();
        if self.running && !(should_run && self.started) {
            self.sensor_stops = self.sensor_stops.saturating_add(1);
            self.set_stop_reason(self.stopping);
        } else if is_configured && self.off.is_some() && self.stopping.is_some() {
            // Before it has started.
            self.set_stop_reason(self.stopping);
        }
        if should_run && !self.started {
            sensor.start(self.bin_width, self.dither);
            self.sensor_starts = self.sensor_starts.saturating_add(1);
            (self.started, self.running) = (true, true);
        } else if !should_run && self.running {
            sensor.stop();
            self.running = false;
            self.answer_sensor_failure();
        } else if !self.running
            && sensor.is_stopping()
            && let Err(error) = sensor.poll(now_ms, self)
        {
            self.sensor_failed(error.into());
        }
        self.stopping = None;
    }

    /// Takes laser cycles from a simulated sensor as fast as they are processed, without a clock.
    /// It does so while its photons count, every event has left its slot, and `left`, which it
    /// counts down, is not 0. So no decision is deferred. Call [`Self::poll_with`] between the calls.
    pub fn simulate(&mut self, sensor: &mut Simulated<'_>, left: &mut u64) {
        for _ in 0..UNPACED {
            if *left == 0 || !self.takes_sensor() || self.array.has_event() {
                return;
            }
            *left -= 1;
            sensor.laser_cycles(1, self);
        }
    }

    /// Decides on a whole histogram.
    // Not inlined, to keep this off the stack while the histogram is sent.
    #[inline(never)]
    fn decide_whole(&mut self, pixel: PixelAddress, counts: &[u32; BINS]) {
        let mut events = Vec::<DepthEvent, { EchoNumber::LAST.raw() as usize }>::new();
        let room = self.room();
        self.array
            .histogram::<Count24, _>(pixel, counts, room, |event| {
                // There is room for each echo.
                let _ = events.push(*event);
            });
        for event in &events {
            self.enqueue(event);
        }
    }

    /// Counts an error, and logs one of another kind than the last.
    fn sensor_failed(&mut self, fault: SensorFault) {
        self.sensor_errors = self.sensor_errors.saturating_add(1);
        self.answer_sensor_failure();
        if self.sensor_fault.replace(fault) != Some(fault) {
            #[cfg(all(target_os = "none", feature = "defmt"))]
            defmt::warn!("sensor: {}", fault);
        }
    }

    /// Whether the sensor runs, and with it a laser.
    #[must_use]
    pub const fn sensor_is_running(&self) -> bool {
        self.running
    }

    /// Whether a program has the host's port open, as far as the port can tell. Otherwise the
    /// sensor is off.
    pub fn set_listening(&mut self, listens: bool) {
        if self.listens && !listens {
            self.close();
        }
        self.listens = listens;
    }

    /// Drops a frame that was cut off and the session of a program that is gone.
    #[cold]
    #[inline(never)]
    fn close(&mut self) {
        self.deframer = Deframer::new();
        self.endpoint.close();
        self.start_over(StopReason::NotListening);
    }

    /// Why the sensor stopped last, for the host: after a reset, its reason.
    pub const fn set_stop_reason(&mut self, reason: Option<StopReason>) {
        self.stop_reason = reason;
        if let Some(reason) = reason {
            self.endpoint.set_stop_reason(reason);
        }
    }

    /// The sensor is off from the next poll on, until a configuration.
    fn stop_sensor(&mut self, reason: StopReason) {
        // Whether it is off already or not: no configuration from before starts it.
        self.stale = self.endpoint.waiting();
        if self.off.is_none() {
            self.off = Some(reason);
            self.stopping = Some(reason);
        }
    }

    const fn host_is_silent(&self, now_ms: u32) -> bool {
        let most = self.host_timeout_ms as u32;
        most > 0 && self.endpoint.silent_ms(now_ms) >= most
    }

    /// Whether photons of a sensor count. Those that come while a configuration
    /// waits for the last events of the one before belong to neither.
    fn takes_sensor(&self) -> bool {
        self.array.config().is_some()
            && self.source == Source::Sensor
            && self.off.is_none()
            && self.question() != Some(message::CONFIGURE)
    }
}

/// Counts while a configuration takes photons from the sensor, else does nothing.
impl PhotonSink for Sidecar<'_> {
    fn photon(&mut self, pixel: PixelAddress, code: u16) {
        if self.takes_sensor() {
            self.array.photon(pixel.raw().into(), code);
        }
    }

    fn end_laser_cycles(&mut self, mut cycles: u16) {
        if !self.takes_sensor() {
            return;
        }
        while cycles > 0 {
            cycles = self.end_laser_cycles_to_look(cycles);
        }
    }

    /// All histograms of the frame end with its last laser cycle.
    fn begin_frame(&mut self, cycles: u32) {
        if self.takes_sensor() {
            self.array.begin_frame(cycles);
        }
    }

    /// Decides once, whatever L1, L2 and X are. The event's exposure is the laser cycles of
    /// the frame, as far as its field holds them. Without room for an event
    /// the histogram counts as deferred and is dropped: the next one is as good. Blocks
    /// and tracking do not apply.
    fn histogram(&mut self, pixel: PixelAddress, counts: &[u32; BINS]) {
        if !self.takes_sensor() {
            return;
        }
        self.decide_whole(pixel, counts);
        self.drain();
        self.send_sensor_histogram(pixel, counts);
    }
}
