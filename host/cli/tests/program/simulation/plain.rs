//! The plain model stays what it was, and effects that do nothing change
//! nothing.

use dtof_core::PixelAddress;
use dtof_data::photons::source::PhotonSource;
use dtof_data::random::pixel_rng;
use dtof_light::scene::Scene;
use rand_distr::{Bernoulli, Distribution, Normal, Poisson, Uniform};

use super::{Photons, array, pixel, sliced};

/// A still scene.
const SCENE: &str = "columns = 64\nrows = 32\nbackground = 0.02\n\
    [[surface]]\nrange_mm = 3400\nrange_right_mm = 3800\nreflectivity = 0.5\n\
    [[surface]]\nrange_mm = 2400\nreflectivity = 0.2\n\
    rectangle = { columns = [8, 28], rows = [10, 30] }\n\
    [[surface]]\nrange_mm = 1550\nreflectivity = 0.9\n\
    ball = { centre = [46, 17], radius = 10, radius_mm = 300 }\n";

/// Its photons, from before scene files and effects existed.
#[test]
fn the_photons_of_a_plain_scene_are_what_they_were_bit_for_bit() {
    for (columns, rows, expected) in [
        (64, 32, 0x462a_dbd0_560f_f395_u64),
        (8, 8, 0x13fb_0c3a_4633_b873),
        (5, 3, 0xdf13_a2d4_baeb_f6cb),
    ] {
        let scene = Scene {
            size: [columns, rows],
            ..Scene::parse(SCENE).unwrap()
        };
        let mut photons = scene.photons(1, 600).unwrap();
        // FNV-1a over laser cycle and code, slice by slice of 200 laser cycles.
        let mut hash = 0xcbf2_9ce4_8422_2325;
        for _ in 0..3 {
            let slice = photons.next_slice(200).unwrap();
            for photon in slice.pixels.iter().flat_map(|pixel| &pixel.photons) {
                for number in [photon.cycle, photon.code] {
                    hash = (hash ^ u64::from(number)).wrapping_mul(0x0000_0100_0000_01b3);
                }
            }
        }
        assert_eq!(hash, expected, "{columns}x{rows}");
    }
}

/// The plain model in one function, as it was before effects.
fn plain(background: f64, signal: f64, position: f64, cycles: u64) -> Photons {
    let mut rng = pixel_rng(1, PixelAddress::new(0));
    let total = background * 128.0 + signal;
    let pulse = Normal::new(position, 1.0).unwrap();
    let bin = Uniform::new(0, 128).unwrap();
    let mut photons = Vec::new();
    if total == 0.0 {
        return photons;
    }
    for cycle in 0..cycles {
        let mut left: f64 = Poisson::new(total).unwrap().sample(&mut rng);
        while left > 0.0 {
            left -= 1.0;
            if !Bernoulli::new(signal / total).unwrap().sample(&mut rng) {
                photons.push((cycle, bin.sample(&mut rng)));
                continue;
            }
            let position: f64 = pulse.sample(&mut rng);
            if (0.0..128.0).contains(&position) {
                #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
                photons.push((cycle, position as u16));
            }
        }
    }
    photons
}

fn text(background: f64, signal: f64, position: f64) -> String {
    format!(
        "background = {background}\n[[surface]]\nsignal = {signal}\nposition_bins = {position}\n"
    )
}

#[test]
fn without_effects_a_scene_is_the_plain_model() {
    for (background, signal, position) in [
        (0.02, 0.5, 60.25),
        (0.0, 0.0, 10.0),
        (0.1, 0.0, 10.0),
        (0.0, 3.0, 0.5),   // half before the histogram
        (0.01, 3.0, 128.), // half behind it
    ] {
        let scene = Scene::parse(&text(background, signal, position)).unwrap();
        let position = scene.rates(PixelAddress::new(0), 0).position;
        let photons = pixel(&text(background, signal, position), 5000);
        assert_eq!(photons, plain(background, signal, position, 5000));
    }
}

/// Each effect, with values without an effect.
const IDLE: [&str; 8] = [
    "[tail]\nshare = 0\ndecay_bins = 10\n",
    "[second_echo]\nshare = 0\nbehind_mm = 500\n",
    "[cover_glass]\nsignal = 0\nposition_bins = 5\n",
    "[hot_pixels]\nmultiple = 1\nshare = 1\n",
    "[dead_time]\nduration_ps = 0\n",
    "[afterpulsing]\nprobability = 0\ndecay_ps = 1000\n",
    "[jitter]\nsigma_ps = 0\n",
    "[tdc]\nhits_per_cycle = 1000\n",
];

#[test]
fn effects_that_do_nothing_change_nothing() {
    let all = IDLE.concat();
    for text in [text(0.02, 0.5, 60.25), text(0.02, 3.0, 127.5)] {
        let mut expected = pixel(&text, 5000);
        expected.sort_unstable(); // effects put the photons of a laser cycle into order
        for effects in IDLE.iter().copied().chain([all.as_str()]) {
            let found = pixel(&format!("{text}{effects}"), 5000);
            assert!(found == expected, "{effects}");
        }
    }
}

/// Each effect, with values that have an effect.
const BUSY: [&str; 8] = [
    "[tail]\nshare = 0.4\ndecay_bins = 10\n",
    "[second_echo]\nshare = 0.3\nbehind_mm = 500\n",
    "[cover_glass]\nsignal = 0.5\nposition_bins = 5\n",
    "[hot_pixels]\nmultiple = 5\nshare = 1\n",
    "[dead_time]\nduration_ps = 5000\n",
    "[afterpulsing]\nprobability = 0.1\ndecay_ps = 40_000\n",
    "[jitter]\nsigma_ps = 500\n",
    "[tdc]\nhits_per_cycle = 1\n",
];

#[test]
fn effects_do_something_whatever_the_length_of_a_slice() {
    let text = text(0.02, 0.5, 60.25);
    let mut plain = pixel(&text, 2000);
    plain.sort_unstable();
    let all = BUSY.concat();
    for effects in BUSY.iter().copied().chain([all.as_str()]) {
        let text = format!("{text}{effects}");
        let photons = sliced(&text, 2000, 1000);
        assert!(photons[0] != plain, "{effects}");
        assert!(sliced(&text, 2000, 8) == photons, "{effects}");
        let is_sorted = photons[0].is_sorted_by_key(|(cycle, _)| *cycle);
        assert!(is_sorted, "{effects}");
    }
}

/// Light effects draw their own random numbers, so other photons stay.
#[test]
fn an_effect_leaves_the_photons_alone_that_are_not_its_own() {
    let text = text(0.02, 0.5, 60.25);
    let before = |photons: &Photons, bin| -> Photons {
        let mut photons = photons.clone();
        photons.retain(|(_, code)| *code < bin);
        photons.sort_unstable();
        photons
    };
    let plain = pixel(&text, 5000);
    // A tail and a second echo come after the pulse; of the cover glass, 5 bins
    // behind the pulse, nothing is left 20 bins further.
    for (effects, bin) in [(BUSY[0], 54), (BUSY[1], 54)] {
        let changed = pixel(&format!("{text}{effects}"), 5000);
        assert!(before(&changed, bin) == before(&plain, bin), "{effects}");
    }
    let glass = "[cover_glass]\nsignal = 0.5\nposition_bins = 100\n";
    let changed = pixel(&format!("{text}{glass}"), 5000);
    assert!(before(&changed, 90) == before(&plain, 90));
    assert!(changed.len() > plain.len());
}

#[test]
fn a_listed_hot_pixel_is_the_only_one_that_changes() {
    let text = format!("columns = 4\n{}", text(0.02, 0.5, 60.25));
    let mut plain = array(&text, 1000);
    let hot = format!("{text}[hot_pixels]\nmultiple = 9\npixels = [2]\n");
    let hot = array(&hot, 1000);
    for (index, (plain, hot)) in plain.iter_mut().zip(&hot).enumerate() {
        plain.sort_unstable();
        assert_eq!(plain == hot, index != 2, "pixel {index}");
    }
}
