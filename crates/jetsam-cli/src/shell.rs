//! `jetsam completions` and `jetsam man`: made from the arguments themselves.

use crate::Outcome;
use crate::args::Args;
use crate::terminal::print;
use clap::CommandFactory;

/// Prints completions for a shell.
pub fn completions(shell: clap_complete::Shell) -> miette::Result<Outcome> {
    let mut text = Vec::new();
    clap_complete::generate(shell, &mut Args::command(), "jetsam", &mut text);
    print(&String::from_utf8_lossy(&text));
    Ok(Outcome::Fine)
}

/// Prints the man page.
pub fn man() -> miette::Result<Outcome> {
    let mut text = Vec::new();
    clap_mangen::Man::new(Args::command()).render(&mut text).expect("writing to memory");
    print(&String::from_utf8_lossy(&text));
    Ok(Outcome::Fine)
}
