//! Names of schemes and blends.

use simulated::scheme::{BlendChoice, BlendError, SchemeName, describe};

#[test]
fn a_blend_is_refused_unless_scheme_d_uses_it() {
    let quarter = BlendChoice::fixed(0.25).ok();
    assert!(SchemeName::B.with_blend(quarter).is_err());
    let scheme = SchemeName::D.with_blend(quarter).map(describe);
    assert_eq!(scheme, Ok("scheme D, blend 0.250".into()));
    let scheme = SchemeName::D.with_blend(None).map(describe);
    assert_eq!(scheme, Ok("scheme D, automatic blend".into()));
}

#[test]
fn a_blend_lies_between_zero_and_one() {
    for wrong in ["-0.1", "1.01", "nan", "half", ""] {
        assert_eq!(wrong.parse::<BlendChoice>(), Err(BlendError::OutOfRange), "{wrong:?}");
    }
}
