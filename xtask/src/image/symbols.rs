//! Finds panics, floating point and allocation by the names of symbols.

/// A line for each of `names` that an image must not have.
pub fn problems<S: AsRef<str>>(names: &[S]) -> impl Iterator<Item = String> {
    let names = names.iter().map(AsRef::as_ref);
    names.filter_map(|name| Some(format!("{}: {name}", forbidden(name)?)))
}

/// The reason why an image must not have a symbol of this name, mangled or not; `None` if it may.
fn forbidden(name: &str) -> Option<&'static str> {
    if is_panic(name) {
        Some("panics")
    } else if is_soft_float(name) {
        Some("calculates in floating point")
    } else if is_allocator(name) {
        Some("allocates")
    } else {
        None
    }
}

/// The panicking machinery and its entry points. Both manglings keep these names as they are.
const PANICS: &[&str] = &[
    // core::panicking::*, panic_fmt, panic_bounds_check, panic_const_*,
    // panic_already_borrowed, rust_panic, begin_panic
    "panic",
    // Option and Result
    "unwrap_failed expect_failed assert_failed",
    // slices and strings: slice_start_index_len_fail, slice_index_order_fail,
    // slice_index_fail, slice_error_fail, len_mismatch_fail
    "index_fail len_fail order_fail slice_error_fail mismatch_fail",
    // unwinding
    "rust_begin_unwind rust_eh_personality _Unwind_",
];

fn is_panic(name: &str) -> bool {
    PANICS.iter().any(|parts| has_part(name, parts))
}

/// The heap of the alloc crate or of C.
fn is_allocator(name: &str) -> bool {
    const PARTS: &str = "__rust_alloc __rust_dealloc __rust_realloc __rdl_ __rg_ \
        exchange_malloc alloc_error capacity_overflow";
    const C: &str = "malloc calloc realloc free memalign sbrk _sbrk";
    has_part(name, PARTS) || is_made_of(name, &[C])
}

/// A routine that replaces a floating-point instruction, or a function of the mathematical library.
fn is_soft_float(name: &str) -> bool {
    if has_part(name, "compiler_builtins5float compiler_builtins4math") {
        return true;
    }
    match name.strip_prefix("__") {
        Some(name) => name
            .strip_prefix("aeabi_")
            .map_or_else(|| is_gnu_float(name), is_aeabi_float),
        None => is_mathematics(name),
    }
}

/// The names of Arm's run-time ABI, without `__aeabi_`.
///
/// The names for integers are allowed: `uidiv`, `uldivmod`, `lmul`, `llsl`, `memcpy`.
fn is_aeabi_float(name: &str) -> bool {
    // Operations on one of the types: fadd, dmul, fcmplt, cdcmpeq, cfrcmple, d2iz.
    const TYPES: &str = "f d h cf cd";
    const OPERATIONS: &str = "add sub rsub mul div neg cmpeq cmplt cmple cmpge cmpgt cmpun \
        rcmple 2iz 2uiz 2lz 2ulz 2f 2d 2h 2f_alt 2h_alt";
    // From an integer: i2d, ul2f.
    const FROM: &str = "i2 ui2 l2 ul2";
    is_made_of(name, &[TYPES, OPERATIONS]) || is_made_of(name, &[FROM, TYPES])
}

/// The names of GCC's and LLVM's run-time libraries, without `__`. A float is
/// named by its machine mode: `sf` single, `df` double and so on.
fn is_gnu_float(name: &str) -> bool {
    const FLOATS: &str = "hf bf sf df xf tf kf";
    const COMPLEX: &str = "hc sc dc xc tc kc";
    const INTEGERS: &str = "qi hi si di ti";
    const BINARY: &str = "add sub mul div";
    const UNARY_AND_COMPARE: &str = "neg cmp unord eq ne lt le gt ge powi";
    let forms: [&[&str]; 7] = [
        // addsf3; on old Arm with a unit, addsf3vfp
        &[BINARY, FLOATS, "3 3vfp"],
        // mulsc3
        &[BINARY, COMPLEX, "3"],
        // negsf2, unorddf2
        &[UNARY_AND_COMPARE, FLOATS, "2 2vfp"],
        // extendsfdf2, truncdfsf2
        &["extend trunc", FLOATS, FLOATS, "2"],
        // fixsfsi, fixunsdfdi
        &["fix fixuns", FLOATS, INTEGERS],
        // floatsisf, floatundidf
        &["float floatun floatuns", INTEGERS, FLOATS],
        &["gnu_f2h_ieee gnu_h2f_ieee"],
    ];
    forms.iter().any(|form| is_made_of(name, form))
}

/// Whether one of these words is in `name`.
fn has_part(name: &str, words: &str) -> bool {
    words.split_whitespace().any(|word| name.contains(word))
}

/// Whether `name` is a word of the first of `parts`, then one of the second, and
/// so on to its end.
fn is_made_of(name: &str, parts: &[&str]) -> bool {
    let [first, others @ ..] = parts else {
        return name.is_empty();
    };
    let mut rests = first
        .split_whitespace()
        .filter_map(|word| name.strip_prefix(word));
    rests.any(|rest| is_made_of(rest, others))
}

/// Functions of the mathematical library, for `double`, and with `f`, `l`,
/// `f16` or `f128` at the end for others. An integer square root has another name, as it is
/// mangled.
fn is_mathematics(name: &str) -> bool {
    const FUNCTIONS: &str = "acos acosh asin asinh atan atan2 atanh cbrt ceil copysign cos cosh \
        erf erfc exp exp10 exp2 expm1 fabs fdim floor fma fmax fmaximum fmaximum_num fmin \
        fminimum fminimum_num fmod frexp hypot ilogb ldexp lgamma log log10 log1p log2 modf \
        nearbyint pow remainder remquo rint round roundeven scalbn sin sincos sinh sqrt tan \
        tanh tgamma trunc";
    ["", "f", "l", "f16", "f128"].iter().any(|suffix| {
        let name = name.strip_suffix(suffix);
        name.is_some_and(|name| is_made_of(name, &[FUNCTIONS]))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn assert_all(names: &str, expected: Option<&str>) {
        for name in names.split_whitespace() {
            assert_eq!(forbidden(name), expected, "{name}");
        }
    }

    #[test]
    fn finds_the_panicking_machinery() {
        let names = "
            _ZN4core9panicking18panic_bounds_check17h5b1f7b0f7c4b8f2bE
            _ZN4core9panicking9panic_fmt17h0123456789abcdefE
            _ZN4core6option13unwrap_failed17h0123456789abcdefE
            _ZN4core6option13expect_failed17h0123456789abcdefE
            _ZN4core5slice5index26slice_start_index_len_fail17h0123456789abcdefE
            _ZN4core5slice5index22slice_index_order_fail17h0123456789abcdefE
            _RNvNtNtCs1234_4core9panicking11panic_const24panic_const_div_by_zero
            _RNvNtNtCs1234_4core5slice5index16slice_index_fail
            _RNvNvNtCs1234_4core5slice20copy_from_slice_impl17len_mismatch_fail
            core::panicking::panic rust_begin_unwind rust_eh_personality
            _RNvCs1234_7___rustc17rust_begin_unwind
            _Unwind_Resume dtof_has_a_reachable_panic";
        assert_all(names, Some("panics"));
    }

    #[test]
    fn finds_floating_point() {
        let names = "
            __aeabi_fadd __aeabi_fsub __aeabi_frsub __aeabi_fmul __aeabi_fdiv __aeabi_fneg
            __aeabi_dadd __aeabi_dmul __aeabi_ddiv __aeabi_drsub __aeabi_dcmpun
            __aeabi_fcmpeq __aeabi_fcmplt __aeabi_cfcmple __aeabi_cdcmpeq __aeabi_cfrcmple
            __aeabi_f2iz __aeabi_f2uiz __aeabi_d2lz __aeabi_d2ulz __aeabi_f2d __aeabi_d2f
            __aeabi_i2f __aeabi_i2d __aeabi_ui2f __aeabi_l2d __aeabi_ul2f
            __aeabi_f2h __aeabi_d2h __aeabi_h2f __aeabi_h2f_alt
            __addsf3 __adddf3 __subsf3 __mulsf3 __muldf3 __multf3 __divdf3 __mulsc3
            __negsf2 __ltsf2 __gedf2 __unordsf2 __cmpdf2 __powidf2 __addsf3vfp
            __extendsfdf2 __extendhfsf2 __truncdfsf2 __trunctfdf2
            __fixsfsi __fixdfdi __fixunssfsi __fixunsdfti
            __floatsisf __floatdidf __floatunsisf __floatundidf __floattisf
            __gnu_f2h_ieee __gnu_h2f_ieee
            sqrt sqrtf sqrtf128 fma fmaf fmod floor floorf truncf roundevenf powl";
        assert_all(names, Some("calculates in floating point"));
    }

    #[test]
    fn finds_allocation() {
        let names = "
            __rust_alloc __rust_dealloc __rust_realloc __rust_alloc_zeroed
            _RNvCs1234_7___rustc12___rust_alloc _RNvCs1234_7___rustc11___rdl_alloc
            _ZN5alloc5alloc18handle_alloc_error17h0123456789abcdefE
            _ZN5alloc7raw_vec17capacity_overflow17h0123456789abcdefE
            malloc calloc realloc free _sbrk";
        assert_all(names, Some("allocates"));
    }

    #[test]
    fn leaves_integers_and_memory_alone() {
        let names = "
            __aeabi_memcpy __aeabi_memcpy4 __aeabi_memmove8 __aeabi_memset __aeabi_memclr4
            __aeabi_uidiv __aeabi_idiv __aeabi_uidivmod __aeabi_idivmod __aeabi_uldivmod
            __aeabi_ldivmod __aeabi_lmul __aeabi_llsl __aeabi_llsr __aeabi_lasr
            __aeabi_lcmp __aeabi_ulcmp __aeabi_uread4 __aeabi_unwind_cpp_pr0
            __mulsi3 __muldi3 __multi3 __divsi3 __divdi3 __udivsi3 __udivdi3 __umoddi3
            __udivmoddi4 __udivmodsi4 __ashldi3 __lshrdi3 __ashrdi3 __negdi2 __cmpdi2
            __ucmpdi2 __clzsi2 __ctzdi2 __popcountsi2 __bswapsi2 __ffssi2
            memcpy memset memmove memcmp bcmp strlen _start
            _ZN9dtof_core5isqrt5isqrt17h0123456789abcdefE
            _ZN13library_image5roots17h0123456789abcdefE
            _RINvNtCs1234_9dtof_core5pixel6detectKj8_NtNtB4_9histogram7Count10E
            $t.0 $d $x .L1";
        assert_all(names, None);
    }
}
