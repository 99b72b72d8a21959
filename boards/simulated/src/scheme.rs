//! Words for schemes (`none`, `A` to `D`) and for the blend of scheme D. Scenario files and the command line share these
//! words.
//!
//! ```
//! use simulated::scheme::{SchemeName, describe};
//!
//! let scheme = SchemeName::D.with_blend(Some("0.25".parse()?))?;
//! assert_eq!(describe(scheme), "scheme D, blend 0.250");
//! assert_eq!(describe(SchemeName::D.with_blend(None)?), "scheme D, automatic blend");
//! assert_eq!("b".parse(), Ok(SchemeName::B));
//! assert!(SchemeName::B.with_blend(Some("0.25".parse()?)).is_err());
//! # Ok::<(), simulated::scheme::BlendError>(())
//! ```

use motor_hub::braking::{Blend, BlendFraction, Scheme};
use serde::Deserialize;
use serde::ser::{Serialize, SerializeStruct, Serializer};
use std::str::FromStr;

/// A scheme's name. Upper and lower case are accepted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(try_from = "String")]
pub enum SchemeName {
    /// No braking regime: forward and reverse driving only.
    None,
    /// Control is an equivalent voltage.
    A,
    /// Control is a current.
    B,
    /// As B, but braking is as steep as driving.
    C,
    /// Between B and C, as a [`BlendChoice`] says.
    D,
}

/// The blend of scheme D.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(try_from = "NumberOrAuto")]
pub struct BlendChoice(Blend);

/// What is wrong with a blend.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum BlendError {
    /// The blend is neither a number from 0 to 1 nor "auto".
    #[error("a blend is a number from 0 (scheme B) to 1 (scheme C), or \"auto\"")]
    OutOfRange,
    /// A blend is given with a scheme other than D.
    #[error("a blend is allowed with scheme D only")]
    NotD,
}

/// There is no scheme of this name.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("unknown scheme `{0}`, expected one of `none`, `A`, `B`, `C`, `D`")]
pub struct UnknownScheme(String);

impl FromStr for SchemeName {
    type Err = UnknownScheme;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        match text.to_ascii_uppercase().as_str() {
            "NONE" => Ok(Self::None),
            "A" => Ok(Self::A),
            "B" => Ok(Self::B),
            "C" => Ok(Self::C),
            "D" => Ok(Self::D),
            _ => Err(UnknownScheme(text.to_owned())),
        }
    }
}

impl TryFrom<String> for SchemeName {
    type Error = UnknownScheme;

    fn try_from(text: String) -> Result<Self, Self::Error> {
        text.parse()
    }
}

impl SchemeName {
    /// Returns the scheme for the firmware. Scheme D without a blend blends automatically.
    pub fn with_blend(self, blend: Option<BlendChoice>) -> Result<Scheme, BlendError> {
        match (self, blend) {
            (Self::D, None) => Ok(Scheme::D(Blend::Automatic)),
            (Self::D, Some(BlendChoice(blend))) => Ok(Scheme::D(blend)),
            (_, Some(_)) => Err(BlendError::NotD),
            (Self::None, None) => Ok(Scheme::ForwardReverse),
            (Self::A, None) => Ok(Scheme::A),
            (Self::B, None) => Ok(Scheme::B),
            (Self::C, None) => Ok(Scheme::C),
        }
    }
}

impl BlendChoice {
    /// A blend that is the same at all speeds: 0 to 1, in steps of 2^-16.
    pub fn fixed(blend: f64) -> Result<Self, BlendError> {
        if !(0.0..=1.0).contains(&blend) {
            return Err(BlendError::OutOfRange);
        }
        let bits = (blend * f64::from(BlendFraction::ONE.to_bits())).round() as u32;
        BlendFraction::from_bits(bits).map(|b| Self(Blend::Fixed(b))).map_err(|_| BlendError::OutOfRange)
    }
}

impl FromStr for BlendChoice {
    type Err = BlendError;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        match text {
            "auto" => Ok(Self(Blend::Automatic)),
            _ => text.parse().map_err(|_| BlendError::OutOfRange).and_then(Self::fixed),
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
    type Error = BlendError;

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
        let name = match self.0 {
            Scheme::ForwardReverse => "none",
            Scheme::A => "A",
            Scheme::B => "B",
            Scheme::C => "C",
            Scheme::D(_) => "D",
        };
        let mut words = to.serialize_struct("SchemeWords", 2)?;
        words.serialize_field("scheme", name)?;
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
        Scheme::A => "scheme A".into(),
        Scheme::B => "scheme B".into(),
        Scheme::C => "scheme C".into(),
        Scheme::D(Blend::Automatic) => "scheme D, automatic blend".into(),
        Scheme::D(Blend::Fixed(fraction)) => {
            format!("scheme D, blend {:.3}", share(fraction))
        }
    }
}
