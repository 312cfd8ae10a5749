//! Pictures of jetsam worlds.
