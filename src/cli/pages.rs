//! `pathspace completions` and `pathspace man`: made from the one definition of commands and flags.

use std::path::Path;

use super::args::Cli;
use super::output::{EXIT_OK, print, write_stdout};
use crate::error::{Error, Result};

/// Prints the completions of a shell.
///
/// # Errors
/// Those of stdout.
pub fn completions(shell: clap_complete::Shell) -> Result<u8> {
    let mut text = Vec::new();
    clap_complete::generate(shell, &mut Cli::definition(), "pathspace", &mut text);
    write_stdout(&text)?;
    Ok(EXIT_OK)
}

/// Writes `pathspace.1` and a page for each command.
///
/// # Errors
/// [`Error::Io`] naming the file.
pub fn manual(folder: &Path) -> Result<u8> {
    std::fs::create_dir_all(folder).map_err(|source| Error::io(folder, "make", source))?;
    let failed = |source| Error::io(folder, "write the pages to", source);
    clap_mangen::generate_to(Cli::definition(), folder).map_err(failed)?;
    let files = std::fs::read_dir(folder).map_err(failed)?.flatten().map(|file| file.file_name());
    let mut names: Vec<String> = files.map(|name| name.to_string_lossy().into_owned()).collect();
    names.retain(|name| name.starts_with("pathspace") && name.ends_with(".1"));
    names.sort();
    print(&format!("{}\n", names.join("\n")))?;
    Ok(EXIT_OK)
}
