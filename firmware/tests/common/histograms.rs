//! The answers to histogram requests.

use dtof_core::PixelAddress;
use dtof_firmware::sidecar::Sidecar;
use dtof_link::{HistogramHead, HistogramPart, NoHistogram, message};

use super::host::Host;

pub type Answer = Result<(HistogramHead, Vec<u32>), (PixelAddress, NoHistogram)>;

/// The answers to histogram requests among these messages.
pub fn histograms(answers: &[(u8, Vec<u8>, usize)]) -> Vec<Answer> {
    let mut found: Vec<Answer> = Vec::new();
    let mut parts: Option<(HistogramHead, Vec<u32>)> = None;
    for (_, body, _) in answers
        .iter()
        .filter(|(kind, ..)| *kind == message::HISTOGRAM)
    {
        let part = match HistogramPart::from_le_bytes(body).unwrap() {
            Ok(part) => part,
            Err(none) => {
                found.push(Err(none));
                continue;
            }
        };
        let (head, mut counts) = parts.take().unwrap_or((part.head(), Vec::new()));
        assert_eq!(head, part.head());
        assert_eq!(counts.len(), usize::from(part.first_bin()));
        counts.extend(part.counts());
        if counts.len() < 128 {
            parts = Some((head, counts));
        } else {
            assert_eq!(counts.len(), 128);
            found.push(Ok((head, counts)));
        }
    }
    assert_eq!(parts, None);
    found
}

/// The address of a pixel that no histogram can be had of, and why.
#[track_caller]
pub fn refused(device: &mut Sidecar, host: &mut Host, pixel: u16) -> NoHistogram {
    let (kind, body) = (message::HISTOGRAM_REQUEST, pixel.to_le_bytes());
    let body = host.answer(device, 0, kind, &body);
    let (of, reason) = HistogramPart::from_le_bytes(&body).unwrap().unwrap_err();
    assert_eq!(of.raw(), pixel);
    reason
}
