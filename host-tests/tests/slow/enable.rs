//! PC6 of the STM32F405, ENABLE of its sensor, goes low and stays low after every fault, and its watchdog is not fed
//! any more in a hang. QEMU has neither, but logs what is written to them. Times are the image's own milliseconds, or how often it
//! feeds its watchdog, at most once in each.
//!
//! ```sh
//! DTOF_SLOW=1 cargo test --package dtof-host-tests --test slow enable:: -- --nocapture
//! ```

use std::fs;
use std::path::PathBuf;
use std::sync::MutexGuard;
use std::thread;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail, ensure};
use dtof_device::{Client, HostTimeout, Stopped, Task};
use dtof_link::{Source, StopReason};
use tempfile::TempDir;

use crate::boards::{is_known, settings};
use crate::emulator::{Board, Emulator, PATIENCE, Planted, QEMU};
use crate::enabled;

/// How long the watchdog must not be fed.
const LONG: Duration = Duration::from_millis(500);
/// For so many feeds of the watchdog ENABLE must stay low. A driver that is on raises it again within ten.
const LONG_FEEDS: usize = 1_000;
/// Host timeouts in milliseconds: one that must not run out, and one that must.
const NEVER_MS: u16 = 60_000;
const SILENCE_MS: u16 = 3_000;
/// Milliseconds of a watchdog whose oscillator is as slow as the data sheet allows: 17 kHz.
const MOST_WATCHDOG_MS: u32 = 1_000;
const SLOWEST_KHZ: u32 = 17;

/// What is written to the pin and to the watchdog.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Written {
    Enable(bool),
    Prescaler(u32),
    Reload(u32),
    Start,
    Feed,
    /// Anything else that QEMU does not have.
    Other,
}

impl Written {
    /// From a line of QEMU's log. It has another name for the page of the independent watchdog.
    fn of(line: &str) -> Self {
        let Some((place, value)) = line.trim_end_matches(')').split_once(", value 0x") else {
            return Self::Other;
        };
        let value = u32::from_str_radix(value, 16).unwrap_or_default();
        let is_at = |part: &str, offset: &str| place.starts_with(part) && place.ends_with(offset);
        // GPIOC_BSRR (RM0090, 8.4.7); IWDG_KR, IWDG_PR and IWDG_RLR (21.4).
        if is_at("GPIOC: ", "offset 0x018") && value & 1 << 22 != 0 {
            Self::Enable(false)
        } else if is_at("GPIOC: ", "offset 0x018") && value & 1 << 6 != 0 {
            Self::Enable(true)
        } else if is_at("I2S2ext: ", "offset 0x004") {
            Self::Prescaler(4 << value)
        } else if is_at("I2S2ext: ", "offset 0x008") {
            Self::Reload(value + 1)
        } else if is_at("I2S2ext: ", "offset 0x000") && value == 0xcccc {
            Self::Start
        } else if is_at("I2S2ext: ", "offset 0x000") && value == 0xaaaa {
            Self::Feed
        } else {
            Self::Other
        }
    }
}

/// A board with a TMF8829 that never answers: ENABLE stays high as long as the driver waits for it.
struct Bench {
    emulator: Emulator,
    folder: TempDir,
}

impl Bench {
    fn start() -> Result<Self> {
        let image = Board::Stm32F405.image(&["tmf8829-spi"])?;
        let folder = tempfile::tempdir()?;
        let log = folder.path().join("log");
        let emulator = Emulator::start_logged(Board::Stm32F405, &image, &log)?;
        Ok(Self { emulator, folder })
    }

    fn log(&self) -> PathBuf {
        self.folder.path().join("log")
    }

    /// All that has been written so far.
    fn written(&self) -> Result<Vec<Written>> {
        let text = fs::read_to_string(self.log())?;
        let (whole, _) = text.rsplit_once('\n').unwrap_or_default();
        Ok(whole.lines().map(Written::of).collect())
    }

    fn is_high(&self) -> Result<bool> {
        let written = self.written()?;
        let mut levels = written.iter().rev();
        Ok(levels.find(|written| matches!(written, Written::Enable(_)))
            == Some(&Written::Enable(true)))
    }

    fn until(&self, what: &str, mut is: impl FnMut(&Self) -> Result<bool>) -> Result<()> {
        let start = Instant::now();
        while !is(self)? {
            ensure!(start.elapsed() < PATIENCE, "{what}");
            thread::sleep(Duration::from_millis(2));
        }
        Ok(())
    }

    /// A host that has started the sensor, and what the image had counted and written before and after the host spoke last.
    /// ENABLE was high at least once.
    fn light(&mut self, host_timeout_ms: u16) -> Result<(Client, [(u32, usize); 2])> {
        let mut client = Client::new(self.emulator.connect()?)?;
        let mut settings = settings();
        let sensor = client.sensor()?.context("no sensor")?;
        if let Some(bin_width) = sensor.bin_width {
            settings.configuration.bin_width_ps = bin_width;
        }
        let task = Task {
            settings: &settings,
            pixels: 1,
            columns: 1,
            dynamic_depth: None,
            host_timeout: HostTimeout::from_milliseconds(host_timeout_ms).context("no timeout")?,
        };
        ensure!(!self.is_high()?, "ENABLE is high before a host asks for it");
        let asked = self.now()?;
        client.configure(&task.configuration(Source::Sensor)?)?;
        let answered = self.now()?;
        self.until("ENABLE never goes high", |bench| {
            Ok(bench.first_high()?.is_some())
        })?;
        Ok((client, [asked, answered]))
    }

    /// The milliseconds that the image has counted, and how much it has written until then.
    fn now(&mut self) -> Result<(u32, usize)> {
        self.emulator.interrupt()?;
        let now = (self.emulator.milliseconds()?, self.written()?.len());
        self.emulator.resume()?;
        Ok(now)
    }

    /// Stops the image while ENABLE is high, and plants a fault. How much was written before.
    fn plant(&mut self, what: Planted) -> Result<usize> {
        loop {
            self.emulator.interrupt()?;
            if self.is_high()? {
                break;
            }
            self.emulator.resume()?;
            self.until("ENABLE stays low", Self::is_high)?;
        }
        self.emulator.plant(what)?;
        let before = self.written()?.len();
        self.emulator.resume()?;
        Ok(before)
    }

    /// Where ENABLE went high first.
    fn first_high(&self) -> Result<Option<usize>> {
        let mut written = self.written()?.into_iter();
        Ok(written.position(|what| what == Written::Enable(true)))
    }

    /// What the image has in its memory after a while in which its host speaks.
    fn after(&mut self, client: &mut Client, end: Instant) -> Result<Vec<u8>> {
        while Instant::now() < end {
            client.exchange()?;
        }
        self.emulator.interrupt()?;
        let statics = self.emulator.statics()?;
        self.emulator.resume()?;
        Ok(statics)
    }

    /// Waits until ENABLE has stayed low for long. Returns how often the watchdog was fed from the write `from` until it went low.
    fn goes_low(&self, from: usize) -> Result<usize> {
        let mut low_after = 0;
        self.until("ENABLE does not stay low", |bench| {
            let written = bench.written()?;
            let stays = stays_low(&written, from);
            low_after = stays.map_or(0, |at| fed(&written[from..at]));
            Ok(stays.is_some())
        })?;
        Ok(low_after)
    }

    /// Waits until ENABLE has stayed low for long. Returns the milliseconds of the image between which it went low, after
    /// `begin`.
    fn low_between(&mut self, begin: (u32, usize)) -> Result<[u32; 2]> {
        let start = Instant::now();
        let mut seen = vec![begin];
        loop {
            let written = self.written()?;
            if let Some(at) = stays_low(&written, 0) {
                let later = seen.partition_point(|&(_, length)| length <= at);
                let [before, after] = [later.checked_sub(1), Some(later)]
                    .map(|place| place.and_then(|place| seen.get(place)));
                let (before, after) = before.zip(after).context("low at once, or never")?;
                return Ok([before.0, after.0]);
            }
            ensure!(start.elapsed() < PATIENCE, "ENABLE does not stay low");
            thread::sleep(Duration::from_millis(5));
            seen.push(self.now()?);
        }
    }
}

/// Where ENABLE went low, from the write `from` on, if it has stayed so for long.
fn stays_low(written: &[Written], from: usize) -> Option<usize> {
    let high = written.iter().rposition(|of| *of == Written::Enable(true));
    let begin = high.map_or(from, |high| from.max(high));
    let low = begin
        + written[begin..]
            .iter()
            .position(|of| *of == Written::Enable(false))?;
    (fed(&written[low..]) >= LONG_FEEDS).then_some(low)
}

fn fed(written: &[Written]) -> usize {
    written.iter().filter(|&&of| of == Written::Feed).count()
}

/// Milliseconds of the watchdog with the slowest oscillator, if it starts.
fn watchdog_ms(written: &[Written]) -> Option<u32> {
    let starts = written.iter().position(|&of| of == Written::Start)?;
    let before = || written[..starts].iter().rev();
    let clocks = before().find_map(|of| match of {
        Written::Prescaler(clocks) => Some(clocks),
        _ => None,
    })?;
    let count = before().find_map(|of| match of {
        Written::Reload(count) => Some(count),
        _ => None,
    })?;
    Some((clocks * count).div_ceil(SLOWEST_KHZ))
}

#[test]
fn enable_goes_low_and_stays_low_after_every_fault() -> Result<()> {
    let Some(_alone) = ready("ENABLE of stm32f405 in QEMU") else {
        return Ok(());
    };
    for (what, reason) in [
        (Planted::Panic, StopReason::Panic),
        (Planted::Fault, StopReason::Fault),
        (Planted::Overflow, StopReason::Fault),
    ] {
        let mut bench = Bench::start()?;
        let (mut client, _) = bench.light(NEVER_MS)?;
        let before = bench.plant(what)?;
        // The board has been reset, and has started again.
        bench.until("no reset", |bench| {
            Ok(bench.written()?[before..].contains(&Written::Start))
        })?;
        let start = Instant::now();
        let lost = loop {
            match client.exchange() {
                Err(lost) if lost.is::<Stopped>() => break format!("{lost:#}"),
                _ => ensure!(start.elapsed() < PATIENCE, "{what:?}: no report"),
            }
        };
        ensure!(lost.contains(&format!("({reason})")), "{what:?}: {lost}");
        bench.goes_low(before)?;
        let after = &bench.written()?[before..];
        ensure!(
            after[0] == Written::Enable(false),
            "{what:?}: first {:?}",
            after[0]
        );
        ensure!(
            !after.contains(&Written::Enable(true)),
            "{what:?}: ENABLE goes high again"
        );
        println!("stm32f405, {what:?}: ENABLE goes low, the board is reset, and ENABLE stays low");
    }
    Ok(())
}

#[test]
fn the_watchdog_is_not_fed_when_the_image_hangs_or_its_clock_stops() -> Result<()> {
    let Some(_alone) = ready("the watchdog of stm32f405 in QEMU") else {
        return Ok(());
    };
    for what in [Planted::Hang, Planted::Clock] {
        let mut bench = Bench::start()?;
        let (mut client, _) = bench.light(NEVER_MS)?;
        bench.until("the watchdog is not fed", |bench| {
            Ok(fed(&bench.written()?) > 10)
        })?;
        let before = bench.plant(what)?;
        let start = Instant::now();
        // A host that speaks, so that interrupts of the serial port go on.
        let statics = bench.after(&mut client, start + LONG / 2)?;
        let mut end = start + LONG;
        while bench.after(&mut client, end)? == statics {
            ensure!(
                start.elapsed() < PATIENCE,
                "{what:?}: the image does not run"
            );
            end += LONG;
        }
        let written = bench.written()?;
        let (before, after) = written.split_at(before);
        // The main loop may not have seen the last millisecond before.
        ensure!(fed(after) <= 1, "{what:?}: fed {} times", fed(after));
        let ms = watchdog_ms(before).context("no watchdog")?;
        ensure!(ms <= MOST_WATCHDOG_MS, "a watchdog of {ms} ms");
        println!("stm32f405, {what:?}: its watchdog of at most {ms} ms is not fed any more");
    }
    Ok(())
}

#[test]
fn enable_goes_low_when_the_host_ends_its_session_or_is_silent() -> Result<()> {
    let Some(_alone) = ready("ENABLE of stm32f405 without a host") else {
        return Ok(());
    };
    let mut bench = Bench::start()?;
    drop(bench.light(NEVER_MS)?);
    let high = bench.first_high()?.context("never high")?;
    let ended = bench.goes_low(high)?;
    ensure!(ended < usize::from(SILENCE_MS), "low after {ended} ms");
    let (shortest, longest) = silence()?;
    ensure!(
        longest >= u32::from(SILENCE_MS) && shortest < u32::from(SILENCE_MS) * 3 / 2,
        "low after {shortest} to {longest} ms"
    );
    println!(
        "stm32f405: ENABLE goes low and stays low when the session ends, after {ended} ms, and when the host is silent for \
         {SILENCE_MS} ms, after {shortest} to {longest} ms"
    );
    Ok(())
}

/// Between which milliseconds after its host was last heard ENABLE went low. Repeated if a busy computer leaves that open by
/// more than a tenth.
fn silence() -> Result<(u32, u32)> {
    for _ in 0..10 {
        let mut bench = Bench::start()?;
        let (_silent, [asked, answered]) = bench.light(SILENCE_MS)?;
        let low = bench.low_between(answered)?;
        let (shortest, longest) = (low[0].saturating_sub(answered.0), low[1] - asked.0);
        if longest - shortest <= u32::from(SILENCE_MS) / 10 {
            return Ok((shortest, longest));
        }
    }
    bail!("the computer is too busy to tell")
}

fn ready(test: &str) -> Option<MutexGuard<'static, ()>> {
    enabled(test, &[QEMU]).filter(|_| is_known(test))
}
