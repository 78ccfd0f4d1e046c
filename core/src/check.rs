//! Constants are checked at compile time.

/// The value of a constant `Result`, checked at compile time. An error is a compile error
/// with its text.
///
/// It takes the `Result` of any `const fn` of this crate:
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

/// Implements `Display` and `Error` for a type with a constant `text`, which [`checked`]
/// shows as well.
macro_rules! impl_error {
    ($error:ident) => {
        impl core::fmt::Display for $error {
            fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
                f.write_str(self.text())
            }
        }

        impl core::error::Error for $error {}
    };
}

pub(crate) use impl_error;
