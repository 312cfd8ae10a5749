//! What the user reads: data to stdout, messages to stderr, errors with their remedy.

use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;
use std::io::{IsTerminal, Write};

/// Prints data. A reader that has gone away (`jetsam schema | head`) is no error.
pub fn print(text: &str) {
    let mut out = std::io::stdout().lock();
    let _ = writeln!(out, "{text}").and_then(|()| out.flush());
}

/// Prints one JSON object on a line.
pub fn print_json(value: &impl Serialize) {
    print(&serde_json::to_string(value).expect("reports hold nothing JSON cannot say"));
}

/// A message.
pub fn say(text: &str) {
    let _ = writeln!(std::io::stderr(), "{text}");
}

/// An error: with the place marked on a terminal, in plain lines elsewhere.
pub fn complain(report: &miette::Report) {
    if std::io::stderr().is_terminal() {
        return say(&format!("{report:?}"));
    }
    say(&format!("error: {report}"));
    if let Some(help) = report.help() {
        say(&format!("help: {help}"));
    }
}

/// A progress bar on a terminal, nothing elsewhere.
pub fn progress(length: u64, what: &str) -> ProgressBar {
    if !std::io::stderr().is_terminal() {
        return ProgressBar::hidden();
    }
    let style = ProgressStyle::with_template("{prefix} {wide_bar} {pos}/{len} {msg} eta {eta}")
        .expect("the template is well-formed");
    ProgressBar::new(length).with_style(style).with_prefix(what.to_owned())
}

/// Lines of two columns.
pub fn table(rows: &[(&str, String)]) -> String {
    let width = rows.iter().map(|r| r.0.len()).max().unwrap_or(0);
    let lines: Vec<String> = rows.iter().map(|(name, value)| format!("{name:width$}  {value}")).collect();
    lines.join("\n")
}

/// A step length in the unit that suits it.
pub fn seconds(s: f64) -> String {
    match s {
        s if s >= 1.0 || s == 0.0 => format!("{s:.3} s"),
        s if s >= 1e-3 => format!("{:.3} ms", 1e3 * s),
        s => format!("{:.3} us", 1e6 * s),
    }
}
