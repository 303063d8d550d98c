//! Where the noise comes from, as tables: for the terminal and for the page.

use super::classes::{Classes, Part};
use super::runs::Interval;
use crate::plot::html::Page;
use crate::plot::number::short;
use crate::plot::svg::escaped;

/// Parts that carry less than this share of both mean and noise are left out of the terminal's tables.
const NOTHING: f64 = 5e-5;

fn percent(share: f64) -> String {
    short(100.0 * share)
}

fn with_interval(share: &Interval) -> String {
    format!("{} ({} to {})", percent(share.value), percent(share.low), percent(share.high))
}

/// Relative RMSE of a relMSE; 0 where an interval reaches below.
fn error_of(relmse: f64) -> f64 {
    relmse.max(0.0).sqrt()
}

/// What was looked at, and how the noise lies among pixels and paths.
fn summary(classes: &Classes) -> String {
    let Classes { paths, pixels, seeds, spp, relmse, relmse_of_all, .. } = classes;
    let missed = if *relmse_of_all > 2.0 * relmse.high {
        " Most of the noise lies in pixels that were not looked at: --classes=PATHS looks at more."
    } else {
        ""
    };
    format!(
        "{paths} paths of {pixels} pixels in {seeds} pictures of {spp} spp: error {} %; of all pixels {} %, of whose \
         square the worst 0.1 % of the pixels carry {} %. The worst 0.1 % of the paths carry {} % of the \
         squares.{missed}",
        with_interval(&relmse.map(error_of)),
        percent(error_of(*relmse_of_all)),
        percent(classes.worst_pixels),
        percent(classes.worst_paths),
    )
}

/// The tables of the terminal.
pub fn text(classes: &Classes, lines: &mut Vec<String>) {
    lines.push("Classes of paths: shares of the mean and of the noise (relMSE)".into());
    lines.push(summary(classes));
    for (title, parts) in [("class", &classes.classes), ("edges", &classes.edges)] {
        lines.push(format!(
            "{title:<16}  {:>8}  {:>28}  {:>8}  {:>14}  {:>8}{}",
            "mean %",
            "noise %",
            "alone %",
            "in worst 0.1 %",
            "paths %",
            if title == "class" { "  paths E … L" } else { "" }
        ));
        let counts = |part: &&Part| part.mean.abs().max(part.noise.value.abs()) > NOTHING;
        for part in parts.iter().filter(counts) {
            let what = if title == "class" { format!("  {}", part.what) } else { String::new() };
            lines.push(format!(
                "{:<16}  {:>8}  {:>28}  {:>8}  {:>14}  {:>8}{what}",
                part.name,
                percent(part.mean),
                with_interval(&part.noise),
                percent(part.alone),
                percent(part.worst),
                percent(part.paths),
            ));
        }
    }
    lines.push(String::new());
}

/// The section of the page.
pub fn section(classes: &Classes, page: &mut Page) {
    page.heading("Where the noise comes from");
    page.paragraph(&summary(classes));
    let cells = |part: &Part| {
        let noise = part.noise.map(|share| 100.0 * share);
        vec![
            format!("{}<small>{}</small>", escaped(&part.name), escaped(&part.what)),
            percent(part.mean),
            format!("{}<small>{} to {}</small>", short(noise.value), short(noise.low), short(noise.high)),
            percent(part.alone),
            percent(part.worst),
            percent(part.paths),
        ]
    };
    for (title, parts) in [("class of path", &classes.classes), ("edges", &classes.edges)] {
        let head = [
            title,
            "mean, %",
            "noise, %",
            "noise alone, %",
            "of its squares in the worst 0.1 % of paths, %",
            "paths, %",
        ];
        page.table(&head, &parts.iter().map(cells).collect::<Vec<_>>());
    }
    page.paragraph(
        "E is the eye, L the light; S is scattered without a density (mirror, smooth glass), N so or by a lobe of a \
         GGX alpha of at most 0.2, D by any other than S; + is one or more, … any. Noise: the covariance of a class \
         with the picture over pictures of different seeds, as a share of the picture's variance, weighed as relMSE \
         is; shares add up to 100 %. Alone: the variance of the class's own picture. Where few paths carry most of \
         a class, its interval is too narrow.",
    );
}
