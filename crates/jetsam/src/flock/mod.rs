//! Flocks (E22-E28): agents that perceive each other, steer, keep clear of fluids and bodies, and push what they meet.
//!
//! In: the state's [`Agents`](crate::state::Agents), and the particles for what is met. Out: agents moved and decided anew, and forces
//! on the particles. [`Crowd::run`] is the stage `agents`; [`crate::backend::Cpu`] calls it between the particles' forces and
//! their sum over bodies.
//!
//! | file | what it does |
//! |---|---|
//! | model | constants of a flock, derived from the scene |
//! | motion | agents move, and stay in the domain and out of bodies |
//! | coupling | agents of mass push fluids and bodies, and are pushed (E27, E28) |
//! | perception | agents sorted into cells; those around a cell, packed |
//! | sums | what an agent perceives: sums over its neighbours, sixteen at a time |
//! | nearest | topological neighbours (E25) |
//! | decide | what an agent does about it: steering or a new direction (E22-E24, E26) |
//! | obstacles | bodies ahead, and bodies touched |
//! | order | polarization, milling, fragments |
//!
//! Agents decide every `tau` and move every step: a step ends where a decision is due. Reynolds' agents decide every step.

mod coupling;
mod decide;
mod model;
mod motion;
mod nearest;
mod obstacles;
mod order;
mod perception;
mod stage;
mod sums;

pub use decide::unit_vector;
pub use model::{FlockConstants, Limits, Matter, Weights, name};
pub use order::{Order, neighbours};
pub use stage::{Crowd, World as Surroundings};
