//! What the user sees while waiting: a bar on a terminal, one line a phase elsewhere, nothing when quiet. All of it
//! goes to stderr.

use std::io::{IsTerminal, Write, stderr};
use std::sync::{Mutex, PoisonError};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use integrator::Progress;

use crate::failure::note;

/// Steps of the bar.
const STEPS: u64 = 1000;

/// Where progress goes.
#[derive(Debug)]
pub(crate) enum Reporter {
    /// Nowhere.
    Quiet,
    /// One line when a phase begins; holds the names of those that have.
    Lines(Mutex<Vec<&'static str>>),
    /// A bar that is redrawn in place; holds the name of the present phase.
    Bar(ProgressBar, Mutex<&'static str>),
}

impl Reporter {
    /// A bar where stderr is a terminal that can redraw, else lines.
    pub(crate) fn new(quiet: bool) -> Self {
        let dumb = std::env::var_os("TERM").is_some_and(|term| term == "dumb");
        if quiet {
            Self::Quiet
        } else if stderr().is_terminal() && !dumb {
            let style = ProgressStyle::with_template("{prefix:>12} [{bar:40}] {percent:>3} %  {eta} left")
                .expect("the template is right")
                .progress_chars("=> ");
            let bar = ProgressBar::with_draw_target(Some(STEPS), ProgressDrawTarget::stderr());
            Self::Bar(bar.with_style(style), Mutex::default())
        } else {
            Self::Lines(Mutex::default())
        }
    }

    /// Shows how far the work is; may be called from any thread.
    pub(crate) fn update(&self, progress: Progress) {
        match self {
            Self::Quiet => {}
            Self::Lines(begun) => {
                let mut begun = begun.lock().unwrap_or_else(PoisonError::into_inner);
                if !begun.contains(&progress.phase) {
                    begun.push(progress.phase);
                    note(progress.phase);
                }
            }
            Self::Bar(bar, phase) => {
                let mut phase = phase.lock().unwrap_or_else(PoisonError::into_inner);
                if *phase != progress.phase {
                    *phase = progress.phase;
                    bar.set_prefix(progress.phase);
                    bar.reset();
                }
                drop(phase);
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "a clamped share of the steps"
                )]
                bar.set_position((progress.done.clamp(0.0, 1.0) * STEPS as f32) as u64);
            }
        }
    }

    /// Tells something beside the bar, such as a warning.
    pub(crate) fn note(&self, message: &str) {
        match self {
            Self::Quiet => {}
            Self::Lines(_) => note(message),
            Self::Bar(bar, _) => bar.suspend(|| note(message)),
        }
    }

    /// Writes a line of the summary as it is.
    pub(crate) fn line(&self, line: &str) {
        if !matches!(self, Self::Quiet) {
            // Nobody is left to be told when stderr is closed.
            let _ = writeln!(stderr(), "{line}");
        }
    }

    /// Removes the bar.
    pub(crate) fn finish(&self) {
        if let Self::Bar(bar, _) = self {
            bar.finish_and_clear();
        }
    }
}
