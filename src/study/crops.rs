//! What an error looks like: the liveliest window of the picture at each error of the price list that people ask for,
//! side by side and before the reference, with what each took: samples, seconds, money, energy.

use super::findings::Study;
use super::reference::Reference;
use super::report::{PriceRecord, Report};
use crate::film::png;
use crate::plot::html::{self, Page};
use crate::plot::number::short;

/// Errors from which on they are shown.
const LEAST_ERROR: f64 = 0.01;

/// Most columns and rows of a crop.
const SIDE: usize = 96;

/// Steps between windows that are compared.
const STEP: usize = 8;

/// Puts the crops onto the page.
pub fn section(report: &Report, study: &Study, page: &mut Page) {
    let [width, height] = report.setup.resolution.map(|side| side as usize);
    let Some(reference) = study.reference.as_ref().filter(|r| r.values.len() == 3 * width * height) else { return };
    if study.price_pictures.is_empty() {
        return;
    }
    let window = Window::liveliest(reference, (width, height));
    let shown = report.prices.iter().zip(0..).filter(|(price, _)| price.error >= LEAST_ERROR);
    let mut figures: Vec<String> = shown
        .filter_map(|(price, place): (&PriceRecord, usize)| {
            let picture = study.price_pictures.get(place)?;
            let drawn = window.drawn(|i| f64::from(picture[i]), &format!("error of {} %", 100.0 * price.error));
            Some(html::figure(&drawn, &legend(price, report)))
        })
        .collect();
    let beyond = report.prices.iter().skip(figures.len()).find(|price| price.error >= LEAST_ERROR);
    figures.push(html::figure(&window.drawn(|i| reference.values[i], "the reference"), "<b>The reference</b>"));
    page.heading("What an error looks like");
    page.markup("<div class=\"pair many\">\n");
    figures.iter().for_each(|figure| page.markup(figure));
    page.markup("</div>\n");
    if let Some(price) = beyond {
        let (percent, seconds) = (100.0 * price.error, short(price.seconds.value));
        page.paragraph(&format!("{percent} % was beyond the budget: it takes about {seconds} s."));
    }
    page.paragraph(&terms(report));
}

/// What a picture of that error took.
fn legend(price: &PriceRecord, report: &Report) -> String {
    let mut legend = format!("<b>{} %</b>", 100.0 * price.error);
    let Some(run) = price.measured else { return legend };
    legend += &format!(": {} spp, {} s", run.spp, short(run.seconds));
    if let Some(money) = run.money {
        legend += &format!(", costs {}", short(money));
    }
    if let Some(joules) = run.joules {
        legend += &format!(", {} J", short(joules));
    }
    if let Some(error) = run.error {
        legend += &format!("<br><small>{} % off the reference</small>", short(100.0 * error));
    }
    let [[w, h], [rw, rh]] = [report.setup.resolution, report.setup.render_resolution].map(|size| size.map(f64::from));
    if [rw, rh] != [w, h] && rw * rh > 0.0 {
        let grown = (rw * rh) / (w * h);
        let fixed = report.setup.fixed_s;
        let seconds = fixed + grown * (run.seconds - fixed);
        let money = run.money.map_or(String::new(), |money| format!(", {}", short(money * seconds / run.seconds)));
        legend += &format!("<br><small>{rw} × {rh}: about {} s{money}</small>", short(seconds));
    }
    legend
}

/// What the numbers are.
fn terms(report: &Report) -> String {
    let mut terms = format!(
        "Relative RMSE of the whole picture; seconds with load and build, on {} threads.",
        report.setup.threads
    );
    if let Some(price) = report.setup.price_per_core_hour {
        terms += &format!(" Costs at {} a core and hour, for as many cores as threads.", short(price));
    }
    if report.prices.iter().any(|price| price.measured.is_some_and(|run| run.joules.is_some())) {
        terms += " Joules: of the processor packages while it rendered, others' work included.";
    }
    terms
}

/// A window of the picture.
struct Window {
    columns: usize,
    place: (usize, usize),
    size: (usize, usize),
}

impl Window {
    /// The one with the most change from pixel to pixel as displayed; the first of equals.
    fn liveliest(reference: &Reference, (width, height): (usize, usize)) -> Self {
        let luma: Vec<f64> = (reference.values.chunks_exact(3))
            .map(|rgb| rgb.iter().map(|value| f64::from(png::srgb_byte(*value))).sum())
            .collect();
        let size = (width.min(SIDE), height.min(SIDE));
        let change = |(x, y): (usize, usize)| -> f64 {
            let row = |y: usize| luma[y * width + x..][..size.0].windows(2).map(|pair| (pair[1] - pair[0]).abs());
            (y..y + size.1).flat_map(row).sum()
        };
        let mut best = ((0, 0), f64::NEG_INFINITY);
        for y in (0..=height - size.1).step_by(STEP) {
            for x in (0..=width - size.0).step_by(STEP) {
                let change = change((x, y));
                if change > best.1 {
                    best = ((x, y), change);
                }
            }
        }
        Window { columns: width, place: best.0, size }
    }

    /// The window of a picture whose numbers `value` tells, as markup.
    fn drawn(&self, value: impl Fn(usize) -> f64, alt: &str) -> String {
        let ((x, y), (w, h)) = (self.place, self.size);
        let numbers = (y..y + h).flat_map(|row| 3 * (row * self.columns + x)..3 * (row * self.columns + x + w));
        let bytes: Vec<u8> = numbers.map(|i| png::srgb_byte(value(i))).collect();
        let size = (w as u32, h as u32);
        html::picture(&png::encode_rgb(&bytes, size.0, size.1), size, alt)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Oracle: a grey picture with a checkerboard in one corner.
    #[test]
    fn the_window_is_where_things_happen() {
        let (width, height) = (200, 150);
        let lively = |p: usize| p % width >= 120 && p / width >= 80 && (p % width + p / width).is_multiple_of(2);
        let values = (0..3 * width * height).map(|i| if lively(i / 3) { 1.0 } else { 0.2 }).collect();
        let window = Window::liveliest(&Reference::of_values(values, None), (width, height));
        assert_eq!((window.place, window.size), ((104, 48), (96, 96)));
        let small = Window::liveliest(&Reference::of_values(vec![0.5; 3 * 12], None), (4, 3));
        assert_eq!((small.place, small.size), ((0, 0), (4, 3)));
        assert!(small.drawn(|_| 0.5, "grey").contains("width=\"4\" height=\"3\""));
    }
}
