//! The files of the page, embedded from `page/`. They need no build step.

/// A file that the page loads.
#[derive(Clone, Copy, Debug)]
pub struct Asset {
    /// Path of the URL.
    pub path: &'static str,
    /// Contents.
    pub bytes: &'static [u8],
}

impl Asset {
    /// Media type, by the end of the path.
    pub fn kind(&self) -> &'static str {
        match self.path.rsplit_once('.') {
            Some((_, "css")) => "text/css; charset=utf-8",
            Some((_, "js")) => "text/javascript; charset=utf-8",
            _ => "image/svg+xml",
        }
    }
}

/// The page itself, which is HTML.
pub const PAGE: &str = include_str!("../page/index.html");

macro_rules! assets {
    ($($file:literal)+) => {
        &[$(Asset { path: concat!("/", $file), bytes: include_bytes!(concat!("../page/", $file)) }),+]
    };
}

/// All files that the page loads.
pub const ALL: &[Asset] = assets! {
    "style.css" "favicon.svg" "vendor/uPlot.min.css" "vendor/uPlot.iife.min.js"
    "js/app.js" "js/bands.js" "js/chain.js" "js/devices.js" "js/dom.js" "js/fields.js" "js/firmware.js"
    "js/gamepad.js" "js/group.js" "js/history.js" "js/hub.js" "js/jog.js" "js/learn.js" "js/link.js" "js/list.js"
    "js/mcap.js" "js/motors.js" "js/panels.js" "js/plots.js" "js/record.js" "js/regimes.js" "js/setup.js"
    "js/slider.js" "js/small.js" "js/state.js" "js/transport.js" "js/tune.js" "js/units.js" "js/world.js"
};

/// The file with this path of the URL.
pub fn find(path: &str) -> Option<&'static Asset> {
    ALL.iter().find(|asset| asset.path == path)
}
