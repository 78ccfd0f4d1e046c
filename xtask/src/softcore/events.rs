//! The event words of a soft-core against what the host makes of the same photons.

use anyhow::{Context, Result, ensure};
use dtof_core::{AerDecoder, AerRecord, AerWord, AsyncPixel, DepthEvent, Flags};
use dtof_softcore::stream::{self, BINS};

use super::photons::Photon;

/// Decodes the words and decides again, on the host, from the photons of each event's
/// exposure. How many events there are.
///
/// # Errors
/// If a word means nothing or something else, or two exposures of a macropixel share a
/// laser cycle.
pub fn check(words: &[u128], photons: &[Photon]) -> Result<u64> {
    let mut decoder = AerDecoder::new();
    let mut events = 0;
    // The laser cycle that ended the last exposure of each macropixel.
    let mut ended = [0; 1 << u8::BITS];
    for &word in words {
        let record = decoder.decode(AerWord::from_le_bytes(word.to_le_bytes()));
        let event = match record.with_context(|| format!("word {word:032x}"))? {
            AerRecord::Time(_) => continue,
            AerRecord::Event(event) => event,
            other => anyhow::bail!("{other:?} over the link"),
        };
        events += 1;
        let end = event.cycle.0 + 1;
        let start = end.checked_sub(event.exposure.into());
        let start = start.with_context(|| format!("{event:?}: before the first laser cycle"))?;
        let ended = ended.get_mut(usize::from(event.pixel.0));
        let ended = ended.with_context(|| format!("{event:?}: no such macropixel"))?;
        ensure!(start >= *ended, "{event:?}: photons counted twice");
        *ended = end;
        let again = decide(&event, start, photons)?;
        ensure!(
            again == Some(event),
            "{event:?}: the host decides {again:?}"
        );
    }
    Ok(events)
}

/// What the host decides from the photons from laser cycle `start` to the event.
fn decide(event: &DepthEvent, start: u64, photons: &[Photon]) -> Result<Option<DepthEvent>> {
    let config = stream::config()?;
    let mut pixel = AsyncPixel::<BINS>::new(event.pixel);
    let first = photons.partition_point(|photon| u64::from(photon.cycle) < start);
    for photon in &photons[first..] {
        if u64::from(photon.cycle) > event.cycle.0 {
            break;
        }
        if u16::from(photon.pixel) == event.pixel.0 {
            pixel.count(&config, photon.code);
        }
    }
    let _ = pixel.end_laser_cycles(&config, event.cycle, event.exposure);
    let again = pixel.acknowledge();
    // Whether a decision was put off is the link's doing.
    let put_off = event.flags.contains(Flags::DEFERRED);
    Ok(again.map(|mut again| {
        if put_off {
            again.flags |= Flags::DEFERRED;
        }
        again
    }))
}

#[cfg(test)]
mod tests {
    use dtof_core::{AerEncoder, LaserCycle, PixelAddress};

    use super::*;

    /// A target in every laser cycle of macropixel 2, and the events of two exposures.
    fn target() -> (Vec<Photon>, Vec<u128>) {
        let config = stream::config().unwrap();
        let mut pixel = AsyncPixel::<BINS>::new(PixelAddress(2));
        let mut encoder = AerEncoder::new();
        let (mut photons, mut words) = (Vec::new(), Vec::new());
        for cycle in 0..100_u32 {
            photons.push(Photon {
                cycle,
                pixel: 2,
                code: 60,
            });
            pixel.count(&config, 60);
            let _ = pixel.end_laser_cycle(&config, LaserCycle(cycle.into()));
            if let Some(event) = pixel.acknowledge() {
                let (time, word) = encoder.encode(&event);
                let word = time.into_iter().chain([word]);
                words.extend(word.map(|word| u128::from_le_bytes(word.to_le_bytes())));
            }
        }
        (photons, words)
    }

    #[test]
    fn events_are_those_of_the_photons() {
        let (photons, words) = target();
        assert_eq!(words.len(), 3, "a time word and two events");
        assert_eq!(check(&words, &photons).unwrap(), 2);
        assert_eq!(check(&[], &photons).unwrap(), 0);
    }

    #[test]
    fn every_wrong_bit_of_an_event_is_noticed() {
        let (photons, words) = target();
        for bit in 0..u128::BITS {
            let mut wrong = words.clone();
            wrong[1] ^= 1 << bit;
            let is_put_off = check(&wrong, &photons).is_ok();
            // Only the flag that the link sets is not known to the host.
            let flags = u128::from(Flags::DEFERRED.bits()) << 122;
            assert_eq!(is_put_off, 1 << bit == flags, "bit {bit}");
        }
    }

    #[test]
    fn photons_that_are_missing_or_shared_are_noticed() {
        let (photons, words) = target();
        assert!(check(&words, &photons[1..]).is_err());
        assert!(check(&[words[0], words[1], words[1]], &photons).is_err());
        assert!(check(&words[1..], &photons).is_err(), "no time word");
    }
}
