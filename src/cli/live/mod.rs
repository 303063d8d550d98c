//! A render that is seen while it runs: the page (`--serve`, `pathspace view`), a file that is written again and again
//! (`--preview`), and tev (`--display-server`). All are shown the film between passes, while the render's clock is
//! paused, and may take one percent of its time; what hangs or is gone is left behind, never waited for.
//!
//! `args` are the flags, `frame` is what is shown, `layers` what else can be, `http` the server and its clients, `page`
//! what they share with the render, `watch` all of it as the render sees it.

pub mod args;
pub mod frame;
mod http;
pub mod layers;
pub mod page;
mod tev;
pub mod watch;
