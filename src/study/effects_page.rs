//! The price of effects as people read it: the table of the terminal, and the part of the page with pictures.

use super::effects::{EffectRow, Kind};
use super::effects_plot;
use super::findings::Study;
use super::report::Report;
use super::runs::Interval;
use super::words::{signed, with_interval};
use crate::film::png;
use crate::plot::html::{self, Page, mark};
use crate::plot::number::short;
use crate::plot::svg::{COLOURS, escaped};

const HEAD: [&str; 9] = [
    "effect",
    "share of time %",
    "s saved to 1 %",
    "rays a path, with and without",
    "error without %",
    "where",
    "FLIP without",
    "mean %",
    "error %/s",
];

/// The error, or what it is below where none was seen.
fn error(squared: &Interval) -> String {
    let percent = |squared: f64| short(100.0 * squared.max(0.0).sqrt());
    match (squared.low > 0.0, squared.high.is_finite()) {
        (true, _) => format!("{} ({} to {})", percent(squared.value), percent(squared.low), percent(squared.high)),
        (false, true) if squared.high <= 0.0 => "0".into(),
        (false, true) => format!("0 (< {})", percent(squared.high)),
        (false, false) => "-".into(),
    }
}

fn cells(row: &EffectRow) -> Vec<String> {
    if let Some(why) = &row.not_measured {
        return vec![row.name.clone(), why.clone()];
    }
    let or_dash = |text: Option<String>| text.unwrap_or_else(|| "-".into());
    let [with, without] = row.rays_per_path.map(short);
    vec![
        row.name.clone(),
        or_dash(row.time_share.map(|share| signed(&share, 100.0))),
        or_dash(row.seconds_saved.map(short)),
        format!("{with} {without}"),
        or_dash(row.error_squared.map(|squared| error(&squared))),
        or_dash(row.place.map(|place| {
            format!("{} % in {}", short(100.0 * place.share), place.crop.map(|side| side.to_string()).join(","))
        })),
        or_dash(row.flip.map(|flip| with_interval(&flip, 1.0))),
        or_dash(row.mean_change.map(|change| signed(&change, 100.0))),
        or_dash(row.error_per_second.map(|rate| short(100.0 * rate))),
    ]
}

/// Adds the table to the `lines` of the terminal.
pub fn text(report: &Report, lines: &mut Vec<String>) {
    let Some(rows) = &report.effects else { return };
    if rows.is_empty() {
        lines.extend(["Effects: this scene calls for none that can be left out".into(), String::new()]);
        return;
    }
    lines.push("Effects: what each takes, and what --without it loses; cheapest to leave out first".into());
    let table: Vec<Vec<String>> =
        std::iter::once(HEAD.map(String::from).to_vec()).chain(rows.iter().map(cells)).collect();
    let width = |column: usize| {
        let cells = table.iter().filter(|row| row.len() == HEAD.len());
        cells.map(|row| row[column].chars().count()).max().unwrap_or(0)
    };
    let name = table.iter().map(|row| row[0].chars().count()).max().unwrap_or(0);
    for row in &table {
        let rest = row.iter().enumerate().skip(1).map(|(column, cell)| match row.len() == HEAD.len() {
            true => format!("  {cell:>0$}", width(column)),
            false => format!("  {cell}"),
        });
        lines.push(format!("{:name$}{}", row[0], rest.collect::<String>()));
    }
    lines.extend(remarks(rows).into_iter().map(|remark| format!("  {remark}")));
    lines.push(String::new());
}

/// What rows of some kinds mean, and which the budget did not reach.
fn remarks(rows: &[EffectRow]) -> Vec<String> {
    let has = |kind: Kind| rows.iter().any(|row| row.kind == kind && row.not_measured.is_none());
    let mut remarks = Vec::new();
    if has(Kind::Technique) {
        remarks.push(
            "technique: the others find the same light, so none of them changes the expected picture: its error is 0 \
             within the interval, but for light that no other finds; the price of leaving it out is time"
                .into(),
        );
    }
    if has(Kind::Choice) {
        remarks.push("--option: with it in the place of the present choice, not without".into());
    }
    if has(Kind::Length) {
        remarks.push("depth:N: without paths of more than N edges".into());
    }
    let beyond: Vec<&str> = rows.iter().filter(|row| row.not_measured.is_some()).map(|row| &*row.name).collect();
    if !beyond.is_empty() {
        let (count, names) = (beyond.len(), beyond.join(", "));
        remarks.push(format!("not measured, {count} of {}: {names}; a larger --budget helps", rows.len()));
    }
    remarks
}

/// Adds the table and the pictures to the page.
pub fn html(report: &Report, study: &Study, page: &mut Page) {
    let Some(rows) = report.effects.as_ref().filter(|rows| !rows.is_empty()) else { return };
    page.heading("Effects: what each costs, and what would be lost without it");
    let cells = |row: &EffectRow| -> Vec<String> {
        let mut cells: Vec<String> = cells(row).iter().map(|cell| escaped(cell)).collect();
        cells.resize(HEAD.len(), String::new());
        cells
    };
    page.table(&HEAD, &rows.iter().map(cells).collect::<Vec<_>>());
    page.paragraph("Sorted by the error for a second that leaving the effect out saves: cheapest to leave out first.");
    for remark in remarks(rows) {
        page.paragraph(&escaped(&remark));
    }
    let seen = effects_plot::seen(report);
    if !seen.is_empty() {
        let marks = seen.iter().enumerate().map(|(i, row)| mark(i % COLOURS, &format!("{} {}", i + 1, row.name)));
        let legend = marks.collect::<String>() + "Only what was seen to be missing is drawn. Bars: 95 %.";
        page.figure(&effects_plot::svg(report), &legend);
    }
    let [w, h] = report.setup.resolution;
    for shown in &study.shown {
        let picture = |values: &[f32], alt: &str| {
            let bytes: Vec<u8> = values.iter().map(|v| png::srgb_byte(f64::from(*v))).collect();
            html::picture(&png::encode_rgb(&bytes, w, h), (w, h), alt)
        };
        let figure = |values: &[f32], alt: String| html::figure(&picture(values, &alt), &escaped(&alt));
        let [with, without] = &shown.pictures;
        let percent = short(100.0 * shown.error);
        page.pair([
            figure(with, format!("with {}", shown.name)),
            figure(without, format!("without {}: {percent} % relative RMSE", shown.name)),
        ]);
    }
}
