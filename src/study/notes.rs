//! What a reader must know to read a report: the rules it keeps, and where its numbers end.

use super::findings::Study;
use super::report::Report;
use super::settings::Role;

/// Fewest rounds at which an interval over rounds is worth its name.
const FEW_ROUNDS: usize = 3;

/// The notes of `report`.
pub fn of(report: &Report, study: &Study) -> Vec<String> {
    let mut notes = Vec::new();
    if report.interrupted {
        notes.push("A signal ended the study early: what was measured until then is shown.".into());
    }
    let [w, h] = report.setup.resolution;
    let [rw, rh] = report.setup.render_resolution;
    let ratio = f64::from(rw) * f64::from(rh) / (f64::from(w) * f64::from(h));
    if (ratio - 1.0).abs() > 0.01 {
        notes.push(format!(
            "Measured at {w}x{h} pixels. `render` by itself takes {rw}x{rh}: {ratio:.1} times the pixels, and \
             about that many \
             times the seconds for the same error; samples per pixel stay."
        ));
    }
    match &report.reference {
        None if report.effects.is_some() => effects(&mut notes),
        None => notes.push("There was no time for a reference: nothing was measured against one.".into()),
        Some(r) if r.what == "own" => notes.push(format!(
            "Reference: the mean of {} held-out runs of {} samples per pixel with seeds of their own, by the \
             same renderer. \
             Its own error is stated and subtracted. What the renderer gets wrong everywhere, it gets wrong there too.",
            r.runs, r.spp
        )),
        Some(r) if r.own_relmse.is_none() => notes.push(format!(
            "Reference: {}. Its own error is not known; it is part of every error, and of the default's bias.",
            r.what
        )),
        Some(r) => notes.push(format!("Reference: {}. Its own error is subtracted.", r.what)),
    }
    if study.rounds < FEW_ROUNDS && report.reference.is_some() {
        notes.push(format!(
            "Only {} rounds of runs fitted the budget: intervals are wide or missing. A larger --budget or a \
             smaller --width \
             helps.",
            study.rounds
        ));
    }
    if let Some(caution) = report.prices.iter().find_map(|price| price.caution) {
        notes.push(format!("The price list has lower bounds, because in the pilot {caution}."));
    }
    if let (Some(seconds), Some(prediction)) = (report.setup.estimate_s, study.prediction) {
        notes.push(format!(
            "An estimate of the error takes {:.3} ms, as long as {:.2} samples per pixel. `--error` asks for one at \
             each power of two, and some near the target.",
            1e3 * seconds,
            seconds / prediction.seconds_per_spp
        ));
    }
    let unreliable: Vec<&str> = report.settings.iter().filter(|r| r.unreliable).map(|r| r.name.as_str()).collect();
    if !unreliable.is_empty() {
        notes.push(format!(
            "Interval unreliable, because one pixel carries more than 10 % of the error of some run: {}.",
            unreliable.join("; ")
        ));
    }
    let nonfinite: u64 = report.settings.iter().filter(|r| r.role != Role::Knob).map(|r| r.nonfinite).sum();
    if nonfinite > 0 {
        notes.push(format!("{nonfinite} samples were not finite; they count as 0 and stay in every metric."));
    }
    notes.push(
        "Errors are relative RMSE, the square root of relMSE = mean of (I - R)²/(R² + ε), of linear \
         pictures; nothing is \
         clamped, denoised or tone-mapped. No clamping is offered by this renderer, so none is measured. FLIP \
         is of the \
         displayed picture."
            .into(),
    );
    if report.effects.is_some() {
        return notes;
    }
    notes.push(
        "Efficiency is 1/(relMSE · processor time) over that of the default, at equal samples; seconds to 1 % \
         compare at \
         equal error. Intervals are of 95 % over rounds of runs, each round in order and in reverse; where the \
         interval of \
         an efficiency contains 1 there is no measurable difference. The warm-up of each setting is left out by rule."
            .into(),
    );
    notes.push(
        "Bias compares runs of equal seeds with the default's, so noise that both share is not in it; bias² \
         comes from \
         products of different runs and may come out negative where there is none."
            .into(),
    );
    notes
}

/// What the prices of effects are.
fn effects(notes: &mut Vec<String>) {
    notes.push(
        "Each effect: pairs of runs of equal seeds, with it and without it. Its share of the time is that of the \
         processor time to equal error, each picture's own as its film estimates it; below 0 the picture is dearer \
         without it. Seconds saved are processor seconds on the way to 1 %, by a slope of 1."
            .into(),
    );
    notes.push(
        "The error is the relative RMSE of the expected picture without the effect against that with it, by products \
         of different pairs: noise is no part of it, and 0 (< x) says that none above x was seen. FLIP is of the \
         means of the pairs, that of noise alone subtracted; noise hides small differences from it. Intervals are \
         of 95 % over pairs. A texture that is left out leaves its factor, a lobe the surface below it."
            .into(),
    );
}
