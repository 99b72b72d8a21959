//! New firmware for a hub with a bootloader. A page sends the image in parts. The relay sends the image to the hub in
//! small chunks between two frames, so that pages get frames during the update.

use crate::hub::{RequestError, or_refusal};
use crate::requests::SignatureFiles;
use motor_hub::update::ImageSignature;
use motor_hub_client::update::{Image, Progress as News, UpdateError, Updating, read_key, read_signature};
use motor_hub_client::{Error, Session};
use serde::Serialize;

/// Progress of an update, for pages.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Progress {
    /// `running`, `done` or `failed`.
    pub(crate) state: &'static str,
    /// Share of the image that the hub has received, 0 to 100 percent.
    pub(crate) percent: usize,
    /// Text for the user: the present step, the result, or why the update failed.
    pub(crate) text: String,
}

/// Announces an image to the hub. All motors must be disabled.
pub(crate) fn begin(
    session: &mut Session,
    bytes: Vec<u8>,
    version: &str,
    files: Option<&SignatureFiles>,
) -> Result<Updating, RequestError> {
    let signature = files.map(read_files).transpose()?;
    let image = Image { bytes, version: version.to_owned(), origin: None };
    Ok(Updating::begin(session, image, signature)?)
}

/// Continues an update. Returns the progress, or `None` if there is nothing new. After `done` or `failed` the update has
/// ended.
pub(crate) fn go_on(update: &mut Updating, session: &mut Session) -> Result<Option<Progress>, Error> {
    let (state, text) = match or_refusal(update.step(session))? {
        Ok(None) => return Ok(None),
        Ok(Some(News::Sending(_))) => ("running", "The firmware is sent.".to_owned()),
        Ok(Some(News::Checking)) => ("running", "The hub checks the firmware.".to_owned()),
        Ok(Some(News::Restarting)) => {
            ("running", "The hub restarts with the new firmware, which takes some 20 s.".to_owned())
        }
        Ok(Some(News::Confirmed(version))) => ("done", format!("the hub runs {version}, confirmed")),
        Err(why) => {
            update.abandon(session);
            ("failed", why)
        }
    };
    Ok(Some(Progress { state, percent: update.percent(), text }))
}

/// Returns the progress `failed` with this reason.
pub(crate) fn failed(update: &Updating, why: &str) -> Progress {
    Progress { state: "failed", percent: update.percent(), text: why.to_owned() }
}

impl From<UpdateError> for RequestError {
    fn from(error: UpdateError) -> Self {
        match error {
            UpdateError::Hub(error) => error.into(),
            UpdateError::Unfit(why) | UpdateError::Failed(why) => Self::Refused(why),
        }
    }
}

/// Converts hexadecimal digits to bytes; `None` if a character is no hexadecimal digit, or if a byte has one digit.
pub(crate) fn bytes_of(hex: &str) -> Option<Vec<u8>> {
    let (pairs, []) = hex.as_bytes().as_chunks::<2>() else { return None };
    let digit = |digit: u8| char::from(digit).to_digit(16);
    pairs.iter().map(|&[high, low]| u8::try_from(16 * digit(high)? + digit(low)?).ok()).collect()
}

/// Reads the signature and the key.
fn read_files(files: &SignatureFiles) -> Result<ImageSignature, String> {
    let (signature, key) = (bytes_of(&files.signature), bytes_of(&files.key));
    let signature = read_signature(&signature.unwrap_or_default());
    let key = read_key(&key.unwrap_or_default());
    Ok(ImageSignature {
        bytes: signature.map_err(|why| format!("the signature {why}"))?,
        key: key.map_err(|why| format!("the key {why}"))?,
    })
}
