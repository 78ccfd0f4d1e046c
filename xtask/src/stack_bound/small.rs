//! What a Cortex-M0 or M0+ needs several instructions for: large frames, and jumps by a
//! table. As LLVM makes them; all else stays without a bound. Encodings: Armv6-M
//! Architecture Reference Manual (DDI 0419), A6.7.

use super::thumb::Effect;

/// The effect of an instruction that sets the stack pointer, by those around it: `code` are
/// the halfwords from address `start` on, `index` is that of the instruction.
///
/// - `ldr rX, =N; add sp, rX` makes a frame, or gives it back.
/// - `subs rX, r7, #; mov sp, rX; pop {…, pc}` gives all back, by the frame pointer r7;
///   two subtractions if the number is large.
pub fn frame(code: &[u16], start: u32, index: usize) -> Option<Effect> {
    let before = |steps: usize| code.get(index.checked_sub(steps)?).copied();
    let instruction = *code.get(index)?;
    let register = instruction >> 3 & 0xf;
    match instruction & 0xff87 {
        // ADD SP, rX
        0x4485 => {
            let load = before(1)?;
            (load >> 8 == 0x48 | register).then_some(())?;
            let address = start + 2 * u32::try_from(index - 1).ok()?;
            let literal = (address & !3) + 4 + 4 * u32::from(load & 0xff);
            let place = usize::try_from(literal.checked_sub(start)? / 2).ok()?;
            let [low, high] = [*code.get(place)?, *code.get(place + 1)?];
            let bytes = u32::from(high) << 16 | u32::from(low);
            Some(match i32::try_from(bytes) {
                Ok(_) => Effect::None,
                Err(_) => Effect::Takes(bytes.wrapping_neg()),
            })
        }
        // MOV SP, rX
        0x4685 => {
            // POP with the PC
            (*code.get(index + 1)? >> 8 == 0xbd).then_some(())?;
            // SUBS rX, r7, #3 bits
            let is_first = |code: u16| code & 0xfe3f == 0x1e38 | register;
            // SUBS rX, #8 bits
            let is_second = |code: u16| code >> 8 == 0x38 | register;
            let last = before(1)?;
            let given_back = is_first(last) || is_second(last) && is_first(before(2)?);
            given_back.then_some(Effect::None)
        }
        _ => None,
    }
}

/// How many bytes behind itself the first of these instructions, `add pc, rX` or `mov pc, rX`, has its
/// table, if one stands there: constants then make it a jump within the function. An instruction
/// that does nothing may align the table.
pub fn table_of_jump(code: &[u16]) -> Option<u32> {
    const NOP: u16 = 0x46c0;
    match code {
        [jump, next, ..] if matches!(jump & 0xff87, 0x4487 | 0x4687) => {
            Some(if *next == NOP { 4 } else { 2 })
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_by_a_constant_are_as_large_as_it_says() {
        // push {r4-r7, lr}; ldr r6, [pc, #4]; add sp, r6; nop; nop; nop; the constant
        let code = |constant: i32, load: u16| {
            let [a, b, c, d] = i32::to_le_bytes(constant);
            let [low, high] = [[a, b], [c, d]].map(u16::from_le_bytes);
            [0xb5f0, load, 0x44b5, 0xbf00, 0xbf00, 0xbf00, low, high]
        };
        let frame = |constant, load| frame(&code(constant, load), 0x1000_0000, 2);
        assert_eq!(frame(-1368, 0x4e02), Some(Effect::Takes(1368)));
        assert_eq!(frame(1368, 0x4e02), Some(Effect::None));
        // Another register; a constant beyond the code.
        assert_eq!(frame(-1368, 0x4d02), None);
        assert_eq!(frame(-1368, 0x4e03), None);
    }

    #[test]
    fn a_frame_pointer_gives_back_before_a_return_only() {
        // subs r6, r7, #7; subs r6, #5; mov sp, r6; pop {r4-r7, pc}
        let code = [0x1ffe, 0x3e05, 0x46b5, 0xbdf0];
        assert_eq!(frame(&code, 0, 2), Some(Effect::None));
        assert_eq!(frame(&code[1..], 0, 1), None);
        assert_eq!(frame(&[0x1ffe, 0x46b5, 0xbdf0], 0, 1), Some(Effect::None));
        assert_eq!(frame(&[0x1ffe, 0x3e05, 0x46b5, 0xbf00], 0, 2), None);
        // Of another register: subs r6, r5, #7.
        assert_eq!(frame(&[0x1fee, 0x3e05, 0x46b5, 0xbdf0], 0, 2), None);
    }

    #[test]
    fn a_table_stands_behind_a_jump_or_is_aligned() {
        for jump in [0x4487, 0x4497, 0x4687] {
            assert_eq!(table_of_jump(&[jump, 5]), Some(2));
            assert_eq!(table_of_jump(&[jump, 0x46c0, 5]), Some(4));
            assert_eq!(table_of_jump(&[jump]), None);
        }
        // bx lr, blx r3, add sp, r6
        for other in [0x4770, 0x4798, 0x44b5] {
            assert_eq!(table_of_jump(&[other, 5]), None);
        }
    }
}
