//! What the tests of the link share.

use dtof_link::endpoint::Endpoint;
use dtof_link::frame::Deframer;

/// The golden frame whose line in the document begins so.
pub fn golden(begins: &str) -> Vec<u8> {
    let document = include_str!("../../../docs/link-format.md");
    let line = document
        .lines()
        .find(|line| line.starts_with(&format!("| {begins}")))
        .unwrap();
    let hex = line.split('`').nth(1).unwrap();
    hex.split(' ')
        .map(|byte| u8::from_str_radix(byte, 16).unwrap())
        .collect()
}

/// Puts bytes of the wire into an end.
pub fn give(end: &mut Endpoint, wire: &[u8]) {
    let mut deframer = Deframer::new();
    for &byte in wire {
        if let Some(frame) = deframer.push(byte) {
            end.receive(frame, 0);
        }
    }
}
