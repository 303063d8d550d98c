//! Text from files as text: what would move a terminal's cursor, set its title or turn its lines around is written as
//! an escape. Names come from files, and files from anybody.

use std::borrow::Cow;

/// Text for a terminal. Lines and tabs stay.
pub fn plain(text: &str) -> Cow<'_, str> {
    if text.chars().any(is_active) { Cow::Owned(escaped(text, is_active)) } else { Cow::Borrowed(text) }
}

/// A name on one line: as [`plain`], without lines and tabs.
pub fn one_line(text: &str) -> String {
    escaped(text, |c| is_active(c) || c.is_control())
}

fn escaped(text: &str, active: impl Fn(char) -> bool) -> String {
    let mut plain = String::with_capacity(text.len());
    for c in text.chars() {
        if active(c) { plain.extend(c.escape_default()) } else { plain.push(c) }
    }
    plain
}

/// Control characters, line separators, and those that change the direction of writing.
fn is_active(c: char) -> bool {
    (c.is_control() && !matches!(c, '\n' | '\t'))
        || matches!(c, '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Oracle: Unicode's names of the characters. Deterministic.
    #[test]
    fn what_acts_on_a_terminal_is_escaped() {
        assert_eq!(plain("a\tß\n日本"), "a\tß\n日本");
        assert_eq!(plain("\u{1b}[2J\u{9b}\u{202e}x\r"), r"\u{1b}[2J\u{9b}\u{202e}x\r");
        assert_eq!(one_line("a\nb\u{7f}"), r"a\nb\u{7f}");
    }
}
