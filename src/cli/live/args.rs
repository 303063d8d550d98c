//! Flags of renders that are seen while they run.

use std::path::PathBuf;
use std::time::Duration;

use clap::Args;

use crate::cli::units;

/// Where the page is served unless told otherwise.
pub const DEFAULT_ADDRESS: &str = "127.0.0.1:8707";

/// Who sees a render while it runs.
#[derive(Debug, Default, Args)]
pub struct LiveArgs {
    /// Write the picture so far to this file, after the first pass and then again and again
    #[arg(long, value_name = "F.png", help_heading = "While it runs")]
    pub preview: Option<PathBuf>,
    /// How often --preview writes, at most: 5s, 1m
    #[arg(
        long, value_name = "DURATION", default_value = "5s", requires = "preview", value_parser = units::duration,
        help_heading = "While it runs"
    )]
    pub every: Duration,
    /// Serve a page that shows the render as it gets better, at 127.0.0.1:8707 or at ADDR, until it ends
    #[arg(
        long, value_name = "ADDR", num_args = 0..=1, require_equals = true, default_missing_value = DEFAULT_ADDRESS,
        help_heading = "While it runs"
    )]
    pub serve: Option<String>,
    /// Let --serve listen where other machines can reach it; the page is then opened by a secret in its address
    #[arg(long, requires = "serve", help_heading = "While it runs")]
    pub serve_anywhere: bool,
    /// Show the render in tev, the image viewer, which listens at 127.0.0.1:14158
    #[arg(long, value_name = "HOST:PORT", help_heading = "While it runs")]
    pub display_server: Option<String>,
}
