//! From measurements to the report that is shown: figures, then the notes that a reader of these figures needs.

use super::findings::Study;
use super::notes;
use super::report::{Report, Setup};

impl Report {
    /// From what was measured. `reference` names a given one.
    pub fn new(study: &Study, setup: Setup, reference: Option<String>) -> Self {
        let mut report = Report::of_figures(study, setup, reference);
        report.notes = notes::of(&report, study);
        report
    }
}
