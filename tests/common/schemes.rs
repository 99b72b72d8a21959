//! Schemes for tests with random values.

use motor_hub::braking::{Blend, BlendFraction, Scheme};
use proptest::prelude::{Just, Strategy, prop_oneof};

/// Any scheme, with any blend of Scheme D up to this many steps.
pub(crate) fn any_scheme(largest_blend: u32) -> impl Strategy<Value = Scheme> {
    let blend = (0..=largest_blend).prop_map(|bits| BlendFraction::from_bits(bits).expect("in range"));
    prop_oneof![
        Just(Scheme::ForwardReverse),
        Just(Scheme::A),
        Just(Scheme::B),
        Just(Scheme::C),
        Just(Scheme::D(Blend::Automatic)),
        blend.prop_map(|blend| Scheme::D(Blend::Fixed(blend))),
    ]
}
