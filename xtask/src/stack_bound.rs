//! The most stack a Cortex-M image can need, from its machine code.
//!
//! A function takes the sum of what its instructions take, and the most that any
//! function it goes to needs. Interrupts come on top. Three things have no such
//! bound and are an error: recursion, a stack pointer set in another way, and a
//! call of what is only known when the image runs. The report of a panic calls
//! through tables, so the bound ends at the panic handler. A compiled function ends
//! in a jump or a return; it never runs on into the next.

mod small;
mod thumb;

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::mem;
use std::ops::Range;
use std::path::Path;

use anyhow::{Context, Result, bail, ensure};
use object::{Object, ObjectSection, ObjectSymbol, SectionKind, SymbolKind};

use thumb::Effect;

/// Bytes the processor saves when an interrupt comes: 26 words with those of the
/// floating-point unit, and a word that keeps the stack aligned.
const EXCEPTION_FRAME: u32 = 27 * 4;
/// Entries of the vector table: those of the NMI and the hard fault, which
/// interrupt all others, come after the stack's start and Reset.
const NMI: usize = 2;
const HARD_FAULT: usize = 3;

/// Bytes of stack an image can need: the main loop, a handler of an interrupt on
/// it (all have the same priority), and on that the hard fault's and the NMI's. The hard
/// fault's may reset the stack pointer, as it may come from an overflow: it then needs its
/// own bytes from the start on.
///
/// # Errors
/// If the file is no such image, or a function in it has no bound.
pub fn of_image(path: &Path) -> Result<u64> {
    let bytes = fs::read(path).with_context(|| path.display().to_string())?;
    let file = object::File::parse(&*bytes)?;
    let table = file.section_by_name(".vector_table");
    let table = table.context("no vector table in the image")?;
    let (vectors, _) = table.data()?.as_chunks();
    let vectors = vectors.iter().map(|word| u32::from_le_bytes(*word));
    let mut needs = Needs {
        functions: functions(&file)?,
        known: BTreeMap::new(),
        under_way: Vec::new(),
    };
    needs.resolve_defmt_rtt();
    needs.resolve(&USB_DEVICE, &[USB_CLASS]);
    needs.resolve(&[PIXEL_ARRAY], &TOGETHER);
    let mut bound = 0;
    let mut handlers = 0;
    let mut nmi = 0;
    let mut anew = 0;
    for (index, vector) in vectors.enumerate().skip(1) {
        // Reserved entries are 0.
        if vector == 0 {
            continue;
        }
        let starts_anew = index == HARD_FAULT && needs.lets_start_anew(vector & !1);
        let need = needs.of(vector & !1)?;
        match index {
            1 => bound += need,
            NMI => nmi = EXCEPTION_FRAME + need,
            HARD_FAULT if starts_anew => {
                bound += EXCEPTION_FRAME;
                anew = need;
            }
            HARD_FAULT => bound += EXCEPTION_FRAME + need,
            _ => handlers = handlers.max(EXCEPTION_FRAME + need),
        }
    }
    Ok(((bound + handlers).max(anew) + nmi).into())
}

/// The function of an image that takes most stack for itself: its name and its bytes.
///
/// # Errors
/// If the file is no Cortex-M image, or a function sets the stack pointer.
pub fn largest_frame(path: &Path) -> Result<(String, u32)> {
    largest_frame_of(&fs::read(path).with_context(|| path.display().to_string())?)
}

fn largest_frame_of(image: &[u8]) -> Result<(String, u32)> {
    let functions = functions(&object::File::parse(image)?)?.into_values();
    let functions: Vec<Function> = functions.collect();
    if let Some(Function { name, .. }) = functions.iter().find(|one| one.sets_stack_pointer) {
        bail!("{name} sets the stack pointer");
    }
    let largest = functions.into_iter().max_by_key(|function| function.takes);
    let largest = largest.context("no function in the image")?;
    Ok((largest.name, largest.takes))
}

/// The functions of a defmt logger, in defmt-rtt, and how often each calls one
/// of the two that write. One call more may be of something else.
const DEFMT_RTT: [(&str, u32); 3] = [
    ("_defmt_acquire", 1),
    ("_defmt_release", 3),
    ("_defmt_write", 5),
];

/// In the names of the functions of usb-device that call its classes through a table; its
/// `poll` may be a part of the interrupt's handler. And in those of the functions of classes.
const USB_DEVICE: [&str; 2] = ["usb_device6device", "USBCTRL_IRQ"];
const USB_CLASS: &str = "UsbClass";

/// The same of an array of pixels, which calls the code of blocks and of neighbours through pointers.
const PIXEL_ARRAY: &str = "9dtof_core11pixel_array";
const TOGETHER: [&str; 2] = ["9dtof_core7binning", "9dtof_core10neighbours"];

/// A function, as far as the stack is concerned.
#[derive(Debug, Default)]
struct Function {
    name: String,
    takes: u32,
    goes_to: BTreeSet<u32>,
    /// The number of calls and jumps whose target is only known when it runs.
    goes_anywhere: u32,
    sets_stack_pointer: bool,
}

/// The stack that functions need, with all functions they go to.
struct Needs {
    functions: BTreeMap<u32, Function>,
    known: BTreeMap<u32, u32>,
    under_way: Vec<u32>,
}

impl Needs {
    /// The functions of [`DEFMT_RTT`] call one of two, by the channel's mode.
    fn resolve_defmt_rtt(&mut self) {
        let writes = |(_, function): &(&u32, &Function)| function.name.contains("blocking_write");
        let found = self.functions.iter().filter(writes);
        let writers: Vec<u32> = found.map(|(&address, _)| address).collect();
        if writers.is_empty() {
            return;
        }
        for function in self.functions.values_mut() {
            let is_it = |(name, _): &&(&str, u32)| *name == function.name;
            let calls = DEFMT_RTT.iter().find(is_it).map_or(0, |&(_, calls)| calls);
            if (1..=calls).contains(&function.goes_anywhere) {
                function.goes_anywhere = 0;
                function.goes_to.extend(&writers);
            }
        }
    }

    /// Functions with one of `callers` in their names may call through pointers all of those with one of `called` in
    /// theirs, if there are some.
    fn resolve(&mut self, callers: &[&str], called: &[&str]) {
        let has = |function: &Function, parts: &[&str]| {
            parts.iter().any(|part| function.name.contains(part))
        };
        let found = self.functions.iter();
        let found = found.filter(|(_, function)| has(function, called));
        let found: Vec<u32> = found.map(|(&address, _)| address).collect();
        if found.is_empty() {
            return;
        }
        for function in self.functions.values_mut() {
            if function.goes_anywhere > 0 && has(function, callers) {
                function.goes_anywhere = 0;
                function.goes_to.extend(&found);
            }
        }
    }

    /// Lets the function at `address` set the stack pointer. Gives whether it does.
    fn lets_start_anew(&mut self, address: u32) -> bool {
        let function = self.functions.get_mut(&address);
        function.is_some_and(|function| mem::take(&mut function.sets_stack_pointer))
    }

    /// The stack that the function at `address` needs.
    fn of(&mut self, address: u32) -> Result<u32> {
        if let Some(&known) = self.known.get(&address) {
            return Ok(known);
        }
        let function = self.functions.get(&address);
        let function = function.with_context(|| format!("no function at {address:#x}"))?;
        let name = function.name.clone();
        if name.contains("rust_begin_unwind") {
            return Ok(0);
        }
        ensure!(!self.under_way.contains(&address), "{name} calls itself");
        ensure!(
            function.goes_anywhere == 0,
            "{name} calls what is only known when it runs"
        );
        ensure!(
            !function.sets_stack_pointer,
            "{name} sets the stack pointer"
        );
        let takes = function.takes;
        self.under_way.push(address);
        let mut most = 0;
        for to in function.goes_to.clone() {
            most = most.max(self.of(to).with_context(|| format!("called by {name}"))?);
        }
        self.under_way.pop();
        self.known.insert(address, takes + most);
        Ok(takes + most)
    }
}

/// Every function of the image by its address.
fn functions(file: &object::File) -> Result<BTreeMap<u32, Function>> {
    // Some of assembly have no size: they reach to the next.
    let mut names: BTreeMap<u32, (&str, u32)> = BTreeMap::new();
    // Where machine code begins and ends among constants.
    let mut code = BTreeMap::new();
    for symbol in file.symbols() {
        let address = u32::try_from(symbol.address())?;
        match symbol.name()? {
            name if name.starts_with("$t") => _ = code.insert(address, true),
            name if name.starts_with("$d") => _ = code.insert(address, false),
            name if symbol.kind() == SymbolKind::Text => {
                let size = u32::try_from(symbol.size())?;
                let entry = names.entry(address & !1).or_insert((name, size));
                entry.1 = entry.1.max(size);
            }
            _ => {}
        }
    }
    let mut functions = BTreeMap::new();
    for section in file.sections() {
        if section.kind() != SectionKind::Text || section.name()? == ".vector_table" {
            continue;
        }
        let start = u32::try_from(section.address())?;
        let (halfwords, _) = section.data()?.as_chunks();
        let halfwords = halfwords.iter().map(|pair| u16::from_le_bytes(*pair));
        let halfwords: Vec<u16> = halfwords.collect();
        let end = start + 2 * u32::try_from(halfwords.len())?;
        for (&address, &(name, size)) in names.range(start..end) {
            let next = names.range(address + 1..end).next();
            let end = match size {
                0 => next.map_or(end, |(&next, _)| next),
                size => address + size,
            };
            let mut function = Function {
                name: name.to_owned(),
                ..Function::default()
            };
            let mut at = address;
            while at < end {
                let is_code = |at| code.range(..=at).next_back().is_none_or(|(_, &code)| code);
                let index = usize::try_from((at - start) / 2)?;
                let rest = halfwords.get(index..).unwrap_or_default();
                let jumps_by_table = || {
                    let table = small::table_of_jump(rest);
                    table.is_some_and(|bytes| code.get(&(at + bytes)) == Some(&false))
                };
                let (effect, bytes) = match rest {
                    [_, ..] if !is_code(at) => (Effect::None, 2),
                    &[first, second, ..] if thumb::is_wide(first) => {
                        (thumb::wide(at, first, second), 4)
                    }
                    &[first, ..] => {
                        let effect = match thumb::narrow(at, first) {
                            Effect::SetsStackPointer => small::frame(&halfwords, start, index),
                            Effect::GoesAnywhere if jumps_by_table() => Some(Effect::None),
                            effect => Some(effect),
                        };
                        (effect.unwrap_or(Effect::SetsStackPointer), 2)
                    }
                    [] => bail!("{name} reaches beyond its section"),
                };
                function.add(effect, address..end);
                at += bytes;
            }
            functions.insert(address, function);
        }
    }
    Ok(functions)
}

impl Function {
    /// One instruction more of a function whose addresses are `own`. A jump to its
    /// start counts as a call.
    fn add(&mut self, effect: Effect, own: Range<u32>) {
        match effect {
            Effect::None => {}
            Effect::Takes(bytes) => self.takes += bytes,
            Effect::GoesTo(to) if to != own.start && own.contains(&to) => {}
            Effect::GoesTo(to) => _ = self.goes_to.insert(to),
            Effect::GoesAnywhere => self.goes_anywhere += 1,
            Effect::SetsStackPointer => self.sets_stack_pointer = true,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The stack that the first of these functions needs. Each stands at its index with
    /// the bytes it takes and the functions it goes to. The last is the panic handler.
    fn need(functions: &[(u32, &[u32])], unbounded: Option<u32>) -> Result<u32> {
        let last = functions.len() - 1;
        let function = |(index, (takes, goes_to)): (usize, &(u32, &[u32]))| Function {
            name: ["function", "rust_begin_unwind"][usize::from(index == last)].to_owned(),
            takes: *takes,
            goes_to: goes_to.iter().copied().collect(),
            goes_anywhere: (unbounded == u32::try_from(index).ok()).into(),
            sets_stack_pointer: false,
        };
        let functions = functions.iter().enumerate().map(function);
        let mut needs = Needs {
            functions: (0..).zip(functions).collect(),
            known: BTreeMap::new(),
            under_way: Vec::new(),
        };
        needs.of(0)
    }

    #[test]
    fn adds_up_the_deepest_way() {
        let functions: [(u32, &[u32]); 5] =
            [(8, &[1, 2]), (100, &[3]), (50, &[3, 4]), (7, &[]), (0, &[])];
        assert_eq!(need(&functions, None).unwrap(), 115);
    }

    #[test]
    fn ends_at_the_panic_handler_and_only_there() {
        let functions: [(u32, &[u32]); 3] = [(8, &[1]), (4, &[2]), (1000, &[0])];
        assert_eq!(need(&functions, Some(2)).unwrap(), 12);
        assert!(need(&functions, Some(1)).is_err());
    }

    #[test]
    fn a_logger_is_excused_for_its_own_calls_alone() {
        for (name, calls, is_bounded) in [
            ("_defmt_acquire", 1, true),
            ("_defmt_acquire", 2, false),
            ("_defmt_write", 5, true),
            ("_defmt_timestamp", 1, false),
        ] {
            let function = |name: &str, takes, goes_anywhere| Function {
                name: name.to_owned(),
                takes,
                goes_anywhere,
                ..Function::default()
            };
            let writer = function("defmt_rtt::blocking_write", 10, 0);
            let mut needs = Needs {
                functions: [(0, function(name, 4, calls)), (2, writer)].into(),
                known: BTreeMap::new(),
                under_way: Vec::new(),
            };
            needs.resolve_defmt_rtt();
            assert_eq!(needs.of(0).ok(), is_bounded.then_some(14), "{name} {calls}");
        }
    }

    #[test]
    fn calls_through_pointers_go_to_functions_of_known_names() {
        let function = |name: &str, takes, goes_anywhere| Function {
            name: name.to_owned(),
            takes,
            goes_anywhere,
            ..Function::default()
        };
        let poll = "_ZN10usb_device6device9UsbDevice4poll";
        let look = "_ZN9dtof_core11pixel_array10PixelArray4look";
        let class = ["UsbClass4poll", "UsbClass10control_in"];
        let together = [
            "_ZN9dtof_core7binning15count_in_blocks",
            "_ZN9dtof_core10neighbours16end_laser_cycles",
        ];
        for (caller, called, need) in [
            (poll, class, Some(14)),
            (poll, ["other"; 2], None),
            (look, together, Some(14)),
            (look, class, None),
            ("main", together, None),
        ] {
            let [first, second] = called;
            let functions = [
                (0, function(caller, 4, 3)),
                (2, function(first, 6, 0)),
                (4, function(second, 10, 0)),
            ];
            let mut needs = Needs {
                functions: functions.into(),
                known: BTreeMap::new(),
                under_way: Vec::new(),
            };
            needs.resolve(&USB_DEVICE, &[USB_CLASS]);
            needs.resolve(&[PIXEL_ARRAY], &TOGETHER);
            assert_eq!(needs.of(0).ok(), need, "{caller}");
        }
    }

    #[test]
    fn a_handler_that_starts_the_stack_anew_has_a_bound_and_others_have_none() {
        let sets = |goes_to: &[u32]| Function {
            takes: 4,
            goes_to: goes_to.iter().copied().collect(),
            sets_stack_pointer: true,
            ..Function::default()
        };
        let mut needs = Needs {
            functions: [(0, sets(&[])), (2, sets(&[]))].into(),
            known: BTreeMap::new(),
            under_way: Vec::new(),
        };
        assert!(needs.lets_start_anew(0));
        assert_eq!(needs.of(0).unwrap(), 4);
        assert!(needs.of(2).is_err());
        // Repeated, or of a function that does not exist.
        assert!(!needs.lets_start_anew(0) && !needs.lets_start_anew(4));
    }

    /// An ELF file for Arm with these functions, one after the other, each a name and its code.
    fn image(functions: &[(&str, &[u16])]) -> Vec<u8> {
        let (mut code, mut symbols, mut names) = (vec![], vec![0; 16], b"\0.text\0".to_vec());
        let words = |words: &[usize]| -> Vec<u8> {
            let bytes = words.iter().map(|&word| u32::try_from(word).unwrap());
            bytes.flat_map(u32::to_le_bytes).collect()
        };
        for (name, halfwords) in functions {
            symbols.extend(words(&[names.len(), code.len(), 2 * halfwords.len()]));
            symbols.extend([2, 0, 1, 0]); // a function in section 1
            names.extend([name.as_bytes(), b"\0"].concat());
            code.extend(halfwords.iter().flat_map(|word| word.to_le_bytes()));
        }
        let [code_bytes, symbol_bytes, name_bytes] = [&code, &symbols, &names].map(Vec::len);
        let symbols_at = 52 + code_bytes;
        let names_at = symbols_at + symbol_bytes;
        let headers_at = names_at + name_bytes;
        let mut file = b"\x7fELF\x01\x01\x01\0\0\0\0\0\0\0\0\0\x02\0\x28\0".to_vec();
        // Four headers of 40 bytes; section 3 has the names.
        file.extend(words(&[1, 0, 0, headers_at, 0, 52, 40 << 16, 3 << 16 | 4]));
        file.extend([code, symbols, names].concat());
        for header in [
            [0; 10],
            [1, 1, 6, 0, 52, code_bytes, 0, 0, 2, 0],
            [0, 2, 0, 0, symbols_at, symbol_bytes, 3, 1, 4, 16],
            [0, 3, 0, 0, names_at, name_bytes, 0, 0, 1, 0],
        ] {
            file.extend(words(&header));
        }
        file
    }

    #[test]
    fn the_largest_frame_is_one_function_and_not_a_chain() {
        // push {r4, r6, r7, lr}; sub sp, #24; bl large; pop {r4, pc}
        let small: (_, &[u16]) = ("small", &[0xb5d0, 0xb086, 0xf000, 0xf801, 0xbd10]);
        // push {r4, r6, r7, lr}; sub.w sp, sp, #4800; pop {r4, pc}
        let large: (_, &[u16]) = ("large", &[0xb5d0, 0xf5ad, 0x5d96, 0xbd10]);
        for order in [[small, large], [large, small]] {
            let largest = largest_frame_of(&image(&order)).unwrap();
            assert_eq!(largest, ("large".to_owned(), 4816));
        }
        // mov sp, r4; bx lr
        let anew: (_, &[u16]) = ("anew", &[0x46a5, 0x4770]);
        let error = largest_frame_of(&image(&[large, anew])).unwrap_err();
        assert_eq!(error.to_string(), "anew sets the stack pointer");
        assert!(largest_frame_of(&image(&[])).is_err());
        assert!(largest_frame_of(b"text").is_err());
    }

    #[test]
    fn recursion_has_no_bound() {
        assert!(need(&[(8, &[1]), (4, &[0]), (0, &[])], None).is_err());
        assert!(need(&[(8, &[7]), (0, &[])], None).is_err());
    }
}
