//! What a survey writes down of the scatterings of camera paths: a guide learns from it. Empty in renders.

use glam::Vec3;

use crate::shading::guide::Record;

/// Scatterings of the paths of a wave.
#[derive(Default)]
pub struct Log {
    entries: Vec<Entry>,
    /// Entries whose `before` is known.
    settled: usize,
}

struct Entry {
    record: Record,
    /// Camera sample.
    slot: u32,
    /// Throughput that arrived, grey.
    throughput: f32,
    /// What the sample had gathered up to there, with the light sample there, grey.
    before: f32,
}

/// Mean of the channels.
pub fn grey(rgb: impl Into<Vec3>) -> f32 {
    rgb.into().element_sum() * (1.0 / 3.0)
}

impl Log {
    /// Notes a scattering of a path to which `throughput` arrived; the value of `record` is not known yet.
    pub fn push(&mut self, slot: u32, throughput: Vec3, record: Record) {
        self.entries.push(Entry { record, slot, throughput: grey(throughput), before: 0.0 });
    }

    /// After the light samples of an edge: what the samples have gathered up to there.
    pub fn settle(&mut self, gathered: impl Fn(u32) -> [f32; 3]) {
        for entry in &mut self.entries[self.settled..] {
            entry.before = grey(gathered(entry.slot));
        }
        self.settled = self.entries.len();
    }

    /// At the end of the paths: takes the records, in the order in which they were noted.
    pub fn take(&mut self, gathered: impl Fn(u32) -> [f32; 3]) -> impl Iterator<Item = Record> {
        self.settled = 0;
        std::mem::take(&mut self.entries).into_iter().map(move |entry| {
            let value = (grey(gathered(entry.slot)) - entry.before) / entry.throughput;
            Record { value: if value.is_finite() { value.max(0.0) } else { 0.0 }, ..entry.record }
        })
    }
}
