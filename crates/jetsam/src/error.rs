//! Errors at the edges: what the user gave is wrong, said with place and remedy. Inside a step there are none,
//! only counters in [`crate::StepReport`].

use miette::{Diagnostic, NamedSource, SourceSpan};
use thiserror::Error;

/// What can be wrong with the input.
#[derive(Debug, Error, Diagnostic)]
pub enum Error {
    /// The scene, or what it refers to, is wrong.
    #[error("{place}{message}")]
    Scene {
        /// `file:line: ` where known, else empty.
        place: String,
        /// What is wrong.
        message: String,
        /// What to do about it.
        #[help]
        help: String,
        /// The file, for display.
        #[source_code]
        source_code: Option<NamedSource<String>>,
        /// Where in the file.
        #[label("here")]
        span: Option<SourceSpan>,
    },
    /// A file cannot be read or written.
    #[error("{path}: {source}")]
    #[diagnostic(help("check the path and its permissions"))]
    Io {
        /// The file.
        path: String,
        /// What the system says.
        source: std::io::Error,
    },
}

/// Result with [`enum@Error`], boxed to keep it small.
pub type Result<T> = std::result::Result<T, Box<Error>>;
