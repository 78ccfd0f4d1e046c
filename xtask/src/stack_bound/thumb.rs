//! Thumb-2 machine code, as far as the stack is concerned: what an instruction
//! takes of it and where it goes. Encodings: Armv7-M Architecture Reference
//! Manual (DDI 0403), A5 and A7.7.

/// The effect of an instruction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Effect {
    /// Nothing of interest; gives back some of the stack; returns.
    None,
    /// Takes this many bytes of the stack.
    Takes(u32),
    /// Goes to the instruction at this address, for good or to come back.
    GoesTo(u32),
    /// Jumps to an address from a register or from memory, other than back to the caller.
    GoesAnywhere,
    /// Sets the stack pointer in another way.
    SetsStackPointer,
}

/// Whether the instruction that begins with this halfword has a second one.
pub fn is_wide(first: u16) -> bool {
    first >> 11 >= 0b11101
}

/// The effect of an instruction of one halfword at `address`.
pub fn narrow(address: u32, code: u16) -> Effect {
    let destination = (code >> 4 & 8) | (code & 7);
    let to = |halfwords: u32, bits: u32| Effect::GoesTo(target(address, halfwords << 1, bits + 1));
    match code {
        // PUSH
        _ if code & 0xfe00 == 0xb400 => Effect::Takes(4 * (code & 0x1ff).count_ones()),
        // SUB SP, SP, #
        _ if code & 0xff80 == 0xb080 => Effect::Takes(4 * u32::from(code & 0x7f)),
        // ADD, MOV of any register
        _ if code & 0xff00 == 0x4400 || code & 0xff00 == 0x4600 => match destination {
            13 => Effect::SetsStackPointer,
            15 => Effect::GoesAnywhere,
            _ => Effect::None,
        },
        // BX, BLX
        _ if code & 0xff00 == 0x4700 && code & 0xf8 != 0x70 => Effect::GoesAnywhere,
        // B with a condition, which is neither UDF nor SVC
        _ if code & 0xf000 == 0xd000 && code & 0x0e00 != 0x0e00 => to((code & 0xff).into(), 8),
        // B
        _ if code & 0xf800 == 0xe000 => to((code & 0x7ff).into(), 11),
        _ => Effect::None,
    }
}

/// The effect of an instruction of two halfwords at `address`.
pub fn wide(address: u32, first: u16, second: u16) -> Effect {
    let base = first & 0xf;
    let byte = u32::from(second & 0xff);
    match first >> 9 {
        // LDM, STM; LDRD, STRD, TBB, TBH
        0b111_0100 if first & 0x40 == 0 => multiple(first, second),
        0b111_0100 if first & 0xef == 0x6d => Effect::Takes(4 * byte),
        // A shifted register
        0b111_0101 if second >> 8 & 0xf == 13 => Effect::SetsStackPointer,
        // VPUSH, and whatever else counts the stack pointer down
        0b111_0110 if first & 0xaf == 0x2d => Effect::Takes(4 * byte),
        // A constant; branches
        0b111_1000..=0b111_1011 if second & 0x8000 == 0 => constant(first, second),
        0b111_1000..=0b111_1011 => branch(address, first, second),
        // LDR and STR of one register
        0b111_1100 => {
            let loads_word = first & 0x70 == 0x50;
            match second >> 12 {
                13 if loads_word => Effect::SetsStackPointer,
                // Other than POP, which is a return.
                15 if first == 0xf85d && second & 0xfff == 0xb04 => Effect::None,
                15 if loads_word => Effect::GoesAnywhere,
                _ if base == 13 && first & 0x80 == 0 && second & 0xb00 == 0x900 => {
                    Effect::Takes(byte)
                }
                _ => Effect::None,
            }
        }
        _ => Effect::None,
    }
}

fn multiple(first: u16, second: u16) -> Effect {
    let (base, writes_back, loads) = (first & 0xf, first & 0x20 != 0, first & 0x10 != 0);
    let counts_down = first & 0x180 == 0x100;
    match (base, loads) {
        (13, false) if writes_back && counts_down => Effect::Takes(4 * second.count_ones()),
        (13, true) if writes_back && !counts_down => Effect::None,
        (13, _) if writes_back => Effect::SetsStackPointer,
        (_, true) if second & 0x8000 != 0 && base != 13 => Effect::GoesAnywhere,
        _ => Effect::None,
    }
}

/// Data processing with a constant.
fn constant(first: u16, second: u16) -> Effect {
    if second >> 8 & 0xf != 13 {
        return Effect::None;
    }
    let high = u32::from(first >> 10 & 1) << 11 | u32::from(second >> 12 & 7) << 8;
    let bits = high | u32::from(second & 0xff);
    match first & 0xfbff {
        0xf1ad | 0xf1bd => Effect::Takes(expand(bits)),
        0xf2ad => Effect::Takes(bits),
        // ADD gives back.
        0xf10d | 0xf11d | 0xf20d => Effect::None,
        _ => Effect::SetsStackPointer,
    }
}

/// `ThumbExpandImm`.
fn expand(bits: u32) -> u32 {
    let byte = bits & 0xff;
    match bits >> 8 {
        0 => byte,
        1 => byte << 16 | byte,
        2 => byte << 24 | byte << 8,
        3 => byte * 0x0101_0101,
        _ => (0x80 | byte & 0x7f).rotate_right(bits >> 7),
    }
}

/// Branches, and what shares their place.
fn branch(address: u32, first: u16, second: u16) -> Effect {
    let (first, second) = (u32::from(first), u32::from(second));
    let sign = first >> 10 & 1;
    let (j1, j2) = (second >> 13 & 1, second >> 11 & 1);
    if second & 0x1000 != 0 {
        // B, BL
        let (i1, i2) = (1 ^ j1 ^ sign, 1 ^ j2 ^ sign);
        let offset = sign << 24 | i1 << 23 | i2 << 22 | (first & 0x3ff) << 12;
        return Effect::GoesTo(target(address, offset | (second & 0x7ff) << 1, 25));
    }
    if second & 0x4000 == 0 && first & 0x380 != 0x380 {
        // B with a condition
        let offset = sign << 20 | j2 << 19 | j1 << 18 | (first & 0x3f) << 12;
        return Effect::GoesTo(target(address, offset | (second & 0x7ff) << 1, 21));
    }
    // MSR of MSP, PSP or CONTROL, which chooses one of the two
    if first & 0xfff0 == 0xf380 && matches!(second & 0xff, 8 | 9 | 20) {
        return Effect::SetsStackPointer;
    }
    Effect::None
}

/// `offset`, a signed number of so many bits, from what reads as the address of
/// the instruction.
fn target(address: u32, offset: u32, bits: u32) -> u32 {
    let unused = 32 - bits;
    let offset = (offset << unused).cast_signed() >> unused;
    address.wrapping_add(4).wrapping_add_signed(offset)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn takes_of_the_stack() {
        assert_eq!(narrow(0, 0xb5d0), Effect::Takes(16)); // push {r4, r6, r7, lr}
        assert_eq!(narrow(0, 0xb086), Effect::Takes(24)); // sub sp, #24
        for (first, second, bytes) in [
            (0xe92d, 0x0b10, 16),   // push.w {r4, r8, r9, r11}
            (0xf84d, 0xbd04, 4),    // str r11, [sp, #-4]!
            (0xf5ad, 0x5d96, 4800), // sub.w sp, sp, #4800
            (0xf6ad, 0x7dff, 4095), // subw sp, sp, #4095
            (0xe96d, 0x4504, 16),   // strd r4, r5, [sp, #-16]!
            (0xed2d, 0x8b06, 24),   // vpush {d8, d9, d10}
        ] {
            assert!(is_wide(first));
            assert_eq!(wide(0, first, second), Effect::Takes(bytes), "{first:x}");
        }
    }

    #[test]
    fn gives_back_or_touches_no_stack() {
        // mov r7, sp; pop {r4, pc}; bx lr; udf #0; add sp, #24
        for code in [0x466f, 0xbd10, 0x4770, 0xde00, 0xb006] {
            assert!(!is_wide(code));
            assert_eq!(narrow(0, code), Effect::None, "{code:x}");
        }
        for (first, second) in [
            (0xf1ad, 0x0420), // sub.w r4, sp, #32
            (0xf50d, 0x5d96), // add.w sp, sp, #4800
            (0xe9cd, 0x4504), // strd r4, r5, [sp, #16]
            (0xf841, 0x4d04), // str r4, [r1, #-4]!
            (0xe8bd, 0x8110), // pop.w {r4, r8, pc}
            (0xf85d, 0xfb04), // ldr pc, [sp], #4
            (0xe8df, 0xf001), // tbb [pc, r1]
            (0xf3ef, 0x8008), // mrs r0, msp
            (0xecbd, 0x8b02), // vpop {d8}
        ] {
            assert_eq!(wide(0, first, second), Effect::None, "{first:x}");
        }
    }

    #[test]
    fn goes_to_an_address() {
        // b, beq
        assert_eq!(narrow(0x100, 0xe7fe), Effect::GoesTo(0x100));
        assert_eq!(narrow(0x104, 0xd0fc), Effect::GoesTo(0x100));
        for (address, first, second, to) in [
            (0x106, 0xf7ff, 0xfffb, 0x100), // bl
            (0x10a, 0xf7ff, 0xbff9, 0x100), // b.w
            (0x10e, 0xf47f, 0xaff7, 0x100), // bne.w
            (0x112, 0xf000, 0xfde0, 0xcd6), // bl
            (0x116, 0xf040, 0x85de, 0xcd6), // bne.w
            (0x11a, 0xf000, 0xbddc, 0xcd6), // b.w
        ] {
            assert_eq!(wide(address, first, second), Effect::GoesTo(to));
        }
    }

    #[test]
    fn what_has_no_bound_is_seen() {
        // mov pc, r4; bx r12; blx r2
        for code in [0x46a7, 0x4760, 0x4790] {
            assert_eq!(narrow(0, code), Effect::GoesAnywhere);
        }
        assert_eq!(wide(0, 0xf8d0, 0xf004), Effect::GoesAnywhere); // ldr.w pc, [r0, #4]
        assert_eq!(wide(0, 0xf8dd, 0xf004), Effect::GoesAnywhere); // ldr.w pc, [sp, #4]
        assert_eq!(wide(0, 0xf85d, 0xfd04), Effect::GoesAnywhere); // ldr pc, [sp, #-4]!
        assert_eq!(wide(0, 0xf85d, 0xf021), Effect::GoesAnywhere); // ldr.w pc, [sp, r1, lsl #2]
        assert_eq!(narrow(0, 0x46a5), Effect::SetsStackPointer); // mov sp, r4
        assert_eq!(wide(0, 0xea4f, 0x0d04), Effect::SetsStackPointer); // mov.w sp, r4
        assert_eq!(wide(0, 0xf380, 0x8808), Effect::SetsStackPointer); // msr msp, r0
        assert_eq!(wide(0, 0xf380, 0x8814), Effect::SetsStackPointer); // msr control, r0
    }

    #[test]
    fn expands_constants() {
        for (bits, value) in [
            (0x0ab, 0xab),
            (0x1ab, 0x00ab_00ab),
            (0x2ab, 0xab00_ab00),
            (0x3ab, 0xabab_abab),
            (0x4ab, 0x5580_0000),
            (0xf7f, 0x3fc),
        ] {
            assert_eq!(expand(bits), value, "{bits:x}");
        }
    }
}
