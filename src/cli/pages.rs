//! `pathspace completions` and `pathspace man`: made from the one definition of commands and flags.

use std::path::Path;

use super::args::Cli;
use super::output::{EXIT_OK, print, write_stdout};
use crate::error::{Error, Result};
use crate::film::atomic::write_atomically;

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

/// Writes `pathspace.1` and a page for each command, each whole or not at all.
///
/// # Errors
/// [`Error::Io`] naming the file.
pub fn manual(folder: &Path) -> Result<u8> {
    std::fs::create_dir_all(folder).map_err(|source| Error::io(folder, "make", source))?;
    let mut command = Cli::definition().disable_help_subcommand(true);
    command.build();
    let mut names = Vec::new();
    write_pages(&command, folder, &mut names)?;
    names.sort();
    print(&format!("{}\n", names.join("\n")))?;
    Ok(EXIT_OK)
}

/// As `clap_mangen::generate_to`, which leaves a page empty or cut off where it is killed.
fn write_pages(command: &clap::Command, folder: &Path, names: &mut Vec<String>) -> Result<()> {
    for command in command.get_subcommands().filter(|command| !command.is_hide_set()) {
        write_pages(command, folder, names)?;
    }
    let page = clap_mangen::Man::new(command.clone());
    let name = page.get_filename();
    write_atomically(&folder.join(&name), |file| page.render(file))?;
    names.push(name);
    Ok(())
}
