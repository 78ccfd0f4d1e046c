//! The header of an array (NumPy's `NEP 1`): a Python dictionary of type, order and shape. It is
//! checked against the length of the file before anything is allocated.

use std::io::{BufReader, Read};
use std::{fmt, iter};

use anyhow::{Context, Error, Result, anyhow, bail, ensure};

use crate::options::files::fill;

use crate::photons::axes::index_of;
use crate::photons::input::Input;

/// The most bytes of a header. Those of numbers and of records of numbers are shorter.
const MOST_BYTES: u64 = 4096;
/// How deep literals nest: the shape of a field, in a field, in a list of fields, in the
/// dictionary.
const DEEPEST: u32 = 4;

/// A header that agrees with the length of its file.
#[derive(Clone, Debug)]
pub struct Header {
    /// Lengths of the axes.
    pub shape: Vec<u64>,
    /// Whether the first axis changes fastest.
    pub fortran: bool,
    /// The type of the elements.
    pub elements: Elements,
}

/// The type of the elements of an array.
#[derive(Clone, Debug)]
pub enum Elements {
    /// A single type.
    Plain(Element),
    /// Records with fields.
    Records(Vec<Field>),
}

/// A field of a record.
#[derive(Clone, Debug)]
pub struct Field {
    /// Its name; empty for padding.
    pub name: String,
    /// Its type, if it is not an array.
    pub element: Option<Element>,
    /// Its type as written in the header.
    pub text: String,
    /// Its bytes.
    pub bytes: u64,
}

/// A type such as `<u2`: byte order, a letter for its kind, and its size.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Element {
    text: String,
    kind: char,
    size: u64,
    is_big_endian: bool,
}

/// An element.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Number {
    /// Of an integer type.
    Integer(i128),
    /// Of a float type.
    Float(f64),
}

impl Element {
    /// Returns `None` if NumPy has no such type.
    pub(super) fn parse(text: &str) -> Option<Self> {
        let mut letters = text.chars();
        let order = letters.next().filter(|order| "<>|".contains(*order))?;
        let kind = letters.next()?;
        // Times have a unit after the size.
        let (size, unit) = match letters.as_str().split_once('[') {
            Some((size, unit)) => (size, Some(unit)),
            None => (letters.as_str(), None),
        };
        let is_time = matches!(kind, 'm' | 'M');
        let has_unit = unit.is_some_and(|unit| unit.ends_with(']'));
        let is_number = size.chars().all(|digit| digit.is_ascii_digit());
        // Objects have no size.
        let size = if kind == 'O' && size.is_empty() {
            "0"
        } else {
            size
        };
        let size = size.parse().ok().filter(|_| is_number)?;
        let is_known = matches!(
            (kind, size),
            ('b', 1)
                | ('i' | 'u', 1 | 2 | 4 | 8)
                | ('f', 2 | 4 | 8 | 16)
                | ('c', 8 | 16 | 32)
                | ('m' | 'M', 8)
                | ('S' | 'a' | 'U' | 'V', _)
                | ('O', 0 | 8)
        );
        let has_no_order = matches!(kind, 'b' | 'S' | 'a' | 'V' | 'O') || size == 1;
        let is_type =
            is_known && (unit.is_none() || is_time && has_unit) && (order != '|' || has_no_order);
        is_type.then(|| Self {
            text: text.to_owned(),
            kind,
            size,
            is_big_endian: order == '>',
        })
    }

    /// The bytes of an element, if its size is fixed.
    fn bytes(&self) -> Option<u64> {
        match self.kind {
            'O' => None,
            'U' => self.size.checked_mul(4),
            _ => Some(self.size),
        }
    }

    /// The bytes of an integer type, and whether it is signed.
    #[must_use]
    pub fn integer(&self) -> Option<(u32, bool)> {
        let size = u32::try_from(self.size).ok()?;
        let is_integer = matches!((self.kind, size), ('u' | 'i', 1 | 2 | 4 | 8));
        is_integer.then_some((size, self.kind == 'i'))
    }

    /// The bytes of a float type of 16, 32 or 64 bits.
    #[must_use]
    pub fn float(&self) -> Option<u64> {
        matches!((self.kind, self.size), ('f', 2 | 4 | 8)).then_some(self.size)
    }

    /// Whether the highest byte comes first.
    #[must_use]
    pub const fn is_big_endian(&self) -> bool {
        self.is_big_endian
    }

    /// Gives the numbers in `bytes` to `take`, up to the first that it refuses. Returns `None` if the type is neither an
    /// integer nor a float. The bytes of a number may be reversed.
    fn numbers(
        &self,
        bytes: &mut [u8],
        take: impl FnMut(Number) -> Result<(), String>,
    ) -> Option<Result<(), String>> {
        use Number::{Float, Integer};
        if self.is_big_endian {
            let size = usize::try_from(self.size).ok()?.max(1);
            bytes.chunks_mut(size).for_each(<[u8]>::reverse);
        }
        Some(match (self.kind, self.size) {
            ('u', 1) => each(bytes, |b| Integer(u8::from_le_bytes(b).into()), take),
            ('u', 2) => each(bytes, |b| Integer(u16::from_le_bytes(b).into()), take),
            ('u', 4) => each(bytes, |b| Integer(u32::from_le_bytes(b).into()), take),
            ('u', 8) => each(bytes, |b| Integer(u64::from_le_bytes(b).into()), take),
            ('i', 1) => each(bytes, |b| Integer(i8::from_le_bytes(b).into()), take),
            ('i', 2) => each(bytes, |b| Integer(i16::from_le_bytes(b).into()), take),
            ('i', 4) => each(bytes, |b| Integer(i32::from_le_bytes(b).into()), take),
            ('i', 8) => each(bytes, |b| Integer(i64::from_le_bytes(b).into()), take),
            ('f', 2) => each(bytes, |b| Float(half(u16::from_le_bytes(b))), take),
            ('f', 4) => each(bytes, |b| Float(f32::from_le_bytes(b).into()), take),
            ('f', 8) => each(bytes, |b| Float(f64::from_le_bytes(b)), take),
            _ => return None,
        })
    }
}

/// Gives each number to `take`; its lowest byte comes first.
fn each<const N: usize>(
    bytes: &[u8],
    number: impl Fn([u8; N]) -> Number,
    take: impl FnMut(Number) -> Result<(), String>,
) -> Result<(), String> {
    let (numbers, _) = bytes.as_chunks();
    numbers.iter().copied().map(number).try_for_each(take)
}

/// The value of a float of 16 bits (IEEE 754 binary16).
fn half(bits: u16) -> f64 {
    let sign = if bits >> 15 == 1 { -1.0 } else { 1.0 };
    let (exponent, fraction) = (bits >> 10 & 0x1f, f64::from(bits & 0x3ff) / 1024.0);
    sign * match exponent {
        0 => fraction * 2f64.powi(-14),
        0x1f if fraction == 0.0 => f64::INFINITY,
        0x1f => f64::NAN,
        _ => (1.0 + fraction) * 2f64.powi(i32::from(exponent) - 15),
    }
}

impl fmt::Display for Element {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

impl Header {
    /// Reads the header of a file of `length` bytes. The data follow.
    ///
    /// # Errors
    /// Fails if it is not a header, or does not match the length of the file.
    pub fn read(file: &mut impl Read, length: u64) -> Result<Self> {
        let mut start = [0; 10];
        fill(file, &mut start, NOT_NPY)?;
        ensure!(start.starts_with(b"\x93NUMPY"), NOT_NPY);
        let version = start[6];
        ensure!(
            (1..=3).contains(&version) && start[7] == 0,
            not_npy(format!("version {version}.{}", start[7]))
        );
        let mut bytes = u64::from(u16::from_le_bytes([start[8], start[9]]));
        let mut before = start.len() as u64;
        if version > 1 {
            let mut high = [0; 2];
            fill(file, &mut high, &format!("{NOT_NPY}: {CUT}"))?;
            bytes |= u64::from(u16::from_le_bytes(high)) << 16;
            before += 2;
        }
        ensure!(
            bytes <= MOST_BYTES,
            "the header is longer than one of numbers can be"
        );
        let mut header = Vec::new();
        file.take(bytes).read_to_end(&mut header)?;
        ensure!(header.len() as u64 == bytes, not_npy(CUT));
        let text = match version {
            3 => String::from_utf8(header).map_err(|_| not_npy("the header is not UTF-8"))?,
            // Latin-1.
            _ => header.into_iter().map(char::from).collect(),
        };
        let dictionary = Literals::only(text.trim_end())?;
        let (header, each) = Self::from_dictionary(&dictionary)?;
        let is_object = matches!(&header.elements, Elements::Plain(element) if element.kind == 'O');
        ensure!(
            !is_object,
            "the elements are Python objects: must be numbers; convert them, as with .astype(int)"
        );
        let data = length.saturating_sub(before + bytes);
        let shape = &header.shape;
        let mut axes = shape.iter();
        let count = axes.try_fold(1u64, |all, &axis| all.checked_mul(axis));
        let claimed = count.zip(each);
        let claimed = claimed.and_then(|(count, each)| count.checked_mul(each));
        ensure!(
            claimed == Some(data),
            "the header claims {shape:?} elements of {}, but there are {data} bytes of data",
            dictionary.get("descr").map_or("", |descr| descr.text)
        );
        Ok(header)
    }

    /// The header of a dictionary, and the bytes of an element.
    fn from_dictionary(dictionary: &Literal) -> Result<(Self, Option<u64>)> {
        let of = |key: &str| {
            ensure!(
                dictionary.all(key).count() <= 1,
                not_npy(format!("{key} is there twice"))
            );
            let found = dictionary.get(key);
            found.ok_or_else(|| not_npy(format!("no {key}")))
        };
        let order = of("fortran_order")?;
        let fortran = match order.value {
            Value::Name("True") => true,
            Value::Name("False") => false,
            _ => bail!(not_npy(format!("fortran_order is {}", order.text))),
        };
        let shape = of("shape")?.lengths()?;
        let descr = of("descr")?;
        let (elements, bytes) = match &descr.value {
            Value::Text(_) => {
                let element = descr.element()?;
                let bytes = element.bytes();
                (Elements::Plain(element), bytes)
            }
            Value::List(fields) => {
                let fields = fields
                    .iter()
                    .map(Field::from_tuple)
                    .collect::<Result<Vec<_>>>()?;
                let mut sizes = fields.iter().map(|field| field.bytes);
                let bytes = sizes.try_fold(0u64, u64::checked_add);
                (Elements::Records(fields), bytes)
            }
            _ => bail!(not_npy(format!("no type {}", descr.text))),
        };
        let header = Self {
            shape,
            fortran,
            elements,
        };
        Ok((header, bytes))
    }
}

/// The file is of another format.
const NOT_NPY: &str = "not an .npy file as numpy.save writes it";
/// The file is shorter than its header.
const CUT: &str = "the file ends within its header";

/// The error of a file that is not in NumPy's format.
fn not_npy(reason: impl fmt::Display) -> Error {
    anyhow!("{NOT_NPY}: {reason}")
}

impl Field {
    /// Reads a tuple of name, type and, for an array, the lengths of its axes.
    fn from_tuple(tuple: &Literal) -> Result<Self> {
        let wrong = || not_npy(format!("not a field: {}", tuple.text));
        let Value::Tuple(parts) = &tuple.value else {
            bail!(wrong());
        };
        let (name, kind, axes) = match &parts[..] {
            [name, kind] => (name, kind, Vec::new()),
            [name, kind, axes] => (name, kind, axes.lengths()?),
            _ => bail!(wrong()),
        };
        ensure!(
            !matches!(kind.value, Value::List(_)),
            "the elements are not plain numbers"
        );
        // A field may have a title before its name.
        let name = match &name.value {
            Value::Tuple(names) => names.last().map(|name| &name.value),
            value => Some(value),
        };
        let Some(Value::Text(name)) = name else {
            bail!(wrong());
        };
        let element = kind.element()?;
        let mut sides = axes.iter();
        let bytes = element.bytes();
        let bytes =
            bytes.and_then(|bytes| sides.try_fold(bytes, |all, &side| all.checked_mul(side)));
        Ok(Self {
            name: name.clone(),
            bytes: bytes.context("records of no fixed size")?,
            text: match axes.is_empty() {
                true => element.to_string(),
                false => tuple.text.to_owned(),
            },
            element: axes.is_empty().then_some(element),
        })
    }
}

/// A Python literal and its source text.
struct Literal<'a> {
    value: Value<'a>,
    text: &'a str,
}

enum Value<'a> {
    Text(String),
    Number(u64),
    /// `True`, `False`.
    Name(&'a str),
    Tuple(Vec<Literal<'a>>),
    List(Vec<Literal<'a>>),
    Dictionary(Vec<(Literal<'a>, Literal<'a>)>),
}

impl<'a> Literal<'a> {
    /// The values of a key.
    fn all(&self, key: &str) -> impl Iterator<Item = &Self> {
        let entries = match &self.value {
            Value::Dictionary(entries) => &entries[..],
            _ => &[],
        };
        let is_key = move |name: &Self| matches!(&name.value, Value::Text(text) if text == key);
        let entries = entries.iter().filter(move |(name, _)| is_key(name));
        entries.map(|(_, value)| value)
    }

    fn get(&self, key: &str) -> Option<&Self> {
        self.all(key).next()
    }

    /// Lengths of axes.
    fn lengths(&self) -> Result<Vec<u64>> {
        let wrong = || not_npy(format!("the shape {} is not lengths of axes", self.text));
        let (Value::Tuple(lengths) | Value::List(lengths)) = &self.value else {
            bail!(wrong());
        };
        let lengths = lengths.iter().map(|length| match length.value {
            Value::Number(length) => Ok(length),
            _ => Err(wrong()),
        });
        lengths.collect()
    }

    /// A plain type.
    fn element(&self) -> Result<Element> {
        let element = match &self.value {
            Value::Text(text) => Element::parse(text),
            _ => None,
        };
        element.ok_or_else(|| not_npy(format!("no type {}", self.text)))
    }
}

/// Fills `bytes`. The file had them when it was opened.
pub(super) fn read_all(file: &mut impl Read, bytes: &mut [u8]) -> Result<()> {
    fill(file, bytes, "the file became shorter while it was read")
}

/// A parser of literals.
struct Literals<'a> {
    text: &'a str,
    at: usize,
    depth: u32,
}

impl<'a> Literals<'a> {
    /// Parses `text`, which must be one literal.
    fn only(text: &'a str) -> Result<Literal<'a>> {
        let mut literals = Self {
            text,
            at: 0,
            depth: 0,
        };
        let literal = literals.next()?;
        ensure!(
            literals.rest().is_empty(),
            not_npy("text follows the dictionary")
        );
        Ok(literal)
    }

    fn rest(&self) -> &'a str {
        &self.text[self.at..]
    }

    fn skip_blanks(&mut self) {
        self.at += self.rest().len() - self.rest().trim_start_matches([' ', '\t']).len();
    }

    /// Skips blanks, and then `mark` if it comes next. Returns whether it did.
    fn skips(&mut self, mark: char) -> bool {
        self.skip_blanks();
        let is_there = self.rest().starts_with(mark);
        self.at += if is_there { mark.len_utf8() } else { 0 };
        is_there
    }

    fn next(&mut self) -> Result<Literal<'a>> {
        ensure!(self.depth <= DEEPEST, "the elements are not plain numbers");
        self.skip_blanks();
        let begin = self.at;
        let value = match self.rest().chars().next() {
            Some(quote @ ('\'' | '"')) => Value::Text(self.quoted(quote)?),
            Some('(') => {
                let (parts, has_comma) = self.until(')', Self::next)?;
                ensure!(
                    has_comma || parts.is_empty(),
                    not_npy("parentheses without a comma")
                );
                Value::Tuple(parts)
            }
            Some('[') => Value::List(self.until(']', Self::next)?.0),
            Some('{') => {
                let entries = self.until('}', |literals| {
                    let key = literals.next()?;
                    ensure!(literals.skips(':'), not_npy("no : after a key"));
                    Ok((key, literals.next()?))
                });
                Value::Dictionary(entries?.0)
            }
            _ => {
                // A negative number is no length, but the error names it.
                let is_part = |letter: char| letter.is_ascii_alphanumeric() || letter == '-';
                let word = self.rest().split(|letter| !is_part(letter)).next();
                let word = word.filter(|word| !word.is_empty());
                let word = word.ok_or_else(|| not_npy("a part of its header is missing"))?;
                self.at += word.len();
                // Python 2 wrote long integers with an L.
                match word.strip_suffix('L').unwrap_or(word).parse() {
                    Ok(number) => Value::Number(number),
                    Err(_) => Value::Name(word),
                }
            }
        };
        let text = &self.text[begin..self.at];
        Ok(Literal { value, text })
    }

    /// Parses a quoted text.
    fn quoted(&mut self, quote: char) -> Result<String> {
        let mut text = String::new();
        let mut letters = self.rest().chars();
        letters.next();
        loop {
            let letter = letters.next();
            let letter = letter.filter(|letter| !letter.is_control());
            match letter.ok_or_else(|| not_npy("a text does not end"))? {
                // No field that is read has an escape: others than of a quote stay as they are.
                '\\' => match letters.next() {
                    Some(letter @ ('\\' | '\'' | '"')) => text.push(letter),
                    other => text.extend(iter::once('\\').chain(other)),
                },
                letter if letter == quote => break,
                letter => text.push(letter),
            }
        }
        self.at = self.text.len() - letters.as_str().len();
        Ok(text)
    }

    /// Parses elements with `each`, separated by commas, up to the bracket `end`. Also returns
    /// whether there was a comma.
    fn until<T>(
        &mut self,
        end: char,
        mut each: impl FnMut(&mut Self) -> Result<T>,
    ) -> Result<(Vec<T>, bool)> {
        self.at += 1;
        self.depth += 1;
        let (mut all, mut has_comma) = (Vec::new(), false);
        while !self.skips(end) {
            all.push(each(self)?);
            if !self.skips(',') {
                ensure!(self.skips(end), not_npy(format!("no {end}")));
                break;
            }
            has_comma = true;
        }
        self.depth -= 1;
        Ok((all, has_comma))
    }
}

/// An array whose header has been read, and whose elements follow.
pub struct Array<R: Read> {
    /// The header.
    pub header: Header,
    /// The elements.
    file: R,
}

/// Elements that are converted at a time.
const AT_ONCE: usize = 1 << 13;

impl<R: Read> Array<R> {
    /// Reads the header of a file of `length` bytes.
    ///
    /// # Errors
    /// Those of [`Header::read`].
    pub fn read(mut file: R, length: u64) -> Result<Self> {
        let header = Header::read(&mut file, length)?;
        Ok(Self { header, file })
    }

    /// The type of the elements.
    ///
    /// # Errors
    /// Fails if they are records.
    pub fn element(&self) -> Result<&Element> {
        match &self.header.elements {
            Elements::Plain(element) => Ok(element),
            Elements::Records(_) => bail!("elements are records, not numbers"),
        }
    }

    /// Gives `take` all elements as `convert` makes them, some at a time, in the order of the file.
    ///
    /// # Errors
    /// Fails if the elements are neither integers nor floats of 16, 32 or 64 bits, if the file ends too early, or with what
    /// `convert` says of an element, after its index.
    pub fn elements<T>(
        mut self,
        convert: impl Fn(Number) -> Result<T, String>,
        mut take: impl FnMut(&[T]),
    ) -> Result<()> {
        let element = self.element()?.clone();
        let size = usize::try_from(element.bytes().unwrap_or_default())?;
        let Header { shape, fortran, .. } = &self.header;
        let all = usize::try_from(shape.iter().product::<u64>())?;
        // The size in an archive may be wrong, so memory grows only with what is read.
        let (mut bytes, mut converted, mut done) = (Vec::new(), Vec::new(), 0);
        while done < all {
            bytes.resize(size * AT_ONCE.min(all - done), 0);
            read_all(&mut self.file, &mut bytes)?;
            converted.clear();
            let result = element.numbers(&mut bytes, |number| {
                converted.push(convert(number)?);
                Ok(())
            });
            let result = result.context("the elements are not plain numbers")?;
            result.map_err(|why| {
                let place = done + converted.len();
                anyhow!("element {} is {why}", index_of(place, shape, *fortran))
            })?;
            take(&converted);
            done += converted.len();
        }
        Ok(())
    }
}

impl Array<BufReader<Box<dyn Read>>> {
    /// Opens an `.npy` file, or an array in memory.
    ///
    /// # Errors
    /// Fails if it cannot be opened, and with those of [`Header::read`].
    pub fn open(input: &Input) -> Result<Self> {
        let (file, length) = input.open()?;
        Self::read(BufReader::new(file), length)
    }
}

#[cfg(test)]
mod tests;
