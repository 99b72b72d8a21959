//! SVG to PNG with the font that the program carries, so that a picture is the same on every machine.

use resvg::{tiny_skia, usvg};

/// Pixels of the PNG to one of the SVG: sharp on a dense screen, still readable when halved.
const ZOOM: f32 = 1.5;

/// Why a chart cannot be drawn.
#[derive(Debug, thiserror::Error)]
pub enum DrawError {
    /// It is no SVG document.
    #[error("chart: {0}")]
    Svg(#[from] usvg::Error),
    /// It is zero pixels wide or high.
    #[error("chart: it has no area")]
    NoArea,
    /// There is not memory enough.
    #[error("chart: it is too large to draw")]
    TooLarge,
    /// Its pixels make no PNG, in the encoder's words.
    #[error("chart: {0}")]
    Png(String),
}

/// Renders an SVG document that [`super::Figure::svg`] wrote.
///
/// # Errors
/// See [`DrawError`].
pub fn from_svg(svg: &str) -> Result<Vec<u8>, DrawError> {
    let mut options = usvg::Options::default();
    options.fontdb_mut().load_font_data(epaint_default_fonts::UBUNTU_LIGHT.to_vec());
    options.fontdb_mut().set_sans_serif_family("Ubuntu");
    let tree = usvg::Tree::from_str(svg, &options)?;
    let size = tree.size().to_int_size().scale_by(ZOOM).ok_or(DrawError::NoArea)?;
    let mut pixels = tiny_skia::Pixmap::new(size.width(), size.height()).ok_or(DrawError::TooLarge)?;
    resvg::render(&tree, tiny_skia::Transform::from_scale(ZOOM, ZOOM), &mut pixels.as_mut());
    pixels.encode_png().map_err(|error| DrawError::Png(error.to_string()))
}
