//! `freelux`: words and files around the renderer. Each subcommand is one file and one call into the libraries.

mod args;
mod chart;
mod compare;
mod encode;
mod explain;
mod failure;
mod files;
mod info;
mod machine;
mod mesh;
mod ply;
mod progress;
mod render;
mod summary;
mod view;

use std::process::ExitCode;

use clap::Parser;
use clap::error::ErrorKind;

use crate::failure::{Failure, print};

/// Renders scenes with global illumination by caching and reprojecting radiance.
///
/// Exit codes: 0 done; 1 failed while running, or `compare` found more than its limit; 2 wrong input or arguments;
/// 130 or 143 interrupted.
#[derive(Debug, Parser)]
#[command(name = "freelux", version, max_term_width = 100, arg_required_else_help = false)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, clap::Subcommand)]
enum Command {
    Render(render::RenderArgs),
    Compare(compare::CompareArgs),
    Info(info::InfoArgs),
    Chart(chart::ChartArgs),
    Mesh(mesh::MeshArgs),
    Explain(explain::ExplainArgs),
}

/// Lets an interrupted program remove what is not finished. Its exit code is 128 and the number of the signal, as
/// shells have it. Where there can be no handler the system ends the program, which is no worse than before.
#[cfg(unix)]
fn handle_signals() {
    use signal_hook::consts::{SIGINT, SIGTERM};
    let Ok(mut signals) = signal_hook::iterator::Signals::new([SIGINT, SIGTERM]) else { return };
    std::thread::spawn(move || {
        if let Some(signal) = signals.forever().next() {
            files::abandon(128 + signal)
        }
    });
}

#[cfg(not(unix))]
fn handle_signals() {
    let _ = ctrlc::set_handler(|| files::abandon(130));
}

fn main() -> ExitCode {
    handle_signals();
    let result = match Cli::try_parse() {
        Ok(cli) => match &cli.command {
            Command::Render(args) => render::run(args),
            Command::Compare(args) => compare::run(args),
            Command::Info(args) => info::run(args),
            Command::Chart(args) => chart::run(args),
            Command::Mesh(args) => mesh::run(args),
            Command::Explain(args) => explain::run(args),
        },
        Err(error) => answer(&error),
    };
    result.unwrap_or_else(|failure| failure.report())
}

/// Prints help or the version where that was asked for; other errors of the arguments become one line.
fn answer(error: &clap::Error) -> Result<ExitCode, Failure> {
    let text = error.render().to_string();
    if matches!(error.kind(), ErrorKind::DisplayHelp | ErrorKind::DisplayVersion) {
        print(&text)?;
        return Ok(ExitCode::SUCCESS);
    }
    let lines =
        text.lines().take_while(|line| !line.starts_with("Usage:") && !line.starts_with("For more information"));
    let words: Vec<&str> = lines.map(str::trim).filter(|line| !line.is_empty()).collect();
    let line = words.join(" ");
    let line = line.strip_prefix("error: ").unwrap_or(&line);
    Err(Failure::Input(format!("{line}; see freelux --help")))
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;

    #[test]
    fn the_definition_of_the_arguments_is_consistent() {
        Cli::command().debug_assert();
    }
}
