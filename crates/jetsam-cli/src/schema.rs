//! `jetsam schema`: what a scene file may hold.

use crate::Outcome;
use crate::terminal::print;

/// Prints the JSON schema of the scene file.
pub fn schema() -> miette::Result<Outcome> {
    print(&serde_json::to_string_pretty(&jetsam::scene::schema()).expect("a schema is plain JSON"));
    Ok(Outcome::Fine)
}
