//! The `jetsam` command: arguments in, exit status out. Each command has a file of its own.
//!
//! Exit status: 0 fine, 1 the run went wrong, 2 the input is wrong. Messages go to stderr, data to stdout.
#![forbid(unsafe_code)]

mod args;
mod bench;
mod check;
mod devices;
mod drawing;
mod output;
mod run;
mod scenes;
mod schema;
mod shell;
mod solvers;
mod terminal;
mod validate;
mod view;
mod voxelize;

use args::{Args, Command};
use clap::Parser;
use std::process::ExitCode;

/// Counts what is allocated, for `bench`.
#[global_allocator]
static MEMORY: peak_alloc::PeakAlloc = peak_alloc::PeakAlloc;

/// How a command that understood its input ended.
enum Outcome {
    Fine,
    WentWrong,
}

fn main() -> ExitCode {
    let done = match Args::parse().command.unwrap_or_else(|| Command::default_scene(view::has_display())) {
        Command::Run(run) => run::run(&run),
        Command::View(view) => view::view(view),
        Command::Check(check) => check::check(&check),
        Command::Voxelize(voxelize) => voxelize::voxelize(&voxelize),
        Command::Bench(bench) => bench::bench(&bench),
        Command::Validate(validate) => validate::validate(&validate),
        Command::Scenes(scenes) => scenes::scenes(&scenes),
        Command::Devices(devices) => devices::devices(&devices),
        Command::Schema => schema::schema(),
        Command::Completions { shell } => shell::completions(shell),
        Command::Man => shell::man(),
    };
    match done {
        Ok(Outcome::Fine) => ExitCode::SUCCESS,
        Ok(Outcome::WentWrong) => ExitCode::from(1),
        Err(report) => {
            terminal::complain(&report);
            ExitCode::from(2)
        }
    }
}
