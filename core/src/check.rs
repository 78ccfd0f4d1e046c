//! What is constant is checked when it is compiled.

/// The value of a constant `Result`, checked when compiled. An error is a compile error
/// with its text.
///
/// It takes whatever a `const fn` of this crate returns that may be refused:
///
/// ```
/// use dtof_core::{PixelConfig, RangeGate, checked};
///
/// const GATE: RangeGate<128> = checked!(RangeGate::new(20, 119));
/// const CONFIG: PixelConfig<128> =
///     checked!(PixelConfig::paper().x(4).l1(40).l2(2000).gate(GATE).build());
/// ```
///
/// X of 50 is greater than L1 of 40, so this does not compile:
///
/// ```compile_fail,E0080
/// use dtof_core::{PixelConfig, checked};
///
/// const CONFIG: PixelConfig<128> = checked!(PixelConfig::paper().x(50).l1(40).build());
/// ```
#[macro_export]
macro_rules! checked {
    ($result:expr) => {
        const {
            match $result {
                Ok(value) => value,
                Err(error) => panic!("{}", error.text()),
            }
        }
    };
}

/// Makes an error of a type with a constant text, which [`checked`] says too.
macro_rules! written_as_its_text {
    ($error:ident) => {
        impl core::fmt::Display for $error {
            fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
                f.write_str(self.text())
            }
        }

        impl core::error::Error for $error {}
    };
}

pub(crate) use written_as_its_text;
