//! The engine on a device against the engine on this computer: the same
//! photons, word for word the same events. The device is the sidecar of the
//! firmware behind a TCP port of this computer.

use std::net::TcpListener;
use std::path::Path;
use std::time::Duration;

use crate::common::assert_contains;
use crate::device::{client, listen, serve};
use dtof_core::fixed::types::{U4F12, U8F8};
use dtof_core::{
    Array, BlockLevel, Count, DepthEvent, EchoNumber, Flags, Neighbours, PixelAddress, WindowRule,
};
use dtof_data::photons::source::PhotonSource;
use dtof_device::{Client, DeviceEngine};
use dtof_engine::Engine;
use dtof_engine::host::host_engine;
use dtof_engine::settings::Settings;
use dtof_firmware::sidecar::Sidecar;
use dtof_light::demo;
use dtof_light::effects::tdc::Tdc;
use dtof_link::AdaptiveBinning;

const PIXELS: usize = 64;
/// Number of blocks of 8x8 pixels in three levels.
const BLOCKS: usize = 21;
const ARRAY: Array = Array::new(8, 8).unwrap();

fn settings() -> Settings {
    Settings::static_scene(1)
}

/// The same with the other rule and the other estimator.
fn with_windows() -> Settings {
    settings().for_pulse(U8F8::lit("0.55")).configured(|array| {
        array.rule = WindowRule::new(2, U4F12::lit("4.5"), Count::saturating(5))
            .unwrap()
            .into();
    })
}

/// Serves one connection after another, each with a new sidecar. A connection ends when the host is
/// gone or after `lives`.
fn device(lives: Option<Duration>) -> String {
    let mut lives = lives.unwrap_or(Duration::MAX);
    listen(move |stream| {
        let mut pixels = heapless::Vec::<_, PIXELS>::new();
        let mut blocks = heapless::Vec::<_, BLOCKS>::new();
        let mut on = |lives| {
            let mut sidecar = Sidecar::new(&mut pixels, &mut blocks, None);
            serve(stream, &mut sidecar, lives, |_, _| {})
        };
        while let Ok(true) = on(lives) {
            lives = Duration::MAX; // switched off and on
        }
        true
    })
}

/// All events of `cycles` laser cycles of the demo's scene, with a TDC of this dead time.
fn events(engine: &mut dyn Engine, cycles: u64, dead_time: u16) -> anyhow::Result<Vec<DepthEvent>> {
    let mut scene = demo::scene()?;
    scene.size = [8, 8];
    scene.effects.tdc = (dead_time > 0).then(|| Tdc {
        dead_time_bins: Some(dead_time),
        ..Tdc::default()
    });
    let mut photons = scene.photons(1, cycles)?;
    let mut events = Vec::new();
    for _ in 0..cycles / 250 {
        events.extend(engine.run(&photons.next_slice(250)?)?);
    }
    Ok(events)
}

/// Blocks of three levels, tracking and two echoes as well.
fn with_all() -> Settings {
    with_windows()
        .for_pulse(U8F8::lit("1"))
        .configured(|array| {
            array.binning = Some(AdaptiveBinning {
                levels: BlockLevel::saturating(3),
                patience: 50,
            });
            array.tracking = true;
            array.echoes = EchoNumber::new(2).unwrap();
            array.echo_wait = 4;
            array.l2 = 300;
        })
}

fn addresses(pixels: u16) -> Vec<PixelAddress> {
    (0..pixels).map(PixelAddress::new).collect()
}

/// Checks that device and host give the same events, and returns them.
#[track_caller]
fn same_events(
    settings: &Settings,
    cycles: u64,
    reads_every: Duration,
    at_least: u64,
) -> Vec<DepthEvent> {
    let mut client = client(&device(None));
    assert_eq!((client.bins(), client.pixels()), (128, 64));
    client.reads_every = reads_every;
    let mut on_device = DeviceEngine::new(client, settings, ARRAY, &addresses(64)).unwrap();
    let mut on_host = host_engine(settings, ARRAY, &addresses(64)).unwrap();
    let expected = events(on_host.as_mut(), cycles, settings.dead_time()).unwrap();
    let actual = events(&mut on_device, cycles, settings.dead_time()).unwrap();
    assert!(!expected.is_empty() && actual == expected);
    assert_eq!(on_device.statistics(), on_host.statistics());
    assert_eq!(on_device.report().cycles, cycles);
    assert!(on_device.statistics()[0].counted >= at_least);
    actual
}

#[test]
fn a_million_photons_give_the_same_events_on_a_device() {
    same_events(&settings(), 6_000, Duration::ZERO, 1_000_000);
}

#[test]
fn a_host_that_seldom_reads_gets_the_same_events() {
    same_events(&settings(), 1_500, Duration::from_millis(20), 100_000);
}

#[test]
fn every_rule_and_estimator_gives_the_same_events_on_a_device() {
    let [plain, with_windows] = [settings(), with_windows()].map(|settings| settings.configuration);
    let mut events = Vec::new();
    for rule in [plain.rule, with_windows.rule] {
        for estimator in [plain.estimator, with_windows.estimator] {
            let settings = settings().configured(|array| {
                (array.rule, array.estimator) = (rule, estimator);
            });
            events.push(same_events(&settings, 1_000, Duration::ZERO, 100_000));
        }
    }
    // The settings make a difference.
    for (index, one) in events.iter().enumerate() {
        assert!(!events[index + 1..].contains(one));
    }
}

#[test]
fn blocks_tracking_and_echoes_are_the_same_on_a_device() {
    for (cycles, reads_every) in [(1_500, 0), (500, 20)] {
        let reads_every = Duration::from_millis(reads_every);
        let events = same_events(&with_all(), cycles, reads_every, 10_000);
        let of_level = |level| events.iter().filter(move |of| of.level.raw() == level);
        for level in 0..=3 {
            assert!(of_level(level).count() > 0, "level {level}");
        }
        assert!(events.iter().any(|event| event.echo.raw() == 2));
    }
}

#[test]
fn dead_times_and_photons_once_per_bin_are_the_same_on_a_device() {
    let all = with_all();
    let without_blocks = all.clone().configured(|array| array.binning = None);
    for dead_time in [1, 20, 128] {
        let settings = without_blocks
            .clone()
            .configured(|array| array.dead_time = Some(dead_time));
        same_events(&settings, 2_000, Duration::ZERO, 50_000);
    }
    let every = same_events(&all, 1_000, Duration::ZERO, 100_000);
    let once = all.configured(|array| array.once_per_bin = true);
    let once = same_events(&once, 1_000, Duration::ZERO, 100_000);
    assert!(every != once);
}

#[test]
fn neighbours_confirm_alike_on_a_device() {
    let all = with_all().configured(|array| array.binning = None);
    let alone = same_events(&all, 1_000, Duration::ZERO, 100_000);
    for neighbours in [Neighbours::Four, Neighbours::Eight] {
        let settings = all
            .clone()
            .configured(|array| array.neighbours = Some(neighbours));
        let events = same_events(&settings, 1_000, Duration::ZERO, 100_000);
        let is_confirmed = |event: &DepthEvent| event.flags.contains(Flags::CONFIRMED);
        assert!(events.iter().any(is_confirmed) && !alone.iter().any(is_confirmed));
    }
}

#[test]
fn a_configuration_the_device_cannot_take_is_refused_with_its_reason() {
    let name = device(None);
    let refused = |settings: &Settings, pixels: u16| {
        let engine = DeviceEngine::new(client(&name), settings, ARRAY, &addresses(pixels));
        format!("{:#}", engine.err().expect("refused"))
    };
    let mut settings = settings();
    assert_contains(&refused(&settings, 65), "does not have that many pixels");
    settings.configuration.l2 = 100;
    let reason = refused(&settings, 64);
    assert_contains(&reason, "refuses");
    assert_contains(&reason, "L2 must be greater than L1");
    settings.configuration.l2 = 2_000;
    settings.configuration.tracking = true;
    assert_contains(&refused(&settings, 64), "tracking needs the window rule");
    settings.configuration.tracking = false;
    // One column of 64 pixels has 32, 16 and 8 blocks.
    settings.configuration.binning = with_all().configuration.binning;
    let column = DeviceEngine::new(
        client(&name),
        &settings,
        Array::new(1, 64).unwrap(),
        &addresses(64),
    );
    let reason = format!("{:#}", column.err().expect("refused"));
    assert_contains(&reason, "no room for the blocks of pixels");
}

#[test]
fn a_device_that_restarts_is_noticed() {
    let name = device(Some(Duration::from_millis(200)));
    let mut engine = DeviceEngine::new(client(&name), &settings(), ARRAY, &addresses(64)).unwrap();
    let error = loop {
        if let Err(error) = events(&mut engine, 250, 0) {
            break error;
        }
    };
    assert_contains(&format!("{error:#}"), "restarted");
}

#[test]
fn an_emulated_device_runs_an_image_and_no_other_takes_one() {
    let refused = |name: &str, image: &str| {
        let opened = dtof_device::open(name, Some(Path::new(image)));
        format!("{:#}", opened.err().expect("refused"))
    };
    let missing = refused("qemu", "no/such/image");
    assert!(missing.starts_with("no image at no/such/image: "));
    assert!(missing.contains("`cargo xtask image mps2-an386`"));
    let other = refused("qemu", "Cargo.toml");
    assert_eq!(other, "Cargo.toml: is not an ELF file, as an image must be");
    let other = refused("tcp:127.0.0.1:1", "Cargo.toml");
    assert_eq!(other, "image is for device qemu");
}

#[test]
fn nobody_at_the_other_end_is_an_error_not_a_hang() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let name = format!("tcp:{}", listener.local_addr().unwrap());
    let answered = Client::new(dtof_device::open(&name, None).unwrap());
    let error = answered.err().expect("nobody answers");
    assert_contains(&format!("{error:#}"), "no device answered");
    drop(listener);
    // Another test may have its port by now.
    assert!(dtof_device::open("tcp:127.0.0.1:1", None).is_err());
    assert!(dtof_device::open("/dev/not-a-port", None).is_err());
}
