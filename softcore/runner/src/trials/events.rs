//! The events of a soft-core against those of the host from the same photons.

use std::iter::Peekable;
use std::vec::IntoIter;

use anyhow::{Context, Result, ensure};
use dtof_core::{
    AerDecoder, AerRecord, AerWord, AsyncPixel, DepthEvent, LaserCycle, PixelAddress, PixelConfig,
    Statistics,
};
use dtof_softcore::stream::{self, BINS, Mark};

use super::photons::Photon;

/// The events of the words over the link.
///
/// # Errors
/// If a word means nothing, or something else.
pub fn decoded(words: &[u128]) -> Result<Vec<DepthEvent>> {
    let mut decoder = AerDecoder::new();
    let mut events = Vec::new();
    for &word in words {
        let record = decoder.decode(AerWord::from_le_bytes(word.to_le_bytes()));
        match record.with_context(|| format!("word {word:032x}"))? {
            AerRecord::Time(_) => {}
            AerRecord::Event(event) => events.push(event),
            other => anyhow::bail!("{other:?} over the link"),
        }
    }
    Ok(events)
}

/// The events of `pixels` macropixels on the host, and the counts of all of them. The host
/// looks when the soft-core looked, and takes events when it took them.
///
/// # Errors
/// If an event is taken that is not there.
pub fn decided(
    pixels: u8,
    marks: &[u32],
    photons: &[Photon],
) -> Result<(Vec<DepthEvent>, Statistics)> {
    let config = stream::config()?;
    let pixel = |number: u8| {
        let photons = photons.iter().filter(|photon| photon.pixel == number);
        Pixel {
            pixel: AsyncPixel::new(PixelAddress::new(number.into())),
            photons: photons.copied().collect::<Vec<_>>().into_iter().peekable(),
            looked: 0,
        }
    };
    let mut pixels: Vec<Pixel> = (0..pixels).map(pixel).collect();
    let (mut events, mut all) = (Vec::new(), Statistics::default());
    let mut turn = 0;
    for &mark in marks {
        match Mark::from_raw(mark) {
            Mark::Look(now) => {
                let number = pixels.len();
                let pixel = &mut pixels[turn];
                turn = (turn + 1) % number;
                pixel.count(&config, now);
                let passed = u16::try_from(now - pixel.looked).unwrap_or(u16::MAX);
                pixel.looked = now;
                let last = LaserCycle::new(now - 1);
                let looked = &mut pixel.pixel;
                let _ = looked.end_laser_cycles(&config, &mut all, last, passed);
            }
            Mark::Taken(address) => {
                let pixel = pixels.get_mut(usize::from(address.raw()));
                let event = pixel.and_then(|pixel| pixel.pixel.take_event());
                events.push(event.with_context(|| format!("no event waits in {address:?}"))?);
            }
        }
    }
    for pixel in &mut pixels {
        pixel.count(&config, u64::MAX);
        pixel.pixel.add_photons_to(&mut all);
    }
    Ok((events, all))
}

struct Pixel {
    pixel: AsyncPixel<BINS>,
    /// Those that have not been counted.
    photons: Peekable<IntoIter<Photon>>,
    /// Laser cycles that had ended at the last look.
    looked: u64,
}

impl Pixel {
    /// Counts the photons of the laser cycles before `end`.
    fn count(&mut self, config: &PixelConfig<BINS>, end: u64) {
        let is_before = |photon: &Photon| u64::from(photon.cycle) < end;
        while let Some(photon) = self.photons.next_if(is_before) {
            self.pixel.count(config, photon.code);
        }
    }
}

/// Whether both are the same, event by event.
///
/// # Errors
/// Names the first that differs.
pub fn compare(of_core: &[DepthEvent], of_host: &[DepthEvent]) -> Result<()> {
    for (of_core, of_host) in of_core.iter().zip(of_host) {
        ensure!(
            of_core == of_host,
            "over the link {of_core:?}, on the host {of_host:?}"
        );
    }
    let [of_core, of_host] = [of_core.len(), of_host.len()];
    ensure!(
        of_core == of_host,
        "{of_core} events over the link, {of_host} on the host"
    );
    Ok(())
}

#[cfg(test)]
mod tests {
    use dtof_core::AerEncoder;

    use super::*;

    /// A target in every laser cycle of the second of two macropixels, looks in turn, and the
    /// words of the events.
    fn target() -> (Vec<Photon>, Vec<u32>, Vec<u128>) {
        let photons: Vec<Photon> = (0..200)
            .map(|cycle| Photon {
                cycle,
                pixel: 1,
                code: 60,
            })
            .collect();
        let mut marks = Vec::new();
        for now in (50..=200).step_by(50) {
            marks.push(Mark::Look(now).to_raw());
            marks.push(Mark::Look(now).to_raw());
            marks.push(Mark::Taken(PixelAddress::new(1)).to_raw());
        }
        let (events, _) = decided(2, &marks, &photons).unwrap();
        let mut encoder = AerEncoder::new();
        let mut words = Vec::new();
        for event in &events {
            let (time, word) = encoder.encode(event);
            let both = time.into_iter().chain([word]);
            words.extend(both.map(|word| u128::from_le_bytes(word.to_le_bytes())));
        }
        (photons, marks, words)
    }

    #[test]
    fn every_wrong_bit_missing_and_additional_event_is_noticed() {
        let (photons, marks, words) = target();
        let (events, all) = decided(2, &marks, &photons).unwrap();
        assert_eq!((words.len(), all.events, all.photons()), (5, 4, 200));
        assert!(compare(&decoded(&words).unwrap(), &events).is_ok());
        for bit in 0..u128::BITS {
            let mut wrong = words.clone();
            wrong[2] ^= 1 << bit;
            let same = decoded(&wrong).and_then(|wrong| compare(&wrong, &events));
            assert!(same.is_err(), "bit {bit}");
        }
        assert!(decoded(&words[1..]).is_err(), "no time word");
        for wrong in [&words[..4], &[words.clone(), vec![words[4]]].concat()] {
            assert!(compare(&decoded(wrong).unwrap(), &events).is_err());
        }
    }

    #[test]
    fn photons_and_looks_make_the_events() {
        let (photons, marks, words) = target();
        let same = |marks: &[u32], photons: &[Photon]| {
            let (events, _) = decided(2, marks, photons)?;
            compare(&decoded(&words)?, &events)
        };
        assert!(same(&marks, &photons).is_ok());
        assert!(same(&marks, &photons[1..]).is_err());
        // A look less, and so the other macropixel's turn.
        assert!(same(&marks[1..], &photons).is_err());
        let later = Mark::Look(52).to_raw();
        assert!(same(&[&[marks[0], later], &marks[2..]].concat(), &photons).is_err());
    }
}
