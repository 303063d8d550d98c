//! Values as a file has them: a channel, and how f64 means become f32.

/// One channel of a file: a value for each pixel of the window, row-major.
#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    /// Full name, `variance.R`.
    pub name: String,
    /// Whether it is a component of a colour that is linear in radiance or reflectance, with the two others beside it.
    pub is_color: bool,
    /// Finite values.
    pub values: Vec<f32>,
}

impl Channel {
    /// The part of its name that channels of one layer share; the whole name where it has no component.
    pub fn layer(&self) -> &str {
        self.name.rsplit_once('.').map_or(self.name.as_str(), |(layer, _)| layer)
    }
}

/// A value as it is stored: rounded to f32 and saturated.
pub(super) fn stored(value: f64) -> f32 {
    value.clamp(f64::from(f32::MIN), f64::from(f32::MAX)) as f32
}
