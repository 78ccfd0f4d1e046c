//! Messages in Protobuf, as their format is described: without any schema.

/// A field of a message in Protobuf: its number, and its value as bytes or as a number.
#[derive(Clone, Debug, PartialEq)]
pub enum Field {
    Bytes(Vec<u8>),
    Number(u64),
}

impl Field {
    pub fn number(&self) -> u64 {
        match self {
            Self::Number(number) => *number,
            Self::Bytes(bytes) => panic!("{bytes:?}"),
        }
    }

    pub fn bytes(&self) -> &[u8] {
        match self {
            Self::Bytes(bytes) => bytes,
            Self::Number(number) => panic!("{number}"),
        }
    }

    pub fn text(&self) -> &str {
        std::str::from_utf8(self.bytes()).unwrap()
    }
}

/// The fields of a message in Protobuf, in order.
pub fn fields(bytes: &[u8]) -> Vec<(u64, Field)> {
    let mut rest = bytes;
    let varint = |rest: &mut &[u8]| {
        let mut value = 0;
        for shift in (0..64).step_by(7) {
            let byte = rest[0];
            *rest = &rest[1..];
            value |= u64::from(byte & 0x7f) << shift;
            if byte < 0x80 {
                return value;
            }
        }
        panic!("a number without end");
    };
    let mut fields = Vec::new();
    while !rest.is_empty() {
        let key = varint(&mut rest);
        let field = match key & 7 {
            0 => Field::Number(varint(&mut rest)),
            kind @ (1 | 2 | 5) => {
                let length = match kind {
                    1 => 8,
                    5 => 4,
                    _ => usize::try_from(varint(&mut rest)).unwrap(),
                };
                let (value, behind) = rest.split_at(length);
                rest = behind;
                if kind == 2 {
                    Field::Bytes(value.to_vec())
                } else {
                    let number = value.iter().rev();
                    Field::Number(number.fold(0, |number, &byte| number << 8 | u64::from(byte)))
                }
            }
            kind => panic!("kind {kind}"),
        };
        fields.push((key >> 3, field));
    }
    fields
}

/// The only field of this number.
#[track_caller]
pub fn field(bytes: &[u8], number: u64) -> Field {
    let all = fields(bytes);
    let mut found = all.iter().filter(|(of, _)| *of == number);
    let field = found.next().unwrap_or_else(|| panic!("no field {number}"));
    assert!(found.next().is_none());
    field.1.clone()
}
