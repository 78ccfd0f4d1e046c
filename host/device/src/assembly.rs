//! Assembles histograms from link messages.

use std::collections::VecDeque;

use anyhow::{Context, Result, ensure};
use dtof_core::PixelAddress;
use dtof_link::{HistogramHead, HistogramPart, NoHistogram};

/// The histogram of a pixel as a device has sent it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PixelHistogram {
    /// Pixel, laser cycle and exposure.
    pub head: HistogramHead,
    /// Photons of each bin.
    pub counts: Vec<u32>,
}

/// The answer to a request: the histogram, or the pixel and the reason why it has none.
pub type HistogramAnswer = Result<PixelHistogram, (PixelAddress, NoHistogram)>;

/// Open requests, and answers that have arrived.
#[derive(Debug, Default)]
pub(super) struct Assembly {
    requested: VecDeque<PixelAddress>,
    /// A histogram whose last bins are still missing.
    begun: Option<PixelHistogram>,
    answers: VecDeque<HistogramAnswer>,
}

impl Assembly {
    /// Notes that a histogram was requested.
    pub fn request(&mut self, pixel: PixelAddress) {
        self.requested.push_back(pixel);
    }

    /// The next answer.
    pub fn next(&mut self) -> Option<HistogramAnswer> {
        self.answers.pop_front()
    }

    /// Takes a message from a device with `bins` bins.
    ///
    /// # Errors
    /// Fails if the message is invalid or was not requested.
    pub fn take(&mut self, body: &[u8], bins: u16) -> Result<()> {
        let part = HistogramPart::from_le_bytes(body);
        let part = part.context("the device sends an invalid histogram")?;
        let pixel = match &part {
            Ok(part) => part.head().pixel,
            Err((pixel, _)) => *pixel,
        };
        ensure!(
            self.requested.front() == Some(&pixel),
            "the device sends a histogram of pixel {}, which was not requested",
            pixel.raw()
        );
        let number = pixel.raw();
        let part = match part {
            Ok(part) => part,
            Err(none) => {
                ensure!(
                    self.begun.is_none(),
                    "the device sends half a histogram of pixel {number}"
                );
                self.requested.pop_front();
                self.answers.push_back(Err(none));
                return Ok(());
            }
        };
        let head = part.head();
        let mut histogram = self.begun.take().unwrap_or(PixelHistogram {
            head,
            counts: Vec::new(),
        });
        let (have, first) = (histogram.counts.len(), part.first_bin());
        ensure!(
            histogram.head == head && have == usize::from(first),
            "the device sends bin {first} of pixel {number} where bin {have} comes next"
        );
        ensure!(
            u64::from(head.exposure) <= head.cycle.raw(),
            "the device sends an exposure of pixel {number} that began before the first laser cycle"
        );
        histogram.counts.extend(part.counts());
        let have = histogram.counts.len();
        ensure!(
            have <= usize::from(bins),
            "the device sends {have} bins of pixel {number}, and has {bins} bins"
        );
        if have < usize::from(bins) {
            self.begun = Some(histogram);
        } else {
            self.requested.pop_front();
            self.answers.push_back(Ok(histogram));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use dtof_core::LaserCycle;
    use proptest::prelude::*;

    const HEAD: HistogramHead = HistogramHead {
        pixel: PixelAddress::new(3),
        is_whole: false,
        cycle: LaserCycle::new(1000),
        exposure: 40,
    };

    fn bodies(head: HistogramHead, counts: &[u32]) -> Vec<Vec<u8>> {
        let messages = head.messages(counts).map(|message| {
            let mut body = heapless::Vec::new();
            message.write(&mut body);
            body.to_vec()
        });
        messages.collect()
    }

    #[test]
    fn pieces_become_histograms_in_the_order_of_requests() {
        let mut counts = vec![7; 128];
        counts[99] = 1 << 20;
        let mut assembly = Assembly::default();
        let other = PixelAddress::new(4);
        for pixel in [HEAD.pixel, other, HEAD.pixel] {
            assembly.request(pixel);
        }
        let bodies = bodies(HEAD, &counts);
        assert_eq!(bodies.len(), 2);
        assembly.take(&bodies[0], 128).unwrap();
        assert_eq!(assembly.next(), None);
        assembly.take(&bodies[1], 128).unwrap();
        let none = NoHistogram::GivenUp;
        assembly.take(&none.message(other), 128).unwrap();
        let histogram = PixelHistogram { head: HEAD, counts };
        assert_eq!(assembly.next(), Some(Ok(histogram)));
        assert_eq!(assembly.next(), Some(Err((other, none))));
        assert_eq!(assembly.next(), None);
    }

    #[test]
    fn invalid_messages_are_refused() {
        let whole = bodies(HEAD, &[1; 128]).remove(0);
        let halves = bodies(HEAD, &[1 << 20; 128]);
        let late = HistogramHead {
            exposure: 1001,
            ..HEAD
        };
        let none = NoHistogram::NoPixel.message(HEAD.pixel).to_vec();
        let other = NoHistogram::NoPixel.message(PixelAddress::new(9)).to_vec();
        let too_many = bodies(HEAD, &[1; 136]).remove(0);
        let cases: [(&[&[u8]], &str); 8] = [
            (&[&[]], "an invalid histogram"),
            (&[&whole[..16]], "an invalid histogram"),
            (&[&other], "of pixel 9, which was not requested"),
            (&[&none, &none], "of pixel 3, which was not requested"),
            (&[&halves[1]], "bin 80 of pixel 3 where bin 0 comes next"),
            (
                &[&halves[0], &halves[0]],
                "bin 0 of pixel 3 where bin 80 comes next",
            ),
            (&[&halves[0], &none], "half a histogram of pixel 3"),
            (&[&too_many], "136 bins of pixel 3, and has 128 bins"),
        ];
        for (messages, reason) in cases {
            let mut assembly = Assembly::default();
            assembly.request(HEAD.pixel);
            let mut taken = messages.iter().map(|body| assembly.take(body, 128));
            let error = taken.find_map(Result::err).unwrap().to_string();
            assert!(error.contains(reason), "{error}");
        }
        let mut assembly = Assembly::default();
        assembly.request(HEAD.pixel);
        let error = assembly.take(&bodies(late, &[1; 128])[0], 128);
        assert!(error.unwrap_err().to_string().contains("began before"));
    }

    proptest! {
        #[test]
        fn any_messages_are_taken_or_refused(
            bodies in prop::collection::vec(prop::collection::vec(any::<u8>(), 0..244), 0..4),
            reason in 0u8..5,
        ) {
            let mut assembly = Assembly::default();
            for mut body in bodies {
                assembly.request(PixelAddress::new(0));
                for (place, byte) in body.iter_mut().zip([0, 0, reason, 0]) {
                    *place = byte;
                }
                let _ = assembly.take(&body, 128);
            }
            while let Some(answer) = assembly.next() {
                prop_assert!(answer.is_err() || answer.is_ok_and(|found| found.counts.len() == 128));
            }
        }
    }
}
