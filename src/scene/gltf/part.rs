//! One object of a material read member by member: defaults, ranges, and warnings that name the material.
//!
//! Factors outside their range are clamped with a warning; infinite ones are errors.

use glam::Vec3;
use serde_json::Value;

use super::document::Document;
use super::json::brief;
use crate::error::Result;

/// An object below a material, whether the file has it or not.
pub(super) struct Part<'d> {
    pub(super) document: &'d Document,
    /// `/materials/N`.
    pub(super) material: &'d str,
    /// Name of the material.
    pub(super) name: &'d str,
    /// Path of the object below the material, with a slash at its end; empty for the material itself.
    pub(super) path: String,
}

impl<'d> Part<'d> {
    /// A number, `default` where the file has none. It may be infinite.
    pub(super) fn number(&self, member: &str, default: f32) -> Result<f32> {
        let pointer = self.at(member);
        match self.document.value(&pointer) {
            None => Ok(default),
            Some(value) => value
                .as_f64()
                .map(|number| number as f32)
                .ok_or_else(|| self.document.error(pointer, format!("expected a number, found {}", brief(value)))),
        }
    }

    /// A number from `least` to `most`.
    pub(super) fn factor(&self, member: &str, default: f32, (least, most): (f32, f32)) -> Result<f32> {
        self.in_range(self.number(member, default)?, member, (least, most))
    }

    /// Three numbers from 0 to `most`.
    pub(super) fn color(&self, member: &str, default: Vec3, most: f32) -> Result<Vec3> {
        let pointer = self.at(member);
        match self.document.value(&pointer) {
            None => Ok(default),
            Some(Value::Array(channels)) if channels.len() == 3 => {
                let mut color = [0.0; 3];
                for (channel, value) in color.iter_mut().enumerate() {
                    *value = self.number(&format!("{member}/{channel}"), 0.0)?;
                }
                self.color_in_range(color, member, most)
            }
            Some(other) => Err(self.document.error(pointer, format!("expected three numbers, found {}", brief(other)))),
        }
    }

    /// The first three of four numbers from 0 to 1.
    pub(super) fn color_of_four(&self, member: &str, default: Vec3) -> Result<Vec3> {
        let pointer = self.at(member);
        match self.document.value(&pointer) {
            None => Ok(default),
            Some(Value::Array(channels)) if channels.len() == 4 => {
                let channel = |i: usize| self.factor(&format!("{member}/{i}"), 0.0, (0.0, 1.0));
                Ok(Vec3::new(channel(0)?, channel(1)?, channel(2)?))
            }
            Some(other) => Err(self.document.error(pointer, format!("expected four numbers, found {}", brief(other)))),
        }
    }

    /// A value of `member` clamped to its range, with a warning; an error if it is not finite.
    pub(super) fn in_range(&self, value: f32, member: &str, (least, most): (f32, f32)) -> Result<f32> {
        let value = self.document.finite(value, &self.at(member))?;
        let clamped = value.clamp(least, most);
        if clamped != value {
            self.warn(&format!("{}{member} {value} is out of range and clamped to {clamped}", self.path));
        }
        Ok(clamped)
    }

    /// As [`in_range`](Self::in_range) for three channels from 0 to `most`.
    pub(super) fn color_in_range(&self, color: [f32; 3], member: &str, most: f32) -> Result<Vec3> {
        let mut clamped = [0.0; 3];
        for (channel, value) in clamped.iter_mut().zip(color) {
            *channel = self.in_range(value, member, (0.0, most))?;
        }
        Ok(clamped.into())
    }

    /// Pointer of a member.
    pub(super) fn at(&self, member: &str) -> String {
        format!("{}/{}{member}", self.material, self.path)
    }

    /// Warns of something about the material.
    pub(super) fn warn(&self, what: &str) {
        self.document.warn(format!("material \"{}\"", self.name), what);
    }
}
