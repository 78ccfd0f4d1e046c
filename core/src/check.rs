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
