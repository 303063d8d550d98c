//! Layers as the page shows them: what there is, and one of them as a file.

use serde::Serialize;

use super::page::Bytes;
use crate::film::Film;
use crate::plan::{Aov, RenderPlan};

/// Layers that need nothing gathered: every film has them.
const ALWAYS: [Aov; 3] = [Aov::SPP, Aov::STDERR, Aov::VARIANCE];

/// A layer that the page can show: channels whose names share what stands before the last dot.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Layer {
    /// What they share.
    pub name: String,
    /// What stands behind the dot, channel by channel; the whole name where there is none.
    pub components: Vec<String>,
    #[serde(skip)]
    aov: Aov,
}

/// The layers of `film`, as `plan` has gathered them.
pub fn of(plan: &RenderPlan, film: &Film) -> Vec<Layer> {
    let mut layers: Vec<Layer> = Vec::new();
    for aov in gathered(plan) {
        for channel in film.channel_names(&[aov], plan.max_depth) {
            let (name, component) = channel.rsplit_once('.').unwrap_or((&channel, &channel));
            match layers.last_mut().filter(|layer| layer.name == name && layer.aov == aov) {
                Some(layer) => layer.components.push(component.into()),
                None => layers.push(Layer { name: name.into(), components: vec![component.into()], aov }),
            }
        }
    }
    layers
}

fn gathered(plan: &RenderPlan) -> impl Iterator<Item = Aov> {
    ALWAYS.into_iter().chain(plan.aovs.iter().copied().filter(|aov| !ALWAYS.contains(aov)))
}

/// Names of layers that a render by `plan` has not gathered, but another could.
pub fn beyond(plan: &RenderPlan) -> Vec<&'static str> {
    let gathered: Vec<Aov> = gathered(plan).collect();
    Aov::all().filter(|aov| !gathered.contains(aov)).map(Aov::name).collect()
}

/// Its file for the page: columns, rows and channels as u32, 1 where they are a colour or else 0, then the channels one
/// after the other as f32; little-endian.
pub fn file(layer: &Layer, plan: &RenderPlan, film: &Film) -> Bytes {
    let is_of_it = |name: &str| name.rsplit_once('.').map_or(name, |(layer, _)| layer) == layer.name;
    let channels = film.channels_in(&[layer.aov], plan.max_depth, is_of_it);
    let is_color = channels.len() == 3 && channels.iter().all(|channel| channel.is_color);
    let head = [film.window.width, film.window.height, channels.len() as u32, u32::from(is_color)];
    let mut bytes = Vec::with_capacity(16 + 4 * channels.len() * film.pixels.len());
    bytes.extend(head.into_iter().flat_map(u32::to_le_bytes));
    bytes.extend(channels.iter().flat_map(|channel| &channel.values).flat_map(|value| value.to_le_bytes()));
    bytes.into()
}
