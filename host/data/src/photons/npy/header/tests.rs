use std::io;

use super::*;
use proptest::prelude::*;

/// Of format 1.0, before so many bytes of data.
fn header(dictionary: &str, data: u64) -> Result<Header> {
    let length = u16::try_from(dictionary.len()).unwrap().to_le_bytes();
    let bytes = [b"\x93NUMPY\x01\x00", &length[..], dictionary.as_bytes()].concat();
    Header::read(&mut &bytes[..], bytes.len() as u64 + data)
}

/// Compares the whole message.
#[track_caller]
fn refused(text: &str, data: u64, message: &str) {
    let error = header(text, data).unwrap_err();
    assert_eq!(format!("{error:#}"), message, "{text}");
}

/// Headers as written by numpy.save of Python 2 and 3, and by hand.
#[test]
fn what_numpy_writes_is_read() {
    for (text, shape, fortran, data) in [
        (
            "{'descr': '<u2', 'fortran_order': False, 'shape': (3, 4), }    \n",
            vec![3, 4],
            false,
            24,
        ),
        (
            "{'descr': '|u1', 'fortran_order': True, 'shape': (5,), }\n",
            vec![5],
            true,
            5,
        ),
        (
            "{'descr': '>f8', 'fortran_order': False, 'shape': (), }\n",
            vec![],
            false,
            8,
        ),
        (
            "{'shape': (10L, 2L), 'fortran_order': False, 'descr': '<i4'}",
            vec![10, 2],
            false,
            80,
        ),
        (
            "{\"descr\":\"<u4\",\"shape\":[7],\"fortran_order\":False}",
            vec![7],
            false,
            28,
        ),
    ] {
        let found = header(text, data).unwrap();
        assert_eq!((&found.shape, found.fortran), (&shape, fortran), "{text}");
        assert!(matches!(found.elements, Elements::Plain(_)));
        for wrong in [data - 1, data + 1] {
            let error = header(text, wrong).unwrap_err().to_string();
            let end = format!(", but there are {wrong} bytes of data");
            assert!(error.ends_with(&end), "{text}: {error}");
        }
    }
    let text = "{'descr': [('pixel', '<u2'), ('', '|V2'), (('a title', 'it\\'s'), '<f4', (2, 3)), \
                ('n\\\\\\n', '>U3')], 'fortran_order': False, 'shape': (2,), }";
    let Elements::Records(fields) = header(text, 80).unwrap().elements else {
        panic!("no records");
    };
    let found = fields.iter().map(|field| {
        let element = field.element.as_ref().map(Element::to_string);
        (&field.name[..], field.bytes, &field.text[..], element)
    });
    let plain = |text: &str| Some(text.to_owned());
    let expected = [
        ("pixel", 2, "<u2", plain("<u2")),
        ("", 2, "|V2", plain("|V2")),
        ("it's", 24, "(('a title', 'it\\'s'), '<f4', (2, 3))", None),
        ("n\\\\n", 12, ">U3", plain(">U3")),
    ];
    assert!(found.eq(expected), "{fields:?}");
}

/// The length of the header has 16 bits in format 1, and 32 in 2 and 3. The text is Latin-1, but UTF-8 in 3.
#[test]
fn every_format_is_read_to_the_end_of_its_header() {
    let text = |name: &[u8]| {
        let [before, after] = [
            &b"{'descr': [('"[..],
            b"', '|u1')], 'fortran_order': False, 'shape': (3,), }\n",
        ];
        [before, name, after].concat()
    };
    let file = |version: u8, length: &[u8], text: &[u8]| {
        [b"\x93NUMPY", &[version, 0][..], length, text].concat()
    };
    let read = |file: &[u8], data: u64| {
        let header = Header::read(&mut &file[..], file.len() as u64 + data);
        header.map_err(|error| format!("{error:#}"))
    };
    let (latin, utf) = (text(b"\xfc"), text("ü".as_bytes()));
    let of = |text: &[u8]| u8::try_from(text.len()).unwrap();
    for file in [
        file(1, &[of(&latin), 0], &latin),
        file(2, &[of(&latin), 0, 0, 0], &latin),
        file(3, &[of(&utf), 0, 0, 0], &utf),
    ] {
        let Elements::Records(fields) = read(&file, 3).unwrap().elements else {
            panic!("no records");
        };
        assert_eq!((fields.len(), &fields[0].name[..]), (1, "ü"));
        // Wherever the file ends within its header.
        for end in 0..file.len() {
            let message = match end {
                0..10 => NOT_NPY.to_owned(),
                _ => format!("{NOT_NPY}: {CUT}"),
            };
            assert_eq!(read(&file[..end], 0).unwrap_err(), message);
        }
    }
    let long = "the header is longer than one of numbers can be";
    for (file, message) in [
        (
            file(3, &[of(&latin), 0, 0, 0], &latin),
            &format!("{NOT_NPY}: the header is not UTF-8")[..],
        ),
        (file(1, &[1, 16], &[b' '; 4097]), long),
        (file(2, &[of(&latin), 0, 1, 0], &latin), long),
        (
            file(1, &[0, 16], &[b' '; 4096]),
            &format!("{NOT_NPY}: a part of its header is missing"),
        ),
        (file(0, &[2, 0], b"{}"), &format!("{NOT_NPY}: version 0.0")),
        (
            file(4, &[2, 0, 0, 0], b"{}"),
            &format!("{NOT_NPY}: version 4.0"),
        ),
        (
            b"\x93NUMPY\x01\x01\x02\x00{}".to_vec(),
            &format!("{NOT_NPY}: version 1.1"),
        ),
        (b"\x93NUMPX\x01\x00\x02\x00{}".to_vec(), NOT_NPY),
    ] {
        assert_eq!(read(&file, 3).unwrap_err(), message);
    }
}

#[test]
fn what_is_no_header_is_refused() {
    for (text, reason) in [
        ("", "a part of its header is missing"),
        ("{", "a part of its header is missing"),
        ("{'descr': '<u2'}", "no fortran_order"),
        ("[1, 2]", "no fortran_order"),
        ("{'fortran_order': False}", "no shape"),
        ("{'fortran_order': False, 'shape': (3,)}", "no descr"),
        ("{'fortran_order': 0}", "fortran_order is 0"),
        (
            "{'fortran_order': False} more",
            "text follows the dictionary",
        ),
        ("{'fortran_order': False 'shape': (3,)}", "no }"),
        ("{'descr': '<u2, 'fortran_order': False}", "no }"),
        ("{'descr' '<u2'}", "no : after a key"),
        ("{'descr': '<u2", "a text does not end"),
        ("{'descr':\n '<u2'}", "a part of its header is missing"),
        ("{'fortran\n_order': False}", "a text does not end"),
    ] {
        refused(text, 6, &format!("{NOT_NPY}: {reason}"));
    }
    for (shape, reason) in [
        ("3", "the shape 3 is not lengths of axes"),
        ("(-3,)", "the shape (-3,) is not lengths of axes"),
        ("('3',)", "the shape ('3',) is not lengths of axes"),
        (
            "(18446744073709551616,)",
            "the shape (18446744073709551616,) is not lengths of axes",
        ),
        ("(3)", "parentheses without a comma"),
        ("(3,], 'a': 3", "a part of its header is missing"),
        ("(3,), 'shape': (3,)", "shape is there twice"),
    ] {
        let text = format!("{{'descr': '<u2', 'fortran_order': False, 'shape': {shape}}}");
        refused(&text, 6, &format!("{NOT_NPY}: {reason}"));
    }
    for (descr, reason) in [
        ("'<u2', \"descr\": '<u2'", "descr is there twice"),
        ("5", "no type 5"),
        ("('a', '<u2')", "no type ('a', '<u2')"),
        ("[5]", "not a field: 5"),
        ("[('a',)]", "not a field: ('a',)"),
        ("[['a', '<u2']]", "not a field: ['a', '<u2']"),
        ("[(1, '<u2')]", "not a field: (1, '<u2')"),
        ("[((), '<u2')]", "not a field: ((), '<u2')"),
        ("[('a', 5)]", "no type 5"),
        ("[('a', '<u2', 3)]", "the shape 3 is not lengths of axes"),
    ] {
        let text = format!("{{'fortran_order': False, 'shape': (3,), 'descr': {descr}}}");
        refused(&text, 6, &format!("{NOT_NPY}: {reason}"));
    }
    let plain = "the elements are not plain numbers";
    let objects =
        "the elements are Python objects: must be numbers; convert them, as with .astype(int)";
    for (descr, data, message) in [
        ("'|O'", 24, objects),
        ("'|O8'", 24, objects),
        ("[('a', '|O')]", 24, "records of no fixed size"),
        (
            "[('a', '|V9223372036854775808', (2,))]",
            0,
            "records of no fixed size",
        ),
        ("[('a', [('b', '<u2')])]", 6, plain),
        ("[[[[['<u4']]]]]", 6, plain),
    ] {
        let text = format!("{{'fortran_order': False, 'shape': (3,), 'descr': {descr}}}");
        refused(&text, data, message);
    }
    refused("((((((((((1))))))))))", 6, plain);
}

#[test]
fn types_are_those_of_numpy() {
    for kind in [
        "",
        "<",
        "u2",
        "=u2",
        "<u",
        "|u2",
        "|i4",
        "|f8",
        "|U2",
        "|S",
        "<u2[rubbish",
        "<u2[s]",
        "<M8[s",
        "<z4",
        "<u3",
        "<f3",
        "<u+2",
        "|O9",
        "<b2",
        "<c4",
        "<u2\\q",
    ] {
        let text = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': (3,)}}");
        refused(&text, 6, &format!("{NOT_NPY}: no type '{kind}'"));
    }
    for (kind, bytes) in [
        ("|u1", 1),
        ("<u1", 1),
        ("|b1", 1),
        ("<M8[ns]", 8),
        (">m8", 8),
        ("|S3", 3),
        ("|a1", 1),
        ("<U3", 12),
        ("<c8", 8),
        (">c16", 16),
        ("<f16", 16),
        ("|V0", 0),
    ] {
        let text = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': (5,)}}");
        let Elements::Plain(element) = header(&text, 5 * bytes).unwrap().elements else {
            panic!("{kind} has records");
        };
        assert_eq!(
            (&element.to_string()[..], element.bytes()),
            (kind, Some(bytes))
        );
    }
}

/// No product of lengths wraps around to the number of bytes that are there.
#[test]
fn a_shape_that_the_data_do_not_have_is_refused() {
    for (descr, shape, data) in [
        ("'<u4'", vec![3u64, 16], 128),
        ("'<u4'", vec![1, 16], 128),
        ("'<u8'", vec![1 << 32, 1 << 32], 0),
        ("'<u4'", vec![1 << 63, 16], 0),
        ("'<u4'", vec![(1 << 61) + 1, 8, 16], 512),
        ("'<U4611686018427387904'", vec![0], 0),
        (
            "[('a', '|V9223372036854775808'), ('b', '|V9223372036854775808')]",
            vec![2],
            0,
        ),
    ] {
        let text = format!("{{'descr': {descr}, 'fortran_order': False, 'shape': {shape:?}}}");
        let message = format!(
            "the header claims {shape:?} elements of {descr}, but there are {data} bytes of data"
        );
        refused(&text, data, &message);
    }
}

/// A file that fails.
struct Broken;

impl Read for Broken {
    fn read(&mut self, _: &mut [u8]) -> io::Result<usize> {
        Err(io::Error::other("the disk is gone"))
    }
}

#[test]
fn a_file_that_cannot_be_read_is_not_taken_for_another() {
    let text = "{'descr': '|u1', 'fortran_order': False, 'shape': (5,)}";
    let length = u8::try_from(text.len()).unwrap();
    let start = b"\x93NUMPY\x02\x00";
    let whole = [start, &[length, 0, 0, 0][..], text.as_bytes(), &[1, 2]].concat();
    let all = whole.len() as u64 + 3;
    let read = |file: &mut dyn Read| {
        let mut elements = 0;
        Array::read(file, all)?.elements(Ok, |some| elements += some.len())?;
        anyhow::Ok(elements)
    };
    for end in 0..=whole.len() {
        let error = read(&mut whole[..end].chain(Broken)).unwrap_err();
        assert_eq!(error.to_string(), "the disk is gone", "{end}");
    }
    assert_eq!(
        read(&mut &whole[..]).unwrap_err().to_string(),
        "the file became shorter while it was read"
    );
    assert_eq!(read(&mut whole.chain(&[3, 4, 5][..])).unwrap(), 5);
}

proptest! {
    #[test]
    fn no_text_is_a_panic(text in "\\PC{0,80}", start in "[{(\\['\"]{0,6}", data in 0..100u64) {
        let _ = header(&text, data);
        let _ = header(&(start + &text), data);
    }
}
