//! Words for schemes (`none`, `A` to `D`) and for the blend of scheme D. Scenario files and the command line share these
//! words.
//!
//! ```
//! use simulated::scheme::{SchemeName, describe};
//!
//! let [b, d] = ["b".parse::<SchemeName>()?, "D".parse()?];
//! assert_eq!(describe(d.0), "scheme D, automatic blend");
//! assert_eq!(describe(d.with_blend(Some("0.25".parse()?))?), "scheme D, blend 0.250");
//! assert!(b.with_blend(Some("0.25".parse()?)).is_err());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use motor_hub::braking::{Blend, BlendFraction, Scheme};
use serde::Deserialize;
use serde::ser::{Serialize, SerializeStruct, Serializer};
use std::str::FromStr;

/// A scheme that is given by its name in upper or lower case. Scheme D has the automatic blend.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(try_from = "String")]
pub struct SchemeName(pub Scheme);

/// The blend of scheme D.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(try_from = "NumberOrAuto")]
pub struct BlendChoice(pub Blend);

/// What is wrong with a scheme or its blend.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SchemeError {
    /// There is no scheme of this name.
    #[error("unknown scheme `{0}`, expected one of `none`, `A`, `B`, `C`, `D`")]
    Unknown(String),
    /// The blend is neither a number from 0 to 1 nor "auto".
    #[error("a blend is a number from 0 (scheme B) to 1 (scheme C), or \"auto\"")]
    OutOfRange,
    /// A blend is given with a scheme other than D.
    #[error("a blend is allowed with scheme D only")]
    NotD,
}

/// Returns the name of a scheme, without the blend of scheme D.
const fn name(scheme: Scheme) -> &'static str {
    match scheme {
        Scheme::ForwardReverse => "none",
        Scheme::A => "A",
        Scheme::B => "B",
        Scheme::C => "C",
        Scheme::D(_) => "D",
    }
}

impl FromStr for SchemeName {
    type Err = SchemeError;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        // The first scheme D in the list has the automatic blend.
        let named = Scheme::ALL.into_iter().find(|scheme| name(*scheme).eq_ignore_ascii_case(text));
        named.map(Self).ok_or_else(|| SchemeError::Unknown(text.to_owned()))
    }
}

impl TryFrom<String> for SchemeName {
    type Error = SchemeError;

    fn try_from(text: String) -> Result<Self, Self::Error> {
        text.parse()
    }
}

impl SchemeName {
    /// Returns the scheme with a blend, which only scheme D has. Scheme D without a blend blends automatically.
    pub fn with_blend(self, blend: Option<BlendChoice>) -> Result<Scheme, SchemeError> {
        match (self.0, blend) {
            (scheme, None) => Ok(scheme),
            (Scheme::D(_), Some(BlendChoice(blend))) => Ok(Scheme::D(blend)),
            (_, Some(_)) => Err(SchemeError::NotD),
        }
    }
}

impl BlendChoice {
    /// A blend that is the same at all speeds: 0 to 1, in steps of 2^-16.
    pub fn fixed(blend: f64) -> Result<Self, SchemeError> {
        if !(0.0..=1.0).contains(&blend) {
            return Err(SchemeError::OutOfRange);
        }
        let bits = (blend * f64::from(BlendFraction::ONE.to_bits())).round() as u32;
        BlendFraction::from_bits(bits).map(|b| Self(Blend::Fixed(b))).map_err(|_| SchemeError::OutOfRange)
    }
}

impl FromStr for BlendChoice {
    type Err = SchemeError;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        match text {
            "auto" => Ok(Self(Blend::Automatic)),
            _ => text.parse().map_err(|_| SchemeError::OutOfRange).and_then(Self::fixed),
        }
    }
}

/// A blend in a file: a number, or "auto".
#[derive(Deserialize)]
#[serde(untagged, expecting = "a blend is a number from 0 to 1, or \"auto\"")]
enum NumberOrAuto {
    Number(f64),
    Auto(String),
}

impl TryFrom<NumberOrAuto> for BlendChoice {
    type Error = SchemeError;

    fn try_from(blend: NumberOrAuto) -> Result<Self, Self::Error> {
        match blend {
            NumberOrAuto::Number(blend) => Self::fixed(blend),
            NumberOrAuto::Auto(text) => text.parse(),
        }
    }
}

/// A scheme in JSON: `scheme` and `blend` as a user types them. `blend` is null for all schemes but D.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SchemeWords(pub Scheme);

impl Serialize for SchemeWords {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        let mut words = to.serialize_struct("SchemeWords", 2)?;
        words.serialize_field("scheme", name(self.0))?;
        match self.0 {
            Scheme::D(Blend::Automatic) => words.serialize_field("blend", "auto")?,
            Scheme::D(Blend::Fixed(fraction)) => words.serialize_field("blend", &share(fraction))?,
            _ => words.serialize_field("blend", &None::<f64>)?,
        }
        words.end()
    }
}

fn share(fraction: BlendFraction) -> f64 {
    f64::from(fraction.to_bits()) / f64::from(BlendFraction::ONE.to_bits())
}

/// A scheme in words, for headings.
pub fn describe(scheme: Scheme) -> String {
    match scheme {
        Scheme::ForwardReverse => "no braking regime".into(),
        Scheme::D(Blend::Automatic) => "scheme D, automatic blend".into(),
        Scheme::D(Blend::Fixed(fraction)) => format!("scheme D, blend {:.3}", share(fraction)),
        scheme => format!("scheme {}", name(scheme)),
    }
}
