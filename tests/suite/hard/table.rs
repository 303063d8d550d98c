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
    ("GLBPMRI".find(&id[..1]).unwrap_or(9), id.to_owned())
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

fn markdown(records: &[Record]) -> String {
    let mut text = String::from(
        "# Hard cases\n\nWritten by `make hard`. σ: standard errors of a mean; other differences are relative to what was \
         expected unless it was 0. Slow cases take more than 10 s in a debug build.\n\n\
         | case | stresses | on | expected | got | difference | verdict |\n| --- | --- | --- | --- | --- | --- | --- |\n",
    );
    for record in records {
        let slow = if record.seconds > SLOW_S { " (slow)" } else { "" };
        for row in &record.rows {
            let cells = [
                &format!("{} {}{slow}", record.id, record.name),
                &record.stresses,
                &row.on,
                &row.expected,
                &row.got,
                &row.difference,
                verdict(row.passed),
            ];
            let _ = writeln!(text, "| {} |", cells.map(|c: &str| c.replace('|', "\\|")).join(" | "));
        }
    }
    text
}
