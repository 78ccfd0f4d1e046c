//! Recordings of every format: any bytes are one, or one clear line.

use std::fs;

use dtof_data::photons::input::Input as Recorded;
use dtof_data::photons::open::{ReadOptions, counts, open};

use crate::{Input, folder, is_one_line};

/// What a file of this name begins with, so that the search need not find it.
const FORMATS: [(&str, &[u8]); 8] = [
    ("a.npy", b""),
    ("a.npy", b"\x93NUMPY\x01\x00"),
    ("a.npz", b"PK\x03\x04"),
    ("a.csv", b"pixel,cycle,bin\n"),
    ("a.json", b"[{"),
    ("a.json", b"{\"Result_Set\":["),
    ("a.json.gz", b"\x1f\x8b\x08"),
    ("a.npz", b""),
];

/// Laser cycles that are read.
const CYCLES: u16 = 300;

/// What a user says of a recording: nothing, mostly.
fn opening(choice: u8) -> ReadOptions {
    let is = |bit: u8| choice >> bit & 1 == 1;
    ReadOptions {
        cycles: Some(CYCLES.into()),
        rebin: if is(0) { 2 } else { 1 },
        columns: is(1).then_some(2),
        bins: is(2).then_some(8),
        axes: is(3).then(|| "bins,captures,columns".parse().expect("axes")),
        masked: if is(4) { vec![0] } else { Vec::new() },
        ..ReadOptions::default()
    }
}

/// Photons that are read are in the array and in order. Together with those that are left they are
/// all that were counted.
pub fn recordings(data: &[u8]) {
    let mut input = Input::new(data);
    let choice = input.byte();
    let (name, head) = FORMATS[usize::from(choice & 7)];
    let folder = folder();
    let path = folder.path().join(name);
    fs::write(&path, [head, input.left].concat()).expect("a file");
    let recorded = Recorded::File(path);
    let opening = opening(choice >> 3);
    let mut recording = match open(&recorded, &opening) {
        Ok(recording) => recording,
        Err(error) => return is_one_line(&error),
    };
    let source = recording.photons.as_mut();
    let (pixels, cycles) = (source.addresses().len(), source.cycles());
    assert!(cycles <= u64::from(CYCLES));
    let (mut done, mut photons) = (0, 0);
    while done < cycles {
        let slice = match source.next_slice(100) {
            Ok(slice) => slice,
            Err(error) => return is_one_line(&error),
        };
        assert_eq!(slice.pixels.len(), pixels);
        assert_eq!(slice.first_cycle, done);
        for pixel in &slice.pixels {
            let mut of_pixel = pixel.photons.iter();
            assert!(pixel.photons.is_sorted_by_key(|photon| photon.cycle));
            assert!(of_pixel.all(|photon| {
                photon.cycle < pixel.cycles && usize::from(photon.code) < recording.metadata.bins
            }));
            photons += pixel.photons.len() as u64;
        }
        done += 100;
    }
    let all = match counts(&recorded, &opening) {
        Ok(all) => all,
        Err(error) => return is_one_line(&error),
    };
    let counted: u64 = all.histograms.iter().flatten().sum();
    // Of a list the laser cycles that are read are counted, of histograms all.
    let left = if recording.metadata.is_list {
        0
    } else {
        source.not_replayed()
    };
    assert_eq!(photons + left, counted);
}
