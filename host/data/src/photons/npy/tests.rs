use std::io::{Cursor, Write};
use std::sync::Arc;

use anyhow::{Context, Result};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

use super::header::{Array, Header};
use super::histograms::ArrayHistograms;
use super::numbers::ElementKind;
use super::records::{self, RecordReader};
use super::{archive, header, histograms, numbers};
use crate::photons::axes::Axes;
use crate::photons::input::{Input, NpyArray};
use crate::photons::photon_list::{PhotonReader, RawPhoton};

/// The array `a.npy`.
fn array(descr: &str, shape: &[u64], data: &[u8]) -> Input {
    with_header(header(descr, shape, 128), data)
}

/// The same in Fortran order.
fn fortran(descr: &str, shape: &[u64], data: &[u8]) -> Input {
    let header = String::from_utf8_lossy(&header(descr, shape, 128)[10..]).into_owned();
    let dictionary = header.replace("False", "True ");
    let start = b"\x93NUMPY\x01\x00\x76\x00";
    with_header([start, dictionary.as_bytes()].concat(), data)
}

fn with_header(header: Vec<u8>, data: &[u8]) -> Input {
    Input::Array(Arc::new(NpyArray {
        name: "a.npy".to_owned(),
        header,
        data: Box::new(data.to_vec()),
    }))
}

/// The histograms of an array.
fn histograms_of(input: &Input, axes: Option<&Axes>) -> Result<ArrayHistograms> {
    let read = Array::open(input).and_then(|array| histograms::read(array, axes));
    read.with_context(|| input.to_string())
}

/// The fields of a list of photons that are not read.
fn other_fields(input: &Input, has_axes: bool) -> Result<Option<Vec<String>>> {
    let header: Result<Header> = Array::open(input).map(|array| array.header);
    let header = header.with_context(|| input.to_string())?;
    Ok(records::other_fields(&header, has_axes))
}

/// The line of an error.
fn line<T>(result: Result<T>) -> String {
    format!("{:#}", result.err().expect("an error"))
}

#[test]
fn a_header_is_what_numpy_writes() {
    let dictionary = "{'descr': '<u2', 'fortran_order': False, 'shape': (3, 4), }";
    let text = format!("{dictionary:<117}\n");
    let expected = [&b"\x93NUMPY\x01\x00\x76\x00"[..], text.as_bytes()].concat();
    assert_eq!(header("<u2", &[3, 4], 128), expected);
    for (descr, shape, dictionary) in [
        (
            "|u1",
            &[][..],
            "{'descr': '|u1', 'fortran_order': False, 'shape': (), }",
        ),
        (
            ">f8",
            &[5],
            "{'descr': '>f8', 'fortran_order': False, 'shape': (5,), }",
        ),
        (
            "[('x', '<f4')]",
            &[2, 3, 4],
            "{'descr': [('x', '<f4')], 'fortran_order': False, 'shape': (2, 3, 4), }",
        ),
    ] {
        // No space is left: it takes what it needs.
        let text = format!("{dictionary}\n");
        let length = u8::try_from(text.len()).unwrap();
        let start = [&b"\x93NUMPY\x01\x00"[..], &[length, 0]].concat();
        let expected = [&start, text.as_bytes()].concat();
        assert_eq!(header(descr, shape, 0), expected, "{descr}");
    }
}

/// One number of each type, as a picture and as a count of photons.
#[test]
fn numbers_of_every_type_are_read() {
    use ElementKind::{Byte, Float, Integer};
    let float = 1.5f32.to_bits().to_be_bytes();
    let double = 2e9f64.to_bits().to_le_bytes();
    for (descr, bytes, kind, value) in [
        ("|u1", &[0x81][..], Byte, 129.0),
        ("|i1", &[0x81], Integer, -127.0),
        ("<i1", &[0x7f], Integer, 127.0),
        ("<u2", &[0x02, 0x81], Integer, 33_026.0),
        (">u2", &[0x81, 0x02], Integer, 33_026.0),
        ("<i2", &[0x02, 0x81], Integer, -32_510.0),
        (">i2", &[0x01, 0x02], Integer, 258.0),
        ("<u4", &[0, 0, 1, 0xff], Integer, 4_278_255_616.0),
        (">i4", &[0xff, 0xff, 0xff, 0xfe], Integer, -2.0),
        (">u8", &[0x80, 0, 0, 0, 0, 0, 0, 0], Integer, 2f64.powi(63)),
        ("<i8", &[0, 0, 0, 0, 0, 0, 0, 0x80], Integer, -2f64.powi(63)),
        ("<i8", &[3, 0, 0, 0, 1, 0, 0, 0], Integer, 4_294_967_299.0),
        (">f4", &float, Float, 1.5),
        ("<f8", &double, Float, 2e9),
        // 16 bits: five of exponent, ten of fraction.
        ("<f2", &[0x00, 0x00], Float, 0.0),
        ("<f2", &[0x01, 0x00], Float, 2f64.powi(-24)),
        (">f2", &[0x83, 0xff], Float, -1023.0 * 2f64.powi(-24)),
        ("<f2", &[0x00, 0x04], Float, 2f64.powi(-14)),
        ("<f2", &[0x55, 0x35], Float, 0.333_251_953_125),
        ("<f2", &[0x00, 0x3c], Float, 1.0),
        ("<f2", &[0x00, 0xc0], Float, -2.0),
        ("<f2", &[0xff, 0x7b], Float, 65_504.0),
        ("<f2", &[0x00, 0x7c], Float, f64::INFINITY),
        (">f2", &[0xfc, 0x00], Float, f64::NEG_INFINITY),
    ] {
        let picture = numbers::read(&array(descr, &[1, 1], bytes)).unwrap();
        assert_eq!(picture.values, [value], "{descr} {bytes:?}");
        assert_eq!((picture.element, &picture.shape[..]), (kind, &[1, 1][..]));
        let counts = histograms_of(&array(descr, &[1], bytes), None);
        let count = counts
            .ok()
            .map(|counts| counts.histograms.count(0, 0) as f64);
        let is_count = value >= 0.0 && value.fract() == 0.0;
        assert_eq!(count, is_count.then_some(value), "{descr} {bytes:?}");
    }
    for nan in [[0x00, 0x7e], [0x01, 0xfc]] {
        let nan = numbers::read(&array("<f2", &[1, 1], &nan)).unwrap();
        assert!(nan.values[0].is_nan());
    }
}

/// Above 2^53 not all whole numbers are floats.
#[test]
fn floats_are_counts_up_to_the_last_that_is_exact() {
    let read = |value: f64| histograms_of(&array("<f8", &[1], &value.to_le_bytes()), None);
    let most = 2f64.powi(53);
    assert_eq!(read(most).unwrap().histograms.count(0, 0), 1 << 53);
    assert_eq!(read(-0.0).unwrap().histograms.count(0, 0), 0);
    for (value, is) in [
        (
            most + 2.0,
            "9007199254740994, which is not a number of photons",
        ),
        (0.5, "0.5, which is not a number of photons"),
        (f64::INFINITY, "inf, which is not a number of photons"),
        (f64::NAN, "NaN, which is not a number of photons"),
        (-0.5, "negative: -0.5"),
    ] {
        assert_eq!(line(read(value)), format!("a.npy: element [0] is {is}"));
    }
}

/// More elements than are converted at a time.
#[test]
fn elements_past_the_first_block_are_read_and_named() {
    let mut bytes = vec![1; 3 * 4096];
    bytes[2 * 4096 + 5] = 255;
    let negative = histograms_of(&array("|i1", &[3, 4096], &bytes), None);
    assert_eq!(line(negative), "a.npy: element [2, 5] is negative: -1");
    let counts: Vec<u16> = (0..3 * 4096).map(|count| count * 5).collect();
    let bytes: Vec<u8> = counts
        .iter()
        .flat_map(|count| count.to_be_bytes())
        .collect();
    let read = histograms_of(&array(">u2", &[3, 4096], &bytes), None).unwrap();
    let expected = counts.into_iter().map(u64::from);
    assert!(read.histograms.iter().flatten().eq(expected));
}

/// Two rows of three: 0 to 5 in C order.
#[test]
fn the_order_in_the_file_makes_no_difference() {
    let rows = array("|u1", &[2, 3], &[0, 1, 2, 3, 4, 5]);
    let columns = fortran("|u1", &[2, 3], &[0, 3, 1, 4, 2, 5]);
    let axes: Axes = "columns,bins".parse().unwrap();
    for input in [rows, columns] {
        let picture = numbers::read(&input).unwrap();
        assert_eq!(picture.values, [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
        let histograms = histograms_of(&input, Some(&axes)).unwrap();
        assert!(histograms.histograms.iter().eq([[0, 1, 2], [3, 4, 5]]));
        assert_eq!(histograms.axes, [2]);
    }
    // 2 by 3 by 4, of which the last index is the slowest.
    let slow: Vec<u8> = (0..24)
        .map(|at| at % 2 * 12 + at / 2 % 3 * 4 + at / 6)
        .collect();
    let picture = numbers::read(&fortran("|u1", &[2, 3, 4], &slow)).unwrap();
    assert!(picture.values.into_iter().eq((0..24).map(f64::from)));
    let negative = fortran("|i1", &[2, 2, 2], &[0, 0, 0, 0, 255, 0, 0, 0]);
    assert_eq!(
        line(histograms_of(&negative, None)),
        "a.npy: element [0, 0, 1] is negative: -1"
    );
}

#[test]
fn what_holds_no_histograms_is_refused() {
    let whole = "must be integers, or floats that are whole numbers; convert them with .astype(numpy.uint32)";
    for (descr, shape, bytes, message) in [
        ("|b1", &[2, 8][..], 16, format!("elements are |b1: {whole}")),
        ("<c8", &[1, 8], 64, format!("elements are <c8: {whole}")),
        (
            "[('a', '<u4')]",
            &[8],
            32,
            "elements are records, not numbers".to_owned(),
        ),
        (
            "<f4",
            &[2, 3],
            24,
            "elements are <f4: photons are rows of three integers: pixel, cycle and bin; convert them with \
             .astype(numpy.int64)"
                .to_owned(),
        ),
        (
            "<u4",
            &[2, 4],
            32,
            "4 bins: must be from 8 to 4096; photons are rows of three: pixel, cycle and bin".to_owned(),
        ),
        (
            "|u1",
            &[1, 4097],
            4097,
            "4097 bins: must be at most 4096 (axes says which axis they are)".to_owned(),
        ),
        (
            "<u4",
            &[],
            4,
            "the array has no axis; one must be the bins".to_owned(),
        ),
        ("|u1", &[0, 8], 0, "the array [0, 8] is empty".to_owned()),
    ] {
        let input = array(descr, shape, &vec![0; bytes]);
        assert_eq!(line(histograms_of(&input, None)), format!("a.npy: {message}"));
    }
    // What is left to refuse depends on the run.
    for bins in [3, 8, 4096] {
        let input = array("|u1", &[2, bins as u64], &vec![0; 2 * bins]);
        let read = histograms_of(&input, None).unwrap();
        assert_eq!(read.layout.bins(), bins);
    }
}

#[test]
fn what_is_no_picture_is_refused() {
    let numbers_of =
        "must be integers, or floats of 32 or 64 bits; convert them with .astype(numpy.float32)";
    for (descr, shape, bytes, message) in [
        (
            "|b1",
            &[1, 2][..],
            2,
            format!("elements are |b1: {numbers_of}"),
        ),
        (
            "<c8",
            &[1, 2],
            16,
            format!("elements are <c8: {numbers_of}"),
        ),
        ("<f4", &[0, 2], 0, "the array [0, 2] is empty".to_owned()),
        (
            "|u1",
            &[3, 16_777_217],
            3 * 16_777_217,
            "50331651 elements: must be at most 50331648".to_owned(),
        ),
    ] {
        let input = array(descr, shape, &vec![0; bytes]);
        assert_eq!(line(numbers::read(&input)), format!("a.npy: {message}"));
    }
}

/// All photons, and where each was.
fn photons(input: &Input) -> Result<Vec<(RawPhoton, String)>> {
    let mut reader = RecordReader::open(input)?;
    let mut all = Vec::new();
    while let Some(photon) = reader.next()? {
        all.push((photon, reader.place()));
        assert!(all.len() <= 20_000, "no end");
    }
    assert!(reader.next()?.is_none());
    Ok(all)
}

/// The same photons in records and in rows, more than are read at a time.
#[test]
fn photons_are_read_in_every_layout() {
    let expected: Vec<RawPhoton> = (0..20_000).map(|at| [at % 200, 3 * at, at % 128]).collect();
    let packed = "[('pixel', '|u1'), ('cycle', '<u4'), ('bin', '<i2')]";
    let turned =
        "[('bin', '>i2'), ('', '|V3'), ('time', '<f8', (2,)), ('cycle', '>u8'), ('pixel', '<i4')]";
    let data = |bytes: &dyn Fn(RawPhoton) -> Vec<u8>| -> Vec<u8> {
        expected.iter().flat_map(|&photon| bytes(photon)).collect()
    };
    let low = |number: u64, bytes: usize| number.to_le_bytes()[..bytes].to_vec();
    let high = |number: u64, bytes: usize| number.to_be_bytes()[8 - bytes..].to_vec();
    let packed_data =
        data(&|[pixel, cycle, bin]| [low(pixel, 1), low(cycle, 4), low(bin, 2)].concat());
    let turned_data = data(&|[pixel, cycle, bin]| {
        [high(bin, 2), vec![0xff; 19], high(cycle, 8), low(pixel, 4)].concat()
    });
    let triples = data(&|photon| photon.map(|number| high(number, 4)).concat());
    for (input, others) in [
        (array(packed, &[20_000], &packed_data), vec![]),
        (
            array(turned, &[20_000], &turned_data),
            vec!["time".to_owned()],
        ),
        (array(">i4", &[20_000, 3], &triples), vec![]),
    ] {
        assert_eq!(other_fields(&input, false).unwrap(), Some(others));
        let found = photons(&input).unwrap();
        assert_eq!(found.len(), expected.len());
        for (at, (photon, place)) in found.into_iter().enumerate() {
            assert_eq!(photon, expected[at]);
            assert_eq!(place, format!("a.npy: record {at}"));
        }
    }
}

/// What is a list of photons, and of which fields, without and with names of axes.
#[test]
fn a_list_of_photons_is_told_from_histograms() {
    let of = |names: &[&str]| Some(names.iter().map(|&name| name.to_owned()).collect());
    for (descr, shape, expected) in [
        ("<u4", &[0, 3][..], [of(&[]), None]),
        ("<f4", &[0, 3], [None, None]),
        ("<u4", &[0, 8], [None, None]),
        ("<u4", &[3], [None, None]),
        (
            "[('a', '<u2'), ('bin', '<u2'), ('', '|V1'), ('b', '<f4')]",
            &[0],
            [of(&["a", "b"]), of(&["a", "b"])],
        ),
    ] {
        let input = array(descr, shape, &vec![0; if shape == [3] { 12 } else { 0 }]);
        let found = [false, true].map(|has_axes| other_fields(&input, has_axes).unwrap());
        assert_eq!(found, expected, "{descr} {shape:?}");
    }
    let cut = with_header(b"\x93NUMPY".to_vec(), &[]);
    let message = "a.npy: not an .npy file as numpy.save writes it";
    assert_eq!(line(other_fields(&cut, false)), message);
}

#[test]
fn what_holds_no_photons_is_refused() {
    let fields = "[('pixel', '|u1'), ('cycle', '|i1'), ('bin', '|u1'), ('x', '|V4093')]";
    let with = |part: &str, other: &str| fields.replace(part, other);
    for (descr, shape, message) in [
        (
            fields.to_owned(),
            &[1, 1][..],
            "a list of photons has one axis, not [1, 1]",
        ),
        (
            with("bin", "tof"),
            &[1],
            "the records have the fields pixel, cycle, tof, x: must have pixel, cycle and bin",
        ),
        (
            with("|i1", "|b1"),
            &[1],
            "field cycle is |b1: must be an integer",
        ),
        (
            with("'|i1'", "'|i1', (1,)"),
            &[1],
            "field cycle is ('cycle', '|i1', (1,)): must be an integer",
        ),
        (
            with("4093", "4094"),
            &[1],
            "records of 4097 bytes: must be at most 4096",
        ),
        ("<u4".to_owned(), &[1, 1024], "the elements are not records"),
    ] {
        let bytes = if descr.contains("4094") { 4097 } else { 4096 };
        let read = photons(&array(&descr, shape, &vec![0; bytes]));
        assert_eq!(line(read), format!("a.npy: {message}"));
    }
    let turned = |rows: usize| fortran("|u1", &[rows as u64, 3], &vec![7; 3 * rows]);
    assert_eq!(
        line(photons(&turned(2))),
        "a.npy: the photons are in Fortran order; save numpy.ascontiguousarray of them"
    );
    assert_eq!(photons(&turned(1)).unwrap()[0].0, [7; 3]);
    // A number may be negative only where the type has a sign. The place is that of the photon.
    let mut data = vec![0; 2 * 4096];
    (data[0], data[4096 + 1]) = (200, 0xff);
    let mut reader = RecordReader::open(&array(fields, &[2], &data)).unwrap();
    assert_eq!(reader.place(), "a.npy: record 0");
    assert_eq!(reader.next().unwrap(), Some([200, 0, 0]));
    assert_eq!(line(reader.next()), "a number is negative");
    assert_eq!(reader.place(), "a.npy: record 1");
}

/// An archive with these arrays.
fn zip(arrays: &[(&str, &[u8])], method: CompressionMethod) -> Vec<u8> {
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    let options = SimpleFileOptions::default().compression_method(method);
    for (name, bytes) in arrays {
        zip.start_file(*name, options).unwrap();
        zip.write_all(bytes).unwrap();
    }
    zip.finish().unwrap().into_inner()
}

/// Reads an archive. An error is without the name of the file.
fn read_zip(bytes: &[u8], name: Option<&str>) -> Result<ArrayHistograms, String> {
    let file = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(&file, bytes).unwrap();
    archive::read(file.path(), name, None).map_err(|error| {
        let error = format!("{error:#}");
        let start = format!("{}: ", file.path().display());
        error.strip_prefix(&start).expect("its name").to_owned()
    })
}

/// Eight bins of so many photons.
fn bins(count: u8) -> Vec<u8> {
    [header("|u1", &[8], 128), vec![count; 8]].concat()
}

#[test]
fn an_array_of_an_archive_is_chosen_by_its_name() {
    let (dark, lit) = (bins(1), bins(100));
    for method in [CompressionMethod::Stored, CompressionMethod::Deflated] {
        let two = zip(
            &[("lit.npy", &lit), ("readme.txt", b"?"), ("dark.npy", &dark)],
            method,
        );
        let read = |name| read_zip(&two, name).map(|read| read.histograms.histogram(0));
        assert_eq!(read(Some("dark")), Ok(vec![1; 8]));
        assert_eq!(read(Some("lit")), Ok(vec![100; 8]));
        let message = "2 arrays: choose one with array: dark, lit";
        assert_eq!(read(None), Err(message.to_owned()));
        let message = "no array \"grey\"; there is dark, lit";
        assert_eq!(read(Some("grey")), Err(message.to_owned()));
    }
    let one = zip(&[("lit.npy", &lit)], CompressionMethod::Stored);
    assert!(
        read_zip(&one, None)
            .unwrap()
            .histograms
            .iter()
            .eq([[100; 8]])
    );
}

#[test]
fn what_is_wrong_with_an_archive_is_named_in_a_line() {
    let stored = |name: &str, bytes: &[u8]| zip(&[(name, bytes)], CompressionMethod::Stored);
    let whole = stored("two\nlines.npy", &bins(1));
    let longer = [bins(1), vec![0; 1 << 13]].concat();
    let [longer_stored, longer] = [CompressionMethod::Stored, CompressionMethod::Deflated]
        .map(|method| zip(&[("a.npy", &longer)], method));
    // A field of both headers of the entry: its offset in the one within the archive and in the list at the end.
    let with = |zip: &[u8], offsets: [usize; 2], bytes: &[u8]| {
        let mut zip = zip.to_vec();
        for (mark, offset) in [b"PK\x03\x04", b"PK\x01\x02"].into_iter().zip(offsets) {
            let at = zip.windows(4).position(|four| four == mark).unwrap() + offset;
            zip[at..at + bytes.len()].copy_from_slice(bytes);
        }
        zip
    };
    for (zip, message) in [
        (stored("a.txt", b"?"), "no arrays"),
        (
            stored("a.npy", b"?"),
            "array a: not an .npy file as numpy.save writes it",
        ),
        // The checksum, then method 12, which is bzip2.
        (
            with(&whole, [14, 16], b"crc!"),
            "array two\\nlines: the archive is damaged: Invalid checksum",
        ),
        (
            with(&whole, [8, 10], &[12]),
            "array two\\nlines: its compression, Bzip2, is not known here; save it with numpy.savez or \
             numpy.savez_compressed",
        ),
        // The length is that of the array, but more data follow.
        (
            with(&longer, [22, 24], &[128 + 8, 0]),
            "array a: File is larger than its declared uncompressed size",
        ),
        (
            with(&longer_stored, [22, 24], &[128 + 8, 0]),
            "array a: File is larger than its declared uncompressed size",
        ),
    ] {
        assert_eq!(read_zip(&zip, None).unwrap_err(), message);
    }
    for (bytes, message) in [
        (&b""[..], "the file is empty"),
        (b"counts", "not an .npz file as numpy.savez writes it"),
        (b"PK", "the archive is damaged or cut off"),
        (
            &whole[..whole.len() / 2],
            "the archive is damaged or cut off",
        ),
        (
            &whole[..whole.len() - 1],
            "the archive is damaged or cut off",
        ),
    ] {
        assert_eq!(read_zip(bytes, None).unwrap_err(), message);
    }
    let message = read_zip(&whole, Some("lines")).unwrap_err();
    assert_eq!(message, "no array \"lines\"; there is two\\nlines");
}
