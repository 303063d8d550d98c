//! Records that have JSON as rows of a table, by the names that they have there.

use serde::Serialize;
use serde_json::Value;

use crate::plot::number::short;
use crate::plot::svg::escaped;

/// Rows of name and value, as markup, but for the keys `left_out`; names of parts are joined by dots.
pub fn rows(record: &impl Serialize, left_out: &[&str]) -> Vec<Vec<String>> {
    let mut rows = Vec::new();
    let Ok(Value::Object(fields)) = serde_json::to_value(record) else { return rows };
    for (name, value) in fields.iter().filter(|(name, _)| !left_out.contains(&name.as_str())) {
        add(name, value, &mut rows);
    }
    rows
}

fn add(name: &str, value: &Value, rows: &mut Vec<Vec<String>>) {
    match value {
        Value::Object(fields) => fields.iter().for_each(|(key, value)| add(&format!("{name}.{key}"), value, rows)),
        Value::Array(values) if values.iter().any(|value| value.is_object() || value.is_array()) => {
            values.iter().enumerate().for_each(|(i, value)| add(&format!("{name}[{i}]"), value, rows));
        }
        Value::Array(values) => row(name, &values.iter().map(text).collect::<Vec<_>>().join(", "), rows),
        value => row(name, &text(value), rows),
    }
}

fn row(name: &str, value: &str, rows: &mut Vec<Vec<String>>) {
    let value = if value.is_empty() { "–".into() } else { format!("<span class=\"long\">{}</span>", escaped(value)) };
    rows.push(vec![format!("<code>{}</code>", escaped(name)), value]);
}

/// Counts in full, other numbers with three digits.
fn text(value: &Value) -> String {
    match value {
        Value::Null => "–".into(),
        Value::String(text) => text.clone(),
        Value::Number(number) if number.is_f64() => short(number.as_f64().unwrap_or(f64::NAN)),
        other => other.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_value_has_a_row() {
        let record = serde_json::json!({
            "a": {"b": 1.23456, "c": [1, 2]}, "d": [{"e": null}], "f": "<&", "g": true, "h": [], "i": 7,
        });
        let plain = |cell: &String| {
            cell.replace("<code>", "")
                .replace("</code>", "")
                .replace("<span class=\"long\">", "")
                .replace("</span>", "")
        };
        let found: Vec<String> =
            rows(&record, &["i"]).iter().map(|row| row.iter().map(plain).collect::<Vec<_>>().join("=")).collect();
        assert_eq!(found, ["a.b=1.23", "a.c=1, 2", "d[0].e=–", "f=&lt;&amp;", "g=true", "h=–"]);
    }
}
