//! A report as text: the tables of the terminal, and the rows of `report.csv`.

use super::class_tables;
use super::effects_page;
use super::report::{PriceRecord, Report, Row};
use super::runs::Interval;
use super::settings::Role;
use super::words::{range, signed, with_interval};
use crate::plot::number::short;

/// The tables that `pathspace accuracy` prints.
pub fn text(report: &Report) -> String {
    let s = &report.setup;
    let mut lines = vec![
        format!("scene      {}, {}x{} pixels", s.scene, s.resolution[0], s.resolution[1]),
        format!("machine    {}, {} threads, {}", s.cpu, s.threads, s.backend),
        format!("default    {}", s.options),
        format!("time       {:.1} s of {:.1} s, load and build {:.3} s", s.seconds, s.budget_s, s.fixed_s),
    ];
    if let Some(r) = &report.reference {
        let own = r.own_relmse.map_or("not known".into(), |own| format!("{:.3} %", percent(own.value)));
        lines.push(match r.spp {
            0 => format!("reference  {}; its own error {own}", r.what),
            spp => format!(
                "reference  {} runs of {spp} spp with seeds of their own; its own error {own}, subtracted",
                r.runs
            ),
        });
    }
    lines.push(String::new());
    prices(report, &mut lines);
    settings(report, &mut lines);
    knobs(report, &mut lines);
    lengths(report, &mut lines);
    if let Some(classes) = &report.classes {
        class_tables::text(classes, &mut lines);
    }
    effects_page::text(report, &mut lines);
    for note in &report.notes {
        lines.push(format!("* {note}"));
    }
    lines.push(String::new());
    lines.join("\n")
}

fn prices(report: &Report, lines: &mut Vec<String>) {
    if report.prices.is_empty() {
        return;
    }
    lines.push(
        "Price list: what an error costs (predicted by the pilot, 95 % interval), and what a run of it took".into(),
    );
    lines.push(format!(
        "{:>7}  {:>26}  {:>26}  {:>9} {:>9} {:>8} {:>9}",
        "error", "spp", "seconds", "spp run", "seconds", "error", "own est."
    ));
    for price in &report.prices {
        lines.push(price_line(price));
    }
    lines.push(String::new());
}

fn price_line(price: &PriceRecord) -> String {
    let predicted = format!(
        "{:>6} %  {:>26}  {:>26}",
        100.0 * price.error,
        predicted_text(price, &price.spp),
        predicted_text(price, &price.seconds)
    );
    let Some(m) = price.measured else { return format!("{predicted}  beyond the budget") };
    let error = |e: Option<f64>| e.map_or("-".into(), |e| format!("{:.2} %", 100.0 * e));
    let estimated = error(m.estimated.map(|e| e.value));
    format!("{predicted}  {:>9} {:>9} {:>8} {estimated:>9}", m.spp, short(m.seconds), error(m.error))
}

/// A prediction with its interval, or what the pilot's tail leaves of it.
pub fn predicted_text(price: &PriceRecord, of: &Interval) -> String {
    match price.caution {
        Some(_) => format!("at least {}", short(of.low)),
        None => with_interval(of, 1.0),
    }
}

fn settings(report: &Report, lines: &mut Vec<String>) {
    let rows: Vec<&Row> = report.settings.iter().filter(|row| row.role != Role::Knob).collect();
    let Some(first) = rows.first() else { return };
    lines.push(format!("Techniques at {} spp, {} runs of each", first.spp, first.runs));
    let width = rows.iter().map(|row| row.name.len()).max().unwrap_or(0).max("setting".len());
    lines.push(format!(
        "{:width$}  {:>22}  {:>14}  {:>9}  {:>40}  {:>20}",
        "setting", "error %", "slope", "ms/spp", "efficiency", "seconds to 1 %"
    ));
    for row in rows {
        let slope = row.slope.map_or("-".into(), |[s, e]| format!("{s:.3} ± {e:.3}"));
        lines.push(format!(
            "{:width$}  {:>22}  {slope:>14}  {:>9}  {:>40}  {:>20}",
            row.name,
            row.relmse.map_or("-".into(), |r| with_interval(&r.map(error_of), 100.0)),
            row.cpu_s_per_spp.map_or("-".into(), |c| short(1e3 * c.value)),
            efficiency(row),
            row.seconds_to_1_percent.map_or("-".into(), |s| with_interval(&s, 1.0)),
        ));
    }
    lines.push(String::new());
}

fn knobs(report: &Report, lines: &mut Vec<String>) {
    let rows: Vec<&Row> = report.settings.iter().filter(|row| row.role != Role::Technique).collect();
    let Some(first) = rows.iter().find(|row| row.role == Role::Knob) else { return };
    lines
        .push(format!("Knobs: bias against the default (the default's own: against the reference), {} spp", first.spp));
    let width = rows.iter().map(|row| row.name.len()).max().unwrap_or(0).max("setting".len());
    lines.push(format!(
        "{:width$}  {:>30}  {:>32}  {:>9}  {:>24}",
        "setting", "mean error %", "bias²", "bias %", "time saved %"
    ));
    for row in rows {
        lines.push(format!(
            "{:width$}  {:>30}  {:>32}  {:>9}  {:>24}",
            row.name,
            row.mean_error.map_or("-".into(), |m| signed(&m, 100.0)),
            row.bias_squared.map_or("-".into(), |b| signed(&b, 1.0)),
            row.bias_squared.map_or("-".into(), |b| bias_percent(&b)),
            row.time_ratio.map_or("-".into(), |t| signed(&saved(&t), 100.0)),
        ));
    }
    lines.push(String::new());
}

fn lengths(report: &Report, lines: &mut Vec<String>) {
    let Some(l) = &report.lengths else { return };
    lines.push("Path lengths: share of the mean, and what a depth limit there leaves out".into());
    lines.push(format!("{:>5}  {:>26}  {:>30}", "edges", "share %", "mean error %"));
    for (i, share) in l.share.iter().enumerate() {
        let name = if i + 1 == l.share.len() { format!("{}+", i + 1) } else { (i + 1).to_string() };
        let truncation = l.truncation.get(i).map_or("-".into(), |t| signed(t, 100.0));
        lines.push(format!("{name:>5}  {:>26}  {truncation:>30}", with_interval(share, 100.0)));
    }
    let own = short(100.0 * l.default_truncation);
    lines.push(format!("default's own depth limit: about {own} % (geometric tail)"));
    lines.push(String::new());
}

/// Relative RMSE of a relMSE; 0 where noise made it negative.
pub fn error_of(relmse: f64) -> f64 {
    relmse.max(0.0).sqrt()
}

fn percent(relmse: f64) -> f64 {
    100.0 * error_of(relmse)
}

/// Time saved, from a ratio of times.
pub fn saved(ratio: &Interval) -> Interval {
    Interval { value: 1.0 - ratio.value, low: 1.0 - ratio.high, high: 1.0 - ratio.low }
}

/// √bias² in percent, or the largest that is compatible with the runs where none was seen.
pub fn bias_percent(squared: &Interval) -> String {
    match (squared.low > 0.0, squared.high.is_finite()) {
        _ if squared.high == 0.0 => "0".into(),
        (true, _) => short(percent(squared.value)),
        (false, true) => format!("< {}", short(percent(squared.high))),
        _ => "-".into(),
    }
}

/// The ratio and what it means.
pub fn efficiency(row: &Row) -> String {
    match &row.efficiency {
        Some(e) if e.high.is_finite() && row.no_measurable_difference => {
            format!("no measurable difference {}", range(e))
        }
        Some(e) => with_interval(e, 1.0),
        None if row.role == Role::Default => "1".into(),
        None => "-".into(),
    }
}

/// The settings as comma-separated values, a header first. Empty fields are unknown.
pub fn csv(report: &Report) -> String {
    let mut lines = vec![
        "setting,role,spp,runs,relmse,relmse_low,relmse_high,slope,slope_stderr,cpu_s_per_spp,wall_s_per_spp,\
         time_ratio,time_ratio_low,time_ratio_high,efficiency,efficiency_low,efficiency_high,seconds_to_1_percent,\
         mean_error,mean_error_low,mean_error_high,bias_squared,bias_squared_low,bias_squared_high,p50,p95,p999,flip"
            .to_string(),
    ];
    let field = |v: f64| if v.is_finite() { format!("{v:e}") } else { String::new() };
    let three = |i: &Option<Interval>| i.map_or(vec![String::new(); 3], |i| [i.value, i.low, i.high].map(field).into());
    let one = |i: &Option<Interval>| i.map_or(String::new(), |i| field(i.value));
    for row in &report.settings {
        let mut fields = vec![row.name.clone(), format!("{:?}", row.role).to_lowercase()];
        fields.extend([row.spp.to_string(), row.runs.to_string()]);
        fields.extend(three(&row.relmse));
        fields.extend(row.slope.map_or([String::new(), String::new()], |s| s.map(field)));
        fields.extend([one(&row.cpu_s_per_spp), one(&row.wall_s_per_spp)]);
        fields.extend(three(&row.time_ratio));
        fields.extend(three(&row.efficiency));
        fields.push(one(&row.seconds_to_1_percent));
        fields.extend(three(&row.mean_error));
        fields.extend(three(&row.bias_squared));
        fields.extend(row.percentiles.map(field));
        fields.push(one(&row.flip));
        lines.push(fields.join(","));
    }
    lines.push(String::new());
    lines.join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_about_three_digits() {
        let shown = [0.0, 1234.0, 12.34, 1.234, 0.1234, 0.01234, 1.2e-5, -0.5, 2.5e7].map(short);
        assert_eq!(shown, ["0", "1234", "12.3", "1.23", "0.123", "0.0123", "1.2e-5", "-0.500", "2.50e7"]);
        let i = Interval { value: 0.5, low: 0.25, high: 1.0 };
        assert_eq!(with_interval(&i, 100.0), "50.0 (25.0 to 100)");
        assert_eq!(with_interval(&Interval::around(2.0, f64::INFINITY), 1.0), "2.00");
        assert_eq!(signed(&Interval::around(-1.0, 1.0), 1.0), "-1.00 (-2.00 to 0)");
        assert_eq!(saved(&i), Interval { value: 0.5, low: 0.0, high: 0.75 });
        assert_eq!(bias_percent(&Interval { value: 1e-4, low: 1e-5, high: 1e-3 }), "1.00");
        assert_eq!(bias_percent(&Interval { value: -1e-9, low: -1e-4, high: 1e-4 }), "< 1.00");
    }
}
