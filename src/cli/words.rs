//! Options as a command line for a shell of the POSIX kind.

/// The words of options, each with a space before it; quoted where a shell would read them as something else.
pub fn line(options: &[(String, Vec<String>)]) -> String {
    let mut line = String::new();
    for word in options.iter().flat_map(|(_, words)| words) {
        let plain = |c: char| c.is_ascii_alphanumeric() || "-_./,:=%+#".contains(c);
        line.push(' ');
        // A word that begins with # would be a comment.
        match !word.is_empty() && !word.starts_with('#') && word.chars().all(plain) {
            true => line.push_str(word),
            false => line.push_str(&format!("'{}'", word.replace('\'', r"'\''"))),
        }
    }
    line
}

/// `options` of a sequence for one of its frames alone.
pub fn of_frame(mut options: Vec<(String, Vec<String>)>, frame: u32) -> Vec<(String, Vec<String>)> {
    options.retain(|(option, _)| option != "frames");
    options.push(("frames".into(), vec!["--frames".into(), frame.to_string()]));
    options
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Oracle: the shell's rules of quoting.
    #[test]
    fn words_reach_a_shell_as_they_are() {
        let options = [["a b.gltf", "--size=8x8"], ["it's", "#204060"], ["f.##.exr", ""]]
            .map(|words| ("any".to_string(), words.map(String::from).to_vec()));
        assert_eq!(line(&options), r" 'a b.gltf' --size=8x8 'it'\''s' '#204060' f.##.exr ''");
    }
}
