//! New firmware for a hub with a bootloader. A page sends the image in parts. The relay sends the image to the hub in
//! small chunks between two frames, so that pages get frames during the update.

use crate::hub::{RequestError, or_refusal};
use crate::requests::SignatureFiles;
use motor_hub::update::ImageSignature;
use motor_hub_client::update::{Image, Progress as News, UpdateError, Updating, read_key, read_signature};
use motor_hub_client::{Error, Session};
use serde::Serialize;

pub(crate) use motor_hub_client::update::LARGEST_IMAGE;

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

/// A running update.
#[derive(Debug)]
pub(crate) struct Update {
    updating: Updating,
    length: usize,
    percent: usize,
}

impl Update {
    /// Announces an image to the hub. All motors must be disabled.
    pub(crate) fn begin(
        session: &mut Session,
        bytes: Vec<u8>,
        version: &str,
        files: Option<&SignatureFiles>,
    ) -> Result<Self, RequestError> {
        let signature = files.map(read_files).transpose()?;
        let length = bytes.len().max(1);
        let image = Image { bytes, version: version.to_owned(), origin: None };
        Ok(Self { updating: Updating::begin(session, image, signature)?, length, percent: 0 })
    }

    /// True while the hub may be silent because it restarts.
    pub(crate) fn restarts(&self) -> bool {
        self.updating.restarts()
    }

    /// Continues the update. Returns the progress, or `None` if there is nothing new. After `done` or `failed` the
    /// update has ended.
    pub(crate) fn go_on(&mut self, session: &mut Session) -> Result<Option<Progress>, Error> {
        match or_refusal(self.updating.step(session))? {
            Ok(news) => Ok(news.map(|news| self.progress(news))),
            Err(why) => {
                self.updating.abandon(session);
                Ok(Some(self.failed(&why)))
            }
        }
    }

    /// Makes the hub discard the image, unless the hub restarts with the image already.
    pub(crate) fn abandon(&self, session: &mut Session) {
        self.updating.abandon(session);
    }

    /// Returns a failure if nothing has happened for too long, else `None`.
    pub(crate) fn late(&self) -> Option<Progress> {
        self.updating.late().map(|why| self.failed(why))
    }

    /// Returns the progress `failed` with this reason.
    pub(crate) fn failed(&self, why: &str) -> Progress {
        Progress { state: "failed", percent: self.percent, text: why.to_owned() }
    }

    fn progress(&mut self, news: News) -> Progress {
        self.percent = if let News::Sending(bytes) = news { 100 * bytes / self.length } else { 100 };
        let (state, text) = match news {
            News::Sending(_) => ("running", "The firmware is sent.".to_owned()),
            News::Checking => ("running", "The hub checks the firmware.".to_owned()),
            News::Restarting => {
                ("running", "The hub restarts with the new firmware, which takes some 20 s.".to_owned())
            }
            News::Confirmed(version) => ("done", format!("the hub runs {version}, confirmed")),
        };
        Progress { state, percent: self.percent, text }
    }
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
