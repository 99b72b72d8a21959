//! The files of the page, embedded from `page/`. They need no build step.
//!
//! ```
//! use dashboard::assets;
//!
//! assert!(assets::find("/").is_some_and(|page| page.kind.starts_with("text/html")));
//! assert!(assets::find("/../Cargo.toml").is_none());
//! ```

/// A file of the page.
#[derive(Clone, Copy, Debug)]
pub struct Asset {
    /// Path of the URL.
    pub path: &'static str,
    /// Media type.
    pub kind: &'static str,
    /// Contents.
    pub bytes: &'static [u8],
}

macro_rules! assets {
    ($($path:literal $kind:ident $file:literal)+) => {
        &[$(Asset { path: $path, kind: $kind, bytes: include_bytes!(concat!("../page/", $file)) }),+]
    };
}

const HTML: &str = "text/html; charset=utf-8";
const CSS: &str = "text/css; charset=utf-8";
const JS: &str = "text/javascript; charset=utf-8";
const SVG: &str = "image/svg+xml";

/// All files of the page.
pub const ALL: &[Asset] = assets! {
    "/" HTML "index.html"
    "/style.css" CSS "style.css"
    "/favicon.svg" SVG "favicon.svg"
    "/vendor/uPlot.min.css" CSS "vendor/uPlot.min.css"
    "/vendor/uPlot.iife.min.js" JS "vendor/uPlot.iife.min.js"
    "/js/app.js" JS "js/app.js"
    "/js/bands.js" JS "js/bands.js"
    "/js/chain.js" JS "js/chain.js"
    "/js/devices.js" JS "js/devices.js"
    "/js/dom.js" JS "js/dom.js"
    "/js/fields.js" JS "js/fields.js"
    "/js/firmware.js" JS "js/firmware.js"
    "/js/gamepad.js" JS "js/gamepad.js"
    "/js/group.js" JS "js/group.js"
    "/js/history.js" JS "js/history.js"
    "/js/hub.js" JS "js/hub.js"
    "/js/jog.js" JS "js/jog.js"
    "/js/learn.js" JS "js/learn.js"
    "/js/link.js" JS "js/link.js"
    "/js/list.js" JS "js/list.js"
    "/js/mcap.js" JS "js/mcap.js"
    "/js/motors.js" JS "js/motors.js"
    "/js/panels.js" JS "js/panels.js"
    "/js/plots.js" JS "js/plots.js"
    "/js/record.js" JS "js/record.js"
    "/js/regimes.js" JS "js/regimes.js"
    "/js/setup.js" JS "js/setup.js"
    "/js/slider.js" JS "js/slider.js"
    "/js/small.js" JS "js/small.js"
    "/js/state.js" JS "js/state.js"
    "/js/transport.js" JS "js/transport.js"
    "/js/tune.js" JS "js/tune.js"
    "/js/units.js" JS "js/units.js"
    "/js/world.js" JS "js/world.js"
};

/// The file with this path of the URL.
#[must_use]
pub fn find(path: &str) -> Option<&'static Asset> {
    ALL.iter().find(|asset| asset.path == path)
}
