//! stub
use crate::{Outcome, args};
/// stub
pub fn voxelize(_: &args::Voxelize) -> miette::Result<Outcome> { Ok(Outcome::Fine) }
