//! Light: tail, second echo, cover glass, hot pixels.

use super::{array, float, histogram, near_count, near_mean, near_share, pixel};

const CYCLES: u64 = 100_000;
/// One bin of 250 ps, in millimetres.
const MM_PER_BIN: f64 = 37.474_057_25;

#[test]
fn a_tail_holds_its_share_and_moves_the_mean() {
    let (sigma, decay, share) = (1.0_f64, 5.0_f64, 0.3_f64);
    let photons = pixel(
        "pulse_sigma_bins = 1.0\n[[surface]]\nsignal = 1\nposition_bins = 20.5\n\
         [tail]\nshare = 0.3\ndecay_bins = 5\n",
        CYCLES,
    );
    near_count("photons", photons.len(), 1e5);
    // 0.3 of them are later by 5 bins on average; the spread of an exponential
    // delay is its mean, that of a bin 1/12.
    let spread = sigma.powi(2) + 1.0 / 12.0 + decay.powi(2) * (2.0 * share - share.powi(2));
    near_mean("mean", &photons, 20.5 + share * decay, spread);
    // Ten standard deviations behind the pulse there is nothing but tail: a
    // normal pulse with an exponential tail, far from its middle.
    let late = photons.iter().filter(|(_, code)| *code >= 31).count();
    let expected = share * (-10.5 / decay + (sigma / decay).powi(2) / 2.0).exp();
    near_share("tail", late, photons.len(), expected);
}

#[test]
fn a_second_echo_has_its_share_and_place() {
    let behind_mm = 30.0 * MM_PER_BIN;
    let text = format!(
        "[[surface]]\nsignal = 1\nposition_bins = 40.5\n\
         [second_echo]\nshare = 0.25\nbehind_mm = {behind_mm}\n"
    );
    let photons = pixel(&text, CYCLES);
    let (first, second): (Vec<_>, Vec<_>) = photons.iter().partition(|(_, code)| *code < 55);
    near_share("second echo", second.len(), photons.len(), 0.25);
    let spread = 1.0 + 1.0 / 12.0;
    for (what, echo, position) in [("first", first, 40.5), ("second", second, 70.5)] {
        near_mean(what, &echo, position, spread);
    }
}

#[test]
fn the_cover_glass_has_its_rate_at_its_place() {
    let photons = pixel(
        "background = 0.01\n[cover_glass]\nsignal = 2.5\nposition_bins = 10.5\n",
        CYCLES,
    );
    let bins = histogram(&photons);
    let peak: u32 = bins[4..17].iter().sum();
    near_count("peak", peak as usize, (2.5 + 13.0 * 0.01) * 1e5);
    let rest: u32 = bins[17..].iter().sum();
    near_count("rest", rest as usize, 111.0 * 0.01 * 1e5);
}

#[test]
fn the_tail_is_the_lasers_and_the_cover_glass_has_it_too() {
    let photons = pixel(
        "[cover_glass]\nsignal = 1\nposition_bins = 20.5\n[tail]\nshare = 0.5\ndecay_bins = 8\n",
        CYCLES,
    );
    let spread = 1.0 + 1.0 / 12.0 + 64.0 * 0.75;
    near_mean("mean", &photons, 24.5, spread);
}

#[test]
fn hot_pixels_are_as_many_and_as_hot_as_said() {
    let pixels = array(
        "columns = 64\nrows = 64\nbackground = 0.001\n[hot_pixels]\nmultiple = 20\nshare = 0.02\n",
        1000,
    );
    // 128 photons in a thousand laser cycles, or 2560.
    let (hot, normal): (Vec<_>, Vec<_>) = pixels.iter().partition(|photons| photons.len() > 1000);
    near_share("hot pixels", hot.len(), 4096, 0.02);
    for (what, pixels, rate) in [("hot", hot, 0.02), ("normal", normal, 0.001)] {
        let photons = pixels.iter().map(|photons| photons.len()).sum();
        near_count(what, photons, float(pixels.len()) * 128.0 * 1000.0 * rate);
    }
}
