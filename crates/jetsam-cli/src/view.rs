//! `jetsam view`: a scene in a window.

use crate::Outcome;
use crate::args::View;

/// Whether a window can be opened.
pub fn has_display() -> bool {
    #[cfg(feature = "window")]
    return jetsam_view::window::has_display();
    #[cfg(not(feature = "window"))]
    return false;
}

/// Opens the window; returns when it is closed.
#[cfg(feature = "window")]
pub fn view(args: View) -> miette::Result<Outcome> {
    use std::path::Path;
    crate::run::set_threads(args.threads)?;
    let scene = args.input.open()?;
    let name = Path::new(&args.input.scene).file_stem().map(|s| s.to_string_lossy().into_owned());
    let options = jetsam_view::window::Options {
        name: name.unwrap_or(args.input.scene),
        scene,
        playing: !args.paused,
        backend: args.backend.into(),
        style: args.style.style()?,
    };
    jetsam_view::window::open(options)?;
    Ok(Outcome::Fine)
}

/// Says that there are no windows.
#[cfg(not(feature = "window"))]
pub fn view(_: View) -> miette::Result<Outcome> {
    Err(miette::miette!(
        help = "build it with the feature `window`, which is on by default, or use `jetsam run`",
        "this program was built without windows"
    ))
}
