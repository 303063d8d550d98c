//! The command line: [`args`] (raw, typed) → [`job`] (validated against the scene) → one module per subcommand →
//! [`report`] and [`progress`]. stdout carries only what was asked for (JSON, tables, `--progress ndjson`); everything
//! else goes to stderr. Nothing here computes light.

pub mod accuracy;
pub mod args;
pub mod bench;
pub mod compare;
mod denoising;
pub mod doctor;
pub mod exr;
pub mod farm;
mod frames;
mod html;
pub mod info;
pub mod job;
mod keeping;
pub mod live;
pub mod looks;
pub mod merge;
mod output;
mod pages;
pub mod production;
pub mod progress;
mod quick;
pub mod render;
pub mod replay;
pub mod report;
mod sequence;
pub mod signal;
mod suite;
mod terminal;
pub mod units;
pub mod verify;
pub mod view;
mod waiting;
pub mod words;

use crate::error::{Error, Result};
use crate::machine;
use args::{Cli, Command};

/// Runs one command and returns its exit code.
///
/// # Errors
/// Whatever stopped the command; [`Error::exit_code`](crate::Error::exit_code) says how the process should end.
pub fn run(cli: &Cli) -> Result<u8> {
    signal::survive_file_limits()?;
    let exit = dispatch(cli)?;
    signal::explain(exit);
    Ok(exit)
}

fn dispatch(cli: &Cli) -> Result<u8> {
    let threads = match &cli.command {
        Command::Render(args) => args.settings.threads,
        Command::Verify(args) => args.threads,
        Command::Bench(args) => args.settings.threads,
        Command::Accuracy(args) => args.settings.threads,
        Command::View(args) => args.settings.threads,
        Command::Info(args) => args.settings.threads,
        Command::Compare(_) | Command::Merge(_) | Command::Farm(_) | Command::Doctor => None,
        Command::Completions { .. } | Command::Man { .. } => None,
    };
    // Images are loaded on it, so that -t bounds that, too.
    let started = machine::start_pool(threads.map_or(0, |n| n as usize));
    started.map_err(|e| Error::Option { option: "--threads", problem: e.to_string() })?;
    match &cli.command {
        Command::Render(args) if args.sequence.is_on() => sequence::run(args),
        Command::Render(args) => render::run(args),
        Command::Info(args) => info::run(args),
        Command::Compare(args) => compare::run(args),
        Command::Verify(args) => verify::run(args),
        Command::Bench(args) => bench::run(args),
        Command::Accuracy(args) => accuracy::run(args),
        Command::Merge(args) => merge::run(args),
        Command::View(args) => view::run(args),
        Command::Farm(args) => {
            Cli::check(args.words())?;
            farm::run(args)
        }
        Command::Doctor => doctor::run(),
        Command::Completions { shell } => pages::completions(*shell),
        Command::Man { folder } => pages::manual(folder),
    }
}
