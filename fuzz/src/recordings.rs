//! Recordings of every format: any bytes are one, or one clear line.

use std::fs;

use dtof::input::medium::Medium;
use dtof::input::open::{Opening, counts, open};

use crate::Input;

/// What a file of this name begins with, so that the search need not find it.
const FORMATS: [(&str, &[u8]); 6] = [
    ("a.npy", b""),
    ("a.npy", b"\x93NUMPY\x01\x00"),
    ("a.npz", b"PK\x03\x04"),
    ("a.csv", b"pixel,cycle,bin\n"),
    ("a.json", b"[{"),
    ("a.json", b"{\"Result_Set\":["),
];

/// Photons that are read are in the array and in order, and are as many as are counted.
pub fn recordings(data: &[u8]) {
    let mut input = Input::new(data);
    let (name, head) = FORMATS[usize::from(input.byte()) % FORMATS.len()];
    let folder = tempfile::tempdir_in("/dev/shm").or_else(|_| tempfile::tempdir());
    let folder = folder.expect("a folder");
    let path = folder.path().join(name);
    fs::write(&path, [head, input.left].concat()).expect("a file");
    let medium = Medium::File(path);
    let opening = Opening {
        cycles: 300,
        ..Opening::default()
    };
    let mut recording = match open(&medium, &opening) {
        Ok(recording) => recording,
        Err(error) => {
            let line = format!("{error:#}");
            assert!(!line.is_empty() && !line.contains('\n'), "{line:?}");
            return;
        }
    };
    let source = recording.photons.as_mut();
    let pixels = source.addresses().len();
    let mut done = 0;
    while done < source.cycles().min(300) {
        let Ok(slice) = source.next_slice(100) else {
            return;
        };
        assert_eq!(slice.pixels.len(), pixels);
        assert_eq!(slice.first_cycle, done);
        for pixel in &slice.pixels {
            assert!(pixel.photons.is_sorted_by_key(|photon| photon.cycle));
            assert!(
                pixel
                    .photons
                    .iter()
                    .all(|photon| photon.cycle < pixel.cycles.max(1))
            );
        }
        done += 100;
    }
    let _ = counts(&medium, &opening);
}
