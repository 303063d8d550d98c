//! Reads the records of a run and prints them as one table; the same as Markdown. `make hard` calls it after the cases.

use std::fmt::Write as _;
use std::path::PathBuf;

use super::{REPORT, Record};

/// Cases that take longer than this are marked.
const SLOW_S: f64 = 10.0;

#[test]
#[ignore = "`make hard` runs it, after the cases"]
fn print() {
    let folder = PathBuf::from(std::env::var_os(REPORT).expect("PATHSPACE_HARD names the folder of the records"));
    let mut records: Vec<Record> = std::fs::read_dir(&folder)
        .expect("the records' folder")
        .map(|entry| entry.expect("an entry").path())
        .filter(|path| path.extension().is_some_and(|e| e == "json"))
        .map(|path| serde_json::from_slice(&std::fs::read(path).expect("a record")).expect("a whole record"))
        .collect();
    records.sort_by_key(|record| order(&record.id));
    print!("{}", plain(&records));
    std::fs::write(folder.join("HARD.md"), markdown(&records)).expect("the table");
}

/// Themes in the order of the specification.
fn order(id: &str) -> (usize, String) {
    ("GLBPMRIXVWT".find(&id[..1]).unwrap_or(99), id.to_owned())
}

fn verdict(passed: bool) -> &'static str {
    if passed { "ok" } else { "FAILED" }
}

fn plain(records: &[Record]) -> String {
    let mut text = String::new();
    for record in records {
        let slow = if record.seconds > SLOW_S { ", slow" } else { "" };
        let _ = writeln!(text, "\n{} {} ({}; {:.1} s{slow})", record.id, record.name, record.stresses, record.seconds);
        for row in &record.rows {
            let _ = writeln!(
                text,
                "  {:<34} expected {:<24} got {:<32} {:<28} {}",
                row.on,
                row.expected,
                row.got,
                row.difference,
                verdict(row.passed)
            );
        }
    }
    let rows = records.iter().map(|r| r.rows.len()).sum::<usize>();
    let failed = records.iter().flat_map(|r| &r.rows).filter(|row| !row.passed).count();
    let _ = writeln!(text, "\n{} cases, {rows} verdicts, {failed} failed", records.len());
    text
}

/// Columns of the Markdown table: the backends by the first word of a row's `on`, and all else.
const COLUMNS: [&str; 6] = ["embree", "obvhs", "flat", "brute", "auto", "other"];

/// Longest line of a document, bytes.
const LINE_BYTES: usize = 120;

/// The column of a verdict.
fn column(on: &str) -> usize {
    let word = on.split(|c: char| !c.is_ascii_alphabetic()).next().unwrap_or("");
    COLUMNS.iter().position(|name| *name == word).unwrap_or(COLUMNS.len() - 1)
}

/// The standard errors of a difference that is stated in them.
fn sigmas(difference: &str) -> Option<f64> {
    difference.split_once(" σ")?.0.parse().ok()
}

/// One row a case: verdicts for each column, as `5`, or `4/5` where one failed, and the largest deviation of a mean.
fn markdown(records: &[Record]) -> String {
    let rows = || records.iter().flat_map(|r| &r.rows);
    let mut text = format!(
        "# Hard cases\n\n\
         Written by `make hard`, which also prints what each verdict expected and got. Columns count verdicts by\n\
         backend, over all its ray modes; `auto` is the backend that the plan chooses, `other` what is not traced or\n\
         compares backends. `4/5`: one of five failed. σ: largest deviation of a mean from what is expected, in\n\
         standard errors; 4.9 is the limit. A star marks cases of more than 10 s in a debug build.\n\n\
         {} cases, {} verdicts, {} failed.\n\n\
         | case | what | stresses | {} | σ |\n|{}\n",
        records.len(),
        rows().count(),
        rows().filter(|row| !row.passed).count(),
        COLUMNS.join(" | "),
        " --- |".repeat(COLUMNS.len() + 4),
    );
    for record in records {
        let mut line = format!(
            "| {}{} | {} | {} |",
            record.id,
            if record.seconds > SLOW_S { "*" } else { "" },
            record.name.replace('|', "\\|"),
            record.stresses.replace('|', "\\|"),
        );
        for c in 0..COLUMNS.len() {
            let here: Vec<_> = record.rows.iter().filter(|row| column(&row.on) == c).collect();
            let _ = match (here.iter().filter(|row| row.passed).count(), here.len()) {
                (_, 0) => write!(line, "|"),
                (passed, all) if passed == all => write!(line, "{all}|"),
                (passed, all) => write!(line, "{passed}/{all}|"),
            };
        }
        if let Some(worst) = record.rows.iter().filter_map(|row| sigmas(&row.difference)).reduce(f64::max) {
            let _ = write!(line, "{worst:.1}");
        }
        line.push('|');
        assert!(line.len() <= LINE_BYTES, "shorten what {} is called: {} bytes", record.id, line.len());
        let _ = writeln!(text, "{line}");
    }
    text
}

#[test]
fn one_row_a_case() {
    let row = |on: &str, difference: &str, passed| super::Row {
        on: on.into(),
        expected: String::new(),
        got: String::new(),
        difference: difference.into(),
        passed,
    };
    let rows = vec![
        row("embree/packet16, far", "1.25 σ", true),
        row("embree/single", "2.31 σ, too noisy to judge", false),
        row("flat", "0", true),
        row("- (closed form)", "3e-9 (bound 1e-8)", true),
    ];
    let record = Record { id: "G01".into(), name: "a|b".into(), stresses: "c".into(), seconds: 11.0, rows };
    assert!(markdown(&[record]).ends_with("\n| G01* | a\\|b | c |1/2||1|||1|2.3|\n"));
}
